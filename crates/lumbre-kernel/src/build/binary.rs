//! Builds the binary tree. The result is the same for any number of threads.
//!
//! One thread builds each subtree of a few thousand primitives. Above them, threads share the work on a node. How the
//! work is shared does not change the result: boxes grow in any order, costs are whole numbers, and primitives are
//! partitioned in pieces of fixed length. The depth is bounded: below [`SAH_DEPTH`] levels every split is in the
//! middle.

use std::borrow::Cow;

use rayon::prelude::*;

use crate::build::binary_node::{BinaryNode, Costs, Known, choose};
use crate::build::binary_tree::{Binary, InnerNode, SAH_DEPTH, Subtree};
use crate::build::boxes::{Boxes, fill};
use crate::build::morton::{self, Code};
use crate::build::options::Preset;
use crate::build::partition::part;
use crate::build::primitive::{Bounds, Kind, Primitive, Traits};
use crate::build::reinsert::reinsert;
use crate::build::sah::{BestSplit, Binning, Bins, Centers, Fill, FindCenters, Part, Split};
use crate::build::small::{SMALL_BUILD_MAX, SmallSplit, SplitSmall, group_of};
use crate::build::treelet;
use crate::intersect::Isa;
use crate::tree::PrimitiveId;

/// `Fast` uses SAH at or below this many primitives. That makes leaves a tenth fuller and nodes fewer, for a twentieth
/// of the build time.
const FAST_FEW: usize = 48;
/// Threads share the work above this many primitives.
pub(crate) const PARALLEL: usize = 4096;
/// Minimum primitives per thread in a small build.
const MIN_ALONE: usize = 1024;
/// Primitives per task in a shared node.
const CHUNK: usize = 1 << 12;

/// A binary tree and the contents of its leaves.
pub(crate) struct GrownTree<'p> {
    pub(crate) tree: Binary<'p>,
    /// In the order of the leaves.
    pub(crate) ids: Vec<PrimitiveId>,
    /// Instances with their boxes; their ids come first.
    pub(crate) instances: Vec<Primitive>,
}

/// Builds the binary tree over packed primitives and all others. There must be at least one primitive.
///
/// Primitives are first partitioned in place until one thread can build each remaining subtree. The nodes and ids of a
/// packed subtree overwrite its primitives: they take about half of that memory, and large builds free the other half.
/// Other subtrees usually have more nodes than primitives; their primitives are freed here, before the layout, except
/// those of instances.
pub(crate) fn binary_tree<'p>(
    isa: Isa,
    preset: Preset,
    mut others: Vec<Primitive>,
    packed: &'p mut Boxes,
    traits: &[Traits],
) -> GrownTree<'p> {
    // Enough shared levels for one node per thread.
    let shared = (2 * rayon::current_num_threads()).ilog2();
    let shared = if shared > 1 { shared + 1 } else { 0 };
    let all = others.len() + packed.len();
    let alone = if all <= PARALLEL { PARALLEL } else { (all / 8).clamp(MIN_ALONE, PARALLEL) };
    let builder = &Builder { isa, traits, shared, alone };
    let counts = sort_by_rank(&mut others, traits);
    let first_packed = others.len();
    let mut ids: Vec<PrimitiveId> = vec![[0; 2]; first_packed];
    let packed = (!packed.is_empty()).then_some(packed);
    let of_others = || builder.trees_by_rank(preset, &mut others, &counts, &mut ids);
    let of_packed = || packed.map(|packed| builder.tree_of_packed(preset, packed, first_packed));
    // Skips the thread pool when there is only one task.
    let (mut trees, packed_tree) =
        if first_packed > 0 { rayon::join(of_others, of_packed) } else { (Vec::new(), of_packed()) };
    others.truncate(counts[Kind::Instance.rank()]);
    others.shrink_to_fit();
    if let Some(PackedTree { tree, ids: packed_ids }) = packed_tree {
        ids = with_all(ids, &packed_ids);
        trees.push(tree);
    }
    let better = |tree| if preset == Preset::Best { reinsert(tree) } else { tree };
    let join = |low, high| {
        Binary::InnerNode(Box::new(InnerNode { is_ranked: true, ..InnerNode::over([low, high]) }))
    };
    let tree = trees.into_iter().map(better).reduce(join).expect("there are primitives");
    GrownTree { tree, ids, instances: others }
}

/// Joins the ids of both lists.
fn with_all(first: Vec<PrimitiveId>, others: &[&[PrimitiveId]]) -> Vec<PrimitiveId> {
    let mut ids = fill(first.len() + others.iter().map(|others| others.len()).sum::<usize>(), [0; 2]);
    let (place, mut rest) = ids.split_at_mut(first.len());
    place.copy_from_slice(&first);
    let places: Vec<&mut [PrimitiveId]> = others.iter().map(|others| take(&mut rest, others.len())).collect();
    places.into_par_iter().zip(others).for_each(|(place, others)| place.copy_from_slice(others));
    ids
}

/// Splits off the first `count` elements.
fn take<'a, T>(rest: &mut &'a mut [T], count: usize) -> &'a mut [T] {
    rest.split_off_mut(..count).unwrap_or_default()
}

/// Sorts unpacked primitives by rank and returns the number of each rank.
///
/// Each rank has a tree of its own. Otherwise boxes of one kind would grow around scattered primitives of another, such
/// as trees on a ground. A separate tree also lets an any-hit search test cheap primitives first.
fn sort_by_rank(primitives: &mut [Primitive], traits: &[Traits]) -> [usize; Kind::RANKS] {
    let rank = |primitive: &Primitive| traits[primitive.first() as usize].kind.rank();
    let mut counts = [0; Kind::RANKS];
    primitives.iter().for_each(|primitive| counts[rank(primitive)] += 1);
    if !counts.contains(&primitives.len()) {
        primitives.sort_by_key(rank);
    }
    counts
}

/// The top of the tree, above the subtrees that are still to be built.
enum SplitPlan {
    InnerNode(Box<[SplitPlan; 2]>),
    Subtree(PendingSubtree),
}

/// A subtree that is still to be built.
struct PendingSubtree {
    count: usize,
    depth: u32,
    /// The binning, if the parent's split determines it.
    binning: Option<Binning>,
    /// Whether to split by the order along the Morton curve instead.
    is_sorted: bool,
}

impl SplitPlan {
    /// Collects the subtrees in order. The recursion of this and of [`Self::over`] is as deep as the tree.
    fn pending_subtrees<'a>(&'a self, pending_subtrees: &mut Vec<&'a PendingSubtree>) {
        match self {
            Self::InnerNode(sides) => sides.iter().for_each(|side| side.pending_subtrees(pending_subtrees)),
            Self::Subtree(pending) => pending_subtrees.push(pending),
        }
    }

    /// Joins the finished subtrees, given in order.
    fn over<'p>(&self, subtrees: &mut impl Iterator<Item = Binary<'p>>) -> Binary<'p> {
        match self {
            Self::InnerNode(sides) => {
                let [left, right] = &**sides;
                let left = left.over(subtrees);
                Binary::over([left, right.over(subtrees)])
            }
            Self::Subtree(_) => subtrees.next().expect("there is one for each seed"),
        }
    }
}

/// Primitives to build a tree over, and slots for the ids in its leaves.
struct TreeInput<'a> {
    primitives: &'a mut [Primitive],
    /// `None` when ids and nodes overwrite the primitives.
    ids: Option<&'a mut [PrimitiveId]>,
    /// Index of the first id.
    first: usize,
    /// Whether to keep the primitives, in the order of the ids.
    keeps: bool,
    /// Whether reinsertion may move parts of these subtrees.
    moves: bool,
}

/// A finished subtree, either in the slots of its primitives or in memory of its own.
struct GrownSubtree {
    /// Number of primitives.
    count: usize,
    /// `Ok` has the number of nodes in the primitives' slots, in front of the ids. `Err` has the nodes themselves.
    nodes: Result<usize, Vec<BinaryNode>>,
    costs: Costs,
    known: Known,
}

impl GrownSubtree {
    /// Primitive slots that the nodes and ids take: never more than there are.
    fn len(&self) -> usize {
        self.nodes_there() + slots_for_ids(self.count)
    }

    fn nodes_there(&self) -> usize {
        self.nodes.as_ref().map_or(0, |&count| count)
    }
}

/// Primitive slots needed to store this many ids.
fn slots_for_ids(count: usize) -> usize {
    (count * size_of::<PrimitiveId>()).div_ceil(size_of::<Primitive>())
}

/// The tree over packed primitives, and the ids in its leaves by subtree.
struct PackedTree<'p> {
    tree: Binary<'p>,
    ids: Vec<&'p [PrimitiveId]>,
}

/// At or above this many packed primitives, unused slots are freed before more memory is allocated. Lower in tests.
const MANY: usize = if cfg!(test) { 1 << 13 } else { 1 << 20 };

/// The primitives of a node, and a buffer of the same length for its children's.
struct Range<'a> {
    here: &'a mut [Primitive],
    there: &'a mut [Primitive],
    ids: &'a mut [PrimitiveId],
    /// Index of the first id.
    first: usize,
    depth: u32,
    /// Whether `there` is the primitives' original place.
    is_away: bool,
}

impl<'a> Range<'a> {
    fn len(&self) -> usize {
        self.here.len()
    }

    /// The two sides of a split that moved the primitives into the buffer.
    fn moved(self, left: usize) -> [Self; 2] {
        Self { here: self.there, there: self.here, is_away: !self.is_away, ..self }.cut(left)
    }

    /// The two sides of a split in place.
    fn cut(self, left: usize) -> [Self; 2] {
        let (here, here_right) = self.here.split_at_mut(left);
        let (there, there_right) = self.there.split_at_mut(left);
        let (ids, ids_right) = self.ids.split_at_mut(left);
        let (first, depth, is_away) = (self.first, self.depth + 1, self.is_away);
        let (right, place) = (here_right, first + left);
        [
            Self { here, there, ids, first, depth, is_away },
            Self { here: right, there: there_right, ids: ids_right, first: place, depth, is_away },
        ]
    }
}

struct Builder<'a> {
    isa: Isa,
    traits: &'a [Traits],
    /// Levels of the tree whose nodes threads share. The result does not depend on it.
    shared: u32,
    /// Up to this many primitives, one thread builds the subtree.
    alone: usize,
}

/// The memory of one thread for building subtrees.
struct ThreadScratch {
    nodes: Vec<BinaryNode>,
    bins: Box<Bins>,
    /// Buffer for the primitives of one subtree.
    there: Vec<Primitive>,
    /// Buffer for their ids.
    ids: Vec<PrimitiveId>,
}

/// The rest of a thread's memory, without those two buffers.
struct SubtreeScratch<'w> {
    nodes: &'w mut Vec<BinaryNode>,
    bins: &'w mut Bins,
}

impl ThreadScratch {
    /// For subtrees of at most `most` primitives.
    fn new(most: usize) -> Self {
        let ids = vec![[0; 2]; most];
        // Packed primitives usually need somewhat fewer nodes. A growing vector would need twice its memory for a
        // moment.
        let nodes = Vec::with_capacity(most / 3);
        Self { nodes, bins: Box::new(Bins::EMPTY), there: vec![Bounds::EMPTY; most], ids }
    }
}

impl Builder<'_> {
    /// Builds a tree for each rank that has unpacked primitives. The primitives are sorted by rank; `counts` has the
    /// number of each.
    fn trees_by_rank(
        &self,
        preset: Preset,
        mut primitives: &mut [Primitive],
        counts: &[usize],
        mut ids: &mut [PrimitiveId],
    ) -> Vec<Binary<'static>> {
        let mut trees = Vec::with_capacity(Kind::RANKS);
        let mut first = 0;
        for (rank, &count) in counts.iter().enumerate().filter(|&(_, &count)| count > 0) {
            let (primitives, ids) = (take(&mut primitives, count), take(&mut ids, count));
            let mut codes = Vec::new();
            if preset == Preset::Fast {
                let mut sorted = vec![Bounds::EMPTY; primitives.len()];
                codes = self.sort(primitives, &mut sorted);
                primitives.copy_from_slice(&sorted);
            }
            let keeps = rank == Kind::Instance.rank();
            let ids = Some(ids);
            // Only single-instance leaves can be reinserted later.
            trees.push(if keeps && preset != Preset::Best {
                let plan = self.plan_sorted::<false>(primitives, 0, &codes);
                self.grow::<false>(&plan, &codes, TreeInput { primitives, ids, first, keeps, moves: false })
            } else {
                let plan = self.plan_sorted::<true>(primitives, 0, &codes);
                self.grow::<true>(&plan, &codes, TreeInput { primitives, ids, first, keeps, moves: false })
            });
            first += count;
        }
        trees
    }

    /// Builds the tree of packed primitives. `first` is the index of its first id.
    fn tree_of_packed<'p>(&self, preset: Preset, primitives: &'p mut Boxes, first: usize) -> PackedTree<'p> {
        let mut codes = Vec::new();
        if preset == Preset::Fast {
            let mut sorted = Boxes::empty(primitives.len());
            codes = self.sort(primitives, &mut sorted);
            *primitives = sorted;
        }
        let plan = self.plan_sorted::<false>(primitives, 0, &codes);
        let moves = preset != Preset::Fast && treelet::is_tried(primitives.len());
        let input = TreeInput { primitives, ids: None, first, keeps: false, moves };
        let subtrees = self.subtrees::<false>(&plan, &codes, input);
        drop(codes);
        let count = primitives.len();
        let is_compact = count >= MANY;
        if is_compact {
            let (mut from, mut to) = (0, 0);
            for subtree in &subtrees {
                primitives.copy_within(from..from + subtree.len(), to);
                (from, to) = (from + subtree.count, to + subtree.len());
            }
            primitives.shorten(to);
        }
        let mut rest = &primitives[..];
        let mut ids = Vec::with_capacity(subtrees.len());
        let mut binaries = Vec::with_capacity(subtrees.len());
        for subtree in subtrees {
            let own =
                rest.split_off(..if is_compact { subtree.len() } else { subtree.count }).unwrap_or_default();
            let (nodes, behind) = own.split_at(subtree.nodes_there());
            ids.push(&bytemuck::cast_slice(behind)[..subtree.count]);
            let nodes = match subtree.nodes {
                Ok(_) => Cow::Borrowed(bytemuck::cast_slice(nodes)),
                Err(nodes) => Cow::Owned(nodes),
            };
            binaries.push(Binary::Subtree(Subtree { nodes, costs: subtree.costs, known: subtree.known }));
        }
        let tree = plan.over(&mut binaries.into_iter());
        PackedTree { tree: if moves { treelet::reinsert_upper(tree, count) } else { tree }, ids }
    }

    /// Sorts the primitives along the Morton curve into `sorted`, and returns their codes.
    fn sort(&self, primitives: &[Primitive], sorted: &mut [Primitive]) -> Vec<Code> {
        let centers = self.centers(primitives);
        morton::sort(primitives, sorted, &centers)
    }

    /// Splits along the Morton curve while codes differ. The recursion is at most as deep as a code has bits, plus that
    /// of [`Builder::plan`].
    fn plan_sorted<const COSTS: bool>(
        &self,
        primitives: &mut [Primitive],
        depth: u32,
        codes: &[Code],
    ) -> SplitPlan {
        let count = primitives.len();
        if count <= self.alone {
            return SplitPlan::Subtree(PendingSubtree { count, depth, binning: None, is_sorted: true });
        }
        let Some(middle) = morton::cut(codes) else { return self.plan::<COSTS>(primitives, depth, None) };
        let (left, right) = primitives.split_at_mut(middle);
        let (left_codes, right_codes) = codes.split_at(middle);
        let (left, right) = rayon::join(
            || self.plan_sorted::<COSTS>(left, depth + 1, left_codes),
            || self.plan_sorted::<COSTS>(right, depth + 1, right_codes),
        );
        SplitPlan::InnerNode(Box::new([left, right]))
    }

    /// `binning` is the binning of the primitives, if the parent's split determines it.
    fn plan<const COSTS: bool>(
        &self,
        primitives: &mut [Primitive],
        depth: u32,
        binning: Option<Binning>,
    ) -> SplitPlan {
        let count = primitives.len();
        if count <= self.alone {
            return SplitPlan::Subtree(PendingSubtree { count, depth, binning, is_sorted: false });
        }
        let ([left, right], [left_binning, right_binning]) = self.divide::<COSTS>(primitives, depth, binning);
        let (left, right) = rayon::join(
            || self.plan::<COSTS>(left, depth + 1, left_binning),
            || self.plan::<COSTS>(right, depth + 1, right_binning),
        );
        SplitPlan::InnerNode(Box::new([left, right]))
    }

    /// Splits one shared node. Not inlined: the bins would stay on the stack during the recursion.
    #[inline(never)]
    fn divide<'p, const COSTS: bool>(
        &self,
        primitives: &'p mut [Primitive],
        depth: u32,
        binning: Option<Binning>,
    ) -> ([&'p mut [Primitive]; 2], [Option<Binning>; 2]) {
        let mut bins = Bins::EMPTY;
        let Some(split) = self.split::<COSTS>(primitives, depth, binning, &mut bins) else {
            let middle = self.by_order(primitives);
            let (left, right) = primitives.split_at_mut(middle);
            return ([left, right], [None; 2]);
        };
        part(self.isa, primitives, &split, depth < self.shared);
        let (left, right) = primitives.split_at_mut(split.left);
        let binnings = [split.next(0, left.len()), split.next(1, right.len())];
        ([left, right], binnings.map(Some))
    }

    /// Builds the planned tree. `codes` are those of the primitives if they were sorted; the input has slots for ids.
    fn grow<const COSTS: bool>(&self, plan: &SplitPlan, codes: &[Code], input: TreeInput) -> Binary<'static> {
        let subtrees = self.subtrees::<COSTS>(plan, codes, input);
        let mut apart = subtrees.into_iter().map(|GrownSubtree { nodes, costs, known, .. }| {
            let nodes = Cow::Owned(nodes.expect_err("names have places of their own"));
            Binary::Subtree(Subtree { nodes, costs, known })
        });
        plan.over(&mut apart)
    }

    /// Builds the planned subtrees.
    fn subtrees<const COSTS: bool>(
        &self,
        plan: &SplitPlan,
        mut codes: &[Code],
        input: TreeInput,
    ) -> Vec<GrownSubtree> {
        let TreeInput { mut primitives, mut ids, mut first, keeps, moves } = input;
        let mut pending_subtrees = Vec::new();
        plan.pending_subtrees(&mut pending_subtrees);
        let most = pending_subtrees.iter().map(|pending| pending.count).max().unwrap_or_default();
        let mut inputs = Vec::with_capacity(pending_subtrees.len());
        for pending in pending_subtrees {
            let codes = codes.split_off(..pending.count).unwrap_or_default();
            let own = take(&mut primitives, pending.count);
            let ids = ids.as_mut().map(|ids| take(ids, pending.count));
            inputs.push((pending, codes, TreeInput { primitives: own, ids, first, keeps, moves }));
            first += pending.count;
        }
        inputs
            .into_par_iter()
            .map_init(
                || ThreadScratch::new(most),
                |scratch, (pending, codes, input)| {
                    let ThreadScratch { nodes, bins, there, ids: own_ids } = scratch;
                    nodes.clear();
                    let there = &mut there[..pending.count];
                    let TreeInput { primitives: own, ids, first, keeps, moves } = input;
                    let is_there = ids.is_none();
                    let ids = ids.unwrap_or(&mut own_ids[..pending.count]);
                    let range = Range {
                        here: &mut *own,
                        there,
                        ids: &mut *ids,
                        first,
                        depth: pending.depth,
                        is_away: false,
                    };
                    if pending.is_sorted {
                        self.subtree_sorted::<COSTS>(range, codes, &mut SubtreeScratch { nodes, bins });
                    } else {
                        let scratch = &mut SubtreeScratch { nodes, bins };
                        let split = pending.binning.and_then(|binning| {
                            self.binned::<COSTS>(range.here, binning, scratch.bins, range.depth)
                        });
                        self.subtree::<COSTS>(range, split, scratch);
                    }
                    let (costs, known) =
                        if moves { Known::choose(nodes) } else { (choose(nodes, keeps), Known::default()) };
                    let mut subtree =
                        GrownSubtree { count: pending.count, nodes: Ok(nodes.len()), costs, known };
                    // Both fit unless hardly any primitives share a leaf.
                    if !is_there || subtree.len() > own.len() {
                        subtree.nodes = Err(nodes.to_vec());
                    }
                    if is_there {
                        let (nodes_there, behind) = own.split_at_mut(subtree.nodes_there());
                        nodes_there.copy_from_slice(bytemuck::cast_slice(&nodes[..nodes_there.len()]));
                        bytemuck::cast_slice_mut(behind)[..ids.len()].copy_from_slice(ids);
                    }
                    subtree
                },
            )
            .collect()
    }

    fn subtree_sorted<const COSTS: bool>(
        &self,
        range: Range,
        codes: &[Code],
        scratch: &mut SubtreeScratch,
    ) -> Bounds {
        let count = range.len();
        if count <= FAST_FEW {
            return self.subtree::<COSTS>(range, None, scratch);
        }
        let Some(middle) = morton::cut(codes) else { return self.subtree::<COSTS>(range, None, scratch) };
        let place = scratch.nodes.len();
        scratch.nodes.push(BinaryNode(Bounds::EMPTY));
        let [left, right] = range.cut(middle);
        let (left_codes, right_codes) = codes.split_at(middle);
        let mut bounds = self.subtree_sorted::<COSTS>(left, left_codes, scratch);
        let right_place = scratch.nodes.len() - place;
        bounds.grow(&self.subtree_sorted::<COSTS>(right, right_codes, scratch));
        scratch.nodes[place] = BinaryNode::inner(&bounds, right_place);
        bounds
    }

    /// The cheapest split by these bins.
    fn binned<const COSTS: bool>(
        &self,
        primitives: &[Primitive],
        binning: Binning,
        bins: &mut Bins,
        depth: u32,
    ) -> Option<Split> {
        self.fill::<COSTS>(primitives, binning, bins, depth);
        self.isa.run(BestSplit::<COSTS> { bins, binning })
    }

    /// The split of a node, or `None` to split it by order.
    fn split<const COSTS: bool>(
        &self,
        primitives: &[Primitive],
        depth: u32,
        binning: Option<Binning>,
        bins: &mut Bins,
    ) -> Option<Split> {
        let split = binning.and_then(|binning| self.binned::<COSTS>(primitives, binning, bins, depth));
        self.known::<COSTS>(primitives, depth, split, bins)
    }

    /// As [`Self::split`], after a first attempt that may have found a split.
    #[inline]
    fn known<const COSTS: bool>(
        &self,
        primitives: &[Primitive],
        depth: u32,
        split: Option<Split>,
        bins: &mut Bins,
    ) -> Option<Split> {
        if depth >= SAH_DEPTH {
            return None;
        }
        // A small spread means that the estimated range was much too wide: measure it instead.
        if split.is_some_and(|split| split.occupied_bins > 4) {
            return split;
        }
        let centers = self.centers(primitives);
        if centers.coincide() {
            return None;
        }
        self.binned::<COSTS>(primitives, Binning::new(&centers, primitives.len()), bins, depth)
    }

    fn centers(&self, primitives: &[Primitive]) -> Centers {
        if primitives.len() <= CHUNK {
            return self.isa.run(FindCenters { primitives });
        }
        let (left, right) = primitives.split_at(primitives.len() / 2);
        let (mut centers, others) = rayon::join(|| self.centers(left), || self.centers(right));
        centers.grow(&others);
        centers
    }

    fn fill<const COSTS: bool>(
        &self,
        primitives: &[Primitive],
        binning: Binning,
        bins: &mut Bins,
        depth: u32,
    ) {
        if depth >= self.shared || primitives.len() <= CHUNK {
            let traits = self.traits;
            self.isa.run(Fill::<COSTS> { primitives, binning, bins, traits });
            return;
        }
        let (left, right) = primitives.split_at(primitives.len() / 2);
        let mut other = Bins::EMPTY;
        rayon::join(
            || self.fill::<COSTS>(left, binning, bins, depth),
            || self.fill::<COSTS>(right, binning, &mut other, depth),
        );
        bins.join(&other);
    }

    /// Builds a subtree on one thread and returns its box. The depth is bounded, and so is this recursion.
    fn subtree<const COSTS: bool>(
        &self,
        range: Range,
        split: Option<Split>,
        scratch: &mut SubtreeScratch,
    ) -> Bounds {
        let count = range.len();
        if count <= SMALL_BUILD_MAX {
            return self.small::<COSTS>(range, scratch);
        }
        let place = scratch.nodes.len();
        scratch.nodes.push(BinaryNode(Bounds::EMPTY));
        let split = self.known::<COSTS>(range.here, range.depth, split, scratch.bins);
        let ([left, right], splits) = match &split {
            Some(split) => {
                let (left, right) = range.there.split_at_mut(split.left);
                self.isa.run(Part { primitives: &*range.here, split, sides: [left, right] });
                let cut = range.moved(split.left);
                let splits = [0, 1].map(|side| {
                    let primitives = &*cut[side].here;
                    if primitives.len() <= SMALL_BUILD_MAX {
                        return None;
                    }
                    let binning = split.next(side, primitives.len());
                    self.binned::<COSTS>(primitives, binning, scratch.bins, cut[side].depth)
                });
                (cut, splits)
            }
            None => {
                let middle = self.by_order(range.here);
                (range.cut(middle), [None; 2])
            }
        };
        let mut bounds = self.subtree::<COSTS>(left, splits[0], scratch);
        let right_place = scratch.nodes.len() - place;
        bounds.grow(&self.subtree::<COSTS>(right, splits[1], scratch));
        scratch.nodes[place] = BinaryNode::inner(&bounds, right_place);
        bounds
    }

    fn small<const COSTS: bool>(&self, range: Range, scratch: &mut SubtreeScratch) -> Bounds {
        let traits = self.traits;
        let place = scratch.nodes.len();
        match self.isa.run(SplitSmall::<COSTS> { primitives: range.here, traits }) {
            SmallSplit::Leaf => {
                let mut bounds = Bounds::EMPTY;
                for (name, primitive) in range.ids.iter_mut().zip(&*range.here) {
                    *name = [primitive.first(), primitive.second()];
                    bounds.grow(primitive);
                }
                if range.is_away {
                    range.there.copy_from_slice(range.here);
                }
                scratch.nodes.push(BinaryNode::leaf(&bounds, range.first, range.ids.len()));
                bounds
            }
            SmallSplit::Split(left) => {
                scratch.nodes.push(BinaryNode(Bounds::EMPTY));
                let [left, right] = range.cut(left);
                let mut bounds = self.small::<COSTS>(left, scratch);
                let right_place = scratch.nodes.len() - place;
                bounds.grow(&self.small::<COSTS>(right, scratch));
                scratch.nodes[place] = BinaryNode::inner(&bounds, right_place);
                bounds
            }
        }
    }

    /// Splits in the middle by kind, then geometry, then along the longest axis. So leaves hold one kind even where all
    /// primitives coincide.
    fn by_order(&self, primitives: &mut [Primitive]) -> usize {
        let axis = self.centers(primitives).longest_axis();
        let group = |p: &Primitive| group_of(p, self.traits);
        let order = |a: &Primitive, b: &Primitive| {
            group(a)
                .cmp(&group(b))
                .then(a.center2_on(axis).cmp(&b.center2_on(axis)))
                .then((a.first(), a.second()).cmp(&(b.first(), b.second())))
        };
        let middle = primitives.len() / 2;
        primitives.select_nth_unstable_by(middle, order);
        middle
    }
}
