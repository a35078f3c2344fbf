//! Leaves of spheres in a search, and the search through trees of nothing else.

use lumbre_geometry::{Ray, Root, Roots};
use lumbre_math::DVec3;

use crate::lanes::{self, Lanes, Task, Vector};
use crate::node::{BoxRay, tag};
use crate::opening::Start;
use crate::spheres::{ExactSphere, SphereRay};
use crate::stack::Stack;
use crate::traverse::{self, Ask, Found, Place, Search, What};
use crate::triangles::BLOCK;
use crate::way::Way;
use crate::{Accel, options};

/// The ray for the spheres of one cloud, or of some with one origin.
pub(crate) struct CloudRay {
    geometry: u32,
    /// The cloud's.
    origin: DVec3,
    /// Where the first test tells anything; and how many units of space there are for each of `t`.
    spheres: Option<(SphereRay, f64)>,
}

impl CloudRay {
    #[inline(always)]
    fn new<'a, S: Search<'a>>(accel: &Accel, ray: &Ray, geometry: u32, search: &S) -> Self {
        let origin = accel.cloud(geometry).origin;
        let spheres = SphereRay::new(ray, &origin, accel.holds.sizes.sphere_reach);
        let mut cloud = Self { geometry, origin, spheres };
        cloud.set_range(search.floor(), search.limit());
        cloud
    }

    #[inline(always)]
    pub(crate) fn set_range(&mut self, t_min: f64, t_max: f64) {
        if let Some((spheres, length)) = &mut self.spheres {
            spheres.set_range(*length, t_min, t_max);
        }
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
        let (mut mask, sure) = match &cloud.spheres {
            Some((ray, _)) => lanes::meet_spheres::<L>(block, ray),
            None => (L::Eight::ALL, 0),
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
            cloud.set_range(search.floor(), search.limit());
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
    pub(crate) from: Start,
    pub(crate) place: &'s Place,
    pub(crate) ray: &'s Ray,
    pub(crate) search: &'s mut S,
}

impl<'a, S: Search<'a>> Task for AmongSpheres<'a, '_, S> {
    /// Whether the search ended before it had seen everything.
    type Output = bool;

    #[inline(always)]
    fn run<L: Lanes>(self) -> bool {
        let Self { accel, from, place, ray, search } = self;
        let Some(root) = accel.tree.root else { return false };
        let mut boxes = BoxRay::passing_all();
        if !traverse::start::<L, S>(accel, ray, search, &mut boxes) {
            return false;
        }
        let mut way = Way::<L>::new(&accel.tree.nodes, boxes.slabs);
        let mut turned = None;
        let mut stack = Stack::new();
        let mut next = Some(from.below(root));
        while let Some(reference) = next {
            let Some(leaf) = way.descend::<S::Order>(reference, &mut stack) else { break };
            let limit = search.limit();
            if meet_leaf::<L, S>(accel, ray, leaf, &mut turned, place, search) {
                return true;
            }
            if search.limit() < limit {
                way.end_at(boxes.progress.up(search.limit()));
            }
            next = way.pop::<S::Order>(&mut stack);
        }
        false
    }
}
