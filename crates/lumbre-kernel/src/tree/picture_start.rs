//! What picture rays need to start in single precision, relative to the meshes of a tree.

use lumbre_math::DVec3;

use super::filter_start::FilterStart;
use super::node::{ROUNDOFF, round_up};

/// Rounding errors of picture rays and of the triangles they meet: see
/// [`Accel::picture_rounding`](crate::Accel::picture_rounding).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PictureRounding {
    /// The origin of rays in single precision.
    pub origin: DVec3,
    /// The error of a ray's start on each axis, relative to its distance from the origin there.
    pub relative: f64,
    /// The apparent error of a triangle's position, from the size of the tree.
    pub absolute: f64,
}

impl PictureRounding {
    /// By how much [`Surface::point_error`](lumbre_geometry::Surface::point_error) must grow on each axis at a point on
    /// a triangle of a mesh that is directly in the tree, so that rays that leave the point do not hit the triangle.
    #[inline]
    pub fn error(&self, point: DVec3) -> DVec3 {
        (point - self.origin).abs() * self.relative + self.absolute
    }
}

/// What picture rays need to start in single precision, relative to the mesh.
#[derive(Clone, Debug)]
pub(crate) struct PictureStart {
    /// For rays that start relative to the mesh.
    pub(crate) start: FilterStart,
    pub(crate) rounding: PictureRounding,
    /// Maximum distance of a hit from its triangle on each axis, for an unrounded ray from outside an instance: see
    /// `trace::picture`.
    pub(crate) deviation: f64,
    /// Whether there are triangles in single precision in the tree or in its instances.
    pub(crate) has_triangles: bool,
}

impl PictureStart {
    /// For a tree with this start, whose instances have deviations up to `within`; `None` if pictures need double
    /// precision.
    pub(crate) fn new(start: &FilterStart, within: f64, has_triangles: bool) -> Option<Self> {
        let shift = start.shift.iter().fold(0.0f32, |most, shift| most.max(shift.abs()));
        let own = ROUNDOFF * (128.0 + 2.0 * f64::from(shift)) / start.scale;
        let rounding = PictureRounding {
            origin: DVec3::from_slice(&start.mesh_origin),
            relative: RELATIVE * ROUNDOFF,
            absolute: ABSOLUTE * ROUNDOFF / start.scale,
        };
        let room = within * start.scale;
        // False for a NaN too.
        (room <= MAX_ROOM).then(|| Self {
            start: start.relative_to_mesh(round_up(room)),
            rounding,
            deviation: own.max(within),
            has_triangles,
        })
    }
}

/// See [`Accel::picture_rounding`](crate::Accel::picture_rounding).
const RELATIVE: f64 = 2.0;
const ABSOLUTE: f64 = 20.0;
/// Maximum widening of boxes for the contents of instances, in tree units.
const MAX_ROOM: f64 = 1.0 / 1024.0;
