#![doc = include_str!("../README.md")]
//!
//! A [`Material`] is a function of place that yields a [`Bsdf`]; a [`Bsdf`] is a function of two directions. Colour is
//! carried on the lanes of [`Spectrum`].

mod albedo;
mod bsdf;
pub mod coated;
pub mod conductor;
pub mod dielectric;
pub mod diffuse;
mod frame;
pub mod fresnel;
mod material;
pub mod medium;
pub mod microfacet;
mod mipmap;
pub mod principled;
mod principled_params;
pub mod sheen;
pub mod spectrum;
mod specular;
mod stretched;
mod texture;
pub mod thin_film;

pub use bsdf::{Bsdf, BsdfSample, Scatter};
pub use frame::{LocalDir, ShadingFrame};
pub use material::{LocalSurface, Material, MaterialKind, Metal, Roughness};
pub use medium::HomogeneousMedium;
pub use mipmap::{AxisWrap, ImageFilter, MipMap, MipMapOptions, Wrap};
pub use principled_params::{Convention, PrincipledParams, VolumeParams};
pub use spectrum::{NamedSpectrum, SpectrumValue};
pub use texture::{
    FURTHER_SETS, FloatTexture, FurtherUv, ImageTexture, Mapping2d, SpectrumTexture, Texture, TextureContext,
    TexturePoint, TextureValue, UvSet, VertexData,
};

/// Values on the lanes that light transport carries: linear Rec. 709 today.
pub type Spectrum = lumbre_image::Rgb;

/// The number held within [0, 1]; 0 for what is not one.
fn unit(c: f32) -> f32 {
    if c > 0.0 { c.min(1.0) } else { 0.0 }
}
