//! A little of everything, small enough for an interpreter: what `cargo xtask miri` runs.
//!
//! All other tests are left out there, but for that of the stack. The instruction sets that it does not know are not
//! found, so that this goes through the
//! portable path, with the stack that is not cleared and every look-up that is not checked.

use std::sync::Arc;

use lumbre_geometry::Ray;
use lumbre_math::{DVec3, Transform};

use super::oracle::check;
use super::scenes::{
    Random, balls, build, cloud, cube, icosphere, options, precise, ray, shape, soup, with_every_preset,
};
use crate::batch;
use crate::batch::packet::{self, PACKET};
use crate::{Accel, GeometryKind};

/// How many random rays a tree is asked with: in the interpreter, every one takes seconds.
const RAYS: usize = if cfg!(miri) { 2 } else { 6 };

const CENTER: DVec3 = DVec3::new(1.5, -2.25, 4.0);

fn some_of_each(random: &mut Random) -> Accel {
    let inner = Arc::new(build(vec![GeometryKind::Mesh(Arc::new(cube()))]));
    let world_from_object = Transform::scale(DVec3::new(-1.0, 0.5, 0.75)).unwrap();
    build(vec![
        GeometryKind::Mesh(Arc::new(soup(random, 10, CENTER, 3.0))),
        GeometryKind::PreciseMesh(Arc::new(precise(&soup(random, 3, CENTER, 3.0)))),
        GeometryKind::Spheres(Arc::new(cloud(random, 9, DVec3::ZERO, CENTER, 3.0))),
        GeometryKind::Shape(shape(random, CENTER, 3.0)),
        GeometryKind::Custom(Arc::new(balls(random, 3, CENTER, 3.0, None))),
        GeometryKind::Instance(inner.instance(world_from_object)),
    ])
}

#[test]
fn a_few_rays_are_answered_as_by_the_loop() {
    with_every_preset(|| {
        let mut random = Random(95);
        let mixed = some_of_each(&mut random);
        let meshes = build(vec![GeometryKind::Mesh(Arc::new(icosphere(1, CENTER, 2.0)))]);
        for accel in [mixed, meshes] {
            let mut rays: Vec<Ray> = (0..RAYS).map(|_| ray(&mut random, CENTER, 3.0)).collect();
            // Exactly through corners and edges.
            let corner = CENTER + DVec3::new(0.0, 0.0, 2.0);
            rays.push(Ray::new(corner + DVec3::new(0.0, 0.0, 3.0), -DVec3::Z));
            rays.iter().for_each(|ray| {
                check(&accel, ray);
            });
            let mut hits = vec![None; rays.len()];
            accel.closest_batch(&rays, &mut hits);
            assert!(rays.iter().zip(&hits).all(|(ray, hit)| accel.closest(ray) == *hit));
            for (ray, hit) in rays.iter().zip(&hits) {
                if let Some(hit) = hit {
                    assert!(accel.surface(ray, hit).point.is_finite());
                }
            }
        }
    });
}

#[test]
fn sixteen_rays_that_go_together_are_answered_as_each_alone() {
    let mut random = Random(97);
    let accel = build(vec![GeometryKind::Mesh(Arc::new(icosphere(1, CENTER, 2.0)))]);
    let eye = CENTER + DVec3::new(1.5, 1.25, 9.0);
    // One of them exactly through a corner.
    let rays: [Ray; PACKET] = std::array::from_fn(|i| {
        let beside = if i == 5 { DVec3::ZERO } else { 0.3 * random.vector() };
        Ray::new(eye, CENTER + DVec3::new(0.0, 0.0, 2.0) + beside - eye)
    });
    // The portable path, which an interpreter takes, has no packets.
    let answered = if cfg!(miri) { 0 } else { packet::ALL };
    assert_eq!(batch::shims::answered_by_packet(accel.isa, &accel.tree, &rays), answered);
    let (mut hits, mut any) = (vec![None; rays.len()], vec![false; rays.len()]);
    accel.closest_batch(&rays, &mut hits);
    accel.any_batch(&rays, &mut any);
    for ((ray, hit), any) in rays.iter().zip(&hits).zip(any) {
        assert_eq!(accel.closest_exact_at(accel.isa, ray), *hit);
        assert_eq!(any, hit.is_some());
    }
}

#[test]
fn a_small_tree_is_refitted_saved_and_asked_for_points() {
    let mut random = Random(96);
    let mut accel = some_of_each(&mut random);
    let bytes = accel.to_bytes();
    let geometries = accel.tree.geometries.clone();
    accel.refit(geometries.clone()).unwrap();
    let loaded = Accel::from_bytes(&bytes, geometries).unwrap();
    for _ in 0..3 {
        let p = CENTER + 3.0 * random.vector();
        assert_eq!(accel.is_inside(p), loaded.is_inside(p));
        // Not its parameters: the interpreter rounds angles as it likes.
        let name =
            |accel: &Accel| accel.closest_point(p, 9.0).map(|found| found.map(|it| (it.id, it.primitive)));
        assert_eq!(name(&accel), name(&loaded));
    }
    let ball = build(vec![GeometryKind::Mesh(Arc::new(icosphere(1, CENTER, 2.0)))]);
    assert!((ball.winding_number(CENTER).unwrap() - 1.0).abs() < 2e-3);
    assert_eq!(options().preset, Default::default());
}
