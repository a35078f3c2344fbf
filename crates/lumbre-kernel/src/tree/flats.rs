//! A tree of nested boxes, split at the median, over primitives without area: see
//! [`point::flats`](crate::point::flats).

use lumbre_geometry::Aabb;
use lumbre_math::DVec3;

/// Maximum items of a leaf.
const LEAF: usize = 4;

/// The flat primitives of one tree's geometries.
#[derive(Clone, Debug, Default)]
pub(crate) struct Flats {
    // The first is the root; empty without items.
    nodes: Vec<FlatNode>,
    items: Vec<FlatItem>,
    /// The largest finite coordinates, as absolute values.
    pub(crate) reach: DVec3,
}

#[derive(Clone, Debug)]
pub(crate) struct FlatNode {
    /// Bounds of all items below it; infinite if one of them moves.
    pub(crate) bounds: Aabb,
    pub(crate) below: Below,
}

#[derive(Clone, Copy, Debug)]
pub(crate) enum Below {
    /// The second child; the first one is the next node.
    Nodes(u32),
    /// A range of items.
    Items(u32, u32),
}

/// A flat primitive, or an instance of a tree that has some.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FlatItem {
    pub(crate) geometry: u32,
    pub(crate) primitive: u32,
}

impl Flats {
    pub(crate) fn new(mut boxed: Vec<(Aabb, FlatItem)>) -> Self {
        let mut flats = Self::default();
        if !boxed.is_empty() {
            flats.split(&mut boxed, 0);
            flats.items = boxed.iter().map(|(_, item)| *item).collect();
            let reaches = boxed.iter().map(|(bounds, _)| bounds.min.abs().max(bounds.max.abs()));
            flats.reach = reaches.filter(|reach| reach.is_finite()).fold(DVec3::ZERO, DVec3::max);
        }
        flats
    }

    /// Builds the node of these items, which start at index `first`. Halves differ by at most one, so the recursion is
    /// as deep as the logarithm of their number.
    fn split(&mut self, boxed: &mut [(Aabb, FlatItem)], first: usize) {
        let bounds = boxed.iter().fold(Aabb::EMPTY, |all, (bounds, _)| all.union(*bounds));
        let node = self.nodes.len();
        let all = Below::Items(first as u32, (first + boxed.len()) as u32);
        self.nodes.push(FlatNode { bounds, below: all });
        if boxed.len() <= LEAF {
            return;
        }
        let center = |bounds: &Aabb| 0.5 * bounds.min + 0.5 * bounds.max;
        let centers = Aabb::around(boxed.iter().map(|(bounds, _)| center(bounds)).filter(|c| c.is_finite()));
        let size = centers.size();
        let axis = (0..3).max_by(|&a, &b| size[a].total_cmp(&size[b])).unwrap_or(0);
        let middle = boxed.len() / 2;
        boxed.select_nth_unstable_by(middle, |a, b| {
            let by_center = center(&a.0)[axis].total_cmp(&center(&b.0)[axis]);
            by_center.then((a.1.geometry, a.1.primitive).cmp(&(b.1.geometry, b.1.primitive)))
        });
        let (below, above) = boxed.split_at_mut(middle);
        self.split(below, first);
        self.nodes[node].below = Below::Nodes(self.nodes.len() as u32);
        self.split(above, first + middle);
    }

    pub(crate) fn root(&self) -> Option<&FlatNode> {
        self.nodes.first()
    }

    pub(crate) fn node(&self, node: u32) -> &FlatNode {
        &self.nodes[node as usize]
    }

    pub(crate) fn items(&self, first: u32, end: u32) -> &[FlatItem] {
        &self.items[first as usize..end as usize]
    }

    /// Bytes of memory.
    pub(crate) fn memory_bytes(&self) -> usize {
        self.nodes.capacity() * size_of::<FlatNode>() + self.items.capacity() * size_of::<FlatItem>()
    }
}
