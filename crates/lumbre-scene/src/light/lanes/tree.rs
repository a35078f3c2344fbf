//! The descent of the tree of lights in lanes: see [`crate::light::tree`].

use lumbre_simd::{Mask, Real, UInt, V3};

use super::sample::{Receiver, below_one};
use super::table::{LEAF, ROUNDING, Rows, Table, node};

/// A receiver as the tree sees it.
#[derive(Clone, Copy)]
pub(super) struct LanePlace<R: Real> {
    /// Relative to the table's origin.
    from: V3<R>,
    pub normal: V3<R>,
    /// Whether there is a normal.
    pub is_oriented: R::Mask,
    /// A bound on the rounding of `from`.
    rounding: R,
}

/// An emitter for each lane.
pub(super) struct LaneChosen<R: Real> {
    /// 0 where it is not valid.
    pub emitter: R::UInt,
    pub probability: R,
    pub valid: R::Mask,
}

/// What cosines of single precision may be off by.
pub(super) const SLACK: f32 = 1e-6;
/// The importance of what may shine, at least: it is not lost where numbers end.
const LEAST: f32 = 1e-37;
/// The level at which a random number gets further digits.
const REFINED: u32 = 6;

impl<R: Real> LanePlace<R> {
    #[inline(always)]
    pub(super) fn new(table: &Table, receiver: &Receiver<R>) -> Self {
        let from = (receiver.from - V3::constant_f64(table.origin)).to_single();
        let normal = receiver.normal;
        Self {
            from,
            normal,
            is_oriented: normal.length_squared().simd_gt(R::zero()),
            rounding: R::splat(ROUNDING) * from.abs().max_component(),
        }
    }
}

#[inline(always)]
fn sine<R: Real>(cosine: R) -> R {
    (R::one() - cosine * cosine).simd_max(R::zero()).sqrt()
}

/// The cosine and sine of the difference of two angles, of 0 where it is negative.
#[inline(always)]
fn angle_less<R: Real>(a: [R; 2], b: [R; 2]) -> [R; 2] {
    let is_none = b[0].simd_le(a[0]);
    let (cosine, sine) = (a[0] * b[0] + a[1] * b[1], a[1] * b[0] - a[0] * b[1]);
    [R::select(is_none, R::one(), cosine), sine.or_zero(!is_none)]
}

/// A bound on the cosine at the place to any light of a node; 0 where all are below the horizon.
#[inline(always)]
fn cosine_at<R: Real>(rows: &Rows<'_, R>, way: V3<R>, place: &LanePlace<R>) -> R {
    let half = rows.vector(node::HALF) + V3::splat(place.rounding);
    let height = place.normal.dot(way) + place.normal.abs().dot(half);
    let distance = (way.abs() - half).max(V3::splat(R::zero())).length();
    let sine = height / distance;
    let is_below = sine.simd_lt(R::splat(-SLACK));
    let bound = sine.simd_max(R::splat(SLACK)).simd_min(R::one()).or_zero(!is_below);
    R::select(place.is_oriented & distance.simd_gt(R::zero()), bound, R::one())
}

/// What the lights of a node may send to a place, roughly: zero only where they send nothing.
#[inline(always)]
fn importance<R: Real>(table: &Table, at: R::UInt, active: R::Mask, place: &LanePlace<R>) -> R {
    let rows = table.node_rows::<R>(at, active);
    let way = rows.vector(node::CENTER) - place.from;
    let squared = way.length_squared();
    let strength = rows.number(node::STRENGTH);
    let radius = rows.number(node::RADIUS) + place.rounding;
    let radius_squared = radius * radius;
    let is_within = squared.simd_le(radius_squared);
    let cos_normals = rows.number(node::COS_NORMALS);
    let cos_light = rows.number(node::COS_LIGHT);
    let faces_all = cos_normals.simd_le(R::splat(-1.0));
    // The angle between the axis and the way, less that of the cone of normals, less that which the sphere is seen in.
    let cos_way = -rows.vector(node::AXIS).dot(way) / squared.sqrt();
    let sin_seen = (radius_squared / squared).simd_min(R::one()).sqrt();
    let angle = angle_less([cos_way, sine(cos_way)], [cos_normals, sine(cos_normals)]);
    let angle = angle_less(angle, [sine(sin_seen), sin_seen]);
    let slack = R::splat(SLACK);
    let faces = is_within | faces_all | cos_light.simd_lt(angle[0] + slack);
    let cosine = R::select(faces_all | is_within, R::one(), angle[0].simd_max(slack));
    let distance_squared = R::select(is_within, radius_squared, squared).simd_max(R::splat(1e-35));
    let at_place = cosine_at(&rows, way, place);
    let value = (at_place * cosine * strength / distance_squared).simd_max(R::splat(LEAST));
    value.or_zero(faces & at_place.simd_gt(R::zero()) & strength.simd_gt(R::zero()))
}

/// The share of the first child of a node, and whether anything shines there.
#[inline(always)]
fn share<R: Real>(
    table: &Table,
    at: R::UInt,
    second: R::UInt,
    active: R::Mask,
    place: &LanePlace<R>,
) -> (R, R::Mask) {
    let a = importance(table, at + R::UInt::splat(1), active, place);
    let b = importance(table, second, active, place);
    let share = a / (a + b);
    let shines = (a + b).simd_gt(R::zero());
    // Both may be beyond all numbers.
    (R::select(share.simd_eq(share), share, R::splat(0.5)), shines)
}

/// Whether anything may shine on a place.
#[inline(always)]
pub(super) fn shines_on<R: Real>(table: &Table, active: R::Mask, place: &LanePlace<R>) -> R::Mask {
    importance(table, R::UInt::splat(0), active, place).simd_gt(R::zero())
}

/// An emitter for each place. `u` has steps of `step`, and `more` are the digits below.
#[inline(always)]
pub(super) fn choose<R: Real>(
    table: &Table,
    active: R::Mask,
    place: &LanePlace<R>,
    u: R,
    step: R,
    more: R,
) -> LaneChosen<R> {
    let zero = R::UInt::splat(0);
    let (mut at, mut u, mut probability, mut valid) = (zero, u, R::one(), active);
    let mut level = 0;
    loop {
        if level == REFINED {
            u = (u + more * step / probability).simd_min(below_one());
        }
        level += 1;
        let next = R::UInt::gather(&table.next, R::UInt::select(valid, at, zero));
        let is_leaf = !(next & R::UInt::splat(LEAF)).simd_eq(zero);
        let open = valid & !is_leaf;
        if open.none() {
            let emitter = R::UInt::select(valid, next & R::UInt::splat(!LEAF), zero);
            return LaneChosen { emitter, probability, valid };
        }
        let (share, shines) = share(table, at, R::UInt::select(open, next, zero), open, place);
        valid = valid & (shines | !open);
        let open = open & shines;
        let is_first = u.simd_lt(share);
        let rest = R::select(is_first, u / share, (u - share) / (R::one() - share)).simd_min(below_one());
        u = R::select(open, rest, u);
        let part = R::select(is_first, share, R::one() - share);
        probability = R::select(open, probability * part, probability);
        let child = R::UInt::select(is_first, at + R::UInt::splat(1), next);
        at = R::UInt::select(open, child, at);
    }
}

/// The probability with which [`choose`] chooses an emitter.
#[inline(always)]
pub(super) fn probability<R: Real>(
    table: &Table,
    active: R::Mask,
    place: &LanePlace<R>,
    emitter: R::UInt,
) -> R {
    let zero = R::UInt::splat(0);
    let leaf = R::UInt::gather(&table.leaves, R::UInt::select(active, emitter, zero));
    let (mut at, mut probability, mut open) = (zero, R::one().or_zero(active), active);
    loop {
        open = open & !at.simd_eq(leaf);
        if open.none() {
            return probability;
        }
        let second = R::UInt::gather(&table.next, R::UInt::select(open, at, zero));
        let second = R::UInt::select(open, second, zero);
        let (share, shines) = share(table, at, second, open, place);
        let is_first = leaf.simd_lt(second);
        let part = R::select(is_first, share, R::one() - share).or_zero(shines);
        probability = R::select(open, probability * part, probability);
        open = open & shines;
        let child = R::UInt::select(is_first, at + R::UInt::splat(1), second);
        at = R::UInt::select(open, child, at);
    }
}

#[cfg(test)]
mod tests {
    use lumbre_geometry::Aabb;
    use lumbre_math::DVec3;
    use lumbre_math::random::RandomStream;

    use super::*;
    use crate::light::tree::{Emitter, Facing, LightTree};

    fn vector(random: &mut RandomStream) -> DVec3 {
        let mut x = || 2.0 * random.next_f64() - 1.0;
        DVec3::new(x(), x(), x())
    }

    fn lane_place(table: &Table, from: DVec3, normal: DVec3) -> LanePlace<f32> {
        let [x, y, z] = from.to_array();
        let n = normal.as_vec3();
        LanePlace::new(
            table,
            &Receiver { from: V3::new(x, y, z), normal: V3::new(n.x, n.y, n.z), time: None },
        )
    }

    #[test]
    fn every_light_can_be_chosen_and_densities_match() {
        let mut random = RandomStream::new(16);
        // Far from where numbers are fine, too.
        for (size, middle) in [(10.0, DVec3::ZERO), (10.0, DVec3::splat(3e4)), (2e5, DVec3::ONE)] {
            let lights: Vec<(Emitter, DVec3)> = (0..150)
                .map(|i| {
                    let half = 0.3 * vector(&mut random).abs() * f64::from(i % 4);
                    let at = middle + if i % 2 == 0 { size } else { 3.0 } * vector(&mut random);
                    let axis = vector(&mut random).normalize();
                    let facing = match i % 3 {
                        0 => Facing::ANY,
                        1 => Facing::side(axis),
                        _ => Facing::cone(axis, 0.9, 0.7),
                    };
                    let bounds = Aabb { min: at - half, max: at + half };
                    (Emitter { bounds, facing, strength: random.next_f64() }, axis)
                })
                .collect();
            let emitters: Vec<Emitter> = lights.iter().map(|light| light.0).collect();
            let table = Table::of_tree(&LightTree::new(&emitters).unwrap(), 0);
            let (mut shining, mut left_out) = (0, 0);
            for round in 0..300 {
                let from = middle + if round % 3 == 0 { 1.4 * size } else { 4.0 } * vector(&mut random);
                let normal = if round % 2 == 0 { DVec3::ZERO } else { vector(&mut random).normalize() };
                let place = lane_place(&table, from, normal);
                let mut sum = 0.0;
                for (i, (emitter, axis)) in (0..).zip(&lights) {
                    let within = vector(&mut random) * 0.5 * emitter.bounds.size();
                    let way = (from - (emitter.bounds.center() + within)).normalize();
                    let shines = match i % 3 {
                        0 => true,
                        1 => axis.dot(way) > 0.0,
                        _ => axis.dot(way) > 0.7,
                    };
                    let shines = shines && (normal == DVec3::ZERO || normal.dot(-way) > 0.0);
                    let probability = probability::<f32>(&table, true, &place, UInt::splat(i));
                    assert!(!shines || probability > 0.0, "{i} {from} {normal}");
                    shining += u32::from(shines);
                    left_out += u32::from(probability == 0.0);
                    sum += probability;
                }
                assert!(sum < 1.0 + 1e-4, "{sum}");
                let (u, more) = (random.next_f32(), random.next_f32());
                let chosen = choose::<f32>(&table, true, &place, u, 1.0 / 16_777_216.0, more);
                if chosen.valid {
                    let probability = probability::<f32>(&table, true, &place, chosen.emitter);
                    assert_eq!(probability, chosen.probability);
                }
            }
            assert!(shining > 8_000 && left_out > 5_000, "{shining} {left_out}");
        }
    }

    #[test]
    fn of_thousands_of_lights_each_has_its_turn() {
        let light = |i: u32| {
            let at = DVec3::new(f64::from(i % 256), f64::from(i / 256), 1e6);
            Emitter { bounds: Aabb::around([at]), facing: Facing::ANY, strength: 1.0 }
        };
        const COUNT: u32 = 1 << 15;
        let emitters: Vec<Emitter> = (0..COUNT).map(light).collect();
        let table = Table::of_tree(&LightTree::new(&emitters).unwrap(), 0);
        let place = lane_place(&table, DVec3::ZERO, DVec3::ZERO);
        let mut random = RandomStream::new(17);
        // Further digits are needed: one number of 24 bits has 512 for each.
        let mut found = std::collections::HashSet::new();
        for i in 0..8 * COUNT {
            let u = (i as f32 + 0.5) / (8 * COUNT) as f32;
            let chosen = choose::<f32>(&table, true, &place, u, 1.0 / 16_777_216.0, random.next_f32());
            found.insert(chosen.emitter.to_lanes()[0]);
            assert!((chosen.probability * COUNT as f32 - 1.0).abs() < 0.1, "{}", chosen.probability);
        }
        assert_eq!(found.len(), COUNT as usize);
    }
}
