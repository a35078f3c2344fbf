//! Vectors of eight and sixteen numbers, against each number alone.

use super::scenes::Random;
use crate::intersect::{Dispatch, Isa, Simd};
use crate::simd::vector::stack_entry;
use crate::simd::{F32x8, F32x16, LANES, LastEight, Row, Vector};

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

/// Numbers that are moved, chosen and counted, and a mask and places to do it by.
struct Moved<'a> {
    rows: &'a [Row<f32>; 2],
    exact: &'a Row<f64>,
    words: &'a [u32; LANES],
    mask: u32,
    places: u32,
}

#[derive(Debug, PartialEq)]
struct Movement {
    selected: [u32; LANES],
    above: u32,
    keys: [i32; LANES],
    bits: [i32; LANES],
    swizzle: [f32; 8],
    first_four: [i64; 4],
    least: [f32; 2],
    lane: f32,
    joined: [f32; LANES],
    two: [f32; LANES],
    are_equal: [bool; 2],
    rounded: [f32; LANES],
    less: [f32; LANES],
    larger: [f32; LANES],
    smaller: [f32; LANES],
    is_no_larger: u32,
}

/// A lane of which more than its own number is asked.
const LANE: usize = 6;
const AWAY: f64 = 0.1;

impl Dispatch for Moved<'_> {
    type Output = Movement;

    #[inline(always)]
    fn run<L: Simd>(self) -> Movement {
        let Self { rows, exact, words, mask, places } = self;
        let (a, b) = (L::F32x16::load(&rows[0].0), L::F32x16::load(&rows[1].0));
        let (first, last) = (a.half(0), a.half(1));
        Movement {
            selected: stored(L::F32x16::select(mask, a, b)).0.map(f32::to_bits),
            above: a.bits_above(rows[1].0[LANE].to_bits().cast_signed()),
            keys: a.lanes_in_bits().bits(),
            bits: a.bits(),
            swizzle: a.swizzle(places).to_array(),
            first_four: a.first_four(mask, words),
            least: [first.reduce_min(mask & 0xff), last.reduce_min(0)],
            lane: last.lane(LANE),
            joined: stored(L::F32x16::of_two(last, first)).0,
            two: stored(L::F32x16::splat_two(first.lane(1), last.lane(2), LastEight::new())).0,
            are_equal: [a.are_equal(), L::F32x16::splat(rows[0].0[LANE]).are_equal()],
            rounded: stored(L::F32x16::rounded(exact)).0,
            less: stored(a.rounded_less(AWAY)).0,
            larger: stored(a.abs().max_nonneg(b)).0,
            smaller: stored(a.abs().min_nonneg(b.abs())).0,
            is_no_larger: a.abs().le_nonneg(b.abs()),
        }
    }
}

#[test]
fn lanes_are_moved_and_chosen_as_one_by_one() {
    let mut random = Random(174);
    for round in 0..300 {
        let mut rows = [Row::of(0.0); 2];
        for row in &mut rows {
            row.0 = std::array::from_fn(|_| (random.unit() - 0.5) as f32);
        }
        let exact = Row(std::array::from_fn(|_| random.unit() - 0.5));
        let words: [u32; LANES] = std::array::from_fn(|_| random.below(1 << 20) as u32);
        // Four bits or more.
        let mask = random.below(1 << 16) as u32 | 0b1001_0000_0001_0010;
        let places = random.below(1 << 16) as u32 | (random.below(1 << 16) as u32) << 16;
        if round % 4 == 0 {
            rows[1].0[round % LANES] = rows[0].0[round % LANES];
        }
        let [a, b] = rows.map(|row| row.0);
        let bits = a.map(|x| x.to_bits().cast_signed());
        let lanes_of = |holds: &dyn Fn(usize) -> bool| (0..LANES).filter(|&i| holds(i)).map(|i| 1 << i).sum();
        let chosen: Vec<usize> = (0..LANES).filter(|&i| mask >> i & 1 == 1).collect();
        let expected = Movement {
            selected: std::array::from_fn(|i| if mask >> i & 1 == 1 { a[i] } else { b[i] }.to_bits()),
            above: lanes_of(&|i| bits[i] > b[LANE].to_bits().cast_signed()),
            keys: std::array::from_fn(|i| bits[i] & !15 | i as i32),
            bits,
            swizzle: std::array::from_fn(|i| a[(places >> (4 * i) & 15) as usize]),
            first_four: std::array::from_fn(|i| stack_entry(bits[chosen[i]], words[chosen[i]])),
            least: [
                chosen.iter().filter(|&&i| i < 8).map(|&i| a[i]).fold(f32::INFINITY, f32::min),
                f32::INFINITY,
            ],
            lane: a[8 + LANE],
            joined: std::array::from_fn(|i| a[(i + 8) % LANES]),
            two: std::array::from_fn(|i| if i < 8 { a[1] } else { a[10] }),
            are_equal: [false, true],
            rounded: exact.0.map(|x| x as f32),
            less: a.map(|x| (f64::from(x) - AWAY) as f32),
            larger: std::array::from_fn(|i| a[i].abs().max(b[i])),
            smaller: std::array::from_fn(|i| a[i].abs().min(b[i].abs())),
            is_no_larger: lanes_of(&|i| a[i].abs() <= b[i].abs()),
        };
        for isa in Isa::all() {
            let moved = Moved { rows: &rows, exact: &exact, words: &words, mask, places };
            assert_eq!(isa.run(moved), expected, "{isa:?}");
        }
    }
}
