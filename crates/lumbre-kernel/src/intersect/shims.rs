//! Each operation at an instruction set, for tests.

use lumbre_geometry::Ray;
use lumbre_math::Transform;

use super::box_ray::{SlabRows, Slabs};
use super::boxes::{
    intersect_boxes, intersect_each, only_child, push_by_distance, put_and_take_as_built,
    put_and_take_by_distance,
};
use super::dispatch::Dispatch;
use super::f32_ray::F32Ray;
use super::isa::Isa;
use super::operations::{CornerScratch, Simd};
use super::slots::Slots;
use super::triangles::Edges;
use super::watertight::BlockRay;
use crate::ray32::Ray32;
use crate::simd::{F32x8, F32x16, LANES, Row, Vector};
use crate::tree::filter_start::FilterStart;
use crate::tree::node::{Node, WIDTH};
use crate::tree::triangle_block::TriangleBlock;
use crate::tree::{BLOCK, Corners};

/// [`Simd::start_filter`] and [`Simd::start_blocks`] at an instruction set, for tests.
pub(crate) fn start_filter_at(isa: Isa, start: &FilterStart, ray: &Ray) -> Option<(Slabs, BlockRay, f32)> {
    struct Starting<'a>(&'a FilterStart, &'a Ray);
    impl Dispatch for Starting<'_> {
        type Output = Option<(Slabs, BlockRay, f32)>;
        #[inline(always)]
        fn run<L: Simd>(self) -> Self::Output {
            let slabs = L::start_filter(self.0, self.1)?;
            let (blocks, place_per_height) = L::start_blocks(self.0, self.1, &slabs);
            Some((slabs, blocks, place_per_height))
        }
    }
    isa.run(Starting(start, ray))
}

/// [`Simd::read`] and [`Simd::read_f32`] at an instruction set, for tests.
pub(crate) fn read_at(isa: Isa, ray: &Ray, f32_ray: &Ray32) -> (Ray, Ray32) {
    struct Reading<'a>(&'a Ray, &'a Ray32);
    impl Dispatch for Reading<'_> {
        type Output = (Ray, Ray32);
        #[inline(always)]
        fn run<L: Simd>(self) -> Self::Output {
            (L::read(self.0), L::read_f32(self.1))
        }
    }
    isa.run(Reading(ray, f32_ray))
}

/// [`Simd::start_placed`] at an instruction set, for tests.
pub(crate) fn start_placed_at(
    isa: Isa,
    start: &FilterStart,
    map: &Transform,
    ray: &Ray,
    range: [f64; 2],
) -> (Ray, Option<Slabs>) {
    struct Starting<'a>(&'a FilterStart, &'a Transform, &'a Ray, [f64; 2]);
    impl Dispatch for Starting<'_> {
        type Output = (Ray, Option<Slabs>);
        #[inline(always)]
        fn run<L: Simd>(self) -> Self::Output {
            L::start_placed(self.0, self.1, self.2, self.3)
        }
    }
    isa.run(Starting(start, map, ray, range))
}

/// [`Simd::intersect_boxes`] at an instruction set, with where the ray enters each box, for tests.
pub(crate) fn intersect_boxes_at(isa: Isa, node: &Node, ray: &Slabs) -> (u32, [i32; WIDTH]) {
    struct Boxes<'a>(&'a Node, &'a Slabs);
    impl Dispatch for Boxes<'_> {
        type Output = (u32, [i32; WIDTH]);
        #[inline(always)]
        fn run<L: Simd>(self) -> Self::Output {
            // A child's reference is its lane here. The nearest child is never pushed, so it has no key.
            let mut node = *self.0;
            node.children = std::array::from_fn(|lane| lane as u32);
            let (mask, enter) = intersect_boxes::<L::F32x16>(&node, self.1);
            let mut by_lane = [i32::MAX; WIDTH];
            // On top of earlier entries: in the order of the node.
            let mut slots = Slots::new();
            slots.push(99);
            let mut taken = vec![put_and_take_as_built::<L::F32x16>(&node, mask, &mut slots)];
            taken.extend(std::iter::from_fn(|| slots.pop()));
            let met = (0..WIDTH as u32).filter(|lane| mask >> lane & 1 != 0);
            assert_eq!(taken, std::iter::once(99).chain(met).rev().collect::<Vec<_>>());
            if mask.count_ones() > 1 {
                let mut slots = Slots::new();
                let mut together = Slots::new();
                together.push(i64::MIN);
                let first = put_and_take_by_distance(&node, mask, enter, &mut together);
                let nearest = push_by_distance(&node, mask, enter, slots.room());
                assert_eq!(first, nearest);
                assert_eq!(slots.len() + 1, mask.count_ones() as usize);
                by_lane[nearest as usize] = i32::MIN;
                let mut last = i64::MIN;
                while let Some(entry) = slots.pop() {
                    assert_eq!(together.pop(), Some(entry), "the same, with fewer branches");
                    assert!(last < entry, "the nearest are on top");
                    last = entry;
                    by_lane[entry as usize % WIDTH] = (entry >> 32) as i32;
                }
            } else if mask != 0 {
                by_lane[only_child(&node, mask) as usize] = i32::MIN;
            }
            (mask, by_lane)
        }
    }
    isa.run(Boxes(node, ray))
}

/// A mask of children, and where the ray enters them.
type Entered = (u32, [f32; WIDTH]);

/// For some children at an instruction set, [`intersect_each`] for the live rays and [`intersect_boxes`] for each ray:
/// a mask, and where children are entered; for tests. All rays have the sides of the first.
pub(crate) fn intersect_each_at(
    isa: Isa,
    node: &Node,
    rays: &[Slabs; LANES],
    alive: u32,
    children: u32,
) -> (Entered, [Entered; LANES]) {
    struct Each<'a>(&'a Node, &'a [Slabs; LANES], u32, u32);
    impl Dispatch for Each<'_> {
        type Output = (Entered, [Entered; LANES]);
        #[inline(always)]
        fn run<L: Simd>(self) -> Self::Output {
            let Self(node, rays, alive, children) = self;
            let row = |number: &dyn Fn(&Slabs) -> f32| Row(std::array::from_fn(|i| number(&rays[i])));
            let rows = SlabRows {
                inverse: std::array::from_fn(|axis| row(&|ray| ray.inverse[axis])),
                near_offset: std::array::from_fn(|axis| row(&|ray| ray.near_offset[axis])),
                far_offset: std::array::from_fn(|axis| row(&|ray| ray.far_offset[axis])),
                s_min: row(&Slabs::s_min),
                s_max: row(&Slabs::s_max),
            };
            let mut enters = Row::of(0.0);
            let boxes = (children, L::F32x16::splat(-1.0));
            let (met, enter) = intersect_each::<L::F32x16>(node, &rows, rays[0].sides, boxes, alive, true);
            enter.store(&mut enters);
            let alone = std::array::from_fn(|i| {
                let mut enters = Row::of(0.0);
                let (met, enter) = intersect_boxes::<L::F32x16>(node, &rays[i]);
                enter.store(&mut enters);
                (met, enters.0)
            });
            ((met, enters.0), alone)
        }
    }
    isa.run(Each(node, rays, alive, children))
}

/// The triangles of a block that the ray may meet in its range and the ones that it certainly meets, at an instruction
/// set, with the interval of heights of each, for tests.
pub(crate) fn intersect_triangles_at(
    isa: Isa,
    block: &TriangleBlock,
    ray: &BlockRay,
) -> (u32, u32, [[f32; 2]; BLOCK]) {
    struct Triangles<'a>(&'a TriangleBlock, &'a BlockRay);
    impl Dispatch for Triangles<'_> {
        type Output = (u32, u32, [[f32; 2]; BLOCK]);
        #[inline(always)]
        fn run<L: Simd>(self) -> Self::Output {
            let (mask, edges) = L::intersect_triangles(self.0, self.1);
            let crossings = edges.place(self.1);
            let between = std::array::from_fn(|lane| <[f32; 2]>::from(crossings.between(lane)));
            (mask & crossings.in_range, mask & crossings.sure, between)
        }
    }
    isa.run(Triangles(block, ray))
}

/// The bits of a ray's test against a block, for lanes with a triangle: which triangles it may meet, which are in its
/// range, which it certainly meets, where, and their corners in single precision.
#[derive(Debug, PartialEq)]
pub(crate) struct TestedBlock {
    masks: [u32; 3],
    heights: [[u32; BLOCK]; 2],
    corners: [[[u32; BLOCK]; 3]; 3],
}

impl TestedBlock {
    #[inline(always)]
    fn of<L: Simd>(
        (block, ray): (&TriangleBlock, &BlockRay),
        (mask, edges): (u32, Edges<L::F32x8>),
        corners: [[L::F32x8; 3]; 3],
    ) -> Self {
        let taken = block.taken();
        let crossings = edges.place(ray);
        let mut told = Self {
            masks: [mask, mask & crossings.in_range, mask & crossings.sure],
            heights: [[0; BLOCK]; 2],
            corners: [[[0; BLOCK]; 3]; 3],
        };
        for lane in (0..BLOCK).filter(|lane| taken >> lane & 1 != 0) {
            let (from, to) = crossings.between(lane);
            (told.heights[0][lane], told.heights[1][lane]) = (from.to_bits(), to.to_bits());
            for (told, corners) in told.corners.iter_mut().zip(&corners) {
                for (told, corner) in told.iter_mut().zip(corners) {
                    told[lane] = corner.lane(lane).to_bits();
                }
            }
        }
        told
    }
}

/// The results of two rays, each with its own block, at an instruction set: tested together and one by one; for tests.
pub(crate) fn told_at(
    isa: Isa,
    blocks: [&TriangleBlock; 2],
    rays: [&BlockRay; 2],
    f32_ray: [&F32Ray; 2],
) -> [[TestedBlock; 2]; 2] {
    struct Telling<'a>([&'a TriangleBlock; 2], [&'a BlockRay; 2], [&'a F32Ray; 2]);
    impl Dispatch for Telling<'_> {
        type Output = [[TestedBlock; 2]; 2];
        #[inline(always)]
        fn run<L: Simd>(self) -> Self::Output {
            let Self(blocks, rays, f32_ray) = self;
            let (mask, edges) = L::intersect_triangles_by_two(blocks, rays);
            let [x, y, z] = L::sheared_corners_by_two(blocks, f32_ray);
            let one =
                |row: &[L::F32x16; 3], which| [row[0].half(which), row[1].half(which), row[2].half(which)];
            let together = |which: usize| {
                let of_one = (mask >> (BLOCK * which) & L::F32x8::ALL, edges.half(which));
                let corners = [one(&x, which), one(&y, which), one(&z, which)];
                TestedBlock::of::<L>((blocks[which], rays[which]), of_one, corners)
            };
            let alone = |which: usize| {
                let (block, ray) = (blocks[which], rays[which]);
                let corners = L::sheared_corners(block, f32_ray[which]);
                TestedBlock::of::<L>((block, ray), L::intersect_triangles(block, ray), corners)
            };
            [[together(0), together(1)], [alone(0), alone(1)]]
        }
    }
    isa.run(Telling(blocks, rays, f32_ray))
}

/// [`Simd::corners`] at an instruction set, for tests.
pub(crate) fn corners_at(isa: Isa, block: &TriangleBlock) -> Corners {
    struct Taking<'a>(&'a TriangleBlock);
    impl Dispatch for Taking<'_> {
        type Output = Corners;
        #[inline(always)]
        fn run<L: Simd>(self) -> Self::Output {
            *L::corners(self.0, &mut CornerScratch::new())
        }
    }
    isa.run(Taking(block))
}

/// [`Simd::equals_before`] at an instruction set, for tests.
pub(crate) fn equals_before_at(isa: Isa, list: &[u32; 3 * BLOCK]) -> [u32; 3 * BLOCK] {
    struct Comparing<'a>(&'a [u32; 3 * BLOCK]);
    impl Dispatch for Comparing<'_> {
        type Output = [u32; 3 * BLOCK];
        #[inline(always)]
        fn run<L: Simd>(self) -> Self::Output {
            L::equals_before(self.0)
        }
    }
    isa.run(Comparing(list))
}

/// [`Simd::truncated`] at an instruction set, for tests.
pub(crate) fn truncated_at(isa: Isa, numbers: &[f32; BLOCK]) -> [i32; BLOCK] {
    struct Truncating<'a>(&'a [f32; BLOCK]);
    impl Dispatch for Truncating<'_> {
        type Output = [i32; BLOCK];
        #[inline(always)]
        fn run<L: Simd>(self) -> Self::Output {
            L::truncated(self.0)
        }
    }
    isa.run(Truncating(numbers))
}
