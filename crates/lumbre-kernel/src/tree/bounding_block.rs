//! Bounding volumes of shapes by eight: a conservative first test in single precision.

use bytemuck::{Pod, Zeroable};
use lumbre_geometry::{BoundingVolume, PlacedShape, Ray};
use lumbre_math::{DMat3, DVec3};
use rayon::prelude::*;

use crate::tree::BLOCK;
use crate::tree::node::{TreeSpace, round_up};
use crate::tree::packed::Entry;

/// Up to eight bounding volumes (see [`BoundingVolume`]), each with its centre, relative to the tree's origin, and the
/// map from there to its cube.
///
/// A lane of NaN passes every test. An unused lane has a height of -∞ and never passes.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(32))]
pub(crate) struct BoundingBlock {
    pub(crate) centers: [[f32; BLOCK]; 3],
    /// `rows[axis][column][lane]`.
    pub(crate) rows: [[[f32; BLOCK]; 3]; 3],
    /// Half the extent along y: 1, or 0 for a flat shape.
    pub(crate) heights: [f32; BLOCK],
    /// The coefficients c, d and e.
    pub(crate) profiles: [[f32; BLOCK]; 3],
    /// The radius of a ring's tube; -1 for other solids, otherwise 0.
    pub(crate) tubes: [f32; BLOCK],
    /// Error bounds of cube coordinates: per unit of distance from the centre, 64uN, and absolute. See
    /// [`BoundingVolumeRay`].
    pub(crate) margins: [f32; BLOCK],
    pub(crate) least_margins: [f32; BLOCK],
}

const _: () = assert!(size_of::<BoundingBlock>() == 608);

/// u.
const ROUNDOFF: f64 = 1.0 / (1u64 << 24) as f64;
/// Smaller bounding volumes, relative to the tree, are not tested in single precision.
const LARGEST_NORM: f64 = (1u64 << 18) as f64;
/// Largest supported condition of a map.
const LARGEST_CONDITION: f64 = (1u64 << 16) as f64;

/// A bounding volume in a block's units.
struct Mapped {
    bounding_volume: BoundingVolume,
    /// Relative to the tree's origin.
    center: DVec3,
    /// From space to the cube.
    rows: [DVec3; 3],
    /// N.
    norm: f64,
    /// S.
    size: f64,
}

impl Mapped {
    /// `None` if single precision is too coarse for it.
    fn new(bounding_volume: BoundingVolume, tree_space: &TreeSpace) -> Option<Self> {
        let back = bounding_volume.axes.inverse();
        let largest_row = |m: &DMat3| (0..3).map(|axis| m.row(axis).abs().element_sum()).fold(0.0, f64::max);
        let (norm, size) = (largest_row(&back), largest_row(&bounding_volume.axes));
        let center = bounding_volume.center - tree_space.origin;
        // Every comparison with a NaN is false.
        let is_fit = norm > 0.0
            && norm <= LARGEST_NORM * tree_space.scale
            && norm * size <= LARGEST_CONDITION
            && center.abs().max_element() * tree_space.scale <= 2.0;
        is_fit.then_some(Self {
            bounding_volume,
            center,
            rows: [0, 1, 2].map(|axis| back.row(axis)),
            norm,
            size,
        })
    }
}

impl BoundingBlock {
    /// A block without bounding volumes.
    pub(crate) const EMPTY: Self = Self {
        centers: [[0.0; BLOCK]; 3],
        rows: [[[0.0; BLOCK]; 3]; 3],
        heights: [f32::NEG_INFINITY; BLOCK],
        profiles: [[0.0; BLOCK]; 3],
        tubes: [0.0; BLOCK],
        margins: [1.0; BLOCK],
        least_margins: [1.0; BLOCK],
    };

    /// Puts the bounding volume of a shape into a lane. If there is none, or if single precision is too coarse for it,
    /// the lane passes every test.
    pub(crate) fn put(
        &mut self,
        lane: usize,
        bounding_volume: Option<BoundingVolume>,
        tree_space: &TreeSpace,
    ) {
        let Some(mapped) =
            bounding_volume.and_then(|bounding_volume| Mapped::new(bounding_volume, tree_space))
        else {
            self.rows.iter_mut().flatten().for_each(|lanes| lanes[lane] = f32::NAN);
            (self.heights[lane], self.tubes[lane]) = (f32::NAN, 0.0);
            return;
        };
        let Mapped { bounding_volume, center, rows, norm, size } = mapped;
        for axis in 0..3 {
            self.centers[axis][lane] = center[axis] as f32;
            for (lanes, number) in self.rows[axis].iter_mut().zip(rows[axis].to_array()) {
                lanes[lane] = number as f32;
            }
        }
        self.heights[lane] = if bounding_volume.is_flat { 0.0 } else { 1.0 };
        for (lanes, number) in self.profiles.iter_mut().zip(bounding_volume.profile) {
            lanes[lane] = number as f32;
        }
        self.tubes[lane] = if bounding_volume.is_solid && bounding_volume.tube == 0.0 {
            -1.0
        } else {
            bounding_volume.tube as f32
        };
        let per_distance = 64.0 * ROUNDOFF * norm;
        // The centre was rounded.
        let moved = ROUNDOFF * center.abs().max_element() + tree_space.nearby_slop() / tree_space.scale;
        self.margins[lane] = round_up(per_distance);
        self.least_margins[lane] = round_up(per_distance * size + norm * moved + 16.0 * ROUNDOFF);
    }
}

/// The bounding volumes of the shapes in a tree's leaves.
#[derive(Clone, Debug, Default)]
pub(crate) struct BoundingVolumes {
    blocks: Vec<BoundingBlock>,
    /// For each entry of the tree, the index of its block. The top bit is set unless it is the last block of its leaf.
    /// Undefined for other entries than shapes.
    of_entry: Vec<u32>,
}

const GOES_ON: u32 = 1 << 31;

impl BoundingVolumes {
    /// The bounding volumes of a tree's shapes; none if single precision is too coarse for
    /// the tree.
    pub(crate) fn new<'g>(
        entries: &[Entry],
        tree_space: &TreeSpace,
        shape: impl Fn(&Entry) -> Option<&'g PlacedShape> + Sync,
    ) -> Self {
        let bounding_volume = |entry: &Entry| shape(entry)?.bounding_volume();
        let is_shape = |entry: &Entry| shape(entry).is_some();
        let two_to = |exponent: i32| 2.0f64.powi(exponent);
        let is_fit = tree_space.near > 0.0 && (two_to(-40)..=two_to(40)).contains(&tree_space.scale);
        if !is_fit || !entries.iter().any(is_shape) {
            return Self::default();
        }
        // Leaf by leaf, eight at a time.
        let mut spans = Vec::new();
        let mut of_entry = Vec::with_capacity(entries.len());
        for (leaf, first) in leaves(entries) {
            for (eight, own) in leaf.chunks(BLOCK).enumerate() {
                if is_shape(&own[0]) {
                    spans.push(first + eight * BLOCK..first + eight * BLOCK + own.len());
                }
                let goes_on = if (eight + 1) * BLOCK < leaf.len() { GOES_ON } else { 0 };
                of_entry.extend(own.iter().map(|_| spans.len().saturating_sub(1) as u32 | goes_on));
            }
        }
        let block = |span: &std::ops::Range<usize>| {
            let mut block = BoundingBlock::EMPTY;
            for (lane, entry) in entries[span.clone()].iter().enumerate() {
                block.put(lane, bounding_volume(entry), tree_space);
            }
            block
        };
        let mut blocks: Vec<_> = spans.par_iter().with_min_len(64).map(block).collect();
        // The vector reserves at least four elements, but many trees have one shape.
        blocks.shrink_to_fit();
        Self { blocks, of_entry }
    }

    /// The block of the entry at `place` and of up to seven that follow it in its leaf, and whether more follow; `None`
    /// without bounding volumes.
    #[inline(always)]
    pub(crate) fn block(&self, entry: usize) -> Option<(&BoundingBlock, bool)> {
        let place = *self.of_entry.get(entry)?;
        Some((self.blocks.get((place & !GOES_ON) as usize)?, place & GOES_ON != 0))
    }

    /// Bytes of memory.
    pub(crate) fn memory_bytes(&self) -> usize {
        self.blocks.capacity() * size_of::<BoundingBlock>() + self.of_entry.capacity() * size_of::<u32>()
    }
}

/// The entries leaf by leaf, each leaf with the index of its first.
fn leaves(entries: &[Entry]) -> impl Iterator<Item = (&[Entry], usize)> {
    entries.split_inclusive(Entry::is_last).scan(0, |next, leaf| {
        let first = *next;
        *next += leaf.len();
        Some((leaf, first))
    })
}

/// A ray in single precision, for a conservative first test of eight bounding volumes.
///
/// # Error bound
///
/// Points on the ray are o + h e. Here o is the origin; e is the direction divided by its largest component, which
/// makes that component 1; h is a height as in [`HeightRange`](crate::intersect::watertight::HeightRange), t times that
/// component. For a bounding volume, let W be the largest coordinate of w = o - center, S the largest of a point of the
/// volume, N the largest row sum of absolute values in the map M to its cube, and u = 2⁻²⁴. At a hit |h| ≤ W + S, since
/// |h| is its distance from o on the axis of that component.
///
/// In the cube, the point at h is p + h d, with p = M w and d = M e. As computed here, w has an error of 2.1u W, since
/// the rounding error of o is kept separately. So p has an error of that times N, of u N W from rounding M, and of 5u N
/// W from its sums: 8.1u N W. For the same reasons d has an error of 7u N; the least size of a component, 2⁻⁴⁰ N, is
/// small compared with it. So the point of a hit has an error of less than 15.1u N (W + S). The centre is rounded, and
/// the double-precision hit may be off by `slop` from the line or the shape: `moved` is the sum of both. Let the margin
/// be m = 64u N (W + S) + N `moved` + 16u.
///
/// *Slabs.* The planes of the cube, moved outwards by m, are met at near = -(a + w) / |d| and far = (w - a) / |d|, with
/// the sign of d taken off p for a, and w = 1 + m (or m along y where the bounding volume is flat). Their roundings are
/// worth less than 3u|h d| + 2u (|a| + w)
/// ≤ 7u N (W + S) + 4u on the axis, for which m has room: near ≤ h ≤ far at every hit.
///
/// *Profile.* What is left of the line, between heights among which h is, is again p' + k d' with |k| ≤ 1: p' in its
/// middle, and p' ± d' at its ends, no coordinate beyond 1 + 2m. There x² + y² + c z² + d z + e is a parabola A k² + 2B
/// k + C. At the hit it truly is not positive, and it changes by less than 8 (1 + m) m + 3m² with what the point is
/// wrong by, these last roundings included, which is m at most. Those of A, B, C and of their sum are below 2⁻¹⁷ (1 +
/// m)². So the computed parabola is no greater than `tolerance` = 12 m (1 + m) + 2⁻¹⁵ there, by 2⁻¹⁶ at least, and so
/// is its least value, which is at an end, or C - B² / A where |B| < A; that this is greater is seen from (C -
/// tolerance) A > B², with roundings below 4u B² < 4u A².
///
/// *Tube.* In the space of x, y and r z, the distance of a point from a ring's tube is √((ρ - (1 - r))² + r² z²) - r,
/// and a move of the point changes it by at most the length of the move. So a piece of the line has no hit if its
/// middle is farther outside than half its length: sixteen pieces are tested. A point has an error of m on each axis,
/// including its rounding errors, and an error of its distance of less than 2m + 2⁻¹⁶; half the length of a piece has a
/// relative error of 2⁻²⁰.
///
/// # Certain hits
///
/// A line that is inside a solid somewhere in the range, and outside it somewhere else in the range, crosses its border
/// in between. A point that is inside by m in the cube, and by the tolerance of the profile, is inside, and it is in
/// the range if its height certainly is; a point that is outside by as much is outside. This also holds for double
/// precision, whose errors are far smaller. The ends of the range, 6u of themselves too far out here, have an error
/// below 12u N (W + S) in the cube, which m covers too.
///
/// A bounding volume that is smaller than 2⁻¹⁸ of the tree, or whose map stretches too much for single precision,
/// passes without a test. Otherwise 2⁻⁴² ≤ N ≤ 2⁵⁸ and W ≤ 2⁴⁶, by the bounds on single-precision searches, and nothing
/// over- or underflows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BoundingVolumeRay {
    /// Relative to the tree's origin.
    pub(crate) origin: [f32; 3],
    /// The rounding error of the origin.
    pub(crate) rest: [f32; 3],
    pub(crate) direction: [f32; 3],
}

/// The tolerance: its factor of m (1 + m), and its constant.
pub(crate) const TOLERANCE_PER_MARGIN: f32 = 12.0;
pub(crate) const MIN_TOLERANCE: f32 = 1.0 / (1 << 15) as f32;
/// The error bound of a distance from a tube: its factor of m, and its constant.
pub(crate) const TUBE_ERROR_PER_MARGIN: f32 = 2.0;
pub(crate) const MIN_TUBE_ERROR: f32 = 1.0 / (1 << 16) as f32;
/// Smallest component of a direction in the cube, in units of 64uN.
pub(crate) const MIN_COMPONENT: f32 = 1.0 / (1u64 << 22) as f32;

impl BoundingVolumeRay {
    /// For a ray from nearby; `length` is the size of its direction's largest component.
    #[inline(always)]
    pub(crate) fn new(tree_space: &TreeSpace, ray: &Ray, length: f64) -> Self {
        let exact = ray.origin - tree_space.origin;
        let origin = exact.as_vec3();
        let rest = (exact - origin.as_dvec3()).as_vec3();
        let direction = (ray.direction * (1.0 / length)).as_vec3();
        Self { origin: origin.to_array(), rest: rest.to_array(), direction: direction.to_array() }
    }
}
