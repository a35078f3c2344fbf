//! Material `openpbr`: the parameters of OpenPBR Surface 1.1 (Academy Software Foundation, 2024) by their names, as far
//! as the layers of the principled material have them.

use std::sync::Arc;

use lumbre_image::Rgb;
use lumbre_shading::subsurface::{Inside, SubsurfaceParams};
use lumbre_shading::{Convention, MaterialKind, PrincipledParams, Roughness, Texture, VolumeParams};

use super::convert::{Converter, FloatArc, SpectrumArc};
use super::params::Params;
use super::source::Result;
use super::textures::{SpectrumUse, single};
use crate::diagnostic::quoted;

/// Parameters of what is not rendered, with the value that changes nothing.
const LEFT_OUT: [(&str, f32); 5] = [
    ("base_diffuse_roughness", 0.0),
    ("transmission_scatter_anisotropy", 0.0),
    ("coat_roughness_anisotropy", 0.0),
    ("emission_luminance", 0.0),
    ("geometry_opacity", 1.0),
];

/// What says more of what is not rendered: without effect on its own.
const DETAILS: [&str; 1] = ["emission_color"];

/// What says more of the body that light enters: without effect unless it does.
const OF_BODY: [&str; 4] =
    ["subsurface_color", "subsurface_radius", "subsurface_radius_scale", "subsurface_scatter_anisotropy"];

/// What lies above the base or takes its place: not with a body that light enters.
const NOT_OF_BODY: [(&str, f32); 7] = [
    ("base_metalness", 0.0),
    ("specular_weight", 1.0),
    ("specular_roughness_anisotropy", 0.0),
    ("transmission_weight", 0.0),
    ("coat_weight", 0.0),
    ("fuzz_weight", 0.0),
    ("thin_film_weight", 0.0),
];

/// What says more of those, and of the base that a body takes the place of.
const DETAILS_OF_OTHERS: [&str; 16] = [
    "base_color",
    "base_weight",
    "specular_color",
    "transmission_color",
    "transmission_depth",
    "transmission_dispersion_scale",
    "transmission_dispersion_abbe_number",
    "coat_color",
    "coat_roughness",
    "coat_ior",
    "coat_darkening",
    "fuzz_color",
    "fuzz_roughness",
    "thin_film_thickness",
    "thin_film_ior",
    "geometry_thin_walled",
];

impl Converter<'_, '_> {
    pub fn openpbr(&mut self, params: &Params) -> Result<MaterialKind> {
        for (name, plain) in LEFT_OUT {
            if params.has(name) && single(params, name, plain)? != plain {
                let message = format!("{} of an openpbr material is left out", quoted(name));
                self.note(params.spot_of(name), message);
            }
        }
        params.ignore(&DETAILS);
        let scatter = self.spectrum_texture(params, "transmission_scatter", SpectrumUse::Reflectance)?;
        if scatter.is_some_and(|given| given.value() != Some(Rgb::BLACK)) {
            let message = "\"transmission_scatter\" of an openpbr material is left out";
            self.note(params.spot_of("transmission_scatter"), message);
        }
        let subsurface = single(params, "subsurface_weight", 0.0)?;
        if subsurface == 1.0 {
            return self.openpbr_body(params);
        }
        if subsurface != 0.0 {
            let message = "\"subsurface_weight\" of an openpbr material is left out: a surface lets all light that \
                           it does not reflect into the body (1), or none (0)";
            self.note(params.spot_of("subsurface_weight"), message);
        }
        params.ignore(&OF_BODY);
        let base = self.spectrum_texture_or(params, "base_color", SpectrumUse::Reflectance, 0.8)?;
        let weight = self.float_texture_or(params, "base_weight", 1.0)?;
        let transmission = self.float_texture_or(params, "transmission_weight", 0.0)?;
        let (ior, of_spectrum) = self.index_and_dispersion(params, "specular_ior", 1.5)?;
        // 20 over the Abbe number, times the scale.
        let abbe = single(params, "transmission_dispersion_abbe_number", 20.0)?;
        let dispersion = single(params, "transmission_dispersion_scale", 0.0)? * 20.0 / abbe.max(1e-3);
        let fuzz = self.float_texture_or(params, "fuzz_weight", 0.0)?;
        let fuzz_color = self.spectrum_texture_or(params, "fuzz_color", SpectrumUse::Reflectance, 1.0)?;
        let thin = params.boolean("geometry_thin_walled", false)?;
        let volume = if thin {
            params.ignore(&["transmission_color", "transmission_depth"]);
            None
        } else {
            Some(self.openpbr_volume(params)?)
        };
        let is_clear = !matches!(*transmission, Texture::Constant(0.0));
        // Micrometres.
        let film = self.float_texture_or(params, "thin_film_thickness", 0.5)?;
        Ok(MaterialKind::Principled(Box::new(PrincipledParams {
            convention: Convention::Gltf,
            // The colour of a clear body is that of its inside, unless it is thin.
            base_color: if is_clear && !thin { base.clone() } else { self.weighed(base, weight) },
            metallic: self.float_texture_or(params, "base_metalness", 0.0)?,
            roughness: self.float_texture_or(params, "specular_roughness", 0.3)?,
            anisotropy: self.float_texture_or(params, "specular_roughness_anisotropy", 0.0)?,
            ior,
            specular: self.float_texture_or(params, "specular_weight", 1.0)?,
            specular_color: self.spectrum_texture_or(
                params,
                "specular_color",
                SpectrumUse::Reflectance,
                1.0,
            )?,
            transmission,
            dispersion: dispersion.max(of_spectrum.max(0.0)),
            volume,
            clearcoat: self.float_texture_or(params, "coat_weight", 0.0)?,
            clearcoat_roughness: self.float_texture_or(params, "coat_roughness", 0.0)?,
            clearcoat_ior: single(params, "coat_ior", 1.6)?,
            clearcoat_color: self.spectrum_texture_or(params, "coat_color", SpectrumUse::Reflectance, 1.0)?,
            clearcoat_darkening: single(params, "coat_darkening", 1.0)?,
            sheen_color: self.weighed(fuzz_color, fuzz),
            sheen_roughness: self.float_texture_or(params, "fuzz_roughness", 0.5)?,
            iridescence: self.float_texture_or(params, "thin_film_weight", 0.0)?,
            iridescence_ior: single(params, "thin_film_ior", 1.4)?,
            iridescence_thickness: match *film {
                Texture::Constant(v) => self.number(1000.0 * v),
                _ => Arc::new(Texture::Scale { texture: film, scale: self.number(1000.0) }),
            },
            ..PrincipledParams::default()
        })))
    }

    /// A body that scatters the light that enters it.
    fn openpbr_body(&mut self, params: &Params) -> Result<MaterialKind> {
        for (name, plain) in NOT_OF_BODY {
            if params.has(name) && single(params, name, plain)? != plain {
                let message = format!("{} of an openpbr material with a body is left out", quoted(name));
                self.note(params.spot_of(name), message);
            }
        }
        params.ignore(&DETAILS_OF_OTHERS);
        let radius = single(params, "subsurface_radius", 1.0)?;
        if radius <= 0.0 {
            return params.out_of_range("subsurface_radius", f64::from(radius), "more than 0");
        }
        let scale = self.spectrum_texture(params, "subsurface_radius_scale", SpectrumUse::Coefficient)?;
        let scale = scale.map_or_else(|| self.colour(Rgb::new(1.0, 0.5, 0.25)), |known| known.texture);
        let radius = self.number(radius);
        let roughness = self.float_texture_or(params, "specular_roughness", 0.3)?;
        let alpha = match *roughness {
            Texture::Constant(r) => self.number(r * r),
            _ => Arc::new(Texture::Scale { texture: roughness.clone(), scale: roughness }),
        };
        Ok(MaterialKind::Subsurface(Box::new(SubsurfaceParams {
            inside: Inside::Reflectance {
                reflectance: self.spectrum_texture_or(
                    params,
                    "subsurface_color",
                    SpectrumUse::Reflectance,
                    0.8,
                )?,
                mean_free_path: self.weighed(scale, radius),
            },
            scale: 1.0,
            asymmetry: single(params, "subsurface_scatter_anisotropy", 0.0)?,
            eta: self.index_and_dispersion(params, "specular_ior", 1.5)?.0,
            roughness: Roughness { u: alpha.clone(), v: alpha, remap: false },
        })))
    }

    /// What is inside: it has its colour at some depth.
    fn openpbr_volume(&mut self, params: &Params) -> Result<VolumeParams> {
        let depth = single(params, "transmission_depth", 0.0)?;
        if depth < 0.0 {
            return params.out_of_range("transmission_depth", f64::from(depth), "0 or more");
        }
        let colour = self.spectrum_value(params, "transmission_color", SpectrumUse::Reflectance)?;
        let colour = colour.map_or(Rgb::WHITE, |colour| colour.reflectance_rgb());
        if depth == 0.0 {
            if colour != Rgb::WHITE {
                let message = "\"transmission_color\" without \"transmission_depth\" is left out: a body has its \
                               colour at a depth";
                self.note(params.spot_of("transmission_color"), message);
            }
            return Ok(VolumeParams::default());
        }
        Ok(VolumeParams { attenuation_color: colour, attenuation_distance: depth, ..VolumeParams::default() })
    }

    /// A colour times a number.
    fn weighed(&mut self, colour: SpectrumArc, weight: FloatArc) -> SpectrumArc {
        match (&*colour, &*weight) {
            (_, Texture::Constant(1.0)) => colour,
            (Texture::Constant(c), Texture::Constant(w)) => self.colour(*c * *w),
            _ => Arc::new(Texture::Scale { texture: colour, scale: weight }),
        }
    }
}
