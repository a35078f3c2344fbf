//! What the race found, as tables in Markdown, plots and JSON.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

use anyhow::{Context, Result};
use serde_json::{Value, json};

use super::curve::{Point, geometric_mean, time_to_error};
use super::plot::{Line, svg};
use super::program::Kind;

/// All programs on one scene with this many threads.
#[derive(Debug)]
pub(crate) struct Heat {
    pub(crate) scene: &'static str,
    pub(crate) about: &'static str,
    pub(crate) threads: usize,
    pub(crate) curves: Vec<Curve>,
    /// The relative mean squared error of the reference of Lumbre's, by noise.
    pub(crate) noise: f64,
    pub(crate) agreement: Option<Agreement>,
    /// The programs that were measured against references of their own.
    pub(crate) own: Vec<Kind>,
    /// Who was left out, and why.
    pub(crate) notes: Vec<String>,
    /// The error that all are to reach.
    pub(crate) target: Option<f64>,
}

/// How one program, in one way, comes to less error in more time.
#[derive(Debug)]
pub(crate) struct Curve {
    pub(crate) kind: Kind,
    pub(crate) version: String,
    pub(crate) name: String,
    pub(crate) way: &'static str,
    /// The place of its program among those of the heat.
    pub(crate) place: usize,
    /// In the order of their samples.
    pub(crate) points: Vec<Point>,
    /// The mean of its best picture over that of Lumbre's reference.
    pub(crate) brightness: f64,
}

/// How Mitsuba's reference compares with Lumbre's.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Agreement {
    /// The relative mean squared error between the two.
    pub(crate) relative_mse: f64,
    /// As much of it as the noise of both makes.
    pub(crate) noise: f64,
    /// The ratio of their means.
    pub(crate) brightness: f64,
}

impl Heat {
    fn seconds(&self, curve: &Curve) -> Option<(f64, bool)> {
        let time = time_to_error(&curve.points, self.target?)?;
        Some((time.seconds, time.measured))
    }

    /// The least time of a program, over its ways.
    fn best(&self, kind: Kind) -> Option<(f64, bool)> {
        let times = self.curves.iter().filter(|c| c.kind == kind).filter_map(|c| self.seconds(c));
        times.min_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// How many times as long as Lumbre a program takes.
    fn ratio(&self, kind: Kind) -> Option<(f64, bool)> {
        let (ours, theirs) = (self.best(Kind::Lumbre)?, self.best(kind)?);
        Some((theirs.0 / ours.0, ours.1 && theirs.1))
    }

    fn file(&self) -> String {
        format!("{}-{}.svg", self.scene, self.threads)
    }
}

fn threads_text(threads: usize) -> String {
    if threads == 1 { "one thread".to_owned() } else { format!("{threads} threads") }
}

/// What lies beyond the measurements is marked.
fn marked((value, measured): (f64, bool), unit: &str) -> String {
    format!("{}{value:.2}{unit}", if measured { "" } else { "~" })
}

/// A table of one heat.
pub(crate) fn heat_table(heat: &Heat, ladder: &[u32]) -> String {
    let mut out = String::from("| program |");
    for spp in ladder {
        let _ = write!(out, " {spp} spp |");
    }
    let target = heat.target.unwrap_or(f64::NAN);
    let _ = writeln!(out, " time to {target:.2e} | as long as Lumbre | mean |");
    out.push_str(&"|---".repeat(ladder.len() + 4));
    out.push_str("|\n");
    let lumbre = heat.best(Kind::Lumbre);
    for curve in &heat.curves {
        let own = if heat.own.contains(&curve.kind)
            || heat.own.contains(&Kind::MitsubaLlvm) && curve.kind == Kind::MitsubaScalar
        {
            " †"
        } else {
            ""
        };
        let _ = write!(out, "| {}{own} |", curve.name);
        for (i, spp) in ladder.iter().enumerate() {
            match curve.points.get(i) {
                Some(p) if p.spp == *spp => write!(out, " {:.2} s, {:.2e} |", p.seconds, p.error),
                Some(p) => write!(out, " ({}) {:.2} s, {:.2e} |", p.spp, p.seconds, p.error),
                None => write!(out, " |"),
            }
            .ok();
        }
        let time = heat.seconds(curve);
        let ratio = lumbre.zip(time).map(|(ours, theirs)| (theirs.0 / ours.0, ours.1 && theirs.1));
        let _ = writeln!(
            out,
            " {} | {} | {:+.1} % |",
            time.map_or(String::new(), |t| marked(t, " s")),
            ratio.map_or(String::new(), |r| marked(r, "")),
            100.0 * (curve.brightness - 1.0)
        );
    }
    out
}

/// How many times as long as Lumbre each program takes to the same error, over all scenes.
pub(crate) fn summary(heats: &[Heat]) -> String {
    let mut out = String::new();
    let mut threads: Vec<usize> = heats.iter().map(|h| h.threads).collect();
    threads.dedup();
    for threads in threads {
        let heats: Vec<&Heat> = heats.iter().filter(|h| h.threads == threads).collect();
        let _ = write!(out, "| {} |", threads_text(threads));
        heats.iter().for_each(|h| {
            let _ = write!(out, " {} |", h.scene);
        });
        let _ = writeln!(out, " geometric mean |\n|{}", "---|".repeat(heats.len() + 2));
        for kind in Kind::ALL {
            let ratios: Vec<Option<(f64, bool)>> = heats.iter().map(|h| h.ratio(kind)).collect();
            if kind == Kind::Lumbre || ratios.iter().all(Option::is_none) {
                continue;
            }
            let _ = write!(out, "| {} |", kind.name());
            for ratio in &ratios {
                let _ = write!(out, " {} |", ratio.map_or(String::new(), |r| marked(r, "")));
            }
            let known: Vec<f64> = ratios.iter().flatten().map(|r| r.0).collect();
            let mean = geometric_mean(&known).map_or(String::new(), |m| format!("{m:.2}"));
            let _ = writeln!(out, " {mean} |");
        }
        out.push('\n');
    }
    out
}

const BEGIN: &str = "<!-- the race begins: written by cargo xtask bench render -->";
const END: &str = "<!-- the race ends -->";

/// Writes `race.md`, between its markers where it exists, and the plots into `race/`.
pub(crate) fn write(heats: &[Heat], ladder: &[u32], size: u32, folder: &Path) -> Result<()> {
    let plots = folder.join("race");
    fs::create_dir_all(&plots)?;
    let mut text = String::new();
    let mut versions: Vec<&str> =
        heats.iter().flat_map(|h| &h.curves).map(|c| c.version.as_str()).filter(|v| !v.is_empty()).collect();
    versions.sort_unstable();
    versions.dedup();
    let _ = writeln!(
        text,
        "{}, {}, pictures of {size} x {size} pixels. {}.\n",
        date(SystemTime::now()),
        machine(),
        versions.join(", ")
    );
    text.push_str(
        "How many times as long as Lumbre each program takes to the same error, in the best of its ways:\n\n",
    );
    text.push_str(&summary(heats));
    for heat in heats {
        let points = |curve: &Curve| curve.points.iter().map(|p| [p.seconds, p.error]).collect();
        let lines: Vec<Line<'_>> =
            heat.curves.iter().map(|c| Line { name: &c.name, points: points(c) }).collect();
        let axes = ["seconds of rendering", "relative mean squared error"];
        let title = format!("{}, {}", heat.scene, threads_text(heat.threads));
        fs::write(plots.join(heat.file()), svg(&title, axes, &lines))?;
        let _ = writeln!(text, "### {title}\n\n{}\n", heat.about);
        let _ = write!(text, "Noise of the reference: {:.1e}.", heat.noise);
        if let Some(agreement) = heat.agreement {
            let _ = write!(
                text,
                " Mitsuba's reference beside Lumbre's: relative MSE {:.1e}, of which the noise of both is {:.1e}; mean {:+.2} %.",
                agreement.relative_mse,
                agreement.noise,
                100.0 * (agreement.brightness - 1.0)
            );
        }
        text.push_str("\n\n");
        let _ =
            writeln!(text, "![{0}](race/{0}.png) ![Error against time](race/{1})\n", heat.scene, heat.file());
        text.push_str(&heat_table(heat, ladder));
        text.push('\n');
        for note in &heat.notes {
            let _ = writeln!(text, "{note}\n");
        }
    }
    let file = folder.join("race.md");
    let old = if file.exists() { fs::read_to_string(&file)? } else { format!("{BEGIN}\n{END}\n") };
    fs::write(
        &file,
        between_markers(&old, &text).with_context(|| format!("{} has no markers", file.display()))?,
    )?;
    Ok(())
}

/// The text with another middle; `None` where the markers are missing.
fn between_markers(old: &str, middle: &str) -> Option<String> {
    let (before, rest) = old.split_once(BEGIN)?;
    let (_, after) = rest.split_once(END)?;
    Some(format!("{before}{BEGIN}\n\n{}\n\n{END}{after}", middle.trim()))
}

/// The figures, in the form of all benchmarks of the workspace.
pub(crate) fn json(heats: &[Heat]) -> Value {
    let mut rows = Vec::new();
    for heat in heats {
        for kind in Kind::ALL.into_iter().filter(|kind| *kind != Kind::Lumbre) {
            if let (Some(ours), Some(theirs), Some(target)) =
                (heat.best(Kind::Lumbre), heat.best(kind), heat.target)
            {
                rows.push(json!({
                    "scene": heat.scene,
                    "work": format!("relative MSE {target:.3e}"),
                    "unit": "s",
                    "threads": heat.threads,
                    "lumbre": ours.0,
                    "peer": theirs.0,
                    "peer_name": kind.name(),
                    "ratio": theirs.0 / ours.0,
                    "spread": null,
                    "measured": ours.1 && theirs.1,
                }));
            }
        }
    }
    let curves: Vec<Value> = heats
        .iter()
        .flat_map(|heat| heat.curves.iter().map(move |curve| (heat, curve)))
        .map(|(heat, curve)| {
            let points: Vec<Value> = curve
                .points
                .iter()
                .map(|p| json!({"spp": p.spp, "seconds": p.seconds, "error": p.error}))
                .collect();
            json!({"scene": heat.scene, "threads": heat.threads, "program": curve.name, "points": points})
        })
        .collect();
    json!({"machine": machine(), "date": date(SystemTime::now()), "rows": rows, "curves": curves})
}

/// The processor and its threads.
pub(super) fn machine() -> String {
    let info = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model =
        info.lines().find_map(|line| line.strip_prefix("model name")).and_then(|rest| rest.split_once(':'));
    let model = model.map_or(std::env::consts::ARCH, |(_, name)| name.trim());
    let threads = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    format!("{model}, {threads} threads, {}", std::env::consts::OS)
}

/// The day as year-month-day, by Hinnant, "chrono-compatible low-level date algorithms", 2021.
pub(super) fn date(time: SystemTime) -> String {
    let days = time.duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs() / 86_400) as i64 + 719_468;
    let (era, of_era) = (days / 146_097, days % 146_097);
    let year_of_era = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month_from_march = (5 * of_year + 2) / 153;
    let day = of_year - (153 * month_from_march + 2) / 5 + 1;
    let month = if month_from_march < 10 { month_from_march + 3 } else { month_from_march - 9 };
    let year = year_of_era + era * 400 + i64::from(month <= 2);
    format!("{year}-{month:02}-{day:02}")
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn the_table_replaces_only_the_last_one() {
        let old = format!("# Race\nbefore\n{BEGIN}\nold\n{END}\nafter\n");
        let new = between_markers(&old, "new\n").unwrap();
        assert_eq!(new, format!("# Race\nbefore\n{BEGIN}\n\nnew\n\n{END}\nafter\n"));
        assert_eq!(between_markers(&new, "new\n").unwrap(), new);
        assert_eq!(between_markers("# Race\n", "new"), None);
    }

    #[test]
    fn leap_days_and_ends_of_years_have_their_date() {
        for (days, text) in
            [(0, "1970-01-01"), (11_016, "2000-02-29"), (20_453, "2025-12-31"), (20_820, "2027-01-02")]
        {
            assert_eq!(date(UNIX_EPOCH + Duration::from_secs(days * 86_400 + 4321)), text);
        }
    }
}
