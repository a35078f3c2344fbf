//! Spheres that are swept along a curve.

use lumbre_geometry::{Aabb, Ray, Root, Roots};
use lumbre_math::{DVec2, DVec3, DVec4};

/// A segment of a curve that is no line is approximated by this many round cones; the error is below the square of its
/// inverse.
const PIECES: u32 = 512;
/// As near as it begins, few steps are exact.
const NEWTON_STEPS: u32 = 3;
/// Round cones that share one box.
const GROUP: usize = 16;

/// Center and radius as a cubic in u from 0 to 1, by powers.
type Cubic = [DVec4; 4];

fn at(c: &Cubic, u: f64) -> DVec4 {
    ((c[3] * u + c[2]) * u + c[1]) * u + c[0]
}

/// The convex hull of two spheres, a part of a segment.
#[derive(Clone, Copy, Debug)]
struct RoundCone {
    ends: [DVec3; 2],
    radii: [f64; 2],
    segment: u32,
    /// Where it begins and ends on its segment.
    range: [f64; 2],
}

/// What is inside of any sphere of a sweep: round cones that share their spheres, so that there is no gap between them.
#[derive(Clone, Debug)]
pub(super) struct Sweep {
    segments: Vec<Cubic>,
    cones: Vec<RoundCone>,
    /// The boxes of groups of round cones.
    groups: Vec<Aabb>,
}

impl Sweep {
    /// A sweep through spheres, along lines.
    pub(super) fn linear(spheres: &[DVec4]) -> Self {
        let segment = |pair: &[DVec4]| [pair[0], pair[1] - pair[0], DVec4::ZERO, DVec4::ZERO];
        Self::new(spheres.windows(2).map(segment).collect(), 1)
    }

    /// A sweep by a uniform cubic B-spline.
    pub(super) fn b_spline(spheres: &[DVec4]) -> Self {
        let segment = |p: &[DVec4]| {
            let [a, b, c, d] = [p[0], p[1], p[2], p[3]];
            [a + 4.0 * b + c, 3.0 * (c - a), 3.0 * (a - 2.0 * b + c), d - a + 3.0 * (b - c)].map(|k| k / 6.0)
        };
        Self::new(spheres.windows(4).map(segment).collect(), PIECES)
    }

    /// A sweep by Catmull and Rom's spline; the first and the last sphere give slopes only.
    pub(super) fn cubic(spheres: &[DVec4]) -> Self {
        let segment = |p: &[DVec4]| {
            let [a, b, c, d] = [p[0], p[1], p[2], p[3]];
            [b, 0.5 * (c - a), a - 2.5 * b + 2.0 * c - 0.5 * d, 0.5 * (d - a) + 1.5 * (b - c)]
        };
        Self::new(spheres.windows(4).map(segment).collect(), PIECES)
    }

    /// The bytes that a segment takes.
    pub(super) const SEGMENT_BYTES: u64 = PIECES as u64 * size_of::<RoundCone>() as u64;

    fn new(segments: Vec<Cubic>, pieces: u32) -> Self {
        let mut cones = Vec::with_capacity(segments.len() * pieces as usize);
        for (segment, cubic) in segments.iter().enumerate() {
            for i in 0..pieces {
                let range = [i, i + 1].map(|i| f64::from(i) / f64::from(pieces));
                let [a, b] = range.map(|u| at(cubic, u));
                let radii = [a.w.max(0.0), b.w.max(0.0)];
                let ends = [a.truncate(), b.truncate()];
                cones.push(RoundCone { ends, radii, segment: segment as u32, range });
            }
        }
        let groups = cones
            .chunks(GROUP)
            .map(|group| {
                group
                    .iter()
                    .map(RoundCone::bounds)
                    .fold(Aabb::EMPTY, |a, b| Aabb { min: a.min.min(b.min), max: a.max.max(b.max) })
            })
            .collect();
        Self { segments, cones, groups }
    }

    pub(super) fn bounds(&self) -> Aabb {
        self.groups.iter().fold(Aabb::EMPTY, |a, b| Aabb { min: a.min.min(b.min), max: a.max.max(b.max) })
    }

    pub(super) fn contains(&self, p: DVec3) -> bool {
        let near = self.groups.iter().zip(self.cones.chunks(GROUP));
        near.filter(|(bounds, _)| bounds.min.cmple(p).all() && p.cmple(bounds.max).all())
            .any(|(_, cones)| cones.iter().any(|cone| cone.contains(p)))
    }

    /// Where a ray enters and leaves the union of all.
    pub(super) fn roots(&self, ray: &Ray, out: &mut Roots) {
        let mut spans: Vec<[(f64, usize); 2]> = Vec::new();
        for (g, cones) in self.cones.chunks(GROUP).enumerate() {
            if !meets(&self.groups[g], ray) {
                continue;
            }
            for (i, cone) in cones.iter().enumerate() {
                if let Some([near, far]) = cone.span(ray) {
                    let index = g * GROUP + i;
                    spans.push([(near, index), (far, index)]);
                }
            }
        }
        spans.sort_by(|a, b| a[0].0.total_cmp(&b[0].0));
        let mut rest = spans.into_iter();
        let Some(mut span) = rest.next() else { return };
        let mut push = |[near, far]: [(f64, usize); 2]| {
            for (t, cone) in [near, far] {
                if ray.contains(t) {
                    let along = self.cones[cone].along(ray.at(t));
                    out.push(Root { part: cone as u32, local: DVec2::new(along, 0.0), ..Root::at(t) });
                }
            }
        };
        for next in rest {
            if next[0].0 <= span[1].0 {
                if next[1].0 > span[1].0 {
                    span[1] = next[1];
                }
            } else {
                push(span);
                span = next;
            }
        }
        push(span);
    }

    /// The normal, of any length: away from the center of the sphere that the point is on.
    pub(super) fn normal(&self, p: DVec3, root: &Root) -> DVec3 {
        let Some(cone) = self.cones.get(root.part as usize) else { return DVec3::Y };
        let cubic = &self.segments[cone.segment as usize];
        let mut u = cone.range[0] + root.local.x * (cone.range[1] - cone.range[0]);
        // The spheres that touch their envelope at p have no slope of |p − C|² − r²; the round cone gives where that is
        // nearly so.
        for _ in 0..NEWTON_STEPS {
            let sphere = at(cubic, u);
            let first = (3.0 * cubic[3] * u + 2.0 * cubic[2]) * u + cubic[1];
            let second = 6.0 * cubic[3] * u + 2.0 * cubic[2];
            let away = p - sphere.truncate();
            let slope = away.dot(first.truncate()) + sphere.w * first.w;
            let change = away.dot(second.truncate()) - first.truncate().length_squared()
                + first.w * first.w
                + sphere.w * second.w;
            let next = (u - slope / change).clamp(cone.range[0], cone.range[1]);
            if !next.is_finite() {
                break;
            }
            u = next;
        }
        p - at(cubic, u).truncate()
    }
}

fn meets(bounds: &Aabb, ray: &Ray) -> bool {
    let (a, b) = ((bounds.min - ray.origin) / ray.direction, (bounds.max - ray.origin) / ray.direction);
    // 0 / 0, on a side of the box, counts as inside.
    let (near, far) = (a.min(b), a.max(b));
    let near = [near.x, near.y, near.z].into_iter().filter(|t| !t.is_nan()).fold(f64::NEG_INFINITY, f64::max);
    let far = [far.x, far.y, far.z].into_iter().filter(|t| !t.is_nan()).fold(f64::INFINITY, f64::min);
    near <= far && far >= ray.t_min && near <= ray.t_max
}

impl RoundCone {
    fn bounds(&self) -> Aabb {
        let [a, b] = self.ends;
        let [r, s] = self.radii.map(DVec3::splat);
        let margin = DVec3::splat(1e-9 * (a.abs() + b.abs() + r + s).max_element());
        Aabb { min: (a - r).min(b - s) - margin, max: (a + r).max(b + s) + margin }
    }

    /// The unit axis, the length, and sine and cosine of the slope of its side; nothing where one sphere is inside of
    /// the other.
    fn side(&self) -> Option<(DVec3, f64, f64, f64)> {
        let axis = self.ends[1] - self.ends[0];
        let length = axis.length();
        let sine = (self.radii[0] - self.radii[1]) / length;
        (length > 0.0 && sine.abs() < 1.0).then(|| (axis / length, length, sine, (1.0 - sine * sine).sqrt()))
    }

    fn contains(&self, p: DVec3) -> bool {
        let in_sphere = |i: usize| (p - self.ends[i]).length() <= self.radii[i];
        if in_sphere(0) || in_sphere(1) {
            return true;
        }
        let Some((axis, length, sine, cosine)) = self.side() else { return false };
        let q = p - self.ends[0];
        let along = q.dot(axis);
        let across = (q - axis * along).length();
        self.radii[0] * sine <= along
            && along <= length + self.radii[1] * sine
            && cosine * across + sine * along <= self.radii[0]
    }

    /// How far along its axis the center of the sphere is that a point of the surface is on, from 0 to 1.
    fn along(&self, p: DVec3) -> f64 {
        let Some((axis, length, sine, cosine)) = self.side() else {
            return if self.radii[0] >= self.radii[1] { 0.0 } else { 1.0 };
        };
        let along = (p - self.ends[0]).dot(axis);
        ((along - self.radii[0] * sine) / (cosine * cosine * length)).clamp(0.0, 1.0)
    }

    /// Where a ray enters and leaves it. It is convex: both are the extremes of the crossings with its parts.
    fn span(&self, ray: &Ray) -> Option<[f64; 2]> {
        let (mut near, mut far) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut meet = |t: f64| {
            if t.is_finite() {
                (near, far) = (near.min(t), far.max(t));
            }
        };
        let dd = ray.direction.length_squared();
        for (center, radius) in self.ends.iter().zip(self.radii) {
            let o = ray.origin - *center;
            let half = o.dot(ray.direction);
            // From the nearest point of the ray, where digits are not lost.
            let away = o - ray.direction * (half / dd);
            let rest = radius * radius - away.length_squared();
            if rest >= 0.0 && radius > 0.0 {
                let (middle, reach) = (-half / dd, (rest / dd).sqrt());
                meet(middle - reach);
                meet(middle + reach);
            }
        }
        if let Some((axis, length, sine, cosine)) = self.side() {
            // cos² |across|² = (r − sin · along)², with t from the nearest point to the middle.
            let middle = 0.5 * (self.ends[0] + self.ends[1]);
            let shift = (middle - ray.origin).dot(ray.direction) / dd;
            let o = ray.at(shift) - self.ends[0];
            let (oa, da) = (o.dot(axis), ray.direction.dot(axis));
            let (ox, dx) = (o - axis * oa, ray.direction - axis * da);
            let (ro, rd) = (self.radii[0] - sine * oa, -sine * da);
            let cc = cosine * cosine;
            let a = cc * dx.length_squared() - rd * rd;
            let half = cc * ox.dot(dx) - ro * rd;
            let c = cc * ox.length_squared() - ro * ro;
            let mut try_at = |t: f64| {
                let along = oa + t * da;
                let is_on = self.radii[0] * sine <= along && along <= length + self.radii[1] * sine;
                // Not on the other half of the double cone.
                if is_on && ro + t * rd >= 0.0 {
                    meet(shift + t);
                }
            };
            let discriminant = half * half - a * c;
            if discriminant >= 0.0 {
                let q = -(half + half.signum() * discriminant.sqrt());
                try_at(q / a);
                try_at(c / q);
            }
        }
        (near <= far).then_some([near, far])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ray's crossings are where what contains its points begins and ends.
    #[test]
    fn crossings_are_the_ends_of_what_it_contains() {
        let sphere = |x, y, z, r| DVec4::new(x, y, z, r);
        let spheres = [
            sphere(-2.5, 0.3, 0.2, 0.3),
            sphere(-1.0, -0.4, 0.1, 0.7),
            sphere(0.3, 0.9, -0.6, 0.25),
            sphere(1.2, 0.1, 0.4, 0.5),
            sphere(2.6, 0.7, 0.3, 0.2),
        ];
        let sweeps = [Sweep::linear(&spheres), Sweep::b_spline(&spheres), Sweep::cubic(&spheres)];
        let mut hits = 0;
        for sweep in &sweeps {
            for i in 0..200_u32 {
                let spread = |k: u32| f64::from((i * k) % 97) / 97.0 * 2.0 - 1.0;
                let origin = DVec3::new(3.0 * spread(31), 4.0 * spread(17), -5.0);
                let target = DVec3::new(2.0 * spread(53), spread(71), spread(11));
                let ray = Ray::new(origin, target - origin);
                let mut roots = Roots::new();
                sweep.roots(&ray, &mut roots);
                assert_eq!(roots.len() % 2, 0, "it is entered as often as left");
                hits += roots.len();
                for (k, root) in roots.iter().enumerate() {
                    let step = 1e-6;
                    assert_eq!(sweep.contains(ray.at(root.t + step)), k % 2 == 0, "{root:?}");
                    assert_eq!(sweep.contains(ray.at(root.t - step)), k % 2 == 1, "{root:?}");
                    let facing = sweep.normal(ray.at(root.t), root).dot(ray.direction);
                    assert_eq!(facing < 0.0, k % 2 == 0, "normals point outwards: {root:?}");
                }
            }
        }
        assert!(hits > 200, "{hits}");
    }
}
