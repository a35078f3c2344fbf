//! What a render tells while it runs.

use std::time::Duration;

use lumbre_image::Image;

/// Observes how far a render is. It never changes the picture.
pub trait Progress: Sync {
    /// Told now and then, from whichever thread, never from two at once.
    fn state(&self, _state: &State) {}

    /// Told after each pass over the picture, from one thread; the next pass waits for it.
    fn pass(&self, _snapshot: &Snapshot<'_>) {}

    /// Asked once, from one thread, when no more samples will be taken: whether anyone still wants the picture. Where no one does, it is
    /// not put together, and the render ends at once with [`crate::RenderError::Unwanted`].
    fn is_wanted(&self) -> bool {
        true
    }

    /// Told once, from one thread, when no more samples will be taken and the picture is put together: what
    /// [`crate::Stats::stride`] will be.
    fn stopped(&self, _stride: Option<u32>) {}
}

/// Nobody.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoProgress;

impl Progress for NoProgress {}

/// How far a render is.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct State {
    /// Samples taken, over all pixels.
    pub samples: u64,
    /// Rays traced by this run.
    pub rays: u64,
    /// Samples over all pixels at the end: exact where their number ends the render, else estimated from the time or the noise that
    /// does; `None` as long as nothing is known.
    pub total: Option<u64>,
    /// How much of the way to its end the render has gone, in [0, 1], whichever of its limits comes first.
    pub share: f64,
    /// Since the start.
    pub elapsed: Duration,
    /// Until the end, if the rest goes as fast; `None` before anything is known.
    pub left: Option<Duration>,
}

/// The picture after a pass.
pub struct Snapshot<'a> {
    /// Samples of every pixel; where noise ends their sampling, of those that it has not ended.
    pub spp: u32,
    /// The noise, as [`crate::Stop::noise`] defines it; `None` before there are two samples.
    pub noise: Option<f64>,
    pub(crate) picture: &'a dyn Fn() -> Image,
}

impl Snapshot<'_> {
    /// The picture so far. It is put together when asked for.
    pub fn image(&self) -> Image {
        (self.picture)()
    }
}

impl std::fmt::Debug for Snapshot<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Snapshot").field("spp", &self.spp).field("noise", &self.noise).finish_non_exhaustive()
    }
}
