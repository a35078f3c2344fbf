//! What a render tells while it runs.

use std::time::Duration;

use lumbre_image::Image;

/// Someone who wants to know how far a render is. Nothing that it does changes the picture.
pub trait Progress: Sync {
    /// Told now and then, from whichever thread, never from two at once.
    fn state(&self, _state: &State) {}

    /// Told after each pass over the picture, from one thread; the next pass waits for it.
    fn pass(&self, _snapshot: &Snapshot<'_>) {}
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
    /// Samples wanted, over all pixels.
    pub total: u64,
    /// Since the start.
    pub elapsed: Duration,
    /// Until the end, if the rest goes as fast; `None` before anything is done.
    pub left: Option<Duration>,
}

/// The picture after a pass.
pub struct Snapshot<'a> {
    /// Samples of every pixel.
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
