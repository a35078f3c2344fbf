//! Materials, textures and BSDFs.
//!
//! A [`Material`] is a function of place that yields a [`Bsdf`]; a [`Bsdf`] is a function of two directions. Colour is
//! carried on the lanes of [`Spectrum`].

mod bsdf;
mod frame;
mod material;
mod mipmap;
mod texture;

pub use bsdf::{Bsdf, BsdfSample, Scatter};
pub use frame::{LocalDir, ShadingFrame};
pub use material::{LocalSurface, Material, MaterialKind, Roughness};
pub use mipmap::{ImageFilter, MipMap, Wrap};
pub use texture::{
    FloatTexture, ImageTexture, Mapping2d, SpectrumTexture, Texture, TextureContext, TextureValue,
};

/// Values on the lanes that light transport carries: linear Rec. 709 today.
pub type Spectrum = lumbre_image::Rgb;
