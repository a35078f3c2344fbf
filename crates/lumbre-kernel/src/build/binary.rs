//! From primitives to a binary tree: the same from any number of threads.
//!
//! Subtrees over few thousand primitives are made by one thread each; above them, threads share the work on a node. What is
//! done does not depend on how it is shared: boxes grow in any order, costs are whole numbers, and primitives are parted in
//! pieces of one length. The depth is bounded: past [`SAH_DEPTH`] levels every split is in the middle.

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
use crate::build::small::{FEW, SmallSplit, SplitSmall, group_of};
use crate::build::treelet;
use crate::intersect::Isa;
use crate::tree::Name;

/// A fast build splits up to this many primitives by SAH: leaves are a tenth fuller, and nodes fewer, for a twentieth of its time.
const FAST_FEW: usize = 48;
/// From how many primitives on threads share the work.
pub(crate) const PARALLEL: usize = 4096;
/// How few they leave to one of them, where there are not many more.
const MIN_ALONE: usize = 1024;
/// How many primitives a thread takes at a time in a node that is shared.
const CHUNK: usize = 1 << 12;

/// A binary tree, and what is in its leaves.
pub(crate) struct GrownTree<'p> {
    pub(crate) tree: Binary<'p>,
    /// In the order of leaves.
    pub(crate) names: Vec<Name>,
    /// Instances with their boxes; their names are the first.
    pub(crate) instances: Vec<Primitive>,
}

/// The binary tree over primitives (not none) of geometries: packed ones, and all others.
///
/// First they are parted where they stand until one thread takes what is left together; then twigs grow, which need but a
/// little room each. They take the place of their primitives with their names, as long as those are packed: half of the room, and
/// where there are many of them the other half is given back. Of others, there are more nodes than primitives as a rule: these
/// are given back here, before the tree is laid out, but for instances.
pub(crate) fn binary_tree<'p>(
    isa: Isa,
    preset: Preset,
    mut others: Vec<Primitive>,
    packed: &'p mut Boxes,
    traits: &[Traits],
) -> GrownTree<'p> {
    // Below, there is a node for every thread.
    let shared = (2 * rayon::current_num_threads()).ilog2();
    let shared = if shared > 1 { shared + 1 } else { 0 };
    let all = others.len() + packed.len();
    let alone = if all <= PARALLEL { PARALLEL } else { (all / 8).clamp(MIN_ALONE, PARALLEL) };
    let builder = &Builder { isa, traits, shared, alone };
    let counts = sort_by_rank(&mut others, traits);
    let first_packed = others.len();
    let mut names: Vec<Name> = vec![[0; 2]; first_packed];
    let packed = (!packed.is_empty()).then_some(packed);
    let of_others = || builder.trees_by_rank(preset, &mut others, &counts, &mut names);
    let of_packed = || packed.map(|packed| builder.tree_of_packed(preset, packed, first_packed));
    // Work for one is not handed over.
    let (mut trees, packed_tree) =
        if first_packed > 0 { rayon::join(of_others, of_packed) } else { (Vec::new(), of_packed()) };
    others.truncate(counts[Kind::Instance.rank()]);
    others.shrink_to_fit();
    if let Some(PackedTree { tree, names: packed_names }) = packed_tree {
        names = with_all(names, &packed_names);
        trees.push(tree);
    }
    let better = |tree| if preset == Preset::Best { reinsert(tree) } else { tree };
    let join = |low, high| {
        Binary::InnerNode(Box::new(InnerNode { is_ranked: true, ..InnerNode::over([low, high]) }))
    };
    let tree = trees.into_iter().map(better).reduce(join).expect("there are primitives");
    GrownTree { tree, names, instances: others }
}

/// Names, and others behind them.
fn with_all(first: Vec<Name>, others: &[&[Name]]) -> Vec<Name> {
    let mut names = fill(first.len() + others.iter().map(|others| others.len()).sum::<usize>(), [0; 2]);
    let (place, mut rest) = names.split_at_mut(first.len());
    place.copy_from_slice(&first);
    let places: Vec<&mut [Name]> = others.iter().map(|others| take(&mut rest, others.len())).collect();
    places.into_par_iter().zip(others).for_each(|(place, others)| place.copy_from_slice(others));
    names
}

/// The first `count` of some, which then are no longer among them.
fn take<'a, T>(rest: &mut &'a mut [T], count: usize) -> &'a mut [T] {
    rest.split_off_mut(..count).unwrap_or_default()
}

/// Brings primitives, none of which is packed, into the order of their ranks; how many there are of each.
///
/// Apart, because boxes of one kind do not grow around what is of another and everywhere among them, as trees on a ground
/// are; and so that a search for any hit asks first what is quickly asked.
fn sort_by_rank(primitives: &mut [Primitive], traits: &[Traits]) -> [usize; Kind::RANKS] {
    let rank = |primitive: &Primitive| traits[primitive.first() as usize].kind.rank();
    let mut counts = [0; Kind::RANKS];
    primitives.iter().for_each(|primitive| counts[rank(primitive)] += 1);
    if !counts.contains(&primitives.len()) {
        primitives.sort_by_key(rank);
    }
    counts
}

/// Which twigs there are to be, and what stands over them.
enum Sketch {
    InnerNode(Box<[Sketch; 2]>),
    Subtree(Seed),
}

/// A twig to be.
struct Seed {
    count: usize,
    depth: u32,
    /// How it is to be binned, where that is known.
    binning: Option<Binning>,
    /// Whether it is to be split by the order along a curve instead.
    is_sorted: bool,
}

impl Sketch {
    /// From the first to the last. The depth of its recursion, and of that of [`Self::over`], is that of the tree.
    fn seeds<'a>(&'a self, seeds: &mut Vec<&'a Seed>) {
        match self {
            Self::InnerNode(sides) => sides.iter().for_each(|side| side.seeds(seeds)),
            Self::Subtree(seed) => seeds.push(seed),
        }
    }

    /// The tree of its twigs, which come in their order.
    fn over<'p>(&self, twigs: &mut impl Iterator<Item = Binary<'p>>) -> Binary<'p> {
        match self {
            Self::InnerNode(sides) => {
                let [left, right] = &**sides;
                let left = left.over(twigs);
                Binary::over([left, right.over(twigs)])
            }
            Self::Subtree(_) => twigs.next().expect("there is one for each seed"),
        }
    }
}

/// Primitives of which a tree is to grow, and places for what is in its leaves.
struct Plot<'a> {
    primitives: &'a mut [Primitive],
    /// Without, names and nodes take the place of the primitives.
    names: Option<&'a mut [Name]>,
    /// The place of the first name.
    first: usize,
    /// Whether the primitives are to stay, in the order of names.
    keeps: bool,
    /// Whether subtrees of twigs may be put elsewhere.
    moves: bool,
}

/// A twig that has grown where its primitives stood, or apart.
struct GrownTwig {
    /// Of how many primitives.
    count: usize,
    /// How many there are in the place of the primitives, before their names; or the nodes themselves, which stand apart.
    nodes: Result<usize, Vec<BinaryNode>>,
    costs: Costs,
    known: Known,
}

impl GrownTwig {
    /// How much of the place of the primitives its nodes and names take: never more than there is.
    fn len(&self) -> usize {
        self.nodes_there() + units_of_names(self.count)
    }

    fn nodes_there(&self) -> usize {
        self.nodes.as_ref().map_or(0, |&count| count)
    }
}

/// Primitive slots needed to store this many ids.
fn units_of_names(count: usize) -> usize {
    (count * size_of::<Name>()).div_ceil(size_of::<Primitive>())
}

/// The tree over packed primitives, and what is in its leaves, piece by piece.
struct PackedTree<'p> {
    tree: Binary<'p>,
    names: Vec<&'p [Name]>,
}

/// From this many packed primitives on, the memory that they leave is freed before more is allocated. Lower in tests.
const MANY: usize = if cfg!(test) { 1 << 13 } else { 1 << 20 };

/// The primitives of a node of a twig, and as much room for those of its children.
struct Range<'a> {
    here: &'a mut [Primitive],
    there: &'a mut [Primitive],
    names: &'a mut [Name],
    /// The place of the first name.
    first: usize,
    depth: u32,
    /// Whether `there` is where they stood in the beginning.
    is_away: bool,
}

impl<'a> Range<'a> {
    fn len(&self) -> usize {
        self.here.len()
    }

    /// The two sides, where the primitives were moved over.
    fn moved(self, left: usize) -> [Self; 2] {
        Self { here: self.there, there: self.here, is_away: !self.is_away, ..self }.cut(left)
    }

    /// The two sides, where the primitives are as they were.
    fn cut(self, left: usize) -> [Self; 2] {
        let (here, here_right) = self.here.split_at_mut(left);
        let (there, there_right) = self.there.split_at_mut(left);
        let (names, names_right) = self.names.split_at_mut(left);
        let (first, depth, is_away) = (self.first, self.depth + 1, self.is_away);
        let (right, place) = (here_right, first + left);
        [
            Self { here, there, names, first, depth, is_away },
            Self { here: right, there: there_right, names: names_right, first: place, depth, is_away },
        ]
    }
}

struct Builder<'a> {
    isa: Isa,
    traits: &'a [Traits],
    /// Levels of the tree whose nodes threads share. What comes out does not depend on it.
    shared: u32,
    /// Up to this many primitives are left to one thread.
    alone: usize,
}

/// What one thread needs for twigs.
struct Workplace {
    nodes: Vec<BinaryNode>,
    bins: Box<Bins>,
    /// Room for the primitives of one.
    there: Vec<Primitive>,
    /// And for their names.
    names: Vec<Name>,
}

/// What a twig needs but for that room.
struct Tools<'w> {
    nodes: &'w mut Vec<BinaryNode>,
    bins: &'w mut Bins,
}

impl Workplace {
    /// For subtrees of at most this many primitives.
    fn new(most: usize) -> Self {
        let names = vec![[0; 2]; most];
        // Packed primitives have somewhat fewer nodes as a rule; what grows takes twice its room for a moment.
        let nodes = Vec::with_capacity(most / 3);
        Self { nodes, bins: Box::new(Bins::EMPTY), there: vec![Bounds::EMPTY; most], names }
    }
}

impl Builder<'_> {
    /// A tree of each rank that has primitives, none of which is packed. Primitives are in the order of their ranks; `counts` has the
    /// number of each.
    fn trees_by_rank(
        &self,
        preset: Preset,
        mut primitives: &mut [Primitive],
        counts: &[usize],
        mut names: &mut [Name],
    ) -> Vec<Binary<'static>> {
        let mut trees = Vec::with_capacity(Kind::RANKS);
        let mut first = 0;
        for (rank, &count) in counts.iter().enumerate().filter(|&(_, &count)| count > 0) {
            let (primitives, names) = (take(&mut primitives, count), take(&mut names, count));
            let mut codes = Vec::new();
            if preset == Preset::Fast {
                let mut sorted = vec![Bounds::EMPTY; primitives.len()];
                codes = self.sort(primitives, &mut sorted);
                primitives.copy_from_slice(&sorted);
            }
            let keeps = rank == Kind::Instance.rank();
            let names = Some(names);
            // Subtrees that are put elsewhere later are those of single instances.
            trees.push(if keeps && preset != Preset::Best {
                let sketch = self.sketch_sorted::<false>(primitives, 0, &codes);
                self.grow::<false>(&sketch, &codes, Plot { primitives, names, first, keeps, moves: false })
            } else {
                let sketch = self.sketch_sorted::<true>(primitives, 0, &codes);
                self.grow::<true>(&sketch, &codes, Plot { primitives, names, first, keeps, moves: false })
            });
            first += count;
        }
        trees
    }

    /// A tree of packed primitives, whose first name has this place.
    fn tree_of_packed<'p>(&self, preset: Preset, primitives: &'p mut Boxes, first: usize) -> PackedTree<'p> {
        let mut codes = Vec::new();
        if preset == Preset::Fast {
            let mut sorted = Boxes::empty(primitives.len());
            codes = self.sort(primitives, &mut sorted);
            *primitives = sorted;
        }
        let sketch = self.sketch_sorted::<false>(primitives, 0, &codes);
        let moves = preset != Preset::Fast && treelet::is_tried(primitives.len());
        let plot = Plot { primitives, names: None, first, keeps: false, moves };
        let twigs = self.twigs::<false>(&sketch, &codes, plot);
        drop(codes);
        let count = primitives.len();
        let is_compact = count >= MANY;
        if is_compact {
            let (mut from, mut to) = (0, 0);
            for twig in &twigs {
                primitives.copy_within(from..from + twig.len(), to);
                (from, to) = (from + twig.count, to + twig.len());
            }
            primitives.shorten(to);
        }
        let mut rest = &primitives[..];
        let mut names = Vec::with_capacity(twigs.len());
        let mut binaries = Vec::with_capacity(twigs.len());
        for twig in twigs {
            let own = rest.split_off(..if is_compact { twig.len() } else { twig.count }).unwrap_or_default();
            let (nodes, behind) = own.split_at(twig.nodes_there());
            names.push(&bytemuck::cast_slice(behind)[..twig.count]);
            let nodes = match twig.nodes {
                Ok(_) => Cow::Borrowed(bytemuck::cast_slice(nodes)),
                Err(nodes) => Cow::Owned(nodes),
            };
            binaries.push(Binary::Subtree(Subtree { nodes, costs: twig.costs, known: twig.known }));
        }
        let tree = sketch.over(&mut binaries.into_iter());
        PackedTree { tree: if moves { treelet::reinsert_upper(tree, count) } else { tree }, names }
    }

    /// Puts as many primitives in the order along a curve there; their codes.
    fn sort(&self, primitives: &[Primitive], sorted: &mut [Primitive]) -> Vec<Code> {
        let centers = self.centers(primitives);
        morton::sort(primitives, sorted, &centers)
    }

    /// Splits by the order along a curve as long as there are codes that differ. The depth of this recursion is at most that
    /// of the bits of a code, and then of [`Builder::sketch`].
    fn sketch_sorted<const COSTS: bool>(
        &self,
        primitives: &mut [Primitive],
        depth: u32,
        codes: &[Code],
    ) -> Sketch {
        let count = primitives.len();
        if count <= self.alone {
            return Sketch::Subtree(Seed { count, depth, binning: None, is_sorted: true });
        }
        let Some(middle) = morton::cut(codes) else { return self.sketch::<COSTS>(primitives, depth, None) };
        let (left, right) = primitives.split_at_mut(middle);
        let (left_codes, right_codes) = codes.split_at(middle);
        let (left, right) = rayon::join(
            || self.sketch_sorted::<COSTS>(left, depth + 1, left_codes),
            || self.sketch_sorted::<COSTS>(right, depth + 1, right_codes),
        );
        Sketch::InnerNode(Box::new([left, right]))
    }

    /// `binning` is how the primitives are to be binned, where that is known.
    fn sketch<const COSTS: bool>(
        &self,
        primitives: &mut [Primitive],
        depth: u32,
        binning: Option<Binning>,
    ) -> Sketch {
        let count = primitives.len();
        if count <= self.alone {
            return Sketch::Subtree(Seed { count, depth, binning, is_sorted: false });
        }
        let ([left, right], [left_binning, right_binning]) = self.divide::<COSTS>(primitives, depth, binning);
        let (left, right) = rayon::join(
            || self.sketch::<COSTS>(left, depth + 1, left_binning),
            || self.sketch::<COSTS>(right, depth + 1, right_binning),
        );
        Sketch::InnerNode(Box::new([left, right]))
    }

    /// One level of a node that threads share. Apart, so that its bins are not on the stack of what is below.
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

    /// The tree that was sketched. `codes` are those of the primitives, if they were sorted, and there are places for names.
    fn grow<const COSTS: bool>(&self, sketch: &Sketch, codes: &[Code], plot: Plot) -> Binary<'static> {
        let twigs = self.twigs::<COSTS>(sketch, codes, plot);
        let mut apart = twigs.into_iter().map(|GrownTwig { nodes, costs, known, .. }| {
            let nodes = Cow::Owned(nodes.expect_err("names have places of their own"));
            Binary::Subtree(Subtree { nodes, costs, known })
        });
        sketch.over(&mut apart)
    }

    /// The twigs that were sketched.
    fn twigs<const COSTS: bool>(&self, sketch: &Sketch, mut codes: &[Code], plot: Plot) -> Vec<GrownTwig> {
        let Plot { mut primitives, mut names, mut first, keeps, moves } = plot;
        let mut seeds = Vec::new();
        sketch.seeds(&mut seeds);
        let most = seeds.iter().map(|seed| seed.count).max().unwrap_or_default();
        let mut plots = Vec::with_capacity(seeds.len());
        for seed in seeds {
            let codes = codes.split_off(..seed.count).unwrap_or_default();
            let own = take(&mut primitives, seed.count);
            let names = names.as_mut().map(|names| take(names, seed.count));
            plots.push((seed, codes, Plot { primitives: own, names, first, keeps, moves }));
            first += seed.count;
        }
        plots
            .into_par_iter()
            .map_init(
                || Workplace::new(most),
                |work, (seed, codes, plot)| {
                    let Workplace { nodes, bins, there, names: own_names } = work;
                    nodes.clear();
                    let there = &mut there[..seed.count];
                    let Plot { primitives: own, names, first, keeps, moves } = plot;
                    let is_there = names.is_none();
                    let names = names.unwrap_or(&mut own_names[..seed.count]);
                    let range = Range {
                        here: &mut *own,
                        there,
                        names: &mut *names,
                        first,
                        depth: seed.depth,
                        is_away: false,
                    };
                    if seed.is_sorted {
                        self.twig_sorted::<COSTS>(range, codes, &mut Tools { nodes, bins });
                    } else {
                        let tools = &mut Tools { nodes, bins };
                        let split = seed.binning.and_then(|binning| {
                            self.binned::<COSTS>(range.here, binning, tools.bins, range.depth)
                        });
                        self.twig::<COSTS>(range, split, tools);
                    }
                    let (costs, known) =
                        if moves { Known::choose(nodes) } else { (choose(nodes, keeps), Known::default()) };
                    let mut twig = GrownTwig { count: seed.count, nodes: Ok(nodes.len()), costs, known };
                    // There is no room for both only where hardly any share a leaf.
                    if !is_there || twig.len() > own.len() {
                        twig.nodes = Err(nodes.to_vec());
                    }
                    if is_there {
                        let (nodes_there, behind) = own.split_at_mut(twig.nodes_there());
                        nodes_there.copy_from_slice(bytemuck::cast_slice(&nodes[..nodes_there.len()]));
                        bytemuck::cast_slice_mut(behind)[..names.len()].copy_from_slice(names);
                    }
                    twig
                },
            )
            .collect()
    }

    fn twig_sorted<const COSTS: bool>(&self, range: Range, codes: &[Code], work: &mut Tools) -> Bounds {
        let count = range.len();
        if count <= FAST_FEW {
            return self.twig::<COSTS>(range, None, work);
        }
        let Some(middle) = morton::cut(codes) else { return self.twig::<COSTS>(range, None, work) };
        let place = work.nodes.len();
        work.nodes.push(BinaryNode(Bounds::EMPTY));
        let [left, right] = range.cut(middle);
        let (left_codes, right_codes) = codes.split_at(middle);
        let mut bounds = self.twig_sorted::<COSTS>(left, left_codes, work);
        let right_place = work.nodes.len() - place;
        bounds.grow(&self.twig_sorted::<COSTS>(right, right_codes, work));
        work.nodes[place] = BinaryNode::inner(&bounds, right_place);
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

    /// The split of a node; `None` where it is to be split by order.
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

    /// The same where a split has been found, if any was.
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
        // Where the range was much too wide, it is measured.
        if split.is_some_and(|split| split.spread > 4) {
            return split;
        }
        let centers = self.centers(primitives);
        if centers.are_one() {
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

    /// Makes a subtree by one thread; returns its box. Its depth is bounded, and so is this recursion.
    fn twig<const COSTS: bool>(&self, range: Range, split: Option<Split>, work: &mut Tools) -> Bounds {
        let count = range.len();
        if count <= FEW {
            return self.few::<COSTS>(range, work);
        }
        let place = work.nodes.len();
        work.nodes.push(BinaryNode(Bounds::EMPTY));
        let split = self.known::<COSTS>(range.here, range.depth, split, work.bins);
        let ([left, right], splits) = match &split {
            Some(split) => {
                let (left, right) = range.there.split_at_mut(split.left);
                self.isa.run(Part { primitives: &*range.here, split, sides: [left, right] });
                let cut = range.moved(split.left);
                let splits = [0, 1].map(|side| {
                    let primitives = &*cut[side].here;
                    if primitives.len() <= FEW {
                        return None;
                    }
                    let binning = split.next(side, primitives.len());
                    self.binned::<COSTS>(primitives, binning, work.bins, cut[side].depth)
                });
                (cut, splits)
            }
            None => {
                let middle = self.by_order(range.here);
                (range.cut(middle), [None; 2])
            }
        };
        let mut bounds = self.twig::<COSTS>(left, splits[0], work);
        let right_place = work.nodes.len() - place;
        bounds.grow(&self.twig::<COSTS>(right, splits[1], work));
        work.nodes[place] = BinaryNode::inner(&bounds, right_place);
        bounds
    }

    fn few<const COSTS: bool>(&self, range: Range, work: &mut Tools) -> Bounds {
        let traits = self.traits;
        let place = work.nodes.len();
        match self.isa.run(SplitSmall::<COSTS> { primitives: range.here, traits }) {
            SmallSplit::Leaf => {
                let mut bounds = Bounds::EMPTY;
                for (name, primitive) in range.names.iter_mut().zip(&*range.here) {
                    *name = [primitive.first(), primitive.second()];
                    bounds.grow(primitive);
                }
                if range.is_away {
                    range.there.copy_from_slice(range.here);
                }
                work.nodes.push(BinaryNode::leaf(&bounds, range.first, range.names.len()));
                bounds
            }
            SmallSplit::Split(left) => {
                work.nodes.push(BinaryNode(Bounds::EMPTY));
                let [left, right] = range.cut(left);
                let mut bounds = self.few::<COSTS>(left, work);
                let right_place = work.nodes.len() - place;
                bounds.grow(&self.few::<COSTS>(right, work));
                work.nodes[place] = BinaryNode::inner(&bounds, right_place);
                bounds
            }
        }
    }

    /// Without a SAH split: in the middle by kind, then geometry, then along the longest axis, so that leaves of one kind
    /// come about even where everything stands in one place.
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
