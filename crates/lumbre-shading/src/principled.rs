//! One layered surface for all parameters of glTF and of the principled materials.

use lumbre_math::{Elementary, Vec2, Vec3};
use lumbre_simd::V3;

use crate::albedo::ALBEDO;
use crate::dielectric::Dielectric;
use crate::lanes::{LaneBsdf, Row, colour_lane, lane, spectrum, square};
use crate::microfacet::Microfacets;
use crate::principled_lanes::{ClearcoatLanes, PrincipledLanes};
use crate::sheen::Sheen;
use crate::specular::Specular;
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

/// A transparent lacquer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clearcoat {
    /// The share of the surface that it covers, in [0, 1].
    pub weight: f32,
    /// α of its roughness, in [0, 1].
    pub alpha: f32,
    /// Its normal in the shading frame: unit, z > 0.
    pub normal: Vec3,
    /// Its index of refraction, 1 or more.
    pub eta: f32,
    /// The colour of what passes it twice along its normal, in [0, 1]; oblique light passes more of it.
    pub color: Spectrum,
    /// How much of the light that the lacquer reflects back down darkens the base, in [0, 1]: none at 0. White stays
    /// white.
    pub darkening: f32,
    /// The α of the base before it was regularised, if it was: a coat darkens both alike.
    pub base_alpha: Option<f32>,
}

impl Clearcoat {
    /// The index of refraction of most lacquers.
    pub const ETA: f32 = 1.5;

    /// No coat.
    pub const NONE: Self = Self {
        weight: 0.0,
        alpha: 0.0,
        normal: Vec3::Z,
        eta: Self::ETA,
        color: Spectrum::WHITE,
        darkening: 0.0,
        base_alpha: None,
    };

    fn face(&self) -> Dielectric {
        Dielectric { eta: self.eta, facets: Microfacets::new(self.alpha, self.alpha) }
    }

    /// Half of what it absorbs along its normal, as the exponent of Beer and Lambert's law.
    fn absorption(&self) -> Spectrum {
        self.color.map(|c| if c < 1.0 { -0.5 * c.max(1e-6).logarithm() } else { 0.0 })
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
        spectrum(self.lane().eval(wo.lane(), wi.lane()).0)
    }

    /// The density of [`Principled::sample`] without its delta parts.
    pub fn pdf(&self, wo: LocalDir, wi: LocalDir) -> f32 {
        self.lane().eval(wo.lane(), wi.lane()).1
    }

    /// A direction sampled from the coat, by reflection or refraction at the facets, or by the cosine.
    pub fn sample(&self, wo: LocalDir, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        self.lane().sample(wo.lane(), lobe, square(u)).scalar()
    }

    /// Every delta part with its own weight: the one that [`Principled::sample`] gives times the probability of
    /// choosing it. Rough facets without refraction transmit straight on; they count by the facet of u = 0.
    pub(crate) fn specular(&self, wo: LocalDir) -> Specular {
        let all = self.lane();
        let lobes = all.lobes(wo.lane());
        let reflection = all.shares(wo.cos_theta()).reflection_probability();
        let ways = all.ways_through();
        let through = (1.0 - reflection) / ways;
        let facets = |start: f32, share: f32| (lobes.coat + lobes.facets * start, lobes.facets * share);
        let ways = (0..ways as usize).map(|way| facets(reflection + through * way as f32, through));
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
        self.lane().is_delta()
    }

    /// An estimate of its albedo at normal incidence.
    pub fn albedo_estimate(&self) -> Spectrum {
        let all = self.lane();
        let metal = spectrum(all.metal(1.0));
        let face = spectrum(all.dielectric(1.0, [all.opaque_eta(); 3]));
        let diffuse = self.base * (1.0 - self.diffuse_transmission)
            + self.diffuse_transmission_color * self.diffuse_transmission;
        let through = Spectrum::WHITE - face;
        let plastic = face + through * diffuse;
        let clear = face + through * self.transmission_color;
        let base = metal.lerp(plastic.lerp(clear, self.transmission), 1.0 - self.metallic);
        let normal = V3::new(0.0, 0.0, 1.0);
        let coat = all.coat.share(normal);
        base * spectrum(all.under_coat(normal, normal)) + Spectrum::splat(coat)
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
        let base_alpha = Some(self.base_alpha());
        let coat = Clearcoat { alpha, base_alpha, ..self.coat };
        Self { facets: self.facets.regularized(), coat, ..self }
    }

    /// Below this difference of η from 1 there is no refraction.
    pub(crate) const NO_BORDER: f32 = 1e-3;

    /// The factor by which light that a coat reflects back down darkens the base: OpenPBR Surface 1.1 (Academy Software
    /// Foundation, 2024), "Coat darkening". A share K of what leaves the base comes back, of which the base reflects
    /// its albedo E: what remains of the first reflection is (1 − K) / (1 − E K).
    fn darkened(&self) -> Spectrum {
        let Clearcoat { weight, eta, darkening, .. } = self.coat;
        if weight == 0.0 || darkening == 0.0 {
            return Spectrum::WHITE;
        }
        let diffuse = self.base * (1.0 - self.diffuse_transmission)
            + self.diffuse_transmission_color * self.diffuse_transmission;
        let through = Spectrum::WHITE - self.f0;
        let plastic = self.f0 + through * diffuse;
        let clear = self.f0 + through * self.transmission_color;
        let albedo = self.base.lerp(plastic.lerp(clear, self.transmission), 1.0 - self.metallic);
        // Even light comes back by total reflection too; what a mirror sends up is reflected as it came in.
        let mirrored = ALBEDO.face_mean(0.0, eta);
        let even = 1.0 - (1.0 - mirrored) / (eta * eta);
        let diffuse_share = (1.0 - self.metallic) * (1.0 - self.transmission);
        let rough = diffuse_share + (1.0 - diffuse_share) * self.base_alpha().min(1.0).sqrt();
        let back = mirrored + (even - mirrored) * rough;
        albedo.map(|e| {
            let left = (1.0 - back) / (1.0 - crate::unit(e) * back);
            1.0 + (left - 1.0) * darkening
        })
    }

    /// The roughness of the base by which a coat darkens it.
    fn base_alpha(&self) -> f32 {
        self.coat.base_alpha.unwrap_or(self.facets.alpha().x)
    }

    fn spread(&self) -> f32 {
        match self.body {
            Body::Solid { spread } => spread,
            Body::Thin => 0.0,
        }
    }

    fn lane(&self) -> PrincipledLanes<f32> {
        PrincipledLanes {
            base: colour_lane(self.base),
            metallic: self.metallic,
            facets: self.facets.lane(),
            tangent: square(self.tangent),
            eta: self.eta,
            f0: colour_lane(self.f0),
            f90: self.f90,
            transmission: self.transmission,
            transmission_color: colour_lane(self.transmission_color),
            thin: self.body == Body::Thin,
            spread: self.spread(),
            diffuse_transmission: self.diffuse_transmission,
            diffuse_transmission_color: colour_lane(self.diffuse_transmission_color),
            film: self.film.lane(),
            sheen: self.sheen.lane(),
            coat: ClearcoatLanes {
                weight: self.coat.weight,
                alpha: self.coat.alpha,
                normal: lane(self.coat.normal),
                eta: self.coat.eta,
                absorption: colour_lane(self.coat.absorption()),
                darkened: colour_lane(self.darkened()),
            },
        }
    }

    /// The row that [`PrincipledLanes`] loads.
    pub(crate) fn row(&self) -> Row {
        let alpha = self.facets.alpha();
        let mut row = Row::from_slice(&self.base.to_array());
        row.extend([self.metallic, alpha.x, alpha.y, self.tangent.x, self.tangent.y, self.eta]);
        row.extend(self.f0.to_array());
        row.extend([self.f90, self.transmission]);
        row.extend(self.transmission_color.to_array());
        row.extend([f32::from(self.body == Body::Thin), self.spread(), self.diffuse_transmission]);
        row.extend(self.diffuse_transmission_color.to_array());
        row.extend([self.film.weight, self.film.eta, self.film.thickness]);
        row.extend(self.sheen.color.to_array());
        row.extend([self.sheen.roughness(), self.coat.weight, self.coat.alpha]);
        row.extend(self.coat.normal.to_array());
        row.extend(self.film.nm);
        row.push(self.coat.eta);
        row.extend(self.coat.absorption().to_array());
        row.extend(self.darkened().to_array());
        row
    }
}
