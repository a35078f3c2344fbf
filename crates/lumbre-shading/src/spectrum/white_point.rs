//! The white of light of a temperature.

use super::{blackbody, observe};

/// The chromaticity (CIE 1931 x and y) of light of a correlated colour temperature in kelvin: daylight of that
/// temperature, or a black body below 4000 K, as pbrt takes it for a white balance. `None` where a temperature is not
/// positive, or so low that nothing is seen.
///
/// Temperatures are taken by the constant of radiation of the time when daylight was tabulated (1.4380 cm K). Daylight
/// after CIE 15:2018.
pub fn white_point(kelvin: f64) -> Option<[f64; 2]> {
    let kelvin = kelvin * (1.4388 / 1.4380);
    if kelvin < 4000.0 {
        let [x, y, z] = observe(|nm| blackbody(nm, kelvin));
        let sum = x + y + z;
        return (sum > 1e-30 && y > 0.0).then(|| [x / sum, y / sum]);
    }
    let t = 1000.0 / kelvin;
    let x = if kelvin <= 7000.0 {
        0.244_063 + t * (0.099_11 + t * (2.967_8 - t * 4.607))
    } else {
        0.237_040 + t * (0.247_48 + t * (1.901_8 - t * 2.006_4))
    };
    x.is_finite().then(|| [x, -3.0 * x * x + 2.87 * x - 0.275])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_points_are_the_published_ones() {
        // D65 and D50 of CIE 15, and illuminant A (2856 K by the constant of its time, 1.4350).
        for (kelvin, [x, y]) in
            [(6500.0, [0.3127, 0.3291]), (5000.0, [0.3457, 0.3586]), (2854.5, [0.4476, 0.4074])]
        {
            let [found_x, found_y] = white_point(kelvin).unwrap();
            assert!(
                (found_x - x).abs() < 3e-4 && (found_y - y).abs() < 3e-4,
                "{kelvin}: {found_x} {found_y}"
            );
        }
        assert!(white_point(0.0).is_none() && white_point(-5.0).is_none() && white_point(1.0).is_none());
        assert!(white_point(f64::NAN).is_none());
    }
}
