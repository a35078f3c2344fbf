//! Tori, by the quartic along the line.

use lumbre_math::roots::{DepressedCubic, quartic_roots_between};

use super::notes::{Notes, out_of_range};
use super::quadratic::digits_lost;
use super::{Fate, Remark, Topic};
use crate::twofold::{self, Number, Twofold, components, cross, dot};
use crate::{Ray, Torus};

/// The textbook's quartic along the line from the ray's origin.
struct Schoolbook {
    /// The constant first.
    coefficients: [f64; 5],
    /// Whether none of them is rounded.
    is_exact: bool,
}

/// The coefficients for a torus with the squares of both radii, where `w` leads from its centre to the ray's origin.
fn coefficients<N: Number>(w: [N; 3], d: [N; 3], axis: [N; 3], [big, small]: [N; 2]) -> [N; 5] {
    let (across, offset) = (cross(d, axis), cross(w, axis));
    let (g, h, k) = (dot(d, d), dot(w, d), dot(w, w) + big - small);
    let [two, four, eight] = [2.0, 4.0, 8.0].map(N::from);
    [
        k * k - four * big * dot(offset, offset),
        four * h * k - eight * big * dot(offset, across),
        four * h * h + two * g * k - four * big * dot(across, across),
        four * g * h,
        g * g,
    ]
}

impl Schoolbook {
    fn new(torus: &Torus, ray: &Ray) -> Self {
        let (center, radii) = (torus.center(), [torus.major(), torus.minor()]);
        let (w, d) = ((ray.origin - center).to_array(), ray.direction.to_array());
        let rounded = coefficients(w, d, torus.axis().to_array(), radii.map(|r| r * r));
        let w = std::array::from_fn(|i| Twofold::difference(ray.origin[i], center[i]));
        let (d, axis) = (components(ray.direction), components(torus.axis()));
        let whole = coefficients(w, d, axis, radii.map(|r| Twofold::product(r, r)));
        let is_exact = whole.iter().zip(rounded).all(|(whole, c)| whole.high == c && whole.low == 0.0);
        Self { coefficients: rounded, is_exact }
    }

    /// Its real roots in ascending order.
    fn roots(&self) -> Vec<f64> {
        let Self { coefficients, .. } = self;
        let fits = coefficients.iter().all(|c| c.is_finite());
        if fits {
            quartic_roots_between(coefficients, f64::NEG_INFINITY, f64::INFINITY).to_vec()
        } else {
            vec![]
        }
    }
}

/// The crossing that a crossing in doubles stands for: a step of Newton's method on the torus' own equation
/// `(p·p + R² − r²)² = 4·R²·|p×V|²`, in twice the precision at the point itself. `None` where that does not settle it.
fn settled(torus: &Torus, ray: &Ray, t: f64) -> Option<f64> {
    let p = twofold::place(ray.origin, torus.center(), t, ray.direction);
    let (d, v) = (components::<Twofold>(ray.direction), components::<Twofold>(torus.axis()));
    let (big, small) =
        (Twofold::product(torus.major(), torus.major()), Twofold::product(torus.minor(), torus.minor()));
    let four = big * Twofold::from(4.0) / dot(v, v);
    let (offset, across) = (cross(p, v), cross(d, v));
    let k = dot(p, p) + big - small;
    let value = k * k - four * dot(offset, offset);
    let half_slope = k * dot(p, d) * Twofold::from(2.0) - four * dot(offset, across);
    let step = value.high / (2.0 * half_slope.high);
    (step.abs() <= 1e-9 * t.abs()).then_some(t - step)
}

/// The names of the roots.
const ROOTS: [[&str; 2]; 4] = [["s₁", "t₁"], ["s₂", "t₂"], ["s₃", "t₃"], ["s₄", "t₄"]];

impl Torus {
    pub(crate) fn explained(&self, ray: &Ray, notes: &mut Notes) {
        let step = notes.step(Topic::Parameters);
        step.vector("C", "", self.center()).vector("V", "", self.axis());
        step.number("R", "", self.major()).number("r", "", self.minor());
        let w = ray.origin - self.center();
        let nearest = self.nearest(ray);
        let (p, u) = self.turned(&nearest);
        let step = notes.step(Topic::TorusFrame);
        step.vector("W", "O − C", w).number("g", "|D|", nearest.speed);
        step.number("t₀", "−(W·D)/(D·D)", nearest.start).number("s₀", "", nearest.shift);
        step.vector("p", "", p).vector("U", "", u);
        step.number("z₀", "p·⟨0, 0, 1⟩", p.z).number("z₁", "U·⟨0, 0, 1⟩", u.z);
        if !nearest.is_within {
            step.remark(Remark::Misses);
            return;
        }
        let bounds = self.span(p, u, self.reach());
        let step = notes.step(Topic::TorusBounds);
        let Some((low, high)) = bounds else {
            step.remark(Remark::Misses);
            return;
        };
        step.number("σ₁", "", low).number("σ₂", "", high);
        let Some(line) = self.line(&ray.with_range(f64::NEG_INFINITY, f64::INFINITY)) else {
            return;
        };

        let schoolbook = Schoolbook::new(self, ray);
        let [c0, c1, c2, c3, c4] = schoolbook.coefficients;
        let quartic = self.quartic(&line);
        let step = notes.step(Topic::Quartic);
        step.number("a₂", "2·(|p|² − r² − R² + 2·R²·z₁²)", quartic.p);
        step.beside("c₂ = 4·(W·D)² + 2·(D·D)·(W·W + R² − r²) − 4·R²·|D×V|²", c2);
        step.number("a₁", "8·R²·z₀·z₁", quartic.q);
        step.beside("c₁ = 4·(W·D)·(W·W + R² − r²) − 8·R²·((W×V)·(D×V))", c1);
        step.number("a₀", "(|p|² − r² + R²)² − 4·R²·(|p|² − z₀²)", quartic.w);
        step.beside("c₀ = (W·W + R² − r²)² − 4·R²·|W×V|²", c0);
        if self.is_thin() {
            step.remark(Remark::Thin);
        }

        let splits = match DepressedCubic::new(0.5 * quartic.p, 0.25 * quartic.q) {
            DepressedCubic::OneRoot(split) => vec![split],
            DepressedCubic::ThreeRoots(three) => {
                let left = three.left();
                let (middle, right) = three.others(left);
                vec![left, middle, right]
            }
        };
        let values = splits.iter().map(|&s| quartic.at(s).0).collect();
        notes.step(Topic::QuarticExtrema).numbers("s", "", splits).numbers("y", "", values);

        let mut roots = vec![];
        self.crossings(&line, f64::NEG_INFINITY, |s, multiplicity| {
            roots.push((s, line.t(s), multiplicity));
            true
        });
        let step = notes.step(Topic::QuarticRoots);
        for ([s_name, t_name], &(s, t, multiplicity)) in ROOTS.into_iter().zip(&roots) {
            step.number(s_name, "", s).number(t_name, format!("t₀ + (s₀ + {s_name})/g"), t);
            if multiplicity > 1 {
                step.remark(Remark::Touches);
            }
        }
        step.remark(match self.descend(&line, &quartic) {
            _ if roots.is_empty() => Remark::Misses,
            Some(_) => Remark::Descent,
            None => Remark::Pieces,
        });

        let theirs = schoolbook.roots();
        let step = notes.step(Topic::TextbookQuartic);
        step.number("c₄", "(D·D)·(D·D)", c4).number("c₃", "4·(D·D)·(W·D)", c3);
        step.numbers("τ", "", theirs.clone());
        let crossings = roots.iter().map(|root| usize::from(root.2)).sum();
        if theirs.len() == roots.len() {
            let mut lost: f64 = 0.0;
            for (theirs, &(_, t, multiplicity)) in theirs.iter().zip(&roots) {
                // Half of the digits of a double root are lost by any rounding.
                let is_simple = multiplicity == 1;
                if let Some(t) = settled(self, ray, t).filter(|_| is_simple) {
                    let off = ((theirs - t) / t).abs();
                    lost = lost.max(if off.is_finite() { off } else { 0.0 });
                }
            }
            if lost > 1e-12 {
                step.remark(Remark::Cancellation { digits: digits_lost(lost) });
            }
        } else if theirs.len() != crossings && !(schoolbook.is_exact && crossings > roots.len()) {
            // A touch of the very quartic is lost to the solver, not to rounded coefficients.
            step.remark(Remark::SchoolbookCount { crossings, roots: theirs.len() });
        }
        for (_, t, _) in roots {
            notes.candidate(t, 0, out_of_range(ray, t).unwrap_or(Fate::Hit));
        }
    }
}
