//! Leaves of spheres in a search, and the search through trees of nothing else.

use std::marker::PhantomData;

use lumbre_geometry::{Ray, Root, Roots};
use lumbre_math::DVec3;

use crate::lanes::{LANE_BITS, Lanes, Task};
use crate::node::{BoxRay, Node, tag};
use crate::spheres::{ExactSphere, SphereRay};
use crate::stack::{Order, Stack};
use crate::traverse::{self, Ask, Found, Place, Search, What};
use crate::triangles::BLOCK;
use crate::{Accel, options};

/// The ray for the spheres of one cloud, or of some with one origin.
pub(crate) struct CloudRay {
    geometry: u32,
    /// The cloud's.
    origin: DVec3,
    spheres: SphereRay,
}

impl CloudRay {
    #[inline(always)]
    fn new<'a, S: Search<'a>>(accel: &Accel, ray: &Ray, geometry: u32, search: &S) -> Self {
        let origin = accel.cloud(geometry).origin;
        let mut spheres = SphereRay::new(ray, &origin, accel.holds.sphere_reach);
        spheres.set_range(search.floor(), search.limit());
        Self { geometry, origin, spheres }
    }

    #[inline(always)]
    pub(crate) fn set_range(&mut self, t_min: f64, t_max: f64) {
        self.spheres.set_range(t_min, t_max);
    }
}

/// Tests the spheres of a leaf; `turned` is the ray for the last cloud that was met. True ends the search.
#[inline(always)]
pub(crate) fn meet_leaf<'a, L: Lanes, S: Search<'a>>(
    accel: &'a Accel,
    ray: &Ray,
    leaf: u32,
    turned: &mut Option<CloudRay>,
    place: &Place,
    search: &mut S,
) -> bool {
    let places = tag::blocks(leaf);
    for (number, block) in (places.start as u32..).zip(&accel.tree.sphere_blocks[places]) {
        // Names are elsewhere in memory: where they cannot matter, they are not asked.
        let is_other = |cloud: &CloudRay| {
            !accel.holds.has_one_cloud_origin
                && cloud.geometry != accel.tree.sphere_names[number as usize].geometry
        };
        if turned.as_ref().is_none_or(is_other) {
            let geometry = accel.tree.sphere_names[number as usize].geometry;
            *turned = Some(CloudRay::new(accel, ray, geometry, search));
        }
        let Some(cloud) = turned else { return false };
        let (mut mask, sure) = match S::ASK {
            Ask::Whether => L::meet_spheres::<true>(block, &cloud.spheres),
            Ask::First | Ask::Every | Ask::Nothing => L::meet_spheres::<false>(block, &cloud.spheres),
        };
        if S::ASK == Ask::Whether && sure != 0 {
            search.settle();
            return true;
        }
        let limit = search.limit();
        while mask != 0 {
            let lane = mask.trailing_zeros() as usize % BLOCK;
            mask &= mask - 1;
            let what = What::Sphere { block: number, lane: lane as u32 };
            if offer_crossings(accel, ray, &block.sphere(lane, &cloud.origin), what, place, search) {
                return true;
            }
        }
        if search.limit() < limit {
            cloud.spheres.set_range(search.floor(), search.limit());
        }
    }
    false
}

/// Offers what a search asks of one sphere. True ends the search.
#[inline(always)]
pub(crate) fn offer_crossings<'a, S: Search<'a>>(
    accel: &'a Accel,
    ray: &Ray,
    sphere: &ExactSphere,
    what: What,
    place: &Place,
    search: &mut S,
) -> bool {
    let mut offer = |root: Root, order: usize| {
        let is_front = S::FACES && options::meets_front(accel, ray, what, &root);
        search.offer(&Found { root, what, order: order as u32, is_front, accel, place })
    };
    match S::ASK {
        Ask::Nothing => false,
        Ask::Whether => {
            let is_hit = sphere.closest(ray).is_some();
            if is_hit {
                search.settle();
            }
            is_hit
        }
        Ask::First => sphere.closest(ray).is_some_and(|root| offer(root, 0)),
        Ask::Every => {
            let mut roots = Roots::new();
            sphere.roots(ray, &mut roots);
            roots.into_iter().enumerate().any(|(order, root)| offer(root, order))
        }
    }
}

/// A search through a tree of nothing but spheres.
pub(crate) struct AmongSpheres<'a, 's, S> {
    pub(crate) accel: &'a Accel,
    pub(crate) ray: &'s Ray,
    pub(crate) search: &'s mut S,
}

/// Its way through the nodes.
struct Walk<'a, L> {
    nodes: &'a [Node],
    boxes: BoxRay,
    /// No box ahead of this key is of interest.
    limit_key: i32,
    lanes: PhantomData<L>,
}

impl<L: Lanes> Walk<'_, L> {
    #[inline(always)]
    fn pop<O: Order>(&self, stack: &mut Stack<O::Entry>) -> Option<u32> {
        loop {
            let entry = stack.pop()?;
            if !O::is_beyond(entry, self.limit_key) {
                return Some(O::reference(entry));
            }
        }
    }

    /// Goes down from a node to a leaf; `None` when there is none left.
    #[inline(always)]
    fn descend<O: Order>(&self, mut reference: u32, stack: &mut Stack<O::Entry>) -> Option<u32> {
        while reference >> tag::SHIFT == tag::INNER {
            let node = &self.nodes[reference as usize];
            let (mask, keys) = L::meet_boxes(node, &self.boxes.slabs);
            reference = if mask & mask.wrapping_sub(1) != 0 {
                O::push_children::<L>(node, mask, keys, stack.with_room())
            } else if mask != 0 {
                L::only_child(node, mask)
            } else {
                self.pop::<O>(stack)?
            };
        }
        Some(reference)
    }

    #[inline(always)]
    fn narrow(&mut self, limit: f64) {
        self.boxes.slabs.s_max = self.boxes.progress.up(limit);
        self.limit_key = self.boxes.slabs.s_max.to_bits() as i32 | LANE_BITS;
    }
}

impl<'a, S: Search<'a>> Task for AmongSpheres<'a, '_, S> {
    /// Whether the search ended before it had seen everything.
    type Output = bool;

    #[inline(always)]
    fn run<L: Lanes>(self) -> bool {
        let Self { accel, ray, search } = self;
        let Some(root) = accel.tree.root else { return false };
        let mut boxes = BoxRay::passing_all();
        if !traverse::start::<L, S>(accel, ray, search, &mut boxes) {
            return false;
        }
        let limit_key = boxes.slabs.s_max.to_bits() as i32 | LANE_BITS;
        let mut walk = Walk::<L> { nodes: &accel.tree.nodes, boxes, limit_key, lanes: PhantomData };
        let mut turned = None;
        let place = Place::default();
        let mut stack = Stack::new();
        let mut next = Some(root);
        while let Some(reference) = next {
            let Some(leaf) = walk.descend::<S::Order>(reference, &mut stack) else { break };
            let limit = search.limit();
            if meet_leaf::<L, S>(accel, ray, leaf, &mut turned, &place, search) {
                return true;
            }
            if search.limit() < limit {
                walk.narrow(search.limit());
            }
            next = walk.pop::<S::Order>(&mut stack);
        }
        false
    }
}
