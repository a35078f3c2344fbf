//! Random numbers as functions of words, over lanes.

use crate::{Real, UInt};

/// Four words that any change of these four changes altogether.
///
/// Source: Jarzynski, Olano, "Hash Functions for GPU Rendering", JCGT 9(3), 2020.
#[inline(always)]
pub fn pcg4d<U: UInt>(words: [U; 4]) -> [U; 4] {
    let (factor, addend) = (U::splat(1_664_525), U::splat(1_013_904_223));
    let [x, y, z, w] = words;
    let words = [x * factor + addend, y * factor + addend, z * factor + addend, w * factor + addend];
    let [x, y, z, w] = stir(words);
    stir([x ^ x.shr::<16>(), y ^ y.shr::<16>(), z ^ z.shr::<16>(), w ^ w.shr::<16>()])
}

#[inline(always)]
fn stir<U: UInt>([x, y, z, w]: [U; 4]) -> [U; 4] {
    let x = x + y * w;
    let y = y + z * x;
    let z = z + x * y;
    let w = w + y * z;
    [x, y, z, w]
}

/// A uniform number in [0, 1) from a word: its 24 high bits.
#[inline(always)]
pub fn uniform<R: Real>(word: R::UInt) -> R {
    R::from_int(word.shr::<8>()) * R::splat(1.0 / 16_777_216.0)
}

#[cfg(test)]
mod tests {
    use std::num::Wrapping;

    use super::*;

    #[test]
    fn a_flipped_bit_flips_half_of_the_bits() {
        let (mut flipped, mut count) = (0, 0);
        for i in 0..2000_u32 {
            let words = [i, i ^ 0x55, 7, i.wrapping_mul(0x9e37_79b9)].map(Wrapping);
            let hash = pcg4d(words);
            let mut other = words;
            other[i as usize % 4] ^= Wrapping(1 << (i / 4 % 32));
            for (a, b) in hash.into_iter().zip(pcg4d(other)) {
                // The high bits, from which numbers are made.
                flipped += ((a ^ b).0 >> 8).count_ones();
                count += 24;
            }
        }
        let share = f64::from(flipped) / f64::from(count);
        // The highest bits of a word reach fewer.
        assert!((share - 0.5).abs() < 2.5e-2, "{share}");
    }

    #[test]
    fn numbers_are_uniform_and_uncorrelated() {
        let count = 100_000_u32;
        let mut means = [0.0; 4];
        let mut products = [0.0; 5];
        let mut last = [0.5_f64; 4];
        for i in 0..count {
            let numbers = pcg4d([3, 5, 11, i].map(Wrapping)).map(|word| f64::from(uniform::<f32>(word)));
            for k in 0..4 {
                assert!((0.0..1.0).contains(&numbers[k]));
                means[k] += numbers[k] / f64::from(count);
                products[k] += (numbers[k] - 0.5) * (numbers[(k + 1) % 4] - 0.5) / f64::from(count);
            }
            products[4] += (numbers[0] - 0.5) * (last[0] - 0.5) / f64::from(count);
            last = numbers;
        }
        // Standard errors are 9e-4 and 2.6e-4.
        assert!(means.into_iter().all(|mean| (mean - 0.5).abs() < 4e-3), "{means:?}");
        assert!(products.into_iter().all(|product| product.abs() < 1.2e-3), "{products:?}");
        assert_eq!(uniform::<f32>(Wrapping(u32::MAX)), 1.0 - f32::EPSILON / 2.0);
    }
}
