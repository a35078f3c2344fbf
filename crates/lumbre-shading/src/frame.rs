//! The shading frame, and directions in it.

use lumbre_math::Vec3;

/// A unit direction in a shading frame, whose z axis is the shading normal. Only a [`ShadingFrame`] and the samplers of
/// this crate make one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalDir(pub(crate) Vec3);

impl LocalDir {
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
}

impl std::ops::Neg for LocalDir {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

/// An orthonormal frame about a shading normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShadingFrame {
    /// x: along ∂p/∂u where there is one.
    pub s: Vec3,
    /// y.
    pub t: Vec3,
    /// z: the shading normal.
    pub n: Vec3,
}

impl ShadingFrame {
    /// A frame about unit `n` with `s` as near to `tangent` as it can be; any `s` where the tangent says nothing.
    pub fn new(_n: Vec3, _tangent: Vec3) -> Self {
        unimplemented!("skeleton")
    }

    /// A unit direction of the world, in the frame.
    pub fn to_local(&self, world: Vec3) -> LocalDir {
        LocalDir(Vec3::new(self.s.dot(world), self.t.dot(world), self.n.dot(world)))
    }

    /// A direction of the frame, in the world.
    pub fn to_world(&self, local: LocalDir) -> Vec3 {
        self.s * local.0.x + self.t * local.0.y + self.n * local.0.z
    }
}
