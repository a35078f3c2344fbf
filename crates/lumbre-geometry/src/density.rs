//! Conversion between densities per unit area and per unit solid angle.

use lumbre_math::DVec3;

use crate::{DirectionSample, Ray, Surface, SurfaceSample};

/// A sample by area as a sample of directions from `from`; `None` when it is seen edge-on or lies at `from`.
pub(crate) fn seen_from(from: DVec3, sample: SurfaceSample) -> Option<DirectionSample> {
    let to_point = sample.surface.point - from;
    let pdf = per_solid_angle(sample.pdf, to_point, &sample.surface);
    (pdf > 0.0 && pdf.is_finite()).then_some(DirectionSample { surface: sample.surface, pdf })
}

/// The density per unit solid angle at `ray.origin` of a point sampled with a density of `pdf_area` per unit
/// area; 0 when it is seen edge-on.
pub(crate) fn pdf_seen_from(ray: &Ray, surface: &Surface, pdf_area: f64) -> f64 {
    let pdf = per_solid_angle(pdf_area, surface.point - ray.origin, surface);
    if pdf.is_finite() { pdf } else { 0.0 }
}

/// dω = |cos θ| dA / distance².
fn per_solid_angle(pdf_area: f64, to_point: DVec3, surface: &Surface) -> f64 {
    let distance_squared = to_point.length_squared();
    let projected = surface.normal.dot(to_point).abs() / distance_squared.sqrt();
    pdf_area * distance_squared / projected
}

/// An index chosen in proportion to `shares` by `u` in [0, 1), and the remainder of `u`, again uniform in [0,
/// 1).
pub(crate) fn choose(shares: &[f64], u: f64) -> (usize, f64) {
    let mut left = u * shares.iter().sum::<f64>();
    let mut last = 0;
    for (i, &share) in shares.iter().enumerate() {
        if share <= 0.0 {
            continue;
        }
        if left < share {
            return (i, left / share);
        }
        left -= share;
        last = i;
    }
    (last, 1.0 - f64::EPSILON)
}
