//! Progress display.

use std::io::IsTerminal;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use clap::ValueEnum;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use lumbre::{Progress, State};

use crate::signals::{Phase, Signals};
use crate::units::spoken;

/// How to show progress.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Style {
    /// A bar on a terminal, else lines.
    Auto,
    /// A bar.
    Bar,
    /// A line now and then.
    Plain,
    /// A JSON object a line.
    Json,
    /// Nothing.
    None,
}

/// Progress on standard error, and to those who watch for signals.
pub(crate) struct Watched<'a> {
    /// What is shown.
    pub display: Display,
    /// Who watches.
    pub signals: &'a Signals,
}

impl Progress for Watched<'_> {
    fn state(&self, state: &State) {
        self.display.state(state);
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
    /// A bar.
    Bar(ProgressBar),
    /// Lines, with the time of the last one.
    Lines {
        /// Whether they are JSON.
        json: bool,
        /// The time of the last one.
        last: Mutex<Option<Instant>>,
    },
    /// Nothing.
    None,
}

/// The length of a bar.
const STEPS: u64 = 1000;
/// The interval between lines.
const INTERVAL: Duration = Duration::from_secs(2);

impl Display {
    /// A display that shows nothing yet.
    pub(crate) fn new(style: Style) -> Self {
        match style {
            Style::None => Self::None,
            Style::Auto if std::io::stderr().is_terminal() => Self::bar(),
            Style::Bar => Self::bar(),
            Style::Auto | Style::Plain => Self::Lines { json: false, last: Mutex::new(None) },
            Style::Json => Self::Lines { json: true, last: Mutex::new(None) },
        }
    }

    fn bar() -> Self {
        let bar = ProgressBar::with_draw_target(Some(STEPS), ProgressDrawTarget::stderr());
        if let Ok(style) = ProgressStyle::with_template("{bar:40} {percent:>3}%  {msg}") {
            bar.set_style(style);
        }
        Self::Bar(bar)
    }

    /// Clears a bar.
    pub(crate) fn finish(&self) {
        if let Self::Bar(bar) = self {
            bar.finish_and_clear();
        }
    }
}

impl Display {
    fn state(&self, state: &State) {
        let left = state.left.map_or_else(String::new, |left| format!(", {} left", spoken(left)));
        match self {
            Self::None => {}
            Self::Bar(bar) => {
                bar.set_position((state.share * STEPS as f64) as u64);
                bar.set_message(format!("{}{left}", spoken(state.elapsed)));
            }
            Self::Lines { json, last } => {
                let Ok(mut last) = last.lock() else { return };
                let due = last.is_none_or(|at| at.elapsed() >= INTERVAL) || state.share >= 1.0;
                if !due {
                    return;
                }
                *last = Some(Instant::now());
                if *json {
                    let line = serde_json::json!({
                        "samples": state.samples,
                        "total": state.total,
                        "share": state.share,
                        "seconds": state.elapsed.as_secs_f64(),
                        "seconds_left": state.left.map(|left| left.as_secs_f64()),
                    });
                    say!("{line}");
                } else {
                    let percent = 100.0 * state.share;
                    say!("{percent:5.1} %  {}{left}", spoken(state.elapsed));
                }
            }
        }
    }
}
