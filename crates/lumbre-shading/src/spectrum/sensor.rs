//! What sensors other than the eye record of light.

/// The spectral sensitivities of a camera, and what it makes of the numbers that it records.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorCurves {
    /// The sensitivities of red, green and blue, at even steps; the ends go on.
    pub sensitivities: [Vec<f32>; 3],
    /// The first wavelength and the step, in nm.
    pub first_nm: f32,
    /// The step between wavelengths, in nm.
    pub step_nm: f32,
    /// By rows, the linear Rec. 709 of the picture of what red, green and blue record of light, relative to the
    /// luminance of light with a constant spectrum.
    pub rec709: [[f32; 3]; 3],
}

impl SensorCurves {
    /// The sensitivities at a wavelength in nm.
    pub fn at(&self, nm: f32) -> [f32; 3] {
        self.sensitivities.each_ref().map(|curve| {
            let Some(last) = curve.len().checked_sub(1) else { return 0.0 };
            let place = ((nm - self.first_nm) / self.step_nm).clamp(0.0, last as f32);
            let low = (place as usize).min(last.saturating_sub(1));
            let t = place - low as f32;
            curve[low] * (1.0 - t) + curve[(low + 1).min(last)] * t
        })
    }
}
