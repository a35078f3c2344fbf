//! Tori: ring, horn and spindle.

mod closest_point;
mod crossings;
mod line;
mod quartic;
mod surface;

use lumbre_math::{DVec3, Elementary, orthonormal_basis};

use crate::shape::check;
use crate::{Ray, Root, Roots, ShapeError};

/// The points at distance `minor` from a circle of radius `major`.
///
/// With `minor < major` it is a ring torus, with `minor = major` a horn torus, with `minor > major` a spindle
/// torus, whose surface crosses itself on the axis. A spindle also has an inner sheet, the lemon around its
/// centre, and a ray hits both. As a solid it is even-odd: the lemon is outside, and the normals of the inner
/// sheet point into it.
///
/// `u` is the azimuth φ about the axis over 2π, counted from the first vector of T. Duff's frame about the axis
/// (from x towards y for the axis z). `v` is the angle ϑ around the tube over 2π, 0 where it is farthest from
/// the axis and 1/4 at its top: the point is `(major + minor cos ϑ)(cos φ, sin φ, 0) + (0, 0, minor sin ϑ)`. On
/// the inner sheet the factor is negative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Torus {
    center: DVec3,
    // Orthonormal and right-handed.
    pub(crate) e1: DVec3,
    pub(crate) e2: DVec3,
    axis: DVec3,
    // The frame is that of the coordinate axes, so no rotation is needed.
    upright: bool,
    major: f64,
    minor: f64,
}

impl Torus {
    /// A torus around the circle of radius `major` about `center`, in the plane perpendicular to `axis` (of any
    /// non-zero length), with a tube of radius `minor`.
    ///
    /// # Errors
    /// [`ShapeError`] unless everything is finite, both radii are from 1e-70 to 1e70 and the axis is not zero.
    pub fn new(center: DVec3, axis: DVec3, major: f64, minor: f64) -> Result<Self, ShapeError> {
        let center = check::finite("center", center)?;
        let axis = check::direction("axis", axis)?;
        let radius = |name, found: f64| {
            let fourth_powers_are_numbers = (1e-70..=1e70).contains(&found);
            check::within(name, found, fourth_powers_are_numbers, "a number from 1e-70 to 1e70")
        };
        let major = radius("majorradius", major)?;
        let minor = radius("minorradius", minor)?;
        let (e1, e2) = orthonormal_basis(axis);
        Ok(Self { center, e1, e2, axis, upright: axis == DVec3::Z, major, minor })
    }

    /// The centre.
    pub fn center(&self) -> DVec3 {
        self.center
    }

    /// The axis, a unit vector.
    pub fn axis(&self) -> DVec3 {
        self.axis
    }

    /// The radius of the circle at the centre of the tube.
    pub fn major(&self) -> f64 {
        self.major
    }

    /// The radius of the tube.
    pub fn minor(&self) -> f64 {
        self.minor
    }

    fn is_ring(&self) -> bool {
        self.minor < self.major
    }

    /// Whether the tube is so thin that the quartic's digits cannot decide whether a line meets it.
    pub(crate) fn is_thin(&self) -> bool {
        self.minor < 1e-4 * self.major
    }

    pub(crate) fn framed(&self, v: DVec3) -> DVec3 {
        if self.upright { v } else { DVec3::new(v.dot(self.e1), v.dot(self.e2), v.dot(self.axis)) }
    }

    fn unframed(&self, v: DVec3) -> DVec3 {
        if self.upright { v } else { v.x * self.e1 + v.y * self.e2 + v.z * self.axis }
    }

    /// The first crossing in the ray's range.
    #[inline]
    pub fn closest(&self, ray: &Ray) -> Option<Root> {
        let line = self.line(ray)?;
        let mut found = None;
        self.crossings(&line, ray.t_min, |s, multiplicity| {
            let t = line.t(s);
            if ray.contains(t) && t.is_finite() {
                found = Some(Root { multiplicity, ..Root::at(t) });
            }
            found.is_none() && t <= ray.t_max
        });
        found
    }

    /// Every crossing in the ray's range, appended in ascending order.
    pub fn roots(&self, ray: &Ray, out: &mut Roots) {
        let Some(line) = self.line(ray) else {
            return;
        };
        self.crossings(&line, ray.t_min, |s, multiplicity| {
            let t = line.t(s);
            if ray.contains(t) && t.is_finite() {
                out.push(Root { multiplicity, ..Root::at(t) });
            }
            t <= ray.t_max
        });
    }

    /// Always true: a spindle is even-odd.
    pub fn is_solid(&self) -> bool {
        true
    }

    /// Whether the closed solid contains `p`.
    pub fn contains(&self, p: DVec3) -> bool {
        let p = self.framed(p - self.center);
        let (outer, inner) = self.factors(p.x.hypotenuse(p.y), p.z);
        outer <= 0.0 && (self.is_ring() || inner >= 0.0)
    }

    /// "torus".
    pub fn name(&self) -> &'static str {
        "torus"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hits(torus: &Torus, origin: [f64; 3], direction: [f64; 3]) -> Vec<(f64, u8)> {
        let ray = Ray::new(DVec3::from(origin), DVec3::from(direction)).with_range(-1e9, 1e9);
        let mut roots = Roots::new();
        torus.roots(&ray, &mut roots);
        roots.iter().map(|r| (r.t, r.multiplicity)).collect()
    }

    #[track_caller]
    fn agree(found: &[(f64, u8)], expected: &[(f64, u8)]) {
        assert_eq!(found.len(), expected.len(), "{found:?} {expected:?}");
        for (f, e) in found.iter().zip(expected) {
            assert!((f.0 - e.0).abs() < 1e-6 && f.1 == e.1, "{found:?} {expected:?}");
        }
    }

    #[test]
    fn multiple_roots_come_with_their_multiplicity() {
        let ring = Torus::new(DVec3::ZERO, DVec3::Z, 3.0, 1.0).unwrap();
        let inside = 2.0 * 3f64.sqrt();
        agree(&hits(&ring, [4.0, -5.0, 0.0], [0.0, 1.0, 0.0]), &[(5.0, 2)]);
        agree(
            &hits(&ring, [2.0, -5.0, 0.0], [0.0, 1.0, 0.0]),
            &[(5.0 - inside, 1), (5.0, 2), (5.0 + inside, 1)],
        );
        agree(&hits(&ring, [-5.0, 0.0, 1.0], [1.0, 0.0, 0.0]), &[(2.0, 2), (8.0, 2)]);
        agree(&hits(&ring, [3.0, -5.0, 1.0], [0.0, 1.0, 0.0]), &[(5.0, 4)]);
        let bitangent = Torus::new(DVec3::ZERO, DVec3::Z, 5.0, 3.0).unwrap();
        agree(&hits(&bitangent, [-8.0, 0.0, -6.0], [4.0, 0.0, 3.0]), &[(1.2, 2), (2.8, 2)]);
    }

    #[test]
    fn the_same_multiple_roots_come_out_wherever_the_torus_stands() {
        let (center, axis) = (DVec3::new(1.5, -2.25, 7.0), DVec3::new(2.0, -1.0, 3.0));
        let moved = Torus::new(center, axis, 3.0, 1.0).unwrap();
        let place = |v: [f64; 3]| v[0] * moved.e1 + v[1] * moved.e2 + v[2] * moved.axis;
        let line = |origin: [f64; 3], direction: [f64; 3]| {
            hits(&moved, (center + place(origin)).to_array(), place(direction).to_array())
        };
        agree(&line([-5.0, 0.0, 1.0], [1.0, 0.0, 0.0]), &[(2.0, 2), (8.0, 2)]);
        let inside = 2.0 * 3f64.sqrt();
        agree(&line([2.0, -5.0, 0.0], [0.0, 1.0, 0.0]), &[(5.0 - inside, 1), (5.0, 2), (5.0 + inside, 1)]);
    }

    #[test]
    fn horn_and_spindle_tori_have_all_crossings() {
        let horn = Torus::new(DVec3::ZERO, DVec3::Z, 1.0, 1.0).unwrap();
        agree(&hits(&horn, [-3.0, 0.0, 0.0], [1.0, 0.0, 0.0]), &[(1.0, 1), (3.0, 2), (5.0, 1)]);
        let spindle = Torus::new(DVec3::ZERO, DVec3::Z, 1.0, 2.0).unwrap();
        agree(&hits(&spindle, [-5.0, 0.0, 0.0], [1.0, 0.0, 0.0]), &[(2.0, 1), (4.0, 1), (6.0, 1), (8.0, 1)]);
        let ray = Ray::new(DVec3::new(-5.0, 0.0, 0.0), DVec3::X);
        let at = |t: f64| spindle.surface(&ray, &Root::at(t));
        for (t, x) in [(2.0, -1.0), (4.0, 1.0), (6.0, -1.0), (8.0, 1.0)] {
            assert!((at(t).normal - x * DVec3::X).length() < 1e-15);
            assert!((spindle.surface_at(0, at(t).uv).unwrap().point - ray.at(t)).length() < 1e-14);
        }
    }

    #[test]
    fn rays_that_are_none_miss() {
        let ring = Torus::new(DVec3::ONE, DVec3::Y, 3.0, 1.0).unwrap();
        assert!(ring.closest(&Ray::new(DVec3::ONE, DVec3::ZERO)).is_none());
        assert!(ring.closest(&Ray::new(DVec3::new(f64::NAN, 0.0, 0.0), DVec3::X)).is_none());
        assert!(ring.closest(&Ray::new(DVec3::ZERO, DVec3::new(1.0, f64::NAN, 0.0))).is_none());
        assert!(ring.closest(&Ray::new(DVec3::ZERO, DVec3::X).with_range(f64::NAN, 9.0)).is_none());
        assert!(ring.closest(&Ray::new(DVec3::ZERO, DVec3::X).with_range(9.0, 0.1)).is_none());
        assert!(ring.closest(&Ray::new(DVec3::ZERO, DVec3::X)).is_some());
    }
}
