//! What comes before the tree: geometries are checked, bounded and taken apart into primitives.

use lumbre_geometry::{Aabb, PlacedShape};
use lumbre_math::{DMat3, DVec3, Transform};
use rayon::prelude::*;

use crate::build::{Bounds, Kind, Primitive, Traits, binary_tree};
use crate::collapse::{Entry, Packed, pack};
use crate::holds::Holds;
use crate::lanes::Level;
use crate::node::{Node, Units, tag};
use crate::{Accel, BuildError, Geometry, GeometryKind, Instance, TriangleMesh};

/// References have 29 bits of place.
pub(crate) const MOST_PRIMITIVES: usize = (1 << 29) - 1;

/// See [`Accel::build`].
pub(crate) fn build(geometries: Vec<Geometry>) -> Result<Accel, BuildError> {
    if geometries.len() > MOST_PRIMITIVES {
        return Err(BuildError::TooMany);
    }
    let parts = take_apart(&geometries)?;
    let units = units_of(&geometries, &parts);
    let traits: Vec<Traits> = geometries.iter().map(traits_of).collect();

    let mut primitives: Vec<Primitive> = Vec::with_capacity(parts.boxed.len() + parts.triangles);
    primitives.extend(parts.boxed.iter().map(|part| Primitive {
        bounds: Bounds::around(&units, &part.bounds),
        geometry: part.geometry,
        primitive: part.primitive,
    }));
    for (position, geometry) in geometries.iter().enumerate() {
        if let GeometryKind::Mesh(mesh) = &geometry.kind {
            primitives.par_extend(triangles_of(mesh).map(|(triangle, bounds)| Primitive {
                bounds: Bounds::around(&units, &bounds),
                geometry: position as u32,
                primitive: triangle,
            }));
        }
    }
    let count = primitives.len() + parts.infinite.len();
    let tree = if primitives.is_empty() {
        Packed::default()
    } else {
        let binary = binary_tree(&mut primitives, &traits);
        pack(&geometries, &traits, &primitives, &binary)?
    };
    Ok(Accel {
        units,
        holds: Holds::new(&geometries, &tree.blocks),
        tree,
        infinite: parts.infinite,
        bounds: parts.bounds,
        primitives: count,
        level: Level::best(),
        geometries,
    })
}

/// What geometries consist of, triangles apart.
struct Parts {
    /// Everything finite together, what is finite within infinite instances included.
    bounds: Aabb,
    /// Everything finite that goes into the tree.
    tree_bounds: Aabb,
    boxed: Vec<Boxed>,
    infinite: Vec<Entry>,
    /// How many that are not of zero area.
    triangles: usize,
}

struct Boxed {
    bounds: Aabb,
    geometry: u32,
    primitive: u32,
}

fn take_apart(geometries: &[Geometry]) -> Result<Parts, BuildError> {
    let mut parts = Parts {
        bounds: Aabb::EMPTY,
        tree_bounds: Aabb::EMPTY,
        boxed: Vec::new(),
        infinite: Vec::new(),
        triangles: 0,
    };
    for (position, geometry) in geometries.iter().enumerate() {
        let room = MOST_PRIMITIVES - parts.boxed.len() - parts.infinite.len() - parts.triangles;
        match &geometry.kind {
            GeometryKind::Mesh(mesh) => {
                if mesh.indices.len() > room {
                    return Err(BuildError::TooMany);
                }
                check_mesh(position, mesh)?;
                let (bounds, triangles) = triangles_of(mesh)
                    .map(|(_, bounds)| (bounds, 1))
                    .reduce(|| (Aabb::EMPTY, 0), |a, b| (a.0.union(b.0), a.1 + b.1));
                parts.tree_bounds = parts.tree_bounds.union(bounds);
                parts.triangles += triangles;
            }
            GeometryKind::Shape(shape) => parts.add(position, 0, shape.bounds(), room)?,
            GeometryKind::Custom(custom) => {
                for primitive in 0..custom.primitive_count() {
                    let room = MOST_PRIMITIVES - parts.boxed.len() - parts.infinite.len() - parts.triangles;
                    parts.add(position, primitive, custom.bounds(primitive), room)?;
                }
            }
            GeometryKind::Instance(instance) => {
                let (is_infinite, bounds) = (!instance.accel.infinite.is_empty(), instance_bounds(instance));
                if is_infinite {
                    parts.bounds = parts.bounds.union(bounds);
                    parts.add(position, 0, None, room)?;
                } else if !bounds.is_empty() {
                    parts.add(position, 0, Some(bounds), room)?;
                }
            }
        }
    }
    parts.bounds = parts.bounds.union(parts.tree_bounds);
    Ok(parts)
}

impl Parts {
    fn add(
        &mut self,
        position: usize,
        primitive: u32,
        bounds: Option<Aabb>,
        room: usize,
    ) -> Result<(), BuildError> {
        if room == 0 {
            return Err(BuildError::TooMany);
        }
        let geometry = position as u32;
        match bounds {
            Some(bounds) if bounds.min.is_nan() || bounds.max.is_nan() => {
                return Err(BuildError::NotFinite { geometry: position, element: primitive as usize });
            }
            Some(bounds) if bounds.is_empty() => {}
            Some(bounds) if bounds.min.is_finite() && bounds.max.is_finite() => {
                self.tree_bounds = self.tree_bounds.union(bounds);
                self.boxed.push(Boxed { bounds, geometry, primitive });
            }
            _ => self.infinite.push(Entry::new(geometry, primitive, true)),
        }
        Ok(())
    }
}

fn check_mesh(position: usize, mesh: &TriangleMesh) -> Result<(), BuildError> {
    if !mesh.origin.is_finite() {
        return Err(BuildError::NotFinite { geometry: position, element: 0 });
    }
    if let Some(element) = mesh.positions.par_iter().position_first(|position| !position.is_finite()) {
        return Err(BuildError::NotFinite { geometry: position, element });
    }
    let is_outside = |vertex: &u32| *vertex as usize >= mesh.positions.len();
    match mesh.indices.par_iter().position_first(|triangle| triangle.iter().any(is_outside)) {
        Some(triangle) => Err(BuildError::VertexOutOfRange { geometry: position, triangle }),
        None => Ok(()),
    }
}

/// The triangles that have an area, and their boxes in space.
fn triangles_of(mesh: &TriangleMesh) -> impl ParallelIterator<Item = (u32, Aabb)> {
    mesh.indices.par_iter().enumerate().filter_map(|(triangle, vertices)| {
        let [p0, p1, p2] = vertices.map(|vertex| mesh.positions[vertex as usize].as_dvec3());
        let has_area = (p1 - p0).cross(p2 - p0) != DVec3::ZERO;
        let bounds = Aabb { min: mesh.origin + p0.min(p1).min(p2), max: mesh.origin + p0.max(p1).max(p2) };
        has_area.then_some((triangle as u32, bounds))
    })
}

/// The units that make the tree's boxes about 1 in size.
fn units_of(geometries: &[Geometry], parts: &Parts) -> Units {
    let bounds = if parts.tree_bounds.is_empty() {
        Aabb { min: DVec3::ZERO, max: DVec3::ZERO }
    } else {
        parts.tree_bounds
    };
    let origin = bounds.center();
    let half = (bounds.max - origin).max(origin - bounds.min);
    let largest = half.max_element();
    // The power of two that brings the largest half edge into (0.5, 1].
    let scale = if largest > 0.0 && largest.is_finite() {
        let exponent = largest.log2().ceil().clamp(-1000.0, 1000.0);
        f64::from_bits((1023.0 - exponent) as u64 * (1 << 52))
    } else {
        1.0
    };
    let condition = geometries.iter().fold(1.0, |worst: f64, geometry| match &geometry.kind {
        GeometryKind::Shape(shape) => worst.max(condition_of(&shape.world_from_object())),
        GeometryKind::Instance(instance) => {
            let inner = instance.accel.units.condition;
            worst.max(condition_of(&instance.world_from_object) * inner + 2.0)
        }
        _ => worst,
    });
    Units { origin, scale, radius: (half * scale).length(), condition }
}

/// By how much a map and its inverse together may enlarge rounding errors: the lesser of two bounds, of which one is 1
/// for every rotation with a uniform scale, the other for every scale along the axes.
fn condition_of(map: &Transform) -> f64 {
    let (there, back) = (map.linear(), map.inverse_affine().matrix3);
    let size = |m: DMat3| m.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt();
    let sizes = |m: DMat3| DMat3::from_cols(m.x_axis.abs(), m.y_axis.abs(), m.z_axis.abs());
    let by_norm = size(there) * size(back) / 3.0;
    let by_component = (sizes(there) * sizes(back) * DVec3::ONE).max_element();
    by_norm.min(by_component).max(1.0)
}

/// A box around an instance of what is finite: of boxes two levels down the inner tree, each taken over by itself, which
/// is tighter than the image of the whole.
fn instance_bounds(instance: &Instance) -> Aabb {
    let inner = &instance.accel;
    let map = &instance.world_from_object;
    let whole = placed_bounds(&inner.bounds, map);
    let node = |reference: u32| {
        (reference >> tag::SHIFT == tag::INNER).then(|| &inner.tree.nodes[reference as usize])
    };
    let Some(root) = inner.tree.root.filter(|_| inner.infinite.is_empty()).and_then(node) else {
        return whole;
    };
    let mut joined = Aabb::EMPTY;
    for lane in 0..root.len as usize {
        match node(root.children[lane]) {
            Some(child) => {
                for lane in 0..child.len as usize {
                    joined = joined.union(placed_bounds(&box_in_space(&inner.units, child, lane), map));
                }
            }
            None => joined = joined.union(placed_bounds(&box_in_space(&inner.units, root, lane), map)),
        }
    }
    // Each bounds it, so that their common part does.
    Aabb { min: joined.min.max(whole.min), max: joined.max.min(whole.max) }
}

/// A node's box, back from tree units.
fn box_in_space(units: &Units, node: &Node, lane: usize) -> Aabb {
    let plane = |side: usize| {
        let planes = [0, 2, 4].map(|axis| f64::from(node.planes[axis + side][lane]));
        DVec3::from_array(planes) / units.scale + units.origin
    };
    // Rounded once more than the planes were.
    Aabb { min: plane(0), max: plane(1) }.outward(2)
}

/// A box around the image of a box (J. Arvo, "Transforming axis-aligned bounding boxes", Graphics Gems, 1990).
fn placed_bounds(bounds: &Aabb, map: &Transform) -> Aabb {
    if bounds.is_empty() {
        return Aabb::EMPTY;
    }
    let affine = map.affine();
    let linear = affine.matrix3;
    let sizes = DMat3::from_cols(linear.x_axis.abs(), linear.y_axis.abs(), linear.z_axis.abs());
    let center = bounds.center();
    let half = (bounds.max - center).max(center - bounds.min);
    let image = affine.transform_point3(center);
    let reach = sizes * half;
    let rounding = 8.0 * f64::EPSILON * (sizes * (center.abs() + half) + affine.translation.abs());
    Aabb { min: image - reach - rounding, max: image + reach + rounding }
}

/// What the build must know of a geometry. Costs are relative to a node's.
fn traits_of(geometry: &Geometry) -> Traits {
    match &geometry.kind {
        GeometryKind::Mesh(_) => Traits { kind: Kind::Triangle, cost: 0.5 },
        GeometryKind::Shape(shape) => Traits { kind: Kind::Shape, cost: cost_of(shape) },
        GeometryKind::Instance(_) => Traits { kind: Kind::Instance, cost: 6.0 },
        GeometryKind::Custom(_) => Traits { kind: Kind::Custom, cost: 3.0 },
    }
}

fn cost_of(shape: &PlacedShape) -> f32 {
    let moved = if shape.world_from_object().is_identity() { 0.0 } else { 0.5 };
    moved + shape.shape().search_cost()
}
