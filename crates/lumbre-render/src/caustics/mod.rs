//! Photons for caustics: light from lamps over mirrors and smooth glass, which camera paths hardly ever find.
//!
//! A pass of light paths serves a few samples of every pixel, and is a function of the scene, the options, the seed and
//! its number. The first thread that needs a pass traces it; other threads that need it help.

mod light_paths;
mod merging;
mod photons;
mod share;

use std::ops::Range;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

use lumbre_shading::spectrum::WavelengthDensity;

pub(crate) use light_paths::{ChordSampler, LightTracer, typical_way};
pub(crate) use merging::{Merging, radius};
pub(crate) use photons::{Photon, Photons};
pub use share::caustic_share;

/// Samples per pixel that share a pass of light paths, in RGB.
const SAMPLES_A_PASS: u32 = 4;
/// Lines of a pass: one for each pixel, within these limits; in a spectral render, a quarter of it.
const MIN_LINES: u32 = 1 << 12;
const MAX_LINES: u32 = 1 << 18;
/// Pieces of a pass, each traced by one thread.
const PIECES: u32 = 32;
/// Samples per pixel whose passes are kept: those between two noise checks.
const KEPT_SAMPLES: u32 = 32;

/// How the light paths of a picture are divided into passes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PassPlan {
    /// The number of pixels across and down.
    size: [u32; 2],
    /// How paths choose wavelengths; `None` in RGB. The paths of a pass have the same wavelengths, those of the camera
    /// and those of light. So there is a pass for each sample of a pixel, of fewer lines.
    density: Option<WavelengthDensity>,
}

impl PassPlan {
    /// The plan for a picture of a size, in RGB or by wavelengths.
    pub(crate) fn new(size: [u32; 2], density: Option<WavelengthDensity>) -> Self {
        Self { size, density }
    }

    /// The samples of a pixel that share a pass.
    fn samples(&self) -> u32 {
        if self.density.is_some() { 1 } else { SAMPLES_A_PASS }
    }

    /// The pass of a sample.
    pub(crate) fn pass_of(&self, sample: u32) -> u32 {
        sample / self.samples()
    }

    /// The lines of a pass.
    pub(crate) fn lines(&self) -> u32 {
        let [width, height] = self.size;
        width.saturating_mul(height).clamp(MIN_LINES, MAX_LINES) / (SAMPLES_A_PASS / self.samples())
    }

    /// How many passes are kept.
    fn kept(&self) -> usize {
        (KEPT_SAMPLES / self.samples()) as usize
    }
}

/// Memory bound of the passes for a picture of a size. A line may start several light paths, but most start none.
pub(crate) fn memory_bytes(width: u32, height: u32) -> u64 {
    let plan = PassPlan::new([width, height], None);
    plan.kept() as u64 * u64::from(plan.lines()) * 2 * size_of::<Photon>() as u64
}

/// The cached passes of a render.
#[derive(Debug, Default)]
pub(crate) struct Passes {
    /// Each with its plan and its number.
    kept: Mutex<Vec<(PassPlan, u32, Arc<Pass>)>>,
}

/// A pass while threads trace it.
#[derive(Debug, Default)]
struct Pass {
    next_piece: AtomicU32,
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct State {
    pieces: Vec<Option<Vec<Photon>>>,
    has_failed: bool,
    photons: Option<Arc<Photons>>,
}

impl Passes {
    /// The photons of a pass; traced if they are not cached.
    pub(crate) fn get(&self, tracer: &LightTracer<'_>, plan: &PassPlan, number: u32) -> Arc<Photons> {
        let pass = self.find(plan, number);
        pass.help(tracer, plan.lines(), number);
        pass.wait()
    }

    fn find(&self, plan: &PassPlan, number: u32) -> Arc<Pass> {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let pass = match kept.iter().position(|(of, at, _)| of == plan && *at == number) {
            Some(position) => kept.remove(position).2,
            None => Arc::default(),
        };
        kept.push((*plan, number, Arc::clone(&pass)));
        if kept.len() > plan.kept() {
            kept.remove(0);
        }
        pass
    }
}

impl Pass {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Traces pieces until all have been started.
    fn help(&self, tracer: &LightTracer<'_>, lines: u32, number: u32) {
        loop {
            let piece = self.next_piece.fetch_add(1, Ordering::Relaxed);
            if piece >= PIECES {
                // Keeps the counter from wrapping around.
                self.next_piece.store(PIECES, Ordering::Relaxed);
                return;
            }
            let attempt = Attempt { pass: self };
            let mut photons = Vec::new();
            tracer.trace(number, lines_of_piece(lines, piece), &mut photons);
            std::mem::forget(attempt);
            self.put(piece, photons);
        }
    }

    /// Completes a piece; the last one completes the pass.
    fn put(&self, piece: u32, photons: Vec<Photon>) {
        let mut state = self.state();
        state.pieces.resize(PIECES as usize, None);
        state.pieces[piece as usize] = Some(photons);
        if state.pieces.iter().all(Option::is_some) {
            let pieces = std::mem::take(&mut state.pieces);
            state.photons = Some(Arc::new(Photons::new(pieces.into_iter().flatten().flatten().collect())));
            self.changed.notify_all();
        }
    }

    fn wait(&self) -> Arc<Photons> {
        let mut state = self.state();
        loop {
            assert!(!state.has_failed, "another thread failed to trace light paths");
            if let Some(photons) = &state.photons {
                return Arc::clone(photons);
            }
            state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

/// A piece that is being traced. A panic releases the threads that wait for it.
struct Attempt<'a> {
    pass: &'a Pass,
}

impl Drop for Attempt<'_> {
    fn drop(&mut self) {
        self.pass.state().has_failed = true;
        self.pass.changed.notify_all();
    }
}

/// The lines of a piece.
fn lines_of_piece(lines: u32, piece: u32) -> Range<u32> {
    let start = |piece: u32| (u64::from(lines) * u64::from(piece) / u64::from(PIECES)) as u32;
    start(piece)..start(piece + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_are_all_lines_of_a_pass() {
        for lines in [MIN_LINES, 5000, MAX_LINES] {
            let pieces: Vec<u32> = (0..PIECES).flat_map(|piece| lines_of_piece(lines, piece)).collect();
            assert!(pieces.into_iter().eq(0..lines));
        }
    }
}
