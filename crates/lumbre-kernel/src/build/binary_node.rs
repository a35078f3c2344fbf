//! Nodes of the binary tree, and the choices that turn them into wide nodes: see [`collapse`](super::collapse).

use std::cmp::Reverse;

use bytemuck::{Pod, Zeroable};

use super::primitive::Bounds;
use crate::tree::node::WIDTH;

/// A node of a subtree: its box and two words.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(transparent)]
pub(crate) struct BinaryNode(pub(super) Bounds);

const LEAF: u32 = 1 << 31;

impl BinaryNode {
    pub(crate) fn leaf(bounds: &Bounds, first: usize, count: usize) -> Self {
        Self(bounds.with_ids(first as u32, LEAF | count as u32))
    }

    /// A leaf that has the box and words of another.
    pub(crate) fn again(leaf: &Bounds) -> Self {
        Self(*leaf)
    }

    /// An inner node whose right child is `right` places behind it.
    pub(crate) fn inner(bounds: &Bounds, right: usize) -> Self {
        Self(bounds.with_ids(right as u32, 0))
    }

    pub(crate) fn bounds(&self) -> &Bounds {
        &self.0
    }

    /// The ids in a leaf; `None` for an inner node.
    #[inline(always)]
    pub(crate) fn ids(&self) -> Option<std::ops::Range<usize>> {
        let first = self.0.first() as usize;
        let count = (self.0.second() & !LEAF) as usize;
        (self.0.second() & LEAF != 0).then(|| first..first + count)
    }

    /// Distance from an inner node to its right child.
    #[inline(always)]
    pub(crate) fn right(&self) -> usize {
        self.0.first() as usize
    }

    #[inline(always)]
    pub(crate) fn choices(&self) -> Choices {
        Choices(self.0.second())
    }

    #[inline(always)]
    pub(crate) fn choose(&mut self, choices: Choices) {
        self.0 = self.0.with_ids(self.0.first(), choices.0);
    }
}

/// The least costs of putting a subtree into 1 to 15 children of a node. Entry 0 is unused.
pub(crate) type Costs = [f32; WIDTH];

pub(super) const LEAF_COSTS: Costs = [0.0; WIDTH];

/// How a node of the binary tree divides its 2 to 16 slots for wide children between its two children, and up to how
/// many slots it is better to be one child itself. The left share is free for up to eight slots and for sixteen; from
/// nine to fifteen, each further slot goes to the side that gains more. So all choices fit in 29 bits, and trees are
/// hardly worse.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Choices(pub(crate) u32);

/// Up to this many slots, the left share is chosen freely.
const FREELY: usize = WIDTH / 2;
/// Bit offsets of the left share minus one, for up to [`FREELY`] slots.
const LEFT_AT: [u32; FREELY + 2] = [0, 0, 0, 0, 1, 3, 5, 8, 11, 14];
/// From this bit on, one bit per slot says whether it goes to the left.
const NEXT_AT: u32 = LEFT_AT[FREELY + 1];
const LEFT_OF_ALL_AT: u32 = NEXT_AT + (WIDTH - FREELY - 1) as u32;
const MAX_AS_ONE_AT: u32 = LEFT_OF_ALL_AT + 4;

// The top bit of the word marks a leaf. Four bits hold a number below sixteen.
const _: () = assert!(MAX_AS_ONE_AT + 4 < u32::BITS && WIDTH == 16);

/// The choices of a node whose left or right child is a leaf.
const ALL_BUT_ONE_RIGHT: u32 = 0;
const ALL_BUT_ONE_LEFT: u32 = {
    let next = (1 << (LEFT_OF_ALL_AT - NEXT_AT)) - 1;
    let mut choices = next << NEXT_AT | (WIDTH as u32 - 2) << LEFT_OF_ALL_AT;
    let mut children = 2;
    while children <= FREELY {
        choices |= (children as u32 - 2) << LEFT_AT[children];
        children += 1;
    }
    choices
};

impl Choices {
    /// Slots for the left child; 0 if the node is better as one child.
    #[inline(always)]
    pub(super) fn left(self, children: usize) -> usize {
        let bits = |from: u32, to: u32| (self.0 >> from & ((1 << (to - from)) - 1)) as usize;
        if children <= bits(MAX_AS_ONE_AT, MAX_AS_ONE_AT + 4) {
            0
        } else if children <= FREELY {
            1 + bits(LEFT_AT[children], LEFT_AT[children + 1])
        } else if children < WIDTH {
            let next = bits(NEXT_AT, NEXT_AT + (children - FREELY) as u32).count_ones() as usize;
            1 + bits(LEFT_AT[FREELY], LEFT_AT[FREELY + 1]) + next
        } else {
            1 + bits(LEFT_OF_ALL_AT, MAX_AS_ONE_AT)
        }
    }
}

/// The least cost of sharing `children` slots, and the left child's share.
#[inline(always)]
fn share_freely(children: usize, left: &Costs, right: &Costs) -> (f32, usize) {
    let mut best = (f32::INFINITY, 1);
    for first in 1..children {
        let cost = left[first] + right[children - first];
        if cost < best.0 {
            best = (cost, first);
        }
    }
    best
}

/// Makes the choices of a node over two children.
#[inline(always)]
pub(super) fn share(area: f32, left: &Costs, right: &Costs) -> (Costs, Choices) {
    let mut costs = LEAF_COSTS;
    let beside_leaf = if left[1] == 0.0 {
        Some((right, ALL_BUT_ONE_RIGHT))
    } else if right[1] == 0.0 {
        Some((left, ALL_BUT_ONE_LEFT))
    } else {
        None
    };
    if let Some((other, choices)) = beside_leaf {
        // A leaf uses one slot; the other child gets the rest.
        costs[2..].copy_from_slice(&other[1..WIDTH - 1]);
        return one_if_no_worse(costs, area + other[WIDTH - 1], choices);
    }
    let (mut choices, mut first) = (0, 1);
    for children in 2..=FREELY {
        (costs[children], first) = share_freely(children, left, right);
        choices |= (first as u32 - 1) << LEFT_AT[children];
    }
    for children in FREELY + 1..WIDTH {
        let cost = left[first] + right[children - first];
        let next = left[first + 1] + right[children - first - 1];
        let is_left = next < cost;
        costs[children] = if is_left { next } else { cost };
        first += usize::from(is_left);
        choices |= u32::from(is_left) << (NEXT_AT as usize + children - FREELY - 1);
    }
    let (cost, first) = share_freely(WIDTH, left, right);
    choices |= (first as u32 - 1) << LEFT_OF_ALL_AT;
    one_if_no_worse(costs, area + cost, choices)
}

/// Adds the alternative of one wide child to the costs of sharing two slots or more.
#[inline(always)]
fn one_if_no_worse(mut costs: Costs, as_one: f32, choices: u32) -> (Costs, Choices) {
    costs[1] = as_one;
    // Costs never increase with more slots, so the useless ones are consecutive.
    let mut most_as_one = 1;
    for (children, cost) in costs.iter_mut().enumerate().skip(2) {
        if *cost >= as_one {
            *cost = as_one;
            most_as_one = children as u32;
        }
    }
    (costs, Choices(choices | most_as_one << MAX_AS_ONE_AT))
}

/// The costs of instances: one slot each if all fit, otherwise one wide node for them.
pub(super) fn costs_of_instances(count: usize, area: f32) -> Costs {
    std::array::from_fn(|children| if children < count { area } else { 0.0 })
}

/// The costs of the larger subtrees, so that moving them needs no new choices.
#[derive(Default)]
pub(crate) struct Known {
    /// With the indices of their roots, in descending order.
    costs: Vec<(u32, Costs)>,
}

impl Known {
    /// Minimum nodes of a subtree that is kept.
    const LEAST: usize = 32;

    /// Makes the choices of all nodes, and returns the root's costs too.
    pub(crate) fn choose(nodes: &mut [BinaryNode]) -> (Costs, Self) {
        let mut known = Self { costs: Vec::with_capacity(nodes.len() / 16) };
        let costs = choose_and(
            nodes,
            false,
            #[inline(always)]
            |place, count, costs| {
                if count >= Self::LEAST {
                    known.costs.push((place as u32, *costs));
                }
            },
        );
        (costs, known)
    }

    /// The costs of the subtree of these nodes, whose root has index `place`.
    pub(crate) fn costs(&self, place: usize, nodes: &[BinaryNode]) -> Costs {
        let found = self.costs.binary_search_by_key(&Reverse(place as u32), |&(place, _)| Reverse(place));
        found.map_or_else(|_| choose(&mut nodes.to_vec(), false), |found| self.costs[found].1)
    }
}

/// Makes the choices of all nodes, and returns the root's costs.
pub(crate) fn choose(nodes: &mut [BinaryNode], are_instances: bool) -> Costs {
    choose_and(
        nodes,
        are_instances,
        #[inline(always)]
        |_, _, _| {},
    )
}

/// As [`choose`]; calls `tell` with each inner node's index, subtree size and costs.
#[inline(always)]
fn choose_and(
    nodes: &mut [BinaryNode],
    are_instances: bool,
    mut tell: impl FnMut(usize, usize, &Costs),
) -> Costs {
    // A stack of the subtrees behind the node that have no parent yet. The top two are the node's children.
    let mut behind = Vec::new();
    let mut ends = Vec::new();
    for (place, node) in nodes.iter_mut().enumerate().rev() {
        let mut costs = LEAF_COSTS;
        let mut end = place + 1;
        if let Some(ids) = node.ids() {
            if are_instances {
                costs = costs_of_instances(ids.len(), node.bounds().half_area());
            }
        } else if let (Some(left), Some(right)) = (behind.pop(), behind.pop()) {
            let choices;
            (costs, choices) = share(node.bounds().half_area(), &left, &right);
            node.choose(choices);
            end = ends.pop().and_then(|_| ends.pop()).unwrap_or(end);
            tell(place, end - place, &costs);
        }
        behind.push(costs);
        ends.push(end);
    }
    behind.pop().unwrap_or(LEAF_COSTS)
}
