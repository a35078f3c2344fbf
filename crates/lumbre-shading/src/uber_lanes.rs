//! [`crate::uber`] over lanes.

use std::f32::consts::FRAC_1_PI;

use lumbre_simd::{Mask, Real, V3};

use crate::conductor::{mirrored, reflect};
use crate::dielectric::refract;
use crate::diffuse::{cosine_direction, has_side};
use crate::fresnel;
use crate::lanes::{LaneBsdf, LaneSample, colour, field};
use crate::microfacet::FacetLanes;

/// [`crate::uber::Uber`] over lanes.
#[derive(Clone, Copy, Debug)]
pub struct UberLanes<R: Real> {
    /// Albedo of the Lambertian lobe.
    pub diffuse: V3<R>,
    /// A factor on the facets.
    pub glossy: V3<R>,
    /// A factor on the mirror.
    pub mirror: V3<R>,
    /// A factor on what is refracted.
    pub refracted: V3<R>,
    /// What goes straight on.
    pub passed: V3<R>,
    /// Index of refraction, inside over outside.
    pub eta: R,
    /// The facets; not smooth.
    pub facets: FacetLanes<R>,
}

// The lobes, in the order in which they are sampled.
const DIFFUSE: usize = 0;
const GLOSSY: usize = 1;
pub(crate) const MIRROR: usize = 2;
pub(crate) const REFRACTED: usize = 3;
pub(crate) const PASSED: usize = 4;

/// The least Fresnel reflectance by which facets are sampled: some of them are met at grazing angles.
const MIN_GLOSSY: f32 = 0.1;

impl<R: Real> UberLanes<R> {
    /// The probability of each lobe, about in proportion to its power; all 0 where nothing scatters.
    #[inline(always)]
    fn probabilities(&self, wo: V3<R>) -> [R; 5] {
        let reflected = fresnel::dielectric(wo.z, self.eta);
        let powers = [
            self.diffuse.max_component(),
            self.glossy.max_component() * reflected.simd_max(R::splat(MIN_GLOSSY)),
            self.mirror.max_component() * reflected,
            self.refracted.max_component() * (R::one() - reflected),
            self.passed.max_component(),
        ];
        let [a, b, c, d, e] = powers;
        let sum = a + b + c + d + e;
        let scatters = sum.simd_gt(R::zero());
        let mut shares = powers;
        for share in &mut shares {
            *share = (*share / sum).or_zero(scatters);
        }
        shares
    }

    /// f · |cos θi| without delta parts, and the density of both lobes with these probabilities.
    #[inline(always)]
    fn eval_with(&self, wo: V3<R>, wi: V3<R>, diffuse: R, glossy: R) -> (V3<R>, R) {
        let fits = (wo.z * wi.z).simd_gt(R::zero());
        let half = wo + wi;
        let has_half = half.length_squared().simd_gt(R::zero());
        let m = half.normalize();
        let m = V3::select(m.z.simd_lt(R::zero()), -m, m);
        let cosine = R::splat(FRAC_1_PI) * wi.z.abs();
        let density = (R::splat(0.25) * self.facets.density(m)).or_zero(has_half);
        let reflected = fresnel::dielectric(wo.dot(m), self.eta);
        let both = self.facets.both_visible_per_cosines(wo, wi);
        let facets = (reflected * density * both * wi.z.abs()).or_zero(has_half);
        let value = self.diffuse * cosine + self.glossy * facets;
        let pdf = diffuse * cosine + glossy * (density * self.facets.visible_per_cosine(wo));
        (value.or_zero(fits), pdf.or_zero(fits))
    }

    /// The direction, own weight and η of one of the delta parts, and where it is not black.
    #[inline(always)]
    pub(crate) fn delta(&self, wo: V3<R>, lobe: usize) -> (V3<R>, V3<R>, R, R::Mask) {
        let reflected = fresnel::dielectric(wo.z, self.eta);
        let across = R::select(wo.z.simd_gt(R::zero()), self.eta, self.eta.recip());
        let (wi, weight, eta, exists) = match lobe {
            MIRROR => (mirrored(wo), self.mirror * reflected, R::one(), R::Mask::splat(true)),
            REFRACTED => {
                let (wi, exists) = refract(wo, V3::constant([0.0, 0.0, 1.0]), across);
                // Radiance is scaled by η², as by glass.
                (wi, self.refracted * ((R::one() - reflected) / (across * across)), across, exists)
            }
            _ => (-wo, self.passed, R::one(), R::Mask::splat(true)),
        };
        (wi, weight, eta, exists & weight.max_component().simd_gt(R::zero()))
    }
}

impl<R: Real> LaneBsdf<R> for UberLanes<R> {
    const ROW: usize = 18;

    #[inline(always)]
    fn load(table: &[f32], at: R::UInt) -> Self {
        Self {
            diffuse: colour(table, at, 0),
            glossy: colour(table, at, 3),
            mirror: colour(table, at, 6),
            refracted: colour(table, at, 9),
            passed: colour(table, at, 12),
            eta: field(table, at, 15),
            facets: FacetLanes { alpha_x: field(table, at, 16), alpha_y: field(table, at, 17) },
        }
    }

    #[inline(always)]
    fn eval(&self, wo: V3<R>, wi: V3<R>) -> (V3<R>, R) {
        let probabilities = self.probabilities(wo);
        self.eval_with(wo, wi, probabilities[DIFFUSE], probabilities[GLOSSY])
    }

    #[inline(always)]
    fn sample(&self, wo: V3<R>, lobe: R, u: [R; 2]) -> LaneSample<R> {
        let probabilities = self.probabilities(wo);
        let none = R::Mask::splat(false);
        // By rounding the probabilities may sum to less than `lobe`: then it is the last one that exists.
        let mut chosen = [none; 5];
        let (mut rest, mut found, mut after) = (lobe, none, none);
        for i in 0..5 {
            chosen[i] = !found & rest.simd_lt(probabilities[i]);
            found = found | chosen[i];
            rest = rest - probabilities[i];
        }
        for i in (0..5).rev() {
            let is_last = !found & !after & probabilities[i].simd_gt(R::zero());
            chosen[i] = chosen[i] | is_last;
            after = after | is_last;
        }
        let exists = has_side(wo) & (found | after);

        let facet = self.facets.sample_visible(wo, u);
        let mut wi = V3::select(chosen[GLOSSY], reflect(wo, facet), cosine_direction(u, wo.z));
        let (value, pdf) = self.eval_with(wo, wi, probabilities[DIFFUSE], probabilities[GLOSSY]);
        let mut sample = LaneSample {
            wi,
            weight: value / pdf,
            pdf,
            valid: exists & pdf.simd_gt(R::zero()) & pdf.is_finite(),
            delta: none,
            transmitted: none,
            eta: R::one(),
        };
        for part in [MIRROR, REFRACTED, PASSED] {
            let is_it = chosen[part];
            if is_it.none() {
                continue;
            }
            let (direction, weight, eta, is_there) = self.delta(wo, part);
            wi = V3::select(is_it, direction, wi);
            let weight = weight * probabilities[part].recip();
            sample.weight = V3::select(is_it, weight, sample.weight);
            sample.pdf = R::select(is_it, R::one(), sample.pdf);
            sample.valid = (sample.valid & !is_it) | (is_it & exists & is_there);
            sample.delta = sample.delta | is_it;
            sample.transmitted = sample.transmitted | (is_it & R::Mask::splat(part != MIRROR));
            sample.eta = R::select(is_it, eta, sample.eta);
        }
        LaneSample { wi, ..sample }
    }

    #[inline(always)]
    fn is_delta(&self) -> R::Mask {
        self.diffuse.max_component().simd_eq(R::zero()) & self.glossy.max_component().simd_eq(R::zero())
    }

    #[inline(always)]
    fn regularized(self, mask: R::Mask) -> Self {
        Self { facets: self.facets.regularized(mask), ..self }
    }
}
