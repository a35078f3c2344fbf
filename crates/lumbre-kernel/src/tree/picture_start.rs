//! What rays of pictures need to start in single precision, relative to the meshes of a tree.

use lumbre_math::DVec3;

use super::filter_start::FilterStart;
use super::node::{ROUNDOFF, round_up};

/// By how much rays of a picture are rounded, and triangles with them: see [`Accel::picture_rounding`](crate::Accel::picture_rounding).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PictureRounding {
    /// What rays in single precision start relative to.
    pub origin: DVec3,
    /// How far a ray's start moves on each axis, by its distance from the origin there.
    pub relative: f64,
    /// How far a triangle seems to be from where it is, by the size of the tree.
    pub absolute: f64,
}

impl PictureRounding {
    /// What [`Surface::point_error`](lumbre_geometry::Surface::point_error) is to grow by, axis by axis, for a point on a triangle of a
    /// mesh that stands in the tree itself, so that the rays that leave it do not hit the triangle.
    #[inline]
    pub fn error(&self, point: DVec3) -> DVec3 {
        (point - self.origin).abs() * self.relative + self.absolute
    }
}

/// What rays of a picture need to start in single precision: relative to the mesh.
#[derive(Clone, Debug)]
pub(crate) struct PictureStart {
    /// For rays that start relative to the mesh.
    pub(crate) start: FilterStart,
    pub(crate) rounding: PictureRounding,
    /// How far a hit in the tree may be from its triangle, on each axis, as seen from a ray that comes to it as to an instance, and that
    /// was not rounded: see `trace::picture`.
    pub(crate) deviation: f64,
    /// Whether there are triangles in single precision in the tree, or in its instances.
    pub(crate) has_triangles: bool,
}

impl PictureStart {
    /// Of a tree that has this start, with triangles or not, and whose instances have deviations up to `within`; `None` where pictures
    /// take double precision.
    pub(crate) fn new(start: &FilterStart, within: f64, has_triangles: bool) -> Option<Self> {
        let shift = start.shift.iter().fold(0.0f32, |most, shift| most.max(shift.abs()));
        let own = ROUNDOFF * (128.0 + 2.0 * f64::from(shift)) / start.scale;
        let rounding = PictureRounding {
            origin: DVec3::from_slice(&start.mesh_origin),
            relative: RELATIVE * ROUNDOFF,
            absolute: ABSOLUTE * ROUNDOFF / start.scale,
        };
        let room = within * start.scale;
        // Also where that is no number.
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
/// By no more than this, in tree units, boxes may be moved for what is in instances.
const MAX_ROOM: f64 = 1.0 / 1024.0;
