//! The part of a tree that a query includes.

use std::fmt;

use crate::hit::Hit;
use crate::tree::Tree;

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

/// Which sides of surfaces count: for a triangle by its winding, for other primitives by their normals.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Faces {
    /// Both sides.
    #[default]
    Both,
    /// Only the side of the normal: back faces are culled.
    Front,
    /// Only the other side.
    Back,
}

impl Default for Query<'_> {
    fn default() -> Self {
        Self::new()
    }
}

impl<'q> Query<'q> {
    /// Includes everything.
    pub fn new() -> Self {
        Self { mask: u32::MAX, exclude: None, faces: Faces::Both, filter: None }
    }

    /// Only geometry whose mask shares a bit with `mask`; in an instance, the instance's mask must too: see
    /// [`Accel::with_masks`](crate::Accel::with_masks). `u32::MAX` includes all geometry, even with a mask of zero.
    #[must_use]
    pub fn mask(self, mask: u32) -> Self {
        Self { mask, ..self }
    }

    /// Excludes one primitive, such as the one on which the ray starts, by a hit in the same tree. All crossings of a
    /// curved shape, such as the far side of a sphere, are excluded with it.
    #[must_use]
    pub fn exclude(self, hit: &'q Hit) -> Self {
        Self { exclude: Some(hit), ..self }
    }

    /// Only these sides of surfaces.
    #[must_use]
    pub fn faces(self, faces: Faces) -> Self {
        Self { faces, ..self }
    }

    /// Only hits for which `filter` returns true, such as the opaque ones of a leaf's texture. It is called in any
    /// order of `t`, may be called more than once for a hit, and must depend on the hit only.
    #[must_use]
    pub fn filter(self, filter: &'q dyn Fn(&Hit) -> bool) -> Self {
        Self { filter: Some(filter), ..self }
    }

    /// Whether it certainly includes everything of a tree and of its instances.
    #[inline(always)]
    pub(crate) fn takes_all(&self, tree: &Tree) -> bool {
        let has_masks = !tree.masks.is_empty() || tree.summary.masks_within;
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
