//! Proof by numbers: rays aimed at edges and vertices that must not leak, and trees that must answer as loops do.
//!
//! The counts of the ignored tests are set by `LUMBRE_PROOF_RAYS`, which rays they are by `LUMBRE_PROOF_SEED`; `cargo
//! xtask proof` runs them.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use lumbre_geometry::Ray;
use lumbre_math::{DVec3, Transform};
use rayon::prelude::*;

use super::scenes::{
    Random, build, bumpy, cloud, cube, icosphere, mixture, ray, repeats, shape, soup, torus, vertex,
    with_every_preset,
};
use crate::batch::packet::PACKET;
use crate::{Accel, BuildOptions, Geometry, GeometryKind, Hit, Preset, TriangleMesh, brute};

/// Closed meshes, each with a point inside.
fn closed_meshes() -> Vec<(&'static str, TriangleMesh, DVec3)> {
    let ring = DVec3::new(-0.7, 0.4, 1.1);
    vec![
        ("cube", cube(), DVec3::new(1.3, 0.4, 3.9)),
        ("ball", icosphere(3, DVec3::new(2.0, -3.5, 1.25), 2.5), DVec3::new(2.2, -3.1, 1.0)),
        ("rock", bumpy(4, DVec3::new(-1.0, 2.5, 0.75), 2.5), DVec3::new(-0.9, 2.4, 0.8)),
        ("torus", torus(40, 20, 2.5, 0.75), ring + DVec3::new(2.5, 0.01, 0.02)),
        ("needles", torus(3, 400, 2.5, 0.01), ring + DVec3::new(2.499, 0.0, 0.001)),
        ("hoop", torus(2000, 3, 2.5, 0.3), ring + DVec3::new(2.5, 0.001, 0.002)),
    ]
}

fn tree(kind: GeometryKind, preset: Preset) -> Accel {
    Accel::build(vec![Geometry { id: 3, kind }], &BuildOptions { preset }).unwrap()
}

/// The mesh as it is, far from the origin, in an instance, and in an instance of an instance: with the map to each
/// place.
fn placements(mesh: &TriangleMesh, preset: Preset) -> [(Accel, Transform); 4] {
    let mut random = Random(19);
    let far = DVec3::new(1.0e6, -3.0e5, 7.0e6);
    let as_it_is = || tree(GeometryKind::Mesh(Arc::new(mesh.clone())), preset);
    let placed = |accel: Accel, world_from_object: Transform| {
        tree(GeometryKind::Instance(accel.instance(world_from_object)), preset)
    };
    let squeezed = random.placement(DVec3::new(3.0, -1.0, 2.0), 1.0, 1e-6)
        * Transform::scale(DVec3::new(-1.0, 1.0, 1.0)).unwrap();
    let turned = random.placement(DVec3::new(0.5, 4.0, -2.0), 1.0, 1.0);
    let large = random.placement(DVec3::new(3.0, -1.0, 2.0) * 1e6, 1e6, 1e6);
    [
        (as_it_is(), Transform::IDENTITY),
        (
            tree(GeometryKind::Mesh(Arc::new(TriangleMesh { origin: far, ..mesh.clone() })), preset),
            Transform::translate(far),
        ),
        (placed(as_it_is(), squeezed), squeezed),
        (placed(placed(as_it_is(), turned), large), large * turned),
    ]
}

/// Rays of a chunk; each has its own random numbers.
const CHUNK: u64 = 1 << 14;
/// Rays of a batch, where they are to fly.
const FLOCK: usize = 256;

/// Half of `rays` at vertices, half at edges, from inside: every one has a closest hit, every fourth is
/// asked for all its crossings as well, which must be odd in number, and every other fourth whether it hits at all.
/// Half of them are aimed at triangles that follow one another, and are asked by batches of sixteen, too; the others by
/// larger ones, in which they fly. Answers how many rays there were.
fn bombard(rays: u64, seed: u64) -> u64 {
    let meshes = closed_meshes();
    let places = (meshes.len() * Preset::ALL.len() * 4) as u64;
    let chunks_each = rays.div_ceil(places * CHUNK);
    let shot = AtomicU64::new(0);
    for (name, mesh, inside) in &meshes {
        for preset in Preset::ALL {
            for (place, (accel, map)) in placements(mesh, preset).iter().enumerate() {
                let from = map.point(*inside);
                (0..chunks_each).into_par_iter().for_each(|chunk| {
                    let mut random = Random(seed ^ (chunk << 20) ^ (place as u64) << 8);
                    let mut alike = Vec::with_capacity(PACKET);
                    let mut flock = Vec::with_capacity(FLOCK);
                    let mut number = 0;
                    for i in 0..CHUNK {
                        let are_alike = (i as usize / PACKET).is_multiple_of(2);
                        if are_alike && !(i as usize).is_multiple_of(PACKET) {
                            number = (number + 1) % mesh.indices.len();
                        } else {
                            number = random.below(mesh.indices.len());
                        }
                        let triangle = mesh.indices[number];
                        let corners = triangle.map(|index| vertex(mesh, index));
                        let along = [0.5, 0.25, random.unit()][random.below(3)];
                        let local = if i % 2 == 0 { corners[0] } else { corners[0].lerp(corners[1], along) };
                        let ray = Ray::new(from, map.point(local) - from);
                        assert!(
                            accel.closest(&ray).is_some(),
                            "{name}, {preset:?}, place {place}: a leak along {ray:?}"
                        );
                        if i % 8 < 2 {
                            let count = accel.count(&ray);
                            assert_eq!(count % 2, 1, "{name}, {preset:?}, place {place}: {ray:?}");
                        } else if i % 8 < 4 {
                            assert!(accel.any(&ray), "{name}, {preset:?}, place {place}: {ray:?}");
                        }
                        let (batch, full) =
                            if are_alike { (&mut alike, PACKET) } else { (&mut flock, FLOCK) };
                        batch.push(ray);
                        if batch.len() == full {
                            let (hits, any) = by_batch(accel, batch);
                            let none = hits.iter().zip(any).position(|(hit, any)| hit.is_none() || !any);
                            assert_eq!(none, None, "{name}, {preset:?}, place {place}: {batch:?}");
                            batch.clear();
                        }
                    }
                    shot.fetch_add(CHUNK, Ordering::Relaxed);
                });
                eprintln!(
                    "{name}, {preset:?}, place {place}: {} rays, none leaked",
                    shot.load(Ordering::Relaxed)
                );
            }
        }
    }
    shot.into_inner()
}

#[test]
fn no_ray_leaks_in_millions_aimed_at_edges_and_vertices() {
    let rays = repeats(20_000_000) as u64;
    assert!(bombard(rays, 5) >= rays);
}

fn asked_for(name: &str, otherwise: u64) -> u64 {
    let dispatched = std::env::var(name).ok();
    dispatched.map_or(otherwise, |dispatched| {
        dispatched.parse().unwrap_or_else(|_| panic!("{name} is a whole number"))
    })
}

/// What the random numbers start from: far apart even where the seeds asked for are neighbours.
fn seed_asked_for() -> u64 {
    Random(asked_for("LUMBRE_PROOF_SEED", 1)).bits()
}

#[test]
#[ignore = "an hour; `cargo xtask proof leaks` before a release"]
fn proof_that_no_aimed_ray_leaks() {
    let shot = bombard(asked_for("LUMBRE_PROOF_RAYS", 1_000_000_000), seed_asked_for());
    eprintln!("{shot} rays aimed at edges and vertices, 0 leaks");
}

/// The nearest hits, and any, of a batch.
fn by_batch(accel: &Accel, rays: &[Ray]) -> (Vec<Option<Hit>>, Vec<bool>) {
    let (mut hits, mut any) = (vec![None; rays.len()], vec![false; rays.len()]);
    accel.closest_batch(rays, &mut hits);
    accel.any_batch(rays, &mut any);
    (hits, any)
}

/// Trees against the loop: the same hit, with the same bits of t, and any hit where there is one. A third of the rays
/// follow one another closely, and are asked by batches of sixteen; a third are asked by larger ones, in which they
/// fly. Answers how many of the rays hit something.
fn compare(rays: u64, seed: u64) -> u64 {
    let chunks = rays.div_ceil(CHUNK);
    let center = DVec3::new(1.5, -2.25, 4.0);
    let hits = AtomicU64::new(0);
    (0..chunks).into_par_iter().for_each(|chunk| {
        let mut random = Random(seed ^ chunk << 24);
        let accel = if chunk % 4 == 0 {
            mixture(&mut random, center, 3.0, (chunk % 8 == 0).into(), chunk % 16 == 0)
        } else if chunk % 4 == 1 {
            let shapes = (0..60).map(|_| GeometryKind::Shape(shape(&mut random, center, 3.0))).collect();
            let mesh = GeometryKind::Mesh(Arc::new(soup(&mut random, 60, center, 3.0)));
            build([shapes, vec![mesh]].concat())
        } else if chunk % 8 == 2 {
            let origin = center - 2.0 * random.vector();
            build(vec![GeometryKind::Spheres(Arc::new(cloud(&mut random, 200, origin, center, 3.0)))])
        } else {
            let mesh = soup(&mut random, 100, center, 3.0);
            let mesh = GeometryKind::Mesh(Arc::new(mesh));
            tree(mesh, Preset::ALL[chunk as usize % 3])
        };
        let mut found = 0;
        for flock in 0..CHUNK as usize / FLOCK {
            let mut rays: Vec<_> = (0..FLOCK).map(|_| ray(&mut random, center, 3.0)).collect();
            let (hits, any) = match flock % 3 {
                0 => {
                    let packets = rays.chunks_mut(PACKET).enumerate().map(|(number, rays)| {
                        // From one place, or from places that are near to each other.
                        let (first, apart) = (rays[0], [0.0, 0.01][number % 2]);
                        for ray in rays.iter_mut() {
                            ray.origin = first.origin + apart * random.vector();
                            ray.direction =
                                first.direction + 0.02 * first.direction.length() * random.vector();
                        }
                        by_batch(&accel, rays)
                    });
                    let (hits, any): (Vec<_>, Vec<_>) = packets.unzip();
                    (hits.concat(), any.concat())
                }
                1 => by_batch(&accel, &rays),
                _ => rays.iter().map(|ray| (accel.closest(ray), accel.any(ray))).unzip(),
            };
            for ((ray, hit), any) in rays.iter().zip(hits).zip(any) {
                let expected = brute::closest(&accel.tree, ray);
                let bits = |hit: &Option<Hit>| hit.as_ref().map(|hit| hit.root.t.to_bits());
                assert_eq!(hit, expected, "{ray:?}");
                assert_eq!(bits(&hit), bits(&expected), "{ray:?}");
                assert_eq!(any, expected.is_some(), "{ray:?}");
                found += u64::from(hit.is_some());
            }
        }
        hits.fetch_add(found, Ordering::Relaxed);
    });
    hits.into_inner()
}

#[test]
fn half_a_million_rays_are_answered_as_by_a_loop() {
    assert!(compare(500_000, 7) > 500_000 / 8);
}

#[test]
#[ignore = "minutes; `cargo xtask proof loop` before a release"]
fn proof_that_trees_answer_as_a_loop() {
    let rays = asked_for("LUMBRE_PROOF_RAYS", 10_000_000).div_ceil(CHUNK) * CHUNK;
    let hits = compare(rays, seed_asked_for());
    eprintln!("{rays} rays, {hits} hits, 0 other than a loop's");
    assert!(hits > rays / 8);
}

#[test]
fn with_every_preset_the_places_are_what_they_seem() {
    // A ray that is aimed past the mesh misses it, so that "no leak" above means something.
    with_every_preset(|| {
        for (_, mesh, inside) in closed_meshes() {
            for (accel, map) in placements(&mesh, super::scenes::options().preset) {
                let outside = map.point(inside + DVec3::new(40.0, 50.0, 60.0));
                assert!(accel.any(&Ray::new(outside, map.point(inside) - outside)));
                assert!(!accel.any(&Ray::new(outside, outside - map.point(inside))));
            }
        }
    });
}
