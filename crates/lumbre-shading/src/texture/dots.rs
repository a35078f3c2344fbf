//! Dots at random places of a plane.

use lumbre_math::noise::noise;
use lumbre_math::{DVec2, Vec2};

const RADIUS: f64 = 0.35;

/// Whether a place is in a dot. Each square of one unit about whole coordinates has a dot of radius 0.35 or none, by
/// chance, so far from its middle that it stays inside; the numbers that decide are those of pbrt.
pub(super) fn is_inside(st: Vec2) -> bool {
    let st = st.as_dvec2();
    let square = (st + 0.5).floor();
    let random = |offset: DVec2| noise((square + offset).extend(0.5));
    if random(DVec2::splat(0.5)) <= 0.0 {
        return false;
    }
    let shift = DVec2::new(random(DVec2::new(1.5, 2.8)), random(DVec2::new(4.5, 9.8)));
    (st - square - (0.5 - RADIUS) * shift).length_squared() < RADIUS * RADIUS
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_squares_in_ten_have_a_dot_of_the_radius() {
        let (mut filled, mut inside, side, fine) = (0, 0, 40, 50);
        for i in 0..side * side {
            let square = Vec2::new((i % side) as f32, (i / side) as f32) - 7.0;
            let mut of_square = 0;
            for j in 0..fine * fine {
                let within = (Vec2::new((j % fine) as f32, (j / fine) as f32) + 0.5) / fine as f32 - 0.5;
                of_square += i32::from(is_inside(square + within));
            }
            let share = f64::from(of_square) / f64::from(fine * fine);
            let of_dot = std::f64::consts::PI * RADIUS * RADIUS;
            assert!(share == 0.0 || (share - of_dot).abs() < 0.01, "{square}: {share}");
            filled += i32::from(of_square > 0);
            inside += of_square;
        }
        let filled = f64::from(filled) / f64::from(side * side);
        assert!((0.3..0.5).contains(&filled) && inside > 0, "{filled}");
        assert!(!is_inside(Vec2::NAN));
    }
}
