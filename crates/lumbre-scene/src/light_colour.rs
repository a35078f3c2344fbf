//! The spectra of lights in spectral renders.

use std::sync::Arc;

use lumbre_shading::Spectrum;
use lumbre_shading::spectrum::{LightCurve, Wavelengths};

/// The colours of a light.
#[derive(Clone, Debug)]
pub(crate) enum LightColour {
    /// One colour, times a factor by direction and position.
    Constant {
        /// The colour.
        colour: Spectrum,
        /// Its spectrum with luminance 1, if it has one.
        spectrum: Option<Arc<LightCurve>>,
    },
    /// Colours that vary.
    Varied,
    /// The emission of a surface, which has its own spectrum.
    Surface,
}

impl LightColour {
    /// Light at some wavelengths; `radiance` is its colour.
    pub(crate) fn at_wavelengths(&self, radiance: Spectrum, wavelengths: &Wavelengths) -> Spectrum {
        match self {
            Self::Constant { colour, spectrum } => {
                constant(*colour, spectrum.as_deref(), radiance, wavelengths)
            }
            Self::Varied | Self::Surface => wavelengths.varied_light(radiance),
        }
    }
}

/// Light at some wavelengths; `radiance` is its colour: that of a light of one colour, times a factor. The light may
/// have a spectrum of luminance 1.
pub(crate) fn constant(
    colour: Spectrum,
    spectrum: Option<&LightCurve>,
    radiance: Spectrum,
    wavelengths: &Wavelengths,
) -> Spectrum {
    let factor = radiance.average() / colour.average();
    if !factor.is_finite() {
        // The film reports it.
        return if radiance.is_black() { Spectrum::BLACK } else { radiance };
    }
    match spectrum {
        Some(spectrum) => wavelengths.curve(spectrum) * (colour.luminance() * factor),
        None => wavelengths.light(colour) * factor,
    }
}
