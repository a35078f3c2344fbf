//! What has no area: triangles that are lines or points, and spheres without a radius.
//!
//! No ray hits these, so trees leave them out. Distances count them: here they have a tree of their own, of nested boxes that are
//! halved at the median. It is made when the first closest point is asked for.

use lumbre_geometry::Aabb;
use lumbre_math::{DMat3, DVec3, Transform};

use crate::geometry::has_area;
use crate::tree::sphere_block::{ExactSphere, has_radius};
use crate::{Accel, GeometryKind, Placement, precise_mesh};

/// The most items of a leaf.
const LEAF: usize = 4;

/// The flat primitives of one tree's geometries.
#[derive(Debug, Default)]
pub(crate) struct Flats {
    // The first is the root; none where there are no items.
    nodes: Vec<FlatNode>,
    items: Vec<FlatItem>,
    /// The greatest finite coordinates, without their signs.
    pub(crate) reach: DVec3,
}

#[derive(Debug)]
pub(crate) struct FlatNode {
    /// Everything below it; infinite where something below moves.
    pub(crate) bounds: Aabb,
    pub(crate) below: Below,
}

#[derive(Clone, Copy, Debug)]
pub(crate) enum Below {
    /// The second child; the first one is the next node.
    Nodes(u32),
    /// A range of items.
    Items(u32, u32),
}

/// A flat primitive, or an instance of a tree that has some.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FlatItem {
    pub(crate) geometry: u32,
    pub(crate) primitive: u32,
}

impl Flats {
    pub(crate) fn of(accel: &Accel) -> Self {
        let mut boxed: Vec<(Aabb, FlatItem)> = Vec::new();
        for (geometry, standing) in (0..).zip(&accel.geometries) {
            let mut add =
                |primitive: u32, bounds: Aabb| boxed.push((bounds, FlatItem { geometry, primitive }));
            match &standing.kind {
                GeometryKind::Mesh(mesh) => {
                    for (primitive, triangle) in (0..).zip(&mesh.indices) {
                        let corners = triangle.map(|vertex| mesh.positions[vertex as usize]);
                        if !has_area(&corners) {
                            add(primitive, Aabb::around(corners.map(|p| mesh.origin + p.as_dvec3())));
                        }
                    }
                }
                GeometryKind::PreciseMesh(mesh) => {
                    for primitive in 0..mesh.indices.len() as u32 {
                        let corners = mesh.corners(primitive);
                        if !precise_mesh::has_area(&corners) {
                            add(primitive, Aabb::around(corners));
                        }
                    }
                }
                GeometryKind::Spheres(cloud) => {
                    for (primitive, sphere) in (0..).zip(&cloud.spheres) {
                        if !has_radius(sphere) {
                            add(primitive, Aabb::around([ExactSphere::of(cloud, primitive).center]));
                        }
                    }
                }
                GeometryKind::Instance(instance) => {
                    if let Some(root) = instance.accel.flats().root() {
                        add(0, placed(&root.bounds, &instance.world_from_object));
                    }
                }
                GeometryKind::Shape(_) | GeometryKind::Custom(_) => {}
            }
        }
        let mut flats = Self::default();
        if !boxed.is_empty() {
            flats.split(&mut boxed, 0);
            flats.items = boxed.iter().map(|(_, item)| *item).collect();
            let reaches = boxed.iter().map(|(bounds, _)| bounds.min.abs().max(bounds.max.abs()));
            flats.reach = reaches.filter(|reach| reach.is_finite()).fold(DVec3::ZERO, DVec3::max);
        }
        flats
    }

    /// Makes the node of these items, which start at a position in the list. Halves differ by one at most, so it nests no deeper
    /// than the logarithm of their number.
    fn split(&mut self, boxed: &mut [(Aabb, FlatItem)], first: usize) {
        let bounds = boxed.iter().fold(Aabb::EMPTY, |all, (bounds, _)| all.union(*bounds));
        let node = self.nodes.len();
        let all = Below::Items(first as u32, (first + boxed.len()) as u32);
        self.nodes.push(FlatNode { bounds, below: all });
        if boxed.len() <= LEAF {
            return;
        }
        let center = |bounds: &Aabb| 0.5 * bounds.min + 0.5 * bounds.max;
        let centers = Aabb::around(boxed.iter().map(|(bounds, _)| center(bounds)).filter(|c| c.is_finite()));
        let size = centers.size();
        let axis = (0..3).max_by(|&a, &b| size[a].total_cmp(&size[b])).unwrap_or(0);
        let middle = boxed.len() / 2;
        boxed.select_nth_unstable_by(middle, |a, b| {
            let by_center = center(&a.0)[axis].total_cmp(&center(&b.0)[axis]);
            by_center.then((a.1.geometry, a.1.primitive).cmp(&(b.1.geometry, b.1.primitive)))
        });
        let (below, above) = boxed.split_at_mut(middle);
        self.split(below, first);
        self.nodes[node].below = Below::Nodes(self.nodes.len() as u32);
        self.split(above, first + middle);
    }

    pub(crate) fn root(&self) -> Option<&FlatNode> {
        self.nodes.first()
    }

    pub(crate) fn node(&self, node: u32) -> &FlatNode {
        &self.nodes[node as usize]
    }

    pub(crate) fn items(&self, first: u32, end: u32) -> &[FlatItem] {
        &self.items[first as usize..end as usize]
    }

    /// Bytes that they take.
    pub(crate) fn memory_bytes(&self) -> usize {
        self.nodes.capacity() * size_of::<FlatNode>() + self.items.capacity() * size_of::<FlatItem>()
    }
}

impl Accel {
    /// What has no area among its geometries.
    pub(crate) fn flats(&self) -> &Flats {
        self.flats.get_or_init(|| Flats::of(self))
    }
}

/// A box that holds another one under a map, rounding included; infinite where that moves.
fn placed(bounds: &Aabb, placement: &Placement) -> Aabb {
    match placement {
        Placement::Still(map) if bounds.min.is_finite() && bounds.max.is_finite() => moved(bounds, map),
        Placement::Still(_) | Placement::Moving(_) => Aabb { min: DVec3::NEG_INFINITY, max: DVec3::INFINITY },
    }
}

fn moved(bounds: &Aabb, map: &Transform) -> Aabb {
    let corners = (0..8).map(|i| {
        let pick = |bit: usize| if i >> bit & 1 == 1 { bounds.max } else { bounds.min };
        map.point(DVec3::new(pick(0).x, pick(1).y, pick(2).z))
    });
    let moved = Aabb::around(corners);
    let linear = map.linear();
    let sizes = DMat3::from_cols(linear.x_axis.abs(), linear.y_axis.abs(), linear.z_axis.abs());
    let far = bounds.min.abs().max(bounds.max.abs());
    let rounding = 1e-15 * (sizes * far + map.point(DVec3::ZERO).abs());
    Aabb { min: moved.min - rounding, max: moved.max + rounding }
}
