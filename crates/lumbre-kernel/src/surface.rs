//! Computes the surface at the chosen hit.

use std::borrow::Cow;

use lumbre_geometry::{PlacedShape, Ray, Surface};
use lumbre_math::quadratic::dop;
use lumbre_math::rounding::{UNIT_ROUNDOFF, gamma};
use lumbre_math::{DMat3, DVec2, DVec3, Transform, Vec3};
use smallvec::SmallVec;

use crate::hit::{Hit, Target, TargetShape};
use crate::tree::sphere_block::ExactSphere;
use crate::tree::{GeometryKind, Instance, Tree};

/// The instances along a hit's route, outermost first, and the innermost tree.
fn along<'a>(tree: &'a Tree, hit: &Hit) -> (SmallVec<[&'a Instance; 4]>, &'a Tree) {
    let mut inner = tree;
    let mut instances = SmallVec::with_capacity(hit.route.len());
    for &position in &hit.route {
        let GeometryKind::Instance(instance) = &inner.geometries[position as usize].kind else {
            panic!("a hit of another tree");
        };
        instances.push(instance);
        inner = &instance.tree;
    }
    (instances, inner)
}

/// The map from the innermost instance of a hit.
pub(crate) fn world_from_object(tree: &Tree, ray: &Ray, hit: &Hit) -> Transform {
    let (instances, _) = along(tree, hit);
    let outwards = |outer, instance: &&Instance| outer * instance.world_from_object.at(ray.time);
    instances.iter().fold(Transform::IDENTITY, outwards)
}

/// The surface at a hit, in the space of `accel`.
#[inline]
pub(crate) fn surface(tree: &Tree, ray: &Ray, hit: &Hit) -> Surface {
    placed_surface::<false>(tree, ray, hit)
}

/// The surface at a hit for picture rays that leave it.
#[inline]
pub(crate) fn picture_surface(tree: &Tree, ray: &Ray, hit: &Hit) -> Surface {
    // Without a picture start, all rays are in double precision, in instances too.
    if tree.picture_start().is_some() {
        placed_surface::<true>(tree, ray, hit)
    } else {
        placed_surface::<false>(tree, ray, hit)
    }
}

/// The surface at a hit; `ROUNDED`: with the error of picture rays at its triangle, which maps transform too.
#[inline]
fn placed_surface<const ROUNDED: bool>(tree: &Tree, ray: &Ray, hit: &Hit) -> Surface {
    if hit.route.is_empty() {
        return rounded::<ROUNDED>(tree, hit, bare_surface(tree, ray, hit));
    }
    let (instances, inner) = along(tree, hit);
    // The same steps as in the search, for the same bits.
    let ray = instances.iter().fold(*ray, |ray, instance| instance.world_from_object.object_ray(&ray));
    let surface = rounded::<ROUNDED>(inner, hit, bare_surface(inner, &ray, hit));
    let placed = |surface, instance: &&Instance| place(&surface, &instance.world_from_object.at(ray.time));
    instances.iter().rev().fold(surface, placed)
}

/// What was hit, and where it is.
pub(crate) fn target<'a>(tree: &'a Tree, ray: &Ray, hit: &Hit) -> Target<'a> {
    let (instances, inner) = along(tree, hit);
    let shape = match &inner.geometries[hit.geometry as usize].kind {
        GeometryKind::Shape(shape) => TargetShape::Exact(Cow::Borrowed(shape)),
        GeometryKind::Mesh(mesh) => {
            let corner = |vertex: u32| mesh.origin + mesh.positions[vertex as usize].as_dvec3();
            TargetShape::Triangle(mesh.indices[hit.primitive as usize].map(corner))
        }
        GeometryKind::PreciseMesh(mesh) => TargetShape::Triangle(mesh.corners(hit.primitive)),
        GeometryKind::Spheres(cloud) => {
            let sphere = ExactSphere::of(cloud, hit.primitive).to_shape();
            TargetShape::Exact(Cow::Owned(PlacedShape::new(sphere.into(), Transform::IDENTITY)))
        }
        GeometryKind::Custom(_) => TargetShape::Custom,
        GeometryKind::Instance(_) => panic!("a hit of another tree"),
    };
    let placements = instances.iter().map(|instance| instance.world_from_object.at(ray.time)).collect();
    Target { placements, shape }
}

/// The surface at a hit, in the space of its innermost instance.
pub(crate) fn surface_in_object(tree: &Tree, ray: &Ray, hit: &Hit) -> Surface {
    let (instances, inner) = along(tree, hit);
    let ray = instances.iter().fold(*ray, |ray, instance| instance.world_from_object.object_ray(&ray));
    bare_surface(inner, &ray, hit)
}

/// A surface of a tree, with the error of picture rays there.
#[inline]
fn rounded<const ROUNDED: bool>(tree: &Tree, hit: &Hit, mut surface: Surface) -> Surface {
    if ROUNDED
        && let Some(picture) = &tree.picture
        && matches!(tree.geometries[hit.geometry as usize].kind, GeometryKind::Mesh(_))
    {
        surface.point_error += picture.rounding.error(surface.point);
    }
    surface
}

/// The surface at a hit in the tree that contains its geometry.
#[inline]
fn bare_surface(tree: &Tree, ray: &Ray, hit: &Hit) -> Surface {
    match &tree.geometries[hit.geometry as usize].kind {
        GeometryKind::Shape(shape) => shape.surface(ray, &hit.root),
        GeometryKind::Mesh(mesh) => {
            let corners = mesh.indices[hit.primitive as usize].map(|vertex| mesh.positions[vertex as usize]);
            triangle_surface(mesh.origin, corners, hit.root.local)
        }
        GeometryKind::PreciseMesh(mesh) => precise_surface(&mesh.corners(hit.primitive), hit.root.local),
        GeometryKind::Custom(custom) => custom.surface(hit.primitive, ray, &hit.root),
        GeometryKind::Spheres(cloud) => ExactSphere::of(cloud, hit.primitive).surface(ray, &hit.root),
        GeometryKind::Instance(_) => panic!("a hit of another tree"),
    }
}

/// A point of a triangle from its barycentrics (b1, b2).
///
/// Its error is that of the combination, γ₇ Σ|bᵢ pᵢ| (M. Pharr, W. Jakob, G. Humphreys, "Physically Based Rendering",
/// 3rd edition, 2016, section 3.9), and one rounding for the mesh's origin.
pub(crate) fn triangle_surface(origin: DVec3, corners: [Vec3; 3], uv: DVec2) -> Surface {
    let [p0, p1, p2] = corners.map(|corner| corner.as_dvec3());
    let b0 = 1.0 - uv.x - uv.y;
    let (dpdu, dpdv) = (p1 - p0, p2 - p0);
    let terms = [b0 * p0, uv.x * p1, uv.y * p2];
    let point = origin + (terms[0] + terms[1] + terms[2]);
    let sizes = terms[0].abs() + terms[1].abs() + terms[2].abs();
    Surface {
        point,
        point_error: gamma(7) * sizes + UNIT_ROUNDOFF * point.abs(),
        normal: unit(dpdu.cross(dpdv)),
        uv,
        dpdu,
        dpdv,
        dndu: DVec3::ZERO,
        dndv: DVec3::ZERO,
    }
}

/// As [`triangle_surface`], in double precision: from the first corner, so that the error is that of the differences
/// plus one rounding of the position.
fn precise_surface(&[p0, p1, p2]: &[DVec3; 3], uv: DVec2) -> Surface {
    let (dpdu, dpdv) = (p1 - p0, p2 - p0);
    let terms = [uv.x * dpdu, uv.y * dpdv];
    let point = p0 + (terms[0] + terms[1]);
    // If the sides are nearly parallel, their cross product is computed with compensated differences.
    let normal = |x: usize, y: usize| dop(dpdu[x], dpdv[y], dpdu[y], dpdv[x]);
    Surface {
        point,
        point_error: gamma(7) * (terms[0].abs() + terms[1].abs()) + gamma(2) * point.abs(),
        normal: unit(DVec3::new(normal(1, 2), normal(2, 0), normal(0, 1))),
        uv,
        dpdu,
        dpdv,
        dndu: DVec3::ZERO,
        dndv: DVec3::ZERO,
    }
}

/// The surface under a map. Its error grows by |L| and by the rounding of the product, γ₃ (|L| |p| + |τ|).
fn place(surface: &Surface, world_from_object: &Transform) -> Surface {
    let affine = world_from_object.affine();
    let linear = affine.matrix3;
    let sizes = DMat3::from_cols(linear.x_axis.abs(), linear.y_axis.abs(), linear.z_axis.abs());
    let point_error = (1.0 + gamma(3)) * (sizes * surface.point_error)
        + gamma(4) * (sizes * surface.point.abs() + affine.translation.abs());
    // The normal is N/|N| with N = L⁻ᵀ n; its derivative is the component of N's derivative across it.
    let scaled = world_from_object.normal(surface.normal);
    let length = scaled.length();
    let normal = unit(scaled);
    let change = |dn: DVec3| {
        let dn = world_from_object.normal(dn) / length;
        dn - normal * normal.dot(dn)
    };
    Surface {
        point: world_from_object.point(surface.point),
        point_error,
        normal,
        uv: surface.uv,
        dpdu: world_from_object.vector(surface.dpdu),
        dpdv: world_from_object.vector(surface.dpdv),
        dndu: change(surface.dndu),
        dndv: change(surface.dndv),
    }
}

/// The direction of `v`, even if its square would leave the range of f64.
fn unit(v: DVec3) -> DVec3 {
    let v = v / v.abs().max_element();
    v / v.length()
}
