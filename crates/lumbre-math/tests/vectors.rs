//! The mathematics against reference data computed with 120 digits: every family that is not about shapes.
//!
//! Each test says how many records it must see, so that a missing family fails.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use glam::{DMat3, DMat4, DQuat, DVec2, DVec3, DVec4};
use lumbre_math::quaternion::{self, Euler};
use lumbre_math::view::{Handedness, View};
use lumbre_math::{Frame, Transform, matrix, optics, orthonormal_basis, projection, vector};
use serde_json::Value;

/// Relative to the largest of the expected numbers.
const TOLERANCE: f64 = 1e-14;

fn records(family: &str, expected: usize) -> Vec<Value> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/vectors.json");
    let text = std::fs::read_to_string(path).expect("the reference data is in the repository");
    let mut all: Value = serde_json::from_str(&text).expect("it is JSON");
    let Value::Array(records) = all[family].take() else { panic!("no family {family}") };
    assert_eq!(records.len(), expected, "{family}");
    records
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

fn numbers<const N: usize>(value: &Value) -> [f64; N] {
    let list: Vec<f64> =
        value.as_array().unwrap_or_else(|| panic!("{value} is no list")).iter().map(number).collect();
    list.try_into().unwrap_or_else(|list| panic!("{list:?} has not {N} entries"))
}

fn vec3(value: &Value) -> DVec3 {
    DVec3::from_array(numbers(value))
}

fn mat3(value: &Value) -> DMat3 {
    matrix::rows3(numbers(value))
}

fn mat4(value: &Value) -> DMat4 {
    matrix::rows4(numbers(value))
}

fn quat(value: &Value) -> DQuat {
    quaternion::from_wxyz(numbers(value))
}

#[track_caller]
fn close(what: &str, found: &[f64], expected: &[f64], record: &Value) {
    assert_eq!(found.len(), expected.len());
    let scale = expected.iter().fold(0.0_f64, |most, e| most.max(e.abs()));
    for (f, e) in found.iter().zip(expected) {
        // Where all is zero, a rounding of numbers near one is what can be asked for.
        let slack = TOLERANCE * if scale > 0.0 { scale } else { 1.0 };
        assert!((f - e).abs() <= slack, "{what}: {found:?}, not {expected:?}, in {record}");
    }
}

#[track_caller]
fn close3(what: &str, found: DVec3, expected: &Value, record: &Value) {
    close(what, &found.to_array(), &numbers::<3>(expected), record);
}

#[track_caller]
fn close_mat3(what: &str, found: DMat3, expected: &Value, record: &Value) {
    close(what, &matrix::to_rows3(&found), &numbers::<9>(expected), record);
}

#[track_caller]
fn close_mat4(what: &str, found: DMat4, expected: &Value, record: &Value) {
    close(what, &matrix::to_rows4(&found), &numbers::<16>(expected), record);
}

#[test]
fn products_angles_and_projections_of_vectors() {
    for r in records("vector", 6) {
        let (a, b) = (vec3(&r["a"]), vec3(&r["b"]));
        close("dot", &[vector::dot(a, b)], &[number(&r["dot"])], &r);
        close("dot of glam", &[a.dot(b)], &[number(&r["dot"])], &r);
        close3("cross", vector::cross(a, b), &r["cross"], &r);
        close3("cross of glam", a.cross(b), &r["cross"], &r);
        close3("cross matrix", vector::cross_matrix(a) * b, &r["cross"], &r);
        close("angle", &[vector::angle(a, b)], &[number(&r["angle_rad"])], &r);
        close("length", &[vector::projected_length(a, b)], &[number(&r["proj_len_b_on_a"])], &r);
        close3("projection", vector::project(a, b), &r["proj_b_on_a"], &r);
        close3("rest", b - vector::reject(a, b), &r["proj_b_on_a"], &r);
    }
}

/// The product of one record, which has sizes of its own.
fn check_product<const R: usize, const K: usize, const C: usize>(r: &Value) -> bool {
    fn rows<const R: usize, const C: usize>(value: &Value) -> Option<[[f64; C]; R]> {
        let list = value.as_array()?;
        if list.len() != R || list.iter().any(|row| row.as_array().is_none_or(|row| row.len() != C)) {
            return None;
        }
        Some(std::array::from_fn(|i| numbers(&list[i])))
    }
    let (Some(a), Some(b)) = (rows::<R, K>(&r["a"]), rows::<K, C>(&r["b"])) else { return false };
    let expected = rows::<R, C>(&r["product"]).expect("the sizes fit");
    close("product", matrix::product(&a, &b).as_flattened(), expected.as_flattened(), r);
    let swapped = matrix::product(&matrix::transpose(&b), &matrix::transpose(&a));
    close("transposed", matrix::transpose(&swapped).as_flattened(), expected.as_flattened(), r);
    true
}

#[test]
fn products_of_matrices() {
    for r in records("matrix_product", 3) {
        let checked = [
            check_product::<3, 2, 4>(&r),
            check_product::<2, 2, 1>(&r),
            check_product::<2, 2, 2>(&r),
            check_product::<3, 3, 3>(&r),
            check_product::<4, 4, 4>(&r),
        ];
        assert_eq!(checked.into_iter().filter(|&c| c).count(), 1, "sizes not foreseen in {r}");
    }
}

#[test]
fn rotations_about_an_axis() {
    for r in records("axis_angle", 12) {
        let (axis, degrees, v) = (vec3(&r["axis"]), number(&r["angle_deg"]), vec3(&r["v"]));
        let turn = matrix::axis_angle(axis, degrees).unwrap();
        close_mat3("matrix", turn, &r["matrix3"], &r);
        close3("rotated", turn * v, &r["rotated"], &r);
        close3("by parts", matrix::rotate_vector(axis, degrees, v).unwrap(), &r["rotated"], &r);
        let map = Transform::rotate(axis, degrees).unwrap();
        close3("transform", map.vector(v), &r["rotated"], &r);
        close("back", &map.inverse_vector(vec3(&r["rotated"])).to_array(), &v.to_array(), &r);
        let q = quaternion::from_axis_angle(axis, degrees).unwrap();
        close("quaternion", &quaternion::to_wxyz(q), &numbers::<4>(&r["quaternion"]), &r);
        close3("by quaternion", quaternion::rotate(q, v), &r["rotated"], &r);
    }
}

#[test]
fn euler_angles_both_ways() {
    let mut poles = 0;
    for r in records("euler", 18) {
        let [heading, attitude, bank] =
            ["heading_deg", "attitude_deg", "bank_deg"].map(|key| number(&r[key]));
        let q = Euler { heading, attitude, bank }.to_quaternion();
        close("quaternion", &quaternion::to_wxyz(q), &numbers::<4>(&r["quaternion"]), &r);
        let turn = matrix::rotation_y(heading) * matrix::rotation_z(attitude) * matrix::rotation_x(bank);
        close_mat3("three turns", turn, &r["matrix3"], &r);
        close_mat3("matrix", quaternion::to_matrix(q), &r["matrix3"], &r);
        let given = quat(&r["quaternion"]);
        let found = Euler::from_quaternion(given);
        let expected: [f64; 3] = numbers(&r["recovered_deg"]);
        // Next to a pole heading and bank are uncertain by u / cos(attitude), in opposite ways.
        let pole = !r["pole"].is_null();
        poles += usize::from(pole);
        let slack = if pole { 1.0 } else { 1.0 / expected[1].to_radians().cos() };
        let pairs = [found.heading, found.attitude, found.bank].into_iter().zip(expected);
        for (f, e) in pairs {
            // A half turn either way is the same.
            let difference = ((f - e + 540.0).rem_euclid(360.0) - 180.0).abs();
            assert!(difference <= TOLERANCE * 180.0 * slack, "{found:?} in {r}");
        }
        close_mat3("again", quaternion::to_matrix(found.to_quaternion()), &r["matrix3"], &r);
    }
    assert!(poles >= 4, "{poles}");
}

#[test]
fn algebra_of_quaternions() {
    for r in records("quaternion", 10) {
        let (p, q) = (quat(&r["p"]), quat(&r["q"]));
        let same = |what: &str, found: DQuat, key: &str| {
            close(what, &quaternion::to_wxyz(found), &numbers::<4>(&r[key]), &r);
        };
        same("sum", p + q, "sum");
        same("product", p * q, "product");
        same("conjugate", p.conjugate(), "conjugate_p");
        same("inverse", quaternion::inverse(p).unwrap(), "inverse_p");
        close("norm", &[p.length()], &[number(&r["norm_p"])], &r);
    }
}

#[test]
fn quaternions_turn_vectors() {
    for r in records("quaternion_rotate", 6) {
        let (q, v) = (quat(&r["quaternion"]), vec3(&r["v"]));
        close3("rotated", quaternion::rotate(q, v), &r["rotated"], &r);
        close_mat3("matrix", quaternion::to_matrix(q), &r["matrix3"], &r);
        let again = quaternion::from_matrix(&mat3(&r["matrix3"]));
        close_mat3("from the matrix", quaternion::to_matrix(again), &r["matrix3"], &r);
        // q v q⁻¹ to the letter.
        let product = q * DQuat::from_xyzw(v.x, v.y, v.z, 0.0) * quaternion::inverse(q).unwrap();
        close3("product", product.xyz(), &r["rotated"], &r);
    }
}

#[test]
fn frames_from_two_directions() {
    let mut parallel = 0;
    for r in records("frame", 7) {
        let (a, b) = (vec3(&r["a"]), vec3(&r["b"]));
        let any = Frame::from_two_or_any(a, b).unwrap();
        close3("w", any.z, &r["w"], &r);
        if r["u"].is_null() {
            parallel += 1;
            assert_eq!(Frame::from_two(a, b), None, "{r}");
            assert_eq!(any, Frame::from_z(any.z));
            continue;
        }
        let frame = Frame::from_two(a, b).unwrap();
        close3("u", frame.x, &r["u"], &r);
        close3("v", frame.y, &r["v"], &r);
        assert_eq!(frame, any);
    }
    assert_eq!(parallel, 1);
}

#[test]
fn frames_from_one_direction() {
    for r in records("onb", 10) {
        let n = vector::unit(vec3(&r["n"])).unwrap();
        close3("n", n, &r["unit_n"], &r);
        let (e1, e2) = orthonormal_basis(vec3(&r["unit_n"]));
        close3("e1", e1, &r["b1"], &r);
        close3("e2", e2, &r["b2"], &r);
    }
}

#[test]
fn views_of_either_hand() {
    let mut hands = [0, 0];
    for r in records("look_at", 12) {
        let (eye, target, up) = (vec3(&r["eye"]), vec3(&r["center"]), vec3(&r["up"]));
        let (map, other) = match r["handedness"].as_str() {
            Some("right") => {
                hands[0] += 1;
                (Transform::look_at_right(eye, target, up), Transform::look_at_left(eye, target, up))
            }
            Some("left") => {
                hands[1] += 1;
                (Transform::look_at_left(eye, target, up), Transform::look_at_right(eye, target, up))
            }
            hand => panic!("{hand:?}"),
        };
        let (map, other) = (map.unwrap(), other.unwrap());
        close_mat4("matrix", DMat4::from(*map.affine()), &r["matrix"], &r);
        close3("target", map.point(target), &r["center_image"], &r);
        // The other hand turns half round about y.
        let turned = Transform::scale(DVec3::new(-1.0, 1.0, -1.0)).unwrap() * other;
        close_mat4("turned", DMat4::from(*turned.affine()), &r["matrix"], &r);
    }
    assert_eq!(hands, [6, 6]);
}

#[test]
fn orthographic_projections() {
    for r in records("ortho", 5) {
        let [l, right, b, t, n, f] =
            ["left", "right", "bottom", "top", "near", "far"].map(|key| number(&r[key]));
        let lens = projection::orthographic(l, right, b, t, n, f).unwrap();
        close_mat4("matrix", lens, &r["matrix"], &r);
        close3("image", projection::project(&lens, vec3(&r["point"])).unwrap(), &r["image"], &r);
    }
}

#[test]
fn perspective_projections() {
    let mut points = 0;
    for r in records("perspective", 5) {
        let [fovy, aspect, near, far] = ["fovy_deg", "aspect", "near", "far"].map(|key| number(&r[key]));
        let lens = projection::perspective(fovy, aspect, near, far).unwrap();
        close_mat4("matrix", lens, &r["matrix"], &r);
        for at in r["points"].as_array().unwrap() {
            let p = vec3(&at["point"]);
            let clip = projection::clip_coordinates(&lens, p);
            close("clip", &clip.to_array(), &numbers::<4>(&at["clip"]), &r);
            close3("image", projection::project(&lens, p).unwrap(), &at["ndc"], &r);
            points += 1;
        }
    }
    assert_eq!(points, 20);
}

#[test]
fn central_projections_on_a_plane() {
    for r in records("simple_projection", 3) {
        let lens = projection::simple_perspective(number(&r["d"])).unwrap();
        let p = vec3(&r["point"]);
        close_mat4("matrix", lens, &r["matrix"], &r);
        close("clip", &projection::clip_coordinates(&lens, p).to_array(), &numbers::<4>(&r["clip"]), &r);
        close3("image", projection::project(&lens, p).unwrap(), &r["image"], &r);
    }
}

#[test]
fn normals_of_transformed_surfaces() {
    for r in records("normal_transform", 8) {
        let (linear, n) = (mat3(&r["matrix3"]), vec3(&r["normal"]));
        close3("matrix", matrix::transform_normal(&linear, n).unwrap(), &r["transformed"], &r);
        // The translation must not matter.
        let moved = matrix::affine4(linear, DVec3::new(5.0, -7.0, 11.0));
        let map = Transform::from_matrix(moved).unwrap();
        close3("transform", map.normal(n).normalize(), &r["transformed"], &r);
    }
}

#[test]
fn the_standard_chain_in_rows_and_in_columns() {
    for r in records("composition", 6) {
        let (scale, degrees, offset) = (vec3(&r["scale"]), vec3(&r["angles_deg"]), vec3(&r["translate"]));
        let p = vec3(&r["point"]);
        let columns = matrix::standard_chain(scale, degrees, offset);
        close_mat4("columns", columns, &r["column_matrix_same_angles"], &r);
        let image = (columns * p.extend(1.0)).truncate();
        close3("image", image, &r["column_image_same_angles"], &r);
        let rows = matrix::row_chain_with_column_rotations(scale, degrees, offset);
        close_mat4("rows", rows, &r["row_matrix"], &r);
        close_mat4("equivalent", matrix::from_row_convention(rows), &r["column_matrix_equivalent"], &r);
        let negated = matrix::standard_chain(scale, -degrees, offset);
        // The chain in rows, factor by factor as it is printed.
        let printed = [
            matrix::to_row_convention(matrix::affine4(matrix::scale3(scale), DVec3::ZERO)),
            matrix::affine4(matrix::rotation_x(degrees.x), DVec3::ZERO),
            matrix::affine4(matrix::rotation_y(degrees.y), DVec3::ZERO),
            matrix::affine4(matrix::rotation_z(degrees.z), DVec3::ZERO),
            matrix::to_row_convention(matrix::affine4(DMat3::IDENTITY, offset)),
        ];
        close_mat4("printed", printed.into_iter().product(), &r["row_matrix"], &r);
        close_mat4("negated", negated, &r["column_matrix_equivalent"], &r);
        let row_image: DVec4 = p.extend(1.0);
        let as_row = [0, 1, 2].map(|c| row_image.dot(rows.col(c)));
        close("row image", &as_row, &numbers::<3>(&r["row_image"]), &r);
        // The chain of transforms, with its inverse.
        let map = Transform::translate(offset)
            * Transform::rotate(DVec3::Z, degrees.z).unwrap()
            * Transform::rotate(DVec3::Y, degrees.y).unwrap()
            * Transform::rotate(DVec3::X, degrees.x).unwrap()
            * Transform::scale(scale).unwrap();
        close_mat4("transform", DMat4::from(*map.affine()), &r["column_matrix_same_angles"], &r);
        close("back", &map.inverse_point(image).to_array(), &p.to_array(), &r);
    }
}

/// A list of elementary maps in the order in which they act.
fn chain(ops: &Value) -> Transform {
    ops.as_array().unwrap().iter().fold(Transform::IDENTITY, |map, op| {
        let args: Vec<f64> = op.as_array().unwrap()[1..].iter().map(number).collect();
        let axis = |axis| Transform::rotate(axis, args[0]).unwrap();
        let next = match op[0].as_str().unwrap() {
            "scale" => Transform::scale(DVec3::from_slice(&args)).unwrap(),
            "translate" => Transform::translate(DVec3::from_slice(&args)),
            "rotate_x_deg" => axis(DVec3::X),
            "rotate_y_deg" => axis(DVec3::Y),
            "rotate_z_deg" => axis(DVec3::Z),
            "shear" => Transform::shear(args[0], args[1], args[2], args[3], args[4], args[5]).unwrap(),
            name => panic!("{name}"),
        };
        next * map
    })
}

#[test]
fn rays_go_to_object_space_and_keep_their_parameter() {
    for r in records("t_rescale", 4) {
        let map = chain(&r["ops"]);
        let origin = map.inverse_point(vec3(&r["origin"]));
        let direction = map.inverse_vector(vec3(&r["direction"]));
        close3("origin", origin, &r["object_origin"], &r);
        close3("direction", direction, &r["object_direction"], &r);
        let length = vector::length(direction);
        close("length", &[length], &[number(&r["object_direction_length"])], &r);
        let (world, object): ([f64; 2], [f64; 2]) = (numbers(&r["t_world"]), numbers(&r["t_object_unit"]));
        close("t", &object.map(|t| t / length), &world, &r);
        for t in world {
            // On the unit sphere, where the parameter of the world says.
            close("on the sphere", &[vector::length(origin + t * direction)], &[1.0], &r);
        }
    }
}

#[test]
fn the_transforms_of_the_shapes_and_their_inverses() {
    let mut checked = 0;
    for r in records("intersection", 413) {
        let transform = &r["transform"];
        if transform.is_null() {
            continue;
        }
        let map = chain(&transform["ops"]);
        close_mat4("matrix", DMat4::from(*map.affine()), &transform["matrix"], &r);
        close_mat4("inverse", DMat4::from(*map.inverse_affine()), &transform["inverse"], &r);
        close("determinant", &[map.determinant()], &[number(&transform["det"])], &r);
        assert_eq!(map.is_mirror(), number(&transform["det"]) < 0.0);
        let general = Transform::from_matrix(mat4(&transform["matrix"])).unwrap();
        close_mat4(
            "inverse of the matrix",
            DMat4::from(*general.inverse_affine()),
            &transform["inverse"],
            &r,
        );
        checked += 1;
    }
    assert!(checked > 60, "{checked}");
}

#[test]
fn rays_through_pixel_centres() {
    for r in records("camera_ray", 8) {
        let (eye, target, up) = (vec3(&r["eye"]), vec3(&r["center"]), vec3(&r["up"]));
        let view = View::look_at(eye, target, up, Handedness::Right).unwrap();
        let size = DVec2::new(number(&r["width"]), number(&r["height"]));
        let film = DVec2::from_array(numbers(&r["pixel"])) + 0.5;
        let direction = view.perspective_direction(number(&r["fovy_deg"]), size, film);
        close3("origin", view.eye, &r["origin"], &r);
        close3("direction", direction.normalize(), &r["direction_unit"], &r);
    }
}

#[test]
fn reflected_and_refracted_directions() {
    let mut total = 0;
    for r in records("reflect_refract", 7) {
        let (d, n, eta) = (vec3(&r["direction"]), vec3(&r["normal"]), number(&r["eta"]));
        close3("reflected", optics::reflect(d, n).normalize(), &r["reflected_unit"], &r);
        close3("facing", optics::facing(n, d).normalize(), &r["facing_normal"], &r);
        match optics::refract(d, n, eta) {
            Some(refracted) => close3("refracted", refracted, &r["refracted_unit"], &r),
            None => {
                assert!(r["refracted_unit"].is_null(), "{r}");
                total += 1;
            }
        }
    }
    assert_eq!(total, 1);
}
