//! Live examples: the commands of a page are run, and what they print stands below each, in the page itself.

use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, bail};

/// What is said of a block in the line that opens it: `console`, `console,head=20`, `console,result` or
/// `console,varies`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Example {
    /// How many lines of each output are shown, if not all.
    head: Option<usize>,
    /// Whether only the results of `lumbre math` are shown, without the steps.
    only_results: bool,
    /// Whether the numbers of an output are others each time, as times are.
    varies: bool,
}

/// How a command ends that has to fail.
const FAILS: &str = "# fails";

impl Example {
    /// `None` for blocks of other kinds.
    pub(crate) fn from_info(info: &str) -> Result<Option<Self>> {
        let mut words = info.split(',').map(str::trim);
        if words.next() != Some("console") {
            return Ok(None);
        }
        let mut example = Self { head: None, only_results: false, varies: false };
        for word in words {
            match word.strip_prefix("head=").and_then(|number| number.parse().ok()) {
                Some(lines) => example.head = Some(lines),
                None if word == "result" => example.only_results = true,
                None if word == "varies" => example.varies = true,
                None => bail!("{word} says nothing of an example: head=NUMBER, result and varies do"),
            }
        }
        Ok(Some(example))
    }

    /// Whether one run of the example shows the same as another.
    pub(crate) fn is_same(self, shown: &str, other: &str) -> bool {
        shown == other || (self.varies && without_numbers(shown) == without_numbers(other))
    }

    /// The commands with what they print, or which line (from 0) is wrong and why. What `text` has between its commands
    /// is what they printed before.
    pub(crate) fn run(
        self,
        text: &str,
        folder: &Path,
        program: &Path,
    ) -> Result<String, (usize, anyhow::Error)> {
        let mut shown = String::new();
        let starts = |line: &str| line.starts_with("$ ");
        if !text.trim_start().starts_with("$ ") {
            return Err((0, anyhow::anyhow!("an example begins with a command, after $")));
        }
        for (number, line) in text.lines().enumerate().filter(|(_, line)| starts(line)) {
            if !shown.is_empty() {
                shown.push('\n');
            }
            let said = self.run_line(line, folder, program).map_err(|error| (number, error))?;
            shown.push_str(&said);
        }
        Ok(shown)
    }

    fn run_line(self, line: &str, folder: &Path, program: &Path) -> Result<String> {
        let command = line.strip_prefix("$ ").context("a command stands after $")?;
        let must_fail = command.ends_with(FAILS);
        // A function in place of a folder of the path, as the program may have any name.
        let script = format!("lumbre() {{ \"$LUMBRE_PROGRAM\" \"$@\"; }}\nexec 2>&1\n{command}");
        let output = Command::new("sh")
            .args(["-c", &script])
            .current_dir(folder)
            .env("LUMBRE_PROGRAM", program)
            .envs([("NO_COLOR", "1"), ("COLUMNS", "100"), ("LC_ALL", "C.UTF-8")])
            .stdin(std::process::Stdio::null())
            .output()
            .context("cannot start sh")?;
        let said = String::from_utf8_lossy(&output.stdout);
        let is_orderly = output.status.code().is_some_and(|code| code != 101 && (code != 0) == must_fail);
        if !is_orderly {
            bail!(
                "{command}: {}{}\n{said}",
                output.status,
                if must_fail { ", which is not as it has to fail" } else { "" }
            );
        }
        let mut lines: Vec<&str> = said.lines().map(str::trim_end).collect();
        if self.only_results {
            lines = results(&lines);
            anyhow::ensure!(
                !lines.is_empty(),
                "{command} prints no result, which is a line that begins with ="
            );
        }
        let most = self.head.unwrap_or(usize::MAX);
        let mut shown = format!("$ {command}\n");
        for line in lines.iter().take(most) {
            anyhow::ensure!(!line.starts_with("$ "), "{command} prints {line}, which looks like a command");
            shown.push_str(line);
            shown.push('\n');
        }
        if most < lines.len() {
            shown.push_str("…\n");
        }
        Ok(shown)
    }
}

/// The results among the lines that `lumbre math` prints: each begins with `=`, and goes on while its brackets are
/// open.
fn results<'a>(lines: &[&'a str]) -> Vec<&'a str> {
    let mut shown = Vec::new();
    let mut open = 0_usize;
    for line in lines {
        if open > 0 || line.starts_with("= ") {
            open = (open + line.matches('[').count()).saturating_sub(line.matches(']').count());
            shown.push(*line);
        }
    }
    shown
}

/// A text with a mark in place of each number, together with its unit where that is one of time: a slower run takes
/// seconds in place of milliseconds.
fn without_numbers(text: &str) -> String {
    let mut result = String::new();
    let mut rest = text;
    while let Some(at) = rest.find(|c: char| c.is_ascii_digit()) {
        result.push_str(&rest[..at]);
        result.push('#');
        rest = rest[at..].trim_start_matches(|c: char| c.is_ascii_digit() || matches!(c, '.' | 'e' | '-'));
        let unit = TIME_UNITS.iter().find_map(|unit| rest.strip_prefix(unit));
        rest = unit.filter(|after| !after.starts_with(char::is_alphanumeric)).unwrap_or(rest);
    }
    result + rest
}

/// Units of time, as they stand after a number.
const TIME_UNITS: [&str; 6] = [" ns", " µs", " ms", " s", " min", " h"];

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    fn run(info: &str, text: &str) -> Result<String, (usize, anyhow::Error)> {
        let example = Example::from_info(info).expect("known words").expect("an example");
        example.run(text, Path::new("/"), Path::new("echo"))
    }

    #[test]
    fn what_a_command_prints_stands_below_it() {
        let expected = "$ lumbre a 'b  c'\na b  c\n\n$ lumbre d; false # fails\nd\n";
        let commands = "$ lumbre a 'b  c'\n$ lumbre d; false # fails\n";
        for text in [commands, expected] {
            assert_eq!(run("console", text).expect("both as they should"), expected);
        }
        let cut = run("console,head=2", "$ printf '1\\n2\\n3\\n'").expect("it prints");
        assert_eq!(cut, "$ printf '1\\n2\\n3\\n'\n1\n2\n…\n");
    }

    #[test]
    fn only_results_are_shown_where_that_is_asked() {
        let text = "$ printf 'cross(a, b)\\n  = [1·2]\\n= 5\\nM\\n= [[1, 2],\\n   [3, 4]]\\ntail\\n'";
        let shown = run("console,result", text).expect("it prints");
        assert_eq!(shown, format!("{text}\n= 5\n= [[1, 2],\n   [3, 4]]\n"));
        assert_eq!(run("console,result", "\n$ echo 5").expect_err("no result").0, 1);
    }

    #[test]
    fn what_fails_or_should_have_is_named_with_its_line() {
        for text in ["false", "true # fails", "exit 101", "exit 101 # fails", "kill $$ # fails", "echo '$ a'"]
        {
            assert_eq!(run("console", &format!("\n$ {text}")).expect_err(text).0, 1, "{text}");
        }
        assert_eq!(run("console", "lumbre").expect_err("no command").0, 0);
        assert_eq!(Example::from_info("rust").expect("another kind"), None);
        assert!(Example::from_info("console,tail=3").is_err());
    }

    #[test]
    fn times_are_other_numbers_where_that_is_said() {
        let example = |info| Example::from_info(info).expect("known words").expect("an example");
        let (one, other) = ("a 1.25 s, 3 pixels", "a 12e-3 s, 3 pixels");
        assert!(example("console,varies").is_same(one, other) && !example("console").is_same(one, other));
        assert!(!example("console,varies").is_same(one, "a 1.25 s, 3 rays"));
        assert!(example("console,varies").is_same(one, "a 999 ms, 3 pixels"));
        assert!(!example("console,varies").is_same("2 shapes", "2 handles"));
    }
}
