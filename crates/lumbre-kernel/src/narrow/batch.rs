//! Many rays at once: those that are alike together, the others in flight.

use std::marker::PhantomData;

use super::packet::Packet;
use super::{Goal, alone, stream};
use crate::batch::{AT_ONCE, FAR, LEAST_OFTEN};
use crate::blocks::Unit;
use crate::holds::{Contents, SingleStart};
use crate::lanes::{Lanes, Level, Task};
use crate::node::Node;
use crate::packet::{ALL, PACKET};
use crate::single::Exact;
use crate::{Accel, Ray32};

/// From so many on, rays are faster in flight than one after another, where the caches hold little of the tree, and where they do: to
/// set out, and to wait for the last, takes its time.
const LEAST_FAR: usize = 32;
const LEAST_NEAR: usize = 192;
/// Rays that are taken to double precision at a time.
const WIDELY: usize = 1024;

/// Searches along every ray.
pub(crate) fn search_all<G: Goal>(level: Level, accel: &Accel, rays: &[Ray32], answers: &mut [G::Answer]) {
    let start = accel.single.as_ref().filter(|start| start.contents == Contents::Triangles);
    let Some(start) = start else {
        let mut wide = Vec::with_capacity(rays.len().min(WIDELY));
        for (rays, answers) in rays.chunks(WIDELY).zip(answers.chunks_mut(WIDELY)) {
            wide.clear();
            wide.extend(rays.iter().map(|ray| ray.to_f64()));
            G::all_widely(level, accel, &wide, answers);
        }
        return;
    };
    let tree = &accel.tree;
    let is_far = size_of_val::<[Node]>(&tree.nodes) + size_of_val::<[Unit]>(&tree.blocks) >= FAR;
    level.run(Batch::<G> { accel, start, rays, answers, is_far, goal: PhantomData });
}

struct Batch<'a, 'r, G: Goal> {
    accel: &'a Accel,
    start: &'a SingleStart,
    rays: &'r [Ray32],
    answers: &'r mut [G::Answer],
    is_far: bool,
    goal: PhantomData<G>,
}

impl<G: Goal> Task for Batch<'_, '_, G> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self { accel, start, rays, answers, is_far, .. } = self;
        let exact = Exact::new(accel, start);
        let mut packet = Packet::new(accel, start);
        // After a packet that did not pay, others go alone before the next is tried: ever more while none does, and at once many where
        // none has.
        let (mut without, mut patience) = (0, LEAST_OFTEN);
        let mut others: Vec<usize> = Vec::new();
        for (rays, answers) in rays.chunks(AT_ONCE).zip(answers.chunks_mut(AT_ONCE)) {
            others.clear();
            let (packets, _) = rays.as_chunks::<PACKET>();
            for (i, rays) in packets.iter().enumerate() {
                let first = PACKET * i;
                let mut answered = 0;
                if without > 0 {
                    without -= 1;
                } else if let Some(answers) = answers[first..].first_chunk_mut() {
                    let together = packet.search::<G, L>(rays, answers);
                    answered = together.answered;
                    (without, patience) =
                        if together.pays { (0, 0) } else { (patience, (2 * patience).clamp(1, LEAST_OFTEN)) };
                }
                if answered != ALL {
                    others.extend(
                        (0..PACKET).filter(|place| answered >> place & 1 == 0).map(|place| first + place),
                    );
                }
            }
            others.extend(PACKET * packets.len()..rays.len());
            if others.len() < if is_far { LEAST_FAR } else { LEAST_NEAR } {
                // Here, and not by a call: a hit that was put together elsewhere would be waited for. Nor in a closure, which does not
                // take on the instruction set.
                for &i in &others {
                    answers[i] = alone::search::<G, L>(&exact, &rays[i]);
                }
            } else {
                stream::fly::<G, L>(&exact, is_far, rays, &others, answers);
            }
        }
    }
}
