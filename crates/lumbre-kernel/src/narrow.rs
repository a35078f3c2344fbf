//! Rays in single precision, in trees of nothing but meshes: what is asked where speed counts more than the last digits.
//!
//! The test is that of S. Woop, C. Benthin, I. Wald, "Watertight Ray/Triangle Intersection", JCGT 2(1), 2013, and simpler than the one
//! in double precision (see [`triangles`](crate::triangles)): triangles are closed, so that a ray through an edge meets all that have it,
//! which makes no difference to the nearest hit and to whether there is one. Where that would be imprecise, products are computed exactly.
//! Nothing depends on the instruction set: no product is fused with a sum.
//!
//! The ray is that from its start relative to the mesh, rounded once. All that follows is meant of it.
//!
//! # Why nothing leaks
//!
//! Where a corner comes to lie in the ray's sheared space is computed of the ray and the corner alone, so that it is the same for all
//! triangles that share it. The line of the ray passes through a closed mesh of those corners: not through the rim of one of them only,
//! but, if it is moved by ever so little into general position, through the inside of one that is not seen on edge; and as triangles are
//! closed and finitely many, there is one that it passes through, and is not seen on edge, without being moved. Its edge functions have
//! one sign, or are zero. An edge function is the difference of two rounded products. Rounding keeps their order or makes them equal, and
//! so it has the exact sign or is zero: that triangle is not left out. Where one came out as zero it is computed again by exact products,
//! which those of two numbers of single precision are in double precision, and so has the exact sign.
//!
//! # Why boxes lose nothing
//!
//! Let u = 2⁻²⁴, h the largest distance of the mesh from the ray's start along the last axis, and lengths be in tree units. The sheared
//! corners are off by u(2m + 6.1h) from exact ones, where m ≤ 4.1 for a triangle around the ray: by two roundings of what they are, and
//! of the height, the shear (which is off by 3u, and no more than 1), and their product. Where all edge functions e are strictly of one
//! sign, their exact ones are too, and the ray does pass through the computed triangle, at the height Σ e z / Σ e of exact ones.
//! Each is off by 2u(p + |e|), where p is the largest product, so that the height as computed is off by 6u(p / |Σ e| + 1) times the extent
//! of the triangle along the ray, and by 7uh for the roundings of sums, products and heights. That is why p times the extent has to be
//! below 2 |Σ e|, which leaves 24.2u; else, and where one is zero, weights come from exact products, and their height is off by 2uh.
//!
//! So the hit lies within u(8.2 + 6.1h) + 24.2u + 7uh of the triangle on each axis, where h ≤ 1.01 + |o|: below
//! u(47 + 14|o|). And as planes are relative to the tree's origin, which the ray knows rounded, by a little more than u times its
//! distance from the mesh's: `Units::narrow_margin` has room for all of it beside what is said in [`node`](crate::node). `t` itself is
//! off by three roundings, which the ends of the range among boxes have room for, too.
//!
//! So no box is passed by with a hit in it that is as near as the nearest: the answer is that of a loop over all triangles, whatever
//! the tree.

mod alone;
mod batch;
mod flyer;
mod packet;

use std::marker::PhantomData;

use bytemuck::Zeroable;

use crate::anything::Whole;
use crate::batch::Ends;
use crate::blocks::TriangleBlock;
use crate::fleet::Crossing;
use crate::holds::{Contents, SingleStart};
use crate::lanes::{self, Asked, Axes, Eight, Lanes, Level, Question, Task, Vector, Wide};
use crate::packet::Companion;
use crate::query::All;
use crate::single::{self, Alone, Exact, Outcome, Winner};
use crate::single_spheres::AloneAmongSpheres;
use crate::stack::{AsBuilt, ByDistance, Order};
use crate::traverse::Place;
use crate::triangles::BLOCK;
use crate::{Accel, Hit, Hit32, Ray32};

pub(crate) use self::batch::search_all;
#[cfg(test)]
pub(crate) use self::batch::search_triangles;
use self::packet::Packet;

/// A ray in single precision among triangles.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NarrowRay {
    /// The axes that become x, y and z; z is the direction's largest.
    pub(crate) axes: &'static Axes,
    /// Relative to the mesh, in the order of the axes; the last of four is the smallest `t`.
    pub(crate) origin: [f32; 4],
    /// The direction by its z, of which x and y count; the last of four is the largest `t`.
    pub(crate) shear: [f32; 4],
    /// From what is behind a corner, with the sign turned, to `t`.
    pub(crate) minus_inverse: f32,
}

/// Where weights are precise enough: the largest product times the extent of the triangle and a little is no more than their sum times
/// so much. See above.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Precise {
    /// The same by the longest side of all boxes in place of the extent: where the largest product is no more than the sum times this, one
    /// need not look at heights. What these are wrong by, as rounded, is less than the little.
    at_once: f32,
    most: f32,
    little: f32,
}

impl Precise {
    /// For a tree in which no side of a triangle's box is longer, but for rounding.
    pub(crate) fn new(space_per_unit: f32, longest_side: f32) -> Self {
        let most = 2.0 * space_per_unit;
        let little = most * (1.0 / 1024.0);
        // More than what rounding may take away, here and of the side.
        const MORE: f32 = 1.0 + 8.0 * f32::EPSILON;
        Self { at_once: most / (MORE * (longest_side + little)), most, little }
    }

    /// A bit for each of the mask that is: by the largest product, how far within the triangle the line is, the sum of the edge functions, and the
    /// heights of the corners. Other bits mean nothing.
    #[inline(always)]
    pub(crate) fn of<V: Vector>(&self, mask: u32, largest: V, within: V, sum: V, z: [V; 3]) -> u32 {
        let is_strict = V::splat(0.0).below(within);
        let largest = largest + V::splat(TINY);
        let sum = sum.abs();
        let at_once = is_strict & largest.at_most(sum * V::splat(self.at_once));
        if mask & !at_once == 0 {
            return at_once;
        }
        let extent = z[0].max(z[1]).max(z[2]) - z[0].min(z[1]).min(z[2]);
        let least = largest * (extent + V::splat(self.little));
        at_once | is_strict & least.at_most(sum * V::splat(self.most))
    }
}

/// The least of the edge functions, or of their opposites, whichever is more: how far within the triangle the line is.
#[inline(always)]
fn within<V: Vector>([u, v, w]: [V; 3]) -> V {
    let opposite = u.max(v).max(w).turned_by(V::splat(-0.0));
    u.min(v).min(w).max(opposite)
}

/// What products may lose by underflow is nothing beside this.
const TINY: f32 = 1.0 / (1u128 << 80) as f32;

/// How a line passes the triangles of a block, as it is seen at first.
struct Lines<E> {
    /// The first of the two products that each edge function is the difference of.
    products: [E; 3],
    edges: [E; 3],
    within: E,
    heights: [E; 3],
}

impl<E: Vector> Lines<E> {
    /// By corners in the sheared space of the ray, and a bit for each triangle that it may pass through.
    #[inline(always)]
    fn of([x, y, heights]: [[E; 3]; 3]) -> (u32, Self) {
        let products = [x[2] * y[1], x[0] * y[2], x[1] * y[0]];
        let edges = [products[0] - y[2] * x[1], products[1] - y[0] * x[2], products[2] - y[1] * x[0]];
        let within = within(edges);
        (E::splat(0.0).at_most(within), Self { products, edges, within, heights })
    }

    /// What is needed of triangles that it may pass through, and a bit for each of the mask that has to be looked at closer.
    #[inline(always)]
    fn pass(self, mask: u32, precise: &Precise) -> (u32, Pass<E>) {
        let Self { products: [bc, ca, ab], edges: [u, v, w], within, heights: z } = self;
        let det = u + v + w;
        let largest = bc.larger(ca).larger(ab);
        let unclear = mask & !precise.of(mask, largest, within, det, z);
        (unclear, Pass { height: u * z[0] + v * z[1] + w * z[2], weights: [v, w, det] })
    }
}

/// How a line passes the triangles of a block.
#[derive(Clone, Copy, Zeroable)]
pub(crate) struct Pass<E> {
    /// Where along it, times the sum of all weights.
    height: E,
    /// Those of the second and third corner, and the sum of all.
    weights: [E; 3],
}

/// How a line passes the triangles of a block, and which of these its ray meets.
type Passed<E> = (Crossing<E>, Pass<E>);

impl<E: Eight> Pass<E> {
    /// The weights of one.
    #[inline(always)]
    fn weights_of(&self, lane: usize) -> [f32; 3] {
        let [v, w, det] = self.weights;
        [v.lane(lane), w.lane(lane), det.lane(lane)]
    }

    /// Those of all.
    #[inline(always)]
    fn all_weights(&self) -> [[f32; BLOCK]; 3] {
        let [v, w, det] = self.weights;
        [v.to_array(), w.to_array(), det.to_array()]
    }
}

impl<W: Wide> Pass<W> {
    /// That of one of the two: `which` is 0 or 1.
    #[inline(always)]
    fn half(&self, which: usize) -> Pass<W::Half> {
        let Self { height, weights: [v, w, det] } = self;
        Pass { height: height.half(which), weights: [v.half(which), w.half(which), det.half(which)] }
    }

    /// Those of two.
    #[inline(always)]
    fn of_two(first: &Pass<W::Half>, second: &Pass<W::Half>) -> Self {
        Self {
            height: W::of_two(first.height, second.height),
            weights: lanes::three_of_two(&first.weights, &second.weights),
        }
    }
}

/// The nearest crossing so far, if there is one. With a ray it takes a cache line, which many rays in flight are to find there.
#[derive(Clone, Copy)]
pub(crate) struct Nearest {
    /// The place of its block, and the lane in the last three bits.
    place: u32,
    /// The weights of the second and third corner, and the sum of all.
    weights: [f32; 3],
}

const _: () = assert!(size_of::<NarrowRay>() + size_of::<Nearest>() <= 64);

impl Nearest {
    /// There is no block there: it would reach beyond where blocks may begin.
    const NONE: Self = Self { place: u32::MAX, weights: [0.0; 3] };

    #[inline(always)]
    fn new(block: u32, lane: u32, weights: [f32; 3]) -> Self {
        Self { place: block * BLOCK as u32 + lane, weights }
    }

    /// The place of its block, and the lane.
    #[inline(always)]
    fn triangle(&self) -> Option<(u32, u32)> {
        if self.place == u32::MAX {
            None
        } else {
            Some((self.place / BLOCK as u32, self.place % BLOCK as u32))
        }
    }

    /// Takes what is nearer of what a ray meets in a block, and ends the ray there; whether there was anything.
    #[inline(always)]
    fn take<E: Eight>(
        &mut self,
        exact: &Exact,
        ray: &mut NarrowRay,
        place: u32,
        crossing: &Crossing<E>,
        pass: &Pass<E>,
    ) -> bool {
        let &Crossing { met, unclear, at } = crossing;
        if met | unclear == 0 {
            return false;
        }
        let t = at.to_array();
        let lane = single::nearest_of(met, &t);
        self.take_nearest(exact, ray, place, crossing, pass, (lane, t[lane]))
    }

    /// The same where it is known in which lane the ray meets the nearest, if it does meet any, and at which `t`.
    #[inline(always)]
    fn take_nearest<E: Eight>(
        &mut self,
        exact: &Exact,
        ray: &mut NarrowRay,
        place: u32,
        crossing: &Crossing<E>,
        pass: &Pass<E>,
        (lane, t): (usize, f32),
    ) -> bool {
        let &Crossing { met, unclear, at } = crossing;
        let others = at.at_most(E::splat(t)) & met & !(1 << lane);
        if unclear | others == 0 && t < ray.t_max() {
            *self = Self::new(place, lane as u32, pass.weights_of(lane));
            ray.end_at(t);
            return true;
        }
        let at = at.to_array();
        self.take_closely(exact, ray, place, &Crossing { met, unclear, at }, &pass.all_weights())
    }

    /// The same where a triangle has to be looked at closer, or two are met at the same place, of whatever block.
    #[cold]
    #[inline(never)]
    fn take_closely(
        &mut self,
        exact: &Exact,
        ray: &mut NarrowRay,
        place: u32,
        crossing: &Crossing<[f32; BLOCK]>,
        weights: &[[f32; BLOCK]; 3],
    ) -> bool {
        let &Crossing { met, unclear, ref at } = crossing;
        let mut is_nearer = false;
        let mut rest = met | unclear;
        while rest != 0 {
            let lane = rest.trailing_zeros();
            rest &= rest - 1;
            let (t, weights) = if unclear >> lane & 1 == 0 {
                let lane = lane as usize % BLOCK;
                (at[lane], weights.map(|weights| weights[lane]))
            } else {
                match ray.cross_exactly(exact.block(place), lane) {
                    Some(crossing) => crossing,
                    None => continue,
                }
            };
            if t < ray.t_max() || t == ray.t_max() && self.comes_after(exact, place, lane) {
                *self = Self::new(place, lane, weights);
                ray.end_at(t);
                is_nearer = true;
            }
        }
        is_nearer
    }

    /// Whether a triangle that is met where this is comes before it.
    fn comes_after(&self, exact: &Exact, block: u32, lane: u32) -> bool {
        match self.triangle() {
            Some((own_block, own_lane)) => exact.names(block, lane) < exact.names(own_block, own_lane),
            None => true,
        }
    }

    /// As a hit at this `t`, if there is one.
    #[inline(always)]
    fn hit(&self, exact: &Exact, t: f32) -> Option<Hit32> {
        let (block, lane) = self.triangle()?;
        let (geometry, primitive) = exact.names(block, lane);
        let [v, w, det] = self.weights;
        Some(Hit32 {
            t,
            local: [v / det, w / det],
            id: exact.accel().geometries[geometry as usize].id,
            primitive,
            geometry,
            instance: Hit32::NO_INSTANCE,
        })
    }
}

impl NarrowRay {
    /// Of no ray.
    pub(crate) fn of_none() -> Self {
        Self { axes: Axes::by_bits(0, 0), origin: [0.0; 4], shear: [0.0; 4], minus_inverse: 0.0 }
    }

    #[inline(always)]
    fn t_min(&self) -> f32 {
        self.origin[3]
    }

    #[inline(always)]
    fn t_max(&self) -> f32 {
        self.shear[3]
    }

    #[inline(always)]
    fn end_at(&mut self, t_max: f32) {
        self.shear[3] = t_max;
    }

    /// How the line of the ray passes the triangles of a block, and a bit for each that it may pass through.
    #[inline(always)]
    fn lines<L: Lanes>(&self, block: &TriangleBlock) -> (u32, Lines<L::Eight>) {
        let (mask, lines) = Lines::of(L::narrow_corners(block, lanes::opaque(self)));
        (mask & block.taken(), lines)
    }

    /// The same of two rays, each among the triangles of its block: those of the first, and those of the second.
    #[inline(always)]
    fn lines_by_two<L: Lanes>(rays: [&Self; 2], blocks: [&TriangleBlock; 2]) -> (u32, Lines<L::Wide>) {
        let (mask, lines) = Lines::of(L::narrow_corners_by_two(blocks, rays));
        (mask & (blocks[0].taken() | blocks[1].taken() << BLOCK), lines)
    }

    /// Where the ray meets the triangles of a block that its line passes so, and which of those in the mask it does meet.
    #[inline(always)]
    fn cross<E: Eight>(&self, mask: u32, pass: &Pass<E>) -> (u32, E) {
        // Read again: most lines pass through few blocks.
        let ray = lanes::opaque(self);
        let t = pass.height.over(pass.weights[2]) * E::splat(ray.minus_inverse);
        (mask & E::splat(ray.t_min()).at_most(t) & t.at_most(E::splat(ray.t_max())), t)
    }

    /// Which triangles of a block the ray meets; `None` where its line passes through none.
    #[inline(always)]
    fn pass<L: Lanes>(&self, precise: &Precise, block: &TriangleBlock) -> Option<Passed<L::Eight>> {
        let (mask, lines) = self.lines::<L>(block);
        if mask == 0 {
            return None;
        }
        let (unclear, pass) = lines.pass(mask, precise);
        let (met, at) = self.cross(mask & !unclear, &pass);
        Some((Crossing { met, unclear, at }, pass))
    }

    /// Where the ray meets a triangle, by exact products; the weights of the second and third corner, and the sum of all.
    #[cold]
    #[inline(never)]
    fn cross_exactly(&self, block: &TriangleBlock, lane: u32) -> Option<(f32, [f32; 3])> {
        let corners = self.axes.gather(block, lane as usize).map(|[x, y, z]| {
            let height = self.origin[2] - z;
            let x = (self.origin[0] - x) - self.shear[0] * height;
            let y = (self.origin[1] - y) - self.shear[1] * height;
            [f64::from(x), f64::from(y), f64::from(height)]
        });
        let [a, b, c] = corners;
        let edge = |p: [f64; 3], q: [f64; 3]| p[0] * q[1] - p[1] * q[0];
        let (u, v, w) = (edge(c, b), edge(a, c), edge(b, a));
        let is_inside = u.min(v).min(w) >= 0.0 || u.max(v).max(w) <= 0.0;
        let det = u + v + w;
        if !is_inside || det == 0.0 {
            return None;
        }
        let t = ((u * a[2] + v * b[2] + w * c[2]) / det * f64::from(self.minus_inverse)) as f32;
        (self.t_min() <= t && t <= self.t_max()).then(|| (t, [(v / det) as f32, (w / det) as f32, 1.0]))
    }

    /// Whether the ray meets any triangle of a block.
    #[inline(always)]
    fn meets_any<L: Lanes>(&self, precise: &Precise, block: &TriangleBlock) -> bool {
        match self.pass::<L>(precise, block) {
            Some((Crossing { met, unclear, .. }, _)) => {
                met != 0 || unclear != 0 && self.meets_exactly(block, unclear)
            }
            None => false,
        }
    }

    /// Whether the ray meets one of these.
    #[cold]
    #[inline(never)]
    fn meets_exactly(&self, block: &TriangleBlock, mut mask: u32) -> bool {
        while mask != 0 {
            let lane = mask.trailing_zeros();
            mask &= mask - 1;
            if self.cross_exactly(block, lane).is_some() {
                return true;
            }
        }
        false
    }
}

/// What is asked of a ray.
pub(crate) trait Goal: Sized {
    /// Which boxes come first.
    type Order: Order;
    /// What is handed out.
    type Answer: Copy;
    /// Whether any hit will do.
    const IS_ANY: bool;
    /// The question of a ray alone, at a level.
    fn alone_at(level: Level) -> Asked<Self::Answer, Ray32> {
        level.asked::<Narrowly<Self>>()
    }
    /// The same in double precision.
    type Wide: Companion;
    /// What that finds in a tree itself, rounded.
    fn rounded(accel: &Accel, answer: <Self::Wide as single::Goal>::Answer) -> Self::Answer;
    /// The same, put there: what goes through memory is waited for.
    #[inline(always)]
    fn put_rounded(accel: &Accel, answer: <Self::Wide as single::Goal>::Answer, place: &mut Self::Answer) {
        *place = Self::rounded(accel, answer);
    }
    /// The same of what it hands out.
    fn rounded_found(found: <Self::Wide as single::Goal>::Found) -> Self::Answer;
    /// Searches along a ray alone; not where it does not come from nearby.
    fn alone<L: Lanes>(exact: &Exact, ray: &Ray32) -> Outcome<Self::Answer>;
    /// What double precision says.
    fn widely(accel: &Accel, ray: &Ray32) -> Self::Answer;
    /// The answer of a ray in flight: whether any hit `is_met`, or the nearest, at this `t`.
    fn answer(exact: &Exact, is_met: bool, nearest: &Nearest, t: f32) -> Self::Answer;
    /// Puts the answers of rays that went together, the first of which has this position.
    fn answer_together<L: Lanes>(packet: &Packet, first: usize, ends: &mut impl Ends<Self::Answer>);
}

/// The nearest hit.
pub(crate) enum Closest {}

/// Whether there is a hit.
pub(crate) enum Any {}

impl Goal for Closest {
    type Order = ByDistance;
    type Answer = Option<Hit32>;
    type Wide = single::Nearest;
    const IS_ANY: bool = false;

    #[inline(always)]
    fn rounded(accel: &Accel, winner: Option<Winner>) -> Option<Hit32> {
        // No `map`: it does not take on the instruction set of who calls it.
        Some(rounded(accel, &winner?))
    }

    #[inline(always)]
    fn put_rounded(accel: &Accel, winner: Option<Winner>, place: &mut Option<Hit32>) {
        match winner {
            Some(winner) => *place = Some(rounded(accel, &winner)),
            None => *place = None,
        }
    }

    #[inline(always)]
    fn rounded_found(found: Option<Hit>) -> Option<Hit32> {
        found.as_ref().map(narrowed)
    }

    #[inline(always)]
    fn alone<L: Lanes>(exact: &Exact, ray: &Ray32) -> Outcome<Self::Answer> {
        alone::closest::<L>(exact, ray)
    }

    #[inline(never)]
    fn widely(accel: &Accel, ray: &Ray32) -> Option<Hit32> {
        accel.closest(&ray.to_f64()).map(|hit| narrowed(&hit))
    }

    #[inline(always)]
    fn answer(exact: &Exact, _: bool, nearest: &Nearest, t: f32) -> Option<Hit32> {
        nearest.hit(exact, t)
    }

    #[inline(always)]
    fn answer_together<L: Lanes>(packet: &Packet, first: usize, ends: &mut impl Ends<Option<Hit32>>) {
        packet.put_nearest::<L>(first, ends);
    }
}

impl Goal for Any {
    type Order = AsBuilt;
    type Answer = bool;
    type Wide = single::Whether;
    const IS_ANY: bool = true;

    #[inline(always)]
    fn rounded(_: &Accel, is_met: bool) -> bool {
        is_met
    }

    #[inline(always)]
    fn rounded_found(is_met: bool) -> bool {
        is_met
    }

    #[inline(always)]
    fn alone<L: Lanes>(exact: &Exact, ray: &Ray32) -> Outcome<bool> {
        alone::any::<L>(exact, ray)
    }

    #[inline(never)]
    fn widely(accel: &Accel, ray: &Ray32) -> bool {
        accel.any(&ray.to_f64())
    }

    #[inline(always)]
    fn answer(_: &Exact, is_met: bool, _: &Nearest, _: f32) -> bool {
        is_met
    }

    #[inline(always)]
    fn answer_together<L: Lanes>(packet: &Packet, first: usize, ends: &mut impl Ends<bool>) {
        packet.put_met(first, ends);
    }
}

/// A hit that a tree has itself, in double precision, rounded.
#[inline(always)]
fn rounded(accel: &Accel, winner: &Winner) -> Hit32 {
    let &Winner { root, geometry, primitive } = winner;
    Hit32 {
        t: root.t as f32,
        local: [root.local.x as f32, root.local.y as f32],
        id: accel.geometries[geometry as usize].id,
        primitive,
        geometry,
        instance: Hit32::NO_INSTANCE,
    }
}

/// An answer in double precision, rounded.
fn narrowed(hit: &Hit) -> Hit32 {
    Hit32 {
        t: hit.root.t as f32,
        local: [hit.root.local.x as f32, hit.root.local.y as f32],
        id: hit.id,
        primitive: hit.primitive,
        geometry: hit.geometry,
        instance: hit.instances.first().copied().unwrap_or(Hit32::NO_INSTANCE),
    }
}

/// What is asked of rays in single precision, one after another.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NarrowQuestions {
    /// [`Accel::closest_f32`].
    pub(crate) closest: Asked<Option<Hit32>, Ray32>,
    /// [`Accel::any_f32`].
    pub(crate) any: Asked<bool, Ray32>,
}

impl NarrowQuestions {
    pub(crate) fn new(level: Level, start: Option<&SingleStart>) -> Self {
        match start.map(|start| start.contents) {
            Some(Contents::Triangles) => {
                Self { closest: level.asked::<Narrowly<Closest>>(), any: level.asked::<Narrowly<Any>>() }
            }
            Some(Contents::Shapes) => Self {
                closest: level.asked::<AmongShapes<Closest>>(),
                any: level.asked::<AmongShapes<Any>>(),
            },
            Some(Contents::Spheres) => Self {
                closest: level.asked::<AmongSpheres<Closest>>(),
                any: level.asked::<AmongSpheres<Any>>(),
            },
            Some(Contents::Anything) => Self {
                closest: level.asked::<AmongAnything<Closest>>(),
                any: level.asked::<AmongAnything<Any>>(),
            },
            None => Self { closest: level.asked::<Widely<Closest>>(), any: level.asked::<Widely<Any>>() },
        }
    }
}

/// In single precision.
struct Narrowly<G>(PhantomData<G>);
/// In double precision, rounded, in a tree of shapes and custom geometry, too.
struct AmongShapes<G>(PhantomData<G>);
/// The same in a tree of nothing but spheres.
struct AmongSpheres<G>(PhantomData<G>);
/// The same in a tree of anything.
struct AmongAnything<G>(PhantomData<G>);
/// In double precision, rounded.
struct Widely<G>(PhantomData<G>);

impl<G: Goal> Question for Narrowly<G> {
    type Ray = Ray32;
    type Answer = G::Answer;

    #[inline(always)]
    fn ask<L: Lanes>(accel: &Accel, ray: &Ray32) -> G::Answer {
        match &accel.single {
            Some(start) => alone::search::<G, L>(&Exact::new(accel, start), ray),
            None => G::widely(accel, ray),
        }
    }
}

impl<G: Goal> Question for AmongShapes<G> {
    type Ray = Ray32;
    type Answer = G::Answer;

    #[inline(always)]
    fn ask<L: Lanes>(accel: &Accel, ray: &Ray32) -> G::Answer {
        if let Some(start) = &accel.single
            && let wide = L::read_widened(ray)
            && let Outcome::Settled(answer) = Alone::<G::Wide, true>::new(accel, start, &wide).run::<L>()
        {
            return G::rounded(accel, answer);
        }
        G::widely(accel, ray)
    }
}

impl<G: Goal> Question for AmongSpheres<G> {
    type Ray = Ray32;
    type Answer = G::Answer;

    #[inline(always)]
    fn ask<L: Lanes>(accel: &Accel, ray: &Ray32) -> G::Answer {
        if let Some(start) = &accel.single
            && let wide = L::read_widened(ray)
            && let Outcome::Settled(answer) =
                AloneAmongSpheres::<G::Wide>::new(accel, start, start.root, &wide).run::<L>()
        {
            return G::rounded(accel, answer);
        }
        G::widely(accel, ray)
    }
}

impl<G: Goal> Question for AmongAnything<G> {
    type Ray = Ray32;
    type Answer = G::Answer;

    #[inline(always)]
    fn ask<L: Lanes>(accel: &Accel, ray: &Ray32) -> G::Answer {
        let around = &Place::default();
        if let Some(start) = &accel.single
            && let wide = L::read_widened(ray)
            && let Outcome::Settled(found) =
                Whole::<G::Wide, All>::new(accel, start, around, &wide).run::<L>()
        {
            return G::rounded_found(found);
        }
        G::widely(accel, ray)
    }
}

impl<G: Goal> Question for Widely<G> {
    type Ray = Ray32;
    type Answer = G::Answer;

    #[inline(always)]
    fn ask<L: Lanes>(accel: &Accel, ray: &Ray32) -> G::Answer {
        G::widely(accel, ray)
    }
}
