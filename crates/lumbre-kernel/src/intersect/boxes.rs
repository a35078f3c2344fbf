//! Boxes by sixteen: which children of a node a ray meets, and in what order it visits them.

use std::hint::select_unpredictable;
use std::mem::MaybeUninit;

use super::axes::Sides;
use super::slots::{PushSlots, Slots};
use crate::intersect::box_ray::Slabs;
use crate::intersect::box_ray::{Frustum, SlabRows};
use crate::simd::vector::stack_entry;
use crate::simd::{F32x16, LANES};
use crate::tree::node::{Node, WIDTH};

const _: () = assert!(WIDTH == LANES);

/// The near planes of all children on an axis, and the far planes.
#[inline(always)]
fn near_and_far<'a>(node: &'a Node, sides: &Sides, axis: usize) -> (&'a [f32; WIDTH], &'a [f32; WIDTH]) {
    let planes = node.planes.as_flattened().as_ptr();
    let near = sides.near[axis];
    // SAFETY: a multiple of sixteen below 96, and so is the other; an array of sixteen from there on lies in one of 96.
    unsafe { (&*planes.add(near).cast(), &*planes.add(near ^ WIDTH).cast()) }
}

/// One bit for each child whose box the ray meets, and where it enters.
#[inline(always)]
pub(crate) fn intersect_boxes<W: F32x16>(node: &Node, ray: &Slabs) -> (u32, W) {
    let (near_x, far_x) = near_and_far(node, ray.sides, 0);
    let (near_y, far_y) = near_and_far(node, ray.sides, 1);
    let (near_z, far_z) = near_and_far(node, ray.sides, 2);
    let [x, y, z, _] = ray.inverse;
    let (near, far) = (&ray.near_offset, &ray.far_offset);
    let near_x = W::load(near_x).mul_add(W::splat(x), W::splat(near[0]));
    let near_y = W::load(near_y).mul_add(W::splat(y), W::splat(near[1]));
    let near_z = W::load(near_z).mul_add(W::splat(z), W::splat(near[2]));
    let far_x = W::load(far_x).mul_add(W::splat(x), W::splat(far[0]));
    let far_y = W::load(far_y).mul_add(W::splat(y), W::splat(far[1]));
    let far_z = W::load(far_z).mul_add(W::splat(z), W::splat(far[2]));
    // Bit patterns order like floats since 0 <= s_min; a negative exit is a miss.
    let enter = near_x.max_nonneg(near_y).max_nonneg(near_z.max_nonneg(W::splat(ray.s_min())));
    let leave = far_x.min_nonneg(far_y).min_nonneg(far_z.min_nonneg(W::splat(ray.s_max())));
    (enter.le_nonneg(leave), enter)
}

/// The boxes that a packet meets: all that any of its rays meets, entered no later than by that ray.
#[inline(always)]
pub(crate) fn intersect_frustum<W: F32x16>(node: &Node, frustum: &Frustum) -> (u32, W) {
    let mut enter = W::splat(frustum.s_min);
    let mut leave = W::splat(frustum.s_max);
    for axis in 0..3 {
        let (near, far) = near_and_far(node, frustum.sides, axis);
        let center = W::splat(frustum.center[axis]);
        let (least, most) = (W::splat(frustum.least_inverse[axis]), W::splat(frustum.most_inverse[axis]));
        let (near, far) = (W::load(near) - center, W::load(far) - center);
        let width = W::splat(frustum.width[axis]);
        let first = (near * least).min(near * most) - width;
        let last = (far * least).max(far * most) + width;
        enter = enter.max_nonneg(first);
        leave = leave.min_nonneg(last);
    }
    (enter.le_nonneg(leave), enter)
}

/// The children in the mask whose boxes any live ray meets, and, if `is_ordered`, where the first ray enters each.
#[inline(always)]
pub(crate) fn intersect_each<W: F32x16>(
    node: &Node,
    rays: &SlabRows,
    sides: &Sides,
    (children, mut enters): (u32, W),
    alive: u32,
    is_ordered: bool,
) -> (u32, W) {
    let (near_x, far_x) = near_and_far(node, sides, 0);
    let (near_y, far_y) = near_and_far(node, sides, 1);
    let (near_z, far_z) = near_and_far(node, sides, 2);
    let [x, y, z] = &rays.inverse;
    let (x, y, z) = (W::load(&x.0), W::load(&y.0), W::load(&z.0));
    let [first_x, first_y, first_z] = &rays.near_offset;
    let (first_x, first_y, first_z) = (W::load(&first_x.0), W::load(&first_y.0), W::load(&first_z.0));
    let [last_x, last_y, last_z] = &rays.far_offset;
    let (last_x, last_y, last_z) = (W::load(&last_x.0), W::load(&last_y.0), W::load(&last_z.0));
    let (s_min, s_max) = (W::load(&rays.s_min.0), W::load(&rays.s_max.0));
    let (mut met, mut rest) = (0, children);
    while rest != 0 {
        let child = rest.trailing_zeros() as usize % WIDTH;
        rest &= rest - 1;
        let enter_x = x.mul_add(W::splat(near_x[child]), first_x);
        let enter_y = y.mul_add(W::splat(near_y[child]), first_y);
        let enter_z = z.mul_add(W::splat(near_z[child]), first_z);
        let leave_x = x.mul_add(W::splat(far_x[child]), last_x);
        let leave_y = y.mul_add(W::splat(far_y[child]), last_y);
        let leave_z = z.mul_add(W::splat(far_z[child]), last_z);
        // As for one ray: see `intersect_boxes`.
        let enter = enter_x.max_nonneg(enter_y).max_nonneg(enter_z.max_nonneg(s_min));
        let leave = leave_x.min_nonneg(leave_y).min_nonneg(leave_z.min_nonneg(s_max));
        let those = enter.le_nonneg(leave) & alive;
        met |= u32::from(those != 0) << child;
        if is_ordered && those != 0 {
            let before = W::splat(0.0) - W::select(those, enter, W::splat(f32::INFINITY));
            enters = W::select(1 << child, W::splat(-before.reduce_max()), enters);
        }
    }
    (met, enters)
}

/// The one child in `mask`; the mask has at most one bit.
#[inline(always)]
pub(crate) fn only_child(node: &Node, mask: u32) -> u32 {
    node.children[mask.trailing_zeros() as usize % WIDTH]
}

/// Pushes the children in `mask` (two or more) onto the stack, the nearest last, except the nearest itself, which is
/// returned. `enter` has the distances.
#[inline(always)]
pub(crate) fn push_by_distance<W: F32x16>(node: &Node, mask: u32, enter: W, room: PushSlots<i64>) -> u32 {
    let but_one = mask & mask.wrapping_sub(1);
    let but_two = but_one & but_one.wrapping_sub(1);
    let but_three = but_two & but_two.wrapping_sub(1);
    if but_three & but_three.wrapping_sub(1) != 0 {
        return push_many(node, mask, enter, room);
    }
    let [a, b, c, d] = enter.first_four(mask, &node.children);
    let (a, b) = (a.min(b), a.max(b));
    if but_two == 0 {
        room.window[0] = MaybeUninit::new(b);
        // SAFETY: that one was written.
        unsafe { room.add(1) };
        return a as u32;
    }
    if but_three == 0 {
        let (nearest, rest) = (a.min(c), a.max(c));
        room.window[0] = MaybeUninit::new(b.max(rest));
        room.window[1] = MaybeUninit::new(b.min(rest));
        // SAFETY: both were written.
        unsafe { room.add(2) };
        return nearest as u32;
    }
    let (c, d) = (c.min(d), c.max(d));
    let (nearest, low) = (a.min(c), a.max(c));
    let (high, farthest) = (b.min(d), b.max(d));
    room.window[0] = MaybeUninit::new(farthest);
    room.window[1] = MaybeUninit::new(low.max(high));
    room.window[2] = MaybeUninit::new(low.min(high));
    // SAFETY: all three were written.
    unsafe { room.add(3) };
    nearest as u32
}

/// As [`push_by_distance`], for any two or more.
#[inline(always)]
fn push_many<W: F32x16>(node: &Node, mask: u32, enter: W, room: PushSlots<i64>) -> u32 {
    put_in_order(node, mask, enter, room.window);
    let count = mask.count_ones() as usize - 1;
    // SAFETY: `count` entries were written, and one more.
    unsafe {
        let nearest = room.window[count % WIDTH].assume_init() as u32;
        room.add(count);
        nearest
    }
}

/// Writes the children in `mask`, the nearest last.
#[inline(always)]
fn put_in_order<W: F32x16>(node: &Node, mask: u32, enter: W, window: &mut [MaybeUninit<i64>; WIDTH]) {
    let keys = enter.lanes_in_bits();
    let by_lane = keys.bits();
    // Each goes to the index that counts the farther ones. All keys differ, so the first slots are all written.
    let mut rest = mask % (1 << WIDTH);
    while rest != 0 {
        let lane = rest.trailing_zeros() as usize % WIDTH;
        rest &= rest - 1;
        let place = (keys.bits_above(by_lane[lane]) & mask).count_ones() as usize % WIDTH;
        window[place] = MaybeUninit::new(stack_entry(by_lane[lane], node.children[lane]));
    }
}

/// As [`push_by_distance`], almost branch-free if there are instructions for it: only for more than four.
#[inline(always)]
pub(crate) fn put_and_take_by_distance<W: F32x16>(
    node: &Node,
    mask: u32,
    enter: W,
    slots: &mut Slots<i64>,
) -> u32 {
    let count = mask.count_ones() as usize;
    let room = slots.room();
    match room.window.first_chunk_mut() {
        Some(four) if count <= 4 => {
            if !enter.store_four_descending(mask, &node.children, four) {
                return push_by_distance(node, mask, enter, room);
            }
        }
        _ => put_in_order(node, mask, enter, room.window),
    }
    // SAFETY: this many entries were written.
    unsafe { room.add(count) };
    slots.pop().map_or(Node::ABSENT, |entry| entry as u32)
}

/// Pushes the children in `mask` (one or more) onto the stack in the order of the node, except the last, which is
/// returned.
#[inline(always)]
pub(crate) fn push_as_built<W: F32x16>(node: &Node, mask: u32, room: PushSlots<u32>) -> u32 {
    W::put_chosen(mask, &node.children, room.window);
    // SAFETY: `count` entries were written, and one more.
    unsafe { room.add(mask.count_ones() as usize - 1) };
    node.children[(31 - mask.leading_zeros()) as usize % WIDTH]
}

/// Pushes the children in `mask`, if any, onto the stack in the order of the node, and pops the last entry,
/// branch-free.
#[inline(always)]
pub(crate) fn put_and_take_as_built<W: F32x16>(node: &Node, mask: u32, slots: &mut Slots<u32>) -> u32 {
    let Some(last) = slots.len.checked_sub(1) else { return Node::ABSENT };
    let child = &node.children[(mask.leading_zeros() ^ 31) as usize % WIDTH];
    // SAFETY: it is one of the first `len`, which are initialised.
    let top = unsafe { slots.entries[last].assume_init_ref() };
    let taken = *select_unpredictable(mask != 0, child, top);
    let room = slots.room();
    W::put_chosen(mask, &node.children, room.window);
    // As many were written as there are bits; one less, or the last, is taken.
    slots.len = last + mask.count_ones() as usize;
    taken
}
