//! Mistakes that texts on ray tracing print, each shown to be one: the printed form fails where ours holds.

use lumbre_math::glam::{DMat2, DMat3, DMat4, DVec2, DVec3};
use lumbre_math::matrix::{self, axis_angle, rotation_x, rotation_y, rotation_z};
use lumbre_math::quaternion::{self, Euler};
use lumbre_math::{Frame, Transform, optics, projection, vector};

const A: DVec3 = DVec3::new(1.0, -2.0, 3.5);
const B: DVec3 = DVec3::new(0.5, 4.0, 2.0);
const EYE: DVec3 = DVec3::new(4.0, -1.0, 7.0);
const TARGET: DVec3 = DVec3::new(-2.0, 3.0, 1.0);

fn far(a: DVec3, b: DVec3) -> bool {
    (a - b).length() > 1e-3
}

fn near(a: DVec3, b: DVec3) -> bool {
    (a - b).length() < 1e-13
}

#[test]
fn the_arc_cosine_is_blind_to_small_angles() {
    let tilted = DVec3::new(1.0, 1e-9, 0.0);
    let printed = (DVec3::X.dot(tilted) / tilted.length()).acos();
    assert_eq!(printed, 0.0);
    assert!((vector::angle(DVec3::X, tilted) - 1e-9).abs() < 1e-24);
}

#[test]
fn solving_for_a_perpendicular_vector_may_divide_by_zero() {
    // "Choose two components, solve for the third": 1, 1 and -(x + y)/z.
    let printed = |v: DVec3| DVec3::new(1.0, 1.0, -(v.x + v.y) / v.z);
    assert!(printed(DVec3::new(1.0, 2.0, 4.0)).dot(DVec3::new(1.0, 2.0, 4.0)).abs() < 1e-15);
    let flat = DVec3::new(1.0, 2.0, 0.0);
    assert!(!printed(flat).is_finite());
    assert_eq!(vector::perpendicular(flat).dot(flat), 0.0);
}

#[test]
fn z_cross_y_is_minus_x() {
    assert_eq!(vector::cross(DVec3::Z, DVec3::Y), -DVec3::X);
    assert_eq!(vector::cross(DVec3::X, DVec3::Z), -DVec3::Y);
}

#[test]
fn the_third_axis_is_the_cross_product_of_the_others() {
    let frame = Frame::from_two(A, B).unwrap();
    assert!(frame.x.dot(frame.y).abs() < 1e-15);
    assert!(near(frame.x.cross(frame.y), frame.z));
}

#[test]
fn the_mirror_about_the_y_axis_has_no_shear() {
    let printed = DMat2::from_cols(DVec2::new(-1.0, 1.0), DVec2::new(0.0, 1.0));
    let p = DVec2::new(3.0, 4.0);
    assert_eq!(matrix::mirror2_about_y() * p, DVec2::new(-3.0, 4.0));
    assert_ne!(printed * p, DVec2::new(-3.0, 4.0));
}

#[test]
fn the_transpose_of_a_product_swaps_its_factors() {
    let (a, b) = (rotation_x(20.0) * 2.0, matrix::shear3(1.0, 0.0, 0.0, 3.0, 0.0, 0.0));
    assert_eq!((a * b).transpose(), b.transpose() * a.transpose());
    assert_ne!((a * b).transpose(), a.transpose() * b.transpose());
}

#[test]
fn the_product_of_a_row_and_a_column_is_a_number() {
    let row = [A.to_array()];
    let column = B.to_array().map(|b| [b]);
    assert_eq!(matrix::product(&row, &column), [[A.dot(B)]]);
    // For row vectors, "the transpose of the first times the second" is a 3×3 matrix.
    assert_eq!(matrix::product(&matrix::transpose(&row), &[B.to_array()]).len(), 3);
}

#[test]
fn axes_as_rows_map_the_world_to_the_frame() {
    let frame = Frame::from_two(A, B).unwrap();
    let rows = frame.matrix().transpose();
    let p = DVec3::new(2.0, 5.0, -1.0);
    assert!(near(rows * p, frame.to_local(p)));
    assert!(near(rows * frame.x, DVec3::X) && near(rows.transpose() * DVec3::X, frame.x));
    assert!(far(rows * p, frame.to_world(p)));
    // Nor is it the products with the coordinates one by one.
    assert!(far(rows * p, DVec3::new(frame.x.dot(DVec3::splat(p.x)), frame.y.dot(p), frame.z.dot(p))));
}

#[test]
fn the_last_row_of_an_affine_matrix_is_0_0_0_1() {
    let good = matrix::affine4(rotation_y(30.0), A);
    assert!(Transform::from_matrix(good).is_ok());
    let mut printed = good;
    printed.w_axis.w = 0.0;
    assert!(Transform::from_matrix(printed).is_err());
}

#[test]
fn any_factor_but_zero_leaves_a_homogeneous_point_alone() {
    for factor in [-3.0, 1e-5, 0.5, 2.0] {
        let p = matrix::point_of_homogeneous(matrix::homogeneous_point(A) * factor).unwrap();
        assert!(near(p, A), "{factor}");
    }
}

#[test]
fn normals_need_the_sign_of_the_inverse_transpose() {
    let map = matrix::scale3(DVec3::new(-1.0, 3.0, 0.5));
    let (n, tangent) = (A, vector::perpendicular(A));
    let right = matrix::transform_normal(&map, n).unwrap();
    for factor in [-2.0, 1.0, 0.1] {
        let any = factor * (map.inverse().transpose() * n);
        assert!(any.dot(map * tangent).abs() < 1e-13);
        assert_eq!(any.dot(right) > 0.0, factor > 0.0);
    }
    // The map of the points itself does not carry them.
    assert!((map * n).dot(map * tangent).abs() > 1e-3);
}

#[test]
fn the_whole_inverse_transpose_puts_translation_in_w() {
    let whole = matrix::affine4(rotation_z(25.0) * matrix::scale3(DVec3::new(2.0, 3.0, 1.0)), B);
    let printed = whole.inverse().transpose() * A.extend(0.0);
    assert!(printed.w.abs() > 0.1);
    let map = Transform::from_matrix(whole).unwrap();
    assert!(near(map.normal(A), printed.truncate()));
}

#[test]
fn the_look_at_moves_by_minus_the_eye() {
    let map = Transform::look_at_right(EYE, TARGET, DVec3::Y).unwrap();
    let turn = matrix::affine4(map.linear(), DVec3::ZERO);
    let moved = |by: DVec3| turn * matrix::affine4(DMat3::IDENTITY, by);
    let eye_of = |m: DMat4| m.transform_point3(EYE);
    assert!(near(eye_of(moved(-EYE)), DVec3::ZERO));
    assert!(far(eye_of(moved(EYE)), DVec3::ZERO));
    assert!(near(map.point(TARGET), DVec3::new(0.0, 0.0, -(EYE - TARGET).length())));
}

#[test]
fn the_orthographic_translation_is_scaled_as_well() {
    let lens = projection::orthographic(-2.0, 6.0, 1.0, 3.0, 2.0, 10.0).unwrap();
    let mut printed = lens;
    printed.w_axis = DVec3::new(-2.0, -2.0, -6.0).extend(1.0);
    let corner = DVec3::new(6.0, 3.0, -10.0);
    assert!(near(projection::project(&lens, corner).unwrap(), DVec3::ONE));
    assert!(far(projection::project(&printed, corner).unwrap(), DVec3::ONE));
}

#[test]
fn central_projection_divides_by_the_distance_which_is_minus_z() {
    let p = DVec3::new(2.0, 3.0, -4.0);
    let image = projection::project(&projection::simple_perspective(1.0).unwrap(), p).unwrap();
    assert!(near(image, DVec3::new(0.5, 0.75, -1.0)));
    assert!(far(image, DVec3::new(p.x / p.z, p.y / p.z, -1.0)));
}

#[test]
fn the_printed_euler_angles_want_two_corrections() {
    let euler = Euler { heading: 25.0, attitude: -40.0, bank: 70.0 };
    let q = euler.to_quaternion();
    let [a, b, c, d] = quaternion::to_wxyz(q);
    let heading = |squares: f64| (2.0 * (c * a - b * d)).atan2(1.0 - squares).to_degrees();
    assert!((heading(2.0 * c * c + 2.0 * d * d) - 25.0).abs() < 1e-13);
    assert!((heading(2.0 * c * c + d * d) - 25.0).abs() > 1.0);
    assert!((Euler::from_quaternion(q).heading - 25.0).abs() < 1e-13);
    // The test for equality with the pole does not fire at the pole.
    let mut missed = 0;
    for heading in 0..90 {
        let pole = Euler { heading: f64::from(heading), attitude: 90.0, bank: 17.0 };
        let q = pole.to_quaternion();
        let [a, b, c, d] = quaternion::to_wxyz(q);
        missed += usize::from(b * c + d * a != 0.5);
        let found = Euler::from_quaternion(q);
        assert_eq!(found.bank, 0.0);
        assert!((found.heading - f64::from(heading) - 17.0).abs() < 1e-12);
    }
    assert!(missed > 10, "{missed}");
}

#[test]
fn rows_times_the_matrices_of_columns_rotate_the_other_way() {
    for (turn, back) in [
        (rotation_x(40.0), rotation_x(-40.0)),
        (rotation_y(40.0), rotation_y(-40.0)),
        (rotation_z(40.0), rotation_z(-40.0)),
    ] {
        // The row p M is the column Mᵀ p.
        assert!(near(turn.transpose() * A, back * A) && far(turn * A, back * A));
    }
}

#[test]
fn rotations_and_translations_do_not_commute() {
    let (turn, shift) = (Transform::rotate(B, 50.0).unwrap(), Transform::translate(A));
    let p = DVec3::new(2.0, 0.5, -1.0);
    assert!(near((shift * turn).point(p), axis_angle(B, 50.0).unwrap() * p + A));
    assert!(near((turn * shift).point(p), axis_angle(B, 50.0).unwrap() * (p + A)));
    assert!(far((shift * turn).point(p), (turn * shift).point(p)));
}

#[test]
fn six_mixed_products_are_equal_up_to_sign() {
    let c = DVec3::new(-1.0, 0.25, 6.0);
    let volume = vector::mixed_product(A, B, c);
    for (x, y, z, sign) in
        [(A, B, c, 1.0), (B, c, A, 1.0), (c, A, B, 1.0), (B, A, c, -1.0), (A, c, B, -1.0), (c, B, A, -1.0)]
    {
        assert!((vector::mixed_product(x, y, z) - sign * volume).abs() < 1e-14);
    }
    assert!(volume.abs() > 1.0);
}

#[test]
fn total_reflection_has_no_refracted_ray() {
    let d = DVec3::new(4.0, -3.0, 0.0);
    assert_eq!(optics::refract(d, DVec3::Y, 1.5), None);
    assert_eq!(optics::refract(d, DVec3::Y, 1.2), optics::refract(d, -DVec3::Y, 1.2));
    assert!(optics::refract(d, DVec3::Y, 1.2).is_some());
    assert_eq!(optics::reflect(d, DVec3::Y), optics::reflect(d, -2.0 * DVec3::Y));
}
