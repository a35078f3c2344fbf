//! Tone mapping: from scene light to displayable colours.

use crate::{Encoded, Rgb};
use lumbre_math::Elementary;

/// A tone mapping operator.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ToneMap {
    /// Clamped at 1.
    #[default]
    None,
    /// AgX: a sigmoid of the logarithm of light, on inset primaries so that bright colours fade to white.
    AgX,
    /// A fit to the reference rendering of ACES for a standard display.
    Aces,
    /// Colours below 0.8 are unchanged; highlights are compressed.
    Neutral,
}

impl ToneMap {
    /// The names, in the order of the enum.
    pub const NAMES: [&'static str; 4] = ["none", "agx", "aces", "neutral"];

    /// The operator of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        match name {
            "none" => Some(Self::None),
            "agx" => Some(Self::AgX),
            "aces" => Some(Self::Aces),
            "neutral" => Some(Self::Neutral),
            _ => None,
        }
    }

    /// The displayed light in `[0, 1]` for `light`. Negative numbers and NaN count as 0.
    pub fn apply(self, light: Rgb) -> Rgb {
        let light = light.map(|c| if c.is_nan() { 0.0 } else { c.clamp(0.0, f32::MAX) });
        let shown = match self {
            Self::None => light,
            Self::AgX => agx(light),
            Self::Aces => aces(light),
            Self::Neutral => neutral(light),
        };
        shown.clamp(0.0, 1.0)
    }

    /// `light`, brightened by `exposure` stops, tone mapped and encoded as sRGB.
    pub fn encode(self, light: Rgb, exposure: f32) -> Encoded {
        Encoded::srgb(self.apply(light * exposure.exponential_2()))
    }
}

fn mul(rows: [[f32; 3]; 3], c: Rgb) -> Rgb {
    let [r, g, b] = rows.map(|row| row[0] * c.r + row[1] * c.g + row[2] * c.b);
    Rgb::new(r, g, b)
}

/// T. Sobotka, "AgX", 2022; the matrix and the range in stops as in B. Wrensch, "Minimal AgX implementation",
/// 2023. The curve is the sigmoid itself rather than a polynomial fitted to it.
fn agx(light: Rgb) -> Rgb {
    const INSET: [[f32; 3]; 3] = [
        [0.842_479_06, 0.078_433_6, 0.079_223_745],
        [0.042_328_242, 0.878_468_64, 0.079_166_13],
        [0.042_375_655, 0.078_433_6, 0.879_142_97],
    ];
    // The inverse of INSET.
    const OUTSET: [[f32; 3]; 3] = [
        [1.196_879_005_12, -0.098_020_881_14, -0.099_029_744_08],
        [-0.052_896_851_757, 1.151_903_129_9, -0.098_961_176_815],
        [-0.052_971_635_514, -0.098_043_450_118, 1.151_073_672_64],
    ];
    // Ten stops below middle grey (0.18) to six and a half above.
    const STOPS: [f32; 2] = [-12.473_93, 4.026_069];

    let stretched = mul(INSET, light).map(|c| {
        let stops = c.max(1e-10).logarithm_2().clamp(STOPS[0], STOPS[1]);
        agx_sigmoid((stops - STOPS[0]) / (STOPS[1] - STOPS[0]))
    });
    // The curve is for a display of exponent 2.2: back to light for the sRGB curve.
    mul(OUTSET, stretched).map(|c| c.max(0.0).power(2.2))
}

/// From (0, 0) to (1, 1) with slope 2 at the pivot, which is middle grey: each side of it is a scaled `t / (1 +
/// t^p)^(1/p)`, whose scale follows from its end.
fn agx_sigmoid(x: f32) -> f32 {
    const PIVOT: [f32; 2] = [10.0 / 16.5, 0.5];
    const SLOPE: f32 = 2.0;
    let (sign, run, rise, power) = if x < PIVOT[0] {
        (-1.0, PIVOT[0], PIVOT[1], 3.0)
    } else {
        (1.0, 1.0 - PIVOT[0], 1.0 - PIVOT[1], 3.25)
    };
    let scale = SLOPE * run * ((SLOPE * run / rise).power(power) - 1.0).power(-1.0 / power);
    let t = SLOPE * (x - PIVOT[0]).abs() / scale;
    PIVOT[1] + sign * scale * t * (1.0 + t.power(power)).power(-1.0 / power)
}

/// S. Hill's fit of the ACES 1.0 reference rendering and sRGB output transforms, as published with "Baking Lab"
/// (M. Pettineo and others, 2015).
fn aces(light: Rgb) -> Rgb {
    const INTO: [[f32; 3]; 3] =
        [[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]];
    const OUT: [[f32; 3]; 3] =
        [[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]];
    // Beyond this the fraction is at its limit, and its squares could overflow.
    let fit = |v: f32| {
        let v = v.min(1e15);
        (v * (v + 0.024_578_6) - 0.000_090_537) / (v * (0.983_729 * v + 0.432_951) + 0.238_081)
    };
    mul(OUT, mul(INTO, light).map(fit))
}

/// Khronos Group, "PBR Neutral tone mapper" specification, 2024.
fn neutral(light: Rgb) -> Rgb {
    /// Fresnel reflectance at normal incidence of a common dielectric, which base colours do not include.
    const F90: f32 = 0.04;
    const START: f32 = 0.8 - F90;
    const DESATURATION: f32 = 0.15;

    let least = light.min_component();
    let offset = if least < 2.0 * F90 { least - least * least / (4.0 * F90) } else { F90 };
    let colour = light.map(|c| c - offset);
    let peak = colour.max_component();
    if peak < START {
        return colour;
    }
    let room = 1.0 - START;
    let new_peak = 1.0 - room * room / (peak + room - START);
    let faded = 1.0 - 1.0 / (DESATURATION * (peak - new_peak) + 1.0);
    colour.map(|c| c / peak * new_peak).lerp(Rgb::splat(new_peak), faded)
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [ToneMap; 4] = [ToneMap::None, ToneMap::AgX, ToneMap::Aces, ToneMap::Neutral];

    #[test]
    fn every_map_has_its_name() {
        for (name, map) in ToneMap::NAMES.into_iter().zip(ALL) {
            assert_eq!(ToneMap::from_name(name), Some(map));
        }
        assert_eq!(ToneMap::from_name("filmic"), None);
    }

    #[test]
    fn greys_grow_with_light_stay_grey_and_within_the_display() {
        for map in ALL {
            let mut last = -1.0;
            for i in 0..4000 {
                let light = 2f32.powf(i as f32 / 200.0 - 12.0);
                let shown = map.apply(Rgb::splat(light));
                let spread = shown.max_component() - shown.min_component();
                assert!(spread < 2e-3, "{map:?} {light}: {shown:?}");
                assert!(last <= shown.g + 1e-6 && shown.g <= 1.0, "{map:?} {light}");
                last = shown.g;
            }
            assert!(last > 0.97, "{map:?} shows the brightest as {last}");
        }
    }

    #[test]
    fn nothing_that_is_not_a_number_comes_out() {
        let odd = [0.0, -0.0, -5.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, 1e-45, 0.3];
        for map in ALL {
            for r in odd {
                for g in odd {
                    for b in odd {
                        let shown = map.apply(Rgb::new(r, g, b));
                        let fine = |c: f32| (0.0..=1.0).contains(&c);
                        assert!(
                            fine(shown.r) && fine(shown.g) && fine(shown.b),
                            "{map:?} {r} {g} {b}: {shown:?}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn the_agx_curve_agrees_with_the_published_polynomial() {
        // B. Wrensch's sixth-degree fit, whose mean squared error he gives as 3.67e-6.
        let fitted = |x: f64| {
            let c = [-0.00232, 0.1191, 0.4298, -6.868, 31.96, -40.14, 15.5];
            c.iter().rev().fold(0.0, |sum, c| sum * x + c)
        };
        let errors: Vec<f64> = (0..=1000)
            .map(|i| f64::from(agx_sigmoid(i as f32 / 1000.0)) - fitted(f64::from(i) / 1000.0))
            .collect();
        let mean_squared = errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64;
        assert!(mean_squared < 1e-5, "{mean_squared}");
        assert!(agx_sigmoid(0.0).abs() < 1e-6 && (agx_sigmoid(1.0) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn agx_and_its_outset_undo_each_other_on_the_diagonal() {
        // Middle grey is where the sigmoid crosses one half: 0.5^2.2.
        let shown = ToneMap::AgX.apply(Rgb::splat(0.18));
        assert!((shown - Rgb::splat(0.5f32.powf(2.2))).map(f32::abs).max_component() < 1e-3, "{shown:?}");
    }

    #[test]
    fn neutral_keeps_base_colours_as_the_specification_says() {
        let c = ToneMap::Neutral.apply(Rgb::new(0.5, 0.4, 0.3));
        assert!((c - Rgb::new(0.46, 0.36, 0.26)).map(f32::abs).max_component() < 1e-6);
        // Worked by hand: peak 1.96, new peak 1 - 0.0576 / 1.44 = 0.96.
        let grey = ToneMap::Neutral.apply(Rgb::splat(2.0));
        assert!((grey.r - 0.96).abs() < 1e-6, "{grey:?}");
    }

    #[test]
    fn aces_has_the_value_of_its_formula_at_one() {
        // (1 + 0.0245786 - 0.000090537) / (0.983729 + 0.432951 + 0.238081), on the diagonal of both matrices.
        let white = ToneMap::Aces.apply(Rgb::WHITE);
        assert!((white.g - 0.6191).abs() < 1e-3, "{white:?}");
    }

    #[test]
    fn exposure_is_in_stops() {
        let c = Rgb::new(0.02, 0.05, 0.1);
        assert_eq!(ToneMap::None.encode(c, 2.0), ToneMap::None.encode(c * 4.0, 0.0));
        assert_eq!(ToneMap::AgX.encode(c, -1.0), ToneMap::AgX.encode(c * 0.5, 0.0));
    }
}
