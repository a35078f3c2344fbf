//! Cylinders: open or capped, finite or infinite.

use std::f64::consts::TAU;

use lumbre_math::{DVec2, DVec3, Transform};

use crate::axial::{Axial, axial_shape};
use crate::shape::check;
use crate::{
    Aabb, BoundingVolume, DirectionSample, NearestPoint, NearestPointError, Ray, Root, Roots, ShapeError,
    Surface, SurfaceSample,
};

/// The points at distance `radius` from an axis, between two planes perpendicular to it or without end.
///
/// `u` is the azimuth over `phimax` (about z from x towards y for [`Cylinder::along_z`]), and `v` the fraction
/// along the axis, or the distance along it when the cylinder is infinite. On the caps `v` is the fraction of
/// the radius. A complete cylinder with caps is a convex solid. A ray along the axis misses an infinite
/// cylinder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cylinder {
    body: Axial,
}

impl Cylinder {
    /// The cylinder from `p0` to `p1`, with disks at both ends if `caps`.
    ///
    /// # Errors
    /// [`ShapeError`] unless the ends are finite and differ, and the radius is finite and greater than 0.
    pub fn new(p0: DVec3, p1: DVec3, radius: f64, caps: bool) -> Result<Self, ShapeError> {
        let (p1, p2) = (check::finite("p0", p0)?, check::finite("p1", p1)?);
        let radius = check::positive("radius", radius)?;
        if p1 == p2 {
            return Err(ShapeError::Degenerate("p0 and p1 of the cylinder are the same point"));
        }
        let axis = check::direction("p1", p2 - p1)?;
        let length = check::positive("p1", (p2 - p1).length())?;
        let body = Axial { p1, p2, axis, length, has_ends: true, ..infinite(p1, axis, radius) };
        Ok(Self { body: Axial { cut1: true, cut2: true, caps, ..body } })
    }

    /// pbrt's cylinder about the z axis from `zmin` to `zmax` (in either order; either may be infinite), with
    /// disks at its finite ends if `caps`.
    ///
    /// # Errors
    /// [`ShapeError`] unless the radius is finite and greater than 0 and the two heights differ and are not NaN.
    pub fn along_z(radius: f64, zmin: f64, zmax: f64, caps: bool) -> Result<Self, ShapeError> {
        let radius = check::positive("radius", radius)?;
        let any = "a number or inf";
        let zmin = check::within("zmin", zmin, !zmin.is_nan(), any)?;
        let zmax = check::within("zmax", zmax, !zmax.is_nan(), any)?;
        let (low, high) = (zmin.min(zmax), zmin.max(zmax));
        if low == high {
            return Err(ShapeError::Degenerate("nothing of the cylinder lies between zmin and zmax"));
        }
        let on_axis = |z: f64| DVec3::new(0.0, 0.0, z);
        let body = match (low.is_finite(), high.is_finite()) {
            (true, true) => return Self::new(on_axis(low), on_axis(high), radius, caps),
            (true, false) => Axial { cut1: true, ..infinite(on_axis(low), DVec3::Z, radius) },
            (false, true) => Axial { cut2: true, ..infinite(on_axis(high), DVec3::Z, radius) },
            (false, false) => infinite(DVec3::ZERO, DVec3::Z, radius),
        };
        Ok(Self { body: Axial { caps, ..body } })
    }

    /// The infinite cylinder about the line through `point` along `axis`, of any non-zero length.
    ///
    /// # Errors
    /// [`ShapeError`] unless everything is finite, the axis is not zero and the radius is greater than 0.
    pub fn infinite(point: DVec3, axis: DVec3, radius: f64) -> Result<Self, ShapeError> {
        let point = check::finite("point", point)?;
        let axis = check::direction("axis", axis)?;
        Ok(Self { body: infinite(point, axis, check::positive("radius", radius)?) })
    }

    /// The radius.
    pub fn radius(&self) -> f64 {
        self.body.r1
    }
}

fn infinite(point: DVec3, axis: DVec3, radius: f64) -> Axial {
    Axial {
        p1: point,
        p2: point,
        axis,
        length: f64::INFINITY,
        r1: radius,
        r2: radius,
        k: 0.0,
        cut1: false,
        cut2: false,
        caps: false,
        phi_max: TAU,
        has_ends: false,
    }
}

axial_shape!(Cylinder, "cylinder");
