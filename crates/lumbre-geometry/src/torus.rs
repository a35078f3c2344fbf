//! Tori: ring, horn and spindle.

use std::f64::consts::{PI, TAU};

use lumbre_math::roots::{DepressedCubic, bracketed_root};
use lumbre_math::rounding::gamma;
use lumbre_math::{DMat3, DVec2, DVec3, Transform, orthonormal_basis};

use crate::nearest::under_similarity;
use crate::shape::check;
use crate::support::{azimuth, bounds_from_support};
use crate::{
    Aabb, DirectionSample, Hull, NearestPoint, NoNearestPoint, Ray, Root, Roots, ShapeError, Surface,
    SurfaceSample, density, measure,
};

/// The points at distance `minor` from a circle of radius `major`.
///
/// With `minor < major` it is a ring; with `minor = major` a horn, whose hole is a point; with `minor > major` a spindle,
/// whose surface crosses itself on the axis. A spindle has an inner sheet too, the lemon around its centre, and a ray
/// meets both. As a solid it is even-odd: the lemon is outside, and the normals of the inner sheet point into it.
///
/// `u` is the azimuth φ about the axis over 2π, counted from the first of the two directions of T. Duff's frame about the
/// axis (from x towards y for the axis z), and `v` is the angle ϑ around the tube over 2π, 0 where it is farthest from the
/// axis and a quarter on its top: the point is `(major + minor cos ϑ)(cos φ, sin φ, 0) + (0, 0, minor sin ϑ)`. On the
/// inner sheet the factor is negative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Torus {
    center: DVec3,
    // Orthonormal and right-handed.
    e1: DVec3,
    e2: DVec3,
    axis: DVec3,
    // The frame is the coordinate axes', and nothing need be turned.
    upright: bool,
    major: f64,
    minor: f64,
}

/// A ray's line in the torus's frame: the points `p + s u` with a unit `u` perpendicular to `p`, at t = (shift + s)/speed.
struct Line {
    p: DVec3,
    u: DVec3,
    shift: f64,
    speed: f64,
    // All crossings lie strictly in between, and both ends outside.
    low: f64,
    high: f64,
}

impl Line {
    fn t(&self, s: f64) -> f64 {
        (self.shift + s) / self.speed
    }
}

/// The quartic of which the crossings are the roots: s⁴ + p s² + q s + w. Away from them it is as good as the torus's own
/// equation, and quicker.
#[derive(Clone, Copy)]
struct Quartic {
    p: f64,
    q: f64,
    w: f64,
}

impl Quartic {
    #[inline]
    fn new(torus: &Torus, line: &Line) -> Self {
        let (big, small) = (torus.major * torus.major, torus.minor * torus.minor);
        let (p, u) = (line.p, line.u);
        let reach = p.length_squared() - small;
        let sum = reach + big;
        Self {
            p: 2.0 * (reach - big + 2.0 * big * u.z * u.z),
            q: 8.0 * big * p.z * u.z,
            w: sum * sum - 4.0 * big * (p.x * p.x + p.y * p.y),
        }
    }

    #[inline]
    fn at(&self, s: f64) -> (f64, f64) {
        let square = s * s;
        let value = (square + self.p) * square + (self.q * s + self.w);
        (value, (4.0 * square + 2.0 * self.p) * s + self.q)
    }

    fn curvature(&self, s: f64) -> f64 {
        12.0 * s * s + 2.0 * self.p
    }
}

/// What is known of the first crossing.
enum First {
    /// The way down to it was not gone.
    Unsought,
    /// The way down led there, and it was emitted.
    Emitted,
    /// The way down does not lead there.
    Unclear,
}

/// The monotone pieces of the quartic, met in order.
struct Pieces<'a, F> {
    torus: &'a Torus,
    line: &'a Line,
    quartic: Quartic,
    t_min: f64,
    first: First,
    emit: F,
    // The last place with a sign: where, which, and the quartic there.
    left: (f64, f64, f64),
    // Splits since then at which the quartic vanishes: the first, the last, how many.
    touching: Option<(f64, f64, u8)>,
}

impl<F: FnMut(f64, u8) -> bool> Pieces<'_, F> {
    /// Goes on to a root of the derivative; `None` when no more crossings are wanted.
    #[inline]
    fn until(&mut self, split: f64) -> Option<()> {
        let is_within = self.line.low < split && split < self.line.high;
        if !is_within {
            return Some(());
        }
        let (sign, quartic) = self.torus.sign_and_quartic(self.line, split);
        if sign == 0.0 {
            self.touching =
                Some(self.touching.map_or((split, split, 1), |(first, _, n)| (first, split, n + 1)));
            return Some(());
        }
        self.until_sign(split, sign, quartic)
    }

    /// Goes on to where the quartic has a sign.
    #[inline]
    fn until_sign(&mut self, s: f64, sign: f64, quartic: f64) -> Option<()> {
        let left = std::mem::replace(&mut self.left, (s, sign, quartic));
        let known =
            if sign == left.1 { First::Unclear } else { std::mem::replace(&mut self.first, First::Unclear) };
        if let First::Emitted = known {
            return Some(());
        }
        let (root, multiplicity) = if let Some((first, last, n)) = self.touching.take() {
            let middle = 0.5 * (first + last);
            let size = self.torus.major + self.torus.minor;
            let is_flat = self.quartic.curvature(middle).abs() <= 1e-7 * size * size;
            let multiplicity = match (sign == left.1, n) {
                (true, 1 | 2) if !is_flat => 2,
                (true, _) => 4,
                (false, 2) => 3,
                (false, _) => 1,
            };
            (middle, multiplicity)
        } else if sign != left.1 && self.line.t(s) >= self.t_min {
            // The negative end is a minimum of the quartic: there its parabola is a good guess.
            let (minimum, depth, outwards) =
                if sign < 0.0 { (s, quartic, -1.0) } else { (left.0, left.2, 1.0) };
            let half_width = (-2.0 * depth / self.quartic.curvature(minimum)).sqrt();
            let by_descent = match known {
                First::Unsought => self.torus.descend(self.line, &self.quartic),
                First::Emitted | First::Unclear => None,
            };
            let guess = minimum + outwards * half_width;
            (by_descent.unwrap_or_else(|| self.root(left.0, s, guess, sign > 0.0)), 1)
        } else {
            return Some(());
        };
        (self.emit)(self.line.t(root), multiplicity).then_some(())
    }

    /// The root in a monotone piece: by the quartic as far as that goes, then by the torus's own equation.
    #[inline]
    fn root(&self, low: f64, high: f64, guess: f64, rising: bool) -> f64 {
        let mut s = guess;
        for _ in 0..8 {
            let (value, slope) = self.quartic.at(s);
            let next = s - value / slope;
            // Also when it is not a number.
            let is_within = low < next && next < high;
            if !is_within {
                break;
            }
            let step = (next - s).abs();
            s = next;
            if step <= 1e-6 * self.torus.minor {
                break;
            }
        }
        if low < s && s < high {
            let (value, slope) = self.torus.value_and_slope(self.line, s);
            let step = value / slope;
            let next = s - step;
            // What Newton's method leaves is this step squared, times how fast the slope changes.
            let left_over = step * step * self.quartic.curvature(s) / self.quartic.at(s).1;
            if low < next && next < high && left_over.abs() <= 0.25 * f64::EPSILON * self.torus.minor {
                return next;
            }
        }
        bracketed_root(low, high, s, rising, |s| self.torus.value_and_slope(self.line, s))
    }
}

/// How far beyond the torus its bounds lie, relatively: enough that their ends are outside whatever the rounding.
const MARGIN: f64 = 1e-9;

impl Torus {
    /// A torus around the circle of radius `major` about `center`, in the plane perpendicular to `axis` (of any length but
    /// zero), with a tube of radius `minor`.
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

    /// The radius of the circle inside the tube.
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

    fn framed(&self, v: DVec3) -> DVec3 {
        if self.upright { v } else { DVec3::new(v.dot(self.e1), v.dot(self.e2), v.dot(self.axis)) }
    }

    fn unframed(&self, v: DVec3) -> DVec3 {
        if self.upright { v } else { v.x * self.e1 + v.y * self.e2 + v.z * self.axis }
    }

    /// The line, moved to where it is nearest to the centre: there the quartic has no cubic term, and its coefficients
    /// know nothing of how far away the ray began. `None` when a bound of the torus is missed.
    #[inline]
    fn line(&self, ray: &Ray) -> Option<Line> {
        let (w, d) = (ray.origin - self.center, ray.direction);
        let dd = d.length_squared();
        let speed = dd.sqrt();
        let unit = d / speed;
        let first = -w.dot(unit);
        let near = w + first * unit;
        let reach = (self.major + self.minor) * (1.0 + MARGIN);
        let within_sphere = near.length_squared() <= reach * reach;
        // Not finite for a direction of zero, nor for a NaN anywhere.
        if !within_sphere || !dd.is_finite() {
            return None;
        }
        let second = -near.dot(unit);
        let (p, u) = (self.framed(near + second * unit), self.framed(unit));
        let (low, high) = self.span(p, u, reach)?;
        let shift = first + second;
        let overlaps = shift + high >= ray.t_min * speed && shift + low <= ray.t_max * speed;
        overlaps.then_some(Line { p, u, shift, speed, low, high })
    }

    /// Where the line is inside the flat cylinder around the torus; `None` when it is nowhere, or only in the hole.
    #[inline]
    fn span(&self, p: DVec3, u: DVec3, reach: f64) -> Option<(f64, f64)> {
        let flat = self.minor * (1.0 + MARGIN);
        let (mut low, mut high) = (-2.0 * reach, 2.0 * reach);
        if u.z == 0.0 {
            if p.z.abs() > flat {
                return None;
            }
        } else {
            let inverse = 1.0 / u.z;
            let (middle, half) = (-p.z * inverse, flat * inverse.abs());
            (low, high) = (low.max(middle - half), high.min(middle + half));
        }
        let a = u.x * u.x + u.y * u.y;
        let h = p.x * u.x + p.y * u.y;
        let c = p.x * p.x + p.y * p.y - reach * reach;
        let delta = h * h - a * c;
        if delta < 0.0 {
            return None;
        }
        if a > 1e-30 {
            let inverse = 1.0 / a;
            let (middle, half) = (-h * inverse, delta.sqrt() * inverse);
            (low, high) = (low.max(middle - half), high.min(middle + half));
        } else if c > 0.0 {
            return None;
        }
        if low > high {
            return None;
        }
        // The distance from the axis is convex along the line, so that it is greatest at an end.
        let hole = (self.major - self.minor) * (1.0 - MARGIN);
        let rho_squared = |s: f64| (p.x + s * u.x).powi(2) + (p.y + s * u.y).powi(2);
        let in_hole = hole > 0.0 && rho_squared(low).max(rho_squared(high)) < hole * hole;
        (!in_hole).then_some((low, high))
    }

    /// The function that vanishes on the torus, and its slope along the line: negative inside, positive outside.
    ///
    /// For a ring it is (ρ - R)² + z² - r²; the quartic has a second factor (ρ + R)² + z² - r², which is positive, and
    /// would only add rounding. For the others it is the product.
    #[inline]
    fn value_and_slope(&self, line: &Line, s: f64) -> (f64, f64) {
        let p = line.p + s * line.u;
        let rho = (p.x * p.x + p.y * p.y).sqrt();
        let outward = p.x * line.u.x + p.y * line.u.y;
        if self.is_ring() {
            let from_circle = rho - self.major;
            let value = (from_circle - self.minor) * (from_circle + self.minor) + p.z * p.z;
            return (value, 2.0 * (from_circle * outward / rho + p.z * line.u.z));
        }
        let (outer, inner) = self.factors(rho, p.z);
        let (big, small) = (self.major * self.major, self.minor * self.minor);
        let along = p.dot(line.u);
        (outer * inner, 4.0 * (p.length_squared() + big - small) * along - 8.0 * big * outward)
    }

    /// (ρ - R)² + z² - r² and (ρ + R)² + z² - r².
    #[inline]
    fn factors(&self, rho: f64, z: f64) -> (f64, f64) {
        let (near, far) = (rho - self.major, rho + self.major);
        let outer = (near - self.minor) * (near + self.minor) + z * z;
        let inner = (far - self.minor) * (far + self.minor) + z * z;
        (outer, inner)
    }

    /// The quartic at `s`, without the positive factor of a ring's: 0 where it is 0 up to rounding; and the quartic itself.
    #[inline]
    fn sign_and_quartic(&self, line: &Line, s: f64) -> (f64, f64) {
        let p = line.p + s * line.u;
        let (outer, inner) = self.factors((p.x * p.x + p.y * p.y).sqrt(), p.z);
        let size = self.major + self.minor;
        let rounding = 16.0 * f64::EPSILON * size;
        let (value, uncertain) = if self.is_ring() {
            (outer, rounding * self.minor)
        } else {
            let rounding = rounding * size;
            (outer * inner, rounding * (outer.abs() + inner.abs() + rounding))
        };
        let sign = if value.abs() <= uncertain { 0.0 } else { value.signum() };
        (sign, outer * inner)
    }

    /// Every crossing of the whole line in order, `emit(t, multiplicity)`, until `emit` returns false. Those before
    /// `t_min` may be left out.
    #[inline]
    fn crossings(&self, line: &Line, t_min: f64, mut emit: impl FnMut(f64, u8) -> bool) {
        let quartic = Quartic::new(self, line);
        let mut first = First::Unsought;
        if line.t(line.low) >= t_min {
            first = match self.descend(line, &quartic) {
                Some(s) if !emit(line.t(s), 1) => return,
                Some(_) => First::Emitted,
                None => First::Unclear,
            };
        }
        self.crossings_by_pieces(line, quartic, t_min, first, emit);
    }

    /// Goes down the quartic to the first crossing of a ring; `None` where the line may do little more than touch it, or the way is
    /// not seen at once.
    ///
    /// Where it bends only one way and falls, what is found is the only zero, and where it falls from above zero while it is convex,
    /// the first.
    #[inline]
    fn descend(&self, line: &Line, quartic: &Quartic) -> Option<f64> {
        if !self.is_ring() {
            return None;
        }
        let &Line { low, high, .. } = line;
        if quartic.p >= 0.0 {
            return self.slide(line, quartic, low, [low, high]);
        }
        // Convex up to one bend, concave up to the other, and convex again.
        let bend = (quartic.p * (-1.0 / 6.0)).sqrt();
        let mut from = low;
        if low < -bend {
            let (value, slope) = quartic.at(-bend);
            if slope >= 0.0 {
                return self.slide(line, quartic, low, [low, -bend]);
            }
            if value < 0.0 {
                return self.slide(line, quartic, low.max(-bend - value / slope), [low, -bend]);
            }
            if value <= self.noise() {
                return None;
            }
            from = -bend;
        }
        if bend <= from {
            return self.slide(line, quartic, from, [from, high]);
        }
        let (value, slope) = quartic.at(bend);
        if value < 0.0 {
            return self.slide(line, quartic, bend - value / slope, [from, bend]);
        }
        if value <= self.noise() || slope >= 0.0 || bend >= high {
            return None;
        }
        self.slide(line, quartic, bend - value / slope, [bend, high])
    }

    /// Less than this is nothing for a quartic: much more than rounding takes and gives.
    #[inline]
    fn noise(&self) -> f64 {
        let size = self.major + self.minor;
        1e-10 * (size * size) * (size * size)
    }

    /// A zero of the quartic, from a place between two on, if it falls all the way there without getting flat: by E. Halley's steps
    /// ("Methodus nova accurata & facilis inveniendi radices", 1694), and a last one by the ring's own equation.
    #[inline]
    fn slide(&self, line: &Line, quartic: &Quartic, from: f64, [low, high]: [f64; 2]) -> Option<f64> {
        let noise = self.noise();
        let (mut s, mut last_step) = (from, f64::INFINITY);
        for _ in 0..8 {
            let (value, slope) = quartic.at(s);
            let (curvature, squared) = (quartic.curvature(s), slope * slope);
            // Where a parabola comes to zero, its slope squared is twice its depth times the curvature. A NaN falls nowhere.
            let falls = low <= s && s <= high && slope < 0.0 && squared > noise * curvature.abs();
            if !falls {
                break;
            }
            if last_step <= 1e-3 * self.minor {
                let root = s - self.last_step(line, s, slope);
                let left_over = (s - root) * (s - root) * curvature / slope;
                let is_exact = left_over.abs() <= 0.25 * f64::EPSILON * self.minor;
                if is_exact && line.low < root && root < line.high {
                    return Some(root);
                }
                break;
            }
            let step = value * slope / (squared - 0.5 * value * curvature).max(0.5 * squared);
            last_step = step.abs();
            s -= step;
        }
        None
    }

    /// A ring's step of Newton's method by its own equation, from near a zero of the quartic, which has this slope there.
    #[inline]
    fn last_step(&self, line: &Line, s: f64, slope: f64) -> f64 {
        let p = line.p + s * line.u;
        let (outer, inner) = self.factors((p.x * p.x + p.y * p.y).sqrt(), p.z);
        outer * inner / slope
    }

    /// The same piece by piece, without the first if it was emitted.
    ///
    /// The quartic s⁴ + p s² + q s + w is monotone between the roots of its derivative; where its signs differ at the ends
    /// of a piece there is a root. Where it vanishes at such an end the line touches.
    #[inline]
    fn crossings_by_pieces(
        &self,
        line: &Line,
        quartic: Quartic,
        t_min: f64,
        first: First,
        emit: impl FnMut(f64, u8) -> bool,
    ) {
        let left = (line.low, 1.0, 0.0);
        let mut pieces = Pieces { torus: self, line, quartic, t_min, first, emit, left, touching: None };
        let _: Option<()> = (|| {
            match DepressedCubic::new(0.5 * quartic.p, 0.25 * quartic.q) {
                DepressedCubic::OneRoot(split) => pieces.until(split)?,
                DepressedCubic::ThreeRoots(three) => {
                    let left = three.left();
                    pieces.until(left)?;
                    let (middle, right) = three.others(left);
                    pieces.until(middle)?;
                    pieces.until(right)?;
                }
            }
            pieces.until_sign(line.high, 1.0, 0.0)
        })();
    }

    /// The first crossing in the ray's range.
    #[inline]
    pub fn closest(&self, ray: &Ray) -> Option<Root> {
        let line = self.line(ray)?;
        let mut found = None;
        self.crossings(&line, ray.t_min, |t, multiplicity| {
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
        self.crossings(&line, ray.t_min, |t, multiplicity| {
            if ray.contains(t) && t.is_finite() {
                out.push(Root { multiplicity, ..Root::at(t) });
            }
            t <= ray.t_max
        });
    }

    /// The surface at a crossing.
    pub fn surface(&self, ray: &Ray, root: &Root) -> Surface {
        // From the point nearest to the centre, which is as exact as the torus is small.
        let d = ray.direction;
        let w = ray.origin - self.center;
        let near_t = -w.dot(d) / d.length_squared();
        let p = self.framed((w + near_t * d) + (root.t - near_t) * d);
        let rho = p.x.hypot(p.y);
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
        let meridian = DVec2::from_angle(TAU * uv.x);
        let tube = DVec2::from_angle(TAU * uv.y);
        (part == 0).then(|| Surface { uv, ..self.surface_on(meridian, tube) })
    }

    /// The surface on the half-plane of the unit vector `meridian`, in the direction `tube` from the circle's point there:
    /// its first component along the meridian, its second along the axis.
    fn surface_on(&self, meridian: DVec2, tube: DVec2) -> Surface {
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

    /// The box under a transform, tight.
    pub fn bounds(&self, world_from_object: &Transform) -> Option<Aabb> {
        let support = |d: DVec3| {
            let across = d.dot(self.e1).hypot(d.dot(self.e2));
            d.dot(self.center) + self.major * across + self.minor * d.length()
        };
        let magnitude = self.center.abs() + DVec3::splat(self.major + self.minor);
        Some(bounds_from_support(world_from_object, magnitude, support))
    }

    /// The body of revolution whose outline touches the tube where it turns from out to up, and of a ring its tube.
    pub fn hull(&self) -> Option<Hull> {
        let (major, minor) = (self.major, self.minor);
        let reach = major + minor;
        let axes = DMat3::from_cols(reach * self.e1, reach * self.e2, minor * self.axis);
        // At a height of `minor` z, ρ² is at most (R + r s)² with s = √(1 - z²), and s at most that of the tangent to it as a
        // function of z², here at z² = 1/2: s ≤ (1/√2) + (1/2 - z²) / √2.
        let (big, small) = (major / reach, minor / reach);
        let s = std::f64::consts::FRAC_1_SQRT_2;
        let constant = big * big + small * small + 3.0 * s * big * small;
        let slope = small * small + 2.0 * s * big * small;
        let hull = Hull::new(self.center, axes, [slope, 0.0, -constant], self.is_ring());
        Some(Hull { tube: if self.is_ring() { small } else { 0.0 }, ..hull })
    }

    /// Where the tube meets the axis: ϑ beyond it, up to π, belongs to the inner sheet; π for a ring.
    fn crossing_angle(&self) -> f64 {
        (-self.major / self.minor).max(-1.0).acos()
    }

    /// The integral of |major + minor cos ϑ| from 0 to `theta`, for an angle up to π, and its slope.
    fn swept(&self, theta: f64) -> (f64, f64) {
        let signed = |theta: f64| self.major * theta + self.minor * theta.sin();
        let split = self.crossing_angle();
        let slope = (self.major + self.minor * theta.cos()).abs();
        if theta <= split { (signed(theta), slope) } else { (2.0 * signed(split) - signed(theta), slope) }
    }

    /// The area: 4π² major minor for a ring. A spindle's inner sheet counts as well.
    pub fn area(&self) -> f64 {
        2.0 * TAU * self.minor * self.swept(PI).0
    }

    /// The area after a transform, by quadrature.
    pub fn area_under(&self, world_from_object: &Transform) -> f64 {
        let split = self.crossing_angle() / TAU;
        // A spindle's area element has a kink where the sheets cross.
        let pieces = [(0.0, split), (split, 1.0 - split), (1.0 - split, 1.0)];
        let piece = |(from, to): (f64, f64)| {
            if to <= from {
                return 0.0;
            }
            measure::patch_area(world_from_object, |u, v| {
                let (meridian, tube) =
                    (DVec2::from_angle(TAU * u), DVec2::from_angle(TAU * (from + v * (to - from))));
                let density = TAU * TAU * self.minor * (self.major + self.minor * tube.x) * (to - from);
                density * self.unframed(DVec3::new(tube.x * meridian.x, tube.x * meridian.y, tube.y))
            })
        };
        pieces.into_iter().map(piece).sum()
    }

    /// Always: a spindle is taken even-odd.
    pub fn is_solid(&self) -> bool {
        true
    }

    /// Whether the closed solid holds `p`.
    pub fn contains(&self, p: DVec3) -> bool {
        let p = self.framed(p - self.center);
        let (outer, inner) = self.factors(p.x.hypot(p.y), p.z);
        outer <= 0.0 && (self.is_ring() || inner >= 0.0)
    }

    /// The nearest point to `p` under a map that keeps angles.
    ///
    /// # Errors
    /// [`NoNearestPoint::Map`] for other maps.
    pub fn closest_point(
        &self,
        world_from_object: &Transform,
        p: DVec3,
    ) -> Result<NearestPoint, NoNearestPoint> {
        under_similarity(world_from_object, p, |p| {
            let local = self.framed(p - self.center);
            let rho = local.x.hypot(local.y);
            let outward = if rho > 0.0 { DVec2::new(local.x, local.y) / rho } else { DVec2::X };
            // The plane through the axis and the point cuts the torus in two circles.
            let near = DVec2::new(rho - self.major, local.z);
            let far = DVec2::new(-rho - self.major, local.z);
            let distance = |tube: DVec2| (tube.length() - self.minor).abs();
            let (surface, distance) = if distance(near) <= distance(far) {
                (self.surface_on(outward, near), distance(near))
            } else {
                (self.surface_on(-outward, far), distance(far))
            };
            NearestPoint { point: surface.point, distance, part: 0, uv: surface.uv }
        })
    }

    /// "torus".
    pub fn name(&self) -> &'static str {
        "torus"
    }

    /// A point uniform by area.
    pub fn sample_area(&self, u: DVec2) -> Option<SurfaceSample> {
        // The upper half of the tube for one half of the numbers, the lower for the other.
        let (upper, fraction) = if u.y < 0.5 { (true, 2.0 * u.y) } else { (false, 2.0 * u.y - 1.0) };
        let goal = fraction * self.swept(PI).0;
        let theta = bracketed_root(0.0, PI, fraction * PI, true, |theta| {
            let (value, slope) = self.swept(theta);
            (value - goal, slope)
        });
        let (sin, cos) = theta.sin_cos();
        let tube = DVec2::new(cos, if upper { sin } else { -sin });
        let surface = self.surface_on(DVec2::from_angle(TAU * u.x), tube);
        Some(SurfaceSample { surface, pdf: 1.0 / self.area() })
    }

    /// A point uniform by area, as seen from `from`.
    pub fn sample_direction(&self, from: DVec3, u: DVec2) -> Option<DirectionSample> {
        density::seen_from(from, self.sample_area(u)?)
    }

    /// The density of [`Torus::sample_direction`].
    pub fn pdf_direction(&self, ray: &Ray, surface: &Surface) -> f64 {
        density::pdf_seen_from(ray, surface, 1.0 / self.area())
    }
}

#[cfg(test)]
mod tests {
    use lumbre_math::random::RandomStream;

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

    /// Lines of every kind about a ring: far and near, steep and flat, many of which pass close to touching.
    fn lines(count: u32) -> impl Iterator<Item = Ray> {
        let mut random = RandomStream::new(33);
        let mut next = move || 2.0 * random.next_f64() - 1.0;
        (0..count).map(move |i| {
            let through = 1.3 * DVec3::new(next(), next(), 0.4 * next());
            let direction = DVec3::new(next(), next(), next() * 0.5f64.powi(i as i32 % 12));
            Ray::new(through - 10f64.powi(i as i32 % 4) * direction, direction)
        })
    }

    #[test]
    fn the_way_down_to_the_first_crossing_ends_where_the_first_piece_does() {
        let (mut found, mut all) = (0, 0);
        for minor in [0.02, 0.25, 0.6, 0.95] {
            let ring = Torus::new(DVec3::ZERO, DVec3::Z, 1.0, minor).unwrap();
            for ray in lines(if cfg!(miri) { 200 } else { 20_000 }) {
                let Some(line) = ring.line(&ray) else { continue };
                let quartic = Quartic::new(&ring, &line);
                let mut by_pieces = Vec::new();
                ring.crossings_by_pieces(&line, quartic, f64::NEG_INFINITY, First::Unclear, |t, n| {
                    by_pieces.push((t, n));
                    true
                });
                all += 1;
                let mut by_both = Vec::new();
                ring.crossings(&line, f64::NEG_INFINITY, |t, n| {
                    by_both.push((t, n));
                    true
                });
                assert_eq!(by_both.len(), by_pieces.len(), "{ray:?}");
                let Some(s) = ring.descend(&line, &quartic) else {
                    assert_eq!(by_both, by_pieces);
                    continue;
                };
                found += 1;
                let &[(t, multiplicity), ref behind @ ..] = &by_pieces[..] else { panic!("{ray:?}") };
                // As far as the place is told by an equation that is rounded.
                let steepness = (ring.value_and_slope(&line, s).1 / minor).abs().min(1.0);
                let rounding = 1e-14 + 2.0 * f64::EPSILON * line.shift.abs();
                assert!((line.t(s) - t).abs() * line.speed * steepness <= rounding, "{ray:?} {s} {t}");
                assert_eq!(multiplicity, 1, "{ray:?}");
                assert_eq!(by_both[0], (line.t(s), 1));
                assert_eq!(by_both[1..], *behind);
                // Wherever a ray begins, it has what the line has from there on.
                for t_min in by_both.iter().map(|(t, _)| *t).chain([line.t(line.low), line.t(line.high)]) {
                    let mut ahead = Roots::new();
                    ring.roots(&ray.with_range(t_min, f64::INFINITY), &mut ahead);
                    let ahead: Vec<_> = ahead.iter().map(|root| (root.t, root.multiplicity)).collect();
                    let expected: Vec<_> = by_both.iter().copied().filter(|(t, _)| *t >= t_min).collect();
                    assert_eq!(ahead, expected, "{ray:?}");
                }
            }
        }
        assert!(10 * found > 9 * all, "{found} of {all}");
    }

    #[test]
    fn a_horn_is_touched_at_its_point_and_a_spindle_crossed_on_both_sheets() {
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
    fn the_area_of_a_spindle_counts_both_sheets() {
        let spindle = Torus::new(DVec3::ONE, DVec3::X, 1.5, 2.0).unwrap();
        let by_quadrature = spindle.area_under(&Transform::IDENTITY);
        assert!((spindle.area() / by_quadrature - 1.0).abs() < 1e-10);
        let ring = Torus::new(DVec3::ONE, DVec3::X, 2.5, 0.75).unwrap();
        assert!((ring.area() - 4.0 * PI * PI * 2.5 * 0.75).abs() < 1e-12);
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
