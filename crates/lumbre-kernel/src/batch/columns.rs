//! Picture rays: columns in, columns out.
//!
//! If single precision can traverse the tree, rays are rounded once, relative to the mesh's origin, and traversed like
//! [`Ray32`]: coherent rays in packets, the others one by one in small trees and interleaved in large ones. All other
//! rays are traversed in double precision. Each answer depends only on its ray.

use std::marker::PhantomData;

use lumbre_geometry::Ray;

use super::f32_packet::{F32Bundle, PictureRay};
use super::{AnyHit, Batch, ClosestHit, F32, Plan, Precision, Sink, batch_f64};
use crate::columns::{HitColumns, RayColumns};
use crate::intersect::{Dispatch, Isa, Simd};
use crate::ray32::{Hit32, Ray32};
use crate::simd;
use crate::trace::decide::Decider;
use crate::trace::filtered::Queries;
use crate::trace::filtered_ray::Found;
use crate::trace::picture::{Crossing, LocalRay, Search};
use crate::trace::stack::Goal;
use crate::trace::{ContextRef, Outcome, exact, f32_ray};
use crate::tree::Tree;
use crate::tree::filter_start::FilterStart;
use crate::tree::packed::Start;
use crate::tree::picture_start::PictureStart;

/// Rays that are transposed at a time.
const PIECE: usize = 4096;

/// [`Accel::closest_columns`].
pub(crate) fn closest(isa: Isa, tree: &Tree, rays: &RayColumns, exact: bool, hits: &mut HitColumns) {
    rays.check();
    hits.clear(rays.len());
    match tree.picture_start() {
        Some(picture) if !exact => {
            let answer = &mut Closest { tree, isa, rays, hits };
            traverse_f32::<ClosestHit, _>(isa, tree, picture, rays, answer);
        }
        _ => traverse_f64(rays, |rays, first| {
            let sink = &mut F64Closest { tree, isa, rays, first, hits };
            if !batch_f64::<ClosestHit, _>(isa, tree, rays, sink, Plan::SINGLES) {
                let closest = Queries::of(isa, tree).closest;
                for (i, ray) in rays.iter().enumerate() {
                    if let Some(hit) = closest.ask(tree, ray) {
                        hits.put_hit(first + i, tree, hit);
                    }
                }
            }
        }),
    }
}

/// [`Accel::any_columns`].
pub(crate) fn any(isa: Isa, tree: &Tree, rays: &RayColumns, exact: bool, occluded: &mut Vec<bool>) {
    rays.check();
    occluded.clear();
    occluded.resize(rays.len(), false);
    match tree.picture_start() {
        Some(picture) if !exact => {
            let answer = &mut Any { tree, isa, rays, occluded };
            traverse_f32::<AnyHit, _>(isa, tree, picture, rays, answer);
        }
        _ => traverse_f64(rays, |rays, first| {
            super::any_by(isa, tree, rays, &mut occluded[first..first + rays.len()], Plan::SINGLES);
        }),
    }
}

/// Calls `answer` with pieces of the rays in double precision, each with the position of its first.
fn traverse_f64(columns: &RayColumns, mut answer: impl FnMut(&[Ray], usize)) {
    let mut rays = Vec::with_capacity(columns.len().min(PIECE));
    for first in (0..columns.len()).step_by(PIECE) {
        rays.clear();
        rays.extend((first..columns.len().min(first + PIECE)).map(|i| columns.ray(i)));
        answer(&rays, first);
    }
}

/// Traverses rays in single precision, piece by piece.
fn traverse_f32<G: Goal, A: Answer>(
    isa: Isa,
    tree: &Tree,
    picture: &PictureStart,
    columns: &RayColumns,
    answer: &mut A,
) {
    let start = &picture.start;
    let piece = if start.only_triangles { PIECE } else { PIECE / 4 };
    let (mut alone, mut both) = (Vec::new(), Vec::new());
    for first in (0..columns.len()).step_by(piece) {
        let range = first..columns.len().min(first + piece);
        if start.only_triangles {
            alone.clear();
            columns.push_local(picture, range, &mut alone);
            let rays = &alone[..];
            let sink = &mut F32Sink { tree, isa, start: picture, rays, first, answer };
            batch::<F32<G>, _>(isa, tree, start, rays, sink, Plan::of_picture(tree));
        } else {
            both.clear();
            let some = columns.slice(range);
            both.extend(
                (0..some.len()).map(|i| PictureRay { local: some.local(picture, i), ray: some.ray(i) }),
            );
            let sink = &mut PictureSink { first, answer };
            batch::<Picture<G>, _>(isa, tree, start, &both, sink, Plan::SINGLES);
        }
    }
}

/// Traverses rays in packets, or one by one if packets are not used.
fn batch<P: Precision, S: Sink<P::Answer>>(
    isa: Isa,
    tree: &Tree,
    start: &FilterStart,
    rays: &[P::Ray],
    sink: &mut S,
    plan: Plan,
) {
    if super::batched(isa, tree).is_some() {
        isa.run_with_vectors(Batch::<P, S> { tree, start, rays, sink, plan });
    } else {
        isa.run(OneByOne::<P, S> { tree, start, rays, sink });
    }
}

/// Rays one by one, if packets are not used.
struct OneByOne<'a, P: Precision, S> {
    tree: &'a Tree,
    start: &'a FilterStart,
    rays: &'a [P::Ray],
    sink: &'a mut S,
}

impl<P: Precision, S: Sink<P::Answer>> Dispatch for OneByOne<'_, P, S> {
    type Output = ();

    #[inline(always)]
    fn run<L: Simd>(self) {
        let decider = &Decider::new(self.tree, self.start);
        for (i, ray) in self.rays.iter().enumerate() {
            self.sink.put(i, P::traverse_alone::<L>(decider, simd::opaque(ray)));
        }
    }
}

/// Single precision in trees of any primitives.
struct Picture<G>(PhantomData<G>);

impl<G: Goal> Precision for Picture<G> {
    type Goal = G;
    type Ray = PictureRay;
    type Answer = Option<Crossing>;
    type Bundle<'a, 'd>
        = F32Bundle<'a, 'd, G, PictureRay>
    where
        'a: 'd;
    const PREFETCHES_RAYS: bool = false;

    #[inline(always)]
    fn traverse_alone<L: Simd>(decider: &Decider, ray: &PictureRay) -> Outcome<Option<Crossing>> {
        let tree = decider.tree();
        let Some(picture) = &tree.picture else { return Outcome::Uncertain };
        let PictureRay { local, ray } = ray;
        let (local, limit) = (LocalRay::new(*simd::opaque(local)), ray.t_max);
        Search { tree, picture, from: Start::WHOLE, ray, local, limit }.run::<G, L, true>()
    }

    // Leaves of other primitives keep single rays busy.
    #[inline(always)]
    fn interleave<L: Simd>(
        decider: &Decider,
        _: bool,
        rays: &[PictureRay],
        positions: &[usize],
        sink: &mut impl Sink<Option<Crossing>>,
    ) {
        for &i in positions {
            sink.put(i, Self::traverse_alone::<L>(decider, simd::opaque(&rays[i])));
        }
    }
}

/// The answers of a piece, in a tree of any primitives.
struct PictureSink<'a, A> {
    first: usize,
    answer: &'a mut A,
}

impl<A: Answer> Sink<Option<Crossing>> for PictureSink<'_, A> {
    #[inline(always)]
    fn put(&mut self, position: usize, outcome: Outcome<Option<Crossing>>) {
        match outcome {
            Outcome::Certain(None) => {}
            Outcome::Certain(Some(crossing)) => self.answer.put_crossing(self.first + position, crossing),
            Outcome::Uncertain => self.answer.put_exactly(self.first + position),
        }
    }
}

/// A single ray that a batch gave up.
struct Alone<'a, G> {
    tree: &'a Tree,
    picture: &'a PictureStart,
    ray: &'a Ray32,
    goal: PhantomData<G>,
}

impl<G: Goal> Dispatch for Alone<'_, G> {
    type Output = Outcome<Option<Hit32>>;

    #[inline(always)]
    fn run<L: Simd>(self) -> Self::Output {
        f32_ray::traverse::<G, L>(&Decider::new(self.tree, &self.picture.start), self.ray)
    }
}

/// Receives the answers of rays in single precision.
trait Answer {
    type Goal: Goal;
    /// The answer for a ray, by its position among all.
    fn put(&mut self, position: usize, hit: Option<Hit32>);
    /// The answer in a tree of any primitives.
    fn put_crossing(&mut self, position: usize, crossing: Crossing);
    /// The answer by double precision.
    fn put_exactly(&mut self, position: usize);
}

/// The answers of a piece.
struct F32Sink<'a, A> {
    tree: &'a Tree,
    isa: Isa,
    start: &'a PictureStart,
    rays: &'a [Ray32],
    first: usize,
    answer: &'a mut A,
}

impl<A: Answer> F32Sink<'_, A> {
    #[cold]
    #[inline(never)]
    fn put_alone(&mut self, position: usize) {
        let (tree, picture, ray) = (self.tree, self.start, &self.rays[position]);
        let alone = Alone::<A::Goal> { tree, picture, ray, goal: PhantomData };
        match self.isa.run(alone) {
            Outcome::Certain(hit) => self.answer.put(self.first + position, hit),
            Outcome::Uncertain => self.answer.put_exactly(self.first + position),
        }
    }
}

impl<A: Answer> Sink<Option<Hit32>> for F32Sink<'_, A> {
    #[inline(always)]
    fn put(&mut self, position: usize, outcome: Outcome<Option<Hit32>>) {
        match outcome {
            Outcome::Certain(hit) => self.answer.put(self.first + position, hit),
            Outcome::Uncertain => self.put_alone(position),
        }
    }
}

/// See [`closest`].
struct Closest<'a> {
    tree: &'a Tree,
    isa: Isa,
    rays: &'a RayColumns<'a>,
    hits: &'a mut HitColumns,
}

impl Answer for Closest<'_> {
    type Goal = ClosestHit;

    #[inline(always)]
    fn put(&mut self, position: usize, hit: Option<Hit32>) {
        if let Some(Hit32 { t, local, id, primitive, geometry, .. }) = hit {
            self.hits.put_plain(position, (id, primitive, geometry), t, local);
        }
    }

    #[inline(always)]
    fn put_crossing(&mut self, position: usize, crossing: Crossing) {
        self.hits.put_crossing(position, self.tree, crossing);
    }

    fn put_exactly(&mut self, position: usize) {
        let closest = Queries::of(self.isa, self.tree).closest;
        if let Some(hit) = closest.ask(self.tree, &self.rays.ray(position)) {
            self.hits.put_hit(position, self.tree, hit);
        }
    }
}

/// See [`any`].
struct Any<'a> {
    tree: &'a Tree,
    isa: Isa,
    rays: &'a RayColumns<'a>,
    occluded: &'a mut [bool],
}

impl Answer for Any<'_> {
    type Goal = AnyHit;

    #[inline(always)]
    fn put(&mut self, position: usize, hit: Option<Hit32>) {
        self.occluded[position] = hit.is_some();
    }

    #[inline(always)]
    fn put_crossing(&mut self, position: usize, _: Crossing) {
        self.occluded[position] = true;
    }

    fn put_exactly(&mut self, position: usize) {
        let any = Queries::of(self.isa, self.tree).any;
        self.occluded[position] = any.ask(self.tree, &self.rays.ray(position));
    }
}

/// See [`closest`].
struct F64Closest<'a> {
    tree: &'a Tree,
    isa: Isa,
    rays: &'a [Ray],
    first: usize,
    hits: &'a mut HitColumns,
}

impl Sink<Found> for F64Closest<'_> {
    #[inline(always)]
    fn put(&mut self, position: usize, outcome: Outcome<Found>) {
        let hit = match outcome {
            Outcome::Certain(Found { winner, in_instance: None }) => {
                if let Some(winner) = winner {
                    self.hits.put_winner(self.first + position, self.tree, winner);
                }
                return;
            }
            Outcome::Certain(found) => found.into_hit(self.tree, ContextRef::OUTSIDE),
            Outcome::Uncertain => exact::closest(self.isa, self.tree, &self.rays[position], None),
        };
        if let Some(hit) = hit {
            self.hits.put_hit(self.first + position, self.tree, hit);
        }
    }
}
