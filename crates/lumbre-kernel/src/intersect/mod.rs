//! Rays against what a tree is made of: boxes, blocks of triangles, spheres and bounding volumes, for each instruction set. With
//! [`simd`](crate::simd), the fence around all `unsafe` but the call that maps a file: above it, a traversal is written once, over
//! [`Simd`].
//!
//! [`Isa::run`] chooses the instruction set once a search, and [`Isa::dispatched`] for all searches. The code between is generic and
//! `#[inline(always)]` without a target feature of its own, so that it takes on the features of the root that it is inlined into.

#![allow(unsafe_code)]

mod bounding_volumes;
pub(crate) mod box_ray;
mod boxes;
mod dispatched;
pub(crate) mod f32_ray;
pub(crate) mod filter_start;
mod portable;
mod spheres;
pub(crate) mod watertight;
#[cfg(target_arch = "x86_64")]
mod x86;

use std::mem::MaybeUninit;
use std::sync::OnceLock;

use bytemuck::Zeroable;
use lumbre_geometry::Ray;
use lumbre_math::{DVec3, Transform};

#[cfg(target_arch = "x86_64")]
use self::x86::OnX86;
use crate::Ray32;
#[cfg(test)]
use crate::intersect::box_ray::SlabRows;
use crate::intersect::box_ray::{BoxRay, Slabs};
use crate::intersect::f32_ray::F32Ray;
use crate::intersect::filter_start::FilterStart;
use crate::intersect::watertight::{BlockRay, EdgeTest, Inside, Shear};
#[cfg(test)]
use crate::simd::Vector;
use crate::simd::{F32x8, F32x16, Row, WIDE, three_of_two};
#[cfg(test)]
use crate::tree::node::Node;
use crate::tree::node::{TreeSpace, WIDTH};
use crate::tree::triangle_block::{TriangleBlock, shared_row, unshared_row};
use crate::tree::{BLOCK, Corners};

#[cfg(test)]
pub(crate) use bounding_volumes::intersect_bounding_volumes_at;
pub(crate) use bounding_volumes::{BoundingHits, intersect_bounding_volumes};
pub(crate) use boxes::{
    intersect_boxes, intersect_each, intersect_frustum, only_child, push_as_built, push_by_distance,
    put_and_take_as_built, put_and_take_by_distance,
};
pub(crate) use dispatched::{DispatchedQuery, RayQuery};
pub(crate) use portable::Portable;
pub(crate) use spheres::intersect_spheres;
#[cfg(test)]
pub(crate) use spheres::intersect_spheres_at;

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
fn corners_of_two<W: F32x16>(first: &[[W::Half; 3]; 3], second: &[[W::Half; 3]; 3]) -> [[W; 3]; 3] {
    let [x, y, z] = first;
    [three_of_two(x, &second[0]), three_of_two(y, &second[1]), three_of_two(z, &second[2])]
}

/// [`Simd::start_f32_by_four`], one ray after the other.
#[inline(always)]
fn start_f32_one_by_one<L: Simd + ?Sized>(
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
pub(crate) struct CornersRoom(Corners);

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

/// The planes of a node that a ray meets first.
#[derive(Debug, PartialEq)]
#[repr(align(32))]
pub(crate) struct Sides {
    // On each axis, where the planes start in the flat array of a node's planes: `WIDTH` times 2 axis + side. The other planes are
    // at that place with `WIDTH` flipped.
    near: [usize; 3],
}

// The fourth bit makes no difference.
static SIDES: [Sides; 16] = {
    let mut sides = [const { Sides { near: [0; 3] } }; 16];
    let mut signs = 0;
    while signs < 16 {
        let mut axis = 0;
        while axis < 3 {
            sides[signs].near[axis] = 2 * WIDTH * axis + WIDTH * (signs >> axis & 1);
            axis += 1;
        }
        signs += 1;
    }
    sides
};

impl Sides {
    /// Where no component is negative.
    pub(crate) const OF_NONE_NEGATIVE: &'static Self = &SIDES[0];

    /// For a direction that has these signs: a bit for each negative component, and one of any that follows.
    #[inline(always)]
    pub(crate) fn new(signs: u32) -> &'static Self {
        &SIDES[signs as usize % 16]
    }
}

/// The axes in another order.
// By lines: what every ray reads stands in the first, and one of a table is found by a shift.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct Axes {
    // Each below three; the fourth only fills up.
    order: [u32; 4],
    // The words where their rows begin in a block that shares its vertices, and in one that does not.
    shared_rows: [u32; 3],
    unshared_rows: [u32; 3],
    // The halves of each.
    halves: [u32; 8],
}

impl Axes {
    const fn of(x: usize, y: usize, z: usize) -> Self {
        let order = [x as u32, y as u32, z as u32, 3];
        let mut halves = [0; 8];
        let mut half = 0;
        while half < 8 {
            halves[half] = 2 * order[half / 2] + half as u32 % 2;
            half += 1;
        }
        let shared_rows = [shared_row(x) as u32, shared_row(y) as u32, shared_row(z) as u32];
        let unshared_rows = [unshared_row(x) as u32, unshared_row(y) as u32, unshared_row(z) as u32];
        Self { order, shared_rows, unshared_rows, halves }
    }
}

// By which is the last and whether it is negative; eight, so that three bits name one.
const AXES: [Axes; 8] = [
    Axes::of(1, 2, 0),
    Axes::of(2, 0, 1),
    Axes::of(0, 1, 2),
    Axes::of(0, 1, 2),
    Axes::of(2, 1, 0),
    Axes::of(0, 2, 1),
    Axes::of(1, 0, 2),
    Axes::of(1, 0, 2),
];

impl Axes {
    /// The last is the direction's largest; the others are in the order that keeps the winding.
    #[inline(always)]
    pub(crate) fn new(direction: &DVec3) -> &'static Self {
        let [x, y, z] = [direction.x.abs(), direction.y.abs(), direction.z.abs()];
        // Without branches, for incoherent rays.
        let x_is_largest = usize::from((x >= y) & (x >= z));
        let z = (1 - x_is_largest) * (2 - usize::from(y >= z));
        let is_negative = usize::from(direction.as_ref()[z] < 0.0);
        static ALL: [Axes; 8] = AXES;
        &ALL[(4 * is_negative + z) % 8]
    }

    /// The axes for a direction whose components have these signs, a bit for each negative one, and these sizes: a bit each for
    /// |x| ≥ |y|, |y| ≥ |z| and |x| ≥ |z|.
    #[inline(always)]
    pub(crate) fn by_bits(signs: u32, sizes: u32) -> &'static Self {
        static ALL: [Axes; 64] = {
            let mut all = [AXES[0]; 64];
            let mut bits = 0;
            while bits < 64 {
                let (signs, sizes) = (bits % 8, bits / 8);
                let z = if sizes & 0b101 == 0b101 {
                    0
                } else if sizes & 0b10 != 0 {
                    1
                } else {
                    2
                };
                all[bits] = AXES[4 * (signs >> z & 1) + z];
                bits += 1;
            }
            all
        };
        &ALL[(((sizes % 8) << 3) | (signs % 8)) as usize]
    }

    /// What they are in it: each below three, as the compiler then knows.
    #[inline(always)]
    pub(crate) fn order(&self) -> [usize; 3] {
        let [x, y, z, _] = self.order;
        [x.min(2) as usize, y.min(2) as usize, z.min(2) as usize]
    }

    /// A vector's components in this order.
    #[inline(always)]
    pub(crate) fn permute_single(&self, v: &[f32; 4]) -> [f32; 4] {
        [v[self.order[0] as usize % 4], v[self.order[1] as usize % 4], v[self.order[2] as usize % 4], v[3]]
    }

    /// A vector's components in this order.
    #[inline(always)]
    pub(crate) fn permute(&self, v: &DVec3) -> [f64; 3] {
        let v: &[f64; 3] = v.as_ref();
        // SAFETY: the axes are below three.
        let at = |axis: u32| unsafe { *v.get_unchecked(axis as usize) };
        [at(self.order[0]), at(self.order[1]), at(self.order[2])]
    }

    /// The words where their rows begin in a block: each has all vertices that [`TriangleBlock::vertices_at`] names.
    #[inline(always)]
    fn rows(&self, block: &TriangleBlock) -> [usize; 3] {
        let [x, y, z] = if block.is_unshared() { self.unshared_rows } else { self.shared_rows };
        [x as usize, y as usize, z as usize]
    }

    /// The corners in one lane of a block, each in this order.
    #[inline(always)]
    pub(crate) fn gather(&self, block: &TriangleBlock, lane: usize) -> [[f32; 3]; 3] {
        let words = block.words();
        let [x, y, z] = self.rows(block);
        block.vertices_at(lane).map(|vertex| {
            // SAFETY: see `rows`.
            let at = |row: usize| unsafe { *words.get_unchecked(row + vertex) };
            [at(x), at(y), at(z)]
        })
    }
}

/// Entries in the array of a stack. Few in tests, so that spilling is tested.
pub(crate) const STACK: usize = if cfg!(test) { 3 * WIDTH } else { 256 };

/// The array of a stack, which is not cleared for every ray.
#[repr(C, align(64))]
pub(crate) struct Slots<E> {
    // Beside the first entries.
    len: usize,
    // The first `len` are initialised, and `len <= STACK`.
    entries: [MaybeUninit<E>; STACK],
}

impl<E: Copy> Slots<E> {
    #[inline(always)]
    pub(crate) fn new() -> Self {
        Self { entries: [const { MaybeUninit::uninit() }; STACK], len: 0 }
    }

    /// Many: none is moved to where it is.
    pub(crate) fn many<const N: usize>() -> Box<[Self; N]> {
        let mut many = Box::<[Self; N]>::new_uninit();
        let first: *mut Self = many.as_mut_ptr().cast();
        // SAFETY: of `N` from the first on, the lengths are written, and entries may be uninitialised.
        unsafe {
            for i in 0..N {
                (&raw mut (*first.add(i)).len).write(0);
            }
            many.assume_init()
        }
    }

    #[inline(always)]
    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// Adds one.
    ///
    /// # Panics
    /// When it is full.
    #[inline(always)]
    pub(crate) fn push(&mut self, entry: E) {
        self.entries[self.len] = MaybeUninit::new(entry);
        self.len += 1;
    }

    /// Somewhere for all children of a node.
    ///
    /// # Panics
    /// When there is not.
    #[inline(always)]
    pub(crate) fn room(&mut self) -> Room<'_, E> {
        let len = self.len;
        let window = (&mut self.entries[len..len + WIDTH]).try_into().expect("as many");
        Room { window, end: &mut self.len, len }
    }

    #[inline(always)]
    pub(crate) fn clear(&mut self) {
        self.len = 0;
    }

    #[inline(always)]
    pub(crate) fn pop(&mut self) -> Option<E> {
        if self.len == 0 {
            return None;
        }
        self.len -= 1;
        // SAFETY: it was one of the first `len`, which are initialised, and there are no more than `STACK`.
        Some(unsafe { self.entries.get_unchecked(self.len).assume_init() })
    }
}

/// The next ones of an array that entries are added to.
pub(crate) struct Room<'s, E> {
    window: &'s mut [MaybeUninit<E>; WIDTH],
    end: &'s mut usize,
    // Where that stood.
    len: usize,
}

impl<E> Room<'_, E> {
    /// Adds the first of them.
    ///
    /// # Safety
    /// They have been written.
    #[inline(always)]
    unsafe fn add(self, count: usize) {
        *self.end = self.len + count;
    }
}

/// Work that is compiled for every instruction set and dispatched to one.
pub(crate) trait Dispatch {
    /// Its result.
    type Output;
    /// Does it. To be `#[inline(always)]`, with everything that it calls in its inner loop.
    fn run<L: Simd>(self) -> Self::Output;
}

/// The type beside which dispatched work is compiled.
///
/// The compiler puts a generic method into the codegen unit of the type whose method it is. As methods of types in different modules, the
/// traversals are compiled in parallel; as functions of this module they would all be one unit.
trait CompilationUnit {
    // Out of the way of the others.
    #[inline(never)]
    fn run_portable<T: Dispatch>(task: T) -> T::Output {
        task.run::<Portable>()
    }
}

impl<H> CompilationUnit for H {}

/// An instruction set that this machine has: there is no other way to one than asking it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Isa(Set);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Set {
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Isa {
    /// The best that this machine has.
    pub(crate) fn best() -> Self {
        static BEST: OnceLock<Isa> = OnceLock::new();
        *BEST.get_or_init(|| Self::all().pop().expect("one at least"))
    }

    /// All that this machine has, the best last.
    pub(crate) fn all() -> Vec<Self> {
        let mut all = vec![Self(Set::Portable)];
        #[cfg(target_arch = "x86_64")]
        {
            let has_avx2 = std::arch::is_x86_feature_detected!("avx2")
                && std::arch::is_x86_feature_detected!("fma")
                && std::arch::is_x86_feature_detected!("bmi1")
                && std::arch::is_x86_feature_detected!("bmi2")
                && std::arch::is_x86_feature_detected!("lzcnt")
                && std::arch::is_x86_feature_detected!("popcnt");
            if has_avx2 {
                all.push(Self(Set::Avx2));
            }
            if has_avx2
                && std::arch::is_x86_feature_detected!("avx512f")
                && std::arch::is_x86_feature_detected!("avx512cd")
                && std::arch::is_x86_feature_detected!("avx512dq")
                && std::arch::is_x86_feature_detected!("avx512vl")
            {
                all.push(Self(Set::Avx512));
            }
        }
        all
    }

    /// Whether there are vectors of eight numbers.
    pub(crate) fn has_vectors(self) -> bool {
        self.0 != Set::Portable
    }

    /// Runs a task that is only compiled for instruction sets with vectors.
    #[inline(always)]
    pub(crate) fn run_with_vectors<T: Dispatch>(self, task: T) -> T::Output {
        match self.0 {
            Set::Portable => unreachable!("who calls it asks `has_vectors`"),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `all` alone makes this value, after finding on this machine all the features of `run_avx2`.
            Set::Avx2 => unsafe { T::run_avx2(task) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as above, of `run_avx512`.
            Set::Avx512 => unsafe { T::run_avx512(task) },
        }
    }

    /// Runs the task with these lanes.
    #[inline(always)]
    pub(crate) fn run<T: Dispatch>(self, task: T) -> T::Output {
        self.run_beside::<T, T>(task)
    }

    /// The same, compiled beside this type: see [`CompilationUnit`].
    #[inline(always)]
    pub(crate) fn run_beside<H, T: Dispatch>(self, task: T) -> T::Output {
        match self.0 {
            Set::Portable => H::run_portable(task),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `all` alone makes this value, after finding on this machine all the features of `run_avx2`.
            Set::Avx2 => unsafe { H::run_avx2(task) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as above, of `run_avx512`.
            Set::Avx512 => unsafe { H::run_avx512(task) },
        }
    }
}

/// What [`Simd::start_filter`] and [`Simd::start_blocks`] give at an instruction set, for tests.
#[cfg(test)]
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

/// What [`Simd::read`] and [`Simd::read_f32`] give at an instruction set, for tests.
#[cfg(test)]
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

/// What [`Simd::start_f32_by_four`] gives at an instruction set, and what it gives one by one, for tests.
#[cfg(test)]
pub(crate) fn start_f32_by_four_at(
    isa: Isa,
    start: &FilterStart,
    rays: [&Ray32; 4],
) -> [[Option<(Slabs, F32Ray)>; 4]; 2] {
    struct Starting<'a>(&'a FilterStart, [&'a Ray32; 4]);
    impl Dispatch for Starting<'_> {
        type Output = [[Option<(Slabs, F32Ray)>; 4]; 2];
        #[inline(always)]
        fn run<L: Simd>(self) -> Self::Output {
            let Self(start, rays) = self;
            [true, false].map(|is_together| {
                let mut starts = [(Slabs::ZERO, F32Ray::of_none()); 4];
                let [a, b, c, d] = &mut starts;
                let places = [a, b, c, d].map(|(slabs, f32_ray)| (slabs, f32_ray));
                let fit = if is_together {
                    L::start_f32_by_four(start, rays, places)
                } else {
                    start_f32_one_by_one::<L>(start, rays, places)
                };
                std::array::from_fn(|i| (fit >> i & 1 != 0).then_some(starts[i]))
            })
        }
    }
    isa.run(Starting(start, rays))
}

/// What [`Simd::start_placed`] gives at an instruction set, for tests.
#[cfg(test)]
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

/// What [`Simd::intersect_boxes`] gives at an instruction set, and where the ray enters each box, for tests.
#[cfg(test)]
pub(crate) fn intersect_boxes_at(isa: Isa, node: &Node, ray: &Slabs) -> (u32, [i32; WIDTH]) {
    struct Boxes<'a>(&'a Node, &'a Slabs);
    impl Dispatch for Boxes<'_> {
        type Output = (u32, [i32; WIDTH]);
        #[inline(always)]
        fn run<L: Simd>(self) -> Self::Output {
            // A child's reference is its lane here. The nearest, which never stands on the stack, has no key.
            let mut node = *self.0;
            node.children = std::array::from_fn(|lane| lane as u32);
            let (mask, enter) = intersect_boxes::<L::F32x16>(&node, self.1);
            let mut by_lane = [i32::MAX; WIDTH];
            // On what was there before: as they stand in the node.
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

/// A mask of children, and where they are entered.
#[cfg(test)]
type Entered = (u32, [f32; WIDTH]);

/// What [`intersect_each`] gives of some children at an instruction set for those of the rays that are alive, and what [`intersect_boxes`] gives for each
/// of them: a mask, and where children are entered; for tests. All have the sides of the first.
#[cfg(test)]
pub(crate) fn intersect_each_at(
    isa: Isa,
    node: &Node,
    rays: &[Slabs; WIDE],
    alive: u32,
    children: u32,
) -> (Entered, [Entered; WIDE]) {
    struct Each<'a>(&'a Node, &'a [Slabs; WIDE], u32, u32);
    impl Dispatch for Each<'_> {
        type Output = (Entered, [Entered; WIDE]);
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

/// The triangles of a block that the ray may meet in its range and those that it certainly does, at an instruction set, with the heights
/// between which each is met, for tests.
#[cfg(test)]
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
            let crossings = L::place_crossings(&edges, self.1);
            let between = std::array::from_fn(|lane| <[f32; 2]>::from(crossings.between(lane)));
            (mask & crossings.in_range, mask & crossings.sure, between)
        }
    }
    isa.run(Triangles(block, ray))
}

/// What a ray is told of a block, bit by bit, of lanes with a triangle: which it may meet, those in its range, those that it surely meets,
/// where, and the corners as single precision has them.
#[cfg(test)]
#[derive(Debug, PartialEq)]
pub(crate) struct Told {
    masks: [u32; 3],
    heights: [[u32; BLOCK]; 2],
    corners: [[[u32; BLOCK]; 3]; 3],
}

#[cfg(test)]
impl Told {
    #[inline(always)]
    fn of<L: Simd>(
        (block, ray): (&TriangleBlock, &BlockRay),
        (mask, edges): (u32, L::Edges),
        corners: [[L::F32x8; 3]; 3],
    ) -> Self {
        let taken = block.taken();
        let crossings = L::place_crossings(&edges, ray);
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

/// What two rays are told of two blocks at an instruction set, each of its own: by both together, and by each alone; for tests.
#[cfg(test)]
pub(crate) fn told_at(
    isa: Isa,
    blocks: [&TriangleBlock; 2],
    rays: [&BlockRay; 2],
    f32_ray: [&F32Ray; 2],
) -> [[Told; 2]; 2] {
    struct Telling<'a>([&'a TriangleBlock; 2], [&'a BlockRay; 2], [&'a F32Ray; 2]);
    impl Dispatch for Telling<'_> {
        type Output = [[Told; 2]; 2];
        #[inline(always)]
        fn run<L: Simd>(self) -> Self::Output {
            let Self(blocks, rays, f32_ray) = self;
            let (mask, edges) = L::intersect_triangles_by_two(blocks, rays);
            let [x, y, z] = L::f32_corners_by_two(blocks, f32_ray);
            let one =
                |row: &[L::F32x16; 3], which| [row[0].half(which), row[1].half(which), row[2].half(which)];
            let together = |which: usize| {
                let of_one = (mask >> (BLOCK * which) & L::F32x8::ALL, L::edges_of(&edges, which));
                let corners = [one(&x, which), one(&y, which), one(&z, which)];
                Told::of::<L>((blocks[which], rays[which]), of_one, corners)
            };
            let alone = |which: usize| {
                let (block, ray) = (blocks[which], rays[which]);
                let corners = L::f32_corners(block, f32_ray[which]);
                Told::of::<L>((block, ray), L::intersect_triangles(block, ray), corners)
            };
            [[together(0), together(1)], [alone(0), alone(1)]]
        }
    }
    isa.run(Telling(blocks, rays, f32_ray))
}

/// [`Simd::corners`] at an instruction set, for tests.
#[cfg(test)]
pub(crate) fn corners_at(isa: Isa, block: &TriangleBlock) -> Corners {
    struct Taking<'a>(&'a TriangleBlock);
    impl Dispatch for Taking<'_> {
        type Output = Corners;
        #[inline(always)]
        fn run<L: Simd>(self) -> Self::Output {
            *L::corners(self.0, &mut CornersRoom::new())
        }
    }
    isa.run(Taking(block))
}

/// [`Simd::equals_before`] at an instruction set, for tests.
#[cfg(test)]
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
#[cfg(test)]
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
