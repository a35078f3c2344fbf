//! Samples become pixels.
//!
//! A pixel is a function of its own samples alone: the filter is sampled, so that no sample reaches a neighbour
//! (Ernst, Stamminger, Greiner, "Filter Importance Sampling", IEEE Symposium on Interactive Ray Tracing, 2006). Sums are
//! in double precision and in the order of the samples.

mod bounds;
mod filter;
mod guide;
mod pixel;
mod tile;

pub use bounds::PixelBounds;
pub use filter::{Filter, FilterSample, FilterShape};
pub use guide::{Count, FEATURES, GuideSums, RatioSums};
pub use pixel::{FeatureSample, FeatureSums, Pixel, Tint};
pub use tile::{Exposure, Extras, Sample, Tile};
