//! The surface of a torus: its points, bounds, area and sampling.

use std::f64::consts::{PI, TAU};

use lumbre_math::roots::bracketed_root;
use lumbre_math::rounding::gamma;
use lumbre_math::{DMat3, DVec2, DVec3, Elementary, Transform, direction_at};

use super::Torus;
use crate::shape::sampled_by_area;
use crate::support::{azimuth, bounds_from_support};
use crate::twofold::point;
use crate::{Aabb, BoundingVolume, Ray, Root, Surface, SurfaceSample, measure};

impl Torus {
    /// The surface at a crossing.
    pub fn surface(&self, ray: &Ray, root: &Root) -> Surface {
        let p = self.framed(point(ray.origin, self.center, root.t, ray.direction));
        let rho = p.x.hypotenuse(p.y);
        let outward = if rho > 0.0 { DVec2::new(p.x, p.y) / rho } else { DVec2::X };
        let (outer, inner) = self.factors(rho, p.z);
        if !self.is_ring() && inner.abs() < outer.abs() {
            self.surface_on(-outward, DVec2::new(-rho - self.major, p.z))
        } else {
            self.surface_on(outward, DVec2::new(rho - self.major, p.z))
        }
    }

    /// The surface at `uv`.
    pub fn surface_at(&self, part: u32, uv: DVec2) -> Option<Surface> {
        let meridian = direction_at(TAU * uv.x);
        let tube = direction_at(TAU * uv.y);
        (part == 0).then(|| Surface { uv, ..self.surface_on(meridian, tube) })
    }

    /// The surface in the half-plane of the unit vector `meridian`, in the direction `tube` from the circle's
    /// point there: the first component of `tube` is along the meridian, the second along the axis.
    pub(super) fn surface_on(&self, meridian: DVec2, tube: DVec2) -> Surface {
        let tube = if tube == DVec2::ZERO { DVec2::X } else { tube.normalize() };
        let rho = self.major + self.minor * tube.x;
        let radial = DVec3::new(meridian.x, meridian.y, 0.0);
        let tangent = DVec3::new(-meridian.y, meridian.x, 0.0);
        let side = if rho < 0.0 { -1.0 } else { 1.0 };
        let around = DVec3::new(-tube.y * radial.x, -tube.y * radial.y, tube.x);
        let local = DVec3::new(rho * radial.x, rho * radial.y, self.minor * tube.y);
        let point = self.center + self.unframed(local);
        let size = DVec3::splat(self.major + self.minor);
        Surface {
            point,
            point_error: gamma(24) * size + gamma(2) * (point.abs() + self.center.abs()),
            normal: self.unframed(side * DVec3::new(tube.x * radial.x, tube.x * radial.y, tube.y)),
            uv: DVec2::new(
                (azimuth(meridian.y, meridian.x) / TAU).min(1.0),
                (azimuth(tube.y, tube.x) / TAU).min(1.0),
            ),
            dpdu: self.unframed(TAU * rho * tangent),
            dpdv: self.unframed(TAU * self.minor * around),
            dndu: self.unframed(side * TAU * tube.x * tangent),
            dndv: self.unframed(side * TAU * around),
        }
    }

    /// The tight box under a transform.
    pub fn bounds(&self, world_from_object: &Transform) -> Option<Aabb> {
        let support = |d: DVec3| {
            let across = d.dot(self.e1).hypotenuse(d.dot(self.e2));
            d.dot(self.center) + self.major * across + self.minor * d.length()
        };
        let magnitude = self.center.abs() + DVec3::splat(self.major + self.minor);
        Some(bounds_from_support(world_from_object, magnitude, support))
    }

    /// A bounding solid of revolution, and the tube of a ring.
    pub fn bounding_volume(&self) -> Option<BoundingVolume> {
        let (major, minor) = (self.major, self.minor);
        let reach = major + minor;
        let axes = DMat3::from_cols(reach * self.e1, reach * self.e2, minor * self.axis);
        // At a height of `minor` z, ρ² ≤ (R + r s)² with s = √(1 - z²). As a function of z², s lies below its
        // tangent, here at z² = 1/2: s ≤ (1/√2) + (1/2 - z²) / √2.
        let (big, small) = (major / reach, minor / reach);
        let s = std::f64::consts::FRAC_1_SQRT_2;
        let constant = big * big + small * small + 3.0 * s * big * small;
        let slope = small * small + 2.0 * s * big * small;
        let bounding_volume = BoundingVolume::new(self.center, axes, [slope, 0.0, -constant], self.is_ring());
        Some(BoundingVolume { tube: if self.is_ring() { small } else { 0.0 }, ..bounding_volume })
    }

    /// The angle ϑ at which the tube meets the axis: beyond it, up to π, lies the inner sheet; π for a ring.
    fn crossing_angle(&self) -> f64 {
        (-self.major / self.minor).max(-1.0).arc_cosine()
    }

    /// The integral of |major + minor cos ϑ| from 0 to `theta`, for an angle up to π, and its slope.
    fn swept(&self, theta: f64) -> (f64, f64) {
        let signed = |theta: f64| self.major * theta + self.minor * theta.sine();
        let split = self.crossing_angle();
        let slope = (self.major + self.minor * theta.cosine()).abs();
        if theta <= split { (signed(theta), slope) } else { (2.0 * signed(split) - signed(theta), slope) }
    }

    /// The area, 4π² major minor for a ring. A spindle's inner sheet is included.
    pub fn area(&self) -> f64 {
        2.0 * TAU * self.minor * self.swept(PI).0
    }

    /// The area after a transform, by quadrature.
    pub fn area_under(&self, world_from_object: &Transform) -> f64 {
        let split = self.crossing_angle() / TAU;
        // A spindle's area element has a kink where the sheets meet.
        let pieces = [(0.0, split), (split, 1.0 - split), (1.0 - split, 1.0)];
        let piece = |(from, to): (f64, f64)| {
            if to <= from {
                return 0.0;
            }
            measure::patch_area(world_from_object, |u, v| {
                let (meridian, tube) = (direction_at(TAU * u), direction_at(TAU * (from + v * (to - from))));
                let density = TAU * TAU * self.minor * (self.major + self.minor * tube.x) * (to - from);
                density * self.unframed(DVec3::new(tube.x * meridian.x, tube.x * meridian.y, tube.y))
            })
        };
        pieces.into_iter().map(piece).sum()
    }

    /// A point uniform by area.
    pub fn sample_area(&self, u: DVec2) -> Option<SurfaceSample> {
        // u.y chooses the upper or the lower half of the tube.
        let (upper, fraction) = if u.y < 0.5 { (true, 2.0 * u.y) } else { (false, 2.0 * u.y - 1.0) };
        let goal = fraction * self.swept(PI).0;
        let theta = bracketed_root(0.0, PI, fraction * PI, true, |theta| {
            let (value, slope) = self.swept(theta);
            (value - goal, slope)
        });
        let (sin, cos) = theta.sine_cosine();
        let tube = DVec2::new(cos, if upper { sin } else { -sin });
        let surface = self.surface_on(direction_at(TAU * u.x), tube);
        Some(SurfaceSample { surface, pdf: 1.0 / self.area() })
    }

    sampled_by_area!(pub);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_area_of_a_spindle_counts_both_sheets() {
        let spindle = Torus::new(DVec3::ONE, DVec3::X, 1.5, 2.0).unwrap();
        let by_quadrature = spindle.area_under(&Transform::IDENTITY);
        assert!((spindle.area() / by_quadrature - 1.0).abs() < 1e-10);
        let ring = Torus::new(DVec3::ONE, DVec3::X, 2.5, 0.75).unwrap();
        assert!((ring.area() - 4.0 * PI * PI * 2.5 * 0.75).abs() < 1e-12);
    }
}
