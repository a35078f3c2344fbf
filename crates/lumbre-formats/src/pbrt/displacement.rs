//! Displacement of a mesh by a texture: its faces are split until their edges are short, and then every vertex moves
//! along its normal.

use std::collections::HashMap;
use std::sync::Arc;

use lumbre_math::{DVec3, Transform, Vec2, Vec3};
use lumbre_scene::MeshDesc;
use lumbre_shading::{FloatTexture, TextureContext, VertexData};

use crate::budget::{Budget, Hold, LimitError};

/// By what a mesh is displaced.
#[derive(Clone, Debug)]
pub(super) struct Displacement {
    pub texture: Arc<FloatTexture>,
    /// Edges become shorter than this in the world.
    pub edge_length: f64,
    pub world_from_object: Transform,
}

/// Why a mesh is not displaced.
#[derive(Debug)]
pub(super) enum Refused {
    Limit(LimitError),
    /// It has no texture coordinates.
    NoUvs,
    /// The texture is not finite at a vertex.
    NotFinite {
        vertex: usize,
        point: DVec3,
    },
}

impl From<LimitError> for Refused {
    fn from(error: LimitError) -> Self {
        Self::Limit(error)
    }
}

/// What a vertex takes while faces are split, with its edge, and a face.
const VERTEX_BYTES: u64 = 128;
const FACE_BYTES: u64 = 32;
/// Faces for each square of edges, about.
const FACES_PER_SQUARE: f64 = 2.3;
/// What is split between two questions to the budget.
const STRIDE: usize = 1024;

impl Displacement {
    /// The displaced mesh, whose positions are relative to the origin as those of `mesh` are.
    ///
    /// # Errors
    /// [`Refused`].
    pub fn apply(&self, mesh: &MeshDesc, origin: DVec3, budget: &Budget) -> Result<MeshDesc, Refused> {
        let uvs = mesh.uvs.as_ref().ok_or(Refused::NoUvs)?;
        let mut hold = budget.hold_nothing();
        let quads = mesh.quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
        let faces: Vec<[u32; 3]> = mesh.triangles.iter().copied().chain(quads).collect();
        let numbers: Option<Vec<u32>> = mesh.face_indices.as_ref().map(|numbers| {
            let triangles = mesh.triangles.len();
            let of_face = |i: usize| if i < triangles { i } else { triangles + (i - triangles) / 2 };
            (0..faces.len()).map(|i| numbers[of_face(i)]).collect()
        });
        hold.grow((mesh.positions.len() as u64) * VERTEX_BYTES + faces.len() as u64 * FACE_BYTES, WHAT)?;
        let mut work = Refinement {
            positions: mesh.positions.clone(),
            world: mesh.positions.iter().map(|p| self.in_world(*p, origin)).collect(),
            uvs: uvs.clone(),
            normals: mesh.normals.clone().unwrap_or_else(|| normals(&mesh.positions, &faces)),
            edges: HashMap::new(),
            faces: vec![],
            of_face: vec![],
        };
        self.check_size(&work, &faces, budget)?;
        for (number, &face) in faces.iter().enumerate() {
            self.split(&mut work, face, number, origin, budget, &mut hold)?;
        }
        let Refinement { mut positions, uvs, normals: directions, faces, of_face, .. } = work;
        for (i, position) in positions.iter_mut().enumerate() {
            let point = origin + position.as_dvec3();
            let at = TextureContext {
                point,
                normal: directions[i],
                uv: uvs[i],
                dpdx: Vec3::ZERO,
                dpdy: Vec3::ZERO,
                duv_dx: Vec2::ZERO,
                duv_dy: Vec2::ZERO,
                vertex: VertexData::NONE,
                spectral: None,
            };
            let moved = *position + self.texture.evaluate(&at) * directions[i];
            if !moved.is_finite() {
                return Err(Refused::NotFinite { vertex: i, point });
            }
            *position = moved;
        }
        let kept = positions.len() * (2 * size_of::<Vec3>() + size_of::<Vec2>()) + faces.len() * 16;
        budget.bytes(kept as u64, WHAT)?;
        Ok(MeshDesc {
            normals: Some(normals(&positions, &faces)),
            positions,
            uvs: Some(uvs),
            face_indices: numbers.map(|numbers| of_face.iter().map(|&i| numbers[i as usize]).collect()),
            triangles: faces,
            ..MeshDesc::default()
        })
    }

    fn in_world(&self, position: Vec3, origin: DVec3) -> DVec3 {
        self.world_from_object.point(origin + position.as_dvec3())
    }

    /// Charges the budget for about the final number of faces.
    fn check_size(&self, work: &Refinement, faces: &[[u32; 3]], budget: &Budget) -> Result<(), LimitError> {
        let area = |face: &[u32; 3]| {
            let [a, b, c] = face.map(|i| work.world[i as usize]);
            0.5 * (b - a).cross(c - a).length()
        };
        let squares = faces.iter().map(area).sum::<f64>() / (self.edge_length * self.edge_length);
        let about = (FACES_PER_SQUARE * squares).min(1e18) as u64;
        budget.hold(about.saturating_mul(FACE_BYTES + VERTEX_BYTES / 2), WHAT).map(drop)?;
        budget.elements(about, WHAT)
    }

    /// Splits a face, and what becomes of it, at the middle of its longest edge until that is short.
    fn split(
        &self,
        work: &mut Refinement,
        face: [u32; 3],
        number: usize,
        origin: DVec3,
        budget: &Budget,
        hold: &mut Hold<'_>,
    ) -> Result<(), LimitError> {
        let mut open = vec![face];
        while let Some(face) = open.pop() {
            let length = |i: usize| {
                let (a, b) = (face[i], face[(i + 1) % 3]);
                (work.world[a as usize] - work.world[b as usize]).length()
            };
            let longest = (0..3).max_by(|&a, &b| length(a).total_cmp(&length(b))).unwrap_or(0);
            // A face of lengths that are not finite stays as it is.
            let is_long = length(longest) >= self.edge_length && length(longest).is_finite();
            if !is_long {
                work.faces.push(face);
                work.of_face.push(number as u32);
                if work.faces.len().is_multiple_of(STRIDE) {
                    hold.grow(STRIDE as u64 * FACE_BYTES, WHAT)?;
                }
                continue;
            }
            let (a, b, c) = (face[longest], face[(longest + 1) % 3], face[(longest + 2) % 3]);
            let middle = match work.edges.get(&(a.min(b), a.max(b))) {
                Some(&middle) => middle,
                None => {
                    if work.positions.len().is_multiple_of(STRIDE) {
                        hold.grow(STRIDE as u64 * VERTEX_BYTES, WHAT)?;
                        budget.elements(STRIDE as u64, WHAT)?;
                    }
                    work.middle(a, b, |position| self.in_world(position, origin))
                }
            };
            if middle == a || middle == b {
                continue;
            }
            open.extend([[a, middle, c], [middle, b, c]]);
        }
        Ok(())
    }
}

const WHAT: &str = "faces of a displaced plymesh, by its edgelength";

/// A mesh whose faces are being split.
struct Refinement {
    positions: Vec<Vec3>,
    world: Vec<DVec3>,
    uvs: Vec<Vec2>,
    normals: Vec<Vec3>,
    /// The middle of each edge that was split.
    edges: HashMap<(u32, u32), u32>,
    faces: Vec<[u32; 3]>,
    of_face: Vec<u32>,
}

impl Refinement {
    fn middle(&mut self, a: u32, b: u32, in_world: impl Fn(Vec3) -> DVec3) -> u32 {
        let (i, j) = (a as usize, b as usize);
        let position = 0.5 * self.positions[i] + 0.5 * self.positions[j];
        if position == self.positions[i] || position == self.positions[j] {
            // As near as numbers are.
            return if position == self.positions[i] { a } else { b };
        }
        let normal = (self.normals[i] + self.normals[j]).try_normalize();
        self.world.push(in_world(position));
        self.positions.push(position);
        self.uvs.push(0.5 * self.uvs[i] + 0.5 * self.uvs[j]);
        self.normals.push(normal.unwrap_or(self.normals[i]));
        let middle = self.positions.len() as u32 - 1;
        self.edges.insert((a.min(b), a.max(b)), middle);
        middle
    }
}

/// The mean of the unit normals of the faces around each vertex.
fn normals(positions: &[Vec3], faces: &[[u32; 3]]) -> Vec<Vec3> {
    let mut sums = vec![Vec3::ZERO; positions.len()];
    for face in faces {
        let [a, b, c] = face.map(|i| positions[i as usize]);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        face.iter().for_each(|&i| sums[i as usize] += normal);
    }
    sums.iter().map(|sum| sum.normalize_or_zero()).collect()
}

#[cfg(test)]
mod tests {
    use lumbre_math::Transform;
    use lumbre_shading::{Mapping2d, Texture};

    use super::*;
    use crate::Limits;

    /// A roof of two triangles and a quad, with an edge in common each.
    fn mesh() -> MeshDesc {
        let positions = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.5], [0.0, 1.5], [4.0, 0.0], [4.0, 1.5]];
        let positions: Vec<Vec3> = positions.iter().map(|&[x, y]| Vec3::new(x, y, 0.5)).collect();
        let uvs = positions.iter().map(|p| Vec2::new(p.x / 4.0, p.y / 1.5)).collect();
        MeshDesc {
            positions,
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            quads: vec![[1, 4, 5, 2]],
            face_indices: Some(vec![7, 8, 9]),
            uvs: Some(uvs),
            ..MeshDesc::default()
        }
    }

    fn displacement(edge_length: f64) -> Displacement {
        // 2 u along the mesh.
        let texture = Texture::Bilerp { mapping: Mapping2d::IDENTITY, corners: [0.0, 0.0, 2.0, 2.0] };
        let world_from_object = Transform::scale(DVec3::splat(3.0)).unwrap();
        Displacement { texture: Arc::new(texture), edge_length, world_from_object }
    }

    #[test]
    fn displacement_splits_edges_without_cracks() {
        let origin = DVec3::new(0.0, 0.0, 100.0);
        let moved = displacement(0.7).apply(&mesh(), origin, &Budget::default()).unwrap();
        // Each inner edge has two faces in opposite directions, each outer one lies on the outline.
        let mut edges = HashMap::new();
        for face in &moved.triangles {
            for i in 0..3 {
                let (a, b) = (face[i], face[(i + 1) % 3]);
                *edges.entry((a.min(b), a.max(b))).or_insert(0) += if a < b { 1 } else { -1 };
                // Before they move: three times as long in the world.
                let flat = |i: u32| moved.positions[i as usize].truncate();
                assert!((flat(a) - flat(b)).length() * 3.0 < 0.7 + 1e-5);
            }
        }
        let outer = edges.iter().filter(|(_, balance)| **balance != 0);
        for ((a, b), _) in outer {
            let [a, b] = [*a, *b].map(|i| moved.positions[i as usize]);
            let is_on = |along: fn(Vec3) -> f32, at: f32| along(a) == at && along(b) == at;
            let is_outline = is_on(|p| p.x, 0.0) || is_on(|p| p.x, 4.0) || is_on(|p| p.y, 0.0);
            assert!(is_outline || is_on(|p| p.y, 1.5), "{a} {b}");
        }
        let area: f32 = (moved.triangles.iter())
            .map(|face| {
                let [a, b, c] = face.map(|i| moved.positions[i as usize].truncate());
                0.5 * (b - a).perp_dot(c - a)
            })
            .sum();
        assert!((area - 6.0).abs() < 1e-4, "{area}");
        assert!(moved.triangles.len() > 100);
        for position in &moved.positions {
            assert!((position.z - (0.5 + 0.5 * position.x)).abs() < 1e-5, "{position}");
        }
        let slope = Vec3::new(-0.5, 0.0, 1.0).normalize();
        assert!(moved.normals.unwrap().iter().all(|n| (*n - slope).length() < 1e-4));
        let numbers = moved.face_indices.unwrap();
        assert!(numbers.len() == moved.triangles.len() && numbers.contains(&9) && numbers.contains(&7));
    }

    #[test]
    fn impossible_and_huge_displacements_are_refused() {
        let refused = |mesh: &MeshDesc, edge: f64, limits| {
            displacement(edge).apply(mesh, DVec3::ZERO, &Budget::new(limits)).unwrap_err()
        };
        let bare = MeshDesc { uvs: None, ..mesh() };
        assert!(matches!(refused(&bare, 1.0, Limits::default()), Refused::NoUvs));
        let Refused::Limit(error) = refused(&mesh(), 1e-9, Limits::default()) else { panic!() };
        assert!(error.to_string().contains("edgelength"), "{error}");
        let nan = Displacement { texture: Arc::new(Texture::Constant(f32::NAN)), ..displacement(1.0) };
        let refused = nan.apply(&mesh(), DVec3::ZERO, &Budget::default()).unwrap_err();
        assert!(matches!(refused, Refused::NotFinite { vertex: 0, .. }), "{refused:?}");
    }
}
