//! `lumbre FILE…`: what has no verb is rendered.

use std::ffi::OsString;
use std::path::Path;

use clap::Command;
use lumbre::formats::SceneFormat;

use crate::denoiser::Choice;

/// The arguments with `render` in front where they name no command but a scene.
pub(crate) fn with_render(mut arguments: Vec<OsString>, program: &Command) -> Vec<OsString> {
    let names_command = |argument: &OsString| {
        argument.to_str().is_some_and(|name| name == "help" || program.find_subcommand(name).is_some())
    };
    let is_for_program =
        |argument: &OsString| ["-h", "--help", "-V", "--version"].iter().any(|known| argument == known);
    let is_option = |argument: &OsString| argument.as_encoded_bytes().starts_with(b"-") && argument != "-";
    let renders = match arguments.get(1) {
        None => false,
        Some(first) if names_command(first) || is_for_program(first) => false,
        // Options may come first.
        Some(first) if is_option(first) => arguments[2..].iter().any(is_scene),
        // What looks like the name of a file and is none is said by the command that looks for it.
        Some(first) => is_scene(first) || looks_like_a_file(first),
    };
    if renders {
        arguments.insert(1, "render".into());
    }
    if arguments.get(1).is_some_and(|verb| verb == "render") {
        for i in 3..arguments.len() {
            let is_name = Choice::NAMES.iter().any(|name| arguments[i] == *name);
            if arguments[i - 1] == "--denoise" && !is_name && is_scene(&arguments[i]) {
                // Without a value of its own, it does not take the scene for one.
                arguments[i - 1] = "--denoise=auto".into();
            }
        }
    }
    arguments
}

fn is_scene(argument: &OsString) -> bool {
    let path = Path::new(argument);
    argument == "-" || SceneFormat::from_path(path).is_some() || path.is_file()
}

/// Whether a word is no command, by its form or because there is a folder of that name.
fn looks_like_a_file(argument: &OsString) -> bool {
    let path = Path::new(argument);
    path.extension().is_some() || path.components().count() > 1 || path.is_dir()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn denoise_without_a_value_does_not_take_the_scene_for_one() {
        let program = Command::new("lumbre").subcommand(Command::new("render"));
        for (arguments, expected) in [
            (&["render", "--denoise", "a.obj"][..], &["render", "--denoise=auto", "a.obj"][..]),
            (&["--denoise", "a.obj"], &["render", "--denoise=auto", "a.obj"]),
            (&["render", "--denoise", "oidn", "a.obj"], &["render", "--denoise", "oidn", "a.obj"]),
            (&["render", "--denoise", "odin", "a.obj"], &["render", "--denoise", "odin", "a.obj"]),
            (&["a.obj", "--denoise"], &["render", "a.obj", "--denoise"]),
        ] {
            let all = |words: &[&str]| -> Vec<OsString> {
                std::iter::once("lumbre").chain(words.iter().copied()).map(Into::into).collect()
            };
            assert_eq!(with_render(all(arguments), &program), all(expected));
        }
    }

    #[test]
    fn a_scene_without_a_verb_is_rendered_and_a_wrong_verb_is_not() {
        let program =
            Command::new("lumbre").subcommand(Command::new("render")).subcommand(Command::new("info"));
        for (arguments, expected) in [
            (&["fox.glb"][..], true),
            (&["a.pbrt.gz", "-o", "b.png"], true),
            (&["-"], true),
            (&["fox.fbx"], true),
            (&["models/fox"], true),
            (&["."], true),
            (&["--spp", "4", "a.OBJ"], true),
            (&["info", "a.obj"], false),
            (&["help"], false),
            (&["--version"], false),
            (&["rendr", "a.obj"], false),
            (&["--nonsense"], false),
            (&[], false),
        ] {
            let all: Vec<OsString> =
                std::iter::once("lumbre").chain(arguments.iter().copied()).map(Into::into).collect();
            let found = with_render(all.clone(), &program);
            assert_eq!(found.len() - all.len(), usize::from(expected), "{arguments:?}");
            assert_eq!(found.get(1).is_some_and(|verb| verb == "render"), expected, "{arguments:?}");
        }
    }
}
