//! Rectangles, sampled uniformly by solid angle.

use lumbre_math::{DVec2, DVec3, Elementary, direction_at};

/// A rectangle, up to rounding.
///
/// C. Urena, M. Fajardo, A. King, "An Area-Preserving Parametrization for Spherical Rectangles", EGSR 2013. The four
/// angles are kept as complex numbers here, whose product needs one arc tangent for the solid angle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rectangle {
    corner: DVec3,
    /// Orthonormal: along the sides, and the normal.
    axes: [DVec3; 3],
    lengths: DVec2,
}

/// A rectangle as seen from a viewpoint, with a non-zero solid angle.
#[derive(Clone, Copy, Debug)]
pub(super) struct RectangleView {
    /// The least and the greatest coordinates along the sides, relative to the viewpoint.
    least: DVec2,
    greatest: DVec2,
    /// The distance to the plane.
    height: f64,
    /// For each side of `least` and `greatest` along y, the angle that the corner of least x adds: see `corner_angle`.
    angles_of_least_x: [DVec2; 2],
    pub solid_angle: f64,
}

/// Cosines between sides up to this count as right angles: the rounding of one to single precision. The error of
/// densities is no greater.
const SQUARE: f64 = 1e-5;
/// Smaller solid angles are sampled by area: as a difference of angles, they lose digits.
const MIN_SOLID_ANGLE: f64 = 1e-5;

impl Rectangle {
    /// `None` for sides that are not at right angles.
    pub(super) fn new(corner: DVec3, sides: [DVec3; 2]) -> Option<Self> {
        let [x, y] = sides.map(DVec3::normalize);
        // False for NaN.
        let is_square = x.dot(y).abs() <= SQUARE;
        is_square.then(|| {
            let normal = x.cross(y).normalize();
            let lengths = DVec2::new(sides[0].length(), sides[1].length());
            Self { corner, axes: [x, normal.cross(x), normal], lengths }
        })
    }

    /// `None` if it should be sampled by area.
    #[inline]
    pub(super) fn seen_from(&self, from: DVec3) -> Option<RectangleView> {
        let way = self.corner - from;
        let [x, y, normal] = self.axes;
        let least = DVec2::new(way.dot(x), way.dot(y));
        let greatest = least + self.lengths;
        let height = way.dot(normal).abs();
        let [low, high] = [least, greatest].map(|corner| corner_angle(DVec2::new(least.x, corner.y), height));
        let [low_beyond, high_beyond] =
            [least, greatest].map(|corner| corner_angle(DVec2::new(greatest.x, corner.y), height));
        let angle = product(product(high_beyond, low), conjugate(product(low_beyond, high)));
        let angle = angle.y.angle_from(angle.x);
        // A sum of angles, from 0 to a full turn.
        let solid_angle = if angle < 0.0 { angle + std::f64::consts::TAU } else { angle };
        let range = MIN_SOLID_ANGLE..std::f64::consts::TAU - MIN_SOLID_ANGLE;
        let view = RectangleView { least, greatest, height, angles_of_least_x: [low, high], solid_angle };
        range.contains(&solid_angle).then_some(view)
    }

    /// A point uniform by solid angle, as fractions of the sides.
    #[inline]
    pub(super) fn sample(&self, view: &RectangleView, u: DVec2) -> DVec2 {
        let RectangleView { least, greatest, height, angles_of_least_x: [low, high], solid_angle } = *view;
        let squared = height * height;
        let (y0, y1) = (least.y, greatest.y);
        let (reach0, reach1) = ((y0 * y0 + squared).sqrt(), (y1 * y1 + squared).sqrt());
        // The part from the least x to this one has u.x of the solid angle.
        let turned = product(direction_at(u.x * solid_angle), product(high, conjugate(low)).normalize());
        let f = (y1 / reach1 - turned.x * (y0 / reach0)) / turned.y;
        let over = (f * f - squared / (reach0 * reach0)).max(0.0).sqrt();
        // Not `clamp`, which would propagate NaN.
        let x = (height.copysign(f) / over).max(least.x).min(greatest.x);
        // Along y, uniform by the sine of the angle.
        let across = x * x + squared;
        let (h0, h1) = (y0 / (across + y0 * y0).sqrt(), y1 / (across + y1 * y1).sqrt());
        let h = h0 + u.y * (h1 - h0);
        let y = (h * (across / (1.0 - h * h)).sqrt()).max(y0).min(y1);
        ((DVec2::new(x, y) - least) / self.lengths).clamp(DVec2::ZERO, DVec2::ONE)
    }
}

/// A complex number whose angle, from −π/2 to π/2, is the solid angle of the rectangle from the foot of the
/// perpendicular to a corner, negative if one coordinate of the corner is.
#[inline]
fn corner_angle(corner: DVec2, height: f64) -> DVec2 {
    let distance = (corner.length_squared() + height * height).sqrt();
    DVec2::new(height * distance, corner.x * corner.y)
}

#[inline]
fn product(a: DVec2, b: DVec2) -> DVec2 {
    a.rotate(b)
}

#[inline]
fn conjugate(a: DVec2) -> DVec2 {
    DVec2::new(a.x, -a.y)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use lumbre_math::random::RandomStream;

    use super::*;

    fn vector(random: &mut RandomStream) -> DVec3 {
        let mut x = || 2.0 * random.next_f64() - 1.0;
        DVec3::new(x(), x(), x())
    }

    fn any_rectangle(random: &mut RandomStream) -> (Rectangle, DVec3, [DVec3; 2]) {
        let x = vector(random).normalize();
        let y = x.cross(vector(random)).normalize();
        let sides = [x * (0.2 + random.next_f64()), y * (0.2 + 2.0 * random.next_f64())];
        let corner = vector(random);
        (Rectangle::new(corner, sides).unwrap(), corner, sides)
    }

    fn triangle_solid_angle(corners: [DVec3; 3]) -> f64 {
        let triangle = lumbre_geometry::Triangle::new(corners[0], corners[1], corners[2]).unwrap();
        triangle.solid_angle(DVec3::ZERO)
    }

    #[test]
    fn the_solid_angle_of_a_rectangle_is_that_of_its_triangles() {
        let mut random = RandomStream::new(3);
        let mut count = 0;
        for _ in 0..2000 {
            let (rectangle, corner, [a, b]) = any_rectangle(&mut random);
            let from = 2.5 * vector(&mut random);
            let Some(view) = rectangle.seen_from(from) else { continue };
            let at = corner - from;
            let expected = triangle_solid_angle([at, at + a, at + a + b])
                + triangle_solid_angle([at, at + a + b, at + b]);
            assert!(
                (view.solid_angle - expected).abs() < 1e-12 + 1e-9 * expected,
                "{} {expected}",
                view.solid_angle
            );
            count += 1;
        }
        assert!(count > 1900, "{count}");
    }

    #[test]
    fn points_of_a_rectangle_are_uniform_by_solid_angle() {
        let mut random = RandomStream::new(5);
        for case in 0..60 {
            let (rectangle, corner, [a, b]) = any_rectangle(&mut random);
            // Some so near that the solid angle is almost a hemisphere.
            let height = if case % 3 == 0 { 0.01 } else { 2.0 };
            let over = rectangle.axes[2] * height * (random.next_f64() - 0.5);
            let from =
                corner + a * (1.6 * random.next_f64() - 0.3) + b * (1.6 * random.next_f64() - 0.3) + over;
            let Some(view) = rectangle.seen_from(from) else { continue };
            const SIDE: usize = 40;
            const CELLS: usize = 4;
            let mut counts = [[0.0; CELLS]; CELLS];
            for i in 0..SIDE * SIDE {
                let jitter = DVec2::new(random.next_f64(), random.next_f64());
                let u = (DVec2::new((i % SIDE) as f64, (i / SIDE) as f64) + jitter) / SIDE as f64;
                let part = rectangle.sample(&view, u);
                let cell = |x: f64| ((x * CELLS as f64) as usize).min(CELLS - 1);
                counts[cell(part.y)][cell(part.x)] += 1.0 / (SIDE * SIDE) as f64;
                // The part up to a sample has the requested share of the solid angle.
                let up_to = Rectangle::new(corner, [a * part.x, b]).and_then(|part| part.seen_from(from));
                if let Some(up_to) = up_to {
                    assert!((up_to.solid_angle / view.solid_angle - u.x).abs() < 1e-6, "{case}: {u}");
                }
            }
            for (y, x) in (0..CELLS).flat_map(|y| (0..CELLS).map(move |x| (y, x))) {
                let start = corner + (a * x as f64 + b * y as f64) / CELLS as f64;
                let cell = Rectangle::new(start, [a, b].map(|side| side / CELLS as f64)).unwrap();
                let share = cell.seen_from(from).map_or(0.0, |cell| cell.solid_angle / view.solid_angle);
                assert!((counts[y][x] - share).abs() < 0.015, "{case} {x} {y}: {} {share}", counts[y][x]);
            }
        }
    }

    #[test]
    fn what_is_not_a_rectangle_or_not_to_be_seen_is_refused() {
        let (x, y) = (DVec3::new(2.0, 0.0, 0.0), DVec3::new(0.0, 3.0, 0.0));
        assert!(Rectangle::new(DVec3::ONE, [x, y + 1e-3 * x]).is_none());
        assert!(Rectangle::new(DVec3::ONE, [x, DVec3::ZERO]).is_none());
        let rectangle = Rectangle::new(DVec3::ONE, [x, y]).unwrap();
        // In its plane, beside it and on it.
        assert!(rectangle.seen_from(DVec3::new(-4.0, 2.0, 1.0)).is_none());
        assert!(
            rectangle.seen_from(DVec3::new(2.0, 2.0, 1.0)).is_none_or(|view| view.solid_angle > 1.9 * PI)
        );
        assert!(rectangle.seen_from(DVec3::new(2.0, 2.0, 1e9)).is_none());
    }
}
