//! Ambient occlusion.

use lumbre_math::warp;
use lumbre_scene::{Interaction, Scene};
use lumbre_shading::{ShadingFrame, ShadingNormals, Spectrum};

use crate::integrators::Integrator;
use crate::transport::journal::{Event, Met, Source};
use crate::transport::{Record, SampleNumbers, Sampler};
use crate::wave::PrimaryHits;
use crate::wave::trees::{Branch, TreeIntegrator, TreeVertex};

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

impl Integrator for AmbientOcclusion {
    fn estimate(&self, primary_hits: &mut PrimaryHits<'_, '_>, _: &Sampler, record: &mut Record) {
        primary_hits.follow_trees(self, record);
    }
}

impl TreeIntegrator for AmbientOcclusion {
    fn shade<'s>(
        &self,
        _: &'s Scene,
        branch: Branch<'s>,
        met: Option<&Interaction<'s>>,
        numbers: &SampleNumbers,
        vertex: &mut TreeVertex<'_, 's>,
        record: &mut Record,
    ) {
        let Some(met) = met else {
            return record.note(|| Event::Left { ray: branch.ray });
        };
        record.note(|| Event::Met(Met::of(&branch.ray, met, 0, Spectrum::WHITE)));
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
        vertex.begin_direct(Source::Sampled, Spectrum::WHITE);
        let segment = vertex.add_along(&ray, Spectrum::splat(weight));
        vertex.note(record, Some(segment), move |is_occluded| Event::Looked { ray, is_occluded });
    }
}
