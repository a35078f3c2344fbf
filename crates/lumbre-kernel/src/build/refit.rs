//! Moves the contents of a tree without rebuilding it.

use std::fmt;

use lumbre_geometry::Aabb;
use lumbre_math::DVec3;
use rayon::prelude::*;

use crate::build::clouds::box_of;
use crate::build::error::BuildError;
use crate::build::input::{Boxer, Parts, take_apart, units_of};
use crate::build::open_instances::{self, Families};
use crate::build::primitive::Bounds;
use crate::intersect::Isa;
use crate::intersect::Portable;
use crate::tree::geometry::SphereCloud;
use crate::tree::geometry::has_area;
use crate::tree::node::{Node, TreeSpace, tag};
use crate::tree::packed::Entry;
use crate::tree::packed::Start;
use crate::tree::sphere_block::{SphereBlock, has_radius};
use crate::tree::triangle_block::{BlockIds, Blocks};
use crate::tree::{Geometry, GeometryKind, Tree};

/// Why a tree cannot be refitted. The tree stays unchanged.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum RefitError {
    /// The geometries themselves are invalid.
    Unsound(BuildError),
    /// The list has another length.
    OtherLength {
        /// Number of the tree's geometries.
        expected: usize,
        /// Number of geometries given.
        found: usize,
    },
    /// A geometry has another kind, or another number of primitives.
    OtherTopology {
        /// Position of the geometry in the list.
        geometry: usize,
    },
    /// Something that the build left out of the tree (a triangle without area, a sphere without a radius, an empty or
    /// an infinite primitive) would now be in it, or something in it became infinite. The tree needs a new build.
    NeedsBuild {
        /// Position of the geometry in the list.
        geometry: usize,
        /// The triangle, sphere or primitive.
        element: usize,
    },
}

impl fmt::Display for RefitError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unsound(error) => error.fmt(f),
            Self::OtherLength { expected, found } => {
                write!(f, "{found} geometries for a tree that was built of {expected}")
            }
            Self::OtherTopology { geometry } => {
                write!(f, "geometry {geometry} is not of the kind and size that the tree was built of")
            }
            Self::NeedsBuild { geometry, element } => {
                write!(f, "element {element} of geometry {geometry} has no place in the tree: build it again")
            }
        }
    }
}

impl std::error::Error for RefitError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Unsound(error) => Some(error),
            _ => None,
        }
    }
}

/// See [`Accel::refit`].
pub(crate) fn refit(tree: &mut Tree, geometries: Vec<Geometry>) -> Result<f64, RefitError> {
    if geometries.len() != tree.geometries.len() {
        return Err(RefitError::OtherLength { expected: tree.geometries.len(), found: geometries.len() });
    }
    for (geometry, (old, new)) in tree.geometries.iter().zip(&geometries).enumerate() {
        if !is_same_topology(&old.kind, &new.kind) {
            return Err(RefitError::OtherTopology { geometry });
        }
    }
    let parts = take_apart(&geometries).map_err(RefitError::Unsound)?;
    check_infinite(tree, &parts)?;
    let built_cost = tree.built_cost.unwrap_or_else(|| cost(&tree.packed.nodes));
    let old = std::mem::replace(&mut tree.geometries, geometries);
    match check_places(tree, &parts) {
        Ok(places) => {
            tree.packed.move_triangles(Isa::best(), &tree.geometries, &old, parts.has_flat);
            fit(tree, parts, places);
        }
        Err(error) => {
            tree.geometries = old;
            return Err(error);
        }
    }
    tree.built_cost = Some(built_cost);
    let cost = cost(&tree.packed.nodes);
    Ok(if built_cost > 0.0 { cost / built_cost } else { 1.0 })
}

/// The current places of a tree's entries.
pub(crate) struct Places {
    /// The box of each; `None` if it became empty.
    pub(crate) boxes: Vec<Option<Aabb>>,
    /// The entries of opened instances, and where each enters.
    pub(crate) starts: Vec<(usize, Start)>,
}

/// Checks that everything that can be hit has an entry. Returns the places of the entries.
pub(crate) fn check_places(tree: &Tree, parts: &Parts) -> Result<Places, RefitError> {
    check_triangles(tree, &tree.geometries)?;
    check_spheres(tree, &tree.geometries)?;
    entry_boxes(tree, parts)
}

/// Updates the nodes, spheres and entries of a tree. Triangles are already packed.
pub(crate) fn fit(tree: &mut Tree, parts: Parts, places: Places) {
    let Places { boxes, starts } = places;
    let geometries = &tree.geometries;
    let tree_space = units_of(geometries, &parts);
    let boxer = |geometry: &Geometry| match &geometry.kind {
        GeometryKind::Mesh(mesh) => Some(Boxer::new(mesh, &tree_space)),
        _ => None,
    };
    let boxers: Vec<Option<Boxer>> = geometries.iter().map(boxer).collect();
    let packed = &mut tree.packed;
    for (place, start) in starts {
        let old = packed.entries[place];
        if old.primitive() != start.word() {
            packed.entries.to_mut()[place] = Entry::new(old.geometry, start.word(), old.is_last());
        }
    }
    let cloud_boxes: Vec<Bounds> = packed
        .sphere_blocks
        .to_mut()
        .par_iter_mut()
        .zip(packed.sphere_ids.par_iter())
        .with_min_len(256)
        .map(|(block, ids)| match &geometries[ids.geometry as usize].kind {
            GeometryKind::Spheres(cloud) => fill_sphere_block(block, ids, cloud, &tree_space),
            _ => Bounds::EMPTY,
        })
        .collect();
    let entry_boxes: Vec<Bounds> = boxes
        .iter()
        .map(|boxed| boxed.map_or(Bounds::EMPTY, |bounds| Bounds::near(&tree_space, &bounds, 0, 0)))
        .collect();

    // Leaves first, then the nodes above: children follow their parents.
    let mut node_boxes = vec![Bounds::EMPTY; packed.nodes.len()];
    let (nodes, blocks) = (packed.nodes.to_mut(), Blocks::new(&packed.blocks));
    let (ids, entries) = (&*packed.ids, &*packed.entries);
    nodes.par_iter_mut().zip(&mut node_boxes).with_min_len(64).for_each(|(node, whole)| {
        for lane in 0..node.len() {
            let child = node.children[lane];
            let first = tag::place(child);
            let mut around = Bounds::EMPTY;
            match tag::of(child) {
                tag::INNER => continue,
                tag::TRIANGLES => {
                    for block in blocks.leaf(child) {
                        let ids = &ids[block.number() as usize];
                        if let Some(boxer) = &boxers[ids.geometry as usize] {
                            around.grow(&boxer.around_all::<Portable>(block.triangles()));
                        }
                    }
                }
                tag::SPHERES => {
                    cloud_boxes[tag::blocks(child)].iter().for_each(|bounds| around.grow(bounds));
                }
                _ => {
                    for (entry, bounds) in entries[first..].iter().zip(&entry_boxes[first..]) {
                        around.grow(bounds);
                        if entry.is_last() {
                            break;
                        }
                    }
                }
            }
            around.put(node, lane);
            whole.grow(&around);
        }
    });
    for place in (0..nodes.len()).rev() {
        let node = &mut nodes[place];
        for lane in 0..node.len() {
            let child = node.children[lane];
            if tag::is_inner(child) {
                let around = node_boxes[tag::place(child)];
                around.put(node, lane);
                node_boxes[place].grow(&around);
            }
        }
    }

    tree.summary.sizes = parts.sizes;
    tree.primitives = parts.count();
    tree.infinite = parts.infinite;
    tree.tree_space = tree_space;
    tree.bounds = parts.bounds;
    tree.follow();
}

fn is_same_topology(old: &GeometryKind, new: &GeometryKind) -> bool {
    match (old, new) {
        (GeometryKind::Mesh(old), GeometryKind::Mesh(new)) => old.indices.len() == new.indices.len(),
        (GeometryKind::Spheres(old), GeometryKind::Spheres(new)) => old.spheres.len() == new.spheres.len(),
        (GeometryKind::PreciseMesh(old), GeometryKind::PreciseMesh(new)) => {
            old.indices.len() == new.indices.len()
        }
        (GeometryKind::Custom(old), GeometryKind::Custom(new)) => {
            old.primitive_count() == new.primitive_count()
        }
        (GeometryKind::Shape(_), GeometryKind::Shape(_))
        | (GeometryKind::Instance(_), GeometryKind::Instance(_)) => true,
        _ => false,
    }
}

/// Checks that the same geometries are infinite as before.
fn check_infinite(tree: &Tree, parts: &Parts) -> Result<(), RefitError> {
    let name = |entry: &Entry| (entry.geometry, entry.primitive());
    let (mut old, mut new) = (tree.infinite.iter().map(name), parts.infinite.iter().map(name));
    loop {
        match (old.next(), new.next()) {
            (None, None) => return Ok(()),
            (old, new) if old == new => {}
            (old, new) => {
                let (geometry, element) = old.min(new).or(old).or(new).unwrap_or_default();
                return Err(RefitError::NeedsBuild {
                    geometry: geometry as usize,
                    element: element as usize,
                });
            }
        }
    }
}

/// Checks that every triangle with an area is in the tree.
fn check_triangles(tree: &Tree, geometries: &[Geometry]) -> Result<(), RefitError> {
    let mut named = vec![0; geometries.len()];
    for ids in &tree.packed.ids {
        let count = ids.primitives.iter().filter(|&&primitive| primitive != u32::MAX).count();
        named[ids.geometry as usize] += count;
    }
    for (geometry, standing) in geometries.iter().enumerate() {
        let GeometryKind::Mesh(mesh) = &standing.kind else { continue };
        if named[geometry] == mesh.indices.len() {
            continue;
        }
        let mut has_place = vec![false; mesh.indices.len()];
        for ids in tree.packed.ids.iter().filter(|ids| ids.geometry as usize == geometry) {
            for &primitive in ids.primitives.iter().filter(|&&primitive| primitive != u32::MAX) {
                has_place[primitive as usize] = true;
            }
        }
        let missing = (0..mesh.indices.len()).find(|&triangle| {
            let corners = mesh.indices[triangle].map(|vertex| mesh.positions[vertex as usize]);
            !has_place[triangle] && has_area(&corners)
        });
        if let Some(element) = missing {
            return Err(RefitError::NeedsBuild { geometry, element });
        }
    }
    Ok(())
}

/// Checks that every sphere with a radius is in the tree.
fn check_spheres(tree: &Tree, geometries: &[Geometry]) -> Result<(), RefitError> {
    let is_cloud = |geometry: &Geometry| matches!(geometry.kind, GeometryKind::Spheres(_));
    if !geometries.iter().any(is_cloud) {
        return Ok(());
    }
    let mut has_place: Vec<Vec<bool>> = geometries
        .iter()
        .map(|geometry| match &geometry.kind {
            GeometryKind::Spheres(cloud) => vec![false; cloud.spheres.len()],
            _ => Vec::new(),
        })
        .collect();
    for ids in &tree.packed.sphere_ids {
        for &primitive in ids.primitives.iter().filter(|&&primitive| primitive != u32::MAX) {
            has_place[ids.geometry as usize][primitive as usize] = true;
        }
    }
    for (geometry, standing) in geometries.iter().enumerate() {
        let GeometryKind::Spheres(cloud) = &standing.kind else { continue };
        let mut places = cloud.spheres.iter().zip(&has_place[geometry]);
        if let Some(element) = places.position(|(sphere, has_place)| !has_place && has_radius(sphere)) {
            return Err(RefitError::NeedsBuild { geometry, element });
        }
    }
    Ok(())
}

/// The current places of the tree's entries.
fn entry_boxes(tree: &Tree, parts: &Parts) -> Result<Places, RefitError> {
    let (entries, geometries) = (&*tree.packed.entries, &tree.geometries);
    // Sorted by id, as they were taken apart.
    let mut has_place = vec![false; parts.boxed.len()];
    let mut boxes: Vec<Option<Aabb>> = entries
        .iter()
        .map(|entry| {
            let primitive = if open_instances::is_part(entry, geometries) { 0 } else { entry.primitive() };
            let name = (entry.geometry, primitive);
            let found = parts.boxed.binary_search_by_key(&name, |boxed| (boxed.geometry, boxed.primitive));
            found.ok().map(|place| {
                has_place[place] = true;
                parts.boxed[place].bounds
            })
        })
        .collect();
    if let Some(missing) = has_place.iter().position(|&has_place| !has_place) {
        let boxed = &parts.boxed[missing];
        return Err(RefitError::NeedsBuild {
            geometry: boxed.geometry as usize,
            element: boxed.primitive as usize,
        });
    }
    let mut families = Families::default();
    let mut starts = Vec::new();
    for (geometry, places) in open_instances::opened(entries, geometries) {
        let GeometryKind::Instance(instance) = &geometries[geometry as usize].kind else { continue };
        let old: Vec<Start> = places.iter().map(|&place| Start::of(entries[place].primitive())).collect();
        let now = open_instances::starts_of(&mut families, instance, boxes[places[0]], &old);
        for (place, (start, bounds)) in places.into_iter().zip(now) {
            boxes[place] = bounds;
            starts.push((place, start));
        }
    }
    Ok(Places { boxes, starts })
}

/// Updates the spheres of a block; one without a radius becomes one that is never hit.
fn fill_sphere_block(
    block: &mut SphereBlock,
    ids: &BlockIds,
    cloud: &SphereCloud,
    tree_space: &TreeSpace,
) -> Bounds {
    let mut around = Bounds::EMPTY;
    for (lane, &primitive) in ids.primitives.iter().enumerate() {
        if primitive == u32::MAX {
            continue;
        }
        let sphere = cloud.spheres[primitive as usize];
        if has_radius(&sphere) {
            around.grow(&box_of(cloud, primitive, tree_space));
            block.put(lane, sphere);
        } else {
            block.put(lane, [f32::NAN; 4]);
        }
    }
    around
}

/// Approximate number of boxes that a ray meets: the sum of their areas over the area of the whole.
pub(crate) fn cost(nodes: &[Node]) -> f64 {
    let area = |node: &Node, lane: usize| {
        let size =
            |axis: usize| f64::from(node.planes[2 * axis + 1][lane] - node.planes[2 * axis][lane]).max(0.0);
        size(0) * size(1) + size(1) * size(2) + size(2) * size(0)
    };
    let Some(root) = nodes.first() else { return 0.0 };
    let whole = {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for lane in 0..root.len() {
            let corner =
                |side: usize| DVec3::from_array([0, 2, 4].map(|axis| root.planes[axis + side][lane].into()));
            (low, high) = (low.min(corner(0)), high.max(corner(1)));
        }
        let size = (high - low).max(DVec3::ZERO);
        size.x * size.y + size.y * size.z + size.z * size.x
    };
    let lanes = |node: &Node| (0..node.len()).map(|lane| area(node, lane)).sum::<f64>();
    let all: f64 = nodes.iter().map(lanes).sum();
    if whole > 0.0 { all / whole } else { 0.0 }
}
