//! The way of a ray through the nodes of a tree.

use std::marker::PhantomData;

use crate::lanes::{self, LANE_BITS, Lanes};
use crate::node::{Node, Slabs, tag};
use crate::stack::{Order, Stack, stack_entry};

/// A ray among the boxes of a tree.
pub(crate) struct Way<'a, L> {
    nodes: &'a [Node],
    slabs: Slabs,
    /// No entry of a stack that is larger is of interest.
    limit: i64,
    lanes: PhantomData<L>,
}

/// The children of a node that a ray meets.
pub(crate) struct Met<'a, L: Lanes> {
    node: &'a Node,
    mask: u32,
    enter: L::Wide,
}

impl<L: Lanes> Clone for Met<'_, L> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<L: Lanes> Copy for Met<'_, L> {}

impl<'a, L: Lanes> Way<'a, L> {
    #[inline(always)]
    pub(crate) fn new(nodes: &'a [Node], slabs: Slabs) -> Self {
        Self { nodes, limit: limit_of(slabs.s_max), slabs, lanes: PhantomData }
    }

    /// Leaves out the boxes that the ray enters after this.
    #[inline(always)]
    pub(crate) fn end_at(&mut self, s_max: f32) {
        self.slabs.s_max = s_max;
        self.limit = limit_of(s_max);
    }

    #[inline(always)]
    pub(crate) fn slabs(&self) -> &Slabs {
        &self.slabs
    }

    /// Goes on from a node: to a child, to what stands on the stack, or nowhere.
    #[inline(always)]
    pub(crate) fn meet_node<O: Order>(&self, reference: u32, stack: &mut Stack<O::Entry>) -> Option<u32> {
        let met = self.look_at(reference);
        self.go_on::<O>(&met, stack)
    }

    /// Which children of a node are met.
    #[inline(always)]
    pub(crate) fn look_at(&self, reference: u32) -> Met<'a, L> {
        let Some(node) = self.nodes.get(reference as usize) else { out_of_tree() };
        let (mask, enter) = lanes::meet_boxes::<L::Wide>(node, lanes::opaque(&self.slabs));
        Met { node, mask, enter }
    }

    /// Goes on from what was met.
    #[inline(always)]
    pub(crate) fn go_on<O: Order>(
        &self,
        &Met { node, mask, enter }: &Met<'a, L>,
        stack: &mut Stack<O::Entry>,
    ) -> Option<u32> {
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

    /// The next on the stack that is not beyond the limit.
    #[inline(always)]
    pub(crate) fn pop<O: Order>(&self, stack: &mut Stack<O::Entry>) -> Option<u32> {
        loop {
            let entry = stack.pop()?;
            if !O::is_beyond(entry, self.limit) {
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

/// What no reference in a tree leads to. The place is not told: it would have to be kept at hand for every step.
#[cold]
#[inline(never)]
pub(crate) fn out_of_tree() -> ! {
    panic!("a reference leads out of its tree")
}

/// No entry of a stack that is larger is of interest to what ends here.
#[inline(always)]
pub(crate) fn limit_of(s_max: f32) -> i64 {
    stack_entry(s_max.to_bits() as i32 | LANE_BITS, u32::MAX)
}
