//! Dead links: every link of the built pages leads to a file, and to an element of it where one is named.

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsStr;
use std::fs;
use std::path::{Component, Path, PathBuf};

use anyhow::{Context, Result};

use crate::files;

/// What a built page has of links.
#[derive(Debug, Default, PartialEq, Eq)]
struct Links {
    /// The names of its elements.
    ids: BTreeSet<String>,
    /// What it leads to.
    targets: BTreeSet<String>,
}

/// All that is wrong with the links of the pages below `html`, which were made of `pages`. Links to elsewhere are
/// looked at for their form only.
pub(crate) fn check(html: &Path, pages: &Path) -> Result<Vec<String>> {
    let mut found = BTreeMap::new();
    for page in files::with_ending(html, "html")? {
        // The page of what is not found is shown at any address, so that its links are to the root.
        if page.file_name() != Some(OsStr::new("404.html")) {
            let text =
                fs::read_to_string(&page).with_context(|| format!("cannot read {}", page.display()))?;
            found.insert(page, links(&text));
        }
    }
    let mut faults = Vec::new();
    for (page, links) in &found {
        for target in &links.targets {
            if let Some(wrong) = fault(page, target, &found) {
                let page = page.strip_prefix(html).unwrap_or(page);
                faults.push(format!("{}: dead link {target}: {wrong}", place(page, target, pages)));
            }
        }
    }
    Ok(faults)
}

/// What is wrong with a link from this page.
fn fault(page: &Path, target: &str, found: &BTreeMap<PathBuf, Links>) -> Option<String> {
    if let Some((scheme, rest)) = target.split_once(':') {
        let host = rest.trim_start_matches('/').split('/').next().unwrap_or_default();
        let is_address = match scheme {
            "http" | "https" => {
                rest.starts_with("//") && host.contains('.') && !target.contains(char::is_whitespace)
            }
            "mailto" => rest.contains('@'),
            "data" => true,
            _ => false,
        };
        return (!is_address).then(|| "this is no address".to_owned());
    }
    let (path, fragment) = target.split_once('#').unwrap_or((target, ""));
    let path = decoded(path.split('?').next().unwrap_or_default());
    let file = if path.is_empty() { page.to_owned() } else { resolved(page.parent()?, &path) };
    let file = if file.is_dir() { file.join("index.html") } else { file };
    if !file.exists() {
        return Some("there is no such file".to_owned());
    }
    let links = found.get(&file)?;
    let is_there = fragment.is_empty() || links.ids.contains(&decoded(fragment));
    (!is_there).then(|| "there is no such place in that page".to_owned())
}

/// A path without its steps upwards.
fn resolved(folder: &Path, path: &str) -> PathBuf {
    let mut file = PathBuf::new();
    for component in folder.join(path).components() {
        match component {
            Component::ParentDir => drop(file.pop()),
            Component::CurDir => {}
            other => file.push(other),
        }
    }
    file
}

/// With `%20` and the like as what they stand for.
fn decoded(text: &str) -> String {
    let mut parts = text.split('%');
    let mut bytes = parts.next().unwrap_or_default().as_bytes().to_vec();
    for part in parts {
        match part.get(..2).and_then(|digits| u8::from_str_radix(digits, 16).ok()) {
            Some(byte) => {
                bytes.push(byte);
                bytes.extend(&part.as_bytes()[2..]);
            }
            None => {
                bytes.push(b'%');
                bytes.extend(part.as_bytes());
            }
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

/// The elements' names and the links of a page. It is made by mdbook, which quotes every attribute and closes every
/// tag.
fn links(html: &str) -> Links {
    let mut links = Links::default();
    let mut rest = html;
    while let Some((_, after)) = rest.split_once('<') {
        // Scripts and comments are skipped as a whole.
        let end = [("!--", "-->"), ("script>", "</script>"), ("style>", "</style>")];
        if let Some((_, end)) = end.into_iter().find(|(start, _)| after.starts_with(start)) {
            rest = after.split_once(end).map_or("", |(_, rest)| rest);
            continue;
        }
        let mut tag = after;
        while let Some(at) = tag.find(['>', '"']) {
            if tag.as_bytes()[at] == b'>' {
                break;
            }
            let (name, value) = (&tag[..at], &tag[at + 1..]);
            let (value, next) = value.split_once('"').unwrap_or((value, ""));
            let name = name.trim_end_matches('=').rsplit(char::is_whitespace).next().unwrap_or_default();
            let value = value.replace("&amp;", "&");
            match name {
                "id" | "name" => drop(links.ids.insert(value)),
                "href" | "src" => drop(links.targets.insert(value)),
                _ => {}
            }
            tag = next;
        }
        rest = tag;
    }
    links
}

/// The page and the line that a link was written in, as far as it can be found.
fn place(page: &Path, target: &str, pages: &Path) -> String {
    let candidates = [page.with_extension("md"), page.with_file_name("README.md")];
    let source = candidates.into_iter().find(|source| pages.join(source).exists());
    let Some(source) = source else { return page.display().to_string() };
    let text = fs::read_to_string(pages.join(&source)).unwrap_or_default();
    let (path, fragment) = target.split_once('#').unwrap_or((target, ""));
    let wanted = [target, fragment, path.trim_end_matches("html")];
    let wanted = wanted.iter().find(|wanted| !wanted.is_empty() && text.contains(**wanted));
    let line = wanted.and_then(|wanted| text.lines().position(|line| line.contains(*wanted)));
    let name = Path::new(super::PAGES).join(source);
    match line {
        Some(line) => format!("{}:{}", name.display(), line + 1),
        None => name.display().to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_and_names_are_those_of_tags() {
        let html = "<!-- <a href=\"no\"> --><script>\"<a href='no'>\"</script><p id=\"a\">href=\"no\"<a class=\"x\" href=\"b?c&amp;d\">\
                    <img alt=\"1 > 0\" src=\"e.png\"></p>";
        let found = links(html);
        assert_eq!(found.targets.iter().collect::<Vec<_>>(), ["b?c&d", "e.png"]);
        assert_eq!(found.ids.iter().collect::<Vec<_>>(), ["a"]);
    }

    #[test]
    fn dead_links_are_named_with_their_lines() {
        let folder = tempfile::tempdir().expect("a folder");
        let (html, pages) = (folder.path().join("html"), folder.path().join("docs"));
        for folder in [html.join("sub"), pages.clone()] {
            fs::create_dir_all(folder).expect("a folder");
        }
        let write = |path: &Path, text: &str| fs::write(path, text).expect("a file");
        let good = "<a href=\"sub/b.html#b\"></a><a href=\"https://example.org/x\"></a><a href=\"#here\" id=\"here\"></a>";
        let bad = "<a href=\"sub/b.html#none\"></a><a href=\"none.html\"></a><img src=\"htps:x\">";
        write(&html.join("a.html"), &format!("{good}{bad}"));
        write(
            &html.join("sub/b.html"),
            "<p id=\"b\"><a href=\"../a.html\"></a><a href=\"../../a.html\"></a>",
        );
        write(&pages.join("a.md"), "\n[x](sub/b.md#none)\n[y](none.md)\n");
        let faults = check(&html, &pages).expect("all can be read");
        let places: Vec<&str> =
            faults.iter().map(|fault| fault.split(": ").next().unwrap_or_default()).collect();
        assert_eq!(places, ["docs/a.md", "docs/a.md:3", "docs/a.md:2", "sub/b.html"], "{faults:?}");
    }
}
