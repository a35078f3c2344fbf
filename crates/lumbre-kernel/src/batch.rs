//! Many rays at once: some in flight on one thread, so that one's arithmetic fills the waits of another.
//!
//! Each ray takes the very steps that it takes alone, a node or a leaf at a time, in turn with the others: its answer has the
//! same bits. A step ends with a fetch of what the next one of that ray will read.

use lumbre_geometry::Ray;

use crate::Accel;
use crate::lanes::{Lanes, Level, Task};
use crate::node::BoxRay;
use crate::stack::{Order, Stack};
use crate::touch::{self, Touch};
use crate::traverse::{self, Frame, Place, Search, Step};

/// Rays in flight on a thread. Of 4, 6, 8 and 12, this is the best for closest hits, by 8 to 13 %, on meshes of 67 thousand to
/// a million triangles, and within 2 % of the best for any hit (`cargo xtask bench kernel --batches`).
const IN_FLIGHT: usize = 6;

/// Searches along every ray: `begin` makes a search, `end` takes it with the position of its ray, in any order.
pub(crate) fn search_all<'a, S: Search<'a>>(
    level: Level,
    accel: &'a Accel,
    rays: &[Ray],
    begin: impl Fn(&Ray) -> S,
    mut end: impl FnMut(usize, &mut S),
) {
    if accel.holds.only_triangles {
        level.run(Flights { level, accel, rays, begin, end });
    } else {
        for (position, ray) in rays.iter().enumerate() {
            let mut search = begin(ray);
            traverse::search(level, accel, ray, &mut search);
            end(position, &mut search);
        }
    }
}

/// A ray under way.
struct Flight<'a, 'r, S: Search<'a>, L> {
    position: usize,
    reference: u32,
    frame: Frame<'a, &'r Ray, L>,
    search: S,
    touches: Vec<Touch<'a>>,
    stack: Stack<<S::Order as Order>::Entry>,
}

/// All the rays, in a tree of nothing but triangles.
struct Flights<'a, 'r, B, E> {
    level: Level,
    accel: &'a Accel,
    rays: &'r [Ray],
    begin: B,
    end: E,
}

impl<'a, S, B, E> Task for Flights<'a, '_, B, E>
where
    S: Search<'a>,
    B: Fn(&Ray) -> S,
    E: FnMut(usize, &mut S),
{
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self { level, accel, rays, begin, mut end } = self;
        let place = Place::default();
        let mut waiting = rays.iter().enumerate();
        let mut flights: Vec<Flight<S, L>> = Vec::with_capacity(IN_FLIGHT);
        let Some(root) = accel.tree.root else {
            waiting.for_each(|(position, ray)| end(position, &mut begin(ray)));
            return;
        };
        // As many as there is room for; those that pass the tree by end at once.
        while flights.len() < IN_FLIGHT
            && let Some((position, ray)) = waiting.next()
        {
            let mut search = begin(ray);
            let mut boxes = BoxRay::passing_all();
            if !traverse::start::<L, S>(accel, ray, &search, &mut boxes) {
                end(position, &mut search);
                continue;
            }
            let frame = Frame::new(accel, ray, boxes, &search);
            let (touches, stack) = (Vec::new(), Stack::new());
            flights.push(Flight { position, reference: root, frame, search, touches, stack });
        }
        // Those that are under way stand first.
        let mut count = flights.len();
        while count > 0 {
            let mut turn = 0;
            while turn < count {
                let Flight { position, reference, frame, search, touches, stack } = &mut flights[turn];
                let step = frame.step(*reference, &place, stack, search, touches);
                if let Step::On(next) = step {
                    *reference = next;
                    frame.fetch(next);
                    turn += 1;
                    continue;
                }
                if !touches.is_empty() {
                    if step == Step::Out {
                        touch::offer_borders(level, accel, frame.ray, touches, search);
                    }
                    touches.clear();
                }
                // The next that meets the tree takes its place, where it stands.
                stack.clear();
                *reference = root;
                let next = loop {
                    let Some((next, ray)) = waiting.next() else { break None };
                    end(*position, search);
                    (*position, *search) = (next, begin(ray));
                    if frame.restart(ray, search) {
                        break Some(next);
                    }
                };
                if next.is_none() {
                    count -= 1;
                    flights.swap(turn, count);
                }
            }
        }
        flights.iter_mut().for_each(|flight| end(flight.position, &mut flight.search));
    }
}
