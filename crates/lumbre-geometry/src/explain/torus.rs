//! Tori, by the quartic along the line.

use lumbre_math::DVec3;
use lumbre_math::roots::DepressedCubic;

use super::notes::{Notes, out_of_range};
use super::quadratic::digits_lost;
use super::{Fate, Remark, Topic};
use crate::{Ray, Torus};

/// The textbook's quartic along the line from the ray's origin, the constant first.
#[derive(Clone, Copy)]
struct Schoolbook([f64; 5]);

impl Schoolbook {
    fn new(torus: &Torus, w: DVec3, d: DVec3) -> Self {
        let (big, small) = (torus.major() * torus.major(), torus.minor() * torus.minor());
        let (across, offset) = (d.cross(torus.axis()), w.cross(torus.axis()));
        let (g, h, k) = (d.dot(d), w.dot(d), w.dot(w) + big - small);
        Self([
            k * k - 4.0 * big * offset.dot(offset),
            4.0 * h * k - 8.0 * big * offset.dot(across),
            4.0 * h * h + 2.0 * g * k - 4.0 * big * across.dot(across),
            4.0 * g * h,
            g * g,
        ])
    }

    /// How far from `t` its root is, by a step of Newton's method, relative to `t`.
    fn relative_error(self, t: f64) -> f64 {
        let [c0, c1, c2, c3, c4] = self.0;
        let value = (((c4 * t + c3) * t + c2) * t + c1) * t + c0;
        let slope = ((4.0 * c4 * t + 3.0 * c3) * t + 2.0 * c2) * t + c1;
        (value / slope / t).abs()
    }
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
        step.vector("w", "O − C", w).number("v", "|D|", nearest.speed);
        step.number("t₀", "−(w·D)/(D·D)", nearest.start).number("s₀", "", nearest.shift);
        step.vector("p", "", p).vector("u", "", u);
        step.number("z₀", "p·⟨0, 0, 1⟩", p.z).number("z₁", "u·⟨0, 0, 1⟩", u.z);
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
        step.number("s₁", "", low).number("s₂", "", high);
        let Some(line) = self.line(&ray.with_range(f64::NEG_INFINITY, f64::INFINITY)) else {
            return;
        };

        let schoolbook = Schoolbook::new(self, w, ray.direction);
        let Schoolbook([c0, c1, c2, ..]) = schoolbook;
        let quartic = self.quartic(&line);
        let step = notes.step(Topic::Quartic);
        step.number("a₂", "2·(|p|² − r² − R² + 2·R²·z₁²)", quartic.p);
        step.beside("c₂ = 4·(w·D)² + 2·(D·D)·(w·w + R² − r²) − 4·R²·|D×V|²", c2);
        step.number("a₁", "8·R²·z₀·z₁", quartic.q);
        step.beside("c₁ = 4·(w·D)·(w·w + R² − r²) − 8·R²·((w×V)·(D×V))", c1);
        step.number("a₀", "(|p|² − r² + R²)² − 4·R²·(|p|² − z₀²)", quartic.w);
        step.beside("c₀ = (w·w + R² − r²)² − 4·R²·|w×V|²", c0);
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
        notes.step(Topic::QuarticExtrema).numbers("s", "", splits).numbers("f", "", values);

        let mut roots = vec![];
        self.crossings(&line, f64::NEG_INFINITY, |s, multiplicity| {
            roots.push((s, line.t(s), multiplicity));
            true
        });
        let step = notes.step(Topic::QuarticRoots);
        let mut lost: f64 = 0.0;
        for ([s_name, t_name], &(s, t, multiplicity)) in ROOTS.into_iter().zip(&roots) {
            step.number(s_name, "", s).number(t_name, format!("t₀ + (s₀ + {s_name})/v"), t);
            if multiplicity == 1 {
                let off = schoolbook.relative_error(t);
                lost = lost.max(if off.is_finite() { off } else { 0.0 });
            } else {
                step.remark(Remark::Touches);
            }
        }
        step.remark(match self.descend(&line, &quartic) {
            _ if roots.is_empty() => Remark::Misses,
            Some(_) => Remark::Descent,
            None => Remark::Pieces,
        });
        if lost > 1e-12 {
            step.remark(Remark::Cancellation { digits: digits_lost(lost) });
        }
        for (_, t, _) in roots {
            notes.candidate(t, 0, out_of_range(ray, t).unwrap_or(Fate::Hit));
        }
    }
}
