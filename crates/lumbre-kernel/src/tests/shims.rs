//! Queries at an instruction set, and the answer of each traversal alone.

use lumbre_geometry::Ray;

use crate::intersect::Isa;
use crate::trace::f32_ray::{self, F32Queries};
use crate::trace::filtered::{self, Queries};
use crate::trace::filtered_ray::Found;
use crate::trace::stack::{AnyHit, ClosestHit};
use crate::trace::{ContextRef, Outcome, exact};
use crate::{Accel, Hit, Hit32, Query, Ray32, batch};

impl Accel {
    pub(crate) fn closest_at(&self, isa: Isa, ray: &Ray) -> Option<Hit> {
        Queries::of(isa, &self.tree).closest.ask(&self.tree, ray)
    }

    pub(crate) fn any_at(&self, isa: Isa, ray: &Ray) -> bool {
        Queries::of(isa, &self.tree).any.ask(&self.tree, ray)
    }

    pub(crate) fn closest_exact_at(&self, isa: Isa, ray: &Ray) -> Option<Hit> {
        exact::closest(isa, &self.tree, ray, None)
    }

    pub(crate) fn closest_with_exact_at(&self, isa: Isa, ray: &Ray, query: &Query) -> Option<Hit> {
        exact::closest(isa, &self.tree, ray, Some(query))
    }

    pub(crate) fn any_with_exact_at(&self, isa: Isa, ray: &Ray, query: &Query) -> bool {
        exact::any(isa, &self.tree, ray, Some(query))
    }

    pub(crate) fn closest_batch_at(&self, isa: Isa, rays: &[Ray], hits: &mut [Option<Hit>]) {
        batch::closest(isa, &self.tree, rays, hits);
    }

    pub(crate) fn any_batch_at(&self, isa: Isa, rays: &[Ray], hits: &mut [bool]) {
        batch::any(isa, &self.tree, rays, hits);
    }

    pub(crate) fn closest_f32_at(&self, isa: Isa, ray: &Ray32) -> Option<Hit32> {
        match F32Queries::of(isa, &self.tree) {
            Some(queries) => queries.closest.ask(&self.tree, ray),
            None => f32_ray::closest_widened(isa, &self.tree, ray),
        }
    }

    pub(crate) fn any_f32_at(&self, isa: Isa, ray: &Ray32) -> bool {
        match F32Queries::of(isa, &self.tree) {
            Some(queries) => queries.any.ask(&self.tree, ray),
            None => f32_ray::any_widened(isa, &self.tree, ray),
        }
    }

    pub(crate) fn closest_batch_f32_at(&self, isa: Isa, rays: &[Ray32], hits: &mut [Option<Hit32>]) {
        assert_eq!(rays.len(), hits.len());
        batch::closest_f32(isa, &self.tree, rays, hits);
    }

    pub(crate) fn any_batch_f32_at(&self, isa: Isa, rays: &[Ray32], hits: &mut [bool]) {
        assert_eq!(rays.len(), hits.len());
        batch::any_f32(isa, &self.tree, rays, hits);
    }

    /// What the filtered traversal comes to.
    pub(crate) fn filtered_closest_at(&self, isa: Isa, ray: &Ray, query: &Query) -> Outcome<Option<Hit>> {
        match filtered::with_query::<ClosestHit>(isa, &self.tree, ray, query) {
            Outcome::Certain(found) => {
                Outcome::Certain(Found::into_hit(found, &self.tree, ContextRef::OUTSIDE))
            }
            Outcome::Uncertain => Outcome::Uncertain,
        }
    }

    /// The same of the traversal for any hit.
    pub(crate) fn filtered_any_at(&self, isa: Isa, ray: &Ray) -> Outcome<bool> {
        match filtered::without_query::<AnyHit>(isa, &self.tree, ray) {
            Outcome::Certain(is_hit) => Outcome::Certain(is_hit),
            Outcome::Uncertain => Outcome::Uncertain,
        }
    }

    /// The same of the traversal for the closest hit that takes everything.
    pub(crate) fn filtered_at(&self, isa: Isa, ray: &Ray) -> Outcome<Option<Hit>> {
        match filtered::without_query::<ClosestHit>(isa, &self.tree, ray) {
            Outcome::Certain(found) => {
                Outcome::Certain(Found::into_hit(found, &self.tree, ContextRef::OUTSIDE))
            }
            Outcome::Uncertain => Outcome::Uncertain,
        }
    }

    /// Whether the tree is of nothing but triangles to the filtered traversal; `None` where only the exact one
    /// traverses it.
    pub(crate) fn only_triangles(&self) -> Option<bool> {
        self.tree.single.as_ref().map(|start| start.only_triangles)
    }
}
