//! Surfaces as plain rows: what lanes read of triangles that need nothing but their corners and a row of numbers.

use std::sync::Arc;

use lumbre_kernel::TriangleMesh;
use lumbre_math::{DVec3, Vec2, Vec3};
use lumbre_shading::lanes::BsdfKind;
use lumbre_shading::{TextureContext, VertexData};

use crate::surface::{Form, SurfaceEntry};

/// Surfaces by the id of a hit, and the numbers of their BSDFs.
#[derive(Debug, Default)]
pub struct SurfaceTable {
    surfaces: Vec<Option<FlatSurface>>,
    rows: Vec<f32>,
}

/// A mesh in the world itself, still, of flat opaque faces that have one BSDF and emit the same everywhere.
#[derive(Clone, Debug)]
pub struct FlatSurface {
    /// Its triangles.
    pub mesh: Arc<TriangleMesh>,
    /// 1 where the normals of its triangles point outside, −1 where they point inside.
    pub outward: f32,
    /// The kind of its BSDF, which looks the same from everywhere around the normal.
    pub kind: BsdfKind,
    /// Where the row of its BSDF begins in [`SurfaceTable::rows`].
    pub row: u32,
    /// Whether light from below its horizon counts.
    pub transmits: bool,
    /// The radiance that it emits, and whether its back does, too.
    pub emission: Option<([f32; 3], bool)>,
}

/// A uniform material is the same everywhere.
const ANYWHERE: TextureContext = TextureContext {
    point: DVec3::ZERO,
    normal: Vec3::Z,
    uv: Vec2::ZERO,
    dpdx: Vec3::ZERO,
    dpdy: Vec3::ZERO,
    duv_dx: Vec2::ZERO,
    duv_dy: Vec2::ZERO,
    vertex: VertexData::NONE,
};

impl SurfaceTable {
    pub(crate) fn new(entries: &[SurfaceEntry]) -> Self {
        let mut table = Self::default();
        for entry in entries {
            let surface = table.flat(entry);
            table.surfaces.push(surface);
        }
        table
    }

    /// The surface with the id of a hit, if it is flat.
    #[inline]
    pub fn surface(&self, id: u32) -> Option<&FlatSurface> {
        self.surfaces.get(id as usize)?.as_ref()
    }

    /// The rows of all BSDFs, one after the other.
    pub fn rows(&self) -> &[f32] {
        &self.rows
    }

    fn flat(&mut self, entry: &SurfaceEntry) -> Option<FlatSurface> {
        let (Form::Mesh(attributes), Some(material)) = (&entry.form, &entry.material) else { return None };
        let is_flat =
            attributes.normals().is_none() && attributes.moving.is_none() && attributes.precise.is_none();
        let is_plain = entry.alpha.is_none()
            && entry.boundary.is_none()
            && material.is_uniform()
            && !material.one_sided
            && !material.may_be_solid()
            && entry
                .emission
                .as_ref()
                .is_none_or(|emission| emission.image.is_none() && !emission.by_vertices);
        if !is_flat || !is_plain {
            return None;
        }
        let bsdf = material.bsdf(&ANYWHERE)?;
        if !bsdf.is_isotropic() {
            return None;
        }
        let row = self.rows.len() as u32;
        self.rows.extend(bsdf.row());
        Some(FlatSurface {
            mesh: attributes.mesh.clone(),
            outward: if entry.reverse { -1.0 } else { 1.0 },
            kind: bsdf.kind(),
            row,
            transmits: material.lets_light_through(),
            emission: entry.emission.as_ref().map(|e| (e.radiance.to_array(), e.two_sided)),
        })
    }
}
