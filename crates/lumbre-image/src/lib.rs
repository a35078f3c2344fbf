//! Colours and rectangles of colours. No files here: reading and writing them is another floor's work.

mod image;
mod rgb;

pub use crate::image::Image;
pub use rgb::Rgb;
