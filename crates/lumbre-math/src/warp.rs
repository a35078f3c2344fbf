//! Maps from the unit square to disks, hemispheres, spheres, cones and triangles, each with its density.
//!
//! This module computes in single precision, for shading; [`crate::warp64`] has the same functions in double precision,
//! for points that geometry goes on to compute with. A density (`…_pdf`) is per unit of the area or solid angle that
//! the map lands on, for a uniform point of the square. Directions are in a frame whose pole is z.
//!
//! | to | map | back | density |
//! |---|---|---|---|
//! | unit disk | [`square_to_disk`] | [`disk_to_square`] | [`disk_pdf`] |
//! | hemisphere, by cosine | [`square_to_cosine_hemisphere`] | [`cosine_hemisphere_to_square`] | [`cosine_hemisphere_pdf`] |
//! | hemisphere | [`square_to_hemisphere`] | [`hemisphere_to_square`] | [`hemisphere_pdf`] |
//! | sphere | [`square_to_sphere`] | [`sphere_to_square`] | [`sphere_pdf`] |
//! | cone about z | [`square_to_cone`] | [`cone_to_square`] | [`cone_pdf`] |
//! | triangle | [`square_to_triangle`], [`square_to_triangle_turk`] | [`triangle_to_square`] | 1/area |
//! | sphere, equal areas, octahedral | [`equal_area_square_to_sphere`] | [`equal_area_sphere_to_square`] | [`sphere_pdf`] |
//! | sphere, latitude and longitude | [`latlong_to_sphere`] | [`sphere_to_latlong`] | [`latlong_pdf`] |
//!
//! ```
//! use lumbre_math::{Vec2, Vec3, warp};
//!
//! let u = Vec2::new(0.3, 0.8);
//! let direction = warp::square_to_cosine_hemisphere(u);
//! assert!(direction.is_normalized() && direction.z > 0.0);
//! assert!((warp::cosine_hemisphere_to_square(direction) - u).length() < 1e-6);
//!
//! // The middle of an equal-area environment picture is straight up, its corners are straight down.
//! assert_eq!(warp::equal_area_square_to_sphere(Vec2::new(0.5, 0.5)), Vec3::Z);
//! assert_eq!(warp::equal_area_square_to_sphere(Vec2::new(1.0, 0.0)), -Vec3::Z);
//! ```

macro_rules! warps {
    ($scalar:ident, $v2:ident, $v3:ident, $terms:expr) => {
        use std::$scalar::consts::{FRAC_1_PI, FRAC_PI_2, FRAC_PI_4, PI, TAU};

        use glam::{$v2, $v3};

        use crate::Elementary;

        /// The sine and cosine of an angle up to π/4, by the terms of their series that the precision can hold: the
        /// same bits on every machine, and faster than what is good for all angles.
        #[inline]
        pub(crate) fn sin_cos_octant(angle: $scalar) -> ($scalar, $scalar) {
            let square = angle * angle;
            let (mut sin, mut cos) = (1.0, 1.0);
            for k in (1..=$terms).rev() {
                let even = 2.0 * k as $scalar;
                sin = 1.0 - square * (1.0 / (even * (even + 1.0))) * sin;
                cos = 1.0 - square * (1.0 / (even * (even - 1.0))) * cos;
            }
            (angle * sin, cos)
        }

        /// The sine and cosine of this many turns, which are exact at quarters.
        #[inline]
        pub fn circle(turns: $scalar) -> ($scalar, $scalar) {
            let quarter = (4.0 * turns).rounded();
            let (sin, cos) = sin_cos_octant((4.0 * turns - quarter) * FRAC_PI_2);
            match quarter.rem_euclid(4.0) as u8 {
                0 => (sin, cos),
                1 => (cos, -sin),
                2 => (-sin, -cos),
                _ => (-cos, sin),
            }
        }

        /// Maps the unit square to the unit disk, preserving area with little distortion: squares about the
        /// middle become circles.
        ///
        /// Source: Shirley, Chiu, "A Low Distortion Map Between Disk and Square", Journal of Graphics Tools
        /// 2(3), 1997.
        pub fn square_to_disk(u: $v2) -> $v2 {
            let p = 2.0 * u - $v2::ONE;
            if p == $v2::ZERO {
                return $v2::ZERO;
            }
            if p.x.abs() > p.y.abs() {
                let (sin, cos) = sin_cos_octant(FRAC_PI_4 * (p.y / p.x));
                p.x * $v2::new(cos, sin)
            } else {
                // The angle measured from the y axis: exact on it.
                let (sin, cos) = sin_cos_octant(FRAC_PI_4 * (p.x / p.y));
                p.y * $v2::new(sin, cos)
            }
        }

        /// The inverse of [`square_to_disk`].
        pub fn disk_to_square(p: $v2) -> $v2 {
            let radius = p.length();
            let square = if p.x.abs() > p.y.abs() {
                let radius = radius.copysign(p.x);
                $v2::new(radius, radius * (p.y / p.x).arc_tangent() / FRAC_PI_4)
            } else if p.y != 0.0 {
                let radius = radius.copysign(p.y);
                $v2::new(radius * (p.x / p.y).arc_tangent() / FRAC_PI_4, radius)
            } else {
                $v2::ZERO
            };
            (0.5 * (square + $v2::ONE)).clamp($v2::ZERO, $v2::ONE)
        }

        /// The density of [`square_to_disk`] per area.
        pub fn disk_pdf() -> $scalar {
            FRAC_1_PI
        }

        /// A direction of the upper hemisphere with a density proportional to its cosine: the disk, projected
        /// up.
        pub fn square_to_cosine_hemisphere(u: $v2) -> $v3 {
            let p = square_to_disk(u);
            p.extend((1.0 - p.length_squared()).max(0.0).sqrt())
        }

        /// The inverse of [`square_to_cosine_hemisphere`], for a unit vector with `w.z ≥ 0`.
        pub fn cosine_hemisphere_to_square(w: $v3) -> $v2 {
            disk_to_square(w.truncate())
        }

        /// The density of [`square_to_cosine_hemisphere`] per solid angle; 0 below the horizon.
        pub fn cosine_hemisphere_pdf(cos_theta: $scalar) -> $scalar {
            cos_theta.max(0.0) * FRAC_1_PI
        }

        /// A uniform direction of the upper hemisphere: the disk under Lambert's equal-area map.
        pub fn square_to_hemisphere(u: $v2) -> $v3 {
            let p = square_to_disk(u);
            let square = p.length_squared().min(1.0);
            (p * (2.0 - square).sqrt()).extend(1.0 - square)
        }

        /// The inverse of [`square_to_hemisphere`], for a unit vector with `w.z ≥ 0`.
        pub fn hemisphere_to_square(w: $v3) -> $v2 {
            disk_to_square(w.truncate() / (1.0 + w.z).sqrt())
        }

        /// The density of [`square_to_hemisphere`] per solid angle.
        pub fn hemisphere_pdf() -> $scalar {
            1.0 / TAU
        }

        /// A uniform direction of the sphere. `u.x` gives the height (0 is the pole +z), `u.y` the azimuth from
        /// x to y.
        pub fn square_to_sphere(u: $v2) -> $v3 {
            let (sin, cos) = circle(u.y);
            // √(1 - z²) without cancellation near the poles.
            let radius = 2.0 * (u.x * (1.0 - u.x)).max(0.0).sqrt();
            $v3::new(radius * cos, radius * sin, 1.0 - 2.0 * u.x)
        }

        /// The inverse of [`square_to_sphere`].
        pub fn sphere_to_square(w: $v3) -> $v2 {
            let height = if w.z > 0.0 { 0.5 * one_minus_z(w) } else { 0.5 * (1.0 - w.z) };
            $v2::new(height.min(1.0), turn(w))
        }

        /// The density of [`square_to_sphere`] and of [`equal_area_square_to_sphere`] per solid angle.
        pub fn sphere_pdf() -> $scalar {
            1.0 / (2.0 * TAU)
        }

        /// A uniform direction of the cone about z. The cone is given by `1 - cos θ` of its half-angle θ, in
        /// `(0, 2]`; for a narrow cone compute that as `sin² θ / (1 + cos θ)`, to avoid cancellation.
        pub fn square_to_cone(u: $v2, one_minus_cos_max: $scalar) -> $v3 {
            let p = square_to_disk(u);
            let square = p.length_squared().min(1.0);
            let lowered = one_minus_cos_max * square;
            (p * (one_minus_cos_max * (2.0 - lowered)).max(0.0).sqrt()).extend(1.0 - lowered)
        }

        /// The inverse of [`square_to_cone`], for a unit vector in the cone.
        pub fn cone_to_square(w: $v3, one_minus_cos_max: $scalar) -> $v2 {
            let lowered = if w.z > 0.0 { one_minus_z(w) } else { 1.0 - w.z };
            let radius = (lowered / one_minus_cos_max).sqrt();
            let across = w.truncate().length();
            if across > 0.0 { disk_to_square(w.truncate() * (radius / across)) } else { $v2::splat(0.5) }
        }

        /// The density of [`square_to_cone`] per solid angle.
        pub fn cone_pdf(one_minus_cos_max: $scalar) -> $scalar {
            1.0 / (TAU * one_minus_cos_max)
        }

        /// Barycentric coordinates of a uniform point of a triangle, continuous and of little distortion.
        ///
        /// Source: Heitz, "A Low-Distortion Map Between Triangle and Square", 2019.
        pub fn square_to_triangle(u: $v2) -> $v3 {
            let b = if u.y > u.x {
                let x = 0.5 * u.x;
                $v2::new(x, u.y - x)
            } else {
                let y = 0.5 * u.y;
                $v2::new(u.x - y, y)
            };
            $v3::new((1.0 - b.x - b.y).max(0.0), b.x, b.y)
        }

        /// The inverse of [`square_to_triangle`].
        pub fn triangle_to_square(b: $v3) -> $v2 {
            if b.z > b.y { $v2::new(2.0 * b.y, b.y + b.z) } else { $v2::new(b.y + b.z, 2.0 * b.z) }
        }

        /// Barycentric coordinates of a uniform point of a triangle, by the square root; it squeezes the square
        /// into one corner.
        ///
        /// Source: Turk, "Generating Random Points in Triangles", Graphics Gems, 1990.
        pub fn square_to_triangle_turk(u: $v2) -> $v3 {
            let root = u.x.max(0.0).sqrt();
            $v3::new(1.0 - root, root * (1.0 - u.y), root * u.y)
        }

        /// Maps the unit square to the sphere, preserving area: the inner square |x|+|y| ≤ 1 (of the square
        /// scaled to [-1, 1]²) is the upper hemisphere, its corners the axes ±x, ±y; the four outer triangles
        /// fold under it and meet at -z. It is continuous across the edges of the square by
        /// [`equal_area_wrap`].
        ///
        /// This is the mapping of octahedral environment maps. Source: Clarberg, "Fast Equal-Area Mapping of
        /// the (Hemi)Sphere using SIMD", Journal of Graphics Tools 13(3), 2008.
        pub fn equal_area_square_to_sphere(u: $v2) -> $v3 {
            let p = 2.0 * u - $v2::ONE;
            let (x, y) = (p.x.abs(), p.y.abs());
            // Positive on the upper hemisphere; 1 minus its magnitude is the distance from the nearer pole.
            let signed = 1.0 - (x + y);
            // Above, `x + y` itself: `1 - (1 - (x + y))` would round once more near the pole.
            let radius = if signed >= 0.0 { x + y } else { (1.0 - x) + (1.0 - y) };
            if radius == 0.0 {
                return $v3::new(0.0, 0.0, (1.0 as $scalar).copysign(signed));
            }
            let (sin, cos) = circle(0.125 * ((y - x) / radius + 1.0));
            let square = radius * radius;
            let across = radius * (2.0 - square).sqrt();
            $v3::new(
                (across * cos.max(0.0)).copysign(p.x),
                (across * sin).copysign(p.y),
                (1.0 - square).copysign(signed),
            )
        }

        /// The inverse of [`equal_area_square_to_sphere`].
        pub fn equal_area_sphere_to_square(w: $v3) -> $v2 {
            let a = w.abs();
            // √(1 - |z|) without cancellation near the poles.
            let radius = one_minus_z(a).max(0.0).sqrt().min(1.0);
            // The azimuth within a quadrant, in [0, 1]; atan2(0, 0) is 0.
            let y = radius * (a.y.angle_from(a.x) / FRAC_PI_2);
            let x = radius - y;
            // By `is_sign_negative`: the horizon belongs to both halves, and either gives the same point there.
            let (x, y) = if w.z.is_sign_negative() { (1.0 - y, 1.0 - x) } else { (x, y) };
            let p = $v2::new(x.copysign(w.x), y.copysign(w.y));
            0.5 * (p + $v2::ONE)
        }

        /// Wraps a point up to one square outside the unit square, for filtering across the edges of an
        /// equal-area map: each edge meets itself, mirrored about its middle.
        pub fn equal_area_wrap(u: $v2) -> $v2 {
            let mut p = u;
            if p.x < 0.0 {
                p = $v2::new(-p.x, 1.0 - p.y);
            } else if p.x > 1.0 {
                p = $v2::new(2.0 - p.x, 1.0 - p.y);
            }
            if p.y < 0.0 {
                p = $v2::new(1.0 - p.x, -p.y);
            } else if p.y > 1.0 {
                p = $v2::new(1.0 - p.x, 2.0 - p.y);
            }
            p
        }

        /// The direction at longitude `2π u.x`, from x towards y, and at the angle `π u.y` from +z.
        pub fn latlong_to_sphere(u: $v2) -> $v3 {
            let (sin_phi, cos_phi) = circle(u.x);
            let (sin_theta, cos_theta) = circle(0.5 * u.y);
            $v3::new(sin_theta * cos_phi, sin_theta * sin_phi, cos_theta)
        }

        /// The inverse of [`latlong_to_sphere`].
        pub fn sphere_to_latlong(w: $v3) -> $v2 {
            $v2::new(turn(w), w.truncate().length().angle_from(w.z) * FRAC_1_PI)
        }

        /// The density of [`latlong_to_sphere`] per solid angle, at a direction with this sine of its angle
        /// from z. Infinite at the poles.
        pub fn latlong_pdf(sin_theta: $scalar) -> $scalar {
            1.0 / (TAU * PI * sin_theta)
        }

        /// `1 - z` of a unit vector with `z ≥ 0`, without cancellation.
        fn one_minus_z(w: $v3) -> $scalar {
            (w.x * w.x + w.y * w.y) / (1.0 + w.z)
        }

        /// The azimuth from x towards y in turns, in `[0, 1)`.
        fn turn(w: $v3) -> $scalar {
            let turns = w.y.angle_from(w.x) / TAU;
            let turns = if turns < 0.0 { turns + 1.0 } else { turns };
            if turns < 1.0 { turns } else { 0.0 }
        }
    };
}

pub(crate) use warps;

warps!(f32, Vec2, Vec3, 5);

#[cfg(test)]
mod tests {
    #[test]
    fn sines_and_cosines_of_an_octant_have_all_their_digits() {
        for i in -1000..=1000 {
            let angle = f64::from(i) * 1e-3 * std::f64::consts::FRAC_PI_4;
            let (sin, cos) = super::super::warp64::sin_cos_octant(angle);
            assert!((sin - angle.sin()).abs() <= 3e-16 && (cos - angle.cos()).abs() <= 3e-16, "{angle}");
            let (sin, cos) = super::sin_cos_octant(angle as f32);
            let expected = f64::from(angle as f32).sin_cos();
            assert!((f64::from(sin) - expected.0).abs() <= 1.2e-7, "{angle}");
            assert!((f64::from(cos) - expected.1).abs() <= 1.2e-7, "{angle}");
            let turns = 2.5e-3 * f64::from(i);
            let (sin, cos) = super::super::warp64::circle(turns);
            let expected = (turns * std::f64::consts::TAU).sin_cos();
            assert!((sin - expected.0).abs() <= 4e-15 && (cos - expected.1).abs() <= 4e-15, "{turns}");
        }
    }
}
