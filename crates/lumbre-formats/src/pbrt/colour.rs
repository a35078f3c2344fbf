//! Conversion of `rgb` values of a colour space to linear Rec. 709.

use lumbre_image::{ColourSpace, Rgb};
use lumbre_math::{DMat3, DVec3};
use lumbre_shading::spectrum::white_point;

/// Light: the same stimulus, without adaptation, so that the white of ACES stays warmer than D65. Colours
/// outside the gamut of Rec. 709 are clipped.
pub(super) fn light(space: &ColourSpace, rgb: [f64; 3]) -> Rgb {
    if *space == ColourSpace::REC709 {
        return Rgb::new(rgb[0] as f32, rgb[1] as f32, rgb[2] as f32);
    }
    let matrix = space.to(&ColourSpace::REC709).unwrap_or(DMat3::IDENTITY);
    let c = matrix * DVec3::from_array(rgb);
    Rgb::new(c.x as f32, c.y as f32, c.z as f32).map(|c| c.max(0.0))
}

/// A reflectance or another factor on light: 1 in every channel is preserved.
pub(super) fn factor(space: &ColourSpace, rgb: [f64; 3]) -> Rgb {
    space.to_rec709(rgb).map(|c| c.max(0.0))
}

/// What a film makes of light in linear Rec. 709 which takes light of this temperature in kelvin for white, by the
/// linear Bradford transform; `None` for a temperature that has no colour.
pub(super) fn balanced(kelvin: f64) -> Option<DMat3> {
    let lit = ColourSpace { white: white_point(kelvin)?, ..ColourSpace::REC709 };
    // The same light in the space of the other white, and then the same appearance.
    Some(lit.adapted_to(&ColourSpace::REC709)? * ColourSpace::REC709.to(&lit)?)
}

/// CIE XYZ to linear Rec. 709, for pbrt-v3's `xyz` parameters.
pub(super) fn rgb_from_xyz(xyz: [f64; 3]) -> [f64; 3] {
    let from_rgb = ColourSpace::REC709.to_xyz().unwrap_or(DMat3::IDENTITY);
    (from_rgb.inverse() * DVec3::from_array(xyz)).to_array()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_reflects_white_though_white_light_of_aces_is_warm() {
        let reflected = factor(&ColourSpace::ACES2065_1, [1.0; 3]);
        assert!(reflected.zip(Rgb::WHITE, |a, b| (a - b).abs()).max_component() < 1e-5);
        let white = light(&ColourSpace::ACES2065_1, [1.0; 3]);
        assert!(white.r > 1.02 && white.b < 0.95, "{white:?}");
        assert!((white.luminance() - 1.0).abs() < 1e-3);
    }

    #[test]
    fn light_of_rec709_passes_unchanged_and_wide_light_is_clipped() {
        assert_eq!(light(&ColourSpace::REC709, [0.2, 3.0, 0.5]), Rgb::new(0.2, 3.0, 0.5));
        let red = light(&ColourSpace::REC2020, [2.0, 0.0, 0.0]);
        assert!((red.r - 3.321).abs() < 1e-3 && red.g == 0.0 && red.b == 0.0, "{red:?}");
    }

    #[test]
    fn light_of_the_balance_becomes_white() {
        for kelvin in [1500.0, 3200.0, 5000.0, 9000.0] {
            let [x, y] = white_point(kelvin).unwrap();
            let warm = DVec3::from_array(rgb_from_xyz([x / y, 1.0, (1.0 - x - y) / y]));
            let found = balanced(kelvin).unwrap() * warm;
            assert!((found - 1.0).abs().max_element() < 1e-9, "{kelvin}: {found}");
        }
        // Computed by hand of the published matrices for a black body of 3202 K.
        let found = balanced(3200.0).unwrap() * DVec3::new(0.5, 0.4, 0.3);
        let expected = DVec3::new(0.23017, 0.45263, 0.82918);
        assert!((found / expected - 1.0).abs().max_element() < 2e-3, "{found}");
        assert!(balanced(1.0).is_none());
    }

    #[test]
    fn xyz_of_white_is_white() {
        let white = rgb_from_xyz([0.950_456, 1.0, 1.089_058]);
        assert!(white.iter().all(|v| (v - 1.0).abs() < 1e-3), "{white:?}");
    }
}
