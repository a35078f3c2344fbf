//! The scenes that the benchmark makes itself: the same triangles on every machine and every day.

use std::sync::Arc;

use lumbre_geometry::{Cone, Cuboid, Cylinder, PlacedShape, Shape, Sphere, Torus, Triangle};
use lumbre_kernel::{SphereCloud, TriangleMesh};
use lumbre_math::random::RandomStream;
use lumbre_math::{DAffine3, DVec3, Transform};

use crate::scene::{Camera, Hair, Placement, Scene};
use crate::shaping::{Shaper, between, direction};

/// A scene yet to be made.
pub(crate) struct Recipe {
    /// Its name.
    pub name: &'static str,
    /// Whether it is small enough to be measured in a hurry.
    pub is_quick: bool,
    make: fn(&str) -> Scene,
}

impl Recipe {
    /// Makes it.
    pub(crate) fn make(&self) -> Scene {
        (self.make)(self.name)
    }
}

/// Every scene that needs no file.
pub(crate) const RECIPES: &[Recipe] = &[
    Recipe { name: "scan-1k", is_quick: true, make: |name| scan(name, 9) },
    Recipe { name: "scan-100k", is_quick: true, make: |name| scan(name, 91) },
    Recipe { name: "scan-1m", is_quick: false, make: |name| scan(name, 289) },
    Recipe { name: "scan-10m", is_quick: false, make: |name| scan(name, 913) },
    Recipe { name: "indoor", is_quick: true, make: indoor },
    Recipe { name: "terrain", is_quick: false, make: terrain },
    Recipe { name: "bars", is_quick: false, make: bars },
    Recipe { name: "sponge", is_quick: false, make: sponge },
    Recipe { name: "needles", is_quick: false, make: needles },
    Recipe { name: "stadium", is_quick: false, make: stadium },
    Recipe { name: "forest", is_quick: false, make: forest },
    Recipe { name: "pipes", is_quick: false, make: pipes },
    Recipe { name: "boulders", is_quick: false, make: boulders },
    Recipe { name: "spheres-20k", is_quick: true, make: |name| spheres(name, 20_000) },
    Recipe { name: "spheres-1m", is_quick: false, make: |name| spheres(name, 1_000_000) },
    Recipe { name: "hair-20k", is_quick: true, make: |name| hair(name, 20_000) },
    Recipe { name: "hair-1m", is_quick: false, make: |name| hair(name, 1_000_000) },
    Recipe { name: "mixed", is_quick: true, make: mixed },
    Recipe { name: "park", is_quick: false, make: park },
];

/// A closed ball with bumps and grooves as a scanner sees them: 12 n² triangles.
fn scan(name: &str, n: u32) -> Scene {
    Scene::of_mesh(name, bumpy_ball(n))
}

fn bumpy_ball(n: u32) -> TriangleMesh {
    let mut shaper = Shaper::default();
    let surface = |p: DVec3| {
        let d = p.normalize();
        let bumps = 0.12 * (5.0 * d.x + 2.0 * (3.0 * d.y).sin()).sin() * (4.0 * d.z).cos()
            + 0.03 * (23.0 * d.x).sin() * (19.0 * d.y).sin() * (21.0 * d.z).sin()
            + 0.004 * (150.0 * d.y + 5.0 * (40.0 * d.x).sin()).sin();
        d * (1.0 + bumps)
    };
    // Tangents even out the sizes of the squares.
    let even = |i: u32| {
        let s = f64::from(i) / f64::from(n) * 2.0 - 1.0;
        (std::f64::consts::FRAC_PI_4 * s).tan()
    };
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            shaper.grid(n, n, |row, column| {
                let mut p = DVec3::ZERO;
                p[axis] = side;
                // Turned so that all six faces look outward.
                let (u, v) = if side > 0.0 { (row, column) } else { (column, row) };
                p[(axis + 1) % 3] = even(u);
                p[(axis + 2) % 3] = even(v);
                surface(p)
            });
        }
    }
    shaper.finish()
}

/// Rooms with doors, shelves of books, tables, chairs and crockery: large and small boxes side by side.
fn indoor(name: &str) -> Scene {
    let mut random = RandomStream::new(3);
    let mut shaper = Shaper::default();
    let (half_x, height, half_z) = (12.0, 3.0, 8.0);
    shaper.cuboid(DVec3::new(0.0, height / 2.0, 0.0), DVec3::new(half_x, height / 2.0, half_z), 0.0);
    for x in [-4.0, 4.0] {
        // A wall with a door in it.
        shaper.cuboid(DVec3::new(x, 1.5, -4.5), DVec3::new(0.1, 1.5, 3.5), 0.0);
        shaper.cuboid(DVec3::new(x, 1.5, 4.5), DVec3::new(0.1, 1.5, 3.5), 0.0);
        shaper.cuboid(DVec3::new(x, 2.6, 0.0), DVec3::new(0.1, 0.4, 1.0), 0.0);
    }
    for (x, z) in [(-8.0, -7.8), (0.0, -7.8), (8.0, -7.8), (-8.0, 7.8), (8.0, 7.8)] {
        shelf(&mut shaper, &mut random, DVec3::new(x, 0.0, z));
    }
    for x in [-9.5, -6.5, -1.5, 1.5, 6.5, 9.5] {
        for z in [-4.0, 0.0, 4.0] {
            let yaw = between(&mut random, -0.4, 0.4);
            table(&mut shaper, &mut random, DVec3::new(x, 0.0, z), yaw);
        }
    }
    let camera =
        Camera { eye: DVec3::new(-3.0, 1.7, 6.5), target: DVec3::new(1.0, 1.0, -3.0), field_of_view: 65.0 };
    let lamp = (DVec3::new(0.0, 2.9, 1.0), 1.2);
    Scene { meshes: vec![Arc::new(shaper.finish())], ..Scene::empty(name, camera, lamp) }
}

/// Boards two metres high and four wide, and the books on them.
fn shelf(shaper: &mut Shaper, random: &mut RandomStream, foot: DVec3) {
    for board in 0..6 {
        let at = foot + DVec3::new(0.0, 0.1 + 0.38 * f64::from(board), 0.0);
        shaper.cuboid(at, DVec3::new(2.0, 0.015, 0.16), 0.0);
        let mut x = -1.95;
        while board < 5 && x < 1.9 {
            let half = DVec3::new(
                between(random, 0.008, 0.03),
                between(random, 0.09, 0.15),
                between(random, 0.07, 0.12),
            );
            let book = at + DVec3::new(x + half.x, 0.016 + half.y, 0.0);
            shaper.cuboid(book, half, between(random, -0.05, 0.05));
            x += 2.0 * half.x + 0.004;
        }
    }
}

/// A table, four chairs, cups and balls.
fn table(shaper: &mut Shaper, random: &mut RandomStream, foot: DVec3, yaw: f64) {
    let turn = |v: DVec3| {
        let (sin, cos) = yaw.sin_cos();
        foot + DVec3::new(cos * v.x + sin * v.z, v.y, cos * v.z - sin * v.x)
    };
    let mut block = |center: DVec3, half: DVec3| shaper.cuboid(turn(center), half, yaw);
    block(DVec3::new(0.0, 0.74, 0.0), DVec3::new(0.8, 0.02, 0.5));
    for (x, z) in [(-0.75, -0.45), (0.75, -0.45), (-0.75, 0.45), (0.75, 0.45)] {
        block(DVec3::new(x, 0.36, z), DVec3::new(0.03, 0.36, 0.03));
    }
    for (x, z) in [(-0.4, -0.8), (0.4, -0.8), (-0.4, 0.8), (0.4, 0.8)] {
        block(DVec3::new(x, 0.45, z), DVec3::new(0.2, 0.02, 0.2));
        block(DVec3::new(x, 0.7, z * 1.23), DVec3::new(0.2, 0.25, 0.015));
        for (dx, dz) in [(-0.17, -0.17), (0.17, -0.17), (-0.17, 0.17), (0.17, 0.17)] {
            block(DVec3::new(x + dx, 0.22, z + dz), DVec3::new(0.015, 0.22, 0.015));
        }
    }
    for _ in 0..6 {
        let spot = DVec3::new(between(random, -0.7, 0.7), 0.76, between(random, -0.4, 0.4));
        if random.next_f64() < 0.6 {
            // A cup with an inside.
            let profile = [(0.0, 0.0), (0.03, 0.0), (0.04, 0.1), (0.036, 0.1), (0.027, 0.01), (0.0, 0.01)];
            shaper.lathe(turn(spot), 24, 5, |s| profile[(s * 5.0).round() as usize]);
        } else {
            shaper.ball(turn(spot + DVec3::new(0.0, 0.05, 0.0)), 0.05, 20);
        }
    }
}

/// Six gratings of bars that cross: wherever two do, their faces lie in one plane, and a ray meets both at once.
fn bars(name: &str) -> Scene {
    let mut shaper = Shaper::default();
    let (count, step, half) = (120, 0.1, 0.01);
    let end = 0.5 * f64::from(count) * step;
    for grating in 0..6 {
        let z = f64::from(grating);
        for bar in 0..count {
            let at = f64::from(bar) * step - end;
            shaper.cuboid(DVec3::new(at, 0.0, z), DVec3::new(half, end, half), 0.0);
            shaper.cuboid(DVec3::new(0.0, at, z), DVec3::new(end, half, half), 0.0);
        }
    }
    Scene::of_mesh(name, shaper.finish())
}

/// A sponge after K. Menger, of eight thousand cubes side by side: the faces between two are there twice.
fn sponge(name: &str) -> Scene {
    let mut cubes = vec![DVec3::ZERO];
    let mut size = 1.0;
    for _ in 0..3 {
        size /= 3.0;
        let steps = (0..27).map(|i: i32| [i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1]);
        let kept = steps.filter(|step| step.iter().filter(|&&s| s == 0).count() < 2);
        let offsets: Vec<_> = kept.map(|step| DVec3::from_array(step.map(f64::from)) * 2.0 * size).collect();
        cubes = cubes.iter().flat_map(|&cube| offsets.iter().map(move |&offset| cube + offset)).collect();
    }
    let mut shaper = Shaper::default();
    for cube in cubes {
        shaper.cuboid(cube, DVec3::splat(size), 0.0);
    }
    Scene::of_mesh(name, shaper.finish())
}

/// Hills of half a million triangles, seen from among them.
fn terrain(name: &str) -> Scene {
    let mesh = hills(500, 100.0);
    let camera =
        Camera { eye: DVec3::new(10.0, 22.0, 45.0), target: DVec3::new(0.0, 2.0, 0.0), field_of_view: 50.0 };
    let lamp = (DVec3::new(60.0, 70.0, -40.0), 8.0);
    Scene { meshes: vec![Arc::new(mesh)], ..Scene::empty(name, camera, lamp) }
}

fn hills(n: u32, side: f64) -> TriangleMesh {
    let mut shaper = Shaper::default();
    shaper.grid(n, n, |row, column| {
        let at = |i: u32| (f64::from(i) / f64::from(n) - 0.5) * side;
        let (x, z) = (at(column), at(row));
        DVec3::new(x, height_of_hills(x, z), z)
    });
    shaper.finish()
}

/// Seven octaves of value noise on a lattice, ten metres high.
fn height_of_hills(x: f64, z: f64) -> f64 {
    let corner = |i: i64, j: i64, octave: u64| {
        RandomStream::new(lumbre_math::random::hash_words(&[i as u64, j as u64, octave])).next_f64()
    };
    (0..7)
        .map(|octave| {
            let scale = 0.04 * 2.0_f64.powi(octave);
            let (u, v) = (x * scale, z * scale);
            let (i, j) = (u.floor(), v.floor());
            let smooth = |s: f64| s * s * (3.0 - 2.0 * s);
            let (s, t) = (smooth(u - i), smooth(v - j));
            let (i, j, octave_key) = (i as i64, j as i64, octave as u64);
            let mix = |a: f64, b: f64, s: f64| a + (b - a) * s;
            let near = mix(corner(i, j, octave_key), corner(i + 1, j, octave_key), s);
            let far = mix(corner(i, j + 1, octave_key), corner(i + 1, j + 1, octave_key), s);
            10.0 * mix(near, far, t) / 2.0_f64.powi(octave)
        })
        .sum()
}

/// A hundred thousand thin triangles, hundreds to thousands of times as long as wide, in every direction.
fn needles(name: &str) -> Scene {
    let mut random = RandomStream::new(5);
    let mut shaper = Shaper::default();
    for _ in 0..100_000 {
        let start = DVec3::new(
            between(&mut random, -1.0, 1.0),
            between(&mut random, -1.0, 1.0),
            between(&mut random, -1.0, 1.0),
        );
        let along = direction(&mut random) * between(&mut random, 0.1, 0.6);
        let across = direction(&mut random) * between(&mut random, 0.0001, 0.0008);
        shaper.triangle([start, start + along, start + across]);
    }
    Scene::of_mesh(name, shaper.finish())
}

/// A teapot of 200,000 triangles on the grass of a stadium of 2,000: sizes from a millimetre to 200 metres.
fn stadium(name: &str) -> Scene {
    let mut shaper = Shaper::default();
    let grass = |x: f64, z: f64| DVec3::new(x, 0.0, z);
    shaper.quad([grass(-60.0, -60.0), grass(-60.0, 60.0), grass(60.0, 60.0), grass(60.0, -60.0)]);
    // The stands rise in steps.
    shaper.lathe(DVec3::ZERO, 48, 20, |s| {
        let step = (s * 20.0).round();
        (60.0 + 2.0 * (step / 2.0).ceil(), 1.5 * (step / 2.0).floor())
    });
    let foot = DVec3::new(0.5, 0.0, 0.25);
    shaper.lathe(foot, 400, 200, |s| {
        let bulge = (std::f64::consts::PI * s.powf(0.8)).sin();
        (0.001 + 0.07 * bulge + 0.05 * (1.0 - s) * (8.0 * s).min(1.0), 0.16 * s + 0.002 * (60.0 * s).sin())
    });
    let half_turn = |s: f64| std::f64::consts::PI * (s - 0.5);
    shaper.tube(64, 160, |s| {
        let (sin, cos) = half_turn(s).sin_cos();
        (foot + DVec3::new(0.07 + 0.05 * cos, 0.08 + 0.05 * sin, 0.0), 0.008)
    });
    shaper
        .tube(64, 160, |s| (foot + DVec3::new(-0.07 - 0.08 * s, 0.05 + 0.1 * s * s, 0.0), 0.02 - 0.012 * s));
    let camera = Camera {
        eye: foot + DVec3::new(0.15, 0.22, 0.5),
        target: foot + DVec3::new(-0.02, 0.07, 0.0),
        field_of_view: 50.0,
    };
    let lamp = (DVec3::new(-20.0, 45.0, 30.0), 6.0);
    Scene { meshes: vec![Arc::new(shaper.finish())], ..Scene::empty(name, camera, lamp) }
}

/// Ten thousand trees of three kinds on hills: fifty million triangles by instancing.
fn forest(name: &str) -> Scene {
    let mut random = RandomStream::new(8);
    let trees = [2.0, 3.5, 5.0].map(|height| Arc::new(tree(&mut random, height)));
    let mut placements = Vec::new();
    for row in 0..100 {
        for column in 0..100 {
            let mut jittered = |i: i32| (f64::from(i) + random.next_f64()) - 50.0;
            let (x, z) = (jittered(column), jittered(row));
            let (sin, cos) = (std::f64::consts::TAU * random.next_f64()).sin_cos();
            let size = between(&mut random, 0.6, 1.3);
            let columns = [
                [size * cos, 0.0, -size * sin],
                [0.0, size * between(&mut random, 0.8, 1.2), 0.0],
                [size * sin, 0.0, size * cos],
                [x, height_of_hills(x, z), z],
            ];
            placements.push(Placement {
                mesh: random.next_below(trees.len()),
                world_from_object: columns.map(|column| column.map(|v| v as f32)),
            });
        }
    }
    let camera =
        Camera { eye: DVec3::new(10.0, 22.0, 45.0), target: DVec3::new(0.0, 4.0, 0.0), field_of_view: 50.0 };
    let lamp = (DVec3::new(60.0, 70.0, -40.0), 8.0);
    Scene {
        meshes: vec![Arc::new(hills(100, 100.0))],
        placed_meshes: trees.to_vec(),
        placements,
        ..Scene::empty(name, camera, lamp)
    }
}

/// Everything in one tree: hills of a hundred thousand triangles, five hundred trees and twenty thousand stones by
/// instancing, mostly seen from hundreds of times their size, and three hundred exact shapes.
fn park(name: &str) -> Scene {
    let mut random = RandomStream::new(31);
    let mut stone = bumpy_ball(8);
    for p in &mut stone.positions {
        *p *= lumbre_math::Vec3::new(1.0, 0.6, 0.8);
    }
    let placed = vec![Arc::new(tree(&mut random, 3.5)), Arc::new(stone)];
    let foot = |random: &mut RandomStream| {
        let (x, z) = (between(random, -48.0, 48.0), between(random, -48.0, 48.0));
        DVec3::new(x, height_of_hills(x, z), z)
    };
    let mut placements = Vec::new();
    for i in 0..20_500 {
        let mesh = usize::from(i >= 500);
        let size = if mesh == 0 { between(&mut random, 0.6, 1.3) } else { between(&mut random, 0.03, 0.12) };
        let place = Transform::translate(foot(&mut random))
            * Transform::rotate(DVec3::Y, 360.0 * random.next_f64()).expect("an axis")
            * Transform::scale(DVec3::splat(size)).expect("not flat");
        placements.push(Placement { mesh, world_from_object: columns_of(&place) });
    }
    let shapes = (0..300).map(|i| {
        let kind: Shape = match i % 3 {
            0 => Sphere::new(0.4 * DVec3::Y, 0.5).expect("a radius").into(),
            1 => Cylinder::new(DVec3::ZERO, 1.2 * DVec3::Y, 0.2, true).expect("a radius").into(),
            _ => Cuboid::new(DVec3::new(-0.6, 0.0, -0.2), DVec3::new(0.6, 0.5, 0.2)).expect("a size").into(),
        };
        let place = Transform::translate(foot(&mut random))
            * Transform::rotate(DVec3::Y, 360.0 * random.next_f64()).expect("an axis");
        PlacedShape::new(kind, place)
    });
    let shapes = Arc::new(shapes.collect());
    let camera =
        Camera { eye: DVec3::new(10.0, 22.0, 45.0), target: DVec3::new(0.0, 2.0, 0.0), field_of_view: 50.0 };
    let lamp = (DVec3::new(60.0, 70.0, -40.0), 8.0);
    Scene {
        meshes: vec![Arc::new(hills(224, 100.0))],
        shapes,
        placed_meshes: placed,
        placements,
        ..Scene::empty(name, camera, lamp)
    }
}

/// A thousand long bent pipes, every which way and through one another: the boxes of all overlap.
fn pipes(name: &str) -> Scene {
    let mut random = RandomStream::new(21);
    let mut shaper = Shaper::default();
    shaper.tube(24, 200, |s| {
        let bend = 0.3 * (9.0 * s).sin();
        (DVec3::new(10.0 * s - 5.0, bend, 0.2 * (14.0 * s).cos()), 0.08)
    });
    scattered(name, &mut random, shaper.finish(), 1_000, 5.0)
}

/// Two hundred scanned balls in a heap, each through many others.
fn boulders(name: &str) -> Scene {
    let mut random = RandomStream::new(22);
    scattered(name, &mut random, bumpy_ball(40), 200, 2.5)
}

/// A map as all programs can take it.
fn columns_of(place: &Transform) -> [[f32; 3]; 4] {
    let DAffine3 { matrix3: m, translation } = *place.affine();
    [m.x_axis, m.y_axis, m.z_axis, translation].map(|column| column.as_vec3().to_array())
}

/// Copies of a mesh in a cube, turned and stretched at random.
fn scattered(name: &str, random: &mut RandomStream, mesh: TriangleMesh, count: usize, half: f64) -> Scene {
    let placements = (0..count).map(|_| {
        let at = DVec3::from_array([(); 3].map(|()| between(random, -half, half)));
        let stretch = DVec3::from_array([(); 3].map(|()| between(random, 0.7, 1.2)));
        let place = Transform::translate(at)
            * Transform::rotate(direction(random), 360.0 * random.next_f64()).expect("an axis")
            * Transform::scale(stretch).expect("not flat");
        Placement { mesh: 0, world_from_object: columns_of(&place) }
    });
    let placements = placements.collect();
    let camera = Camera { eye: half * DVec3::new(1.7, 1.3, 2.6), target: DVec3::ZERO, field_of_view: 45.0 };
    let lamp = (half * DVec3::new(0.8, 2.5, 0.9), 0.5 * half);
    Scene { placed_meshes: vec![Arc::new(mesh)], placements, ..Scene::empty(name, camera, lamp) }
}

/// A trunk and two and a half thousand leaves.
fn tree(random: &mut RandomStream, height: f64) -> TriangleMesh {
    let mut shaper = Shaper::default();
    shaper.lathe(DVec3::ZERO, 10, 6, |s| (0.06 * height * (1.0 - 0.9 * s), 0.8 * height * s - 0.2));
    for _ in 0..2_400 {
        let crown = direction(random) * random.next_f64().cbrt() * DVec3::new(0.28, 0.35, 0.28) * height;
        let center = crown + DVec3::new(0.0, 0.65 * height, 0.0);
        let u = direction(random) * 0.018 * height;
        let v = u.cross(direction(random)).normalize() * 0.01 * height;
        shaper.quad([center - u, center - v, center + u, center + v]);
    }
    shaper.finish()
}

/// Spheres of several sizes in a cube, partly overlapping.
fn spheres(name: &str, count: usize) -> Scene {
    let mut random = RandomStream::new(12);
    let half = 0.6 * (count as f64).cbrt();
    let mut at = || between(&mut random, -half, half) as f32;
    let mut list: Vec<[f32; 4]> = (0..count).map(|_| [at(), at(), at(), 0.0]).collect();
    for sphere in &mut list {
        sphere[3] = between(&mut random, 0.1, 0.4) as f32;
    }
    let camera = Camera { eye: half * DVec3::new(1.6, 1.2, 2.2), target: DVec3::ZERO, field_of_view: 45.0 };
    let lamp = (half * DVec3::new(0.8, 2.5, 0.9), 0.5 * half);
    let cloud = SphereCloud { spheres: list, ..SphereCloud::default() };
    Scene { spheres: Arc::new(cloud), ..Scene::empty(name, camera, lamp) }
}

/// Hair on a ball of radius 1: each hair is one cubic curve that leaves the ball and falls.
fn hair(name: &str, count: usize) -> Scene {
    let mut random = RandomStream::new(21);
    let thickness = 0.4 / (count as f64).sqrt();
    let points = (0..count)
        .map(|_| {
            let out = direction(&mut random);
            let length = between(&mut random, 0.25, 0.4);
            let mut at = out;
            let mut way = out;
            // Thinner and thinner, evenly from end to end.
            [1.0, 0.7, 0.4, 0.1].map(|share| {
                let here = at;
                // It falls more and more, and curls a little.
                way = (way + 0.35 * direction(&mut random) - 0.45 * DVec3::Y).normalize();
                at += length / 3.0 * way;
                let [x, y, z] = here.as_vec3().to_array();
                [x, y, z, (share * thickness) as f32]
            })
        })
        .collect();
    let camera = Camera { eye: DVec3::new(1.2, 0.9, 3.2), target: DVec3::ZERO, field_of_view: 45.0 };
    let lamp = (DVec3::new(1.5, 4.0, 1.5), 1.0);
    Scene { curves: Arc::new(Hair { points }), ..Scene::empty(name, camera, lamp) }
}

/// 1,600 exact shapes of six kinds about a scanned ball, on a floor of triangles.
fn mixed(name: &str) -> Scene {
    let mut random = RandomStream::new(4);
    let (low, high) = (DVec3::new(0.0, -0.8, 0.0), DVec3::new(0.0, 0.8, 0.0));
    let mut shapes = Vec::new();
    for i in 0..1_600 {
        let kind: Shape = match i % 6 {
            0 => Sphere::new(DVec3::ZERO, between(&mut random, 0.4, 0.9)).expect("a radius").into(),
            1 => Cuboid::new(DVec3::splat(-0.6), DVec3::new(0.6, 0.5, 0.7)).expect("a size").into(),
            2 => Cylinder::new(low, high, 0.5, true).expect("a radius").into(),
            3 => Cone::new(low, high, 0.7, 0.0, true).expect("a radius").into(),
            4 => Torus::new(DVec3::ZERO, DVec3::Y, 0.7, 0.25).expect("two radii").into(),
            _ => {
                let (a, b) = (DVec3::new(-0.9, -0.5, 0.1), DVec3::new(0.9, -0.6, 0.0));
                Triangle::new(a, b, DVec3::new(0.1, 0.9, -0.2)).expect("three corners").into()
            }
        };
        let cell = |i: i32| 0.7 * (f64::from(i) - 19.5);
        let place = Transform::translate(DVec3::new(cell(i % 40), 0.3, cell(i / 40)))
            * Transform::rotate(direction(&mut random), 360.0 * random.next_f64()).expect("an axis")
            * Transform::scale(DVec3::splat(0.35)).expect("not flat");
        shapes.push(PlacedShape::new(kind, place));
    }
    let mut floor = Shaper::default();
    let corner = |x: f64, z: f64| DVec3::new(x, -0.2, z);
    floor.quad([corner(-20.0, -20.0), corner(-20.0, 20.0), corner(20.0, 20.0), corner(20.0, -20.0)]);
    let mut ball = bumpy_ball(40);
    for p in &mut ball.positions {
        *p = 2.0 * *p + lumbre_math::Vec3::new(0.0, 2.5, 0.0);
    }
    let camera =
        Camera { eye: DVec3::new(9.0, 7.0, 14.0), target: DVec3::new(0.0, 0.5, 0.0), field_of_view: 50.0 };
    let lamp = (DVec3::new(8.0, 16.0, 6.0), 2.0);
    Scene {
        meshes: vec![Arc::new(floor.finish()), Arc::new(ball)],
        shapes: Arc::new(shapes),
        ..Scene::empty(name, camera, lamp)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenes_are_as_large_as_their_names_say() {
        let count = |name: &str| {
            let recipe = RECIPES.iter().find(|recipe| recipe.name == name).expect("a recipe");
            recipe.make().primitive_count()
        };
        assert_eq!(count("scan-1k"), 12 * 9 * 9);
        assert_eq!(count("scan-100k"), 12 * 91 * 91);
        assert_eq!(count("spheres-20k"), 20_000);
        assert_eq!(count("mixed"), 1_600 + 2 + 12 * 40 * 40);
        assert!((40_000..80_000).contains(&count("indoor")), "{}", count("indoor"));
        assert!((190_000..210_000).contains(&count("stadium")), "{}", count("stadium"));
        assert_eq!(count("bars"), 6 * 2 * 120 * 12);
        assert_eq!(count("sponge"), 20 * 20 * 20 * 12);
        assert_eq!(count("needles"), 100_000);
        assert_eq!(count("forest"), 10_000 + 2 * 100 * 100 + 3 * (2 * 60 + 2 * 2_400));
    }

    #[test]
    fn a_scanned_ball_looks_outward_everywhere() {
        let mesh = bumpy_ball(20);
        let outward = mesh.indices.iter().filter(|triangle| {
            let [a, b, c] = triangle.map(|i| mesh.positions[i as usize]);
            (b - a).cross(c - a).dot(a + b + c) > 0.0
        });
        assert_eq!(outward.count(), mesh.indices.len());
    }
}
