//! Triangles without area that stitch a mesh: never hit, and no ray passes where they are.

use std::sync::Arc;

use lumbre_geometry::Ray;
use lumbre_math::{DVec3, Vec3};

use super::oracle::check;
use super::scenes::{Random, build, icosphere, vertex};
use crate::{GeometryKind, PreciseMesh, Ray32, TriangleMesh};

/// A closed mesh some of whose edges have a vertex on them for one of their sides alone: the triangle on the other side stays whole,
/// and one without area stitches it to the two halves. With `twice`, the seams are cut once more. The vertices lie on a grid, so that
/// new ones are exactly on their edges.
fn stitched(grid: f64, twice: bool, random: &mut Random) -> (TriangleMesh, Vec<[DVec3; 2]>) {
    let mut mesh = icosphere(1, DVec3::ZERO, 2.5);
    for p in &mut mesh.positions {
        *p = (*p / grid as f32).round() * grid as f32;
    }
    let mut seams = Vec::new();
    for triangle in 0..mesh.indices.len() {
        if random.below(3) != 0 {
            continue;
        }
        let [a, b, c] = mesh.indices[triangle];
        let [p, q] = [a, b].map(|i| mesh.positions[i as usize]);
        let halfway = |p: Vec3, q: Vec3| (p + q) * 0.5;
        let middle = mesh.positions.len() as u32;
        mesh.positions.push(halfway(p, q));
        mesh.indices[triangle] = [a, middle, c];
        mesh.indices.extend([[middle, b, c], [a, b, middle]]);
        if twice {
            let last = mesh.indices.len() - 2;
            let quarter = mesh.positions.len() as u32;
            mesh.positions.push(halfway(mesh.positions[middle as usize], q));
            mesh.indices[last] = [middle, quarter, c];
            mesh.indices.extend([[quarter, b, c], [middle, b, quarter]]);
        }
        seams.push([p, q].map(|p| mesh.origin + p.as_dvec3()));
    }
    (mesh, seams)
}

#[test]
fn no_ray_leaks_at_a_seam_and_none_hits_what_has_no_area() {
    let rays = if std::env::var_os("LUMBRE_LONG_TESTS").is_some() { 1_000_000 } else { 3_000 };
    let mut random = Random(19);
    let far = DVec3::new(1.0e6, -1.0e6, 1.0e6);
    for (origin, is_precise, twice) in [
        (DVec3::ZERO, false, false),
        (DVec3::ZERO, false, true),
        (far, false, true),
        (DVec3::ZERO, true, true),
        (far, true, false),
    ] {
        let (mut mesh, mut seams) = stitched(1.0 / 64.0, twice, &mut random);
        mesh.origin = origin;
        seams.iter_mut().flatten().for_each(|p| *p += origin);
        assert!(seams.len() > 10);
        let positions = (0..mesh.positions.len() as u32).map(|i| vertex(&mesh, i)).collect::<Vec<_>>();
        let indices = mesh.indices.clone();
        let kind = if is_precise {
            GeometryKind::PreciseMesh(Arc::new(PreciseMesh {
                positions: positions.clone(),
                indices: indices.clone(),
            }))
        } else {
            GeometryKind::Mesh(Arc::new(mesh))
        };
        let accel = build(vec![kind]);
        let has_area = |primitive: u32| {
            let [a, b, c] = indices[primitive as usize].map(|i| positions[i as usize]);
            (b - a).cross(c - a) != DVec3::ZERO
        };
        let mut ones = 0;
        for i in 0..rays {
            let [p, q] = seams[random.below(seams.len())];
            let along = [0.5, 0.25, 0.75, random.unit(), random.unit()][random.below(5)];
            let within = if i % 4 == 0 { DVec3::ZERO } else { random.vector() };
            let from = origin + within;
            let ray = Ray::new(from, p.lerp(q, along) - from);
            let hit = accel.closest(&ray).unwrap_or_else(|| panic!("a leak along {ray:?}"));
            assert!(has_area(hit.primitive), "{ray:?}");
            let surface = accel.surface(&ray, &hit);
            let (off, bound) = (surface.point.distance(ray.at(hit.root.t)), 1e-14 * (10.0 + origin.length()));
            assert!(off < bound, "{off} {ray:?}");
            assert!(accel.any(&ray), "{ray:?}");
            let count = accel.count(&ray);
            // More than one where rounding folds the seam: then there and back, at one place.
            assert_eq!(count % 2, 1, "{count} {ray:?}");
            ones += usize::from(count == 1);
            if i % 16 == 0 {
                assert_eq!(check(&accel, &ray), count);
                let ray = Ray32::new(from.as_vec3(), ray.direction.as_vec3());
                let hit = accel.closest_f32(&ray).expect("no leak in single precision");
                assert!(has_area(hit.primitive), "{ray:?}");
            }
        }
        assert!(ones > rays * 3 / 4, "{ones} of {rays}");
    }
}
