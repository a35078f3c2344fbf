//! The Morton order of primitives, by which a fast build splits.
//!
//! C. Lauterbach, M. Garland, S. Sengupta, D. Luebke, D. Manocha, "Fast BVH Construction on GPUs", Computer Graphics
//! Forum 28(2), 2009. Unlike there, SAH splits a cell that holds many primitives, so that small details of a large
//! scene get a good tree too.

use rayon::prelude::*;

use crate::build::primitive::Primitive;
use crate::build::sah::Centers;

/// Bits of a code on each axis.
const BITS: u32 = 10;
/// Maximum leading bits of the first, radix pass.
const DEALT: u32 = 12;

/// The code of a centre, and the index of its primitive.
pub(crate) type Code = [u32; 2];

/// Sorts primitives along the curve into `sorted`; returns their codes in that order.
pub(crate) fn sort(primitives: &[Primitive], sorted: &mut [Primitive], centers: &Centers) -> Vec<Code> {
    let cells = Cells::new(centers);
    let codes: Vec<Code> = primitives
        .par_iter()
        .enumerate()
        .with_min_len(4096)
        .map(|(place, primitive)| [cells.code(primitive), place as u32])
        .collect();
    let mut dealt = deal(&codes);
    drop(codes);
    // The index makes every code unique, so that the order is unique.
    dealt.hands().into_par_iter().for_each(|hand| hand.sort_unstable());
    sorted.par_iter_mut().zip(&dealt.codes).with_min_len(4096).for_each(|(place, code)| {
        *place = primitives[code[1] as usize];
    });
    dealt.codes
}

/// Maps a centre to its cell.
struct Cells {
    start: [i32; 3],
    factor: [f32; 3],
}

impl Cells {
    // Cells are cubes.
    fn new(centers: &Centers) -> Self {
        let sizes = centers.sizes();
        let size = sizes.into_iter().fold(0.0, f32::max);
        let factor = if size > 0.0 { ((1 << BITS) as f32 - 0.5) / size } else { 0.0 };
        Self { start: centers.start(), factor: [factor; 3] }
    }

    #[inline(always)]
    fn code(&self, primitive: &Primitive) -> u32 {
        let center2 = primitive.center2();
        let cell = |axis: usize| {
            let along = (i64::from(center2[axis]) - i64::from(self.start[axis])) as f32 * self.factor[axis];
            spread((along as u32).min((1 << BITS) - 1))
        };
        cell(0) << 2 | cell(1) << 1 | cell(2)
    }
}

/// Spreads ten bits with two zeros before each.
#[inline(always)]
fn spread(x: u32) -> u32 {
    let x = (x | x << 16) & 0x0300_00ff;
    let x = (x | x << 8) & 0x0300_f00f;
    let x = (x | x << 4) & 0x030c_30c3;
    (x | x << 2) & 0x0924_9249
}

/// Codes bucketed by their first bits.
struct Dealt {
    codes: Vec<Code>,
    ends: Vec<usize>,
}

impl Dealt {
    fn hands(&mut self) -> Vec<&mut [Code]> {
        let mut rest = &mut self.codes[..];
        let mut start = 0;
        let mut hands = Vec::new();
        for &end in &self.ends {
            let hand = rest.split_off_mut(..end - start).unwrap_or_default();
            start = end;
            if hand.len() > 1 {
                hands.push(hand);
            }
        }
        hands
    }
}

fn deal(codes: &[Code]) -> Dealt {
    // About one bucket per code, if these are few.
    let bits = DEALT.min((codes.len() + 1).ilog2());
    let hand_of = |code: &Code| (code[0] >> (3 * BITS - bits)) as usize;
    let mut ends = vec![0; 1 << bits];
    for code in codes {
        ends[hand_of(code)] += 1;
    }
    let mut sum = 0;
    for end in &mut ends {
        let count = *end;
        *end = sum;
        sum += count;
    }
    let mut dealt = vec![[0; 2]; codes.len()];
    for code in codes {
        let place = &mut ends[hand_of(code)];
        dealt[*place] = *code;
        *place += 1;
    }
    Dealt { codes: dealt, ends }
}

/// Where to cut a range of differing codes: at the first bit in which the first and the last code differ.
pub(crate) fn cut(codes: &[Code]) -> Option<usize> {
    let (first, last) = (codes.first()?[0], codes.last()?[0]);
    let differing = first ^ last;
    if differing == 0 {
        return None;
    }
    let bit = 1 << (31 - differing.leading_zeros());
    Some(codes.partition_point(|code| code[0] & bit == 0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_are_spread_by_threes() {
        for x in [0, 1, 2, 5, 0x155, 0x2aa, 0x3ff] {
            let expected = (0..BITS).fold(0, |all, bit| all | (x >> bit & 1) << (3 * bit));
            assert_eq!(spread(x), expected, "{x}");
        }
    }

    #[test]
    fn codes_are_cut_where_their_first_differing_bit_turns() {
        let codes: Vec<Code> = [0x20, 0x21, 0x2f, 0x34, 0x3a].map(|code| [code, 7]).to_vec();
        assert_eq!(cut(&codes), Some(3));
        assert_eq!(cut(&codes[..3]), Some(2));
        assert_eq!(cut(&[[5, 2], [5, 3]]), None);
    }
}
