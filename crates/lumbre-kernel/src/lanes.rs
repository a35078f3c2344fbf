//! The fence around SIMD, and around the one array that is not cleared: the only module with `unsafe`. Outside it, a search is written once, over [`Lanes`].
//!
//! [`Level::run`] chooses the instruction set once a ray. The code between is generic and `#[inline(always)]` without a
//! target feature of its own, so that it takes on the features of the root that it is inlined into.

#![allow(unsafe_code)]

use std::mem::MaybeUninit;

use crate::node::{BoxRay, Node, WIDTH};
use crate::stack::{STACK, stack_entry};
use crate::triangles::{BLOCK, Shear, TriangleBlock};

/// What a search does eight at a time: boxes, and triangles.
pub(crate) trait Lanes {
    /// Where the ray enters each of eight boxes, in an order of integers: see [`key`].
    type Keys: Copy;

    /// One bit for each child whose box the ray meets, and where it enters.
    fn meet_boxes(node: &Node, ray: &BoxRay) -> (u32, Self::Keys);

    /// Puts the children in `mask` onto the stack, the nearest last. There must be room for eight.
    fn push_by_distance(node: &Node, mask: u32, keys: Self::Keys, slots: &mut Slots);

    /// One bit for each triangle whose rounded edge functions do not have differing signs: every triangle that is hit,
    /// and a few others.
    fn meet_triangles(block: &TriangleBlock, shear: &Shear, origin: &[f64; 3]) -> u32;
}

/// Integers in the order of the floats.
#[inline(always)]
pub(crate) fn key(s: f32) -> i32 {
    let bits = s.to_bits() as i32;
    bits ^ (((bits >> 31) as u32) >> 1) as i32
}

/// In the last bits of a child's key stands its lane, so that no two are equal. To be compared with a limit that has all
/// these bits set.
pub(crate) const LANE_BITS: i32 = WIDTH as i32 - 1;

/// The array of a stack, which is not cleared for every ray.
pub(crate) struct Slots {
    // The first `len` are initialised, and `len <= STACK`.
    entries: [MaybeUninit<i64>; STACK],
    len: usize,
}

impl Slots {
    #[inline(always)]
    pub(crate) fn new() -> Self {
        Self { entries: [const { MaybeUninit::uninit() }; STACK], len: 0 }
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
    pub(crate) fn push(&mut self, entry: i64) {
        self.entries[self.len] = MaybeUninit::new(entry);
        self.len += 1;
    }

    #[inline(always)]
    pub(crate) fn pop(&mut self) -> Option<i64> {
        if self.len == 0 {
            return None;
        }
        self.len -= 1;
        // SAFETY: it was one of the first `len`, which are initialised.
        Some(unsafe { self.entries[self.len % STACK].assume_init() })
    }

    /// The next eight, to be written before `len` takes them in.
    ///
    /// # Panics
    /// When there are not as many.
    #[inline(always)]
    fn next_eight(&mut self) -> &mut [MaybeUninit<i64>; WIDTH] {
        let window = &mut self.entries[self.len..self.len + WIDTH];
        window.try_into().expect("eight")
    }
}

/// Work to be done with whichever lanes the machine has.
pub(crate) trait Task {
    /// What it gives.
    type Output;
    /// Does it. To be `#[inline(always)]`, with everything that it calls in its inner loop.
    fn run<L: Lanes>(self) -> Self::Output;
}

/// An instruction set that this machine has: there is no other way to one than asking it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Level(Set);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Set {
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2,
}

impl Level {
    /// What every machine has.
    #[cfg(test)]
    pub(crate) const PORTABLE: Self = Self(Set::Portable);

    /// The best that this machine has.
    pub(crate) fn best() -> Self {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2")
            && std::arch::is_x86_feature_detected!("fma")
            && std::arch::is_x86_feature_detected!("bmi1")
            && std::arch::is_x86_feature_detected!("bmi2")
            && std::arch::is_x86_feature_detected!("lzcnt")
            && std::arch::is_x86_feature_detected!("popcnt")
        {
            return Self(Set::Avx2);
        }
        Self(Set::Portable)
    }

    /// Runs the task with these lanes.
    #[inline(always)]
    pub(crate) fn run<T: Task>(self, task: T) -> T::Output {
        match self.0 {
            Set::Portable => task.run::<Portable>(),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `best` alone makes this value, after finding on this machine all the features of `run_avx2`.
            Set::Avx2 => unsafe { run_avx2(task) },
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
fn run_avx2<T: Task>(task: T) -> T::Output {
    task.run::<Avx2>()
}

/// Plain loops over arrays.
pub(crate) struct Portable;

impl Lanes for Portable {
    type Keys = [i32; WIDTH];

    #[inline(always)]
    fn meet_boxes(node: &Node, ray: &BoxRay) -> (u32, [i32; WIDTH]) {
        let mut enter = [ray.s_min; WIDTH];
        let mut leave = [ray.s_max; WIDTH];
        for axis in 0..3 {
            let near_planes = &node.planes[ray.near_planes[axis]];
            let far_planes = &node.planes[ray.near_planes[axis] ^ 1];
            for lane in 0..WIDTH {
                let first = near_planes[lane] * ray.inverse[axis] + ray.near_offset[axis];
                let last = far_planes[lane] * ray.inverse[axis] + ray.far_offset[axis];
                enter[lane] = if first > enter[lane] { first } else { enter[lane] };
                leave[lane] = if last < leave[lane] { last } else { leave[lane] };
            }
        }
        let mut mask = 0;
        let mut keys = [0; WIDTH];
        for lane in 0..WIDTH {
            mask |= u32::from(enter[lane] <= leave[lane]) << lane;
            keys[lane] = key(enter[lane]) & !LANE_BITS | lane as i32;
        }
        (mask & ((1 << node.len) - 1), keys)
    }

    #[inline(always)]
    fn push_by_distance(node: &Node, mask: u32, keys: [i32; WIDTH], slots: &mut Slots) {
        let window = slots.next_eight();
        // Where each goes is how many are farther: no two have one key, so that the first places are all written.
        for lane in (0..WIDTH).filter(|lane| mask >> lane & 1 != 0) {
            let is_farther = |other: &usize| mask >> other & 1 != 0 && keys[*other] > keys[lane];
            let place = (0..WIDTH).filter(is_farther).count();
            window[place % WIDTH] = MaybeUninit::new(stack_entry(keys[lane], node.children[lane]));
        }
        slots.len += (mask & 0xff).count_ones() as usize;
    }

    #[inline(always)]
    fn meet_triangles(block: &TriangleBlock, shear: &Shear, origin: &[f64; 3]) -> u32 {
        let mut x = [[0.0; BLOCK]; 3];
        let mut y = [[0.0; BLOCK]; 3];
        for corner in 0..3 {
            let axes = &block.corners[corner];
            for lane in 0..BLOCK {
                let z = f64::from(axes[shear.axes[2]][lane]) - origin[2];
                x[corner][lane] = (f64::from(axes[shear.axes[0]][lane]) - origin[0]) - shear.x * z;
                y[corner][lane] = (f64::from(axes[shear.axes[1]][lane]) - origin[1]) - shear.y * z;
            }
        }
        let mut mask = 0;
        for lane in 0..BLOCK {
            let edge = |p: usize, q: usize| x[p][lane] * y[q][lane] - y[p][lane] * x[q][lane];
            let (u, v, w) = (edge(2, 1), edge(0, 2), edge(1, 0));
            let inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
            mask |= u32::from(inside) << lane;
        }
        mask
    }
}

/// AVX2 with FMA.
#[cfg(target_arch = "x86_64")]
pub(crate) struct Avx2;

#[cfg(target_arch = "x86_64")]
impl Lanes for Avx2 {
    type Keys = std::arch::x86_64::__m256i;

    #[inline(always)]
    fn meet_boxes(node: &Node, ray: &BoxRay) -> (u32, Self::Keys) {
        use std::arch::x86_64::*;
        // SAFETY: only `run_avx2` instantiates this, so the machine has AVX2 and FMA. Every load is of eight f32 in an
        // array of eight; `near_planes` is checked by the index into `planes`.
        unsafe {
            let mut enter = _mm256_set1_ps(ray.s_min);
            let mut leave = _mm256_set1_ps(ray.s_max);
            for axis in 0..3 {
                let inverse = _mm256_set1_ps(ray.inverse[axis]);
                let near_index = ray.near_planes[axis];
                let near_planes = _mm256_loadu_ps(node.planes[near_index].as_ptr());
                let far_planes = _mm256_loadu_ps(node.planes[near_index ^ 1].as_ptr());
                let first = _mm256_fmadd_ps(near_planes, inverse, _mm256_set1_ps(ray.near_offset[axis]));
                let last = _mm256_fmadd_ps(far_planes, inverse, _mm256_set1_ps(ray.far_offset[axis]));
                enter = _mm256_max_ps(first, enter);
                leave = _mm256_min_ps(last, leave);
            }
            let mask = _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(enter, leave)) as u32;
            (mask & ((1 << node.len) - 1), _mm256_castps_si256(enter))
        }
    }

    #[inline(always)]
    fn push_by_distance(node: &Node, mask: u32, enter: Self::Keys, slots: &mut Slots) {
        use std::arch::x86_64::*;
        let window = slots.next_eight();
        // SAFETY: only `run_avx2` instantiates this, so the machine has AVX2. The store is of eight i32 into an array of
        // eight.
        unsafe {
            let turn = _mm256_srli_epi32::<1>(_mm256_srai_epi32::<31>(enter));
            let ordered = _mm256_xor_si256(enter, turn);
            let lanes = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
            let low_bits = _mm256_set1_epi32(LANE_BITS);
            let keys = _mm256_or_si256(_mm256_andnot_si256(low_bits, ordered), lanes);
            let mut scalar_keys = [0; WIDTH];
            _mm256_storeu_si256(scalar_keys.as_mut_ptr().cast(), keys);
            // Where each goes is how many are farther: no two have one key, so that the first places are all written.
            let mut rest = mask & 0xff;
            while rest != 0 {
                let lane = rest.trailing_zeros() as usize % WIDTH;
                rest &= rest - 1;
                let this = scalar_keys[lane];
                let farther = _mm256_cmpgt_epi32(keys, _mm256_set1_epi32(this));
                let farther = _mm256_movemask_ps(_mm256_castsi256_ps(farther)) as u32 & mask;
                let place = farther.count_ones() as usize % WIDTH;
                window[place] = MaybeUninit::new(stack_entry(this, node.children[lane]));
            }
        }
        slots.len += (mask & 0xff).count_ones() as usize;
    }

    #[inline(always)]
    fn meet_triangles(block: &TriangleBlock, shear: &Shear, origin: &[f64; 3]) -> u32 {
        use std::arch::x86_64::*;
        // SAFETY: only `run_avx2` instantiates this, so the machine has AVX2. Every load is of four f32 in an array of
        // four; the axes are checked by the index.
        unsafe {
            let [kx, ky, kz] = shear.axes;
            let (shear_x, shear_y) = (_mm256_set1_pd(shear.x), _mm256_set1_pd(shear.y));
            let (ox, oy, oz) =
                (_mm256_set1_pd(origin[0]), _mm256_set1_pd(origin[1]), _mm256_set1_pd(origin[2]));
            let mut mask = 0;
            for half in [0, BLOCK / 2] {
                let mut x = [_mm256_setzero_pd(); 3];
                let mut y = [_mm256_setzero_pd(); 3];
                for corner in 0..3 {
                    let axes = &block.corners[corner];
                    let z = _mm256_sub_pd(_mm256_cvtps_pd(_mm_loadu_ps(axes[kz][half..].as_ptr())), oz);
                    let across = _mm256_sub_pd(_mm256_cvtps_pd(_mm_loadu_ps(axes[kx][half..].as_ptr())), ox);
                    let up = _mm256_sub_pd(_mm256_cvtps_pd(_mm_loadu_ps(axes[ky][half..].as_ptr())), oy);
                    // No fused multiply-add: the bits are to be those of the scalar test.
                    x[corner] = _mm256_sub_pd(across, _mm256_mul_pd(shear_x, z));
                    y[corner] = _mm256_sub_pd(up, _mm256_mul_pd(shear_y, z));
                }
                let u = _mm256_sub_pd(_mm256_mul_pd(x[2], y[1]), _mm256_mul_pd(y[2], x[1]));
                let v = _mm256_sub_pd(_mm256_mul_pd(x[0], y[2]), _mm256_mul_pd(y[0], x[2]));
                let w = _mm256_sub_pd(_mm256_mul_pd(x[1], y[0]), _mm256_mul_pd(y[1], x[0]));
                let zero = _mm256_setzero_pd();
                let least = _mm256_min_pd(_mm256_min_pd(u, v), w);
                let most = _mm256_max_pd(_mm256_max_pd(u, v), w);
                let sided = _mm256_or_pd(
                    _mm256_cmp_pd::<_CMP_GE_OQ>(least, zero),
                    _mm256_cmp_pd::<_CMP_LE_OQ>(most, zero),
                );
                mask |= (_mm256_movemask_pd(sided) as u32) << half;
            }
            mask
        }
    }
}

/// What [`Lanes::meet_boxes`] gives at a level, and where the ray enters each box, for tests.
#[cfg(test)]
pub(crate) fn meet_boxes_at(level: Level, node: &Node, ray: &BoxRay) -> (u32, [i32; WIDTH]) {
    struct Boxes<'a>(&'a Node, &'a BoxRay);
    impl Task for Boxes<'_> {
        type Output = (u32, [i32; WIDTH]);
        #[inline(always)]
        fn run<L: Lanes>(self) -> Self::Output {
            let (mask, keys) = L::meet_boxes(self.0, self.1);
            let mut slots = Slots::new();
            L::push_by_distance(self.0, mask, keys, &mut slots);
            let mut by_lane = [i32::MAX; WIDTH];
            while let Some(entry) = slots.pop() {
                let key = (entry >> 32) as i32;
                by_lane[(key & LANE_BITS) as usize] = key;
            }
            (mask, by_lane)
        }
    }
    level.run(Boxes(node, ray))
}
