//! The steps of every quadratic equation.

use lumbre_math::{DVec3, Elementary};

use super::notes::{Notes, out_of_range};
use super::{Fate, Remark, Step, Topic};
use crate::Ray;
use crate::line::Solution;

/// How a quadratic equation along a line was solved.
pub(super) struct Solved {
    /// Where it was set up: 0 at the ray's origin.
    pub(super) start: f64,
    /// a, h and c there.
    pub(super) coefficients: [f64; 3],
    /// The same at the ray's origin, in doubles.
    pub(super) at_origin: [f64; 3],
    /// Their formulas, with `W` for the place.
    pub(super) formulas: [&'static str; 3],
    /// The textbook's formulas, with `W` for the ray's origin.
    pub(super) textbook: [&'static str; 3],
    /// What to say of a line that lies in the surface.
    pub(super) in_surface: Remark,
    /// What to say where both roots are one.
    pub(super) touches: Remark,
    /// A point, with its symbol and formula, that the discriminant is computed from.
    pub(super) nearest: Option<(&'static str, &'static str, DVec3)>,
    pub(super) delta: f64,
    pub(super) delta_formula: &'static str,
    /// A bound on the discriminant's error, where the search asks for it.
    pub(super) delta_error: Option<f64>,
    /// Bounds on the errors of a, h and c, where the search computes them.
    pub(super) errors: Option<[f64; 3]>,
    /// −(h ± √Δ).
    pub(super) q: f64,
    /// Both crossings, in `t`.
    pub(super) crossings: Option<(f64, f64)>,
    /// Whether it was solved in twice the precision.
    pub(super) is_twofold: bool,
}

/// −(h ± √Δ), with the sign that lets nothing cancel.
pub(super) fn stable_q(h: f64, delta: f64) -> f64 {
    -(h + delta.sqrt().copysign(h))
}

/// A formula in the place where an equation is set up.
pub(super) fn at_place(formula: &'static str, start: f64) -> String {
    if start == 0.0 { formula.to_owned() } else { formula.replace('W', "W₀") }
}

/// Explains where an equation is set up; `formula` and `w` are of the ray's origin, and `place` of the point at
/// `start`.
pub(super) fn tell_place(notes: &mut Notes, formula: &'static str, w: DVec3, start: f64, place: DVec3) {
    let step = notes.step(Topic::SetUp);
    step.vector("W", formula, w);
    if start != 0.0 {
        step.number("t₀", "", start).vector("W₀", "W + t₀·D", place);
        step.remark(Remark::SetUpNearby { start });
    }
}

/// Adds both crossings of a surface as candidates, which are hits where they are in the ray's range and nothing
/// `excludes` them.
pub(super) fn tell_pair(
    notes: &mut Notes,
    ray: &Ray,
    pair: Option<(f64, f64)>,
    excludes: impl Fn(f64) -> Option<Fate>,
) {
    let Some((first, second)) = pair else {
        return;
    };
    let mut tell = |t: f64| {
        let fate = out_of_range(ray, t).or_else(|| excludes(t));
        notes.candidate(t, 0, fate.unwrap_or(Fate::Hit));
    };
    tell(first);
    if second != first {
        tell(second);
    }
}

impl Solved {
    /// The same equation as it was solved in twice the precision.
    pub(super) fn in_twice_the_precision(self, exact: &Solution) -> Self {
        Self {
            start: exact.start,
            coefficients: [exact.a.high, exact.h.high, exact.c.high],
            delta: exact.delta().high,
            delta_error: None,
            errors: None,
            q: exact.q().high,
            // Where nothing is rounded, twice the precision changes nothing.
            is_twofold: [exact.a, exact.h, exact.c, exact.delta()].iter().any(|number| number.low != 0.0),
            ..self
        }
    }

    /// Explains the equation, in a step that `intermediates` begins.
    pub(super) fn tell(&self, notes: &mut Notes, intermediates: impl FnOnce(&mut Step)) {
        let step = notes.step(Topic::Quadratic);
        intermediates(step);
        if self.is_twofold {
            step.remark(Remark::TwicePrecision);
        }
        let [a, h, c] = self.coefficients;
        let [a_origin, h_origin, c_origin] = self.at_origin;
        let [a_formula, h_formula, c_formula] = self.formulas;
        let [a_textbook, h_textbook, c_textbook] = self.textbook;
        step.number("a", a_formula, a);
        if self.textbook_a() == "a₀" {
            step.beside(format!("a₀ = {a_textbook}"), a_origin);
        }
        step.number("h", at_place(h_formula, self.start), h);
        step.beside(format!("b = 2·({h_textbook})"), 2.0 * h_origin);
        step.number("c", at_place(c_formula, self.start), c);
        if self.textbook_c() == "c₀" {
            step.beside(format!("c₀ = {c_textbook}"), c_origin);
        }
        if let Some([a_error, h_error, c_error]) = self.errors {
            step.number("ε₂", "", a_error).number("ε₁", "", h_error).number("ε₀", "", c_error);
        }
        self.tell_discriminant(notes);
        self.tell_roots(notes);
    }

    /// What the textbook's first coefficient is called, which is that of the ray's origin.
    fn textbook_a(&self) -> &'static str {
        if self.coefficients[0] == self.at_origin[0] { "a" } else { "a₀" }
    }

    /// What its last coefficient is called.
    fn textbook_c(&self) -> &'static str {
        if self.coefficients[2] == self.at_origin[2] { "c" } else { "c₀" }
    }

    fn textbook_discriminant(&self) -> String {
        format!("b² − 4·{}·{}", self.textbook_a(), self.textbook_c())
    }

    fn schoolbook_discriminant(&self) -> f64 {
        let [a, h, c] = self.at_origin;
        let b = 2.0 * h;
        b * b - 4.0 * a * c
    }

    fn tell_discriminant(&self, notes: &mut Notes) {
        let schoolbook = self.schoolbook_discriminant();
        let step = notes.step(Topic::Discriminant);
        if let Some((symbol, formula, nearest)) = self.nearest {
            step.vector(symbol, formula, nearest);
        }
        step.number("Δ", self.delta_formula, self.delta);
        step.beside(self.textbook_discriminant(), schoolbook);
        if let Some(error) = self.delta_error {
            step.number("ε", "", error);
        }
        let is_schoolbook_hit = schoolbook >= 0.0;
        match self.crossings {
            // Without a negative discriminant nothing is rounded: the line lies in or inside of the surface.
            None if is_schoolbook_hit && self.delta < 0.0 => step.remark(Remark::SchoolbookHits),
            Some(_) if !is_schoolbook_hit => step.remark(Remark::SchoolbookMisses),
            _ => step,
        };
    }

    fn tell_roots(&self, notes: &mut Notes) {
        let step = notes.step(Topic::Roots);
        let [a, h, c] = self.coefficients;
        let Some((first, second)) = self.crossings else {
            step.remark(match () {
                () if a != 0.0 || h != 0.0 || c > 0.0 => Remark::Misses,
                () if c < 0.0 => Remark::InsideThroughout,
                () => self.in_surface,
            });
            return;
        };
        let from_start = |formula: &'static str| {
            if self.start == 0.0 { formula.to_owned() } else { format!("t₀ + {formula}") }
        };
        if first == second {
            step.number("t₁", if self.start == 0.0 { "−h/a" } else { "t₀ − h/a" }, first)
                .remark(self.touches);
            return;
        }
        // With the sign of h, or of zero, as the search takes it.
        step.number("q", if self.q < 0.0 { "−(h + √(Δ))" } else { "√(Δ) − h" }, self.q);
        let (q_over_a, c_over_q) = (from_start("q/a"), from_start("c/q"));
        // A root that has gone to infinity is q/a.
        let is_ascending = if a == 0.0 { !first.is_finite() } else { (self.q < 0.0) == (a > 0.0) };
        let formulas = if is_ascending { [q_over_a, c_over_q] } else { [c_over_q, q_over_a] };
        let textbook = self.textbook_roots();
        let mut lost: f64 = 0.0;
        for (i, (t, formula)) in [first, second].into_iter().zip(formulas).enumerate() {
            if !t.is_finite() {
                step.remark(Remark::AtInfinity);
                continue;
            }
            let (symbol, sign) = if i == 0 { ("t₁", '−') } else { ("t₂", '+') };
            // With a negative `a` the greater root comes with the minus.
            let sign = if (self.at_origin[0] < 0.0) == (sign == '−') { '+' } else { '−' };
            step.number(symbol, formula, t);
            let (discriminant, a) = (self.textbook_discriminant(), self.textbook_a());
            step.beside(format!("(−b {sign} √({discriminant}))/(2·{a})"), textbook[i]);
            if textbook[i].is_finite() {
                let off = ((textbook[i] - t) / t).abs();
                lost = lost.max(if off.is_finite() { off } else { 0.0 });
            }
        }
        if lost > 1e-12 {
            step.remark(Remark::Cancellation { digits: digits_lost(lost) });
        }
    }

    /// The roots by the formula of textbooks, in ascending order.
    fn textbook_roots(&self) -> [f64; 2] {
        let [a, h, _] = self.at_origin;
        let (b, root) = (2.0 * h, self.schoolbook_discriminant().sqrt());
        let [minus, plus] = [(-b - root) / (2.0 * a), (-b + root) / (2.0 * a)];
        if a < 0.0 { [plus, minus] } else { [minus, plus] }
    }
}

/// The decimal digits, of about 16, that a relative error takes.
pub(super) fn digits_lost(relative_error: f64) -> f64 {
    (relative_error / (0.5 * f64::EPSILON)).logarithm_10().clamp(0.0, 16.0)
}
