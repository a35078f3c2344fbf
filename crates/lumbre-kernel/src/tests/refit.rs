//! Trees whose contents moved: against the loop, and against trees built anew.

use std::sync::Arc;

use lumbre_geometry::Ray;
use lumbre_math::{DVec3, Transform, Vec3};

use super::oracle::check;
use super::scenes::{Random, balls, build, cloud, cube, icosphere, mixture, ray, shape, with_every_preset};
use crate::Instance;
use crate::{Accel, BuildError, Geometry, GeometryKind, PreciseMesh, RefitError, TriangleMesh};

const CENTER: DVec3 = DVec3::new(1.5, -2.25, 4.0);

/// The same geometries elsewhere.
pub(crate) fn moved(accel: &Accel, random: &mut Random, center: DVec3, extent: f64) -> Vec<Geometry> {
    let mut move_kind = |kind: &GeometryKind| match kind {
        GeometryKind::Mesh(mesh) => {
            let twist = Transform::rotate(random.vector(), 50.0).unwrap();
            let bend = |p: &Vec3| {
                let p = p.as_dvec3();
                (twist.vector(p) + 0.2 * extent * (DVec3::new(p.y, p.z, p.x) / extent).map(f64::sin))
                    .as_vec3()
            };
            let positions = mesh.positions.iter().map(bend).collect();
            GeometryKind::Mesh(Arc::new(TriangleMesh {
                origin: center,
                positions,
                indices: mesh.indices.clone(),
            }))
        }
        GeometryKind::PreciseMesh(mesh) => {
            let twist = Transform::rotate(random.vector(), 50.0).unwrap();
            let middle = mesh.positions.iter().sum::<DVec3>() / mesh.positions.len() as f64;
            let size = mesh.positions.iter().fold(0.0, |most: f64, p| most.max((*p - middle).length()));
            let bend = |p: &DVec3| center + twist.vector(*p - middle) * (extent / size);
            let positions = mesh.positions.iter().map(bend).collect();
            GeometryKind::PreciseMesh(Arc::new(PreciseMesh { positions, indices: mesh.indices.clone() }))
        }
        GeometryKind::Shape(_) => GeometryKind::Shape(shape(random, center, extent)),
        GeometryKind::Spheres(old) => {
            let mut new = cloud(random, old.spheres.len(), center + 0.1 * extent, center, extent);
            // What has no radius has no place in the tree.
            for (new, old) in new.spheres.iter_mut().zip(&old.spheres) {
                new[3] = if old[3] > 0.0 { new[3] } else { 0.0 };
            }
            GeometryKind::Spheres(Arc::new(new))
        }
        GeometryKind::Instance(instance) => {
            let world_from_object = random.placement(center, extent, 0.2 * extent)
                * Transform::translate(-instance.tree.bounds.center());
            let world_from_object = world_from_object.into();
            GeometryKind::Instance(Instance { world_from_object, ..instance.clone() })
        }
        GeometryKind::Custom(custom) => {
            let count = custom.primitive_count() as usize;
            GeometryKind::Custom(Arc::new(balls(random, count, center, extent, None)))
        }
    };
    accel
        .tree
        .geometries
        .iter()
        .map(|geometry| Geometry { id: geometry.id, kind: move_kind(&geometry.kind) })
        .collect()
}

#[test]
fn a_refitted_tree_finds_what_a_loop_finds() {
    with_every_preset(|| {
        for seed in 40..44 {
            let mut random = Random(seed);
            let mut accel = mixture(&mut random, CENTER, 3.0, 1, false);
            for step in 0..3 {
                // Off to where the old units are of no use.
                let (center, extent) = [(CENTER, 3.0), (1e5 * CENTER, 200.0), (-CENTER, 1e-3)][step];
                let geometries = moved(&accel, &mut random, center, extent);
                let growth = accel.refit(geometries).unwrap();
                assert!(growth.is_finite() && growth > 0.0);
                let hits: usize = (0..400).map(|_| check(&accel, &ray(&mut random, center, extent))).sum();
                assert!(hits > 100, "{hits}");
            }
        }
    });
}

#[test]
fn what_moves_together_costs_what_it_cost() {
    let mut random = Random(8);
    let mesh = icosphere(5, DVec3::ZERO, 3.0);
    let at = |scale: f32, origin: DVec3| {
        let positions = mesh.positions.iter().map(|&p| p * scale).collect();
        let mesh = TriangleMesh { origin, positions, indices: mesh.indices.clone() };
        vec![Geometry { id: 5, kind: GeometryKind::Mesh(Arc::new(mesh)) }]
    };
    let mut accel = Accel::build(at(1.0, CENTER), &Default::default()).unwrap();
    let growth = accel.refit(at(4.0, DVec3::new(70.0, 80.0, -90.0))).unwrap();
    assert!((0.99..1.01).contains(&growth), "{growth}");

    // Shuffled, it costs much more; put back, what it cost.
    let mut shuffled = at(1.0, CENTER);
    if let GeometryKind::Mesh(mesh) = &mut shuffled[0].kind {
        let mesh = Arc::make_mut(mesh);
        let places = mesh.positions.len();
        for i in 0..places {
            mesh.positions.swap(i, random.below(places));
        }
    }
    let growth = accel.refit(shuffled).unwrap();
    assert!(growth > 5.0, "{growth}");
    let growth = accel.refit(at(1.0, CENTER)).unwrap();
    assert!((0.99..1.01).contains(&growth), "{growth}");
}

#[test]
fn triangles_may_vanish_and_come_back() {
    let whole = TriangleMesh { origin: DVec3::new(2.0, -3.5, 1.25), ..icosphere(2, DVec3::ZERO, 2.5) };
    let mut accel = build(vec![GeometryKind::Mesh(Arc::new(whole.clone()))]);
    let geometry =
        |mesh: &TriangleMesh| vec![Geometry { id: 9, kind: GeometryKind::Mesh(Arc::new(mesh.clone())) }];
    let mut collapsed = whole.clone();
    for p in &mut collapsed.positions {
        if p.y > 0.5 {
            *p = Vec3::new(0.25, 0.75, 0.5);
        }
    }
    accel.refit(geometry(&collapsed)).unwrap();
    assert!(accel.primitive_count() < whole.indices.len() && accel.primitive_count() > 50);
    let mut random = Random(3);
    let mut hits = 0;
    for _ in 0..2000 {
        hits += check(&accel, &ray(&mut random, DVec3::new(2.0, -3.5, 1.25), 2.5));
    }
    assert!(hits > 500, "{hits}");
    accel.refit(geometry(&whole)).unwrap();
    assert_eq!(accel.primitive_count(), whole.indices.len());
    let fresh = build(vec![GeometryKind::Mesh(Arc::new(whole))]);
    for _ in 0..500 {
        let ray = ray(&mut random, DVec3::new(2.0, -3.5, 1.25), 2.5);
        assert_eq!(accel.closest(&ray).map(|hit| hit.root.t), fresh.closest(&ray).map(|hit| hit.root.t));
    }
}

#[test]
fn what_has_no_place_is_refused_and_the_tree_stays_as_it_was() {
    let mut flat = cube();
    flat.indices.push([2, 2, 5]);
    let mut accel = build(vec![GeometryKind::Mesh(Arc::new(flat.clone()))]);
    let before = format!("{accel:?}");
    let geometry = |mesh: TriangleMesh| vec![Geometry { id: 9, kind: GeometryKind::Mesh(Arc::new(mesh)) }];

    let mut open = flat.clone();
    open.indices[12] = [2, 4, 5];
    assert_eq!(accel.refit(geometry(open)), Err(RefitError::NeedsBuild { geometry: 0, element: 12 }));
    assert_eq!(accel.refit(geometry(cube())), Err(RefitError::OtherTopology { geometry: 0 }));
    assert_eq!(accel.refit(vec![]), Err(RefitError::OtherLength { expected: 1, found: 0 }));
    let mut broken = flat.clone();
    broken.positions[3].z = f32::NAN;
    let unsound = BuildError::NotFinite { geometry: 0, element: 3 };
    assert_eq!(accel.refit(geometry(broken)), Err(RefitError::Unsound(unsound)));
    assert_eq!(format!("{accel:?}"), before);

    let mut balls_and_floor =
        build(vec![GeometryKind::Custom(Arc::new(balls(&mut Random(2), 9, CENTER, 2.0, Some(-3.0))))]);
    let no_floor = GeometryKind::Custom(Arc::new(balls(&mut Random(2), 10, CENTER, 2.0, None)));
    let result = balls_and_floor.refit(vec![Geometry { id: 4, kind: no_floor }]);
    assert_eq!(result, Err(RefitError::NeedsBuild { geometry: 0, element: 9 }));
}

#[test]
fn an_instance_follows_the_tree_in_it() {
    let ball = icosphere(2, DVec3::ZERO, 2.5);
    let inner = build(vec![GeometryKind::Mesh(Arc::new(ball.clone()))]);
    let place = Transform::translate(DVec3::new(7.0, 8.0, 9.0));
    let instance =
        |accel: Arc<Accel>| vec![Geometry { id: 6, kind: GeometryKind::Instance(accel.instance(place)) }];
    let mut inner = Arc::new(inner);
    let mut outer = Accel::build(instance(Arc::clone(&inner)), &Default::default()).unwrap();
    let ray = Ray::new(DVec3::new(7.1, 8.2, -50.0), DVec3::Z);
    let before = outer.closest(&ray).unwrap().root.t;
    // Larger: the outer tree lets go of it first.
    outer.refit(instance(Arc::new(build(vec![GeometryKind::Mesh(Arc::new(cube()))])))).unwrap();
    let larger = TriangleMesh { positions: ball.positions.iter().map(|&p| 3.0 * p).collect(), ..ball };
    let geometries = vec![Geometry { id: 1000, kind: GeometryKind::Mesh(Arc::new(larger)) }];
    Arc::get_mut(&mut inner).expect("nobody else holds it").refit(geometries).unwrap();
    outer.refit(instance(inner)).unwrap();
    let after = outer.closest(&ray).unwrap().root.t;
    assert!((before - after - 5.0).abs() < 0.3, "{before} {after}");
}
