//! Partitions primitives by a split, in place and on several threads.
//!
//! Pieces of a fixed length are partitioned independently; then elements on the wrong side of the middle are swapped.
//! The result does not depend on the number of threads, but the order of the primitives changes.

use rayon::prelude::*;

use crate::build::primitive::{Bounds, Primitive};
use crate::build::sah::{PartPiece, Split};
use crate::intersect::Isa;

/// Primitives per piece: with a buffer of the same length, they fit a core's cache.
const PIECE: usize = 2048;

/// Moves the primitives left of a split in front of the others. `is_shared` says whether other threads may help.
pub(crate) fn part(isa: Isa, primitives: &mut [Primitive], split: &Split, is_shared: bool) {
    let count = primitives.len();
    let room = || vec![Bounds::EMPTY; PIECE.min(count)];
    let part = |buffer: &mut Vec<Primitive>, primitives: &mut [Primitive]| {
        isa.run(PartPiece { primitives, split, buffer })
    };
    let lefts: Vec<usize> = if is_shared {
        primitives.par_chunks_mut(PIECE).with_min_len(4).map_init(room, part).collect()
    } else {
        let mut buffer = room();
        primitives.chunks_mut(PIECE).map(|piece| part(&mut buffer, piece)).collect()
    };
    let pieces = lefts.iter().enumerate().map(|(piece, left)| {
        let start = piece * PIECE;
        (start, start + left, (start + PIECE).min(count))
    });
    let middle = split.left;
    let (low, high) = primitives.split_at_mut(middle);
    let astray_low = runs(low, 0, pieces.clone().map(|(_, left_end, end)| (left_end, end.min(middle))));
    let astray_high = runs(high, middle, pieces.map(|(start, left_end, _)| (start.max(middle), left_end)));
    let pairs = pair(astray_low, astray_high);
    let swap = |(low, high): (&mut [Primitive], &mut [Primitive])| low.swap_with_slice(high);
    if is_shared {
        pairs.into_par_iter().with_min_len(4).for_each(swap);
    } else {
        pairs.into_iter().for_each(swap);
    }
}

/// The parts of a list between these positions; the list begins at position `first`. Parts that end before they begin
/// are empty.
fn runs(
    mut rest: &mut [Primitive],
    mut first: usize,
    places: impl Iterator<Item = (usize, usize)>,
) -> Vec<&mut [Primitive]> {
    let mut runs = Vec::new();
    for (start, end) in places.filter(|(start, end)| start < end) {
        let (_, from_start) = std::mem::take(&mut rest).split_at_mut(start - first);
        let (run, behind) = from_start.split_at_mut(end - start);
        runs.push(run);
        rest = behind;
        first = end;
    }
    runs
}

/// Cuts two lists of equal length into pairs of parts of equal length.
fn pair<'a>(
    low: Vec<&'a mut [Primitive]>,
    high: Vec<&'a mut [Primitive]>,
) -> Vec<(&'a mut [Primitive], &'a mut [Primitive])> {
    let mut pairs = Vec::with_capacity(low.len() + high.len());
    let (mut low, mut high) = (low.into_iter(), high.into_iter());
    let (mut a, mut b) = (low.next(), high.next());
    while let (Some(first), Some(second)) = (&mut a, &mut b) {
        let len = first.len().min(second.len());
        pairs.extend(first.split_off_mut(..len).zip(second.split_off_mut(..len)));
        if first.is_empty() {
            a = low.next();
        }
        if second.is_empty() {
            b = high.next();
        }
    }
    pairs
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::build::sah::{BestSplit, Binning, Bins, Fill, FindCenters};

    #[test]
    fn the_left_side_of_a_split_comes_first_for_any_threads() {
        let isa = Isa::best();
        for (count, skew) in
            [(3, 1), (PIECE, 2), (3 * PIECE + 17, 1), (11 * PIECE - 5, 5), (40 * PIECE + 1, 3)]
        {
            // Scattered, in an order unrelated to their positions.
            let boxed = |i: usize| {
                let place = |factor: usize| ((i * factor + 7) % 1009) as f32 / 1009.0;
                let low = [place(389).powi(skew), 0.3 * place(611), 0.2 * place(127)];
                Bounds::new(low, low.map(|x| x + 0.001), 0, i as u32)
            };
            let primitives: Vec<Primitive> = (0..count).map(boxed).collect();
            let centers = isa.run(FindCenters { primitives: &primitives });
            let binning = Binning::new(&centers, count);
            let mut bins = Bins::EMPTY;
            isa.run(Fill::<false> { primitives: &primitives, binning, bins: &mut bins, traits: &[] });
            let split = isa.run(BestSplit::<false> { bins: &bins, binning }).unwrap();
            let [mut alone, mut shared] = [primitives.clone(), primitives];
            part(isa, &mut alone, &split, false);
            part(isa, &mut shared, &split, true);
            let ids = |list: &[Primitive]| list.iter().map(Bounds::second).collect::<Vec<_>>();
            assert_eq!(ids(&alone), ids(&shared));
            assert!(0 < split.left && split.left < count);
            assert!(alone[..split.left].iter().all(|primitive| split.is_left(primitive)));
            assert!(!alone[split.left..].iter().any(|primitive| split.is_left(primitive)));
            let mut all = ids(&alone);
            all.sort_unstable();
            assert!(all.into_iter().eq(0..count as u32));
        }
    }
}
