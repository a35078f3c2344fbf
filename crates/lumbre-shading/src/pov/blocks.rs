//! Patterns of cells: bricks, checks, hexagons, and distances to random points.

use lumbre_math::{DVec3, Elementary};

use super::noise::{NoiseGenerator, hash3, noise, random};
use super::pattern::Crackle;

/// What coordinates are raised by, so that faces at whole numbers lie in one cell.
const TINY: f64 = 1e-10;

/// 0 in mortar, 1 in bricks.
pub(super) fn brick(p: DVec3, size: DVec3, mortar: f64) -> f64 {
    let p = p + DVec3::splat(mortar + TINY);
    let fraction = |x: f64| x - x.floor();
    if fraction(p.y / size.y) <= mortar / size.y {
        return 0.0;
    }
    let is_odd = fraction(p.y / (2.0 * size.y)) <= 0.5;
    let shift = |is_shifted: bool| if is_shifted { 0.5 } else { 0.0 };
    let in_mortar = fraction(p.x / size.x + shift(!is_odd)) <= mortar / size.x
        || fraction(p.z / size.z + shift(is_odd)) <= mortar / size.z;
    if in_mortar { 0.0 } else { 1.0 }
}

/// A random number for each cube.
pub(super) fn cell(p: DVec3) -> f64 {
    let cell = (p + DVec3::splat(TINY)).floor();
    random(hash3(cell.x as i64, cell.y as i64, cell.z as i64))
}

/// 0 or 1 by cubes.
pub(super) fn checker(p: DVec3) -> f64 {
    let cell = (p + DVec3::splat(TINY)).floor();
    (cell.x + cell.y + cell.z).rem_euclid(2.0)
}

/// The face of a cube about the origin that a point lies behind: +x, +y, +z, -x, -y, -z.
pub(super) fn cube_face(p: DVec3) -> f64 {
    let size = p.abs();
    let axis = if size.x >= size.y && size.x >= size.z {
        0
    } else if size.y >= size.z {
        1
    } else {
        2
    };
    let face = if p[axis] >= 0.0 { axis } else { axis + 3 };
    face as f64
}

/// 0, 1 or 2 by hexagons of side ½ in x and z.
pub(super) fn hexagon(p: DVec3) -> f64 {
    const HEIGHT: f64 = 0.866_025_404;
    let x = p.x.abs();
    let z = if p.z < 0.0 { 6.0 * HEIGHT - p.z.abs() } else { p.z };
    let (x, z) = ((x / 0.5) % 6.0, (z / HEIGHT).rem_euclid(6.0));
    let (i, j) = (x.floor() as usize, (z.floor() as usize).min(5));
    let value = match i {
        0 | 5 => [0, 1, 1, 2, 2, 0][j],
        2 | 3 => [2, 2, 0, 0, 1, 1][j],
        _ => {
            let a = x - x.floor();
            let a = if (i + j) % 2 == 1 { 1.0 - a } else { a };
            let b = z - z.floor();
            let a = if a == 0.0 { TINY } else { a };
            if b / a < 1.0 { [0, 2, 1, 0, 2, 1][j] } else { [2, 1, 0, 2, 1, 0][j] }
        }
    };
    f64::from(value)
}

/// 0 to 3 by squares in x and z.
pub(super) fn square(p: DVec3) -> f64 {
    let odd = |x: f64| (x + TINY).floor().rem_euclid(2.0) == 1.0;
    match (odd(p.x), odd(p.z)) {
        (false, false) => 0.0,
        (false, true) => 1.0,
        (true, true) => 2.0,
        (true, false) => 3.0,
    }
}

/// 0 to 5 by triangles of side 1 in x and z: those that point up and those that point down, by threes along a row.
pub(super) fn triangular(p: DVec3) -> f64 {
    const HEIGHT: f64 = 0.866_025_403_784_438_6;
    let row = (p.z / HEIGHT).floor();
    let up = p.z / HEIGHT - row;
    let is_odd = row.rem_euclid(2.0) == 1.0;
    let x = p.x - 0.5 * up - if is_odd { 0.5 } else { 0.0 };
    let column = x.floor();
    let is_down = x - column + up > 1.0;
    let values = match (is_odd, is_down) {
        (false, false) => [0.0, 4.0, 2.0],
        (false, true) => [3.0, 5.0, 1.0],
        (true, false) => [2.0, 0.0, 4.0],
        (true, true) => [1.0, 3.0, 5.0],
    };
    values[column.rem_euclid(3.0) as usize % 3]
}

/// The distances to the nearest of random points, one in each cube.
pub(super) fn crackle(p: DVec3, crackle: &Crackle, generator: NoiseGenerator) -> f64 {
    let base = (p - DVec3::splat(TINY)).floor();
    let place = p - base;
    let offset = power(crackle.offset.abs(), crackle.metric);
    // How many of the nearest are asked for.
    let asked = match crackle.form {
        _ if crackle.is_solid => 1,
        form if form.z != 0.0 => 3,
        form if form.y != 0.0 => 2,
        _ => 1,
    };
    // Distances in the metric with the squares of Euclidean ones, which exclude most points at less cost:
    // of vectors of one Euclidean length, the p-norms differ by 3^|1/p − 1/2| at most.
    let mut nearest = [[f64::INFINITY; 2]; 3];
    let spread = match crackle.metric {
        2.0 => MARGIN,
        metric if metric > 0.0 => 3.0_f64.power((1.0 - 2.0 / metric).abs()) * MARGIN,
        _ => f64::INFINITY,
    };
    let mut reach = f64::INFINITY;
    let mut nucleus = DVec3::ZERO;
    for [x, y, z] in NEAR_CUBES {
        let corner = DVec3::new(f64::from(x), f64::from(y), f64::from(z));
        // No point of the cube is nearer than its surface.
        let least = place - place.clamp(corner, corner + DVec3::ONE);
        if least.length_squared() >= reach {
            continue;
        }
        let cell = base + corner;
        let seed = hash3(cell.x as i64, cell.y as i64, cell.z as i64);
        let point = cell + DVec3::new(random(seed), random(seed + 1), random(seed + 2));
        let square = (point - p).length_squared();
        if square >= reach {
            continue;
        }
        let distance = measure(point - p, crackle.metric) + offset;
        if distance < nearest[0][0] {
            nucleus = point;
        }
        if distance < nearest[asked - 1][0] {
            let place = nearest.iter().position(|[other, _]| distance < *other).unwrap_or(asked - 1);
            nearest[place..].rotate_right(1);
            nearest[place] = [distance, square];
            reach = nearest[asked - 1][1] * spread;
        }
    }
    if crackle.is_solid {
        return noise(nucleus, generator);
    }
    let root = |sum: f64| if crackle.metric == 2.0 { sum.sqrt() } else { sum.power(1.0 / crackle.metric) };
    (0..asked).map(|i| crackle.form[i] * root(nearest[i][0])).sum::<f64>().clamp(0.0, 1.0)
}

/// More than 1 by more than rounding.
const MARGIN: f64 = 1.0 + 1e-9;

/// The cubes about one, the nearest first: 5³ without those that are two away along several axes.
const NEAR_CUBES: [[i32; 3]; 81] = near_cubes();

const fn near_cubes() -> [[i32; 3]; 81] {
    let mut cubes = [[0; 3]; 81];
    let (mut count, mut away) = (0, 0);
    while away <= 6 {
        let mut i = 0;
        while i < 125 {
            let [x, y, z] = [i / 25 - 2, i / 5 % 5 - 2, i % 5 - 2];
            let far = (x * x == 4) as i32 + (y * y == 4) as i32 + (z * z == 4) as i32;
            if far < 2 && x * x + y * y + z * z == away {
                cubes[count] = [x, y, z];
                count += 1;
            }
            i += 1;
        }
        away += 1;
    }
    cubes
}

/// The power of a number that is not negative: whole exponents and halves, as metrics have, are multiplied.
fn power(x: f64, exponent: f64) -> f64 {
    if !(1.0..=16.0).contains(&exponent) {
        return x.power(exponent);
    }
    let whole = (1..exponent as u32).fold(x, |product, _| product * x);
    match exponent.fract() {
        0.0 => whole,
        0.5 => whole * x.sqrt(),
        _ => x.power(exponent),
    }
}

/// The distance in a metric, before the root.
fn measure(v: DVec3, metric: f64) -> f64 {
    power(v.x.abs(), metric) + power(v.y.abs(), metric) + power(v.z.abs(), metric)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The same without leaving any point out.
    fn plain(p: DVec3, crackle: &Crackle) -> f64 {
        let base = (p - DVec3::splat(TINY)).floor();
        let mut all: Vec<(f64, DVec3)> = NEAR_CUBES
            .iter()
            .map(|&[x, y, z]| {
                let cell = base + DVec3::new(f64::from(x), f64::from(y), f64::from(z));
                let seed = hash3(cell.x as i64, cell.y as i64, cell.z as i64);
                let point = cell + DVec3::new(random(seed), random(seed + 1), random(seed + 2));
                (measure(point - p, crackle.metric) + power(crackle.offset.abs(), crackle.metric), point)
            })
            .collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        if crackle.is_solid {
            return noise(all[0].1, NoiseGenerator::Corrected);
        }
        let root =
            |sum: f64| if crackle.metric == 2.0 { sum.sqrt() } else { sum.power(1.0 / crackle.metric) };
        (0..3).map(|i| crackle.form[i] * root(all[i].0)).sum::<f64>().clamp(0.0, 1.0)
    }

    #[test]
    fn crackle_leaves_out_only_points_that_do_not_count() {
        let forms = [DVec3::X, DVec3::new(-1.0, 1.0, 0.0), DVec3::new(0.3, 0.2, 0.5)];
        for metric in [0.6, 1.0, 1.5, 2.0, 2.3, 2.5, 3.0, 7.5, 20.0] {
            for (i, is_solid) in (0..400).map(|i| (i, i % 4 == 3)) {
                let spread = |k: i32| f64::from(i * k % 397) * 0.037 - 7.0;
                let p = DVec3::new(spread(31), spread(57), spread(83));
                let offset = if i % 5 == 0 { 0.2 } else { 0.0 };
                let pattern = Crackle { form: forms[i as usize % 3], metric, offset, is_solid };
                let found = crackle(p, &pattern, NoiseGenerator::Corrected);
                assert_eq!(found, plain(p, &pattern), "{p} {pattern:?}");
            }
        }
    }

    #[test]
    fn powers_of_halves_are_powers() {
        for x in [0.0_f64, 0.3, 1.0, 2.7] {
            for exponent in [0.5, 1.0, 1.5, 2.5, 3.0, 4.25, 7.5, 20.0] {
                let expected = Elementary::power(x, exponent);
                assert!((power(x, exponent) - expected).abs() <= 1e-14 * expected, "{x} {exponent}");
            }
        }
    }
}
