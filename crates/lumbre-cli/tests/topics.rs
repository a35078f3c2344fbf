//! The table of topics of the mathematics, `docs/mathematics/topics.md`, walked line by line, and the same table in
//! Spanish: everything it names is there, and every command runs.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A line of the table.
struct Topic {
    name: String,
    chapter: String,
    anchor: String,
    function: String,
    /// `None` where no command reaches the function.
    command: Option<String>,
    test: String,
}

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn read(path: &Path) -> Result<String, String> {
    fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))
}

/// What stands between backticks.
fn code(cell: &str) -> Result<String, String> {
    let inner = cell.strip_prefix('`').and_then(|rest| rest.strip_suffix('`'));
    inner.map(str::to_owned).ok_or_else(|| format!("{cell:?} is not in backticks"))
}

fn topic(line: &str) -> Result<Topic, String> {
    let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
    let [name, chapter, function, command, test] = cells[..] else {
        return Err(format!("{} cells, not 5", cells.len()));
    };
    let link = chapter.split_once("](").and_then(|(_, rest)| rest.strip_suffix(')'));
    let link = link.ok_or_else(|| format!("{chapter:?} is no link"))?;
    let (chapter, anchor) = link.split_once('#').ok_or_else(|| format!("{link:?} has no heading"))?;
    let command = if command == "–" { None } else { Some(code(command)?) };
    Ok(Topic {
        name: name.to_owned(),
        chapter: chapter.to_owned(),
        anchor: anchor.to_owned(),
        function: code(function)?,
        command,
        test: code(test)?,
    })
}

/// The anchor that a heading gets in the book.
fn anchor_of(heading: &str) -> String {
    let letter = |c: char| match c {
        c if c.is_whitespace() => Some('-'),
        c if c.is_alphanumeric() || c == '-' || c == '_' => Some(c),
        _ => None,
    };
    heading.trim_start_matches('#').trim().to_lowercase().chars().filter_map(letter).collect()
}

fn check_chapter(topic: &Topic, folder: &str) -> Result<(), String> {
    let text = read(&repository().join(folder).join(&topic.chapter))?;
    let has_heading = text.lines().any(|line| line.starts_with('#') && anchor_of(line) == topic.anchor);
    has_heading.then_some(()).ok_or_else(|| format!("{} has no heading {}", topic.chapter, topic.anchor))
}

/// All Rust files of a folder.
fn sources(folder: &Path) -> Result<Vec<String>, String> {
    let mut texts = Vec::new();
    for entry in fs::read_dir(folder).map_err(|e| format!("{}: {e}", folder.display()))? {
        let path = entry.map_err(|e| e.to_string())?.path();
        if path.is_dir() {
            texts.extend(sources(&path)?);
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            texts.push(read(&path)?);
        }
    }
    Ok(texts)
}

/// Whether a public item of one of these kinds has this name.
fn defines(text: &str, kinds: &[&str], name: &str) -> bool {
    text.lines().any(|line| {
        let Some(rest) = line.trim_start().strip_prefix("pub ") else { return false };
        kinds.iter().any(|kind| {
            let named = rest.strip_prefix(kind).and_then(|rest| rest.strip_prefix(' '));
            named
                .and_then(|rest| rest.strip_prefix(name))
                .is_some_and(|after| !after.starts_with(|c: char| c.is_alphanumeric() || c == '_'))
        })
    })
}

const FUNCTIONS: &[&str] = &["fn", "const fn"];
const TYPES: &[&str] = &["struct", "enum", "trait", "type"];

fn check_function(topic: &Topic, _: &str) -> Result<(), String> {
    let path: Vec<&str> = topic.function.split("::").collect();
    let [krate, .., name] = path[..] else { return Err(format!("{} is no path", topic.function)) };
    let folder = repository().join("crates").join(krate.replace('_', "-")).join("src");
    let texts = sources(&folder)?;
    let is_type = |name: &str| name.starts_with(char::is_uppercase);
    let found = match path[path.len() - 2] {
        _ if is_type(name) => texts.iter().any(|text| defines(text, TYPES, name)),
        // A method stands in the file of its type.
        owner if is_type(owner) => {
            texts.iter().any(|text| defines(text, TYPES, owner) && defines(text, FUNCTIONS, name))
        }
        _ => texts.iter().any(|text| defines(text, FUNCTIONS, name)),
    };
    found.then_some(()).ok_or_else(|| format!("{} is not defined", topic.function))
}

/// The words of a command; single quotes hold one together.
fn words(command: &str) -> Vec<String> {
    let (mut words, mut word, mut is_quoted) = (Vec::new(), None::<String>, false);
    for c in command.chars() {
        match c {
            '\'' => {
                is_quoted = !is_quoted;
                word.get_or_insert_default();
            }
            ' ' if !is_quoted => words.extend(word.take()),
            c => word.get_or_insert_default().push(c),
        }
    }
    words.into_iter().chain(word).collect()
}

fn check_command(topic: &Topic, folder: &str) -> Result<(), String> {
    let Some(command) = &topic.command else { return Ok(()) };
    let words = words(command);
    if words.first().is_none_or(|program| program != "lumbre") {
        return Err(format!("{command:?} is no command of lumbre"));
    }
    let speaks = ["explain", "math"].contains(&words.get(1).map_or("", String::as_str));
    if speaks && (folder == SPANISH) != command.contains(" --lang es ") {
        return Err(format!("{command:?} is in the other language"));
    }
    let output = Command::new(env!("CARGO_BIN_EXE_lumbre"))
        .args(&words[1..])
        .current_dir(repository().join("docs"))
        .output()
        .map_err(|e| e.to_string())?;
    let is_right = output.status.success() && output.stderr.is_empty() && !output.stdout.is_empty();
    let complaint = String::from_utf8_lossy(&output.stderr).into_owned();
    is_right.then_some(()).ok_or_else(|| format!("{command}: {}: {complaint}", output.status))
}

fn check_test(topic: &Topic, _: &str) -> Result<(), String> {
    let (file, function) =
        topic.test.split_once(": ").ok_or_else(|| format!("{:?} is no test", topic.test))?;
    let text = read(&repository().join("crates").join(file))?;
    let signature = format!("fn {function}()");
    let lines: Vec<&str> = text.lines().map(str::trim).collect();
    let place = lines.iter().position(|line| line.starts_with(&signature));
    let place = place.ok_or_else(|| format!("{file} has no {function}"))?;
    let is_marked =
        lines[..place].iter().rev().take_while(|line| line.starts_with('#')).any(|l| *l == "#[test]");
    is_marked.then_some(()).ok_or_else(|| format!("{function} is no test"))
}

fn complaints(line: &str, folder: &str) -> Vec<String> {
    let topic = match topic(line) {
        Ok(topic) => topic,
        Err(why) => return vec![format!("{line}: {why}")],
    };
    let checks = [check_chapter, check_function, check_command, check_test];
    checks
        .iter()
        .filter_map(|check| check(&topic, folder).err())
        .map(|why| format!("{}: {why}", topic.name))
        .collect()
}

fn lines(text: &str) -> impl Iterator<Item = &str> {
    let is_row = |line: &&str| {
        ["|---", "| topic |", "| tema |"].iter().all(|head| !line.starts_with(head)) && line.starts_with('|')
    };
    text.lines().filter(is_row)
}

/// The folders of the tables, from that of the repository.
const ENGLISH: &str = "docs/mathematics";
const SPANISH: &str = "docs/es/mathematics";

/// The pages of a folder.
fn pages(folder: &Path) -> Result<Vec<String>, String> {
    let mut names = Vec::new();
    for entry in fs::read_dir(folder).map_err(|e| e.to_string())? {
        let name = entry.map_err(|e| e.to_string())?.file_name().to_string_lossy().into_owned();
        names.extend(Some(name).filter(|name| name.ends_with(".md") && name != "topics.md"));
    }
    Ok(names)
}

#[test]
fn every_topic_has_its_chapter_function_command_and_test() -> Result<(), String> {
    let mut counts = Vec::new();
    for folder in [ENGLISH, SPANISH] {
        let text = read(&repository().join(folder).join("topics.md"))?;
        let complaints: Vec<String> = lines(&text).flat_map(|line| complaints(line, folder)).collect();
        assert!(complaints.is_empty(), "{}", complaints.join("\n"));
        let topics: Vec<Topic> = lines(&text).map(topic).collect::<Result<_, _>>()?;
        assert!(topics.len() > 140, "{} topics", topics.len());
        assert!(topics.iter().filter(|topic| topic.command.is_none()).count() <= 3);
        let told: BTreeSet<&str> = topics.iter().map(|topic| topic.chapter.as_str()).collect();
        let of_mathematics = pages(&repository().join(folder))?;
        let of_light = pages(&repository().join(folder).join("../light"))?;
        let of_light = of_light.into_iter().map(|name| format!("../light/{name}"));
        let mut chapters = 0;
        for name in of_mathematics.into_iter().chain(of_light) {
            assert!(told.contains(name.as_str()), "no topic is told in {name}");
            chapters += 1;
        }
        counts.push((topics.len(), chapters));
    }
    assert_eq!(counts[0], counts[1]);
    Ok(())
}

#[test]
fn a_line_that_is_wrong_anywhere_is_noticed() {
    let right = "| Dot product | [vectors](vectors.md#dot-product) | `lumbre_math::vector::dot` | `lumbre math 'dot([1, 2], [3, 4])'` | \
        `lumbre-math/tests/vectors.rs: products_angles_and_projections_of_vectors` |";
    assert_eq!(complaints(right, ENGLISH), Vec::<String>::new());
    let wrong = [
        ("vectors.md#", "vector.md#"),
        ("#dot-product", "#dot-products"),
        ("lumbre_math::vector::dot`", "lumbre_math::vector::dots`"),
        ("lumbre_math::vector::dot`", "lumbre_math::Transform::dot`"),
        ("lumbre_math::vector::dot`", "lumbre_mathematics::vector::dot`"),
        ("lumbre math 'dot(", "lumbre math 'dots("),
        ("`lumbre math", "`math"),
        ("tests/vectors.rs:", "tests/vector.rs:"),
        (": products_angles", ": product_angles"),
        (": products_angles_and_projections_of_vectors", ": records"),
        (" | `lumbre math", " `lumbre math"),
    ];
    for (from, to) in wrong {
        let changed = right.replacen(from, to, 1);
        assert_ne!(changed, right);
        let found = complaints(&changed, ENGLISH);
        assert_eq!(found.len(), 1, "{changed}: {found:?}");
    }
}
