//! Many thin curves: cubic Bézier segments with a width.

use std::f64::consts::PI;
use std::fmt;

use lumbre_math::rounding::gamma;
use lumbre_math::{DVec2, DVec3, Elementary, Vec3};

use crate::curve_chords::{CHORDS, may_touch, passes_line};
use crate::shape::check;
use crate::{Aabb, Ray, Root, Roots, ShapeError, Strand, Surface};

/// How a curve is shaded across its width.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CurveKind {
    /// A ribbon that faces every ray.
    #[default]
    Flat,
    /// The same ribbon, with the normals of a tube: they turn linearly with v, from one side to the other.
    Cylinder,
    /// A ribbon with normals of its own.
    Ribbon,
}

/// Curves of one kind, each of one or more cubic Bézier segments.
///
/// A ray crosses a segment where the segment passes it nearest by half its width or less, measured across the ray, and
/// at the depth of the segment's axis there: what is crossed is a ribbon about the axis that is turned to the ray, or
/// for [`CurveKind::Ribbon`] one as wide as a ribbon of its own normal looks. Ends are cut across the axis. The place
/// is a root of a polynomial, bracketed by planes which neighbouring pieces share, so no ray passes between two of
/// them, and the answers do not depend on how segments are cut for a tree.
///
/// Control points have single precision, relative to an origin in double precision.
///
/// Ribbons that face the ray, ends and normals are those of M. Pharr, W. Jakob, G. Humphreys, "Physically Based
/// Rendering", 4th edition, 2023, section 6.7. There the curve is a chain of chords; here its nearest point is found,
/// by Newton's method.
#[derive(Clone)]
pub struct Curves {
    kind: CurveKind,
    origin: DVec3,
    // 3 n + 1 of each strand of n segments.
    points: Vec<Vec3>,
    segments: Vec<Segment>,
    // The first segment of each strand.
    strands: Vec<u32>,
    // Of a ribbon: unit, at both ends of each segment.
    normals: Vec<[Vec3; 2]>,
    // Each segment is 2 to this power primitives.
    splits: u32,
}

#[derive(Clone, Copy, Debug)]
struct Segment {
    /// Where its four control points begin.
    first: u32,
    /// At both ends.
    widths: [f32; 2],
    /// Everything of it is this near to the line through its ends, or nearer.
    reach: f32,
}

/// Relative to the ray: x and y across, z along its unit direction.
type Cubic = [DVec3; 4];

/// How often a segment is halved at most, for rays which it passes equally near over some length.
const MAX_DEPTH: u32 = 10;

impl Curves {
    /// No curves yet. Each segment will be two primitives: see [`Curves::with_splits`].
    pub fn new(kind: CurveKind) -> Self {
        Self {
            kind,
            origin: DVec3::ZERO,
            points: vec![],
            segments: vec![],
            strands: vec![],
            normals: vec![],
            splits: 1,
        }
    }

    /// Adds a curve. What single precision cannot hold is rounded: control points relative to the first point of the
    /// first curve.
    ///
    /// # Errors
    /// [`ShapeError`] for points that are too far from the first, and for a ribbon without normals.
    pub fn push(&mut self, strand: &Strand) -> Result<(), ShapeError> {
        let is_ribbon = self.kind == CurveKind::Ribbon;
        if is_ribbon && strand.normals().is_empty() {
            return Err(ShapeError::Degenerate("a ribbon has no normals"));
        }
        if self.points.is_empty() {
            self.origin = strand.points()[0];
        }
        let origin = self.origin;
        let relative = |p: DVec3| (p - origin).as_vec3();
        if let Some(far) = strand.points().iter().find(|&&p| !relative(p).is_finite()) {
            check::finite("P", DVec3::INFINITY.copysign(*far - origin))?;
        }
        let first = self.first_of_more(strand.points().len())?;
        self.strands.push(self.segments.len() as u32);
        self.points.extend(strand.points().iter().map(|&p| relative(p)));
        for (i, widths) in strand.widths().windows(2).enumerate() {
            let widths = [widths[0] as f32, widths[1] as f32];
            let first = first + 3 * i as u32;
            let reach = reach_of(&self.points[first as usize..], widths);
            self.segments.push(Segment { first, widths, reach });
        }
        if is_ribbon {
            self.normals.extend(strand.normals().windows(2).map(|n| [n[0].as_vec3(), n[1].as_vec3()]));
        }
        Ok(())
    }

    /// Adds all of other curves of the same kind.
    ///
    /// # Errors
    /// [`ShapeError`] where they are too far away or too many, or of another kind; nothing is added then.
    pub fn append(&mut self, other: &Self) -> Result<(), ShapeError> {
        if self.kind != other.kind {
            return Err(ShapeError::Degenerate("these curves are of another kind"));
        }
        if self.points.is_empty() {
            let splits = self.splits;
            *self = Self { splits, ..other.clone() };
            return Ok(());
        }
        let offset = other.origin - self.origin;
        let relative = |p: &Vec3| (p.as_dvec3() + offset).as_vec3();
        if !other.points.iter().all(|p| relative(p).is_finite()) {
            return Err(ShapeError::Degenerate("these curves are too far apart for one shape"));
        }
        let first = self.first_of_more(other.points.len())?;
        let segments = self.segments.len() as u32;
        self.points.extend(other.points.iter().map(relative));
        for segment in &other.segments {
            let first = segment.first + first;
            // Anew, for the points were rounded.
            let reach = reach_of(&self.points[first as usize..], segment.widths);
            self.segments.push(Segment { first, reach, ..*segment });
        }
        self.strands.extend(other.strands.iter().map(|first| first + segments));
        self.normals.extend(&other.normals);
        Ok(())
    }

    /// The index at which this many more control points begin.
    fn first_of_more(&self, count: usize) -> Result<u32, ShapeError> {
        match u32::try_from(self.points.len() + count) {
            Ok(_) => Ok(self.points.len() as u32),
            Err(_) => Err(ShapeError::Degenerate("curves of more than 2^32 control points make no shape")),
        }
    }

    /// The same curves, each segment in 2^`splits` primitives; at most 64. More primitives have tighter boxes and take
    /// more memory, and change no answer. Among hairs of one segment, two primitives are 1.5 times as fast as one, and
    /// eight twice; a tree takes 50 bytes a primitive.
    #[must_use]
    pub fn with_splits(mut self, splits: u32) -> Self {
        let most = (u32::MAX / self.segments.len().max(1) as u32).ilog2();
        self.splits = splits.min(most).min(6);
        self
    }

    /// How each is shaded.
    pub fn kind(&self) -> CurveKind {
        self.kind
    }

    /// The number of curves.
    pub fn len(&self) -> usize {
        self.strands.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.strands.is_empty()
    }

    /// The number of segments of all curves.
    pub fn segment_count(&self) -> usize {
        self.segments.len()
    }

    /// The number of primitives: pieces of segments.
    pub fn primitive_count(&self) -> u32 {
        (self.segments.len() as u32) << self.splits
    }

    /// The bytes that are kept for all curves.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.points[..])
            + size_of_val(&self.segments[..])
            + size_of_val(&self.strands[..])
            + size_of_val(&self.normals[..])
    }

    /// The segment that a primitive is of, among those of all curves.
    pub fn segment_of(&self, primitive: u32) -> u32 {
        primitive >> self.splits
    }

    /// The curve that a primitive is of, and which of its segments it is of; both from 0.
    pub fn strand_of(&self, primitive: u32) -> (u32, u32) {
        let segment = primitive >> self.splits;
        let strand = self.strands.partition_point(|&first| first <= segment) - 1;
        (strand as u32, segment - self.strands[strand])
    }

    /// The control points of the segment that a primitive is of.
    pub fn control_points(&self, primitive: u32) -> [DVec3; 4] {
        let first = self.segment(primitive).first as usize;
        std::array::from_fn(|i| self.origin + self.points[first + i].as_dvec3())
    }

    /// The width at a parameter of the segment that a primitive is of.
    pub fn width(&self, primitive: u32, u: f64) -> f64 {
        width_at(self.segment(primitive), u)
    }

    /// The box of all.
    pub fn bounds_of_all(&self) -> Aabb {
        (0..self.primitive_count()).fold(Aabb::EMPTY, |all, primitive| all.union(self.bounds(primitive)))
    }

    /// The box of a primitive.
    pub fn bounds(&self, primitive: u32) -> Aabb {
        let first = self.segment(primitive).first as usize;
        let whole: Cubic = std::array::from_fn(|i| self.points[first + i].as_dvec3());
        let (piece, [u0, u1]) = self.piece(whole, primitive);
        let reach = 0.5 * self.width(primitive, u0).max(self.width(primitive, u1));
        let around = Aabb::around(piece);
        Aabb { min: self.origin + around.min - reach, max: self.origin + around.max + reach }.outward(4)
    }

    /// The sum of the lengths of all segments, each times its mean width.
    pub fn area(&self) -> f64 {
        let area = |segment: &Segment| {
            let first = segment.first as usize;
            let p: Cubic = std::array::from_fn(|i| self.points[first + i].as_dvec3());
            // Gauss's rule of five points.
            let nodes = [
                (0.0, 0.568_888_888_888_888_9),
                (0.538_469_310_105_683, 0.478_628_670_499_366_5),
                (0.906_179_845_938_664, 0.236_926_885_056_189_1),
            ];
            let at = |u: f64| at(&p, u)[1].length() * width_at(segment, u);
            let sum = |(x, weight): (f64, f64)| {
                if x == 0.0 { weight * at(0.5) } else { weight * (at(0.5 - 0.5 * x) + at(0.5 + 0.5 * x)) }
            };
            0.5 * nodes.into_iter().map(sum).sum::<f64>()
        };
        self.segments.iter().map(area).sum()
    }

    /// The first crossing of a primitive in the ray's range.
    pub fn closest(&self, primitive: u32, ray: &Ray) -> Option<Root> {
        let mut search = Search::new(self, primitive, ray)?;
        search.first_only = true;
        search.primitive(primitive);
        search.found.first().copied()
    }

    /// Every crossing of a primitive in the ray's range, appended in ascending order.
    pub fn roots(&self, primitive: u32, ray: &Ray, out: &mut Roots) {
        let Some(mut search) = Search::new(self, primitive, ray) else { return };
        search.primitive(primitive);
        search.found.sort_by(|a, b| a.t.total_cmp(&b.t));
        out.extend(search.found);
    }

    /// The surface at a crossing: the normal of a ribbon, or one that faces the ray; u along the segment and v across
    /// it, each in [0, 1].
    ///
    /// Where exactly light leaves a fibre is not modelled. The error of the point is so large that rays leave it by
    /// more than the width, so no curve shades itself.
    pub fn surface(&self, primitive: u32, ray: &Ray, root: &Root) -> Surface {
        let DVec2 { x: u, y: v } = root.local;
        let p = self.control_points(primitive);
        let [_, mut dpdu, _] = at(&p, u);
        if dpdu == DVec3::ZERO {
            dpdu = p[3] - p[0];
        }
        let width = self.width(primitive, u);
        let along_ray = ray.direction.normalize();
        let tangent = dpdu.normalize_or(along_ray.any_orthonormal_vector());
        let across = along_ray.cross(tangent);
        let across = across.try_normalize().unwrap_or_else(|| tangent.any_orthonormal_vector());
        let facing = across.cross(tangent);
        let (normal, dpdv, dndv) = match self.kind {
            CurveKind::Flat => (facing, across, DVec3::ZERO),
            CurveKind::Cylinder => {
                let (sine, cosine) = ((v - 0.5) * PI).sine_cosine();
                let dpdv = cosine * across - sine * facing;
                (cosine * facing + sine * across, dpdv, PI * dpdv)
            }
            CurveKind::Ribbon => {
                let normal = self.ribbon_normal(primitive, u);
                let normal = normal - tangent * tangent.dot(normal);
                let normal = normal.try_normalize().unwrap_or(facing);
                let dpdv = normal.cross(tangent);
                (normal, if dpdv.dot(across) < 0.0 { -dpdv } else { dpdv }, DVec3::ZERO)
            }
        };
        let point = ray.at(root.t);
        let rounding = gamma(16) * (ray.origin.abs() + (root.t * ray.direction).abs());
        Surface {
            point,
            // Five times this is how far rays start away, at least.
            point_error: rounding + 0.25 * width,
            normal,
            uv: root.local,
            dpdu,
            dpdv: width * dpdv,
            dndu: DVec3::ZERO,
            dndv,
        }
    }

    /// Whether a ray may touch a primitive: a quick test that is never false where it does.
    fn may_touch(&self, primitive: u32, ray: &Ray) -> bool {
        let segment = self.segment(primitive);
        let offset = ray.origin - self.origin;
        let direction = ray.direction.as_vec3();
        let points = &self.points[segment.first as usize..][..4];
        let relative = |p: Vec3| (p.as_dvec3() - offset).as_vec3();
        if passes_line(relative(points[0]), points[3] - points[0], direction, segment.reach) {
            return false;
        }
        let points = std::array::from_fn(|i| relative(points[i]));
        // The parts of the parameter that the primitive is: one or more chords, or a share of one.
        let place = primitive as usize & ((1 << self.splits) - 1);
        let first = (place * CHORDS) >> self.splits;
        let end = ((place + 1) * CHORDS).div_ceil(1 << self.splits);
        may_touch(points, direction, segment.widths, first..end)
    }

    fn segment(&self, primitive: u32) -> &Segment {
        &self.segments[(primitive >> self.splits) as usize]
    }

    /// Between those of the ends, along the shorter arc.
    fn ribbon_normal(&self, primitive: u32, u: f64) -> DVec3 {
        let [n0, n1] = self.normals[(primitive >> self.splits) as usize].map(|n| n.as_dvec3());
        let angle = n0.dot(n1).clamp(-1.0, 1.0).arc_cosine();
        // Nearly parallel, or nearly opposite.
        if !(1e-4..PI - 1e-4).contains(&angle) {
            return (n0 + u * (n1 - n0)).normalize_or(n0);
        }
        (((1.0 - u) * angle).sine() * n0 + (u * angle).sine() * n1) / angle.sine()
    }

    /// The part of a segment that a primitive is, and its parameters in the segment.
    fn piece(&self, whole: Cubic, primitive: u32) -> (Cubic, [f64; 2]) {
        let mut piece = whole;
        for level in (0..self.splits).rev() {
            let [first, second] = halves(&piece);
            piece = if primitive >> level & 1 == 0 { first } else { second };
        }
        let size = 0.5f64.powi(self.splits as i32);
        let place = f64::from(primitive & ((1 << self.splits) - 1));
        (piece, [place * size, (place + 1.0) * size])
    }
}

fn width_at(segment: &Segment, u: f64) -> f64 {
    let [w0, w1] = segment.widths.map(f64::from);
    w0 + u * (w1 - w0)
}

/// How far the points of a segment of these control points and widths are from the line through its ends, or a little
/// more.
fn reach_of(points: &[Vec3], [w0, w1]: [f32; 2]) -> f32 {
    let way = |i: usize| (points[i] - points[0]).as_dvec3();
    let chord = way(3);
    let distance = |i: usize| match chord.try_normalize() {
        Some(along) => way(i).reject_from_normalized(along).length(),
        None => way(i).length(),
    };
    let reach = distance(1).max(distance(2)) as f32 + 0.5 * w0.max(w1);
    // More than the rounding of all steps.
    reach * (1.0 + 1e-5)
}

/// A cubic at a parameter, with its first and second derivative.
fn at(p: &Cubic, u: f64) -> [DVec3; 3] {
    let v = 1.0 - u;
    let (a, b, c) = (v * p[0] + u * p[1], v * p[1] + u * p[2], v * p[2] + u * p[3]);
    let (d, e) = (v * a + u * b, v * b + u * c);
    [v * d + u * e, 3.0 * (e - d), 6.0 * (c - 2.0 * b + a)]
}

fn halves(p: &Cubic) -> [Cubic; 2] {
    let (a, b, c) = (0.5 * (p[0] + p[1]), 0.5 * (p[1] + p[2]), 0.5 * (p[2] + p[3]));
    let (d, e) = (0.5 * (a + b), 0.5 * (b + c));
    let middle = 0.5 * (d + e);
    [[p[0], a, d, middle], [middle, e, c, p[3]]]
}

/// A piece of a segment, with what bounds it.
#[derive(Clone, Copy)]
struct Piece {
    cubic: Cubic,
    /// Its parameters in the segment.
    u: [f64; 2],
    /// Normals, in the plane across the ray, of the lines that cut it off at its ends; those of neighbours are the same
    /// to the bit.
    cuts: [DVec2; 2],
    /// How often it may be halved.
    depth: u32,
}

/// A search for crossings of a ray with a segment.
struct Search<'a> {
    curves: &'a Curves,
    segment: &'a Segment,
    normals: Option<u32>,
    ray: &'a Ray,
    length: f64,
    axes: [DVec3; 3],
    /// Of heights, in units of length.
    range: [f64; 2],
    /// Whether no segment of the same curve comes before.
    is_first: bool,
    first_only: bool,
    found: Roots,
}

impl<'a> Search<'a> {
    /// `None` where the ray certainly misses the primitive.
    fn new(curves: &'a Curves, primitive: u32, ray: &'a Ray) -> Option<Self> {
        if !curves.may_touch(primitive, ray) {
            return None;
        }
        // A direction may be of any length that is a number.
        let largest = ray.direction.abs().max_element();
        let z = (ray.direction / largest).try_normalize()?;
        let length = largest * (ray.direction / largest).length();
        if !(ray.origin.is_finite() && length.is_finite()) {
            return None;
        }
        let (x, y) = z.any_orthonormal_pair();
        Some(Self {
            curves,
            segment: curves.segment(primitive),
            normals: (curves.kind == CurveKind::Ribbon).then_some(primitive),
            ray,
            length,
            axes: [x, y, z],
            range: [ray.t_min * length, ray.t_max * length],
            is_first: true,
            first_only: false,
            found: Roots::new(),
        })
    }

    /// A control point, the same for all segments that share it.
    fn project(&self, point: usize) -> DVec3 {
        let p = self.curves.points[point].as_dvec3() - (self.ray.origin - self.curves.origin);
        let [x, y, z] = self.axes;
        DVec3::new(x.dot(p), y.dot(p), z.dot(p))
    }

    fn primitive(&mut self, primitive: u32) {
        let Curves { splits, ref segments, .. } = *self.curves;
        let first = self.segment.first as usize;
        let whole: Cubic = std::array::from_fn(|i| self.project(first + i));
        let (cubic, u) = self.curves.piece(whole, primitive);
        if self.passes(&cubic, self.reach(u)) {
            return;
        }
        // The cut between two segments is across the way from the control point before to the one after it.
        let index = (primitive >> splits) as usize;
        let is_joined =
            |index: usize, first: u32| segments.get(index).is_some_and(|segment| segment.first == first);
        let before = index > 0 && first >= 3 && is_joined(index - 1, first as u32 - 3);
        let after = is_joined(index + 1, first as u32 + 3);
        self.is_first = !before;
        let start = if before {
            direction(whole[1] - self.project(first - 1), whole[3] - self.project(first - 3))
        } else {
            direction(whole[1] - whole[0], direction3(whole[2] - whole[0], whole[3] - whole[0]))
        };
        let end = if after {
            direction(self.project(first + 4) - whole[2], self.project(first + 6) - whole[0])
        } else {
            direction(whole[3] - whole[2], direction3(whole[3] - whole[1], whole[3] - whole[0]))
        };
        let mut piece = Piece { cubic: whole, u: [0.0, 1.0], cuts: [start, end], depth: MAX_DEPTH };
        for level in (0..splits).rev() {
            piece = piece.halves()[(primitive >> level & 1) as usize];
        }
        self.search(&piece);
    }

    /// Half the greatest width between two parameters.
    fn reach(&self, [u0, u1]: [f64; 2]) -> f64 {
        0.5 * width_at(self.segment, u0).max(width_at(self.segment, u1))
    }

    /// Whether the ray certainly misses a piece: outside of the strip along its chord that its control points are in.
    fn passes(&self, p: &Cubic, reach: f64) -> bool {
        let size = p.iter().fold(DVec3::ZERO, |size, p| size.max(p.abs()));
        let slack = 1e-13 * (size.x + size.y);
        let reach = reach + slack;
        let low = p[0].z.min(p[1].z).min(p[2].z.min(p[3].z));
        let high = p[0].z.max(p[1].z).max(p[2].z.max(p[3].z));
        let slack = 1e-13 * size.z;
        // Also where anything is not a number.
        if !(low - slack <= self.range[1] && high + slack >= self.range[0] && size.is_finite()) {
            return true;
        }
        let chord = (p[3] - p[0]).truncate();
        let along = chord.try_normalize().unwrap_or(DVec2::X);
        let outside = |a: f64, b: f64, c: f64, d: f64| {
            a.min(b).min(c.min(d)) > reach || a.max(b).max(c.max(d)) < -reach
        };
        let [a, b, c, d] = p.map(|p| p.truncate());
        outside(along.perp_dot(a), along.perp_dot(b), along.perp_dot(c), along.perp_dot(d))
            || outside(along.dot(a), along.dot(b), along.dot(c), along.dot(d))
    }

    fn search(&mut self, piece: &Piece) {
        if self.passes(&piece.cubic, self.reach(piece.u)) {
            return;
        }
        if piece.depth == 0 || piece.has_one_place() {
            self.nearest(piece);
            return;
        }
        let [first, second] = piece.halves();
        self.search(&first);
        self.search(&second);
    }

    /// The place of a piece that the ray passes nearest, if that is between its ends.
    fn nearest(&mut self, piece: &Piece) {
        let Piece { cubic: p, u: [u0, u1], cuts: [start, end], .. } = piece;
        // Half the derivative of the squared distance, with the sign changed: it falls through zero where the distance
        // is least.
        let ahead = |p: DVec3, tangent: DVec2| -p.truncate().dot(tangent);
        // What is exactly on a cut belongs to the piece before it, if there is one.
        let is_open = self.is_first && *u0 == 0.0 && ahead(p[0], *start) == 0.0;
        if !(ahead(p[0], *start) > 0.0 || is_open) || ahead(p[3], *end) > 0.0 {
            return;
        }
        let chord = (p[3] - p[0]).truncate();
        let mut s = (ahead(p[0], chord) / chord.length_squared()).clamp(0.0, 1.0);
        if s.is_nan() {
            s = 0.5;
        }
        let (mut low, mut high) = (0.0, 1.0);
        let mut here = at(p, s);
        for _ in 0..64 {
            let [place, tangent, bend] = here.map(|v| v.truncate());
            let value = -place.dot(tangent);
            if value > 0.0 {
                low = s
            } else {
                high = s
            }
            let slope = -(tangent.length_squared() + place.dot(bend));
            let newton = s - value / slope;
            let next = if low < newton && newton < high { newton } else { 0.5 * (low + high) };
            let is_settled = (next - s).abs() <= 4.0 * f64::EPSILON;
            s = next;
            here = at(p, s);
            if is_settled {
                break;
            }
        }
        let [place, tangent, _] = here;
        let u = u0 + s * (u1 - u0);
        let mut width = width_at(self.segment, u);
        if let Some(primitive) = self.normals {
            width *= self.curves.ribbon_normal(primitive, u).dot(self.axes[2]).abs();
        }
        let foot = -place.truncate();
        let distance = foot.length();
        let t = place.z / self.length;
        if !(distance <= 0.5 * width && width > 0.0 && self.ray.contains(t)) {
            return;
        }
        let side = if tangent.truncate().perp_dot(foot) > 0.0 { 1.0 } else { -1.0 };
        let v = 0.5 + side * distance / width;
        let root = Root { local: DVec2::new(u, v.clamp(0.0, 1.0)), ..Root::at(t) };
        if !self.first_only {
            self.found.push(root);
        } else if self.found.first().is_none_or(|first| t < first.t) {
            self.found.clear();
            self.found.push(root);
            self.range[1] = place.z;
        }
    }
}

impl Piece {
    fn halves(&self) -> [Self; 2] {
        let [first, second] = halves(&self.cubic);
        let middle = 0.5 * (self.u[0] + self.u[1]);
        let cut = direction(second[1] - first[2], self.cubic[3] - self.cubic[0]);
        let depth = self.depth.saturating_sub(1);
        [
            Self { cubic: first, u: [self.u[0], middle], cuts: [self.cuts[0], cut], depth },
            Self { cubic: second, u: [middle, self.u[1]], cuts: [cut, self.cuts[1]], depth },
        ]
    }

    /// Whether the squared distance to the ray has no more than one minimum or maximum within it: its second derivative
    /// keeps its sign, as the coefficients of that polynomial in Bernstein's basis do.
    fn has_one_place(&self) -> bool {
        let p = self.cubic.map(|p| p.truncate());
        let a = [3.0 * (p[1] - p[0]), 3.0 * (p[2] - p[1]), 3.0 * (p[3] - p[2])];
        let b = [2.0 * (a[1] - a[0]), 2.0 * (a[2] - a[1])];
        if a == [DVec2::ZERO; 3] {
            return true;
        }
        let coefficients = [
            a[0].dot(a[0]) + p[0].dot(b[0]),
            a[0].dot(a[1]) + 0.25 * (3.0 * p[1].dot(b[0]) + p[0].dot(b[1])),
            (a[0].dot(a[2]) + 2.0 * a[1].dot(a[1])) / 3.0 + 0.5 * (p[2].dot(b[0]) + p[1].dot(b[1])),
            a[1].dot(a[2]) + 0.25 * (p[3].dot(b[0]) + 3.0 * p[2].dot(b[1])),
            a[2].dot(a[2]) + p[3].dot(b[1]),
        ];
        coefficients.iter().all(|&c| c > 0.0) || coefficients.iter().all(|&c| c < 0.0)
    }
}

/// The first of two ways across the ray that leads anywhere.
fn direction(first: DVec3, second: DVec3) -> DVec2 {
    direction3(first, second).truncate()
}

fn direction3(first: DVec3, second: DVec3) -> DVec3 {
    if first.truncate() == DVec2::ZERO { second } else { first }
}

impl fmt::Debug for Curves {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Curves")
            .field("kind", &self.kind)
            .field("origin", &self.origin)
            .field("points", &self.points)
            .field("segments", &self.segments)
            .field("normals", &self.normals)
            .finish_non_exhaustive()
    }
}
