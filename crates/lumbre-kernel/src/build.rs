//! From primitives to a binary tree: the same from any number of threads.
//!
//! Subtrees over few thousand primitives are made by one thread each; above them, threads share the work on a node. What is
//! done does not depend on how it is shared: boxes grow in any order, costs are whole numbers, and sides keep the order of
//! their primitives. The depth is bounded: past [`SAH_DEPTH`] levels every split is in the middle.

use rayon::prelude::*;

use crate::accel::Preset;
use crate::bins::{self, BestSplit, Binning, Bins, CountLeft, Fill, Measure, Part, Split};
use crate::collapse::{Choices, Costs, choose};
use crate::few::{Decide, FEW, Few, group_of};
use crate::lanes::Level;
use crate::morton::{self, Code};
use crate::primitive::{Bounds, Kind, Primitive, Traits};
use crate::reinsert::reinsert;

/// Levels that may be split by SAH; then come at most 32 more, each halving.
const SAH_DEPTH: u32 = 64;
/// So many a fast build splits by SAH: leaves then are a tenth fuller, and nodes fewer, for a twentieth of its time.
const FAST_FEW: usize = 48;
/// From how many primitives on two threads share the work.
const PARALLEL: usize = 4096;
/// How many primitives a thread takes at a time in a node that is shared.
const CHUNK: usize = 1 << 14;

/// The binary tree, or a part of it.
pub(crate) enum Binary {
    /// Over many primitives.
    Fork(Box<Fork>),
    /// Over fewer, with their nodes in a row.
    Twig(Twig),
}

/// A node with two children of their own.
pub(crate) struct Fork {
    pub(crate) bounds: Bounds,
    pub(crate) costs: Costs,
    pub(crate) choices: Choices,
    pub(crate) children: [Binary; 2],
    /// Whether the right child is of a higher rank than the left.
    pub(crate) is_ranked: bool,
}

impl Binary {
    /// The node over two.
    pub(crate) fn over(children: [Self; 2]) -> Self {
        Self::Fork(Box::new(Fork::over(children)))
    }

    /// A twig of such nodes.
    pub(crate) fn twig(mut nodes: Vec<BinaryNode>) -> Self {
        let costs = choose(&mut nodes);
        Self::Twig(Twig { nodes, costs })
    }
}

/// Nodes in depth-first order, the root first, each left child right after its parent.
pub(crate) struct Twig {
    pub(crate) nodes: Vec<BinaryNode>,
    /// The costs of the root, for those above it.
    pub(crate) costs: Costs,
}

/// A node of a twig: its box, named by two words.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BinaryNode(Bounds);

const LEAF: u32 = 1 << 31;

impl BinaryNode {
    pub(crate) fn leaf(bounds: &Bounds, first: usize, count: usize) -> Self {
        Self(bounds.with_names(first as u32, LEAF | count as u32))
    }

    /// A leaf from the box of one.
    pub(crate) fn again(leaf: &Bounds) -> Self {
        Self(*leaf)
    }

    /// An inner node, its right child so far behind it.
    pub(crate) fn inner(bounds: &Bounds, right: usize) -> Self {
        Self(bounds.with_names(right as u32, 0))
    }

    pub(crate) fn bounds(&self) -> &Bounds {
        &self.0
    }

    /// The names of a leaf's primitives; `None` of an inner node.
    #[inline(always)]
    pub(crate) fn names(&self) -> Option<std::ops::Range<usize>> {
        let first = self.0.first() as usize;
        let count = (self.0.second() & !LEAF) as usize;
        (self.0.second() & LEAF != 0).then(|| first..first + count)
    }

    /// How far behind an inner node its right child stands.
    #[inline(always)]
    pub(crate) fn right(&self) -> usize {
        self.0.first() as usize
    }

    #[inline(always)]
    pub(crate) fn choices(&self) -> Choices {
        Choices(self.0.second())
    }

    #[inline(always)]
    pub(crate) fn choose(&mut self, choices: Choices) {
        self.0 = self.0.with_names(self.0.first(), choices.0);
    }
}

/// A primitive by its geometry, and which of it.
pub(crate) type Name = [u32; 2];

/// The binary tree over primitives (not none), and their names in the order of its leaves.
///
/// First they are parted, to and fro between two lists, until one thread takes what is left together; the second list is
/// given back before twigs grow, which need but a little room each.
pub(crate) fn binary_tree(
    level: Level,
    preset: Preset,
    mut primitives: Vec<Primitive>,
    traits: &[Traits],
) -> (Binary, Vec<Name>) {
    let count = primitives.len();
    let mut other: Vec<Primitive> = fill(count, Bounds::EMPTY);
    // Below, there is a node for every thread.
    let shared = (2 * rayon::current_num_threads()).ilog2();
    let shared = if shared > 1 { shared + 1 } else { 0 };
    let builder = Builder { level, traits, shared };
    let counts = part_by_rank(&mut primitives, &mut other, traits);
    // Sorting moves all of them over, once.
    let is_sorted = preset == Preset::Fast;
    let mut rest = Range { here: &mut primitives, there: &mut other, is_home: !is_sorted, depth: 0 };
    let mut sketches = Vec::with_capacity(Kind::RANKS);
    for (rank, count) in counts.into_iter().enumerate().filter(|&(_, count)| count > 0) {
        let [range, behind] = rest.cut(count);
        rest = behind;
        let range = Range { depth: 0, ..range };
        let is_packed = rank + 1 == Kind::RANKS;
        let (sketch, codes) = match (is_sorted, is_packed) {
            (true, true) => builder.sort::<false>(range),
            (true, false) => builder.sort::<true>(range),
            (false, true) => (builder.sketch::<false>(range, None), Vec::new()),
            (false, false) => (builder.sketch::<true>(range, None), Vec::new()),
        };
        sketches.push((count, is_packed, sketch, codes));
    }
    let (mut primitives, there) = if is_sorted { (other, primitives) } else { (primitives, other) };
    drop(there);

    let mut names: Vec<Name> = fill(count, [0; 2]);
    let (mut here, mut places, mut first) = (&mut primitives[..], &mut names[..], 0);
    let mut trees = Vec::with_capacity(Kind::RANKS);
    for (count, is_packed, sketch, codes) in sketches {
        let ground = Ground { here: take(&mut here, count), names: take(&mut places, count), first };
        first += count;
        trees.push(match is_packed {
            true => builder.grow::<false>(sketch, &codes, ground),
            false => builder.grow::<true>(sketch, &codes, ground),
        });
    }
    drop(primitives);
    let better = |tree| if preset == Preset::Best { reinsert(tree) } else { tree };
    let join = |low, high| Binary::Fork(Box::new(Fork { is_ranked: true, ..Fork::over([low, high]) }));
    let tree = trees.into_iter().map(better).reduce(join).expect("there are primitives");
    (tree, names)
}

/// The first `count` of some, which then are no longer among them.
fn take<'a, T>(rest: &mut &'a mut [T], count: usize) -> &'a mut [T] {
    rest.split_off_mut(..count).unwrap_or_default()
}

/// Brings primitives into the order of their ranks; how many there are of each.
///
/// Apart, because boxes of one kind do not grow around what is of another and everywhere among them, as trees on a ground
/// are; and so that a search for any hit asks first what is quickly asked.
fn part_by_rank(
    primitives: &mut Vec<Primitive>,
    other: &mut Vec<Primitive>,
    traits: &[Traits],
) -> [usize; Kind::RANKS] {
    let mut counts = [0; Kind::RANKS];
    let ranks: Vec<usize> = traits.iter().map(|traits| traits.kind.rank()).collect();
    if let Some(&first) = ranks.first()
        && ranks.iter().all(|&rank| rank == first)
    {
        counts[first] = primitives.len();
        return counts;
    }
    let rank = |primitive: &Primitive| ranks[primitive.first() as usize];
    primitives.iter().for_each(|primitive| counts[rank(primitive)] += 1);
    let mut places = [0, counts[0], counts[0] + counts[1]];
    for primitive in &*primitives {
        let place = &mut places[rank(primitive)];
        other[*place] = *primitive;
        *place += 1;
    }
    std::mem::swap(primitives, other);
    counts
}

/// Like `vec![value; count]`, by all threads.
pub(crate) fn fill<T: Clone + Send + Sync>(count: usize, value: T) -> Vec<T> {
    (0..count).into_par_iter().with_min_len(CHUNK).map(|_| value.clone()).collect()
}

/// The primitives of a node, and as much room for those of its children.
struct Range<'a> {
    here: &'a mut [Primitive],
    there: &'a mut [Primitive],
    /// Whether `here` is where they are to be in the end.
    is_home: bool,
    depth: u32,
}

impl Range<'_> {
    fn len(&self) -> usize {
        self.here.len()
    }

    /// The two sides, where the primitives were moved over.
    fn moved(self, left: usize) -> [Self; 2] {
        Self { here: self.there, there: self.here, is_home: !self.is_home, ..self }.cut(left)
    }

    /// The two sides, where the primitives are as they were.
    fn cut(self, left: usize) -> [Self; 2] {
        let (here, here_right) = self.here.split_at_mut(left);
        let (there, there_right) = self.there.split_at_mut(left);
        let (is_home, depth) = (self.is_home, self.depth + 1);
        [Self { here, there, is_home, depth }, Self { here: here_right, there: there_right, is_home, depth }]
    }
}

/// Which twigs there are to be, and what stands over them.
enum Sketch {
    Fork(Box<[Sketch; 2]>),
    Twig(Seed),
}

/// A twig to be.
struct Seed {
    count: usize,
    depth: u32,
    /// How it is to be split, where that is known.
    split: Option<Split>,
    /// Whether it is to be split by the order along a curve instead.
    is_sorted: bool,
}

impl Sketch {
    /// Of what one thread takes; brings the primitives home.
    fn twig(range: Range, split: Option<Split>, is_sorted: bool) -> Self {
        if !range.is_home {
            range.there.copy_from_slice(range.here);
        }
        Self::Twig(Seed { count: range.len(), depth: range.depth, split, is_sorted })
    }

    /// From the first to the last. The depth of its recursion, and of that of [`Self::over`], is that of the tree.
    fn seeds<'a>(&'a self, seeds: &mut Vec<&'a Seed>) {
        match self {
            Self::Fork(sides) => sides.iter().for_each(|side| side.seeds(seeds)),
            Self::Twig(seed) => seeds.push(seed),
        }
    }

    /// The tree of its twigs, which come in their order.
    fn over(&self, twigs: &mut impl Iterator<Item = Binary>) -> Binary {
        match self {
            Self::Fork(sides) => {
                let [left, right] = &**sides;
                let left = left.over(twigs);
                Binary::over([left, right.over(twigs)])
            }
            Self::Twig(_) => twigs.next().expect("there is one for each seed"),
        }
    }
}

/// Where twigs grow: primitives, and room for their names.
struct Ground<'a> {
    here: &'a mut [Primitive],
    names: &'a mut [Name],
    /// The place of the first name.
    first: usize,
}

/// The primitives of a part of a twig, and where their names go.
struct Plot<'a> {
    range: Range<'a>,
    names: &'a mut [Name],
    /// The place of the first name.
    first: usize,
}

impl Plot<'_> {
    fn len(&self) -> usize {
        self.range.len()
    }

    /// As [`Range::moved`].
    fn moved(self, left: usize) -> [Self; 2] {
        let Self { range, names, first } = self;
        Self::of(range.moved(left), names, first)
    }

    /// As [`Range::cut`].
    fn cut(self, left: usize) -> [Self; 2] {
        let Self { range, names, first } = self;
        Self::of(range.cut(left), names, first)
    }
}

impl<'a> Plot<'a> {
    fn of([left, right]: [Range<'a>; 2], names: &'a mut [Name], first: usize) -> [Self; 2] {
        let (names, names_right) = names.split_at_mut(left.len());
        let right_first = first + left.len();
        [Self { range: left, names, first }, Self { range: right, names: names_right, first: right_first }]
    }
}

struct Builder<'a> {
    level: Level,
    traits: &'a [Traits],
    /// Levels of the tree whose nodes threads share. What comes out does not depend on it.
    shared: u32,
}

/// What one thread needs for twigs.
struct Workplace {
    nodes: Vec<BinaryNode>,
    bins: Box<Bins>,
    /// Room for the primitives of one.
    there: Vec<Primitive>,
}

impl Workplace {
    fn new() -> Self {
        Self { nodes: Vec::new(), bins: Box::new(Bins::EMPTY), there: vec![Bounds::EMPTY; PARALLEL] }
    }
}

impl Builder<'_> {
    /// `split` is how the primitives are to be split, where that is known.
    fn sketch<const COSTS: bool>(&self, range: Range, split: Option<Split>) -> Sketch {
        if range.len() <= PARALLEL {
            return Sketch::twig(range, split, false);
        }
        let ([left, right], splits) = self.divide::<COSTS>(range, split);
        let (left, right) =
            rayon::join(|| self.sketch::<COSTS>(left, splits[0]), || self.sketch::<COSTS>(right, splits[1]));
        Sketch::Fork(Box::new([left, right]))
    }

    /// One level of a node that threads share. Apart, so that its bins are not on the stack of what is below.
    #[inline(never)]
    fn divide<'r, const COSTS: bool>(
        &self,
        range: Range<'r>,
        split: Option<Split>,
    ) -> ([Range<'r>; 2], [Option<Split>; 2]) {
        let mut bins = Bins::EMPTY;
        let Some(split) = self.known::<COSTS>(&range, split, &mut bins) else {
            let middle = self.by_order(range.here);
            return (range.cut(middle), [None; 2]);
        };
        let count = range.len();
        let (left, right) = range.there.split_at_mut(split.left);
        self.part(range.here, &split, [left, right], range.depth);
        let cut = range.moved(split.left);
        let splits = [0, 1].map(|side| {
            let binning = split.next(side, [split.left, count - split.left][side]);
            self.fill::<COSTS>(cut[side].here, binning, &mut bins, cut[side].depth);
            self.best::<COSTS>(&bins, binning)
        });
        (cut, splits)
    }

    /// Splits by the order along a curve; the codes in that order.
    fn sort<const COSTS: bool>(&self, range: Range) -> (Sketch, Vec<Code>) {
        let (_, centers) = self.measure(range.here);
        let codes = morton::sort(range.here, range.there, &centers);
        let Range { here, there, is_home, depth } = range;
        let sorted = Range { here: there, there: here, is_home: !is_home, depth };
        (self.sketch_sorted::<COSTS>(sorted, &codes), codes)
    }

    /// The depth of this recursion is at most that of the bits of a code, and then of [`Builder::sketch`].
    fn sketch_sorted<const COSTS: bool>(&self, range: Range, codes: &[Code]) -> Sketch {
        if range.len() <= PARALLEL {
            return Sketch::twig(range, None, true);
        }
        let Some(middle) = morton::cut(codes) else { return self.sketch::<COSTS>(range, None) };
        let [left, right] = range.cut(middle);
        let (left_codes, right_codes) = codes.split_at(middle);
        let (left, right) = rayon::join(
            || self.sketch_sorted::<COSTS>(left, left_codes),
            || self.sketch_sorted::<COSTS>(right, right_codes),
        );
        Sketch::Fork(Box::new([left, right]))
    }

    /// The tree that was sketched; `codes` are those of its primitives, if they were sorted.
    fn grow<const COSTS: bool>(&self, sketch: Sketch, codes: &[Code], ground: Ground) -> Binary {
        let Ground { mut here, mut names, mut first } = ground;
        let mut seeds = Vec::new();
        sketch.seeds(&mut seeds);
        let mut start = 0;
        let plots: Vec<_> = seeds
            .into_iter()
            .map(|seed| {
                let (here, names) = (take(&mut here, seed.count), take(&mut names, seed.count));
                let codes = codes.get(start..start + seed.count).unwrap_or_default();
                let plot = (seed, codes, here, names, first);
                start += seed.count;
                first += seed.count;
                plot
            })
            .collect();
        let twig = |work: &mut Workplace, (seed, codes, here, names, first): (&Seed, _, _, _, _)| {
            let mut there = std::mem::take(&mut work.there);
            let range = Range { here, there: &mut there[..seed.count], is_home: true, depth: seed.depth };
            let plot = Plot { range, names, first };
            if seed.is_sorted {
                self.twig_sorted::<COSTS>(plot, codes, work);
            } else {
                self.twig::<COSTS>(plot, seed.split, work);
            }
            work.there = there;
            // As long as it is, and no longer.
            let nodes = work.nodes.to_vec();
            work.nodes.clear();
            Binary::twig(nodes)
        };
        let twigs: Vec<Binary> = plots.into_par_iter().map_init(Workplace::new, twig).collect();
        sketch.over(&mut twigs.into_iter())
    }

    fn twig_sorted<const COSTS: bool>(&self, plot: Plot, codes: &[Code], work: &mut Workplace) -> Bounds {
        let count = plot.len();
        if count <= FAST_FEW {
            return self.twig::<COSTS>(plot, None, work);
        }
        let Some(middle) = morton::cut(codes) else { return self.twig::<COSTS>(plot, None, work) };
        let place = work.nodes.len();
        work.nodes.push(BinaryNode(Bounds::EMPTY));
        let [left, right] = plot.cut(middle);
        let (left_codes, right_codes) = codes.split_at(middle);
        let mut bounds = self.twig_sorted::<COSTS>(left, left_codes, work);
        let right_place = work.nodes.len() - place;
        bounds.grow(&self.twig_sorted::<COSTS>(right, right_codes, work));
        work.nodes[place] = BinaryNode::inner(&bounds, right_place);
        bounds
    }

    fn best<const COSTS: bool>(&self, bins: &Bins, binning: Binning) -> Option<Split> {
        self.level.run(BestSplit::<COSTS> { bins, binning })
    }

    /// The split of a node; `None` where it is to be split by order.
    #[inline]
    fn known<const COSTS: bool>(
        &self,
        range: &Range,
        split: Option<Split>,
        bins: &mut Bins,
    ) -> Option<Split> {
        if range.depth >= SAH_DEPTH {
            return None;
        }
        // Where the range was much too wide, it is measured.
        if split.is_some_and(|split| split.spread > 4) {
            return split;
        }
        let (_, centers) = self.measure(range.here);
        if centers.are_one() {
            return None;
        }
        let binning = Binning::new(&centers, range.len());
        self.fill::<COSTS>(range.here, binning, bins, range.depth);
        self.best::<COSTS>(bins, binning)
    }

    fn measure(&self, primitives: &[Primitive]) -> (Bounds, bins::Centers) {
        if primitives.len() <= CHUNK {
            return self.level.run(Measure { primitives });
        }
        let (left, right) = primitives.split_at(primitives.len() / 2);
        bins::join(rayon::join(|| self.measure(left), || self.measure(right)))
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
            self.level.run(Fill::<COSTS> { primitives, binning, bins, traits });
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

    /// Moves the primitives of a node that threads share to their sides.
    fn part(&self, primitives: &[Primitive], split: &Split, sides: [&mut [Primitive]; 2], depth: u32) {
        if depth >= self.shared || primitives.len() <= 2 * CHUNK {
            self.level.run(Part { primitives, split, sides });
            return;
        }
        let (first, second) = primitives.split_at(primitives.len() / 2);
        let count = |primitives: &[Primitive]| self.level.run(CountLeft { primitives, split });
        let first_left = first.par_chunks(CHUNK).map(count).sum();
        let [left, right] = sides;
        let (left, second_left) = left.split_at_mut(first_left);
        let (right, second_right) = right.split_at_mut(first.len() - first_left);
        rayon::join(
            || self.part(first, split, [left, right], depth),
            || self.part(second, split, [second_left, second_right], depth),
        );
    }

    /// Makes a subtree by one thread; returns its box. Its depth is bounded, and so is this recursion.
    fn twig<const COSTS: bool>(&self, plot: Plot, split: Option<Split>, work: &mut Workplace) -> Bounds {
        let count = plot.len();
        if count <= FEW {
            return self.few::<COSTS>(plot, work);
        }
        let place = work.nodes.len();
        work.nodes.push(BinaryNode(Bounds::EMPTY));
        let split = self.known::<COSTS>(&plot.range, split, &mut work.bins);
        let ([left, right], splits) = match &split {
            Some(split) => {
                let (left, right) = plot.range.there.split_at_mut(split.left);
                self.level.run(Part { primitives: &*plot.range.here, split, sides: [left, right] });
                let cut = plot.moved(split.left);
                let splits = [0, 1].map(|side| {
                    let primitives = &*cut[side].range.here;
                    if primitives.len() <= FEW {
                        return None;
                    }
                    let binning = split.next(side, primitives.len());
                    let traits = self.traits;
                    self.level.run(Fill::<COSTS> { primitives, binning, bins: &mut work.bins, traits });
                    self.best::<COSTS>(&work.bins, binning)
                });
                (cut, splits)
            }
            None => {
                let middle = self.by_order(plot.range.here);
                (plot.cut(middle), [None; 2])
            }
        };
        let mut bounds = self.twig::<COSTS>(left, splits[0], work);
        let right_place = work.nodes.len() - place;
        bounds.grow(&self.twig::<COSTS>(right, splits[1], work));
        work.nodes[place] = BinaryNode::inner(&bounds, right_place);
        bounds
    }

    fn few<const COSTS: bool>(&self, plot: Plot, work: &mut Workplace) -> Bounds {
        let traits = self.traits;
        let place = work.nodes.len();
        match self.level.run(Decide::<COSTS> { primitives: plot.range.here, traits }) {
            Few::Leaf => {
                let mut bounds = Bounds::EMPTY;
                for (name, primitive) in plot.names.iter_mut().zip(&*plot.range.here) {
                    *name = [primitive.first(), primitive.second()];
                    bounds.grow(primitive);
                }
                work.nodes.push(BinaryNode::leaf(&bounds, plot.first, plot.names.len()));
                bounds
            }
            Few::Split(left) => {
                work.nodes.push(BinaryNode(Bounds::EMPTY));
                let [left, right] = plot.cut(left);
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
        let axis = self.measure(primitives).1.longest_axis();
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
