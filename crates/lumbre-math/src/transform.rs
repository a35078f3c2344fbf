//! Invertible affine maps that carry their inverse.

use std::ops::Mul;

use glam::{DAffine3, DMat3, DMat4, DVec3};

/// An invertible affine map from one space to another, named by the caller as `world_from_object`, with its inverse.
///
/// Products read right to left: `world_from_object * object_from_part`. The elementary constructors know their inverse
/// exactly, and a product multiplies the inverses in reverse order, so that a chain of elementary maps never inverts a
/// matrix numerically.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transform {
    // `inverse` is the inverse of `forward`, up to rounding.
    forward: DAffine3,
    inverse: DAffine3,
}

/// The matrix has no usable inverse: its determinant is zero up to rounding, or an entry is not finite, or it is not
/// affine (its last row is not 0 0 0 1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SingularTransform;

impl std::fmt::Display for SingularTransform {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("the transform is not an invertible affine map")
    }
}

impl std::error::Error for SingularTransform {}

impl Default for Transform {
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl Transform {
    /// The map that changes nothing.
    pub const IDENTITY: Self = Self { forward: DAffine3::IDENTITY, inverse: DAffine3::IDENTITY };

    /// A general affine map, given with columns as images of the axes.
    ///
    /// # Errors
    /// [`SingularTransform`] when |det L| ≤ 16 u Π|row of L|, when an entry is not finite, or when the last row is not
    /// a non-zero multiple of 0 0 0 1 (such a multiple is divided out: homogeneous points are the same up to a factor).
    pub fn from_matrix(matrix: DMat4) -> Result<Self, SingularTransform> {
        let last = matrix.row(3);
        if !matrix.is_finite() || last.truncate() != DVec3::ZERO || last.w == 0.0 {
            return Err(SingularTransform);
        }
        let matrix = if last.w == 1.0 { matrix } else { matrix * (1.0 / last.w) };
        Self::from_affine(DAffine3::from_mat4(matrix))
    }

    /// A general affine map.
    ///
    /// # Errors
    /// [`SingularTransform`] as for [`Transform::from_matrix`].
    pub fn from_affine(forward: DAffine3) -> Result<Self, SingularTransform> {
        let linear = forward.matrix3;
        let scale = linear.row(0).length() * linear.row(1).length() * linear.row(2).length();
        let determinant = linear.determinant();
        let invertible = determinant.abs() > 8.0 * f64::EPSILON * scale && determinant.is_finite();
        if !invertible || !forward.is_finite() {
            return Err(SingularTransform);
        }
        let inverse = forward.inverse();
        if inverse.is_finite() { Ok(Self { forward, inverse }) } else { Err(SingularTransform) }
    }

    /// Moves points by `offset`; leaves directions alone.
    pub fn translate(offset: DVec3) -> Self {
        Self { forward: DAffine3::from_translation(offset), inverse: DAffine3::from_translation(-offset) }
    }

    /// Scales each axis by its factor; a negative factor mirrors.
    ///
    /// # Errors
    /// [`SingularTransform`] when a factor is zero or not finite, or its reciprocal overflows.
    pub fn scale(factors: DVec3) -> Result<Self, SingularTransform> {
        let inverse = factors.recip();
        if factors.is_finite() && inverse.is_finite() {
            Ok(Self { forward: DAffine3::from_scale(factors), inverse: DAffine3::from_scale(inverse) })
        } else {
            Err(SingularTransform)
        }
    }

    /// The shear `x' = x + xy·y + xz·z`, `y' = y + yx·x + yz·z`, `z' = z + zx·x + zy·y`.
    ///
    /// # Errors
    /// [`SingularTransform`] when the six factors make a singular matrix.
    pub fn shear(xy: f64, xz: f64, yx: f64, yz: f64, zx: f64, zy: f64) -> Result<Self, SingularTransform> {
        let linear =
            DMat3::from_cols(DVec3::new(1.0, yx, zx), DVec3::new(xy, 1.0, zy), DVec3::new(xz, yz, 1.0));
        Self::from_affine(DAffine3::from_mat3(linear))
    }

    /// A rotation by `degrees` about `axis` (any length but zero), x towards y about z.
    ///
    /// Multiples of 90° give exact zeros and ones about the coordinate axes.
    ///
    /// # Errors
    /// [`SingularTransform`] when the axis is zero or anything is not finite.
    pub fn rotate(axis: DVec3, degrees: f64) -> Result<Self, SingularTransform> {
        let unit = axis / axis.abs().max_element();
        let unit = unit / unit.length();
        if !unit.is_finite() || !degrees.is_finite() {
            return Err(SingularTransform);
        }
        let (sin, cos) = sin_cos_degrees(degrees);
        // 1 - cos θ without cancellation for small angles.
        let half_sin = sin_cos_degrees(0.5 * degrees).0;
        let versine = 2.0 * half_sin * half_sin;
        let versine = if cos == 0.0 { 1.0 } else { versine };
        let (x, y, z) = (unit.x, unit.y, unit.z);
        let linear = DMat3::from_cols(
            DVec3::new(cos + versine * x * x, versine * x * y + sin * z, versine * x * z - sin * y),
            DVec3::new(versine * x * y - sin * z, cos + versine * y * y, versine * y * z + sin * x),
            DVec3::new(versine * x * z + sin * y, versine * y * z - sin * x, cos + versine * z * z),
        );
        Ok(Self { forward: DAffine3::from_mat3(linear), inverse: DAffine3::from_mat3(linear.transpose()) })
    }

    /// The map itself, as glam's affine type.
    pub fn affine(&self) -> &DAffine3 {
        &self.forward
    }

    /// The inverse map, as glam's affine type.
    pub fn inverse_affine(&self) -> &DAffine3 {
        &self.inverse
    }

    /// The linear part `L`.
    pub fn linear(&self) -> DMat3 {
        self.forward.matrix3
    }

    /// The map back.
    #[must_use]
    pub fn inverse(&self) -> Self {
        Self { forward: self.inverse, inverse: self.forward }
    }

    /// The image of a point (w = 1).
    pub fn point(&self, p: DVec3) -> DVec3 {
        self.forward.transform_point3(p)
    }

    /// The image of a direction (w = 0); its length changes with it.
    pub fn vector(&self, v: DVec3) -> DVec3 {
        self.forward.transform_vector3(v)
    }

    /// The image of a normal, `L⁻ᵀ n`, not normalised. Outward normals stay outward even under a mirror.
    pub fn normal(&self, n: DVec3) -> DVec3 {
        self.inverse.matrix3.transpose() * n
    }

    /// The point whose image is `p`.
    pub fn inverse_point(&self, p: DVec3) -> DVec3 {
        self.inverse.transform_point3(p)
    }

    /// The direction whose image is `v`.
    pub fn inverse_vector(&self, v: DVec3) -> DVec3 {
        self.inverse.transform_vector3(v)
    }

    /// The normal whose image is `n`, up to length.
    pub fn inverse_normal(&self, n: DVec3) -> DVec3 {
        self.forward.matrix3.transpose() * n
    }

    /// The determinant of the linear part: the factor of volumes, negative for a mirror.
    pub fn determinant(&self) -> f64 {
        self.forward.matrix3.determinant()
    }

    /// Whether the map turns a right-handed frame into a left-handed one.
    pub fn is_mirror(&self) -> bool {
        self.determinant() < 0.0
    }

    /// Whether the map changes nothing at all.
    pub fn is_identity(&self) -> bool {
        self.forward == DAffine3::IDENTITY
    }
}

impl Mul for Transform {
    type Output = Self;

    /// First `inner`, then `self`.
    fn mul(self, inner: Self) -> Self {
        Self { forward: self.forward * inner.forward, inverse: inner.inverse * self.inverse }
    }
}

/// Sine and cosine of an angle in degrees, exact at every multiple of 90.
pub fn sin_cos_degrees(degrees: f64) -> (f64, f64) {
    let reduced = degrees % 360.0;
    let quarter = (reduced / 90.0).round();
    let (sin, cos) = (reduced - 90.0 * quarter).to_radians().sin_cos();
    match quarter as i64 {
        0 | 4 | -4 => (sin, cos),
        1 | -3 => (cos, -sin),
        2 | -2 => (-sin, -cos),
        _ => (-cos, sin),
    }
}
