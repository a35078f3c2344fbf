//! Where a line crosses a surface of the second degree.

use lumbre_math::DVec3;
use lumbre_math::quadratic::quadratic;
use lumbre_math::rounding::gamma;

use crate::support::{length, on_side_of, unit};
use crate::twofold::{Magnitude, Number, Twofold, components, place, place_near, point};
use crate::{Ray, Root};

/// A surface F = 0 of the second degree.
pub(crate) trait SecondDegree {
    /// The point that places are relative to.
    fn base(&self) -> DVec3;

    /// A point about which the surface is.
    fn center(&self) -> DVec3;

    /// The coefficients of F(p + s d) = a s² + 2 h s + c, for a point `p` relative to the base.
    fn along<N: Number>(&self, p: [N; 3], d: [N; 3]) -> [N; 3];
}

/// Both crossings of a ray's line in order, whatever its range: equal where it touches, infinite where there is none;
/// `None` where it misses.
///
/// The equation is set up at the ray's origin if that is near, else about the middle of the two crossings, so that it
/// keeps its digits however far away the ray begins. Doubles with an error bound decide most lines, and double-double
/// the others: those that nearly touch, that are nearly parallel to an asymptote or a generator, or whose digits
/// cancel.
#[inline]
pub(crate) fn crossings(surface: &impl SecondDegree, ray: &Ray) -> Option<(f64, f64)> {
    let (start, p, slack) = set_up(surface, ray);
    let doubles = Doubles::new(surface, ray.direction, p, slack);
    doubles.crossings(start).unwrap_or_else(|| exact_crossings(surface, ray, start, p))
}

/// Where the equation is set up: the parameter, the place there relative to the base, and how far that may be off, in
/// units of the unit roundoff.
#[inline(always)]
pub(crate) fn set_up(surface: &impl SecondDegree, ray: &Ray) -> (f64, DVec3, DVec3) {
    let (w, d) = (ray.origin - surface.base(), ray.direction);
    let [a, h, c] = surface.along(w.to_array(), d.to_array());
    if is_nearby(a, h, c) {
        (0.0, w, w.abs())
    } else {
        place_near(ray.origin, surface.base(), start(ray.origin - surface.center(), d, a, h), d)
    }
}

/// The equation in doubles, with bounds of its errors.
pub(crate) struct Doubles {
    pub(crate) a: f64,
    pub(crate) h: f64,
    pub(crate) c: f64,
    /// h² − ac.
    pub(crate) delta: f64,
    /// Of a, h and c, in units of the unit roundoff.
    pub(crate) errors: [f64; 3],
    /// Of the discriminant.
    pub(crate) delta_error: f64,
}

impl Doubles {
    /// The equation set up at the place `p`, which is `slack` units of the unit roundoff off.
    #[inline(always)]
    pub(crate) fn new(surface: &impl SecondDegree, d: DVec3, p: DVec3, slack: DVec3) -> Self {
        let [a, h, c] = surface.along(p.to_array(), d.to_array());
        let delta = h * h - a * c;
        // No coefficient is off by more than this many units of the unit roundoff of its terms.
        const ROUNDINGS: f64 = 20.0;
        let sizes = surface.along(components::<Magnitude>(p.abs().max(slack)), components(d));
        let errors @ [a_error, h_error, c_error] = sizes.map(|size| ROUNDINGS * size.0);
        let delta_error = 2.0 * h.abs() * h_error + a.abs() * c_error + c.abs() * a_error;
        Self { a, h, c, delta, errors, delta_error: f64::EPSILON * delta_error }
    }

    /// The crossings as far as doubles decide them.
    #[inline(always)]
    pub(crate) fn crossings(&self, start: f64) -> Option<Option<(f64, f64)>> {
        let &Self { a, h, c, delta, errors, delta_error } = self;
        // False for a NaN.
        let is_certain = delta.abs() > delta_error;
        if !is_certain {
            return None;
        }
        if delta < 0.0 {
            return Some(None);
        }
        let (first, second) = quadratic(a, h, c, delta)?;
        let keeps_digits = is_exact(start, [first, second], 2.0 * delta.sqrt(), errors, 200.0);
        keeps_digits.then_some(Some((start + first, start + second)))
    }
}

/// As [`crossings`], in twice the precision, and at the place `p` by `start` for want of that.
#[cold]
#[inline(never)]
pub(crate) fn exact_crossings(
    surface: &impl SecondDegree,
    ray: &Ray,
    start: f64,
    p: DVec3,
) -> Option<(f64, f64)> {
    let exact = Solution::new(ray.origin, surface.base(), ray.direction, start, |p, d| surface.along(p, d));
    if exact.is_finite {
        return exact.crossings;
    }
    let [a, h, c] = surface.along(p.to_array(), ray.direction.to_array());
    let (first, second) = quadratic(a, h, c, h * h - a * c)?;
    Some((start + first, start + second))
}

/// Whether the ray begins so near to the crossings that the equation keeps its digits there.
#[inline]
pub(crate) fn is_nearby(a: f64, h: f64, c: f64) -> bool {
    h * h <= 4.0 * (h * h - a * c)
}

/// The parameter to set the equation up at, far away: the middle of the crossings, if that is not much farther from the
/// surface's centre than the ray's origin, at `w` from there; else the point nearest to the centre.
#[inline]
pub(crate) fn start(w: DVec3, d: DVec3, a: f64, h: f64) -> f64 {
    let (middle, dd) = (-h / a, d.length_squared());
    // False for a NaN.
    let is_near = (w + middle * d).length_squared() <= 16.0 * w.length_squared();
    if is_near { middle } else { -w.dot(d) / dd }
}

/// Whether the errors of the coefficients, in units of the unit roundoff, leave both crossings their digits, where F's
/// derivative is `slope`: the bounds may be `tolerance` units of `t`, for they are sums of absolute values, of which
/// rounding errors hardly ever reach a tenth.
#[inline]
pub(crate) fn is_exact(start: f64, roots: [f64; 2], slope: f64, [a, h, c]: [f64; 3], tolerance: f64) -> bool {
    roots.into_iter().all(|root| {
        let (s, t) = (root.abs(), (start + root).abs());
        // A ray that starts at a crossing has no digits of that one to keep: there F is what rounding leaves of its
        // terms.
        if t * slope < 1e-14 * c {
            return true;
        }
        let size = if t > 1e-6 * start.abs() { t } else { start.abs() };
        let error = c + s * (2.0 * h + s * a);
        // False for a NaN, and for a root at infinity. Where start and root cancel, their sum has few digits.
        error < tolerance * slope * size && s < 4.0 * size
    })
}

/// A quadratic equation along a line, solved in twice the precision.
pub(crate) struct Solution {
    /// Both crossings as values of `t`: see [`crossings`].
    pub(crate) crossings: Option<(f64, f64)>,
    /// Where the equation was set up, and the point there relative to the base.
    pub(crate) start: f64,
    pub(crate) place: [Twofold; 3],
    /// The coefficients there.
    pub(crate) a: Twofold,
    pub(crate) h: Twofold,
    pub(crate) c: Twofold,
    /// False where a product over- or underflowed beyond use: then nothing is known.
    pub(crate) is_finite: bool,
}

impl Solution {
    #[cold]
    #[inline(never)]
    pub(crate) fn new(
        origin: DVec3,
        base: DVec3,
        direction: DVec3,
        start: f64,
        along: impl Fn([Twofold; 3], [Twofold; 3]) -> [Twofold; 3],
    ) -> Self {
        // Only some leading digits, so that small numbers stay exact and a line that touches is seen to.
        let start = if start.is_finite() { f64::from_bits(start.to_bits() & (!0 << 32)) } else { 0.0 };
        let place = place(origin, base, start, direction);
        let [a, h, c] = along(place, components(direction));
        let delta = h * h - a * c;
        let is_finite = delta.is_finite();
        let at = |s: Twofold| (Twofold::from(start) + s).high;
        let crossings = if !is_finite || delta.high < 0.0 {
            None
        } else if delta.high == 0.0 {
            let double = at((h / a).negated());
            double.is_finite().then_some((double, double))
        } else {
            let q = stable(h, delta);
            let near = at(c / q);
            // As `a` vanishes, one crossing goes to infinity.
            let far = q.high / a.high;
            let far = if far.is_finite() { at(q / a) } else { far };
            Some(if near <= far { (near, far) } else { (far, near) })
        };
        Self { crossings, start, place, a, h, c, is_finite }
    }

    /// h² − ac.
    pub(crate) fn delta(&self) -> Twofold {
        self.h * self.h - self.a * self.c
    }

    /// q: one root is q/a, the other c/q.
    pub(crate) fn q(&self) -> Twofold {
        stable(self.h, self.delta())
    }

    /// The point, relative to the base, of the crossing that `t` is: not rounded on the way, which from far away would
    /// put it anywhere on the surface.
    pub(crate) fn point(&self, t: f64, direction: DVec3) -> Option<DVec3> {
        let (first, second) = self.crossings?;
        let delta = self.delta();
        let q = stable(self.h, delta);
        let pair = if delta.sqrt().high == 0.0 {
            [(self.h / self.a).negated(); 2]
        } else {
            [self.c / q, q / self.a]
        };
        let [near, far] = if pair[1].high < pair[0].high { [pair[1], pair[0]] } else { pair };
        let s = if (t - first).abs() <= (second - t).abs() { near } else { far };
        let at = |i: usize| (self.place[i] + s * Twofold::from(direction[i])).high;
        let point = DVec3::new(at(0), at(1), at(2));
        point.is_finite().then_some(point)
    }
}

/// −(h ± √Δ), with the sign that lets nothing cancel.
fn stable(h: Twofold, delta: Twofold) -> Twofold {
    let root = delta.sqrt();
    if h.high < 0.0 { root - h } else { (h + root).negated() }
}

/// The point at a crossing, relative to the base, and on a scale of `size`.
pub(crate) fn point_at(
    surface: &impl SecondDegree,
    ray: &Ray,
    t: f64,
    size: impl FnOnce(DVec3) -> f64,
) -> DVec3 {
    let (base, d) = (surface.base(), ray.direction);
    let p = point(ray.origin, base, t, d);
    if !is_blurred(ray, t, size(p)) {
        return p;
    }
    let start = -(ray.origin - surface.center()).dot(d) / d.length_squared();
    Solution::new(ray.origin, base, d, start, |p, d| surface.along(p, d)).point(t, d).unwrap_or(p)
}

/// The unit vector along F's gradient at `t`, on the side of the ray that its crossings say.
pub(crate) fn sided_gradient(surface: &impl SecondDegree, gradient: DVec3, ray: &Ray, t: f64) -> DVec3 {
    let Some((first, second)) = crossings(surface, ray) else {
        return gradient;
    };
    let are_two = first < second && (second - first).is_finite();
    if !are_two {
        return gradient;
    }
    let (w, d) = (ray.origin - surface.base(), ray.direction);
    let [a, ..] = surface.along(w.to_array(), d.to_array());
    on_side_of(gradient, d, (t - first < second - t) == (a > 0.0))
}

/// Whether the rounding of `t` moves the point there by more than a small part of `size`.
#[inline]
pub(crate) fn is_blurred(ray: &Ray, t: f64, size: f64) -> bool {
    // False for a NaN.
    let is_sharp = f64::EPSILON * t.abs() * length(ray.direction) <= 1e-6 * size;
    !is_sharp
}

/// The crossings that lie in the ray's range and whose points, relative to `base`, `keeps` accepts.
#[inline]
pub(crate) fn accepted(
    ray: &Ray,
    base: DVec3,
    pair: Option<(f64, f64)>,
    keeps: impl Fn(DVec3) -> bool,
) -> impl Iterator<Item = Root> {
    let (first, second) = pair.unwrap_or((f64::NAN, f64::NAN));
    let touches = first == second;
    let root = |t: f64, multiplicity: u8| {
        // An infinite root is one that the quadratic does not have.
        let counts = t.is_finite() && ray.contains(t) && keeps(point(ray.origin, base, t, ray.direction));
        counts.then_some(Root { multiplicity, ..Root::at(t) })
    };
    let near = root(first, if touches { 2 } else { 1 });
    let far = if touches { None } else { root(second, 1) };
    near.into_iter().chain(far)
}

/// The parameter where a line crosses the plane through `point` perpendicular to `normal`, and the slope of its way
/// along the normal, of the right sign: 0 where it is parallel, and the parameter says nothing.
#[inline]
pub(crate) fn plane_crossing(ray: &Ray, point: DVec3, normal: DVec3) -> (f64, f64) {
    let (away, along, keeps_digits) = plane_products(ray, point, normal);
    if keeps_digits && along != 0.0 {
        (away / along, along)
    } else {
        exact_plane_crossing(ray, point, normal)
    }
}

/// The way to the plane and the ray's way, both along the normal; and whether doubles keep their digits.
#[inline(always)]
pub(crate) fn plane_products(ray: &Ray, point: DVec3, normal: DVec3) -> (f64, f64, bool) {
    let d = ray.direction;
    let to_point = point - ray.origin;
    let (along, away) = (d.dot(normal), to_point.dot(normal));
    let size = normal.abs();
    // Where much cancels, digits are lost.
    let keeps_digits =
        64.0 * along.abs() >= d.abs().dot(size) && 64.0 * away.abs() >= to_point.abs().dot(size);
    (away, along, keeps_digits)
}

/// Both ways as if computed in twice the precision and then rounded.
pub(crate) fn exact_plane_products(ray: &Ray, point: DVec3, normal: DVec3) -> (f64, f64) {
    let n = normal.to_array();
    let along = exact_dot(ray.direction.to_array().map(Twofold::from), n);
    let away = exact_dot(std::array::from_fn(|i| Twofold::difference(point[i], ray.origin[i])), n);
    (away, along)
}

#[inline(never)]
fn exact_plane_crossing(ray: &Ray, point: DVec3, normal: DVec3) -> (f64, f64) {
    let (away, along) = exact_plane_products(ray, point, normal);
    let t = away / along;
    if t.is_finite() || along == 0.0 {
        return (t, along);
    }
    let along = ray.direction.dot(normal);
    ((point - ray.origin).dot(normal) / along, along)
}

/// The dot product, rounded to about a unit in the last place however much cancels.
///
/// T. Ogita, S. M. Rump, S. Oishi, "Accurate sum and dot product", SIAM Journal on Scientific Computing, 2005.
fn exact_dot(a: [Twofold; 3], n: [f64; 3]) -> f64 {
    let [x, y, z] = std::array::from_fn(|i| a[i].times(n[i]));
    let first = Twofold::sum(x.high, y.high);
    let sum = Twofold::sum(first.high, z.high);
    sum.high + ((x.low + y.low + z.low) + (first.low + sum.low))
}

/// An implicit function F at a point: its value and derivatives.
pub(crate) struct Implicit {
    pub(crate) value: f64,
    pub(crate) gradient: DVec3,
    /// The sum of the absolute values of F's terms, which bounds the rounding error of `value`.
    pub(crate) terms: f64,
}

impl Implicit {
    /// The step to the surface: one of Newton's method, whose remaining error is the square of a rounding
    /// error.
    pub(crate) fn to_surface(&self) -> DVec3 {
        let length = length(self.gradient);
        let step = -(self.value / length) * (self.gradient / length);
        if step.is_finite() { step } else { DVec3::ZERO }
    }

    /// A bound on the distance from the surface of a point where F evaluates to 0.
    pub(crate) fn uncertainty(&self) -> f64 {
        let distance = gamma(12) * self.terms / length(self.gradient);
        // At a singular point there is no useful bound.
        if distance.is_finite() { distance } else { 0.0 }
    }

    /// The derivative of the unit normal gradient/|gradient| along a tangent, given the Hessian's product with
    /// the tangent.
    pub(crate) fn turning(&self, hessian_times_tangent: DVec3) -> DVec3 {
        let length = length(self.gradient);
        let normal = self.gradient / length;
        let across = (hessian_times_tangent - normal * normal.dot(hessian_times_tangent)) / length;
        // Orthogonalised twice: where the derivative is small, the first result is mostly rounding error.
        let turned = across - normal * normal.dot(across);
        if turned.is_finite() { turned } else { DVec3::ZERO }
    }

    /// The unit normal; z where the gradient is zero.
    pub(crate) fn normal(&self) -> DVec3 {
        unit(self.gradient).unwrap_or(DVec3::Z)
    }
}
