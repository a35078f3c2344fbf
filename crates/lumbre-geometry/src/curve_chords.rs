//! A quick test, in single precision, of whether a ray may touch a curve.

use std::ops::Range;

use lumbre_math::Vec3;

/// The number of chords that stand for a curve, between equal steps of its parameter.
pub(crate) const CHORDS: usize = 8;

/// Bernstein's cubic polynomials at the ends of all chords: exact in single precision.
const WEIGHTS: [[f32; CHORDS + 1]; 4] = {
    let mut weights = [[0.0; CHORDS + 1]; 4];
    let mut i = 0;
    while i <= CHORDS {
        let u = i as f32 / CHORDS as f32;
        let v = 1.0 - u;
        weights[0][i] = v * v * v;
        weights[1][i] = 3.0 * u * v * v;
        weights[2][i] = 3.0 * u * u * v;
        weights[3][i] = u * u * u;
        i += 1;
    }
    weights
};
/// How far a curve is from its chords at most, relative to the larger of the second differences of its control points:
/// a chord of step h is off by h²/8 times the second derivative, which is six times a second difference.
const OFF: f32 = 6.0 / (8.0 * (CHORDS * CHORDS) as f32);
/// The rounding of all steps, relative to the distance of the control points: some 40 units in the last place.
const ROUNDING: f32 = 5e-6;
/// The sizes between which no square leaves the range of single precision.
const SIZES: Range<f32> = 1e-15..1e15;

/// Whether a ray certainly misses everything within `reach` of the line through two points: `start`, relative to the
/// ray's origin, and the one at `chord` from there. The direction has any length.
#[inline]
pub(crate) fn passes_line(start: Vec3, chord: Vec3, direction: Vec3, reach: f32) -> bool {
    let normal = direction.cross(chord);
    let length = normal.length();
    let [from, along, way] = [start, chord, direction].map(|v| v.abs().element_sum());
    // The cross product of nearly parallel vectors has a large relative error.
    let limit = reach * length + ROUNDING * (from + along) * along * way;
    // False where anything leaves the range of single precision.
    start.dot(normal).abs() > limit && length > SIZES.start
}

/// Whether a ray may come as near to a cubic Bézier curve as half the curve's width. It is never false where the ray
/// does, and true without a test for sizes whose squares leave the range of single precision.
///
/// `points` are the control points relative to the ray's origin. The direction has any length, the width is linear
/// between `widths` at both ends, and `chords` are those to test.
#[inline]
pub(crate) fn may_touch(points: [Vec3; 4], direction: Vec3, widths: [f32; 2], chords: Range<usize>) -> bool {
    let size = points.iter().fold(0.0, |size: f32, p| size.max(p.abs().element_sum()));
    let length = direction.length();
    if !(SIZES.contains(&size) && SIZES.contains(&length)) {
        return true;
    }
    let (right, up) = (direction / length).any_orthonormal_pair();
    let [across, above] = [right, up].map(|axis| points.map(|p| axis.dot(p)));
    let [x, y] = [across, above].map(|p| {
        std::array::from_fn::<f32, { CHORDS + 1 }, _>(|i| {
            p[0] * WEIGHTS[0][i] + p[1] * WEIGHTS[1][i] + p[2] * WEIGHTS[2][i] + p[3] * WEIGHTS[3][i]
        })
    });
    let difference = |first: usize| {
        let along = |p: &[f32; 4]| p[first] - 2.0 * p[first + 1] + p[first + 2];
        along(&across).powi(2) + along(&above).powi(2)
    };
    let slack = OFF * difference(0).max(difference(1)).sqrt() + ROUNDING * size;
    let step = (widths[1] - widths[0]) / CHORDS as f32;
    let widening = 0.5 * step.abs();
    let excess: [f32; CHORDS] = std::array::from_fn(|i| {
        let (along_x, along_y) = (x[i + 1] - x[i], y[i + 1] - y[i]);
        let length_squared = (along_x * along_x + along_y * along_y).max(f32::MIN_POSITIVE);
        let share = -(x[i] * along_x + y[i] * along_y) / length_squared;
        let share = share.clamp(0.0, 1.0);
        let (near_x, near_y) = (x[i] + share * along_x, y[i] + share * along_y);
        // Half the width in the middle of the chord, and how much wider its wider end is.
        let middle = widths[0] + step * (i as f32 + 0.5);
        let reach = 0.5 * (middle + widening) + slack;
        near_x * near_x + near_y * near_y - reach * reach
    });
    excess[chords].iter().any(|&excess| excess <= 0.0)
}

#[cfg(test)]
mod tests {
    use lumbre_math::random::RandomStream;

    use super::*;

    fn between(random: &mut RandomStream, low: f64, high: f64) -> f64 {
        low + (high - low) * random.next_f64()
    }

    /// The distance of the point at a parameter from the ray's line, by double precision.
    fn distance(points: &[Vec3; 4], direction: Vec3, u: f64) -> f64 {
        let p = points.map(|p| p.as_dvec3());
        let v = 1.0 - u;
        let at = v * v * v * p[0] + 3.0 * u * v * v * p[1] + 3.0 * u * u * v * p[2] + u * u * u * p[3];
        at.reject_from(direction.as_dvec3()).length()
    }

    #[test]
    fn no_ray_that_touches_a_curve_is_said_to_miss_it() {
        let mut random = RandomStream::new(5);
        let (mut touched, mut missed, mut rejected, mut passed) = (0, 0, 0, 0);
        for round in 0..4000 {
            let scale = 10f64.powf(between(&mut random, -6.0, 6.0));
            let away = between(&mut random, 0.0, 3.0).exp() - 1.0;
            let mut vector = |scale: f64| {
                let mut one = || (scale * between(&mut random, -1.0, 1.0)) as f32;
                Vec3::new(one(), one(), one())
            };
            let start = vector(scale * away);
            let mut points = [start; 4];
            for i in 1..4 {
                points[i] = points[i - 1] + vector(0.4 * scale);
            }
            if round % 16 == 0 {
                // A straight line, and a point.
                points = if round % 32 == 0 {
                    [start; 4]
                } else {
                    [0.0, 0.1, 0.2, 0.3].map(|s| start * (1.0 + s))
                };
            }
            let aim = points[round % 4] + vector(0.1 * scale);
            let direction = aim * between(&mut random, 0.1, 10.0) as f32;
            let width = || scale * 10f64.powf(-4.0);
            let widths = [width(), 3.0 * width()].map(|w| (w * 10f64.powf((round % 7) as f64 / 2.0)) as f32);
            let is_near = |u: f64| {
                let width = f64::from(widths[0]) + u * f64::from(widths[1] - widths[0]);
                distance(&points, direction, u) <= 0.5 * width
            };
            let steps = 512;
            for chord in 0..CHORDS {
                let first = chord * steps / CHORDS;
                let touches = (first..=first + steps / CHORDS).any(|i| is_near(i as f64 / steps as f64));
                let may = may_touch(points, direction, widths, chord..chord + 1);
                assert!(may || !touches, "{points:?} {direction} {widths:?} {chord}");
                touched += u32::from(touches);
                missed += u32::from(!touches);
                rejected += u32::from(!may);
            }
            let chord = points[3] - points[0];
            let is_within = |p: &Vec3| (p - points[0]).cross(chord).length() / chord.length();
            let reach = points.iter().map(is_within).fold(0.0, f32::max) + 0.5 * widths[0].max(widths[1]);
            let passes = passes_line(points[0], chord, direction, 1.001 * reach);
            let touches = (0..=steps).any(|i| is_near(i as f64 / steps as f64));
            assert!(!(passes && touches), "{points:?} {direction} {widths:?}");
            passed += u32::from(passes);
        }
        assert!(touched > 1000 && passed > 50, "{touched} {passed}");
        assert!(f64::from(rejected) > 0.8 * f64::from(missed), "{rejected} of {missed}");
    }

    #[test]
    fn sizes_out_of_range_are_not_judged() {
        for scale in [1e-30, 1e25, f32::INFINITY, f32::NAN] {
            let points = [1.0, 2.0, 3.0, 4.0].map(|x| scale * Vec3::new(x, 1.0, 0.0));
            assert!(may_touch(points, Vec3::Z, [0.0; 2], 0..CHORDS), "{scale}");
            let points = [1.0, 2.0, 3.0, 4.0].map(|x| Vec3::new(x, 1.0, 0.0));
            assert!(may_touch(points, scale * Vec3::Z, [0.0; 2], 0..CHORDS), "{scale}");
            assert!(!may_touch(points, Vec3::Z, [0.0; 2], 0..CHORDS));
        }
    }
}
