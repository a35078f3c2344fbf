//! Triangles in parts: nothing of one is lost, and nothing counts twice.

use std::collections::HashSet;
use std::ops::ControlFlow;
use std::sync::Arc;

use lumbre_geometry::Ray;
use lumbre_math::{DVec3, Transform};

use super::oracle::check;
use super::scenes::{Random, build, bumpy, cube, icosphere, mesh, ray, soup, vertex, with_parts_everywhere};
use crate::carve::{Carver, Cell, find_incomplete, part_of, plane_at, reach};
use crate::node::Units;
use crate::{Accel, BuildOptions, Geometry, GeometryKind, Instance, LoadError, Preset, TriangleMesh, brute};

const CENTER: DVec3 = DVec3::new(1.5, -2.25, 4.0);

/// Long thin triangles every which way.
fn needles(random: &mut Random, count: usize) -> TriangleMesh {
    let mut positions = Vec::new();
    for _ in 0..count {
        let start = CENTER + 2.0 * random.vector();
        positions.extend([start, start + 0.8 * random.vector(), start + 0.002 * random.vector()]);
    }
    let indices = (0..count as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    mesh(positions, indices)
}

fn best(mesh: &TriangleMesh) -> Accel {
    let kind = GeometryKind::Mesh(Arc::new(mesh.clone()));
    Accel::build(vec![Geometry { id: 3, kind }], &BuildOptions { preset: Preset::Best }).unwrap()
}

/// Rays at random, and at corners and edges.
fn rays_at(mesh: &TriangleMesh, random: &mut Random, count: usize) -> Vec<Ray> {
    let aimed = |i: usize, random: &mut Random| {
        let triangle = mesh.indices[random.below(mesh.indices.len())];
        let [a, b, c] = triangle.map(|index| vertex(mesh, index));
        let target = match i % 4 {
            0 => a,
            1 => a.lerp(b, random.unit()),
            _ => a.lerp(b, random.unit()).lerp(c, random.unit()),
        };
        let from = target + 3.0 * random.vector();
        Ray::new(from, target - from)
    };
    (0..count).map(|i| if i % 2 == 0 { ray(random, CENTER, 3.0) } else { aimed(i / 2, random) }).collect()
}

#[test]
fn every_point_of_a_triangle_is_in_the_box_of_one_of_its_parts() {
    let mut random = Random(71);
    let (mut tried, mut shrunk) = (0, 0);
    for round in 0..3000 {
        let size = 10f64.powf(random.between(-12.0, 12.0));
        let origin = random.vector() * size * [0.0, 1.0, 1e3][random.below(3)];
        let mut corners = [random.vector(), random.vector(), random.vector()];
        match round % 5 {
            // A needle, one in a plane of two axes, one along an axis, one that is almost in a plane.
            0 => corners[2] = corners[0] + 1e-5 * random.vector(),
            1 => corners.iter_mut().for_each(|corner| corner[round % 3] = 0.25),
            2 => corners[1] = corners[0] + DVec3::X * random.unit(),
            3 => corners.iter_mut().for_each(|corner| corner[round % 3] *= 1e-7),
            _ => {}
        }
        let positions = corners.map(|corner| (corner * size).as_vec3()).to_vec();
        let mesh = TriangleMesh { origin, positions, indices: vec![[0, 1, 2]] };
        let units = Units::new(origin + size * 0.3 * random.vector(), 0.5 / size, 1.0, 1.0);
        let corners = Carver::new(&mesh, &units).corners(0);
        // Cut again and again.
        let mut cells = vec![Cell::WHOLE];
        for _ in 0..random.below(40) {
            let (axis, cell) = (random.below(3), cells.swap_remove(random.below(cells.len())));
            let (low, high) = (cell.low[axis], cell.high[axis]);
            let at = low + 1 + (random.unit() * f64::from(high - low)) as u16;
            if low < at && at < high { cells.extend(cell.cut(axis, at)) } else { cells.push(cell) }
        }
        let parts: Vec<_> = cells.iter().filter_map(|cell| part_of(&corners, cell)).collect();
        let whole = part_of(&corners, &Cell::WHOLE).unwrap();
        shrunk += parts.iter().filter(|part| part.half_area() < 0.5 * whole.half_area()).count();
        for _ in 0..60 {
            let mut weights = [random.unit(), random.unit(), random.unit()];
            if random.unit() < 0.5 {
                weights[random.below(3)] = 0.0;
            }
            if random.unit() < 0.3 {
                weights[random.below(3)] = 0.0;
            }
            let sum: f64 = weights.iter().sum();
            if sum == 0.0 {
                continue;
            }
            let on = |axis: usize| (0..3).map(|i| corners[i][axis] * (weights[i] / sum)).sum::<f64>();
            let mut point = [0, 1, 2].map(on);
            // On a plane of some cell, where the triangle has that.
            if random.unit() < 0.4 {
                let (cell, axis) = (cells[random.below(cells.len())], random.below(3));
                let [low, high] = reach(&corners, axis);
                let plane = plane_at(low, high, cell.high[axis]);
                let (a, b) = (corners[0], corners[1 + random.below(2)]);
                let along = (plane - a[axis]) / (b[axis] - a[axis]);
                if (0.0..=1.0).contains(&along) {
                    point = [0, 1, 2].map(|i| a[i] + along * (b[i] - a[i]));
                }
            }
            // What the arithmetic of this test may be wrong by.
            let slack = 1e-14;
            let is_in = parts.iter().any(|part| {
                (0..3).all(|axis| {
                    f64::from(part.low_plane(axis)) - slack <= point[axis]
                        && point[axis] <= f64::from(part.high_plane(axis)) + slack
                })
            });
            assert!(is_in, "round {round}: {point:?} of {corners:?} in {cells:?}");
            tried += 1;
        }
    }
    assert!(tried > 150_000 && shrunk > 10_000, "{tried} {shrunk}");
}

#[test]
fn cells_that_do_not_tile_are_found_out() {
    let mut random = Random(72);
    let is_complete = |cells: &[Cell]| find_incomplete(cells.iter().map(|cell| ([2, 7], *cell))).is_none();
    for _ in 0..300 {
        let mut cells = vec![Cell::WHOLE];
        for _ in 0..1 + random.below(50) {
            let (axis, cell) = (random.below(3), cells.swap_remove(random.below(cells.len())));
            let at = cell.low[axis] + ((cell.high[axis] - cell.low[axis]) / 3).max(1);
            if at < cell.high[axis] { cells.extend(cell.cut(axis, at)) } else { cells.push(cell) }
        }
        assert!(is_complete(&cells), "{cells:?}");
        let place = random.below(cells.len());
        let mut wrong = cells.clone();
        let cell = &mut wrong[place];
        match random.below(5) {
            0 => cell.low[random.below(3)] += 1,
            1 => cell.high[random.below(3)] -= 1,
            2 => *cell = cells[(place + 1) % cells.len()],
            3 => wrong.push(cells[place]),
            _ => {
                wrong.swap_remove(place);
                if wrong.is_empty() {
                    continue;
                }
            }
        }
        assert!(wrong == cells || !is_complete(&wrong), "{cells:?} {wrong:?}");
    }
}

#[test]
fn needles_are_split_and_what_would_not_gain_is_not() {
    let mut random = Random(73);
    let needles = needles(&mut random, 100_000);
    let accel = best(&needles);
    assert!(accel.tree.has_parts());
    assert_eq!(accel.primitive_count(), 100_000);
    let references: usize = accel.tree.names.iter().map(|names| names.primitives().count()).sum();
    assert!((110_000..=130_000).contains(&references), "{references}");
    for mesh in [cube(), icosphere(4, CENTER, 2.0), bumpy(4, CENTER, 2.5)] {
        assert!(!best(&mesh).tree.has_parts());
    }
}

#[test]
fn parts_are_found_as_by_a_loop() {
    let mut random = Random(74);
    let needles = needles(&mut random, 400);
    let rays = rays_at(&needles, &mut random, 3000);
    let accel = with_parts_everywhere(|| build(vec![GeometryKind::Mesh(Arc::new(needles))]));
    assert!(accel.tree.has_parts());
    let hits: usize = rays.iter().map(|ray| check(&accel, ray)).sum();
    assert!(hits > 1000, "{hits}");
}

/// A tree whose triangles are in parts, in an instance and beside one.
fn nested(random: &mut Random) -> Accel {
    let soup = GeometryKind::Mesh(Arc::new(soup(random, 150, CENTER, 3.0)));
    let inner = Arc::new(build(vec![GeometryKind::Mesh(Arc::new(icosphere(2, CENTER, 2.5))), soup.clone()]));
    assert!(inner.tree.has_parts());
    let map = random.placement(CENTER, 0.5, 1.0) * Transform::translate(-CENTER);
    let instance = |accel: &Arc<Accel>, map: Transform| {
        GeometryKind::Instance(Instance { accel: Arc::clone(accel), world_from_object: map.into() })
    };
    build(vec![soup, instance(&inner, map), instance(&inner, Transform::IDENTITY)])
}

#[test]
fn a_filter_is_asked_once_about_each_crossing() {
    let mut random = Random(75);
    let accel = with_parts_everywhere(|| nested(&mut random));
    let mut asked = 0;
    for _ in 0..3000 {
        let ray = ray(&mut random, CENTER, 3.0);
        let all = brute::every(&accel, &ray);
        let mut names = HashSet::new();
        let found = accel.closest_filtered(&ray, |hit| {
            assert!(names.insert((hit.route.clone(), hit.geometry, hit.primitive)), "{hit:?} twice");
            false
        });
        assert_eq!((found, names.len()), (None, all.len()));
        names.clear();
        accel.any_filtered(&ray, |hit| {
            assert!(names.insert((hit.route.clone(), hit.geometry, hit.primitive)), "{hit:?} twice");
            false
        });
        assert_eq!(names.len(), all.len());
        asked += names.len();
        // Three at a time, so that parts come in batches of their own.
        let mut first = Vec::new();
        accel.all(&ray, |hit| {
            first.push(hit.clone());
            if first.len() == 3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        assert_eq!(first, all[..all.len().min(3)]);
    }
    assert!(asked > 3000, "{asked}");
}

#[test]
fn points_do_not_see_parts() {
    let mut random = Random(76);
    let rock = GeometryKind::Mesh(Arc::new(bumpy(3, CENTER, 2.5)));
    let whole = build(vec![rock.clone()]);
    let parted = with_parts_everywhere(|| build(vec![rock]));
    assert!(parted.tree.cells.len() > 100);
    let mut inside = 0;
    for _ in 0..2000 {
        let p = CENTER + 3.0 * random.vector();
        assert_eq!(parted.is_inside(p), whole.is_inside(p));
        assert_eq!(parted.closest_point(p, 9.0).unwrap(), whole.closest_point(p, 9.0).unwrap());
        let exact = whole.winding_number_exact(p).unwrap();
        let sums = [parted.winding_number_exact(p).unwrap(), parted.winding_number(p).unwrap()];
        assert!((sums[0] - exact).abs() < 1e-9 && (sums[1] - exact).abs() < 4e-3, "{sums:?} {exact}");
        inside += usize::from(whole.is_inside(p));
    }
    assert!((200..1800).contains(&inside), "{inside}");
}

#[test]
fn parts_are_saved_mapped_and_refitted() {
    let mut random = Random(77);
    let needles = needles(&mut random, 3000);
    let rays = rays_at(&needles, &mut random, 300);
    let mut accel = with_parts_everywhere(|| nested_needles(&needles));
    let before = format!("{:?}", accel.tree);
    let (bytes, geometries) = (accel.to_bytes(), accel.geometries.clone());
    let loaded = Accel::from_bytes(&bytes, geometries.clone()).unwrap();
    assert!(format!("{:?}", loaded.tree) == before);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tree");
    accel.save(&path).unwrap();
    let mapped = Accel::map(&path, geometries.clone()).unwrap();
    assert!(format!("{:?}", mapped.tree) == before);
    rays.iter().for_each(|ray| assert_eq!(mapped.closest(ray), accel.closest(ray)));
    // Where nothing moved, parts are what they were.
    assert_eq!(accel.refit(geometries.clone()).unwrap(), 1.0);
    assert!(format!("{:?}", accel.tree) == before);
    // Bent and turned, they still hold all of their triangles.
    let turn = Transform::rotate(DVec3::new(0.3, 1.0, -0.4), 50.0).unwrap();
    let bend = |p: &lumbre_math::Vec3| {
        let p = turn.vector(p.as_dvec3());
        (p + 0.3 * DVec3::new(p.y.sin(), p.z.sin(), p.x.sin())).as_vec3()
    };
    let positions = needles.positions.iter().map(bend).collect();
    let moved = TriangleMesh { positions, indices: needles.indices.clone(), origin: needles.origin };
    let growth = accel.refit(vec![Geometry { id: 9, kind: GeometryKind::Mesh(Arc::new(moved.clone())) }]);
    assert!(growth.unwrap() != 1.0);
    let hits: usize = rays_at(&moved, &mut random, 600).iter().map(|ray| check(&accel, ray)).sum();
    assert!(hits > 200, "{hits}");
    // A triangle may lose its area, and have it back.
    let mut flat = moved.clone();
    for triangle in flat.indices.iter_mut().step_by(3) {
        triangle[2] = triangle[0];
    }
    for mesh in [&flat, &moved] {
        accel.refit(vec![Geometry { id: 9, kind: GeometryKind::Mesh(Arc::new(mesh.clone())) }]).unwrap();
        rays_at(mesh, &mut random, 200).iter().for_each(|ray| {
            check(&accel, ray);
        });
    }
}

fn nested_needles(needles: &TriangleMesh) -> Accel {
    let accel = build(vec![GeometryKind::Mesh(Arc::new(needles.clone()))]);
    assert!(accel.tree.cells.len() > 500);
    accel
}

#[test]
fn bytes_with_a_part_too_few_are_refused() {
    let mut random = Random(78);
    let accel = with_parts_everywhere(|| nested_needles(&needles(&mut random, 2000)));
    let bytes = accel.to_bytes();
    let start = bytes.len() - 8 - 16 * accel.tree.cells.len();
    let (mut refused, mut taken) = (0, 0);
    for _ in 0..600 {
        let mut wrong = bytes.clone();
        let place = start + 4 * random.below(4 * accel.tree.cells.len());
        wrong[place + random.below(4)] ^= 1 << random.below(8);
        let end = wrong.len() - 8;
        let sum = wrong[..end].iter().fold(0xcbf2_9ce4_8422_2325_u64, |hash, &byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
        });
        wrong[end..].copy_from_slice(&sum.to_le_bytes());
        match Accel::from_bytes(&wrong, accel.geometries.clone()) {
            Err(LoadError::Inconsistent { .. }) => refused += 1,
            Err(other) => panic!("{other}"),
            // The other names of a lane may be as good.
            Ok(loaded) => {
                taken += 1;
                (0..3).for_each(|_| {
                    check(&loaded, &ray(&mut random, CENTER, 3.0));
                });
            }
        }
    }
    assert!(refused > 580, "{refused} refused, {taken} taken");
}
