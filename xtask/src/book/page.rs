//! Pages as they are read in the repository, and as mdbook takes them: files that they show and what their examples
//! print are up to date in both; for mdbook formulas become MathML, pictures are rendered, and links that leave the
//! book lead to the repository.

use std::borrow::Cow;
use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsStr;
use std::fs;
use std::ops::Range;
use std::path::{Component, Path, PathBuf};

use anyhow::{Context, Result};
use pulldown_cmark::{CodeBlockKind, CowStr, Event, Options, Parser, Tag};

use crate::files;

use super::console::Example;
use super::picture::{Kept, Pictures};
use super::{PAGES, formula, include};

/// Where the sources are to be seen.
const REPOSITORY: &str = env!("CARGO_PKG_REPOSITORY");

/// Something wrong in a page, with its place.
type Fault = String;

/// What is put in place of a part of a page.
struct Change {
    place: Range<usize>,
    text: String,
}

/// A page as it is to stand in the repository, and as mdbook takes it.
struct Prepared {
    kept: String,
    book: String,
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
    /// The small pictures of the repository.
    kept: RefCell<Kept>,
    /// What examples showed: pages in two languages share those whose commands are the same, and each is run once.
    shown: RefCell<BTreeMap<(Example, String), String>>,
    /// Whether the repository is brought up to date, and nothing else.
    update: bool,
}

impl<'a> Preparer<'a> {
    pub(crate) fn new(
        root: &'a Path,
        copy: &'a Path,
        program: &'a Path,
        rendered: &'a Path,
        quick: bool,
        update: bool,
    ) -> Result<Self> {
        let pictures = Pictures { program, kept: rendered, quick };
        let kept = RefCell::new(Kept::read(&root.join(PAGES))?);
        let shown = RefCell::default();
        Ok(Self { root, copy, program, pictures, kept, shown, update })
    }

    /// Prepares every page, and says all that is wrong in them: also where the page of the repository is not up to
    /// date, unless it is brought up to date. With `only`, those alone whose path contains one of them.
    pub(crate) fn prepare_all(&self, only: &[String]) -> Result<Vec<Fault>> {
        let folder = self.copy.join(PAGES);
        let mut faults = Vec::new();
        let summary = fs::read_to_string(folder.join("SUMMARY.md")).context("cannot read SUMMARY.md")?;
        let listed: BTreeSet<PathBuf> = links_of(&summary).map(|link| folder.join(&*link)).collect();
        for page in files::with_ending(&folder, "md")? {
            let name = page.strip_prefix(self.copy).unwrap_or(&page).to_owned();
            let is_asked = only.is_empty() || only.iter().any(|part| name.to_string_lossy().contains(part));
            if page.file_name() == Some(OsStr::new("SUMMARY.md")) || !is_asked {
                continue;
            }
            if !listed.contains(&page) {
                faults.push(format!("{}: no line of SUMMARY.md leads to this page", name.display()));
            }
            let text =
                fs::read_to_string(&page).with_context(|| format!("cannot read {}", page.display()))?;
            let Prepared { kept, book } = self.prepare(&name, &text, &mut faults)?;
            fs::write(&page, book).with_context(|| format!("cannot write {}", page.display()))?;
            if kept != text && self.update {
                let original = self.root.join(&name);
                fs::write(&original, kept).with_context(|| format!("cannot write {}", original.display()))?;
            } else if let Some(line) = first_difference(&text, &kept) {
                faults.push(format!("{}:{line}: not up to date (cargo xtask book --update)", name.display()));
            }
        }
        if self.update {
            self.kept.borrow().write(&self.root.join(PAGES))?;
        }
        Ok(faults)
    }

    /// The page of this name, relative to the root, prepared.
    fn prepare(&self, name: &Path, text: &str, faults: &mut Vec<Fault>) -> Result<Prepared> {
        // Their lines may be others then: what is wrong is said with that of the page that was read.
        let folder = self.copy.join(name);
        let text = match include::expanded(name, folder.parent().unwrap_or(&folder), text) {
            Ok(expanded) => Cow::Owned(expanded),
            Err(error) => {
                faults.push(format!("{error:#}"));
                Cow::Borrowed(text)
            }
        };
        let text = &*text;
        let mut changes = Vec::new();
        // What is shown by examples, which is to stand in the repository, too.
        let mut shown_there = Vec::new();
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
                    Some((example, place, commands)) => match self.run(example, &commands) {
                        Ok(shown) => {
                            let commands = commands.trim_end();
                            let is_same = example.is_same(commands, shown.trim_end());
                            let shown = if is_same { commands } else { &shown };
                            let info = text[place.clone()].lines().next().unwrap_or_default();
                            let info = info.trim_start_matches('`');
                            shown_there.push(Change {
                                place: place.clone(),
                                text: fenced(shown, info, text, &place),
                            });
                            Ok(Some(fenced(shown, "console", text, &place)))
                        }
                        Err((number, error)) => {
                            let lines = text[place.clone()].split_inclusive('\n').take(number + 1);
                            say(place.start + lines.map(str::len).sum::<usize>(), &error);
                            Ok(None)
                        }
                    },
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
        if let Some(at) = text.find("{{#include ") {
            say(at, &anyhow::anyhow!("an include that stands in no block of code by itself"));
        }
        Ok(Prepared { kept: changed(text, &shown_there), book: changed(text, &changes) })
    }

    /// Runs an example, unless one with the same commands was run.
    fn run(&self, example: Example, text: &str) -> Result<String, (usize, anyhow::Error)> {
        let commands = text.lines().filter(|line| line.starts_with("$ ")).collect::<Vec<_>>().join("\n");
        let key = (example, commands);
        if let Some(shown) = self.shown.borrow().get(&key) {
            return Ok(shown.clone());
        }
        let shown = example.run(text, &self.copy.join(PAGES), self.program)?;
        self.shown.borrow_mut().insert(key, shown.clone());
        Ok(shown)
    }

    /// Renders a picture that has its scene next to it, and copies one from outside the pages. Returns its new path, if
    /// it moved.
    fn image(&self, page: &Path, link: &str) -> Result<Option<String>> {
        let Some(file) = local_file(page, link) else { return Ok(None) };
        let (from, to) = (self.root.join(&file), self.copy.join(&file));
        let scene = to.with_extension("pbrt");
        if file.starts_with(PAGES) {
            if scene.exists() && file.extension() == Some(OsStr::new("png")) {
                let name = file.strip_prefix(PAGES)?;
                let mut kept = self.kept.borrow_mut();
                if self.update {
                    kept.update(name, &scene, &from, self.program)?;
                    return Ok(None);
                }
                let is_current = from.exists() && kept.is_current(name, &scene)?;
                let picture = self.pictures.picture_of(&scene)?;
                fs::copy(&picture, &to).with_context(|| format!("cannot copy {}", picture.display()))?;
                anyhow::ensure!(is_current, "{link} is not of its scene (cargo xtask book --update)");
            }
            anyhow::ensure!(from.exists(), "there is no picture {link}");
            return Ok(None);
        }
        let inside = Path::new("outside").join(&file);
        let to = self.copy.join(PAGES).join(&inside);
        fs::create_dir_all(to.parent().unwrap_or(&to))?;
        fs::copy(&from, &to).with_context(|| format!("dead link {link}: cannot copy {}", file.display()))?;
        let up = page.components().count().saturating_sub(2);
        Ok(Some(format!("{}{}", "../".repeat(up), inside.display())))
    }

    /// Where a link leads in the book, if not where it says: to the repository, if it leaves the book; to the index
    /// that mdbook makes of a README.
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

/// The first line that is another, from 1; `None` where there is none.
fn first_difference(text: &str, other: &str) -> Option<usize> {
    let same = text.lines().zip(other.lines()).take_while(|(a, b)| a == b).count();
    (text != other).then_some(same + 1)
}

/// A block of code of what was shown, indented as the one that it replaces.
fn fenced(shown: &str, info: &str, text: &str, place: &Range<usize>) -> String {
    let line = text[..place.start].rfind('\n').map_or(0, |end| end + 1);
    let indent = " ".repeat(text[line..place.start].chars().count());
    let mut longest = 2;
    for run in shown.split(|c| c != '`') {
        longest = longest.max(run.len());
    }
    let fence = "`".repeat(longest + 1);
    let mut block = format!("{fence}{info}\n");
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

    fn prepared(text: &str) -> (Prepared, Vec<Fault>) {
        let folder = tempfile::tempdir().expect("a folder");
        let (root, copy) = (folder.path().join("root"), folder.path().join("copy"));
        for folder in [&root, &copy] {
            fs::create_dir_all(folder.join(PAGES).join("more")).expect("a folder");
        }
        fs::write(root.join("seen.png"), "picture").expect("a file");
        let kept = folder.path().join("kept");
        let preparer =
            Preparer::new(&root, &copy, Path::new("echo"), &kept, true, false).expect("nothing is kept");
        let mut faults = Vec::new();
        let page =
            preparer.prepare(Path::new("docs/more/page.md"), text, &mut faults).expect("it can be read");
        (page, faults)
    }

    #[test]
    fn formulas_examples_and_links_are_replaced() {
        let page = "Cost `$x$` \\$5, $x$.\n\n1. one\n   ```console\n   $ lumbre `echo hi`\n   ```\n\n[a](../../seen.png) ![b](../../seen.png) [c](../d.md#e)\n";
        let (Prepared { kept, book: page }, faults) = prepared(page);
        assert_eq!(faults, [""; 0]);
        assert!(kept.contains("   $ lumbre `echo hi`\n   hi\n   ```\n\n[a](../../seen.png)"), "{kept}");
        assert!(page.starts_with("Cost `$x$` \\$5, <math"), "{page}");
        assert!(page.contains("1. one\n   ```console\n   $ lumbre `echo hi`\n   hi\n   ```\n"), "{page}");
        assert!(page.contains("/blob/main/seen.png)"), "{page}");
        assert!(page.contains("![b](../outside/seen.png) [c](../d.md#e)\n"), "{page}");
    }

    #[test]
    fn an_example_that_stands_in_two_places_is_run_once() {
        let page = "```console\n$ echo more >> file; wc -l < file\n```\n\n```console\n$ echo more >> file; wc -l < file\nold\n```\n\n```console\n$ wc -l < file\n```\n";
        let (Prepared { kept, .. }, faults) = prepared(page);
        assert_eq!(faults, [""; 0]);
        assert_eq!(kept.matches("wc -l < file\n1\n").count(), 3, "{kept}");
    }

    #[test]
    fn what_is_wrong_is_said_with_its_line() {
        let (_, faults) = prepared(
            "one\n\n$\\nosuch$\n\n[a](../../none.md)\n\n```console\n$ true\n\n$ false\n```\n{{#include none}}",
        );
        let places: Vec<&str> =
            faults.iter().map(|fault| fault.split(": ").next().unwrap_or_default()).collect();
        assert_eq!(
            places,
            ["docs/more/page.md:3", "docs/more/page.md:5", "docs/more/page.md:10", "docs/more/page.md:12"],
            "{faults:?}"
        );
    }
}
