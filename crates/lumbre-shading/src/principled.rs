//! One layered surface for all parameters of glTF and of the principled materials.

use std::f32::consts::FRAC_1_PI;

use lumbre_math::warp::circle;
use lumbre_math::{Vec2, Vec3};

use crate::albedo::{ALBEDO, MAX_ETA};
use crate::conductor::reflect;
use crate::dielectric::{Dielectric, Ways, refract};
use crate::diffuse::cosine_direction;
use crate::lanes::vector;
use crate::microfacet::Microfacets;
use crate::sheen::Sheen;
use crate::specular::Specular;
use crate::stretched::{STRETCHED, Stretched};
use crate::thin_film::ThinFilm;
use crate::{BsdfSample, LocalDir, Scatter, Spectrum, fresnel};

/// A layered surface: a clear coat over fibres over a base. The base is a mixture, by area, of metal, an opaque
/// dielectric and a clear dielectric; all three share one roughness.
///
/// - Metal: Schlick's approximation between its colour and white, as in glTF 2.0 (Khronos, 2021, appendix B).
/// - The opaque dielectric: the exact Fresnel equations; what is not reflected reaches a Lambertian base, which
///   reflects or transmits it. The base is scaled by the albedo left over by the interface in both directions:
///   Kelemen, Szirmay-Kalos, "A Microfacet Based Coupled Specular-Matte BRDF Model with Importance Sampling",
///   Eurographics 2001. White on white conserves energy.
/// - The clear dielectric refracts ([`Body::Solid`]) or transmits straight on ([`Body::Thin`]).
/// - Multiple scattering between the facets of metal and clear dielectrics is compensated after Kulla, Conty,
///   "Revisiting Physically Based Shading at Imageworks", SIGGRAPH course 2017. White metal conserves energy.
/// - Fibres attenuate the layers below by the larger of their albedos along the two directions, as in glTF's
///   KHR_materials_sheen: reciprocal, at most energy-conserving, and without light scattered back down.
/// - The coat attenuates by its reflectance towards the viewer, as in glTF's KHR_materials_clearcoat: white
///   under a coat stays white.
///
/// It is reciprocal (radiance in a solid scaled by η²) except under a coat. Opaque and thin surfaces look the
/// same from both sides; a solid has its fibres and coat on the outside only.
///
/// Anisotropic facets have a table of their reflection; reflection and transmission of a dielectric use
/// isotropic facets as rough as the anisotropic ones in the plane of each direction. Anisotropic facets of a
/// clear solid lose the multiple scattering in excess of that of the smaller roughness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Principled {
    /// Reflectance of the metal at normal incidence, and of the Lambertian base of the opaque dielectric.
    pub base: Spectrum,
    /// The share of metal, in [0, 1].
    pub metallic: f32,
    /// The roughness of the base.
    pub facets: Microfacets,
    /// The x axis of the facets in the shading frame: cosine and sine of its angle with the tangent.
    pub tangent: Vec2,
    /// Index of the dielectrics, inside over outside.
    pub eta: f32,
    /// What the dielectrics reflect at normal incidence, in [0, 1].
    pub f0: Spectrum,
    /// What the dielectrics reflect at grazing incidence, in [0, 1].
    pub f90: f32,
    /// The clear share of the dielectric.
    pub transmission: f32,
    /// A factor on transmission through the clear dielectric.
    pub transmission_color: Spectrum,
    /// Whether the clear dielectric is thin or solid.
    pub body: Body,
    /// The share of the Lambertian light of the opaque dielectric that is transmitted.
    pub diffuse_transmission: f32,
    /// A factor on that.
    pub diffuse_transmission_color: Spectrum,
    /// A thin film on the base.
    pub film: ThinFilm,
    /// Fibres above the film.
    pub sheen: Sheen,
    /// The topmost layer.
    pub coat: Clearcoat,
}

/// The interior behind a clear surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Body {
    /// A thin pane: transmission is spread by roughness, not refracted, and the bounces between the two faces
    /// are summed.
    Thin,
    /// A solid; the normal points out of it.
    Solid {
        /// Half of the difference of η between blue and red; 0 without dispersion.
        spread: f32,
    },
}

/// A transparent lacquer of index 1.5.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clearcoat {
    /// The share of the surface that it covers, in [0, 1].
    pub weight: f32,
    /// α of its roughness, in [0, 1].
    pub alpha: f32,
    /// Its normal in the shading frame: unit, z > 0.
    pub normal: Vec3,
}

impl Clearcoat {
    /// The index of refraction of the lacquer.
    pub const ETA: f32 = 1.5;

    /// No coat.
    pub const NONE: Self = Self { weight: 0.0, alpha: 0.0, normal: Vec3::Z };

    fn face(&self) -> Dielectric {
        Dielectric { eta: Self::ETA, facets: Microfacets::new(self.alpha, self.alpha) }
    }

    /// The rotation in a plane through the normal that takes the coat's normal to z, or its inverse.
    fn turned(&self, w: Vec3, back: bool) -> Vec3 {
        let n = self.normal;
        if n == Vec3::Z {
            return w;
        }
        // A half-turn about the bisector, then one about z: their product fixes the axis.
        let bisector = n + Vec3::Z;
        let half_turn = |w: Vec3| bisector * (2.0 * bisector.dot(w) / bisector.length_squared()) - w;
        let about_z = |w: Vec3| Vec3::new(-w.x, -w.y, w.z);
        if back { half_turn(about_z(w)) } else { about_z(half_turn(w)) }
    }

    fn local(&self, w: LocalDir) -> LocalDir {
        LocalDir(self.turned(w.0, false))
    }

    /// The attenuation of the layers below along one direction.
    fn share(&self, w: LocalDir) -> f32 {
        if self.weight == 0.0 {
            return 0.0;
        }
        let cos = self.local(w).abs_cos_theta();
        self.weight * ALBEDO.face(cos, self.alpha, Self::ETA)
    }

    /// The directions in the coat's frame that map to `wi`, each with `wo`, as seen from above: where the coat
    /// is tilted, some of its reflections are below the surface and are mirrored back up.
    fn between(&self, wo: LocalDir, wi: LocalDir) -> impl Iterator<Item = (LocalDir, LocalDir)> {
        let o = self.local(wo);
        let is_met = wo.same_hemisphere(wi) && wo.same_hemisphere(o);
        let folded = (self.normal != Vec3::Z).then(|| flipped(wi));
        let below = wo.cos_theta() < 0.0;
        [is_met.then_some(wi), folded.filter(|_| is_met)].into_iter().flatten().filter_map(move |wi| {
            let i = self.local(wi);
            o.same_hemisphere(i).then(|| if below { (-o, -i) } else { (o, i) })
        })
    }
}

/// The probabilities of the lobes; they sum to 1.
#[derive(Clone, Copy)]
struct Lobes {
    coat: f32,
    facets: f32,
    /// Cosine-weighted, on the side of `wo`.
    near: f32,
    /// Cosine-weighted, on the other side.
    far: f32,
}

/// The power reflected and transmitted by a facet; the rest is lost, or reaches the base of the opaque
/// dielectric.
struct Shares {
    reflects: Spectrum,
    transmits: Spectrum,
}

impl Shares {
    /// The probability that a sample is a reflection.
    fn reflection_probability(&self) -> f32 {
        let (r, t) = (self.reflects.max_component(), self.transmits.max_component());
        if t > 0.0 { r / (r + t) } else { 1.0 }
    }
}

impl Principled {
    /// An opaque, white, fully rough dielectric of index 1.5, to start from.
    pub const DEFAULT: Self = Self {
        base: Spectrum::WHITE,
        metallic: 0.0,
        facets: Microfacets::ROUGH,
        tangent: Vec2::X,
        eta: 1.5,
        f0: Spectrum::splat(0.04),
        f90: 1.0,
        transmission: 0.0,
        transmission_color: Spectrum::WHITE,
        body: Body::Thin,
        diffuse_transmission: 0.0,
        diffuse_transmission_color: Spectrum::WHITE,
        film: ThinFilm::NONE,
        sheen: Sheen::NONE,
        coat: Clearcoat::NONE,
    };

    /// f · |cos θi|, without delta parts.
    pub fn eval(&self, wo: LocalDir, wi: LocalDir) -> Spectrum {
        if !sided(wo) || !sided(wi) {
            return Spectrum::BLACK;
        }
        let mut sum = self.cosine_part(wo, wi) + self.eval_facets(wo, wi);
        if !self.has_layers() {
            return sum;
        }
        sum *= self.passes_fibres(wo, wi);
        let covered = self.covered(wo) && self.covered(wi);
        if covered {
            sum += self.sheen.eval(wo, wi);
        }
        sum *= self.passes_coat(wo, wi);
        if covered && self.coat.weight > 0.0 {
            for (o, i) in self.coat.between(wo, wi) {
                sum += Spectrum::splat(self.coat.weight * self.coat.face().eval(o, i));
            }
        }
        sum
    }

    /// The density of [`Principled::sample`] without its delta parts.
    pub fn pdf(&self, wo: LocalDir, wi: LocalDir) -> f32 {
        if !sided(wo) || !sided(wi) {
            return 0.0;
        }
        let lobes = self.lobes(wo);
        let cosine = if wo.same_hemisphere(wi) { lobes.near } else { lobes.far };
        let mut pdf = cosine * FRAC_1_PI * wi.abs_cos_theta();
        if lobes.facets > 0.0 {
            pdf += lobes.facets * self.pdf_facets(wo, wi);
        }
        if lobes.coat > 0.0 {
            for (o, i) in self.coat.between(wo, wi) {
                pdf += lobes.coat * self.coat.face().pdf_of(o, i, Ways::Reflection);
            }
        }
        pdf
    }

    /// A direction sampled from the coat, by reflection or refraction at the facets, or by the cosine.
    pub fn sample(&self, wo: LocalDir, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if !sided(wo) {
            return None;
        }
        let lobes = self.lobes(wo);
        let wi = if lobe < lobes.coat {
            let above = self.coat.local(wo);
            if !above.same_hemisphere(wo) {
                return None;
            }
            let below = wo.cos_theta() < 0.0;
            let sample =
                self.coat.face().sample_of(if below { -above } else { above }, 0.0, u, Ways::Reflection)?;
            let wi = LocalDir(self.coat.turned(sample.wi.vec(), true));
            let wi = if below { -wi } else { wi };
            let wi = if wo.same_hemisphere(wi) { wi } else { flipped(wi) };
            if !wo.same_hemisphere(wi) {
                return None;
            }
            if sample.scatter == Scatter::Delta {
                let weight = sample.weight * (self.coat.weight / lobes.coat);
                return Some(BsdfSample { wi, weight, ..sample });
            }
            wi
        } else if lobe < lobes.coat + lobes.facets {
            let lobe = ((lobe - lobes.coat) / lobes.facets).clamp(0.0, 1.0 - f32::EPSILON / 2.0);
            let sample = self.sample_facets(wo, lobe, u)?;
            if let Some(weight) = sample.delta {
                let layers = self.passes_fibres(wo, sample.wi) * self.passes_coat(wo, sample.wi);
                return Some(BsdfSample {
                    wi: sample.wi,
                    weight: weight * (layers / lobes.facets),
                    scatter: Scatter::Delta,
                    transmitted: sample.eta.is_some(),
                    eta: sample.eta.unwrap_or(1.0),
                });
            }
            sample.wi
        } else {
            // A remainder by rounding beyond the last lobe must not select a lobe of probability zero.
            let far = lobes.far > 0.0 && (lobes.near == 0.0 || lobe >= 1.0 - lobes.far);
            if lobes.near + lobes.far == 0.0 {
                return None;
            }
            cosine_direction(u, if far { -wo.cos_theta() } else { wo.cos_theta() })?
        };
        let pdf = self.pdf(wo, wi);
        if !(pdf > 0.0 && pdf.is_finite()) {
            return None;
        }
        let transmitted = !wo.same_hemisphere(wi);
        let eta = if transmitted { self.eta_across(wo) } else { 1.0 };
        let weight = self.eval(wo, wi) / pdf;
        Some(BsdfSample { wi, weight, scatter: Scatter::Density(pdf), transmitted, eta })
    }

    /// Every delta part with its own weight: the one that [`Principled::sample`] gives times the probability of
    /// choosing it. Rough facets without refraction transmit straight on; they count by the facet of u = 0.
    pub(crate) fn specular(&self, wo: LocalDir) -> Specular {
        let lobes = self.lobes(wo);
        let reflection = self.shares(self.to_facets(wo).cos_theta()).reflection_probability();
        let (_, lanes) = self.lanes();
        let through = (1.0 - reflection) / lanes as f32;
        let facets = |start: f32, share: f32| (lobes.coat + lobes.facets * start, lobes.facets * share);
        let ways = (0..lanes).map(|lane| facets(reflection + through * lane as f32, through));
        [(0.0, lobes.coat), facets(0.0, reflection)]
            .into_iter()
            .chain(ways)
            .filter(|(_, probability)| *probability > 0.0)
            .filter_map(|(start, probability)| {
                let sample = self.sample(wo, start + 0.5 * probability, Vec2::ZERO)?;
                let weight = sample.weight * probability;
                (sample.scatter == Scatter::Delta).then_some(BsdfSample { weight, ..sample })
            })
            .collect()
    }

    /// Whether all parts are deltas.
    pub fn is_delta(&self) -> bool {
        let dielectric = 1.0 - self.metallic;
        self.facets.is_smooth()
            && dielectric * (1.0 - self.transmission) == 0.0
            && self.sheen.is_none()
            && (self.coat.weight == 0.0 || self.coat.face().is_delta())
    }

    /// An estimate of its albedo at normal incidence.
    pub fn albedo_estimate(&self) -> Spectrum {
        let metal = self.metal(1.0);
        let face = self.dielectric(1.0, self.opaque_eta());
        let diffuse = self.base * (1.0 - self.diffuse_transmission)
            + self.diffuse_transmission_color * self.diffuse_transmission;
        let through = Spectrum::WHITE - face;
        let plastic = face + through * diffuse;
        let clear = face + through * self.transmission_color;
        let base = metal.lerp(plastic.lerp(clear, self.transmission), 1.0 - self.metallic);
        let coat = self.coat.share(LocalDir(Vec3::Z));
        base * (1.0 - coat) + Spectrum::splat(coat)
    }

    /// The solid inside another of this index; see [`crate::Bsdf::immersed`].
    #[must_use]
    pub fn immersed(self, outside: f32) -> Self {
        let eta = self.eta / outside;
        let Body::Solid { spread } = self.body else { return self };
        if !(eta > 0.0 && eta.is_finite()) {
            return self;
        }
        let (in_vacuum, inside) = (fresnel::dielectric(1.0, self.eta), fresnel::dielectric(1.0, eta));
        let share = if in_vacuum > 0.0 { inside / in_vacuum } else { 1.0 };
        let body = Body::Solid { spread: spread / outside };
        Self { eta, f0: (self.f0 * share).map(crate::unit), body, ..self }
    }

    /// Regularised as in [`crate::Bsdf::regularized`].
    #[must_use]
    pub fn regularized(self) -> Self {
        let alpha = self.coat.face().facets.regularized().alpha().x;
        Self { facets: self.facets.regularized(), coat: Clearcoat { alpha, ..self.coat }, ..self }
    }

    // Layers.

    fn has_layers(&self) -> bool {
        self.coat.weight > 0.0 || !self.sheen.is_none()
    }

    /// Whether transmission refracts.
    fn is_solid(&self) -> bool {
        self.transmission > 0.0 && matches!(self.body, Body::Solid { .. })
    }

    /// Whether the layers are on the side of a direction.
    fn covered(&self, w: LocalDir) -> bool {
        w.cos_theta() > 0.0 || !self.is_solid()
    }

    fn passes_fibres(&self, wo: LocalDir, wi: LocalDir) -> f32 {
        let one = |w| if self.covered(w) { self.sheen.passes(w) } else { 1.0 };
        if self.sheen.is_none() { 1.0 } else { one(wo).min(one(wi)) }
    }

    /// The transmission of the coat towards `wo`, or where that is inside a solid, towards `wi`.
    fn passes_coat(&self, wo: LocalDir, wi: LocalDir) -> f32 {
        if self.coat.weight == 0.0 {
            1.0
        } else if self.covered(wo) {
            1.0 - self.coat.share(wo)
        } else if self.covered(wi) {
            1.0 - self.coat.share(wi)
        } else {
            1.0
        }
    }

    // Fresnel terms.

    /// The relative index of the opaque dielectric, which is never seen from inside.
    fn opaque_eta(&self) -> f32 {
        self.eta.max(1.0 / self.eta).min(MAX_ETA)
    }

    /// Index of the other side over that of the side of `w`, for transmission.
    fn eta_across(&self, w: LocalDir) -> f32 {
        if !self.is_solid() {
            1.0
        } else if w.cos_theta() > 0.0 {
            self.eta
        } else {
            1.0 / self.eta
        }
    }

    /// The reflectance of the metal at a cosine.
    fn metal(&self, cos: f32) -> Spectrum {
        let bare = self.base.lerp(Spectrum::WHITE, schlick(cos));
        if self.film.weight == 0.0 {
            return bare;
        }
        bare.lerp(self.film.reflectance(cos, self.base), self.film.weight)
    }

    /// The reflectance of the dielectrics at a cosine, negative from the inside: interpolated between `f0` and
    /// `f90` as the exact Fresnel equations vary.
    fn dielectric(&self, cos: f32, eta: f32) -> Spectrum {
        let exact = fresnel::dielectric(cos, eta);
        if cos < 0.0 && exact == 1.0 {
            return Spectrum::WHITE;
        }
        let grazing = grazing_share(exact, eta);
        let between = |f0: Spectrum| f0.map(|f0| crate::unit(f0 + (self.f90 - f0) * grazing));
        let bare = between(self.f0);
        if self.film.weight == 0.0 {
            return bare;
        }
        let outside = if cos < 0.0 { (1.0 - (1.0 - cos * cos) * eta * eta).max(0.0).sqrt() } else { cos };
        // Never more than the Lambertian base assumes.
        let most = between(self.film.most(self.f0));
        let film = self.film.reflectance(outside, self.f0).zip(most, f32::min);
        bare.lerp(film, self.film.weight)
    }

    /// The albedo that the opaque dielectric withholds from its base, where perfect facets reflect `mirror` and
    /// dielectric ones `face`.
    fn kept(&self, mirror: f32, face: f32) -> Spectrum {
        let eta = self.opaque_eta();
        let head_on = fresnel::dielectric(1.0, eta);
        let grazing = ((face - head_on * mirror) / (1.0 - head_on)).max(0.0);
        let between = |f0: Spectrum| f0 * (mirror - grazing).max(0.0) + Spectrum::splat(self.f90 * grazing);
        let bare = between(self.f0);
        let kept = if self.film.weight == 0.0 {
            bare
        } else {
            bare.lerp(between(self.film.most(self.f0)), self.film.weight)
        };
        kept.map(crate::unit)
    }

    /// The indices of the channels of a solid, and how many differ: one without dispersion.
    fn lanes(&self) -> ([f32; 3], usize) {
        let spread = match self.body {
            Body::Solid { spread } => spread,
            Body::Thin => 0.0,
        };
        if spread == 0.0 {
            return ([self.eta; 3], 1);
        }
        ([self.eta - spread, self.eta, self.eta + spread].map(|eta| eta.max(1.001)), 3)
    }

    /// Reflection and transmission of a facet at a cosine, negative from below.
    fn shares(&self, cos: f32) -> Shares {
        let dielectric = 1.0 - self.metallic;
        let clear = dielectric * self.transmission;
        let mut reflects = Spectrum::BLACK;
        if self.metallic > 0.0 {
            reflects += self.metal(cos.abs()) * self.metallic;
        }
        if dielectric > clear {
            reflects += self.dielectric(cos.abs(), self.opaque_eta()) * (dielectric - clear);
        }
        if clear == 0.0 {
            return Shares { reflects, transmits: Spectrum::BLACK };
        }
        let clear_reflects = match (self.body, self.lanes()) {
            // R + T² R + T² R³ + … as for a thin pane of glass.
            (Body::Thin, _) => self.dielectric(cos.abs(), self.opaque_eta()).map(|r| 2.0 * r / (1.0 + r)),
            (Body::Solid { .. }, ([eta, ..], 1)) => self.dielectric(cos, eta),
            (Body::Solid { .. }, ([r, g, b], _)) => {
                Spectrum::new(self.dielectric(cos, r).r, self.dielectric(cos, g).g, self.dielectric(cos, b).b)
            }
        };
        reflects += clear_reflects * clear;
        let transmits = (Spectrum::WHITE - clear_reflects) * self.transmission_color * clear;
        Shares { reflects, transmits }
    }

    // Cosine-weighted parts: the Lambertian base, and multiple scattering between facets.

    /// The isotropic α for lookups in the tables.
    fn mean_alpha(&self) -> f32 {
        let alpha = self.facets.alpha();
        (alpha.x * alpha.y).sqrt().min(1.0)
    }

    fn is_stretched(&self) -> bool {
        let alpha = self.facets.alpha();
        alpha.x != alpha.y && alpha.max_element() > Stretched::LEAST
    }

    /// The single-scattering albedo of perfect facets; `alpha` is [`Self::mean_alpha`].
    fn mirror(&self, w: LocalDir, alpha: f32) -> f32 {
        if !self.is_stretched() {
            return ALBEDO.mirror(w.abs_cos_theta(), alpha);
        }
        STRETCHED.mirror(self.facets.alpha(), self.to_facets(w).vec())
    }

    /// The roughness in a direction: that of the most similar isotropic facets.
    fn alpha_towards(&self, w: LocalDir) -> f32 {
        let across = self.to_facets(w).vec().truncate();
        let length = across.length();
        if !self.is_stretched() || length == 0.0 {
            return self.mean_alpha();
        }
        (self.facets.alpha() * across / length).length().min(1.0)
    }

    /// The mean of a function of that roughness over all azimuths.
    fn mean_around(&self, f: impl Fn(f32) -> f32) -> f32 {
        if !self.is_stretched() {
            return f(self.mean_alpha());
        }
        const STEPS: u8 = 8;
        let each = (0..STEPS).map(|i| {
            let (sin, cos) = circle((f32::from(i) + 0.5) / f32::from(4 * STEPS));
            f((self.facets.alpha() * Vec2::new(cos, sin)).length().min(1.0))
        });
        each.sum::<f32>() / f32::from(STEPS)
    }

    /// The mean of [`Self::mirror`].
    fn mirror_mean(&self, alpha: f32) -> f32 {
        if self.is_stretched() { STRETCHED.mean(self.facets.alpha()) } else { ALBEDO.mirror_mean(alpha) }
    }

    /// f · |cos θi| of all that is sampled by the cosine, without the fibres.
    fn cosine_part(&self, wo: LocalDir, wi: LocalDir) -> Spectrum {
        let reflects = wo.same_hemisphere(wi);
        let alpha = self.mean_alpha();
        let dielectric = 1.0 - self.metallic;
        let opaque = dielectric * (1.0 - self.transmission);
        let rough = !self.facets.is_smooth();
        let mirror = |w: LocalDir| self.mirror(w, alpha);
        let mut sum = Spectrum::BLACK;
        if opaque > 0.0 && (reflects || self.diffuse_transmission > 0.0) {
            let eta = self.opaque_eta();
            let face = |w: LocalDir| ALBEDO.face(w.abs_cos_theta(), self.alpha_towards(w), eta);
            let kept = |w: LocalDir| self.kept(mirror(w), face(w));
            let mean =
                self.kept(self.mirror_mean(alpha), self.mean_around(|alpha| ALBEDO.face_mean(alpha, eta)));
            let white = given_back(kept(wo), kept(wi), mean);
            let color = if reflects {
                self.base * (1.0 - self.diffuse_transmission)
            } else {
                self.diffuse_transmission_color * (self.diffuse_transmission * self.spread_across(wo))
            };
            sum += white * color * opaque;
        }
        if rough && self.metallic > 0.0 && reflects {
            let mean = self.mirror_mean(alpha);
            let white =
                given_back(Spectrum::splat(mirror(wo)), Spectrum::splat(mirror(wi)), Spectrum::splat(mean));
            // The series of further bounces: F² E / (1 − F (1 − E)) of the first one's loss.
            let f = if self.film.weight == 0.0 {
                (self.base * 20.0 + Spectrum::WHITE) / 21.0
            } else {
                self.metal(2.0 / 3.0)
            };
            let further = f.map(|f| f * f * mean / (1.0 - f * (1.0 - mean)).max(1e-6));
            sum += white * further * self.metallic;
        }
        let clear = dielectric * self.transmission;
        if rough && clear > 0.0 {
            sum += self.clear_further_bounces(wo, wi, alpha) * clear;
        }
        sum * wi.abs_cos_theta()
    }

    /// The factor of η² on diffuse transmission into or out of a solid.
    fn spread_across(&self, wo: LocalDir) -> f32 {
        if !self.is_solid() {
            return 1.0;
        }
        let eta2 = self.eta * self.eta;
        let dense = eta2.min(1.0);
        if wo.cos_theta() > 0.0 { dense / eta2 } else { dense }
    }

    /// The share of multiple scattering between clear facets that is compensated: the tables are for plain
    /// glass, and facets with less reflection lose at least this share.
    fn plainness(&self) -> f32 {
        let head_on = fresnel::dielectric(1.0, self.eta);
        let (least, most) = (self.f0.min_component(), self.f0.max_component());
        let tint = if head_on > 0.0 { (least / head_on).min(head_on / most.max(1e-6)) } else { 1.0 };
        let in_tables = self.eta.max(1.0 / self.eta) <= MAX_ETA;
        tint.min(1.0) * self.f90 * (1.0 - self.film.weight) * f32::from(in_tables)
    }

    /// f of multiple scattering between clear facets.
    fn clear_further_bounces(&self, wo: LocalDir, wi: LocalDir, alpha: f32) -> Spectrum {
        let reflects = wo.same_hemisphere(wi);
        let tint = if reflects { Spectrum::WHITE } else { self.transmission_color };
        if self.body == Body::Thin {
            let loss = |w: LocalDir| 1.0 - self.mirror(w, alpha);
            let mean = (1.0 - self.mirror_mean(alpha)).max(1e-6);
            let once = ALBEDO.face_mean(0.0, self.opaque_eta());
            let pane = 2.0 * once / (1.0 + once);
            let share = if reflects { pane } else { 1.0 - pane };
            return tint * (share * loss(wo) * loss(wi) / mean * FRAC_1_PI);
        }
        let eta = self.eta;
        if (eta - 1.0).abs() < Self::NO_BORDER {
            return Spectrum::BLACK;
        }
        // Anisotropic facets lose at least as much as the smoother of their two roughnesses.
        let alpha = if self.is_stretched() { self.facets.alpha().min_element() } else { alpha };
        let loss =
            |w: LocalDir| (1.0 - ALBEDO.glass(w.abs_cos_theta(), alpha, eta, w.cos_theta() < 0.0)).max(0.0);
        let mean = |inside| (1.0 - ALBEDO.glass_mean(alpha, eta, inside)).max(0.0);
        // The losses of both sides are distributed over both so that the result is reciprocal: by the losses
        // times η².
        let both = (mean(false) + eta * eta * mean(true)).max(1e-6);
        let denser = if wo.cos_theta() > 0.0 { 1.0 } else { eta * eta };
        tint * (self.plainness() * loss(wo) * loss(wi) * denser / both * FRAC_1_PI)
    }

    // Facets.

    /// Below this difference of η from 1 there is no refraction.
    pub(crate) const NO_BORDER: f32 = 1e-3;

    fn to_facets(self, w: LocalDir) -> LocalDir {
        let Vec2 { x: c, y: s } = self.tangent;
        LocalDir(Vec3::new(c * w.0.x + s * w.0.y, c * w.0.y - s * w.0.x, w.0.z))
    }

    fn back_from_facets(&self, w: LocalDir) -> LocalDir {
        let Vec2 { x: c, y: s } = self.tangent;
        LocalDir(Vec3::new(c * w.0.x - s * w.0.y, s * w.0.x + c * w.0.y, w.0.z))
    }

    /// The modes of scattering from `wo` to `wi` (in the frame of the facets): a channel, or `None` for all,
    /// the interface, and `wi` as seen by it.
    fn ways(
        &self,
        wo: LocalDir,
        wi: LocalDir,
    ) -> impl Iterator<Item = (Option<usize>, Dielectric, LocalDir)> {
        let reflects = wo.same_hemisphere(wi);
        let (etas, lanes) = self.lanes();
        let thin = self.body == Body::Thin;
        let clear = self.transmission > 0.0 && self.metallic < 1.0;
        let count = if reflects || (thin && clear) {
            1
        } else if clear {
            lanes
        } else {
            0
        };
        let facets = self.facets;
        let through = !reflects && !thin;
        (0..count).filter_map(move |lane| {
            if !through {
                // For a reflection, any index other than 1 will do.
                let wi = if reflects { wi } else { flipped(wi) };
                return Some((None, Dielectric { eta: 1.5, facets }, wi));
            }
            let eta = etas[lane];
            let bends = (eta - 1.0).abs() >= Self::NO_BORDER;
            bends.then(|| ((lanes > 1).then_some(lane), Dielectric { eta, facets }, wi))
        })
    }

    fn eval_facets(&self, wo: LocalDir, wi: LocalDir) -> Spectrum {
        if self.facets.is_smooth() {
            return Spectrum::BLACK;
        }
        let reflects = wo.same_hemisphere(wi);
        let (wo, wi) = (self.to_facets(wo), self.to_facets(wi));
        let mut sum = Spectrum::BLACK;
        for (lane, border, wi) in self.ways(wo, wi) {
            let Some(facet) = border.facet(wo, wi) else { continue };
            let shares = self.shares(wo.lane().dot(facet.normal));
            let share = if reflects { shares.reflects } else { shares.transmits };
            sum += only(share, lane) * border.eval_facet(&facet, wo, wi);
        }
        sum
    }

    fn pdf_facets(&self, wo: LocalDir, wi: LocalDir) -> f32 {
        if self.facets.is_smooth() {
            return 0.0;
        }
        let reflects = wo.same_hemisphere(wi);
        let (wo, wi) = (self.to_facets(wo), self.to_facets(wi));
        let mut sum = 0.0;
        for (lane, border, wi) in self.ways(wo, wi) {
            let Some(facet) = border.facet(wo, wi) else { continue };
            let reflection = self.shares(wo.lane().dot(facet.normal)).reflection_probability();
            let way = if reflects { reflection } else { 1.0 - reflection };
            let lane = if lane.is_some() { 1.0 / 3.0 } else { 1.0 };
            sum += lane * way * self.facets.visible_density(wo.vec(), vector(facet.normal)) * facet.jacobian;
        }
        sum
    }

    fn sample_facets(&self, wo: LocalDir, lobe: f32, u: Vec2) -> Option<FacetSample> {
        let wo = self.to_facets(wo);
        let smooth = self.facets.is_smooth();
        let m = if smooth { Vec3::Z } else { self.facets.sample_visible(wo.vec(), u) };
        let shares = self.shares(wo.vec().dot(m));
        let reflection = shares.reflection_probability();
        let mirrored = || if smooth { wo.mirrored() } else { reflect(wo, m) };
        if lobe < reflection {
            let wi = mirrored();
            let delta = smooth.then(|| shares.reflects / reflection);
            return wo.same_hemisphere(wi).then(|| FacetSample {
                wi: self.back_from_facets(wi),
                delta,
                eta: None,
            });
        }
        let through = 1.0 - reflection;
        let (etas, lanes) = self.lanes();
        let lane = (((lobe - reflection) / through * lanes as f32) as usize).min(lanes - 1);
        let one_of = (lanes > 1).then_some(lane);
        let share = only(shares.transmits, one_of) * (lanes as f32 / through);
        let (wi, eta, delta) = if self.body == Body::Thin {
            (flipped(mirrored()), 1.0, smooth)
        } else if (etas[lane] - 1.0).abs() < Self::NO_BORDER {
            (-wo, 1.0, true)
        } else {
            let eta = if wo.cos_theta() > 0.0 { etas[lane] } else { 1.0 / etas[lane] };
            (refract(wo, m, eta)?, eta, smooth)
        };
        if wo.same_hemisphere(wi) {
            return None;
        }
        let delta = delta.then(|| share / (eta * eta));
        Some(FacetSample { wi: self.back_from_facets(wi), delta, eta: Some(eta) })
    }

    // Sampling.

    fn lobes(&self, wo: LocalDir) -> Lobes {
        let cos = wo.abs_cos_theta();
        let alpha = self.mean_alpha();
        let dielectric = 1.0 - self.metallic;
        let opaque = dielectric * (1.0 - self.transmission);
        let clear = dielectric * self.transmission;
        let shares = self.shares(wo.cos_theta());
        let coat = if self.covered(wo) { self.coat.share(wo) } else { 0.0 };
        let under = 1.0 - coat;
        let facets = under * (shares.reflects.max_component() + shares.transmits.max_component());
        let inside = {
            let face = self.dielectric(cos, self.opaque_eta());
            opaque * (1.0 - face.min_component())
        };
        let further = if self.facets.is_smooth() { 0.0 } else { 1.0 - self.mirror(wo, alpha) };
        let fibres =
            if self.covered(wo) { self.sheen.color.max_component() * self.sheen.share(wo) } else { 0.0 };
        let near = inside * self.base.max_component() * (1.0 - self.diffuse_transmission)
            + further * (self.metallic + 0.5 * clear)
            + fibres;
        let far = inside * self.diffuse_transmission_color.max_component() * self.diffuse_transmission
            + further * 0.5 * clear;
        // No existing part may have a tiny probability, however faint from here.
        let total = coat + facets + under * (near + far);
        let least = |share: f32, there: bool| if there { share.max(0.05 * total).max(1e-4) } else { 0.0 };
        let rough = !self.facets.is_smooth();
        let coat = least(coat, coat > 0.0);
        let facets = least(facets, facets > 0.0);
        let near_there =
            opaque > 0.0 || !self.sheen.is_none() || rough && (self.metallic > 0.0 || clear > 0.0);
        let near = least(under * near, near_there);
        let far = least(under * far, opaque * self.diffuse_transmission > 0.0 || rough && clear > 0.0);
        let sum = coat + facets + near + far;
        Lobes { coat: coat / sum, facets: facets / sum, near: near / sum, far: far / sum }
    }
}

/// A direction sampled from the facets.
struct FacetSample {
    wi: LocalDir,
    /// The weight of a delta.
    delta: Option<Spectrum>,
    /// η of the other side over that of this side, for transmission.
    eta: Option<f32>,
}

/// Whether a direction is on a side of the surface, not in it.
fn sided(w: LocalDir) -> bool {
    w.abs_cos_theta() > 0.0
}

/// The direction mirrored to the other side of the surface.
fn flipped(w: LocalDir) -> LocalDir {
    LocalDir(Vec3::new(w.0.x, w.0.y, -w.0.z))
}

/// The colour with all channels but one set to zero.
fn only(color: Spectrum, lane: Option<usize>) -> Spectrum {
    match lane {
        None => color,
        Some(0) => Spectrum::new(color.r, 0.0, 0.0),
        Some(1) => Spectrum::new(0.0, color.g, 0.0),
        Some(_) => Spectrum::new(0.0, 0.0, color.b),
    }
}

/// Schlick, "An Inexpensive BRDF Model for Physically-based Rendering", Eurographics 1994: the weight of white.
fn schlick(cos: f32) -> f32 {
    (1.0 - crate::unit(cos)).powi(5)
}

/// The exact Fresnel term as a fraction between normal incidence and grazing incidence, where it is 1.
fn grazing_share(exact: f32, eta: f32) -> f32 {
    let head_on = fresnel::dielectric(1.0, eta);
    (exact - head_on) / (1.0 - head_on)
}

/// f of a white Lambertian with albedo 1 − kept(wo), reciprocal.
fn given_back(kept_o: Spectrum, kept_i: Spectrum, kept_mean: Spectrum) -> Spectrum {
    let rest = |kept: Spectrum| Spectrum::WHITE - kept;
    let mean = rest(kept_mean).map(|rest| rest.max(1e-6));
    let product = rest(kept_o) * rest(kept_i) * FRAC_1_PI;
    product.zip(mean, |product, mean| product / mean)
}
