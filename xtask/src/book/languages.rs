//! Pages in two languages: a page of `docs/es` is the page of `docs` with the same name, in Spanish. A test holds both
//! to the same headings, formulas, commands, figures, exercises, tables and links; each has a link to the other below
//! its title.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result};

use crate::files;

/// The folder of the pages in Spanish, below the pages.
pub(super) const SPANISH: &str = "es";

/// Says of the built pages in Spanish that they are: mdbook knows one language for the whole book.
pub(super) fn mark(html: &Path) -> Result<()> {
    let folder = html.join(SPANISH);
    if !folder.exists() {
        return Ok(());
    }
    for page in files::with_ending(&folder, "html")? {
        let text = fs::read_to_string(&page).with_context(|| format!("cannot read {}", page.display()))?;
        let marked = text.replacen("<html lang=\"en\"", "<html lang=\"es\"", 1);
        anyhow::ensure!(marked != text, "{} does not name its language", page.display());
        fs::write(&page, marked).with_context(|| format!("cannot write {}", page.display()))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::path::{Component, PathBuf};

    use pulldown_cmark::{CodeBlockKind, Event, Options, Parser, Tag, TagEnd};
    use xtask::command::root;

    use super::super::PAGES;
    use super::*;

    /// The folders of `docs` all of whose pages are there in both languages.
    const WHOLE: [&str; 2] = ["mathematics", "light"];
    /// What commands look for in what they print: in English, and in Spanish.
    const SOUGHT: [(&str, &str); 2] =
        [("By chance the path", "Por azar el camino"), ("over the density", "entre la densidad")];
    /// The commands that take `--lang`.
    const TRANSLATED: [&str; 2] = ["lumbre explain ", "lumbre math "];

    /// What the same page has in common in all languages.
    #[derive(Debug, Default)]
    struct Outline {
        /// The level of each heading.
        headings: Vec<String>,
        /// Sorted, since the order of words is another; without the words in them.
        formulas: Vec<String>,
        commands: Vec<String>,
        commands_in_tables: Vec<String>,
        /// The blocks of code, by the line that opens each.
        code: Vec<String>,
        /// Figures and links, from the folder of the pages, links sorted; without the folder of a language.
        figures: Vec<String>,
        links: Vec<String>,
        exercises: usize,
        /// The cells of each row of each table.
        rows: Vec<usize>,
    }

    impl Outline {
        /// That of a page of this name, relative to the pages, whose commands are asked for Spanish or not.
        fn of(page: &Path, text: &str, is_spanish: bool) -> Self {
            let mut outline = Self { exercises: text.matches("<details>").count(), ..Self::default() };
            let options = Options::ENABLE_MATH | Options::ENABLE_TABLES | Options::ENABLE_FOOTNOTES;
            let (mut code, mut is_in_table) = (None, false);
            for event in Parser::new_ext(text, options) {
                match event {
                    Event::Start(Tag::Heading { level, .. }) => outline.headings.push(level.to_string()),
                    Event::InlineMath(latex) => outline.formulas.push(without_words(&latex)),
                    Event::DisplayMath(latex) => {
                        outline.formulas.push(format!("$${}", without_words(&latex)))
                    }
                    Event::Start(Tag::CodeBlock(kind)) => {
                        let info = match kind {
                            CodeBlockKind::Fenced(info) => info.to_string(),
                            CodeBlockKind::Indented => String::new(),
                        };
                        outline.code.push(info);
                        code = Some(String::new());
                    }
                    Event::Text(part) => {
                        if let Some(code) = &mut code {
                            code.push_str(&part);
                        }
                    }
                    Event::End(TagEnd::CodeBlock) => {
                        let code = code.take().unwrap_or_default();
                        let is_shell = outline.code.last().is_some_and(|info| info == "sh");
                        outline.commands.extend(commands(&code, is_shell, is_spanish));
                    }
                    Event::Code(code) if is_in_table && code.starts_with("lumbre ") => {
                        outline.commands_in_tables.push(code.replace(" --lang es", ""));
                    }
                    Event::Start(Tag::Image { dest_url, .. }) => {
                        outline.figures.push(neutral(page, &dest_url));
                    }
                    Event::Start(Tag::Link { dest_url, .. }) => {
                        let target = neutral(page, &dest_url);
                        // The link to the other language is not one of the text.
                        if target != neutral_path(page) || dest_url.starts_with('#') {
                            outline.links.push(target);
                        }
                    }
                    Event::Start(Tag::Table(_)) => is_in_table = true,
                    Event::End(TagEnd::Table) => is_in_table = false,
                    Event::Start(Tag::TableHead | Tag::TableRow) => outline.rows.push(0),
                    Event::Start(Tag::TableCell) => {
                        if let Some(cells) = outline.rows.last_mut() {
                            *cells += 1;
                        }
                    }
                    _ => {}
                }
            }
            outline.formulas.sort();
            outline.commands_in_tables.sort();
            outline.links.sort();
            outline
        }
    }

    /// A formula without spaces, and without the words that stand in it.
    fn without_words(latex: &str) -> String {
        let mut rest = latex;
        let mut result = String::new();
        while let Some((before, words)) = rest.split_once(r"\text{") {
            result.push_str(before);
            rest = words.split_once('}').map_or("", |(_, after)| after);
        }
        result.push_str(rest);
        result.retain(|c| !c.is_whitespace());
        result
    }

    /// The commands of a block of code, as they are in English. One that should be asked for Spanish and is not, or the
    /// reverse, is marked.
    fn commands(code: &str, is_shell: bool, is_spanish: bool) -> Vec<String> {
        let command = |line: &str| {
            let command = match line.strip_prefix("$ ") {
                Some(command) => command,
                None if is_shell && line.starts_with("lumbre ") => {
                    line.split(" # ").next().unwrap_or_default().trim()
                }
                None => return None,
            };
            let takes_language = TRANSLATED.iter().any(|name| format!("{command} ").contains(name));
            let mut english = command.replace(" --lang es", "");
            let is_asked = english != command;
            let is_right = is_asked == (is_spanish && takes_language) || (is_asked && !is_spanish);
            for (sought, in_spanish) in SOUGHT {
                english = english.replace(in_spanish, sought);
            }
            Some(if is_right { english } else { format!("{command} (--lang es?)") })
        };
        code.lines().filter_map(command).collect()
    }

    /// Where a link of a page leads, from the folder of the pages, without the folder of a language and without the
    /// place in the page.
    fn neutral(page: &Path, link: &str) -> String {
        match destination(page, link) {
            Some(target) => neutral_path(&target),
            None => link.to_owned(),
        }
    }

    /// The file that a link leads to, from the folder of the pages; `None` for an address.
    fn destination(page: &Path, link: &str) -> Option<PathBuf> {
        let path = link.split('#').next().unwrap_or_default();
        if path.contains(':') {
            return None;
        }
        if path.is_empty() {
            return Some(page.to_owned());
        }
        let mut target = PathBuf::new();
        for part in page.parent().unwrap_or(page).join(path).components() {
            match part {
                Component::ParentDir if target.file_name().is_some() => {
                    target.pop();
                }
                part => target.push(part),
            }
        }
        Some(target)
    }

    fn neutral_path(path: &Path) -> String {
        path.strip_prefix(SPANISH).unwrap_or(path).to_string_lossy().into_owned()
    }

    /// How two pages differ in what they should have in common.
    fn differences(name: &Path, english: &str, spanish: &str) -> Vec<String> {
        let translation = Path::new(SPANISH).join(name);
        let ours = Outline::of(name, english, false);
        let theirs = Outline::of(&translation, spanish, true);
        let mut found = Vec::new();
        let mut compare = |what: &str, ours: &[String], theirs: &[String]| {
            let without = |some: &[String], others: &[String]| {
                let mut others = others.to_vec();
                let mut left = some.to_vec();
                left.retain(|one| match others.iter().position(|other| other == one) {
                    Some(place) => {
                        others.swap_remove(place);
                        false
                    }
                    None => true,
                });
                left
            };
            if ours != theirs {
                let (missing, more) = (without(ours, theirs), without(theirs, ours));
                found.push(format!("{what}: {missing:?} only in English, {more:?} only in Spanish"));
            }
        };
        compare("headings", &ours.headings, &theirs.headings);
        compare("formulas", &ours.formulas, &theirs.formulas);
        compare("commands", &ours.commands, &theirs.commands);
        compare("commands in tables", &ours.commands_in_tables, &theirs.commands_in_tables);
        compare("blocks of code", &ours.code, &theirs.code);
        compare("figures", &ours.figures, &theirs.figures);
        compare("links", &ours.links, &theirs.links);
        if ours.exercises != theirs.exercises {
            found.push(format!("exercises: {} in English, {} in Spanish", ours.exercises, theirs.exercises));
        }
        if ours.rows != theirs.rows {
            found.push(format!("rows of tables: {:?} in English, {:?} in Spanish", ours.rows, theirs.rows));
        }
        let up = "../".repeat(name.components().count());
        let depth = &up[3..];
        for (text, switch) in [
            (english, format!("[Español]({depth}{SPANISH}/{})", name.display())),
            (spanish, format!("[English]({up}{})", name.display())),
        ] {
            if !text.lines().take(5).any(|line| line == switch) {
                found.push(format!("no line {switch} below the title"));
            }
        }
        found
    }

    /// The links of a page in Spanish that lead to an English page, though that one is translated.
    fn strays(name: &Path, spanish: &str, translated: &[PathBuf]) -> Vec<String> {
        let page = Path::new(SPANISH).join(name);
        let stray = |event: Event<'_>| match event {
            Event::Start(Tag::Link { dest_url, .. }) => {
                let target = destination(&page, &dest_url)?;
                (target != name && translated.contains(&target)).then(|| format!("{dest_url} is in English"))
            }
            _ => None,
        };
        Parser::new(spanish).filter_map(stray).collect()
    }

    /// The pages in Spanish, relative to their folder.
    fn translated() -> Vec<PathBuf> {
        let folder = root().join(PAGES).join(SPANISH);
        let pages = files::with_ending(&folder, "md").expect("there are pages");
        pages.iter().map(|page| page.strip_prefix(&folder).expect("it is below").to_owned()).collect()
    }

    #[test]
    fn both_languages_have_the_same_structure() {
        let pages = root().join(PAGES);
        let mut faults = Vec::new();
        let translated = translated();
        for name in &translated {
            let read = |path: PathBuf| {
                fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
            };
            let (english, spanish) = (read(pages.join(name)), read(pages.join(SPANISH).join(name)));
            let mut found = differences(name, &english, &spanish);
            found.extend(strays(name, &spanish, &translated));
            faults.extend(found.into_iter().map(|fault| format!("{}: {fault}", name.display())));
        }
        assert!(faults.is_empty(), "{}", faults.join("\n"));
    }

    #[test]
    fn chapters_and_figures_with_words_are_there_in_both_languages() {
        let pages = root().join(PAGES);
        let translated = translated();
        for folder in WHOLE {
            let names = files::with_ending(&pages.join(folder), "md").expect("there are pages");
            assert!(names.len() > 5, "{folder}");
            for name in names {
                let name = name.strip_prefix(&pages).expect("it is below");
                assert!(translated.iter().any(|one| one == name), "{} is not translated", name.display());
            }
            let figures = files::with_ending(&pages.join(folder), "svg").expect("there are figures");
            for figure in figures {
                let name = figure.strip_prefix(&pages).expect("it is below");
                let english = fs::read_to_string(&figure).expect("it can be read");
                match fs::read_to_string(pages.join(SPANISH).join(name)) {
                    Ok(spanish) => {
                        assert_eq!(drawing(&english), drawing(&spanish), "{}", name.display());
                        assert_ne!(words(&english), words(&spanish), "{}", name.display());
                    }
                    Err(_) => {
                        let words = words(&english);
                        assert!(words.is_empty(), "{} has the words {words:?}", name.display());
                    }
                }
            }
        }
    }

    /// A figure without what is written in it.
    fn drawing(svg: &str) -> Vec<&str> {
        svg.split('<').map(|part| part.split_inclusive('>').next().unwrap_or_default()).collect()
    }

    /// The labels of a figure that are words and not names: of three letters, apart from functions.
    fn words(svg: &str) -> Vec<&str> {
        let is_word = |label: &&str| {
            let mut words = label.split(|c: char| !c.is_alphabetic());
            words.any(|word| word.chars().count() > 2 && !["cos", "sin", "tan"].contains(&word))
        };
        let labels = svg.split("<text").skip(1).filter_map(|part| part.split_once('>'));
        labels.map(|(_, label)| label.split('<').next().unwrap_or_default()).filter(is_word).collect()
    }

    #[test]
    fn differences_between_languages_are_found() {
        let english = "# A\n\n[Español](../es/m/a.md)\n\n## B\n\nThe $x$ of $$y = \\text{one } z$$ is [here](b.md#c).\n\n![p](f/p.svg)\n\n\
                       | a | b |\n|---|---|\n| 1 | `lumbre info` |\n\n```console\n$ lumbre math '1'\n= 1\n\n$ lumbre cast a\n0\n```\n\n1. Q\n   <details>A</details>\n";
        let spanish = "# Á\n\n[English](../../m/a.md)\n\n## B\n\nEn $$y = \\text{un } z$$, [aquí](b.md#d), la $x$.\n\n![p](../../m/f/p.svg)\n\n\
                       | a | b |\n|---|---|\n| 1 | `lumbre info` |\n\n```console\n$ lumbre math --lang es '1'\n= 1\n\n$ lumbre cast a\n0\n```\n\n1. P\n   <details>R</details>\n";
        let found = |spanish: &str| differences(Path::new("m/a.md"), english, spanish);
        assert_eq!(found(spanish), Vec::<String>::new());
        let strays = |pages: &[&str]| {
            let pages: Vec<PathBuf> = pages.iter().map(PathBuf::from).collect();
            strays(Path::new("m/a.md"), &spanish.replace("b.md#d", "../../m/b.md#d"), &pages).len()
        };
        assert_eq!((strays(&["m/a.md", "m/c.md"]), strays(&["m/a.md", "m/b.md"])), (0, 1));
        for (from, to) in [
            ("## B", "### B"),
            ("$x$", "$X$"),
            ("z$$", "w$$"),
            (" --lang es", ""),
            ("lumbre cast a", "lumbre cast --lang es a"),
            ("lumbre cast a", "lumbre cast b"),
            ("lumbre info", "lumbre --help"),
            ("```console", "```text"),
            ("f/p.svg", "f/q.svg"),
            ("b.md#d", "c.md#d"),
            ("<details>", "<p>"),
            ("| 1 | `lumbre info` |\n", ""),
            ("../../m/a.md", "../m/a.md"),
        ] {
            let changed = spanish.replacen(from, to, 1);
            assert_ne!(changed, spanish, "{from}");
            assert!(!found(&changed).is_empty(), "{from} to {to}");
        }
    }

    #[test]
    fn built_pages_in_spanish_say_so() {
        let folder = tempfile::tempdir().expect("a folder");
        mark(folder.path()).expect("there may be none");
        let page = folder.path().join(SPANISH).join("a.html");
        fs::create_dir_all(folder.path().join(SPANISH)).expect("a folder");
        fs::write(&page, "<!DOCTYPE HTML>\n<html lang=\"en\" class=\"light\">").expect("a file");
        mark(folder.path()).expect("it names its language");
        let marked = fs::read_to_string(&page).expect("a file");
        assert_eq!(marked, "<!DOCTYPE HTML>\n<html lang=\"es\" class=\"light\">");
        mark(folder.path()).expect_err("another language");
    }
}
