//! `lumbre farm`: a render on many machines, by the scheduler that is there.

use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::Command;

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Args, Parser, Subcommand};
use lumbre::formats::image::{ImageFormat, is_own_image};
use lumbre::formats::{atomic_write, open_regular};
use lumbre::{CancelToken, Error};

use crate::failure::Failure;
use crate::output::{Inputs, Pictures};
use crate::reading::Frames;
use crate::signals::Signals;
use crate::units::{self, counted};

/// Distributes a render over many machines.
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

The picture is byte for byte that of one machine. A task that is killed and runs again continues from its checkpoint, with the same result.
The scripts also run under Kubernetes, whose JOB_COMPLETION_INDEX is then the number of the task.")]
struct SlurmArguments {
    /// The scene.
    #[arg(required = true, value_name = "SCENE")]
    scene: PathBuf,
    /// The picture; with --frames, a name with # for the frame number. By default NAME.exr for NAME.pbrt.
    #[arg(short, long, value_name = "OUT")]
    output: Option<PathBuf>,
    /// Samples per pixel. By default as many as the scene says.
    #[arg(long, value_name = "N", value_parser = units::whole(1..=u32::MAX))]
    spp: Option<u32>,
    /// Frames of an animation. Each task renders some frames instead of some samples.
    #[arg(long, value_name = "A..B")]
    frames: Option<Frames>,
    /// The number of tasks.
    #[arg(long, value_name = "N", value_parser = units::whole(1_u32..=100_000))]
    tasks: u32,
    /// Submit the jobs, by sbatch.
    #[arg(long)]
    submit: bool,
    /// An option for sbatch, such as --sbatch=--partition=render. May be repeated.
    #[arg(long, value_name = "OPTION", allow_hyphen_values = true)]
    sbatch: Vec<String>,
    /// The folder of scripts and parts. By default NAME.farm for NAME.pbrt.
    #[arg(long, value_name = "DIR")]
    folder: Option<PathBuf>,
    /// Options of lumbre render, after --. Those that the tasks set themselves (--samples, -o), and those that parts
    /// cannot have (--time, --noise, --denoise), are refused.
    #[arg(last = true, value_name = "RENDER OPTIONS")]
    render: Vec<String>,
}

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    match &arguments.scheduler {
        Scheduler::Slurm(arguments) => slurm(arguments),
    }
}

/// The options of lumbre render that a task has, read as its command will read them.
#[derive(Parser)]
#[command(no_binary_name = true)]
struct Task {
    #[command(flatten)]
    arguments: crate::render::Arguments,
}

/// The names that a job has, as words of a shell.
struct Names {
    scene: String,
    output: String,
    folder: String,
    here: String,
    program: String,
}

fn slurm(arguments: &SlurmArguments) -> Result<(), Failure> {
    let _signals = Signals::listen(&CancelToken::new())?;
    let stem = arguments.scene.file_stem().map_or("scene".into(), |stem| stem.to_string_lossy().into_owned());
    let default_output = || match arguments.frames {
        Some(_) => format!("{stem}.####.exr").into(),
        None => format!("{stem}.exr").into(),
    };
    let output: PathBuf = arguments.output.clone().unwrap_or_else(default_output);
    let is_writable = ImageFormat::from_path(&output).is_some_and(|format| format.is_writable());
    if !is_writable || (arguments.frames.is_some() && !output.to_string_lossy().contains('#')) {
        return Err(Failure::Usage(format!(
            "{}: expected the name of a picture ({}){}",
            output.display(),
            ImageFormat::WRITABLE,
            if arguments.frames.is_some() { " with # for the number of the frame" } else { "" }
        )));
    }
    Inputs::of([arguments.scene.as_path()]).refuse(&output)?;
    if arguments.output.is_none() {
        refuse_others(&output, arguments.frames.as_ref())?;
    }
    let folder: PathBuf = arguments.folder.clone().unwrap_or_else(|| format!("{stem}.farm").into());
    let here = std::env::current_dir().map_err(|e| Failure::Io(format!("the current folder: {e}")))?;
    let program = std::env::current_exe().map_err(|e| Failure::Io(format!("the program's own name: {e}")))?;
    let names = Names {
        scene: in_script(&arguments.scene)?,
        output: in_script(&output)?,
        folder: in_script(&folder)?,
        here: in_script(&here)?,
        program: in_script(&program)?,
    };
    let logs = in_pattern(&names.folder)?;
    for option in arguments.sbatch.iter().chain(&arguments.render) {
        in_script(Path::new(option))?;
    }
    let task = task(arguments, &names)?;
    let (render, merge) = match &arguments.frames {
        Some(Frames(frames)) => frame_scripts(arguments, &names, *frames.start(), *frames.end())?,
        None => sample_scripts(arguments, &names, &task)?,
    };
    let head = |name: &str| {
        let options: String = arguments.sbatch.iter().map(|option| format!("#SBATCH {option}\n")).collect();
        format!("{MARK}#SBATCH --job-name={name}-{}\n{options}", plain(&stem))
    };
    let start =
        format!("set -eu\ncd {}\nlumbre=${{LUMBRE:-{}}}\n", quoted(&names.here), quoted(&names.program));
    let last = arguments.tasks - 1;
    let render = format!(
        "{}#SBATCH --array=0-{last}\n#SBATCH --requeue\n#SBATCH --output={}\n{start}{TASK}{render}",
        head("lumbre"),
        quoted(&format!("{logs}/%a.log"))
    );
    let merge =
        format!("{}#SBATCH --output={}\n{start}{merge}", head("merge"), quoted(&format!("{logs}/merge.log")));
    let submit = format!(
        "{MARK}set -eu\ncd {}\njob=$(sbatch --parsable {})\nsbatch --parsable --dependency=afterok:\"${{job%%;*}}\" {}\n",
        quoted(&names.here),
        quoted(&format!("{}/render.sh", names.folder)),
        quoted(&format!("{}/merge.sh", names.folder))
    );
    let submit_path = folder.join("submit.sh");
    let scripts =
        [(folder.join("render.sh"), render), (folder.join("merge.sh"), merge), (submit_path.clone(), submit)];
    for (path, _) in &scripts {
        refuse_foreign(path)?;
    }
    fs::create_dir_all(&folder).map_err(|e| Failure::Io(format!("{}: {e}", folder.display())))?;
    for (path, text) in &scripts {
        atomic_write(path, |file| file.write_all(text.as_bytes()))
            .map_err(|e| Failure::from(Error::from(e)))?;
        make_executable(path)?;
    }
    let tasks = counted(u64::from(arguments.tasks), "task");
    if !arguments.submit {
        say!("{}: {tasks}; run this script, or give --submit", submit_path.display());
        return Ok(());
    }
    // A name that begins with a dash is none of an option.
    let submitted = Command::new("sh").arg(format!("{}/submit.sh", names.folder)).status();
    match submitted {
        Ok(status) if status.success() => {
            say!("{tasks} submitted; {} is written when all are done", output.display());
            Ok(())
        }
        Ok(status) => Err(Failure::Io(format!("{}: sbatch failed ({status})", submit_path.display()))),
        Err(e) => Err(Failure::Io(format!("{}: {e}", submit_path.display()))),
    }
}

/// How every script begins, by which it is known again.
const MARK: &str = "#!/bin/sh\n# Written by lumbre farm slurm, which replaces it.\n";

/// Refuses to replace a script that is none of ours.
fn refuse_foreign(path: &Path) -> Result<(), Failure> {
    if fs::symlink_metadata(path).is_err() {
        return Ok(());
    }
    let mut start = Vec::new();
    let read = open_regular(path).map(|(file, _)| file.take(MARK.len() as u64).read_to_end(&mut start));
    if read.is_ok() && start == MARK.as_bytes() {
        return Ok(());
    }
    Err(Failure::Usage(format!(
        "{}: not written by lumbre farm, and not replaced (expected another --folder)",
        path.display()
    )))
}

/// Refuses a default name that is the one of a file which is not known to be Lumbre's.
fn refuse_others(output: &Path, frames: Option<&Frames>) -> Result<(), Failure> {
    let pictures = frames.map_or(Pictures::One, |Frames(numbers)| Pictures::Frames(numbers.clone()));
    match pictures.names(output).find(|name| name.exists() && !is_own_image(name)) {
        Some(name) => Err(Failure::Usage(format!(
            "{} exists and was not written by Lumbre (expected -o with another name)",
            name.display()
        ))),
        None => Ok(()),
    }
}

/// A folder as Slurm reads it in the pattern of a log's name, where % begins the number of a job, and %% is %. Behind a
/// backslash it replaces nothing, so that all tasks would have one log.
///
/// # Errors
/// [`Failure::Usage`] for a name with a backslash.
fn in_pattern(folder: &str) -> Result<String, Failure> {
    if folder.contains('\\') {
        let why =
            "Slurm cannot write logs into a folder of this name (expected --folder without backslashes)";
        return Err(Failure::Usage(format!("{folder}: {why}")));
    }
    Ok(folder.replace('%', "%%"))
}

/// A name as a script has it: no option, and all on one line.
///
/// # Errors
/// [`Failure::Usage`] for a name that no script can hold.
fn in_script(path: &Path) -> Result<String, Failure> {
    let name = path.to_str().filter(|name| !name.chars().any(char::is_control));
    match name {
        None => Err(Failure::Usage(format!(
            "{}: a job script cannot hold this name (expected UTF-8 without line feeds and other control characters)",
            path.display()
        ))),
        Some("-") => Err(Failure::Usage("-: every task reads the scene (expected a file)".to_owned())),
        Some(name) if name.starts_with('-') => Ok(format!("./{name}")),
        Some(name) => Ok(name.to_owned()),
    }
}

/// The options of a task, as lumbre render will take them; what it would refuse is refused now, and not on the cluster.
fn task(arguments: &SlurmArguments, names: &Names) -> Result<crate::render::Arguments, Failure> {
    let own: &[&str] = match arguments.frames {
        Some(_) => &["--frames", "0..1", "-o", &names.output, "--resume", "--progress", "plain"],
        None => &[
            "--samples",
            "0..1",
            "-o",
            "task.part",
            "--checkpoint",
            "task.checkpoint",
            "--resume",
            "--progress",
            "plain",
        ],
    };
    let spp =
        arguments.spp.filter(|_| arguments.frames.is_some()).map(|spp| ["--spp".to_owned(), spp.to_string()]);
    let words = std::iter::once(names.scene.clone()).chain(own.iter().map(|&word| word.to_owned()));
    let words = words.chain(spp.into_iter().flatten()).chain(arguments.render.iter().cloned());
    let wrong = |why: &str| {
        let own = if arguments.frames.is_some() {
            "--frames, -o, --resume and --progress"
        } else {
            "--samples, -o, --checkpoint, --resume and --progress"
        };
        Failure::Usage(format!(
            "after --: {why} (expected options of lumbre render other than {own}, which the tasks set themselves)"
        ))
    };
    let task = Task::try_parse_from(words).map_err(|error| {
        if let Some(option) = conflicting(&error) {
            return Failure::Usage(format!("after --: {option} cannot be used in a farm render"));
        }
        let said = error.to_string();
        let first = said.lines().next().unwrap_or_default();
        wrong(first.strip_prefix("error: ").unwrap_or("not an option of lumbre render"))
    })?;
    let task = task.arguments;
    task.check_task().map_err(|why| wrong(&why.to_string()))?;
    match (arguments.spp, task.spp()) {
        (Some(a), Some(b)) if a != b => Err(wrong(&format!("--spp {b} and --spp {a} before it"))),
        _ => Ok(task),
    }
}

/// The option that conflicts with one that the tasks set themselves.
fn conflicting(error: &clap::Error) -> Option<String> {
    const OWN: [&str; 4] = ["--samples", "--frames", "--checkpoint", "--resume"];
    if error.kind() != ErrorKind::ArgumentConflict {
        return None;
    }
    let named = [ContextKind::InvalidArg, ContextKind::PriorArg].into_iter().filter_map(|kind| {
        match error.get(kind) {
            Some(ContextValue::String(name)) => Some(name.clone()),
            Some(ContextValue::Strings(names)) => names.first().cloned(),
            _ => None,
        }
    });
    // As `--noise <R>`.
    let mut options = named.map(|name| name.split(' ').next().unwrap_or_default().to_owned());
    options.find(|name| !OWN.contains(&&**name))
}

/// The number of a task.
const TASK: &str =
    "task=${SLURM_ARRAY_TASK_ID:-${JOB_COMPLETION_INDEX:?\"this script is a task of a job array\"}}\n";

/// Tasks that take some samples each.
fn sample_scripts(
    arguments: &SlurmArguments,
    names: &Names,
    task: &crate::render::Arguments,
) -> Result<(String, String), Failure> {
    let spp = match arguments.spp.or(task.spp()) {
        Some(spp) => spp,
        None => task.open_scene()?.options().stop.spp,
    };
    let tasks = arguments.tasks;
    if tasks > spp {
        return Err(Failure::Usage(format!(
            "--tasks {tasks} is more than the {} per pixel (expected {spp} or fewer)",
            counted(u64::from(spp), "sample")
        )));
    }
    let base = quoted(&format!("{}/task.", names.folder));
    let render = format!(
        "first=$((task * {spp} / {tasks}))\nlast=$(((task + 1) * {spp} / {tasks}))\n\
         exec \"$lumbre\" render {} --samples \"$first..$last\" -o {base}\"$task.part\" \
         --checkpoint {base}\"$task.checkpoint\" --resume --progress plain{}\n",
        quoted(&names.scene),
        options(arguments)
    );
    let parts = format!(
        "set --\ntask=0\nwhile [ \"$task\" -lt {tasks} ]; do\n  set -- \"$@\" {base}\"$task.part\"\n  task=$((task + 1))\ndone\n"
    );
    let background = match task.background_file() {
        Some(path) => format!(" --background {}", quoted(&in_script(path)?)),
        None => String::new(),
    };
    let merge = format!("{parts}exec \"$lumbre\" merge \"$@\" -o {}{background}\n", quoted(&names.output));
    Ok((render, merge))
}

/// Tasks that render some frames each.
fn frame_scripts(
    arguments: &SlurmArguments,
    names: &Names,
    first: u32,
    last: u32,
) -> Result<(String, String), Failure> {
    let (count, tasks) = (last - first + 1, arguments.tasks);
    if tasks > count {
        return Err(Failure::Usage(format!(
            "--tasks {tasks} is more than the {} (expected {count} or fewer)",
            counted(u64::from(count), "frame")
        )));
    }
    let spp = arguments.spp.map_or_else(String::new, |spp| format!(" --spp {spp}"));
    let out = quoted(&names.output);
    let render = format!(
        "first=$(({first} + task * {count} / {tasks}))\nlast=$(({first} + (task + 1) * {count} / {tasks} - 1))\n\
         exec \"$lumbre\" render {} --frames \"$first..$last\" -o {out}{spp} --resume --progress plain{}\n",
        quoted(&names.scene),
        options(arguments)
    );
    let merge = format!("echo {}\n", quoted(&format!("frames {first} to {last} are done: {}", names.output)));
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
