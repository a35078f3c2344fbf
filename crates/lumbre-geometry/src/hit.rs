//! What a search finds, and what is computed once for the winner.

use lumbre_math::{DVec2, DVec3};
use smallvec::SmallVec;

/// A crossing of a surface by a ray: the little that a search keeps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Root {
    /// Where, in units of the ray's direction.
    pub t: f64,
    /// Which part of the shape: 0 for the surface or the lateral surface; 1 and 2 for the caps at the first and second
    /// end; 0 to 5 for a box's faces -x, +x, -y, +y, -z, +z. For CSG, see `Csg`.
    pub part: u32,
    /// How often: 2 where a ray touches without crossing, as the multiplicity of a polynomial's root.
    pub multiplicity: u8,
    /// Surface coordinates that the search had to find anyway: barycentrics (b1, b2) of a triangle, (u, v) of a
    /// bilinear patch; zero for others, which compute theirs for the winner only.
    pub local: DVec2,
}

impl Root {
    /// A simple crossing of part 0.
    #[inline]
    pub fn at(t: f64) -> Self {
        Self { t, part: 0, multiplicity: 1, local: DVec2::ZERO }
    }
}

/// Crossings in ascending order of `t`.
pub type Roots = SmallVec<[Root; 4]>;

/// The surface at a hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// The point, re-projected onto the surface: its error does not grow with the distance to the ray's origin.
    pub point: DVec3,
    /// A bound on the absolute error of each component of `point`.
    pub point_error: DVec3,
    /// The geometric normal: unit, outward for closed shapes, not turned towards the ray.
    pub normal: DVec3,
    /// Surface parameters, each in [0, 1] on bounded shapes.
    pub uv: DVec2,
    /// ∂point/∂u.
    pub dpdu: DVec3,
    /// ∂point/∂v.
    pub dpdv: DVec3,
    /// ∂normal/∂u.
    pub dndu: DVec3,
    /// ∂normal/∂v.
    pub dndv: DVec3,
}

impl Surface {
    /// An origin for a ray that leaves along `direction`: on that side of the surface, past the error of `point`, so that
    /// the ray does not meet the surface where it starts.
    ///
    /// M. Pharr, W. Jakob, G. Humphreys, "Physically Based Rendering", 3rd edition, 2016, section 3.9.
    pub fn offset_origin(&self, direction: DVec3) -> DVec3 {
        let distance = self.normal.abs().dot(self.point_error);
        let side = if self.normal.dot(direction) < 0.0 { -self.normal } else { self.normal };
        let moved = self.point + distance * side;
        // Away from the surface, whatever the last addition rounded off.
        let outward = |axis: usize| match side[axis] {
            s if s > 0.0 => moved[axis].next_up(),
            s if s < 0.0 => moved[axis].next_down(),
            _ => moved[axis],
        };
        DVec3::new(outward(0), outward(1), outward(2))
    }
}

/// A point chosen on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceSample {
    /// Where it is, with its normal and parameters.
    pub surface: Surface,
    /// The density of the choice, per unit area.
    pub pdf: f64,
}

/// A point chosen on a surface as seen from somewhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectionSample {
    /// Where it is, with its normal and parameters.
    pub surface: Surface,
    /// The density of the choice, per unit solid angle at the place that it is seen from.
    pub pdf: f64,
}
