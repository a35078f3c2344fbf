//! The cases of the catalogue of malformed files, read from the folder `malformed`.

use std::fs;
use std::path::Path;

/// The beginning of most scenes.
const HEAD: &str = "Film \"rgb\" \"integer xresolution\" 4 \"integer yresolution\" 3\n\
                    Sampler \"sobol\" \"integer pixelsamples\" 1\nLookAt 0 -8 3 0 0 0 0 0 1\nCamera \"perspective\"\n\
                    WorldBegin\nLightSource \"infinite\"\n";

pub(crate) struct Case {
    pub(crate) name: String,
    pub(crate) bytes: Vec<u8>,
    /// Files that it names.
    pub(crate) files: Vec<(String, Vec<u8>)>,
    /// The status that the program ends with.
    pub(crate) status: i32,
    /// The first line of what the program says.
    pub(crate) said: String,
}

impl Case {
    /// Whether the file is a list of rays rather than a scene.
    pub(crate) fn has_rays(&self) -> bool {
        self.name.ends_with(".csv") || self.name.ends_with(".npy")
    }
}

/// Every case of every catalogue.
pub(crate) fn every_case() -> Vec<Case> {
    let catalogues = Path::new(env!("CARGO_MANIFEST_DIR")).join("../lumbre-cli/tests/malformed");
    let mut all = Vec::new();
    for file in fs::read_dir(catalogues).unwrap() {
        all.extend(cases(&fs::read_to_string(file.unwrap().path()).unwrap()));
    }
    assert!(all.len() >= 400, "{}", all.len());
    all
}

/// The cases of a catalogue: after `=== NAME` a file, after `--- STATUS` the first line that is said.
fn cases(text: &str) -> Vec<Case> {
    let blocks = text.split("\n=== ").skip(1);
    blocks
        .map(|block| {
            let (name, rest) = block.split_once('\n').unwrap();
            let (body, rest) = rest.rsplit_once("\n--- ").unwrap_or(("", &rest["--- ".len()..]));
            let (status, said) = rest.split_once('\n').unwrap();
            let body = format!("{body}\n");
            let (files, body) = files_of(&body);
            // A backslash at the end of the last line: the file has no end of line there.
            let body = body.strip_suffix("\\\n").unwrap_or(&body);
            let (head, body) = match body.strip_prefix("@HEAD\n") {
                Some(body) => (HEAD, body),
                None => ("", body),
            };
            let bytes = [head.as_bytes(), &unescaped(body)].concat();
            let said = said.lines().next().unwrap().to_owned();
            Case { name: name.to_owned(), bytes, files, status: status.parse().unwrap(), said }
        })
        .collect()
}

/// `\xNN` is a byte and `\\` a backslash.
fn unescaped(text: &str) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut rest = text.as_bytes();
    while let Some((&first, more)) = rest.split_first() {
        rest = more;
        match (first, more) {
            (b'\\', [b'\\', after @ ..]) => {
                bytes.push(b'\\');
                rest = after;
            }
            (b'\\', [b'x', a, b, after @ ..]) => {
                let digits = [*a, *b];
                bytes.push(u8::from_str_radix(std::str::from_utf8(&digits).unwrap(), 16).unwrap());
                rest = after;
            }
            _ => bytes.push(first),
        }
    }
    bytes
}

/// A file of the book's pictures.
fn source(name: &str) -> Vec<u8> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/pictures/images");
    fs::read(folder.join(name)).unwrap()
}

/// The files that any case may name, besides its own.
pub(crate) fn common_files() -> Vec<(&'static str, Vec<u8>)> {
    let text = |name| (name, b"text\n".to_vec());
    let of_book = |name| (name, source(name));
    vec![
        ("good.pbrt", format!("{HEAD}Shape \"sphere\"\n").into_bytes()),
        text("a.txt"),
        text("b.txt"),
        of_book("cloud.nvdb"),
        of_book("satin.bsdf"),
    ]
}

/// The files of the lines in front that make some, and the rest of the body: `@FILE NAME text`, with `\n` between
/// lines; `@CUT NAME COUNT of SOURCE`, the first bytes of a picture's file; `@PUT NAME HEX at OFFSET of SOURCE`, with
/// some bytes replaced.
fn files_of(body: &str) -> (Vec<(String, Vec<u8>)>, String) {
    let mut files = Vec::new();
    let mut rest = body;
    while let Some((line, after)) = rest.split_once('\n') {
        let words: Vec<&str> = line.split(' ').collect();
        let (name, bytes) = match words[..] {
            ["@FILE", name, ..] => {
                let text = line.splitn(3, ' ').nth(2).unwrap_or_default();
                (name, text.replace("\\n", "\n").into_bytes())
            }
            ["@CUT", name, count, "of", of] => {
                (name, source(of)[..count.parse::<usize>().unwrap()].to_owned())
            }
            ["@PUT", name, hex, "at", offset, "of", of] => {
                let (mut bytes, offset) = (source(of), offset.parse::<usize>().unwrap());
                for (i, digits) in hex.as_bytes().chunks(2).enumerate() {
                    bytes[offset + i] = u8::from_str_radix(std::str::from_utf8(digits).unwrap(), 16).unwrap();
                }
                (name, bytes)
            }
            _ => break,
        };
        files.push((name.to_owned(), bytes));
        rest = after;
    }
    (files, rest.to_owned())
}
