//! The maps of [`crate::warp`] in double precision.

crate::warp::warps!(f64, DVec2, DVec3, 9);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::RandomStream;
    use crate::warp;

    const SIDE: usize = 512;

    /// A function of a point and its mean.
    type Moment<T> = (fn(&T) -> f64, f64);

    /// The centres of a fine grid over the square.
    fn grid() -> impl Iterator<Item = DVec2> {
        let at = |i: usize| (i as f64 + 0.5) / SIDE as f64;
        (0..SIDE * SIDE).map(move |i| DVec2::new(at(i % SIDE), at(i / SIDE)))
    }

    fn random_points(count: usize) -> impl Iterator<Item = DVec2> {
        let mut random = RandomStream::new(21);
        (0..count).map(move |_| DVec2::new(random.next_f64(), random.next_f64()))
    }

    /// Random points, and those on lines where a map changes from one formula to another.
    fn all_points() -> impl Iterator<Item = DVec2> {
        let special = [0.0, 0.125, 0.25, 0.5, 0.75, 0.875, 1.0 - 1e-9, 1e-12];
        let lattice = special.into_iter().flat_map(move |x| special.map(|y| DVec2::new(x, y)));
        lattice.chain(random_points(20_000))
    }

    /// Asserts that the mean of each moment over the image of the grid is as given.
    fn assert_moments<const N: usize, T>(name: &str, map: impl Fn(DVec2) -> T, moments: [Moment<T>; N]) {
        let mut sums = [0.0; N];
        for u in grid() {
            let point = map(u);
            for (sum, (moment, _)) in sums.iter_mut().zip(&moments) {
                *sum += moment(&point);
            }
        }
        for (k, (sum, (_, expected))) in sums.iter().zip(&moments).enumerate() {
            let mean = sum / (SIDE * SIDE) as f64;
            // (The grid sees the square root at the rim of the disk only to 5e-5.)
            assert!((mean - expected).abs() < 1e-4, "{name}, moment {k}: {mean}, not {expected}");
        }
    }

    fn assert_back_and_forth(
        name: &str,
        map: impl Fn(DVec2) -> DVec3,
        back: impl Fn(DVec3) -> DVec2,
        tolerance: f64,
    ) {
        let mut count = 0;
        for u in all_points() {
            let w = map(u);
            let again = map(back(w));
            assert!((again - w).length() < tolerance, "{name}: {u} to {w} to {} to {again}", back(w));
            count += 1;
        }
        assert!(count > 20_000);
    }

    /// The ratio of the area of the image of a small square to the area of that square, by central differences.
    fn stretch(map: impl Fn(DVec2) -> DVec3, u: DVec2) -> f64 {
        let h = 1e-5;
        let along_x = (map(u + DVec2::X * h) - map(u - DVec2::X * h)) / (2.0 * h);
        let along_y = (map(u + DVec2::Y * h) - map(u - DVec2::Y * h)) / (2.0 * h);
        along_x.cross(along_y).length()
    }

    #[test]
    fn the_disk_has_the_moments_of_a_disk() {
        assert_moments(
            "disk",
            square_to_disk,
            [
                (|p| p.x, 0.0),
                (|p| p.y, 0.0),
                (|p| p.x * p.x, 0.25),
                (|p| p.x * p.y, 0.0),
                (|p| p.length(), 2.0 / 3.0),
            ],
        );
        for u in all_points() {
            assert!(square_to_disk(u).length() <= 1.0 + 1e-15);
            assert!((disk_to_square(square_to_disk(u)) - u).length() < 1e-14, "{u}");
        }
        assert_eq!(disk_to_square(DVec2::ZERO), DVec2::splat(0.5));
        assert_eq!(square_to_disk(DVec2::new(0.5, 1.0)), DVec2::Y);
        assert_eq!(square_to_disk(DVec2::new(0.0, 0.5)), -DVec2::X);
    }

    #[test]
    fn hemispheres_have_the_moments_of_their_densities() {
        assert_moments(
            "cosine",
            square_to_cosine_hemisphere,
            [
                (|w| w.z, 2.0 / 3.0),
                (|w| w.z * w.z, 0.5),
                (|w| w.x, 0.0),
                (|w| w.y * w.y, 0.25),
                (|w| w.x * w.z, 0.0),
            ],
        );
        assert_moments(
            "uniform",
            square_to_hemisphere,
            [(|w| w.z, 0.5), (|w| w.z * w.z, 1.0 / 3.0), (|w| w.x, 0.0), (|w| w.y * w.y, 1.0 / 3.0)],
        );
        for u in all_points() {
            assert!((square_to_hemisphere(u).length() - 1.0).abs() < 1e-15);
            assert!((square_to_cosine_hemisphere(u).length() - 1.0).abs() < 1e-15);
        }
        assert_back_and_forth("uniform", square_to_hemisphere, hemisphere_to_square, 1e-14);
        // At the horizon the height is the square root of what is left of 1: half the digits.
        assert_back_and_forth("cosine", square_to_cosine_hemisphere, cosine_hemisphere_to_square, 1e-7);
    }

    #[test]
    fn spheres_have_the_moments_of_a_sphere() {
        let moments: [Moment<DVec3>; 7] = [
            (|w| w.x, 0.0),
            (|w| w.y, 0.0),
            (|w| w.z, 0.0),
            (|w| w.x * w.x, 1.0 / 3.0),
            (|w| w.z * w.z, 1.0 / 3.0),
            (|w| w.y * w.z, 0.0),
            (|w| w.z.powi(4) + w.x.powi(4), 0.4),
        ];
        assert_moments("sphere", square_to_sphere, moments);
        assert_moments("equal area", equal_area_square_to_sphere, moments);
        assert_back_and_forth("sphere", square_to_sphere, sphere_to_square, 1e-14);
        assert_back_and_forth("equal area", equal_area_square_to_sphere, equal_area_sphere_to_square, 1e-14);
        assert_back_and_forth("latlong", latlong_to_sphere, sphere_to_latlong, 1e-14);
    }

    #[test]
    fn cones_wide_and_narrow_have_the_moments_of_a_cap() {
        for one_minus_cos in [2.0, 1.0, 0.3, 1e-3, 1e-14] {
            let sum: DVec3 = grid().map(|u| square_to_cone(u, one_minus_cos)).sum();
            let mean = sum / (SIDE * SIDE) as f64;
            assert!((mean - DVec3::Z * (1.0 - 0.5 * one_minus_cos)).length() < 1e-5);
            let across: f64 =
                grid().map(|u| square_to_cone(u, one_minus_cos).truncate().length_squared()).sum();
            // The mean of 1 - z², z uniform in [1 - c, 1], is c - c²/3.
            let expected = one_minus_cos - one_minus_cos * one_minus_cos / 3.0;
            assert!((across / (SIDE * SIDE) as f64 / expected - 1.0).abs() < 1e-4);
            for u in random_points(2_000) {
                let w = square_to_cone(u, one_minus_cos);
                assert!((w.length() - 1.0).abs() < 1e-15);
                assert!(w.z >= 1.0 - one_minus_cos - 1e-15);
                let again = cone_to_square(w, one_minus_cos);
                // A whole sphere: what is next to -z has lost its distance from it.
                let tolerance = if one_minus_cos == 2.0 { 1e-6 } else { 1e-13 };
                assert!((again - u).length() < tolerance, "{one_minus_cos}: {u}, {again}");
            }
        }
        assert_eq!(cone_to_square(DVec3::Z, 0.3), DVec2::splat(0.5));
    }

    #[test]
    fn each_density_is_one_over_the_stretch_of_its_map() {
        let mut count = 0;
        for u in random_points(2_000) {
            // Differences must not reach over a line where two formulas meet.
            let p = (2.0 * u - DVec2::ONE).abs();
            let near = |a: f64| a.abs() < 1e-3;
            if near(p.x)
                || near(p.y)
                || near(p.x - p.y)
                || near(p.x + p.y - 1.0)
                || near(1.0 - p.x)
                || near(1.0 - p.y)
            {
                continue;
            }
            count += 1;
            let close = |map: &dyn Fn(DVec2) -> DVec3, pdf: f64, name: &str| {
                let product = stretch(map, u) * pdf;
                assert!((product - 1.0).abs() < 1e-4, "{name} at {u}: {product}");
            };
            close(&|u| square_to_disk(u).extend(0.0), disk_pdf(), "disk");
            let w = square_to_cosine_hemisphere(u);
            close(&square_to_cosine_hemisphere, cosine_hemisphere_pdf(w.z), "cosine");
            close(&square_to_hemisphere, hemisphere_pdf(), "hemisphere");
            close(&square_to_sphere, sphere_pdf(), "sphere");
            close(&|u| square_to_cone(u, 0.4), cone_pdf(0.4), "cone");
            close(&equal_area_square_to_sphere, sphere_pdf(), "equal area");
            let sin_theta = latlong_to_sphere(u).truncate().length();
            close(&latlong_to_sphere, latlong_pdf(sin_theta), "latlong");
            let corners = [DVec3::new(1.0, 2.0, 3.0), DVec3::new(4.0, 2.5, 3.0), DVec3::new(1.0, 5.0, 7.0)];
            let area = 0.5 * (corners[1] - corners[0]).cross(corners[2] - corners[0]).length();
            let place = |b: DVec3| corners[0] * b.x + corners[1] * b.y + corners[2] * b.z;
            close(&|u| place(square_to_triangle(u)), 1.0 / area, "triangle");
            close(&|u| place(square_to_triangle_turk(u)), 1.0 / area, "triangle by the root");
        }
        assert!(count > 1_900, "{count}");
        assert_eq!(cosine_hemisphere_pdf(-0.25), 0.0);
    }

    #[test]
    fn triangles_have_the_moments_of_a_triangle() {
        let moments: [Moment<DVec3>; 5] = [
            (|b| b.x, 1.0 / 3.0),
            (|b| b.y, 1.0 / 3.0),
            (|b| b.x * b.x, 1.0 / 6.0),
            (|b| b.y * b.z, 1.0 / 12.0),
            (|b| b.z * b.z, 1.0 / 6.0),
        ];
        assert_moments("heitz", square_to_triangle, moments);
        assert_moments("turk", square_to_triangle_turk, moments);
        assert_back_and_forth("heitz", square_to_triangle, triangle_to_square, 1e-15);
        for u in all_points() {
            for b in [square_to_triangle(u), square_to_triangle_turk(u)] {
                assert!(b.min_element() >= 0.0 && (b.element_sum() - 1.0).abs() < 1e-15, "{u}: {b}");
            }
        }
    }

    #[test]
    fn the_equal_area_square_has_its_axes_where_they_belong() {
        let at = |x, y| equal_area_square_to_sphere(DVec2::new(x, y));
        let axes = [
            (0.5, 0.5, DVec3::Z),
            (1.0, 0.5, DVec3::X),
            (0.0, 0.5, -DVec3::X),
            (0.5, 1.0, DVec3::Y),
            (0.5, 0.0, -DVec3::Y),
            (0.0, 0.0, -DVec3::Z),
            (1.0, 1.0, -DVec3::Z),
        ];
        for (x, y, axis) in axes {
            assert!((at(x, y) - axis).length() < 1e-15, "{x}, {y}: {}", at(x, y));
        }
        // The signs of x and y are those of the quadrant, above and below the horizon, and z falls outwards.
        assert!(at(0.7, 0.6).cmpgt(DVec3::ZERO).all());
        let below = at(0.2, 0.95);
        assert!(below.x < 0.0 && below.y > 0.0 && below.z < 0.0);
        // A point by hand: p = (1/2, 1/4), r = 3/4, z = 1 - 9/16, azimuth π/4 (1 - 1/3) = 30°.
        let across = (1.0_f64 - 0.4375 * 0.4375).sqrt();
        let expected = DVec3::new(across * 0.75_f64.sqrt(), across * 0.5, 0.4375);
        assert!((at(0.75, 0.625) - expected).length() < 1e-15);
        // Its mirror image under the horizon: (1/2, 1/4) reflects in the line x + y = 1 to (3/4, 1/2).
        let mirrored = DVec3::new(expected.x, expected.y, -expected.z);
        assert!((at(0.875, 0.75) - mirrored).length() < 1e-15);
    }

    #[test]
    fn next_to_the_poles_equal_areas_keep_their_digits() {
        for k in 10..45 {
            let tiny = f64::powi(2.0, -k);
            for z in [1.0, -1.0] {
                let w = DVec3::new(0.6 * tiny, -0.8 * tiny, z * (1.0 - tiny * tiny).sqrt());
                let again = equal_area_square_to_sphere(equal_area_sphere_to_square(w));
                assert!((again - w).truncate().length() < 1e-15, "{w} {again}");
                assert_eq!(again.z.signum(), z);
            }
        }
    }

    #[test]
    fn wrapping_an_equal_area_square_continues_the_sphere() {
        let mut count = 0;
        for u in random_points(5_000) {
            let (inside, outside) = (1e-9, -1e-9);
            for [a, b] in [
                [DVec2::new(inside, u.y), DVec2::new(outside, u.y)],
                [DVec2::new(1.0 - inside, u.y), DVec2::new(1.0 - outside, u.y)],
                [DVec2::new(u.x, inside), DVec2::new(u.x, outside)],
                [DVec2::new(u.x, 1.0 - inside), DVec2::new(u.x, 1.0 - outside)],
            ] {
                let wrapped = equal_area_wrap(b);
                assert_eq!(equal_area_wrap(a), a);
                assert!(wrapped.min_element() >= 0.0 && wrapped.max_element() <= 1.0);
                let [here, there] = [a, wrapped].map(equal_area_square_to_sphere);
                assert!((here - there).length() < 1e-7, "{a} {b}");
                count += 1;
            }
        }
        assert_eq!(count, 20_000);
        let corner = equal_area_wrap(DVec2::new(-0.25, 1.125));
        assert!(corner.min_element() >= 0.0 && corner.max_element() <= 1.0);
    }

    #[test]
    fn latitude_and_longitude_turn_from_x_to_y_and_fall_from_z() {
        assert!((latlong_to_sphere(DVec2::new(0.25, 0.5)) - DVec3::Y).length() < 1e-15);
        assert!((latlong_to_sphere(DVec2::new(0.0, 0.5)) - DVec3::X).length() < 1e-15);
        assert!(latlong_to_sphere(DVec2::new(0.3, 0.1)).z > 0.9);
        let u = DVec2::new(0.8125, 0.375);
        assert!((sphere_to_latlong(latlong_to_sphere(u)) - u).length() < 1e-15);
        assert_eq!(sphere_to_latlong(DVec3::new(1.0, -1e-300, 0.0)).x, 0.0);
    }

    #[test]
    fn single_precision_agrees_with_double() {
        for u in all_points() {
            let s = u.as_vec2();
            let u = s.as_dvec2();
            let close = |a: glam::Vec3, b: DVec3, tolerance: f64, name: &str| {
                assert!((a.as_dvec3() - b).length() < tolerance, "{name} at {u}: {a}, {b}");
            };
            close(warp::square_to_cosine_hemisphere(s), square_to_cosine_hemisphere(u), 1e-3, "cosine");
            close(warp::square_to_hemisphere(s), square_to_hemisphere(u), 1e-6, "hemisphere");
            close(warp::square_to_sphere(s), square_to_sphere(u), 1e-6, "sphere");
            close(warp::square_to_cone(s, 0.3), square_to_cone(u, 0.3_f32.into()), 1e-6, "cone");
            close(warp::square_to_triangle(s), square_to_triangle(u), 1e-6, "triangle");
            close(warp::square_to_triangle_turk(s), square_to_triangle_turk(u), 1e-6, "turk");
            close(warp::latlong_to_sphere(s), latlong_to_sphere(u), 1e-6, "latlong");
            let w = warp::equal_area_square_to_sphere(s);
            close(w, equal_area_square_to_sphere(u), 1e-6, "equal area");
            let again = warp::equal_area_square_to_sphere(warp::equal_area_sphere_to_square(w));
            close(again, w.as_dvec3(), 1e-6, "equal area back");
        }
    }
}
