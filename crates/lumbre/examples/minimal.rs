//! A scene made in Rust, asked with a ray, and rendered: `cargo run --release --example minimal`.

use lumbre::description::{Camera, FilmDesc, LightDesc};
use lumbre::geometry::{Plane, Sphere, Torus};
use lumbre::image::Rgb;
use lumbre::shading::Material;
use lumbre::{DVec3, Ray, SceneBuilder, ShapeBuilder, Transform};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let ball = Sphere::new(DVec3::new(-1.2, 0.0, 0.9), 0.9)?;
    let ring = Torus::new(DVec3::new(1.1, 0.0, 0.35), DVec3::new(0.3, 0.0, 1.0), 0.8, 0.3)?;
    let floor = Plane::new(DVec3::ZERO, DVec3::Z)?;
    let lamp = Sphere::new(DVec3::new(-3.0, -4.0, 6.0), 0.8)?;

    let eye = DVec3::new(0.0, -8.0, 3.0);
    let scene = SceneBuilder::new()
        .shape(ShapeBuilder::exact(ball).material(Material::diffuse(Rgb::new(0.8, 0.25, 0.08))))
        .shape(ShapeBuilder::exact(ring).material(Material::diffuse(Rgb::new(0.15, 0.4, 0.5))))
        .shape(ShapeBuilder::exact(floor))
        .shape(ShapeBuilder::exact(lamp).shining(Rgb::splat(30.0)))
        .light(LightDesc::Infinite {
            world_from_light: Transform::IDENTITY,
            radiance: Rgb::splat(0.3),
            image: None,
        })
        .camera(Camera::perspective(eye, DVec3::new(0.0, 0.0, 0.6), DVec3::Z, 32.0)?)
        .film(FilmDesc { width: Some(640), height: Some(400), ..FilmDesc::default() })
        .build()?;

    let hit = scene.closest(&Ray::new(eye, DVec3::new(-1.2, 8.0, -2.1))).ok_or("the ray goes to the ball")?;
    println!("shape {} at {} after {}", hit.shape, hit.point, hit.t);

    scene.render(&scene.options())?.save("minimal.png")?;
    Ok(())
}
