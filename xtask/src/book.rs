//! The book: the pages of `docs/` with their pictures rendered, their examples run and their links tried, as static pages.

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
mod links;
mod page;
mod picture;

/// The version of mdbook that the book is written for.
const MDBOOK: &str = "0.5.4";
/// The folder of the pages, at the root of the repository.
const PAGES: &str = "docs";
/// What pages include and examples read besides, laid out as in the repository.
const BESIDE: [&str; 2] = ["scenes", "crates/lumbre/examples"];

/// How the book is built.
#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct Book {
    /// Pictures of one sample a pixel and a quarter of the width and height, by the program as the tests build it: for the checks alone.
    #[arg(long)]
    quick: bool,
    /// Only gets mdbook where there is none.
    #[arg(long)]
    install_only: bool,
}

impl Book {
    /// Builds the book into `target/book/html`, where mdbook is found or can be had.
    pub(crate) fn run(self) -> Result<()> {
        let mdbook = match find_mdbook() {
            Some(mdbook) => mdbook,
            None => install_mdbook()?,
        };
        if self.install_only { Ok(()) } else { build(&mdbook, self.quick) }
    }
}

/// The checks of the book, where mdbook is found; else that is said.
pub(crate) fn test() -> Result<()> {
    match find_mdbook() {
        Some(mdbook) => build(&mdbook, true),
        None => {
            eprintln!("\nThe book is left out: it needs mdbook 0.5 (cargo xtask book --install-only)");
            Ok(())
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
    let program = program(quick)?;
    let book = target().join("book");
    let (copy, html) = (book.join("root"), book.join("html"));
    for folder in [&copy, &html] {
        if folder.exists() {
            fs::remove_dir_all(folder).with_context(|| format!("cannot remove {}", folder.display()))?;
        }
    }
    for part in BESIDE.into_iter().chain([PAGES]) {
        files::copy(&root().join(part), &copy.join(part))?;
    }
    let pages = copy.join(PAGES);
    let (root, kept) = (root(), book.join("pictures"));
    let preparer = Preparer::new(&root, &copy, &program, &kept, quick);
    let mut faults = preparer.prepare_all()?;
    if faults.is_empty() {
        run_mdbook(mdbook, &pages, &html)?;
        faults = links::check(&html, &pages)?;
    }
    for fault in &faults {
        eprintln!("error: {fault}");
    }
    match faults.len() {
        0 => eprintln!("The book is {}", html.join("index.html").display()),
        count => bail!("{count} faults in the book"),
    }
    Ok(())
}

/// The program that renders the pictures and runs the examples.
fn program(quick: bool) -> Result<PathBuf> {
    if let Some(named) = std::env::var_os("LUMBRE_PROGRAM") {
        let named = PathBuf::from(named);
        return named.canonicalize().with_context(|| format!("cannot find {}", named.display()));
    }
    if quick {
        return tested_program();
    }
    release_program()
}

/// Runs mdbook over the prepared pages. What it warns of, such as a file that is to be included and is not there, is an error here.
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
