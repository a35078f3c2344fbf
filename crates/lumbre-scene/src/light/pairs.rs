//! Pairs of mesh triangles that form rectangles.

use std::collections::HashMap;

use lumbre_kernel::TriangleMesh;
use lumbre_math::DVec3;

use super::rectangle::Rectangle;

/// Two triangles on either side of a diagonal of a rectangle, which face the same way.
#[derive(Clone, Debug)]
pub(super) struct Pair {
    pub triangles: [u32; 2],
    pub rectangle: Rectangle,
    /// The corner at the right angle of the first triangle, and the sides from there, in the space of the mesh's tree.
    pub corner: DVec3,
    pub sides: [DVec3; 2],
    /// The distance of the second triangle's corner from the exact rectangle.
    pub gap: DVec3,
}

/// Maximum gap, relative to the shorter side: the rounding of a rotated rectangle to single precision.
const GAP: f64 = 1e-5;

/// The pairs of a mesh; each triangle is in at most one.
pub(super) fn pairs(mesh: &TriangleMesh) -> Vec<Pair> {
    let mut pairs = Vec::new();
    // By the directed diagonal: the other triangle has the opposite direction.
    let mut open: HashMap<[[u32; 3]; 2], (u32, DVec3)> = HashMap::new();
    for (triangle, indices) in (0..).zip(&mesh.indices) {
        let Some((vertices, rectangle)) = right_angled(mesh, indices) else { continue };
        let [corner, from, to] = vertices.map(|i| mesh.positions[i as usize]);
        let key = |p: lumbre_math::Vec3| (p + 0.0).to_array().map(f32::to_bits);
        let [corner, a, b] = [corner, from, to].map(|p| mesh.origin + p.as_dvec3());
        let sides = [a - corner, b - corner];
        let shortest = sides[0].length().min(sides[1].length());
        if let Some(&(other, opposite)) = open.get(&[key(to), key(from)]) {
            let gap = (opposite - (corner + sides[0] + sides[1])).abs();
            if gap.max_element() <= GAP * shortest {
                open.remove(&[key(to), key(from)]);
                pairs.push(Pair { triangles: [other, triangle], rectangle, corner, sides, gap });
                continue;
            }
        }
        open.insert([key(from), key(to)], (triangle, corner));
    }
    pairs
}

/// The vertices of a triangle from its right angle on, if it has one, and the rectangle of which it is half.
fn right_angled(mesh: &TriangleMesh, &[a, b, c]: &[u32; 3]) -> Option<([u32; 3], Rectangle)> {
    [[a, b, c], [b, c, a], [c, a, b]].into_iter().find_map(|vertices| {
        let [corner, p, q] = vertices.map(|i| mesh.origin + mesh.positions[i as usize].as_dvec3());
        Some((vertices, Rectangle::new(corner, [p - corner, q - corner])?))
    })
}

#[cfg(test)]
mod tests {
    use lumbre_math::{DQuat, Vec3};

    use super::*;

    fn mesh(positions: &[[f32; 3]], indices: &[[u32; 3]]) -> TriangleMesh {
        // Turned, so that single precision rounds.
        let turn = DQuat::from_axis_angle(DVec3::new(0.48, 0.6, 0.64), 0.7);
        let turned = |&p: &[f32; 3]| (turn * Vec3::from(p).as_dvec3()).as_vec3();
        let origin = DVec3::new(0.1, -30.0, 1e5);
        TriangleMesh { origin, positions: positions.iter().map(turned).collect(), indices: indices.to_vec() }
    }

    fn found(positions: &[[f32; 3]], indices: &[[u32; 3]]) -> Vec<[u32; 2]> {
        pairs(&mesh(positions, indices)).iter().map(|pair| pair.triangles).collect()
    }

    #[test]
    fn every_face_of_a_box_is_a_rectangle() {
        let corner = |i: u32| {
            [[-1.0, 2.5][(i & 1) as usize], [3.0, 4.0][(i >> 1 & 1) as usize], [0.5, 7.0][(i >> 2) as usize]]
        };
        let positions: Vec<[f32; 3]> = (0..8).map(corner).collect();
        let faces: [[u32; 4]; 6] =
            [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let indices: Vec<[u32; 3]> = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [c, d, a]]).collect();
        let pairs = pairs(&mesh(&positions, &indices));
        assert_eq!(pairs.len(), 6);
        for (i, pair) in (0..).zip(pairs) {
            assert_eq!(pair.triangles, [2 * i, 2 * i + 1]);
            let [a, b, c] =
                indices[2 * i as usize + 1].map(|i| positions[i as usize]).map(|p| Vec3::from(p).as_dvec3());
            let area = (b - a).cross(c - a).length();
            assert!((pair.sides[0].cross(pair.sides[1]).length() / area - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn corners_that_are_the_same_place_are_the_same_corner() {
        let positions = [
            [0.0, 0.0, 2.0],
            [3.0, 0.0, 2.0],
            [3.0, 1.0, 2.0],
            [0.0, 0.0, 2.0],
            [3.0, 1.0, 2.0],
            [0.0, 1.0, 2.0],
        ];
        assert_eq!(found(&positions, &[[0, 1, 2], [3, 4, 5]]), [[0, 1]]);
    }

    #[test]
    fn what_is_no_rectangle_is_left_as_triangles() {
        let square = [[2.0, 0.0, 0.0], [5.0, 0.0, 0.0], [5.0, 2.0, 0.0], [2.0, 2.0, 0.0]];
        let halves = [[0, 1, 2], [0, 2, 3]];
        assert_eq!(found(&square, &halves), [[0, 1]]);
        let moved = |corner: usize, to: [f32; 3]| {
            let mut square = square;
            square[corner] = to;
            found(&square, &halves)
        };
        // Skew, a kite, and bent.
        assert_eq!(moved(3, [2.5, 2.0, 0.0]), [[0; 2]; 0]);
        assert_eq!(moved(3, [2.0, 2.01, 0.0]), [[0; 2]; 0]);
        assert_eq!(moved(3, [2.0, 2.0, 0.01]), [[0; 2]; 0]);
        // They face opposite ways, or lie on each other.
        assert_eq!(found(&square, &[[0, 1, 2], [0, 3, 2]]), [[0; 2]; 0]);
        assert_eq!(found(&square, &[[0, 1, 2], [0, 1, 2], [2, 1, 0]]), [[0; 2]; 0]);
        // A third half has no other.
        assert_eq!(found(&square, &[[0, 1, 2], [0, 2, 3], [0, 2, 3]]), [[0, 1]]);
    }
}
