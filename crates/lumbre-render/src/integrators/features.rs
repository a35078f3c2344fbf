//! Pictures of features.

use lumbre_scene::{Scene, View};
use lumbre_shading::Spectrum;

use crate::integrators::RayIntegrator;
use crate::transport::journal::{Event, Met, Source};
use crate::transport::{Feature, Features, PrimaryHit, Record, SampleNumbers};

/// A picture of one feature; no light is needed. The normal is shown as (n + 1) / 2.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FeatureIntegrator(pub Feature);

impl RayIntegrator for FeatureIntegrator {
    fn radiance(
        &self,
        _: &Scene,
        view: &View,
        primary_hit: PrimaryHit<'_>,
        _: &SampleNumbers,
        record: &mut Record,
    ) -> Spectrum {
        let ray = primary_hit.ray.ray;
        match &primary_hit.met {
            Some(met) => record.note(|| Event::Met(Met::of(&ray, met, 0, Spectrum::WHITE))),
            None => record.note(|| Event::Left { ray }),
        }
        let Some(features) = Features::of(view, &primary_hit) else { return Spectrum::BLACK };
        let value = features.get(self.0);
        let shown = if self.0 == Feature::Normal { (value + Spectrum::WHITE) * 0.5 } else { value };
        record.added(Source::Surface, Spectrum::WHITE, shown, 1.0)
    }
}
