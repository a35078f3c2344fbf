//! Solids of revolution whose radius is linear along the axis: the common part of cylinders and cones.

use std::f64::consts::TAU;

use lumbre_math::quadratic::quadratic;
use lumbre_math::rounding::{UNIT_ROUNDOFF, gamma};
use lumbre_math::{DMat3, DVec2, DVec3, Elementary, Transform, orthonormal_basis};

use crate::line::{Solution, is_blurred, is_exact, is_nearby, plane_crossing, start};
use crate::nearest::{Meridian, under_similarity};
use crate::shape::{sampled_by_area, two_crossings};
use crate::sphere::sided;
use crate::support::{arc_support, azimuth, bounds_from_support, cross_size, dot_size, length, unit};
use crate::twofold::{Number, Twofold, components, cross, dot, place_near, point};
use crate::{
    Aabb, BoundingVolume, NearestPoint, NearestPointError, Ray, Root, Surface, SurfaceSample, density,
    measure,
};

/// The points at distance ρ(z) = r1 + k z from an axis, where z is the distance along it, between two planes
/// perpendicular to it.
///
/// With caps it is a convex solid, and its crossings are the ends of one interval: the lateral surface's
/// intersected with the slab's. No computed point is tested against a rim, so there is no crack along it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Axial {
    /// The points of the axis at z = 0 and z = length; both the same when the length is infinite.
    pub(crate) p1: DVec3,
    pub(crate) p2: DVec3,
    /// Unit.
    pub(crate) axis: DVec3,
    pub(crate) length: f64,
    pub(crate) r1: f64,
    pub(crate) r2: f64,
    /// (r2 − r1) / length.
    pub(crate) k: f64,
    /// Whether the planes through p1 and p2 cut the body; false at an apex.
    pub(crate) cut1: bool,
    pub(crate) cut2: bool,
    /// Whether disks close the body at the cuts.
    pub(crate) caps: bool,
    pub(crate) phi_max: f64,
    /// Whether the line from p1 to p2 is the axis and the radii there are exact; else `axis` and `k` are.
    pub(crate) has_ends: bool,
}

pub(crate) const LATERAL: u32 = 0;
pub(crate) const CAP1: u32 = 1;
pub(crate) const CAP2: u32 = 2;

/// The interval of a line inside a convex set: its two ends in order of `t`, each with the part that bounds it.
pub(crate) type Span = [(f64, u32); 2];

/// What one nappe has of a line that crosses the double cone at two places, or misses it; `radius` is the signed radius
/// at the middle of the crossings, and `growth` that of the radius along the line.
#[inline]
fn nappe(a: f64, pair: Option<(f64, f64)>, growth: f64, radius: f64) -> Option<Span> {
    let (first, second) = pair?;
    let (low, high) = if a > 0.0 {
        (radius >= 0.0).then_some((first, second))?
    } else if growth > 0.0 {
        (second, f64::INFINITY)
    } else {
        (f64::NEG_INFINITY, first)
    };
    Some([(low, LATERAL), (high, LATERAL)])
}

/// F(t) = a t² + 2 h t + c = |B + tA|² − (e + g t)² with A = D×V, B = W×V.
pub(crate) struct Equation {
    pub(crate) a: f64,
    pub(crate) h: f64,
    pub(crate) c: f64,
    pub(crate) e: f64,
    pub(crate) g: f64,
    /// A.
    pub(crate) across: DVec3,
    /// B.
    pub(crate) offset: DVec3,
}

/// The equation in doubles, with bounds of its errors.
pub(crate) struct Doubles {
    pub(crate) equation: Equation,
    /// h² − ac.
    pub(crate) delta: f64,
    /// The signed radius at the middle of the crossings.
    pub(crate) radius: f64,
    /// Of a, h and c, in units of the unit roundoff.
    pub(crate) errors: [f64; 3],
    /// Of the discriminant.
    pub(crate) delta_error: f64,
    /// Whether the signs of a, the discriminant and the radius are beyond doubt.
    pub(crate) is_certain: bool,
}

impl Doubles {
    /// The equation set up at the place `p` relative to p1, which is `slack` units of the unit roundoff off.
    #[inline(always)]
    pub(crate) fn new(body: &Axial, d: DVec3, p: DVec3, slack: f64) -> Self {
        let equation = body.equation(p, d);
        let Equation { a, h, c, e, g, across, offset } = equation;
        let delta = h * h - a * c;

        // Bounds on the errors in units of the unit roundoff, by the inequality of Cauchy and Schwarz.
        let (way, across, offset) = (length(p), length(across), length(offset));
        let (speed, reach) = (4.0 * length(d), 4.0 * way + slack);
        let slope = body.k.abs();
        let e_error = slope * reach + 2.0 * body.r1;
        let a_error = 2.0 * speed * (across + slope * g.abs());
        let h_error = across * reach + offset * speed + g.abs() * e_error + e.abs() * slope * speed;
        let c_error = 2.0 * (offset * reach + e.abs() * e_error)
            // Near the apex nothing is left but errors.
            + UNIT_ROUNDOFF * (reach * reach + e_error * e_error);
        let delta_error = f64::EPSILON * (2.0 * h.abs() * h_error + a.abs() * c_error + c.abs() * a_error);
        let radius = e - g * (h / a);
        let is_certain = a.abs() > f64::EPSILON * a_error
            && delta.abs() > delta_error
            && (g == 0.0 || radius.abs() > 8.0 * f64::EPSILON * (e_error + (h / a).abs() * slope * speed));
        Self { equation, delta, radius, errors: [a_error, h_error, c_error], delta_error, is_certain }
    }

    /// What the line has of the double cone, as far as doubles decide it.
    #[inline(always)]
    pub(crate) fn double_cone(&self, start: f64) -> Option<DoubleCone> {
        let Equation { a, h, c, g, .. } = self.equation;
        if !self.is_certain {
            return None;
        }
        let cone = DoubleCone { a, growth: g, radius: self.radius, pair: None };
        if self.delta < 0.0 && a > 0.0 {
            return Some(cone);
        }
        let (first, second) = quadratic(a, h, c, self.delta)?;
        let keeps_digits = is_exact(start, [first, second], 2.0 * self.delta.sqrt(), self.errors, 60.0);
        keeps_digits.then_some(DoubleCone { pair: Some((start + first, start + second)), ..cone })
    }
}

/// What a line that crosses a double cone at two places, or misses it, has of it.
pub(crate) struct DoubleCone {
    pub(crate) a: f64,
    /// What the signed radius grows by along the line, and what it is at the middle of the crossings.
    pub(crate) growth: f64,
    pub(crate) radius: f64,
    pub(crate) pair: Option<(f64, f64)>,
}

impl DoubleCone {
    /// The part in one nappe.
    #[inline]
    pub(crate) fn nappe(&self) -> Option<Span> {
        nappe(self.a, self.pair, self.growth, self.radius)
    }
}

/// The equation in twice the precision, rounded.
pub(crate) struct ExactSide {
    pub(crate) a: f64,
    pub(crate) h: f64,
    pub(crate) c: f64,
    pub(crate) e: f64,
    pub(crate) g: f64,
    pub(crate) pair: Option<(f64, f64)>,
    /// The signed radius at the middle of the crossings; no number where `a` is zero.
    pub(crate) middle: f64,
    pub(crate) spine: Spine,
    pub(crate) solution: Solution,
}

impl ExactSide {
    /// The interval of the line within one nappe.
    pub(crate) fn span(&self, caps: bool) -> Option<Span> {
        let &Self { a, h, c, e, g, pair, .. } = self;
        if a != 0.0 {
            return nappe(a, pair, g, self.middle);
        }
        let whole = (f64::NEG_INFINITY, f64::INFINITY);
        let (low, high) = if h != 0.0 {
            // Parallel to a generator: one crossing is at infinity.
            let (first, second) = pair?;
            let t = if first.is_finite() { first } else { second };
            match (h < 0.0, g > 0.0) {
                (true, true) => (t, whole.1),
                (false, false) if g < 0.0 => (whole.0, t),
                _ => return None,
            }
        } else if g == 0.0 {
            (c <= 0.0).then_some(whole)?
        } else {
            // Along a generator: the line is inside from the apex on, and misses an open surface.
            let apex = (caps && c <= 0.0).then_some(self.solution.start - e / g)?;
            if g > 0.0 { (apex, whole.1) } else { (whole.0, apex) }
        };
        Some([(low, LATERAL), (high, LATERAL)])
    }
}

/// The axis of a body in twice the precision.
pub(crate) struct Spine {
    /// The point of it that places are relative to: a pointed end, where there is one.
    pub(crate) base: DVec3,
    pub(crate) axis: [Twofold; 3],
    /// The square of its length.
    pub(crate) square: Twofold,
    /// What the radius grows by along it, and the radius at the base times the square.
    pub(crate) rise: Twofold,
    pub(crate) radius: Twofold,
}

impl Spine {
    /// The signed radius at a place relative to the base, times the square.
    fn radius_at(&self, p: [Twofold; 3]) -> Twofold {
        self.radius + self.growth(p)
    }

    /// What that grows by along `d`.
    fn growth(&self, d: [Twofold; 3]) -> Twofold {
        self.rise * dot(d, self.axis)
    }
}

impl Axial {
    pub(crate) fn is_whole(&self) -> bool {
        self.phi_max >= TAU
    }

    pub(crate) fn is_bounded(&self) -> bool {
        self.length.is_finite()
    }

    fn has_cap(&self, part: u32) -> bool {
        self.caps && if part == CAP1 { self.cut1 } else { part == CAP2 && self.cut2 }
    }

    fn cap(&self, part: u32) -> (DVec3, f64) {
        if part == CAP1 { (self.p1, self.r1) } else { (self.p2, self.r2) }
    }

    /// The equation of the lateral surface along `d` from a place `p` relative to p1.
    #[inline]
    pub(crate) fn equation(&self, p: DVec3, d: DVec3) -> Equation {
        let (across, offset) = (d.cross(self.axis), p.cross(self.axis));
        let (e, g) = (self.r1 + self.k * p.dot(self.axis), self.k * d.dot(self.axis));
        let a = across.length_squared() - g * g;
        let (h, c) = (across.dot(offset) - e * g, offset.length_squared() - e * e);
        Equation { a, h, c, e, g, across, offset }
    }

    /// The interval of the line within the lateral surface of one nappe, without cuts.
    ///
    /// The [`Equation`] is set up at the ray's origin if that is near, else about the middle of the crossings, where
    /// the discriminant keeps its digits for a thin cone far away; where they do not suffice, in twice the precision.
    #[inline]
    pub(crate) fn lateral_span(&self, ray: &Ray) -> Option<Span> {
        let (start, p, slack) = self.set_up(ray);
        let doubles = Doubles::new(self, ray.direction, p, length(slack));
        let decided = doubles.double_cone(start).map(|cone| cone.nappe());
        self.cut_at_apex(ray, decided.unwrap_or_else(|| self.exact_side(ray, start, p).span(self.caps))?)
    }

    /// Where the equation is set up: the parameter, the place there relative to p1, and how far that may be off, in
    /// units of the unit roundoff.
    #[inline(always)]
    pub(crate) fn set_up(&self, ray: &Ray) -> (f64, DVec3, DVec3) {
        let (w, d) = (ray.origin - self.p1, ray.direction);
        let Equation { a, h, c, .. } = self.equation(w, d);
        if is_nearby(a, h, c) {
            (0.0, w, w.abs())
        } else {
            place_near(ray.origin, self.p1, start(w, d, a, h), d)
        }
    }

    /// The equation of the lateral surface in twice the precision, or in doubles at the place `p` by `start` for want
    /// of that.
    #[cold]
    #[inline(never)]
    pub(crate) fn exact_side(&self, ray: &Ray, start: f64, p: DVec3) -> ExactSide {
        // Near a pointed end, where everything cancels, from the point nearest to that.
        let near_tip = self.r1 == 0.0 || self.r2 == 0.0;
        let from_tip = if near_tip { self.way_to_tip(ray) } else { start };
        let (spine, solution) = self.solution(ray, from_tip);
        let (radius, growth) = (spine.radius_at(solution.place), spine.growth(components(ray.direction)));
        if solution.is_finite {
            let [a, h, c, e, g] = [solution.a, solution.h, solution.c, radius, growth].map(|x| x.high);
            let middle = (radius - growth * (solution.h / solution.a)).high;
            let pair = solution.crossings;
            ExactSide { a, h, c, e, g, pair, middle, spine, solution }
        } else {
            let Equation { a, h, c, e, g, .. } = self.equation(p, ray.direction);
            let pair = quadratic(a, h, c, (h * h - a * c).max(0.0));
            let pair = pair.map(|(first, second)| (start + first, start + second));
            ExactSide { a, h, c, e, g, pair, middle: e - g * (h / a), spine, solution }
        }
    }

    /// The parameter of the point nearest to the pointed end.
    fn way_to_tip(&self, ray: &Ray) -> f64 {
        let tip = if self.r2 == 0.0 { self.p2 } else { self.p1 };
        (tip - ray.origin).dot(ray.direction) / ray.direction.length_squared()
    }

    /// The part of the interval on the body's side of a pointed end.
    #[inline]
    pub(crate) fn cut_at_apex(&self, ray: &Ray, [near, far]: Span) -> Option<Span> {
        let (apex, is_above) = match (self.r1 == 0.0, self.r2 == 0.0) {
            (true, _) => (self.p1, true),
            (_, true) => (self.p2, false),
            _ => return Some([near, far]),
        };
        let (t, along) = plane_crossing(ray, apex, self.axis);
        if along == 0.0 {
            return Some([near, far]);
        }
        let cut = |end: (f64, u32), low: f64, high: f64| (end.0.max(low).min(high), end.1);
        let (low, high) = if (along > 0.0) == is_above { (t, f64::INFINITY) } else { (f64::NEG_INFINITY, t) };
        Some([cut(near, low, high), cut(far, low, high)])
    }

    /// The axis in twice the precision: between the ends, where there are two.
    fn spine(&self) -> Spine {
        // Of about unit length, so that no product over- or underflows.
        let is_ordinary = 1e-20 < self.length && self.length < 1e20;
        let scale = if is_ordinary { 1.0 } else { (-self.length.logarithm_2().floor()).exponential_2() };
        if !self.has_ends {
            let axis = components(self.axis);
            let square = dot(axis, axis);
            let (rise, radius) = (Twofold::from(self.k) * square, Twofold::from(self.r1) * square);
            return Spine { base: self.p1, axis, square, rise, radius };
        }
        let scale = Twofold::from(scale);
        let axis = std::array::from_fn(|i| Twofold::difference(self.p2[i], self.p1[i]) * scale);
        let square = dot(axis, axis);
        let rise = Twofold::difference(self.r2, self.r1) * scale;
        let (base, radius) = if self.r2 == 0.0 { (self.p2, 0.0) } else { (self.p1, self.r1) };
        Spine { base, axis, square, rise, radius: Twofold::from(radius) * square }
    }

    /// The equation of the lateral surface, in twice the precision: F(t) times the fourth power of the spine's length.
    fn solution(&self, ray: &Ray, start: f64) -> (Spine, Solution) {
        let spine = self.spine();
        let solution = Solution::new(ray.origin, spine.base, ray.direction, start, |p, d| {
            let (across, offset) = (cross(d, spine.axis), cross(p, spine.axis));
            let (e, g) = (spine.radius_at(p), spine.growth(d));
            [
                spine.square * dot(across, across) - g * g,
                spine.square * dot(across, offset) - e * g,
                spine.square * dot(offset, offset) - e * e,
            ]
        });
        (spine, solution)
    }

    /// The interval of the line between the cutting planes.
    #[inline]
    pub(crate) fn slab_span(&self, ray: &Ray) -> Option<Span> {
        let mut span = [(f64::NEG_INFINITY, CAP1), (f64::INFINITY, CAP2)];
        let cuts = [(self.cut1, self.p1, CAP1), (self.cut2, self.p2, CAP2)];
        for (cut, point, part) in cuts {
            if !cut {
                continue;
            }
            let (t, along) = plane_crossing(ray, point, self.axis);
            if along == 0.0 {
                let z = (ray.origin - point).dot(self.axis);
                let is_between = if part == CAP1 { z >= 0.0 } else { z <= 0.0 };
                if !is_between {
                    return None;
                }
            } else if (along > 0.0) == (part == CAP1) {
                span[0] = (t, part);
            } else {
                span[1] = (t, part);
            }
        }
        Some(span)
    }

    #[inline]
    fn crossings(&self, ray: &Ray) -> [Option<Root>; 2] {
        let none = [None, None];
        let Some(side) = self.lateral_span(ray) else {
            return none;
        };
        let Some(slab) = self.slab_span(ray) else {
            return none;
        };
        let root = |(t, part): (f64, u32), multiplicity| {
            let hits = t.is_finite() && ray.contains(t) && (self.is_whole() || self.keeps(ray, t, part));
            hits.then_some(Root { part, multiplicity, ..Root::at(t) })
        };
        if self.caps {
            let near = if slab[0].0 > side[0].0 { slab[0] } else { side[0] };
            let far = if slab[1].0 < side[1].0 { slab[1] } else { side[1] };
            if near.0 < far.0 {
                [root(near, 1), root(far, 1)]
            } else if near.0 == far.0 {
                [root(near, 2), None]
            } else {
                none
            }
        } else {
            let between = |end: (f64, u32)| slab[0].0 <= end.0 && end.0 <= slab[1].0;
            let [near, far] = side;
            if near.0 == far.0 {
                [between(near).then(|| root(near, 2)).flatten(), None]
            } else {
                [near, far].map(|end| between(end).then(|| root(end, 1)).flatten())
            }
        }
    }

    /// Whether the point at `t` is within the sweep.
    pub(crate) fn keeps(&self, ray: &Ray, t: f64, part: u32) -> bool {
        let (_, arm) = self.arm(ray, t, part);
        self.phi(arm) <= self.phi_max
    }

    pub(crate) fn phi(&self, arm: DVec3) -> f64 {
        let (e1, e2) = orthonormal_basis(self.axis);
        azimuth(arm.dot(e2), arm.dot(e1))
    }

    /// The height above p1 of the point at `t`, and its offset from the axis.
    pub(crate) fn arm(&self, ray: &Ray, t: f64, part: u32) -> (f64, DVec3) {
        // Near a pointed end the offset is small compared with the distance from the other.
        let from_2 = part == CAP2 || self.r2 == 0.0;
        let base = if from_2 { self.p2 } else { self.p1 };
        let lift = if from_2 && part == LATERAL { self.length } else { 0.0 };
        let split = |w: DVec3| {
            let z = w.dot(self.axis);
            let arm = w - z * self.axis;
            // Twice: where the offset is small, the first is mostly rounding error.
            (z + lift, arm - arm.dot(self.axis) * self.axis)
        };
        let w = point(ray.origin, base, t, ray.direction);
        let (z, arm) = split(w);
        if part != LATERAL || !is_blurred(ray, t, length(arm)) {
            return (z, arm);
        }
        let start = -(ray.origin - base).dot(ray.direction) / ray.direction.length_squared();
        let (spine, solution) = self.solution(ray, start);
        let sharp = solution.point(t, ray.direction);
        sharp.map_or((z, arm), |w| split(w + (spine.base - base)))
    }

    two_crossings!(pub(crate));

    /// The surface at a crossing.
    pub(crate) fn surface(&self, ray: &Ray, root: &Root) -> Surface {
        let (z, arm) = self.arm(ray, root.t, root.part);
        let outward = unit(arm).unwrap_or_else(|| orthonormal_basis(self.axis).0);
        let u = (self.phi(arm) / self.phi_max).min(1.0);
        if root.part == LATERAL {
            let z = if self.is_bounded() { z.clamp(0.0, self.length) } else { z };
            let surface = self.on_side(z, outward, u);
            let ends = self.lateral_span(ray).map(|[near, far]| (near.0, far.0));
            Surface { normal: sided(surface.normal, ends, ray, root.t), ..surface }
        } else {
            let rho = length(arm);
            self.on_cap(root.part, rho, outward, u)
        }
    }

    /// The surface at `uv` of a part.
    pub(crate) fn surface_at(&self, part: u32, uv: DVec2) -> Option<Surface> {
        let (e1, e2) = orthonormal_basis(self.axis);
        let (sin, cos) = (uv.x * self.phi_max).sine_cosine();
        let outward = cos * e1 + sin * e2;
        if part == LATERAL {
            let z = if self.is_bounded() { uv.y * self.length } else { uv.y };
            Some(self.on_side(z, outward, uv.x))
        } else {
            let rho = uv.y * self.cap(part).1;
            self.has_cap(part).then(|| self.on_cap(part, rho, outward, uv.x))
        }
    }

    pub(crate) fn on_side(&self, z: f64, outward: DVec3, u: f64) -> Surface {
        let rho = (self.r1 + self.k * z).max(0.0);
        let slant = self.k.hypotenuse(1.0);
        let w = z * self.axis + rho * outward;
        let point = self.p1 + w;
        let rise = if self.is_bounded() { self.length } else { 1.0 };
        // The offset and the radius have the rounding error of the products that they come from.
        let error = gamma(10)
            * (cross_size(w, self.axis) + rho + (self.r1 + self.k.abs() * dot_size(w, self.axis)) / slant);
        let is_apex = rho == 0.0;
        let around = self.axis.cross(outward);
        Surface {
            point,
            point_error: DVec3::splat(error) + gamma(2) * (point.abs() + self.p1.abs() + w.abs()),
            normal: if is_apex {
                -self.axis * self.k.signum()
            } else {
                (outward - self.k * self.axis) / slant
            },
            uv: DVec2::new(u, if self.is_bounded() { z / self.length } else { z }),
            dpdu: self.phi_max * rho.max(1e-10 * self.r1.max(self.r2).min(1.0)) * around,
            dpdv: rise * (self.axis + self.k * outward),
            dndu: self.phi_max / slant * around,
            dndv: DVec3::ZERO,
        }
    }

    fn on_cap(&self, part: u32, rho: f64, outward: DVec3, u: f64) -> Surface {
        let (center, radius) = self.cap(part);
        let w = rho.min(radius) * outward;
        let point = center + w;
        Surface {
            point,
            point_error: DVec3::splat(gamma(8) * dot_size(w, self.axis))
                + gamma(2) * (point.abs() + center.abs() + w.abs()),
            normal: if part == CAP1 { -self.axis } else { self.axis },
            uv: DVec2::new(u, (rho / radius).min(1.0)),
            dpdu: self.phi_max * rho.max(1e-10 * radius) * self.axis.cross(outward),
            dpdv: radius * outward,
            dndu: DVec3::ZERO,
            dndv: DVec3::ZERO,
        }
    }

    /// The bounding box under a transform, tight for every sweep; `None` when infinite.
    pub(crate) fn bounds(&self, world_from_object: &Transform) -> Option<Aabb> {
        if !self.is_bounded() {
            return None;
        }
        let (e1, e2) = orthonormal_basis(self.axis);
        let has_wedges = self.has_cap(CAP1) || self.has_cap(CAP2);
        let support = |d: DVec3| {
            let end = |center: DVec3, radius: f64| {
                let reach = if self.is_whole() {
                    radius * d.cross(self.axis).length()
                } else {
                    let rim = radius * arc_support(d.dot(e1), d.dot(e2), 0.0, self.phi_max);
                    if has_wedges { rim.max(0.0) } else { rim }
                };
                d.dot(center) + reach
            };
            end(self.p1, self.r1).max(end(self.p2, self.r2))
        };
        let reach = DVec3::splat(self.r1.max(self.r2));
        let magnitude = self.p1.abs().max(self.p2.abs()) + reach;
        Some(bounds_from_support(world_from_object, magnitude, support))
    }

    /// The whole solid, with caps.
    pub(crate) fn bounding_volume(&self) -> Option<BoundingVolume> {
        if !self.is_bounded() {
            return None;
        }
        let (e1, e2) = orthonormal_basis(self.axis);
        let radius = self.r1.max(self.r2);
        let axes = DMat3::from_cols(radius * e1, radius * e2, 0.5 * self.length * self.axis);
        // The radius is middle + half z.
        let (middle, half) = (0.5 * (self.r1 + self.r2) / radius, 0.5 * (self.r2 - self.r1) / radius);
        let profile = [-half * half, -2.0 * middle * half, -middle * middle];
        Some(BoundingVolume::new(0.5 * (self.p1 + self.p2), axes, profile, self.is_solid()))
    }

    /// The areas of the lateral surface and the two caps; 0 for a missing cap.
    fn part_areas(&self) -> [f64; 3] {
        let cap = |part| {
            let radius = self.cap(part).1;
            if self.has_cap(part) { 0.5 * self.phi_max * radius * radius } else { 0.0 }
        };
        let slant = self.length.hypotenuse(self.r2 - self.r1);
        [0.5 * self.phi_max * (self.r1 + self.r2) * slant, cap(CAP1), cap(CAP2)]
    }

    /// The area; infinite for infinite bodies.
    pub(crate) fn area(&self) -> f64 {
        if self.is_bounded() { self.part_areas().iter().sum() } else { f64::INFINITY }
    }

    /// The area after a transform: a quadrature over the azimuth, since the integrand is linear along the axis.
    pub(crate) fn area_under(&self, world_from_object: &Transform) -> f64 {
        if !self.is_bounded() {
            return f64::INFINITY;
        }
        let stretch = measure::area_stretch(world_from_object);
        let (e1, e2) = orthonormal_basis(self.axis);
        let side = measure::integrate(0.0, self.phi_max, |phi| {
            let (sin, cos) = phi.sine_cosine();
            (stretch * (cos * e1 + sin * e2 - self.k * self.axis)).length()
        });
        let [_, cap1, cap2] = self.part_areas();
        0.5 * (self.r1 + self.r2) * self.length * side + (cap1 + cap2) * (stretch * self.axis).length()
    }

    /// Whether the sweep is complete and every cut is capped.
    pub(crate) fn is_solid(&self) -> bool {
        self.is_whole() && (self.caps || !(self.cut1 || self.cut2))
    }

    /// Whether the closed solid contains `p`.
    pub(crate) fn contains(&self, p: DVec3) -> bool {
        let w = p - self.p1;
        let radius = self.r1 + self.k * w.dot(self.axis);
        self.is_solid()
            && (!self.cut1 || w.dot(self.axis) >= 0.0)
            && (!self.cut2 || (p - self.p2).dot(self.axis) <= 0.0)
            && w.cross(self.axis).length() <= radius
    }

    /// The nearest point to `p` under a similarity.
    pub(crate) fn closest_point(
        &self,
        world_from_object: &Transform,
        p: DVec3,
    ) -> Result<NearestPoint, NearestPointError> {
        under_similarity(world_from_object, p, |p| {
            let (e1, e2) = orthonormal_basis(self.axis);
            let w = p - self.p1;
            let local = DVec3::new(w.dot(e1), w.dot(e2), w.dot(self.axis));
            let meridian = Meridian::new(local, self.phi_max);
            let outward = meridian.outward.x * e1 + meridian.outward.y * e2;
            let u = (meridian.phi / self.phi_max).min(1.0);
            // The profile is a segment, ray or line. Of a ray, p1 and p2 are both its end.
            let has_low_end = self.cut1 || self.k > 0.0 || self.is_bounded();
            let has_high_end = self.is_bounded() || self.cut2;
            let low = if has_low_end { 0.0 } else { f64::NEG_INFINITY };
            let high =
                if has_high_end { if self.is_bounded() { self.length } else { 0.0 } } else { f64::INFINITY };
            let foot = (meridian.z + self.k * (meridian.x - self.r1)) / (1.0 + self.k * self.k);
            let z = foot.clamp(low, high);
            let rho = (self.r1 + self.k * z).max(0.0);
            let side = NearestPoint {
                point: self.p1 + z * self.axis + rho * outward,
                distance: meridian.distance(rho, z),
                part: LATERAL,
                uv: DVec2::new(u, if self.is_bounded() { z / self.length } else { z }),
            };
            [CAP1, CAP2].into_iter().filter(|&part| self.has_cap(part)).fold(side, |best, part| {
                let (center, radius) = self.cap(part);
                let r = meridian.x.clamp(0.0, radius);
                let z = if part == CAP2 && self.is_bounded() { self.length } else { 0.0 };
                let uv = DVec2::new(u, r / radius);
                best.or_nearer(NearestPoint {
                    point: center + r * outward,
                    distance: meridian.distance(r, z),
                    part,
                    uv,
                })
            })
        })
    }

    /// A point uniform by area: first a part, then a point of it; `None` when infinite.
    pub(crate) fn sample_area(&self, u: DVec2) -> Option<SurfaceSample> {
        if !self.is_bounded() {
            return None;
        }
        let (part, left) = density::choose(&self.part_areas(), u.x);
        let part = part as u32;
        let v = if part == LATERAL {
            let (r1, r2) = (self.r1, self.r2);
            let rho = ((1.0 - left) * r1 * r1 + left * r2 * r2).sqrt();
            // From the apex on, the fraction is √ξ, where the general form is 0/0.
            if rho + r1 > 0.0 { (left * (r1 + r2) / (rho + r1)).min(1.0) } else { 0.0 }
        } else {
            left.sqrt()
        };
        let surface = self.surface_at(part, DVec2::new(u.y, v))?;
        Some(SurfaceSample { surface, pdf: 1.0 / self.area() })
    }

    sampled_by_area!(pub(crate));
}

/// The methods of a shape that wraps an [`Axial`] in its field `body`.
macro_rules! axial_shape {
    ($shape:ident, $name:literal) => {
        impl $shape {
            /// The part with azimuth up to `phimax` degrees, caps included.
            ///
            /// # Errors
            /// [`ShapeError`] when `phimax` is not in (0, 360].
            pub fn partial(self, phimax: f64) -> Result<Self, ShapeError> {
                Ok(Self { body: Axial { phi_max: check::sweep(phimax)?, ..self.body } })
            }

            /// The first crossing in the ray's range.
            #[inline]
            pub fn closest(&self, ray: &Ray) -> Option<Root> {
                self.body.closest(ray)
            }

            /// Every crossing in the ray's range, appended in ascending order.
            pub fn roots(&self, ray: &Ray, out: &mut Roots) {
                self.body.roots(ray, out);
            }

            pub(crate) fn explained(&self, ray: &Ray, notes: &mut crate::explain::Notes) {
                self.body.explained(ray, notes);
            }

            /// The surface at a crossing.
            pub fn surface(&self, ray: &Ray, root: &Root) -> Surface {
                self.body.surface(ray, root)
            }

            /// The surface at `uv` of a part: 0 lateral, 1 and 2 the caps; `None` for a missing cap.
            pub fn surface_at(&self, part: u32, uv: DVec2) -> Option<Surface> {
                self.body.surface_at(part, uv)
            }

            /// The bounding box under a transform, tight for every sweep; `None` when infinite.
            pub fn bounds(&self, world_from_object: &Transform) -> Option<Aabb> {
                self.body.bounds(world_from_object)
            }

            /// A bounding volume: the whole solid, with caps; `None` when infinite.
            pub fn bounding_volume(&self) -> Option<BoundingVolume> {
                self.body.bounding_volume()
            }

            /// The area, caps included; may be infinite.
            pub fn area(&self) -> f64 {
                self.body.area()
            }

            /// The area after a transform, by quadrature over the azimuth.
            pub fn area_under(&self, world_from_object: &Transform) -> f64 {
                self.body.area_under(world_from_object)
            }

            /// Whether the sweep is complete and every cut is capped.
            pub fn is_solid(&self) -> bool {
                self.body.is_solid()
            }

            /// Whether the closed solid contains `p`; false when open.
            pub fn contains(&self, p: DVec3) -> bool {
                self.body.contains(p)
            }

            /// The nearest point to `p` under a similarity.
            ///
            /// # Errors
            /// [`NearestPointError::Map`] for other maps.
            pub fn closest_point(
                &self,
                world_from_object: &Transform,
                p: DVec3,
            ) -> Result<NearestPoint, NearestPointError> {
                self.body.closest_point(world_from_object, p)
            }

            #[doc = concat!("\"", $name, "\".")]
            pub fn name(&self) -> &'static str {
                $name
            }

            /// A point uniform by area; `None` when infinite.
            pub fn sample_area(&self, u: DVec2) -> Option<SurfaceSample> {
                self.body.sample_area(u)
            }

            /// A point uniform by area, as seen from `from`; `None` when it is seen edge-on, or the shape is infinite.
            pub fn sample_direction(&self, from: DVec3, u: DVec2) -> Option<DirectionSample> {
                self.body.sample_direction(from, u)
            }

            /// The density with which `sample_direction` chooses the point `surface` on the ray; 0 when infinite.
            pub fn pdf_direction(&self, ray: &Ray, surface: &Surface) -> f64 {
                self.body.pdf_direction(ray, surface)
            }
        }
    };
}
pub(crate) use axial_shape;
