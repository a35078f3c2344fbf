use std::f64::consts::PI;

use super::*;

fn surface(curvature: f64, thickness: f64, eta: f64, diameter: f64) -> LensSurface {
    let [curvature, thickness, aperture] = [curvature, thickness, 0.5 * diameter].map(|mm| 1e-3 * mm);
    LensSurface { curvature, thickness, eta, aperture }
}

/// Two elements with a stop of this many millimetres between.
fn surfaces(stop: f64) -> Vec<LensSurface> {
    vec![
        surface(50.0, 6.0, 1.5, 30.0),
        surface(-50.0, 10.0, 1.0, 30.0),
        surface(0.0, 4.0, 0.0, stop),
        surface(80.0, 5.0, 1.6, 28.0),
        surface(-60.0, 40.0, 1.0, 28.0),
    ]
}

fn lens(stop: f64, distance: f64) -> Lens {
    Lens::new(surfaces(stop), None, distance, 0.035).unwrap()
}

/// The mean weight over the exit pupil, where light comes through.
fn brightness(lens: &Lens, film: DVec2) -> f64 {
    let n = 300;
    let place = |i: i32| (f64::from(i) + 0.5) / f64::from(n);
    let rays = (0..n * n).filter_map(|i| lens.ray(film, DVec2::new(place(i % n), place(i / n))));
    rays.map(|(_, _, weight)| weight).sum::<f64>() / f64::from(n * n)
}

#[test]
fn a_focused_lens_has_the_focal_length_of_its_surfaces() {
    // By quadrature elsewhere.
    let lens = lens(10.0, 2.0);
    assert!((lens.focal_length() - 32.441e-3).abs() < 2e-6, "{}", lens.focal_length());
    assert!((lens.film_distance() - 20.278e-3).abs() < 2e-6, "{}", lens.film_distance());
}

#[test]
fn rays_from_a_point_of_the_film_meet_where_the_lens_is_focused() {
    for distance in [0.3, 2.0, 50.0] {
        let lens = lens(4.0, distance);
        for film in [DVec2::new(0.0, 0.0), DVec2::new(0.0008, -0.0011)] {
            let mut points = vec![];
            for u in [DVec2::new(0.45, 0.5), DVec2::new(0.55, 0.5), DVec2::new(0.5, 0.56)] {
                let (origin, direction, weight) = lens.ray(film, u).unwrap();
                assert!(weight > 0.0 && direction.z > 0.0 && (direction.length() - 1.0).abs() < 1e-12);
                points.push(origin + direction * ((distance - origin.z) / direction.z));
            }
            let spread = (points[0] - points[1]).length().max((points[0] - points[2]).length());
            // By a tenth of the pupil, which is 4 mm wide, rays part far more without a lens.
            assert!(spread < 2e-4 * distance, "{distance} {film}: {spread}");
            // Upside down, as large as a thin lens makes it.
            let image = points[0].truncate() / film;
            let scale = 1.0 - (distance - lens.film_distance()) / lens.focal_length();
            let is_turned = film == DVec2::ZERO || (image / scale - 1.0).abs().max_element() < 0.15;
            assert!(is_turned, "{distance}: {image} {scale}");
        }
    }
}

#[test]
fn brightness_follows_the_unvignetted_stop() {
    // Of a sky of 1, by quadrature elsewhere: the middle of the film, and a corner, which is vignetted.
    let lens = lens(10.0, 2.0);
    let middle = brightness(&lens, DVec2::ZERO);
    assert!((middle / 0.119 - 1.0).abs() < 0.01, "{middle}");
    let corner = 0.5 * 0.035 * (1.0 - 4.0 / 64.0) * DVec2::new(0.5_f64.sqrt(), -(0.5_f64.sqrt()));
    let corner = brightness(&lens, corner);
    assert!((corner / 0.0749 - 1.0).abs() < 0.02, "{corner}");
    // π sin² of the angle of the stop, whose tangent is half as large for half the diameter.
    let narrow = brightness(&Lens::new(surfaces(5.0), None, 2.0, 0.035).unwrap(), DVec2::ZERO);
    let squared_sine = middle / PI;
    let squared_tangent = 0.25 * squared_sine / (1.0 - squared_sine);
    let expected = PI * squared_tangent / (1.0 + squared_tangent);
    assert!((narrow / expected - 1.0).abs() < 0.01, "{narrow}, expected {expected}");
}

#[test]
fn stops_by_name_let_as_much_light_through_as_a_round_one() {
    let round = brightness(&lens(8.0, 2.0), DVec2::ZERO);
    for name in ApertureImage::NAMES {
        let stop = ApertureImage::named(name);
        assert!(stop.is_some(), "{name}");
        let shaped = brightness(&Lens::new(surfaces(8.0), stop, 2.0, 0.035).unwrap(), DVec2::ZERO);
        assert!((shaped / round - 1.0).abs() < 0.02, "{name}: {shaped} {round}");
    }
    assert!(ApertureImage::named("heart").is_none());
    // The square of the stop, half of it open: dark outside.
    let square = ApertureImage::named("square").unwrap();
    assert!(square.at(DVec2::new(0.0, 0.4)) > 1.0 && square.at(DVec2::new(0.0, 0.6)) == 0.0);
    assert_eq!(square.at(DVec2::new(1.1, 0.0)), 0.0);
    // A corner of the pentagon and of the star; two points of the star are above each other.
    let pentagon = ApertureImage::named("pentagon").unwrap();
    assert!(pentagon.at(DVec2::new(0.0, 0.75)) > 0.0 && pentagon.at(DVec2::new(0.0, -0.75)) == 0.0);
    let star = ApertureImage::named("star").unwrap();
    assert!(star.at(DVec2::new(-0.9, 0.0)) > 0.0 && star.at(DVec2::new(0.9, 0.0)) == 0.0);
}

#[test]
fn what_makes_no_lens_is_refused() {
    let refused =
        |surfaces: Vec<LensSurface>, distance| Lens::new(surfaces, None, distance, 0.035).unwrap_err();
    assert_eq!(refused(vec![], 2.0), LensError::Surface);
    let mut negative = surfaces(10.0);
    negative[1].thickness = -1.0;
    assert_eq!(refused(negative, 2.0), LensError::Surface);
    // Planes alone bend nothing.
    assert_eq!(refused(vec![surface(0.0, 5.0, 1.0, 9.0)], 2.0), LensError::NoFocus);
    assert_eq!(refused(surfaces(10.0), 0.05), LensError::TooNear);
}
