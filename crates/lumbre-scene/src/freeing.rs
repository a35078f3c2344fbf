//! Lists that are freed as they are used up.

/// The items of a list, whose memory is freed as they are taken: descriptions are as large as what is made of them.
pub fn freeing<T>(mut items: Vec<T>) -> impl Iterator<Item = T> {
    const PIECE: usize = 1 << 14;
    items.reverse();
    std::iter::from_fn(move || {
        let item = items.pop();
        if items.len().is_multiple_of(PIECE) {
            items.shrink_to_fit();
        }
        item
    })
}
