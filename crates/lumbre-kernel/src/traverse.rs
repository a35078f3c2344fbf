//! One search through a tree and all the trees placed in it, for every kind of query.
//!
//! There is no recursion: an instance suspends the frame around it, leaves a mark on the stack, and the mark resumes it.
//! What a query answers never depends on the order of the visit: the tests in leaves are given the ray's own range and
//! not the part still of interest, so that a root has the same bits whenever it is found, and ties have an order.

use std::borrow::Borrow;

use lumbre_geometry::{Ray, Root, Roots};
use lumbre_math::DVec3;
use smallvec::SmallVec;

use crate::blocks::{Blocks, TriangleBlock};
use crate::collapse::Entry;
use crate::holds::{Contents, Holds, SingleStart, Sizes};
use crate::hulls::HullRay;
use crate::lanes::{self, Lanes, Level, MetHulls, Task};
use crate::node::{BoxRay, Progress, Slabs, tag};
use crate::opening::Start;
use crate::single::Outcome;
use crate::sphere_search::{self, AmongSpheres, CloudRay};
use crate::spheres::ExactSphere;
use crate::stack::{Order, Stack};
use crate::touch::{self, AllTouches, Touch};
use crate::triangles::{self, BLOCK, BlockRay, HeightRange, Inside, Passage, Shear};
use crate::way::Way;
use crate::{Accel, GeometryKind, InstancePath, options, precise};

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
pub(crate) trait Search<'a> {
    /// What it needs to know.
    const ASK: Ask;
    /// Whether it wants to know which side of what is no triangle is met.
    const FACES: bool = false;
    /// Which boxes are to come first.
    type Order: Order;

    /// Whether it wants anything in an instance.
    #[inline(always)]
    fn enters(&self, _accel: &Accel, _geometry: u32) -> bool {
        true
    }

    /// The largest `t` that it still wants; never grows.
    fn limit(&self) -> f64;

    /// The smallest `t` that it wants.
    fn floor(&self) -> f64;

    /// Takes a crossing; true ends the search.
    fn offer(&mut self, found: &Found<'a, '_>) -> bool;

    /// The same for the inside of a triangle.
    #[inline(always)]
    fn offer_inside(&mut self, t: f64, inside: &Inside, what: What, accel: &'a Accel, place: &Place) -> bool {
        let is_front = inside.det > 0.0;
        self.offer(&Found { root: inside.root(t), what, order: 0, is_front, accel, place })
    }

    /// Takes the news that there is a crossing, which ends the search. Only where it asks [`Ask::Whether`].
    fn settle(&mut self) {}

    /// Searches a placed tree of nothing but triangles in single precision, if that can settle what it wants; true ends the search.
    /// The ray is that in the tree's space, and has started among its boxes.
    #[inline(always)]
    fn meet_single<L: Lanes>(
        &mut self,
        _placed: &PlacedTree<'a, '_>,
        _ray: &Ray,
        _slabs: Slabs,
    ) -> Outcome<bool> {
        Outcome::Unsettled
    }
}

/// A tree in an instance, for single precision.
pub(crate) struct PlacedTree<'a, 'p> {
    pub(crate) accel: &'a Accel,
    pub(crate) start: &'a SingleStart,
    /// Where it is entered.
    pub(crate) root: u32,
    pub(crate) standing: Standing<'p>,
}

/// Where a tree stands, which is only written down once something is met there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Standing<'p> {
    /// Instances around it, but for the innermost one where that is given.
    pub(crate) around: &'p Place,
    /// The position of that, and its id.
    pub(crate) innermost: Option<(u32, u32)>,
}

impl<'p> Standing<'p> {
    /// At a place.
    #[inline(always)]
    pub(crate) fn at(around: &'p Place) -> Self {
        Self { around, innermost: None }
    }

    /// In one more instance.
    #[inline(always)]
    pub(crate) fn within(around: &'p Place, geometry: u32, id: u32) -> Self {
        Self { around, innermost: Some((geometry, id)) }
    }

    /// The place of what is in the tree.
    #[inline(always)]
    pub(crate) fn place(&self) -> Place {
        let mut place = self.around.clone();
        if let Some((geometry, id)) = self.innermost {
            place.route.push(geometry);
            place.ids.push(id);
        }
        place
    }

    /// Whether it has this route.
    #[inline(always)]
    pub(crate) fn has_route(&self, route: &[u32]) -> bool {
        match self.innermost {
            Some((geometry, _)) => route.split_last() == Some((&geometry, &self.around.route[..])),
            None => *route == self.around.route[..],
        }
    }
}

/// A crossing on offer.
pub(crate) struct Found<'a, 'p> {
    pub(crate) root: Root,
    pub(crate) what: What,
    /// Which of the primitive's crossings.
    pub(crate) order: u32,
    /// Whether the front is met; of what is no triangle, only where the search wants to know.
    pub(crate) is_front: bool,
    /// The tree that the geometry stands in.
    pub(crate) accel: &'a Accel,
    pub(crate) place: &'p Place,
}

/// What is crossed.
#[derive(Clone, Copy)]
pub(crate) enum What {
    /// The triangle in a lane of the block that begins there, whose name is looked up when it is wanted.
    Lane { block: u32, lane: u32 },
    /// The sphere in a lane of a block, alike.
    Sphere { block: u32, lane: u32 },
    /// A primitive by its names.
    Named { geometry: u32, primitive: u32 },
}

impl What {
    /// Geometry and primitive.
    #[inline(always)]
    pub(crate) fn names(self, accel: &Accel) -> (u32, u32) {
        match self {
            Self::Lane { block, lane } => {
                let names = &accel.tree.names[accel.tree.block(block).number() as usize];
                (names.geometry, names.primitives[lane as usize % BLOCK])
            }
            Self::Sphere { block, lane } => {
                let names = &accel.tree.sphere_names[block as usize];
                (names.geometry, names.primitives[lane as usize % BLOCK])
            }
            Self::Named { geometry, primitive } => (geometry, primitive),
        }
    }
}

/// The instances that a search is within.
#[derive(Debug, Default)]
pub(crate) struct Place {
    /// Their positions in the lists of their trees.
    pub(crate) route: InstancePath,
    /// Their ids.
    pub(crate) ids: InstancePath,
}

impl Clone for Place {
    // Every better hit takes a copy, and that of a slice is no loop.
    #[inline]
    fn clone(&self) -> Self {
        Self { route: InstancePath::from_slice(&self.route), ids: InstancePath::from_slice(&self.ids) }
    }
}

impl Place {
    /// Whether it is in an instance.
    #[inline(always)]
    pub(crate) fn is_within(&self) -> bool {
        !self.route.is_empty()
    }
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
pub(crate) fn search<'a, S: Search<'a>>(level: Level, accel: &'a Accel, ray: &Ray, search: &mut S) {
    search_from(level, accel, Start::WHOLE, Place::default(), ray, search);
}

/// The same in a part of a tree that stands at a place; crossings exactly at an edge may be ones of the whole.
#[inline(always)]
pub(crate) fn search_from<'a, S: Search<'a>>(
    level: Level,
    accel: &'a Accel,
    from: Start,
    mut place: Place,
    ray: &Ray,
    search: &mut S,
) {
    let mut touches = Vec::new();
    let (place, touched) = (&mut place, &mut touches);
    let is_over = if accel.holds.only_triangles {
        level.run(AmongTriangles { accel, from, place, ray, search: &mut *search, touches: touched })
    } else if accel.holds.only_spheres {
        level.run(AmongSpheres { accel, from, place, ray, search: &mut *search })
    } else {
        level.run(AmongAll { accel, from, place, ray, search: &mut *search, touches: touched })
    };
    if !is_over && !touches.is_empty() {
        touch::offer_borders(level, accel, place, ray, &touches, search);
    }
}

/// Collects what the whole line touches.
pub(crate) fn all_touches<'a>(
    level: Level,
    accel: &'a Accel,
    place: &mut Place,
    ray: &Ray,
) -> Vec<Touch<'a>> {
    let line = ray.with_range(f64::NEG_INFINITY, f64::INFINITY);
    let mut touches = Vec::new();
    let from = Start::WHOLE;
    level.run(AmongAll { accel, from, place, ray: &line, search: &mut AllTouches, touches: &mut touches });
    touches
}

/// A tree in progress, with the ray in its space.
pub(crate) struct Frame<'a, R, L> {
    accel: &'a Accel,
    // Those of the tree, which may lie in a file.
    way: Way<'a, L>,
    blocks: Blocks<'a>,
    pub(crate) ray: R,
    progress: Progress,
    limit: f64,
    floor: f64,
    /// For triangles, once the ray has come to some.
    mesh: Option<MeshRay>,
    /// For spheres, once some were met.
    clouds: Option<CloudRay>,
    /// For shapes, alike.
    hulls: Option<HullRay>,
}

/// The ray for the triangles of one mesh, or of some with one origin.
struct MeshRay {
    shear: Shear,
    /// Relative to the mesh's.
    origin: [f64; 3],
    /// Where single precision tells anything.
    blocks: Option<BlockRay>,
}

impl MeshRay {
    #[inline(always)]
    fn new(shear: Shear, ray: &Ray, mesh_origin: &DVec3, largest_corner: f32, range: [f64; 2]) -> Self {
        let origin = shear.local_origin(&ray.origin, mesh_origin);
        let blocks = BlockRay::new(&shear, &origin, largest_corner, range[0], range[1]);
        Self { shear, origin, blocks }
    }
}

/// Makes `boxes` the ray for the boxes of a tree, as far as the search wants it; false where it passes the tree by or is not
/// sound.
#[inline(always)]
pub(crate) fn start<'a, L: Lanes, S: Search<'a>>(
    accel: &Accel,
    ray: &Ray,
    search: &S,
    boxes: &mut BoxRay,
) -> bool {
    let (floor, limit) = (search.floor(), search.limit());
    L::start_nearby(&accel.units, ray, floor, limit, boxes)
        || (is_sound(ray) && boxes.start_anywhere(&accel.units, ray, floor, limit))
}

impl<'a, R: Borrow<Ray>, L: Lanes> Frame<'a, R, L> {
    #[inline(always)]
    pub(crate) fn new<S: Search<'a>>(accel: &'a Accel, ray: R, boxes: BoxRay, search: &S) -> Self {
        let (limit, floor) = (search.limit(), search.floor());
        let way = Way::new(&accel.tree.nodes, boxes.slabs);
        Self {
            accel,
            way,
            blocks: accel.tree.blocks(),
            ray,
            progress: boxes.progress,
            limit,
            floor,
            mesh: None,
            clouds: None,
            hulls: None,
        }
    }

    /// Takes over what the search has found since.
    #[inline(always)]
    fn narrow<S: Search<'a>>(&mut self, search: &S) {
        let limit = search.limit();
        if limit < self.limit {
            self.limit = limit;
            self.way.end_at(self.progress.up(limit));
            if let Some(MeshRay { shear, blocks: Some(blocks), .. }) = &mut self.mesh {
                blocks.end_at(shear, limit);
            }
            if let Some(clouds) = &mut self.clouds {
                clouds.set_range(self.floor, limit);
            }
        }
    }

    /// Turns to the mesh of a block: to the first that the ray comes to, and where meshes have different origins to each.
    #[inline(always)]
    fn turn_to(&mut self, block: &TriangleBlock) {
        let Holds { has_one_origin, first_origin, sizes: Sizes { largest_corner, .. }, .. } =
            self.accel.holds;
        if has_one_origin && self.mesh.is_some() {
            return;
        }
        let ray = self.ray.borrow();
        let shear = self.mesh.as_ref().map_or_else(|| Shear::new(&ray.direction), |mesh| mesh.shear);
        let names = &self.accel.tree.names;
        let mesh_origin = if has_one_origin {
            first_origin
        } else {
            self.accel.mesh_origin(names[block.number() as usize].geometry)
        };
        let range = [self.floor, self.limit];
        self.mesh = Some(MeshRay::new(shear, ray, &mesh_origin, largest_corner, range));
    }
}

/// A search through a tree of nothing but triangles.
struct AmongTriangles<'a, 's, S> {
    accel: &'a Accel,
    from: Start,
    place: &'s Place,
    ray: &'s Ray,
    search: &'s mut S,
    /// The triangles met at an edge or a corner.
    touches: &'s mut Vec<Touch<'a>>,
}

impl<'a, S: Search<'a>> Task for AmongTriangles<'a, '_, S> {
    /// Whether the search ended before it had seen everything.
    type Output = bool;

    #[inline(always)]
    fn run<L: Lanes>(self) -> bool {
        let Self { accel, from, place, ray, search, touches } = self;
        let Some(root) = accel.tree.root else { return false };
        let mut boxes = BoxRay::passing_all();
        if !start::<L, S>(accel, ray, search, &mut boxes) {
            return false;
        }
        let mut frame = Frame::<&Ray, L>::new(accel, ray, boxes, search);
        meet_triangles(&mut frame, from.below(root), &mut Stack::new(), place, search, touches)
    }
}

/// Searches a tree of nothing but triangles, on a stack that is empty. True ends the search.
#[inline(always)]
fn meet_triangles<'a, R: Borrow<Ray>, L: Lanes, S: Search<'a>>(
    frame: &mut Frame<'a, R, L>,
    root: u32,
    stack: &mut Stack<<S::Order as Order>::Entry>,
    place: &Place,
    search: &mut S,
    touches: &mut Vec<Touch<'a>>,
) -> bool {
    let mut next = Some(root);
    while let Some(reference) = next {
        let Some(leaf) = frame.way.descend::<S::Order>(reference, stack) else { break };
        if meet_blocks(frame, leaf, place, search, touches) {
            return true;
        }
        next = frame.way.pop::<S::Order>(stack);
    }
    false
}

/// A search through a tree of anything.
struct AmongAll<'a, 's, S> {
    accel: &'a Accel,
    from: Start,
    /// As it was again, unless the search ends before it has seen everything.
    place: &'s mut Place,
    ray: &'s Ray,
    search: &'s mut S,
    touches: &'s mut Vec<Touch<'a>>,
}

impl<'a, S: Search<'a>> Task for AmongAll<'a, '_, S> {
    /// Whether the search ended before it had seen everything.
    type Output = bool;

    #[inline(always)]
    fn run<L: Lanes>(self) -> bool {
        let Self { accel, from, place, ray, search, touches } = self;
        if !is_sound(ray) {
            return false;
        }
        let mut stack: Stack<<S::Order as Order>::Entry> = Stack::new();
        let mut inner_stack = Stack::new();
        let mut suspended: SmallVec<[Frame<Ray, L>; 2]> = SmallVec::new();

        let mut boxes = BoxRay::passing_all();
        let meets_tree = start::<L, S>(accel, ray, search, &mut boxes);
        let mut frame = Frame::<Ray, L>::new(accel, *ray, boxes, search);
        if enter(&mut frame, from, meets_tree, place, &mut stack, search) {
            return true;
        }
        while let Some(reference) = frame.way.pop::<S::Order>(&mut stack) {
            let Some(leaf) = frame.way.descend::<S::Order>(reference, &mut stack) else { break };
            let first = (leaf & tag::PLACE) as usize;
            match leaf >> tag::SHIFT {
                tag::TRIANGLES => {
                    if meet_blocks(&mut frame, leaf, place, search, touches) {
                        return true;
                    }
                }
                tag::SPHERES => {
                    let Frame { accel, ray, clouds, .. } = &mut frame;
                    if sphere_search::meet_leaf::<L, S>(accel, ray, leaf, clouds, place, search) {
                        return true;
                    }
                    frame.narrow(search);
                }
                tag::SHAPES if frame.progress.is_nearby() && frame.accel.hulls.block(first).is_some() => {
                    if meet_shapes(&mut frame, first, place, search) {
                        return true;
                    }
                    frame.narrow(search);
                }
                tag::SHAPES | tag::CUSTOM => {
                    for entry in &frame.accel.tree.entries[first..] {
                        if meet_entry(&frame, entry, place, search) {
                            return true;
                        }
                        if entry.is_last() {
                            break;
                        }
                    }
                    frame.narrow(search);
                }
                tag::PRECISE => {
                    for entry in &frame.accel.tree.entries[first..] {
                        let name = [entry.geometry, entry.primitive()];
                        if precise::meet(frame.accel, &frame.ray, name, place, search, touches) {
                            return true;
                        }
                        if entry.is_last() {
                            break;
                        }
                    }
                    frame.narrow(search);
                }
                tag::INSTANCE => {
                    let entry = frame.accel.instance_entry(first);
                    let (geometry, from) = (entry.geometry, Start::of(entry.primitive()));
                    if from.is_nothing() || !search.enters(frame.accel, geometry) {
                        continue;
                    }
                    let standing = &frame.accel.geometries[geometry as usize];
                    let GeometryKind::Instance(instance) = &standing.kind else {
                        unreachable!("the tag says so");
                    };
                    let inner = &*instance.accel;
                    if let Some(start) =
                        inner.single.as_ref().filter(|start| start.contents == Contents::Triangles)
                    {
                        let (root, id) = (from.below(start.root), standing.id);
                        let standing = Standing::within(place, geometry, id);
                        let placed = PlacedTree { accel: inner, start, root, standing };
                        // Nothing beyond the limit is wanted; what is met has the same bits whatever the range.
                        let range = [search.floor(), search.limit()];
                        let mut moving = None;
                        let map = instance.world_from_object.map_at(frame.ray.time, &mut moving);
                        let (ray, slabs) = L::start_placed(start, map, &frame.ray, range);
                        if let Some(slabs) = slabs
                            && let Outcome::Settled(is_over) = search.meet_single::<L>(&placed, &ray, slabs)
                        {
                            if is_over {
                                return true;
                            }
                            frame.narrow(search);
                            continue;
                        }
                    }
                    let ray = instance.world_from_object.object_ray(&frame.ray);
                    let mut boxes = BoxRay::passing_all();
                    if inner.holds.only_triangles {
                        let Some(root) = inner.tree.root else { continue };
                        let root = from.below(root);
                        if start::<L, S>(inner, &ray, search, &mut boxes) {
                            place.route.push(geometry);
                            place.ids.push(standing.id);
                            let mut inner = Frame::<&Ray, L>::new(inner, &ray, boxes, search);
                            if meet_triangles(&mut inner, root, &mut inner_stack, place, search, touches) {
                                return true;
                            }
                            place.route.pop();
                            place.ids.pop();
                            frame.narrow(search);
                        }
                        continue;
                    }
                    let meets_tree =
                        inner.tree.root.is_some() && start::<L, S>(inner, &ray, search, &mut boxes);
                    if !meets_tree && (inner.infinite.is_empty() || !is_sound(&ray)) {
                        continue;
                    }
                    place.route.push(geometry);
                    place.ids.push(standing.id);
                    stack.push(S::Order::entry(tag::reference(tag::RETURN, 0)));
                    let inner = Frame::new(inner, ray, boxes, search);
                    suspended.push(std::mem::replace(&mut frame, inner));
                    if enter(&mut frame, from, meets_tree, place, &mut stack, search) {
                        return true;
                    }
                }
                tag::RETURN => {
                    frame = suspended.pop().expect("a mark for every frame");
                    place.route.pop();
                    place.ids.pop();
                    frame.narrow(search);
                }
                _ => unreachable!("no other tags"),
            }
        }
        false
    }
}

/// Starts on a tree, or on a part of one: what is infinite at once, the rest onto the stack. True ends the search.
#[inline(always)]
fn enter<'a, L: Lanes, S: Search<'a>>(
    frame: &mut Frame<'a, Ray, L>,
    from: Start,
    meets_tree: bool,
    place: &Place,
    stack: &mut Stack<<S::Order as Order>::Entry>,
    search: &mut S,
) -> bool {
    if let Some(root) = frame.accel.tree.root.filter(|_| meets_tree) {
        stack.push(S::Order::entry(from.below(root)));
    }
    for (i, entry) in frame.accel.infinite.iter().enumerate() {
        if matches!(frame.accel.geometries[entry.geometry as usize].kind, GeometryKind::Instance(_)) {
            let index = frame.accel.tree.entries.len() + i;
            stack.push(S::Order::entry(tag::reference(tag::INSTANCE, index as u32)));
        } else if meet_entry(frame, entry, place, search) {
            return true;
        }
    }
    frame.narrow(search);
    false
}

/// Tests the triangles of a leaf. True ends the search.
#[inline(always)]
fn meet_blocks<'a, R: Borrow<Ray>, L: Lanes, S: Search<'a>>(
    frame: &mut Frame<'a, R, L>,
    leaf: u32,
    place: &Place,
    search: &mut S,
    touches: &mut Vec<Touch<'a>>,
) -> bool {
    let accel = frame.accel;
    let mut following = Some(leaf & tag::PLACE);
    // All of a leaf are of one mesh.
    frame.turn_to(frame.blocks.block(leaf & tag::PLACE));
    while let Some(number) = following {
        let block = frame.blocks.block(number);
        following = block.next(number);
        let Some(mesh) = &frame.mesh else { unreachable!("the ray was turned to it") };
        let mut mask = if let Some(blocks) = &mesh.blocks {
            let (mask, edges) = L::meet_triangles(block, blocks);
            if mask == 0 {
                continue;
            }
            let crossings = L::place_crossings(&edges, blocks);
            if S::ASK == Ask::Whether && crossings.sure & mask != 0 {
                search.settle();
                return true;
            }
            crossings.in_range & mask
        } else {
            block.taken()
        };
        let MeshRay { shear, origin, .. } = *mesh;
        while mask != 0 {
            let lane = mask.trailing_zeros() as usize % BLOCK;
            mask &= mask - 1;
            let what = What::Lane { block: number, lane: lane as u32 };
            let (passage, inside) = L::pass(block, lane, &shear, &origin);
            if passage == Passage::Inside {
                let t = inside.t(&shear);
                if !triangles::is_in_range(frame.ray.borrow(), t) {
                    continue;
                }
                if search.offer_inside(t, &inside, what, accel, place) {
                    return true;
                }
                frame.narrow(search);
            } else if passage == Passage::Unclear {
                let ray = frame.ray.borrow();
                if meet_unclear(ray, shear, origin, accel, what, place, search, touches) {
                    return true;
                }
                frame.narrow(search);
            }
        }
    }
    false
}

/// Tests a triangle that may be touched at an edge, or is seen on edge.
#[cold]
#[inline(never)]
#[allow(clippy::too_many_arguments)]
fn meet_unclear<'a, S: Search<'a>>(
    ray: &Ray,
    shear: Shear,
    origin: [f64; 3],
    accel: &'a Accel,
    what: What,
    place: &Place,
    search: &mut S,
    touches: &mut Vec<Touch<'a>>,
) -> bool {
    let What::Lane { block, lane } = what else { unreachable!("triangles are in blocks") };
    let (block, lane) = (accel.tree.block(block), lane as usize);
    let meeting = triangles::intersect(ray, shear, origin, shear.axes.gather(block, lane));
    let corners = block.triangle(lane).map(|corner| corner.map(f64::from));
    touch::offer_meeting(meeting, ray, corners, what, accel, place, search, touches)
}

/// Tests a leaf of shapes, whose hulls there are: in double precision those alone whose hulls are met.
#[inline(always)]
fn meet_shapes<'a, L: Lanes, S: Search<'a>>(
    frame: &mut Frame<'a, Ray, L>,
    mut first: usize,
    place: &Place,
    search: &mut S,
) -> bool {
    let accel = frame.accel;
    let length = frame.ray.direction.abs().max_element();
    let hulls = *frame.hulls.get_or_insert_with(|| HullRay::new(&accel.units, &frame.ray, length));
    let range = HeightRange::new((search.floor() * length) as f32, (search.limit() * length) as f32);
    while let Some((block, goes_on)) = accel.hulls.block(first) {
        let MetHulls { mut mask, sure, .. } = match S::ASK {
            Ask::Whether => lanes::meet_hulls::<L, true>(block, &hulls, &range),
            Ask::First | Ask::Every | Ask::Nothing => lanes::meet_hulls::<L, false>(block, &hulls, &range),
        };
        if S::ASK == Ask::Whether && sure != 0 {
            search.settle();
            return true;
        }
        while mask != 0 {
            let entry = &accel.tree.entries[first + mask.trailing_zeros() as usize];
            mask &= mask - 1;
            if meet_entry(frame, entry, place, search) {
                return true;
            }
        }
        if !goes_on {
            break;
        }
        first += BLOCK;
    }
    false
}

/// Tests a shape or a primitive of custom geometry.
#[inline(always)]
fn meet_entry<'a, L: Lanes, S: Search<'a>>(
    frame: &Frame<'a, Ray, L>,
    entry: &Entry,
    place: &Place,
    search: &mut S,
) -> bool {
    let (geometry, primitive) = (entry.geometry, entry.primitive());
    meet_primitive(frame.accel, &frame.ray, geometry, primitive, place, search)
}

/// Whether a shape, or a primitive of custom geometry, is crossed within the ray's range.
#[inline(always)]
pub(crate) fn is_crossed(kind: &GeometryKind, primitive: u32, ray: &Ray) -> bool {
    match kind {
        GeometryKind::Shape(shape) => shape.any(ray),
        GeometryKind::Custom(custom) => custom.any(primitive, ray),
        _ => false,
    }
}

/// The first of its crossings. What custom geometry answers may lie out of the range.
#[inline(always)]
pub(crate) fn first_crossing(kind: &GeometryKind, primitive: u32, ray: &Ray) -> Option<Root> {
    match kind {
        GeometryKind::Shape(shape) => shape.closest(ray),
        GeometryKind::Custom(custom) => custom.closest(primitive, ray),
        _ => None,
    }
}

/// All of its crossings. What custom geometry answers may lie out of the range.
pub(crate) fn all_crossings(kind: &GeometryKind, primitive: u32, ray: &Ray) -> Roots {
    let mut roots = Roots::new();
    match kind {
        GeometryKind::Shape(shape) => shape.roots(ray, &mut roots),
        GeometryKind::Custom(custom) => custom.roots(primitive, ray, &mut roots),
        _ => {}
    }
    roots
}

/// Offers the crossings of one primitive that is neither a triangle nor an instance.
#[inline(always)]
pub(crate) fn meet_primitive<'a, S: Search<'a>>(
    accel: &'a Accel,
    ray: &Ray,
    geometry: u32,
    primitive: u32,
    place: &Place,
    search: &mut S,
) -> bool {
    let kind = &accel.geometries[geometry as usize].kind;
    let what = What::Named { geometry, primitive };
    if let GeometryKind::Spheres(cloud) = kind {
        let sphere = ExactSphere::of(cloud, primitive);
        return sphere_search::offer_crossings(accel, ray, &sphere, what, place, search);
    }
    let mut offer = |root: Root, order: usize| {
        let order = order as u32;
        // Also keeps out a NaN.
        if !ray.contains(root.t) {
            return false;
        }
        let is_front = S::FACES && options::meets_front(accel, ray, what, &root);
        search.offer(&Found { root, what, order, is_front, accel, place })
    };
    match S::ASK {
        Ask::Nothing => false,
        Ask::Whether => {
            let is_hit = is_crossed(kind, primitive, ray);
            if is_hit {
                search.settle();
            }
            is_hit
        }
        Ask::First => first_crossing(kind, primitive, ray).is_some_and(|root| offer(root, 0)),
        Ask::Every => {
            let roots = all_crossings(kind, primitive, ray);
            roots.into_iter().enumerate().any(|(order, root)| offer(root, order))
        }
    }
}
