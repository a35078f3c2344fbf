//! The way of a ray through the nodes of a tree.

use std::marker::PhantomData;

use crate::lanes::{self, Lanes};
use crate::node::{Node, Slabs, out_of_tree, tag};
use crate::stack::{Order, Stack};

/// A ray among the boxes of a tree.
pub(crate) struct Way<'a, L> {
    nodes: &'a [Node],
    slabs: Slabs,
    lanes: PhantomData<L>,
}

impl<'a, L: Lanes> Way<'a, L> {
    #[inline(always)]
    pub(crate) fn new(nodes: &'a [Node], slabs: Slabs) -> Self {
        Self { nodes, slabs, lanes: PhantomData }
    }

    /// Leaves out the boxes that the ray enters after this.
    #[inline(always)]
    pub(crate) fn end_at(&mut self, s_max: f32) {
        self.slabs.end_at(s_max);
    }

    #[inline(always)]
    pub(crate) fn slabs(&self) -> &Slabs {
        &self.slabs
    }

    #[inline(always)]
    pub(crate) fn slabs_mut(&mut self) -> &mut Slabs {
        &mut self.slabs
    }

    /// Goes on from a node: to a child, to what stands on the stack, or nowhere.
    #[inline(always)]
    pub(crate) fn meet_node<O: Order>(&self, reference: u32, stack: &mut Stack<O::Entry>) -> Option<u32> {
        let Some(node) = self.nodes.get(reference as usize) else { out_of_tree() };
        let (mask, enter) = lanes::meet_boxes::<L::Wide>(node, lanes::opaque(&self.slabs));
        if mask & mask.wrapping_sub(1) != 0 || O::PUTS_ONE && mask != 0 {
            Some(stack.put(
                #[inline(always)]
                |room| O::push_children::<L>(node, mask, enter, room),
            ))
        } else if mask != 0 {
            Some(lanes::only_child(node, mask))
        } else {
            self.pop::<O>(stack)
        }
    }

    /// Whether an entry of a stack lies wholly beyond the end of the ray.
    #[inline(always)]
    pub(crate) fn is_beyond<O: Order>(&self, entry: O::Entry) -> bool {
        O::is_beyond(entry, self.slabs.s_max())
    }

    /// The next on the stack that is not beyond the end of the ray.
    #[inline(always)]
    pub(crate) fn pop<O: Order>(&self, stack: &mut Stack<O::Entry>) -> Option<u32> {
        loop {
            let entry = stack.pop()?;
            if !self.is_beyond::<O>(entry) {
                return Some(O::reference(entry));
            }
        }
    }

    /// Goes down from a node to a leaf; `None` when there is none left.
    #[inline(always)]
    pub(crate) fn descend<O: Order>(&self, mut reference: u32, stack: &mut Stack<O::Entry>) -> Option<u32> {
        while reference >> tag::SHIFT == tag::INNER {
            reference = self.meet_node::<O>(reference, stack)?;
        }
        Some(reference)
    }
}
