//! The nearest hit and any hit, in single precision wherever that can decide, in trees that hold instances, clouds of spheres or
//! meshes in double precision.
//!
//! What stands in the tree itself is searched as in [`single`]; what those leaves have found bounds what is still
//! sought here, and the other way round. A placed tree is searched in single precision as well, where that can tell: one of
//! triangles at once, with the ray that the instance's map gives; any other by a search of its own, which goes no deeper than
//! [`SingleStart`] allows. Where single precision cannot tell about a placed tree, the plain search answers for that alone. What
//! is found there comes with its crossing in double precision, as that of a shape does.

use std::cmp::Ordering;
use std::marker::PhantomData;

use lumbre_geometry::Ray;

use crate::collapse::Entry;
use crate::holds::{Contents, SingleStart};
use crate::lanes::{self, Lanes, Level, Question, Task};
use crate::node::tag;
use crate::opening::Start;
use crate::query::{All, Any, Closest, Filter};
use crate::single::{self, Alone, Candidate, Goal, Nearest, Outcome, SingleRay, Step, Whether, Winner};
use crate::single_spheres::AloneAmongSpheres;
use crate::sphere_search::{self, CloudRay};
use crate::stack::Stack;
use crate::traverse::{self, Place, Search, Standing};
use crate::way::Way;
use crate::{Accel, GeometryKind, Hit, Instance, precise};

/// In a tree of anything, in single precision first.
pub(crate) struct Amidst<G>(PhantomData<G>);

impl<G: Sought> Question for Amidst<G> {
    type Ray = Ray;
    type Answer = G::Found;

    #[inline(always)]
    fn ask<L: Lanes>(accel: &Accel, ray: &Ray) -> G::Found {
        if let Some(start) = &accel.single {
            let (around, ray) = (&Place::default(), &L::read(ray));
            if let Outcome::Settled(found) = Whole::<G, All>::new(accel, start, around, ray).run::<L>() {
                return found;
            }
        }
        G::find_plainly(accel, L::level(), ray)
    }
}

/// Searches along a ray among what a filter takes.
pub(crate) fn search<G: Sought, F: Filter>(
    level: Level,
    accel: &Accel,
    start: &SingleStart,
    ray: &Ray,
    filter: &F,
) -> Outcome<G::Found> {
    let (root, around) = (start.root, &Place::default());
    level.run(Whole::<G, F> { accel, start, root, around, ray, filter, goal: PhantomData })
}

/// A search with one ray, from a node on.
pub(crate) struct Whole<'a, 'r, G, F> {
    accel: &'a Accel,
    start: &'a SingleStart,
    root: u32,
    /// Where the tree stands.
    around: &'r Place,
    ray: &'r Ray,
    filter: &'r F,
    goal: PhantomData<G>,
}

impl<'a, 'r, G> Whole<'a, 'r, G, All> {
    /// In a tree that stands nowhere else, among all there is.
    #[inline(always)]
    pub(crate) fn new(accel: &'a Accel, start: &'a SingleStart, around: &'r Place, ray: &'r Ray) -> Self {
        Self { accel, start, root: start.root, around, ray, filter: &All, goal: PhantomData }
    }
}

impl<G: Sought, F: Filter> Task for Whole<'_, '_, G, F> {
    type Output = Outcome<G::Found>;

    #[inline(always)]
    fn run<L: Lanes>(self) -> Self::Output {
        let Self { accel, start, root, around, ray, filter, .. } = self;
        // Where all is taken, who asks has read it.
        let own;
        let ray = if F::TAKES_ALL {
            ray
        } else {
            own = L::read(ray);
            &own
        };
        let Some(slabs) = L::start_single(start, ray) else { return Outcome::Unsettled };
        let mut way = Way::<L>::new(&accel.tree.nodes, slabs);
        let mut stack = Stack::new();
        let mut next = way.descend::<G::Order>(root, &mut stack);
        if next.is_none() && accel.infinite.is_empty() {
            // Many rays come to no leaf, and need nothing else.
            return Outcome::Settled(G::found(accel, G::NOTHING));
        }
        let selection = filter.select(accel, Standing::at(around));
        let blocks = L::start_blocks(start, lanes::opaque(ray), way.slabs());
        let single = SingleRay::new(accel, start, blocks, selection);
        let mut among = AmongOthers { accel, single, filter, around, within: None, clouds: None };
        for entry in &*accel.infinite {
            if let Some(last) = among.meet_infinite::<G, L>(entry, ray, &mut way) {
                return among.found::<G, L>(ray, last);
            }
        }
        while let Some(leaf) = next {
            if let Some(last) = among.meet_leaf::<G, L>(leaf, ray, &mut way) {
                return among.found::<G, L>(ray, last);
            }
            let Some(reference) = way.pop::<G::Order>(&mut stack) else { break };
            next = way.descend::<G::Order>(reference, &mut stack);
        }
        among.found::<G, L>(ray, Step::Out)
    }
}

/// A ray in the leaves of a tree of anything.
pub(crate) struct AmongOthers<'a, F: Filter + 'a> {
    accel: &'a Accel,
    /// Among those that it can search. What is nearest in an instance has the geometry [`WITHIN`] there.
    single: SingleRay<'a, true, F::Selection<'a>>,
    filter: &'a F,
    around: &'a Place,
    /// The last of the nearest that was in an instance.
    within: Option<Hit>,
    /// For spheres, once the ray has come to some.
    clouds: Option<CloudRay>,
}

/// No geometry of the tree, and behind all of them: of two hits at the same `t`, one outside of instances comes first.
pub(crate) const WITHIN: u32 = u32::MAX;

impl<'a, F: Filter> AmongOthers<'a, F> {
    /// Tests a leaf; how the search ends, if it does.
    #[inline(always)]
    fn meet_leaf<G: Sought, L: Lanes>(&mut self, leaf: u32, ray: &Ray, way: &mut Way<L>) -> Option<Step> {
        // The ray is opaque where many come to no such leaf: what these make of it would else be made before any is known.
        match leaf >> tag::SHIFT {
            tag::INSTANCE => {
                let entry = &self.accel.tree.entries[(leaf & tag::PLACE) as usize];
                G::meet_instance(self, entry, lanes::opaque(ray), way)
            }
            tag::SPHERES | tag::PRECISE => G::meet_others(self, leaf, lanes::opaque(ray), way),
            tag::TRIANGLES => G::meet_triangles(&mut self.single, leaf, ray, way),
            _ => self.single.meet_leaf::<G, L>(leaf, lanes::opaque(ray), way),
        }
    }

    /// What an entry places, if anything of that is wanted.
    #[inline(always)]
    fn placed(&self, entry: &Entry) -> Option<Placed<'a>> {
        Placed::of(self.accel, entry).filter(|placed| self.filter.enters(self.accel, placed.geometry))
    }

    /// Tests what stands outside the tree, alike.
    #[inline(always)]
    fn meet_infinite<G: Sought, L: Lanes>(
        &mut self,
        entry: &Entry,
        ray: &Ray,
        way: &mut Way<L>,
    ) -> Option<Step> {
        if matches!(self.accel.geometries[entry.geometry as usize].kind, GeometryKind::Instance(_)) {
            G::meet_instance(self, entry, ray, way)
        } else {
            G::meet_entry(&mut self.single, entry, ray, way)
        }
    }

    /// What came of it.
    #[inline(always)]
    fn found<G: Sought, L: Lanes>(&mut self, ray: &Ray, last: Step) -> Outcome<G::Found> {
        match G::answer::<L, _, true>(&self.single, ray, last) {
            Outcome::Settled(answer) => Outcome::Settled(G::found_among(self, answer)),
            Outcome::Unsettled => Outcome::Unsettled,
        }
    }

    /// Takes a hit in an instance, if it is the nearest; false where the plain search has to answer.
    #[inline(always)]
    fn meet_hit<L: Lanes>(&mut self, hit: &impl InInstance, ray: &Ray, way: &mut Way<L>) -> bool {
        let heights = single::heights(hit.t(), single::largest_component(ray));
        let (best, crossed) = (&self.single.best, || self.single.crossed());
        let is_better = |t| self.single.is_better(ray, t, (WITHIN, 0));
        let is_nearer = match is_nearest(hit, heights, (best, crossed, &self.within), is_better) {
            Outcome::Settled(is_nearer) => is_nearer,
            Outcome::Unsettled => return false,
        };
        if is_nearer {
            let within = hit.put(&mut self.within);
            let crossed = Winner { root: within.root, geometry: WITHIN, primitive: 0 };
            self.single.keep_crossed(crossed, heights, way);
        }
        true
    }

    /// Offers a search what is met in a leaf of spheres or of triangles in double precision; false where the ray meets one of these
    /// exactly at an edge, so that the plain search has to answer.
    #[inline(always)]
    fn offer_others<L: Lanes, S: Search<'a>>(&mut self, leaf: u32, ray: &Ray, search: &mut S) -> bool {
        let accel = self.accel;
        // The search asks the filter itself; should single precision not be able to tell in the end, that is asked again.
        self.filter.keep_answers();
        if leaf >> tag::SHIFT == tag::SPHERES {
            if let Some(clouds) = &mut self.clouds {
                clouds.set_range(search.floor(), search.limit());
            }
            sphere_search::meet_leaf::<L, S>(accel, ray, leaf, &mut self.clouds, self.around, search);
            return true;
        }
        let mut touches = Vec::new();
        for entry in &accel.tree.entries[(leaf & tag::PLACE) as usize..] {
            let name = [entry.geometry, entry.primitive()];
            let is_over = precise::meet(accel, ray, name, self.around, search, &mut touches);
            if is_over || entry.is_last() {
                break;
            }
        }
        touches.is_empty()
    }
}

/// A hit in an instance.
pub(crate) trait InInstance {
    fn t(&self) -> f64;
    /// Whether it is nearer than another, or as near and before it.
    fn comes_before(&self, other: &Hit) -> bool;
    /// Makes a place hold it.
    fn put<'p>(&self, place: &'p mut Option<Hit>) -> &'p Hit;
}

/// One that has its whole path.
impl InInstance for Hit {
    #[inline(always)]
    fn t(&self) -> f64 {
        self.root.t
    }

    fn comes_before(&self, other: &Hit) -> bool {
        comes_before(self.root.t, (&self.route, self.geometry, self.primitive), other)
    }

    fn put<'p>(&self, place: &'p mut Option<Hit>) -> &'p Hit {
        place.insert(self.clone())
    }
}

/// What is nearest in a placed tree of triangles.
pub(crate) struct Direct<'d> {
    pub(crate) accel: &'d Accel,
    pub(crate) standing: Standing<'d>,
    pub(crate) winner: Winner,
}

impl InInstance for Direct<'_> {
    #[inline(always)]
    fn t(&self) -> f64 {
        self.winner.root.t
    }

    fn comes_before(&self, other: &Hit) -> bool {
        let &Winner { root, geometry, primitive } = &self.winner;
        comes_before(root.t, (&self.standing.place().route, geometry, primitive), other)
    }

    // Field by field: a whole that was written in parts is slow to be read at once.
    #[inline(always)]
    fn put<'p>(&self, place: &'p mut Option<Hit>) -> &'p Hit {
        let &Self { accel, standing, winner } = self;
        winner.put(accel, place);
        let hit = place.as_mut().expect("it was put there");
        let Place { route, ids } = standing.place();
        (hit.route, hit.instances) = (route, ids);
        hit
    }
}

/// Whether a hit in an instance, between these heights, is the nearest of its ray: where heights do not tell, beside the best that is
/// no triangle, and what that is where it is in an instance.
#[inline(always)]
pub(crate) fn is_nearest(
    hit: &impl InInstance,
    (from, to): (f32, f32),
    (best, crossed, within): (&Candidate, impl FnOnce() -> Option<Winner>, &Option<Hit>),
    is_better: impl FnOnce(f64) -> Outcome<bool>,
) -> Outcome<bool> {
    if from > best.to {
        return Outcome::Settled(false);
    }
    if to < best.from {
        return Outcome::Settled(true);
    }
    match (crossed(), within) {
        (Some(Winner { geometry: WITHIN, .. }), Some(within)) => Outcome::Settled(hit.comes_before(within)),
        _ => is_better(hit.t()),
    }
}

/// Whether what is met there, under these names, comes before a hit.
#[cold]
#[inline(never)]
fn comes_before(t: f64, names: (&[u32], u32, u32), other: &Hit) -> bool {
    let order = t.partial_cmp(&other.root.t).unwrap_or(Ordering::Equal);
    order.then_with(|| names.cmp(&(&other.route[..], other.geometry, other.primitive))) == Ordering::Less
}

/// An instance, or a part of one.
pub(crate) struct Placed<'a> {
    pub(crate) instance: &'a Instance,
    pub(crate) from: Start,
    /// Its position and its id.
    pub(crate) geometry: u32,
    pub(crate) id: u32,
}

impl<'a> Placed<'a> {
    /// `None` where an entry stands for nothing.
    #[inline(always)]
    pub(crate) fn of(accel: &'a Accel, entry: &Entry) -> Option<Self> {
        let (geometry, from) = (entry.geometry, Start::of(entry.primitive()));
        let standing = &accel.geometries[geometry as usize];
        let GeometryKind::Instance(instance) = &standing.kind else { unreachable!("the tag says so") };
        (!from.is_nothing()).then_some(Self { instance, from, geometry, id: standing.id })
    }

    /// What is met in it in a range, if it is a tree of triangles and single precision can tell.
    #[inline(always)]
    pub(crate) fn search_triangles<G: Goal, L: Lanes, F: Filter>(
        &self,
        ray: &Ray,
        range: [f64; 2],
        filter: &F,
        standing: Standing,
    ) -> Outcome<G::Answer> {
        let inner = &*self.instance.accel;
        let Some(start) = &inner.single else { return Outcome::Unsettled };
        if start.contents != Contents::Triangles {
            return Outcome::Unsettled;
        }
        let mut moving = None;
        let map = self.instance.world_from_object.map_at(ray.time, &mut moving);
        let (ray, slabs) = L::start_placed(start, map, ray, range);
        let Some(slabs) = slabs else { return Outcome::Unsettled };
        let selection = filter.select(inner, standing);
        Alone::<G, false, _>::among(inner, start, self.from.below(start.root), &ray, selection).go::<L>(slabs)
    }

    /// What is met in it in a range, whatever it is.
    #[inline(never)]
    pub(crate) fn search<G: Sought, F: Filter>(
        &self,
        level: Level,
        ray: &Ray,
        [t_min, t_max]: [f64; 2],
        filter: &F,
        standing: Standing,
    ) -> G::Found {
        let place = standing.place();
        let inner = &*self.instance.accel;
        let ray = self.instance.world_from_object.object_ray(ray).with_range(t_min, t_max);
        if let Some(start) = &inner.single {
            let root = self.from.below(start.root);
            let found = match start.contents {
                // That was asked.
                Contents::Triangles => Outcome::Unsettled,
                Contents::Shapes => {
                    let selection = filter.select(inner, Standing::at(&place));
                    match level.run(Alone::<G, true, _>::among(inner, start, root, &ray, selection)) {
                        Outcome::Settled(answer) => Outcome::Settled(G::found_at(inner, answer, &place)),
                        Outcome::Unsettled => Outcome::Unsettled,
                    }
                }
                Contents::Spheres if F::TAKES_ALL => {
                    match level.run(AloneAmongSpheres::<G>::new(inner, start, root, &ray)) {
                        Outcome::Settled(answer) => Outcome::Settled(G::found_at(inner, answer, &place)),
                        Outcome::Unsettled => Outcome::Unsettled,
                    }
                }
                Contents::Spheres => Outcome::Unsettled,
                Contents::Anything => level.run(Whole::<G, F> {
                    accel: inner,
                    start,
                    root,
                    around: &place,
                    ray: &ray,
                    filter,
                    goal: PhantomData,
                }),
            };
            if let Outcome::Settled(found) = found {
                return found;
            }
        }
        filter.keep_answers();
        G::find_plainly_from(inner, level, self.from, place, &ray, filter)
    }
}

/// What is asked of a ray among anything.
pub(crate) trait Sought: Goal {
    /// Tests an instance; how the search ends, if it does.
    fn meet_instance<L: Lanes, F: Filter>(
        among: &mut AmongOthers<F>,
        entry: &Entry,
        ray: &Ray,
        way: &mut Way<L>,
    ) -> Option<Step>;

    /// Tests a leaf of spheres or of triangles in double precision, alike.
    fn meet_others<L: Lanes, F: Filter>(
        among: &mut AmongOthers<F>,
        leaf: u32,
        ray: &Ray,
        way: &mut Way<L>,
    ) -> Option<Step>;

    /// Hands out what was found.
    fn found_among<F: Filter>(among: &mut AmongOthers<F>, answer: Self::Answer) -> Self::Found;

    /// Hands out what was found in a tree that stands there.
    fn found_at(accel: &Accel, answer: Self::Answer, place: &Place) -> Self::Found;

    /// What the plain search finds in a part of a tree that stands there.
    fn find_plainly_from<F: Filter>(
        accel: &Accel,
        level: Level,
        from: Start,
        place: Place,
        ray: &Ray,
        filter: &F,
    ) -> Self::Found;
}

impl Sought for Nearest {
    #[inline(always)]
    fn meet_instance<L: Lanes, F: Filter>(
        among: &mut AmongOthers<F>,
        entry: &Entry,
        ray: &Ray,
        way: &mut Way<L>,
    ) -> Option<Step> {
        let placed = among.placed(entry)?;
        let (filter, standing) = (among.filter, Standing::within(among.around, placed.geometry, placed.id));
        let range = [ray.t_min, among.single.limit(ray)];
        let is_settled = match placed.search_triangles::<Self, L, F>(ray, range, filter, standing) {
            Outcome::Settled(None) => true,
            Outcome::Settled(Some(winner)) => {
                among.meet_hit(&Direct { accel: &placed.instance.accel, standing, winner }, ray, way)
            }
            Outcome::Unsettled => match placed.search::<Self, F>(L::level(), ray, range, filter, standing) {
                None => true,
                Some(hit) => among.meet_hit(&hit, ray, way),
            },
        };
        (!is_settled).then_some(Step::Unsettled)
    }

    #[inline(always)]
    fn meet_others<L: Lanes, F: Filter>(
        among: &mut AmongOthers<F>,
        leaf: u32,
        ray: &Ray,
        way: &mut Way<L>,
    ) -> Option<Step> {
        let filter = among.filter;
        let mut search = Closest::new(&ray.with_range(ray.t_min, among.single.limit(ray)), filter);
        if !among.offer_others::<L, _>(leaf, ray, &mut search) {
            return Some(Step::Unsettled);
        }
        let (root, what) = search.crossing()?;
        let (geometry, primitive) = what.names(among.accel);
        let is_settled = among.single.meet_root(root, geometry, primitive, ray, way);
        (!is_settled).then_some(Step::Unsettled)
    }

    #[inline(always)]
    fn found_among<F: Filter>(among: &mut AmongOthers<F>, answer: Option<Winner>) -> Option<Hit> {
        let winner = answer?;
        if winner.geometry != WITHIN {
            return Self::found_at(among.accel, Some(winner), among.around);
        }
        // Field by field, see above.
        let within = among.within.as_mut()?;
        let &mut Hit { root, id, primitive, geometry, .. } = within;
        let (instances, route) = (std::mem::take(&mut within.instances), std::mem::take(&mut within.route));
        Some(Hit { root, id, primitive, geometry, instances, route })
    }

    #[inline(always)]
    fn found_at(accel: &Accel, answer: Option<Winner>, place: &Place) -> Option<Hit> {
        let mut hit = answer?.to_hit(accel);
        if place.is_within() {
            let Place { route, ids } = place.clone();
            (hit.route, hit.instances) = (route, ids);
        }
        Some(hit)
    }

    #[inline(never)]
    fn find_plainly_from<F: Filter>(
        accel: &Accel,
        level: Level,
        from: Start,
        place: Place,
        ray: &Ray,
        filter: &F,
    ) -> Option<Hit> {
        let mut search = Closest::new(ray, filter);
        traverse::search_from(level, accel, from, place, ray, &mut search);
        search.take_hit()
    }
}

impl Sought for Whether {
    #[inline(always)]
    fn meet_instance<L: Lanes, F: Filter>(
        among: &mut AmongOthers<F>,
        entry: &Entry,
        ray: &Ray,
        _: &mut Way<L>,
    ) -> Option<Step> {
        let placed = among.placed(entry)?;
        let (filter, standing) = (among.filter, Standing::within(among.around, placed.geometry, placed.id));
        let range = [ray.t_min, ray.t_max];
        let is_met = match placed.search_triangles::<Self, L, F>(ray, range, filter, standing) {
            Outcome::Settled(is_met) => is_met,
            Outcome::Unsettled => placed.search::<Self, F>(L::level(), ray, range, filter, standing),
        };
        is_met.then_some(Step::Met)
    }

    #[inline(always)]
    fn meet_others<L: Lanes, F: Filter>(
        among: &mut AmongOthers<F>,
        leaf: u32,
        ray: &Ray,
        _: &mut Way<L>,
    ) -> Option<Step> {
        let filter = among.filter;
        let mut search = Any::new(ray, filter);
        if !among.offer_others::<L, _>(leaf, ray, &mut search) {
            return Some(Step::Unsettled);
        }
        search.is_hit.then_some(Step::Met)
    }

    #[inline(always)]
    fn found_among<F: Filter>(_: &mut AmongOthers<F>, answer: bool) -> bool {
        answer
    }

    #[inline(always)]
    fn found_at(_: &Accel, answer: bool, _: &Place) -> bool {
        answer
    }

    #[inline(never)]
    fn find_plainly_from<F: Filter>(
        accel: &Accel,
        level: Level,
        from: Start,
        place: Place,
        ray: &Ray,
        filter: &F,
    ) -> bool {
        let mut search = Any::new(ray, filter);
        traverse::search_from(level, accel, from, place, ray, &mut search);
        search.is_hit
    }
}

/// What single precision tells of a ray, for tests.
#[cfg(test)]
pub(crate) fn search_at<G: Sought, F: Filter>(
    level: Level,
    accel: &Accel,
    ray: &Ray,
    filter: &F,
) -> Outcome<G::Found> {
    let Some(start) = &accel.single else { return Outcome::Unsettled };
    search::<G, F>(level, accel, start, ray, filter)
}
