//! Triangles: two intersection tests, one of them watertight, and the exact shape.

use std::f64::consts::{PI, TAU};

use lumbre_math::quadratic::dop;
use lumbre_math::rounding::gamma;
use lumbre_math::{DVec2, DVec3, Elementary, Transform};

use crate::nearest::on_triangle;
use crate::shape::{check, open_surface};
use crate::support::bounds_from_support;
use crate::{
    Aabb, BoundingVolume, DirectionSample, NearestPoint, NearestPointError, Ray, Root, Roots, ShapeError,
    Surface, SurfaceSample, density, measure,
};

/// The intersection of a line with a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriangleHit {
    /// The ray parameter; the caller checks the range.
    pub t: f64,
    /// The weight of the second vertex.
    pub b1: f64,
    /// The weight of the third vertex.
    pub b2: f64,
    /// A positive multiple of −D·((p1−p0)×(p2−p0)). Positive when the ray hits the front face, whose vertices
    /// are counter-clockwise as seen from the ray's origin; to cull back faces, drop the negative ones. Never
    /// 0.
    pub determinant: f64,
}

/// The test of T. Möller, B. Trumbore, "Fast, minimum storage ray/triangle intersection", Journal of Graphics
/// Tools, 1997, which solves O + tD = (1−b1−b2) p0 + b1 p1 + b2 p2 by Cramer's rule.
///
/// It is fast, but not watertight: the barycentrics of two triangles with a common edge round differently, and
/// a ray at the edge may miss both.
#[inline]
pub fn moller_trumbore(
    origin: DVec3,
    direction: DVec3,
    p0: DVec3,
    p1: DVec3,
    p2: DVec3,
) -> Option<TriangleHit> {
    let (edge1, edge2) = (p1 - p0, p2 - p0);
    let s = origin - p0;
    let s1 = direction.cross(edge2);
    let determinant = s1.dot(edge1);
    let inverse = determinant.recip();
    let b1 = s1.dot(s) * inverse;
    let s2 = s.cross(edge1);
    let b2 = s2.dot(direction) * inverse;
    let inside = determinant != 0.0 && b1 >= 0.0 && b2 >= 0.0 && b1 + b2 <= 1.0;
    inside.then(|| TriangleHit { t: s2.dot(edge2) * inverse, b1, b2, determinant })
}

/// The per-ray data of [`WatertightRay::hit`]: the dominant axis of the direction, and the shear that aligns
/// the ray with it.
#[derive(Clone, Copy, Debug)]
pub struct WatertightRay {
    origin: DVec3,
    order: Order,
    shear: DVec3,
}

/// A cyclic order of the axes that ends with the dominant one, reversed when the direction is negative there.
#[derive(Clone, Copy, Debug)]
enum Order {
    Yzx,
    Zyx,
    Zxy,
    Xzy,
    Xyz,
    Yxz,
}

impl Order {
    #[inline(always)]
    fn apply(self, v: DVec3) -> DVec3 {
        match self {
            Self::Yzx => DVec3::new(v.y, v.z, v.x),
            Self::Zyx => DVec3::new(v.z, v.y, v.x),
            Self::Zxy => DVec3::new(v.z, v.x, v.y),
            Self::Xzy => DVec3::new(v.x, v.z, v.y),
            Self::Xyz => v,
            Self::Yxz => DVec3::new(v.y, v.x, v.z),
        }
    }
}

impl WatertightRay {
    /// The shear of a ray. A ray with a direction of zero, or with a NaN, hits nothing.
    #[inline]
    pub fn new(origin: DVec3, direction: DVec3) -> Self {
        let size = direction.abs();
        let pick = |goes_down: bool, up: Order, down: Order| if goes_down { down } else { up };
        let order = if size.x >= size.y && size.x >= size.z {
            pick(direction.x < 0.0, Order::Yzx, Order::Zyx)
        } else if size.y >= size.z {
            pick(direction.y < 0.0, Order::Zxy, Order::Xzy)
        } else {
            pick(direction.z < 0.0, Order::Xyz, Order::Yxz)
        };
        let along = order.apply(direction);
        Self { origin, order, shear: DVec3::new(along.x / along.z, along.y / along.z, 1.0 / along.z) }
    }

    /// A point in the sheared space of the ray, whose last axis is the ray: rounded from the ray and the point alone,
    /// so that it is the same for all faces that share it.
    #[inline]
    pub(crate) fn sheared(&self, p: DVec3) -> DVec3 {
        let along = self.order.apply(p - self.origin);
        DVec3::new(along.x - self.shear.x * along.z, along.y - self.shear.y * along.z, along.z)
    }

    /// The distance along the ray to a height in its sheared space.
    #[inline]
    pub(crate) fn t(&self, height: f64) -> f64 {
        height * self.shear.z
    }

    /// The test of S. Woop, C. Benthin, I. Wald, "Watertight ray/triangle intersection", Journal of Computer
    /// Graphics Techniques, 2013.
    ///
    /// The line passes a common edge on the same side of both triangles, so it cannot slip between them: their
    /// edge functions are the same two rounded products, subtracted in opposite order. The sign is right unless
    /// the products round to the same number; then it is decided by their rounding errors. Nothing here may be
    /// contracted into a fused multiply-add.
    ///
    /// Vertices in single precision may be passed promoted.
    #[inline]
    pub fn hit(&self, p0: DVec3, p1: DVec3, p2: DVec3) -> Option<TriangleHit> {
        // One branch, the same for all triangles of a ray, is cheaper than nine look-ups.
        match self.order {
            Order::Yzx => self.hit_in(Order::Yzx, p0, p1, p2),
            Order::Zyx => self.hit_in(Order::Zyx, p0, p1, p2),
            Order::Zxy => self.hit_in(Order::Zxy, p0, p1, p2),
            Order::Xzy => self.hit_in(Order::Xzy, p0, p1, p2),
            Order::Xyz => self.hit_in(Order::Xyz, p0, p1, p2),
            Order::Yxz => self.hit_in(Order::Yxz, p0, p1, p2),
        }
    }

    #[inline(always)]
    fn hit_in(&self, order: Order, p0: DVec3, p1: DVec3, p2: DVec3) -> Option<TriangleHit> {
        let edges = self.edges_in(order, p0, p1, p2);
        if !edges.are_passed_inside() {
            return None;
        }
        edges.crossing(self.shear.z)
    }

    #[inline(always)]
    fn edges_in(&self, order: Order, p0: DVec3, p1: DVec3, p2: DVec3) -> Edges {
        let [a, b, c] = [p0, p1, p2].map(|p| order.apply(p - self.origin));
        let flat = |p: DVec3| (p.x - self.shear.x * p.z, p.y - self.shear.y * p.z);
        let ((ax, ay), (bx, by), (cx, cy)) = (flat(a), flat(b), flat(c));
        let mut u = cx * by - cy * bx;
        let mut v = ax * cy - ay * cx;
        let mut w = bx * ay - by * ax;
        if (u == 0.0) | (v == 0.0) | (w == 0.0) {
            (u, v, w) = (dop(cx, by, cy, bx), dop(ax, cy, ay, cx), dop(bx, ay, by, ax));
        }
        let corners = [DVec3::new(ax, ay, a.z), DVec3::new(bx, by, b.z), DVec3::new(cx, cy, c.z)];
        Edges { corners, u, v, w }
    }

    /// The edge functions of a triangle.
    pub(crate) fn edges(&self, [p0, p1, p2]: [DVec3; 3]) -> Edges {
        self.edges_in(self.order, p0, p1, p2)
    }

    /// The axes in the order of the sheared space.
    pub(crate) fn axes(&self) -> [DVec3; 3] {
        let numbers = self.order.apply(DVec3::new(0.0, 1.0, 2.0));
        numbers.to_array().map(|axis| DVec3::AXES[axis as usize])
    }

    /// What a height along the last axis moves a point by, along the first two, and what it is of the ray's `t`.
    pub(crate) fn shear(&self) -> DVec3 {
        self.shear
    }
}

/// The edge functions of a triangle in the sheared space of a ray.
pub(crate) struct Edges {
    /// In sheared space.
    pub(crate) corners: [DVec3; 3],
    /// Of the edges opposite to p0, p1 and p2.
    pub(crate) u: f64,
    pub(crate) v: f64,
    pub(crate) w: f64,
}

impl Edges {
    /// Whether the ray passes inside all edges, or on them.
    #[inline(always)]
    pub(crate) fn are_passed_inside(&self) -> bool {
        let &Self { u, v, w, .. } = self;
        // No short-circuit: the branches are unpredictable, and a misprediction costs more than the
        // comparisons.
        !(((u < 0.0) | (v < 0.0) | (w < 0.0)) & ((u > 0.0) | (v > 0.0) | (w > 0.0)))
    }

    /// Where the line crosses the triangle's plane; `None` where it sees the triangle edge-on.
    #[inline(always)]
    pub(crate) fn crossing(&self, from_height: f64) -> Option<TriangleHit> {
        let &Self { corners: [a, b, c], u, v, w, .. } = self;
        let determinant = u + v + w;
        if determinant == 0.0 || determinant.is_nan() {
            return None;
        }
        let inverse = determinant.recip();
        let t = from_height * (u * a.z + v * b.z + w * c.z) * inverse;
        Some(TriangleHit { t, b1: v * inverse, b2: w * inverse, determinant })
    }
}

/// On which side of an edge between sheared points the ray passes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Side {
    /// Whether the edge function is positive. Where it is zero, the ray counts as moved by (ε, ε²) in the sheared plane
    /// ("simulation of simplicity": H. Edelsbrunner, E. Mücke, ACM Transactions on Graphics 9(1), 1990), as it does
    /// among the triangles of a mesh, so that the faces on both sides of an edge agree whichever way they run along it.
    pub(crate) is_positive: bool,
    /// Whether the ray meets the edge's line exactly.
    pub(crate) is_exact: bool,
}

impl Side {
    /// The exact sign of px qy − py qx.
    #[inline]
    pub(crate) fn of(p: DVec3, q: DVec3) -> Self {
        let (first, second) = (p.x * q.y, p.y * q.x);
        if first != second {
            return Self { is_positive: first > second, is_exact: false };
        }
        // Both products round to the same number: their errors decide.
        let residue = p.x.multiply_add(q.y, -first) - p.y.multiply_add(q.x, -first);
        let moved = [residue, p.y - q.y, q.x - p.x].into_iter().find(|&term| term != 0.0);
        Self { is_positive: moved.is_some_and(|term| term > 0.0), is_exact: residue == 0.0 }
    }
}

/// The triangle p0, p1, p2, edges included; its front is where the vertices are counter-clockwise.
///
/// Its `root.local` and its `uv` are the weights (b1, b2) of p1 and p2. A triangle without area is never hit.
///
/// It uses [`WatertightRay`] rather than [`moller_trumbore`], through whose edges some rays leak
/// (`tests/triangles.rs`), at about twice the time (`examples/shape_speed.rs`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle {
    p0: DVec3,
    p1: DVec3,
    p2: DVec3,
    // Whether it has no area.
    pub(crate) is_flat: bool,
}

/// Solid angles outside this range are sampled by area: small ones lose the digits of the spherical excess, and
/// directly over the triangle the corners lie on a great circle.
const SPHERICAL_SAMPLING: std::ops::Range<f64> = 1e-5..TAU - 1e-5;

/// The least height over the plane, relative to the triangle's size, for sampling by solid angle.
const CLEARANCE: f64 = 1e-7;

impl Triangle {
    /// A triangle, possibly without area.
    ///
    /// # Errors
    /// [`ShapeError`] unless all coordinates are finite.
    pub fn new(p0: DVec3, p1: DVec3, p2: DVec3) -> Result<Self, ShapeError> {
        let (p0, p1, p2) = (check::finite("p0", p0)?, check::finite("p1", p1)?, check::finite("p2", p2)?);
        let triangle = Self { p0, p1, p2, is_flat: false };
        Ok(Self { is_flat: triangle.cross() == DVec3::ZERO, ..triangle })
    }

    /// The three corners.
    pub fn corners(&self) -> [DVec3; 3] {
        [self.p0, self.p1, self.p2]
    }

    /// (p1−p0)×(p2−p0), zero exactly when the rounded edges are parallel.
    fn cross(&self) -> DVec3 {
        let (a, b) = (self.p1 - self.p0, self.p2 - self.p0);
        DVec3::new(dop(a.y, b.z, a.z, b.y), dop(a.z, b.x, a.x, b.z), dop(a.x, b.y, a.y, b.x))
    }

    /// The first crossing in the ray's range, by the watertight test: adjacent triangles have no gap.
    #[inline]
    pub fn closest(&self, ray: &Ray) -> Option<Root> {
        let hit = WatertightRay::new(ray.origin, ray.direction).hit(self.p0, self.p1, self.p2)?;
        let hits = ray.contains(hit.t) && !self.is_flat;
        hits.then(|| Root { local: DVec2::new(hit.b1, hit.b2), ..Root::at(hit.t) })
    }

    /// The one crossing, if it is in the ray's range.
    pub fn roots(&self, ray: &Ray, out: &mut Roots) {
        out.extend(self.closest(ray));
    }

    /// The surface at a crossing.
    pub fn surface(&self, _ray: &Ray, root: &Root) -> Surface {
        self.surface_on(root.local)
    }

    /// The surface at the weights (b1, b2), which may lie outside the triangle.
    pub fn surface_at(&self, part: u32, uv: DVec2) -> Option<Surface> {
        (part == 0).then(|| self.surface_on(uv))
    }

    fn surface_on(&self, uv: DVec2) -> Surface {
        let b0 = 1.0 - uv.x - uv.y;
        let cross = self.cross();
        let size = cross.abs().max_element();
        let sum = b0.abs() * self.p0.abs() + uv.x.abs() * self.p1.abs() + uv.y.abs() * self.p2.abs();
        Surface {
            point: b0 * self.p0 + uv.x * self.p1 + uv.y * self.p2,
            point_error: gamma(9) * sum,
            normal: (cross / size).normalize(),
            uv,
            dpdu: self.p1 - self.p0,
            dpdv: self.p2 - self.p0,
            dndu: DVec3::ZERO,
            dndv: DVec3::ZERO,
        }
    }

    /// The bounding box under a transform: that of the three corners.
    pub fn bounds(&self, world_from_object: &Transform) -> Option<Aabb> {
        let magnitude = self.p0.abs().max(self.p1.abs()).max(self.p2.abs());
        let support = |d: DVec3| d.dot(self.p0).max(d.dot(self.p1)).max(d.dot(self.p2));
        Some(bounds_from_support(world_from_object, magnitude, support))
    }

    /// A bounding volume: the triangle itself, as a plane section of a cone through its axis.
    pub fn bounding_volume(&self) -> Option<BoundingVolume> {
        let [p0, p1, p2] = self.corners();
        let (base, foot) = (0.5 * (p1 - p0), 0.5 * (p0 + p1));
        // Scaled to a square, the radius of the cone is (1 - z) / 2.
        BoundingVolume::flat(0.5 * (foot + p2), base, 0.5 * (p2 - foot), [-0.25, 0.5, -0.25])
    }

    /// Half the length of the cross product.
    pub fn area(&self) -> f64 {
        0.5 * self.cross().length()
    }

    /// The area after a transform.
    pub fn area_under(&self, world_from_object: &Transform) -> f64 {
        0.5 * (measure::area_stretch(world_from_object) * self.cross()).length()
    }

    open_surface!();

    /// The nearest point to `p` under any map.
    ///
    /// # Errors
    /// None.
    pub fn closest_point(
        &self,
        world_from_object: &Transform,
        p: DVec3,
    ) -> Result<NearestPoint, NearestPointError> {
        let corners = self.corners().map(|corner| world_from_object.point(corner));
        Ok(on_triangle(p, corners, 0))
    }

    /// "triangle".
    pub fn name(&self) -> &'static str {
        "triangle"
    }

    /// A point uniform by area; `None` for a triangle without area.
    ///
    /// E. Heitz, "A low-distortion map between triangle and square", 2019.
    pub fn sample_area(&self, u: DVec2) -> Option<SurfaceSample> {
        let pdf = 1.0 / self.area();
        let uv = if u.y > u.x {
            DVec2::new(0.5 * u.x, u.y - 0.5 * u.x)
        } else {
            DVec2::new(u.x - 0.5 * u.y, 0.5 * u.y)
        };
        pdf.is_finite().then(|| SurfaceSample { surface: self.surface_on(uv), pdf })
    }

    /// The solid angle that the triangle subtends at `from`.
    ///
    /// A. van Oosterom, J. Strackee, "The solid angle of a plane triangle", IEEE Transactions on Biomedical
    /// Engineering, 1983.
    pub fn solid_angle(&self, from: DVec3) -> f64 {
        solid_angle_of(self.p0 - from, self.p1 - from, self.p2 - from)
    }

    /// The solid angle, if the triangle is sampled by it.
    fn sampled_solid_angle(&self, from: DVec3) -> Option<f64> {
        let cross = self.cross();
        let height = (self.p0 - from).dot(cross).abs() / cross.length();
        let is_clear = height > CLEARANCE * ((self.p1 - self.p0).length() + (self.p2 - self.p0).length());
        let solid_angle = self.solid_angle(from);
        (is_clear && SPHERICAL_SAMPLING.contains(&solid_angle)).then_some(solid_angle)
    }

    /// A point uniform by solid angle, or by area where the solid angle is tiny or almost a hemisphere.
    ///
    /// J. Arvo, "Stratified sampling of spherical triangles", SIGGRAPH 1995.
    pub fn sample_direction(&self, from: DVec3, u: DVec2) -> Option<DirectionSample> {
        let Some(solid_angle) = self.sampled_solid_angle(from) else {
            return density::seen_from(from, self.sample_area(u)?);
        };
        let [a, b, c] = self.corners().map(|p| (p - from).normalize());
        let side_ab = a.cross(b).normalize();
        let side_ca = c.cross(a).normalize();
        let alpha = angle_between(side_ab, -side_ca);
        let (sin_alpha, cos_alpha) = alpha.sine_cosine();
        let cos_c = a.dot(b);

        // A smaller triangle with the same corner A, whose area is the fraction u.x of the whole.
        let (sin_phi, cos_phi) = (PI + u.x * solid_angle - alpha).sine_cosine();
        let k1 = cos_phi + cos_alpha;
        let k2 = sin_phi - sin_alpha * cos_c;
        let numerator = k2 + (k2 * cos_phi - k1 * sin_phi) * cos_alpha;
        let cos_b = (numerator / ((k2 * sin_phi + k1 * cos_phi) * sin_alpha)).clamp(-1.0, 1.0);
        let sin_b = (1.0 - cos_b * cos_b).sqrt();
        let moved_c = cos_b * a + sin_b * (c - c.dot(a) * a).normalize();

        // A point between B and the moved corner.
        let versine = u.y * (1.0 - moved_c.dot(b));
        let sin_theta = (versine * (2.0 - versine)).max(0.0).sqrt();
        let direction = (1.0 - versine) * b + sin_theta * (moved_c - moved_c.dot(b) * b).normalize();

        // Its intersection with the plane, without the edge tests: rounding may put it slightly outside.
        let (edge1, edge2) = (self.p1 - self.p0, self.p2 - self.p0);
        let s = from - self.p0;
        let s1 = direction.cross(edge2);
        let determinant = s1.dot(edge1);
        let (b1, b2) = (s1.dot(s) / determinant, s.cross(edge1).dot(direction) / determinant);
        if !(b1.is_finite() && b2.is_finite()) {
            return None;
        }
        let b1 = b1.clamp(0.0, 1.0);
        let surface = self.surface_on(DVec2::new(b1, b2.clamp(0.0, 1.0 - b1)));
        Some(DirectionSample { surface, pdf: 1.0 / solid_angle })
    }

    /// The density of [`Triangle::sample_direction`].
    pub fn pdf_direction(&self, ray: &Ray, surface: &Surface) -> f64 {
        match self.sampled_solid_angle(ray.origin) {
            Some(solid_angle) => 1.0 / solid_angle,
            None => density::pdf_seen_from(ray, surface, 1.0 / self.area()),
        }
    }
}

/// The solid angle of a triangle, its corners given relative to the viewpoint.
///
/// The triple product is computed from the edges, so that a small distant triangle does not cancel.
pub(crate) fn solid_angle_of(a: DVec3, b: DVec3, c: DVec3) -> f64 {
    let (la, lb, lc) = (a.length(), b.length(), c.length());
    let volume = a.dot((b - a).cross(c - a)).abs();
    let denominator = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    2.0 * volume.angle_from(denominator)
}

/// The angle between two unit vectors, accurate near 0 and near π.
///
/// W. Kahan, "How futile are mindless assessments of roundoff in floating-point computation?", 2006.
fn angle_between(a: DVec3, b: DVec3) -> f64 {
    2.0 * (a - b).length().angle_from((a + b).length())
}
