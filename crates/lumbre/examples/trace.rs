//! A whole path tracer over Lumbre's rays: balls on a floor, matt and mirror, a small lamp and a sky: `cargo
//! run --release --example trace`.
//!
//! The book goes through it line by line in "Your own ray tracer".

use std::f64::consts::PI;
use std::path::Path;

use lumbre::geometry::{Plane, Sphere};
use lumbre::image::{Image, Rgb};
use lumbre::math::optics::{facing, reflect};
use lumbre::math::random::RandomStream;
use lumbre::math::view::{Handedness, View};
use lumbre::math::{orthonormal_basis, warp64};
use lumbre::{DVec2, DVec3, Ray, SaveOptions, Scene, SceneBuilder, ShapeBuilder, write_image};

/// The vertical opening angle of the camera in degrees.
const FOVY: f64 = 32.0;
/// Paths for each pixel, and the most surfaces on one.
const SAMPLES: u32 = 16;
const BOUNCES: u32 = 8;
/// A small lamp: its place, its intensity in watts per steradian, and the radiance of the sky.
const LAMP: DVec3 = DVec3::new(-3.0, -4.0, 6.0);
const INTENSITY: f64 = 60.0;
const SKY: DVec3 = DVec3::new(0.25, 0.3, 0.4);

/// What a shape is made of.
#[derive(Clone, Copy)]
enum Surface {
    /// Scatters this share of the light evenly.
    Matt(DVec3),
    /// Reflects this share of the light in one direction.
    Mirror(DVec3),
}

/// The surface of each shape, in the order in which they are added to the scene.
const SURFACES: [Surface; 3] = [
    Surface::Matt(DVec3::new(0.7, 0.69, 0.66)),
    Surface::Matt(DVec3::new(0.8, 0.25, 0.08)),
    Surface::Mirror(DVec3::new(0.9, 0.9, 0.9)),
];

/// The picture that a camera sees of a scene.
fn trace(camera: &View, scene: &Scene, width: u32, height: u32) -> Image {
    let size = DVec2::new(f64::from(width), f64::from(height));
    let mut random = RandomStream::new(1);
    let mut pixels = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let mut sum = DVec3::ZERO;
            for _ in 0..SAMPLES {
                let film = DVec2::new(f64::from(x) + random.next_f64(), f64::from(y) + random.next_f64());
                let direction = camera.perspective_direction(FOVY, size, film);
                sum += radiance(scene, Ray::new(camera.eye, direction), &mut random);
            }
            let [r, g, b] = (sum / f64::from(SAMPLES)).as_vec3().to_array();
            pixels.push(Rgb { r, g, b });
        }
    }
    Image::from_pixels(width, height, pixels).expect("there are width times height pixels")
}

/// The radiance that comes back along a ray: one random path.
fn radiance(scene: &Scene, mut ray: Ray, random: &mut RandomStream) -> DVec3 {
    let (mut sum, mut beta) = (DVec3::ZERO, DVec3::ONE);
    for _ in 0..BOUNCES {
        let Some(hit) = scene.closest(&ray) else { return sum + beta * SKY };
        let normal = facing(hit.normal, ray.direction);
        let (albedo, direction) = match SURFACES[hit.shape as usize] {
            Surface::Mirror(albedo) => (albedo, reflect(ray.direction, normal)),
            Surface::Matt(albedo) => {
                sum += beta * albedo / PI * irradiance(scene, hit.point, normal);
                (albedo, cosine_direction(normal, random))
            }
        };
        beta *= albedo;
        // Roulette: what carries little is ended, and what goes on makes up for it.
        let goes_on = beta.max_element().min(1.0);
        if random.next_f64() >= goes_on {
            return sum;
        }
        beta /= goes_on;
        ray = Ray::new(hit.point, direction).with_range(1e-9, f64::INFINITY);
    }
    sum
}

/// The irradiance from the lamp: the cosine law and one over the square of the distance, unless something is between.
fn irradiance(scene: &Scene, point: DVec3, normal: DVec3) -> f64 {
    let to_lamp = LAMP - point;
    let cos = normal.dot(to_lamp) / to_lamp.length();
    let shadow = Ray::new(point, to_lamp).with_range(1e-9, 1.0);
    if cos <= 0.0 || scene.any(&shadow) { 0.0 } else { INTENSITY * cos / to_lamp.length_squared() }
}

/// A random direction about a normal, with the density cos θ / π.
fn cosine_direction(normal: DVec3, random: &mut RandomStream) -> DVec3 {
    let local = warp64::square_to_cosine_hemisphere(DVec2::new(random.next_f64(), random.next_f64()));
    let (e1, e2) = orthonormal_basis(normal);
    local.x * e1 + local.y * e2 + local.z * normal
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let scene = SceneBuilder::new()
        .shape(ShapeBuilder::exact(Plane::new(DVec3::ZERO, DVec3::Z)?))
        .shape(ShapeBuilder::exact(Sphere::new(DVec3::new(-1.0, 0.0, 1.0), 1.0)?))
        .shape(ShapeBuilder::exact(Sphere::new(DVec3::new(1.2, 0.5, 0.9), 0.9)?))
        .build()?;
    let (eye, target) = (DVec3::new(0.0, -7.0, 3.0), DVec3::new(0.1, 0.0, 0.8));
    let camera =
        View::look_at(eye, target, DVec3::Z, Handedness::Right).ok_or("the camera looks somewhere")?;
    let image = trace(&camera, &scene, 320, 240);
    write_image(Path::new("trace.png"), &image, &SaveOptions::default())?;
    Ok(())
}
