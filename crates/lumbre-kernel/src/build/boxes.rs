//! A list of boxes that can be shortened in place.

use std::ops::{Deref, DerefMut};

use bytemuck::{Pod, Zeroable};
use rayon::prelude::*;

use crate::build::primitive::Bounds;

/// Half of a box. For an alignment above 16 bytes, the standard library shrinks an allocation by copying it.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C, align(16))]
struct Half([i32; 4]);

/// Boxes, as a vector would hold them.
pub(crate) struct Boxes {
    // One more half than needed, so that boxes can be aligned.
    halves: Vec<Half>,
    count: usize,
}

impl Boxes {
    /// `count` empty boxes.
    pub(crate) fn empty(count: usize) -> Self {
        Self { halves: fill(2 * count + 1, Half([Bounds::EMPTY_LANE; 4])), count }
    }

    /// Halves before the first box.
    fn start(&self) -> usize {
        self.halves.as_ptr().addr() % align_of::<Bounds>() / size_of::<Half>()
    }

    /// Keeps the first `count` boxes and frees the memory of the others.
    pub(crate) fn shorten(&mut self, count: usize) {
        let before = self.start();
        self.count = self.count.min(count);
        self.halves.truncate(2 * self.count + 1);
        self.halves.shrink_to_fit();
        // The allocator may have moved them.
        let now = self.start();
        self.halves.copy_within(before..before + 2 * self.count, now);
    }
}

/// Like `vec![value; count]`, filled by several threads if each gets enough elements.
pub(crate) fn fill<T: Clone + Send + Sync>(count: usize, value: T) -> Vec<T> {
    const LEAST: usize = 1 << 14;
    (0..count).into_par_iter().with_min_len(LEAST).map(|_| value.clone()).collect()
}

impl Deref for Boxes {
    type Target = [Bounds];

    fn deref(&self) -> &[Bounds] {
        bytemuck::cast_slice(&self.halves[self.start()..][..2 * self.count])
    }
}

impl DerefMut for Boxes {
    fn deref_mut(&mut self) -> &mut [Bounds] {
        let start = self.start();
        bytemuck::cast_slice_mut(&mut self.halves[start..][..2 * self.count])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_stay_when_others_go() {
        for (count, kept) in [(0, 0), (1, 1), (1, 0), (1000, 1), (100_000, 33_333), (10, 20)] {
            let mut boxes = Boxes::empty(count);
            assert_eq!(boxes.len(), count);
            for (place, bounds) in boxes.iter_mut().enumerate() {
                *bounds = Bounds::new([0.0; 3], [0.5; 3], place as u32, 7);
            }
            boxes.shorten(kept);
            assert_eq!(boxes.len(), count.min(kept));
            for (place, bounds) in boxes.iter().enumerate() {
                assert_eq!(
                    (bounds.first(), bounds.second(), bounds.range2(1)[1]),
                    (place as u32, 7, 1 << 28)
                );
            }
        }
    }
}
