//! Closed meshes as solids for CSG.

use std::collections::HashMap;
use std::ops::ControlFlow;
use std::sync::Arc;

use lumbre_geometry::{Aabb, Crossing, Crossings, Ray, Root, Solid, Surface, Triangle};
use lumbre_kernel::{Accel, BuildOptions, Geometry, GeometryKind, TriangleMesh};
use lumbre_math::{DVec3, Transform, Vec3};

/// A closed triangle mesh; its parts are its triangles.
#[derive(Debug)]
pub(crate) struct MeshSolid {
    mesh: Arc<TriangleMesh>,
    accel: Accel,
}

/// Why a mesh is not a solid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(crate) enum SolidError {
    /// An edge with unequal numbers of triangles in its two directions.
    #[error("the mesh is not closed: triangle {triangle} has an edge without a neighbour")]
    Open {
        /// A triangle with the edge.
        triangle: usize,
    },
    /// It is empty.
    #[error("the mesh has no triangles")]
    Empty,
    /// The tree cannot be built.
    #[error("{0}")]
    Tree(#[from] lumbre_kernel::BuildError),
}

impl MeshSolid {
    /// The solid inside a mesh. Vertices at the same position are merged.
    pub(crate) fn new(mesh: Arc<TriangleMesh>) -> Result<Self, SolidError> {
        if mesh.indices.is_empty() {
            return Err(SolidError::Empty);
        }
        if let Some(triangle) = open_edge(&mesh) {
            return Err(SolidError::Open { triangle });
        }
        let geometry = Geometry { id: 0, kind: GeometryKind::Mesh(mesh.clone()) };
        Ok(Self { accel: Accel::build(vec![geometry], &BuildOptions::default())?, mesh })
    }

    fn triangle(&self, index: u32) -> Option<Triangle> {
        let corners = self.mesh.indices.get(index as usize)?;
        let [a, b, c] = corners.map(|i| self.mesh.origin + self.mesh.positions[i as usize].as_dvec3());
        Triangle::new(a, b, c).ok()
    }
}

/// A triangle with an edge whose numbers of triangles in its two directions differ.
fn open_edge(mesh: &TriangleMesh) -> Option<usize> {
    // Adding 0 turns -0 into 0.
    let key = |p: Vec3| (p + Vec3::ZERO).to_array().map(f32::to_bits);
    let mut places = HashMap::new();
    let places: Vec<u32> = (mesh.positions.iter())
        .map(|&p| {
            let next = places.len() as u32;
            *places.entry(key(p)).or_insert(next)
        })
        .collect();
    let mut balance: HashMap<(u32, u32), (i64, usize)> = HashMap::new();
    for (triangle, corners) in mesh.indices.iter().enumerate() {
        let [a, b, c] = corners.map(|i| places[i as usize]);
        for (from, to) in [(a, b), (b, c), (c, a)] {
            if from != to {
                let (edge, way) = if from < to { ((from, to), 1) } else { ((to, from), -1) };
                balance.entry(edge).or_insert((0, triangle)).0 += way;
            }
        }
    }
    // The least, so that the result does not depend on the order of the map.
    balance.into_values().filter(|&(sum, _)| sum != 0).map(|(_, triangle)| triangle).min()
}

impl Solid for MeshSolid {
    fn part_count(&self) -> u32 {
        self.mesh.indices.len() as u32
    }

    fn bounds(&self, world_from_object: &Transform) -> Aabb {
        let corners = self.mesh.positions.iter().map(|p| self.mesh.origin + p.as_dvec3());
        Aabb::around(corners.map(|p| world_from_object.point(p))).outward(4)
    }

    fn crossings(&self, ray: &Ray, out: &mut Crossings) {
        let bounds = self.accel.bounds();
        let apart = bounds.center() - ray.origin;
        let speed = ray.direction.length();
        // The nearest point of the line to the mesh's centre, and the half-length of the line inside the
        // bounding sphere.
        let nearest = apart.dot(ray.direction) / (speed * speed);
        let reach = (bounds.size().length() + 1e-12 * apart.length()) / speed;
        let line = ray.with_range(nearest - reach, nearest + reach);
        let first = out.len();
        self.accel.all(&line, |hit| {
            let triangle = self.triangle(hit.primitive);
            let normal = triangle.map_or(DVec3::ZERO, |t| {
                let [a, b, c] = t.corners();
                (b - a).cross(c - a)
            });
            let root = Root { part: hit.primitive, ..hit.root };
            out.push(Crossing { root, enters: normal.dot(ray.direction) < 0.0 });
            ControlFlow::Continue(())
        });
        balance(out, first);
    }

    fn surface(&self, ray: &Ray, root: &Root) -> Surface {
        let surface = self.triangle(root.part).map(|triangle| triangle.surface(ray, root));
        surface.unwrap_or_else(|| Surface {
            point: ray.at(root.t),
            point_error: DVec3::ZERO,
            normal: DVec3::Z,
            uv: root.local,
            dpdu: DVec3::X,
            dpdv: DVec3::Y,
            dndu: DVec3::ZERO,
            dndv: DVec3::ZERO,
        })
    }
}

/// Removes unpaired crossings of lines along a face or through a silhouette, so that entries and exits are
/// equal in number. Crossings are in ascending order.
fn balance(crossings: &mut Crossings, first: usize) {
    let mut depth = 0_usize;
    let mut kept = first;
    for i in first..crossings.len() {
        let crossing = crossings[i];
        if !crossing.enters && depth == 0 {
            continue;
        }
        depth = if crossing.enters { depth + 1 } else { depth - 1 };
        crossings[kept] = crossing;
        kept += 1;
    }
    crossings.truncate(kept);
    while depth > 0 {
        let Some(last) = crossings[first..].iter().rposition(|c| c.enters) else { break };
        crossings.remove(first + last);
        depth -= 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tetrahedron away from the origin.
    fn tetrahedron() -> TriangleMesh {
        TriangleMesh {
            origin: DVec3::new(7.0, -3.0, 2.0),
            positions: vec![
                Vec3::new(0.0, 0.0, 0.0),
                Vec3::new(3.0, 0.0, 0.0),
                Vec3::new(0.0, 4.0, 0.0),
                Vec3::new(0.0, 0.0, 5.0),
            ],
            indices: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
        }
    }

    #[test]
    fn a_closed_mesh_is_a_solid_and_one_with_a_hole_is_not() {
        assert!(MeshSolid::new(Arc::new(tetrahedron())).is_ok());
        let mut open = tetrahedron();
        open.indices.pop();
        assert!(matches!(MeshSolid::new(Arc::new(open)), Err(SolidError::Open { .. })));
        let mut turned = tetrahedron();
        turned.indices[2].swap(0, 1);
        assert!(matches!(MeshSolid::new(Arc::new(turned)), Err(SolidError::Open { .. })));
        assert_eq!(MeshSolid::new(Arc::new(TriangleMesh::default())).err(), Some(SolidError::Empty));
    }

    #[test]
    fn lines_enter_as_often_as_they_leave() {
        let solid = MeshSolid::new(Arc::new(tetrahedron())).unwrap();
        let mesh = tetrahedron();
        let mut entered = 0;
        let corner = |i: usize| mesh.origin + mesh.positions[i].as_dvec3();
        for i in 0..4000 {
            let share = f64::from(i) / 4000.0;
            let (a, b) = (corner(i as usize % 4), corner((i as usize / 4) % 4));
            let through = a.lerp(b, share);
            let direction = DVec3::new((9.0 * share).sin(), (7.0 * share).cos(), 0.3 - share);
            let mut crossings = Crossings::new();
            solid.crossings(&Ray::new(through - 20.0 * direction, direction), &mut crossings);
            let enter = crossings.iter().filter(|c| c.enters).count();
            assert_eq!(2 * enter, crossings.len(), "{crossings:?}");
            entered += enter;
        }
        assert!(entered > 500, "{entered}");
    }

    #[test]
    fn a_line_through_the_middle_hits_the_faces() {
        let solid = MeshSolid::new(Arc::new(tetrahedron())).unwrap();
        // Along x at y = 1, z = 1 of the mesh: x from 0 to 3 (1 - 1/4 - 1/5).
        let ray = Ray::new(DVec3::new(27.0, -2.0, 3.0), DVec3::new(-2.0, 0.0, 0.0));
        let mut crossings = Crossings::new();
        solid.crossings(&ray, &mut crossings);
        let found: Vec<(f64, bool)> = crossings.iter().map(|c| (ray.at(c.root.t).x, c.enters)).collect();
        assert_eq!(found.len(), 2);
        assert!((found[0].0 - 8.65).abs() < 1e-6 && found[0].1, "{found:?}");
        assert!((found[1].0 - 7.0).abs() < 1e-6 && !found[1].1, "{found:?}");
    }
}
