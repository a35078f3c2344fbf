//! Pages as mdbook takes them: formulas become MathML, examples are run, pictures rendered, and links that leave the book lead to the
//! repository.

use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::fs;
use std::ops::Range;
use std::path::{Component, Path, PathBuf};

use anyhow::{Context, Result};
use pulldown_cmark::{CodeBlockKind, CowStr, Event, Options, Parser, Tag};

use crate::files;

use super::console::Example;
use super::picture::Pictures;
use super::{PAGES, formula};

/// Where the sources are to be seen.
const REPOSITORY: &str = env!("CARGO_PKG_REPOSITORY");

/// Something wrong in a page, with its place.
type Fault = String;

/// What is put in place of a part of a page.
struct Change {
    place: Range<usize>,
    text: String,
}

/// Prepares the pages of a copy of what the book is made of.
#[derive(Debug)]
pub(crate) struct Preparer<'a> {
    /// The repository.
    root: &'a Path,
    /// The copy, in which examples are run and pages are changed.
    copy: &'a Path,
    program: &'a Path,
    pictures: Pictures<'a>,
}

impl<'a> Preparer<'a> {
    pub(crate) fn new(
        root: &'a Path,
        copy: &'a Path,
        program: &'a Path,
        kept: &'a Path,
        quick: bool,
    ) -> Self {
        Self { root, copy, program, pictures: Pictures { program, kept, quick } }
    }

    /// Prepares every page, and says all that is wrong in them.
    pub(crate) fn prepare_all(&self) -> Result<Vec<Fault>> {
        let folder = self.copy.join(PAGES);
        let mut faults = Vec::new();
        let summary = fs::read_to_string(folder.join("SUMMARY.md")).context("cannot read SUMMARY.md")?;
        let listed: BTreeSet<PathBuf> = links_of(&summary).map(|link| folder.join(&*link)).collect();
        for page in files::with_ending(&folder, "md")? {
            let name = page.strip_prefix(self.copy).unwrap_or(&page).to_owned();
            if page.file_name() == Some(OsStr::new("SUMMARY.md")) {
                continue;
            }
            if !listed.contains(&page) {
                faults.push(format!("{}: no line of SUMMARY.md leads to this page", name.display()));
            }
            let text =
                fs::read_to_string(&page).with_context(|| format!("cannot read {}", page.display()))?;
            let prepared = self.prepare(&name, &text, &mut faults)?;
            fs::write(&page, prepared).with_context(|| format!("cannot write {}", page.display()))?;
        }
        Ok(faults)
    }

    /// The page of this name, relative to the root, prepared.
    fn prepare(&self, name: &Path, text: &str, faults: &mut Vec<Fault>) -> Result<String> {
        let mut changes = Vec::new();
        let mut say = |at: usize, error: &anyhow::Error| {
            let line = 1 + text[..at].matches('\n').count();
            faults.push(format!("{}:{line}: {error:#}", name.display()));
        };
        let options = Options::ENABLE_MATH | Options::ENABLE_TABLES | Options::ENABLE_FOOTNOTES;
        let mut example: Option<(Example, Range<usize>, String)> = None;
        for (event, place) in Parser::new_ext(text, options).into_offset_iter() {
            let changed = match event {
                Event::InlineMath(latex) => formula::html(&latex, false).map(Some),
                Event::DisplayMath(latex) => formula::html(&latex, true).map(Some),
                Event::Start(Tag::CodeBlock(CodeBlockKind::Fenced(info))) => {
                    Example::from_info(&info).map(|found| {
                        example = found.map(|found| (found, place.clone(), String::new()));
                        None
                    })
                }
                Event::Text(part) => {
                    if let Some((.., commands)) = &mut example {
                        commands.push_str(&part);
                    }
                    Ok(None)
                }
                Event::End(pulldown_cmark::TagEnd::CodeBlock) => match example.take() {
                    Some((example, place, commands)) => {
                        let folder = self.copy.join(PAGES);
                        match example.run(&commands, &folder, self.program) {
                            Ok(shown) => Ok(Some(fenced(&shown, text, &place))),
                            Err((number, error)) => {
                                let lines = text[place.clone()].split_inclusive('\n').take(number + 1);
                                say(place.start + lines.map(str::len).sum::<usize>(), &error);
                                Ok(None)
                            }
                        }
                    }
                    None => Ok(None),
                },
                Event::Start(Tag::Image { dest_url, .. }) => {
                    self.image(name, &dest_url).map(|to| relinked(&text[place.clone()], &dest_url, to))
                }
                Event::Start(Tag::Link { dest_url, .. }) => {
                    self.link(name, &dest_url).map(|to| relinked(&text[place.clone()], &dest_url, to))
                }
                _ => Ok(None),
            };
            match changed {
                Ok(Some(text)) => changes.push(Change { place, text }),
                Ok(None) => {}
                Err(error) => say(place.start, &error),
            }
        }
        // mdbook would say which file, and not where.
        for (at, _) in text.match_indices("{{#include ") {
            let named =
                text[at..].trim_start_matches("{{#include ").split(['}', ':']).next().unwrap_or_default();
            let file = self.copy.join(name).with_file_name(named.trim());
            if !file.is_file() {
                say(at, &anyhow::anyhow!("there is no {named} to be included"));
            }
        }
        Ok(changed(text, &changes))
    }

    /// Renders a picture that has its scene beside it, and takes in one from outside the pages. Where it is then, if not where it was.
    fn image(&self, page: &Path, link: &str) -> Result<Option<String>> {
        let Some(file) = local_file(page, link) else { return Ok(None) };
        let (from, to) = (self.root.join(&file), self.copy.join(&file));
        let scene = to.with_extension("pbrt");
        if file.starts_with(PAGES) {
            if !from.exists() && scene.exists() && file.extension() == Some(OsStr::new("png")) {
                let picture = self.pictures.picture_of(&scene)?;
                fs::copy(&picture, &to).with_context(|| format!("cannot copy {}", picture.display()))?;
            }
            return Ok(None);
        }
        let inside = Path::new("outside").join(&file);
        let to = self.copy.join(PAGES).join(&inside);
        fs::create_dir_all(to.parent().unwrap_or(&to))?;
        fs::copy(&from, &to).with_context(|| format!("dead link {link}: cannot copy {}", file.display()))?;
        let up = page.components().count().saturating_sub(2);
        Ok(Some(format!("{}{}", "../".repeat(up), inside.display())))
    }

    /// Where a link leads in the book, if not where it says: to the repository, if it leaves the book; to the index that mdbook makes of
    /// a README.
    fn link(&self, page: &Path, link: &str) -> Result<Option<String>> {
        let Some(file) = local_file(page, link) else { return Ok(None) };
        if file.starts_with(PAGES) {
            return Ok(file.ends_with("README.md").then(|| link.replacen("README.md", "index.md", 1)));
        }
        let found = self.root.join(&file);
        let kind = if found.is_dir() { "tree" } else { "blob" };
        anyhow::ensure!(found.exists(), "dead link {link}: there is no {}", file.display());
        let fragment = link.split_once('#').map(|(_, fragment)| format!("#{fragment}")).unwrap_or_default();
        Ok(Some(format!("{REPOSITORY}/{kind}/main/{}{fragment}", file.display())))
    }
}

fn links_of(text: &str) -> impl Iterator<Item = CowStr<'_>> {
    Parser::new(text).filter_map(|event| match event {
        Event::Start(Tag::Link { dest_url, .. }) => Some(dest_url),
        _ => None,
    })
}

/// The file that a link of a page is to, relative to the root; `None` for links within the page and to elsewhere.
fn local_file(page: &Path, link: &str) -> Option<PathBuf> {
    let path = link.split('#').next().unwrap_or_default();
    if path.is_empty() || path.contains(':') || path.starts_with("//") {
        return None;
    }
    let mut file = PathBuf::new();
    for component in page.parent()?.join(path).components() {
        match component {
            Component::Normal(part) => file.push(part),
            // What leaves the repository stays as it is, and is found to be dead.
            Component::ParentDir if !file.pop() => return None,
            _ => {}
        }
    }
    Some(file)
}

/// A link or a picture in Markdown, with another destination.
fn relinked(markdown: &str, from: &str, to: Option<String>) -> Option<String> {
    let (before, after) = markdown.rsplit_once(from)?;
    Some(format!("{before}{}{after}", to?))
}

/// A block of code of what was shown, indented as the one that it replaces.
fn fenced(shown: &str, text: &str, place: &Range<usize>) -> String {
    let line = text[..place.start].rfind('\n').map_or(0, |end| end + 1);
    let indent = " ".repeat(text[line..place.start].chars().count());
    let mut longest = 2;
    for run in shown.split(|c| c != '`') {
        longest = longest.max(run.len());
    }
    let fence = "`".repeat(longest + 1);
    let mut block = format!("{fence}console\n");
    for line in shown.lines() {
        block.push_str(if line.is_empty() { "" } else { &indent });
        block.push_str(line);
        block.push('\n');
    }
    block + &indent + &fence
}

/// The text with all changes; those inside another are part of it already.
fn changed(text: &str, changes: &[Change]) -> String {
    let mut result = String::with_capacity(text.len());
    let mut done = 0;
    let mut sorted: Vec<&Change> = changes.iter().collect();
    sorted.sort_by_key(|change| change.place.start);
    for change in sorted {
        if change.place.start < done {
            continue;
        }
        result.push_str(&text[done..change.place.start]);
        result.push_str(&change.text);
        done = change.place.end;
    }
    result + &text[done..]
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    fn prepared(text: &str) -> (String, Vec<Fault>) {
        let folder = tempfile::tempdir().expect("a folder");
        let (root, copy) = (folder.path().join("root"), folder.path().join("copy"));
        for folder in [&root, &copy] {
            fs::create_dir_all(folder.join(PAGES).join("more")).expect("a folder");
        }
        fs::write(root.join("seen.png"), "picture").expect("a file");
        let kept = folder.path().join("kept");
        let preparer = Preparer::new(&root, &copy, Path::new("echo"), &kept, true);
        let mut faults = Vec::new();
        let page =
            preparer.prepare(Path::new("docs/more/page.md"), text, &mut faults).expect("it can be read");
        (page, faults)
    }

    #[test]
    fn formulas_examples_and_links_are_replaced() {
        let page = "Cost `$x$` \\$5, $x$.\n\n1. one\n   ```console\n   $ lumbre `echo hi`\n   ```\n\n[a](../../seen.png) ![b](../../seen.png) [c](../d.md#e)\n";
        let (page, faults) = prepared(page);
        assert_eq!(faults, [""; 0]);
        assert!(page.starts_with("Cost `$x$` \\$5, <math"), "{page}");
        assert!(page.contains("1. one\n   ```console\n   $ lumbre `echo hi`\n   hi\n   ```\n"), "{page}");
        assert!(page.contains("/blob/main/seen.png)"), "{page}");
        assert!(page.contains("![b](../outside/seen.png) [c](../d.md#e)\n"), "{page}");
    }

    #[test]
    fn what_is_wrong_is_said_with_its_line() {
        let (_, faults) = prepared(
            "one\n\n$\\nosuch$\n\n[a](../../none.md)\n\n```console\n$ true\n$ false\n```\n{{#include none}}",
        );
        let places: Vec<&str> =
            faults.iter().map(|fault| fault.split(": ").next().unwrap_or_default()).collect();
        assert_eq!(
            places,
            ["docs/more/page.md:3", "docs/more/page.md:5", "docs/more/page.md:9", "docs/more/page.md:11"],
            "{faults:?}"
        );
    }
}
