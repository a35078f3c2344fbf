//! Cylinders and cones.

use lumbre_math::DVec3;

use super::notes::{Notes, out_of_range};
use super::planar::tell_plane;
use super::quadratic::{Solved, at_place, stable_q, tell_place};
use super::{Fate, Remark, Topic};
use crate::Ray;
use crate::axial::{Axial, CAP1, Doubles, Equation, ExactSide, LATERAL, Span};
use crate::support::length;

impl Axial {
    pub(crate) fn explained(&self, ray: &Ray, notes: &mut Notes) {
        self.tell_parameters(notes);
        let pair = self.tell_side(ray, notes);
        self.tell_cuts(ray, notes);
        self.tell_candidates(ray, notes, pair, self.lateral_span(ray), self.slab_span(ray));
    }

    pub(super) fn tell_parameters(&self, notes: &mut Notes) {
        let step = notes.step(Topic::Parameters);
        step.vector("P₁", "", self.p1);
        if self.p2 != self.p1 {
            step.vector("P₂", "", self.p2);
        }
        step.vector("V", if self.has_ends { "(P₂ − P₁)/|P₂ − P₁|" } else { "" }, self.axis);
        step.number("r₁", "", self.r1);
        if self.k == 0.0 {
            return;
        }
        if self.has_ends {
            step.number("r₂", "", self.r2).number("k", "(r₂ − r₁)/|P₂ − P₁|", self.k);
        } else {
            step.number("k", "", self.k);
        }
    }

    /// Explains both crossings with the uncut lateral surface of both nappes.
    pub(super) fn tell_side(&self, ray: &Ray, notes: &mut Notes) -> Option<(f64, f64)> {
        let (start, p, slack) = self.set_up(ray);
        let doubles = Doubles::new(self, ray.direction, p, length(slack));
        let pair = if let Some(cone) = doubles.double_cone(start) {
            self.tell_doubles(notes, ray, start, p, &doubles, cone.pair);
            cone.pair
        } else {
            let exact = self.exact_side(ray, start, p);
            if exact.solution.is_finite {
                self.tell_exact(notes, ray, &exact);
            } else {
                self.tell_doubles(notes, ray, start, p, &doubles, exact.pair);
            }
            exact.pair
        };
        if self.r1 == 0.0 {
            tell_plane(notes, Topic::Tip, ray, ("P₁", self.p1), ("V", self.axis));
        } else if self.r2 == 0.0 {
            tell_plane(notes, Topic::Tip, ray, ("P₂", self.p2), ("V", self.axis));
        }
        pair
    }

    /// The textbook's formulas, where `W` comes from the first end, or from the second.
    fn textbook(&self, is_from_first: bool) -> [&'static str; 3] {
        if self.k == 0.0 {
            ["|D×V|²", "(D×V)·(W×V)", "|W×V|² − r₁²"]
        } else if is_from_first {
            ["|D×V|² − (k·(D·V))²", "(D×V)·(W×V) − (r₁ + k·(W·V))·(k·(D·V))", "|W×V|² − (r₁ + k·(W·V))²"]
        } else {
            ["|D×V|² − (k·(D·V))²", "(D×V)·(W×V) − (r₂ + k·(W·V))·(k·(D·V))", "|W×V|² − (r₂ + k·(W·V))²"]
        }
    }

    /// What the search makes of a line that lies in the lateral surface.
    fn in_surface(&self) -> Remark {
        match (self.caps, self.k == 0.0) {
            (false, _) => Remark::InSurface,
            (true, true) => Remark::InCappedSide,
            (true, false) => Remark::AlongGenerator,
        }
    }

    fn tell_doubles(
        &self,
        notes: &mut Notes,
        ray: &Ray,
        start: f64,
        place: DVec3,
        doubles: &Doubles,
        crossings: Option<(f64, f64)>,
    ) {
        let w = ray.origin - self.p1;
        let Equation { a, h, c, g, .. } = doubles.equation;
        let at_origin = self.equation(w, ray.direction);
        let formulas = self.textbook(true);
        let solved = Solved {
            start,
            coefficients: [a, h, c],
            at_origin: [at_origin.a, at_origin.h, at_origin.c],
            formulas,
            textbook: formulas,
            in_surface: self.in_surface(),
            touches: Remark::Touches,
            nearest: None,
            delta: doubles.delta,
            delta_formula: "h² − a·c",
            delta_error: Some(doubles.delta_error),
            errors: Some(doubles.errors),
            q: stable_q(h, doubles.delta),
            crossings,
            is_twofold: false,
        };
        tell_place(notes, "O − P₁", w, start, place);
        solved.tell(notes, |_| ());
        if self.k != 0.0 {
            let step = notes.step(Topic::Nappe);
            step.number("g", "k·(D·V)", g);
            step.number("ρ", at_place("r₁ + k·(W·V) − g·(h/a)", start), doubles.radius);
        }
    }

    fn tell_exact(&self, notes: &mut Notes, ray: &Ray, exact: &ExactSide) {
        let ExactSide { spine, solution, .. } = exact;
        let w = ray.origin - spine.base;
        let axis = DVec3::from_array(spine.axis.map(|x| x.high));
        let [rise, radius] = [spine.rise, spine.radius].map(|x| x.high);
        // The textbook's axis is a unit vector, and its radius that of the end which `W` comes from.
        let is_from_first = spine.base == self.p1;
        let at_origin = {
            let (across, offset) = (ray.direction.cross(self.axis), w.cross(self.axis));
            let first = if is_from_first { self.r1 } else { self.r2 };
            let (e, g) = (first + self.k * w.dot(self.axis), self.k * ray.direction.dot(self.axis));
            [across.length_squared() - g * g, across.dot(offset) - e * g, offset.length_squared() - e * e]
        };
        let is_at_tip = {
            let terms = exact.e.abs() + (exact.g * (exact.h / exact.a)).abs();
            self.k != 0.0 && exact.middle.abs() <= 1e-20 * terms
        };
        let solved = Solved {
            start: 0.0,
            coefficients: at_origin,
            at_origin,
            formulas: [
                "(U·U)·|D×U|² − (K·(D·U))²",
                "(U·U)·((D×U)·(W×U)) − (ρ₀ + K·(W·U))·(K·(D·U))",
                "(U·U)·|W×U|² − (ρ₀ + K·(W·U))²",
            ],
            textbook: self.textbook(is_from_first),
            in_surface: self.in_surface(),
            touches: if is_at_tip { Remark::ThroughTip } else { Remark::Touches },
            nearest: None,
            delta: 0.0,
            delta_formula: "h² − a·c",
            delta_error: None,
            errors: None,
            q: 0.0,
            crossings: exact.pair,
            is_twofold: false,
        };
        let solved = solved.in_twice_the_precision(solution);
        let (place, start) = (DVec3::from_array(solution.place.map(|x| x.high)), solution.start);
        let from = if is_from_first { "O − P₁" } else { "O − P₂" };
        tell_place(notes, from, w, start, place);
        solved.tell(notes, |step| {
            // Along the axis from end to end where there are ends, with a length near 1.
            step.vector("U", "", axis).number("K", "", rise).number("ρ₀", "", radius);
        });
        if self.k != 0.0 && exact.a != 0.0 {
            let step = notes.step(Topic::Nappe);
            step.number("g", "K·(D·U)", exact.g);
            step.number("ρ", at_place("ρ₀ + K·(W·U) − g·(h/a)", start), exact.middle);
        }
    }

    /// Explains where the line passes the planes that cut the body.
    pub(super) fn tell_cuts(&self, ray: &Ray, notes: &mut Notes) {
        let second = if self.p2 == self.p1 { "P₁" } else { "P₂" };
        let cuts =
            [(self.cut1, Topic::FirstCut, ("P₁", self.p1)), (self.cut2, Topic::SecondCut, (second, self.p2))];
        for (is_cut, topic, point) in cuts {
            if is_cut {
                tell_plane(notes, topic, ray, point, ("V", self.axis));
            }
        }
    }

    /// That the point of the lateral surface at `t` is above or below the body.
    pub(super) fn outside_heights(&self, ray: &Ray, t: f64) -> Fate {
        let has_low_end = self.cut1 || self.r1 == 0.0 || self.is_bounded();
        let min = if has_low_end { 0.0 } else { f64::NEG_INFINITY };
        let max = match (self.is_bounded(), self.cut2) {
            (true, _) => self.length,
            (false, true) => 0.0,
            (false, false) => f64::INFINITY,
        };
        Fate::OutsideHeights { z: self.arm(ray, t, LATERAL).0, min, max }
    }

    fn tell_candidates(
        &self,
        ray: &Ray,
        notes: &mut Notes,
        pair: Option<(f64, f64)>,
        side: Option<Span>,
        slab: Option<Span>,
    ) {
        let is_end = |t: f64| side.is_some_and(|side| side.iter().any(|end| end.0 == t));
        let of_equation = pair.map_or(vec![], |(first, second)| vec![first, second]);
        for &t in of_equation.iter().filter(|&&t| t.is_finite() && !is_end(t)) {
            let height = (ray.origin - self.p1).dot(self.axis) + t * ray.direction.dot(self.axis);
            notes.candidate(t, LATERAL, Fate::OtherNappe { radius: self.r1 + self.k * height });
        }
        let Some([side_near, side_far]) = side else {
            return;
        };
        let sides = if side_near.0 == side_far.0 { vec![side_near] } else { vec![side_near, side_far] };
        let Some([slab_near, slab_far]) = slab else {
            for (t, part) in sides {
                notes.candidate(t, part, self.outside_heights(ray, t));
            }
            return;
        };
        if !self.caps {
            for (t, part) in sides {
                let is_between = slab_near.0 <= t && t <= slab_far.0;
                let fate = (!is_between).then(|| self.outside_heights(ray, t));
                notes.candidate(t, part, fate.or_else(|| self.excludes(ray, t, part)).unwrap_or(Fate::Hit));
            }
            return;
        }
        let near = if slab_near.0 > side_near.0 { slab_near } else { side_near };
        let far = if slab_far.0 < side_far.0 { slab_far } else { side_far };
        for end @ (t, part) in sides.into_iter().chain([slab_near, slab_far]) {
            let fate = if near.0 <= far.0 && (t == near.0 || t == far.0) {
                let owner = if t == near.0 { near } else { far };
                let is_owner = end == owner;
                self.excludes(ray, t, part).unwrap_or(if is_owner {
                    Fate::Hit
                } else {
                    Fate::Shared { part: owner.1 }
                })
            } else if part == LATERAL {
                self.outside_heights(ray, t)
            } else {
                let radius = if part == CAP1 { self.r1 } else { self.r2 };
                Fate::OutsideRim { distance: length(self.arm(ray, t, part).1), radius }
            };
            notes.candidate(t, part, fate);
        }
    }

    /// Why a crossing between the cuts is none of the ray: its range, or the sweep.
    fn excludes(&self, ray: &Ray, t: f64, part: u32) -> Option<Fate> {
        if let Some(fate) = out_of_range(ray, t) {
            return Some(fate);
        }
        let is_swept = self.is_whole() || self.keeps(ray, t, part);
        (!is_swept).then(|| {
            let phi = self.phi(self.arm(ray, t, part).1);
            Fate::OutsideSweep { phi, max: self.phi_max }
        })
    }
}
