//! Bilinear patches.

use std::f64::consts::TAU;

use lumbre_math::quadratic::{dop, quadratic};
use lumbre_math::roots::{RealRoots, roots_between};
use lumbre_math::rounding::gamma;
use lumbre_math::{DVec2, DVec3, Elementary, Transform};
use smallvec::SmallVec;

use crate::shape::{check, open_surface};
use crate::support::bounds_from_support;
use crate::triangle::{Side, WatertightRay, solid_angle_of};
use crate::{
    Aabb, BoundingVolume, DirectionSample, NearestPoint, NearestPointError, Ray, Root, Roots, ShapeError,
    Surface, SurfaceSample, density, measure,
};

/// The surface (1−u)(1−v) p00 + u(1−v) p10 + (1−u)v p01 + uv p11 with u and v in [0, 1]: doubly ruled, and flat
/// when the corners are coplanar. The normal is along ∂p/∂u × ∂p/∂v.
///
/// Its `root.local` and its `uv` are (u, v). Patches and triangles that share an edge have no gap, see
/// [`BilinearPatch::line_crossings`]. A ray along one of its rulings crosses it once or not at all.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BilinearPatch {
    p00: DVec3,
    p10: DVec3,
    p01: DVec3,
    p11: DVec3,
    is_rectangle: bool,
}

/// Where a line crosses a bilinear patch.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PatchCrossings {
    /// In ascending order.
    pub of_line: SmallVec<[PatchCrossing; 2]>,
    /// Whether the line lies in the patch's plane, or along one of its edges: then no point is given.
    pub is_edge_on: bool,
}

/// One crossing of a line with a bilinear patch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PatchCrossing {
    /// The crossing.
    pub root: Root,
    /// Whether the patch owns it. Of the faces that meet at an edge or a corner, exactly one owns a crossing there; at
    /// the border of a surface it may have no owner.
    pub is_owned: bool,
    /// Where on the outline, if it is exactly there.
    pub place: Option<PatchPlace>,
}

/// A place on the outline of a bilinear patch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PatchPlace {
    /// Within the edge from this corner of [`BilinearPatch::outline`] to the next.
    Edge(usize),
    /// At this corner.
    Corner(usize),
}

/// Solid angles outside this range are sampled by area: small ones cancel in the sum of four angles, and
/// directly over the rectangle the depth is 0.
const SPHERICAL_SAMPLING: std::ops::Range<f64> = 1e-4..TAU - 1e-6;

/// The least height over the plane, relative to the rectangle's size, for sampling by solid angle.
const CLEARANCE: f64 = 1e-7;

impl BilinearPatch {
    /// The patch with four corners; two may coincide.
    ///
    /// # Errors
    /// [`ShapeError`] unless the corners are finite and not collinear.
    pub fn new(p00: DVec3, p10: DVec3, p01: DVec3, p11: DVec3) -> Result<Self, ShapeError> {
        let (p00, p10) = (check::finite("p00", p00)?, check::finite("p10", p10)?);
        let (p01, p11) = (check::finite("p01", p01)?, check::finite("p11", p11)?);
        let (along_u, along_v) = (p10 - p00, p01 - p00);
        let size = along_u.length() * along_v.length();
        let is_rectangle = (p11 - p01 - along_u).length() <= 1e-14 * along_u.length()
            && along_u.dot(along_v).abs() <= 1e-14 * size
            && size > 0.0;
        let patch = Self { p00, p10, p01, p11, is_rectangle };
        let is_flat_line = patch.corner_crosses().iter().all(|&cross| cross == DVec3::ZERO);
        if is_flat_line {
            return Err(ShapeError::Degenerate("the corners of the bilinear patch lie on a line"));
        }
        Ok(patch)
    }

    /// The corners p00, p10, p01, p11.
    pub fn corners(&self) -> [DVec3; 4] {
        [self.p00, self.p10, self.p01, self.p11]
    }

    fn dpdu(&self, v: f64) -> DVec3 {
        (1.0 - v) * (self.p10 - self.p00) + v * (self.p11 - self.p01)
    }

    fn dpdv(&self, u: f64) -> DVec3 {
        (1.0 - u) * (self.p01 - self.p00) + u * (self.p11 - self.p10)
    }

    /// ∂p/∂u × ∂p/∂v at the corners 00, 10, 01, 11; in between it is linear in u and in v.
    fn corner_crosses(&self) -> [DVec3; 4] {
        [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)].map(|(u, v)| self.dpdu(v).cross(self.dpdv(u)))
    }

    /// The corners in the order of the outline: p00, p10, p11, p01.
    pub fn outline(&self) -> [DVec3; 4] {
        [self.p00, self.p10, self.p11, self.p01]
    }

    /// How the line of a ray crosses the patch, whatever the range of the ray.
    ///
    /// What is inside is decided by the straight edges alone, each as the triangles of a mesh decide about theirs: by
    /// the exact sign of the edge function of its sheared end points. So a ray passes a common edge on the same side of
    /// both faces, whichever they are. The winding number of the outline around the ray decides whether there is one
    /// crossing, or none or two; the roots of a quadratic only say where.
    pub fn line_crossings(&self, ray: &Ray) -> PatchCrossings {
        let mut crossings = PatchCrossings::default();
        if !(ray.origin.is_finite() && ray.direction.is_finite()) || ray.direction == DVec3::ZERO {
            return crossings;
        }
        let sheared = WatertightRay::new(ray.origin, ray.direction);
        let patch = self.sheared(&sheared);
        let sides = patch.sides();
        for (uv, multiplicity) in patch.inside(patch.winding(sides) != 0).into_iter().flatten() {
            let t = sheared.t(patch.at(uv).z);
            if t.is_finite() {
                let root = Root { t, part: 0, multiplicity, local: uv };
                crossings.of_line.push(PatchCrossing { root, is_owned: true, place: None });
            }
        }
        if sides.iter().any(|side| side.is_exact) {
            self.find_places(&sheared, &patch, sides, &mut crossings);
        }
        if let [first, second] = &mut *crossings.of_line {
            // Entering comes before leaving.
            let is_front = |crossing: &PatchCrossing| patch.turn(crossing.root.local) < 0.0;
            let swaps = second.root.t < first.root.t
                || second.root.t == first.root.t && is_front(second) && !is_front(first);
            if swaps {
                std::mem::swap(first, second);
            }
        } else {
            crossings.of_line.sort_by(|a, b| a.root.t.total_cmp(&b.root.t));
        }
        crossings
    }

    /// The patch in the sheared space of a ray.
    #[inline]
    pub(crate) fn sheared(&self, sheared: &WatertightRay) -> Sheared {
        Sheared { corners: self.corners().map(|p| sheared.sheared(p)) }
    }

    /// Finds the crossings exactly at edges and corners: those that the patch owns, and the others.
    #[cold]
    fn find_places(
        &self,
        sheared: &WatertightRay,
        patch: &Sheared,
        sides: [Side; 4],
        crossings: &mut PatchCrossings,
    ) {
        const UV: [DVec2; 4] = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y];
        let (outline, corners) = (patch.outline(), self.outline());
        let is_met = |corner: usize| outline[corner].x == 0.0 && outline[corner].y == 0.0;
        let is_along = |edge: usize| {
            let next = (edge + 1) % 4;
            is_met(edge) && is_met(next) && corners[edge] != corners[next]
        };
        crossings.is_edge_on = sides.iter().all(|side| side.is_exact) || (0..4).any(is_along);
        if crossings.is_edge_on {
            return;
        }
        let highest = outline.iter().map(|p| p.z).fold(f64::NEG_INFINITY, f64::max);
        let lowest = outline.iter().map(|p| p.z).fold(f64::INFINITY, f64::min);
        let width = outline.iter().map(|p| (p.x - outline[0].x).abs().max((p.y - outline[0].y).abs()));
        let close = 1e-6 * width.fold(highest - lowest, f64::max) * sheared.t(1.0).abs();
        let mut place_at = |place: PatchPlace, uv: DVec2| {
            let t = sheared.t(patch.at(uv).z);
            let distance = |crossing: &PatchCrossing| (crossing.root.t - t).abs();
            let found = crossings
                .of_line
                .iter_mut()
                .filter(|crossing| crossing.place.is_none() && distance(crossing) <= close)
                .min_by(|a, b| distance(a).total_cmp(&distance(b)));
            match found {
                Some(own) => own.place = Some(place),
                None if t.is_finite() => {
                    let root = Root { t, part: 0, multiplicity: 1, local: uv };
                    crossings.of_line.push(PatchCrossing { root, is_owned: false, place: Some(place) });
                }
                None => {}
            }
        };
        for edge in 0..4 {
            let next = (edge + 1) % 4;
            let [p, q] = [outline[edge], outline[next]];
            if is_met(edge) {
                let is_repeated = (0..edge).any(|other| is_met(other) && corners[other] == corners[edge]);
                if !is_repeated {
                    place_at(PatchPlace::Corner(edge), UV[edge]);
                }
            } else if sides[edge].is_exact && !is_met(next) && p.x * q.x <= 0.0 && p.y * q.y <= 0.0 {
                let share = if p.x.abs() > p.y.abs() { p.x / (p.x - q.x) } else { p.y / (p.y - q.y) };
                place_at(PatchPlace::Edge(edge), UV[edge].lerp(UV[next], share));
            }
        }
    }

    /// The first crossing in the ray's range. The outline belongs to the patch.
    #[inline]
    pub fn closest(&self, ray: &Ray) -> Option<Root> {
        let crossings = self.line_crossings(ray);
        crossings.of_line.iter().map(|crossing| crossing.root).find(|root| ray.contains(root.t))
    }

    /// Every crossing in the ray's range, appended in ascending order.
    pub fn roots(&self, ray: &Ray, out: &mut Roots) {
        let crossings = self.line_crossings(ray);
        let roots = crossings.of_line.iter().map(|crossing| crossing.root);
        out.extend(roots.filter(|root| ray.contains(root.t)));
    }

    /// The surface at a crossing.
    pub fn surface(&self, _ray: &Ray, root: &Root) -> Surface {
        self.surface_on(root.local)
    }

    /// The surface at `uv`.
    pub fn surface_at(&self, part: u32, uv: DVec2) -> Option<Surface> {
        (part == 0).then(|| self.surface_on(uv))
    }

    fn surface_on(&self, uv: DVec2) -> Surface {
        let (u, v) = (uv.x, uv.y);
        let weights = [(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v];
        let weigh = |p: [DVec3; 4]| (0..4).map(|i| weights[i] * p[i]).sum::<DVec3>();
        let (dpdu, dpdv) = (self.dpdu(v), self.dpdv(u));
        let mut cross = dpdu.cross(dpdv);
        if cross == DVec3::ZERO {
            // Coincident corners: use the limit from the middle of the patch.
            let inside = |x: f64| x + 1e-8 * (0.5 - x);
            cross = self.dpdu(inside(v)).cross(self.dpdv(inside(u)));
        }
        let normal = (cross / cross.abs().max_element()).normalize();
        // The Weingarten equations, with ∂²p/∂u∂v the only non-zero second derivative.
        let twist = normal.dot(self.p11 - self.p01 - self.p10 + self.p00);
        let (e, f, g) = (dpdu.length_squared(), dpdu.dot(dpdv), dpdv.length_squared());
        let bend = twist / (e * g - f * f);
        let bend = if bend.is_finite() { bend } else { 0.0 };
        Surface {
            point: weigh(self.corners()),
            point_error: gamma(16) * weigh(self.corners().map(DVec3::abs)),
            normal,
            uv,
            dpdu,
            dpdv,
            dndu: bend * (f * dpdu - e * dpdv),
            dndv: bend * (f * dpdv - g * dpdu),
        }
    }

    /// The bounding box under a transform: that of the corners, since every point is a convex combination of
    /// them.
    pub fn bounds(&self, world_from_object: &Transform) -> Option<Aabb> {
        let corners = self.corners();
        let magnitude = corners.map(DVec3::abs).into_iter().fold(DVec3::ZERO, DVec3::max);
        let support = |d: DVec3| corners.iter().map(|&p| d.dot(p)).fold(f64::NEG_INFINITY, f64::max);
        Some(bounds_from_support(world_from_object, magnitude, support))
    }

    /// A bounding volume: a box.
    pub fn bounding_volume(&self) -> Option<BoundingVolume> {
        BoundingVolume::of_box(&self.bounds(&Transform::IDENTITY)?)
    }

    /// The area, of one side, by quadrature.
    pub fn area(&self) -> f64 {
        self.area_under(&Transform::IDENTITY)
    }

    /// The area after a transform, of one side, by quadrature.
    pub fn area_under(&self, world_from_object: &Transform) -> f64 {
        measure::patch_area(world_from_object, |u, v| self.dpdu(v).cross(self.dpdv(u)))
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
        let [q00, q10, q01, q11] = self.corners().map(|corner| world_from_object.point(corner) - p);
        let at = |u: f64, v: f64| (1.0 - v) * ((1.0 - u) * q00 + u * q10) + v * ((1.0 - u) * q01 + u * q11);
        let mut best = (DVec2::ZERO, q00);
        let mut take = |uv: DVec2| {
            let uv = uv.clamp(DVec2::ZERO, DVec2::ONE);
            let point = at(uv.x, uv.y);
            if point.length_squared() < best.1.length_squared() {
                best = (uv, point);
            }
        };
        // The sides, and the ruling of constant u through every stationary point of the distance.
        let along = |start: DVec3, end: DVec3| {
            let side = end - start;
            let t = -start.dot(side) / side.length_squared();
            if t.is_finite() { t.clamp(0.0, 1.0) } else { 0.0 }
        };
        take(DVec2::new(along(q00, q10), 0.0));
        take(DVec2::new(along(q01, q11), 1.0));
        let inside = stationary(q00, q10, q01, q11);
        let columns: SmallVec<[f64; 8]> = inside.iter().copied().chain([0.0, 1.0]).collect();
        for &u in &columns {
            let v = along((1.0 - u) * q00 + u * q10, (1.0 - u) * q01 + u * q11);
            take(DVec2::new(u, v));
            take(DVec2::new(along((1.0 - v) * q00 + v * q01, (1.0 - v) * q10 + v * q11), v));
        }
        // A few steps along each parameter in turn restore the accuracy that the polynomial lost.
        for _ in 0..4 {
            let v = best.0.y;
            let u = along((1.0 - v) * q00 + v * q01, (1.0 - v) * q10 + v * q11);
            let v = along((1.0 - u) * q00 + u * q10, (1.0 - u) * q01 + u * q11);
            let point = at(u, v);
            if point.length_squared() >= best.1.length_squared() {
                break;
            }
            best = (DVec2::new(u, v), point);
        }
        let (uv, offset) = best;
        Ok(NearestPoint { point: p + offset, distance: offset.length(), part: 0, uv })
    }

    /// "bilinear".
    pub fn name(&self) -> &'static str {
        "bilinear"
    }

    /// A sampled point with its exact density `pdf`: uniform by area when the patch is a planar convex
    /// quadrilateral, and nearly so otherwise.
    ///
    /// (u, v) are sampled from the bilinear interpolation of the area elements at the corners.
    pub fn sample_area(&self, u: DVec2) -> Option<SurfaceSample> {
        let w = self.corner_crosses().map(DVec3::length);
        let v = sample_linear(u.y, w[0] + w[1], w[2] + w[3]);
        let lerp = |a: f64, b: f64| (1.0 - v) * a + v * b;
        let uv = DVec2::new(sample_linear(u.x, lerp(w[0], w[2]), lerp(w[1], w[3])), v);
        let surface = self.surface_on(uv);
        let pdf = self.pdf_area(&surface);
        (pdf > 0.0 && pdf.is_finite()).then_some(SurfaceSample { surface, pdf })
    }

    fn pdf_area(&self, surface: &Surface) -> f64 {
        let [w00, w10, w01, w11] = self.corner_crosses().map(DVec3::length);
        let DVec2 { x: u, y: v } = surface.uv;
        let here = (1.0 - v) * ((1.0 - u) * w00 + u * w10) + v * ((1.0 - u) * w01 + u * w11);
        let mean = 0.25 * (w00 + w10 + w01 + w11);
        here / mean / self.dpdu(v).cross(self.dpdv(u)).length()
    }

    /// The solid angle seen from `from` of a rectangle that is sampled by solid angle; `None` otherwise.
    fn sampled_solid_angle(&self, from: DVec3) -> Option<f64> {
        if !self.is_rectangle {
            return None;
        }
        let (ex, ey) = (self.p10 - self.p00, self.p01 - self.p00);
        let cross = ex.cross(ey);
        let height = (self.p00 - from).dot(cross).abs() / cross.length();
        let is_clear = height > CLEARANCE * (ex.length() + ey.length());
        let halves = [(self.p00, self.p10, self.p11), (self.p00, self.p11, self.p01)];
        let solid_angle = halves.into_iter().map(|(a, b, c)| solid_angle_of(a - from, b - from, c - from));
        let solid_angle = solid_angle.sum::<f64>();
        (is_clear && SPHERICAL_SAMPLING.contains(&solid_angle)).then_some(solid_angle)
    }

    /// A point as seen from `from`: uniform by solid angle for a rectangle whose solid angle is neither tiny
    /// nor almost a hemisphere, else as in [`BilinearPatch::sample_area`]; `None` when it is seen edge-on.
    ///
    /// C. Ureña, M. Fajardo, A. King, "An area-preserving parametrization for spherical rectangles",
    /// Eurographics Symposium on Rendering, 2013.
    pub fn sample_direction(&self, from: DVec3, u: DVec2) -> Option<DirectionSample> {
        let Some(solid_angle) = self.sampled_solid_angle(from) else {
            return density::seen_from(from, self.sample_area(u)?);
        };
        // In a frame along its sides, the rectangle spans x0..x1, y0..y1 at depth z0 below the viewpoint.
        let (ex, ey) = (self.p10 - self.p00, self.p01 - self.p00);
        let (width, height) = (ex.length(), ey.length());
        let (x, y) = (ex / width, ey / height);
        let corner = self.p00 - from;
        let (x0, y0) = (corner.dot(x), corner.dot(y));
        let (x1, y1) = (x0 + width, y0 + height);
        let z0 = -corner.dot(x.cross(y)).abs();

        // The z components of the outward normals of the planes through the viewpoint and the sides y0, x1, y1,
        // x0. The other components of neighbours are orthogonal, so the products of these give the angles
        // between the planes.
        let [n0, n1, n2, n3] = [-y0, x1, y1, -x0].map(|s| s / s.hypotenuse(z0));
        let angle = |a: f64, b: f64| (-a * b).arc_cosine();
        let k = TAU - angle(n2, n3) - angle(n3, n0);
        debug_assert!((angle(n0, n1) + angle(n1, n2) - k - solid_angle).abs() < 1e-6);

        let (sin, cos) = (u.x * solid_angle + k).sine_cosine();
        let fu = (cos * n0 - n2) / sin;
        let cu = (1.0_f64.copysign(fu) / (fu * fu + n0 * n0).sqrt()).clamp(-1.0, 1.0);
        let xu = (-cu * z0 / (1.0 - cu * cu).sqrt()).max(x0).min(x1);
        let depth = xu.hypotenuse(z0);
        let (h0, h1) = (y0 / depth.hypotenuse(y0), y1 / depth.hypotenuse(y1));
        let hv = h0 + u.y * (h1 - h0);
        let yv = (hv * depth / (1.0 - hv * hv).sqrt()).max(y0).min(y1);
        let uv = DVec2::new((xu - x0) / width, (yv - y0) / height);
        uv.is_finite().then(|| DirectionSample { surface: self.surface_on(uv), pdf: 1.0 / solid_angle })
    }

    /// The density of [`BilinearPatch::sample_direction`].
    pub fn pdf_direction(&self, ray: &Ray, surface: &Surface) -> f64 {
        match self.sampled_solid_angle(ray.origin) {
            Some(solid_angle) => 1.0 / solid_angle,
            None => density::pdf_seen_from(ray, surface, self.pdf_area(surface)),
        }
    }
}

/// A patch in the sheared space of a ray, which is its last axis.
pub(crate) struct Sheared {
    /// p00, p10, p01, p11.
    pub(crate) corners: [DVec3; 4],
}

/// The z component of a cross product.
fn turn(a: DVec3, b: DVec3) -> f64 {
    dop(a.x, b.y, a.y, b.x)
}

impl Sheared {
    pub(crate) fn outline(&self) -> [DVec3; 4] {
        let [p00, p10, p01, p11] = self.corners;
        [p00, p10, p11, p01]
    }

    /// On which side of each edge of the outline the ray passes.
    #[inline]
    pub(crate) fn sides(&self) -> [Side; 4] {
        let outline = self.outline();
        std::array::from_fn(|i| Side::of(outline[i], outline[(i + 1) % 4]))
    }

    /// How often the outline winds around the ray.
    #[inline]
    pub(crate) fn winding(&self, sides: [Side; 4]) -> i32 {
        let outline = self.outline();
        let mut winding = 0;
        for (i, side) in sides.into_iter().enumerate() {
            let [is_above, goes_above] = [i, (i + 1) % 4].map(|corner| outline[corner].y > 0.0);
            if is_above != goes_above && side.is_positive == goes_above {
                winding += if goes_above { 1 } else { -1 };
            }
        }
        winding
    }

    /// a, h, c and the discriminant of a + 2 h u + c u² = 0, whose roots are the rulings of constant u that meet the
    /// ray.
    #[inline]
    pub(crate) fn rulings(&self) -> [f64; 4] {
        let [p00, p10, p01, p11] = self.corners;
        let (a, c) = (turn(p00, p01), turn(p10 - p00, p11 - p01));
        let h = 0.5 * (turn(p10, p11) - a - c);
        [a, h, c, dop(h, h, a, c)]
    }

    pub(crate) fn at(&self, uv: DVec2) -> DVec3 {
        let [p00, p10, p01, p11] = self.corners;
        let (low, high) = ((1.0 - uv.x) * p00 + uv.x * p10, (1.0 - uv.x) * p01 + uv.x * p11);
        (1.0 - uv.y) * low + uv.y * high
    }

    pub(crate) fn derivatives(&self, uv: DVec2) -> [DVec3; 2] {
        let [p00, p10, p01, p11] = self.corners;
        [(1.0 - uv.y) * (p10 - p00) + uv.y * (p11 - p01), (1.0 - uv.x) * (p01 - p00) + uv.x * (p11 - p10)]
    }

    /// Negative where the ray meets the front.
    fn turn(&self, uv: DVec2) -> f64 {
        let [along_u, along_v] = self.derivatives(uv);
        turn(along_u, along_v)
    }

    /// The (u, v) of the crossings with their multiplicity, given whether their number is odd.
    ///
    /// A. Reshetov, "Cool patches: a geometric approach to ray/bilinear patch intersections", Ray Tracing Gems,
    /// 2019: the rulings of constant u that the ray intersects are roots of a quadratic; the rest is linear. Theirs
    /// tests u and v against 0 and 1, which leaks; here a root that is off by its rounding is moved into the patch.
    fn inside(&self, is_odd: bool) -> [Option<(DVec2, u8)>; 2] {
        let [a, h, c, delta] = self.rulings();
        let roots = quadratic(c, h, a, delta);
        if let Some((double, second)) = roots
            && double == second
            && !is_odd
        {
            let uv = self.on_ruling(double);
            return [(depth(uv) >= 0.0).then_some((uv, 2)), None];
        }
        let uvs = roots.map_or([DVec2::NAN; 2], |(first, second)| {
            [first, second].map(|u| self.refined(self.on_ruling(u)))
        });
        let depths = uvs.map(depth);
        let into = |uv: DVec2| Some((uv.clamp(DVec2::ZERO, DVec2::ONE), 1));
        if is_odd {
            let deepest = if depths[0] >= depths[1] { 0 } else { 1 };
            // A root that is not there, or plainly elsewhere, is that of a patch seen almost edge-on.
            let uv = if depths[deepest] > -1e-3 { Some(uvs[deepest]) } else { self.on_halves() };
            return [uv.and_then(into), None];
        }
        // Both or neither: the one that is farther from the outline is right.
        let decisive = if depths[0].abs() >= depths[1].abs() { depths[0] } else { depths[1] };
        if decisive >= 0.0 { uvs.map(into) } else { [None, None] }
    }

    /// Whether the ray runs along the ruling `u`: seen along the ray, the ruling is a point.
    pub(crate) fn runs_along_ruling(&self, u: f64) -> bool {
        let [first, last] = [0.0, 1.0].map(|v| self.at(DVec2::new(u, v)));
        let size =
            self.corners.iter().fold(0.0_f64, |most, corner| most.max(corner.x.abs().max(corner.y.abs())));
        let is_centred = |p: DVec3| p.x.abs().max(p.y.abs()) <= 1e-14 * size;
        size > 0.0 && is_centred(first) && is_centred(last)
    }

    /// Whether the ruling `u` is parallel to the ray, and does not lie on it: seen along the ray, it is a point
    /// elsewhere.
    pub(crate) fn is_parallel_to_ruling(&self, u: f64) -> bool {
        let [first, last] = [0.0, 1.0].map(|v| self.at(DVec2::new(u, v)));
        let width = |p: DVec3| p.x.abs().max(p.y.abs());
        let size = self.corners.iter().fold(0.0_f64, |most, corner| most.max(width(*corner)));
        let slack = 1e-14 * (1.0 + u.abs()) * size;
        width(last - first) <= slack && width(first) > slack
    }

    /// The point of a ruling that is nearest to the ray.
    pub(crate) fn on_ruling(&self, u: f64) -> DVec2 {
        let [p00, p10, p01, p11] = self.corners;
        let (start, end) = ((1.0 - u) * p00 + u * p10, (1.0 - u) * p01 + u * p11);
        let side = end - start;
        let v = -(start.x * side.x + start.y * side.y) / (side.x * side.x + side.y * side.y);
        DVec2::new(u, v)
    }

    /// A Newton step. A ruling of constant u almost parallel to the ray determines the crossing poorly; afterwards the
    /// error is limited by the angle with the surface alone.
    pub(crate) fn refined(&self, uv: DVec2) -> DVec2 {
        let (p, [along_u, along_v]) = (self.at(uv), self.derivatives(uv));
        let area = turn(along_u, along_v);
        let step = DVec2::new(-turn(p, along_v) / area, -turn(along_u, p) / area);
        // Where the ray almost touches, a step may go anywhere.
        if step.x.abs() + step.y.abs() < 1e-6 { uv + step } else { uv }
    }

    /// The crossing of the two triangles that have the patch's outline.
    fn on_halves(&self) -> Option<DVec2> {
        let [p00, p10, p01, p11] = self.corners;
        let in_half = |a: DVec3, b: DVec3, c: DVec3| {
            let sides = [Side::of(b, c), Side::of(c, a), Side::of(a, b)].map(|side| side.is_positive);
            let weights = [turn(b, c), turn(c, a), turn(a, b)];
            let sum = weights[0] + weights[1] + weights[2];
            (sides[0] == sides[1] && sides[1] == sides[2])
                .then(|| DVec2::new(weights[1] / sum, weights[2] / sum))
        };
        let uv = match in_half(p00, p10, p11) {
            Some(w) => DVec2::new(w.x + w.y, w.y),
            None => in_half(p00, p11, p01).map(|w| DVec2::new(w.x, w.x + w.y))?,
        };
        // Anywhere, where they have no area either.
        Some(if uv.is_finite() { uv } else { DVec2::splat(0.5) })
    }
}

/// How far within the unit square, in its units; negative outside, and −∞ for a NaN.
fn depth(uv: DVec2) -> f64 {
    if uv.is_nan() {
        return f64::NEG_INFINITY;
    }
    uv.x.min(1.0 - uv.x).min(uv.y).min(1.0 - uv.y)
}

/// A number in [0, 1] with a density linear from `a` at 0 to `b` at 1, both ≥ 0 and not both 0.
fn sample_linear(u: f64, a: f64, b: f64) -> f64 {
    (u * (a + b) / (a + ((1.0 - u) * a * a + u * b * b).sqrt())).clamp(0.0, 1.0)
}

/// The `u` in [0, 1] of the rulings whose nearest point to the origin is stationary. With a(u) + v b(u) on the
/// ruling, extended to a whole line, and v = -a·b/b·b its nearest point, the derivative by u times (b·b)² is a
/// quintic.
fn stationary(q00: DVec3, q10: DVec3, q01: DVec3, q11: DVec3) -> RealRoots<6> {
    // Each a polynomial in u.
    let (a, b) = ([q00, q10 - q00], [q01 - q00, (q11 - q10) - (q01 - q00)]);
    let product = |x: &[f64], y: &[f64]| {
        let mut sum = [0.0; 6];
        for (i, x) in x.iter().enumerate() {
            for (j, y) in y.iter().enumerate() {
                // The coefficients beyond degree five cancel.
                if let Some(place) = sum.get_mut(i + j) {
                    *place += x * y;
                }
            }
        }
        sum
    };
    let dot =
        |x: [DVec3; 2], y: [DVec3; 2]| [x[0].dot(y[0]), x[0].dot(y[1]) + x[1].dot(y[0]), x[1].dot(y[1])];
    let along = |x: [DVec3; 2], y: DVec3| [x[0].dot(y), x[1].dot(y)];
    let (n, d) = (dot(a, b), dot(b, b));
    let square = product(&d, &d);
    let both = product(&n, &d);
    let first = product(&along(a, a[1]), &square[..5]);
    let second = product(&both[..5], &along(a, b[1]));
    let third = product(&both[..5], &along(b, a[1]));
    let fourth = product(&product(&n, &n)[..5], &along(b, b[1]));
    let slope: [f64; 6] = std::array::from_fn(|i| first[i] - second[i] - third[i] + fourth[i]);
    roots_between(&slope, 0.0, 1.0)
}
