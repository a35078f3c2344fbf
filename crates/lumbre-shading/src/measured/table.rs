//! Tables over the unit square, one for each direction of view, linear between their nodes and between the directions.

/// Slices of a table that a direction of view lies between, each with its share; shares sum to 1.
#[derive(Clone, Copy, Debug)]
pub(super) struct Between([(usize, f64); 4]);

impl Between {
    /// The slices about an azimuth and an elevation; directions beyond the first and the last count as those.
    pub(super) fn new(azimuths: &[f32], azimuth: f64, elevations: &[f32], elevation: f64) -> Self {
        let ((row, down), (column, along)) = (place(azimuths, azimuth), place(elevations, elevation));
        let slice = |row: usize, column: usize| {
            row.min(azimuths.len() - 1) * elevations.len() + column.min(elevations.len() - 1)
        };
        Self([
            (slice(row, column), (1.0 - down) * (1.0 - along)),
            (slice(row, column + 1), (1.0 - down) * along),
            (slice(row + 1, column), down * (1.0 - along)),
            (slice(row + 1, column + 1), down * along),
        ])
    }
}

/// The node at or below a value, and the share of the next one.
fn place(nodes: &[f32], value: f64) -> (usize, f64) {
    let last = nodes.len() - 1;
    let below = nodes.partition_point(|&node| f64::from(node) <= value).saturating_sub(1).min(last);
    let Some(&next) = nodes.get(below + 1) else { return (below, 0.0) };
    let (low, high) = (f64::from(nodes[below]), f64::from(next));
    (below, ((value - low) / (high - low)).clamp(0.0, 1.0))
}

/// Numbers on a grid over the unit square, bilinear between its nodes, for each slice; slices lie one after the other,
/// each row by row.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Table {
    width: usize,
    height: usize,
    values: Vec<f32>,
}

/// A cell of the grid, and where a point is in it.
#[derive(Clone, Copy)]
struct Cell {
    column: usize,
    row: usize,
    x: f64,
    y: f64,
}

impl Table {
    /// `None` unless there are whole slices of at least 2 × 2 numbers.
    pub(super) fn new([height, width]: [usize; 2], values: Vec<f32>) -> Option<Self> {
        let each = height.checked_mul(width)?;
        let is_whole = height >= 2 && width >= 2 && !values.is_empty() && values.len().is_multiple_of(each);
        is_whole.then_some(Self { width, height, values })
    }

    pub(super) fn slices(&self) -> usize {
        self.values.len() / (self.width * self.height)
    }

    /// The cell of a point of the unit square; points outside are moved to its edge.
    fn cell(&self, [x, y]: [f64; 2]) -> Cell {
        let one = |v: f64, nodes: usize| {
            let cells = nodes - 1;
            let place = v.clamp(0.0, 1.0) * cells as f64;
            let cell = (place as usize).min(cells - 1);
            (cell, place - cell as f64)
        };
        let ((column, x), (row, y)) = (one(x, self.width), one(y, self.height));
        Cell { column, row, x, y }
    }

    /// A number between slices.
    fn at(&self, between: &Between, row: usize, column: usize) -> f64 {
        let each = self.width * self.height;
        let place = row * self.width + column;
        let mut sum = 0.0;
        for (slice, share) in between.0 {
            if share > 0.0 {
                sum += share * f64::from(self.values[slice * each + place]);
            }
        }
        sum
    }

    /// The value at a point of the unit square.
    pub(super) fn value(&self, between: &Between, point: [f64; 2]) -> f64 {
        let Cell { column, row, x, y } = self.cell(point);
        let row_at = |row| lerp(self.at(between, row, column), self.at(between, row, column + 1), x);
        lerp(row_at(row), row_at(row + 1), y)
    }

    /// The value in a table of one slice.
    pub(super) fn single(&self, point: [f64; 2]) -> f64 {
        self.value(&Between([(0, 1.0), (0, 0.0), (0, 0.0), (0, 0.0)]), point)
    }
}

/// A density over the unit square for each slice, and the warp that samples it: first a row by the density of rows,
/// then a place in the row. Both densities are piecewise linear, so that their integrals are inverted by the roots of
/// quadratics.
///
/// Dupuy and Jakob, "An Adaptive Parameterization for Efficient Material Acquisition and Rendering", SIGGRAPH
/// Asia 2018.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Warp {
    /// The density: the integral of each slice is 1.
    density: Table,
    /// For each node, the integral over its row up to it.
    along: Table,
    /// For each row, the integral up to it; as wide as two nodes; the second is not read.
    up: Vec<f32>,
}

impl Warp {
    /// Of numbers that are not negative; a slice of zeros counts as even.
    pub(super) fn new(mut density: Table) -> Self {
        let (width, height) = (density.width, density.height);
        let (dx, dy) = (1.0 / (width - 1) as f64, 1.0 / (height - 1) as f64);
        let mut along = vec![0.0; density.values.len()];
        let mut up = vec![0.0; density.slices() * height];
        let slices = density.values.chunks_exact_mut(width * height);
        let integrals = along.chunks_exact_mut(width * height).zip(up.chunks_exact_mut(height));
        for (values, (along, up)) in slices.zip(integrals) {
            let row = |y: usize, values: &[f32]| -> f64 {
                let row = &values[y * width..][..width];
                row.windows(2).map(|pair| 0.5 * dx * (f64::from(pair[0]) + f64::from(pair[1]))).sum()
            };
            let rows: Vec<f64> = (0..height).map(|y| row(y, values)).collect();
            let total: f64 = rows.windows(2).map(|pair| 0.5 * dy * (pair[0] + pair[1])).sum();
            if total > 0.0 {
                values.iter_mut().for_each(|v| *v = (f64::from(*v) / total) as f32);
            } else {
                values.fill(1.0);
            }
            let mut below = 0.0;
            for (y, up) in up.iter_mut().enumerate() {
                let mut sum = 0.0;
                for x in 1..width {
                    let place = y * width + x;
                    sum += 0.5 * dx * (f64::from(values[place - 1]) + f64::from(values[place]));
                    along[place] = sum as f32;
                }
                if y > 0 {
                    let row = |y: usize| f64::from(along[y * width + width - 1]);
                    below += 0.5 * dy * (row(y - 1) + row(y));
                    *up = below as f32;
                }
            }
        }
        let along = Table { width, height, values: along };
        Self { density, along, up }
    }

    pub(super) fn slices(&self) -> usize {
        self.density.slices()
    }

    fn up(&self, between: &Between, row: usize) -> f64 {
        let height = self.density.height;
        let mut sum = 0.0;
        for (slice, share) in between.0 {
            if share > 0.0 {
                sum += share * f64::from(self.up[slice * height + row]);
            }
        }
        sum
    }

    /// The integral over a row.
    fn row(&self, between: &Between, row: usize) -> f64 {
        self.along.at(between, row, self.along.width - 1)
    }

    /// A point of the unit square with this density, from two uniform numbers in [0, 1]; and the density.
    pub(super) fn sample(&self, between: &Between, u: [f64; 2]) -> ([f64; 2], f64) {
        let (columns, rows) = (self.density.width - 1, self.density.height - 1);
        let total = self.up(between, rows);
        let wanted = u[1].clamp(0.0, 1.0) * total;
        let row = last_at_most(rows, wanted, |row| self.up(between, row));
        let (low, high) = (self.row(between, row), self.row(between, row + 1));
        let y = root(low, high, (wanted - self.up(between, row)) * rows as f64);

        let whole = lerp(low, high, y);
        let integral =
            |column| lerp(self.along.at(between, row, column), self.along.at(between, row + 1, column), y);
        let wanted = u[0].clamp(0.0, 1.0) * whole;
        let column = last_at_most(columns, wanted, integral);
        let density = |column| {
            lerp(self.density.at(between, row, column), self.density.at(between, row + 1, column), y)
        };
        let (left, right) = (density(column), density(column + 1));
        let x = root(left, right, (wanted - integral(column)) * columns as f64);
        let point = [(column as f64 + x) / columns as f64, (row as f64 + y) / rows as f64];
        (point, lerp(left, right, x) / total)
    }

    /// The uniform numbers from which [`Warp::sample`] makes a point, and the density there.
    pub(super) fn invert(&self, between: &Between, point: [f64; 2]) -> ([f64; 2], f64) {
        let (columns, rows) = (self.density.width - 1, self.density.height - 1);
        let Cell { column, row, x, y } = self.density.cell(point);
        let total = self.up(between, rows);
        let (low, high) = (self.row(between, row), self.row(between, row + 1));
        let below = self.up(between, row) + integral(low, high, y) / rows as f64;
        let across = |table: &Table, column| {
            lerp(table.at(between, row, column), table.at(between, row + 1, column), y)
        };
        let (left, right) = (across(&self.density, column), across(&self.density, column + 1));
        let before = across(&self.along, column) + integral(left, right, x) / columns as f64;
        let whole = lerp(low, high, y);
        let along = if whole > 0.0 { before / whole } else { point[0] };
        ([along, below / total], lerp(left, right, x) / total)
    }
}

fn lerp(a: f64, b: f64, t: f64) -> f64 {
    a * (1.0 - t) + b * t
}

/// ∫ of a + (b − a) t from 0 to t.
fn integral(a: f64, b: f64, t: f64) -> f64 {
    t * (a + 0.5 * (b - a) * t)
}

/// The t in [0, 1] up to which the integral of a + (b − a) t is this.
fn root(a: f64, b: f64, area: f64) -> f64 {
    let area = area.max(0.0);
    let sum = a + (a * a + 2.0 * (b - a) * area).max(0.0).sqrt();
    if sum > 0.0 { (2.0 * area / sum).min(1.0) } else { 0.0 }
}

/// The last of `cells` ascending nodes that is at most this; 0 if none is.
fn last_at_most(cells: usize, value: f64, node: impl Fn(usize) -> f64) -> usize {
    let (mut low, mut high) = (0, cells);
    while high - low > 1 {
        let middle = low.midpoint(high);
        if node(middle) <= value {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two slices of 3 × 4 numbers, with zeros at an edge.
    fn table() -> Table {
        let numbers = [0.0, 1.0, 3.0, 0.5, 0.0, 2.0, 0.25, 4.0, 0.0, 0.0, 1.5, 2.0];
        let other = numbers.map(|v| 3.0 - 0.5 * v);
        Table::new([3, 4], [numbers, other].concat()).unwrap()
    }

    #[test]
    fn tables_are_linear_between_nodes_and_between_slices() {
        let (azimuths, elevations) = ([0.0], [0.25, 0.75]);
        let between = |elevation| Between::new(&azimuths, 9.0, &elevations, elevation);
        let table = table();
        // A node, the middle of an edge, and of a cell.
        for (point, first) in
            [([1.0 / 3.0, 0.5], 2.0), ([0.5, 0.0], 2.0), ([0.5, 0.25], 0.25 * (1.0 + 3.0 + 2.0 + 0.25))]
        {
            for (elevation, share) in [(0.0, 0.0), (0.25, 0.0), (0.375, 0.25), (0.75, 1.0), (2.0, 1.0)] {
                let expected = lerp(first, 3.0 - 0.5 * first, share);
                let value = table.value(&between(elevation), point);
                assert!((value - expected).abs() < 1e-12, "{point:?} {elevation}: {value} {expected}");
            }
        }
        assert!(Table::new([1, 4], vec![1.0; 4]).is_none() && Table::new([2, 3], vec![1.0; 7]).is_none());
    }

    #[test]
    fn a_warp_has_its_density_and_goes_back() {
        let warp = Warp::new(table());
        let elevations = [0.25, 0.75];
        for elevation in [0.25, 0.4, 0.75] {
            let between = Between::new(&[0.0], 0.0, &elevations, elevation);
            let n = 200;
            let (mut sum, mut counts) = (0.0, [[0_u32; 8]; 8]);
            for i in 0..n * n {
                let u = [(i % n) as f64 + 0.5, (i / n) as f64 + 0.5].map(|v| v / n as f64);
                let (point, density) = warp.sample(&between, u);
                let (back, same) = warp.invert(&between, point);
                assert!((density - same).abs() < 1e-6 * (1.0 + density), "{point:?}: {density} {same}");
                assert!((back[0] - u[0]).abs() < 1e-6 && (back[1] - u[1]).abs() < 1e-6, "{u:?} {back:?}");
                let [x, y] = point.map(|v| ((8.0 * v) as usize).min(7));
                counts[y][x] += 1;
                sum += 1.0 / density;
            }
            // The mean of 1 / density is the area; a cell's share is the integral of its density.
            assert!((sum / f64::from(n * n) - 1.0).abs() < 3e-2, "{sum}");
            for (y, row) in counts.iter().enumerate() {
                for (x, &count) in row.iter().enumerate() {
                    let steps = 40;
                    let at = |i: u32, of: usize| (of as f64 + (f64::from(i) + 0.5) / 40.0) / 8.0;
                    let mean = (0..steps * steps)
                        .map(|i| warp.invert(&between, [at(i % steps, x), at(i / steps, y)]).1)
                        .sum::<f64>()
                        / f64::from(steps * steps);
                    let expected = mean / 64.0 * f64::from(n * n);
                    assert!((f64::from(count) - expected).abs() < 0.03 * expected + 25.0, "{x} {y}");
                }
            }
        }
    }

    #[test]
    fn a_slice_of_zeros_counts_as_even() {
        let warp = Warp::new(Table::new([2, 3], vec![0.0; 6]).unwrap());
        let between = Between::new(&[0.0], 0.0, &[0.0], 0.0);
        assert_eq!(warp.sample(&between, [0.25, 0.75]), ([0.25, 0.75], 1.0));
    }
}
