//! Orthonormal frames.

use glam::{DMat3, DVec3, Vec3};

use crate::vector::unit;

/// Two unit vectors that complete the unit vector `n` to a right-handed frame, `e1 × e2 = n`.
///
/// Continuous except across the plane `n.z = 0`, without a singular direction; for `n = z` the result is `x,
/// y`, for `n = y` it is `x, -z`. It is the azimuth reference of every shape with an axis. `n.z = -0.0` counts
/// as negative. Source: Duff, Burgess, Christensen, Hery, Kensler, Liani, Villemin, "Building an Orthonormal
/// Basis, Revisited", JCGT 6(1), 2017.
pub fn orthonormal_basis(n: DVec3) -> (DVec3, DVec3) {
    let sign = 1.0_f64.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    let e1 = DVec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x);
    let e2 = DVec3::new(b, sign + n.y * n.y * a, -n.y);
    (e1, e2)
}

/// [`orthonormal_basis`] in single precision.
pub fn orthonormal_basis_f32(n: Vec3) -> (Vec3, Vec3) {
    let sign = 1.0_f32.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    let e1 = Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x);
    let e2 = Vec3::new(b, sign + n.y * n.y * a, -n.y);
    (e1, e2)
}

/// A right-handed orthonormal frame: `x × y = z`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// The first axis (`u` of the pair of directions).
    pub x: DVec3,
    /// The second axis (`v`).
    pub y: DVec3,
    /// The third axis (`w`): the normal of a shading frame.
    pub z: DVec3,
}

impl Default for Frame {
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl Frame {
    /// The coordinate axes.
    pub const IDENTITY: Self = Self { x: DVec3::X, y: DVec3::Y, z: DVec3::Z };

    /// The frame of [`orthonormal_basis`] whose third axis is the unit vector `z`.
    pub fn from_z(z: DVec3) -> Self {
        let (x, y) = orthonormal_basis(z);
        Self { x, y, z }
    }

    /// The frame whose third axis is along `a` and whose second axis is as near to `b` as possible, `y·b > 0`.
    /// Neither needs to be unit. `None` when they are parallel up to rounding, or one is zero or not finite.
    pub fn from_two(a: DVec3, b: DVec3) -> Option<Self> {
        let z = unit(a)?;
        let b = unit(b)?;
        let across = b.cross(z);
        // |b × w|² ≤ 2⁻⁴⁰ |b|²: the direction of the product would be mostly rounding error.
        if across.length_squared() <= f64::powi(2.0, -40) {
            return None;
        }
        let x = across.normalize();
        Some(Self { x, y: z.cross(x), z })
    }

    /// [`Frame::from_two`], or the frame of [`orthonormal_basis`] where `b` is parallel to `a`. `None` only
    /// when `a` is zero or not finite.
    pub fn from_two_or_any(a: DVec3, b: DVec3) -> Option<Self> {
        match Self::from_two(a, b) {
            Some(frame) => Some(frame),
            None => Some(Self::from_z(unit(a)?)),
        }
    }

    /// World to local coordinates.
    pub fn to_local(&self, v: DVec3) -> DVec3 {
        DVec3::new(self.x.dot(v), self.y.dot(v), self.z.dot(v))
    }

    /// Local to world coordinates.
    pub fn to_world(&self, local: DVec3) -> DVec3 {
        self.x * local.x + self.y * local.y + self.z * local.z
    }

    /// The matrix with the axes as columns, `world_from_local`; its transpose has them as rows and is its inverse.
    pub fn matrix(&self) -> DMat3 {
        DMat3::from_cols(self.x, self.y, self.z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::RandomStream;

    fn unit_vectors(count: usize) -> impl Iterator<Item = DVec3> {
        let mut random = RandomStream::new(0x5eed_f00d);
        let poles = [DVec3::Z, -DVec3::Z, DVec3::X, -DVec3::X, DVec3::Y, -DVec3::Y];
        let near = (1..60).flat_map(|k| {
            let tiny = f64::powi(2.0, -k);
            [DVec3::new(tiny, -tiny, -1.0).normalize(), DVec3::new(1.0, 0.5, -tiny).normalize()]
        });
        let any = (0..count).filter_map(move |_| {
            let v = DVec3::from_array(std::array::from_fn(|_| 2.0 * random.next_f64() - 1.0));
            v.try_normalize()
        });
        poles.into_iter().chain(near).chain(any)
    }

    #[test]
    fn the_basis_is_orthonormal_and_right_handed_everywhere() {
        let mut count = 0;
        for n in unit_vectors(20_000) {
            let (e1, e2) = orthonormal_basis(n);
            let (f1, f2) = orthonormal_basis_f32(n.as_vec3());
            assert!((e1.cross(e2) - n).length() < 1e-15, "{n}");
            assert!((e1.length() - 1.0).abs() < 1e-15 && (e2.length() - 1.0).abs() < 1e-15, "{n}");
            assert!(e1.dot(e2).abs() < 1e-15 && e1.dot(n).abs() < 1e-15 && e2.dot(n).abs() < 1e-15, "{n}");
            assert!((f1.cross(f2) - n.as_vec3()).length() < 1e-6, "{n}");
            assert!(f1.dot(f2).abs() < 1e-6 && (f1.length() - 1.0).abs() < 1e-6, "{n}");
            count += 1;
        }
        assert!(count > 20_000);
    }

    #[test]
    fn the_basis_of_a_coordinate_axis_is_made_of_coordinate_axes() {
        assert_eq!(orthonormal_basis(DVec3::Z), (DVec3::X, DVec3::Y));
        assert_eq!(orthonormal_basis(DVec3::Y), (DVec3::X, -DVec3::Z));
        assert_eq!(orthonormal_basis(DVec3::new(0.0, 0.0, -1.0)), (DVec3::X, -DVec3::Y));
    }

    #[test]
    fn coordinates_go_to_the_frame_and_back() {
        let v = DVec3::new(3.0, -2.0, 0.5);
        for n in unit_vectors(500) {
            let frame = Frame::from_z(n);
            assert!((frame.to_world(frame.to_local(v)) - v).length() < 1e-14);
            assert!((frame.to_local(frame.z) - DVec3::Z).length() < 1e-15);
            assert!((frame.matrix() * v - frame.to_world(v)).length() < 1e-14);
            assert!((frame.matrix().determinant() - 1.0).abs() < 1e-14);
        }
    }

    #[test]
    fn a_frame_from_two_directions_needs_two_directions() {
        let a = DVec3::new(1.0, -2.0, 0.25);
        assert_eq!(Frame::from_two(a, -3.0 * a), None);
        assert_eq!(Frame::from_two(DVec3::ZERO, a), None);
        assert_eq!(Frame::from_two(a, DVec3::ZERO), None);
        assert_eq!(Frame::from_two(DVec3::splat(f64::NAN), a), None);
        assert_eq!(Frame::from_two_or_any(DVec3::ZERO, a), None);
        let any = Frame::from_two_or_any(a, 2.0 * a).unwrap();
        assert_eq!(any.z, a.normalize());
        // Sizes far from one change nothing.
        let big = Frame::from_two(a * 1e300, DVec3::Y * 1e-300).unwrap();
        let small = Frame::from_two(a, DVec3::Y).unwrap();
        assert!((big.x - small.x).length() < 1e-15 && (big.y - small.y).length() < 1e-15);
    }
}
