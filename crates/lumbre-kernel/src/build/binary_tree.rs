//! The binary tree.

use std::borrow::Cow;

use super::binary_node::{BinaryNode, Choices, Costs, Known, choose, share};
use super::primitive::Bounds;
use super::small::SMALL_BUILD_MAX;

/// Levels that SAH may split; at most 32 levels of halving follow.
pub(super) const SAH_DEPTH: u32 = 64;
/// Bound on the depth of every tree built here; the last few primitives may be split in any way.
pub(crate) const DEEPEST: u32 = SAH_DEPTH + 32 + SMALL_BUILD_MAX as u32;

/// The binary tree, or a part of it.
pub(crate) enum Binary<'p> {
    /// Above the subtrees that one thread builds.
    InnerNode(Box<InnerNode<'p>>),
    /// A subtree that one thread built, in one array.
    Subtree(Subtree<'p>),
}

/// A node that owns its two children.
pub(crate) struct InnerNode<'p> {
    pub(crate) bounds: Bounds,
    pub(crate) costs: Costs,
    pub(crate) choices: Choices,
    pub(crate) children: [Binary<'p>; 2],
    /// Number of nodes in its tree, including itself.
    pub(crate) nodes: usize,
    /// Whether the right child has a higher rank than the left.
    pub(crate) is_ranked: bool,
}

impl Binary<'_> {
    /// The node over two trees.
    pub(crate) fn over(children: [Self; 2]) -> Self {
        Self::InnerNode(Box::new(InnerNode::over(children)))
    }

    /// A subtree of these nodes.
    pub(crate) fn subtree(mut nodes: Vec<BinaryNode>) -> Self {
        let costs = choose(&mut nodes, false);
        Self::Subtree(Subtree { nodes: Cow::Owned(nodes), costs, known: Known::default() })
    }
}

/// Nodes in depth-first order, the root first, each left child right after its parent.
pub(crate) struct Subtree<'p> {
    /// Usually borrowed from the slots of the subtree's primitives.
    pub(crate) nodes: Cow<'p, [BinaryNode]>,
    /// The costs of the root, for its ancestors.
    pub(crate) costs: Costs,
    /// The costs of other nodes, if reinsertion may move them.
    pub(super) known: Known,
}

impl<'p> Subtree<'p> {
    /// The subtree in this range of nodes. Owned nodes are copied.
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
            Self::InnerNode(inner) => &inner.bounds,
            Self::Subtree(subtree) => subtree.nodes[0].bounds(),
        }
    }

    pub(crate) fn costs(&self) -> &Costs {
        match self {
            Self::InnerNode(inner) => &inner.costs,
            Self::Subtree(subtree) => &subtree.costs,
        }
    }

    /// Number of nodes.
    fn nodes(&self) -> usize {
        match self {
            Self::InnerNode(inner) => inner.nodes,
            Self::Subtree(subtree) => subtree.nodes.len(),
        }
    }
}

impl<'p> InnerNode<'p> {
    /// The node over two trees.
    pub(crate) fn over(children: [Binary<'p>; 2]) -> Self {
        let mut bounds = *children[0].bounds();
        bounds.grow(children[1].bounds());
        let (costs, choices) = share(bounds.half_area(), children[0].costs(), children[1].costs());
        let nodes = 1 + children[0].nodes() + children[1].nodes();
        Self { bounds, costs, choices, children, nodes, is_ranked: false }
    }
}
