//! Half-precision numbers (IEEE 754 binary16) as their 16 bits.

/// The exact value of 16 bits.
pub fn half_to_f32(bits: u16) -> f32 {
    let sign = u32::from(bits & 0x8000) << 16;
    let exponent = u32::from(bits >> 10) & 0x1F;
    let fraction = u32::from(bits & 0x3FF);
    match (exponent, fraction) {
        (0, _) => {
            // A subnormal is a multiple of 2^-24, exact in f32.
            let magnitude = fraction as f32 * 2f32.powi(-24);
            f32::from_bits(magnitude.to_bits() | sign)
        }
        (31, _) => f32::from_bits(sign | 0x7F80_0000 | fraction << 13),
        _ => f32::from_bits(sign | (exponent + 112) << 23 | fraction << 13),
    }
}

/// The nearest half, ties to even; overflow gives infinity, and NaN stays NaN.
pub fn f32_to_half(v: f32) -> u16 {
    let bits = v.to_bits();
    let sign = (bits >> 16) as u16 & 0x8000;
    let magnitude = bits & 0x7FFF_FFFF;
    if magnitude > 0x7F80_0000 {
        return sign | 0x7E00;
    }
    // 65520 is half-way between the largest half and the next step: it and everything above round to infinity.
    if magnitude >= 0x477F_F000 {
        return sign | 0x7C00;
    }
    // Below 2^-14 the steps are 2^-24: adding 2^-1, whose last bit is 2^-24, rounds to them.
    if magnitude < 0x3880_0000 {
        let rounded = f32::from_bits(magnitude) + 0.5;
        return sign | (rounded.to_bits() - 0.5f32.to_bits()) as u16;
    }
    // Rebias the exponent, and round off 13 bits; a carry into the exponent is right.
    let odd = magnitude >> 13 & 1;
    let rounded = magnitude - (112 << 23) + 0xFFF + odd;
    sign | (rounded >> 13) as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_half_comes_back() {
        for bits in 0..=u16::MAX {
            let v = half_to_f32(bits);
            if v.is_nan() {
                assert!(half_to_f32(f32_to_half(v)).is_nan());
            } else {
                assert_eq!(f32_to_half(v), bits, "{v}");
            }
        }
        assert_eq!(half_to_f32(0x3C00), 1.0);
        assert_eq!(half_to_f32(0xC100), -2.5);
        assert_eq!(half_to_f32(0x7BFF), 65504.0);
        assert_eq!(half_to_f32(0x0001), 2f32.powi(-24));
        assert_eq!(half_to_f32(0xFC00), f32::NEG_INFINITY);
    }

    #[test]
    fn rounding_goes_to_the_nearest_and_ties_to_even() {
        for bits in 0..0x7BFFu16 {
            let (low, high) = (half_to_f32(bits), half_to_f32(bits + 1));
            let middle = low + (high - low) / 2.0;
            let even = if bits % 2 == 0 { bits } else { bits + 1 };
            assert_eq!(f32_to_half(middle), even);
            assert_eq!(f32_to_half(middle.next_down()), bits);
            assert_eq!(f32_to_half(middle.next_up()), bits + 1);
            assert_eq!(f32_to_half(-middle), even | 0x8000);
        }
        assert_eq!(f32_to_half(65519.996), 0x7BFF);
        assert_eq!(f32_to_half(65520.0), 0x7C00);
        assert_eq!(f32_to_half(f32::MAX), 0x7C00);
        assert_eq!(f32_to_half(f32::MIN_POSITIVE), 0);
    }
}
