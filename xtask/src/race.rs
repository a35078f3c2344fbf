//! The race: Lumbre and its peers render the same scenes in turn, and the error of their pictures is set against the
//! time.

use std::fs;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, ensure};
use clap::Args;
use xtask::command::release_program;

use curve::Point;
use picture::Picture;
use program::{Found, Kind, Program};
use report::{Agreement, Curve, Heat};
use scene::Scene;

mod curve;
pub(crate) mod picture;
mod plot;
mod program;
mod report;
pub(crate) mod scaling;
mod scene;
mod scenes;
mod write;

/// The arguments of the race.
#[derive(Args)]
pub(crate) struct Race {
    /// Small pictures and few samples: two to three minutes.
    #[arg(long)]
    quick: bool,
    /// Only these scenes, separated by commas: cornell, interior, lights, terrain, glass, coats, models, tumbler, pool,
    /// cloud, smoke, hair.
    #[arg(long, value_delimiter = ',')]
    scenes: Vec<String>,
    /// Only these programs; by default all that are found. Lumbre always takes part.
    #[arg(long, value_delimiter = ',')]
    peers: Vec<Kind>,
    /// Threads of each program; several numbers are raced one after another.
    #[arg(long, value_delimiter = ',', default_values_t = [2])]
    threads: Vec<usize>,
    /// How often each picture is rendered: the least time and the mean error count.
    #[arg(long, default_value_t = 1)]
    runs: u32,
    /// The folder for race.md, between its markers where it exists, and for the plots, such as docs/measurements; by
    /// default target/bench/race.
    #[arg(long)]
    out: Option<PathBuf>,
    /// The figures as JSON, too.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Lumbre's program; by default the release build of this workspace.
    #[arg(long, value_name = "PROGRAM")]
    lumbre: Option<PathBuf>,
    /// First install the peers that are Python packages, into target/bench/peers.
    #[arg(long)]
    install: bool,
}

/// How large and how long a race is.
struct Extent {
    /// Pixels along each side.
    size: u32,
    /// Samples a pixel, ascending.
    ladder: &'static [u32],
    /// A program goes no further up the ladder where it would take longer than this, in seconds.
    longest: f64,
    /// Samples a pixel of references by Lumbre, by Mitsuba, and by a program for itself.
    references: [u32; 3],
}

const NORMAL: Extent =
    Extent { size: 256, ladder: &[4, 16, 64, 256], longest: 15.0, references: [512, 2048, 1024] };
const QUICK: Extent = Extent { size: 128, ladder: &[4, 16, 64], longest: 5.0, references: [256, 1024, 256] };

/// The samples at which Mitsuba sets the error that all are to reach.
const TARGET_SPP: u32 = 64;

impl Race {
    /// Renders, prints tables and writes them.
    pub(crate) fn run(self) -> Result<()> {
        if self.install {
            program::install()?;
        }
        let mut chosen = scenes::all();
        let known: Vec<&str> = chosen.iter().map(|scene| scene.name).collect();
        if let Some(unknown) = self.scenes.iter().find(|name| !known.contains(&name.as_str())) {
            anyhow::bail!("there is no scene {unknown}: {}", known.join(", "));
        }
        chosen.retain(|scene| self.scenes.is_empty() || self.scenes.iter().any(|name| name == scene.name));
        ensure!(self.threads.iter().all(|&n| n > 0) && self.runs > 0, "there must be a thread and a run");
        let lumbre = match &self.lumbre {
            Some(program) => {
                fs::canonicalize(program).with_context(|| format!("there is no {}", program.display()))?
            }
            None => release_program()?,
        };
        let mut found = Vec::new();
        for kind in Kind::ALL {
            if kind == Kind::Lumbre || self.peers.is_empty() || self.peers.contains(&kind) {
                match program::find(kind, &lumbre) {
                    Ok(one) => found.push((kind, one)),
                    Err(missing) => println!("{} is left out: {missing}", kind.name()),
                }
            }
        }
        let extent = if self.quick { QUICK } else { NORMAL };
        let work = program::folder().join("race");
        let out = self.out.clone().unwrap_or_else(|| work.clone());
        let mut heats = Vec::new();
        for &threads in &self.threads {
            for scene in &chosen {
                let heat = heat(scene, &found, threads, self.runs, &extent, &work)?;
                println!("\n{}", report::heat_table(&heat, extent.ladder));
                heats.push(heat);
            }
        }
        report::write(&heats, extent.ladder, extent.size, &out)?;
        draw(&chosen, &lumbre, extent.size, &work, &out)?;
        if let Some(file) = &self.json {
            fs::write(file, serde_json::to_string_pretty(&report::json(&heats))?)?;
        }
        println!("{}", report::summary(&heats));
        println!("{}", out.join("race.md").display());
        Ok(())
    }
}

fn scene_folder(scene: &Scene, size: u32, work: &Path) -> PathBuf {
    work.join("scenes").join(format!("{}-{size}", scene.name))
}

/// Small pictures of the scenes next to the tables.
fn draw(scenes: &[Scene], lumbre: &Path, size: u32, work: &Path, out: &Path) -> Result<()> {
    for scene in scenes {
        let picture = out.join("race").join(format!("{}.png", scene.name));
        let mut command = Command::new(lumbre);
        command.arg("render").arg(scene_folder(scene, size, work).join("scene.pbrt")).arg("-o").arg(picture);
        let done = command.args(["--spp", "64", "--denoise", "--progress", "none", "-q"]).status()?;
        ensure!(done.success(), "Lumbre cannot render {}", scene.name);
    }
    Ok(())
}

/// All programs on one scene.
fn heat(
    scene: &Scene,
    found: &[(Kind, Found)],
    threads: usize,
    runs: u32,
    extent: &Extent,
    work: &Path,
) -> Result<Heat> {
    println!("\n{}, {threads} thread{}", scene.name, if threads == 1 { "" } else { "s" });
    let folder = scene_folder(scene, extent.size, work);
    write::write_scene(scene, extent.size, &folder)?;
    let mut notes = Vec::new();
    let mut programs = Vec::new();
    for (kind, found) in found.iter().filter(|(kind, _)| kind.shows(scene)) {
        match Program::start(*kind, found, &folder, threads) {
            Ok(program) => programs.push(program),
            Err(error) if *kind == Kind::Lumbre => return Err(error),
            Err(error) => notes.push(format!("{} is left out: {error:#}", kind.name())),
        }
    }
    notes.iter().for_each(|note| println!("  {note}"));
    let references = References::make(scene, &mut programs, extent, &folder, &mut notes)?;
    let mut curves: Vec<Curve> = Vec::new();
    for (place, program) in programs.iter().enumerate() {
        for way in program.kind.ways(scene) {
            let name = [program.kind.name(), way].join(" ").trim_end().to_owned();
            let (kind, version) = (program.kind, program.version.clone());
            curves.push(Curve { kind, version, name, way, place, points: Vec::new(), brightness: 0.0 });
        }
    }
    for &spp in extent.ladder {
        let mut made: Vec<Vec<(Point, f64)>> = vec![Vec::new(); curves.len()];
        for run in 0..runs {
            for turn in 0..curves.len() {
                // Who begins changes, so that none always comes after the same.
                let which = (turn + run as usize) % curves.len();
                let curve = &curves[which];
                let next_takes =
                    curve.points.last().map_or(0.0, |p| p.seconds * f64::from(spp) / f64::from(p.spp));
                let ended = curve.points.len() < extent.ladder.iter().position(|&s| s == spp).unwrap_or(0);
                if ended || next_takes > extent.longest {
                    continue;
                }
                let program = &mut programs[curve.place];
                let out = folder.join(format!("{}-{spp}.pfm", curve.name.replace(' ', "-")));
                let rendered = program
                    .render(spp, 1 + run, curve.way, &out)
                    .and_then(|cost| Ok((cost, Picture::read(&out)?)))
                    .and_then(|(cost, picture)| {
                        Ok((cost, picture.relative_mse(&references.of(curve.kind).picture)?, picture.mean()))
                    });
                match rendered {
                    Ok((cost, error, mean)) => {
                        println!("  {} {}: {:.2} s, {error:.2e}", curve.name, cost.spp, cost.seconds);
                        made[which].push((Point { spp: cost.spp, seconds: cost.seconds, error }, mean));
                    }
                    Err(error) if curve.kind == Kind::Lumbre => return Err(error),
                    Err(error) => notes.push(format!("{} ends at {spp} samples: {error:#}", curve.name)),
                }
            }
        }
        for (curve, made) in curves.iter_mut().zip(made) {
            if let Some(&(first, _)) = made.first() {
                let share = 1.0 / made.len() as f64;
                let seconds = made.iter().map(|(p, _)| p.seconds).fold(f64::MAX, f64::min);
                let error = made.iter().map(|(p, _)| p.error * share).sum();
                curve.points.push(Point { spp: first.spp, seconds, error });
                curve.brightness =
                    made.iter().map(|(_, mean)| mean * share).sum::<f64>() / references.lumbre.mean();
            }
        }
    }
    let target = curves
        .iter()
        .find(|c| c.kind == Kind::MitsubaLlvm)
        .or_else(|| curves.iter().find(|c| c.kind == Kind::Lumbre))
        .and_then(|c| c.points.iter().find(|p| p.spp == TARGET_SPP).or(c.points.last()))
        .map(|p| p.error);
    let own = references.own.iter().map(|(kind, _)| *kind).collect();
    Ok(Heat {
        scene: scene.name,
        about: scene.about,
        threads,
        curves,
        noise: references.common.noise,
        agreement: references.agreement,
        own,
        notes,
        target,
    })
}

/// Pictures without visible noise.
struct References {
    lumbre: Picture,
    /// The mean of Lumbre's and Mitsuba's where they tend to the same, else Lumbre's.
    common: Reference,
    /// Of programs whose materials are others.
    own: Vec<(Kind, Reference)>,
    agreement: Option<Agreement>,
}

impl References {
    /// The picture that the noise of a program is measured against.
    fn of(&self, kind: Kind) -> &Reference {
        let own = |of: Kind| self.own.iter().find(|(kind, _)| *kind == of).map(|(_, reference)| reference);
        // Both variants of Mitsuba compute the same.
        let compiled = (kind == Kind::MitsubaScalar).then_some(Kind::MitsubaLlvm);
        own(kind).or_else(|| own(compiled?)).unwrap_or(&self.common)
    }

    /// Renders them, or takes those of an earlier race of the same scene.
    fn make(
        scene: &Scene,
        programs: &mut Vec<Program>,
        extent: &Extent,
        folder: &Path,
        notes: &mut Vec<String>,
    ) -> Result<Self> {
        let [by_lumbre, by_mitsuba, by_itself] = extent.references;
        let with_mitsuba = programs.iter().any(|p| p.kind == Kind::MitsubaLlvm);
        let shared = with_mitsuba && Kind::MitsubaLlvm.agrees(scene);
        let mut made: Vec<(Kind, Reference)> = Vec::new();
        let mut failed = Vec::new();
        for program in programs.iter_mut() {
            let kind = program.kind;
            // The scalar variant follows the compiled one, and makes a reference only where that is missing.
            let follows = kind == Kind::MitsubaScalar && with_mitsuba;
            let spp = match kind {
                Kind::Lumbre => Some(if shared { by_lumbre } else { by_itself }),
                Kind::MitsubaLlvm => Some(by_mitsuba),
                _ if follows || kind.agrees(scene) => None,
                _ => Some(by_itself),
            };
            if let Some(spp) = spp {
                match reference(program, scene, spp, folder) {
                    Ok(reference) => made.push((kind, reference)),
                    Err(error) if kind == Kind::Lumbre => return Err(error),
                    Err(error) => {
                        notes.push(format!("{} is left out: {error:#}", kind.name()));
                        failed.push(kind);
                    }
                }
            }
        }
        programs.retain(|p| !failed.contains(&p.kind));
        let take = |made: &mut Vec<(Kind, Reference)>, kind| {
            made.iter().position(|(of, _)| *of == kind).map(|at| made.swap_remove(at).1)
        };
        let lumbre = take(&mut made, Kind::Lumbre).context("there is no reference by Lumbre")?;
        let mut common = lumbre.clone();
        let mut agreement = None;
        if let Some((_, mitsuba)) = made.iter().find(|(kind, _)| *kind == Kind::MitsubaLlvm) {
            agreement = Some(Agreement {
                relative_mse: mitsuba.picture.relative_mse(&lumbre.picture)?,
                noise: mitsuba.noise + lumbre.noise,
                brightness: mitsuba.picture.mean() / lumbre.picture.mean(),
            });
            if shared && mitsuba.noise + lumbre.noise > 0.0 {
                // The share by which their mean has the least noise.
                let share = lumbre.noise / (mitsuba.noise + lumbre.noise);
                let noise = share * mitsuba.noise;
                common = Reference { picture: lumbre.picture.mixed(&mitsuba.picture, share), noise };
            }
        }
        if shared {
            take(&mut made, Kind::MitsubaLlvm);
        }
        Ok(Self { lumbre: lumbre.picture, common, own: made, agreement })
    }
}

/// A picture with its relative mean squared error, by noise alone.
#[derive(Clone)]
struct Reference {
    picture: Picture,
    noise: f64,
}

/// A reference by one program, in two halves that measure its noise. They are kept in files that are named after all
/// that they depend on.
fn reference(program: &mut Program, scene: &Scene, spp: u32, folder: &Path) -> Result<Reference> {
    let mut hasher = DefaultHasher::new();
    write::pbrt(scene, 0).hash(&mut hasher);
    for object in &scene.objects {
        let numbers = object.mesh.points.iter().chain(&object.mesh.normals);
        numbers.flatten().for_each(|x| x.to_bits().hash(&mut hasher));
    }
    if let Some(sky) = &scene.sky {
        sky.pixels.iter().flatten().for_each(|x| x.to_bits().hash(&mut hasher));
    }
    let name = program.kind.name().to_lowercase().replace(' ', "-");
    let mut half = |seed| {
        let file = folder.join(format!("reference-{name}-{spp}-{seed}-{:016x}.pfm", hasher.finish()));
        if !file.exists() {
            println!("  half of a reference by {} with {spp} samples", program.kind.name());
            let unfinished = file.with_extension("part.pfm");
            program.render(spp / 2, seed, program.kind.ways(scene)[0], &unfinished)?;
            fs::rename(&unfinished, &file)?;
        }
        Picture::read(&file)
    };
    let (a, b) = (half(4242)?, half(4243)?);
    let picture = a.mixed(&b, 0.5);
    // Each half has twice the variance of their mean, and they differ by that of both.
    let noise = f64::midpoint(a.relative_mse(&picture)?, b.relative_mse(&picture)?);
    Ok(Reference { picture, noise })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_scene_can_be_written_and_names_only_what_it_has() {
        for scene in scenes::all() {
            let text = write::pbrt(&scene, 64);
            // A volume has a mesh around it.
            let meshes = scene.objects.len() + usize::from(scene.volume.is_some());
            assert_eq!(text.matches("plymesh").count(), meshes, "{}", scene.name);
            assert!(scene.objects.iter().all(|o| o.material < scene.materials.len()), "{}", scene.name);
            let shines = scene.sky.is_some() || scene.objects.iter().any(|o| o.emission.is_some());
            assert!(shines, "{} is dark", scene.name);
        }
    }

    #[test]
    fn race_scenes_have_their_lamps_and_triangles() {
        let scenes = scenes::all();
        let scene = |name| scenes.iter().find(|s| s.name == name).unwrap();
        let lamps = scene("lights").objects.iter().filter(|o| o.emission.is_some());
        assert_eq!(lamps.map(|o| o.mesh.faces.len() / 2).sum::<usize>(), 10_000);
        assert_eq!(scene("terrain").objects.iter().map(|o| o.mesh.faces.len()).sum::<usize>(), 1_000_000);
    }
}
