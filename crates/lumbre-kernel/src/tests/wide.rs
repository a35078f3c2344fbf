//! Vectors of eight and sixteen numbers, against each number alone.

use super::scenes::Random;
use crate::intersect::{Dispatch, Isa, Simd};
use crate::simd::{F32x8, F32x16, LANES, Row, Vector};

/// What is looked at of sixteen rows, and of numbers in double precision.
struct Together<'a> {
    rows: &'a [Row<f32>; LANES],
    exact: &'a Row<f64>,
    place: f64,
    scale: f64,
}

#[derive(Debug, PartialEq)]
struct Given {
    most: [f32; 8],
    middle: Row<f32>,
    first: f32,
    with_bits: u32,
    are_same: bool,
    rounded: Row<f32>,
    parted: [Row<f32>; 2],
}

fn stored<W: F32x16>(wide: W) -> Row<f32> {
    let mut row = Row::of(0.0);
    wide.store(&mut row);
    row
}

impl Dispatch for Together<'_> {
    type Output = Given;

    #[inline(always)]
    fn run<L: Simd>(self) -> Given {
        let Self { rows, exact, place, scale } = self;
        let first = L::F32x16::load(&rows[0].0);
        let mut wide = [first; 8];
        for (wide, row) in wide.iter_mut().zip(rows) {
            *wide = L::F32x16::load(&row.0);
        }
        let (rounded, rest) = L::F32x16::parted_from(exact, place);
        Given {
            most: L::F32x16::reduce_max_of_eight(wide),
            middle: stored(first.midpoint()),
            first: first.first(),
            with_bits: first.with_bits(rows[0].0[3].to_bits()),
            are_same: L::F32x16::are_same(exact),
            rounded: stored(L::F32x16::rounded_from(exact, place, scale)),
            parted: [stored(rounded), stored(rest)],
        }
    }
}

#[test]
fn sixteen_numbers_give_together_what_each_gives_alone() {
    let mut random = Random(172);
    for round in 0..200 {
        let mut rows = [Row::of(0.0); LANES];
        for row in &mut rows {
            row.0 = std::array::from_fn(|_| (random.unit() - 0.5) as f32);
        }
        // Bits that are no number, in some lanes.
        for lane in [3, 8, 12] {
            rows[0].0[lane] = [f32::from_bits(u32::MAX), 0.25][round % 2];
        }
        let (place, scale) = (random.unit(), 3.0 * random.unit());
        let mut exact = Row(std::array::from_fn(|_| random.unit()));
        let is_one = round % 3 == 0;
        if is_one {
            exact = Row::of(exact.0[0]);
        }
        let differs = if round % 5 == 0 { Some(round % LANES) } else { None };
        if let Some(lane) = differs {
            exact.0[lane] = [f64::NAN, exact.0[lane] + 1e-15][round % 2];
        }

        let middle = 0.5 * (rows[0].0[5] + rows[0].0[10]);
        let rounded = exact.0.map(|x| (x - place) as f32);
        let rest = std::array::from_fn(|i| (exact.0[i] - place - f64::from(rounded[i])) as f32);
        let with_bits =
            (0..LANES).filter(|&i| rows[0].0[i].to_bits() == rows[0].0[3].to_bits()).map(|i| 1 << i).sum();
        let most = rows.each_ref().map(|row| row.0.iter().copied().fold(f32::NEG_INFINITY, f32::max));
        for isa in Isa::all() {
            let given = isa.run(Together { rows: &rows, exact: &exact, place, scale });
            // What a NaN comes to is not said.
            let from = if round % 2 == 0 { 1 } else { 0 };
            assert_eq!(given.most[from..], most[from..8], "{isa:?}");
            assert_eq!(given.with_bits, with_bits, "{isa:?}");
            assert_eq!(given.first.to_bits(), rows[0].0[0].to_bits(), "{isa:?}");
            assert_eq!(given.middle.0.map(f32::to_bits), [middle.to_bits(); LANES], "{isa:?}");
            assert_eq!(given.are_same, is_one && differs.is_none(), "{isa:?}");
            let bits = |row: [f32; LANES]| row.map(|x| if x.is_nan() { None } else { Some(x.to_bits()) });
            let scaled = exact.0.map(|x| ((x - place) * scale) as f32);
            assert_eq!(bits(given.rounded.0), bits(scaled), "{isa:?}");
            assert_eq!(bits(given.parted[0].0), bits(rounded), "{isa:?}");
            assert_eq!(bits(given.parted[1].0), bits(rest), "{isa:?}");
        }
    }
}

/// Numbers of each result, and masks, of arithmetic with three.
type Results = (Vec<Vec<f32>>, [u32; 2]);

#[inline(always)]
fn arithmetic<V: Vector>(a: V, b: V, c: V) -> Results {
    let results = [
        a + b,
        a - b,
        a * b,
        a.mul_add(b, c),
        a.neg_mul_add(b, c),
        a.mul_sub(b, c),
        a / V::splat(4.0),
        (a * a).sqrt(),
        a.min(b),
        a.max(b),
        a.abs(),
        a.xor_sign(b),
    ];
    let numbers = |v: V| {
        let array = v.to_array();
        (0..V::COUNT).map(|i| array[i]).collect()
    };
    (results.into_iter().map(numbers).collect(), [a.simd_le(b), a.simd_lt(b)])
}

/// The same of eight and of sixteen.
struct Arithmetic([[f32; LANES]; 3]);

impl Dispatch for Arithmetic {
    type Output = [Results; 2];

    #[inline(always)]
    fn run<L: Simd>(self) -> [Results; 2] {
        let [a, b, c] = &self.0;
        let eight = |row: &[f32; LANES]| L::F32x8::load(row.first_chunk().expect("sixteen"));
        let wide = |row: &[f32; LANES]| L::F32x16::load(row);
        [arithmetic(eight(a), eight(b), eight(c)), arithmetic(wide(a), wide(b), wide(c))]
    }
}

#[test]
fn arithmetic_gives_in_every_lane_what_it_gives_alone() {
    let mut random = Random(173);
    for _ in 0..100 {
        // Integers: nothing is rounded.
        let mut row = || std::array::from_fn(|_| random.below(9) as f32 - 4.0);
        let [a, b, c]: [[f32; LANES]; 3] = [row(), row(), row()];
        let alone = |i: usize| {
            let (a, b, c) = (a[i], b[i], c[i]);
            let turned = if b.is_sign_negative() { -a } else { a };
            let products = [a * b + c, c - a * b, a * b - c];
            [[a + b, a - b, a * b], products, [a / 4.0, a.abs(), a.min(b)], [a.max(b), a.abs(), turned]]
                .concat()
        };
        for isa in Isa::all() {
            for (results, masks) in isa.run(Arithmetic([a, b, c])) {
                let count = results[0].len();
                assert!(count == 8 || count == LANES);
                for i in 0..count {
                    let given: Vec<f32> = results.iter().map(|result| result[i]).collect();
                    assert_eq!(given, alone(i), "{isa:?}");
                    assert_eq!(masks[0] >> i & 1 == 1, a[i] <= b[i], "{isa:?}");
                    assert_eq!(masks[1] >> i & 1 == 1, a[i] < b[i], "{isa:?}");
                }
                assert_eq!((masks[0] | masks[1]) >> count, 0, "{isa:?}");
            }
        }
    }
}
