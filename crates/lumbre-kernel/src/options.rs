//! What a query may leave out.

use lumbre_geometry::{Ray, Root};

use crate::query::Filter;
use crate::spheres::ExactSphere;
use crate::traverse::{Found, What};
use crate::{Accel, GeometryKind, Hit};

/// What a query leaves out; by default nothing. Queries that do not take this pay nothing for it.
#[derive(Clone, Copy, Debug)]
pub struct QueryOptions<'h> {
    /// Only geometry whose mask has one of these bits counts, in instances whose masks have one of them too. See
    /// [`Accel::with_masks`].
    pub mask: u32,
    /// A primitive that does not count, as the one on which the ray starts: that of a hit in the same tree. A shape that
    /// folds back, as a sphere does, does not count either.
    pub exclude: Option<&'h Hit>,
    /// The faces that count.
    pub faces: Faces,
}

impl Default for QueryOptions<'_> {
    fn default() -> Self {
        Self { mask: u32::MAX, exclude: None, faces: Faces::Both }
    }
}

/// Which sides of surfaces count: those of a triangle by its winding, those of anything else by its normal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Faces {
    /// Both sides.
    #[default]
    Both,
    /// Those that the ray meets on the side of the normal: back faces are culled.
    Front,
    /// The other ones.
    Back,
}

impl QueryOptions<'_> {
    fn has_mask(&self, accel: &Accel, geometry: u32) -> bool {
        accel.masks.get(geometry as usize).is_none_or(|mask| mask & self.mask != 0)
    }
}

impl Filter for QueryOptions<'_> {
    const TAKES_ALL: bool = false;
    const FACES: bool = true;

    fn takes(&mut self, found: &Found) -> bool {
        let (geometry, primitive) = found.what.names(found.accel);
        let is_face = match self.faces {
            Faces::Both => true,
            Faces::Front => found.is_front,
            Faces::Back => !found.is_front,
        };
        let is_excluded = self.exclude.is_some_and(|hit| {
            (hit.geometry, hit.primitive) == (geometry, primitive) && hit.route == found.place.route
        });
        is_face && !is_excluded && self.has_mask(found.accel, geometry)
    }

    fn enters(&self, accel: &Accel, geometry: u32) -> bool {
        self.has_mask(accel, geometry)
    }
}

/// Whether a ray meets the front of what is no triangle.
pub(crate) fn meets_front(accel: &Accel, ray: &Ray, what: What, root: &Root) -> bool {
    let (geometry, primitive) = what.names(accel);
    let surface = match &accel.geometries[geometry as usize].kind {
        GeometryKind::Shape(shape) => shape.surface(ray, root),
        GeometryKind::Custom(custom) => custom.surface(primitive, ray, root),
        GeometryKind::Spheres(cloud) => ExactSphere::of(cloud, primitive).surface(ray, root),
        GeometryKind::Mesh(_) | GeometryKind::PreciseMesh(_) | GeometryKind::Instance(_) => {
            unreachable!("it is tested by itself")
        }
    };
    surface.normal.dot(ray.direction) < 0.0
}
