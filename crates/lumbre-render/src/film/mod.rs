//! Samples become pixels.
//!
//! A pixel is a function of its own samples alone: the filter is sampled, so that no sample reaches a neighbour
//! (Ernst, Stamminger, Greiner, "Filter Importance Sampling", IEEE Symposium on Interactive Ray Tracing, 2006). Sums
//! are exact ([`ExactSum`]), so that they do not depend on the order and distribution of samples.

mod bounds;
mod buckets;
mod exact;
mod filter;
mod guide;
mod guides;
mod pixel;
mod sparse;
mod surface;
mod tile;

pub(crate) use bounds::MAX_PIXELS;
pub use bounds::PixelBounds;
pub use buckets::{BucketSums, SpectralSample};
pub use exact::ExactSum;
pub use filter::{Filter, FilterSample, FilterShape};
pub use guide::{Count, FEATURES, GROUPS, GuideSums, GuideSurfaceSums, RatioSums};
pub use guides::Guides;
pub use pixel::{FeatureSample, FeatureSums, Pixel, Tint};
pub use surface::{SurfaceSample, SurfaceSums};
pub use tile::{Addition, Exposure, Extras, Sample, Tile};

pub(crate) use buckets::{ATTRIBUTES, channel_name};
pub(crate) use pixel::{MAX_LUMINANCE, MAX_SAMPLE};
pub(crate) use surface::{NUMBERS, SurfacePoint};
pub(crate) use tile::TileSumsMut;
