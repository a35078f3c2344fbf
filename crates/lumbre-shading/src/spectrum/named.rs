//! The built-in spectra: published tables and formulas.
//!
//! - Glasses: Sellmeier's formula with the coefficients of the SCHOTT catalogue of 2017.
//! - Silver, gold, copper: Johnson and Christy, "Optical Constants of the Noble Metals", Physical Review B 6, 1972.
//! - Aluminium: Rakić, "Algorithm for the Determination of Intrinsic Optical Constants of Metal Films", Applied Optics
//!   34(22), 1995.
//! - Brass (CuZn): Querry, "Optical Constants", Contractor Report CRDC-CR-85034, 1985, of 70 % copper and 30 % zinc.
//! - Magnesium oxide: Stephens and Malitson, "Index of Refraction of Magnesium Oxide", Journal of Research of the
//!   National Bureau of Standards 49(4), 1952. Titanium dioxide: Devore, "Refractive Indices of Rutile and Sphalerite",
//!   JOSA 41(6), 1951, ordinary ray. Neither absorbs in the visible: k is 0 (for rutile this is off below 430 nm).
//! - CIE illuminants: CIE 15:2018. D50, D65 and the D60 of ACES follow the daylight formula.

use super::{fluorescent, interpolate};
use lumbre_math::Elementary;

/// A built-in spectrum. Beyond the wavelengths of its source it is constant; a fluorescent lamp is zero there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NamedSpectrum {
    // The index in `TABLE`.
    index: usize,
}

impl NamedSpectrum {
    /// The spectrum of this name.
    pub fn from_name(name: &str) -> Option<Self> {
        TABLE.iter().position(|entry| entry.0 == name).map(|index| Self { index })
    }

    /// All names.
    pub fn names() -> impl Iterator<Item = &'static str> {
        TABLE.iter().map(|entry| entry.0)
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        TABLE[self.index].0
    }

    /// Its value at a wavelength in nm: an index of refraction, an absorption index k, or a relative power.
    pub fn at(self, nm: f64) -> f64 {
        match TABLE[self.index].1 {
            Source::Sellmeier(b, c) => {
                let l2 = micrometres2(nm);
                let sum: f64 = b.iter().zip(c).map(|(b, c)| b * l2 / (l2 - c)).sum();
                (1.0 + sum).sqrt()
            }
            Source::MagnesiumOxide => {
                let l2 = micrometres2(nm);
                let resonance = 0.021_957_70 / (l2 - 0.014_283_22);
                (2.956_362 + resonance - 0.010_623_87 * l2 - 0.000_020_496_8 * l2 * l2).sqrt()
            }
            Source::Rutile => {
                // No nearer to the resonance than the measurements.
                let l2 = micrometres2(nm.max(430.0));
                (5.913 + 0.2441 / (l2 - 0.0803)).sqrt()
            }
            Source::Eta(metal) => by_table(metal, nm, |row| row.1),
            Source::K(metal) => by_table(metal, nm, |row| row.2),
            Source::Zero => 0.0,
            // The constant of 1931, which defines illuminant A.
            Source::IlluminantA => {
                let shape = |nm: f64| nm.powi(-5) / (1.435e7 / (2848.0 * nm)).exponential_minus_1();
                100.0 * shape(nm) / shape(560.0)
            }
            Source::Daylight((m1, m2)) => daylight(nm, m1, m2),
            Source::Lamp(number) => lamp(nm, number),
        }
    }
}

/// Where a spectrum comes from.
#[derive(Clone, Copy)]
enum Source {
    /// n² = 1 + Σ Bᵢ λ² / (λ² − Cᵢ), λ in µm.
    Sellmeier([f64; 3], [f64; 3]),
    MagnesiumOxide,
    Rutile,
    /// η and k of a metal.
    Eta(Metal),
    K(Metal),
    Zero,
    IlluminantA,
    /// S₀ + M₁ S₁ + M₂ S₂.
    Daylight((f64, f64)),
    /// A fluorescent lamp of the CIE, F1 being 1.
    Lamp(usize),
}

/// (nm, η, k), ascending.
type Metal = &'static [(f64, f64, f64)];

/// (M₁, M₂) of D65 and of D50 as the CIE defines them, rounded to three decimals.
const M_D65: (f64, f64) = (-0.296, -0.688);
const M_D50: (f64, f64) = (-1.040, 0.367);
/// Those of the daylight with the chromaticity of the white of ACES, (0.32168, 0.33767).
const M_D60: (f64, f64) = (-0.531, -0.495);

/// D65.
pub(super) fn d65(nm: f64) -> f64 {
    daylight(nm, M_D65.0, M_D65.1)
}

fn daylight(nm: f64, m1: f64, m2: f64) -> f64 {
    let place = ((nm - 360.0) / 10.0).clamp(0.0, (DAYLIGHT.len() - 1) as f64);
    let i = (place as usize).min(DAYLIGHT.len() - 2);
    let t = place - i as f64;
    let value = |[s0, s1, s2]: [f64; 3]| s0 + m1 * s1 + m2 * s2;
    value(DAYLIGHT[i]) * (1.0 - t) + value(DAYLIGHT[i + 1]) * t
}

/// Linear between the entries, and zero beyond them.
fn lamp(nm: f64, number: usize) -> f64 {
    let powers = &fluorescent::LAMPS[number - 1];
    let place = (nm - fluorescent::FIRST_NM) / fluorescent::STEP_NM;
    let last = (powers.len() - 1) as f64;
    if !(0.0..=last).contains(&place) {
        return 0.0;
    }
    let i = (place as usize).min(powers.len() - 2);
    let t = place - i as f64;
    powers[i] * (1.0 - t) + powers[i + 1] * t
}

/// λ² in µm².
fn micrometres2(nm: f64) -> f64 {
    (nm * 1e-3).powi(2)
}

fn by_table(metal: Metal, nm: f64, value: impl Fn(&(f64, f64, f64)) -> f64) -> f64 {
    let after = metal.partition_point(|row| row.0 <= nm).clamp(1, metal.len() - 1);
    let pair = [&metal[after - 1], &metal[after]].map(|row| (row.0, value(row)));
    interpolate(&pair, nm)
}

#[rustfmt::skip]
const TABLE: &[(&str, Source)] = &[
    ("glass-BK7", Source::Sellmeier(
        [1.03961212, 0.231792344, 1.01046945], [0.00600069867, 0.0200179144, 103.560653])),
    ("glass-BAF10", Source::Sellmeier(
        [1.5851495, 0.143559385, 1.08521269], [0.00926681282, 0.0424489805, 105.613573])),
    ("glass-FK51A", Source::Sellmeier(
        [0.971247817, 0.216901417, 0.904651666], [0.00472301995, 0.0153575612, 168.68133])),
    ("glass-LASF9", Source::Sellmeier(
        [2.00029547, 0.298926886, 1.80691843], [0.0121426017, 0.0538736236, 156.530829])),
    // The scene language's F5, F10 and F11 have the data of SF5, SF10 and SF11, for historical reasons.
    ("glass-F5", SF5),
    ("glass-F10", SF10),
    ("glass-F11", SF11),
    ("metal-Ag-eta", Source::Eta(SILVER)),
    ("metal-Ag-k", Source::K(SILVER)),
    ("metal-Al-eta", Source::Eta(ALUMINIUM)),
    ("metal-Al-k", Source::K(ALUMINIUM)),
    ("metal-Au-eta", Source::Eta(GOLD)),
    ("metal-Au-k", Source::K(GOLD)),
    ("metal-Cu-eta", Source::Eta(COPPER)),
    ("metal-Cu-k", Source::K(COPPER)),
    ("metal-CuZn-eta", Source::Eta(BRASS)),
    ("metal-CuZn-k", Source::K(BRASS)),
    ("metal-MgO-eta", Source::MagnesiumOxide),
    ("metal-MgO-k", Source::Zero),
    ("metal-TiO2-eta", Source::Rutile),
    ("metal-TiO2-k", Source::Zero),
    ("stdillum-A", Source::IlluminantA),
    ("stdillum-D50", Source::Daylight(M_D50)),
    ("stdillum-D65", Source::Daylight(M_D65)),
    ("stdillum-F1", Source::Lamp(1)),
    ("stdillum-F2", Source::Lamp(2)),
    ("stdillum-F3", Source::Lamp(3)),
    ("stdillum-F4", Source::Lamp(4)),
    ("stdillum-F5", Source::Lamp(5)),
    ("stdillum-F6", Source::Lamp(6)),
    ("stdillum-F7", Source::Lamp(7)),
    ("stdillum-F8", Source::Lamp(8)),
    ("stdillum-F9", Source::Lamp(9)),
    ("stdillum-F10", Source::Lamp(10)),
    ("stdillum-F11", Source::Lamp(11)),
    ("stdillum-F12", Source::Lamp(12)),
    ("illum-acesD60", Source::Daylight(M_D60)),
];

const SF5: Source =
    Source::Sellmeier([1.46141885, 0.247713019, 0.949995832], [0.0111826126, 0.0508594669, 112.041888]);
const SF10: Source =
    Source::Sellmeier([1.61625977, 0.259229334, 1.07762317], [0.0127534559, 0.0581983954, 116.60768]);
const SF11: Source =
    Source::Sellmeier([1.73848403, 0.311168974, 1.17490871], [0.0136068604, 0.0615960463, 121.922711]);

#[rustfmt::skip]
const SILVER: Metal = &[
    (342.5, 0.14, 1.142), (354.2, 0.10, 1.419), (367.9, 0.07, 1.657), (381.5, 0.05, 1.864), (397.4, 0.05, 2.070),
    (413.3, 0.05, 2.275), (430.5, 0.04, 2.462), (450.9, 0.04, 2.657), (471.4, 0.05, 2.869), (495.9, 0.05, 3.093),
    (520.9, 0.05, 3.324), (548.6, 0.06, 3.586), (582.1, 0.05, 3.858), (616.8, 0.06, 4.152), (659.5, 0.05, 4.483),
    (704.5, 0.04, 4.838), (756.0, 0.03, 5.242), (821.1, 0.04, 5.727), (892.0, 0.04, 6.312),
];

#[rustfmt::skip]
const GOLD: Metal = &[
    (342.5, 1.48, 1.871), (354.2, 1.50, 1.866), (367.9, 1.48, 1.895), (381.5, 1.46, 1.933), (397.4, 1.47, 1.952),
    (413.3, 1.46, 1.958), (430.5, 1.45, 1.948), (450.9, 1.38, 1.914), (471.4, 1.31, 1.849), (495.9, 1.04, 1.833),
    (520.9, 0.62, 2.081), (548.6, 0.43, 2.455), (582.1, 0.29, 2.863), (616.8, 0.21, 3.272), (659.5, 0.14, 3.697),
    (704.5, 0.13, 4.103), (756.0, 0.14, 4.542), (821.1, 0.16, 5.083), (892.0, 0.17, 5.663),
];

#[rustfmt::skip]
const COPPER: Metal = &[
    (342.5, 1.36, 1.864), (354.2, 1.37, 1.916), (367.9, 1.36, 1.975), (381.5, 1.33, 2.045), (397.4, 1.32, 2.116),
    (413.3, 1.28, 2.207), (430.5, 1.25, 2.305), (450.9, 1.24, 2.397), (471.4, 1.25, 2.483), (495.9, 1.22, 2.564),
    (520.9, 1.18, 2.608), (548.6, 1.02, 2.577), (582.1, 0.70, 2.704), (616.8, 0.30, 3.205), (659.5, 0.22, 3.747),
    (704.5, 0.21, 4.205), (756.0, 0.24, 4.665), (821.1, 0.26, 5.180), (892.0, 0.30, 5.768),
];

#[rustfmt::skip]
const ALUMINIUM: Metal = &[
    (326.28, 0.31474, 3.9165), (364.66, 0.39877, 4.3957), (413.28, 0.52135, 5.0008), (442.80, 0.60790, 5.3676),
    (476.87, 0.72780, 5.7781), (516.60, 0.87340, 6.2418), (563.57, 1.0728, 6.7839), (619.93, 1.3660, 7.4052),
    (652.25, 1.5724, 7.7354), (688.81, 1.8301, 8.0601), (729.32, 2.1606, 8.3565), (774.91, 2.6154, 8.4914),
    (794.78, 2.7675, 8.3866), (815.69, 2.7668, 8.2573), (837.74, 2.6945, 8.1878),
];

#[rustfmt::skip]
const BRASS: Metal = &[
    (360.0, 1.503, 1.815), (370.0, 1.497, 1.818), (380.0, 1.487, 1.818), (390.0, 1.471, 1.813), (400.0, 1.445, 1.805),
    (410.0, 1.405, 1.794), (420.0, 1.350, 1.786), (430.0, 1.278, 1.784), (440.0, 1.191, 1.797), (450.0, 1.094, 1.829),
    (460.0, 0.994, 1.883), (470.0, 0.900, 1.957), (480.0, 0.816, 2.046), (490.0, 0.745, 2.145), (500.0, 0.686, 2.250),
    (510.0, 0.639, 2.358), (520.0, 0.602, 2.464), (530.0, 0.573, 2.568), (540.0, 0.549, 2.668), (550.0, 0.527, 2.765),
    (560.0, 0.505, 2.860), (570.0, 0.484, 2.958), (580.0, 0.468, 3.059), (590.0, 0.460, 3.159), (600.0, 0.450, 3.253),
    (610.0, 0.452, 3.345), (620.0, 0.449, 3.434), (630.0, 0.445, 3.522), (640.0, 0.444, 3.609), (650.0, 0.444, 3.695),
    (660.0, 0.445, 3.778), (670.0, 0.444, 3.860), (680.0, 0.444, 3.943), (690.0, 0.445, 4.025), (700.0, 0.446, 4.106),
    (720.0, 0.450, 4.266), (740.0, 0.455, 4.424), (760.0, 0.458, 4.579), (780.0, 0.464, 4.737), (800.0, 0.473, 4.890),
    (830.0, 0.483, 5.115),
];

/// (S₀, S₁, S₂) of daylight from 360 nm every 10 nm, linear between. Judd, MacAdam, Wyszecki, "Spectral Distribution of
/// Typical Daylight as a Function of Correlated Color Temperature", JOSA 54(8), 1964.
#[rustfmt::skip]
const DAYLIGHT: [[f64; 3]; 48] = [
    [61.50, 38.00, 5.30], [68.80, 42.40, 6.10], [63.40, 38.50, 3.00], [65.80, 35.00, 1.20], [94.80, 43.40, -1.10],
    [104.80, 46.30, -0.50], [105.90, 43.90, -0.70], [96.80, 37.10, -1.20], [113.90, 36.70, -2.60],
    [125.60, 35.90, -2.90], [125.50, 32.60, -2.80], [121.30, 27.90, -2.60], [121.30, 24.30, -2.60],
    [113.50, 20.10, -1.80], [113.10, 16.20, -1.50], [110.80, 13.20, -1.30], [106.50, 8.60, -1.20],
    [108.80, 6.10, -1.00], [105.30, 4.20, -0.50], [104.40, 1.90, -0.30], [100.00, 0.00, 0.00], [96.00, -1.60, 0.20],
    [95.10, -3.50, 0.50], [89.10, -3.50, 2.10], [90.50, -5.80, 3.20], [90.30, -7.20, 4.10], [88.40, -8.60, 4.70],
    [84.00, -9.50, 5.10], [85.10, -10.90, 6.70], [81.90, -10.70, 7.30], [82.60, -12.00, 8.60], [84.90, -14.00, 9.80],
    [81.30, -13.60, 10.20], [71.90, -12.00, 8.30], [74.30, -13.30, 9.60], [76.40, -12.90, 8.50], [63.30, -10.60, 7.00],
    [71.70, -11.60, 7.60], [77.00, -12.20, 8.00], [65.20, -10.20, 6.70], [47.70, -7.80, 5.20], [68.60, -11.20, 7.40],
    [65.00, -10.40, 6.80], [66.00, -10.60, 7.00], [61.00, -9.70, 6.40], [53.30, -8.30, 5.50], [58.90, -9.30, 6.10],
    [61.90, -9.80, 6.50],
];
