//! `lumbre cast`: what rays hit.

use std::io::{self, ErrorKind, Write};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use lumbre::formats::{atomic_write, atomic_write_seek};
use lumbre::{CancelToken, Ray, Scene};
use rayon::ThreadPool;

mod answers;
mod array;
mod bytes;
mod csv;
mod npy;
mod output;
mod pipeline;
mod progress;
mod rays;
#[cfg(test)]
mod tests;

use answers::{Block, Form, Table};
use output::Output;
use progress::Progress;
use rays::RayReader;

use crate::failure::Failure;
use crate::overwrite::refuse_inputs;
use crate::reading::{ReadingArguments, print_warnings};
use crate::signals::Signals;

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
pub(crate) struct Arguments {
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
    /// No warnings.
    #[arg(short, long)]
    quiet: bool,
    #[command(flatten)]
    reading: ReadingArguments,
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
pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let form = match arguments.output.as_deref().map(Path::extension) {
        None => Form::Csv,
        Some(Some(extension)) if extension == "csv" => Form::Csv,
        Some(Some(extension)) if extension == "npy" => Form::Npy,
        Some(Some(extension)) if extension == "npz" => Form::Npz,
        Some(_) => {
            return Err(Failure::Usage("-o: expected a name that ends in .csv, .npy or .npz".to_owned()));
        }
    };
    if [&arguments.scene, &arguments.rays].iter().all(|path| path.as_path() == Path::new("-")) {
        return Err(Failure::Usage("the scene and --rays cannot both be standard input".to_owned()));
    }
    if let Some(output) = &arguments.output {
        refuse_inputs(output, [arguments.scene.as_path(), &arguments.rays])?;
    }
    let rays = RayReader::open(&arguments.rays)?;
    let (scene, diagnostics) = arguments.reading.open(std::slice::from_ref(&arguments.scene))?;
    if !arguments.quiet {
        print_warnings(&diagnostics);
    }
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(arguments.threads.map_or(0, usize::from))
        .build()
        .map_err(|e| Failure::Limit(format!("cannot start threads: {e}")))?;
    let progress = Progress::new(arguments.quiet);
    let query = arguments.query;
    let cast =
        Cast { scene: &scene, query, form, pool: &pool, progress: &progress, at_a_time: query.at_a_time() };
    let done = match &arguments.output {
        Some(path) => cast.to_file(rays, path),
        None => cast.to_standard_output(rays),
    };
    progress.finish();
    done
}

impl Query {
    /// What there is a line of for each answer.
    fn table(self) -> Table {
        match self {
            Self::Closest | Self::All => Table::Hits,
            Self::Any => Table::Numbers("hit"),
            Self::Count => Table::Numbers("count"),
        }
    }

    /// How many rays to work on at a time: enough for batches, and few where each may have many answers.
    fn at_a_time(self) -> usize {
        match self {
            Self::Closest | Self::Any => 4096,
            Self::Count => 1024,
            Self::All => 256,
        }
    }
}

/// What is asked, and how.
struct Cast<'a> {
    scene: &'a Scene,
    query: Query,
    form: Form,
    pool: &'a ThreadPool,
    progress: &'a Progress,
    /// How many rays a thread works on at a time, which changes no byte of the answers.
    at_a_time: usize,
}

impl Cast<'_> {
    fn to_standard_output(&self, rays: RayReader) -> Result<(), Failure> {
        let mut failure = None;
        let mut out = io::stdout().lock();
        let written = Output::csv(&mut out, self.query.table())
            .and_then(|output| self.write(rays, output, || Ok(()), &mut failure));
        match (failure, written) {
            (Some(failure), _) => Err(failure),
            // Whoever reads may stop reading: `lumbre cast … | head`.
            (None, Err(e)) if e.kind() != ErrorKind::BrokenPipe => {
                Err(Failure::Io(format!("standard output: {e}")))
            }
            (None, _) => Ok(()),
        }
    }

    fn to_file(&self, rays: RayReader, path: &Path) -> Result<(), Failure> {
        // An interrupted run must not leave its temporary file.
        let signals = Signals::listen(&CancelToken::new())
            .map_err(|e| Failure::Io(format!("cannot listen for signals: {e}")))?;
        let check = || signals.received().map_or(Ok(()), |status| Err(Failure::Interrupted(status)));
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let table = self.query.table();
        let mut failure = None;
        let written = match self.form {
            Form::Csv => atomic_write(path, |out: &mut dyn Write| {
                self.write(rays, Output::csv(out, table)?, check, &mut failure)
            }),
            form => atomic_write_seek(path, |file| {
                self.write(rays, Output::in_file(file, form, table, folder)?, check, &mut failure)
            }),
        };
        match failure {
            Some(failure) => Err(failure),
            None => written.map_err(|e| lumbre::Error::from(e).into()),
        }
    }

    /// Answers all rays. What is no error of writing is left in `failure`.
    fn write(
        &self,
        mut rays: RayReader,
        mut output: Output,
        check: impl Fn() -> Result<(), Failure>,
        failure: &mut Option<Failure>,
    ) -> io::Result<()> {
        let decoder = rays.decoder();
        let next = || {
            check()?;
            let piece = rays.next(self.at_a_time)?;
            if let Some(piece) = &piece {
                self.progress.show(piece.first_ray, rays.fraction());
            }
            Ok(piece)
        };
        let work = |piece: rays::Piece| Ok(self.answer(piece.first_ray, &decoder.rays(&piece)?));
        let done = pipeline::in_order(self.pool, next, work, |block| Ok(output.append(&block)?));
        match done.and_then(|()| Ok(check()?)) {
            Ok(()) => output.finish(),
            Err(Stop::Writing(e)) => Err(e),
            Err(Stop::Failure(e)) => {
                *failure = Some(e);
                Err(io::Error::other("stopped"))
            }
        }
    }

    fn answer(&self, first: u64, rays: &[Ray]) -> Block {
        let mut block = Block::new(self.form, self.query.table());
        match self.query {
            Query::Closest => {
                let hits = self.scene.closest_batch(rays);
                (first..).zip(&hits).for_each(|(ray, hit)| block.push_hit(ray, hit.as_ref()));
            }
            Query::Any => {
                let hits = self.scene.any_batch(rays);
                (first..).zip(hits).for_each(|(ray, hit)| block.push_number(ray, u64::from(hit)));
            }
            Query::All => (first..).zip(rays).for_each(|(i, ray)| {
                self.scene.all(ray, |hit| {
                    block.push_hit(i, Some(&hit));
                    ControlFlow::Continue(())
                });
            }),
            Query::Count => {
                (first..).zip(rays).for_each(|(i, ray)| block.push_number(i, self.scene.count(ray) as u64))
            }
        }
        block
    }
}

/// Why not all rays were answered.
enum Stop {
    Writing(io::Error),
    Failure(Failure),
}

impl From<io::Error> for Stop {
    fn from(error: io::Error) -> Self {
        Self::Writing(error)
    }
}

impl From<Failure> for Stop {
    fn from(failure: Failure) -> Self {
        Self::Failure(failure)
    }
}
