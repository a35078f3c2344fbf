//! Trees over the triangles of meshes, for scenes that ask where a ray meets one.

use std::collections::HashMap;
use std::sync::{Arc, OnceLock};

use lumbre_geometry::{Aabb, Ray, Root, Roots, Triangle};
use lumbre_math::{DVec2, DVec3, Transform};
use lumbre_scene::MeshDesc;

/// Up to this many triangles are tested one after another.
const LEAF: usize = 8;

/// Trees by the addresses of their meshes, which stay as long as that.
pub(super) type MeshTrees = HashMap<usize, (Arc<MeshDesc>, MeshTree)>;

/// Boxes around ever fewer triangles.
#[derive(Debug)]
pub(super) struct MeshTree {
    nodes: Vec<Node>,
    order: Vec<u32>,
}

#[derive(Debug)]
struct Node {
    bounds: Aabb,
    /// Which of the triangles are in it.
    first: usize,
    count: usize,
    /// The second of its children, the first follows it; 0 for a leaf.
    second: usize,
}

/// A mesh as a surface of which parts are seen, and what it encloses.
#[derive(Debug)]
pub(super) struct MeshBody {
    mesh: Arc<MeshDesc>,
    tree: OnceLock<MeshTree>,
    enclosure: Option<Arc<Enclosure>>,
}

/// The inside of a mesh: from where a ray in a direction crosses its triangles an odd number of times.
#[derive(Debug)]
pub(super) struct Enclosure {
    mesh: MeshDesc,
    tree: OnceLock<MeshTree>,
    direction: DVec3,
}

impl Enclosure {
    /// That of triangles, each of three positions.
    pub(super) fn new(positions: Vec<lumbre_math::Vec3>, direction: DVec3) -> Self {
        let count = positions.len() as u32 / 3;
        let triangles = (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        Self {
            mesh: MeshDesc { positions, triangles, ..MeshDesc::default() },
            tree: OnceLock::new(),
            direction,
        }
    }

    pub(super) fn contains(&self, p: DVec3) -> bool {
        let tree = self.tree.get_or_init(|| MeshTree::new(&self.mesh));
        let mut is_inside = false;
        tree.each(&self.mesh, &Ray::new(p, self.direction), &mut |_, _| {
            is_inside = !is_inside;
            f64::INFINITY
        });
        is_inside
    }
}

impl MeshBody {
    pub(super) fn new(mesh: &Arc<MeshDesc>, enclosure: Option<&Arc<Enclosure>>) -> Self {
        Self { mesh: Arc::clone(mesh), tree: OnceLock::new(), enclosure: enclosure.cloned() }
    }

    pub(super) fn contains(&self, p: DVec3) -> bool {
        self.enclosure.as_ref().is_some_and(|enclosure| enclosure.contains(p))
    }

    pub(super) fn bounds(&self) -> Aabb {
        Aabb::around(self.mesh.positions.iter().map(|p| p.as_dvec3()))
    }

    /// Its crossings, each with the number of its triangle as its part.
    pub(super) fn roots(&self, ray: &Ray, out: &mut Roots) {
        let tree = self.tree.get_or_init(|| MeshTree::new(&self.mesh));
        tree.each(&self.mesh, ray, &mut |face, root| {
            out.push(Root { part: face, ..*root });
            f64::INFINITY
        });
        out.sort_by(|a, b| a.t.total_cmp(&b.t));
    }

    pub(super) fn normal(&self, root: &Root) -> DVec3 {
        normal(&self.mesh, root.part, root.local)
    }

    pub(super) fn uv(&self, root: &Root) -> DVec2 {
        let Some(uvs) = &self.mesh.uvs else { return root.local };
        let [a, b, c] = self.mesh.triangles[root.part as usize].map(|i| uvs[i as usize].as_dvec2());
        a * (1.0 - root.local.x - root.local.y) + b * root.local.x + c * root.local.y
    }
}

/// A normal of any length at a place of a triangle: interpolated, where the mesh has normals.
fn normal(mesh: &MeshDesc, face: u32, DVec2 { x, y }: DVec2) -> DVec3 {
    let face = mesh.triangles[face as usize];
    if let Some(normals) = &mesh.normals {
        let [a, b, c] = face.map(|i| normals[i as usize].as_dvec3());
        return a * (1.0 - x - y) + b * x + c * y;
    }
    let [a, b, c] = face.map(|i| mesh.positions[i as usize].as_dvec3());
    (b - a).cross(c - a)
}

/// The first triangle of a mesh along a ray, with its unit normal: interpolated, where the mesh has normals.
pub(super) fn mesh_hit(
    trees: &mut MeshTrees,
    mesh: &Arc<MeshDesc>,
    map: &Transform,
    ray: &Ray,
) -> Option<(f64, DVec3)> {
    let key = Arc::as_ptr(mesh) as usize;
    let (_, tree) = trees.entry(key).or_insert_with(|| (Arc::clone(mesh), MeshTree::new(mesh)));
    let (t, normal) = tree.closest(mesh, &ray.into_object(map))?;
    Some((t, map.normal(normal).normalize_or(DVec3::Y)))
}

impl MeshTree {
    fn new(mesh: &MeshDesc) -> Self {
        let corners =
            |face: u32| mesh.triangles[face as usize].map(|i| mesh.positions[i as usize].as_dvec3());
        let middle = |face: u32| corners(face).iter().sum::<DVec3>();
        let mut tree = Self { nodes: Vec::new(), order: (0..mesh.triangles.len() as u32).collect() };
        // What is still to be split, with the parent whose second child it is.
        let mut open = vec![(0, tree.order.len(), None)];
        while let Some((first, count, parent)) = open.pop() {
            let index = tree.nodes.len();
            if let Some(parent) = parent {
                let parent: &mut Node = &mut tree.nodes[parent];
                parent.second = index;
            }
            let faces = &mut tree.order[first..first + count];
            let bounds = Aabb::around(faces.iter().flat_map(|face| corners(*face)));
            tree.nodes.push(Node { bounds, first, count, second: 0 });
            if count <= LEAF {
                continue;
            }
            let size = bounds.max - bounds.min;
            let axis = if size.x >= size.y && size.x >= size.z {
                0
            } else if size.y >= size.z {
                1
            } else {
                2
            };
            let half = count / 2;
            faces.select_nth_unstable_by(half, |a, b| middle(*a)[axis].total_cmp(&middle(*b)[axis]));
            open.push((first + half, count - half, Some(index)));
            open.push((first, half, None));
        }
        tree
    }

    /// The first hit, with a normal of any length.
    fn closest(&self, mesh: &MeshDesc, ray: &Ray) -> Option<(f64, DVec3)> {
        let mut best: Option<(f64, DVec3)> = None;
        self.each(mesh, ray, &mut |face, root| {
            if best.is_none_or(|(t, _)| root.t < t) {
                best = Some((root.t, normal(mesh, face, root.local)));
            }
            best.map_or(f64::INFINITY, |(t, _)| t)
        });
        best
    }

    /// Visits the triangles that a ray meets, in no order. A visit says beyond where hits are of no use any more.
    fn each(&self, mesh: &MeshDesc, ray: &Ray, visit: &mut dyn FnMut(u32, &Root) -> f64) {
        if mesh.triangles.is_empty() {
            return;
        }
        let mut last = ray.t_max;
        let mut open = vec![0];
        while let Some(index) = open.pop() {
            let node = &self.nodes[index];
            if !is_met(&node.bounds, ray, last) {
                continue;
            }
            if node.second != 0 {
                open.extend([node.second, index + 1]);
                continue;
            }
            for &face in &self.order[node.first..node.first + node.count] {
                let [a, b, c] = mesh.triangles[face as usize].map(|i| mesh.positions[i as usize].as_dvec3());
                let Ok(triangle) = Triangle::new(a, b, c) else { continue };
                if let Some(root) = triangle.closest(ray) {
                    last = last.min(visit(face, &root));
                }
            }
        }
    }
}

/// Whether a ray meets a box before t; what touches it counts.
fn is_met(bounds: &Aabb, ray: &Ray, t: f64) -> bool {
    let margin = DVec3::splat(1e-9 * (bounds.max.abs().max(bounds.min.abs())).max_element());
    let (a, b) = (
        (bounds.min - margin - ray.origin) / ray.direction,
        (bounds.max + margin - ray.origin) / ray.direction,
    );
    let (near, far) = (a.min(b), a.max(b));
    let near = near.to_array().into_iter().filter(|t| !t.is_nan()).fold(ray.t_min, f64::max);
    let far = far.to_array().into_iter().filter(|t| !t.is_nan()).fold(t, f64::min);
    near <= far
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumbre_math::Vec3;

    #[test]
    fn a_tree_finds_what_a_look_at_every_triangle_finds() {
        let mut mesh = MeshDesc::default();
        for i in 0..300_u32 {
            let spread = |k: u32| ((i * k) % 101) as f32 / 50.0 - 1.0;
            let corner = Vec3::new(spread(31), spread(57), spread(83));
            mesh.positions.extend([
                corner,
                corner + Vec3::new(0.2, spread(7) * 0.1, 0.05),
                corner + Vec3::new(0.0, 0.3, spread(11) * 0.2),
            ]);
            mesh.triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
        }
        let tree = MeshTree::new(&mesh);
        let mut hits = 0;
        for i in 0..300_u32 {
            let spread = |k: u32| f64::from((i * k) % 97) / 48.0 - 1.0;
            let ray = Ray::new(
                DVec3::new(spread(13), spread(29), -4.0),
                DVec3::new(0.1 * spread(5), 0.1 * spread(3), 1.5),
            );
            let every = mesh.triangles.iter().filter_map(|face| {
                let corner = |k: usize| mesh.positions[face[k] as usize].as_dvec3();
                Triangle::new(corner(0), corner(1), corner(2)).ok()?.closest(&ray)
            });
            let expected = every.map(|root| root.t).min_by(f64::total_cmp);
            assert_eq!(tree.closest(&mesh, &ray).map(|(t, _)| t), expected);
            hits += u32::from(expected.is_some());
        }
        assert!(hits > 50, "{hits}");
    }
}
