//! Ray tests against the parts of a tree: boxes, blocks of triangles, spheres and bounding volumes, for each
//! instruction set. This module and [`simd`](crate::simd) contain all `unsafe` code except the call that maps a file.
//! The traversals above are written once, over [`Simd`].
//!
//! [`Isa::run`] chooses the instruction set once per search, and [`Isa::dispatched`] once for all searches. The code in
//! between is generic and `#[inline(always)]` without a target feature of its own, so that it inherits the features of
//! the function that it is inlined into.

#![allow(unsafe_code)]

pub(crate) mod axes;
mod bounding_volumes;
pub(crate) mod box_ray;
mod boxes;
mod dispatch;
pub(crate) mod f32_ray;
mod isa;
mod operations;
mod portable;
#[cfg(test)]
mod shims;
mod slots;
mod spheres;
mod triangles;
pub(crate) mod watertight;
#[cfg(target_arch = "x86_64")]
mod x86;

pub(crate) use axes::{Axes, Sides};
#[cfg(test)]
pub(crate) use bounding_volumes::intersect_bounding_volumes_at;
pub(crate) use bounding_volumes::{BoundingHits, intersect_bounding_volumes};
pub(crate) use boxes::{
    intersect_boxes, intersect_each, intersect_frustum, only_child, push_as_built, push_by_distance,
    put_and_take_as_built, put_and_take_by_distance,
};
pub(crate) use dispatch::{Dispatch, DispatchedQuery, RayQuery};
pub(crate) use isa::Isa;
pub(crate) use operations::{CornerScratch, Simd};
pub(crate) use portable::Portable;
#[cfg(test)]
pub(crate) use shims::*;
pub(crate) use slots::{PushSlots, STACK, Slots};
pub(crate) use spheres::intersect_spheres;
#[cfg(test)]
pub(crate) use spheres::intersect_spheres_at;
pub(crate) use triangles::{Crossings, Edges};
