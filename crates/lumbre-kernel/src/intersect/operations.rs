//! What a search does many at a time, for each instruction set.

use lumbre_geometry::Ray;
use lumbre_math::Transform;

use super::axes::Axes;
use super::box_ray::{BoxRay, Slabs};
use super::f32_ray::F32Ray;
use super::isa::Isa;
use super::triangles::{Edges, Shears};
use super::watertight::{BlockRay, EdgeTest, Inside, Shear};
use crate::ray32::Ray32;
use crate::simd::{F32x8, F32x16, LastEight, Row, Vector, WIDE, three_of_two};
use crate::tree::filter_start::FilterStart;
use crate::tree::node::TreeSpace;
use crate::tree::triangle_block::TriangleBlock;
use crate::tree::{BLOCK, Corners};

/// What a search does many at a time: boxes by sixteen, and triangles by eight.
pub(crate) trait Simd {
    /// Eight numbers.
    type F32x8: F32x8;
    /// Sixteen numbers, alike.
    type F32x16: F32x16<Half = Self::F32x8>;
    /// Whether two rays, each at a block of its own, are better met together than one after the other.
    const INTERSECTS_BY_TWO: bool = false;
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

    /// The numbers of rays in single precision, side by side: origin, start, direction, end.
    fn f32_rows(rays: &[Ray32; WIDE], rows: &mut [Row<f32>; 8]);

    /// The numbers of rays, side by side: origin, direction and range.
    fn columns(rays: &[Ray; WIDE], columns: &mut [Row<f64>; 8]);

    /// The corners of the triangles of a block in the ray's sheared space, `[x, y or z][corner]`: see [`Shears::apply`]. What lanes without
    /// a triangle have means nothing.
    fn sheared_corners<S: Shears>(block: &TriangleBlock, ray: &S) -> [[Self::F32x8; 3]; 3];

    /// The same of two blocks, each by its ray: those of the first, and those of the second.
    #[inline(always)]
    fn sheared_corners_by_two<S: Shears>(
        blocks: [&TriangleBlock; 2],
        rays: [&S; 2],
    ) -> [[Self::F32x16; 3]; 3] {
        let [x, y, z] = Self::sheared_corners(blocks[0], rays[0]);
        let [other_x, other_y, other_z] = Self::sheared_corners(blocks[1], rays[1]);
        [three_of_two(&x, &other_x), three_of_two(&y, &other_y), three_of_two(&z, &other_z)]
    }

    /// A bit for each triangle that the line of the ray may meet, among them all that it does, and what [`Edges::place`] needs.
    #[inline(always)]
    fn intersect_triangles(block: &TriangleBlock, ray: &BlockRay) -> (u32, Edges<Self::F32x8>) {
        let (mask, edges) = Edges::of(Self::sheared_corners(block, ray), Self::F32x8::splat(ray.least_size));
        (mask & block.taken(), edges)
    }

    /// The same of two blocks, each by its ray: those of the first, and those of the second.
    #[inline(always)]
    fn intersect_triangles_by_two(
        blocks: [&TriangleBlock; 2],
        rays: [&BlockRay; 2],
    ) -> (u32, Edges<Self::F32x16>) {
        if !Self::INTERSECTS_BY_TWO {
            let (first, of_first) = Self::intersect_triangles(blocks[0], rays[0]);
            let (second, of_second) = Self::intersect_triangles(blocks[1], rays[1]);
            return (first | second << BLOCK, Edges::of_two(&of_first, &of_second));
        }
        let least_size = Self::F32x16::splat_two(rays[0].least_size, rays[1].least_size, LastEight::new());
        let (mask, edges) = Edges::of(Self::sheared_corners_by_two(blocks, rays), least_size);
        (mask & (blocks[0].taken() | blocks[1].taken() << BLOCK), edges)
    }

    /// For each number of a list, a bit for each place before it that has the same.
    fn equals_before(list: &[u32; 3 * BLOCK]) -> [u32; 3 * BLOCK];

    /// Whole numbers without what stands behind the point. None is to be 2^31 or more, or to be no number.
    fn truncated(numbers: &[f32; BLOCK]) -> [i32; BLOCK];

    /// The corners of the triangles of a block: where they stand there, or in this room.
    fn corners<'a>(block: &'a TriangleBlock, room: &'a mut CornerScratch) -> &'a Corners;

    /// [`Shear::new`] and [`Shear::local_origin`] of a ray that has these axes, for a mesh.
    fn shear(ray: &Ray, axes: &'static Axes, mesh_origin: &[f64; 4]) -> (Shear, [f64; 3]);

    /// How a ray passes the triangle in a lane, in double precision, and what its crossing inside is made of. `origin` has the order
    /// of the shear's axes.
    fn pass(block: &TriangleBlock, lane: usize, shear: &Shear, origin: &[f64; 3]) -> (EdgeTest, Inside);
}

/// Room for corners.
#[repr(align(32))]
pub(crate) struct CornerScratch(pub(super) Corners);

impl CornerScratch {
    #[inline(always)]
    pub(crate) fn new() -> Self {
        Self([[[0.0; BLOCK]; 3]; 3])
    }
}
