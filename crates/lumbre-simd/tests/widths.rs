//! Every operation gives the same bits in every lane at every instruction set.

use std::num::Wrapping;

use lumbre_simd::{Double, InstructionSet, Job, Mask, Real, Task, UInt, V3, math, random};

/// What an operation gives for one row of inputs.
#[derive(Clone, Copy, Debug)]
enum Answer {
    Single(f32),
    Double(f64),
    Int(u32),
}

impl Answer {
    /// Equal bits, or both NaN.
    fn is_same(self, other: Self) -> bool {
        match (self, other) {
            (Self::Single(a), Self::Single(b)) => a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan(),
            (Self::Double(a), Self::Double(b)) => a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan(),
            (Self::Int(a), Self::Int(b)) => a == b,
            _ => false,
        }
    }
}

const FEW: usize = 2;
const COUNT: usize = 16 * 5000;

/// Columns of numbers.
struct Inputs {
    singles: [Vec<f32>; 4],
    doubles: [Vec<f64>; FEW],
    ints: [Vec<u32>; FEW],
}

/// A small generator of its own, since this crate depends on nothing: Steele, Lea, Flood, "Fast Splittable Pseudorandom
/// Number Generators", OOPSLA 2014.
fn next_random(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (*state ^ *state >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ z >> 31
}

fn single(bits: u64) -> f32 {
    const SPECIAL: [f32; 20] = [
        0.0,
        -0.0,
        1.0,
        -1.0,
        0.5,
        -1.5,
        2.5,
        8_388_607.5,
        -8_388_608.0,
        2_147_483_500.0,
        2_147_483_648.0,
        -2_147_483_648.0,
        f32::INFINITY,
        f32::NEG_INFINITY,
        f32::NAN,
        f32::MIN_POSITIVE,
        1e-45,
        -1e-40,
        f32::MAX,
        f32::MIN,
    ];
    let word = (bits >> 32) as u32;
    match bits % 8 {
        0 | 1 => SPECIAL[word as usize % SPECIAL.len()],
        2 => f32::from_bits(word),
        3 => word.cast_signed() as f32 / 16_777_216.0,
        _ => word.cast_signed() as f32 / 2_147_483_648.0,
    }
}

fn inputs() -> Inputs {
    let mut state = 5;
    let singles = std::array::from_fn(|_| (0..COUNT).map(|_| single(next_random(&mut state))).collect());
    let double = |bits: u64| match bits % 4 {
        0 => f64::from_bits(bits.rotate_left(17)),
        1 => f64::from(single(bits.rotate_left(23))) * 1e-290,
        _ => f64::from(single(bits.rotate_left(29))),
    };
    let doubles = std::array::from_fn(|_| (0..COUNT).map(|_| double(next_random(&mut state))).collect());
    let ints = std::array::from_fn(|_| {
        (0..COUNT).map(|_| next_random(&mut state)).map(|x| (x >> (32 + x % 32)) as u32).collect()
    });
    Inputs { singles, doubles, ints }
}

/// A task.
struct Norm<R>(V3<R>);

impl<R: Real> Task<R> for Norm<R> {
    type Output = R;
    #[inline(always)]
    fn run(self) -> R {
        self.0.length()
    }
}

/// All operations on all inputs: their names, and the answers row by row.
struct Operations<'a>(&'a Inputs);

type Answers = Vec<(&'static str, Vec<Answer>)>;

impl Job for Operations<'_> {
    type Output = Answers;
    #[inline(always)]
    fn run<R: Real>(self) -> Answers {
        let mut answers = Answers::new();
        for start in (0..COUNT).step_by(R::LANES) {
            let mut next = 0;
            let mut put = |name: &'static str, lanes: [Answer; 16]| {
                if start == 0 {
                    answers.push((name, Vec::with_capacity(COUNT)));
                }
                assert_eq!(answers[next].0, name);
                answers[next].1.extend_from_slice(&lanes[..R::LANES]);
                next += 1;
            };
            macro_rules! singles { ($($name:literal: $value:expr;)*) => {
                $(put($name, R::to_lanes($value).map(Answer::Single));)* } }
            macro_rules! doubles { ($($name:literal: $value:expr;)*) => {
                $(put($name, R::Double::to_lanes($value).map(Answer::Double));)* } }
            macro_rules! ints { ($($name:literal: $value:expr;)*) => {
                $(put($name, R::UInt::to_lanes($value).map(Answer::Int));)* } }
            macro_rules! masks { ($($name:literal: $value:expr;)*) => {
                $({
                    let mask: R::Mask = $value;
                    put($name, std::array::from_fn(|lane| Answer::Int(mask.to_bitmask() >> lane & 1)));
                })* } }

            let [a, b, c, d] = std::array::from_fn(|i| R::from_slice(&self.0.singles[i][start..]));
            let [x, y] = std::array::from_fn(|i| R::Double::from_slice(&self.0.doubles[i][start..]));
            let [i, j] = std::array::from_fn(|k| R::UInt::from_slice(&self.0.ints[k][start..]));
            let (small, p) = (i & R::UInt::splat(1023), V3::new(a, b, c));
            let q = V3::new(b, c, d);
            singles! {
                "a": a; "a + b": a + b; "a - b": a - b; "a * b": a * b; "a / b": a / b; "-a": -a;
                "sqrt": a.sqrt(); "abs": a.abs(); "min": a.simd_min(b); "max": a.simd_max(b);
                "round": a.round_ties_even(); "floor": a.floor(); "recip": a.recip(); "copysign": a.copysign(b);
                "select": R::select(a.simd_lt(b), c, d); "or_zero": a.or_zero(b.simd_le(c));
                "from_bits": R::from_bits(i); "from_int": R::from_int(i);
                "gather": R::gather(&self.0.singles[3], small); "to_single": x.to_single();
                "zero": R::zero(); "one": R::one(); "splat": R::splat(1.1); "dot": p.dot(q);
                "length": p.length(); "cross": p.cross(q).y; "normalize": p.normalize().z;
                "max_component": p.max_component(); "vector min": p.min(q).y; "vector max": p.max(q).z;
                "vector abs": p.abs().x; "vector quotient": (p / q).x; "vector by number": (p / d).y;
                "vector select": V3::select(a.simd_eq(b), p, q).x; "vector or zero": p.or_zero(a.simd_gt(d)).y;
                "sin": math::sin_cos_turns(a).0; "cos": math::sin_cos_turns(a).1; "atan2": math::atan2(a, b);
                "acos": math::acos(a); "exp": math::exp(a); "ln": math::ln(a); "pow": math::pow(a, b);
                "basis": math::orthonormal_basis(p).0.x; "basis 2": math::orthonormal_basis(p).1.y;
                "disk": math::square_to_disk([a, b])[0]; "disk 2": math::square_to_disk([a, b])[1];
                "uniform": random::uniform(i);
                "call": R::call(Norm(p)); "hemisphere": math::cosine_hemisphere([a, b]).z;
            }
            doubles! {
                "x": x; "x + y": x + y; "x - y": x - y; "x * y": x * y; "x / y": x / y; "-x": -x;
                "double sqrt": x.sqrt(); "double abs": x.abs(); "double min": x.simd_min(y);
                "double max": x.simd_max(y); "double copysign": x.copysign(y);
                "double select": R::Double::select(a.simd_lt(b), x, y); "from_single": R::Double::from_single(a);
                "next": x.next_towards_sign(y); "next of zero": R::Double::splat(0.0).next_towards_sign(y);
                "next of -0": R::Double::splat(-0.0).next_towards_sign(y);
                "next of infinity": R::Double::splat(f64::INFINITY).next_towards_sign(y);
                "next of -infinity": R::Double::splat(f64::NEG_INFINITY).next_towards_sign(y);
                "double gather": R::Double::gather(&self.0.doubles[1], small);
                "to_double": p.to_double().y; "normalize_f64": V3::new(x, y, x).normalize_f64().y;
                "max_component_f64": V3::new(x, y, -x).max_component_f64();
                "min_f64": V3::new(x, y, y).min_f64(V3::new(y, x, y)).x;
                "select_f64": V3::select_f64(x.simd_lt(y), V3::splat(x), V3::splat(y)).z;
            }
            ints! {
                "i": i; "i + j": i + j; "i - j": i - j; "i * j": i * j; "i ^ j": i ^ j; "i & j": i & j; "i | j": i | j;
                "shl": i.shl::<7>(); "shl 0": i.shl::<0>(); "shl 31": i.shl::<31>(); "shr": i.shr::<9>();
                "shr 31": i.shr::<31>(); "int select": R::UInt::select(i.simd_lt(j), i, j);
                "to_bits": a.to_bits(); "to_int": a.to_int(); "int gather": R::UInt::gather(&self.0.ints[1], small);
                "pcg4d": random::pcg4d([i, j, i + j, small])[0]; "pcg4d 2": random::pcg4d([i, j, i + j, small])[3];
                "indices": R::UInt::splat(start as u32) + R::UInt::lane_indices();
            }
            masks! {
                "lt": a.simd_lt(b); "le": a.simd_le(b); "gt": a.simd_gt(b); "ge": a.simd_ge(b); "eq": a.simd_eq(b);
                "ne": a.simd_ne(b); "finite": a.is_finite(); "double lt": x.simd_lt(y); "double le": x.simd_le(y);
                "double gt": x.simd_gt(y); "double ge": x.simd_ge(y); "int eq": small.simd_eq(j); "int lt": i.simd_lt(j);
                "and": a.simd_lt(b) & c.simd_lt(d); "or": a.simd_lt(b) | c.simd_lt(d); "not": !a.simd_lt(b);
                "none": R::Mask::splat(false); "all": R::Mask::splat(true);
            }
        }
        answers
    }
}

#[test]
fn every_operation_has_the_same_bits_at_every_width() {
    let inputs = inputs();
    let expected = InstructionSet::SCALAR.run(Operations(&inputs));
    assert!(expected.len() > 90 && expected.iter().all(|(_, answers)| answers.len() == COUNT));
    for set in InstructionSet::available() {
        for ((name, expected), (_, answers)) in expected.iter().zip(set.run(Operations(&inputs))) {
            for (row, (a, b)) in expected.iter().zip(answers).enumerate() {
                let singles: Vec<f32> = inputs.singles.iter().map(|column| column[row]).collect();
                let doubles = [inputs.doubles[0][row], inputs.doubles[1][row]];
                assert!(a.is_same(b), "{name} at {}: {a:?} and {b:?} of {singles:?} {doubles:?}", set.name());
            }
        }
    }
}

#[test]
fn scalar_operations_are_those_of_the_standard_library() {
    let inputs = inputs();
    let same = |name: &str, ours: f32, theirs: f32| {
        assert!(Answer::Single(ours).is_same(Answer::Single(theirs)), "{name}: {ours} {theirs}");
    };
    for (&a, &b) in inputs.singles[0].iter().zip(&inputs.singles[1]) {
        same("round", Real::round_ties_even(a), a.round_ties_even());
        same("floor", Real::floor(a), a.floor());
        same("copysign", Real::copysign(a, b), a.copysign(b));
        same("min", a.simd_min(b), if a < b { a } else { b });
        same("max", a.simd_max(b), if a > b { a } else { b });
        let int = if a.abs() < 2_147_483_648.0 { (a as i32).cast_unsigned() } else { 1 << 31 };
        assert_eq!(Real::to_int(a), Wrapping(int), "{a}");
    }
    for (&x, &y) in inputs.doubles[0].iter().zip(&inputs.doubles[1]) {
        let expected = if y > 0.0 {
            x.next_up()
        } else if y < 0.0 {
            x.next_down()
        } else {
            x
        };
        assert!(Answer::Double(x.next_towards_sign(y)).is_same(Answer::Double(expected)), "{x} {y}");
    }
}

/// Masks and what moves lanes, against the lanes one by one.
struct Moves;

impl Job for Moves {
    type Output = usize;
    #[inline(always)]
    fn run<R: Real>(self) -> usize {
        let numbers: [f32; 16] = std::array::from_fn(|i| i as f32 + 0.5);
        let ints: [u32; 16] = std::array::from_fn(|i| 0xffff_fff0 | i as u32);
        let doubles: [f64; 16] = std::array::from_fn(|i| i as f64 - 7.25);
        let all = if R::LANES == 16 { 0xffff } else { (1 << R::LANES) - 1 };
        for bits in 0..1 << R::LANES {
            let mask = R::Mask::from_bitmask(bits | 0xffff_0000 & !all);
            assert_eq!(mask.to_bitmask(), bits);
            assert_eq!(mask.count(), bits.count_ones() as usize);
            assert_eq!([mask.any(), mask.all(), mask.none()], [bits != 0, bits == all, bits == 0]);
            let chosen: Vec<usize> = (0..R::LANES).filter(|lane| bits >> lane & 1 == 1).collect();
            let (mut a, mut b, mut c) = ([9.0; 17], [9; 17], [9.0; 17]);
            R::from_lanes(&numbers).compress_store(mask, &mut a[..R::LANES]);
            R::UInt::from_lanes(&ints).compress_store(mask, &mut b[..R::LANES]);
            R::Double::from_lanes(&doubles).compress_store(mask, &mut c[..R::LANES]);
            for (place, &lane) in chosen.iter().enumerate() {
                assert_eq!((a[place], b[place], c[place]), (numbers[lane], ints[lane], doubles[lane]));
            }
        }
        for n in 0..20 {
            let expected = if n >= R::LANES { all } else { (1 << n) - 1 };
            assert_eq!(R::Mask::first(n).to_bitmask(), expected);
        }
        let largest = R::UInt::from_lanes(&ints).reduce_max();
        assert_eq!(largest, ints[R::LANES - 1]);
        assert_eq!(R::from_lanes(&numbers).to_lanes()[..R::LANES], numbers[..R::LANES]);
        assert_eq!(R::from_lanes(&numbers).to_lanes()[R::LANES..], [0.0; 16][R::LANES..]);
        R::LANES
    }
}

#[test]
fn lanes_are_moved_as_masks_say() {
    for set in InstructionSet::available() {
        assert_eq!(set.run(Moves), set.lanes());
    }
}

/// A gather with one bad index, in the last lane.
struct BadGather(u32, u8);

impl Job for BadGather {
    type Output = ();
    #[inline(always)]
    fn run<R: Real>(self) {
        let mut lanes = [2; 16];
        lanes[R::LANES - 1] = self.0;
        let index = R::UInt::from_lanes(&lanes);
        match self.1 {
            0 => drop(std::hint::black_box(R::gather(&[0.0; 5], index))),
            1 => drop(std::hint::black_box(R::UInt::gather(&[0; 5], index))),
            _ => drop(std::hint::black_box(R::Double::gather(&[0.0; 5], index))),
        }
    }
}

#[test]
fn a_gather_out_of_range_panics() {
    for set in InstructionSet::available() {
        for kind in 0..3 {
            set.run(BadGather(4, kind));
            for index in [5, 1 << 31, u32::MAX] {
                let result = std::panic::catch_unwind(|| set.run(BadGather(index, kind)));
                assert!(result.is_err(), "{index} at {}", set.name());
            }
        }
    }
}

/// Slices that are one short.
struct Short(u8);

impl Job for Short {
    type Output = ();
    #[inline(always)]
    fn run<R: Real>(self) {
        let n = R::LANES - 1;
        let (mut a, mut b, mut c) = ([0.0; 16], [0; 16], [0.0; 16]);
        let none = R::Mask::splat(false);
        match self.0 {
            0 => drop(std::hint::black_box(R::from_slice(&a[..n]))),
            1 => R::zero().copy_to_slice(&mut a[..n]),
            2 => R::zero().compress_store(none, &mut a[..n]),
            3 => drop(std::hint::black_box(R::UInt::from_slice(&b[..n]))),
            4 => R::UInt::splat(0).copy_to_slice(&mut b[..n]),
            5 => R::UInt::splat(0).compress_store(none, &mut b[..n]),
            6 => drop(std::hint::black_box(R::Double::from_slice(&c[..n]))),
            7 => R::Double::splat(0.0).copy_to_slice(&mut c[..n]),
            _ => R::Double::splat(0.0).compress_store(none, &mut c[..n]),
        }
    }
}

#[test]
fn a_slice_without_room_for_all_lanes_panics() {
    for set in InstructionSet::available() {
        for which in 0..9 {
            let result = std::panic::catch_unwind(|| set.run(Short(which)));
            assert!(result.is_err(), "{which} at {}", set.name());
        }
    }
}

#[test]
fn an_instruction_set_can_be_limited_by_name() {
    let all = InstructionSet::available();
    assert_eq!(all[0], InstructionSet::SCALAR);
    for set in &all {
        assert_eq!(InstructionSet::limited_to(set.name()).unwrap(), *set);
        assert!(*set <= *all.last().unwrap());
    }
    assert!(all.contains(&InstructionSet::detect()));
    #[cfg(target_arch = "aarch64")]
    assert_eq!(all.iter().map(|set| set.name()).collect::<Vec<_>>(), ["scalar", "neon"]);
    let error = InstructionSet::limited_to("sse2").unwrap_err();
    assert_eq!(
        error.to_string(),
        "LUMBRE_SIMD names no instruction set (found \"sse2\"; expected scalar, neon, avx2 or avx512)"
    );
}
