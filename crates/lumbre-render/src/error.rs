//! Why nothing can be rendered.

use crate::film::PixelBounds;

/// Why a render cannot begin.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// The picture has no pixels, or too many.
    #[error("a picture of {width} by {height} pixels cannot be made (1 to 65536 each way, 2^30 in all)")]
    Size {
        /// Pixels across.
        width: u32,
        /// Pixels down.
        height: u32,
    },
    /// The crop holds no pixel of the picture.
    #[error("the crop {},{},{},{} is outside the picture ({width}x{height})", .crop.x0, .crop.y0, .crop.x1, .crop.y1)]
    EmptyCrop {
        /// The crop.
        crop: PixelBounds,
        /// Pixels across.
        width: u32,
        /// Pixels down.
        height: u32,
    },
    /// There is no such camera.
    #[error("there is no camera {index} (expected 0 to {})", .count.saturating_sub(1))]
    NoSuchCamera {
        /// Which was asked for.
        index: usize,
        /// How many there are.
        count: usize,
    },
    /// The camera of the options makes no picture of this scene.
    #[error("{0}")]
    Camera(#[from] lumbre_scene::BuildError),
    /// The state to go on from is not that of this render.
    #[error("the state to continue from has other pixels, samples or sums")]
    OtherState,
    /// The pixel filter has no width.
    #[error("the pixel filter needs a radius above 0, and a value above 0 somewhere inside it")]
    Filter,
    /// The integrator follows colours only.
    #[error("a spectral render works only with the integrator path or caustics")]
    NoWavelengths,
    /// The film keeps wavelengths, and the paths carry none.
    #[error("film \"spectral\" works only with a spectral render by the integrator path or caustics")]
    NoBuckets,
    /// Nobody wants the picture any longer: [`crate::Progress::is_wanted`].
    #[error("the picture is not wanted any longer")]
    Unwanted,
}
