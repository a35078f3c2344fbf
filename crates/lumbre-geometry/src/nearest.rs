//! Nearest points: the common part of the shapes' methods.

use std::f64::consts::TAU;

use lumbre_math::{DMat3, DVec2, DVec3, Elementary, Transform, direction_at};

use crate::support::azimuth;

/// The point of a surface that is nearest to a given point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearestPoint {
    /// The point, in world space.
    pub point: DVec3,
    /// The distance to the given point, never negative.
    pub distance: f64,
    /// The part of the shape that it lies on: see [`crate::Root::part`].
    pub part: u32,
    /// Surface parameters, as in [`crate::Surface::uv`]; the weights (b1, b2) of a triangle.
    pub uv: DVec2,
}

/// Why there is no nearest point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum NearestPointError {
    /// The given point is not finite.
    NotFinite,
    /// The shape is curved, its map is not a similarity (to within 1e-13), and there is no method for its
    /// image.
    Map,
    /// A quadric that is not closed.
    OpenQuadric,
    /// User geometry that does not implement nearest points.
    NotOffered,
    /// CSG whose nearest leaf point is not on the result, or not beyond doubt; or that has user-defined solids.
    Csg,
}

impl std::fmt::Display for NearestPointError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::NotFinite => "the point is not finite",
            Self::Map => "the shape is curved, and stands under a map that does not keep angles",
            Self::OpenQuadric => "the shape is a quadric that is not closed",
            Self::NotOffered => "the geometry offers no nearest points",
            Self::Csg => "the nearest surface that the solid is composed of is not on it where it is nearest",
        })
    }
}

impl std::error::Error for NearestPointError {}

pub(crate) type Nearest = Result<NearestPoint, NearestPointError>;

impl NearestPoint {
    /// The nearer of the two; the first when they are equally near.
    pub(crate) fn or_nearer(self, other: Self) -> Self {
        if other.distance < self.distance { other } else { self }
    }
}

/// Applies a method for object space under a similarity.
pub(crate) fn under_similarity(
    world_from_object: &Transform,
    p: DVec3,
    nearest: impl FnOnce(DVec3) -> NearestPoint,
) -> Nearest {
    if world_from_object.is_identity() {
        return Ok(nearest(p));
    }
    let factor = similarity_factor(world_from_object).ok_or(NearestPointError::Map)?;
    let found = nearest(world_from_object.inverse_point(p));
    let point = world_from_object.point(found.point);
    Ok(NearestPoint { point, distance: factor * found.distance, ..found })
}

/// The factor by which a similarity scales lengths, allowing for the rounding of a product of a few maps;
/// `None` for other maps.
pub fn similarity_factor(world_from_object: &Transform) -> Option<f64> {
    let l = world_from_object.linear();
    let (x, y, z) = (l.x_axis.length_squared(), l.y_axis.length_squared(), l.z_axis.length_squared());
    let largest_of = |a: f64, b: f64, c: f64| a.abs().max(b.abs()).max(c.abs());
    let skew = largest_of(l.x_axis.dot(l.y_axis), l.y_axis.dot(l.z_axis), l.z_axis.dot(l.x_axis));
    let is_similar = largest_of(x - y, y - z, z - x).max(skew) <= 1e-13 * x;
    is_similar.then(|| ((x + y + z) / 3.0).sqrt())
}

/// The weights (b1, b2) of the point of a triangle nearest to the origin, and that point.
///
/// After C. Ericson, "Real-Time Collision Detection", 2004, section 5.1.5. Unlike there, the foot of the
/// perpendicular and the nearest points of all three sides are candidates, so the result is accurate for
/// slivers, too.
#[inline]
pub fn nearest_on_triangle(a: DVec3, b: DVec3, c: DVec3) -> (DVec2, DVec3) {
    let (ab, ac, bc) = (b - a, c - a, c - b);
    let on_side = |start: DVec3, side: DVec3| {
        let size = side.length_squared();
        let t = if size > 0.0 { (-start.dot(side) / size).clamp(0.0, 1.0) } else { 0.0 };
        // From the nearer end, so that the end itself is exact.
        let point = if t <= 0.5 { start + t * side } else { (start + side) - (1.0 - t) * side };
        (t, point, point.length_squared())
    };
    let (t, point, distance) = on_side(a, ab);
    let mut best = (DVec2::new(t, 0.0), point, distance);
    let mut take = |uv: DVec2, point: DVec3, distance: f64| {
        if distance < best.2 {
            best = (uv, point, distance);
        }
    };
    let (t, point, distance) = on_side(a, ac);
    take(DVec2::new(0.0, t), point, distance);
    let (t, point, distance) = on_side(b, bc);
    take(DVec2::new(1.0 - t, t), point, distance);

    let (e, f, g) = (ab.length_squared(), ab.dot(ac), ac.length_squared());
    let (d1, d2) = (-ab.dot(a), -ac.dot(a));
    let determinant = e * g - f * f;
    let (v, w) = (g * d1 - f * d2, e * d2 - f * d1);
    if v >= 0.0 && w >= 0.0 && v + w <= determinant && determinant > 0.0 {
        let (v, w) = (v / determinant, w / determinant);
        let point = a + v * ab + w * ac;
        take(DVec2::new(v, w), point, point.length_squared());
    }
    (best.0, best.1)
}

/// The nearest point of any triangle.
pub(crate) fn on_triangle(p: DVec3, [a, b, c]: [DVec3; 3], part: u32) -> NearestPoint {
    let (uv, offset) = nearest_on_triangle(a - p, b - p, c - p);
    NearestPoint { point: p + offset, distance: offset.length(), part, uv }
}

/// The half-plane about an axis in which a surface of revolution is nearest to a point, and the point's
/// coordinates in it.
///
/// At any distance r ≥ 0 from the axis, the squared distance decreases with the cosine of the angle between the
/// azimuths. So for any profile the nearest azimuth is the point's own or, outside the sweep, the nearer end of
/// the sweep.
pub(crate) struct Meridian {
    /// The unit direction of the half-plane, perpendicular to the axis.
    pub(crate) outward: DVec2,
    /// The azimuth, from 0 to the end of the sweep.
    pub(crate) phi: f64,
    /// The point's coordinate along `outward`; may be negative.
    pub(crate) x: f64,
    /// The point's coordinate along the axis.
    pub(crate) z: f64,
    /// The point's distance from the half-plane.
    pub(crate) aside: f64,
}

impl Meridian {
    /// For a point in the frame of the axis.
    pub(crate) fn new(p: DVec3, phi_max: f64) -> Self {
        let rho = p.x.hypotenuse(p.y);
        let phi = azimuth(p.y, p.x);
        if phi_max >= TAU || phi <= phi_max || rho == 0.0 {
            let is_axis = rho == 0.0;
            let outward = if is_axis { DVec2::X } else { DVec2::new(p.x, p.y) / rho };
            return Self { outward, phi: if is_axis { 0.0 } else { phi }, x: rho, z: p.z, aside: 0.0 };
        }
        let phi = if phi - phi_max <= TAU - phi { phi_max } else { 0.0 };
        let outward = direction_at(phi);
        let flat = DVec2::new(p.x, p.y);
        Self { outward, phi, x: flat.dot(outward), z: p.z, aside: flat.perp_dot(outward) }
    }

    /// The distance of the point from (r, z) in the half-plane.
    pub(crate) fn distance(&self, r: f64, z: f64) -> f64 {
        DVec3::new(r - self.x, z - self.z, self.aside).length()
    }
}

/// The point of the sphere of `radius` about the origin whose image under an invertible linear map is nearest
/// to `d`.
///
/// The map's singular values are the semi-axes of the image, by one-sided Jacobi rotations (M. R. Hestenes,
/// "Inversion of matrices by biorthogonalization and related results", 1958). The nearest point of an ellipsoid
/// is the one root of a monotone function (D. Eberly, "Distance from a point to an ellipse, an ellipsoid, or a
/// hyperellipsoid", 2013).
pub(crate) fn nearest_on_ellipsoid(map: DMat3, radius: f64, d: DVec3) -> DVec3 {
    let mut image = [map.x_axis * radius, map.y_axis * radius, map.z_axis * radius];
    let mut turn = [DVec3::X, DVec3::Y, DVec3::Z];
    for _ in 0..30 {
        let mut is_done = true;
        for (i, j) in [(0, 1), (0, 2), (1, 2)] {
            let (a, b) = (image[i], image[j]);
            let (aa, bb, ab) = (a.length_squared(), b.length_squared(), a.dot(b));
            if ab.abs() <= f64::EPSILON * (aa * bb).sqrt() {
                continue;
            }
            is_done = false;
            let zeta = (bb - aa) / (2.0 * ab);
            let tangent = zeta.signum() / (zeta.abs() + zeta.hypotenuse(1.0));
            let cos = 1.0 / tangent.hypotenuse(1.0);
            let sin = cos * tangent;
            (image[i], image[j]) = (cos * a - sin * b, sin * a + cos * b);
            (turn[i], turn[j]) = (cos * turn[i] - sin * turn[j], sin * turn[i] + cos * turn[j]);
        }
        if is_done {
            break;
        }
    }
    let mut order = [0, 1, 2];
    order.sort_by(|&i, &j| image[j].length_squared().total_cmp(&image[i].length_squared()));
    let axes = order.map(|i| image[i].length());
    let place = order.map(|i| d.dot(image[i]) / image[i].length());
    let found = on_centred_ellipsoid(axes, place.map(f64::abs));
    // Back to the sphere, and projected onto it.
    let on_sphere =
        (0..3).fold(DVec3::ZERO, |sum, i| sum + (found[i] / axes[i]).copysign(place[i]) * turn[order[i]]);
    on_sphere * (radius / on_sphere.length())
}

/// The point nearest to `y` (no negative coordinate) of the ellipsoid with these semi-axes, the largest first.
fn on_centred_ellipsoid(axes: [f64; 3], y: [f64; 3]) -> [f64; 3] {
    let mut found = [0.0; 3];
    for last in (0..3).rev() {
        let smallest = axes[last];
        if y[last] > 0.0 {
            // The point is e_i² y_i / (e_i² + s) for one s > -e²; q = (e² + s)/e² stays accurate near 0.
            let ratio = |i: usize| (axes[i] / smallest) * (axes[i] / smallest);
            let more = |i: usize| ((axes[i] - smallest) / smallest) * ((axes[i] + smallest) / smallest);
            let z = |i: usize| y[i] / axes[i];
            let excess =
                |q: f64| (0..=last).map(|i| (ratio(i) * z(i) / (q + more(i))).powi(2)).sum::<f64>() - 1.0;
            let mut low = z(last);
            let mut high = (0..=last).map(|i| (ratio(i) * z(i)).powi(2)).sum::<f64>().sqrt().max(low);
            for _ in 0..2000 {
                let middle = 0.5 * (low + high);
                if middle <= low || middle >= high {
                    break;
                }
                if excess(middle) > 0.0 { low = middle } else { high = middle }
            }
            for i in 0..=last {
                found[i] = ratio(i) * y[i] / (high + more(i));
            }
            return found;
        }
        // In a plane of symmetry: the nearest points are a symmetric pair, or one in the plane.
        let share = |i: usize| axes[i] * y[i] / ((axes[i] - smallest) * (axes[i] + smallest));
        let is_deep = (0..last).all(|i| axes[i] * y[i] < (axes[i] - smallest) * (axes[i] + smallest));
        let rest = 1.0 - (0..last).map(|i| share(i) * share(i)).sum::<f64>();
        if is_deep && rest > 0.0 || last == 0 {
            for i in 0..last {
                found[i] = axes[i] * share(i);
            }
            found[last] = smallest * rest.sqrt();
            return found;
        }
    }
    found
}
