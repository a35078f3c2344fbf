//! Constructive solid geometry against the membership of points.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::sync::Arc;

use lumbre_geometry::{
    Aabb, Cone, Crossing, Crossings, Csg, Cuboid, Cylinder, Disk, Leaf, LeafPart, PlacedShape, Plane,
    Quadric, Ray, Root, Roots, Shape, ShapeError, Solid, Sphere, Surface, Torus,
};
use lumbre_math::random::RandomStream;
use lumbre_math::{DVec3, Transform};

#[derive(Clone, Copy, Debug)]
enum Operation {
    Union,
    Intersection,
    Difference,
}

/// A tree evaluated the obvious way: the oracle.
#[derive(Clone, Debug)]
enum Tree {
    Leaf(PlacedShape),
    Node(Operation, Vec<Tree>),
}

impl Tree {
    fn holds(&self, p: DVec3) -> bool {
        match self {
            Self::Leaf(shape) => shape.shape().contains(shape.world_from_object().inverse_point(p)),
            Self::Node(Operation::Union, operands) => operands.iter().any(|o| o.holds(p)),
            Self::Node(Operation::Intersection, operands) => operands.iter().all(|o| o.holds(p)),
            Self::Node(Operation::Difference, operands) => {
                operands[0].holds(p) && !operands[1..].iter().any(|o| o.holds(p))
            }
        }
    }

    fn csg(&self) -> Csg {
        match self {
            Self::Leaf(shape) => Csg::leaf(shape.clone()).unwrap(),
            Self::Node(operation, operands) => {
                let operands = operands.iter().map(Self::csg).collect();
                match operation {
                    Operation::Union => Csg::union(operands),
                    Operation::Intersection => Csg::intersection(operands),
                    Operation::Difference => Csg::difference(operands),
                }
                .unwrap()
            }
        }
    }
}

struct Scene {
    random: RandomStream,
    center: DVec3,
    size: f64,
}

impl Scene {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.random.next_f64()
    }

    fn vector(&mut self) -> DVec3 {
        DVec3::from_array(std::array::from_fn(|_| self.between(-1.0, 1.0)))
    }

    /// A solid of about the size of 1 around 0, in general position after `place`.
    fn solid(&mut self) -> Shape {
        let near = 0.25 * self.vector();
        match self.random.next_below(12) {
            0 => Sphere::new(near, self.between(0.6, 1.2)).unwrap().into(),
            1 => Cuboid::new(near - DVec3::splat(0.7), near + DVec3::new(0.5, 0.9, self.between(0.3, 1.0)))
                .unwrap()
                .into(),
            2 => Torus::new(near, self.vector(), self.between(0.5, 0.9), self.between(0.15, 0.45))
                .unwrap()
                .into(),
            3 => Torus::new(near, self.vector(), 0.4, self.between(0.5, 0.8)).unwrap().into(),
            4 => Cylinder::new(near, near + self.vector(), self.between(0.3, 0.9), true).unwrap().into(),
            5 => Cone::new(near, near + self.vector(), self.between(0.3, 0.9), self.between(0.0, 0.3), true)
                .unwrap()
                .into(),
            6 => {
                // An ellipsoid with mixed terms.
                let c = [1.5, 2.0, 3.5, 0.5, -0.75, 0.25, 0.5, -0.25, 0.125, -self.between(0.5, 2.0)];
                Quadric::new(c, None).unwrap().into()
            }
            7 => Cylinder::infinite(near, self.vector(), self.between(0.3, 0.9)).unwrap().into(),
            8..11 => {
                // A paraboloid, hyperboloids of one sheet and of two, a double cone, a saddle, two planes that cross.
                let [a, b, c, i, j] = [
                    [1.0, 1.5, 0.0, -1.0, -0.25],
                    [1.0, 2.0, -1.5, 0.25, -0.2],
                    [1.0, 2.0, -1.5, 0.25, 0.2],
                    [1.0, 2.0, -1.5, 0.0, 0.0],
                    [1.0, -1.5, 0.0, 1.0, 0.1],
                    [1.0, -1.5, 0.0, 0.0, 0.0],
                ][self.random.next_below(6)];
                Quadric::new([a, b, c, 0.25, 0.0, -0.125, 0.0, 0.0, i, j], None).unwrap().into()
            }
            _ => Plane::new(near, self.vector()).unwrap().into(),
        }
    }

    fn place(&mut self) -> Transform {
        let sign = if self.random.next_below(2) == 0 { 1.0 } else { -1.0 };
        let factors =
            DVec3::new(sign * self.between(0.6, 1.5), self.between(0.6, 1.5), self.between(0.6, 1.5));
        let move_there = Transform::translate(self.center + self.size * 0.5 * self.vector());
        let turn = Transform::rotate(self.vector(), self.between(0.0, 360.0)).unwrap();
        let shear = Transform::shear(0.3, -0.2, 0.1, 0.0, 0.4, -0.1).unwrap();
        move_there * turn * shear * Transform::scale(self.size * factors).unwrap()
    }

    fn tree(&mut self, depth: usize) -> Tree {
        if depth == 0 || self.random.next_below(5) == 0 {
            let (solid, place) = (self.solid(), self.place());
            return Tree::Leaf(PlacedShape::new(solid, place));
        }
        let operation =
            [Operation::Union, Operation::Intersection, Operation::Difference][self.random.next_below(3)];
        let operands = (0..2 + self.random.next_below(2)).map(|_| self.tree(depth - 1)).collect();
        Tree::Node(operation, operands)
    }

    fn line(&mut self) -> Ray {
        let through = self.center + self.size * self.vector();
        let direction = self.vector() * self.between(0.1, 10.0);
        let origin = through - direction * self.between(-0.5, 3.0);
        Ray::new(origin, direction)
    }
}

fn roots(csg: &Csg, ray: &Ray) -> Roots {
    let mut roots = Roots::new();
    csg.roots(ray, &mut roots);
    roots
}

/// Compares along random lines; how many crossings there were.
fn compare(seed: u64, center: DVec3, size: f64, trees: usize, depth: usize, slack: f64) -> usize {
    let mut scene = Scene { random: RandomStream::new(seed), center, size };
    let mut crossings = 0;
    for _ in 0..trees {
        let tree = scene.tree(depth);
        let csg = tree.csg();
        for _ in 0..12 {
            let ray = scene.line();
            let whole = ray.with_range(f64::NEG_INFINITY, f64::INFINITY);
            let found = roots(&csg, &whole);
            assert!(found.windows(2).all(|w| w[0].t < w[1].t), "{found:?}");
            let length = ray.direction.length();
            let samples: Vec<f64> = (0..60).map(|_| scene.between(-4.0, 4.0) * size / length).collect();
            let near = (center - ray.origin).dot(ray.direction) / (length * length);
            for t in samples.into_iter().map(|t| near + t) {
                if found.iter().any(|r| (r.t - t).abs() * length < slack) {
                    continue;
                }
                let p = ray.at(t);
                // Near a surface that touching or rounding makes uncertain, membership must not depend on the last
                // bits.
                let wobble = slack * DVec3::new(0.48, -0.6, 0.64);
                let holds = tree.holds(p);
                if tree.holds(p + wobble) != holds || tree.holds(p - wobble) != holds {
                    continue;
                }
                let after = found.iter().filter(|r| r.t < t).count();
                let starts_inside = starts_inside(&csg, &whole, &found, &tree);
                assert_eq!((after % 2 == 1) != starts_inside, holds, "{tree:?} {ray:?} {t} {found:?}");
                assert_eq!(csg.contains(p), holds);
            }
            check_surfaces(&csg, &whole, &found, slack);
            // A range only selects.
            let (from, to) = (near - size / length, near + 1.5 * size / length);
            let part = roots(&csg, &ray.with_range(from, to));
            let expected: Vec<f64> = found.iter().map(|r| r.t).filter(|t| (from..=to).contains(t)).collect();
            assert_eq!(part.iter().map(|r| r.t).collect::<Vec<_>>(), expected, "{tree:?} {ray:?}");
            assert_eq!(csg.closest(&ray.with_range(from, to)), part.first().copied());
            crossings += found.len();
            if let (Some(bounds), false) = (csg.bounds(&Transform::IDENTITY), found.is_empty()) {
                let grown = Aabb { min: bounds.min - slack, max: bounds.max + slack };
                assert!(found.iter().all(|r| grown.contains(ray.at(r.t))));
            }
        }
    }
    crossings
}

/// Whether the line comes from inside an unbounded solid.
fn starts_inside(csg: &Csg, line: &Ray, found: &Roots, tree: &Tree) -> bool {
    match found.first() {
        Some(first) => csg.surface(line, first).normal.dot(line.direction) > 0.0,
        None => tree.holds(line.origin),
    }
}

/// Entering and leaving alternate, and surfaces are where their roots say.
fn check_surfaces(csg: &Csg, line: &Ray, found: &Roots, slack: f64) {
    let mut previous: Option<bool> = None;
    for root in found {
        let surface = csg.surface(line, root);
        let enters = surface.normal.dot(line.direction) < 0.0;
        assert!(previous.is_none_or(|before| before != enters), "{found:?}");
        previous = Some(enters);
        let cos = surface.normal.dot(line.direction).abs() / line.direction.length();
        assert!((surface.point - line.at(root.t)).length() * cos < slack, "{surface:?} {root:?}");
        let part = csg.leaf_of(root).unwrap();
        assert!(part.leaf < csg.leaves().len() && part.part < 8);
    }
}

#[test]
fn nested_trees_agree_with_the_membership_of_points() {
    let crossings = compare(1, DVec3::new(3.0, -2.0, 1.5), 1.75, 1000, 3, 1e-9);
    assert!(crossings > 8_000, "{crossings}");
}

#[test]
fn far_from_the_origin_too() {
    let crossings = compare(2, DVec3::new(4e5, -7e5, 2e5), 2.5, 150, 2, 1e-6);
    assert!(crossings > 1_500, "{crossings}");
}

#[test]
fn small_solids_and_large_ones_are_alike() {
    let crossings = compare(3, DVec3::new(2e-4, 1e-4, -3e-4), 1e-4, 100, 2, 1e-13);
    assert!(crossings > 1_000, "{crossings}");
    let crossings = compare(4, DVec3::new(-2e9, 1e9, 3e9), 3e9, 100, 2, 1.0);
    assert!(crossings > 1_000, "{crossings}");
}

fn cuboid(low: DVec3, high: DVec3) -> Csg {
    Csg::leaf(PlacedShape::new(Cuboid::new(low, high).unwrap().into(), Transform::IDENTITY)).unwrap()
}

fn rays_through(center: DVec3, count: usize) -> Vec<Ray> {
    let mut scene = Scene { random: RandomStream::new(5), center, size: 1.0 };
    (0..count).map(|_| scene.line().with_range(f64::NEG_INFINITY, f64::INFINITY)).collect()
}

#[test]
fn two_boxes_side_by_side_are_one() {
    let turn = Transform::rotate(DVec3::new(1.0, 2.0, -0.5), 33.0).unwrap();
    let low = DVec3::new(0.25, -1.0, 2.0);
    let middle = DVec3::new(1.0, 0.3, 3.1);
    let high = DVec3::new(1.7, 0.3, 3.1);
    let both = [
        Csg::union(vec![cuboid(low, middle), cuboid(DVec3::new(middle.x, low.y, low.z), high)]).unwrap(),
        cuboid(low, high),
    ];
    let [both, one] = both.map(|csg| csg.placed(&turn));
    let mut hits = 0;
    for ray in rays_through(turn.point(middle), 20_000) {
        let (found, expected) = (roots(&both, &ray), roots(&one, &ray));
        assert_eq!(found.len(), expected.len(), "{ray:?} {found:?} {expected:?}");
        hits += found.len();
    }
    assert!(hits > 5_000, "{hits}");
}

#[test]
fn a_hole_drilled_flush_with_the_faces_leaves_no_film() {
    let block = cuboid(DVec3::new(-1.0, -1.5, 0.1), DVec3::new(1.0, 1.5, 0.7));
    let drill = Cylinder::new(DVec3::new(0.2, 0.1, 0.1), DVec3::new(0.2, 0.1, 0.7), 0.4, true).unwrap();
    let drill = Csg::leaf(PlacedShape::new(drill.into(), Transform::IDENTITY)).unwrap();
    let mut hits = 0;
    for turn in [Transform::IDENTITY, Transform::rotate(DVec3::new(3.0, -1.0, 2.0), 71.0).unwrap()] {
        let plate = Csg::difference(vec![block.clone(), drill.clone()]).unwrap().placed(&turn);
        for ray in rays_through(turn.point(DVec3::new(0.2, 0.1, 0.4)), 20_000) {
            for root in roots(&plate, &ray) {
                hits += 1;
                let p = turn.inverse_point(plate.surface(&ray, &root).point);
                let axial = (p - DVec3::new(0.2, 0.1, 0.0)).truncate().length();
                assert!(axial > 0.4 - 1e-12, "a film at {p}");
                let part = plate.leaf_of(&root).unwrap();
                assert_eq!(part.flipped, part.leaf == 1);
                assert!(part.leaf == 0 || part.part == 0, "the drill's caps are nowhere left");
            }
        }
    }
    assert!(hits > 10_000, "{hits}");
}

#[test]
fn a_solid_without_itself_is_nothing_and_with_itself_is_itself() {
    let ball = |radius: f64| {
        let map = Transform::translate(DVec3::new(2.0, 1.0, -3.0))
            * Transform::rotate(DVec3::new(1.0, 1.0, 0.3), 50.0).unwrap()
            * Transform::scale(DVec3::new(1.0, 0.5, -1.5)).unwrap();
        Csg::leaf(PlacedShape::new(Sphere::new(DVec3::ZERO, radius).unwrap().into(), map)).unwrap()
    };
    let nothing = Csg::difference(vec![ball(0.9), ball(0.9)]).unwrap();
    let itself = Csg::union(vec![ball(0.9), ball(0.9)]).unwrap();
    let common = Csg::intersection(vec![ball(0.9), ball(0.9)]).unwrap();
    let mut hits = 0;
    for ray in rays_through(DVec3::new(2.0, 1.0, -3.0), 5_000) {
        assert!(roots(&nothing, &ray).is_empty());
        let expected = roots(&ball(0.9), &ray);
        assert_eq!(roots(&itself, &ray), expected);
        assert_eq!(roots(&common, &ray).len(), expected.len());
        hits += expected.len();
    }
    assert!(hits > 2_000, "{hits}");
}

#[test]
fn the_first_deciding_leaf_owns_coinciding_surfaces() {
    let (low, high) = (DVec3::new(0.5, 0.5, 0.5), DVec3::new(2.0, 2.5, 3.0));
    let away = cuboid(DVec3::splat(10.0), DVec3::splat(12.0));
    // The first leaf has the same face, but only inside an intersection that is empty there.
    let hidden = Csg::intersection(vec![cuboid(low, high), away]).unwrap();
    let csg = Csg::union(vec![hidden, cuboid(low, high), cuboid(low, high)]).unwrap();
    let ray = Ray::new(DVec3::new(1.0, 1.5, -5.0), DVec3::new(0.0, 0.0, 2.0));
    let leaves: Vec<_> = roots(&csg, &ray).iter().map(|r| csg.leaf_of(r).unwrap().leaf).collect();
    assert_eq!(leaves, [2, 2]);
}

#[test]
fn a_ray_may_begin_inside() {
    let shell = Csg::difference(vec![
        Csg::leaf(PlacedShape::new(Sphere::new(DVec3::ONE, 2.0).unwrap().into(), Transform::IDENTITY))
            .unwrap(),
        Csg::leaf(PlacedShape::new(Sphere::new(DVec3::ONE, 1.5).unwrap().into(), Transform::IDENTITY))
            .unwrap(),
    ])
    .unwrap();
    let at = |x: f64| Ray::new(DVec3::new(1.0 + x, 1.0, 1.0), DVec3::new(0.5, 0.0, 0.0));
    let nearest = |ray: Ray| shell.closest(&ray).map(|r| (r.t, shell.leaf_of(&r).unwrap().flipped));
    assert_eq!(nearest(at(0.0)), Some((3.0, true)));
    assert_eq!(nearest(at(1.75)), Some((0.5, false)));
    assert_eq!(nearest(at(2.5)), None);
    let inner = shell.surface(&at(0.0), &shell.closest(&at(0.0)).unwrap());
    assert!((inner.normal + DVec3::X).length() < 1e-15, "the shell's inner side faces its hollow");
}

/// The union of two overlapping boxes, as a mesh would report it: each crossed face.
#[derive(Debug)]
struct Overlapping(Cuboid, Cuboid);

impl Solid for Overlapping {
    fn part_count(&self) -> u32 {
        12
    }

    fn bounds(&self, world_from_object: &Transform) -> Aabb {
        self.0.bounds(world_from_object).unwrap().union(self.1.bounds(world_from_object).unwrap())
    }

    fn crossings(&self, ray: &Ray, out: &mut Crossings) {
        let line = ray.with_range(f64::NEG_INFINITY, f64::INFINITY);
        for (first_part, cuboid) in [(6, &self.1), (0, &self.0)] {
            let mut roots = Roots::new();
            cuboid.roots(&line, &mut roots);
            let crossings = roots.iter().enumerate().map(|(i, root)| Crossing {
                root: Root { part: first_part + root.part, ..*root },
                enters: i == 0,
            });
            out.extend(crossings.filter(|c| c.root.multiplicity == 1));
        }
    }

    fn surface(&self, ray: &Ray, root: &Root) -> Surface {
        let (cuboid, part) = if root.part < 6 { (&self.0, root.part) } else { (&self.1, root.part - 6) };
        cuboid.surface(ray, &Root { part, ..*root })
    }
}

#[test]
fn a_strangers_solid_is_an_operand_like_any_other() {
    let corners = [(-1.0, 0.5), (0.0, 1.5)].map(|(low, high)| (DVec3::splat(low), DVec3::splat(high)));
    let boxes = corners.map(|(low, high)| Cuboid::new(low, high).unwrap());
    let turn = Transform::translate(DVec3::new(1.0, 5.0, -2.0))
        * Transform::rotate(DVec3::new(1.0, 2.0, 3.0), 40.0).unwrap();
    let ball =
        Csg::leaf(PlacedShape::new(Sphere::new(DVec3::splat(0.4), 0.8).unwrap().into(), turn)).unwrap();
    let stranger = Csg::solid(Arc::new(Overlapping(boxes[0], boxes[1]))).unwrap().placed(&turn);
    let plain = Csg::union(corners.map(|(low, high)| cuboid(low, high)).to_vec()).unwrap().placed(&turn);
    let one = Csg::difference(vec![stranger, ball.clone()]).unwrap();
    let other = Csg::difference(vec![plain, ball]).unwrap();
    let mut hits = 0;
    for ray in rays_through(turn.point(DVec3::splat(0.4)), 5_000) {
        let (found, expected) = (roots(&one, &ray), roots(&other, &ray));
        assert_eq!(found.len(), expected.len());
        for (a, b) in found.iter().zip(&expected) {
            assert!((a.t - b.t).abs() < 1e-13 * (1.0 + a.t.abs() * 30.0));
            let (a, b) = (one.surface(&ray, a), other.surface(&ray, b));
            assert!((a.normal - b.normal).length() < 1e-12 && (a.point - b.point).length() < 1e-12);
        }
        let p = ray.at(0.7);
        assert_eq!(one.contains(p), other.contains(p));
        hits += found.len();
    }
    assert!(hits > 5_000, "{hits}");
}

#[test]
fn transformed_csg_is_the_same_after_it_is_split() {
    let mut scene = Scene { random: RandomStream::new(8), center: DVec3::new(1.0, 2.0, 0.5), size: 1.5 };
    let mut hits = 0;
    for _ in 0..50 {
        let csg = scene.tree(2).csg();
        let map = scene.place();
        let placed = PlacedShape::new(csg.clone().into(), map);
        let apart = Csg::leaf(placed.clone()).unwrap();
        assert_eq!(apart.leaves().len(), csg.leaves().len());
        scene.center = map.point(DVec3::new(1.0, 2.0, 0.5));
        for _ in 0..20 {
            let ray = scene.line();
            let mut found = Roots::new();
            placed.roots(&ray, &mut found);
            let expected = roots(&apart, &ray);
            assert_eq!(found.len(), expected.len());
            for (a, b) in found.iter().zip(&expected) {
                assert!((a.t - b.t).abs() < 1e-9 * (1.0 + a.t.abs()) && a.part == b.part);
            }
            hits += found.len();
        }
        scene.center = DVec3::new(1.0, 2.0, 0.5);
    }
    assert!(hits > 100, "{hits}");
}

#[test]
fn what_encloses_nothing_is_refused_and_so_is_endless_nesting() {
    let disk = Disk::new(DVec3::ONE, DVec3::Y, 2.0, 0.0).unwrap();
    let refused = Csg::leaf(PlacedShape::new(disk.into(), Transform::IDENTITY));
    assert!(matches!(refused, Err(ShapeError::Degenerate(why)) if why.contains("encloses nothing")));
    assert!(Csg::union(vec![]).is_err());
    let mut nested = cuboid(DVec3::ONE, DVec3::new(2.0, 3.0, 4.0));
    for _ in 1..Csg::MAX_DEPTH {
        nested = Csg::union(vec![nested]).unwrap();
    }
    assert!(nested.closest(&Ray::new(DVec3::ZERO, DVec3::new(1.5, 2.0, 2.5))).is_some());
    assert!(Csg::union(vec![nested]).is_err());
}

#[test]
fn a_bowl_is_cut_from_an_open_paraboloid() {
    // y ≤ 1 - x² - z², within a cylinder from y = -1 to 1.
    let bowl: Shape = Quadric::new([1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0], None).unwrap().into();
    let can: Shape = Cylinder::new(-DVec3::Y, DVec3::Y, 1.0, true).unwrap().into();
    let leaf = |shape: Shape| Csg::leaf(PlacedShape::new(shape, Transform::IDENTITY)).unwrap();
    let csg = Csg::intersection(vec![leaf(bowl), leaf(can)]).unwrap();
    let t = |origin: DVec3, direction: DVec3| {
        roots(&csg, &Ray::new(origin, direction)).iter().map(|root| root.t).collect::<Vec<_>>()
    };
    assert_eq!(t(DVec3::new(0.5, 5.0, 0.0), -DVec3::Y), [4.25, 6.0]);
    assert_eq!(t(DVec3::new(-10.0, 0.75, 0.0), DVec3::X), [9.5, 10.5]);
    assert_eq!(t(DVec3::new(-10.0, -0.5, 0.0), DVec3::X), [9.0, 11.0]);
    assert!(csg.contains(DVec3::new(0.0, 0.9, 0.0)) && !csg.contains(DVec3::new(0.5, 0.9, 0.0)));
}

#[test]
fn a_union_of_many_is_as_its_parts_in_any_grouping() {
    let mut random = RandomStream::new(91);
    let center = DVec3::new(4.0, -2.0, 1.0);
    let mut vector = || DVec3::from_array(std::array::from_fn(|_| 2.0 * random.next_f64() - 1.0));
    let balls: Vec<Shape> =
        (0..700).map(|_| Sphere::new(center + 3.0 * vector(), 0.3).unwrap().into()).collect();
    let floor: Shape = Plane::new(center - 2.5 * DVec3::Z, DVec3::Z).unwrap().into();
    let leaf = |shape: &Shape| Csg::leaf(PlacedShape::new(shape.clone(), Transform::IDENTITY)).unwrap();
    let solids = || balls.iter().chain([&floor]).map(leaf);
    let union = Csg::union(solids().collect()).unwrap();
    let block = Cuboid::new(center - 2.75, center + 2.75).unwrap().into();
    let holes = Csg::difference([leaf(&block)].into_iter().chain(solids()).collect()).unwrap();
    // The leaves are in the order of the operands, whatever the grouping.
    for (csg, before) in [(&union, 0), (&holes, 1)] {
        for (i, shape) in balls.iter().enumerate() {
            let Leaf::Shape(placed) = &csg.leaves()[before + i] else { panic!() };
            assert_eq!(placed.bounds(), shape.bounds(&Transform::IDENTITY));
        }
    }
    let mut crossings = 0;
    for _ in 0..300 {
        let from = center + 8.0 * vector();
        let ray = Ray::new(from, center + 2.5 * vector() - from).with_range(f64::NEG_INFINITY, f64::INFINITY);
        // The plain way: between neighbouring crossings of all parts, is the middle inside of one?
        let mut all: Vec<f64> = vec![];
        for shape in balls.iter().chain([&floor, &block]) {
            let mut own = Roots::new();
            shape.roots(&ray, &mut own);
            all.extend(own.iter().map(|root| root.t));
        }
        all.sort_by(f64::total_cmp);
        let inside = |csg: usize, t: f64| {
            let p = ray.at(t);
            let in_one = balls.iter().chain([&floor]).any(|shape| shape.contains(p));
            if csg == 0 { in_one } else { block.contains(p) && !in_one }
        };
        for (number, csg) in [&union, &holes].into_iter().enumerate() {
            let changes = |i: usize| {
                let before = all[i] - 0.5 * if i == 0 { 1.0 } else { all[i] - all[i - 1] };
                let after = all[i] + 0.5 * if i + 1 == all.len() { 1.0 } else { all[i + 1] - all[i] };
                inside(number, before) != inside(number, after)
            };
            let expected: Vec<f64> = (0..all.len()).filter(|&i| changes(i)).map(|i| all[i]).collect();
            let found = roots(csg, &ray);
            assert_eq!(found.iter().map(|root| root.t).collect::<Vec<_>>(), expected, "{ray:?}");
            for root in &found {
                let LeafPart { leaf, flipped, .. } = csg.leaf_of(root).unwrap();
                assert_eq!(flipped, number == 1 && leaf > 0);
            }
            crossings += found.len();
        }
    }
    assert!(crossings > 3000, "{crossings}");
}
