//! Any bytes are volumes of NanoVDB or an error with a place; values of a volume are finite and not negative.
use lumbre_formats::nanovdb::{Values, grid_names, read};
use lumbre_formats::{Budget, Limits};
use lumbre_math::DVec3;

pub(crate) fn run(bytes: &[u8]) {
    let mut limits = Limits::default();
    limits.memory = 64 << 20;
    let (name, budget) = ("fuzz.nvdb".into(), || Budget::new(limits));
    let Ok(names) = grid_names(bytes, &name, &budget()) else { return };
    for grid in names.iter().take(4) {
        match read(bytes, &name, grid, Values::NotNegative, &budget()) {
            Ok(read) => {
                let Some(read) = read else { continue };
                let [low, high] = read.world_bounds;
                for p in [low, high, low.lerp(high, 0.5), DVec3::ZERO] {
                    let value = read.grid.at(p);
                    assert!(value.is_finite() && value >= 0.0, "{value} at {p}");
                }
            }
            Err(error) => assert!(error.to_diagnostic().to_string().starts_with("error: ")),
        }
    }
}
