//! The programs of the race: how they are found and started, and how they render.

use std::ffi::OsString;
use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::Instant;

use anyhow::{Context, Result, bail, ensure};
use serde_json::{Value, json};
use xtask::command::{root, succeeds};

use super::scene::{Material, Scene};

/// Who can take part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Kind {
    /// Lumbre itself.
    Lumbre,
    /// Mitsuba 3, compiled for the scene by LLVM.
    MitsubaLlvm,
    /// Mitsuba 3, one ray at a time.
    MitsubaScalar,
    /// Blender's Cycles.
    Cycles,
    /// LuxCore.
    Luxcore,
    /// pbrt-v4.
    Pbrt,
}

impl Kind {
    pub(crate) const ALL: [Self; 6] =
        [Self::Lumbre, Self::MitsubaLlvm, Self::MitsubaScalar, Self::Cycles, Self::Luxcore, Self::Pbrt];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Lumbre => "Lumbre",
            Self::MitsubaLlvm => "Mitsuba llvm",
            Self::MitsubaScalar => "Mitsuba scalar",
            Self::Cycles => "Cycles",
            Self::Luxcore => "LuxCore",
            Self::Pbrt => "pbrt-v4",
        }
    }

    /// The ways in which it is asked to render a scene, by sampler or by integrator: the best of them counts.
    pub(crate) fn ways(self, scene: &Scene) -> &'static [&'static str] {
        match self {
            Self::MitsubaLlvm | Self::MitsubaScalar => &["independent", "orthogonal"],
            Self::Lumbre if scene.has_caustics => &["caustics", "path"],
            Self::Luxcore if scene.has_caustics => &["bidirectional", "photons", "path"],
            _ => &[""],
        }
    }

    /// Whether its picture of a scene tends to the one that Lumbre's tends to: all of its materials are the same
    /// functions.
    pub(crate) fn agrees(self, scene: &Scene) -> bool {
        let same = |material: &Material| match self {
            Self::Lumbre => true,
            Self::MitsubaLlvm | Self::MitsubaScalar | Self::Cycles => {
                !matches!(material, Material::Coated { .. } | Material::Principled { .. })
            }
            Self::Luxcore => matches!(material, Material::Diffuse { .. } | Material::Glass { .. }),
            // It renders by wavelengths.
            Self::Pbrt => false,
        };
        scene.materials.iter().all(same)
    }

    /// Whether it can show a scene at all.
    pub(crate) fn shows(self, scene: &Scene) -> bool {
        let is_principled = |material: &Material| matches!(material, Material::Principled { .. });
        match self {
            Self::Lumbre | Self::MitsubaLlvm | Self::MitsubaScalar => true,
            // Media and hair are written for those alone, and for pbrt-v4.
            Self::Cycles | Self::Luxcore if scene.volume.is_some() || scene.hair.is_some() => false,
            // What glTF describes is written for those alone.
            _ if scene.materials.iter().any(is_principled) => false,
            // pbrt-v4 maps skies to a square, and LuxCore turns them in a way that the race does not know yet.
            Self::Pbrt | Self::Luxcore => scene.sky.is_none(),
            Self::Cycles => true,
        }
    }

    fn script(self) -> Option<Script> {
        match self {
            Self::MitsubaLlvm => {
                Some(Script { file: "render_mitsuba.py", variant: "llvm_ad_rgb", ..MITSUBA })
            }
            Self::MitsubaScalar => Some(MITSUBA),
            Self::Cycles => Some(Script {
                file: "render_cycles.py",
                module: "bpy",
                variable: "BPY_PYTHON",
                package: "bpy==5.0.1",
                variant: "",
            }),
            Self::Luxcore => Some(Script {
                file: "render_luxcore.py",
                module: "pyluxcore",
                variable: "LUXCORE_PYTHON",
                package: "pyluxcore",
                variant: "",
            }),
            Self::Lumbre | Self::Pbrt => None,
        }
    }
}

/// A program that is driven from Python.
struct Script {
    file: &'static str,
    module: &'static str,
    /// The environment variable that may name an interpreter that has the module.
    variable: &'static str,
    /// What pip calls it.
    package: &'static str,
    variant: &'static str,
}

const MITSUBA: Script = Script {
    file: "render_mitsuba.py",
    module: "mitsuba",
    variable: "MITSUBA_PYTHON",
    package: "mitsuba",
    variant: "scalar_rgb",
};

const FILES: [(&str, &str); 4] = [
    ("worker.py", include_str!("worker.py")),
    ("render_mitsuba.py", include_str!("render_mitsuba.py")),
    ("render_cycles.py", include_str!("render_cycles.py")),
    ("render_luxcore.py", include_str!("render_luxcore.py")),
];

/// Where everything of the race lies that is made by it.
pub(crate) fn folder() -> PathBuf {
    root().join("target").join("bench")
}

fn own_python() -> PathBuf {
    let inside = if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" };
    folder().join("peers").join(inside)
}

/// Installs the peers that come as Python packages into an environment of the race's own. What cannot be installed is
/// said.
pub(crate) fn install() -> Result<()> {
    let place = folder().join("peers");
    // Blender comes for one version of Python only.
    let python = ["python3.11", "python3", "python"].into_iter().find(|name| succeeds(name, &["--version"]));
    let python = python.context("Python is needed to install peers")?;
    xtask::command::run(python, &["-m", "venv", &place.to_string_lossy()])?;
    let pip = own_python().to_string_lossy().into_owned();
    for package in [Kind::MitsubaLlvm, Kind::Luxcore, Kind::Cycles].into_iter().filter_map(Kind::script) {
        if let Err(error) = xtask::command::run(&pip, &["-m", "pip", "install", package.package]) {
            println!("{} is not installed: {error}", package.package);
        }
    }
    Ok(())
}

/// A program that was found.
#[derive(Clone, Debug)]
pub(crate) enum Found {
    Lumbre(PathBuf),
    Pbrt,
    Python(PathBuf),
}

/// Looks for a program; the error says what is missing.
pub(crate) fn find(kind: Kind, lumbre: &Path) -> Result<Found> {
    let Some(script) = kind.script() else {
        return match kind {
            Kind::Pbrt if Command::new("pbrt").arg("--help").output().is_err() => {
                bail!("pbrt is not on the PATH")
            }
            Kind::Pbrt => Ok(Found::Pbrt),
            _ => Ok(Found::Lumbre(lumbre.to_owned())),
        };
    };
    let python = std::env::var_os(script.variable).map_or_else(own_python, PathBuf::from);
    let question = format!(
        "import importlib.util, sys; sys.exit(importlib.util.find_spec('{}') is None)",
        script.module
    );
    ensure!(
        succeeds(&python.to_string_lossy(), &["-c", &question]),
        "no Python with {} is named by {}, nor was one installed by --install",
        script.module,
        script.variable
    );
    Ok(Found::Python(python))
}

/// A program with a scene.
#[derive(Debug)]
pub(crate) struct Program {
    pub(crate) kind: Kind,
    pub(crate) version: String,
    threads: usize,
    folder: PathBuf,
    how: How,
}

#[derive(Debug)]
enum How {
    Lumbre(PathBuf),
    /// With the seconds of a picture with one sample a pixel.
    Pbrt(f64),
    Worker(Worker),
}

/// A script that has the scene and waits for requests.
#[derive(Debug)]
struct Worker {
    process: Child,
    requests: ChildStdin,
    answers: BufReader<ChildStdout>,
    log: PathBuf,
}

/// What a render has cost.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cost {
    /// Samples a pixel, which may be more than were asked for.
    pub(crate) spp: u32,
    /// Seconds of rendering alone.
    pub(crate) seconds: f64,
}

impl Program {
    /// Starts a program on the scene that lies in a folder.
    pub(crate) fn start(kind: Kind, found: &Found, folder: &Path, threads: usize) -> Result<Self> {
        let (how, version) = match found {
            Found::Lumbre(program) => {
                let said = Command::new(program).arg("--version").output().context("cannot start Lumbre")?;
                let version = String::from_utf8_lossy(&said.stdout).trim().replacen("lumbre", "Lumbre", 1);
                (How::Lumbre(program.clone()), version)
            }
            Found::Pbrt => (How::Pbrt(0.0), "pbrt-v4".to_owned()),
            Found::Python(python) => {
                let script = kind.script().context("a program in Python has a script")?;
                let (worker, version) = Worker::start(python, &script, folder, threads)?;
                (How::Worker(worker), version)
            }
        };
        let mut program = Self { kind, version, threads, folder: folder.to_owned(), how };
        if matches!(program.how, How::Pbrt(_)) {
            let out = folder.join("start.pfm");
            let start = program.render(1, 1, "", &out)?.seconds;
            program.how = How::Pbrt(start);
        }
        Ok(program)
    }

    /// Renders the picture to a .pfm.
    pub(crate) fn render(&mut self, spp: u32, seed: u32, way: &str, out: &Path) -> Result<Cost> {
        match &mut self.how {
            How::Lumbre(program) => {
                let stats = self.folder.join("stats.json");
                let mut command = Command::new(&*program);
                command
                    .arg("render")
                    .arg(self.folder.join("scene.pbrt"))
                    .arg("-o")
                    .arg(out)
                    .arg("--stats")
                    .arg(&stats);
                command.args([
                    "--spp",
                    &spp.to_string(),
                    "--seed",
                    &seed.to_string(),
                    "--progress",
                    "none",
                    "-q",
                ]);
                if !way.is_empty() {
                    command.args(["--integrator", way]);
                }
                run(command.args(["--strict", "--threads", &self.threads.to_string()]))?;
                let stats: Value = serde_json::from_slice(&fs::read(stats)?)?;
                let seconds =
                    stats["seconds"]["render"].as_f64().context("the statistics lack the seconds")?;
                Ok(Cost { spp, seconds })
            }
            How::Pbrt(one) => {
                let mut command = Command::new("pbrt");
                command.args([
                    "--spp",
                    &spp.to_string(),
                    "--seed",
                    &seed.to_string(),
                    "--quiet",
                    "--outfile",
                ]);
                command
                    .arg(out)
                    .args(["--nthreads", &self.threads.to_string()])
                    .arg(self.folder.join("scene.pbrt"));
                let start = Instant::now();
                run(&mut command)?;
                let whole = start.elapsed().as_secs_f64();
                let share = f64::from(spp) / f64::from(spp.max(2) - 1);
                Ok(Cost { spp, seconds: if *one > 0.0 { (whole - *one).max(0.0) * share } else { whole } })
            }
            How::Worker(worker) => worker.render(spp, seed, way, out),
        }
    }
}

fn run(command: &mut Command) -> Result<()> {
    let out = command.output().with_context(|| format!("cannot start {:?}", command.get_program()))?;
    if !out.status.success() {
        bail!("{:?} failed: {}", command.get_program(), String::from_utf8_lossy(&out.stderr));
    }
    Ok(())
}

impl Worker {
    fn start(python: &Path, script: &Script, folder: &Path, threads: usize) -> Result<(Self, String)> {
        let scripts = self::folder().join("scripts");
        fs::create_dir_all(&scripts)?;
        for (name, text) in FILES {
            fs::write(scripts.join(name), text)?;
        }
        let log = folder.join(format!("{}-{}.log", script.module, script.variant));
        let mut process = Command::new(python)
            .arg("-B")
            .arg(scripts.join(script.file))
            .args([folder.as_os_str().to_owned(), OsString::from(threads.to_string()), script.variant.into()])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(fs::File::create(&log)?)
            .spawn()
            .with_context(|| format!("cannot start {}", python.display()))?;
        let requests = process.stdin.take().context("the script has no input")?;
        let answers = BufReader::new(process.stdout.take().context("the script has no output")?);
        let mut worker = Self { process, requests, answers, log };
        let version = worker.answer()?["version"].as_str().unwrap_or_default().to_owned();
        Ok((worker, version))
    }

    fn render(&mut self, spp: u32, seed: u32, way: &str, out: &Path) -> Result<Cost> {
        let request = json!({"spp": spp, "seed": seed, "way": way, "out": out.to_string_lossy()});
        writeln!(self.requests, "{request}").with_context(|| self.said())?;
        let answer = self.answer()?;
        let spp = answer["spp"].as_u64().and_then(|n| u32::try_from(n).ok());
        match (spp, answer["seconds"].as_f64()) {
            (Some(spp), Some(seconds)) => Ok(Cost { spp, seconds }),
            _ => bail!("the script answers {answer}"),
        }
    }

    /// The next answer; programs print other lines too.
    fn answer(&mut self) -> Result<Value> {
        let mut line = Vec::new();
        loop {
            line.clear();
            if self.answers.read_until(b'\n', &mut line)? == 0 {
                bail!("{}", self.said());
            }
            // Messages of the program may stand before it on the line.
            if let Some((_, answer)) = String::from_utf8_lossy(&line).split_once("race: ") {
                return Ok(serde_json::from_str(answer)?);
            }
        }
    }

    /// The last that the script said on its way out.
    fn said(&self) -> String {
        let text = fs::read(&self.log).unwrap_or_default();
        let text = String::from_utf8_lossy(&text);
        let last = text.lines().rev().find(|line| !line.trim().is_empty()).unwrap_or("nothing");
        format!("it ended and said: {last} ({})", self.log.display())
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        // It has nothing to save, and its exit status says nothing.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
