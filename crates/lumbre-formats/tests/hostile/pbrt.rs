//! Any bytes are a scene or an error at a place of it.

use lumbre_formats::pbrt;

use super::read_both_ways;

pub(crate) fn run(bytes: &[u8]) {
    read_both_ways(100_000, "error: fuzz.pbrt", |budget, diagnostics| {
        pbrt::read_bytes("fuzz.pbrt", bytes, None, budget, diagnostics)
    });
}
