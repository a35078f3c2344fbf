//! The catalogue of malformed files, in memory: what the program says of each is the message of the problem.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::time::Duration;

use lumbre::formats::HeldFiles;
use lumbre_web::{Problem, Session, Wanted};

#[path = "../../lumbre-cli/tests/malformed_files.rs"]
mod malformed_files;

use malformed_files::{Case, common_files, every_case};

/// Opens a file beside others, and renders what opens; or casts the rays that it holds.
fn tried(case: &Case) -> Result<Vec<String>, Problem> {
    let mut files = HeldFiles::default();
    for (name, bytes) in common_files() {
        files.insert(name, bytes);
    }
    for (name, bytes) in &case.files {
        files.insert(name, bytes.clone());
    }
    if case.has_rays() {
        let session = Session::open(files, "good.pbrt", &Wanted::default())?;
        return session.cast(case.bytes.clone(), "closest").map(|_| Vec::new());
    }
    files.insert(&case.name, case.bytes.clone());
    let wanted = Wanted { size: Some((4, 3)), spp: Some(1), ..Wanted::default() };
    let mut session = Session::open(files, &case.name, &wanted)?;
    while !session.step(Duration::from_secs(60))?.done {}
    Ok(session.warnings().to_vec())
}

#[test]
fn every_malformed_file_is_refused_in_the_words_of_the_program() {
    let (all, mut wrong) = (every_case(), Vec::new());
    for case in &all {
        let Case { name, status, said, .. } = case;
        let found = match tried(case) {
            Ok(warnings) => warnings.first().cloned().unwrap_or_default(),
            Err(problem) => format!("error: {}", problem.message.lines().next().unwrap_or_default()),
        };
        // A list of rays has no name of its own, and no system says of files in memory that they are missing.
        let front = |name: &str| format!("error: {name}:");
        let said = if case.has_rays() { said.replace(&front(name), &front("rays")) } else { said.clone() };
        // A browser has less memory.
        let said = said.replace("limit 8589934592", "limit 1073741824");
        let said =
            said.replace("No such file or directory (os error 2)", "no such file among those that are held");
        if found != said && *status != 0 {
            wrong.push(format!("{name}\n  found    {found}\n  expected {status} {said}"));
        }
    }
    assert!(wrong.is_empty(), "{} of {}:\n{}", wrong.len(), all.len(), wrong.join("\n"));
}
