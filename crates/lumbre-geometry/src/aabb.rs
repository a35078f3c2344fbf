//! Axis-aligned bounding boxes.

use lumbre_math::DVec3;

use crate::Ray;

/// An axis-aligned box, both ends included. Empty when `min > max` on any axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// The corner of the least coordinates.
    pub min: DVec3,
    /// The corner of the greatest coordinates.
    pub max: DVec3,
}

impl Aabb {
    /// The empty box, the identity of `union`.
    pub const EMPTY: Self = Self { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };

    /// The smallest box around some points.
    pub fn around(points: impl IntoIterator<Item = DVec3>) -> Self {
        points
            .into_iter()
            .fold(Self::EMPTY, |bounds, p| Self { min: bounds.min.min(p), max: bounds.max.max(p) })
    }

    /// The smallest box around both.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Whether it contains no point.
    pub fn is_empty(&self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// Whether it contains `p`, faces included.
    pub fn contains(&self, p: DVec3) -> bool {
        self.min.cmple(p).all() && p.cmple(self.max).all()
    }

    /// Where a ray enters and leaves the closed box, within the ray's range; `None` if it has no point in it.
    ///
    /// Between the two planes of an axis is a slab, and the box is what the slabs have in common: T. L. Kay, J. T.
    /// Kajiya, "Ray tracing complex scenes", SIGGRAPH 1986. A ray along a slab is in it everywhere or nowhere, which is
    /// decided without dividing by zero. Each end is wrong by no more than three roundings.
    pub fn slabs(&self, ray: &Ray) -> Option<[f64; 2]> {
        let (mut enter, mut leave) = (ray.t_min, ray.t_max);
        for axis in 0..3 {
            let (low, high) = (self.min[axis] - ray.origin[axis], self.max[axis] - ray.origin[axis]);
            let d = ray.direction[axis];
            if d == 0.0 {
                if !(low <= 0.0 && high >= 0.0) {
                    return None;
                }
                continue;
            }
            let (at_low, at_high) = (low / d, high / d);
            enter = enter.max(at_low.min(at_high));
            leave = leave.min(at_low.max(at_high));
        }
        let is_ray = ray.origin.is_finite() && ray.direction.is_finite() && ray.direction != DVec3::ZERO;
        (is_ray && enter <= leave).then_some([enter, leave])
    }

    /// The centre.
    pub fn center(&self) -> DVec3 {
        0.5 * self.min + 0.5 * self.max
    }

    /// The edge lengths.
    pub fn size(&self) -> DVec3 {
        self.max - self.min
    }

    /// Half the surface area, the cost measure of the SAH; 0 when empty.
    pub fn half_area(&self) -> f64 {
        if self.is_empty() {
            return 0.0;
        }
        let s = self.size();
        s.x * s.y + s.y * s.z + s.z * s.x
    }

    /// Each face moved outward by `ulps` representable numbers.
    #[must_use]
    pub fn outward(self, ulps: u32) -> Self {
        let mut grown = self;
        for _ in 0..ulps {
            grown.min = DVec3::from_array(grown.min.to_array().map(f64::next_down));
            grown.max = DVec3::from_array(grown.max.to_array().map(f64::next_up));
        }
        grown
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slabs_are_entered_and_left_where_the_planes_are() {
        let b = Aabb { min: DVec3::new(-1.0, 2.0, 3.0), max: DVec3::new(2.0, 4.0, 9.0) };
        let through = Ray::new(DVec3::new(-5.0, 3.0, 5.0), DVec3::new(2.0, 0.0, 0.0));
        assert_eq!(b.slabs(&through), Some([2.0, 3.5]));
        assert_eq!(b.slabs(&through.with_range(2.5, 3.0)), Some([2.5, 3.0]));
        assert_eq!(b.slabs(&through.with_range(4.0, 9.0)), None);
        // From within, backwards, and within the plane of a face.
        let within = Ray::new(DVec3::new(0.0, 3.0, 4.0), DVec3::new(0.0, 0.0, -4.0));
        assert_eq!(b.slabs(&within), Some([0.0, 0.25]));
        let in_a_face = Ray::new(DVec3::new(2.0, 0.0, 5.0), DVec3::new(0.0, 1.0, -0.0));
        assert_eq!(b.slabs(&in_a_face), Some([2.0, 4.0]));
        let beside = Ray::new(DVec3::new(2.5, 0.0, 5.0), DVec3::Y);
        assert_eq!(b.slabs(&beside), None);
        // Through an edge only, and what is no ray or no box.
        let edge = Ray::new(DVec3::new(1.0, 5.0, 5.0), DVec3::new(1.0, -1.0, 0.0));
        assert_eq!(b.slabs(&edge), Some([1.0, 1.0]));
        assert_eq!(b.slabs(&Ray::new(b.center(), DVec3::ZERO)), None);
        assert_eq!(b.slabs(&Ray::new(b.center(), DVec3::NAN)), None);
        assert_eq!(Aabb::EMPTY.slabs(&through), None);
    }
}
