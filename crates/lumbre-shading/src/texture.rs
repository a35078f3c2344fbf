//! Values that vary over a surface.

use std::sync::Arc;

use lumbre_math::{DVec3, Transform, Vec2, Vec3};

use crate::{MipMap, Spectrum};

/// Where a texture is evaluated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureContext {
    /// The point in world space.
    pub point: DVec3,
    /// The shading normal.
    pub normal: Vec3,
    /// Surface parameters.
    pub uv: Vec2,
    /// ∂p/∂x over one pixel; zero where unknown.
    pub dpdx: Vec3,
    /// ∂p/∂y over one pixel.
    pub dpdy: Vec3,
    /// (∂u/∂x, ∂v/∂x).
    pub duv_dx: Vec2,
    /// (∂u/∂y, ∂v/∂y).
    pub duv_dy: Vec2,
}

/// From a surface to the plane of an image.
#[derive(Clone, Debug, PartialEq)]
pub enum Mapping2d {
    /// (u, v) scaled, then moved.
    Uv {
        /// Factors.
        scale: Vec2,
        /// Offsets.
        delta: Vec2,
    },
    /// Angles about the origin of texture space.
    Spherical {
        /// Texture space from world.
        texture_from_world: Transform,
    },
    /// Angle and height about the z axis of texture space.
    Cylindrical {
        /// Texture space from world.
        texture_from_world: Transform,
    },
    /// Two products with the point.
    Planar {
        /// Texture space from world.
        texture_from_world: Transform,
        /// s = p · this.
        vs: DVec3,
        /// t = p · this.
        vt: DVec3,
        /// Offsets.
        delta: Vec2,
    },
}

/// A value that textures can have: a float or a spectrum.
pub trait TextureValue: Copy + Send + Sync + std::fmt::Debug + 'static {}
impl TextureValue for f32 {}
impl TextureValue for Spectrum {}

/// An image over a surface. Its value is `scale * texel`, or `1 - scale * texel` when inverted.
#[derive(Clone, Debug)]
pub struct ImageTexture {
    /// From the surface to the image.
    pub mapping: Mapping2d,
    /// The image.
    pub image: Arc<MipMap>,
    /// A factor.
    pub scale: f32,
    /// Whether to take one minus the value.
    pub invert: bool,
}

/// The closed set of textures. Trees are shallow: whoever makes one bounds its depth by [`Texture::MAX_DEPTH`].
#[derive(Clone, Debug)]
pub enum Texture<T: TextureValue> {
    /// The same everywhere.
    Constant(T),
    /// A product.
    Scale {
        /// The value.
        texture: Arc<Texture<T>>,
        /// Its factor.
        scale: Arc<Texture<f32>>,
    },
    /// Between two values.
    Mix {
        /// At amount 0 and 1.
        textures: [Arc<Texture<T>>; 2],
        /// How much of the second.
        amount: Arc<Texture<f32>>,
    },
    /// Between two values by |n · direction|, the first where that is 1.
    DirectionMix {
        /// The two values.
        textures: [Arc<Texture<T>>; 2],
        /// A direction of world space.
        direction: Vec3,
    },
    /// Bilinear between the corners of the unit square, in the order v00, v01, v10, v11 (second digit: t).
    Bilerp {
        /// From the surface to the square.
        mapping: Mapping2d,
        /// Values at the corners.
        corners: [T; 4],
    },
    /// Squares of two textures, in two dimensions.
    Checkerboard2d {
        /// From the surface to the plane.
        mapping: Mapping2d,
        /// The textures; the first at (0, 0).
        textures: [Arc<Texture<T>>; 2],
    },
    /// Cubes of two textures.
    Checkerboard3d {
        /// Texture space from world.
        texture_from_world: Transform,
        /// The textures; the first at the origin.
        textures: [Arc<Texture<T>>; 2],
    },
    /// An image.
    Image(ImageTexture),
}

/// A texture of numbers.
pub type FloatTexture = Texture<f32>;
/// A texture of colours.
pub type SpectrumTexture = Texture<Spectrum>;

impl<T: TextureValue> Texture<T> {
    /// How deep a tree of textures may be.
    pub const MAX_DEPTH: usize = 64;

    /// The value at a place.
    pub fn evaluate(&self, _at: &TextureContext) -> T {
        unimplemented!("skeleton")
    }
}
