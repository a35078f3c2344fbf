//! Numbers as text.

use std::io::Write;

/// Appends the shortest decimal that reads back to the same bits, as `{:?}` prints it.
pub fn push_f64(out: &mut Vec<u8>, value: f64) {
    let is_plain = value == 0.0 || (1e-4..1e16).contains(&value.abs());
    if is_plain {
        out.extend(zmij::Buffer::new().format_finite(value).as_bytes());
    } else {
        // zmij writes other exponents.
        let _ = write!(out, "{value:?}");
    }
}

/// Appends a whole number.
pub fn push_u64(out: &mut Vec<u8>, value: u64) {
    out.extend(itoa::Buffer::new().format(value).as_bytes());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_look_as_the_standard_library_prints_them() {
        let edges =
            [0.0, 1.0, 1e-4, 1e16, 0.1, 0.3, f64::MIN_POSITIVE, 5e-324, f64::MAX, f64::INFINITY, f64::NAN];
        let neighbours = edges.iter().flat_map(|x| [x.next_down(), *x, x.next_up()]);
        let powers = (-1074..1024).map(|e| 2f64.powi(e)).chain((-320..309).map(|e| 10f64.powi(e)));
        let powers = powers.flat_map(|x| [x.next_down(), x, x.next_up(), 3.0 * x, x + 1.0]);
        let mut state = 1u64;
        let mut random = || {
            // Steele, Lea and Flood, "Fast splittable pseudorandom number generators", OOPSLA 2014.
            state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
            let z = (state ^ state >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB)
        };
        let any: Vec<f64> = (0..100_000).map(|_| f64::from_bits(random())).collect();
        let usual: Vec<f64> =
            (0..300_000).map(|_| (random() as f64).ln() * f64::from(random() as u32)).collect();
        let short = any.iter().map(|x| (x.to_bits() % 100_000_000) as f64 / 1e5);
        let mut seen = 0;
        for x in
            edges.into_iter().chain(neighbours).chain(powers).chain(short).chain(any.clone()).chain(usual)
        {
            for x in [x, -x] {
                let mut text = Vec::new();
                push_f64(&mut text, x);
                assert_eq!(String::from_utf8(text).unwrap(), format!("{x:?}"));
                seen += 1;
            }
        }
        assert!(seen > 1_000_000, "{seen}");
    }
}
