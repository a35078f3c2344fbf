//! How a ray traverses a tree.
//!
//! [`filtered`] is the traversal that every query takes first: single precision decides what it is certain of, and
//! double precision the rest (see [`decide`]), so that an answer has the same bits as with double precision alone. If
//! neither can decide, because the ray meets an edge exactly or starts far away, [`exact`] answers: the traversal in
//! double precision, which finds all hits, and is the oracle of the other traversals. Rays in single precision have a
//! traversal of their own, [`f32_ray`], in trees of triangles; [`picture`] extends it to trees of any primitives.

mod cloud_ray;
pub(crate) mod cursor;
pub(crate) mod decide;
pub(crate) mod edges;
pub(crate) mod exact;
pub(crate) mod f32_ray;
pub(crate) mod filtered;
pub(crate) mod filtered_ray;
mod instances;
mod leaves;
pub(crate) mod picture;
pub(crate) mod stack;
pub(crate) mod tree_query;
pub(crate) mod visitor;
pub(crate) mod visitors;

use bytemuck::Zeroable;
use lumbre_geometry::{Ray, Root, Roots};

use crate::hit::{Hit, InstancePath};
use crate::tree::sphere_block::ExactSphere;
use crate::tree::{GeometryKind, Tree};

/// The result of single precision, and of the double precision that it asks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Outcome<T> {
    /// The answer.
    Certain(T),
    /// Only the exact traversal can answer.
    Uncertain,
}

/// How a traversal ends early.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stop {
    /// Any hit suffices, and there is one.
    Hit,
    /// Only the exact traversal can answer.
    Uncertain,
}

/// The triangles of a block that a ray may hit.
#[derive(Clone, Copy, Zeroable)]
pub(crate) struct LaneHits<T> {
    /// A bit for each certain hit.
    pub(crate) met: u32,
    /// A bit for each triangle that needs an exact decision.
    pub(crate) uncertain: u32,
    /// The crossing with each; arbitrary for triangles in neither mask.
    pub(crate) at: T,
}

/// The order of two crossings at the same `t`: entering before leaving, then by geometry and primitive.
#[inline(always)]
pub(crate) fn precedes(
    (enters, ids): (bool, (u32, u32)),
    (other_enters, other_ids): (bool, (u32, u32)),
) -> bool {
    (!enters, ids) < (!other_enters, other_ids)
}

/// A crossing in a tree, without the instances of a [`Hit`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Winner {
    pub(crate) root: Root,
    pub(crate) geometry: u32,
    pub(crate) primitive: u32,
}

impl Winner {
    /// Converts to a hit outside of instances.
    #[inline(always)]
    pub(crate) fn to_hit(self, tree: &Tree) -> Hit {
        let Self { root, geometry, primitive } = self;
        Hit {
            root,
            id: tree.geometries[geometry as usize].id,
            primitive,
            geometry,
            instances: InstancePath::new(),
            route: InstancePath::new(),
        }
    }

    /// Converts to a hit in a tree in this context.
    pub(crate) fn to_hit_in(self, tree: &Tree, context: ContextRef) -> Hit {
        let Context { route, ids } = context.to_context();
        Hit { instances: ids, route, ..self.to_hit(tree) }
    }

    /// Writes the hit into a slot, field by field: storing a temporary as a whole stalls.
    #[inline(always)]
    pub(crate) fn put(self, tree: &Tree, slot: &mut Option<Hit>) {
        let Some(hit) = slot else {
            *slot = Some(self.to_hit(tree));
            return;
        };
        let Self { root, geometry, primitive } = self;
        hit.root = root;
        hit.id = tree.geometries[geometry as usize].id;
        hit.primitive = primitive;
        hit.geometry = geometry;
        // Cheaper than clearing, which first looks where the path is stored.
        hit.instances = InstancePath::new();
        hit.route = InstancePath::new();
    }
}

/// Larger than every geometry index: of two hits at the same `t`, one outside of instances comes first.
pub(crate) const IN_INSTANCE: u32 = u32::MAX;

/// The height along a ray per unit of `t`.
#[inline(always)]
pub(crate) fn largest_component(ray: &Ray) -> f64 {
    ray.direction.abs().max_element()
}

/// The instances around a tree, outermost first.
#[derive(Debug, Default)]
pub(crate) struct Context {
    /// Their positions in the lists of their trees.
    pub(crate) route: InstancePath,
    /// Their ids.
    pub(crate) ids: InstancePath,
}

impl Clone for Context {
    // Faster than the derived one, which copies element by element.
    #[inline]
    fn clone(&self) -> Self {
        Self { route: InstancePath::from_slice(&self.route), ids: InstancePath::from_slice(&self.ids) }
    }
}

/// A context plus an innermost instance that is only appended once something is hit in it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ContextRef<'c> {
    around: Option<&'c Context>,
    /// Position and id of the innermost instance, if it is not part of `around`.
    innermost: Option<(u32, u32)>,
}

impl<'c> ContextRef<'c> {
    /// Outside of all instances.
    pub(crate) const OUTSIDE: Self = Self { around: None, innermost: None };

    #[inline(always)]
    pub(crate) fn of(around: &'c Context) -> Self {
        Self { around: Some(around), innermost: None }
    }

    /// In one more instance; only the first such instance may be pending.
    #[inline(always)]
    pub(crate) fn within(self, geometry: u32, id: u32) -> Self {
        debug_assert!(self.innermost.is_none(), "the last one is written down");
        Self { around: self.around, innermost: Some((geometry, id)) }
    }

    #[inline(always)]
    pub(crate) fn to_context(self) -> Context {
        let mut context = self.around.cloned().unwrap_or_default();
        if let Some((geometry, id)) = self.innermost {
            context.route.push(geometry);
            context.ids.push(id);
        }
        context
    }

    #[inline(always)]
    pub(crate) fn has_route(&self, route: &[u32]) -> bool {
        let around = self.around.map_or(&[][..], |around| &around.route);
        match self.innermost {
            Some((geometry, _)) => route.split_last() == Some((&geometry, around)),
            None => *route == *around,
        }
    }
}

/// Whether a ray can hit anything: finite, with a direction and a range.
pub(crate) fn is_sound(ray: &Ray) -> bool {
    ray.origin.is_finite()
        && ray.direction.is_finite()
        && ray.direction.abs().max_element() > 0.0
        && ray.t_min <= ray.t_max
}

/// Whether a shape, a sphere of a cloud or a primitive of user geometry is hit in the ray's range.
#[inline(always)]
pub(crate) fn is_crossed(kind: &GeometryKind, primitive: u32, ray: &Ray) -> bool {
    match kind {
        GeometryKind::Shape(shape) => shape.any(ray),
        GeometryKind::Custom(custom) => custom.any(primitive, ray),
        GeometryKind::Spheres(cloud) => ExactSphere::of(cloud, primitive).closest(ray).is_some(),
        GeometryKind::Mesh(_) | GeometryKind::PreciseMesh(_) | GeometryKind::Instance(_) => false,
    }
}

/// The first of its crossings. For user geometry it may lie outside the range.
#[inline(always)]
pub(crate) fn first_crossing(kind: &GeometryKind, primitive: u32, ray: &Ray) -> Option<Root> {
    match kind {
        GeometryKind::Shape(shape) => shape.closest(ray),
        GeometryKind::Custom(custom) => custom.closest(primitive, ray),
        GeometryKind::Spheres(cloud) => ExactSphere::of(cloud, primitive).closest(ray),
        GeometryKind::Mesh(_) | GeometryKind::PreciseMesh(_) | GeometryKind::Instance(_) => None,
    }
}

/// All of its crossings. For user geometry they may lie outside the range.
pub(crate) fn all_crossings(kind: &GeometryKind, primitive: u32, ray: &Ray) -> Roots {
    let mut roots = Roots::new();
    match kind {
        GeometryKind::Shape(shape) => shape.roots(ray, &mut roots),
        GeometryKind::Custom(custom) => custom.roots(primitive, ray, &mut roots),
        GeometryKind::Spheres(cloud) => ExactSphere::of(cloud, primitive).roots(ray, &mut roots),
        GeometryKind::Mesh(_) | GeometryKind::PreciseMesh(_) | GeometryKind::Instance(_) => {}
    }
    roots
}

/// Whether a ray meets the front at a crossing of a primitive other than a triangle.
pub(crate) fn meets_front(kind: &GeometryKind, primitive: u32, ray: &Ray, root: &Root) -> bool {
    let surface = match kind {
        GeometryKind::Shape(shape) => shape.surface(ray, root),
        GeometryKind::Custom(custom) => custom.surface(primitive, ray, root),
        GeometryKind::Spheres(cloud) => ExactSphere::of(cloud, primitive).surface(ray, root),
        GeometryKind::Mesh(_) | GeometryKind::PreciseMesh(_) | GeometryKind::Instance(_) => {
            unreachable!("triangles know their front, and instances have none")
        }
    };
    surface.normal.dot(ray.direction) < 0.0
}
