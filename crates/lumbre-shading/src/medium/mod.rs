//! Participating media: what absorbs, scatters and emits light between surfaces.
//!
//! A medium says what becomes of light along a straight way through it: [`Medium::sample`] samples where it scatters,
//! [`Medium::transmittance`] estimates what is left of it at the end. Coefficients are per unit of length of the world.

mod cloud;
mod grid;
mod heterogeneous;
mod homogeneous;
mod phase;
mod presets;
mod sparse;
mod spectra;

use lumbre_math::DVec3;
use lumbre_math::random::RandomStream;

use crate::Spectrum;
use crate::spectrum::Wavelengths;

pub use cloud::Cloud;
pub use grid::{Grid, GridError, Voxel};
pub use heterogeneous::{Coefficients, Density, Factor, Glow, Heat, HeterogeneousMedium};
pub use homogeneous::{DistanceSample, HomogeneousMedium, albedo_of_many_collisions};
pub use phase::{henyey_greenstein, sample_henyey_greenstein, sample_henyey_greenstein_lanes};
pub use presets::{preset, preset_names};
pub use sparse::{Brick, SparseGrid, SparseGridError};
pub use spectra::MediumSpectra;

/// A participating medium.
#[derive(Clone, Debug)]
pub enum Medium {
    /// The same everywhere.
    Homogeneous {
        /// How it absorbs and scatters.
        medium: HomogeneousMedium,
        /// The radiance that it tends to where it is deep and does not scatter: it emits σ_a times this per unit of
        /// length.
        glow: Spectrum,
        /// What is known of both by wavelength.
        spectra: Option<Box<MediumSpectra>>,
    },
    /// By place.
    Heterogeneous(Box<HeterogeneousMedium>),
}

/// What becomes of light along a way through a medium.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Passage {
    /// How far it comes.
    pub outcome: DistanceSample,
    /// An estimate of what the medium adds on the way: a radiance, to be multiplied by the throughput before the way.
    pub emitted: Spectrum,
}

/// A straight way in the world: points `origin` + t `direction` for t from 0 to `length`, which may be infinite. The
/// direction is unit.
#[derive(Clone, Copy, Debug)]
pub struct Way {
    /// Where it begins.
    pub origin: DVec3,
    /// The unit direction.
    pub direction: DVec3,
    /// How long it is.
    pub length: f64,
}

/// The random numbers of one passage: two that are stratified over the samples of a pixel, and any number of others.
#[derive(Clone, Debug)]
pub struct PassageNumbers {
    first: [f64; 2],
    used: u8,
    rest: RandomStream,
}

impl PassageNumbers {
    /// Two numbers in [0, 1), and the seed of the others.
    pub fn new(first: [f64; 2], seed: u64) -> Self {
        Self { first, used: 0, rest: RandomStream::new(seed) }
    }

    /// All from one seed.
    pub fn from_seed(seed: u64) -> Self {
        let mut rest = RandomStream::new(seed);
        let first = [rest.next_f64(), rest.next_f64()];
        Self { first, used: 0, rest }
    }

    /// The first two.
    fn first(&self) -> [f64; 2] {
        self.first
    }

    /// The next number in [0, 1).
    fn next(&mut self) -> f64 {
        self.used = self.used.saturating_add(1);
        match self.used {
            1 => self.first[1],
            2 => self.first[0],
            _ => self.rest.next_f64(),
        }
    }
}

impl Medium {
    /// The asymmetry of its phase function, that of Henyey and Greenstein.
    pub fn asymmetry(&self) -> f32 {
        match self {
            Self::Homogeneous { medium, .. } => medium.asymmetry,
            Self::Heterogeneous(medium) => medium.asymmetry,
        }
    }

    /// Whether it emits light.
    pub fn glows(&self) -> bool {
        match self {
            Self::Homogeneous { glow, .. } => !glow.is_black(),
            Self::Heterogeneous(medium) => medium.glows(),
        }
    }

    /// Bytes that its grids take.
    pub fn memory(&self) -> usize {
        match self {
            Self::Homogeneous { .. } => 0,
            Self::Heterogeneous(medium) => medium.memory(),
        }
    }

    /// Samples where light of throughput `carried` scatters along a way, if it does. Channels are those of linear Rec.
    /// 709, or the wavelengths that are given.
    pub fn sample(
        &self,
        way: &Way,
        carried: Spectrum,
        mut numbers: PassageNumbers,
        wavelengths: Option<&Wavelengths>,
    ) -> Passage {
        match self {
            Self::Homogeneous { medium, glow, spectra } => {
                let spectra = spectra.as_deref();
                let medium = medium.at(spectra, wavelengths);
                let glow = match wavelengths {
                    Some(wavelengths) if !glow.is_black() => {
                        MediumSpectra::glow_at(spectra, *glow, wavelengths)
                    }
                    _ => *glow,
                };
                Passage {
                    outcome: medium.sample_distance(carried, way.length, numbers.first()),
                    emitted: if glow.is_black() { glow } else { glow * medium.absorbed(way.length) },
                }
            }
            Self::Heterogeneous(medium) => medium.sample(way, carried, &mut numbers, wavelengths),
        }
    }

    /// What is left of light at the end of a way; where the medium is not the same everywhere, an estimate of it.
    pub fn transmittance(
        &self,
        way: &Way,
        mut numbers: PassageNumbers,
        wavelengths: Option<&Wavelengths>,
    ) -> Spectrum {
        match self {
            Self::Homogeneous { medium, spectra, .. } => {
                medium.at(spectra.as_deref(), wavelengths).transmittance(way.length)
            }
            Self::Heterogeneous(medium) => medium.transmittance(way, &mut numbers, wavelengths),
        }
    }
}
