//! Progress display.

use std::fmt;
use std::io::IsTerminal;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use clap::ValueEnum;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use lumbre::image::Image;
use lumbre::{Progress, Snapshot, State};

use crate::signals::{Phase, Signals};
use crate::units::{counted, spoken};

/// How to show progress.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Style {
    /// A bar on a terminal, else lines.
    Auto,
    /// A bar.
    Bar,
    /// A line every 2 seconds, less often in long renders.
    Plain,
    /// A JSON object per line, every 2 seconds.
    Json,
    /// Nothing.
    None,
}

/// Receives the picture during the render.
pub(crate) trait PictureViewer: Sync {
    /// Shows the picture, unless one was shown a moment ago; the last one always. It is put together when asked for.
    fn show(&self, picture: &dyn Fn() -> Image, is_last: bool);
}

/// Reports progress to standard error and to the signal handler.
pub(crate) struct ProgressReporter<'a> {
    /// What is shown.
    pub display: Display,
    /// Who watches.
    pub signals: &'a Signals,
    /// Who else wants to see the picture.
    pub viewers: Vec<Box<dyn PictureViewer>>,
    /// The position in a series of pictures.
    pub series: Option<Series>,
    /// The last whole pass over the picture.
    pub pass: Mutex<Pass>,
}

/// What is known after a pass over the picture.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Pass {
    /// Samples of each pixel.
    spp: u32,
    noise: Option<f64>,
}

/// The place of a picture among several that are rendered one after another.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Series {
    /// The number of the frame.
    pub number: u32,
    /// How many are done.
    pub done: u32,
    /// How many there are.
    pub count: u32,
    /// When the first began.
    pub start: Instant,
}

impl fmt::Display for Series {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let left = time_left(self.left(0.0));
        write!(f, "frame {} ({} of {}{left})", self.number, self.done + 1, self.count)
    }
}

impl Series {
    /// The share of all that is done, when this is done of the picture.
    fn share(&self, of_picture: f64) -> f64 {
        (f64::from(self.done) + of_picture) / f64::from(self.count)
    }

    /// The time until all are done, if they take as long on average, when this is done of the picture.
    fn left(&self, of_picture: f64) -> Option<Duration> {
        let (share, elapsed) = (self.share(of_picture), self.start.elapsed().as_secs_f64());
        let is_known = self.done > 0 || of_picture >= MIN_SHARE;
        Duration::try_from_secs_f64(elapsed / share - elapsed).ok().filter(|_| is_known)
    }
}

impl ProgressReporter<'_> {
    /// The render has ended with this picture.
    pub(crate) fn finish(&self, picture: &Image) {
        self.display.finish();
        self.viewers.iter().for_each(|viewer| viewer.show(&|| picture.clone(), true));
    }
}

impl Progress for ProgressReporter<'_> {
    fn state(&self, state: &State) {
        self.signals.took(state.samples);
        let pass = self.pass.lock().map(|pass| *pass).unwrap_or_default();
        self.display.state(state, &pass, self.series.as_ref());
    }

    fn pass(&self, snapshot: &Snapshot<'_>) {
        if let Ok(mut pass) = self.pass.lock() {
            *pass = Pass { spp: snapshot.spp, noise: snapshot.noise };
        }
        self.viewers.iter().for_each(|viewer| viewer.show(&|| snapshot.image(), false));
    }

    fn stopped(&self, stride: Option<u32>) {
        // From here on there is something to save, and nothing that could go on without end.
        let is_whole = stride == Some(1) || (stride.is_some() && self.signals.received().is_none());
        if is_whole {
            self.signals.enter(Phase::Saving);
        }
    }
}

/// Progress on standard error.
pub(crate) enum Display {
    /// A bar, or a line of words where it is not known how much there is to do.
    Bar(ProgressBar),
    /// Lines.
    Lines {
        /// Whether they are JSON.
        json: bool,
        /// The times of the first and the last one.
        shown: Mutex<Option<(Instant, Instant)>>,
    },
    /// Nothing.
    None,
}

/// The length of a bar.
const STEPS: u64 = 1000;
/// The least interval between lines.
const INTERVAL: Duration = Duration::from_secs(2);
/// The interval between lines of words, as a share of the time since the first: 240 lines in 8 minutes would hide all
/// others.
const INTERVAL_SHARE: f64 = 0.1;
/// The share that has to be done before the time left is told: less says little about the rest.
const MIN_SHARE: f64 = 0.01;

impl Display {
    /// A display that shows nothing yet.
    pub(crate) fn new(style: Style) -> Self {
        match style {
            Style::None => Self::None,
            Style::Auto if std::io::stderr().is_terminal() => Self::bar(),
            Style::Bar => Self::bar(),
            Style::Auto | Style::Plain => Self::Lines { json: false, shown: Mutex::new(None) },
            Style::Json => Self::Lines { json: true, shown: Mutex::new(None) },
        }
    }

    fn bar() -> Self {
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
        Self::Bar(styled(bar, "{msg}"))
    }

    /// Clears a bar.
    pub(crate) fn finish(&self) {
        if let Self::Bar(bar) = self {
            bar.finish_and_clear();
        }
    }

    /// Shows what share is done, in [0, 1], and words; `json` is the line of [`Style::Json`].
    fn show(&self, share: Option<f64>, words: String, json: impl FnOnce() -> serde_json::Value) {
        match self {
            Self::None => {}
            Self::Bar(bar) => {
                if let Some(share) = share {
                    if bar.length().is_none() {
                        bar.set_length(STEPS);
                        styled(bar.clone(), "{bar:40} {percent:>3}%  {msg}");
                    }
                    bar.set_position((share * STEPS as f64) as u64);
                }
                bar.set_message(words);
            }
            Self::Lines { json: is_json, shown } => {
                let Ok(mut shown) = shown.lock() else { return };
                let is_done = share.is_some_and(|share| share >= 1.0);
                let is_due = |(first, last): (Instant, Instant)| {
                    last.elapsed() >= interval(last.duration_since(first), *is_json)
                };
                if !is_done && !shown.is_none_or(is_due) {
                    return;
                }
                let now = Instant::now();
                *shown = Some((shown.map_or(now, |(first, _)| first), now));
                match share {
                    _ if *is_json => say!("{}", json()),
                    Some(share) => say!("{:5.1} %  {words}", 100.0 * share),
                    None => say!("{words}"),
                }
            }
        }
    }

    fn state(&self, state: &State, pass: &Pass, series: Option<&Series>) {
        let all = series.map(|series| (series, series.share(state.share), series.left(state.share)));
        let left = state.left.filter(|_| state.share >= MIN_SHARE);
        let seconds = state.elapsed.as_secs_f64();
        let rays_per_second = if seconds > 0.0 { state.rays as f64 / seconds } else { 0.0 };
        let mut words = all.map_or_else(String::new, |(series, _, left)| {
            let Series { number, done, count, .. } = series;
            format!("frame {number}, {} of {count}{}; ", done + 1, time_left(left))
        });
        if pass.spp > 0 {
            words += &format!("{} per pixel, ", counted(u64::from(pass.spp), "sample"));
        }
        if let Some(noise) = pass.noise {
            words += &format!("noise {noise:.3}, ");
        }
        words += &format!("{:.1} M rays/s, ", rays_per_second / 1e6);
        words += &format!("{}{}", spoken(state.elapsed), time_left(left));
        self.show(Some(state.share), words, || {
            serde_json::json!({
                "frame": all.map(|(series, ..)| series.number),
                "share_of_all": all.map(|(_, share, _)| share),
                "seconds_left_of_all": all.and_then(|(.., left)| left).map(|left| left.as_secs_f64()),
                "samples_per_pixel": pass.spp,
                "noise": pass.noise,
                "rays_per_second": rays_per_second,
                "samples": state.samples,
                "total": state.total,
                "share": state.share,
                "seconds": state.elapsed.as_secs_f64(),
                "seconds_left": left.map(|left| left.as_secs_f64()),
            })
        });
    }
}

/// The time from one line to the next, when this time has passed since the first.
fn interval(elapsed: Duration, is_json: bool) -> Duration {
    // Programs get a steady stream.
    if is_json { INTERVAL } else { INTERVAL.max(elapsed.mul_f64(INTERVAL_SHARE)) }
}

fn styled(bar: ProgressBar, template: &str) -> ProgressBar {
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    bar
}

fn time_left(left: Option<Duration>) -> String {
    left.map_or_else(String::new, |left| format!(", {} left", spoken(left)))
}

/// How many rays are done, on a terminal.
pub(crate) struct RayProgress {
    display: Display,
    start: Instant,
}

impl RayProgress {
    /// Shows nothing yet, or never anything.
    pub(crate) fn new(quiet: bool) -> Self {
        let is_shown = !quiet && std::io::stderr().is_terminal();
        Self { display: Display::new(if is_shown { Style::Bar } else { Style::None }), start: Instant::now() }
    }

    /// Shows how many rays are done, and which share of all that is, if known.
    pub(crate) fn show(&self, rays: u64, share: Option<f64>) {
        let elapsed = self.start.elapsed();
        self.display.show(share, ray_words(rays, share, elapsed), || serde_json::json!({ "rays": rays }));
    }

    /// Clears what is shown.
    pub(crate) fn finish(&self) {
        self.display.finish();
    }
}

fn ray_words(rays: u64, share: Option<f64>, elapsed: Duration) -> String {
    let seconds = elapsed.as_secs_f64();
    let rate = rays as f64 / seconds.max(1e-3);
    let share = share.filter(|share| (MIN_SHARE..=1.0).contains(share));
    let left = share.and_then(|share| Duration::try_from_secs_f64(seconds / share - seconds).ok());
    format!("{:.1} million rays, {:.2} million/s{}", rays as f64 / 1e6, rate / 1e6, time_left(left))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_told_with_their_place_in_the_whole() {
        let start = Instant::now() - Duration::from_secs(30);
        let series = Series { number: 12, done: 2, count: 5, start };
        // Half of the third of five pictures: half of all.
        assert_eq!(series.share(0.5), 0.5);
        // Half of the third is left, and two more.
        assert!((series.left(0.5).unwrap().as_secs_f64() - 30.0).abs() < 1.0);
        assert_eq!(series.to_string(), "frame 12 (3 of 5, 45 s left)");
        let first = Series { done: 0, ..series };
        assert_eq!(first.to_string(), "frame 12 (1 of 5)");
        assert_eq!(first.left(0.009), None);
        assert!(first.left(0.02).is_some());
    }

    #[test]
    fn lines_come_less_often_as_time_passes() {
        let seconds_between =
            |seconds, is_json| interval(Duration::from_secs(seconds), is_json).as_secs_f64();
        assert_eq!([0, 20, 50, 600].map(|seconds| seconds_between(seconds, false)), [2.0, 2.0, 5.0, 60.0]);
        assert_eq!(seconds_between(600, true), 2.0);
    }

    #[test]
    fn the_time_left_is_said_where_the_share_is_known() {
        let elapsed = Duration::from_secs(20);
        let words = |share| ray_words(30_000_000, share, elapsed);
        assert_eq!(words(Some(0.25)), "30.0 million rays, 1.50 million/s, 60 s left");
        assert_eq!(words(None), "30.0 million rays, 1.50 million/s");
        assert_eq!(words(Some(0.009)), "30.0 million rays, 1.50 million/s");
    }
}
