//! Rays exactly through edges and vertices.
//!
//! Inside a mesh the rule for zeros (see [`watertight`]) gives each such crossing one owner, but at the border of an open mesh it may give
//! it none: the ray, moved by its ε, passes the mesh by. A triangle is closed, so such a crossing counts all the same, once. Which
//! edges are borders is seen from the triangles that the ray hits at that place, so that no mesh needs a table of its
//! neighbours; corners are compared by position, so that a mesh whose corners are split for their normals or texture
//! coordinates stays closed.

use std::collections::HashMap;

use lumbre_geometry::{Ray, Root};

use super::Context;
use super::exact::{self, Crossing, Visitor};
use crate::Accel;
use crate::intersect::Isa;
use crate::intersect::watertight::{self, Feature, Meeting, Shear};
use crate::precise_mesh::has_area;

/// A triangle whose edges or corners a ray hits exactly.
#[derive(Clone, Debug)]
pub(crate) struct EdgeHit<'a> {
    /// The crossing; it may lie out of the ray's range.
    root: Root,
    /// Whether the rule for zeros gives the crossing to this triangle, so that it was visited already.
    is_owned: bool,
    is_front: bool,
    feature: Feature,
    corners: [[f64; 3]; 3],
    geometry: u32,
    primitive: u32,
    accel: &'a Accel,
    context: Context,
}

impl EdgeHit<'_> {
    fn crossing<'c>(&'c self, ray: &'c Ray) -> Crossing<'c> {
        let &Self { root, is_front, geometry, primitive, accel, ref context, .. } = self;
        Crossing { root, geometry, primitive, order: 0, is_front: Some(is_front), ray, accel, context }
    }
}

/// A triangle that a ray may hit at an edge.
pub(crate) struct Triangle<'a> {
    pub(crate) corners: [[f64; 3]; 3],
    /// Geometry and primitive.
    pub(crate) ids: (u32, u32),
    pub(crate) accel: &'a Accel,
}

impl<'a> Triangle<'a> {
    /// Shows a visitor how a ray meets it, and collects an edge hit. True ends the traversal.
    pub(crate) fn visit(
        self,
        meeting: Meeting,
        ray: &Ray,
        context: &Context,
        visitor: &mut dyn Visitor,
        edge_hits: &mut Vec<EdgeHit<'a>>,
    ) -> bool {
        let Self { corners, ids: (geometry, primitive), accel } = self;
        let (root, is_front) = match meeting {
            Meeting::Miss => return false,
            Meeting::Hit { root, is_front } => (root, is_front),
            Meeting::Touch { root, is_owned, feature, is_front } => {
                let context = context.clone();
                edge_hits.push(EdgeHit {
                    root,
                    is_owned,
                    is_front,
                    feature,
                    corners,
                    geometry,
                    primitive,
                    accel,
                    context,
                });
                if !is_owned || !ray.contains(root.t) {
                    return false;
                }
                (root, is_front)
            }
        };
        let is_front = Some(is_front);
        visitor.visit(&Crossing { root, geometry, primitive, order: 0, is_front, ray, accel, context })
    }
}

/// How a ray meets a triangle in double precision.
pub(crate) fn intersect_precise(accel: &Accel, ray: &Ray, geometry: u32, primitive: u32) -> Meeting {
    let corners = accel.precise_corners(geometry, primitive);
    let meeting = watertight::intersect_precise(ray, Shear::new(&ray.direction), &corners);
    // After a refit, some in the tree may have lost their area.
    if matches!(meeting, Meeting::Miss) || has_area(&corners) { meeting } else { Meeting::Miss }
}

/// A corner by position; the two zeros are one.
type Position = [u64; 3];

fn position(corner: [f64; 3]) -> Position {
    corner.map(|x| (x + 0.0).to_bits())
}

/// What is known of an edge from the triangles around a place.
struct Shared {
    third: Position,
    is_shared: bool,
}

/// What is known of a vertex.
struct Fan {
    is_owned: bool,
    is_open: bool,
    first: usize,
}

/// Of the edge hits without an owner, those that count because they lie at a border. `hits` are to be all of the line, or those for
/// which that makes no difference.
fn at_borders(hits: &[EdgeHit]) -> Vec<usize> {
    // Meshes by where they are.
    let mut order: Vec<usize> = (0..hits.len()).collect();
    let mesh = |i: usize| (hits[i].context.route.as_slice(), hits[i].geometry);
    order.sort_by(|&a, &b| mesh(a).cmp(&mesh(b)).then(hits[a].primitive.cmp(&hits[b].primitive)));
    let mut result = Vec::new();
    for group in order.chunk_by(|&a, &b| mesh(a) == mesh(b)) {
        let mut edges: HashMap<[Position; 2], Shared> = HashMap::new();
        let key = |a: Position, b: Position| if a < b { [a, b] } else { [b, a] };
        for &i in group {
            let corners = hits[i].corners.map(position);
            for opposite in 0..3 {
                let third = corners[opposite];
                let edge = key(corners[(opposite + 1) % 3], corners[(opposite + 2) % 3]);
                let shared = edges.entry(edge).or_insert(Shared { third, is_shared: false });
                shared.is_shared |= shared.third != third;
            }
        }
        let mut fans: HashMap<Position, Fan> = HashMap::new();
        for &i in group {
            let corners = hits[i].corners.map(position);
            match hits[i].feature {
                Feature::Edge(opposite) => {
                    let edge = key(corners[(opposite + 1) % 3], corners[(opposite + 2) % 3]);
                    if !hits[i].is_owned && !edges[&edge].is_shared {
                        result.push(i);
                    }
                }
                Feature::Vertex(corner) => {
                    let around = [corners[(corner + 1) % 3], corners[(corner + 2) % 3]];
                    let is_open = around.iter().any(|&other| !edges[&key(corners[corner], other)].is_shared);
                    let fan = fans.entry(corners[corner]).or_insert(Fan {
                        is_owned: false,
                        is_open: false,
                        first: i,
                    });
                    fan.is_owned |= hits[i].is_owned;
                    fan.is_open |= is_open;
                }
                Feature::EdgeOn => {}
            }
        }
        result.extend(fans.into_values().filter(|fan| fan.is_open && !fan.is_owned).map(|fan| fan.first));
    }
    result
}

/// Shows a visitor what lies at borders, once the traversal has found these edge hits.
#[cold]
#[inline(never)]
pub(crate) fn visit_borders(
    isa: Isa,
    accel: &Accel,
    context: &mut Context,
    ray: &Ray,
    edge_hits: &[EdgeHit],
    visitor: &mut dyn Visitor,
) {
    let matters = |hit: &EdgeHit, [first, last]: [f64; 2]| {
        let t = hit.root.t;
        !hit.is_owned && ray.contains(t) && first <= t && t <= last
    };
    // More triangles can only make fewer borders: without any now, there are none.
    if !at_borders(edge_hits).iter().any(|&i| matters(&edge_hits[i], visitor.range())) {
        return;
    }
    // Some of the neighbours may lie beyond what was traversed.
    let all = exact::all_edge_hits(isa, accel, context, ray);
    for i in at_borders(&all) {
        if matters(&all[i], visitor.range()) && visitor.visit(&all[i].crossing(ray)) {
            return;
        }
    }
}

/// The same for a loop over everything, which has found all edge hits.
#[cfg(test)]
pub(crate) fn visit_borders_of_all(ray: &Ray, edge_hits: &[EdgeHit], visitor: &mut dyn Visitor) {
    for i in at_borders(edge_hits) {
        if ray.contains(edge_hits[i].root.t) {
            visitor.visit(&edge_hits[i].crossing(ray));
        }
    }
}
