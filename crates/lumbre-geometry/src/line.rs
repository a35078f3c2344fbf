//! A ray's line relative to a nearby origin, and implicit surfaces.

use lumbre_math::DVec3;
use lumbre_math::rounding::gamma;

use crate::{Ray, Root};

/// A ray's line with its origin moved to the point nearest to `place`: the points `p + s d`, at t = shift + s.
///
/// Coefficients computed from it do not grow with the distance of the ray's origin, so a discriminant keeps its
/// digits.
pub(crate) struct NearLine {
    pub(crate) p: DVec3,
    pub(crate) d: DVec3,
    pub(crate) shift: f64,
}

impl NearLine {
    #[inline]
    pub(crate) fn new(ray: &Ray, place: DVec3) -> Self {
        let d = ray.direction;
        let dd = d.length_squared();
        let w = ray.origin - place;
        let first = -w.dot(d) / dd;
        let near = w + first * d;
        let second = -near.dot(d) / dd;
        Self { p: place + (near + second * d), d, shift: first + second }
    }

    pub(crate) fn at(&self, s: f64) -> DVec3 {
        self.p + s * self.d
    }

    pub(crate) fn at_t(&self, t: f64) -> DVec3 {
        self.at(t - self.shift)
    }

    /// The roots of a quadratic in `s` that lie in the ray's range and whose points `keeps` accepts, in order.
    #[inline]
    pub(crate) fn accepted(
        &self,
        ray: &Ray,
        pair: Option<(f64, f64)>,
        keeps: impl Fn(DVec3) -> bool,
    ) -> impl Iterator<Item = Root> {
        let (first, second) = pair.unwrap_or((f64::NAN, f64::NAN));
        let touches = first == second;
        let root = |s: f64, multiplicity: u8| {
            let t = self.shift + s;
            // An infinite root is one that the quadratic does not have.
            let counts = t.is_finite() && ray.contains(t) && keeps(self.at(s));
            counts.then_some(Root { multiplicity, ..Root::at(t) })
        };
        let near = root(first, if touches { 2 } else { 1 });
        let far = if touches { None } else { root(second, 1) };
        near.into_iter().chain(far)
    }
}

/// An implicit function F at a point: its value and derivatives.
pub(crate) struct Implicit {
    pub(crate) value: f64,
    pub(crate) gradient: DVec3,
    /// The sum of the absolute values of F's terms, which bounds the rounding error of `value`.
    pub(crate) terms: f64,
}

impl Implicit {
    /// The step to the surface: one of Newton's method, whose remaining error is the square of a rounding
    /// error.
    pub(crate) fn to_surface(&self) -> DVec3 {
        let step = -self.value / self.gradient.length_squared() * self.gradient;
        if step.is_finite() { step } else { DVec3::ZERO }
    }

    /// A bound on the distance from the surface of a point where F evaluates to 0.
    pub(crate) fn uncertainty(&self) -> f64 {
        let distance = gamma(12) * self.terms / self.gradient.length();
        // At a singular point there is no useful bound.
        if distance.is_finite() { distance } else { 0.0 }
    }

    /// The derivative of the unit normal gradient/|gradient| along a tangent, given the Hessian's product with
    /// the tangent.
    pub(crate) fn turning(&self, hessian_times_tangent: DVec3) -> DVec3 {
        let length = self.gradient.length();
        let normal = self.gradient / length;
        let across = (hessian_times_tangent - normal * normal.dot(hessian_times_tangent)) / length;
        // Orthogonalised twice: where the derivative is small, the first result is mostly rounding error.
        let turned = across - normal * normal.dot(across);
        if turned.is_finite() { turned } else { DVec3::ZERO }
    }

    /// The unit normal; z where the gradient is zero.
    pub(crate) fn normal(&self) -> DVec3 {
        self.gradient.try_normalize().unwrap_or(DVec3::Z)
    }
}
