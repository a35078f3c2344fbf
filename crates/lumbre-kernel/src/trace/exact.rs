//! The traversal in double precision: every crossing, for any visitor, in any tree.
//!
//! It answers when single precision is uncertain (see [`filtered`](super::filtered)), finds all hits, and is the oracle
//! of the other traversals. A visitor's results never depend on the order of the traversal: leaves are tested with the
//! ray's full range, so that a crossing has the same bits whenever it is found, and ties have a fixed order.
//!
//! There is no recursion, because the input decides how deeply instances nest: an instance suspends the frame around
//! it.

use lumbre_geometry::{Ray, Root};
use lumbre_math::DVec3;

use super::cloud_ray::CloudRay;
use super::cursor::NodeCursor;
use super::edges::{self, EdgeHit, Patch};
use super::stack::{ClosestHit, Goal, Stack};
use super::visitor::{Crossing, Visitor, Wanted};
use super::visitors::{Any, Closest};
use super::{Context, all_crossings, first_crossing, is_sound, largest_component};
use crate::hit::Hit;
use crate::intersect::box_ray::{BoxRay, Progress};
use crate::intersect::watertight::{self, BlockRay, EdgeTest, HeightRange, Shear};
use crate::intersect::{self, BoundingHits, Dispatch, Isa, Simd};
use crate::query::Query;
use crate::tree::BLOCK;
use crate::tree::bounding_block::BoundingVolumeRay;
use crate::tree::node::tag;
use crate::tree::packed::Entry;
use crate::tree::packed::Start;
use crate::tree::summary::{Sizes, Summary};
use crate::tree::triangle_block::{Blocks, TriangleBlock};
use crate::tree::{GeometryKind, Tree};

/// The closest hit.
#[inline(never)]
pub(crate) fn closest(isa: Isa, tree: &Tree, ray: &Ray, query: Option<&Query>) -> Option<Hit> {
    closest_from(isa, tree, Start::WHOLE, &Context::default(), ray, query)
}

/// Whether anything is hit.
#[inline(never)]
pub(crate) fn any(isa: Isa, tree: &Tree, ray: &Ray, query: Option<&Query>) -> bool {
    any_from(isa, tree, Start::WHOLE, &Context::default(), ray, query)
}

/// The closest hit in a part of a tree in this context.
pub(crate) fn closest_from(
    isa: Isa,
    tree: &Tree,
    from: Start,
    context: &Context,
    ray: &Ray,
    query: Option<&Query>,
) -> Option<Hit> {
    let mut closest = Closest::new(ray, query);
    traverse_from(isa, tree, from, context, ray, &mut closest);
    closest.into_hit()
}

/// Whether anything is hit in a part of a tree in this context.
pub(crate) fn any_from(
    isa: Isa,
    tree: &Tree,
    from: Start,
    context: &Context,
    ray: &Ray,
    query: Option<&Query>,
) -> bool {
    let mut any = Any::new(ray, query);
    traverse_from(isa, tree, from, context, ray, &mut any);
    any.is_hit
}

/// Shows a visitor the crossings of a ray.
pub(crate) fn traverse(isa: Isa, tree: &Tree, ray: &Ray, visitor: &mut dyn Visitor) {
    traverse_from(isa, tree, Start::WHOLE, &Context::default(), ray, visitor);
}

/// As [`traverse`], in a part of a tree in this context. It may show edge hits of the whole tree.
fn traverse_from(
    isa: Isa,
    tree: &Tree,
    from: Start,
    context: &Context,
    ray: &Ray,
    visitor: &mut dyn Visitor,
) {
    let context = &mut context.clone();
    let mut edge_hits = Vec::new();
    let traversal = Traversal { tree, from, context, ray, visitor: &mut *visitor, edge_hits: &mut edge_hits };
    let is_over = isa.run(traversal);
    if !is_over && !edge_hits.is_empty() {
        visit_borders(isa, tree, context, ray, &edge_hits, visitor);
    }
}

/// Shows a visitor the hits at borders, given the edge hits that the traversal found.
#[cold]
#[inline(never)]
fn visit_borders(
    isa: Isa,
    tree: &Tree,
    context: &mut Context,
    ray: &Ray,
    edge_hits: &[EdgeHit],
    visitor: &mut dyn Visitor,
) {
    let matters = |hit: &EdgeHit, [first, last]: [f64; 2]| {
        let t = hit.root.t;
        !hit.is_owned && ray.contains(t) && first <= t && t <= last
    };
    // More triangles can only remove borders: without any now, there are none.
    if !edges::at_borders(edge_hits).iter().any(|&i| matters(&edge_hits[i], visitor.range())) {
        return;
    }
    // Some neighbours may lie beyond the traversed range.
    let all = all_edge_hits(isa, tree, context, ray);
    for i in edges::at_borders(&all) {
        if matters(&all[i], visitor.range()) && visitor.visit(&all[i].crossing(ray)) {
            return;
        }
    }
}

/// The edge hits of the whole line, in a tree in this context.
fn all_edge_hits<'a>(isa: Isa, tree: &'a Tree, context: &mut Context, ray: &Ray) -> Vec<EdgeHit<'a>> {
    /// Searches the whole line.
    struct EdgeHitsOnly;
    impl Visitor for EdgeHitsOnly {
        fn wanted(&self) -> Wanted {
            Wanted::None
        }
        fn range(&self) -> [f64; 2] {
            [f64::NEG_INFINITY, f64::INFINITY]
        }
        fn visit(&mut self, _: &Crossing) -> bool {
            false
        }
    }
    let line = ray.with_range(f64::NEG_INFINITY, f64::INFINITY);
    let mut edge_hits = Vec::new();
    isa.run(Traversal {
        tree,
        from: Start::WHOLE,
        context,
        ray: &line,
        visitor: &mut EdgeHitsOnly,
        edge_hits: &mut edge_hits,
    });
    edge_hits
}

/// The traversal of one ray.
struct Traversal<'a, 't> {
    tree: &'a Tree,
    from: Start,
    /// Restored at the end of the traversal, unless the visitor ended it.
    context: &'t mut Context,
    ray: &'t Ray,
    visitor: &'t mut dyn Visitor,
    /// Triangles that the ray meets exactly at an edge or a corner.
    edge_hits: &'t mut Vec<EdgeHit<'a>>,
}

impl Dispatch for Traversal<'_, '_> {
    /// Whether the visitor ended the traversal.
    type Output = bool;

    #[inline(always)]
    fn run<L: Simd>(self) -> bool {
        let Self { tree, from, context, ray, visitor, edge_hits } = self;
        if !is_sound(ray) {
            return false;
        }
        let mut stack: Stack<<ClosestHit as Goal>::Entry> = Stack::new();
        let mut suspended: Vec<Frame<L>> = Vec::new();
        let mut frame = Frame::<L>::new(tree, *ray, visitor);
        if frame.enter(from, context, &mut stack, visitor) {
            return true;
        }
        while let Some(leaf) = frame.cursor.next_leaf::<ClosestHit>(&mut stack) {
            let first = tag::place(leaf);
            let is_over = match tag::of(leaf) {
                tag::TRIANGLES => frame.test_triangles(leaf, context, visitor, edge_hits),
                tag::SPHERES => frame.test_spheres(leaf, context, visitor),
                tag::SHAPES => frame.test_shapes(first, context, visitor, edge_hits),
                tag::PRECISE => frame.test_precise(first, context, visitor, edge_hits),
                tag::CUSTOM => frame.test_entries(first, context, visitor, edge_hits),
                tag::INSTANCE => {
                    let entry = frame.tree.instance_entry(first);
                    match frame.inside(entry, visitor) {
                        Some((inner, from)) => {
                            stack.push(ClosestHit::entry(tag::reference(tag::RETURN, 0)));
                            context.route.push(entry.geometry);
                            context.ids.push(frame.tree.geometries[entry.geometry as usize].id);
                            suspended.push(std::mem::replace(&mut frame, inner));
                            frame.enter(from, context, &mut stack, visitor)
                        }
                        None => false,
                    }
                }
                tag::RETURN => {
                    frame = suspended.pop().expect("a mark for every frame");
                    context.route.pop();
                    context.ids.pop();
                    false
                }
                _ => unreachable!("no other tags"),
            };
            if is_over {
                return true;
            }
            frame.shorten(visitor);
        }
        false
    }
}

/// A tree under traversal, with the ray in its space.
struct Frame<'a, L> {
    tree: &'a Tree,
    cursor: NodeCursor<'a, L>,
    blocks: Blocks<'a>,
    ray: Ray,
    progress: Progress,
    /// Whether the ray meets the bounds of the tree.
    meets_tree: bool,
    wanted: Wanted,
    range: [f64; 2],
    /// Prepared for the last mesh, sphere cloud and shapes that the ray came to.
    mesh: Option<MeshRay>,
    cloud: Option<CloudRay>,
    bounding_volumes: Option<BoundingVolumeRay>,
}

/// The ray for the triangles of one mesh, or of several meshes with one origin.
#[derive(Clone, Copy)]
struct MeshRay {
    shear: Shear,
    /// Relative to the mesh's origin.
    origin: [f64; 3],
    /// `None` if single precision is too coarse.
    blocks: Option<BlockRay>,
}

impl<'a, L: Simd> Frame<'a, L> {
    #[inline(always)]
    fn new(tree: &'a Tree, ray: Ray, visitor: &dyn Visitor) -> Self {
        let range @ [t_min, t_max] = visitor.range();
        let mut boxes = BoxRay::passing_all();
        let meets_tree = tree.packed.root.is_some()
            && (L::start_nearby(&tree.tree_space, &ray, t_min, t_max, &mut boxes)
                || is_sound(&ray) && boxes.start_anywhere(&tree.tree_space, &ray, t_min, t_max));
        Self {
            tree,
            cursor: NodeCursor::new(&tree.packed.nodes, boxes.slabs),
            blocks: tree.packed.blocks(),
            ray,
            progress: boxes.progress,
            meets_tree,
            wanted: visitor.wanted(),
            range,
            mesh: None,
            cloud: None,
            bounding_volumes: None,
        }
    }

    /// Starts on a part of the tree: tests unbounded geometry and pushes the rest onto the stack. True ends the
    /// traversal.
    fn enter(
        &mut self,
        from: Start,
        context: &Context,
        stack: &mut Stack<<ClosestHit as Goal>::Entry>,
        visitor: &mut dyn Visitor,
    ) -> bool {
        if let Some(root) = self.tree.packed.root.filter(|_| self.meets_tree) {
            stack.push(ClosestHit::entry(from.below(root)));
        }
        for (i, entry) in self.tree.infinite.iter().enumerate() {
            if matches!(self.tree.geometries[entry.geometry as usize].kind, GeometryKind::Instance(_)) {
                let index = self.tree.packed.entries.len() + i;
                stack.push(ClosestHit::entry(tag::reference(tag::INSTANCE, index as u32)));
            } else if self.test_primitive(entry.geometry, entry.primitive(), context, visitor) {
                return true;
            }
        }
        self.shorten(visitor);
        false
    }

    /// Shortens the ray to the visitor's range.
    #[inline(always)]
    fn shorten(&mut self, visitor: &dyn Visitor) {
        let [_, limit] = visitor.range();
        if limit < self.range[1] {
            self.range[1] = limit;
            self.cursor.slabs.end_at(self.progress.up(limit));
            if let Some(MeshRay { shear, blocks: Some(blocks), .. }) = &mut self.mesh {
                blocks.end_at(shear, limit);
            }
        }
    }

    /// The frame inside an instance, and the part of its tree to enter; `None` if the visitor wants nothing there.
    #[inline(always)]
    fn inside(&self, entry: &Entry, visitor: &dyn Visitor) -> Option<(Self, Start)> {
        let (geometry, from) = (entry.geometry, Start::of(entry.primitive()));
        if from.is_nothing() || !visitor.enters(self.tree, geometry) {
            return None;
        }
        let GeometryKind::Instance(instance) = &self.tree.geometries[geometry as usize].kind else {
            unreachable!("the tag says so");
        };
        let inner = &*instance.tree;
        let ray = instance.world_from_object.object_ray(&self.ray);
        let frame = Self::new(inner, ray, visitor);
        let meets_any = frame.meets_tree || !inner.infinite.is_empty() && is_sound(&ray);
        meets_any.then_some((frame, from))
    }

    /// Shows the visitor a crossing in the ray's range. True ends the traversal.
    #[inline(always)]
    fn visit(
        &self,
        root: Root,
        (geometry, primitive, order): (u32, u32, u32),
        is_front: Option<bool>,
        context: &Context,
        visitor: &mut dyn Visitor,
    ) -> bool {
        let &Self { tree, ref ray, .. } = self;
        let first = root;
        visitor.visit(&Crossing { root, first, geometry, primitive, order, is_front, ray, tree, context })
    }

    /// Prepares the ray for the mesh of a block: for the first one, and for each one if meshes have different origins.
    #[inline(always)]
    fn turn_to(&mut self, block: &TriangleBlock) -> MeshRay {
        let &Summary { has_one_origin, first_origin, sizes: Sizes { largest_corner, .. }, .. } =
            &self.tree.summary;
        if has_one_origin && let Some(mesh) = self.mesh {
            return mesh;
        }
        let shear = self.mesh.map_or_else(|| Shear::new(&self.ray.direction), |mesh| mesh.shear);
        let mesh_origin = if has_one_origin {
            first_origin
        } else {
            self.tree.mesh_origin(self.tree.packed.ids[block.number() as usize].geometry)
        };
        let origin = shear.local_origin(&self.ray.origin, &mesh_origin);
        let [t_min, t_max] = self.range;
        let blocks = BlockRay::new(&shear, &origin, largest_corner, t_min, t_max);
        *self.mesh.insert(MeshRay { shear, origin, blocks })
    }

    /// Tests a leaf of triangles.
    #[inline(always)]
    fn test_triangles(
        &mut self,
        leaf: u32,
        context: &Context,
        visitor: &mut dyn Visitor,
        edge_hits: &mut Vec<EdgeHit<'a>>,
    ) -> bool {
        // A leaf has triangles of one mesh only.
        let MeshRay { shear, origin, blocks } = self.turn_to(self.blocks.block(leaf & tag::PLACE));
        let mut following = Some(leaf & tag::PLACE);
        while let Some(place) = following {
            let block = self.blocks.block(place);
            following = block.next(place);
            let mut mask = match &blocks {
                Some(ray) => {
                    let (mask, edges) = L::intersect_triangles(block, ray);
                    if mask == 0 {
                        continue;
                    }
                    mask & edges.place(ray).in_range
                }
                None => block.taken(),
            };
            while mask != 0 {
                let lane = mask.trailing_zeros() as usize % BLOCK;
                mask &= mask - 1;
                let ids = || {
                    let ids = &self.tree.packed.ids[block.number() as usize];
                    (ids.geometry, ids.primitives[lane])
                };
                match L::pass(block, lane, &shear, &origin) {
                    (EdgeTest::Outside, _) => {}
                    (EdgeTest::Inside, inside) => {
                        let t = inside.t(&shear);
                        let is_wanted =
                            self.range[0] <= t && t <= self.range[1] && self.wanted != Wanted::None;
                        if !is_wanted || !watertight::is_in_range(&self.ray, t) {
                            continue;
                        }
                        let (geometry, primitive) = ids();
                        let ids = (geometry, primitive, 0);
                        if self.visit(inside.root(t), ids, Some(inside.det > 0.0), context, visitor) {
                            return true;
                        }
                    }
                    (EdgeTest::Uncertain, _) => {
                        let corners = shear.axes.gather(block, lane);
                        let meeting = watertight::intersect(&self.ray, shear, origin, corners);
                        let corners = block.triangle(lane).map(|corner| corner.map(f64::from));
                        let triangle = edges::Triangle { corners, ids: ids(), tree: self.tree };
                        if triangle.visit(meeting, &self.ray, context, visitor, edge_hits) {
                            return true;
                        }
                    }
                }
            }
        }
        false
    }

    /// Tests a leaf of spheres of clouds.
    #[inline(always)]
    fn test_spheres(&mut self, leaf: u32, context: &Context, visitor: &mut dyn Visitor) -> bool {
        let packed = &self.tree.packed;
        let places = tag::blocks(leaf);
        for (ids, block) in packed.sphere_ids[places.clone()].iter().zip(&packed.sphere_blocks[places]) {
            let cloud = CloudRay::turn(&mut self.cloud, self.tree, &self.ray, ids.geometry);
            let mut mask = match cloud.within(self.range) {
                Some(ray) => intersect::intersect_spheres::<L>(block, ray).0,
                None => ids.lanes(),
            };
            while mask != 0 {
                let lane = mask.trailing_zeros() as usize % BLOCK;
                mask &= mask - 1;
                if self.test_primitive(ids.geometry, ids.primitives[lane], context, visitor) {
                    return true;
                }
            }
        }
        false
    }

    /// Tests the shapes of a leaf whose bounding volumes are hit.
    #[inline(always)]
    fn test_shapes(
        &mut self,
        mut first: usize,
        context: &Context,
        visitor: &mut dyn Visitor,
        edge_hits: &mut Vec<EdgeHit<'a>>,
    ) -> bool {
        let tree = self.tree;
        if !self.progress.is_nearby() || tree.bounding_volumes.block(first).is_none() {
            return self.test_entries(first, context, visitor, edge_hits);
        }
        let length = largest_component(&self.ray);
        let bounding_volumes = *self
            .bounding_volumes
            .get_or_insert_with(|| BoundingVolumeRay::new(&tree.tree_space, &self.ray, length));
        let range = HeightRange::new((self.range[0] * length) as f32, (self.range[1] * length) as f32);
        while let Some((block, goes_on)) = tree.bounding_volumes.block(first) {
            let BoundingHits { mut mask, .. } =
                intersect::intersect_bounding_volumes::<L, false>(block, &bounding_volumes, &range);
            while mask != 0 {
                let entry = &tree.packed.entries[first + mask.trailing_zeros() as usize];
                mask &= mask - 1;
                if self.test_entry(entry, context, visitor, edge_hits) {
                    return true;
                }
            }
            if !goes_on {
                break;
            }
            first += BLOCK;
        }
        false
    }

    /// Tests a leaf of triangles in double precision.
    fn test_precise(
        &mut self,
        first: usize,
        context: &Context,
        visitor: &mut dyn Visitor,
        edge_hits: &mut Vec<EdgeHit<'a>>,
    ) -> bool {
        for entry in &self.tree.packed.entries[first..] {
            let (geometry, primitive) = (entry.geometry, entry.primitive());
            let meeting = edges::intersect_precise(self.tree, &self.ray, geometry, primitive);
            if !matches!(meeting, watertight::Meeting::Miss) {
                let corners =
                    self.tree.precise_corners(geometry, primitive).map(|corner: DVec3| corner.to_array());
                let triangle = edges::Triangle { corners, ids: (geometry, primitive), tree: self.tree };
                if triangle.visit(meeting, &self.ray, context, visitor, edge_hits) {
                    return true;
                }
            }
            if entry.is_last() {
                break;
            }
        }
        false
    }

    /// Tests a leaf of user geometry, or of shapes one by one.
    fn test_entries(
        &self,
        first: usize,
        context: &Context,
        visitor: &mut dyn Visitor,
        edge_hits: &mut Vec<EdgeHit<'a>>,
    ) -> bool {
        for entry in &self.tree.packed.entries[first..] {
            if self.test_entry(entry, context, visitor, edge_hits) {
                return true;
            }
            if entry.is_last() {
                break;
            }
        }
        false
    }

    /// Tests a shape or a primitive of user geometry.
    #[inline(always)]
    fn test_entry(
        &self,
        entry: &Entry,
        context: &Context,
        visitor: &mut dyn Visitor,
        edge_hits: &mut Vec<EdgeHit<'a>>,
    ) -> bool {
        let (tree, geometry) = (self.tree, entry.geometry);
        if let Some(patch) = Patch::of(&tree.geometries[geometry as usize].kind) {
            return patch.visit((tree, geometry), &self.ray, context, visitor, edge_hits);
        }
        self.test_primitive(entry.geometry, entry.primitive(), context, visitor)
    }

    /// Shows the visitor the crossings of a primitive other than a triangle, bilinear patch or instance.
    fn test_primitive(
        &self,
        geometry: u32,
        primitive: u32,
        context: &Context,
        visitor: &mut dyn Visitor,
    ) -> bool {
        visit_primitive(self.tree, &self.ray, (geometry, primitive), self.wanted, context, visitor)
    }
}

/// Shows a visitor the crossings of a primitive other than a triangle, bilinear patch or instance. True ends the
/// traversal.
pub(crate) fn visit_primitive(
    tree: &Tree,
    ray: &Ray,
    (geometry, primitive): (u32, u32),
    wanted: Wanted,
    context: &Context,
    visitor: &mut dyn Visitor,
) -> bool {
    let kind = &tree.geometries[geometry as usize].kind;
    let mut first = Root::at(f64::NAN);
    let mut visit = |root: Root, order: usize| {
        let order = order as u32;
        if root.t != first.t {
            first = root;
        }
        // Also rejects NaN.
        ray.contains(root.t)
            && visitor.visit(&Crossing {
                root,
                first,
                geometry,
                primitive,
                order,
                is_front: None,
                ray,
                tree,
                context,
            })
    };
    match wanted {
        Wanted::None => false,
        Wanted::First => first_crossing(kind, primitive, ray).is_some_and(|root| visit(root, 0)),
        Wanted::Every => {
            let crossings = all_crossings(kind, primitive, ray);
            crossings.into_iter().enumerate().any(|(order, root)| visit(root, order))
        }
    }
}
