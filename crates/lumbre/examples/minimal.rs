//! A scene made in Rust, asked with a ray, and rendered: `cargo run --release --example minimal`.

use std::sync::Arc;

use lumbre::description::{Camera, CameraKind, FilmDesc, LightDesc};
use lumbre::geometry::{Plane, Sphere, Torus};
use lumbre::image::Rgb;
use lumbre::shading::{Material, MaterialKind, SpectrumTexture};
use lumbre::{DVec3, Ray, SceneBuilder, ShapeBuilder, Transform};

fn diffuse(r: f32, g: f32, b: f32) -> Material {
    let reflectance = Arc::new(SpectrumTexture::Constant(Rgb::new(r, g, b)));
    Material::new(MaterialKind::Diffuse { reflectance })
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let ball = Sphere::new(DVec3::new(-1.2, 0.0, 0.9), 0.9)?;
    let ring = Torus::new(DVec3::new(1.1, 0.0, 0.35), DVec3::new(0.3, 0.0, 1.0), 0.8, 0.3)?;
    let floor = Plane::new(DVec3::ZERO, DVec3::Z)?;
    let lamp = Sphere::new(DVec3::new(-3.0, -4.0, 6.0), 0.8)?;

    let eye = DVec3::new(0.0, -8.0, 3.0);
    let camera = Camera {
        name: None,
        kind: CameraKind::Perspective { fov: 32.0, lens_radius: 0.0, focal_distance: 8.0 },
        world_from_camera: Transform::look_at_left(eye, DVec3::new(0.0, 0.0, 0.6), DVec3::Z)?.inverse(),
        motion: None,
        frame_aspect: None,
        screen_window: None,
        shutter_open: 0.0,
        shutter_close: 1.0,
    };

    let scene = SceneBuilder::new()
        .shape(ShapeBuilder::exact(ball).material(diffuse(0.8, 0.25, 0.08)))
        .shape(ShapeBuilder::exact(ring).material(diffuse(0.15, 0.4, 0.5)))
        .shape(ShapeBuilder::exact(floor))
        .shape(ShapeBuilder::exact(lamp).shining(Rgb::splat(30.0)))
        .light(LightDesc::Infinite {
            world_from_light: Transform::IDENTITY,
            radiance: Rgb::splat(0.3),
            image: None,
        })
        .camera(camera)
        .film(FilmDesc { width: Some(640), height: Some(400), ..FilmDesc::default() })
        .build()?;

    let hit = scene.closest(&Ray::new(eye, DVec3::new(-1.2, 8.0, -2.1))).ok_or("the ray goes to the ball")?;
    println!("shape {} at {} after {}", hit.shape, hit.point, hit.t);

    scene.render(&scene.options())?.save("minimal.png")?;
    Ok(())
}
