//! What a scene answers about the surfaces in it.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::sync::Arc;

use lumbre_geometry::{
    BilinearPatch, Cone, Cuboid, Cylinder, Disk, Paraboloid, Plane, Quadric, Ray, Shape, ShapeError, Sphere,
    Torus, Triangle,
};
use lumbre_image::Rgb;
use lumbre_math::random::RandomStream;
use lumbre_math::{DVec2, DVec3, Transform, Vec2, Vec3, warp64};
use lumbre_scene::{
    AreaLightDesc, BuildError, BuildWarning, Camera, CameraKind, ColouredShape, CsgDesc, CsgOperation,
    Footprint, GeometryDesc, InstanceDesc, LightDesc, MaterialId, MeshDesc, NamedMaterial, ObjectDesc,
    ObjectId, Scene, SceneDesc, ShapeDesc,
};
use lumbre_shading::{FloatTexture, Material, Spectrum, Texture};

fn shape(index: u32, geometry: GeometryDesc) -> ShapeDesc {
    ShapeDesc {
        index,
        geometry,
        world_from_object: Transform::IDENTITY,
        reverse_orientation: false,
        material: Some(MaterialId(0)),
        boundary: None,
        area_light: None,
        alpha: None,
    }
}

fn exact(shape: impl Into<Shape>) -> GeometryDesc {
    GeometryDesc::Exact(shape.into())
}

fn of_shapes(shapes: Vec<ShapeDesc>) -> SceneDesc {
    let material = NamedMaterial { name: None, material: Arc::new(Material::default_diffuse()) };
    SceneDesc { shapes, materials: vec![material.clone(), material], ..SceneDesc::default() }
}

fn glow() -> AreaLightDesc {
    AreaLightDesc {
        radiance: Rgb::splat(4.0),
        image: None,
        by_vertices: false,
        two_sided: false,
        power: None,
        spectrum: None,
    }
}

fn build(shapes: Vec<ShapeDesc>) -> Scene {
    Scene::build(of_shapes(shapes)).unwrap()
}

fn directions(count: usize) -> impl Iterator<Item = DVec3> {
    let mut random = RandomStream::new(77);
    (0..count).map(move |_| warp64::square_to_sphere(DVec2::new(random.next_f64(), random.next_f64())))
}

/// A square from (2, 3) to (6, 5) at z = 1, as two triangles.
fn square() -> MeshDesc {
    MeshDesc {
        positions: vec![
            Vec3::new(2.0, 3.0, 1.0),
            Vec3::new(6.0, 3.0, 1.0),
            Vec3::new(6.0, 5.0, 1.0),
            Vec3::new(2.0, 5.0, 1.0),
        ],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..MeshDesc::default()
    }
}

fn down(x: f64, y: f64) -> Ray {
    Ray::new(DVec3::new(x, y, 9.0), -DVec3::Z)
}

fn meet<'s>(scene: &'s Scene, ray: &Ray) -> lumbre_scene::Interaction<'s> {
    let hit = scene.closest(ray).expect("a hit");
    scene.interaction(ray, &hit, &Footprint::Point)
}

#[test]
fn rays_that_leave_a_flat_or_convex_surface_never_meet_it_again() {
    let c = DVec3::new(0.5, -0.25, 0.0);
    let shapes: Vec<Shape> = vec![
        Sphere::new(c, 0.7).unwrap().into(),
        Cuboid::new(c - DVec3::new(0.9, 0.4, 0.0), c + 0.6).unwrap().into(),
        Cylinder::new(c - 0.4, c + DVec3::new(0.5, 0.7, 0.0), 0.4, true).unwrap().into(),
        Cone::new(c - 0.4, c + DVec3::new(0.5, 0.7, 0.0), 0.8, 0.0, true).unwrap().into(),
        Disk::new(c, DVec3::Z, 0.9, 0.0).unwrap().into(),
        Disk::new(c, DVec3::new(0.1, -0.2, 1.0), 0.9, 0.2).unwrap().into(),
        Triangle::new(c, c + DVec3::X, c + DVec3::Y).unwrap().into(),
        BilinearPatch::new(c, c + DVec3::X, c + DVec3::Y, c + DVec3::X + DVec3::Y).unwrap().into(),
        Quadric::new([1.0, 4.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -0.5], None).unwrap().into(),
        Paraboloid::new(0.8, 0.1, 1.2, 360.0).unwrap().into(),
    ];
    let quad = MeshDesc {
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y],
        quads: vec![[0, 1, 2, 3]],
        ..MeshDesc::default()
    };
    let geometries = shapes.into_iter().map(GeometryDesc::Exact).chain([GeometryDesc::Mesh(Arc::new(quad))]);
    for geometry in geometries {
        // The inside of a paraboloid is hollow: only the outer side is convex.
        let is_hollow =
            matches!(&geometry, GeometryDesc::Exact(exact) if matches!(*exact, Shape::Paraboloid(_)));
        check_leaving(&geometry, is_hollow);
    }
}

fn check_leaving(geometry: &GeometryDesc, outside_alone: bool) {
    for scale in [1e-6, 1.0, 1e6] {
        for place in [DVec3::ZERO, DVec3::new(30.0, -20.0, 0.0)] {
            let placement =
                Transform::translate(place * scale) * Transform::scale(DVec3::splat(scale)).unwrap();
            let scene = build(vec![ShapeDesc { world_from_object: placement, ..shape(0, geometry.clone()) }]);
            let mut left = 0;
            for (towards, leaving) in directions(1500).zip(directions(1600).skip(100)) {
                let at = placement.point(DVec3::new(0.5, 0.25, 0.1) + 0.3 * leaving);
                let ray = Ray::new(at - 40.0 * scale * towards, towards);
                let Some(hit) = scene.closest(&ray) else { continue };
                let met = scene.interaction(&ray, &hit, &Footprint::Point);
                if outside_alone && !met.front {
                    continue;
                }
                let side = if met.surface.normal.dot(met.towards_origin) > 0.0 { 1.0 } else { -1.0 };
                let out = side * met.surface.normal;
                let leaving = if leaving.dot(out) < 0.0 { -leaving } else { leaving };
                // Grazing rays too.
                for direction in [leaving, (leaving - 0.9999 * leaving.dot(out) * out).normalize(), out] {
                    assert!(
                        !scene.is_occluded(&met.leave(direction)),
                        "{geometry:?} {scale} {place} {ray:?} {direction}"
                    );
                    left += 1;
                }
            }
            assert!(left > 300, "{geometry:?}: {left}");
        }
    }
}

#[test]
fn rays_that_leave_the_origin_do_not_meet_it_again() {
    // Where every coordinate is 0, so is the error of the point.
    let shapes: Vec<Shape> = vec![
        Disk::new(DVec3::ZERO, DVec3::Z, 40.0, 0.0).unwrap().into(),
        Disk::new(DVec3::ZERO, DVec3::new(0.1, -0.2, 1.0), 0.9, 0.0).unwrap().into(),
        Plane::new(DVec3::ZERO, DVec3::new(0.3, 0.2, 1.0)).unwrap().into(),
        Triangle::new(DVec3::ZERO, DVec3::X, DVec3::Y).unwrap().into(),
        BilinearPatch::new(DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::X + DVec3::Y).unwrap().into(),
        Cuboid::new(DVec3::ZERO, DVec3::ONE).unwrap().into(),
    ];
    for (geometry, scale) in
        shapes.into_iter().flat_map(|shape| [1e-3, 0.7, 1.0, 1e3].map(|scale| (shape.clone(), scale)))
    {
        let placement = Transform::scale(DVec3::new(scale, 2.0 * scale, scale)).unwrap();
        let scene =
            build(vec![ShapeDesc { world_from_object: placement, ..shape(0, exact(geometry.clone())) }]);
        let mut left = 0;
        for towards in directions(300) {
            let ray = Ray::new(-3.0 * towards, towards);
            let Some(hit) = scene.closest(&ray) else { continue };
            let met = scene.interaction(&ray, &hit, &Footprint::Point);
            // From inside, a corner of the box leads to its other faces.
            let is_inside = matches!(geometry, Shape::Cuboid(_)) && !met.front;
            if met.surface.point != DVec3::ZERO || is_inside {
                continue;
            }
            let side = if met.surface.normal.dot(met.towards_origin) > 0.0 { 1.0 } else { -1.0 };
            for leaving in directions(30) {
                let leaving = if leaving.dot(side * met.surface.normal) < 0.0 { -leaving } else { leaving };
                assert!(!scene.is_occluded(&met.leave(leaving)), "{geometry:?} {scale} {towards} {leaving}");
                let from_light = Ray { origin: met.shadow_origin(), ..met.leave(leaving) };
                assert!(!scene.is_occluded(&from_light), "{geometry:?} {scale} {towards} {leaving}, light");
                left += 1;
            }
        }
        assert!(left >= 60, "{geometry:?} {scale}: {left}");
    }
}

#[test]
fn the_colour_of_a_line_runs_from_end_to_end() {
    let (from, to) = (DVec3::new(2.0, 3.0, 4.0), DVec3::new(5.0, 1.0, 4.5));
    let colours = [Rgb::new(1.0, 0.25, 0.0), Rgb::new(0.0, 0.75, 0.5)];
    let line = || {
        GeometryDesc::Coloured(Box::new(ColouredShape {
            shape: Cylinder::new(from, to, 0.3, true).unwrap().into(),
            ends: [from, to],
            colours,
            coverages: [1.0, 0.5],
        }))
    };
    let stretch = Transform::translate(DVec3::new(-7.0, 20.0, 3.0))
        * Transform::rotate(DVec3::new(1.0, 2.0, -0.5), 40.0).unwrap()
        * Transform::scale(DVec3::new(-2.0, 0.5, 3.0)).unwrap();
    let turn = Transform::rotate(DVec3::Y, 70.0).unwrap() * Transform::translate(DVec3::new(1.0, -9.0, 2.0));
    let alone = of_shapes(vec![ShapeDesc { world_from_object: stretch, ..shape(0, line()) }]);
    let mut inside = of_shapes(vec![]);
    inside.objects.push(ObjectDesc { shapes: alone.shapes.clone(), ..ObjectDesc::default() });
    inside.instances.push(InstanceDesc { object: ObjectId(0), world_from_object: turn.into() });
    for (scene, place) in [(alone, stretch), (inside, turn * stretch)] {
        let scene = Scene::build(scene).unwrap();
        let mut met_ends = [0; 3];
        for towards in directions(2000) {
            let at = from.lerp(to, towards.x.abs());
            let ray = Ray::new(place.point(at - 0.9 * towards), place.vector(towards).normalize());
            let Some(hit) = scene.closest(&ray) else { continue };
            let met = scene.interaction(&ray, &hit, &Footprint::Point);
            let here = place.inverse_point(met.surface.point) - from;
            let part = (here.dot(to - from) / (to - from).length_squared()) as f32;
            let end = if part < 1e-6 {
                0
            } else if part > 1.0 - 1e-6 {
                2
            } else {
                1
            };
            met_ends[end] += 1;
            let vertex = met.at.vertex;
            let expected = colours[0].lerp(colours[1], part);
            let off =
                [vertex.colour.r - expected.r, vertex.colour.g - expected.g, vertex.colour.b - expected.b];
            assert!(off.iter().all(|off| off.abs() < 1e-5), "{part}: {:?}", vertex.colour);
            assert!((vertex.coverage - (1.0 - 0.5 * part)).abs() < 1e-5, "{part}: {}", vertex.coverage);
        }
        assert!(met_ends.iter().all(|&met| met > 20), "{met_ends:?}");
    }
}

#[test]
fn a_wall_very_near_is_hit_all_the_same() {
    let floor = shape(0, exact(Disk::new(DVec3::new(3.0, 2.0, 0.0), DVec3::Z, 5.0, 0.0).unwrap()));
    let wall = shape(1, exact(Disk::new(DVec3::new(3.0, 2.0, 1e-9), DVec3::Z, 5.0, 0.0).unwrap()));
    let scene = build(vec![floor, wall]);
    let ray = Ray::new(DVec3::new(3.5, 2.5, -4.0), DVec3::Z);
    let met = meet(&scene, &ray);
    assert_eq!(met.shape, 0);
    let mut on = 0;
    for direction in directions(500).filter(|d| d.z > 0.01) {
        assert!(scene.is_occluded(&met.leave(direction)));
        on += 1;
    }
    assert!(on > 200);
}

#[test]
fn a_mesh_without_texture_coordinates_has_those_of_pbrt() {
    let scene = build(vec![shape(4, GeometryDesc::Mesh(Arc::new(square())))]);
    // First triangle (0, 0), (1, 0), (1, 1): at three quarters of x and a quarter of y.
    let met = meet(&scene, &down(5.0, 3.5));
    assert_eq!((met.shape, met.primitive, met.front), (4, 0, true));
    assert!((met.uv() - Vec2::new(0.75, 0.25)).length() < 1e-6, "{}", met.uv());
    assert!((met.surface.dpdu - DVec3::new(4.0, 0.0, 0.0)).length() < 1e-6);
    assert!((met.surface.dpdv - DVec3::new(0.0, 2.0, 0.0)).length() < 1e-6);
    // As a quad both halves share the square's.
    let quad = MeshDesc { triangles: vec![], quads: vec![[0, 1, 2, 3]], ..square() };
    for (x, y) in [(5.0, 3.5), (2.5, 4.5), (3.0, 4.0)] {
        let expected = Vec2::new((x - 2.0) / 4.0, (y - 3.0) / 2.0);
        let scene = build(vec![shape(0, GeometryDesc::Mesh(Arc::new(quad.clone())))]);
        let met = meet(&scene, &down(x.into(), y.into()));
        assert!((met.uv() - expected).length() < 1e-6, "{} {expected}", met.uv());
        // And so when baked through a mirror: x to -x.
        let mirror = Transform::scale(DVec3::new(-1.0, 1.0, 1.0)).unwrap();
        let mirrored = build(vec![ShapeDesc {
            world_from_object: mirror,
            ..shape(0, GeometryDesc::Mesh(Arc::new(quad.clone())))
        }]);
        let met = meet(&mirrored, &down((-x).into(), y.into()));
        assert!((met.uv() - expected).length() < 1e-6, "mirrored: {} {expected}", met.uv());
        assert!((met.surface.normal - DVec3::Z).length() < 1e-9 && met.front);
    }
}

#[test]
fn texture_coordinates_and_normals_of_vertices_are_interpolated() {
    let uvs = vec![Vec2::new(0.5, 0.0), Vec2::new(2.5, 0.0), Vec2::new(2.5, 3.0), Vec2::new(0.5, 3.0)];
    let tilt = |x: f32| Vec3::new(x, 0.0, 1.0).normalize();
    let normals = vec![tilt(-0.5), tilt(0.5), tilt(0.5), tilt(-0.5)];
    let desc = MeshDesc { uvs: Some(uvs), normals: Some(normals), ..square() };
    let geometry = GeometryDesc::Mesh(Arc::new(desc.clone()));
    let scene = build(vec![shape(0, geometry.clone())]);
    let met = meet(&scene, &down(3.0, 3.5));
    assert!((met.uv() - Vec2::new(1.0, 0.75)).length() < 1e-6, "{}", met.uv());
    assert!((met.surface.dpdu - DVec3::new(2.0, 0.0, 0.0)).length() < 1e-6);
    assert!((met.surface.dpdv - DVec3::new(0.0, 2.0 / 3.0, 0.0)).length() < 1e-6);
    // A quarter along: the normal leans half as far as at the side.
    let expected = Vec3::new(-0.25 * 0.5 / 1.25_f32.sqrt() * 2.0, 0.0, 1.0 / 1.25_f32.sqrt()).normalize();
    assert!((met.shading.normal - expected).length() < 1e-6, "{} {expected}", met.shading.normal);
    assert!(met.shading.dndu.x > 0.1);
    assert!((met.surface.normal - DVec3::Z).length() < 1e-12);

    // Vertices say which side is out, and ReverseOrientation turns what they say.
    let mut inward = desc;
    for n in inward.normals.iter_mut().flatten() {
        *n = -*n;
    }
    let inward = GeometryDesc::Mesh(Arc::new(inward));
    let met_front = |geometry: &GeometryDesc, reverse_orientation: bool| {
        let scene = build(vec![ShapeDesc { reverse_orientation, ..shape(0, geometry.clone()) }]);
        let met = meet(&scene, &down(3.0, 3.5));
        assert!(met.surface.normal.dot(met.shading.normal.as_dvec3()) > 0.0);
        met.front
    };
    assert!(met_front(&geometry, false) && !met_front(&geometry, true));
    assert!(!met_front(&inward, false) && met_front(&inward, true));
}

#[test]
fn an_instanced_mesh_carries_its_normals_along() {
    let tilt = Vec3::new(0.5, 0.0, 1.0).normalize();
    let desc = MeshDesc { normals: Some(vec![tilt; 4]), ..square() };
    let placement = Transform::translate(DVec3::new(10.0, 0.0, 3.0))
        * Transform::rotate(DVec3::Z, 90.0).unwrap()
        * Transform::scale(DVec3::new(2.0, 1.0, -1.0)).unwrap();
    let mut scene = of_shapes(vec![]);
    scene.objects = vec![
        ObjectDesc {
            name: "square".into(),
            shapes: vec![shape(3, GeometryDesc::Mesh(Arc::new(desc)))],
            instances: vec![],
        },
        ObjectDesc {
            name: "outer".into(),
            shapes: vec![],
            instances: vec![InstanceDesc {
                object: ObjectId(0),
                world_from_object: Transform::IDENTITY.into(),
            }],
        },
    ];
    scene.instances = vec![InstanceDesc { object: ObjectId(1), world_from_object: placement.into() }];
    let scene = Scene::build(scene).unwrap();
    let target = placement.point(DVec3::new(4.0, 4.5, 1.0));
    let met = meet(&scene, &Ray::new(target + 5.0 * DVec3::Z, -DVec3::Z));
    let expected = placement.normal(tilt.as_dvec3()).normalize();
    assert!((met.shading.normal.as_dvec3() - expected).length() < 1e-6, "{} {expected}", met.shading.normal);
    assert_eq!(met.shape, 3);
    assert!((met.surface.point - target).length() < 1e-9);
}

#[test]
fn objects_that_are_not_placed_are_not_built() {
    // A part of an object with several placements warns that its light is not sampled.
    let shining = |index| ObjectDesc {
        shapes: vec![ShapeDesc {
            area_light: Some(glow()),
            ..shape(index, exact(Sphere::new(DVec3::new(4.0, 4.0, -2.0), 2.5).unwrap()))
        }],
        ..ObjectDesc::default()
    };
    let at = |object, z| InstanceDesc {
        object: ObjectId(object),
        world_from_object: Transform::translate(DVec3::new(0.0, 0.0, z)).into(),
    };
    // 0 is nowhere, 1 in 2, 2 in the world, and 3 only in 0.
    let mut scene = of_shapes(vec![]);
    scene.objects = (5..9).map(shining).collect();
    scene.objects[0].instances = vec![at(3, -7.0)];
    scene.objects[2].instances = vec![at(1, -7.0), at(1, -14.0)];
    scene.instances = vec![at(2, 1.0)];
    let scene = Scene::build(scene).unwrap();
    assert_eq!(scene.warnings(), [BuildWarning::UnsampledLight { shape: 6 }]);
    assert_eq!(scene.accel().primitive_count(), 1);
    assert_eq!(meet(&scene, &down(4.0, 4.0)).shape, 7);
    let below = Ray::new(DVec3::new(4.0, 4.0, -30.0), DVec3::Z);
    assert_eq!(meet(&scene, &below).shape, 6);
}

#[test]
fn cutouts_pass_their_share_deterministically() {
    let sheet = |alpha: FloatTexture| ShapeDesc {
        alpha: Some(Arc::new(alpha)),
        ..shape(0, GeometryDesc::Mesh(Arc::new(square())))
    };
    let half = build(vec![
        sheet(Texture::Constant(0.3)),
        shape(1, exact(Disk::new(DVec3::new(4.0, 4.0, 0.0), DVec3::Z, 9.0, 0.0).unwrap())),
    ]);
    let (mut stopped, mut count) = (0, 0);
    for i in 0..20_000 {
        let ray = down(2.0 + 4.0 * f64::from(i) / 20_000.0, 4.1);
        let met = meet(&half, &ray);
        stopped += u32::from(met.shape == 0);
        assert_eq!(met.shape, meet(&half, &ray).shape);
        let short = ray.with_range(0.0, 8.5);
        assert_eq!(half.is_occluded(&short), met.shape == 0);
        count += 1;
    }
    let share = f64::from(stopped) / f64::from(count);
    assert!((share - 0.3).abs() < 0.015, "{share}");
    let none = build(vec![sheet(Texture::Constant(0.0))]);
    assert!(!none.is_occluded(&down(4.0, 4.0)));
    assert!(none.accel().any(&down(4.0, 4.0)), "queries that are not about light see it");
}

#[test]
fn an_interface_is_no_surface_and_gives_no_light() {
    let pane = ShapeDesc {
        material: None,
        area_light: Some(glow()),
        ..shape(6, GeometryDesc::Mesh(Arc::new(square())))
    };
    let scene = build(vec![pane]);
    assert!(!scene.is_occluded(&down(4.0, 4.0)) && scene.closest(&down(4.0, 4.0)).is_none());
    assert_eq!(scene.warnings(), [BuildWarning::LightOnInterface { shape: 6 }, BuildWarning::NoLight]);
    assert_eq!(scene.lights().len(), 0);
}

fn csg(operation: CsgOperation, operands: Vec<ShapeDesc>) -> GeometryDesc {
    GeometryDesc::Csg(CsgDesc {
        operation,
        operands: operands.into_iter().map(|shape| Arc::new(vec![shape])).collect(),
    })
}

/// A closed box as a mesh.
fn box_mesh(low: Vec3, high: Vec3) -> GeometryDesc {
    let pick = |i: u32, bit: u32, low: f32, high: f32| if i >> bit & 1 == 1 { high } else { low };
    let corner =
        |i| Vec3::new(pick(i, 0, low.x, high.x), pick(i, 1, low.y, high.y), pick(i, 2, low.z, high.z));
    GeometryDesc::Mesh(Arc::new(MeshDesc {
        positions: (0..8).map(corner).collect(),
        quads: vec![[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]],
        ..MeshDesc::default()
    }))
}

#[test]
fn a_hole_shows_the_material_of_what_was_taken_away() {
    let placement = Transform::translate(DVec3::new(20.0, 0.0, 5.0));
    let block = |mesh: bool| {
        if mesh {
            box_mesh(Vec3::new(-2.0, -2.0, -1.0), Vec3::new(2.0, 2.0, 1.5))
        } else {
            exact(Cuboid::new(DVec3::new(-2.0, -2.0, -1.0), DVec3::new(2.0, 2.0, 1.5)).unwrap())
        }
    };
    for as_mesh in [false, true] {
        let drill = ShapeDesc {
            material: Some(MaterialId(1)),
            ..shape(12, exact(Sphere::new(DVec3::new(0.5, 0.0, 1.5), 1.25).unwrap()))
        };
        let solid = csg(CsgOperation::Difference, vec![shape(11, block(as_mesh)), drill]);
        let scene = build(vec![ShapeDesc { world_from_object: placement, ..shape(10, solid) }]);
        // Down into the hole: the inside of the sphere, facing up.
        let met = meet(&scene, &Ray::new(DVec3::new(20.5, 0.0, 15.0), -DVec3::Z));
        assert_eq!((met.shape, met.front), (12, true), "mesh: {as_mesh}");
        assert!((met.surface.point - DVec3::new(20.5, 0.0, 5.25)).length() < 1e-6);
        assert!((met.surface.normal - DVec3::Z).length() < 1e-6);
        // Next to the hole: the block's own top.
        let met = meet(&scene, &Ray::new(DVec3::new(18.5, 0.3, 15.0), -DVec3::Z));
        assert_eq!((met.shape, met.front), (11, true), "mesh: {as_mesh}");
        assert!((met.surface.point.z - 6.5).abs() < 1e-6 && (met.surface.normal - DVec3::Z).length() < 1e-6);
        // From inside the block its far face is met from the back.
        let met = meet(&scene, &Ray::new(DVec3::new(18.5, 0.3, 5.0), -DVec3::Z));
        assert!(!met.front && (met.surface.point.z - 4.0).abs() < 1e-6);
    }
}

#[test]
fn a_mesh_taken_away_shows_its_inside_turned_out() {
    let ball = shape(1, exact(Sphere::new(DVec3::new(0.0, 0.0, 0.5), 3.0).unwrap()));
    let hole = shape(2, box_mesh(Vec3::new(-1.0, -1.25, 1.0), Vec3::new(1.5, 1.0, 9.0)));
    let scene = build(vec![shape(0, csg(CsgOperation::Difference, vec![ball, hole]))]);
    let met = meet(&scene, &down(0.25, 0.5));
    assert_eq!((met.shape, met.front), (2, true));
    assert!((met.surface.point.z - 1.0).abs() < 1e-6 && (met.surface.normal - DVec3::Z).length() < 1e-9);
    assert!(met.shading.normal.z > 0.999);
}

#[test]
fn what_is_no_solid_cannot_be_combined() {
    let ball = || shape(3, exact(Sphere::new(DVec3::new(1.0, 2.0, 3.0), 2.0).unwrap()));
    let refused = |operands| {
        let desc = of_shapes(vec![shape(9, csg(CsgOperation::Union, operands))]);
        match Scene::build(desc) {
            Err(BuildError::Csg { shape, reason }) => (shape, reason),
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(refused(vec![ball(), shape(4, GeometryDesc::Mesh(Arc::new(square())))]).0, 4);
    let disk = shape(5, exact(Disk::new(DVec3::new(1.0, 1.0, 1.0), DVec3::Z, 2.0, 0.0).unwrap()));
    assert_eq!(refused(vec![ball(), disk]).0, 5);
    assert_eq!(refused(vec![ball()]).0, 9);
}

#[test]
fn nested_csg_is_refused_only_if_very_deep() {
    let nested = |depth: usize| {
        let ball = |x: f64| shape(1, exact(Sphere::new(DVec3::new(x, 2.0, 3.0), 2.0).unwrap()));
        let mut geometry = csg(CsgOperation::Union, vec![ball(0.0), ball(0.5)]);
        for level in 1..depth {
            geometry = csg(CsgOperation::Union, vec![shape(2, geometry), ball(level as f64)]);
        }
        Scene::build(of_shapes(vec![shape(0, geometry)]))
    };
    assert!(nested(20).is_ok());
    // On a stack of a size that is known.
    let deep = std::thread::Builder::new().stack_size(1 << 26).spawn(move || {
        assert!(nested(500).is_ok());
        assert!(matches!(nested(1100), Err(BuildError::Csg { .. })));
    });
    deep.unwrap().join().unwrap();
}

#[test]
fn what_cannot_be_built_is_named() {
    let error = |desc: SceneDesc| Scene::build(desc).unwrap_err();
    let plane =
        ShapeDesc { area_light: Some(glow()), ..shape(7, exact(Plane::new(DVec3::ONE, DVec3::Z).unwrap())) };
    assert_eq!(error(of_shapes(vec![plane])), BuildError::InfiniteLight { shape: 7, name: "plane" });
    let unknown =
        ShapeDesc { material: Some(MaterialId(5)), ..shape(8, GeometryDesc::Mesh(Arc::new(square()))) };
    assert_eq!(
        error(of_shapes(vec![unknown])),
        BuildError::NoSuchMaterial { shape: 8, material: 5, count: 2 }
    );

    let instance =
        |object| InstanceDesc { object: ObjectId(object), world_from_object: Transform::IDENTITY.into() };
    let object = |name: &str, inner: Vec<InstanceDesc>| ObjectDesc {
        name: name.into(),
        shapes: vec![],
        instances: inner,
    };
    let cycle = SceneDesc {
        objects: vec![object("a", vec![instance(1)]), object("b", vec![instance(0)])],
        ..of_shapes(vec![])
    };
    assert!(matches!(error(cycle), BuildError::ObjectCycle { .. }));
    let missing =
        SceneDesc { instances: vec![instance(2)], objects: vec![object("a", vec![])], ..of_shapes(vec![]) };
    assert_eq!(error(missing), BuildError::NoSuchObject { object: 2, count: 1 });
    let chain =
        (0..100_000).map(|i| object("link", if i == 0 { vec![] } else { vec![instance(i - 1)] })).collect();
    assert!(matches!(
        error(SceneDesc { objects: chain, ..of_shapes(vec![]) }),
        BuildError::NestedTooDeeply { .. }
    ));

    let light = SceneDesc {
        lights: vec![LightDesc::Distant { towards: DVec3::ZERO, irradiance: Rgb::WHITE }],
        ..of_shapes(vec![])
    };
    assert!(matches!(error(light), BuildError::Light { light: 0, .. }));
    let camera = Camera {
        name: None,
        kind: CameraKind::Perspective { fov: 180.0, lens_radius: 0.0, focal_distance: 1.0 },
        world_from_camera: Transform::IDENTITY,
        motion: None,
        frame_aspect: None,
        screen_window: None,
        shutter_open: 0.0,
        shutter_close: 1.0,
        clip: None,
        medium: None,
    };
    let camera = SceneDesc { cameras: vec![camera], ..of_shapes(vec![]) };
    assert!(matches!(error(camera), BuildError::Camera { camera: 0, parameter: "fov", .. }));
    let _: Result<Sphere, ShapeError> = Sphere::new(DVec3::ONE, 2.0);
}

#[test]
fn a_scene_of_nothing_builds_and_answers() {
    let scene = Scene::build(SceneDesc::default()).unwrap();
    assert!(scene.closest(&down(1.0, 2.0)).is_none());
    assert_eq!((scene.cameras().len(), scene.lights().len()), (1, 1));
    let sample =
        scene.sample_light(DVec3::new(1.0, 2.0, 3.0), DVec3::ZERO, 0.0, 0.3, DVec2::new(0.7, 0.6)).unwrap();
    assert!(sample.towards.is_normalized() && sample.radiance.is_finite());
}

#[test]
fn a_description_with_a_light_or_a_camera_keeps_its_own() {
    let lamp = ShapeDesc {
        area_light: Some(glow()),
        ..shape(0, exact(Torus::new(DVec3::ONE, DVec3::Z, 2.0, 0.5).unwrap()))
    };
    let scene = build(vec![lamp]);
    assert_eq!(scene.lights().len(), 1);
    assert!(!scene.lights()[0].is_infinite());
    assert_eq!(build(vec![shape(0, GeometryDesc::Mesh(Arc::new(square())))]).lights().len(), 1);
}

#[test]
fn cameras_see_through_one_sided_backs_and_light_does_not() {
    let mut count = 0;
    for (mirrored, reverse) in [(false, false), (true, false), (false, true)] {
        let mut desc = SceneDesc::default();
        let material = Material { one_sided: true, ..Material::default_diffuse() };
        desc.materials.push(NamedMaterial { name: None, material: Arc::new(material) });
        let mesh = MeshDesc {
            positions: vec![Vec3::new(-4.0, -4.0, 3.0), Vec3::new(4.0, -4.0, 3.0), Vec3::new(0.0, 5.0, 3.0)],
            triangles: vec![[0, 1, 2]],
            // Which say nothing about the way the face runs.
            normals: Some(vec![Vec3::NEG_Z; 3]),
            ..MeshDesc::default()
        };
        let scale = DVec3::new(if mirrored { -1.0 } else { 1.0 }, 1.0, 1.0);
        desc.shapes.push(ShapeDesc {
            index: 0,
            geometry: GeometryDesc::Mesh(Arc::new(mesh)),
            world_from_object: Transform::scale(scale).unwrap(),
            reverse_orientation: reverse,
            material: Some(MaterialId(0)),
            boundary: None,
            area_light: None,
            alpha: None,
        });
        let scene = Scene::build(desc).unwrap();
        for (from, towards, is_front) in [(9.0, DVec3::NEG_Z, !reverse), (-2.0, DVec3::Z, reverse)] {
            let ray = Ray::new(DVec3::new(0.5, 0.25, from), towards);
            assert_eq!(scene.closest_seen(&ray, [0.5; 2]).is_some(), is_front, "{mirrored} {reverse} {from}");
            assert!(scene.closest(&ray).is_some() && scene.is_occluded(&ray));
            count += 1;
        }
    }
    assert_eq!(count, 6);
}

#[test]
fn one_material_under_several_names_has_one_number() {
    let [paint, glass] = [0.2, 0.8].map(|grey| Arc::new(Material::diffuse(Spectrum::splat(grey))));
    let named = |material: &Arc<Material>| NamedMaterial { name: None, material: material.clone() };
    let ball = |number: u32| ShapeDesc {
        material: Some(MaterialId(number)),
        world_from_object: Transform::translate(DVec3::X * f64::from(number)),
        ..shape(number, exact(Sphere::new(DVec3::ZERO, 0.25).unwrap()))
    };
    let materials = vec![named(&paint), named(&glass), named(&paint)];
    let scene =
        Scene::build(SceneDesc { shapes: (0..3).map(ball).collect(), materials, ..SceneDesc::default() });
    let scene = scene.unwrap();
    let ids = [0.0, 1.0, 2.0].map(|x| meet(&scene, &down(x, 0.0)).material_id);
    assert_eq!(ids, [0, 1, 0].map(MaterialId));
}
