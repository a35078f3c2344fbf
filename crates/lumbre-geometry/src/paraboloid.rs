//! Paraboloids of revolution.

use std::f64::consts::TAU;

use lumbre_math::roots::roots_between;
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

/// The surface `z = zmax (x² + y²)/radius²` between two heights: a bowl, open upwards, with the given radius at
/// `zmax`.
///
/// As in pbrt-v3: `u` is the azimuth over `phimax`, `v` the height as a fraction from `zmin` to `zmax`, and the
/// normal points out of the bowl, downwards at its bottom.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Paraboloid {
    // z = bend (x² + y²), bend > 0: z_max / radius², rounded.
    bend: f64,
    pub(crate) radius: f64,
    pub(crate) z_min: f64,
    pub(crate) z_max: f64,
    pub(crate) phi_max: f64,
}

impl Paraboloid {
    /// The bowl with a rim of `radius` at the greater of the two heights, down to the lesser, with azimuth up
    /// to `phimax` degrees.
    ///
    /// # Errors
    /// [`ShapeError`] unless the heights are finite, different, and the greater one above 0, `radius` is
    /// greater than 0 and `phimax` in (0, 360].
    pub fn new(radius: f64, zmin: f64, zmax: f64, phimax: f64) -> Result<Self, ShapeError> {
        let radius = check::positive("radius", radius)?;
        let zmin = check::within("zmin", zmin, zmin.is_finite(), "a finite number")?;
        let zmax = check::within("zmax", zmax, zmax.is_finite(), "a finite number")?;
        let phi_max = check::sweep(phimax)?;
        let (z_min, z_max) = (zmin.min(zmax), zmin.max(zmax));
        let z_max = check::positive("zmax", z_max)?;
        let bend = z_max / radius / radius;
        if z_min == z_max || !bend.is_normal() {
            return Err(ShapeError::Degenerate("nothing of the paraboloid lies between zmin and zmax"));
        }
        let paraboloid = Self { bend, radius, z_min, z_max, phi_max };
        if !paraboloid.area().is_normal() {
            return Err(ShapeError::Degenerate("the paraboloid is too large or too small to have an area"));
        }
        Ok(paraboloid)
    }

    /// The lowest height of the surface, at least 0.
    fn bottom(&self) -> f64 {
        self.z_min.max(0.0)
    }

    fn radius_at(&self, z: f64) -> f64 {
        (z / self.bend).sqrt()
    }

    pub(crate) fn keeps(&self, p: DVec3) -> bool {
        let is_bottom = self.z_min <= 0.0;
        (is_bottom || self.z_min <= p.z)
            && p.z <= self.z_max
            && (self.phi_max >= TAU || azimuth(p.y, p.x) <= self.phi_max)
    }

    /// The first crossing in the ray's range.
    pub fn closest(&self, ray: &Ray) -> Option<Root> {
        accepted(ray, DVec3::ZERO, crossings(self, ray), |p| self.keeps(p)).next()
    }

    /// Every crossing in the ray's range, appended in ascending order.
    pub fn roots(&self, ray: &Ray, out: &mut Roots) {
        out.extend(accepted(ray, DVec3::ZERO, crossings(self, ray), |p| self.keeps(p)));
    }

    fn implicit(&self, p: DVec3) -> Implicit {
        let round = self.bend * (p.x * p.x + p.y * p.y);
        Implicit {
            value: round - p.z,
            gradient: DVec3::new(2.0 * self.bend * p.x, 2.0 * self.bend * p.y, -1.0),
            terms: round + p.z.abs(),
        }
    }

    /// The surface at a crossing.
    pub fn surface(&self, ray: &Ray, root: &Root) -> Surface {
        let size = |p| 0.5 * length(self.implicit(p).gradient) / self.bend;
        let near = point_at(self, ray, root.t, size);
        let surface = self.surface_on(near + self.implicit(near).to_surface());
        Surface { normal: sided_gradient(self, surface.normal, ray, root.t), ..surface }
    }

    /// The surface at `uv`; `None` below z = 0.
    pub fn surface_at(&self, part: u32, uv: DVec2) -> Option<Surface> {
        let z = self.z_min + uv.y * (self.z_max - self.z_min);
        if part != 0 || z < 0.0 {
            return None;
        }
        let round = self.radius_at(z) * direction_at(self.phi_max * uv.x);
        Some(Surface { uv, ..self.surface_on(round.extend(z)) })
    }

    fn surface_on(&self, p: DVec3) -> Surface {
        let implicit = self.implicit(p);
        let height = self.z_max - self.z_min;
        let phi = azimuth(p.y, p.x);
        // At the bottom any meridian will do, but none has a finite derivative by height: use a point nearby.
        let floor = 1e-10 * self.radius_at(self.z_max);
        let rho = p.x.hypotenuse(p.y);
        let round = if rho > floor { DVec2::new(p.x, p.y) } else { floor * direction_at(phi) };
        let dpdu = self.phi_max * DVec3::new(-round.y, round.x, 0.0);
        let rise = 0.5 / (self.bend * round.length_squared());
        let dpdv = height * DVec3::new(rise * round.x, rise * round.y, 1.0);
        let bend =
            |dp: DVec3| implicit.turning(DVec3::new(2.0 * self.bend * dp.x, 2.0 * self.bend * dp.y, 0.0));
        Surface {
            point: p,
            // The next ray's crossing has an error relative to the whole bowl.
            point_error: DVec3::splat(
                gamma(16) * self.z_max.max(self.radius_at(self.z_max)) + implicit.uncertainty(),
            ),
            normal: implicit.normal(),
            uv: DVec2::new((phi / self.phi_max).min(1.0), ((p.z - self.z_min) / height).clamp(0.0, 1.0)),
            dpdu,
            dpdv,
            dndu: bend(dpdu),
            dndv: bend(dpdv),
        }
    }

    /// The tight bounding box under a transform.
    pub fn bounds(&self, world_from_object: &Transform) -> Option<Aabb> {
        let (inner, outer) = (self.radius_at(self.bottom()), self.radius_at(self.z_max));
        let support = |d: DVec3| {
            let outward = arc_support(d.x, d.y, 0.0, self.phi_max);
            // A parabola in the radius.
            let at = |rho: f64| outward * rho + d.z * self.bend * rho * rho;
            let ends = at(inner).max(at(outer));
            let turn = -0.5 * outward / (self.bend * d.z);
            if inner < turn && turn < outer { ends.max(at(turn)) } else { ends }
        };
        Some(bounds_from_support(world_from_object, DVec3::new(outer, outer, self.z_max), support))
    }

    /// A bounding volume: the filled bowl.
    pub fn bounding_volume(&self) -> Option<BoundingVolume> {
        let (low, high) = (self.bottom(), self.z_max);
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
        let radius = self.radius_at(high);
        let axes = DMat3::from_diagonal(DVec3::new(radius, radius, half));
        let profile = [0.0, -half / high, -middle / high];
        Some(BoundingVolume::new(DVec3::new(0.0, 0.0, middle), axes, profile, false))
    }

    /// √(1 + 4 bend z) at the two ends, from which areas are computed.
    fn slants(&self) -> (f64, f64) {
        let slant = |z: f64| (1.0 + 4.0 * self.bend * z).sqrt();
        (slant(self.bottom()), slant(self.z_max))
    }

    /// The area: phimax (B³ - A³)/(12 bend²) with the slants A and B, arranged so that a flat bowl does not
    /// cancel.
    pub fn area(&self) -> f64 {
        let (a, b) = self.slants();
        let height = self.z_max - self.bottom();
        self.phi_max * height / (3.0 * self.bend) * (a * a + a * b + b * b) / (a + b)
    }

    /// The area after a transform, by quadrature.
    pub fn area_under(&self, world_from_object: &Transform) -> f64 {
        let (inner, outer) = (self.radius_at(self.bottom()), self.radius_at(self.z_max));
        measure::patch_area(world_from_object, |u, v| {
            let rho = inner + v * (outer - inner);
            let round = 2.0 * self.bend * rho * direction_at(self.phi_max * u);
            self.phi_max * (outer - inner) * rho * round.extend(-1.0)
        })
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
            let meridian = Meridian::new(p, self.phi_max);
            let (inner, rim) = (self.radius_at(self.bottom()), self.radius_at(self.z_max));
            // Zeros of the derivative of the squared distance along the parabola, in units of the rim's radius.
            let square = self.bend * rim * self.bend * rim;
            let slope = [-meridian.x / rim, 1.0 - 2.0 * self.bend * meridian.z, 0.0, 2.0 * square];
            let inside = roots_between(&slope, inner / rim, 1.0);
            let places = inside.iter().map(|s| (s * rim).clamp(inner, rim)).chain([rim]);
            let height = |r: f64| (self.bend * r * r).clamp(self.bottom(), self.z_max);
            let distance = |r: f64| meridian.distance(r, height(r));
            let r = places.fold(inner, |best, r| if distance(r) < distance(best) { r } else { best });
            let point = (r * meridian.outward).extend(height(r));
            let v = (height(r) - self.z_min) / (self.z_max - self.z_min);
            let uv = DVec2::new((meridian.phi / self.phi_max).min(1.0), v);
            NearestPoint { point, distance: distance(r), part: 0, uv }
        })
    }

    /// "paraboloid".
    pub fn name(&self) -> &'static str {
        "paraboloid"
    }

    /// A point uniform by area: the cube of the slant is uniform.
    pub fn sample_area(&self, u: DVec2) -> Option<SurfaceSample> {
        let (a, b) = self.slants();
        let c = (a * a * a + u.y * (b * b * b - a * a * a)).cube_root();
        // z - bottom = (c² - a²)/(4 bend), without cancellation.
        let shares = (a * a + a * b + b * b) * (c + a) / ((a + b) * (c * c + c * a + a * a));
        let z = (self.bottom() + u.y * (self.z_max - self.bottom()) * shares).min(self.z_max);
        let round = self.radius_at(z) * direction_at(self.phi_max * u.x);
        Some(SurfaceSample { surface: self.surface_on(round.extend(z)), pdf: 1.0 / self.area() })
    }

    sampled_by_area!(pub);
}

impl SecondDegree for Paraboloid {
    fn base(&self) -> DVec3 {
        DVec3::ZERO
    }

    fn center(&self) -> DVec3 {
        DVec3::new(0.0, 0.0, 0.5 * (self.bottom() + self.z_max))
    }

    /// Of z_max (x² + y²) - radius² z, which the given numbers make without rounding.
    #[inline]
    fn along<N: Number>(&self, p: [N; 3], d: [N; 3]) -> [N; 3] {
        let (rim, square) = (N::from(self.z_max), N::from(self.radius) * N::from(self.radius));
        let flat = |a: [N; 3], b: [N; 3]| rim * (a[0] * b[0] + a[1] * b[1]);
        let half = N::from(0.5) * square;
        [flat(d, d), flat(p, d) - half * d[2], flat(p, p) - square * p[2]]
    }
}
