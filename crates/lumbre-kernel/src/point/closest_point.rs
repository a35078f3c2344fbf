//! The nearest point of all surfaces to a given point.
//!
//! Branch and bound, the nearest box first, in all trees together: entering an instance adds a frame, with its map to
//! the outermost space, in which all distances are measured. A tree's boxes are in single precision and contain their
//! primitives up to a `slop` (see `node`), which is subtracted from every distance. Primitives without area are in no
//! tree; they have a tree of their own (see `flats`).

use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::fmt;

use lumbre_geometry::{Aabb, NearestPoint, NearestPointError, nearest_on_triangle, similarity_factor};
use lumbre_math::{DVec2, DVec3, Transform};

use super::flats::flats;
use crate::hit::InstancePath;
use crate::trace::Context;
use crate::tree::flats::{Below, FlatItem};
use crate::tree::geometry::TriangleMesh;
use crate::tree::node::{Node, tag};
use crate::tree::packed::Start;
use crate::tree::sphere_block::{ExactSphere, has_radius};
use crate::tree::{GeometryKind, Instance, Tree};

/// The nearest point of all surfaces to a given point.
#[derive(Clone, Debug, PartialEq)]
pub struct ClosestPoint {
    /// Its distance, never negative.
    pub distance: f64,
    /// Its position, in the space of the queried tree.
    pub point: DVec3,
    /// The part of a shape: see [`lumbre_geometry::Root::part`].
    pub part: u32,
    /// The barycentrics (b1, b2) on a triangle, surface parameters on a shape.
    pub uv: DVec2,
    /// The id of the geometry.
    pub id: u32,
    /// The triangle of a mesh, the sphere of a cloud, the primitive of a custom geometry, otherwise 0.
    pub primitive: u32,
    /// The position of the geometry in the list that its tree was built from.
    pub geometry: u32,
    /// The ids of the instances around it.
    pub instances: InstancePath,
    /// The positions of those instances in the lists that their trees were built from.
    pub(crate) route: InstancePath,
}

/// Why there is no answer: geometry without an answer may be nearer than all other geometry.
#[derive(Clone, Debug, PartialEq)]
pub struct ClosestPointError {
    /// The reason that the geometry gives.
    pub why: NearestPointError,
    /// The id of the geometry.
    pub id: u32,
    /// The position of the geometry in the list that its tree was built from.
    pub geometry: u32,
    /// The ids of the instances around it.
    pub instances: InstancePath,
}

impl fmt::Display for ClosestPointError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "no nearest point: geometry {} (id {})", self.geometry, self.id)?;
        if !self.instances.is_empty() {
            write!(f, " in the instances {:?}", self.instances.as_slice())?;
        }
        write!(f, " may be the nearest, and {}", self.why)
    }
}

impl std::error::Error for ClosestPointError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        Some(&self.why)
    }
}

/// See [`Accel::closest_point`].
pub(crate) fn closest_point(
    tree: &Tree,
    point: DVec3,
    max_distance: f64,
    time: f64,
) -> Result<Option<ClosestPoint>, ClosestPointError> {
    let mut search = Search::new(point, max_distance);
    if !point.is_finite() || max_distance.is_nan() || max_distance < 0.0 {
        return Ok(None);
    }
    let mut frames = vec![Frame::outermost(tree, point, time)];
    let mut pending = BinaryHeap::new();
    enter(&frames, Start::WHOLE, 0.0, &mut pending);
    enter_flats(&frames, 0.0, &mut pending);
    while let Some(next) = pending.pop() {
        if next.distance > search.limit {
            break;
        }
        let frame = &frames[next.frame as usize];
        match next.what {
            Waiting::Reference(reference) if tag::is_inner(reference) => {
                let node = &frame.tree.packed.nodes[reference as usize];
                for lane in 0..node.len() {
                    let distance = frame.distance_to_box(node, lane).max(next.distance);
                    if distance <= search.limit {
                        let what = Waiting::Reference(node.children[lane]);
                        pending.push(Pending { distance, frame: next.frame, what });
                    }
                }
            }
            Waiting::Reference(reference) if tag::of(reference) == tag::TRIANGLES => {
                for ids in &frame.tree.packed.ids[frame.tree.packed.numbers(reference)] {
                    if let GeometryKind::Mesh(mesh) = &frame.tree.geometries[ids.geometry as usize].kind {
                        for &primitive in ids.primitives.iter().filter(|&&primitive| primitive != u32::MAX) {
                            search.intersect_triangle(frame, mesh, ids.geometry, primitive);
                        }
                    }
                }
            }
            Waiting::Reference(reference) if tag::of(reference) == tag::SPHERES => {
                for ids in &frame.tree.packed.sphere_ids[tag::blocks(reference)] {
                    for &primitive in ids.primitives.iter().filter(|&&primitive| primitive != u32::MAX) {
                        search.meet(frame, ids.geometry, primitive, next.distance);
                    }
                }
            }
            Waiting::Reference(reference) => {
                let first = tag::place(reference);
                for entry in &frame.tree.packed.entries[first..] {
                    let what = Waiting::Primitive(entry.geometry, entry.primitive());
                    pending.push(Pending { distance: next.distance, frame: next.frame, what });
                    if entry.is_last() {
                        break;
                    }
                }
            }
            Waiting::Flat(node) => {
                let flats = flats(frame.tree);
                match flats.node(node).below {
                    Below::Nodes(second) => {
                        for child in [node + 1, second] {
                            let distance =
                                frame.distance_to_flats(&flats.node(child).bounds).max(next.distance);
                            if distance <= search.limit {
                                let what = Waiting::Flat(child);
                                pending.push(Pending { distance, frame: next.frame, what });
                            }
                        }
                    }
                    Below::Items(first, end) => {
                        let mut inner = Vec::new();
                        for &FlatItem { geometry, primitive } in flats.items(first, end) {
                            match &frame.tree.geometries[geometry as usize].kind {
                                GeometryKind::Mesh(mesh) => {
                                    search.intersect_triangle(frame, mesh, geometry, primitive);
                                }
                                GeometryKind::Instance(instance) => {
                                    inner.push(frame.within(geometry, instance));
                                }
                                _ => search.meet(frame, geometry, primitive, next.distance),
                            }
                        }
                        for frame in inner {
                            frames.push(frame);
                            enter_flats(&frames, next.distance, &mut pending);
                        }
                    }
                }
            }
            Waiting::Primitive(geometry, primitive) => {
                if let GeometryKind::Instance(instance) = &frame.tree.geometries[geometry as usize].kind {
                    let start = Start::of(primitive);
                    if start.is_nothing() {
                        continue;
                    }
                    let inner = frame.within(geometry, instance);
                    frames.push(inner);
                    enter(&frames, start, next.distance, &mut pending);
                } else {
                    search.meet(frame, geometry, primitive, next.distance);
                }
            }
        }
    }
    search.into_answer()
}

/// Adds the tree of the last frame, or a part of it, to the list.
fn enter(frames: &[Frame], start: Start, distance: f64, pending: &mut BinaryHeap<Pending>) {
    let position = frames.len() - 1;
    let frame = position as u32;
    let tree = frames[position].tree;
    let root = tree.packed.root.map(|root| Waiting::Reference(start.below(root)));
    let infinite = tree.infinite.iter().map(|entry| Waiting::Primitive(entry.geometry, entry.primitive()));
    pending.extend(root.into_iter().chain(infinite).map(|what| Pending { distance, frame, what }));
}

/// Adds the primitives without area below the last frame.
fn enter_flats(frames: &[Frame], distance: f64, pending: &mut BinaryHeap<Pending>) {
    let position = frames.len() - 1;
    if let Some(root) = flats(frames[position].tree).root() {
        let distance = frames[position].distance_to_flats(&root.bounds).max(distance);
        pending.push(Pending { distance, frame: position as u32, what: Waiting::Flat(0) });
    }
}

/// An item to visit, and a lower bound on its distance.
struct Pending {
    distance: f64,
    frame: u32,
    what: Waiting,
}

#[derive(Clone, Copy)]
enum Waiting {
    /// A node or a leaf.
    Reference(u32),
    /// Geometry and primitive, other than a triangle of a mesh; for an instance, where it is entered.
    Primitive(u32, u32),
    /// A node of primitives without area.
    Flat(u32),
}

// The nearest is the greatest.
impl Ord for Pending {
    fn cmp(&self, other: &Self) -> Ordering {
        other.distance.total_cmp(&self.distance)
    }
}

impl PartialOrd for Pending {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Pending {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Pending {}

/// A tree in its frame.
pub(crate) struct Frame<'a> {
    pub(crate) tree: &'a Tree,
    /// From the tree's space to the outermost.
    pub(crate) map: Transform,
    is_identity: bool,
    /// Bound on the factor by which the map may shrink distances.
    shrink: f64,
    /// The query point, in the tree's space.
    pub(crate) local: DVec3,
    /// The time of the query.
    time: f64,
    pub(crate) context: Context,
    /// The query point in tree units, and the error bound of distances to boxes there.
    in_units: DVec3,
    slop: f64,
}

impl<'a> Frame<'a> {
    pub(crate) fn outermost(tree: &'a Tree, point: DVec3, time: f64) -> Self {
        Self::new(tree, Transform::IDENTITY, point, time, Context::default())
    }

    /// The frame of an instance in this tree.
    pub(crate) fn within(&self, geometry: u32, instance: &'a Instance) -> Self {
        let mut context = self.context.clone();
        context.route.push(geometry);
        context.ids.push(self.tree.geometries[geometry as usize].id);
        let world_from_object = instance.world_from_object.at(self.time);
        let local = world_from_object.inverse_point(self.local);
        Self::new(&instance.tree, self.map * world_from_object, local, self.time, context)
    }

    fn new(tree: &'a Tree, map: Transform, local: DVec3, time: f64, context: Context) -> Self {
        let tree_space = &tree.tree_space;
        let in_units = (local - tree_space.origin) * tree_space.scale;
        // The largest singular value of the inverse is at most the root of the sum of squares.
        let stretch = similarity_factor(&map).map_or_else(
            || map.inverse_affine().matrix3.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt(),
            |factor| 1.0 / factor,
        );
        let shrink = (1.0 - 1e-9) / stretch;
        let slop = 4.0 * tree_space.slop_of(local);
        Self { tree, map, is_identity: map.is_identity(), shrink, local, time, context, in_units, slop }
    }

    /// A lower bound on the distance of a node's child, in the outermost space.
    fn distance_to_box(&self, node: &Node, lane: usize) -> f64 {
        let gap = |axis: usize| {
            let low = f64::from(node.planes[2 * axis][lane]) - self.in_units[axis];
            let high = self.in_units[axis] - f64::from(node.planes[2 * axis + 1][lane]);
            low.max(high).max(0.0)
        };
        let distance = DVec3::new(gap(0), gap(1), gap(2)).length() * (1.0 - 1e-12) - self.slop;
        let distance = distance / self.tree.tree_space.scale * self.shrink;
        // Also 0 for NaN.
        if distance > 0.0 { distance } else { 0.0 }
    }

    /// A lower bound on the distance of a box of primitives without area, in the outermost space.
    fn distance_to_flats(&self, bounds: &Aabb) -> f64 {
        let tree_space = &self.tree.tree_space;
        let reach = self.local.abs() + flats(self.tree).reach;
        let slop = 4.0 * tree_space.slop_of(reach) / tree_space.scale;
        let gap = (bounds.min - self.local).max(self.local - bounds.max).max(DVec3::ZERO);
        let distance = (gap.length() * (1.0 - 1e-12) - slop) * self.shrink;
        // Also 0 for NaN.
        if distance > 0.0 { distance } else { 0.0 }
    }
}

/// The result so far.
pub(crate) struct Search {
    point: DVec3,
    /// Nothing farther away counts.
    limit: f64,
    best: Option<ClosestPoint>,
    /// Geometry without an answer, and lower bounds on its distance.
    refused: Vec<(f64, ClosestPointError)>,
}

impl Search {
    pub(crate) fn new(point: DVec3, max_distance: f64) -> Self {
        Self { point, limit: max_distance, best: None, refused: Vec::new() }
    }

    /// The nearest point, unless geometry without an answer may be nearer.
    pub(crate) fn into_answer(self) -> Result<Option<ClosestPoint>, ClosestPointError> {
        let limit = self.limit;
        let nearest = self.refused.into_iter().filter(|(distance, _)| *distance <= limit);
        let rank = |(distance, no): &(f64, ClosestPointError)| (*distance, no.instances.clone(), no.geometry);
        let compare = |a: &(f64, ClosestPointError), b: &(f64, ClosestPointError)| {
            rank(a).partial_cmp(&rank(b)).unwrap_or(Ordering::Equal)
        };
        match nearest.min_by(compare) {
            Some((_, no)) => Err(no),
            None => Ok(self.best),
        }
    }

    /// The nearest point of geometry with an answer, and whether no other geometry may be nearer.
    #[cfg(test)]
    pub(crate) fn into_parts(self) -> (Option<ClosestPoint>, bool) {
        let is_sure = self.refused.iter().all(|(distance, _)| *distance > self.limit);
        (self.best, is_sure)
    }

    /// Takes a point that is nearer than the best, or equally near and before it in the lists.
    fn offer(&mut self, frame: &Frame, geometry: u32, primitive: u32, found: &NearestPoint) {
        let is_within = found.distance <= self.limit;
        let comes_first = self.best.as_ref().is_none_or(|best| {
            let order = frame.context.route.as_slice().cmp(best.route.as_slice());
            found.distance < best.distance
                || order.then((geometry, primitive).cmp(&(best.geometry, best.primitive))) == Ordering::Less
        });
        if !is_within || !comes_first {
            return;
        }
        self.limit = found.distance;
        self.best = Some(ClosestPoint {
            distance: found.distance,
            point: found.point,
            part: found.part,
            uv: found.uv,
            id: frame.tree.geometries[geometry as usize].id,
            primitive,
            geometry,
            instances: frame.context.ids.clone(),
            route: frame.context.route.clone(),
        });
    }

    /// A triangle of a mesh, moved to the outermost space; one without area is a line or a point.
    pub(crate) fn intersect_triangle(
        &mut self,
        frame: &Frame,
        mesh: &TriangleMesh,
        geometry: u32,
        primitive: u32,
    ) {
        let corners = mesh.indices[primitive as usize].map(|vertex| mesh.positions[vertex as usize]);
        let from_point = mesh.origin - frame.local;
        self.intersect_corners(frame, corners.map(|p| from_point + p.as_dvec3()), geometry, primitive);
    }

    /// A triangle whose corners are relative to the point, in the tree's space.
    fn intersect_corners(&mut self, frame: &Frame, corners: [DVec3; 3], geometry: u32, primitive: u32) {
        let [a, b, c] =
            if frame.is_identity { corners } else { corners.map(|corner| frame.map.vector(corner)) };
        let (uv, offset) = nearest_on_triangle(a, b, c);
        let distance = offset.length();
        if distance <= self.limit {
            let found = NearestPoint { point: self.point + offset, distance, part: 0, uv };
            self.offer(frame, geometry, primitive, &found);
        }
    }

    /// A shape, a sphere of a cloud, or a primitive of custom geometry, at a distance of at least `distance`.
    pub(crate) fn meet(&mut self, frame: &Frame, geometry: u32, primitive: u32, distance: f64) {
        let standing = &frame.tree.geometries[geometry as usize];
        let found = match &standing.kind {
            GeometryKind::Shape(shape) => shape.closest_point_under(&frame.map, self.point),
            GeometryKind::Spheres(cloud) => {
                let sphere = ExactSphere::of(cloud, primitive);
                if !has_radius(&cloud.spheres[primitive as usize]) {
                    let center = frame.map.point(sphere.center);
                    let distance = (center - self.point).length();
                    let found = NearestPoint { point: center, distance, part: 0, uv: DVec2::ZERO };
                    self.offer(frame, geometry, primitive, &found);
                    return;
                }
                sphere.to_shape().closest_point(&frame.map, self.point)
            }
            GeometryKind::Custom(custom) => match similarity_factor(&frame.map) {
                Some(factor) => custom.closest_point(primitive, frame.local).map(|found| NearestPoint {
                    point: frame.map.point(found.point),
                    distance: factor * found.distance,
                    ..found
                }),
                None => Err(NearestPointError::Map),
            },
            GeometryKind::PreciseMesh(mesh) => {
                let corners = mesh.corners(primitive).map(|p| p - frame.local);
                self.intersect_corners(frame, corners, geometry, primitive);
                return;
            }
            GeometryKind::Mesh(_) | GeometryKind::Instance(_) => return,
        };
        match found {
            Ok(found) => self.offer(frame, geometry, primitive, &found),
            Err(why) => {
                let bounds = match &standing.kind {
                    GeometryKind::Shape(shape) => {
                        shape.shape().bounds(&(frame.map * shape.world_from_object()))
                    }
                    _ => None,
                };
                let distance =
                    bounds.map_or(distance, |bounds| distance.max(distance_to(&bounds, self.point)));
                let instances = frame.context.ids.clone();
                let no = ClosestPointError { why, id: standing.id, geometry, instances };
                if distance <= self.limit {
                    self.refused.push((distance, no));
                }
            }
        }
    }
}

/// A lower bound on the distance of a box.
fn distance_to(bounds: &Aabb, p: DVec3) -> f64 {
    (bounds.min - p).max(p - bounds.max).max(DVec3::ZERO).length() * (1.0 - 1e-12)
}
