//! Lines moved near the shape that they are tested against, and what surfaces given by an equation share.

use lumbre_math::DVec3;
use lumbre_math::rounding::gamma;

use crate::{Ray, Root};

/// A ray's line, from where it is nearest to a place: the points `p + s d`, at t = shift + s.
///
/// Coefficients formed here are as small as the shape, however far away the ray began, so that a discriminant keeps its
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

/// Normals of the surface F = 0 at a point, from F's derivatives there.
pub(crate) struct Implicit {
    pub(crate) value: f64,
    pub(crate) gradient: DVec3,
    /// The sum of the sizes of F's terms, of which `value` is what is left.
    pub(crate) terms: f64,
}

impl Implicit {
    /// The way to the surface: one step of Newton's, which squares an error that is rounding already.
    pub(crate) fn to_surface(&self) -> DVec3 {
        let step = -self.value / self.gradient.length_squared() * self.gradient;
        if step.is_finite() { step } else { DVec3::ZERO }
    }

    /// How far off the surface a point can be for which F came out as 0.
    pub(crate) fn uncertainty(&self) -> f64 {
        let distance = gamma(12) * self.terms / self.gradient.length();
        // At a singular point the surface is known to half the digits only, in units of nothing; say nothing then.
        if distance.is_finite() { distance } else { 0.0 }
    }

    /// The derivative of the unit normal gradient/|gradient| along a tangent, given the Hessian's product with it.
    pub(crate) fn turning(&self, hessian_times_tangent: DVec3) -> DVec3 {
        let length = self.gradient.length();
        let normal = self.gradient / length;
        let across = (hessian_times_tangent - normal * normal.dot(hessian_times_tangent)) / length;
        // Once more: where the normal hardly turns, what is left is rounding.
        let turned = across - normal * normal.dot(across);
        if turned.is_finite() { turned } else { DVec3::ZERO }
    }

    /// The unit normal; z where there is none.
    pub(crate) fn normal(&self) -> DVec3 {
        self.gradient.try_normalize().unwrap_or(DVec3::Z)
    }
}
