//! Primitives during the build: 32 bytes each.

use bytemuck::{Pod, Zeroable};
use lumbre_geometry::Aabb;
use lumbre_math::Elementary;

use crate::intersect::Simd;
use crate::tree::node::{Node, TreeSpace, round_up};

/// The kind of a primitive. A leaf holds one kind: triangles of one mesh, spheres of one cloud.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub(crate) enum Kind {
    Triangle,
    Shape,
    Instance,
    Custom,
    Sphere,
    Precise,
}

impl Kind {
    /// Whether its primitives are packed into blocks.
    pub(crate) fn is_packed(self) -> bool {
        matches!(self, Self::Triangle | Self::Sphere)
    }

    /// Kinds of different ranks have trees of their own, joined at the root. The last rank has the packed kinds, which
    /// are tested first.
    pub(crate) fn rank(self) -> usize {
        match self {
            Self::Instance => 0,
            Self::Shape | Self::Custom | Self::Precise => 1,
            Self::Triangle | Self::Sphere => 2,
        }
    }

    /// Number of ranks.
    pub(crate) const RANKS: usize = 3;
}

/// What the build needs to know of a geometry: the kind of its primitives and the cost of a test.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Traits {
    pub(crate) kind: Kind,
    /// In sixteenths of a node's cost. Integers, so that sums do not depend on their order.
    pub(crate) cost: u32,
    /// Maximum primitives of this kind in a leaf.
    pub(crate) most: usize,
}

impl Traits {
    /// The cost of testing a triangle or a sphere.
    pub(crate) const COST_OF_PACKED: u32 = 4;
}

/// Fixed-point steps per tree unit. Twice a centre minus another such number still fits an `i32`.
pub(crate) const ONE: f64 = (1 << 28) as f64;

/// A box in tree units with two ids: for a primitive, its geometry and its index there.
///
/// Eight integers that one vector operation can grow: the lower corner and the first id, the upper corner negated and
/// the second id. The resolution of 2^-28 is well below that of the box test (see `node`). Coordinates have a relative
/// rounding error of up to 2^-24 in either direction; the planes of a node are widened by that.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(32))]
pub(crate) struct Bounds {
    lanes: [i32; 8],
}

/// A box with the ids of its contents.
pub(crate) type Primitive = Bounds;

const FIRST: usize = 3;
const SECOND: usize = 7;

impl Bounds {
    // Beyond all coordinates, but with a size that does not overflow.
    pub(crate) const EMPTY: Self = Self { lanes: [Self::EMPTY_LANE; 8] };
    pub(crate) const EMPTY_LANE: i32 = 1 << 30;

    /// From corners in tree units.
    #[inline(always)]
    pub(crate) fn new(low: [f32; 3], high: [f32; 3], first: u32, second: u32) -> Self {
        let fixed = |x: f32| (x * ONE as f32) as i32;
        let (low, high) = (low.map(fixed), high.map(fixed));
        Self { lanes: [low[0], low[1], low[2], first as i32, -high[0], -high[1], -high[2], second as i32] }
    }

    /// From the lower corner and the negated upper corner in tree units; ids are zero.
    #[inline(always)]
    pub(crate) fn of_lanes<L: Simd>(mut numbers: [f32; 8]) -> Self {
        for number in &mut numbers {
            *number *= ONE as f32;
        }
        Self { lanes: L::truncated(&numbers) }
    }

    /// The intersection; of negative size if it is empty.
    #[inline(always)]
    pub(crate) fn common(&self, other: &Self) -> Self {
        Self { lanes: std::array::from_fn(|lane| self.lanes[lane].max(other.lanes[lane])) }
    }

    /// The box nearest to a box in space.
    #[inline]
    pub(crate) fn near(tree_space: &TreeSpace, bounds: &Aabb, first: u32, second: u32) -> Self {
        let low = (bounds.min - tree_space.origin) * tree_space.scale;
        let high = (bounds.max - tree_space.origin) * tree_space.scale;
        Self::new(low.as_vec3().to_array(), high.as_vec3().to_array(), first, second)
    }

    #[inline(always)]
    pub(crate) fn with_ids(mut self, first: u32, second: u32) -> Self {
        self.lanes[FIRST] = first as i32;
        self.lanes[SECOND] = second as i32;
        self
    }

    /// The geometry of a primitive.
    #[inline(always)]
    pub(crate) fn first(&self) -> u32 {
        self.lanes[FIRST] as u32
    }

    /// The index of a primitive in its geometry.
    #[inline(always)]
    pub(crate) fn second(&self) -> u32 {
        self.lanes[SECOND] as u32
    }

    /// The lower plane on an axis, moved outward by the possible rounding error.
    #[inline]
    pub(crate) fn low_plane(&self, axis: usize) -> f32 {
        -Self::outward(-self.lanes[axis])
    }

    /// The upper plane on an axis, likewise.
    #[inline]
    pub(crate) fn high_plane(&self, axis: usize) -> f32 {
        Self::outward(-self.lanes[axis + 4])
    }

    /// Writes the box as that of a node's child.
    #[inline]
    pub(crate) fn put(&self, node: &mut Node, lane: usize) {
        for axis in 0..3 {
            node.planes[2 * axis][lane] = self.low_plane(axis);
            node.planes[2 * axis + 1][lane] = self.high_plane(axis);
        }
    }

    /// The box with these planes, read back from a node; empty if they are inverted or beyond all coordinates.
    pub(crate) fn of_planes(low: [f32; 3], high: [f32; 3]) -> Self {
        const BEYOND: f32 = (Bounds::EMPTY_LANE as f64 / ONE) as f32;
        if !(0..3).all(|axis| -BEYOND < low[axis] && low[axis] <= high[axis] && high[axis] < BEYOND) {
            return Self::EMPTY;
        }
        let [low, high] = [low.map(|plane| Self::inward(-plane)), high.map(Self::inward)];
        Self { lanes: [-low[0], -low[1], -low[2], 0, -high[0], -high[1], -high[2], 0] }
    }

    fn outward(x: i32) -> f32 {
        let x = f64::from(x);
        round_up((x + x.abs() * f64::from(f32::EPSILON) + 2.0) / ONE)
    }

    /// The coordinate that becomes this plane.
    fn inward(plane: f32) -> i32 {
        let near = f64::from(plane.next_down()) * ONE;
        let mut x = (near - near.abs() * f64::from(f32::EPSILON) - 2.0).rounded() as i32;
        while Self::outward(x) > plane {
            x -= 1;
        }
        while Self::outward(x) < plane {
            x += 1;
        }
        x
    }

    /// Twice the ends on an axis; arbitrary for an empty box.
    #[inline(always)]
    pub(crate) fn range2(&self, axis: usize) -> [i32; 2] {
        [self.lanes[axis].wrapping_mul(2), self.lanes[axis + 4].wrapping_mul(-2)]
    }

    /// Grows to contain another box; loses the ids.
    #[inline(always)]
    pub(crate) fn grow(&mut self, other: &Self) {
        for lane in 0..8 {
            self.lanes[lane] = self.lanes[lane].min(other.lanes[lane]);
        }
    }

    /// Half the area, in squares of the fixed-point unit; 0 if empty.
    #[inline(always)]
    pub(crate) fn half_area(&self) -> f32 {
        let sizes: [f32; 4] = std::array::from_fn(|lane| {
            let size = self.lanes[lane].wrapping_neg().wrapping_sub(self.lanes[lane + 4]);
            size.max(0) as f32
        });
        let [x, y, z, _] = sizes;
        x * y + y * z + z * x
    }

    /// Twice the middle on each axis; the last lane is unused.
    #[inline(always)]
    pub(crate) fn center2(&self) -> [i32; 4] {
        std::array::from_fn(|lane| self.lanes[lane].wrapping_sub(self.lanes[lane + 4]))
    }

    #[inline(always)]
    pub(crate) fn center2_on(&self, axis: usize) -> i32 {
        self.lanes[axis] - self.lanes[axis + 4]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::scenes::Random;

    #[test]
    fn boxes_by_planes_have_these_planes() {
        let mut random = Random(461);
        for round in 0..200_000 {
            let size = 2f64.powf(random.between(-28.0, 0.0));
            let mut corner = || [0; 3].map(|_| (size * random.between(-1.0, 1.0)) as f32);
            let (a, b) = (corner(), if round % 5 == 0 { [0.0, 1.0, -1.0] } else { corner() });
            let bounds = Bounds::new(
                std::array::from_fn(|axis| a[axis].min(b[axis])),
                std::array::from_fn(|axis| a[axis].max(b[axis])),
                7,
                8,
            );
            let planes = |bounds: &Bounds| {
                let low: [f32; 3] = std::array::from_fn(|axis| bounds.low_plane(axis));
                (low, std::array::from_fn(|axis| bounds.high_plane(axis)))
            };
            let (low, high) = planes(&bounds);
            assert_eq!(planes(&Bounds::of_planes(low, high)), (low, high), "{bounds:?}");
        }
        let (low, high) = ([0, 1, 2].map(|axis| Bounds::EMPTY.low_plane(axis)), [0.0; 3]);
        assert_eq!(Bounds::of_planes(low, high).half_area(), 0.0);
        for hostile in [f32::NAN, f32::INFINITY, -f32::INFINITY, f32::MAX, -1e9] {
            assert_eq!(Bounds::of_planes([hostile; 3], [hostile.max(0.5); 3]).half_area(), 0.0);
        }
    }
}
