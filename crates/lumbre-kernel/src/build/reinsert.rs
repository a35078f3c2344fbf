//! Improves a binary tree by moving subtrees to where the sum of all areas becomes least.
//!
//! D. Meister, J. Bittner, "Parallel Reinsertion for Bounding Volume Hierarchy Optimization", Computer Graphics Forum
//! 37(2), 2018. Places are searched for many subtrees at once. If several moves would touch the same nodes, the one
//! with the largest gain wins, and the first of equals, so that the result does not depend on threads.

use rayon::prelude::*;

use crate::build::binary_node::BinaryNode;
use crate::build::binary_tree::Binary;
use crate::build::primitive::Bounds;
use crate::intersect::{Dispatch, Isa, Simd};
use crate::simd;

/// Maximum rounds.
const ROUNDS: usize = 8;
/// Stops after a round that gains less than this share of all areas. Upper nodes have been moved before (see
/// `treelet`), so most trees stop after one or two rounds. With a thousandth, whole builds took up to 1.25 times as
/// long, without a measurable gain for rays.
const MIN_GAIN: f64 = 0.015;
/// One node in this many is considered in each round, the largest first. With one in two, whole builds took up to 1.7
/// times as long, without a measurable gain for rays.
const SHARE: usize = 8;
/// Discards a result deeper than this: recursions below rely on the bound.
pub(crate) const DEEPEST: u32 = 200;
/// Maximum places searched for one subtree.
const MAX_PLACES: usize = 4096;

pub(crate) const NONE: u32 = u32::MAX;

/// A node with links to its parent and children.
#[derive(Clone, Copy)]
pub(crate) struct Node {
    bounds: Bounds,
    pub(crate) area: f32,
    parent: u32,
    /// `NONE` for leaves.
    pub(crate) children: [u32; 2],
}

impl Node {
    /// A node without children.
    pub(crate) fn closed(bounds: &Bounds, parent: u32) -> Self {
        Self { bounds: *bounds, area: bounds.half_area(), parent, children: [NONE; 2] }
    }
}

/// The tree as a list; the root comes first.
pub(crate) struct Tree {
    pub(crate) nodes: Vec<Node>,
}

/// A move that would improve the tree.
#[derive(Clone, Copy)]
struct Move {
    from: u32,
    to: u32,
    gain: f32,
}

/// An improved tree over the same leaves, or the same tree.
pub(crate) fn reinsert(tree: Binary<'_>) -> Binary<'_> {
    let mut linked = Tree::of(&tree);
    if linked.nodes.len() < 8 {
        return tree;
    }
    let all = linked.inner_area();
    linked.rounds(ROUNDS, SHARE, MIN_GAIN * all);
    linked.to_binary().unwrap_or(tree)
}

/// Searches the best place for a subtree.
struct Seek<'a> {
    tree: &'a Tree,
    from: u32,
    stack: &'a mut Vec<(f32, u32)>,
}

impl Dispatch for Seek<'_> {
    type Output = Option<Move>;

    #[inline(always)]
    fn run<L: Simd>(self) -> Option<Move> {
        self.tree.best_move(self.from, self.stack)
    }
}

impl Tree {
    fn of(tree: &Binary) -> Self {
        let mut nodes = Vec::new();
        let mut pending = vec![(tree, NONE)];
        while let Some((tree, parent)) = pending.pop() {
            match tree {
                Binary::InnerNode(inner) => {
                    let place = nodes.len() as u32;
                    nodes.push(Node::closed(&inner.bounds, parent));
                    Self::link(&mut nodes, parent, place);
                    pending.extend(inner.children.iter().rev().map(|child| (child, place)));
                }
                Binary::Subtree(subtree) => {
                    let start = nodes.len() as u32;
                    nodes.extend(subtree.nodes.iter().map(|node| Node::closed(node.bounds(), NONE)));
                    nodes[start as usize].parent = parent;
                    Self::link(&mut nodes, parent, start);
                    for (i, node) in subtree.nodes.iter().enumerate() {
                        if node.ids().is_none() {
                            let place = start + i as u32;
                            let children = [place + 1, place + node.right() as u32];
                            nodes[place as usize].children = children;
                            for child in children {
                                nodes[child as usize].parent = place;
                            }
                        }
                    }
                }
            }
        }
        Self { nodes }
    }

    /// The left child comes first: the stack returns it first.
    fn link(nodes: &mut [Node], parent: u32, child: u32) {
        if parent != NONE {
            let children = &mut nodes[parent as usize].children;
            children[usize::from(children[0] != NONE)] = child;
        }
    }

    #[inline(always)]
    fn node(&self, place: u32) -> &Node {
        &self.nodes[place as usize]
    }

    fn is_leaf(&self, place: u32) -> bool {
        self.node(place).children[0] == NONE
    }

    #[inline(always)]
    fn sibling(&self, place: u32) -> u32 {
        let [left, right] = self.node(self.node(place).parent).children;
        if left == place { right } else { left }
    }

    /// The children of an inner node.
    pub(crate) fn children(&self, place: u32) -> Option<[u32; 2]> {
        (!self.is_leaf(place)).then(|| self.node(place).children)
    }

    /// The summed areas of all inner nodes.
    pub(crate) fn inner_area(&self) -> f64 {
        self.nodes.iter().filter(|node| node.children[0] != NONE).map(|node| f64::from(node.area)).sum()
    }

    /// Runs at most `most` rounds; stops after one that gains at most `least`.
    pub(crate) fn rounds(&mut self, most: usize, share: usize, least: f64) {
        for _ in 0..most {
            if self.round(share) <= least {
                break;
            }
        }
    }

    /// Searches a better place for one in `share` nodes and moves them; returns the gained area.
    pub(crate) fn round(&mut self, share: usize) -> f64 {
        self.moves(share).into_iter().map(f64::from).sum()
    }

    /// As [`Self::round`]; returns the gain of each move.
    fn moves(&mut self, share: usize) -> Vec<f32> {
        // The largest nodes that have a grandparent.
        let mut candidates: Vec<u32> =
            (1..self.nodes.len() as u32).filter(|&place| self.node(place).parent != 0).collect();
        let count = (candidates.len() / share).max(candidates.len().min(64));
        let by_area = |a: &u32, b: &u32| self.node(*b).area.total_cmp(&self.node(*a).area).then(a.cmp(b));
        if count < candidates.len() {
            candidates.select_nth_unstable_by(count, by_area);
            candidates.truncate(count);
        }
        let isa = Isa::best();
        let seek = |stack: &mut Vec<(f32, u32)>, &from: &u32| isa.run(Seek { tree: self, from, stack });
        let mut moves: Vec<Move> =
            candidates.par_iter().with_min_len(64).map_init(Vec::new, seek).flatten().collect();
        moves.par_sort_unstable_by(|a, b| b.gain.total_cmp(&a.gain).then(a.from.cmp(&b.from)));

        let mut touched = vec![false; self.nodes.len()];
        let mut gains = Vec::new();
        for Move { from, to, gain } in moves {
            let parent = self.node(from).parent;
            let all = [from, to, parent, self.sibling(from), self.node(parent).parent, self.node(to).parent];
            if all.iter().any(|&place| touched[place as usize]) {
                continue;
            }
            all.iter().for_each(|&place| touched[place as usize] = true);
            self.reinsert(from, to);
            gains.push(gain);
        }
        gains
    }

    /// The best new sibling for a subtree. Nodes are searched from near to far. The search skips a node if even a place
    /// at no cost below it would gain less than the best place so far.
    #[inline(always)]
    fn best_move(&self, from: u32, stack: &mut Vec<(f32, u32)>) -> Option<Move> {
        let own = *self.node(from);
        let parent = own.parent;
        let mut best = Move { from, to: NONE, gain: 0.0 };
        // The area gained by removing it, up to the pivot.
        let mut freed = self.node(parent).area;
        let mut pivot = parent;
        let mut rest = self.node(self.sibling(from)).bounds;
        let mut beside = self.sibling(from);
        let mut places = 0;
        loop {
            stack.clear();
            stack.push((freed, beside));
            while let Some((gain, place)) = stack.pop() {
                if gain - own.area <= best.gain || places > MAX_PLACES {
                    continue;
                }
                places += 1;
                let there = self.node(place);
                let mut joined = there.bounds;
                joined.grow(&own.bounds);
                let gain_here = gain - joined.half_area();
                if gain_here > best.gain {
                    best = Move { from, to: place, gain: gain_here };
                }
                if there.children[0] != NONE {
                    let below = gain_here + there.area;
                    simd::fetch(self.node(there.children[1]));
                    stack.push((below, there.children[1]));
                    stack.push((below, there.children[0]));
                }
            }
            if pivot != parent {
                rest.grow(&self.node(beside).bounds);
                freed += self.node(pivot).area - rest.half_area();
            }
            if pivot == 0 {
                break;
            }
            beside = self.sibling(pivot);
            pivot = self.node(pivot).parent;
        }
        let stays = best.to == NONE || best.to == parent || best.to == self.sibling(from);
        // Rounding must not make trees cycle.
        (!stays && best.gain > 1e-5 * own.area).then_some(best)
    }

    /// Removes a subtree, replaces its parent by its sibling, and inserts it next to `to` under the freed node.
    fn reinsert(&mut self, from: u32, to: u32) {
        let free = self.node(from).parent;
        let sibling = self.sibling(from);
        let above = self.node(free).parent;
        self.replace(above, free, sibling);
        let over = self.node(to).parent;
        self.replace(over, to, free);
        self.nodes[free as usize].children = [to, from];
        self.nodes[to as usize].parent = free;
        self.refit_from(above);
        self.refit_from(free);
    }

    fn replace(&mut self, parent: u32, child: u32, by: u32) {
        let children = &mut self.nodes[parent as usize].children;
        children[usize::from(children[0] != child)] = by;
        self.nodes[by as usize].parent = parent;
    }

    fn refit_from(&mut self, mut place: u32) {
        while place != NONE {
            let [left, right] = self.node(place).children;
            let mut bounds = self.node(left).bounds;
            bounds.grow(&self.node(right).bounds);
            let node = &mut self.nodes[place as usize];
            node.bounds = bounds;
            node.area = bounds.half_area();
            place = node.parent;
        }
    }

    /// The nodes in depth-first order, parents first; `None` if the tree is deeper than `deepest`.
    pub(crate) fn order(&self, deepest: u32) -> Option<Vec<u32>> {
        let mut order = Vec::with_capacity(self.nodes.len());
        let mut pending = vec![(0, 0)];
        while let Some((place, depth)) = pending.pop() {
            if depth > deepest {
                return None;
            }
            order.push(place);
            if !self.is_leaf(place) {
                pending.extend(self.node(place).children.map(|child| (child, depth + 1)));
            }
        }
        Some(order)
    }

    /// Converts back; `None` if the tree became too deep.
    fn to_binary(&self) -> Option<Binary<'static>> {
        // From the end: the number of nodes below each.
        let order = self.order(DEEPEST)?;
        let mut sizes = vec![1_u32; self.nodes.len()];
        for &place in order.iter().rev() {
            if !self.is_leaf(place) {
                sizes[place as usize] +=
                    self.node(place).children.map(|child| sizes[child as usize]).iter().sum::<u32>();
            }
        }
        Some(self.part(0, &sizes))
    }

    /// The recursion is as deep as the tree.
    fn part(&self, root: u32, sizes: &[u32]) -> Binary<'static> {
        if sizes[root as usize] > 1024 {
            let [left, right] = self.node(root).children;
            let (left, right) = rayon::join(|| self.part(left, sizes), || self.part(right, sizes));
            return Binary::over([left, right]);
        }
        let mut nodes = Vec::with_capacity(sizes[root as usize] as usize);
        let mut pending = vec![root];
        while let Some(place) = pending.pop() {
            let node = self.node(place);
            if self.is_leaf(place) {
                nodes.push(BinaryNode::again(&node.bounds));
                continue;
            }
            let [left, right] = node.children;
            nodes.push(BinaryNode::inner(&node.bounds, 1 + sizes[left as usize] as usize));
            pending.extend([right, left]);
        }
        Binary::subtree(nodes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn leaf(low: [f32; 3], high: [f32; 3], first: u32) -> BinaryNode {
        BinaryNode::leaf(&Bounds::new(low, high, 0, 0), first as usize, 3)
    }

    #[test]
    fn leaves_that_were_put_apart_come_together() {
        // Eight pairs of near boxes, whose halves are in two different trees.
        let size = |i: usize| [0.05 * i as f32 - 0.3, 0.02 * (i % 3) as f32, 0.1];
        let nodes = |shift: f32| {
            // A comb: each inner node has a leaf on its left.
            let mut nodes = Vec::new();
            for i in 0..8 {
                let low = size(i);
                let high = [low[0] + 0.01, low[1] + 0.01, low[2] + 0.01 + shift];
                if i < 7 {
                    nodes.push(BinaryNode::inner(&Bounds::new([-0.5; 3], [0.5; 3], 0, 0), 2));
                }
                nodes.push(leaf(low, high, 3 * i as u32));
            }
            nodes
        };
        let tree = Binary::over([Binary::subtree(nodes(0.002)), Binary::subtree(nodes(0.004))]);
        let mut before = Tree::of(&tree);
        // Recomputes the boxes of inner nodes.
        for place in (0..before.nodes.len() as u32).rev() {
            if !before.is_leaf(place) {
                before.refit_from(place);
            }
        }
        let sum = before.inner_area();
        let leaves: f32 =
            before.nodes.iter().filter(|node| node.children[0] == NONE).map(|node| node.area).sum();
        let gains: Vec<f32> = (0..ROUNDS).flat_map(|_| before.moves(SHARE)).collect();
        assert!(gains.len() > 4, "{}", gains.len());
        let gained: f64 = gains.into_iter().map(f64::from).sum();
        let rest = before.inner_area();
        assert!(rest < 0.6 * sum, "{rest} of {sum}");
        // Gains are computed as if nothing else moved meanwhile.
        let lost = sum - rest;
        assert!((gained - lost).abs() < 0.1 * lost, "{gained}, and it is {lost}");
        let after = Tree::of(&before.to_binary().expect("not deep"));
        assert_eq!(after.nodes.len(), 31);
        let leaves_after: f32 =
            after.nodes.iter().filter(|node| node.children[0] == NONE).map(|node| node.area).sum();
        assert!((leaves_after - leaves).abs() < 1e-3 * leaves);
        // Every box contains its children's.
        for node in after.nodes.iter().filter(|node| node.children[0] != NONE) {
            for child in node.children {
                let mut joined = node.bounds;
                joined.grow(&after.node(child).bounds);
                assert_eq!(joined.half_area(), node.bounds.half_area());
            }
        }
    }
}
