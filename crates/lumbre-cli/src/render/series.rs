//! The pictures of `lumbre render`: one, the frames of an animation, or views from all around.

use std::ops::RangeInclusive;
use std::path::Path;
use std::time::Instant;

use lumbre::{CancelToken, RenderOptions};

use super::Arguments;
use super::picture::{Context, First, FirstStage, Frame, picture};
use crate::denoiser::{Choice, Denoiser};
use crate::failure::Failure;
use crate::output::{self, Inputs};
use crate::progress::Series;
use crate::reading::Frames;
use crate::signals::{Phase, Signals};

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    // Invalid names are reported before the scene is read, invalid folders before it is rendered.
    let named = arguments.output.as_deref().map(|output| arguments.named(output));
    arguments.staging.check(named.as_deref())?;
    arguments.check_frames(named.as_deref())?;
    if let Some(output) = &named {
        arguments.check_format(output)?;
    }
    arguments.check_standard_output()?;
    let denoiser = Denoiser::find(arguments.denoise.unwrap_or(Choice::None))?;
    let denoiser = denoiser.as_ref();
    let inputs = Inputs::of(arguments.inputs());
    output::refuse_inputs(arguments.file(), &arguments.pictures(), arguments.stats.as_deref(), &inputs)?;
    let start = Instant::now();
    if let (Some((width, height)), None) = (arguments.size, &arguments.crop) {
        // Reports impossible options before anything is read.
        let mut asked = RenderOptions::default();
        (asked.width, asked.height) = (width, height);
        asked.guides = denoiser.is_some();
        arguments.reading.memory().check_picture(&asked, 0)?;
    }
    let cancel = CancelToken::new();
    let signals = Signals::listen(&cancel)?;
    signals.end_at(arguments.deadline(start));
    signals.enter(reading(arguments));
    let mut stage = arguments.staging.stage(arguments.size, arguments.reading.limits())?;
    arguments.view.set(&mut stage)?;
    // The first picture's name and exposure are used for all.
    let animation = arguments.animation()?;
    let mut first = First { pattern: None, exposure: arguments.exposure, animation };
    let context = Context { arguments, stage: &stage, start, cancel: &cancel, signals: &signals, denoiser };
    match (&arguments.frames, arguments.staging.turntable()) {
        (Some(Frames(numbers)), _) => frames(context, numbers, &mut first)?,
        (None, Some(count)) => turntable(context, count, &mut first)?,
        (None, None) => {
            let (desc, mut diagnostics) = arguments.reading.describe(&arguments.scene)?;
            picture(context, desc, &mut diagnostics, None, &mut first)?;
        }
    }
    if let Some(animation) = first.animation {
        animation.finish()?;
    }
    match signals.received() {
        Some(status) => Err(Failure::Interrupted(status)),
        None => Ok(()),
    }
}

/// The phase of reading a scene: a file has an end, a pipe may have none.
fn reading(arguments: &Arguments) -> Phase {
    let what = "reading the scene";
    let is_file = arguments.inputs().all(Path::is_file);
    if is_file { Phase::Preparing(what) } else { Phase::Receiving(what) }
}

/// Renders frames of an animation, each read at its own time.
fn frames(context: Context<'_>, numbers: &RangeInclusive<u32>, first: &mut First) -> Result<(), Failure> {
    let Context { arguments, signals, .. } = context;
    let mut first_stage = FirstStage::default();
    let count = numbers.end() - numbers.start() + 1;
    for number in numbers.clone() {
        let start = Instant::now();
        signals.end_at(arguments.deadline(start));
        signals.enter(reading(arguments));
        let (desc, mut diagnostics) = arguments.reading.describe_frame(&arguments.scene, number)?;
        let done = number - numbers.start();
        let series = Series { number, done, count, start: context.start };
        if !arguments.quiet {
            say!("{series}");
        }
        let frame = Some((Frame { number, is_first: done == 0, series }, &mut first_stage));
        picture(Context { start, ..context }, desc, &mut diagnostics, frame, first)?;
        if context.cancel.is_cancelled() {
            break;
        }
    }
    Ok(())
}

/// Renders views from all around, one turn.
fn turntable(context: Context<'_>, count: u32, first: &mut First) -> Result<(), Failure> {
    let Context { arguments, signals, .. } = context;
    let (desc, mut diagnostics) = arguments.reading.describe(&arguments.scene)?;
    for done in 0..count {
        let mut stage = context.stage.clone();
        stage.turns = Some(f64::from(done) / f64::from(count));
        // The time of the first one includes reading.
        let start = if done == 0 { context.start } else { Instant::now() };
        signals.end_at(arguments.deadline(start));
        let series = Series { number: done + 1, done, count, start: context.start };
        let frame = Frame { number: done + 1, is_first: done == 0, series };
        // Each rotation has its own camera.
        let frame = Some((frame, &mut FirstStage::default()));
        picture(Context { stage: &stage, start, ..context }, desc.clone(), &mut diagnostics, frame, first)?;
        if context.cancel.is_cancelled() {
            break;
        }
    }
    Ok(())
}
