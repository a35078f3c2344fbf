//! The order of a ray's axes, and which planes of a box it meets first.

use lumbre_math::DVec3;

use crate::tree::node::WIDTH;
use crate::tree::triangle_block::{TriangleBlock, shared_row, unshared_row};

/// The planes of a node that a ray meets first.
#[derive(Debug, PartialEq)]
#[repr(align(32))]
pub(crate) struct Sides {
    // For each axis, where the planes start in the flat array of a node's planes: `WIDTH` times 2 axis + side. Flipping
    // `WIDTH` gives the start of the other planes.
    pub(super) near: [usize; 3],
}

// The fourth bit is ignored.
static SIDES: [Sides; 16] = {
    let mut sides = [const { Sides { near: [0; 3] } }; 16];
    let mut signs = 0;
    while signs < 16 {
        let mut axis = 0;
        while axis < 3 {
            sides[signs].near[axis] = 2 * WIDTH * axis + WIDTH * (signs >> axis & 1);
            axis += 1;
        }
        signs += 1;
    }
    sides
};

impl Sides {
    /// For directions without negative components.
    pub(crate) const OF_NONE_NEGATIVE: &'static Self = &SIDES[0];

    /// For the signs of a direction: one bit per negative component. A fourth bit is ignored.
    #[inline(always)]
    pub(crate) fn new(signs: u32) -> &'static Self {
        &SIDES[signs as usize % 16]
    }
}

/// The axes in another order. One cache line each: hot fields come first, and a shift finds the table entry.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct Axes {
    // Each below three; the fourth is padding.
    pub(super) order: [u32; 4],
    // The words where the axes' rows begin in a block that shares its vertices, and in one that does not.
    pub(super) shared_rows: [u32; 3],
    pub(super) unshared_rows: [u32; 3],
    // Both halves of each.
    pub(super) halves: [u32; 8],
}

impl Axes {
    const fn of(x: usize, y: usize, z: usize) -> Self {
        let order = [x as u32, y as u32, z as u32, 3];
        let mut halves = [0; 8];
        let mut half = 0;
        while half < 8 {
            halves[half] = 2 * order[half / 2] + half as u32 % 2;
            half += 1;
        }
        let shared_rows = [shared_row(x) as u32, shared_row(y) as u32, shared_row(z) as u32];
        let unshared_rows = [unshared_row(x) as u32, unshared_row(y) as u32, unshared_row(z) as u32];
        Self { order, shared_rows, unshared_rows, halves }
    }
}

// By which axis is last and whether it is negative; eight entries, so that three bits select one.
const AXES: [Axes; 8] = [
    Axes::of(1, 2, 0),
    Axes::of(2, 0, 1),
    Axes::of(0, 1, 2),
    Axes::of(0, 1, 2),
    Axes::of(2, 1, 0),
    Axes::of(0, 2, 1),
    Axes::of(1, 0, 2),
    Axes::of(1, 0, 2),
];

impl Axes {
    /// The last is the direction's largest; the others are in the order that keeps the winding.
    #[inline(always)]
    pub(crate) fn new(direction: &DVec3) -> &'static Self {
        let [x, y, z] = [direction.x.abs(), direction.y.abs(), direction.z.abs()];
        // Branch-free, for incoherent rays.
        let x_is_largest = usize::from((x >= y) & (x >= z));
        let z = (1 - x_is_largest) * (2 - usize::from(y >= z));
        let is_negative = usize::from(direction.as_ref()[z] < 0.0);
        static ALL: [Axes; 8] = AXES;
        &ALL[(4 * is_negative + z) % 8]
    }

    /// The axes for a direction, from one bit for each negative component, and one bit each for |x| ≥ |y|, |y| ≥ |z|
    /// and |x| ≥ |z|.
    #[inline(always)]
    pub(crate) fn by_bits(signs: u32, sizes: u32) -> &'static Self {
        static ALL: [Axes; 64] = {
            let mut all = [AXES[0]; 64];
            let mut bits = 0;
            while bits < 64 {
                let (signs, sizes) = (bits % 8, bits / 8);
                let z = if sizes & 0b101 == 0b101 {
                    0
                } else if sizes & 0b10 != 0 {
                    1
                } else {
                    2
                };
                all[bits] = AXES[4 * (signs >> z & 1) + z];
                bits += 1;
            }
            all
        };
        &ALL[(((sizes % 8) << 3) | (signs % 8)) as usize]
    }

    /// The axes in this order. The compiler learns that each is below three.
    #[inline(always)]
    pub(crate) fn order(&self) -> [usize; 3] {
        let [x, y, z, _] = self.order;
        [x.min(2) as usize, y.min(2) as usize, z.min(2) as usize]
    }

    /// A vector's components in this order.
    #[inline(always)]
    pub(crate) fn permute_single(&self, v: &[f32; 4]) -> [f32; 4] {
        [v[self.order[0] as usize % 4], v[self.order[1] as usize % 4], v[self.order[2] as usize % 4], v[3]]
    }

    /// A vector's components in this order.
    #[inline(always)]
    pub(crate) fn permute(&self, v: &DVec3) -> [f64; 3] {
        let v: &[f64; 3] = v.as_ref();
        // SAFETY: the axes are below three.
        let at = |axis: u32| unsafe { *v.get_unchecked(axis as usize) };
        [at(self.order[0]), at(self.order[1]), at(self.order[2])]
    }

    /// The first words of the axes' rows in a block; each row has all vertices that [`TriangleBlock::vertices_at`]
    /// returns.
    #[inline(always)]
    pub(super) fn rows(&self, block: &TriangleBlock) -> [usize; 3] {
        let [x, y, z] = if block.is_unshared() { self.unshared_rows } else { self.shared_rows };
        [x as usize, y as usize, z as usize]
    }

    /// The corners in one lane of a block, in the order of these axes.
    #[inline(always)]
    pub(crate) fn gather(&self, block: &TriangleBlock, lane: usize) -> [[f32; 3]; 3] {
        let words = block.words();
        let [x, y, z] = self.rows(block);
        block.vertices_at(lane).map(|vertex| {
            // SAFETY: see `rows`.
            let at = |row: usize| unsafe { *words.get_unchecked(row + vertex) };
            [at(x), at(y), at(z)]
        })
    }
}
