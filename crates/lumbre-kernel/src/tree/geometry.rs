//! The data of geometries: meshes, spheres, user geometry, and the placement of instances. Trees themselves are
//! elsewhere.

use std::fmt::Debug;
use std::sync::Arc;

use lumbre_geometry::{Aabb, NearestPoint, NearestPointError, Ray, Root, Roots, Surface};
use lumbre_math::{AnimatedTransform, DVec3, Transform, Vec3};

/// Where an instance is.
#[derive(Clone, Debug, PartialEq)]
pub enum Placement {
    /// At one place at all times.
    Still(Transform),
    /// At a place that depends on the time of the ray.
    Moving(Arc<AnimatedTransform>),
}

impl From<Transform> for Placement {
    fn from(map: Transform) -> Self {
        Self::Still(map)
    }
}

impl From<AnimatedTransform> for Placement {
    fn from(map: AnimatedTransform) -> Self {
        Self::Moving(Arc::new(map))
    }
}

impl Placement {
    /// The map at a time.
    pub fn at(&self, time: f64) -> Transform {
        match self {
            Self::Still(map) => *map,
            Self::Moving(motion) => motion.at(time),
        }
    }

    /// The map at a time. If it changes, it is computed into `moving`.
    #[inline(always)]
    pub(crate) fn map_at<'m>(&'m self, time: f64, moving: &'m mut Option<Transform>) -> &'m Transform {
        match self {
            Self::Still(map) => map,
            Self::Moving(motion) => moving.insert(motion.at(time)),
        }
    }

    /// The ray in the space of the placed tree.
    #[inline(always)]
    pub(crate) fn object_ray(&self, ray: &Ray) -> Ray {
        ray.into_object(self.map_at(ray.time, &mut None))
    }
}

/// An indexed triangle mesh. Vertex `i` is at `origin + positions[i]`, so that single precision holds small objects far
/// away.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriangleMesh {
    /// The origin of the positions.
    pub origin: DVec3,
    /// Vertices.
    pub positions: Vec<Vec3>,
    /// Three vertices each; the front is the side from which they run counter-clockwise.
    pub indices: Vec<[u32; 3]>,
}

/// Many spheres. Sphere `i` is around `origin + (x, y, z)` of `spheres[i]`, which is its centre and its radius, so that
/// single precision holds small spheres far away. Each answers as a [`Sphere`](lumbre_geometry::Sphere) of these
/// numbers in double precision does.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SphereCloud {
    /// The origin of the centres.
    pub origin: DVec3,
    /// Centre and radius of each sphere. A sphere with a radius of zero or less is never hit.
    pub spheres: Vec<[f32; 4]>,
}

/// Geometry that the caller defines. Each test costs one indirect call.
pub trait CustomGeometry: Debug + Send + Sync {
    /// Number of primitives.
    fn primitive_count(&self) -> u32;
    /// A box around a primitive; `None` if it is infinite.
    fn bounds(&self, primitive: u32) -> Option<Aabb>;
    /// The first crossing in the ray's range.
    fn closest(&self, primitive: u32, ray: &Ray) -> Option<Root>;
    /// Appends every crossing in the ray's range, in ascending order.
    fn roots(&self, primitive: u32, ray: &Ray, out: &mut Roots);
    /// The surface at a crossing.
    fn surface(&self, primitive: u32, ray: &Ray, root: &Root) -> Surface;
    /// The point of a primitive that is nearest to `point`. The default returns an error.
    ///
    /// # Errors
    /// [`NearestPointError::NotOffered`], or another reason.
    fn closest_point(&self, primitive: u32, point: DVec3) -> Result<NearestPoint, NearestPointError> {
        let _ = (primitive, point);
        Err(NearestPointError::NotOffered)
    }
    /// The winding number of all primitives together around a point: 1 inside a body, 0 outside. `None` by default.
    fn winding_number(&self, point: DVec3) -> Option<f64> {
        let _ = point;
        None
    }
    /// Whether anything is crossed in the ray's range.
    fn any(&self, primitive: u32, ray: &Ray) -> bool {
        self.closest(primitive, ray).is_some()
    }
}

/// Whether a triangle can be hit at all, as double precision sees it.
#[inline(always)]
pub(crate) fn has_area(&[a, b, c]: &[Vec3; 3]) -> bool {
    // Single precision is certain for all but slivers: its errors are below 2^-20 of the products, and 1e-37.
    let (e, f) = ((b - a).to_array(), (c - a).to_array());
    let is_clear = |x: usize, y: usize| {
        let (p, q) = (e[x] * f[y], e[y] * f[x]);
        let bound = (p.abs() + q.abs()) * (1.0 / (1 << 20) as f32) + 1e-37;
        (p - q).abs() > bound && bound < f32::INFINITY
    };
    is_clear(0, 1) || is_clear(1, 2) || is_clear(2, 0) || has_area_exactly([a, b, c])
}

#[cold]
#[inline(never)]
fn has_area_exactly(corners: [Vec3; 3]) -> bool {
    let [a, b, c] = corners.map(|corner| corner.as_dvec3());
    (b - a).cross(c - a) != DVec3::ZERO
}
