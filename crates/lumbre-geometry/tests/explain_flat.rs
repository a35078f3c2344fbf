//! What is said of degenerate lines of whole numbers, and of shapes that are no quadrics: planes, disks, boxes,
//! triangles, patches and tori. The oracle is arithmetic of whole numbers.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::collections::BTreeMap;

use lumbre_geometry::{
    BilinearPatch, Capsule, Cone, Cuboid, Cylinder, Disk, Explanation, Fate, Plane, Ray, Remark, Shape,
    Sphere, Step, Topic, Torus, Triangle,
};
use lumbre_math::DVec3;
use lumbre_math::random::RandomStream;

type Whole = [i128; 3];

fn vector(v: Whole) -> DVec3 {
    DVec3::from_array(v.map(|x| x as f64))
}

fn sub(a: Whole, b: Whole) -> Whole {
    std::array::from_fn(|i| a[i] - b[i])
}

fn dot(a: Whole, b: Whole) -> i128 {
    (0..3).map(|i| a[i] * b[i]).sum()
}

fn cross(a: Whole, b: Whole) -> Whole {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// A fraction with a positive divisor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Fraction(i128, i128);

impl Fraction {
    fn new(over: i128, under: i128) -> Self {
        if under < 0 { Self(-over, -under) } else { Self(over, under) }
    }

    fn cmp(self, other: Self) -> std::cmp::Ordering {
        (self.0 * other.1).cmp(&(other.0 * self.1))
    }

    fn is_less(self, other: Self) -> bool {
        self.cmp(other).is_lt()
    }

    fn equals(self, other: Self) -> bool {
        self.cmp(other).is_eq()
    }

    fn value(self) -> f64 {
        self.0 as f64 / self.1 as f64
    }
}

/// The remarks of the first step of a topic; none where there is no such step.
fn remarks(explanation: &Explanation, topic: Topic) -> &[Remark] {
    let step: Option<&Step> = explanation.steps.iter().find(|step| step.topic == topic);
    step.map_or(&[], |step| &step.remarks)
}

/// Counts what is said, by name.
#[derive(Default)]
struct Said(BTreeMap<&'static str, usize>);

impl Said {
    /// That a remark is made where it is true, and nowhere else.
    fn hold(&mut self, name: &'static str, is_said: bool, is_so: bool, context: &dyn Fn() -> String) {
        assert_eq!(is_said, is_so, "{name}: {}", context());
        *self.0.entry(name).or_default() += usize::from(is_said);
    }

    fn has_each(&self, names: &[&str]) {
        for name in names {
            assert!(self.0.get(name).is_some_and(|count| *count >= 8), "{name}: {:?}", self.0);
        }
    }
}

struct Rays(RandomStream);

impl Rays {
    fn whole(&mut self, most: i128) -> i128 {
        i128::from(self.0.next_below(2 * most as usize + 1) as u32) - most
    }

    fn any(&mut self, most: i128) -> Whole {
        std::array::from_fn(|_| self.whole(most))
    }

    fn direction(&mut self, most: i128) -> Whole {
        loop {
            let d = self.any(most);
            if d != [0; 3] {
                return d;
            }
        }
    }
}

fn ray_of(origin: Whole, direction: Whole) -> Ray {
    Ray::new(vector(origin), vector(direction))
}

#[test]
fn what_is_said_of_planes_and_disks_is_so() {
    let (mut rays, mut said) = (Rays(RandomStream::new(61)), Said::default());
    let (point, normal, radius, hole) = ([1, -2, 3], [2, -1, 2], 5, 2);
    let plane = Shape::from(Plane::new(vector(point), vector(normal)).unwrap());
    let disk = Shape::from(Disk::new(vector(point), vector(normal), radius as f64, hole as f64).unwrap());
    for i in 0..3000 {
        let mut d = rays.direction(3);
        // Every third line is parallel, every second of these lies in the plane.
        if i % 3 == 0 {
            d = cross(normal, d);
        }
        let in_plane = cross(normal, rays.any(2));
        let mut origin: Whole = std::array::from_fn(|k| point[k] + in_plane[k]);
        if i % 2 == 0 {
            origin = std::array::from_fn(|k| origin[k] + rays.whole(3) * normal[k]);
        }
        if d == [0; 3] {
            continue;
        }
        let ray = ray_of(origin, d);
        let (slope, away) = (dot(d, normal), dot(sub(point, origin), normal));
        for shape in [&plane, &disk] {
            let explanation = shape.explain(&ray);
            let context = || format!("{ray:?} {explanation:#?}");
            let made = remarks(&explanation, Topic::Plane);
            let (is_parallel, is_in) = (slope == 0 && away != 0, slope == 0 && away == 0);
            said.hold("parallel", made.contains(&Remark::Parallel), is_parallel, &context);
            said.hold("in the plane", made.contains(&Remark::InPlane), is_in, &context);
            let loses = made.iter().any(|remark| matches!(remark, Remark::Cancellation { .. }));
            said.hold("loses digits", loses, false, &context);
            // All products of whole numbers are exact.
            said.hold("twice the precision", made.contains(&Remark::TwicePrecision), false, &context);
            assert_eq!(explanation.candidates.len(), usize::from(slope != 0), "{}", context());
            for candidate in &explanation.candidates {
                let t = Fraction::new(away, slope);
                assert!((candidate.t - t.value()).abs() <= 1e-14 * t.value().abs(), "{}", context());
                // The square of the distance from the centre, times the square of the divisor.
                let arm: Whole = std::array::from_fn(|k| (origin[k] - point[k]) * slope + away * d[k]);
                let (squared, unit) = (dot(arm, arm), slope * slope);
                let is_so = match candidate.fate {
                    Fate::Hit => away == 0 || (away > 0) == (slope > 0),
                    Fate::Behind => away != 0 && (away > 0) != (slope > 0),
                    Fate::OutsideRim { .. } => squared > radius * radius * unit,
                    Fate::InsideHole { .. } => squared < hole * hole * unit,
                    _ => false,
                };
                let name = match candidate.fate {
                    Fate::OutsideRim { .. } => "beyond the rim",
                    Fate::InsideHole { .. } => "in the hole",
                    Fate::Behind => "behind",
                    _ => "hit",
                };
                // At the rim itself rounding decides.
                let is_at_rim = squared == radius * radius * unit || squared == hole * hole * unit;
                said.hold(name, true, is_so || is_at_rim, &context);
            }
        }
    }
    said.has_each(&["parallel", "in the plane", "beyond the rim", "in the hole", "behind", "hit"]);
}

#[test]
fn where_nothing_is_rounded_nothing_is_said_of_rounding() {
    let shapes: [Shape; 5] = [
        Cylinder::along_z(2.0, -3.0, 4.0, true).unwrap().into(),
        Cylinder::along_z(2.0, -3.0, 4.0, false).unwrap().into(),
        Capsule::new(DVec3::new(1.0, 0.0, -4.0), DVec3::new(1.0, 0.0, 4.0), 2.0).unwrap().into(),
        Cone::new(DVec3::ZERO, DVec3::new(0.0, 0.0, 4.0), 2.0, 0.0, false).unwrap().into(),
        Sphere::new(DVec3::new(1.0, 2.0, -1.0), 2.0).unwrap().into(),
    ];
    let mut count = 0;
    for shape in &shapes {
        // Along the axis: in the middle, in the side, beside it; along a generator of the cone; and across, touching.
        for (origin, d) in [
            ([0, 0, -8], [0, 0, 1]),
            ([2, 0, -8], [0, 0, 1]),
            ([0, 3, -8], [0, 0, 2]),
            ([2, 0, 0], [-1, 0, 2]),
            ([2, -8, 0], [0, 1, 0]),
            ([3, -8, 0], [0, 1, 0]),
            ([1, -8, -4], [0, 1, 0]),
        ] {
            let ray = ray_of(origin, d);
            let explanation = shape.explain(&ray);
            for remark in explanation.steps.iter().flat_map(|step| &step.remarks) {
                let is_of_rounding = matches!(
                    remark,
                    Remark::TwicePrecision
                        | Remark::Cancellation { .. }
                        | Remark::SchoolbookHits
                        | Remark::SchoolbookMisses
                );
                assert!(!is_of_rounding, "{ray:?} {explanation:#?}");
                count += 1;
            }
        }
    }
    assert!(count > 20, "{count}");
}

#[test]
fn what_is_said_of_boxes_is_so() {
    let (mut rays, mut said) = (Rays(RandomStream::new(62)), Said::default());
    let (low, high) = ([-2, 1, 0], [3, 4, 2]);
    let shape = Shape::from(Cuboid::new(vector(low), vector(high)).unwrap());
    for i in 0..3000 {
        let mut d = rays.direction(2);
        if i % 2 == 0 {
            d[i % 3] = 0;
        }
        let mut origin = rays.any(6);
        // In a face, on an edge, or through a corner.
        if i % 5 > 1 {
            let back = rays.whole(3);
            origin = std::array::from_fn(|k| [low[k], high[k], origin[k]][(i + 2 * k) % 3] - back * d[k]);
        }
        if d == [0; 3] {
            continue;
        }
        let ray = ray_of(origin, d);
        let explanation = shape.explain(&ray);
        let context = || format!("{ray:?} {explanation:#?}");
        let (mut enter, mut leave): (Option<Fraction>, Option<Fraction>) = (None, None);
        let mut is_beside = false;
        for k in 0..3 {
            let is_between = low[k] <= origin[k] && origin[k] <= high[k];
            let slabs = remarks(&explanation, Topic::Slabs);
            let said_between = slabs.contains(&Remark::Between { axis: k });
            said.hold("between", said_between, d[k] == 0 && is_between, &context);
            let said_beside = slabs.contains(&Remark::Beside { axis: k });
            said.hold("beside", said_beside, d[k] == 0 && !is_between, &context);
            if d[k] == 0 {
                is_beside |= !is_between;
                continue;
            }
            let [a, b] = [low[k], high[k]].map(|plane| Fraction::new(plane - origin[k], d[k]));
            let (near, far) = if a.is_less(b) { (a, b) } else { (b, a) };
            enter = Some(enter.filter(|enter| near.is_less(*enter)).unwrap_or(near));
            leave = Some(leave.filter(|leave| leave.is_less(far)).unwrap_or(far));
        }
        let (enter, leave) = (enter.unwrap(), leave.unwrap());
        let span = remarks(&explanation, Topic::Span);
        let misses = is_beside || leave.is_less(enter);
        said.hold("misses", span.contains(&Remark::Misses), misses, &context);
        let touches = !misses && enter.equals(leave);
        said.hold("touches", span.contains(&Remark::Touches), touches, &context);
    }
    said.has_each(&["between", "beside", "misses", "touches"]);
}

#[test]
fn what_is_said_of_triangles_is_so() {
    let (mut rays, mut said) = (Rays(RandomStream::new(63)), Said::default());
    for i in 0..3000 {
        let [a, b, c] = std::array::from_fn(|_| rays.any(3));
        let (ab, ac) = (sub(b, a), sub(c, a));
        let normal = cross(ab, ac);
        let is_flat = normal == [0; 3];
        // Towards a corner, along an edge, in the plane, or anywhere.
        let d = match i % 4 {
            0 => ab,
            1 => std::array::from_fn(|k| ab[k] - ac[k]),
            _ => rays.direction(2),
        };
        let through: Whole = match i % 3 {
            0 => a,
            1 => std::array::from_fn(|k| b[k] + c[k] - a[k]),
            _ => rays.any(4),
        };
        if d == [0; 3] {
            continue;
        }
        let origin: Whole = std::array::from_fn(|k| through[k] - 2 * d[k]);
        let ray = ray_of(origin, d);
        let shape = Shape::from(Triangle::new(vector(a), vector(b), vector(c)).unwrap());
        let explanation = shape.explain(&ray);
        let context = || format!("{a:?} {b:?} {c:?} {ray:?} {explanation:#?}");
        let parameters = remarks(&explanation, Topic::Parameters);
        said.hold("flat", parameters.contains(&Remark::Flat), is_flat, &context);
        let edges = remarks(&explanation, Topic::EdgeFunctions);
        // Six volumes: on which side of each edge the line passes.
        let side = |p: Whole, q: Whole| dot(d, cross(sub(p, origin), sub(q, origin)));
        let (u, v, w) = (side(b, c), side(c, a), side(a, b));
        let (slope, away) = (dot(d, normal), dot(sub(a, origin), normal));
        // Whole numbers round only in the shear, where the longest component is no power of two.
        let longest = d.map(i128::abs).into_iter().max().unwrap();
        if longest.count_ones() == 1 {
            said.hold("parallel", edges.contains(&Remark::Parallel), slope == 0 && away != 0, &context);
            said.hold("in the plane", edges.contains(&Remark::InPlane), slope == 0 && away == 0, &context);
            let is_on = u == 0 || v == 0 || w == 0;
            said.hold("on an edge", edges.contains(&Remark::OnEdge), is_on, &context);
            let by_errors = edges.contains(&Remark::EdgeByRoundingErrors);
            said.hold("rounding errors decide", by_errors, false, &context);
            let is_inside = [u, v, w].iter().all(|x| *x >= 0) || [u, v, w].iter().all(|x| *x <= 0);
            let misses = !is_inside && (slope != 0 || away != 0);
            said.hold("misses", edges.contains(&Remark::Misses), misses, &context);
            let is_met = is_inside && slope != 0;
            for topic in [Topic::MollerTrumbore, Topic::PlaneAndSides] {
                let made = remarks(&explanation, topic);
                assert_eq!(made.contains(&Remark::Parallel), slope == 0, "{}", context());
                // At an edge itself another test may say otherwise, and then it is said.
                let disagrees = made.contains(&Remark::Disagrees);
                said.hold("disagrees", disagrees && !is_on, false, &context);
            }
            let hits = explanation.candidates.iter().filter(|candidate| candidate.root.is_some()).count();
            let is_ahead = away == 0 || (away > 0) == (slope > 0);
            assert_eq!(hits, usize::from(is_met && is_ahead), "{}", context());
        }
    }
    said.has_each(&["flat", "parallel", "in the plane", "on an edge", "misses"]);
}

#[test]
fn what_is_said_of_patches_is_so() {
    let (mut rays, mut said) = (Rays(RandomStream::new(64)), Said::default());
    for i in 0..4000 {
        let mut corners: [Whole; 4] = std::array::from_fn(|_| rays.any(2));
        if i % 2 == 0 {
            // z = uv on a square of four: rulings along x and y.
            corners = [[0, 0, 0], [4, 0, 0], [0, 4, 0], [4, 4, 4]];
        }
        let [p00, p10, p01, p11] = corners;
        // The shear is exact along these.
        let d: Whole = [[0, 0, -1], [0, 1, 0], [1, 0, 0], [1, 0, 1], [0, 2, 1], [1, -1, 2], [1, 2, 0]][i % 7];
        let origin = rays.any(4);
        let ray = ray_of(origin, d);
        let Ok(patch) = BilinearPatch::new(vector(p00), vector(p10), vector(p01), vector(p11)) else {
            continue;
        };
        let explanation = Shape::from(patch).explain(&ray);
        let context = || format!("{corners:?} {ray:?} {explanation:#?}");
        // The determinant det[D, a(u) − O, b(u) − O] as a·u² + 2·h·u + c; only its sign depends on the space.
        let turn = |p: Whole, q: Whole| dot(d, cross(p, q));
        let [q00, q10, q01, q11] = corners.map(|p| sub(p, origin));
        let c = turn(q00, q01);
        let a = turn(sub(q10, q00), sub(q11, q01));
        let b = turn(q10, q11) - a - c;
        let delta = b * b - 4 * a * c;
        let made = remarks(&explanation, Topic::Rulings);
        let has = |remark: &Remark| made.contains(remark);
        said.hold("at infinity", has(&Remark::AtInfinity), a == 0 && b != 0, &context);
        said.hold("every ruling", has(&Remark::EveryRuling), (a, b, c) == (0, 0, 0), &context);
        let misses = delta < 0 || (a, b) == (0, 0) && c != 0;
        said.hold("no ruling", has(&Remark::Misses), misses, &context);
        said.hold("one ruling", has(&Remark::Touches), delta == 0 && a != 0, &context);
        // E(u) = e + u·f runs along a ruling: parallel to d for one u, and not on the line.
        let (e, f) = (sub(q01, q00), sub(sub(q11, q10), sub(q01, q00)));
        let (k, l) = (cross(e, d), cross(f, d));
        let parallel_at = (0..3).find(|&i| l[i] != 0).map(|i| Fraction::new(-k[i], l[i]));
        let is_parallel = |u: Fraction| {
            let start: Whole = std::array::from_fn(|i| u.1 * q00[i] + u.0 * (q10[i] - q00[i]));
            (0..3).all(|i| k[i] * u.1 + u.0 * l[i] == 0) && cross(start, d) != [0, 0, 0]
        };
        let is_said = has(&Remark::ParallelRuling);
        if let Some(u) = parallel_at {
            said.hold("parallel ruling", is_said, is_parallel(u) && (a, b) != (0, 0), &context);
        } else {
            said.hold("parallel ruling", is_said && k != [0; 3], false, &context);
        }
        let winding = remarks(&explanation, Topic::Winding);
        let sides = [(q00, q10), (q10, q11), (q11, q01), (q01, q00)].map(|(p, q)| turn(p, q));
        said.hold("on an edge", winding.contains(&Remark::OnEdge), sides.contains(&0), &context);
        said.hold("rounding", winding.contains(&Remark::EdgeByRoundingErrors), false, &context);
        // A line that lies in the surface z = uv, x = 4u, y = 4v, within its border, is not said to miss it.
        let lies = i % 2 == 0 && (d, origin[2]) == ([0, 1, 0], origin[0]) && (0..=4).contains(&origin[0])
            || i % 2 == 0 && (d, origin[2]) == ([1, 0, 0], origin[1]) && (0..=4).contains(&origin[1]);
        if lies {
            let roots = remarks(&explanation, Topic::Roots);
            said.hold("lies in it", true, !roots.contains(&Remark::Misses), &context);
        }
        // One that has no real ruling meets nothing.
        if delta < 0 {
            let roots = remarks(&explanation, Topic::Roots);
            said.hold("misses", roots.contains(&Remark::Misses), true, &context);
        }
    }
    said.has_each(&[
        "at infinity",
        "every ruling",
        "no ruling",
        "one ruling",
        "parallel ruling",
        "on an edge",
        "lies in it",
        "misses",
    ]);
}

/// How many real roots a quartic has, each counted once, and whether one of them is multiple: by Sturm's sequence.
fn real_roots(coefficients: [i128; 5]) -> (usize, bool) {
    let trimmed = |mut p: Vec<i128>| {
        while p.last() == Some(&0) {
            p.pop();
        }
        let common = p.iter().fold(0_i128, |a, b| {
            let (mut a, mut b) = (a.abs(), b.abs());
            while b != 0 {
                (a, b) = (b, a % b);
            }
            a
        });
        p.into_iter().map(|x| x / common.max(1)).collect::<Vec<_>>()
    };
    let p = trimmed(coefficients.to_vec());
    let derivative = (1..p.len()).map(|i| i as i128 * p[i]).collect();
    let mut chain = vec![p, trimmed(derivative)];
    loop {
        let [.., a, b] = &chain[..] else { panic!("two at least") };
        let (mut rest, lead) = (a.clone(), b[b.len() - 1]);
        while rest.len() >= b.len() {
            let (top, shift) = (rest[rest.len() - 1], rest.len() - b.len());
            // Times the square of the leading coefficient, so that signs stay.
            rest = rest.into_iter().map(|x| x * lead * lead).collect();
            for (i, x) in b.iter().enumerate() {
                rest[i + shift] -= top * lead * x;
            }
            rest.pop();
            rest = trimmed(rest);
        }
        if rest.is_empty() {
            break;
        }
        chain.push(rest.into_iter().map(|x| -x).collect());
    }
    let changes = |at: fn(&[i128]) -> i128| {
        let signs: Vec<i128> = chain.iter().map(|p| at(p).signum()).filter(|sign| *sign != 0).collect();
        signs.windows(2).filter(|pair| pair[0] != pair[1]).count()
    };
    let lead = |p: &[i128]| p[p.len() - 1];
    let turned = |p: &[i128]| if p.len() % 2 == 1 { p[p.len() - 1] } else { -p[p.len() - 1] };
    let common = &chain[chain.len() - 1];
    // Common roots of the quartic and its derivative are multiple; they may be complex.
    let has_real = match common.len() {
        1 => false,
        3 => common[1] * common[1] - 4 * common[0] * common[2] >= 0,
        _ => true,
    };
    (changes(turned) - changes(lead), has_real)
}

#[test]
fn what_is_said_of_tori_is_so() {
    assert_eq!(real_roots([4, 0, -5, 0, 1]), (4, false));
    assert_eq!(real_roots([1, 0, -2, 0, 1]), (2, true));
    assert_eq!(real_roots([1, 0, 2, 0, 1]), (0, false));
    assert_eq!(real_roots([1, 0, 0, 0, 1]), (0, false));
    let (mut rays, mut said) = (Rays(RandomStream::new(65)), Said::default());
    let (big, small) = (3, 1);
    let torus = Torus::new(DVec3::ZERO, DVec3::Z, big as f64, small as f64).unwrap();
    let shape = Shape::from(torus);
    for i in 0..3000 {
        let d = rays.direction(1);
        let mut origin = rays.any(4);
        if i % 3 == 0 {
            // Through the equators, the circles on top and below, and the centre.
            origin = [[4, 0, 0], [0, 2, 0], [3, 0, 1], [0, 0, 0], [0, -3, -1]][i % 5];
        }
        let back = rays.whole(2);
        let origin: Whole = std::array::from_fn(|k| origin[k] - back * d[k]);
        let ray = ray_of(origin, d);
        let explanation = shape.explain(&ray);
        let context = || format!("{ray:?} {explanation:#?}");
        let (g, h, k) = (dot(d, d), dot(origin, d), dot(origin, origin) + big * big - small * small);
        let flat = |a: Whole, b: Whole| a[0] * b[0] + a[1] * b[1];
        let four = 4 * big * big;
        let quartic = [
            k * k - four * flat(origin, origin),
            4 * h * k - 2 * four * flat(origin, d),
            4 * h * h + 2 * g * k - four * flat(d, d),
            4 * g * h,
            g * g,
        ];
        let (count, is_multiple) = real_roots(quartic);
        let topics = [Topic::TorusFrame, Topic::TorusBounds, Topic::QuarticRoots];
        let made: Vec<Remark> =
            topics.iter().flat_map(|topic| remarks(&explanation, *topic).to_vec()).collect();
        said.hold("misses", made.contains(&Remark::Misses), count == 0, &context);
        said.hold("touches", made.contains(&Remark::Touches), count > 0 && is_multiple, &context);
        // Its coefficients are whole numbers: nothing is rounded in them.
        let theirs = remarks(&explanation, Topic::TextbookQuartic);
        let miscounts = theirs.iter().any(|remark| matches!(remark, Remark::SchoolbookCount { .. }));
        said.hold("another number of roots", miscounts, false, &context);
        assert_eq!(explanation.candidates.len(), count, "{}", context());
    }
    said.has_each(&["misses", "touches"]);
}
