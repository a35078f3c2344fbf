//! Thin-film interference: soap, oil on water, heated steel.

use std::f32::consts::PI;

use lumbre_simd::math::{exp, sin_cos_turns};
use lumbre_simd::{Mask, Real, Task, V3};

use crate::albedo::unit;
use crate::lanes::{colour_lane, spectrum};
use crate::{Spectrum, fresnel};

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
    /// The wavelengths in nm that channels are; 0 where they are linear Rec. 709.
    pub nm: [f32; 3],
}

impl ThinFilm {
    /// No film.
    pub const NONE: Self = Self { weight: 0.0, eta: 1.3, thickness: 0.0, nm: [0.0; 3] };

    /// The reflectance at a cosine (outside) where the bare surface has the reflectance `f0` at normal
    /// incidence; each channel in [0, 1].
    pub fn reflectance(&self, cos: f32, f0: Spectrum) -> Spectrum {
        spectrum(self.lane().reflectance(V3::splat(cos), colour_lane(f0)))
    }

    /// The maximal reflectance at normal incidence over all wavelengths: both faces in phase.
    pub fn most(&self, f0: Spectrum) -> Spectrum {
        spectrum(self.lane().most(colour_lane(f0)))
    }

    pub(crate) fn lane(&self) -> ThinFilmLanes<f32> {
        let Self { weight, eta, thickness, nm } = *self;
        ThinFilmLanes { weight, eta, thickness, nm: V3::new(nm[0], nm[1], nm[2]) }
    }
}

/// [`ThinFilm`] over lanes.
#[derive(Clone, Copy, Debug)]
pub struct ThinFilmLanes<R: Real> {
    /// The share of the surface covered, in [0, 1].
    pub weight: R,
    /// Index of refraction, at least 1.
    pub eta: R,
    /// In nanometres, ≥ 0.
    pub thickness: R,
    /// The wavelengths in nm that channels are; 0 where they are linear Rec. 709.
    pub nm: V3<R>,
}

impl<R: Real> ThinFilmLanes<R> {
    /// The film fades out below a thickness of 30 nm, where the method does not apply.
    #[inline(always)]
    fn eta_of_thickness(&self) -> R {
        let t = (self.thickness / R::splat(30.0)).simd_max(R::zero()).simd_min(R::one());
        let excess = self.eta.simd_max(R::one()) - R::one();
        R::one() + excess * t * t * (R::splat(3.0) - R::splat(2.0) * t)
    }

    /// [`ThinFilm::reflectance`], at a cosine for each channel.
    #[inline(always)]
    pub(crate) fn reflectance(&self, cos: V3<R>, f0: V3<R>) -> V3<R> {
        let [x, y, z] = REC709_FROM_XYZ;
        V3::new(
            R::call(Channel { film: self, cos: cos.x, f0: f0.x, row: x, nm: self.nm.x }),
            R::call(Channel { film: self, cos: cos.y, f0: f0.y, row: y, nm: self.nm.y }),
            R::call(Channel { film: self, cos: cos.z, f0: f0.z, row: z, nm: self.nm.z }),
        )
    }

    /// The reflectance in a channel, by its row of [`REC709_FROM_XYZ`] or at its wavelength.
    #[inline(always)]
    fn channel(&self, cos: R, f0: R, row: [f32; 3], nm: R) -> R {
        let (one, two) = (R::one(), R::splat(2.0));
        let eta = self.eta_of_thickness();
        let cos = cos.simd_max(R::zero()).simd_min(one);
        let cos_inside = (one - (one - cos * cos) / (eta * eta)).simd_max(R::zero()).sqrt();
        let outer = fresnel::dielectric(cos, eta);
        let passes = one - outer;
        let detour = two * eta * self.thickness * R::splat(1e-9) * cos_inside;
        let base = index_of(f0);
        let inner = fresnel::dielectric(cos_inside, base / eta);
        // Reflection inside the denser medium shifts the phase by half a wave: at the outer face always,
        // at the base where the film is the denser. In turns.
        let shift = R::select(base.simd_lt(eta), one, R::splat(0.5));
        let both = outer * inner;
        let series = passes * passes * inner / (one - both).simd_max(R::splat(1e-6));
        let root = both.sqrt();
        let first = (series - passes) * root;
        let mut orders = first * row_of(sensitivity(detour, shift), row)
            + first * root * row_of(sensitivity(two * detour, two * shift), row);
        let is_wavelength = R::zero().simd_lt(nm);
        if is_wavelength.any() {
            // The sum over all orders, of cosines of multiples of the phase: that of Airy.
            let (_, wave) = sin_cos_turns(detour * R::splat(1e9) / nm.simd_max(one) + shift);
            let airy = first * (wave - root) / (one + both - two * root * wave).simd_max(R::splat(1e-6));
            orders = R::select(is_wavelength, airy, orders);
        }
        unit(outer + series + two * orders)
    }

    /// [`ThinFilm::most`].
    #[inline(always)]
    pub(crate) fn most(&self, f0: V3<R>) -> V3<R> {
        let eta = self.eta_of_thickness();
        let outer = fresnel::dielectric(R::one(), eta).sqrt();
        V3::new(most_of(outer, eta, f0.x), most_of(outer, eta, f0.y), most_of(outer, eta, f0.z))
    }
}

/// [`ThinFilmLanes::channel`].
struct Channel<'a, R: Real> {
    film: &'a ThinFilmLanes<R>,
    cos: R,
    f0: R,
    row: [f32; 3],
    nm: R,
}

impl<R: Real> Task<R> for Channel<'_, R> {
    type Output = R;
    #[inline(always)]
    fn run(self) -> R {
        self.film.channel(self.cos, self.f0, self.row, self.nm)
    }
}

#[inline(always)]
fn most_of<R: Real>(outer: R, eta: R, f0: R) -> R {
    let inner = fresnel::dielectric(R::one(), index_of(f0) / eta).sqrt();
    let sum = (outer + inner) / (R::one() + outer * inner);
    (sum * sum).simd_max(f0)
}

#[inline(always)]
fn row_of<R: Real>(xyz: V3<R>, row: [f32; 3]) -> R {
    xyz.dot(V3::constant(row))
}

/// The index of the dielectric with the reflectance `f0` at normal incidence.
#[inline(always)]
pub(crate) fn index_of<R: Real>(f0: R) -> R {
    let root = f0.simd_max(R::zero()).simd_min(R::splat(0.9999)).sqrt();
    (R::one() + root) / (R::one() - root)
}

/// Linear Rec. 709 from CIE XYZ, for a white of (1, 1, 1): each row is divided by its sum.
const REC709_FROM_XYZ: [[f32; 3]; 3] =
    [[2.688_95, -1.275_71, -0.413_24], [-1.022_15, 1.978_32, 0.043_83], [0.061_21, -0.224_49, 1.163_28]];

/// The lobes of the eye's sensitivity (X, Y, Z, and X again): Gaussians in the wave number, with the constants fitted
/// by Belcour and Barla.
const PLACES: [f32; 4] = [1.6810e6, 1.7953e6, 2.2084e6, 2.2399e6];
const VARIANCES: [f32; 4] = [4.3278e9, 9.3046e9, 6.6121e9, 4.5282e9];
/// The share of each of the two lobes of X: amplitudes 5.4856e-13 and 9.7470e-14, each times the root of its variance.
const OF_X: [f32; 2] = {
    // √(4.3278e9) and √(4.5282e9)
    let (first, second) = (5.4856e-13 * 65_786.0, 9.7470e-14 * 67_292.0);
    [first / (first + second), second / (first + second)]
};

/// The Fourier transform of the eye's sensitivity at an optical path difference in metres, with a phase shift in turns,
/// normalised to 1 for no difference.
#[inline(always)]
fn sensitivity<R: Real>(path: R, shift: R) -> V3<R> {
    V3::new(
        R::splat(OF_X[0]) * lobe(path, shift, 0) + R::splat(OF_X[1]) * lobe(path, shift, 3),
        lobe(path, shift, 1),
        lobe(path, shift, 2),
    )
}

#[inline(always)]
fn lobe<R: Real>(path: R, shift: R, which: usize) -> R {
    let phase = R::splat(2.0 * PI) * path;
    let (_, cos) = sin_cos_turns(R::splat(PLACES[which]) * path + shift);
    cos * exp(R::splat(-VARIANCES[which]) * (phase * phase))
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
                let film = ThinFilm { weight: 1.0, eta, thickness, ..ThinFilm::NONE };
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
        let none = ThinFilm { weight: 1.0, eta: 1.4, thickness: 0.0, ..ThinFilm::NONE }.reflectance(1.0, f0);
        assert!((none - f0).map(f32::abs).max_component() < 1e-3, "{none:?}");
        // Far beyond coherence intensities add: R12 + T² R23 / (1 − R12 R23).
        let thick =
            ThinFilm { weight: 1.0, eta: 1.4, thickness: 30_000.0, ..ThinFilm::NONE }.reflectance(1.0, f0);
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
        let film = ThinFilm { weight: 1.0, eta: 1.38, thickness: 550.0 / 4.0 / 1.38, ..ThinFilm::NONE };
        let coated = film.reflectance(1.0, Spectrum::splat(0.16));
        let airy = |wavelength: f32| {
            let (outer, inner) = ((1.38_f32 - 1.0) / 2.38, (index_of(0.16) - 1.38) / (index_of(0.16) + 1.38));
            let phase = (4.0 * PI * 1.38 * film.thickness / wavelength).cos();
            let both = outer * inner;
            (outer * outer + inner * inner + 2.0 * both * phase) / (1.0 + both * both + 2.0 * both * phase)
        };
        assert!((coated.g - airy(550.0)).abs() < 0.01, "{coated:?} {}", airy(550.0));
        // And at wavelengths exactly.
        let nm = [450.0, 550.0, 640.0];
        let spectral = ThinFilm { nm, ..film }.reflectance(1.0, Spectrum::splat(0.16));
        for (ours, nm) in spectral.to_array().into_iter().zip(nm) {
            assert!((ours - airy(nm)).abs() < 1e-4, "{nm}: {ours} {}", airy(nm));
        }
        assert!(coated.r > coated.g && coated.b > coated.g && coated.max_component() < 0.16, "{coated:?}");
    }
}
