//! The vector operations of a search, for each instruction set.

use lumbre_geometry::Ray;
use lumbre_math::Transform;

use super::axes::Axes;
use super::box_ray::{BoxRay, Slabs};
use super::f32_ray::F32Ray;
use super::isa::Isa;
use super::triangles::{Edges, Shears};
use super::watertight::{BlockRay, EdgeTest, Inside, Shear};
use crate::ray32::Ray32;
use crate::simd::{F32x8, F32x16, LANES, LastEight, Row, Vector, three_of_two};
use crate::tree::filter_start::FilterStart;
use crate::tree::node::TreeSpace;
use crate::tree::triangle_block::TriangleBlock;
use crate::tree::{BLOCK, Corners};

/// The vector operations of a search: sixteen boxes or eight triangles at a time.
pub(crate) trait Simd {
    /// Eight numbers.
    type F32x8: F32x8;
    /// Sixteen numbers.
    type F32x16: F32x16<Half = Self::F32x8>;
    /// Whether testing two rays together, each with its own block, is faster than one after the other.
    const INTERSECTS_BY_TWO: bool = false;
    /// Whether a packet continues for a while after it stopped paying, to make use of the work done: see `packet`.
    const GOES_ON_TOGETHER: bool = true;

    /// The instruction set of these operations.
    fn isa() -> Isa;

    /// Sets up `boxes` for the ray from `t_min` to `t_max` and a tree in these units, if the ray starts nearby; returns
    /// whether it does. Also checks that the ray is valid.
    fn start_nearby(tree_space: &TreeSpace, ray: &Ray, t_min: f64, t_max: f64, boxes: &mut BoxRay) -> bool;

    /// The ray for boxes in single precision; `None` if it does not start nearby, or is invalid.
    fn start_filter(start: &FilterStart, ray: &Ray) -> Option<Slabs>;

    /// The ray in the space of a placed tree, with another range, and for the boxes there: see [`Ray::into_object`].
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

    /// The same ray for triangles, and the factor from heights along it to positions in the range of boxes.
    fn start_blocks(start: &FilterStart, ray: &Ray, slabs: &Slabs) -> (BlockRay, f32);

    /// A ray for wide loads, though it may just have been written element by element. A wide load of recent narrow
    /// stores would stall until they retire, which would serialise the rays.
    #[inline(always)]
    fn read(ray: &Ray) -> Ray {
        *ray
    }

    /// As [`Self::read`], in single precision.
    #[inline(always)]
    fn read_f32(ray: &Ray32) -> Ray32 {
        *ray
    }

    /// The ray in single precision for boxes; `None` if it does not start nearby, or is invalid.
    fn start_f32(start: &FilterStart, ray: &Ray32) -> Option<Slabs>;

    /// The same ray for triangles.
    fn start_f32_blocks(start: &FilterStart, ray: &Ray32, slabs: &Slabs) -> F32Ray;

    /// The numbers of rays in single precision, transposed: origin, start, direction, end.
    fn f32_rows(rays: &[Ray32; LANES], rows: &mut [Row<f32>; 8]);

    /// The numbers of rays, transposed: origin, direction and range.
    fn columns(rays: &[Ray; LANES], columns: &mut [Row<f64>; 8]);

    /// The corners of a block's triangles in the ray's sheared space, `[x, y or z][corner]`: see [`Shears::apply`].
    /// Lanes without a triangle are undefined.
    fn sheared_corners<S: Shears>(block: &TriangleBlock, ray: &S) -> [[Self::F32x8; 3]; 3];

    /// As [`Self::sheared_corners`] for two rays, each with its own block.
    #[inline(always)]
    fn sheared_corners_by_two<S: Shears>(
        blocks: [&TriangleBlock; 2],
        rays: [&S; 2],
    ) -> [[Self::F32x16; 3]; 3] {
        let [x, y, z] = Self::sheared_corners(blocks[0], rays[0]);
        let [other_x, other_y, other_z] = Self::sheared_corners(blocks[1], rays[1]);
        [three_of_two(&x, &other_x), three_of_two(&y, &other_y), three_of_two(&z, &other_z)]
    }

    /// A bit for each triangle that the line of the ray may meet, which includes all that it meets, and the input of
    /// [`Edges::place`].
    #[inline(always)]
    fn intersect_triangles(block: &TriangleBlock, ray: &BlockRay) -> (u32, Edges<Self::F32x8>) {
        let (mask, edges) = Edges::of(Self::sheared_corners(block, ray), Self::F32x8::splat(ray.least_size));
        (mask & block.taken(), edges)
    }

    /// As [`Self::intersect_triangles`] for two rays, each with its own block.
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

    /// For each number of a list, a bit for each equal one before it.
    fn equals_before(list: &[u32; 3 * BLOCK]) -> [u32; 3 * BLOCK];

    /// Integers, truncated towards zero. All numbers must be below 2^31, and none NaN.
    fn truncated(numbers: &[f32; BLOCK]) -> [i32; BLOCK];

    /// The corners of a block's triangles: borrowed from the block, or computed into `room`.
    fn corners<'a>(block: &'a TriangleBlock, room: &'a mut CornerScratch) -> &'a Corners;

    /// [`Shear::new`] and [`Shear::local_origin`] of a ray that has these axes, for a mesh.
    fn shear(ray: &Ray, axes: &'static Axes, mesh_origin: &[f64; 4]) -> (Shear, [f64; 3]);

    /// How a ray passes the triangle in a lane, in double precision, and the data of its crossing. `origin` has the
    /// order of the shear's axes.
    fn pass(block: &TriangleBlock, lane: usize, shear: &Shear, origin: &[f64; 3]) -> (EdgeTest, Inside);
}

/// Scratch memory for corners.
#[repr(align(32))]
pub(crate) struct CornerScratch(pub(super) Corners);

impl CornerScratch {
    #[inline(always)]
    pub(crate) fn new() -> Self {
        Self([[[0.0; BLOCK]; 3]; 3])
    }
}
