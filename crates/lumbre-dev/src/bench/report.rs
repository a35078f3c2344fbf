//! The table, and the same figures as JSON.

use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

use anyhow::{Context, Result};
use serde_json::{Value, json};

use crate::measure::{Ratio, geometric_mean};

/// A figure of Lumbre and of a peer.
#[derive(Clone, Debug)]
pub(crate) struct Row {
    /// The scene.
    pub scene: String,
    /// What was measured, such as `closest primary` or `build`.
    pub work: String,
    /// The unit of the two figures.
    pub unit: &'static str,
    /// On how many threads.
    pub threads: usize,
    /// Lumbre's figure.
    pub lumbre: f64,
    /// The peer's name, its figure, and the ratio, more than 1 where Lumbre is faster or smaller. `None` where no peer
    /// takes part.
    pub peer: Option<(String, f64, Ratio)>,
}

/// How the answers of a program on a scene compare.
#[derive(Clone, Debug)]
pub(crate) struct Mismatches {
    /// The scene.
    pub scene: String,
    /// The program.
    pub program: String,
    /// Answers that were held against the loop over everything, of all works and queries.
    pub sampled: usize,
    /// Those of them that were wrong.
    pub wrong: usize,
    /// Answers that were held against Lumbre's.
    pub compared: usize,
    /// Those of them that were others.
    pub differing: usize,
}

/// Everything that was measured.
#[derive(Default)]
pub(crate) struct Report {
    /// Speeds and sizes.
    pub rows: Vec<Row>,
    /// Right and wrong.
    pub mismatches: Vec<Mismatches>,
}

impl Report {
    /// The geometric means of the ratios to every peer, of the rows whose work begins with each of some words.
    pub(crate) fn means(&self) -> Vec<(String, &'static str, f64, f64, usize)> {
        let mut peers: Vec<&String> = Vec::new();
        for (name, _, _) in self.rows.iter().filter_map(|row| row.peer.as_ref()) {
            if !peers.contains(&name) {
                peers.push(name);
            }
        }
        let mut means = Vec::new();
        for peer in peers {
            for group in ["closest", "any", "build", "bytes", "peak bytes"] {
                let ratios: Vec<f64> = self
                    .rows
                    .iter()
                    .filter(|row| row.work.starts_with(group))
                    .filter_map(|row| row.peer.as_ref().filter(|(name, _, _)| name == peer))
                    .map(|(_, _, ratio)| ratio.median)
                    .filter(|ratio| ratio.is_finite() && *ratio > 0.0)
                    .collect();
                if !ratios.is_empty() {
                    let least = ratios.iter().copied().fold(f64::INFINITY, f64::min);
                    means.push((peer.clone(), group, geometric_mean(&ratios), least, ratios.len()));
                }
            }
        }
        means
    }

    /// Prints the means.
    pub(crate) fn print_means(&self) {
        println!("\nRatios to each peer (more than 1: Lumbre is faster, or smaller)");
        println!("{:<28} {:<10} {:>8} {:>8} {:>5}", "peer", "of", "mean", "least", "rows");
        for (peer, group, mean, least, rows) in self.means() {
            println!("{peer:<28} {group:<10} {mean:>8.2} {least:>8.2} {rows:>5}");
        }
    }

    /// The same as JSON.
    pub(crate) fn to_json(&self) -> Value {
        let row = |row: &Row| {
            let (name, figure, ratio, spread) = match &row.peer {
                Some((name, figure, ratio)) => {
                    (json!(name), json!(figure), json!(ratio.median), json!(ratio.spread))
                }
                None => (Value::Null, Value::Null, Value::Null, Value::Null),
            };
            json!({
                "scene": row.scene, "work": row.work, "unit": row.unit, "threads": row.threads,
                "lumbre": row.lumbre, "peer": figure, "peer_name": name, "ratio": ratio, "spread": spread,
            })
        };
        let mismatch = |m: &Mismatches| {
            json!({
                "scene": m.scene, "program": m.program, "sampled": m.sampled, "wrong": m.wrong,
                "compared": m.compared, "differing": m.differing,
            })
        };
        let mean = |(peer, group, mean, least, rows): (String, &str, f64, f64, usize)| json!({ "peer_name": peer, "of": group, "ratio": mean, "least": least, "rows": rows });
        json!({
            "machine": machine(),
            "date": today(),
            "rows": self.rows.iter().map(row).collect::<Vec<_>>(),
            "means": self.means().into_iter().map(mean).collect::<Vec<_>>(),
            "mismatches": self.mismatches.iter().map(mismatch).collect::<Vec<_>>(),
        })
    }

    /// Writes the JSON.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub(crate) fn write(&self, path: &Path) -> Result<()> {
        let text = serde_json::to_string_pretty(&self.to_json())?;
        std::fs::write(path, text + "\n").with_context(|| format!("cannot write {}", path.display()))
    }
}

/// The processor and how many threads it runs.
pub(crate) fn machine() -> String {
    let processor = std::fs::read_to_string("/proc/cpuinfo").ok().and_then(|text| {
        let line = text.lines().find(|line| line.starts_with("model name"))?;
        Some(line.split_once(':')?.1.trim().to_owned())
    });
    let threads = std::thread::available_parallelism().map_or(0, usize::from);
    let processor = processor.unwrap_or_else(|| std::env::consts::ARCH.to_owned());
    format!("{processor}, {threads} threads, {}", std::env::consts::OS)
}

/// The day, in UTC.
pub(crate) fn today() -> String {
    let seconds = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.as_secs());
    date_of((seconds / 86_400) as i64)
}

/// The day this many days after the first of January 1970, in the Gregorian calendar.
fn date_of(days: i64) -> String {
    let is_leap = |year: i64| (year % 4 == 0 && year % 100 != 0) || year % 400 == 0;
    let mut year = 1970;
    let mut rest = days;
    loop {
        let length = if is_leap(year) { 366 } else { 365 };
        if rest < length {
            break;
        }
        rest -= length;
        year += 1;
    }
    let february = if is_leap(year) { 29 } else { 28 };
    let mut month = 1;
    for length in [31, february, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31] {
        if rest < length {
            break;
        }
        rest -= length;
        month += 1;
    }
    format!("{year:04}-{month:02}-{:02}", rest + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_have_their_dates() {
        assert_eq!(date_of(0), "1970-01-01");
        assert_eq!(date_of(11_016), "2000-02-29");
        assert_eq!(date_of(20_453), "2025-12-31");
        assert_eq!(date_of(20_454), "2026-01-01");
    }

    #[test]
    fn the_json_has_the_words_that_others_rely_on() {
        let ratio = Ratio { median: 1.5, spread: 0.25 };
        let row = Row {
            scene: "indoor".to_owned(),
            work: "closest primary".to_owned(),
            unit: "Mray/s",
            threads: 2,
            lumbre: 6.0,
            peer: Some(("Embree 4".to_owned(), 4.0, ratio)),
        };
        let twice = Row {
            peer: Some(("Embree 4".to_owned(), 4.0, Ratio { median: 6.0, spread: 0.0 })),
            ..row.clone()
        };
        let report = Report { rows: vec![row, twice], mismatches: Vec::new() };
        let json = report.to_json();
        assert!(json["machine"].is_string() && json["date"].as_str().is_some_and(|date| date.len() == 10));
        let row = json["rows"][0].as_object().expect("an object");
        for word in ["scene", "work", "threads", "lumbre", "peer", "peer_name", "ratio", "spread"] {
            assert!(row.contains_key(word), "{word}");
        }
        assert_eq!((row["ratio"].as_f64(), row["threads"].as_u64()), (Some(1.5), Some(2)));
        assert!((json["means"][0]["ratio"].as_f64().expect("a number") - 3.0).abs() < 1e-12);
        assert_eq!(json["means"][0]["least"], 1.5);
    }
}
