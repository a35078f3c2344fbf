//! What every shape promises. To put a shape under contract, add a line to `subjects`.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::f64::consts::{PI, TAU};

use lumbre_geometry::{
    Aabb, BilinearPatch, Capsule, Cone, Csg, Cuboid, Cylinder, Disk, Hyperboloid, Paraboloid, PlacedShape,
    Plane, Quadric, Ray, Root, Roots, Shape, ShapeError, Sphere, Surface, Torus, Triangle,
};
use lumbre_math::random::{RandomStream, hash_words};
use lumbre_math::{DVec2, DVec3, Transform};

/// A shape under test, somewhere.
pub(crate) struct Subject {
    pub(crate) name: String,
    pub(crate) placed: PlacedShape,
    /// A box that rays are aimed at: the shape's own, or for an infinite shape some part of it.
    aim: Aabb,
}

impl Subject {
    fn is_bounded(&self) -> bool {
        self.placed.bounds().is_some()
    }

    /// Whether its area is known and points on it can be chosen: not so for infinite shapes and for CSG.
    fn has_area(&self) -> bool {
        self.is_bounded() && !matches!(self.placed.shape(), Shape::Csg(_))
    }

    /// Whether its box touches it: not so for quadrics that a box clips, which have that box.
    fn has_tight_box(&self) -> bool {
        !matches!(self.placed.shape(), Shape::Quadric(quadric) if !quadric.is_solid())
    }

    fn center(&self) -> DVec3 {
        self.aim.center()
    }

    /// A radius that holds the box.
    pub(crate) fn reach(&self) -> f64 {
        0.5 * self.aim.size().length()
    }

    /// A stream of random numbers of its own for each law.
    pub(crate) fn random(&self, law: u64) -> Random {
        let name = self.name.bytes().fold(law, |key, byte| hash_words(&[key, u64::from(byte)]));
        Random(RandomStream::new(name))
    }
}

struct Subjects(Vec<Subject>);

impl Subjects {
    /// Puts a shape under contract in every placement.
    fn add<S: Into<Shape>>(&mut self, name: &str, shape: Result<S, ShapeError>) {
        let shape = shape.unwrap_or_else(|error| panic!("{name}: {error}")).into();
        for (place, map) in placements() {
            let placed = PlacedShape::new(shape.clone(), map);
            let aim = placed.bounds().unwrap_or_else(|| {
                let near = DVec3::splat(3.0);
                let center = DVec3::new(0.4, -0.3, 0.9);
                Aabb::around((0..8).map(|corner| {
                    let sign = |bit: u32| if corner >> bit & 1 == 1 { 1.0 } else { -1.0 };
                    map.point(center + near * DVec3::new(sign(0), sign(1), sign(2)))
                }))
            });
            self.0.push(Subject { name: format!("{name}, {place}"), placed, aim });
        }
    }
}

/// Where the shapes stand: never where they were made.
fn placements() -> Vec<(&'static str, Transform)> {
    let turn = Transform::rotate(DVec3::new(2.0, -1.0, 0.7), 130.0).unwrap();
    let scale = |x, y, z| Transform::scale(DVec3::new(x, y, z)).unwrap();
    let moved = |x, y, z| Transform::translate(DVec3::new(x, y, z));
    let shear = Transform::shear(0.5, 0.0, 0.2, -0.25, 0.0, 0.3).unwrap();
    vec![
        ("as made", Transform::IDENTITY),
        ("turned and moved", moved(3.0, -40.0, 7.0) * turn),
        ("stretched", moved(-2.0, 5.0, 1.0) * turn * scale(3.0, 0.7, 1.6)),
        ("mirrored", moved(11.0, 2.0, -6.0) * scale(2.5, -2.5, 2.5) * turn),
        ("sheared and mirrored", moved(0.3, -0.6, 2.0) * shear * turn * scale(-1.7, 0.8, 1.2)),
        ("huge", moved(2e6, -5e6, 3e6) * turn * scale(1e6, 1e6, 1e6)),
        ("tiny", turn * scale(1e-6, 1e-6, 1e-6) * moved(0.7, 0.2, -1.3)),
        ("far away", moved(8e5, -9e5, 4e5) * turn * scale(1.9, 1.9, 1.9)),
    ]
}

pub(crate) fn subjects() -> Vec<Subject> {
    let v = DVec3::new;
    let (p, q, r, s) = (v(0.4, -0.3, 1.2), v(-1.3, 2.1, 0.6), v(2.2, 0.9, -0.8), v(1.1, 1.7, 2.3));
    let ball = || Sphere::new(p, 2.5);
    let can = |caps| Cylinder::new(p, q, 0.7, caps);
    let lampshade = |caps| Cone::new(p, q, 1.4, 0.6, caps);
    let mut all = Subjects(Vec::new());
    all.add("sphere", ball());
    all.add("slice of a sphere", ball().and_then(|b| b.partial(-1.1, 1.9, 360.0)));
    all.add("wedge of a sphere", ball().and_then(|b| b.partial(-9.0, 2.1, 130.0)));
    all.add("plane", Plane::new(p, v(1.0, -2.0, 0.5)));
    all.add("disk", Disk::new(p, v(0.3, 2.0, -1.0), 1.7, 0.0));
    all.add("annulus", Disk::new(q, v(-0.3, 0.2, -1.0), 1.7, 0.6));
    all.add("sector", Disk::new(q, v(0.0, 0.0, 3.0), 1.7, 0.6).and_then(|d| d.partial(215.0)));
    all.add("box", Cuboid::new(p, q));
    all.add("open cylinder", can(false));
    all.add("capped cylinder", can(true));
    all.add("wedge of a cylinder", can(true).and_then(|c| c.partial(250.0)));
    all.add("cylinder along z", Cylinder::along_z(1.3, 2.2, -0.7, false).and_then(|c| c.partial(100.0)));
    all.add("endless cylinder", Cylinder::along_z(0.8, f64::NEG_INFINITY, f64::INFINITY, false));
    all.add("half-endless cylinder", Cylinder::along_z(1.2, f64::NEG_INFINITY, 1.1, true));
    all.add("capsule", Capsule::new(p, q, 0.8));
    all.add("open frustum", lampshade(false));
    all.add("capped frustum", lampshade(true));
    all.add("wedge of a frustum", lampshade(true).and_then(|c| c.partial(200.0)));
    all.add("finite cone", Cone::new(p, q, 0.0, 1.2, true));
    all.add("open pointed cone", Cone::nappe(p, v(1.0, 2.0, -0.4), 33.0, 2.7, false));
    all.add("blunt cone", Cone::nappe(q, v(1.0, 2.0, -0.4), 71.0, 0.9, true));
    all.add("endless cone", Cone::nappe(p, v(-0.2, 0.5, -0.4), 40.0, f64::INFINITY, false));
    all.add("triangle", Triangle::new(p, q, r));
    all.add(
        "rectangle",
        BilinearPatch::new(p, p + v(2.0, 1.0, 0.0), p + v(-0.6, 1.2, 0.9), p + v(1.4, 2.2, 0.9)),
    );
    all.add("bilinear patch", BilinearPatch::new(p, q, r, s));
    all.add(
        "flat quadrilateral",
        BilinearPatch::new(v(0.2, 0.1, 0.7), v(2.0, 0.4, 0.7), v(0.5, 1.3, 0.7), v(1.6, 1.9, 0.7)),
    );
    all.add("ring torus", Torus::new(p, v(0.5, -1.0, 2.0), 1.6, 0.45));
    all.add("horn torus", Torus::new(q, DVec3::Z, 1.2, 1.2));
    all.add("spindle torus", Torus::new(q, v(-1.0, 0.2, -0.3), 0.9, 1.4));
    all.add("paraboloid", Paraboloid::new(1.3, 0.0, 2.2, 360.0));
    all.add("belt of a paraboloid", Paraboloid::new(1.8, 0.4, 1.1, 230.0));
    all.add("hyperboloid", Hyperboloid::new(v(1.2, 0.3, -0.7), v(0.2, 1.1, 1.6), 360.0));
    all.add("wedge of a hyperboloid", Hyperboloid::new(v(0.3, 1.1, 1.4), v(-1.2, 0.6, -0.4), 140.0));
    all.add("cone by a segment", Hyperboloid::new(v(-0.4, 0.8, 0.2), v(0.2, -0.4, 1.7), 360.0));
    let ellipsoid = [1.0, 2.5, 0.75, 0.6, -0.4, 0.3, -1.0, 0.5, 2.0, -1.5];
    all.add("ellipsoid", Quadric::new(ellipsoid.map(|x| -3.0 * x), None));
    let clip = Aabb { min: v(-1.1, -0.8, -1.3), max: v(1.2, 0.9, 0.7) };
    all.add("open ellipsoid", Quadric::new(ellipsoid, Some(clip)));
    let saddle = [1.0, -1.4, 0.1, 0.3, 0.0, 0.2, 0.1, 0.0, -1.0, 0.15];
    all.add("saddle in a box", Quadric::new(saddle, Some(clip)));
    all.add("endless hyperboloid", Quadric::new([1.0, 1.3, -0.8, 0.2, 0.0, 0.0, 0.4, 0.0, 0.0, -1.1], None));
    all.add("csg", bored_box());
    all.0
}

/// A box with rounded corners, through which a torus and a cylinder are bored.
fn bored_box() -> Result<Csg, ShapeError> {
    let v = DVec3::new;
    let solid = |shape: Result<Shape, ShapeError>| Csg::leaf(PlacedShape::new(shape?, Transform::IDENTITY));
    let body = Csg::intersection(vec![
        solid(Cuboid::new(v(-1.1, -0.9, 0.2), v(1.3, 1.2, 1.9)).map(Shape::from))?,
        solid(Sphere::new(v(0.2, 0.1, 1.0), 1.45).map(Shape::from))?,
    ])?;
    Csg::difference(vec![
        body,
        solid(Cylinder::new(v(0.1, 0.2, -3.0), v(0.4, -0.1, 4.0), 0.35, true).map(Shape::from))?,
        solid(Torus::new(v(0.1, 0.0, 1.9), v(0.1, 0.0, 1.0), 0.8, 0.25).map(Shape::from))?,
    ])
}

pub(crate) struct Random(RandomStream);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0.next_f64()
    }

    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + self.unit() * (high - low)
    }

    fn uv(&mut self) -> DVec2 {
        DVec2::new(self.unit(), self.unit())
    }

    pub(crate) fn direction(&mut self) -> DVec3 {
        let z = self.between(-1.0, 1.0);
        let (sin, cos) = self.between(0.0, TAU).sin_cos();
        let rho = (1.0 - z * z).sqrt();
        DVec3::new(rho * cos, rho * sin, z)
    }

    /// A line of the invariant measure through a ball, starting outside it; its direction is unit.
    fn line(&mut self, center: DVec3, radius: f64) -> Ray {
        let d = self.direction();
        let (e1, e2) = d.any_orthonormal_pair();
        let rho = radius * self.unit().sqrt();
        let (sin, cos) = self.between(0.0, TAU).sin_cos();
        Ray::new(center + rho * (cos * e1 + sin * e2) - 1.5 * radius * d, d)
    }

    /// A ray through the subject's surroundings from within or without, of any length of direction.
    pub(crate) fn ray(&mut self, subject: &Subject) -> Ray {
        let line = self.line(subject.center(), subject.reach());
        let start = self.between(0.0, 2.0) * subject.reach();
        let length = 10f64.powf(self.between(-3.0, 3.0));
        Ray::new(line.at(start), line.direction * length)
    }
}

fn roots(placed: &PlacedShape, ray: &Ray) -> Roots {
    let mut found = Roots::new();
    placed.roots(ray, &mut found);
    found
}

fn whole_line(ray: &Ray) -> Ray {
    ray.with_range(f64::NEG_INFINITY, f64::INFINITY)
}

/// |cos| of the angle between a ray and a normal.
fn slope(surface: &Surface, direction: DVec3) -> f64 {
    surface.normal.dot(direction).abs() / direction.length()
}

/// What rounding may do to a place near a subject, relative to the largest number that enters.
fn grain(subject: &Subject, ray: &Ray) -> f64 {
    let map = subject.placed.world_from_object();
    let spread = map.linear().abs_sum() * map.inverse_affine().matrix3.abs_sum();
    let largest = ray.origin.length() + subject.center().length() + subject.reach();
    f64::EPSILON * largest * spread.max(1.0)
}

trait AbsSum {
    fn abs_sum(&self) -> f64;
}

impl AbsSum for lumbre_math::DMat3 {
    fn abs_sum(&self) -> f64 {
        self.to_cols_array().iter().map(|x| x.abs()).sum()
    }
}

/// Runs a law over every subject; it returns how often it had something to hold for, which must be often enough.
fn hold(law: u64, at_least: usize, check: impl Fn(&Subject, &mut Random) -> Option<usize>) {
    for subject in subjects() {
        if let Some(times) = check(&subject, &mut subject.random(law)) {
            assert!(times >= at_least, "{}: only {times} times", subject.name);
        }
    }
}

#[test]
fn closest_is_the_first_root_in_order_and_range() {
    hold(1, 66, |subject, random| {
        let mut hits = 0;
        for _ in 0..4000 {
            let ray = random.ray(subject);
            let t_of = |distance: f64| distance * subject.reach() / ray.direction.length();
            let ray = ray.with_range(t_of(random.between(-1.0, 0.5)), t_of(random.between(0.5, 4.0)));
            let found = roots(&subject.placed, &ray);
            hits += found.len();
            let name = &subject.name;
            assert_eq!(subject.placed.closest(&ray), found.first().copied(), "{name}: {ray:?}");
            assert_eq!(subject.placed.any(&ray), !found.is_empty(), "{name}: {ray:?}");
            assert!(found.iter().all(|r| ray.contains(r.t) && r.t.is_finite()), "{name}: {ray:?} {found:?}");
            assert!(found.is_sorted_by(|a, b| a.t <= b.t), "{name}: {ray:?} {found:?}");
            assert!(found.iter().all(|r| r.multiplicity >= 1), "{name}: {found:?}");
            // Every crossing of the range is one of the whole line, and the other way round.
            let on_line = roots(&subject.placed, &whole_line(&ray));
            let in_range: Vec<Root> = on_line.into_iter().filter(|r| ray.contains(r.t)).collect();
            assert_eq!(found.as_slice(), in_range, "{name}: {ray:?}");
            // Starting the search beyond the first crossing finds the next one.
            if let [first, second, ..] = found[..] {
                let beyond = ray.with_range(0.5 * first.t + 0.5 * second.t, ray.t_max);
                assert_eq!(subject.placed.closest(&beyond), Some(second), "{name}: {beyond:?}");
            }
        }
        Some(hits)
    });
}

#[test]
fn t_is_in_direction_units_and_rays_can_be_reversed() {
    hold(2, 66, |subject, random| {
        let mut hits = 0;
        for _ in 0..3000 {
            let ray = whole_line(&random.ray(subject));
            let found = roots(&subject.placed, &ray);
            let doubled = roots(&subject.placed, &Ray { direction: 8.0 * ray.direction, ..ray });
            let ts = |roots: &Roots, factor: f64| roots.iter().map(|r| factor * r.t).collect::<Vec<_>>();
            assert_eq!(ts(&found, 1.0), ts(&doubled, 8.0), "{}: {ray:?}", subject.name);

            let all_steep =
                found.iter().all(|r| slope(&subject.placed.surface(&ray, r), ray.direction) > 1e-2);
            if !all_steep {
                continue;
            }
            let far = 3.0 * subject.reach() / ray.direction.length();
            let back = Ray { origin: ray.at(far), direction: -ray.direction, ..ray };
            let reversed = roots(&subject.placed, &back);
            assert_eq!(found.len(), reversed.len(), "{}: {ray:?} {found:?} {reversed:?}", subject.name);
            for (a, b) in found.iter().zip(reversed.iter().rev()) {
                hits += 1;
                let (there, here) = (subject.placed.surface(&ray, a), subject.placed.surface(&back, b));
                let off = (there.point - here.point).length();
                assert!(off <= 1e4 * grain(subject, &ray), "{}: {off} {ray:?}", subject.name);
                assert_eq!(a.part, b.part, "{}: {ray:?}", subject.name);
            }
        }
        Some(hits)
    });
}

#[test]
fn every_hit_lies_on_the_ray_and_in_the_box_which_is_tight() {
    hold(3, 1000, |subject, random| {
        let bounds = subject.placed.bounds();
        let mut reached = Aabb::EMPTY;
        let mut hits = 0;
        for _ in 0..20_000 {
            let ray = random.line(subject.center(), subject.reach());
            for root in roots(&subject.placed, &whole_line(&ray)) {
                hits += 1;
                let surface = subject.placed.surface(&ray, &root);
                let off = (surface.point - ray.at(root.t)).length();
                let allowed = 1e3 * grain(subject, &ray) / slope(&surface, ray.direction).max(1e-6);
                assert!(off <= allowed, "{}: {off} off {ray:?} {surface:?}", subject.name);
                let inside = bounds.is_none_or(|b| b.contains(surface.point));
                assert!(inside, "{}: {} outside {bounds:?}", subject.name, surface.point);
                reached = reached.union(Aabb { min: surface.point, max: surface.point });
            }
        }
        if let (Some(bounds), Some(_)) = (bounds, subject.placed.sample_area(DVec2::splat(0.5))) {
            for _ in 0..20_000 {
                if let Some(sample) = subject.placed.sample_area(random.uv()) {
                    let p = sample.surface.point;
                    assert!(bounds.contains(p), "{}: sample {p} outside {bounds:?}", subject.name);
                    reached = reached.union(Aabb { min: p, max: p });
                }
            }
            let slack = (reached.min - bounds.min).max(bounds.max - reached.max).max_element();
            let loose = slack > 0.06 * bounds.size().max_element();
            assert!(
                !loose || !subject.has_tight_box(),
                "{}: {bounds:?} but hits only in {reached:?}",
                subject.name
            );
        }
        Some(hits)
    });
}

#[test]
fn a_hit_point_is_hit_again_from_elsewhere() {
    hold(4, 66, |subject, random| {
        let mut hits = 0;
        for _ in 0..2000 {
            let ray = random.line(subject.center(), subject.reach());
            let Some(root) = subject.placed.closest(&ray) else {
                continue;
            };
            let surface = subject.placed.surface(&ray, &root);
            let from = subject.center() + 2.0 * subject.reach() * random.direction();
            let aimed = Ray::new(from, surface.point - from);
            // At an edge rounding decides whether the surface is there.
            let at_edge = |uv: DVec2| uv.min_element() < 1e-9 || uv.max_element() > 1.0 - 1e-9;
            let steepness = slope(&surface, aimed.direction);
            if steepness < 0.05 || (subject.is_bounded() && at_edge(surface.uv)) {
                continue;
            }
            hits += 1;
            let again = roots(&subject.placed, &aimed);
            let nearest = again.iter().min_by(|a, b| (a.t - 1.0).abs().total_cmp(&(b.t - 1.0).abs()));
            let nearest = nearest.unwrap_or_else(|| panic!("{}: missed {aimed:?}", subject.name));
            let off = (nearest.t - 1.0).abs() * aimed.direction.length() * steepness;
            let error = surface.normal.abs().dot(surface.point_error);
            // The second ray has rounding errors of its own.
            assert!(off <= error + 200.0 * grain(subject, &aimed), "{}: {off} against {error}", subject.name);
        }
        Some(hits)
    });
}

#[test]
fn a_leaving_ray_misses_its_start_but_hits_a_near_wall() {
    leave(6000);
}

/// Takes about a minute: some hundred thousand rays a shape and placement.
#[test]
#[ignore = "slow"]
fn leaving_rays_never_hit_their_start_again() {
    leave(200_000);
}

fn leave(rays: usize) {
    hold(5, rays / 15, |subject, random| {
        let mut left = 0;
        for _ in 0..rays {
            let ray = random.line(subject.center(), subject.reach());
            let Some(root) = subject.placed.closest(&ray) else {
                continue;
            };
            let surface = subject.placed.surface(&ray, &root);
            for _ in 0..2 {
                let direction = random.direction();
                // Along the inside of a curve the surface comes back soon, and rightly so.
                if slope(&surface, direction) < 0.02 {
                    continue;
                }
                left += 1;
                let origin = surface.offset_origin(direction);
                let moved = (origin - surface.point).length();
                let grain = grain(subject, &Ray { origin: surface.point, ..ray });
                assert!(moved <= 400.0 * grain, "{}: moved {moved}", subject.name);
                let leaving = Ray::new(origin, direction);
                if let Some(again) = subject.placed.closest(&leaving) {
                    assert!(
                        again.t > 1e-8 * subject.reach(),
                        "{}: found itself at {} from {surface:?} along {direction}",
                        subject.name,
                        again.t
                    );
                }
                // The step over the error must not step over a wall: this surface, crossed from the other side.
                let step = (1e-4 * subject.reach()).max(1e3 * moved);
                let across = Ray::new(origin - step * direction, direction);
                let t = subject.placed.closest(&across).map_or(f64::INFINITY, |r| r.t);
                let at_edge = surface.uv.min_element() < 1e-3 || surface.uv.max_element() > 1.0 - 1e-3;
                let curved_away = slope(&surface, direction) < 0.2;
                assert!(
                    t <= 1.01 * step || at_edge || curved_away || !subject.is_bounded(),
                    "{}: wall at {step} missed, {t} {surface:?} {direction}",
                    subject.name
                );
            }
        }
        Some(left)
    });
}

#[test]
fn uv_and_its_derivatives_describe_the_surface() {
    hold(6, 100, |subject, random| {
        let map = subject.placed.world_from_object();
        let mut hits = 0;
        for _ in 0..3000 {
            let ray = random.line(subject.center(), subject.reach());
            let Some(root) = subject.placed.closest(&ray) else {
                continue;
            };
            let s = subject.placed.surface(&ray, &root);
            let name = &subject.name;
            hits += 1;
            assert!((s.normal.length() - 1.0).abs() < 1e-14, "{name}: {s:?}");
            for tangent in [s.dpdu, s.dpdv, s.dndu, s.dndv] {
                let lean = s.normal.dot(tangent).abs();
                assert!(lean <= 1e-9 * tangent.length(), "{name}: {lean} {s:?}");
            }
            let in_square = s.uv.min_element() >= 0.0 && s.uv.max_element() <= 1.0;
            assert!(in_square || !subject.is_bounded(), "{name}: {s:?}");
            assert!(s.point_error.is_finite() && s.point_error.min_element() >= 0.0, "{name}: {s:?}");

            let at = |uv: DVec2| {
                let object = PlacedShape::new(subject.placed.shape().clone(), Transform::IDENTITY);
                let made = object.shape().surface_at(root.part, uv)?;
                Some((map.point(made.point), map.normal(made.normal).normalize()))
            };
            let Some((rebuilt, normal)) = at(s.uv) else {
                continue;
            };
            let off = (rebuilt - s.point).length();
            assert!(off <= 1e-8 * subject.reach() + 1e3 * grain(subject, &ray), "{name}: {off} {s:?}");
            assert!((normal - s.normal).length() < 1e-6, "{name}: {normal} {s:?}");

            // Not across the seam, and not next to a pole or an apex, where the normal turns fast.
            let h = 1e-4;
            let inside = s.uv.min_element() > 0.02 && s.uv.max_element() < 0.98;
            let clear_of_seam = (s.uv.x - s.uv.x.round()).abs() > 0.02;
            if !(inside || (!subject.is_bounded() && clear_of_seam)) {
                continue;
            }
            for (step, dp, dn) in [(DVec2::X, s.dpdu, s.dndu), (DVec2::Y, s.dpdv, s.dndv)] {
                let (Some(before), Some(after)) = (at(s.uv - h * step), at(s.uv + h * step)) else {
                    panic!("{name}: part of a part");
                };
                let (slope, turn) = ((after.0 - before.0) / (2.0 * h), (after.1 - before.1) / (2.0 * h));
                let noise = 1e3 * grain(subject, &ray) / h;
                let off = (slope - dp).length();
                assert!(
                    off <= 1e-5 * (dp.length() + subject.reach()) + noise,
                    "{name}: {slope} {dp} at {:?}",
                    s.uv
                );
                let off = (turn - dn).length();
                assert!(off <= 1e-4 * (1.0 + dn.length()), "{name}: dn {turn} {dn} at {:?}", s.uv);
            }
        }
        Some(hits)
    });
}

#[test]
fn a_solid_is_entered_and_left_in_turn() {
    hold(7, 166, |subject, random| {
        if !subject.placed.shape().is_solid() {
            let p = subject.placed.world_from_object().inverse_point(subject.center());
            assert!(!subject.placed.shape().contains(p), "{}: holds a point but is no solid", subject.name);
            return None;
        }
        let map = subject.placed.world_from_object();
        let contains = |p: DVec3| subject.placed.shape().contains(map.inverse_point(p));
        let mut crossings = 0;
        for _ in 0..3000 {
            let ray = whole_line(&random.line(subject.center(), subject.reach()));
            let found = roots(&subject.placed, &ray);
            let fronts: Vec<bool> = found
                .iter()
                .filter(|r| r.multiplicity % 2 == 1)
                .map(|r| subject.placed.surface(&ray, r).normal.dot(ray.direction) < 0.0)
                .collect();
            crossings += fronts.len();
            let alternate = fronts.is_sorted_by(|a, b| a != b);
            let from_outside =
                !subject.is_bounded() || fronts.is_empty() || (fronts[0] && fronts.len().is_multiple_of(2));
            assert!(alternate && from_outside, "{}: {fronts:?} {ray:?}", subject.name);

            let far = 2.5 * subject.reach();
            let mut ends: Vec<f64> = found.iter().map(|r| r.t).filter(|&t| t > 0.0).collect();
            ends.push(ends.last().copied().unwrap_or(0.0) + far);
            let mut start = 0.0;
            for (end, root) in
                ends.into_iter().zip(found.iter().filter(|r| r.t > 0.0).map(Some).chain([None]))
            {
                let enters = root.map(|r| subject.placed.surface(&ray, r).normal.dot(ray.direction) < 0.0);
                let middle = ray.at(0.5 * (start + end));
                if let (Some(enters), true) = (enters, end - start > 1e-6 * subject.reach()) {
                    assert_eq!(contains(middle), !enters, "{}: {middle} {ray:?} {found:?}", subject.name);
                }
                start = end;
            }
        }
        Some(crossings)
    });
}

#[test]
fn random_lines_cross_as_often_as_the_area_says() {
    // Crofton: lines of the invariant measure through a ball of radius R cross a surface A / (2πR²) times on average.
    hold(8, 2000, |subject, random| {
        let area = subject.placed.area();
        if !subject.has_area() {
            assert!(area.is_infinite(), "{}", subject.name);
            return None;
        }
        let (n, radius) = (60_000, subject.reach());
        let (mut sum, mut sum_of_squares) = (0.0, 0.0);
        for _ in 0..n {
            let line = random.line(subject.center(), radius);
            let crossings = roots(&subject.placed, &whole_line(&line)).len() as f64;
            sum += crossings;
            sum_of_squares += crossings * crossings;
        }
        let mean = sum / f64::from(n);
        let sigma = ((sum_of_squares / f64::from(n) - mean * mean) / f64::from(n)).sqrt();
        let expected = area / (TAU * radius * radius);
        let off = (mean - expected) / sigma;
        assert!(off.abs() < 4.5, "{}: {mean} crossings, {expected} expected, {off} sigma", subject.name);
        Some(sum as usize)
    });
}

#[test]
fn area_samples_match_their_density() {
    hold(9, 5000, |subject, random| {
        if !subject.has_area() {
            assert!(subject.placed.sample_area(DVec2::splat(0.3)).is_none(), "{}", subject.name);
            return None;
        }
        let (center, radius, area) = (subject.center(), subject.reach(), subject.placed.area());
        let (mut weights, mut moments) = (Mean::default(), [Mean::default(); 3]);
        let mut samples = 0;
        for i in 0..20_000 {
            let Some(sample) = subject.placed.sample_area(random.uv()) else {
                weights.add(0.0);
                moments.iter_mut().for_each(|m| m.add(0.0));
                continue;
            };
            samples += 1;
            weights.add(1.0 / sample.pdf);
            let offset = (sample.surface.point - center) / radius;
            for axis in 0..3 {
                moments[axis].add((offset[axis] + 0.5 * offset[(axis + 1) % 3]).powi(2) / sample.pdf / area);
            }
            if i % 20 == 0 {
                let n = sample.surface.normal;
                let (aside, _) = n.any_orthonormal_pair();
                let from = sample.surface.point + radius * (n + 0.3 * aside);
                let ray = Ray::new(from, sample.surface.point - from);
                let near = |r: &Root| (r.t - 1.0).abs() * ray.direction.length() < 1e3 * grain(subject, &ray);
                let at_edge =
                    sample.surface.uv.min_element() < 1e-6 || sample.surface.uv.max_element() > 1.0 - 1e-6;
                let found = roots(&subject.placed, &ray);
                assert!(found.iter().any(near) || at_edge, "{}: {sample:?} {found:?}", subject.name);
            }
        }
        weights.assert_near(&Mean::exact(area), &subject.name);

        // The second moments of the surface, from the crossings of random lines.
        let mut from_lines = [Mean::default(); 3];
        for _ in 0..30_000 {
            let line = random.line(center, radius);
            let mut sums = [0.0; 3];
            for root in roots(&subject.placed, &whole_line(&line)) {
                let offset = (subject.placed.surface(&line, &root).point - center) / radius;
                for axis in 0..3 {
                    sums[axis] += (offset[axis] + 0.5 * offset[(axis + 1) % 3]).powi(2);
                }
            }
            for axis in 0..3 {
                from_lines[axis].add(sums[axis] * TAU * radius * radius / area);
            }
        }
        for axis in 0..3 {
            moments[axis].assert_near(&from_lines[axis], &subject.name);
        }
        Some(samples)
    });
}

#[test]
fn direction_samples_match_their_density() {
    hold(10, 5000, |subject, random| {
        if !subject.has_area() {
            assert!(
                subject.placed.sample_direction(DVec3::ZERO, DVec2::splat(0.3)).is_none(),
                "{}",
                subject.name
            );
            return None;
        }
        let (center, radius) = (subject.center(), subject.reach());
        let mut samples = 0;
        for distance in [0.05, 0.9, 1.7] {
            // Sampling by area right before the surface has no variance to speak of: it is infinite.
            let is_clear = |from: DVec3, random: &mut Random| {
                let nearest = |_| {
                    let ray = Ray::new(from, random.direction());
                    subject.placed.closest(&ray).map_or(f64::INFINITY, |r| r.t)
                };
                (0..400).map(nearest).fold(f64::INFINITY, f64::min) > 0.1 * radius
            };
            let candidates =
                (0..100).map(|_| center + distance * radius * random.direction()).collect::<Vec<_>>();
            let Some(from) = candidates.into_iter().find(|&from| is_clear(from, random)) else {
                continue;
            };
            let (mut weights, mut moments) = (Mean::default(), [Mean::default(); 3]);
            for _ in 0..10_000 {
                let Some(sample) = subject.placed.sample_direction(from, random.uv()) else {
                    weights.add(0.0);
                    moments.iter_mut().for_each(|m| m.add(0.0));
                    continue;
                };
                samples += 1;
                let ray = Ray::new(from, 3.7 * (sample.surface.point - from));
                // Seen edge-on the density runs to infinity, and its rounding error with it.
                let steepness = slope(&sample.surface, ray.direction);
                if steepness > 1e-3 {
                    let pdf = subject.placed.pdf_direction(&ray, &sample.surface);
                    let off = (pdf / sample.pdf - 1.0).abs();
                    let allowed = 1e-9 + 1e3 * grain(subject, &ray) / radius / steepness;
                    assert!(off < allowed, "{}: {pdf} {sample:?}", subject.name);
                }
                weights.add(1.0 / sample.pdf);
                let direction = ray.direction.normalize();
                for axis in 0..3 {
                    moments[axis]
                        .add((direction[axis] + 0.5 * direction[(axis + 1) % 3]).powi(2) / sample.pdf);
                }
            }
            // The same integrals over the points that can be chosen, by directions uniform over the whole sphere.
            let (mut solid_angle, mut from_rays) = (Mean::default(), [Mean::default(); 3]);
            for _ in 0..20_000 {
                let ray = Ray::new(from, random.direction());
                let found = roots(&subject.placed, &ray);
                let chosen = found
                    .iter()
                    .filter(|r| subject.placed.pdf_direction(&ray, &subject.placed.surface(&ray, r)) > 0.0);
                let count = chosen.count() as f64 * 4.0 * PI;
                solid_angle.add(count);
                for axis in 0..3 {
                    let d = ray.direction;
                    from_rays[axis].add((d[axis] + 0.5 * d[(axis + 1) % 3]).powi(2) * count);
                }
            }
            let place = format!("{} from {distance}", subject.name);
            weights.assert_near(&solid_angle, &place);
            for axis in 0..3 {
                moments[axis].assert_near(&from_rays[axis], &place);
            }
        }
        Some(samples)
    });
}

#[test]
fn rays_that_are_none_miss() {
    hold(11, 10, |subject, random| {
        let mut tried = 0;
        for _ in 0..20 {
            let ray = random.ray(subject);
            let nan = DVec3::new(0.0, f64::NAN, 0.0);
            let odd = [
                Ray { direction: DVec3::ZERO, ..ray },
                Ray { direction: -DVec3::ZERO, ..ray },
                Ray { direction: ray.direction + nan, ..ray },
                Ray { origin: ray.origin + nan, ..ray },
                Ray { origin: ray.origin + DVec3::INFINITY, ..ray },
                ray.with_range(f64::NAN, f64::INFINITY),
                ray.with_range(0.0, f64::NAN),
                ray.with_range(7.0, 3.0),
                ray.with_range(f64::INFINITY, f64::INFINITY),
                ray.with_range(f64::NEG_INFINITY, f64::NEG_INFINITY),
            ];
            for ray in odd {
                tried += 1;
                let found = roots(&subject.placed, &ray);
                assert!(found.is_empty(), "{}: {found:?} {ray:?}", subject.name);
                assert_eq!(subject.placed.closest(&ray), None, "{}: {ray:?}", subject.name);
            }
            // Aligned with the axes, signed zeros among them: an answer, whichever it is.
            for axis in DVec3::AXES {
                for direction in [axis, -axis] {
                    let found = roots(&subject.placed, &whole_line(&Ray { direction, ..ray }));
                    assert!(found.iter().all(|r| r.t.is_finite()), "{}: {found:?}", subject.name);
                }
            }
        }
        Some(tried)
    });
}

#[test]
fn samples_are_on_the_surface_or_none() {
    hold(12, 0, |subject, random| {
        let on_surface = subject.placed.sample_area(random.uv()).map_or(DVec3::ZERO, |s| s.surface.point);
        let corner = subject
            .placed
            .shape()
            .surface_at(0, DVec2::ZERO)
            .map_or(DVec3::ZERO, |s| subject.placed.world_from_object().point(s.point));
        let reach = subject.reach();
        let places = [
            subject.center(),
            subject.aim.min,
            subject.aim.max,
            on_surface,
            corner,
            on_surface + DVec3::splat(1e-13 * reach),
            subject.center() + DVec3::splat(1e9 * reach),
            subject.center() + DVec3::splat(1e100 * reach),
            DVec3::splat(f64::INFINITY),
            DVec3::splat(f64::NAN),
        ];
        let numbers = [0.0, f64::MIN_POSITIVE, 0.5, 1.0 - 0.5 * f64::EPSILON];
        let mut samples = 0;
        for u in numbers.into_iter().flat_map(|x| numbers.map(|y| DVec2::new(x, y))) {
            if let Some(sample) = subject.placed.sample_area(u) {
                let is_good = sample.surface.point.is_finite() && sample.surface.normal.is_normalized();
                assert!(is_good && sample.pdf > 0.0, "{}: {sample:?} of {u}", subject.name);
            }
            for from in places {
                let Some(sample) = subject.placed.sample_direction(from, u) else {
                    continue;
                };
                samples += 1;
                let is_good = sample.surface.point.is_finite() && sample.surface.normal.is_normalized();
                let is_good = is_good && sample.pdf > 0.0 && sample.pdf.is_finite();
                assert!(is_good || !from.is_finite(), "{}: {sample:?} from {from} of {u}", subject.name);
            }
        }
        Some(samples)
    });
}

/// A running mean and its standard error.
#[derive(Clone, Copy, Default)]
struct Mean {
    n: f64,
    sum: f64,
    sum_of_squares: f64,
    exact: Option<f64>,
}

impl Mean {
    fn exact(value: f64) -> Self {
        Self { exact: Some(value), ..Self::default() }
    }

    fn add(&mut self, x: f64) {
        self.n += 1.0;
        self.sum += x;
        self.sum_of_squares += x * x;
    }

    fn value(&self) -> f64 {
        self.exact.unwrap_or(self.sum / self.n)
    }

    fn variance(&self) -> f64 {
        if self.exact.is_some() {
            return 0.0;
        }
        let mean = self.value();
        ((self.sum_of_squares / self.n - mean * mean) / self.n).max(0.0)
    }

    fn assert_near(&self, other: &Self, what: &str) {
        let sigma = (self.variance() + other.variance()).sqrt();
        let off = (self.value() - other.value()).abs();
        let rounding = 1e-9 * other.value().abs();
        assert!(
            off <= 4.8 * sigma + rounding,
            "{what}: {} against {}, sigma {sigma}",
            self.value(),
            other.value()
        );
    }
}
