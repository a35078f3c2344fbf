//! What spectra lights have, where a render carries wavelengths.

use std::sync::Arc;

use lumbre_shading::Spectrum;
use lumbre_shading::spectrum::{LightCurve, Wavelengths};

use crate::LightDesc;

/// What a light's colours are made of.
#[derive(Clone, Debug)]
pub(crate) enum LightColour {
    /// One colour, times a factor by direction and place.
    Constant {
        /// The colour.
        colour: Spectrum,
        /// Its spectrum with luminance 1, where it has one of its own.
        spectrum: Option<Arc<LightCurve>>,
    },
    /// Colours that vary from place to place.
    Varied,
    /// What a surface emits, which says so itself.
    Surface,
}

impl LightColour {
    /// Of a light.
    pub(crate) fn of(desc: &LightDesc) -> Self {
        let one = |colour: &Spectrum| Self::Constant { colour: *colour, spectrum: None };
        match desc {
            LightDesc::Point { intensity, .. } | LightDesc::Spot { intensity, .. } => one(intensity),
            LightDesc::Distant { irradiance, .. } => one(irradiance),
            LightDesc::Infinite { radiance, image: None, .. }
            | LightDesc::Portal { radiance, image: None, .. } => one(radiance),
            LightDesc::Infinite { .. }
            | LightDesc::Portal { .. }
            | LightDesc::Goniometric { .. }
            | LightDesc::Projection { .. }
            | LightDesc::Pov(_) => Self::Varied,
            LightDesc::Moving { light, .. } => Self::of(light),
            LightDesc::Spectral { light, spectrum } => {
                let spectrum = Some(spectrum.clone());
                match (Self::of(light), &**light) {
                    (Self::Constant { colour, .. }, _) => Self::Constant { colour, spectrum },
                    (_, LightDesc::Goniometric { intensity, .. }) => {
                        Self::Constant { colour: *intensity, spectrum }
                    }
                    (other, _) => other,
                }
            }
        }
    }

    /// Light at some wavelengths, of which `radiance` is the colour.
    pub(crate) fn at_wavelengths(&self, radiance: Spectrum, wavelengths: &Wavelengths) -> Spectrum {
        match self {
            Self::Constant { colour, spectrum } => {
                constant(*colour, spectrum.as_deref(), radiance, wavelengths)
            }
            Self::Varied | Self::Surface => wavelengths.varied_light(radiance),
        }
    }
}

/// Light at some wavelengths, of which `radiance` is the colour: that of a light of one colour, which may have a spectrum of luminance 1,
/// times a factor.
pub(crate) fn constant(
    colour: Spectrum,
    spectrum: Option<&LightCurve>,
    radiance: Spectrum,
    wavelengths: &Wavelengths,
) -> Spectrum {
    let factor = radiance.average() / colour.average();
    if !factor.is_finite() {
        // It is for the film to find.
        return if radiance.is_black() { Spectrum::BLACK } else { radiance };
    }
    match spectrum {
        Some(spectrum) => wavelengths.curve(spectrum) * (colour.luminance() * factor),
        None => wavelengths.light(colour) * factor,
    }
}
