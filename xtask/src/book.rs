//! The book: the pages of `docs/` with their pictures rendered, their examples run and their links tried, as static
//! pages. The pages of the repository have small pictures, what examples print, and the files that they show, too:
//! `cargo xtask book --update` writes them.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};
use clap::Args;
use xtask::command::{self, release_program, root, target, tested_program};

use crate::files;

use page::Preparer;

mod console;
mod formula;
mod include;
mod languages;
mod links;
mod live;
mod page;
mod picture;

/// The version of mdbook that the book is written for.
const MDBOOK: &str = "0.5.4";
/// The folder of the pages, at the root of the repository.
const PAGES: &str = "docs";
/// What pages include and examples read besides, laid out as in the repository.
const BESIDE: [&str; 2] = ["scenes", "crates/lumbre/examples"];

/// The page that a test of the reader of scenes writes, of what the reader accepts.
const COVERAGE: &str = "docs/coverage.md";

/// How the book is built.
#[derive(Args, Clone, Debug)]
pub(crate) struct Book {
    /// Pictures of one sample a pixel and a quarter of the width and height, by the program as the tests build it: for
    /// the checks alone.
    #[arg(long)]
    quick: bool,
    /// Brings the pages of the repository up to date, and builds no book: files that they show, what their examples
    /// print, and small pictures of scenes that are new or have changed.
    #[arg(long, conflicts_with_all = ["quick", "install_only"])]
    update: bool,
    /// With --update, only pages whose path contains one of these, such as light/ or quadric.md.
    #[arg(requires = "update", value_name = "PAGE")]
    pages: Vec<String>,
    /// Only gets mdbook where there is none.
    #[arg(long)]
    install_only: bool,
}

/// Writes the page of what is rendered.
fn write_coverage() -> Result<()> {
    let mut cargo = Command::new("cargo");
    cargo.current_dir(root()).env("LUMBRE_UPDATE_PAGES", "1");
    // Of the whole workspace, so that it is what the tests have compiled.
    cargo.args(["test", "--quiet", "--workspace", "--lib", "pbrt::coverage"]);
    if !cargo.status().context("cargo cannot be started")?.success() {
        bail!("{COVERAGE} cannot be written");
    }
    Ok(())
}

impl Book {
    /// All of it, as it is handed out.
    pub(crate) fn whole() -> Self {
        Self { quick: false, update: false, pages: Vec::new(), install_only: false }
    }

    /// Builds the book into `target/book/html`, where mdbook is found or can be had.
    pub(crate) fn run(self) -> Result<()> {
        if self.update {
            if self.pages.is_empty() || self.pages.iter().any(|page| COVERAGE.contains(page.as_str())) {
                write_coverage()?;
            }
            return prepare(false, true, &self.pages).map(drop);
        }
        let mdbook = match find_mdbook() {
            Some(mdbook) => mdbook,
            None => install_mdbook()?,
        };
        if self.install_only { Ok(()) } else { build(&mdbook, self.quick) }
    }
}

/// The checks of the book; without mdbook, the checks that do not need it, with a message.
pub(crate) fn test() -> Result<()> {
    match find_mdbook() {
        Some(mdbook) => build(&mdbook, true),
        None => {
            eprintln!(
                "\nThe links of the book are not tried: it needs mdbook 0.5 (cargo xtask book --install-only)"
            );
            prepare(true, false, &[]).map(drop)
        }
    }
}

/// mdbook, on the path or where this program puts its tools, of the same minor version: others make other pages.
fn find_mdbook() -> Option<PathBuf> {
    let wanted = MDBOOK.rsplit_once('.').map_or(MDBOOK, |(minor, _)| minor);
    let is_fit = |mdbook: &PathBuf| {
        let output = Command::new(mdbook).arg("--version").output();
        output.is_ok_and(|said| {
            String::from_utf8_lossy(&said.stdout).starts_with(&format!("mdbook v{wanted}."))
        })
    };
    ["mdbook".into(), installed_mdbook()].into_iter().find(is_fit)
}

fn tools() -> PathBuf {
    root().join("target/tools")
}

fn installed_mdbook() -> PathBuf {
    tools().join("bin").join(format!("mdbook{}", std::env::consts::EXE_SUFFIX))
}

fn install_mdbook() -> Result<PathBuf> {
    let (tools, version) = (tools().to_string_lossy().into_owned(), format!("mdbook@{MDBOOK}"));
    // Unoptimised: it runs for some seconds, and compiles in less than a minute. Without what watches and serves.
    let how = ["install", "--locked", "--debug", "--no-default-features", "--features", "search"];
    command::run("cargo", &[&how[..], &["--root", &tools, &version]].concat())?;
    Ok(installed_mdbook())
}

fn build(mdbook: &Path, quick: bool) -> Result<()> {
    let pages = prepare(quick, false, &[])?;
    let html = target().join("book/html");
    if html.exists() {
        fs::remove_dir_all(&html).with_context(|| format!("cannot remove {}", html.display()))?;
    }
    run_mdbook(mdbook, &pages, &html)?;
    languages::mark(&html)?;
    refuse(&links::check(&html, &pages)?)?;
    if live::add(&html)? && quick {
        crate::web::test_book(&html, &program(quick)?)?;
    }
    eprintln!("The book is {}", html.join("index.html").display());
    Ok(())
}

/// Prepares a copy of the pages for mdbook, or updates the pages of the repository (only paths that contain one of
/// `only`, if any). The folder of the copy.
fn prepare(quick: bool, update: bool, only: &[String]) -> Result<PathBuf> {
    let program = program(quick)?;
    let book = target().join("book");
    let copy = book.join("root");
    if copy.exists() {
        fs::remove_dir_all(&copy).with_context(|| format!("cannot remove {}", copy.display()))?;
    }
    for part in BESIDE.into_iter().chain([PAGES]) {
        files::copy(&root().join(part), &copy.join(part))?;
    }
    let (root, rendered) = (root(), book.join("pictures"));
    let preparer = Preparer::new(&root, &copy, &program, &rendered, quick, update)?;
    refuse(&preparer.prepare_all(only)?)?;
    Ok(copy.join(PAGES))
}

fn refuse(faults: &[String]) -> Result<()> {
    for fault in faults {
        eprintln!("error: {fault}");
    }
    anyhow::ensure!(faults.is_empty(), "{} faults in the book", faults.len());
    Ok(())
}

/// The program that renders the pictures and runs the examples.
pub(crate) fn program(quick: bool) -> Result<PathBuf> {
    if let Some(named) = std::env::var_os("LUMBRE_PROGRAM") {
        let named = PathBuf::from(named);
        return named.canonicalize().with_context(|| format!("cannot find {}", named.display()));
    }
    if quick {
        return tested_program();
    }
    release_program()
}

/// Runs mdbook over the prepared pages. What it warns of, such as a file that is to be included and is not there, is an
/// error here.
fn run_mdbook(mdbook: &Path, pages: &Path, html: &Path) -> Result<()> {
    let output = Command::new(mdbook)
        .arg("build")
        .arg(pages)
        .arg("--dest-dir")
        .arg(html)
        .env("NO_COLOR", "1")
        .output()
        .with_context(|| format!("cannot start {}", mdbook.display()))?;
    let said = String::from_utf8_lossy(&output.stderr);
    let is_fault = |line: &&str| line.contains("ERROR") || line.contains("WARN");
    if !output.status.success() || said.lines().any(|line| is_fault(&line)) {
        bail!("mdbook refuses the book:\n{said}");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use pulldown_cmark::{CodeBlockKind, Event, Parser, Tag, TagEnd};

    use super::*;

    /// All that is missing in a page where it is read in the repository, without running anything.
    fn missing(page: &Path, text: &str) -> Vec<String> {
        let mut faults = Vec::new();
        let folder = page.parent().unwrap_or(page);
        match include::expanded(page, folder, text) {
            Ok(expanded) if expanded == text => {}
            Ok(_) => faults.push("a file that it shows has changed".to_owned()),
            Err(error) => faults.push(format!("{error:#}")),
        }
        let mut example = None;
        for event in Parser::new(text) {
            match event {
                Event::Start(Tag::Image { dest_url, .. })
                    if !dest_url.contains(':') && !folder.join(&*dest_url).is_file() =>
                {
                    faults.push(format!("there is no picture {dest_url}"));
                }
                Event::Start(Tag::CodeBlock(CodeBlockKind::Fenced(info))) if info.starts_with("console") => {
                    example = Some(String::new());
                }
                Event::Text(part) => {
                    if let Some(example) = &mut example {
                        example.push_str(&part);
                    }
                }
                Event::End(TagEnd::CodeBlock) => {
                    if let Some(example) = example.take()
                        && example.lines().all(|line| line.is_empty() || line.starts_with("$ "))
                    {
                        faults.push(format!("an example without output: {}", example.trim()));
                    }
                }
                _ => {}
            }
        }
        faults
    }

    #[test]
    fn pages_are_whole_where_they_are_read() {
        let pages = files::with_ending(&root().join(PAGES), "md").expect("there are pages");
        assert!(pages.len() > 30, "{}", pages.len());
        let mut faults = Vec::new();
        for page in pages.into_iter().chain([root().join("README.md")]) {
            let text = fs::read_to_string(&page).expect("it can be read");
            faults.extend(
                missing(&page, &text).into_iter().map(|fault| format!("{}: {fault}", page.display())),
            );
        }
        assert!(faults.is_empty(), "cargo xtask book --update mends these:\n{}", faults.join("\n"));
    }

    /// The exercises of a page whose answer neither has a command that computes it, nor is marked as one of reasoning
    /// alone.
    fn uncomputed(text: &str) -> Vec<String> {
        let answers = text.split("<details>").skip(1).filter_map(|rest| rest.split("</details>").next());
        let is_computed = |answer: &&str| !answer.contains("```console") && !answer.contains(REASONED);
        answers.filter(is_computed).map(str::to_owned).collect()
    }

    /// What an answer has in place of a command where there is nothing to compute.
    const REASONED: &str = "<!-- reasoned -->";

    #[test]
    fn answers_of_exercises_are_computed() {
        let (mut exercises, mut reasoned) = (0, 0);
        let mut faults = Vec::new();
        for folder in ["mathematics", "light"] {
            for page in files::with_ending(&root().join(PAGES).join(folder), "md").expect("there are pages") {
                let text = fs::read_to_string(&page).expect("it can be read");
                exercises += text.matches("<details>").count();
                reasoned += text.matches(REASONED).count();
                faults.extend(
                    uncomputed(&text).into_iter().map(|answer| format!("{}: {answer}", page.display())),
                );
            }
        }
        assert!(faults.is_empty(), "a command is missing in these answers:\n{}", faults.join("\n"));
        assert!(
            exercises > 100 && reasoned * 10 < exercises,
            "{exercises} exercises, {reasoned} without a command"
        );
        let page =
            "<details>a</details><details>```console\n$ b\n```</details><details><!-- reasoned --></details>";
        assert_eq!(uncomputed(page), ["a"]);
    }

    #[test]
    fn what_is_missing_in_a_page_is_found() {
        let folder = tempfile::tempdir().expect("a folder");
        fs::write(folder.path().join("a.pbrt"), "one\n").expect("a file");
        let missing = |text: &str| missing(&folder.path().join("page.md"), text).len();
        assert_eq!(
            missing("<!-- include a.pbrt -->\n```\none\n```\n```console\n$ a\nb\n```\n![x](a.pbrt)\n"),
            0
        );
        for text in [
            "<!-- include a.pbrt -->\n```\ntwo\n```\n",
            "```\n{{#include a.pbrt}}\n```\n",
            "```console\n$ a\n\n$ b\n```\n",
            "![x](a.png)\n",
        ] {
            assert_eq!(missing(text), 1, "{text}");
        }
    }
}
