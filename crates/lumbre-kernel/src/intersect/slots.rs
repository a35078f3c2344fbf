//! The array of a stack of nodes.

use std::mem::MaybeUninit;

use crate::tree::node::WIDTH;

/// Entries in the array of a stack. Few in tests, so that spilling is tested.
pub(crate) const STACK: usize = if cfg!(test) { 3 * WIDTH } else { 256 };

/// The array of a stack; not cleared for every ray.
#[repr(C, align(64))]
pub(crate) struct Slots<E> {
    // In the cache line of the first entries.
    pub(super) len: usize,
    // The first `len` are initialised, and `len <= STACK`.
    pub(super) entries: [MaybeUninit<E>; STACK],
}

impl<E: Copy> Slots<E> {
    #[inline(always)]
    pub(crate) fn new() -> Self {
        Self { entries: [const { MaybeUninit::uninit() }; STACK], len: 0 }
    }

    /// `N` arrays on the heap, initialised in place.
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

    /// Pushes an entry.
    ///
    /// # Panics
    /// If the array is full.
    #[inline(always)]
    pub(crate) fn push(&mut self, entry: E) {
        self.entries[self.len] = MaybeUninit::new(entry);
        self.len += 1;
    }

    /// Slots for all children of a node.
    ///
    /// # Panics
    /// If there are too few.
    #[inline(always)]
    pub(crate) fn room(&mut self) -> PushSlots<'_, E> {
        let len = self.len;
        let window = (&mut self.entries[len..len + WIDTH]).try_into().expect("as many");
        PushSlots { window, end: &mut self.len, len }
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

/// The next slots of an array.
pub(crate) struct PushSlots<'s, E> {
    pub(super) window: &'s mut [MaybeUninit<E>; WIDTH],
    end: &'s mut usize,
    // The length field of the array.
    len: usize,
}

impl<E> PushSlots<'_, E> {
    /// Adds the first `count` of them.
    ///
    /// # Safety
    /// They have been written.
    #[inline(always)]
    pub(super) unsafe fn add(self, count: usize) {
        *self.end = self.len + count;
    }
}
