//! Orders the children of nodes for any-hit searches, which test the last child first.
//!
//! Each of several tests stops a ray with probability `p` at cost `c`. The expected cost is least in the
//! order of falling `p / c`: L. G. Mitten, "An Analytic Solution to the Least Cost Testing Sequence Problem", Journal
//! of Industrial Engineering 11, 1960; for trees, T. Ize, C. Hansen, "RTSAH Traversal Order for Occlusion Rays",
//! Computer Graphics Forum 30(2), 2011.
//!
//! A line that meets a convex body of surface S meets the surfaces in it 2A / S times on average, where A is their
//! area: Crofton's formula, see L. A. Santaló, "Integral Geometry and Geometric Probability", 1976. For the box of a
//! leaf, that is the `p` of its triangles, at most 1. Hits below a node count as independent, each weighted by its
//! box's share of the node's surface. So a wall comes before a bush, and both before small objects of many parts.
//!
//! Only for nodes with nothing but triangles below. The `p` of other primitives is unknown: there the largest child
//! stays last.

use rayon::prelude::*;

use crate::intersect::{CornerScratch, Dispatch, Isa, Simd};
use crate::simd::{F32x8, F32x16, Vector};
use crate::tree::node::{Node, TreeSpace, WIDTH, tag};
use crate::tree::triangle_block::{Blocks, TriangleBlock};

/// The expectation for a ray that meets a box.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Odds {
    /// The probability that the contents stop it.
    stops: f32,
    /// The cost of the test, in nodes and blocks.
    cost: f32,
}

/// One thread sorts the children of this many nodes in one call.
const FEW: usize = if cfg!(test) { 8 } else { 256 };

/// Sorts the children of every node with only triangles below. Nodes are depth first: all nodes below a node follow it
/// directly.
pub(crate) fn sort_children(isa: Isa, tree_space: &TreeSpace, nodes: &mut [Node], blocks: Blocks) {
    Sorter { isa, blocks, scale: tree_space.scale as f32 }.sort(nodes, 0);
}

#[derive(Clone, Copy)]
struct Sorter<'a> {
    isa: Isa,
    blocks: Blocks<'a>,
    /// Tree units per unit of the meshes.
    scale: f32,
}

impl Sorter<'_> {
    /// Sorts the children of the node at `place` and of all nodes below it. Returns its odds, if known.
    fn sort(&self, nodes: &mut [Node], place: usize) -> Option<Odds> {
        if nodes.len() <= FEW {
            return self.isa.run(SortFew { sorter: *self, nodes, place });
        }
        let (node, mut rest) = nodes.split_first_mut()?;
        let mut inner: Vec<(usize, usize)> = (0..WIDTH)
            .filter(|&lane| tag::is_inner(node.children[lane]))
            .map(|lane| (node.children[lane] as usize, lane))
            .collect();
        inner.sort_unstable();
        let mut below = Vec::with_capacity(inner.len());
        for (at, &(first, lane)) in inner.iter().enumerate() {
            let end = inner.get(at + 1).map_or(first + rest.len(), |&(next, _)| next);
            below.push((lane, first, rest.split_off_mut(..end - first).expect("nodes stand depth first")));
        }
        let found: Vec<_> =
            below.into_par_iter().map(|(lane, first, nodes)| (lane, self.sort(nodes, first))).collect();
        let mut odds = [None; WIDTH];
        found.into_iter().for_each(|(lane, found)| odds[lane] = found);
        self.isa.run(SortOne { sorter: *self, node, odds })
    }

    /// Sorts the children of a node, given the odds of its inner nodes.
    #[inline(always)]
    fn sort_one<L: Simd>(
        &self,
        node: &mut Node,
        inner: &[Option<Odds>; WIDTH],
        room: &mut CornerScratch,
    ) -> Option<Odds> {
        let areas = Areas::of::<L>(node);
        let (mut stops, mut costs) = ([0.0; WIDTH], [1.0; WIDTH]);
        let mut len = 0;
        for (lane, &child) in node.children.iter().enumerate() {
            let odds = match tag::of(child) {
                tag::INNER => inner[lane]?,
                tag::TRIANGLES => {
                    let (mut triangles, mut cost) = (0.0, 0.0);
                    for block in self.blocks.leaf(child) {
                        triangles += area_of::<L>(block, self.scale, room);
                        cost += 1.0;
                    }
                    // A finite number for every box.
                    Odds { stops: (triangles / areas.of_children[lane]).min(1.0), cost }
                }
                _ if child == Node::ABSENT => break,
                _ => return None,
            };
            (stops[lane], costs[lane]) = (odds.stops, odds.cost);
            len += 1;
        }
        // From last to first: falling probability per cost.
        let keys = (L::F32x16::load(&stops) / L::F32x16::load(&costs)).lanes_in_bits();
        let by_lane = keys.bits();
        let mut order = [0; WIDTH];
        for (lane, &key) in by_lane[..len].iter().enumerate() {
            let above = keys.bits_above(key) & ((1 << len) - 1);
            order[(len - 1 - above.count_ones() as usize) % WIDTH] = lane;
        }
        put_in_order(node, &order[..len]);
        let (mut goes_on, mut cost) = (1.0, 1.0);
        for &lane in order[..len].iter().rev() {
            let lane = lane % WIDTH;
            let share = areas.of_children[lane] * areas.inverse;
            cost += goes_on * share * costs[lane];
            goes_on *= 1.0 - share * stops[lane];
        }
        Some(Odds { stops: 1.0 - goes_on, cost })
    }
}

/// Sorts the children of these nodes: the node at `place` and all below it.
struct SortFew<'a> {
    sorter: Sorter<'a>,
    nodes: &'a mut [Node],
    place: usize,
}

impl Dispatch for SortFew<'_> {
    type Output = Option<Odds>;

    #[inline(always)]
    fn run<L: Simd>(self) -> Option<Odds> {
        let Self { sorter, nodes, place } = self;
        let mut room = CornerScratch::new();
        let mut odds = [None; FEW];
        for at in (0..nodes.len()).rev() {
            let node = &mut nodes[at];
            let mut inner = [None; WIDTH];
            for (odds_of, &child) in inner.iter_mut().zip(&node.children) {
                if tag::is_inner(child) {
                    *odds_of = odds[(child as usize - place) % FEW];
                }
            }
            odds[at % FEW] = sorter.sort_one::<L>(node, &inner, &mut room);
        }
        odds[0]
    }
}

/// Sorts the children of a node, given the odds of its inner nodes.
struct SortOne<'a> {
    sorter: Sorter<'a>,
    node: &'a mut Node,
    odds: [Option<Odds>; WIDTH],
}

impl Dispatch for SortOne<'_> {
    type Output = Option<Odds>;

    #[inline(always)]
    fn run<L: Simd>(self) -> Option<Odds> {
        self.sorter.sort_one::<L>(self.node, &self.odds, &mut CornerScratch::new())
    }
}

/// Reorders the children of a node by lanes.
#[inline(always)]
fn put_in_order(node: &mut Node, order: &[usize]) {
    let before = *node;
    for (lane, &from) in order.iter().enumerate() {
        let from = from % WIDTH;
        node.children[lane] = before.children[from];
        for (row, before) in node.planes.iter_mut().zip(&before.planes) {
            row[lane] = before[from];
        }
    }
}

/// The surface areas of a node's boxes.
struct Areas {
    /// Half the areas of the children's boxes; zero for an inverted box, as of a leaf whose contents have no area any
    /// more.
    of_children: [f32; WIDTH],
    /// One over half the area of the node's own box, or zero if it has none.
    inverse: f32,
}

impl Areas {
    #[inline(always)]
    fn of<L: Simd>(node: &Node) -> Self {
        let zero = L::F32x16::splat(0.0);
        let (mut sizes, mut all) = ([zero; 3], [0.0_f32; 3]);
        for axis in 0..3 {
            let low = L::F32x16::load(&node.planes[2 * axis]);
            let high = L::F32x16::load(&node.planes[2 * axis + 1]);
            sizes[axis] = (high - low).max(zero);
            all[axis] = (high.reduce_max() + (zero - low).reduce_max()).max(0.0);
        }
        let ([x, y, z], [all_x, all_y, all_z]) = (sizes, all);
        let of_children = (x * y + y * z + z * x).to_array();
        let whole = all_x * all_y + all_y * all_z + all_z * all_x;
        Self { of_children, inverse: if whole > 0.0 { 1.0 / whole } else { 0.0 } }
    }
}

/// The area of the triangles of a block, in tree units.
#[inline(always)]
fn area_of<L: Simd>(block: &TriangleBlock, scale: f32, room: &mut CornerScratch) -> f32 {
    let corners = L::corners(block, room);
    let scale = L::F32x8::splat(scale);
    let (mut a, mut b) = ([scale; 3], [scale; 3]);
    for (axis, [first, second, third]) in corners.iter().enumerate() {
        let first = L::F32x8::load(first);
        a[axis] = (L::F32x8::load(second) - first) * scale;
        b[axis] = (L::F32x8::load(third) - first) * scale;
    }
    let ([ax, ay, az], [bx, by, bz]) = (a, b);
    let (x, y, z) = (ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx);
    // All corners of an empty lane coincide.
    let [a, b, c, d, e, f, g, h] = (x * x + y * y + z * z).sqrt().to_array();
    0.5 * (((a + e) + (c + g)) + ((b + f) + (d + h)))
}
