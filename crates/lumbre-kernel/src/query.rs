//! The queries as searches: closest, any, every and how many.

use std::cell::RefCell;
use std::cmp::Ordering;
use std::collections::{BTreeMap, BinaryHeap};

use lumbre_geometry::{Ray, Root};
use smallvec::SmallVec;

use crate::lanes::Lanes;
use crate::node::Slabs;
use crate::options::Selection;
use crate::single::{self, Nearest, Outcome, Whether, Winner};
use crate::stack::{AsBuilt, ByDistance};
use crate::traverse::{Ask, Found, Place, PlacedTree, Search, Standing, What};
use crate::triangles::Inside;
use crate::{Accel, Hit, InstancePath};

impl Found<'_, '_> {
    #[inline]
    fn to_hit(&self) -> Hit {
        let (geometry, primitive) = self.what.names(self.accel);
        Hit {
            root: self.root,
            id: self.accel.geometries[geometry as usize].id,
            primitive,
            geometry,
            instances: self.place.ids.clone(),
            route: self.place.route.clone(),
        }
    }
}

// No NaN comes this far, and the two zeros are one place.
fn by_t(a: f64, b: f64) -> Ordering {
    a.partial_cmp(&b).unwrap_or(Ordering::Equal)
}

/// What a query takes.
pub(crate) trait Filter {
    /// Whether it takes everything, so that nothing has to be asked.
    const TAKES_ALL: bool;
    /// Whether it wants to know which side is met.
    const FACES: bool = false;
    /// Whether it takes this.
    fn takes(&self, found: &Found) -> bool;
    /// Whether it takes anything in an instance.
    #[inline(always)]
    fn enters(&self, _accel: &Accel, _geometry: u32) -> bool {
        true
    }
    /// What it takes in one tree.
    type Selection<'s>: Selection
    where
        Self: 's;
    /// That of a tree which stands there.
    fn select<'s>(&'s self, accel: &'s Accel, standing: Standing<'s>) -> Self::Selection<'s>;
    /// Learns that searches of such selections are over: none of what it was asked about will be met again.
    #[inline(always)]
    fn forget(&self) {}
    /// Learns that a search by such a selection could not tell, so that what it was asked about may be met again, and that what
    /// is met from now on may, too.
    #[inline(always)]
    fn keep_answers(&self) {}
}

/// Takes everything.
#[derive(Clone, Copy, Debug)]
pub(crate) struct All;

impl Filter for All {
    const TAKES_ALL: bool = true;
    #[inline(always)]
    fn takes(&self, _: &Found) -> bool {
        true
    }

    type Selection<'s> = All;
    #[inline(always)]
    fn select<'s>(&'s self, _: &'s Accel, _: Standing<'s>) -> All {
        All
    }
}

/// Takes what the closure takes, which is asked once about each crossing.
pub(crate) struct If<F> {
    // Asked by searches within a search, too, one at a time.
    asked: RefCell<Answered<F>>,
}

/// A crossing by route, geometry, primitive, and which of the primitive's crossings it is.
type CrossingName = (InstancePath, u32, u32, u32);

/// A closure, and what it has answered.
struct Answered<F> {
    accept: F,
    /// Of crossings that may be met again.
    answers: BTreeMap<CrossingName, bool>,
    /// Of those that a search in single precision met: where it has to give up, the plain one meets them again.
    latest: SmallVec<[(CrossingName, bool); 4]>,
    /// Whether that has happened: then every answer is kept.
    keeps_all: bool,
}

impl<F: FnMut(&Hit) -> bool> Answered<F> {
    /// What the closure takes of a crossing that may be met again: it is asked once.
    fn take_once(&mut self, name: CrossingName, hit: impl FnOnce() -> Hit) -> bool {
        *self.answers.entry(name).or_insert_with(|| (self.accept)(&hit()))
    }
}

impl<F: FnMut(&Hit) -> bool> If<F> {
    pub(crate) fn new(accept: F) -> Self {
        let answered =
            Answered { accept, answers: BTreeMap::new(), latest: SmallVec::new(), keeps_all: false };
        Self { asked: RefCell::new(answered) }
    }
}

impl<F: FnMut(&Hit) -> bool> Filter for If<F> {
    const TAKES_ALL: bool = false;
    fn takes(&self, found: &Found) -> bool {
        let asked = &mut *self.asked.borrow_mut();
        if !asked.keeps_all {
            return (asked.accept)(&found.to_hit());
        }
        let (geometry, primitive) = found.what.names(found.accel);
        let name = (found.place.route.clone(), geometry, primitive, found.order);
        asked.take_once(name, || found.to_hit())
    }

    type Selection<'s>
        = Asking<'s, F>
    where
        F: 's;
    #[inline(always)]
    fn select<'s>(&'s self, accel: &'s Accel, standing: Standing<'s>) -> Asking<'s, F> {
        Asking { filter: self, accel, standing }
    }

    fn forget(&self) {
        self.asked.borrow_mut().latest.clear();
    }

    fn keep_answers(&self) {
        let Answered { answers, latest, keeps_all, .. } = &mut *self.asked.borrow_mut();
        answers.extend(latest.drain(..));
        *keeps_all = true;
    }
}

/// What a closure takes of one tree.
pub(crate) struct Asking<'s, F> {
    filter: &'s If<F>,
    accel: &'s Accel,
    standing: Standing<'s>,
}

impl<F> Clone for Asking<'_, F> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<F> Copy for Asking<'_, F> {}

impl<F: FnMut(&Hit) -> bool> Selection for Asking<'_, F> {
    const TAKES_ALL: bool = false;
    const ASKS: bool = true;

    #[inline(never)]
    fn accepts(&self, winner: &Winner, order: u32) -> bool {
        let mut hit = winner.to_hit(self.accel);
        let place = self.standing.place();
        (hit.instances, hit.route) = (place.ids, place.route);
        let asked = &mut *self.filter.asked.borrow_mut();
        let name = (hit.route.clone(), hit.geometry, hit.primitive, order);
        if asked.keeps_all {
            return asked.take_once(name, || hit);
        }
        let is_taken = (asked.accept)(&hit);
        asked.latest.push((name, is_taken));
        is_taken
    }
}

/// The nearest hit.
pub(crate) struct Closest<'a, 'f, F> {
    best: Option<Best<'a>>,
    // Of the best, where that is in an instance.
    place: Option<Place>,
    limit: f64,
    floor: f64,
    filter: &'f F,
}

/// As little as the winner can be told by.
struct Best<'a> {
    crossing: Crossing,
    what: What,
    accel: &'a Accel,
}

enum Crossing {
    /// Of a triangle, at the limit.
    Inside(Inside),
    Root(Root),
}

impl<'a, 'f, F> Closest<'a, 'f, F> {
    #[inline(always)]
    pub(crate) fn new(ray: &Ray, filter: &'f F) -> Self {
        Self { best: None, place: None, limit: ray.t_max, floor: ray.t_min, filter }
    }

    // Field by field: a whole that was written in parts is slow to be read at once.
    #[inline(always)]
    pub(crate) fn take_hit(&mut self) -> Option<Hit> {
        let (root, what) = self.crossing()?;
        let Best { accel, .. } = self.best.as_ref()?;
        let (geometry, primitive) = what.names(accel);
        let id = accel.geometries[geometry as usize].id;
        let mut hit =
            Hit { root, id, primitive, geometry, instances: InstancePath::new(), route: InstancePath::new() };
        if let Some(place) = self.place.take() {
            (hit.instances, hit.route) = (place.ids, place.route);
        }
        Some(hit)
    }

    /// The nearest crossing so far, of something that stands in the tree itself.
    #[inline(always)]
    pub(crate) fn crossing(&self) -> Option<(Root, What)> {
        let Best { crossing, what, .. } = self.best.as_ref()?;
        let root = match crossing {
            Crossing::Inside(inside) => inside.root(self.limit),
            Crossing::Root(root) => *root,
        };
        Some((root, *what))
    }

    /// Whether a crossing at the same `t` comes first in the lists.
    #[cold]
    #[inline(never)]
    fn comes_first(&self, best: &Best, what: What, accel: &Accel, place: &Place) -> bool {
        let own: &[u32] = self.place.as_ref().map_or(&[], |place| &place.route);
        let order = place.route.as_slice().cmp(own);
        order.then_with(|| what.names(accel).cmp(&best.what.names(best.accel))) == Ordering::Less
    }

    /// Whether a crossing is nearer than the best, or as near and before it.
    #[inline(always)]
    fn is_better(&self, t: f64, what: What, accel: &Accel, place: &Place) -> bool {
        if t > self.limit {
            return false;
        }
        match &self.best {
            Some(best) if t == self.limit => self.comes_first(best, what, accel, place),
            _ => true,
        }
    }

    #[inline(always)]
    fn keep(&mut self, t: f64, best: Best<'a>, place: &Place) {
        self.limit = t;
        self.best = Some(best);
        if place.is_within() || self.place.is_some() {
            self.place = place.is_within().then(|| place.clone());
        }
    }
}

impl<'a, F: Filter> Search<'a> for Closest<'a, '_, F> {
    const ASK: Ask = if F::TAKES_ALL { Ask::First } else { Ask::Every };
    const FACES: bool = F::FACES;
    type Order = ByDistance;

    #[inline(always)]
    fn enters(&self, accel: &Accel, geometry: u32) -> bool {
        self.filter.enters(accel, geometry)
    }

    #[inline(always)]
    fn limit(&self) -> f64 {
        self.limit
    }

    #[inline(always)]
    fn floor(&self) -> f64 {
        self.floor
    }

    #[inline(always)]
    fn offer(&mut self, found: &Found<'a, '_>) -> bool {
        let Found { root, what, accel, place, .. } = *found;
        if self.is_better(root.t, what, accel, place) && (F::TAKES_ALL || self.filter.takes(found)) {
            self.keep(root.t, Best { crossing: Crossing::Root(root), what, accel }, place);
        }
        false
    }

    #[inline(always)]
    fn offer_inside(&mut self, t: f64, inside: &Inside, what: What, accel: &'a Accel, place: &Place) -> bool {
        if !self.is_better(t, what, accel, place) {
            return false;
        }
        if !F::TAKES_ALL {
            let is_front = inside.det > 0.0;
            let found = Found { root: inside.root(t), what, order: 0, is_front, accel, place };
            if !self.filter.takes(&found) {
                return false;
            }
        }
        self.keep(t, Best { crossing: Crossing::Inside(*inside), what, accel }, place);
        false
    }

    #[inline(always)]
    fn meet_single<L: Lanes>(
        &mut self,
        placed: &PlacedTree<'a, '_>,
        ray: &Ray,
        slabs: Slabs,
    ) -> Outcome<bool> {
        let selection = self.filter.select(placed.accel, placed.standing);
        match single::search_placed::<Nearest, L, _>(placed, ray, slabs, selection) {
            Outcome::Unsettled => {
                self.filter.keep_answers();
                return Outcome::Unsettled;
            }
            Outcome::Settled(None) => {}
            Outcome::Settled(Some(Winner { root, geometry, primitive })) => {
                let (place, accel) = (placed.standing.place(), placed.accel);
                let what = What::Named { geometry, primitive };
                if self.is_better(root.t, what, accel, &place) {
                    self.keep(root.t, Best { crossing: Crossing::Root(root), what, accel }, &place);
                }
            }
        }
        self.filter.forget();
        Outcome::Settled(false)
    }
}

/// Whether there is a hit.
pub(crate) struct Any<'f, F> {
    pub(crate) is_hit: bool,
    limit: f64,
    floor: f64,
    filter: &'f F,
}

impl<'f, F> Any<'f, F> {
    #[inline(always)]
    pub(crate) fn new(ray: &Ray, filter: &'f F) -> Self {
        Self { is_hit: false, limit: ray.t_max, floor: ray.t_min, filter }
    }
}

impl<'a, F: Filter> Search<'a> for Any<'_, F> {
    const ASK: Ask = if F::TAKES_ALL { Ask::Whether } else { Ask::Every };
    const FACES: bool = F::FACES;
    type Order = AsBuilt;

    #[inline(always)]
    fn enters(&self, accel: &Accel, geometry: u32) -> bool {
        self.filter.enters(accel, geometry)
    }

    #[inline(always)]
    fn limit(&self) -> f64 {
        self.limit
    }

    #[inline(always)]
    fn floor(&self) -> f64 {
        self.floor
    }

    #[inline(always)]
    fn offer(&mut self, found: &Found<'a, '_>) -> bool {
        self.is_hit = F::TAKES_ALL || self.filter.takes(found);
        self.is_hit
    }

    #[inline(always)]
    fn offer_inside(&mut self, t: f64, inside: &Inside, what: What, accel: &'a Accel, place: &Place) -> bool {
        if F::TAKES_ALL {
            self.is_hit = true;
            return true;
        }
        let is_front = inside.det > 0.0;
        self.offer(&Found { root: inside.root(t), what, order: 0, is_front, accel, place })
    }

    #[inline(always)]
    fn settle(&mut self) {
        self.is_hit = true;
    }

    #[inline(always)]
    fn meet_single<L: Lanes>(
        &mut self,
        placed: &PlacedTree<'a, '_>,
        ray: &Ray,
        slabs: Slabs,
    ) -> Outcome<bool> {
        let selection = self.filter.select(placed.accel, placed.standing);
        let outcome = single::search_placed::<Whether, L, _>(placed, ray, slabs, selection);
        match outcome {
            Outcome::Settled(is_hit) => {
                self.is_hit |= is_hit;
                self.filter.forget();
            }
            Outcome::Unsettled => self.filter.keep_answers(),
        }
        outcome
    }
}

/// How many hits.
pub(crate) struct Count {
    pub(crate) hits: usize,
    limit: f64,
    floor: f64,
}

impl Count {
    pub(crate) fn new(ray: &Ray) -> Self {
        Self { hits: 0, limit: ray.t_max, floor: ray.t_min }
    }
}

impl Search<'_> for Count {
    const ASK: Ask = Ask::Every;
    type Order = AsBuilt;

    fn limit(&self) -> f64 {
        self.limit
    }

    fn floor(&self) -> f64 {
        self.floor
    }

    fn offer(&mut self, _: &Found<'_, '_>) -> bool {
        self.hits += 1;
        false
    }
}

/// The next hits after a given one, nearest first: a batch of bounded size.
pub(crate) struct Batch<'a> {
    nearest: BinaryHeap<Ranked>,
    size: usize,
    after: Option<&'a Ranked>,
    limit: f64,
    floor: f64,
}

/// A hit with all that its place in the order depends on.
#[derive(Debug)]
pub(crate) struct Ranked {
    pub(crate) hit: Hit,
    // Which of the primitive's crossings: a shape may be crossed twice at the same t.
    order: u32,
}

impl Ord for Ranked {
    fn cmp(&self, other: &Self) -> Ordering {
        by_t(self.hit.root.t, other.hit.root.t).then_with(|| self.hit.route.cmp(&other.hit.route)).then_with(
            || {
                let place = |ranked: &Self| (ranked.hit.geometry, ranked.hit.primitive, ranked.order);
                place(self).cmp(&place(other))
            },
        )
    }
}

impl PartialOrd for Ranked {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Ranked {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Ranked {}

impl<'a> Batch<'a> {
    pub(crate) fn new(ray: &Ray, size: usize, after: Option<&'a Ranked>) -> Self {
        let floor = after.map_or(ray.t_min, |after| after.hit.root.t);
        Self { nearest: BinaryHeap::new(), size, after, limit: ray.t_max, floor }
    }

    /// The hits in order, and whether there may be more.
    pub(crate) fn into_hits(self) -> (Vec<Ranked>, bool) {
        let is_full = self.nearest.len() == self.size;
        (self.nearest.into_sorted_vec(), is_full)
    }
}

impl Search<'_> for Batch<'_> {
    const ASK: Ask = Ask::Every;
    type Order = ByDistance;

    fn limit(&self) -> f64 {
        self.limit
    }

    fn floor(&self) -> f64 {
        self.floor
    }

    fn offer(&mut self, found: &Found<'_, '_>) -> bool {
        let t = found.root.t;
        if t < self.floor || self.limit < t {
            return false;
        }
        let ranked = Ranked { hit: found.to_hit(), order: found.order };
        if self.after.is_some_and(|after| ranked <= *after) {
            return false;
        }
        self.nearest.push(ranked);
        if self.nearest.len() > self.size {
            self.nearest.pop();
        }
        if self.nearest.len() == self.size
            && let Some(farthest) = self.nearest.peek()
        {
            self.limit = farthest.hit.root.t;
        }
        false
    }
}
