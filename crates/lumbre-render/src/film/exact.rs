//! Sums that do not depend on the order of their addends.

/// A sum of numbers in fixed point. Each number is rounded once, to a multiple of 2⁻⁶³ (1.1 · 10⁻¹⁹);
/// additions are exact. So the same numbers give the same bits in any order and grouping.
///
/// Sixteen million numbers of at most [`ExactSum::LIMIT`] fit; beyond that it stays at its largest value.
///
/// It is aligned to eight bytes, so that a pixel of seven sums and two counts has no padding.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(Rust, packed(8))]
pub struct ExactSum(i128);

/// Binary places after the point.
const PLACES: i32 = 63;

impl ExactSum {
    /// The largest magnitude of a number: 2⁴⁰, about 10¹².
    pub const LIMIT: f64 = (1_u64 << 40) as f64;

    /// Whether a number can be added.
    #[inline]
    pub fn holds(number: f64) -> bool {
        number.abs() <= Self::LIMIT
    }

    /// Adds a number; one that is larger than [`ExactSum::LIMIT`] counts as that, and NaN as nothing.
    #[inline]
    pub fn add(&mut self, number: f64) {
        self.0 = self.0.saturating_add(fixed(number));
    }

    /// Adds another sum.
    #[inline]
    pub fn merge(&mut self, other: Self) {
        self.0 = self.0.saturating_add(other.0);
    }

    /// The sum.
    #[inline]
    pub fn value(self) -> f64 {
        self.0 as f64 * (1.0 / (1_u64 << PLACES) as f64)
    }

    /// The sum in units of 2⁻⁶³.
    pub fn units(self) -> i128 {
        self.0
    }

    /// A sum of this many units of 2⁻⁶³.
    pub fn from_units(units: i128) -> Self {
        Self(units)
    }
}

/// A number in units of 2⁻⁶³, halves rounded away from zero. It works on the bits, because conversions
/// from floating point to 128-bit integers are slow.
#[inline]
fn fixed(number: f64) -> i128 {
    const MANTISSA: i32 = 52;
    if number.is_nan() {
        return 0;
    }
    let bits = number.clamp(-ExactSum::LIMIT, ExactSum::LIMIT).to_bits();
    let exponent = (bits >> MANTISSA & 0x7ff) as i32;
    let mantissa = bits & ((1 << MANTISSA) - 1) | u64::from(exponent > 0) << MANTISSA;
    let shift = exponent.max(1) - 1023 - MANTISSA + PLACES;
    let magnitude = if shift >= 0 {
        i128::from(mantissa) << shift
    } else if shift > -64 {
        i128::from(((mantissa >> (-shift - 1)) + 1) >> 1)
    } else {
        0
    };
    if bits >> 63 == 1 { -magnitude } else { magnitude }
}

#[cfg(test)]
mod tests {
    use lumbre_math::random::RandomStream;

    use super::*;

    #[test]
    fn a_sum_is_the_same_in_any_order_and_grouping() {
        let mut random = RandomStream::new(5);
        let numbers: Vec<f64> = (0..1000)
            .map(|_| (random.next_f64() - 0.5) * 2.0_f64.powi(random.next_below(70) as i32 - 40))
            .collect();
        let sum = |numbers: &mut dyn Iterator<Item = &f64>| {
            let mut sum = ExactSum::default();
            numbers.for_each(|&number| sum.add(number));
            sum
        };
        let whole = sum(&mut numbers.iter());
        assert_eq!(sum(&mut numbers.iter().rev()), whole);
        let mut parts: Vec<ExactSum> = numbers.chunks(37).map(|part| sum(&mut part.iter())).collect();
        while parts.len() > 1 {
            let part = parts.swap_remove(random.next_below(parts.len()));
            let into = random.next_below(parts.len());
            parts[into].merge(part);
        }
        assert_eq!(parts[0], whole);
        let plain: f64 = numbers.iter().sum();
        assert!((whole.value() - plain).abs() < 1e-6 * plain.abs().max(1.0));
    }

    #[test]
    fn numbers_are_rounded_to_the_last_place_and_held_to_the_limit() {
        let unit = 2.0_f64.powi(-63);
        let cases = [
            (0.0, 0),
            (unit, 1),
            (-3.0 * unit, -3),
            (0.5 * unit, 1),
            (-0.5 * unit, -1),
            (0.499 * unit, 0),
            (2.5 * unit, 3),
            (1e-300, 0),
            (f64::MIN_POSITIVE / 4.0, 0),
            (1.0, 1 << 63),
            (1.5 + unit, (1 << 63) + (1 << 62)),
            (ExactSum::LIMIT, 1 << 103),
            (1e300, 1 << 103),
            (f64::NEG_INFINITY, -(1 << 103)),
            (f64::NAN, 0),
        ];
        for (number, expected) in cases {
            let mut sum = ExactSum::default();
            sum.add(number);
            assert_eq!(sum.units(), expected, "{number}");
        }
        let mut random = RandomStream::new(6);
        for _ in 0..10_000 {
            let number = (random.next_f64() - 0.5) * 2.0_f64.powi(random.next_below(100) as i32 - 60);
            let mut sum = ExactSum::default();
            sum.add(number);
            assert!((sum.value() - number).abs() <= 0.5 * unit, "{number}");
        }
    }
}
