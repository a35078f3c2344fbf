//! Features of the first surface: the film `gbuffer` of pbrt-v4.

use lumbre_image::Rgb;
use lumbre_math::{DVec3, Vec2, Vec3};
use lumbre_scene::{CameraRay, FilmSpace, Footprint, View};

use crate::film::ExactSum;
use crate::film::pixel::Sums;

/// The first surface that a sample sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceSample {
    /// The point, in the film's space.
    pub point: [f64; 3],
    /// The change of the point's third coordinate to the next pixel to the right, and downwards.
    pub slope: [f32; 2],
    /// The geometric normal, unit, in the film's space, on the side of the camera.
    pub normal: [f32; 3],
    /// The shading normal, likewise.
    pub shading_normal: [f32; 3],
    /// Surface parameters.
    pub uv: [f32; 2],
    /// Reflectance.
    pub albedo: Rgb,
}

/// A point of a surface in world space, with its features.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SurfacePoint {
    pub(crate) point: DVec3,
    pub(crate) normal: DVec3,
    pub(crate) shading_normal: Vec3,
    pub(crate) uv: Vec2,
    pub(crate) albedo: Rgb,
}

impl SurfaceSample {
    /// The features at a camera ray's hit. The rays of its footprint are `spacing` pixels away.
    pub(crate) fn of(
        view: &View,
        space: FilmSpace,
        camera: &CameraRay,
        at: &SurfacePoint,
        spacing: f64,
    ) -> Self {
        let placement = view.placement(camera.ray.time);
        let point = |p: DVec3| match space {
            FilmSpace::Camera => placement.inverse_point(p),
            FilmSpace::World => p,
        };
        let facing = |n: DVec3| {
            let n = if n.dot(camera.ray.direction) > 0.0 { -n } else { n };
            let n = match space {
                FilmSpace::Camera => placement.inverse_normal(n),
                FilmSpace::World => n,
            };
            n.normalize_or_zero().as_vec3().to_array()
        };
        // Where the neighbouring rays meet the tangent plane.
        let beside = |origin: DVec3, direction: DVec3| {
            let t = at.normal.dot(at.point - origin) / at.normal.dot(direction);
            ((point(origin + t * direction) - point(at.point)).z / spacing).abs() as f32
        };
        let slope = match camera.footprint {
            Footprint::Neighbours { x_origin, x_direction, y_origin, y_direction } => {
                [beside(x_origin, x_direction), beside(y_origin, y_direction)]
            }
            _ => [0.0; 2],
        };
        Self {
            point: point(at.point).to_array(),
            slope: slope.map(|s| if s.is_finite() { s } else { 0.0 }),
            normal: facing(at.normal),
            shading_normal: facing(at.shading_normal.as_dvec3()),
            uv: at.uv.to_array(),
            albedo: at.albedo,
        }
    }
}

/// Sums over the samples of one pixel, independent of their order.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SurfaceSums {
    /// Σ weight × value of the samples that see a surface: albedo, point and slope in a unit that the film knows,
    /// normal, shading normal, uv.
    values: [ExactSum; VALUES],
    /// Σ weight of these samples.
    seen: ExactSum,
    /// Σ colour of all samples, without weights.
    colour: [ExactSum; 3],
    /// Σ colour², without weights.
    squares: [ExactSum; 3],
}

/// Numbers of a [`SurfaceSample`].
const VALUES: usize = 16;

/// The greatest colour whose square a sum holds.
const MAX_COLOUR: f64 = 1e6;

impl SurfaceSums {
    /// The channels that are made of them, by pbrt's names.
    pub const CHANNELS: [&str; VALUES + 6] = [
        "Albedo.R",
        "Albedo.G",
        "Albedo.B",
        "P.X",
        "P.Y",
        "P.Z",
        "dzdx",
        "dzdy",
        "N.X",
        "N.Y",
        "N.Z",
        "Ns.X",
        "Ns.Y",
        "Ns.Z",
        "u",
        "v",
        "Variance.R",
        "Variance.G",
        "Variance.B",
        "RelativeVariance.R",
        "RelativeVariance.G",
        "RelativeVariance.B",
    ];

    /// Adds a sample of this colour; `None` saw no surface. Lengths are measured in `unit`.
    pub fn add(&mut self, colour: Rgb, sample: Option<&SurfaceSample>, weight: f64, unit: f64) {
        let colours = self.colour.iter_mut().zip(&mut self.squares).zip(colour.to_array());
        for ((sum, squares), channel) in colours {
            let channel = f64::from(channel).clamp(-MAX_COLOUR, MAX_COLOUR);
            sum.add(channel);
            squares.add(channel * channel);
        }
        let Some(SurfaceSample { point, slope, normal, shading_normal, uv, albedo }) = sample else { return };
        let ([ax, ay, az], [px, py, pz], [sx, sy]) =
            (albedo.to_array().map(f64::from), *point, slope.map(f64::from));
        let ([nx, ny, nz], [mx, my, mz], [u, v]) =
            (normal.map(f64::from), shading_normal.map(f64::from), uv.map(f64::from));
        let [px, py, pz, sx, sy] = [px, py, pz, sx, sy].map(|length| length / unit);
        let values = [ax, ay, az, px, py, pz, sx, sy, nx, ny, nz, mx, my, mz, u, v];
        self.values.iter_mut().zip(values).for_each(|(sum, value)| sum.add(weight * value));
        self.seen.add(weight);
    }

    /// Adds the samples of another.
    pub fn merge(&mut self, other: &Self) {
        let merge = |sums: &mut [ExactSum], others: &[ExactSum]| {
            sums.iter_mut().zip(others).for_each(|(sum, &other)| sum.merge(other));
        };
        merge(&mut self.values, &other.values);
        self.seen.merge(other.seen);
        merge(&mut self.colour, &other.colour);
        merge(&mut self.squares, &other.squares);
    }

    /// The values of [`Self::CHANNELS`] for a pixel of this many samples: the means over the samples that see a
    /// surface, 0 where none does; the variance of the colours of all samples; and that, divided by their mean.
    pub fn channels(&self, samples: u32, unit: f64) -> [f32; VALUES + 6] {
        let mut channels = [0.0; VALUES + 6];
        let seen = self.seen.value();
        for (i, (channel, sum)) in channels.iter_mut().zip(self.values).enumerate() {
            let is_length = (3..8).contains(&i);
            if seen != 0.0 {
                *channel = (sum.value() / seen * if is_length { unit } else { 1.0 }) as f32;
            }
        }
        if samples < 2 {
            return channels;
        }
        let n = f64::from(samples);
        for c in 0..3 {
            let mean = self.colour[c].value() / n;
            let variance = (self.squares[c].value() / n - mean * mean).max(0.0) * n / (n - 1.0);
            channels[VALUES + c] = variance as f32;
            channels[VALUES + 3 + c] = if mean == 0.0 { 0.0 } else { (variance / mean) as f32 };
        }
        channels
    }

    /// All of its sums.
    pub(crate) fn numbers_mut(&mut self) -> impl Iterator<Item = &mut ExactSum> {
        let Self { values, seen, colour, squares } = self;
        values.iter_mut().chain([seen]).chain(colour).chain(squares)
    }
}

/// Sums of a [`SurfaceSums`].
pub(crate) const NUMBERS: usize = VALUES + 7;

impl Sums for SurfaceSums {
    fn merge(&mut self, other: &Self) {
        self.merge(other);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_count_hits_and_variances_count_all_samples() {
        let sample = SurfaceSample {
            point: [1.0, -2.0, 12.0],
            slope: [0.5, 0.25],
            normal: [0.0, 0.0, -1.0],
            shading_normal: [0.0, 0.6, -0.8],
            uv: [0.25, 0.75],
            albedo: Rgb::new(0.1, 0.2, 0.4),
        };
        let mut sums = SurfaceSums::default();
        sums.add(Rgb::new(1.0, 0.0, 3.0), Some(&sample), 0.5, 16.0);
        sums.add(Rgb::new(3.0, 0.0, 3.0), None, 2.0, 16.0);
        let other = SurfaceSample { point: [4.0, 1.0, 6.0], uv: [0.75, 0.75], ..sample };
        let mut second = SurfaceSums::default();
        second.add(Rgb::new(5.0, 0.0, 3.0), Some(&other), 1.0, 16.0);
        sums.merge(&second);
        let channels = sums.channels(3, 16.0);
        let of = |name: &str| {
            let at = SurfaceSums::CHANNELS.iter().position(|channel| *channel == name).unwrap();
            channels[at]
        };
        let expected = [
            ("Albedo.G", 0.2),
            ("P.X", 3.0),
            ("P.Y", 0.0),
            ("P.Z", 8.0),
            ("dzdx", 0.5),
            ("dzdy", 0.25),
            ("N.Z", -1.0),
            ("Ns.Y", 0.6),
            ("u", 1.75 / 3.0),
            ("v", 0.75),
            ("Variance.R", 4.0),
            ("Variance.G", 0.0),
            ("Variance.B", 0.0),
            ("RelativeVariance.R", 4.0 / 3.0),
            ("RelativeVariance.G", 0.0),
        ];
        for (name, value) in expected {
            assert!((of(name) - value).abs() < 1e-6, "{name}: {} {value}", of(name));
        }
        assert_eq!(SurfaceSums::default().channels(0, 1.0), [0.0; VALUES + 6]);
    }
}
