//! Any bytes are a measured material or an error with a place; what a material reflects is finite and not negative.
use lumbre_formats::measured::read;
use lumbre_formats::{Budget, Limits};
use lumbre_math::{Vec2, Vec3};
use lumbre_shading::measured::Measured;
use lumbre_shading::{Scatter, ShadingFrame};

pub(crate) fn run(bytes: &[u8]) {
    let mut limits = Limits::default();
    limits.memory = 64 << 20;
    let tables = match read(bytes, &"fuzz.bsdf".into(), &Budget::new(limits)) {
        Ok(tables) => tables,
        Err(error) => {
            assert!(error.to_diagnostic().to_string().starts_with("error: "));
            return;
        }
    };
    let bsdf = Measured::new(tables.into());
    let frame = ShadingFrame { s: Vec3::X, t: Vec3::Y, n: Vec3::Z };
    let directions = [[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [-0.3, 0.9, 0.2], [0.1, -0.99, -0.05]];
    let directions = directions.map(|w| frame.to_local(Vec3::from_array(w).normalize()));
    for wo in directions {
        for wi in directions {
            let (value, pdf) = (bsdf.eval(wo, wi), bsdf.pdf(wo, wi));
            assert!(value.min_component() >= 0.0 && pdf >= 0.0 && pdf.is_finite(), "{value:?} {pdf}");
        }
        for u in [Vec2::ZERO, Vec2::new(0.3, 0.9), Vec2::new(0.999, 0.5)] {
            let Some(sample) = bsdf.sample(wo, u) else { continue };
            let Scatter::Density(pdf) = sample.scatter else { panic!("{sample:?}") };
            assert!(pdf > 0.0 && sample.wi.vec().is_finite(), "{sample:?}");
        }
    }
}
