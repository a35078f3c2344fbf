//! Solids made of plane curves: swept along y, drawn to a point, or turned about y.

use lumbre_geometry::{Aabb, Ray, Root, Roots};
use lumbre_math::roots::{keeps_sign, roots_between};
use lumbre_math::{DVec2, DVec3, Elementary};

/// A piece of a curve, a cubic in u from 0 to 1, whose second coordinate only rises or only falls.
#[derive(Clone, Debug)]
pub(super) struct Piece {
    a: [f64; 4],
    b: [f64; 4],
    /// The number of the curve that it is of, and where it begins and ends on it.
    curve: u32,
    range: [f64; 2],
}

fn at(c: &[f64; 4], u: f64) -> f64 {
    ((c[3] * u + c[2]) * u + c[1]) * u + c[0]
}

fn slope(c: &[f64; 4], u: f64) -> f64 {
    (3.0 * c[3] * u + 2.0 * c[2]) * u + c[1]
}

/// The same polynomial with u from 0 to 1 for what was from `low` to `high`.
fn cut(c: &[f64; 4], low: f64, high: f64) -> [f64; 4] {
    let w = high - low;
    [at(c, low), slope(c, low) * w, (3.0 * c[3] * low + c[2]) * w * w, c[3] * w * w * w]
}

/// Closed loops, or the outline of what is turned: the part of the plane that they enclose is by the even–odd rule.
#[derive(Clone, Debug, Default)]
pub(super) struct Outline {
    pieces: Vec<Piece>,
    curves: u32,
}

impl Outline {
    /// Adds a cubic by its powers of u.
    pub(super) fn push(&mut self, c: [DVec2; 4]) {
        let (a, b) = (c.map(|c| c.x), c.map(|c| c.y));
        let turns = roots_between(&[b[1], 2.0 * b[2], 3.0 * b[3]], 0.0, 1.0);
        let mut ends = vec![0.0];
        ends.extend(turns.iter().copied().filter(|u| 0.0 < *u && *u < 1.0));
        ends.push(1.0);
        for pair in ends.windows(2) {
            let (low, high) = (pair[0], pair[1]);
            let (a, b) = (cut(&a, low, high), cut(&b, low, high));
            self.pieces.push(Piece { a, b, curve: self.curves, range: [low, high] });
        }
        self.curves += 1;
    }

    pub(super) fn line(&mut self, from: DVec2, to: DVec2) {
        self.push([from, to - from, DVec2::ZERO, DVec2::ZERO]);
    }

    pub(super) fn parabola(&mut self, from: DVec2, control: DVec2, to: DVec2) {
        self.push([from, 2.0 * (control - from), from - 2.0 * control + to, DVec2::ZERO]);
    }

    pub(super) fn bezier(&mut self, [p0, p1, p2, p3]: [DVec2; 4]) {
        self.push([p0, 3.0 * (p1 - p0), 3.0 * (p0 - 2.0 * p1 + p2), p3 - 3.0 * p2 + 3.0 * p1 - p0]);
    }

    /// From a value with a slope to another.
    pub(super) fn hermite(&mut self, from: DVec2, leaving: DVec2, to: DVec2, arriving: DVec2) {
        let rest = to - from;
        self.push([from, leaving, 3.0 * rest - 2.0 * leaving - arriving, leaving + arriving - 2.0 * rest]);
    }

    pub(super) fn is_empty(&self) -> bool {
        self.pieces.is_empty()
    }

    /// Whether a point is enclosed: by the crossings to the right of it.
    fn contains(&self, p: DVec2) -> bool {
        let mut is_inside = false;
        for piece in &self.pieces {
            let (first, last) = (piece.b[0], at(&piece.b, 1.0));
            if (first <= p.y) == (last <= p.y) {
                continue;
            }
            let [b0, b1, b2, b3] = piece.b;
            let u = roots_between(&[b0 - p.y, b1, b2, b3], 0.0, 1.0).first().copied();
            let u = u.unwrap_or(if (first - p.y).abs() < (last - p.y).abs() { 0.0 } else { 1.0 });
            is_inside ^= at(&piece.a, u) > p.x;
        }
        is_inside
    }

    fn bounds(&self) -> [DVec2; 2] {
        let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        for piece in &self.pieces {
            // Of the control points.
            let control = |c: &[f64; 4]| {
                let first = c[0] + c[1] / 3.0;
                [c[0], first, c[0] + (2.0 * c[1] + c[2]) / 3.0, c.iter().sum()]
            };
            for (x, y) in control(&piece.a).into_iter().zip(control(&piece.b)) {
                low = low.min(DVec2::new(x, y));
                high = high.max(DVec2::new(x, y));
            }
        }
        [low, high]
    }
}

/// A solid of curves, in its own space.
#[derive(Clone, Debug)]
pub(super) enum Swept {
    /// An outline in x and z from one height to another; drawn to a point at height 0 where it is conic.
    Prism { outline: Outline, heights: [f64; 2], conic: bool, open: bool },
    /// An outline of radius and height, turned about y; inside is what lies between it and the axis.
    Lathe(Outline),
    /// A curve of the square of the radius over the height, with disks at its ends unless it is open.
    Revolution { outline: Outline, open: bool },
}

/// The parts of roots that are no pieces of a curve.
const CAPS: u32 = u32::MAX - 1;

impl Swept {
    pub(super) fn roots(&self, ray: &Ray, out: &mut Roots) {
        let mut found = Roots::new();
        match self {
            Self::Prism { outline, heights, conic, open } => {
                prism_sides(outline, heights, *conic, ray, &mut found);
                if !open {
                    for (i, &height) in heights.iter().enumerate() {
                        let t = (height - ray.origin.y) / ray.direction.y;
                        if t.is_finite() && ray.contains(t) && outline.contains(section(ray.at(t), *conic)) {
                            found.push(Root { part: CAPS + i as u32, ..Root::at(t) });
                        }
                    }
                }
            }
            Self::Lathe(outline) => lathe_sides(outline, false, ray, &mut found),
            Self::Revolution { outline, open } => {
                lathe_sides(outline, true, ray, &mut found);
                if !open {
                    for (i, (height, squared)) in ends(outline).into_iter().enumerate() {
                        let t = (height - ray.origin.y) / ray.direction.y;
                        let p = ray.at(t);
                        if t.is_finite() && ray.contains(t) && p.x * p.x + p.z * p.z < squared {
                            found.push(Root { part: CAPS + i as u32, ..Root::at(t) });
                        }
                    }
                }
            }
        }
        found.sort_by(|a, b| a.t.total_cmp(&b.t));
        out.extend(found);
    }

    /// A normal, of any length, pointing out of the solid.
    pub(super) fn normal(&self, p: DVec3, root: &Root) -> DVec3 {
        if root.part >= CAPS {
            let is_upper = root.part > CAPS;
            return if is_upper == self.is_upright() { DVec3::Y } else { -DVec3::Y };
        }
        let u = root.local.x;
        let normal = match self {
            Self::Prism { outline, conic, .. } => {
                let piece = &outline.pieces[root.part as usize];
                let (dx, dz) = (slope(&piece.a, u), slope(&piece.b, u));
                if *conic {
                    let (x, z) = (at(&piece.a, u), at(&piece.b, u));
                    DVec3::new(dz, dx * z - dz * x, -dx)
                } else {
                    DVec3::new(dz, 0.0, -dx)
                }
            }
            Self::Lathe(outline) => {
                let piece = &outline.pieces[root.part as usize];
                let (dr, dh) = (slope(&piece.a, u), slope(&piece.b, u));
                let radial = DVec2::new(p.x, p.z).normalize_or_zero();
                DVec3::new(radial.x * dh, -dr, radial.y * dh)
            }
            Self::Revolution { outline, .. } => {
                let piece = &outline.pieces[root.part as usize];
                // Of x² + z² − r²(h).
                let per_height = slope(&piece.a, u) / slope(&piece.b, u);
                DVec3::new(2.0 * p.x, -per_height, 2.0 * p.z)
            }
        };
        let step = normal.normalize_or_zero() * 1e-6 * (1.0 + p.abs().max_element());
        if self.contains(p + step) && !self.contains(p - step) { -normal } else { normal }
    }

    /// Whether it is turned about y.
    pub(super) fn is_turned(&self) -> bool {
        !matches!(self, Self::Prism { .. })
    }

    /// The coordinates on the surface: around y, and along the outline.
    pub(super) fn uv(&self, p: DVec3, root: &Root) -> DVec2 {
        let turn = p.z.angle_from(p.x) / std::f64::consts::TAU;
        let around = if turn < 0.0 { turn + 1.0 } else { turn };
        match self {
            Self::Prism { .. } => root.local,
            Self::Lathe(outline) => {
                let piece = &outline.pieces[root.part as usize];
                let [low, high] = piece.range;
                let along = f64::from(piece.curve) + low + root.local.x * (high - low);
                DVec2::new(around, along / f64::from(outline.curves))
            }
            Self::Revolution { outline, .. } => {
                let [(first, _), (last, _)] = ends(outline);
                DVec2::new(around, (p.y - first) / (last - first))
            }
        }
    }

    fn is_upright(&self) -> bool {
        match self {
            Self::Prism { heights, .. } => heights[0] <= heights[1],
            Self::Lathe(_) => true,
            Self::Revolution { outline, .. } => {
                let [(first, _), (last, _)] = ends(outline);
                first <= last
            }
        }
    }

    pub(super) fn contains(&self, p: DVec3) -> bool {
        match self {
            Self::Prism { outline, heights: [a, b], conic, .. } => {
                a.min(*b) <= p.y && p.y <= a.max(*b) && outline.contains(section(p, *conic))
            }
            Self::Lathe(outline) => outline.contains(DVec2::new(DVec2::new(p.x, p.z).length(), p.y)),
            Self::Revolution { outline, .. } => outline.contains(DVec2::new(p.x * p.x + p.z * p.z, p.y)),
        }
    }

    pub(super) fn bounds(&self) -> Aabb {
        match self {
            Self::Prism { outline, heights: [a, b], conic, .. } => {
                let [low, high] = outline.bounds();
                let sizes = if *conic { [*a, *b] } else { [1.0, 1.0] };
                let corners = sizes.into_iter().flat_map(|s| [low * s, high * s]);
                let (mut min, mut max) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
                for corner in corners {
                    (min, max) = (min.min(corner), max.max(corner));
                }
                Aabb { min: DVec3::new(min.x, a.min(*b), min.y), max: DVec3::new(max.x, a.max(*b), max.y) }
            }
            Self::Lathe(outline) => {
                let [low, high] = outline.bounds();
                let r = high.x.max(-low.x);
                Aabb { min: DVec3::new(-r, low.y, -r), max: DVec3::new(r, high.y, r) }
            }
            Self::Revolution { outline, .. } => {
                let [low, high] = outline.bounds();
                let r = high.x.max(0.0).sqrt();
                Aabb { min: DVec3::new(-r, low.y, -r), max: DVec3::new(r, high.y, r) }
            }
        }
    }
}

/// A point of the plane of an outline.
fn section(p: DVec3, conic: bool) -> DVec2 {
    let q = DVec2::new(p.x, p.z);
    if conic { q / p.y } else { q }
}

/// Height and squared radius at both ends.
fn ends(outline: &Outline) -> [(f64, f64); 2] {
    let (Some(first), Some(last)) = (outline.pieces.first(), outline.pieces.last()) else {
        return [(0.0, 0.0); 2];
    };
    [(first.b[0], first.a[0]), (at(&last.b, 1.0), at(&last.a, 1.0))]
}

fn prism_sides(outline: &Outline, heights: &[f64; 2], conic: bool, ray: &Ray, out: &mut Roots) {
    let (o, d) = (ray.origin, ray.direction);
    let (low, high) = (heights[0].min(heights[1]), heights[0].max(heights[1]));
    // The line that the ray is in the plane of the outline.
    let line = if conic { o.cross(d) } else { DVec3::new(-d.z, d.z * o.x - d.x * o.z, d.x) };
    for (part, piece) in outline.pieces.iter().enumerate() {
        let mut c: [f64; 4] = std::array::from_fn(|i| line.x * piece.a[i] + line.z * piece.b[i]);
        c[0] += line.y;
        if keeps_sign(&c) {
            continue;
        }
        for &u in roots_between(&c, 0.0, 1.0).iter().filter(|u| **u < 1.0) {
            let (x, z) = (at(&piece.a, u), at(&piece.b, u));
            let t = if conic {
                let (by_x, by_z) = (d.x - x * d.y, d.z - z * d.y);
                if by_x.abs() > by_z.abs() { (x * o.y - o.x) / by_x } else { (z * o.y - o.z) / by_z }
            } else {
                ((x - o.x) * d.x + (z - o.z) * d.z) / (d.x * d.x + d.z * d.z)
            };
            let y = o.y + t * d.y;
            if t.is_finite() && ray.contains(t) && low <= y && y <= high {
                out.push(Root { part: part as u32, local: DVec2::new(u, 0.0), ..Root::at(t) });
            }
        }
    }
}

/// Crossings with a curve turned about y, of its radius, or of the square of that, over the height.
fn lathe_sides(outline: &Outline, is_squared: bool, ray: &Ray, out: &mut Roots) {
    let (o, d) = (ray.origin, ray.direction);
    let is_level = d.y.abs() < 1e-9 * d.length();
    for (part, piece) in outline.pieces.iter().enumerate() {
        let mut push = |t: f64, u: f64| {
            if t.is_finite() && ray.contains(t) {
                out.push(Root { part: part as u32, local: DVec2::new(u, 0.0), ..Root::at(t) });
            }
        };
        if is_level {
            let [b0, b1, b2, b3] = piece.b;
            for &u in roots_between(&[b0 - o.y, b1, b2, b3], 0.0, 1.0).iter().filter(|u| **u < 1.0) {
                let r = at(&piece.a, u);
                let squared = if is_squared { r } else { r * r };
                let a = d.x * d.x + d.z * d.z;
                let half = o.x * d.x + o.z * d.z;
                let rest = half * half - a * (o.x * o.x + o.z * o.z - squared);
                if rest > 0.0 {
                    push((-half - rest.sqrt()) / a, u);
                    push((-half + rest.sqrt()) / a, u);
                }
            }
            continue;
        }
        // (o + (h − o_y) d / d_y) in x and z, times d_y.
        let along = |o: f64, d_axis: f64| -> [f64; 4] {
            let mut c = piece.b.map(|b| b * d_axis);
            c[0] += o * d.y - ray.origin.y * d_axis;
            c
        };
        let (x, z) = (along(o.x, d.x), along(o.z, d.z));
        let mut c = [0.0; 7];
        for i in 0..4 {
            for j in 0..4 {
                c[i + j] += x[i] * x[j] + z[i] * z[j];
                if !is_squared {
                    c[i + j] -= piece.a[i] * piece.a[j] * d.y * d.y;
                }
            }
            if is_squared {
                c[i] -= piece.a[i] * d.y * d.y;
            }
        }
        if keeps_sign(&c) {
            continue;
        }
        for &u in roots_between(&c, 0.0, 1.0).iter().filter(|u| **u < 1.0) {
            push((at(&piece.b, u) - o.y) / d.y, u);
        }
    }
}
