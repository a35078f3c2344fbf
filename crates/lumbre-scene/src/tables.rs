//! Surfaces as rows of numbers: triangle data for lanes, and the parameters of uniform BSDFs.

use std::sync::Arc;

use lumbre_kernel::TriangleMesh;
use lumbre_math::{DVec3, Vec2, Vec3};
use lumbre_shading::lanes::{BsdfKind, Rows};
use lumbre_shading::spectrum::SpectralLookup;
use lumbre_shading::{Bsdf, Material, ShadingFrame, ShadingNormals, TextureContext, VertexData};

use crate::Footprint;
use crate::surface::{Form, MeshAttributes, SurfaceEntry, TrianglePoint};

/// Surfaces by the id of a hit, and the parameters of their BSDFs.
#[derive(Debug, Default)]
pub struct SurfaceTable {
    surfaces: Vec<Option<TriangleSurface>>,
    rows: Rows,
}

/// A static mesh whose faces emit uniformly.
#[derive(Clone, Debug)]
pub struct TriangleSurface {
    /// Its triangles.
    pub mesh: Arc<TriangleMesh>,
    /// 1 if the normals of its triangles, or else of its vertices, point outside, −1 if they point inside.
    pub outward: f32,
    /// Its uniform, isotropic BSDF; `None` if the material is textured.
    pub bsdf: Option<UniformBsdf>,
    /// Whether light from below its horizon counts.
    pub transmits: bool,
    /// The radiance that it emits, and whether its back emits too.
    pub emission: Option<([f32; 3], bool)>,
    attributes: Arc<MeshAttributes>,
    material: Arc<Material>,
}

/// A uniform BSDF.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UniformBsdf {
    /// Its kind.
    pub kind: BsdfKind,
    /// Start of its row in [`SurfaceTable::rows`].
    pub row: u32,
}

/// Any point will do for a uniform material.
const ANYWHERE: TextureContext = TextureContext {
    point: DVec3::ZERO,
    normal: Vec3::Z,
    uv: Vec2::ZERO,
    dpdx: Vec3::ZERO,
    dpdy: Vec3::ZERO,
    duv_dx: Vec2::ZERO,
    duv_dy: Vec2::ZERO,
    vertex: VertexData::NONE,
    spectral: None,
};

impl SurfaceTable {
    pub(crate) fn new(entries: &[SurfaceEntry]) -> Self {
        let mut rows = Rows::default();
        // Most neighbours have the same material.
        let mut last = None;
        let surfaces = entries.iter().map(|entry| triangles(entry, &mut rows, &mut last)).collect();
        Self { surfaces, rows }
    }

    /// The surface with the id of a hit, if it is one of triangles.
    #[inline]
    pub fn surface(&self, id: u32) -> Option<&TriangleSurface> {
        self.surfaces.get(id as usize)?.as_ref()
    }

    /// The rows of all BSDFs.
    pub fn rows(&self) -> &Rows {
        &self.rows
    }
}

/// A material and its BSDF, if that is the same everywhere.
type Known<'e> = Option<(&'e Arc<Material>, Option<UniformBsdf>)>;

fn triangles<'e>(entry: &'e SurfaceEntry, rows: &mut Rows, last: &mut Known<'e>) -> Option<TriangleSurface> {
    let (Form::Mesh(attributes), Some(material)) = (&entry.form, &entry.material) else { return None };
    let is_still = attributes.moving.is_none() && attributes.precise.is_none() && attributes.pieces.is_none();
    let shines_evenly = entry
        .emission
        .as_ref()
        .is_none_or(|emission| emission.image.is_none() && !emission.by_vertices && entry.alpha.is_none());
    let is_plain = !material.may_be_solid() && !material.has_displacement() && entry.boundary.is_none();
    if !is_still || !shines_evenly || !is_plain {
        return None;
    }
    let bsdf = match last {
        Some((known, bsdf)) if Arc::ptr_eq(known, material) => *bsdf,
        _ => {
            let bsdf = uniform(material, rows);
            *last = Some((material, bsdf));
            bsdf
        }
    };
    Some(TriangleSurface {
        mesh: attributes.mesh.clone(),
        outward: if entry.reverse { -1.0 } else { 1.0 },
        bsdf,
        transmits: material.is_transmissive(),
        emission: entry.emission.as_ref().map(|e| (e.radiance.to_array(), e.two_sided)),
        attributes: attributes.clone(),
        material: material.clone(),
    })
}

/// The BSDF of a material, if that is the same everywhere.
fn uniform(material: &Material, rows: &mut Rows) -> Option<UniformBsdf> {
    let bsdf = material.is_uniform().then(|| material.bsdf(&ANYWHERE))??;
    if !bsdf.is_isotropic() {
        return None;
    }
    let row = rows.push(&bsdf);
    Some(UniformBsdf { kind: bsdf.kind(), row })
}

impl TriangleSurface {
    /// Whether there are vertex normals.
    #[inline]
    pub fn is_smooth(&self) -> bool {
        self.attributes.normals().is_some()
    }

    /// The normals of some vertices.
    #[inline]
    pub fn normals(&self, corners: [u32; 3]) -> Option<[Vec3; 3]> {
        let normals = self.attributes.normals()?;
        Some(corners.map(|corner| normals[corner as usize]))
    }

    /// The material at a point, with mixtures resolved, the shading frame and the BSDF: as
    /// [`crate::Interaction::resolved`] and [`Material::shading`]; `None` if nothing scatters. Colours are linear Rec.
    /// 709, or at the given wavelengths.
    pub fn scattering(
        &self,
        met: &TrianglePoint<'_>,
        footprint: &Footprint,
        normals: ShadingNormals,
        spectral: Option<SpectralLookup>,
    ) -> Option<(&Material, ShadingFrame, Bsdf)> {
        let (mut at, surface) = self.attributes.texture_context(met, footprint);
        at.spectral = spectral;
        let towards = -met.direction;
        let material = self.material.resolve(&at, towards);
        let (frame, bsdf) = material.shading(&at, &surface, towards, normals)?;
        Some((material, frame, bsdf))
    }
}
