//! Progress of a render.

use std::time::Duration;

use lumbre_image::Image;

/// Observes the progress of a render. It never changes the picture.
pub trait Progress: Sync {
    /// Called at intervals, from any thread, never from two at once.
    fn state(&self, _state: &State) {}

    /// Called after each pass over the picture, from one thread; the next pass waits for it.
    fn pass(&self, _snapshot: &Snapshot<'_>) {}

    /// Called once, from one thread, when no more samples will be taken: whether the picture is still wanted. If not,
    /// it is not assembled, and the render ends at once with [`crate::RenderError::Unwanted`].
    fn is_wanted(&self) -> bool {
        true
    }

    /// Called once, from one thread, before the picture is assembled, with its [`crate::Stats::stride`].
    fn stopped(&self, _stride: Option<u32>) {}
}

/// No observer.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoProgress;

impl Progress for NoProgress {}

/// The progress of a render.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct State {
    /// Samples taken, over all pixels.
    pub samples: u64,
    /// Rays traced by this run.
    pub rays: u64,
    /// Final samples over all pixels: exact if their number ends the render, else estimated from the time or noise
    /// limit; `None` if unknown.
    pub total: Option<u64>,
    /// The fraction done, in [0, 1], by the limit that comes first.
    pub share: f64,
    /// Time since the start.
    pub elapsed: Duration,
    /// Estimated time left; `None` if unknown.
    pub left: Option<Duration>,
}

/// The picture after a pass.
pub struct Snapshot<'a> {
    /// Samples of every pixel; with a noise target, of the pixels that have not reached it.
    pub spp: u32,
    /// The noise, as [`crate::Stop::noise`] defines it; `None` before there are two samples.
    pub noise: Option<f64>,
    pub(crate) picture: &'a dyn Fn() -> Image,
}

impl Snapshot<'_> {
    /// Assembles the picture so far.
    pub fn image(&self) -> Image {
        (self.picture)()
    }
}

impl std::fmt::Debug for Snapshot<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Snapshot").field("spp", &self.spp).field("noise", &self.noise).finish_non_exhaustive()
    }
}
