//! The light of the sun's disc through the air.

use std::sync::Arc;

use lumbre_image::Rgb;
use lumbre_math::Elementary;

use crate::SpectrumValue;
use crate::spectrum::{LightCurve, luminance_of};

/// The unit of luminance in cd/m².
pub(super) const UNIT: f64 = 100_000.0 / std::f64::consts::PI;
/// Luminous efficacy, in lm/W.
pub(super) const EFFICACY: f64 = 683.0;
/// The temperature of the sun in kelvin, of which its disc is a black body: A. Prša and others, "Nominal Values for
/// Selected Solar and Planetary Quantities: IAU 2015 Resolution B3", 2016.
const TEMPERATURE: f64 = 5772.0;
/// The thickness of the ozone layer in cm.
const OZONE: f64 = 0.35;
/// The absorption of ozone per cm, by wavelength in nm: M. Iqbal, "An Introduction to Solar Radiation", 1983.
const OZONE_ABSORPTION: [(f64, f64); 52] = [
    (445.0, 0.003),
    (450.0, 0.003),
    (455.0, 0.004),
    (460.0, 0.006),
    (465.0, 0.008),
    (470.0, 0.009),
    (475.0, 0.012),
    (480.0, 0.014),
    (485.0, 0.017),
    (490.0, 0.021),
    (495.0, 0.025),
    (500.0, 0.03),
    (505.0, 0.035),
    (510.0, 0.04),
    (515.0, 0.045),
    (520.0, 0.048),
    (525.0, 0.057),
    (530.0, 0.063),
    (535.0, 0.07),
    (540.0, 0.075),
    (545.0, 0.08),
    (550.0, 0.085),
    (555.0, 0.095),
    (560.0, 0.103),
    (565.0, 0.11),
    (570.0, 0.12),
    (575.0, 0.122),
    (580.0, 0.12),
    (585.0, 0.118),
    (590.0, 0.115),
    (595.0, 0.12),
    (600.0, 0.125),
    (605.0, 0.13),
    (610.0, 0.12),
    (620.0, 0.105),
    (630.0, 0.09),
    (640.0, 0.079),
    (650.0, 0.067),
    (660.0, 0.057),
    (670.0, 0.048),
    (680.0, 0.036),
    (690.0, 0.028),
    (700.0, 0.023),
    (710.0, 0.018),
    (720.0, 0.014),
    (730.0, 0.011),
    (740.0, 0.01),
    (750.0, 0.009),
    (760.0, 0.007),
    (770.0, 0.004),
    (780.0, 0.0),
    (790.0, 0.0),
];
/// The wavelengths of the spectrum, in nm.
const FIRST: u32 = 360;
const LAST: u32 = 830;
const STEP: u32 = 5;

/// The light of the sun's disc where it reaches the ground, on a surface that faces it.
///
/// A black body through clear air: the optical depths of molecules, aerosols and ozone of A. J. Preetham, P. Shirley
/// and B. Smits, "A Practical Analytic Model for Daylight", SIGGRAPH 1999, appendix 1.
#[derive(Clone, Debug)]
pub struct Sunlight {
    /// The irradiance, in the unit of [`crate::sky`] times steradians: π is 100,000 lux.
    pub irradiance: Rgb,
    /// Its spectrum with luminance 1.
    pub spectrum: Arc<LightCurve>,
}

impl Sunlight {
    /// The diameter of the sun in degrees, seen from the earth at its mean distance.
    pub const ANGLE: f64 = 0.533;

    /// The light of a sun at this height above the horizon in degrees, through air of this turbidity; `None` if the air
    /// lets none through.
    pub fn new(elevation: f64, turbidity: f64) -> Option<Self> {
        let depth = |nm: f64| optical_depth(nm, elevation, turbidity);
        let radiance = |nm: f64| black_body(nm) * (-depth(nm)).exponential();
        let samples =
            (FIRST..=LAST).step_by(STEP as usize).map(|nm| (f64::from(nm), radiance(f64::from(nm))));
        let spectrum = SpectrumValue::Sampled(samples.collect());
        let luminance = EFFICACY * luminance_of(&spectrum)?;
        let half = (0.5 * Self::ANGLE).to_radians().sine();
        let irradiance = luminance / UNIT * std::f64::consts::PI * half * half;
        Some(Self {
            irradiance: spectrum.illuminant_rgb() * irradiance as f32,
            spectrum: Arc::new(LightCurve::of(&spectrum)?),
        })
    }
}

/// The spectral radiance of the sun in W/(m² sr nm): Planck's law.
fn black_body(nm: f64) -> f64 {
    // 2hc² in W m²/sr, times 1e-9 for nm, and hc/k in nm K, with the constants of the SI of 2019.
    const FIRST_CONSTANT: f64 = 1.191_042_972e-16;
    const SECOND_CONSTANT: f64 = 1.438_776_877e7;
    let metres = nm * 1e-9;
    let x = SECOND_CONSTANT / (nm * TEMPERATURE);
    1e-9 * FIRST_CONSTANT / (metres.powi(5) * x.exponential_minus_1())
}

/// The optical depth of the air along the way of sunlight.
fn optical_depth(nm: f64, elevation: f64, turbidity: f64) -> f64 {
    let zenith = 90.0 - elevation;
    // The mass of air on the way, relative to that below the zenith.
    let mass = 1.0 / (elevation.to_radians().sine() + 0.15 * (93.885 - zenith).power(-1.253));
    let micrometres = nm / 1000.0;
    let molecules = 0.008735 * micrometres.power(-4.08);
    let haze = (0.04608 * turbidity - 0.04586).max(0.0) * micrometres.power(-1.3);
    mass * (molecules + haze + OZONE * ozone(nm))
}

/// The absorption of ozone per cm, linear between the entries of the table and 0 beyond them.
fn ozone(nm: f64) -> f64 {
    let next = OZONE_ABSORPTION.partition_point(|(at, _)| *at <= nm);
    if next == 0 || next == OZONE_ABSORPTION.len() {
        return 0.0;
    }
    let ((before, low), (after, high)) = (OZONE_ABSORPTION[next - 1], OZONE_ABSORPTION[next]);
    low + (high - low) * (nm - before) / (after - before)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lux(elevation: f64, turbidity: f64) -> f64 {
        f64::from(Sunlight::new(elevation, turbidity).unwrap().irradiance.luminance()) * UNIT
    }

    #[test]
    fn the_sun_above_the_air_gives_its_illuminance() {
        // A black body of 5772 K seen under 0.533 degrees gives 125,400 lux: the sum by the approximation of CIE's
        // curve of C. Wyman, P. Sloan and P. Shirley, 2013. Of the sun itself 127,500 to 133,300 are measured.
        let radiance = (FIRST..=LAST).map(|nm| (f64::from(nm), black_body(nm.into())));
        let luminance = EFFICACY * luminance_of(&SpectrumValue::Sampled(radiance.collect())).unwrap();
        let half = (0.5 * Sunlight::ANGLE).to_radians().sin();
        let lux = luminance * std::f64::consts::PI * half * half;
        assert!((lux / 125_400.0 - 1.0).abs() < 3e-3, "{lux}");
    }

    #[test]
    fn low_sun_and_hazy_air_make_sunlight_weaker_and_redder() {
        assert!((80_000.0..110_000.0).contains(&lux(60.0, 2.0)), "{}", lux(60.0, 2.0));
        for (bright, dark) in
            [((60.0, 3.0), (30.0, 3.0)), ((30.0, 3.0), (5.0, 3.0)), ((30.0, 2.0), (30.0, 6.0))]
        {
            let [high, low] =
                [bright, dark].map(|(elevation, turbidity)| Sunlight::new(elevation, turbidity).unwrap());
            assert!(high.irradiance.luminance() > low.irradiance.luminance());
            assert!(high.irradiance.b / high.irradiance.r > low.irradiance.b / low.irradiance.r);
        }
    }

    #[test]
    fn the_air_below_the_zenith_is_one_mass() {
        let single = optical_depth(550.0, 90.0, 1.0);
        assert!(
            (single / (0.008735 * 0.55_f64.powf(-4.08) + 0.00022 * 0.55_f64.powf(-1.3) + 0.35 * 0.085) - 1.0)
                .abs()
                < 2e-3
        );
        // Near the horizon it is some 38: F. Kasten, A. T. Young, 1989.
        let ratio = optical_depth(550.0, 0.0, 1.0) / single;
        assert!((30.0..42.0).contains(&ratio), "{ratio}");
    }
}
