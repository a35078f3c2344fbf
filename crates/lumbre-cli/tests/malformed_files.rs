//! The files that a case of the catalogue of malformed files brings along.

use std::fs;
use std::path::Path;

/// The files of the lines in front that make some, and the rest of the body: `@FILE NAME text`, with `\n` between
/// lines;
/// `@CUT NAME COUNT of SOURCE`, the first bytes of a picture's file; `@PUT NAME HEX at OFFSET of SOURCE`, with some
/// bytes replaced.
pub(crate) fn files_of(body: &str) -> (Vec<(String, Vec<u8>)>, String) {
    let source = |name: &str| {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/pictures/images");
        fs::read(folder.join(name)).unwrap()
    };
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
