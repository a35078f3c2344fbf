//! `lumbre farm`: a render on many machines, by the scheduler that is there.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use clap::{Args, Subcommand};
use lumbre::formats::atomic_write;
use lumbre::formats::image::ImageFormat;
use lumbre::{CancelToken, Error};

use crate::failure::Failure;
use crate::output::Inputs;
use crate::reading::{Frames, ReadingArguments};
use crate::signals::Signals;
use crate::units::counted;

/// Shares out a render among machines.
#[derive(Args)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    scheduler: Scheduler,
}

#[derive(Subcommand)]
enum Scheduler {
    Slurm(SlurmArguments),
}

/// Writes the scripts of a Slurm job array whose tasks render parts, and of a job that merges them when all are done.
#[derive(Args)]
#[command(after_help = "Examples:
  lumbre farm slurm scene.pbrt --tasks 16                   writes scene.farm/render.sh, merge.sh and submit.sh
  lumbre farm slurm scene.pbrt --tasks 16 --submit          and submits them
  lumbre farm slurm scene.pbrt --spp 4096 --tasks 64 -o big.exr -- --size 3840x2160 --max-depth 12
  lumbre farm slurm dancer.glb --frames 0..239 --tasks 24 -o frame.####.png
  lumbre farm slurm scene.pbrt --tasks 16 --sbatch=--partition=render --sbatch=--cpus-per-task=32

The picture is byte for byte that of one machine. A task that is killed and runs again goes on from its checkpoint, and changes nothing. The
scripts take their number from Kubernetes' JOB_COMPLETION_INDEX as well.")]
struct SlurmArguments {
    /// The scene.
    #[arg(required = true, value_name = "SCENE")]
    scene: PathBuf,
    /// The picture; with --frames, the pattern of the names of pictures. By default SCENE's stem with .exr.
    #[arg(short, long, value_name = "OUT")]
    output: Option<PathBuf>,
    /// Samples per pixel; by default as many as the scene says.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    spp: Option<u32>,
    /// Frames of an animation, which are shared out instead of samples.
    #[arg(long, value_name = "A..B")]
    frames: Option<Frames>,
    /// How many tasks.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    tasks: u32,
    /// Submit the jobs, by sbatch.
    #[arg(long)]
    submit: bool,
    /// An option for sbatch, as --sbatch=--partition=render; as often as needed.
    #[arg(long, value_name = "OPTION", allow_hyphen_values = true)]
    sbatch: Vec<String>,
    /// The folder of scripts and parts; by default SCENE's stem with .farm.
    #[arg(long, value_name = "DIR")]
    folder: Option<PathBuf>,
    /// Options of lumbre render, after --.
    #[arg(last = true, value_name = "RENDER OPTIONS")]
    render: Vec<String>,
}

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    match &arguments.scheduler {
        Scheduler::Slurm(arguments) => slurm(arguments),
    }
}

fn slurm(arguments: &SlurmArguments) -> Result<(), Failure> {
    let _signals = Signals::listen(&CancelToken::new())?;
    let stem = arguments.scene.file_stem().map_or("scene".into(), |stem| stem.to_string_lossy().into_owned());
    let output = arguments.output.clone().unwrap_or_else(|| match arguments.frames {
        Some(_) => format!("{stem}.####.exr").into(),
        None => format!("{stem}.exr").into(),
    });
    let is_writable = ImageFormat::from_path(&output).is_some_and(|format| format.is_writable());
    if !is_writable || (arguments.frames.is_some() && !output.to_string_lossy().contains('#')) {
        return Err(Failure::Usage(format!(
            "{}: expected the name of a picture (.exr, .png, .hdr, .pfm or .jpg){}",
            output.display(),
            if arguments.frames.is_some() { " with # for the number of the frame" } else { "" }
        )));
    }
    Inputs::of([arguments.scene.as_path()]).refuse(&output)?;
    let folder = arguments.folder.clone().unwrap_or_else(|| format!("{stem}.farm").into());
    let (render, merge) = match &arguments.frames {
        Some(Frames(frames)) => frame_scripts(arguments, &output, *frames.start(), *frames.end())?,
        None => sample_scripts(arguments, &output, &folder)?,
    };
    let head = |name: &str| {
        let options: String = arguments.sbatch.iter().map(|option| format!("#SBATCH {option}\n")).collect();
        format!("#!/bin/sh\n#SBATCH --job-name={name}-{}\n{options}", plain(&stem))
    };
    let logs = quoted(&folder.join("%a.log").display().to_string());
    let here = std::env::current_dir().map_err(|e| Failure::Io(format!("the current folder: {e}")))?;
    let program = std::env::current_exe().map_err(|e| Failure::Io(format!("the program's own name: {e}")))?;
    let start = format!(
        "set -eu\ncd {}\nlumbre=${{LUMBRE:-{}}}\n",
        quoted(&here.display().to_string()),
        quoted(&program.display().to_string())
    );
    let last = arguments.tasks - 1;
    let render = format!(
        "{}#SBATCH --array=0-{last}\n#SBATCH --requeue\n#SBATCH --output={logs}\n{start}{TASK}{render}",
        head("lumbre")
    );
    let merge = format!(
        "{}#SBATCH --output={}\n{start}{merge}",
        head("merge"),
        quoted(&folder.join("merge.log").display().to_string())
    );
    let (render_path, merge_path) = (folder.join("render.sh"), folder.join("merge.sh"));
    let submit = format!(
        "#!/bin/sh\nset -eu\ncd {}\njob=$(sbatch --parsable {})\nsbatch --parsable --dependency=afterok:\"${{job%%;*}}\" {}\n",
        quoted(&here.display().to_string()),
        quoted(&render_path.display().to_string()),
        quoted(&merge_path.display().to_string())
    );
    fs::create_dir_all(&folder).map_err(|e| Failure::Io(format!("{}: {e}", folder.display())))?;
    let submit_path = folder.join("submit.sh");
    for (path, text) in [(&render_path, &render), (&merge_path, &merge), (&submit_path, &submit)] {
        atomic_write(path, |file| file.write_all(text.as_bytes()))
            .map_err(|e| Failure::from(Error::from(e)))?;
        make_executable(path)?;
    }
    let tasks = counted(u64::from(arguments.tasks), "task");
    if !arguments.submit {
        say!("{}: {tasks}; run it, or give --submit", submit_path.display());
        return Ok(());
    }
    let submitted = Command::new("sh").arg(&submit_path).status();
    match submitted {
        Ok(status) if status.success() => {
            say!("{tasks} submitted; {} comes when all are done", output.display());
            Ok(())
        }
        Ok(status) => Err(Failure::Io(format!("{}: sbatch failed ({status})", submit_path.display()))),
        Err(e) => Err(Failure::Io(format!("{}: {e}", submit_path.display()))),
    }
}

/// The number of a task.
const TASK: &str =
    "task=${SLURM_ARRAY_TASK_ID:-${JOB_COMPLETION_INDEX:?\"this script is a task of a job array\"}}\n";

/// Tasks that take some samples each.
fn sample_scripts(
    arguments: &SlurmArguments,
    output: &Path,
    folder: &Path,
) -> Result<(String, String), Failure> {
    let spp = match arguments.spp {
        Some(spp) => spp,
        None => {
            let (scene, _) = ReadingArguments::default().open(std::slice::from_ref(&arguments.scene))?;
            scene.options().stop.spp
        }
    };
    let tasks = arguments.tasks;
    if tasks > spp {
        return Err(Failure::Usage(format!(
            "--tasks: each takes a sample of every pixel at least (found {tasks} for {}; expected {spp} or fewer)",
            counted(u64::from(spp), "sample")
        )));
    }
    let base = quoted(&folder.join("task.").display().to_string());
    let render = format!(
        "first=$((task * {spp} / {tasks}))\nlast=$(((task + 1) * {spp} / {tasks}))\n\
         exec \"$lumbre\" render {} --samples \"$first..$last\" -o {base}\"$task.part\" \
         --checkpoint {base}\"$task.checkpoint\" --resume --progress plain{}\n",
        quoted(&arguments.scene.display().to_string()),
        options(arguments)
    );
    let parts = format!(
        "set --\ntask=0\nwhile [ \"$task\" -lt {tasks} ]; do\n  set -- \"$@\" {base}\"$task.part\"\n  task=$((task + 1))\ndone\n"
    );
    let merge =
        format!("{parts}exec \"$lumbre\" merge \"$@\" -o {}\n", quoted(&output.display().to_string()));
    Ok((render, merge))
}

/// Tasks that render some frames each.
fn frame_scripts(
    arguments: &SlurmArguments,
    output: &Path,
    first: u32,
    last: u32,
) -> Result<(String, String), Failure> {
    let (count, tasks) = (last - first + 1, arguments.tasks);
    if tasks > count {
        return Err(Failure::Usage(format!(
            "--tasks: each renders a frame at least (found {tasks} for {}; expected {count} or fewer)",
            counted(u64::from(count), "frame")
        )));
    }
    let spp = arguments.spp.map_or_else(String::new, |spp| format!(" --spp {spp}"));
    let out = quoted(&output.display().to_string());
    let render = format!(
        "first=$(({first} + task * {count} / {tasks}))\nlast=$(({first} + (task + 1) * {count} / {tasks} - 1))\n\
         exec \"$lumbre\" render {} --frames \"$first..$last\" -o {out}{spp} --progress plain{}\n",
        quoted(&arguments.scene.display().to_string()),
        options(arguments)
    );
    let merge =
        format!("echo {}\n", quoted(&format!("frames {first} to {last} are done: {}", output.display())));
    Ok((render, merge))
}

fn options(arguments: &SlurmArguments) -> String {
    arguments.render.iter().map(|option| format!(" {}", quoted(option))).collect()
}

/// A word for a shell, as it is.
fn quoted(word: &str) -> String {
    format!("'{}'", word.replace('\'', r"'\''"))
}

/// A name of letters, digits and little else.
fn plain(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() || c == '.' || c == '-' { c } else { '_' }).collect()
}

fn make_executable(path: &Path) -> Result<(), Failure> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        let set = fs::metadata(path).and_then(|meta| {
            let mut permissions = meta.permissions();
            permissions.set_mode(permissions.mode() | 0o111);
            fs::set_permissions(path, permissions)
        });
        set.map_err(|e| Failure::Io(format!("{}: {e}", path.display())))?;
    }
    #[cfg(not(unix))]
    let _ = path;
    Ok(())
}
