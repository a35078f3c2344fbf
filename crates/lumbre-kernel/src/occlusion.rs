//! In which order the children of nodes stand: where any hit will do, the last that a ray meets is asked first.
//!
//! Of several things, each of which may stop a ray at a probability `p` and takes `c` to ask, the least is expected to be spent where
//! they are asked by falling `p / c`: L. G. Mitten, "An Analytic Solution to the Least Cost Testing Sequence Problem", Journal of
//! Industrial Engineering 11, 1960; of trees, T. Ize, C. Hansen, "RTSAH Traversal Order for Occlusion Rays", Computer Graphics Forum
//! 30(2), 2011.
//!
//! A line that meets a convex body of surface S meets surfaces in it 2A / S times in the mean, where A is their area: Crofton's formula,
//! see L. A. Santaló, "Integral Geometry and Geometric Probability", 1976. With the box of a leaf for the body, that is `p` of its
//! triangles, or 1 where it is more. What is below a node is taken to be met independently of one another, each with the share that
//! its box has of the node's surface. So a wall comes before a bush, and both before what is small and of many parts.
//!
//! Only where there are nothing but triangles below. Of other things `p` is not known: there the largest stay the last.

use rayon::prelude::*;

use crate::blocks::{Blocks, TriangleBlock};
use crate::lanes::{CornersRoom, Eight, Lanes, Level, Task, Vector};
use crate::node::{Node, Units, WIDTH, tag};

/// What is to be expected of a ray that meets a box.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Odds {
    /// How likely it is stopped by what is in there.
    stops: f32,
    /// What that takes, in nodes and blocks.
    cost: f32,
}

impl Odds {
    const NONE: Self = Self { stops: 0.0, cost: 1.0 };
}

/// From how many nodes on threads share the work.
const MANY: usize = if cfg!(test) { 8 } else { 256 };

/// Sorts the children of every node below which there is nothing but triangles. Nodes stand depth first, those below one child behind
/// those below the children that stand before it.
pub(crate) fn sort_children(level: Level, units: &Units, nodes: &mut [Node], blocks: Blocks) {
    Sorter { level, blocks, scale: units.scale as f32 }.sort(nodes, 0);
}

struct Sorter<'a> {
    level: Level,
    blocks: Blocks<'a>,
    /// Tree units per unit of the meshes.
    scale: f32,
}

impl Sorter<'_> {
    /// Sorts the children of a node and of those below it, the first of which stands at this place; what is to be expected of it,
    /// where that is known.
    fn sort(&self, nodes: &mut [Node], place: usize) -> Option<Odds> {
        let is_shared = nodes.len() > MANY;
        let (node, mut rest) = nodes.split_first_mut()?;
        let len = node.len();
        let children = node.children;
        let is_inner = |child: u32| child >> tag::SHIFT == tag::INNER;
        let (mut below, mut first) = (<[&mut [Node]; WIDTH]>::default(), place + 1);
        for lane in 0..len {
            if is_inner(children[lane]) {
                let next = children[lane + 1..len].iter().copied().find(|&child| is_inner(child));
                let end = next.map_or(first + rest.len(), |next| next as usize);
                below[lane] = rest.split_off_mut(..end - first).expect("nodes stand depth first");
                first = end;
            }
        }
        let seen = self.level.run(Look { sorter: self, node });
        let odds_of = |lane: usize, below: &mut [Node]| match children[lane] >> tag::SHIFT {
            tag::INNER => self.sort(below, children[lane] as usize),
            tag::TRIANGLES => Some(seen.leaves[lane]),
            _ => None,
        };
        let mut odds = [None; WIDTH];
        let lanes = odds[..len].iter_mut().zip(&mut below[..len]).enumerate();
        if is_shared {
            let mut lanes: Vec<_> = lanes.collect();
            lanes.par_iter_mut().for_each(|(lane, (odds, below))| **odds = odds_of(*lane, below));
        } else {
            lanes.for_each(|(lane, (odds, below))| *odds = odds_of(lane, below));
        }
        let mut known = [Odds::NONE; WIDTH];
        for (known, odds) in known.iter_mut().zip(&odds[..len]) {
            *known = (*odds)?;
        }
        let order = order_of(&known[..len]);
        put_in_order(node, &order[..len]);
        Some(seen.odds(&known, &order[..len]))
    }
}

/// The lanes by rising odds for their cost; of equal ones as they were.
fn order_of(odds: &[Odds]) -> [usize; WIDTH] {
    let (mut order, mut keys) = ([0; WIDTH], [0.0; WIDTH]);
    for (lane, odds) in odds.iter().enumerate() {
        let key = odds.stops / odds.cost;
        let mut at = lane;
        while at > 0 && keys[at - 1] > key {
            (order[at], keys[at]) = (order[at - 1], keys[at - 1]);
            at -= 1;
        }
        (order[at], keys[at]) = (lane, key);
    }
    order
}

/// Puts the children of a node in an order of their lanes.
fn put_in_order(node: &mut Node, order: &[usize]) {
    if order.is_sorted() {
        return;
    }
    let before = *node;
    for (lane, &from) in order.iter().enumerate() {
        node.children[lane] = before.children[from];
        for (row, before) in node.planes.iter_mut().zip(&before.planes) {
            row[lane] = before[from];
        }
    }
}

/// What is seen of a node at once.
struct Seen {
    /// What is to be expected of its leaves of triangles; of other children it means nothing.
    leaves: [Odds; WIDTH],
    /// Of the surface of its box, the shares of the children's, in the order in which they stood.
    shares: [f32; WIDTH],
}

impl Seen {
    /// What is to be expected of it, where this is of its children, which are asked in this order, the last first.
    fn odds(&self, children: &[Odds; WIDTH], order: &[usize]) -> Odds {
        let (mut goes_on, mut cost) = (1.0, 1.0);
        for &lane in order.iter().rev() {
            let (share, odds) = (self.shares[lane], children[lane]);
            cost += goes_on * share * odds.cost;
            goes_on *= 1.0 - share * odds.stops;
        }
        Odds { stops: 1.0 - goes_on, cost }
    }
}

/// Looks at the boxes of a node, and at the triangles of its leaves.
struct Look<'a> {
    sorter: &'a Sorter<'a>,
    node: &'a Node,
}

impl Task for Look<'_> {
    type Output = Seen;

    #[inline(always)]
    fn run<L: Lanes>(self) -> Seen {
        let Self { sorter: Sorter { blocks, scale, .. }, node } = self;
        let len = node.len();
        let mut areas = [0.0; WIDTH];
        let (mut low, mut high) = ([f32::MAX; 3], [-f32::MAX; 3]);
        for (lane, area) in areas[..len].iter_mut().enumerate() {
            let [from, to] = [0, 1].map(|side| [0, 2, 4].map(|axis| node.planes[axis + side][lane]));
            for axis in 0..3 {
                (low[axis], high[axis]) = (low[axis].min(from[axis]), high[axis].max(to[axis]));
            }
            *area = half_area(from, to);
        }
        let whole = half_area(low, high);
        let mut seen = Seen { leaves: [Odds::NONE; WIDTH], shares: [0.0; WIDTH] };
        for (lane, &area) in areas[..len].iter().enumerate() {
            // A number, and no more than one, whatever the boxes.
            seen.shares[lane] = (area / whole).min(1.0);
            let child = node.children[lane];
            if child >> tag::SHIFT == tag::TRIANGLES {
                let (mut triangles, mut cost) = (0.0, 0.0);
                for block in blocks.leaf(child) {
                    triangles += area_of::<L>(block, *scale);
                    cost += 1.0;
                }
                seen.leaves[lane] = Odds { stops: (triangles / area).min(1.0), cost };
            }
        }
        seen
    }
}

/// Half of the surface of a box: none of one that is inside out, as of leaves in which nothing has an area any more.
#[inline(always)]
fn half_area(low: [f32; 3], high: [f32; 3]) -> f32 {
    let [x, y, z] = [0, 1, 2].map(|axis| (high[axis] - low[axis]).max(0.0));
    x * y + y * z + z * x
}

/// The area of the triangles of a block, in tree units.
#[inline(always)]
fn area_of<L: Lanes>(block: &TriangleBlock, scale: f32) -> f32 {
    let mut room = CornersRoom::new();
    let corners = L::corners(block, &mut room);
    let scale = L::Eight::splat(scale);
    let (mut a, mut b) = ([scale; 3], [scale; 3]);
    for (axis, [first, second, third]) in corners.iter().enumerate() {
        let first = L::Eight::load(first);
        a[axis] = (L::Eight::load(second) - first) * scale;
        b[axis] = (L::Eight::load(third) - first) * scale;
    }
    let ([ax, ay, az], [bx, by, bz]) = (a, b);
    let (x, y, z) = (ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx);
    let doubled = (x * x + y * y + z * z).sqrt().to_array();
    let mut sum = 0.0;
    for (lane, area) in doubled.into_iter().enumerate() {
        sum += if block.taken() >> lane & 1 != 0 { area } else { 0.0 };
    }
    0.5 * sum
}
