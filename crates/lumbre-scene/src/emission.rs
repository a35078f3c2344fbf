//! Emission of surfaces.

use std::sync::Arc;

use lumbre_math::Vec2;
use lumbre_shading::spectrum::{LightCurve, Wavelengths};
use lumbre_shading::{MipMap, Spectrum};

use crate::light_colour;

/// The emitted radiance, equal in all directions.
#[derive(Clone, Debug)]
pub struct Emission {
    /// Radiance, or a factor on the image.
    pub radiance: Spectrum,
    /// A factor over uv.
    pub image: Option<Arc<MipMap>>,
    /// Whether vertex colours are a factor, too.
    pub by_vertices: bool,
    /// Whether the back emits, too.
    pub two_sided: bool,
    /// The spectrum of the radiance, with luminance 1, if it is more than a colour.
    pub spectrum: Option<Arc<LightCurve>>,
}

impl Emission {
    /// The emitted radiance of the front or the back at `uv`, for a vertex colour.
    pub fn at(&self, front: bool, uv: Vec2, vertices: Spectrum) -> Spectrum {
        if !front && !self.two_sided {
            return Spectrum::BLACK;
        }
        let radiance = if self.by_vertices { self.radiance * vertices } else { self.radiance };
        match &self.image {
            None => radiance,
            Some(image) => radiance * positive(image.lookup(uv, Vec2::ZERO, Vec2::ZERO)),
        }
    }

    /// The mean radiance over uv, from a grid of points; vertex colours count as white.
    pub fn mean(&self) -> Spectrum {
        const SIDE: u32 = 32;
        if self.image.is_none() {
            return self.radiance;
        }
        let grid = |i: u32| (i as f32 + 0.5) / SIDE as f32;
        let points = (0..SIDE * SIDE).map(|i| Vec2::new(grid(i % SIDE), grid(i / SIDE)));
        points.map(|uv| self.at(true, uv, Spectrum::WHITE)).sum::<Spectrum>() / (SIDE * SIDE) as f32
    }

    /// Emitted radiance at some wavelengths; `radiance` is its colour.
    pub fn at_wavelengths(&self, radiance: Spectrum, wavelengths: &Wavelengths) -> Spectrum {
        let is_varied = self.image.is_some() || self.by_vertices;
        if is_varied {
            return wavelengths.varied_light(radiance);
        }
        light_colour::constant(self.radiance, self.spectrum.as_deref(), radiance, wavelengths)
    }

    /// The number of emissive sides.
    pub fn sides(&self) -> f32 {
        if self.two_sided { 2.0 } else { 1.0 }
    }
}

fn positive(colour: Spectrum) -> Spectrum {
    colour.map(|c| c.max(0.0))
}
