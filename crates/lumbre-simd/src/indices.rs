//! Whether the indices of a gather are within its table.

/// Checks the largest index of a gather. Instructions take indices as signed numbers, hence the second bound.
#[inline(always)]
pub(crate) fn check_indices(largest: u32, len: usize) {
    if largest as usize >= len.min(1 << 31) {
        refuse_index(largest, len);
    }
}

#[cold]
#[inline(never)]
fn refuse_index(index: u32, len: usize) -> ! {
    panic!("index {index} of a table of {len}");
}
