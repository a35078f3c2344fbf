//! Rays exactly through edges and vertices.
//!
//! The rule for zeros (see [`watertight`]) gives each crossing of an edge or vertex inside a mesh one owner. At the
//! border of an open mesh it may give none: the ray, moved by its ε, misses the mesh. A triangle is closed, so such a
//! crossing still counts, once. An edge is a border if the faces that the ray hits at that point say so; no mesh needs
//! a table of its neighbours. Corners are compared by position, so that a mesh whose corners are split for their
//! normals or texture coordinates stays closed. A bilinear patch decides about its edges by the same rule, and forms
//! one surface with neighbouring patches and meshes.

use std::collections::{HashMap, HashSet};

use lumbre_geometry::{BilinearPatch, PatchCrossings, PatchPlace, PlacedShape, Ray, Root, Shape};
use lumbre_math::{DVec3, Transform};
use smallvec::SmallVec;

use super::Context;
use super::visitor::{Crossing, Visitor, Wanted};
use crate::intersect::watertight::{self, Feature, Meeting, Shear};
use crate::tree::precise_mesh::has_area;
use crate::tree::{GeometryKind, Tree};

/// A face (a triangle or a bilinear patch) whose edge or corner a ray hits exactly.
#[derive(Clone, Debug)]
pub(crate) struct EdgeHit<'a> {
    /// The crossing; it may lie outside the ray's range.
    pub(super) root: Root,
    /// Whether the rule for zeros gives the crossing to this face, so that it was visited already.
    pub(super) is_owned: bool,
    /// `None` for patches, which compute it on demand.
    is_front: Option<bool>,
    place: Place,
    /// The corners in order, in `space`.
    outline: Outline,
    /// For patches, and meshes next to them: the map from the space of the corners.
    space: Space,
    geometry: u32,
    primitive: u32,
    /// Which of the primitive's crossings.
    order: u32,
    tree: &'a Tree,
    context: Context,
}

type Outline = SmallVec<[Position; 4]>;

/// A place on a face's outline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    Edge([Position; 2]),
    Corner(Position),
    /// Seen on edge: never hit, but a neighbour of other faces.
    EdgeOn,
}

impl EdgeHit<'_> {
    pub(super) fn crossing<'c>(&'c self, ray: &'c Ray) -> Crossing<'c> {
        let &Self { root, is_front, geometry, primitive, order, tree, ref context, .. } = self;
        Crossing { root, first: root, geometry, primitive, order, is_front, ray, tree, context }
    }

    fn is_patch(&self) -> bool {
        matches!(self.tree.geometries[self.geometry as usize].kind, GeometryKind::Shape(_))
    }

    /// The edges by their ends, without edges of length zero.
    fn edges(&self) -> impl Iterator<Item = [Position; 2]> {
        let next = self.outline.iter().cycle().skip(1);
        self.outline.iter().zip(next).filter(|(a, b)| a != b).map(|(&a, &b)| key(a, b))
    }
}

/// A bilinear patch of a tree.
#[derive(Clone, Copy)]
pub(crate) struct Patch<'a> {
    placed: &'a PlacedShape,
    patch: &'a BilinearPatch,
}

impl<'a> Patch<'a> {
    /// `None` for any other geometry.
    #[inline(always)]
    pub(crate) fn of(kind: &'a GeometryKind) -> Option<Self> {
        let GeometryKind::Shape(placed) = kind else { return None };
        let Shape::BilinearPatch(patch) = placed.shape() else { return None };
        Some(Self { placed, patch })
    }

    /// How the line of a ray crosses the patch.
    #[inline(never)]
    pub(crate) fn line_crossings(self, ray: &Ray) -> PatchCrossings {
        self.patch.line_crossings(&self.placed.object_ray(ray))
    }

    /// Shows a visitor the crossings that the patch owns, and collects its edge hits. True ends the traversal.
    pub(crate) fn visit<'e>(
        self,
        (tree, geometry): (&'e Tree, u32),
        ray: &Ray,
        context: &Context,
        visitor: &mut dyn Visitor,
        edge_hits: &mut Vec<EdgeHit<'e>>,
    ) -> bool {
        let PatchCrossings { of_line, is_edge_on } = self.line_crossings(ray);
        let corners = self.patch.outline().map(|corner| position(corner.to_array()));
        let mut collect = |root: Root, is_owned: bool, place: Place, order: u32| {
            edge_hits.push(EdgeHit {
                root,
                is_owned,
                is_front: None,
                place,
                outline: Outline::from_slice(&corners),
                space: Space::of(&self.placed.world_from_object()),
                geometry,
                primitive: 0,
                order,
                tree,
                context: context.clone(),
            });
        };
        if is_edge_on {
            collect(Root::at(f64::NAN), false, Place::EdgeOn, 0);
        }
        for (order, crossing) in (0..).zip(&of_line) {
            let place = match crossing.place {
                None => continue,
                Some(PatchPlace::Corner(corner)) => Place::Corner(corners[corner]),
                Some(PatchPlace::Edge(edge)) => Place::Edge(key(corners[edge], corners[(edge + 1) % 4])),
            };
            collect(crossing.root, crossing.is_owned, place, order);
        }
        if visitor.wanted() == Wanted::None {
            return false;
        }
        let mut first = Root::at(f64::NAN);
        for (order, crossing) in (0..).zip(&of_line) {
            let root = crossing.root;
            if !crossing.is_owned || !ray.contains(root.t) {
                continue;
            }
            if root.t != first.t {
                first = root;
            }
            let is_front = None;
            let crossing =
                Crossing { root, first, geometry, primitive: 0, order, is_front, ray, tree, context };
            if visitor.visit(&crossing) {
                return true;
            }
        }
        false
    }
}

/// A triangle that a ray may hit at an edge.
pub(crate) struct Triangle<'a> {
    pub(crate) corners: [[f64; 3]; 3],
    /// Geometry and primitive.
    pub(crate) ids: (u32, u32),
    pub(crate) tree: &'a Tree,
}

impl<'a> Triangle<'a> {
    /// Shows a visitor the crossing, and collects an edge hit. True ends the traversal.
    pub(crate) fn visit(
        self,
        meeting: Meeting,
        ray: &Ray,
        context: &Context,
        visitor: &mut dyn Visitor,
        edge_hits: &mut Vec<EdgeHit<'a>>,
    ) -> bool {
        let Self { corners, ids: (geometry, primitive), tree } = self;
        let (root, is_front) = match meeting {
            Meeting::Miss => return false,
            Meeting::Hit { root, is_front } => (root, is_front),
            Meeting::Touch { root, is_owned, feature, is_front } => {
                let corners = corners.map(position);
                let place = match feature {
                    Feature::Edge(opposite) => {
                        Place::Edge(key(corners[(opposite + 1) % 3], corners[(opposite + 2) % 3]))
                    }
                    Feature::Vertex(corner) => Place::Corner(corners[corner]),
                    Feature::EdgeOn => Place::EdgeOn,
                };
                edge_hits.push(EdgeHit {
                    root,
                    is_owned,
                    is_front: Some(is_front),
                    place,
                    outline: Outline::from_slice(&corners),
                    space: Space::of_mesh(tree, geometry),
                    geometry,
                    primitive,
                    order: 0,
                    tree,
                    context: context.clone(),
                });
                if !is_owned || !ray.contains(root.t) {
                    return false;
                }
                (root, is_front)
            }
        };
        let is_front = Some(is_front);
        let (first, order) = (root, 0);
        visitor.visit(&Crossing { root, first, geometry, primitive, order, is_front, ray, tree, context })
    }
}

/// The meeting of a ray and a triangle in double precision.
pub(crate) fn intersect_precise(tree: &Tree, ray: &Ray, geometry: u32, primitive: u32) -> Meeting {
    let corners = tree.precise_corners(geometry, primitive);
    let meeting = watertight::intersect_precise(ray, Shear::new(&ray.direction), &corners);
    // After a refit, a triangle in the tree may have lost its area.
    if matches!(meeting, Meeting::Miss) || has_area(&corners) { meeting } else { Meeting::Miss }
}

/// A corner by position; both zeros are the same.
type Position = [u64; 3];

fn position(corner: [f64; 3]) -> Position {
    corner.map(|x| (x + 0.0).to_bits())
}

/// The two ends of an edge in either direction.
fn key(a: Position, b: Position) -> [Position; 2] {
    if a < b { [a, b] } else { [b, a] }
}

/// The map from the space where corners are compared to the space of their tree, as bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Space([Position; 4]);

impl Space {
    fn of(map: &Transform) -> Self {
        let affine = map.affine();
        let [x, y, z] = affine.matrix3.to_cols_array_2d();
        Self([x, y, z, affine.translation.to_array()].map(position))
    }

    fn of_mesh(tree: &Tree, geometry: u32) -> Self {
        let origin = match &tree.geometries[geometry as usize].kind {
            GeometryKind::Mesh(mesh) => mesh.origin,
            _ => DVec3::ZERO,
        };
        Self::of(&Transform::translate(origin))
    }
}

/// What the faces around a point say of an edge.
struct Shared {
    /// The corners of the first face, sorted.
    face: Outline,
    is_shared: bool,
}

/// What the faces around a point say of a vertex.
struct Fan {
    is_owned: bool,
    is_open: bool,
    first: usize,
}

/// The unowned edge hits that count because they lie at a border. `hits` must be all edge hits of the line, or a subset
/// with the same result.
pub(super) fn at_borders(hits: &[EdgeHit]) -> Vec<usize> {
    // Each mesh is a surface of its own, but the patches in a tree and the meshes next to them form one surface.
    let with_patches: HashSet<&[u32]> =
        hits.iter().filter(|hit| hit.is_patch()).map(|hit| hit.context.route.as_slice()).collect();
    let surface = |i: usize| {
        let route = hits[i].context.route.as_slice();
        let is_joined = with_patches.contains(route);
        (route, is_joined.then_some(hits[i].space), if is_joined { 0 } else { hits[i].geometry })
    };
    let ids = |i: usize| (hits[i].geometry, hits[i].primitive, hits[i].order);
    let mut order: Vec<usize> = (0..hits.len()).collect();
    order.sort_by(|&a, &b| surface(a).cmp(&surface(b)).then(ids(a).cmp(&ids(b))));
    let mut result = Vec::new();
    for group in order.chunk_by(|&a, &b| surface(a) == surface(b)) {
        let mut edges: HashMap<[Position; 2], Shared> = HashMap::new();
        for &i in group {
            let mut face = hits[i].outline.clone();
            face.sort_unstable();
            for edge in hits[i].edges() {
                let shared =
                    edges.entry(edge).or_insert_with(|| Shared { face: face.clone(), is_shared: false });
                shared.is_shared |= shared.face != face;
            }
        }
        let mut fans: HashMap<Position, Fan> = HashMap::new();
        for &i in group {
            match hits[i].place {
                Place::Edge(edge) => {
                    if !hits[i].is_owned && !edges[&edge].is_shared {
                        result.push(i);
                    }
                }
                Place::Corner(corner) => {
                    let mut around = hits[i].edges().filter(|edge| edge.contains(&corner));
                    let is_open = around.any(|edge| !edges[&edge].is_shared);
                    let fan = fans.entry(corner).or_insert(Fan { is_owned: false, is_open: false, first: i });
                    fan.is_owned |= hits[i].is_owned;
                    fan.is_open |= is_open;
                }
                Place::EdgeOn => {}
            }
        }
        result.extend(fans.into_values().filter(|fan| fan.is_open && !fan.is_owned).map(|fan| fan.first));
    }
    result
}

/// Shows a visitor the hits at borders, for a loop over everything that has found all edge hits.
#[cfg(test)]
pub(crate) fn visit_borders_of_all(ray: &Ray, edge_hits: &[EdgeHit], visitor: &mut dyn Visitor) {
    for i in at_borders(edge_hits) {
        if ray.contains(edge_hits[i].root.t) {
            visitor.visit(&edge_hits[i].crossing(ray));
        }
    }
}
