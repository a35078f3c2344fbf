//! Opens instances: if boxes around parts of an instance are much smaller than the box around the whole, leaves of the
//! outer tree enter the inner tree at several nodes instead of at its root.
//!
//! C. Benthin, S. Woop, I. Wald, A. Áfra, "Improved Two-Level BVHs using Partial Re-Braiding", High Performance
//! Graphics, 2017.
//!
//! Unlike there, instances are opened before the build, and by area instead of size: an instance is opened if its parts
//! have so much less area that rays enter it less often, starting with the largest gain. Overlap alone is no reason,
//! because entering an instance costs as much as several nodes. For two hundred scanned balls in a heap and ten
//! thousand trees of a forest, whose boxes overlap many others, opening by size lost 0.03 and 0.07 of the speed (with
//! nodes of eight children) at two leaves per instance, and lost more with more leaves. Opening by area
//! leaves these scenes as they are. A thousand long, slanted pipes, opened into the sixteen children of their roots,
//! reached 4.1 times the speed for closest hits and 2.8 times for any hits; half of them opened, 1.9 and 1.6 times. The
//! scenes are `boulders`, `forest` and `pipes` of `cargo xtask bench kernel`.

use std::collections::BTreeMap;
use std::sync::Arc;

use lumbre_geometry::Aabb;
use lumbre_math::Transform;
use rayon::prelude::*;
use rustc_hash::FxHashMap;

use crate::build::outline::{EightSizes, Outline, Placing, box_in_space};
use crate::build::primitive::{Bounds, ONE, Primitive};
use crate::intersect::{Dispatch, Isa, Simd};
use crate::tree::geometry::Placement;
use crate::tree::node::{TreeSpace, tag};
use crate::tree::packed::Entry;
use crate::tree::packed::Start;
use crate::tree::{Geometry, GeometryKind, Instance, Tree};

/// Extra leaves allowed for each static instance, and for all: enough to open an average one once.
const MORE: usize = 15;
const MORE_FOR_ALL: usize = 64;
/// Open an instance only if its parts have at most this share of the whole's area. Sixteen parts of a ball have about
/// 0.8.
const LARGEST_SHARE: f32 = 0.65;
/// Approximate boxes in a part's outline; at least one for each child.
const OUTLINE: usize = 8;

/// A node of an instance's tree where rays may enter, with its children.
struct Family {
    /// Empty if one of them is a leaf: rays cannot enter at a leaf.
    children: Vec<u32>,
    /// Around the children.
    boxes: Vec<EightSizes>,
    outline: Outline,
    /// The families of the children, once they are known.
    families: Vec<u32>,
}

impl Family {
    fn of(inner: &Tree, reference: u32) -> Self {
        let node = &inner.packed.nodes[reference as usize];
        let lanes = 0..node.len();
        let children = lanes.map(|lane| (node.children[lane], box_in_space(&inner.tree_space, node, lane)));
        // No ray meets a child that a refit made empty.
        let (mut children, mut boxes): (Vec<_>, Vec<_>) =
            children.filter(|child| !child.1.is_empty()).unzip();
        if children.iter().any(|&child| !tag::is_inner(child)) {
            (children, boxes) = Default::default();
        }
        let boxes = EightSizes::of(&boxes);
        let outline = Outline::below(inner, reference, OUTLINE);
        Self { children, boxes, outline, families: Vec::new() }
    }
}

/// What is known of the trees that instances place. Many instances share a tree.
#[derive(Default)]
pub(crate) struct Families {
    known: Vec<Family>,
    /// Index of the family of a tree and node.
    places: FxHashMap<(usize, u32), u32>,
}

impl Families {
    /// The index of a node's family.
    fn learn(&mut self, tree: &Arc<Tree>, node: u32) -> u32 {
        *self.places.entry((Arc::as_ptr(tree).addr(), node)).or_insert_with(|| {
            self.known.push(Family::of(tree, node));
            self.known.len() as u32 - 1
        })
    }

    fn get(&self, place: u32) -> &Family {
        &self.known[place as usize]
    }

    /// Finds the families of the children.
    fn learn_children(&mut self, tree: &Arc<Tree>, place: u32) {
        let family = self.get(place);
        if family.families.len() < family.children.len() {
            let children = family.children.clone();
            self.known[place as usize].families =
                children.into_iter().map(|child| self.learn(tree, child)).collect();
        }
    }

    /// The boxes around these nodes of an instance's tree, in the space around the instance; `None` unless the nodes
    /// together are the whole tree.
    fn boxes_of(&mut self, instance: &Instance, whole: &Aabb, nodes: &[u32]) -> Option<Vec<Aabb>> {
        let Instance { tree, world_from_object } = instance;
        tree.packed.root.filter(|&root| tag::is_inner(root))?;
        let mut places: Vec<(u32, usize)> = nodes.iter().copied().zip(0..).collect();
        places.sort_unstable();
        let mut boxes = vec![None; nodes.len()];
        let mut pending = vec![(self.learn(tree, 0), *whole)];
        while let Some((place, around)) = pending.pop() {
            self.learn_children(tree, place);
            let family = self.get(place);
            if family.children.is_empty() {
                return None;
            }
            for (node, &place) in family.children.iter().zip(&family.families) {
                let mut bounds = around;
                if let Some(own) = self.get(place).outline.part_at(world_from_object) {
                    // Both bound it, so their intersection does.
                    bounds = Aabb { min: own.min.max(around.min), max: own.max.min(around.max) };
                }
                match places.binary_search_by_key(node, |place| place.0) {
                    Ok(found) => boxes[places[found].1] = Some(bounds),
                    Err(_) => pending.push((place, bounds)),
                }
            }
        }
        boxes.into_iter().collect()
    }
}

/// The instance, if this is a static one.
fn still(geometry: &Geometry) -> Option<(&Instance, &Transform)> {
    match &geometry.kind {
        GeometryKind::Instance(instance) => match &instance.world_from_object {
            Placement::Still(map) => Some((instance, map)),
            Placement::Moving(_) => None,
        },
        _ => None,
    }
}

/// Marks a primitive that cannot be opened.
const NO_FAMILY: u32 = u32::MAX;
/// The second id of an opened primitive.
const OPENED: u32 = u32::MAX;
/// Parts per task.
const CHUNK: usize = 256;

/// Opens those instances among the primitives where it pays, into at most `room` additional parts. The second id of a
/// part is the node where it is entered.
pub(crate) fn open(
    primitives: &mut Vec<Primitive>,
    geometries: &[Geometry],
    tree_space: &TreeSpace,
    room: usize,
) {
    let mut known = Families::default();
    let of = |primitive: &Primitive| still(&geometries[primitive.first() as usize]);
    let family = |primitive: &Primitive| match of(primitive) {
        Some((Instance { tree, .. }, _)) if tree.packed.root.is_some_and(tag::is_inner) => {
            known.learn(tree, 0)
        }
        _ => NO_FAMILY,
    };
    let mut families: Vec<u32> = primitives.iter().map(family).collect();
    let instances = families.iter().filter(|&&family| family != NO_FAMILY).count();
    if instances == 0 {
        return;
    }
    let mut more = (MORE * instances + MORE_FOR_ALL).min(room);
    let mut first = 0;
    // Level by level, so that threads share the work of a level.
    while first < primitives.len() {
        let mut gains = vec![0.0; families.len()];
        let parts = primitives[first..].par_chunks_mut(CHUNK).zip(families.par_chunks(CHUNK));
        parts.zip(gains.par_chunks_mut(CHUNK)).for_each(|((parts, families), gains)| {
            let are_whole = first == 0;
            Isa::best().run(Weigh {
                parts,
                families,
                gains,
                known: &known,
                geometries,
                tree_space,
                are_whole,
            });
        });
        let positive = gains.iter().enumerate().filter(|(_, gain)| **gain > 0.0);
        // The largest gain first; ties by position.
        let mut order: Vec<u64> =
            positive.map(|(place, gain)| u64::from(!gain.to_bits()) << 32 | place as u64).collect();
        drop(gains);
        order.par_sort_unstable();
        let mut opened = Vec::new();
        let mut count = 0;
        for place in order.into_iter().map(|key| key as u32 as usize) {
            let children = known.get(families[place]).children.len();
            let Some(rest) = (more + 1).checked_sub(children) else { break };
            more = rest;
            count += children;
            opened.push(place);
        }
        opened.sort_unstable();
        let mut next = Vec::with_capacity(count);
        let end = primitives.len();
        primitives.reserve_exact(count);
        for place in opened {
            let part = primitives[first + place];
            let Some((instance, _)) = of(&part) else { continue };
            known.learn_children(&instance.tree, families[place]);
            let family = known.get(families[place]);
            next.extend(&family.families);
            primitives.extend(family.children.iter().map(|&child| part.with_ids(part.first(), child)));
            primitives[first + place] = part.with_ids(part.first(), OPENED);
        }
        (first, families) = (end, next);
    }
    primitives.retain(|primitive| primitive.second() != OPENED);
}

/// Finds the boxes of parts, cut to their parents' boxes, and the gain of opening each.
struct Weigh<'a> {
    parts: &'a mut [Primitive],
    families: &'a [u32],
    gains: &'a mut [f32],
    known: &'a Families,
    geometries: &'a [Geometry],
    tree_space: &'a TreeSpace,
    /// Whether these are whole instances with boxes of their own.
    are_whole: bool,
}

impl Dispatch for Weigh<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Simd>(self) {
        let Self { parts, families, gains, known, geometries, tree_space, are_whole } = self;
        // Converts areas in space to areas of primitives.
        let scale = (tree_space.scale * ONE).powi(2);
        for ((part, &family), gain) in parts.iter_mut().zip(families).zip(gains) {
            if family == NO_FAMILY {
                continue;
            }
            let Some((_, map)) = still(&geometries[part.first() as usize]) else { continue };
            let (family, placing) = (known.get(family), Placing::of(map));
            if !are_whole && let Some(around) = family.outline.around::<L>(&placing) {
                *part = part.common(&Bounds::near(tree_space, &around, part.first(), part.second()));
            }
            if !family.boxes.is_empty() {
                let count = family.children.len();
                let areas = (scale * EightSizes::placed_area(&family.boxes, count, &placing)) as f32;
                let area = part.half_area();
                if areas <= LARGEST_SHARE * area {
                    *gain = area - areas;
                }
            }
        }
    }
}

/// The indices of the entries of opened instances, by geometry.
pub(crate) fn opened(entries: &[Entry], geometries: &[Geometry]) -> BTreeMap<u32, Vec<usize>> {
    let mut found: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (place, entry) in entries.iter().enumerate() {
        if is_part(entry, geometries) {
            found.entry(entry.geometry).or_default().push(place);
        }
    }
    found
}

/// Whether an entry belongs to an opened instance.
pub(crate) fn is_part(entry: &Entry, geometries: &[Geometry]) -> bool {
    let kind = |geometry: &Geometry| matches!(geometry.kind, GeometryKind::Instance(_));
    entry.primitive() != Start::WHOLE.0 && geometries.get(entry.geometry as usize).is_some_and(kind)
}

/// The starts of an opened instance's entries, each with its box: its parts, or the first entry for the whole. `whole`
/// is the box around the instance, if it is not empty.
pub(crate) fn starts_of(
    families: &mut Families,
    instance: &Instance,
    whole: Option<Aabb>,
    starts: &[Start],
) -> Vec<(Start, Option<Aabb>)> {
    let nodes: Vec<u32> = starts.iter().map(|start| start.node()).collect();
    let boxes = whole.and_then(|whole| families.boxes_of(instance, &whole, &nodes));
    if let Some(boxes) = boxes {
        return nodes.into_iter().map(Start).zip(boxes.into_iter().map(Some)).collect();
    }
    let stands_in = |(place, start): (usize, &Start)| match whole {
        Some(_) if place == 0 => (start.marked(Start::AS_WHOLE), whole),
        _ => (start.marked(Start::AS_NOTHING), None),
    };
    starts.iter().enumerate().map(stands_in).collect()
}
