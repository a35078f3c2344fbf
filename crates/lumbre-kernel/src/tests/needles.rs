//! Long thin triangles every which way, whose boxes are mostly empty.

use std::sync::Arc;

use lumbre_geometry::Ray;
use lumbre_math::{DVec3, Transform};

use super::oracle::check;
use super::scenes::{Random, build, mesh, ray, vertex, with_every_preset};
use crate::{Accel, Geometry, GeometryKind, TriangleMesh};

const CENTER: DVec3 = DVec3::new(1.5, -2.25, 4.0);

fn needles(random: &mut Random, count: usize) -> TriangleMesh {
    let mut positions = Vec::new();
    for _ in 0..count {
        let start = CENTER + 2.0 * random.vector();
        positions.extend([start, start + 0.8 * random.vector(), start + 0.002 * random.vector()]);
    }
    let indices = (0..count as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    mesh(positions, indices)
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
fn needles_are_found_as_by_a_loop() {
    let mut random = Random(74);
    let needles = Arc::new(needles(&mut random, 400));
    let rays = rays_at(&needles, &mut random, 3000);
    with_every_preset(|| {
        let accel = build(vec![GeometryKind::Mesh(Arc::clone(&needles))]);
        let hits: usize = rays.iter().map(|ray| check(&accel, ray)).sum();
        assert!(hits > 1000, "{hits}");
    });
}

#[test]
fn needles_are_saved_mapped_and_refitted() {
    with_every_preset(|| {
        let mut random = Random(77);
        let needles = needles(&mut random, 3000);
        let rays = rays_at(&needles, &mut random, 300);
        let mut accel = build(vec![GeometryKind::Mesh(Arc::new(needles.clone()))]);
        let before = format!("{:?}", accel.tree.packed);
        let (bytes, geometries) = (accel.to_bytes(), accel.tree.geometries.clone());
        let loaded = Accel::from_bytes(&bytes, geometries.clone()).unwrap();
        assert!(format!("{:?}", loaded.tree.packed) == before);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("tree");
        accel.save(&path).unwrap();
        let mapped = Accel::map(&path, geometries.clone()).unwrap();
        assert!(format!("{:?}", mapped.tree.packed) == before);
        rays.iter().for_each(|ray| assert_eq!(mapped.closest(ray), accel.closest(ray)));
        // Where nothing moved, all is as it was.
        assert_eq!(accel.refit(geometries.clone()).unwrap(), 1.0);
        assert!(format!("{:?}", accel.tree.packed) == before);
        // Bent and turned, boxes still hold all of their triangles.
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
    });
}
