//! Paraboloids, hyperboloids and general quadrics.

use lumbre_math::DVec3;

use super::notes::Notes;
use super::quadratic::{Solved, stable_q, tell_pair, tell_place};
use super::{Fate, Remark, Topic};
use crate::line::{Doubles, SecondDegree, Solution, crossings, set_up};
use crate::support::azimuth;
use crate::twofold::point;
use crate::{Hyperboloid, Paraboloid, Quadric, Ray};

/// Explains both crossings of a line. The formulas are of a, h and c, and `from` is that of the ray's origin
/// relative to the base.
fn tell(
    notes: &mut Notes,
    surface: &impl SecondDegree,
    ray: &Ray,
    from: &'static str,
    formulas: [&'static str; 3],
) -> Option<(f64, f64)> {
    let (w, d) = (ray.origin - surface.base(), ray.direction);
    let (start, p, slack) = set_up(surface, ray);
    let doubles = Doubles::new(surface, d, p, slack);
    let Doubles { a, h, c, delta, errors, delta_error } = doubles;
    let found = crossings(surface, ray);
    let solved = Solved {
        start,
        coefficients: [a, h, c],
        at_origin: surface.along(w.to_array(), d.to_array()),
        formulas,
        textbook: formulas,
        in_surface: Remark::InSurface,
        touches: Remark::Touches,
        nearest: None,
        delta,
        delta_formula: "h² − a·c",
        delta_error: Some(delta_error),
        errors: Some(errors),
        q: stable_q(h, delta),
        crossings: found,
        is_twofold: false,
    };
    let is_decided = doubles.crossings(start).is_some();
    let exact = Solution::new(ray.origin, surface.base(), d, start, |p, d| surface.along(p, d));
    let (solved, place) = if is_decided || !exact.is_finite {
        (solved, p)
    } else {
        (solved.in_twice_the_precision(&exact), DVec3::from_array(exact.place.map(|x| x.high)))
    };
    tell_place(notes, from, w, solved.start, place);
    solved.tell(notes, |_| ());
    found
}

impl Paraboloid {
    pub(crate) fn explained(&self, ray: &Ray, notes: &mut Notes) {
        let step = notes.step(Topic::Parameters);
        step.number("r", "", self.radius).number("H", "", self.z_max).vector("Z", "", DVec3::Z);
        let formulas = ["H·|D×Z|²", "H·((W×Z)·(D×Z)) − r²·(D·Z)/2", "H·|W×Z|² − r²·(W·Z)"];
        let pair = tell(notes, self, ray, "O", formulas);
        tell_pair(notes, ray, pair, |t| {
            let p = point(ray.origin, DVec3::ZERO, t, ray.direction);
            if self.keeps(p) {
                return None;
            }
            let (z, min, max) = (p.z, self.z_min, self.z_max);
            let is_below = z < min && min > 0.0;
            Some(if is_below || z > max {
                Fate::OutsideHeights { z, min, max }
            } else {
                Fate::OutsideSweep { phi: azimuth(p.y, p.x), max: self.phi_max }
            })
        });
    }
}

impl Hyperboloid {
    pub(crate) fn explained(&self, ray: &Ray, notes: &mut Notes) {
        let along = self.p2 - self.p1;
        let base = self.base();
        let step = notes.step(Topic::Parameters);
        step.vector("P₁", "", self.p1).vector("P₂", "", self.p2).vector("Z", "", DVec3::Z);
        step.number("H", "(P₂ − P₁)·Z", along.z);
        step.vector("B", "(P₁·Z)·Z", base);
        step.vector("Q", "H·(P₁ − B)", along.z * (self.p1 - base));
        step.vector("K", "P₂ − P₁ − H·Z", along - along.z * DVec3::Z);
        let formulas = [
            "H²·|D×Z|² − |(D·Z)·K|²",
            "H²·((W×Z)·(D×Z)) − (Q + (W·Z)·K)·((D·Z)·K)",
            "H²·|W×Z|² − |Q + (W·Z)·K|²",
        ];
        let pair = tell(notes, self, ray, "O − B", formulas);
        tell_pair(notes, ray, pair, |t| {
            let p = base + point(ray.origin, base, t, ray.direction);
            if self.keeps(p) {
                return None;
            }
            let v = self.v_of(p.z);
            let turn = self.turn(p);
            Some(if (0.0..=1.0).contains(&v) {
                Fate::OutsideSweep { phi: azimuth(turn.y, turn.x), max: self.phi_max }
            } else {
                Fate::OutsideSegment { v }
            })
        });
    }
}

impl Quadric {
    pub(crate) fn explained(&self, ray: &Ray, notes: &mut Notes) {
        let [x, y, z] = [self.matrix.x_axis, self.matrix.y_axis, self.matrix.z_axis];
        let step = notes.step(Topic::Parameters);
        step.vector("Q₁", "", x).vector("Q₂", "", y).vector("Q₃", "", z);
        step.vector("G", "", 0.5 * self.linear).number("j", "", self.constant);
        let formulas =
            ["D·⟨Q₁·D, Q₂·D, Q₃·D⟩", "D·(⟨Q₁·W, Q₂·W, Q₃·W⟩ + G)", "W·(⟨Q₁·W, Q₂·W, Q₃·W⟩ + G) + W·G + j"];
        let pair = tell(notes, self, ray, "O", formulas);
        tell_pair(notes, ray, pair, |t| {
            let p = point(ray.origin, DVec3::ZERO, t, ray.direction);
            let clip = self.clip()?;
            let axis = (0..3).find(|&axis| !(clip.min[axis] <= p[axis] && p[axis] <= clip.max[axis]))?;
            Some(Fate::OutsideBox { axis, value: p[axis], min: clip.min[axis], max: clip.max[axis] })
        });
    }
}
