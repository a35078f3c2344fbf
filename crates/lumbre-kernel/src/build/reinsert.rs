//! Making a binary tree better: subtrees are taken out and put in where the sum of all areas becomes least.
//!
//! D. Meister, J. Bittner, "Parallel Reinsertion for Bounding Volume Hierarchy Optimization", Computer Graphics Forum 37(2),
//! 2018. Places are sought for many subtrees at once; of those that would touch the same nodes, the one that gains most
//! moves, the earlier of equals, so that the result does not depend on threads.

use rayon::prelude::*;

use crate::build::binary_node::BinaryNode;
use crate::build::binary_tree::Binary;
use crate::build::primitive::Bounds;
use crate::intersect::{Dispatch, Isa, Simd};
use crate::simd;

/// How often places are sought at most.
const ROUNDS: usize = 8;
/// No more where a round gains less than this share of all areas. As upper nodes have been moved before (see `treelet`), most trees
/// come to that in one round or two. With a thousandth, whole builds took up to 1.25 times as long, and rays gained nothing that could
/// be measured.
const MIN_GAIN: f64 = 0.015;
/// Of how many nodes one is considered in a round, by area. With one of two, whole builds took up to 1.7 times as long, and rays
/// gained nothing that could be measured.
const SHARE: usize = 8;
/// Trees that become deeper are given up: recursions below rely on it.
pub(crate) const DEEPEST: u32 = 200;
/// How many places are looked at for one subtree at most.
const MAX_PLACES: usize = 4096;

pub(crate) const NONE: u32 = u32::MAX;

/// A node with links both ways.
#[derive(Clone, Copy)]
pub(crate) struct Node {
    bounds: Bounds,
    pub(crate) area: f32,
    parent: u32,
    /// `NONE` for leaves.
    pub(crate) children: [u32; 2],
}

impl Node {
    /// Without children.
    pub(crate) fn closed(bounds: &Bounds, parent: u32) -> Self {
        Self { bounds: *bounds, area: bounds.half_area(), parent, children: [NONE; 2] }
    }
}

/// The tree as a list; the root comes first.
pub(crate) struct Tree {
    pub(crate) nodes: Vec<Node>,
}

/// A subtree that would be better elsewhere.
#[derive(Clone, Copy)]
struct Move {
    from: u32,
    to: u32,
    gain: f32,
}

/// A better tree over the same leaves, or the same one.
pub(crate) fn reinsert(tree: Binary<'_>) -> Binary<'_> {
    let mut linked = Tree::of(&tree);
    if linked.nodes.len() < 8 {
        return tree;
    }
    let all = linked.inner_area();
    linked.rounds(ROUNDS, SHARE, MIN_GAIN * all);
    linked.to_binary().unwrap_or(tree)
}

/// Seeks where a subtree is best put.
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
                Binary::InnerNode(fork) => {
                    let place = nodes.len() as u32;
                    nodes.push(Node::closed(&fork.bounds, parent));
                    Self::link(&mut nodes, parent, place);
                    pending.extend(fork.children.iter().rev().map(|child| (child, place)));
                }
                Binary::Subtree(twig) => {
                    let start = nodes.len() as u32;
                    nodes.extend(twig.nodes.iter().map(|node| Node::closed(node.bounds(), NONE)));
                    nodes[start as usize].parent = parent;
                    Self::link(&mut nodes, parent, start);
                    for (i, node) in twig.nodes.iter().enumerate() {
                        if node.names().is_none() {
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

    /// Left children come first, since they are taken first from the stack.
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

    /// Those of an inner node.
    pub(crate) fn children(&self, place: u32) -> Option<[u32; 2]> {
        (!self.is_leaf(place)).then(|| self.node(place).children)
    }

    /// The areas of all inner nodes together.
    pub(crate) fn inner_area(&self) -> f64 {
        self.nodes.iter().filter(|node| node.children[0] != NONE).map(|node| f64::from(node.area)).sum()
    }

    /// At most this many rounds, up to the first that gains no more than `least`.
    pub(crate) fn rounds(&mut self, most: usize, share: usize, least: f64) {
        for _ in 0..most {
            if self.round(share) <= least {
                break;
            }
        }
    }

    /// Seeks a better place for one in this many nodes and moves it; returns how much area was gained.
    pub(crate) fn round(&mut self, share: usize) -> f64 {
        self.moves(share).into_iter().map(f64::from).sum()
    }

    /// The same; returns how much each move gained.
    fn moves(&mut self, share: usize) -> Vec<f32> {
        // The largest ones, of those that have a grandparent.
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

    /// Where a subtree is best put: beside which node. Nodes are looked at from the near to the far, and not below where
    /// even a place without cost would gain less than the best one so far.
    #[inline(always)]
    fn best_move(&self, from: u32, stack: &mut Vec<(f32, u32)>) -> Option<Move> {
        let own = *self.node(from);
        let parent = own.parent;
        let mut best = Move { from, to: NONE, gain: 0.0 };
        // What is gained by taking it out, as far up as the pivot.
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
        // Rounding must not make trees go round in circles.
        (!stays && best.gain > 1e-5 * own.area).then_some(best)
    }

    /// Takes a subtree out, whose parent's place goes to its sibling, and puts it beside `to` under the node that became
    /// free.
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

    /// The nodes in the order of a walk, children after parents; `None` where it is deeper than that.
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

    /// Back; `None` where it became too deep.
    fn to_binary(&self) -> Option<Binary<'static>> {
        // From the end, how many nodes are under each.
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

    /// The depth of its recursion is that of the tree.
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
        Binary::twig(nodes)
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
        // Eight pairs of near boxes, of which the halves were put into two trees.
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
        let tree = Binary::over([Binary::twig(nodes(0.002)), Binary::twig(nodes(0.004))]);
        let mut before = Tree::of(&tree);
        // The boxes of inner nodes as they are.
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
        // Gains are reckoned as if nothing else moved meanwhile.
        let lost = sum - rest;
        assert!((gained - lost).abs() < 0.1 * lost, "{gained}, and it is {lost}");
        let after = Tree::of(&before.to_binary().expect("not deep"));
        assert_eq!(after.nodes.len(), 31);
        let leaves_after: f32 =
            after.nodes.iter().filter(|node| node.children[0] == NONE).map(|node| node.area).sum();
        assert!((leaves_after - leaves).abs() < 1e-3 * leaves);
        // Every box holds its children's.
        for node in after.nodes.iter().filter(|node| node.children[0] != NONE) {
            for child in node.children {
                let mut joined = node.bounds;
                joined.grow(&after.node(child).bounds);
                assert_eq!(joined.half_area(), node.bounds.half_area());
            }
        }
    }
}
