//! What a query takes into account.

use std::fmt;

use crate::trace::{ContextRef, Winner};
use crate::{Accel, Hit};

/// What a query takes into account; by default everything. Queries without one pay nothing for it.
///
/// ```
/// use lumbre_kernel::{Faces, Query};
///
/// let is_opaque = |hit: &lumbre_kernel::Hit| hit.primitive % 2 == 0;
/// let query = Query::new().mask(0b10).faces(Faces::Front).filter(&is_opaque);
/// # let _ = query;
/// ```
#[derive(Clone, Copy)]
pub struct Query<'q> {
    pub(crate) mask: u32,
    pub(crate) exclude: Option<&'q Hit>,
    pub(crate) faces: Faces,
    pub(crate) filter: Option<&'q dyn Fn(&Hit) -> bool>,
}

/// Which sides of surfaces count: of a triangle by its winding, of anything else by its normal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Faces {
    /// Both sides.
    #[default]
    Both,
    /// Where the ray comes from the side of the normal: back faces are culled.
    Front,
    /// Where it does not.
    Back,
}

impl Default for Query<'_> {
    fn default() -> Self {
        Self::new()
    }
}

impl<'q> Query<'q> {
    /// Takes everything into account.
    pub fn new() -> Self {
        Self { mask: u32::MAX, exclude: None, faces: Faces::Both, filter: None }
    }

    /// Only geometry whose mask shares a bit with `mask`, and in instances only where theirs does, too: see
    /// [`Accel::with_masks`]. `u32::MAX` takes all geometry, even that with a mask of zero.
    #[must_use]
    pub fn mask(self, mask: u32) -> Self {
        Self { mask, ..self }
    }

    /// Leaves out one primitive, as the one on which the ray starts: that of a hit in the same tree. All crossings of a curved
    /// shape, such as the far side of a sphere, are left out with it.
    #[must_use]
    pub fn exclude(self, hit: &'q Hit) -> Self {
        Self { exclude: Some(hit), ..self }
    }

    /// Only these sides of surfaces.
    #[must_use]
    pub fn faces(self, faces: Faces) -> Self {
        Self { faces, ..self }
    }

    /// Only hits for which `filter` returns true, such as the opaque ones of a leaf's texture. It is called in any order of `t`, may be
    /// called more than once for a hit, and must answer by the hit alone.
    #[must_use]
    pub fn filter(self, filter: &'q dyn Fn(&Hit) -> bool) -> Self {
        Self { filter: Some(filter), ..self }
    }

    /// Whether it certainly takes everything of a tree and of its instances.
    #[inline(always)]
    pub(crate) fn takes_all(&self, accel: &Accel) -> bool {
        let has_masks = !accel.masks.is_empty() || accel.summary.masks_within;
        (!has_masks || self.mask == u32::MAX)
            && self.exclude.is_none()
            && self.faces == Faces::Both
            && self.filter.is_none()
    }
}

impl fmt::Debug for Query<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Query")
            .field("mask", &self.mask)
            .field("exclude", &self.exclude)
            .field("faces", &self.faces)
            .field("has_filter", &self.filter.is_some())
            .finish()
    }
}

/// What of one tree a query takes into account.
#[derive(Clone, Copy)]
pub(crate) struct TreeQuery<'a> {
    query: &'a Query<'a>,
    accel: &'a Accel,
    context: ContextRef<'a>,
    /// Geometry and primitive.
    excluded: Option<(u32, u32)>,
}

impl<'a> TreeQuery<'a> {
    /// In a tree that stands there.
    #[inline(always)]
    pub(crate) fn new(query: &'a Query<'a>, accel: &'a Accel, context: ContextRef<'a>) -> Self {
        let excluded = match query.exclude {
            Some(hit) if context.has_route(&hit.route) => Some((hit.geometry, hit.primitive)),
            _ => None,
        };
        Self { query, accel, context, excluded }
    }

    /// The query.
    #[inline(always)]
    pub(crate) fn query(&self) -> &'a Query<'a> {
        self.query
    }

    /// Whether the mask leaves a geometry.
    #[inline(always)]
    pub(crate) fn has_mask(&self, geometry: u32) -> bool {
        let mask = self.query.mask;
        mask == u32::MAX || self.accel.masks.get(geometry as usize).is_none_or(|own| own & mask != 0)
    }

    /// Whether a primitive may count, before it is tested.
    #[inline(always)]
    pub(crate) fn has_primitive(&self, geometry: u32, primitive: u32) -> bool {
        self.excluded != Some((geometry, primitive)) && self.has_mask(geometry)
    }

    /// Whether both sides of a surface count.
    #[inline(always)]
    pub(crate) fn takes_both_faces(&self) -> bool {
        self.query.faces == Faces::Both
    }

    /// Whether a side of a surface counts.
    #[inline(always)]
    pub(crate) fn takes_face(&self, is_front: bool) -> bool {
        match self.query.faces {
            Faces::Both => true,
            Faces::Front => is_front,
            Faces::Back => !is_front,
        }
    }

    /// Whether the filter takes a hit.
    pub(crate) fn accepts(&self, winner: &Winner) -> bool {
        self.query.filter.is_none_or(|filter| filter(&winner.to_hit_in(self.accel, self.context)))
    }
}
