//! Any bytes are an STL file or an error with a place.

use lumbre_formats::stl::read_stl;

use super::read_both_ways;

pub(crate) fn run(bytes: &[u8]) {
    read_both_ways(1_000_000, "error: ", |budget, diagnostics| {
        read_stl(bytes, &"fuzz.stl".into(), budget, diagnostics)
    });
}
