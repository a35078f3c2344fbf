//! Any bytes are a POV-Ray scene, or settings of one, or an error with a place.

use std::path::Path;

use lumbre_formats::Input;
use lumbre_formats::pov::{PovJob, PovOptions, pov_scene};

use super::read_both_ways;

pub(crate) fn run(bytes: &[u8]) {
    // A file of settings is lines and numbers; what it says is right or has a line.
    let text = String::from_utf8_lossy(bytes);
    if let Err(wrong) = PovJob::default().read_ini(&text, None) {
        assert!(wrong.starts_with("line "), "{wrong}");
    }
    read_both_ways(100_000, "error: ", |budget, diagnostics| {
        let input = Input::from_reader("fuzz.pov", bytes, budget)?;
        pov_scene(&input, Path::new("/nowhere"), &PovOptions::default(), budget, diagnostics)
    });
}
