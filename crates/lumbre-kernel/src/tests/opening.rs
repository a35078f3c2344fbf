//! Instances that the tree enters in several places: the same answers as of whole ones.

use std::ops::ControlFlow;
use std::sync::Arc;

use lumbre_geometry::{Aabb, PlacedShape, Ray, Sphere};
use lumbre_math::{AnimatedTransform, DVec3, Transform, Vec3};

use super::oracle::check;
use super::scenes::{
    Balls, Random, build, cube, icosphere, options, precise, ray, repeats, soup, vertex, with_every_preset,
};
use crate::build::open_instances::is_part;
use crate::tree::packed::Entry;
use crate::tree::packed::Start;
use crate::{
    Accel, BuildOptions, Geometry, GeometryKind, LoadError, MapError, Placement, Preset, Query, SphereCloud,
    TriangleMesh,
};

const CENTER: DVec3 = DVec3::new(1.5, -2.25, 4.0);
/// What is long is so long, and not at the origin.
const HALF: f64 = 2.75;
const MIDDLE: DVec3 = DVec3::new(0.75, -3.5, 2.0);

/// A closed square bar in many steps, along x.
fn bar(steps: u32) -> TriangleMesh {
    let mut positions = Vec::new();
    let mut indices = vec![[0, 2, 1], [0, 3, 2]];
    for step in 0..=steps {
        let x = HALF * (2.0 * f64::from(step) / f64::from(steps) - 1.0);
        for (y, z) in [(-0.09, -0.07), (0.09, -0.07), (0.09, 0.07), (-0.09, 0.07)] {
            positions.push(DVec3::new(x, y, z).as_vec3());
        }
        let at = |side: u32, step: u32| 4 * step + side % 4;
        for side in 0..4 * u32::from(step < steps) {
            let [a, b] = [at(side, step), at(side + 1, step)];
            indices.extend([[a, b, b + 4], [a, b + 4, a + 4]]);
        }
    }
    indices.extend([[4 * steps, 4 * steps + 1, 4 * steps + 2], [4 * steps, 4 * steps + 2, 4 * steps + 3]]);
    TriangleMesh { origin: MIDDLE, positions, indices }
}

/// A place on a line along x, or near it.
fn on_line(random: &mut Random) -> DVec3 {
    MIDDLE + DVec3::new(HALF, 0.1, 0.08) * random.vector()
}

/// Small things of one kind in a row.
fn rows(random: &mut Random) -> [Accel; 5] {
    let small = |random: &mut Random, count: usize| {
        let mut mesh = soup(random, count, MIDDLE, 0.2);
        for corners in mesh.positions.chunks_mut(3) {
            let x = random.between(-HALF, HALF) as f32;
            corners.iter_mut().for_each(|p| p.x += x);
        }
        mesh
    };
    let shapes = (0..3_000).map(|_| {
        let ball = Sphere::new(DVec3::ZERO, random.between(0.02, 0.1)).unwrap();
        GeometryKind::Shape(PlacedShape::new(ball.into(), Transform::translate(on_line(random))))
    });
    let shapes = shapes.collect();
    let spheres = (0..6_000).map(|_| {
        let p = (on_line(random) - MIDDLE).as_vec3();
        [p.x, p.y, p.z, random.between(0.01, 0.06) as f32]
    });
    let cloud = SphereCloud { origin: MIDDLE, spheres: spheres.collect() };
    let balls = (0..3_000).map(|_| (on_line(random), random.between(0.02, 0.1))).collect();
    [
        build(vec![GeometryKind::Mesh(Arc::new(small(random, 4_000)))]),
        build(vec![GeometryKind::PreciseMesh(Arc::new(precise(&small(random, 3_000))))]),
        build(shapes),
        build(vec![GeometryKind::Spheres(Arc::new(cloud))]),
        build(vec![GeometryKind::Custom(Arc::new(Balls { balls, floor: None }))]),
    ]
}

/// A turned, stretched and perhaps mirrored place for what is long.
fn slanted(random: &mut Random) -> Transform {
    random.placement(CENTER, 1.5, 0.8) * Transform::translate(-MIDDLE)
}

/// The same, turning and moving from the time 0 to 1.
fn motion(random: &mut Random) -> AnimatedTransform {
    let keys = [0.0, 1.0].map(|time| {
        let turn = Transform::rotate(random.vector(), random.between(-90.0, 90.0)).unwrap();
        let at = Transform::translate(CENTER + random.vector());
        (time, at * turn * Transform::translate(-MIDDLE))
    });
    AnimatedTransform::new(keys.to_vec()).unwrap()
}

fn place(accel: &Arc<Accel>, map: impl Into<Placement>) -> GeometryKind {
    GeometryKind::Instance(accel.instance(map))
}

fn scattered(random: &mut Random, trees: &[Arc<Accel>], count: usize) -> Accel {
    build((0..count).map(|i| place(&trees[i % trees.len()], slanted(random))).collect())
}

/// How many entries are parts, and how many instances they are of.
fn parts(accel: &Accel) -> (usize, usize) {
    let of = |entry: &&Entry| is_part(entry, &accel.tree.geometries);
    let mut ids: Vec<u32> = accel.tree.packed.entries.iter().filter(of).map(|entry| entry.geometry).collect();
    let count = ids.len();
    ids.sort_unstable();
    ids.dedup();
    (count, ids.len())
}

fn assert_opened(accel: &Accel) {
    let (parts, instances) = parts(accel);
    if options().preset == Preset::Fast {
        assert_eq!(parts, 0);
    } else {
        assert!(instances > 5 && parts > 3 * instances, "{parts} parts of {instances}");
    }
}

fn check_rays(accel: &Accel, random: &mut Random, long: usize) {
    let count = repeats(long);
    let hits: usize = (0..count).map(|_| check(accel, &ray(random, CENTER, 2.0))).sum();
    assert!(hits > count / 16, "only {hits} hits of {count} rays");
}

#[test]
fn opened_instances_are_found_as_by_a_loop() {
    with_every_preset(|| {
        let mut random = Random(301);
        let bars = [300, 500].map(|steps| Arc::new(build(vec![GeometryKind::Mesh(Arc::new(bar(steps)))])));
        let accel = scattered(&mut random, &bars, 16);
        assert_opened(&accel);
        assert_eq!(accel.primitive_count(), 16);
        check_rays(&accel, &mut random, 300);
        for row in rows(&mut random) {
            let row = Arc::new(row);
            let accel = scattered(&mut random, &[row, bars[1].clone()], 16);
            assert_opened(&accel);
            check_rays(&accel, &mut random, 80);
        }
    });
}

#[test]
fn parts_of_trees_with_instances_in_them_are_found_as_by_a_loop() {
    with_every_preset(|| {
        let mut random = Random(302);
        let bar = Arc::new(build(vec![GeometryKind::Mesh(Arc::new(bar(8)))]));
        let knots = (0..600).map(|_| {
            let turn = Transform::rotate(random.vector(), random.between(-90.0, 90.0)).unwrap();
            let map = Transform::translate(on_line(&mut random))
                * turn
                * Transform::scale(DVec3::splat(random.between(0.01, 0.03))).unwrap();
            place(&bar, map * Transform::translate(-MIDDLE))
        });
        let knots = knots.collect();
        let string = Arc::new(build(knots));
        let accel = scattered(&mut random, &[string], 20);
        assert_opened(&accel);
        check_rays(&accel, &mut random, 80);
    });
}

#[test]
fn long_triangles_in_opened_instances_are_found_as_by_a_loop() {
    with_every_preset(|| {
        let mut random = Random(303);
        let mut mesh = bar(24);
        mesh.indices.extend(bar(300).indices.iter().map(|t| t.map(|i| i + mesh.positions.len() as u32)));
        mesh.positions.extend(bar(300).positions.iter().map(|&p| p * Vec3::new(1.0, 0.9, 0.8)));
        let inner = Arc::new(build(vec![GeometryKind::Mesh(Arc::new(mesh))]));
        let accel = scattered(&mut random, &[inner], 20);
        assert_opened(&accel);
        check_rays(&accel, &mut random, 800);
    });
}

#[test]
fn lines_through_corners_of_opened_bars_cross_evenly() {
    with_every_preset(|| {
        let mut random = Random(304);
        let mesh = Arc::new(bar(300));
        let inner = Arc::new(build(vec![GeometryKind::Mesh(Arc::clone(&mesh))]));
        // Maps that keep the corners' bits, or nearly.
        let turn = |axis: DVec3| Transform::rotate(axis, 45.0).unwrap() * Transform::translate(-MIDDLE);
        let kinds = [DVec3::Z, DVec3::Y, DVec3::new(1.0, 1.0, 0.0)];
        let accel = build(kinds.iter().map(|&axis| place(&inner, turn(axis))).collect());
        if options().preset != Preset::Fast {
            assert!(parts(&accel).0 > 6, "{:?}", parts(&accel));
        }
        let mut crossings = 0;
        for i in 0..400 {
            let map = turn(kinds[i % 3]);
            let target = map.point(vertex(&mesh, random.below(mesh.positions.len()) as u32));
            let other = map.point(vertex(&mesh, random.below(mesh.positions.len()) as u32));
            let direction = if i % 2 == 0 { random.vector() } else { other - target };
            if direction == DVec3::ZERO {
                continue;
            }
            let line = Ray::new(target, direction).with_range(f64::NEG_INFINITY, f64::INFINITY);
            let count = check(&accel, &line);
            assert_eq!(count % 2, 0, "{line:?}");
            crossings += count;
        }
        assert!(crossings > 600, "{crossings}");
    });
}

#[test]
fn other_queries_answer_as_without_opening() {
    let mut random = Random(305);
    let fast = BuildOptions { preset: Preset::Fast };
    for (i, row) in rows(&mut random).into_iter().enumerate() {
        let mask = |i: usize| 1 << (i % 3);
        let count = row.tree.geometries.len();
        let inner = Arc::new(row.with_masks((0..count).map(mask).collect()));
        let bar = Arc::new(build(vec![GeometryKind::Mesh(Arc::new(bar(400)))]));
        let opened = scattered(&mut random, &[inner, bar], 18);
        assert!(parts(&opened).0 > 30);
        let masks = (0..18).map(|i| !mask(i)).collect::<Vec<_>>();
        let whole = Accel::build(opened.tree.geometries.clone(), &fast).unwrap().with_masks(masks.clone());
        assert_eq!(parts(&whole).0, 0);
        let opened = opened.with_masks(masks);
        let (mut inside, mut near) = (0, 0);
        for _ in 0..200 {
            let p = CENTER + 2.0 * random.vector();
            // Whether something without an answer may be nearer depends on the boxes.
            if let (Ok(nearest), Ok(expected)) =
                (opened.closest_point(p, f64::INFINITY), whole.closest_point(p, f64::INFINITY))
            {
                assert_eq!(nearest, expected);
                near += usize::from(nearest.is_some());
            }
            let p = Transform::point(
                &opened.tree.geometries[random.below(18)].kind.map_of_instance(),
                on_line(&mut random),
            );
            assert_eq!(opened.is_inside(p), whole.is_inside(p), "kind {i} {p}");
            inside += usize::from(opened.is_inside(p));
            let ray = ray(&mut random, CENTER, 2.0);
            let hit = opened.closest(&ray);
            for options in
                [Query { mask: 1, ..Query::new() }, Query { mask: 6, exclude: hit.as_ref(), ..Query::new() }]
            {
                assert_eq!(opened.closest_with(&ray, &options), whole.closest_with(&ray, &options));
                assert_eq!(opened.any_with(&ray, &options), whole.any_with(&ray, &options));
            }
        }
        assert!(inside > 20 && near > if i < 2 { 199 } else { 0 }, "kind {i}: {inside} inside, {near} near");
    }
}

impl GeometryKind {
    fn map_of_instance(&self) -> Transform {
        match self {
            Self::Instance(instance) => instance.world_from_object.at(0.0),
            _ => panic!("an instance"),
        }
    }
}

#[test]
fn only_what_gains_is_opened_and_only_so_far() {
    let mut random = Random(306);
    let long = Arc::new(build(vec![GeometryKind::Mesh(Arc::new(bar(3000)))]));
    let round = Arc::new(build(vec![GeometryKind::Mesh(Arc::new(icosphere(4, MIDDLE, 1.0)))]));
    // Along the axes, parts have as much area as the whole; balls have more.
    let stretch = Transform::scale(DVec3::new(0.9, 1.2, -0.8)).unwrap();
    let straight = build(vec![place(&long, stretch), place(&round, slanted(&mut random))]);
    assert_eq!(parts(&straight), (0, 0));
    // Nor is what moves.
    let moving = build(vec![place(&long, motion(&mut random))]);
    assert_eq!(parts(&moving), (0, 0));
    for count in [1, 9, 200] {
        let accel = scattered(&mut random, &[Arc::clone(&long)], count);
        let entries = accel.tree.packed.entries.len();
        assert!(entries >= 12 * count && entries <= 16 * count + 64, "{count} became {entries}");
    }
}

#[test]
fn instances_fill_their_nodes() {
    let mut random = Random(311);
    let bars = [Arc::new(build(vec![GeometryKind::Mesh(Arc::new(bar(400)))]))];
    for count in [1, 3, 8, 9, 700] {
        let accel = scattered(&mut random, &bars, count);
        let (nodes, entries) = (accel.tree.packed.nodes.len(), accel.tree.packed.entries.len());
        // A root, and nodes of eleven children in the mean.
        assert!(nodes - 1 <= entries / 10, "{nodes} nodes over {entries} entries");
        if count == 700 {
            check_rays(&accel, &mut random, 40);
        }
    }
}

#[test]
fn opened_trees_are_the_same_from_any_number_of_threads() {
    with_every_preset(|| {
        // Threads of a pool do not know this thread's.
        let options = options();
        let print = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let mut random = Random(307);
                let mesh = Geometry { id: 3, kind: GeometryKind::Mesh(Arc::new(bar(300))) };
                let bar = Arc::new(Accel::build(vec![mesh], &options).unwrap());
                let kinds = (0..3_000).map(|_| place(&bar, slanted(&mut random)));
                let geometries = kinds.map(|kind| Geometry { id: 9, kind }).collect();
                let accel = Accel::build(geometries, &options).unwrap();
                assert_eq!(parts(&accel).0 > 5_000, options.preset != Preset::Fast);
                format!("{:?}", accel.tree.packed)
            })
        };
        let one = print(1);
        assert!(one == print(2), "two threads differ from one");
        assert!(one == print(5), "five threads differ from one");
    });
}

/// The geometries with other trees in the instances.
fn with_tree(accel: &Accel, tree: &Arc<Accel>) -> Vec<Geometry> {
    let replaced = |geometry: &Geometry| {
        let map = geometry.kind.map_of_instance();
        Geometry { id: geometry.id, kind: place(tree, map) }
    };
    accel.tree.geometries.iter().map(replaced).collect()
}

#[test]
fn parts_follow_what_moves() {
    with_every_preset(|| {
        let mut random = Random(308);
        let inner = Arc::new(build(vec![GeometryKind::Mesh(Arc::new(bar(400)))]));
        let mut accel = scattered(&mut random, &[inner], 14);
        for _ in 0..2 {
            let mut geometries = accel.tree.geometries.clone();
            for geometry in &mut geometries {
                let GeometryKind::Instance(instance) = &mut geometry.kind else { panic!() };
                instance.world_from_object = slanted(&mut random).into();
            }
            accel.refit(geometries).unwrap();
            assert_opened(&accel);
            check_rays(&accel, &mut random, 150);
        }
        // One begins to move.
        let mut geometries = accel.tree.geometries.clone();
        let GeometryKind::Instance(instance) = &mut geometries[3].kind else { panic!() };
        instance.world_from_object = motion(&mut random).into();
        accel.refit(geometries).unwrap();
        let (mut hits, count) = (0, repeats(200));
        for _ in 0..count {
            let time = random.between(-0.2, 1.2);
            hits += check(&accel, &ray(&mut random, CENTER, 2.0).at_time(time));
        }
        assert!(hits > count / 8, "{hits}");
    });
}

#[test]
fn parts_follow_their_tree_and_stand_for_another_as_a_whole() {
    with_every_preset(|| {
        let mut random = Random(309);
        let mesh = bar(400);
        let mut inner = Arc::new(build(vec![GeometryKind::Mesh(Arc::new(mesh.clone()))]));
        let mut accel = scattered(&mut random, &[inner.clone()], 14);
        let before = format!("{:?}", accel.tree.packed);
        // The outer tree lets go of it: for another, for a tiny one, for one of nothing.
        let others = [
            build(vec![GeometryKind::Mesh(Arc::new(soup(&mut random, 700, MIDDLE, 1.0)))]),
            build(vec![GeometryKind::Mesh(Arc::new(cube()))]),
            build(vec![]),
        ];
        for other in others {
            let is_empty = other.primitive_count() == 0;
            accel.refit(with_tree(&accel, &Arc::new(other))).unwrap();
            if is_empty {
                assert_eq!((0..99).map(|_| check(&accel, &ray(&mut random, CENTER, 2.0))).sum::<usize>(), 0);
                assert_eq!(accel.closest_point(CENTER, f64::INFINITY), Ok(None));
            } else {
                check_rays(&accel, &mut random, 100);
            }
            let loaded = Accel::from_bytes(&accel.to_bytes(), accel.tree.geometries.clone()).unwrap();
            assert_eq!(format!("{:?}", loaded.tree.packed), format!("{:?}", accel.tree.packed));
        }
        accel.refit(with_tree(&accel, &inner)).unwrap();
        assert_eq!(format!("{:?}", accel.tree.packed), before);
        // What is in it moves.
        accel.refit(with_tree(&accel, &Arc::new(build(vec![])))).unwrap();
        let bend = |p: &Vec3| *p + Vec3::new(0.0, 0.4 * (2.0 * p.x).sin(), 0.1 * p.x);
        let bent = TriangleMesh { positions: mesh.positions.iter().map(bend).collect(), ..mesh.clone() };
        let geometries = vec![Geometry { id: 1000, kind: GeometryKind::Mesh(Arc::new(bent)) }];
        Arc::get_mut(&mut inner).expect("nobody else holds it").refit(geometries).unwrap();
        accel.refit(with_tree(&accel, &inner)).unwrap();
        assert_opened(&accel);
        check_rays(&accel, &mut random, 600);
        // A half of it vanishes, so that there may be no parts any more.
        accel.refit(with_tree(&accel, &Arc::new(build(vec![])))).unwrap();
        let flat = |p: &Vec3| if p.x > 0.0 { Vec3::ZERO } else { *p };
        let half = TriangleMesh { positions: mesh.positions.iter().map(flat).collect(), ..mesh.clone() };
        let geometries = vec![Geometry { id: 1000, kind: GeometryKind::Mesh(Arc::new(half)) }];
        Arc::get_mut(&mut inner).expect("nobody else holds it").refit(geometries).unwrap();
        accel.refit(with_tree(&accel, &inner)).unwrap();
        check_rays(&accel, &mut random, 600);
    });
}

#[test]
fn opened_trees_are_saved_and_mapped() {
    with_every_preset(|| {
        let mut random = Random(310);
        let inner = Arc::new(build(vec![GeometryKind::Mesh(Arc::new(bar(400)))]));
        let accel = scattered(&mut random, &[inner], 14);
        assert_opened(&accel);
        let loaded = Accel::from_bytes(&accel.to_bytes(), accel.tree.geometries.clone()).unwrap();
        assert_eq!(format!("{loaded:?}"), format!("{accel:?}"));
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("tree");
        accel.save(&path).unwrap();
        let mapped = Accel::map(&path, accel.tree.geometries.clone()).unwrap();
        assert_eq!(format!("{mapped:?}"), format!("{accel:?}"));
        check_rays(&mapped, &mut random, 100);

        // Over trees that are put together otherwise, or have moved within the same box.
        let fast = Accel::build(
            vec![Geometry { id: 1000, kind: GeometryKind::Mesh(Arc::new(bar(400))) }],
            &BuildOptions { preset: Preset::Fast },
        );
        let mut wavy = bar(400);
        for p in &mut wavy.positions[280..1_400] {
            p.y *= 0.5;
        }
        let mut moved = build(vec![GeometryKind::Mesh(Arc::new(bar(400)))]);
        let geometries = vec![Geometry { id: 1000, kind: GeometryKind::Mesh(Arc::new(wavy)) }];
        moved.refit(geometries).unwrap();
        for other in [fast.unwrap(), moved] {
            let geometries = with_tree(&accel, &Arc::new(other));
            let loaded = Accel::from_bytes(&accel.to_bytes(), geometries.clone()).unwrap();
            check_rays(&loaded, &mut random, 80);
            match Accel::map(&path, geometries) {
                Err(MapError::Load(LoadError::Moved)) => {}
                // Nothing is known of the inside of what is not opened.
                Ok(mapped) => {
                    assert_eq!(parts(&mapped).0, 0);
                    check_rays(&mapped, &mut random, 80);
                }
                Err(other) => panic!("{other}"),
            }
        }
    });
}

#[test]
fn hostile_parts_are_refused_or_stand_for_the_whole() {
    let mut random = Random(311);
    let inner = Arc::new(build(vec![GeometryKind::Mesh(Arc::new(bar(400)))]));
    let nodes = inner.tree.packed.nodes.len();
    let mut accel = scattered(&mut random, &[inner], 9);
    let whole = accel.tree.packed.entries.to_vec();
    assert!(parts(&accel).0 > 40 && nodes > 20);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tree");
    let (mut refused, mut stand_in) = (0, 0);
    for _ in 0..400 {
        let mut entries = whole.clone();
        for _ in 0..1 + random.below(3) {
            let (place, other) = (random.below(entries.len()), random.below(entries.len()));
            let old = entries[place];
            let word = match random.below(6) {
                0 => random.below(nodes + 3) as u32,
                1 => random.bits() as u32 & (u32::MAX >> 1),
                2 => entries[other].primitive(),
                3 => old.primitive() | 1 << 29,
                4 => old.primitive() | 1 << 30,
                _ => 0,
            };
            let geometry = if random.unit() < 0.3 { entries[other].geometry } else { old.geometry };
            entries[place] = Entry::new(geometry, word, true);
        }
        let is_same = entries.iter().zip(&whole).all(|(a, b)| a.to_words() == b.to_words());
        Arc::make_mut(&mut accel.tree).packed.entries = entries.into();
        match Accel::from_bytes(&accel.to_bytes(), accel.tree.geometries.clone()) {
            Ok(loaded) => {
                let starts = loaded.tree.packed.entries.iter().map(|entry| Start::of(entry.primitive()));
                stand_in += usize::from(starts.into_iter().any(Start::is_nothing));
                (0..4).for_each(|_| {
                    check(&loaded, &ray(&mut random, CENTER, 2.0));
                });
                let _ = loaded.closest_point(CENTER, 1.0);
            }
            Err(error) => {
                assert!(!is_same, "{error}");
                refused += 1;
            }
        }
        if accel.save(&path).is_ok() {
            let mapped = Accel::map(&path, accel.tree.geometries.clone());
            assert_eq!(mapped.is_ok(), is_same);
        }
    }
    assert!(refused > 30 && stand_in > 100, "{refused} refused, {stand_in} stand for the whole");
}

#[test]
fn all_ends_where_it_is_told_and_boxes_hold_the_parts() {
    let mut random = Random(312);
    let inner = Arc::new(build(vec![GeometryKind::Mesh(Arc::new(bar(400)))]));
    let accel = scattered(&mut random, &[inner], 60);
    let mut most = 0;
    for _ in 0..300 {
        let ray = ray(&mut random, CENTER, 2.0);
        let mut hits = Vec::new();
        accel.all(&ray, |hit| {
            hits.push(hit.clone());
            if hits.len() == 3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        assert!(hits.len() <= 3 && hits.is_sorted_by(|a, b| a.root.t <= b.root.t));
        most = most.max(hits.len());
        for hit in &hits {
            let Aabb { min, max } = accel.bounds().outward(2);
            assert!(Aabb { min: min - 1e-9, max: max + 1e-9 }.contains(ray.at(hit.root.t)));
        }
    }
    assert_eq!(most, 3);
}
