//! A tree over lights that chooses one for a point: near, bright lights that face it are chosen more often.
//!
//! After A. Conty Estevez, C. Kulla, "Importance Sampling of Many Lights with Adaptive Tree Splitting", Proceedings of
//! the ACM on Computer Graphics and Interactive Techniques 1(2), 2018, without the splitting; cosines of bounding cones
//! are computed without angles, as in M. Pharr, W. Jakob, G. Humphreys, "Physically Based Rendering", 4th edition,
//! 2023, 12.6. The cosine at the point is bounded by the height of the node's box over the horizon, which is tighter
//! than a cone for lights in the plane of the point.

use lumbre_geometry::Aabb;
use lumbre_math::DVec3;

/// The tree's entry for a light, or for a piece of one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Emitter {
    /// Its position.
    pub bounds: Aabb,
    /// Its orientation.
    pub facing: Facing,
    /// Its greatest radiant intensity, averaged over colours.
    pub strength: f64,
}

/// A bound on the directions of light: normals or axes lie within a cone, and light leaves within an angle of them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Facing {
    /// Unit; zero where all directions are possible.
    pub(super) axis: DVec3,
    /// The cosine of the angle between the axis and the farthest normal; −1 for all directions.
    pub(super) cos_normals: f64,
    /// The cosine of the angle between a normal and the farthest direction of light.
    pub(super) cos_light: f64,
}

/// Rounding error of cosines of bounding cones.
const SLACK: f64 = 1e-9;

impl Facing {
    /// Every direction.
    pub(crate) const ANY: Self = Self { axis: DVec3::ZERO, cos_normals: -1.0, cos_light: 0.0 };

    /// From a plane with this unit normal, on its side only.
    pub(crate) fn side(normal: DVec3) -> Self {
        Self { axis: normal, cos_normals: 1.0, cos_light: 0.0 }
    }

    /// A cone around a unit axis, whose light falls off between the angles with these cosines.
    pub(crate) fn cone(axis: DVec3, cos_start: f64, cos_end: f64) -> Self {
        let (sin_start, sin_end) = (sine(cos_start), sine(cos_end));
        Self { axis, cos_normals: cos_start, cos_light: cos_start * cos_end + sin_start * sin_end - SLACK }
    }

    /// The bound on all of these, around the mean of their axes.
    fn around(all: &[(Emitter, u32)]) -> Self {
        if let [(emitter, _)] = all {
            return emitter.facing;
        }
        let cos_light = all.iter().map(|(emitter, _)| emitter.facing.cos_light).fold(1.0, f64::min);
        let sum: DVec3 = all.iter().map(|(emitter, _)| emitter.facing.axis).sum();
        let Some(axis) = sum.try_normalize() else { return Self { cos_light, ..Self::ANY } };
        let farthest = |facing: &Self| {
            let cosine = axis.dot(facing.axis);
            // More than a half turn in total: every direction.
            if facing.cos_normals <= -1.0 || cosine <= -facing.cos_normals {
                return -1.0;
            }
            cosine * facing.cos_normals - sine(cosine) * sine(facing.cos_normals) - SLACK
        };
        let cos_normals = all.iter().map(|(emitter, _)| farthest(&emitter.facing)).fold(1.0, f64::min);
        if cos_normals <= -1.0 {
            Self { cos_light, ..Self::ANY }
        } else {
            Self { axis, cos_normals, cos_light }
        }
    }
}

fn sine(cosine: f64) -> f64 {
    (1.0 - cosine * cosine).max(0.0).sqrt()
}

/// A tree over emitters, each in a leaf of its own.
#[derive(Clone, Debug)]
pub(crate) struct LightTree {
    // In depth-first order: a node of n leaves has 2n - 1 nodes, its first child follows it.
    pub(super) nodes: Vec<Node>,
    // The node of each emitter.
    pub(super) leaves: Vec<u32>,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    pub center: DVec3,
    /// Half the size of the bounding box.
    pub half: DVec3,
    pub radius_squared: f64,
    pub facing: Facing,
    pub strength: f64,
    /// The second child; of a leaf, [`LEAF`] and its emitter.
    pub next: u32,
}

/// A lit point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    pub from: DVec3,
    /// The unit normal of an opaque surface, on the lit side; zero if light from every side counts.
    pub normal: DVec3,
}

/// Elevations with a sine above minus this count as above the horizon: normals may have been rounded to single
/// precision.
pub(super) const HORIZON_SLACK: f64 = 1e-6;

pub(super) const LEAF: u32 = 1 << 31;
const BELOW_ONE: f64 = 1.0 - 0.5 * f64::EPSILON;

impl Node {
    fn emitter(&self) -> Option<u32> {
        (self.next & LEAF != 0).then_some(self.next & !LEAF)
    }

    /// A rough estimate of the light from the node to a point: zero only if there is none.
    #[inline]
    fn importance(&self, place: &Place) -> f64 {
        self.cosine_at(place) * self.intensity(place.from)
    }

    /// A bound on the cosine between the normal at the point and the direction to any light of the node; 1 without a
    /// normal, 0 if all lights are below the horizon.
    #[inline]
    fn cosine_at(&self, &Place { from, normal }: &Place) -> f64 {
        if normal == DVec3::ZERO {
            return 1.0;
        }
        let way = self.center - from;
        // Bounds the height of the box above the plane of the point, and its distance.
        let height = normal.dot(way) + normal.abs().dot(self.half);
        let distance = (way.abs() - self.half).max(DVec3::ZERO).length();
        if distance <= 0.0 {
            return 1.0;
        }
        let sine = height / distance;
        if sine < -HORIZON_SLACK { 0.0 } else { sine.clamp(HORIZON_SLACK, 1.0) }
    }

    /// An estimate of the light from the node to a point that faces it.
    #[inline]
    fn intensity(&self, from: DVec3) -> f64 {
        let way = from - self.center;
        let squared = way.length_squared();
        if squared <= self.radius_squared {
            // Inside the bounding sphere, any orientation is possible.
            return self.strength / self.radius_squared.max(f64::MIN_POSITIVE);
        }
        let Facing { axis, cos_normals, cos_light } = self.facing;
        if cos_normals <= -1.0 {
            return self.strength / squared;
        }
        // The angle between the axis and the direction to the point, minus that of the cone of normals, minus the
        // angular radius of the sphere.
        let cos_way = axis.dot(way) / squared.sqrt();
        let sin_seen = (self.radius_squared / squared).min(1.0).sqrt();
        let (cosine, sin) = angle_less([cos_way, sine(cos_way)], [cos_normals, sine(cos_normals)]);
        let (cosine, _) = angle_less([cosine, sin], [sine(sin_seen), sin_seen]);
        if cosine + SLACK <= cos_light { 0.0 } else { self.strength * cosine.max(SLACK) / squared }
    }
}

/// The cosine and sine of the difference of two angles, or of 0 if it is negative.
#[inline]
fn angle_less([cos_a, sin_a]: [f64; 2], [cos_b, sin_b]: [f64; 2]) -> (f64, f64) {
    if cos_a >= cos_b { (1.0, 0.0) } else { (cos_a * cos_b + sin_a * sin_b, sin_a * cos_b - cos_a * sin_b) }
}

/// A chosen emitter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Chosen {
    pub emitter: usize,
    pub probability: f64,
}

impl LightTree {
    /// `None` if nothing emits, or if there are too many emitters.
    pub(crate) fn new(emitters: &[Emitter]) -> Option<Self> {
        let is_dark = !emitters.iter().any(|emitter| emitter.strength > 0.0);
        if is_dark || emitters.len() >= (LEAF / 2) as usize {
            return None;
        }
        let mut order: Vec<(Emitter, u32)> = emitters.iter().copied().zip(0..).collect();
        let mut nodes = Vec::with_capacity(2 * emitters.len() - 1);
        build(&mut order, &mut nodes, 0);
        let mut leaves = vec![0; emitters.len()];
        for (at, node) in (0..).zip(&nodes) {
            if let Some(emitter) = node.emitter() {
                leaves[emitter as usize] = at;
            }
        }
        Some(Self { nodes, leaves })
    }

    /// Whether any light may reach a point.
    pub(crate) fn shines_on(&self, place: &Place) -> bool {
        self.nodes[0].importance(place) > 0.0
    }

    /// The emitter for a point and a uniform `u` of [0, 1); `None` if no light reaches the point.
    pub(crate) fn choose(&self, place: &Place, mut u: f64) -> Option<Chosen> {
        let (mut at, mut probability) = (0, 1.0);
        loop {
            let node = &self.nodes[at];
            if let Some(emitter) = node.emitter() {
                return Some(Chosen { emitter: emitter as usize, probability });
            }
            let share = self.share_of_first(at, place)?;
            if u < share {
                (at, u) = (at + 1, (u / share).min(BELOW_ONE));
                probability *= share;
            } else {
                (at, u) = (node.next as usize, ((u - share) / (1.0 - share)).min(BELOW_ONE));
                probability *= 1.0 - share;
            }
        }
    }

    /// The probability with which [`LightTree::choose`] chooses an emitter.
    pub(crate) fn probability(&self, place: &Place, emitter: usize) -> f64 {
        let leaf = self.leaves[emitter] as usize;
        let (mut at, mut probability) = (0, 1.0);
        while at != leaf {
            let Some(share) = self.share_of_first(at, place) else { return 0.0 };
            let second = self.nodes[at].next as usize;
            if leaf < second {
                at += 1;
                probability *= share;
            } else {
                at = second;
                probability *= 1.0 - share;
            }
        }
        probability
    }

    /// The probability of the first child of a node.
    #[inline]
    fn share_of_first(&self, at: usize, place: &Place) -> Option<f64> {
        let first = self.nodes[at + 1].importance(place);
        let second = self.nodes[self.nodes[at].next as usize].importance(place);
        let share = first / (first + second);
        if share.is_nan() {
            // No light from either; or both are infinitely strong, because the point is on a light without an extent.
            return (first > 0.0).then_some(0.5);
        }
        Some(share)
    }
}

/// Below this depth, splits by number: no tree is much deeper.
const DEEP: u32 = 64;
/// Bins along each axis.
const BINS: usize = 12;

/// Appends the nodes of some emitters, depth first.
fn build(emitters: &mut [(Emitter, u32)], nodes: &mut Vec<Node>, depth: u32) {
    let bounds = emitters.iter().fold(Aabb::EMPTY, |bounds, (emitter, _)| bounds.union(emitter.bounds));
    let radius_squared = 0.25 * bounds.size().length_squared() * (1.0 + SLACK);
    let at = nodes.len();
    nodes.push(Node {
        center: bounds.center(),
        half: 0.5 * (1.0 + SLACK) * bounds.size(),
        radius_squared,
        facing: Facing::around(emitters),
        strength: emitters.iter().map(|(emitter, _)| emitter.strength).sum(),
        next: LEAF | emitters[0].1,
    });
    if emitters.len() == 1 {
        return;
    }
    let middle = if depth < DEEP { split(emitters, &bounds) } else { None };
    let middle = middle.unwrap_or(emitters.len() / 2);
    let (first, second) = emitters.split_at_mut(middle);
    build(first, nodes, depth + 1);
    nodes[at].next = nodes.len() as u32;
    build(second, nodes, depth + 1);
}

/// The contents of a bin or a side.
#[derive(Clone, Copy)]
struct Group {
    bounds: Aabb,
    axes: DVec3,
    strength: f64,
    count: usize,
}

impl Group {
    const EMPTY: Self = Self { bounds: Aabb::EMPTY, axes: DVec3::ZERO, strength: 0.0, count: 0 };

    fn of(emitter: &Emitter) -> Self {
        Self { bounds: emitter.bounds, axes: emitter.facing.axis, strength: emitter.strength, count: 1 }
    }

    fn union(&self, other: &Self) -> Self {
        Self {
            bounds: self.bounds.union(other.bounds),
            axes: self.axes + other.axes,
            strength: self.strength + other.strength,
            count: self.count + other.count,
        }
    }

    /// Strength times the squared extent times a measure of the spread of directions, from 1 for one to 2 for all.
    fn cost(&self) -> f64 {
        if self.count == 0 {
            return 0.0;
        }
        let spread = 2.0 - self.axes.length() / self.count as f64;
        self.strength * self.bounds.size().length_squared() * spread
    }
}

/// Partitions the emitters at the cheapest plane between centres; returns the size of the first side, or `None` if no
/// plane separates them.
fn split(emitters: &mut [(Emitter, u32)], bounds: &Aabb) -> Option<usize> {
    let centers = Aabb::around(emitters.iter().map(|(emitter, _)| emitter.bounds.center()));
    let (size, extent) = (centers.size(), bounds.size());
    let bin = |emitter: &Emitter, axis: usize| {
        let part = (emitter.bounds.center()[axis] - centers.min[axis]) / size[axis];
        ((part * BINS as f64) as usize).min(BINS - 1)
    };
    let mut best: Option<(f64, usize, usize)> = None;
    for axis in 0..3 {
        // False for NaN.
        let is_wide = size[axis] > 0.0;
        if !is_wide {
            continue;
        }
        let mut bins = [Group::EMPTY; BINS];
        for (emitter, _) in emitters.iter() {
            let group = &mut bins[bin(emitter, axis)];
            *group = group.union(&Group::of(emitter));
        }
        let mut after = [Group::EMPTY; BINS + 1];
        for i in (0..BINS).rev() {
            after[i] = after[i + 1].union(&bins[i]);
        }
        let mut before = Group::EMPTY;
        // Thin sides are worse than their extent suggests.
        let shape = extent.max_element() / extent[axis].max(f64::MIN_POSITIVE);
        for i in 1..BINS {
            before = before.union(&bins[i - 1]);
            let cost = shape * (before.cost() + after[i].cost());
            if before.count > 0 && after[i].count > 0 && best.is_none_or(|(least, ..)| cost < least) {
                best = Some((cost, axis, i));
            }
        }
    }
    let (_, axis, border) = best?;
    let mut middle = 0;
    for i in 0..emitters.len() {
        if bin(&emitters[i].0, axis) < border {
            emitters.swap(i, middle);
            middle += 1;
        }
    }
    Some(middle)
}

#[cfg(test)]
mod tests {
    use lumbre_math::random::RandomStream;

    use super::*;

    fn vector(random: &mut RandomStream) -> DVec3 {
        let mut x = || 2.0 * random.next_f64() - 1.0;
        DVec3::new(x(), x(), x())
    }

    fn emitters(count: usize, seed: u64) -> Vec<Emitter> {
        let mut random = RandomStream::new(seed);
        (0..count)
            .map(|i| {
                let (at, size) = (10.0 * vector(&mut random), 0.3 * vector(&mut random).abs());
                let axis = vector(&mut random).normalize();
                let facing = match i % 3 {
                    0 => Facing::ANY,
                    1 => Facing::side(axis),
                    _ => Facing::cone(axis, 0.9, 0.7),
                };
                let strength = if i % 7 == 3 { 0.0 } else { random.next_f64() };
                Emitter { bounds: Aabb { min: at - size, max: at + size }, facing, strength }
            })
            .collect()
    }

    fn anywhere(from: DVec3) -> Place {
        Place { from, normal: DVec3::ZERO }
    }

    #[test]
    fn probabilities_sum_to_one_and_are_those_of_the_choice() {
        let mut random = RandomStream::new(5);
        for count in [1, 2, 3, 50, 300] {
            let tree = LightTree::new(&emitters(count, count as u64)).unwrap();
            assert_eq!(tree.nodes.len(), 2 * count - 1);
            for i in 0..20 {
                let normal = if i % 3 == 0 { DVec3::ZERO } else { vector(&mut random).normalize() };
                let place = Place { from: 14.0 * vector(&mut random), normal };
                let sum: f64 = (0..count).map(|emitter| tree.probability(&place, emitter)).sum();
                // No choice at a point that no light reaches.
                let Some(chosen) = tree.choose(&place, random.next_f64()) else {
                    assert!(sum < 1.0);
                    continue;
                };
                assert!(sum <= 1.0 + 1e-12, "{sum}");
                assert_eq!(tree.probability(&place, chosen.emitter), chosen.probability);
            }
        }
    }

    #[test]
    fn what_shines_on_a_place_is_never_left_out() {
        let mut random = RandomStream::new(6);
        let all = emitters(200, 9);
        let tree = LightTree::new(&all).unwrap();
        let (mut left_out, mut shining) = (0, 0);
        for round in 0..400 {
            let from = 14.0 * vector(&mut random);
            let normal = if round % 2 == 0 { DVec3::ZERO } else { vector(&mut random).normalize() };
            let place = Place { from, normal };
            for (i, emitter) in all.iter().enumerate().filter(|(_, emitter)| emitter.strength > 0.0) {
                let within = vector(&mut random) * 0.5 * emitter.bounds.size();
                let way = (from - (emitter.bounds.center() + within)).normalize();
                let shines = match i % 3 {
                    0 => true,
                    1 => emitter.facing.axis.dot(way) > 0.0,
                    _ => emitter.facing.axis.dot(way) > 0.7,
                };
                let shines = shines && (normal == DVec3::ZERO || normal.dot(-way) > 0.0);
                let probability = tree.probability(&place, i);
                assert!(!shines || probability > 0.0, "{i} {from}");
                shining += u32::from(shines);
                left_out += u32::from(probability == 0.0);
            }
        }
        // It is no use where it leaves out nothing.
        assert!(shining > 15_000 && left_out > 15_000, "{shining} {left_out}");
    }

    #[test]
    fn lights_below_the_horizon_of_an_opaque_place_are_never_chosen() {
        let at = |x, y, z, half: f64| {
            let (at, half) = (DVec3::new(x, y, z), DVec3::new(half, half, 0.0));
            let bounds = Aabb { min: at - half, max: at + half };
            Emitter { bounds, facing: Facing::ANY, strength: if z < 0.7 { 1e6 } else { 0.3 } }
        };
        // A wide panel and a point below, and a point above.
        let lights = [at(0.2, 0.0, -0.4, 30.0), at(1.0, 2.0, -3.0, 0.0), at(2.0, 1.0, 1.5, 0.0)];
        let tree = LightTree::new(&lights).unwrap();
        let place = Place { from: DVec3::new(0.5, 0.3, 0.1), normal: DVec3::Z };
        assert_eq!([0, 1, 2].map(|i| tree.probability(&place, i)), [0.0, 0.0, 1.0]);
        assert_eq!(tree.choose(&place, 0.2).unwrap().emitter, 2);
        let below = Place { normal: -DVec3::Z, ..place };
        assert_eq!(tree.probability(&below, 2), 0.0);
        assert!(
            tree.shines_on(&below)
                && [0, 1, 2].iter().all(|&i| tree.probability(&anywhere(place.from), i) > 0.0)
        );
        assert!(!LightTree::new(&lights[..2]).unwrap().shines_on(&place));
        // The one above gives a place that faces it at an angle as much more as the cosine is greater.
        let two = LightTree::new(&[at(0.0, 0.0, 4.0, 0.0), at(0.0, 4.0, 4.0, 0.0)]).unwrap();
        let share = two.probability(&Place { from: DVec3::ZERO, normal: DVec3::Z }, 0);
        assert!((share - 1.0 / (1.0 + 0.5 * 0.5_f64.sqrt())).abs() < 1e-9, "{share}");
    }

    #[test]
    fn near_bright_lights_that_face_a_place_are_chosen_more_often() {
        let at = |x: f64| Aabb { min: DVec3::new(x, 0.0, 0.0), max: DVec3::new(x, 0.0, 0.0) };
        let light = |x, facing, strength| Emitter { bounds: at(x), facing, strength };
        let here = anywhere(DVec3::ZERO);
        let first = |lights: &[Emitter]| LightTree::new(lights).unwrap().probability(&here, 0);
        let any = Facing::ANY;
        assert!((first(&[light(1.0, any, 1.0), light(3.0, any, 1.0)]) - 0.9).abs() < 1e-9);
        assert!((first(&[light(1.0, any, 1.0), light(-1.0, any, 3.0)]) - 0.25).abs() < 1e-9);
        let (away, towards) = (Facing::side(DVec3::X), Facing::side(-DVec3::X));
        assert_eq!(first(&[light(1.0, away, 1.0), light(2.0, towards, 1.0)]), 0.0);
        let slanted = Facing::side(DVec3::new(-0.6, 0.8, 0.0));
        assert!((first(&[light(1.0, slanted, 1.0), light(-1.0, any, 1.0)]) - 0.375).abs() < 1e-9);
    }

    #[test]
    fn a_million_lights_in_one_place_make_a_tree_that_is_not_deep() {
        let one = Emitter { bounds: Aabb::around([DVec3::ONE]), facing: Facing::ANY, strength: 1.0 };
        let tree = LightTree::new(&vec![one; 1 << 12]).unwrap();
        let chosen = tree.choose(&anywhere(DVec3::ZERO), 0.3).unwrap();
        assert!((chosen.probability * 4096.0 - 1.0).abs() < 1e-9, "{chosen:?}");
    }
}
