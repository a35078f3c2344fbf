//! The command line of POV-Ray: its switches, and files of settings (`.ini`) in place of a scene.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use lumbre::formats::pov::PovJob;
use lumbre::formats::{Budget, Input, Limits, SceneFormat};

use crate::failure::Failure;

/// The commands that take switches of POV-Ray.
const COMMANDS: [&str; 3] = ["render", "view", "info"];

/// The words with options of ours in place of POV-Ray's switches and files of settings, where a scene of POV-Ray is
/// rendered.
///
/// # Errors
/// [`Failure`] if a file of settings cannot be read, or if a switch has a wrong value.
pub(crate) fn translated(words: Vec<OsString>) -> Result<Vec<OsString>, Failure> {
    let is_command = words.get(1).is_some_and(|word| COMMANDS.iter().any(|name| word == name));
    if !is_command || !words[2..].iter().any(is_of_povray) {
        return Ok(words);
    }
    let is_render = words[1] == "render";
    let mut job = PovJob::default();
    let mut out: Vec<OsString> = words[..2].to_vec();
    let mut scenes: Vec<OsString> = Vec::new();
    let mut settings: Option<PathBuf> = None;
    let mut rest = words[2..].iter().peekable();
    while let Some(word) = rest.next() {
        if let Some((path, section)) = file_of_settings(word) {
            read_settings(&mut job, &path, section.as_deref())?;
            settings = Some(path);
            continue;
        }
        if word == "--" {
            scenes.extend(rest.cloned());
            break;
        }
        let text = word.to_string_lossy();
        let next_is_ours = rest.peek().is_some_and(|next| next.to_string_lossy().contains('='));
        if is_switch(&text, next_is_ours)
            && let Some(outcome) = job.switch(&text)
        {
            outcome.map_err(|wrong| Failure::Usage(format!("{text}: {wrong}")))?;
            continue;
        }
        out.push(word.clone());
    }
    let folder = settings.as_deref().and_then(Path::parent).unwrap_or(Path::new(""));
    let has_scene = out[2..].iter().any(|word| SceneFormat::from_path(Path::new(word)).is_some());
    if let Some(input) = &job.input {
        scenes.push(scene_beside(folder, input).into());
    } else if let (Some(settings), false) = (&settings, has_scene || !scenes.is_empty()) {
        scenes.push(settings.with_extension("pov").into());
    }
    out.extend(options(&job, is_render, folder, &out));
    for ignored in &job.ignored {
        say!("note: this setting of POV-Ray is left out: {ignored}");
    }
    if !scenes.is_empty() {
        out.push("--".into());
        out.extend(scenes);
    }
    Ok(out)
}

/// Whether a word is a scene of POV-Ray, a file of its settings, or a switch that names a scene.
fn is_of_povray(word: &OsString) -> bool {
    let text = word.to_string_lossy();
    let name = text.strip_prefix("+I").or(text.strip_prefix("+i")).unwrap_or(&text);
    SceneFormat::from_path(Path::new(name)) == Some(SceneFormat::Pov) || file_of_settings(word).is_some()
}

/// The path of a file of settings, with the section that its name ends with.
fn file_of_settings(word: &OsString) -> Option<(PathBuf, Option<String>)> {
    let text = word.to_string_lossy();
    let is_settings = |path: &Path| path.extension().is_some_and(|end| end.eq_ignore_ascii_case("ini"));
    if is_settings(Path::new(word)) && !text.starts_with(['+', '-']) {
        return Some((PathBuf::from(word), None));
    }
    let (path, section) = text.strip_suffix(']')?.split_once('[')?;
    is_settings(Path::new(path)).then(|| (PathBuf::from(path), Some(section.to_owned())))
}

/// Whether a word is a switch of POV-Ray and no option of ours: with -, the usual ones.
fn is_switch(text: &str, next_is_ours: bool) -> bool {
    match text.as_bytes() {
        [b'+', ..] => true,
        [b'-', b'A' | b'P' | b'J' | b'C', ..] => true,
        [b'-', b'D'] => !next_is_ours,
        [b'-', b'G', b'A'] | [b'-', b'U', b'V'] => true,
        _ => false,
    }
}

fn read_settings(job: &mut PovJob, path: &Path, section: Option<&str>) -> Result<(), Failure> {
    let budget = Budget::new(Limits::default());
    let input = Input::open(path, &budget).map_err(lumbre::Error::from)?;
    let text = String::from_utf8_lossy(&input);
    job.read_ini(&text, section).map_err(|wrong| Failure::input(format!("{}: {wrong}", path.display())))
}

/// A scene by its name in a file of settings: in the current folder, or next to that file.
fn scene_beside(folder: &Path, name: &str) -> PathBuf {
    let name = PathBuf::from(name);
    let with_ending = |path: PathBuf| match path.extension() {
        Some(_) => path,
        None => path.with_extension("pov"),
    };
    let here = with_ending(name);
    if here.is_file() { here } else { folder.join(here) }
}

/// Options of ours for what a job asks for.
fn options(job: &PovJob, is_render: bool, folder: &Path, given: &[OsString]) -> Vec<OsString> {
    let mut out: Vec<OsString> = Vec::new();
    let mut push = |name: &str, value: OsString| out.extend([name.into(), value]);
    let is_given = |names: &[&str]| given.iter().any(|word| names.iter().any(|name| word == name));
    let range = |[first, last]: [u32; 2]| OsString::from(format!("{first}..{last}"));
    for library in &job.library {
        let path = PathBuf::from(library);
        push("--pov-include", if path.is_dir() { path } else { folder.join(path) }.into());
    }
    for declared in &job.declares {
        push("--pov-declare", declared.into());
    }
    let frames = job.frames();
    if let Some((all, shown)) = frames {
        let clocks = [job.initial_clock.unwrap_or(0.0), job.final_clock.unwrap_or(1.0)];
        push("--pov-clock", format!("{}..{}", clocks[0], clocks[1]).into());
        push("--pov-frames", range(all));
        if is_render && !is_given(&["--frames"]) {
            push("--frames", range(shown));
        }
    } else if let Some(clock) = job.clock {
        push("--pov-clock", clock.to_string().into());
    }
    if is_render {
        // A picture of POV-Ray is wider than high by a third, unless it says otherwise.
        let size = match (job.width, job.height) {
            (Some(width), Some(height)) => Some((width, height)),
            (Some(width), None) => Some((width, (width * 3 / 4).max(1))),
            (None, Some(height)) => Some(((height * 4 / 3).max(1), height)),
            (None, None) => None,
        };
        if let Some((width, height)) = size.filter(|_| !is_given(&["--size"])) {
            push("--size", format!("{width}x{height}").into());
        }
        if job.antialias == Some(false) && !is_given(&["--spp", "--noise", "--time"]) {
            push("--spp", "1".into());
        }
        let output = job.output.clone().or_else(|| {
            let input = job.input.as_deref().filter(|_| frames.is_some())?;
            Some(Path::new(input).with_extension("").to_string_lossy().into_owned())
        });
        if let Some(output) = output.filter(|_| !is_given(&["-o", "--output"])) {
            push("-o", picture_name(&output, frames.map(|(all, _)| all[1])).into());
        }
    }
    if job.cyclic && frames.is_some() {
        out.push("--pov-cyclic".into());
    }
    out
}

/// The name of a picture: with .png where it has no ending, and with the digits of a frame's number.
fn picture_name(output: &str, last_frame: Option<u32>) -> String {
    let path = Path::new(output);
    let ending = path.extension().map_or("png".to_owned(), |ending| ending.to_string_lossy().into_owned());
    let stem = path.with_extension("");
    let stem = stem.display();
    match last_frame {
        Some(last) => format!("{stem}{}.{ending}", "#".repeat(last.to_string().len())),
        None => format!("{stem}.{ending}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(text: &[&str]) -> Vec<OsString> {
        std::iter::once("lumbre").chain(text.iter().copied()).map(Into::into).collect()
    }

    #[test]
    fn switches_become_options() {
        for (found, expected) in [
            (&["render", "a.pov", "+W320", "+H240"][..], &["render", "a.pov", "--size", "320x240"][..]),
            (&["render", "+W320", "a.pov", "-A"], &["render", "a.pov", "--size", "320x240", "--spp", "1"]),
            (
                &["render", "+Ia.pov", "+Ob", "+K0.5", "-D", "+A0.3"],
                &["render", "--pov-clock", "0.5", "-o", "b.png", "--", "a.pov"],
            ),
            (
                &["render", "a.pov", "-D", "light.0.scale=2", "+H300"],
                &["render", "a.pov", "-D", "light.0.scale=2", "--size", "400x300"],
            ),
            (
                &["render", "a.pov", "+KFI1", "+KFF20", "+SF5", "+EF6", "+KC", "+Oframe.png"],
                &[
                    "render",
                    "a.pov",
                    "--pov-clock",
                    "0..1",
                    "--pov-frames",
                    "1..20",
                    "--frames",
                    "5..6",
                    "-o",
                    "frame##.png",
                    "--pov-cyclic",
                ],
            ),
            (
                &["render", "a.pov", "--spp", "4", "-A", "-o", "c.png", "+Ob"],
                &["render", "a.pov", "--spp", "4", "-o", "c.png"],
            ),
            (&["info", "a.pov", "+W320"], &["info", "a.pov"]),
            // Not of POV-Ray: nothing changes.
            (&["render", "a.obj", "+W320"], &["render", "a.obj", "+W320"]),
            (&["diff", "a.pov", "+W320"], &["diff", "a.pov", "+W320"]),
        ] {
            assert_eq!(translated(words(found)).unwrap(), words(expected), "{found:?}");
        }
        let wrong = translated(words(&["render", "a.pov", "+Wx"]));
        assert!(wrong.is_ok_and(|words| words.iter().any(|word| word == "+Wx")), "it is left to the command");
        assert!(translated(words(&["render", "a.pov", "+W0"])).is_err());
    }

    #[test]
    fn a_file_of_settings_names_its_scene() {
        let folder = std::env::temp_dir().join(format!("lumbre-povray-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("turn.ini");
        std::fs::write(&path, "+W80 +H60\nInitial_Frame=1\nFinal_Frame=9\n[still]\nInput_File_Name=b\n")
            .unwrap();
        let found = translated(words(&["render", &path.to_string_lossy()])).unwrap();
        let scene = folder.join("turn.pov").to_string_lossy().into_owned();
        let expected = [
            "render",
            "--pov-clock",
            "0..1",
            "--pov-frames",
            "1..9",
            "--frames",
            "1..9",
            "--size",
            "80x60",
            "--",
            &scene,
        ];
        assert_eq!(found, words(&expected));
        let section = format!("{}[Still]", path.display());
        let found = translated(words(&["render", &section])).unwrap();
        assert_eq!(found.last(), Some(&folder.join("b.pov").into_os_string()));
        assert!(found.iter().any(|word| word == "b#.png"), "{found:?}");
        std::fs::remove_dir_all(&folder).unwrap();
        assert!(translated(words(&["render", &path.to_string_lossy()])).is_err());
    }
}
