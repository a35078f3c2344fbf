//! What `-h` says: of each command the options that matter most, each in a sentence. `--help` has them all, with every
//! word.

use clap::{Arg, Command};

/// The options of a command that `-h` lists. Commands that are not here have few enough to list them all.
const ESSENTIAL: [(&str, &[&str]); 3] = [
    (
        "render",
        &[
            "scene",
            "output",
            "size",
            "spp",
            "time",
            "noise",
            "denoise",
            "integrator",
            "camera",
            "azimuth",
            "elevation",
            "zoom",
            "env",
            "ground",
            "background",
            "exposure",
            "frames",
            "turntable",
            "settings",
            "resume",
            "quiet",
        ],
    ),
    (
        "view",
        &[
            "scene",
            "port",
            "host",
            "no_open",
            "export",
            "spp",
            "size",
            "camera",
            "env",
            "ground",
            "background",
            "exposure",
            "settings",
        ],
    ),
    (
        "explain",
        &[
            "scene",
            "pixel",
            "shape",
            "all_shapes",
            "ray",
            "nearest",
            "sample",
            "depth",
            "only",
            "digits",
            "format",
            "output",
            "lang",
            "size",
            "camera",
        ],
    ),
];

/// What `-h` says of options of `render` and `view` whose first sentence is long.
const SUMMARIES: [(&str, &str); 13] = [
    ("time", "Stop after this time, as 90s, 2m or 1h30m"),
    ("noise", "Stop sampling a pixel at this share of noise, such as 0.02"),
    ("integrator", "What each pixel shows: light (path, caustics, …) or normals, depth, albedo, uv"),
    ("azimuth", "Go around the model to the right, in degrees"),
    ("elevation", "Go up, in degrees"),
    ("frames", "Frames of an animation, as -o frame.####.png or -o walk.gif"),
    ("turntable", "N pictures from all around the model, as -o frame.####.png or -o turn.gif"),
    ("ground", "What the model stands on: none, shadow or plane"),
    ("env", "Light from all around: a picture, studio, sky:TIME,LATITUDE,LONGITUDE or none"),
    ("background", "What is behind everything: env, studio, transparent, a colour or an image"),
    ("settings", "Set a parameter of the scene, as material.0.color=red or camera.fov=40"),
    ("resume", "Continue from a checkpoint"),
    ("export", "Write a page of the finished picture into this folder instead of showing it"),
];

/// How many examples `-h` has.
const EXAMPLES: usize = 3;

/// Makes `-h` short for all commands; `more` says that there is more. `is_short` says that `-h` is on the command line:
/// what it lists is then in one list, by importance.
pub(crate) fn shorten(program: Command, more: &str, is_short: bool) -> Command {
    program.mut_subcommands(|command| {
        let name = command.get_name().to_owned();
        let essential = ESSENTIAL.iter().find(|(of, _)| *of == name).map(|(_, options)| *options);
        let command = command.mut_args(|arg| {
            let id = arg.get_id().as_str().to_owned();
            let arg = with_sentence(arg);
            let Some(options) = essential else { return arg };
            let Some(place) = options.iter().position(|option| *option == id) else {
                return arg.hide_short_help(true);
            };
            if is_short && !arg.is_positional() { in_one_list(arg, &name, place) } else { arg }
        });
        let Some(examples) = command.get_after_help().map(ToString::to_string) else { return command };
        let first = examples.split("\n\n").next().unwrap_or_default();
        let lines = if essential.is_some() { 1 + EXAMPLES } else { usize::MAX };
        let first = first.lines().take(lines).collect::<Vec<_>>().join("\n");
        let rest =
            if essential.is_some() { format!("\n\n{more}: lumbre {name} --help") } else { String::new() };
        let short = format!("{first}{rest}");
        command.after_help(short).after_long_help(examples)
    })
}

/// An argument of which `-h` prints the first sentence of the help.
fn with_sentence(arg: Arg) -> Arg {
    let Some(help) = arg.get_help().map(ToString::to_string) else { return arg };
    let long = arg.get_long_help().map_or_else(|| help.clone(), ToString::to_string);
    let sentence = help.split(". ").next().unwrap_or_default().to_owned();
    arg.help(sentence).long_help(long)
}

/// An option of a command as one line of a single list.
fn in_one_list(arg: Arg, command: &str, place: usize) -> Arg {
    /// The longest name of a value that leaves room for the sentence.
    const MAX_NAME: usize = 16;
    let names = arg.get_value_names().unwrap_or_default();
    let is_long = names.iter().map(|name| name.len()).sum::<usize>() > MAX_NAME;
    let id = arg.get_id().as_str().to_owned();
    let summary = SUMMARIES.iter().find(|(of, _)| command != "explain" && *of == id);
    let takes_value = arg.get_action().takes_values();
    let arg = arg.help_heading(None).display_order(place);
    let arg = if takes_value { arg.hide_possible_values(true).hide_default_value(true) } else { arg };
    let arg = if is_long { arg.value_name("…") } else { arg };
    match summary {
        Some((_, summary)) => arg.help(*summary),
        None => arg,
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn every_essential_option_is_one_of_its_command() {
        let program = crate::Arguments::command();
        for (name, options) in ESSENTIAL {
            let command = program.find_subcommand(name).expect(name);
            for option in options {
                assert!(command.get_arguments().any(|arg| arg.get_id() == *option), "{name} {option}");
            }
        }
    }

    #[test]
    fn short_help_fits_on_a_screen_and_long_help_has_all() {
        let mut program = shorten(crate::Arguments::command(), "More", false);
        let mut in_short = shorten(crate::Arguments::command(), "More", true);
        for (name, options) in ESSENTIAL {
            let short = in_short.find_subcommand_mut(name).expect(name).render_help().to_string();
            // Beside the options: what it does, usage, the scene, three examples, and lines between.
            let count = short.lines().count();
            assert!(count <= options.len() + 16, "{name}: {count} lines:\n{short}");
            for line in short.lines() {
                assert!(line.chars().count() <= 120, "{name}: {line}");
            }
            for option in options.iter().filter(|option| **option != "scene") {
                let arg = program.find_subcommand(name).expect(name).get_arguments();
                let long = arg.filter(|arg| arg.get_id() == *option).find_map(Arg::get_long);
                assert!(
                    long.is_some_and(|long| short.contains(&format!("--{long}"))),
                    "{name}: {option}\n{short}"
                );
            }
            let command = program.find_subcommand_mut(name).expect(name);
            let long = command.render_long_help().to_string();
            for arg in command.get_arguments().filter(|arg| !arg.is_hide_set()).filter_map(Arg::get_long) {
                assert!(long.contains(&format!("--{arg}")), "{name} --{arg}");
            }
        }
    }
}
