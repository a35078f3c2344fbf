//! Opening of instances: where boxes around parts of one are much smaller than the box around the whole, leaves of the outer
//! tree enter the inner one at several of its nodes, and not at its root.
//!
//! C. Benthin, S. Woop, I. Wald, A. Áfra, "Improved Two-Level BVHs using Partial Re-Braiding", High Performance Graphics,
//! 2017. There, what is large beside a node of the outer tree is opened while that is built. Here, an instance is opened
//! before, where its parts have so much less area that rays enter it more seldom; those that gain most come first. Overlap
//! alone is no reason: on two hundred scanned balls in a heap and ten thousand trees of a forest, all within the boxes of many
//! others, opening by size lost 0.03 and 0.07 of the speed with twice as many leaves as instances, and more with more, since
//! entering an instance costs as much as several nodes. (By area, it leaves these as they are.) A thousand long and slanted
//! pipes came to 1.1, 1.6 and 2.8 times the speed with two, four and nine times as many leaves, and to no more with seventeen.
//! The scenes are `boulders`, `forest` and `pipes` of `cargo xtask bench kernel`.

use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, OnceLock};

use lumbre_geometry::Aabb;
use lumbre_math::Transform;
use rayon::prelude::*;

use crate::collapse::Entry;
use crate::node::tag;
use crate::outline::{EightBoxes, Outline, box_in_space, center_and_half};
use crate::prepare::Boxed;
use crate::{Accel, Geometry, GeometryKind, Instance, Placement};

/// How many leaves there may be more for each instance that stands still, and how many more for all.
const MORE: usize = 7;
const MORE_FOR_ALL: usize = 64;
/// Parts are to have no more of the area of the whole than this. The test of an entered root would allow for 7/6; more nodes
/// of the outer tree take from that.
const LARGEST_SHARE: f64 = 0.8;
/// Boxes of a part's outline, about.
const OUTLINE: usize = 8;

/// Where an entry of an instance enters the instance's tree: at the root, or at another node. The parts of an instance
/// together are all of its tree, no two of them have a node in common, and none is a leaf.
///
/// After a refit with another tree in which these are no such nodes, one entry stands for the whole and the others for nothing,
/// until a tree comes in which they are again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Start(u32);

impl Start {
    /// At the root.
    pub(crate) const WHOLE: Self = Self(0);
    const AS_WHOLE: u32 = 1;
    const AS_NOTHING: u32 = 2;

    /// As it stands in an entry.
    #[inline(always)]
    pub(crate) fn of(word: u32) -> Self {
        Self(word)
    }

    pub(crate) fn word(self) -> u32 {
        self.0
    }

    #[inline(always)]
    pub(crate) fn is_nothing(self) -> bool {
        self.0 >> tag::SHIFT >= Self::AS_NOTHING
    }

    /// What is entered of a tree with this root.
    #[inline(always)]
    pub(crate) fn below(self, root: u32) -> u32 {
        if self == Self::WHOLE || self.0 >> tag::SHIFT != tag::INNER { root } else { self.0 }
    }

    fn node(self) -> u32 {
        self.0 & tag::PLACE
    }

    fn marked(self, mark: u32) -> Self {
        Self(tag::reference(mark, self.node()))
    }
}

/// A node of an instance's tree that is to be entered, or the root, with what is below it. Nothing where there is a leaf, for
/// leaves are not entered.
struct Family {
    children: Vec<u32>,
    boxes: Vec<Aabb>,
    packed: Option<EightBoxes>,
    outlines: OnceLock<Vec<Outline>>,
}

impl Family {
    fn of(inner: &Accel, node: u32) -> Self {
        let node = &inner.tree.nodes[node as usize];
        let lanes = 0..node.len as usize;
        let children = lanes.map(|lane| (node.children[lane], box_in_space(&inner.units, node, lane)));
        // What became empty by a refit is met by no ray.
        let (mut children, mut boxes): (Vec<_>, Vec<_>) =
            children.filter(|child| !child.1.is_empty()).unzip();
        if children.iter().any(|child| child >> tag::SHIFT != tag::INNER) {
            (children, boxes) = Default::default();
        }
        let packed: Vec<_> = boxes.iter().map(center_and_half).collect();
        let packed = (!packed.is_empty()).then(|| EightBoxes::new(&packed));
        Self { children, boxes, packed, outlines: OnceLock::new() }
    }

    /// By how much the areas of the boxes around the children are less than that of the box around all, if that is enough.
    fn gain(&self, map: &Transform, whole: &Aabb) -> f64 {
        let Some(boxes) = &self.packed else { return 0.0 };
        let (area, areas) = (whole.half_area(), boxes.placed_area(self.children.len(), map));
        if areas <= LARGEST_SHARE * area { area - areas } else { 0.0 }
    }

    /// The children, each with a box in the space around the instance.
    fn placed<'a>(
        &'a self,
        inner: &'a Accel,
        placement: &'a Placement,
        whole: &'a Aabb,
    ) -> impl Iterator<Item = (u32, Aabb)> + 'a {
        let outlines = self.outlines.get_or_init(|| {
            let own = self.children.iter().zip(&self.boxes);
            own.map(|(&child, &around)| Outline::below(inner, child, around, OUTLINE)).collect()
        });
        self.children.iter().zip(outlines).map(move |(&child, outline)| {
            let bounds = outline.at(placement);
            // Each bounds it, so that their common part does.
            (child, Aabb { min: bounds.min.max(whole.min), max: bounds.max.min(whole.max) })
        })
    }
}

/// What is known of trees that instances place: many are of one.
#[derive(Default)]
pub(crate) struct Families {
    known: HashMap<(usize, u32), Family>,
}

impl Families {
    fn key(instance: &Instance, node: u32) -> (usize, u32) {
        (Arc::as_ptr(&instance.accel).addr(), node)
    }

    fn get(&self, instance: &Instance, node: u32) -> &Family {
        &self.known[&Self::key(instance, node)]
    }

    fn learn(&mut self, instance: &Instance, node: u32) -> &Family {
        self.known.entry(Self::key(instance, node)).or_insert_with(|| Family::of(&instance.accel, node))
    }

    /// The boxes around those parts of a tree, whose nodes these are, in the space around the instance; `None` unless they
    /// together are all of the tree.
    fn boxes_of(&mut self, instance: &Instance, whole: &Aabb, nodes: &[u32]) -> Option<Vec<Aabb>> {
        let inner = &*instance.accel;
        inner.tree.root.filter(|root| root >> tag::SHIFT == tag::INNER)?;
        let mut places: Vec<(u32, usize)> = nodes.iter().copied().zip(0..).collect();
        places.sort_unstable();
        let mut boxes = vec![None; nodes.len()];
        let mut pending = vec![(0, *whole)];
        while let Some((node, around)) = pending.pop() {
            let family = self.learn(instance, node);
            if family.children.is_empty() {
                return None;
            }
            for (child, bounds) in family.placed(inner, &instance.world_from_object, &around) {
                match places.binary_search_by_key(&child, |place| place.0) {
                    Ok(found) => boxes[places[found].1] = Some(bounds),
                    Err(_) => pending.push((child, bounds)),
                }
            }
        }
        boxes.into_iter().collect()
    }
}

/// The instance that this is, if it stands still.
fn still(geometry: &Geometry) -> Option<(&Instance, &Transform)> {
    match &geometry.kind {
        GeometryKind::Instance(instance) => match &instance.world_from_object {
            Placement::Still(map) => Some((instance, map)),
            Placement::Moving(_) => None,
        },
        _ => None,
    }
}

/// Opens the instances among some primitives where that pays, into no more than `room` parts more than there are primitives.
/// They come back in the order of their names.
pub(crate) fn open(boxed: Vec<Boxed>, geometries: &[Geometry], room: usize) -> Vec<Boxed> {
    let of = |boxed: &Boxed| still(&geometries[boxed.geometry as usize]);
    let can_be_opened = |boxed: &Boxed| {
        let root = of(boxed).and_then(|(instance, _)| instance.accel.tree.root);
        root.is_some_and(|root| root >> tag::SHIFT == tag::INNER)
    };
    if !boxed.iter().any(can_be_opened) {
        return boxed;
    }
    let (mut parts, mut done): (Vec<_>, Vec<_>) = boxed.into_iter().partition(can_be_opened);
    let mut more = (MORE * parts.len() + MORE_FOR_ALL).min(room);
    let mut families = Families::default();
    // Level by level, so that threads share the work on one.
    while !parts.is_empty() {
        for part in &parts {
            if let Some((instance, _)) = of(part) {
                families.learn(instance, part.primitive);
            }
        }
        let gain = |part: &Boxed| {
            of(part)
                .map_or(0.0, |(instance, map)| families.get(instance, part.primitive).gain(map, &part.bounds))
        };
        let gains: Vec<f64> = parts.par_iter().with_min_len(256).map(gain).collect();
        let mut order: Vec<usize> = (0..parts.len()).filter(|&i| gains[i] > 0.0).collect();
        order.par_sort_unstable_by(|&a, &b| gains[b].total_cmp(&gains[a]).then(a.cmp(&b)));
        let mut is_opened = vec![false; parts.len()];
        for i in order {
            let Some((instance, _)) = of(&parts[i]) else { continue };
            let children = families.get(instance, parts[i].primitive).children.len();
            let Some(rest) = (more + 1).checked_sub(children) else { break };
            (more, is_opened[i]) = (rest, true);
        }
        let children = |part: &Boxed| -> Vec<Boxed> {
            let Some((instance, _)) = of(part) else { return Vec::new() };
            let family = families.get(instance, part.primitive);
            let placed = family.placed(&instance.accel, &instance.world_from_object, &part.bounds);
            let geometry = part.geometry;
            placed.map(|(primitive, bounds)| Boxed { bounds, geometry, primitive }).collect()
        };
        let opened = parts.par_iter().zip(&is_opened).with_min_len(256).filter(|(_, is_opened)| **is_opened);
        let next: Vec<Boxed> = opened.flat_map_iter(|(part, _)| children(part)).collect();
        let mut is_opened = is_opened.into_iter();
        parts.retain(|_| !is_opened.next().unwrap_or_default());
        done.append(&mut parts);
        parts = next;
    }
    done.sort_unstable_by_key(|boxed| (boxed.geometry, boxed.primitive));
    done
}

/// Where the entries of instances that were opened stand among all of a tree, by geometry.
pub(crate) fn opened(entries: &[Entry], geometries: &[Geometry]) -> BTreeMap<u32, Vec<usize>> {
    let mut found: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (place, entry) in entries.iter().enumerate() {
        if is_part(entry, geometries) {
            found.entry(entry.geometry).or_default().push(place);
        }
    }
    found
}

/// Whether an entry is of an instance that was opened.
pub(crate) fn is_part(entry: &Entry, geometries: &[Geometry]) -> bool {
    let kind = |geometry: &Geometry| matches!(geometry.kind, GeometryKind::Instance(_));
    entry.primitive() != Start::WHOLE.0 && geometries.get(entry.geometry as usize).is_some_and(kind)
}

/// What the entries of an opened instance stand for now, each with its box: parts of it, or the first for the whole. `whole` is
/// the box around it, if it is not empty.
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
