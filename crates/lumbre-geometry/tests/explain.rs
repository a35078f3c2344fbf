//! What an explanation promises: its hits are those of the search, to the bit; what it says of the other crossings is true; and its
//! coefficients vanish at its roots.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::collections::BTreeMap;

use lumbre_geometry::{
    Candidate, Csg, Cuboid, Explanation, Fate, Leaf, PlacedShape, Plane, Ray, Remark, Root, Roots, Shape,
    ShapeError, Sphere, Step, Topic, Torus, Triangle, Value,
};
use lumbre_math::random::RandomStream;
use lumbre_math::{DVec2, DVec3, Transform};

use crate::{contract, exactness};

fn is_long() -> bool {
    std::env::var_os("LUMBRE_LONG_TESTS").is_some()
}

fn number(steps: &[Step], symbol: &str) -> Option<f64> {
    let mut all = steps.iter().flat_map(|step| &step.quantities);
    all.find_map(|quantity| match quantity.value {
        Value::Number(number) if quantity.symbol == symbol => Some(number),
        _ => None,
    })
}

fn vector(steps: &[Step], symbol: &str) -> Option<DVec3> {
    let mut all = steps.iter().flat_map(|step| &step.quantities);
    all.find_map(|quantity| match quantity.value {
        Value::Vector(vector) if quantity.symbol == symbol => Some(vector),
        _ => None,
    })
}

/// Whether what is said of a crossing of `shape` holds, as far as rounding lets it be seen.
fn is_true(shape: &Shape, ray: &Ray, explanation: &Explanation, candidate: &Candidate) -> bool {
    let steps = &explanation.steps;
    let (t, p) = (candidate.t, ray.at(candidate.t));
    let slack = 1e-9 * (1.0 + ray.origin.length() + (t * ray.direction).length());
    let near = |a: f64, b: f64| (a - b).abs() <= slack;
    let along_axis = |p: DVec3| {
        let (first, axis) = (vector(steps, "P₁").unwrap(), vector(steps, "V").unwrap());
        (p - first).dot(axis)
    };
    match candidate.fate {
        Fate::Hit => candidate.root.is_some(),
        Fate::Behind => t < 0.0 && t < ray.t_min && 0.0 <= ray.t_min,
        Fate::BeforeRange { t_min } => t < t_min && t_min == ray.t_min,
        Fate::BeyondRange { t_max } => t > t_max && t_max == ray.t_max,
        Fate::OtherNappe { radius } => {
            let expected = number(steps, "r₁").unwrap() + number(steps, "k").unwrap() * along_axis(p);
            near(radius, expected) && radius <= slack
        }
        Fate::OutsideHeights { z, min, max } => {
            let expected = match shape {
                Shape::Sphere(sphere) => p.z - sphere.center().z,
                Shape::Paraboloid(_) => p.z,
                _ => along_axis(p),
            };
            near(z, expected) && (z < min + slack || max - slack < z)
        }
        Fate::OutsideSegment { v } => {
            let (first, second) = (vector(steps, "P₁").unwrap(), vector(steps, "P₂").unwrap());
            near(first.z + v * (second.z - first.z), p.z) && !(0.0..=1.0).contains(&v)
        }
        Fate::OutsideSweep { phi, max } => phi > max && phi <= std::f64::consts::TAU,
        Fate::OutsideRim { distance, radius } => {
            let center = match (shape, candidate.part) {
                (Shape::Disk(_), _) => vector(steps, "C"),
                (_, 1) => vector(steps, "P₁"),
                _ => vector(steps, "P₂").or(vector(steps, "P₁")),
            };
            near(distance, (p - center.unwrap()).length()) && distance > radius - slack
        }
        Fate::InsideHole { distance, radius } => {
            near(distance, (p - vector(steps, "C").unwrap()).length()) && distance < radius + slack
        }
        Fate::OutsideEdges { weights } => {
            let Shape::Triangle(triangle) = shape else { return false };
            let place: DVec3 = weights.iter().zip(triangle.corners()).map(|(w, p)| *w * p).sum();
            let size: f64 = weights.iter().map(|weight| weight.abs()).sum();
            weights.iter().any(|weight| *weight < 0.0) && (place - p).length() <= slack * size.max(1.0)
        }
        Fate::OutsidePatch { u, v } => {
            let Shape::BilinearPatch(patch) = shape else { return false };
            let [p00, p10, p01, p11] = patch.corners();
            let place = (1.0 - v) * ((1.0 - u) * p00 + u * p10) + v * ((1.0 - u) * p01 + u * p11);
            let is_outside = !(0.0..=1.0).contains(&u) || !(0.0..=1.0).contains(&v);
            is_outside && (place - p).length() <= 1e3 * slack * (1.0 + u * u + v * v)
        }
        Fate::OutsideSlab { axis, enter, leave } => {
            let (low, high) = (vector(steps, "L").unwrap(), vector(steps, "H").unwrap());
            (t < enter || leave < t) && (p[axis] < low[axis] + slack || p[axis] > high[axis] - slack)
        }
        Fate::OutsideBox { axis, value, min, max } => near(value, p[axis]) && (value < min || max < value),
        Fate::InsideSolid => {
            let nearest = shape.closest_point(&Transform::IDENTITY, p).unwrap();
            shape.contains(p) || nearest.distance <= slack
        }
        Fate::Shared { part } => {
            let is_it = |other: &&Candidate| other.t == t && other.part == part && other.fate == Fate::Hit;
            explanation.candidates.iter().any(|other| is_it(&other))
        }
        Fate::Flat | Fate::NotReturned => false,
        Fate::Touch
        | Fate::InsideOperand { .. }
        | Fate::OutsideOperand { .. }
        | Fate::Coincides { .. }
        | Fate::NoChange { .. } => {
            let Shape::Csg(csg) = shape else { return false };
            is_true_of_operands(csg, ray, explanation, candidate)
        }
    }
}

fn is_true_of_operands(csg: &Csg, ray: &Ray, explanation: &Explanation, candidate: &Candidate) -> bool {
    let (t, p) = (candidate.t, ray.at(candidate.t));
    let slack = 1e-9 * (1.0 + ray.origin.length() + (t * ray.direction).length());
    let leaf_of = |part: u32| csg.leaf_of(&Root { part, ..Root::at(t) }).unwrap().leaf;
    let own = leaf_of(candidate.part);
    let of_operand = |operand: usize| {
        let Leaf::Shape(placed) = &csg.leaves()[operand] else { panic!("none but shapes here") };
        let is_inside = placed.shape().contains(placed.world_from_object().inverse_point(p));
        (is_inside, placed.closest_point(p).unwrap().distance <= slack)
    };
    match candidate.fate {
        Fate::InsideOperand { operand } => {
            let (is_inside, is_close) = of_operand(operand);
            operand != own && (is_inside || is_close)
        }
        Fate::OutsideOperand { operand } => {
            let (is_inside, is_close) = of_operand(operand);
            operand != own && (!is_inside || is_close)
        }
        Fate::Coincides { operand } => explanation
            .candidates
            .iter()
            .any(|other| leaf_of(other.part) == operand && (other.t - t).abs() <= slack),
        Fate::NoChange { inside } => {
            let step = 10.0 * slack / ray.direction.length();
            csg.contains(ray.at(t - step)) == inside && csg.contains(ray.at(t + step)) == inside
        }
        Fate::Touch => of_operand(own).1,
        _ => false,
    }
}

fn name_of(fate: Fate) -> String {
    let name = format!("{fate:?}");
    name.split(' ').next().unwrap_or_default().to_owned()
}

/// Holds an explanation to the search; returns the number of hits.
fn hold(
    shape: &Shape,
    ray: &Ray,
    expected: &Roots,
    name: &str,
    fates: &mut BTreeMap<String, usize>,
) -> usize {
    let explanation = shape.explain(ray);
    let told: Vec<Root> = explanation.candidates.iter().filter_map(|candidate| candidate.root).collect();
    assert_eq!(told, expected.to_vec(), "{name}: {ray:?} {explanation:#?}");
    assert!(explanation.candidates.is_sorted_by(|a, b| a.t <= b.t), "{name}: {ray:?}");
    for candidate in &explanation.candidates {
        *fates.entry(name_of(candidate.fate)).or_default() += 1;
        assert!(
            is_true(shape, ray, &explanation, candidate),
            "{name}: {candidate:?} of {ray:?} {explanation:#?}"
        );
        if let Some(root) = candidate.root {
            assert_eq!((candidate.t.to_bits(), candidate.part), (root.t.to_bits(), root.part));
        }
    }
    let surface_step = explanation.steps.iter().find(|step| step.topic == Topic::Surface);
    let surface = expected.first().map(|root| shape.surface(ray, root));
    let told = surface_step.map(std::slice::from_ref);
    assert_eq!(told.and_then(|step| vector(step, "n")), surface.map(|surface| surface.normal), "{name}");
    assert_eq!(told.and_then(|step| vector(step, "p")), surface.map(|surface| surface.point), "{name}");
    assert_eq!(told.and_then(|step| number(step, "u")), surface.map(|surface| surface.uv.x), "{name}");

    // Of the whole line nothing is missing, whatever the range.
    if !matches!(shape, Shape::Csg(_)) {
        let mut on_line = Roots::new();
        shape.roots(&ray.with_range(f64::NEG_INFINITY, f64::INFINITY), &mut on_line);
        for root in on_line {
            let is_told = explanation.candidates.iter().any(|c| c.t == root.t && c.part == root.part);
            assert!(is_told, "{name}: {root:?} of {ray:?} {explanation:#?}");
        }
    }
    expected.len()
}

#[test]
fn an_explanation_has_the_hits_of_the_search_and_tells_the_truth_of_every_other_crossing() {
    let rays = if is_long() { 1250 } else { 40 };
    let (mut fates, mut hits_of) = (BTreeMap::new(), BTreeMap::<String, usize>::new());
    for subject in contract::subjects() {
        let mut random = subject.random(101);
        let mut hits = 0;
        for i in 0..rays {
            let map = {
                let turn = Transform::rotate(random.direction(), random.between(0.0, 360.0)).unwrap();
                let mut size = || 2f64.powf(random.between(-2.0, 2.0));
                let scale = Transform::scale(DVec3::new(size(), -size(), size())).unwrap();
                Transform::translate(3.0 * random.direction()) * turn * scale
            };
            let near = random.ray(&subject);
            let line = match i % 4 {
                // From far away.
                0 => Ray { origin: near.at(-1e5 * subject.reach() / near.direction.length()), ..near },
                // Along an axis of the object.
                1 => Ray { direction: subject.placed.world_from_object().vector(DVec3::AXES[i % 3]), ..near },
                _ => near,
            };
            let shape = subject.placed.shape();
            let to = map * subject.placed.world_from_object();
            let placed = PlacedShape::new(shape.clone(), to);
            let t_of = |distance: f64| distance * subject.reach() / near.direction.length();
            let range = match i % 3 {
                0 => (f64::NEG_INFINITY, f64::INFINITY),
                1 => (0.0, f64::INFINITY),
                _ => (t_of(random.between(-1.0, 0.5)), t_of(random.between(0.5, 2.0))),
            };
            let ray = Ray {
                origin: map.point(line.origin),
                direction: map.vector(line.direction),
                ..line.with_range(range.0, range.1)
            };
            let mut expected = Roots::new();
            placed.roots(&ray, &mut expected);
            hits += hold(shape, &placed.object_ray(&ray), &expected, &subject.name, &mut fates);
        }
        let shape = subject.name.split(',').next().unwrap().to_owned();
        *hits_of.entry(shape).or_insert(0) += hits;
    }
    assert!(hits_of.values().all(|&hits| hits > 15), "{hits_of:?}");
    println!("{fates:#?}");
    let common = [
        "Hit",
        "Behind",
        "BeforeRange",
        "BeyondRange",
        "OtherNappe",
        "OutsideHeights",
        "OutsideSegment",
        "OutsideSweep",
        "OutsideRim",
        "InsideHole",
        "OutsideEdges",
        "OutsidePatch",
        "OutsideSlab",
        "OutsideBox",
        "InsideSolid",
        "InsideOperand",
        "OutsideOperand",
    ];
    for fate in common {
        assert!(fates.get(fate).is_some_and(|&times| times > 10), "{fate}: {fates:?}");
    }
}

#[test]
fn the_coefficients_vanish_at_the_roots_in_exact_arithmetic() {
    let mut random = exactness::Random(RandomStream::new(11));
    let (mut vanished, mut nearby, mut twofold) = (0, 0, 0);
    for round in 0..if is_long() { 200 } else { 6 } {
        let slenderness = 10f64.powf(random.between(0.0, 6.0));
        for subject in exactness::subjects(&mut random, slenderness) {
            for i in 0..12 {
                let uv = DVec2::new(random.between(0.0, 1.0), random.between(0.0, 1.0));
                let at = subject.shape.surface_at(0, uv).map_or(DVec3::ZERO, |s| s.point);
                let spread = if i % 3 == 0 { 10f64.powf(random.between(-12.0, 0.0)) } else { 1.0 };
                let through = at + spread * subject.size * random.vector();
                let direction = random.vector();
                let away = 10f64.powf(random.between(-1.0, if round % 2 == 0 { 1.0 } else { 9.0 }));
                let ray = Ray::new(through - away * direction, direction);
                let steps = subject.shape.explain(&ray).steps;
                vanished += check_equation(&steps, &ray, &subject, &mut nearby, &mut twofold);
            }
        }
    }
    println!("{vanished} {nearby} {twofold}");
    assert!(vanished > 600 && nearby > 100 && twofold > 10, "{vanished} {nearby} {twofold}");
}

/// Puts the roots into the equation that is told; returns how many there are.
fn check_equation(
    steps: &[Step],
    ray: &Ray,
    subject: &exactness::Subject,
    nearby: &mut usize,
    twofold: &mut usize,
) -> usize {
    let step = |topic: Topic| steps.iter().find(|step| step.topic == topic).map(std::slice::from_ref);
    let equation = step(Topic::Quadratic).unwrap();
    let [a, h, c] = ["a", "h", "c"].map(|symbol| number(equation, symbol).unwrap());
    let start = number(step(Topic::SetUp).unwrap(), "t₀").unwrap_or(0.0);
    let is_twofold = equation[0].remarks.contains(&Remark::TwicePrecision);
    *nearby += usize::from(start != 0.0);
    *twofold += usize::from(is_twofold);
    let roots = step(Topic::Roots).unwrap();
    let mut count = 0;
    for t in ["t₁", "t₂"].into_iter().filter_map(|symbol| number(roots, symbol)) {
        use exactness::Exact;
        let s = &Exact::from(t) - &Exact::from(start);
        let linear = &(&Exact::from(a) * &s) + &Exact::from(2.0 * h);
        let value = (&(&linear * &s) + &Exact::from(c)).value();
        let s = s.value().abs();
        // What the coefficients may be off by, in units of the unit roundoff.
        let [a_error, h_error, c_error] = match ["ε₂", "ε₁", "ε₀"].map(|symbol| number(equation, symbol))
        {
            [Some(a), Some(h), Some(c)] => [a, h, c],
            _ if is_twofold => [a, h, c].map(|x| 4.0 * x.abs()),
            _ => {
                let symbol = if start == 0.0 { "w" } else { "w₀" };
                let w = vector(step(Topic::SetUp).unwrap(), symbol).unwrap().length();
                let (d, r) = (ray.direction.length(), number(steps, "r").unwrap());
                [d * d, w * d, w * w + r * r].map(|x| 16.0 * x)
            }
        };
        let slope = 2.0 * (a * s.copysign(t - start) + h).abs();
        let last_place = f64::EPSILON * (t.abs() + start.abs() * f64::EPSILON);
        let bound = 0.5 * f64::EPSILON * (a_error * s * s + 2.0 * h_error * s + c_error)
            + 8.0 * slope * last_place
            + a.abs() * last_place * last_place;
        assert!(value.abs() <= bound, "{}: {value} {bound} at {t} of {ray:?} {steps:#?}", subject.name);
        count += 1;
    }
    count
}

#[test]
fn the_quartic_vanishes_at_its_roots() {
    let mut random = exactness::Random(RandomStream::new(12));
    let mut count = 0;
    for i in 0..if is_long() { 20_000 } else { 600 } {
        let (major, minor) = (random.between(0.5, 2.0), random.between(0.2, 2.5));
        let torus = Shape::from(Torus::new(random.vector(), random.vector(), major, minor).unwrap());
        let (through, direction) = (2.0 * random.vector(), random.vector());
        let ray = Ray::new(through - 10f64.powi(i % 7) * direction, direction);
        let steps = torus.explain(&ray).steps;
        let Some(quartic) = steps.iter().find(|step| step.topic == Topic::Quartic) else { continue };
        let [a2, a1, a0] =
            ["a₂", "a₁", "a₀"].map(|symbol| number(std::slice::from_ref(quartic), symbol).unwrap());
        let roots = steps.iter().find(|step| step.topic == Topic::QuarticRoots).unwrap();
        for s in
            ["s₁", "s₂", "s₃", "s₄"].into_iter().filter_map(|name| number(std::slice::from_ref(roots), name))
        {
            use exactness::Exact;
            let s_exact = Exact::from(s);
            let square = &s_exact * &s_exact;
            let value = &(&(&(&square + &Exact::from(a2)) * &square) + &(&Exact::from(a1) * &s_exact))
                + &Exact::from(a0);
            let size = (major + minor).powi(4);
            assert!(value.value().abs() <= 1e-13 * size, "{} {size} {steps:#?}", value.value());
            count += 1;
        }
    }
    assert!(count > 500, "{count}");
}

#[test]
fn a_sphere_is_explained_as_on_paper() {
    let sphere = Shape::from(Sphere::new(DVec3::ZERO, 1.0).unwrap());
    let explanation = sphere.explain(&Ray::new(DVec3::new(0.0, 0.0, -5.0), DVec3::Z));
    let steps = &explanation.steps;
    for (symbol, expected) in
        [("a", 1.0), ("h", -5.0), ("c", 24.0), ("Δ", 1.0), ("q", 6.0), ("t₁", 4.0), ("t₂", 6.0)]
    {
        assert_eq!(number(steps, symbol), Some(expected), "{symbol}");
    }
    let schoolbook: Vec<_> = steps
        .iter()
        .flat_map(|step| &step.quantities)
        .filter_map(|quantity| quantity.schoolbook.clone())
        .collect();
    assert_eq!(schoolbook[0], ("b = 2·(w·D)".into(), Value::Number(-10.0)));
    assert_eq!(schoolbook[1], ("b² − 4·a·c".into(), Value::Number(4.0)));
    assert_eq!(schoolbook[2], ("(−b − √(b² − 4·a·c))/(2·a)".into(), Value::Number(4.0)));
    assert_eq!(explanation.candidates.len(), 2);
    assert!(explanation.candidates.iter().all(|candidate| candidate.fate == Fate::Hit));
    assert_eq!(vector(steps, "n"), Some(DVec3::NEG_Z));

    let behind = sphere.explain(&Ray::new(DVec3::new(0.0, 0.0, 0.5), DVec3::Z));
    let fates: Vec<_> = behind.candidates.iter().map(|candidate| (candidate.t, candidate.fate)).collect();
    assert_eq!(fates, [(-1.5, Fate::Behind), (0.5, Fate::Hit)]);
}

#[test]
fn the_textbook_loses_a_small_distant_sphere_and_it_is_said() {
    let pea = Shape::from(Sphere::new(DVec3::new(0.0, 0.0, 3e9), 0.125).unwrap());
    let explanation = pea.explain(&Ray::new(DVec3::new(0.0625, 0.0, 0.0), DVec3::Z));
    let remarks: Vec<_> = explanation.steps.iter().flat_map(|step| step.remarks.clone()).collect();
    let is_said = |remark: &Remark| matches!(remark, Remark::Cancellation { digits } if *digits > 5.0);
    assert!(remarks.iter().any(is_said), "{explanation:#?}");
    // The discriminant has digits, the textbook's has none.
    let discriminant = explanation.steps.iter().find(|step| step.topic == Topic::Discriminant).unwrap();
    let told = discriminant.quantities.iter().find(|quantity| quantity.symbol == "Δ").unwrap();
    let expected = 0.125 * 0.125 - 0.0625 * 0.0625;
    assert_eq!(told.value, Value::Number(expected));
    assert_eq!(told.schoolbook.as_ref().unwrap().1, Value::Number(0.0));
    let hits = explanation.candidates.iter().filter(|candidate| candidate.fate == Fate::Hit).count();
    assert_eq!(hits, 2);
}

#[test]
fn a_triangle_is_explained_by_three_tests_that_agree() {
    let v = DVec3::new;
    let triangle = Shape::from(Triangle::new(v(0.0, 0.0, 6.0), v(4.0, 0.0, 6.0), v(0.0, 2.0, 6.0)).unwrap());
    let explanation = triangle.explain(&Ray::new(v(1.0, 0.5, 0.0), v(0.0, 0.0, 2.0)));
    let tests = [Topic::EdgeFunctions, Topic::MollerTrumbore, Topic::PlaneAndSides];
    for topic in tests {
        let step = explanation.steps.iter().find(|step| step.topic == topic).unwrap();
        let numbers = ["t", "b₁", "b₂"].map(|symbol| number(std::slice::from_ref(step), symbol).unwrap());
        assert_eq!(numbers, [3.0, 0.25, 0.25], "{topic:?}");
        assert!(step.remarks.is_empty(), "{step:?}");
    }
    let beside = triangle.explain(&Ray::new(v(3.0, 1.5, 0.0), v(0.0, 0.0, 2.0)));
    let [only] = &beside.candidates[..] else { panic!("{beside:#?}") };
    assert_eq!(only.fate, Fate::OutsideEdges { weights: [-0.5, 0.75, 0.75] });
}

#[test]
fn a_direction_of_any_length_is_explained_and_one_that_is_none_is_said_to_be() {
    let sphere = Shape::from(Sphere::new(DVec3::new(0.0, 0.0, 5.0), 2.0).unwrap());
    for length in [1e-200, 1e200] {
        let ray = Ray::new(DVec3::ZERO, DVec3::new(0.0, 0.0, length));
        let explanation = sphere.explain(&ray);
        let mut expected = Roots::new();
        sphere.roots(&ray, &mut expected);
        let told: Vec<_> = explanation.candidates.iter().filter_map(|candidate| candidate.root).collect();
        assert_eq!(told, expected.to_vec());
        assert_eq!(told.len(), 2);
        assert_eq!(explanation.steps[0].topic, Topic::ScaledRay);
        let none = sphere.explain(&ray.with_range(0.0, 0.5 * told[0].t));
        assert!(none.candidates.iter().all(|candidate| matches!(candidate.fate, Fate::BeyondRange { .. })));
        assert_eq!(none.candidates.len(), 2);
    }
    for ray in [
        Ray::new(DVec3::ZERO, DVec3::ZERO),
        Ray::new(DVec3::NAN, DVec3::Z),
        Ray::new(DVec3::ZERO, DVec3::new(0.0, f64::INFINITY, 1.0)),
        Ray::new(DVec3::ZERO, DVec3::Z).with_range(f64::NAN, 1.0),
    ] {
        for subject in contract::subjects().iter().step_by(8) {
            let explanation = subject.placed.shape().explain(&ray);
            assert!(explanation.candidates.is_empty());
            assert_eq!(explanation.steps[0].remarks, [Remark::NoRay], "{ray:?}");
        }
    }
}

/// The fates of the crossings of a CSG tree with the x axis, with the interval of the result.
fn fates_of(csg: Result<Csg, ShapeError>, ray: &Ray) -> (Vec<(f64, Fate)>, Vec<[f64; 2]>) {
    let explanation = Shape::from(csg.unwrap()).explain(ray);
    let fates = explanation.candidates.iter().map(|candidate| (candidate.t, candidate.fate)).collect();
    let result = explanation.steps[0].quantities.iter().find(|quantity| quantity.symbol == "I").unwrap();
    let Value::Intervals(intervals) = &result.value else { panic!("{result:?}") };
    (fates, intervals.clone())
}

#[test]
fn a_crossing_of_an_operand_that_is_none_of_the_result_names_the_operand_that_is_why() {
    let leaf = |shape: Result<Shape, ShapeError>| {
        Csg::leaf(PlacedShape::new(shape.unwrap(), Transform::IDENTITY)).unwrap()
    };
    let ball =
        |x: f64, y: f64, radius: f64| leaf(Sphere::new(DVec3::new(x, y, 0.0), radius).map(Shape::from));
    let slab = |from: f64, to: f64| {
        leaf(Cuboid::new(DVec3::new(from, -1.0, -1.0), DVec3::new(to, 3.0, 3.0)).map(Shape::from))
    };
    let ray = Ray::new(DVec3::ZERO, DVec3::X);
    // From 2 to 6 and from 4 to 9.
    let pair = || vec![ball(4.0, 0.0, 2.0), ball(6.5, 0.0, 2.5)];
    let (inside, outside) =
        (|operand| Fate::InsideOperand { operand }, |operand| Fate::OutsideOperand { operand });
    assert_eq!(
        fates_of(Csg::union(pair()), &ray),
        (vec![(2.0, Fate::Hit), (4.0, inside(0)), (6.0, inside(1)), (9.0, Fate::Hit)], vec![[2.0, 9.0]])
    );
    assert_eq!(
        fates_of(Csg::difference(pair()), &ray),
        (vec![(2.0, Fate::Hit), (4.0, Fate::Hit), (6.0, inside(1)), (9.0, outside(0))], vec![[2.0, 4.0]])
    );
    assert_eq!(
        fates_of(Csg::intersection(pair()), &ray.with_range(5.0, f64::INFINITY)),
        (
            vec![
                (2.0, Fate::BeforeRange { t_min: 5.0 }),
                (4.0, Fate::BeforeRange { t_min: 5.0 }),
                (6.0, Fate::Hit),
                (9.0, outside(0))
            ],
            vec![[4.0, 6.0]]
        )
    );
    // Two boxes side by side are one.
    let (fates, interval) = fates_of(Csg::union(vec![slab(1.0, 2.0), slab(2.0, 5.0)]), &ray);
    assert_eq!(interval, [[1.0, 5.0]]);
    let coincides = |operand| Fate::Coincides { operand };
    assert_eq!(fates, [(1.0, Fate::Hit), (2.0, coincides(1)), (2.0, coincides(0)), (5.0, Fate::Hit)]);
    // A ball that is only touched, and one that is not met.
    let (fates, interval) = fates_of(Csg::union(vec![slab(1.0, 2.0), ball(7.0, 2.0, 2.0)]), &ray);
    assert_eq!(interval, [[1.0, 2.0]]);
    assert_eq!(fates, [(1.0, Fate::Hit), (2.0, Fate::Hit), (7.0, Fate::Touch)]);
    let far = Shape::from(Csg::union(vec![slab(1.0, 2.0), ball(7.0, 9.0, 2.0)]).unwrap()).explain(&ray);
    assert_eq!(far.steps[0].remarks, [Remark::NotLookedAt { operand: 1 }]);
    assert!(far.operands[0].explanation.is_some() && far.operands[1].explanation.is_none());
    // Half a space holds the ray's beginning.
    let below = leaf(Plane::new(DVec3::new(3.0, 0.0, 0.0), DVec3::X).map(Shape::from));
    let (fates, interval) = fates_of(Csg::difference(vec![below, slab(1.0, 2.0)]), &ray);
    assert_eq!(interval, [[f64::NEG_INFINITY, 1.0], [2.0, 3.0]]);
    assert!(fates.iter().all(|(_, fate)| *fate == Fate::Hit) && fates.len() == 3);
}
