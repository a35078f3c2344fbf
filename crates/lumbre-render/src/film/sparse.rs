//! Sums that most tiles do not have.

/// A value for each pixel of a tile, without memory as long as all are the default.
#[derive(Clone, Debug)]
pub(super) struct Sparse<T> {
    /// Number of values; 0 if they are not requested.
    len: usize,
    /// Empty, or one per pixel.
    values: Vec<T>,
}

impl<T: Copy + Default + PartialEq> Sparse<T> {
    pub(super) fn new(len: usize) -> Self {
        Self { len, values: Vec::new() }
    }

    pub(super) fn len(&self) -> usize {
        self.len
    }

    /// Whether any value is not the default.
    pub(super) fn is_used(&self) -> bool {
        self.values.iter().any(|value| *value != T::default())
    }

    /// The value of a pixel; the default if values are not requested.
    #[inline]
    pub(super) fn get(&self, at: usize) -> T {
        self.values.get(at).copied().unwrap_or_default()
    }

    /// The value of a pixel, mutable.
    ///
    /// # Panics
    /// If values are not requested.
    #[inline]
    pub(super) fn get_mut(&mut self, at: usize) -> &mut T {
        if self.values.is_empty() {
            self.values = vec![T::default(); self.len];
        }
        &mut self.values[at]
    }

    /// Sets the value of a pixel, if values are requested.
    pub(super) fn set(&mut self, at: usize, value: T) {
        let is_stored = !self.values.is_empty() || value != T::default();
        if at < self.len && is_stored {
            *self.get_mut(at) = value;
        }
    }

    /// All values.
    pub(super) fn iter(&self) -> impl Iterator<Item = T> + '_ {
        (0..self.len).map(|at| self.get(at))
    }
}

impl<T: Copy + Default + PartialEq> PartialEq for Sparse<T> {
    fn eq(&self, other: &Self) -> bool {
        self.len == other.len && self.iter().eq(other.iter())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_take_memory_once_one_is_not_the_default() {
        let mut values = Sparse::<u32>::new(5);
        values.set(3, 0);
        values.set(7, 9);
        assert_eq!((values.values.len(), values.len(), values.is_used(), values.get(3)), (0, 5, false, 0));
        values.set(3, 8);
        *values.get_mut(2) += 4;
        assert_eq!(values.iter().collect::<Vec<_>>(), [0, 0, 4, 8, 0]);
        assert!(values.is_used() && values != Sparse::new(5));
        values.set(3, 0);
        values.set(2, 0);
        // The same numbers, in either representation.
        assert!(!values.is_used() && values == Sparse::new(5) && values != Sparse::new(4));
        let mut none = Sparse::<u32>::new(0);
        none.set(0, 6);
        assert_eq!((none.get(0), none.iter().count()), (0, 0));
    }
}
