//! Environment lights.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use lumbre_image::Image;
use lumbre_math::distribution::PiecewiseConstant2D;
use lumbre_math::{DVec2, DVec3, Elementary, Transform, warp64};
use lumbre_shading::{Scatter, Spectrum};

use super::LightSample;
use super::lanes::LaneMaps;
use crate::EnvironmentMapping;

/// Uniform radiance from all directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UniformLight {
    /// The radiance.
    pub radiance: Spectrum,
}

impl UniformLight {
    pub(super) fn sample(&self, u: DVec2) -> LightSample {
        LightSample {
            towards: warp64::square_to_sphere(u),
            end: None,
            radiance: self.radiance,
            scatter: Scatter::Density(Self::pdf() as f32),
        }
    }

    pub(super) fn pdf() -> f64 {
        1.0 / (4.0 * PI)
    }
}

/// An image over the sphere, interpolated bilinearly. Texels that are not finite count as black.
#[derive(Clone, Debug)]
pub(super) struct Panorama {
    /// Three numbers a texel, in rows of `width + 2`, padded by one texel on each side with the values beyond the edge.
    /// None is negative.
    pub(super) texels: Arc<Vec<f32>>,
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) mapping: EnvironmentMapping,
    pub(super) world_from_light: Transform,
    pub(super) scale: Spectrum,
}

impl Panorama {
    /// `None` for an image that is empty.
    pub(super) fn new(
        image: Arc<Image>,
        mapping: EnvironmentMapping,
        world_from_light: Transform,
        scale: Spectrum,
    ) -> Option<Self> {
        let is_usable = image.width() > 0 && image.height() > 0;
        if !is_usable {
            return None;
        }
        let (width, height) = (image.width(), image.height());
        let (columns, rows) = (-1..=i64::from(width), -1..=i64::from(height));
        let mut texels = Vec::with_capacity(3 * (width as usize + 2) * (height as usize + 2));
        for y in rows {
            texels.extend(columns.clone().flat_map(|x| texel(&image, mapping, x, y).to_array()));
        }
        Some(Self { texels: Arc::new(texels), width, height, mapping, world_from_light, scale })
    }

    /// A texel, or one beyond the edge.
    #[inline]
    fn texel(&self, x: i64, y: i64) -> Spectrum {
        let at = 3 * ((y + 1) as usize * (self.width as usize + 2) + (x + 1) as usize);
        Spectrum::new(self.texels[at], self.texels[at + 1], self.texels[at + 2])
    }

    /// The value in the unit world-space `direction`.
    pub(super) fn radiance(&self, direction: DVec3) -> Spectrum {
        self.scale * self.lookup(self.square(self.to_light(direction)))
    }

    /// The solid angle of a pixel of a row, in arbitrary units.
    fn solid_angle(&self, row: u32) -> f64 {
        match self.mapping {
            EnvironmentMapping::EqualArea => 1.0,
            EnvironmentMapping::LatitudeLongitude => {
                let edge = |y: u32| (PI * f64::from(y) / f64::from(self.height)).cosine();
                edge(row) - edge(row + 1)
            }
        }
    }

    /// The mean over the sphere and over the channels; `None` if it is 0.
    pub(super) fn mean(&self) -> Option<f64> {
        let (mut sum, mut whole) = (0.0, 0.0);
        for y in 0..self.height {
            let weight = self.solid_angle(y);
            let row = (0..i64::from(self.width)).map(|x| mean_of(self.texel(x, i64::from(y))));
            sum += weight * row.sum::<f64>();
            whole += weight * f64::from(self.width);
        }
        let mean = sum / whole * f64::from(self.scale.average());
        (mean > 0.0 && mean.is_finite()).then_some(mean)
    }

    fn to_light(&self, direction: DVec3) -> DVec3 {
        self.world_from_light.inverse_vector(direction).normalize()
    }

    /// The irradiance on a surface with the unit `normal`: a sum over all pixels.
    fn irradiance(&self, normal: DVec3) -> Spectrum {
        let (width, height) = (self.width, self.height);
        let cell = 1.0 / (f64::from(width) * f64::from(height));
        let mut sum = [0.0_f64; 3];
        for y in 0..height {
            for x in 0..width {
                let uv = DVec2::new(
                    (f64::from(x) + 0.5) / f64::from(width),
                    (f64::from(y) + 0.5) / f64::from(height),
                );
                let local = self.direction(uv);
                let cosine = self.world_from_light.vector(local).normalize().dot(normal);
                if cosine > 0.0 {
                    let weight = cosine * cell / self.density_of_map(local);
                    let texel = self.texel(i64::from(x), i64::from(y));
                    sum.iter_mut().zip(texel.to_array()).for_each(|(sum, c)| *sum += weight * f64::from(c));
                }
            }
        }
        self.scale * Spectrum::from(sum.map(|c| c as f32))
    }

    /// The unit direction in light space of a point of the unit square.
    fn direction(&self, uv: DVec2) -> DVec3 {
        match self.mapping {
            EnvironmentMapping::EqualArea => warp64::equal_area_square_to_sphere(uv),
            EnvironmentMapping::LatitudeLongitude => warp64::latlong_to_sphere(uv + DVec2::new(0.5, 0.0)),
        }
    }

    /// The point of the unit square of a unit direction in light space; (0, 0) is the upper left of the image.
    fn square(&self, local: DVec3) -> DVec2 {
        match self.mapping {
            EnvironmentMapping::EqualArea => warp64::equal_area_sphere_to_square(local),
            EnvironmentMapping::LatitudeLongitude => {
                let uv = warp64::sphere_to_latlong(local);
                DVec2::new(if uv.x < 0.5 { uv.x + 0.5 } else { uv.x - 0.5 }, uv.y)
            }
        }
    }

    /// The ratio of area in the square to world-space solid angle.
    fn density_of_map(&self, local: DVec3) -> f64 {
        let in_light = match self.mapping {
            EnvironmentMapping::EqualArea => 1.0 / (4.0 * PI),
            EnvironmentMapping::LatitudeLongitude => 1.0 / (TAU * PI * local.truncate().length()),
        };
        // A solid angle under a linear map; 1 up to rounding for a rotation.
        let stretch = self.world_from_light.vector(local).length();
        in_light * (stretch * stretch * stretch / self.world_from_light.determinant().abs())
    }

    /// Bilinear interpolation at a point of the unit square.
    fn lookup(&self, uv: DVec2) -> Spectrum {
        let size = DVec2::new(f64::from(self.width), f64::from(self.height));
        let at = (uv * size - 0.5).clamp(DVec2::splat(-0.5), size - 0.5);
        let cell = at.floor();
        let (x, y) = (cell.x as i64, cell.y as i64);
        let part = (at - cell).as_vec2();
        let above = self.texel(x, y).lerp(self.texel(x + 1, y), part.x);
        let below = self.texel(x, y + 1).lerp(self.texel(x + 1, y + 1), part.x);
        above.lerp(below, part.y)
    }
}

/// The remaining share of the weight of a pixel that is darker than the mean. A smaller share gains nothing more; 0.1
/// costs a twentieth of the gain.
const LEFT: f32 = 0.01;

/// An environment map, interpolated bilinearly and sampled by brightness.
#[derive(Clone, Debug)]
pub struct Environment {
    pub(super) picture: Panorama,
    // One cell per pixel: the mean of the interpolated image over the pixel, times its solid angle. It is
    // positive wherever the interpolated image is.
    pub(super) by_brightness: PiecewiseConstant2D,
    // The same minus the mean, for code that finds light along its own rays as well.
    //
    // O. Karlik, M. Sik, P. Vevoda, T. Skrivan, J. Krivanek, "MIS Compensation: Optimizing Sampling Techniques in
    // Multiple Importance Sampling", SIGGRAPH Asia 2019. Where the image is darker than its mean, a share remains, so
    // that samples alone still find all light.
    pub(super) beside_others: PiecewiseConstant2D,
    // The mean over the sphere and over the channels.
    mean: f64,
    /// The maps for lanes.
    pub(super) maps: LaneMaps,
}

impl Environment {
    /// `None` for an image that is black or empty.
    pub(crate) fn new(
        image: Arc<Image>,
        mapping: EnvironmentMapping,
        world_from_light: Transform,
        scale: Spectrum,
    ) -> Option<Self> {
        let picture = Panorama::new(image, mapping, world_from_light, scale)?;
        let (width, height) = (picture.width as usize, picture.height as usize);
        // The mean of the linear interpolation over a pixel: 1/8, 6/8, 1/8 of it and its neighbours, along both
        // axes.
        let brightness = |x: i64, y: i64| mean_of(picture.texel(x, y));
        let smooth = |x: i64, y: i64| {
            let row = |y| 0.125 * (brightness(x - 1, y) + brightness(x + 1, y)) + 0.75 * brightness(x, y);
            0.125 * (row(y - 1) + row(y + 1)) + 0.75 * row(y)
        };
        let (mut weights, mut solid_angles) =
            (Vec::with_capacity(width * height), Vec::with_capacity(height));
        let (mut sum, mut whole) = (0.0, 0.0);
        for y in 0..height {
            let solid_angle = picture.solid_angle(y as u32);
            solid_angles.push(solid_angle);
            for x in 0..width {
                let weight = solid_angle * smooth(x as i64, y as i64);
                weights.push(weight as f32);
                sum += weight;
                whole += solid_angle;
            }
        }
        let by_brightness = PiecewiseConstant2D::new(&weights, width)?;
        let mean = sum / whole;
        for (row, solid_angle) in weights.chunks_mut(width).zip(solid_angles) {
            let usual = (mean * solid_angle) as f32;
            row.iter_mut().for_each(|weight| *weight = (*weight - usual).max(LEFT * *weight));
        }
        let beside_others = PiecewiseConstant2D::new(&weights, width)?;
        let mean = mean * f64::from(scale.average());
        let maps = LaneMaps::new(&picture);
        Some(Self { picture, by_brightness, beside_others, mean, maps })
    }

    pub(super) fn mean(&self) -> f64 {
        self.mean
    }

    /// The radiance from the unit world-space `direction`.
    pub fn radiance(&self, direction: DVec3) -> Spectrum {
        self.picture.radiance(direction)
    }

    /// The irradiance on a surface with the unit `normal`: a sum over all pixels.
    pub fn irradiance(&self, normal: DVec3) -> Spectrum {
        self.picture.irradiance(normal)
    }

    pub(super) fn sample(&self, u: DVec2) -> Option<LightSample> {
        self.sample_by(&self.by_brightness, u)
    }

    pub(super) fn pdf(&self, direction: DVec3) -> f64 {
        self.pdf_by(&self.by_brightness, direction)
    }

    /// A sample for MIS with rays that find the light too: it leaves them more of the dim parts.
    pub(super) fn sample_beside_others(&self, u: DVec2) -> Option<LightSample> {
        self.sample_by(&self.beside_others, u)
    }

    /// The density of [`Environment::sample_beside_others`].
    pub(super) fn pdf_beside_others(&self, direction: DVec3) -> f64 {
        self.pdf_by(&self.beside_others, direction)
    }

    fn sample_by(&self, choice: &PiecewiseConstant2D, u: DVec2) -> Option<LightSample> {
        let (uv, density) = choice.sample(u);
        let local = self.picture.direction(uv);
        let pdf = density * self.picture.density_of_map(local);
        let radiance = self.picture.scale * self.picture.lookup(uv);
        (pdf > 0.0 && pdf.is_finite() && !radiance.is_black()).then(|| LightSample {
            towards: self.picture.world_from_light.vector(local).normalize(),
            end: None,
            radiance,
            scatter: Scatter::Density(pdf as f32),
        })
    }

    fn pdf_by(&self, choice: &PiecewiseConstant2D, direction: DVec3) -> f64 {
        let local = self.picture.to_light(direction);
        choice.pdf(self.picture.square(local)) * self.picture.density_of_map(local)
    }
}

/// The first texel of an image that is not finite, from the top left, as (x, y).
pub(crate) fn first_not_finite(image: &Image) -> Option<(u32, u32)> {
    let place = image.pixels().iter().position(|c| !c.is_finite())?;
    Some(((place % image.width() as usize) as u32, (place / image.width() as usize) as u32))
}

/// The light of a texel: negative channels count as 0, and texels that are not finite as black.
fn light_of(texel: Spectrum) -> Spectrum {
    if texel.is_finite() { texel.map(|c| c.max(0.0)) } else { Spectrum::BLACK }
}

/// The mean of the channels, also if their sum overflows.
fn mean_of(colour: Spectrum) -> f64 {
    let mean = f64::from(colour.average());
    if mean.is_finite() { mean } else { colour.to_array().iter().map(|&c| f64::from(c) / 3.0).sum() }
}

/// The pixel, wrapped if it is beyond an edge; see [`light_of`].
fn texel(image: &Image, mapping: EnvironmentMapping, x: i64, y: i64) -> Spectrum {
    let (width, height) = (i64::from(image.width()), i64::from(image.height()));
    let (x, y) = match mapping {
        EnvironmentMapping::EqualArea => {
            let (mut x, mut y) = (x, y);
            // Each edge meets itself, mirrored about its middle.
            if x < 0 || x >= width {
                (x, y) = (if x < 0 { -1 - x } else { 2 * width - 1 - x }, height - 1 - y);
            }
            if y < 0 || y >= height {
                (x, y) = (width - 1 - x, if y < 0 { -1 - y } else { 2 * height - 1 - y });
            }
            (x.clamp(0, width - 1), y.clamp(0, height - 1))
        }
        // Beyond a pole is the opposite side.
        EnvironmentMapping::LatitudeLongitude => {
            let beyond = y < 0 || y >= height;
            let y = if y < 0 {
                -1 - y
            } else if y >= height {
                2 * height - 1 - y
            } else {
                y
            };
            ((if beyond { x + width / 2 } else { x }).rem_euclid(width), y.clamp(0, height - 1))
        }
    };
    light_of(image.pixels()[(y * width + x) as usize])
}
