//! Thin-film interference: soap, oil on water, heated steel.

use std::f32::consts::PI;

use crate::{Spectrum, fresnel};
use lumbre_math::Elementary;

/// A thin film on a surface, whose two reflections interfere.
///
/// Belcour, Barla, "A Practical Extension to Microfacet Theory for the Modeling of Varying Iridescence",
/// SIGGRAPH 2017: the spectrum is integrated against the eye's sensitivity in Fourier space, where two orders
/// of interference suffice. As in glTF's KHR_materials_iridescence polarisation is ignored; unlike there, both
/// faces use the exact Fresnel terms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThinFilm {
    /// The share of the surface covered, in [0, 1].
    pub weight: f32,
    /// Index of refraction, at least 1.
    pub eta: f32,
    /// In nanometres, ≥ 0.
    pub thickness: f32,
}

impl ThinFilm {
    /// No film.
    pub const NONE: Self = Self { weight: 0.0, eta: 1.3, thickness: 0.0 };

    /// The film fades out below a thickness of 30 nm, where the method does not apply.
    fn eta_of_thickness(&self) -> f32 {
        let t = (self.thickness / 30.0).clamp(0.0, 1.0);
        1.0 + (self.eta.max(1.0) - 1.0) * t * t * (3.0 - 2.0 * t)
    }

    /// The reflectance at a cosine (outside) where the bare surface has the reflectance `f0` at normal
    /// incidence; each channel in [0, 1].
    pub fn reflectance(&self, cos: f32, f0: Spectrum) -> Spectrum {
        let eta = self.eta_of_thickness();
        let cos = cos.clamp(0.0, 1.0);
        let cos_inside = (1.0 - (1.0 - cos * cos) / (eta * eta)).max(0.0).sqrt();
        let outer = fresnel::dielectric(cos, eta);
        let passes = 1.0 - outer;
        let detour = 2.0 * eta * self.thickness * 1e-9 * cos_inside;
        let lane = |f0: f32, row: [f32; 3]| {
            let base = index_of(f0);
            let inner = fresnel::dielectric(cos_inside, base / eta);
            // Reflection inside the denser medium shifts the phase by half a wave: at the outer face always,
            // at the base where the film is the denser.
            let shift = if base < eta { 2.0 * PI } else { PI };
            let both = outer * inner;
            let series = passes * passes * inner / (1.0 - both).max(1e-6);
            let root = both.sqrt();
            let (mut order, mut sum) = (series - passes, outer + series);
            for m in 1..=2 {
                order *= root;
                let m = m as f32;
                let [x, y, z] = sensitivity(m * detour, m * shift);
                sum += 2.0 * order * (row[0] * x + row[1] * y + row[2] * z);
            }
            crate::unit(sum)
        };
        Spectrum::new(
            lane(f0.r, REC709_FROM_XYZ[0]),
            lane(f0.g, REC709_FROM_XYZ[1]),
            lane(f0.b, REC709_FROM_XYZ[2]),
        )
    }

    /// The maximal reflectance at normal incidence over all wavelengths: both faces in phase.
    pub fn most(&self, f0: Spectrum) -> Spectrum {
        let eta = self.eta_of_thickness();
        let outer = fresnel::dielectric(1.0, eta).sqrt();
        f0.map(|f0| {
            let inner = fresnel::dielectric(1.0, index_of(f0) / eta).sqrt();
            ((outer + inner) / (1.0 + outer * inner)).powi(2).max(f0)
        })
    }
}

/// The index of the dielectric with the reflectance `f0` at normal incidence.
pub(crate) fn index_of(f0: f32) -> f32 {
    let root = f0.clamp(0.0, 0.9999).sqrt();
    (1.0 + root) / (1.0 - root)
}

/// Linear Rec. 709 from CIE XYZ, for a white of (1, 1, 1): each row is divided by its sum.
const REC709_FROM_XYZ: [[f32; 3]; 3] =
    [[2.688_95, -1.275_71, -0.413_24], [-1.022_15, 1.978_32, 0.043_83], [0.061_21, -0.224_49, 1.163_28]];

/// The Fourier transform of the eye's sensitivity (X, Y, Z) at an optical path difference in metres, with a
/// phase shift: sums of Gaussians in the wave number, with the constants fitted by Belcour and Barla,
/// normalised to 1 for no difference.
fn sensitivity(path: f32, shift: f32) -> [f32; 3] {
    const AMPLITUDES: [f32; 4] = [5.4856e-13, 4.4201e-13, 5.2481e-13, 9.7470e-14];
    const PLACES: [f32; 4] = [1.6810e6, 1.7953e6, 2.2084e6, 2.2399e6];
    const VARIANCES: [f32; 4] = [4.3278e9, 9.3046e9, 6.6121e9, 4.5282e9];
    let phase = 2.0 * PI * path;
    let lobe = |i: usize, at: f32, spread: f32| {
        let height = AMPLITUDES[i] * (2.0 * PI * VARIANCES[i]).sqrt();
        height * at.cosine() * (-VARIANCES[i] * spread).exponential()
    };
    let all = |i: usize| lobe(i, PLACES[i] * phase + shift, phase * phase);
    let white = |i: usize| lobe(i, 0.0, 0.0);
    [(all(0) + all(3)) / (white(0) + white(3)), all(1) / white(1), all(2) / white(2)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_film_of_the_surface_s_own_index_changes_nothing() {
        let mut count = 0;
        for eta in [1.3, 1.5, 2.0_f32] {
            let f0 = fresnel::dielectric(1.0, eta);
            for thickness in [120.0, 400.0, 900.0] {
                let film = ThinFilm { weight: 1.0, eta, thickness };
                for cos in [0.2, 0.6, 1.0] {
                    let ours = film.reflectance(cos, Spectrum::splat(f0));
                    let bare = fresnel::dielectric(cos, eta);
                    assert!(
                        (ours - Spectrum::splat(bare)).map(f32::abs).max_component() < 2e-3,
                        "{ours:?} {bare}"
                    );
                    count += 1;
                }
            }
        }
        assert_eq!(count, 27);
    }

    #[test]
    fn no_film_changes_nothing_and_a_thick_one_loses_its_colours() {
        let f0 = Spectrum::new(0.04, 0.5, 0.9);
        let none = ThinFilm { weight: 1.0, eta: 1.4, thickness: 0.0 }.reflectance(1.0, f0);
        assert!((none - f0).map(f32::abs).max_component() < 1e-3, "{none:?}");
        // Far beyond coherence intensities add: R12 + T² R23 / (1 − R12 R23).
        let thick = ThinFilm { weight: 1.0, eta: 1.4, thickness: 30_000.0 }.reflectance(1.0, f0);
        for (ours, f0) in thick.to_array().into_iter().zip(f0.to_array()) {
            let (outer, inner) =
                (fresnel::dielectric(1.0, 1.4), fresnel::dielectric(1.0, index_of(f0) / 1.4));
            let expected = outer + (1.0 - outer).powi(2) * inner / (1.0 - outer * inner);
            assert!((ours - expected).abs() < 1e-3, "{ours} {expected}");
        }
    }

    #[test]
    fn films_have_the_colours_of_an_integral_over_wavelengths() {
        // A quarter of a wave at 550 nm of an index between: green interferes away, red and blue remain.
        let film = ThinFilm { weight: 1.0, eta: 1.38, thickness: 550.0 / 4.0 / 1.38 };
        let coated = film.reflectance(1.0, Spectrum::splat(0.16));
        let airy = |wavelength: f32| {
            let (outer, inner) = ((1.38_f32 - 1.0) / 2.38, (index_of(0.16) - 1.38) / (index_of(0.16) + 1.38));
            let phase = (4.0 * PI * 1.38 * film.thickness / wavelength).cos();
            let both = outer * inner;
            (outer * outer + inner * inner + 2.0 * both * phase) / (1.0 + both * both + 2.0 * both * phase)
        };
        assert!((coated.g - airy(550.0)).abs() < 0.01, "{coated:?} {}", airy(550.0));
        assert!(coated.r > coated.g && coated.b > coated.g && coated.max_component() < 0.16, "{coated:?}");
    }
}
