//! The stack of a search: a short array, and the heap for what no longer fits.

/// Entries in the array: a power of two, many more than a search usually has.
pub(crate) const STACK: usize = 128;

/// The array.
pub(crate) type Entries = [i64; STACK];

/// The key of a distance above, a reference below: entries have the order of their distances.
#[inline(always)]
pub(crate) fn stack_entry(key: i32, reference: u32) -> i64 {
    (i64::from(key) << 32) | i64::from(reference)
}

/// Last in, first out.
pub(crate) struct Stack {
    pub(crate) entries: Entries,
    /// How many are in the array.
    pub(crate) top: usize,
    // The ones below them.
    spilled: Vec<i64>,
}

impl Stack {
    #[inline(always)]
    pub(crate) fn new() -> Self {
        Self { entries: [0; STACK], top: 0, spilled: Vec::new() }
    }

    /// Makes room for eight more in the array.
    #[inline(always)]
    pub(crate) fn make_room(&mut self) {
        if self.top > STACK - 8 {
            self.spill();
        }
    }

    /// Adds one. There must be room.
    #[inline(always)]
    pub(crate) fn push(&mut self, entry: i64) {
        self.entries[self.top % STACK] = entry;
        self.top += 1;
    }

    #[inline(always)]
    pub(crate) fn pop(&mut self) -> Option<i64> {
        if self.top == 0 && !self.refill() {
            return None;
        }
        self.top -= 1;
        Some(self.entries[self.top % STACK])
    }

    #[cold]
    #[inline(never)]
    fn spill(&mut self) {
        self.spilled.extend_from_slice(&self.entries[..self.top]);
        self.top = 0;
    }

    #[cold]
    #[inline(never)]
    fn refill(&mut self) -> bool {
        let count = self.spilled.len().min(STACK / 2);
        let rest = self.spilled.len() - count;
        self.entries[..count].copy_from_slice(&self.spilled[rest..]);
        self.spilled.truncate(rest);
        self.top = count;
        count > 0
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
            stack.make_room();
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
