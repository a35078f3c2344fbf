//! SAH bins: finds the cheapest split and performs it.
//!
//! I. Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies", IEEE Symposium on Interactive Ray Tracing,
//! 2007. Unlike there, the range of a side's centres is not measured: it is the parent's range on that side of the
//! split, clipped to the side's box. It is measured only if the bins show that this is much too wide.

use crate::build::primitive::{Bounds, Primitive, Traits};
use crate::intersect::{Dispatch, Simd};
use crate::tree::BLOCK;

/// Bins on an axis: a power of two.
const MAX_BINS: usize = 16;
/// Bins for nodes with few primitives, where evaluating all bins takes longer than filling them.
const FEWER_BINS: usize = 8;
const FEWER_BELOW: usize = 64;

/// The range of twice the primitives' centres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Centers {
    low: [i32; 4],
    high: [i32; 4],
}

impl Centers {
    const EMPTY: Self = Self { low: [i32::MAX; 4], high: [i32::MIN; 4] };

    #[inline(always)]
    pub(crate) fn grow(&mut self, centers: &Self) {
        for lane in 0..4 {
            self.low[lane] = self.low[lane].min(centers.low[lane]);
            self.high[lane] = self.high[lane].max(centers.high[lane]);
        }
    }

    fn within(mut self, bounds: &Bounds) -> Self {
        for axis in 0..3 {
            let [low, high] = bounds.range2(axis);
            self.low[axis] = self.low[axis].max(low);
            self.high[axis] = self.high[axis].min(high);
        }
        self
    }

    pub(crate) fn start(&self) -> [i32; 3] {
        [self.low[0], self.low[1], self.low[2]]
    }

    pub(crate) fn sizes(&self) -> [f32; 3] {
        std::array::from_fn(|axis| (i64::from(self.high[axis]) - i64::from(self.low[axis])) as f32)
    }

    pub(crate) fn coincide(&self) -> bool {
        (0..3).all(|axis| self.low[axis] == self.high[axis])
    }

    pub(crate) fn longest_axis(&self) -> usize {
        let size = |axis: usize| i64::from(self.high[axis]) - i64::from(self.low[axis]);
        (0..3).fold(0, |best, axis| if size(axis) > size(best) { axis } else { best })
    }
}

/// Maps a centre to its bin. A centre outside the range goes to some bin, always the same.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Binning {
    start: [i32; 4],
    factor: [f32; 4],
    bins: usize,
}

impl Binning {
    pub(crate) fn new(centers: &Centers, count: usize) -> Self {
        let bins = if count < FEWER_BELOW { FEWER_BINS } else { MAX_BINS };
        let mut binning = Self { start: centers.low, factor: [0.0; 4], bins };
        for axis in 0..3 {
            let size = centers.high[axis].wrapping_sub(centers.low[axis]);
            if size > 0 {
                // The first and the last bin are half as wide as others.
                binning.factor[axis] = (bins as f32 - 1.0) / size as f32;
            }
        }
        binning
    }

    // Adding 2^23 leaves an integer in the low bits, rounded to nearest.
    #[inline(always)]
    fn bin_of(center2: i32, start: i32, factor: f32) -> usize {
        let place = center2.wrapping_sub(start) as f32 * factor;
        (place + 8_388_608.0).to_bits() as usize % MAX_BINS
    }

    // The last lane only fills the vector.
    #[inline(always)]
    fn bins(&self, primitive: &Primitive) -> [u32; 4] {
        let center2 = primitive.center2();
        std::array::from_fn(|lane| Self::bin_of(center2[lane], self.start[lane], self.factor[lane]) as u32)
    }

    /// [`Self::bins`] for eight centres in vectors.
    #[inline(always)]
    fn bins_of_eight(&self, eight: &[Primitive; 8]) -> [[u32; 4]; 8] {
        let mut places = [[0; 4]; 8];
        for (place, primitive) in places.iter_mut().zip(eight) {
            *place = self.bins(primitive);
        }
        places
    }

    #[inline(always)]
    fn is_left(&self, primitive: &Primitive, axis: usize, bin: usize) -> bool {
        Self::bin_of(primitive.center2_on(axis), self.start[axis], self.factor[axis]) < bin
    }

    /// The lower end of a bin's range, give or take a hundredth of it.
    fn edge(&self, axis: usize, bin: usize, margin: f64) -> i32 {
        let place = (bin as f64 - 0.5 + margin) / f64::from(self.factor[axis]);
        (f64::from(self.start[axis]) + place) as i32
    }
}

/// From this many primitives on, bins are filled in two alternating rows (see [`Bins`]).
const TWO_ROWS_FROM: usize = 32;

/// The contents of a node's bins.
#[derive(Clone)]
pub(crate) struct Bins {
    /// The first row has the total once the bins are filled. With two rows, primitives alternate between them:
    /// neighbours mostly share a bin, and growing the same one again would wait for the last result.
    tallies: [Tally; 2],
}

/// The contents of one row of bins.
#[derive(Clone)]
struct Tally {
    bounds: [[Bounds; MAX_BINS]; 3],
    counts: [[u32; MAX_BINS]; 3],
    costs: [[u32; MAX_BINS]; 3],
}

impl Tally {
    const EMPTY: Self = Self {
        bounds: [[Bounds::EMPTY; MAX_BINS]; 3],
        counts: [[0; MAX_BINS]; 3],
        costs: [[0; MAX_BINS]; 3],
    };

    #[inline(always)]
    fn clear(&mut self, bins: usize) {
        for axis in 0..3 {
            self.bounds[axis][..bins].fill(Bounds::EMPTY);
            self.counts[axis][..bins].fill(0);
            self.costs[axis][..bins].fill(0);
        }
    }

    #[inline(always)]
    fn add<const COSTS: bool>(&mut self, bins: &[u32; 4], primitive: &Primitive, traits: &[Traits]) {
        let cost = if COSTS { traits[primitive.first() as usize].cost } else { 0 };
        for (axis, &bin) in bins[..3].iter().enumerate() {
            let bin = bin as usize % MAX_BINS;
            self.bounds[axis][bin].grow(primitive);
            self.counts[axis][bin] += 1;
            if COSTS {
                self.costs[axis][bin] += cost;
            }
        }
    }

    #[inline(always)]
    fn join(&mut self, other: &Self, bins: usize) {
        for axis in 0..3 {
            for bin in 0..bins {
                self.bounds[axis][bin].grow(&other.bounds[axis][bin]);
                self.counts[axis][bin] += other.counts[axis][bin];
                self.costs[axis][bin] += other.costs[axis][bin];
            }
        }
    }
}

impl Bins {
    pub(crate) const EMPTY: Self = Self { tallies: [Tally::EMPTY, Tally::EMPTY] };

    pub(crate) fn join(&mut self, other: &Self) {
        self.tallies[0].join(&other.tallies[0], MAX_BINS);
    }

    /// Tallies primitives in this many rows.
    #[inline(always)]
    fn fill<const ROWS: usize, const COSTS: bool>(
        &mut self,
        primitives: &[Primitive],
        binning: Binning,
        traits: &[Traits],
    ) {
        let tallies = &mut self.tallies[..ROWS];
        for tally in tallies.iter_mut() {
            tally.clear(binning.bins);
        }
        let (eights, rest) = primitives.as_chunks::<8>();
        for eight in eights {
            let places = binning.bins_of_eight(eight);
            for (i, (place, primitive)) in places.iter().zip(eight).enumerate() {
                tallies[i % ROWS].add::<COSTS>(place, primitive, traits);
            }
        }
        for primitive in rest {
            tallies[0].add::<COSTS>(&binning.bins(primitive), primitive, traits);
        }
        if let [all, others] = tallies {
            all.join(others, binning.bins);
        }
    }
}

/// A split between bins.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Split {
    pub(crate) binning: Binning,
    pub(crate) axis: usize,
    /// The first bin on the right.
    pub(crate) bin: usize,
    /// Primitives on the left.
    pub(crate) left: usize,
    /// The range of the centres on each side.
    centers: [Centers; 2],
    /// Bins that the centres occupy, on the axis where they occupy most.
    pub(crate) occupied_bins: usize,
}

impl Split {
    /// The binning of a side.
    pub(crate) fn next(&self, side: usize, count: usize) -> Binning {
        Binning::new(&self.centers[side], count)
    }

    #[inline(always)]
    pub(crate) fn is_left(&self, primitive: &Primitive) -> bool {
        self.binning.is_left(primitive, self.axis, self.bin)
    }
}

/// The cost of one side: with `COSTS` the sum of the primitives' costs, else its number of blocks.
#[inline(always)]
fn cost_of<const COSTS: bool>(count: u32, cost: u32) -> f32 {
    if COSTS { cost as f32 } else { count.div_ceil(BLOCK as u32) as f32 }
}

/// Finds the cheapest split; `None` if all centres are in one bin on each axis.
pub(crate) struct BestSplit<'a, const COSTS: bool> {
    pub(crate) bins: &'a Bins,
    pub(crate) binning: Binning,
}

impl<const COSTS: bool> Dispatch for BestSplit<'_, COSTS> {
    type Output = Option<Split>;

    #[inline(always)]
    fn run<L: Simd>(self) -> Option<Split> {
        let Self { bins: Bins { tallies: [bins, ..] }, binning } = self;
        let last = binning.bins;
        let mut best = (f32::INFINITY, 0, 0);
        let mut occupied = [(0, 0); 3];
        let mut occupied_bins = 0;
        for (axis, occupied) in occupied.iter_mut().enumerate() {
            let (bounds, counts, costs) = (&bins.bounds[axis], &bins.counts[axis], &bins.costs[axis]);
            let low = counts[..last].iter().position(|&count| count > 0)?;
            let high = counts[..last].iter().rposition(|&count| count > 0).unwrap_or(low);
            *occupied = (low, high);
            occupied_bins = occupied_bins.max(high - low + 1);

            let mut right_costs = [0.0; MAX_BINS];
            let (mut right, mut count, mut cost) = (Bounds::EMPTY, 0, 0);
            for bin in (low + 1..=high).rev() {
                right.grow(&bounds[bin]);
                count += counts[bin];
                cost += costs[bin];
                right_costs[bin % MAX_BINS] = right.half_area() * cost_of::<COSTS>(count, cost);
            }
            let (mut left, mut count, mut cost) = (Bounds::EMPTY, 0, 0);
            for bin in low + 1..=high {
                left.grow(&bounds[bin - 1]);
                count += counts[bin - 1];
                cost += costs[bin - 1];
                let both = left.half_area() * cost_of::<COSTS>(count, cost) + right_costs[bin % MAX_BINS];
                if both < best.0 {
                    best = (both, axis, bin);
                }
            }
        }
        let (_, axis, bin) = best;
        if bin == 0 {
            return None;
        }

        let mut sides = [Bounds::EMPTY; 2];
        for other in 0..last {
            sides[usize::from(other >= bin)].grow(&bins.bounds[axis][other]);
        }
        let left = bins.counts[axis][..bin].iter().sum::<u32>() as usize;
        // The range of the occupied bins.
        let mut whole = Centers { low: binning.start, high: binning.start };
        for (axis, &(low, high)) in occupied.iter().enumerate() {
            if binning.factor[axis] > 0.0 {
                whole.low[axis] = binning.edge(axis, low, -0.01);
                whole.high[axis] = binning.edge(axis, high + 1, 0.01);
            }
        }
        let mut centers = [whole; 2];
        centers[0].high[axis] = binning.edge(axis, bin, 0.01);
        centers[1].low[axis] = binning.edge(axis, bin, -0.01);
        let centers = [centers[0].within(&sides[0]), centers[1].within(&sides[1])];
        Some(Split { binning, axis, bin, left, centers, occupied_bins })
    }
}

/// Measures the range of the primitives' centres.
pub(crate) struct FindCenters<'a> {
    pub(crate) primitives: &'a [Primitive],
}

impl Dispatch for FindCenters<'_> {
    type Output = Centers;

    #[inline(always)]
    fn run<L: Simd>(self) -> Centers {
        let mut centers = Centers::EMPTY;
        for primitive in self.primitives {
            let center2 = primitive.center2();
            centers.grow(&Centers { low: center2, high: center2 });
        }
        centers
    }
}

/// Fills the bins with primitives.
pub(crate) struct Fill<'a, const COSTS: bool> {
    pub(crate) primitives: &'a [Primitive],
    pub(crate) binning: Binning,
    pub(crate) bins: &'a mut Bins,
    pub(crate) traits: &'a [Traits],
}

impl<const COSTS: bool> Dispatch for Fill<'_, COSTS> {
    type Output = ();

    #[inline(always)]
    fn run<L: Simd>(self) {
        let Self { primitives, binning, bins, traits } = self;
        if primitives.len() >= TWO_ROWS_FROM {
            bins.fill::<2, COSTS>(primitives, binning, traits);
        } else {
            bins.fill::<1, COSTS>(primitives, binning, traits);
        }
    }
}

/// Moves primitives to the sides of a split, in their order.
pub(crate) struct Part<'a> {
    pub(crate) primitives: &'a [Primitive],
    pub(crate) split: &'a Split,
    pub(crate) sides: [&'a mut [Primitive]; 2],
}

impl Dispatch for Part<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Simd>(self) {
        let Self { primitives, split, sides: [left, right] } = self;
        let (axis, bin, binning) = (split.axis, split.bin, split.binning);
        let mut sides = Sides { left, right, places: [0; 2] };
        let (eights, rest) = primitives.as_chunks::<8>();
        for eight in eights {
            let places = binning.bins_of_eight(eight);
            for (place, primitive) in places.iter().zip(eight) {
                sides.put(primitive, (place[axis] as usize) < bin);
            }
        }
        for primitive in rest {
            sides.put(primitive, binning.is_left(primitive, axis, bin));
        }
    }
}

/// The sides of a split, and the number of primitives in each so far.
struct Sides<'a> {
    left: &'a mut [Primitive],
    right: &'a mut [Primitive],
    places: [usize; 2],
}

impl Sides<'_> {
    #[inline(always)]
    fn put(&mut self, primitive: &Primitive, is_left: bool) {
        let [left, right] = &mut self.places;
        // Branch-free: the branch would often be mispredicted.
        let place = if is_left { &mut self.left[*left] } else { &mut self.right[*right] };
        *place = *primitive;
        *left += usize::from(is_left);
        *right += usize::from(!is_left);
    }
}

/// Moves the primitives left of a split to the front and returns their number. `buffer` is a buffer for all of them.
pub(crate) struct PartPiece<'a> {
    pub(crate) primitives: &'a mut [Primitive],
    pub(crate) split: &'a Split,
    pub(crate) buffer: &'a mut [Primitive],
}

impl Dispatch for PartPiece<'_> {
    type Output = usize;

    #[inline(always)]
    fn run<L: Simd>(self) -> usize {
        let Self { primitives, split, buffer } = self;
        let (mut left, mut right) = (0, 0);
        for place in 0..primitives.len() {
            let primitive = primitives[place];
            let is_left = split.is_left(&primitive);
            // Branch-free: a wrong element is overwritten later.
            primitives[left] = primitive;
            buffer[right] = primitive;
            left += usize::from(is_left);
            right += usize::from(!is_left);
        }
        primitives[left..].copy_from_slice(&buffer[..right]);
        left
    }
}
