//! pbrt-v3's `uber`, and with it `plastic`: lobes side by side, each with a weight of its own.

use std::sync::Arc;

use lumbre_math::{Elementary, Vec2};

use crate::lanes::{LaneBsdf, Row, colour_lane, spectrum, square, vector};
use crate::material::{Roughness, albedo, index};
use crate::microfacet::Microfacets;
use crate::specular::Specular;
use crate::uber_lanes::{MIRROR, PASSED, REFRACTED, UberLanes};
use crate::{
    BsdfSample, FloatTexture, LocalDir, Scatter, Spectrum, SpectrumTexture, TextureContext, fresnel,
};

/// The parameters of `uber`, by their names in pbrt-v3.
#[derive(Clone, Debug)]
pub struct UberParams {
    /// Kd: albedo of the Lambertian lobe.
    pub kd: Arc<SpectrumTexture>,
    /// Ks: a factor on the Fresnel reflectance of the facets.
    pub ks: Arc<SpectrumTexture>,
    /// Kr: a factor on that of a mirror.
    pub kr: Arc<SpectrumTexture>,
    /// Kt: a factor on what smooth refraction transmits.
    pub kt: Arc<SpectrumTexture>,
    /// A factor on all of these; the rest of the light goes straight on.
    pub opacity: Arc<SpectrumTexture>,
    /// Index of refraction, inside over outside.
    pub eta: Arc<FloatTexture>,
    /// Roughness of the facets; its remapping is [`remapped_roughness`].
    pub roughness: Roughness,
}

impl UberParams {
    /// Whether it is known to be uniform.
    pub(crate) fn is_uniform(&self) -> bool {
        let colours = [&self.kd, &self.ks, &self.kr, &self.kt, &self.opacity];
        let numbers = [&self.eta, &self.roughness.u, &self.roughness.v];
        colours.iter().all(|colour| colour.is_constant()) && numbers.iter().all(|number| number.is_constant())
    }

    /// Whether light may pass to the other side.
    pub(crate) fn is_transmissive(&self) -> bool {
        !is_everywhere(&self.kt, Spectrum::BLACK) || self.has_delta_transmission()
    }

    /// Whether it may have a mirror or smooth refraction anywhere.
    pub(crate) fn may_be_specular(&self) -> bool {
        !is_everywhere(&self.kr, Spectrum::BLACK) || self.is_transmissive()
    }

    /// Whether light may pass to the other side unbent.
    pub(crate) fn has_delta_transmission(&self) -> bool {
        let may_be_one = match *self.eta {
            FloatTexture::Constant(eta) => index(eta) == 1.0,
            _ => true,
        };
        !is_everywhere(&self.opacity, Spectrum::WHITE)
            || (may_be_one && !is_everywhere(&self.kt, Spectrum::BLACK))
    }

    /// The BSDF at a position.
    pub(crate) fn bsdf(&self, at: &TextureContext) -> Uber {
        let opacity = albedo(self.opacity.evaluate(at));
        let part = |colour: &SpectrumTexture| opacity * albedo(colour.evaluate(at));
        let alpha = |texture: &FloatTexture| {
            let roughness = texture.evaluate(at);
            let alpha = if self.roughness.remap { remapped_roughness(roughness) } else { roughness };
            // Never a mirror, which is what Kr is for.
            alpha.max(Microfacets::SMOOTH_BELOW)
        };
        Uber {
            diffuse: part(&self.kd),
            glossy: part(&self.ks),
            mirror: part(&self.kr),
            refracted: part(&self.kt),
            passed: Spectrum::WHITE - opacity,
            eta: index(self.eta.evaluate(at)),
            facets: Microfacets::new(alpha(&self.roughness.u), alpha(&self.roughness.v)),
        }
    }
}

/// Whether a texture is known to be this colour everywhere.
fn is_everywhere(texture: &SpectrumTexture, colour: Spectrum) -> bool {
    matches!(texture, SpectrumTexture::Constant(found) if albedo(*found) == colour)
}

/// α by a roughness of pbrt-v3, in [0, 1], with `remaproughness`. pbrt-v4 has the square root in its place, which is
/// smaller: 0.32 in place of 0.46 for a roughness of 0.1. Source: the polynomial in ln r of pbrt-v3's manual of its
/// file format.
pub fn remapped_roughness(roughness: f32) -> f32 {
    let x = roughness.max(1e-3).logarithm();
    (((0.000_640_711 * x + 0.017_120_1) * x + 0.173_4) * x + 0.819_955) * x + 1.621_42
}

/// A sum of lobes that know nothing of each other, the same from both sides but for the index: Lambert, dielectric
/// facets that only reflect, a mirror and a refraction by the same index, and light that goes straight on.
///
/// What the parameters give in sum may be more than what arrives, as in pbrt-v3: white Kd with white Ks makes light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Uber {
    /// Albedo of the Lambertian lobe, in [0, 1], as all colours here.
    pub diffuse: Spectrum,
    /// A factor on the facets.
    pub glossy: Spectrum,
    /// A factor on the mirror.
    pub mirror: Spectrum,
    /// A factor on what is refracted.
    pub refracted: Spectrum,
    /// What goes straight on.
    pub passed: Spectrum,
    /// Index of refraction, inside over outside; positive.
    pub eta: f32,
    /// The facets; not smooth.
    pub facets: Microfacets,
}

impl Uber {
    /// With each colour as a function of itself.
    #[must_use]
    pub(crate) fn with_colours(self, of: impl Fn(Spectrum) -> Spectrum) -> Self {
        Self {
            diffuse: of(self.diffuse),
            glossy: of(self.glossy),
            mirror: of(self.mirror),
            refracted: of(self.refracted),
            passed: of(self.passed),
            ..self
        }
    }

    /// f · |cos θi|, without the delta parts.
    pub fn eval(&self, wo: LocalDir, wi: LocalDir) -> Spectrum {
        spectrum(self.lane().eval(wo.lane(), wi.lane()).0)
    }

    /// The density of [`Uber::sample`].
    pub fn pdf(&self, wo: LocalDir, wi: LocalDir) -> f32 {
        self.lane().eval(wo.lane(), wi.lane()).1
    }

    /// A direction of one of the lobes.
    pub fn sample(&self, wo: LocalDir, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        self.lane().sample(wo.lane(), lobe, square(u)).scalar()
    }

    /// Its mirror, its refraction, and what goes straight on.
    pub(crate) fn specular(&self, wo: LocalDir) -> Specular {
        if wo.cos_theta() == 0.0 || wo.cos_theta().is_nan() {
            return Specular::new();
        }
        let part = |lobe| {
            let (wi, weight, eta, is_there) = self.lane().delta(wo.lane(), lobe);
            is_there.then(|| BsdfSample {
                wi: LocalDir(vector(wi)),
                weight: spectrum(weight),
                scatter: Scatter::Delta,
                transmitted: lobe != MIRROR,
                eta,
            })
        };
        [MIRROR, REFRACTED, PASSED].into_iter().filter_map(part).collect()
    }

    /// Whether it is made of delta parts alone.
    pub fn is_delta(&self) -> bool {
        self.lane().is_delta()
    }

    fn lane(&self) -> UberLanes<f32> {
        UberLanes {
            diffuse: colour_lane(self.diffuse),
            glossy: colour_lane(self.glossy),
            mirror: colour_lane(self.mirror),
            refracted: colour_lane(self.refracted),
            passed: colour_lane(self.passed),
            eta: self.eta,
            facets: self.facets.lane(),
        }
    }

    /// The row that [`UberLanes`] loads.
    pub(crate) fn row(&self) -> Row {
        let colours = [self.diffuse, self.glossy, self.mirror, self.refracted, self.passed];
        let alpha = self.facets.alpha();
        colours.into_iter().flat_map(Spectrum::to_array).chain([self.eta, alpha.x, alpha.y]).collect()
    }

    /// An estimate of its albedo: what it gives head on, at most 1.
    pub(crate) fn albedo_estimate(&self) -> Spectrum {
        let reflected = fresnel::dielectric(1.0, self.eta);
        let sum = self.diffuse
            + (self.glossy + self.mirror) * reflected
            + self.refracted * (1.0 - reflected)
            + self.passed;
        albedo(sum)
    }
}

#[cfg(test)]
mod tests {
    use lumbre_math::Vec3;

    use super::*;

    const WHITE_DIFFUSE: Uber = Uber {
        diffuse: Spectrum::WHITE,
        glossy: Spectrum::BLACK,
        mirror: Spectrum::BLACK,
        refracted: Spectrum::BLACK,
        passed: Spectrum::BLACK,
        eta: 1.5,
        facets: Microfacets::ROUGH,
    };

    fn from(x: f32, z: f32) -> LocalDir {
        LocalDir(Vec3::new(x, -0.3, z).normalize())
    }

    fn parts(params: &UberParams) -> Uber {
        let at = TextureContext {
            point: lumbre_math::DVec3::new(2.0, -1.0, 3.0),
            normal: Vec3::Z,
            uv: Vec2::new(0.25, 0.75),
            dpdx: Vec3::ZERO,
            dpdy: Vec3::ZERO,
            duv_dx: Vec2::ZERO,
            duv_dy: Vec2::ZERO,
            vertex: crate::VertexData::NONE,
            spectral: None,
        };
        params.bsdf(&at)
    }

    fn params() -> UberParams {
        let grey = |c: f32| Arc::new(SpectrumTexture::Constant(Spectrum::splat(c)));
        UberParams {
            kd: grey(0.25),
            ks: grey(0.25),
            kr: grey(0.0),
            kt: grey(0.0),
            opacity: grey(1.0),
            eta: Arc::new(FloatTexture::Constant(1.5)),
            roughness: Roughness::isotropic(0.1, true),
        }
    }

    #[test]
    fn a_mirror_of_kr_has_the_fresnel_reflectance_of_its_index() {
        let kr = Spectrum::new(0.9, 0.5, 0.2);
        let bsdf = Uber { diffuse: Spectrum::BLACK, mirror: kr, eta: 1.7, ..WHITE_DIFFUSE };
        let head_on = LocalDir(Vec3::Z);
        // ((η − 1) / (η + 1))².
        let expected = kr * (0.7_f32 / 2.7).powi(2);
        let sample = bsdf.sample(head_on, 0.5, Vec2::ZERO).expect("a mirror");
        assert!(sample.wi == head_on && sample.scatter == Scatter::Delta && !sample.transmitted);
        let error = (sample.weight - expected).map(f32::abs).max_component();
        assert!(error < 1e-6, "{:?}", sample.weight);
        // At Brewster's angle what is reflected is polarised across, by cos²(2 θ) / 2.
        let brewster = 1.7_f32.atan();
        let wo = LocalDir(Vec3::new(brewster.sin(), 0.0, brewster.cos()));
        let expected = kr * (0.5 * (2.0 * brewster).cos().powi(2));
        let found = bsdf.specular(wo)[0].weight;
        assert!((found - expected).map(f32::abs).max_component() < 1e-6, "{found:?} {expected:?}");
        assert!(bsdf.is_delta());
    }

    #[test]
    fn what_opacity_leaves_goes_straight_on_in_its_colour() {
        let opacity = Spectrum::new(0.75, 0.5, 0.0);
        let opaque = parts(&params());
        let clear = parts(&UberParams { opacity: Arc::new(SpectrumTexture::Constant(opacity)), ..params() });
        for (wo, wi) in [(from(0.4, 0.8), from(-0.2, 0.5)), (from(0.4, -0.8), from(-0.6, -0.3))] {
            let straight = clear.specular(wo);
            assert_eq!(straight.len(), 1);
            assert_eq!((straight[0].wi, straight[0].weight), (-wo, Spectrum::WHITE - opacity));
            assert!(straight[0].transmitted && straight[0].eta == 1.0);
            let error = (clear.eval(wo, wi) - opacity * opaque.eval(wo, wi)).map(f32::abs).max_component();
            assert!(error < 1e-6 && !opaque.eval(wo, wi).is_black());
        }
        assert!(opaque.specular(from(0.4, 0.8)).is_empty());
    }

    #[test]
    fn kr_and_kt_of_one_are_smooth_glass() {
        let bsdf = Uber {
            diffuse: Spectrum::BLACK,
            mirror: Spectrum::WHITE,
            refracted: Spectrum::WHITE,
            ..WHITE_DIFFUSE
        };
        let glass =
            crate::Bsdf::Dielectric(crate::dielectric::Dielectric { eta: 1.5, facets: Microfacets::SMOOTH });
        for wo in [from(0.4, 0.8), from(0.4, -0.8), from(2.0, -0.4)] {
            let expected: Vec<BsdfSample> = glass.specular(wo).collect();
            let found = bsdf.specular(wo);
            assert_eq!(found.len(), expected.len());
            for (found, expected) in found.iter().zip(&expected) {
                assert_eq!(
                    (found.wi, found.transmitted, found.eta),
                    (expected.wi, expected.transmitted, expected.eta)
                );
                assert!((found.weight - expected.weight).map(f32::abs).max_component() < 1e-6);
            }
        }
    }

    #[test]
    fn roughness_is_remapped_as_pbrt_v3_does() {
        // By hand: ln 0.1 = −2.302585, and so on.
        for (roughness, alpha) in [(1.0, 1.621_42), (0.1, 0.461_8), (0.001, 0.047_2), (0.0, 0.047_2)] {
            let found = remapped_roughness(roughness);
            assert!((found - alpha).abs() < 2e-4, "{roughness}: {found}");
        }
        let rough =
            |value, remap| parts(&UberParams { roughness: Roughness::isotropic(value, remap), ..params() });
        assert_eq!(rough(0.3, false).facets.alpha(), Vec2::splat(0.3));
        assert!(!rough(0.0, false).facets.is_smooth());
    }
}
