//! What an explanation promises: its hits are those of the search, to the bit; what it says of the other crossings is
//! true; and its coefficients vanish at its roots.

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
            let (low, high) = (vector(steps, "P₀").unwrap(), vector(steps, "P₁").unwrap());
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
    assert_eq!(told.and_then(|step| vector(step, "N")), surface.map(|surface| surface.normal), "{name}");
    assert_eq!(told.and_then(|step| vector(step, "P")), surface.map(|surface| surface.point), "{name}");
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
fn explanations_have_the_hits_and_true_reasons_for_others() {
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

/// Puts the roots into the equation of the explanation; returns how many there are.
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
                let symbol = if start == 0.0 { "W" } else { "W₀" };
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
    assert_eq!(schoolbook[0], ("b = 2·(W·D)".into(), Value::Number(-10.0)));
    assert_eq!(schoolbook[1], ("b² − 4·a·c".into(), Value::Number(4.0)));
    assert_eq!(schoolbook[2], ("(−b − √(b² − 4·a·c))/(2·a)".into(), Value::Number(4.0)));
    assert_eq!(explanation.candidates.len(), 2);
    assert!(explanation.candidates.iter().all(|candidate| candidate.fate == Fate::Hit));
    assert_eq!(vector(steps, "N"), Some(DVec3::NEG_Z));

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
fn directions_of_any_length_are_explained() {
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
fn a_rejected_crossing_names_the_deciding_operand() {
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

/// A shape of whole numbers, with a place on it that is whole too, directions along it, and the tip of a cone.
struct Whole {
    subject: exactness::Subject,
    on: Vec<DVec3>,
    along: Vec<DVec3>,
    tip: Option<DVec3>,
    has_caps: bool,
}

fn whole_shapes() -> Vec<Whole> {
    let v = DVec3::new;
    let axial = |p1: DVec3, p2: DVec3, r1: f64, r2: f64| exactness::axial("axial", p1, p2, r1, r2);
    let capped = |p1: DVec3, p2: DVec3, r1: f64, r2: f64| {
        let shape: Result<Shape, ShapeError> = if r1 == r2 {
            lumbre_geometry::Cylinder::new(p1, p2, r1, true).map(Shape::from)
        } else {
            lumbre_geometry::Cone::new(p1, p2, r1, r2, true).map(Shape::from)
        };
        exactness::axial("capped", p1, p2, r1, r2).with_shape(shape.unwrap())
    };
    let whole = |subject, on: &[DVec3], along: &[DVec3], tip| Whole {
        subject,
        on: on.to_vec(),
        along: along.to_vec(),
        tip,
        has_caps: false,
    };
    let mut all = vec![
        whole(
            exactness::sphere(v(1.0, 2.0, -1.0), 3.0),
            &[v(4.0, 2.0, -1.0), v(2.0, 4.0, 1.0), v(1.0, 2.0, 2.0)],
            &[v(0.0, 1.0, 0.0), v(2.0, -1.0, 0.0), v(1.0, 0.0, 0.0)],
            None,
        ),
        whole(
            exactness::paraboloid(2.0, 4.0),
            &[v(0.0, 0.0, 0.0), v(1.0, 0.0, 1.0), v(0.0, -2.0, 4.0)],
            &[DVec3::Z, v(1.0, 0.0, 2.0), DVec3::X],
            None,
        ),
        // Its generators go through (1, 0, 0): one is along (0, 1, 1).
        whole(
            exactness::hyperboloid(v(1.0, -2.0, -2.0), v(1.0, 2.0, 2.0)),
            &[v(1.0, 0.0, 0.0), v(0.0, 0.0, 0.0), v(2.0, 0.0, 0.0)],
            &[v(0.0, 1.0, 1.0), v(0.0, -1.0, 1.0), DVec3::Z],
            None,
        ),
        whole(
            exactness::quadric("pipe", [1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -25.0], 5.0),
            &[v(3.0, 4.0, 0.0), v(0.0, 5.0, 7.0), v(1.0, 1.0, 1.0), v(9.0, 0.0, 0.0)],
            &[DVec3::Z, v(4.0, -3.0, 0.0), v(4.0, -3.0, 5.0)],
            None,
        ),
        whole(
            exactness::quadric("saddle", [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0], 1.0),
            &[DVec3::ZERO, v(2.0, 3.0, 6.0), v(1.0, 1.0, 4.0)],
            &[DVec3::X, DVec3::Y, v(1.0, 0.0, 3.0)],
            None,
        ),
    ];
    // Along z, and along (2, 1, 2), which is 3 long.
    for (first, step) in [(v(1.0, -2.0, 0.0), v(0.0, 0.0, 6.0)), (v(0.0, 1.0, -1.0), v(4.0, 2.0, 4.0))] {
        let second = first + step;
        let side = if step.x == 0.0 { v(3.0, 0.0, 0.0) } else { v(2.0, -2.0, -1.0) };
        for is_capped in [false, true] {
            let made = |r1: f64, r2: f64| {
                if is_capped { capped(first, second, r1, r2) } else { axial(first, second, r1, r2) }
            };
            all.push(Whole {
                has_caps: is_capped,
                ..whole(
                    made(3.0, 3.0),
                    &[first + side, first, first + 2.0 * side],
                    &[step, side, step + side],
                    None,
                )
            });
            all.push(Whole {
                has_caps: is_capped,
                ..whole(
                    made(3.0, 0.0),
                    &[second, first + side, first, first + 2.0 * side],
                    &[step - side, step, side, step + side],
                    Some(second),
                )
            });
            all.push(Whole {
                has_caps: is_capped,
                ..whole(
                    made(3.0, 6.0),
                    &[first - step, first + side, first, second + 2.0 * side],
                    &[step + side, step, side, step - side],
                    Some(first - step),
                )
            });
        }
    }
    all
}

/// What the remarks and fates of an explanation claim of a ray of whole numbers, held to exact arithmetic; counts them
/// by name.
fn hold_claims(whole: &Whole, ray: &Ray, said: &mut BTreeMap<&'static str, usize>) {
    let shape = &whole.subject.shape;
    let explanation = shape.explain(ray);
    let [a, h, c] = whole.subject.coefficients(ray);
    let delta = &(&h * &h) - &(&a * &c);
    let sign = |x: &exactness::Exact| x.value().partial_cmp(&0.0).unwrap() as i32;
    let (a, h, c, delta) =
        (sign(&a), sign(&h), sign(&c), (sign(&delta), a.value(), h.value(), delta.value()));
    let (delta, a_value, h_value, delta_value) = delta;
    let context =
        || format!("{}: {ray:?} a {a} h {h} c {c} Δ {delta} {:#?}", whole.subject.name, explanation.steps);
    let roots = explanation.steps.iter().find(|step| step.topic == Topic::Roots).unwrap();
    let discriminant = explanation.steps.iter().find(|step| step.topic == Topic::Discriminant).unwrap();
    let mut count = |name| *said.entry(name).or_default() += 1;
    // Of the line, exactly one thing is said, and it is so.
    let mut claims = 0;
    for remark in &roots.remarks {
        let (name, is_so) = match *remark {
            Remark::Misses => ("misses", delta < 0 || (a, h) == (0, 0) && c > 0),
            Remark::InsideThroughout => ("inside", (a, h) == (0, 0) && c < 0),
            Remark::InSurface => ("in the surface", (a, h, c) == (0, 0, 0) && !whole.has_caps),
            Remark::InCappedSide => {
                ("in a side", (a, h, c) == (0, 0, 0) && whole.has_caps && whole.tip.is_none())
            }
            Remark::AlongGenerator => {
                ("a generator", (a, h, c) == (0, 0, 0) && whole.has_caps && whole.tip.is_some())
            }
            Remark::Touches | Remark::ThroughTip => {
                let tip = whole.tip.map(|tip| (ray.at(-h_value / a_value) - tip).length());
                let is_at_tip = tip.is_some_and(|distance| distance < 1e-9);
                let is_tip = *remark == Remark::ThroughTip;
                (
                    if is_tip { "through the tip" } else { "touches" },
                    delta == 0 && a != 0 && is_at_tip == is_tip,
                )
            }
            Remark::AtInfinity => ("at infinity", a == 0 && h != 0),
            Remark::Cancellation { digits } => {
                // By the larger of both errors of the textbook's roots.
                let root = |sign: f64| (-h_value + sign * delta_value.sqrt()) / a_value;
                let [plus, minus] = [root(1.0), root(-1.0)];
                let q = -(h_value + delta_value.sqrt().copysign(h_value));
                let c_value = whole.subject.coefficients(ray)[2].value();
                let exact = [q / a_value, c_value / q];
                let mut off: f64 = 0.0;
                for quantity in roots.quantities.iter().filter(|quantity| quantity.symbol.starts_with('t')) {
                    let Some((_, Value::Number(theirs))) = &quantity.schoolbook else { continue };
                    let nearest =
                        exact.into_iter().min_by(|x, y| (x - theirs).abs().total_cmp(&(y - theirs).abs()));
                    off = off.max(((theirs - nearest.unwrap()) / nearest.unwrap()).abs());
                }
                let expected = (off / (0.5 * f64::EPSILON)).log10().min(16.0);
                assert!((digits - expected).abs() < 0.5, "{digits} {expected} {plus} {minus} {}", context());
                ("loses digits", true)
            }
            ref other => panic!("{other:?} {}", context()),
        };
        assert!(is_so, "{name}: {}", context());
        claims += usize::from(!matches!(remark, Remark::Cancellation { .. } | Remark::AtInfinity));
        count(name);
    }
    let crosses_twice = delta > 0 && a != 0;
    let expected = usize::from(!(crosses_twice || a == 0 && h != 0));
    assert_eq!(claims, expected, "{}", context());
    for remark in &discriminant.remarks {
        let theirs =
            match &discriminant.quantities.iter().find(|quantity| quantity.symbol == "Δ").unwrap().schoolbook
            {
                Some((_, Value::Number(theirs))) => *theirs,
                other => panic!("{other:?}"),
            };
        match remark {
            Remark::SchoolbookHits => assert!(theirs >= 0.0 && delta < 0, "{}", context()),
            Remark::SchoolbookMisses => assert!(theirs < 0.0 && delta >= 0, "{}", context()),
            other => panic!("{other:?} {}", context()),
        }
        count("rounding decides for the textbook");
    }
    for candidate in &explanation.candidates {
        assert!(is_true(shape, ray, &explanation, candidate), "{candidate:?} {}", context());
        count(match candidate.fate {
            Fate::Hit => "hit",
            Fate::Behind => "behind",
            Fate::OtherNappe { .. } => "other nappe",
            _ => "another fate",
        });
    }
}

#[test]
fn what_is_said_of_degenerate_lines_of_whole_numbers_is_so() {
    let mut random = RandomStream::new(31);
    let mut whole = |most: usize| (random.next_below(2 * most + 1) as f64) - most as f64;
    let shapes = whole_shapes();
    let mut said = BTreeMap::new();
    let mut rays = 0;
    for round in 0..200 {
        for shape in &shapes {
            let on = shape.on[round % shape.on.len()];
            let along = shape.along[round / shape.on.len() % shape.along.len()];
            let direction = match round % 3 {
                // Along, or nearly: a whole number away.
                0 | 1 => along * [1.0, -2.0, 3.0][round % 5 % 3],
                _ => DVec3::new(whole(3), whole(3), whole(3)),
            };
            let beside = if round % 4 == 3 { DVec3::new(whole(2), whole(2), whole(2)) } else { DVec3::ZERO };
            if direction == DVec3::ZERO {
                continue;
            }
            // From near and from a million lengths away.
            let back = [0.0, 1.0, 5.0, 1e6][round / 3 % 4];
            hold_claims(shape, &Ray::new(on + beside - back * direction, direction), &mut said);
            rays += 1;
        }
    }
    println!("{rays} {said:#?}");
    assert!(rays > 2500, "{rays}");
    let common = [
        "misses",
        "inside",
        "in the surface",
        "in a side",
        "a generator",
        "touches",
        "through the tip",
        "at infinity",
        "behind",
    ];
    for name in common {
        assert!(said.get(name).is_some_and(|count| *count >= 10), "{name}: {said:?}");
    }
}
