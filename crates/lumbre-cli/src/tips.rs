//! Suggests an option for a wrong one: first by synonyms from other programs, then by spelling.

use std::ffi::OsString;
use std::io::{self, Write};

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Command, CommandFactory, Error, Parser};
use lumbre::formats::diagnostic::nearest_name;

use crate::console::{escaped, has_colours};
use crate::short_help::shorten;
use crate::spanish;

/// Words of other programs for an option.
const OPTIONS: &[(&str, &[&str])] = &[
    ("--spp", &["--samples-per-pixel", "--pixel-samples", "--pixelsamples", "--num-samples", "--quality"]),
    ("--output", &["--out", "--outfile", "--output-file", "--image", "--save"]),
    ("--output-format", &["--format", "--file-format"]),
    ("--input-format", &["--input-type", "--type", "--from-format"]),
    ("--size", &["--resolution", "--res", "--dimensions", "--geometry", "--width", "--height", "-w"]),
    (
        "--eye",
        &[
            "--camera-position",
            "--camera-pos",
            "--camera-origin",
            "--position",
            "--look-from",
            "--lookfrom",
            "--from",
        ],
    ),
    ("--target", &["--look-at", "--lookat", "--camera-target", "--focal-point", "--camera-focal-point"]),
    ("--up", &["--up-axis", "--upaxis", "--camera-up", "--view-up", "--camera-view-up"]),
    ("--fov", &["--field-of-view", "--view-angle", "--camera-view-angle", "--vfov", "--hfov"]),
    ("--ortho", &["--orthographic", "--orthogonal", "--camera-orthographic", "--parallel", "--projection"]),
    ("--azimuth", &["--rotate", "--rotation", "--yaw", "--heading", "--phi", "--camera-azimuth-angle"]),
    ("--elevation", &["--pitch", "--tilt", "--theta", "--altitude", "--camera-elevation-angle"]),
    ("--zoom", &["--scale", "--magnify", "--camera-zoom-factor"]),
    ("--fit", &["--fit-all", "--view-all", "--frame-all", "--autocenter", "--viewall"]),
    ("--turntable", &["--spin", "--orbit", "--animate"]),
    ("--frame", &["--animation-time", "--at-time"]),
    ("--animation", &["--anim", "--clip", "--animation-index", "--animation-name"]),
    ("--threads", &["--nthreads", "--num-threads", "--thread-count", "--jobs", "-j", "--cores", "--cpus"]),
    (
        "--max-depth",
        &["--bounces", "--max-bounces", "--maxdepth", "--depth", "--ray-depth", "--maximum-depth"],
    ),
    ("--crop", &["--cropwindow", "--crop-window", "--region", "--pixelbounds", "--border", "--roi"]),
    ("--time", &["--timeout", "--time-limit", "--max-time"]),
    ("--noise", &["--noise-level", "--noise-threshold", "--adaptive", "--adaptive-threshold", "--variance"]),
    ("--denoise", &["--denoiser", "--denoising", "--denoise-image", "--despeckle", "--smooth"]),
    ("--tonemap", &["--tone-mapping", "--tone-mapper", "--tonemapper", "--view-transform"]),
    ("--exposure", &["--ev", "--exposure-compensation", "--brightness"]),
    ("--env", &["--environment", "--envmap", "--environment-map", "--hdri", "--ibl", "--skybox", "--world"]),
    ("--background", &["--bg", "--backdrop", "--background-color", "--transparent", "--alpha"]),
    ("--ground", &["--floor", "--shadow-catcher", "--ground-plane"]),
    ("--tev", &["--display-server"]),
    ("--aov", &["--aovs", "--passes", "--layers", "--render-passes"]),
    ("--stats", &["--statistics", "--report", "--pixelstats"]),
    ("--integrator", &["--renderer", "--mode", "--algorithm"]),
    ("--seed", &["--random-seed", "--rng-seed"]),
    ("--max-memory", &["--memory", "--mem", "--memory-limit"]),
    ("--quiet", &["--silent"]),
    ("--verbose", &["--debug", "--log-level"]),
    ("--rays", &["--input", "--rays-file"]),
    ("--query", &["--mode", "--type"]),
    ("--fail-above", &["--threshold", "--tolerance", "--max-error", "--fail"]),
    ("--metric", &["--error", "--method"]),
    ("--json", &["--format"]),
    ("--lang", &["--language", "--locale"]),
    ("--define", &["--set", "--param", "--parameter", "--override"]),
];

/// What cannot be asked for by an option, and what helps instead.
const HINTS: &[(&[&str], &str)] = &[
    (&["--oidn", "--openimagedenoise"], "the option for it is --denoise oidn"),
    (
        &["--optix"],
        "the denoisers are --denoise (Lumbre's own filter) and --denoise oidn (Open Image Denoise)",
    ),
    (
        &["--gpu", "--device", "--cuda", "--wavefront"],
        "pictures are rendered on the processor's cores (--threads N)",
    ),
    (&["--interactive", "--gui", "--display"], "lumbre view SCENE shows the picture in the browser"),
    (
        &["--pixel", "--pixelmaterial"],
        "lumbre explain SCENE --pixel X,Y explains the colour of a pixel, with its materials; lumbre render --crop renders a part of the picture",
    ),
    (
        &["--mse-reference-image", "--mse-reference-out"],
        "lumbre diff OUT REFERENCE measures the difference of two pictures",
    ),
    (&["--write-partial-images"], "a long render saves its samples in OUT.checkpoint, for --resume"),
    (&["--quick"], "a fast picture has few samples, such as --spp 16 --denoise, or a small --size"),
];

/// Words of other programs for a command.
const COMMANDS: &[(&str, &[&str])] = &[
    ("render", &["draw", "image"]),
    ("view", &["show", "display", "preview", "gui"]),
    ("cast", &["trace", "intersect", "raycast", "shoot", "query"]),
    ("info", &["inspect", "describe", "stat", "stats", "list", "validate"]),
    ("diff", &["compare", "cmp", "difference", "flip"]),
    ("completions", &["completion", "complete", "autocomplete"]),
    ("man", &["manual", "manpage"]),
    ("math", &["calc", "calculate", "eval", "evaluate"]),
];

/// Reads the command line, or says what is wrong with it.
///
/// # Errors
/// The exit status: 0 for help, 2 for wrong usage.
pub(crate) fn parse<P: Parser + CommandFactory>(arguments: &[OsString]) -> Result<P, u8> {
    let is_spanish = spanish::is_asked_for(arguments);
    let is_short = arguments.iter().any(|argument| argument == "-h");
    let read = |words: &[OsString]| {
        let program = if is_spanish {
            shorten(spanish::translated(P::command()), "Todas las opciones y más ejemplos", is_short)
        } else {
            shorten(P::command(), "All options, and more examples", is_short)
        };
        P::from_arg_matches(&program.try_get_matches_from(words)?)
    };
    read(arguments).map_err(|mut error| {
        // What the user wrote is in the message, where it must not drive the terminal; in a styled message it can no
        // longer be distinguished from the styles.
        let harmless: Vec<OsString> = arguments
            .iter()
            .map(|argument| escaped(&argument.to_string_lossy()).into_owned().into())
            .collect();
        if harmless != arguments
            && let Err(same) = read(&harmless)
        {
            error = same;
        }
        let mut program = P::command();
        program.build();
        let command = arguments.get(1).and_then(|name| program.find_subcommand(name)).unwrap_or(&program);
        give_tip(&mut error, command);
        if is_spanish && error.use_stderr() {
            let _ = io::stderr().lock().write_all(spanish::said(&error).as_bytes());
            return 2;
        }
        show(&error)
    })
}

fn show(error: &Error) -> u8 {
    let text = error.render();
    let write = |out: &mut dyn Write, has_colours: bool| {
        // The reader may close the pipe: `lumbre help | head -1`.
        let _ = if has_colours { write!(out, "{}", text.ansi()) } else { write!(out, "{text}") };
    };
    if error.use_stderr() {
        write(&mut io::stderr().lock(), has_colours(&io::stderr()));
        2
    } else {
        write(&mut io::stdout().lock(), has_colours(&io::stdout()));
        0
    }
}

/// Replaces the tip of an error by a better one, and drops a misleading one.
fn give_tip(error: &mut Error, command: &Command) {
    let text = |kind| match error.get(kind) {
        Some(ContextValue::String(text)) => Some(text.clone()),
        _ => None,
    };
    match error.kind() {
        ErrorKind::UnknownArgument => {
            let Some(wrong) = text(ContextKind::InvalidArg).filter(|wrong| wrong.starts_with('-')) else {
                return;
            };
            error.remove(ContextKind::SuggestedArg);
            error.remove(ContextKind::Suggested);
            // The usual one goes by the tip that was dropped.
            error.insert(ContextKind::Usage, ContextValue::StyledStr(command.clone().render_usage()));
            match tip(&wrong, command) {
                Some(Tip::Spelling(option)) => {
                    error.insert(ContextKind::SuggestedArg, ContextValue::String(option));
                }
                Some(Tip::Meaning(option)) => {
                    let valid = command.get_styles().get_valid();
                    let text = format!("the option for it is '{valid}{option}{valid:#}'");
                    error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![text.into()]));
                }
                Some(Tip::Hint(hint)) => {
                    error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![hint.into()]));
                }
                None => {}
            }
        }
        ErrorKind::InvalidSubcommand => {
            let Some(wrong) = text(ContextKind::InvalidSubcommand) else { return };
            let by_meaning =
                COMMANDS.iter().find(|(_, words)| words.contains(&&*wrong)).map(|(name, _)| *name);
            let names = command.get_subcommands().map(Command::get_name);
            if let Some(name) = by_meaning.or_else(|| nearest_name(&wrong, names)) {
                let names = ContextValue::Strings(vec![name.to_owned()]);
                error.insert(ContextKind::SuggestedSubcommand, names);
            }
        }
        _ => {}
    }
}

/// What a wrong option is answered with.
#[derive(Debug, PartialEq)]
enum Tip {
    /// The option of similar spelling.
    Spelling(String),
    /// The option with the same meaning.
    Meaning(String),
    /// What helps instead.
    Hint(&'static str),
}

fn tip(wrong: &str, command: &Command) -> Option<Tip> {
    let options: Vec<String> =
        command.get_arguments().filter_map(|a| a.get_long()).map(|name| format!("--{name}")).collect();
    let known_words = || OPTIONS.iter().filter(|(option, _)| options.iter().any(|known| known == option));
    let meant =
        |wrong: &str| known_words().find(|(_, words)| words.contains(&wrong)).map(|(option, _)| *option);
    if let Some(option) = meant(wrong) {
        return Some(Tip::Meaning(option.to_owned()));
    }
    if let Some((_, hint)) = HINTS.iter().find(|(words, _)| words.contains(&wrong)) {
        return Some(Tip::Hint(hint));
    }
    let name = wrong.strip_prefix("--")?;
    let names = |words: &[String]| {
        let names = words.iter().filter_map(|word| word.strip_prefix("--"));
        nearest_name(name, names).map(|name| format!("--{name}"))
    };
    if let Some(option) = names(&options) {
        return Some(Tip::Spelling(option));
    }
    let words: Vec<String> =
        known_words().flat_map(|(_, words)| *words).map(|&word| word.to_owned()).collect();
    meant(&names(&words)?).map(|option| Tip::Meaning(option.to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_option_is_answered_by_meaning_before_spelling() {
        let program = crate::Arguments::command();
        let tip = |command: &str, wrong: &str| tip(wrong, program.find_subcommand(command).unwrap());
        let meaning = |option: &str| Some(Tip::Meaning(option.to_owned()));
        let spelling = |option: &str| Some(Tip::Spelling(option.to_owned()));
        for (command, wrong, expected) in [
            ("render", "--pixel-samples", meaning("--spp")),
            ("render", "--samplse", spelling("--samples")),
            ("render", "--resolution", meaning("--size")),
            ("render", "--camera-position", meaning("--eye")),
            ("render", "-j", meaning("--threads")),
            ("render", "--denoiser", meaning("--denoise")),
            ("cast", "--input", meaning("--rays")),
            ("diff", "--threshold", meaning("--fail-above")),
            ("render", "--sizes", spelling("--size")),
            ("cast", "--querry", spelling("--query")),
            ("render", "--display-server", meaning("--tev")),
            ("cast", "--samples", None),
            ("render", "--frobnicate", None),
            ("render", "-x", None),
        ] {
            assert_eq!(tip(command, wrong), expected, "{command} {wrong}");
        }
        for (wrong, expected) in [
            ("--oidn", "--denoise oidn"),
            ("--gui", "lumbre view SCENE"),
            ("--pixel", "lumbre explain SCENE --pixel X,Y"),
            ("--pixelmaterial", "lumbre explain"),
            ("--mse-reference-image", "lumbre diff"),
            ("--wavefront", "--threads"),
        ] {
            assert!(
                matches!(tip("render", wrong), Some(Tip::Hint(hint)) if hint.contains(expected)),
                "{wrong}"
            );
        }
    }

    #[test]
    fn known_options_get_no_tip() {
        for command in crate::Arguments::command().get_subcommands() {
            let options: Vec<String> = command
                .get_arguments()
                .filter_map(|a| a.get_long())
                .map(|name| format!("--{name}"))
                .collect();
            let known = |word: &str| options.iter().any(|option| option == word);
            for (_, words) in OPTIONS.iter().filter(|(option, _)| known(option)) {
                assert!(!words.iter().any(|word| known(word)), "{words:?}");
            }
            // A hint may name the command that has the option.
            let here = format!("lumbre {}", command.get_name());
            let others = HINTS.iter().filter(|(_, hint)| !hint.contains(&here));
            assert!(!others.flat_map(|(words, _)| *words).any(|word| known(word)), "{here}");
        }
    }

    #[test]
    fn every_tip_is_an_option_of_some_command() {
        let program = crate::Arguments::command();
        let is_known = |option: &str| {
            program
                .get_subcommands()
                .any(|c| c.get_arguments().any(|a| a.get_long() == option.strip_prefix("--")))
        };
        for (option, _) in OPTIONS {
            assert!(is_known(option), "{option}");
        }
        for (name, _) in COMMANDS {
            assert!(program.find_subcommand(name).is_some(), "{name}");
        }
    }
}
