//! What sixteen numbers give together, beside each alone.

use super::scenes::Random;
use crate::lanes::{Lanes, Level, Row, Task, WIDE, Wide};

/// What is looked at of sixteen rows, and of numbers in double precision.
struct Together<'a> {
    rows: &'a [Row<f32>; WIDE],
    exact: &'a Row<f64>,
    place: f64,
    scale: f64,
}

#[derive(Debug, PartialEq)]
struct Given {
    most: Row<f32>,
    middle: Row<f32>,
    first: f32,
    with_bits: u32,
    are_same: bool,
    rounded: Row<f32>,
    parted: [Row<f32>; 2],
}

fn stored<W: Wide>(wide: W) -> Row<f32> {
    let mut row = Row::of(0.0);
    wide.store(&mut row);
    row
}

impl Task for Together<'_> {
    type Output = Given;

    #[inline(always)]
    fn run<L: Lanes>(self) -> Given {
        let Self { rows, exact, place, scale } = self;
        let first = L::Wide::load(&rows[0].0);
        let mut wide = [first; WIDE];
        for (wide, row) in wide.iter_mut().zip(rows) {
            *wide = L::Wide::load(&row.0);
        }
        let (rounded, rest) = L::Wide::parted_from(exact, place);
        Given {
            most: L::Wide::most_of_each(wide),
            middle: stored(first.middle()),
            first: first.first(),
            with_bits: first.with_bits(rows[0].0[3].to_bits()),
            are_same: L::Wide::are_same(exact),
            rounded: stored(L::Wide::rounded_from(exact, place, scale)),
            parted: [stored(rounded), stored(rest)],
        }
    }
}

#[test]
fn sixteen_numbers_give_together_what_each_gives_alone() {
    let mut random = Random(172);
    for round in 0..200 {
        let mut rows = [Row::of(0.0); WIDE];
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
        let differs = if round % 5 == 0 { Some(round % WIDE) } else { None };
        if let Some(lane) = differs {
            exact.0[lane] = [f64::NAN, exact.0[lane] + 1e-15][round % 2];
        }

        let middle = 0.5 * (rows[0].0[5] + rows[0].0[10]);
        let rounded = exact.0.map(|x| (x - place) as f32);
        let rest = std::array::from_fn(|i| (exact.0[i] - place - f64::from(rounded[i])) as f32);
        let with_bits =
            (0..WIDE).filter(|&i| rows[0].0[i].to_bits() == rows[0].0[3].to_bits()).map(|i| 1 << i).sum();
        let most = rows.each_ref().map(|row| row.0.iter().copied().fold(f32::NEG_INFINITY, f32::max));
        for level in Level::all() {
            let given = level.run(Together { rows: &rows, exact: &exact, place, scale });
            // What a NaN comes to is not said.
            let from = if round % 2 == 0 { 1 } else { 0 };
            assert_eq!(given.most.0[from..], most[from..], "{level:?}");
            assert_eq!(given.with_bits, with_bits, "{level:?}");
            assert_eq!(given.first.to_bits(), rows[0].0[0].to_bits(), "{level:?}");
            assert_eq!(given.middle.0.map(f32::to_bits), [middle.to_bits(); WIDE], "{level:?}");
            assert_eq!(given.are_same, is_one && differs.is_none(), "{level:?}");
            let bits = |row: [f32; WIDE]| row.map(|x| if x.is_nan() { None } else { Some(x.to_bits()) });
            let scaled = exact.0.map(|x| ((x - place) * scale) as f32);
            assert_eq!(bits(given.rounded.0), bits(scaled), "{level:?}");
            assert_eq!(bits(given.parted[0].0), bits(rounded), "{level:?}");
            assert_eq!(bits(given.parted[1].0), bits(rest), "{level:?}");
        }
    }
}
