//! From geometries to a binary tree: binned SAH, the same tree from any number of threads.
//!
//! I. Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies", IEEE Symposium on Interactive Ray Tracing,
//! 2007. Nodes go to places known in advance (a subtree over n primitives owns 2n - 1 of them), so that threads share
//! nothing, and its depth is bounded: past [`SAH_DEPTH`] levels every split is in the middle.

use lumbre_geometry::Aabb;

use crate::node::{Units, round_down, round_up};

/// The kind of a primitive. A leaf holds one kind, and triangles of one mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub(crate) enum Kind {
    Triangle,
    Shape,
    Instance,
    Custom,
}

/// A finite primitive on its way into the tree.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Primitive {
    pub(crate) bounds: Bounds,
    pub(crate) geometry: u32,
    pub(crate) primitive: u32,
}

/// A box in tree units.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounds {
    pub(crate) min: [f32; 3],
    pub(crate) max: [f32; 3],
}

impl Bounds {
    const EMPTY: Self = Self { min: [f32::INFINITY; 3], max: [f32::NEG_INFINITY; 3] };

    /// The smallest one around a box in space.
    #[inline]
    pub(crate) fn around(units: &Units, bounds: &Aabb) -> Self {
        let min = (bounds.min - units.origin) * units.scale;
        let max = (bounds.max - units.origin) * units.scale;
        Self { min: min.to_array().map(round_down), max: max.to_array().map(round_up) }
    }

    #[inline(always)]
    fn grow(&mut self, other: &Self) {
        for axis in 0..3 {
            self.min[axis] = lesser(self.min[axis], other.min[axis]);
            self.max[axis] = greater(self.max[axis], other.max[axis]);
        }
    }

    #[inline(always)]
    fn grow_to(&mut self, point: [f32; 3]) {
        self.grow(&Self { min: point, max: point });
    }

    /// Half the area; 0 when empty.
    #[inline(always)]
    pub(crate) fn half_area(&self) -> f32 {
        let [x, y, z] = std::array::from_fn(|axis| greater(self.max[axis] - self.min[axis], 0.0));
        x * y + y * z + z * x
    }

    // Twice the middle.
    #[inline(always)]
    fn center2(&self) -> [f32; 3] {
        std::array::from_fn(|axis| self.min[axis] + self.max[axis])
    }
}

// One instruction each, which f32::min and f32::max are not.
#[inline(always)]
fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// What the build must know of a geometry: the kind of its primitives, and what a test of one costs, a node being 1.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Traits {
    pub(crate) kind: Kind,
    pub(crate) cost: f32,
}

/// A node of the binary tree. The left child of an inner node comes right after it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BinaryNode {
    pub(crate) bounds: Bounds,
    /// Of a leaf, how many primitives; 0 for an inner node.
    pub(crate) count: u32,
    /// Of a leaf, its first primitive; else how far behind it the right child stands.
    pub(crate) place: u32,
}

const UNUSED: BinaryNode = BinaryNode { bounds: Bounds::EMPTY, count: 0, place: 0 };

/// The most primitives in a leaf.
pub(crate) const LEAF: usize = 8;
const BINS: usize = 16;
/// Levels that may be split by SAH; then come at most 32 more, each halving.
const SAH_DEPTH: u32 = 64;
/// From how many primitives on two threads share the work.
const PARALLEL: usize = 4096;
/// How many primitives a thread bins at a time, which fixes the order of the sums.
const CHUNK: usize = 1 << 16;

/// The binary tree over `primitives` (not none), which it reorders; the root comes first.
pub(crate) fn binary_tree(primitives: &mut [Primitive], traits: &[Traits]) -> Vec<BinaryNode> {
    let mut nodes = vec![UNUSED; 2 * primitives.len() - 1];
    let bounds = measure(primitives);
    split(primitives, 0, traits, bounds, 0, &mut nodes);
    nodes
}

/// The boxes around primitives and around (twice) their centres.
#[derive(Clone, Copy)]
struct Extent {
    bounds: Bounds,
    centers2: Bounds,
}

impl Extent {
    const EMPTY: Self = Self { bounds: Bounds::EMPTY, centers2: Bounds::EMPTY };

    #[inline(always)]
    fn add(&mut self, primitive: &Primitive) {
        self.bounds.grow(&primitive.bounds);
        self.centers2.grow_to(primitive.bounds.center2());
    }
}

fn measure(primitives: &[Primitive]) -> Extent {
    if primitives.len() <= CHUNK {
        let mut extent = Extent::EMPTY;
        primitives.iter().for_each(|primitive| extent.add(primitive));
        return extent;
    }
    let (left, right) = primitives.split_at(primitives.len() / 2);
    let (mut left, right) = rayon::join(|| measure(left), || measure(right));
    left.bounds.grow(&right.bounds);
    left.centers2.grow(&right.centers2);
    left
}

fn split(
    primitives: &mut [Primitive],
    first: usize,
    traits: &[Traits],
    extent: Extent,
    depth: u32,
    nodes: &mut [BinaryNode],
) {
    let count = primitives.len();
    let is_one_kind = count <= LEAF && is_uniform(primitives, traits);
    let leaf_cost = if is_one_kind && (count == 1 || kind_of(&primitives[0], traits) != Kind::Instance) {
        primitives.iter().map(|p| traits[p.geometry as usize].cost).sum()
    } else {
        f32::INFINITY
    };
    let best = if count == 1 || depth >= SAH_DEPTH { None } else { best_split(primitives, traits, &extent) };
    let leaf_wins = best.as_ref().is_none_or(|best| leaf_cost <= best.cost);
    if leaf_cost < f32::INFINITY && leaf_wins {
        nodes[0] = BinaryNode { bounds: extent.bounds, count: count as u32, place: first as u32 };
        return;
    }

    let middle = match &best {
        Some(best) => partition(primitives, best, &extent),
        None => split_by_order(primitives, traits, &extent),
    };
    let (left, right) = primitives.split_at_mut(middle);
    let (this, rest) = nodes.split_first_mut().expect("a place for every node");
    *this = BinaryNode { bounds: extent.bounds, count: 0, place: 2 * middle as u32 };
    let (left_nodes, right_nodes) = rest.split_at_mut(2 * middle - 1);
    let mut go_left = || split(left, first, traits, measure(left), depth + 1, left_nodes);
    let mut go_right = || split(right, first + middle, traits, measure(right), depth + 1, right_nodes);
    if count >= PARALLEL {
        rayon::join(go_left, go_right);
    } else {
        go_left();
        go_right();
    }
}

fn kind_of(primitive: &Primitive, traits: &[Traits]) -> Kind {
    traits[primitive.geometry as usize].kind
}

/// Whether the primitives can stand in one leaf.
fn is_uniform(primitives: &[Primitive], traits: &[Traits]) -> bool {
    let first = &primitives[0];
    let kind = kind_of(first, traits);
    primitives[1..]
        .iter()
        .all(|p| kind_of(p, traits) == kind && (kind != Kind::Triangle || p.geometry == first.geometry))
}

struct Split {
    axis: usize,
    // The first bin on the right.
    bin: usize,
    cost: f32,
}

/// What turns a centre into a bin.
#[derive(Clone, Copy)]
struct Binning {
    start: [f32; 3],
    factor: [f32; 3],
}

impl Binning {
    fn new(extent: &Extent) -> Self {
        let factor = std::array::from_fn(|axis| {
            let size = extent.centers2.max[axis] - extent.centers2.min[axis];
            let factor = BINS as f32 * 0.9999 / size;
            if factor.is_finite() { factor } else { 0.0 }
        });
        Self { start: extent.centers2.min, factor }
    }

    #[inline(always)]
    fn bin(&self, axis: usize, primitive: &Primitive) -> usize {
        let center2 = primitive.bounds.min[axis] + primitive.bounds.max[axis];
        let bin = ((center2 - self.start[axis]) * self.factor[axis]) as usize;
        if bin < BINS { bin } else { BINS - 1 }
    }
}

#[derive(Clone, Copy)]
struct Bin {
    bounds: Bounds,
    cost: f32,
    count: u32,
}

type Bins = [[Bin; BINS]; 3];

const NO_BINS: Bins = [[Bin { bounds: Bounds::EMPTY, cost: 0.0, count: 0 }; BINS]; 3];

fn fill_bins(primitives: &[Primitive], traits: &[Traits], binning: &Binning) -> Bins {
    if primitives.len() <= CHUNK {
        let mut bins = NO_BINS;
        for primitive in primitives {
            let cost = traits[primitive.geometry as usize].cost;
            for (axis, bins) in bins.iter_mut().enumerate() {
                let bin = &mut bins[binning.bin(axis, primitive)];
                bin.bounds.grow(&primitive.bounds);
                bin.cost += cost;
                bin.count += 1;
            }
        }
        return bins;
    }
    let (left, right) = primitives.split_at(primitives.len() / 2);
    let (mut left, right) =
        rayon::join(|| fill_bins(left, traits, binning), || fill_bins(right, traits, binning));
    for (left, right) in left.iter_mut().flatten().zip(right.iter().flatten()) {
        left.bounds.grow(&right.bounds);
        left.cost += right.cost;
        left.count += right.count;
    }
    left
}

/// The cheapest split between bins, with its cost; `None` when all centres coincide.
fn best_split(primitives: &[Primitive], traits: &[Traits], extent: &Extent) -> Option<Split> {
    let binning = Binning::new(extent);
    let bins = fill_bins(primitives, traits, &binning);
    let mut best: Option<Split> = None;
    let area = extent.bounds.half_area();
    // A flat or tiny parent has no area to compare with: any split is as good.
    let per_area = if area > f32::MIN_POSITIVE { 1.0 / area } else { 0.0 };
    for (axis, bins) in bins.iter().enumerate() {
        let mut right_costs = [0.0; BINS];
        let mut right = Bin { bounds: Bounds::EMPTY, cost: 0.0, count: 0 };
        for bin in (1..BINS).rev() {
            right.bounds.grow(&bins[bin].bounds);
            right.cost += bins[bin].cost;
            right.count += bins[bin].count;
            right_costs[bin] =
                if right.count == 0 { f32::INFINITY } else { right.bounds.half_area() * right.cost };
        }
        let mut left = Bin { bounds: Bounds::EMPTY, cost: 0.0, count: 0 };
        for bin in 1..BINS {
            left.bounds.grow(&bins[bin - 1].bounds);
            left.cost += bins[bin - 1].cost;
            left.count += bins[bin - 1].count;
            if left.count == 0 {
                continue;
            }
            let cost = 1.0 + (left.bounds.half_area() * left.cost + right_costs[bin]) * per_area;
            if cost < best.as_ref().map_or(f32::INFINITY, |best| best.cost) {
                best = Some(Split { axis, bin, cost });
            }
        }
    }
    best
}

/// Brings those left of the split to the front; returns how many they are: neither none nor all.
fn partition(primitives: &mut [Primitive], split: &Split, extent: &Extent) -> usize {
    let binning = Binning::new(extent);
    let is_left = |primitive: &Primitive| binning.bin(split.axis, primitive) < split.bin;
    let (mut low, mut high) = (0, primitives.len());
    loop {
        while low < high && is_left(&primitives[low]) {
            low += 1;
        }
        while low < high && !is_left(&primitives[high - 1]) {
            high -= 1;
        }
        if low == high {
            return low;
        }
        primitives.swap(low, high - 1);
        low += 1;
        high -= 1;
    }
}

/// Without a SAH split: in the middle by kind, then geometry, then along the longest axis, so that leaves of one kind
/// come about even where everything stands in one place.
fn split_by_order(primitives: &mut [Primitive], traits: &[Traits], extent: &Extent) -> usize {
    let size: [f32; 3] = std::array::from_fn(|axis| extent.centers2.max[axis] - extent.centers2.min[axis]);
    let axis = (0..3).fold(0, |best, axis| if size[axis] > size[best] { axis } else { best });
    let key = |p: &Primitive| {
        let center2 = p.bounds.center2()[axis];
        (kind_of(p, traits), if kind_of(p, traits) == Kind::Triangle { p.geometry } else { 0 }, center2)
    };
    let order = |a: &Primitive, b: &Primitive| {
        let (a_key, b_key) = (key(a), key(b));
        (a_key.0, a_key.1)
            .cmp(&(b_key.0, b_key.1))
            .then(a_key.2.total_cmp(&b_key.2))
            .then((a.geometry, a.primitive).cmp(&(b.geometry, b.primitive)))
    };
    let middle = primitives.len() / 2;
    if primitives.len() > LEAF {
        primitives.select_nth_unstable_by(middle, order);
        return middle;
    }
    // Few: cut where the kind changes.
    primitives.sort_unstable_by(order);
    let group = |p: &Primitive| (key(p).0, key(p).1);
    (1..primitives.len())
        .filter(|&at| group(&primitives[at - 1]) != group(&primitives[at]))
        .min_by_key(|&at| at.abs_diff(middle))
        .unwrap_or(middle)
}
