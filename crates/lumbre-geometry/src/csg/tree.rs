//! The tree of operations: its construction, numbering and bounds.

use std::sync::Arc;

use lumbre_math::{DVec3, Transform};

use super::{Csg, Leaf, LeafPart, Solid};
use crate::{Aabb, PlacedShape, Root, Shape, ShapeError};

#[derive(Clone, Debug)]
pub(super) struct Node {
    pub(super) kind: NodeKind,
    pub(super) parent: Option<u32>,
    pub(super) end: u32,
    // How many operands must count for the node to contain a point. A subtracted operand counts where it does
    // not contain it.
    pub(super) needed: u32,
    // How many operands count outside of every leaf.
    pub(super) initial: u32,
    pub(super) is_subtracted: bool,
    // `None` when unbounded.
    pub(super) bounds: Option<Aabb>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NodeKind {
    Leaf(u32),
    Union,
    Intersection,
    Difference,
}

/// Operands of a union that are not grouped: a ray looks at the box of each.
const MAX_TOGETHER: usize = 8;

/// An operand on its way into a tree.
struct Operand {
    nodes: Vec<Node>,
    first_leaf: u32,
    is_subtracted: bool,
}

/// Many operands in two halves, by the middles of their boxes along the axis on which these are farthest apart, and a
/// group of those that are unbounded; `None` for few.
fn halves(operands: &mut [Operand]) -> Option<[&mut [Operand]; 3]> {
    if operands.len() <= MAX_TOGETHER {
        return None;
    }
    let bounds = |operand: &Operand| operand.nodes.first().and_then(|node| node.bounds);
    let middle = |operand: &Operand| bounds(operand).map_or(DVec3::ZERO, |bounds| bounds.center());
    operands.sort_by_key(|operand| bounds(operand).is_none());
    let bounded = operands.partition_point(|operand| bounds(operand).is_some());
    let (bounded, unbounded) = operands.split_at_mut(bounded);
    let around = Aabb::around(bounded.iter().map(middle));
    if bounded.len() <= 1 || around.size() == DVec3::ZERO {
        // They cannot be distinguished.
        return None;
    }
    let axis = around.size().max_position();
    bounded.sort_by(|a, b| middle(a)[axis].total_cmp(&middle(b)[axis]));
    let (near, far) = bounded.split_at_mut(bounded.len() / 2);
    Some([near, far, unbounded])
}

/// No exact shape has more parts than this.
const SHAPE_PARTS: u32 = 8;

const MAX_PARTS: u32 = (1 << 31) - 1;
const TOO_MANY_PARTS: ShapeError =
    ShapeError::Degenerate("the operands of csg have more than 2147483647 parts in all");

impl Csg {
    /// The maximal nesting depth: a single solid counts as one. Descriptions of that depth still fit on a thread's
    /// stack.
    pub const MAX_DEPTH: usize = 1024;

    /// A single solid: a shape for which [`Shape::is_solid`] is true, such as a whole sphere, a torus (even-odd
    /// if it is a spindle), a capped cylinder, or one without bounds: the half-space below a plane, an infinite
    /// cylinder or cone, a quadric without a clipping box; or a CSG shape, whose tree is taken over.
    ///
    /// # Errors
    /// [`ShapeError::Degenerate`] for a shape that is not solid.
    pub fn leaf(shape: PlacedShape) -> Result<Self, ShapeError> {
        if let Shape::Csg(inner) = shape.shape() {
            return Ok(Self::clone(inner).placed(&shape.world_from_object()));
        }
        if !shape.shape().is_solid() {
            return Err(ShapeError::Degenerate(
                "an operand of CSG encloses nothing: it must be a closed shape that is whole, such as a sphere or a \
                 capped cylinder, a plane (for the half-space below it), an infinite cylinder, cone or quadric, a closed \
                 mesh or another csg",
            ));
        }
        Ok(Self::single(Leaf::Shape(shape), SHAPE_PARTS))
    }

    /// A user-defined solid.
    ///
    /// # Errors
    /// [`ShapeError::Degenerate`] when it has more than 2^31 - 1 parts.
    pub fn solid(solid: Arc<dyn Solid>) -> Result<Self, ShapeError> {
        let parts = solid.part_count();
        if parts > MAX_PARTS {
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
            initial: 0,
            is_subtracted: false,
            bounds,
        };
        Self {
            nodes: vec![node],
            leaves: vec![leaf],
            first_part: vec![0, parts],
            leaf_nodes: vec![(0, false)],
            depth: 1,
        }
    }

    /// The union: the points in at least one of the operands.
    ///
    /// # Errors
    /// [`ShapeError::Degenerate`] without operands, when the nesting becomes deeper than [`Csg::MAX_DEPTH`], or when
    /// there are more than 2^31 - 1 parts in all.
    pub fn union(operands: Vec<Self>) -> Result<Self, ShapeError> {
        Self::combine(NodeKind::Union, operands)
    }

    /// The intersection: the points in all of the operands.
    ///
    /// # Errors
    /// As for [`Csg::union`].
    pub fn intersection(operands: Vec<Self>) -> Result<Self, ShapeError> {
        Self::combine(NodeKind::Intersection, operands)
    }

    /// The difference: the points in the first operand and in none of the rest.
    ///
    /// # Errors
    /// As for [`Csg::union`].
    pub fn difference(operands: Vec<Self>) -> Result<Self, ShapeError> {
        Self::combine(NodeKind::Difference, operands)
    }

    fn combine(kind: NodeKind, mut operands: Vec<Self>) -> Result<Self, ShapeError> {
        let depth = 1 + operands.iter().map(|operand| operand.depth).max().unwrap_or(0);
        if operands.is_empty() {
            return Err(ShapeError::Degenerate("a csg shape needs at least one operand"));
        }
        if depth > Self::MAX_DEPTH {
            return Err(ShapeError::Degenerate("csg shapes are nested deeper than 1024"));
        }
        if kind == NodeKind::Difference && operands.len() > MAX_TOGETHER {
            // What is taken away together is grouped as a union is.
            let taken = Self::combine(NodeKind::Union, operands.split_off(1))?;
            operands.push(taken);
        }
        let mut csg = Self { nodes: vec![], leaves: vec![], first_part: vec![0], leaf_nodes: vec![], depth };
        let mut parts = Vec::with_capacity(operands.len());
        for (i, operand) in operands.into_iter().enumerate() {
            let (first_leaf, parts_so_far) = (csg.leaves.len() as u32, csg.part_count());
            if u64::from(parts_so_far) + u64::from(operand.part_count()) > u64::from(MAX_PARTS) {
                return Err(TOO_MANY_PARTS);
            }
            let is_subtracted = kind == NodeKind::Difference && i > 0;
            csg.leaf_nodes.extend(operand.leaf_nodes.iter().map(|&(node, odd)| (node, odd != is_subtracted)));
            csg.first_part.extend(operand.first_part[1..].iter().map(|part| parts_so_far + part));
            csg.leaves.extend(operand.leaves);
            parts.push(Operand { nodes: operand.nodes, first_leaf, is_subtracted });
        }
        csg.push_group(kind, None, &mut parts);
        csg.update_bounds();
        Ok(csg)
    }

    /// Appends a node over some operands. The operands of a large union are grouped by their places, again and again,
    /// so that a ray comes to few of them; leaves keep their order.
    fn push_group(&mut self, kind: NodeKind, parent: Option<u32>, operands: &mut [Operand]) {
        let count = operands.len() as u32;
        let (needed, initial) = match kind {
            NodeKind::Union | NodeKind::Leaf(_) => (1, 0),
            NodeKind::Intersection => (count, 0),
            NodeKind::Difference => (count, count - 1),
        };
        let place = self.nodes.len();
        let node = Node { kind, parent, end: 0, needed, initial, is_subtracted: false, bounds: None };
        self.nodes.push(node);
        let groups = if kind == NodeKind::Union { halves(operands) } else { None };
        match groups {
            Some(groups) => {
                for group in groups.into_iter().filter(|group| !group.is_empty()) {
                    self.push_group(kind, Some(place as u32), group);
                }
            }
            None => {
                operands.iter_mut().for_each(|operand| self.push_operand(place as u32, operand));
            }
        }
        self.nodes[place].end = self.nodes.len() as u32;
    }

    fn push_operand(&mut self, parent: u32, operand: &mut Operand) {
        let (first_node, first_leaf) = (self.nodes.len() as u32, operand.first_leaf);
        for node in std::mem::take(&mut operand.nodes) {
            if let NodeKind::Leaf(leaf) = node.kind {
                self.leaf_nodes[(first_leaf + leaf) as usize].0 += first_node;
            }
            self.nodes.push(Node {
                kind: match node.kind {
                    NodeKind::Leaf(leaf) => NodeKind::Leaf(first_leaf + leaf),
                    other => other,
                },
                parent: Some(node.parent.map_or(parent, |parent| first_node + parent)),
                end: first_node + node.end,
                is_subtracted: if node.parent.is_none() { operand.is_subtracted } else { node.is_subtracted },
                ..node
            });
        }
    }

    /// The same solid with `world_from_self` applied to every leaf.
    #[must_use]
    pub fn placed(mut self, world_from_self: &Transform) -> Self {
        if world_from_self.is_identity() {
            return self;
        }
        for leaf in &mut self.leaves {
            *leaf = leaf.placed(world_from_self);
        }
        self.update_bounds();
        self
    }

    fn update_bounds(&mut self) {
        let all = self.node_bounds(&Transform::IDENTITY);
        for (node, bounds) in self.nodes.iter_mut().zip(all) {
            node.bounds = bounds;
        }
    }

    /// The bounding box of every node; `None` for those that are unbounded.
    pub(super) fn node_bounds(&self, world_from_object: &Transform) -> Vec<Option<Aabb>> {
        // `None` until an operand has been seen, then its box or that it is unbounded.
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
                    if node.is_subtracted {
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

    /// The leaves, in the order of the operands.
    pub fn leaves(&self) -> &[Leaf] {
        &self.leaves
    }

    /// The leaf and part that a root of this shape lies on; `None` for a root that is not of this shape.
    pub fn leaf_of(&self, root: &Root) -> Option<LeafPart> {
        let place = root.part >> 1;
        // A leaf without parts begins where the next does.
        let leaf = self.first_part.partition_point(|&first| first <= place).checked_sub(1)?;
        let part = place - self.first_part[leaf];
        (leaf < self.leaves.len()).then_some(LeafPart { leaf, part, flipped: root.part & 1 == 1 })
    }

    fn part_count(&self) -> u32 {
        self.first_part[self.leaves.len()]
    }

    pub(super) fn is_unbounded(&self, leaf: u32) -> bool {
        self.nodes[self.leaf_nodes[leaf as usize].0 as usize].bounds.is_none()
    }
}
