//! What a sample of light is in lanes, and what it lights.

use lumbre_simd::{Double, Mask, Real, UInt, V3};

/// Light that arrives at a point in each lane, from a sampled direction. Undefined unless `valid`.
#[derive(Clone, Copy, Debug)]
pub struct LaneLightSample<R: Real> {
    /// Unit, towards the light.
    pub towards: V3<R>,
    /// The end of the shadow segment, unless the light is at infinity.
    pub point: V3<R::Double>,
    /// An error bound of each component of the point.
    pub error: V3<R::Double>,
    /// The unit normal there, on the emissive side; zero without a surface.
    pub normal: V3<R>,
    /// Whether it is at infinity.
    pub infinite: R::Mask,
    /// The radiance that arrives if unoccluded. For a delta light, the irradiance on a surface that faces it, divided
    /// by the probability of the choice.
    pub radiance: V3<R>,
    /// How the direction was chosen, per unit solid angle, with the probability of the choice.
    pub pdf: R,
    /// Whether the light is a delta light, which has no density.
    pub delta: R::Mask,
    /// Whether any light arrives.
    pub valid: R::Mask,
    /// The sampled light: see [`super::LaneLights::light_of`].
    pub source: R::UInt,
}

/// The lit point in each lane.
#[derive(Clone, Copy, Debug)]
pub struct Receiver<R: Real> {
    /// The point.
    pub from: V3<R::Double>,
    /// The unit geometric normal on the viewer's side; zero if light from every side counts: for a transmissive
    /// surface, and in a medium.
    pub normal: V3<R>,
    /// The time; `None` if nothing moves.
    pub time: Option<R::Double>,
}

impl<R: Real> LaneLightSample<R> {
    #[inline(always)]
    pub(super) fn none() -> Self {
        let (zero, nowhere) = (V3::splat(R::zero()), V3::splat(R::Double::splat(0.0)));
        let none = R::Mask::splat(false);
        Self {
            towards: zero,
            point: nowhere,
            error: nowhere,
            normal: zero,
            infinite: none,
            radiance: zero,
            pdf: R::zero(),
            delta: none,
            valid: none,
            source: R::UInt::splat(0),
        }
    }

    /// A light's `other` in some lanes, with directions more likely by this factor.
    #[inline(always)]
    pub(super) fn with(self, mask: R::Mask, other: Self, probability: R, source: R::UInt) -> Self {
        let radiance = V3::select(other.delta, other.radiance * probability.recip(), other.radiance);
        Self {
            towards: V3::select(mask, other.towards, self.towards),
            point: V3::select_f64(mask, other.point, self.point),
            error: V3::select_f64(mask, other.error, self.error),
            normal: V3::select(mask, other.normal, self.normal),
            infinite: (mask & other.infinite) | (!mask & self.infinite),
            radiance: V3::select(mask, radiance, self.radiance),
            pdf: R::select(mask, other.pdf * probability, self.pdf),
            delta: (mask & other.delta) | (!mask & self.delta),
            valid: (mask & other.valid) | (!mask & self.valid),
            source: R::UInt::select(mask, source, self.source),
        }
    }
}

/// The largest number below 1.
#[inline(always)]
pub(super) fn below_one<R: Real>() -> R {
    R::splat(1.0 - 0.5 * f32::EPSILON)
}
