//! Hair and fur: a fibre of tinted glass with scales, as a whole.

use std::f32::consts::{FRAC_PI_8, PI, TAU};
use std::sync::Arc;

use lumbre_math::{Elementary, Vec2};
use lumbre_simd::math::{atan2, exp, ln, sin_cos_turns};
use lumbre_simd::{Mask, Real, V3};

use crate::diffuse::has_side;
use crate::lanes::{LaneBsdf, LaneSample, Row, colour, colour_lane, field, spectrum, square};
use crate::material::{albedo, index};
use crate::{BsdfSample, FloatTexture, LocalDir, Spectrum, SpectrumTexture, TextureContext, fresnel};

/// What colours a fibre.
#[derive(Clone, Debug)]
pub enum HairColour {
    /// The absorption, per radius of the fibre.
    Absorption(Arc<SpectrumTexture>),
    /// The colour of a mass of hair: see [`absorption_of_colour`].
    Reflectance(Arc<SpectrumTexture>),
    /// Concentrations of pigments: see [`absorption_of_melanin`].
    Melanin {
        /// The brown to black one.
        eumelanin: Arc<FloatTexture>,
        /// The red one.
        pheomelanin: Arc<FloatTexture>,
    },
}

/// The parameters of `hair`, by their names in pbrt-v4.
#[derive(Clone, Debug)]
pub struct HairParams {
    /// What colours it.
    pub colour: HairColour,
    /// Index of refraction.
    pub eta: Arc<FloatTexture>,
    /// Roughness along the fibre, in [0.01, 1].
    pub beta_m: Arc<FloatTexture>,
    /// Roughness around it, in [0.01, 1].
    pub beta_n: Arc<FloatTexture>,
    /// By how many degrees the scales are tilted.
    pub alpha: Arc<FloatTexture>,
}

impl HairParams {
    /// The BSDF at a position: across the fibre, v goes from one side to the other.
    pub(crate) fn bsdf(&self, at: &TextureContext) -> Hair {
        let beta_n = roughness(self.beta_n.evaluate(at));
        let absorption = match &self.colour {
            HairColour::Absorption(absorption) => absorption.evaluate_unbounded(at),
            HairColour::Reflectance(colour) => absorption_of_colour(colour.evaluate(at), beta_n),
            HairColour::Melanin { eumelanin, pheomelanin } => {
                at.coefficient(absorption_of_melanin(eumelanin.evaluate(at), pheomelanin.evaluate(at)))
            }
        };
        Hair::new(
            absorption,
            2.0 * at.uv.y - 1.0,
            self.eta.evaluate(at),
            self.beta_m.evaluate(at),
            beta_n,
            self.alpha.evaluate(at),
        )
    }
}

/// The absorption by concentrations of eumelanin and pheomelanin, which are 0 or more: 8 of the first is black hair,
/// 1.3 brown, 0.3 blond.
///
/// Source: E. d'Eon, G. Francois, M. Hill, J. Letteri, J.-M. Aubry, "An Energy-Conserving Hair Reflectance Model",
/// EGSR 2011.
pub fn absorption_of_melanin(eumelanin: f32, pheomelanin: f32) -> Spectrum {
    Spectrum::new(0.419, 0.697, 1.37) * eumelanin.max(0.0)
        + Spectrum::new(0.187, 0.4, 1.05) * pheomelanin.max(0.0)
}

/// The absorption of fibres of a roughness whose mass has about this colour. Channels are in [0.0001, 1], since no
/// absorption makes hair black.
///
/// Source: M. J.-Y. Chiang, B. Bitterli, C. Tappan, B. Burley, "A Practical and Controllable Hair and Fur Model for
/// Production Path Tracing", Computer Graphics Forum 35(2), 2016.
pub fn absorption_of_colour(colour: Spectrum, beta_n: f32) -> Spectrum {
    let b = roughness(beta_n);
    let scale = 5.969 + b * (-0.215 + b * (2.532 + b * (-10.73 + b * (5.574 + b * 0.245))));
    albedo(colour).map(|c| {
        let root = c.max(1e-4).logarithm() / scale;
        root * root
    })
}

fn roughness(beta: f32) -> f32 {
    // NaN is the least.
    if beta.is_nan() { 0.01 } else { beta.clamp(0.01, 1.0) }
}

/// A fibre, at one place across it: a rough dielectric cylinder that absorbs, with tilted scales. Light is reflected
/// (R), goes through (TT), is reflected once inside (TRT), or more often; each of these is a lobe around a cone about
/// the fibre.
///
/// The x axis of its frame is along the fibre. What comes in and what leaves may have any direction: that light goes in
/// at one place and comes out at another is part of it, so it stands on the surface of a curve as a whole.
///
/// All light that is not absorbed leaves if the scales are not tilted; else near to all. It is not reciprocal: the tilt
/// and the attenuation are those of `wo`.
///
/// Sources: M. J.-Y. Chiang, B. Bitterli, C. Tappan, B. Burley, "A Practical and Controllable Hair and Fur Model for
/// Production Path Tracing", Computer Graphics Forum 35(2), 2016, in the form of M. Pharr, W. Jakob, G. Humphreys,
/// "Physically Based Rendering", 4th edition, 2023, section 9.9; E. d'Eon and others, "An Energy-Conserving Hair
/// Reflectance Model", EGSR 2011; S. R. Marschner, H. W. Jensen, M. Cammarano, S. Worley, P. Hanrahan, "Light
/// Scattering from Human Hair Fibers", SIGGRAPH 2003. There, Bessel's function is approximated such that up to 0.35 %
/// of the light is lost; here it is not.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hair {
    /// The absorption, per radius.
    pub absorption: Spectrum,
    /// Where across the fibre, in [-1, 1]: as far along the frame's y axis as seen from the front.
    pub h: f32,
    /// Index of refraction.
    pub eta: f32,
    /// The variance of the first lobe along the fibre.
    variance: f32,
    /// The scale of the logistic distribution around it.
    scale: f32,
    /// Of the tilt.
    sine: f32,
}

impl Hair {
    /// By absorption, place, index of refraction, the roughness along and around the fibre, both clamped to [0.01, 1],
    /// and the tilt of the scales in degrees.
    pub fn new(absorption: Spectrum, h: f32, eta: f32, beta_m: f32, beta_n: f32, alpha: f32) -> Self {
        let (m, n) = (roughness(beta_m), roughness(beta_n));
        // By powers that are the same on all machines.
        let to = |x: f32, steps: u32| (0..steps).fold(x, |x, _| x * x);
        let (m20, n22) = (to(m, 4) * to(m, 2), to(n, 4) * to(n, 2) * to(n, 1));
        let width = 0.726 * m + 0.812 * m * m + 3.7 * m20;
        let alpha = if alpha.is_finite() { alpha } else { 0.0 };
        Self {
            absorption: absorption.map(|a| a.max(0.0)),
            // NaN is the middle.
            h: if h.is_nan() { 0.0 } else { h.clamp(-1.0, 1.0) },
            eta: index(eta),
            variance: width * width,
            scale: FRAC_PI_8.sqrt() * (0.265 * n + 1.194 * n * n + 5.372 * n22),
            sine: alpha.to_radians().sine(),
        }
    }

    /// f · |cos θi|.
    pub fn eval(&self, wo: LocalDir, wi: LocalDir) -> Spectrum {
        spectrum(self.lane().eval(wo.lane(), wi.lane()).0)
    }

    /// The density of [`Hair::sample`].
    pub fn pdf(&self, wo: LocalDir, wi: LocalDir) -> f32 {
        self.lane().eval(wo.lane(), wi.lane()).1
    }

    /// A direction of one of the lobes.
    pub fn sample(&self, wo: LocalDir, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        self.lane().sample(wo.lane(), lobe, square(u)).scalar()
    }

    /// The share of the light that leaves in all directions, if it comes at right angles to the fibre.
    pub(crate) fn albedo_estimate(&self) -> Spectrum {
        let [a, b, c, d] = self.lane().attenuations(0.0, 1.0);
        spectrum(a + b + c + d)
    }

    fn lane(&self) -> HairLanes<f32> {
        HairLanes {
            absorption: colour_lane(self.absorption),
            h: self.h,
            eta: self.eta,
            variance: self.variance,
            scale: self.scale,
            sine: self.sine,
        }
    }

    pub(crate) fn row(&self) -> Row {
        let [r, g, b] = self.absorption.to_array();
        Row::from_slice(&[r, g, b, self.h, self.eta, self.variance, self.scale, self.sine])
    }
}

/// [`Hair`] over lanes.
#[derive(Clone, Copy, Debug)]
pub struct HairLanes<R: Real> {
    absorption: V3<R>,
    h: R,
    eta: R,
    variance: R,
    scale: R,
    sine: R,
}

/// How often light goes through the fibre in its lobes; the last is all that is left.
const LOBES: usize = 4;

/// A direction by its angles about a fibre.
#[derive(Clone, Copy)]
struct Angles<R: Real> {
    /// To the plane across the fibre.
    sine: R,
    cosine: R,
    /// Around it.
    phi: R,
}

impl<R: Real> Angles<R> {
    #[inline(always)]
    fn of(w: V3<R>) -> Self {
        let cosine = (w.y * w.y + w.z * w.z).sqrt();
        Self { sine: w.x, cosine, phi: atan2(w.z, w.y) }
    }
}

/// What is the same for all directions of incidence.
#[derive(Clone, Copy)]
struct Fibre<R: Real> {
    wo: Angles<R>,
    attenuations: [V3<R>; LOBES],
    /// Their shares in the sampling.
    shares: [R; LOBES],
    gamma_o: R,
    gamma_t: R,
}

impl<R: Real> HairLanes<R> {
    /// What is left of light in each lobe, by the angle to the plane across the fibre.
    #[inline(always)]
    fn attenuations(&self, sine: R, cosine: R) -> [V3<R>; LOBES] {
        let one = R::one();
        let (_, cos_gamma_t) = self.refracted(sine, cosine);
        let sin_theta_t = sine / self.eta;
        let cos_theta_t = (one - sin_theta_t * sin_theta_t).simd_max(R::splat(1e-6)).sqrt();
        let length = R::splat(2.0) * cos_gamma_t / cos_theta_t;
        let t = V3::new(
            exp(-self.absorption.x * length),
            exp(-self.absorption.y * length),
            exp(-self.absorption.z * length),
        );
        let cos_gamma_o = (one - self.h * self.h).simd_max(R::zero()).sqrt();
        // Less than 1, where the rest of the series would be 0/0.
        let f = fresnel::dielectric(cosine * cos_gamma_o, self.eta).simd_min(R::splat(0.999_999));
        let first = V3::splat(f);
        let second = t * ((one - f) * (one - f));
        let third = t * second * f;
        let left = V3::splat(one) - t * f;
        let rest = t * third * f;
        [first, second, third, V3::new(rest.x / left.x, rest.y / left.y, rest.z / left.z)]
    }

    /// Sine and cosine of the angle of refraction across the fibre.
    #[inline(always)]
    fn refracted(&self, sine: R, cosine: R) -> (R, R) {
        let eta = (self.eta * self.eta - sine * sine).simd_max(R::splat(1e-6)).sqrt();
        // h over Bravais' index, which is infinite along the fibre.
        let sin_gamma_t = (self.h * cosine / eta).simd_max(R::splat(-1.0)).simd_min(R::one());
        (sin_gamma_t, (R::one() - sin_gamma_t * sin_gamma_t).simd_max(R::zero()).sqrt())
    }

    #[inline(always)]
    fn fibre(&self, wo: V3<R>) -> Fibre<R> {
        let wo = Angles::of(wo);
        let attenuations = self.attenuations(wo.sine, wo.cosine);
        let [a, b, c, d] = attenuations;
        let (a, b, c, d) = (a.x + a.y + a.z, b.x + b.y + b.z, c.x + c.y + c.z, d.x + d.y + d.z);
        let scale = (a + b + c + d).recip();
        let (sin_gamma_t, cos_gamma_t) = self.refracted(wo.sine, wo.cosine);
        let cos_gamma_o = (R::one() - self.h * self.h).simd_max(R::zero()).sqrt();
        Fibre {
            wo,
            attenuations,
            shares: [a * scale, b * scale, c * scale, d * scale],
            gamma_o: atan2(self.h, cos_gamma_o),
            gamma_t: atan2(sin_gamma_t, cos_gamma_t),
        }
    }

    /// Sine and cosine of the viewer's angle as the scales tilt it: −2α, α and 4α.
    #[inline(always)]
    fn tilted(&self, wo: Angles<R>) -> [(R, R); LOBES] {
        let (s1, c1) = (self.sine, (R::one() - self.sine * self.sine).sqrt());
        let (s2, c2) = (R::splat(2.0) * s1 * c1, c1 * c1 - s1 * s1);
        let (s4, c4) = (R::splat(2.0) * s2 * c2, c2 * c2 - s2 * s2);
        let (sine, cosine) = (wo.sine, wo.cosine);
        [
            (sine * c2 - cosine * s2, (cosine * c2 + sine * s2).abs()),
            (sine * c1 + cosine * s1, (cosine * c1 - sine * s1).abs()),
            (sine * c4 + cosine * s4, (cosine * c4 - sine * s4).abs()),
            (sine, cosine),
        ]
    }

    #[inline(always)]
    fn variances(&self) -> [R; LOBES] {
        let wide = R::splat(4.0) * self.variance;
        [self.variance, R::splat(0.25) * self.variance, wide, wide]
    }

    /// How far around the fibre a lobe leads.
    #[inline(always)]
    fn turn(fibre: &Fibre<R>, lobe: usize) -> R {
        let passes = R::splat(2.0 * lobe as f32);
        passes * fibre.gamma_t - R::splat(2.0) * fibre.gamma_o + R::splat(lobe as f32 * PI)
    }

    #[inline(always)]
    fn value(&self, fibre: &Fibre<R>, wi: V3<R>) -> (V3<R>, R) {
        let wi = Angles::of(wi);
        let (tilted, variances) = (self.tilted(fibre.wo), self.variances());
        let (mut f, mut pdf) = (V3::splat(R::zero()), R::zero());
        let mut lobe = 0;
        while lobe < LOBES {
            let (sine, cosine) = tilted[lobe];
            let mut both = along([wi.sine, wi.cosine], [sine, cosine], variances[lobe]);
            if lobe < LOBES - 1 {
                let away = wrapped(wi.phi - fibre.wo.phi - Self::turn(fibre, lobe));
                both = both * logistic(away, self.scale);
            } else {
                both = both * R::splat(1.0 / TAU);
            }
            f = f + fibre.attenuations[lobe] * both;
            pdf = pdf + fibre.shares[lobe] * both;
            lobe += 1;
        }
        (f, pdf)
    }
}

/// An angle as one in [−π, π].
#[inline(always)]
fn wrapped<R: Real>(angle: R) -> R {
    angle - R::splat(TAU) * (angle * R::splat(1.0 / TAU)).round_ties_even()
}

/// e^−x I₀(x) of x ≥ 0: to 3e-7.
///
/// Source: M. Abramowitz, I. A. Stegun, "Handbook of Mathematical Functions", 1964, 9.8.1 and 9.8.2.
#[inline(always)]
fn bessel<R: Real>(x: R) -> R {
    let is_small = x.simd_lt(R::splat(3.75));
    let near = x * R::splat(1.0 / 3.75);
    let near = near * near;
    let c = [1.0, 3.515_622_9, 3.089_942_4, 1.206_749_2, 0.265_973_2, 0.036_076_8, 0.004_581_3];
    let mut small = R::splat(c[6]);
    let mut i = 6;
    while i > 0 {
        i -= 1;
        small = small * near + R::splat(c[i]);
    }
    let far = R::splat(3.75) / x.simd_max(R::splat(3.75));
    let c = [
        0.398_942_28,
        0.013_285_92,
        0.002_253_19,
        -0.001_575_65,
        0.009_162_81,
        -0.020_577_06,
        0.026_355_37,
        -0.016_476_33,
        0.003_923_77,
    ];
    let mut large = R::splat(c[8]);
    let mut i = 8;
    while i > 0 {
        i -= 1;
        large = large * far + R::splat(c[i]);
    }
    R::select(is_small, small * exp(-x), large / x.simd_max(R::splat(3.75)).sqrt())
}

/// The density along the fibre, by sines and cosines of both angles.
///
/// exp(−sᵢ sₒ / v) I₀(cᵢ cₒ / v) / (2 v sinh(1/v)), with the exponents joined: cᵢ cₒ − sᵢ sₒ − 1 is half of a square of
/// a length.
#[inline(always)]
fn along<R: Real>([sin_i, cos_i]: [R; 2], [sin_o, cos_o]: [R; 2], v: R) -> R {
    let (x, y) = (cos_i - cos_o, sin_i + sin_o);
    let exponent = R::splat(-0.5) * (x * x + y * y) / v;
    let norm = v * (R::one() - exp(R::splat(-2.0) / v));
    exp(exponent) * bessel(cos_i * cos_o / v) / norm
}

/// The logistic distribution on [−π, π].
#[inline(always)]
fn logistic<R: Real>(x: R, scale: R) -> R {
    let e = exp(-x.abs() / scale);
    let whole = R::one() + e;
    e / (scale * whole * whole * within(scale))
}

/// The probability of the logistic distribution in [−π, π].
#[inline(always)]
fn within<R: Real>(scale: R) -> R {
    let e = exp(R::splat(-PI) / scale);
    (R::one() - e) / (R::one() + e)
}

impl<R: Real> LaneBsdf<R> for HairLanes<R> {
    const ROW: usize = 8;

    #[inline(always)]
    fn load(table: &[f32], at: R::UInt) -> Self {
        Self {
            absorption: colour(table, at, 0),
            h: field(table, at, 3),
            eta: field(table, at, 4),
            variance: field(table, at, 5),
            scale: field(table, at, 6),
            sine: field(table, at, 7),
        }
    }

    #[inline(always)]
    fn eval(&self, wo: V3<R>, wi: V3<R>) -> (V3<R>, R) {
        let (f, pdf) = self.value(&self.fibre(wo), wi);
        let is_known = pdf.is_finite() & R::zero().simd_lt(pdf);
        (f.or_zero(is_known), pdf.or_zero(is_known))
    }

    #[inline(always)]
    fn sample(&self, wo: V3<R>, lobe: R, u: [R; 2]) -> LaneSample<R> {
        let fibre = self.fibre(wo);
        let (tilted, variances) = (self.tilted(fibre.wo), self.variances());
        let one = R::one();
        // The last lobe, unless an earlier one is found; and what is left of the number that chose it.
        let mut start = one - fibre.shares[LOBES - 1];
        let mut share = fibre.shares[LOBES - 1];
        let (mut sin_o, mut cos_o) = tilted[LOBES - 1];
        let mut v = variances[LOBES - 1];
        let mut turn = R::zero();
        let mut is_last = R::Mask::splat(true);
        let mut p = LOBES - 1;
        let before = [
            R::zero(),
            fibre.shares[0],
            fibre.shares[0] + fibre.shares[1],
            fibre.shares[0] + fibre.shares[1] + fibre.shares[2],
        ];
        while p > 0 {
            p -= 1;
            let is_this = lobe.simd_lt(before[p + 1]);
            start = R::select(is_this, before[p], start);
            share = R::select(is_this, fibre.shares[p], share);
            sin_o = R::select(is_this, tilted[p].0, sin_o);
            cos_o = R::select(is_this, tilted[p].1, cos_o);
            v = R::select(is_this, variances[p], v);
            turn = R::select(is_this, Self::turn(&fibre, p), turn);
            is_last = is_last & !is_this;
        }
        let third = ((lobe - start) / share).simd_max(R::zero()).simd_min(one);
        // 1 less the cosine of the angle to the tilted direction's mirror image.
        let w = one - u[0];
        let away = -v * ln(w + u[0] * exp(R::splat(-2.0) / v));
        let away = away.simd_max(R::zero()).simd_min(R::splat(2.0));
        let (_, cos_around) = sin_cos_turns(third);
        let sine = (away * (R::splat(2.0) - away)).sqrt();
        let sin_i = (away - one) * sin_o + sine * cos_around * cos_o;
        let sin_i = sin_i.simd_max(R::splat(-1.0)).simd_min(one);
        let cos_i = (one - sin_i * sin_i).simd_max(R::zero()).sqrt();
        // Both halves by the smaller tail, which keeps its digits.
        let least = one / (one + exp(R::splat(PI) / self.scale));
        let half = (u[1] - R::splat(0.5)).abs();
        let tail = R::splat(0.5) - half * within(self.scale);
        let tail = tail.simd_max(least).simd_max(R::splat(f32::MIN_POSITIVE));
        let reach = self.scale * ln((one - tail) / tail);
        let reach = reach.simd_max(R::zero()).simd_min(R::splat(PI)).copysign(u[1] - R::splat(0.5));
        let around = R::select(is_last, R::splat(TAU) * u[1], turn + reach);
        let (sin_phi, cos_phi) = sin_cos_turns((fibre.wo.phi + around) * R::splat(1.0 / TAU));
        let wi = V3::new(sin_i, cos_i * cos_phi, cos_i * sin_phi);
        let (f, pdf) = self.value(&fibre, wi);
        LaneSample {
            wi,
            weight: f / pdf,
            pdf,
            valid: has_side(wo) & pdf.is_finite() & R::zero().simd_lt(pdf),
            delta: R::Mask::splat(false),
            transmitted: (wo.z * wi.z).simd_lt(R::zero()),
            eta: one,
        }
    }

    #[inline(always)]
    fn is_delta(&self) -> R::Mask {
        R::Mask::splat(false)
    }

    #[inline(always)]
    fn regularized(self, _: R::Mask) -> Self {
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumbre_math::Vec3;

    #[test]
    fn what_is_left_of_light_is_what_the_series_gives() {
        // Computed in double precision: index 1.55, absorption 0.3, 0.8 and 1.6, by degrees and h.
        for (degrees, h, expected) in [
            (0.0_f32, 0.0, [0.55853, 0.23181, 0.083649]),
            (0.0, 0.5, [0.57599, 0.24953, 0.092065]),
            (0.0, 0.9, [0.63336, 0.33911, 0.18007]),
            (30.0, 0.0, [0.54141, 0.21676, 0.079016]),
            (30.0, 0.5, [0.55713, 0.2337, 0.08917]),
            (30.0, 0.9, [0.61387, 0.33197, 0.19594]),
            (70.0, 0.0, [0.52543, 0.27211, 0.19203]),
            (70.0, 0.5, [0.54189, 0.30588, 0.23179]),
            (70.0, 0.9, [0.63493, 0.49399, 0.45377]),
        ] {
            let hair = Hair::new(Spectrum::new(0.3, 0.8, 1.6), h, 1.55, 0.35, 0.4, 2.0);
            let (sine, cosine) = degrees.to_radians().sin_cos();
            let [a, b, c, d] = hair.lane().attenuations(sine, cosine);
            let sum = spectrum(a + b + c + d).to_array();
            for (sum, expected) in sum.into_iter().zip(expected) {
                assert!((sum / expected - 1.0).abs() < 1e-4, "{degrees} {h}: {sum} {expected}");
            }
        }
    }

    #[test]
    fn values_are_those_of_the_published_model() {
        // With an approximate Bessel function, which loses up to 0.35 %.
        for (wo, wi, h, expected) in [
            (
                Vec3::new(0.30943, 0.20628, 0.92828),
                Vec3::new(std::f32::consts::FRAC_1_SQRT_2, 0.0, std::f32::consts::FRAC_1_SQRT_2),
                -0.2169,
                [0.0031606, 0.001553, 0.0014176],
            ),
            (
                Vec3::new(-0.61885, 0.30943, 0.72199),
                Vec3::new(-0.50252, 0.50252, -0.70353),
                -0.3939,
                [1.5445e-5, 6.4838e-7, 1.8639e-7],
            ),
            (
                Vec3::new(0.10099, -0.10099, 0.98975),
                Vec3::new(0.20628, 0.30943, -0.92828),
                0.1015,
                [0.13463, 0.04952, 0.033194],
            ),
        ] {
            let hair = Hair::new(Spectrum::new(0.3, 0.8, 1.0), h, 1.55, 0.35, 0.4, 2.0);
            let value = hair.eval(LocalDir(wo.normalize()), LocalDir(wi.normalize())).to_array();
            for (value, expected) in value.into_iter().zip(expected) {
                assert!((value / expected - 1.0).abs() < 5e-3, "{wo} {wi}: {value} {expected}");
            }
        }
    }

    #[test]
    fn the_bessel_function_is_that_of_the_tables() {
        for (x, expected) in [
            (0.0_f32, 1.0_f32),
            (1.0, 0.465_759_6),
            (3.0, 0.243_000_4),
            (4.0, 0.207_001_9),
            (10.0, 0.127_833_3),
            (1000.0, 0.012_617_24),
        ] {
            assert!((bessel(x) / expected - 1.0).abs() < 1e-5, "{x}: {}", bessel(x));
        }
    }

    #[test]
    fn colours_and_pigments_become_absorption() {
        let blond = absorption_of_melanin(0.3, 0.5);
        assert!((blond.r - (0.3 * 0.419 + 0.5 * 0.187)).abs() < 1e-6);
        let same = absorption_of_colour(Spectrum::new(1.0, 0.5, 0.0), 0.3);
        assert!(same.r == 0.0 && same.b.is_finite() && same.b > same.g);
        // ln 0.5 over 5.969 − 0.0645 + 0.22788 − 0.28971 + 0.0451494 + 0.00059535.
        assert!((same.g - (0.5f32.ln() / 5.888_411).powi(2)).abs() < 1e-5, "{}", same.g);
    }

    #[test]
    fn light_from_the_side_shines_on_that_side() {
        // A mirror of a fibre, seen from +z with light from +y: its highlight is at h = sin 45°.
        let brightest = (-9..=9)
            .map(|i| {
                let hair = Hair::new(Spectrum::splat(50.0), i as f32 / 10.0, 1.55, 0.3, 0.1, 0.0);
                (i, hair.eval(LocalDir(Vec3::Z), LocalDir(Vec3::Y)).r)
            })
            .max_by(|a, b| a.1.total_cmp(&b.1));
        assert!(brightest.is_some_and(|(i, _)| (6..=8).contains(&i)), "{brightest:?}");
    }
}
