//! Constructive solid geometry: unions, intersections and differences of solids.

use std::fmt::Debug;
use std::sync::Arc;

use lumbre_math::{DVec2, DVec3, Transform};
use smallvec::{SmallVec, smallvec};

use crate::placed::into_world;
use crate::{
    Aabb, DirectionSample, Hull, NearestPoint, NoNearestPoint, PlacedShape, Ray, Root, Roots, Shape,
    ShapeError, Surface, SurfaceSample,
};

/// A stranger's solid, such as a closed mesh, as an operand of CSG.
pub trait Solid: Debug + Send + Sync {
    /// How many parts its surface has: the parts of its roots are less than this.
    fn part_count(&self) -> u32;

    /// A box around it under `world_from_object`, rounded outward. Only bounded solids are accepted.
    fn bounds(&self, world_from_object: &Transform) -> Aabb;

    /// Every crossing of the **whole** line of `ray`, whatever the ray's range, appended in any order. On every line as
    /// many must enter as leave.
    fn crossings(&self, ray: &Ray, out: &mut Crossings);

    /// The surface at a crossing, with its normal outward.
    fn surface(&self, ray: &Ray, root: &Root) -> Surface;

    /// Whether it holds `p`; unless overridden, by counting the crossings behind it on a line through it.
    fn contains(&self, p: DVec3) -> bool {
        let mut crossings = Crossings::new();
        // No axis of symmetry of anything likely.
        self.crossings(&Ray::new(p, DVec3::new(0.612_372_4, 0.353_553_7, 0.707_106_1)), &mut crossings);
        let behind = crossings.iter().filter(|c| c.root.t <= 0.0);
        behind.map(|c| if c.enters { 1 } else { -1 }).sum::<i32>() > 0
    }
}

/// Where a line enters or leaves a solid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// Where, and on which of the solid's parts.
    pub root: Root,
    /// Whether the solid lies beyond it.
    pub enters: bool,
}

/// Crossings of one line.
pub type Crossings = SmallVec<[Crossing; 8]>;

/// A solid that a CSG shape is made of.
#[derive(Clone, Debug)]
pub enum Leaf {
    /// An exact shape.
    Shape(PlacedShape),
    /// A stranger's solid, placed.
    Solid {
        /// What it is.
        solid: Arc<dyn Solid>,
        /// Where it stands; `None` for where it is.
        world_from_object: Option<Box<Transform>>,
    },
}

/// Whose surface a root of a CSG shape lies on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LeafPart {
    /// The leaf, counted in the order of the operands from left to right.
    pub leaf: usize,
    /// The part, as the leaf numbers its own.
    pub part: u32,
    /// Whether the leaf was taken away, so that its outside is the result's inside and its normal is turned.
    pub flipped: bool,
}

/// A solid composed of others, each surface keeping its own leaf: see [`Csg::leaf_of`].
///
/// All crossings of the whole line with every leaf are merged in order of `t`, counting which leaves the line is inside
/// of, and those remain where the result changes between inside and outside (after S. D. Roth, "Ray casting for modeling
/// solids", Computer Graphics and Image Processing, 1982); the ray's range is applied last, so that it may begin
/// anywhere. The operations are regularised (A. A. G. Requicha, "Representations for rigid solids", ACM Computing
/// Surveys, 1980): nothing is left that has no volume, so that a touch without crossing is no hit.
///
/// Crossings that are closer together than 256 units in the last place of the largest coordinate involved count as one.
/// So surfaces that coincide leave neither a film nor a gap, whichever rounds to the nearer side: two boxes side by side
/// are one, and a hole drilled as deep as the block is open. Where several leaves' surfaces coincide on the result's, the
/// leaf that comes first has it.
///
/// There is no closed form for the area of such a shape: it is given as infinite, nothing is sampled on it, and it cannot
/// be a light.
#[derive(Clone, Debug)]
pub struct Csg {
    // In preorder: the children of a node, and theirs, stand between it and its `end`. Walking them needs no stack.
    nodes: Vec<Node>,
    leaves: Vec<Leaf>,
    // Where the parts of each leaf begin, in the order of `leaves`, and at the end how many there are.
    first_part: Vec<u32>,
    // For each leaf its node, and whether it is taken away an odd number of times.
    places: Vec<(u32, bool)>,
    depth: usize,
}

#[derive(Clone, Debug)]
struct Node {
    kind: NodeKind,
    parent: Option<u32>,
    end: u32,
    // How many of its operands must hold for it to hold, those taken away counting when they do not.
    needed: u32,
    // How many hold while the line is outside of every leaf.
    idle: u32,
    is_taken_away: bool,
    // None for unbounded.
    bounds: Option<Aabb>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum NodeKind {
    Leaf(u32),
    Union,
    Intersection,
    Difference,
}

/// A leaf's crossing while they are merged.
#[derive(Clone, Copy)]
struct Event {
    root: Root,
    leaf: u32,
    enters: bool,
}

type Events = SmallVec<[Event; 16]>;

/// How deep CSG shapes nest.
const MAX_DEPTH: usize = 64;

/// Exact shapes have no more parts than this.
const SHAPE_PARTS: u32 = 8;

/// Crossings as close as this, in terms of the coordinates involved, are one.
const COINCIDENT: f64 = 256.0 * f64::EPSILON;

/// The least distance from other leaves' surfaces, in terms of the coordinates involved, at which it is clear which side of
/// them a point is on.
const CLEAR: f64 = 1e-11;

impl Csg {
    /// A single solid: a shape of which [`Shape::is_solid`] says so, such as a whole sphere, a torus (even-odd if it is a
    /// spindle), a capped cylinder, or the half-space below a plane; or a CSG shape, which is taken apart.
    ///
    /// # Errors
    /// [`ShapeError::Degenerate`] for a shape that encloses nothing.
    pub fn leaf(shape: PlacedShape) -> Result<Self, ShapeError> {
        if let Shape::Csg(inner) = shape.shape() {
            return Ok(Self::clone(inner).placed(&shape.world_from_object()));
        }
        if !shape.shape().is_solid() {
            return Err(ShapeError::Degenerate(
                "an operand of CSG encloses nothing: it must be a closed shape that is whole, such as a sphere or a \
                 capped cylinder, a plane (for the half-space below it), a closed mesh or another csg",
            ));
        }
        Ok(Self::single(Leaf::Shape(shape), SHAPE_PARTS))
    }

    /// A stranger's solid.
    ///
    /// # Errors
    /// [`ShapeError::Degenerate`] when it has more than 2^31 - 1 parts.
    pub fn solid(solid: Arc<dyn Solid>) -> Result<Self, ShapeError> {
        let parts = solid.part_count();
        if parts > MOST_PARTS {
            return Err(TOO_MANY_PARTS);
        }
        Ok(Self::single(Leaf::Solid { solid, world_from_object: None }, parts))
    }

    fn single(leaf: Leaf, parts: u32) -> Self {
        let bounds = leaf.bounds(&Transform::IDENTITY);
        let node = Node {
            kind: NodeKind::Leaf(0),
            parent: None,
            end: 1,
            needed: 1,
            idle: 0,
            is_taken_away: false,
            bounds,
        };
        Self {
            nodes: vec![node],
            leaves: vec![leaf],
            first_part: vec![0, parts],
            places: vec![(0, false)],
            depth: 1,
        }
    }

    /// What is in at least one of the operands.
    ///
    /// # Errors
    /// [`ShapeError::Degenerate`] without operands, when the nesting becomes deeper than 64, or when there are more than
    /// 2^31 - 1 parts of surfaces.
    pub fn union(operands: Vec<Self>) -> Result<Self, ShapeError> {
        Self::combine(NodeKind::Union, operands)
    }

    /// What is in all of the operands.
    ///
    /// # Errors
    /// As [`Csg::union`].
    pub fn intersection(operands: Vec<Self>) -> Result<Self, ShapeError> {
        Self::combine(NodeKind::Intersection, operands)
    }

    /// What is in the first operand and in none of the rest.
    ///
    /// # Errors
    /// As [`Csg::union`].
    pub fn difference(operands: Vec<Self>) -> Result<Self, ShapeError> {
        Self::combine(NodeKind::Difference, operands)
    }

    fn combine(kind: NodeKind, operands: Vec<Self>) -> Result<Self, ShapeError> {
        let depth = 1 + operands.iter().map(|operand| operand.depth).max().unwrap_or(0);
        if operands.is_empty() {
            return Err(ShapeError::Degenerate("a csg shape needs at least one operand"));
        }
        if depth > MAX_DEPTH {
            return Err(ShapeError::Degenerate("csg shapes are nested deeper than 64"));
        }
        let count = operands.len() as u32;
        let (needed, idle) = match kind {
            NodeKind::Union | NodeKind::Leaf(_) => (1, 0),
            NodeKind::Intersection => (count, 0),
            NodeKind::Difference => (count, count - 1),
        };
        let root = Node { kind, parent: None, end: 0, needed, idle, is_taken_away: false, bounds: None };
        let mut csg = Self { nodes: vec![root], leaves: vec![], first_part: vec![0], places: vec![], depth };
        for (i, operand) in operands.into_iter().enumerate() {
            let (first_node, first_leaf) = (csg.nodes.len() as u32, csg.leaves.len() as u32);
            let parts_so_far = csg.part_count();
            let too_many = u64::from(parts_so_far) + u64::from(operand.part_count()) > u64::from(MOST_PARTS);
            if too_many {
                return Err(TOO_MANY_PARTS);
            }
            let is_taken_away = kind == NodeKind::Difference && i > 0;
            csg.nodes.extend(operand.nodes.into_iter().map(|node| Node {
                kind: match node.kind {
                    NodeKind::Leaf(leaf) => NodeKind::Leaf(first_leaf + leaf),
                    other => other,
                },
                parent: Some(node.parent.map_or(0, |parent| first_node + parent)),
                end: first_node + node.end,
                is_taken_away: if node.parent.is_none() { is_taken_away } else { node.is_taken_away },
                ..node
            }));
            csg.places.extend(
                operand.places.into_iter().map(|(node, away)| (first_node + node, away != is_taken_away)),
            );
            csg.first_part.extend(operand.first_part[1..].iter().map(|part| parts_so_far + part));
            csg.leaves.extend(operand.leaves);
        }
        csg.nodes[0].end = csg.nodes.len() as u32;
        csg.find_bounds();
        Ok(csg)
    }

    /// The same, moved: every leaf under `world_from_self` as well.
    #[must_use]
    pub fn placed(mut self, world_from_self: &Transform) -> Self {
        if world_from_self.is_identity() {
            return self;
        }
        for leaf in &mut self.leaves {
            *leaf = leaf.placed(world_from_self);
        }
        self.find_bounds();
        self
    }

    fn find_bounds(&mut self) {
        let all = self.node_bounds(&Transform::IDENTITY);
        for (node, bounds) in self.nodes.iter_mut().zip(all) {
            node.bounds = bounds;
        }
    }

    /// The box of every node; `None` for those that are unbounded.
    fn node_bounds(&self, world_from_object: &Transform) -> Vec<Option<Aabb>> {
        // Unset until an operand says something: nothing, or a box, or that it is unbounded.
        let mut all: Vec<Option<Option<Aabb>>> = vec![None; self.nodes.len()];
        for i in (0..self.nodes.len()).rev() {
            let node = &self.nodes[i];
            let bounds = match node.kind {
                NodeKind::Leaf(leaf) => self.leaves[leaf as usize].bounds(world_from_object),
                _ => all[i].flatten(),
            };
            all[i] = Some(bounds);
            let Some(parent) = node.parent.map(|parent| parent as usize) else {
                continue;
            };
            all[parent] = match (self.nodes[parent].kind, all[parent]) {
                (NodeKind::Difference, so_far) => {
                    if node.is_taken_away {
                        so_far
                    } else {
                        Some(bounds)
                    }
                }
                (_, None) => Some(bounds),
                (NodeKind::Intersection, Some(so_far)) => Some(match (so_far, bounds) {
                    (Some(a), Some(b)) => Some(Aabb { min: a.min.max(b.min), max: a.max.min(b.max) }),
                    (a, b) => a.or(b),
                }),
                (_, Some(so_far)) => Some(so_far.zip(bounds).map(|(a, b)| a.union(b))),
            };
        }
        all.into_iter().map(Option::flatten).collect()
    }

    /// The solids that it is made of, in the order of the operands.
    pub fn leaves(&self) -> &[Leaf] {
        &self.leaves
    }

    /// Whose surface a root of this shape lies on; `None` for a root that is not of this shape.
    pub fn leaf_of(&self, root: &Root) -> Option<LeafPart> {
        let place = root.part >> 1;
        // Leaves without parts share their beginning with the next.
        let leaf = self.first_part.partition_point(|&first| first <= place).checked_sub(1)?;
        let part = place - self.first_part[leaf];
        (leaf < self.leaves.len()).then_some(LeafPart { leaf, part, flipped: root.part & 1 == 1 })
    }

    fn part_count(&self) -> u32 {
        self.first_part[self.leaves.len()]
    }

    /// The first crossing in the ray's range.
    pub fn closest(&self, ray: &Ray) -> Option<Root> {
        let mut found = None;
        self.sweep(ray, |root| {
            found = Some(root);
            false
        });
        found
    }

    /// Every crossing in the ray's range, appended in ascending order.
    pub fn roots(&self, ray: &Ray, out: &mut Roots) {
        self.sweep(ray, |root| {
            out.push(root);
            true
        });
    }

    /// Every crossing of the result in the ray's range in order, until `emit` returns false.
    fn sweep(&self, ray: &Ray, mut emit: impl FnMut(Root) -> bool) {
        let mut state = State::new(self);
        let mut events = Events::new();
        if self.gather(ray, &mut state, &mut events).is_none() {
            return;
        }
        let (origin, direction) = (ray.origin.abs().max_element(), ray.direction.abs().max_element());
        let mut rest = &events[..];
        while let Some(first) = rest.first() {
            let t = first.root.t;
            if t > ray.t_max {
                return;
            }
            let reach = t + COINCIDENT * (origin / direction + t.abs());
            let together = 1 + rest[1..].iter().take_while(|event| event.root.t <= reach).count();
            let (group, later) = rest.split_at(together);
            rest = later;
            if let Some(root) = state.pass(group)
                && ray.contains(root.t)
                && !emit(root)
            {
                return;
            }
        }
    }

    /// Collects all crossings of all leaves that matter, in order; `None` when the result is nowhere in the ray's range.
    ///
    /// A leaf whose box the ray's range misses is outside throughout it, and takes every intersection with it.
    fn gather(&self, ray: &Ray, state: &mut State, events: &mut Events) -> Option<()> {
        let inverse = ray.direction.recip();
        let mut i = 0;
        while let Some(node) = self.nodes.get(i) {
            let is_absent = match (node.bounds, node.kind) {
                (Some(bounds), _) if !overlaps(&bounds, ray, inverse) => true,
                (_, NodeKind::Leaf(leaf)) => !self.cross(leaf, ray, state, events),
                _ => false,
            };
            i = if is_absent {
                self.after_absence(i)?
            } else if matches!(node.kind, NodeKind::Leaf(_)) {
                node.end as usize
            } else {
                i + 1
            };
        }
        events.sort_by(|a: &Event, b: &Event| a.root.t.total_cmp(&b.root.t).then(a.leaf.cmp(&b.leaf)));
        Some(())
    }

    /// Where to go on when node `i` holds nowhere; `None` when then nothing does.
    fn after_absence(&self, mut i: usize) -> Option<usize> {
        loop {
            let node = &self.nodes[i];
            let parent = node.parent? as usize;
            let decides = match self.nodes[parent].kind {
                NodeKind::Intersection => true,
                NodeKind::Difference => !node.is_taken_away,
                _ => false,
            };
            if !decides {
                return Some(node.end as usize);
            }
            i = parent;
        }
    }

    /// Appends the crossings of a leaf; false when the whole line is outside of it.
    fn cross(&self, leaf: u32, ray: &Ray, state: &mut State, events: &mut Events) -> bool {
        let first_part = self.first_part[leaf as usize];
        let flipped = self.places[leaf as usize].1;
        let encode = |root: &Root| Root {
            part: first_part.saturating_add(root.part) << 1 | u32::from(flipped),
            multiplicity: 1,
            ..*root
        };
        let line = ray.with_range(f64::NEG_INFINITY, f64::INFINITY);
        let before = events.len();
        match &self.leaves[leaf as usize] {
            Leaf::Shape(shape) => {
                let mut roots = Roots::new();
                shape.roots(&line, &mut roots);
                // A touch is no crossing.
                let crosses = |root: &&Root| root.multiplicity % 2 == 1 && root.t.is_finite();
                let mut inside = self.is_unbounded(leaf)
                    && match roots.iter().find(crosses) {
                        Some(first) => shape.surface(&line, first).normal.dot(line.direction) > 0.0,
                        None => leaf_contains(shape, line.origin),
                    };
                if inside {
                    state.turn(leaf, true);
                }
                let started_inside = inside;
                for root in roots.iter().filter(crosses) {
                    inside = !inside;
                    events.push(Event { root: encode(root), leaf, enters: inside });
                }
                let is_odd = inside && !self.is_unbounded(leaf);
                if is_odd {
                    // A touch that rounding made a crossing: it is the last one or the one before, and no matter which.
                    events.pop();
                }
                started_inside || events.len() > before
            }
            Leaf::Solid { solid, world_from_object } => {
                let mut crossings = Crossings::new();
                let line = world_from_object.as_ref().map_or(line, |m| line.into_object(m));
                solid.crossings(&line, &mut crossings);
                let finite = crossings.iter().filter(|c| c.root.t.is_finite());
                events.extend(finite.map(|c| Event { root: encode(&c.root), leaf, enters: c.enters }));
                events.len() > before
            }
        }
    }

    fn is_unbounded(&self, leaf: u32) -> bool {
        self.nodes[self.places[leaf as usize].0 as usize].bounds.is_none()
    }

    /// The surface at a crossing: that of the leaf, turned inside out where the leaf was taken away.
    pub fn surface(&self, ray: &Ray, root: &Root) -> Surface {
        let Some(LeafPart { leaf, part, flipped }) = self.leaf_of(root) else {
            // Not a root of this shape; the first leaf's part 0 is as wrong as any.
            return self.leaves[0].surface(ray, &Root { part: 0, ..*root });
        };
        turned_if(flipped, self.leaves[leaf].surface(ray, &Root { part, ..*root }))
    }

    /// The surface of a leaf's part at `uv`, whether or not the other operands have left it there; `None` for strangers'
    /// solids.
    pub fn surface_at(&self, part: u32, uv: DVec2) -> Option<Surface> {
        let LeafPart { leaf, part, flipped } = self.leaf_of(&Root { part, ..Root::at(0.0) })?;
        match &self.leaves[leaf] {
            Leaf::Shape(shape) => {
                let surface = shape.shape().surface_at(part, uv)?;
                let map = shape.world_from_object();
                let surface = if map.is_identity() { surface } else { into_world(&map, &surface) };
                Some(turned_if(flipped, surface))
            }
            Leaf::Solid { .. } => None,
        }
    }

    /// A box around it under a transform; `None` when it is unbounded. Not always tight: a union has the box around its
    /// operands' boxes, an intersection what their boxes have in common, a difference that of its first operand.
    pub fn bounds(&self, world_from_object: &Transform) -> Option<Aabb> {
        let bounds = (*self.node_bounds(world_from_object).first()?)?;
        if !bounds.is_empty() {
            return Some(bounds);
        }
        // Operands that have nothing in common: a point is box enough for what is never hit.
        let center = bounds.center();
        Some(Aabb { min: center, max: center })
    }

    /// A box around it.
    pub fn hull(&self) -> Option<Hull> {
        Hull::of_box(&self.bounds(&Transform::IDENTITY)?)
    }

    /// Infinite, for want of a closed form: see [`Csg`].
    pub fn area(&self) -> f64 {
        f64::INFINITY
    }

    /// Infinite, for want of a closed form: see [`Csg`].
    pub fn area_under(&self, _world_from_object: &Transform) -> f64 {
        f64::INFINITY
    }

    /// Always.
    pub fn is_solid(&self) -> bool {
        true
    }

    /// Whether it holds `p`, as its leaves say.
    pub fn contains(&self, p: DVec3) -> bool {
        let mut state = State::new(self);
        for (i, leaf) in self.leaves.iter().enumerate() {
            if leaf.contains(p) {
                state.turn(i as u32, true);
            }
        }
        state.holds(0)
    }

    /// The nearest point to `p`, where it is the nearest point of all leaves and lies on the result alone.
    ///
    /// # Errors
    /// [`NoNearestPoint`] where it is not, and where a leaf has no answer.
    pub fn closest_point(
        &self,
        world_from_object: &Transform,
        p: DVec3,
    ) -> Result<NearestPoint, NoNearestPoint> {
        let leaf_point = |leaf: &Leaf, p: DVec3| match leaf {
            Leaf::Shape(shape) => {
                shape.shape().closest_point(&(*world_from_object * shape.world_from_object()), p)
            }
            Leaf::Solid { .. } => Err(NoNearestPoint::Csg),
        };
        let mut best: Option<(usize, NearestPoint)> = None;
        for (i, leaf) in self.leaves.iter().enumerate() {
            let found = leaf_point(leaf, p)?;
            if best.is_none_or(|(_, best)| found.distance < best.distance) {
                best = Some((i, found));
            }
        }
        let (nearest, found) = best.ok_or(NoNearestPoint::Csg)?;
        // No point of the result is nearer, for it lies on some leaf. It remains to be seen whether this one is on the result.
        let mut state = State::new(self);
        let object_point = world_from_object.inverse_point(found.point);
        for (i, leaf) in self.leaves.iter().enumerate().filter(|(i, _)| *i != nearest) {
            let size = found.point.abs().max_element().max(p.abs().max_element());
            let is_clear = leaf_point(leaf, found.point)?.distance > CLEAR * (size + found.distance);
            if !is_clear {
                return Err(NoNearestPoint::Csg);
            }
            if leaf.contains(object_point) {
                state.turn(i as u32, true);
            }
        }
        let holds_outside = state.holds(0);
        state.turn(nearest as u32, true);
        if state.holds(0) == holds_outside {
            return Err(NoNearestPoint::Csg);
        }
        let part = (self.first_part[nearest] + found.part) << 1 | u32::from(self.places[nearest].1);
        Ok(NearestPoint { part, ..found })
    }

    /// "csg".
    pub fn name(&self) -> &'static str {
        "csg"
    }

    /// `None`: see [`Csg`].
    pub fn sample_area(&self, _u: DVec2) -> Option<SurfaceSample> {
        None
    }

    /// `None`: see [`Csg`].
    pub fn sample_direction(&self, _from: DVec3, _u: DVec2) -> Option<DirectionSample> {
        None
    }

    /// 0: see [`Csg`].
    pub fn pdf_direction(&self, _ray: &Ray, _surface: &Surface) -> f64 {
        0.0
    }
}

const MOST_PARTS: u32 = (1 << 31) - 1;
const TOO_MANY_PARTS: ShapeError =
    ShapeError::Degenerate("the operands of csg have more than 2147483647 parts in all");

impl Leaf {
    fn placed(&self, world_from_self: &Transform) -> Self {
        match self {
            Self::Shape(shape) => {
                let map = *world_from_self * shape.world_from_object();
                Self::Shape(PlacedShape::new(shape.shape().clone(), map))
            }
            Self::Solid { solid, world_from_object } => {
                let map = *world_from_self * world_from_object.as_deref().copied().unwrap_or_default();
                Self::Solid { solid: Arc::clone(solid), world_from_object: Some(Box::new(map)) }
            }
        }
    }

    fn bounds(&self, world_from_self: &Transform) -> Option<Aabb> {
        match self {
            Self::Shape(shape) => shape.shape().bounds(&(*world_from_self * shape.world_from_object())),
            Self::Solid { solid, world_from_object: None } => Some(solid.bounds(world_from_self)),
            Self::Solid { solid, world_from_object: Some(map) } => {
                Some(solid.bounds(&(*world_from_self * **map)))
            }
        }
    }

    fn surface(&self, ray: &Ray, root: &Root) -> Surface {
        match self {
            Self::Shape(shape) => shape.surface(ray, root),
            Self::Solid { solid, world_from_object: None } => solid.surface(ray, root),
            Self::Solid { solid, world_from_object: Some(map) } => {
                into_world(map, &solid.surface(&ray.into_object(map), root))
            }
        }
    }

    fn contains(&self, p: DVec3) -> bool {
        match self {
            Self::Shape(shape) => leaf_contains(shape, p),
            Self::Solid { solid, world_from_object: None } => solid.contains(p),
            Self::Solid { solid, world_from_object: Some(map) } => solid.contains(map.inverse_point(p)),
        }
    }
}

fn leaf_contains(shape: &PlacedShape, p: DVec3) -> bool {
    shape.shape().contains(shape.world_from_object().inverse_point(p))
}

fn turned_if(flipped: bool, surface: Surface) -> Surface {
    if !flipped {
        return surface;
    }
    Surface { normal: -surface.normal, dndu: -surface.dndu, dndv: -surface.dndv, ..surface }
}

/// Whether the ray's range meets a box; true when in doubt.
#[inline]
fn overlaps(bounds: &Aabb, ray: &Ray, inverse: DVec3) -> bool {
    let (mut near, mut far) = (ray.t_min, ray.t_max);
    for axis in 0..3 {
        let a = (bounds.min[axis] - ray.origin[axis]) * inverse[axis];
        let b = (bounds.max[axis] - ray.origin[axis]) * inverse[axis];
        if a.is_nan() || b.is_nan() {
            // In the plane of a face, and parallel to it.
            continue;
        }
        // The rounding of the two operations, on either side.
        let slack = 4.0 * f64::EPSILON * a.abs().max(b.abs());
        let slack = if slack.is_finite() { slack } else { 0.0 };
        near = near.max(a.min(b) - slack);
        far = far.min(a.max(b) + slack);
    }
    near <= far
}

/// Which leaves and nodes hold at a place of the line.
struct State<'a> {
    csg: &'a Csg,
    // For each leaf how often it has been entered and not left.
    nesting: SmallVec<[i32; 16]>,
    // For each node how many of its operands count towards it.
    counts: SmallVec<[u32; 32]>,
}

impl<'a> State<'a> {
    fn new(csg: &'a Csg) -> Self {
        Self {
            csg,
            nesting: smallvec![0; csg.leaves.len()],
            counts: csg.nodes.iter().map(|node| node.idle).collect(),
        }
    }

    fn holds(&self, node: usize) -> bool {
        self.counts[node] >= self.csg.nodes[node].needed
    }

    /// Enters or leaves a leaf, and tells the nodes above as far as it matters to them.
    fn turn(&mut self, leaf: u32, enters: bool) {
        let nesting = &mut self.nesting[leaf as usize];
        let was_inside = *nesting > 0;
        *nesting += if enters { 1 } else { -1 };
        let is_inside = *nesting > 0;
        if was_inside == is_inside {
            return;
        }
        let mut i = self.csg.places[leaf as usize].0 as usize;
        self.counts[i] = u32::from(is_inside);
        let mut holds = is_inside;
        while let Some(parent) = self.csg.nodes[i].parent {
            let parent = parent as usize;
            let counts_for = holds != self.csg.nodes[i].is_taken_away;
            let held = self.holds(parent);
            if counts_for {
                self.counts[parent] += 1;
            } else {
                self.counts[parent] -= 1;
            }
            holds = self.holds(parent);
            if holds == held {
                return;
            }
            i = parent;
        }
    }

    /// Passes crossings that happen together; the root, when the result begins or ends there.
    fn pass(&mut self, group: &[Event]) -> Option<Root> {
        let held = self.holds(0);
        // A crossing that would have sufficed by itself has the surface, or one without which nothing would have changed.
        let mut decisive = None;
        if group.len() > 1 {
            decisive = self.decisive(group, held);
        }
        for event in group {
            self.turn(event.leaf, event.enters);
        }
        let holds = self.holds(0);
        if holds == held {
            return None;
        }
        if decisive.is_none() && group.len() > 1 {
            // Undoing one crossing is passing it backwards.
            let backwards: SmallVec<[Event; 8]> =
                group.iter().map(|event| Event { enters: !event.enters, ..*event }).collect();
            decisive = self.decisive(&backwards, holds);
        }
        let agrees = |event: &&Event| (event.enters != self.csg.places[event.leaf as usize].1) == holds;
        let chosen = match decisive {
            Some(i) => group.get(i),
            None => group.iter().filter(agrees).min_by_key(|event| event.leaf),
        };
        chosen.or(group.first()).map(|event| event.root)
    }

    /// Of the crossings that by themselves would change whether the result holds, that of the first leaf.
    fn decisive(&mut self, group: &[Event], held: bool) -> Option<usize> {
        let mut found: Option<usize> = None;
        for (i, event) in group.iter().enumerate() {
            self.turn(event.leaf, event.enters);
            let decides = self.holds(0) != held;
            self.turn(event.leaf, !event.enters);
            if decides && found.is_none_or(|best| event.leaf < group[best].leaf) {
                found = Some(i);
            }
        }
        found
    }
}
