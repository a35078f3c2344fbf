//! Partial rebuild after geometry has moved: keeps the leaves of packed triangles and spheres.
//!
//! Neighbours in a block are usually neighbours on a surface and move together. Refits degrade the nodes above them,
//! over parts that moved apart. So the rebuild takes whole leaves instead of triangles: five to eight times fewer, and
//! without packing. Shapes, instances and custom geometry move independently; their leaves are made anew.

use lumbre_geometry::Aabb;

use crate::build::binary::{GrownTree, PARALLEL, binary_tree};
use crate::build::boxes::Boxes;
use crate::build::collapse::{Relaid, lay_out};
use crate::build::input::{self, take_apart};
use crate::build::occlusion_order;
use crate::build::options::{BuildOptions, Preset};
use crate::build::primitive::{Bounds, Kind, Primitive, Traits};
use crate::build::refit::{Places, check_places, cost};
use crate::intersect::Isa;
use crate::tree::BLOCK;
use crate::tree::Tree;
use crate::tree::node::tag;
use crate::tree::packed::Entry;

/// See [`Accel::rebuild_partially`].
pub(crate) fn rebuild_partially(tree: &mut Tree, options: &BuildOptions) -> f64 {
    let mut best = cost(&tree.packed.nodes);
    let built_cost = *tree.built_cost.get_or_insert(best);
    let preset = options.preset;
    let is_much = tree.packed.ids.len() + tree.packed.entries.len() > PARALLEL;
    let relaid =
        if is_much { rayon::scope(|_| over_leaves(tree, preset)) } else { over_leaves(tree, preset) };
    if let Some(Relaid { mut nodes, entries, root }) = relaid
        && let new_cost = cost(&nodes)
        && new_cost < best
    {
        best = new_cost;
        occlusion_order::sort_children(Isa::best(), &tree.tree_space, &mut nodes, tree.packed.blocks());
        let packed = &mut tree.packed;
        (packed.nodes, packed.entries, packed.root) = (nodes.into(), entries.into(), Some(root));
        tree.follow();
    }
    if built_cost > 0.0 { best / built_cost } else { 1.0 }
}

/// A tree of another tree's leaves; `None` if there is nothing to rebuild, or if there are too many leaves.
fn over_leaves(tree: &Tree, preset: Preset) -> Option<Relaid> {
    let Tree { geometries, packed, .. } = tree;
    packed.root.filter(|&root| tag::is_inner(root))?;
    let mut primitives = entries_of(tree)?;
    // Each leaf becomes a geometry of one sphere, behind the other geometries.
    let mut traits: Vec<Traits> = geometries.iter().map(input::traits_of).collect();
    let first = traits.len();
    let mut leaves = Vec::new();
    for node in &*packed.nodes {
        for (lane, &child) in node.children[..node.len()].iter().enumerate() {
            let blocks = match tag::of(child) {
                tag::TRIANGLES => packed.numbers(child).len(),
                tag::SPHERES => tag::blocks(child).len(),
                _ => continue,
            };
            let plane = |side: usize| [0, 2, 4].map(|axis| node.planes[axis + side][lane]);
            primitives.push(Bounds::of_planes(plane(0), plane(1)).with_ids(traits.len() as u32, 0));
            let cost = Traits::COST_OF_PACKED * (blocks * BLOCK) as u32;
            traits.push(Traits { kind: Kind::Sphere, cost, most: 1 });
            leaves.push(child);
        }
    }
    let nothing = &mut Boxes::empty(0);
    let GrownTree { tree, ids, instances } = binary_tree(Isa::best(), preset, primitives, nothing, &traits);
    let layout = lay_out(&traits, &tree, &ids, &instances).ok()?;
    Some(layout.over_leaves(&ids, |geometry| leaves[geometry as usize - first]))
}

/// The contents of unpacked leaves as single primitives; `None` if they do not match the geometries.
fn entries_of(tree: &Tree) -> Option<Vec<Primitive>> {
    let entries = &tree.packed.entries;
    if entries.is_empty() {
        return Some(Vec::new());
    }
    let parts = take_apart(&tree.geometries).ok()?;
    let Places { boxes, .. } = check_places(tree, &parts).ok()?;
    let around = |(entry, bounds): (&Entry, Option<Aabb>)| {
        let bounds = bounds.map_or(Bounds::EMPTY, |bounds| Bounds::near(&tree.tree_space, &bounds, 0, 0));
        bounds.with_ids(entry.geometry, entry.primitive())
    };
    Some(entries.iter().zip(boxes).map(around).collect())
}
