#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
//! The `lumbre` program: render, view, cast, info, diff, merge, explain, math. It is a library so that other front
//! ends, such as the Python package, bring the same program.
//!
//! # Streams of rays
//!
//! `lumbre cast` never holds its list of rays, so memory does not grow with it (`cast/`). A reader takes some thousand
//! rays off the input as bytes; a thread of the pool decodes them, asks the scene and encodes the answers;
//! `cast/pipeline.rs` passes the blocks on in the order of the rays; `cast/output.rs` appends them. What an output must
//! state first is written last: the header of a .npy again at the end, and the columns of a .npz from a temporary file
//! each. Arrays in Fortran order are read by position, from a temporary file if they come through a pipe. The size of a
//! block and the number of threads change no byte.
//!
//! # Explanations
//!
//! `lumbre explain` computes nothing that a render does not. `Shape::explain` (`lumbre-geometry`) is built from the
//! pieces of the ray tests and ends with what the ray test returns; a contract test compares both to the bit. The light
//! comes from the integrators themselves, which log events to an optional journal (`lumbre-render`,
//! `transport/journal.rs`). `Accel::target` says which shape was hit, and under which transforms. `explain/document.rs`
//! holds sections of quantities; `english.rs` and `spanish.rs` have the words, `formula.rs` puts numbers into formulas,
//! `writing.rs` and `html.rs` write them.
//!
//! # WebAssembly
//!
//! There the library has what needs no system: the answers of cast, explain and math.

#![cfg_attr(
    target_family = "wasm",
    allow(dead_code, reason = "the arguments of commands are not parsed there")
)]

#[cfg(not(target_family = "wasm"))]
use std::ffi::OsString;

#[cfg(not(target_family = "wasm"))]
use clap::{CommandFactory, Parser, Subcommand};
#[cfg(not(target_family = "wasm"))]
use lumbre_simd::InstructionSet;

/// Prints a message to standard error, ignoring errors.
#[cfg(not(target_family = "wasm"))]
macro_rules! say {
    ($($what:tt)*) => { $crate::console::tell(&format!($($what)*)) };
}

#[cfg(not(target_family = "wasm"))]
mod animation;
mod cast;
#[cfg(not(target_family = "wasm"))]
mod checkpoint;
#[cfg(not(target_family = "wasm"))]
mod completions;
mod console;
#[cfg(not(target_family = "wasm"))]
mod denoiser;
#[cfg(not(target_family = "wasm"))]
mod diff;
mod explain;
mod failure;
#[cfg(not(target_family = "wasm"))]
mod farm;
#[cfg(not(target_family = "wasm"))]
mod info;
mod language;
mod math;
#[cfg(not(target_family = "wasm"))]
mod memory;
#[cfg(not(target_family = "wasm"))]
mod merge;
#[cfg(not(target_family = "wasm"))]
mod names;
#[cfg(not(target_family = "wasm"))]
mod oidn;
#[cfg(not(target_family = "wasm"))]
mod output;
#[cfg(not(target_family = "wasm"))]
mod povray;
#[cfg(not(target_family = "wasm"))]
mod preview;
#[cfg(not(target_family = "wasm"))]
mod progress;
#[cfg(not(target_family = "wasm"))]
mod reading;
#[cfg(not(target_family = "wasm"))]
mod render;
#[cfg(not(target_family = "wasm"))]
mod report;
#[cfg(not(target_family = "wasm"))]
mod short_help;
#[cfg(not(target_family = "wasm"))]
mod shown;
#[cfg(not(target_family = "wasm"))]
mod signals;
#[cfg(not(target_family = "wasm"))]
mod spanish;
#[cfg(not(target_family = "wasm"))]
mod spanish_messages;
#[cfg(not(target_family = "wasm"))]
mod staging;
#[cfg(not(target_family = "wasm"))]
mod tev;
#[cfg(not(target_family = "wasm"))]
mod threads;
#[cfg(not(target_family = "wasm"))]
mod tips;
mod units;
#[cfg(not(target_family = "wasm"))]
mod verb;
#[cfg(not(target_family = "wasm"))]
mod view;
#[cfg(not(target_family = "wasm"))]
mod viewing;

pub use cast::{Query, cast};
#[cfg(not(target_family = "wasm"))]
pub use explain::program::Explainer;
pub use explain::{Digits, Format, Request, SceneNames, explain};
pub use failure::Failure;
pub use language::Language;
pub use math::calculate;
#[cfg(not(target_family = "wasm"))]
pub use memory::{check_picture, memory_left};

/// Renders scenes, casts rays into them, says what is in them, and compares and joins pictures.
#[cfg(not(target_family = "wasm"))]
#[derive(Parser)]
#[command(name = "lumbre", version, about, max_term_width = 110)]
#[command(
    override_usage = "lumbre SCENE… [OPTIONS]      a picture of it, as lumbre render\n       lumbre <COMMAND> …"
)]
#[command(mut_subcommand("view", without_turntable))]
#[command(mut_subcommand("explain", |command| without_turntable(command)))]
#[command(after_help = "Examples:
  lumbre model.glb                              a picture of a model: without a command, files are rendered
  lumbre render scene.pbrt                      a picture under the scene's own film name
  lumbre render model.obj --size 800x600        a model, framed and lit
  lumbre view scene.pbrt                        the picture in the browser, live
  lumbre cast scene.pbrt --rays rays.csv        what each ray hits first
  lumbre info scene.pbrt --json                 what is in a scene
  lumbre diff a.exr b.exr --metric relmse       how different two pictures are
  lumbre merge a.part b.part -o picture.exr     one picture from parts that two machines rendered
  lumbre explain scene.pbrt --pixel 320,240     every number between a pixel and its colour
  lumbre math 'rotate(z, 90) * [1, 0, 0]'       vectors, transforms and quaternions, step by step

Exit status: 0 done, 1 a comparison failed, 2 usage, 3 input, 4 files, 5 a limit, 128 + N signal N
(130 for Ctrl-C, 143 for SIGTERM).")]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[cfg(not(target_family = "wasm"))]
#[derive(Subcommand)]
enum Command {
    Render(Box<render::Arguments>),
    View(Box<viewing::Arguments>),
    Cast(cast::Arguments),
    Info(info::Arguments),
    Diff(diff::Arguments),
    Merge(merge::Arguments),
    Explain(Box<explain::program::Arguments>),
    Math(math::Arguments),
    Farm(farm::Arguments),
    Completions(completions::CompletionsArguments),
    Man(completions::ManArguments),
}

/// Hides an option that these commands refuse: they show one picture.
#[cfg(not(target_family = "wasm"))]
fn without_turntable(command: clap::Command) -> clap::Command {
    command.mut_arg("turntable", |option| option.hide(true))
}

/// Runs the program with these arguments, the first being its name, and returns its exit status. Signals end the
/// process.
#[cfg(not(target_family = "wasm"))]
pub fn run(words: Vec<OsString>) -> u8 {
    let words = verb::with_render(words, &Arguments::command());
    let words = match povray::translated(words) {
        Ok(words) => words,
        Err(failure) => {
            say!("error: {failure}");
            return failure.status();
        }
    };
    let words = math::with_negative_expressions(words);
    let is_spanish = spanish::is_asked_for(&words);
    let arguments: Arguments = match tips::parse(&words) {
        Ok(arguments) => arguments,
        Err(status) => return status,
    };
    if let Err(wrong) = InstructionSet::from_environment() {
        say!("error: {wrong}");
        return Failure::Usage(String::new()).status();
    }
    threads::start();
    let outcome = match arguments.command {
        Command::Render(mut arguments) => {
            arguments.pass_options_to_reader();
            render::series::run(&arguments)
        }
        Command::View(arguments) => viewing::run(*arguments),
        Command::Cast(arguments) => cast::run(&arguments),
        Command::Info(arguments) => info::run(&arguments),
        Command::Diff(arguments) => diff::run(&arguments),
        Command::Merge(arguments) => merge::run(&arguments),
        Command::Explain(arguments) => explain::program::run(&arguments),
        Command::Math(arguments) => math::run(&arguments),
        Command::Farm(arguments) => farm::run(&arguments),
        Command::Completions(arguments) => completions::completions::<Arguments>(&arguments),
        Command::Man(arguments) => completions::man::<Arguments>(&arguments),
    };
    match outcome {
        Ok(()) => 0,
        Err(failure) => {
            if !failure.is_silent() {
                let message = failure.to_string();
                let message = if is_spanish { spanish_messages::in_spanish(&message) } else { message };
                say!("error: {message}");
            }
            failure.status()
        }
    }
}
