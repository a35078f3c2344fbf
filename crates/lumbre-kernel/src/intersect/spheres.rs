//! A ray against eight spheres: see [`SphereRay`].

use super::operations::Simd;
use crate::simd::{F32x8, Vector};
use crate::tree::sphere_block::{SphereBlock, SphereRay};

/// A bit for each sphere of a block that the ray may hit in its range, which includes all that it hits; and a bit for
/// each that it certainly hits. Unused lanes are NaN, and no comparison with a NaN holds.
#[inline(always)]
pub(crate) fn intersect_spheres<L: Simd>(block: &SphereBlock, ray: &SphereRay) -> (u32, u32) {
    let (load, splat) = (L::F32x8::load, L::F32x8::splat);
    let zero = splat(0.0);
    let [ex, ey, ez] = [splat(ray.direction[0]), splat(ray.direction[1]), splat(ray.direction[2])];
    let x = load(&block.centers[0]) - splat(ray.origin[0]);
    let y = load(&block.centers[1]) - splat(ray.origin[1]);
    let z = load(&block.centers[2]) - splat(ray.origin[2]);
    let (radii, margin) = (load(&block.radii), splat(ray.margin));
    // Where the line is nearest to the centre, and the square of that distance.
    let along = x.mul_add(ex, y.mul_add(ey, z * ez));
    let px = along.neg_mul_add(ex, x);
    let py = along.neg_mul_add(ey, y);
    let pz = along.neg_mul_add(ez, z);
    let beside = px.mul_add(px, py.mul_add(py, pz * pz));
    let size = radii + margin;
    let rest = size.mul_sub(size, beside);
    let mask = zero.simd_le(rest);
    if mask == 0 {
        return (0, 0);
    }
    let half = rest.sqrt();
    let (from, last) = (along - half, along + half);
    let in_range = mask & from.simd_le(splat(ray.far)) & splat(ray.near).simd_le(last);
    let inner = radii - margin;
    let is_crossed = zero.simd_lt(inner) & zero.simd_le(inner.mul_sub(inner, beside));
    let [start, end] = ray.surely_in;
    let certain = in_range & is_crossed & splat(start).simd_le(from) & along.simd_le(splat(end));
    (in_range, certain)
}

/// [`intersect_spheres`] at an instruction set, for tests.
#[cfg(test)]
pub(crate) fn intersect_spheres_at(isa: super::Isa, block: &SphereBlock, ray: &SphereRay) -> (u32, u32) {
    struct Spheres<'a>(&'a SphereBlock, &'a SphereRay);
    impl super::Dispatch for Spheres<'_> {
        type Output = (u32, u32);
        #[inline(always)]
        fn run<L: Simd>(self) -> (u32, u32) {
            intersect_spheres::<L>(self.0, self.1)
        }
    }
    isa.run(Spheres(block, ray))
}
