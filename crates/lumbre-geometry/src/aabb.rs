//! Axis-aligned bounding boxes.

use lumbre_math::DVec3;

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
