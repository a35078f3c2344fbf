//! What spectra lights have, where a render carries wavelengths.

use std::sync::Arc;

use lumbre_shading::Spectrum;
use lumbre_shading::spectrum::{LightCurve, Wavelengths};

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
