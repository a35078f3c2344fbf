//! Media of solids and of the air.

use std::sync::Arc;

use lumbre_shading::Spectrum;
use lumbre_shading::pov::{Media, Phase, Pigment, Scattering};

use super::value::Value;
use super::{Parser, Result};

/// Places along a ray at which a density is evaluated, at most.
const MAX_SAMPLES: f64 = 200.0;

impl Parser<'_, '_> {
    /// A medium in braces, whose word was taken.
    pub(super) fn media_block(&mut self) -> Result<Media> {
        self.expect(b'{')?;
        let mut media = Media::NONE;
        let mut intervals = 1;
        while !self.take(b'}')? {
            if self.take(b',')? {
                continue;
            }
            if let Some(map) = self.transform()? {
                media = media.moved(&map);
                continue;
            }
            let Some(word) = self.word()? else { return Err(self.unexpected("what a medium has")) };
            self.peeked = None;
            match &*word {
                "absorption" => media.absorption = self.rgb()?,
                "emission" => media.emission = self.rgb()?,
                "scattering" => media.scattering = Some(self.scattering()?),
                "density" => {
                    self.budget.bytes(size_of::<Pigment>() as u64, "densities")?;
                    media.densities.push(self.density_block()?);
                }
                "intervals" => intervals = self.whole(1.0, MAX_SAMPLES)?,
                "samples" => {
                    media.samples = self.whole(1.0, MAX_SAMPLES)?;
                    if self.take(b',')? {
                        self.float()?;
                    }
                }
                // How often POV-Ray looks, and when it is content.
                "method" | "confidence" | "variance" | "ratio" | "aa_level" | "aa_threshold" | "jitter" => {
                    self.float()?;
                }
                "collect" => {
                    self.optional_bool()?;
                }
                _ => match self.known(&word)? {
                    Some(Value::Media(known)) => media = (*known).clone(),
                    Some(Value::Density(known)) => media.densities.push(known),
                    _ => return Err(self.error(format!("{word} has no meaning in a medium"))),
                },
            }
        }
        media.samples = (media.samples * intervals).min(MAX_SAMPLES as u32);
        Ok(media)
    }

    fn scattering(&mut self) -> Result<Scattering> {
        self.expect(b'{')?;
        let kind = self.whole(1.0, 5.0)?;
        self.comma()?;
        let mut scattering = Scattering { phase: Phase::Isotropic, colour: Spectrum::BLACK, extinction: 1.0 };
        scattering.colour = self.rgb()?;
        let mut eccentricity = 0.0;
        while !self.take(b'}')? {
            if self.take_word("eccentricity")? {
                eccentricity = self.finite()? as f32;
            } else if self.take_word("extinction")? {
                scattering.extinction = self.finite()? as f32;
            } else {
                self.expect(b',')?;
            }
        }
        scattering.phase = match kind {
            1 => Phase::Isotropic,
            2 => Phase::Haze,
            3 => Phase::Murky,
            4 => Phase::Rayleigh,
            _ => Phase::HenyeyGreenstein(eccentricity.clamp(-0.999, 0.999)),
        };
        Ok(scattering)
    }

    /// A density in braces, whose word was taken: a pigment of numbers.
    pub(super) fn density_block(&mut self) -> Result<Arc<Pigment>> {
        self.expect(b'{')?;
        self.density_body(b'}')
    }

    /// A density up to a closing mark.
    pub(super) fn density_body(&mut self, end: u8) -> Result<Arc<Pigment>> {
        let outer = std::mem::replace(&mut self.is_density, true);
        let density = self.pigment_body(None, end);
        self.is_density = outer;
        density
    }
}
