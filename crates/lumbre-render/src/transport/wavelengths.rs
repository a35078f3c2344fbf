//! Which wavelengths samples carry in a spectral render.

use lumbre_shading::spectrum::Wavelengths;

use crate::transport::Draw;

/// How the wavelengths of a sample are chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum WavelengthChoice {
    /// As the eye sees them: [`Wavelengths::visible`].
    Visible,
    /// Evenly between two ends in nm.
    Even([f32; 2]),
}

impl WavelengthChoice {
    /// Those of a sample.
    pub(crate) fn of(self, draw: &Draw) -> Wavelengths {
        match self {
            Self::Visible => Wavelengths::visible(draw.wavelength()),
            Self::Even(ends) => Wavelengths::even(draw.wavelength(), ends),
        }
    }
}
