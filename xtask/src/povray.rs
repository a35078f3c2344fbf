//! POV-Ray's own example scenes: which are read, which are rendered as POV-Ray does, and how long both take.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail, ensure};
use clap::Args;
use xtask::command::{release_program, succeeds, target};

use crate::race::picture::Picture;

/// Where Debian's package povray-examples puts them.
const EXAMPLES: &str = "/usr/share/doc/povray/examples";
/// Scenes whose pictures differ in more than this share of their pixels …
const MAX_SHARE: f64 = 0.03;
/// … by more than this in a channel, do not agree, …
const DIFFERENT: f64 = 0.03;
/// … nor do those whose channels differ by more than this on average.
const MAX_MEAN: f64 = 0.01;
/// Scenes whose camera has several rays for each pixel: with `-A` Lumbre takes one of them, where POV-Ray takes all.
const MANY_RAYS: [&str; 5] =
    ["chess2.pov", "ess-ortho-camera.pov", "ess-persp-camera.pov", "focalblur.pov", "meshcam_persp_demo.pov"];
/// Warnings that change nothing of a picture.
const HARMLESS: [&str; 2] = ["the scene says", "the scene has no light"];

/// Walks scenes of POV-Ray.
#[derive(Args)]
pub(crate) struct Corpus {
    /// Only scenes whose path contains this.
    filter: Option<String>,
    /// The folder of the scenes.
    #[arg(long, default_value = EXAMPLES)]
    folder: PathBuf,
    /// Width and height of the pictures that are compared.
    #[arg(long, default_values_t = [80, 60], num_args = 2)]
    size: Vec<u32>,
    /// The most seconds that each program may take for a scene.
    #[arg(long, default_value_t = 60)]
    seconds: u64,
    /// Keeps the pictures of both programs in target/povray, and takes POV-Ray's from there where it was kept.
    #[arg(long)]
    keep: bool,
}

/// What became of a scene.
struct Outcome {
    /// Why it was not read, if it was not.
    error: Option<String>,
    /// What was said about it that matters, without places.
    warnings: Vec<String>,
    agreement: Agreement,
}

enum Agreement {
    /// One of the programs made no picture.
    Unknown(&'static str),
    /// The share of the pixels that differ, and the mean difference.
    Known { share: f64, mean: f64 },
}

impl Agreement {
    fn holds(&self) -> bool {
        matches!(self, Self::Known { share, mean } if *share <= MAX_SHARE && *mean <= MAX_MEAN)
    }
}

impl Corpus {
    /// Prints a line for each scene, and tables of all.
    pub(crate) fn run(&self) -> Result<()> {
        let program = lumbre()?;
        ensure!(succeeds("povray", &["--version"]), "povray is not on the PATH");
        let scenes = self.scenes()?;
        ensure!(!scenes.is_empty(), "no scenes in {}", self.folder.display());
        let pictures = target().join("povray");
        std::fs::create_dir_all(&pictures)?;
        let mut folders: BTreeMap<String, Vec<Outcome>> = BTreeMap::new();
        for scene in &scenes {
            let outcome = self.outcome(&program, scene, &pictures)?;
            let name = scene.strip_prefix(&self.folder).unwrap_or(scene);
            println!("{}: {}", name.display(), outcome.line());
            let folder = name.components().next().map(|first| first.as_os_str().to_string_lossy());
            let folder = folder.filter(|_| name.components().count() > 1).unwrap_or_default().into_owned();
            folders.entry(folder).or_default().push(outcome);
        }
        print_tables(&folders);
        Ok(())
    }

    fn scenes(&self) -> Result<Vec<PathBuf>> {
        let mut folders = vec![self.folder.clone()];
        let mut scenes = Vec::new();
        while let Some(folder) = folders.pop() {
            let entries = std::fs::read_dir(&folder).with_context(|| format!("{}", folder.display()))?;
            for entry in entries {
                let path = entry?.path();
                if path.is_dir() {
                    folders.push(path);
                } else if path.extension().is_some_and(|end| end == "pov") {
                    scenes.push(path);
                }
            }
        }
        let wanted = self.filter.as_deref().unwrap_or_default();
        scenes.retain(|path| path.to_string_lossy().contains(wanted));
        scenes.sort();
        Ok(scenes)
    }

    fn outcome(&self, program: &Path, scene: &Path, pictures: &Path) -> Result<Outcome> {
        let limit = Duration::from_secs(self.seconds);
        let (ours, theirs) = if self.keep {
            let name = scene.strip_prefix(&self.folder).unwrap_or(scene).with_extension("");
            let name = name.to_string_lossy().replace(['/', '\\'], "-");
            let [width, height] = self.size[..] else { bail!("a size is two numbers") };
            let name = |end: &str| pictures.join(format!("{name}-{width}x{height}-{end}"));
            (name("lumbre.pfm"), name("povray.ppm"))
        } else {
            (pictures.join("lumbre.pfm"), pictures.join("povray.ppm"))
        };
        let mut switches = self.switches(scene);
        if MANY_RAYS.iter().any(|name| scene.ends_with(name)) {
            switches.retain(|switch| switch != "-A");
        }
        let run = run_lumbre(program, scene, &ours, &switches, limit)?;
        let of_kind = |kind: &str| -> Vec<String> {
            let lines = run.said.lines().filter_map(|line| line.trim().strip_prefix(kind));
            let mut found: Vec<String> = lines.map(without_place).collect();
            found.dedup();
            found
        };
        let mut warnings = of_kind("warning: ");
        warnings.retain(|warning| !HARMLESS.iter().any(|words| warning.contains(words)));
        let error = of_kind("error: ").into_iter().next().filter(|_| !run.is_good);
        if run.is_late {
            return Ok(Outcome {
                error,
                warnings,
                agreement: Agreement::Unknown("takes longer than it may"),
            });
        }
        let picture = produced(&ours).and_then(|path| Picture::read(&path).ok());
        let Some(picture) = picture.filter(|_| run.is_good) else {
            return Ok(Outcome { error, warnings, agreement: Agreement::Unknown("no picture") });
        };
        if !self.keep || produced(&theirs).is_none() {
            let mut peer = povray(scene, &theirs)?;
            peer.args(self.switches(scene)).args(["+WT1", "+FP8", "File_Gamma=srgb"]);
            run_within(&mut peer, limit, &pictures.join("povray.txt"))?;
        }
        let Some(reference) = produced(&theirs).and_then(|path| read_ppm(&path).ok()) else {
            return Ok(Outcome { error, warnings, agreement: Agreement::Unknown("none by POV-Ray") });
        };
        let (share, mean) = difference(&picture, &reference);
        Ok(Outcome { error, warnings, agreement: Agreement::Known { share, mean } })
    }

    /// The switches that POV-Ray is given: one ray through the middle of each pixel, unless the camera has several.
    fn switches(&self, scene: &Path) -> Vec<String> {
        let mut switches = vec![format!("+W{}", self.size[0]), format!("+H{}", self.size[1]), "-A".into()];
        // Its scenes are frames of an animation; those at the number 0 do not exist.
        if scene.to_string_lossy().contains("/portfolio/") {
            switches.extend(["+KFI1", "+KFF2", "+SF1", "+EF1"].map(String::from));
        }
        switches
    }
}

impl Outcome {
    fn line(&self) -> String {
        let said =
            if self.warnings.is_empty() { String::new() } else { format!(" ({})", self.warnings.join("; ")) };
        match (&self.error, &self.agreement) {
            (Some(error), _) => format!("is not read: {error}{said}"),
            (None, Agreement::Unknown(why)) => format!("{why}{said}"),
            (None, Agreement::Known { share, mean }) => {
                let verdict = if self.agreement.holds() { "agrees" } else { "differs" };
                format!("{verdict}, {:.1} % of its pixels, by {mean:.4} on average{said}", 100.0 * share)
            }
        }
    }
}

fn print_tables(folders: &BTreeMap<String, Vec<Outcome>>) {
    println!(
        "\n| folder | scenes | read | without a warning | compared | agree |\n|---|---|---|---|---|---|"
    );
    let row = |name: &str, outcomes: &[&Outcome]| {
        let count = |test: &dyn Fn(&Outcome) -> bool| outcomes.iter().filter(|o| test(o)).count();
        println!(
            "| {name} | {} | {} | {} | {} | {} |",
            outcomes.len(),
            count(&|o| o.error.is_none()),
            count(&|o| o.error.is_none() && o.warnings.is_empty()),
            count(&|o| matches!(o.agreement, Agreement::Known { .. })),
            count(&|o| o.agreement.holds()),
        );
    };
    for (name, outcomes) in folders {
        row(name, &outcomes.iter().collect::<Vec<_>>());
    }
    let all: Vec<&Outcome> = folders.values().flatten().collect();
    row("all", &all);
    println!("\n| said | scenes | of them agree |\n|---|---|---|");
    let mut said: BTreeMap<&str, [usize; 2]> = BTreeMap::new();
    for outcome in &all {
        for words in outcome.warnings.iter().chain(&outcome.error) {
            let counts = said.entry(words).or_default();
            counts[0] += 1;
            counts[1] += usize::from(outcome.agreement.holds());
        }
    }
    let mut said: Vec<_> = said.into_iter().collect();
    said.sort_by_key(|(_, counts)| std::cmp::Reverse(counts[0]));
    for (words, [count, agree]) in said {
        println!("| {words} | {count} | {agree} |");
    }
}

/// The program that `LUMBRE_PROGRAM` names, else the one that is built for release.
fn lumbre() -> Result<PathBuf> {
    std::env::var_os("LUMBRE_PROGRAM").map_or_else(release_program, |named| Ok(named.into()))
}

struct Run {
    is_good: bool,
    is_late: bool,
    said: String,
    seconds: f64,
}

fn run_lumbre(program: &Path, scene: &Path, out: &Path, switches: &[String], limit: Duration) -> Result<Run> {
    forget(out);
    let mut command = Command::new(program);
    command.arg("render").arg(scene).args(switches).arg(format!("+O{}", out.display()));
    command.args(["--threads", "1", "--progress", "none"]);
    run_within(&mut command, limit, &out.with_extension("txt"))
}

fn povray(scene: &Path, out: &Path) -> Result<Command> {
    forget(out);
    let mut command = Command::new("povray");
    // It finds what a scene includes beside it only where it runs.
    command.current_dir(scene.parent().context("a scene lies in a folder")?);
    command.arg(format!("+I{}", scene.file_name().unwrap_or_default().to_string_lossy()));
    command.arg(format!("+O{}", out.display())).args(["-D", "-GA"]);
    Ok(command)
}

/// Runs a command for at most so long, with what it says in a file.
fn run_within(command: &mut Command, limit: Duration, log: &Path) -> Result<Run> {
    let file = File::create(log)?;
    command.stdin(Stdio::null()).stdout(file.try_clone()?).stderr(file);
    let start = Instant::now();
    let mut child =
        command.spawn().with_context(|| format!("cannot start {}", command.get_program().display()))?;
    let (is_good, is_late) = loop {
        if let Some(status) = child.try_wait()? {
            break (status.success(), false);
        }
        if start.elapsed() > limit {
            child.kill()?;
            child.wait()?;
            break (false, true);
        }
        std::thread::sleep(Duration::from_millis(5));
    };
    let seconds = start.elapsed().as_secs_f64();
    let said = String::from_utf8_lossy(&std::fs::read(log)?).into_owned();
    Ok(Run { is_good, is_late, said, seconds })
}

/// A message without the file, line and column before it.
fn without_place(message: &str) -> String {
    let is_place = |part: &str| part.parse::<u32>().is_ok() || part.contains(['/', '.']);
    let parts: Vec<&str> = message.split(':').collect();
    let first = parts.iter().position(|part| !is_place(part.trim()) || part.contains(' '));
    parts[first.unwrap_or(0)..].join(":").trim().to_owned()
}

/// The picture of a name, or of a frame of that name.
fn produced(path: &Path) -> Option<PathBuf> {
    [path.to_owned(), of_frame(path)].into_iter().find(|path| path.exists())
}

fn of_frame(path: &Path) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let ending = path.extension().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!("{stem}1.{ending}"))
}

fn forget(path: &Path) {
    for path in [path.to_owned(), of_frame(path)] {
        let _ = std::fs::remove_file(path);
    }
}

/// An 8-bit .ppm, as numbers of a screen.
fn read_ppm(path: &Path) -> Result<Picture> {
    let bytes = std::fs::read(path)?;
    let mut rest = &bytes[..];
    let mut word = || -> Result<&str> {
        loop {
            let end = rest.iter().position(u8::is_ascii_whitespace).context("the header ends early")?;
            let (word, after) = rest.split_at(end);
            rest = &after[1..];
            if word.starts_with(b"#") {
                let line = rest.iter().position(|b| *b == b'\n').context("a comment without end")?;
                rest = &rest[line + 1..];
            } else if !word.is_empty() {
                return Ok(std::str::from_utf8(word)?);
            }
        }
    };
    ensure!(word()? == "P6", "it is no .ppm of bytes");
    let (width, height): (usize, usize) = (word()?.parse()?, word()?.parse()?);
    ensure!(word()? == "255" && rest.len() == 3 * width * height, "it is no .ppm of 8 bits");
    let pixels = rest.chunks_exact(3).map(|c| [c[0], c[1], c[2]].map(|c| f32::from(c) / 255.0)).collect();
    Ok(Picture { width, height, pixels })
}

/// The share of pixels that differ, and the mean of the differences, of linear light and numbers of a screen.
fn difference(ours: &Picture, theirs: &Picture) -> (f64, f64) {
    if (ours.width, ours.height) != (theirs.width, theirs.height) {
        return (1.0, 1.0);
    }
    let encoded = |c: f32| {
        let c = if c.is_nan() { 1.0 } else { f64::from(c.clamp(0.0, 1.0)) };
        if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 }
    };
    let (mut different, mut sum) = (0, 0.0);
    for (a, b) in ours.pixels.iter().zip(&theirs.pixels) {
        let each = [0, 1, 2].map(|k| (encoded(a[k]) - f64::from(b[k])).abs());
        different += usize::from(each.iter().any(|d| *d > DIFFERENT));
        sum += each.iter().sum::<f64>() / 3.0;
    }
    let count = ours.pixels.len().max(1) as f64;
    (different as f64 / count, sum / count)
}

/// Example scenes that both programs render alike, and that take POV-Ray long enough to be timed.
const RACED: [&str; 10] = [
    "advanced/biscuit.pov",
    "advanced/blocks/stackergold.pov",
    "advanced/blocks/stackertransp.pov",
    "advanced/infinitybox.pov",
    "advanced/lamppost.pov",
    "advanced/woodbox.pov",
    "bsp/Tango.pov",
    "incdemo/shapes.pov",
    "lights/arealit3.pov",
    "textures/patterns/crackle3.pov",
];

/// The time of example scenes.
#[derive(Args)]
pub(crate) struct Times {
    /// Width and height of the pictures.
    #[arg(long, default_values_t = [320, 240], num_args = 2)]
    size: Vec<u32>,
    /// How often each program runs; the median counts.
    #[arg(long, default_value_t = 3)]
    runs: usize,
    /// Threads of each program.
    #[arg(long, default_value_t = 2)]
    threads: usize,
    /// The folder of the examples.
    #[arg(long, default_value = EXAMPLES)]
    folder: PathBuf,
}

impl Times {
    /// Times whole commands, with one ray a pixel and with antialiasing, and prints a table.
    pub(crate) fn run(&self) -> Result<()> {
        let program = lumbre()?;
        ensure!(succeeds("povray", &["--version"]), "povray is not on the PATH");
        let folder = target().join("povray");
        std::fs::create_dir_all(&folder)?;
        if let Ok(load) = std::fs::read_to_string("/proc/loadavg") {
            println!("load before: {}", load.trim());
        }
        println!(
            "| scene | POV-Ray -A | Lumbre -A | ratio | POV-Ray +A0.3 | Lumbre +A | ratio |\n|---|---|---|---|---|---|---|"
        );
        let mut logs = [0.0; 2];
        for name in RACED {
            let scene = self.folder.join(name);
            let mut cells = Vec::new();
            for (i, antialias) in [["-A", "-A"], ["+A0.3", "+A"]].into_iter().enumerate() {
                let [theirs, ours] = self.medians(&program, &scene, &folder, antialias)?;
                logs[i] += (theirs / ours).ln() / RACED.len() as f64;
                cells.push(format!("{theirs:.2} s | {ours:.2} s | {:.1}", theirs / ours));
            }
            println!("| {name} | {} |", cells.join(" | "));
        }
        println!("| geometric mean | | | {:.1} | | | {:.1} |", logs[0].exp(), logs[1].exp());
        Ok(())
    }

    /// The median times of both programs, which take turns.
    fn medians(
        &self,
        program: &Path,
        scene: &Path,
        folder: &Path,
        [theirs, ours]: [&str; 2],
    ) -> Result<[f64; 2]> {
        let size = [format!("+W{}", self.size[0]), format!("+H{}", self.size[1])];
        let limit = Duration::from_secs(600);
        let mut times = [Vec::new(), Vec::new()];
        for _ in 0..self.runs.max(1) {
            let mut peer = povray(scene, &folder.join("time.png"))?;
            peer.args(&size).args([theirs, &format!("+WT{}", self.threads)]);
            let mut command = Command::new(program);
            command.arg("render").arg(scene).args(&size).arg(ours);
            command.arg("-o").arg(folder.join("time-lumbre.png"));
            command.args(["--threads", &self.threads.to_string(), "--progress", "none"]);
            for (command, times) in [&mut peer, &mut command].into_iter().zip(&mut times) {
                let run = run_within(command, limit, &folder.join("time.txt"))?;
                if !run.is_good {
                    bail!("{:?} failed: {}", command.get_program(), run.said);
                }
                times.push(run.seconds);
            }
        }
        Ok(times.map(|mut times| {
            times.sort_by(f64::total_cmp);
            times[times.len() / 2]
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_is_told_without_its_place() {
        for (found, expected) in [
            ("/a/b.c/x.pov:11:110: the inside of a mesh", "the inside of a mesh"),
            ("x.pov: the scene has no light: it is black", "the scene has no light: it is black"),
            ("dispersion is not rendered", "dispersion is not rendered"),
        ] {
            assert_eq!(without_place(found), expected);
        }
    }

    #[test]
    fn pictures_differ_by_what_a_screen_shows() {
        let gray = |c: f32| Picture { width: 2, height: 1, pixels: vec![[c; 3], [0.0; 3]] };
        // Linear 0.2140 is half of what a screen shows.
        let (share, mean) = difference(&gray(0.214_041), &gray(0.5));
        assert!(share == 0.0 && mean < 1e-4, "{share} {mean}");
        let (share, mean) = difference(&gray(0.214_041), &gray(0.6));
        assert!(share == 0.5 && (mean - 0.05).abs() < 1e-4, "{share} {mean}");
    }

    #[test]
    fn a_ppm_is_read_past_its_comments() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.ppm");
        std::fs::write(&path, b"P6\n# made by hand\n2 1\n255\n\x00\x33\xff\xff\x00\x00").unwrap();
        let picture = read_ppm(&path).unwrap();
        assert_eq!((picture.width, picture.height), (2, 1));
        assert_eq!(picture.pixels, [[0.0, 0.2, 1.0], [1.0, 0.0, 0.0]]);
        std::fs::write(&path, b"P6 2 1 65535\n").unwrap();
        assert!(read_ppm(&path).is_err());
    }
}
