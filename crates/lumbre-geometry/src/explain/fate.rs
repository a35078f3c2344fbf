//! What became of a crossing.

/// Whether a crossing of the ray's line is a hit, or why it is none.
///
/// Where there are several reasons, it is the first that the search comes to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fate {
    /// The search returns it.
    Hit,
    /// It is behind the ray's origin: `t` is less than 0, where the ray's range begins at 0 or later.
    Behind,
    /// `t` is less than the ray's range.
    BeforeRange {
        /// The least `t` of the range.
        t_min: f64,
    },
    /// `t` is greater than the ray's range.
    BeyondRange {
        /// The greatest `t` of the range.
        t_max: f64,
    },
    /// It is on the other nappe of a cone.
    OtherNappe {
        /// The radius there, with a sign, which is negative on the other nappe.
        radius: f64,
    },
    /// It is above or below the heights between which the surface is kept.
    OutsideHeights {
        /// Its height: along z from the centre of a sphere, along z for a paraboloid, along the axis from the first end
        /// for a cylinder, cone or capsule.
        z: f64,
        /// The least height, which may be infinite.
        min: f64,
        /// The greatest height, which may be infinite.
        max: f64,
    },
    /// It is above or below the ends of the segment that sweeps a hyperboloid.
    OutsideSegment {
        /// The place along the segment: 0 at its first end, 1 at its second.
        v: f64,
    },
    /// Its azimuth is beyond the sweep.
    OutsideSweep {
        /// Its azimuth in radians, from 0 to 2π.
        phi: f64,
        /// The greatest azimuth in radians.
        max: f64,
    },
    /// It is in the plane, but beyond the rim of the disk.
    OutsideRim {
        /// The distance from the centre.
        distance: f64,
        /// The rim's radius.
        radius: f64,
    },
    /// It is in the hole of an annulus.
    InsideHole {
        /// The distance from the centre.
        distance: f64,
        /// The hole's radius.
        radius: f64,
    },
    /// It is in the plane, but outside the edges of a triangle.
    OutsideEdges {
        /// The barycentric coordinates; one is negative.
        weights: [f64; 3],
    },
    /// It is on the surface that continues a bilinear patch.
    OutsidePatch {
        /// The parameter u; outside of [0, 1], or v is.
        u: f64,
        /// The parameter v.
        v: f64,
    },
    /// It is in the plane of a box's face, but outside of the face.
    OutsideSlab {
        /// The axis along which it is outside: 0, 1 or 2.
        axis: usize,
        /// The `t` where the line enters between the two faces of that axis.
        enter: f64,
        /// The `t` where the line leaves them.
        leave: f64,
    },
    /// It is outside the box that clips a quadric.
    OutsideBox {
        /// The axis along which it is outside: 0, 1 or 2.
        axis: usize,
        /// Its coordinate along that axis.
        value: f64,
        /// The least coordinate in the box.
        min: f64,
        /// The greatest coordinate in the box.
        max: f64,
    },
    /// It is within the solid, on a surface that continues one of its parts.
    InsideSolid,
    /// It is at the seam of two parts, and counts for the other.
    Shared {
        /// The part that it counts for.
        part: u32,
    },
    /// The triangle has no area, and is never hit.
    Flat,
    /// The line touches an operand of a CSG tree without crossing it.
    Touch,
    /// It is inside another operand of a CSG tree, which is why the result neither begins nor ends there.
    InsideOperand {
        /// The other operand's place among the leaves, from 0.
        operand: usize,
    },
    /// It is outside another operand of a CSG tree, which is why the result neither begins nor ends there.
    OutsideOperand {
        /// The other operand's place among the leaves, from 0.
        operand: usize,
    },
    /// It coincides with the surface of another operand, which owns it, or with which it ends where it begins.
    Coincides {
        /// The other operand's place among the leaves, from 0.
        operand: usize,
    },
    /// The result of a CSG tree is the same on both sides, for reasons that take more than one other operand.
    NoChange {
        /// Whether both sides are inside the result.
        inside: bool,
    },
    /// The search does not return it although no reason was found. Tests hold that this does not happen.
    NotReturned,
}
