//! Elementary matrices in two and three dimensions, and the row and column conventions.
//!
//! Lumbre writes vectors as columns: `p' = M p`, a product reads right to left, the translation is in the last
//! column. Many texts write rows: `p' = p M`, a product reads left to right, the translation is in the last
//! row. One is the transpose of the other, `(A B)ᵀ = Bᵀ Aᵀ`:
//!
//! | columns | rows |
//! |---|---|
//! | `M` | `Mᵀ` |
//! | `T R S`: scale, rotate, translate | `Sᵀ Rᵀ Tᵀ` |
//! | [`rotation_z`]`(a)`, x towards y | its transpose, which equals `rotation_z(-a)` |
//!
//! Hence a text that multiplies row vectors by these rotation matrices rotates the other way. Numbers listed
//! row by row become a matrix by [`rows3`] and [`rows4`]; glam itself lists columns. Convert matrices for row
//! vectors by [`from_row_convention`] and [`to_row_convention`].
//!
//! Rectangular matrices are arrays of rows; see [`product`] and [`transpose`]. For square ones use glam's `*`,
//! `transpose`, `determinant`; for the inverse of an affine one [`Transform`](crate::Transform), which refuses
//! singular ones.

use glam::{DMat2, DMat3, DMat4, DVec2, DVec3, DVec4};

use crate::exact::{self, Solutions};
use crate::transform::sin_cos_degrees;
use crate::vector::{cross, dot, scaled_to_one, unit};

/// The product of an R×K and a K×C matrix: `product[i][j] = Σ_k a[i][k] b[k][j]`.
pub fn product<const R: usize, const K: usize, const C: usize>(
    a: &[[f64; K]; R],
    b: &[[f64; C]; K],
) -> [[f64; C]; R] {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..K).map(|k| a[i][k] * b[k][j]).sum()))
}

/// The transpose: `transpose[j][i] = a[i][j]`.
pub fn transpose<const R: usize, const C: usize>(a: &[[f64; C]; R]) -> [[f64; R]; C] {
    std::array::from_fn(|j| std::array::from_fn(|i| a[i][j]))
}

/// The matrix whose entries are listed row by row.
pub fn rows3(entries: [f64; 9]) -> DMat3 {
    DMat3::from_cols_array(&entries).transpose()
}

/// The matrix whose entries are listed row by row.
pub fn rows4(entries: [f64; 16]) -> DMat4 {
    DMat4::from_cols_array(&entries).transpose()
}

/// The entries row by row.
pub fn to_rows3(matrix: &DMat3) -> [f64; 9] {
    matrix.transpose().to_cols_array()
}

/// The entries row by row.
pub fn to_rows4(matrix: &DMat4) -> [f64; 16] {
    matrix.transpose().to_cols_array()
}

/// The matrix for column vectors equivalent to `m` for row vectors, `p' = p m`.
pub fn from_row_convention(m: DMat4) -> DMat4 {
    m.transpose()
}

/// The matrix for row vectors equivalent to `m` for column vectors, `p' = m p`.
pub fn to_row_convention(m: DMat4) -> DMat4 {
    m.transpose()
}

/// The standard chain for row vectors, scale, then x, y, z, then translate, with the rotation matrices of
/// column vectors. It rotates by the opposite angles; for scenes that were written with it. As a matrix for row
/// vectors.
pub fn row_chain_with_column_rotations(scale: DVec3, degrees: DVec3, offset: DVec3) -> DMat4 {
    to_row_convention(standard_chain(scale, -degrees, offset))
}

/// The standard chain: scale, then rotate about x, then y, then z, then translate: `T Rz Ry Rx S`.
pub fn standard_chain(scale: DVec3, degrees: DVec3, offset: DVec3) -> DMat4 {
    let rotation = rotation_z(degrees.z) * rotation_y(degrees.y) * rotation_x(degrees.x);
    affine4(rotation * DMat3::from_diagonal(scale), offset)
}

/// The matrix `[[L, τ], [0, 1]]`.
pub fn affine4(linear: DMat3, offset: DVec3) -> DMat4 {
    DMat4::from_cols(
        linear.x_axis.extend(0.0),
        linear.y_axis.extend(0.0),
        linear.z_axis.extend(0.0),
        offset.extend(1.0),
    )
}

/// The homogeneous coordinates of a point, w = 1.
pub fn homogeneous_point(p: DVec3) -> DVec4 {
    p.extend(1.0)
}

/// The homogeneous coordinates of a direction, w = 0.
pub fn homogeneous_direction(v: DVec3) -> DVec4 {
    v.extend(0.0)
}

/// The point of homogeneous coordinates, which are defined up to a factor; `None` when w = 0, a direction.
pub fn point_of_homogeneous(h: DVec4) -> Option<DVec3> {
    (h.w != 0.0).then(|| h.truncate() / h.w)
}

/// Scales the axes of the plane. The inverse has the reciprocals; a factor of zero has none.
pub fn scale2(factors: DVec2) -> DMat2 {
    DMat2::from_diagonal(factors)
}

/// `x' = x + xy·y`, `y' = y + yx·x`. If one of the two is zero, the inverse has the other negated.
pub fn shear2(xy: f64, yx: f64) -> DMat2 {
    DMat2::from_cols(DVec2::new(1.0, yx), DVec2::new(xy, 1.0))
}

/// Rotates the plane by an angle, x towards y; exact at multiples of 90°.
pub fn rotation2(degrees: f64) -> DMat2 {
    let (sin, cos) = sin_cos_degrees(degrees);
    DMat2::from_cols(DVec2::new(cos, sin), DVec2::new(-sin, cos))
}

/// Mirrors the plane about the y axis: `x' = -x`.
pub fn mirror2_about_y() -> DMat2 {
    DMat2::from_diagonal(DVec2::new(-1.0, 1.0))
}

/// Scales the axes. The inverse has the reciprocals; a factor of zero has none.
pub fn scale3(factors: DVec3) -> DMat3 {
    DMat3::from_diagonal(factors)
}

/// `x' = x + xy·y + xz·z`, `y' = y + yx·x + yz·z`, `z' = z + zx·x + zy·y`. It may be singular.
pub fn shear3(xy: f64, xz: f64, yx: f64, yz: f64, zx: f64, zy: f64) -> DMat3 {
    DMat3::from_cols(DVec3::new(1.0, yx, zx), DVec3::new(xy, 1.0, zy), DVec3::new(xz, yz, 1.0))
}

/// Rotates about x, y towards z; exact at multiples of 90°. The inverse is the transpose.
pub fn rotation_x(degrees: f64) -> DMat3 {
    let (sin, cos) = sin_cos_degrees(degrees);
    DMat3::from_cols(DVec3::X, DVec3::new(0.0, cos, sin), DVec3::new(0.0, -sin, cos))
}

/// Rotates about y, z towards x; exact at multiples of 90°.
pub fn rotation_y(degrees: f64) -> DMat3 {
    let (sin, cos) = sin_cos_degrees(degrees);
    DMat3::from_cols(DVec3::new(cos, 0.0, -sin), DVec3::Y, DVec3::new(sin, 0.0, cos))
}

/// Rotates about z, x towards y; exact at multiples of 90°.
pub fn rotation_z(degrees: f64) -> DMat3 {
    let (sin, cos) = sin_cos_degrees(degrees);
    DMat3::from_cols(DVec3::new(cos, sin, 0.0), DVec3::new(-sin, cos, 0.0), DVec3::Z)
}

/// Rotates about `axis`, of any non-zero length, x towards y when it is z (Rodrigues' formula). Exact at
/// multiples of 90° about the coordinate axes. `None` when the axis is zero or anything is not finite.
pub fn axis_angle(axis: DVec3, degrees: f64) -> Option<DMat3> {
    let a = unit(axis)?;
    if !degrees.is_finite() {
        return None;
    }
    let (sin, cos) = sin_cos_degrees(degrees);
    // 1 - cos θ without cancellation for small angles; at 90° the formula would have a rounding error.
    let half_sin = sin_cos_degrees(0.5 * degrees).0;
    let versine = if cos == 0.0 { 1.0 } else { 2.0 * half_sin * half_sin };
    let (x, y, z) = (a.x, a.y, a.z);
    let (xx, yy, zz) = (x * x, y * y, z * z);
    // On the diagonal, x² + cos θ (1 - x²) leaves 1 exactly 1 about a coordinate axis.
    Some(DMat3::from_cols(
        DVec3::new(xx + cos * (yy + zz), versine * x * y + sin * z, versine * x * z - sin * y),
        DVec3::new(versine * x * y - sin * z, yy + cos * (zz + xx), versine * y * z + sin * x),
        DVec3::new(versine * x * z + sin * y, versine * y * z - sin * x, zz + cos * (xx + yy)),
    ))
}

/// `v` rotated by `degrees` about `axis`, from its parts parallel and perpendicular to the axis. `None` as for
/// [`axis_angle`].
pub fn rotate_vector(axis: DVec3, degrees: f64, v: DVec3) -> Option<DVec3> {
    let a = unit(axis)?;
    let (sin, cos) = sin_cos_degrees(degrees);
    let along = a.dot(v) * a;
    let turned = along + cos * (v - along) + sin * a.cross(v);
    turned.is_finite().then_some(turned)
}

/// The matrix of normals `L⁻ᵀ` up to a positive factor, as the signed cofactors of `linear`: outward normals
/// stay outward, even under mirrors. The result is not normalised. For a singular matrix it is zero or a limit.
///
/// Only the 3×3 block matters: normals ignore translations.
pub fn normal_matrix(linear: &DMat3) -> DMat3 {
    let [a, b, c] = [linear.x_axis, linear.y_axis, linear.z_axis];
    let cofactors = DMat3::from_cols(cross(b, c), cross(c, a), cross(a, b));
    // cof(L) = det(L) L⁻ᵀ has the sign of the determinant.
    if dot(a, cofactors.x_axis) < 0.0 { -cofactors } else { cofactors }
}

/// The image of the normal `n` of a surface under `linear`, with length 1; `None` when it has no direction.
///
/// Columns and normals of any length do: products neither overflow nor vanish.
pub fn transform_normal(linear: &DMat3, n: DVec3) -> Option<DVec3> {
    // cof(L S) = cof(L) cof(S) for the diagonal matrix S that gives each column a length near 1.
    let (columns, factors) = {
        let scaled = [linear.x_axis, linear.y_axis, linear.z_axis].map(scaled_to_one);
        (scaled.map(|(column, _)| column), DVec3::from_array(scaled.map(|(_, factor)| factor)))
    };
    let cofactors = normal_matrix(&DMat3::from_cols(columns[0], columns[1], columns[2]));
    let back = scaled_to_one(n).0 * (factors / factors.max_element());
    unit(cofactors * scaled_to_one(back).0)
}

/// The `x` with `m x = b`, by Cramer's rule: each component is the determinant of `m` with that column replaced
/// by `b`, over that of `m`. `None` for a singular matrix, and where a quotient is not finite.
///
/// The determinants are exact (see [`exact`]), so that each component is within 1.5 units in its last place.
pub fn solve(m: &DMat3, b: DVec3) -> Option<DVec3> {
    let rows = std::array::from_fn(|i| std::array::from_fn(|j| m.col(j)[i]));
    match exact::solve(&rows, &b.to_array()) {
        Solutions::One(x) => Some(DVec3::from_array(x)),
        Solutions::None | Solutions::Many | Solutions::NotFinite => None,
    }
}

/// The mirror z to -z: turns right-handed coordinates into left-handed ones and back.
///
/// Points and directions become `Σ p`, normals `Σ n`, maps `Σ M Σ` (see [`change_handedness`]): rotations about
/// x and y reverse, those about z do not. Triangles must swap two vertices to keep their front.
pub fn mirror_z() -> DMat3 {
    DMat3::from_diagonal(DVec3::new(1.0, 1.0, -1.0))
}

/// The map `m` expressed in mirrored coordinates (z to -z): `Σ M Σ`.
pub fn change_handedness(m: DMat4) -> DMat4 {
    let sigma = DMat4::from_mat3(mirror_z());
    sigma * m * sigma
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quarter_turns_are_exact() {
        assert_eq!(rotation_x(90.0) * DVec3::Y, DVec3::Z);
        assert_eq!(rotation_y(90.0) * DVec3::Z, DVec3::X);
        assert_eq!(rotation_z(90.0) * DVec3::X, DVec3::Y);
        assert_eq!(rotation2(-270.0) * DVec2::X, DVec2::Y);
        for k in -9..9 {
            let degrees = 90.0 * f64::from(k);
            assert_eq!(axis_angle(DVec3::X * 3.0, degrees).unwrap(), rotation_x(degrees));
            assert_eq!(axis_angle(DVec3::Y * 0.1, degrees).unwrap(), rotation_y(degrees));
            assert_eq!(axis_angle(DVec3::Z * 1e200, degrees).unwrap(), rotation_z(degrees));
        }
    }

    #[test]
    fn elementary_inverses_are_inverses() {
        let close = |m: DMat2| (m - DMat2::IDENTITY).to_cols_array().iter().all(|e| e.abs() < 1e-15);
        assert!(close(shear2(2.5, 0.0) * shear2(-2.5, 0.0)));
        assert!(close(scale2(DVec2::new(4.0, -0.5)) * scale2(DVec2::new(0.25, -2.0))));
        assert!(close(rotation2(37.0) * rotation2(-37.0)));
        assert!(close(mirror2_about_y() * mirror2_about_y()));
        assert_eq!(mirror2_about_y() * DVec2::new(3.0, 4.0), DVec2::new(-3.0, 4.0));
        // In the plane turns commute, in space they do not.
        let (a, b) = (rotation2(20.0) * rotation2(50.0), rotation2(50.0) * rotation2(20.0));
        assert!((a - b).to_cols_array().iter().all(|e| e.abs() < 1e-16));
        assert_ne!(rotation_x(90.0) * rotation_y(90.0), rotation_y(90.0) * rotation_x(90.0));
        assert_eq!(
            shear3(2.0, 3.0, 0.0, 0.0, 0.0, 5.0) * DVec3::new(1.0, 10.0, 100.0),
            DVec3::new(321.0, 10.0, 150.0)
        );
        assert_eq!(
            scale3(DVec3::new(2.0, 3.0, 4.0)) * DVec3::new(1.0, 10.0, 100.0),
            DVec3::new(2.0, 30.0, 400.0)
        );
    }

    #[test]
    fn rotations_keep_their_axis_and_turn_at_unit_speed() {
        let axis = DVec3::new(2.0, -1.0, 0.5);
        for degrees in [1e-9, 0.3, 41.0, 163.0, 359.0, -725.5] {
            let r = axis_angle(axis, degrees).unwrap();
            assert!((r * axis - axis).length() < 1e-15);
            assert!((r.determinant() - 1.0).abs() < 1e-14);
            let product = r * r.transpose() - DMat3::IDENTITY;
            assert!(product.to_cols_array().iter().all(|e| e.abs() < 1e-15));
            let v = DVec3::new(0.3, 4.0, -7.0);
            assert!((rotate_vector(axis, degrees, v).unwrap() - r * v).length() < 1e-14);
            // dR/dθ = [a]× R.
            let h = 1e-4;
            let slope = (axis_angle(axis, degrees + h).unwrap() * v
                - axis_angle(axis, degrees - h).unwrap() * v)
                / (2.0 * h.to_radians());
            assert!((slope - axis.normalize().cross(r * v)).length() < 1e-8);
        }
        assert!(axis_angle(DVec3::ZERO, 30.0).is_none());
        assert!(axis_angle(axis, f64::NAN).is_none());
        assert!(rotate_vector(axis, f64::INFINITY, DVec3::X).is_none());
    }

    #[test]
    fn rows_are_the_transpose_of_columns() {
        let (s, a, t) =
            (DVec3::new(2.0, 0.5, 3.0), DVec3::new(10.0, -20.0, 70.0), DVec3::new(5.0, 6.0, -7.0));
        let m = standard_chain(s, a, t);
        let p = DVec4::new(1.0, -2.0, 3.0, 1.0);
        // p as a row: each entry of p·M is the product with a column of M.
        let rows = to_row_convention(m);
        let as_row =
            DVec4::new(p.dot(rows.x_axis), p.dot(rows.y_axis), p.dot(rows.z_axis), p.dot(rows.w_axis));
        assert!((m * p - as_row).length() < 1e-14);
        assert_eq!(from_row_convention(rows), m);
        assert_eq!(rows.row(3).truncate(), t);
        assert_eq!(rows4(to_rows4(&m)), m);
        assert_eq!(to_rows4(&m)[3], 5.0);
        let l = rotation_x(25.0);
        assert_eq!(rows3(to_rows3(&l)), l);
        let a = [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]];
        let b = [[1.0], [0.5], [-2.0]];
        assert_eq!(transpose(&product(&a, &b)), product(&transpose(&b), &transpose(&a)));
        assert_eq!(transpose(&a)[2], [3.0, 6.0]);
    }

    #[test]
    fn translations_move_points_and_leave_directions() {
        let m = affine4(DMat3::IDENTITY, DVec3::new(5.0, -6.0, 7.0));
        let v = DVec3::new(1.0, 2.0, 3.0);
        assert_eq!(m * homogeneous_direction(v), homogeneous_direction(v));
        let moved = m * homogeneous_point(v);
        assert_eq!(point_of_homogeneous(moved), Some(DVec3::new(6.0, -4.0, 10.0)));
        assert_eq!(point_of_homogeneous(moved * -2.5), Some(DVec3::new(6.0, -4.0, 10.0)));
        assert_eq!(point_of_homogeneous(homogeneous_direction(v)), None);
    }

    #[test]
    fn normals_stay_perpendicular_and_outward() {
        let maps = [
            shear3(0.5, -2.0, 0.0, 3.0, 0.0, 0.0) * scale3(DVec3::new(1.0, 2.0, 5.0)),
            scale3(DVec3::new(-1.0, 2.0, 0.25)) * rotation_y(33.0),
            scale3(DVec3::splat(-3.0)),
        ];
        for map in maps {
            let (n, d) = (DVec3::new(0.6, -2.0, 0.3), DVec3::new(1.0, -1.0, 2.0));
            let tangent = crate::vector::perpendicular(n);
            let moved = transform_normal(&map, n).unwrap();
            assert!((moved.length() - 1.0).abs() < 1e-15);
            assert!(moved.dot(map * tangent).abs() < 1e-14 * (map * tangent).length());
            assert_eq!(moved.dot(map * d) > 0.0, n.dot(d) > 0.0);
        }
        assert!(transform_normal(&DMat3::ZERO, DVec3::Y).is_none());
    }

    #[test]
    fn cramers_rule_solves_what_has_a_solution() {
        let m = rows3([2.0, -1.0, 0.5, 0.0, 3.0, 7.0, -4.0, 1.0, 1.5]);
        let x = DVec3::new(3.0, -0.25, 8.0);
        assert!((solve(&m, m * x).unwrap() - x).length() < 1e-14);
        // Nearly singular: the determinant is 2⁻⁴⁰.
        let tiny = f64::powi(2.0, -40);
        let m = rows3([1.0, 1.0, 0.0, 1.0, 1.0 + tiny, 0.0, 0.0, 0.0, 3.0]);
        assert_eq!(solve(&m, DVec3::new(2.0, 2.0 + tiny, 6.0)), Some(DVec3::new(1.0, 1.0, 2.0)));
        assert_eq!(solve(&rows3([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]), x), None);
    }

    #[test]
    fn in_a_mirror_rotations_about_x_and_y_turn_the_other_way() {
        let check = |m: DMat3, expected: DMat3| {
            let mirrored = change_handedness(affine4(m, DVec3::new(1.0, 2.0, 3.0)));
            assert_eq!(mirrored, affine4(expected, DVec3::new(1.0, 2.0, -3.0)));
        };
        check(rotation_x(40.0), rotation_x(-40.0));
        check(rotation_y(40.0), rotation_y(-40.0));
        check(rotation_z(40.0), rotation_z(40.0));
    }
}
