//! `lumbre cast`: ray queries.

use std::io::Write;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use lumbre::formats::{Budget, Input, Limits, atomic_write};
use lumbre::{Ray, Scene};
use rayon::prelude::*;

mod answers;
mod npy;
mod rays;

use answers::{Answer, Form};

use crate::failure::Failure;
use crate::reading::{ReadingArguments, print_warnings};

/// Casts rays into a scene, in double precision.
#[derive(Args)]
#[command(after_help = "Examples:
  lumbre cast scene.pbrt --rays rays.csv
  lumbre cast scene.pbrt --rays rays.npy --query all -o hits.npz
  echo 'ox,oy,oz,dx,dy,dz
0,0,-5,0,0,1' | lumbre cast scene.pbrt --rays -

Rays: CSV with a header among ox,oy,oz,dx,dy,dz,tmin,tmax (tmin and tmax may be left out: 0 and inf), or a .npy array (N,6) or (N,8) of f4 or f8.
t is in units of the given direction, which need not have length 1.
Answers: ray,hit,t,px,py,pz,nx,ny,nz,u,v,front,shape,prim,instance (closest, all); ray,hit (any); ray,count (count).")]
pub struct Arguments {
    /// The scene.
    scene: PathBuf,
    /// The rays, CSV or .npy; - is standard input.
    #[arg(long, value_name = "FILE")]
    rays: PathBuf,
    /// What to ask of each ray.
    #[arg(long, value_enum, default_value_t = Query::Closest)]
    query: Query,
    /// Where to write the answers, by extension .csv, .npy or .npz; standard output as CSV by default.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Threads; all cores by default.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    #[command(flatten)]
    reading: ReadingArguments,
    /// Print no warnings.
    #[arg(short, long)]
    quiet: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Query {
    /// The first hit.
    Closest,
    /// Whether there is a hit.
    Any,
    /// Every hit, by t.
    All,
    /// How many hits there are.
    Count,
}

/// Runs the command.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let form = match arguments.output.as_deref().map(Path::extension) {
        None => Form::Csv,
        Some(Some(extension)) if extension == "csv" => Form::Csv,
        Some(Some(extension)) if extension == "npy" => Form::Npy,
        Some(Some(extension)) if extension == "npz" => Form::Npz,
        Some(_) => {
            return Err(Failure::Usage("-o: expected a name that ends in .csv, .npy or .npz".to_owned()));
        }
    };
    let rays = read_rays(&arguments.rays)?;
    let (scene, diagnostics) = arguments.reading.open(std::slice::from_ref(&arguments.scene))?;
    if !arguments.quiet {
        print_warnings(&diagnostics);
    }
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(arguments.threads.map_or(0, usize::from))
        .build()
        .map_err(|e| Failure::Limit(format!("cannot start threads: {e}")))?;
    let answers = pool.install(|| answer(&scene, arguments.query, &rays));

    let mut bytes = Vec::new();
    answers.write(&mut bytes, form).map_err(|e| Failure::Io(e.to_string()))?;
    match &arguments.output {
        Some(path) => atomic_write(path, |file| file.write_all(&bytes))
            .map_err(|e| Failure::from(lumbre::Error::from(e))),
        None => match std::io::stdout().lock().write_all(&bytes) {
            // The reader may close the pipe: `lumbre cast … | head`.
            Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => {
                Err(Failure::Io(format!("standard output: {e}")))
            }
            _ => Ok(()),
        },
    }
}

fn read_rays(path: &Path) -> Result<Vec<Ray>, Failure> {
    let budget = Budget::new(Limits::default());
    let input = if path == Path::new("-") {
        Input::from_reader("standard input", std::io::stdin(), &budget)
    } else {
        Input::open(path, &budget)
    };
    let input = input.map_err(|e| Failure::from(lumbre::Error::from(e)))?;
    rays::read(input.name(), &input)
}

/// The results of a query, in the order of the rays.
enum Answers {
    Hits(Vec<Answer>),
    Numbers(&'static str, Vec<u64>),
}

impl Answers {
    fn write(&self, out: &mut Vec<u8>, form: Form) -> std::io::Result<()> {
        match self {
            Self::Hits(answers) => answers::write(out, form, answers),
            Self::Numbers(name, numbers) => answers::write_counts(out, form, name, numbers),
        }
    }
}

fn answer(scene: &Scene, query: Query, rays: &[Ray]) -> Answers {
    let numbered = || rays.par_iter().enumerate().map(|(i, ray)| (i as u64, ray));
    match query {
        Query::Closest => {
            Answers::Hits(numbered().map(|(i, ray)| Answer { ray: i, hit: scene.closest(ray) }).collect())
        }
        Query::Any => Answers::Numbers("hit", numbered().map(|(_, ray)| u64::from(scene.any(ray))).collect()),
        Query::All => Answers::Hits(
            numbered()
                .flat_map_iter(|(i, ray)| {
                    let mut found = Vec::new();
                    scene.all(ray, |hit| {
                        found.push(Answer { ray: i, hit: Some(hit) });
                        ControlFlow::Continue(())
                    });
                    found
                })
                .collect(),
        ),
        Query::Count => {
            Answers::Numbers("count", numbered().map(|(_, ray)| scene.count(ray) as u64).collect())
        }
    }
}
