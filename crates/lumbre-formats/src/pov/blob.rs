//! Blobs: balls and cylinders whose fields are added.

use lumbre_geometry::{Aabb, Ray, Root, Roots};
use lumbre_math::roots::quartic_roots_between;
use lumbre_math::{DVec3, Transform};

use super::part_tree::PartTree;

/// Where the sum of the fields of all parts is above a threshold.
#[derive(Clone, Debug)]
pub(super) struct Blob {
    threshold: f64,
    parts: Vec<Ball>,
    tree: PartTree,
    bounds: Aabb,
}

/// A field about a segment: s (1 − d² / r²)² at a distance d below r.
#[derive(Clone, Debug)]
pub(super) struct Ball {
    ends: [DVec3; 2],
    radius: f64,
    strength: f64,
    pub world_from_ball: Transform,
}

impl Ball {
    pub(super) fn new(ends: [DVec3; 2], radius: f64, strength: f64) -> Self {
        Self { ends, radius: radius.abs().max(1e-9), strength, world_from_ball: Transform::IDENTITY }
    }

    /// From the nearest point of the segment to a point, in the space of the part.
    fn away(&self, p: DVec3) -> DVec3 {
        let q = self.world_from_ball.inverse_point(p) - self.ends[0];
        let axis = self.ends[1] - self.ends[0];
        if axis == DVec3::ZERO {
            return q;
        }
        q - axis * (q.dot(axis) / axis.length_squared()).clamp(0.0, 1.0)
    }

    fn field(&self, p: DVec3) -> f64 {
        let rest = 1.0 - self.away(p).length_squared() / (self.radius * self.radius);
        if rest > 0.0 { self.strength * rest * rest } else { 0.0 }
    }

    fn gradient(&self, p: DVec3) -> DVec3 {
        let away = self.away(p);
        let squared = self.radius * self.radius;
        let rest = 1.0 - away.length_squared() / squared;
        if rest <= 0.0 {
            return DVec3::ZERO;
        }
        self.world_from_ball.normal(away * (-4.0 * self.strength * rest / squared))
    }

    /// The parts of a ray on which the field is a polynomial: from t to t, with the square of the distance by powers of
    /// t.
    fn spans(&self, ray: &Ray, out: &mut Vec<Span>) {
        let o = self.world_from_ball.inverse_point(ray.origin) - self.ends[0];
        let d = self.world_from_ball.inverse_vector(ray.direction);
        let axis = self.ends[1] - self.ends[0];
        let mut push = |o: DVec3, d: DVec3, low: f64, high: f64| {
            let square = [o.length_squared(), 2.0 * o.dot(d), d.length_squared()];
            // Where it is below r².
            let (half, a) = (0.5 * square[1], square[2]);
            let below = self.radius * self.radius - square[0];
            let (mut near, mut far) = (low, high);
            if a > 0.0 {
                let middle = -half / a;
                let reach = below / a + middle * middle;
                if reach <= 0.0 {
                    return;
                }
                (near, far) = (low.max(middle - reach.sqrt()), high.min(middle + reach.sqrt()));
            } else if below <= 0.0 {
                return;
            }
            if near < far {
                // s (1 − d² / r²)².
                let [c0, c1, c2] = square.map(|c| c / (self.radius * self.radius));
                let e = [1.0 - c0, -c1, -c2];
                let field = [
                    e[0] * e[0],
                    2.0 * e[0] * e[1],
                    e[1] * e[1] + 2.0 * e[0] * e[2],
                    2.0 * e[1] * e[2],
                    e[2] * e[2],
                ];
                out.push(Span { near, far, field: field.map(|c| c * self.strength) });
            }
        };
        let all = (f64::NEG_INFINITY, f64::INFINITY);
        if axis == DVec3::ZERO {
            push(o, d, all.0, all.1);
            return;
        }
        let scale = 1.0 / axis.length_squared();
        let (along, step) = (o.dot(axis) * scale, d.dot(axis) * scale);
        let (ox, dx) = (o - axis * along, d - axis * step);
        let (from, to) = (o, o - axis);
        if step == 0.0 {
            match along {
                a if a < 0.0 => push(from, d, all.0, all.1),
                a if a > 1.0 => push(to, d, all.0, all.1),
                _ => push(ox, dx, all.0, all.1),
            }
            return;
        }
        let (first, last) = (-along / step, (1.0 - along) / step);
        if step > 0.0 {
            push(from, d, all.0, first);
            push(ox, dx, first, last);
            push(to, d, last, all.1);
        } else {
            push(to, d, all.0, last);
            push(ox, dx, last, first);
            push(from, d, first, all.1);
        }
    }

    fn bounds(&self) -> Aabb {
        let reach = DVec3::splat(self.radius);
        let (low, high) = (self.ends[0].min(self.ends[1]) - reach, self.ends[0].max(self.ends[1]) + reach);
        let corner = |i: usize| {
            let pick = |axis: usize| if i >> axis & 1 == 1 { high[axis] } else { low[axis] };
            self.world_from_ball.point(DVec3::new(pick(0), pick(1), pick(2)))
        };
        Aabb::around((0..8).map(corner))
    }
}

/// A part of a ray, with the field of one part of the blob there.
#[derive(Clone, Copy, Debug)]
struct Span {
    near: f64,
    far: f64,
    field: [f64; 5],
}

impl Blob {
    pub(super) fn new(threshold: f64, parts: Vec<Ball>) -> Self {
        let all: Vec<Aabb> = parts.iter().map(Ball::bounds).collect();
        let bounds =
            all.iter().copied().reduce(Aabb::union).unwrap_or(Aabb { min: DVec3::ZERO, max: DVec3::ONE });
        Self { threshold, tree: PartTree::new(&all), parts, bounds }
    }

    pub(super) fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// The parts that may have a field at a point.
    fn around(&self, p: DVec3) -> impl Iterator<Item = &Ball> {
        self.tree.around(p).into_iter().map(|part| &self.parts[part as usize])
    }

    pub(super) fn contains(&self, p: DVec3) -> bool {
        self.around(p).map(|part| part.field(p)).sum::<f64>() >= self.threshold
    }

    pub(super) fn normal(&self, p: DVec3) -> DVec3 {
        -self.around(p).map(|part| part.gradient(p)).sum::<DVec3>()
    }

    pub(super) fn roots(&self, ray: &Ray, out: &mut Roots) {
        let met = self.tree.along(ray);
        if met.is_empty() {
            return;
        }
        // From the middle of the blob, where numbers are small.
        let middle = 0.5 * (self.bounds.min + self.bounds.max);
        let shift = (middle - ray.origin).dot(ray.direction) / ray.direction.length_squared();
        let moved = Ray::new(ray.at(shift), ray.direction);
        let mut spans = Vec::new();
        for part in met {
            self.parts[part as usize].spans(&moved, &mut spans);
        }
        let mut ends: Vec<f64> = spans.iter().flat_map(|span| [span.near, span.far]).collect();
        ends.sort_unstable_by(f64::total_cmp);
        ends.dedup();
        for pair in ends.windows(2) {
            let (low, high) = (pair[0], pair[1]);
            if high + shift < ray.t_min || low + shift > ray.t_max {
                continue;
            }
            let mut sum = [-self.threshold, 0.0, 0.0, 0.0, 0.0];
            for span in spans.iter().filter(|span| span.near <= low && high <= span.far) {
                sum.iter_mut().zip(span.field).for_each(|(sum, field)| *sum += field);
            }
            let roots = quartic_roots_between(&sum, low, high);
            // The end of a span belongs to the next one.
            let within = roots.iter().filter(|s| **s < high).map(|s| shift + s);
            out.extend(within.filter(|t| ray.contains(*t)).map(Root::at));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ray's crossings are where what contains its points begins and ends.
    #[test]
    fn crossings_are_the_ends_of_what_it_contains() {
        let mut bent = Ball::new([DVec3::new(-0.2, 0.3, 0.0), DVec3::new(0.8, -0.2, 0.1)], 0.3, 0.6);
        bent.world_from_ball = Transform::translate(DVec3::new(0.1, 0.2, -0.1));
        let center = |x, y, z| [DVec3::new(x, y, z); 2];
        let parts = vec![
            Ball::new(center(0.0, 0.0, 0.0), 0.7, 1.0),
            Ball::new(center(0.6, 0.3, 0.0), 0.6, 0.9),
            Ball::new(center(0.3, 0.2, -0.5), 0.4, -0.8),
            bent,
        ];
        let blob = Blob::new(0.5, parts);
        let mut hits = 0;
        for i in 0..400_u32 {
            let spread = |k: u32| f64::from((i * k) % 97) / 97.0 * 2.0 - 1.0;
            let origin = DVec3::new(2.0 * spread(31), 2.0 * spread(17), -5.0);
            let target = DVec3::new(0.3 + 0.6 * spread(53), 0.5 * spread(71), 0.5 * spread(11));
            let ray = Ray::new(origin, target - origin);
            let mut roots = Roots::new();
            blob.roots(&ray, &mut roots);
            assert_eq!(roots.len() % 2, 0, "it is entered as often as left");
            hits += roots.len();
            for (k, root) in roots.iter().enumerate() {
                let p = ray.at(root.t);
                let step = blob.normal(p).normalize() * 1e-6;
                assert!(
                    !blob.contains(p + step) && blob.contains(p - step),
                    "normals point outwards: {root:?}"
                );
                assert_eq!(step.dot(ray.direction) < 0.0, k % 2 == 0, "{root:?}");
            }
        }
        assert!(hits > 200, "{hits}");
    }
}
