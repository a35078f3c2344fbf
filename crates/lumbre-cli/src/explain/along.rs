//! What a shape's equation is along the line of a ray: a function of t that is 0 where the line crosses the surface.

use lumbre::geometry::{BilinearPatch, Capsule, Explanation, Shape, Topic, Torus, Value as Found};
use lumbre::{DVec3, Ray};

/// A shape along the line of a ray.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Along {
    /// `F(t)`, whose formula is in the symbols of the explanation.
    Function { formula: &'static str, pieces: Vec<Piece> },
    /// The intervals of t within each of several things, and within all of them.
    Intervals(Vec<(String, Vec<[f64; 2]>)>),
}

/// A polynomial from a `t` on, as far as the next piece.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Piece {
    pub(super) from: f64,
    /// Its variable is `scale·t − start`.
    pub(super) scale: f64,
    pub(super) start: f64,
    /// The constant first.
    pub(super) coefficients: Vec<f64>,
}

impl Along {
    /// The function's value.
    pub(super) fn at(&self, t: f64) -> Option<f64> {
        let Self::Function { pieces, .. } = self else { return None };
        let piece = pieces.iter().rev().find(|piece| piece.from <= t).or(pieces.first())?;
        let x = piece.scale * t - piece.start;
        Some(piece.coefficients.iter().rev().fold(0.0, |sum, coefficient| sum * x + coefficient))
    }
}

/// What stands in the formula of a function, and in no step of the explanation.
pub(super) fn definitions(formula: &str) -> &'static [&'static str] {
    match formula {
        OF_PATCH => {
            &["O + t·D = P₀₀ + α·E₁ + β·E₂ + γ·E₃", "E₁ = P₁₀ − P₀₀", "E₂ = P₀₁ − P₀₀", "E₃ = P₁₁ − P₁₀ − E₂"]
        }
        OF_FLAT_PATCH => &["E₁ = P₁₀ − P₀₀", "E₂ = P₀₁ − P₀₀"],
        OF_CAPSULE => &["P = O + t·D", "Q = P₁ + min(max((P − P₁)·V, 0), |P₂ − P₁|)·V"],
        OF_TORUS => &["P = O + t·D"],
        _ => &[],
    }
}

const OF_PATCH: &str = "γ − α·β";
const OF_FLAT_PATCH: &str = "(O + t·D − P₀₀)·(E₁×E₂)";
/// `Q` is the nearest point of the segment between both ends.
const OF_CAPSULE: &str = "|P − Q|² − r₁²";
const OF_TORUS: &str = "(|P − C|² + R² − r²)² − 4·R²·|(P − C)×V|²";

fn everywhere(start: f64, coefficients: impl Into<Vec<f64>>) -> Vec<Piece> {
    vec![Piece { from: f64::NEG_INFINITY, scale: 1.0, start, coefficients: coefficients.into() }]
}

/// The shape along the line of a ray, both in the shape's own space, as it is explained; `None` where no function is at
/// hand.
pub(super) fn along(shape: &Shape, explanation: &Explanation, ray: &Ray) -> Option<Along> {
    let number = |topic: Topic, symbol: &str| number(explanation, topic, symbol);
    // The steps of a ray whose direction was scaled are of that, and have other t.
    let factor = number(Topic::ScaledRay, "λ").unwrap_or(1.0);
    let direction = vector(explanation, Topic::ScaledRay, "D").unwrap_or(ray.direction);
    let ray = &Ray { direction, ..*ray };
    let function = |formula: &'static str, pieces: Vec<Piece>| Along::Function { formula, pieces };
    let mut found = match shape {
        Shape::Plane(_) | Shape::Disk(_) => {
            let (along, away) = (number(Topic::Plane, "μ")?, number(Topic::Plane, "δ")?);
            function("t·μ − δ", everywhere(0.0, [-away, along]))
        }
        Shape::Triangle(triangle) => {
            let [a, b, c] = triangle.corners();
            let normal = (b - a).cross(c - a);
            let coefficients = [normal.dot(ray.origin - a), normal.dot(ray.direction)];
            function("(O + t·D − P₀)·n", everywhere(0.0, coefficients))
        }
        Shape::Cuboid(_) => Along::Intervals(slabs(explanation, ray, factor)?),
        Shape::Csg(_) => Along::Intervals(of_operands(explanation)?),
        Shape::Torus(torus) => function(OF_TORUS, quartic(torus, ray)),
        Shape::Capsule(capsule) => function(OF_CAPSULE, by_parts(capsule, explanation, ray)?),
        Shape::BilinearPatch(patch) => {
            let (formula, coefficients) = of_patch(patch, ray);
            function(formula, everywhere(0.0, coefficients))
        }
        _ => {
            let [a, h, c] = ["a", "h", "c"].map(|symbol| number(Topic::Quadratic, symbol));
            let (a, h, c) = (a?, h?, c?);
            let start = number(Topic::SetUp, "t₀");
            let formula = if start.is_some() {
                "a·(t − t₀)² + 2·h·(t − t₀) + c"
            } else {
                "a·t² + 2·h·t + c"
            };
            let coefficients = [c, 2.0 * h, a];
            function(formula, everywhere(start.unwrap_or(0.0), coefficients))
        }
    };
    if let Along::Function { pieces, .. } = &mut found {
        for piece in pieces {
            (piece.from, piece.scale) = (piece.from / factor, factor);
        }
    }
    let is_finite = match &found {
        Along::Function { pieces, .. } => pieces
            .iter()
            .all(|piece| piece.start.is_finite() && piece.coefficients.iter().all(|c| c.is_finite())),
        Along::Intervals(_) => true,
    };
    is_finite.then_some(found)
}

/// The first quantity with a symbol in the steps of a topic.
pub(super) fn value<'e>(explanation: &'e Explanation, topic: Topic, symbol: &str) -> Option<&'e Found> {
    let steps = explanation.steps.iter().filter(|step| step.topic == topic);
    let mut quantities = steps.flat_map(|step| &step.quantities);
    quantities.find(|quantity| quantity.symbol == symbol).map(|quantity| &quantity.value)
}

pub(super) fn number(explanation: &Explanation, topic: Topic, symbol: &str) -> Option<f64> {
    match value(explanation, topic, symbol)? {
        Found::Number(x) => Some(*x),
        _ => None,
    }
}

pub(super) fn vector(explanation: &Explanation, topic: Topic, symbol: &str) -> Option<DVec3> {
    match value(explanation, topic, symbol)? {
        Found::Vector(v) => Some(*v),
        _ => None,
    }
}

fn slabs(explanation: &Explanation, ray: &Ray, factor: f64) -> Option<Vec<(String, Vec<[f64; 2]>)>> {
    let corner = |symbol: &str| vector(explanation, Topic::Parameters, symbol);
    let (low, high) = (corner("P₀")?, corner("P₁")?);
    let mut within = [f64::NEG_INFINITY, f64::INFINITY];
    let mut rows = Vec::new();
    for (axis, [name, first, second]) in
        [["x", "x₀", "x₁"], ["y", "y₀", "y₁"], ["z", "z₀", "z₁"]].into_iter().enumerate()
    {
        let ends = [first, second].map(|symbol| number(explanation, Topic::Slabs, symbol));
        let slab = match ends {
            [Some(a), Some(b)] => Some([a.min(b) / factor, a.max(b) / factor]),
            // Parallel to both planes: between them all the way, or nowhere.
            _ if low[axis] <= ray.origin[axis] && ray.origin[axis] <= high[axis] => {
                Some([f64::NEG_INFINITY, f64::INFINITY])
            }
            _ => None,
        };
        let [from, to] = slab.unwrap_or([f64::INFINITY, f64::NEG_INFINITY]);
        within = [within[0].max(from), within[1].min(to)];
        rows.push((name.to_owned(), slab.into_iter().collect()));
    }
    let is_within = within[0] <= within[1];
    rows.push(("∩".to_owned(), if is_within { vec![within] } else { Vec::new() }));
    Some(rows)
}

fn of_operands(explanation: &Explanation) -> Option<Vec<(String, Vec<[f64; 2]>)>> {
    let step = explanation.steps.iter().find(|step| step.topic == Topic::Intervals)?;
    let rows = step.quantities.iter().filter_map(|quantity| match &quantity.value {
        Found::Intervals(intervals) => Some((quantity.symbol.to_string(), intervals.clone())),
        _ => None,
    });
    Some(rows.collect())
}

/// `(p·p + R² − r²)² − 4·R²·|p×V|²` for p = O + t·D − C, from the point that is nearest to the centre.
fn quartic(torus: &Torus, ray: &Ray) -> Vec<Piece> {
    let d = ray.direction;
    let (big, small) = (torus.major() * torus.major(), torus.minor() * torus.minor());
    let start = -(ray.origin - torus.center()).dot(d) / d.dot(d);
    let p = ray.at(start) - torus.center();
    let (across, offset) = (d.cross(torus.axis()), p.cross(torus.axis()));
    let (g, h, k) = (d.dot(d), p.dot(d), p.dot(p) + big - small);
    everywhere(
        start,
        [
            k * k - 4.0 * big * offset.dot(offset),
            4.0 * h * k - 8.0 * big * offset.dot(across),
            4.0 * h * h + 2.0 * g * k - 4.0 * big * across.dot(across),
            4.0 * g * h,
            g * g,
        ],
    )
}

/// The square of the distance from the segment in the middle of a capsule, less that of the radius: near one end, along
/// the side, and near the other end.
fn by_parts(capsule: &Capsule, explanation: &Explanation, ray: &Ray) -> Option<Vec<Piece>> {
    let end = |symbol: &str| vector(explanation, Topic::Parameters, symbol);
    let (first, second) = (end("P₁")?, end("P₂")?);
    let small = capsule.radius() * capsule.radius();
    let (o, d) = (ray.origin, ray.direction);
    let of_ball = |center: DVec3| {
        let w = o - center;
        vec![w.dot(w) - small, 2.0 * w.dot(d), d.dot(d)]
    };
    let segment = second - first;
    let axis = segment.normalize();
    let (offset, across) = ((o - first).cross(axis), d.cross(axis));
    let of_side = vec![offset.dot(offset) - small, 2.0 * offset.dot(across), across.dot(across)];
    let (height, rise) = ((o - first).dot(axis), d.dot(axis));
    let piece = |from: f64, coefficients: Vec<f64>| Piece { from, scale: 1.0, start: 0.0, coefficients };
    if rise == 0.0 {
        let coefficients = match () {
            () if height < 0.0 => of_ball(first),
            () if height > segment.length() => of_ball(second),
            () => of_side,
        };
        return Some(vec![piece(f64::NEG_INFINITY, coefficients)]);
    }
    let passes = [(-height / rise, first), ((segment.length() - height) / rise, second)];
    let [before, after] = if rise > 0.0 { passes } else { [passes[1], passes[0]] };
    Some(vec![
        piece(f64::NEG_INFINITY, of_ball(before.1)),
        piece(before.0, of_side),
        piece(after.0, of_ball(after.1)),
    ])
}

/// With P = P₀₀ + α·E₁ + β·E₂ + γ·E₃, the surface is where γ = α·β; where these three do not span space, it is in a
/// plane.
fn of_patch(patch: &BilinearPatch, ray: &Ray) -> (&'static str, Vec<f64>) {
    let [p00, p10, p01, p11] = patch.corners();
    let (e1, e2) = (p10 - p00, p01 - p00);
    let e3 = p11 - p10 - e2;
    let det = e1.cross(e2).dot(e3);
    let place = ray.origin - p00;
    let size = e1.length() * e2.length() * (e1.length() + e2.length() + e3.length());
    if det.abs() <= 1e-9 * size {
        let normal = e1.cross(e2);
        return (OF_FLAT_PATCH, vec![normal.dot(place), normal.dot(ray.direction)]);
    }
    // Each of the three is linear in t.
    let of = |row: DVec3| [row.dot(place) / det, row.dot(ray.direction) / det];
    let ([a0, a1], [b0, b1], [c0, c1]) = (of(e2.cross(e3)), of(e3.cross(e1)), of(e1.cross(e2)));
    (OF_PATCH, vec![c0 - a0 * b0, c1 - a0 * b1 - a1 * b0, -a1 * b1])
}

#[cfg(test)]
mod tests {
    use lumbre::geometry::{
        Cone, Cuboid, Cylinder, Disk, Hyperboloid, Paraboloid, Plane, Quadric, Sphere, Triangle,
    };
    use lumbre::math::random::RandomStream;

    use super::*;

    fn shapes() -> Vec<Shape> {
        let v = DVec3::new;
        vec![
            Sphere::new(v(0.5, -0.25, 0.75), 1.5).expect("a sphere").into(),
            Plane::new(v(0.0, 0.0, 0.5), v(0.5, 1.0, 3.0)).expect("a plane").into(),
            Disk::new(v(0.0, 0.0, 0.5), v(0.5, 1.0, 3.0), 2.5, 0.5).expect("a disk").into(),
            Cylinder::new(v(-1.0, 0.0, -1.0), v(1.0, 0.5, 1.5), 0.8, false).expect("a cylinder").into(),
            Cone::new(v(-1.0, 0.0, -1.0), v(1.0, 0.5, 1.5), 1.2, 0.4, false).expect("a cone").into(),
            Paraboloid::new(1.5, 0.0, 2.0, 360.0).expect("a paraboloid").into(),
            Hyperboloid::new(v(1.0, 0.5, -1.0), v(0.5, -1.0, 1.5), 360.0).expect("a hyperboloid").into(),
            Torus::new(v(0.1, 0.2, 0.3), v(0.0, 1.0, 2.0), 1.5, 0.5).expect("a torus").into(),
            Capsule::new(v(-1.0, 0.0, -1.0), v(1.0, 0.5, 1.5), 0.7).expect("a capsule").into(),
            BilinearPatch::new(v(-2.0, -2.0, 0.0), v(2.0, -2.0, 1.0), v(-2.0, 2.0, 1.0), v(2.0, 2.0, -1.0))
                .expect("a patch")
                .into(),
            BilinearPatch::new(v(-2.0, -2.0, 0.0), v(2.0, -2.0, 0.0), v(-2.0, 2.0, 0.0), v(2.0, 3.0, 0.0))
                .expect("a patch")
                .into(),
            Triangle::new(v(-2.0, -2.0, 0.0), v(3.0, -2.0, 1.0), v(-2.0, 3.0, 1.0))
                .expect("a triangle")
                .into(),
            Cuboid::new(v(-1.0, -1.5, -2.0), v(1.0, 1.5, 0.5)).expect("a box").into(),
        ]
    }

    #[test]
    fn the_function_changes_sign_at_each_crossing() {
        let mut random = RandomStream::new(11);
        for shape in shapes() {
            let mut roots = 0;
            for _ in 0..300 {
                let mut next = |size: f64| size * (2.0 * random.next_f64() - 1.0);
                let origin = DVec3::new(next(5.0), next(5.0), next(5.0));
                let target = DVec3::new(next(1.0), next(1.0), next(1.0));
                let ray = Ray::new(origin, 0.4 * (target - origin));
                let explanation = shape.explain(&ray);
                let along = along(&shape, &explanation, &ray).expect("it has one");
                for candidate in explanation.candidates.iter().filter(|candidate| candidate.root.is_some()) {
                    roots += 1;
                    let t = candidate.t;
                    let name = shape.name();
                    match &along {
                        Along::Function { .. } => {
                            let [before, there, after] =
                                [t - 1e-6, t, t + 1e-6].map(|t| along.at(t).expect("a function"));
                            assert!(
                                there.abs() <= 1e-3 * before.abs().max(after.abs()),
                                "{name} at {t}: {before} {there} {after}"
                            );
                            assert!(before * after < 0.0, "{name} at {t}: {before} and {after}");
                        }
                        Along::Intervals(rows) => {
                            let (_, all) = rows.last().expect("rows");
                            assert!(all.iter().flatten().any(|end| *end == t), "{name}: {t} in {rows:?}");
                        }
                    }
                }
            }
            assert!(roots > 50, "{}: {roots}", shape.name());
        }
    }

    #[test]
    fn a_scaled_direction_has_the_same_places() {
        let ball: Shape = Sphere::new(DVec3::ZERO, 1.0).expect("a ball").into();
        for size in [1e-200, 1e200] {
            let ray = Ray::new(DVec3::new(0.0, 0.0, -5.0), size * DVec3::Z);
            let along = along(&ball, &ball.explain(&ray), &ray).expect("it has one");
            assert!(along.at(4.0 / size).is_some_and(|f| f.abs() < 1e-9), "{along:?}");
            assert!(along.at(5.0 / size).is_some_and(|f| (f + 1.0).abs() < 1e-9), "{along:?}");
        }
    }

    #[test]
    fn a_quadric_has_its_equation() {
        let equation = [1.0, 1.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0];
        let shape: Shape = Quadric::new(equation, None).expect("a quadric").into();
        let ray = Ray::new(DVec3::new(-5.0, 0.0, 0.0), DVec3::X);
        let along = along(&shape, &shape.explain(&ray), &ray).expect("it has one");
        let Along::Function { formula, .. } = along else { panic!("{along:?}") };
        assert!(formula.starts_with("a·"), "{formula}");
    }

    #[test]
    fn what_is_defined_beside_a_formula_gives_its_numbers() {
        let (p00, p10, p01, p11) = (
            DVec3::new(-2.0, -2.0, 0.0),
            DVec3::new(2.0, -2.0, 1.0),
            DVec3::new(-2.0, 2.0, 1.0),
            DVec3::new(2.0, 3.0, -1.0),
        );
        let patch: Shape = BilinearPatch::new(p00, p10, p01, p11).expect("a patch").into();
        let (p1, p2, r) = (DVec3::new(-1.0, 0.0, -1.0), DVec3::new(1.0, 0.5, 1.5), 0.7);
        let capsule: Shape = Capsule::new(p1, p2, r).expect("a capsule").into();
        let ray = Ray::new(DVec3::new(0.3, -4.0, 0.2), DVec3::new(0.1, 1.5, -0.05));
        let of = |shape: &Shape, formula: &str| {
            let along = along(shape, &shape.explain(&ray), &ray).expect("it has one");
            assert!(matches!(&along, Along::Function { formula: found, .. } if *found == formula));
            along
        };
        let (of_patch, of_capsule) = (of(&patch, OF_PATCH), of(&capsule, OF_CAPSULE));
        for t in [-3.0, 0.0, 1.0, 2.2, 2.7, 3.1, 9.0] {
            let p = ray.origin + t * ray.direction;
            // α, β and γ by Cramer's rule.
            let (e1, e2) = (p10 - p00, p01 - p00);
            let e3 = p11 - p10 - e2;
            let det = |a: DVec3, b: DVec3, c: DVec3| a.dot(b.cross(c));
            let (w, all) = (p - p00, det(e1, e2, e3));
            let (alpha, beta, gamma) = (det(w, e2, e3) / all, det(e1, w, e3) / all, det(e1, e2, w) / all);
            let expected = gamma - alpha * beta;
            let found = of_patch.at(t).expect("a number");
            assert!((found - expected).abs() < 1e-11 * (1.0 + expected.abs()), "{t}: {found} {expected}");
            let v = (p2 - p1).normalize();
            let q = p1 + (p - p1).dot(v).max(0.0).min((p2 - p1).length()) * v;
            let expected = (p - q).length_squared() - r * r;
            let found = of_capsule.at(t).expect("a number");
            assert!((found - expected).abs() < 1e-11 * (1.0 + expected.abs()), "{t}: {found} {expected}");
        }
    }
}
