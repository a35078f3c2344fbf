//! The last splits: for sixteen primitives or fewer, tries every split along every axis.

use crate::build::primitive::{Bounds, Kind, Primitive, Traits};
use crate::intersect::{Dispatch, Simd};
use crate::tree::BLOCK;
use crate::tree::node::WIDTH;

/// Up to this many primitives, every split is tried.
pub(crate) const SMALL_BUILD_MAX: usize = 2 * BLOCK;
/// The cost of a node, in the units of primitives' costs.
const NODE_COST: f32 = 16.0;

/// The decision for a few primitives.
pub(crate) enum SmallSplit {
    Leaf,
    /// They are sorted: this many go to the left.
    Split(usize),
}

/// Whether they fit one leaf.
#[inline(always)]
fn fits_one_leaf<const COSTS: bool>(primitives: &[Primitive], traits: &[Traits]) -> bool {
    let group = |p: &Primitive| group_of(p, traits);
    let first = group(&primitives[0]);
    let most = match first.0 {
        // It becomes a node over single-instance leaves later.
        Kind::Instance if !COSTS => WIDTH,
        _ => traits[primitives[0].first() as usize].most,
    };
    primitives.len() <= most && primitives[1..].iter().all(|p| group(p) == first)
}

/// Leaves hold one kind: triangles of one mesh, spheres of one cloud.
#[inline(always)]
pub(crate) fn group_of(primitive: &Primitive, traits: &[Traits]) -> (Kind, u32) {
    let kind = traits[primitive.first() as usize].kind;
    (kind, if kind.is_packed() { primitive.first() } else { 0 })
}

/// Decides about a few primitives. With `COSTS` they may be of any kind; without, all tests cost the same.
pub(crate) struct SplitSmall<'a, const COSTS: bool> {
    pub(crate) primitives: &'a mut [Primitive],
    pub(crate) traits: &'a [Traits],
}

impl<const COSTS: bool> Dispatch for SplitSmall<'_, COSTS> {
    type Output = SmallSplit;

    #[inline(always)]
    fn run<L: Simd>(self) -> SmallSplit {
        let Self { primitives, traits } = self;
        let count = primitives.len();
        let could_be_leaf = fits_one_leaf::<COSTS>(primitives, traits);
        if could_be_leaf && (count == 1 || !COSTS) {
            return SmallSplit::Leaf;
        }

        if could_be_leaf && count == 2 {
            // Two primitives have only one split.
            let cost = |p: &Primitive| traits[p.first() as usize].cost as f32;
            let [a, b] = [&primitives[0], &primitives[1]];
            let mut whole = *a;
            whole.grow(b);
            let apart = a.half_area() * cost(a) + b.half_area() * cost(b) + NODE_COST * whole.half_area();
            let is_leaf = (cost(a) + cost(b)) * whole.half_area() <= apart;
            return if is_leaf { SmallSplit::Leaf } else { SmallSplit::Split(1) };
        }

        // In one mesh, only splits that leave at most a full leaf on each side.
        let is_one_mesh = !COSTS && is_one_group(primitives, traits);
        let (least, most) =
            if is_one_mesh { (count - BLOCK.min(count - 1), BLOCK.min(count - 1)) } else { (1, count - 1) };
        let mut best = (f32::INFINITY, 0);
        let mut best_order = [0; SMALL_BUILD_MAX];
        let mut whole = Bounds::EMPTY;
        primitives.iter().for_each(|p| whole.grow(p));
        let mut are_apart = false;
        for axis in 0..3 {
            let order = order_on(axis, primitives);
            let center2 = |at: usize| primitives[order[at] as usize % SMALL_BUILD_MAX].center2_on(axis);
            are_apart |= center2(0) < center2(count - 1);
            let mut right_costs = [0.0; SMALL_BUILD_MAX + 1];
            let (mut right, mut cost) = (Bounds::EMPTY, 0);
            for at in (least..count).rev() {
                let primitive = &primitives[order[at] as usize % SMALL_BUILD_MAX];
                right.grow(primitive);
                if COSTS {
                    cost += traits[primitive.first() as usize].cost;
                }
                if at <= most {
                    right_costs[at] = right.half_area() * if COSTS { cost as f32 } else { 1.0 };
                }
            }
            let (mut left, mut cost) = (Bounds::EMPTY, 0);
            for at in 1..=most {
                let primitive = &primitives[order[at - 1] as usize % SMALL_BUILD_MAX];
                left.grow(primitive);
                if COSTS {
                    cost += traits[primitive.first() as usize].cost;
                }
                if at >= least {
                    let both = left.half_area() * if COSTS { cost as f32 } else { 1.0 } + right_costs[at];
                    if both < best.0 {
                        best = (both, at);
                        best_order = order;
                    }
                }
            }
        }
        if could_be_leaf {
            let area = whole.half_area();
            let all: u32 = primitives.iter().map(|p| traits[p.first() as usize].cost).sum();
            if all as f32 * area <= best.0 + NODE_COST * area {
                return SmallSplit::Leaf;
            }
        }
        if !are_apart {
            return SmallSplit::Split(by_group(primitives, traits));
        }
        let mut copy = [Bounds::EMPTY; SMALL_BUILD_MAX];
        copy[..count].copy_from_slice(primitives);
        for (place, &from) in primitives.iter_mut().zip(&best_order) {
            *place = copy[from as usize % SMALL_BUILD_MAX];
        }
        SmallSplit::Split(best.1)
    }
}

#[inline(always)]
fn is_one_group(primitives: &[Primitive], traits: &[Traits]) -> bool {
    let first = group_of(&primitives[0], traits);
    primitives[1..].iter().all(|p| group_of(p, traits) == first)
}

/// The primitives in the order of their centres, ties by position. Computes each rank by counting the primitives before
/// it.
#[inline(always)]
fn order_on(axis: usize, primitives: &[Primitive]) -> [u8; SMALL_BUILD_MAX] {
    let mut centers = [i32::MAX; SMALL_BUILD_MAX];
    let mut start = i32::MAX;
    for (center, primitive) in centers.iter_mut().zip(primitives) {
        *center = primitive.center2_on(axis);
        start = start.min(*center);
    }
    // The bits of the centre that fit next to four bits for the position.
    let end = centers[..primitives.len().min(SMALL_BUILD_MAX)].iter().copied().max().unwrap_or(start);
    let shift = 5_u32.saturating_sub(end.wrapping_sub(start).leading_zeros());
    let mut keys = [i32::MAX; SMALL_BUILD_MAX];
    for lane in 0..primitives.len().min(SMALL_BUILD_MAX) {
        let key = centers[lane].wrapping_sub(start) as u32 >> shift;
        keys[lane] = (key << 4) as i32 | lane as i32;
    }
    let mut ranks = [0_i32; SMALL_BUILD_MAX];
    for key in keys {
        for lane in 0..SMALL_BUILD_MAX {
            ranks[lane] += i32::from(key < keys[lane]);
        }
    }
    let mut order = [0; SMALL_BUILD_MAX];
    for lane in 0..SMALL_BUILD_MAX {
        order[ranks[lane] as usize % SMALL_BUILD_MAX] = lane as u8;
    }
    order
}

/// Groups primitives by kind; returns the change of kind that is nearest to the middle, or the middle.
#[cold]
#[inline(never)]
fn by_group(primitives: &mut [Primitive], traits: &[Traits]) -> usize {
    let group = |p: &Primitive| group_of(p, traits);
    primitives.sort_unstable_by_key(|p| (group(p), p.first(), p.second()));
    let middle = primitives.len() / 2;
    (1..primitives.len())
        .filter(|&at| group(&primitives[at - 1]) != group(&primitives[at]))
        .min_by_key(|&at| at.abs_diff(middle))
        .unwrap_or(middle)
}
