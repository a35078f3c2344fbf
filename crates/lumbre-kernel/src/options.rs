//! What a query may leave out.

use lumbre_geometry::{Ray, Root};

use crate::blocks::BlockNames;
use crate::query::{All, Filter};
use crate::single::Winner;
use crate::spheres::ExactSphere;
use crate::traverse::{Found, Standing, What};
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

impl Faces {
    /// Whether a side is among them.
    #[inline(always)]
    pub(crate) fn have(self, is_front: bool) -> bool {
        match self {
            Self::Both => true,
            Self::Front => is_front,
            Self::Back => !is_front,
        }
    }
}

impl QueryOptions<'_> {
    /// Whether they leave everything of a tree and of those placed in it, as far as that is seen at a glance.
    #[inline(always)]
    pub(crate) fn take_all(&self, accel: &Accel) -> bool {
        let has_masks = !accel.masks.is_empty() || accel.holds.masks_within;
        !has_masks && self.exclude.is_none() && self.faces == Faces::Both
    }

    fn has_mask(&self, accel: &Accel, geometry: u32) -> bool {
        has_mask(&accel.masks, self.mask, geometry)
    }
}

#[inline(always)]
fn has_mask(masks: &[u32], mask: u32, geometry: u32) -> bool {
    match masks.get(geometry as usize) {
        Some(own) => own & mask != 0,
        None => true,
    }
}

impl Filter for QueryOptions<'_> {
    const TAKES_ALL: bool = false;
    const FACES: bool = true;

    fn takes(&self, found: &Found) -> bool {
        let (geometry, primitive) = found.what.names(found.accel);
        let is_excluded = self.exclude.is_some_and(|hit| {
            (hit.geometry, hit.primitive) == (geometry, primitive) && hit.route == found.place.route
        });
        self.faces.have(found.is_front) && !is_excluded && self.has_mask(found.accel, geometry)
    }

    fn enters(&self, accel: &Accel, geometry: u32) -> bool {
        self.has_mask(accel, geometry)
    }

    type Selection<'s>
        = Selected<'s>
    where
        Self: 's;
    #[inline(always)]
    fn select<'s>(&'s self, accel: &'s Accel, standing: Standing<'s>) -> Selected<'s> {
        let excluded = match self.exclude {
            Some(hit) if standing.has_route(&hit.route) => Some((hit.geometry, hit.primitive)),
            _ => None,
        };
        Selected { masks: &accel.masks, mask: self.mask, excluded, faces: self.faces }
    }
}

/// What a search in one tree takes of what stands in that itself, by default everything: told by names and faces, before anything
/// is known of where it is met; or by the hit itself.
pub(crate) trait Selection: Copy {
    /// Whether it takes everything, so that nothing has to be asked.
    const TAKES_ALL: bool;
    /// Whether it has to be asked about every hit that would be an answer: see [`Selection::accepts`].
    const ASKS: bool = false;
    /// The faces that it takes.
    #[inline(always)]
    fn faces(&self) -> Faces {
        Faces::Both
    }
    /// Whether it takes a primitive, its faces aside.
    #[inline(always)]
    fn takes(&self, _geometry: u32, _primitive: u32) -> bool {
        true
    }
    /// Of the lanes of a block, those whose triangles it takes, their faces aside.
    #[inline(always)]
    fn lanes(&self, _names: &BlockNames) -> u32 {
        u32::MAX
    }
    /// Whether it takes a hit, which is the crossing of this order of its primitive.
    #[inline(always)]
    fn accepts(&self, _winner: &Winner, _order: u32) -> bool {
        true
    }
}

impl Selection for All {
    const TAKES_ALL: bool = true;
}

/// What [`QueryOptions`] leave of one tree.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Selected<'a> {
    masks: &'a [u32],
    mask: u32,
    /// Geometry and primitive.
    excluded: Option<(u32, u32)>,
    faces: Faces,
}

// Without closures, which would not have the instruction set of the search around them.
impl Selection for Selected<'_> {
    const TAKES_ALL: bool = false;

    #[inline(always)]
    fn faces(&self) -> Faces {
        self.faces
    }

    #[inline(always)]
    fn takes(&self, geometry: u32, primitive: u32) -> bool {
        self.excluded != Some((geometry, primitive)) && has_mask(self.masks, self.mask, geometry)
    }

    #[inline(always)]
    fn lanes(&self, names: &BlockNames) -> u32 {
        if !has_mask(self.masks, self.mask, names.geometry) {
            return 0;
        }
        match self.excluded {
            Some((geometry, primitive)) if geometry == names.geometry => !names.lanes_of(primitive),
            _ => u32::MAX,
        }
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
