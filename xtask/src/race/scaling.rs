//! The time of a path against the number of lights, triangles and instances.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::SystemTime;

use anyhow::{Context, Result, ensure};
use clap::Args;
use serde_json::Value;
use xtask::command::release_program;

use super::plot::{Line, svg};
use super::program::folder;
use super::report::{date, machine};
use super::scene::{Camera, Material, Mesh, Object, Scene};
use super::scenes::{Parts, ceiling, diffuse, floor, terrain};
use super::write::write_scene;

/// What is measured.
#[derive(Args)]
pub(crate) struct Scaling {
    /// No more of anything than this.
    #[arg(long, default_value_t = 10_000_000)]
    most: u32,
    /// Threads.
    #[arg(long, default_value_t = 1)]
    threads: usize,
    /// How often each scene is rendered: the least time counts.
    #[arg(long, default_value_t = 3)]
    runs: u32,
    /// The folder for scaling.md and its plot, such as docs/measurements; by default target/bench/scaling.
    #[arg(long)]
    out: Option<PathBuf>,
    /// Lumbre's program; by default the release build of this workspace.
    #[arg(long, value_name = "PROGRAM")]
    lumbre: Option<PathBuf>,
}

/// Pixels along each side.
const SIZE: u32 = 256;
/// Samples a pixel.
const SPP: u32 = 4;

/// A kind of thing, in growing numbers.
struct Series {
    name: &'static str,
    counts: &'static [u32],
    write: fn(u32, &Path) -> Result<()>,
}

const SERIES: [Series; 3] = [
    Series { name: "lights", counts: &[1, 10, 100, 1_000, 10_000, 100_000, 1_000_000], write: write_lights },
    Series {
        name: "triangles",
        counts: &[1_000, 10_000, 100_000, 1_000_000, 10_000_000],
        write: write_triangles,
    },
    Series {
        name: "instances",
        counts: &[1, 10, 100, 1_000, 10_000, 100_000, 1_000_000],
        write: write_instances,
    },
];

impl Scaling {
    /// Renders, prints the table, and writes it with its plot.
    pub(crate) fn run(self) -> Result<()> {
        let program = self.lumbre.clone().map_or_else(release_program, Ok)?;
        let work = folder().join("scaling");
        let mut table =
            String::from("| | number | microseconds a path | seconds of building |\n|---|---|---|---|\n");
        println!("{}", table.trim_end());
        let mut lines = Vec::new();
        for series in SERIES {
            let mut points = Vec::new();
            for &count in series.counts.iter().filter(|count| **count <= self.most) {
                let scene = work.join(format!("{}-{count}", series.name));
                (series.write)(count, &scene)?;
                let (mut path, mut build) = (f64::INFINITY, f64::INFINITY);
                for _ in 0..self.runs {
                    let (render, built) = self.render(&program, &scene)?;
                    (path, build) = (path.min(render / f64::from(SIZE * SIZE * SPP)), build.min(built));
                }
                let row = format!("| {} | {count} | {:.2} | {build:.2} |", series.name, 1e6 * path);
                println!("{row}");
                let _ = writeln!(table, "{row}");
                points.push([f64::from(count), 1e6 * path]);
                // The largest take gigabytes.
                fs::remove_dir_all(&scene)?;
            }
            lines.push(Line { name: series.name, points });
        }
        let out = self.out.unwrap_or(work);
        fs::create_dir_all(&out)?;
        let plot = svg("Growth", ["number", "microseconds a path"], &lines);
        fs::write(out.join("scaling.svg"), plot)?;
        let threads = self.threads;
        let head = format!(
            "# Growth\n\n{}, {}: the time of a path of {SIZE} x {SIZE} pixels and {SPP} samples, least of {} runs, with {threads} threads. \
             `cargo xtask bench scaling --threads {threads}`\n\n![The plot](scaling.svg)\n\n",
            date(SystemTime::now()),
            machine(),
            self.runs
        );
        fs::write(out.join("scaling.md"), head + &table)?;
        println!("\n{} and scaling.svg beside it", out.join("scaling.md").display());
        Ok(())
    }

    /// Seconds of rendering and of building.
    fn render(&self, program: &Path, scene: &Path) -> Result<(f64, f64)> {
        let statistics = scene.join("stats.json");
        let mut command = Command::new(program);
        command.arg("render").arg(scene.join("scene.pbrt")).arg("-o").arg(scene.join("out.pfm"));
        command.args([
            "--spp",
            &SPP.to_string(),
            "--threads",
            &self.threads.to_string(),
            "--denoise",
            "none",
        ]);
        command.args([
            "--progress",
            "none",
            "-q",
            "--max-memory",
            "64G",
            "--max-elements",
            "1000000000",
            "--stats",
        ]);
        let out = command.arg(&statistics).output().context("cannot start Lumbre")?;
        ensure!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        let statistics: Value = serde_json::from_slice(&fs::read(&statistics)?)?;
        let seconds = |name: &str| statistics["seconds"][name].as_f64().context("no seconds");
        Ok((seconds("render")?, seconds("build")?))
    }
}

/// The camera of fields that reach 50 in all directions.
const CAMERA: Camera = Camera { eye: [-8.0, 9.0, 44.0], target: [2.0, 0.0, 14.0], fov: 50.0 };

/// Places on a square grid over the field, and the distance between them.
fn lattice(count: u32) -> (impl Iterator<Item = [f64; 2]>, f64) {
    let side = f64::from(count).sqrt().ceil();
    let step = 100.0 / side;
    let place = move |i: u32| {
        let (column, row) = (f64::from(i) % side, (f64::from(i) / side).floor());
        [step * (column + 0.5) - 50.0, step * (row + 0.5) - 50.0]
    };
    ((0..count).map(place), step)
}

/// Lamps over a floor, as bright together whatever their number.
fn write_lights(count: u32, folder: &Path) -> Result<()> {
    let mut parts = Parts::default();
    parts.add(floor([-55.0, 55.0], 0.0, [-55.0, 55.0]), diffuse([0.5, 0.5, 0.5]));
    let (places, step) = lattice(count);
    let half = 0.1 * step.min(10.0);
    let mut lamps = Mesh::default();
    for [x, z] in places {
        lamps.add(&ceiling([x - half, x + half], 4.0, [z - half, z + half]));
    }
    parts.add_light(lamps, [10.0; 3]);
    write_scene(&parts.scene("lights", "", 3, CAMERA), SIZE, folder)
}

fn write_triangles(count: u32, folder: &Path) -> Result<()> {
    let columns = f64::from(count).sqrt().round() as u32;
    write_scene(&terrain(columns, (count / columns / 2).max(1)), SIZE, folder)
}

/// Balls on a floor.
fn write_instances(count: u32, folder: &Path) -> Result<()> {
    let (places, step) = lattice(count);
    let mut parts = Parts::default();
    parts.add(floor([-55.0, 55.0], 0.0, [-55.0, 55.0]), diffuse([0.5, 0.5, 0.5]));
    parts.add_light(ceiling([-30.0, 30.0], 30.0, [-30.0, 30.0]), [8.0; 3]);
    let mut scene = parts.scene("instances", "", 3, CAMERA);
    // The ball is written as the others are, and is an object of its own in the text.
    scene.materials.push(Material::Diffuse { reflectance: [0.6, 0.5, 0.4] });
    let material = scene.materials.len() - 1;
    scene.objects.push(Object { mesh: Mesh::ball([0.0, 1.0, 0.0], 1.0, 3), material, emission: None });
    write_with_instances(&scene, places, 0.4 * step.min(5.0), folder)
}

/// Writes a scene whose last mesh is instanced at places, in a size.
fn write_with_instances(
    scene: &Scene,
    places: impl Iterator<Item = [f64; 2]>,
    size: f64,
    folder: &Path,
) -> Result<()> {
    write_scene(scene, SIZE, folder)?;
    let text = fs::read_to_string(folder.join("scene.pbrt"))?;
    let begin = text.rfind("AttributeBegin").context("the scene has no shapes")?;
    let shape = &text[begin..];
    let mut out = format!("{}ObjectBegin \"ball\"\n{shape}ObjectEnd\n", &text[..begin]);
    for [x, z] in places {
        let _ = writeln!(
            out,
            "AttributeBegin\n  Translate {x} 0 {z}\n  Scale {size} {size} {size}\n  ObjectInstance \"ball\"\nAttributeEnd"
        );
    }
    fs::write(folder.join("scene.pbrt"), out)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_thing_has_a_place_of_its_own_in_the_field() {
        for count in [1, 10, 1000] {
            let (places, step) = lattice(count);
            let places: Vec<[f64; 2]> = places.collect();
            assert_eq!(places.len(), count as usize);
            assert!(places.iter().flatten().all(|x| x.abs() < 50.0));
            for (i, a) in places.iter().enumerate() {
                let is_apart = |b: &[f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]) > 0.99 * step;
                assert!(places[..i].iter().all(is_apart), "{count}");
            }
        }
    }

    #[test]
    fn scenes_have_as_many_things_as_they_say() {
        let desk = tempfile::tempdir().unwrap();
        write_instances(10, desk.path()).unwrap();
        let text = fs::read_to_string(desk.path().join("scene.pbrt")).unwrap();
        assert_eq!(text.matches("ObjectInstance").count(), 10);
        assert_eq!((text.matches("ObjectBegin").count(), text.matches("plymesh").count()), (1, 3));
        write_lights(10, desk.path()).unwrap();
        let mesh = fs::read(desk.path().join("mesh-1.ply")).unwrap();
        assert!(String::from_utf8_lossy(&mesh[..300]).contains("element face 20\n"));
    }
}
