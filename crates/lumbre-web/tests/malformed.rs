//! The catalogue of malformed files, in memory: what the program says of each is the message of the problem.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::fs;
use std::path::Path;
use std::time::Duration;

use lumbre::formats::HeldFiles;
use lumbre_web::{Problem, Session, Wanted};

#[path = "../../lumbre-cli/tests/malformed_files.rs"]
mod malformed_files;

const HEAD: &str = "Film \"rgb\" \"integer xresolution\" 4 \"integer yresolution\" 3\n\
                    Sampler \"sobol\" \"integer pixelsamples\" 1\nLookAt 0 -8 3 0 0 0 0 0 1\nCamera \"perspective\"\n\
                    WorldBegin\nLightSource \"infinite\"\n";

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

/// Opens a file beside others, and renders what opens; or casts the rays that it holds.
fn tried(name: &str, bytes: &[u8], own: Vec<(String, Vec<u8>)>) -> Result<Vec<String>, Problem> {
    let mut files = HeldFiles::default();
    for text in ["a.txt", "b.txt"] {
        files.insert(text, *b"text\n");
    }
    for (name, bytes) in own {
        files.insert(&name, bytes);
    }
    files.insert("good.pbrt", format!("{HEAD}Shape \"sphere\"\n").into_bytes());
    if name.ends_with(".csv") || name.ends_with(".npy") {
        let session = Session::open(files, "good.pbrt", &Wanted::default())?;
        return session.cast(bytes.to_vec(), "closest").map(|_| Vec::new());
    }
    files.insert(name, bytes);
    let wanted = Wanted { size: Some((4, 3)), spp: Some(1), ..Wanted::default() };
    let mut session = Session::open(files, name, &wanted)?;
    while !session.step(Duration::from_secs(60))?.done {}
    Ok(session.warnings().to_vec())
}

#[test]
fn every_malformed_file_is_refused_in_the_words_of_the_program() {
    let catalogue = Path::new(env!("CARGO_MANIFEST_DIR")).join("../lumbre-cli/tests/malformed");
    let (mut all, mut wrong) = (0, Vec::new());
    for file in fs::read_dir(catalogue).unwrap() {
        let text = fs::read_to_string(file.unwrap().path()).unwrap();
        for block in text.split("\n=== ").skip(1) {
            let (name, rest) = block.split_once('\n').unwrap();
            let (body, rest) = rest.rsplit_once("\n--- ").unwrap_or(("", &rest["--- ".len()..]));
            let (status, said) = rest.split_once('\n').unwrap();
            let body = format!("{body}\n");
            let body = body.strip_suffix("\\\n").unwrap_or(&body);
            let (own, body) = malformed_files::files_of(body);
            let (head, body) = body.strip_prefix("@HEAD\n").map_or(("", body.as_str()), |body| (HEAD, body));
            let said = said.lines().next().unwrap();
            all += 1;
            let found = match tried(name, &[head.as_bytes(), &unescaped(body)].concat(), own) {
                Ok(warnings) => warnings.first().cloned().unwrap_or_default(),
                Err(problem) => format!("error: {}", problem.message.lines().next().unwrap_or_default()),
            };
            // A list of rays has no name of its own, and no system says of files in memory that they are missing.
            let is_of_rays = name.ends_with(".csv") || name.ends_with(".npy");
            let front = |name: &str| format!("error: {name}:");
            let said = if is_of_rays { said.replace(&front(name), &front("rays")) } else { said.to_owned() };
            let said = said
                .replace("No such file or directory (os error 2)", "no such file among those that are held");
            if found != said && status != "0" {
                wrong.push(format!("{name}\n  found    {found}\n  expected {status} {said}"));
            }
        }
    }
    assert!(all >= 270, "{all}");
    assert!(wrong.is_empty(), "{} of {all}:\n{}", wrong.len(), wrong.join("\n"));
}
