//! Rays in single precision leak at no edge and no corner of closed meshes.

use lumbre_math::{DVec3, Vec3};

use super::f32_ray::{in_batch, kinds};
use super::scenes::{Random, build, bumpy, cube, icosphere, torus, vertex, with_every_preset};
use crate::batch::packet::PACKET;
use crate::intersect::Isa;
use crate::{Ray32, TriangleMesh};

/// A prism over a polygon that is all but a square: on one of its sides corners lie no more than a roundoff apart, and
/// those of its top and bottom, which are level, make fans of needles with a corner across.
fn fans() -> TriangleMesh {
    let step = 1.0 / (1 << 23) as f32;
    let mut outline = vec![[-0.9, -0.7], [1.03, -0.8]];
    outline.extend((0..150).map(|i| [1.03, 0.61 + i as f32 * step]));
    outline.push([-0.8, 1.1]);
    let n = outline.len() as u32;
    let isa = |y: f32| outline.iter().map(move |&[x, z]| Vec3::new(x, y, z));
    let positions = isa(-1.0).chain(isa(0.7)).collect();
    let mut indices = Vec::new();
    for i in 1..n - 1 {
        indices.extend([[0, i, i + 1], [n, n + i + 1, n + i]]);
    }
    for i in 0..n {
        let next = (i + 1) % n;
        indices.extend([[i, n + i, n + next], [i, n + next, next]]);
    }
    TriangleMesh { origin: DVec3::ZERO, positions, indices }
}

/// Closed meshes, each with a point inside.
fn closed_meshes() -> Vec<(&'static str, TriangleMesh, DVec3)> {
    let ring = DVec3::new(-0.7, 0.4, 1.1);
    vec![
        ("cube", cube(), DVec3::new(1.3, 0.4, 3.9)),
        ("cube from its middle", cube(), DVec3::new(1.75, 0.25, 4.25)),
        ("ball", icosphere(3, DVec3::new(2.0, -3.5, 1.25), 2.5), DVec3::new(2.2, -3.1, 1.0)),
        ("rock", bumpy(3, DVec3::new(-1.0, 2.5, 0.75), 2.5), DVec3::new(-0.9, 2.4, 0.8)),
        ("torus", torus(40, 20, 2.5, 0.75), ring + DVec3::new(2.5, 0.01, 0.02)),
        ("needles", torus(3, 400, 2.5, 0.01), ring + DVec3::new(2.499, 0.0, 0.001)),
        ("hoop", torus(2000, 3, 2.5, 0.3), ring + DVec3::new(2.5, 0.001, 0.002)),
        ("fans", fans(), DVec3::new(0.2, 0.05, 0.1)),
    ]
}

/// The mesh as it is, far off by its origin and by its vertices, stretched, small and mirrored, and large; each with
/// where the point inside comes to lie.
fn placements(mesh: &TriangleMesh, inside: DVec3) -> Vec<(TriangleMesh, Vec3)> {
    let moved = |factor: Vec3, by: Vec3| {
        let positions = mesh.positions.iter().map(|&p| p * factor + by).collect();
        let mesh = TriangleMesh { origin: DVec3::ZERO, positions, indices: mesh.indices.clone() };
        (mesh, inside.as_vec3() * factor + by)
    };
    let far = Vec3::new(1.0e6, -3.0e5, 7.0e6);
    let origin = far.as_dvec3() - inside + DVec3::new(1e-5, 7e-6, -1.3e-5);
    vec![
        moved(Vec3::ONE, Vec3::ZERO),
        (TriangleMesh { origin, ..mesh.clone() }, far),
        moved(Vec3::ONE, Vec3::new(1000.0, -300.0, 4000.0)),
        moved(Vec3::new(1.0, 1e-3, 40.0), Vec3::new(3.0, 0.0, -1.0)),
        moved(Vec3::splat(-3e-6), Vec3::ZERO),
        moved(Vec3::new(2e5, 3e5, 2.5e5), Vec3::ZERO),
    ]
}

/// A neighbour, two roundoffs away at most.
fn shaken(random: &mut Random, p: Vec3) -> Vec3 {
    p.map(|x| match random.below(5) {
        0 => x.next_up(),
        1 => x.next_down(),
        2 => x.next_up().next_up(),
        3 => x.next_down().next_down(),
        _ => x,
    })
}

#[test]
fn no_ray_from_within_leaks_at_a_corner_or_an_edge() {
    let mut random = Random(706);
    let mut shot = 0;
    with_every_preset(|| {
        for (name, mesh, inside) in closed_meshes() {
            for (number, (mesh, from)) in placements(&mesh, inside).into_iter().enumerate() {
                let accel = build(kinds(std::slice::from_ref(&mesh)));
                assert_eq!(accel.only_triangles(), Some(true));
                let mut triangle = 0;
                let mut rays = Vec::new();
                for i in 0..2152 {
                    // By turns sixteen neighbours and sixteen from anywhere.
                    let are_alike = (i / PACKET).is_multiple_of(2);
                    triangle = if are_alike && !i.is_multiple_of(PACKET) {
                        (triangle + 1) % mesh.indices.len()
                    } else {
                        random.below(mesh.indices.len())
                    };
                    let corners = mesh.indices[triangle].map(|index| vertex(&mesh, index));
                    let along = [0.5, 0.25, random.unit()][random.below(3)];
                    let target = if i % 2 == 0 { corners[0] } else { corners[0].lerp(corners[1], along) };
                    // There are few places to start at so far off.
                    let is_shaken = number != 1 && random.below(4) == 0;
                    let origin = if is_shaken { shaken(&mut random, from) } else { from };
                    // From where it starts to the target, from there to the rounded target, or a little off it.
                    let direction = match random.below(3) {
                        0 => (target - origin.as_dvec3()).as_vec3(),
                        1 if number != 1 => target.as_vec3() - origin,
                        _ => shaken(&mut random, (target - origin.as_dvec3()).as_vec3()),
                    };
                    rays.push(Ray32::new(origin, direction));
                }
                for isa in Isa::all() {
                    for ray in &rays {
                        let is_leak = accel.closest_f32_at(isa, ray).is_none() || !accel.any_f32_at(isa, ray);
                        assert!(!is_leak, "{name}, place {number}, {isa:?}: a leak along {ray:?}");
                    }
                    for rays in [&rays[..], &rays[16..32], &rays[64..81]] {
                        for flies in [false, true] {
                            let (hits, met) = in_batch(&accel, isa, rays, flies);
                            let leak = hits.iter().zip(met).position(|(hit, met)| hit.is_none() || !met);
                            let about = format!("{name}, place {number}, {isa:?}, {flies}");
                            assert_eq!(leak, None, "{about}: a leak along {rays:?}");
                        }
                    }
                }
                shot += rays.len();
            }
        }
    });
    assert!(shot > 300_000, "{shot}");
}
