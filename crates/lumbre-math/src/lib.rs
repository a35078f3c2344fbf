#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![doc = include_str!("../README.md")]
//!
//! # Conventions
//!
//! Vectors are columns and a matrix acts from the left, `p' = M p`, so that a product reads right to left: `T * R`
//! rotates first. Points carry w = 1, directions w = 0. Angles in the interfaces are in degrees, unless a name says
//! otherwise, and exact at the right angles; a positive rotation about z turns x towards y, about x y towards z, about
//! y z towards x, whatever the hand in which the axes are drawn. The parameter `t` of a ray is in units of its
//! direction as given. Row vectors and other hands enter at the boundary: see [`matrix`].
//!
//! # glam in the public interface
//!
//! Vectors, matrices and quaternions are those of glam 0.34, which is re-exported as [`glam`] so that a program need
//! not name the version: `use lumbre_math::glam`. A change to another minor version of glam (0.35) is a breaking change
//! of this crate and of all that build on it, and raises their minor versions too; a patch of glam is not.
//!
//! Nothing here does input or output or keeps a state, and nothing panics on any number.
//!
//! # Where to find what
//!
//! | topic | call |
//! |---|---|
//! | dot product, length | `a.dot(b)`, `a.length()` of glam; with all digits [`vector::dot`], [`vector::length`] |
//! | unit vector | `a.normalize()` of glam; of any length [`vector::unit`] |
//! | cross product | `a.cross(b)` of glam; with all digits [`vector::cross`]; as a matrix [`vector::cross_matrix`] |
//! | mixed product, determinant | [`vector::mixed_product`] |
//! | angle between vectors | [`vector::angle`] |
//! | projection, its signed length, the rest | [`vector::project`], [`vector::projected_length`], [`vector::reject`] |
//! | some perpendicular vector | [`vector::perpendicular`] |
//! | frame from one direction, from two | [`orthonormal_basis`], [`Frame::from_z`], [`Frame::from_two`] |
//! | change of coordinates | [`Frame::to_local`], [`Frame::to_world`], [`Transform::from_frame`] |
//! | product and transpose of matrices | `*` and `transpose` of glam; of any size [`matrix::product`], [`matrix::transpose`] |
//! | linear equations, Cramer's rule | [`matrix::solve`]; of any size, and how many solutions there are, [`exact::solve`] |
//! | determinant, cofactors, inverse without rounding on the way | [`exact::determinant`], [`exact::cofactors`], [`exact::inverse`] |
//! | rank, eigenvalues, characteristic polynomial | [`exact::rank`], [`exact::eigenvalues`], [`exact::characteristic_polynomial`] |
//! | inverse of an affine matrix | [`Transform::from_matrix`] and [`Transform::inverse`] |
//! | scale, shear, rotation, mirror of the plane | [`matrix::scale2`], [`matrix::shear2`], [`matrix::rotation2`], [`matrix::mirror2_about_y`] |
//! | scale, shear, translation of space | [`Transform::scale`], [`Transform::shear`], [`Transform::translate`] |
//! | rotation about x, y, z | [`matrix::rotation_x`], [`matrix::rotation_y`], [`matrix::rotation_z`] |
//! | rotation about any axis | [`Transform::rotate`], [`matrix::axis_angle`], [`matrix::rotate_vector`] |
//! | composition, its inverse | `a * b` of [`Transform`], [`Transform::inverse`] |
//! | scale, rotate about x, y, z, translate | [`matrix::standard_chain`] |
//! | transforms that change with time | [`AnimatedTransform`] |
//! | points and directions | [`Transform::point`], [`Transform::vector`] |
//! | homogeneous coordinates | [`matrix::homogeneous_point`], [`matrix::homogeneous_direction`], [`matrix::point_of_homogeneous`] |
//! | rows or columns | [`matrix::from_row_convention`], [`matrix::rows4`], [`matrix::row_chain_with_column_rotations`] |
//! | left or right hand | [`Transform::change_handedness`], [`matrix::mirror_z`] |
//! | normals | [`Transform::normal`], [`matrix::transform_normal`] |
//! | area under a transform | [`Transform::area_factor`] |
//! | quaternions: sum, product, conjugate | `+`, `*`, `conjugate()` of glam's [`DQuat`] |
//! | length, unit, slerp of quaternions of any length | [`quaternion::length`], [`quaternion::unit`], [`quaternion::slerp`] |
//! | inverse, quotient, rotation of a vector, matrix both ways | [`quaternion::inverse`], [`quaternion::divide`], [`quaternion::rotate`], [`quaternion::to_matrix`], [`quaternion::from_matrix`] |
//! | Euler angles both ways | [`quaternion::Euler`] |
//! | look-at of either hand | [`Transform::look_at_right`], [`Transform::look_at_left`], [`view::View`] |
//! | rays of a camera | [`view::View::perspective_direction`], [`view::View::orthographic_origin`], [`view::View::cylindrical_direction`] |
//! | projection matrices | [`projection::orthographic`], [`projection::perspective`], [`projection::simple_perspective`] |
//! | reflection, refraction | [`optics::reflect`], [`optics::refract`], [`optics::facing`] |
//! | rounding errors, leaving a surface | [`rounding::gamma`], [`Transform::point_error`], [`rounding::offset_point`] |
//! | quadratic equations, roots of polynomials | [`quadratic::roots_of`], [`quadratic`], [`roots`] |
//! | interval arithmetic, with derivatives | [`interval::Interval`], [`interval::Dual`] |
//! | random numbers | [`random`], evenly spread [`sobol`] |
//! | gradient noise | [`noise::noise`] |
//! | random points of disks, spheres, triangles | [`warp`], [`warp64`] |
//! | random choice by weight | [`distribution`] |

pub use glam;
pub use glam::{DAffine3, DMat3, DMat4, DQuat, DVec2, DVec3, DVec4, Vec2, Vec3, Vec4};

pub mod animated;
pub mod distribution;
mod elementary;
pub mod exact;
pub mod frame;
pub mod interval;
pub mod matrix;
pub mod noise;
pub mod optics;
pub mod projection;
pub mod quadratic;
pub mod quaternion;
pub mod random;
pub mod roots;
pub mod rounding;
pub mod sobol;
pub mod transform;
pub mod vector;
pub mod view;
pub mod warp;
pub mod warp64;

pub use animated::{AnimatedTransform, AnimationError};
pub use elementary::{Elementary, direction_at};
pub use frame::{Frame, orthonormal_basis, orthonormal_basis_f32};
pub use transform::{SingularTransformError, Transform};
