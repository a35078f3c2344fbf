//! Invertible affine maps that carry their inverse.

use std::f64::consts::FRAC_1_SQRT_2;
use std::ops::Mul;

use crate::Elementary;
use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3};

use crate::frame::Frame;
use crate::matrix;
use crate::quaternion;
use crate::rounding::gamma;
use crate::vector::{cross, dot, mixed_product};
use crate::view::{Handedness, View};

/// An invertible affine map from one space to another with its inverse; name it like `world_from_object`.
///
/// Products read right to left: `world_from_object * object_from_part`. The elementary constructors know their
/// inverse exactly, and a product multiplies the inverses in reverse order, so a chain of elementary maps never
/// inverts a matrix numerically.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transform {
    // `inverse` is the inverse of `forward`, up to rounding.
    forward: DAffine3,
    inverse: DAffine3,
}

/// The matrix has no usable inverse: its determinant is zero up to rounding, an entry is not finite, or it is
/// not affine (its last row is not 0 0 0 1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SingularTransformError;

impl std::fmt::Display for SingularTransformError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("the transform is not an invertible affine map")
    }
}

impl std::error::Error for SingularTransformError {}

impl Default for Transform {
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl Transform {
    /// The identity.
    pub const IDENTITY: Self = Self { forward: DAffine3::IDENTITY, inverse: DAffine3::IDENTITY };

    /// A general affine map; the columns are the images of the axes.
    ///
    /// # Errors
    /// [`SingularTransformError`] when |det L| ≤ 16 u Π|row of L|, when an entry is not finite, or when the last row
    /// is not a non-zero multiple of 0 0 0 1 (such a multiple is divided out: homogeneous points are equal up
    /// to a factor).
    pub fn from_matrix(matrix: DMat4) -> Result<Self, SingularTransformError> {
        let last = matrix.row(3);
        if !matrix.is_finite() || last.truncate() != DVec3::ZERO || last.w == 0.0 {
            return Err(SingularTransformError);
        }
        let matrix = if last.w == 1.0 {
            matrix
        } else {
            DMat4::from_cols_array(&matrix.to_cols_array().map(|entry| entry / last.w))
        };
        Self::from_affine(DAffine3::from_mat4(matrix))
    }

    /// A general affine map.
    ///
    /// # Errors
    /// [`SingularTransformError`] as for [`Transform::from_matrix`].
    pub fn from_affine(forward: DAffine3) -> Result<Self, SingularTransformError> {
        let linear = inverse_linear(&forward.matrix3).ok_or(SingularTransformError)?;
        let inverse = DAffine3 { matrix3: linear, translation: -(linear * forward.translation) };
        let finite = forward.is_finite() && inverse.is_finite();
        if finite { Ok(Self { forward, inverse }) } else { Err(SingularTransformError) }
    }

    /// A map with its known inverse.
    pub(crate) fn from_parts(forward: DAffine3, inverse: DAffine3) -> Self {
        Self { forward, inverse }
    }

    /// The map that takes the coordinate axes to the axes of `frame`, and the origin to `origin`: local to
    /// world coordinates.
    pub fn from_frame(origin: DVec3, frame: &Frame) -> Self {
        let linear = frame.matrix();
        Self {
            forward: DAffine3 { matrix3: linear, translation: origin },
            inverse: DAffine3 { matrix3: linear.transpose(), translation: -frame.to_local(origin) },
        }
    }

    /// Scales first, then rotates, then translates, as glTF nodes do. The quaternion need not be unit.
    ///
    /// # Errors
    /// [`SingularTransformError`] when a factor or the quaternion is zero, or anything is not finite.
    pub fn from_scale_rotation_translation(
        factors: DVec3,
        rotation: DQuat,
        offset: DVec3,
    ) -> Result<Self, SingularTransformError> {
        let turn = quaternion::to_matrix(rotation);
        if !turn.is_finite() || !offset.is_finite() {
            return Err(SingularTransformError);
        }
        let turn =
            Self { forward: DAffine3::from_mat3(turn), inverse: DAffine3::from_mat3(turn.transpose()) };
        Ok(Self::translate(offset) * turn * Self::scale(factors)?)
    }

    /// The map from world to the coordinates of a camera at `eye` that looks at `target` along -z, x to the right and y
    /// upwards: gluLookAt.
    ///
    /// # Errors
    /// [`SingularTransformError`] when the eye is at the target, or `up` is parallel to the view.
    pub fn look_at_right(eye: DVec3, target: DVec3, up: DVec3) -> Result<Self, SingularTransformError> {
        let view = View::look_at(eye, target, up, Handedness::Right);
        view.map(|view| view.camera_from_world()).ok_or(SingularTransformError)
    }

    /// The map from world to the coordinates of a camera at `eye` that looks at `target` along +z, x to the right and y
    /// upwards in a left-handed world: the LookAt of pbrt and RenderMan.
    ///
    /// # Errors
    /// [`SingularTransformError`] when the eye is at the target, or `up` is parallel to the view.
    pub fn look_at_left(eye: DVec3, target: DVec3, up: DVec3) -> Result<Self, SingularTransformError> {
        let view = View::look_at(eye, target, up, Handedness::Left);
        view.map(|view| view.camera_from_world()).ok_or(SingularTransformError)
    }

    /// Translates points by `offset`; directions are unchanged.
    pub fn translate(offset: DVec3) -> Self {
        Self { forward: DAffine3::from_translation(offset), inverse: DAffine3::from_translation(-offset) }
    }

    /// Scales each axis by its factor; a negative factor mirrors.
    ///
    /// # Errors
    /// [`SingularTransformError`] when a factor is zero or not finite, or its reciprocal overflows.
    pub fn scale(factors: DVec3) -> Result<Self, SingularTransformError> {
        let inverse = factors.recip();
        if factors.is_finite() && inverse.is_finite() {
            Ok(Self { forward: DAffine3::from_scale(factors), inverse: DAffine3::from_scale(inverse) })
        } else {
            Err(SingularTransformError)
        }
    }

    /// The shear `x' = x + xy·y + xz·z`, `y' = y + yx·x + yz·z`, `z' = z + zx·x + zy·y`.
    ///
    /// # Errors
    /// [`SingularTransformError`] when the six factors make a singular matrix.
    pub fn shear(
        xy: f64,
        xz: f64,
        yx: f64,
        yz: f64,
        zx: f64,
        zy: f64,
    ) -> Result<Self, SingularTransformError> {
        Self::from_affine(DAffine3::from_mat3(matrix::shear3(xy, xz, yx, yz, zx, zy)))
    }

    /// A rotation by `degrees` about `axis` (of any non-zero length), x towards y about z.
    ///
    /// Multiples of 90° give exact zeros and ones about the coordinate axes.
    ///
    /// # Errors
    /// [`SingularTransformError`] when the axis is zero or anything is not finite.
    pub fn rotate(axis: DVec3, degrees: f64) -> Result<Self, SingularTransformError> {
        let linear = matrix::axis_angle(axis, degrees).ok_or(SingularTransformError)?;
        Ok(Self { forward: DAffine3::from_mat3(linear), inverse: DAffine3::from_mat3(linear.transpose()) })
    }

    /// The map as glam's affine type.
    pub fn affine(&self) -> &DAffine3 {
        &self.forward
    }

    /// The inverse as glam's affine type.
    pub fn inverse_affine(&self) -> &DAffine3 {
        &self.inverse
    }

    /// The linear part `L`.
    pub fn linear(&self) -> DMat3 {
        self.forward.matrix3
    }

    /// The inverse map.
    #[must_use]
    pub fn inverse(&self) -> Self {
        Self { forward: self.inverse, inverse: self.forward }
    }

    /// The image of a point (w = 1).
    pub fn point(&self, p: DVec3) -> DVec3 {
        self.forward.transform_point3(p)
    }

    /// The image of a direction (w = 0); its length may change.
    pub fn vector(&self, v: DVec3) -> DVec3 {
        self.forward.transform_vector3(v)
    }

    /// The image of a normal, `L⁻ᵀ n`, not normalised. Outward normals stay outward even under a mirror.
    pub fn normal(&self, n: DVec3) -> DVec3 {
        self.inverse.matrix3.transpose() * n
    }

    /// A bound, axis by axis, on the error of [`Transform::point`] of `p`, when `p` itself has an error of up
    /// to `error` on each axis.
    pub fn point_error(&self, p: DVec3, error: DVec3) -> DVec3 {
        error_bound(&self.forward, p, error)
    }

    /// A bound, axis by axis, on the error of [`Transform::inverse_point`] of `p`, when `p` itself has an error
    /// of up to `error` on each axis; the inverse is taken as exact.
    pub fn inverse_point_error(&self, p: DVec3, error: DVec3) -> DVec3 {
        error_bound(&self.inverse, p, error)
    }

    /// The factor by which the map stretches an area element with the unit normal `n`: `|det L| |L⁻ᵀ n|`.
    pub fn area_factor(&self, n: DVec3) -> f64 {
        self.determinant().abs() * self.normal(n).length()
    }

    /// The same map in coordinates mirrored by z to -z, as between right-handed and left-handed axes.
    #[must_use]
    pub fn change_handedness(&self) -> Self {
        let mirror = |map: &DAffine3| DAffine3::from_mat4(matrix::change_handedness(DMat4::from(*map)));
        Self { forward: mirror(&self.forward), inverse: mirror(&self.inverse) }
    }

    /// The point whose image is `p`.
    #[inline]
    pub fn inverse_point(&self, p: DVec3) -> DVec3 {
        self.inverse.transform_point3(p)
    }

    /// The direction whose image is `v`.
    #[inline]
    pub fn inverse_vector(&self, v: DVec3) -> DVec3 {
        self.inverse.transform_vector3(v)
    }

    /// The normal whose image is `n`, up to length.
    pub fn inverse_normal(&self, n: DVec3) -> DVec3 {
        self.forward.matrix3.transpose() * n
    }

    /// The determinant of the linear part: the factor of volumes, negative for a mirror.
    pub fn determinant(&self) -> f64 {
        let linear = &self.forward.matrix3;
        mixed_product(linear.x_axis, linear.y_axis, linear.z_axis)
    }

    /// Whether the map changes handedness.
    pub fn is_mirror(&self) -> bool {
        // Scaled, so that the sign is right where the determinant itself underflows.
        let (rows, _) = scaled_rows(&self.forward.matrix3);
        mixed_product(rows[0], rows[1], rows[2]) < 0.0
    }

    /// Whether the map is the identity.
    pub fn is_identity(&self) -> bool {
        self.forward == DAffine3::IDENTITY
    }
}

/// The three rows of its matrix that say something, each with its translation last: `[[1, 0, 0, 3], [0, 1, 0, 5], [0,
/// 0, 1, 7]]`. A precision applies to every number.
impl std::fmt::Display for Transform {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let DAffine3 { matrix3, translation } = self.forward;
        for row in 0..3 {
            f.write_str(if row == 0 { "[[" } else { "], [" })?;
            for number in matrix3.row(row).to_array() {
                std::fmt::Display::fmt(&number, f)?;
                f.write_str(", ")?;
            }
            std::fmt::Display::fmt(&translation[row], f)?;
        }
        f.write_str("]]")
    }
}

impl Mul for Transform {
    type Output = Self;

    /// First `inner`, then `self`.
    fn mul(self, inner: Self) -> Self {
        Self { forward: self.forward * inner.forward, inverse: inner.inverse * self.inverse }
    }
}

/// The rows of a matrix, each scaled by a power of two so that its largest entry is near 1, and these powers.
fn scaled_rows(linear: &DMat3) -> ([DVec3; 3], DVec3) {
    let power = |row: DVec3| {
        // The exponent; slightly off for subnormal numbers, which is harmless.
        let exponent = (row.abs().max_element().to_bits() >> 52) as i64 - 1023;
        f64::from_bits(((1023 - exponent.clamp(-1000, 1000)) as u64) << 52)
    };
    let rows = [linear.row(0), linear.row(1), linear.row(2)];
    let powers = DVec3::from_array(rows.map(power));
    ([rows[0] * powers.x, rows[1] * powers.y, rows[2] * powers.z], powers)
}

/// The inverse by cofactors, each accurate to a few ulps; `None` when |det L| ≤ 16 u Π|row of L|.
pub(crate) fn inverse_linear(linear: &DMat3) -> Option<DMat3> {
    if !linear.is_finite() {
        return None;
    }
    let ([a, b, c], powers) = scaled_rows(linear);
    let cofactors = [cross(b, c), cross(c, a), cross(a, b)];
    let determinant = dot(a, cofactors[0]);
    let volume = a.length() * b.length() * c.length();
    if determinant.is_nan() || determinant.abs() <= 8.0 * f64::EPSILON * volume {
        return None;
    }
    let column = |i: usize| cofactors[i] / determinant * powers[i];
    Some(DMat3::from_cols(column(0), column(1), column(2)))
}

/// Each coordinate of an image is a sum of three products and a fourth term: four roundings at most.
fn error_bound(map: &DAffine3, p: DVec3, error: DVec3) -> DVec3 {
    let linear = map.matrix3.abs();
    let bound = (1.0 + gamma(4)) * (linear * error) + gamma(4) * (linear * p.abs() + map.translation.abs());
    // The bound is rounded as well.
    bound * (1.0 + gamma(8))
}

/// The sine and cosine of an angle in degrees, exact at every multiple of 90 and best possible at those of 30
/// and 45.
pub fn sin_cos_degrees(degrees: f64) -> (f64, f64) {
    let reduced = degrees % 360.0;
    let quarter = (reduced / 90.0).rounded();
    let rest = reduced - 90.0 * quarter;
    let (sin, cos) = if rest.abs() == 45.0 {
        // Equal, so that the tangent is 1.
        (FRAC_1_SQRT_2.copysign(rest), FRAC_1_SQRT_2)
    } else if rest.abs() == 30.0 {
        (0.5_f64.copysign(rest), 0.75_f64.sqrt())
    } else {
        rest.to_radians().sine_cosine()
    };
    match quarter as i64 {
        0 | 4 | -4 => (sin, cos),
        1 | -3 => (cos, -sin),
        2 | -2 => (-sin, -cos),
        _ => (-cos, sin),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::RandomStream;

    /// The least well conditioned of the samples loses three digits there and back.
    const TOLERANCE: f64 = 2e-13;

    fn close(a: DVec3, b: DVec3, tolerance: f64) {
        assert!((a - b).length() <= tolerance * (1.0 + b.length()), "{a} {b}");
    }

    fn samples() -> Vec<Transform> {
        let turn = Transform::rotate(DVec3::new(1.0, -2.0, 0.5), 73.0).unwrap();
        let stretch = Transform::scale(DVec3::new(2.0, -0.25, 7.0)).unwrap();
        let slant = Transform::shear(0.5, 0.0, -1.5, 2.0, 0.0, 0.75).unwrap();
        let shift = Transform::translate(DVec3::new(5.0, -6.0, 0.125));
        let look = Transform::look_at_left(DVec3::new(1.0, 2.0, 3.0), DVec3::new(4.0, -5.0, 6.0), DVec3::Y);
        vec![turn, stretch, slant, shift, look.unwrap(), shift * turn * slant * stretch, stretch * shift]
    }

    #[test]
    fn it_is_shown_by_rows_with_the_translation_last() {
        let map = Transform::translate(DVec3::new(3.0, 5.5, -7.0))
            * Transform::scale(DVec3::new(2.0, 3.0, 4.0)).unwrap();
        assert_eq!(map.to_string(), "[[2, 0, 0, 3], [0, 3, 0, 5.5], [0, 0, 4, -7]]");
        assert_eq!(
            format!("{map:.1}"),
            "[[2.0, 0.0, 0.0, 3.0], [0.0, 3.0, 0.0, 5.5], [0.0, 0.0, 4.0, -7.0]]"
        );
    }

    #[test]
    fn points_vectors_and_normals_go_there_and_back() {
        let (p, q) = (DVec3::new(3.0, -1.0, 2.5), DVec3::new(0.5, 4.0, -2.0));
        let maps = samples();
        for map in &maps {
            close(map.inverse_point(map.point(p)), p, TOLERANCE);
            close(map.inverse().point(map.point(p)), p, TOLERANCE);
            close(map.inverse_vector(map.vector(q)), q, TOLERANCE);
            close(map.inverse_normal(map.normal(q)), q, TOLERANCE);
            close(map.point(p + q) - map.point(p), map.vector(q), TOLERANCE);
            // A normal is what keeps its product with every vector.
            assert!((map.normal(p).dot(map.vector(q)) - p.dot(q)).abs() < TOLERANCE * 20.0);
            close(map.linear() * q, map.vector(q), 0.0);
            assert_eq!(map.inverse().inverse(), *map);
            let general = Transform::from_affine(*map.affine()).unwrap();
            close(general.inverse_point(p), map.inverse_point(p), TOLERANCE);
            assert_eq!(Transform::from_matrix(DMat4::from(*map.affine())).unwrap(), general);
        }
        assert_eq!(maps.len(), 7);
    }

    #[test]
    fn the_right_factor_acts_first() {
        let turn = Transform::rotate(DVec3::Z, 90.0).unwrap();
        let shift = Transform::translate(DVec3::new(5.0, 0.0, 2.0));
        let p = DVec3::new(1.0, 2.0, 3.0);
        assert_eq!((shift * turn).point(p), DVec3::new(3.0, 1.0, 5.0));
        assert_eq!((turn * shift).point(p), DVec3::new(-2.0, 6.0, 5.0));
        assert_eq!((shift * turn).inverse_point(DVec3::new(3.0, 1.0, 5.0)), p);
    }

    #[test]
    fn right_angles_are_exact() {
        let expected = [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0)];
        for k in -40_i32..=40 {
            assert_eq!(sin_cos_degrees(90.0 * f64::from(k)), expected[k.rem_euclid(4) as usize]);
        }
        assert_eq!(sin_cos_degrees(30.0).0, 0.5);
        assert_eq!(sin_cos_degrees(-210.0).0, 0.5);
        assert_eq!(sin_cos_degrees(300.0).1, 0.5);
        let (sin, cos) = sin_cos_degrees(-135.0);
        assert_eq!((sin, cos), (-FRAC_1_SQRT_2, -FRAC_1_SQRT_2));
        for tenth in -7_200..7_200 {
            let degrees = f64::from(tenth) / 10.0;
            let (sin, cos) = sin_cos_degrees(degrees);
            let (s, c) = degrees.to_radians().sin_cos();
            assert!((sin - s).abs() < 3e-15 && (cos - c).abs() < 3e-15, "{degrees}");
        }
        assert!(sin_cos_degrees(f64::NAN).0.is_nan() && sin_cos_degrees(f64::INFINITY).1.is_nan());
    }

    #[test]
    fn mirrors_are_known_as_such_and_keep_normals_outward() {
        let mirror = Transform::scale(DVec3::new(2.0, 3.0, -4.0)).unwrap();
        let turn = Transform::rotate(DVec3::ONE, 50.0).unwrap();
        assert!(mirror.is_mirror() && (turn * mirror).is_mirror() && !(mirror * turn * mirror).is_mirror());
        assert!((mirror.determinant() + 24.0).abs() < 1e-13);
        let (n, d) = (DVec3::new(0.5, -1.0, 2.0), DVec3::new(1.0, 1.0, 1.0));
        assert!((mirror.normal(n).dot(mirror.vector(d)) - n.dot(d)).abs() < 1e-14);
        // The determinant underflows, its sign does not.
        assert!(Transform::scale(DVec3::splat(-1e-150)).unwrap().is_mirror());
    }

    #[test]
    fn what_cannot_be_undone_is_refused() {
        let singular = |rows: [f64; 9]| {
            assert!(Transform::from_affine(DAffine3::from_mat3(matrix::rows3(rows))).is_err(), "{rows:?}");
        };
        singular([0.0; 9]);
        singular([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]);
        singular([1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]);
        singular([1.0, 0.0, 0.0, 0.0, f64::NAN, 0.0, 0.0, 0.0, 1.0]);
        singular([1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, f64::INFINITY]);
        assert!(Transform::scale(DVec3::new(1.0, 0.0, 2.0)).is_err());
        assert!(Transform::scale(DVec3::new(1.0, 1e-320, 2.0)).is_err());
        assert!(Transform::shear(1.0, 0.0, 1.0, 0.0, 0.0, 0.0).is_err());
        assert!(Transform::rotate(DVec3::ZERO, 10.0).is_err());
        assert!(Transform::rotate(DVec3::X, f64::NAN).is_err());
        let p = DVec3::new(1.0, 2.0, 3.0);
        assert!(Transform::look_at_left(p, p, DVec3::Y).is_err());
        assert!(Transform::look_at_right(p, p + DVec3::Z, DVec3::Z).is_err());
        let mut perspective = DMat4::IDENTITY;
        perspective.z_axis.w = -1.0;
        assert!(Transform::from_matrix(perspective).is_err());
        let zero = DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0);
        assert!(Transform::from_scale_rotation_translation(p, zero, p).is_err());
        assert!(Transform::from_scale_rotation_translation(p, DQuat::IDENTITY, DVec3::NAN).is_err());
    }

    #[test]
    fn very_small_and_very_large_maps_are_not_singular() {
        for size in [1e-120, 1e-30, 1e30, 1e120] {
            let linear = matrix::rotation_x(20.0) * DMat3::from_diagonal(DVec3::new(size, 2.0 * size, -size));
            let map = Transform::from_affine(DAffine3::from_mat3(linear)).unwrap();
            let p = DVec3::new(1.0, 2.0, 3.0);
            close(map.inverse_point(map.point(p)), p, 1e-14);
            assert!(map.is_mirror());
        }
        let uneven = Transform::from_affine(DAffine3::from_scale(DVec3::new(1e-100, 3.0, 1e100))).unwrap();
        close(uneven.inverse_point(DVec3::new(1e-100, 6.0, 3e100)), DVec3::new(1.0, 2.0, 3.0), 1e-15);
    }

    #[test]
    fn a_nearly_singular_inverse_keeps_its_digits() {
        // Exact in binary; by hand, the determinant is 2⁻³⁰ and the inverse has whole numbers times 2³⁰.
        let tiny = f64::powi(2.0, -30);
        let m = matrix::rows3([1.0, 1.0, 0.0, 1.0, 1.0 + tiny, 0.0, 0.0, 0.0, 1.0]);
        let map = Transform::from_affine(DAffine3::from_mat3(m)).unwrap();
        let expected =
            matrix::rows3([1.0 + 1.0 / tiny, -1.0 / tiny, 0.0, -1.0 / tiny, 1.0 / tiny, 0.0, 0.0, 0.0, 1.0]);
        assert_eq!(map.inverse_affine().matrix3, expected);
    }

    #[test]
    fn a_common_factor_of_a_homogeneous_matrix_is_divided_out() {
        let m = DMat4::from(*samples()[5].affine());
        let map = Transform::from_matrix(m * -3.0).unwrap();
        let p = DVec3::new(1.0, 2.0, 3.0);
        close(map.point(p), samples()[5].point(p), 1e-15);
    }

    #[test]
    fn the_parts_of_a_gltf_node_act_in_order() {
        let turn = quaternion::from_axis_angle(DVec3::Y, 90.0).unwrap();
        let (factors, offset) = (DVec3::new(2.0, 3.0, 4.0), DVec3::new(10.0, 20.0, 30.0));
        let map = Transform::from_scale_rotation_translation(factors, turn * 2.5, offset).unwrap();
        close(map.point(DVec3::new(1.0, 1.0, 1.0)), DVec3::new(14.0, 23.0, 28.0), 1e-15);
        close(map.inverse_point(DVec3::new(14.0, 23.0, 28.0)), DVec3::ONE, 1e-15);
    }

    #[test]
    fn areas_grow_by_the_area_factor() {
        for map in samples() {
            let (a, b) = (DVec3::new(1.0, 2.0, -0.5), DVec3::new(0.25, -1.0, 3.0));
            let before = a.cross(b);
            let after = map.vector(a).cross(map.vector(b)).length();
            assert!((after / before.length() - map.area_factor(before.normalize())).abs() < 1e-13);
        }
    }

    #[test]
    fn the_error_bound_holds_and_is_not_far_off() {
        let mut random = RandomStream::new(40);
        let mut largest = 0.0_f64;
        for map in samples() {
            for _ in 0..500 {
                let p = DVec3::from_array(std::array::from_fn(|_| 200.0 * random.next_f64() - 100.0));
                let found = map.point(p);
                let bound = map.point_error(p, DVec3::ZERO);
                for i in 0..3 {
                    // The truth with twice the digits, less what was found.
                    let row = map.linear().row(i);
                    let (head, tail) = (dot(row, p), map.affine().translation[i]);
                    let error = ((head - found[i]) + tail).abs();
                    assert!(error <= bound[i] + 2e-16 * head.abs(), "{error} {}", bound[i]);
                    largest = largest.max(error / bound[i]);
                }
                let off = DVec3::splat(1e-3);
                let moved = (map.point(p + off) - found).abs();
                assert!(moved.cmple(map.point_error(p, off) * 1.000_001).all());
                let back = map.inverse_point_error(found, DVec3::ZERO);
                assert!(back.max_element() > 0.0 || found == DVec3::ZERO);
            }
        }
        assert!(largest > 0.05, "{largest}");
    }

    #[test]
    fn changing_hands_twice_changes_nothing() {
        for map in samples() {
            let changed = map.change_handedness();
            assert_eq!(changed.change_handedness(), map);
            let p = DVec3::new(1.0, 2.0, 3.0);
            let mirrored = |p: DVec3| DVec3::new(p.x, p.y, -p.z);
            close(changed.point(mirrored(p)), mirrored(map.point(p)), 1e-15);
            close(changed.inverse_point(changed.point(p)), p, TOLERANCE);
            assert_eq!(changed.is_mirror(), map.is_mirror());
        }
    }

    #[test]
    fn the_identity_is_the_default_and_changes_nothing() {
        let p = DVec3::new(1.0, 2.0, 3.0);
        assert_eq!(Transform::default().point(p), p);
        assert!(Transform::default().is_identity() && !samples()[0].is_identity());
    }
}
