//! Files that pages show: the text of each stands in the page, below a comment that names it, so that the page is whole
//! where it is read.
//!
//! ````text
//! <!-- include pictures/first.pbrt -->
//! ```
//! the file
//! ```
//! ````

use std::fs;
use std::path::Path;

use anyhow::{Context, Result};

/// How the comment begins that names a file, relative to the page.
const MARK: &str = "<!-- include ";

/// A page of this name, in this folder, with the files that it shows as they are now. Its comments stay. A block of
/// code that holds `{{#include FILE}}` and nothing else gets its comment here.
pub(crate) fn expanded(name: &Path, folder: &Path, text: &str) -> Result<String> {
    let mut result = String::with_capacity(text.len());
    let mut lines = text.split_inclusive('\n').enumerate().peekable();
    while let Some((number, line)) = lines.next() {
        let place = || format!("{}:{}", name.display(), number + 1);
        let trimmed = line.trim();
        let named = trimmed.strip_prefix(MARK).and_then(|rest| rest.strip_suffix("-->")).map(str::trim);
        let is_asked = trimmed.starts_with("```")
            && lines.peek().is_some_and(|(_, next)| next.trim().starts_with("{{#include "));
        if named.is_none() && !is_asked {
            result.push_str(line);
            if trimmed.starts_with("```") {
                // Another block, as it is.
                let fence = &trimmed[..trimmed.len() - trimmed.trim_start_matches('`').len()];
                for (_, line) in lines.by_ref() {
                    result.push_str(line);
                    if line.trim() == fence {
                        break;
                    }
                }
            }
            continue;
        }
        let indent = &line[..line.len() - line.trim_start().len()];
        let opening = match named {
            Some(_) => {
                result.push_str(line);
                lines.next().map(|(_, opening)| opening.trim()).filter(|opening| opening.starts_with("```"))
            }
            None => Some(trimmed),
        };
        let opening =
            opening.with_context(|| format!("{}: no block of code follows the include", place()))?;
        let fence = &opening[..opening.len() - opening.trim_start_matches('`').len()];
        let mut inside = Vec::new();
        loop {
            let (_, line) =
                lines.next().with_context(|| format!("{}: the block of the include has no end", place()))?;
            if line.trim() == fence {
                break;
            }
            inside.push(line.trim());
        }
        let named = match named {
            Some(named) => named,
            None => {
                let named = match inside[..] {
                    [only] => only.strip_prefix("{{#include ").and_then(|rest| rest.strip_suffix("}}")),
                    _ => None,
                };
                let named = named.with_context(|| format!("{}: no include by itself", place()))?.trim();
                result.push_str(&format!("{indent}{MARK}{named} -->\n"));
                named
            }
        };
        let file = folder.join(named);
        let shown = fs::read_to_string(&file)
            .with_context(|| format!("{}: there is no {named} to be included", place()))?;
        let info = opening.trim_start_matches('`');
        let fence = "`".repeat(fence.len().max(longest_run(&shown) + 1));
        result.push_str(&format!("{indent}{fence}{info}\n"));
        for line in shown.trim_end().lines() {
            let indent = if line.is_empty() { "" } else { indent };
            result.push_str(&format!("{indent}{line}\n"));
        }
        result.push_str(&format!("{indent}{fence}\n"));
    }
    Ok(result)
}

/// The longest run of backticks that could end a block.
fn longest_run(text: &str) -> usize {
    text.split(|c| c != '`').map(str::len).max().unwrap_or(0).max(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_has_the_files_that_it_names() {
        let folder = tempfile::tempdir().expect("a folder");
        fs::create_dir(folder.path().join("sub")).expect("a folder");
        fs::write(folder.path().join("sub/a.pbrt"), "one\n\ntwo ```\n").expect("a file");
        let expanded = |text: &str| expanded(Path::new("page.md"), folder.path(), text);
        let expected = "a\n\n- b\n  <!-- include sub/a.pbrt -->\n  ````pbrt\n  one\n\n  two ```\n  ````\nc\n";
        for text in [
            "a\n\n- b\n  ```pbrt\n  {{#include sub/a.pbrt}}\n  ```\nc\n",
            "a\n\n- b\n  <!-- include sub/a.pbrt -->\n  ```pbrt\n  old\n  ```\nc\n",
            expected,
        ] {
            assert_eq!(expanded(text).expect("it is there"), expected);
        }
        for (text, line) in [
            ("```\n{{#include no.pbrt}}\n```\n", 1),
            ("\n<!-- include sub/a.pbrt -->\n\n```\n```\n", 2),
            ("\n<!-- include sub/a.pbrt -->\n```\n", 2),
        ] {
            let error = expanded(text).expect_err(text).to_string();
            assert!(error.contains(&format!("page.md:{line}: ")), "{error}");
        }
    }
}
