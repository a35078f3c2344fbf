//! Pixel filters, sampled.

use std::f64::consts::PI;

use lumbre_math::distribution::PiecewiseConstant1D;
use lumbre_math::{DVec2, Elementary};

/// The closed set of filters: all are products of the same function along x and along y. Radii are in pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FilterShape {
    /// A Gaussian of this standard deviation, minus its value at the radius.
    Gaussian {
        /// Standard deviation.
        sigma: f64,
    },
    /// Constant.
    Box,
    /// Mitchell, Netravali, "Reconstruction Filters in Computer Graphics", SIGGRAPH 1988.
    Mitchell {
        /// Blur.
        b: f64,
        /// Ringing.
        c: f64,
    },
    /// A sinc within the main lobe of a wider one (Lanczos).
    Sinc {
        /// Width of the wider one.
        tau: f64,
    },
    /// A tent.
    Triangle,
}

impl FilterShape {
    /// Its value at a distance from the centre of the pixel.
    pub fn value(&self, x: f64, radius: f64) -> f64 {
        let x = x.abs();
        if x > radius {
            return 0.0;
        }
        match *self {
            Self::Gaussian { sigma } => {
                let bell = |x: f64| (-x * x / (2.0 * sigma * sigma)).exponential();
                (bell(x) - bell(radius)).max(0.0)
            }
            Self::Box => 1.0,
            Self::Mitchell { b, c } => mitchell(2.0 * x / radius, b, c),
            Self::Sinc { tau } => sinc(x) * sinc(x / tau),
            Self::Triangle => radius - x,
        }
    }
}

fn mitchell(x: f64, b: f64, c: f64) -> f64 {
    let cubic = |c3: f64, c2: f64, c1: f64, c0: f64| (((c3 * x + c2) * x + c1) * x + c0) / 6.0;
    if x <= 1.0 {
        cubic(12.0 - 9.0 * b - 6.0 * c, -18.0 + 12.0 * b + 6.0 * c, 0.0, 6.0 - 2.0 * b)
    } else if x <= 2.0 {
        cubic(-b - 6.0 * c, 6.0 * b + 30.0 * c, -12.0 * b - 48.0 * c, 8.0 * b + 24.0 * c)
    } else {
        0.0
    }
}

fn sinc(x: f64) -> f64 {
    if x.abs() < 1e-5 { 1.0 } else { (PI * x).sine() / (PI * x) }
}

/// A position in the filter, and the sample's weight there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilterSample {
    /// Offset from the centre of the pixel, in pixels.
    pub offset: DVec2,
    /// Value over density: almost constant except for its sign.
    pub weight: f64,
}

/// A filter, ready for sampling.
#[derive(Clone, Debug)]
pub struct Filter {
    shape: FilterShape,
    radius: DVec2,
    x: Axis,
    y: Axis,
}

/// The function along one axis, a parabola in each cell: within 1e-6 of the maximum of the exact one.
#[derive(Clone, Debug)]
struct Axis {
    choice: PiecewiseConstant1D,
    /// For each of `CELLS` parts of [0, 1), the cell that a number at its start chooses.
    first: Vec<u16>,
    /// For each cell, the value at its start over the density of its choice, the increase to its end, and four times
    /// the rise of its middle above the straight line.
    weights: Vec<[f64; 3]>,
    radius: f64,
}

/// Cells of the sampling tables.
const CELLS: usize = 512;

impl Axis {
    /// `None` if the function is zero.
    fn new(shape: FilterShape, radius: f64) -> Option<Self> {
        let value = |i: f64| shape.value((i / CELLS as f64 * 2.0 - 1.0) * radius, radius);
        // Not only at the centre: where the function changes sign, it may be zero only there.
        let cell = |i: f64| 0.25 * value(i).abs() + 0.5 * value(i + 0.5).abs() + 0.25 * value(i + 1.0).abs();
        let cells: Vec<f64> = (0..CELLS).map(|i| cell(i as f64)).collect();
        let choice = PiecewiseConstant1D::new(&cells)?;
        let first = (0..CELLS).map(|k| choice.sample_cell(k as f64 / CELLS as f64).0 as u16).collect();
        let weight = |i: usize| {
            let scale = 2.0 * radius / choice.cell_pdf(i);
            let [start, middle, end] = [0.0, 0.5, 1.0].map(|part| value(i as f64 + part) * scale);
            [start, end - start, 4.0 * (middle - 0.5 * (start + end))]
        };
        let weights = (0..CELLS).map(weight).collect();
        Some(Self { choice, first, weights, radius })
    }

    /// A position and the value over the density there, from a uniform number.
    fn sample(&self, u: f64) -> (f64, f64) {
        let starts = self.choice.starts();
        let total = f64::from(PiecewiseConstant1D::TOTAL);
        let x = u * total;
        let mut cell = usize::from(self.first[((u * CELLS as f64) as usize).min(CELLS - 1)]);
        while cell + 1 < CELLS && f64::from(starts[cell + 1]) <= x {
            cell += 1;
        }
        let end = starts.get(cell + 1).map_or(total, |&start| f64::from(start));
        let start = f64::from(starts[cell]);
        let offset = ((x - start) / (end - start)).min(1.0);
        let [at_start, along, bend] = self.weights[cell];
        let place = (cell as f64 + offset) / CELLS as f64;
        ((2.0 * place - 1.0) * self.radius, at_start + offset * (along + (1.0 - offset) * bend))
    }
}

impl Filter {
    /// A filter of these half-widths. `None` unless they are positive and finite, and the function is not zero.
    pub fn new(shape: FilterShape, radius: DVec2) -> Option<Self> {
        let is_sound = radius.is_finite() && radius.min_element() > 0.0;
        if !is_sound {
            return None;
        }
        Some(Self { shape, radius, x: Axis::new(shape, radius.x)?, y: Axis::new(shape, radius.y)? })
    }

    /// Half-widths in pixels.
    pub fn radius(&self) -> DVec2 {
        self.radius
    }

    /// A position in the filter, from two uniform numbers.
    pub fn sample(&self, u: DVec2) -> FilterSample {
        if let FilterShape::Box = self.shape {
            let area = 4.0 * self.radius.x * self.radius.y;
            return FilterSample { offset: (2.0 * u - 1.0) * self.radius, weight: area };
        }
        let (x, x_weight) = self.x.sample(u.x);
        let (y, y_weight) = self.y.sample(u.y);
        FilterSample { offset: DVec2::new(x, y), weight: x_weight * y_weight }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumbre_math::random::uniform_f64;

    const SHAPES: [(FilterShape, f64); 5] = [
        (FilterShape::Gaussian { sigma: 0.5 }, 1.5),
        (FilterShape::Box, 0.5),
        (FilterShape::Mitchell { b: 1.0 / 3.0, c: 1.0 / 3.0 }, 2.0),
        (FilterShape::Sinc { tau: 3.0 }, 4.0),
        (FilterShape::Triangle, 2.0),
    ];

    /// ∫ g f / ∫ f by samples and by a fine grid.
    fn both_means(shape: FilterShape, radius: DVec2, g: impl Fn(DVec2) -> f64) -> (f64, f64) {
        const SIDE: usize = 1024;
        let filter = Filter::new(shape, radius).unwrap();
        let grid = |i: usize| (i as f64 + 0.5) / SIDE as f64;
        let (mut sampled, mut weights, mut exact, mut whole) = (0.0, 0.0, 0.0, 0.0);
        for i in 0..SIDE * SIDE {
            let u = DVec2::new(grid(i % SIDE), grid(i / SIDE));
            // Not the grid, which would alias with the steps at the edges of negative lobes.
            let (x, y) = lumbre_math::sobol::sobol_2d(i as u64);
            let sample = filter.sample(DVec2::new(uniform_f64(x), uniform_f64(y)));
            sampled += sample.weight * g(sample.offset);
            weights += sample.weight;
            let p = (2.0 * u - 1.0) * radius;
            let value = shape.value(p.x, radius.x) * shape.value(p.y, radius.y);
            exact += value * g(p);
            whole += value;
        }
        (sampled / weights, exact / whole)
    }

    #[test]
    fn samples_integrate_like_the_filter() {
        for (shape, radius) in SHAPES {
            let radius = DVec2::new(radius, 0.75 * radius);
            for k in [0.4, 1.0, 2.5] {
                let wave = |p: DVec2| (k * p.x).cos() * (0.7 * k * p.y).cos() + 0.3 * (p.x + 0.2 * p.y);
                let (sampled, exact) = both_means(shape, radius, wave);
                assert!((sampled - exact).abs() < 1e-3, "{shape:?} {k}: {sampled} {exact}");
            }
        }
    }

    #[test]
    fn tables_are_near_the_filter_everywhere() {
        for (shape, radius) in SHAPES {
            let filter = Filter::new(shape, DVec2::splat(radius)).unwrap();
            let greatest = shape.value(0.0, radius);
            for i in 0..10_000 {
                let u = (f64::from(i) + 0.3) / 10_000.0;
                let (x, weight) = filter.x.sample(u);
                let (place, density) = filter.x.choice.sample(u);
                assert!(((2.0 * place - 1.0) * radius - x).abs() < 1e-9, "{shape:?} {u}: {x} {place}");
                let value = weight * density / (2.0 * radius);
                assert!((value - shape.value(x, radius)).abs() < 1e-6 * greatest, "{shape:?} {x}: {value}");
            }
        }
    }

    #[test]
    fn only_negative_lobes_give_negative_samples() {
        for (shape, radius) in SHAPES {
            let filter = Filter::new(shape, DVec2::splat(radius)).unwrap();
            let weight = |i: usize| filter.sample(DVec2::new(i as f64 / 4096.0, 0.37)).weight;
            let negative = (0..4096).filter(|&i| weight(i) < 0.0).count();
            let has_lobes = matches!(shape, FilterShape::Mitchell { .. } | FilterShape::Sinc { .. });
            assert_eq!(negative > 40, has_lobes, "{shape:?} {negative}");
        }
    }

    #[test]
    fn a_filter_without_width_is_none() {
        assert!(Filter::new(FilterShape::Box, DVec2::new(0.0, 1.0)).is_none());
        assert!(Filter::new(FilterShape::Box, DVec2::new(f64::NAN, 1.0)).is_none());
        assert!(Filter::new(FilterShape::Gaussian { sigma: 0.5 }, DVec2::splat(1.5)).is_some());
    }
}
