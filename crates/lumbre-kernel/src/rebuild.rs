//! Putting what has moved together anew: a partial rebuild, which keeps the leaves of packed triangles and spheres.
//!
//! What stands beside what in a block moves together as a rule, as neighbours on a surface do; what refits make worse is above:
//! nodes over parts that went different ways. So the tree is built of leaves, where a build would take triangles, five to eight
//! times as many, which it would have to pack as well. Shapes, instances and custom geometry go different ways one by one; their
//! leaves are made anew.

use lumbre_geometry::Aabb;

use crate::boxes::Boxes;
use crate::build::{Effort, Grown, PARALLEL, binary_tree};
use crate::collapse::{Entry, Relaid, lay_out};
use crate::holds::SingleStart;
use crate::hulls::Hulls;
use crate::node::tag;
use crate::prepare::{self, take_apart};
use crate::primitive::{Bounds, Kind, Primitive, Traits};
use crate::refit::{LeafBoxes, check_places, cost};
use crate::single::Questions;
use crate::triangles::BLOCK;
use crate::{Accel, BuildOptions};

/// See [`Accel::rebuild_partially`].
pub(crate) fn rebuild_partially(accel: &mut Accel, options: &BuildOptions) -> f64 {
    let mut best = cost(&accel.tree.nodes);
    let built_cost = *accel.built_cost.get_or_insert(best);
    let effort = Effort::of(options.preset);
    let is_much = accel.tree.names.len() + accel.tree.entries.len() > PARALLEL;
    let relaid =
        if is_much { rayon::scope(|_| over_leaves(accel, effort)) } else { over_leaves(accel, effort) };
    if let Some(Relaid { nodes, entries, root }) = relaid
        && let new_cost = cost(&nodes)
        && new_cost < best
    {
        best = new_cost;
        let tree = &mut accel.tree;
        (tree.nodes, tree.entries, tree.root) = (nodes.into(), entries.into(), Some(root));
        accel.single = SingleStart::new(&accel.holds, &accel.units, accel.tree.root);
        accel.questions = Questions::new(accel.level, accel.single.as_ref());
        accel.hulls = Hulls::new(&accel.geometries, &accel.tree.entries, &accel.units);
        accel.moments = Default::default();
    }
    if built_cost > 0.0 { best / built_cost } else { 1.0 }
}

/// A tree of the leaves of another; `None` where there is nothing to put together, or more than a tree can name.
fn over_leaves(accel: &Accel, effort: Effort) -> Option<Relaid> {
    let Accel { geometries, tree, units, .. } = accel;
    tree.root.filter(|root| root >> tag::SHIFT == tag::INNER)?;
    let boxes = LeafBoxes::of(accel, units, &boxes_of_entries(accel)?);
    let named = |(entry, bounds): (&Entry, &Bounds)| bounds.with_names(entry.geometry, entry.primitive());
    let mut primitives: Vec<Primitive> = tree.entries.iter().zip(&boxes.entries).map(named).collect();
    // Every leaf is as a geometry of its own, behind the others, with one sphere in it.
    let mut traits: Vec<Traits> = geometries.iter().map(prepare::traits_of).collect();
    let first = traits.len();
    let mut leaves = Vec::new();
    for &child in tree.nodes.iter().flat_map(|node| &node.children[..node.len()]) {
        let blocks = match child >> tag::SHIFT {
            tag::TRIANGLES => &boxes.blocks[tree.numbers(child)],
            tag::SPHERES => &boxes.sphere_blocks[tag::blocks(child)],
            _ => continue,
        };
        primitives.push(LeafBoxes::around(blocks).with_names(traits.len() as u32, 0));
        let cost = Traits::COST_OF_PACKED * (blocks.len() * BLOCK) as u32;
        traits.push(Traits { kind: Kind::Sphere, cost, most: 1 });
        leaves.push(child);
    }
    let nothing = &mut Boxes::empty(0);
    let grown = binary_tree(accel.level, effort, primitives, nothing, &traits, geometries, units);
    let Grown { tree, names, instances, .. } = grown;
    let layout = lay_out(&traits, &tree, &names, &instances).ok()?;
    Some(layout.over_leaves(&names, |geometry| leaves[geometry as usize - first]))
}

/// The boxes of what stands in leaves of no packed kind; `None` where it does not fit the geometries.
fn boxes_of_entries(accel: &Accel) -> Option<Vec<Option<Aabb>>> {
    if accel.tree.entries.is_empty() {
        return Some(Vec::new());
    }
    let parts = take_apart(&accel.geometries).ok()?;
    Some(check_places(accel, &parts).ok()?.boxes)
}
