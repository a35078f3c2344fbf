//! Studio light, as an environment map.

use std::f64::consts::PI;
use std::sync::Arc;

use lumbre_image::{Image, Rgb};
use lumbre_math::{DAffine3, DMat3, DVec2, DVec3, Elementary, Transform, warp64};

use crate::framing::axes;
use crate::{EnvironmentDesc, EnvironmentMapping, LightDesc, UpAxis};

const WIDTH: u32 = 512;
const HEIGHT: u32 = 256;
/// The radiance of a white, unoccluded horizontal surface. Surfaces that face the key light are brighter, and those
/// that face the camera darker.
const LEVEL: f64 = 1.0;

/// A soft rectangular lamp.
struct Softbox {
    /// The direction of its centre: right, up, front.
    towards: DVec3,
    /// The slopes of its half-width and half-height.
    half: DVec2,
    /// The fraction of those over which its edges fade.
    edge: f64,
    radiance: f64,
}

/// A key light from the upper left, a broad fill from the right, two rim lights from behind, and one overhead.
const LAMPS: [Softbox; 5] = [
    Softbox {
        towards: DVec3::new(-0.95, 0.85, 0.6),
        half: DVec2::new(0.45, 0.42),
        edge: 0.35,
        radiance: 15.0,
    },
    Softbox { towards: DVec3::new(1.0, 0.3, 0.45), half: DVec2::new(0.4, 0.8), edge: 0.5, radiance: 1.3 },
    Softbox { towards: DVec3::new(0.7, 0.55, -0.9), half: DVec2::new(0.22, 0.7), edge: 0.4, radiance: 7.0 },
    Softbox { towards: DVec3::new(-0.95, 0.3, -0.6), half: DVec2::new(0.14, 0.7), edge: 0.4, radiance: 5.0 },
    Softbox { towards: DVec3::new(0.1, 1.0, -0.15), half: DVec2::new(0.6, 0.45), edge: 0.6, radiance: 3.0 },
];

impl Softbox {
    fn at(&self, direction: DVec3) -> f64 {
        let axis = self.towards.normalize();
        let depth = direction.dot(axis);
        if depth <= 0.0 {
            return 0.0;
        }
        let side = if axis.y.abs() > 0.95 { DVec3::X } else { DVec3::Y.cross(axis).normalize() };
        let above = axis.cross(side);
        let on_it = DVec2::new(direction.dot(side), direction.dot(above)).abs() / depth / self.half;
        let fade = |x: f64| {
            let t = ((1.0 - x) / self.edge).clamp(0.0, 1.0);
            t * t * (3.0 - 2.0 * t)
        };
        self.radiance * fade(on_it.x) * fade(on_it.y)
    }
}

/// The walls without the lamps: slightly brighter towards the ceiling.
fn walls(direction: DVec3) -> f64 {
    let height = 0.5 + 0.5 * direction.y;
    0.20 + 0.34 * height * height
}

/// The studio light, rotated about the vertical.
pub(crate) fn light(up: UpAxis, turns: f64) -> LightDesc {
    let mut level = 0.0;
    let mut pixels = Vec::with_capacity((WIDTH * HEIGHT) as usize);
    for i in 0..WIDTH * HEIGHT {
        let (x, y) = (f64::from(i % WIDTH) + 0.5, f64::from(i / WIDTH) + 0.5);
        let uv = DVec2::new(x / f64::from(WIDTH) + 0.5, y / f64::from(HEIGHT));
        // In light space z is up, x to the right, and y to the back.
        let towards = warp64::latlong_to_sphere(uv);
        let direction = DVec3::new(towards.x, towards.z, -towards.y);
        let radiance = walls(direction) + LAMPS.iter().map(|lamp| lamp.at(direction)).sum::<f64>();
        let solid_angle = 2.0 * PI * PI * (PI * uv.y).sine() / f64::from(WIDTH * HEIGHT);
        level += radiance * solid_angle * direction.y.max(0.0) / PI;
        pixels.push(Rgb::splat(radiance as f32));
    }
    let image = Image::from_pixels(WIDTH, HEIGHT, pixels);
    let [right, upward, front] = axes(up, turns);
    let space = DAffine3::from_mat3(DMat3::from_cols(right, -front, upward));
    LightDesc::Infinite {
        world_from_light: Transform::from_affine(space).unwrap_or_default(),
        radiance: Rgb::splat((LEVEL / level) as f32),
        image: image.map(|image| EnvironmentDesc {
            image: Arc::new(image),
            mapping: EnvironmentMapping::LatitudeLongitude,
        }),
    }
}
