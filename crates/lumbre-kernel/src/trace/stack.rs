//! The stack of a traversal, and the two goals that decide its order: the closest hit and any hit.

use crate::intersect::{self, PushSlots, STACK, Simd, Slots};
use crate::simd::LANE_BITS;
use crate::simd::vector::stack_entry;
use crate::tree::node::{Node, WIDTH};

/// The goal of a traversal, which decides the order of a node's children.
pub(crate) trait Goal {
    /// Whether any hit ends the traversal.
    const IS_ANY: bool;
    /// The stack's entry for a subtree.
    type Entry: Copy;
    /// An entry that is never culled.
    fn entry(reference: u32) -> Self::Entry;
    /// The subtree of an entry.
    fn reference(entry: Self::Entry) -> u32;
    /// Whether its bounding box lies beyond the end of the ray.
    fn is_beyond(entry: Self::Entry, s_max: f32) -> bool;
    /// Pushes the children in `mask` (two or more; for any hit one or more) except the first to visit, which is
    /// returned.
    fn push_children<L: Simd>(node: &Node, mask: u32, enter: L::F32x16, room: PushSlots<Self::Entry>) -> u32;
    /// Branch-free variant: pushes all, then pops one. For any hit `mask` may be empty.
    fn push_and_pop<L: Simd>(node: &Node, mask: u32, enter: L::F32x16, slots: &mut Slots<Self::Entry>)
    -> u32;
}

/// The closest hit: nearer children first.
pub(crate) enum ClosestHit {}

impl Goal for ClosestHit {
    const IS_ANY: bool = false;
    type Entry = i64;

    #[inline(always)]
    fn entry(reference: u32) -> i64 {
        stack_entry(i32::MIN, reference)
    }

    #[inline(always)]
    fn reference(entry: i64) -> u32 {
        entry as u32
    }

    #[inline(always)]
    fn is_beyond(entry: i64, s_max: f32) -> bool {
        (entry >> 32) as i32 > s_max.to_bits() as i32 | LANE_BITS
    }

    #[inline(always)]
    fn push_children<L: Simd>(node: &Node, mask: u32, enter: L::F32x16, room: PushSlots<i64>) -> u32 {
        intersect::push_by_distance(node, mask, enter, room)
    }

    #[inline(always)]
    fn push_and_pop<L: Simd>(node: &Node, mask: u32, enter: L::F32x16, slots: &mut Slots<i64>) -> u32 {
        intersect::put_and_take_by_distance(node, mask, enter, slots)
    }
}

/// Any hit: children in the order of the build, the last first.
pub(crate) enum AnyHit {}

impl Goal for AnyHit {
    const IS_ANY: bool = true;
    type Entry = u32;

    #[inline(always)]
    fn entry(reference: u32) -> u32 {
        reference
    }

    #[inline(always)]
    fn reference(entry: u32) -> u32 {
        entry
    }

    #[inline(always)]
    fn is_beyond(_: u32, _: f32) -> bool {
        false
    }

    #[inline(always)]
    fn push_children<L: Simd>(node: &Node, mask: u32, _: L::F32x16, room: PushSlots<u32>) -> u32 {
        intersect::push_as_built::<L::F32x16>(node, mask, room)
    }

    #[inline(always)]
    fn push_and_pop<L: Simd>(node: &Node, mask: u32, _: L::F32x16, slots: &mut Slots<u32>) -> u32 {
        intersect::put_and_take_as_built::<L::F32x16>(node, mask, slots)
    }
}

/// A stack that grows without bound: an array, and the heap for the overflow.
pub(crate) struct Stack<E> {
    // Always has slots for all children of a node.
    slots: Slots<E>,
    // The entries below those of the array; rarely used.
    spilled: Option<Box<Spilled<E>>>,
}

struct Spilled<E> {
    entries: Vec<E>,
}

impl<E: Copy> Stack<E> {
    #[inline(always)]
    pub(crate) fn new() -> Self {
        Self { slots: Slots::new(), spilled: None }
    }

    /// Pushes the children of a node. The array spills afterwards, when fewer registers are live.
    #[inline(always)]
    pub(crate) fn put<T>(&mut self, put: impl FnOnce(PushSlots<'_, E>) -> T) -> T {
        let result = put(self.slots.room());
        if self.slots.len() > STACK - WIDTH {
            self.spill();
        }
        result
    }

    #[inline(always)]
    pub(crate) fn push(&mut self, entry: E) {
        self.slots.push(entry);
        if self.slots.len() > STACK - WIDTH {
            self.spill();
        }
    }

    #[inline(always)]
    pub(crate) fn pop(&mut self) -> Option<E> {
        match self.slots.pop() {
            Some(entry) => Some(entry),
            None if self.spilled.is_none() => None,
            None => self.pop_spilled(),
        }
    }

    #[cold]
    #[inline(never)]
    fn spill(&mut self) {
        let Spilled { entries } =
            &mut **self.spilled.get_or_insert_with(|| Box::new(Spilled { entries: Vec::new() }));
        let bottom = entries.len();
        while let Some(entry) = self.slots.pop() {
            entries.push(entry);
        }
        entries[bottom..].reverse();
    }

    #[cold]
    #[inline(never)]
    fn pop_spilled(&mut self) -> Option<E> {
        let Spilled { entries } = &mut **self.spilled.as_mut()?;
        let count = entries.len().min(STACK / 2);
        let rest = entries.len() - count;
        for &entry in &entries[rest..] {
            self.slots.push(entry);
        }
        entries.truncate(rest);
        if rest == 0 {
            self.spilled = None;
        }
        self.slots.pop()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stack_gives_back_what_it_was_given_in_reverse() {
        let mut stack = Stack::new();
        let mut mirror = Vec::new();
        let mut deepest = 0;
        // Fewer in an interpreter.
        let rounds = if cfg!(miri) { 1_000 } else { 20_000i64 };
        for i in 0..rounds {
            for j in 0..(i * 7 % 9).min(8) {
                let entry = stack_entry((i % 100) as i32 - 50, (i * 8 + j) as u32);
                stack.push(entry);
                mirror.push(entry);
            }
            deepest = deepest.max(mirror.len());
            for _ in 0..(i / 500) % 9 {
                assert_eq!(stack.pop(), mirror.pop());
            }
        }
        while let Some(entry) = mirror.pop() {
            assert_eq!(stack.pop(), Some(entry));
        }
        assert_eq!(stack.pop(), None);
        assert!(deepest > 10 * STACK, "{deepest}");
    }
}
