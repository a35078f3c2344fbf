//! Arrays of a tree: owned, or borrowed from a mapped file.

use std::fmt;
use std::marker::PhantomData;
use std::ops::{Deref, Range};
use std::sync::Arc;

use bytemuck::Pod;
use memmap2::Mmap;

/// An array. For many accesses, take the slice once.
#[derive(Clone)]
pub(crate) enum Store<T> {
    Owned(Vec<T>),
    Mapped(Part<T>),
}

/// The location of an array in a mapped file.
#[derive(Clone)]
pub(crate) struct Part<T> {
    file: Arc<Mmap>,
    // A whole number of aligned elements.
    bytes: Range<usize>,
    of: PhantomData<T>,
}

impl<T: Pod> Store<T> {
    /// The elements at these bytes; `None` if the file is too short or the bytes are not aligned.
    pub(crate) fn mapped(file: &Arc<Mmap>, bytes: Range<usize>) -> Option<Self> {
        bytemuck::try_cast_slice::<u8, T>(file.get(bytes.clone())?).ok()?;
        Some(Self::Mapped(Part { file: Arc::clone(file), bytes, of: PhantomData }))
    }

    /// The array for changes; becomes owned.
    pub(crate) fn to_mut(&mut self) -> &mut Vec<T> {
        if let Self::Mapped(_) = self {
            *self = Self::Owned(self.to_vec());
        }
        match self {
            Self::Owned(elements) => elements,
            Self::Mapped(_) => unreachable!("it was taken over"),
        }
    }

    /// Bytes of owned memory.
    pub(crate) fn own_bytes(&self) -> usize {
        match self {
            Self::Owned(elements) => elements.capacity() * size_of::<T>(),
            Self::Mapped(_) => 0,
        }
    }
}

impl<T: Pod> Deref for Store<T> {
    type Target = [T];

    #[inline(always)]
    fn deref(&self) -> &[T] {
        match self {
            Self::Owned(elements) => elements,
            Self::Mapped(part) => bytemuck::cast_slice(&part.file[part.bytes.clone()]),
        }
    }
}

impl<T> Default for Store<T> {
    fn default() -> Self {
        Self::Owned(Vec::new())
    }
}

impl<T> From<Vec<T>> for Store<T> {
    fn from(elements: Vec<T>) -> Self {
        Self::Owned(elements)
    }
}

impl<'a, T: Pod> IntoIterator for &'a Store<T> {
    type Item = &'a T;
    type IntoIter = std::slice::Iter<'a, T>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

impl<T: Pod + fmt::Debug> fmt::Debug for Store<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        (**self).fmt(f)
    }
}
