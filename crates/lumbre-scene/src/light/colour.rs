//! The spectra of a scene's lights in spectral renders.

use lumbre_shading::Spectrum;
use lumbre_shading::spectrum::Wavelengths;

use super::Light;
use crate::light_colour::LightColour;
use crate::{LightId, Scene};

impl Scene {
    /// The light of one of the scene's lights at some wavelengths; `radiance` is its colour, in linear Rec. 709.
    pub fn light_at_wavelengths(
        &self,
        light: LightId,
        radiance: Spectrum,
        wavelengths: &Wavelengths,
    ) -> Spectrum {
        match &self.lighting.colours[light.0 as usize] {
            LightColour::Surface => {
                let emission = self.lights()[light.0 as usize]
                    .entry()
                    .and_then(|entry| self.entries[entry as usize].emission.as_ref());
                match emission {
                    Some(emission) => emission.at_wavelengths(radiance, wavelengths),
                    None => wavelengths.varied_light(radiance),
                }
            }
            colour => colour.at_wavelengths(radiance, wavelengths),
        }
    }

    /// The emission at some wavelengths of the surface with the id of a hit; `radiance` is its colour, in linear Rec.
    /// 709.
    ///
    /// # Panics
    /// If there is no such id.
    pub fn emission_at_wavelengths(
        &self,
        id: u32,
        radiance: Spectrum,
        wavelengths: &Wavelengths,
    ) -> Spectrum {
        match &self.entries[id as usize].emission {
            Some(emission) => emission.at_wavelengths(radiance, wavelengths),
            None => wavelengths.varied_light(radiance),
        }
    }
}

impl Light {
    /// The surface entry of a light that is a surface.
    fn entry(&self) -> Option<u32> {
        match self {
            Self::Shape(light) => Some(light.entry),
            Self::Mesh(light) => Some(light.entry),
            Self::Placed(light) => light.inner().entry(),
            Self::Point(_)
            | Self::Spot(_)
            | Self::Goniometric(_)
            | Self::Projection(_)
            | Self::Distant(_)
            | Self::Disc(_)
            | Self::Uniform(_)
            | Self::Environment(_)
            | Self::Portal(_)
            | Self::Pov(_)
            | Self::Moving(_) => None,
        }
    }
}
