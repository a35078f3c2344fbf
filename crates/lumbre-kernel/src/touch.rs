//! Rays exactly through edges and vertices: the borders of open meshes.
//!
//! Inside a mesh the rule for zeros (see `triangles`) gives each crossing one owner, but at a border it may give it none:
//! the ray, moved by its ε, passes by the mesh. A triangle is closed, so such a crossing counts all the same, once. Which
//! edges are borders is seen from the triangles that the ray touches at that place, so that no mesh needs a table of its
//! neighbours; corners are compared by position, so that a mesh whose corners are split for their normals or texture
//! coordinates stays closed.

use std::collections::HashMap;

use lumbre_geometry::{Ray, Root};

use crate::Accel;
use crate::lanes::Level;
use crate::stack::AsBuilt;
use crate::traverse::{self, Ask, Found, Place, Search, What};
use crate::triangles::Meeting;

/// Where a ray meets a triangle that it touches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Feature {
    /// The edge opposite this corner.
    Edge(usize),
    /// This corner.
    Vertex(usize),
    /// Seen on edge: never hit, but a neighbour of others.
    EdgeOn,
}

/// A triangle whose edges or corners a ray meets exactly.
#[derive(Clone, Debug)]
pub(crate) struct Touch<'a> {
    /// The crossing; it may lie out of the ray's range.
    pub(crate) root: Root,
    /// Whether the rule for zeros gives the crossing to this triangle, so that it was offered already.
    pub(crate) is_owned: bool,
    pub(crate) is_front: bool,
    pub(crate) feature: Feature,
    pub(crate) corners: [[f64; 3]; 3],
    pub(crate) geometry: u32,
    pub(crate) primitive: u32,
    pub(crate) accel: &'a Accel,
    pub(crate) place: Place,
}

impl<'a> Touch<'a> {
    fn found(&self) -> Found<'a, '_> {
        let Self { root, is_front, geometry, primitive, accel, ref place, .. } = *self;
        let what = What::Named { geometry, primitive };
        Found { root, what, order: 0, is_front, accel, place }
    }
}

/// Offers what a ray meets of a triangle that has these corners. One that it touches joins the touches. True ends the search.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
pub(crate) fn offer_meeting<'a, S: Search<'a>>(
    meeting: Meeting,
    ray: &Ray,
    corners: [[f64; 3]; 3],
    what: What,
    accel: &'a Accel,
    place: &Place,
    search: &mut S,
    touches: &mut Vec<Touch<'a>>,
) -> bool {
    let (root, is_front) = match meeting {
        Meeting::Miss => return false,
        Meeting::Hit { root, is_front } => (root, is_front),
        Meeting::Touch { root, is_owned, feature, is_front } => {
            let (geometry, primitive) = what.names(accel);
            let place = place.clone();
            touches.push(Touch {
                root,
                is_owned,
                is_front,
                feature,
                corners,
                geometry,
                primitive,
                accel,
                place,
            });
            if !is_owned || !ray.contains(root.t) {
                return false;
            }
            (root, is_front)
        }
    };
    search.offer(&Found { root, what, order: 0, is_front, accel, place })
}

/// A corner by position; the two zeros are one.
type Position = [u64; 3];

fn position(corner: [f64; 3]) -> Position {
    corner.map(|x| (x + 0.0).to_bits())
}

/// What is known of an edge from the triangles around a touched place.
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

/// Of the touches that nobody owns, those that count because they lie at a border. `touches` are to be all that the line
/// has, or those for which that makes no difference.
fn at_borders(touches: &[Touch]) -> Vec<usize> {
    // Meshes by where they are.
    let mut order: Vec<usize> = (0..touches.len()).collect();
    let mesh = |i: usize| (touches[i].place.route.as_slice(), touches[i].geometry);
    order.sort_by(|&a, &b| mesh(a).cmp(&mesh(b)).then(touches[a].primitive.cmp(&touches[b].primitive)));
    let mut result = Vec::new();
    for group in order.chunk_by(|&a, &b| mesh(a) == mesh(b)) {
        let mut edges: HashMap<[Position; 2], Shared> = HashMap::new();
        let key = |a: Position, b: Position| if a < b { [a, b] } else { [b, a] };
        for &i in group {
            let corners = touches[i].corners.map(position);
            for opposite in 0..3 {
                let third = corners[opposite];
                let edge = key(corners[(opposite + 1) % 3], corners[(opposite + 2) % 3]);
                let shared = edges.entry(edge).or_insert(Shared { third, is_shared: false });
                shared.is_shared |= shared.third != third;
            }
        }
        let mut fans: HashMap<Position, Fan> = HashMap::new();
        for &i in group {
            let corners = touches[i].corners.map(position);
            match touches[i].feature {
                Feature::Edge(opposite) => {
                    let edge = key(corners[(opposite + 1) % 3], corners[(opposite + 2) % 3]);
                    if !touches[i].is_owned && !edges[&edge].is_shared {
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
                    fan.is_owned |= touches[i].is_owned;
                    fan.is_open |= is_open;
                }
                Feature::EdgeOn => {}
            }
        }
        result.extend(fans.into_values().filter(|fan| fan.is_open && !fan.is_owned).map(|fan| fan.first));
    }
    result
}

/// Offers what lies at borders, once the search has met `touches`.
#[cold]
#[inline(never)]
pub(crate) fn offer_borders<'a, S: Search<'a>>(
    level: Level,
    accel: &'a Accel,
    place: &mut Place,
    ray: &Ray,
    touches: &[Touch<'a>],
    search: &mut S,
) {
    let matters = |touch: &Touch, search: &S| {
        let t = touch.root.t;
        !touch.is_owned && ray.contains(t) && search.floor() <= t && t <= search.limit()
    };
    // More triangles can only make fewer borders: without any now, there are none.
    if !at_borders(touches).iter().any(|&i| matters(&touches[i], search)) {
        return;
    }
    // A part of the neighbours may lie beyond what was searched.
    let all = traverse::all_touches(level, accel, place, ray);
    for i in at_borders(&all) {
        if matters(&all[i], search) && search.offer(&all[i].found()) {
            return;
        }
    }
}

/// The same for a loop over everything, which has met all touches.
#[cfg(test)]
pub(crate) fn offer_borders_of_all<'a, S: Search<'a>>(ray: &Ray, touches: &[Touch<'a>], search: &mut S) {
    for i in at_borders(touches) {
        if ray.contains(touches[i].root.t) {
            search.offer(&touches[i].found());
        }
    }
}

/// Looks along the whole line for touches alone.
pub(crate) struct AllTouches;

impl Search<'_> for AllTouches {
    const ASK: Ask = Ask::Nothing;
    type Order = AsBuilt;

    fn limit(&self) -> f64 {
        f64::INFINITY
    }

    fn floor(&self) -> f64 {
        f64::NEG_INFINITY
    }

    fn offer(&mut self, _: &Found<'_, '_>) -> bool {
        false
    }
}
