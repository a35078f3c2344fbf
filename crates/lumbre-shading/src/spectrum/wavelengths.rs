//! The wavelengths of a sample, which a spectral render carries on the three channels of light transport.

use std::sync::LazyLock;

use lumbre_math::Elementary;

use super::{
    FIRST_NM, LAST_NM, LightCurve, SensorCurves, Sigmoid, SpectrumValue, WHITE, blackbody, matching, named,
    observe, rec709_from_xyz,
};
use crate::Spectrum;

/// Three wavelengths, one a channel, with the densities that they were chosen with.
///
/// The first is chosen at random, the others are a third of the distribution away each: A. Wilkie and others, "Hero
/// Wavelength Spectral Sampling", EGSR 2014. Radiance at a wavelength is in units in which light of a constant spectrum
/// of 1 has luminance 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wavelengths {
    /// In nm.
    nm: [f32; 3],
    /// Their densities per nm.
    pdf: [f32; 3],
    /// White light, which has the spectrum of D65 and luminance 1.
    white: [f32; 3],
}

/// How the wavelengths of samples are chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum WavelengthDensity {
    /// [`Wavelengths::visible`].
    Visible,
    /// [`Wavelengths::even`].
    Even {
        /// The first wavelength in nm.
        low: f32,
        /// The last one.
        high: f32,
    },
}

impl WavelengthDensity {
    /// Wavelengths by one number in [0, 1).
    pub fn sample(self, u: f32) -> Wavelengths {
        match self {
            Self::Visible => Wavelengths::visible(u),
            Self::Even { low, high } => Wavelengths::even(u, low, high),
        }
    }
}

/// What colours and spectra are at the wavelengths of a sample: for the look-up of textures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpectralLookup {
    /// The wavelengths.
    pub wavelengths: Wavelengths,
    /// Whether values may be more than 1: coefficients, not reflectances.
    pub is_unbounded: bool,
}

/// The sums of ȳ, and of ȳ times D65.
static LUMINANCE: LazyLock<[f64; 2]> = LazyLock::new(|| [observe(|_| 1.0)[1], observe(named::d65)[1]]);

impl Wavelengths {
    /// How many there are.
    pub const COUNT: usize = 3;

    /// Wavelengths by one number in [0, 1), denser where the eye sees more.
    ///
    /// The density is proportional to 1 / cosh²(0.0072 (λ − 538 nm)) between 360 and 830 nm, as in pbrt-v4: M.
    /// Radziszewski, K. Boryczko, W. Alda, "An Improved Technique for Full Spectral Rendering", WSCG 2009.
    pub fn visible(u: f32) -> Self {
        let numbers = thirds(u);
        // tanh(0.0072 (λ − 538)), with the sign turned.
        let tangents = numbers.map(|u| 0.856_910_62 - 1.827_501_97 * u);
        let nm = tangents.map(|t| 538.0 - 0.5 / 0.0072 * ((1.0 + t) / (1.0 - t)).logarithm());
        let pdf = tangents.map(|t| 0.003_939_804_2 * (1.0 - t * t));
        Self::new(nm, pdf)
    }

    /// Wavelengths by one number in [0, 1), equally dense between two of them in nm.
    pub fn even(u: f32, low: f32, high: f32) -> Self {
        let width = f64::from(high - low);
        Self::new(thirds(u).map(|u| f64::from(low) + u * width), [1.0 / width; 3])
    }

    fn new(nm: [f64; 3], pdf: [f64; 3]) -> Self {
        let nm = nm.map(|nm| nm.clamp(FIRST_NM, LAST_NM));
        let [even, of_white] = *LUMINANCE;
        Self {
            nm: nm.map(|nm| nm as f32),
            pdf: pdf.map(|pdf| pdf as f32),
            white: nm.map(|nm| (named::d65(nm) * (even / of_white)) as f32),
        }
    }

    /// The wavelengths in nm; the first is the hero.
    pub fn nm(&self) -> [f32; 3] {
        self.nm
    }

    /// Their densities per nm.
    pub fn pdf(&self) -> [f32; 3] {
        self.pdf
    }

    /// What a sample of this radiance adds to linear Rec. 709, by the standard observer. Channels may be negative.
    pub fn rec709(&self, radiance: Spectrum) -> Spectrum {
        let [even, of_white] = *LUMINANCE;
        let mut xyz = [0.0; 3];
        for (i, radiance) in radiance.to_array().into_iter().enumerate() {
            let share = f64::from(radiance) / (f64::from(self.pdf[i]) * even * Self::COUNT as f64);
            let response = matching(self.nm[i].into());
            (0..3).for_each(|c| xyz[c] += response[c] * share);
        }
        let rgb = rec709_from_xyz(xyz);
        // The tabulated D65 is exactly white.
        let [r, g, b] = std::array::from_fn(|c| (rgb[c] * (of_white / WHITE[c])) as f32);
        Spectrum::new(r, g, b)
    }

    /// What a sample of this radiance adds to what a camera records, before its matrix.
    pub fn recorded(&self, radiance: Spectrum, sensor: &SensorCurves) -> Spectrum {
        let [even, _] = *LUMINANCE;
        let mut recorded = [0.0; 3];
        for (i, radiance) in radiance.to_array().into_iter().enumerate() {
            let share = f64::from(radiance) / (f64::from(self.pdf[i]) * even * Self::COUNT as f64);
            let sensitivities = sensor.at(self.nm[i]);
            (0..3).for_each(|c| recorded[c] += f64::from(sensitivities[c]) * share);
        }
        Spectrum::from(recorded.map(|c| c as f32))
    }

    /// A reflectance of this colour, clamped to [0, 1].
    pub fn reflectance(&self, colour: Spectrum) -> Spectrum {
        self.sigmoid(Sigmoid::of(colour))
    }

    /// [`Self::reflectance`] for colours that vary from place to place, by a table.
    pub fn varied_reflectance(&self, colour: Spectrum) -> Spectrum {
        self.sigmoid(Sigmoid::by_table(colour))
    }

    /// A coefficient of this colour, which may be more than 1.
    pub fn coefficient(&self, colour: Spectrum) -> Spectrum {
        self.scaled(colour, Sigmoid::of)
    }

    /// [`Self::coefficient`] for colours that vary from place to place, by a table.
    pub fn varied_coefficient(&self, colour: Spectrum) -> Spectrum {
        self.scaled(colour, Sigmoid::by_table)
    }

    /// Light of this colour: a coefficient times white light.
    pub fn light(&self, colour: Spectrum) -> Spectrum {
        self.coefficient(colour) * self.white()
    }

    /// [`Self::light`] for colours that vary from place to place, by a table.
    pub fn varied_light(&self, colour: Spectrum) -> Spectrum {
        self.varied_coefficient(colour) * self.white()
    }

    /// A spectrum given by wavelength; `None` for a colour.
    pub fn values(&self, spectrum: &SpectrumValue) -> Option<Spectrum> {
        let [r, g, b] = self.nm.map(|nm| spectrum.at(nm.into()).map(|value| value as f32));
        Some(Spectrum::new(r?, g?, b?))
    }

    /// Light of a spectrum with luminance 1.
    pub fn curve(&self, curve: &LightCurve) -> Spectrum {
        let [r, g, b] = self.nm.map(|nm| curve.at(nm));
        Spectrum::new(r, g, b)
    }

    /// The radiance of a black body of a temperature in kelvin, relative to the greatest that it has at any wavelength,
    /// as [`BlackbodyColours`](super::BlackbodyColours).
    pub(crate) fn blackbody(&self, kelvin: f32) -> Spectrum {
        let [even, _] = *LUMINANCE;
        let [r, g, b] = self.nm.map(|nm| (even * blackbody(nm.into(), kelvin.into())) as f32);
        Spectrum::new(r, g, b)
    }

    fn white(&self) -> Spectrum {
        Spectrum::from(self.white)
    }

    fn sigmoid(&self, sigmoid: Sigmoid) -> Spectrum {
        let [r, g, b] = self.nm.map(|nm| sigmoid.at(nm));
        Spectrum::new(r, g, b)
    }

    /// Twice the greatest channel times a reflectance, so that coefficients are as smooth as what reflects half.
    fn scaled(&self, colour: Spectrum, sigmoid: impl Fn(Spectrum) -> Sigmoid) -> Spectrum {
        let most = 2.0 * colour.max_component();
        let is_light = most > 0.0 && most.is_finite();
        if is_light { self.sigmoid(sigmoid(colour / most)) * most } else { Spectrum::BLACK }
    }
}

/// A number and those a third and two thirds away from it, in [0, 1).
fn thirds(u: f32) -> [f64; 3] {
    [0.0, 1.0 / 3.0, 2.0 / 3.0].map(|away| (f64::from(u) + away).fract())
}

impl SpectralLookup {
    /// A colour that is the same everywhere.
    pub fn constant(&self, colour: Spectrum) -> Spectrum {
        if self.is_unbounded {
            self.wavelengths.coefficient(colour)
        } else {
            self.wavelengths.reflectance(colour)
        }
    }

    /// A colour that varies from place to place.
    pub fn varied(&self, colour: Spectrum) -> Spectrum {
        if self.is_unbounded {
            self.wavelengths.varied_coefficient(colour)
        } else {
            self.wavelengths.varied_reflectance(colour)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::NamedSpectrum;

    /// The mean of what samples see of light, whose radiance is a function of the wavelengths.
    fn mean(light: impl Fn(&Wavelengths) -> Spectrum) -> [f64; 3] {
        const COUNT: u32 = 60_000;
        let mut sum = [0.0; 3];
        for i in 0..COUNT {
            let wavelengths = Wavelengths::visible((i as f32 + 0.5) / COUNT as f32);
            let seen = wavelengths.rec709(light(&wavelengths)).to_array();
            (0..3).for_each(|c| sum[c] += f64::from(seen[c]) / f64::from(COUNT));
        }
        sum
    }

    fn near(found: [f64; 3], wanted: [f64; 3], tolerance: f64) {
        for c in 0..3 {
            assert!((found[c] - wanted[c]).abs() < tolerance, "{found:?} for {wanted:?}");
        }
    }

    #[test]
    fn wavelengths_have_the_density_that_they_say() {
        // Counts in bins against the integral of the density over them.
        const COUNT: u32 = 200_000;
        let mut counts = [0_u32; 47];
        for i in 0..COUNT {
            let wavelengths = Wavelengths::visible((i as f32 + 0.5) / COUNT as f32);
            for nm in wavelengths.nm() {
                counts[(((nm - 360.0) / 10.0) as usize).min(46)] += 1;
            }
        }
        let density = |nm: f64| 0.003_939_804_2 / (0.0072 * (nm - 538.0)).cosh().powi(2);
        let mut whole = 0.0;
        for (bin, count) in counts.into_iter().enumerate() {
            let low = 360.0 + 10.0 * bin as f64;
            let expected: f64 = (0..100).map(|i| density(low + 0.1 * (f64::from(i) + 0.5)) * 0.1).sum();
            whole += expected;
            let found = f64::from(count) / (3.0 * f64::from(COUNT));
            assert!((found / expected - 1.0).abs() < 0.01, "{low}: {found} {expected}");
        }
        assert!((whole - 1.0).abs() < 1e-4, "{whole}");
        for u in [0.0, 0.3, 0.999_999_9] {
            let wavelengths = Wavelengths::visible(u);
            for (nm, pdf) in wavelengths.nm().into_iter().zip(wavelengths.pdf()) {
                assert!((f64::from(pdf) / density(nm.into()) - 1.0).abs() < 1e-3, "{nm}: {pdf}");
            }
        }
    }

    #[test]
    fn white_light_on_grey_is_grey_and_has_luminance_1() {
        near(mean(|w| w.light(Spectrum::WHITE)), [1.0; 3], 2e-4);
        let grey = Spectrum::splat(0.5);
        near(mean(|w| w.light(Spectrum::splat(0.3)) * w.reflectance(grey)), [0.15; 3], 1e-4);
    }

    #[test]
    fn colours_come_back_through_wavelengths() {
        let colour = Spectrum::new(0.8, 0.3, 0.1);
        let wanted = [0.8, 0.3, 0.1];
        near(mean(|w| w.light(Spectrum::WHITE) * w.reflectance(colour)), wanted, 5e-4);
        near(mean(|w| w.light(colour)), wanted, 5e-4);
        near(mean(|w| w.varied_light(colour)), wanted, 5e-3);
        near(mean(|w| w.light(colour * 20.0)), wanted.map(|c| 20.0 * c), 1e-2);
    }

    #[test]
    fn a_sensor_records_the_integral_of_its_sensitivities() {
        // Two triangles and a constant.
        let sensor = SensorCurves {
            sensitivities: [vec![0.0, 1.0, 0.0], vec![0.5; 3], vec![2.0, 0.0, 0.0]],
            first_nm: 450.0,
            step_nm: 50.0,
            rec709: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        };
        let mut sum = [0.0; 3];
        const COUNT: u32 = 60_000;
        for i in 0..COUNT {
            let wavelengths = Wavelengths::visible((i as f32 + 0.5) / COUNT as f32);
            let recorded = wavelengths.recorded(Spectrum::splat(3.0), &sensor).to_array();
            (0..3).for_each(|c| sum[c] += f64::from(recorded[c]) / f64::from(COUNT));
        }
        // Over the sum of the eye's ȳ. The last one goes on below 450 nm.
        let even = LUMINANCE[0];
        near(sum, [3.0 * 50.0 / even, 3.0 * 0.5 * 470.0 / even, 3.0 * 2.0 * (90.0 + 25.0) / even], 5e-3);
    }

    #[test]
    fn light_by_spectrum_has_luminance_1_and_its_colour() {
        for (value, wanted) in [
            (SpectrumValue::Blackbody(3000.0), [1.7706, 0.84428, 0.27214]),
            (
                SpectrumValue::Named(NamedSpectrum::from_name("stdillum-A").unwrap()),
                [1.845, 0.82607, 0.23337],
            ),
            (
                SpectrumValue::Named(NamedSpectrum::from_name("stdillum-F11").unwrap()),
                [1.4121, 0.92473, 0.53156],
            ),
        ] {
            let curve = LightCurve::of(&value).unwrap();
            near(mean(|w| w.curve(&curve)), wanted, 3e-3);
        }
        assert!(LightCurve::of(&SpectrumValue::Rgb(Spectrum::WHITE)).is_none());
        assert!(LightCurve::of(&SpectrumValue::Sampled(vec![])).is_none());
    }
}
