//! Building: what is refused, what is left out, and that the tree is always the same.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex};

use lumbre_geometry::{Aabb, Ray, Root, Roots, Surface};
use lumbre_math::{DVec3, Transform, Vec3};

use super::scenes::{
    Balls, Random, build, cube, icosphere, mixture, options, ray, room, soup, with_every_preset,
};
use crate::tree::node::tag;
use crate::{Accel, BuildError, BuildOptions, CustomGeometry, Geometry, GeometryKind, Preset, TriangleMesh};

/// Custom geometry that is never hit, and records which threads ask for its boxes.
#[derive(Debug)]
struct DispatchedQuery {
    count: u32,
    by: Mutex<BTreeSet<String>>,
}

impl CustomGeometry for DispatchedQuery {
    fn primitive_count(&self) -> u32 {
        self.count
    }

    fn bounds(&self, primitive: u32) -> Option<Aabb> {
        self.by.lock().unwrap().insert(format!("{:?}", std::thread::current().id()));
        let low = DVec3::splat(primitive.into());
        Some(Aabb { min: low, max: low + DVec3::ONE })
    }

    fn closest(&self, _: u32, _: &Ray) -> Option<Root> {
        None
    }

    fn roots(&self, _: u32, _: &Ray, _: &mut Roots) {}

    fn surface(&self, _: u32, _: &Ray, _: &Root) -> Surface {
        unreachable!("nothing is met")
    }
}

#[test]
fn small_builds_run_on_the_caller_and_large_ones_on_the_pool() {
    let own = BTreeSet::from([format!("{:?}", std::thread::current().id())]);
    for (count, is_own) in [(100, true), (4096, true), (4097, false)] {
        let dispatched = Arc::new(DispatchedQuery { count, by: Mutex::default() });
        let accel = try_build(vec![GeometryKind::Custom(dispatched.clone())]).unwrap();
        assert_eq!(accel.primitive_count(), count as usize);
        assert_eq!(*dispatched.by.lock().unwrap() == own, is_own, "{count}");
    }
}

fn try_build(kinds: Vec<GeometryKind>) -> Result<Accel, BuildError> {
    let geometries = kinds.into_iter().map(|kind| Geometry { id: 5, kind }).collect();
    Accel::build(geometries, &BuildOptions::default())
}

#[test]
fn an_empty_tree_is_never_hit() {
    let accel = build(vec![]);
    let ray = Ray::new(DVec3::new(0.5, 1.0, 2.0), DVec3::new(1.0, -2.0, 0.5));
    assert_eq!(accel.closest(&ray), None);
    assert!(!accel.any(&ray));
    assert_eq!(accel.count(&ray), 0);
    assert!(accel.bounds().is_empty());
    assert_eq!(accel.primitive_count(), 0);

    let instance = accel.instance(Transform::translate(DVec3::splat(3.0)));
    let outer = build(vec![GeometryKind::Instance(instance), GeometryKind::Mesh(Arc::default())]);
    assert!(!outer.any(&ray));
    assert!(outer.bounds().is_empty());
}

#[test]
fn a_mesh_that_names_a_missing_vertex_is_refused_with_its_place() {
    let mut broken = cube();
    broken.indices[7][1] = 8;
    let result = try_build(vec![GeometryKind::Mesh(Arc::new(cube())), GeometryKind::Mesh(Arc::new(broken))]);
    assert_eq!(result.unwrap_err(), BuildError::VertexOutOfRange { geometry: 1, triangle: 7 });
}

#[test]
fn what_is_not_finite_is_refused_with_its_place() {
    for bad in [f32::NAN, f32::INFINITY] {
        let mut broken = cube();
        broken.positions[5].y = bad;
        let result = try_build(vec![GeometryKind::Mesh(Arc::new(broken))]);
        assert_eq!(result.unwrap_err(), BuildError::NotFinite { geometry: 0, element: 5 });
    }
    let moved = TriangleMesh { origin: DVec3::new(0.0, f64::NAN, 0.0), ..cube() };
    let result = try_build(vec![GeometryKind::Mesh(Arc::new(moved))]);
    assert_eq!(result.unwrap_err(), BuildError::NotFinite { geometry: 0, element: 0 });
    let balls = Balls { balls: vec![(DVec3::ONE, 2.0), (DVec3::new(2.0, f64::NAN, 1.0), 1.5)], floor: None };
    let result = try_build(vec![GeometryKind::Custom(Arc::new(balls))]);
    assert_eq!(result.unwrap_err(), BuildError::NotFinite { geometry: 0, element: 1 });
}

#[test]
fn triangles_without_area_are_left_out() {
    let mut mesh = cube();
    mesh.indices.push([3, 3, 5]);
    mesh.indices.push([2, 2, 2]);
    mesh.positions.extend([
        Vec3::new(9.0, 9.0, 9.0),
        Vec3::new(10.0, 11.0, 12.0),
        Vec3::new(11.0, 13.0, 15.0),
    ]);
    mesh.indices.push([8, 9, 10]);
    let accel = build(vec![GeometryKind::Mesh(Arc::new(mesh))]);
    assert_eq!(accel.primitive_count(), 12);
    assert_eq!(accel.bounds(), Aabb { min: DVec3::new(0.5, -1.0, 3.0), max: DVec3::new(3.0, 1.5, 5.5) });
    let ray = Ray::new(DVec3::new(10.0, 11.0, 0.0), DVec3::new(0.0, 0.0, 1.0));
    assert!(!accel.any(&ray));
}

#[test]
fn the_tree_is_the_same_from_any_number_of_threads() {
    with_every_preset(check_that_threads_make_no_difference);
}

fn check_that_threads_make_no_difference() {
    const ROOM: usize = 20_000;
    // Threads of a pool do not know this thread's.
    let options = options();
    let print = |threads: usize, triangles: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut random = Random(5);
            let kinds = if triangles == ROOM {
                [room(&mut random, ROOM / 200), cube()]
            } else {
                let soup = soup(&mut random, triangles, DVec3::new(1.0, 2.0, 3.0), 4.0);
                [soup, icosphere(4, DVec3::ONE, 2.0)]
            };
            let kinds = kinds.map(|mesh| GeometryKind::Mesh(Arc::new(mesh)));
            let geometries = kinds.map(|kind| Geometry { id: 3, kind }).to_vec();
            let accel = Accel::build(geometries, &options).unwrap();
            format!("{:?}", accel.tree.packed)
        })
    };
    // Of few, threads leave less to one; and of a room, upper nodes are put elsewhere.
    for triangles in [4_000, ROOM, 150_000] {
        let one = print(1, triangles);
        assert!(one.len() > 10 * triangles);
        for threads in [2, 5] {
            assert!(one == print(threads, triangles), "{threads} threads differ from one at {triangles}");
        }
    }
}

#[test]
fn reinserting_upper_nodes_keeps_answers() {
    let room = Arc::new(room(&mut Random(6), 60));
    let tree = |preset| {
        let geometries = vec![Geometry { id: 3, kind: GeometryKind::Mesh(Arc::clone(&room)) }];
        Accel::build(geometries, &BuildOptions { preset }).unwrap()
    };
    let (moved, plain) = (tree(Preset::Balanced), tree(Preset::Fast));
    let mut random = Random(7);
    let mut hits = 0;
    for _ in 0..4_000 {
        let ray = ray(&mut random, DVec3::ZERO, 1.0);
        assert_eq!(moved.closest(&ray), plain.closest(&ray), "{ray:?}");
        assert_eq!(moved.any(&ray), plain.any(&ray), "{ray:?}");
        assert_eq!(moved.count(&ray), plain.count(&ray), "{ray:?}");
        hits += usize::from(moved.any(&ray));
    }
    assert!((500..3_900).contains(&hits), "{hits}");
}

#[test]
fn identical_primitives_end_and_stay_shallow() {
    let one = cube();
    let positions = one.positions.clone();
    let indices = (0..1_000_000).map(|_| one.indices[3]).collect();
    let mesh = TriangleMesh { origin: one.origin, positions, indices };
    let accel = build(vec![GeometryKind::Mesh(Arc::new(mesh))]);
    assert_eq!(accel.primitive_count(), 1_000_000);
    assert!(depth(&accel) < 24, "{}", depth(&accel));
    let [a, b, c] = one.indices[3].map(|i| one.positions[i as usize].as_dvec3());
    let target = (a + b + c) / 3.0 + DVec3::new(0.01, 0.02, 0.03);
    let ray = Ray::new(DVec3::new(-5.0, 11.0, -7.0), target - DVec3::new(-5.0, 11.0, -7.0));
    let hit = accel.closest(&ray);
    assert_eq!(hit.map(|hit| hit.primitive), Some(0));
    assert_eq!(accel.count(&ray), 1_000_000);
}

fn depth(accel: &Accel) -> usize {
    let mut deepest = 0;
    let mut pending = vec![(accel.tree.packed.root.unwrap(), 1)];
    while let Some((reference, depth)) = pending.pop() {
        deepest = deepest.max(depth);
        if tag::is_inner(reference) {
            let node = &accel.tree.packed.nodes[reference as usize];
            pending.extend(node.children[..node.len()].iter().map(|&child| (child, depth + 1)));
        }
    }
    deepest
}

#[test]
fn sizes_that_shrink_without_end_stay_shallow() {
    // Each triangle 2/3 of the last: SAH would cut off one at a time.
    let mut positions = Vec::new();
    let mut indices = Vec::new();
    for i in 0..200 {
        let size = (2.0f32 / 3.0).powi(i);
        let base = positions.len() as u32;
        positions.extend([Vec3::X * size, Vec3::Y * size, Vec3::Z * size]);
        indices.push([base, base + 1, base + 2]);
    }
    let accel =
        build(vec![GeometryKind::Mesh(Arc::new(TriangleMesh { origin: DVec3::ONE, positions, indices }))]);
    assert!(depth(&accel) < 64 + 10, "{}", depth(&accel));
    // Those below 2^-52 of the ray's distance vanish in its arithmetic.
    let ray = Ray::new(DVec3::ONE + 2.0, -DVec3::ONE);
    assert!((80..100).contains(&accel.count(&ray)), "{}", accel.count(&ray));
}

#[test]
fn boxes_hold_their_children_and_every_primitive_has_one_place() {
    let mut random = Random(17);
    let accel = mixture(&mut random, DVec3::new(2.0, 3.0, -4.0), 3.0, 1, false);
    let packed: usize = accel
        .tree
        .geometries
        .iter()
        .map(|geometry| match &geometry.kind {
            GeometryKind::Mesh(mesh) => {
                let corners = |triangle: &[u32; 3]| triangle.map(|i| mesh.positions[i as usize].as_dvec3());
                let has_area = |&[a, b, c]: &[DVec3; 3]| (b - a).cross(c - a) != DVec3::ZERO;
                mesh.indices.iter().map(corners).filter(has_area).count()
            }
            GeometryKind::Spheres(cloud) => cloud.spheres.iter().filter(|sphere| sphere[3] > 0.0).count(),
            _ => 0,
        })
        .sum();
    let others = accel.tree.packed.entries.len();
    let in_blocks: usize = accel
        .tree
        .packed
        .ids
        .iter()
        .chain(&accel.tree.packed.sphere_ids)
        .map(|ids| ids.primitives.iter().filter(|&&primitive| primitive != u32::MAX).count())
        .sum();
    assert_eq!(in_blocks, packed);
    assert_eq!(in_blocks + others, accel.primitive_count());
    let mut places: Vec<_> = accel.tree.packed.entries.iter().map(|e| (e.geometry, e.primitive())).collect();
    places.sort_unstable();
    places.dedup();
    assert_eq!(places.len(), others);
    for node in &accel.tree.packed.nodes {
        for lane in 0..node.len() {
            let child = node.children[lane];
            if !tag::is_inner(child) {
                continue;
            }
            let child = &accel.tree.packed.nodes[child as usize];
            for axis in 0..3 {
                for inner in 0..child.len() {
                    assert!(node.planes[2 * axis][lane] <= child.planes[2 * axis][inner]);
                    assert!(node.planes[2 * axis + 1][lane] >= child.planes[2 * axis + 1][inner]);
                }
            }
        }
    }
}

#[test]
fn any_hit_asks_what_is_packed_first_and_instances_last() {
    let mut random = Random(18);
    let accel = mixture(&mut random, DVec3::new(2.0, 3.0, -4.0), 3.0, 1, false);
    // The first tag that is met below a reference, by the way of a search for any hit.
    let rank = |mut reference: u32| {
        while tag::is_inner(reference) {
            let node = &accel.tree.packed.nodes[reference as usize];
            reference = node.children[node.len() - 1];
        }
        match tag::of(reference) {
            tag::INSTANCE => 0,
            tag::TRIANGLES | tag::SPHERES => 2,
            _ => 1,
        }
    };
    let root = &accel.tree.packed.nodes[0];
    let ranks: Vec<u32> = root.children[..root.len()].iter().map(|&child| rank(child)).collect();
    assert!(ranks.is_sorted(), "{ranks:?}");
    assert_eq!(ranks.last(), Some(&2));
}

#[test]
fn a_million_million_leaves_fit_by_nesting() {
    // 40 levels of two: 2^40 cubes in a row along x, in kilobytes.
    let mut tree = Arc::new(build(vec![GeometryKind::Mesh(Arc::new(cube()))]));
    let mut bytes = tree.memory_bytes();
    for isa in 0..40 {
        let step = DVec3::new(4.0 * 2f64.powi(isa), 0.0, 0.0);
        let place = |offset| {
            let world_from_object = Transform::translate(offset);
            GeometryKind::Instance(tree.instance(world_from_object))
        };
        let next = build(vec![place(DVec3::ZERO), place(step)]);
        bytes += next.memory_bytes();
        tree = Arc::new(next);
    }
    assert!(bytes < 200_000, "{bytes}");
    // Down onto one far along the row.
    let n = 0x9a_5a5a_5a5au64;
    let ray = Ray::new(DVec3::new(4.0 * n as f64 + 1.5, 9.0, 4.5), DVec3::new(0.0, -1.0, 0.0));
    let hit = tree.closest(&ray).unwrap();
    assert_eq!(hit.root.t, 7.5);
    assert_eq!(hit.instances.len(), 40);
    let path = hit.route.iter().fold(0u64, |path, &bit| path << 1 | u64::from(bit));
    assert_eq!(path, n);
    assert_eq!(tree.count(&ray), 2);
    assert_eq!(tree.world_from_object(&ray, &hit).point(DVec3::ZERO).x, 4.0 * n as f64);
    let along = Ray::new(DVec3::new(-3.0, 0.3, 4.4), DVec3::X);
    let first = tree.closest(&along).unwrap();
    assert!((first.root.t - 3.5).abs() < 1e-12);
}

#[test]
fn instances_are_bounded_by_what_is_in_them() {
    let inner =
        Arc::new(build(vec![GeometryKind::Mesh(Arc::new(icosphere(3, DVec3::new(1.0, 2.0, 3.0), 2.0)))]));
    let map = Transform::rotate(DVec3::new(1.0, 1.0, 0.3), 45.0).unwrap();
    let outer = build(vec![GeometryKind::Instance(inner.instance(map))]);
    let center = map.point(DVec3::new(1.0, 2.0, 3.0));
    let exact = Aabb { min: center - 2.0, max: center + 2.0 };
    let ratio = outer.bounds().half_area() / exact.half_area();
    assert!(ratio < 1.6, "{ratio}");
    let ball = |p: &Vec3| outer.bounds().contains(map.point(p.as_dvec3()));
    let GeometryKind::Mesh(mesh) = &inner.tree.geometries[0].kind else { panic!("a mesh") };
    assert!(mesh.positions.iter().all(ball));
}

#[test]
fn references_keep_their_kind_and_their_place() {
    for kind in 0..16 {
        for place in [0, 5, tag::PLACE - 1, tag::PLACE] {
            let reference = tag::reference(kind, place);
            assert_eq!((tag::of(reference), tag::place(reference)), (kind, place as usize));
            assert_eq!(tag::is_inner(reference), kind == tag::INNER);
        }
    }
    let last = tag::BLOCK_PLACES - 1;
    for (count, blocks) in [(1, last as usize..last as usize + 1), (8, last as usize..last as usize + 8)] {
        for (leaf, kind) in
            [(tag::triangles(last, count), tag::TRIANGLES), (tag::spheres(last, count), tag::SPHERES)]
        {
            assert_eq!((tag::of(leaf), tag::blocks(leaf)), (kind, blocks.clone()));
        }
    }
}
