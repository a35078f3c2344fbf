//! POV-Ray's textures: pigments, normals and finishes of a surface, as the `pov` integrator lights them, and what a
//! path tracer takes them for.
//!
//! All arithmetic on colours is done in the scene's working space (see `assumed_gamma` of POV-Ray).

mod blocks;
mod bump_map;
mod finish;
mod fractal;
pub mod function;
mod media;
pub mod natives;
mod noise;
mod normal;
mod pattern;
mod physical;
mod pigment;
mod spline;
mod texture;
mod warp;

pub use finish::{Finish, Reflection};
pub use fractal::{Fractal, Magnet};
pub use function::Function;
pub use media::{Media, Phase, Scattering};
pub use noise::{NoiseGenerator, Octaves, noise, vector_noise};
pub use normal::{Normal, NormalKind};
pub use pattern::{Crackle, InsideTest, Pattern, PatternKind, Slope, Wave};
pub use pigment::{Colour, ColourMap, ImageMap, ImageProjection, ImageSource, Pigment, PigmentKind};
pub use spline::{Spline, SplineKind};
pub use texture::{
    Asked, Interior, Layer, LayerAt, PovMaterial, Stacks, Texture, TextureKind, UvForm, Visibility,
};
pub use warp::{BlackHole, Unrolling, Warp, Warps};

use lumbre_math::{DVec2, DVec3};

/// How a surface is looked at: what some patterns depend on besides the point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eye {
    /// The unit normal towards the viewer, before it is perturbed.
    pub normal: DVec3,
    /// The unit direction to the viewer.
    pub direction: DVec3,
    /// The coordinates on the surface, for what is mapped by them.
    pub uv: DVec2,
}

impl Eye {
    /// No surface: for patterns as functions.
    pub const NOWHERE: Self = Self { normal: DVec3::Y, direction: DVec3::Y, uv: DVec2::ZERO };
}
