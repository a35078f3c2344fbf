//! Single precision decides as double precision does: the filtered traversal against the exact one.

use std::sync::Arc;

use lumbre_geometry::{PlacedShape, Plane, Ray};
use lumbre_math::{DVec3, Transform};

use super::scenes::{self, Random};
use crate::batch;
use crate::batch::packet::{self, PACKET};
use crate::intersect::Isa;
use crate::trace::Outcome;
use crate::{Accel, BuildOptions, Faces, Geometry, GeometryKind, Hit, Preset, Query, TriangleMesh};

/// A grid of hills, with a sheet twice in the same place, needles and some triangles seen on edge.
fn mesh(random: &mut Random, origin: DVec3, size: f64) -> TriangleMesh {
    let mut mesh = TriangleMesh { origin, ..TriangleMesh::default() };
    let side = 24;
    for row in 0..=side {
        for column in 0..=side {
            let (x, z) = (f64::from(column) / f64::from(side) - 0.5, f64::from(row) / f64::from(side) - 0.5);
            let y = 0.1 * (9.0 * x).sin() * (7.0 * z).cos();
            mesh.positions.push((2.0 * size * DVec3::new(x, y, z)).as_vec3());
        }
    }
    for row in 0..side {
        for column in 0..side {
            let a = row * (side + 1) + column;
            let (b, c, d) = (a + 1, a + side + 1, a + side + 2);
            mesh.indices.extend([[a, c, b], [b, c, d]]);
            if row == 3 {
                mesh.indices.push([b, c, d]);
            }
        }
    }
    for _ in 0..300 {
        let first = mesh.positions.len() as u32;
        let (from, along) = (size * random.vector(), size * random.vector());
        let across = size * random.vector() * [1e-5, 0.1, 0.0][random.below(3)];
        mesh.positions.extend([from, from + along, from + 0.4 * along + across].map(|p| p.as_vec3()));
        mesh.indices.push([first, first + 1, first + 2]);
    }
    mesh
}

/// A place on a triangle, often on an edge or a corner.
fn place(random: &mut Random, mesh: &TriangleMesh, triangle: usize) -> DVec3 {
    let [a, b, c] = mesh.indices[triangle].map(|i| mesh.positions[i as usize].as_dvec3());
    match random.below(5) {
        0 => a,
        1 => a.lerp(b, [0.5, random.unit()][random.below(2)]),
        _ => {
            let (u, v) = (random.unit(), random.unit());
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            a + u * (b - a) + v * (c - a)
        }
    }
}

/// Ranges that often end where a ray meets something.
fn range(random: &mut Random) -> (f64, f64) {
    let range = [(0.0, f64::INFINITY), (0.0, 1.0), (1e-6, 1.0 - 1e-6), (0.5, 2.0), (1.0, 1.0), (-1.0, 1.0)];
    range[random.below(range.len())]
}

/// A ray at something of the mesh, and from a place on another triangle.
fn ray(random: &mut Random, mesh: &TriangleMesh, size: f64) -> Ray {
    let place = |random: &mut Random| {
        let triangle = random.below(mesh.indices.len());
        place(random, mesh, triangle)
    };
    let target = place(random);
    let start = if random.unit() < 0.4 { place(random) } else { 3.0 * size * random.vector() };
    let mut direction = target - start;
    if random.unit() < 0.1 {
        direction = [DVec3::X, -DVec3::Y, DVec3::Z][random.below(3)] * size;
    }
    let (t_min, t_max) = range(random);
    Ray::new(mesh.origin + start, direction).with_range(t_min, t_max)
}

/// Rays at neighbours, from one place or some that are near to each other, or from the very triangles.
fn alike(random: &mut Random, mesh: &TriangleMesh, size: f64) -> [Ray; PACKET] {
    let first = random.below(mesh.indices.len() - PACKET);
    let eye = 3.0 * size * random.vector();
    let (apart, kind) = ([0.0, 1e-6, 0.1][random.below(3)] * size, random.below(4));
    let spread = [1.0, 0.1][random.below(2)];
    std::array::from_fn(|i| {
        let near = place(random, mesh, first + i);
        let target = eye + spread * (near - eye);
        let from = eye + apart * random.vector();
        let (t_min, t_max) = if kind == 0 { (0.0, f64::INFINITY) } else { range(random) };
        let (from, target) = if kind == 1 { (target, from) } else { (from, target) };
        Ray::new(mesh.origin + from, target - from).with_range(t_min.max(0.0), t_max)
    })
}

/// Every search of a tree against the plain one, which answers with the same bits.
fn check(accel: &Accel, rays: &[Ray], least: u32) {
    for isa in Isa::all() {
        // For closest and any hits: rays that the exact traversal has to answer.
        let (mut unsettled, mut hits) = ([0; 2], 0);
        let mut expected = Vec::with_capacity(rays.len());
        let mut in_batch = vec![None; rays.len()];
        accel.closest_batch_at(isa, rays, &mut in_batch);
        let mut any_in_batch = vec![false; rays.len()];
        accel.any_batch_at(isa, rays, &mut any_in_batch);
        for ((ray, in_batch), any_in_batch) in rays.iter().zip(&in_batch).zip(&any_in_batch) {
            let plain = accel.closest_exact_at(isa, ray);
            assert_eq!(accel.closest_at(isa, ray), plain, "{isa:?} {ray:?}");
            assert_eq!(*in_batch, plain, "{isa:?} {ray:?}");
            assert_eq!(accel.any_at(isa, ray), plain.is_some(), "{isa:?} {ray:?}");
            assert_eq!(*any_in_batch, plain.is_some(), "{isa:?} {ray:?}");
            match accel.filtered_at(isa, ray) {
                Outcome::Certain(answer) => assert_eq!(answer, plain, "{isa:?} {ray:?}"),
                Outcome::Uncertain => unsettled[0] += 1,
            }
            match accel.filtered_any_at(isa, ray) {
                Outcome::Certain(answer) => assert_eq!(answer, plain.is_some(), "{isa:?} {ray:?}"),
                Outcome::Uncertain => unsettled[1] += 1,
            }
            hits += u32::from(plain.is_some());
            expected.push(plain);
        }
        assert!(hits > least && rays.len() - unsettled[0] > least as usize, "{hits} hits, {unsettled:?}");
        // No tree of the tests is as large as those in which rays prefetch, and coherent rays would be packets.
        for plan in batch::shims::INTERLEAVED {
            let interleaved = check_interleaved(accel, isa, rays, &expected, plan);
            // Of an interleaved ray, the stack may be too short.
            for (interleaved, alone) in interleaved.into_iter().zip(unsettled) {
                assert!(interleaved <= alone + rays.len() / 2, "{interleaved} and {alone}");
            }
        }
    }
}

/// Every interleaved ray has its answer; returns how many closest and any hits the exact traversal had to find.
pub(super) fn check_interleaved(
    accel: &Accel,
    isa: Isa,
    rays: &[Ray],
    expected: &[Option<Hit>],
    plan: batch::Plan,
) -> [usize; 2] {
    let other = expected.iter().flatten().next();
    // What is wrong for each, so that none is left out.
    let mut hits: Vec<_> =
        expected.iter().map(|hit| if hit.is_some() { None } else { other.cloned() }).collect();
    let closest = batch::shims::closest(isa, &accel.tree, rays, &mut hits, plan);
    let mut is_hit: Vec<_> = expected.iter().map(Option::is_none).collect();
    let any = batch::shims::any(isa, &accel.tree, rays, &mut is_hit, plan);
    for (((ray, hit), is_hit), expected) in rays.iter().zip(&hits).zip(is_hit).zip(expected) {
        assert_eq!(hit, expected, "{isa:?} {plan:?} {ray:?}");
        assert_eq!(is_hit, expected.is_some(), "{isa:?} {plan:?} {ray:?}");
    }
    [closest, any]
}

const SIZES_AND_OFFSETS: [(f64, f64); 5] = [(1.0, 0.0), (1e-6, 0.0), (3e7, 1.0), (0.02, 1e6), (400.0, 50.0)];

#[test]
fn single_precision_answers_with_the_bits_of_double_precision() {
    let mut random = Random(91);
    for (size, offset) in SIZES_AND_OFFSETS {
        let origin = size * offset * DVec3::new(1.0, -0.7, 0.4);
        let meshes = [mesh(&mut random, origin, size), mesh(&mut random, origin, 0.7 * size)];
        for preset in Preset::ALL {
            let kinds = meshes.iter().map(|mesh| GeometryKind::Mesh(mesh.clone().into()));
            let list = kinds.zip(5..).map(|(kind, id)| Geometry { id, kind }).collect();
            let accel = Accel::build(list, &BuildOptions { preset }).unwrap();
            let rays: Vec<_> = (0..6_000).map(|i| ray(&mut random, &meshes[i % 2], size)).collect();
            check(&accel, &rays, 1_500);
        }
    }
}

#[test]
fn rays_that_go_together_are_answered_as_each_alone() {
    let mut random = Random(94);
    for (size, offset) in SIZES_AND_OFFSETS {
        let origin = size * offset * DVec3::new(1.0, -0.7, 0.4);
        let meshes = [mesh(&mut random, origin, size), mesh(&mut random, origin, 0.7 * size)];
        for preset in Preset::ALL {
            let kinds = meshes.iter().map(|mesh| GeometryKind::Mesh(mesh.clone().into()));
            let list = kinds.zip(5..).map(|(kind, id)| Geometry { id, kind }).collect();
            let accel = Accel::build(list, &BuildOptions { preset }).unwrap();
            let packets: Vec<_> = (0..800).map(|i| alike(&mut random, &meshes[i % 2], size)).collect();
            let together =
                |packet: &&_| batch::shims::answered_by_packet(accel.isa, &accel.tree, packet) != 0;
            let count = packets.iter().filter(together).count();
            assert!(count > 60 || !accel.isa.has_vectors(), "{count}");
            check(&accel, packets.as_flattened(), 1_500);
            // In a long batch, batches that gain nothing are rarely tried.
            packets.iter().for_each(|packet| check_packet(&accel, packet));
        }
    }
}

/// Each level's batch of these rays against single rays.
pub(super) fn check_packet(accel: &Accel, rays: &[Ray; PACKET]) {
    let mut others = *rays;
    others.reverse();
    for isa in Isa::all() {
        let (mut hits, mut met) = ([const { None }; PACKET], [false; PACKET]);
        // Over what stands there already.
        accel.closest_batch_at(isa, &others, &mut hits);
        accel.closest_batch_at(isa, rays, &mut hits);
        accel.any_batch_at(isa, rays, &mut met);
        for ((ray, hit), met) in rays.iter().zip(&hits).zip(met) {
            assert_eq!(*hit, accel.closest_exact_at(isa, ray), "{isa:?} {ray:?}");
            assert_eq!(met, hit.is_some(), "{isa:?} {ray:?}");
        }
    }
}

#[test]
fn rays_that_are_not_sound_do_not_go_together() {
    let mut random = Random(96);
    let mesh = mesh(&mut random, DVec3::ZERO, 1.0);
    let accel = scenes::build(vec![GeometryKind::Mesh(mesh.into())]);
    let sound = Ray::new(DVec3::new(0.1, 3.0, 0.2), DVec3::new(0.01, -1.0, 0.02));
    let packet = [sound; PACKET];
    let (nan, infinity) = (f64::NAN, f64::INFINITY);
    let others = [
        Ray { origin: DVec3::new(0.1, nan, 0.2), ..sound },
        Ray { origin: DVec3::new(0.1, infinity, 0.2), ..sound },
        Ray { direction: DVec3::new(nan, -1.0, 0.02), ..sound },
        Ray { direction: DVec3::new(0.01, -infinity, 0.02), ..sound },
        Ray { direction: DVec3::new(0.0, -0.0, 0.0), ..sound },
        Ray { direction: DVec3::new(0.01, 1.0, 0.02), ..sound },
        Ray { t_min: nan, ..sound },
        Ray { t_min: -1.0, ..sound },
        Ray { t_max: nan, ..sound },
        Ray { t_min: 2.0, t_max: 1.0, ..sound },
        Ray { origin: DVec3::new(0.1, 3e9, 0.2), ..sound },
    ];
    for isa in Isa::all().into_iter().filter(|isa| isa.has_vectors()) {
        assert_eq!(batch::shims::answered_by_packet(isa, &accel.tree, &packet), packet::ALL);
        for (number, other) in others.iter().enumerate() {
            for place in 0..PACKET {
                let mut packet = packet;
                packet[place] = *other;
                let answered = batch::shims::answered_by_packet(isa, &accel.tree, &packet);
                assert_eq!(answered >> place & 1, 0, "{isa:?} {number} {place}");
                check_packet(&accel, &packet);
            }
        }
    }
}

#[test]
fn rays_of_several_octants_go_together_by_octants() {
    let mut random = Random(98);
    let mesh = mesh(&mut random, DVec3::ZERO, 1.0);
    let accel = scenes::build(vec![GeometryKind::Mesh(mesh.into())]);
    let mut seen = [0; 3];
    for i in 0..200 {
        // Half are left and half are right of an axis, or above and below; or around a diagonal, where another axis is
        // the last.
        let (forward, side) =
            [(DVec3::Y, DVec3::X), (DVec3::Z, DVec3::Y), (DVec3::X + DVec3::Y, DVec3::X)][i % 3];
        let eye = -3.0 * forward + 0.3 * random.vector();
        let rays: [Ray; PACKET] = std::array::from_fn(|lane| {
            let across = if lane < 8 { 0.02 } else { -0.02 } + 0.01 * random.unit();
            Ray::new(eye, forward + across * side + DVec3::splat(1e-3) * DVec3::new(1.0, 1.2, 1.4))
        });
        for isa in Isa::all().into_iter().filter(|isa| isa.has_vectors()) {
            let answered = batch::shims::answered_by_packet(isa, &accel.tree, &rays);
            seen[i % 3] += u32::from(answered == packet::ALL);
        }
        check_packet(&accel, &rays);
    }
    let least = if Isa::best().has_vectors() { 40 } else { 0 };
    assert!(seen.iter().all(|&seen| seen >= least), "{seen:?}");
}

#[test]
fn batches_distinguish_components_as_double_precision_does() {
    let mut random = Random(99);
    let mesh = mesh(&mut random, DVec3::ZERO, 1.0);
    let accel = scenes::build(vec![GeometryKind::Mesh(mesh.into())]);
    for i in 0..300 {
        let eye = DVec3::new(-2.0, -2.0, -0.5) + 0.4 * random.vector();
        let rays: [Ray; PACKET] = std::array::from_fn(|_| {
            let mut direction = DVec3::new(1.0, 1.0, 0.2 + 0.1 * random.unit());
            direction[random.below(2)] += [1e-12, -1e-12, 0.0][random.below(3)];
            let DVec3 { x, y, z } = direction;
            Ray::new(eye, [direction, DVec3::new(z, x, y), DVec3::new(y, z, x)][i % 3])
        });
        check_packet(&accel, &rays);
    }
}

/// Shapes and custom geometry, and perhaps a plane without end.
fn beside_meshes(random: &mut Random, origin: DVec3, size: f64, has_plane: bool) -> Vec<GeometryKind> {
    let mut kinds: Vec<_> =
        (0..60).map(|_| GeometryKind::Shape(scenes::shape(random, origin, size))).collect();
    // The same twice: the first in the list is hit.
    kinds.push(kinds[7].clone());
    kinds.push(GeometryKind::Custom(Arc::new(scenes::balls(random, 20, origin, size, None))));
    if has_plane {
        let plane = Plane::new(origin, DVec3::new(0.1, 1.0, 0.2)).unwrap();
        kinds.push(GeometryKind::Shape(PlacedShape::new(plane.into(), Transform::IDENTITY)));
    }
    kinds
}

#[test]
fn it_does_so_beside_shapes_and_custom_geometry() {
    let mut random = Random(93);
    for (size, offset) in SIZES_AND_OFFSETS {
        let origin = size * offset * DVec3::new(1.0, -0.7, 0.4);
        let mesh = mesh(&mut random, origin, size);
        for (has_mesh, has_plane) in [(true, false), (true, true), (false, false), (false, true)] {
            let mut kinds = beside_meshes(&mut random, origin, size, has_plane);
            if has_mesh {
                kinds.push(GeometryKind::Mesh(mesh.clone().into()));
            }
            let rays: Vec<_> = (0..3_000).map(|_| ray(&mut random, &mesh, size)).collect();
            check(&scenes::build(kinds), &rays, 500);
        }
    }
}

#[test]
fn of_sheets_that_lie_close_on_one_another_the_nearest_is_met() {
    let mut random = Random(98);
    for apart in [0.0, 1e-7, 1e-6, 1e-4] {
        let mut mesh = TriangleMesh::default();
        for _ in 0..200 {
            let first = mesh.positions.len() as u32;
            let corners =
                [DVec3::new(-1.0, -1.0, 1.0), DVec3::new(1.0, -1.0, 0.8), DVec3::new(0.0, 1.0, 1.2)];
            let sheet = corners.map(|corner| corner + apart * random.vector());
            mesh.positions.extend(sheet.map(|corner| corner.as_vec3()));
            mesh.indices
                .push([[first, first + 1, first + 2], [first + 1, first, first + 2]][random.below(2)]);
        }
        let list = vec![Geometry { id: 3, kind: GeometryKind::Mesh(mesh.clone().into()) }];
        let accel = Accel::build(list, &BuildOptions::default()).unwrap();
        let rays: Vec<_> = (0..800).map(|_| Ray::new(0.3 * random.vector(), DVec3::Z)).collect();
        check(&accel, &rays, 300);
        if apart == 0.0 {
            assert!(rays.iter().filter_map(|ray| accel.closest(ray)).all(|hit| hit.primitive == 0));
        }
    }
}

#[test]
fn single_precision_settles_nearly_all_rays_that_nobody_aims() {
    let mut random = Random(92);
    let mesh = mesh(&mut random, DVec3::ZERO, 1.0);
    let list = vec![Geometry { id: 1, kind: GeometryKind::Mesh(mesh.into()) }];
    let accel = Accel::build(list, &BuildOptions::default()).unwrap();
    let mut unsettled = 0;
    for _ in 0..20_000 {
        let ray = Ray::new(2.0 * random.vector(), random.vector());
        let outcome = accel.filtered_at(accel.isa, &ray);
        unsettled += u32::from(outcome == Outcome::Uncertain);
    }
    assert!(unsettled < 20, "{unsettled}");
}

fn bits(hit: &Option<Hit>) -> Option<[u64; 3]> {
    hit.as_ref().map(|hit| [hit.root.t, hit.root.local.x, hit.root.local.y].map(f64::to_bits))
}

/// Both searches with options against the plain ones, which answer with the same bits; the nearest hit, and whether the
/// first search was settled.
fn check_with(isa: Isa, accel: &Accel, ray: &Ray, options: &Query) -> (Option<Hit>, bool) {
    let plain = accel.closest_with_exact_at(isa, ray, options);
    let found = accel.closest_with_at(isa, ray, options);
    assert_eq!(found, plain, "{isa:?} {ray:?} {options:?}");
    assert_eq!(bits(&found), bits(&plain), "{isa:?} {ray:?} {options:?}");
    assert_eq!(accel.any_with_exact_at(isa, ray, options), plain.is_some());
    assert_eq!(accel.any_with_at(isa, ray, options), plain.is_some(), "{isa:?} {ray:?} {options:?}");
    let outcome = accel.filtered_closest_at(isa, ray, options);
    (plain, outcome != Outcome::Uncertain)
}

/// Options of every sort along every ray, in a tree whose geometries get masks.
fn check_options(accel: Accel, random: &mut Random, rays: &[Ray], least: u32) {
    let masks = accel.tree.geometries.iter().map(|_| random.bits() as u32 & 0b111).collect();
    let accel = accel.with_masks(masks);
    for isa in Isa::all() {
        let (mut certain, mut hits, mut others) = (0, 0, 0);
        for ray in rays {
            let nearest = accel.closest_exact_at(isa, ray);
            let options = Query {
                mask: [u32::MAX, 0b001, 0b110][random.below(3)],
                exclude: if random.unit() < 0.5 { nearest.as_ref() } else { None },
                faces: [Faces::Both, Faces::Front, Faces::Back][random.below(3)],
                filter: None,
            };
            let (hit, is_certain) = check_with(isa, &accel, ray, &options);
            certain += u32::from(is_certain);
            hits += u32::from(hit.is_some());
            others += u32::from(hit.is_some() && hit != nearest);
        }
        assert!(certain > least && hits > least && others > least / 3, "{certain} {hits} {others}");
    }
}

#[test]
fn options_leave_the_same_bits_in_single_precision() {
    let mut random = Random(94);
    for (size, offset) in SIZES_AND_OFFSETS {
        let origin = size * offset * DVec3::new(1.0, -0.7, 0.4);
        let mut meshes = vec![mesh(&mut random, origin, size), mesh(&mut random, origin, 0.7 * size)];
        // The same places twice, and the other way round: at every height two names and two faces.
        meshes.push(meshes[0].clone());
        meshes.push(meshes[1].clone());
        meshes[3].indices.iter_mut().for_each(|[a, _, c]| std::mem::swap(a, c));
        scenes::with_every_preset(|| {
            let accel =
                scenes::build(meshes.iter().map(|mesh| GeometryKind::Mesh(mesh.clone().into())).collect());
            let rays: Vec<_> = (0..4_000).map(|i| ray(&mut random, &meshes[i % 2], size)).collect();
            check_options(accel, &mut random, &rays, 600);
        });
    }
}

#[test]
fn they_do_so_beside_shapes_and_custom_geometry() {
    let mut random = Random(95);
    for (size, offset) in SIZES_AND_OFFSETS {
        let origin = size * offset * DVec3::new(1.0, -0.7, 0.4);
        let mesh = mesh(&mut random, origin, size);
        for (has_mesh, has_plane) in [(true, false), (true, true), (false, false)] {
            let mut kinds = beside_meshes(&mut random, origin, size, has_plane);
            if has_mesh {
                kinds.push(GeometryKind::Mesh(mesh.clone().into()));
            }
            let rays: Vec<_> = (0..3_000).map(|_| ray(&mut random, &mesh, size)).collect();
            check_options(scenes::build(kinds), &mut random, &rays, 300);
        }
    }
}

#[test]
fn a_ray_that_excludes_its_start_has_the_same_bits() {
    let mut random = Random(96);
    let center = DVec3::new(1.5, -2.25, 4.0);
    scenes::with_every_preset(|| {
        // A hilly ball around a smooth one, and loose triangles between.
        let mut meshes = [
            scenes::bumpy(4, DVec3::ZERO, 4.0),
            scenes::icosphere(3, DVec3::ZERO, 1.2),
            scenes::soup(&mut random, 200, DVec3::ZERO, 3.0),
        ];
        meshes.iter_mut().for_each(|mesh| mesh.origin = center);
        let accel = scenes::build(meshes.map(|mesh| GeometryKind::Mesh(mesh.into())).to_vec());
        let (mut bounces, mut certain, mut blocked) = (0, 0, 0);
        for _ in 0..250 {
            let mut ray = Ray::new(center + 2.2 * random.vector(), random.vector());
            let mut last = None;
            for bounce in 0..12 {
                let faces = [Faces::Both, Faces::Front, Faces::Back][bounce % 3];
                let options = Query { exclude: last.as_ref(), ..Query::new() };
                for isa in Isa::all() {
                    check_with(isa, &accel, &ray, &Query { faces, ..options });
                    // Back to where it came from, and no further.
                    check_with(isa, &accel, &ray.with_range(0.0, 1.0), &options);
                }
                let (hit, is_certain) = check_with(Isa::best(), &accel, &ray, &options);
                certain += u32::from(is_certain);
                blocked += u32::from(accel.any_with(&ray.with_range(0.0, 1.0), &options));
                let Some(hit) = hit else { break };
                bounces += 1;
                let surface = accel.surface(&ray, &hit);
                let side = -surface.normal.dot(ray.direction).signum();
                let direction = side * surface.normal + 0.99 * random.vector().normalize();
                ray = Ray::new(surface.point, direction);
                last = Some(hit);
            }
        }
        assert!(bounces > 2_000 && certain > 1_900, "{bounces} {certain}");
        assert!(blocked > 300, "{blocked}");
    });
}

#[test]
fn culling_at_edges_and_corners_keeps_its_bits() {
    let mut random = Random(97);
    let center = DVec3::new(1.5, -2.25, 4.0);
    let ball = scenes::icosphere(2, center, 1.2);
    let open = TriangleMesh {
        indices: scenes::bumpy(2, center, 2.0).indices[..200].to_vec(),
        ..scenes::bumpy(2, center, 2.0)
    };
    for meshes in [vec![scenes::cube()], vec![ball.clone()], vec![ball, open]] {
        let accel =
            scenes::build(meshes.iter().map(|mesh| GeometryKind::Mesh(mesh.clone().into())).collect());
        let (mut fronts, mut backs, mut unsettled) = (0, 0, 0);
        for mesh in &meshes {
            for triangle in &mesh.indices {
                let [a, b, _] = triangle.map(|index| scenes::vertex(mesh, index));
                let axis = [DVec3::X, -DVec3::Y, DVec3::Z][random.below(3)];
                for target in [a, 0.5 * (a + b)] {
                    for direction in [axis, -axis, random.vector()] {
                        let ray = Ray::new(target - 4.0 * direction, direction);
                        let exclude = accel.closest(&ray);
                        for isa in Isa::all() {
                            for (faces, count) in [(Faces::Front, &mut fronts), (Faces::Back, &mut backs)] {
                                let options = Query { faces, ..Query::new() };
                                let (hit, is_certain) = check_with(isa, &accel, &ray, &options);
                                *count += u32::from(hit.is_some());
                                unsettled += u32::from(!is_certain);
                                let options = Query { exclude: exclude.as_ref(), ..options };
                                check_with(isa, &accel, &ray, &options);
                            }
                        }
                    }
                }
            }
        }
        assert!(fronts > 50 && backs > 50 && unsettled > 50, "{fronts} {backs} {unsettled}");
    }
}
