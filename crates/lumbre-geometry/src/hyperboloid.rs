//! Hyperboloids of one sheet: a segment revolved about an axis.

use std::f64::consts::TAU;

use lumbre_math::roots::{bracketed_root, roots_between};
use lumbre_math::rounding::gamma;
use lumbre_math::{DMat3, DVec2, DVec3, Elementary, Transform, direction_at};

use crate::line::{Implicit, SecondDegree, accepted, crossings, point_at, sided_gradient};
use crate::nearest::{Meridian, under_similarity};
use crate::shape::{check, open_surface, sampled_by_area};
use crate::support::{arc_support, azimuth, bounds_from_support, length};
use crate::twofold::Number;
use crate::{
    Aabb, BoundingVolume, NearestPoint, NearestPointError, Ray, Root, Roots, ShapeError, Surface,
    SurfaceSample, measure,
};

/// The surface that the segment from `p1` to `p2` sweeps about the z axis.
///
/// As in pbrt-v3: `u` is the angle of rotation over `phimax`, `v` runs along the segment from `p1` to `p2`, and
/// the normal is along ∂p/∂u × ∂p/∂v: away from the axis when `p2` is the higher end, towards it when `p1` is.
/// Cylinders and cones are special cases. Ends at the same height are refused: that is a disk.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hyperboloid {
    pub(crate) p1: DVec3,
    pub(crate) p2: DVec3,
    // From p1 to p2, rounded; its z is not 0.
    along: DVec3,
    pub(crate) phi_max: f64,
    // The squared radius at v is start + 2 middle v + end v².
    start: f64,
    middle: f64,
    end: f64,
}

impl Hyperboloid {
    /// The surface swept by the segment from `p1` to `p2` through `phimax` degrees, x towards y.
    ///
    /// # Errors
    /// [`ShapeError`] unless the ends are finite, at different heights, not both on the axis, and `phimax` is
    /// in (0, 360]; and when the fourth powers of its lengths over- or underflow.
    pub fn new(p1: DVec3, p2: DVec3, phimax: f64) -> Result<Self, ShapeError> {
        let p1 = check::finite("p1", p1)?;
        let p2 = check::finite("p2", p2)?;
        let phi_max = check::sweep(phimax)?;
        let along = p2 - p1;
        if along.z == 0.0 || !along.is_finite() {
            return Err(ShapeError::Degenerate(
                "p1 and p2 of the hyperboloid are at the same height: what they sweep is a disk",
            ));
        }
        let (flat, flat_along) = (p1.truncate(), along.truncate());
        if flat == DVec2::ZERO && flat_along == DVec2::ZERO {
            return Err(ShapeError::Degenerate("p1 and p2 of the hyperboloid are both on the axis"));
        }
        let (start, middle, end) = (flat.length_squared(), flat.dot(flat_along), flat_along.length_squared());
        let hyperboloid = Self { p1, p2, along, phi_max, start, middle, end };
        let (square, _, constant) = hyperboloid.element();
        let is_measurable = square.is_finite() && constant.is_finite() && square.max(constant).is_normal();
        if !is_measurable {
            return Err(ShapeError::Degenerate("the hyperboloid is too large or too small to have an area"));
        }
        Ok(hyperboloid)
    }

    /// The segment's point at `v`, before rotation.
    fn segment(&self, v: f64) -> DVec3 {
        self.p1 + v * self.along
    }

    pub(crate) fn v_of(&self, z: f64) -> f64 {
        (z - self.p1.z) / self.along.z
    }

    /// The cosine and sine of the rotation that takes the segment through `p`.
    pub(crate) fn turn(&self, p: DVec3) -> DVec2 {
        let q = self.segment(self.v_of(p.z));
        let turn = DVec2::new(p.x * q.x + p.y * q.y, p.y * q.x - p.x * q.y);
        // Where the segment meets the axis, any angle will do.
        turn.try_normalize().unwrap_or(DVec2::X)
    }

    pub(crate) fn keeps(&self, p: DVec3) -> bool {
        let v = self.v_of(p.z);
        let turn = self.turn(p);
        (0.0..=1.0).contains(&v) && (self.phi_max >= TAU || azimuth(turn.y, turn.x) <= self.phi_max)
    }

    /// The first crossing in the ray's range.
    pub fn closest(&self, ray: &Ray) -> Option<Root> {
        let base = self.base();
        accepted(ray, base, crossings(self, ray), |p| self.keeps(base + p)).next()
    }

    /// Every crossing in the ray's range, appended in ascending order.
    pub fn roots(&self, ray: &Ray, out: &mut Roots) {
        let base = self.base();
        out.extend(accepted(ray, base, crossings(self, ray), |p| self.keeps(base + p)));
    }

    fn implicit(&self, p: DVec3) -> Implicit {
        let v = self.v_of(p.z);
        let swept = self.segment(v).truncate().length();
        let rho = p.truncate().length();
        let spread = (self.middle + self.end * v) / self.along.z;
        Implicit {
            value: (rho - swept) * (rho + swept),
            gradient: 2.0 * DVec3::new(p.x, p.y, -spread),
            terms: rho * rho + swept * swept + (spread * p.z).abs() + (spread * self.p1.z).abs(),
        }
    }

    /// The surface at a crossing.
    pub fn surface(&self, ray: &Ray, root: &Root) -> Surface {
        let steepness = (self.end / (self.along.z * self.along.z)).max(1.0);
        let size = |p| 0.5 * length(self.implicit(self.base() + p).gradient) / steepness;
        let near = self.base() + point_at(self, ray, root.t, size);
        let surface = self.surface_on(near + self.implicit(near).to_surface());
        let side = self.along.z.signum();
        Surface { normal: side * sided_gradient(self, side * surface.normal, ray, root.t), ..surface }
    }

    /// The nearest point of the arc that the segment's point at `v` sweeps.
    fn nearest_at(&self, p: DVec3, v: f64) -> NearestPoint {
        let q = self.segment(v);
        let start = azimuth(q.y, q.x);
        // In the frame rotated to the beginning of the sweep.
        let flat = direction_at(-start).rotate(p.truncate());
        let meridian = Meridian::new(flat.extend(p.z), self.phi_max);
        let r = q.truncate().length();
        let outward = direction_at(start).rotate(meridian.outward);
        NearestPoint {
            point: (r * outward).extend(q.z),
            distance: meridian.distance(r, q.z),
            part: 0,
            uv: DVec2::new((meridian.phi / self.phi_max).min(1.0), v),
        }
    }

    /// The surface at `uv`.
    pub fn surface_at(&self, part: u32, uv: DVec2) -> Option<Surface> {
        (part == 0).then(|| Surface { uv, ..self.surface_on(self.point_at(uv)) })
    }

    fn point_at(&self, uv: DVec2) -> DVec3 {
        let q = self.segment(uv.y);
        direction_at(self.phi_max * uv.x).rotate(q.truncate()).extend(q.z)
    }

    fn surface_on(&self, p: DVec3) -> Surface {
        let implicit = self.implicit(p);
        let side = self.along.z.signum();
        let turn = self.turn(p);
        let dpdu = self.phi_max * DVec3::new(-p.y, p.x, 0.0);
        let dpdv = turn.rotate(self.along.truncate()).extend(self.along.z);
        let flatness = self.end / (self.along.z * self.along.z);
        let bend = |dp: DVec3| side * implicit.turning(2.0 * DVec3::new(dp.x, dp.y, -flatness * dp.z));
        let size = p.abs() + self.p1.abs() + self.along.abs();
        Surface {
            point: p,
            // The next ray's crossing has an error relative to the whole surface.
            point_error: DVec3::splat(gamma(16) * size.max_element() + implicit.uncertainty()),
            normal: side * implicit.normal(),
            uv: DVec2::new((azimuth(turn.y, turn.x) / self.phi_max).min(1.0), self.v_of(p.z).clamp(0.0, 1.0)),
            dpdu,
            dpdv,
            dndu: bend(dpdu),
            dndv: bend(dpdv),
        }
    }

    /// The tight bounding box under a transform: at every angle the segment's extreme point is an end.
    pub fn bounds(&self, world_from_object: &Transform) -> Option<Aabb> {
        let ends = [self.p1, self.p1 + self.along];
        let support = |d: DVec3| {
            let circle = |q: DVec3| {
                let (straight, across) = (d.x * q.x + d.y * q.y, d.y * q.x - d.x * q.y);
                arc_support(straight, across, 0.0, self.phi_max) + d.z * q.z
            };
            circle(ends[0]).max(circle(ends[1]))
        };
        let radius = ends[0].truncate().length().max(ends[1].truncate().length());
        let height = ends[0].z.abs().max(ends[1].z.abs());
        Some(bounds_from_support(world_from_object, DVec3::new(radius, radius, height), support))
    }

    /// A bounding volume: the solid between its rims.
    pub fn bounding_volume(&self) -> Option<BoundingVolume> {
        let p2 = self.p1 + self.along;
        let radius = self.p1.truncate().length().max(p2.truncate().length());
        let axes = DMat3::from_diagonal(DVec3::new(radius, radius, 0.5 * self.along.z));
        let center = DVec3::new(0.0, 0.0, 0.5 * (self.p1.z + p2.z));
        // v = (1 + z) / 2.
        let square = radius * radius;
        let profile = [
            -0.25 * self.end / square,
            -(self.middle + 0.5 * self.end) / square,
            -(self.start + self.middle + 0.25 * self.end) / square,
        ];
        Some(BoundingVolume::new(center, axes, profile, false))
    }

    /// The coefficients of the area element √(square v² + 2 linear v + constant) dφ dv.
    fn element(&self) -> (f64, f64, f64) {
        let climb = self.along.z * self.along.z;
        (
            self.end * (self.end + climb),
            self.middle * (self.end + climb),
            self.middle * self.middle + climb * self.start,
        )
    }

    /// The integral of the area element from the segment's start to `v`, per radian, and its derivative.
    fn swept(&self, v: f64) -> (f64, f64) {
        let (square, linear, constant) = self.element();
        let element = |v: f64| ((square * v + 2.0 * linear) * v + constant).max(0.0).sqrt();
        if square <= 1e-4 * constant {
            // Nearly a cylinder: the closed form would cancel, and quadrature is accurate.
            return (measure::integrate(0.0, v, element), element(v));
        }
        let offset = linear / square;
        let root = square.sqrt();
        // With w = v + offset, the element is √(square w² + rest).
        let rest = (constant - linear * offset).max(0.0);
        let antiderivative = |w: f64| {
            let curved = if rest > 0.0 {
                0.5 * rest / root * (w * root / rest.sqrt()).inverse_hyperbolic_sine()
            } else {
                0.0
            };
            0.5 * w * (square * w * w + rest).sqrt() + curved
        };
        (antiderivative(v + offset) - antiderivative(offset), element(v))
    }

    /// The area.
    pub fn area(&self) -> f64 {
        self.phi_max * self.swept(1.0).0
    }

    /// The area after a transform, by quadrature.
    pub fn area_under(&self, world_from_object: &Transform) -> f64 {
        let along = self.along;
        // A segment through the axis has a kink there.
        let split = (-self.middle / self.end).clamp(0.0, 1.0);
        let split = if split.is_nan() { 0.0 } else { split };
        let piece = |(from, to): (f64, f64)| {
            if to <= from {
                return 0.0;
            }
            measure::patch_area(world_from_object, |u, v| {
                let v = from + v * (to - from);
                let turn = direction_at(self.phi_max * u);
                let (q, slant) = (turn.rotate(self.segment(v).truncate()), turn.rotate(along.truncate()));
                let dpdu = DVec3::new(-q.y, q.x, 0.0);
                self.phi_max * (to - from) * dpdu.cross(slant.extend(along.z))
            })
        };
        piece((0.0, split)) + piece((split, 1.0))
    }

    open_surface!();

    /// The nearest point to `p` under a similarity.
    ///
    /// # Errors
    /// [`NearestPointError::Map`] for other maps.
    pub fn closest_point(
        &self,
        world_from_object: &Transform,
        p: DVec3,
    ) -> Result<NearestPoint, NearestPointError> {
        under_similarity(world_from_object, p, |p| {
            let mut best = self.nearest_at(p, 0.0);
            let mut take = |v: f64| best = best.or_nearer(self.nearest_at(p, v));
            take(1.0);
            // Zeros of the derivative of the squared distance along the segment, rotated towards the point:
            // with r² = start + 2 middle v + end v² and the point at (x, z), (middle + end v)(1 - x/r) + (z of
            // v - z) dz/dv = 0.
            let x = p.truncate().length();
            let rise = self.along.z;
            let line = [self.middle + rise * (self.p1.z - p.z), self.end + rise * rise];
            let square = [line[0] * line[0], 2.0 * line[0] * line[1], line[1] * line[1]];
            let radius = [self.start, 2.0 * self.middle, self.end];
            let spread = [self.middle * self.middle, 2.0 * self.middle * self.end, self.end * self.end];
            let mut slope = [0.0; 5];
            for i in 0..3 {
                slope[i] -= x * x * spread[i];
                for j in 0..3 {
                    slope[i + j] += square[i] * radius[j];
                }
            }
            let on_axis = [-line[0] / line[1], -self.middle / self.end];
            for v in roots_between(&slope, 0.0, 1.0).iter().copied().chain(on_axis) {
                let mut v = v;
                // Newton steps, since the polynomial is inaccurate near the axis.
                for _ in 0..3 {
                    let r = (radius[0] + v * (radius[1] + v * radius[2])).sqrt();
                    let half_spread = self.middle + self.end * v;
                    let first = line[0] + line[1] * v - x * half_spread / r;
                    let second = line[1] - x * (self.end / r - half_spread * half_spread / (r * r * r));
                    let next = v - first / second;
                    let is_step = (next - v).abs() < 1e-3;
                    if !is_step {
                        break;
                    }
                    v = next;
                }
                if v.is_finite() {
                    take(v.clamp(0.0, 1.0));
                }
            }
            if self.phi_max < TAU {
                // The segment at both ends of the sweep.
                for phi in [0.0, self.phi_max] {
                    let turn = direction_at(phi);
                    let start = turn.rotate(self.p1.truncate()).extend(self.p1.z);
                    let along = turn.rotate(self.along.truncate()).extend(self.along.z);
                    let v = ((p - start).dot(along) / along.length_squared()).clamp(0.0, 1.0);
                    let point = start + v * along;
                    let uv = DVec2::new(phi / self.phi_max, v);
                    best =
                        best.or_nearer(NearestPoint { point, distance: (p - point).length(), part: 0, uv });
                }
            }
            best
        })
    }

    /// "hyperboloid".
    pub fn name(&self) -> &'static str {
        "hyperboloid"
    }

    /// A point uniform by area: the swept area is inverted numerically.
    pub fn sample_area(&self, u: DVec2) -> Option<SurfaceSample> {
        let total = self.swept(1.0).0;
        let goal = u.y * total;
        let v = bracketed_root(0.0, 1.0, u.y, true, |v| {
            let (value, slope) = self.swept(v);
            (value - goal, slope)
        });
        let surface = self.surface_on(self.point_at(DVec2::new(u.x, v)));
        Some(SurfaceSample { surface, pdf: 1.0 / (self.phi_max * total) })
    }

    sampled_by_area!(pub);
}

impl SecondDegree for Hyperboloid {
    fn base(&self) -> DVec3 {
        DVec3::new(0.0, 0.0, self.p1.z)
    }

    fn center(&self) -> DVec3 {
        DVec3::new(0.0, 0.0, self.p1.z + 0.5 * self.along.z)
    }

    /// Of (L ρ)² - |L p1 + z A|², where L is the segment's height, A its extent along x and y, and z counts from p1.
    #[inline]
    fn along<N: Number>(&self, p: [N; 3], d: [N; 3]) -> [N; 3] {
        let [ax, ay, rise] = std::array::from_fn(|i| N::difference(self.p2[i], self.p1[i]));
        let reach = [rise * N::from(self.p1.x) + p[2] * ax, rise * N::from(self.p1.y) + p[2] * ay];
        let growth = [d[2] * ax, d[2] * ay];
        let flat = |a: &[N], b: &[N]| a[0] * b[0] + a[1] * b[1];
        let square = rise * rise;
        [
            square * flat(&d, &d) - flat(&growth, &growth),
            square * flat(&p, &d) - flat(&reach, &growth),
            square * flat(&p, &p) - flat(&reach, &reach),
        ]
    }
}
