//! A picture projected from a point.

use std::sync::Arc;

use lumbre_image::Image;
use lumbre_math::{DVec3, Elementary, Transform};
use lumbre_shading::Spectrum;

use super::LightSample;
use super::delta::from_point;

/// A point light that projects a picture along +z of its space; the picture's top is towards +y, and its right towards
/// +x.
#[derive(Clone, Debug)]
pub struct ProjectionLight {
    /// The position.
    pub from: DVec3,
    // For directions; the translation does not matter.
    world_from_light: Transform,
    image: Arc<Image>,
    // A factor on the texels, which are radiant intensities.
    intensity: Spectrum,
    // Half the width and height of the picture at a distance of 1.
    half: [f64; 2],
    /// The unit direction to the middle of the picture.
    pub(super) axis: DVec3,
    /// The cosine of the angle from the middle to the farthest corner.
    pub(super) cos_corner: f64,
    // The integral of the intensity over all directions, and its mean over those of the picture; means of the channels.
    flux: f64,
    mean: f64,
}

/// Minimum cosine from the axis of lit directions, as in pbrt.
const MIN_COSINE: f64 = 1e-3;

impl ProjectionLight {
    /// A picture whose shorter side spans this many degrees. `None` if it is black or empty.
    pub(crate) fn new(
        world_from_light: Transform,
        intensity: Spectrum,
        image: Arc<Image>,
        fov_degrees: f64,
    ) -> Option<Self> {
        let (width, height) = (f64::from(image.width()), f64::from(image.height()));
        let tangent = (0.5 * fov_degrees.to_radians()).tangent();
        let half = [width, height].map(|side| tangent * side / width.min(height));
        let axis = world_from_light.vector(DVec3::Z).try_normalize()?;
        let corners = [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)];
        let to_corner = |(x, y): (f64, f64)| DVec3::new(x * half[0], y * half[1], 1.0);
        let cosine = |corner| Some(world_from_light.vector(to_corner(corner)).try_normalize()?.dot(axis));
        let cosines = corners.into_iter().filter_map(cosine);
        let cos_corner = cosines.fold(1.0, f64::min);
        let cell = 4.0 * half[0] * half[1] / (width * height);
        let (mut flux, mut solid_angle) = (0.0, 0.0);
        for (place, &texel) in (0..).zip(image.pixels()) {
            let (column, row) = (place % image.width(), place / image.width());
            let x = half[0] * (2.0 * (f64::from(column) + 0.5) / width - 1.0);
            let y = half[1] * (1.0 - 2.0 * (f64::from(row) + 0.5) / height);
            let cosine = 1.0 / (1.0 + x * x + y * y).sqrt();
            let weight = cell * cosine * cosine * cosine;
            let colour = if texel.is_finite() { (intensity * texel).average().max(0.0) } else { 0.0 };
            flux += weight * f64::from(colour);
            solid_angle += weight;
        }
        let mean = flux / solid_angle;
        let from = world_from_light.point(DVec3::ZERO);
        let light = Self { from, world_from_light, image, intensity, half, axis, cos_corner, flux, mean };
        (mean > 0.0 && mean.is_finite()).then_some(light)
    }

    /// The radiant intensity in a direction from the light.
    fn intensity(&self, direction: DVec3) -> Spectrum {
        let local = self.world_from_light.inverse_vector(direction).normalize_or_zero();
        if local.z < MIN_COSINE {
            return Spectrum::BLACK;
        }
        let [x, y] = [local.x / local.z / self.half[0], local.y / local.z / self.half[1]];
        if x.abs() > 1.0 || y.abs() > 1.0 {
            return Spectrum::BLACK;
        }
        let (width, height) = (self.image.width(), self.image.height());
        let pixel = |along: f64, count: u32| ((0.5 * along * f64::from(count)) as u32).min(count - 1);
        let texel = self.image.pixel(pixel(1.0 + x, width), pixel(1.0 - y, height));
        // Negative and non-finite texels are black.
        if texel.is_finite() { (self.intensity * texel).map(|c| c.max(0.0)) } else { Spectrum::BLACK }
    }

    pub(super) fn sample(&self, at: DVec3) -> Option<LightSample> {
        let intensity = self.intensity(at - self.from);
        (!intensity.is_black()).then(|| from_point(self.from, at, intensity))?
    }

    /// The mean of its channels over the directions of the picture.
    pub(super) fn mean(&self) -> f64 {
        self.mean
    }

    /// The integral over all directions of the mean of its channels.
    pub(super) fn flux(&self) -> f64 {
        self.flux
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RED: Spectrum = Spectrum::new(1.0, 0.25, 0.0);

    /// Twice as wide as high, red at the upper right, 50 degrees high; it looks along x, with z up.
    fn light() -> ProjectionLight {
        let mut pixels = vec![Spectrum::WHITE; 8];
        pixels[3] = RED;
        let image = Image::from_pixels(4, 2, pixels).unwrap();
        let at = Transform::translate(DVec3::new(1.0, 2.0, 3.0));
        // x of the light to -y, y to z, z to x: a mirror, as pbrt's spaces are.
        let axes = lumbre_math::DMat3::from_cols(-DVec3::Y, DVec3::Z, DVec3::X);
        let turn = Transform::from_affine(lumbre_math::DAffine3::from_mat3(axes)).unwrap();
        ProjectionLight::new(at * turn, Spectrum::splat(6.0), image.into(), 50.0).unwrap()
    }

    #[test]
    fn the_picture_stands_upright_and_ends_at_its_frame() {
        let light = light();
        let tangent = 25_f64.to_radians().tan();
        let seen = |right: f64, up: f64| {
            let at = light.from + 2.0 * DVec3::new(1.0, -right * tangent, up * tangent);
            light.sample(at).map(|sample| sample.radiance)
        };
        let near = |found: Option<Spectrum>, colour: Spectrum, right: f64, up: f64| {
            let d2 = 4.0 * (1.0 + (right * right + up * up) * tangent * tangent);
            let expected = colour * (6.0 / d2) as f32;
            (found.unwrap() - expected).map(f32::abs).max_component() < 1e-5
        };
        for (right, up, colour) in
            [(1.5, 0.5, RED), (1.99, 0.99, RED), (1.01, 0.01, RED), (0.9, 0.5, Spectrum::WHITE)]
        {
            assert!(near(seen(right, up), colour, right, up), "{right} {up}");
        }
        for (right, up) in [(1.5, -0.5), (-1.5, 0.5), (-1.99, -0.99)] {
            assert!(near(seen(right, up), Spectrum::WHITE, right, up), "{right} {up}");
        }
        for (right, up) in [(2.01, 0.0), (0.0, 1.01), (-2.01, 0.5), (0.0, -1.01)] {
            assert!(seen(right, up).is_none(), "{right} {up}");
        }
        assert!(light.sample(light.from - DVec3::X).is_none());
        assert!(light.sample(light.from).is_none());
    }

    #[test]
    fn flux_and_mean_are_those_of_an_integral_over_the_frame() {
        let light = light();
        let count = 2000;
        let (mut flux, mut solid_angle) = (0.0, 0.0);
        for i in 0..count {
            for j in 0..count / 10 {
                let x = 2.0 * (f64::from(i) + 0.5) / f64::from(count) - 1.0;
                let y = 2.0 * (f64::from(j) + 0.5) / f64::from(count / 10) - 1.0;
                let local = DVec3::new(light.half[0] * x, light.half[1] * y, 1.0);
                let weight = 4.0 * light.half[0] * light.half[1]
                    / local.length().powi(3)
                    / f64::from(count * count / 10);
                let intensity = light.intensity(light.world_from_light.vector(local));
                flux += weight * f64::from(intensity.average());
                solid_angle += weight;
            }
        }
        // Its own sums have one place for each texel.
        assert!((light.flux() / flux - 1.0).abs() < 0.05, "{} {flux}", light.flux());
        assert!((light.mean() / (flux / solid_angle) - 1.0).abs() < 0.02);
        let corner = DVec3::new(light.half[0], light.half[1], 1.0).normalize();
        assert!((light.cos_corner - corner.z).abs() < 1e-12);
        let black = Image::filled(3, 2, Spectrum::BLACK);
        assert!(ProjectionLight::new(Transform::IDENTITY, Spectrum::WHITE, black.into(), 50.0).is_none());
    }
}
