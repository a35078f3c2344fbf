//! Meshes that change their form, against the meshes that they are at the time of a ray.

use std::ops::ControlFlow;
use std::sync::Arc;

use lumbre_geometry::Ray;
use lumbre_math::{DVec3, Transform, Vec3};

use super::oracle::check;
use super::scenes::{Random, build, icosphere, ray, soup};
use crate::{BuildError, CustomGeometry, DeformingMesh, GeometryKind, Hit, TriangleMesh};

const CENTER: DVec3 = DVec3::new(1.5, -2.25, 4.0);

/// The mesh bent otherwise at some moments from 0.5 to 2.5.
fn bent(random: &mut Random, mesh: &TriangleMesh, moments: usize, extent: f32) -> DeformingMesh {
    let moments = (0..moments).map(|_| {
        let (axis, phase) = (random.vector().as_vec3(), random.unit() as f32);
        let bend = |p: &Vec3| *p + 0.2 * extent * axis * (2.0 * axis.dot(*p) / extent + 6.0 * phase).sin();
        mesh.positions.iter().map(bend).collect()
    });
    DeformingMesh::new(mesh.origin, [0.5, 2.5], moments.collect(), mesh.indices.clone()).unwrap()
}

fn some_time(random: &mut Random) -> f64 {
    match random.below(8) {
        0 => [0.5, 1.5, 2.5][random.below(3)],
        1 => [-1.0, 9.0, f64::INFINITY, f64::NAN][random.below(4)],
        _ => random.between(0.5, 2.5),
    }
}

#[test]
fn rays_meet_a_deforming_mesh_as_the_mesh_at_their_time() {
    let mut random = Random(1);
    let mut ball = icosphere(2, DVec3::ZERO, 1.6);
    ball.origin = CENTER;
    let mut hits = 0;
    for (mesh, moments) in [(ball, 3), (soup(&mut random, 150, CENTER, 3.0), 2)] {
        let deforming = Arc::new(bent(&mut random, &mesh, moments, 3.0));
        let tree = build(vec![GeometryKind::Custom(deforming.clone())]);
        for _ in 0..40 {
            let time = some_time(&mut random);
            let baked = build(vec![GeometryKind::Mesh(Arc::new(deforming.at(time)))]);
            for _ in 0..30 {
                let ray = ray(&mut random, CENTER, 3.0);
                let timed = ray.at_time(time);
                let found = tree.closest(&timed);
                let bits =
                    |hit: &Option<Hit>| hit.as_ref().map(|h| (h.primitive, h.root.t.to_bits(), h.root.local));
                assert_eq!(bits(&found), bits(&baked.closest(&ray)));
                assert_eq!(tree.any(&timed), found.is_some());
                assert_eq!(tree.count(&timed), baked.count(&ray));
                let Some(found) = found else { continue };
                hits += 1;
                assert_eq!(tree.surface(&timed, &found), baked.surface(&ray, &found));
                assert!(tree.bounds().outward(4).contains(timed.at(found.root.t)) || time.is_nan());
                let mut last = f64::NEG_INFINITY;
                tree.all(&timed, |hit| {
                    assert!(last <= hit.root.t);
                    last = hit.root.t;
                    ControlFlow::Continue(())
                });
            }
        }
    }
    assert!(hits > 300, "{hits}");
}

#[test]
fn a_closed_mesh_stays_closed_while_it_deforms() {
    let mut random = Random(2);
    let mesh = icosphere(3, DVec3::new(0.3, 0.2, -0.1), 2.0);
    let deforming = bent(&mut random, &mesh, 3, 2.0);
    let tree = build(vec![GeometryKind::Custom(Arc::new(deforming.clone()))]);
    for _ in 0..150 {
        let time = some_time(&mut random);
        let now = deforming.at(time);
        for i in 0..40 {
            let corners = now.indices[random.below(now.indices.len())];
            let [a, b, _] = corners.map(|vertex| now.origin + now.positions[vertex as usize].as_dvec3());
            let target = if i % 2 == 0 { a } else { a.lerp(b, [0.5, 0.25, random.unit()][random.below(3)]) };
            let inside = now.origin + DVec3::new(0.31, 0.22, -0.13);
            let within = Ray::new(inside, target - inside).at_time(time);
            assert!(tree.any(&within), "a leak along {within:?}");
            assert_eq!(tree.count(&within) % 2, 1, "{within:?}");
            let from = inside + 9.0 * random.vector().normalize();
            let through = Ray::new(from, target - from).at_time(time);
            assert_eq!(tree.count(&through) % 2, 0, "{through:?}");
        }
    }
}

#[test]
fn a_box_holds_a_triangle_at_every_time() {
    let mut random = Random(3);
    // Coordinates of very different sizes: rounding might lead beyond.
    let mut number = || (random.unit() as f32 - 0.5) * 10_f32.powi(random.below(40) as i32 - 20);
    let mut positions = || (0..30).map(|_| Vec3::new(number(), number(), number())).collect::<Vec<_>>();
    let moments = vec![positions(), positions(), positions()];
    let indices: Vec<[u32; 3]> = (0..10).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let mesh = DeformingMesh::new(DVec3::ZERO, [0.0, 1.0], moments, indices.clone()).unwrap();
    for i in 0..=2000 {
        let now = mesh.at(f64::from(i) / 2000.0);
        for (triangle, corners) in indices.iter().enumerate() {
            let bounds = mesh.bounds(triangle as u32).unwrap();
            assert!(corners.iter().all(|&vertex| bounds.contains(now.positions[vertex as usize].as_dvec3())));
        }
    }
}

#[test]
fn it_deforms_in_instances_and_is_refitted_and_saved() {
    let mut random = Random(4);
    let mut mesh = icosphere(2, DVec3::ZERO, 1.0);
    mesh.origin = DVec3::new(2.0, 1.0, -3.0);
    let kind = |random: &mut Random| GeometryKind::Custom(Arc::new(bent(random, &mesh, 4, 1.0)));
    let inner = build(vec![kind(&mut random), GeometryKind::Mesh(Arc::new(icosphere(1, mesh.origin, 0.5)))]);
    let mut geometries = inner.tree.geometries.clone();
    let mut inner = crate::Accel::from_bytes(&inner.to_bytes(), geometries.clone()).unwrap();
    for round in 0..2 {
        let accel = Arc::new(inner);
        let place = Transform::translate(CENTER) * Transform::translate(-mesh.origin);
        let turn = Transform::translate(CENTER)
            * Transform::rotate(DVec3::new(1.0, 2.0, 0.5), 50.0).unwrap()
            * Transform::translate(-mesh.origin);
        let motion = lumbre_math::AnimatedTransform::new(vec![(0.0, place), (2.0, turn)]).unwrap();
        let instance = accel.instance(motion);
        let outer = build(vec![GeometryKind::Instance(instance)]);
        let mut hits = 0;
        for _ in 0..200 {
            let time = random.between(0.0, 3.0);
            hits += check(&outer, &ray(&mut random, CENTER, 1.0).at_time(time));
        }
        assert!(hits > 100, "{hits}");
        if round == 1 {
            break;
        }
        drop(outer);
        inner = Arc::into_inner(accel).unwrap();
        geometries[0].kind = kind(&mut random);
        inner.refit(geometries.clone()).unwrap();
    }
}

#[test]
fn what_makes_no_mesh_is_refused() {
    let p = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
    let new = |times, moments, indices| DeformingMesh::new(CENTER, times, moments, indices).map(|_| ());
    let whole = vec![[0, 1, 2]];
    assert_eq!(new([0.0, 1.0], vec![p.clone(), p.clone()], whole.clone()), Ok(()));
    let short = vec![p.clone(), p[..2].to_vec()];
    let range = BuildError::VertexOutOfRange { geometry: 0, triangle: 0 };
    assert_eq!(new([0.0, 1.0], short, whole.clone()), Err(range.clone()));
    assert_eq!(new([0.0, 1.0], vec![], whole.clone()), Err(range));
    let broken = vec![p.clone(), vec![Vec3::ZERO, Vec3::NAN, Vec3::Y]];
    assert_eq!(
        new([0.0, 1.0], broken, whole.clone()),
        Err(BuildError::NotFinite { geometry: 0, element: 1 })
    );
    assert!(new([1.0, 1.0], vec![p.clone()], whole.clone()).is_err());
    assert!(new([0.0, f64::INFINITY], vec![p], whole).is_err());
}
