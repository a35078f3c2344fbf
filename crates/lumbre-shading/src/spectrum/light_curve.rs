//! The spectra of lights.

use super::{FIRST_NM, LAST_NM, SpectrumValue, observe};

/// The spectrum of a light, every nanometre, with luminance 1.
#[derive(Clone, Debug, PartialEq)]
pub struct LightCurve {
    values: Vec<f32>,
}

impl LightCurve {
    /// The memory that one takes.
    pub const BYTES: usize = size_of::<Self>() + 471 * size_of::<f32>();

    /// Of a spectrum given by wavelength; `None` for a colour, and for what is dark.
    pub fn of(spectrum: &SpectrumValue) -> Option<Self> {
        spectrum.at(FIRST_NM)?;
        let value = |nm: f64| spectrum.at(nm).unwrap_or(0.0);
        let factor = observe(|_| 1.0)[1] / observe(value)[1];
        let nanometres = (0..=(LAST_NM - FIRST_NM) as u32).map(|i| FIRST_NM + f64::from(i));
        let is_light = factor > 0.0 && factor.is_finite();
        is_light.then(|| Self { values: nanometres.map(|nm| (value(nm) * factor) as f32).collect() })
    }

    /// The radiance at a wavelength in nm: linear between entries, and 0 beyond what is visible.
    #[inline]
    pub fn at(&self, nm: f32) -> f32 {
        let place = nm - FIRST_NM as f32;
        let last = self.values.len() - 1;
        let is_visible = 0.0 <= place && place <= last as f32;
        if !is_visible {
            return 0.0;
        }
        let low = (place as usize).min(last - 1);
        let t = place - low as f32;
        self.values[low] * (1.0 - t) + self.values[low + 1] * t
    }
}
