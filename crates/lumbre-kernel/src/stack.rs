//! The stack of a search: a short array, and the heap for what no longer fits.

use crate::lanes::{self, LANE_BITS, Lanes, Room, Slots};
use crate::node::{Node, WIDTH};

/// Entries in the array: many more than a search usually has, but few in tests, where they are not to do always.
pub(crate) const STACK: usize = if cfg!(test) { 3 * WIDTH } else { 256 };

/// The key of a distance above, a reference below: entries have the order of their distances.
#[inline(always)]
pub(crate) fn stack_entry(key: i32, reference: u32) -> i64 {
    (i64::from(key) << 32) | i64::from(reference)
}

/// In which order a search takes the children of a node.
pub(crate) trait Order {
    /// What stands on the stack.
    type Entry: Copy;
    /// Whether a child alone is put as many are, without a branch that would often be foreseen wrongly.
    const PUTS_ONE: bool;
    /// An entry that is never left out.
    fn entry(reference: u32) -> Self::Entry;
    /// What it refers to.
    fn reference(entry: Self::Entry) -> u32;
    /// Whether it lies wholly beyond where a ray ends.
    fn is_beyond(entry: Self::Entry, s_max: f32) -> bool;
    /// Puts the children in `mask`, two or more, or one or more, onto the stack but for the first to be taken, which it answers.
    fn push_children<L: Lanes>(node: &Node, mask: u32, enter: L::Wide, room: Room<Self::Entry>) -> u32;
    /// The same without a branch, as far as it can be: puts all, and takes what then is the last. Where one alone is put as many are,
    /// `mask` may be empty, too: that is what was there before, then.
    fn put_and_take<L: Lanes>(node: &Node, mask: u32, enter: L::Wide, slots: &mut Slots<Self::Entry>) -> u32;
}

/// The nearest first.
pub(crate) enum ByDistance {}

impl Order for ByDistance {
    type Entry = i64;
    const PUTS_ONE: bool = false;

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
    fn push_children<L: Lanes>(node: &Node, mask: u32, enter: L::Wide, room: Room<i64>) -> u32 {
        lanes::push_by_distance(node, mask, enter, room)
    }

    #[inline(always)]
    fn put_and_take<L: Lanes>(node: &Node, mask: u32, enter: L::Wide, slots: &mut Slots<i64>) -> u32 {
        lanes::put_and_take_by_distance(node, mask, enter, slots)
    }
}

/// The last of a node first, wherever they are.
pub(crate) enum AsBuilt {}

impl Order for AsBuilt {
    type Entry = u32;
    const PUTS_ONE: bool = true;

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
    fn push_children<L: Lanes>(node: &Node, mask: u32, _: L::Wide, room: Room<u32>) -> u32 {
        lanes::push_as_built::<L::Wide>(node, mask, room)
    }

    #[inline(always)]
    fn put_and_take<L: Lanes>(node: &Node, mask: u32, _: L::Wide, slots: &mut Slots<u32>) -> u32 {
        lanes::put_and_take_as_built::<L::Wide>(node, mask, slots)
    }
}

/// Last in, first out.
pub(crate) struct Stack<E> {
    // With room for all children of a node.
    slots: Slots<E>,
    // The ones below them: apart, for there seldom are any.
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

    /// Has entries put into the room for all children of a node that there always is. Only afterwards, when nothing else has to be
    /// kept in registers meanwhile, it is made anew.
    #[inline(always)]
    pub(crate) fn put<T>(&mut self, put: impl FnOnce(Room<'_, E>) -> T) -> T {
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
        // In an interpreter, fewer.
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
