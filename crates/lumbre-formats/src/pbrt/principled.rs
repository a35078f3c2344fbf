//! The principled material, which pbrt-v3 calls `disney`.

use std::sync::Arc;

use lumbre_image::Rgb;
use lumbre_shading::{Convention, MaterialKind, PrincipledParams, Texture, VolumeParams};

use super::convert::{Converter, FloatArc};
use super::params::Params;
use super::source::Result;
use super::textures::{SpectrumUse, single};
use crate::diagnostic::quoted;

/// The names of the parameters.
struct Names {
    base_color: &'static str,
    anisotropic: &'static str,
    specular_tint: &'static str,
    sheen_tint: &'static str,
    clearcoat_gloss: &'static str,
    transmission: &'static str,
    diffuse_transmission: &'static str,
}

/// Mitsuba 3's.
const NEW: Names = Names {
    base_color: "base_color",
    anisotropic: "anisotropic",
    specular_tint: "spec_tint",
    sheen_tint: "sheen_tint",
    clearcoat_gloss: "clearcoat_gloss",
    transmission: "spec_trans",
    diffuse_transmission: "diff_trans",
};

/// Those of pbrt-v3's `disney`.
const OLD: Names = Names {
    base_color: "color",
    anisotropic: "anisotropic",
    specular_tint: "speculartint",
    sheen_tint: "sheentint",
    clearcoat_gloss: "clearcoatgloss",
    transmission: "spectrans",
    diffuse_transmission: "difftrans",
};

/// Burley's coat has an index of 1.5 and covers a quarter of the surface.
const CLEARCOAT_SHARE: f32 = 0.25;

impl Converter<'_, '_> {
    /// Material `principled`, with Mitsuba 3's parameter names.
    pub fn principled(&mut self, params: &Params) -> Result<MaterialKind> {
        let mut principled = self.burley(params, &NEW, 0.5)?;
        if params.has("eta") && params.has("specular") {
            let message = format!("{} excludes {}", quoted("specular"), quoted("eta"));
            return Err(params.spot_of("specular").error(message));
        }
        let mut dispersion = 0.0;
        principled.ior = if params.has("specular") {
            PrincipledParams::ior_from_specular(single(params, "specular", 0.5)?)
        } else {
            let (index, of_spectrum) = self.index_and_dispersion(params, "eta", 1.5)?;
            dispersion = of_spectrum.max(0.0);
            index
        };
        // Lumbre's additions.
        if params.has("clearcoat_roughness") {
            principled.clearcoat_roughness = self.float_texture_or(params, "clearcoat_roughness", 0.0)?;
        }
        principled.anisotropy_rotation = single(params, "anisotropic_rotation", 0.0)?.to_radians();
        principled.sheen_roughness = self.float_texture_or(params, "sheen_roughness", 0.5)?;
        principled.dispersion = single(params, "dispersion", dispersion)?;
        principled.iridescence = self.float_texture_or(params, "iridescence", 0.0)?;
        principled.iridescence_ior = single(params, "iridescence_ior", 1.3)?;
        principled.iridescence_thickness = self.float_texture_or(params, "iridescence_thickness", 400.0)?;
        if let Some(volume) = &mut principled.volume {
            let color = self.spectrum_value(params, "attenuation_color", SpectrumUse::Reflectance)?;
            volume.attenuation_color = color.map_or(Rgb::WHITE, |color| color.reflectance_rgb());
            if params.has("attenuation_distance") {
                volume.attenuation_distance = single(params, "attenuation_distance", 1.0)?;
            }
            if volume.attenuation_distance <= 0.0 {
                let found = f64::from(volume.attenuation_distance);
                return params.out_of_range("attenuation_distance", found, "more than 0");
            }
        }
        // No effect on the mean image.
        params.ignore(&[
            "main_specular_sampling_rate",
            "diffuse_reflectance_sampling_rate",
            "clearcoat_sampling_rate",
        ]);
        Ok(MaterialKind::Principled(Box::new(principled)))
    }

    /// pbrt-v3's material `disney`.
    pub fn disney(&mut self, params: &Params) -> Result<MaterialKind> {
        let mut principled = self.burley(params, &OLD, 0.5)?;
        let (ior, dispersion) = self.index_and_dispersion(params, "eta", 1.5)?;
        (principled.ior, principled.dispersion) = (ior, dispersion.max(0.0));
        if params.has("scatterdistance") {
            params.ignore(&["scatterdistance"]);
            let message =
                "\"scatterdistance\" of material \"disney\" is left out: light does not scatter inside";
            self.note(params.spot_of("scatterdistance"), message);
        }
        Ok(MaterialKind::Principled(Box::new(principled)))
    }

    /// The common parameters.
    fn burley(&mut self, params: &Params, names: &Names, roughness: f32) -> Result<PrincipledParams> {
        let clearcoat = self.float_texture_or(params, "clearcoat", 0.0)?;
        let gloss =
            single(params, names.clearcoat_gloss, if names.base_color == "color" { 1.0 } else { 0.0 })?;
        let sheen = self.float_texture_or(params, "sheen", 0.0)?;
        let white = self.colour(Rgb::WHITE);
        let base_color = self.spectrum_texture_or(params, names.base_color, SpectrumUse::Reflectance, 0.5)?;
        let through = self.float_texture_or(params, names.diffuse_transmission, 0.0)?;
        if single(params, "flatness", 0.0)? != 0.0 {
            self.note(params.spot_of("flatness"), "\"flatness\" of a principled material is left out");
        }
        let thin = params.boolean("thin", false)?;
        Ok(PrincipledParams {
            convention: Convention::Burley,
            metallic: self.float_texture_or(params, "metallic", 0.0)?,
            roughness: self.float_texture_or(params, "roughness", roughness)?,
            anisotropy: self.float_texture_or(params, names.anisotropic, 0.0)?,
            specular_tint: self.float_texture_or(params, names.specular_tint, 0.0)?,
            transmission: self.float_texture_or(params, names.transmission, 0.0)?,
            volume: (!thin).then(VolumeParams::default),
            // Burley's range is from 0, all reflected, to 2, all transmitted.
            diffuse_transmission: self.scaled(through, 0.5),
            diffuse_transmission_color: base_color.clone(),
            base_color,
            clearcoat: self.scaled(clearcoat, CLEARCOAT_SHARE),
            clearcoat_roughness: self.number(PrincipledParams::roughness_from_gloss(gloss)),
            sheen_color: match *sheen {
                Texture::Constant(v) => self.colour(Rgb::splat(v)),
                _ => Arc::new(Texture::Scale { texture: white, scale: sheen }),
            },
            sheen_tint: self.float_texture_or(params, names.sheen_tint, 0.0)?,
            sheen_roughness: self.number(0.5),
            ..PrincipledParams::default()
        })
    }

    fn scaled(&mut self, texture: FloatArc, factor: f32) -> FloatArc {
        match *texture {
            Texture::Constant(v) => self.number(v * factor),
            _ => Arc::new(Texture::Scale { texture, scale: self.number(factor) }),
        }
    }
}
