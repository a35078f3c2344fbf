//! The first test of eight spheres, on every instruction set.

#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::*;

use super::portable::Portable;
#[cfg(target_arch = "x86_64")]
use super::x86::X86;
use crate::spheres::{SphereBlock, SphereRay};
use crate::triangles::BLOCK;

/// What a search does with eight spheres.
pub(crate) trait SphereLanes {
    /// A bit for each sphere that the ray may hit within its range, among them all that it does; where `SURE`, also one for
    /// each that it certainly hits, else none: see [`SphereRay`].
    fn meet_spheres<const SURE: bool>(block: &SphereBlock, ray: &SphereRay) -> (u32, u32);
}

impl SphereLanes for Portable {
    #[inline(always)]
    fn meet_spheres<const SURE: bool>(block: &SphereBlock, ray: &SphereRay) -> (u32, u32) {
        if !ray.is_sharp {
            return ((1 << BLOCK) - 1, 0);
        }
        let [ex, ey, ez] = ray.direction;
        let mut along = [0.0; BLOCK];
        let mut beside = [0.0; BLOCK];
        let mut square = [0.0; BLOCK];
        for lane in 0..BLOCK {
            let x = block.centers[0][lane] - ray.origin[0];
            let y = block.centers[1][lane] - ray.origin[1];
            let z = block.centers[2][lane] - ray.origin[2];
            let b = x * ex + (y * ey + z * ez);
            let (px, py, pz) = (x - b * ex, y - b * ey, z - b * ez);
            let size = block.radii[lane] + ray.margin;
            along[lane] = b;
            beside[lane] = px * px + (py * py + pz * pz);
            square[lane] = size * size;
        }
        let (mut mask, mut sure) = (0, 0);
        for lane in 0..BLOCK {
            // Comparisons with a NaN, which unused lanes have, are false.
            let half = (square[lane] - beside[lane]).sqrt();
            let (first, second) = (along[lane] - half, along[lane] + half);
            let may_be_hit = beside[lane] <= square[lane] && first <= ray.far && second >= ray.near;
            if !may_be_hit {
                continue;
            }
            mask |= 1 << lane;
            if SURE {
                let inner = block.radii[lane] - ray.margin;
                let is_crossed = inner > 0.0 && beside[lane] <= inner * inner;
                if is_crossed && first >= ray.surely_in[0] && along[lane] <= ray.surely_in[1] {
                    sure |= 1 << lane;
                }
            }
        }
        (mask, sure)
    }
}

#[cfg(target_arch = "x86_64")]
impl<const AVX512: bool, const LEAKS: bool> SphereLanes for X86<AVX512, LEAKS> {
    #[inline(always)]
    fn meet_spheres<const SURE: bool>(block: &SphereBlock, ray: &SphereRay) -> (u32, u32) {
        if !ray.is_sharp {
            return ((1 << BLOCK) - 1, 0);
        }
        // SAFETY: see `X86`. The loads are of eight f32 in arrays of eight.
        unsafe {
            // Axis by axis and without closures: into these, instructions are sometimes not inlined, but called.
            let ex = _mm256_set1_ps(ray.direction[0]);
            let ey = _mm256_set1_ps(ray.direction[1]);
            let ez = _mm256_set1_ps(ray.direction[2]);
            let x = _mm256_sub_ps(_mm256_load_ps(block.centers[0].as_ptr()), _mm256_set1_ps(ray.origin[0]));
            let y = _mm256_sub_ps(_mm256_load_ps(block.centers[1].as_ptr()), _mm256_set1_ps(ray.origin[1]));
            let z = _mm256_sub_ps(_mm256_load_ps(block.centers[2].as_ptr()), _mm256_set1_ps(ray.origin[2]));
            let radii = _mm256_load_ps(block.radii.as_ptr());
            let margin = _mm256_set1_ps(ray.margin);
            let along = _mm256_fmadd_ps(x, ex, _mm256_fmadd_ps(y, ey, _mm256_mul_ps(z, ez)));
            let px = _mm256_fnmadd_ps(along, ex, x);
            let py = _mm256_fnmadd_ps(along, ey, y);
            let pz = _mm256_fnmadd_ps(along, ez, z);
            let beside = _mm256_fmadd_ps(px, px, _mm256_fmadd_ps(py, py, _mm256_mul_ps(pz, pz)));
            let size = _mm256_add_ps(radii, margin);
            // Comparisons with a NaN, which unused lanes have, are false.
            let rest = _mm256_fmsub_ps(size, size, beside);
            let mask = _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_GE_OQ>(rest, _mm256_setzero_ps())) as u32;
            if mask == 0 {
                return (0, 0);
            }
            // Of a negative number this is a NaN, in lanes that are out already.
            let half = _mm256_sqrt_ps(rest);
            let first = _mm256_sub_ps(along, half);
            let second = _mm256_add_ps(along, half);
            let in_range = _mm256_and_ps(
                _mm256_cmp_ps::<_CMP_LE_OQ>(first, _mm256_set1_ps(ray.far)),
                _mm256_cmp_ps::<_CMP_GE_OQ>(second, _mm256_set1_ps(ray.near)),
            );
            let mask = mask & _mm256_movemask_ps(in_range) as u32;
            if !SURE || mask == 0 {
                return (mask, 0);
            }
            let inner = _mm256_sub_ps(radii, margin);
            let is_crossed = _mm256_and_ps(
                _mm256_cmp_ps::<_CMP_GT_OQ>(inner, _mm256_setzero_ps()),
                _mm256_cmp_ps::<_CMP_LE_OQ>(beside, _mm256_mul_ps(inner, inner)),
            );
            let from = _mm256_set1_ps(ray.surely_in[0]);
            let to = _mm256_set1_ps(ray.surely_in[1]);
            let surely_in = _mm256_and_ps(
                _mm256_cmp_ps::<_CMP_GE_OQ>(first, from),
                _mm256_cmp_ps::<_CMP_LE_OQ>(along, to),
            );
            (mask, _mm256_movemask_ps(_mm256_and_ps(is_crossed, surely_in)) as u32 & mask)
        }
    }
}

/// What [`SphereLanes::meet_spheres`] gives at a level, for tests.
#[cfg(test)]
pub(crate) fn meet_spheres_at(level: super::Level, block: &SphereBlock, ray: &SphereRay) -> (u32, u32) {
    struct Spheres<'a>(&'a SphereBlock, &'a SphereRay);
    impl super::Task for Spheres<'_> {
        type Output = (u32, u32);
        #[inline(always)]
        fn run<L: super::Lanes>(self) -> Self::Output {
            let (mask, sure) = L::meet_spheres::<true>(self.0, self.1);
            assert_eq!(L::meet_spheres::<false>(self.0, self.1), (mask, 0));
            (mask, sure)
        }
    }
    level.run(Spheres(block, ray))
}
