//! The proof in `triangles`, put to the test: the test of a block in single precision never loses what the one in
//! double precision hits, and is never certain of what that misses.
//!
//! Tried by hand: with a thirtieth of the error, or of the margin in z, this fails; with a third of the error it does
//! not, for roundings seldom all go one way.

use std::collections::BTreeSet;
use std::sync::Arc;

use lumbre_geometry::{PlacedShape, Ray, Sphere};
use lumbre_math::{DVec3, Transform, Vec3};

use super::scenes::{Random, soup};
use crate::build::pack;
use crate::intersect::f32_ray::F32Ray;
use crate::intersect::watertight::{BlockRay, Meeting, Shear, intersect};
use crate::intersect::{Isa, corners_at, equals_before_at, intersect_triangles_at, told_at, truncated_at};
use crate::tree::BLOCK;
use crate::tree::triangle_block::{BlockIds, Blocks, Line, TriangleBlock};
use crate::{Accel, BuildOptions, Geometry, GeometryKind, Preset, TriangleMesh};

struct Tally {
    hits: u32,
    kept: u32,
    sure: u32,
}

/// A block of triangles of about `size`, within `spread` of each other, at `center`, of whose corners about this many
/// are those of others; the last lane stays empty.
fn block(random: &mut Random, shares: f64, center: DVec3, spread: f64, size: f64) -> Vec<Line> {
    let mut mesh = TriangleMesh { origin: DVec3::ZERO, positions: Vec::new(), indices: Vec::new() };
    for lane in 0..BLOCK - 1 {
        let middle = center + spread * random.vector();
        let (along, across) = (size * random.vector(), size * random.vector());
        // A needle now and then, and one almost seen on edge.
        let across = if random.unit() < 0.2 { 1e-5 * across } else { across };
        let corners = [middle - along, middle + along + 0.3 * across, middle + across];
        let triangle = corners.map(|place| {
            if lane > 0 && random.unit() < shares {
                return random.below(mesh.positions.len()) as u32;
            }
            mesh.positions.push(place.as_vec3());
            mesh.positions.len() as u32 - 1
        });
        mesh.indices.push(triangle);
    }
    let ids: Vec<_> = (0..mesh.indices.len() as u32).map(|triangle| [0, triangle]).collect();
    let geometry = Geometry { id: 0, kind: GeometryKind::Mesh(Arc::new(mesh)) };
    pack::pack(Isa::best(), true, &[geometry], &[BlockIds::of(&ids)], &[0], true).lines
}

/// One ray at one block at every instruction set.
fn check(block: &TriangleBlock, ray: &Ray, mesh_origin: DVec3, tally: &mut Tally) {
    let shear = Shear::new(&ray.direction);
    let origin = shear.local_origin(&ray.origin, &mesh_origin);
    let largest =
        (0..BLOCK).flat_map(|lane| block.triangle(lane)).flatten().fold(0.0f32, |most, x| most.max(x.abs()));
    let blocks = BlockRay::new(&shear, &origin, largest, ray.t_min, ray.t_max);
    for isa in Isa::all() {
        let (mask, sure, between) = blocks
            .as_ref()
            .map_or((block.taken(), 0, [[f32::NEG_INFINITY, f32::INFINITY]; BLOCK]), |blocks| {
                intersect_triangles_at(isa, block, blocks)
            });
        for (lane, [from, to]) in between.into_iter().enumerate() {
            if block.taken() >> lane & 1 == 0 {
                assert_eq!((mask | sure) >> lane & 1, 0, "{isa:?} meets an empty lane of {block:?}");
                continue;
            }
            let meeting = intersect(ray, shear, origin, shear.axes.gather(block, lane));
            let is_hit = match meeting {
                Meeting::Miss => false,
                Meeting::Hit { .. } => true,
                Meeting::Touch { root, .. } => ray.contains(root.t),
            };
            if let Meeting::Hit { root, .. } = meeting {
                let height = root.t * shear.direction_z.abs();
                assert!(
                    !(height < f64::from(from) || height > f64::from(to)),
                    "{isa:?} places lane {lane} wrongly along {ray:?} of {block:?}: {height} from {from} to {to}"
                );
            }
            assert!(!is_hit || mask >> lane & 1 != 0, "{isa:?} loses lane {lane} along {ray:?} of {block:?}");
            assert!(
                is_hit || sure >> lane & 1 == 0,
                "{isa:?} invents lane {lane} along {ray:?} of {block:?}"
            );
            tally.hits += u32::from(is_hit);
        }
        tally.kept += mask.count_ones();
        tally.sure += sure.count_ones();
    }
}

const BLOCKS: usize = 1200;

/// Blocks of one kind, with rays from anywhere, often exactly at corners and edges, and with ranges that end there.
fn bombard(seed: u64, shares: &[f64], center: DVec3, spread: f64, size: f64, distance: f64) -> Tally {
    let mut random = Random(seed);
    let mut tally = Tally { hits: 0, kept: 0, sure: 0 };
    for round in 0..BLOCKS {
        let tree_space = block(&mut random, shares[round % shares.len()], center, spread, size);
        let block = Blocks::new(&tree_space).at(0).unwrap();
        for _ in 0..12 {
            let lane = random.below(BLOCK - 1);
            let corners = block.triangle(lane).map(|corner| Vec3::from_array(corner).as_dvec3());
            let target = match random.below(4) {
                0 => corners[random.below(3)],
                1 => corners[0].lerp(corners[1], [0.5, 0.25, random.unit()][random.below(3)]),
                _ => {
                    let (a, b) = (random.unit(), random.unit());
                    corners[0].lerp(corners[1], a).lerp(corners[2], b)
                }
            };
            let mut direction = random.vector();
            if random.unit() < 0.2 {
                direction = [DVec3::X, -DVec3::Y, DVec3::Z, DVec3::new(0.0, -1.0, 1.0)][random.below(4)];
            }
            let t = distance * random.unit();
            let (t_min, t_max) =
                [(0.0, f64::INFINITY), (0.0, t), (t, 2.0 * t), (f64::NEG_INFINITY, f64::INFINITY)]
                    [random.below(4)];
            let mesh_origin = if random.unit() < 0.5 { DVec3::ZERO } else { 3.0 * center };
            let ray = Ray::new(mesh_origin + target - t * direction, direction).with_range(t_min, t_max);
            check(block, &ray, mesh_origin, &mut tally);
        }
    }
    tally
}

#[test]
fn the_test_of_a_block_loses_nothing_and_invents_nothing() {
    let center = DVec3::new(1.5, -0.75, 2.25);
    for (seed, scale) in
        [(71, 1.0), (72, 1e-12), (73, 1e15), (74, 1e-19), (75, 1e22), (76, 1e-30), (78, 1e-13), (79, 1e-15)]
    {
        // Alike in size and distance; small; large and near; far away.
        for (spread, size, distance) in
            [(1.0, 1.0, 4.0), (0.3, 0.003, 5.0), (1.0, 30.0, 0.1), (1.0, 0.1, 1e5), (1.0, 1e-6, 3.0)]
        {
            let tally = bombard(
                seed,
                &[0.0, 0.4, 0.9],
                scale * center,
                scale * spread,
                scale * size,
                scale * distance,
            );
            assert!(tally.hits > 6000, "{}", tally.hits);
        }
    }
}

#[test]
fn two_rays_at_two_blocks_answer_as_each_alone() {
    let mut random = Random(81);
    let mut sharing = [0; 3];
    for _ in 0..600 {
        // Such as share many of their corners, and such as do not.
        let tree_space = [(); 2].map(|()| {
            let shares = [0.0, 0.0, 0.9][random.below(3)];
            block(&mut random, shares, DVec3::ZERO, 1.0, 0.5)
        });
        let blocks =
            [&tree_space[0], &tree_space[1]].map(|tree_space| Blocks::new(tree_space).at(0).unwrap());
        sharing[blocks.iter().filter(|block| !block.is_unshared()).count()] += 1;
        let rays = [(); 2].map(|()| {
            let (origin, direction) = (3.0 * random.vector(), random.vector());
            let shear = Shear::new(&direction);
            let local = shear.local_origin(&origin, &DVec3::ZERO);
            let f32_ray = F32Ray {
                axes: shear.axes,
                origin: [local[0] as f32, local[1] as f32, local[2] as f32, 0.0],
                shear: [shear.x as f32, shear.y as f32, 0.0, f32::INFINITY],
                minus_inverse: -1.0,
            };
            let t_max = random.between(0.5, 6.0);
            (BlockRay::new(&shear, &local, 3.0, 0.0, t_max).unwrap(), f32_ray)
        });
        for isa in Isa::all() {
            let [together, alone] = told_at(isa, blocks, [&rays[0].0, &rays[1].0], [&rays[0].1, &rays[1].1]);
            assert_eq!(together, alone, "{isa:?}");
        }
    }
    assert!(sharing.iter().all(|&pairs| pairs > 50), "{sharing:?}");
}

#[test]
fn the_test_of_a_block_is_sharp() {
    // Else it would prove nothing that it loses nothing.
    let center = DVec3::new(1.5, -0.75, 2.25);
    for size in [1.0, 0.1, 0.01] {
        let Tally { hits, kept, sure } = bombard(77, &[0.0], center, 1.0, size, 5.0);
        assert!(f64::from(kept) < 1.8 * f64::from(hits), "{kept} for {hits}");
        assert!(f64::from(sure) > 0.2 * f64::from(hits), "{sure} of {hits}");
    }
}

#[test]
fn a_ray_that_leaves_a_wall_is_seen_to_leave_it() {
    // As rays do that bounce: moved off the surface by a hundred-thousandth of the room. Of one in six, double
    // precision has to say so.
    let mut random = Random(80);
    let (mut dispatched, mut rays) = (0, 0);
    for _ in 0..200 {
        let center = 5.0 * random.vector();
        let normal = random.vector().normalize();
        let right = normal.cross(random.vector()).normalize() * random.between(1.0, 5.0);
        let up = normal.cross(right).normalize() * random.between(1.0, 5.0);
        let corner = |x: f64, y: f64| (center + x * right + y * up).as_vec3();
        let positions = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
        let wall = TriangleMesh { origin: DVec3::ZERO, positions, indices: vec![[0, 1, 2], [0, 2, 3]] };
        let geometry = Geometry { id: 0, kind: GeometryKind::Mesh(Arc::new(wall)) };
        let ids = [BlockIds::of(&[[0, 0], [0, 1]])];
        let lines = pack::pack(Isa::best(), true, &[geometry], &ids, &[0], true).lines;
        let block = Blocks::new(&lines).at(0).unwrap();
        for _ in 0..50 {
            let at = center + random.between(-1.0, 1.0) * right + random.between(-1.0, 1.0) * up;
            // By the cosine: a ball that touches the wall.
            let direction = normal + 0.999 * random.vector().normalize();
            let ray = Ray::new(at + 1e-4 * normal, direction);
            let shear = Shear::new(&ray.direction);
            let blocks =
                BlockRay::new(&shear, &shear.local_origin(&ray.origin, &DVec3::ZERO), 12.0, 0.0, 1e9);
            let (mask, sure, _) = intersect_triangles_at(Isa::best(), block, &blocks.unwrap());
            assert_eq!(sure, 0);
            (dispatched, rays) = (dispatched + u32::from(mask != 0), rays + 1);
        }
    }
    assert!(dispatched < rays / 4, "{dispatched} of {rays}");
}

/// Blocks of a grid, some of whose triangles have vertices of their own: a share of them.
fn grid(random: &mut Random, own: f64) -> Geometry {
    let mut mesh = TriangleMesh { origin: DVec3::ZERO, positions: Vec::new(), indices: Vec::new() };
    const SIDE: u32 = 24;
    let place = |i: u32, j: u32| Vec3::new(i as f32, j as f32, (7 * i + 3 * j) as f32 % 5.0);
    mesh.positions.extend((0..=SIDE).flat_map(|i| (0..=SIDE).map(move |j| place(i, j))));
    for i in 0..SIDE {
        for j in 0..SIDE {
            let vertex = |i: u32, j: u32| i * (SIDE + 1) + j;
            let [a, b, c, d] = [vertex(i, j), vertex(i, j + 1), vertex(i + 1, j + 1), vertex(i + 1, j)];
            for triangle in [[a, b, c], [a, c, d]] {
                let own = triangle.map(|vertex| {
                    if random.unit() >= own {
                        return vertex;
                    }
                    // Not in the same place, or it would be shared.
                    let nearby = mesh.positions[vertex as usize] + Vec3::splat(1e-3 * random.unit() as f32);
                    mesh.positions.push(nearby);
                    mesh.positions.len() as u32 - 1
                });
                mesh.indices.push(own);
            }
        }
    }
    Geometry { id: 0, kind: GeometryKind::Mesh(Arc::new(mesh)) }
}

#[test]
fn corners_are_compared_with_all_before_them_at_every_level() {
    let mut random = Random(83);
    for kinds in [1, 2, 5, 12, 24, 1000] {
        for _ in 0..200 {
            // Near the ends of the range as well, where a sign might be taken for one.
            let list: [u32; 3 * BLOCK] =
                std::array::from_fn(|_| (random.below(kinds) as u32).wrapping_sub(kinds as u32 / 2));
            let mut expected = [0; 3 * BLOCK];
            for at in 0..list.len() {
                for before in 0..at {
                    expected[at] |= u32::from(list[before] == list[at]) << before;
                }
            }
            for isa in Isa::all() {
                assert_eq!(equals_before_at(isa, &list), expected, "{isa:?}: {list:?}");
            }
        }
    }
}

#[test]
fn numbers_lose_what_stands_behind_the_point_at_every_level() {
    let mut random = Random(84);
    let below_the_end = 2.0f32.powi(31).next_down();
    let mut lists = vec![[0.0, -0.0, 0.99, -0.99, 1e-40, 8_388_608.5, below_the_end, -below_the_end]];
    lists.extend(
        (0..200).map(|i| std::array::from_fn(|_| ((2.0 * random.unit() - 1.0) * 2.0f64.powi(i % 31)) as f32)),
    );
    for numbers in lists {
        let expected = numbers.map(|number| f64::from(number).trunc() as i32);
        for isa in Isa::all() {
            assert_eq!(truncated_at(isa, &numbers), expected, "{isa:?}: {numbers:?}");
        }
    }
}

#[test]
fn a_block_has_its_triangles_corners_shared_or_not() {
    let mut random = Random(81);
    let mut kinds = BTreeSet::new();
    for own in [0.0, 0.15, 0.4, 1.0] {
        let geometry = grid(&mut random, own);
        let GeometryKind::Mesh(mesh) = geometry.kind.clone() else { unreachable!() };
        let accel = Accel::build(vec![geometry], &BuildOptions::default()).unwrap();
        let blocks = accel.tree.packed.blocks();
        let places = blocks.places(&accel.tree.packed.ids).unwrap();
        assert_eq!(places.len(), accel.tree.packed.ids.len());
        for (number, (&place, ids)) in places.iter().zip(&accel.tree.packed.ids).enumerate() {
            let block = blocks.at(place).unwrap();
            assert_eq!(block.number() as usize, number);
            assert_eq!(block.taken().count_ones() as usize, ids.primitives().count());
            kinds.insert(block.is_unshared());
            for (lane, primitive) in ids.primitives().enumerate() {
                let corners = mesh.indices[primitive as usize].map(|v| mesh.positions[v as usize].to_array());
                assert_eq!(block.triangle(lane), corners);
                for isa in Isa::all() {
                    let side_by_side = corners_at(isa, block);
                    let corner = |corner: usize| [0, 1, 2].map(|axis| side_by_side[axis][corner][lane]);
                    assert_eq!([corner(0), corner(1), corner(2)], corners, "{isa:?}");
                }
            }
        }
    }
    assert_eq!(kinds.into_iter().collect::<Vec<_>>(), [false, true]);
}

#[test]
fn triangles_are_ordered_so_that_they_share_vertices() {
    // A strip of eight, in any order, has ten vertices: six of either half, two of which are those of both.
    let mut random = Random(87);
    let positions = (0..10).map(|i| Vec3::new(i as f32, (i % 2) as f32, 0.0)).collect();
    let indices = (0..8).map(|i| [i, i + 1, i + 2]).collect();
    let mesh = Arc::new(TriangleMesh { origin: DVec3::ZERO, positions, indices });
    for len in 1..=8 {
        for _ in 0..50 {
            let mut triangles: Vec<u32> = (0..len).collect();
            for last in (1..triangles.len()).rev() {
                triangles.swap(last, random.below(last + 1));
            }
            let ids: Vec<_> = triangles.iter().map(|&triangle| [0, triangle]).collect();
            let ids = [BlockIds::of(&ids)];
            let geometries = [Geometry { id: 0, kind: GeometryKind::Mesh(Arc::clone(&mesh)) }];
            let filled = pack::pack(Isa::best(), true, &geometries, &ids, &[0], true);
            let block = Blocks::new(&filled.lines).at(0).unwrap();
            assert!(!block.is_unshared(), "{triangles:?}");
            let mut ids = ids;
            filled.orders[0].put(&mut ids[0]);
            assert!(Blocks::new(&filled.lines).places(&ids).is_some());
            let mut stand: Vec<_> = ids[0].primitives().collect();
            stand.sort_unstable();
            assert_eq!(stand, (0..len).collect::<Vec<_>>(), "{triangles:?}");
            for (lane, triangle) in ids[0].primitives().enumerate() {
                let corners = mesh.indices[triangle as usize].map(|v| mesh.positions[v as usize].to_array());
                assert_eq!(block.triangle(lane), corners);
            }
            // What stands in that order stays in it.
            let again = pack::pack(Isa::best(), true, &geometries, &ids, &[0], true);
            assert_eq!(again.lines, filled.lines);
        }
    }
}

#[test]
fn small_trees_of_triangles_alone_share_nothing() {
    let all = grid(&mut Random(88), 0.0);
    let GeometryKind::Mesh(mesh) = &all.kind else { unreachable!() };
    let indices = mesh.indices[..96].to_vec();
    let few = TriangleMesh { origin: mesh.origin, positions: mesh.positions.clone(), indices };
    let few = Geometry { id: 0, kind: GeometryKind::Mesh(Arc::new(few)) };
    let ball = PlacedShape::new(Sphere::new(DVec3::ZERO, 1.0).unwrap().into(), Transform::IDENTITY);
    let ball = Geometry { id: 1, kind: GeometryKind::Shape(ball) };
    let do_share = |geometries: Vec<Geometry>| {
        let accel = Accel::build(geometries, &BuildOptions::default()).unwrap();
        let places = accel.tree.packed.blocks().places(&accel.tree.packed.ids).unwrap();
        let sharing =
            places.iter().filter(|&&place| !accel.tree.packed.blocks().block(place).is_unshared()).count();
        assert!(sharing == 0 || 2 * sharing > places.len(), "{sharing} of {}", places.len());
        sharing != 0
    };
    assert!(!do_share(vec![few.clone()]));
    assert!(do_share(vec![few, ball]));
    assert!(do_share(vec![all]));
}

/// The same mesh where every triangle has vertices of its own: no two share one by name.
fn with_own_vertices(geometry: &Geometry) -> Geometry {
    let GeometryKind::Mesh(mesh) = &geometry.kind else { unreachable!() };
    let positions = mesh.indices.iter().flatten().map(|&v| mesh.positions[v as usize]).collect();
    let indices = (0..mesh.indices.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let mesh = TriangleMesh { origin: mesh.origin, positions, indices };
    Geometry { id: geometry.id, kind: GeometryKind::Mesh(Arc::new(mesh)) }
}

#[test]
fn unshared_rows_of_eight_stay_in_one_cache_line() {
    let mesh = Arc::new(soup(&mut Random(91), 100, DVec3::ZERO, 4.0));
    let geometry = Geometry { id: 0, kind: GeometryKind::Mesh(mesh) };
    let accel = Accel::build(vec![geometry], &BuildOptions::default()).unwrap();
    let places = accel.tree.packed.blocks().places(&accel.tree.packed.ids).unwrap();
    assert!(places.len() > 8);
    for place in places {
        let block = accel.tree.packed.blocks().block(place);
        assert!(block.is_unshared());
        for eight in block.own_corners().as_flattened() {
            let [first, last] = [&raw const eight[0], &raw const eight[BLOCK - 1]].map(|at| at.addr() / 64);
            assert_eq!(first, last);
        }
    }
}

#[test]
fn vertices_in_one_place_are_one_to_a_block() {
    let geometry = grid(&mut Random(84), 0.0);
    let apart = with_own_vertices(&geometry);
    let shared = Accel::build(vec![geometry], &BuildOptions::default()).unwrap();
    let apart = Accel::build(vec![apart], &BuildOptions::default()).unwrap();
    assert_eq!(*shared.tree.packed.blocks, *apart.tree.packed.blocks);
}

/// The same mesh with its vertices elsewhere.
fn with_positions(geometry: &Geometry, mut place: impl FnMut(usize, Vec3) -> Vec3) -> Geometry {
    let GeometryKind::Mesh(mesh) = &geometry.kind else { unreachable!() };
    let positions = mesh.positions.iter().enumerate().map(|(i, &p)| place(i, p)).collect();
    let mesh = TriangleMesh { origin: mesh.origin, positions, indices: mesh.indices.clone() };
    Geometry { id: geometry.id, kind: GeometryKind::Mesh(Arc::new(mesh)) }
}

#[test]
fn triangles_that_move_stand_where_packing_puts_them() {
    let mut random = Random(85);
    for own in [0.0, 0.15, 1.0] {
        let two = [grid(&mut random, own), grid(&mut random, 0.5 * own)];
        let [second, third] = [0, 1].map(|step| {
            // The second time, some are without an area.
            let bent = |i: usize, p: Vec3| {
                let is_flat = step == 0 && i.is_multiple_of(7);
                if is_flat { Vec3::new(3.0, 4.0, 5.0) } else { p + 2.0 * (p + i as f32).map(f32::sin) }
            };
            two.each_ref().map(|geometry| with_positions(geometry, bent)).to_vec()
        });
        for preset in [Preset::Fast, Preset::Balanced, Preset::Best] {
            let mut accel = Accel::build(two.to_vec(), &BuildOptions { preset }).unwrap();
            let first = accel.tree.packed.blocks.to_vec();
            for geometries in [&second, &third, &two.to_vec()] {
                accel.refit(geometries.clone()).unwrap();
                let again = Accel::from_bytes(&accel.to_bytes(), geometries.clone()).unwrap();
                assert_eq!(accel.tree.packed.ids.len(), again.tree.packed.ids.len());
                assert_eq!(
                    bytemuck::cast_slice::<_, u8>(&accel.tree.packed.nodes),
                    bytemuck::cast_slice::<_, u8>(&again.tree.packed.nodes)
                );
                assert_eq!(*accel.tree.packed.blocks, *again.tree.packed.blocks, "{preset:?}");
            }
            assert_eq!(*accel.tree.packed.blocks, first);
        }
    }
}

#[test]
fn triangles_that_come_apart_are_packed_again() {
    let mut random = Random(86);
    // Vertices of other names in the same places.
    let together = with_own_vertices(&grid(&mut random, 0.0));
    // One in the middle, by the least that there is; and all of them.
    let one = with_positions(&together, |i, p| if i == 901 { p.map(f32::next_up) } else { p });
    let all = with_positions(&together, |_, p| p + 0.1 * random.vector().as_vec3());
    for apart in [one, all] {
        let mut accel = Accel::build(vec![together.clone()], &BuildOptions::default()).unwrap();
        let first = accel.tree.packed.blocks.to_vec();
        let mut tree_space = first.clone();
        let mut put = |geometry: &Geometry| {
            let geometries = std::slice::from_ref(geometry);
            pack::move_triangles(accel.isa, geometries, &accel.tree.packed.ids, true, &mut tree_space)
        };
        assert!(!put(&apart));
        assert!(put(&together));
        assert_eq!(tree_space, first);

        accel.refit(vec![apart.clone()]).unwrap();
        let again = Accel::from_bytes(&accel.to_bytes(), vec![apart.clone()]).unwrap();
        assert_eq!(*accel.tree.packed.blocks, *again.tree.packed.blocks);
    }
}

#[test]
fn blocks_that_are_not_such_as_are_packed_are_told() {
    let mut random = Random(82);
    let accel = Accel::build(vec![grid(&mut random, 0.15)], &BuildOptions::default()).unwrap();
    let bytes: Vec<u8> = bytemuck::cast_slice(&accel.tree.packed.blocks).to_vec();
    let places = accel.tree.packed.blocks().places(&accel.tree.packed.ids).unwrap();
    let is_sound = |bytes: &[u8]| {
        let mut lines = vec![Line::default(); bytes.len() / 64];
        bytemuck::cast_slice_mut(&mut lines).copy_from_slice(bytes);
        Blocks::new(&lines).places(&accel.tree.packed.ids).is_some()
    };
    assert!(is_sound(&bytes));
    assert!(!is_sound(&bytes[..bytes.len() - 64]));
    assert!(!is_sound(&[&bytes[..], &[0; 64]].concat()));
    // In heads: the number, the layout, how many follow, and vertices of the other half of lanes, before the row and
    // behind it.
    for place in places {
        let at = 64 * place as usize;
        if accel.tree.packed.blocks().block(place).is_unshared() {
            continue;
        }
        for (byte, value) in [
            (60, bytes[at + 60] ^ 1),
            (1, 1),
            (1, 2),
            (2, 255),
            (3, 0),
            (64, bytes[at + 64] & 0xf0 | 4),
            (64, bytes[at + 64] & 0xf0),
            (67, bytes[at + 67] & 0xf0 | 8),
            (67, bytes[at + 67] | 15),
        ] {
            let mut other = bytes.clone();
            other[at + byte] = value;
            assert!(!is_sound(&other), "{place}: {byte}");
        }
    }
}

#[test]
fn refitted_triangles_may_share_other_vertices() {
    let mut random = Random(83);
    let shared = grid(&mut random, 0.0);
    let apart = grid(&mut random, 1.0);
    for (first, then) in [(&shared, &apart), (&apart, &shared)] {
        let mut accel = Accel::build(vec![first.clone()], &BuildOptions::default()).unwrap();
        let fresh = Accel::build(vec![then.clone()], &BuildOptions::default()).unwrap();
        accel.refit(vec![then.clone()]).unwrap();
        assert!(accel.tree.packed.blocks().places(&accel.tree.packed.ids).is_some());
        let unshared = |accel: &Accel| {
            let places = accel.tree.packed.blocks().places(&accel.tree.packed.ids).unwrap();
            places.iter().filter(|&&place| accel.tree.packed.blocks().block(place).is_unshared()).count()
        };
        assert_eq!(unshared(&accel) > 0, unshared(&fresh) > 0);
        for _ in 0..500 {
            let target = DVec3::new(random.between(0.0, 24.0), random.between(0.0, 24.0), 2.0);
            let ray = Ray::new(target + 30.0 * DVec3::Z, random.vector() - 2.0 * DVec3::Z);
            assert_eq!(accel.closest(&ray), fresh.closest(&ray));
        }
    }
}
