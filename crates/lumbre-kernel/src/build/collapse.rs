//! Turns the binary tree into sixteen-wide nodes and packed leaves.
//!
//! Dynamic programming chooses the nodes of the wide tree so that the sum of their areas is least: H. Ylitie, T.
//! Karras, S. Laine, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs", High Performance
//! Graphics, 2017. The leaves are those of the binary tree.

use rayon::prelude::*;

use crate::build::binary_node::{BinaryNode, Choices};
use crate::build::binary_tree::{Binary, InnerNode};
use crate::build::boxes::fill;
use crate::build::error::BuildError;
use crate::build::occlusion_order;
use crate::build::pack::{self, Filled, LaneOrder};
use crate::build::primitive::{Bounds, Kind, Primitive, Traits};
use crate::intersect::Isa;
use crate::tree::BLOCK;
use crate::tree::PrimitiveId;
use crate::tree::geometry::SphereCloud;
use crate::tree::node::{Node, TreeSpace, WIDTH, tag};
use crate::tree::packed::{Entry, Packed};
use crate::tree::sphere_block::SphereBlock;
use crate::tree::storage::Store;
use crate::tree::triangle_block::{BlockIds, Blocks};
use crate::tree::{Geometry, GeometryKind};

impl Packed {
    /// Moves the triangles of a packed tree from the geometries `before` to the new ones. `may_lack_area` is false if
    /// no triangle can have zero area; that skips the test.
    pub(crate) fn move_triangles(
        &mut self,
        isa: Isa,
        geometries: &[Geometry],
        before: &[Geometry],
        may_lack_area: bool,
    ) {
        if pack::name_same_vertices(before, geometries)
            && pack::move_triangles(isa, geometries, &self.ids, may_lack_area, self.blocks.to_mut())
        {
            return;
        }
        let followers = self.blocks().followers(self.ids.len());
        let old = std::mem::take(&mut self.blocks);
        let number_of = |leaf| Blocks::new(&old).numbers(leaf).map_or(0, |numbers| numbers.start);
        self.pack(isa, geometries, &followers, may_lack_area, number_of);
    }

    /// Packs the triangles by their ids; references in nodes still number blocks. Leaves out triangles without an area;
    /// `may_lack_area` as above.
    pub(crate) fn pack_triangles(&mut self, isa: Isa, geometries: &[Geometry], may_lack_area: bool) {
        let followers = pack::followers_of(&self.nodes, self.root, self.ids.len());
        self.pack(isa, geometries, &followers, may_lack_area, |leaf| tag::blocks(leaf).start);
    }

    /// Packs the triangles of each leaf into consecutive blocks and updates the references in nodes. `number_of`
    /// returns the number of a leaf's first block.
    fn pack(
        &mut self,
        isa: Isa,
        geometries: &[Geometry],
        followers: &[u8],
        may_lack_area: bool,
        number_of: impl Fn(u32) -> usize + Sync,
    ) {
        // In a mixed tree, rays meet too few triangles to gain from larger blocks.
        let is_mixed = !self.entries.is_empty() || !self.sphere_blocks.is_empty();
        let may_share = is_mixed || pack::is_worth_sharing(self.ids.len());
        let Filled { lines, places, orders } =
            pack::pack(isa, may_share, geometries, &self.ids, followers, may_lack_area);
        pack::refer(self.nodes.to_mut(), &mut self.root, &places, number_of);
        self.blocks = lines.into();
        self.put_in_order(&orders);
    }

    /// Reorders ids as their triangles were packed.
    fn put_in_order(&mut self, orders: &[LaneOrder]) {
        if orders.iter().all(|order| order.is_same()) {
            return;
        }
        let ids = self.ids.to_mut();
        ids.par_iter_mut().zip(orders).with_min_len(1 << 10).for_each(|(ids, order)| order.put(ids));
    }
}

/// A node of the binary tree in any representation.
#[derive(Clone, Copy)]
enum Cursor<'a> {
    InnerNode(&'a InnerNode<'a>),
    /// The nodes from this one on.
    Subtree(&'a [BinaryNode]),
    /// One instance of a leaf, and the index of its id.
    Instance(&'a Primitive, usize),
}

impl<'a> Cursor<'a> {
    fn new(tree: &'a Binary<'a>) -> Self {
        match tree {
            Binary::InnerNode(inner) => Self::InnerNode(inner),
            Binary::Subtree(subtree) => Self::Subtree(&subtree.nodes),
        }
    }

    #[inline(always)]
    fn bounds(&self) -> &'a Bounds {
        match self {
            Self::InnerNode(inner) => &inner.bounds,
            Self::Subtree(nodes) => nodes[0].bounds(),
            Self::Instance(bounds, _) => bounds,
        }
    }

    #[inline(always)]
    fn ids(&self) -> Option<std::ops::Range<usize>> {
        match self {
            Self::InnerNode(_) => None,
            Self::Subtree(nodes) => nodes[0].ids(),
            Self::Instance(_, name) => Some(*name..*name + 1),
        }
    }

    #[inline(always)]
    fn choices(&self) -> Choices {
        match self {
            Self::InnerNode(inner) => inner.choices,
            Self::Subtree(nodes) => nodes[0].choices(),
            Self::Instance(..) => unreachable!("a leaf"),
        }
    }

    #[inline(always)]
    fn children(&self) -> [Self; 2] {
        match self {
            Self::InnerNode(inner) => [Self::new(&inner.children[0]), Self::new(&inner.children[1])],
            Self::Subtree(nodes) => [Self::Subtree(&nodes[1..]), Self::Subtree(&nodes[nodes[0].right()..])],
            Self::Instance(..) => unreachable!("a leaf"),
        }
    }

    /// Whether the right child has a higher rank than the left.
    #[inline(always)]
    fn is_ranked(&self) -> bool {
        matches!(self, Self::InnerNode(inner) if inner.is_ranked)
    }
}

/// The children of a wide node.
struct Gathered<'a> {
    order: ChildOrder,
    children: [Cursor<'a>; WIDTH],
    keys: [(u8, f32); WIDTH],
    len: usize,
}

/// The order of the children.
#[derive(Clone, Copy, PartialEq, Eq)]
enum ChildOrder {
    /// By rank, and within a rank by size with the largest last. An any-hit search tests the last child first, because
    /// it is the likeliest hit.
    BySize,
    /// Any order: the children are only counted, or `occlusion_order` sorts them later because there are only triangles
    /// below.
    Any,
}

impl<'a> Gathered<'a> {
    #[inline(always)]
    fn put(&mut self, rank: u8, child: Cursor<'a>) {
        if self.order == ChildOrder::Any {
            self.children[self.len] = child;
            self.len += 1;
            return;
        }
        let key = (rank, child.bounds().half_area());
        let mut at = self.len;
        while at > 0 && self.keys[at - 1] > key {
            (self.children[at], self.keys[at]) = (self.children[at - 1], self.keys[at - 1]);
            at -= 1;
        }
        (self.children[at], self.keys[at]) = (child, key);
        self.len += 1;
    }
}

/// The size of a part of the tree.
#[derive(Clone, Copy, Default)]
struct Counts {
    nodes: usize,
    blocks: usize,
    sphere_blocks: usize,
    entries: usize,
}

impl std::ops::AddAssign for Counts {
    fn add_assign(&mut self, other: Self) {
        self.nodes += other.nodes;
        self.blocks += other.blocks;
        self.sphere_blocks += other.sphere_blocks;
        self.entries += other.entries;
    }
}

/// Minimum nodes of the binary tree to share the work among threads.
const MANY: usize = 1024;

/// A wide node over many primitives, with the sizes of its children.
struct Plan<'a> {
    children: [Cursor<'a>; WIDTH],
    len: usize,
    counts: [Counts; WIDTH],
    /// The plans of those children that have many nodes too.
    plans: [Option<Box<Self>>; WIDTH],
    total: Counts,
}

/// A tree whose blocks are not filled yet.
pub(crate) struct Layout {
    nodes: Vec<Node>,
    entries: Vec<Entry>,
    /// The ids of each block.
    spans: Vec<Span>,
    sphere_spans: Vec<Span>,
    root: u32,
}

/// Lays out a binary tree. The ids of instances come first. The recursion is as deep as the tree, which is bounded.
///
/// # Errors
/// [`BuildError::TooMany`] when there are more blocks than references can name.
pub(crate) fn lay_out(
    traits: &[Traits],
    binary: &Binary,
    ids: &[PrimitiveId],
    instances: &[Primitive],
) -> Result<Layout, BuildError> {
    let is_triangle = |traits: &Traits| traits.kind == Kind::Triangle;
    let order = if traits.iter().all(is_triangle) { ChildOrder::Any } else { ChildOrder::BySize };
    let packer = Packer { traits, ids, instances, order };
    let root = Cursor::new(binary);
    let plan = packer.plan(root);
    let total = plan.as_ref().map_or_else(|| packer.count(root), |plan| plan.total);
    if total.blocks.max(total.sphere_blocks) > tag::BLOCK_PLACES as usize {
        return Err(BuildError::TooMany);
    }
    let mut nodes = fill(total.nodes, Node::EMPTY);
    let mut spans = vec![Span { first: 0, count: 0 }; total.blocks];
    let mut sphere_spans = vec![Span { first: 0, count: 0 }; total.sphere_blocks];
    let mut entries = vec![Entry::new(0, 0, true); total.entries];
    let mut room = OutputSlices {
        nodes: &mut nodes,
        spans: &mut spans,
        sphere_spans: &mut sphere_spans,
        entries: &mut entries,
        start: Counts::default(),
    };
    let root = match &plan {
        Some(plan) => packer.put_many(plan, room),
        None => packer.put(root, &mut room),
    };
    Ok(Layout { nodes, entries, spans, sphere_spans, root })
}

impl Layout {
    /// Fills the blocks, and sorts the children of nodes by their contents. Blocks are most of the tree's memory: only
    /// the ids are left of the build's data by now, and they are freed before the triangles are packed.
    pub(crate) fn pack(
        self,
        isa: Isa,
        tree_space: &TreeSpace,
        geometries: &[Geometry],
        ids: Vec<PrimitiveId>,
    ) -> Packed {
        let Self { nodes, entries, spans, sphere_spans, root } = self;
        let named = |spans: Vec<Span>| -> Vec<BlockIds> {
            let name = |span: &Span| BlockIds::of(&ids[span.first as usize..][..span.count as usize]);
            spans.par_iter().with_min_len(pack::share_of(spans.len())).map(name).collect()
        };
        let (block_ids, sphere_ids) = (named(spans), named(sphere_spans));
        drop(ids);
        let block = |ids: &BlockIds| fill_sphere_block(cloud(geometries, ids.geometry), ids);
        let sphere_blocks: Vec<_> = sphere_ids.par_iter().with_min_len(256).map(block).collect();
        let mut packed = Packed {
            nodes: nodes.into(),
            blocks: Store::default(),
            ids: block_ids.into(),
            entries: entries.into(),
            sphere_blocks: sphere_blocks.into(),
            sphere_ids: sphere_ids.into(),
            root: Some(root),
        };
        packed.pack_triangles(isa, geometries, false);
        let Packed { nodes, blocks, .. } = &mut packed;
        occlusion_order::sort_children(isa, tree_space, nodes.to_mut(), Blocks::new(blocks));
        packed
    }
}

/// A new tree over existing leaves.
pub(crate) struct Relaid {
    pub(crate) nodes: Vec<Node>,
    pub(crate) entries: Vec<Entry>,
    pub(crate) root: u32,
}

impl Layout {
    /// Replaces each sphere by a leaf of another tree. `leaf_of` maps the sphere's geometry to that leaf.
    pub(crate) fn over_leaves(self, ids: &[PrimitiveId], leaf_of: impl Fn(u32) -> u32) -> Relaid {
        let Self { mut nodes, entries, sphere_spans, mut root, .. } = self;
        let stands_for = |reference: &mut u32| {
            if *reference != Node::ABSENT && tag::of(*reference) == tag::SPHERES {
                let span = sphere_spans[tag::blocks(*reference).start];
                *reference = leaf_of(ids[span.first as usize][0]);
            }
        };
        nodes.iter_mut().flat_map(|node| &mut node.children).for_each(stands_for);
        stands_for(&mut root);
        Relaid { nodes, entries, root }
    }
}

fn cloud(geometries: &[Geometry], geometry: u32) -> &SphereCloud {
    match &geometries[geometry as usize].kind {
        GeometryKind::Spheres(cloud) => cloud,
        _ => unreachable!("spheres come from clouds"),
    }
}

#[inline(always)]
fn fill_sphere_block(cloud: &SphereCloud, ids: &BlockIds) -> SphereBlock {
    let mut block = SphereBlock::EMPTY;
    for (lane, primitive) in ids.primitives().enumerate() {
        block.put(lane, cloud.spheres[primitive as usize]);
    }
    block
}

/// The ids of a block, as a range.
#[derive(Clone, Copy)]
struct Span {
    first: u32,
    count: u32,
}

/// The output of a part of the tree; parts are taken from the front.
struct OutputSlices<'a> {
    nodes: &'a mut [Node],
    spans: &'a mut [Span],
    sphere_spans: &'a mut [Span],
    entries: &'a mut [Entry],
    /// Positions of the first elements in the whole tree.
    start: Counts,
}

impl<'a> OutputSlices<'a> {
    /// Splits off the first part.
    fn take(&mut self, counts: Counts) -> Self {
        let nodes = self.nodes.split_off_mut(..counts.nodes).unwrap_or_default();
        let spans = self.spans.split_off_mut(..counts.blocks).unwrap_or_default();
        let sphere_spans = self.sphere_spans.split_off_mut(..counts.sphere_blocks).unwrap_or_default();
        let entries = self.entries.split_off_mut(..counts.entries).unwrap_or_default();
        let start = self.start;
        self.start += counts;
        OutputSlices { nodes, spans, sphere_spans, entries, start }
    }
}

struct Packer<'a> {
    traits: &'a [Traits],
    ids: &'a [PrimitiveId],
    instances: &'a [Primitive],
    /// The order of the children that are written.
    order: ChildOrder,
}

impl<'a> Packer<'a> {
    /// The instances of a leaf with several: each gets a leaf of its own.
    #[inline(always)]
    fn instances_of(&self, leaf: Cursor<'a>) -> Option<(usize, &'a [Primitive])> {
        let ids = leaf.ids().filter(|ids| ids.len() > 1)?;
        Some((ids.start, self.instances.get(ids)?))
    }

    /// The ids, if this becomes a leaf of the wide tree.
    #[inline(always)]
    fn leaf(&self, cursor: Cursor<'a>) -> Option<std::ops::Range<usize>> {
        if self.instances_of(cursor).is_some() { None } else { cursor.ids() }
    }

    /// The wide children of a node that is no leaf of the wide tree.
    #[inline(always)]
    fn gather(&self, root: Cursor<'a>, order: ChildOrder) -> ([Cursor<'a>; WIDTH], usize) {
        let mut found = Gathered { order, children: [root; WIDTH], keys: [(0, 0.0); WIDTH], len: 0 };
        let mut pending = [(root, WIDTH, 0); WIDTH];
        let mut waiting = 1;
        while waiting > 0 {
            waiting -= 1;
            let (cursor, room, rank) = pending[waiting];
            if cursor.ids().is_some() {
                match self.instances_of(cursor) {
                    Some((first, instances)) if instances.len() <= room => {
                        for (name, instance) in (first..).zip(instances) {
                            found.put(rank, Cursor::Instance(instance, name));
                        }
                    }
                    _ => found.put(rank, cursor),
                }
                continue;
            }
            let first = if room > 1 { cursor.choices().left(room) } else { 0 };
            if first == 0 {
                found.put(rank, cursor);
                continue;
            }
            let [left, right] = cursor.children();
            // Rank splits at the root have the most slots. Lower ranks are on the left.
            let above = match cursor.is_ranked() {
                true if room == WIDTH => 2,
                true => 1,
                false => rank,
            };
            pending[waiting] = (right, room - first, above);
            pending[waiting + 1] = (left, first, rank);
            waiting += 2;
        }
        (found.children, found.len)
    }

    /// `None` for a leaf, or a node over few primitives.
    fn plan(&self, root: Cursor<'a>) -> Option<Box<Plan<'a>>> {
        let Cursor::InnerNode(InnerNode { nodes: MANY.., .. }) = root else { return None };
        let (children, len) = self.gather(root, self.order);
        let mut plans: [Option<Box<Plan>>; WIDTH] = Default::default();
        let mut counts = [Counts::default(); WIDTH];
        plans[..len].par_iter_mut().zip(&mut counts[..len]).zip(&children[..len]).for_each(
            |((plan, counts), &child)| {
                *plan = self.plan(child);
                *counts = plan.as_ref().map_or_else(|| self.count(child), |plan| plan.total);
            },
        );
        let mut total = Counts { nodes: 1, ..Counts::default() };
        counts.iter().for_each(|&counts| total += counts);
        Some(Box::new(Plan { children, len, counts, plans, total }))
    }

    fn count(&self, root: Cursor<'a>) -> Counts {
        if let Some(ids) = self.leaf(root) {
            let kind = self.traits[self.ids[ids.start][0] as usize].kind;
            return match kind {
                Kind::Triangle => Counts { blocks: ids.len().div_ceil(BLOCK), ..Counts::default() },
                Kind::Sphere => Counts { sphere_blocks: ids.len().div_ceil(BLOCK), ..Counts::default() },
                Kind::Shape | Kind::Instance | Kind::Custom | Kind::Precise => {
                    Counts { entries: ids.len(), ..Counts::default() }
                }
            };
        }
        let (children, len) = self.gather(root, ChildOrder::Any);
        let mut total = Counts { nodes: 1, ..Counts::default() };
        children[..len].iter().for_each(|&child| total += self.count(child));
        total
    }

    fn put_many(&self, plan: &Plan<'a>, mut room: OutputSlices) -> u32 {
        let place = room.start.nodes;
        let own = room.take(Counts { nodes: 1, ..Counts::default() });
        let rooms: Vec<OutputSlices> =
            plan.counts[..plan.len].iter().map(|&counts| room.take(counts)).collect();
        let mut references = [Node::ABSENT; WIDTH];
        references[..plan.len]
            .par_iter_mut()
            .zip(rooms)
            .zip(&plan.plans[..plan.len])
            .zip(&plan.children[..plan.len])
            .for_each(|(((reference, mut room), plan), &child)| {
                *reference = match plan {
                    Some(plan) => self.put_many(plan, room),
                    None => self.put(child, &mut room),
                };
            });
        own.nodes[0] = node_over(&plan.children[..plan.len], references);
        tag::reference(tag::INNER, place as u32)
    }

    fn put(&self, root: Cursor<'a>, room: &mut OutputSlices) -> u32 {
        if let Some(ids) = self.leaf(root) {
            return self.put_leaf(ids, room);
        }
        let (children, len) = self.gather(root, self.order);
        let place = room.start.nodes;
        let own = room.take(Counts { nodes: 1, ..Counts::default() });
        let mut references = [Node::ABSENT; WIDTH];
        for (reference, &child) in references.iter_mut().zip(&children[..len]) {
            *reference = self.put(child, room);
        }
        own.nodes[0] = node_over(&children[..len], references);
        tag::reference(tag::INNER, place as u32)
    }

    fn put_leaf(&self, ids: std::ops::Range<usize>, room: &mut OutputSlices) -> u32 {
        let (first, count) = (ids.start as u32, ids.len() as u32);
        let ids = &self.ids[ids];
        let tag = match self.traits[ids[0][0] as usize].kind {
            Kind::Triangle => {
                let block = room.start.blocks as u32;
                let blocks = ids.len().div_ceil(BLOCK);
                let own = room.take(Counts { blocks, ..Counts::default() });
                cut(own.spans, first, count);
                return tag::triangles(block, blocks as u32);
            }
            Kind::Sphere => {
                let block = room.start.sphere_blocks as u32;
                let sphere_blocks = ids.len().div_ceil(BLOCK);
                let own = room.take(Counts { sphere_blocks, ..Counts::default() });
                cut(own.sphere_spans, first, count);
                return tag::spheres(block, sphere_blocks as u32);
            }
            Kind::Shape => tag::SHAPES,
            Kind::Instance => tag::INSTANCE,
            Kind::Custom => tag::CUSTOM,
            Kind::Precise => tag::PRECISE,
        };
        let place = room.start.entries as u32;
        let own = room.take(Counts { entries: ids.len(), ..Counts::default() });
        for (i, (entry, name)) in own.entries.iter_mut().zip(ids).enumerate() {
            *entry = Entry::new(name[0], name[1], i + 1 == ids.len());
        }
        tag::reference(tag, place)
    }
}

/// Divides ids among blocks.
#[inline(always)]
fn cut(spans: &mut [Span], first: u32, count: u32) {
    for (i, span) in spans.iter_mut().enumerate() {
        let before = (i * BLOCK) as u32;
        *span = Span { first: first + before, count: (count - before).min(BLOCK as u32) };
    }
}

/// A node with these children.
#[inline(always)]
fn node_over(children: &[Cursor], references: [u32; WIDTH]) -> Node {
    let mut node = Node { children: references, ..Node::EMPTY };
    for (lane, child) in children.iter().enumerate() {
        child.bounds().put(&mut node, lane);
    }
    node
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::build::binary_node::choose;
    use crate::tests::scenes::Random;

    /// A binary tree over boxes, depth first.
    fn grow(
        random: &mut Random,
        count: usize,
        low: [f32; 3],
        size: f32,
        nodes: &mut Vec<BinaryNode>,
    ) -> Bounds {
        if count == 1 {
            let high = low.map(|x| x + size * random.unit() as f32);
            let bounds = Bounds::new(low, high, 0, 0);
            nodes.push(BinaryNode::leaf(&bounds, 0, 1));
            return bounds;
        }
        let place = nodes.len();
        nodes.push(BinaryNode::inner(&Bounds::EMPTY, 0));
        let left = 1 + random.below(count - 1);
        let corner = low.map(|x| x + 0.5 * size * random.unit() as f32);
        let mut bounds = grow(random, left, low, 0.7 * size, nodes);
        let right_place = nodes.len() - place;
        bounds.grow(&grow(random, count - left, corner, 0.7 * size, nodes));
        nodes[place] = BinaryNode::inner(&bounds, right_place);
        bounds
    }

    /// The summed areas of the wide nodes of a subtree that follows its choices with `room` slots.
    fn cost_by_choices(nodes: &[BinaryNode], room: usize) -> f64 {
        if nodes[0].ids().is_some() {
            return 0.0;
        }
        let first = if room > 1 { nodes[0].choices().left(room) } else { 0 };
        if first == 0 {
            return f64::from(nodes[0].bounds().half_area()) + cost_by_choices(nodes, WIDTH);
        }
        assert!(first < room, "{first} of {room}");
        cost_by_choices(&nodes[1..], first) + cost_by_choices(&nodes[nodes[0].right()..], room - first)
    }

    /// The least possible areas for each number of slots.
    fn least_costs(nodes: &[BinaryNode]) -> [f64; WIDTH] {
        if nodes[0].ids().is_some() {
            return [0.0; WIDTH];
        }
        let (left, right) = (least_costs(&nodes[1..]), least_costs(&nodes[nodes[0].right()..]));
        let shared = |room: usize| {
            (1..room).map(|first| left[first] + right[room - first]).fold(f64::INFINITY, f64::min)
        };
        let as_one = f64::from(nodes[0].bounds().half_area()) + shared(WIDTH);
        std::array::from_fn(|room| if room < 2 { as_one } else { as_one.min(shared(room)) })
    }

    #[test]
    fn choices_cost_as_computed_and_hardly_more_than_optimal() {
        let mut random = Random(401);
        let (mut sum, mut least) = (0.0, 0.0);
        for round in 0..200 {
            let mut nodes = Vec::new();
            let count = 2 + random.below(if round % 4 == 0 { 20 } else { 400 });
            grow(&mut random, count, [-0.5; 3], 0.5, &mut nodes);
            let said = f64::from(choose(&mut nodes, false)[1]);
            let found = cost_by_choices(&nodes, 1);
            assert!((said - found).abs() <= 1e-4 * found, "{said} said, {found} found");
            let best = least_costs(&nodes)[1];
            assert!(found >= best * (1.0 - 1e-6), "{found} is less than {best}");
            (sum, least) = (sum + found, least + best);
        }
        assert!(sum < 1.01 * least, "{sum} where {least} would do");
    }
}
