//! The watertight test of triangles: one by one, by eight, and by sixteen with a ray each.
//!
//! After S. Woop, C. Benthin, I. Wald, "Watertight Ray/Triangle Intersection", JCGT 2(1), 2013, with three differences.
//! Everything after the load is in f64. An edge function whose products are equal is computed again exactly, so that
//! its sign is always the sign of the exact edge function of the sheared corners. If that is exactly zero, the ray
//! counts as moved by (ε, ε²) in the sheared plane ("simulation of simplicity": H. Edelsbrunner, E. Mücke, ACM
//! Transactions on Graphics 9(1), 1990). The signs are then those of one ray in general position, the same for every
//! triangle: such a ray crosses a closed mesh an even number of times and meets no edge and no vertex, so that each
//! crossing has exactly one owner.

use lumbre_geometry::{Ray, Root};
use lumbre_math::{DVec2, DVec3, Elementary};

use super::axes::Axes;
use crate::simd::{LANES, Row};
use crate::tree::filter_start::MIN_SIZE;

/// The shear that turns a ray's direction into the last axis; computed once per ray.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shear {
    /// The axes that become x, y and z; z is the direction's largest.
    pub(crate) axes: &'static Axes,
    pub(crate) x: f64,
    pub(crate) y: f64,
    /// The direction's largest component.
    pub(crate) direction_z: f64,
}

impl Shear {
    #[inline(always)]
    pub(crate) fn new(direction: &DVec3) -> Self {
        Self::along(Axes::new(direction), direction)
    }

    /// For a direction that has these axes.
    #[inline(always)]
    pub(crate) fn along(axes: &'static Axes, direction: &DVec3) -> Self {
        let [x, y, z] = axes.permute(direction);
        Self { axes, x: x / z, y: y / z, direction_z: z }
    }

    /// The ray's origin relative to a mesh's, in the order of the axes.
    #[inline(always)]
    pub(crate) fn local_origin(&self, ray_origin: &DVec3, mesh_origin: &DVec3) -> [f64; 3] {
        let ([x, y, z], mesh) = (self.axes.permute(ray_origin), self.axes.permute(mesh_origin));
        [x - mesh[0], y - mesh[1], z - mesh[2]]
    }

    #[inline(always)]
    fn corners(&self, origin: &[f64; 3], &[a, b, c]: &[[f32; 3]; 3]) -> [Corner; 3] {
        let shear = [self.x, self.y];
        [sheared(shear, origin, a), sheared(shear, origin, b), sheared(shear, origin, c)]
    }
}

/// A sheared corner. The shear is the first two components of the direction, divided by the last. All are in the order
/// of the axes.
#[inline(always)]
fn sheared(shear: [f64; 2], origin: &[f64; 3], [x, y, z]: [f32; 3]) -> Corner {
    let height = f64::from(z) - origin[2];
    Corner {
        x: (f64::from(x) - origin[0]) - shear[0] * height,
        y: (f64::from(y) - origin[1]) - shear[1] * height,
        z: height,
    }
}

/// A ray in single precision, for a sharp but conservative first test of eight triangles.
///
/// # Error bound
///
/// Let u = 2⁻²⁴, L the largest coordinate of a corner of the mesh plus the largest of the ray's origin, both relative
/// to the mesh, and R the largest coordinate of a triangle's corners relative to the ray's origin. The origin is kept
/// in two parts: rounded, and the rest, so that together they have an error of u²L, and differences from it a relative
/// error of R. What follows is the sheared corner (x, y, z), z without the rest, compared with that of the test in
/// double precision.
///
/// Let |x|, |y| ≤ m and |z| ≤ h be as computed, and s = m + h + 4uL. The error of x is u(m + h) from the difference and
/// as much from the sum with the rest, uh from z, uh from the product if that is rounded separately, 4.1uh from the
/// shear (at most 1, and the quotient of rounded numbers through a rounded inverse), um from the last subtraction, and
/// 12.3u²L from the rest of the origin and its shear, which with what the rest adds to the first two is 16.3u²L. The
/// sum is u(3m + 8.1h) + 16.3u²L. So δ = 8.5us is larger, and covers rounding in double precision too.
///
/// An edge function xy' - yx' has an error of 4δm + 2δ² from the corners, and of 4.1um² from its own rounding: at most
/// 38.1usm + 145u²s². With `error = 40us (m + 4us)`, which covers its own rounding, an edge function that is not
/// negative in double precision is at least `-error` here. [`TINY`] is added for underflow.
///
/// Let D be the sum of the computed edge functions. A crossing inside the triangle is at the z for which Σ eᵢ (zᵢ - z)
/// is zero in double precision, and between the least and the largest zᵢ. With errors of `error` in each edge function,
/// Σ eᵢ zᵢ differs from z D by at most 3 `error` times the triangle's extent in z: the actual errors are smaller by a
/// twentieth. Rounding errors of the three products and their sums are below 4uh Σ |eᵢ|, those of the corners' z below
/// uh Σ |eᵢ|, those of D below 2uh Σ |eᵢ|, and those from the rest of the origin, of which D takes a part, below us Σ
/// |eᵢ|; those of the ends of the interval, which are compared with products of the range's ends with |D|, or
/// multiplied by its inverse, below 3uh Σ |eᵢ|. No edge function is beyond `error` on the other side than D, so Σ |eᵢ|
/// ≤ |D| + 6 `error`. So `spread = 3 error extent + 12us (|D| + 6 error) + TINY` covers all of it, for any D.
///
/// If all edge functions are beyond `error` on one side, those in double precision are beyond zero on the same side:
/// the line does meet the triangle, and the face is certain too. If height ± spread lies between `surely_first` and
/// `surely_last`, the hit is in range. The ends of the range are moved, outwards or inwards, by their own possible
/// rounding error.
///
/// Nothing overflows, since L ≤ 2³⁸ and so Σ |eᵢ zᵢ| < 2¹²³; for a larger L the test is skipped. It is also skipped
/// below 2⁻⁵⁰, and below 2⁻⁴⁰ nothing is certain.
///
/// The last axis is that of double precision; along it, the rounded direction is no shorter than along the others.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BlockRay {
    pub(crate) axes: &'static Axes,
    /// Relative to the mesh, rounded, in the order of the axes; the last of four is unused, here and below.
    pub(crate) origin: [f32; 4],
    /// The rounding error of the origin, sheared like corners.
    pub(crate) rest: [f32; 4],
    /// The direction divided by its last component, in the order of the axes.
    pub(crate) shear: [f32; 4],
    /// 4uL, for the largest possible L.
    pub(crate) least_size: f32,
    pub(crate) range: HeightRange,
    /// A zero, negative if the last component of the direction is positive: its sign flips the sign of negated heights,
    /// so that they grow along the ray.
    pub(crate) turn: f32,
}

/// The range of a ray in heights.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub(crate) struct HeightRange {
    /// Heights along the ray outside these two are out of range.
    pub(crate) first: f32,
    pub(crate) last: f32,
    /// Heights between these are in range.
    pub(crate) surely_first: f32,
    pub(crate) surely_last: f32,
}

/// u.
const ROUNDOFF: f32 = 1.0 / (1 << 24) as f32;
/// The factors of the error bounds of edge functions and heights.
pub(crate) const EDGE_ERROR: f32 = 40.0 * ROUNDOFF;
pub(crate) const SIZE_ERROR: f32 = 4.0 * ROUNDOFF;
pub(crate) const HEIGHT_ERROR: f32 = 12.0 * ROUNDOFF;
/// Factors of an edge function's error: in the error of a height by the extent in z, and in the bound on all edge
/// functions.
pub(crate) const ERRORS_OF_EXTENT: f32 = 3.0;
pub(crate) const ERRORS_OF_EDGES: f32 = 6.0;
/// Larger than any underflow.
pub(crate) const TINY: f32 = 1.0 / (1u128 << 120) as f32;
/// Larger than a few rounding errors.
pub(crate) const ROUNDINGS: f32 = 6.0 * ROUNDOFF;
/// Moves a position in the range of boxes, a nonnegative product of a few rounded numbers, beyond its possible error.
pub(crate) const BEYOND: f32 = 1.0 + 2.0 * ROUNDINGS;
/// No relevant height is larger, and a range may end there.
pub(crate) const FAR: f32 = (1u128 << 100) as f32;
/// The bounds on L; below the third nothing is certain.
const SMALLEST_REACH: f32 = 1.0 / (1u64 << 50) as f32;
const LARGEST_REACH: f32 = (1u64 << 38) as f32;
const SMALLEST_SURE_REACH: f32 = 1.0 / (1u64 << 40) as f32;

impl HeightRange {
    /// For ends that are products of a few rounded numbers.
    #[inline(always)]
    pub(crate) fn new(start: f32, end: f32) -> Self {
        let within = |height: f32| if height < FAR { if height > -FAR { height } else { -FAR } } else { FAR };
        let (start, end) = (within(start), within(end));
        let (start_error, end_error) = (start.abs() * ROUNDINGS, end.abs() * ROUNDINGS);
        Self {
            first: start - start_error,
            last: end + end_error,
            surely_first: start + start_error,
            surely_last: end - end_error,
        }
    }

    /// As [`Self::new`], if no end is negative.
    #[inline(always)]
    pub(crate) fn ahead(start: f32, end: f32) -> Self {
        let within = |height: f32| if height < FAR { height } else { FAR };
        let (start, end) = (within(start), within(end));
        Self {
            first: start * (1.0 - ROUNDINGS),
            last: end * (1.0 + ROUNDINGS),
            surely_first: start * (1.0 + ROUNDINGS),
            surely_last: end * (1.0 - ROUNDINGS),
        }
    }
}

impl BlockRay {
    /// For the exact test's ray in a mesh whose largest coordinate is `largest_corner`; `origin` has the order of the
    /// axes. `None` if the test would be too coarse.
    #[inline(always)]
    pub(crate) fn new(
        shear: &Shear,
        origin: &[f64; 3],
        largest_corner: f32,
        t_min: f64,
        t_max: f64,
    ) -> Option<Self> {
        let rounded = origin.map(|x| x as f32);
        let rest = [0, 1, 2].map(|axis| (origin[axis] - f64::from(rounded[axis])) as f32);
        let shear_x_y = [shear.x as f32, shear.y as f32];
        let reach = larger(larger(rounded[0].abs(), rounded[1].abs()), rounded[2].abs()) + largest_corner;
        if !(SMALLEST_REACH..=LARGEST_REACH).contains(&reach) {
            return None;
        }
        let length = shear.direction_z.abs();
        let mut range = HeightRange::new((t_min * length) as f32, (t_max * length) as f32);
        if reach < SMALLEST_SURE_REACH || length < 1e-200 {
            // An infinite height counts as out of range for certainty.
            (range.surely_first, range.surely_last) = (f32::INFINITY, f32::NEG_INFINITY);
        }
        Some(Self {
            axes: shear.axes,
            origin: [rounded[0], rounded[1], rounded[2], 0.0],
            rest: [rest[0] - shear_x_y[0] * rest[2], rest[1] - shear_x_y[1] * rest[2], rest[2], 0.0],
            shear: [shear_x_y[0], shear_x_y[1], 1.0, 0.0],
            least_size: reach * MIN_SIZE,
            range,
            turn: if shear.direction_z < 0.0 { 0.0 } else { -0.0 },
        })
    }

    /// Excludes what lies beyond `t_max`.
    #[inline(always)]
    pub(crate) fn end_at(&mut self, shear: &Shear, t_max: f64) {
        let end = (t_max * shear.direction_z.abs()) as f32;
        self.range.last = HeightRange::new(end, end).last;
    }
}

// One instruction, unlike `f32::max`.
#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// See [`BEYOND`]. Rays from nearby start at zero or later, so no hit has a negative height.
#[inline(always)]
pub(crate) fn beyond(place: f32) -> f32 {
    place * BEYOND + f32::MIN_POSITIVE
}

/// A sheared corner: the ray is the z axis.
#[derive(Clone, Copy)]
struct Corner {
    x: f64,
    y: f64,
    z: f64,
}

/// Where a ray hits the outline of a triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Feature {
    /// The edge opposite this corner.
    Edge(usize),
    /// This corner.
    Vertex(usize),
    /// Seen on edge: never hit, but a neighbour of other triangles.
    EdgeOn,
}

/// How a ray meets a triangle.
pub(crate) enum Meeting {
    /// Not at all, or out of range.
    Miss,
    /// In range, away from its edges.
    Hit {
        /// The crossing.
        root: Root,
        /// Whether the ray meets the front.
        is_front: bool,
    },
    /// Exactly at an edge or a corner, in range or not.
    Touch {
        /// The crossing.
        root: Root,
        /// Whether this triangle owns the crossing.
        is_owned: bool,
        /// The edge or corner.
        feature: Feature,
        /// Whether the ray meets the front.
        is_front: bool,
    },
}

/// How a ray passes a triangle, regardless of its range.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum EdgeTest {
    /// Outside of it.
    Outside,
    /// Through it, away from its edges.
    Inside,
    /// So near an edge, or through a triangle so flat, that [`intersect`] has to decide.
    Uncertain,
}

/// The data of a triangle's crossing.
#[derive(Clone, Copy)]
pub(crate) struct Inside {
    /// The heights of the corners, weighted.
    pub(crate) height: f64,
    /// The sum of the weights: positive if the front is met.
    pub(crate) det: f64,
    /// Two of the weights.
    pub(crate) v: f64,
    pub(crate) w: f64,
}

impl Inside {
    /// No crossing.
    pub(crate) const NONE: Self = Self { height: f64::NAN, det: f64::NAN, v: f64::NAN, w: f64::NAN };

    #[inline(always)]
    pub(crate) fn t(&self, shear: &Shear) -> f64 {
        self.t_along(shear.direction_z)
    }

    /// For a direction whose largest component this is.
    #[inline(always)]
    fn t_along(&self, direction_z: f64) -> f64 {
        self.height / self.det / direction_z
    }

    /// The barycentrics of the crossing: those of the second and third corner.
    #[inline(always)]
    pub(crate) fn local(&self) -> DVec2 {
        DVec2::new(self.v / self.det, self.w / self.det)
    }

    /// The crossing, whose `t` this is.
    #[inline(always)]
    pub(crate) fn root(&self, t: f64) -> Root {
        root(t, self.local())
    }

    fn meeting(&self, ray: &Ray, shear: &Shear) -> Meeting {
        let t = self.t(shear);
        if is_in_range(ray, t) {
            Meeting::Hit { root: self.root(t), is_front: self.det > 0.0 }
        } else {
            Meeting::Miss
        }
    }
}

/// The crossing of a triangle at this `t`, with these barycentrics.
#[inline(always)]
pub(crate) fn root(t: f64, local: DVec2) -> Root {
    Root { t, part: 0, multiplicity: 1, local }
}

/// Whether a triangle may be met there. NaN is out of range, and an infinite `t` is never met.
#[inline(always)]
pub(crate) fn is_in_range(ray: &Ray, t: f64) -> bool {
    ray.t_min <= t && t <= ray.t_max && t.abs() < f64::INFINITY
}

/// How the ray passes a triangle. Corners and origin are relative to the mesh, and have the order of the shear's axes.
#[inline(always)]
pub(crate) fn edge_test(shear: &Shear, origin: &[f64; 3], corners: &[[f32; 3]; 3]) -> (EdgeTest, Inside) {
    edge_test_of(shear.corners(origin, corners))
}

#[inline(always)]
fn edge_test_of(corners: [Corner; 3]) -> (EdgeTest, Inside) {
    let weights = weigh(corners);
    if !weights.are_of_inside() {
        let [u, v, w] = weights.edges;
        let is_weakly_inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
        return (if is_weakly_inside { EdgeTest::Uncertain } else { EdgeTest::Outside }, Inside::NONE);
    }
    if weights.cancel() {
        return (EdgeTest::Uncertain, Inside::NONE);
    }
    (EdgeTest::Inside, weights.inside)
}

/// How a line passes the edges of a triangle.
#[derive(Clone, Copy)]
struct Weights {
    edges: [f64; 3],
    /// The first product of each edge function.
    products: [f64; 3],
    inside: Inside,
}

/// From sheared corners, branch-free.
#[inline(always)]
fn weigh([a, b, c]: [Corner; 3]) -> Weights {
    // The edge functions px qy - py qx. The two products of each are rounded separately: the opposite edge of the
    // neighbour then gives exactly the opposite value, and their difference has the right sign unless they are equal.
    let (bc, ca, ab) = (c.x * b.y, a.x * c.y, b.x * a.y);
    let (u, v, w) = (bc - c.y * b.x, ca - a.y * c.x, ab - b.y * a.x);
    let inside = Inside { height: u * a.z + v * b.z + w * c.z, det: u + v + w, v, w };
    Weights { edges: [u, v, w], products: [bc, ca, ab], inside }
}

impl Weights {
    /// Whether the line passes through the triangle, away from its edges.
    #[inline(always)]
    fn are_of_inside(&self) -> bool {
        let [u, v, w] = self.edges;
        ((u > 0.0) & (v > 0.0) & (w > 0.0)) | ((u < 0.0) & (v < 0.0) & (w < 0.0))
    }

    /// Whether the triangle is seen on edge, so that its edge functions cancel; `t` would be arbitrary.
    #[inline(always)]
    fn cancel(&self) -> bool {
        let det = self.inside.det.abs();
        let [bc, ca, ab] = self.products;
        let least = 1.0 / 64.0;
        (det < bc.abs() * least) | (det < ca.abs() * least) | (det < ab.abs() * least)
    }
}

/// Sixteen triangles, each with its own ray; all rays have these axes.
pub(crate) struct Pairs<'a> {
    /// In the order of the axes.
    pub(crate) origin: [&'a Row<f64>; 3],
    pub(crate) mesh_origin: [f64; 3],
    pub(crate) direction: [&'a Row<f64>; 3],
    /// `[corner][axis]`, in the same order, relative to the mesh.
    pub(crate) corners: &'a [[Row<f32>; 3]; 3],
}

/// Where sixteen rays meet triangles.
pub(crate) struct Met {
    /// NaN unless the ray passes [`EdgeTest::Inside`].
    pub(crate) t: Row<f64>,
    pub(crate) local: [Row<f64>; 2],
}

impl Met {
    pub(crate) const NONE: Self = Self { t: Row::of(f64::NAN), local: [Row::of(f64::NAN); 2] };
}

impl Pairs<'_> {
    /// Where each ray meets its triangle: [`edge_test`] of every pair, by the same operations in lanes.
    #[inline(always)]
    pub(crate) fn meet(&self) -> Met {
        let mut met = Met::NONE;
        for i in 0..LANES {
            let [x, y, z] = [self.direction[0].0[i], self.direction[1].0[i], self.direction[2].0[i]];
            let origin = [
                self.origin[0].0[i] - self.mesh_origin[0],
                self.origin[1].0[i] - self.mesh_origin[1],
                self.origin[2].0[i] - self.mesh_origin[2],
            ];
            let shear = [x / z, y / z];
            let [a, b, c] = self.corners;
            let weights = weigh([
                sheared(shear, &origin, [a[0].0[i], a[1].0[i], a[2].0[i]]),
                sheared(shear, &origin, [b[0].0[i], b[1].0[i], b[2].0[i]]),
                sheared(shear, &origin, [c[0].0[i], c[1].0[i], c[2].0[i]]),
            ]);
            let inside = &weights.inside;
            let is_clear = weights.are_of_inside() & !weights.cancel();
            let t = inside.t_along(z);
            met.t.0[i] = if is_clear { t } else { f64::NAN };
            let local = inside.local();
            met.local[0].0[i] = local.x;
            met.local[1].0[i] = local.y;
        }
        met
    }
}

/// How the ray meets a triangle. Corners and origin are relative to the mesh, and have the order of the shear's axes.
#[inline(never)]
pub(crate) fn intersect(ray: &Ray, shear: Shear, origin: [f64; 3], corners: [[f32; 3]; 3]) -> Meeting {
    match edge_test(&shear, &origin, &corners) {
        (EdgeTest::Outside, _) => Meeting::Miss,
        (EdgeTest::Inside, inside) => inside.meeting(ray, &shear),
        (EdgeTest::Uncertain, _) => intersect_uncertain(ray, &shear, shear.corners(&origin, &corners)),
    }
}

/// As [`intersect`], for corners in double precision in the space of the ray.
pub(crate) fn intersect_precise(ray: &Ray, shear: Shear, corners: &[DVec3; 3]) -> Meeting {
    let [x, y, z] = shear.axes.permute(&ray.origin);
    let corners = corners.map(|corner| {
        let corner = shear.axes.permute(&corner);
        let height = corner[2] - z;
        Corner { x: (corner[0] - x) - shear.x * height, y: (corner[1] - y) - shear.y * height, z: height }
    });
    match edge_test_of(corners) {
        (EdgeTest::Outside, _) => Meeting::Miss,
        (EdgeTest::Inside, inside) => inside.meeting(ray, &shear),
        (EdgeTest::Uncertain, _) => intersect_uncertain(ray, &shear, corners),
    }
}

/// Decides about a triangle some of whose edge functions may have rounded to zero, while the others have one sign, or
/// about one that is seen on edge.
fn intersect_uncertain(ray: &Ray, shear: &Shear, corners: [Corner; 3]) -> Meeting {
    let [a, b, c] = corners;
    let [u, v, w] = [settled_edge(c, b), settled_edge(a, c), settled_edge(b, a)];
    let is_inside = (u > 0.0 && v > 0.0 && w > 0.0) || (u < 0.0 && v < 0.0 && w < 0.0);
    if !is_inside {
        let is_weakly_inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
        return if is_weakly_inside { touch(shear, corners) } else { Meeting::Miss };
    }
    let det = u + v + w;
    let largest_product = (c.x * b.y).abs().max((a.x * c.y).abs()).max((b.x * a.y).abs());
    let [u, v, w] = if det.abs() < largest_product * (1.0 / 64.0) {
        [difference_of_products(c, b), difference_of_products(a, c), difference_of_products(b, a)]
    } else {
        [u, v, w]
    };
    let height = u * a.z + v * b.z + w * c.z;
    let inside = Inside { height, det: u + v + w, v, w };
    match inside.meeting(ray, shear) {
        Meeting::Hit { root, .. } => Meeting::Hit { root, is_front: det > 0.0 },
        miss => miss,
    }
}

/// The edge function px qy - py qx; if its rounded products are equal, the difference of their errors.
fn settled_edge(p: Corner, q: Corner) -> f64 {
    let (first, second) = (p.x * q.y, p.y * q.x);
    if first != second { first - second } else { residue(p, q, first) }
}

/// px qy - py qx if both products round to `product`.
fn residue(p: Corner, q: Corner, product: f64) -> f64 {
    p.x.multiply_add(q.y, -product) - p.y.multiply_add(q.x, -product)
}

/// A triangle whose nonzero edge functions have one sign.
fn touch(shear: &Shear, corners: [Corner; 3]) -> Meeting {
    let [a, b, c] = corners;
    let values = [difference_of_products(c, b), difference_of_products(a, c), difference_of_products(b, a)];
    let feature = match values.map(|value| value == 0.0) {
        [true, false, false] => Feature::Edge(0),
        [false, true, false] => Feature::Edge(1),
        [false, false, true] => Feature::Edge(2),
        [false, true, true] => Feature::Vertex(0),
        [true, false, true] => Feature::Vertex(1),
        [true, true, false] => Feature::Vertex(2),
        [true, true, true] => Feature::EdgeOn,
        [false, false, false] => return Meeting::Miss,
    };
    let [u, v, w] = values;
    let det = u + v + w;
    let t = (u * a.z + v * b.z + w * c.z) / det / shear.direction_z;
    let root = root(t, DVec2::new(v / det, w / det));
    if feature != Feature::EdgeOn && !root.t.is_finite() {
        return Meeting::Miss;
    }
    let sides = [side(c, b), side(a, c), side(b, a)];
    let is_owned = feature != Feature::EdgeOn && sides[0].is_some() && sides.iter().all(|s| *s == sides[0]);
    let is_front = values.iter().any(|&value| value > 0.0);
    Meeting::Touch { root, is_owned, feature, is_front }
}

/// Whether the edge function px qy - py qx is positive for the ray moved by (ε, ε²). `None` if the edge is a point.
fn side(p: Corner, q: Corner) -> Option<bool> {
    let (first, second) = (p.x * q.y, p.y * q.x);
    let difference = first - second;
    if difference != 0.0 {
        return Some(difference > 0.0);
    }
    let value = residue(p, q, first);
    // (p - m) × (q - m) with m = (ε, ε²) is value + ε (p.y - q.y) + ε² (q.x - p.x).
    [value, p.y - q.y, q.x - p.x].into_iter().find(|&term| term != 0.0).map(|term| term > 0.0)
}

/// px qy - py qx within 1.5 ulp (W. Kahan; C.-P. Jeannerod, N. Louvet, J.-M. Muller, Mathematics of Computation 82,
/// 2013).
fn difference_of_products(p: Corner, q: Corner) -> f64 {
    let second = p.y * q.x;
    let error = (-p.y).multiply_add(q.x, second);
    p.x.multiply_add(q.y, -second) + error
}
