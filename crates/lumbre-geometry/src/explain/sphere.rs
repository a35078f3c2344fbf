//! Spheres, and parts of them.

use lumbre_math::DVec3;

use super::notes::Notes;
use super::quadratic::{Solved, stable_q, tell_pair, tell_place};
use super::{Fate, Remark, Topic};
use crate::sphere::{Equation, Nearby, crossings, solution};
use crate::support::azimuth;
use crate::{Ray, Sphere};

const FORMULAS: [&str; 3] = ["D·D", "W·D", "W·W − r²"];

/// Explains both crossings with a whole sphere, whose centre is called `C` and radius `r`.
pub(super) fn tell_sphere(notes: &mut Notes, center: DVec3, radius: f64, ray: &Ray) -> Option<(f64, f64)> {
    let equation = Equation::new(center, radius, ray);
    let Equation { a, h, c, keeps_digits, .. } = equation;
    let delta = a * equation.depth;
    let w = ray.origin - center;
    let found = crossings(center, radius, ray);
    let from_origin = Solved {
        start: 0.0,
        coefficients: [a, h, c],
        at_origin: [a, h, c],
        formulas: FORMULAS,
        textbook: FORMULAS,
        in_surface: Remark::InSurface,
        touches: Remark::Touches,
        nearest: Some(("l", "W − (h/a)·D", equation.nearest)),
        delta,
        delta_formula: "a·(r² − l·l)",
        delta_error: None,
        errors: None,
        q: stable_q(h, delta),
        crossings: found,
        is_twofold: false,
    };
    let is_simple = equation.is_steep && keeps_digits || equation.surely_misses;
    let (solved, place) = if is_simple {
        (from_origin, w)
    } else {
        let nearby = Nearby::new(center, radius, ray, [a, h]);
        let elsewhere = Solved { nearest: None, delta_formula: "h² − a·c", ..from_origin };
        let exact = solution(center, radius, ray, nearby.start);
        if nearby.is_certain && keeps_digits {
            let Nearby { start, place, h, c, delta, error, .. } = nearby;
            let q = stable_q(h, delta);
            let coefficients = [a, h, c];
            (Solved { start, coefficients, delta, delta_error: Some(error), q, ..elsewhere }, place)
        } else if exact.is_finite {
            (elsewhere.in_twice_the_precision(&exact), DVec3::from_array(exact.place.map(|x| x.high)))
        } else {
            (from_origin, w)
        }
    };
    tell_place(notes, "O − C", w, solved.start, place);
    solved.tell(notes, |_| ());
    found
}

impl Sphere {
    pub(crate) fn explained(&self, ray: &Ray, notes: &mut Notes) {
        let step = notes.step(Topic::Parameters);
        step.vector("C", "", self.center()).number("r", "", self.radius());
        let pair = tell_sphere(notes, self.center(), self.radius(), ray);
        tell_pair(notes, ray, pair, |t| self.excludes(ray, t));
    }

    /// Why the point at `t` of the whole sphere is not on this part.
    fn excludes(&self, ray: &Ray, t: f64) -> Option<Fate> {
        let w = self.arm(ray, t);
        if self.is_whole() || self.keeps(w) {
            return None;
        }
        let phi = azimuth(w.y, w.x);
        let is_between = self.z_min <= w.z && w.z <= self.z_max;
        Some(if is_between {
            Fate::OutsideSweep { phi, max: self.phi_max }
        } else {
            Fate::OutsideHeights { z: w.z, min: self.z_min, max: self.z_max }
        })
    }
}
