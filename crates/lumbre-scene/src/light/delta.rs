//! Delta lights: point, spot and directional lights, which no ray can hit.

use lumbre_math::{DAffine3, DMat3, DVec3, Elementary, Transform};
use lumbre_shading::{Scatter, Spectrum};

use super::environment::Panorama;
use super::{LightPoint, LightSample};
use crate::EnvironmentDesc;

/// A point light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointLight {
    /// The position.
    pub from: DVec3,
    /// Radiant intensity.
    pub intensity: Spectrum,
}

impl PointLight {
    pub(super) fn sample(&self, at: DVec3) -> Option<LightSample> {
        from_point(self.from, at, self.intensity)
    }
}

/// A spot light with a smooth edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpotLight {
    /// The position.
    pub from: DVec3,
    /// The unit axis of the cone.
    pub axis: DVec3,
    /// Radiant intensity along the axis.
    pub intensity: Spectrum,
    /// The cosine of the angle where the falloff begins.
    pub cos_start: f64,
    /// The cosine of the angle where the falloff ends.
    pub cos_end: f64,
}

impl SpotLight {
    /// A spot light along +z of a space.
    pub fn new(
        world_from_light: &Transform,
        intensity: Spectrum,
        cone_degrees: f32,
        delta_degrees: f32,
    ) -> Self {
        let cone = f64::from(cone_degrees).to_radians();
        let start = (cone - f64::from(delta_degrees).to_radians()).max(0.0);
        Self {
            from: world_from_light.point(DVec3::ZERO),
            axis: world_from_light.vector(DVec3::Z).normalize(),
            intensity,
            cos_start: start.cosine(),
            cos_end: cone.cosine(),
        }
    }

    pub(super) fn sample(&self, at: DVec3) -> Option<LightSample> {
        let cosine = (at - self.from).try_normalize()?.dot(self.axis);
        let share = self.falloff(cosine);
        (share > 0.0).then(|| from_point(self.from, at, self.intensity * share as f32))?
    }

    /// The falloff at an angle with this cosine.
    pub fn falloff(&self, cosine: f64) -> f64 {
        if self.cos_start <= self.cos_end {
            return if cosine >= self.cos_end { 1.0 } else { 0.0 };
        }
        let x = ((cosine - self.cos_end) / (self.cos_start - self.cos_end)).clamp(0.0, 1.0);
        x * x * (3.0 - 2.0 * x)
    }

    /// The integral of the falloff over all directions.
    pub(super) fn solid_angle(&self) -> f64 {
        // The mean of the smoothstep is ½.
        std::f64::consts::TAU * ((1.0 - self.cos_start) + 0.5 * (self.cos_start - self.cos_end))
    }
}

/// A point light with an image of intensity by direction.
#[derive(Clone, Debug)]
pub struct GoniometricLight {
    /// The position.
    pub from: DVec3,
    // Radiant intensity.
    by_direction: Panorama,
    // The mean over all directions and channels.
    mean: f64,
}

impl GoniometricLight {
    /// `None` for an image that is black or empty.
    pub(crate) fn new(
        world_from_light: &Transform,
        intensity: Spectrum,
        image: EnvironmentDesc,
    ) -> Option<Self> {
        // Scale is removed from the space of directions.
        let axes = world_from_light.linear();
        let rotation = DMat3::from_cols(
            axes.x_axis.try_normalize()?,
            axes.y_axis.try_normalize()?,
            axes.z_axis.try_normalize()?,
        );
        let space = Transform::from_affine(DAffine3::from_mat3(rotation)).ok()?;
        let by_direction = Panorama::new(image.image, image.mapping, space, intensity)?;
        let mean = by_direction.mean()?;
        Some(Self { from: world_from_light.point(DVec3::ZERO), by_direction, mean })
    }

    pub(super) fn sample(&self, at: DVec3) -> Option<LightSample> {
        let intensity = self.by_direction.radiance((at - self.from).try_normalize()?);
        (!intensity.is_black()).then(|| from_point(self.from, at, intensity))?
    }

    pub(super) fn mean(&self) -> f64 {
        self.mean
    }
}

/// A directional light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DistantLight {
    /// The unit direction to the light.
    pub towards: DVec3,
    /// Irradiance on a perpendicular surface.
    pub irradiance: Spectrum,
}

impl DistantLight {
    pub(super) fn sample(&self) -> LightSample {
        LightSample { towards: self.towards, end: None, radiance: self.irradiance, scatter: Scatter::Delta }
    }
}

pub(super) fn from_point(from: DVec3, at: DVec3, intensity: Spectrum) -> Option<LightSample> {
    let apart = from - at;
    let towards = apart.try_normalize()?;
    let radiance = intensity * (1.0 / apart.length_squared()) as f32;
    radiance.is_finite().then(|| LightSample {
        towards,
        end: Some(LightPoint::bare(from)),
        radiance,
        scatter: Scatter::Delta,
    })
}
