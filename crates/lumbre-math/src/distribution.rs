//! Sampling in proportion to weights: a point of a line or an image, or one of many items.
//!
//! Weights that are not positive (zero, negative, NaN) or not finite count as zero, and an item of weight zero
//! is never chosen. Without any positive weight the constructors return `None`.
//!
//! ```
//! use lumbre_math::distribution::{AliasTable, PiecewiseConstant1D};
//!
//! let line = PiecewiseConstant1D::new(&[1.0, 0.0, 3.0]).unwrap();
//! let (x, density) = line.sample(0.625);
//! assert!((x - 5.0 / 6.0).abs() < 1e-8 && (density - 2.25).abs() < 1e-8);
//!
//! let lamps = AliasTable::new(&[40.0, 60.0, 0.0]).unwrap();
//! let choice = lamps.sample(0.7);
//! assert!(choice.index < 2 && choice.probability == lamps.probability(choice.index));
//! ```

use glam::DVec2;

use crate::Elementary;

/// The largest number below 1.
const BELOW_ONE: f64 = 1.0 - f64::EPSILON / 2.0;

/// Cumulative sums are integers out of this total: their differences are exact probabilities, so `sample` and
/// `pdf` agree to the last bit, in half the memory of doubles.
const TOTAL: u32 = u32::MAX;

fn weight(raw: f64) -> f64 {
    if 0.0 < raw && raw < f64::INFINITY { raw } else { 0.0 }
}

/// Fills `starts[i]` with the share of [`TOTAL`] of the weights before `i`, at least 1 for each positive
/// weight. Returns the sum of the weights divided by the largest, and the largest; both 0 when there is no
/// positive weight.
fn accumulate(starts: &mut [u32], weight_at: impl Fn(usize) -> f64) -> (f64, f64) {
    let largest = (0..starts.len()).map(&weight_at).fold(0.0, f64::max);
    if largest == 0.0 {
        starts.fill(0);
        return (0.0, 0.0);
    }
    // Relative to the largest, so that no sum overflows.
    let relative = |i: usize| weight_at(i) / largest;
    let mut sum = 0.0;
    let mut ahead = 0_u32;
    for i in 0..starts.len() {
        sum += relative(i);
        ahead += u32::from(weight_at(i) > 0.0);
    }
    let (mut before, mut start) = (0.0, 0);
    for (i, slot) in starts.iter_mut().enumerate() {
        *slot = start;
        before += relative(i);
        let positive = u32::from(weight_at(i) > 0.0);
        ahead -= positive;
        let share = (before / sum * f64::from(TOTAL)).rounded() as u32;
        // Leaves room for this weight and the ones after it; the last positive one ends at the total itself.
        start = if ahead == 0 { TOTAL } else { share.clamp(start + positive, TOTAL - ahead) };
        if positive == 0 {
            start = *slot;
        }
    }
    (sum, largest)
}

/// The cell of `u`, and the offset in it.
fn find(starts: &[u32], u: f64) -> (usize, f64) {
    // Truncated to at most TOTAL - 1, hence inside a cell that is not empty.
    let x = u.clamp(0.0, BELOW_ONE) * f64::from(TOTAL);
    let x = x.min(f64::from(TOTAL).next_down());
    let cell = starts.partition_point(|&start| f64::from(start) <= x) - 1;
    let offset = (x - f64::from(starts[cell])) / f64::from(width(starts, cell));
    (cell, offset.min(BELOW_ONE))
}

/// The probability of a cell, out of [`TOTAL`].
fn width(starts: &[u32], cell: usize) -> u32 {
    starts.get(cell + 1).copied().unwrap_or(TOTAL) - starts[cell]
}

/// A density over `[0, 1)` that is constant on each of `n` cells of equal length.
#[derive(Clone, Debug, PartialEq)]
pub struct PiecewiseConstant1D {
    // Never empty. starts[0] = 0, ascending, at most TOTAL; a cell of weight zero is empty.
    starts: Vec<u32>,
    mean: f64,
}

impl PiecewiseConstant1D {
    /// The density proportional to `weights`, one for each cell. `None` when no weight is positive or there are more
    /// than 2³² - 2 of them.
    pub fn new(weights: &[f64]) -> Option<Self> {
        if weights.len() >= TOTAL as usize {
            return None;
        }
        let mut starts = vec![0; weights.len()];
        let (sum, largest) = accumulate(&mut starts, |i| weight(weights[i]));
        (largest > 0.0).then(|| Self { mean: sum / weights.len() as f64 * largest, starts })
    }

    /// For each cell the probability of all before it, out of [`PiecewiseConstant1D::TOTAL`]: ascending, from 0. A cell
    /// of weight zero begins where the next one does.
    pub fn starts(&self) -> &[u32] {
        &self.starts
    }

    /// What probabilities are out of in [`PiecewiseConstant1D::starts`].
    pub const TOTAL: u32 = TOTAL;

    /// The number of cells.
    pub fn cells(&self) -> usize {
        self.starts.len()
    }

    /// The mean of the weights: the integral over `[0, 1)` of the piecewise constant function.
    pub fn mean(&self) -> f64 {
        self.mean
    }

    /// Maps a uniform `u` of `[0, 1)` to a point of `[0, 1)` and the density there, which is never zero. Time
    /// O(log n).
    pub fn sample(&self, u: f64) -> (f64, f64) {
        let (cell, offset) = find(&self.starts, u);
        (position(cell, offset, self.cells()), self.cell_pdf(cell))
    }

    /// The cell for a uniform `u` of `[0, 1)`, the remainder of `u` as a new uniform number, and the density in
    /// the cell.
    pub fn sample_cell(&self, u: f64) -> (usize, f64, f64) {
        let (cell, offset) = find(&self.starts, u);
        (cell, offset, self.cell_pdf(cell))
    }

    /// The density at `x`; 0 outside `[0, 1)`.
    pub fn pdf(&self, x: f64) -> f64 {
        if (0.0..1.0).contains(&x) { self.cell_pdf(cell_at(x, self.cells())) } else { 0.0 }
    }

    /// The density in a cell; 0 for an index out of range.
    pub fn cell_pdf(&self, cell: usize) -> f64 {
        self.cell_probability(cell) * self.cells() as f64
    }

    /// The probability of a cell; 0 for an index out of range.
    pub fn cell_probability(&self, cell: usize) -> f64 {
        if cell < self.cells() { f64::from(width(&self.starts, cell)) / f64::from(TOTAL) } else { 0.0 }
    }

    /// The inverse of [`PiecewiseConstant1D::sample`]: the probability of everything before `x`.
    pub fn invert(&self, x: f64) -> f64 {
        let x = x.clamp(0.0, BELOW_ONE);
        let cell = cell_at(x, self.cells());
        invert_in(&self.starts, cell, x * self.cells() as f64 - cell as f64)
    }
}

/// A density over the unit square that is constant on each of `columns` × `rows` cells, for environment maps.
///
/// It takes four bytes a cell and does not keep the weights.
#[derive(Clone, Debug, PartialEq)]
pub struct PiecewiseConstant2D {
    columns: usize,
    // `columns` starts for each row. Those of a row of weight zero are all zero; the marginal never chooses it.
    rows: Vec<u32>,
    marginal: PiecewiseConstant1D,
}

impl PiecewiseConstant2D {
    /// The density proportional to `weights`, row by row. `None` when no weight is positive, or when `weights` is not
    /// a whole number of rows of `columns`.
    pub fn new(weights: &[f32], columns: usize) -> Option<Self> {
        if columns == 0 || !weights.len().is_multiple_of(columns) {
            return None;
        }
        Self::from_fn(columns, weights.len() / columns, |x, y| weights[y * columns + x])
    }

    /// The density proportional to `weight_at(column, row)`, which is called several times for each cell and
    /// must be deterministic. `None` when no weight is positive, or when there are more than 2³² - 2 columns or
    /// rows.
    pub fn from_fn(columns: usize, rows: usize, weight_at: impl Fn(usize, usize) -> f32) -> Option<Self> {
        if columns == 0 || columns.max(rows) >= TOTAL as usize {
            return None;
        }
        let mut starts = vec![0; columns.checked_mul(rows)?];
        let sums: Vec<f64> = starts
            .chunks_exact_mut(columns)
            .enumerate()
            .map(|(y, row)| {
                let (sum, largest) = accumulate(row, |x| weight(f64::from(weight_at(x, y))));
                sum / columns as f64 * largest
            })
            .collect();
        let marginal = PiecewiseConstant1D::new(&sums)?;
        Some(Self { columns, rows: starts, marginal })
    }

    /// The choice of a row.
    pub fn marginal(&self) -> &PiecewiseConstant1D {
        &self.marginal
    }

    /// The [`PiecewiseConstant1D::starts`] of the columns of each row, one row after the other; all zero for a row of
    /// weight zero.
    pub fn row_starts(&self) -> &[u32] {
        &self.rows
    }

    /// The number of columns and of rows.
    pub fn size(&self) -> (usize, usize) {
        (self.columns, self.marginal.cells())
    }

    /// The mean of the weights: the integral over the unit square of the piecewise constant function.
    pub fn mean(&self) -> f64 {
        self.marginal.mean()
    }

    /// Maps a uniform `u` of `[0, 1)²` to a point of `[0, 1)²` and the density there, which is never zero. x is
    /// along the columns and y along the rows. Time O(log columns + log rows).
    pub fn sample(&self, u: DVec2) -> (DVec2, f64) {
        let (y, down) = find(&self.marginal.starts, u.y);
        let (x, along) = find(self.row(y), u.x);
        let (columns, rows) = self.size();
        (DVec2::new(position(x, along, columns), position(y, down, rows)), self.cell_pdf(x, y))
    }

    /// The density at a point; 0 outside `[0, 1)²`.
    pub fn pdf(&self, p: DVec2) -> f64 {
        let (columns, rows) = self.size();
        let inside = (0.0..1.0).contains(&p.x) && (0.0..1.0).contains(&p.y);
        if inside { self.cell_pdf(cell_at(p.x, columns), cell_at(p.y, rows)) } else { 0.0 }
    }

    /// The density in the cell of a column and a row; 0 out of range.
    pub fn cell_pdf(&self, column: usize, row: usize) -> f64 {
        let (columns, rows) = self.size();
        if column >= columns || row >= rows {
            return 0.0;
        }
        let along = f64::from(width(self.row(row), column)) / f64::from(TOTAL);
        along * columns as f64 * self.marginal.cell_pdf(row)
    }

    /// The inverse of [`PiecewiseConstant2D::sample`].
    pub fn invert(&self, p: DVec2) -> DVec2 {
        let (columns, rows) = self.size();
        let x = p.x.clamp(0.0, BELOW_ONE);
        let y = p.y.clamp(0.0, BELOW_ONE);
        let column = cell_at(x, columns);
        let along = invert_in(self.row(cell_at(y, rows)), column, x * columns as f64 - column as f64);
        DVec2::new(along, self.marginal.invert(y))
    }

    fn row(&self, row: usize) -> &[u32] {
        &self.rows[row * self.columns..][..self.columns]
    }
}

/// The cell of `x` in `[0, 1)`.
fn cell_at(x: f64, cells: usize) -> usize {
    ((x * cells as f64) as usize).min(cells - 1)
}

/// The point of `[0, 1)` at `offset` into `cell`, adjusted so that [`cell_at`] returns the same cell.
fn position(cell: usize, offset: f64, cells: usize) -> f64 {
    let mut x = ((cell as f64 + offset) / cells as f64).min(BELOW_ONE);
    // The division and the product round: at most a step or two of one ulp.
    while cell_at(x, cells) > cell {
        x = x.next_down();
    }
    while cell_at(x, cells) < cell {
        x = x.next_up();
    }
    x
}

fn invert_in(starts: &[u32], cell: usize, offset: f64) -> f64 {
    let before = f64::from(starts[cell]) + offset * f64::from(width(starts, cell));
    (before / f64::from(TOTAL)).min(BELOW_ONE)
}

/// An item chosen by an [`AliasTable`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice {
    /// The index of the item.
    pub index: usize,
    /// Its probability, which is never zero.
    pub probability: f64,
    /// The remainder of the random number, again uniform in `[0, 1)` and independent of the choice.
    pub rest: f64,
}

/// A weighted choice among `n` items in constant time.
///
/// Source: Walker, "An Efficient Method for Generating Discrete Random Variables with General Distributions",
/// ACM TOMS 3(3), 1977; built as in Vose, "A Linear Algorithm for Generating Random Numbers with a Given
/// Distribution", IEEE Trans. Software Eng. 17(9), 1991.
#[derive(Clone, Debug, PartialEq)]
pub struct AliasTable {
    // Never empty.
    bins: Vec<Bin>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Bin {
    probability: f64,
    // The fraction of this bin that is its own item's; the rest is the alias's. 0 for weight zero.
    own: f64,
    alias: u32,
}

impl AliasTable {
    /// The choice in proportion to `weights`. `None` when no weight is positive or there are more than 2³² - 2.
    pub fn new(weights: &[f64]) -> Option<Self> {
        if weights.len() >= u32::MAX as usize {
            return None;
        }
        let heaviest =
            (0..weights.len()).max_by(|&a, &b| weight(weights[a]).total_cmp(&weight(weights[b])))?;
        let largest = weight(weights[heaviest]);
        if largest == 0.0 {
            return None;
        }
        let sum: f64 = weights.iter().map(|&w| weight(w) / largest).sum();
        let alias = heaviest as u32;
        let mut bins: Vec<Bin> = weights
            .iter()
            .map(|&w| weight(w) / largest / sum)
            .map(|probability| Bin { probability, own: f64::from(u8::from(probability > 0.0)), alias })
            .collect();
        let count = weights.len() as f64;
        let mut left: Vec<f64> = bins.iter().map(|bin| bin.probability * count).collect();
        let (mut small, mut large): (Vec<usize>, Vec<usize>) = (0..bins.len()).partition(|&i| left[i] < 1.0);
        while let (Some(&poor), Some(&rich)) = (small.last(), large.last()) {
            small.pop();
            bins[poor].own = left[poor];
            bins[poor].alias = rich as u32;
            left[rich] -= 1.0 - left[poor];
            if left[rich] < 1.0 {
                large.pop();
                small.push(rich);
            }
        }
        // The remaining bins are full up to rounding, as `own` is initially; or they have weight zero and no
        // donor because of rounding, and their alias is the heaviest item.
        Some(Self { bins })
    }

    /// The number of items, those of weight zero included.
    pub fn count(&self) -> usize {
        self.bins.len()
    }

    /// The item for a uniform `u` of `[0, 1)`.
    pub fn sample(&self, u: f64) -> Choice {
        let scaled = u.clamp(0.0, BELOW_ONE) * self.count() as f64;
        let slot = (scaled as usize).min(self.count() - 1);
        let within = (scaled - slot as f64).min(BELOW_ONE);
        let bin = self.bins[slot];
        let (index, rest) = if within < bin.own {
            (slot, within / bin.own)
        } else {
            (bin.alias as usize, (within - bin.own) / (1.0 - bin.own))
        };
        Choice { index, probability: self.bins[index].probability, rest: rest.min(BELOW_ONE) }
    }

    /// The probability of an item; 0 for an index out of range.
    pub fn probability(&self, index: usize) -> f64 {
        self.bins.get(index).map_or(0.0, |bin| bin.probability)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::RandomStream;

    fn random_weights(seed: u64, count: usize) -> Vec<f64> {
        let mut random = RandomStream::new(seed);
        (0..count)
            .map(|_| match random.next_below(4) {
                0 => 0.0,
                1 => random.next_f64() * 1e-4,
                _ => random.next_f64(),
            })
            .collect()
    }

    #[test]
    fn probabilities_are_the_shares_of_the_weights_and_sum_to_one() {
        for count in [2, 3, 17, 1000] {
            let weights = random_weights(count as u64, count);
            let line = PiecewiseConstant1D::new(&weights).unwrap();
            let sum: f64 = weights.iter().sum();
            let total: f64 = (0..count).map(|i| line.cell_probability(i)).sum();
            assert!((total - 1.0).abs() < 1e-12);
            assert!((line.mean() - sum / count as f64).abs() < 1e-12);
            for (i, w) in weights.iter().enumerate() {
                assert!((line.cell_probability(i) - w / sum).abs() < 1e-9, "{i} of {count}");
                assert_eq!(line.cell_probability(i) > 0.0, *w > 0.0);
            }
        }
    }

    #[test]
    fn samples_are_proportional_and_never_of_zero_weight() {
        let weights = [0.0, 2.0, 0.0, 0.0, 5.0, 1e-30, 1.0, 0.0];
        let line = PiecewiseConstant1D::new(&weights).unwrap();
        let mut counts = [0_u32; 8];
        let steps = 80_000;
        for i in 0..steps {
            let u = (f64::from(i) + 0.5) / f64::from(steps);
            let (x, pdf) = line.sample(u);
            assert!(pdf > 0.0 && pdf == line.pdf(x), "{u} {x}");
            assert!((line.invert(x) - u).abs() < 1e-9, "{u}");
            counts[(x * 8.0) as usize] += 1;
        }
        assert_eq!(counts, [0, 20_000, 0, 0, 50_000, 0, 10_000, 0]);
        // However small, a weight can be hit, and weighs what its probability says.
        assert_eq!(line.cell_probability(5), 1.0 / f64::from(TOTAL));
        let tiny = line.sample(line.invert(5.5 / 8.0));
        assert_eq!((tiny.0 * 8.0) as usize, 5);
        for u in [0.0, BELOW_ONE, 1.0, -3.0, f64::NAN.max(0.0)] {
            let (x, pdf) = line.sample(u);
            assert!((0.0..1.0).contains(&x) && pdf > 0.0, "{u}");
        }
        assert_eq!((line.pdf(-0.1), line.pdf(1.0), line.pdf(0.05)), (0.0, 0.0, 0.0));
    }

    #[test]
    fn all_the_weight_in_the_first_or_in_the_last_cell_is_found() {
        for (weights, cell) in [([7.0, 0.0, 0.0], 0), ([0.0, 0.0, 1e-300], 2), ([0.0, 1e300, 0.0], 1)] {
            let line = PiecewiseConstant1D::new(&weights).unwrap();
            for i in 0..=100 {
                let (found, offset, pdf) = line.sample_cell(f64::from(i) / 100.0);
                assert_eq!((found, pdf), (cell, 3.0));
                assert!((0.0..1.0).contains(&offset));
            }
        }
    }

    #[test]
    fn nothing_to_choose_from_is_none_and_bad_weights_count_as_zero() {
        for weights in [&[][..], &[0.0, 0.0], &[-1.0, f64::NAN], &[f64::INFINITY]] {
            assert!(PiecewiseConstant1D::new(weights).is_none());
            assert!(AliasTable::new(weights).is_none());
        }
        assert!(PiecewiseConstant2D::new(&[], 4).is_none());
        assert!(PiecewiseConstant2D::new(&[0.0; 8], 4).is_none());
        assert!(PiecewiseConstant2D::new(&[1.0; 7], 4).is_none());
        assert!(PiecewiseConstant2D::new(&[1.0; 7], 0).is_none());
        let weights = [1.0, f64::NAN, -5.0, f64::INFINITY, 3.0];
        let line = PiecewiseConstant1D::new(&weights).unwrap();
        let table = AliasTable::new(&weights).unwrap();
        for (i, p) in [0.25, 0.0, 0.0, 0.0, 0.75].into_iter().enumerate() {
            assert!((line.cell_probability(i) - p).abs() < 1e-9);
            assert!((table.probability(i) - p).abs() < 1e-15);
        }
        // Sums that would overflow.
        let huge = [f64::MAX, f64::MAX, f64::MAX];
        assert!((AliasTable::new(&huge).unwrap().probability(1) - 1.0 / 3.0).abs() < 1e-15);
        assert!((PiecewiseConstant1D::new(&huge).unwrap().mean() / f64::MAX - 1.0).abs() < 1e-15);
    }

    #[test]
    fn a_picture_is_sampled_in_proportion_and_its_inverse_goes_back() {
        let (columns, rows) = (37, 19);
        let mut weights: Vec<f32> = random_weights(3, columns * rows).into_iter().map(|w| w as f32).collect();
        weights[5 * columns..6 * columns].fill(0.0);
        let picture = PiecewiseConstant2D::new(&weights, columns).unwrap();
        assert_eq!(picture.size(), (columns, rows));
        let sum: f64 = weights.iter().map(|&w| f64::from(w)).sum();
        let cells = (columns * rows) as f64;
        assert!((picture.mean() - sum / cells).abs() < 1e-9);
        let mut mass = 0.0;
        for y in 0..rows {
            for x in 0..columns {
                let expected = f64::from(weights[y * columns + x]) / sum * cells;
                assert!((picture.cell_pdf(x, y) - expected).abs() < 1e-5, "{x} {y}");
                mass += picture.cell_pdf(x, y) / cells;
            }
        }
        assert!((mass - 1.0).abs() < 1e-9);
        let mut random = RandomStream::new(10);
        let mut counts = vec![0_u32; columns * rows];
        let samples = 400_000;
        for _ in 0..samples {
            let u = DVec2::new(random.next_f64(), random.next_f64());
            let (p, pdf) = picture.sample(u);
            assert!(pdf > 0.0 && pdf == picture.pdf(p));
            assert!((picture.invert(p) - u).length() < 1e-8, "{u}");
            counts[(p.y * rows as f64) as usize * columns + (p.x * columns as f64) as usize] += 1;
        }
        let (mut chi, mut freedom) = (0.0_f64, -1.0_f64);
        for (count, w) in counts.iter().zip(&weights) {
            let expected = f64::from(*w) / sum * f64::from(samples);
            if expected > 5.0 {
                chi += (f64::from(*count) - expected).powi(2) / expected;
                freedom += 1.0;
            } else {
                assert!(*count < 25 && (*w > 0.0 || *count == 0));
            }
        }
        assert!(freedom > 300.0 && (chi - freedom).abs() < 5.0 * (2.0 * freedom).sqrt(), "{chi}");
        assert_eq!(picture.pdf(DVec2::new(0.5, 5.5 / 19.0)), 0.0);
    }

    #[test]
    fn every_cell_is_found_again_at_both_of_its_ends() {
        for cells in [3, 49, 1000, 4093] {
            for cell in 0..cells {
                for offset in [0.0, 0.3, BELOW_ONE] {
                    assert_eq!(cell_at(position(cell, offset, cells), cells), cell);
                }
            }
        }
    }

    #[test]
    fn an_alias_table_gives_shares_and_uniform_remainders() {
        for count in [1, 2, 5, 64, 1000] {
            let mut weights = random_weights(count as u64 + 50, count);
            weights[count / 2] = 2.0;
            let table = AliasTable::new(&weights).unwrap();
            let sum: f64 = weights.iter().sum();
            let steps = 2_000 * count;
            let mut shares = vec![0.0; count];
            let mut rests = vec![0.0; count];
            for i in 0..steps {
                let choice = table.sample((i as f64 + 0.5) / steps as f64);
                assert!((0.0..1.0).contains(&choice.rest) && choice.probability > 0.0);
                assert_eq!(choice.probability, table.probability(choice.index));
                shares[choice.index] += 1.0 / steps as f64;
                rests[choice.index] += choice.rest / steps as f64;
            }
            for (i, w) in weights.iter().enumerate() {
                let expected = w / sum;
                // Each bin contributes less than one step of error at each of its ends.
                let slack = 3.0 * (count as f64).sqrt() / steps as f64 + 0.003 * expected;
                assert!((shares[i] - expected).abs() <= slack, "{i} of {count}: {} {expected}", shares[i]);
                assert!((table.probability(i) - expected).abs() < 1e-15);
                if *w == 0.0 {
                    assert_eq!(shares[i], 0.0);
                } else if expected > 50.0 / steps as f64 {
                    assert!((rests[i] / shares[i] - 0.5).abs() < 0.05, "{i} of {count}");
                }
            }
            let exact: f64 = table
                .bins
                .iter()
                .enumerate()
                .map(|(slot, bin)| {
                    let given: f64 = table
                        .bins
                        .iter()
                        .filter(|other| other.alias as usize == slot)
                        .map(|other| 1.0 - other.own)
                        .sum();
                    ((bin.own + given) / count as f64 - bin.probability).abs()
                })
                .fold(0.0, f64::max);
            assert!(exact < 1e-13, "{count}: {exact}");
        }
    }
}
