//! Rays in single precision: against a plain loop in single precision, against double precision, and at edges that must
//! not leak.

use std::sync::Arc;

use lumbre_geometry::Ray;
use lumbre_math::{DVec3, Transform, Vec3};

use super::refit::moved;
use super::scenes::{
    self, Random, build, bumpy, cube, icosphere, mixture, options, precise, repeats, soup, torus,
    with_every_preset,
};
use crate::batch;
use crate::batch::packet::PACKET;
use crate::intersect::{Isa, Portable, Simd};
use crate::simd::{F32x8, Vector};
use crate::tree::filter_start::FilterStart;
use crate::tree::filter_start::Precise;
use crate::tree::node::Node;
use crate::tree::triangle_block::Line;
use crate::{Accel, BuildOptions, Geometry, GeometryKind, Hit, Hit32, Preset, Ray32, TriangleMesh};

const CENTER: DVec3 = DVec3::new(1.5, -2.25, 4.0);

/// A ray among the triangles of meshes with one origin, as the plain loop takes it.
struct PlainRay {
    /// The axes that become x, y and z.
    order: [usize; 3],
    origin: [f32; 3],
    shear: [f32; 2],
    minus_inverse: f32,
    most: f32,
    t_min: f32,
    t_max: f32,
}

impl PlainRay {
    /// `None` where it does not come from nearby, or is not sound.
    fn new(start: &FilterStart, ray: &Ray32) -> Option<Self> {
        let local = [0, 1, 2].map(|axis| (f64::from(ray.origin[axis]) - start.mesh_origin[axis]) as f32);
        let direction = ray.direction.to_array();
        let is_near = (0..3).all(|axis| {
            let from = local[axis] * start.units_per_space - start.shift[axis];
            from.abs() <= start.farthest[axis] && direction[axis].abs() <= start.longest[axis]
        });
        let is_long = direction.iter().any(|d| d.abs() >= start.shortest);
        let is_ahead = ray.t_min.is_sign_positive() && ray.t_min <= ray.t_max;
        if !(is_near && is_long && is_ahead) {
            return None;
        }
        let [x, y, z] = direction.map(f32::abs);
        let last = if x >= y && x >= z { 0 } else { 1 + usize::from(y < z) };
        let [first, second] = [(last + 1) % 3, (last + 2) % 3];
        let order = if direction[last] < 0.0 { [second, first, last] } else { [first, second, last] };
        // Factors that are powers of two: this is the inverse, but for what underflows.
        let inverse = start.space_per_unit / direction[last] * start.units_per_space;
        Some(Self {
            order,
            origin: order.map(|axis| local[axis]),
            shear: [direction[order[0]] * inverse, direction[order[1]] * inverse],
            minus_inverse: -inverse,
            most: 2.0 * start.space_per_unit,
            t_min: ray.t_min,
            t_max: ray.t_max,
        })
    }

    /// Where it meets a triangle, within its range, the barycentrics, and whether it enters there.
    fn meet(&self, corners: [Vec3; 3]) -> Option<(f32, [f32; 2], bool)> {
        let [a, b, c] = corners.map(|corner| {
            let [x, y, z] = self.order.map(|axis| corner[axis]);
            let height = self.origin[2] - z;
            let across = (self.origin[0] - x) - self.shear[0] * height;
            let up = (self.origin[1] - y) - self.shear[1] * height;
            [across, up, height]
        });
        let products = [(c, b), (a, c), (b, a)].map(|(p, q)| (p[0] * q[1], p[1] * q[0]));
        let [u, v, w] = products.map(|(p, q)| p - q);
        if !has_one_sign([u, v, w].map(f64::from)) {
            return None;
        }
        let det = u + v + w;
        let largest = products.iter().fold(0.0, |most: f32, (p, _)| most.max(p.abs()));
        let extent = a[2].max(b[2]).max(c[2]) - a[2].min(b[2]).min(c[2]);
        let is_little_cancelled =
            (largest + 2f32.powi(-80)) * (extent + self.most / 1024.0) <= det.abs() * self.most;
        // Rounded edge functions of what is small or far may all be zero, wherever it is.
        let is_strict = [u, v, w].iter().all(|&edge| edge > 0.0) || [u, v, w].iter().all(|&edge| edge < 0.0);
        let (t, local, enters) = if !(is_strict && is_little_cancelled) {
            let [a, b, c] = [a, b, c].map(|corner| corner.map(f64::from));
            let [u, v, w] = [(c, b), (a, c), (b, a)].map(|(p, q)| p[0] * q[1] - p[1] * q[0]);
            let det = u + v + w;
            if !has_one_sign([u, v, w]) || det == 0.0 {
                return None;
            }
            let height = (u * a[2] + v * b[2] + w * c[2]) / det;
            let t = (height * f64::from(self.minus_inverse)) as f32;
            (t, [(v / det) as f32, (w / det) as f32], det > 0.0)
        } else {
            let t = (u * a[2] + v * b[2] + w * c[2]) / det * self.minus_inverse;
            (t, [v / det, w / det], det > 0.0)
        };
        (self.t_min <= t && t <= self.t_max).then_some((t, local, enters))
    }
}

fn has_one_sign(edges: [f64; 3]) -> bool {
    edges.iter().all(|&edge| edge >= 0.0) || edges.iter().all(|&edge| edge <= 0.0)
}

/// What a tree of nothing but meshes answers, by a loop over all triangles where the ray comes from nearby; and whether
/// it does.
fn by_reference(accel: &Accel, ray: &Ray32) -> (Option<Hit32>, bool) {
    let start = accel.tree.single.as_ref().expect("made for this");
    assert!(start.only_triangles);
    let Some(plain) = PlainRay::new(start, ray) else { return (widened(accel, ray), false) };
    let mut nearest: Option<(Hit32, bool)> = None;
    for (geometry, Geometry { id, kind }) in accel.tree.geometries.iter().enumerate() {
        let GeometryKind::Mesh(mesh) = kind else { unreachable!("nothing but meshes") };
        for (primitive, triangle) in mesh.indices.iter().enumerate() {
            let corners = triangle.map(|vertex| mesh.positions[vertex as usize]);
            let [a, b, c] = corners.map(|corner| corner.as_dvec3());
            if (b - a).cross(c - a) == DVec3::ZERO {
                continue;
            }
            let Some((t, local, enters)) = plain.meet(corners) else { continue };
            // Of those at the same place, the first that enters, or else the first.
            let is_nearer = nearest.is_none_or(|(nearest, nearest_enters)| {
                t < nearest.t || t == nearest.t && enters && !nearest_enters
            });
            if is_nearer {
                let (geometry, primitive) = (geometry as u32, primitive as u32);
                let instance = Hit32::NO_INSTANCE;
                nearest = Some((Hit32 { t, local, id: *id, primitive, geometry, instance }, enters));
            }
        }
    }
    (nearest.map(|(hit, _)| hit), true)
}

/// What double precision answers, rounded.
fn widened(accel: &Accel, ray: &Ray32) -> Option<Hit32> {
    let Hit { root, id, primitive, geometry, instances, .. } = accel.closest(&ray.to_f64())?;
    let instance = if instances.is_empty() { Hit32::NO_INSTANCE } else { instances[0] };
    let local = root.local.as_vec2().to_array();
    Some(Hit32 { t: root.t as f32, local, id, primitive, geometry, instance })
}

type Bits = Option<([u32; 3], [u32; 4])>;

fn bits(hit: &Option<Hit32>) -> Bits {
    hit.as_ref().map(|&Hit32 { t, local: [u, v], id, primitive, geometry, instance }| {
        ([t, u, v].map(f32::to_bits), [id, primitive, geometry, instance])
    })
}

/// Stands where an answer is to come.
const STALE: Hit32 =
    Hit32 { t: 0.125, local: [0.5, 0.25], id: 99, primitive: 98, geometry: 97, instance: 96 };

/// Every ray alone, and in batches of these sizes, at every instruction set; answers how many hit.
#[track_caller]
fn check(accel: &Accel, rays: &[Ray32], expected: &[Option<Hit32>], sizes: &[usize]) -> usize {
    assert_eq!(rays.len(), expected.len());
    for isa in Isa::all() {
        for (ray, expected) in rays.iter().zip(expected) {
            let found = accel.closest_f32_at(isa, ray);
            assert_eq!(bits(&found), bits(expected), "{isa:?} {ray:?}: {found:?}, not {expected:?}");
            assert_eq!(accel.any_f32_at(isa, ray), expected.is_some(), "{isa:?} {ray:?}");
        }
    }
    check_batches(accel, rays, expected, sizes)
}

/// The closest hits of a batch, and whether there are hits; also with incoherent rays interleaved where they usually
/// are not.
pub(super) fn in_batch(
    accel: &Accel,
    isa: Isa,
    rays: &[Ray32],
    flies: bool,
) -> (Vec<Option<Hit32>>, Vec<bool>) {
    let mut hits = vec![Some(STALE); rays.len()];
    // What would be wrong everywhere.
    let mut met: Vec<bool> = rays.iter().map(|ray| !accel.any_f32(ray)).collect();
    if flies {
        batch::shims::f32(isa, &accel.tree, rays, &mut hits, &mut met);
    } else {
        accel.closest_batch_f32_at(isa, rays, &mut hits);
        accel.any_batch_f32_at(isa, rays, &mut met);
    }
    (hits, met)
}

/// The same in batches alone.
#[track_caller]
fn check_batches(accel: &Accel, rays: &[Ray32], expected: &[Option<Hit32>], sizes: &[usize]) -> usize {
    for isa in Isa::all() {
        for &size in sizes {
            for (rays, expected) in rays.chunks(size).zip(expected.chunks(size)) {
                for flies in [false, true] {
                    let (hits, met) = in_batch(accel, isa, rays, flies);
                    for (((ray, expected), hit), met) in rays.iter().zip(expected).zip(&hits).zip(met) {
                        assert_eq!(
                            bits(hit),
                            bits(expected),
                            "{isa:?} {size} {flies} {ray:?}: {hit:?}, not {expected:?}"
                        );
                        assert_eq!(met, expected.is_some(), "{isa:?} {size} {flies} {ray:?}");
                    }
                }
            }
        }
    }
    for (ray, expected) in rays.iter().zip(expected).take(100) {
        assert_eq!(bits(&accel.closest_f32(ray)), bits(expected), "{ray:?}");
        assert_eq!(accel.any_f32(ray), expected.is_some(), "{ray:?}");
    }
    expected.iter().flatten().count()
}

fn alone(accel: &Accel, rays: &[Ray32]) -> Vec<Option<Hit32>> {
    rays.iter().map(|ray| accel.closest_f32(ray)).collect()
}

/// Floors at heights that are exact, each cut up in two ways, and hills that are there twice, with corners in another
/// order.
fn sheets() -> [TriangleMesh; 2] {
    let mut floors = TriangleMesh::default();
    for floor in 0..9u8 {
        let y = f32::from(floor / 3) * 0.25 - 0.5;
        let first = floors.positions.len() as u32;
        let corners = [[-0.75, -0.5], [0.75, -0.5], [0.75, 0.5], [-0.75, 0.5]];
        floors.positions.extend(corners.map(|[x, z]| Vec3::new(x, y, z)));
        let [a, b, c, d] = [0, 1, 2, 3].map(|corner| first + corner);
        floors.indices.extend(if floor % 3 == 1 { [[b, c, d], [b, d, a]] } else { [[a, b, c], [a, c, d]] });
    }
    let mut hills = TriangleMesh::default();
    let side = 12;
    for place in 0..(side + 1) * (side + 1) {
        let [x, z] = [place % (side + 1), place / (side + 1)].map(|i| i as f32 / side as f32 - 0.5);
        hills.positions.push(Vec3::new(1.5 * x, 0.1 * (9.0 * x).sin() * (7.0 * z).cos(), 1.5 * z));
    }
    for row in 0..side {
        for column in 0..side {
            let a = row * (side + 1) + column;
            let (b, c, d) = (a + 1, a + side + 1, a + side + 2);
            hills.indices.extend([[a, c, b], [b, c, d], [d, b, c], [b, a, c]]);
        }
    }
    [floors, hills]
}

/// Triangles that are hardly any, with corners in a line or almost, or on one another; and some walls.
fn slivers(random: &mut Random) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for i in 0..360 {
        let first = mesh.positions.len() as u32;
        let (from, along) = (0.8 * random.vector(), random.vector());
        let across = random.vector() * [0.0, 1e-8, 1e-7, 1e-6, 1e-4, 0.3][i % 6];
        let third = [0.4, 1.0, 3e-5][random.below(3)];
        mesh.positions.extend([from, from + along, from + third * along + across].map(|p| p.as_vec3()));
        mesh.indices.push([first, first + 1, first + 2]);
        // Across an axis, all at one height.
        if i % 4 == 0 {
            let axis = random.below(3);
            let height = mesh.positions[first as usize][axis];
            mesh.positions[first as usize + 1][axis] = height;
            mesh.positions[first as usize + 2][axis] = height;
        }
    }
    mesh
}

/// Meshes of all sorts, about 1 in size; each list is of one tree.
fn meshes(random: &mut Random) -> Vec<(&'static str, Vec<TriangleMesh>)> {
    let near_zero = |mut mesh: TriangleMesh| {
        mesh.positions.iter_mut().for_each(|p| *p = (*p - Vec3::new(-0.7, 0.4, 1.1)) * 0.4);
        mesh
    };
    let [floors, hills] = sheets();
    vec![
        ("ball", vec![icosphere(2, DVec3::new(0.1, -0.2, 0.05), 0.8)]),
        (
            "rock and cube",
            vec![bumpy(2, DVec3::new(-0.1, 0.1, 0.0), 0.7), {
                let mut cube = cube();
                cube.positions.iter_mut().for_each(|p| *p = (*p - Vec3::new(1.5, 0.5, 4.5)) * 0.5);
                cube
            }],
        ),
        ("hoops of needles", vec![near_zero(torus(3, 60, 2.0, 0.01)), near_zero(torus(120, 3, 2.2, 0.02))]),
        ("soup", vec![soup(random, 500, DVec3::ZERO, 0.8)]),
        ("sheets", vec![hills.clone(), floors.clone(), floors, hills]),
        ("slivers", vec![slivers(random)]),
    ]
}

fn placed(mesh: &TriangleMesh, size: f64, origin: DVec3) -> TriangleMesh {
    let positions = mesh.positions.iter().map(|&p| p * size as f32).collect();
    TriangleMesh { origin, positions, indices: mesh.indices.clone() }
}

pub(super) fn kinds(meshes: &[TriangleMesh]) -> Vec<GeometryKind> {
    meshes.iter().map(|mesh| GeometryKind::Mesh(Arc::new(mesh.clone()))).collect()
}

/// A place on a triangle, relative to the mesh: a corner, in the middle of an edge, elsewhere on it, or within.
fn place(random: &mut Random, mesh: &TriangleMesh) -> DVec3 {
    let triangle = mesh.indices[random.below(mesh.indices.len())];
    let [a, b, c] = triangle.map(|i| mesh.positions[i as usize].as_dvec3());
    match random.below(5) {
        0 => a,
        1 => 0.5 * (b + c),
        2 => c.lerp(a, random.unit()),
        _ => {
            let (u, v) = (random.unit(), random.unit());
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            a + u * (b - a) + v * (c - a)
        }
    }
}

/// A ray at something: from without, from a surface, along an axis, with zeros of both signs, of any length and range.
fn ray(random: &mut Random, meshes: &[TriangleMesh], size: f64) -> Ray32 {
    let mesh = &meshes[random.below(meshes.len())];
    let other = &meshes[random.below(meshes.len())];
    let target = place(random, mesh);
    let axis = DVec3::AXES[random.below(3)] * size * [0.5, 1.0, -2.0][random.below(3)];
    let kind = random.below(8);
    let start = match kind {
        0 | 1 => place(random, other),
        2 | 3 => target - axis,
        4 => 9.0 * size * random.vector(),
        _ => 2.0 * size * random.vector(),
    };
    let origin = (mesh.origin + start).as_vec3();
    let mut direction = match kind {
        2 => axis.as_vec3(),
        // At the target as seen from where the ray starts, or from where it should.
        _ if random.unit() < 0.5 => (mesh.origin + target - origin.as_dvec3()).as_vec3(),
        _ => (target - start).as_vec3(),
    };
    if random.unit() < 0.1 {
        direction[random.below(3)] = [0.0, -0.0, 1e-40, f32::MIN_POSITIVE][random.below(4)];
    }
    let stretch = [1.0, 1.0, 0.03, 1e-4, 700.0][random.below(5)];
    let reach = 1.0 / stretch;
    let ranges = [(0.0, 1.0), (1e-6, 1.0 - 1e-6), (0.5, 2.0), (1.0, 1.0), (0.9, f32::INFINITY)];
    let ray = Ray32::new(origin, direction * stretch);
    match ranges.get(random.below(12)) {
        Some(&(t_min, t_max)) => ray.with_range(t_min * reach, t_max * reach),
        None => ray,
    }
}

const SIZES_AND_ORIGINS: [(f64, DVec3); 6] = [
    (1.0, DVec3::ZERO),
    (1e-3, DVec3::new(0.1, -0.07, 0.04)),
    (1e4, DVec3::new(3e4 + 0.1, -7e3, 1e-3)),
    (0.02, DVec3::new(20.000_000_1, 3.3, -14.7)),
    (3e-9, DVec3::ZERO),
    (2e7, DVec3::new(1.3, 2e7, 0.0)),
];

#[test]
fn the_tree_answers_as_the_plain_loop_in_single_precision_does() {
    let mut random = Random(701);
    for (size, origin) in SIZES_AND_ORIGINS {
        for (name, meshes) in meshes(&mut random) {
            let meshes: Vec<_> = meshes.iter().map(|mesh| placed(mesh, size, origin)).collect();
            let mut rays: Vec<_> = (0..1200).map(|_| ray(&mut random, &meshes, size)).collect();
            let tree = build(kinds(&meshes));
            // Again, where ranges begin and end with a hit, and just before and behind.
            for ray in rays.clone().into_iter().step_by(2) {
                let (Some(Hit32 { t, .. }), true) = by_reference(&tree, &ray) else { continue };
                let t = t.abs();
                rays.push(ray.with_range(t, t));
                rays.push(ray.with_range(t.next_up(), f32::INFINITY));
                rays.push(ray.with_range(0.0, t.next_down().max(0.0)));
            }
            let (expected, from_nearby): (Vec<_>, Vec<_>) =
                rays.iter().map(|ray| by_reference(&tree, ray)).unzip();
            let near = from_nearby.iter().filter(|&&is_near| is_near).count();
            assert!(near > rays.len() * 3 / 4, "{name}, {size}: {near} of {} are from nearby", rays.len());
            with_every_preset(|| {
                let hits = check(&build(kinds(&meshes)), &rays, &expected, &[rays.len()]);
                assert!(hits > rays.len() / 4, "{name}, {size}: {hits} hits of {}", rays.len());
            });
        }
    }
}

#[test]
fn of_triangles_in_one_place_the_first_in_the_lists_is_hit() {
    let [floors, hills] = sheets();
    let accel = build(kinds(&[hills.clone(), floors.clone(), floors, hills]));
    let mut random = Random(702);
    for _ in 0..500 {
        let (x, z) = (random.between(-0.7, 0.7), random.between(-0.45, 0.45));
        let ray = Ray32::new(DVec3::new(x, -3.0, z).as_vec3(), Vec3::new(0.01, 1.0, -0.02));
        let hit = accel.closest_f32(&ray).unwrap();
        // The lowest of the floors is there twice in the same triangles, and once in others, in either mesh.
        assert_eq!((hit.geometry, hit.id), (1, 1007), "{ray:?}");
        assert!(hit.primitive < 4 && (hit.t - 2.5).abs() < 1e-6, "{hit:?}");
    }
}

/// Sixteen rays as those of a square of pixels, or about as much alike: from one eye or some places near to each other,
/// to an eye, from surfaces, around an axis or a diagonal, where signs and the last axis change.
fn square(random: &mut Random, mesh: &TriangleMesh, size: f64) -> [Ray32; PACKET] {
    let kind = random.below(6);
    let middle = if kind == 0 { 0.2 * size * random.vector() } else { place(random, mesh) };
    let eye = match kind {
        1 => middle + size * DVec3::new(1.0, 1.0, 1.0),
        2 => middle + size * DVec3::new(0.0, 2.0, 0.0),
        _ => 3.0 * size * random.vector(),
    };
    let (right, up) = (eye - middle).normalize().any_orthonormal_pair();
    let width = size * [1e-4, 0.01, 0.1, 0.4][random.below(4)];
    let apart = size * [0.0, 0.0, 1e-6, 0.02][random.below(4)];
    let (is_back, range) = (random.unit() < 0.25, random.below(4));
    std::array::from_fn(|i| {
        let (x, y) = ((i % 4) as f64 - 1.5, (i / 4) as f64 - 1.5);
        let target = middle + width * (x * right + y * up);
        let from = eye + apart * random.vector();
        let (from, target) = if is_back { (target, from) } else { (from, target) };
        let ray = Ray32::new((mesh.origin + from).as_vec3(), (target - from).as_vec3());
        match range {
            0 => ray.with_range(0.0, 1.0 - 1e-4),
            1 => ray.with_range(random.between(0.0, 1.0) as f32, random.between(1.0, 2.0) as f32),
            _ => ray,
        }
    })
}

/// Rays that are answered in double precision, or not at all, otherwise as a good one.
fn odd_ones(good: Ray32) -> Vec<Ray32> {
    let (nan, infinity) = (f32::NAN, f32::INFINITY);
    let Ray32 { origin, direction, .. } = good;
    vec![
        Ray32 { origin: origin.with_y(nan), ..good },
        Ray32 { origin: origin.with_z(infinity), ..good },
        Ray32 { direction: direction.with_x(nan), ..good },
        Ray32 { direction: direction.with_y(-infinity), ..good },
        Ray32 { direction: Vec3::new(0.0, -0.0, 0.0), ..good },
        Ray32 { t_min: nan, ..good },
        Ray32 { t_max: nan, ..good },
        Ray32 { t_min: 2.0, t_max: 1.0, ..good },
        Ray32 { t_min: infinity, ..good },
        Ray32 { t_min: -1e3, ..good },
        Ray32 { t_min: -infinity, ..good },
        Ray32 { t_min: -0.0, ..good },
        Ray32 { t_max: -1.0, ..good },
        Ray32 { t_max: 0.0, ..good },
        Ray32 { origin: origin - 1e6 * direction, ..good },
        Ray32 { origin: origin.with_x(3e38), ..good },
        Ray32 { direction: -direction, ..good },
        Ray32 { direction: 1e-12 * direction, ..good },
        Ray32 { direction: 1e12 * direction, ..good },
        Ray32 { direction: 1e-40 * direction, ..good },
    ]
}

#[test]
fn batches_answer_as_single_rays_do() {
    let mut random = Random(703);
    for (size, origin) in SIZES_AND_ORIGINS {
        for (name, meshes) in meshes(&mut random) {
            let meshes: Vec<_> = meshes.iter().map(|mesh| placed(mesh, size, origin)).collect();
            let mut rays = Vec::new();
            for i in 0..repeats(150) {
                // Others in between, so that squares begin anywhere in a row of sixteen.
                rays.extend(square(&mut random, &meshes[i % meshes.len()], size));
                if i % 10 == 9 {
                    let others = 1 + 3 * i / 10;
                    rays.extend((0..others).map(|_| ray(&mut random, &meshes, size)));
                }
            }
            rays.truncate((rays.len() - 5) / PACKET * PACKET + 5);
            with_every_preset(|| {
                let accel = build(kinds(&meshes));
                let hits =
                    check_batches(&accel, &rays, &alone(&accel, &rays), &[1, 7, PACKET, 250, rays.len()]);
                assert!(hits > rays.len() / 10, "{name}, {size}: {hits} of {}", rays.len());
            });
        }
    }
}

#[test]
fn odd_rays_among_rays_that_go_together_are_answered_as_alone() {
    let rock = TriangleMesh { origin: DVec3::new(0.1, -0.3, 0.7), ..bumpy(3, DVec3::ZERO, 1.0) };
    let accel = build(kinds(&[rock]));
    let mut random = Random(704);
    let mut hits = 0;
    for apart in [0.0, 0.01] {
        let square: [Ray32; PACKET] = std::array::from_fn(|i| {
            let beside = 0.02 * DVec3::new((i % 4) as f64, (i / 4) as f64, 0.0);
            let from = DVec3::new(0.4, 0.2, 3.0) + apart * random.vector();
            Ray32::new(from.as_vec3(), (beside - DVec3::Z).as_vec3())
        });
        for lane in 0..PACKET {
            for odd in odd_ones(square[lane]) {
                let mut rays = square;
                rays[lane] = odd;
                hits += check(&accel, &rays, &alone(&accel, &rays), &[PACKET]);
                // No more than half of them go together.
                rays[(lane + 7) % PACKET..].iter_mut().step_by(3).for_each(|ray| *ray = odd);
                check_batches(&accel, &rays, &alone(&accel, &rays), &[PACKET]);
            }
        }
    }
    assert!(hits > 2 * 16 * 20 * 14, "{hits}");
}

#[test]
fn batches_without_rays_or_without_triangles_end() {
    let ray = Ray32::new(CENTER.as_vec3(), Vec3::new(0.3, 0.4, 0.5));
    for accel in [build(vec![]), build(kinds(&[cube()])), mixture(&mut Random(7), CENTER, 3.0, 1, true)] {
        for isa in Isa::all() {
            accel.closest_batch_f32_at(isa, &[], &mut []);
            accel.any_batch_f32_at(isa, &[], &mut []);
        }
        let rays = [ray; 33];
        check(
            &accel,
            &rays,
            &[accel.closest(&ray.to_f64()).map(|_| alone(&accel, &[ray])[0].unwrap()); 33],
            &[1, 9, 33],
        );
    }
}

#[test]
#[should_panic(expected = "a slot for the hit of every ray")]
fn a_batch_without_a_place_for_each_hit_is_refused() {
    build(vec![]).closest_batch_f32(&[Ray32::new(Vec3::ZERO, Vec3::X); 3], &mut [None; 2]);
}

#[test]
#[should_panic(expected = "a slot for the answer of every ray")]
fn a_batch_without_a_place_for_each_answer_is_refused() {
    build(vec![]).any_batch_f32(&[Ray32::new(Vec3::ZERO, Vec3::X); 3], &mut [false; 4]);
}

#[test]
fn batches_answer_as_single_rays_in_a_tree_beyond_caches() {
    let mut random = Random(705);
    let side = 640;
    let mut mesh = TriangleMesh { origin: DVec3::new(0.3, 0.2, -0.1), ..TriangleMesh::default() };
    for place in 0..(side + 1) * (side + 1) {
        let [x, z] = [place % (side + 1), place / (side + 1)].map(|i| i as f32 / side as f32 - 0.5);
        let y = 0.1 * (30.0 * x).sin() * (23.0 * z).cos() + 2e-3 * random.unit() as f32;
        mesh.positions.push(Vec3::new(2.0 * x, y, 2.0 * z));
    }
    for row in 0..side {
        for column in 0..side {
            let a = row * (side + 1) + column;
            let (b, c, d) = (a + 1, a + side + 1, a + side + 2);
            mesh.indices.extend([[a, c, b], [b, c, d]]);
        }
    }
    // Above the ground, and there twice.
    let soup = placed(&soup(&mut random, 600, DVec3::ZERO, 1.0), 1.0, mesh.origin);
    let meshes = [mesh, soup.clone(), soup];
    let geometries = kinds(&meshes).into_iter().zip(5..).map(|(kind, id)| Geometry { id, kind }).collect();
    let accel = Accel::build(geometries, &BuildOptions { preset: Preset::Fast }).unwrap();
    let tree = &accel.tree.packed;
    let bytes = size_of_val::<[Node]>(&tree.nodes) + size_of_val::<[Line]>(&tree.blocks);
    assert!(bytes >= 1 << 24, "{bytes} bytes are not far");

    let mut rays = Vec::new();
    let odd = odd_ones(Ray32::new(Vec3::new(0.3, 2.0, 0.1), Vec3::new(0.01, -1.0, 0.02)));
    for i in 0..160 {
        if i % 3 == 0 {
            rays.extend(square(&mut random, &meshes[i % 2], 1.0));
        } else {
            rays.extend((0..45).map(|_| ray(&mut random, &meshes[..2], 1.0)));
        }
        rays.push(odd[i % odd.len()]);
    }
    // Many that never set out, one after another.
    rays.extend(odd.iter().cycle().take(100));
    rays.extend((0..7).map(|_| ray(&mut random, &meshes, 1.0)));
    assert!(rays.len() > 4096 && !rays.len().is_multiple_of(PACKET), "{}", rays.len());
    let expected = alone(&accel, &rays);
    let hits = check(&accel, &rays, &expected, &[1, 5, 33, 1001, rays.len()]);
    assert!(hits > rays.len() / 3, "{hits} of {}", rays.len());
    for (ray, expected) in rays.iter().zip(&expected).step_by(rays.len() / repeats(rays.len() / 200)) {
        assert_eq!(bits(&by_reference(&accel, ray).0), bits(expected), "{ray:?}");
    }
}

#[test]
fn single_precision_hits_as_double_except_close_to_edges() {
    let mut random = Random(707);
    let meshes = [
        icosphere(4, DVec3::new(0.1, -0.2, 0.05), 1.0),
        bumpy(4, DVec3::new(-0.1, 0.1, 0.0), 1.0),
        torus(60, 30, 0.8, 0.3),
        soup(&mut random, 4000, DVec3::ZERO, 1.0),
    ];
    let (mut rays, mut hits, mut unlike, mut others, mut worst) = (0u32, 0u32, 0u32, 0u32, 0.0f64);
    for mesh in &meshes {
        for (size, origin) in [SIZES_AND_ORIGINS[0], SIZES_AND_ORIGINS[1], SIZES_AND_ORIGINS[2]] {
            let mesh = placed(mesh, size, origin);
            let center = origin
                + mesh.positions.iter().map(|p| p.as_dvec3()).sum::<DVec3>() / mesh.positions.len() as f64;
            let accel = build(kinds(&[mesh]));
            for _ in 0..40_000 {
                let from = center + size * [1.0, 3.0][random.below(2)] * random.vector();
                let to = center + size * random.vector();
                let ray = Ray32::new(from.as_vec3(), (to - from).as_vec3());
                let (single, double) = (accel.closest_f32(&ray), accel.closest(&ray.to_f64()));
                rays += 1;
                let (Some(single), Some(double)) = (&single, &double) else {
                    unlike += u32::from(single.is_some() != double.is_some());
                    continue;
                };
                hits += 1;
                let length = f64::from(ray.direction.length());
                let off = (f64::from(single.t) - double.root.t).abs() * length;
                if single.primitive == double.primitive {
                    worst = worst.max(off / (double.root.t * length + size));
                } else {
                    others += 1;
                }
            }
        }
    }
    assert!(hits > rays / 4, "{hits} of {rays}");
    // None, one and 8.1e-6 as measured, of 480,000 rays.
    assert!(unlike <= rays / 100_000, "{unlike} of {rays} are not alike");
    assert!(others <= rays / 100_000, "{others} of {rays} met another triangle");
    assert!(worst < 1e-5, "{worst}");
}

/// The nearest single precision to a ray for double precision.
fn rounded(ray: &Ray) -> Ray32 {
    Ray32::new(ray.origin.as_vec3(), ray.direction.as_vec3()).with_range(ray.t_min as f32, ray.t_max as f32)
}

#[test]
fn mixed_trees_answer_as_double_precision_rounded() {
    with_every_preset(|| {
        let mut random = Random(708);
        let ball = TriangleMesh { origin: CENTER, ..icosphere(2, DVec3::ZERO, 2.0) };
        let within = Arc::new(build(kinds(std::slice::from_ref(&ball))));
        let twice = Arc::new(build(vec![GeometryKind::Instance(
            within.instance(Transform::translate(DVec3::new(0.5, 0.25, -0.5))),
        )]));
        let instance = |accel: &Arc<Accel>| GeometryKind::Instance(accel.instance(Transform::IDENTITY));
        let cloud = scenes::cloud(&mut random, 60, DVec3::ZERO, CENTER, 3.0);
        let trees = [
            mixture(&mut random, CENTER, 3.0, 2, true),
            mixture(&mut random, CENTER, 3.0, 0, false),
            build(vec![GeometryKind::Mesh(cube().into()), instance(&twice), instance(&within)]),
            build(vec![GeometryKind::Spheres(Arc::new(cloud))]),
            build(vec![GeometryKind::PreciseMesh(Arc::new(precise(&ball)))]),
            // Of two origins.
            build(kinds(&[
                ball,
                TriangleMesh { origin: -CENTER, ..soup(&mut random, 200, DVec3::ZERO, 9.0) },
            ])),
        ];
        for (number, accel) in trees.iter().enumerate() {
            let mut rays: Vec<_> =
                (0..1000).map(|_| rounded(&scenes::ray(&mut random, CENTER, 3.0))).collect();
            let ball = icosphere(1, CENTER, 2.0);
            rays.extend((0..40).flat_map(|_| square(&mut random, &ball, 2.0)));
            rays.extend(odd_ones(Ray32::new(
                (CENTER + 9.0 * DVec3::Z).as_vec3(),
                Vec3::new(0.01, 0.02, -1.0),
            )));
            let expected: Vec<_> = rays.iter().map(|ray| widened(accel, ray)).collect();
            let hits = check(accel, &rays, &expected, &[1, PACKET, 37, rays.len()]);
            assert!(hits > rays.len() / 8, "{number}: {hits} of {}", rays.len());
            let instances = expected.iter().flatten().filter(|hit| hit.instance != Hit32::NO_INSTANCE);
            let has_instances =
                accel.tree.geometries.iter().any(|one| matches!(one.kind, GeometryKind::Instance(_)));
            assert_eq!(instances.count() > 20, has_instances, "{number}");
        }
        // The outermost has the name.
        let ray = Ray32::new((CENTER + 9.0 * DVec3::Z).as_vec3(), -Vec3::Z);
        let hit = build(vec![GeometryKind::Mesh(cube().into()), instance(&twice)]).closest_f32(&ray).unwrap();
        assert_eq!((hit.id, hit.instance, hit.geometry), (1000, 1007, 0));
    });
}

#[test]
fn an_unusable_ray_misses() {
    let meshes = build(kinds(&[cube()]));
    let all = mixture(&mut Random(3), CENTER, 3.0, 1, true);
    let good = Ray32::new(Vec3::new(1.25, 0.5, -7.0), Vec3::new(0.1, -0.03, 1.0));
    let nan = f32::NAN;
    let bad = [
        Ray32 { direction: Vec3::ZERO, ..good },
        Ray32 { direction: -Vec3::ZERO, ..good },
        Ray32 { direction: Vec3::new(0.0, nan, 1.0), ..good },
        Ray32 { direction: Vec3::new(0.0, f32::INFINITY, 1.0), ..good },
        Ray32 { origin: Vec3::new(nan, 0.5, -7.0), ..good },
        Ray32 { t_min: nan, ..good },
        Ray32 { t_max: nan, ..good },
        good.with_range(2.0, 1.0),
        good.with_range(f32::INFINITY, f32::INFINITY),
        good.with_range(0.0, -0.5),
    ];
    for accel in [meshes, all] {
        assert!(accel.any_f32(&good));
        assert_eq!(check(&accel, &bad, &[None; 10], &[1, 10]), 0);
        bad.iter().for_each(|&bad| assert_eq!(check(&accel, &[bad; 16], &[None; 16], &[16]), 0));
    }
}

#[test]
fn both_ends_of_the_range_count() {
    let accel = build(kinds(&[cube()]));
    let ray = Ray32::new(Vec3::new(1.25, 0.5, -7.0), Vec3::new(0.0, 0.0, 2.0));
    let behind = Ray32 { origin: Vec3::new(1.25, 0.5, 13.0), ..ray };
    let (infinity, near, far) = (f32::INFINITY, 5.0f32, 6.25f32);
    for (ray, t_min, t_max, t) in [
        (ray, 0.0, infinity, Some(near)),
        (ray, near, infinity, Some(near)),
        (ray, 0.0, near, Some(near)),
        (ray, near, near, Some(near)),
        (ray, near.next_up(), infinity, Some(far)),
        (ray, near.next_up(), far, Some(far)),
        (ray, far, f32::MAX, Some(far)),
        (ray, near.next_up(), far.next_down(), None),
        (ray, 0.0, near.next_down(), None),
        (ray, far.next_up(), infinity, None),
        // Behind where the ray starts.
        (behind, 0.0, infinity, None),
        (behind, -infinity, infinity, Some(-5.0)),
        (behind, -4.0, infinity, Some(-3.75)),
        (behind, -5.0, -3.0, Some(-5.0)),
        (behind, -4.9, -3.75, Some(-3.75)),
        (behind, -3.5, 1.0, None),
        (ray, -1.0, 5.5, Some(near)),
    ] {
        let ray = ray.with_range(t_min, t_max);
        assert_eq!(accel.closest_f32(&ray).map(|hit| hit.t), t, "{ray:?}");
        let expected = accel.closest_f32(&ray);
        check(&accel, &[ray; 16], &[expected; 16], &[1, 16]);
    }
}

#[test]
fn a_ray_from_afar_is_answered_in_double_precision() {
    let rock = TriangleMesh { origin: CENTER, ..bumpy(3, DVec3::ZERO, 1.5) };
    let accel = build(kinds(std::slice::from_ref(&rock)));
    let mut random = Random(709);
    let rays: Vec<_> = (0..500)
        .map(|i| {
            let from = CENTER + [200.0, 1e4, 1e8][i % 3] * random.vector().normalize();
            Ray32::new(
                from.as_vec3(),
                (CENTER + place(&mut random, &rock) - from.as_vec3().as_dvec3()).as_vec3(),
            )
        })
        .collect();
    let expected: Vec<_> = rays.iter().map(|ray| widened(&accel, ray)).collect();
    assert!(rays.iter().all(|ray| !by_reference(&accel, ray).1));
    let hits = check(&accel, &rays, &expected, &[16, 500]);
    assert!(hits > 300, "{hits}");
}

#[test]
fn a_tree_that_was_moved_answers_as_one_that_is_built_anew() {
    with_every_preset(|| {
        let mut random = Random(710);
        let rock = TriangleMesh { origin: CENTER, ..bumpy(3, DVec3::ZERO, 2.0) };
        let soup = TriangleMesh { origin: CENTER, ..soup(&mut random, 400, DVec3::ZERO, 2.0) };
        let mut accel = build(kinds(&[rock, soup]));
        for (center, extent) in [(CENTER, 3.0), (1e3 * CENTER, 200.0), (-CENTER, 1e-3)] {
            let geometries = moved(&accel, &mut random, center, extent);
            let meshes: Vec<_> = geometries
                .iter()
                .map(|one| match &one.kind {
                    GeometryKind::Mesh(mesh) => TriangleMesh::clone(mesh),
                    _ => unreachable!("nothing but meshes"),
                })
                .collect();
            let size = meshes[0].positions.iter().fold(0.0, |most: f32, p| most.max(p.length()));
            let mut rays: Vec<_> = (0..800).map(|_| ray(&mut random, &meshes, size.into())).collect();
            rays.extend((0..30).flat_map(|_| square(&mut random, &meshes[0], size.into())));
            accel.refit(geometries.clone()).unwrap();
            let fresh = Accel::build(geometries.clone(), &options()).unwrap();
            let expected = alone(&fresh, &rays);
            let hits = check(&accel, &rays, &expected, &[rays.len()]);
            assert!(hits > rays.len() / 3, "{hits} of {}", rays.len());
            accel.rebuild_partially(&options());
            check(&accel, &rays, &expected, &[rays.len()]);
            let again = Accel::from_bytes(&accel.to_bytes(), geometries).unwrap();
            check(&again, &rays, &expected, &[rays.len()]);
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("tree.lumbre");
            accel.save(&path).unwrap();
            let mapped = Accel::map(&path, accel.tree.geometries.clone()).unwrap();
            check(&mapped, &rays, &expected, &[rays.len()]);
        }
    });
}

#[test]
fn single_precision_differences_are_the_same_in_double() {
    // What `FilterStart::single_mesh_origin` relies on.
    let mut random = Random(131);
    let mut inexact = 0;
    for _ in 0..if cfg!(miri) { 1_000 } else { 1_000_000 } {
        let a = f32::from_bits(random.bits() as u32);
        // Of any size, or of about the same, and with few digits or all: halfway cases are among them.
        let b = match random.below(3) {
            0 => f32::from_bits(random.bits() as u32),
            1 => f32::from_bits(a.to_bits().wrapping_add((random.bits() as u32) << 20)),
            _ => f32::from_bits(
                (a.to_bits() ^ 1 << 31).wrapping_sub((random.below(40) as u32) << 23) & !0 << 12,
            ),
        };
        let wide = f64::from(a) - f64::from(b);
        inexact += usize::from(wide + f64::from(b) != f64::from(a));
        if a.is_finite() && b.is_finite() {
            assert_eq!((a - b).to_bits(), (wide as f32).to_bits(), "{a:e} {b:e}");
        }
    }
    assert!(inexact > 100, "{inexact}");
}

#[test]
fn what_is_precise_at_once_is_precise_by_its_extent() {
    type Numbers = <Portable as Simd>::F32x8;
    let mut random = Random(143);
    let (mut precise, mut others, rounds) = (0, 0, if cfg!(miri) { 200 } else { 50_000 });
    for _ in 0..rounds {
        let space_per_unit = 10f64.powf(random.between(-4.0, 4.0)) as f32;
        let side = space_per_unit * 10f64.powf(random.between(-4.0, 0.3)) as f32;
        let [mut products, mut z] = [[[0.0; 8]; 3]; 2];
        let [mut within, mut sum] = [[0.0; 8]; 2];
        for lane in 0..8 {
            let size = 10f64.powf(random.between(-3.0, 3.0));
            for corner in 0..3 {
                products[corner][lane] = (size * random.between(-1.0, 1.0)) as f32;
                z[corner][lane] = side * random.unit() as f32;
            }
            within[lane] = if random.below(16) == 0 { 0.0 } else { size as f32 };
            sum[lane] =
                (size * 10f64.powf(random.between(-2.0, 1.0)) * random.between(-1.0, 1.0).signum()) as f32;
        }
        let [products, z] = [products, z].map(|rows| rows.map(|row| Numbers::load(&row)));
        let (within, sum) = (Numbers::load(&within), Numbers::load(&sum));
        let largest = products[0].max_abs(products[1]).max_abs(products[2]);
        // Where triangles are of any size, nothing is at once.
        let [at_once, by_extent] = [side, f32::MAX].map(|longest_side| {
            Precise::new(space_per_unit, longest_side).of(0xff, largest, within, sum, z) & 0xff
        });
        assert_eq!(at_once, by_extent);
        (precise, others) = (precise + at_once.count_ones(), others + at_once.count_zeros() - 24);
    }
    assert!(precise > 2 * rounds && others > rounds, "{precise} {others}");
}

#[test]
fn the_longest_side_of_all_triangles_is_known() {
    let longest = |meshes: &[TriangleMesh]| {
        let corners = |mesh: &TriangleMesh, triangle: [u32; 3]| triangle.map(|i| mesh.positions[i as usize]);
        let side = |[a, b, c]: [Vec3; 3]| (a.max(b).max(c) - a.min(b).min(c)).max_element();
        let sides = meshes.iter().flat_map(|mesh| mesh.indices.iter().map(|&t| side(corners(mesh, t))));
        sides.fold(0.0, f32::max)
    };
    let meshes = sheets();
    let small = meshes.clone().map(|TriangleMesh { origin, positions, indices }| TriangleMesh {
        origin,
        positions: positions.into_iter().map(|p| 0.3 * p).collect(),
        indices,
    });
    let geometries = |meshes: &[TriangleMesh]| -> Vec<Geometry> {
        let mesh = |(id, mesh): (usize, &TriangleMesh)| Geometry {
            id: id as u32,
            kind: GeometryKind::Mesh(Arc::new(mesh.clone())),
        };
        meshes.iter().enumerate().map(mesh).collect()
    };
    let mut accel = Accel::build(geometries(&meshes), &BuildOptions::default()).unwrap();
    assert_eq!(accel.tree.summary.sizes.longest_side, longest(&meshes));
    let again = Accel::from_bytes(&accel.to_bytes(), geometries(&meshes)).unwrap();
    assert_eq!(again.tree.summary.sizes.longest_side, longest(&meshes));
    accel.refit(geometries(&small)).unwrap();
    assert_eq!(accel.tree.summary.sizes.longest_side, longest(&small));
}
