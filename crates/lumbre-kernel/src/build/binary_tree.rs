//! The binary tree.

use std::borrow::Cow;

use super::binary_node::{BinaryNode, Choices, Costs, Known, choose, share};
use super::primitive::Bounds;
use super::small::FEW;

/// Levels that may be split by SAH; then come at most 32 more, each halving.
pub(super) const SAH_DEPTH: u32 = 64;
/// No tree that has grown so is deeper: the last few are split in any way.
pub(crate) const DEEPEST: u32 = SAH_DEPTH + 32 + FEW as u32;

/// The binary tree, or a part of it.
pub(crate) enum Binary<'p> {
    /// Over many primitives.
    InnerNode(Box<InnerNode<'p>>),
    /// Over fewer, with their nodes in a row.
    Subtree(Subtree<'p>),
}

/// A node with two children of their own.
pub(crate) struct InnerNode<'p> {
    pub(crate) bounds: Bounds,
    pub(crate) costs: Costs,
    pub(crate) choices: Choices,
    pub(crate) children: [Binary<'p>; 2],
    /// How many there are below it, with itself.
    pub(crate) nodes: usize,
    /// Whether the right child is of a higher rank than the left.
    pub(crate) is_ranked: bool,
}

impl Binary<'_> {
    /// The node over two.
    pub(crate) fn over(children: [Self; 2]) -> Self {
        Self::InnerNode(Box::new(InnerNode::over(children)))
    }

    /// A twig of such nodes.
    pub(crate) fn twig(mut nodes: Vec<BinaryNode>) -> Self {
        let costs = choose(&mut nodes, false);
        Self::Subtree(Subtree { nodes: Cow::Owned(nodes), costs, known: Known::default() })
    }
}

/// Nodes in depth-first order, the root first, each left child right after its parent.
pub(crate) struct Subtree<'p> {
    /// As a rule where the primitives stood that they are over.
    pub(crate) nodes: Cow<'p, [BinaryNode]>,
    /// The costs of the root, for those above it.
    pub(crate) costs: Costs,
    /// Those of others, where they may come to stand elsewhere.
    pub(super) known: Known,
}

impl<'p> Subtree<'p> {
    /// The subtree of these nodes. Unless they stand where the primitives stood, they are copied.
    pub(crate) fn part(&self, nodes: std::ops::Range<usize>) -> Self {
        let costs = self.known.costs(nodes.start, &self.nodes[nodes.clone()]);
        let nodes = match &self.nodes {
            Cow::Borrowed(all) => Cow::Borrowed(&all[nodes]),
            Cow::Owned(all) => Cow::Owned(all[nodes].to_vec()),
        };
        Self { nodes, costs, known: Known::default() }
    }
}

impl Binary<'_> {
    pub(crate) fn bounds(&self) -> &Bounds {
        match self {
            Self::InnerNode(fork) => &fork.bounds,
            Self::Subtree(twig) => twig.nodes[0].bounds(),
        }
    }

    pub(crate) fn costs(&self) -> &Costs {
        match self {
            Self::InnerNode(fork) => &fork.costs,
            Self::Subtree(twig) => &twig.costs,
        }
    }

    /// How many nodes it has.
    fn nodes(&self) -> usize {
        match self {
            Self::InnerNode(fork) => fork.nodes,
            Self::Subtree(twig) => twig.nodes.len(),
        }
    }
}

impl<'p> InnerNode<'p> {
    /// The one over two.
    pub(crate) fn over(children: [Binary<'p>; 2]) -> Self {
        let mut bounds = *children[0].bounds();
        bounds.grow(children[1].bounds());
        let (costs, choices) = share(bounds.half_area(), children[0].costs(), children[1].costs());
        let nodes = 1 + children[0].nodes() + children[1].nodes();
        Self { bounds, costs, choices, children, nodes, is_ranked: false }
    }
}
