//! One search through a tree and all the trees placed in it, for every kind of query.
//!
//! There is no recursion: an instance suspends the frame around it, leaves a mark on the stack, and the mark resumes it.
//! What a query answers never depends on the order of the visit: the tests in leaves are given the ray's own range and
//! not the part still of interest, so that a root has the same bits whenever it is found, and ties have an order.

use lumbre_geometry::{Ray, Root, Roots};
use smallvec::SmallVec;

use crate::collapse::Entry;
use crate::lanes::{LANE_BITS, Lanes, Level, Task, key};
use crate::node::{BoxRay, WIDTH, tag};
use crate::stack::{Stack, stack_entry};
use crate::touch::{self, AllTouches, Touch};
use crate::triangles::{self, BLOCK, Meeting, Shear};
use crate::{Accel, GeometryKind, InstancePath};

/// What a search asks of a primitive that may be crossed more than once.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Ask {
    /// Nothing: triangles alone are of interest.
    Nothing,
    /// Whether it is crossed.
    Whether,
    /// The first crossing.
    First,
    /// Every crossing.
    Every,
}

/// A query: what it takes, and when it has enough.
pub(crate) trait Search {
    /// What it needs to know.
    const ASK: Ask;
    /// Whether nearer boxes are to come first.
    const ORDERED: bool;

    /// The largest `t` that it still wants; never grows.
    fn limit(&self) -> f64;

    /// The smallest `t` that it wants.
    fn floor(&self) -> f64;

    /// Takes a crossing; true ends the search.
    fn offer(&mut self, found: &Found) -> bool;

    /// Takes the news that there is a crossing, which ends the search. Only when it asks [`Ask::Whether`].
    fn settle(&mut self) {}
}

/// A crossing on offer.
pub(crate) struct Found<'a> {
    pub(crate) root: Root,
    pub(crate) geometry: u32,
    pub(crate) primitive: u32,
    /// Which of the primitive's crossings.
    pub(crate) order: u32,
    /// The tree that the geometry stands in.
    pub(crate) accel: &'a Accel,
    pub(crate) place: &'a Place,
}

/// The instances that a search is within.
#[derive(Clone, Debug, Default)]
pub(crate) struct Place {
    /// Their positions in the lists of their trees.
    pub(crate) route: InstancePath,
    /// Their ids.
    pub(crate) ids: InstancePath,
}

/// Whether a ray can meet anything: finite, with a direction and a range.
pub(crate) fn is_sound(ray: &Ray) -> bool {
    ray.origin.is_finite()
        && ray.direction.is_finite()
        && ray.direction.abs().max_element() > 0.0
        && ray.t_min <= ray.t_max
}

/// Runs `search` along `ray`, whose answers it keeps.
#[inline(always)]
pub(crate) fn search<S: Search>(level: Level, accel: &Accel, ray: &Ray, search: &mut S) {
    if is_sound(ray) {
        let mut touches = Vec::new();
        let is_over = level.run(Traversal { accel, ray, search, touches: &mut touches });
        if !is_over && !touches.is_empty() {
            touch::offer_borders(accel, ray, &touches, search);
        }
    }
}

/// Collects what the whole line touches.
pub(crate) fn search_touches<'a>(level: Level, accel: &'a Accel, ray: &Ray, search: &mut AllTouches<'a>) {
    let line = ray.with_range(f64::NEG_INFINITY, f64::INFINITY);
    let mut touches = Vec::new();
    level.run(Traversal { accel, ray: &line, search, touches: &mut touches });
    search.touches = touches;
}

struct Traversal<'a, 's, S> {
    accel: &'a Accel,
    ray: &'s Ray,
    search: &'s mut S,
    /// The triangles met at an edge or a corner.
    touches: &'s mut Vec<Touch<'a>>,
}

/// A tree in progress, with the ray in its space.
struct Frame<'a> {
    accel: &'a Accel,
    ray: Ray,
    shear: Shear,
    boxes: BoxRay,
    /// No box ahead of this key is of interest.
    limit_key: i32,
    limit: f64,
}

const ALWAYS: i32 = i32::MIN;

impl<'a> Frame<'a> {
    #[inline(always)]
    fn new<S: Search>(accel: &'a Accel, ray: Ray, search: &S) -> (Self, bool) {
        let boxes = accel.tree.root.and_then(|_| BoxRay::new(&accel.units, &ray));
        let meets_tree = boxes.is_some();
        let boxes = boxes.unwrap_or_else(BoxRay::passing_all);
        let limit_key = key(boxes.s_max) | LANE_BITS;
        let mut frame =
            Self { accel, ray, shear: Shear::new(ray.direction), boxes, limit_key, limit: ray.t_max };
        if search.floor() > ray.t_min {
            frame.boxes.start_at(search.floor());
        }
        frame.narrow(search);
        (frame, meets_tree)
    }

    /// Takes over what the search has found since.
    #[inline(always)]
    fn narrow<S: Search>(&mut self, search: &S) {
        let limit = search.limit();
        if limit < self.limit {
            self.limit = limit;
            self.boxes.end_at(limit);
            self.limit_key = key(self.boxes.s_max) | LANE_BITS;
        }
    }
}

impl<S: Search> Task for Traversal<'_, '_, S> {
    /// Whether the search ended before it had seen everything.
    type Output = bool;

    #[inline(always)]
    fn run<L: Lanes>(self) -> bool {
        let Self { accel, ray, search, touches } = self;
        let mut stack = Stack::new();
        let mut suspended: SmallVec<[Frame; 2]> = SmallVec::new();
        let mut place = Place::default();

        let (mut frame, meets_tree) = Frame::new(accel, *ray, search);
        if enter(&mut frame, meets_tree, &place, &mut stack, search) {
            return true;
        }
        while let Some(entry) = stack.pop() {
            if (entry >> 32) as i32 > frame.limit_key {
                continue;
            }
            let mut reference = entry as u32;
            while reference >> tag::SHIFT == tag::INNER {
                let node = &frame.accel.tree.nodes[reference as usize];
                let (mask, keys) = L::meet_boxes(node, &frame.boxes);
                if mask & mask.wrapping_sub(1) == 0 {
                    if mask == 0 {
                        break;
                    }
                    reference = node.children[mask.trailing_zeros() as usize % WIDTH];
                    continue;
                }
                let slots = stack.with_room();
                if S::ORDERED {
                    L::push_by_distance(node, mask, keys, slots);
                    let Some(nearest) = slots.pop() else { break };
                    reference = nearest as u32;
                } else {
                    // The first children are the largest.
                    let mut rest = mask & (mask - 1);
                    while rest != 0 {
                        let lane = (31 - rest.leading_zeros()) as usize % WIDTH;
                        rest ^= 1 << lane;
                        slots.push(stack_entry(ALWAYS, node.children[lane]));
                    }
                    reference = node.children[mask.trailing_zeros() as usize % WIDTH];
                }
            }

            let first = (reference & tag::PLACE) as usize;
            match reference >> tag::SHIFT {
                tag::TRIANGLES => {
                    let is_over = meet_blocks::<L, S>(&mut frame, reference, &place, search, touches);
                    if is_over {
                        return true;
                    }
                }
                tag::SHAPES | tag::CUSTOM => {
                    for entry in &frame.accel.tree.entries[first..] {
                        if meet_entry(&frame, entry, &place, search) {
                            return true;
                        }
                        if entry.is_last() {
                            break;
                        }
                    }
                    frame.narrow(search);
                }
                tag::INSTANCE => {
                    let geometry = frame.accel.instance_entry(first).geometry;
                    let standing = &frame.accel.geometries[geometry as usize];
                    let GeometryKind::Instance(instance) = &standing.kind else {
                        unreachable!("the tag says so");
                    };
                    let ray = frame.ray.into_object(&instance.world_from_object);
                    if !is_sound(&ray) {
                        continue;
                    }
                    let (inner, meets_tree) = Frame::new(&instance.accel, ray, search);
                    if !meets_tree && instance.accel.infinite.is_empty() {
                        continue;
                    }
                    place.route.push(geometry);
                    place.ids.push(standing.id);
                    stack.push(stack_entry(ALWAYS, tag::reference(tag::RETURN, 0)));
                    suspended.push(std::mem::replace(&mut frame, inner));
                    if enter(&mut frame, meets_tree, &place, &mut stack, search) {
                        return true;
                    }
                }
                tag::RETURN => {
                    frame = suspended.pop().expect("a mark for every frame");
                    place.route.pop();
                    place.ids.pop();
                    frame.narrow(search);
                }
                // A node that the ray misses.
                _ => {}
            }
        }
        false
    }
}

/// Starts on a tree: what is infinite at once, the rest onto the stack. True ends the search.
#[inline(always)]
fn enter<S: Search>(
    frame: &mut Frame,
    meets_tree: bool,
    place: &Place,
    stack: &mut Stack,
    search: &mut S,
) -> bool {
    if let Some(root) = frame.accel.tree.root.filter(|_| meets_tree) {
        stack.push(stack_entry(ALWAYS, root));
    }
    for (i, entry) in frame.accel.infinite.iter().enumerate() {
        if matches!(frame.accel.geometries[entry.geometry as usize].kind, GeometryKind::Instance(_)) {
            let index = frame.accel.tree.entries.len() + i;
            stack.push(stack_entry(ALWAYS, tag::reference(tag::INSTANCE, index as u32)));
        } else if meet_entry(frame, entry, place, search) {
            return true;
        }
    }
    frame.narrow(search);
    false
}

#[inline(always)]
fn meet_blocks<'a, L: Lanes, S: Search>(
    frame: &mut Frame<'a>,
    reference: u32,
    place: &Place,
    search: &mut S,
    touches: &mut Vec<Touch<'a>>,
) -> bool {
    let mut found_any = false;
    let accel = frame.accel;
    let places = tag::blocks(reference);
    let all_names = &accel.tree.names[places.clone()];
    for (block, names) in accel.tree.blocks[places].iter().zip(all_names) {
        let mesh_origin = accel.mesh_origin(names.geometry);
        let origin = frame.shear.local_origin(frame.ray.origin, &mesh_origin.to_array());
        let mut mask = L::meet_triangles(block, &frame.shear, &origin);
        while mask != 0 {
            let lane = mask.trailing_zeros() as usize % BLOCK;
            mask &= mask - 1;
            let corners = block.triangle(lane);
            let (geometry, primitive) = (names.geometry, names.primitives[lane]);
            let root = match triangles::intersect(&frame.ray, &frame.shear, &origin, &corners) {
                Meeting::Miss => continue,
                Meeting::Hit(root) => root,
                Meeting::Touch { root, is_owned, feature } => {
                    let place = place.clone();
                    touches.push(Touch {
                        root,
                        is_owned,
                        feature,
                        corners,
                        geometry,
                        primitive,
                        accel,
                        place,
                    });
                    if !is_owned || !frame.ray.contains(root.t) {
                        continue;
                    }
                    root
                }
            };
            found_any = true;
            if search.offer(&Found { root, geometry, primitive, order: 0, accel, place }) {
                return true;
            }
        }
    }
    if found_any {
        frame.narrow(search);
    }
    false
}

/// Tests a shape or a primitive of custom geometry.
#[inline(always)]
fn meet_entry<S: Search>(frame: &Frame, entry: &Entry, place: &Place, search: &mut S) -> bool {
    let (geometry, primitive) = (entry.geometry, entry.primitive());
    let kind = &frame.accel.geometries[geometry as usize].kind;
    meet_kind(frame.accel, kind, &frame.ray, geometry, primitive, place, search)
}

/// Offers the crossings of one primitive that is neither a triangle nor an instance.
#[inline(always)]
pub(crate) fn meet_kind<S: Search>(
    accel: &Accel,
    kind: &GeometryKind,
    ray: &Ray,
    geometry: u32,
    primitive: u32,
    place: &Place,
    search: &mut S,
) -> bool {
    let mut offer = |root: Root, order: usize| {
        let order = order as u32;
        // Also keeps out a NaN.
        ray.contains(root.t) && search.offer(&Found { root, geometry, primitive, order, accel, place })
    };
    match S::ASK {
        Ask::Nothing => false,
        Ask::Whether => {
            let is_hit = match kind {
                GeometryKind::Shape(shape) => shape.any(ray),
                GeometryKind::Custom(custom) => custom.any(primitive, ray),
                _ => false,
            };
            if is_hit {
                search.settle();
            }
            is_hit
        }
        Ask::First => {
            let root = match kind {
                GeometryKind::Shape(shape) => shape.closest(ray),
                GeometryKind::Custom(custom) => custom.closest(primitive, ray),
                _ => None,
            };
            root.is_some_and(|root| offer(root, 0))
        }
        Ask::Every => {
            let mut roots = Roots::new();
            match kind {
                GeometryKind::Shape(shape) => shape.roots(ray, &mut roots),
                GeometryKind::Custom(custom) => custom.roots(primitive, ray, &mut roots),
                _ => {}
            }
            roots.into_iter().enumerate().any(|(order, root)| offer(root, order))
        }
    }
}
