//! What a search does many at a time, for each instruction set.

use bytemuck::Zeroable;
use lumbre_geometry::Ray;
use lumbre_math::Transform;

use super::axes::Axes;
use super::box_ray::{BoxRay, Slabs};
use super::f32_ray::F32Ray;
use super::isa::Isa;
use super::watertight::{BlockRay, EdgeTest, Inside, Shear};
use crate::ray32::Ray32;
use crate::simd::{F32x8, F32x16, Row, WIDE, three_of_two};
use crate::tree::filter_start::FilterStart;
use crate::tree::node::TreeSpace;
use crate::tree::triangle_block::TriangleBlock;
use crate::tree::{BLOCK, Corners};

/// What a search does many at a time: boxes by sixteen, and triangles by eight.
pub(crate) trait Simd {
    /// Eight numbers.
    type F32x8: F32x8;
    /// How a line passes the edges of eight triangles.
    type Edges: Copy + Zeroable;
    /// The same of two lines, each with its block.
    type EdgesByTwo: Copy + Zeroable;
    /// Sixteen numbers, alike.
    type F32x16: F32x16<Half = Self::F32x8>;
    /// Whether two rays, each at a block of its own, are better met together than one after the other.
    const INTERSECTS_BY_TWO: bool = false;
    /// Whether rays in single precision are better started by four than one after the other.
    const STARTS_BY_FOUR: bool = false;
    /// Whether rays go on together for a while where that no longer pays, for what they have done: see `packet`.
    const GOES_ON_TOGETHER: bool = true;

    /// The instruction set that these are of.
    fn isa() -> Isa;

    /// Makes `boxes` the ray from `t_min` to `t_max` for a tree in these units, if it is one from nearby, which it answers;
    /// also checks that it is sound.
    fn start_nearby(tree_space: &TreeSpace, ray: &Ray, t_min: f64, t_max: f64, boxes: &mut BoxRay) -> bool;

    /// The ray for boxes in single precision; `None` where it does not come from nearby, or is not sound.
    fn start_filter(start: &FilterStart, ray: &Ray) -> Option<Slabs>;

    /// The ray in the space of what a map places, with another range, and for boxes there: see [`Ray::into_object`].
    #[inline(always)]
    fn start_placed(
        start: &FilterStart,
        map: &Transform,
        ray: &Ray,
        [t_min, t_max]: [f64; 2],
    ) -> (Ray, Option<Slabs>) {
        let ray = ray.into_object(map).with_range(t_min, t_max);
        (ray, Self::start_filter(start, &ray))
    }

    /// The same ray for triangles, and from heights along it to places in the range of boxes.
    fn start_blocks(start: &FilterStart, ray: &Ray, slabs: &Slabs) -> (BlockRay, f32);

    /// A ray as it can be read in wide pieces at once, though it may have been written number by number just now: what is read so would
    /// wait until that is out of sight, and with it the rays one for another.
    #[inline(always)]
    fn read(ray: &Ray) -> Ray {
        *ray
    }

    /// The same in single precision.
    #[inline(always)]
    fn read_f32(ray: &Ray32) -> Ray32 {
        *ray
    }

    /// The ray in single precision for boxes; `None` where it does not come from nearby, or is not sound.
    fn start_f32(start: &FilterStart, ray: &Ray32) -> Option<Slabs>;

    /// The same ray for triangles.
    fn start_f32_blocks(start: &FilterStart, ray: &Ray32, slabs: &Slabs) -> F32Ray;

    /// Both of four rays, and a bit for each that comes from nearby and is sound; what is made of the others means nothing.
    #[inline(always)]
    fn start_f32_by_four(
        start: &FilterStart,
        rays: [&Ray32; 4],
        places: [(&mut Slabs, &mut F32Ray); 4],
    ) -> u32 {
        start_f32_one_by_one::<Self>(start, rays, places)
    }

    /// The corners of the triangles of a block in the ray's sheared space, `[x, y or z][corner]`, all with the sign turned; what lanes
    /// without a triangle have means nothing. No product is fused with a sum: it is the same on every machine.
    fn f32_corners(block: &TriangleBlock, ray: &F32Ray) -> [[Self::F32x8; 3]; 3];

    /// The same of two blocks, each by its ray: those of the first, and those of the second.
    #[inline(always)]
    fn f32_corners_by_two(blocks: [&TriangleBlock; 2], rays: [&F32Ray; 2]) -> [[Self::F32x16; 3]; 3] {
        let first = Self::f32_corners(blocks[0], rays[0]);
        let second = Self::f32_corners(blocks[1], rays[1]);
        corners_of_two(&first, &second)
    }

    /// The numbers of rays in single precision, side by side: origin, start, direction, end.
    fn f32_rows(rays: &[Ray32; WIDE], rows: &mut [Row<f32>; 8]);

    /// The numbers of rays, side by side: origin, direction and range.
    fn columns(rays: &[Ray; WIDE], columns: &mut [Row<f64>; 8]);

    /// A bit for each triangle that the line of the ray may meet, among them all that it does, and what [`Simd::place_crossings`]
    /// wants to know: see [`BlockRay`].
    fn intersect_triangles(block: &TriangleBlock, ray: &BlockRay) -> (u32, Self::Edges);

    /// The same of two blocks, each by its ray: those of the first, and those of the second.
    fn intersect_triangles_by_two(
        blocks: [&TriangleBlock; 2],
        rays: [&BlockRay; 2],
    ) -> (u32, Self::EdgesByTwo);

    /// Of one of the two: `which` is 0 or 1.
    fn edges_of(both: &Self::EdgesByTwo, which: usize) -> Self::Edges;

    /// For each number of a list, a bit for each place before it that has the same.
    fn equals_before(list: &[u32; 3 * BLOCK]) -> [u32; 3 * BLOCK];

    /// Whole numbers without what stands behind the point. None is to be 2^31 or more, or to be no number.
    fn truncated(numbers: &[f32; BLOCK]) -> [i32; BLOCK];

    /// The corners of the triangles of a block: where they stand there, or in this room.
    fn corners<'a>(block: &'a TriangleBlock, room: &'a mut CornersRoom) -> &'a Corners;

    /// Where along the ray that is.
    fn place_crossings(edges: &Self::Edges, ray: &BlockRay) -> Crossings<Self::F32x8>;

    /// [`Shear::new`] and [`Shear::local_origin`] of a ray that has these axes, for a mesh.
    fn shear(ray: &Ray, axes: &'static Axes, mesh_origin: &[f64; 4]) -> (Shear, [f64; 3]);

    /// How a ray passes the triangle in a lane, in double precision, and what its crossing inside is made of. `origin` has the order
    /// of the shear's axes.
    fn pass(block: &TriangleBlock, lane: usize, shear: &Shear, origin: &[f64; 3]) -> (EdgeTest, Inside);
}

/// The corners of the triangles of a block, and those of another.
#[inline(always)]
pub(super) fn corners_of_two<W: F32x16>(
    first: &[[W::Half; 3]; 3],
    second: &[[W::Half; 3]; 3],
) -> [[W; 3]; 3] {
    let [x, y, z] = first;
    [three_of_two(x, &second[0]), three_of_two(y, &second[1]), three_of_two(z, &second[2])]
}

/// [`Simd::start_f32_by_four`], one ray after the other.
#[inline(always)]
pub(super) fn start_f32_one_by_one<L: Simd + ?Sized>(
    start: &FilterStart,
    rays: [&Ray32; 4],
    places: [(&mut Slabs, &mut F32Ray); 4],
) -> u32 {
    let mut fit = 0;
    for (i, (ray, (slabs, f32_ray))) in rays.into_iter().zip(places).enumerate() {
        if let Some(started) = L::start_f32(start, ray) {
            *f32_ray = L::start_f32_blocks(start, ray, &started);
            *slabs = started;
            fit |= 1 << i;
        }
    }
    fit
}

/// Room for corners.
#[repr(align(32))]
pub(crate) struct CornersRoom(pub(super) Corners);

impl CornersRoom {
    #[inline(always)]
    pub(crate) fn new() -> Self {
        Self([[[0.0; BLOCK]; 3]; 3])
    }
}

/// Where a ray may meet the triangles of a block.
#[derive(Clone, Copy)]
pub(crate) struct Crossings<E> {
    /// A bit for each that may be met within the range, if its line meets it: among them all that are.
    pub(crate) in_range: u32,
    /// A bit for each that certainly is met there.
    pub(crate) sure: u32,
    /// Heights along the ray between which the crossing lies.
    pub(crate) from: E,
    pub(crate) to: E,
}

impl<E: F32x8> Crossings<E> {
    /// The heights between which the crossing in a lane lies.
    #[inline(always)]
    pub(crate) fn between(&self, lane: usize) -> (f32, f32) {
        (self.from.lane(lane), self.to.lane(lane))
    }
}
