//! What reaches a terminal: colours by one policy, and text that cannot drive it.

use std::borrow::Cow;
use std::ffi::OsString;
#[cfg(not(target_family = "wasm"))]
use std::io::{IsTerminal, Write};

use lumbre::formats::diagnostic::is_printable;

/// Bold and red, as errors of the command line are.
const ERROR: &str = "\x1b[1m\x1b[31m";
/// Bold and yellow.
const WARNING: &str = "\x1b[1m\x1b[33m";
const PLAIN: &str = "\x1b[0m";

/// Whether text for this stream has colours.
#[cfg(not(target_family = "wasm"))]
pub(crate) fn has_colours(stream: &impl IsTerminal) -> bool {
    colours(|name| std::env::var_os(name), stream.is_terminal() && understands_ansi())
}

/// Whether the terminal takes escape sequences. Consoles of Windows do from Windows 10 on, once they are asked to; the
/// terminals of MSYS, which are no consoles, set `TERM`.
#[cfg(not(target_family = "wasm"))]
pub(crate) fn understands_ansi() -> bool {
    !cfg!(windows)
        || std::env::var_os("TERM").is_some_and(|name| !name.is_empty())
        || anstyle_query::windows::enable_ansi_colors() != Some(false)
}

/// `NO_COLOR` (<https://no-color.org>) comes first, then `CLICOLOR_FORCE` and `CLICOLOR`
/// (<https://bixense.com/clicolors>), then whether it is a terminal that knows colours.
fn colours(variable: impl Fn(&str) -> Option<OsString>, is_terminal: bool) -> bool {
    let set = |name| variable(name).filter(|value| !value.is_empty());
    if set("NO_COLOR").is_some() {
        return false;
    }
    if set("CLICOLOR_FORCE").is_some_and(|value| value != "0") {
        return true;
    }
    let is_off =
        set("CLICOLOR").is_some_and(|value| value == "0") || set("TERM").is_some_and(|t| t == "dumb");
    is_terminal && !is_off
}

/// Prints a message to standard error, ignoring errors. `error:`, `warning:` and `aviso:` in front have their colour.
#[cfg(not(target_family = "wasm"))]
pub(crate) fn tell(message: &str) {
    let stream = std::io::stderr();
    let text = message_text(message, has_colours(&stream));
    let _ = writeln!(stream.lock(), "{text}");
}

fn message_text(message: &str, has_colours: bool) -> String {
    let text = escaped(message);
    for (word, colour) in [("error:", ERROR), ("warning:", WARNING), ("aviso:", WARNING)] {
        if let (true, Some(rest)) = (has_colours, text.strip_prefix(word)) {
            return format!("{colour}{word}{PLAIN}{rest}");
        }
    }
    text.into_owned()
}

/// A message with characters that could drive the terminal or disguise the text escaped, as names of files may
/// hold them. A line break stays where an indented line follows, as messages continue.
pub(crate) fn escaped(message: &str) -> Cow<'_, str> {
    let is_kept = |at: usize, c: char| is_printable(c) || (c == '\n' && message[at + 1..].starts_with("  "));
    if message.char_indices().all(|(at, c)| is_kept(at, c)) {
        return Cow::Borrowed(message);
    }
    let mut out = String::with_capacity(message.len() + 8);
    for (at, c) in message.char_indices() {
        if is_kept(at, c) {
            out.push(c);
        } else {
            out.extend(c.escape_default());
        }
    }
    Cow::Owned(out)
}

/// [`escaped`] for what has to stay on its line.
pub(crate) fn escaped_line(text: &str) -> Cow<'_, str> {
    if text.chars().all(is_printable) {
        return Cow::Borrowed(text);
    }
    let each =
        text.chars().map(|c| if is_printable(c) { c.to_string() } else { c.escape_default().to_string() });
    Cow::Owned(each.collect())
}

/// [`escaped_line`] for each line of a text.
pub(crate) fn escaped_lines(text: &str) -> String {
    text.split('\n').map(escaped_line).collect::<Vec<_>>().join("\n")
}

/// JSON as text that cannot drive a terminal either: its strings have escapes for what is not to be printed.
pub(crate) fn escaped_json(json: &serde_json::Value) -> String {
    let text = format!("{json:#}\n");
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        if c == '\n' || is_printable(c) {
            out.push(c);
        } else {
            c.encode_utf16(&mut [0; 2]).iter().for_each(|unit| out.push_str(&format!("\\u{unit:04x}")));
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_follow_the_environment_and_then_the_terminal() {
        let decide = |variables: &[(&str, &str)], is_terminal| {
            let find = |name: &str| {
                variables.iter().find(|(known, _)| *known == name).map(|(_, value)| OsString::from(value))
            };
            colours(find, is_terminal)
        };
        for (variables, at_terminal, in_pipe) in [
            (&[][..], true, false),
            (&[("NO_COLOR", "")], true, false),
            (&[("NO_COLOR", "0")], false, false),
            (&[("CLICOLOR_FORCE", "1")], true, true),
            (&[("CLICOLOR_FORCE", "0")], true, false),
            (&[("CLICOLOR", "0")], false, false),
            (&[("CLICOLOR", "1")], true, false),
            (&[("TERM", "dumb")], false, false),
            (&[("NO_COLOR", "1"), ("CLICOLOR_FORCE", "1")], false, false),
        ] {
            assert_eq!(decide(variables, true), at_terminal, "{variables:?}");
            assert_eq!(decide(variables, false), in_pipe, "{variables:?}");
        }
    }

    #[test]
    fn names_cannot_drive_the_terminal_or_forge_a_line() {
        assert_eq!(
            escaped("a.pbrt:1:2: wrong\n  included from b.pbrt"),
            "a.pbrt:1:2: wrong\n  included from b.pbrt"
        );
        assert_eq!(escaped("\x1b]0;x\x07\0.csv"), "\\u{1b}]0;x\\u{7}\\u{0}.csv");
        assert_eq!(escaped("x\nerror: y"), "x\\nerror: y");
        let json = serde_json::json!({ "name": "\u{9b}31m\x1b \u{202e}é" });
        assert_eq!(escaped_json(&json), "{\n  \"name\": \"\\u009b31m\\u001b \\u202eé\"\n}\n");
        assert_eq!(serde_json::from_str::<serde_json::Value>(&escaped_json(&json)).unwrap(), json);
        assert_eq!(escaped_line("x\n  taken 5\x1b[2J"), "x\\n  taken 5\\u{1b}[2J");
        assert_eq!(escaped("x\u{202e}gpj.exe \u{9b}31m"), "x\\u{202e}gpj.exe \\u{9b}31m");
        assert_eq!(message_text("warning: a\x1b", true), "\x1b[1m\x1b[33mwarning:\x1b[0m a\\u{1b}");
        assert_eq!(message_text("error: a", false), "error: a");
    }
}
