//! Any bytes are a POV-Ray scene or an error with a place.

use std::path::Path;

use lumbre_formats::Input;
use lumbre_formats::pov::{PovOptions, pov_scene};

use super::read_both_ways;

pub(crate) fn run(bytes: &[u8]) {
    read_both_ways(100_000, "error: ", |budget, diagnostics| {
        let input = Input::from_reader("fuzz.pov", bytes, budget)?;
        pov_scene(&input, Path::new("/nowhere"), &PovOptions::default(), budget, diagnostics)
    });
}
