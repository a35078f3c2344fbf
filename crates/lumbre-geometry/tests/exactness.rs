//! Crossings of surfaces of the second degree against exact arithmetic: none is lost, none invented, each within 8
//! units in the last place unless it grazes, from far away, on slender shapes, and along tangents, apexes, axes and
//! generators.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::ops::{Add, Mul, Sub};

use lumbre_geometry::{
    Cone, Cylinder, Hyperboloid, Paraboloid, Quadric, Ray, Root, Roots, Shape, ShapeError, Sphere,
};
use lumbre_math::quadratic::two_product;
use lumbre_math::random::RandomStream;
use lumbre_math::{DVec2, DVec3};

/// A number without any rounding: a sum of doubles that do not overlap, the least first.
///
/// J. R. Shewchuk, "Adaptive precision floating-point arithmetic and fast robust geometric predicates", Discrete &
/// Computational Geometry, 1997.
#[derive(Clone, Debug, Default)]
pub(crate) struct Exact(Vec<f64>);

impl Exact {
    fn grown(mut self, x: f64) -> Self {
        let mut carry = x;
        self.0.retain_mut(|part| {
            let sum = carry + *part;
            let virtual_part = sum - carry;
            let error = (carry - (sum - virtual_part)) + (*part - virtual_part);
            (carry, *part) = (sum, error);
            error != 0.0
        });
        if carry != 0.0 {
            self.0.push(carry);
        }
        self
    }

    /// The number rounded, to a unit in the last place.
    pub(crate) fn value(&self) -> f64 {
        self.0.iter().sum()
    }
}

impl From<f64> for Exact {
    fn from(x: f64) -> Self {
        Self::default().grown(x)
    }
}

impl Add for &Exact {
    type Output = Exact;

    fn add(self, other: Self) -> Exact {
        other.0.iter().fold(self.clone(), |sum, &x| sum.grown(x))
    }
}

impl Sub for &Exact {
    type Output = Exact;

    fn sub(self, other: Self) -> Exact {
        other.0.iter().fold(self.clone(), |sum, &x| sum.grown(-x))
    }
}

impl Mul for &Exact {
    type Output = Exact;

    fn mul(self, other: Self) -> Exact {
        let mut sum = Exact::default();
        for &x in &self.0 {
            for &y in &other.0 {
                let (product, error) = two_product(x, y);
                sum = sum.grown(error).grown(product);
            }
        }
        sum
    }
}

type Vector = [Exact; 3];

fn exact(v: DVec3) -> Vector {
    v.to_array().map(Exact::from)
}

fn minus(a: DVec3, b: DVec3) -> Vector {
    std::array::from_fn(|i| &Exact::from(a[i]) - &Exact::from(b[i]))
}

fn dot(a: &Vector, b: &Vector) -> Exact {
    &(&(&a[0] * &b[0]) + &(&a[1] * &b[1])) + &(&a[2] * &b[2])
}

fn cross(a: &Vector, b: &Vector) -> Vector {
    let part = |i: usize, j: usize| &(&a[i] * &b[j]) - &(&a[j] * &b[i]);
    [part(1, 2), part(2, 0), part(0, 1)]
}

/// a, h and c of F = a t² + 2 h t + c.
type Coefficients = [Exact; 3];

/// A shape and its equation.
pub(crate) struct Subject {
    pub(crate) name: &'static str,
    pub(crate) shape: Shape,
    equation: Box<dyn Fn(&Ray) -> Coefficients>,
    /// The planes that cut it: a point and a direction to the side that is kept.
    cuts: Vec<(DVec3, DVec3)>,
    /// A size of its finest part, to aim near it.
    pub(crate) size: f64,
}

impl Subject {
    /// The same equation, of another shape that has it.
    pub(crate) fn with_shape(self, shape: Shape) -> Self {
        Self { shape, ..self }
    }

    /// a, h and c of F = a t² + 2 h t + c along a ray, exactly.
    pub(crate) fn coefficients(&self, ray: &Ray) -> [Exact; 3] {
        (self.equation)(ray)
    }
}

fn round_to(x: f64) -> f64 {
    f64::from(x as f32)
}

/// |W × D|² |D|² - (r1 |D|² + (r2 - r1) W·D)² for the axis D from p1 to p2.
fn lateral(p1: DVec3, p2: DVec3, r1: f64, r2: f64) -> Box<dyn Fn(&Ray) -> Coefficients> {
    let spine = minus(p2, p1);
    Box::new(move |ray| {
        let (w, d) = (minus(ray.origin, p1), exact(ray.direction));
        let square = dot(&spine, &spine);
        let rise = &Exact::from(r2) - &Exact::from(r1);
        let (across, offset) = (cross(&d, &spine), cross(&w, &spine));
        let e = &(&Exact::from(r1) * &square) + &(&rise * &dot(&w, &spine));
        let g = &rise * &dot(&d, &spine);
        [
            &(&square * &dot(&across, &across)) - &(&g * &g),
            &(&square * &dot(&across, &offset)) - &(&e * &g),
            &(&square * &dot(&offset, &offset)) - &(&e * &e),
        ]
    })
}

pub(crate) fn axial(name: &'static str, p1: DVec3, p2: DVec3, r1: f64, r2: f64) -> Subject {
    let shape: Result<Shape, ShapeError> = if r1 == r2 {
        Cylinder::new(p1, p2, r1, false).map(Shape::from)
    } else {
        Cone::new(p1, p2, r1, r2, false).map(Shape::from)
    };
    Subject {
        name,
        shape: shape.unwrap(),
        equation: lateral(p1, p2, r1, r2),
        cuts: vec![(p1, p2 - p1), (p2, p1 - p2)],
        size: r1.max(r2),
    }
}

pub(crate) fn sphere(center: DVec3, radius: f64) -> Subject {
    Subject {
        name: "sphere",
        shape: Sphere::new(center, radius).unwrap().into(),
        equation: Box::new(move |ray| {
            let (w, d, r) = (minus(ray.origin, center), exact(ray.direction), Exact::from(radius));
            [dot(&d, &d), dot(&w, &d), &dot(&w, &w) - &(&r * &r)]
        }),
        cuts: vec![],
        size: radius,
    }
}

pub(crate) fn paraboloid(radius: f64, height: f64) -> Subject {
    Subject {
        name: "paraboloid",
        shape: Paraboloid::new(radius, 0.0, height, 360.0).unwrap().into(),
        equation: Box::new(move |ray| {
            let (o, d) = (exact(ray.origin), exact(ray.direction));
            let (rim, r) = (Exact::from(height), Exact::from(radius));
            let square = &r * &r;
            let half = &square * &Exact::from(0.5);
            let flat = |a: &Vector, b: &Vector| &rim * &(&(&a[0] * &b[0]) + &(&a[1] * &b[1]));
            [flat(&d, &d), &flat(&o, &d) - &(&half * &d[2]), &flat(&o, &o) - &(&square * &o[2])]
        }),
        cuts: vec![(DVec3::new(0.0, 0.0, height), DVec3::NEG_Z)],
        size: radius,
    }
}

pub(crate) fn hyperboloid(p1: DVec3, p2: DVec3) -> Subject {
    let along = minus(p2, p1);
    Subject {
        name: "hyperboloid",
        shape: Hyperboloid::new(p1, p2, 360.0).unwrap().into(),
        equation: Box::new(move |ray| {
            let (o, d) = (minus(ray.origin, DVec3::new(0.0, 0.0, p1.z)), exact(ray.direction));
            let rise = &along[2];
            let reach: Vec<Exact> =
                (0..2).map(|i| &(rise * &Exact::from(p1[i])) + &(&o[2] * &along[i])).collect();
            let growth: Vec<Exact> = (0..2).map(|i| &d[2] * &along[i]).collect();
            let flat = |a: &[Exact], b: &[Exact]| &(&a[0] * &b[0]) + &(&a[1] * &b[1]);
            let square = rise * rise;
            [
                &(&square * &flat(&d, &d)) - &flat(&growth, &growth),
                &(&square * &flat(&o, &d)) - &flat(&reach, &growth),
                &(&square * &flat(&o, &o)) - &flat(&reach, &reach),
            ]
        }),
        cuts: vec![
            (DVec3::new(0.0, 0.0, p1.z), (p2.z - p1.z) * DVec3::Z),
            (DVec3::new(0.0, 0.0, p2.z), (p1.z - p2.z) * DVec3::Z),
        ],
        size: p1.truncate().length().max(p2.truncate().length()),
    }
}

pub(crate) fn quadric(name: &'static str, coefficients: [f64; 10], size: f64) -> Subject {
    Subject {
        name,
        shape: Quadric::new(coefficients, None).unwrap().into(),
        equation: Box::new(move |ray| {
            let (o, d) = (exact(ray.origin), exact(ray.direction));
            let half = Exact::from(0.5);
            let k = coefficients.map(Exact::from);
            let squares = |p: &Vector, q: &Vector| {
                let mut sum = Exact::default();
                for (n, i, j) in [(0, 0, 0), (1, 1, 1), (2, 2, 2)] {
                    sum = &sum + &(&k[n] * &(&p[i] * &q[j]));
                }
                for (n, i, j) in [(3, 0, 1), (4, 0, 2), (5, 1, 2)] {
                    let mixed = &(&p[i] * &q[j]) + &(&p[j] * &q[i]);
                    sum = &sum + &(&(&k[n] * &half) * &mixed);
                }
                sum
            };
            let linear = dot(&[k[6].clone(), k[7].clone(), k[8].clone()], &d);
            let value = &(&squares(&o, &o) + &dot(&[k[6].clone(), k[7].clone(), k[8].clone()], &o)) + &k[9];
            [squares(&d, &d), &squares(&o, &d) + &(&half * &linear), value]
        }),
        cuts: vec![],
        size,
    }
}

pub(crate) struct Random(pub(crate) RandomStream);

impl Random {
    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + self.0.next_f64() * (high - low)
    }

    pub(crate) fn vector(&mut self) -> DVec3 {
        DVec3::new(self.between(-1.0, 1.0), self.between(-1.0, 1.0), self.between(-1.0, 1.0))
    }
}

/// What was compared.
#[derive(Debug, Default)]
struct Tally {
    crossings: usize,
    misses: usize,
    worst: f64,
}

/// The crossings of the whole line by the equation, `None` where they are on the border of being there.
fn expected(subject: &Subject, ray: &Ray) -> Option<Vec<f64>> {
    let [a, h, c] = (subject.equation)(ray);
    let delta = &(&h * &h) - &(&a * &c);
    let terms = h.value() * h.value() + (a.value() * c.value()).abs();
    if delta.value().abs() <= 1e-26 * terms {
        return None;
    }
    if delta.value() < 0.0 {
        return Some(vec![]);
    }
    let q = -(h.value() + delta.value().sqrt().copysign(h.value()));
    let mut roots = vec![c.value() / q, q / a.value()];
    roots.retain(|t| t.is_finite());
    roots.sort_by(f64::total_cmp);
    let mut kept = vec![];
    for t in roots {
        let mut is_kept = true;
        for &(point, inward) in &subject.cuts {
            let (w, d) = (minus(ray.origin, point), exact(ray.direction));
            let inward = exact(inward);
            let (start, along) = (dot(&w, &inward), dot(&d, &inward));
            let height = (&start + &(&along * &Exact::from(t))).value();
            let doubt = 8.0 * f64::EPSILON * (along.value() * t).abs();
            if height.abs() <= doubt {
                return None;
            }
            is_kept &= height > 0.0;
        }
        if is_kept {
            kept.push(t);
        }
    }
    Some(kept)
}

fn compare(subject: &Subject, ray: &Ray, tally: &mut Tally) {
    let Some(expected) = expected(subject, ray) else {
        return;
    };
    let ray = ray.with_range(f64::NEG_INFINITY, f64::INFINITY);
    let mut found = Roots::new();
    subject.shape.roots(&ray, &mut found);
    let name = subject.name;
    let crossings: usize = found.iter().map(|root| usize::from(root.multiplicity)).sum();
    assert_eq!(crossings, expected.len(), "{name}: {found:?} {expected:?} {ray:?} {:?}", subject.shape);
    tally.misses += usize::from(expected.is_empty());
    let found = found.iter().flat_map(|root| (0..root.multiplicity).map(move |_| root));
    for (root, &t) in found.zip(&expected) {
        tally.crossings += 1;
        check(subject, &ray, root, t, tally);
    }
}

fn check(subject: &Subject, ray: &Ray, root: &Root, t: f64, tally: &mut Tally) {
    let name = subject.name;
    let surface = subject.shape.surface(ray, root);
    assert!((surface.normal.length() - 1.0).abs() < 1e-12, "{name}: {surface:?} {ray:?}");
    let steepness = surface.normal.dot(ray.direction).abs() / ray.direction.length();
    if steepness < 1e-3 {
        return;
    }
    let last_place = t.abs().next_up() - t.abs();
    let off = (root.t - t).abs() / last_place;
    tally.worst = tally.worst.max(off * (8.0 * steepness).min(1.0));
    // A ray that grazes the surface loses digits in proportion; and the expected ones are computed to two units.
    let allowed = 8.0 / (8.0 * steepness).min(1.0) + 2.0;
    assert!(off <= allowed, "{name}: {} instead of {t}, {off} ulp, {ray:?} {:?}", root.t, subject.shape);
}

fn repeats() -> usize {
    if std::env::var_os("LUMBRE_LONG_TESTS").is_some() { 100 } else { 1 }
}

/// Shoots `count` rays at places about the shape from distances of ten to the power `from` to `to`.
fn shoot(subject: &Subject, random: &mut Random, count: usize, [from, to]: [f64; 2], tally: &mut Tally) {
    for i in 0..count {
        let place = {
            let uv = DVec2::new(random.between(0.0, 1.0), random.between(0.0, 1.0));
            let at = subject.shape.surface_at(0, uv).map_or(DVec3::ZERO, |s| s.point);
            // Every third ray nearly touches.
            let spread = if i % 3 == 0 { 10f64.powf(random.between(-12.0, 0.0)) } else { 1.0 };
            at + spread * subject.size * random.vector()
        };
        let distance = 10f64.powf(random.between(from, to));
        let direction = random.vector().map(round_to);
        let origin = place - (distance / direction.length()) * direction;
        compare(subject, &Ray::new(origin, direction), tally);
    }
}

/// Random sizes of few digits, so that exact arithmetic stays short.
pub(crate) fn subjects(random: &mut Random, slenderness: f64) -> Vec<Subject> {
    let mut v = |scale: f64| (scale * random.vector()).map(round_to);
    let (p, q) = (v(2.0), v(2.0));
    let thin = round_to(0.7 / slenderness);
    let (a, b) = (v(1.0), v(1.0));
    let flat = DVec3::new(thin, thin, 1.0);
    let below = DVec3::new(0.0, 0.0, -1.5);
    let wide = round_to(1.3);
    let general = {
        let with_constant = |constant| [a.x, a.y, a.z, b.x, b.y, b.z, p.x, p.y, p.z, constant];
        // No real point satisfies one of the two where the other is an ellipsoid that holds the origin.
        let has_points = Quadric::new(with_constant(q.x), None).is_ok();
        with_constant(if has_points { q.x } else { -q.x })
    };
    vec![
        sphere(p, thin),
        axial("cylinder", p, q, thin, thin),
        axial("frustum", p, q, thin, round_to(0.4 * thin)),
        axial("cone", p, q, thin, 0.0),
        axial("blunt cone", p, q, 0.0, wide),
        paraboloid(thin, wide),
        paraboloid(wide, thin),
        hyperboloid(flat * a + below, flat * b - below),
        quadric("pipe", [1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -thin * thin], thin),
        quadric("general quadric", general, 1.0),
    ]
}

fn every_shape_from(distances: [f64; 2], slenderness: [f64; 2], rays: usize, seed: u64) {
    let mut random = Random(RandomStream::new(seed));
    let mut tallies: Vec<(&str, Tally)> = vec![];
    for _ in 0..6 * repeats() {
        let slenderness = 10f64.powf(random.between(slenderness[0], slenderness[1]));
        for (i, subject) in subjects(&mut random, slenderness).iter().enumerate() {
            if tallies.len() <= i {
                tallies.push((subject.name, Tally::default()));
            }
            shoot(subject, &mut random, rays, distances, &mut tallies[i].1);
        }
    }
    println!("{tallies:#?}");
    assert!(tallies.iter().all(|(_, tally)| tally.crossings > rays / 2), "{tallies:?}");
}

#[test]
fn no_crossing_is_lost_invented_or_off_from_nearby() {
    every_shape_from([0.0, 2.0], [0.0, 1.0], 60, 1);
}

#[test]
fn no_crossing_is_lost_invented_or_off_from_far_away() {
    every_shape_from([3.0, 12.0], [0.0, 1.0], 60, 2);
}

#[test]
fn no_crossing_of_a_slender_shape_is_lost_invented_or_off() {
    every_shape_from([0.0, 3.0], [3.0, 9.0], 60, 3);
}

#[test]
fn cones_are_exact_along_generators_and_at_the_apex() {
    let mut random = Random(RandomStream::new(4));
    let mut tally = Tally::default();
    for i in 0..400 * repeats() {
        let mut v = |scale: f64| (scale * random.vector()).map(round_to);
        let (base, apex) = (v(2.0), v(2.0));
        let radius = round_to(0.3 + v(1.0).x.abs());
        let subject = axial("cone", base, apex, radius, 0.0);
        let other = axial("cone", apex, base, 0.0, radius);
        let generator = {
            let rim = subject.shape.surface_at(0, DVec2::new(random.between(0.0, 1.0), 0.0)).unwrap();
            apex - rim.point
        };
        let aside = match i % 3 {
            0 => DVec3::ZERO,
            1 => 10f64.powf(random.between(-17.0, -3.0)) * random.vector(),
            _ => random.vector(),
        };
        let direction = generator + aside;
        let origin = apex - random.between(-4.0, 9.0) * direction;
        for ray in [Ray::new(origin, direction), Ray::new(origin, -direction)] {
            compare(&subject, &ray, &mut tally);
            compare(&other, &ray, &mut tally);
            // Whatever is known of it: nothing is beyond the apex.
            for caps in [false, true] {
                let cone = Shape::from(Cone::new(base, apex, radius, 0.0, caps).unwrap());
                let mut found = Roots::new();
                cone.roots(&ray.with_range(f64::NEG_INFINITY, f64::INFINITY), &mut found);
                for root in &found {
                    let w = minus(ray.origin, apex);
                    let spine = minus(apex, base);
                    let above =
                        &dot(&w, &spine) + &(&Exact::from(root.t) * &dot(&exact(ray.direction), &spine));
                    let size = (apex - base).length() * (ray.origin.length() + (root.t * direction).length());
                    assert!(above.value() <= 1e-15 * size, "{found:?} {ray:?} {cone:?}");
                }
            }
        }
    }
    println!("{tally:?}");
    // Most end so near the apex that rounding decides on which side.
    assert!(tally.crossings > 25 * repeats(), "{tally:?}");
}

#[test]
fn a_ray_along_a_generator_ends_at_the_apex() {
    let cone = Shape::from(Cone::new(DVec3::ZERO, DVec3::Z, 1.0, 0.0, true).unwrap());
    let v = DVec3::new;
    let one = Ray::new(
        v(2.853220496112134, 0.92689416902127, -2.0),
        v(-0.9510734987040446, -0.30896472300709, 1.0),
    );
    let other = Ray::new(
        v(-1.1835945223964466, -9.929708153140913, -9.0),
        v(0.11835945223964466, 0.9929708153140914, 1.0),
    );
    for (ray, apex) in [(one, 3.0), (other, 10.0)] {
        let mut found = Roots::new();
        cone.roots(&ray, &mut found);
        assert!(found.iter().all(|root| root.t <= apex), "{found:?}");
        assert_eq!(cone.closest(&ray.with_range(apex + 0.2, f64::INFINITY)), None);
    }
}

#[test]
fn quadrics_are_exact_along_asymptotes_and_axes() {
    let mut random = Random(RandomStream::new(5));
    let mut tallies: Vec<(&str, Tally)> = vec![];
    for _ in 0..20 * repeats() {
        for (i, subject) in subjects(&mut random, 2.0).into_iter().enumerate() {
            if tallies.len() <= i {
                tallies.push((subject.name, Tally::default()));
            }
            for k in 0..12 {
                // Directions in which the equation is nearly linear: the quadratic term's zeros, by bisection.
                let (e, f) = (random.vector(), random.vector());
                let square = |s: f64| (subject.equation)(&Ray::new(DVec3::ZERO, e + s * (f - e)))[0].value();
                let (mut low, mut high) = (0.0, 1.0);
                let direction = if (square(low) > 0.0) == (square(high) > 0.0) {
                    // None between: along z, the axis of some.
                    DVec3::Z + if k % 2 == 0 { DVec3::ZERO } else { 1e-9 * e }
                } else {
                    for _ in 0..[20, 40, 60][k % 3] {
                        let middle = 0.5 * (low + high);
                        if (square(middle) > 0.0) == (square(low) > 0.0) {
                            low = middle
                        } else {
                            high = middle
                        }
                    }
                    e + low * (f - e)
                };
                let near = subject.shape.surface_at(0, DVec2::splat(0.4)).map_or(DVec3::ZERO, |s| s.point);
                let origin =
                    near + 0.3 * subject.size * random.vector() - random.between(1.0, 9.0) * direction;
                compare(&subject, &Ray::new(origin, direction), &mut tallies[i].1);
            }
        }
    }
    println!("{tallies:#?}");
    assert!(tallies.iter().all(|(_, tally)| tally.crossings > 20), "{tallies:?}");
}

#[test]
fn a_pipe_is_hit_as_exactly_a_billion_radii_along_it() {
    let pipe = Shape::from(Quadric::new([1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0], None).unwrap());
    for z in [1e3, 1e6, 1e9, 1e12] {
        let mut found = Roots::new();
        pipe.roots(&Ray::new(DVec3::new(3.0, 0.0, z), DVec3::new(-1.0, 0.0, 1.0)), &mut found);
        assert_eq!(found.iter().map(|root| root.t).collect::<Vec<_>>(), [2.0, 4.0], "{z}");
    }
}

#[test]
fn a_slender_hyperboloid_is_the_cylinder_that_it_is() {
    let (low, high) = (DVec3::new(0.001, 0.0, 0.0), DVec3::new(0.001, 0.0, 1000.0));
    let needle = hyperboloid(low, high);
    let tube = Shape::from(Cylinder::along_z(0.001, 0.0, 1000.0, false).unwrap());
    let rays = [
        (DVec3::new(300.0, 0.0, 10.0), DVec3::new(-1.0, 0.0, 0.5)),
        (DVec3::new(3.0, 0.0005, 900.0), DVec3::new(-1.0, 0.0, 0.01)),
        (DVec3::new(300.0, 0.0009, 100.0), DVec3::new(-3.0, 0.000001, 2.0)),
    ];
    let mut tally = Tally::default();
    for (origin, direction) in rays {
        let ray = Ray::new(origin, direction);
        compare(&needle, &ray, &mut tally);
        let (one, other) = (needle.shape.closest(&ray), tube.closest(&ray));
        let (one, other) = (one.unwrap().t, other.unwrap().t);
        assert!((one / other - 1.0).abs() < 1e-15, "{one} {other} {ray:?}");
    }
    assert!(tally.crossings == 6, "{tally:?}");
}
