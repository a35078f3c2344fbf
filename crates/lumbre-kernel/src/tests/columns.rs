//! Rays of pictures: against double precision, from the surfaces that they leave, and at edges and corners that must
//! not leak.

use std::sync::Arc;

use lumbre_geometry::Ray;
use lumbre_math::{DVec3, Transform, Vec3};

use super::scenes::{
    self, Random, build, bumpy, cube, icosphere, mixture, precise, repeats, soup, torus, with_every_preset,
};
use crate::batch::columns;
use crate::intersect::Isa;
use crate::{Accel, GeometryKind, Hit, HitColumns, RayColumns, TargetShape, TriangleMesh};

/// Rays, column by column.
#[derive(Default)]
struct Rays {
    origin: [Vec<f64>; 3],
    direction: [Vec<f32>; 3],
    t_max: Vec<f32>,
}

impl Rays {
    fn len(&self) -> usize {
        self.t_max.len()
    }

    fn push(&mut self, origin: DVec3, direction: DVec3, t_max: f32) {
        for axis in 0..3 {
            self.origin[axis].push(origin[axis]);
            self.direction[axis].push(direction[axis] as f32);
        }
        self.t_max.push(t_max);
    }

    /// `count` of them, from `first` on.
    fn columns(&self, first: usize, len: usize) -> RayColumns<'_> {
        RayColumns {
            origin: [0, 1, 2].map(|axis| &self.origin[axis][first..first + len]),
            direction: [0, 1, 2].map(|axis| &self.direction[axis][first..first + len]),
            t_max: Some(&self.t_max[first..first + len]),
            time: None,
        }
    }

    fn all(&self) -> RayColumns<'_> {
        self.columns(0, self.len())
    }

    fn ray(&self, i: usize) -> Ray {
        self.all().ray(i)
    }
}

/// A mesh of another size, somewhere else.
fn placed(mesh: &TriangleMesh, size: f64, origin: DVec3) -> TriangleMesh {
    let positions = mesh.positions.iter().map(|&p| p * size as f32).collect();
    TriangleMesh { origin, positions, indices: mesh.indices.clone() }
}

fn meshes(random: &mut Random) -> Vec<Vec<TriangleMesh>> {
    vec![
        vec![icosphere(3, DVec3::new(0.1, -0.2, 0.05), 0.8), cube()],
        vec![bumpy(2, DVec3::new(-0.1, 0.1, 0.0), 0.7), torus(40, 5, 1.3, 0.02)],
        vec![soup(random, 700, DVec3::ZERO, 0.8)],
        vec![cube()],
    ]
}

/// Where meshes stand, and how large they are.
const PLACES: [(f64, DVec3); 4] = [
    (1.0, DVec3::new(0.0, 0.0, 0.0)),
    (1.0, DVec3::new(1e6, -1e6, 0.7e6)),
    (1e-6, DVec3::new(0.5, 0.1, -3.0)),
    (1e6, DVec3::new(-2.0, 30.0, 5.0)),
];

fn kinds(meshes: &[TriangleMesh], (size, origin): (f64, DVec3)) -> Vec<GeometryKind> {
    meshes.iter().map(|mesh| GeometryKind::Mesh(Arc::new(placed(mesh, size, origin)))).collect()
}

fn tree(meshes: &[TriangleMesh], place: (f64, DVec3)) -> Accel {
    build(kinds(meshes, place))
}

fn instance(accel: &Arc<Accel>, map: Transform) -> GeometryKind {
    GeometryKind::Instance(accel.instance(map))
}

/// Meshes with shapes, clouds, custom geometry, and instances of meshes and mixtures, all of one size.
fn anything(random: &mut Random, (size, origin): (f64, DVec3)) -> Accel {
    let mut kinds = kinds(
        &[bumpy(2, DVec3::new(-0.5, 0.1, 0.0), 0.4), soup(random, 200, DVec3::ZERO, 0.8)],
        (size, origin),
    );
    for _ in 0..25 {
        kinds.push(GeometryKind::Shape(scenes::shape(random, origin, size)));
    }
    kinds.push(GeometryKind::Spheres(Arc::new(scenes::cloud(random, 20, origin, origin, size))));
    kinds.push(GeometryKind::Custom(Arc::new(scenes::balls(random, 6, origin, 0.7 * size, None))));
    kinds.push(GeometryKind::PreciseMesh(Arc::new(precise(&placed(
        &soup(random, 40, DVec3::ZERO, 0.8),
        size,
        origin,
    )))));
    let ball = Arc::new(tree(&[icosphere(2, DVec3::new(0.1, -0.2, 0.05), 0.9)], PLACES[1]));
    let near = DVec3::new(2.0, -1.0, 0.5);
    let mixed = Arc::new(mixture(random, near, 1.5, 1, false));
    for _ in 0..5 {
        let to = random.placement(origin, size, 0.2 * size);
        kinds.push(instance(&ball, to * Transform::translate(-PLACES[1].1)));
        let to = random.placement(origin, size, 0.1 * size);
        kinds.push(instance(&mixed, to * Transform::translate(-near)));
    }
    // Much smaller, and much larger, than they are at home.
    for place in [PLACES[2], PLACES[3]] {
        let own = Arc::new(tree(&[cube(), soup(random, 60, DVec3::ZERO, 2.0)], place));
        let to = Transform::translate(origin) * Transform::scale(DVec3::splat(0.2 * size / place.0)).unwrap();
        kinds.push(instance(&own, to * Transform::translate(-place.1)));
    }
    build(kinds)
}

/// A place on a triangle: a corner, on an edge, or within.
fn place(random: &mut Random, mesh: &TriangleMesh) -> DVec3 {
    let triangle = mesh.indices[random.below(mesh.indices.len())];
    let [a, b, c] = triangle.map(|i| mesh.positions[i as usize].as_dvec3());
    let (u, v) = (random.unit(), random.unit());
    mesh.origin
        + match random.below(4) {
            0 => a,
            1 => a.lerp(b, u),
            _ if u + v > 1.0 => a + (1.0 - u) * (b - a) + (1.0 - v) * (c - a),
            _ => a + u * (b - a) + v * (c - a),
        }
}

/// Rays at a tree: in fans from one place, from everywhere, along axes, some of them with an end.
fn rays_at(random: &mut Random, accel: &Accel, count: usize) -> Rays {
    let bounds = accel.bounds();
    let (center, size) = (0.5 * (bounds.min + bounds.max), 0.5 * (bounds.max - bounds.min).max_element());
    let mut rays = Rays::default();
    while rays.len() < count {
        let eye = center + size * random.between(0.0, 4.0) * random.vector();
        let aim = center + size * random.vector();
        for _ in 0..[1, 3, 48, 96][random.below(4)] {
            let origin = if random.below(3) == 0 { center + size * random.vector() } else { eye };
            let direction = match random.below(8) {
                0 => DVec3::AXES[random.below(3)] * [0.5, -2.0][random.below(2)],
                1..=5 => aim + 0.05 * size * random.vector() - origin,
                _ => size * random.vector(),
            };
            let t_max = if random.below(4) == 0 { random.unit() as f32 } else { f32::INFINITY };
            rays.push(origin, direction, t_max);
        }
    }
    rays
}

/// All that is known of a hit, to the bit.
fn bits(hits: &HitColumns, i: usize) -> Option<(Hit, [u32; 3], [u32; 2], bool)> {
    let hit = hits.to_hit(i)?;
    let numbers = [hits.t[i], hits.local[0][i], hits.local[1][i]].map(f32::to_bits);
    Some((hit, numbers, [hits.id[i], hits.primitive[i]], hits.is_plain(i)))
}

fn closest(accel: &Accel, rays: &Rays, exact: bool) -> HitColumns {
    let mut hits = HitColumns::default();
    accel.closest_columns(&rays.all(), exact, &mut hits);
    hits
}

/// Whether every instruction set and every cut of the list gives the same answers; how many hit.
fn check_cuts(accel: &Accel, rays: &Rays, exact: bool) -> usize {
    let expected = closest(accel, rays, exact);
    assert_eq!(expected.len(), rays.len());
    let (mut hits, mut occluded) = (HitColumns::default(), vec![true; 3]);
    for isa in Isa::all() {
        for size in [1, 5, 16, 333, rays.len()] {
            for first in (0..rays.len()).step_by(size) {
                let some = rays.columns(first, size.min(rays.len() - first));
                columns::closest(isa, &accel.tree, &some, exact, &mut hits);
                columns::any(isa, &accel.tree, &some, exact, &mut occluded);
                assert_eq!((hits.len(), occluded.len()), (some.len(), some.len()));
                for (i, &is_occluded) in occluded.iter().enumerate() {
                    let (found, expected) = (bits(&hits, i), bits(&expected, first + i));
                    assert_eq!(found, expected, "{isa:?} {size} {exact} {:?}", some.ray(i));
                    assert_eq!(is_occluded, found.is_some(), "{isa:?} {size} {exact} {:?}", some.ray(i));
                }
            }
        }
    }
    (0..rays.len()).filter(|&i| expected.to_hit(i).is_some()).count()
}

/// By how much a point of the tree may be from where it seems to be.
fn reach_of_rounding(accel: &Accel) -> f64 {
    let bounds = accel.bounds();
    let size = (bounds.max - bounds.min).max_element();
    let Some(rounding) = accel.picture_rounding() else { return 1e-9 * size };
    let far = (bounds.min - rounding.origin).abs().max((bounds.max - rounding.origin).abs());
    4.0 * (far * rounding.relative + rounding.absolute).max_element()
}

/// Whether the answer of a ray is that of double precision for a nearby ray; all that is compared is where the hit is.
fn is_near_double(random: &mut Random, accel: &Accel, ray: &Ray, found: Option<f64>) -> bool {
    let error = reach_of_rounding(accel);
    (0..400).any(|i| {
        let beside = Ray { origin: ray.origin + f64::from(i.min(1)) * error * random.vector(), ..*ray };
        let length = ray.direction.length();
        // Its end, too.
        let beside = match found {
            Some(t) if t >= ray.t_max - error / length => beside.with_range(0.0, ray.t_max + error / length),
            _ if i > 200 => beside.with_range(0.0, ray.t_max - error / length),
            _ => beside,
        };
        match (accel.closest(&beside), found) {
            (None, None) => true,
            (Some(hit), Some(t)) => (hit.root.t - t).abs() * length <= 4.0 * error + 1e-6 * t * length,
            _ => false,
        }
    })
}

/// Compares a tree's answers with those of double precision; how many hit.
fn check_beside_double(random: &mut Random, accel: &Accel, rays: &Rays) -> usize {
    let hits = closest(accel, rays, false);
    let (mut others, mut count) = (0, 0);
    for i in 0..rays.len() {
        let (ray, found) = (rays.ray(i), hits.to_hit(i));
        let expected = accel.closest(&ray);
        count += usize::from(found.is_some());
        let name = |hit: &Hit| (hit.id, hit.primitive, hit.instances.clone());
        others += usize::from(found.as_ref().map(name) != expected.as_ref().map(name));
        let t = found.as_ref().map(|hit| hit.root.t);
        assert!(is_near_double(random, accel, &ray, t), "{ray:?}: {found:?}, not {expected:?}");
    }
    assert!(others * 50 <= rays.len(), "{others} of {}", rays.len());
    count
}

/// Sends rays off all surfaces that rays hit; none may hit the triangle that it leaves. How many left.
fn check_leaving(random: &mut Random, accel: &Accel, rays: &Rays) -> usize {
    let hits = closest(accel, rays, false);
    let (mut leaving, mut from) = (Rays::default(), Vec::new());
    for i in 0..rays.len() {
        let Some(hit) = hits.to_hit(i) else { continue };
        let surface = accel.picture_surface(&rays.ray(i), &hit);
        if !matches!(accel.target(&rays.ray(i), &hit).shape, TargetShape::Triangle(_)) {
            continue;
        }
        for k in 0..6 {
            // Steep ones, and some that graze it.
            let across = surface.dpdu.normalize() * random.between(-1.0, 1.0) + 0.3 * random.vector();
            let direction = match k {
                0..=2 => random.vector(),
                3 => across - surface.normal * surface.normal.dot(across) * (1.0 - 1e-5),
                _ => across - surface.normal * surface.normal.dot(across) * random.between(0.9, 1.1),
            };
            let direction = direction.as_vec3().as_dvec3();
            leaving.push(surface.offset_origin(direction), direction, f32::INFINITY);
            from.push((hit.id, hit.primitive, hit.instances.clone()));
        }
    }
    let hits = closest(accel, &leaving, false);
    for (i, from) in from.iter().enumerate() {
        let Some(hit) = hits.to_hit(i) else { continue };
        assert_ne!(&(hit.id, hit.primitive, hit.instances.clone()), from, "{:?}: {hit:?}", leaving.ray(i));
    }
    from.len()
}

#[test]
fn columns_have_the_same_bits_for_any_cut_and_instructions() {
    let mut random = Random(71);
    let mut hits = 0;
    with_every_preset(|| {
        for meshes in meshes(&mut random) {
            for place in PLACES {
                let accel = tree(&meshes, place);
                assert!(accel.picture_rounding().is_some());
                let rays = rays_at(&mut random, &accel, repeats(1200));
                hits += check_cuts(&accel, &rays, false);
                hits += check_cuts(&accel, &rays, true);
            }
        }
        let mut accels = vec![mixture(&mut random, DVec3::new(3.0, -2.0, 1.0), 2.5, 2, true)];
        accels.extend(PLACES.map(|place| anything(&mut random, place)));
        for accel in accels {
            let rays = rays_at(&mut random, &accel, repeats(1200));
            hits += check_cuts(&accel, &rays, false);
            hits += check_cuts(&accel, &rays, true);
        }
    });
    assert!(hits > repeats(12_000), "{hits}");
}

#[test]
fn columns_answer_as_double_precision_but_for_rounding() {
    let mut random = Random(72);
    let mut hits = 0;
    for meshes in meshes(&mut random) {
        for place in PLACES {
            let accel = tree(&meshes, place);
            let rays = rays_at(&mut random, &accel, repeats(2000));
            hits += check_beside_double(&mut random, &accel, &rays);
        }
    }
    for place in PLACES {
        let accel = anything(&mut random, place);
        assert!(accel.picture_rounding().is_some());
        let rays = rays_at(&mut random, &accel, repeats(6000));
        hits += check_beside_double(&mut random, &accel, &rays);
    }
    assert!(hits > repeats(10_000), "{hits}");
}

#[test]
fn exact_columns_are_the_hits_of_double_precision() {
    let mut random = Random(73);
    let mut count = 0;
    for accel in [
        mixture(&mut random, DVec3::new(3.0, -2.0, 1.0), 2.5, 2, true),
        tree(&[cube(), soup(&mut random, 300, DVec3::ZERO, 2.0)], PLACES[1]),
    ] {
        let rays = rays_at(&mut random, &accel, 3000);
        let hits = closest(&accel, &rays, true);
        for i in 0..rays.len() {
            let expected = accel.closest(&rays.ray(i));
            assert_eq!(hits.to_hit(i), expected);
            let is_plain = expected.as_ref().is_some_and(|hit| {
                let is_mesh =
                    matches!(accel.tree.geometries[hit.geometry as usize].kind, GeometryKind::Mesh(_));
                is_mesh && hit.instances.is_empty()
            });
            assert_eq!(hits.is_plain(i), is_plain);
            count += usize::from(expected.is_some());
        }
    }
    assert!(count > 1500, "{count}");
}

#[test]
fn rays_do_not_hit_the_triangle_that_they_leave() {
    let mut random = Random(74);
    let mut leaving = 0;
    for meshes in meshes(&mut random) {
        for place in PLACES {
            let accel = tree(&meshes, place);
            let rays = rays_at(&mut random, &accel, repeats(4000));
            leaving += check_leaving(&mut random, &accel, &rays);
        }
    }
    for place in PLACES {
        let accel = anything(&mut random, place);
        let rays = rays_at(&mut random, &accel, repeats(8000));
        leaving += check_leaving(&mut random, &accel, &rays);
    }
    assert!(leaving > repeats(100_000), "{leaving}");
}

#[test]
fn rays_at_edges_and_corners_of_closed_meshes_hit() {
    let mut random = Random(75);
    // Each is seen whole from its centre.
    let center = DVec3::new(0.3, -0.4, 0.2);
    for mesh in [icosphere(3, center, 0.9), bumpy(2, center, 0.7)] {
        for where_it_stands in PLACES {
            let accel = tree(std::slice::from_ref(&mesh), where_it_stands);
            let GeometryKind::Mesh(own) = accel.tree.geometries[0].kind.clone() else {
                unreachable!("it is one")
            };
            let (size, origin) = where_it_stands;
            let mut rays = Rays::default();
            for _ in 0..repeats(40_000) {
                let from = origin + size * (center + 0.05 * random.vector());
                rays.push(from, place(&mut random, &own) - from, f32::INFINITY);
            }
            // At the corners, along the very lines.
            for p in &own.positions {
                let from: Vec3 = (size * center).as_vec3();
                rays.push(origin + from.as_dvec3(), p.as_dvec3() - from.as_dvec3(), f32::INFINITY);
            }
            assert_all_hit(&accel, &rays);
        }
    }
}

#[track_caller]
fn assert_all_hit(accel: &Accel, rays: &Rays) {
    let hits = closest(accel, rays, false);
    let mut occluded = Vec::new();
    accel.any_columns(&rays.all(), false, &mut occluded);
    let lost = (0..rays.len()).find(|&i| hits.id[i] == HitColumns::MISS || !occluded[i]);
    assert_eq!(lost.map(|i| rays.ray(i)), None);
}

#[test]
fn rays_at_edges_and_corners_hit_in_instances_and_beside_shapes() {
    let mut random = Random(76);
    let center = DVec3::new(0.3, -0.4, 0.2);
    with_every_preset(|| {
        for mesh in [icosphere(4, center, 0.9), bumpy(3, center, 0.7)] {
            for (size, origin) in PLACES {
                let inner = Arc::new(tree(std::slice::from_ref(&mesh), (size, origin)));
                let GeometryKind::Mesh(own) = inner.tree.geometries[0].kind.clone() else {
                    unreachable!("it is one")
                };
                for (distance, scale) in [(0.0, 1.0), (0.0, 1e-4 / size), (3e3, 0.2)] {
                    let map = random.placement(DVec3::new(-0.2, 0.7, 0.4), 1.0, scale)
                        * Transform::translate(-origin);
                    let mut kinds = vec![instance(&inner, map)];
                    // Farther away than the mesh, or within and all around.
                    let at = map.point(origin + size * center);
                    for _ in 0..3 {
                        kinds.push(GeometryKind::Shape(scenes::shape(
                            &mut random,
                            at + 1e3 * scale * size,
                            scale * size,
                        )));
                    }
                    let accel = build(kinds);
                    let accel = match random.below(2) {
                        0 => accel,
                        _ => build(vec![instance(&Arc::new(accel), Transform::IDENTITY)]),
                    };
                    assert!(accel.picture_rounding().is_some());
                    let mut rays = Rays::default();
                    for _ in 0..repeats(2000) {
                        // From within, or from afar towards what is behind a face.
                        let to = map.point(place(&mut random, &own));
                        let from = at + (at - to) * distance;
                        rays.push(from, to - from, f32::INFINITY);
                    }
                    assert_all_hit(&accel, &rays);
                }
            }
        }
    });
}

#[test]
fn rays_that_are_none_hit_nothing() {
    let accel = tree(&[cube()], PLACES[0]);
    let inside = DVec3::new(1.7, 0.3, 4.0);
    let mut rays = Rays::default();
    rays.push(inside, DVec3::ZERO, f32::INFINITY);
    rays.push(DVec3::new(f64::NAN, 0.0, 0.0), DVec3::X, f32::INFINITY);
    rays.push(inside, DVec3::new(f64::INFINITY, 0.0, 0.0), f32::INFINITY);
    rays.push(inside, DVec3::X, f32::NAN);
    rays.push(inside, DVec3::X, -1.0);
    rays.push(inside, DVec3::X, 1e-3);
    rays.push(inside, DVec3::X, f32::INFINITY);
    // From afar.
    rays.push(inside - DVec3::new(1e5, 0.0, 0.0), DVec3::X, f32::INFINITY);
    for exact in [false, true] {
        let hits = closest(&accel, &rays, exact);
        let are_hit: Vec<bool> = (0..rays.len()).map(|i| hits.to_hit(i).is_some()).collect();
        assert_eq!(are_hit, [false, false, false, false, false, false, true, true]);
    }
    assert_eq!(closest(&accel, &Rays::default(), false).len(), 0);
}
