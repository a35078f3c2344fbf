//! Cones: pointed or truncated, open or capped, finite or infinite.

use std::f64::consts::TAU;

use lumbre_math::transform::sin_cos_degrees;
use lumbre_math::{DVec2, DVec3, Transform};

use crate::axial::{Axial, axial_shape};
use crate::shape::check;
use crate::{
    Aabb, BoundingVolume, DirectionSample, NearestPoint, NearestPointError, Ray, Root, Roots, ShapeError,
    Surface, SurfaceSample,
};

/// The points whose distance from an axis is linear along it.
///
/// `u` is the azimuth over `phimax`, and `v` the fraction along the axis, or the distance from the apex when
/// the cone is infinite. On the caps `v` is the fraction of the radius. A complete cone with caps is a convex
/// solid. The normal at an apex points outward along the axis. A ray along a generator of an open cone misses
/// it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    body: Axial,
}

impl Cone {
    /// The frustum with radius `r0` at `p0` and `r1` at `p1`, where one may be 0, with disks at its ends of
    /// non-zero radius if `caps`.
    ///
    /// # Errors
    /// [`ShapeError`] unless the ends are finite and differ and the radii are finite, not negative, and not
    /// both 0.
    pub fn new(p0: DVec3, p1: DVec3, r0: f64, r1: f64, caps: bool) -> Result<Self, ShapeError> {
        let (p1, p2, r1, r2) = (check::finite("p0", p0)?, check::finite("p1", p1)?, r0, r1);
        let expected = "a finite number, 0 or greater";
        let r1 = check::within("radius", r1, 0.0 <= r1 && r1.is_finite(), expected)?;
        let r2 = check::within("topradius", r2, 0.0 <= r2 && r2.is_finite(), expected)?;
        if p1 == p2 {
            return Err(ShapeError::Degenerate("p0 and p1 of the cone are the same point"));
        }
        if r1 == 0.0 && r2 == 0.0 {
            return Err(ShapeError::Degenerate("both radii of the cone are 0"));
        }
        let axis = check::direction("p1", p2 - p1)?;
        let length = check::positive("p1", (p2 - p1).length())?;
        let (cut1, cut2) = (r1 > 0.0, r2 > 0.0);
        let k = (r2 - r1) / length;
        Ok(Self {
            body: Axial { p1, p2, axis, length, r1, r2, k, cut1, cut2, caps, phi_max: TAU, has_ends: true },
        })
    }

    /// The pointed cone that opens from `apex` along `axis` (of any non-zero length), up to `height` along it, which
    /// may be infinite. The angle between the axis and the side is `half_angle` in degrees, between 0 and 90.
    ///
    /// # Errors
    /// [`ShapeError`] unless the apex is finite, the axis finite and not zero, the angle within its range, and the
    /// height greater than 0.
    pub fn nappe(
        apex: DVec3,
        axis: DVec3,
        half_angle: f64,
        height: f64,
        caps: bool,
    ) -> Result<Self, ShapeError> {
        let apex = check::finite("apex", apex)?;
        let axis = check::direction("axis", axis)?;
        let is_sharp = 0.0 < half_angle && half_angle < 90.0;
        let half_angle = check::within("angle", half_angle, is_sharp, "degrees between 0 and 90")?;
        let height = check::within("height", height, height > 0.0, "greater than 0, or inf")?;
        // From a half-angle of 45° on, via the complement: exact at 45°, accurate at both ends.
        let acute_tan = |degrees: f64| {
            let (sin, cos) = sin_cos_degrees(2.0 * degrees);
            sin / (1.0 + cos)
        };
        let k = if half_angle <= 45.0 { acute_tan(half_angle) } else { 1.0 / acute_tan(90.0 - half_angle) };
        let pointed = Axial {
            p1: apex,
            p2: apex,
            axis,
            length: height,
            r1: 0.0,
            r2: f64::INFINITY,
            k,
            cut1: false,
            cut2: false,
            caps,
            phi_max: TAU,
            has_ends: false,
        };
        if height.is_infinite() {
            return Ok(Self { body: Axial { caps: false, ..pointed } });
        }
        let p2 = check::finite("height", apex + height * axis)?;
        let r2 = check::positive("height", k * height)?;
        Ok(Self { body: Axial { p2, r2, cut2: true, ..pointed } })
    }
}

axial_shape!(Cone, "cone");
