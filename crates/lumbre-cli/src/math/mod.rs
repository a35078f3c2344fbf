//! `lumbre math`: vectors, matrices, transforms, cameras and quaternions, step by step.

#[cfg(not(target_family = "wasm"))]
use std::ffi::OsString;
#[cfg(not(target_family = "wasm"))]
use std::path::{Path, PathBuf};

#[cfg(not(target_family = "wasm"))]
use clap::Args;
use lumbre::formats::diagnostic::{Diagnostic, Place, quoted};
use serde_json::json;

use crate::failure::Failure;
#[cfg(not(target_family = "wasm"))]
use crate::failure::print;
use crate::language::{Language, filled};

mod cameras;
mod english;
mod functions;
mod lexer;
mod matrices;
mod numbers;
mod operators;
#[cfg(not(target_family = "wasm"))]
mod prompt;
mod quaternions;
mod session;
mod spanish;
mod steps;
#[cfg(test)]
mod tests;
mod texts;
mod transforms;
mod value;
mod vectors;

use english::ENGLISH;
use lexer::Wrong;
use session::{Outcome, Session};
use spanish::SPANISH;
use texts::Texts;

/// Evaluates vectors, matrices, transforms, cameras and quaternions, step by step.
#[cfg(not(target_family = "wasm"))]
#[derive(Args)]
#[command(after_help = "Examples:
  lumbre math 'cross([1, 2, 2], [2, -1, 2])'
  lumbre math 'T = translate([1, 2, 3]); R = rotate(z, 90); T * R * [1, 0, 0]'
  lumbre math 'orders(rotate_x(90), rotate_y(90))'     both orders, and the inverse both ways
  lumbre math 'row_form(rotate_z(90), [1, 0, 0])'      columns and rows side by side
  lumbre math 'look_at([0, 0, 5], [0, 0, 0], y)' --json
  lumbre math 'angles(euler(30, 90, 10))'              Euler angles at a pole
  lumbre math --file notes.txt                         a script: statements on lines, # comments
  lumbre math                                          a prompt; earlier results are ans and names
  lumbre math 'angle(x, y)' --lang es                  the steps in Spanish
  lumbre math help                                     every function

Exit status 2 for a wrong expression, 3 for one in a file or on standard input.")]
pub(crate) struct Arguments {
    /// What to evaluate, with ; between expressions. Quote it: the shell treats brackets specially. Without an
    /// expression, a prompt opens.
    expression: Vec<String>,
    /// Evaluate the statements of this file; - is standard input.
    #[arg(long, value_name = "FILE", conflicts_with = "expression")]
    file: Option<PathBuf>,
    /// Print each result with its steps as one line of JSON.
    #[arg(long)]
    json: bool,
    /// The language: English or Spanish.
    #[arg(long, value_enum, value_name = "LANGUAGE", default_value_t = Language::En)]
    lang: Language,
}

/// Puts a space before what begins with a single minus: it is part of an expression and no option.
#[cfg(not(target_family = "wasm"))]
pub(crate) fn with_negative_expressions(mut words: Vec<OsString>) -> Vec<OsString> {
    if words.get(1).is_some_and(|verb| verb == "math") {
        for word in &mut words[2..] {
            let is_option = word == "-" || word == "-h" || word.as_encoded_bytes().starts_with(b"--");
            if word.as_encoded_bytes().starts_with(b"-") && !is_option {
                let mut spaced = OsString::from(" ");
                spaced.push(&*word);
                *word = spaced;
            }
        }
    }
    words
}

/// Runs the command.
#[cfg(not(target_family = "wasm"))]
pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let texts = arguments.lang.choose(&ENGLISH, &SPANISH);
    let mut session = Session::new(texts);
    let form = if arguments.json { Form::Json } else { Form::Text };
    if let Some(path) = &arguments.file {
        let text = read(path, texts)?;
        // Some editors put a byte order mark in front.
        let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
        let name = path.display().to_string();
        return evaluate(&mut session, text, form)?
            .map_err(|wrong| Failure::Input(message(&name, text, &wrong, texts)));
    }
    if arguments.expression.is_empty() {
        return prompt::run(&mut session, form);
    }
    let text = arguments.expression.join(" ");
    let text = text.trim_start();
    evaluate(&mut session, text, form)?
        .map_err(|wrong| Failure::Usage(message(texts.expression, text, &wrong, texts)))
}

/// Evaluates an expression and returns what `lumbre math` prints of it, as text or as JSON.
///
/// # Errors
/// [`Failure::Usage`] with the place of a mistake, and [`Failure::Limit`] where more would be printed than `limit`
/// bytes.
pub fn calculate(text: &str, language: Language, as_json: bool, limit: usize) -> Result<String, Failure> {
    let texts = language.choose(&ENGLISH, &SPANISH);
    let form = if as_json { Form::Json } else { Form::Text };
    let text = text.trim_start();
    let mut printed = String::new();
    let mut session = Session::new(texts);
    let run = session.run(text, |outcome| {
        printed += &shown(&outcome, form);
        if printed.len() <= limit {
            Ok(())
        } else {
            Err(Failure::Limit(format!("more than {limit} bytes of answers")))
        }
    });
    match run {
        Ok(outcome) => outcome.map(|()| printed),
        Err(wrong) => Err(Failure::Usage(message(texts.expression, text, &wrong, texts))),
    }
}

/// How results are printed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    Text,
    Json,
}

#[cfg(not(target_family = "wasm"))]
fn read(path: &Path, texts: &Texts) -> Result<String, Failure> {
    let failed = |e: std::io::Error| match e.kind() {
        std::io::ErrorKind::InvalidData => Failure::Input(format!("{}: {}", path.display(), texts.not_utf8)),
        _ => Failure::Io(format!("{}: {}", path.display(), filled(texts.cannot_open, &[&e.to_string()]))),
    };
    if path == Path::new("-") {
        return std::io::read_to_string(std::io::stdin().lock()).map_err(failed);
    }
    // A device has no end.
    if !std::fs::metadata(path).map_err(failed)?.is_file() {
        return Err(Failure::Io(format!("{}: {}", path.display(), texts.not_regular)));
    }
    std::fs::read_to_string(path).map_err(failed)
}

/// Evaluates a text and prints what each statement gives.
///
/// # Errors
/// The outer one where printing fails, the inner one for a mistake in the text.
#[cfg(not(target_family = "wasm"))]
fn evaluate(session: &mut Session, text: &str, form: Form) -> Result<Result<(), Wrong>, Failure> {
    match session.run(text, |outcome| print(&shown(&outcome, form))) {
        Ok(printed) => printed.map(Ok),
        Err(wrong) => Ok(Err(wrong)),
    }
}

/// An outcome as it is printed.
fn shown(outcome: &Outcome, form: Form) -> String {
    match (outcome, form) {
        (Outcome::Help(lines), Form::Text) => lines.iter().map(|line| format!("{line}\n")).collect(),
        (Outcome::Help(lines), Form::Json) => format!("{}\n", json!({ "help": lines })),
        (Outcome::Value { name, value, steps }, Form::Json) => {
            let steps = steps.iter().map(|step| json!({ "operation": step.title, "lines": step.lines }));
            let (kind, numbers) = value.json();
            let report = json!({
                "name": name, "type": kind, "value": numbers, "steps": steps.collect::<Vec<_>>(),
            });
            format!("{report}\n")
        }
        (Outcome::Value { name, value, steps }, Form::Text) => {
            let mut text = String::new();
            for step in steps {
                text += &format!("{}\n", step.title);
                step.lines.iter().for_each(|line| text += &format!("  {line}\n"));
            }
            let front = name.as_ref().map_or("= ".to_owned(), |name| format!("{name} = "));
            for (i, line) in value.lines().iter().enumerate() {
                let front = if i == 0 { front.clone() } else { " ".repeat(front.len()) };
                text += &format!("{front}{line}\n");
            }
            text
        }
    }
}

/// A mistake with its place, and below it the line with a mark under the place.
fn message(name: &str, text: &str, wrong: &Wrong, texts: &Texts) -> String {
    let offset = wrong.offset.min(text.len());
    let place = Place::of_offset(name, text.as_bytes(), offset);
    let message = format!("{place}: {}", said(&wrong.what, texts));
    let start = text[..offset].rfind('\n').map_or(0, |end| end + 1);
    let line = text[start..].lines().next().unwrap_or("");
    let before = text[start..offset].chars().count();
    // A longer line would not show its mark.
    if line.trim().is_empty() || line.chars().count() > 100 || line.contains('\t') {
        return message;
    }
    format!("{message}\n  {line}\n  {}^", " ".repeat(before))
}

/// What is wrong, in the words of a language.
fn said(what: &Diagnostic, texts: &Texts) -> String {
    let Diagnostic { message, found, expected, suggestion, .. } = what;
    let details = [
        found.as_ref().map(|found| filled(texts.found, &[found])),
        expected.as_ref().map(|expected| filled(texts.expected, &[expected])),
        suggestion.as_ref().map(|name| filled(texts.did_you_mean, &[&quoted(name)])),
    ];
    let details: Vec<String> = details.into_iter().flatten().collect();
    if details.is_empty() { message.clone() } else { format!("{message} ({})", details.join("; ")) }
}
