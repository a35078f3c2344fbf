//! Any bytes are a PLY mesh or an error with a place.

use lumbre_formats::ply::read_ply;

use super::read_both_ways;

pub(crate) fn run(bytes: &[u8]) {
    read_both_ways(1_000_000, "error: ", |budget, diagnostics| {
        read_ply(bytes, &"fuzz.ply".into(), budget, diagnostics)
    });
}
