//! Triangles whose edges others meet in between, split there, so that no ray passes the seam.
//!
//! Programs close a gap at a vertex within the edge of a triangle by another triangle, which has no area. No ray hits
//! that one, and whether a ray passes on one side of the edge or of its two parts is then decided by rounding, twice.
//! Split at the vertex, the triangle has the same edges as those on the other side, and every ray that crosses the seam
//! hits one of them.

use std::collections::HashMap;

use lumbre_math::{DVec2, DVec3, Vec3};

/// The parts of the triangles that were split.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Pieces {
    /// By the part's position in the list of triangles. The first part of a triangle stands in its place.
    pieces: HashMap<u32, Piece>,
    /// The corners of the triangles that were split.
    wholes: HashMap<u32, [u32; 3]>,
}

/// A part of a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Piece {
    whole: u32,
    /// The barycentrics of its corners in the whole triangle.
    corners: [DVec2; 3],
}

impl Pieces {
    /// The triangle of the mesh, and the place in it, that a place in a part is.
    pub(crate) fn whole(&self, part: u32, local: DVec2) -> (u32, DVec2) {
        let Some(Piece { whole, corners: [a, b, c] }) = self.pieces.get(&part) else { return (part, local) };
        (*whole, (1.0 - local.x - local.y) * *a + local.x * *b + local.y * *c)
    }

    /// The corners of a triangle that was split.
    pub(crate) fn corners(&self, triangle: u32) -> Option<[u32; 3]> {
        self.wholes.get(&triangle).copied()
    }
}

/// A vertex by its position: meshes have one for each of its texture coordinates.
type Place = [u32; 3];

fn place(position: Vec3) -> Place {
    // Of the two zeros, the positive one.
    (position + Vec3::ZERO).to_array().map(f32::to_bits)
}

/// An edge in no direction.
fn edge(a: Place, b: Place) -> [Place; 2] {
    if a < b { [a, b] } else { [b, a] }
}

fn is_flat([a, b, c]: [Vec3; 3]) -> bool {
    let [a, b, c] = [a, b, c].map(Vec3::as_dvec3);
    (b - a).cross(c - a) == DVec3::ZERO
}

/// The corner of a triangle on a line that is between the others; `None` where two are the same.
fn middle_of([a, b, c]: [Vec3; 3]) -> Option<usize> {
    let is_between = |p: Vec3, q: Vec3, r: Vec3| (p - q).as_dvec3().dot((r - q).as_dvec3()) < 0.0;
    [(c, a, b), (a, b, c), (b, c, a)].into_iter().position(|(p, q, r)| is_between(p, q, r))
}

/// The long edges of triangles without area, each with the vertices between its ends.
struct Seams<'a> {
    positions: &'a [Vec3],
    between: HashMap<[Place; 2], Vec<u32>>,
}

impl<'a> Seams<'a> {
    fn of(positions: &'a [Vec3], triangles: &[[u32; 3]]) -> Self {
        let mut seams = Self { positions, between: HashMap::new() };
        for corners in triangles {
            let at = corners.map(|vertex| positions[vertex as usize]);
            if !is_flat(at) {
                continue;
            }
            let Some(middle) = middle_of(at) else { continue };
            let [from, to] = [(middle + 1) % 3, (middle + 2) % 3].map(|corner| place(at[corner]));
            seams.between.entry(edge(from, to)).or_default().push(corners[middle]);
        }
        seams
    }

    /// The vertices between two others, in their order; `None` if they are more than `room`, from which they are
    /// subtracted.
    fn along(&self, from: u32, to: u32, room: &mut usize) -> Option<Vec<u32>> {
        let at = |vertex: u32| self.positions[vertex as usize];
        let (mut last, mut ahead, mut all) = (from, vec![to], Vec::new());
        while let Some(&next) = ahead.last() {
            // Between two neighbours, there may be another seam. It is shorter, so this comes to an end.
            if let Some(between) = self.between.get(&edge(place(at(last)), place(at(next)))) {
                *room = room.checked_sub(between.len())?;
                let mut between = between.clone();
                let distance = |vertex: u32| (at(vertex) - at(last)).as_dvec3().length_squared();
                between.sort_by(|&a, &b| distance(b).total_cmp(&distance(a)));
                between.dedup_by_key(|vertex| place(at(*vertex)));
                ahead.extend(between);
            } else {
                all.push(next);
                (last, _) = (next, ahead.pop());
            }
        }
        all.pop();
        Some(all)
    }
}

/// Splits the triangles that have an edge with vertices between its ends, by what triangles without area say. The first
/// part of each takes its place, and the others are appended. `None` where there are none, and where there would be too
/// many.
pub(crate) fn split(positions: &[Vec3], triangles: &mut Vec<[u32; 3]>) -> Option<Pieces> {
    let seams = Seams::of(positions, triangles);
    // Of a large mesh, few vertices are the end of a seam.
    let mut ends: Vec<Place> = seams.between.keys().flatten().copied().collect();
    ends.sort_unstable();
    ends.dedup();
    let is_end = |vertex: &u32| ends.binary_search(&place(positions[*vertex as usize])).is_ok();
    let mut room = 3 * triangles.len();
    let mut found = Vec::new();
    if ends.is_empty() {
        return None;
    }
    for (whole, corners) in (0..).zip(triangles.iter()) {
        let may_be = corners.iter().filter(|vertex| is_end(vertex)).count() >= 2;
        if !may_be || is_flat(corners.map(|vertex| positions[vertex as usize])) {
            continue;
        }
        let mut on = [const { Vec::new() }; 3];
        for (i, on) in on.iter_mut().enumerate() {
            *on = seams.along(corners[i], corners[(i + 1) % 3], &mut room)?;
        }
        if on.iter().any(|on| !on.is_empty()) {
            found.push((whole, on));
        }
    }
    let mut pieces = Pieces::default();
    let mut parts = Vec::new();
    for (whole, on) in found {
        let corners = triangles[whole as usize];
        pieces.wholes.insert(whole, corners);
        cut(positions, corners, &on, &mut parts);
        for (i, part) in parts.drain(..).enumerate() {
            let vertices = part.map(|corner| corner.vertex);
            let number = if i == 0 { whole } else { triangles.len() as u32 };
            pieces.pieces.insert(number, Piece { whole, corners: part.map(|corner| corner.local) });
            if i == 0 {
                triangles[whole as usize] = vertices;
            } else {
                triangles.push(vertices);
            }
        }
    }
    (!pieces.wholes.is_empty()).then_some(pieces)
}

/// A vertex of a triangle or on one of its edges, with its barycentrics.
#[derive(Clone, Copy)]
struct Corner {
    vertex: u32,
    local: DVec2,
}

/// Cuts a triangle with vertices on its edges (the first edge is from corner 0 to corner 1), into triangles with the
/// same orientation.
fn cut(positions: &[Vec3], corners: [u32; 3], on: &[Vec<u32>; 3], parts: &mut Vec<[Corner; 3]>) {
    const LOCAL: [DVec2; 3] = [DVec2::ZERO, DVec2::X, DVec2::Y];
    let at = |vertex: u32| positions[vertex as usize].as_dvec3();
    // All vertices of an edge, from the one end to the other.
    let chain = |i: usize| {
        let j = (i + 1) % 3;
        let (from, to) = (at(corners[i]), at(corners[j]));
        let along = (to - from) / (to - from).length_squared();
        let corner = |&vertex: &u32| Corner {
            vertex,
            local: LOCAL[i].lerp(LOCAL[j], (at(vertex) - from).dot(along).clamp(0.0, 1.0)),
        };
        let first = Corner { vertex: corners[i], local: LOCAL[i] };
        let last = Corner { vertex: corners[j], local: LOCAL[j] };
        [vec![first], on[i].iter().map(corner).collect(), vec![last]].concat()
    };
    let first = on.iter().position(|on| !on.is_empty()).unwrap_or(0);
    let [base, right, left] = [0, 1, 2].map(|i| chain((first + i) % 3));
    // From both ends of the base to the opposite corner there may be vertices, too: a fan from the next vertex of the
    // base takes them.
    let fan = |apex: Corner, rim: &[Corner]| -> Vec<[Corner; 3]> {
        rim.windows(2).map(|side| [apex, side[0], side[1]]).collect()
    };
    let opposite = left[0];
    parts.extend(fan(base[1], &left));
    parts.extend(base[1..base.len() - 1].windows(2).map(|side| [side[0], side[1], opposite]));
    parts.extend(fan(base[base.len() - 2], &right));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area([a, b, c]: [DVec2; 3]) -> f64 {
        0.5 * (b - a).perp_dot(c - a)
    }

    #[test]
    fn triangles_are_split_at_vertices_on_their_edges() {
        // The edge from 0 to 1 has 3, 4 and 5 in between, by three triangles without area; that from 1 to 2 has 6, by
        // one that names the ends otherwise.
        let positions = [
            [1.0, 2.0, 0.5],
            [9.0, 2.0, 0.5],
            [9.0, 6.0, 0.5],
            [3.0, 2.0, 0.5],
            [5.0, 2.0, 0.5],
            [8.0, 2.0, 0.5],
            [9.0, 3.0, 0.5],
            [9.0, 2.0, 0.5],
        ]
        .map(Vec3::from);
        let flats = [[1, 0, 4], [4, 3, 0], [5, 4, 1], [7, 6, 2]];
        let mut triangles = [&[[0, 1, 2]], &flats[..]].concat();
        let pieces = split(&positions, &mut triangles).unwrap();
        assert_eq!(triangles[1..5], flats);
        let parts: Vec<usize> = std::iter::once(0).chain(5..triangles.len()).collect();
        assert_eq!(parts.len(), 5);
        let mut sum = 0.0;
        for part in parts {
            let corners = triangles[part].map(|vertex| positions[vertex as usize].as_dvec3());
            let [a, b, c] = corners.map(|p| p.truncate());
            assert!(area([a, b, c]) > 0.0, "{part}");
            sum += area([a, b, c]);
            let local = DVec2::new(0.25, 0.5);
            let (whole, place) = pieces.whole(part as u32, local);
            let at = |[a, b, c]: [DVec3; 3], l: DVec2| (1.0 - l.x - l.y) * a + l.x * b + l.y * c;
            let wholes = [0, 1, 2].map(|i: usize| positions[i].as_dvec3());
            assert_eq!(whole, 0);
            assert!((at(corners, local) - at(wholes, place)).length() < 1e-12, "{part}");
        }
        assert!((sum - 16.0).abs() < 1e-12);
        assert_eq!((pieces.corners(0), pieces.corners(1)), (Some([0, 1, 2]), None));
        assert_eq!(pieces.whole(3, DVec2::X), (3, DVec2::X));
    }

    #[test]
    fn meshes_without_or_with_too_many_seams_stay() {
        let positions = [[1.0, 2.0, 0.5], [9.0, 2.0, 0.5], [9.0, 6.0, 0.5], [5.0, 2.0, 0.5]].map(Vec3::from);
        // A point, a line there and back, and one whose long edge no other has.
        for flat in [[0, 0, 0], [0, 1, 1], [0, 3, 1]] {
            let mut triangles = vec![[0, 3, 2], flat];
            assert_eq!(split(&positions, &mut triangles), None);
            assert_eq!(triangles, [[0, 3, 2], flat]);
        }
        // Each of a thousand triangles would become a thousand.
        let mut positions: Vec<Vec3> = (0..=1001).map(|i| Vec3::new(i as f32, 0.0, 0.0)).collect();
        let last = positions.len() as u32 - 1;
        positions.extend((0..1000).map(|i| Vec3::new(3.0, 5.0, i as f32)));
        let flats = (1..last).map(|i| [0, i, last]);
        let mut triangles: Vec<[u32; 3]> = (0..1000).map(|i| [0, last, last + 1 + i]).chain(flats).collect();
        let before = triangles.clone();
        assert_eq!(split(&positions, &mut triangles), None);
        assert_eq!(triangles, before);
    }
}
