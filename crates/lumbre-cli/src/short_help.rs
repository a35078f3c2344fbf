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
            "spectral",
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
            "format",
            "output",
            "lang",
            "size",
            "camera",
        ],
    ),
];

/// Makes `-h` short for all commands; `more` says that there is more.
pub(crate) fn shorten(program: Command, more: &str) -> Command {
    program.mut_subcommands(|command| {
        let name = command.get_name().to_owned();
        let essential = ESSENTIAL.iter().find(|(of, _)| *of == name).map(|(_, options)| *options);
        let command = command.mut_args(|arg| {
            let is_listed = essential.is_none_or(|options| options.contains(&arg.get_id().as_str()));
            let arg = with_sentence(arg);
            if is_listed { arg } else { arg.hide_short_help(true) }
        });
        let Some(examples) = command.get_after_help().map(ToString::to_string) else { return command };
        let first = examples.split("\n\n").next().unwrap_or_default();
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
        let mut program = shorten(crate::Arguments::command(), "More");
        for (name, _) in ESSENTIAL {
            let command = program.find_subcommand_mut(name).expect(name);
            let (short, long) = (command.render_help().to_string(), command.render_long_help().to_string());
            assert!(short.lines().count() <= 60, "{name}: {} lines", short.lines().count());
            for arg in command.get_arguments().filter(|arg| !arg.is_hide_set()).filter_map(Arg::get_long) {
                assert!(long.contains(&format!("--{arg}")), "{name} --{arg}");
            }
        }
    }
}
