//! Loop subdivision: smooth surfaces from triangles, with their limit positions and normals.
//!
//! C. Loop, "Smooth subdivision surfaces based on triangles", master's thesis, University of Utah, 1987; limit
//! positions and tangents after H. Hoppe et al., "Piecewise smooth surface reconstruction", SIGGRAPH 1994. The weights
//! of the rings are those of J. Warren, as pbrt has them: 3/16 for three neighbours, else 3/(8n).

use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

use lumbre_math::{DVec3, Elementary, Vec3};
use lumbre_scene::MeshDesc;

/// Subdivides `faces` over `positions` `levels` times and moves the vertices to the limit.
///
/// # Errors
/// When more than two faces share an edge, two neighbours have opposite orientations, or faces meet in a vertex
/// alone.
pub(super) fn subdivide(positions: &[Vec3], faces: &[[u32; 3]], levels: u32) -> Result<MeshDesc, String> {
    let mut points: Vec<DVec3> = positions.iter().map(|p| p.as_dvec3()).collect();
    let mut faces = faces.to_vec();
    for _ in 0..levels {
        (points, faces) = refine(&points, &faces)?;
    }
    let rings = rings(points.len(), &faces)?;
    let limit: Vec<DVec3> =
        points.iter().zip(&rings).map(|(p, ring)| limit_point(*p, ring, &points)).collect();
    let normals =
        limit.iter().zip(&rings).map(|(p, ring)| limit_normal(*p, ring, &limit).as_vec3()).collect();
    Ok(MeshDesc {
        positions: limit.iter().map(|p| p.as_vec3()).collect(),
        triangles: faces,
        normals: Some(normals),
        ..MeshDesc::default()
    })
}

/// The neighbours of a vertex, counter-clockwise; at a boundary from one end to the other.
#[derive(Clone, Debug, Default)]
struct Ring {
    neighbours: Vec<u32>,
    is_border: bool,
}

fn rings(vertices: usize, faces: &[[u32; 3]]) -> Result<Vec<Ring>, String> {
    // In a face (v, a, b) the ring around v goes from a to b.
    let mut steps: Vec<Vec<(u32, u32)>> = vec![vec![]; vertices];
    for face in faces {
        for i in 0..3 {
            let (v, a, b) = (face[i], face[(i + 1) % 3], face[(i + 2) % 3]);
            if v == a {
                return Err(format!("a face has vertex {v} twice"));
            }
            steps[v as usize].push((a, b));
        }
    }
    let ring = |(v, steps): (usize, Vec<(u32, u32)>)| -> Result<Ring, String> {
        let mut next = HashMap::with_capacity(steps.len());
        let mut has_before = HashMap::with_capacity(steps.len());
        for &(a, b) in &steps {
            let twice = next.insert(a, b).is_some() || has_before.insert(b, ()).is_some();
            if twice {
                return Err(format!(
                    "more than two faces, or two that disagree about the front, meet at an edge of vertex {v}"
                ));
            }
        }
        let Some(&(first, _)) = steps.first() else { return Ok(Ring::default()) };
        // An open ring starts at the one neighbour without a predecessor.
        let start = steps.iter().map(|(a, _)| *a).find(|a| !has_before.contains_key(a));
        let mut neighbours = vec![start.unwrap_or(first)];
        while let Some(&b) = neighbours.last().and_then(|a| next.get(a)) {
            if b == neighbours[0] {
                break;
            }
            neighbours.push(b);
            if neighbours.len() > steps.len() + 1 {
                break;
            }
        }
        let is_border = start.is_some();
        let whole = steps.len() + usize::from(is_border);
        if neighbours.len() != whole {
            return Err(format!("faces meet in vertex {v} alone"));
        }
        Ok(Ring { neighbours, is_border })
    };
    steps.into_iter().enumerate().map(ring).collect()
}

/// An edge: the vertex at its middle, and the opposite corners of its one or two faces.
struct Edge {
    middle: u32,
    across: [Option<u32>; 2],
}

fn sum(points: &[DVec3], which: &[u32]) -> DVec3 {
    which.iter().map(|i| points[*i as usize]).sum()
}

/// The weight of each neighbour of an inner vertex.
fn beta(valence: usize) -> f64 {
    if valence == 3 { 3.0 / 16.0 } else { 3.0 / (8.0 * valence as f64) }
}

fn refine(points: &[DVec3], faces: &[[u32; 3]]) -> Result<(Vec<DVec3>, Vec<[u32; 3]>), String> {
    let rings = rings(points.len(), faces)?;
    // Old vertices keep their indices.
    let mut new: Vec<DVec3> = points
        .iter()
        .zip(&rings)
        .map(|(p, ring)| match ring.neighbours[..] {
            [] => *p,
            [first, .., last] if ring.is_border => {
                0.75 * *p + 0.125 * (points[first as usize] + points[last as usize])
            }
            _ => {
                let n = ring.neighbours.len();
                (1.0 - n as f64 * beta(n)) * *p + beta(n) * sum(points, &ring.neighbours)
            }
        })
        .collect();
    // The vertex of each edge, in the order of the faces, with the opposite corners.
    let mut across: HashMap<(u32, u32), Edge> = HashMap::with_capacity(faces.len() * 3 / 2);
    let mut edges = vec![];
    for face in faces {
        for i in 0..3 {
            let (a, b, c) = (face[i], face[(i + 1) % 3], face[(i + 2) % 3]);
            let edge = (a.min(b), a.max(b));
            match across.get_mut(&edge) {
                Some(edge) => edge.across[1] = Some(c),
                None => {
                    let number =
                        u32::try_from(points.len() + edges.len()).map_err(|_| "too many vertices")?;
                    across.insert(edge, Edge { middle: number, across: [Some(c), None] });
                    edges.push(edge);
                }
            }
        }
    }
    for edge in &edges {
        let ends = points[edge.0 as usize] + points[edge.1 as usize];
        new.push(match across[edge].across {
            [Some(c), Some(d)] => 0.375 * ends + 0.125 * (points[c as usize] + points[d as usize]),
            _ => 0.5 * ends,
        });
    }
    let middle = |a: u32, b: u32| across[&(a.min(b), a.max(b))].middle;
    let split = faces.iter().flat_map(|&[a, b, c]| {
        let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
        [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
    });
    Ok((new, split.collect()))
}

fn limit_point(p: DVec3, ring: &Ring, points: &[DVec3]) -> DVec3 {
    match ring.neighbours[..] {
        [] => p,
        [first, .., last] if ring.is_border => {
            0.6 * p + 0.2 * (points[first as usize] + points[last as usize])
        }
        _ => {
            let n = ring.neighbours.len();
            let gamma = 1.0 / (n as f64 + 3.0 / (8.0 * beta(n)));
            (1.0 - n as f64 * gamma) * p + gamma * sum(points, &ring.neighbours)
        }
    }
}

fn limit_normal(p: DVec3, ring: &Ring, points: &[DVec3]) -> DVec3 {
    let at = |i: usize| points[ring.neighbours[i] as usize];
    let n = ring.neighbours.len();
    let (s, t) = if n < 2 {
        return DVec3::ZERO;
    } else if !ring.is_border {
        (0..n).fold((DVec3::ZERO, DVec3::ZERO), |(s, t), i| {
            let (sin, cos) = (TAU * i as f64 / n as f64).sine_cosine();
            (s + cos * at(i), t + sin * at(i))
        })
    } else {
        // Along the boundary, and across it into the surface.
        let along = at(0) - at(n - 1);
        let inward = match n {
            2 => at(0) + at(1) - 2.0 * p,
            3 => at(1) - p,
            4 => 2.0 * (at(1) + at(2)) - at(0) - at(3) - 2.0 * p,
            _ => {
                let theta = PI / (n - 1) as f64;
                let ends = theta.sine() * (at(0) + at(n - 1));
                let inner: DVec3 = (1..n - 1)
                    .map(|k| (2.0 * theta.cosine() - 2.0) * (k as f64 * theta).sine() * at(k))
                    .sum();
                -(ends + inner)
            }
        };
        (along, inward)
    };
    s.cross(t).normalize_or_zero()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn octahedron(radius: f32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let axes = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z];
        let faces = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
        (axes.map(|a| radius * a).to_vec(), faces.to_vec())
    }

    #[test]
    fn a_closed_mesh_becomes_round_with_outward_normals() {
        let (points, faces) = octahedron(2.5);
        let mesh = subdivide(&points, &faces, 4).unwrap();
        assert_eq!(mesh.triangles.len(), 8 * 256);
        assert_eq!(mesh.positions.len(), 2 + 4 * 256);
        let normals = mesh.normals.unwrap();
        for (p, n) in mesh.positions.iter().zip(&normals) {
            assert!((n.length() - 1.0).abs() < 1e-5);
            assert!(n.dot(p.normalize()) > 0.95, "{p} {n}");
        }
        for face in &mesh.triangles {
            let [a, b, c] = face.map(|i| mesh.positions[i as usize]);
            assert!((b - a).cross(c - a).dot(a + b + c) > 0.0);
        }
    }

    #[test]
    fn subdividing_more_stays_on_the_same_limit() {
        let (points, faces) = octahedron(1.5);
        let coarse = subdivide(&points, &faces, 1).unwrap();
        let fine = subdivide(&points, &faces, 4).unwrap();
        for (i, p) in coarse.positions.iter().enumerate() {
            assert!((*p - fine.positions[i]).length() < 1e-5, "{i}");
            let (a, b) = (coarse.normals.as_ref().unwrap()[i], fine.normals.as_ref().unwrap()[i]);
            assert!(a.dot(b) > 0.999, "{i}: {a} {b}");
        }
    }

    #[test]
    fn a_flat_sheet_stays_flat_up_to_its_border() {
        // Four by three squares with a bump of none: every normal is +z, borders and corners among them.
        let at = |x: u32, y: u32| y * 5 + x;
        let points: Vec<Vec3> = (0..4)
            .flat_map(|y| (0..5).map(move |x| Vec3::new(x as f32 - 1.5, 2.0 * y as f32, 3.0)))
            .collect();
        let faces: Vec<[u32; 3]> = (0..3)
            .flat_map(|y| (0..4).map(move |x| (x, y)))
            .flat_map(|(x, y)| {
                [[at(x, y), at(x + 1, y), at(x + 1, y + 1)], [at(x, y), at(x + 1, y + 1), at(x, y + 1)]]
            })
            .collect();
        for levels in [0, 2] {
            let mesh = subdivide(&points, &faces, levels).unwrap();
            for (p, n) in mesh.positions.iter().zip(mesh.normals.as_ref().unwrap()) {
                assert!((p.z - 3.0).abs() < 1e-5);
                assert!((*n - Vec3::Z).length() < 1e-4, "{p} {n}");
            }
        }
    }

    #[test]
    fn what_is_no_surface_is_refused() {
        let points = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z, Vec3::ONE, Vec3::NEG_X, Vec3::NEG_Y];
        let cases: [&[[u32; 3]]; 4] = [
            &[[0, 1, 2], [0, 1, 3]],
            &[[0, 1, 2], [1, 0, 3], [0, 1, 4]],
            &[[0, 1, 2], [0, 5, 6]],
            &[[0, 0, 2]],
        ];
        for faces in cases {
            assert!(subdivide(&points, faces, 1).is_err(), "{faces:?}");
        }
    }
}
