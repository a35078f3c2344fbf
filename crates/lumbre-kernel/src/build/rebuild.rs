//! Putting what has moved together anew: a partial rebuild, which keeps the leaves of packed triangles and spheres.
//!
//! What stands beside what in a block moves together as a rule, as neighbours on a surface do; what refits make worse is above:
//! nodes over parts that went different ways. So the tree is built of leaves, where a build would take triangles, five to eight
//! times as many, which it would have to pack as well. Shapes, instances and custom geometry go different ways one by one; their
//! leaves are made anew.

use lumbre_geometry::Aabb;

use crate::build::binary::{Grown, PARALLEL, binary_tree};
use crate::build::boxes::Boxes;
use crate::build::collapse::{Relaid, lay_out};
use crate::build::input::{self, take_apart};
use crate::build::occlusion_order;
use crate::build::primitive::{Bounds, Kind, Primitive, Traits};
use crate::build::refit::{Places, check_places, cost};
use crate::tree::BLOCK;
use crate::tree::node::tag;
use crate::tree::packed::Entry;
use crate::{Accel, BuildOptions, Preset};

/// See [`Accel::rebuild_partially`].
pub(crate) fn rebuild_partially(accel: &mut Accel, options: &BuildOptions) -> f64 {
    let mut best = cost(&accel.tree.nodes);
    let built_cost = *accel.built_cost.get_or_insert(best);
    let preset = options.preset;
    let is_much = accel.tree.names.len() + accel.tree.entries.len() > PARALLEL;
    let relaid =
        if is_much { rayon::scope(|_| over_leaves(accel, preset)) } else { over_leaves(accel, preset) };
    if let Some(Relaid { mut nodes, entries, root }) = relaid
        && let new_cost = cost(&nodes)
        && new_cost < best
    {
        best = new_cost;
        occlusion_order::sort_children(accel.isa, &accel.tree_space, &mut nodes, accel.tree.blocks());
        let tree = &mut accel.tree;
        (tree.nodes, tree.entries, tree.root) = (nodes.into(), entries.into(), Some(root));
        accel.follow_tree();
    }
    if built_cost > 0.0 { best / built_cost } else { 1.0 }
}

/// A tree of the leaves of another; `None` where there is nothing to put together, or more than a tree can name.
fn over_leaves(accel: &Accel, preset: Preset) -> Option<Relaid> {
    let Accel { geometries, tree, .. } = accel;
    tree.root.filter(|&root| tag::is_inner(root))?;
    let mut primitives = entries_of(accel)?;
    // Every leaf is as a geometry of its own, behind the others, with one sphere in it.
    let mut traits: Vec<Traits> = geometries.iter().map(input::traits_of).collect();
    let first = traits.len();
    let mut leaves = Vec::new();
    for node in &*tree.nodes {
        for (lane, &child) in node.children[..node.len()].iter().enumerate() {
            let blocks = match tag::of(child) {
                tag::TRIANGLES => tree.numbers(child).len(),
                tag::SPHERES => tag::blocks(child).len(),
                _ => continue,
            };
            let plane = |side: usize| [0, 2, 4].map(|axis| node.planes[axis + side][lane]);
            primitives.push(Bounds::of_planes(plane(0), plane(1)).with_names(traits.len() as u32, 0));
            let cost = Traits::COST_OF_PACKED * (blocks * BLOCK) as u32;
            traits.push(Traits { kind: Kind::Sphere, cost, most: 1 });
            leaves.push(child);
        }
    }
    let nothing = &mut Boxes::empty(0);
    let Grown { tree, names, instances } = binary_tree(accel.isa, preset, primitives, nothing, &traits);
    let layout = lay_out(&traits, &tree, &names, &instances).ok()?;
    Some(layout.over_leaves(&names, |geometry| leaves[geometry as usize - first]))
}

/// What stands in leaves of no packed kind, one by one; `None` where it does not fit the geometries.
fn entries_of(accel: &Accel) -> Option<Vec<Primitive>> {
    let entries = &accel.tree.entries;
    if entries.is_empty() {
        return Some(Vec::new());
    }
    let parts = take_apart(&accel.geometries).ok()?;
    let Places { boxes, .. } = check_places(accel, &parts).ok()?;
    let around = |(entry, bounds): (&Entry, Option<Aabb>)| {
        let bounds = bounds.map_or(Bounds::EMPTY, |bounds| Bounds::near(&accel.tree_space, &bounds, 0, 0));
        bounds.with_names(entry.geometry, entry.primitive())
    };
    Some(entries.iter().zip(boxes).map(around).collect())
}
