//! Spectra, and their conversion to the channels of light transport.
//!
//! Light is carried as linear Rec. 709. A spectrum given by wavelength is converted once, when the scene is
//! read, with the CIE 1931 standard observer between 360 and 830 nm.

mod fluorescent;
mod light_curve;
mod named;
mod observer;
mod sensor;
mod sigmoid;
mod wavelengths;
mod white_point;

use std::sync::LazyLock;

pub use light_curve::LightCurve;
use lumbre_math::Elementary;
pub use named::NamedSpectrum;
use observer::{FIRST_NM, LAST_NM, MATCHING, STEP_NM};
pub use sensor::SensorCurves;
pub use sigmoid::Sigmoid;
pub use wavelengths::{SpectralLookup, WavelengthDensity, Wavelengths};
pub use white_point::white_point;

use crate::Spectrum;

/// A spectrum as given in a scene file.
#[derive(Clone, Debug, PartialEq)]
pub enum SpectrumValue {
    /// A colour, already linear Rec. 709.
    Rgb(Spectrum),
    /// A black body by its temperature in kelvin, normalised to a maximum of 1.
    Blackbody(f64),
    /// Values by ascending wavelength in nm; interpolated linearly, and constant beyond the first and last.
    /// Empty counts as 0.
    Sampled(Vec<(f64, f64)>),
    /// A built-in spectrum.
    Named(NamedSpectrum),
}

impl SpectrumValue {
    /// The value at a wavelength in nm; `None` for a colour.
    pub fn at(&self, nm: f64) -> Option<f64> {
        match self {
            Self::Rgb(_) => None,
            Self::Blackbody(kelvin) => Some(blackbody(nm, *kelvin)),
            Self::Sampled(pairs) => Some(interpolate(pairs, nm)),
            Self::Named(named) => Some(named.at(nm)),
        }
    }

    /// The colour of a surface of this spectral reflectance under D65, so that a constant gives equal channels.
    /// Clipped to [0, 1].
    pub fn reflectance_rgb(&self) -> Spectrum {
        self.weighed().map(crate::unit)
    }

    /// A coefficient (of refraction, absorption or scattering) for each channel: the mean over the channel's
    /// wavelengths. Not negative.
    pub fn unbounded_rgb(&self) -> Spectrum {
        self.weighed().map(|c| c.max(0.0))
    }

    /// The colour of a light. A colour is unchanged; a spectrum is normalised to a luminance (CIE Y) of 1, for
    /// photometric units, with colours outside the gamut clipped at constant luminance. Black stays black.
    pub fn illuminant_rgb(&self) -> Spectrum {
        if let Self::Rgb(colour) = self {
            return *colour;
        }
        let xyz = observe(|nm| self.at(nm).unwrap_or(0.0));
        let lights = xyz[1] > 0.0 && xyz[1].is_finite();
        if !lights {
            return Spectrum::BLACK;
        }
        let rgb = rec709_from_xyz(xyz.map(|c| c / xyz[1])).map(|c| c.max(0.0));
        let luminance = 0.212_639 * rgb[0] + 0.715_168_7 * rgb[1] + 0.072_192_32 * rgb[2];
        spectrum(rgb.map(|c| c / luminance))
    }

    /// The index of refraction for a material without dispersion: the value at 587.6 nm (the helium d line, n_d
    /// in catalogues). For a colour the mean of its channels.
    pub fn index_of_refraction(&self) -> f32 {
        match self {
            Self::Rgb(colour) => colour.average(),
            _ => self.at(587.6).unwrap_or(1.0) as f32,
        }
    }

    /// The mean of each channel under D65.
    fn weighed(&self) -> Spectrum {
        match self {
            Self::Rgb(colour) => *colour,
            _ => weigh(|nm| self.at(nm).unwrap_or(0.0)),
        }
    }
}

/// The colours of black bodies by their temperature, each relative to its greatest spectral radiance: the integral of
/// B/max B with the observer's functions, in linear Rec. 709. (Dark where most of a body's light is invisible; a
/// luminance of 105 at 5000 K.)
#[derive(Clone, Debug)]
pub struct BlackbodyColours {
    hottest: f32,
    colours: Vec<Spectrum>,
}

impl BlackbodyColours {
    /// Of temperatures up to `hottest` kelvin.
    pub fn up_to(hottest: f32) -> Self {
        const STEPS: u32 = 1024;
        let hottest = if hottest.is_finite() { hottest.max(1.0) } else { 1.0 };
        let colour = |i: u32| {
            let kelvin = f64::from(hottest) * f64::from(i) / f64::from(STEPS);
            spectrum(rec709_from_xyz(observe(|nm| blackbody(nm, kelvin))))
        };
        Self { hottest, colours: (0..=STEPS).map(colour).collect() }
    }

    /// The colour at a temperature in kelvin; that of the hottest one beyond.
    pub fn at(&self, kelvin: f32) -> Spectrum {
        let steps = self.colours.len() - 1;
        let place = (kelvin / self.hottest).clamp(0.0, 1.0) * steps as f32;
        let low = (place as usize).min(steps - 1);
        self.colours[low].lerp(self.colours[low + 1], place - low as f32)
    }
}

/// The index of refraction of a metal, (η, k), in the channels of light transport.
///
/// Three channels cannot hold the spectrum, but can preserve the reflectance at normal incidence: η is the mean
/// over each channel's wavelengths, and k is solved for so that the channel's reflectance
/// ((η − 1)² + k²) / ((η + 1)² + k²) is that of the spectrum under D65. Where no k can (η alone reflects more), k is 0
/// and η is adjusted. A channel that reflects more than 1, as the colour is outside the gamut, has a negative η:
/// [`crate::fresnel::conductor_channel`]. When either is a colour, both are taken channel by channel.
pub fn conductor_rgb(eta: &SpectrumValue, k: &SpectrumValue) -> (Spectrum, Spectrum) {
    if matches!(eta, SpectrumValue::Rgb(_)) || matches!(k, SpectrumValue::Rgb(_)) {
        return (eta.unbounded_rgb(), k.unbounded_rgb());
    }
    let reflected = weigh(|nm| {
        let (eta, k) = (eta.at(nm).unwrap_or(1.0), k.at(nm).unwrap_or(0.0));
        let denominator = (eta + 1.0).powi(2) + k * k;
        if denominator > 0.0 { ((eta - 1.0).powi(2) + k * k) / denominator } else { 0.0 }
    });
    let mean = eta.unbounded_rgb();
    let solve = |eta: f32, r: f32| {
        if r > 1.0 {
            return (1.0 - r, 0.0);
        }
        let (eta, r) = (f64::from(eta), f64::from(r).clamp(0.0, 0.9999));
        let k2 = (r * (eta + 1.0).powi(2) - (eta - 1.0).powi(2)) / (1.0 - r);
        if k2 >= 0.0 {
            (eta as f32, k2.sqrt() as f32)
        } else {
            let root = r.sqrt();
            let above = (1.0 + root) / (1.0 - root);
            ((if eta >= 1.0 { above } else { 1.0 / above }) as f32, 0.0)
        }
    };
    (mean.zip(reflected, |eta, r| solve(eta, r).0), mean.zip(reflected, |eta, r| solve(eta, r).1))
}

/// The spectral radiance of a black body relative to its maximum, at a wavelength in nm. 0 for temperatures
/// that are not positive.
fn blackbody(nm: f64, kelvin: f64) -> f64 {
    if !(kelvin > 0.0 && kelvin.is_finite()) {
        return 0.0;
    }
    // hc/k in nm K, with the constants of the SI of 2019; the maximum is at this value of x = hc/(λkT).
    const SECOND: f64 = 1.438_776_877e7;
    const X_PEAK: f64 = 4.965_114_231_744_276;
    let shape = |x: f64| x.powi(5) / x.exponential_minus_1();
    let x = SECOND / (nm * kelvin);
    if x > 700.0 { 0.0 } else { shape(x) / shape(X_PEAK) }
}

/// Linear between pairs of ascending wavelengths, constant beyond them.
fn interpolate(pairs: &[(f64, f64)], nm: f64) -> f64 {
    let after = pairs.partition_point(|pair| pair.0 <= nm);
    match (after.checked_sub(1).map(|i| pairs[i]), pairs.get(after)) {
        (None, None) => 0.0,
        (Some((_, v)), None) | (None, Some(&(_, v))) => v,
        (Some((nm0, v0)), Some(&(nm1, v1))) => v0 + (v1 - v0) * ((nm - nm0) / (nm1 - nm0)),
    }
}

/// (x̄, ȳ, z̄) at a wavelength in nm within the table: by the cubic through the four nearest entries, as the CIE
/// advises between its entries. (Linear, a narrow line has a colour that is wrong by half a per cent.)
fn matching(nm: f64) -> [f64; 3] {
    let last = MATCHING.len() - 1;
    let place = ((nm - FIRST_NM) / STEP_NM).clamp(0.0, last as f64);
    let i = (place as usize).clamp(1, last - 2);
    let t = place - i as f64;
    let weights = [
        -t * (t - 1.0) * (t - 2.0) / 6.0,
        (t + 1.0) * (t - 1.0) * (t - 2.0) / 2.0,
        -(t + 1.0) * t * (t - 2.0) / 2.0,
        (t + 1.0) * t * (t - 1.0) / 6.0,
    ];
    let near = &MATCHING[i - 1..i + 3];
    std::array::from_fn(|c| near.iter().zip(weights).map(|(entry, w)| entry[c] * w).sum::<f64>().max(0.0))
}

/// XYZ of a spectrum: the sum over every nanometre.
fn observe(mut value: impl FnMut(f64) -> f64) -> [f64; 3] {
    let mut xyz = [0.0; 3];
    for i in 0..=(LAST_NM - FIRST_NM) as u32 {
        let nm = FIRST_NM + f64::from(i);
        let (v, weights) = (value(nm), matching(nm));
        for c in 0..3 {
            xyz[c] += v * weights[c];
        }
    }
    xyz
}

/// The luminance of a spectrum of radiance per nm, without luminous efficacy: its integral over ȳ; `None` for a colour,
/// and for what is dark.
pub(crate) fn luminance_of(spectrum: &SpectrumValue) -> Option<f64> {
    spectrum.at(FIRST_NM)?;
    let [_, luminance, _] = observe(|nm| spectrum.at(nm).unwrap_or(0.0));
    (luminance > 0.0 && luminance.is_finite()).then_some(luminance)
}

/// Each channel's response to D65.
static WHITE: LazyLock<[f64; 3]> = LazyLock::new(|| rec709_from_xyz(observe(named::d65)));

/// The mean of a spectrum over each channel's response to D65.
fn weigh(mut value: impl FnMut(f64) -> f64) -> Spectrum {
    let rgb = rec709_from_xyz(observe(|nm| value(nm) * named::d65(nm)));
    spectrum(std::array::from_fn(|c| rgb[c] / WHITE[c]))
}

/// What a sensor of this sensitivity by wavelength in nm records of light that has the spectrum of D65 and luminance
/// (CIE Y) 1.
pub fn response_to_d65(mut sensitivity: impl FnMut(f64) -> f64) -> f64 {
    let wavelengths = || (0..=(LAST_NM - FIRST_NM) as u32).map(|i| FIRST_NM + f64::from(i));
    let luminance: f64 = wavelengths().map(|nm| matching(nm)[1] * named::d65(nm)).sum();
    let recorded: f64 = wavelengths().map(|nm| sensitivity(nm) * named::d65(nm)).sum();
    recorded / luminance
}

/// For each of these ascending wavelengths in nm, what a value there adds to each channel of a spectrum that is linear
/// between them and constant beyond, weighed as [`SpectrumValue::reflectance_rgb`] does, but not clipped. Weights of a
/// channel sum to 1.
pub fn channel_weights(nm: &[f32]) -> Vec<[f64; 3]> {
    let mut weights = vec![[0.0; 3]; nm.len()];
    let mut add = |i: usize, share: f64, light: [f64; 3]| {
        for (weight, light) in weights[i].iter_mut().zip(light) {
            *weight += share * light;
        }
    };
    for i in 0..=(LAST_NM - FIRST_NM) as u32 {
        let at = FIRST_NM + f64::from(i);
        let light = matching(at).map(|response| response * named::d65(at));
        let after = nm.partition_point(|&node| f64::from(node) <= at);
        match (after.checked_sub(1), nm.get(after)) {
            (None, None) => {}
            (Some(last), None) => add(last, 1.0, light),
            (None, Some(_)) => add(0, 1.0, light),
            (Some(low), Some(&high)) => {
                let from = f64::from(nm[low]);
                let t = (at - from) / (f64::from(high) - from);
                add(low, 1.0 - t, light);
                add(low + 1, t, light);
            }
        }
    }
    for weight in &mut weights {
        let rgb = rec709_from_xyz(*weight);
        *weight = std::array::from_fn(|c| rgb[c] / WHITE[c]);
    }
    weights
}

/// Linear Rec. 709 from XYZ: the inverse of the matrix of the primaries of ITU-R BT.709 with D65 at (0.3127, 0.3290).
fn rec709_from_xyz([x, y, z]: [f64; 3]) -> [f64; 3] {
    [
        3.240_969_941_904_521 * x - 1.537_383_177_570_093 * y - 0.498_610_760_293_003 * z,
        -0.969_243_636_280_88 * x + 1.875_967_501_507_72 * y + 0.041_555_057_407_176 * z,
        0.055_630_079_696_994 * x - 0.203_976_958_888_977 * y + 1.056_971_514_242_879 * z,
    ]
}

fn spectrum(rgb: [f64; 3]) -> Spectrum {
    let finite = |c: f64| if c.is_finite() { c as f32 } else { 0.0 };
    Spectrum::new(finite(rgb[0]), finite(rgb[1]), finite(rgb[2]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(name: &str) -> SpectrumValue {
        SpectrumValue::Named(NamedSpectrum::from_name(name).unwrap_or_else(|| panic!("{name} is missing")))
    }

    fn chromaticity(value: &SpectrumValue) -> (f64, f64) {
        let [x, y, z] = observe(|nm| value.at(nm).unwrap());
        (x / (x + y + z), y / (x + y + z))
    }

    fn close(a: Spectrum, b: [f32; 3], tolerance: f32) -> bool {
        a.to_array().iter().zip(b).all(|(a, b)| (a - b).abs() <= tolerance)
    }

    #[test]
    fn the_observer_sees_equal_energy_as_white() {
        let [x, y, z] = observe(|_| 1.0);
        assert!((y - 106.857).abs() < 0.01, "{y}");
        assert!((x / y - 1.0).abs() < 4e-4 && (z / y - 1.0).abs() < 4e-4, "{x} {y} {z}");
    }

    #[test]
    fn the_standard_illuminants_have_their_published_chromaticity() {
        let published = [
            ("stdillum-A", 0.44758, 0.40745),
            // pbrt-v4's own table, not that of the CIE.
            ("stdillum-D50", 0.33681, 0.35798),
            ("stdillum-D65", 0.31272, 0.32903),
            ("illum-acesD60", 0.32168, 0.33767),
            ("stdillum-F1", 0.3131, 0.3371),
            ("stdillum-F2", 0.3721, 0.3751),
            ("stdillum-F3", 0.4091, 0.3941),
            ("stdillum-F4", 0.4402, 0.4031),
            ("stdillum-F5", 0.3138, 0.3452),
            ("stdillum-F6", 0.3779, 0.3882),
            ("stdillum-F7", 0.3129, 0.3292),
            ("stdillum-F8", 0.3458, 0.3586),
            ("stdillum-F9", 0.3741, 0.3727),
            ("stdillum-F10", 0.3458, 0.3588),
            ("stdillum-F11", 0.3805, 0.3769),
            ("stdillum-F12", 0.4370, 0.4042),
        ];
        for (name, x, y) in published {
            let (our_x, our_y) = chromaticity(&named(name));
            // (The published ones are sums every 5 nm, which the lines of a lamp are not quite the same over.)
            assert!((our_x - x).abs() < 6e-4 && (our_y - y).abs() < 6e-4, "{name}: {our_x} {our_y}");
        }
    }

    #[test]
    fn lamps_have_the_colours_of_the_observer_at_every_nanometre() {
        // Integrated with the observer's table for every nanometre, at luminance 1.
        let expected = [
            ("stdillum-A", [1.845, 0.82607, 0.23337]),
            ("stdillum-D50", [1.0866, 0.99951, 0.74971]),
            ("illum-acesD60", [1.0469, 0.99457, 0.91553]),
            ("stdillum-F1", [0.95426, 1.0193, 0.94367]),
            ("stdillum-F2", [1.3401, 0.94299, 0.56285]),
            ("stdillum-F3", [1.5764, 0.89107, 0.38089]),
            ("stdillum-F4", [1.8063, 0.8342, 0.26707]),
            ("stdillum-F5", [0.91539, 1.0362, 0.89032]),
            ("stdillum-F6", [1.3161, 0.95783, 0.4865]),
            ("stdillum-F7", [1.0003, 1.0002, 0.9974]),
            ("stdillum-F8", [1.1767, 0.97572, 0.72009]),
            ("stdillum-F9", [1.3768, 0.9314, 0.56935]),
            ("stdillum-F10", [1.1776, 0.97562, 0.71836]),
            ("stdillum-F11", [1.4121, 0.92473, 0.53156]),
            ("stdillum-F12", [1.7684, 0.84507, 0.27085]),
        ];
        for (name, colour) in expected {
            let ours = named(name).illuminant_rgb().to_array();
            let is_near = ours.iter().zip(colour).all(|(a, b)| (a / b - 1.0).abs() < 1e-3);
            assert!(is_near, "{name}: {ours:?}, expected {colour:?}");
        }
    }

    #[test]
    fn a_step_between_wavelengths_has_its_colour() {
        // Integrated for every nanometre.
        let step = SpectrumValue::Sampled(vec![(360.0, 0.5), (550.0, 0.6), (551.0, 0.25), (830.0, 0.2)]);
        let colour = step.reflectance_rgb();
        assert!(close(colour, [0.096_938, 0.470_04, 0.569_12], 6e-5), "{colour:?}");
    }

    #[test]
    fn glass_bends_the_d_line_as_its_catalogue_says() {
        let published = [
            ("glass-BK7", 1.5168),
            ("glass-BAF10", 1.67003),
            ("glass-FK51A", 1.48656),
            ("glass-LASF9", 1.85025),
            ("glass-F5", 1.6727),
            ("glass-F10", 1.72825),
            ("glass-F11", 1.78472),
            ("metal-MgO-eta", 1.7375),
            ("metal-TiO2-eta", 2.91237),
        ];
        for (name, n) in published {
            let ours = named(name).index_of_refraction();
            assert!((ours - n).abs() < 1e-3, "{name}: {ours}");
        }
    }

    #[test]
    fn metals_have_the_values_that_pbrt_gives_them() {
        // (η, k) at entries of its tables, half way between two, and beyond the ends.
        let published = [
            ("Ag", 551.041, 0.124375, 3.34813),
            ("Ag", 200.0, 1.519, 1.08),
            ("Ag", 300.5785, 1.5075, 0.981),
            ("Ag", 2000.0, 0.163, 5.95),
            ("Cu", 298.757, 1.40031, 1.66213),
            ("Cu", 885.601, 0.3, 5.717),
            ("Au", 298.757, 1.795, 1.92037),
            ("Au", 885.601, 0.21, 5.88),
            ("Al", 298.757, 0.273375, 3.59375),
            ("Al", 885.601, 2.24, 8.21),
            ("CuZn", 440.0, 1.191, 1.797),
            ("MgO", 767.678, 1.72872, 0.0),
            ("TiO2", 412.031, 3.24, 0.022),
            ("TiO2", 359.988, 3.87, 0.251),
        ];
        for (metal, nm, eta, k) in published {
            let ours = ["eta", "k"].map(|what| named(&format!("metal-{metal}-{what}")).at(nm).unwrap());
            assert!((ours[0] - eta).abs() < 1e-9 && (ours[1] - k).abs() < 1e-9, "{metal} at {nm}: {ours:?}");
        }
    }

    #[test]
    fn built_in_spectra_are_found_by_name_and_finite() {
        let mut count = 0;
        for name in NamedSpectrum::names() {
            let spectrum = NamedSpectrum::from_name(name).unwrap();
            assert_eq!(spectrum.name(), name);
            for nm in (360..=830).step_by(5) {
                let value = spectrum.at(f64::from(nm));
                assert!(value.is_finite() && value >= 0.0, "{name} at {nm}: {value}");
            }
            count += 1;
        }
        assert_eq!(count, 7 + 14 + 3 + 12 + 1);
        assert_eq!(NamedSpectrum::from_name("glass-BK8"), None);
    }

    #[test]
    fn constant_reflectance_is_grey_and_d65_is_white() {
        let grey = SpectrumValue::Sampled(vec![(500.0, 0.37)]);
        assert!(close(grey.reflectance_rgb(), [0.37; 3], 1e-6));
        assert!(close(grey.unbounded_rgb(), [0.37; 3], 1e-6));
        let white = named("stdillum-D65").illuminant_rgb();
        assert!(close(white, [1.0; 3], 1.5e-3), "{white:?}");
    }

    #[test]
    fn channels_are_sums_of_the_values_at_nodes() {
        let nodes = [350.0, 420.0, 433.5, 500.0, 610.0, 700.0];
        let values = [0.3, 0.1, 0.7, 0.2, 0.9, 0.4];
        let pairs = nodes.iter().zip(values).map(|(&nm, v)| (f64::from(nm), v)).collect();
        let expected = SpectrumValue::Sampled(pairs).reflectance_rgb();
        let weights = channel_weights(&nodes);
        let sum = |values: &[f64]| {
            spectrum(std::array::from_fn(|c| weights.iter().zip(values).map(|(w, v)| w[c] * v).sum()))
        };
        assert!(close(sum(&values), expected.to_array(), 1e-6), "{:?} {expected:?}", sum(&values));
        assert!(close(sum(&[1.0; 6]), [1.0; 3], 1e-6));
    }

    #[test]
    fn spectral_light_has_luminance_one_and_colours_stay() {
        let mut count = 0;
        for kelvin in [900.0, 1500.0, 2700.0, 4000.0, 6500.0, 20_000.0] {
            let colour = SpectrumValue::Blackbody(kelvin).illuminant_rgb();
            assert!((colour.luminance() - 1.0).abs() < 1e-4, "{kelvin}: {colour:?}");
            assert!(colour.min_component() >= 0.0);
            count += 1;
        }
        assert_eq!(count, 6);
        let warm = SpectrumValue::Blackbody(2700.0).illuminant_rgb();
        assert!(warm.r > warm.g && warm.g > warm.b);
        // 6504 K on the Planckian locus: (0.3135, 0.3236), a little less green than D65.
        let (x, y) = chromaticity(&SpectrumValue::Blackbody(6504.0));
        assert!((x - 0.3135).abs() < 3e-4 && (y - 0.3237).abs() < 3e-4, "{x} {y}");
        let colour = Spectrum::new(3.0, 0.5, 7.0);
        assert_eq!(SpectrumValue::Rgb(colour).illuminant_rgb(), colour);
        assert_eq!(SpectrumValue::Sampled(vec![]).illuminant_rgb(), Spectrum::BLACK);
        assert_eq!(SpectrumValue::Blackbody(-3.0).illuminant_rgb(), Spectrum::BLACK);
    }

    #[test]
    fn metals_reflect_their_colour_head_on() {
        // Reflectance by wavelength, weighed as a surface's colour is: what the three lanes must give back.
        let mut count = 0;
        for metal in ["Ag", "Al", "Au", "Cu", "CuZn", "MgO", "TiO2"] {
            let (eta, k) = (named(&format!("metal-{metal}-eta")), named(&format!("metal-{metal}-k")));
            let expected = SpectrumValue::Sampled(
                (360..=830)
                    .map(|nm| {
                        let nm = f64::from(nm);
                        let (eta, k) = (eta.at(nm).unwrap(), k.at(nm).unwrap());
                        (nm, ((eta - 1.0).powi(2) + k * k) / ((eta + 1.0).powi(2) + k * k))
                    })
                    .collect(),
            )
            .unbounded_rgb();
            let (eta, k) = conductor_rgb(&eta, &k);
            let ours = crate::fresnel::conductor(1.0, eta, k);
            assert!(close(ours, expected.to_array(), 2e-4), "{metal}: {ours:?} {expected:?}");
            count += 1;
        }
        assert_eq!(count, 7);
        let (eta, k) = conductor_rgb(&named("metal-Au-eta"), &named("metal-Au-k"));
        let gold = crate::fresnel::conductor(1.0, eta, k);
        // Integrated for every nanometre; red is outside the gamut.
        assert!(close(gold, [1.0219, 0.78245, 0.3434], 1e-3), "{gold:?}");
        let grazing = crate::fresnel::conductor(0.0, eta, k);
        assert!(close(grazing, [1.0; 3], 1e-6), "{grazing:?}");
    }

    #[test]
    fn samples_are_linear_between_and_constant_beyond() {
        let ramp = SpectrumValue::Sampled(vec![(400.0, 2.0), (500.0, 4.0)]);
        for (nm, value) in [(300.0, 2.0), (400.0, 2.0), (425.0, 2.5), (500.0, 4.0), (900.0, 4.0)] {
            assert_eq!(ramp.at(nm), Some(value));
        }
        assert_eq!(SpectrumValue::Rgb(Spectrum::WHITE).at(500.0), None);
    }
}
