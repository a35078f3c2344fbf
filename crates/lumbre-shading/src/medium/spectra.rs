//! Media by wavelength.

use std::sync::Arc;

use crate::spectrum::{LightCurve, Wavelengths};
use crate::{Spectrum, SpectrumValue};

/// What is known of a medium by wavelength, where it is more than colours.
#[derive(Clone, Debug, Default)]
pub struct MediumSpectra {
    /// The absorption coefficient.
    pub absorption: Option<SpectrumValue>,
    /// The scattering coefficient.
    pub scattering: Option<SpectrumValue>,
    /// A factor on both.
    pub scale: f32,
    /// The spectrum of what it emits.
    pub glow: Option<Arc<LightCurve>>,
}

impl MediumSpectra {
    /// A coefficient at some wavelengths, from its colour.
    fn coefficient(
        spectrum: Option<&SpectrumValue>,
        scale: f32,
        colour: Spectrum,
        wavelengths: &Wavelengths,
    ) -> Spectrum {
        let values = spectrum.and_then(|spectrum| wavelengths.values(spectrum));
        values.map_or_else(
            || wavelengths.coefficient(colour),
            |values| values.map(|value| (value * scale).max(0.0)),
        )
    }

    /// Absorption and scattering at some wavelengths, from their colours.
    pub(super) fn coefficients(
        spectra: Option<&Self>,
        [absorption, scattering]: [Spectrum; 2],
        wavelengths: &Wavelengths,
    ) -> [Spectrum; 2] {
        let scale = spectra.map_or(1.0, |spectra| spectra.scale);
        let of = |spectrum, colour| Self::coefficient(spectrum, scale, colour, wavelengths);
        [
            of(spectra.and_then(|spectra| spectra.absorption.as_ref()), absorption),
            of(spectra.and_then(|spectra| spectra.scattering.as_ref()), scattering),
        ]
    }

    /// Emitted light at some wavelengths, from its colour.
    pub(super) fn glow_at(spectra: Option<&Self>, glow: Spectrum, wavelengths: &Wavelengths) -> Spectrum {
        match spectra.and_then(|spectra| spectra.glow.as_ref()) {
            Some(curve) => wavelengths.curve(curve) * glow.luminance(),
            None => wavelengths.light(glow),
        }
    }
}
