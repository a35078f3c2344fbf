//! What the scene knows of a geometry of the tree: what it is made of, and how its vertices dress it.

use std::sync::Arc;

use lumbre_geometry::Surface;
use lumbre_kernel::{DeformingMesh, TriangleMesh};
use lumbre_math::{DVec2, DVec3, Transform, Vec2, Vec3, Vec4};
use lumbre_shading::{FloatTexture, FurtherUv, LocalSurface, Material, Spectrum, TextureContext, VertexData};

use crate::csg::CsgForm;
use crate::light::LightId;
use crate::{ColouredShape, Emission, MeshDesc};

/// What stands behind one id of the tree.
#[derive(Clone, Debug)]
pub(crate) struct SurfaceEntry {
    /// [`crate::ShapeDesc::index`].
    pub shape: u32,
    /// `None` for an interface, which rays of light do not see.
    pub material: Option<Arc<Material>>,
    pub emission: Option<Emission>,
    /// The light that samples it; `None` where its light is only found by rays that hit it.
    pub light: Option<LightId>,
    pub alpha: Option<Arc<FloatTexture>>,
    pub reverse: bool,
    /// Whether the material looks up textures, and needs to know how wide a spot a ray covers.
    pub looks_up: bool,
    pub form: Form,
}

/// What dresses the bare surface that the tree knows.
#[derive(Clone, Debug)]
pub(crate) enum Form {
    /// Nothing: the surface is as geometry has it.
    Exact,
    /// Colours alone.
    Coloured(Box<ColourRamp>),
    /// A triangle mesh.
    Mesh(Arc<MeshDress>),
    /// The patch of a mesh that is a quad which is not flat.
    Patch { dress: Arc<MeshDress>, corners: [u32; 4], primitive: u32 },
    /// A CSG: the surface of each leaf.
    Csg(Arc<CsgForm>),
}

/// A colour that runs from one place to another, in the space of a tree.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ColourRamp {
    start: DVec3,
    /// By how much more of the way is done a step farther.
    slope: DVec3,
    colours: [Spectrum; 2],
    coverages: [f32; 2],
}

/// What a mesh has at its vertices, in the space of the tree that it stands in.
#[derive(Clone, Debug, Default)]
pub(crate) struct MeshDress {
    pub mesh: Arc<TriangleMesh>,
    /// Whether each face runs the other way than in the file, because the mesh was baked through a mirror.
    pub swapped: bool,
    /// From this triangle on, two triangles are halves of a quad.
    pub first_half: u32,
    /// What a transform turned; else it is in `rest`.
    pub turned: Turned,
    /// Where it changes its form.
    pub moving: Option<Deforming>,
    /// The description, which others may share, without what has moved into the mesh.
    pub rest: Arc<MeshDesc>,
}

/// A mesh that changes its form, in the space of its tree.
#[derive(Clone, Debug)]
pub(crate) struct Deforming {
    pub mesh: Arc<DeformingMesh>,
    /// Normals at the vertices, moment by moment.
    pub normals: Option<Vec<Vec<Vec3>>>,
}

/// Directions at vertices, turned into the space of a tree.
#[derive(Clone, Debug, Default)]
pub(crate) struct Turned {
    pub normals: Option<Vec<Vec3>>,
    pub tangents: Option<Vec<Vec4>>,
}

/// A surface with what its vertices say of it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Dressed {
    /// The surface, its normal turned to the outside, its uv and derivatives those that textures see.
    pub surface: Surface,
    pub shading: LocalSurface,
    /// What vertices say besides; its derivatives are not by pixels, but by u and v.
    pub vertex: VertexData,
}

/// A value at three or four corners of a face, as a function of the face's own coordinates.
struct Blend<const N: usize> {
    weights: [f64; N],
    /// Derivatives of the weights by the two coordinates of the face.
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

/// What a list has at some corners. (`map` on an array is not inlined here, and showed in profiles.)
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
    /// Whether rays of light see it: an interface only parts media.
    pub(crate) fn is_visible(&self) -> bool {
        self.material.is_some()
    }

    /// Whether it gives off light.
    pub(crate) fn shines(&self) -> bool {
        match &self.form {
            Form::Csg(csg) => csg.leaves.iter().any(Self::shines),
            _ => self.emission.is_some(),
        }
    }

    /// What it gives off, with 1 where it faces as its geometry does and -1 where the other way, if that is the same all
    /// over it: without textures, without cut-outs, and without normals at vertices that might turn a face.
    pub(crate) fn plain_emission(&self) -> Option<(&Emission, f64)> {
        let is_plain = match &self.form {
            Form::Exact | Form::Coloured(_) => true,
            Form::Mesh(mesh) => mesh.normals().is_none(),
            Form::Patch { .. } | Form::Csg(_) => false,
        };
        let emission = self.emission.as_ref()?;
        (is_plain && self.alpha.is_none() && emission.image.is_none() && !emission.by_vertices)
            .then_some((emission, if self.reverse { -1.0 } else { 1.0 }))
    }

    /// Whether any part of it looks up textures.
    pub(crate) fn looks_up_anywhere(&self) -> bool {
        match &self.form {
            Form::Csg(csg) => self.looks_up || csg.leaves.iter().any(Self::looks_up_anywhere),
            _ => self.looks_up,
        }
    }

    /// Whether a camera looks through its back.
    pub(crate) fn is_one_sided(&self) -> bool {
        self.material.as_ref().is_some_and(|material| material.one_sided)
    }

    /// Whether a camera looks through the back of any part of it.
    pub(crate) fn is_one_sided_anywhere(&self) -> bool {
        match &self.form {
            Form::Csg(csg) => csg.leaves.iter().any(Self::is_one_sided_anywhere),
            _ => self.is_one_sided(),
        }
    }

    /// Whether light may go through the material of any part of it.
    pub(crate) fn lets_light_through(&self) -> bool {
        match &self.form {
            Form::Csg(csg) => csg.leaves.iter().any(Self::lets_light_through),
            _ => self.material.as_ref().is_some_and(|material| material.lets_light_through()),
        }
    }

    /// Whether light may go straight on through the material of any part of it.
    pub(crate) fn lets_light_straight_on(&self) -> bool {
        match &self.form {
            Form::Csg(csg) => csg.leaves.iter().any(Self::lets_light_straight_on),
            _ => self.material.as_ref().is_some_and(|material| material.lets_light_straight_on()),
        }
    }

    /// Whether light may pass through some of it.
    pub(crate) fn has_holes(&self) -> bool {
        match &self.form {
            Form::Csg(csg) => csg.leaves.iter().any(Self::has_holes),
            _ => self.alpha.is_some() || !self.is_visible(),
        }
    }

    /// Dresses a bare surface of the tree at a time. `local` are the coordinates of the face that it lies on, `placement` leads
    /// from the space of the mesh to that of `surface`.
    pub(crate) fn dress(
        &self,
        surface: &Surface,
        primitive: u32,
        local: DVec2,
        placement: Option<&Transform>,
        time: f64,
    ) -> Dressed {
        let mut dressed = match &self.form {
            Form::Exact | Form::Csg(_) => plain(surface),
            Form::Coloured(ramp) => Dressed { vertex: ramp.at(surface.point, placement), ..plain(surface) },
            Form::Mesh(mesh) => {
                let corners = mesh.mesh.indices[primitive as usize];
                let uvs = match &mesh.rest.uvs {
                    Some(uvs) => at(uvs, corners),
                    None => mesh.default_uvs(primitive),
                };
                mesh.dress(surface, corners, uvs, &triangle_blend(local), placement, time)
            }
            Form::Patch { dress, corners, .. } => {
                let uvs = match &dress.rest.uvs {
                    Some(uvs) => at(uvs, *corners),
                    None if dress.swapped => [Vec2::ZERO, Vec2::Y, Vec2::X, Vec2::ONE],
                    None => [Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::ONE],
                };
                dress.dress(surface, *corners, uvs, &patch_blend(local), placement, time)
            }
        };
        if self.reverse {
            dressed.turn();
        }
        dressed
    }
}

impl SurfaceEntry {
    /// How far the smooth surface that the normals of a triangle's vertices tell of stands off the triangle, on the side that
    /// `towards` leaves on; `None` where it does not.
    ///
    /// J. Hanika, "Hacking the Shadow Terminator", Ray Tracing Gems II, 2021: the planes through the vertices, across
    /// their normals, blended as the normals are, as far as they lie above the point. Over a triangle of a sphere that is
    /// about twice the height of the sphere, so that rays which the sphere would let go clear the triangles beside it.
    pub(crate) fn rise(
        &self,
        bare: &Surface,
        primitive: u32,
        local: DVec2,
        placement: Option<&Transform>,
        time: f64,
        towards: DVec3,
    ) -> Option<DVec3> {
        let Form::Mesh(mesh) = &self.form else { return None };
        let normals = mesh.corner_normals(mesh.mesh.indices[primitive as usize], time)?;
        let Blend { weights, .. } = triangle_blend(local);
        let unit = |n: DVec3| placement.map_or(n, |map| map.normal(n)).normalize_or_zero();
        let normals = normals.map(unit);
        let above = if bare.normal.dot(towards) < 0.0 { -bare.normal } else { bare.normal };
        let side = if weighted(&weights, &normals).dot(above) < 0.0 { -1.0 } else { 1.0 };
        // From the first corner, and from the others.
        let from_first = local.x * bare.dpdu + local.y * bare.dpdv;
        let ways = [from_first, from_first - bare.dpdu, from_first - bare.dpdv];
        let mut rise = DVec3::ZERO;
        for ((weight, normal), way) in weights.into_iter().zip(normals).zip(ways) {
            let normal = side * normal;
            // A vertex that looks away says nothing of a surface on this side.
            if normal.dot(above) <= 0.0 {
                return None;
            }
            rise -= weight * way.dot(normal).min(0.0) * normal;
        }
        (rise.dot(above) > 0.0 && rise.is_finite()).then_some(rise)
    }
}

impl Dressed {
    /// Where textures are looked up, with derivatives of u and v over a pixel.
    pub(crate) fn context(&self, dpdx: Vec3, dpdy: Vec3, duv_dx: Vec2, duv_dy: Vec2) -> TextureContext {
        // From derivatives by u and v to derivatives over a pixel.
        let further = self.vertex.further.map(|place| FurtherUv {
            duv_dx: place.duv_dx * duv_dx.x + place.duv_dy * duv_dx.y,
            duv_dy: place.duv_dx * duv_dy.x + place.duv_dy * duv_dy.y,
            ..place
        });
        TextureContext {
            point: self.surface.point,
            normal: self.shading.normal,
            uv: self.surface.uv.as_vec2(),
            dpdx,
            dpdy,
            duv_dx,
            duv_dy,
            vertex: VertexData { further, ..self.vertex },
        }
    }

    /// Where textures are looked up, without a footprint.
    pub(crate) fn bare_context(&self) -> TextureContext {
        TextureContext {
            normal: self.surface.normal.as_vec3(),
            ..self.context(Vec3::ZERO, Vec3::ZERO, Vec2::ZERO, Vec2::ZERO)
        }
    }

    /// Turns the inside out.
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

fn plain(surface: &Surface) -> Dressed {
    Dressed {
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

impl ColourRamp {
    pub(crate) fn new(coloured: &ColouredShape, tree_from_object: &Transform) -> Self {
        let [from, to] = coloured.ends;
        let way = to - from;
        let slope = way / way.length_squared();
        Self {
            start: tree_from_object.point(from),
            // What is even in one space is so in another.
            slope: if slope.is_finite() { tree_from_object.normal(slope) } else { DVec3::ZERO },
            colours: coloured.colours,
            coverages: coloured.coverages,
        }
    }

    /// The colour at a place, which `placement` leads to from the space of the tree.
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

impl MeshDress {
    /// Normals at the vertices.
    pub(crate) fn normals(&self) -> Option<&[Vec3]> {
        self.turned.normals.as_deref().or(self.rest.normals.as_deref())
    }

    /// Normals at some vertices at a time.
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

    /// Tangents at the vertices, with the sides of the bitangents.
    fn tangents(&self) -> Option<&[Vec4]> {
        self.turned.tangents.as_deref().or(self.rest.tangents.as_deref())
    }

    /// pbrt's parameters for triangles without any: (0, 0), (1, 0), (1, 1), and those of a quad for its halves.
    fn default_uvs(&self, triangle: u32) -> [Vec2; 3] {
        let second_half = triangle >= self.first_half && (triangle - self.first_half) % 2 == 1;
        let [a, b, c] =
            if second_half { [Vec2::ZERO, Vec2::ONE, Vec2::Y] } else { [Vec2::ZERO, Vec2::X, Vec2::ONE] };
        if self.swapped { [a, c, b] } else { [a, b, c] }
    }

    fn dress<const N: usize>(
        &self,
        bare: &Surface,
        corners: [u32; N],
        uvs: [Vec2; N],
        blend: &Blend<N>,
        placement: Option<&Transform>,
        time: f64,
    ) -> Dressed {
        let mut dressed = self.shape(bare, corners, uvs, blend, placement, time);
        if let Some(colours) = &self.rest.colours {
            let colour = blend.value(corners.map(|i| {
                let Spectrum { r, g, b } = colours[i as usize];
                Vec3::new(r, g, b).as_dvec3()
            }));
            dressed.vertex.colour = Spectrum::new(colour.x as f32, colour.y as f32, colour.z as f32);
        }
        if let Some(coverages) = &self.rest.coverages {
            let coverages = corners.map(|i| DVec3::splat(f64::from(coverages[i as usize])));
            dressed.vertex.coverage = blend.value(coverages).x as f32;
        }
        for (list, place) in self.rest.further_uvs.iter().zip(&mut dressed.vertex.further) {
            let Some(list) = list else { continue };
            let flat = |uv: Vec2| uv.as_dvec2().extend(0.0);
            let further = corners.map(|i| flat(list[i as usize]));
            place.uv = blend.value(further).truncate().as_vec2();
            // From derivatives by the coordinates of the face to derivatives by uv.
            let [by_a, by_b] = blend.slopes(uvs.map(flat));
            let [further_a, further_b] = blend.slopes(further);
            let determinant = by_a.x * by_b.y - by_a.y * by_b.x;
            let by_u = ((further_a * by_b.y - further_b * by_a.y) / determinant).truncate().as_vec2();
            let by_v = ((further_b * by_a.x - further_a * by_b.x) / determinant).truncate().as_vec2();
            if by_u.is_finite() && by_v.is_finite() {
                (place.duv_dx, place.duv_dy) = (by_u, by_v);
            }
        }
        dressed
    }

    fn shape<const N: usize>(
        &self,
        bare: &Surface,
        corners: [u32; N],
        uvs: [Vec2; N],
        blend: &Blend<N>,
        placement: Option<&Transform>,
        time: f64,
    ) -> Dressed {
        let mut surface = *bare;
        let uvs = std::array::from_fn(|i| DVec3::new(f64::from(uvs[i].x), f64::from(uvs[i].y), 0.0));
        let uv = blend.value(uvs);
        surface.uv = DVec2::new(uv.x, uv.y);

        // From derivatives by the coordinates of the face to derivatives by uv.
        let [by_a, by_b] = blend.slopes(uvs);
        let determinant = by_a.x * by_b.y - by_a.y * by_b.x;
        let by_uv = |along_a: DVec3, along_b: DVec3| {
            let along_u = (along_a * by_b.y - along_b * by_a.y) / determinant;
            let along_v = (along_b * by_a.x - along_a * by_b.x) / determinant;
            (along_u, along_v)
        };
        let (dpdu, dpdv) = by_uv(bare.dpdu, bare.dpdv);
        let has_parameters = determinant != 0.0
            && dpdu.is_finite()
            && dpdv.is_finite()
            && dpdu.cross(dpdv).length_squared() > 0.0;
        (surface.dpdu, surface.dpdv) =
            if has_parameters { (dpdu, dpdv) } else { bare.normal.any_orthonormal_pair() };
        (surface.dndu, surface.dndv) =
            if has_parameters { by_uv(bare.dndu, bare.dndv) } else { (DVec3::ZERO, DVec3::ZERO) };

        let Some(normals) = self.corner_normals(corners, time) else {
            let mut dressed = plain(&surface);
            self.align(&mut dressed, corners, blend, placement);
            return dressed;
        };
        let moved = |n: DVec3| placement.map_or(n, |m| m.normal(n));
        let sum = moved(blend.value(normals));
        let length = sum.length();
        if length.is_nan() || length <= 0.0 {
            let mut dressed = plain(&surface);
            self.align(&mut dressed, corners, blend, placement);
            return dressed;
        }
        let normal = sum / length;
        // The vertices say which side is out (pbrt does so, and meshes whose faces run the wrong way are many).
        if surface.normal.dot(normal) < 0.0 {
            surface.normal = -surface.normal;
            surface.dndu = -surface.dndu;
            surface.dndv = -surface.dndv;
        }
        let mut dressed = plain(&surface);
        dressed.shading.normal = normal.as_vec3();
        let turned = |dn: DVec3| {
            let dn = moved(dn) / length;
            dn - normal * normal.dot(dn)
        };
        let [by_a, by_b] = blend.slopes(normals);
        let (dndu, dndv) =
            if has_parameters { by_uv(turned(by_a), turned(by_b)) } else { (DVec3::ZERO, DVec3::ZERO) };
        dressed.shading.dndu = dndu.as_vec3();
        dressed.shading.dndv = dndv.as_vec3();
        self.align(&mut dressed, corners, blend, placement);
        dressed
    }

    /// Lays ∂p/∂u of the shading surface along the tangents, where the mesh has them, and the bitangent on its side.
    fn align<const N: usize>(
        &self,
        dressed: &mut Dressed,
        corners: [u32; N],
        blend: &Blend<N>,
        placement: Option<&Transform>,
    ) {
        let Some(tangents) = self.tangents() else { return };
        let tangents = at(tangents, corners);
        let side: f32 = tangents.iter().map(|t| t.w).sum();
        let mirrored = placement.is_some_and(Transform::is_mirror);
        if side != 0.0 && (side < 0.0) != mirrored {
            dressed.shading.handedness = -1.0;
        }
        let tangent = blend.value(std::array::from_fn(|i| tangents[i].truncate().as_dvec3()));
        let tangent = placement.map_or(tangent, |m| m.vector(tangent)).as_vec3();
        let n = dressed.shading.normal;
        if let Some(unit) = (tangent - n * n.dot(tangent)).try_normalize() {
            dressed.shading.dpdu = unit * dressed.shading.dpdu.length();
        }
    }
}
