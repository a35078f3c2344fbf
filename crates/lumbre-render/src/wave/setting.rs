//! Data shared by all stages of a wave.

use lumbre_kernel::PictureRounding;
use lumbre_math::DVec3;
use lumbre_scene::{SamplerKind, Scene};
use lumbre_shading::{ShadingNormals, Spectrum};
use lumbre_simd::{Double, InstructionSet, Real, V3};

use crate::caustics::Merging;
use crate::transport::Strategy;

/// What all paths of a render have in common.
#[derive(Debug)]
pub(crate) struct Setting<'s> {
    pub(crate) scene: &'s Scene,
    pub(crate) sampler: SamplerKind,
    pub(crate) strategy: Strategy,
    pub(crate) max_depth: u32,
    /// Minimum bounces before Russian roulette.
    pub(crate) roulette_start: u32,
    pub(crate) regularize: bool,
    pub(crate) shading_normals: ShadingNormals,
    pub(crate) has_solids: bool,
    pub(crate) has_media: bool,
    /// Whether light samples of points pass straight through panes.
    pub(crate) has_panes: bool,
    pub(crate) moves: bool,
    /// Whether channels are wavelengths.
    pub(crate) is_spectral: bool,
    pub(crate) instruction_set: InstructionSet,
    /// The photons, if caustics use them.
    pub(crate) merging: Option<Merging<'s>>,
}

/// The segment from a face to the smooth surface over it, on which a ray starts.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TerminatorSegment {
    /// The index of the ray.
    pub(crate) ray: u32,
    /// The origin of the segment.
    pub(crate) from: DVec3,
}

/// Light that a path hit without sampling it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Found {
    /// The index of the path.
    pub(crate) path: u32,
    pub(crate) radiance: Spectrum,
    /// The density with which the last vertex would have sampled it; 0 if that does not matter.
    pub(crate) light_pdf: f32,
}

/// The rounding of picture rays: see [`PictureRounding`]; zero in double precision.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rounding {
    origin: DVec3,
    relative: f64,
    absolute: f64,
}

impl Setting<'_> {
    /// The weight of light that a ray hit, against a sample of the light with this density.
    pub(crate) fn weight_of_found(&self, chosen: f32, light_pdf: f32) -> f32 {
        match self.strategy {
            _ if chosen == f32::INFINITY => 1.0,
            Strategy::Bsdf => 1.0,
            Strategy::Lights => f32::from(u8::from(light_pdf <= 0.0)),
            Strategy::Both => power_heuristic(chosen, light_pdf),
        }
    }

    /// The rounding of rays.
    #[inline(always)]
    pub(crate) fn rounding(&self, is_single: bool) -> Rounding {
        Rounding::of(self.scene, is_single)
    }
}

impl Rounding {
    #[inline(always)]
    pub(crate) fn of(scene: &Scene, is_single: bool) -> Self {
        match scene.accel().picture_rounding() {
            Some(PictureRounding { origin, relative, absolute }) if is_single => {
                Self { origin, relative, absolute }
            }
            _ => Self { origin: DVec3::ZERO, relative: 0.0, absolute: 0.0 },
        }
    }

    /// The error of points, enlarged so that rays that leave them do not meet their surfaces again.
    #[inline(always)]
    pub(crate) fn grow<R: Real>(&self, point: V3<R::Double>, error: V3<R::Double>) -> V3<R::Double> {
        let [x, y, z] = self.origin.to_array();
        V3 {
            x: self.grown::<R>(point.x, error.x, x),
            y: self.grown::<R>(point.y, error.y, y),
            z: self.grown::<R>(point.z, error.z, z),
        }
    }

    #[inline(always)]
    pub(crate) fn grown<R: Real>(&self, x: R::Double, error: R::Double, origin: f64) -> R::Double {
        let s = R::Double::splat;
        error + ((x - s(origin)).abs() * s(self.relative) + s(self.absolute))
    }
}

/// The power heuristic (Veach, "Robust Monte Carlo Methods for Light Transport Simulation", 1997) for two strategies,
/// from their ratio, because squares may overflow.
#[inline(always)]
pub(crate) fn power_heuristic<R: Real>(this: R, other: R) -> R {
    let ratio = other / this;
    let weight = (R::one() + ratio * ratio).recip();
    R::select(this.simd_eq(R::splat(f32::INFINITY)), R::one(), weight)
}

#[cfg(test)]
mod tests {
    use super::power_heuristic;

    #[test]
    fn the_weights_of_both_ways_sum_to_one_at_any_size() {
        for (a, b) in [(2.0_f32, 3.0), (1e30, 2e30), (1e-30, 5e-30), (7.0, 0.0), (0.5, 1e25)] {
            let sum = power_heuristic(a, b) + if b > 0.0 { power_heuristic(b, a) } else { 0.0 };
            assert!((sum - 1.0).abs() < 1e-6, "{a} {b} {sum}");
        }
        assert_eq!(power_heuristic(f32::INFINITY, 2.0), 1.0);
    }
}
