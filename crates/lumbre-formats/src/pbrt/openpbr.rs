//! Material `openpbr`: the parameters of OpenPBR Surface 1.1 (Academy Software Foundation, 2024) by their names, as far
//! as the layers of the principled material have them.

use std::sync::Arc;

use lumbre_image::Rgb;
use lumbre_shading::{Convention, MaterialKind, PrincipledParams, Texture, VolumeParams};

use super::convert::{Converter, FloatArc, SpectrumArc};
use super::params::Params;
use super::source::Result;
use super::textures::{SpectrumUse, single};
use crate::diagnostic::quoted;

/// Parameters of what is not rendered, with the value that changes nothing.
const LEFT_OUT: [(&str, f32); 6] = [
    ("base_diffuse_roughness", 0.0),
    ("subsurface_weight", 0.0),
    ("transmission_scatter_anisotropy", 0.0),
    ("coat_roughness_anisotropy", 0.0),
    ("emission_luminance", 0.0),
    ("geometry_opacity", 1.0),
];

/// What these say more of, and what the layers fix: without effect on their own.
const DETAILS: [&str; 7] = [
    "subsurface_color",
    "subsurface_radius",
    "subsurface_radius_scale",
    "subsurface_scatter_anisotropy",
    "emission_color",
    "coat_ior",
    "coat_darkening",
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
        for name in ["transmission_scatter", "coat_color"] {
            let plain = if name == "coat_color" { Rgb::WHITE } else { Rgb::BLACK };
            let given = self.spectrum_texture(params, name, SpectrumUse::Reflectance)?;
            if given.is_some_and(|given| given.value() != Some(plain)) {
                let message = format!("{} of an openpbr material is left out", quoted(name));
                self.note(params.spot_of(name), message);
            }
        }
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
