//! The proof in `triangles`, put to the test: the test of a block in single precision never loses what the one in double
//! precision hits, and is never certain of what that misses.
//!
//! Tried by hand: with a sixtieth of the error, or without the margin in z, this fails; with a sixth of the error it does not,
//! for roundings seldom all go one way.

use lumbre_geometry::Ray;
use lumbre_math::{DVec3, Vec3};

use super::scenes::Random;
use crate::lanes::{Level, meet_triangles_at};
use crate::triangles::{BLOCK, BlockRay, Meeting, Shear, TriangleBlock, intersect};

struct Tally {
    hits: u32,
    kept: u32,
    sure: u32,
}

/// A block of triangles of about `size`, within `spread` of each other, at `center`; the last lane stays empty.
fn block(random: &mut Random, center: DVec3, spread: f64, size: f64) -> TriangleBlock {
    let mut block = TriangleBlock::EMPTY;
    for lane in 0..BLOCK - 1 {
        let middle = center + spread * random.vector();
        let (along, across) = (size * random.vector(), size * random.vector());
        // A needle now and then, and one almost seen on edge.
        let across = if random.unit() < 0.2 { 1e-5 * across } else { across };
        let corners = [middle - along, middle + along + 0.3 * across, middle + across];
        for (corner, place) in corners.into_iter().enumerate() {
            for axis in 0..3 {
                block.corners[corner][axis][lane] = place[axis] as f32;
            }
        }
    }
    block
}

/// One ray at one block at every level.
fn check(block: &TriangleBlock, ray: &Ray, mesh_origin: DVec3, tally: &mut Tally) {
    let shear = Shear::new(&ray.direction);
    let origin = shear.local_origin(&ray.origin, &mesh_origin);
    let largest =
        block.corners.as_flattened().as_flattened().iter().fold(0.0f32, |most, x| most.max(x.abs()));
    let blocks = BlockRay::new(&shear, &origin, largest, ray.t_min, ray.t_max);
    for level in Level::all() {
        let (mask, sure, between) = blocks
            .as_ref()
            .map_or(((1 << BLOCK) - 1, 0, [[f32::NEG_INFINITY, f32::INFINITY]; BLOCK]), |blocks| {
                meet_triangles_at(level, block, blocks)
            });
        for (lane, [from, to]) in between.into_iter().enumerate() {
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
                    "{level:?} places lane {lane} wrongly along {ray:?} of {block:?}: {height} from {from} to {to}"
                );
            }
            assert!(
                !is_hit || mask >> lane & 1 != 0,
                "{level:?} loses lane {lane} along {ray:?} of {block:?}"
            );
            assert!(
                is_hit || sure >> lane & 1 == 0,
                "{level:?} invents lane {lane} along {ray:?} of {block:?}"
            );
            tally.hits += u32::from(is_hit);
        }
        tally.kept += mask.count_ones();
        tally.sure += sure.count_ones();
    }
}

/// Blocks of one kind, with rays from anywhere, often exactly at corners and edges, and with ranges that end there.
fn bombard(seed: u64, blocks: usize, center: DVec3, spread: f64, size: f64, distance: f64) -> Tally {
    let mut random = Random(seed);
    let mut tally = Tally { hits: 0, kept: 0, sure: 0 };
    for _ in 0..blocks {
        let block = block(&mut random, center, spread, size);
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
            check(&block, &ray, mesh_origin, &mut tally);
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
            let tally = bombard(seed, 500, scale * center, scale * spread, scale * size, scale * distance);
            assert!(tally.hits > 3000, "{}", tally.hits);
        }
    }
}

#[test]
fn the_test_of_a_block_is_sharp() {
    // Else it would prove nothing that it loses nothing.
    let center = DVec3::new(1.5, -0.75, 2.25);
    for size in [1.0, 0.1, 0.01] {
        let Tally { hits, kept, sure } = bombard(77, 2000, center, 1.0, size, 5.0);
        assert!(f64::from(kept) < 1.8 * f64::from(hits), "{kept} for {hits}");
        assert!(f64::from(sure) > 0.2 * f64::from(hits), "{sure} of {hits}");
    }
}
