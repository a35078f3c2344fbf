//! Bilinear patches that share their edges with others and with triangles: no ray passes between, and each crossing has
//! one owner.

use std::collections::HashMap;
use std::sync::Arc;

use lumbre_geometry::{BilinearPatch, PlacedShape, Ray};
use lumbre_math::{DVec3, Transform, Vec3};

use super::oracle::check;
use super::scenes::{Random, build};
use crate::{Accel, GeometryKind, TriangleMesh};

/// A closed body of quads: the surface of a cube of `n` × `n` × `n` cells about zero, its vertices moved by up to
/// `bend` cells.
struct Body {
    positions: Vec<Vec3>,
    /// Counter-clockwise from outside.
    quads: Vec<[u32; 4]>,
}

fn body(n: i32, bend: f64, random: &mut Random) -> Body {
    let (mut positions, mut quads) = (Vec::new(), Vec::new());
    let mut numbers: HashMap<[i32; 3], u32> = HashMap::new();
    for axis in 0..3 {
        for side in [0, n] {
            for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
                let around = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)];
                let mut quad = around.map(|(i, j)| {
                    let mut cell = [0; 3];
                    (cell[axis], cell[(axis + 1) % 3], cell[(axis + 2) % 3]) = (side, i, j);
                    *numbers.entry(cell).or_insert_with(|| {
                        let place = DVec3::from_array(cell.map(|x| f64::from(x) - 0.5 * f64::from(n)));
                        positions.push((place + bend * random.vector()).as_vec3());
                        positions.len() as u32 - 1
                    })
                });
                if side == 0 {
                    quad.reverse();
                }
                quads.push(quad);
            }
        }
    }
    Body { positions, quads }
}

/// The body as patches, each run along in one of the eight ways, under `map`; a share of the quads as two triangles
/// each, if `map` is a translation to `origin`.
fn geometries(
    body: &Body,
    map: Transform,
    origin: DVec3,
    triangles: f64,
    random: &mut Random,
) -> Vec<GeometryKind> {
    let mut indices = Vec::new();
    let mut kinds = Vec::new();
    for &[a, b, c, d] in &body.quads {
        if random.unit() < triangles {
            indices.extend([[a, b, c], [a, c, d]]);
            continue;
        }
        let mut around = [a, b, c, d];
        around.rotate_left(random.below(4));
        if random.below(2) == 0 {
            around.reverse();
        }
        let [p00, p10, p11, p01] = around.map(|i| body.positions[i as usize].as_dvec3());
        let patch = BilinearPatch::new(p00, p10, p01, p11).unwrap();
        kinds.push(GeometryKind::Shape(PlacedShape::new(patch.into(), map)));
    }
    if !indices.is_empty() {
        kinds.push(GeometryKind::Mesh(Arc::new(TriangleMesh {
            origin,
            positions: body.positions.clone(),
            indices,
        })));
    }
    kinds
}

/// Rays from within at vertices and edges: each leaves, an odd number of times.
fn bombard(name: &str, body: &Body, accel: &Accel, map: &Transform, rays: usize, random: &mut Random) {
    for i in 0..rays {
        let quad = body.quads[random.below(body.quads.len())].map(|i| body.positions[i as usize].as_dvec3());
        let along = [0.0, 0.5, 0.25, random.unit(), random.unit()][random.below(5)];
        let target = map.point(quad[0].lerp(quad[1], along));
        let within =
            if random.below(4) == 0 { 0.25 * random.vector().round() } else { 0.4 * random.vector() };
        let from = map.point(within);
        let ray = Ray::new(from, target - from);
        assert!(accel.any(&ray), "{name}: a leak along {ray:?}");
        assert!(accel.closest(&ray).is_some(), "{name}: a leak along {ray:?}");
        let count = accel.count(&ray);
        assert_eq!(count % 2, 1, "{name}: {count} crossings from within along {ray:?}");
        let line = ray.with_range(f64::NEG_INFINITY, f64::INFINITY);
        assert_eq!(accel.count(&line) % 2, 0, "{name}: {line:?}");
        if i % 16 == 0 {
            assert_eq!(check(accel, &ray), count);
        }
    }
}

#[test]
fn no_ray_leaks_between_bent_patches_and_triangles() {
    let rays = if std::env::var_os("LUMBRE_LONG_TESTS").is_some() { 1_000_000 } else { 2_000 };
    let mut random = Random(5);
    let far = DVec3::new(1.0e6, -1.0e6, 1.0e6);
    for (n, bend) in [(2, 0.0), (2, 0.2), (3, 0.25)] {
        let body = body(n, bend, &mut random);
        let affine = random.placement(DVec3::new(3.0, -1.0, 2.0), 0.7, 2.5);
        for (name, map, origin, triangles) in [
            ("patches", Transform::IDENTITY, DVec3::ZERO, 0.0),
            ("patches and triangles", Transform::IDENTITY, DVec3::ZERO, 0.5),
            ("far patches", Transform::translate(far), far, 0.0),
            ("far patches and triangles", Transform::translate(far), far, 0.5),
            ("patches under an affine map", affine, DVec3::ZERO, 0.0),
        ] {
            let accel = build(geometries(&body, map, origin, triangles, &mut random));
            bombard(name, &body, &accel, &map, rays, &mut random);
        }
        let inner = Arc::new(build(geometries(&body, Transform::IDENTITY, DVec3::ZERO, 0.5, &mut random)));
        let instance = inner.instance(affine);
        let accel = build(vec![GeometryKind::Instance(instance)]);
        bombard("in an instance", &body, &accel, &affine, rays, &mut random);
    }
}

#[test]
fn the_border_of_a_lone_patch_counts_once() {
    let [a, b, c, d] =
        [[0.0, 0.0, 2.0], [4.0, 0.0, 3.0], [0.0, 6.0, 5.0], [4.0, 6.0, -1.0]].map(DVec3::from_array);
    let patch = BilinearPatch::new(a, b, c, d).unwrap();
    let accel = build(vec![GeometryKind::Shape(PlacedShape::new(patch.into(), Transform::IDENTITY))]);
    let mut hits = 0;
    for i in -1..=9 {
        for j in -1..=13 {
            let (x, y) = (0.5 * f64::from(i), 0.5 * f64::from(j));
            let is_inside = (0.0..=4.0).contains(&x) && (0.0..=6.0).contains(&y);
            for z in [9.0, -9.0] {
                let ray = Ray::new(DVec3::new(x, y, z), DVec3::new(0.0, 0.0, -0.25 * z));
                assert_eq!(check(&accel, &ray), usize::from(is_inside), "{ray:?}");
                hits += usize::from(is_inside);
            }
        }
    }
    assert_eq!(hits, 2 * 9 * 13);
}
