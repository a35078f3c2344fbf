//! Ambient occlusion.

use lumbre_math::warp;
use lumbre_scene::{Scene, View};
use lumbre_shading::{ShadingFrame, ShadingNormals, Spectrum};

use crate::integrators::RayIntegrator;
use crate::transport::journal::{Event, Met, Source};
use crate::transport::{PrimaryHit, Record, SampleNumbers};

/// The cosine-weighted share of the sky that is visible from a surface: white if nothing is near.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AmbientOcclusion {
    /// Whether directions are cosine-distributed instead of uniform.
    pub cosine: bool,
    /// Maximum distance of occluders.
    pub max_distance: f64,
    /// The axis of the hemisphere: the shading normal, or the geometric one, as in pbrt.
    pub shading_normals: ShadingNormals,
}

impl RayIntegrator for AmbientOcclusion {
    fn radiance(
        &self,
        scene: &Scene,
        _: &View,
        primary_hit: PrimaryHit<'_>,
        numbers: &SampleNumbers,
        record: &mut Record,
    ) -> Spectrum {
        let Some(met) = &primary_hit.met else {
            record.note(|| Event::Left { ray: primary_hit.ray.ray });
            return Spectrum::BLACK;
        };
        record.note(|| Event::Met(Met::of(&primary_hit.ray.ray, met, 0, Spectrum::WHITE)));
        let smooth = met.shading.normal;
        let normal = match self.shading_normals {
            ShadingNormals::Pbrt if ShadingNormals::differ(smooth, met.shading.geometric) => {
                met.shading.geometric
            }
            _ => smooth,
        };
        let facing = if normal.dot(met.towards_origin.as_vec3()) < 0.0 { -normal } else { normal };
        let frame = ShadingFrame::new(facing, met.shading.dpdu);
        let u = numbers.direction(0);
        let (local, weight) = if self.cosine {
            (warp::square_to_cosine_hemisphere(u), 1.0)
        } else {
            let w = warp::square_to_hemisphere(u);
            (w, 2.0 * w.z)
        };
        let direction = (frame.s * local.x + frame.t * local.y + frame.n * local.z).as_dvec3().normalize();
        let ray = met.leave(direction).with_range(0.0, self.max_distance);
        record.counts.shadow += 1;
        let is_occluded = scene.is_occluded(&ray);
        record.note(|| Event::Looked { ray, is_occluded });
        let open = if is_occluded { Spectrum::BLACK } else { Spectrum::splat(weight) };
        record.added(Source::Sampled, Spectrum::WHITE, open, 1.0)
    }
}
