//! The kernel's speed against Embree 4 and the crates `obvhs` and `bvh`, on the same scenes and the same rays:
//! `cargo xtask bench kernel`.
//!
//! Every program gets the same triangles and rays, to the bit, in single precision. Lumbre takes them as they are, by
//! its queries in single precision, and as a peer of itself in double precision; watertight both. Programs run in
//! alternation; a ratio is the median of the ratios of neighbouring runs, and its spread half their interquartile
//! range. Rays are cut into chunks that threads take in turn. What is measured is how long threads ran (see `clock`).
//! Not timed: the conversion of scenes and rays to the form of a program, and making its answers empty again.

mod clock;
mod crates;
mod embree;
mod files;
mod measure;
mod oracle;
mod ours;
mod program;
mod rays;
mod report;
mod rust_heap;
mod scene;
mod shaping;
mod worlds;

use std::path::PathBuf;
use std::time::{Duration, Instant};

use anyhow::{Result, bail};
use clap::Parser;
use lumbre_geometry::Ray;
use lumbre_kernel::Preset;

use embree::{Embree, Setting};
use measure::{Job, Ratio, alternate, median};
use oracle::Sample;
use ours::{Asked, Precision};
use program::{Built, Bytes, Program, Query};
use rays::{PictureSize, Rays, Work};
use report::{Mismatches, Report, Row};
use scene::Scene;
use worlds::RECIPES;

#[derive(Parser)]
#[command(
    name = "cargo xtask bench kernel",
    about = "How fast the kernel is beside others, on the same rays"
)]
struct Options {
    /// Writes the figures to this file.
    #[arg(long)]
    json: Option<PathBuf>,
    /// Small scenes and few rays: ends within a minute.
    #[arg(long)]
    quick: bool,
    /// Only scenes whose name contains this; may be repeated.
    #[arg(long)]
    scene: Vec<String>,
    /// Only work whose name contains this: primary, bounce 1, bounce 3, shadow, short ao, random; or `build`
    /// for no rays at all; may be repeated.
    #[arg(long)]
    work: Vec<String>,
    /// Only peers whose name contains this; `none` for none; may be repeated.
    #[arg(long)]
    peer: Vec<String>,
    /// Numbers of threads.
    #[arg(long, value_delimiter = ',', default_values_t = [1, 2], value_parser = clap::value_parser!(u16).range(1..))]
    threads: Vec<u16>,
    /// A further mesh (.ply, .obj, .stl); may be repeated.
    #[arg(long)]
    mesh: Vec<PathBuf>,
    /// About how many rays of each kind.
    #[arg(long)]
    rays: Option<usize>,
    /// Seconds for each line of the table.
    #[arg(long)]
    seconds: Option<f64>,
    /// How Lumbre builds its trees: fast, balanced or best.
    #[arg(long, default_value = "balanced", value_parser = preset)]
    preset: Preset,
    /// Lumbre takes rays by batches, on every thread, and not one at a time; those of pixels by squares of four by
    /// four.
    #[arg(long)]
    batches: bool,
    /// Lumbre takes rays in double precision.
    #[arg(long)]
    double: bool,
    /// Peers are Lumbre itself, asked otherwise; all take rays in double precision, but for two: by batches, with each
    /// ray written just before, in double precision alone, with options, with masks, but for a primitive, with a
    /// closure, with vertices in double precision, in single precision alone, which leaks, and with rays in single
    /// precision, also each written just before. The ratios are what that costs.
    #[arg(long, conflicts_with = "batches")]
    costs: bool,
    /// Lumbre keeps every sphere as a shape of its own, not in a cloud.
    #[arg(long)]
    placed_spheres: bool,
    /// Names the scenes and ends.
    #[arg(long)]
    list: bool,
}

fn preset(name: &str) -> Result<Preset, String> {
    match name {
        "fast" => Ok(Preset::Fast),
        "balanced" => Ok(Preset::Balanced),
        "best" => Ok(Preset::Best),
        _ => Err("it is fast, balanced or best".to_owned()),
    }
}

/// How much is measured.
struct Plan {
    works: Vec<Work>,
    threads: Vec<usize>,
    size: PictureSize,
    line: Duration,
    oracle_tests: usize,
    deadline: Option<Instant>,
}

impl Plan {
    fn is_over(&self) -> bool {
        self.deadline.is_some_and(|deadline| Instant::now() > deadline)
    }
}

/// Where the triangles come from.
enum Source {
    Made(&'static worlds::Recipe),
    File(PathBuf),
}

impl Source {
    fn name(&self) -> String {
        match self {
            Self::Made(recipe) => recipe.name.to_owned(),
            Self::File(path) => files::name(path),
        }
    }

    fn scene(&self) -> Result<Scene> {
        match self {
            Self::Made(recipe) => Ok(recipe.make()),
            Self::File(path) => files::read(path),
        }
    }
}

fn main() -> Result<()> {
    let start = Instant::now();
    let options = Options::parse();
    let sources = sources(&options);
    if options.list {
        for source in &sources {
            println!("{}", source.name());
        }
        return Ok(());
    }
    if sources.is_empty() {
        bail!("no scene is called {}: see --list", options.scene.join(" or "));
    }
    let is_wanted =
        |wanted: &[String], name: &str| wanted.is_empty() || wanted.iter().any(|part| name.contains(part));
    let works: Vec<_> = Work::ALL.into_iter().filter(|work| is_wanted(&options.work, work.name())).collect();
    if works.is_empty() && options.work != ["build"] {
        bail!("no work is called {}", options.work.join(" or "));
    }
    let mut threads: Vec<_> = options.threads.iter().map(|&count| usize::from(count)).collect();
    // Ascending: a device of Embree's that has more threads gives them to all.
    threads.sort_unstable();
    threads.dedup();
    let seconds = options.seconds.unwrap_or(if options.quick { 0.05 } else { 1.0 });
    let Ok(line) = Duration::try_from_secs_f64(seconds) else {
        bail!("--seconds {seconds} is no time");
    };
    let count = options.rays.unwrap_or(if options.quick { 12_000 } else { 130_000 });
    let plan = Plan {
        works,
        threads,
        size: PictureSize::of_about(count.clamp(32, 1 << 26)),
        line,
        oracle_tests: if options.quick { 20_000_000 } else { 400_000_000 },
        deadline: options.quick.then(|| start + Duration::from_secs(40)),
    };

    let lumbre = ours::Lumbre {
        preset: options.preset,
        asked: if options.batches { Asked::ByBatches } else { Asked::Each },
        precision: if options.double || options.costs { Precision::Double } else { Precision::Single },
        places_spheres: options.placed_spheres,
    };
    let mut programs: Vec<Box<dyn Program>> = vec![Box::new(lumbre)];
    let peers = if options.costs {
        let others = Asked::OTHERS.into_iter().map(|asked| ours::Lumbre { asked, ..lumbre });
        let single = ours::Lumbre { precision: Precision::Single, ..lumbre };
        others
            .chain([single, ours::Lumbre { asked: Asked::Fresh, ..single }])
            .map(|other| Box::new(other) as Box<dyn Program>)
            .collect()
    } else {
        let mut peers = peers()?;
        if !options.double {
            peers.push(Box::new(ours::Lumbre { precision: Precision::Double, ..lumbre }));
        }
        peers
    };
    programs.extend(peers.into_iter().filter(|peer| is_wanted(&options.peer, &peer.name())));

    println!("{}, {}", report::machine(), report::today());
    println!("Mray/s; in brackets the ratio, more than 1 where Lumbre is faster or smaller, and its spread");
    let mut report = Report::default();
    for source in &sources {
        if plan.is_over() {
            println!("\n{}: left out, the time is up", source.name());
            continue;
        }
        measure_scene(&source.scene()?, &programs, &plan, &mut report)?;
    }
    report.print_means();
    if let Some(path) = &options.json {
        report.write(path)?;
    }
    Ok(())
}

/// What is to be measured.
fn sources(options: &Options) -> Vec<Source> {
    let made = RECIPES.iter().filter(|recipe| !options.quick || recipe.is_quick).map(Source::Made);
    let found = files::found().into_iter().filter(|_| !options.quick).map(Source::File);
    let is_wanted = |source: &Source| {
        options.scene.is_empty() || options.scene.iter().any(|part| source.name().contains(part))
    };
    let given = options.mesh.iter().cloned().map(Source::File);
    let mut sources: Vec<_> = made.chain(found).filter(is_wanted).collect();
    // Named scenes are measured even in a hurry.
    if sources.is_empty() {
        sources = RECIPES.iter().map(Source::Made).filter(is_wanted).collect();
    }
    sources.extend(given);
    sources
}

/// Who else takes part. Embree does where `EMBREE_LIB` says where it is.
fn peers() -> Result<Vec<Box<dyn Program>>> {
    let mut peers: Vec<Box<dyn Program>> = Vec::new();
    match std::env::var_os("EMBREE_LIB") {
        Some(path) => {
            let settings =
                [Setting::Default, Setting::High, Setting::Robust, Setting::Compact, Setting::Packets];
            for embree in Embree::load(&path, &settings)? {
                peers.push(Box::new(embree));
            }
        }
        None => println!("Embree is left out: EMBREE_LIB does not name its shared library (libembree4)"),
    }
    peers.push(Box::new(crates::Obvhs));
    peers.push(Box::new(crates::BinaryBvh));
    Ok(peers)
}

/// What a scene's programs answered, and how that compares.
struct Tally {
    sampled: usize,
    wrong: usize,
    compared: usize,
    differing: usize,
}

fn measure_scene(
    scene: &Scene,
    programs: &[Box<dyn Program>],
    plan: &Plan,
    report: &mut Report,
) -> Result<()> {
    println!("\n{}: {}", scene.name, scene.contents());
    let mut taking: Vec<&dyn Program> = Vec::new();
    for program in programs {
        match program.refuses(scene) {
            None => taking.push(&**program),
            Some(why) => println!("{} is left out: {why}", program.name()),
        }
    }
    let accel = ours::build(scene, Preset::Balanced)?;
    let extent = accel.bounds().size().max_element();
    let lists: Vec<_> =
        plan.works.iter().map(|&work| (work, rays::make(work, scene, &accel, plan.size))).collect();
    drop(accel);

    print_head(&taking);
    let trees = measure_builds(scene, &taking, plan, report)?;
    let mut tallies: Vec<_> =
        taking.iter().map(|_| Tally { sampled: 0, wrong: 0, compared: 0, differing: 0 }).collect();
    for (work, rays) in &lists {
        let list = &rays.list;
        if list.is_empty() {
            println!("{}: no ray hits anything to start from", work.name());
            continue;
        }
        let wide: Vec<Ray> = list.iter().map(|ray| ray.to_f64()).collect();
        let truths = oracle::sample(scene, &wide, plan.oracle_tests / (lists.len() * 2));
        let case = Case { scene, taking: &taking, trees: &trees, work: *work, rays, wide: &wide, extent };
        for query in Query::ALL {
            if plan.is_over() {
                println!("{} {}: left out, the time is up", work.name(), query.name());
                continue;
            }
            case.measure(query, &truths, plan, &mut tallies, report)?;
        }
    }
    println!("{:<34} wrong of those tried by a loop in f64; other than Lumbre's of all", "answers");
    for (program, tally) in taking.iter().zip(&tallies) {
        let name = program.name();
        println!(
            "{name:<34} {} of {}; {} of {}",
            tally.wrong, tally.sampled, tally.differing, tally.compared
        );
        report.mismatches.push(Mismatches {
            scene: scene.name.clone(),
            program: name,
            sampled: tally.sampled,
            wrong: tally.wrong,
            compared: tally.compared,
            differing: tally.differing,
        });
    }
    Ok(())
}

/// Builds in alternation on every number of threads, and keeps the last trees.
fn measure_builds<'a>(
    scene: &'a Scene,
    taking: &[&'a dyn Program],
    plan: &Plan,
    report: &mut Report,
) -> Result<Vec<Built<'a>>> {
    let millions = scene.primitive_count() as f64 / 1e6;
    let least = if millions > 2.0 { 1 } else { 3 };
    let mut trees: Vec<Option<Built<'a>>> = taking.iter().map(|_| None).collect();
    for &threads in &plan.threads {
        let trees = &mut trees;
        let rounds = rust_heap::asking(threads, move || {
            let mut build = |i: usize| {
                // The old tree goes before the new one comes.
                trees[i] = None;
                let built = taking[i].build(scene, threads)?;
                let seconds = built.seconds;
                trees[i] = Some(built);
                Ok::<_, anyhow::Error>(seconds)
            };
            if millions <= 2.0 && !plan.is_over() {
                for i in 0..taking.len() {
                    build(i)?;
                }
            }
            alternate(taking.len(), least, plan.line, plan.deadline, build)
        })??;
        let line = Line { scene, taking, work: "build".to_owned(), unit: "Mprim/s", threads };
        let speed = |i: usize| millions / median(rounds.iter().map(|round| round[i]));
        let ratio = |i: usize| Ratio::of(rounds.iter().map(|round| (round[0], round[i])));
        line.put(&(0..taking.len()).collect::<Vec<_>>(), speed, ratio, report);
    }
    let trees: Vec<_> = trees.into_iter().flatten().collect();
    type Of = fn(&Bytes) -> usize;
    let sizes: [(&str, Of); 2] =
        [("bytes a primitive", |bytes| bytes.kept), ("peak bytes a primitive", |bytes| bytes.peak)];
    let threads = plan.threads.last().copied().unwrap_or(1);
    for (work, of) in sizes {
        let each = |i: usize| of(&trees[i].bytes) as f64 / scene.primitive_count() as f64;
        let ratio = |i: usize| Ratio { median: each(i) / each(0), spread: 0.0 };
        let line = Line { scene, taking, work: work.to_owned(), unit: "B", threads };
        line.put(&(0..taking.len()).collect::<Vec<_>>(), each, ratio, report);
    }
    Ok(trees)
}

/// One kind of rays in one scene.
struct Case<'a> {
    scene: &'a Scene,
    taking: &'a [&'a dyn Program],
    trees: &'a [Built<'a>],
    work: Work,
    rays: &'a Rays,
    wide: &'a [Ray],
    extent: f64,
}

impl Case<'_> {
    fn measure(
        &self,
        query: Query,
        truths: &[Sample],
        plan: &Plan,
        tallies: &mut [Tally],
        report: &mut Report,
    ) -> Result<()> {
        let programs: Vec<usize> = (0..self.taking.len())
            .filter(|&i| self.work == Work::Primary || !self.taking[i].takes_packets())
            .collect();
        let Rays { list, by_squares } = self.rays;
        let in_squares = |i: usize| self.taking[i].takes_squares();
        let mut jobs: Vec<Job> = programs
            .iter()
            .map(|&i| {
                let tree = &*self.trees[i].tree;
                if in_squares(i) {
                    let list: Vec<_> = by_squares.iter().map(|&place| list[place]).collect();
                    Job::new(tree, query, &list)
                } else {
                    Job::new(tree, query, list)
                }
            })
            .collect();

        // Answers in the order of the list, from a first run that also warms the caches.
        let answers: Vec<Vec<Option<f64>>> = programs
            .iter()
            .zip(&mut jobs)
            .map(|(&i, job)| {
                job.run(1);
                let found = job.answers();
                if !in_squares(i) {
                    return found;
                }
                let mut ordered = vec![None; found.len()];
                for (answer, &place) in found.into_iter().zip(by_squares) {
                    ordered[place] = answer;
                }
                ordered
            })
            .collect();
        for (&i, found) in programs.iter().zip(&answers) {
            let tally = &mut tallies[i];
            tally.sampled += truths.len();
            tally.compared += found.len();
            tally.differing += oracle::differences(query, self.wide, &answers[0], found, self.extent);
            tally.wrong += truths
                .iter()
                .filter(|sample| {
                    let length = self.wide[sample.index].direction.length();
                    !sample.truth.agrees(query, found[sample.index], length, self.extent)
                })
                .count();
        }

        for &threads in &plan.threads {
            let rounds = alternate(jobs.len(), 3, plan.line, plan.deadline, |i| {
                Ok::<_, anyhow::Error>(jobs[i].run(threads))
            })?;
            let line = Line {
                scene: self.scene,
                taking: self.taking,
                work: format!("{} {}", query.name(), self.work.name()),
                unit: "Mray/s",
                threads,
            };
            let speed = |i: usize| jobs[i].speed(median(rounds.iter().map(|round| round[i])));
            let ratio = |i: usize| Ratio::of(rounds.iter().map(|round| (round[0], round[i])));
            line.put(&programs, speed, ratio, report);
        }
        Ok(())
    }
}

fn print_head(taking: &[&dyn Program]) {
    print!("{:<25} {:>7}", "", "threads");
    for program in taking {
        print!(" {:>22}", program.name());
    }
    println!();
}

/// A line of the table.
struct Line<'a> {
    scene: &'a Scene,
    taking: &'a [&'a dyn Program],
    work: String,
    unit: &'static str,
    threads: usize,
}

impl Line<'_> {
    /// Prints it and writes it down. `programs` says which have a figure, Lumbre first; `figure` and `ratio` are asked
    /// by the position in it.
    fn put(
        &self,
        programs: &[usize],
        figure: impl Fn(usize) -> f64,
        ratio: impl Fn(usize) -> Ratio,
        report: &mut Report,
    ) {
        let row = |peer| Row {
            scene: self.scene.name.clone(),
            work: self.work.clone(),
            unit: self.unit,
            threads: self.threads,
            lumbre: figure(0),
            peer,
        };
        print!("{:<25} {:>7} {:>22.2}", self.work, self.threads, figure(0));
        for i in 1..self.taking.len() {
            let Some(place) = programs.iter().position(|&program| program == i) else {
                print!(" {:>22}", "");
                continue;
            };
            let (figure, ratio) = (figure(place), ratio(place));
            print!(" {:>22}", format!("{figure:.2} ({:.2} ±{:.2})", ratio.median, ratio.spread));
            report.rows.push(row(Some((self.taking[i].name(), figure, ratio))));
        }
        println!();
        if programs.len() == 1 {
            report.rows.push(row(None));
        }
    }
}
