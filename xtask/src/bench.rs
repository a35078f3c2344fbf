//! Benchmarks against peers, alternating in one run.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use anyhow::{Context, Result, bail};
use clap::Subcommand;
use xtask::command::{Profile, release_program, root, run_ours, succeeds};

use crate::povray::Times;
use crate::race::Race;
use crate::race::scaling::Scaling;
use crate::{PassedOn, field};

/// What can be measured.
#[derive(Subcommand)]
pub(crate) enum Bench {
    /// Rays a second, build speed and memory of the kernel, against Embree 4 if EMBREE_LIB names its shared library,
    /// and against the crates obvhs and bvh. All options are passed through: `kernel --help`.
    #[command(disable_help_flag = true)]
    Kernel(PassedOn),
    /// Time and peak memory of reading n, 2n and 4n of everything that a file can list: `growth --help`.
    #[command(disable_help_flag = true)]
    Growth(PassedOn),
    /// Error against time on scenes of all kinds, compared with Mitsuba 3, Cycles, LuxCore and pbrt-v4 where they are
    /// found: in Python environments that MITSUBA_PYTHON, BPY_PYTHON and LUXCORE_PYTHON name or that --install made,
    /// and on the PATH.
    Render(Race),
    /// The time of a path against the number of lights (to a million), of triangles (to ten million) and of instances
    /// (to a million), each in a scene of its own.
    Scaling(Scaling),
    /// The field of exact shapes, against POV-Ray where it is on the PATH.
    Field {
        /// A POV-Ray scene in place of the one that is written for it.
        #[arg(long)]
        pov: Option<PathBuf>,
        /// How often each program runs.
        #[arg(long, default_value_t = 3)]
        runs: usize,
        /// Threads of each program.
        #[arg(long, default_value_t = 2)]
        threads: usize,
    },
    /// Ten example scenes of POV-Ray, against povray where both are installed.
    Povray(Times),
}

impl Bench {
    /// Measures and prints a table.
    pub(crate) fn run(self) -> Result<()> {
        match self {
            Self::Kernel(passed) => run_ours("lumbre-bench", Profile::Release, &passed.arguments),
            Self::Growth(passed) => run_ours("lumbre-growth", Profile::Release, &passed.arguments),
            Self::Render(race) => race.run(),
            Self::Scaling(scaling) => scaling.run(),
            Self::Povray(times) => times.run(),
            Self::Field { pov, runs, threads } => run_field(pov.as_deref(), runs, threads),
        }
    }
}

/// Times whole commands: reading, building, rendering and writing all count.
fn run_field(pov: Option<&Path>, runs: usize, threads: usize) -> Result<()> {
    let program = release_program()?;
    let folder = root().join("target").join("bench");
    std::fs::create_dir_all(&folder)?;
    let threads_text = threads.to_string();
    let lumbre = |_: usize| {
        let mut command = Command::new(&program);
        command.arg("render").arg(root().join("scenes/field/field.pbrt"));
        command.arg("-o").arg(folder.join("lumbre.png"));
        // POV-Ray's adaptive sampling comes to 3.1 samples a pixel: the nearest whole number.
        command.args(["--spp", "3", "--threads", &threads_text, "--progress", "none", "-q"]);
        seconds(&mut command)
    };
    let ours = folder.join("field.pov");
    std::fs::write(&ours, field::pov_scene())?;
    let peer = succeeds("povray", &["--version"]).then_some(pov.unwrap_or(&ours));
    if peer.is_none() {
        println!("POV-Ray is left out: povray is not on the PATH");
    }
    let mut ratios = Vec::new();
    for turn in 0..runs {
        let ours = lumbre(turn)?;
        let Some(scene) = peer else {
            println!("run {turn}: Lumbre {ours:.2} s");
            continue;
        };
        let mut command = Command::new("povray");
        command.arg(format!("+I{}", scene.display()));
        command.arg(format!("+O{}", folder.join("povray.png").display()));
        command.args(["+W1280", "+H720", &format!("+WT{threads}"), "+A0.1", "+AM2", "+R3", "-D"]);
        let theirs = seconds(&mut command)?;
        ratios.push(theirs / ours);
        println!("run {turn}: Lumbre {ours:.2} s, POV-Ray {theirs:.2} s, ratio {:.2}", theirs / ours);
    }
    ratios.sort_by(f64::total_cmp);
    if let (Some(first), Some(last)) = (ratios.first(), ratios.last()) {
        println!("median ratio {:.2} ({first:.2} to {last:.2})", ratios[ratios.len() / 2]);
    }
    Ok(())
}

fn seconds(command: &mut Command) -> Result<f64> {
    let start = Instant::now();
    let out = command.output().with_context(|| format!("cannot start {:?}", command.get_program()))?;
    if !out.status.success() {
        bail!("{:?} failed: {}", command.get_program(), String::from_utf8_lossy(&out.stderr));
    }
    Ok(start.elapsed().as_secs_f64())
}
