//! Filtered image lookups.

use lumbre_math::Vec2;

use crate::Spectrum;

/// What lies beyond an image's edge.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// The image again.
    #[default]
    Repeat,
    /// Its last texel.
    Clamp,
    /// Nothing.
    Black,
    /// The image is an equal-area octahedral sphere, and its edge goes on where the sphere does.
    OctahedralSphere,
}

/// How texels become a value.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum ImageFilter {
    /// The nearest texel.
    Point,
    /// Between four texels.
    #[default]
    Bilinear,
    /// Between four texels of two levels.
    Trilinear,
    /// Elliptically weighted (Heckbert 1989), with this largest ratio of the axes.
    Ewa(f32),
}

/// A pyramid of ever smaller images.
#[derive(Debug)]
pub struct MipMap {}

impl MipMap {
    /// The value about `st`, with (0, 0) at the lower left, over a footprint of the two derivatives.
    pub fn lookup(&self, _st: Vec2, _dst_dx: Vec2, _dst_dy: Vec2) -> Spectrum {
        unimplemented!("skeleton")
    }
}
