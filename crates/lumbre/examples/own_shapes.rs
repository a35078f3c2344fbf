//! Shapes of a program's own, an implicit surface and custom geometry: `cargo run --release --example own_shapes`.

use lumbre::geometry::{Aabb, ImplicitSurface, Plane, Root, Roots, Surface};
use lumbre::image::Rgb;
use lumbre::kernel::CustomGeometry;
use lumbre::shading::Material;
use lumbre::{DVec3, Ray, SceneBuilder, ShapeBuilder};

/// Balls of one radius, each a primitive of its own.
#[derive(Debug)]
struct Balls {
    centers: Vec<DVec3>,
    radius: f64,
}

impl CustomGeometry for Balls {
    fn primitive_count(&self) -> u32 {
        self.centers.len() as u32
    }

    fn bounds(&self, ball: u32) -> Option<Aabb> {
        let center = self.centers[ball as usize];
        Some(Aabb { min: center - self.radius, max: center + self.radius })
    }

    fn closest(&self, ball: u32, ray: &Ray) -> Option<Root> {
        let mut roots = Roots::new();
        self.roots(ball, ray, &mut roots);
        roots.first().copied()
    }

    fn roots(&self, ball: u32, ray: &Ray, out: &mut Roots) {
        // Where |o + t d|² = r²; directions need not have length 1.
        let from = ray.origin - self.centers[ball as usize];
        let (a, half_b) = (ray.direction.length_squared(), from.dot(ray.direction));
        let discriminant = half_b * half_b - a * (from.length_squared() - self.radius * self.radius);
        if discriminant < 0.0 {
            return;
        }
        let root = discriminant.sqrt();
        let both = [(-half_b - root) / a, (-half_b + root) / a];
        out.extend(both.into_iter().filter(|&t| ray.contains(t)).map(Root::at));
    }

    fn surface(&self, ball: u32, ray: &Ray, root: &Root) -> Surface {
        // On the surface again, so that the next ray leaves from there.
        let center = self.centers[ball as usize];
        let normal = (ray.at(root.t) - center).normalize();
        Surface::new(center + self.radius * normal, normal)
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // F is negative inside. It is written with numbers that carry bounds, so that no crossing is lost.
    let bounds = Aabb { min: DVec3::splat(-1.3), max: DVec3::splat(1.3) };
    let blob = ImplicitSurface::new(bounds, |[x, y, z]| {
        x.powi(4) + y.powi(4) + z.powi(4) - x.square() - y.square() - z.square() + 0.4
    })?;
    let centers = (0..12).map(|i| 1.9 * DVec3::new(f64::from(i).cos(), f64::from(i).sin(), -0.45)).collect();
    let scene = SceneBuilder::new()
        .shape(ShapeBuilder::custom(blob).material(Material::diffuse(Rgb::new(0.8, 0.4, 0.1))))
        .shape(ShapeBuilder::custom(Balls { centers, radius: 0.4 }))
        .shape(ShapeBuilder::exact(Plane::new(-1.25 * DVec3::Z, DVec3::Z)?))
        .build()?;

    let hits = scene.count(&Ray::new(DVec3::new(-5.0, 0.1, 0.2), DVec3::X));
    println!("a ray through the blob crosses {hits} surfaces");
    scene.render(&scene.options().with_spp(16))?.save("own_shapes.png")?;
    Ok(())
}
