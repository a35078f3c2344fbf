//! Triangles and rectangles that emit the same everywhere, in lanes: sampled by solid angle when near, else by area.

use std::f32::consts::TAU;

use lumbre_simd::{Double, Mask, Real, UInt, V3, math};

use super::sample::LaneLightSample;
use super::table::{Rows, Table, piece};

/// From this many radii away, sampling by area is as good as by solid angle, and faster.
const FAR_SQUARED: f32 = 4.0;
/// Solid angles of rectangles below this are sampled by area: they lose the digits of the angles that they are the
/// difference of.
const MIN_OF_RECTANGLE: f32 = 2e-3;
/// The same of triangles.
const MIN_OF_TRIANGLE: f32 = 5e-3;
/// Corners whose sine is less are too thin for the formulas of spherical triangles.
const MIN_SINE: f32 = 1e-2;

type Complex<R> = [R; 2];

#[inline(always)]
fn product<R: Real>(a: Complex<R>, b: Complex<R>) -> Complex<R> {
    [a[0] * b[0] - a[1] * b[1], a[1] * b[0] + a[0] * b[1]]
}

#[inline(always)]
fn conjugate<R: Real>(a: Complex<R>) -> Complex<R> {
    [a[0], -a[1]]
}

#[inline(always)]
fn clamped<R: Real>(x: R, least: R, greatest: R) -> R {
    x.simd_max(least).simd_min(greatest)
}

/// A piece as it is seen from a place, if it is near.
struct View<R: Real> {
    rectangle: SeenRectangle<R>,
    triangle: SeenTriangle<R>,
    /// Whether it is sampled by solid angle, as a rectangle or as a triangle.
    by_rectangle: R::Mask,
    by_triangle: R::Mask,
}

/// What a piece is, in each lane.
struct LanePiece<R: Real> {
    sides: [V3<R>; 2],
    normal: V3<R>,
    area: R,
    reach_squared: R,
    is_rectangle: R::Mask,
    /// From the place to the first corner.
    way: V3<R>,
}

impl<R: Real> LanePiece<R> {
    #[inline(always)]
    fn new(rows: &Rows<'_, R>, way: V3<R>) -> Self {
        Self {
            sides: [rows.vector(piece::SIDE_A), rows.vector(piece::SIDE_B)],
            normal: rows.vector(piece::NORMAL),
            area: rows.number(piece::AREA),
            reach_squared: rows.number(piece::REACH_SQUARED),
            is_rectangle: rows.number(piece::IS_RECTANGLE).simd_eq(R::one()),
            way,
        }
    }

    #[inline(always)]
    fn is_near(&self) -> R::Mask {
        let part = R::select(self.is_rectangle, R::splat(0.5), R::splat(1.0 / 3.0));
        let to_center = self.way + (self.sides[0] + self.sides[1]) * part;
        to_center.length_squared().simd_le(R::splat(FAR_SQUARED) * self.reach_squared)
    }

    /// How it is sampled from the place.
    #[inline(always)]
    fn view(&self, active: R::Mask) -> View<R> {
        let near = active & self.is_near();
        let near_rectangle = near & self.is_rectangle;
        let near_triangle = near & !self.is_rectangle;
        let (mut rectangle, mut triangle) = (SeenRectangle::none(), SeenTriangle::none());
        let (mut by_rectangle, mut by_triangle) = (near_rectangle, near_triangle);
        if near_rectangle.any() {
            rectangle = SeenRectangle::new(self);
            by_rectangle = near_rectangle & rectangle.fits();
        }
        if near_triangle.any() {
            triangle = SeenTriangle::new(self);
            by_triangle = near_triangle & triangle.fits();
        }
        View { rectangle, triangle, by_rectangle, by_triangle }
    }

    /// The density per solid angle of uniform sampling by area: distance² / (|cos θ| area).
    #[inline(always)]
    fn density_by_area(&self, arm: V3<R>) -> R {
        let squared = arm.length_squared();
        squared * squared.sqrt() / (self.normal.dot(arm).abs() * self.area)
    }

    #[inline(always)]
    fn density(&self, view: &View<R>, arm: V3<R>) -> R {
        let density = self.density_by_area(arm);
        let density = R::select(view.by_rectangle, view.rectangle.solid_angle.recip(), density);
        R::select(view.by_triangle, view.triangle.solid_angle.recip(), density)
    }
}

/// A sample of the piece of each active lane.
#[inline(always)]
pub(super) fn sample<R: Real>(
    table: &Table,
    active: R::Mask,
    emitter: R::UInt,
    from: V3<R::Double>,
    u: [R; 2],
) -> LaneLightSample<R> {
    let emitter = R::UInt::select(active, emitter, R::UInt::splat(0));
    let rows = table.piece_rows::<R>(emitter, active);
    let corner = table.corner::<R>(emitter);
    let this = LanePiece::new(&rows, (corner - from).to_single());
    let view = this.view(active);
    // By area; of a triangle by the map of E. Heitz, "A low-distortion map between triangle and square", 2019.
    let half = R::splat(0.5);
    let is_upper = u[0].simd_lt(u[1]);
    let of_triangle = [
        R::select(is_upper, half * u[0], u[0] - half * u[1]),
        R::select(is_upper, u[1] - half * u[0], half * u[1]),
    ];
    let mut part = [
        R::select(this.is_rectangle, u[0], of_triangle[0]),
        R::select(this.is_rectangle, u[1], of_triangle[1]),
    ];
    if view.by_rectangle.any() {
        let by_angle = view.rectangle.sample(u);
        part = [
            R::select(view.by_rectangle, by_angle[0], part[0]),
            R::select(view.by_rectangle, by_angle[1], part[1]),
        ];
    }
    if view.by_triangle.any() {
        let by_angle = view.triangle.sample(&this, u);
        part = [
            R::select(view.by_triangle, by_angle[0], part[0]),
            R::select(view.by_triangle, by_angle[1], part[1]),
        ];
    }
    let [a, b] = [this.sides[0].to_double(), this.sides[1].to_double()];
    let point = corner + a * R::Double::from_single(part[0]) + b * R::Double::from_single(part[1]);
    let arm = (point - from).to_single();
    let squared = arm.length_squared();
    let pdf = this.density(&view, arm);
    let is_front = this.normal.dot(this.way).simd_lt(R::zero());
    let shines = is_front | rows.number(piece::SIDES).simd_eq(R::splat(2.0));
    let radiance = rows.vector(piece::RADIANCE);
    let none = R::Mask::splat(false);
    LaneLightSample {
        towards: arm * squared.sqrt().recip(),
        point,
        error: rows.vector(piece::ERROR).to_double(),
        normal: this.normal,
        infinite: none,
        radiance,
        pdf,
        delta: none,
        source: R::UInt::splat(0),
        valid: active
            & shines
            & squared.simd_gt(R::zero())
            & pdf.simd_gt(R::zero())
            & pdf.is_finite()
            & radiance.max_component().simd_gt(R::zero()),
    }
}

/// The density of [`sample`] for a point of the piece of each active lane.
#[inline(always)]
pub(super) fn pdf<R: Real>(
    table: &Table,
    active: R::Mask,
    emitter: R::UInt,
    from: V3<R::Double>,
    point: V3<R::Double>,
) -> R {
    let emitter = R::UInt::select(active, emitter, R::UInt::splat(0));
    let rows = table.piece_rows::<R>(emitter, active);
    let this = LanePiece::new(&rows, (table.corner::<R>(emitter) - from).to_single());
    let view = this.view(active);
    let pdf = this.density(&view, (point - from).to_single());
    // Seen edge-on, it is infinite.
    pdf.or_zero(active & pdf.is_finite())
}

/// A rectangle as it is seen from a place, in units of its longer side.
///
/// C. Urena, M. Fajardo, A. King, "An Area-Preserving Parametrization for Spherical Rectangles", EGSR 2013. The four
/// angles are kept as complex numbers, whose product needs one arc tangent for the solid angle.
struct SeenRectangle<R: Real> {
    least: [R; 2],
    greatest: [R; 2],
    lengths: [R; 2],
    height: R,
    low: Complex<R>,
    high: Complex<R>,
    solid_angle: R,
}

#[inline(always)]
fn corner_angle<R: Real>(x: R, y: R, height: R) -> Complex<R> {
    [height * (x * x + y * y + height * height).sqrt(), x * y]
}

impl<R: Real> SeenRectangle<R> {
    #[inline(always)]
    fn none() -> Self {
        let zero = [R::zero(); 2];
        let (height, solid_angle) = (R::zero(), R::zero());
        Self { least: zero, greatest: zero, lengths: zero, height, low: zero, high: zero, solid_angle }
    }

    #[inline(always)]
    fn new(piece: &LanePiece<R>) -> Self {
        let [a, b] = piece.sides;
        let lengths = [a.length(), b.length()];
        let axes = [a * lengths[0].recip(), b * lengths[1].recip()];
        let unit = lengths[0].simd_max(lengths[1]).recip();
        let way = piece.way * unit;
        let lengths = [lengths[0] * unit, lengths[1] * unit];
        let least = [way.dot(axes[0]), way.dot(axes[1])];
        let greatest = [least[0] + lengths[0], least[1] + lengths[1]];
        let height = way.dot(piece.normal).abs();
        let low = corner_angle(least[0], least[1], height);
        let high = corner_angle(least[0], greatest[1], height);
        let low_beyond = corner_angle(greatest[0], least[1], height);
        let high_beyond = corner_angle(greatest[0], greatest[1], height);
        let turn = product(product(high_beyond, low), conjugate(product(low_beyond, high)));
        let angle = math::atan2(turn[1], turn[0]);
        // A sum of angles, from 0 to a full turn.
        let solid_angle = R::select(angle.simd_lt(R::zero()), angle + R::splat(TAU), angle);
        Self { least, greatest, lengths, height, low, high, solid_angle }
    }

    #[inline(always)]
    fn fits(&self) -> R::Mask {
        self.solid_angle.simd_gt(R::splat(MIN_OF_RECTANGLE))
            & self.solid_angle.simd_lt(R::splat(TAU - MIN_OF_RECTANGLE))
    }

    /// A point uniform by solid angle, as fractions of the sides.
    #[inline(always)]
    fn sample(&self, u: [R; 2]) -> [R; 2] {
        let squared = self.height * self.height;
        let (y0, y1) = (self.least[1], self.greatest[1]);
        let (reach0, reach1) = ((y0 * y0 + squared).sqrt(), (y1 * y1 + squared).sqrt());
        // The part from the least x to this one has u[0] of the solid angle.
        let (sin, cos) = math::sin_cos_turns(u[0] * self.solid_angle * R::splat(1.0 / TAU));
        let base = product(self.high, conjugate(self.low));
        let norm = (base[0] * base[0] + base[1] * base[1]).sqrt().recip();
        let turned = product([cos, sin], [base[0] * norm, base[1] * norm]);
        let f = (y1 / reach1 - turned[0] * (y0 / reach0)) / turned[1];
        let over = (f * f - squared / (reach0 * reach0)).simd_max(R::zero()).sqrt();
        let x = clamped(self.height.copysign(f) / over, self.least[0], self.greatest[0]);
        // Along y, uniform by the sine of the angle.
        let across = x * x + squared;
        let (h0, h1) = (y0 / (across + y0 * y0).sqrt(), y1 / (across + y1 * y1).sqrt());
        let h = h0 + u[1] * (h1 - h0);
        let y = clamped(h * (across / (R::one() - h * h)).sqrt(), y0, y1);
        let (zero, one) = (R::zero(), R::one());
        [
            clamped((x - self.least[0]) / self.lengths[0], zero, one),
            clamped((y - self.least[1]) / self.lengths[1], zero, one),
        ]
    }
}

/// A triangle as it is seen from a place.
///
/// J. Arvo, "Stratified sampling of spherical triangles", SIGGRAPH 1995; the solid angle after A. van Oosterom, J.
/// Strackee, "The solid angle of a plane triangle", IEEE Transactions on Biomedical Engineering, 1983. Sines and
/// cosines of the first corner's angle come from vector products, so that no angle is computed.
struct SeenTriangle<R: Real> {
    /// The unit ways to the corners.
    corners: [V3<R>; 3],
    solid_angle: R,
    /// Of the angle at the first corner.
    cosine: R,
    sine: R,
}

impl<R: Real> SeenTriangle<R> {
    #[inline(always)]
    fn none() -> Self {
        let zero = R::zero();
        Self { corners: [V3::splat(zero); 3], solid_angle: zero, cosine: zero, sine: zero }
    }

    #[inline(always)]
    fn new(piece: &LanePiece<R>) -> Self {
        // In units of the reach, so that no product overflows.
        let unit = piece.reach_squared.sqrt().recip();
        let (edge_a, edge_b) = (piece.sides[0] * unit, piece.sides[1] * unit);
        let a = piece.way * unit;
        let (b, c) = (a + edge_a, a + edge_b);
        let (length_a, length_b, length_c) = (a.length(), b.length(), c.length());
        let volume = a.dot(edge_a.cross(edge_b)).abs();
        let denominator =
            length_a * length_b * length_c + a.dot(b) * length_c + b.dot(c) * length_a + c.dot(a) * length_b;
        let solid_angle = R::splat(2.0) * math::atan2(volume, denominator);
        let corners = [a * length_a.recip(), b * length_b.recip(), c * length_c.recip()];
        // By edges, not corners, which may be near each other.
        let (normal_b, normal_c) = (a.cross(edge_a).normalize(), a.cross(edge_b).normalize());
        let (cosine, sine) = (normal_b.dot(normal_c), normal_b.cross(normal_c).length());
        Self { corners, solid_angle, cosine, sine }
    }

    #[inline(always)]
    fn fits(&self) -> R::Mask {
        self.solid_angle.simd_gt(R::splat(MIN_OF_TRIANGLE))
            & self.solid_angle.simd_lt(R::splat(TAU - MIN_OF_TRIANGLE))
            & self.sine.simd_gt(R::splat(MIN_SINE))
    }

    /// A point uniform by solid angle, as fractions of the sides.
    #[inline(always)]
    fn sample(&self, piece: &LanePiece<R>, u: [R; 2]) -> [R; 2] {
        let [a, b, c] = self.corners;
        let (zero, one) = (R::zero(), R::one());
        // A smaller triangle with the same first corner, whose area is the fraction u[0] of the whole. φ is the angle
        // of that area, less that of the corner, and half a turn.
        let (sin, cos) = math::sin_cos_turns(u[0] * self.solid_angle * R::splat(1.0 / TAU));
        let cos_phi = -(cos * self.cosine + sin * self.sine);
        let sin_phi = -(sin * self.cosine - cos * self.sine);
        let k1 = cos_phi + self.cosine;
        let k2 = sin_phi - self.sine * a.dot(b);
        let numerator = k2 + (k2 * cos_phi - k1 * sin_phi) * self.cosine;
        let cos_b = numerator / ((k2 * sin_phi + k1 * cos_phi) * self.sine);
        let cos_b = clamped(cos_b, -one, one);
        let sin_b = (one - cos_b * cos_b).sqrt();
        let moved = a * cos_b + (c - a * c.dot(a)).normalize() * sin_b;

        // A point between the second corner and the moved one. 1 − cos by the chord, which keeps its digits.
        let versine = u[1] * R::splat(0.5) * (moved - b).length_squared();
        let sin_theta = (versine * (R::splat(2.0) - versine)).simd_max(zero).sqrt();
        let across = moved - b * moved.dot(b);
        let length = across.length();
        let across = across * length.recip().or_zero(length.simd_gt(zero));
        let direction = b * (one - versine) + across * sin_theta;

        // Where it meets the plane; rounding may put it slightly outside.
        let [edge_a, edge_b] = piece.sides;
        let s = -piece.way;
        let s1 = direction.cross(edge_b);
        let inverse = s1.dot(edge_a).recip();
        let x = clamped(s1.dot(s) * inverse, zero, one);
        let y = clamped(s.cross(edge_a).dot(direction) * inverse, zero, one - x);
        [x, y]
    }
}
