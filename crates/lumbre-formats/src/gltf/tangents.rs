//! Tangents for meshes without them, as normal maps expect.

use std::collections::HashMap;

use lumbre_math::{Elementary, Vec2, Vec3, Vec4};

use super::file::File;
use super::json::Read;
use super::mesh::Vertices;

/// Computes the tangents of vertices from one of their uv sets; a vertex with several is split. Without normals
/// each triangle gets its own vertices with a flat normal. Without the uv set nothing happens.
///
/// M. Mikkelsen, "Simulation of Wrinkled Surfaces Revisited", master's thesis, University of Copenhagen, 2008
/// ("MikkTSpace"), as glTF requires: triangles around a vertex that are connected by edges and whose uv
/// orientation agrees share a tangent, the mean of their ∂p/∂u weighted by angle. Differences: vertices are
/// shared only if the file shares them or they are bitwise equal, and sums are in another order.
pub(super) fn make(
    file: &File<'_>,
    vertices: &mut Vertices,
    triangles: &mut [[u32; 3]],
    set: usize,
) -> Read<()> {
    let Some(Some(_)) = vertices.uvs.get(set) else { return Ok(()) };
    let corners = triangles.len() * 3;
    // The tangent of each corner, and the data to find its neighbours.
    let scratch = (corners * (size_of::<Vec4>() + 3 * size_of::<(u64, u64)>())) as u64;
    file.budget.bytes(scratch, "tangents")?;
    if vertices.normals.is_none() {
        let old: Vec<u32> = triangles.iter().flatten().copied().collect();
        grow(file, vertices, corners)?;
        vertices.pick(&old);
        let mut normals = Vec::with_capacity(corners);
        for (triangle, i) in triangles.iter_mut().zip((0_u32..).step_by(3)) {
            *triangle = [i, i + 1, i + 2];
            let [a, b, c] = triangle.map(|i| vertices.positions[i as usize].as_dvec3());
            normals.extend([(b - a).cross(c - a).normalize_or_zero().as_vec3(); 3]);
        }
        vertices.normals = Some(normals);
    }
    let (Some(normals), Some(Some(uvs))) = (&vertices.normals, vertices.uvs.get(set)) else { return Ok(()) };
    // Our v counts upwards.
    let uvs: Vec<Vec2> = uvs.iter().map(|uv| Vec2::new(uv.x, 1.0 - uv.y)).collect();
    let tangents = of_corners(&vertices.positions, normals, &uvs, triangles);
    split(file, vertices, triangles, &tangents)?;
    file.budget.release(scratch);
    Ok(())
}

/// Charges for a list of vertices that grows to this length.
fn grow(file: &File<'_>, vertices: &Vertices, count: usize) -> Read<()> {
    let sets = vertices.uvs.iter().flatten().count() as u64;
    let each = 3 * 12 + 4 + sets * 8 + if vertices.colours.is_some() { 16 } else { 0 };
    file.budget.bytes(count.saturating_sub(vertices.positions.len()) as u64 * each, "vertices")?;
    Ok(())
}

/// Gives every vertex the tangent of its corners, copying the vertex for each further tangent.
fn split(
    file: &File<'_>,
    vertices: &mut Vertices,
    triangles: &mut [[u32; 3]],
    tangents: &[Vec4],
) -> Read<()> {
    let bits = |t: Vec4| t.to_array().map(f32::to_bits);
    let count = vertices.positions.len();
    let mut own: Vec<Option<Vec4>> = vec![None; count];
    let mut old: Vec<u32> = (0..count as u32).collect();
    let mut copies: HashMap<(u32, [u32; 4]), u32> = HashMap::new();
    let mut further = vec![];
    for (corner, &tangent) in triangles.iter_mut().flatten().zip(tangents) {
        match &mut own[*corner as usize] {
            Some(first) if bits(*first) != bits(tangent) => {
                *corner = *copies.entry((*corner, bits(tangent))).or_insert_with(|| {
                    old.push(*corner);
                    further.push(tangent);
                    old.len() as u32 - 1
                });
            }
            first => *first = Some(tangent),
        }
    }
    grow(file, vertices, old.len())?;
    if !further.is_empty() {
        vertices.tangents = None;
        vertices.pick(&old);
    }
    vertices.tangents = Some(own.into_iter().map(Option::unwrap_or_default).chain(further).collect());
    Ok(())
}

/// A triangle with the directions of its uv.
struct Face {
    /// Its corners, with equal vertices merged.
    corners: [u32; 3],
    /// ∂p/∂u, unit.
    along_u: Vec3,
    /// Whether u, v and the normal are right-handed; `None` where the uv area is 0.
    keeps_order: Option<bool>,
    /// The triangles across its edges: from corner k to the next.
    neighbours: [Option<u32>; 3],
}

/// The tangent at each corner of each triangle, with the sign of the bitangent; zero where there is none.
fn of_corners(positions: &[Vec3], normals: &[Vec3], uvs: &[Vec2], triangles: &[[u32; 3]]) -> Vec<Vec4> {
    let uv = |i: u32| if uvs[i as usize].is_finite() { uvs[i as usize] } else { Vec2::ZERO };
    let position = |i: u32| positions[i as usize];
    let one = welded(positions, normals, uvs);
    let mut faces: Vec<Face> = triangles
        .iter()
        .map(|&triangle| {
            let [a, b, c] = triangle;
            let (p, q) = (position(b) - position(a), position(c) - position(a));
            let (s, t) = (uv(b) - uv(a), uv(c) - uv(a));
            let area = s.perp_dot(t);
            let sign = if area > 0.0 { 1.0 } else { -1.0 };
            let along_u = (t.y * p - s.y * q).normalize_or_zero() * sign;
            let along_v = (s.x * q - t.x * p).normalize_or_zero();
            let says_something = area != 0.0 && along_u != Vec3::ZERO && along_v != Vec3::ZERO;
            let keeps_order = says_something.then_some(area > 0.0);
            Face { corners: triangle.map(|i| one[i as usize]), along_u, keeps_order, neighbours: [None; 3] }
        })
        .collect();
    join(&mut faces);

    let mut tangents = vec![Vec4::ZERO; 3 * triangles.len()];
    let mut done = vec![false; 3 * triangles.len()];
    let mut group: Vec<(usize, usize)> = vec![];
    for first in 0..faces.len() {
        for k in 0..3 {
            let Some(order) = faces[first].keeps_order else { break };
            if done[3 * first + k] {
                continue;
            }
            // All triangles around this vertex that are reached across its edges.
            let vertex = faces[first].corners[k];
            group.clear();
            group.push((first, k));
            done[3 * first + k] = true;
            let mut next = 0;
            while let Some(&(face, k)) = group.get(next) {
                next += 1;
                for edge in [k, (k + 2) % 3] {
                    let Some(other) = faces[face].neighbours[edge] else { continue };
                    let other = other as usize;
                    let place = faces[other].corners.iter().position(|&corner| corner == vertex);
                    let Some(place) = place.filter(|place| !done[3 * other + place]) else { continue };
                    // A triangle without uv orientation joins the first group.
                    if faces[other].keeps_order.is_none_or(|its| its == order) {
                        done[3 * other + place] = true;
                        group.push((other, place));
                    }
                }
            }
            let normal = normals[triangles[first][k] as usize];
            let mut sum = Vec3::ZERO;
            for &(face, k) in &group {
                if faces[face].keeps_order.is_none() {
                    continue;
                }
                let flat = |v: Vec3| (v - normal * normal.dot(v)).normalize_or_zero();
                let [here, after, before] = [0, 1, 2].map(|i| position(triangles[face][(k + i) % 3]));
                let angle = flat(before - here).dot(flat(after - here)).clamp(-1.0, 1.0).arc_cosine();
                sum += angle * flat(faces[face].along_u);
            }
            let tangent = sum.normalize_or_zero();
            let tangent = if tangent.is_finite() { tangent } else { Vec3::ZERO };
            let tangent = tangent.extend(if order { 1.0 } else { -1.0 });
            for &(face, k) in &group {
                tangents[3 * face + k] = tangent;
            }
        }
    }
    tangents
}

/// For each vertex the first one equal to it.
fn welded(positions: &[Vec3], normals: &[Vec3], uvs: &[Vec2]) -> Vec<u32> {
    // Negative zero is zero.
    let bits = |c: f32| (c + 0.0).to_bits();
    let mut known: HashMap<[u32; 8], u32> = HashMap::new();
    (0_u32..)
        .zip(positions.iter().zip(normals).zip(uvs))
        .map(|(i, ((p, n), uv))| {
            *known.entry([p.x, p.y, p.z, n.x, n.y, n.z, uv.x, uv.y].map(bits)).or_insert(i)
        })
        .collect()
}

/// Finds the triangle across each edge: one that has the edge in the opposite direction. Where more than two
/// share an edge, they pair up in order.
fn join(faces: &mut [Face]) {
    let mut open: HashMap<[u32; 2], Vec<(u32, usize)>> = HashMap::new();
    for i in 0..faces.len() {
        let corners = faces[i].corners;
        for k in 0..3 {
            let (from, to) = (corners[k], corners[(k + 1) % 3]);
            if from == to {
                continue;
            }
            if let Some(waiting) = open.get_mut(&[to, from])
                && let Some((other, edge)) = waiting.pop()
            {
                faces[i].neighbours[k] = Some(other);
                faces[other as usize].neighbours[edge] = Some(i as u32);
            } else {
                open.entry([from, to]).or_default().push((i as u32, k));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A strip of squares along x in the plane z = 2, whose texture lies as `uv` says.
    fn strip(uv: impl Fn(f32, f32) -> Vec2) -> (Vec<Vec3>, Vec<Vec3>, Vec<Vec2>, Vec<[u32; 3]>) {
        let places: Vec<(f32, f32)> =
            (0..5).flat_map(|i| [(1.5 * i as f32, 3.0), (1.5 * i as f32, 7.0)]).collect();
        let positions = places.iter().map(|&(x, y)| Vec3::new(x, y, 2.0)).collect();
        let triangles =
            (0..4).flat_map(|i| [[2 * i, 2 * i + 2, 2 * i + 1], [2 * i + 1, 2 * i + 2, 2 * i + 3]]).collect();
        (positions, vec![Vec3::Z; 10], places.iter().map(|&(x, y)| uv(x, y)).collect(), triangles)
    }

    #[test]
    fn tangents_follow_u_and_know_mirrored_textures() {
        type Lies = fn(f32, f32) -> Vec2;
        let cases: [(Lies, Vec4); 4] = [
            (|x, y| Vec2::new(0.2 * x, 0.3 * y), Vec4::new(1.0, 0.0, 0.0, 1.0)),
            (|x, y| Vec2::new(-0.2 * x, 0.3 * y), Vec4::new(-1.0, 0.0, 0.0, -1.0)),
            (|x, y| Vec2::new(0.3 * y, -0.2 * x), Vec4::new(0.0, 1.0, 0.0, 1.0)),
            (|x, y| Vec2::new(0.3 * y, 0.2 * x), Vec4::new(0.0, 1.0, 0.0, -1.0)),
        ];
        for (uv, expected) in cases {
            let (positions, normals, uvs, triangles) = strip(uv);
            for tangent in of_corners(&positions, &normals, &uvs, &triangles) {
                assert!((tangent - expected).length() < 1e-6, "{tangent} {expected}");
            }
        }
    }

    #[test]
    fn both_halves_of_a_mirrored_texture_have_their_own_tangent() {
        // u goes up to the middle and down again: the vertices there have two tangents.
        let (positions, normals, uvs, triangles) = strip(|x, y| Vec2::new((x - 3.0).abs(), y));
        let tangents = of_corners(&positions, &normals, &uvs, &triangles);
        for (corner, tangent) in triangles.iter().flatten().zip(&tangents) {
            let left = positions[*corner as usize].x < 3.0;
            let right = positions[*corner as usize].x > 3.0;
            assert!(!left || *tangent == Vec4::new(-1.0, 0.0, 0.0, -1.0));
            assert!(!right || *tangent == Vec4::new(1.0, 0.0, 0.0, 1.0));
        }
        assert!(tangents[..12].iter().all(|t| t.w < 0.0) && tangents[12..].iter().all(|t| t.w > 0.0));
    }

    #[test]
    fn large_fans_and_untextured_ones_get_tangents() {
        let count = 100_000_u32;
        let ring = |i: u32| {
            let (sin, cos) = (i as f32 / count as f32 * 6.0).sin_cos();
            Vec3::new(2.0 * cos, 2.0 * sin, 5.0)
        };
        let mut positions = vec![Vec3::new(0.0, 0.0, 5.0)];
        positions.extend((0..=count).map(ring));
        let uvs: Vec<Vec2> = positions.iter().map(|p| Vec2::new(p.x, p.y)).collect();
        let triangles: Vec<[u32; 3]> = (1..=count).map(|i| [0, i, i + 1]).collect();
        let normals = vec![Vec3::Z; positions.len()];
        for tangent in of_corners(&positions, &normals, &uvs, &triangles) {
            assert!((tangent - Vec4::new(1.0, 0.0, 0.0, 1.0)).length() < 1e-3, "{tangent}");
        }
        let nothing = of_corners(&positions, &normals, &vec![Vec2::ONE; positions.len()], &triangles);
        assert!(nothing.iter().all(|&t| t == Vec4::ZERO));
        let broken = vec![Vec2::NAN; positions.len()];
        assert!(
            of_corners(&positions, &vec![Vec3::NAN; positions.len()], &uvs, &triangles)
                .iter()
                .all(|t| t.is_finite())
        );
        assert!(of_corners(&positions, &normals, &broken, &triangles).iter().all(|t| t.is_finite()));
    }
}
