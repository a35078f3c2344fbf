//! Rays of a picture: columns in, columns out.
//!
//! Where single precision traverses the tree, rays are rounded once, relative to the mesh's origin, and take the ways of
//! [`Ray32`]: coherent ones in packets, the others one by one in small trees and interleaved in large ones. All others
//! take those of double precision. What is answered depends on the ray alone.

use std::marker::PhantomData;

use lumbre_geometry::Ray;

use super::{AnyHit, Batch, ClosestHit, F32, Plan, Sink, batch_f64};
use crate::columns::PictureStart;
use crate::intersect::{Dispatch, Isa, Simd};
use crate::simd;
use crate::trace::decide::Decider;
use crate::trace::filtered::Found;
use crate::trace::picture::{Crossing, LocalRay, Search};
use crate::trace::stack::Goal;
use crate::trace::{ContextRef, Outcome, exact, f32_ray};
use crate::tree::packed::Start;
use crate::{Accel, Hit32, HitColumns, Ray32, RayColumns};

/// How many rays are put side by side at a time.
const PIECE: usize = 4096;

/// [`Accel::closest_columns`].
pub(crate) fn closest(isa: Isa, accel: &Accel, rays: &RayColumns, exact: bool, hits: &mut HitColumns) {
    rays.check();
    hits.clear(rays.len());
    match &accel.picture {
        Some(picture) if !exact => {
            let answer = &mut Closest { accel, isa, rays, hits };
            traverse_f32::<ClosestHit, _>(isa, accel, picture, rays, answer);
        }
        _ => traverse_f64(rays, |rays, first| {
            let sink = &mut F64Closest { accel, isa, rays, first, hits };
            if !batch_f64::<ClosestHit, _>(isa, accel, rays, sink, Plan::SINGLES) {
                let closest = accel.queries_at(isa).closest;
                for (i, ray) in rays.iter().enumerate() {
                    if let Some(hit) = closest.ask(accel, ray) {
                        hits.put_whole(first + i, accel, hit);
                    }
                }
            }
        }),
    }
}

/// [`Accel::any_columns`].
pub(crate) fn any(isa: Isa, accel: &Accel, rays: &RayColumns, exact: bool, occluded: &mut Vec<bool>) {
    rays.check();
    occluded.clear();
    occluded.resize(rays.len(), false);
    match &accel.picture {
        Some(picture) if !exact => {
            let answer = &mut Any { accel, isa, rays, occluded };
            traverse_f32::<AnyHit, _>(isa, accel, picture, rays, answer);
        }
        _ => traverse_f64(rays, |rays, first| {
            super::any_by(isa, accel, rays, &mut occluded[first..first + rays.len()], Plan::SINGLES);
        }),
    }
}

/// Rays in double precision, piece by piece, each with the position of its first.
fn traverse_f64(columns: &RayColumns, mut answer: impl FnMut(&[Ray], usize)) {
    let mut rays = Vec::with_capacity(columns.len().min(PIECE));
    for first in (0..columns.len()).step_by(PIECE) {
        rays.clear();
        rays.extend((first..columns.len().min(first + PIECE)).map(|i| columns.ray(i)));
        answer(&rays, first);
    }
}

/// Rays in single precision, piece by piece.
fn traverse_f32<G: Goal, A: Answer>(
    isa: Isa,
    accel: &Accel,
    picture: &PictureStart,
    columns: &RayColumns,
    answer: &mut A,
) {
    let mut rays = Vec::with_capacity(columns.len().min(PIECE));
    for first in (0..columns.len()).step_by(PIECE) {
        rays.clear();
        picture.push_rays(columns, first..columns.len().min(first + PIECE), &mut rays);
        let (start, rays) = (&picture.start, &rays[..]);
        if !start.only_triangles {
            isa.run(InAnything::<G, A> { accel, picture, columns, rays, first, answer, goal: PhantomData });
            continue;
        }
        let sink = &mut F32Sink { accel, isa, start: picture, rays, first, answer };
        if super::batched(isa, accel).is_some() {
            isa.run_with_vectors(Batch::<F32<G>, _> {
                accel,
                start,
                rays,
                sink,
                plan: Plan::of_picture(accel),
            });
        } else {
            isa.run(OneByOne::<G, _> { accel, picture, rays, sink, goal: PhantomData });
        }
    }
}

/// Rays one after the other, where there are no packets.
struct OneByOne<'a, G, S> {
    accel: &'a Accel,
    picture: &'a PictureStart,
    rays: &'a [Ray32],
    sink: &'a mut S,
    goal: PhantomData<G>,
}

impl<G: Goal, S: Sink<Option<Hit32>>> Dispatch for OneByOne<'_, G, S> {
    type Output = ();

    #[inline(always)]
    fn run<L: Simd>(self) {
        let decider = &Decider::new(self.accel, &self.picture.start);
        for (i, ray) in self.rays.iter().enumerate() {
            self.sink.put(i, f32_ray::traverse::<G, L>(decider, simd::opaque(ray)));
        }
    }
}

/// Rays one after the other, in a tree of anything.
struct InAnything<'a, G, A> {
    accel: &'a Accel,
    picture: &'a PictureStart,
    columns: &'a RayColumns<'a>,
    rays: &'a [Ray32],
    first: usize,
    answer: &'a mut A,
    goal: PhantomData<G>,
}

impl<G: Goal, A: Answer> Dispatch for InAnything<'_, G, A> {
    type Output = ();

    #[inline(always)]
    fn run<L: Simd>(self) {
        let Self { accel, picture, columns, rays, first, answer, .. } = self;
        for (i, ray) in rays.iter().enumerate() {
            let position = first + i;
            let (local, ray) = (LocalRay::new(*simd::opaque(ray)), &columns.ray(position));
            let search = Search { accel, picture, from: Start::WHOLE, ray, local, limit: ray.t_max };
            match search.run::<G, L, true>() {
                Outcome::Certain(None) => {}
                Outcome::Certain(Some(crossing)) => answer.put_crossing(position, crossing),
                Outcome::Uncertain => answer.put_exactly(position),
            }
        }
    }
}

/// One ray, where a batch has given it up.
struct Alone<'a, G> {
    accel: &'a Accel,
    picture: &'a PictureStart,
    ray: &'a Ray32,
    goal: PhantomData<G>,
}

impl<G: Goal> Dispatch for Alone<'_, G> {
    type Output = Outcome<Option<Hit32>>;

    #[inline(always)]
    fn run<L: Simd>(self) -> Self::Output {
        f32_ray::traverse::<G, L>(&Decider::new(self.accel, &self.picture.start), self.ray)
    }
}

/// Takes the answers of rays in single precision.
trait Answer {
    type Goal: Goal;
    /// The answer to a ray, by its position among all.
    fn put(&mut self, position: usize, hit: Option<Hit32>);
    /// The same in a tree of anything.
    fn put_crossing(&mut self, position: usize, crossing: Crossing);
    /// The same by double precision.
    fn put_exactly(&mut self, position: usize);
}

/// The answers of a piece.
struct F32Sink<'a, A> {
    accel: &'a Accel,
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
        let (accel, picture, ray) = (self.accel, self.start, &self.rays[position]);
        let alone = Alone::<A::Goal> { accel, picture, ray, goal: PhantomData };
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
    accel: &'a Accel,
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
        self.hits.put_crossing(position, self.accel, crossing);
    }

    fn put_exactly(&mut self, position: usize) {
        let closest = self.accel.queries_at(self.isa).closest;
        if let Some(hit) = closest.ask(self.accel, &self.rays.ray(position)) {
            self.hits.put_whole(position, self.accel, hit);
        }
    }
}

/// See [`any`].
struct Any<'a> {
    accel: &'a Accel,
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
        let any = self.accel.queries_at(self.isa).any;
        self.occluded[position] = any.ask(self.accel, &self.rays.ray(position));
    }
}

/// See [`closest`].
struct F64Closest<'a> {
    accel: &'a Accel,
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
                    self.hits.put_winner(self.first + position, self.accel, winner);
                }
                return;
            }
            Outcome::Certain(found) => found.into_hit(self.accel, ContextRef::OUTSIDE),
            Outcome::Uncertain => exact::closest(self.isa, self.accel, &self.rays[position], None),
        };
        if let Some(hit) = hit {
            self.hits.put_whole(self.first + position, self.accel, hit);
        }
    }
}
