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
mod rays;
#[cfg(test)]
mod tests;

use answers::{Block, Form, Table};
use output::Output;
use rays::{RayReader, Rows};

use crate::failure::Failure;
use crate::output::{Inputs, Replaced};
use crate::progress::RayProgress;
use crate::reading::{ReadingArguments, print_warnings};
use crate::signals::Signals;

/// Casts rays into a scene, or asks what is at points, in double precision.
#[derive(Args)]
#[command(after_help = "Examples:
  lumbre cast scene.pbrt --rays rays.csv
  lumbre cast scene.pbrt --rays rays.npy --query all -o hits.npz
  lumbre cast part.stl --points points.csv --query distance
  echo 'ox,oy,oz,dx,dy,dz
0,0,-5,0,0,1' | lumbre cast scene.pbrt --rays -

Rays: CSV with a header among ox,oy,oz,dx,dy,dz,tmin,tmax (tmin and tmax may be left out: 0 and inf), or a .npy array (N,6) or (N,8) of f4 or f8.
t is in units of the given direction, which need not have length 1.
Points, for closest-point, distance, inside and winding: CSV with a header x,y,z, or a .npy array (N,3).
Answers: ray,hit,t,px,py,pz,nx,ny,nz,u,v,front,shape,prim,instance (closest, all); ray,hit (any); ray,count (count);
point,found,distance,px,py,pz,shape,prim,instance (closest-point); point,distance; point,inside; point,winding.")]
pub(crate) struct Arguments {
    /// The scene.
    scene: PathBuf,
    /// The rays, or the points, CSV or .npy; - is standard input.
    #[arg(long, visible_alias = "points", value_name = "FILE")]
    rays: PathBuf,
    /// What to ask of each ray or point.
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
    /// Of a point: the nearest point of all surfaces.
    ClosestPoint,
    /// Of a point: how far away that is.
    Distance,
    /// Of a point: whether it is inside of what stands there.
    Inside,
    /// Of a point: how often surfaces wind around it, 1 within a closed body.
    Winding,
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
    // Some of the answers are of no use: an interrupted run leaves none, nor its temporary file.
    let _signals = Signals::listen(&CancelToken::new())?;
    let named = [arguments.scene.as_path(), &arguments.rays];
    if let Some(output) = &arguments.output {
        Inputs::of(named).refuse(output)?;
    }
    let rays = RayReader::open(&arguments.rays, arguments.query.rows())?;
    let (scene, diagnostics) = arguments.reading.open(std::slice::from_ref(&arguments.scene))?;
    if let Some(output) = &arguments.output {
        Inputs::of(diagnostics.files_read().iter().map(PathBuf::as_path)).refuse(output)?;
    }
    if !arguments.quiet {
        print_warnings(&diagnostics);
    }
    // Where the system refuses threads, fewer do, or else this one does the work.
    let wanted = arguments.threads.map_or_else(rayon::current_num_threads, usize::from);
    let fewer = |&threads: &usize| (threads > 1).then_some(threads / 2);
    let pool = std::iter::successors(Some(wanted), fewer)
        .find_map(|threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().ok());
    let progress = RayProgress::new(arguments.quiet);
    let query = arguments.query;
    let cast = Cast {
        scene: &scene,
        query,
        form,
        pool: pool.as_ref(),
        progress: &progress,
        at_a_time: query.at_a_time(),
    };
    let replaced = arguments.output.as_deref().map(Replaced::by);
    let done = match &arguments.output {
        Some(path) => cast.to_file(rays, path),
        None => cast.to_standard_output(rays),
    };
    progress.finish();
    if let (Ok(()), Some(replaced), false) = (&done, replaced, arguments.quiet) {
        replaced.say();
    }
    done
}

impl Query {
    /// What there is a line of for each answer.
    fn table(self) -> Table {
        match self {
            Self::Closest | Self::All => Table::Hits,
            Self::Any => Table::Numbers("hit"),
            Self::Count => Table::Numbers("count"),
            Self::ClosestPoint => Table::Nearest,
            Self::Distance => Table::Reals("distance"),
            Self::Inside => Table::Flags("inside"),
            Self::Winding => Table::Reals("winding"),
        }
    }

    /// What it is asked of.
    fn rows(self) -> Rows {
        match self {
            Self::Closest | Self::Any | Self::All | Self::Count => Rows::Rays,
            Self::ClosestPoint | Self::Distance | Self::Inside | Self::Winding => Rows::Points,
        }
    }

    /// How many rays to work on at a time: enough for batches, and few where each may have many answers.
    fn at_a_time(self) -> usize {
        match self {
            Self::Closest | Self::Any => 4096,
            Self::Count => 1024,
            Self::All | Self::ClosestPoint | Self::Distance | Self::Inside | Self::Winding => 256,
        }
    }
}

/// What is asked, and how.
struct Cast<'a> {
    scene: &'a Scene,
    query: Query,
    form: Form,
    pool: Option<&'a ThreadPool>,
    progress: &'a RayProgress,
    /// How many rays a thread works on at a time, which changes no byte of the answers.
    at_a_time: usize,
}

impl Cast<'_> {
    fn to_standard_output(&self, rays: RayReader) -> Result<(), Failure> {
        let mut failure = None;
        let mut out = io::stdout().lock();
        let written = Output::csv(&mut out, self.query.table())
            .and_then(|output| self.write(rays, output, &mut failure));
        match (failure, written) {
            (Some(failure), _) => Err(failure),
            // The reader may stop early: `lumbre cast … | head`.
            (None, Err(e)) if e.kind() != ErrorKind::BrokenPipe => {
                Err(Failure::Io(format!("standard output: {e}")))
            }
            (None, _) => Ok(()),
        }
    }

    fn to_file(&self, rays: RayReader, path: &Path) -> Result<(), Failure> {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let table = self.query.table();
        let mut failure = None;
        let written = match self.form {
            Form::Csv => atomic_write(path, |out: &mut dyn Write| {
                self.write(rays, Output::csv(out, table)?, &mut failure)
            }),
            form => atomic_write_seek(path, |file| {
                self.write(rays, Output::in_file(file, form, table, folder)?, &mut failure)
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
        failure: &mut Option<Failure>,
    ) -> io::Result<()> {
        let decoder = rays.decoder();
        let next = || {
            let piece = rays.next(self.at_a_time)?;
            if let Some(piece) = &piece {
                self.progress.show(piece.first_ray, rays.fraction());
            }
            Ok(piece)
        };
        let work = |piece: rays::Piece| Ok(self.answer(piece.first_ray, &decoder.rays(&piece)?)?);
        let done = pipeline::in_order(self.pool, next, work, |block| Ok(output.append(&block)?));
        match done {
            Ok(()) => output.finish(),
            Err(Stop::Writing(e)) => Err(e),
            Err(Stop::Failure(e)) => {
                *failure = Some(e);
                Err(io::Error::other("stopped"))
            }
        }
    }

    /// # Errors
    /// Where there is no answer for a point.
    fn answer(&self, first: u64, rays: &[Ray]) -> Result<Block, Failure> {
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
            Query::ClosestPoint | Query::Distance => {
                for (i, point) in (first..).zip(rays) {
                    let nearest = self.scene.closest_point(point.origin, f64::INFINITY)?;
                    match self.query {
                        Query::Distance => {
                            block.push_real(i, nearest.map_or(f64::INFINITY, |nearest| nearest.distance));
                        }
                        _ => block.push_nearest(i, nearest.as_ref()),
                    }
                }
            }
            Query::Inside => (first..)
                .zip(rays)
                .for_each(|(i, point)| block.push_flag(i, self.scene.is_inside(point.origin))),
            Query::Winding => {
                for (i, point) in (first..).zip(rays) {
                    block.push_real(i, self.scene.winding_number(point.origin)?);
                }
            }
        }
        Ok(block)
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
