#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![doc = include_str!("../README.md")]
//!
//! A [`Material`] is a function of position that yields a [`Bsdf`]; a [`Bsdf`] is a function of two directions.
//! Colours are [`Spectrum`] values.

mod albedo;
mod bsdf;
mod bsdf_sample;
pub mod coated;
mod coated_lanes;
pub mod conductor;
pub mod dielectric;
pub mod diffuse;
mod frame;
pub mod fresnel;
pub mod hair;
pub mod lanes;
mod material;
pub mod measured;
pub mod medium;
pub mod microfacet;
mod mipmap;
pub mod pov;
pub mod principled;
mod principled_lanes;
mod principled_params;
pub mod sheen;
pub mod sky;
pub mod spectrum;
mod specular;
mod stretched;
pub mod subsurface;
mod texture;
pub mod thin_film;
pub mod uber;
mod uber_lanes;

pub use bsdf::Bsdf;
pub use bsdf_sample::{BsdfSample, Scatter};
pub use frame::{LocalDir, ShadingFrame, ShadingNormals};
pub use material::{LocalSurface, Material, MaterialKind, Metal, Roughness};
pub use medium::HomogeneousMedium;
pub use mipmap::{AxisWrap, ImageFilter, MipMap, MipMapOptions, Wrap};
pub use principled_params::{Convention, PrincipledParams, VolumeParams};
pub use spectrum::{NamedSpectrum, SpectrumValue};
pub use texture::{
    FURTHER_SETS, FloatTexture, FurtherUv, ImageTexture, Mapping2d, Pattern, PatternKind, SpectrumTexture,
    Texture, TextureContext, TexturePoint, TextureValue, UvSet, VertexData,
};

/// The channels of light transport: linear Rec. 709 at present.
pub type Spectrum = lumbre_image::Rgb;

/// The number clamped to [0, 1]; 0 for NaN.
fn unit(c: f32) -> f32 {
    if c > 0.0 { c.min(1.0) } else { 0.0 }
}
