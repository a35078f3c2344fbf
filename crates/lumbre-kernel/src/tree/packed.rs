//! The tree in arrays: nodes, and the leaves of each kind.

use bytemuck::{Pod, Zeroable};

use super::node::{Node, tag};
use super::sphere_block::SphereBlock;
use super::storage::Store;
use super::triangle_block::{BlockIds, Blocks, Line};

/// A primitive in a leaf, other than a packed triangle or sphere, or an infinite primitive outside the tree.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Entry {
    /// Position in the tree's list.
    pub(crate) geometry: u32,
    /// Index of the primitive in its geometry, or the node where an instance is entered. The top bit marks the last of
    /// its leaf.
    primitive_and_last: u32,
}

const LAST: u32 = 1 << 31;

impl Entry {
    pub(crate) fn new(geometry: u32, primitive: u32, is_last: bool) -> Self {
        Self { geometry, primitive_and_last: primitive | if is_last { LAST } else { 0 } }
    }

    /// The form in which it is saved.
    pub(crate) fn to_words(self) -> [u32; 2] {
        [self.geometry, self.primitive_and_last]
    }

    pub(crate) fn from_words([geometry, primitive_and_last]: [u32; 2]) -> Self {
        Self { geometry, primitive_and_last }
    }

    #[inline(always)]
    pub(crate) fn primitive(&self) -> u32 {
        self.primitive_and_last & !LAST
    }

    #[inline(always)]
    pub(crate) fn is_last(&self) -> bool {
        self.primitive_and_last & LAST != 0
    }
}

/// The packed tree.
#[derive(Clone, Debug, Default)]
pub(crate) struct Packed {
    /// Each node precedes all nodes below it.
    pub(crate) nodes: Store<Node>,
    /// The blocks of triangles: see [`triangle_block`](super::triangle_block).
    pub(crate) blocks: Store<Line>,
    /// The primitive ids of each triangle block.
    pub(crate) ids: Store<BlockIds>,
    pub(crate) entries: Store<Entry>,
    pub(crate) sphere_blocks: Store<SphereBlock>,
    /// The primitive ids of each sphere block.
    pub(crate) sphere_ids: Store<BlockIds>,
    /// The reference to the root; `None` without finite geometry.
    pub(crate) root: Option<u32>,
}

impl Packed {
    /// The blocks of triangles.
    #[inline(always)]
    pub(crate) fn blocks(&self) -> Blocks<'_> {
        Blocks::new(&self.blocks)
    }

    /// The numbers of a triangle leaf's blocks, which index `ids`.
    pub(crate) fn numbers(&self, leaf: u32) -> std::ops::Range<usize> {
        self.blocks().numbers(leaf).expect("references lead to blocks")
    }
}

/// Where an entry enters an instance's tree: at the root, or at another node. The parts of an instance together are its
/// whole tree; they have no node in common, and none is a leaf.
///
/// A refit may bring another tree in which these nodes do not qualify. Then one entry stands for the whole and the
/// others for nothing, until a tree comes in which they qualify again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Start(pub(crate) u32);

impl Start {
    /// At the root.
    pub(crate) const WHOLE: Self = Self(0);
    pub(crate) const AS_WHOLE: u32 = 1;
    pub(crate) const AS_NOTHING: u32 = 2;

    /// The form in an entry.
    #[inline(always)]
    pub(crate) fn of(word: u32) -> Self {
        Self(word)
    }

    pub(crate) fn word(self) -> u32 {
        self.0
    }

    #[inline(always)]
    pub(crate) fn is_nothing(self) -> bool {
        tag::of(self.0) >= Self::AS_NOTHING
    }

    /// The reference to enter, in a tree with this root.
    #[inline(always)]
    pub(crate) fn below(self, root: u32) -> u32 {
        if self == Self::WHOLE || !tag::is_inner(self.0) { root } else { self.0 }
    }

    pub(crate) fn node(self) -> u32 {
        self.0 & tag::PLACE
    }

    pub(crate) fn marked(self, mark: u32) -> Self {
        Self(tag::reference(mark, self.node()))
    }
}
