//! A ray on its way through the nodes of a tree.

use std::marker::PhantomData;

use super::stack::{Goal, Stack};
use crate::intersect::box_ray::Slabs;
use crate::intersect::{self, Simd};
use crate::simd;
use crate::tree::node::{Node, out_of_tree, tag};

/// A ray among the bounding boxes of a tree.
pub(crate) struct NodeCursor<'a, L> {
    nodes: &'a [Node],
    pub(crate) slabs: Slabs,
    lanes: PhantomData<L>,
}

impl<'a, L: Simd> NodeCursor<'a, L> {
    #[inline(always)]
    pub(crate) fn new(nodes: &'a [Node], slabs: Slabs) -> Self {
        Self { nodes, slabs, lanes: PhantomData }
    }

    /// The next leaf at or below `reference`, then from the stack; `None` at the end of the traversal.
    #[inline(always)]
    pub(crate) fn descend<G: Goal>(&self, mut reference: u32, stack: &mut Stack<G::Entry>) -> Option<u32> {
        while tag::is_inner(reference) {
            let Some(node) = self.nodes.get(reference as usize) else { out_of_tree() };
            let (mask, enter) = intersect::intersect_boxes::<L::F32x16>(node, simd::opaque(&self.slabs));
            reference = if mask & mask.wrapping_sub(1) != 0 || G::IS_ANY && mask != 0 {
                stack.put(
                    #[inline(always)]
                    |room| G::push_children::<L>(node, mask, enter, room),
                )
            } else if mask != 0 {
                intersect::only_child(node, mask)
            } else {
                self.pop::<G>(stack)?
            };
        }
        Some(reference)
    }

    /// The next leaf from the stack.
    #[inline(always)]
    pub(crate) fn next_leaf<G: Goal>(&self, stack: &mut Stack<G::Entry>) -> Option<u32> {
        let reference = self.pop::<G>(stack)?;
        self.descend::<G>(reference, stack)
    }

    /// The next subtree on the stack that does not lie beyond the end of the ray.
    #[inline(always)]
    fn pop<G: Goal>(&self, stack: &mut Stack<G::Entry>) -> Option<u32> {
        loop {
            let entry = stack.pop()?;
            if !G::is_beyond(entry, self.slabs.s_max()) {
                return Some(G::reference(entry));
            }
        }
    }
}
