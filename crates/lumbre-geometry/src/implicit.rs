//! General implicit surfaces, `F(x, y, z) = 0`.

use std::fmt;
use std::sync::Arc;

use lumbre_math::DVec3;
use lumbre_math::interval::{Dual, Interval};
use lumbre_math::rounding::gamma;

use crate::{Aabb, Ray, Root, Roots, ShapeError, Surface};

/// A function of a point, written with numbers that carry bounds and a derivative.
type Function = dyn Fn([Dual; 3]) -> Dual + Send + Sync;

/// The part of a surface `F(x, y, z) = 0` that lies in a box; outside is where `F` is positive.
///
/// `F` is written once, as a function of [`Dual`]s, which give bounds of its value and of its slope along a ray. So a
/// ray's crossings are isolated with certainty: a piece of the ray is dropped only where the bounds of `F` exclude
/// zero, and taken as one crossing where those of the slope do and the ends differ in sign; other pieces are halved. No
/// crossing is lost, however close to another, down to a few neighbouring numbers of `t`. Where the surface is only
/// touched, `F` has one sign on both sides, and there is no crossing. Source: D. Mitchell, "Robust Ray Intersection
/// with Interval Arithmetic", Graphics Interface, 1990.
///
/// ```
/// use lumbre_geometry::{Aabb, ImplicitSurface, Ray};
/// use lumbre_math::DVec3;
///
/// // A rounded cube about (3, 0, 0).
/// let bounds = Aabb { min: DVec3::new(1.5, -1.5, -1.5), max: DVec3::new(4.5, 1.5, 1.5) };
/// let cube = ImplicitSurface::new(bounds, |[x, y, z]| (x - 3.0).powi(4) + y.powi(4) + z.powi(4) - 1.0)?;
/// let ray = Ray::new(DVec3::new(-4.0, 0.0, 0.0), DVec3::X);
/// let roots = cube.roots(&ray);
/// assert_eq!(roots.len(), 2);
/// assert!((roots[0].t - 6.0).abs() < 1e-14 && (roots[1].t - 8.0).abs() < 1e-14);
/// # Ok::<(), lumbre_geometry::ShapeError>(())
/// ```
#[derive(Clone)]
pub struct ImplicitSurface {
    bounds: Aabb,
    function: Arc<Function>,
}

/// Evaluations after which what is left of a ray is decided by the signs at its ends alone: more are needed only along
/// a ray that lies in the surface, or nearly.
const MAX_EVALUATIONS: u32 = 1 << 14;

impl ImplicitSurface {
    /// The surface of a function within a box.
    ///
    /// # Errors
    /// [`ShapeError`] for a box that is empty or not finite.
    pub fn new(
        bounds: Aabb,
        function: impl Fn([Dual; 3]) -> Dual + Send + Sync + 'static,
    ) -> Result<Self, ShapeError> {
        if bounds.is_empty() || !bounds.min.is_finite() || !bounds.max.is_finite() {
            return Err(ShapeError::Degenerate(
                "the bounds of an implicit surface must be finite and not empty",
            ));
        }
        Ok(Self { bounds, function: Arc::new(function) })
    }

    /// The box that the surface is cut off by.
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// Bounds of `F` at a point: its value, but for rounding.
    pub fn value(&self, p: DVec3) -> Interval {
        (self.function)(p.to_array().map(Dual::from)).value
    }

    /// Whether a point of the box is on the inside, where `F` is negative.
    pub fn contains(&self, p: DVec3) -> bool {
        self.bounds.contains(p) && self.value(p).middle() < 0.0
    }

    /// The first crossing in the ray's range.
    pub fn closest(&self, ray: &Ray) -> Option<Root> {
        let mut first = None;
        self.each_root(ray, |root| {
            first = Some(root);
            false
        });
        first
    }

    /// Every crossing in the ray's range, in ascending order.
    pub fn roots(&self, ray: &Ray) -> Roots {
        let mut roots = Roots::new();
        self.each_root(ray, |root| {
            roots.push(root);
            true
        });
        roots
    }

    /// The surface where a root was found along a ray. Its parameters are zero, and so are the derivatives of its
    /// normal.
    pub fn surface(&self, ray: &Ray, root: &Root) -> Surface {
        let point = ray.at(root.t);
        let normal = self.gradient(point).try_normalize().unwrap_or_else(|| {
            // At a singular point every direction is as good.
            (-ray.direction).normalize_or(DVec3::Z)
        });
        // That of the point's two roundings, and of `t`, which is right to some of its last bits.
        let point_error = gamma(16) * (ray.origin.abs() + (root.t * ray.direction).abs());
        Surface { point_error, ..Surface::new(point, normal) }
    }

    /// The gradient of `F`.
    pub fn gradient(&self, p: DVec3) -> DVec3 {
        let slope = |axis: usize| {
            let mut place = p.to_array().map(Dual::from);
            place[axis] = Dual::variable(Interval::point(p[axis]));
            (self.function)(place).slope.middle()
        };
        DVec3::new(slope(0), slope(1), slope(2))
    }

    /// `F` and its slope along a ray, over a piece of it.
    fn along(&self, ray: &Ray, t: Interval) -> Dual {
        let t = Dual::variable(t);
        let coordinate = |axis: usize| match ray.direction[axis] {
            // A product with zero would lose the whole axis where the piece is long.
            0.0 => Dual::from(ray.origin[axis]),
            d => ray.origin[axis] + t * d,
        };
        (self.function)([coordinate(0), coordinate(1), coordinate(2)])
    }

    /// Calls `visit` with each crossing in ascending order, until it answers false.
    fn each_root(&self, ray: &Ray, mut visit: impl FnMut(Root) -> bool) {
        let Some([from, to]) = self.bounds.slabs(ray) else { return };
        // The sign at a place, the same for the pieces before and behind it, so that no crossing is counted twice.
        let is_inside = |t: f64| self.along(ray, Interval::point(t)).value.middle() < 0.0;
        let mut evaluations = 0;
        // The pieces still to look at, the nearest last; each with the sides on which it begins and ends.
        let mut pieces = vec![(from, to, is_inside(from), is_inside(to))];
        while let Some((from, to, begins_inside, ends_inside)) = pieces.pop() {
            let piece = self.along(ray, Interval { low: from, high: to });
            evaluations += 1;
            let middle = 0.5 * from + 0.5 * to;
            let can_be_halved = from < middle && middle < to && evaluations < MAX_EVALUATIONS;
            if !piece.value.contains(0.0) && begins_inside == ends_inside {
                continue;
            }
            let is_monotone = piece.slope.low > 0.0 || piece.slope.high < 0.0;
            if is_monotone || !can_be_halved {
                if begins_inside != ends_inside && !visit(Root::at(self.refine(ray, from, to, begins_inside)))
                {
                    return;
                }
                continue;
            }
            let is_middle_inside = is_inside(middle);
            pieces.push((middle, to, is_middle_inside, ends_inside));
            pieces.push((from, middle, begins_inside, is_middle_inside));
        }
    }

    /// Where a piece with one crossing changes its side: to the last bit that the rounding of `F` allows.
    fn refine(&self, ray: &Ray, mut from: f64, mut to: f64, begins_inside: bool) -> f64 {
        loop {
            let middle = 0.5 * from + 0.5 * to;
            if middle <= from || middle >= to {
                // Of two neighbours, the one where F is nearer to zero.
                let size = |t: f64| self.along(ray, Interval::point(t)).value.middle().abs();
                return if size(from) <= size(to) { from } else { to };
            }
            // Newton's step from the middle converges faster where it stays in the piece.
            let here = self.along(ray, Interval::point(middle));
            let value = here.value.middle();
            if (value < 0.0) == begins_inside {
                from = middle
            } else {
                to = middle
            }
            let step = middle - value / here.slope.middle();
            let margin = 2.0 * f64::EPSILON * step.abs();
            for t in [step - margin, step + margin] {
                if from < t && t < to {
                    let is_inside = self.along(ray, Interval::point(t)).value.middle() < 0.0;
                    if is_inside == begins_inside { from = t } else { to = t }
                }
            }
        }
    }
}

impl fmt::Debug for ImplicitSurface {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ImplicitSurface").field("bounds", &self.bounds).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use lumbre_math::random::RandomStream;

    use super::*;
    use crate::{Shape, Sphere, Torus};

    const CENTER: DVec3 = DVec3::new(3.0, -2.0, 0.5);

    fn around(center: DVec3, reach: f64) -> Aabb {
        Aabb { min: center - reach, max: center + reach }
    }

    fn random_ray(random: &mut RandomStream, reach: f64) -> Ray {
        let mut vector = || DVec3::from_array(std::array::from_fn(|_| 2.0 * random.next_f64() - 1.0));
        let origin = CENTER + 2.0 * reach * vector();
        let target = CENTER + reach * vector();
        Ray::new(origin, (target - origin) * (0.1 + 3.0 * vector().x.abs()))
    }

    #[test]
    fn implicit_spheres_and_tori_match_closed_forms() {
        let sphere = ImplicitSurface::new(around(CENTER, 1.5), |[x, y, z]| {
            (x - CENTER.x).square() + (y - CENTER.y).square() + (z - CENTER.z).square() - 1.25 * 1.25
        });
        let torus = ImplicitSurface::new(around(CENTER, 3.0), |[x, y, z]| {
            let (x, y, z) = (x - CENTER.x, y - CENTER.y, z - CENTER.z);
            ((x.square() + y.square()).sqrt() - 2.0).square() + z.square() - 0.75 * 0.75
        });
        let exact: [Shape; 2] = [
            Sphere::new(CENTER, 1.25).unwrap().into(),
            Torus::new(CENTER, DVec3::Z, 2.0, 0.75).unwrap().into(),
        ];
        let mut random = RandomStream::new(41);
        let mut crossings = 0;
        for (surface, shape) in [sphere.unwrap(), torus.unwrap()].iter().zip(&exact) {
            for _ in 0..3000 {
                let ray = random_ray(&mut random, 3.0);
                let mut expected = Roots::new();
                shape.roots(&ray, &mut expected);
                let near_tangent = expected.windows(2).any(|pair| pair[1].t - pair[0].t < 1e-6 * pair[1].t)
                    || expected.iter().any(|root| root.multiplicity > 1);
                let found = surface.roots(&ray);
                if near_tangent {
                    continue;
                }
                assert_eq!(found.len(), expected.len(), "{ray:?}");
                assert_eq!(surface.closest(&ray), found.first().copied());
                for (found, expected) in found.iter().zip(&expected) {
                    let there = shape.surface(&ray, expected);
                    let slant = there.normal.dot(ray.direction).abs() / ray.direction.length();
                    let error = (found.t - expected.t).abs() * slant;
                    assert!(error < 1e-13 * (1.0 + expected.t), "{found:?} for {expected:?} along {ray:?}");
                    let here = surface.surface(&ray, found);
                    assert!(here.normal.dot(there.normal) > 1.0 - 1e-9, "{here:?}, {there:?}");
                    crossings += 1;
                }
            }
        }
        assert!(crossings > 3500, "{crossings}");
    }

    #[test]
    fn two_sheets_that_nearly_touch_are_both_found() {
        // F = (z - 1)² - w², two planes 2 w apart.
        for w in [0.25, 1e-6, 1e-9, 1e-13] {
            let sheets =
                ImplicitSurface::new(around(DVec3::Z, 4.0), move |[_, _, z]| (z - 1.0 - w) * (z - 1.0 + w));
            let ray = Ray::new(DVec3::new(0.3, 0.2, -2.0), DVec3::Z);
            let roots = sheets.unwrap().roots(&ray);
            assert_eq!(roots.len(), 2, "{w}: {roots:?}");
            assert!((roots[1].t - roots[0].t - 2.0 * w).abs() < 2e-15, "{w}: {roots:?}");
        }
    }

    #[test]
    fn what_is_only_touched_or_lies_along_the_ray_is_not_crossed() {
        let ball = ImplicitSurface::new(around(DVec3::ZERO, 3.0), |[x, y, z]| {
            x.square() + y.square() + z.square() - 4.0
        })
        .unwrap();
        assert!(ball.closest(&Ray::new(DVec3::new(-5.0, 2.0, 0.0), DVec3::X)).is_none());
        let plane = ImplicitSurface::new(around(DVec3::ZERO, 3.0), |[_, _, z]| z).unwrap();
        assert!(plane.closest(&Ray::new(DVec3::new(-5.0, 2.0, 0.0), DVec3::X)).is_none());
        assert!(ball.contains(DVec3::new(1.0, 1.0, 1.0)) && !ball.contains(DVec3::splat(1.2)));
    }

    #[test]
    fn a_wave_is_crossed_as_often_as_it_is_counted_by_its_signs() {
        let wave = ImplicitSurface::new(around(DVec3::ZERO, 8.0), |[x, y, z]| {
            (3.0 * x).sin() + (2.0 * y).cos() * z.sin() + 0.25 * z
        })
        .unwrap();
        let plain = |p: DVec3| (3.0 * p.x).sin() + (2.0 * p.y).cos() * p.z.sin() + 0.25 * p.z;
        let mut random = RandomStream::new(43);
        let mut crossings = 0;
        for _ in 0..200 {
            let ray = random_ray(&mut random, 4.0);
            let Some([from, to]) = wave.bounds().slabs(&ray) else { continue };
            let steps = 20_000;
            let side = |i: usize| plain(ray.at(from + (to - from) * i as f64 / steps as f64)) < 0.0;
            let changes = (0..steps).filter(|&i| side(i) != side(i + 1)).count();
            let found = wave.roots(&ray).len();
            // Steps miss pairs of crossings, and nothing else.
            assert!(found >= changes && (found - changes).is_multiple_of(2), "{found}, {changes}: {ray:?}");
            crossings += found;
        }
        assert!(crossings > 500, "{crossings}");
    }
}
