//! Live examples: the commands of a page are run, and what they print is shown below each.

use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, bail};

/// What is said of a block in the line that opens it: `console` or `console,head=20`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Example {
    /// How many lines of each output are shown, if not all.
    head: Option<usize>,
}

impl Example {
    /// `None` for blocks of other kinds.
    pub(crate) fn from_info(info: &str) -> Result<Option<Self>> {
        let mut words = info.split(',').map(str::trim);
        if words.next() != Some("console") {
            return Ok(None);
        }
        let mut head = None;
        for word in words {
            match word.strip_prefix("head=").and_then(|number| number.parse().ok()) {
                Some(lines) => head = Some(lines),
                None => bail!("{word} says nothing of an example: head=NUMBER does"),
            }
        }
        Ok(Some(Self { head }))
    }

    /// The commands with what they print, or which line (from 0) is wrong and why.
    pub(crate) fn run(
        self,
        text: &str,
        folder: &Path,
        program: &Path,
    ) -> Result<String, (usize, anyhow::Error)> {
        let mut shown = String::new();
        for (number, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
            if !shown.is_empty() {
                shown.push('\n');
            }
            let said = self.run_line(line, folder, program).map_err(|error| (number, error))?;
            shown.push_str(&said);
        }
        Ok(shown)
    }

    fn run_line(self, line: &str, folder: &Path, program: &Path) -> Result<String> {
        let (command, must_fail) = match (line.strip_prefix("$ "), line.strip_prefix("$! ")) {
            (Some(command), _) => (command, false),
            (_, Some(command)) => (command, true),
            _ => bail!("an example holds only commands, each after $ or, where it has to fail, after $!"),
        };
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
        let lines: Vec<&str> = said.lines().map(str::trim_end).collect();
        let most = self.head.unwrap_or(usize::MAX);
        let mut shown = format!("$ {command}\n");
        for line in lines.iter().take(most) {
            shown.push_str(line);
            shown.push('\n');
        }
        if most < lines.len() {
            shown.push_str("…\n");
        }
        Ok(shown)
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    fn run(info: &str, text: &str) -> Result<String, (usize, anyhow::Error)> {
        let example = Example::from_info(info).expect("known words").expect("an example");
        example.run(text, Path::new("/"), Path::new("echo"))
    }

    #[test]
    fn what_a_command_prints_stands_below_it() {
        let shown = run("console", "$ lumbre a 'b  c'\n$! lumbre d; false\n").expect("both as they should");
        assert_eq!(shown, "$ lumbre a 'b  c'\na b  c\n\n$ lumbre d; false\nd\n");
        let cut = run("console,head=2", "$ printf '1\\n2\\n3\\n'").expect("it prints");
        assert_eq!(cut, "$ printf '1\\n2\\n3\\n'\n1\n2\n…\n");
    }

    #[test]
    fn what_fails_or_should_have_is_named_with_its_line() {
        for text in ["\n$ false", "\n$! true", "\n$ exit 101", "\n$! exit 101", "\n$! kill $$", "\nlumbre"] {
            assert_eq!(run("console", text).expect_err(text).0, 1, "{text}");
        }
        assert_eq!(Example::from_info("rust").expect("another kind"), None);
        assert!(Example::from_info("console,tail=3").is_err());
    }
}
