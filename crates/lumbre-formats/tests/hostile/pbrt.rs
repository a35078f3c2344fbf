//! Any bytes are a scene or an error at a place of it.
use lumbre_formats::{Budget, Diagnostics, Limits, Strictness, pbrt};

pub(crate) fn run(bytes: &[u8]) {
    let mut limits = Limits::default();
    limits.memory = 64 << 20;
    limits.elements = 100_000;
    limits.files = 100;
    for strictness in [Strictness::Normal, Strictness::Lenient] {
        let mut diagnostics = Diagnostics::with_strictness(strictness);
        let scene = pbrt::read_bytes("fuzz.pbrt", bytes, None, &Budget::new(limits), &mut diagnostics);
        if let Err(error) = scene {
            assert!(error.to_diagnostic().to_string().starts_with("error: fuzz.pbrt"));
        }
        diagnostics.lines();
    }
}
