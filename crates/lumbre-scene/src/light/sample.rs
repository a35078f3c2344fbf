//! What sampling a light gives.

use lumbre_geometry::Surface;
use lumbre_math::DVec3;
use lumbre_shading::{Scatter, Spectrum};

/// Light that arrives at a point from a sampled direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSample {
    /// Unit, towards the light.
    pub towards: DVec3,
    /// Its source; `None` for a light at infinity.
    pub end: Option<LightPoint>,
    /// The radiance that arrives if unoccluded; for [`Scatter::Delta`], the irradiance on a surface perpendicular to
    /// it.
    pub radiance: Spectrum,
    /// How the direction was chosen, per unit solid angle.
    pub scatter: Scatter,
}

/// The end of a shadow ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightPoint {
    /// The point.
    pub point: DVec3,
    /// An error bound of each component; zero for exact points.
    pub error: DVec3,
    /// The normal there; zero without a surface.
    pub normal: DVec3,
}

impl LightSample {
    /// The sample with directions more likely by this factor: the density grows by it; the radiance of a delta light,
    /// which includes the division by the density, shrinks.
    pub(crate) fn of_density(mut self, factor: f64) -> Self {
        match &mut self.scatter {
            Scatter::Density(pdf) => *pdf *= factor as f32,
            Scatter::Delta => self.radiance *= (1.0 / factor) as f32,
        }
        self
    }
}

impl LightPoint {
    pub(crate) fn on(surface: &Surface) -> Self {
        Self { point: surface.point, error: surface.point_error, normal: surface.normal }
    }

    pub(crate) fn bare(point: DVec3) -> Self {
        Self { point, error: DVec3::ZERO, normal: DVec3::ZERO }
    }
}

/// The density per unit solid angle of uniform sampling by area: distance² / (|cos θ| area). `None` when seen
/// edge-on.
#[inline]
pub(super) fn per_solid_angle(area: f64, arm: DVec3, normal: DVec3) -> Option<f64> {
    let squared = arm.length_squared();
    let pdf = squared * squared.sqrt() / (normal.dot(arm).abs() * area);
    (pdf > 0.0 && pdf.is_finite()).then_some(pdf)
}
