//! The command: its arguments, and the answers to all rays of a file.

use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};

use clap::Args;
use lumbre::formats::{atomic_write, atomic_write_seek};
use lumbre::{CancelToken, Scene};
use rayon::ThreadPool;

use super::answers::Form;
use super::output::Output;
use super::pipeline;
use super::query::{Query, answer};
use super::rays::{self, RayReader};
use crate::failure::Failure;
use crate::output::{Inputs, Replaced};
use crate::progress::RayProgress;
use crate::reading::{ReadingArguments, print_warnings};
use crate::signals::Signals;
use crate::units;

#[cfg(test)]
#[path = "command_tests.rs"]
mod tests;

/// Casts rays into a scene, or queries it at points, in double precision.
#[derive(Args)]
#[command(after_help = "Examples:
  lumbre cast scene.pbrt --rays rays.csv
  lumbre cast scene.pbrt --rays rays.npy --query all -o hits.npz
  lumbre cast part.stl --points points.csv --query distance
  echo 'ox,oy,oz,dx,dy,dz
0,0,-5,0,0,1' | lumbre cast scene.pbrt --rays -

Rays: CSV with a header among ox,oy,oz,dx,dy,dz,tmin,tmax (tmin and tmax may be left out: 0 and inf), or a .npy array (N,6) or (N,8) of f4 or f8.
t is in units of the given direction, which need not have length 1. A ray with direction 0,0,0 misses.
Points, for closest-point, distance, inside and winding: CSV with a header x,y,z, or a .npy array (N,3).
Answers: ray,hit,t,px,py,pz,nx,ny,nz,u,v,front,shape,prim,instance (closest, all); ray,hit (any); ray,count (count);
point,found,distance,px,py,pz,shape,prim,instance (closest-point); point,distance; point,inside; point,winding.")]
pub(crate) struct Arguments {
    /// The scene.
    scene: PathBuf,
    /// The rays, or the points, CSV or .npy; - is standard input.
    #[arg(long, visible_alias = "points", value_name = "FILE")]
    rays: PathBuf,
    /// What to compute for each ray or point.
    #[arg(long, value_enum, default_value_t = Query::Closest)]
    query: Query,
    /// Where to write the answers, by extension .csv, .npy or .npz; standard output as CSV by default.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Threads; all cores by default.
    #[arg(long, value_name = "N", value_parser = units::whole(1_u16..=1024))]
    threads: Option<u16>,
    /// No warnings.
    #[arg(short, long)]
    quiet: bool,
    #[command(flatten)]
    reading: ReadingArguments,
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
        let written = self.write(rays, Output::csv(&mut out, self.query.table()), &mut failure);
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
                self.write(rays, Output::csv(out, table), &mut failure)
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
        let work = |piece: rays::Piece| {
            Ok(answer(self.scene, self.query, self.form, piece.first_ray, &decoder.rays(&piece)?)?)
        };
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
