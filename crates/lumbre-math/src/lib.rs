//! The mathematics under Lumbre: transforms, frames, quaternions, projections, warps, distributions, random numbers and
//! polynomial roots, over [`glam`] wherever glam has it.
//!
//! Conventions: vectors are columns and a matrix acts from the left, `p' = M p`; a positive rotation about z turns x
//! towards y (and so on cyclically); the parameter `t` of a ray is in units of its direction as given.

pub use glam;
pub use glam::{DAffine3, DMat3, DMat4, DQuat, DVec2, DVec3, DVec4, Vec2, Vec3};

pub mod distribution;
pub mod frame;
pub mod quadratic;
pub mod random;
pub mod roots;
pub mod sobol;
pub mod transform;
pub mod warp;
pub mod warp64;

pub use frame::{Frame, orthonormal_basis, orthonormal_basis_f32};
pub use transform::{SingularTransform, Transform};
