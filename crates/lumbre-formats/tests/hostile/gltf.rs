//! Any bytes are a glTF or a GLB, or an error with a place.
use std::path::Path;

use lumbre_formats::gltf::{GltfOptions, read_gltf};
use lumbre_formats::{Budget, Diagnostics, Limits, Strictness};

pub(crate) fn run(bytes: &[u8]) {
    let mut limits = Limits::default();
    limits.memory = 64 << 20;
    limits.elements = 1_000_000;
    for (strictness, frame) in [(Strictness::Normal, None), (Strictness::Lenient, Some(0.7))] {
        let mut diagnostics = Diagnostics::with_strictness(strictness);
        let mut options = GltfOptions::default();
        options.frame = frame;
        options.shutter = 0.1;
        let budget = Budget::new(limits);
        // A folder that is not there: nothing outside the bytes is to be read.
        let nowhere = Path::new("/nonexistent");
        let read = read_gltf(bytes, &"fuzz.gltf".into(), nowhere, &options, &budget, &mut diagnostics);
        if let Err(error) = read {
            assert!(error.to_diagnostic().to_string().starts_with("error: "));
        }
        diagnostics.lines();
    }
}
