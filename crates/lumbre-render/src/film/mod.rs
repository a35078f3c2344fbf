//! Samples become pixels.
//!
//! A pixel is a function of its own samples alone: the filter is sampled, so that no sample reaches a neighbour
//! (Ernst, Stamminger, Greiner, "Filter Importance Sampling", IEEE Symposium on Interactive Ray Tracing, 2006). Sums are
//! exact ([`ExactSum`]), so that they do not depend on the order of samples, nor on how these were shared out.

mod bounds;
mod exact;
mod filter;
mod guide;
mod guides;
mod pixel;
mod sparse;
mod tile;

pub(crate) use bounds::MAX_PIXELS;
pub use bounds::PixelBounds;
pub use exact::ExactSum;
pub use filter::{Filter, FilterSample, FilterShape};
pub use guide::{Count, FEATURES, GROUPS, GuideSums, RatioSums, SurfaceSums};
pub use guides::Guides;
pub use pixel::{FeatureSample, FeatureSums, Pixel, Tint};
pub use tile::{Addition, Exposure, Extras, Sample, Tile};

pub(crate) use pixel::{MAX_LUMINANCE, MAX_SAMPLE};
