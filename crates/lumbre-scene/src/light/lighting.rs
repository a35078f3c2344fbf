//! The lights of a scene together.

use std::sync::Arc;

use lumbre_geometry::{Aabb, Ray, Surface};
use lumbre_math::DVec3;
use lumbre_math::distribution::AliasTable;

use super::choice::LightChoice;
use super::lanes::LaneLights;
use super::{Light, LightSample, Place, Sampling};
use crate::LightId;
use crate::light_colour::LightColour;
use crate::surface::SurfaceEntry;

/// The lights of a scene, the surfaces that some of them are, and the choice among them.
#[derive(Debug, Default)]
pub(crate) struct LightSources {
    pub lights: Vec<Light>,
    pub entries: Arc<Vec<SurfaceEntry>>,
    pub choice: LightChoice,
}

/// The lights of a scene, and the data for choosing among them.
#[derive(Debug)]
pub(crate) struct Lighting {
    sources: Arc<LightSources>,
    pub lanes: LaneLights,
    /// By light.
    pub colours: Vec<LightColour>,
    /// `None` without lights.
    by_power: Option<AliasTable>,
    /// The lights that escaping rays hit.
    pub infinite: Vec<LightId>,
}

impl Lighting {
    /// The lights of a scene with these bounds.
    pub(crate) fn new(
        lights: Vec<Light>,
        colours: Vec<LightColour>,
        entries: &Arc<Vec<SurfaceEntry>>,
        bounds: &Aabb,
    ) -> Self {
        let radius = if bounds.is_empty() { 1.0 } else { 0.5 * bounds.size().length() };
        let powers: Vec<f64> = lights.iter().map(|light| light.power(radius)).collect();
        let ids = (0..lights.len() as u32).map(LightId);
        let infinite: Vec<LightId> = ids.filter(|id| lights[id.0 as usize].is_infinite()).collect();
        let choice = LightChoice::new(&lights, entries, radius);
        let sources = Arc::new(LightSources { lights, entries: Arc::clone(entries), choice });
        let lanes = LaneLights::new(&sources, &infinite);
        Self { sources, lanes, colours, by_power: AliasTable::new(&powers), infinite }
    }

    /// Every light, by id.
    pub(crate) fn lights(&self) -> &[Light] {
        &self.sources.lights
    }

    /// See [`LightChoice::sample`].
    pub(crate) fn sample(
        &self,
        place: &Place,
        time: f64,
        u: [f64; 3],
        sampling: Sampling,
    ) -> Option<(LightId, LightSample)> {
        let LightSources { lights, entries, choice } = &*self.sources;
        choice.sample(lights, entries, place, time, u, sampling)
    }

    /// See [`LightChoice::pdf`].
    pub(crate) fn pdf(
        &self,
        light: LightId,
        ray: &Ray,
        normal: DVec3,
        surface: Option<(&Surface, u32)>,
    ) -> f64 {
        self.sources.choice.pdf(&self.sources.lights, light, ray, normal, surface)
    }

    /// A light chosen by power, with its probability; `None` without lights.
    pub(crate) fn choose_by_power(&self, choose: f64) -> Option<(LightId, f64)> {
        let choice = self.by_power.as_ref()?.sample(choose);
        Some((LightId(choice.index as u32), choice.probability))
    }
}
