//! How time and memory grow with the input: `cargo xtask bench growth`.
//!
//! Every list that a file can hold is written with n, 2n and 4n items. Each file is read and built in a process of its
//! own, so that its peak of memory is its own.

mod inputs;

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use anyhow::{Context, Result, bail};
use clap::Parser;
use inputs::INPUTS;

#[derive(Parser)]
#[command(
    bin_name = "cargo xtask bench growth",
    about = "Time and peak memory of reading n, 2n and 4n of everything"
)]
struct Arguments {
    /// Only inputs whose name contains one of these.
    names: Vec<String>,
    /// The least number of items.
    #[arg(long, default_value_t = 10_000)]
    count: usize,
    /// Reads this file and prints seconds and the peak of memory: what the others are measured by.
    #[arg(long, hide = true)]
    measure: Option<PathBuf>,
}

fn main() -> Result<()> {
    let arguments = Arguments::parse();
    if let Some(path) = &arguments.measure {
        return measure(path);
    }
    let folder = std::env::temp_dir().join(format!("lumbre-growth-{}", std::process::id()));
    println!("{:28} {:>9} {:>24} {:>24}  over", "input", "MiB at 4n", "s at n, 2n, 4n", "MiB at n, 2n, 4n");
    let mut chosen = INPUTS.iter().filter(|(name, _)| {
        arguments.names.is_empty() || arguments.names.iter().any(|wanted| name.contains(&**wanted))
    });
    let outcome = chosen.try_for_each(|(name, write)| row(name, *write, arguments.count, &folder));
    // What is left there is in nobody's way.
    let _ = std::fs::remove_dir_all(&folder);
    outcome
}

/// Measures one input, and says where it grows faster than it should: time by more than the fifth of a second and six
/// times from n to 4n, memory beyond 64 MiB and 32 times the input.
fn row(name: &str, write: inputs::Write, count: usize, folder: &Path) -> Result<()> {
    let (mut seconds, mut peaks, mut size) = ([0.0; 3], [0; 3], 0);
    let mut refused = "";
    for (i, count) in [count, 2 * count, 4 * count].into_iter().enumerate() {
        std::fs::create_dir_all(folder)?;
        let files = write(count);
        size = files.iter().map(|(_, bytes)| bytes.len() as u64).sum();
        for (file, bytes) in &files {
            std::fs::write(folder.join(file), bytes).with_context(|| format!("cannot write {file}"))?;
        }
        let first = folder.join(&files[0].0);
        drop(files);
        let output = Command::new(std::env::current_exe()?).arg("--measure").arg(first).output()?;
        let text = String::from_utf8_lossy(&output.stdout);
        let Some((s, peak)) = text.trim().split_once(' ') else {
            bail!("{name}: {}", String::from_utf8_lossy(&output.stderr));
        };
        (seconds[i], peaks[i]) = (s.parse()?, peak.split(' ').next().unwrap_or("").parse::<u64>()?);
        if text.contains("refused") {
            refused = " refused";
        }
        std::fs::remove_dir_all(folder)?;
    }
    let is_slow = seconds[2] > 0.2 && seconds[2] > 6.0 * seconds[0];
    let is_large = peaks[2] > (64 << 20) + 32 * size;
    let mebibytes = |bytes: u64| bytes as f64 / f64::from(1 << 20);
    println!(
        "{name:28} {:9.2} {:>24} {:>24}  {}{}{refused}",
        mebibytes(size),
        seconds.map(|s| format!("{s:.3}")).join(" "),
        peaks.map(|peak| format!("{:.0}", mebibytes(peak))).join(" "),
        if is_slow { "TIME " } else { "" },
        if is_large { "MEMORY" } else { "" },
    );
    Ok(())
}

/// Reads and builds a scene, and prints the seconds, the peak of memory in bytes, and whether it was refused.
fn measure(path: &Path) -> Result<()> {
    let start = Instant::now();
    let read = lumbre::open(path);
    let seconds = start.elapsed().as_secs_f64();
    let status = std::fs::read_to_string("/proc/self/status")
        .context("the system does not tell the peak of memory")?;
    let peak = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix(" kB")?.parse::<u64>().ok());
    let peak = peak.context("the system does not tell the peak of memory")?;
    let refused = match &read {
        Ok(_) => String::new(),
        Err(error) => format!(" refused: {error}"),
    };
    println!("{seconds} {}{refused}", peak * 1024);
    Ok(())
}

#[cfg(test)]
mod tests {
    use peak_alloc::PeakAlloc;

    use super::*;

    #[global_allocator]
    static ALLOCATED: PeakAlloc = PeakAlloc;

    /// What is kept and charged, and what is taken at most while it is built and predicted, in bytes; `None` for what
    /// is refused.
    fn bytes_of(write: inputs::Write, count: usize, folder: &Path) -> Option<[[i64; 2]; 2]> {
        let files = write(count);
        for (file, bytes) in &files {
            std::fs::write(folder.join(file), bytes).unwrap();
        }
        let first = folder.join(&files[0].0);
        drop(files);
        let before = ALLOCATED.current_usage() as i64;
        let (desc, diagnostics) = lumbre::describe(&[&first], &lumbre::ReadOptions::default()).ok()?;
        let kept = ALLOCATED.current_usage() as i64 - before;
        let charged = diagnostics.memory_held() as i64;
        let predicted = lumbre::predicted_build_bytes(&desc) as i64;
        ALLOCATED.reset_peak_usage();
        let built = lumbre::Scene::from_description(desc);
        let taken = ALLOCATED.peak_usage() as i64 - before;
        drop(built);
        Some([[kept, charged], [taken, charged + predicted]])
    }

    #[test]
    fn what_is_read_is_charged_and_what_is_built_was_predicted() {
        // Of tables, which double, and of threads.
        const LEEWAY: i64 = 128 << 10;
        let folder = std::env::temp_dir().join(format!("lumbre-growth-test-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let mut wrong = vec![];
        for (name, write) in INPUTS {
            let few = bytes_of(*write, 1000, &folder);
            let Some((few, many)) = few.zip(bytes_of(*write, 3000, &folder)) else { continue };
            for (what, [few, many]) in ["kept", "taken"].iter().zip([[few[0], many[0]], [few[1], many[1]]]) {
                let [real, expected] = [0, 1].map(|i| many[i] - few[i]);
                if real > expected + LEEWAY {
                    wrong.push(format!("{name}: {real} bytes more {what}, {expected} expected"));
                }
            }
        }
        std::fs::remove_dir_all(&folder).unwrap();
        assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    }
}
