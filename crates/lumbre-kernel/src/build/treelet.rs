//! Reinsertion where it gains most for its time: among the upper nodes of a tree.
//!
//! From the root down, the nodes with the largest areas are opened; subtrees below them move as a whole (T. Karras, T.
//! Aila, "Fast Parallel Construction of High-Quality Bounding Volume Hierarchies", High Performance Graphics, 2013,
//! call such a part of a tree a treelet). A first round over few nodes shows whether it pays: the trees of statues and
//! landscapes are already as good as they can be there, but those of rooms, and of large objects among small ones, are
//! not.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::ops::Range;

use crate::build::binary_node::BinaryNode;
use crate::build::binary_tree::{self, Binary, Subtree};
use crate::build::primitive::Bounds;
use crate::build::reinsert::{self, NONE, Node, Tree};

/// Number of opened nodes. A thousand gain rays nothing more, and the search takes four times as long.
const OPENED: usize = 128;
/// One opened node per this many primitives. Not tried for too few primitives.
const PER_OPENED: usize = 128;
const MIN_OPENED: usize = 64;
/// Maximum rounds.
const ROUNDS: usize = 10;
/// Stops after a round that gains less than this share of the opened nodes' areas. The first round gains at most a
/// hundredth in statues and landscapes, and 5 to 10 hundredths in rooms.
const FIRST_GAIN: f64 = 0.03;
const MIN_GAIN: f64 = 0.005;
/// Discards a deeper treelet, so that the whole tree is no deeper than other reinserted trees.
const DEEPEST: u32 = reinsert::DEEPEST - binary_tree::DEEPEST;

/// The content of a treelet's node.
#[derive(Clone, Copy)]
enum Piece<'a> {
    Tree(&'a Binary<'a>),
    /// A part of a subtree.
    Part(&'a [BinaryNode]),
}

impl<'a> Piece<'a> {
    fn bounds(self) -> &'a Bounds {
        match self {
            Self::Tree(tree) => tree.bounds(),
            Self::Part(nodes) => nodes[0].bounds(),
        }
    }

    fn children(self) -> Option<[Self; 2]> {
        match self {
            Self::Tree(Binary::InnerNode(inner)) => Some(inner.children.each_ref().map(Self::Tree)),
            Self::Tree(Binary::Subtree(subtree)) => Self::Part(&subtree.nodes).children(),
            Self::Part(nodes) => sides(nodes).map(|sides| sides.map(|side| Self::Part(&nodes[side]))),
        }
    }
}

/// The ranges of the subtrees below the first node; `None` for a leaf.
fn sides(nodes: &[BinaryNode]) -> Option<[Range<usize>; 2]> {
    let right = nodes[0].ids().is_none().then(|| nodes[0].right())?;
    Some([1..right, right..nodes.len()])
}

/// Whether it is tried for this many primitives.
pub(crate) fn is_tried(primitives: usize) -> bool {
    primitives >= MIN_OPENED * PER_OPENED
}

/// Reinserts the upper nodes of a tree over this many primitives, if that makes it much better.
pub(crate) fn reinsert_upper(tree: Binary<'_>, primitives: usize) -> Binary<'_> {
    let mut upper = open(&tree, (primitives / PER_OPENED).min(OPENED));
    let children: Vec<_> = (0..upper.nodes.len() as u32).map(|place| upper.children(place)).collect();
    if !improve(&mut upper) {
        return tree;
    }
    over(&upper, 0, &mut cut(tree, &children))
}

/// The tree's nodes after opening up to `count` of them, the largest first and ties by position.
fn open(tree: &Binary, count: usize) -> Tree {
    let mut pieces = vec![Piece::Tree(tree)];
    let mut upper = Tree { nodes: vec![Node::closed(tree.bounds(), NONE)] };
    // Areas are never negative, so their bits order like numbers.
    let key = |node: &Node, place: u32| (node.area.to_bits(), Reverse(place));
    let mut closed = BinaryHeap::from([key(&upper.nodes[0], 0)]);
    let mut opened = 0;
    while opened < count
        && let Some((_, Reverse(parent))) = closed.pop()
    {
        let Some(children) = pieces[parent as usize].children() else { continue };
        let first = pieces.len() as u32;
        for (place, child) in (first..).zip(children) {
            let node = Node::closed(child.bounds(), parent);
            closed.push(key(&node, place));
            upper.nodes.push(node);
            pieces.push(child);
        }
        upper.nodes[parent as usize].children = [first, first + 1];
        opened += 1;
    }
    upper
}

/// Reinserts; returns whether the tree became much better and not too deep.
fn improve(upper: &mut Tree) -> bool {
    let all = upper.inner_area();
    if upper.round(1) <= FIRST_GAIN * all {
        return false;
    }
    upper.rounds(ROUNDS - 1, 1, MIN_GAIN * all);
    upper.order(DEEPEST).is_some()
}

/// The trees below the opened nodes, by position; `children` are the opened nodes' children.
fn cut<'p>(tree: Binary<'p>, children: &[Option<[u32; 2]>]) -> Vec<Option<Binary<'p>>> {
    let mut pieces: Vec<_> = children.iter().map(|_| None).collect();
    let mut pending = vec![(tree, 0)];
    while let Some((tree, place)) = pending.pop() {
        match (tree, children[place as usize]) {
            (Binary::InnerNode(inner), Some(own)) => pending.extend(inner.children.into_iter().zip(own)),
            (Binary::Subtree(subtree), Some(_)) => cut_subtree(&subtree, place, children, &mut pieces),
            (tree, None) => pieces[place as usize] = Some(tree),
        }
    }
    pieces
}

/// [`cut`] below a subtree whose root has this position.
fn cut_subtree<'p>(
    subtree: &Subtree<'p>,
    place: u32,
    children: &[Option<[u32; 2]>],
    pieces: &mut [Option<Binary<'p>>],
) {
    let mut pending = vec![(0..subtree.nodes.len(), place)];
    while let Some((part, place)) = pending.pop() {
        match (sides(&subtree.nodes[part.clone()]), children[place as usize]) {
            (Some(sides), Some(own)) => {
                let sides = sides.map(|side| part.start + side.start..part.start + side.end);
                pending.extend(sides.into_iter().zip(own));
            }
            _ => pieces[place as usize] = Some(Binary::Subtree(subtree.part(part))),
        }
    }
}

/// The tree below a node of a list; takes the pieces that it needs. The recursion is as deep as the list's tree.
fn over<'p>(tree: &Tree, place: u32, pieces: &mut [Option<Binary<'p>>]) -> Binary<'p> {
    match tree.children(place) {
        Some([left, right]) => Binary::over([over(tree, left, pieces), over(tree, right, pieces)]),
        None => pieces[place as usize].take().expect("there is a tree at each leaf of the list, once"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::build::binary::{GrownTree, binary_tree};
    use crate::build::binary_node::choose;
    use crate::build::boxes::Boxes;
    use crate::build::options::Preset;
    use crate::build::primitive::{Kind, Traits};
    use crate::intersect::Isa;
    use crate::tests::scenes::Random;
    use crate::tree::PrimitiveId;

    /// Boxes of a room: objects of many small boxes among walls and boards. Otherwise only small boxes, scattered.
    fn boxes(count: usize, is_room: bool) -> Boxes {
        let mut random = Random(77);
        let mut boxes = Boxes::empty(count);
        let mut thing = [0.0; 3];
        for (place, bounds) in boxes.iter_mut().enumerate() {
            let mut around = |center: [f64; 3], half: f64| center.map(|x| x + random.between(-half, half));
            if place % 500 == 0 || !is_room {
                thing = around([0.0; 3], 0.4);
            }
            let (center, half) = if is_room && place % 25 == 0 {
                (
                    around([0.0; 3], 0.3),
                    [0, 1, 2].map(|axis| if axis == place / 25 % 3 { 1e-3 } else { 0.15 }),
                )
            } else {
                (around(thing, 0.02), [1e-3; 3])
            };
            let corner = |side: f64| [0, 1, 2].map(|axis| (center[axis] + side * half[axis]) as f32);
            *bounds = Bounds::new(corner(-1.0), corner(1.0), 0, place as u32);
        }
        boxes
    }

    fn grow<'p>(preset: Preset, boxes: &'p mut Boxes) -> GrownTree<'p> {
        let traits = [Traits { kind: Kind::Triangle, cost: 4, most: 8 }];
        binary_tree(Isa::best(), preset, Vec::new(), boxes, &traits)
    }

    /// Lists the nodes of a tree, left before right; calls `leaf` for every leaf, and checks that boxes contain those
    /// below.
    fn walk(tree: Piece, leaf: &mut impl FnMut(&BinaryNode), nodes: &mut Vec<BinaryNode>) {
        let place = nodes.len();
        match tree.children() {
            Some(children) => {
                nodes.push(BinaryNode::inner(tree.bounds(), 0));
                let [left, right] = children;
                for child in children {
                    let (own, around) = (child.bounds(), tree.bounds());
                    let mut joined = *own;
                    joined.grow(around);
                    assert_eq!(joined.half_area(), around.half_area());
                }
                walk(left, leaf, nodes);
                nodes[place] = BinaryNode::inner(tree.bounds(), nodes.len() - place);
                walk(right, leaf, nodes);
            }
            None => {
                let node = match tree {
                    Piece::Tree(Binary::Subtree(subtree)) => &subtree.nodes[0],
                    Piece::Part(nodes) => &nodes[0],
                    Piece::Tree(Binary::InnerNode(_)) => unreachable!("it has children"),
                };
                leaf(node);
                nodes.push(*node);
            }
        }
    }

    /// Every id is in one leaf, every box contains those below it, and the stored costs are right.
    fn check(grown: &GrownTree, count: usize) {
        let mut ids: Vec<PrimitiveId> = Vec::new();
        let mut nodes = Vec::new();
        let root = Piece::Tree(&grown.tree);
        walk(root, &mut |leaf| ids.extend(&grown.ids[leaf.ids().expect("a leaf")]), &mut nodes);
        ids.sort_unstable();
        assert!(ids.iter().map(|name| name[1]).eq(0..count as u32));
        assert_eq!(&choose(&mut nodes, false), grown.tree.costs());
    }

    #[test]
    fn what_is_large_among_small_things_is_put_where_it_belongs() {
        // In few subtrees and in many.
        for count in [9_000, 15_000, 120_000] {
            let mut boxes = boxes(count, true);
            let grown = grow(Preset::Balanced, &mut boxes);
            check(&grown, count);
            let mut upper = open(&grown.tree, OPENED.min(count / PER_OPENED));
            let all = upper.inner_area();
            let gain = upper.round(1);
            assert!(gain < FIRST_GAIN * all, "{gain} of {all} is left to be gained");
        }
    }

    /// The nodes of a tree, left before right.
    fn list(tree: &Binary) -> Vec<BinaryNode> {
        let mut nodes = Vec::new();
        walk(Piece::Tree(tree), &mut |_| (), &mut nodes);
        nodes
    }

    #[test]
    fn a_tree_that_gains_little_stays_as_it_is() {
        for count in [9_000, 30_000] {
            let mut boxes = boxes(count, false);
            let grown = grow(Preset::Balanced, &mut boxes);
            check(&grown, count);
            let before = list(&grown.tree);
            let after = list(&reinsert_upper(grown.tree, count));
            assert!(bytemuck::cast_slice::<_, u8>(&before) == bytemuck::cast_slice::<_, u8>(&after));
        }
    }

    #[test]
    fn parts_of_subtrees_that_stand_apart_are_put_together() {
        // Pairs of near boxes along a line, whose halves are in two subtrees, each a comb.
        let subtree = |shift: f32, first: usize| {
            let mut nodes = Vec::new();
            for i in 0..100 {
                let low = [0.009 * i as f32 - 0.45, shift, 0.1];
                let own = BinaryNode::leaf(&Bounds::new(low, low.map(|x| x + 0.001), 0, 0), first + i, 1);
                nodes.push(own);
            }
            let mut whole = *nodes[99].bounds();
            for i in (0..99).rev() {
                whole.grow(nodes[i].bounds());
                nodes.insert(i, BinaryNode::inner(&whole, 2));
            }
            Binary::subtree(nodes)
        };
        let tree = Binary::over([subtree(0.0, 0), subtree(0.002, 100)]);
        let area = |tree: &Binary| {
            let nodes = list(tree);
            let inner = nodes.iter().filter(|node| node.ids().is_none());
            inner.map(|node| f64::from(node.bounds().half_area())).sum::<f64>()
        };
        let before = area(&tree);
        let tree = reinsert_upper(tree, 1_000_000);
        assert!(area(&tree) < 0.7 * before, "{} of {before}", area(&tree));
        check(&GrownTree { tree, ids: (0..200).map(|i| [0, i]).collect(), instances: vec![] }, 200);
    }
}
