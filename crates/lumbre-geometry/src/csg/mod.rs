//! Constructive solid geometry: unions, intersections and differences of solids.

mod leaf;
mod spans;
mod tree;

use lumbre_math::{DVec2, DVec3, Transform};

use crate::placed::into_world;
use crate::shape::unsampled;
use crate::{Aabb, BoundingVolume, NearestPoint, NearestPointError, Ray, Root, Roots, Surface};

pub use leaf::{Crossing, Crossings, Leaf, LeafPart, Solid};
pub(crate) use spans::{Event, Events, Membership, coincident};
use tree::Node;

/// A solid composed of others. Every surface point belongs to one leaf: see [`Csg::leaf_of`].
///
/// The crossings of the whole line with all leaves are merged in order of `t`, counting the leaves that the
/// line is inside of; a crossing is kept where the result changes between inside and outside (S. D. Roth, "Ray
/// casting for modeling solids", Computer Graphics and Image Processing, 1982). The ray's range is applied
/// last, so a ray may start anywhere. The operations are regularised (A. A. G. Requicha, "Representations for
/// rigid solids", ACM Computing Surveys, 1980): parts without volume are dropped, so a touch without crossing
/// is no hit.
///
/// Crossings within 256 ulps of the largest coordinate involved count as one. Coincident surfaces therefore
/// leave neither a film nor a gap, whichever way they round: two adjacent boxes are one, and a hole drilled
/// exactly as deep as the block is open. Where surfaces of several leaves coincide on the result's surface, the
/// first leaf owns it.
///
/// The area of such a shape has no closed form. It is given as infinite, nothing is sampled on it, and it
/// cannot be a light.
#[derive(Clone, Debug)]
pub struct Csg {
    // In preorder: the descendants of a node lie between it and its `end`, so traversal needs no stack.
    nodes: Vec<Node>,
    leaves: Vec<Leaf>,
    // The first part of each leaf, in the order of `leaves`, followed by the total.
    first_part: Vec<u32>,
    // For each leaf its node, and whether it is subtracted an odd number of times.
    leaf_nodes: Vec<(u32, bool)>,
    depth: usize,
}

/// The distance from another leaf's surface, relative to the coordinates involved, below which the side of a
/// point is uncertain.
const CLEAR: f64 = 1e-11;

impl Csg {
    /// The first crossing in the ray's range.
    pub fn closest(&self, ray: &Ray) -> Option<Root> {
        let mut found = None;
        self.sweep(ray, |root| {
            found = Some(root);
            false
        });
        found
    }

    /// Every crossing in the ray's range, appended in ascending order.
    pub fn roots(&self, ray: &Ray, out: &mut Roots) {
        self.sweep(ray, |root| {
            out.push(root);
            true
        });
    }

    /// The surface at a crossing: the leaf's, with its normal flipped where the leaf is subtracted.
    pub fn surface(&self, ray: &Ray, root: &Root) -> Surface {
        let Some(LeafPart { leaf, part, flipped }) = self.leaf_of(root) else {
            // Not a root of this shape: any answer will do.
            return self.leaves[0].surface(ray, &Root { part: 0, ..*root });
        };
        flip_if(flipped, self.leaves[leaf].surface(ray, &Root { part, ..*root }))
    }

    /// The surface of a leaf's part at `uv`, whether or not the other operands remove it there; `None` for
    /// user-defined solids.
    pub fn surface_at(&self, part: u32, uv: DVec2) -> Option<Surface> {
        let LeafPart { leaf, part, flipped } = self.leaf_of(&Root { part, ..Root::at(0.0) })?;
        match &self.leaves[leaf] {
            Leaf::Shape(shape) => {
                let surface = shape.shape().surface_at(part, uv)?;
                let map = shape.world_from_object();
                let surface = if map.is_identity() { surface } else { into_world(&map, &surface) };
                Some(flip_if(flipped, surface))
            }
            Leaf::Solid { .. } => None,
        }
    }

    /// A bounding box under a transform; `None` when it is unbounded. It is not always tight: a union has the
    /// box around its operands' boxes, an intersection the boxes' intersection, a difference the box of its
    /// first operand.
    pub fn bounds(&self, world_from_object: &Transform) -> Option<Aabb> {
        let bounds = (*self.node_bounds(world_from_object).first()?)?;
        if !bounds.is_empty() {
            return Some(bounds);
        }
        // The operands are disjoint, so nothing is ever hit: a box of one point will do.
        let center = bounds.center();
        Some(Aabb { min: center, max: center })
    }

    /// A bounding volume: the box.
    pub fn bounding_volume(&self) -> Option<BoundingVolume> {
        BoundingVolume::of_box(&self.bounds(&Transform::IDENTITY)?)
    }

    /// Always.
    pub fn is_solid(&self) -> bool {
        true
    }

    /// Whether it contains `p`.
    pub fn contains(&self, p: DVec3) -> bool {
        let mut membership = Membership::new(self);
        for (i, leaf) in self.leaves.iter().enumerate() {
            if leaf.contains(p) {
                membership.cross(i as u32, true);
            }
        }
        membership.contains(0)
    }

    /// The nearest point to `p`, where that is the nearest point of all leaves and lies on the result beyond
    /// doubt.
    ///
    /// # Errors
    /// [`NearestPointError`] where it does not, and where a leaf has no answer.
    pub fn closest_point(
        &self,
        world_from_object: &Transform,
        p: DVec3,
    ) -> Result<NearestPoint, NearestPointError> {
        let leaf_point = |leaf: &Leaf, p: DVec3| match leaf {
            Leaf::Shape(shape) => {
                shape.shape().closest_point(&(*world_from_object * shape.world_from_object()), p)
            }
            Leaf::Solid { .. } => Err(NearestPointError::Csg),
        };
        let mut best: Option<(usize, NearestPoint)> = None;
        for (i, leaf) in self.leaves.iter().enumerate() {
            let found = leaf_point(leaf, p)?;
            if best.is_none_or(|(_, best)| found.distance < best.distance) {
                best = Some((i, found));
            }
        }
        let (nearest, found) = best.ok_or(NearestPointError::Csg)?;
        // Every point of the result lies on a leaf, so none is nearer. It remains to check that this point is
        // on the result.
        let mut membership = Membership::new(self);
        let object_point = world_from_object.inverse_point(found.point);
        for (i, leaf) in self.leaves.iter().enumerate().filter(|(i, _)| *i != nearest) {
            let size = found.point.abs().max_element().max(p.abs().max_element());
            let is_clear = leaf_point(leaf, found.point)?.distance > CLEAR * (size + found.distance);
            if !is_clear {
                return Err(NearestPointError::Csg);
            }
            if leaf.contains(object_point) {
                membership.cross(i as u32, true);
            }
        }
        let contains_outside = membership.contains(0);
        membership.cross(nearest as u32, true);
        if membership.contains(0) == contains_outside {
            return Err(NearestPointError::Csg);
        }
        let part = (self.first_part[nearest] + found.part) << 1 | u32::from(self.leaf_nodes[nearest].1);
        Ok(NearestPoint { part, ..found })
    }

    /// "csg".
    pub fn name(&self) -> &'static str {
        "csg"
    }
    unsampled!();
}

fn flip_if(flipped: bool, surface: Surface) -> Surface {
    if !flipped {
        return surface;
    }
    Surface { normal: -surface.normal, dndu: -surface.dndu, dndv: -surface.dndv, ..surface }
}
