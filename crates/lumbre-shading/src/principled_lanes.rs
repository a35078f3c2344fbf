//! [`crate::principled`] over lanes. What no lane has costs nothing: it is left out by a branch.

use std::f32::consts::FRAC_1_PI;

use lumbre_simd::math::{exp, sin_cos_turns};
use lumbre_simd::{Mask, Real, Task, V3};

use crate::albedo::{ALBEDO, MAX_ETA, unit};
use crate::conductor::{mirrored, reflect};
use crate::dielectric::{DielectricLanes, Ways, refract};
use crate::diffuse::{cosine_direction, has_side};
use crate::fresnel;
use crate::lanes::{LaneBsdf, LaneSample, colour, field};
use crate::microfacet::{FacetLanes, Microfacets};
use crate::principled::{Clearcoat, Principled};
use crate::sheen::SheenLanes;
use crate::stretched::{STRETCHED, Stretched};
use crate::thin_film::ThinFilmLanes;

/// [`Principled`] over lanes.
#[derive(Clone, Copy, Debug)]
pub struct PrincipledLanes<R: Real> {
    /// Reflectance of the metal at normal incidence, and of the Lambertian base of the opaque dielectric.
    pub base: V3<R>,
    /// The share of metal.
    pub metallic: R,
    /// The roughness of the base.
    pub facets: FacetLanes<R>,
    /// The x axis of the facets in the shading frame: cosine and sine of its angle with the tangent.
    pub tangent: [R; 2],
    /// Index of the dielectrics, inside over outside.
    pub eta: R,
    /// What the dielectrics reflect at normal incidence.
    pub f0: V3<R>,
    /// What the dielectrics reflect at grazing incidence.
    pub f90: R,
    /// The clear share of the dielectric.
    pub transmission: R,
    /// A factor on transmission through the clear dielectric.
    pub transmission_color: V3<R>,
    /// Whether the clear dielectric is a thin pane.
    pub thin: R::Mask,
    /// Half of the difference of η between blue and red; 0 for a thin pane.
    pub spread: R,
    /// The share of the Lambertian light of the opaque dielectric that is transmitted.
    pub diffuse_transmission: R,
    /// A factor on that.
    pub diffuse_transmission_color: V3<R>,
    /// A thin film on the base.
    pub film: ThinFilmLanes<R>,
    /// Fibres above the film.
    pub sheen: SheenLanes<R>,
    /// The topmost layer.
    pub coat: ClearcoatLanes<R>,
}

/// [`Clearcoat`] over lanes.
#[derive(Clone, Copy, Debug)]
pub struct ClearcoatLanes<R: Real> {
    /// The share of the surface that it covers.
    pub weight: R,
    /// α of its roughness.
    pub alpha: R,
    /// Its normal in the shading frame.
    pub normal: V3<R>,
    /// Its index of refraction.
    pub eta: R,
    /// The exponent of absorption along its normal, one way.
    pub absorption: V3<R>,
    /// A factor on the base where the coat covers it.
    pub darkened: V3<R>,
}

impl<R: Real> ClearcoatLanes<R> {
    #[inline(always)]
    pub(crate) fn face(&self) -> DielectricLanes<R> {
        let facets = FacetLanes::new(self.alpha, self.alpha);
        DielectricLanes { eta: self.eta, facets }
    }

    #[inline(always)]
    fn exists(&self) -> R::Mask {
        self.weight.simd_gt(R::zero())
    }

    /// Where the normal is another than the shading normal.
    #[inline(always)]
    fn leans(&self) -> R::Mask {
        let n = self.normal;
        n.x.simd_ne(R::zero()) | n.y.simd_ne(R::zero()) | n.z.simd_ne(R::one())
    }

    /// The rotation in a plane through the normal that takes the coat's normal to z: a half-turn about the bisector,
    /// then one about z; their product fixes the axis.
    #[inline(always)]
    fn local(&self, w: V3<R>) -> V3<R> {
        V3::select(self.leans(), about_z(self.about_bisector(w)), w)
    }

    /// The inverse of that rotation.
    #[inline(always)]
    fn back(&self, w: V3<R>) -> V3<R> {
        V3::select(self.leans(), self.about_bisector(about_z(w)), w)
    }

    #[inline(always)]
    fn about_bisector(&self, w: V3<R>) -> V3<R> {
        let bisector = self.normal + V3::constant([0.0, 0.0, 1.0]);
        bisector * (R::splat(2.0) * bisector.dot(w) / bisector.length_squared()) - w
    }

    /// The attenuation of the layers below along one direction.
    #[inline(always)]
    pub(crate) fn share(&self, w: V3<R>) -> R {
        let exists = self.exists();
        if exists.none() {
            return R::zero();
        }
        let face = ALBEDO.face(self.local(w).z.abs(), self.alpha, self.eta);
        (self.weight * face).or_zero(exists)
    }

    /// How far light along a direction goes through the coat, in thicknesses.
    #[inline(always)]
    fn way(&self, w: V3<R>) -> R {
        let z = self.local(w).z;
        let sine2 = (R::one() - z * z) / (self.eta * self.eta);
        (R::one() - sine2).simd_max(R::splat(1e-4)).sqrt().recip()
    }

    /// What the face reflects between two directions on the side that it is on, and the density of its samples. Where
    /// the coat leans, some of its reflections are below the surface and are mirrored back up: both ways count.
    #[inline(always)]
    fn eval(&self, wo: V3<R>, wi: V3<R>) -> (R, R) {
        let o = self.local(wo);
        let is_met = (wo.z * wi.z).simd_gt(R::zero()) & (wo.z * o.z).simd_gt(R::zero());
        let (value, pdf) = self.eval_one(wo, o, wi, is_met);
        let folds = is_met & self.leans();
        if folds.none() {
            return (value, pdf);
        }
        let (folded, folded_pdf) = self.eval_one(wo, o, flipped(wi), folds);
        (value + folded, pdf + folded_pdf)
    }

    #[inline(always)]
    fn eval_one(&self, wo: V3<R>, o: V3<R>, wi: V3<R>, is_met: R::Mask) -> (R, R) {
        let i = self.local(wi);
        let is_below = wo.z.simd_lt(R::zero());
        let (above_o, above_i) = (V3::select(is_below, -o, o), V3::select(is_below, -i, i));
        let fits = is_met & (o.z * i.z).simd_gt(R::zero());
        let face = self.face();
        let (value, _) = face.eval(above_o, above_i);
        (value.x.or_zero(fits), face.pdf_of(above_o, above_i, Ways::Reflection).or_zero(fits))
    }
}

#[inline(always)]
fn about_z<R: Real>(w: V3<R>) -> V3<R> {
    V3::new(-w.x, -w.y, w.z)
}

/// The probabilities of the lobes; they sum to 1.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lobes<R: Real> {
    pub(crate) coat: R,
    pub(crate) facets: R,
    /// Cosine-weighted, on the side of `wo`.
    near: R,
    /// Cosine-weighted, on the other side.
    far: R,
}

/// The power reflected and transmitted by a facet; the rest is lost, or reaches the base of the opaque
/// dielectric.
pub(crate) struct Shares<R: Real> {
    reflects: V3<R>,
    transmits: V3<R>,
}

impl<R: Real> Shares<R> {
    /// The probability that a sample is a reflection.
    #[inline(always)]
    pub(crate) fn reflection_probability(&self) -> R {
        let (r, t) = (self.reflects.max_component(), self.transmits.max_component());
        R::select(t.simd_gt(R::zero()), r / (r + t), R::one())
    }
}

/// A direction sampled from the facets.
struct FacetSample<R: Real> {
    wi: V3<R>,
    valid: R::Mask,
    delta: R::Mask,
    /// The weight of a delta.
    weight: V3<R>,
    transmits: R::Mask,
    /// η of the other side over that of this side.
    eta: R,
}

impl<R: Real> PrincipledLanes<R> {
    // Layers.

    /// Whether transmission refracts.
    #[inline(always)]
    fn is_solid(&self) -> R::Mask {
        self.transmission.simd_gt(R::zero()) & !self.thin
    }

    /// Whether the layers are on the side of a direction.
    #[inline(always)]
    fn covered(&self, w: V3<R>) -> R::Mask {
        w.z.simd_gt(R::zero()) | !self.is_solid()
    }

    #[inline(always)]
    fn passes_fibres(&self, wo: V3<R>, wi: V3<R>) -> R {
        if self.sheen.is_none().all() {
            return R::one();
        }
        let along_o = R::select(self.covered(wo), self.sheen.passes(wo), R::one());
        along_o.simd_min(R::select(self.covered(wi), self.sheen.passes(wi), R::one()))
    }

    /// The transmission of the coat towards `wo`, or where that is inside a solid, towards `wi`; times its colour along
    /// both, and what it darkens.
    #[inline(always)]
    pub(crate) fn under_coat(&self, wo: V3<R>, wi: V3<R>) -> V3<R> {
        let (zero, one) = (R::zero(), R::one());
        if self.coat.exists().none() {
            return V3::splat(one);
        }
        let (above_o, above_i) = (self.covered(wo), self.covered(wi));
        let share = self.coat.share(V3::select(above_o, wo, wi));
        let passes = V3::splat(one - share.or_zero(above_o | above_i));
        let ClearcoatLanes { weight, absorption, darkened, .. } = self.coat;
        let least = darkened.x.simd_min(darkened.y).simd_min(darkened.z);
        let is_tinted = absorption.max_component().simd_ne(zero) | least.simd_ne(one);
        if is_tinted.none() {
            return passes;
        }
        let way = self.coat.way(wo).or_zero(above_o) + self.coat.way(wi).or_zero(above_i);
        let exponent = absorption * (-way);
        let tint = V3::new(exp(exponent.x), exp(exponent.y), exp(exponent.z)) * darkened;
        let tint = lerp(V3::splat(one), tint, weight);
        V3::select(is_tinted, passes * tint, passes)
    }

    // Fresnel terms.

    /// The relative index of the opaque dielectric, which is never seen from inside.
    #[inline(always)]
    pub(crate) fn opaque_eta(&self) -> R {
        self.eta.simd_max(self.eta.recip()).simd_min(R::splat(MAX_ETA))
    }

    /// Index of the other side over that of the side of `w`, for transmission.
    #[inline(always)]
    fn eta_across(&self, w: V3<R>) -> R {
        let across = R::select(w.z.simd_gt(R::zero()), self.eta, self.eta.recip());
        R::select(self.is_solid(), across, R::one())
    }

    #[inline(always)]
    fn has_film(&self) -> R::Mask {
        self.film.weight.simd_ne(R::zero())
    }

    /// The reflectance of the metal at a cosine.
    #[inline(always)]
    pub(crate) fn metal(&self, cos: R) -> V3<R> {
        // Schlick, "An Inexpensive BRDF Model for Physically-based Rendering", Eurographics 1994: the weight of white.
        let rest = R::one() - unit(cos);
        let square = rest * rest;
        let bare = lerp(self.base, V3::splat(R::one()), square * square * rest);
        let has_film = self.has_film();
        if has_film.none() {
            return bare;
        }
        let film = self.film.reflectance(V3::splat(cos), self.base);
        V3::select(has_film, lerp(bare, film, self.film.weight), bare)
    }

    /// The reflectance of the dielectrics at a cosine, negative from the inside, for an index in each channel:
    /// interpolated between `f0` and `f90` as the exact Fresnel equations vary.
    #[inline(always)]
    pub(crate) fn dielectric(&self, cos: R, etas: [R; 3]) -> V3<R> {
        let exact = each_dielectric(cos, etas);
        let one = V3::splat(R::one());
        let head_on = each_dielectric(R::one(), etas);
        let grazing = (exact - head_on) / (one - head_on);
        let bare = self.between(self.f0, grazing);
        let has_film = self.has_film();
        let mut reflected = bare;
        if has_film.any() {
            let eta = V3::new(etas[0], etas[1], etas[2]);
            let sine2 = R::one() - cos * cos;
            let inside = one - eta * eta * sine2;
            let inside = inside.max(V3::splat(R::zero()));
            let inside = V3::new(inside.x.sqrt(), inside.y.sqrt(), inside.z.sqrt());
            let is_inside = cos.simd_lt(R::zero());
            let outside = V3::select(is_inside, inside, V3::splat(cos));
            // Never more than the Lambertian base assumes.
            let most = self.between(self.film.most(self.f0), grazing);
            let film = self.film.reflectance(outside, self.f0).min(most);
            reflected = V3::select(has_film, lerp(bare, film, self.film.weight), bare);
        }
        let from_inside = cos.simd_lt(R::zero());
        V3::new(
            R::select(from_inside & exact.x.simd_eq(R::one()), R::one(), reflected.x),
            R::select(from_inside & exact.y.simd_eq(R::one()), R::one(), reflected.y),
            R::select(from_inside & exact.z.simd_eq(R::one()), R::one(), reflected.z),
        )
    }

    /// Between the reflectance at normal incidence and `f90`.
    #[inline(always)]
    fn between(&self, f0: V3<R>, grazing: V3<R>) -> V3<R> {
        let mixed = f0 + (V3::splat(self.f90) - f0) * grazing;
        V3::new(unit(mixed.x), unit(mixed.y), unit(mixed.z))
    }

    /// The albedo that the opaque dielectric withholds from its base, where perfect facets reflect `mirror` and
    /// dielectric ones `face`.
    #[inline(always)]
    fn kept(&self, mirror: R, face: R) -> V3<R> {
        let head_on = fresnel::dielectric(R::one(), self.opaque_eta());
        let grazing = ((face - head_on * mirror) / (R::one() - head_on)).simd_max(R::zero());
        let below = (mirror - grazing).simd_max(R::zero());
        let at_grazing = V3::splat(self.f90 * grazing);
        let bare = self.f0 * below + at_grazing;
        let has_film = self.has_film();
        let mut kept = bare;
        if has_film.any() {
            let most = self.film.most(self.f0) * below + at_grazing;
            kept = V3::select(has_film, lerp(bare, most, self.film.weight), bare);
        }
        V3::new(unit(kept.x), unit(kept.y), unit(kept.z))
    }

    #[inline(always)]
    fn disperses(&self) -> R::Mask {
        self.spread.simd_ne(R::zero())
    }

    /// The indices of the channels of a solid.
    #[inline(always)]
    fn etas(&self) -> [R; 3] {
        let (disperses, least) = (self.disperses(), R::splat(1.001));
        [
            R::select(disperses, (self.eta - self.spread).simd_max(least), self.eta),
            R::select(disperses, self.eta.simd_max(least), self.eta),
            R::select(disperses, (self.eta + self.spread).simd_max(least), self.eta),
        ]
    }

    /// The number of ways through a facet: a channel each, or one for all.
    #[inline(always)]
    pub(crate) fn ways_through(&self) -> R {
        R::select(self.disperses(), R::splat(3.0), R::one())
    }

    #[inline(always)]
    fn clear(&self) -> R {
        (R::one() - self.metallic) * self.transmission
    }

    #[inline(always)]
    fn opaque(&self) -> R {
        (R::one() - self.metallic) * (R::one() - self.transmission)
    }

    /// Reflection and transmission of a facet at a cosine, negative from below.
    #[inline(always)]
    pub(crate) fn shares(&self, cos: R) -> Shares<R> {
        R::call(SharesAt { bsdf: self, cos })
    }

    #[inline(always)]
    fn shares_inlined(&self, cos: R) -> Shares<R> {
        let zero = R::zero();
        let clear = self.clear();
        let opaque = (R::one() - self.metallic) - clear;
        let opaque_etas = [self.opaque_eta(); 3];
        let outside = cos.abs();
        let (is_metal, is_opaque, is_clear) =
            (self.metallic.simd_gt(zero), opaque.simd_gt(zero), clear.simd_gt(zero));
        let mut reflects = V3::splat(zero);
        if is_metal.any() {
            reflects = (self.metal(outside) * self.metallic).or_zero(is_metal);
        }
        if is_opaque.any() {
            reflects = reflects + (self.dielectric(outside, opaque_etas) * opaque).or_zero(is_opaque);
        }
        if is_clear.none() {
            return Shares { reflects, transmits: V3::splat(zero) };
        }
        let [r, g, b] = self.etas();
        let [opaque_eta, ..] = opaque_etas;
        let etas = [
            R::select(self.thin, opaque_eta, r),
            R::select(self.thin, opaque_eta, g),
            R::select(self.thin, opaque_eta, b),
        ];
        let once = self.dielectric(R::select(self.thin, outside, cos), etas);
        // R + T² R + T² R³ + … as for a thin pane of glass.
        let pane = once * R::splat(2.0) / (once + V3::splat(R::one()));
        let clear_reflects = V3::select(self.thin, pane, once);
        let reflects = reflects + (clear_reflects * clear).or_zero(is_clear);
        let transmits = (V3::splat(R::one()) - clear_reflects) * self.transmission_color * clear;
        Shares { reflects, transmits: transmits.or_zero(is_clear) }
    }

    // Cosine-weighted parts: the Lambertian base, and multiple scattering between facets.

    /// The isotropic α for lookups in the tables.
    #[inline(always)]
    fn mean_alpha(&self) -> R {
        (self.facets.alpha_x * self.facets.alpha_y).sqrt().simd_min(R::one())
    }

    #[inline(always)]
    fn is_stretched(&self) -> R::Mask {
        let FacetLanes { alpha_x, alpha_y } = self.facets;
        alpha_x.simd_ne(alpha_y) & alpha_x.simd_max(alpha_y).simd_gt(R::splat(Stretched::LEAST))
    }

    /// The single-scattering albedo of perfect facets.
    #[inline(always)]
    fn mirror(&self, w: V3<R>) -> R {
        let isotropic = ALBEDO.mirror(w.z.abs(), self.mean_alpha());
        let is_stretched = self.is_stretched();
        if is_stretched.none() {
            return isotropic;
        }
        let FacetLanes { alpha_x, alpha_y } = self.facets;
        R::select(is_stretched, STRETCHED.mirror([alpha_x, alpha_y], self.facet_local(w)), isotropic)
    }

    /// The mean of [`Self::mirror`].
    #[inline(always)]
    fn mirror_mean(&self) -> R {
        let isotropic = ALBEDO.mirror_mean(self.mean_alpha());
        let is_stretched = self.is_stretched();
        if is_stretched.none() {
            return isotropic;
        }
        let FacetLanes { alpha_x, alpha_y } = self.facets;
        R::select(is_stretched, STRETCHED.mean([alpha_x, alpha_y]), isotropic)
    }

    /// The roughness in a direction: that of the most similar isotropic facets.
    #[inline(always)]
    fn alpha_towards(&self, w: V3<R>) -> R {
        let across = self.facet_local(w);
        let length = (across.x * across.x + across.y * across.y).sqrt();
        let (x, y) = (self.facets.alpha_x * across.x / length, self.facets.alpha_y * across.y / length);
        let along = (x * x + y * y).sqrt().simd_min(R::one());
        R::select(self.is_stretched() & length.simd_gt(R::zero()), along, self.mean_alpha())
    }

    /// The mean albedo of the opaque face: of the roughnesses of all azimuths.
    #[inline(always)]
    fn face_mean(&self) -> R {
        let eta = self.opaque_eta();
        let isotropic = ALBEDO.face_mean(self.mean_alpha(), eta);
        let is_stretched = self.is_stretched();
        if is_stretched.none() {
            return isotropic;
        }
        const STEPS: u8 = 8;
        let mut sum = R::zero();
        for i in 0..STEPS {
            let (sin, cos) = sin_cos_turns(R::splat((f32::from(i) + 0.5) / f32::from(4 * STEPS)));
            let (x, y) = (self.facets.alpha_x * cos, self.facets.alpha_y * sin);
            let alpha = (x * x + y * y).sqrt().simd_min(R::one());
            sum = sum + ALBEDO.face_mean(alpha, eta);
        }
        R::select(is_stretched, sum * R::splat(1.0 / f32::from(STEPS)), isotropic)
    }

    /// f · |cos θi| of all that is sampled by the cosine, without the fibres.
    #[inline(always)]
    fn cosine_part(&self, wo: V3<R>, wi: V3<R>) -> V3<R> {
        let (zero, one) = (R::zero(), R::one());
        let reflects = (wo.z * wi.z).simd_gt(zero);
        let (opaque, clear) = (self.opaque(), self.clear());
        let is_rough = !self.facets.is_smooth();
        let has_base = opaque.simd_gt(zero) & (reflects | self.diffuse_transmission.simd_gt(zero));
        let has_metal = is_rough & self.metallic.simd_gt(zero) & reflects;
        let has_glass = is_rough & clear.simd_gt(zero);
        let mut sum = V3::splat(zero);
        if (has_base | has_metal | has_glass).none() {
            return sum;
        }
        let (mirror_o, mirror_i, mirror_mean) = (self.mirror(wo), self.mirror(wi), self.mirror_mean());
        if has_base.any() {
            let eta = self.opaque_eta();
            let face_o = ALBEDO.face(wo.z.abs(), self.alpha_towards(wo), eta);
            let face_i = ALBEDO.face(wi.z.abs(), self.alpha_towards(wi), eta);
            let white = given_back(
                self.kept(mirror_o, face_o),
                self.kept(mirror_i, face_i),
                self.kept(mirror_mean, self.face_mean()),
            );
            let near = self.base * (one - self.diffuse_transmission);
            let far = self.diffuse_transmission_color * (self.diffuse_transmission * self.spread_across(wo));
            let color = V3::select(reflects, near, far);
            sum = (white * color * opaque).or_zero(has_base);
        }
        if has_metal.any() {
            let white = given_back(V3::splat(mirror_o), V3::splat(mirror_i), V3::splat(mirror_mean));
            // The series of further bounces: F² E / (1 − F (1 − E)) of the first one's loss.
            let plain = (self.base * R::splat(20.0) + V3::splat(one)) / R::splat(21.0);
            let has_film = self.has_film();
            let mut f = plain;
            if has_film.any() {
                f = V3::select(has_film, self.metal(R::splat(2.0 / 3.0)), plain);
            }
            let lost = V3::splat(one) - f * (one - mirror_mean);
            let further = f * f * mirror_mean / lost.max(V3::splat(R::splat(1e-6)));
            sum = sum + (white * further * self.metallic).or_zero(has_metal);
        }
        if has_glass.any() {
            let mirrors = [mirror_o, mirror_i, mirror_mean];
            sum = sum + (self.clear_further_bounces(wo, wi, mirrors) * clear).or_zero(has_glass);
        }
        sum * wi.z.abs()
    }

    /// The factor of η² on diffuse transmission into or out of a solid.
    #[inline(always)]
    fn spread_across(&self, wo: V3<R>) -> R {
        let eta2 = self.eta * self.eta;
        let dense = eta2.simd_min(R::one());
        let across = R::select(wo.z.simd_gt(R::zero()), dense / eta2, dense);
        R::select(self.is_solid(), across, R::one())
    }

    /// The share of multiple scattering between clear facets that is compensated: the tables are for plain
    /// glass, and facets with less reflection lose at least this share.
    #[inline(always)]
    fn plainness(&self) -> R {
        let one = R::one();
        let head_on = fresnel::dielectric(one, self.eta);
        let most = self.f0.max_component();
        let least = self.f0.x.simd_min(self.f0.y).simd_min(self.f0.z);
        let tint = (least / head_on).simd_min(head_on / most.simd_max(R::splat(1e-6)));
        let tint = R::select(head_on.simd_gt(R::zero()), tint, one).simd_min(one);
        let in_tables = self.eta.simd_max(self.eta.recip()).simd_le(R::splat(MAX_ETA));
        (tint * self.f90 * (one - self.film.weight)).or_zero(in_tables)
    }

    /// f of multiple scattering between clear facets; perfect ones reflect these shares from both directions and on
    /// average.
    #[inline(always)]
    fn clear_further_bounces(&self, wo: V3<R>, wi: V3<R>, mirrors: [R; 3]) -> V3<R> {
        let (zero, one, tiny) = (R::zero(), R::one(), R::splat(1e-6));
        let reflects = (wo.z * wi.z).simd_gt(zero);
        let tint = V3::select(reflects, V3::splat(one), self.transmission_color);
        let [mirror_o, mirror_i, mirror_mean] = mirrors;
        let mut f = zero;
        if self.thin.any() {
            let mean = (one - mirror_mean).simd_max(tiny);
            let once = ALBEDO.face_mean(zero, self.opaque_eta());
            let pane = R::splat(2.0) * once / (one + once);
            let share = R::select(reflects, pane, one - pane);
            let thin = share * (one - mirror_o) * (one - mirror_i) / mean * R::splat(FRAC_1_PI);
            f = thin.or_zero(self.thin);
        }
        let eta = self.eta;
        let bends = !self.thin & (eta - one).abs().simd_ge(R::splat(Principled::NO_BORDER));
        if bends.any() {
            // Anisotropic facets lose at least as much as the smoother of their two roughnesses.
            let smoother = self.facets.alpha_x.simd_min(self.facets.alpha_y);
            let alpha = R::select(self.is_stretched(), smoother, self.mean_alpha());
            let loss_o = one - ALBEDO.glass(wo.z.abs(), alpha, eta, wo.z.simd_lt(zero));
            let loss_i = one - ALBEDO.glass(wi.z.abs(), alpha, eta, wi.z.simd_lt(zero));
            let outside = one - ALBEDO.glass_mean(alpha, eta, R::Mask::splat(false));
            let inside = one - ALBEDO.glass_mean(alpha, eta, R::Mask::splat(true));
            // The losses of both sides are distributed over both so that the result is reciprocal: by the losses
            // times η².
            let both = (outside.simd_max(zero) + eta * eta * inside.simd_max(zero)).simd_max(tiny);
            let denser = R::select(wo.z.simd_gt(zero), one, eta * eta);
            let losses = self.plainness() * loss_o.simd_max(zero) * loss_i.simd_max(zero);
            f = R::select(bends, losses * denser / both * R::splat(FRAC_1_PI), f);
        }
        tint * f
    }

    // Facets.

    #[inline(always)]
    pub(crate) fn facet_local(&self, w: V3<R>) -> V3<R> {
        let [c, s] = self.tangent;
        V3::new(c * w.x + s * w.y, c * w.y - s * w.x, w.z)
    }

    #[inline(always)]
    fn shading_local(&self, w: V3<R>) -> V3<R> {
        let [c, s] = self.tangent;
        V3::new(c * w.x - s * w.y, s * w.x + c * w.y, w.z)
    }

    /// f · |cos θi| of the facets, and the density of [`Self::sample_facets`]: the sum over the ways of scattering from
    /// `wo` to `wi`, which are one, or one for each channel of a prism.
    #[inline(always)]
    fn eval_facets(&self, wo: V3<R>, wi: V3<R>) -> (V3<R>, R) {
        let (zero, one) = (R::zero(), R::one());
        let (mut sum, mut density) = (V3::splat(zero), zero);
        let reflects = (wo.z * wi.z).simd_gt(zero);
        let is_clear = self.transmission.simd_gt(zero) & self.metallic.simd_lt(one);
        let exists = !self.facets.is_smooth() & (reflects | is_clear);
        let through = !reflects & !self.thin;
        let by_channel = through & self.disperses();
        let (wo, wi) = (self.facet_local(wo), self.facet_local(wi));
        // A thin pane spreads light as if it were reflected, and then mirrored to the other side.
        let wi = V3::select(reflects | through, wi, flipped(wi));
        for (channel, eta) in self.etas().into_iter().enumerate() {
            let bends = (eta - one).abs().simd_ge(R::splat(Principled::NO_BORDER));
            let mut exists = exists & (bends | !through);
            if channel > 0 {
                exists = exists & by_channel;
            }
            if exists.none() {
                continue;
            }
            // For a reflection, any index other than 1 will do.
            let eta = R::select(through, eta, R::splat(1.5));
            let border = DielectricLanes { eta, facets: self.facets };
            let (facet, fits) = border.facet(wo, wi);
            let fits = exists & fits;
            let shares = self.shares(wo.dot(facet.normal));
            let transmits = only(shares.transmits, by_channel, channel);
            let share = V3::select(reflects, shares.reflects, transmits);
            sum = sum + (share * border.eval_facet(&facet, wo, wi)).or_zero(fits);
            let reflection = shares.reflection_probability();
            let way = R::select(reflects, reflection, one - reflection);
            let probability = way * R::select(by_channel, R::splat(1.0 / 3.0), one);
            let visible = self.facets.visible_density(wo, facet.normal);
            density = density + (probability * visible * facet.jacobian).or_zero(fits);
        }
        (sum, density)
    }

    #[inline(always)]
    fn sample_facets(&self, wo: V3<R>, lobe: R, u: [R; 2]) -> FacetSample<R> {
        let (zero, one) = (R::zero(), R::one());
        let wo = self.facet_local(wo);
        let smooth = self.facets.is_smooth();
        let mut m = V3::constant([0.0, 0.0, 1.0]);
        if !smooth.all() {
            m = V3::select(smooth, m, self.facets.sample_visible(wo, u));
        }
        let shares = self.shares(wo.dot(m));
        let reflection = shares.reflection_probability();
        let reflected = V3::select(smooth, mirrored(wo), reflect(wo, m));
        let transmits = lobe.simd_ge(reflection);
        let through = one - reflection;
        // The channel that is refracted.
        let (disperses, ways) = (self.disperses(), self.ways_through());
        let place = (lobe - reflection) / through * ways;
        let (is_red, is_blue) = (place.simd_lt(one), place.simd_ge(R::splat(2.0)));
        let [r, g, b] = self.etas();
        let eta = R::select(is_red, r, R::select(is_blue, b, g));
        let eta = R::select(disperses, eta, r);
        let transmitted = shares.transmits;
        let one_channel = V3::new(
            transmitted.x.or_zero(is_red),
            transmitted.y.or_zero(!is_red & !is_blue),
            transmitted.z.or_zero(is_blue),
        );
        let share = V3::select(disperses, one_channel, transmitted) * (ways / through);
        let has_border = (eta - one).abs().simd_ge(R::splat(Principled::NO_BORDER));
        let bends = transmits & !self.thin & has_border;
        let passes = transmits & !self.thin & !has_border;
        let across = R::select(wo.z.simd_gt(zero), eta, eta.recip());
        let across = R::select(bends, across, one);
        let (refracted, refracts) = refract(wo, m, across);
        let wi = V3::select(transmits & self.thin, flipped(reflected), reflected);
        let wi = V3::select(bends, refracted, wi);
        let wi = V3::select(passes, -wo, wi);
        let is_same_side = (wo.z * wi.z).simd_gt(zero);
        let valid = (transmits & !is_same_side & (refracts | !bends)) | (!transmits & is_same_side);
        let weight = V3::select(transmits, share / (across * across), shares.reflects / reflection);
        FacetSample {
            wi: self.shading_local(wi),
            valid,
            delta: smooth | passes,
            weight,
            transmits,
            eta: across,
        }
    }

    // Sampling.

    #[inline(always)]
    pub(crate) fn lobes(&self, wo: V3<R>) -> Lobes<R> {
        R::call(LobesFrom { bsdf: self, wo })
    }

    #[inline(always)]
    fn lobes_inlined(&self, wo: V3<R>) -> Lobes<R> {
        let (zero, one, half) = (R::zero(), R::one(), R::splat(0.5));
        let (opaque, clear) = (self.opaque(), self.clear());
        let shares = self.shares(wo.z);
        let covered = self.covered(wo);
        let coat = self.coat.share(wo).or_zero(covered);
        let under = one - coat;
        let facets = under * (shares.reflects.max_component() + shares.transmits.max_component());
        let face = self.dielectric(wo.z.abs(), [self.opaque_eta(); 3]);
        let inside = opaque * (one - face.x.simd_min(face.y).simd_min(face.z));
        let is_rough = !self.facets.is_smooth();
        let further = (one - self.mirror(wo)).or_zero(is_rough);
        let has_fibres = !self.sheen.is_none();
        let mut fibres = zero;
        if has_fibres.any() {
            fibres = self.sheen.color.max_component() * self.sheen.share(wo);
            fibres = fibres.or_zero(has_fibres & covered);
        }
        let near = inside * self.base.max_component() * (one - self.diffuse_transmission)
            + further * (self.metallic + half * clear)
            + fibres;
        let far = inside * self.diffuse_transmission_color.max_component() * self.diffuse_transmission
            + further * half * clear;
        // No existing part may have a tiny probability, however faint from here.
        let least = (R::splat(0.05) * (coat + facets + under * (near + far))).simd_max(R::splat(1e-4));
        let is_clear = is_rough & clear.simd_gt(zero);
        let is_near = opaque.simd_gt(zero) | has_fibres | (is_rough & self.metallic.simd_gt(zero)) | is_clear;
        let is_far = (opaque * self.diffuse_transmission).simd_gt(zero) | is_clear;
        let coat = coat.simd_max(least).or_zero(coat.simd_gt(zero));
        let facets = facets.simd_max(least).or_zero(facets.simd_gt(zero));
        let near = (under * near).simd_max(least).or_zero(is_near);
        let far = (under * far).simd_max(least).or_zero(is_far);
        let sum = coat + facets + near + far;
        Lobes { coat: coat / sum, facets: facets / sum, near: near / sum, far: far / sum }
    }

    /// [`LaneBsdf::eval`] with the probabilities of the lobes from `wo`.
    #[inline(always)]
    fn eval_with(&self, lobes: &Lobes<R>, wo: V3<R>, wi: V3<R>) -> (V3<R>, R) {
        R::call(Eval { bsdf: self, lobes, wo, wi })
    }

    #[inline(always)]
    fn eval_inlined(&self, lobes: &Lobes<R>, wo: V3<R>, wi: V3<R>) -> (V3<R>, R) {
        let fits = has_side(wo) & has_side(wi);
        let reflects = (wo.z * wi.z).simd_gt(R::zero());
        let (facets, facets_pdf) = self.eval_facets(wo, wi);
        let mut sum = self.cosine_part(wo, wi) + facets;
        let cosine = R::select(reflects, lobes.near, lobes.far);
        let mut pdf = cosine * R::splat(FRAC_1_PI) * wi.z.abs();
        pdf = pdf + (lobes.facets * facets_pdf).or_zero(lobes.facets.simd_gt(R::zero()));
        let covered = self.covered(wo) & self.covered(wi);
        if !self.sheen.is_none().all() {
            sum = sum * self.passes_fibres(wo, wi) + self.sheen.eval(wo, wi).or_zero(covered);
        }
        let has_coat = self.coat.exists();
        if has_coat.any() {
            let (value, face_pdf) = self.coat.eval(wo, wi);
            let own = (self.coat.weight * value).or_zero(has_coat & covered);
            sum = sum * self.under_coat(wo, wi) + V3::splat(own);
            pdf = pdf + (lobes.coat * face_pdf).or_zero(lobes.coat.simd_gt(R::zero()));
        }
        (sum.or_zero(fits), pdf.or_zero(fits))
    }
}

/// [`PrincipledLanes::shares`].
struct SharesAt<'a, R: Real> {
    bsdf: &'a PrincipledLanes<R>,
    cos: R,
}

impl<R: Real> Task<R> for SharesAt<'_, R> {
    type Output = Shares<R>;
    #[inline(always)]
    fn run(self) -> Shares<R> {
        self.bsdf.shares_inlined(self.cos)
    }
}

/// [`PrincipledLanes::lobes`].
struct LobesFrom<'a, R: Real> {
    bsdf: &'a PrincipledLanes<R>,
    wo: V3<R>,
}

impl<R: Real> Task<R> for LobesFrom<'_, R> {
    type Output = Lobes<R>;
    #[inline(always)]
    fn run(self) -> Lobes<R> {
        self.bsdf.lobes_inlined(self.wo)
    }
}

/// [`PrincipledLanes::eval_with`].
struct Eval<'a, R: Real> {
    bsdf: &'a PrincipledLanes<R>,
    lobes: &'a Lobes<R>,
    wo: V3<R>,
    wi: V3<R>,
}

impl<R: Real> Task<R> for Eval<'_, R> {
    type Output = (V3<R>, R);
    #[inline(always)]
    fn run(self) -> (V3<R>, R) {
        self.bsdf.eval_inlined(self.lobes, self.wo, self.wi)
    }
}

impl<R: Real> LaneBsdf<R> for PrincipledLanes<R> {
    const ROW: usize = 45;

    #[inline(always)]
    fn load(table: &[f32], at: R::UInt) -> Self {
        let film: R = field(table, at, 23);
        let mut nm = V3::splat(R::zero());
        if film.simd_ne(R::zero()).any() {
            nm = colour(table, at, 35);
        }
        let coat: R = field(table, at, 30);
        let mut coat_eta = R::splat(Clearcoat::ETA);
        let [mut absorption, mut darkened] = [V3::splat(R::zero()), V3::splat(R::one())];
        if coat.simd_ne(R::zero()).any() {
            coat_eta = field(table, at, 38);
            absorption = colour(table, at, 39);
            darkened = colour(table, at, 42);
        }
        Self {
            base: colour(table, at, 0),
            metallic: field(table, at, 3),
            facets: FacetLanes { alpha_x: field(table, at, 4), alpha_y: field(table, at, 5) },
            tangent: [field(table, at, 6), field(table, at, 7)],
            eta: field(table, at, 8),
            f0: colour(table, at, 9),
            f90: field(table, at, 12),
            transmission: field(table, at, 13),
            transmission_color: colour(table, at, 14),
            thin: field::<R>(table, at, 17).simd_ne(R::zero()),
            spread: field(table, at, 18),
            diffuse_transmission: field(table, at, 19),
            diffuse_transmission_color: colour(table, at, 20),
            film: ThinFilmLanes {
                weight: film,
                eta: field(table, at, 24),
                thickness: field(table, at, 25),
                nm,
            },
            sheen: SheenLanes { color: colour(table, at, 26), roughness: field(table, at, 29) },
            coat: ClearcoatLanes {
                weight: coat,
                alpha: field(table, at, 31),
                normal: colour(table, at, 32),
                eta: coat_eta,
                absorption,
                darkened,
            },
        }
    }

    #[inline(always)]
    fn eval(&self, wo: V3<R>, wi: V3<R>) -> (V3<R>, R) {
        self.eval_with(&self.lobes(wo), wo, wi)
    }

    #[inline(always)]
    fn sample(&self, wo: V3<R>, lobe: R, u: [R; 2]) -> LaneSample<R> {
        let (zero, one) = (R::zero(), R::one());
        let lobes = self.lobes(wo);
        let from_coat = lobe.simd_lt(lobes.coat);
        let from_facets = !from_coat & lobe.simd_lt(lobes.coat + lobes.facets);
        let from_cosine = !from_coat & !from_facets;

        // A remainder by rounding beyond the last lobe must not select a lobe of probability zero.
        let is_far = lobes.far.simd_gt(zero) & (lobes.near.simd_eq(zero) | lobe.simd_ge(one - lobes.far));
        let mut wi = cosine_direction(u, R::select(is_far, -wo.z, wo.z));
        let mut exists = has_side(wo) & (!from_cosine | (lobes.near + lobes.far).simd_ne(zero));
        let mut delta = R::Mask::splat(false);
        let mut delta_weight = V3::splat(one);
        let mut delta_transmits = R::Mask::splat(false);
        let mut delta_eta = one;

        if from_facets.any() {
            let within = (lobe - lobes.coat) / lobes.facets;
            let within = within.simd_max(zero).simd_min(R::splat(1.0 - f32::EPSILON / 2.0));
            let sample = self.sample_facets(wo, within, u);
            wi = V3::select(from_facets, sample.wi, wi);
            exists = exists & (!from_facets | sample.valid);
            delta = from_facets & sample.delta;
            if delta.any() {
                let layers = self.under_coat(wo, sample.wi) * self.passes_fibres(wo, sample.wi);
                delta_weight = sample.weight * (layers / V3::splat(lobes.facets));
                delta_transmits = sample.transmits;
                delta_eta = sample.eta;
            }
        }
        if from_coat.any() {
            let is_below = wo.z.simd_lt(zero);
            let o = self.coat.local(wo);
            let above = V3::select(is_below, -o, o);
            let sample = self.coat.face().sample_of(above, zero, u, Ways::Reflection);
            let reflected = self.coat.back(sample.wi);
            let reflected = V3::select(is_below, -reflected, reflected);
            let is_up = (wo.z * reflected.z).simd_gt(zero);
            let reflected = V3::select(is_up, reflected, flipped(reflected));
            let valid = sample.valid & (o.z * wo.z).simd_gt(zero) & (wo.z * reflected.z).simd_gt(zero);
            wi = V3::select(from_coat, reflected, wi);
            exists = exists & (!from_coat | valid);
            let is_mirror = from_coat & sample.delta;
            delta = delta | is_mirror;
            let weight = sample.weight * (self.coat.weight / lobes.coat);
            delta_weight = V3::select(is_mirror, weight, delta_weight);
            delta_transmits = delta_transmits & !is_mirror;
            delta_eta = R::select(is_mirror, one, delta_eta);
        }
        let transmits = !(wo.z * wi.z).simd_gt(zero);
        let eta = R::select(transmits, self.eta_across(wo), one);
        let (mut weight, mut pdf) = (delta_weight, one);
        if !delta.all() {
            let (value, density) = self.eval_with(&lobes, wo, wi);
            weight = V3::select(delta, delta_weight, value / density);
            pdf = R::select(delta, one, density);
        }
        LaneSample {
            wi,
            weight,
            pdf,
            valid: exists & pdf.simd_gt(zero) & pdf.is_finite(),
            delta,
            transmitted: (delta & delta_transmits) | (!delta & transmits),
            eta: R::select(delta, delta_eta, eta),
        }
    }

    #[inline(always)]
    fn is_delta(&self) -> R::Mask {
        self.facets.is_smooth()
            & self.opaque().simd_eq(R::zero())
            & self.sheen.is_none()
            & (!self.coat.exists() | self.coat.face().is_delta())
    }

    #[inline(always)]
    fn regularized(self, mask: R::Mask) -> Self {
        let alpha = self.coat.face().facets.regularized(R::Mask::splat(true)).alpha_x;
        let coat = ClearcoatLanes { alpha: R::select(mask, alpha, self.coat.alpha), ..self.coat };
        Self { facets: self.facets.regularized(mask), coat, ..self }
    }
}

impl<R: Real> FacetLanes<R> {
    /// [`Microfacets::new`].
    #[inline(always)]
    pub fn new(alpha_x: R, alpha_y: R) -> Self {
        let alpha_x = alpha_x.simd_max(R::zero()).simd_min(R::splat(1e4));
        let alpha_y = alpha_y.simd_max(R::zero()).simd_min(R::splat(1e4));
        let is_rough = alpha_x.simd_max(alpha_y).simd_ge(R::splat(Microfacets::SMOOTH_BELOW));
        // The smaller α of a very anisotropic pair is clamped to where the arithmetic stays finite.
        let least = R::splat(1e-4);
        Self {
            alpha_x: alpha_x.simd_max(least).or_zero(is_rough),
            alpha_y: alpha_y.simd_max(least).or_zero(is_rough),
        }
    }
}

/// The direction mirrored to the other side of the surface.
#[inline(always)]
fn flipped<R: Real>(w: V3<R>) -> V3<R> {
    V3::new(w.x, w.y, -w.z)
}

/// Where the mask is true, the colour with all channels but one set to zero.
#[inline(always)]
fn only<R: Real>(color: V3<R>, mask: R::Mask, channel: usize) -> V3<R> {
    let [x, y, z] = [channel == 0, channel == 1, channel == 2];
    V3::new(
        color.x.or_zero(!mask | R::Mask::splat(x)),
        color.y.or_zero(!mask | R::Mask::splat(y)),
        color.z.or_zero(!mask | R::Mask::splat(z)),
    )
}

#[inline(always)]
fn lerp<R: Real>(a: V3<R>, b: V3<R>, amount: R) -> V3<R> {
    a * (R::one() - amount) + b * amount
}

/// The exact Fresnel terms at a cosine, for an index in each channel.
#[inline(always)]
fn each_dielectric<R: Real>(cos: R, etas: [R; 3]) -> V3<R> {
    let [r, g, b] = etas;
    V3::new(fresnel::dielectric(cos, r), fresnel::dielectric(cos, g), fresnel::dielectric(cos, b))
}

/// f of a white Lambertian with albedo 1 − kept(wo), reciprocal.
#[inline(always)]
fn given_back<R: Real>(kept_o: V3<R>, kept_i: V3<R>, kept_mean: V3<R>) -> V3<R> {
    let one = V3::splat(R::one());
    let mean = (one - kept_mean).max(V3::splat(R::splat(1e-6)));
    (one - kept_o) * (one - kept_i) * R::splat(FRAC_1_PI) / mean
}
