#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![doc = include_str!("../README.md")]

mod bitmap;
mod colour_space;
mod compare;
mod encoding;
mod flip;
mod half;
mod image;
mod layers;
mod rgb;
mod ssim;
mod tonemap;

pub use crate::half::{f32_to_half, half_to_f32};
pub use crate::image::{Image, Window};
pub use bitmap::{Bitmap, Channels, PixelData};
pub use colour_space::ColourSpace;
pub use compare::{Comparison, Metric, compare};
pub use encoding::{Encoded, Encoding, linear_to_srgb, srgb_to_linear, unit_to_u8, unit_to_u16};
pub use flip::flip;
pub use layers::{Layer, Layers};
pub use rgb::Rgb;
pub use ssim::ssim;
pub use tonemap::ToneMap;
