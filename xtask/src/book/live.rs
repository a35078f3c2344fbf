//! The live parts of the book: where the files for browsers are made (`cargo xtask web`), its examples, scenes and
//! figures are edited and run where they stand. The pages are whole without them: what is built is what shows without
//! JavaScript.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result};
use xtask::command::target;

use crate::files;

/// What of `target/web` the book has.
const PARTS: [&str; 2] = ["live", "playground"];

/// Puts the live parts beside the built pages, and lets each page load them. Where they are missing, says so, and the
/// answer is false.
pub(super) fn add(html: &Path) -> Result<bool> {
    let web = target().join("web");
    if PARTS.iter().any(|part| !web.join(part).is_dir()) {
        eprintln!("\nThe book has no live parts, which need WebAssembly: cargo xtask web makes them");
        return Ok(false);
    }
    add_from(&web, html).map(|()| true)
}

fn add_from(web: &Path, html: &Path) -> Result<()> {
    for page in files::with_ending(html, "html")? {
        let text = fs::read_to_string(&page).with_context(|| format!("cannot read {}", page.display()))?;
        let depth = page.strip_prefix(html).unwrap_or(&page).components().count().saturating_sub(1);
        fs::write(&page, with_script(&text, depth)?)
            .with_context(|| format!("cannot write {}", page.display()))?;
    }
    PARTS.iter().try_for_each(|part| files::copy(&web.join(part), &html.join(part)))
}

/// A page this many folders below the book, which loads the live parts.
fn with_script(text: &str, depth: usize) -> Result<String> {
    let up = "../".repeat(depth);
    let (head, rest) = text.split_once("</head>").context("a page without a head")?;
    let more = format!(
        "<link rel=\"stylesheet\" href=\"{up}live/live.css\">\n<script defer src=\"{up}live/live.js\"></script>\n"
    );
    Ok(format!("{head}{more}</head>{rest}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_page_loads_the_live_parts_from_where_it_is() {
        let folder = tempfile::tempdir().expect("a folder");
        let (web, html) = (folder.path().join("web"), folder.path().join("html"));
        for part in PARTS {
            fs::create_dir_all(web.join(part)).expect("a folder");
            fs::write(web.join(part).join("index.html"), "<head></head>").expect("a file");
        }
        fs::create_dir_all(html.join("es/light")).expect("a folder");
        for page in ["index.html", "es/light/a.html"] {
            fs::write(html.join(page), "<html><head><title>a</title></head><body></body></html>")
                .expect("a file");
        }
        add_from(&web, &html).expect("both parts are there");
        let read = |page: &str| fs::read_to_string(html.join(page)).expect("a page");
        assert!(read("index.html").contains("<script defer src=\"live/live.js\">"));
        assert!(
            read("es/light/a.html")
                .contains("<script defer src=\"../../live/live.js\"></script>\n</head><body>")
        );
        // The pages of the parts have their own.
        assert_eq!(read("playground/index.html"), "<head></head>");
        with_script("no page", 0).expect_err("it has no head");
    }
}
