//! Media: what fills solids and the air, and what light meets in it.

use std::sync::Arc;

use lumbre_math::{DVec3, Transform};

use super::Eye;
use super::pigment::{Pigment, PigmentKind};
use crate::Spectrum;

/// A medium. All its numbers are per unit of length, and are multiplied by its densities.
#[derive(Clone, Debug)]
pub struct Media {
    /// What it takes from light.
    pub absorption: Spectrum,
    /// The light that it gives.
    pub emission: Spectrum,
    /// How it scatters light.
    pub scattering: Option<Scattering>,
    /// Densities by place, whose product counts; 1 everywhere where there is none.
    pub densities: Vec<Arc<Pigment>>,
    /// At how many places along a ray its density is asked for, at least.
    pub samples: u32,
}

/// How a medium scatters light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scattering {
    /// By the angle between the ray and the way to the light.
    pub phase: Phase,
    /// How much of each channel.
    pub colour: Spectrum,
    /// How much is lost to the ray for what is scattered.
    pub extinction: f32,
}

/// How much light is scattered by the angle, with POV-Ray's factors: the mean over the sphere is 1, but about 1.15 of
/// haze, 1.25 of murky air and 1.07 of Rayleigh's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Phase {
    /// The same everywhere.
    Isotropic,
    /// Mie scattering by haze.
    Haze,
    /// Mie scattering by murky air.
    Murky,
    /// Rayleigh scattering.
    Rayleigh,
    /// Henyey and Greenstein's function of this eccentricity.
    HenyeyGreenstein(f32),
}

impl Phase {
    /// The value at the cosine between the direction of the ray and that to the light.
    pub fn at(self, cosine: f32) -> f32 {
        match self {
            Self::Isotropic => 1.0,
            Self::Haze => 0.576_655 * (1.0 + 9.0 * (0.5 * (1.0 + cosine)).powi(8)),
            Self::Murky => 0.495_715 * (1.0 + 50.0 * (0.5 * (1.0 + cosine)).powi(32)),
            Self::Rayleigh => 0.799_372 * (1.0 + cosine * cosine),
            Self::HenyeyGreenstein(g) => {
                let base = 1.0 + g * g - 2.0 * g * cosine;
                (1.0 - g * g) / (base * base.max(0.0).sqrt()).max(1e-9)
            }
        }
    }
}

impl Media {
    /// A medium that does nothing.
    pub const NONE: Self = Self {
        absorption: Spectrum::BLACK,
        emission: Spectrum::BLACK,
        scattering: None,
        densities: Vec::new(),
        samples: 10,
    };

    /// Its density at a point.
    pub fn density(&self, p: DVec3) -> Spectrum {
        let at = |density: &Arc<Pigment>| density.colour(p, &Eye::NOWHERE).rgb;
        self.densities.iter().map(at).fold(Spectrum::WHITE, |product, density| product * density)
    }

    /// Whether it is the same everywhere.
    pub fn is_uniform(&self) -> bool {
        self.densities.iter().all(|density| matches!(density.kind, PigmentKind::Colour(_)))
    }

    /// What light loses per unit of length where the density is 1.
    pub fn extinction(&self) -> Spectrum {
        let scattered = self.scattering.map_or(Spectrum::BLACK, |s| s.colour * s.extinction);
        self.absorption + scattered
    }

    /// Moves its densities.
    #[must_use]
    pub fn moved(&self, map: &Arc<Transform>) -> Self {
        let moved = |density: &Arc<Pigment>| {
            let mut density = (**density).clone();
            density.warps.transform(map);
            Arc::new(density)
        };
        Self { densities: self.densities.iter().map(moved).collect(), ..self.clone() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phases_have_the_means_that_their_formulas_have() {
        for (phase, expected) in [
            (Phase::Isotropic, 1.0),
            (Phase::Haze, 0.576_655 * 2.0),
            (Phase::Murky, 0.495_715 * (1.0 + 50.0 / 33.0)),
            (Phase::Rayleigh, 0.799_372 * 4.0 / 3.0),
            (Phase::HenyeyGreenstein(-0.4), 1.0),
        ] {
            let steps = 20_000;
            let at = |i: i32| phase.at((i as f32 + 0.5) / (steps as f32) * 2.0 - 1.0);
            let mean = (0..steps).map(|i| f64::from(at(i))).sum::<f64>() / f64::from(steps);
            assert!((mean - expected).abs() < 1e-4, "{phase:?}: {mean}, expected {expected}");
        }
    }
}
