//! Spheres, and parts of them between two heights and two meridians.

use std::f64::consts::{PI, TAU};

use lumbre_math::quadratic::quadratic;
use lumbre_math::rounding::gamma;
use lumbre_math::{DMat3, DVec2, DVec3, Elementary, Transform, orthonormal_basis, warp64};

use crate::line::{Solution, is_blurred};
use crate::nearest::{Meridian, nearest_on_ellipsoid, similarity_factor, under_similarity};
use crate::shape::check;
use crate::support::{arc_support, azimuth, bounds_from_support, length, on_side_of, unit};
use crate::twofold::{Twofold, dot, place_near, point};
use crate::{
    Aabb, BoundingVolume, DirectionSample, NearestPoint, NearestPointError, Ray, Root, Roots, ShapeError,
    Surface, SurfaceSample, density, measure,
};

/// The points at distance `radius` from `center`.
///
/// Parametrised as in pbrt: `u` is the azimuth about z from x towards y over `phimax`, and `v` is the polar
/// angle, 0 at the low end and 1 at the high end. A clipped sphere is an open surface, so a ray can hit its
/// inside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    center: DVec3,
    radius: f64,
    // Relative to the centre, -radius <= z_min < z_max <= radius.
    pub(crate) z_min: f64,
    pub(crate) z_max: f64,
    // Angles from +z of z_min and z_max: theta_min > theta_max.
    theta_min: f64,
    theta_max: f64,
    pub(crate) phi_max: f64,
}

impl Sphere {
    /// The whole sphere.
    ///
    /// # Errors
    /// [`ShapeError`] unless the centre is finite and the radius finite and greater than 0.
    pub fn new(center: DVec3, radius: f64) -> Result<Self, ShapeError> {
        let center = check::finite("center", center)?;
        let radius = check::positive("radius", radius)?;
        let (z_min, z_max) = (-radius, radius);
        Ok(Self { center, radius, z_min, z_max, theta_min: PI, theta_max: 0.0, phi_max: TAU })
    }

    /// The part with `zmin <= z <= zmax`, measured from the centre, and azimuth up to `phimax` degrees.
    ///
    /// Heights are clamped to the poles, and come in either order, as in pbrt.
    ///
    /// # Errors
    /// [`ShapeError`] when nothing is left, a height is NaN, or `phimax` is not in (0, 360].
    pub fn partial(self, zmin: f64, zmax: f64, phimax: f64) -> Result<Self, ShapeError> {
        let any = "a number";
        let zmin = check::within("zmin", zmin, !zmin.is_nan(), any)?;
        let zmax = check::within("zmax", zmax, !zmax.is_nan(), any)?;
        let phi_max = check::sweep(phimax)?;
        let z_min = zmin.min(zmax).clamp(-self.radius, self.radius);
        let z_max = zmin.max(zmax).clamp(-self.radius, self.radius);
        if z_min == z_max {
            return Err(ShapeError::Degenerate("nothing of the sphere lies between zmin and zmax"));
        }
        let theta = |z: f64| ((self.radius - z) * (self.radius + z)).sqrt().angle_from(z);
        Ok(Self { z_min, z_max, theta_min: theta(z_min), theta_max: theta(z_max), phi_max, ..self })
    }

    /// The centre.
    pub fn center(&self) -> DVec3 {
        self.center
    }

    /// The radius.
    pub fn radius(&self) -> f64 {
        self.radius
    }

    pub(crate) fn is_whole(&self) -> bool {
        self.z_min <= -self.radius && self.z_max >= self.radius && self.phi_max >= TAU
    }

    /// Whether a point of the whole sphere, relative to the centre, belongs to this part.
    pub(crate) fn keeps(&self, w: DVec3) -> bool {
        // A pole's computed height may lie slightly inside the pole.
        (self.z_min <= -self.radius || self.z_min <= w.z)
            && (self.z_max >= self.radius || w.z <= self.z_max)
            && (self.phi_max >= TAU || azimuth(w.y, w.x) <= self.phi_max)
    }

    #[inline]
    fn crossings(&self, ray: &Ray) -> Option<(f64, f64)> {
        crossings(self.center, self.radius, ray)
    }

    pub(crate) fn arm(&self, ray: &Ray, t: f64) -> DVec3 {
        arm(self.center, self.radius, ray, t)
    }

    /// The point of the whole sphere in the direction of `w`, both relative to the centre.
    fn radial(&self, w: DVec3) -> DVec3 {
        let largest = w.abs().max_element();
        if largest == 0.0 {
            return DVec3::new(0.0, 0.0, self.radius);
        }
        let w = w / largest;
        w * (self.radius / w.length())
    }

    /// The first crossing in the ray's range.
    #[inline]
    pub fn closest(&self, ray: &Ray) -> Option<Root> {
        let (first, second) = self.crossings(ray)?;
        let hits =
            |t: f64| t.is_finite() && ray.contains(t) && (self.is_whole() || self.keeps(self.arm(ray, t)));
        let t = if hits(first) {
            first
        } else if hits(second) {
            second
        } else {
            return None;
        };
        Some(Root { multiplicity: 1 + u8::from(first == second), ..Root::at(t) })
    }

    /// Every crossing in the ray's range, appended in ascending order.
    pub fn roots(&self, ray: &Ray, out: &mut Roots) {
        let Some((first, second)) = self.crossings(ray) else {
            return;
        };
        let hits =
            |t: f64| t.is_finite() && ray.contains(t) && (self.is_whole() || self.keeps(self.arm(ray, t)));
        if first == second {
            out.extend(hits(first).then_some(Root { multiplicity: 2, ..Root::at(first) }));
        } else {
            out.extend([first, second].into_iter().filter(|&t| hits(t)).map(Root::at));
        }
    }

    /// The surface at a crossing.
    pub fn surface(&self, ray: &Ray, root: &Root) -> Surface {
        let surface = self.surface_on(self.arm(ray, root.t));
        Surface { normal: sided(surface.normal, self.crossings(ray), ray, root.t), ..surface }
    }

    /// The surface at `uv`.
    pub fn surface_at(&self, part: u32, uv: DVec2) -> Option<Surface> {
        let (phi_sin, phi_cos) = (uv.x * self.phi_max).sine_cosine();
        let (sin, cos) = (self.theta_min + uv.y * (self.theta_max - self.theta_min)).sine_cosine();
        let w = self.radius * DVec3::new(sin * phi_cos, sin * phi_sin, cos);
        (part == 0).then(|| Surface { uv, ..self.surface_on(w) })
    }

    /// The surface at a point given relative to the centre.
    fn surface_on(&self, w: DVec3) -> Surface {
        let normal = w / length(w);
        let rho = w.x.hypotenuse(w.y);
        let phi = azimuth(w.y, w.x);
        let v_range = self.theta_max - self.theta_min;
        // At a pole any meridian will do; u is 0 there, on a parallel so small that it is a point.
        let (x, y) = if rho > 0.0 { (w.x, w.y) } else { (1e-10 * self.radius, 0.0) };
        let hypotenuse = x.hypotenuse(y);
        let dpdu = self.phi_max * DVec3::new(-y, x, 0.0);
        let dpdv = v_range * DVec3::new(w.z * x / hypotenuse, w.z * y / hypotenuse, -rho);
        let point = self.center + w;
        Surface {
            point,
            point_error: gamma(8) * w.abs() + gamma(2) * (point.abs() + self.center.abs()),
            normal,
            uv: DVec2::new(
                (phi / self.phi_max).min(1.0),
                ((rho.angle_from(w.z) - self.theta_min) / v_range).clamp(0.0, 1.0),
            ),
            dpdu,
            dpdv,
            dndu: dpdu / self.radius,
            dndv: dpdv / self.radius,
        }
    }

    /// The bounding box under a transform, tight for parts of a sphere too.
    pub fn bounds(&self, world_from_object: &Transform) -> Option<Aabb> {
        let support = |d: DVec3| {
            let from_center = {
                let length = d.length();
                if self.is_whole() || self.keeps(d * (self.radius / length)) {
                    self.radius * length
                } else {
                    // The whole sphere's extreme point is not on this part, so the extreme is on its edge: two
                    // parallels and two meridians.
                    let parallel = |theta: f64| {
                        let (sin, cos) = theta.sine_cosine();
                        self.radius * (sin * arc_support(d.x, d.y, 0.0, self.phi_max) + cos * d.z)
                    };
                    let meridian = |phi: f64| {
                        let outward = d.x * phi.cosine() + d.y * phi.sine();
                        self.radius * arc_support(d.z, outward, self.theta_max, self.theta_min)
                    };
                    let parallels = parallel(self.theta_min).max(parallel(self.theta_max));
                    parallels.max(meridian(0.0)).max(meridian(self.phi_max))
                }
            };
            d.dot(self.center) + from_center
        };
        let magnitude = self.center.abs() + DVec3::splat(self.radius);
        Some(bounds_from_support(world_from_object, magnitude, support))
    }

    /// A bounding volume: the ball, or its layer between two heights.
    pub fn bounding_volume(&self) -> Option<BoundingVolume> {
        if self.is_whole() {
            let axes = DMat3::from_diagonal(DVec3::splat(self.radius));
            return Some(BoundingVolume::new(self.center, axes, BoundingVolume::BALL, true));
        }
        // Relative to the radius, z = middle + half * (z of the bounding volume).
        let (middle, half) =
            (0.5 * (self.z_min + self.z_max) / self.radius, 0.5 * (self.z_max - self.z_min) / self.radius);
        let center = self.center + self.radius * middle * DVec3::Z;
        let axes = DMat3::from_diagonal(self.radius * DVec3::new(1.0, 1.0, half));
        let profile = [half * half, 2.0 * middle * half, middle * middle - 1.0];
        Some(BoundingVolume::new(center, axes, profile, false))
    }

    /// The area: that of the circumscribed cylinder, by Archimedes.
    pub fn area(&self) -> f64 {
        self.phi_max * self.radius * (self.z_max - self.z_min)
    }

    /// The area after a transform: an ellipsoid's by elliptic integrals, a part's by quadrature.
    pub fn area_under(&self, world_from_object: &Transform) -> f64 {
        if self.is_whole() {
            return measure::ellipsoid_area(self.radius, world_from_object);
        }
        measure::patch_area(world_from_object, |u, v| {
            let (phi_sin, phi_cos) = (u * self.phi_max).sine_cosine();
            let (sin, cos) = (self.theta_min + v * (self.theta_max - self.theta_min)).sine_cosine();
            let density = self.radius * self.radius * sin * self.phi_max * (self.theta_min - self.theta_max);
            density * DVec3::new(sin * phi_cos, sin * phi_sin, cos)
        })
    }

    /// Whether it is a whole sphere.
    pub fn is_solid(&self) -> bool {
        self.is_whole()
    }

    /// Whether the ball contains `p`; false for parts of a sphere.
    pub fn contains(&self, p: DVec3) -> bool {
        self.is_whole() && (p - self.center).length() <= self.radius
    }

    /// The nearest point to `p` under any map; of a part of a sphere, under a similarity.
    ///
    /// # Errors
    /// [`NearestPointError::Map`] for a part of a sphere under another map.
    pub fn closest_point(
        &self,
        world_from_object: &Transform,
        p: DVec3,
    ) -> Result<NearestPoint, NearestPointError> {
        if self.is_whole() && !world_from_object.is_identity() {
            // An ellipsoid, or a sphere again.
            let center = world_from_object.point(self.center);
            let w = match similarity_factor(world_from_object) {
                Some(_) => self.radial(world_from_object.inverse_vector(p - center)),
                None => nearest_on_ellipsoid(world_from_object.linear(), self.radius, p - center),
            };
            let arm = world_from_object.vector(w);
            let distance = match similarity_factor(world_from_object) {
                Some(factor) => (factor * self.radius - (p - center).length()).abs(),
                None => (p - center - arm).length(),
            };
            return Ok(NearestPoint { point: center + arm, distance, part: 0, uv: self.surface_on(w).uv });
        }
        under_similarity(world_from_object, p, |p| {
            let from_center = p - self.center;
            let w = if self.is_whole() {
                self.radial(from_center)
            } else {
                let meridian = Meridian::new(from_center, self.phi_max);
                let theta = meridian.x.angle_from(meridian.z);
                let at = |theta: f64, z: f64| {
                    let r = if z.abs() < self.radius { self.radius * theta.sine() } else { 0.0 };
                    (r, z)
                };
                let on_arc = self.theta_max <= theta && theta <= self.theta_min;
                let (r, z) = if on_arc {
                    (self.radius * theta.sine(), self.radius * theta.cosine())
                } else {
                    let (top, bottom) = (at(self.theta_max, self.z_max), at(self.theta_min, self.z_min));
                    let is_top = meridian.distance(top.0, top.1) <= meridian.distance(bottom.0, bottom.1);
                    if is_top { top } else { bottom }
                };
                (r * meridian.outward).extend(z)
            };
            let distance = if self.is_whole() {
                (from_center.length() - self.radius).abs()
            } else {
                (from_center - w).length()
            };
            NearestPoint { point: self.center + w, distance, part: 0, uv: self.surface_on(w).uv }
        })
    }

    /// "sphere".
    pub fn name(&self) -> &'static str {
        "sphere"
    }

    /// A point uniform by area.
    pub fn sample_area(&self, u: DVec2) -> Option<SurfaceSample> {
        let z = (self.z_min + u.x * (self.z_max - self.z_min)).min(self.z_max);
        let rho = ((self.radius - z) * (self.radius + z)).max(0.0).sqrt();
        let (sin, cos) = (u.y * self.phi_max).sine_cosine();
        let w = DVec3::new(rho * cos, rho * sin, z);
        let surface = self.surface_on(w * (self.radius / w.length()));
        Some(SurfaceSample { surface, pdf: 1.0 / self.area() })
    }

    /// A point uniform by solid angle: in the cone that the sphere subtends, or over all directions from
    /// inside. Parts of a sphere are sampled by area.
    ///
    /// The point on the near side is computed from the angles, not by intersecting a ray that may miss; the
    /// differences 1 − cos are computed without cancellation, so no distance is too large.
    pub fn sample_direction(&self, from: DVec3, u: DVec2) -> Option<DirectionSample> {
        if !self.is_whole() {
            return density::seen_from(from, self.sample_area(u)?);
        }
        let to_center = self.center - from;
        let distance = to_center.length();
        if distance <= self.radius {
            let z = 1.0 - 2.0 * u.x;
            let rho = 2.0 * (u.x * (1.0 - u.x)).sqrt();
            let (sin, cos) = warp64::circle(u.y);
            let direction = DVec3::new(rho * cos, rho * sin, z);
            let (_, t) = self.crossings(&Ray::new(from, direction))?;
            let surface = self.surface_on(self.arm(&Ray::new(from, direction), t));
            return Some(DirectionSample { surface, pdf: 1.0 / (4.0 * PI) });
        }
        let (sin_max, versine_max) = self.cone(distance);
        let versine = u.x * versine_max;
        let sin_squared = versine * (2.0 - versine);
        let ratio = sin_squared / (sin_max * sin_max);
        // The angle at the centre between the directions to `from` and to the point.
        let cos_alpha = (sin_squared / sin_max + (1.0 - versine) * (1.0 - ratio).max(0.0).sqrt()).min(1.0);
        let sin_alpha = {
            // sin α = sin θ (distance cos θ - sqrt(radius² - distance² sin² θ)) / radius, without cancellation.
            let near = (1.0 - versine) - (sin_max * sin_max - sin_squared).max(0.0).sqrt();
            (sin_squared.sqrt() * near / sin_max).clamp(0.0, 1.0)
        };
        let axis = -to_center / distance;
        let (e1, e2) = orthonormal_basis(axis);
        let (sin, cos) = warp64::circle(u.y);
        let w = sin_alpha * cos * e1 + sin_alpha * sin * e2 + cos_alpha * axis;
        let surface = self.surface_on(w * (self.radius / w.length()));
        Some(DirectionSample { surface, pdf: 1.0 / (TAU * versine_max) })
    }

    /// The sine of the cone's half-angle and one minus its cosine, from outside at `distance` from the centre.
    fn cone(&self, distance: f64) -> (f64, f64) {
        let sin = self.radius / distance;
        let cos = ((distance - self.radius) * (distance + self.radius)).sqrt() / distance;
        (sin, sin * sin / (1.0 + cos))
    }

    /// The density of [`Sphere::sample_direction`].
    pub fn pdf_direction(&self, ray: &Ray, surface: &Surface) -> f64 {
        if !self.is_whole() {
            return density::pdf_seen_from(ray, surface, 1.0 / self.area());
        }
        let distance = (self.center - ray.origin).length();
        let is_near_side = surface.normal.dot(ray.direction) <= 0.0;
        if distance <= self.radius {
            1.0 / (4.0 * PI)
        } else if is_near_side {
            1.0 / (TAU * self.cone(distance).1)
        } else {
            0.0
        }
    }
}

/// Both crossings of a ray's line with a whole sphere, in order, whatever the ray's range: the same bits that
/// [`Sphere::closest`] and [`Sphere::roots`] choose from. They are equal where the line touches; `None` where
/// it misses.
///
/// For spheres stored as bare numbers.
#[inline(always)]
pub fn sphere_crossings(center: DVec3, radius: f64, ray: &Ray) -> Option<(f64, f64)> {
    if ray.has_ordinary_direction() {
        return crossings(center, radius, ray);
    }
    let (scaled, [one, other]) = ray.with_direction_scaled()?;
    let (first, second) = crossings(center, radius, &scaled)?;
    Some((first / one / other, second / one / other))
}

/// Both crossings of a whole sphere, in order.
///
/// The discriminant is that of E. Haines, J. Günther, T. Akenine-Möller, "Precision improvements for ray/sphere
/// intersection", Ray Tracing Gems, 2019: the textbook's loses all digits for a small distant sphere. A line that
/// nearly touches is decided in twice the precision.
#[inline(always)]
pub(crate) fn crossings(center: DVec3, radius: f64, ray: &Ray) -> Option<(f64, f64)> {
    let equation = Equation::new(center, radius, ray);
    let Equation { a, h, c, depth, keeps_digits, .. } = equation;
    if equation.is_steep && keeps_digits {
        quadratic(a, h, c, a * depth)
    } else if equation.surely_misses {
        None
    } else {
        careful_crossings(center, radius, ray, [a, h, c, a * depth], keeps_digits)
    }
}

/// The equation a t² + 2 h t + c = 0 of a sphere along a ray.
pub(crate) struct Equation {
    pub(crate) a: f64,
    pub(crate) h: f64,
    pub(crate) c: f64,
    /// The point nearest to the centre, relative to it.
    pub(crate) nearest: DVec3,
    /// The square of the radius less that of the distance there.
    pub(crate) depth: f64,
    /// Whether these numbers decide that the line crosses the sphere, leave the roots their digits, and decide that it
    /// misses.
    pub(crate) is_steep: bool,
    pub(crate) keeps_digits: bool,
    pub(crate) surely_misses: bool,
}

impl Equation {
    #[inline(always)]
    pub(crate) fn new(center: DVec3, radius: f64, ray: &Ray) -> Self {
        let w = ray.origin - center;
        let a = ray.direction.length_squared();
        let h = w.dot(ray.direction);
        let nearest = w - (h / a) * ray.direction;
        let (square, far) = (radius * radius, w.length_squared());
        let (depth, power) = (square - nearest.length_squared(), far - square);
        // All false for a NaN.
        let is_steep =
            depth > 0.1 * square || (far < 2.0 * square && depth * depth > 1e-28 * square * square);
        // Next to the surface the nearer crossing would lose digits, and a ray that starts there would have none left.
        let keeps_digits = power.abs() > 0.2 * square || power.abs() < 1e-6 * square;
        let surely_misses = depth < -0.1 * square && depth < -1e-27 * far;
        Self { a, h, c: power, nearest, depth, is_steep, keeps_digits, surely_misses }
    }
}

/// As [`crossings`], with the equation set up next to the point nearest to the centre, or in twice the precision.
#[inline(never)]
fn careful_crossings(
    center: DVec3,
    radius: f64,
    ray: &Ray,
    [a, h, c, delta]: [f64; 4],
    is_apart: bool,
) -> Option<(f64, f64)> {
    let nearby = Nearby::new(center, radius, ray, [a, h]);
    if nearby.is_certain && is_apart {
        return nearby.crossings(a);
    }
    let solution = solution(center, radius, ray, nearby.start);
    if solution.is_finite { solution.crossings } else { quadratic(a, h, c, delta) }
}

/// The equation next to the point nearest to the centre.
pub(crate) struct Nearby {
    pub(crate) start: f64,
    /// Relative to the centre.
    pub(crate) place: DVec3,
    pub(crate) h: f64,
    pub(crate) c: f64,
    pub(crate) delta: f64,
    /// A bound on the discriminant's error.
    pub(crate) error: f64,
    pub(crate) is_certain: bool,
}

impl Nearby {
    #[inline]
    pub(crate) fn new(center: DVec3, radius: f64, ray: &Ray, [a, h]: [f64; 2]) -> Self {
        let (start, p, slack) = place_near(ray.origin, center, -h / a, ray.direction);
        let (h, c) = (p.dot(ray.direction), p.length_squared() - radius * radius);
        let delta = h * h - a * c;
        let error = a * radius * (1e-14 * radius + f64::EPSILON * slack.element_sum());
        // False for a NaN.
        let is_certain = delta.abs() > error;
        Self { start, place: p, h, c, delta, error, is_certain }
    }

    #[inline]
    pub(crate) fn crossings(&self, a: f64) -> Option<(f64, f64)> {
        let (first, second) = quadratic(a, self.h, self.c, self.delta)?;
        Some((self.start + first, self.start + second))
    }
}

pub(crate) fn solution(center: DVec3, radius: f64, ray: &Ray, start: f64) -> Solution {
    Solution::new(ray.origin, center, ray.direction, start, |p, d| {
        [dot(d, d), dot(p, d), dot(p, p) - Twofold::product(radius, radius)]
    })
}

/// The point of a whole sphere at `t`, relative to the centre.
pub(crate) fn arm(center: DVec3, radius: f64, ray: &Ray, t: f64) -> DVec3 {
    let d = ray.direction;
    let w = if is_blurred(ray, t, radius) {
        let start = -(ray.origin - center).dot(d) / d.length_squared();
        solution(center, radius, ray, start).point(t, d)
    } else {
        None
    };
    let w = w.unwrap_or_else(|| point(ray.origin, center, t, d));
    // At the centre of a sphere too small to see, the side that the ray comes from.
    radius * unit(w).or_else(|| unit(-d)).unwrap_or(DVec3::Z)
}

/// The normal at `t`, on the side of the ray that its crossings say.
pub(crate) fn sided(normal: DVec3, crossings: Option<(f64, f64)>, ray: &Ray, t: f64) -> DVec3 {
    match crossings {
        Some((first, second)) if first < second => on_side_of(normal, ray.direction, t - first < second - t),
        _ => normal,
    }
}
