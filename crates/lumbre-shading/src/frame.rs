//! The shading frame, and directions in it.

use lumbre_math::{Vec3, frame::orthonormal_basis_f32};

/// What is made of normals that differ from the geometric one: those of vertices, and of normal and bump maps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ShadingNormals {
    /// A normal that faces away from the viewer is turned until it does not; directions that a BSDF scatters to on the
    /// wrong side of the surface are folded back; shadows on coarse meshes end where the smooth surface turns away.
    /// Nothing is black that should not be, and no light leaks.
    #[default]
    Lumbre,
    /// As in pbrt-v4: BSDF and cosine by the shading normal as it is, whatever the side of the surface that a direction
    /// is on; the geometric normal says where rays start and which side they are on.
    Pbrt,
}

impl ShadingNormals {
    /// How far the cosine between a shading normal and the geometric one may be from 1 by rounding.
    pub const ROUNDING: f32 = 1e-6;

    /// The one of that name, `lumbre` or `pbrt`.
    pub fn from_name(name: &str) -> Option<Self> {
        match name {
            "lumbre" => Some(Self::Lumbre),
            "pbrt" => Some(Self::Pbrt),
            _ => None,
        }
    }

    /// Whether a shading normal is another than the geometric one.
    pub fn differ(shading: Vec3, geometric: Vec3) -> bool {
        shading.dot(geometric) < 1.0 - Self::ROUNDING
    }
}

/// A unit direction in a shading frame, whose z axis is the shading normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalDir(pub(crate) Vec3);

impl LocalDir {
    /// A unit vector of a frame.
    pub fn new(unit: Vec3) -> Self {
        Self(unit)
    }

    /// Its coordinates.
    pub fn vec(self) -> Vec3 {
        self.0
    }

    /// The cosine of its angle with the shading normal.
    pub fn cos_theta(self) -> f32 {
        self.0.z
    }

    /// The absolute value of that cosine.
    pub fn abs_cos_theta(self) -> f32 {
        self.0.z.abs()
    }

    /// Whether both lie on the same side of the surface.
    pub fn same_hemisphere(self, other: Self) -> bool {
        self.0.z * other.0.z > 0.0
    }

    /// The mirror reflection in the surface.
    pub(crate) fn mirrored(self) -> Self {
        Self(Vec3::new(-self.0.x, -self.0.y, self.0.z))
    }
}

impl std::ops::Neg for LocalDir {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

/// A right-handed orthonormal frame about a shading normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShadingFrame {
    /// x: along ∂p/∂u if that is defined.
    pub s: Vec3,
    /// y: n × s.
    pub t: Vec3,
    /// z: the shading normal.
    pub n: Vec3,
}

impl ShadingFrame {
    /// A frame about the unit vector `n` with `s` as near to `tangent` as possible; `s` is arbitrary if the
    /// tangent is zero, parallel to the normal, or not finite.
    pub fn new(n: Vec3, tangent: Vec3) -> Self {
        // Scaled first, since a derivative of position can have any magnitude.
        let tangent = tangent / tangent.abs().max_element();
        let across = tangent - n * n.dot(tangent);
        // Below a sine of 2⁻¹⁰ the remaining direction is mostly rounding error.
        if across.length_squared() > 1e-6 * tangent.length_squared() && across.is_finite() {
            // Orthogonalised again: the first subtraction leaves a rounding error along n, too small to change
            // the length.
            let s = across.normalize();
            let s = s - n * n.dot(s);
            return Self { s, t: n.cross(s), n };
        }
        let (s, t) = orthonormal_basis_f32(n);
        Self { s, t, n }
    }

    /// World to local direction.
    pub fn to_local(&self, world: Vec3) -> LocalDir {
        LocalDir(Vec3::new(self.s.dot(world), self.t.dot(world), self.n.dot(world)))
    }

    /// Local to world direction.
    pub fn to_world(&self, local: LocalDir) -> Vec3 {
        self.s * local.0.x + self.t * local.0.y + self.n * local.0.z
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumbre_math::random::RandomStream;

    fn assert_orthonormal(frame: &ShadingFrame) {
        let ShadingFrame { s, t, n } = *frame;
        for unit in [s, t, n] {
            assert!((unit.length() - 1.0).abs() < 1e-6, "{frame:?}");
        }
        assert!(s.dot(t).abs() < 1e-6 && s.dot(n).abs() < 1e-6 && t.dot(n).abs() < 1e-6, "{frame:?}");
        assert!((s.cross(t) - n).length() < 1e-6, "{frame:?}");
    }

    #[test]
    fn a_frame_is_orthonormal_and_follows_its_tangent() {
        let mut random = RandomStream::new(12);
        let mut signed = || 2.0 * random.next_f32() - 1.0;
        let mut count = 0;
        for _ in 0..2_000 {
            let (n, tangent) =
                (Vec3::new(signed(), signed(), signed()), Vec3::new(signed(), signed(), signed()));
            let Some(n) = n.try_normalize() else { continue };
            for size in [1e-20, 3.0, 1e20] {
                let frame = ShadingFrame::new(n, tangent * size);
                assert_orthonormal(&frame);
                assert!(frame.s.dot(tangent) >= 0.0);
                assert!(frame.t.dot(tangent).abs() < 1e-6);
                count += 1;
            }
        }
        assert!(count > 5_000);
    }

    #[test]
    fn a_tangent_that_says_nothing_leaves_a_frame_all_the_same() {
        let n = Vec3::new(2.0, -1.0, 0.5).normalize();
        for tangent in [Vec3::ZERO, n * 3.0, n * -1e-4, Vec3::NAN, Vec3::splat(f32::INFINITY)] {
            assert_orthonormal(&ShadingFrame::new(n, tangent));
        }
    }

    #[test]
    fn a_direction_goes_into_the_frame_and_back() {
        let frame = ShadingFrame::new(Vec3::new(0.6, 0.0, -0.8), Vec3::new(1.0, 2.0, 3.0));
        let world = Vec3::new(3.0, -4.0, 12.0) / 13.0;
        let local = frame.to_local(world);
        assert!((frame.to_world(local) - world).length() < 1e-6);
        assert!((local.cos_theta() - frame.n.dot(world)).abs() < 1e-7);
    }
}
