//! What fuzzing found and kept: its corpora, and files that once broke a reader.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::fs;
use std::path::Path;

use crate::hostile::CHECKS;

#[test]
fn every_file_that_fuzzing_kept_is_read_or_refused() {
    let fuzz = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz");
    let mut count = 0;
    for (name, check) in CHECKS {
        for folder in ["corpus", "regressions"] {
            // A packaged crate has none.
            let Ok(files) = fs::read_dir(fuzz.join(folder).join(name)) else { continue };
            for file in files {
                let path = file.unwrap().path();
                println!("{}", path.display());
                check(&fs::read(&path).unwrap());
                count += 1;
            }
        }
    }
    assert!(count >= 40 || !fuzz.exists(), "{count} files");
}
