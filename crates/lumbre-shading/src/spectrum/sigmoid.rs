//! Smooth spectra of colours.
//!
//! Jakob and Hanika, "A Low-Dimensional Function Space for Efficient Spectral Upsampling", Eurographics 2019: a
//! reflectance is a sigmoid of a quadratic polynomial of the wavelength, whose three coefficients are fitted so that
//! its colour under D65 is the given one. We fit single colours exactly when they are first looked up, and look up what
//! varies from place to place in a table of [`Table::SIZE`]³ nodes for each greatest channel (theirs has 64³), which is
//! made at its first use.

use std::array;
use std::cell::RefCell;
use std::collections::HashMap;
use std::sync::{LazyLock, PoisonError, RwLock};

use lumbre_math::Elementary;

use super::channel_weights;
use crate::Spectrum;

/// The sigmoid of a quadratic polynomial of the wavelength: a reflectance between 0 and 1, both included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sigmoid {
    /// Of x², x and 1, where x goes from −1 at 360 nm to 1 at 830 nm.
    coefficients: [f32; 3],
}

/// Where x is 0, and by how many nm it grows by 1.
const MIDDLE_NM: f64 = 595.0;
const HALF_NM: f64 = 235.0;
/// A polynomial that stands for infinity: its square is infinite in single precision, so its sigmoid is 0 or 1.
const STEEPEST: f64 = 1e30;
/// Fits of colours that no sigmoid has, faces and corners of the cube, are held to coefficients of this size, as in the
/// original.
const MAX_COEFFICIENT: f64 = 200.0;

impl Sigmoid {
    /// The reflectance whose colour under D65 is this one, clamped to [0, 1]. The fit is kept.
    pub fn of(colour: Spectrum) -> Self {
        let colour = colour.map(crate::unit);
        if let Some(grey) = Self::of_grey(colour) {
            return grey;
        }
        cached(colour)
    }

    /// [`Self::of`] from a table and a step of Newton's method, with an error of less than a thousandth for most
    /// colours.
    pub fn by_table(colour: Spectrum) -> Self {
        static TABLE: LazyLock<Table> = LazyLock::new(Table::new);
        let colour = colour.map(crate::unit);
        Self::of_grey(colour).unwrap_or_else(|| TABLE.look_up(colour).improved(colour))
    }

    /// The value at a wavelength in nm.
    #[inline]
    pub fn at(&self, nm: f32) -> f32 {
        let x = (nm - MIDDLE_NM as f32) * (1.0 / HALF_NM as f32);
        let [a, b, c] = self.coefficients;
        sigmoid((a * x + b) * x + c)
    }

    /// A constant, for a colour with equal channels.
    fn of_grey(colour: Spectrum) -> Option<Self> {
        let is_grey = colour.r == colour.g && colour.g == colour.b;
        is_grey.then(|| Self { coefficients: [0.0, 0.0, inverse(colour.r.into()) as f32] })
    }

    /// One step of Newton's method nearer to a colour, where that is a small one: faces of the cube have no fit.
    fn improved(self, colour: Spectrum) -> Self {
        const LARGE: f64 = 0.3;
        let before = self.coefficients.map(f64::from);
        let (found, derivatives) = NODES.colour(before);
        let target = colour.to_array().map(f64::from);
        let Some(step) = solve(derivatives, array::from_fn(|k| target[k] - found[k])) else { return self };
        let greatest = |numbers: [f64; 3]| numbers.iter().fold(0.0, |most: f64, c| most.max(c.abs()));
        if greatest(step) > LARGE * (1.0 + greatest(before)) {
            return self;
        }
        Self::from_fit(array::from_fn(|k| before[k] + step[k]))
    }

    fn from_fit(fit: [f64; 3]) -> Self {
        Self { coefficients: fit.map(|c| c as f32) }
    }
}

/// ½ + x / (2 √(1 + x²)), without cancellation near 0.
fn sigmoid(x: f32) -> f32 {
    let root = (1.0 + x * x).sqrt();
    let tail = 0.5 / (root * (root + x.abs()));
    if x < 0.0 { tail } else { 1.0 - tail }
}

/// Where the sigmoid has a value.
fn inverse(value: f64) -> f64 {
    let v = value.clamp(0.0, 1.0);
    ((v - 0.5) / (v * (1.0 - v)).sqrt()).clamp(-STEEPEST, STEEPEST)
}

/// The fit of a colour that is not grey, from the table.
fn cached(colour: Spectrum) -> Sigmoid {
    type Key = [u32; 3];
    /// Fits that are kept for all threads.
    const MAX_FITS: usize = 1 << 20;
    /// A power of two.
    const NEAR: usize = 1024;
    static FITS: LazyLock<RwLock<HashMap<Key, Sigmoid>>> = LazyLock::new(RwLock::default);
    thread_local! {
        // The last ones of a thread, by their hash: threads do not wait for each other.
        static LAST: RefCell<Vec<(Key, Sigmoid)>> =
            RefCell::new(vec![([u32::MAX; 3], Sigmoid { coefficients: [0.0; 3] }); NEAR]);
    }
    let key = colour.to_array().map(f32::to_bits);
    let hash = key.iter().fold(0_u32, |hash, word| (hash ^ word).wrapping_mul(0x9e37_79b1)) >> 16;
    let place = hash as usize % NEAR;
    if let Some(found) = LAST.with_borrow(|last| (last[place].0 == key).then(|| last[place].1)) {
        return found;
    }
    let known = FITS.read().unwrap_or_else(PoisonError::into_inner).get(&key).copied();
    let found = known.unwrap_or_else(|| {
        let found = Sigmoid::from_fit(fit(colour.to_array().map(f64::from)));
        let mut fits = FITS.write().unwrap_or_else(PoisonError::into_inner);
        if fits.len() < MAX_FITS {
            fits.insert(key, found);
        }
        found
    });
    LAST.with_borrow_mut(|last| last[place] = (key, found));
    found
}

/// What the wavelengths of a fit add to each channel under D65.
struct Nodes {
    x: Vec<f64>,
    weights: Vec<[f64; 3]>,
}

/// Every 2 nm: with 5, colours of small channels are off by half a per cent.
static NODES: LazyLock<Nodes> = LazyLock::new(|| {
    let nm: Vec<f32> = (360..=830_u16).step_by(2).map(f32::from).collect();
    let x = nm.iter().map(|&nm| (f64::from(nm) - MIDDLE_NM) / HALF_NM).collect();
    Nodes { x, weights: channel_weights(&nm) }
});

impl Nodes {
    /// The colour of a polynomial, and its derivatives by each coefficient.
    fn colour(&self, [a, b, c]: [f64; 3]) -> ([f64; 3], [[f64; 3]; 3]) {
        let (mut colour, mut derivatives) = ([0.0; 3], [[0.0; 3]; 3]);
        for (&x, weight) in self.x.iter().zip(&self.weights) {
            let p = (a * x + b) * x + c;
            let root = 1.0 / (1.0 + p * p).sqrt();
            let (value, slope) = (0.5 + 0.5 * p * root, 0.5 * root * root * root);
            for k in 0..3 {
                colour[k] += weight[k] * value;
                let slope = weight[k] * slope;
                derivatives[k][0] += slope * x * x;
                derivatives[k][1] += slope * x;
                derivatives[k][2] += slope;
            }
        }
        (colour, derivatives)
    }
}

/// CIE L*a*b* of linear Rec. 709, and its derivatives by each channel.
fn lab(rgb: [f64; 3]) -> ([f64; 3], [[f64; 3]; 3]) {
    // XYZ over that of white: rows sum to 1.
    const XYZ: [[f64; 3]; 3] = [
        [0.433_953, 0.376_219, 0.189_828],
        [0.212_671, 0.715_160, 0.072_169],
        [0.017_758, 0.109_477, 0.872_765],
    ];
    let mut of = [0.0; 3];
    let mut slopes = [[0.0; 3]; 3];
    for (k, row) in XYZ.iter().enumerate() {
        let t: f64 = (0..3).map(|i| row[i] * rgb[i]).sum();
        let (value, slope) = if t > 216.0 / 24_389.0 {
            let root = t.cube_root();
            (root, root / (3.0 * t))
        } else {
            let slope = 841.0 / 108.0;
            (slope * t + 4.0 / 29.0, slope)
        };
        of[k] = value;
        slopes[k] = row.map(|share| slope * share);
    }
    let lab = [116.0 * of[1] - 16.0, 500.0 * (of[0] - of[1]), 200.0 * (of[1] - of[2])];
    let derivatives = [
        array::from_fn(|i| 116.0 * slopes[1][i]),
        array::from_fn(|i| 500.0 * (slopes[0][i] - slopes[1][i])),
        array::from_fn(|i| 200.0 * (slopes[1][i] - slopes[2][i])),
    ];
    (lab, derivatives)
}

/// The coefficients for a colour in [0, 1]³.
fn fit(colour: [f64; 3]) -> [f64; 3] {
    /// Steps from grey to the colour: each fit starts near its end.
    const STEPS: u32 = 5;
    let grey = colour.iter().sum::<f64>() / 3.0;
    let mut coefficients = [0.0, 0.0, inverse(grey.clamp(1e-3, 1.0 - 1e-3))];
    for step in 1..=STEPS {
        let t = f64::from(step) / f64::from(STEPS);
        coefficients = refine(coefficients, colour.map(|c| grey + t * (c - grey)));
    }
    coefficients
}

/// Levenberg and Marquardt's descent to the least difference of L*a*b* from a colour, from coefficients near it.
fn refine(mut coefficients: [f64; 3], colour: [f64; 3]) -> [f64; 3] {
    const ITERATIONS: u32 = 40;
    let target = lab(colour).0;
    let evaluate = |coefficients: [f64; 3]| {
        let (rgb, by_coefficient) = NODES.colour(coefficients);
        let (value, by_channel) = lab(rgb);
        let residual: [f64; 3] = array::from_fn(|k| value[k] - target[k]);
        let jacobian: [[f64; 3]; 3] = array::from_fn(|k| {
            array::from_fn(|i| (0..3).map(|c| by_channel[k][c] * by_coefficient[c][i]).sum())
        });
        (residual, jacobian, residual.iter().map(|r| r * r).sum::<f64>())
    };
    let (mut residual, mut jacobian, mut error) = evaluate(coefficients);
    let mut damping = 1e-4;
    for _ in 0..ITERATIONS {
        if error < 1e-16 {
            break;
        }
        let mut normal: [[f64; 3]; 3] =
            array::from_fn(|i| array::from_fn(|j| (0..3).map(|k| jacobian[k][i] * jacobian[k][j]).sum()));
        let gradient: [f64; 3] = array::from_fn(|i| (0..3).map(|k| jacobian[k][i] * residual[k]).sum());
        for (i, row) in normal.iter_mut().enumerate() {
            row[i] *= 1.0 + damping;
        }
        let next = solve(normal, gradient).map(|step| array::from_fn(|i| coefficients[i] - step[i]));
        let next = next.map(|next: [f64; 3]| {
            let most = next.iter().fold(0.0, |most: f64, c| most.max(c.abs()));
            next.map(|c| if most > MAX_COEFFICIENT { c * (MAX_COEFFICIENT / most) } else { c })
        });
        let better = next.and_then(|next| {
            let found = evaluate(next);
            (found.2 < error).then_some((next, found))
        });
        match better {
            Some((next, found)) => {
                coefficients = next;
                (residual, jacobian, error) = found;
                damping = (damping * 0.2).max(1e-12);
            }
            None if damping > 1e8 => break,
            None => damping *= 10.0,
        }
    }
    coefficients
}

/// The solution of three linear equations by Cramer's rule; `None` where they have none.
fn solve(m: [[f64; 3]; 3], v: [f64; 3]) -> Option<[f64; 3]> {
    let determinant = |m: [[f64; 3]; 3]| {
        m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])
            + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0])
    };
    let whole = determinant(m);
    let solution: [f64; 3] = array::from_fn(|i| {
        let mut m = m;
        (0..3).for_each(|row| m[row][i] = v[row]);
        determinant(m) / whole
    });
    solution.iter().all(|x| x.is_finite()).then_some(solution)
}

/// Coefficients by the greatest channel, its value, and the shares of the two others of it.
struct Table {
    /// By greatest channel, then z (its value), y and x (the shares of the next and the second next channel).
    nodes: Vec<[f32; 3]>,
    /// The values of z.
    z: [f32; Self::SIZE],
}

impl Table {
    const SIZE: usize = 32;

    fn new() -> Self {
        let last = (Self::SIZE - 1) as f64;
        let smooth = |t: f64| t * t * (3.0 - 2.0 * t);
        // Denser near 0 and 1, where coefficients are steep.
        let z: [f64; Self::SIZE] =
            array::from_fn(|k| smooth(smooth(k as f64 / last)).clamp(1e-4, 1.0 - 1e-4));
        let mut nodes = vec![[0.0; 3]; 3 * Self::SIZE.pow(3)];
        for greatest in 0..3 {
            for y in 0..Self::SIZE {
                for x in 0..Self::SIZE {
                    let colour = |k: usize| {
                        let mut colour = [0.0; 3];
                        colour[greatest] = z[k];
                        colour[(greatest + 1) % 3] = z[k] * x as f64 / last;
                        colour[(greatest + 2) % 3] = z[k] * y as f64 / last;
                        colour
                    };
                    let middle = Self::SIZE / 2;
                    let start = fit(colour(middle));
                    let mut put = |k: usize, fit: [f64; 3]| {
                        nodes[Self::index(greatest, k, y, x)] = fit.map(|c| c as f32);
                    };
                    put(middle, start);
                    let mut before = start;
                    for k in middle + 1..Self::SIZE {
                        before = refine(before, colour(k));
                        put(k, before);
                    }
                    before = start;
                    for k in (0..middle).rev() {
                        before = refine(before, colour(k));
                        put(k, before);
                    }
                }
            }
        }
        Self { nodes, z: z.map(|z| z as f32) }
    }

    fn index(greatest: usize, z: usize, y: usize, x: usize) -> usize {
        ((greatest * Self::SIZE + z) * Self::SIZE + y) * Self::SIZE + x
    }

    /// Trilinear between nodes.
    fn look_up(&self, colour: Spectrum) -> Sigmoid {
        let rgb = colour.to_array();
        let greatest =
            if rgb[0] >= rgb[1] && rgb[0] >= rgb[2] { 0 } else { 1 + usize::from(rgb[2] > rgb[1]) };
        let most = rgb[greatest];
        let last = (Self::SIZE - 1) as f32;
        let place = |value: f32| {
            let at = (value / most * last).clamp(0.0, last);
            let low = (at as usize).min(Self::SIZE - 2);
            (low, at - low as f32)
        };
        let (x, tx) = place(rgb[(greatest + 1) % 3]);
        let (y, ty) = place(rgb[(greatest + 2) % 3]);
        let z = self.z.partition_point(|&z| z <= most).clamp(1, Self::SIZE - 1) - 1;
        let tz = ((most - self.z[z]) / (self.z[z + 1] - self.z[z])).clamp(0.0, 1.0);
        let mut coefficients = [0.0; 3];
        for corner in 0..8 {
            let side = |bit: usize, t: f32| if corner >> bit & 1 == 1 { t } else { 1.0 - t };
            let share = side(0, tx) * side(1, ty) * side(2, tz);
            let node =
                self.nodes[Self::index(greatest, z + (corner >> 2), y + (corner >> 1 & 1), x + (corner & 1))];
            (0..3).for_each(|k| coefficients[k] += share * node[k]);
        }
        Sigmoid { coefficients }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumbre_math::random::RandomStream;

    /// The colour under D65, by a sum over every nanometre.
    fn colour_of(sigmoid: Sigmoid) -> [f32; 3] {
        super::super::weigh(|nm| f64::from(sigmoid.at(nm as f32))).to_array()
    }

    #[test]
    fn fits_are_those_that_others_found() {
        // Coefficients of λ², λ and 1 in nm, from an independent exact fit, and the reflectance at 450, 550 and 650 nm.
        let known = [
            ([0.8, 0.2, 0.1], [6.98543e-05, -0.0647727, 13.824], [0.11879, 0.22168, 0.88861]),
            ([0.1, 0.6, 0.2], [-0.000_150_46, 0.160_092, -42.3677], [0.18898, 0.5832, 0.058_707]),
            ([0.2, 0.3, 0.9], [8.88721e-05, -0.105_154, 30.4402], [0.87259, 0.27258, 0.33002]),
            ([0.9, 0.7, 0.3], [-1.13385e-05, 0.019_919_3, -7.03728], [0.32663, 0.71943, 0.87293]),
            ([0.05, 0.05, 0.4], [4.91815e-05, -0.064_008_4, 18.5612], [0.36371, 0.064_912, 0.042_594]),
            ([0.5, 0.45, 0.4], [-3.80269e-09, 0.001_016_18, -0.651_093], [0.4045, 0.45353, 0.50391]),
        ];
        for ([r, g, b], [a, b1, c], values) in known {
            let sigmoid = Sigmoid::of(Spectrum::new(r, g, b));
            for (nm, value) in [450.0_f32, 550.0, 650.0].into_iter().zip(values) {
                let nm64 = f64::from(nm);
                let p: f64 = (a * nm64 + b1) * nm64 + c;
                let theirs = 0.5 + 0.5 * p / (1.0 + p * p).sqrt();
                assert!((theirs - value).abs() < 1e-3, "the row itself: {theirs} {value}");
                assert!(
                    (f64::from(sigmoid.at(nm)) - value).abs() < 5e-4,
                    "{r} {g} {b} at {nm}: {}",
                    sigmoid.at(nm)
                );
            }
        }
    }

    #[test]
    fn a_fit_has_the_colour_that_it_is_of() {
        let mut random = RandomStream::new(11);
        for _ in 0..300 {
            let mut channel = || 0.03 + 0.94 * random.next_f64() as f32;
            let colour = Spectrum::new(channel(), channel(), channel());
            let found = colour_of(Sigmoid::of(colour));
            for (found, wanted) in found.into_iter().zip(colour.to_array()) {
                assert!((found - wanted).abs() < 2e-4, "{colour:?}: {found}");
            }
        }
    }

    #[test]
    fn colours_that_no_sigmoid_has_come_near() {
        for rgb in [
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
            [0.8, 0.0, 0.0],
            [1.0, 1.0, 0.0],
            [0.3, 0.0, 0.0],
        ] {
            let [r, g, b] = rgb;
            let found = colour_of(Sigmoid::of(Spectrum::new(r, g, b)));
            for (found, wanted) in found.into_iter().zip(rgb) {
                assert!((found - wanted).abs() < 0.03, "{rgb:?}: {found}");
            }
        }
    }

    #[test]
    fn greys_are_exact_at_every_wavelength() {
        for grey in [0.0_f32, 1e-6, 0.01, 0.18, 0.5, 0.731, 0.99, 1.0] {
            for sigmoid in [Sigmoid::of(Spectrum::splat(grey)), Sigmoid::by_table(Spectrum::splat(grey))] {
                for nm in [360.0, 444.4, 595.0, 830.0] {
                    assert!(
                        (sigmoid.at(nm) - grey).abs() <= 1e-6 * grey.max(1e-3),
                        "{grey}: {}",
                        sigmoid.at(nm)
                    );
                }
            }
        }
        assert_eq!(Sigmoid::of(Spectrum::new(f32::NAN, -3.0, 0.0)).at(500.0), 0.0);
        assert_eq!(Sigmoid::of(Spectrum::splat(7.0)).at(500.0), 1.0);
    }

    #[test]
    fn the_table_is_near_the_fits() {
        let mut random = RandomStream::new(5);
        let (mut worst, mut sum, count) = (0.0_f32, 0.0_f32, 500_u16);
        for _ in 0..count {
            let mut channel = || 0.02 + 0.96 * random.next_f64() as f32;
            let colour = Spectrum::new(channel(), channel(), channel());
            let found = colour_of(Sigmoid::by_table(colour));
            for (found, wanted) in found.into_iter().zip(colour.to_array()) {
                worst = worst.max((found - wanted).abs());
                sum += (found - wanted).abs() / (3.0 * f32::from(count));
            }
        }
        assert!(worst < 0.002 && sum < 0.0002, "{worst} {sum}");
        // As light of this colour, which is looked up at half of its greatest channel.
        for rgb in [[0.5, 0.0625, 0.0625], [0.0625, 0.5, 0.0625], [0.0625, 0.0625, 0.5]] {
            let found = colour_of(Sigmoid::by_table(Spectrum::from(rgb)));
            for (found, wanted) in found.into_iter().zip(rgb) {
                assert!((found / wanted - 1.0).abs() < 3e-3, "{rgb:?}: {found}");
            }
        }
    }
}
