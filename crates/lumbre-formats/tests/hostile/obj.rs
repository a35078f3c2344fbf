//! Any bytes are an OBJ file or an error with a place.
use lumbre_formats::obj::read_obj;
use lumbre_formats::{Budget, Diagnostics, Limits, Strictness};

pub(crate) fn run(bytes: &[u8]) {
    let mut limits = Limits::default();
    limits.memory = 64 << 20;
    limits.elements = 1_000_000;
    for strictness in [Strictness::Normal, Strictness::Lenient] {
        let mut diagnostics = Diagnostics::with_strictness(strictness);
        let read = read_obj(bytes, &"fuzz.obj".into(), &Budget::new(limits), &mut diagnostics);
        if let Err(error) = read {
            assert!(error.to_diagnostic().to_string().starts_with("error: "));
        }
        diagnostics.lines();
    }
}
