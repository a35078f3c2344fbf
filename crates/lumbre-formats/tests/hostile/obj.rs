//! Any bytes are an OBJ file or an error with a place.

use lumbre_formats::obj::read_obj;

use super::read_both_ways;

pub(crate) fn run(bytes: &[u8]) {
    read_both_ways(1_000_000, "error: ", |budget, diagnostics| {
        read_obj(bytes, &"fuzz.obj".into(), budget, diagnostics)
    });
}
