//! The parameters of the principled material, as functions of place.

use std::sync::Arc;

use lumbre_math::{Elementary, Vec2, direction_at};

use crate::albedo::MAX_ETA;
use crate::material::albedo;
use crate::medium::{HomogeneousMedium, albedo_of_many_collisions};
use crate::microfacet::Microfacets;
use crate::principled::{Body, Clearcoat, Principled};
use crate::sheen::Sheen;
use crate::spectrum::Wavelengths;
use crate::thin_film::{ThinFilm, index_of};
use crate::{FloatTexture, ImageTexture, Spectrum, SpectrumTexture, Texture, TextureContext, fresnel};

/// The lines of helium and hydrogen by which glass is catalogued.
const D_LINE_NM: f32 = 587.6;
const F_LINE_NM: f32 = 486.1;
const C_LINE_NM: f32 = 656.3;

/// Which convention parameters follow where the two families differ.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Convention {
    /// glTF 2.0: anisotropy widens α along the tangent from roughness² up to 1; transmission is multiplied by
    /// the base colour at each crossing of the surface.
    Gltf,
    /// glTF's older specular-glossiness model (KHR_materials_pbrSpecularGlossiness): as glTF, and the base colour is
    /// multiplied by 1 − the greatest channel of the specular colour.
    SpecularGlossiness,
    /// Burley, "Physically Based Shading at Disney", SIGGRAPH course 2012, and its extension of 2015, as in
    /// Mitsuba 3's `principled`: anisotropy a makes α = roughness² / s and roughness² · s with s = √(1 − 0.9
    /// a); transmission into a solid is multiplied by the square root of the base colour, so that two crossings
    /// give the whole colour.
    Burley,
}

/// The interior of a solid (KHR_materials_volume).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VolumeParams {
    /// The colour of white light after [`VolumeParams::attenuation_distance`], in [0, 1]. Default white.
    pub attenuation_color: Spectrum,
    /// In world-space units, > 0. Default infinite: no attenuation.
    pub attenuation_distance: f32,
    /// The multiple-scattering colour of a deep solid, in [0, 1] (`multiscatterColor`). Default black:
    /// absorption only.
    pub scatter_color: Spectrum,
    /// Henyey–Greenstein asymmetry of the scattering, in (−1, 1) (`scatterAnisotropy`). Default 0.
    pub scatter_anisotropy: f32,
}

impl Default for VolumeParams {
    fn default() -> Self {
        Self {
            attenuation_color: Spectrum::WHITE,
            attenuation_distance: f32::INFINITY,
            scatter_color: Spectrum::BLACK,
            scatter_anisotropy: 0.0,
        }
    }
}

/// Parameters of [`Principled`] as functions of position. Names, ranges and defaults are those of core glTF 2.0
/// and of its extensions (Khronos, 2021 to 2024), given in brackets; values are clamped to their ranges.
/// Construct one by `PrincipledParams { …, ..PrincipledParams::default() }`.
#[derive(Clone, Debug)]
pub struct PrincipledParams {
    /// The convention. Default glTF's.
    pub convention: Convention,
    /// Colour of the metal, and of the base of the dielectric. In [0, 1]; default white.
    pub base_color: Arc<SpectrumTexture>,
    /// From 0, a dielectric, to 1, a metal. Default 1, as in glTF.
    pub metallic: Arc<FloatTexture>,
    /// In [0, 1]; α of the facets is its square. Default 1.
    pub roughness: Arc<FloatTexture>,
    /// Anisotropy of the reflection, in [0, 1] (KHR_materials_anisotropy). Default 0.
    pub anisotropy: Arc<FloatTexture>,
    /// Rotation of the direction of anisotropy from the tangent towards the bitangent, in radians. Default 0.
    pub anisotropy_rotation: f32,
    /// glTF's anisotropy texture: red and green are the direction from [-1, 1] mapped to [0, 1], rotated by the
    /// rotation, and blue is a factor on the strength. Default none.
    pub anisotropy_texture: Option<Arc<SpectrumTexture>>,
    /// Index of refraction of the dielectric (KHR_materials_ior). Positive; default 1.5. 0 makes the
    /// reflectance at normal incidence the specular colour itself.
    pub ior: f32,
    /// A factor on all reflection of the dielectric's interface, in [0, 1] (KHR_materials_specular). Default 1.
    pub specular: Arc<FloatTexture>,
    /// A factor on its reflectance at normal incidence, ≥ 0; the product is clamped to 1. Default white.
    pub specular_color: Arc<SpectrumTexture>,
    /// The share of the base colour's hue in that factor, in [0, 1] (Burley's). Default 0.
    pub specular_tint: Arc<FloatTexture>,
    /// The clear share of the dielectric, in [0, 1] (KHR_materials_transmission). Default 0.
    pub transmission: Arc<FloatTexture>,
    /// 20 over the Abbe number of the clear solid (KHR_materials_dispersion), ≥ 0. Default 0: no dispersion.
    pub dispersion: f32,
    /// The interior behind the clear surface (KHR_materials_volume); `None`, the default, is a thin pane, as
    /// glTF's `thicknessFactor` of 0.
    pub volume: Option<VolumeParams>,
    /// The share of the dielectric's Lambertian light that is transmitted, in [0, 1]
    /// (KHR_materials_diffuse_transmission). Default 0.
    pub diffuse_transmission: Arc<FloatTexture>,
    /// A factor on that, in [0, 1]. Default white.
    pub diffuse_transmission_color: Arc<SpectrumTexture>,
    /// The share covered by a clear coat of index 1.5, in [0, 1] (KHR_materials_clearcoat). Default 0.
    pub clearcoat: Arc<FloatTexture>,
    /// The coat's roughness, in [0, 1]; α is the square. Default 0.
    pub clearcoat_roughness: Arc<FloatTexture>,
    /// The coat's index of refraction, at least 1. Default 1.5.
    pub clearcoat_ior: f32,
    /// The colour of light that passes the coat twice along its normal, in [0, 1] (OpenPBR's `coat_color`). Default
    /// white.
    pub clearcoat_color: Arc<SpectrumTexture>,
    /// How much light that the coat reflects back down darkens the base, in [0, 1] (OpenPBR's `coat_darkening`).
    /// Default 0.
    pub clearcoat_darkening: f32,
    /// The coat's tangent-space normal map. Default none: the surface without the base's bump map.
    pub clearcoat_normal: Option<ImageTexture>,
    /// Strength and colour of fibres on the base, in [0, 1] (KHR_materials_sheen). Default black: none.
    pub sheen_color: Arc<SpectrumTexture>,
    /// The share of the base colour's hue in that, in [0, 1] (Burley's). Default 0.
    pub sheen_tint: Arc<FloatTexture>,
    /// Roughness of the fibres, in [0, 1], at least [`Sheen::MIN_ROUGHNESS`]. Default 0.
    pub sheen_roughness: Arc<FloatTexture>,
    /// The share covered by a thin film, in [0, 1] (KHR_materials_iridescence). Default 0.
    pub iridescence: Arc<FloatTexture>,
    /// Index of refraction of the film, ≥ 1. Default 1.3.
    pub iridescence_ior: f32,
    /// Thickness of the film in nanometres, ≥ 0. Default 400. (glTF's texture interpolates between a minimum
    /// and a maximum: a [`Texture::Mix`] of the two.)
    pub iridescence_thickness: Arc<FloatTexture>,
}

impl Default for PrincipledParams {
    fn default() -> Self {
        let (zero, one) = (number(0.0), number(1.0));
        let white = Arc::new(SpectrumTexture::Constant(Spectrum::WHITE));
        Self {
            convention: Convention::Gltf,
            base_color: white.clone(),
            metallic: one.clone(),
            roughness: one.clone(),
            anisotropy: zero.clone(),
            anisotropy_rotation: 0.0,
            anisotropy_texture: None,
            ior: 1.5,
            specular: one,
            specular_color: white.clone(),
            specular_tint: zero.clone(),
            transmission: zero.clone(),
            dispersion: 0.0,
            volume: None,
            diffuse_transmission: zero.clone(),
            diffuse_transmission_color: white.clone(),
            clearcoat: zero.clone(),
            clearcoat_roughness: zero.clone(),
            clearcoat_ior: Clearcoat::ETA,
            clearcoat_color: white,
            clearcoat_darkening: 0.0,
            clearcoat_normal: None,
            sheen_color: Arc::new(SpectrumTexture::Constant(Spectrum::BLACK)),
            sheen_tint: zero.clone(),
            sheen_roughness: zero.clone(),
            iridescence: zero,
            iridescence_ior: 1.3,
            iridescence_thickness: number(400.0),
        }
    }
}

impl PrincipledParams {
    /// From glTF's older specular-glossiness model (KHR_materials_pbrSpecularGlossiness): a dielectric with
    /// this diffuse colour, reflectance `specular` at normal incidence and roughness 1 − `glossiness`. The
    /// diffuse colour is multiplied by 1 − the greatest channel of `specular`, so that metals need no detection.
    pub fn from_specular_glossiness(
        diffuse: Arc<SpectrumTexture>,
        specular: Arc<SpectrumTexture>,
        glossiness: Arc<FloatTexture>,
    ) -> Self {
        let ends = [number(1.0), number(0.0)];
        Self {
            base_color: diffuse,
            metallic: number(0.0),
            roughness: Arc::new(Texture::Mix { textures: ends, amount: glossiness }),
            ior: 0.0,
            specular_color: specular,
            convention: Convention::SpecularGlossiness,
            ..Self::default()
        }
    }

    /// The index of refraction with a reflectance at normal incidence of 0.08 times Burley's `specular` in [0,
    /// 1].
    pub fn ior_from_specular(specular: f32) -> f32 {
        index_of(0.08 * crate::unit(specular))
    }

    /// The roughness of a coat for Burley's `clearcoat_gloss` in [0, 1]: α from 0.1 down to 0.001.
    pub fn roughness_from_gloss(gloss: f32) -> f32 {
        let gloss = crate::unit(gloss);
        (0.1 * (1.0 - gloss) + 0.001 * gloss).sqrt()
    }

    /// Whether it is uniform.
    pub(crate) fn is_uniform(&self) -> bool {
        let colors = [
            &self.base_color,
            &self.specular_color,
            &self.diffuse_transmission_color,
            &self.sheen_color,
            &self.clearcoat_color,
        ];
        let numbers = [
            &self.metallic,
            &self.roughness,
            &self.anisotropy,
            &self.specular,
            &self.specular_tint,
            &self.transmission,
            &self.diffuse_transmission,
            &self.clearcoat,
            &self.clearcoat_roughness,
            &self.sheen_tint,
            &self.sheen_roughness,
            &self.iridescence,
            &self.iridescence_thickness,
        ];
        colors.into_iter().all(|texture| texture.is_constant())
            && numbers.into_iter().all(|texture| texture.is_constant())
            && self.anisotropy_texture.is_none()
            && self.clearcoat_normal.is_none()
    }

    /// The index of refraction inside; see [`crate::Material::interior_index`].
    pub(crate) fn interior_index(&self) -> Option<f32> {
        (self.volume.is_some() && self.is_transmissive())
            .then(|| if self.ior > 0.0 && self.ior.is_finite() { self.ior } else { 1.5 })
    }

    /// Whether light is transmitted anywhere.
    pub fn is_transmissive(&self) -> bool {
        let opens = |texture: &FloatTexture| !matches!(texture, Texture::Constant(v) if *v <= 0.0);
        opens(&self.transmission) || opens(&self.diffuse_transmission)
    }

    /// Whether it, or its coat, may be smooth anywhere.
    pub(crate) fn may_be_specular(&self) -> bool {
        let is_rough = |texture: &FloatTexture| is_constantly(texture, is_rough);
        !is_rough(&self.roughness)
            || !(is_rough(&self.clearcoat_roughness) || is_constantly(&self.clearcoat, |v| v <= 0.0))
    }

    /// Whether any light may be transmitted straight on; see [`crate::Material::has_delta_transmission`].
    pub(crate) fn has_delta_transmission(&self) -> bool {
        if is_constantly(&self.transmission, |v| v <= 0.0) || is_constantly(&self.metallic, |v| v >= 1.0) {
            return false;
        }
        match self.interior_index() {
            Some(index) => (index - 1.0).abs() < Principled::NO_BORDER,
            // Anisotropy only makes it rougher.
            None => !is_constantly(&self.roughness, is_rough),
        }
    }

    /// σ of the Beer–Lambert law inside, per unit of length; see [`crate::Material::interior_attenuation`]. A
    /// channel of 0 counts as a millionth.
    pub fn interior_attenuation(&self, wavelengths: Option<&Wavelengths>) -> Option<Spectrum> {
        self.interior_index()?;
        let volume = self.volume?;
        let distance = volume.attenuation_distance.max(f32::MIN_POSITIVE);
        let left = wavelengths.map_or(volume.attenuation_color, |w| w.reflectance(volume.attenuation_color));
        let sigma = left.map(|left| -crate::unit(left).max(1e-6).logarithm() / distance);
        (sigma.is_finite() && !sigma.is_black()).then_some(sigma)
    }

    /// The medium inside, if it scatters light; see [`crate::Material::interior_medium`].
    pub fn interior_medium(&self, wavelengths: Option<&Wavelengths>) -> Option<HomogeneousMedium> {
        let extinction = self.interior_attenuation(wavelengths)?;
        let volume = self.volume.filter(|volume| !volume.scatter_color.is_black())?;
        let g = volume.scatter_anisotropy;
        let asymmetry = if g.is_nan() { 0.0 } else { g.clamp(-0.999, 0.999) };
        let scattered = wavelengths.map_or(volume.scatter_color, |w| w.reflectance(volume.scatter_color));
        let albedo = scattered.map(|c| albedo_of_many_collisions(c, asymmetry));
        Some(HomogeneousMedium { extinction, albedo, asymmetry })
    }

    /// The BSDF at a position. Its coat is along the shading normal until [`crate::Material::shading`] orients
    /// it.
    pub fn bsdf(&self, at: &TextureContext) -> Principled {
        // Tints and strengths come from colours: wavelengths come in at the end.
        let Some(spectral) = &at.spectral else { return self.bsdf_in_rgb(at) };
        let is_uniform = self.is_uniform();
        let colour = |c: Spectrum| if is_uniform { spectral.constant(c) } else { spectral.varied(c) };
        let bsdf = self.bsdf_in_rgb(&at.in_rgb());
        let (eta, body) = match bsdf.body {
            // The index of the hero wavelength, of a glass of Cauchy's.
            Body::Solid { spread } if spread > 0.0 => {
                let inverse_square = |nm: f32| 1.0 / (nm * nm);
                let between_lines = inverse_square(F_LINE_NM) - inverse_square(C_LINE_NM);
                let away = inverse_square(spectral.wavelengths.nm()[0]) - inverse_square(D_LINE_NM);
                (bsdf.eta + 2.0 * spread * away / between_lines, Body::Solid { spread: 0.0 })
            }
            body => (bsdf.eta, body),
        };
        Principled {
            base: colour(bsdf.base),
            f0: colour(bsdf.f0),
            transmission_color: colour(bsdf.transmission_color),
            diffuse_transmission_color: colour(bsdf.diffuse_transmission_color),
            film: ThinFilm { nm: spectral.wavelengths.nm(), ..bsdf.film },
            sheen: bsdf.sheen.coloured(colour(bsdf.sheen.color)),
            coat: Clearcoat { color: colour(bsdf.coat.color), ..bsdf.coat },
            eta,
            body,
            ..bsdf
        }
    }

    /// Whether it has another index for each wavelength.
    pub(crate) fn disperses(&self) -> bool {
        self.dispersion > 0.0 && self.interior_index().is_some()
    }

    fn bsdf_in_rgb(&self, at: &TextureContext) -> Principled {
        let share = |texture: &FloatTexture| crate::unit(texture.evaluate(at));
        let base = albedo(self.base_color.evaluate(at));
        let (metallic, transmission) = (share(&self.metallic), share(&self.transmission));
        let (facets, tangent) = self.facets(at);
        let f90 = share(&self.specular);
        let tint = hue(base, share(&self.specular_tint));
        let specular_color = self.specular_color.evaluate(at).map(|c| c.max(0.0)) * tint;
        let base = match self.convention {
            Convention::SpecularGlossiness => base * (1.0 - crate::unit(specular_color.max_component())),
            Convention::Gltf | Convention::Burley => base,
        };
        let (eta, bare) = if self.ior > 0.0 && self.ior.is_finite() {
            (self.ior, fresnel::dielectric(1.0, self.ior))
        } else if transmission > 0.0 {
            (1.5, 1.0)
        } else {
            (index_of(crate::unit(specular_color.max_component())), 1.0)
        };
        let weight = share(&self.clearcoat);
        let roughness = if weight > 0.0 { share(&self.clearcoat_roughness) } else { 0.0 };
        let coat = if weight > 0.0 {
            Clearcoat {
                weight,
                alpha: roughness * roughness,
                eta: if self.clearcoat_ior >= 1.0 { self.clearcoat_ior.min(MAX_ETA) } else { 1.0 },
                color: albedo(self.clearcoat_color.evaluate(at)),
                darkening: crate::unit(self.clearcoat_darkening),
                ..Clearcoat::NONE
            }
        } else {
            Clearcoat::NONE
        };
        let sheen = self.sheen_color.evaluate(at);
        let sheen = if sheen.is_black() {
            Sheen::NONE
        } else {
            Sheen::new(sheen * hue(base, share(&self.sheen_tint)), self.sheen_roughness.evaluate(at))
        };
        let film = share(&self.iridescence);
        let film = if film == 0.0 {
            ThinFilm::NONE
        } else {
            let thickness = self.iridescence_thickness.evaluate(at).max(0.0);
            let eta = if self.iridescence_ior > 1.0 { self.iridescence_ior.min(10.0) } else { 1.0 };
            ThinFilm { weight: film, eta, thickness: thickness.min(1e6), ..ThinFilm::NONE }
        };
        // 20 over the Abbe number V, and V = (η − 1) / (η of blue − η of red): half of that difference.
        let spread = 0.5 * (eta - 1.0).max(0.0) * self.dispersion.max(0.0) / 20.0;
        let body = match self.volume {
            None => Body::Thin,
            Some(_) => Body::Solid { spread: if spread < 1e-4 { 0.0 } else { spread } },
        };
        let rooted = self.convention == Convention::Burley && self.volume.is_some();
        Principled {
            base,
            metallic,
            facets,
            tangent,
            eta,
            f0: (specular_color * bare).map(crate::unit) * f90,
            f90,
            transmission,
            transmission_color: if rooted { base.map(f32::sqrt) } else { base },
            body,
            diffuse_transmission: share(&self.diffuse_transmission),
            diffuse_transmission_color: albedo(self.diffuse_transmission_color.evaluate(at)),
            film,
            sheen,
            coat,
        }
    }

    /// The facets of the base, and their direction of anisotropy.
    fn facets(&self, at: &TextureContext) -> (Microfacets, Vec2) {
        let roughness = crate::unit(self.roughness.evaluate(at));
        let alpha = roughness * roughness;
        let mut strength = crate::unit(self.anisotropy.evaluate(at));
        if strength == 0.0 {
            return (Microfacets::new(alpha, alpha), Vec2::X);
        }
        let mut tangent = direction_at(f64::from(self.anisotropy_rotation)).as_vec2();
        if let Some(texture) = &self.anisotropy_texture {
            let texel = texture.evaluate(at);
            strength *= crate::unit(texel.b);
            let direction = Vec2::new(2.0 * texel.r - 1.0, 2.0 * texel.g - 1.0);
            tangent = tangent.rotate(direction.normalize_or(Vec2::X));
        }
        let tangent = tangent.normalize_or(Vec2::X);
        let facets = match self.convention {
            Convention::Gltf | Convention::SpecularGlossiness => {
                Microfacets::new(alpha + (1.0 - alpha) * strength * strength, alpha)
            }
            Convention::Burley => {
                let aspect = (1.0 - 0.9 * strength).sqrt();
                Microfacets::new((alpha / aspect).min(1.0), alpha * aspect)
            }
        };
        (facets, tangent)
    }
}

/// White, tinted by `amount` of a colour's hue: that colour over its luminance.
fn hue(color: Spectrum, amount: f32) -> Spectrum {
    let luminance = color.luminance();
    if amount == 0.0 || luminance <= 0.0 {
        return Spectrum::WHITE;
    }
    Spectrum::WHITE.lerp(color / luminance, amount)
}

/// Whether a texture is a number that meets a condition.
fn is_constantly(texture: &FloatTexture, is: fn(f32) -> bool) -> bool {
    matches!(texture, Texture::Constant(v) if is(*v))
}

/// Whether facets of this roughness are not smooth.
fn is_rough(roughness: f32) -> bool {
    !Microfacets::new(roughness * roughness, roughness * roughness).is_smooth()
}

fn number(v: f32) -> Arc<FloatTexture> {
    Arc::new(Texture::Constant(v))
}
