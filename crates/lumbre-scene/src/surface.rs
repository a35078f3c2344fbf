//! The surface data of the tree's geometries: materials and vertex attributes.

use std::sync::Arc;

use lumbre_geometry::{Curves, Surface};
use lumbre_kernel::{DeformingMesh, PreciseMesh, TriangleMesh};
use lumbre_math::{DVec2, DVec3, Transform, Vec2, Vec3, Vec4};
use lumbre_shading::{FloatTexture, LocalSurface, Material, Spectrum, TextureContext, VertexData};

use crate::seams::Pieces;
use crate::{Boundary, ColouredShape, Emission, Footprint, LightId, MaterialId, MeshDesc};

/// The surface data for one id of the tree.
#[derive(Clone, Debug)]
pub(crate) struct SurfaceEntry {
    /// [`crate::ShapeDesc::index`].
    pub shape: u32,
    /// `None` for an interface, which shadow rays ignore.
    pub material: Option<Arc<Material>>,
    /// The same for all surfaces that have this material.
    pub material_id: MaterialId,
    pub emission: Option<Emission>,
    /// The light that samples it; `None` if only rays that hit it find its light.
    pub light: Option<LightId>,
    pub alpha: Option<Arc<FloatTexture>>,
    /// The media on its sides, if they differ.
    pub boundary: Option<Boundary>,
    pub reverse: bool,
    /// Whether the material has textures, and needs footprints.
    pub is_textured: bool,
    /// Whether it stops all light by POV-Ray's rules: [`lumbre_shading::pov::PovMaterial::stops_light`].
    pub stops_pov_light: bool,
    pub form: Form,
}

/// A CSG with the surface entry of each leaf.
#[derive(Clone, Debug)]
pub(crate) struct CsgForm {
    pub csg: lumbre_geometry::Csg,
    /// In the order of the leaves.
    pub leaves: Vec<SurfaceEntry>,
}

impl CsgForm {
    /// The leaf that a root lies on.
    pub(crate) fn leaf(
        &self,
        root: &lumbre_geometry::Root,
    ) -> Option<(&SurfaceEntry, lumbre_geometry::LeafPart)> {
        let part = self.csg.leaf_of(root)?;
        Some((self.leaves.get(part.leaf)?, part))
    }
}

impl SurfaceEntry {
    /// The index of a part of it in results: the triangle of a mesh, otherwise 0.
    pub(crate) fn primitive(&self, part: u32) -> u32 {
        match self.form {
            Form::Patch { primitive, .. } => primitive,
            Form::Mesh(_) | Form::Custom => part,
            Form::Curves(ref curves, _) => curves.segment_of(part),
            Form::Exact | Form::Coloured(_) | Form::Csg(_) => 0,
        }
    }

    /// The part that has a place in a part that rays meet, and where in it: of triangles that were split, the whole.
    #[inline]
    pub(crate) fn whole(&self, part: u32, local: DVec2) -> (u32, DVec2) {
        match &self.form {
            Form::Mesh(mesh) => {
                mesh.pieces.as_ref().map_or((part, local), |pieces| pieces.whole(part, local))
            }
            _ => (part, local),
        }
    }
}

/// The vertex attributes of a geometry.
#[derive(Clone, Debug)]
pub(crate) enum Form {
    /// None: the surface is geometric.
    Exact,
    /// Colours only.
    Coloured(Box<ColourRamp>),
    /// A triangle mesh.
    Mesh(Arc<MeshAttributes>),
    /// A patch of a mesh, from a quad that is not flat.
    Patch { attributes: Arc<MeshAttributes>, corners: [u32; 4], primitive: u32 },
    /// None; a segment of curves, which are placed by a map.
    Curves(Arc<Curves>, Box<Transform>),
    /// None; one of many primitives.
    Custom,
    /// A CSG: the surface data of each leaf.
    Csg(Arc<CsgForm>),
}

/// A colour interpolated between two points, in the space of a tree.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ColourRamp {
    start: DVec3,
    /// The gradient of the interpolation parameter.
    slope: DVec3,
    colours: [Spectrum; 2],
    coverages: [f32; 2],
}

/// The vertex attributes of a mesh, in the space of its tree.
#[derive(Clone, Debug, Default)]
pub(crate) struct MeshAttributes {
    pub mesh: Arc<TriangleMesh>,
    /// Whether faces are reversed from the file, because the mesh was baked through a mirror.
    pub swapped: bool,
    /// From this triangle on, pairs of triangles are halves of a quad.
    pub first_half: u32,
    /// Attributes changed by the transform, if any; the others are in `rest`.
    pub turned: Option<Box<Turned>>,
    /// Its deformation, if any.
    pub moving: Option<Box<Deforming>>,
    /// The mesh that rays meet instead of `mesh`, if vertices are given in double precision.
    pub precise: Option<Arc<PreciseMesh>>,
    /// The parts of triangles that were split, if any: rays meet the triangles of `mesh`.
    pub pieces: Option<Box<Pieces>>,
    /// The description, which may be shared, without the parts that were moved into the mesh.
    pub rest: Arc<MeshDesc>,
}

/// A deforming mesh, in the space of its tree.
#[derive(Clone, Debug)]
pub(crate) struct Deforming {
    pub mesh: Arc<DeformingMesh>,
    /// Vertex normals, by key.
    pub normals: Option<Vec<Vec<Vec3>>>,
}

/// Vertex directions, transformed into the space of a tree.
#[derive(Clone, Debug, Default)]
pub(crate) struct Turned {
    pub normals: Option<Vec<Vec3>>,
    pub tangents: Option<Vec<Vec4>>,
}

/// A surface with its interpolated vertex attributes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShadingGeometry {
    /// The surface, its normal pointing outside, with the uv and derivatives of textures.
    pub surface: Surface,
    pub shading: LocalSurface,
    /// Further vertex data, with derivatives by u and v instead of pixels.
    pub vertex: VertexData,
}

/// Interpolation over the three or four corners of a face, as a function of the face's own coordinates.
struct Blend<const N: usize> {
    weights: [f64; N],
    /// The derivatives of the weights by the face's two coordinates.
    along: [[f64; N]; 2],
}

impl<const N: usize> Blend<N> {
    #[inline]
    fn value(&self, corners: [DVec3; N]) -> DVec3 {
        weighted(&self.weights, &corners)
    }

    #[inline]
    fn slopes(&self, corners: [DVec3; N]) -> [DVec3; 2] {
        [weighted(&self.along[0], &corners), weighted(&self.along[1], &corners)]
    }
}

#[inline]
fn weighted<const N: usize>(weights: &[f64; N], corners: &[DVec3; N]) -> DVec3 {
    let mut sum = weights[0] * corners[0];
    for i in 1..N {
        sum += weights[i] * corners[i];
    }
    sum
}

/// A list's values at some corners. (`map` on an array is not inlined here.)
#[inline]
fn at<T: Copy, const N: usize>(list: &[T], corners: [u32; N]) -> [T; N] {
    std::array::from_fn(|i| list[corners[i] as usize])
}

fn triangle_blend(b: DVec2) -> Blend<3> {
    Blend { weights: [1.0 - b.x - b.y, b.x, b.y], along: [[-1.0, 1.0, 0.0], [-1.0, 0.0, 1.0]] }
}

/// Corners in the order p00, p10, p01, p11.
fn patch_blend(uv: DVec2) -> Blend<4> {
    let (u, v) = (uv.x, uv.y);
    Blend {
        weights: [(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v],
        along: [[v - 1.0, 1.0 - v, -v, v], [u - 1.0, -u, 1.0 - u, u]],
    }
}

impl SurfaceEntry {
    /// Whether shadow rays meet it: an interface only separates media.
    pub(crate) fn is_visible(&self) -> bool {
        self.material.is_some()
    }

    /// Whether it emits light.
    pub(crate) fn is_emissive(&self) -> bool {
        match &self.form {
            Form::Csg(csg) => csg.leaves.iter().any(Self::is_emissive),
            _ => self.emission.is_some(),
        }
    }

    /// Its emission, if that is uniform: without textures and cut-outs.
    pub(crate) fn uniform_emission(&self) -> Option<&Emission> {
        let emission = self.emission.as_ref()?;
        (self.alpha.is_none() && emission.image.is_none() && !emission.by_vertices).then_some(emission)
    }

    /// 1 if it faces as its geometry does, or −1 if flipped; `None` if vertex normals flip a part of a triangle.
    pub(crate) fn outward(&self, triangle: u32) -> Option<f64> {
        let outward = match &self.form {
            Form::Exact | Form::Coloured(_) | Form::Curves(..) | Form::Custom => 1.0,
            Form::Mesh(mesh) => mesh.outward(triangle)?,
            Form::Patch { .. } | Form::Csg(_) => return None,
        };
        Some(if self.reverse { -outward } else { outward })
    }

    /// Whether any part of it has textures.
    pub(crate) fn looks_up_anywhere(&self) -> bool {
        match &self.form {
            Form::Csg(csg) => self.is_textured || csg.leaves.iter().any(Self::looks_up_anywhere),
            _ => self.is_textured,
        }
    }

    /// Whether a camera looks through its back.
    pub(crate) fn is_one_sided(&self) -> bool {
        self.material.as_ref().is_some_and(|material| material.one_sided)
    }

    /// Whether any part of it is one-sided.
    pub(crate) fn is_one_sided_anywhere(&self) -> bool {
        match &self.form {
            Form::Csg(csg) => csg.leaves.iter().any(Self::is_one_sided_anywhere),
            _ => self.is_one_sided(),
        }
    }

    /// Whether any part of it transmits light.
    pub(crate) fn is_transmissive(&self) -> bool {
        match &self.form {
            Form::Csg(csg) => csg.leaves.iter().any(Self::is_transmissive),
            _ => self.material.as_ref().is_some_and(|material| material.is_transmissive()),
        }
    }

    /// Whether any part of it transmits light straight on.
    pub(crate) fn has_delta_transmission(&self) -> bool {
        match &self.form {
            Form::Csg(csg) => csg.leaves.iter().any(Self::has_delta_transmission),
            _ => self.material.as_ref().is_some_and(|material| material.has_delta_transmission()),
        }
    }

    /// Whether any part of it may enclose a solid that light passes through.
    pub(crate) fn may_be_solid(&self) -> bool {
        match &self.form {
            Form::Csg(csg) => csg.leaves.iter().any(Self::may_be_solid),
            _ => self.material.as_ref().is_some_and(|material| material.may_be_solid()),
        }
    }

    /// Whether its material, or a part of it, has an index of refraction that depends on the wavelength.
    pub(crate) fn disperses(&self) -> bool {
        match &self.form {
            Form::Csg(csg) => csg.leaves.iter().any(Self::disperses),
            _ => self.material.as_ref().is_some_and(|material| material.has_dispersion()),
        }
    }

    /// Whether all of it stops light by POV-Ray's rules.
    pub(crate) fn stops_pov_light_everywhere(&self) -> bool {
        match &self.form {
            Form::Csg(csg) => csg.leaves.iter().all(Self::stops_pov_light_everywhere),
            _ => self.stops_pov_light,
        }
    }

    /// Whether light may pass any part of it.
    pub(crate) fn has_cutouts(&self) -> bool {
        match &self.form {
            Form::Csg(csg) => csg.leaves.iter().any(Self::has_cutouts),
            _ => self.alpha.is_some() || !self.is_visible(),
        }
    }

    /// Adds the vertex attributes to a geometric surface of the tree at a time. `local` are the coordinates in
    /// its face; `placement` maps the space of the mesh to that of `surface`.
    pub(crate) fn shading_geometry(
        &self,
        surface: &Surface,
        primitive: u32,
        local: DVec2,
        placement: Option<&Transform>,
        time: f64,
    ) -> ShadingGeometry {
        let mut shaded = match &self.form {
            Form::Exact | Form::Curves(..) | Form::Custom | Form::Csg(_) => plain(surface),
            Form::Coloured(ramp) => {
                ShadingGeometry { vertex: ramp.at(surface.point, placement), ..plain(surface) }
            }
            Form::Mesh(mesh) => {
                let corners = mesh.corners(primitive);
                let uvs = mesh.corner_uvs(primitive);
                mesh.shading_geometry(surface, corners, uvs, &triangle_blend(local), placement, time)
            }
            Form::Patch { attributes, corners, .. } => {
                let uvs = match &attributes.rest.uvs {
                    Some(uvs) => at(uvs, *corners),
                    None if attributes.swapped => [Vec2::ZERO, Vec2::Y, Vec2::X, Vec2::ONE],
                    None => [Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::ONE],
                };
                attributes.shading_geometry(surface, *corners, uvs, &patch_blend(local), placement, time)
            }
        };
        if self.reverse {
            shaded.turn();
        }
        shaded
    }
}

impl SurfaceEntry {
    /// The offset from a triangle to the smooth surface implied by its vertex normals, on the side of
    /// `towards`; `None` if that is not above the triangle.
    ///
    /// J. Hanika, "Hacking the Shadow Terminator", Ray Tracing Gems II, 2021: the tangent planes of the
    /// vertices, interpolated as the normals are, as far as they lie above the point. On a triangle of a sphere
    /// that is about twice the height of the sphere, so rays that the sphere does not occlude clear the
    /// adjacent triangles.
    pub(crate) fn terminator_offset(
        &self,
        geometric: &Surface,
        primitive: u32,
        local: DVec2,
        placement: Option<&Transform>,
        time: f64,
        towards: DVec3,
    ) -> Option<DVec3> {
        let Form::Mesh(mesh) = &self.form else { return None };
        let normals = mesh.corner_normals(mesh.corners(primitive), time)?;
        let Blend { weights, .. } = triangle_blend(local);
        let unit = |n: DVec3| placement.map_or(n, |map| map.normal(n)).normalize_or_zero();
        let normals = normals.map(unit);
        let above = if geometric.normal.dot(towards) < 0.0 { -geometric.normal } else { geometric.normal };
        let side = if weighted(&weights, &normals).dot(above) < 0.0 { -1.0 } else { 1.0 };
        // From the first corner, and from the others.
        let from_first = local.x * geometric.dpdu + local.y * geometric.dpdv;
        let ways = [from_first, from_first - geometric.dpdu, from_first - geometric.dpdv];
        let mut terminator_offset = DVec3::ZERO;
        for ((weight, normal), way) in weights.into_iter().zip(normals).zip(ways) {
            let normal = side * normal;
            // A vertex that faces away does not describe a surface on this side.
            if normal.dot(above) <= 0.0 {
                return None;
            }
            terminator_offset -= weight * way.dot(normal).min(0.0) * normal;
        }
        (terminator_offset.dot(above) > 0.0 && terminator_offset.is_finite()).then_some(terminator_offset)
    }
}

impl ShadingGeometry {
    /// The context of texture lookups, with derivatives of u and v over a pixel.
    pub(crate) fn context(&self, dpdx: Vec3, dpdy: Vec3, duv_dx: Vec2, duv_dy: Vec2) -> TextureContext {
        let vertex = over_pixel(self.vertex, duv_dx, duv_dy);
        TextureContext {
            point: self.surface.point,
            normal: self.shading.normal,
            uv: self.surface.uv.as_vec2(),
            dpdx,
            dpdy,
            duv_dx,
            duv_dy,
            vertex,
            spectral: None,
        }
    }

    /// The context of texture lookups without a footprint.
    pub(crate) fn point_context(&self) -> TextureContext {
        TextureContext {
            normal: self.surface.normal.as_vec3(),
            ..self.context(Vec3::ZERO, Vec3::ZERO, Vec2::ZERO, Vec2::ZERO)
        }
    }

    /// Flips the surface.
    pub(crate) fn turn(&mut self) {
        self.surface.normal = -self.surface.normal;
        self.surface.dndu = -self.surface.dndu;
        self.surface.dndv = -self.surface.dndv;
        self.shading.normal = -self.shading.normal;
        self.shading.geometric = -self.shading.geometric;
        self.shading.dndu = -self.shading.dndu;
        self.shading.dndv = -self.shading.dndv;
    }
}

/// From derivatives by u and v to derivatives over a pixel.
fn over_pixel(mut vertex: VertexData, duv_dx: Vec2, duv_dy: Vec2) -> VertexData {
    for place in &mut vertex.further {
        let (by_u, by_v) = (place.duv_dx, place.duv_dy);
        place.duv_dx = by_u * duv_dx.x + by_v * duv_dx.y;
        place.duv_dy = by_u * duv_dy.x + by_v * duv_dy.y;
    }
    vertex
}

fn plain(surface: &Surface) -> ShadingGeometry {
    ShadingGeometry {
        surface: *surface,
        shading: LocalSurface {
            normal: surface.normal.as_vec3(),
            dpdu: surface.dpdu.as_vec3(),
            dpdv: surface.dpdv.as_vec3(),
            dndu: surface.dndu.as_vec3(),
            dndv: surface.dndv.as_vec3(),
            geometric: surface.normal.as_vec3(),
            handedness: 1.0,
        },
        vertex: VertexData::NONE,
    }
}

/// A triangle hit, as computed in lanes.
#[derive(Clone, Copy, Debug)]
pub struct TrianglePoint<'a> {
    /// The map from the space of its mesh to the world; `None` for a top-level mesh.
    pub placement: Option<&'a Transform>,
    /// The triangle of its mesh.
    pub triangle: u32,
    /// The barycentrics of its second and third corner.
    pub local: [f32; 2],
    /// The point.
    pub point: DVec3,
    /// The unit geometric normal that points outside.
    pub geometric: Vec3,
    /// The shading normal on its side.
    pub normal: Vec3,
    /// The unit direction of the ray.
    pub direction: Vec3,
    /// The distance.
    pub distance: f32,
}

impl MeshAttributes {
    /// The texture context at a point of a static triangle, without the derivatives of its normal.
    pub(crate) fn texture_context(
        &self,
        met: &TrianglePoint<'_>,
        footprint: &Footprint,
    ) -> (TextureContext, LocalSurface) {
        let corners = self.corners(met.triangle);
        let [p0, p1, p2] = at(&self.mesh.positions, corners).map(|p| p.as_dvec3());
        let uvs = self.corner_uvs(met.triangle);
        let blend = triangle_blend(Vec2::from(met.local).as_dvec2());
        let [uv0, uv1, uv2] = uvs.map(|uv| uv.as_dvec2());
        let [w0, w1, w2] = blend.weights;
        let uv = w0 * uv0 + w1 * uv1 + w2 * uv2;
        let (along_a, along_b, by_a, by_b) = (p1 - p0, p2 - p0, uv1 - uv0, uv2 - uv0);
        let scale = 1.0 / (by_a.x * by_b.y - by_a.y * by_b.x);
        let dpdu = (along_a * by_b.y - along_b * by_a.y) * scale;
        let dpdv = (along_b * by_a.x - along_a * by_b.x) * scale;
        let has_parameters = dpdu.is_finite() && dpdv.is_finite() && dpdu.cross(dpdv).length_squared() > 0.0;
        let (dpdu, dpdv) = if has_parameters {
            (dpdu, dpdv)
        } else {
            along_a.cross(along_b).normalize_or(DVec3::Z).any_orthonormal_pair()
        };
        let (dpdu, dpdv) = match met.placement {
            None => (dpdu, dpdv),
            Some(map) => (map.vector(dpdu), map.vector(dpdv)),
        };
        let spot = footprint.on_plane(
            met.point,
            met.geometric.as_dvec3(),
            dpdu,
            dpdv,
            met.direction.as_dvec3(),
            met.distance.into(),
        );
        let mut surface = LocalSurface {
            normal: met.normal,
            dpdu: dpdu.as_vec3(),
            dpdv: dpdv.as_vec3(),
            dndu: Vec3::ZERO,
            dndv: Vec3::ZERO,
            geometric: met.geometric,
            handedness: 1.0,
        };
        self.align(&mut surface, corners, &blend, met.placement);
        let context = TextureContext {
            point: met.point,
            normal: met.normal,
            uv: uv.as_vec2(),
            dpdx: spot.dpdx,
            dpdy: spot.dpdy,
            duv_dx: spot.duv_dx,
            duv_dy: spot.duv_dy,
            vertex: over_pixel(self.vertex_data(corners, uvs, &blend), spot.duv_dx, spot.duv_dy),
            spectral: None,
        };
        (context, surface)
    }
}

impl ColourRamp {
    pub(crate) fn new(coloured: &ColouredShape, tree_from_object: &Transform) -> Self {
        let [from, to] = coloured.ends;
        let way = to - from;
        let slope = way / way.length_squared();
        Self {
            start: tree_from_object.point(from),
            // A linear function stays linear under an affine map.
            slope: if slope.is_finite() { tree_from_object.normal(slope) } else { DVec3::ZERO },
            colours: coloured.colours,
            coverages: coloured.coverages,
        }
    }

    /// The colour at a point; `placement` maps the space of the tree to that of the point.
    fn at(&self, place: DVec3, placement: Option<&Transform>) -> VertexData {
        let place = placement.map_or(place, |map| map.inverse_point(place));
        let part = self.slope.dot(place - self.start).clamp(0.0, 1.0) as f32;
        let [from, to] = self.coverages;
        VertexData {
            colour: self.colours[0].lerp(self.colours[1], part),
            coverage: from + part * (to - from),
            ..VertexData::NONE
        }
    }
}

impl MeshAttributes {
    /// The corners of a triangle, whole.
    #[inline]
    pub(crate) fn corners(&self, triangle: u32) -> [u32; 3] {
        let split = self.pieces.as_ref().and_then(|pieces| pieces.corners(triangle));
        split.unwrap_or_else(|| self.mesh.indices[triangle as usize])
    }

    /// Vertex normals.
    pub(crate) fn normals(&self) -> Option<&[Vec3]> {
        let turned = self.turned.as_ref().and_then(|turned| turned.normals.as_deref());
        turned.or(self.rest.normals.as_deref())
    }

    /// The normals of some vertices at a time.
    #[inline]
    fn corner_normals<const N: usize>(&self, corners: [u32; N], time: f64) -> Option<[DVec3; N]> {
        let Some(moving) = &self.moving else {
            let normals = at(self.normals()?, corners);
            return Some(std::array::from_fn(|i| normals[i].as_dvec3()));
        };
        let lists = moving.normals.as_ref()?;
        let (from, part) = moving.mesh.part(time);
        let [here, next] = [from, (from + 1).min(lists.len() - 1)].map(|moment| at(&lists[moment], corners));
        Some(std::array::from_fn(|i| here[i].as_dvec3().lerp(next[i].as_dvec3(), part)))
    }

    /// 1 if vertex normals face as the triangle does, or −1 if all face the other way; `None` if they do not agree.
    fn outward(&self, triangle: u32) -> Option<f64> {
        let Some(normals) = self.normals() else { return Some(1.0) };
        let corners = self.corners(triangle);
        let [a, b, c] = at(&self.mesh.positions, corners).map(|p| p.as_dvec3());
        let face = (b - a).cross(c - a);
        let sides = at(normals, corners).map(|normal| normal.as_dvec3().dot(face));
        let all = |sign: f64| sides.iter().all(|side| sign * side > 0.0);
        [1.0, -1.0].into_iter().find(|&sign| all(sign))
    }

    /// The uv of a triangle's corners.
    pub(crate) fn corner_uvs(&self, triangle: u32) -> [Vec2; 3] {
        match &self.rest.uvs {
            Some(uvs) => at(uvs, self.corners(triangle)),
            None => self.default_uvs(triangle),
        }
    }

    /// The vertex colours of a triangle, if it has any.
    pub(crate) fn corner_colours(&self, triangle: u32) -> Option<[Spectrum; 3]> {
        self.rest.colours.as_ref().map(|colours| at(colours, self.corners(triangle)))
    }

    /// Vertex tangents, with the sides of the bitangents.
    fn tangents(&self) -> Option<&[Vec4]> {
        let turned = self.turned.as_ref().and_then(|turned| turned.tangents.as_deref());
        turned.or(self.rest.tangents.as_deref())
    }

    /// pbrt's default uv of triangles: (0, 0), (1, 0), (1, 1); for halves of a quad, those of the quad.
    fn default_uvs(&self, triangle: u32) -> [Vec2; 3] {
        let second_half = triangle >= self.first_half && (triangle - self.first_half) % 2 == 1;
        let [a, b, c] =
            if second_half { [Vec2::ZERO, Vec2::ONE, Vec2::Y] } else { [Vec2::ZERO, Vec2::X, Vec2::ONE] };
        if self.swapped { [a, c, b] } else { [a, b, c] }
    }

    /// Interpolates the vertex attributes over a geometric surface.
    fn shading_geometry<const N: usize>(
        &self,
        geometric: &Surface,
        corners: [u32; N],
        uvs: [Vec2; N],
        blend: &Blend<N>,
        placement: Option<&Transform>,
        time: f64,
    ) -> ShadingGeometry {
        let vertex = self.vertex_data(corners, uvs, blend);
        ShadingGeometry { vertex, ..self.shape(geometric, corners, uvs, blend, placement, time) }
    }

    /// Interpolates the vertex data that textures read, except the first uv.
    fn vertex_data<const N: usize>(&self, corners: [u32; N], uvs: [Vec2; N], blend: &Blend<N>) -> VertexData {
        let mut vertex = VertexData::NONE;
        if let Some(colours) = &self.rest.colours {
            let colour = blend.value(corners.map(|i| {
                let Spectrum { r, g, b } = colours[i as usize];
                Vec3::new(r, g, b).as_dvec3()
            }));
            vertex.colour = Spectrum::new(colour.x as f32, colour.y as f32, colour.z as f32);
        }
        if let Some(coverages) = &self.rest.coverages {
            let coverages = corners.map(|i| DVec3::splat(f64::from(coverages[i as usize])));
            vertex.coverage = blend.value(coverages).x as f32;
        }
        for (list, place) in self.rest.further_uvs.iter().zip(&mut vertex.further) {
            let Some(list) = list else { continue };
            let flat = |uv: Vec2| uv.as_dvec2().extend(0.0);
            let further = corners.map(|i| flat(list[i as usize]));
            place.uv = blend.value(further).truncate().as_vec2();
            // From derivatives by face coordinates to derivatives by uv.
            let [by_a, by_b] = blend.slopes(uvs.map(flat));
            let [further_a, further_b] = blend.slopes(further);
            let determinant = by_a.x * by_b.y - by_a.y * by_b.x;
            let by_u = ((further_a * by_b.y - further_b * by_a.y) / determinant).truncate().as_vec2();
            let by_v = ((further_b * by_a.x - further_a * by_b.x) / determinant).truncate().as_vec2();
            if by_u.is_finite() && by_v.is_finite() {
                (place.duv_dx, place.duv_dy) = (by_u, by_v);
            }
        }
        vertex
    }

    fn shape<const N: usize>(
        &self,
        geometric: &Surface,
        corners: [u32; N],
        uvs: [Vec2; N],
        blend: &Blend<N>,
        placement: Option<&Transform>,
        time: f64,
    ) -> ShadingGeometry {
        let mut surface = *geometric;
        let uvs = std::array::from_fn(|i| DVec3::new(f64::from(uvs[i].x), f64::from(uvs[i].y), 0.0));
        let uv = blend.value(uvs);
        surface.uv = DVec2::new(uv.x, uv.y);

        // From derivatives by face coordinates to derivatives by uv.
        let [by_a, by_b] = blend.slopes(uvs);
        let scale = 1.0 / (by_a.x * by_b.y - by_a.y * by_b.x);
        let by_uv = |along_a: DVec3, along_b: DVec3| {
            let along_u = (along_a * by_b.y - along_b * by_a.y) * scale;
            let along_v = (along_b * by_a.x - along_a * by_b.x) * scale;
            (along_u, along_v)
        };
        let (dpdu, dpdv) = by_uv(geometric.dpdu, geometric.dpdv);
        let has_parameters = dpdu.is_finite() && dpdv.is_finite() && dpdu.cross(dpdv).length_squared() > 0.0;
        (surface.dpdu, surface.dpdv) =
            if has_parameters { (dpdu, dpdv) } else { geometric.normal.any_orthonormal_pair() };
        let is_curved = geometric.dndu != DVec3::ZERO || geometric.dndv != DVec3::ZERO;
        (surface.dndu, surface.dndv) = if has_parameters && is_curved {
            by_uv(geometric.dndu, geometric.dndv)
        } else {
            (DVec3::ZERO, DVec3::ZERO)
        };

        let Some(normals) = self.corner_normals(corners, time) else {
            let mut shaded = plain(&surface);
            self.align(&mut shaded.shading, corners, blend, placement);
            return shaded;
        };
        let moved = |n: DVec3| placement.map_or(n, |m| m.normal(n));
        let sum = moved(blend.value(normals));
        let length = sum.length();
        if length.is_nan() || length <= 0.0 {
            let mut shaded = plain(&surface);
            self.align(&mut shaded.shading, corners, blend, placement);
            return shaded;
        }
        let normal = sum / length;
        // Vertex normals determine the outside, as in pbrt: reversed faces are common in meshes.
        if surface.normal.dot(normal) < 0.0 {
            surface.normal = -surface.normal;
            surface.dndu = -surface.dndu;
            surface.dndv = -surface.dndv;
        }
        let mut shaded = plain(&surface);
        shaded.shading.normal = normal.as_vec3();
        let turned = |dn: DVec3| {
            let dn = moved(dn) / length;
            dn - normal * normal.dot(dn)
        };
        let [by_a, by_b] = blend.slopes(normals);
        let (dndu, dndv) =
            if has_parameters { by_uv(turned(by_a), turned(by_b)) } else { (DVec3::ZERO, DVec3::ZERO) };
        shaded.shading.dndu = dndu.as_vec3();
        shaded.shading.dndv = dndv.as_vec3();
        self.align(&mut shaded.shading, corners, blend, placement);
        shaded
    }

    /// Aligns ∂p/∂u of the shading surface with the tangents, if there are any, and puts the bitangent on its
    /// side.
    fn align<const N: usize>(
        &self,
        shading: &mut LocalSurface,
        corners: [u32; N],
        blend: &Blend<N>,
        placement: Option<&Transform>,
    ) {
        let Some(tangents) = self.tangents() else { return };
        let tangents = at(tangents, corners);
        let side: f32 = tangents.iter().map(|t| t.w).sum();
        let mirrored = placement.is_some_and(Transform::is_mirror);
        if side != 0.0 && (side < 0.0) != mirrored {
            shading.handedness = -1.0;
        }
        let tangent = blend.value(std::array::from_fn(|i| tangents[i].truncate().as_dvec3()));
        let tangent = placement.map_or(tangent, |m| m.vector(tangent)).as_vec3();
        let n = shading.normal;
        if let Some(unit) = (tangent - n * n.dot(tangent)).try_normalize() {
            shading.dpdu = unit * shading.dpdu.length();
        }
    }
}
