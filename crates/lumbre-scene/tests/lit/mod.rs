//! Scenes with lights of every kind.

#![allow(dead_code, reason = "not every test uses all")]

use std::sync::Arc;

use lumbre_geometry::{Disk, Sphere};
use lumbre_image::{Image, Rgb};
use lumbre_math::random::RandomStream;
use lumbre_math::{DVec3, Transform, Vec3};
use lumbre_scene::{
    AreaLightDesc, EnvironmentDesc, EnvironmentMapping, GeometryDesc, InstanceDesc, LightDesc, MaterialId,
    MeshDesc, NamedMaterial, ObjectDesc, ObjectId, Scene, SceneDesc, ShapeDesc,
};
use lumbre_shading::Material;

pub(crate) fn shining(index: u32, geometry: GeometryDesc, radiance: f32, two_sided: bool) -> ShapeDesc {
    let radiance = Rgb::splat(radiance);
    let light =
        AreaLightDesc { radiance, image: None, by_vertices: false, two_sided, power: None, spectrum: None };
    ShapeDesc {
        index,
        geometry,
        world_from_object: Transform::IDENTITY,
        reverse_orientation: index.is_multiple_of(2),
        material: Some(MaterialId(0)),
        boundary: None,
        area_light: Some(light),
        alpha: None,
    }
}

fn patch_of_triangles(random: &mut RandomStream) -> GeometryDesc {
    let mut x = || 2.0 * random.next_f32() - 1.0;
    let at = 4.0 * Vec3::new(x(), x(), x());
    let positions = (0..5).map(|_| at + Vec3::new(x(), x(), x())).collect();
    let triangles = vec![[0, 1, 2], [0, 2, 3], [0, 3, 4]];
    GeometryDesc::Mesh(Arc::new(MeshDesc { positions, triangles, ..MeshDesc::default() }))
}

/// A rectangle that is turned, the point in its middle, its unit normal and half its sides.
pub(crate) fn rectangle_of_triangles(random: &mut RandomStream) -> (GeometryDesc, DVec3, DVec3, [DVec3; 2]) {
    let mut x = || 2.0 * random.next_f64() - 1.0;
    let middle = 5.0 * DVec3::new(x(), x(), x());
    let normal = DVec3::new(x(), x(), x()).normalize();
    let across = normal.cross(DVec3::new(x(), x(), x())).normalize();
    let half = [0.8 * across, 0.5 * normal.cross(across)];
    let corner = |a: f64, b: f64| (middle + a * half[0] + b * half[1]).as_vec3();
    let positions = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    let mesh = MeshDesc { positions, triangles: vec![[0, 1, 2], [2, 3, 0]], ..MeshDesc::default() };
    (GeometryDesc::Mesh(Arc::new(mesh)), middle, normal, half)
}

/// Lights of every kind about the origin, but for the origin itself; under an even sky, or one with a picture.
pub(crate) fn lights_of_all_kinds(sky: Option<EnvironmentMapping>) -> Scene {
    let mut random = RandomStream::new(3);
    let mut shapes: Vec<ShapeDesc> = (0..12)
        .map(|i| shining(i, patch_of_triangles(&mut random), 0.5 + random.next_f32(), i % 3 == 0))
        .collect();
    shapes.extend(
        (20..26)
            .map(|i| shining(i, rectangle_of_triangles(&mut random).0, 0.5 + random.next_f32(), i % 3 == 0)),
    );
    let exact = GeometryDesc::Exact;
    let v = DVec3::new;
    shapes.push(shining(
        12,
        exact(Disk::new(v(0.0, 0.0, 5.0), -DVec3::Z, 1.0, 0.0).unwrap().into()),
        2.0,
        false,
    ));
    shapes.push(shining(13, exact(Sphere::new(v(3.0, 4.0, -2.0), 0.7).unwrap().into()), 1.0, false));
    let placed = shining(14, patch_of_triangles(&mut random), 3.0, true);
    let object = ObjectDesc { shapes: vec![placed], ..ObjectDesc::default() };
    let map = Transform::translate(v(0.5, -4.0, 0.3)) * Transform::scale(v(1.0, 2.0, 0.5)).unwrap();
    let turned =
        Transform::translate(v(-3.0, 0.5, 2.0)) * Transform::rotate(v(1.0, 2.0, 0.5), 150.0).unwrap();
    let spot = LightDesc::Spot {
        world_from_light: turned,
        intensity: Rgb::splat(5.0),
        cone_angle: 100.0,
        cone_delta_angle: 60.0,
    };
    let lights = vec![
        LightDesc::Point { from: v(1.0, -2.0, 2.0), intensity: Rgb::splat(3.0) },
        spot,
        LightDesc::Distant { towards: v(0.2, 1.0, 0.4), irradiance: Rgb::splat(0.7) },
        LightDesc::Disc { towards: v(-0.3, 0.4, 0.8), angle: 30.0, irradiance: Rgb::splat(0.5) },
        match sky {
            None => LightDesc::Infinite {
                world_from_light: Transform::IDENTITY,
                radiance: Rgb::splat(0.1),
                image: None,
            },
            Some(mapping) => sky_of(mapping, turned, 0.1),
        },
    ];
    let material = NamedMaterial { name: None, material: Arc::new(Material::default_diffuse()) };
    let instances = vec![InstanceDesc { object: ObjectId(0), world_from_object: map.into() }];
    let objects = vec![object];
    Scene::build(SceneDesc {
        shapes,
        objects,
        instances,
        lights,
        materials: vec![material],
        ..SceneDesc::default()
    })
    .unwrap()
}

/// A dim sky with two bright pixels and some that are black.
pub(crate) fn sky_under(mapping: EnvironmentMapping, world_from_light: Transform) -> Scene {
    let light = sky_of(mapping, world_from_light, 1.5);
    Scene::build(SceneDesc { lights: vec![light], ..SceneDesc::default() }).unwrap()
}

fn sky_of(mapping: EnvironmentMapping, world_from_light: Transform, scale: f32) -> LightDesc {
    let (width, height) = if mapping == EnvironmentMapping::EqualArea { (12, 12) } else { (22, 11) };
    let mut random = RandomStream::new(4);
    let pixel = |i: u32| match i {
        30 | 31 => Rgb::splat(40.0),
        60..70 => Rgb::BLACK,
        _ => Rgb::splat(0.2 + random.next_f32()),
    };
    let image = Image::from_pixels(width, height, (0..width * height).map(pixel).collect()).unwrap();
    let map = EnvironmentDesc { image: Arc::new(image), mapping };
    LightDesc::Infinite { world_from_light, radiance: Rgb::splat(scale), image: Some(map) }
}
