//! The stack of a search: a short array, and the heap for what no longer fits.

use crate::lanes::Slots;

/// Entries in the array: a power of two, many more than a search usually has.
pub(crate) const STACK: usize = 128;

/// The key of a distance above, a reference below: entries have the order of their distances.
#[inline(always)]
pub(crate) fn stack_entry(key: i32, reference: u32) -> i64 {
    (i64::from(key) << 32) | i64::from(reference)
}

/// Last in, first out.
pub(crate) struct Stack {
    slots: Slots,
    // The ones below them.
    spilled: Vec<i64>,
}

impl Stack {
    #[inline(always)]
    pub(crate) fn new() -> Self {
        Self { slots: Slots::new(), spilled: Vec::new() }
    }

    /// Somewhere for eight more.
    #[inline(always)]
    pub(crate) fn with_room(&mut self) -> &mut Slots {
        if self.slots.len() > STACK - 8 {
            self.spill();
        }
        &mut self.slots
    }

    #[inline(always)]
    pub(crate) fn push(&mut self, entry: i64) {
        self.with_room().push(entry);
    }

    #[inline(always)]
    pub(crate) fn pop(&mut self) -> Option<i64> {
        self.slots.pop().or_else(|| self.pop_spilled())
    }

    #[cold]
    #[inline(never)]
    fn spill(&mut self) {
        let bottom = self.spilled.len();
        while let Some(entry) = self.slots.pop() {
            self.spilled.push(entry);
        }
        self.spilled[bottom..].reverse();
    }

    #[cold]
    #[inline(never)]
    fn pop_spilled(&mut self) -> Option<i64> {
        let count = self.spilled.len().min(STACK / 2);
        let rest = self.spilled.len() - count;
        for &entry in &self.spilled[rest..] {
            self.slots.push(entry);
        }
        self.spilled.truncate(rest);
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
        for i in 0..20_000i64 {
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
