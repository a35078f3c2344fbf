//! Any bytes are a light profile of LM-63 or an error with a place; a profile gives finite candelas in every direction.
use lumbre_formats::ies::read_ies;
use lumbre_formats::{Budget, Limits};

pub(crate) fn run(bytes: &[u8]) {
    let mut limits = Limits::default();
    limits.memory = 64 << 20;
    limits.elements = 1_000_000;
    match read_ies(bytes, &"fuzz.ies".into(), &Budget::new(limits)) {
        Ok(profile) => {
            for direction in DIRECTIONS {
                let candela = profile.candela(direction.into());
                assert!(candela.is_finite() && candela >= 0.0, "{candela} towards {direction:?}");
            }
        }
        Err(error) => assert!(error.to_diagnostic().to_string().starts_with("error: ")),
    }
}

/// Along the axes, and between.
const DIRECTIONS: [[f64; 3]; 8] = [
    [0.0, 0.0, -1.0],
    [0.0, 0.0, 1.0],
    [1.0, 0.0, 0.0],
    [0.0, -1.0, 0.0],
    [0.6, 0.0, -0.8],
    [-0.6, 0.0, 0.8],
    [0.48, -0.6, -0.64],
    [-0.48, 0.6, 0.64],
];
