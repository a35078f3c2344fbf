//! The choice of a light, or of a piece of one, for a place.

use lumbre_geometry::{Ray, Surface};
use lumbre_math::distribution::AliasTable;
use lumbre_math::{DVec2, DVec3};

use super::tree::{Emitter, LightTree};
use super::{Light, LightId, LightSample};
use crate::surface::SurfaceEntry;

/// Who asks for a sample of light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Company {
    /// One who finds light by samples alone.
    Alone,
    /// One who finds light along rays of its own as well, and weighs both.
    BesideOthers,
}

/// Chooses among all lights: those that stand somewhere by a tree, the others by power.
#[derive(Clone, Debug, Default)]
pub(crate) struct LightChoice {
    tree: Option<LightTree>,
    /// The light of each emitter of the tree, and its piece, if it is one of many.
    emitters: Vec<(u32, Option<u32>)>,
    /// The first emitter of each light; `None` for those that are not in the tree.
    firsts: Vec<Option<u32>>,
    /// Lights that are everywhere, or that move, by power.
    elsewhere: Option<AliasTable>,
    elsewhere_ids: Vec<u32>,
    /// The probability of one of those.
    share_elsewhere: f64,
}

/// The least probability of lights that stand somewhere, and of others, where there are both: their powers are no good measure of what
/// they give to a place.
const LEAST_SHARE: f64 = 0.25;

impl LightChoice {
    /// For a scene of this radius.
    pub(crate) fn new(lights: &[Light], entries: &[SurfaceEntry], scene_radius: f64) -> Self {
        let mut choice = Self::default();
        let mut all: Vec<Emitter> = Vec::new();
        let (mut power, mut power_elsewhere) = (0.0, Vec::new());
        for (id, light) in (0..).zip(lights) {
            let found = light.emitters(entries);
            let first = choice.emitters.len() as u32;
            choice.firsts.push((!found.is_empty()).then_some(first));
            if found.is_empty() {
                choice.elsewhere_ids.push(id);
                power_elsewhere.push(light.power(scene_radius));
                continue;
            }
            power += light.power(scene_radius);
            let is_mesh = matches!(light, Light::Mesh(_));
            choice.emitters.extend((0..).zip(&found).map(|(piece, _)| (id, is_mesh.then_some(piece))));
            all.extend(found);
        }
        choice.tree = LightTree::new(&all);
        choice.elsewhere = AliasTable::new(&power_elsewhere);
        choice.share_elsewhere = match (&choice.tree, &choice.elsewhere) {
            (Some(_), Some(_)) => {
                let elsewhere: f64 = power_elsewhere.iter().sum();
                let share = elsewhere / (elsewhere + power);
                // Beyond all numbers, both alike.
                if share.is_nan() { 0.5 } else { share.clamp(LEAST_SHARE, 1.0 - LEAST_SHARE) }
            }
            (None, Some(_)) => 1.0,
            (_, None) => 0.0,
        };
        choice
    }

    /// A sample of a light that `choose` chooses for `from`, in a direction by `x` and `y`. Its density, or the radiance of a delta light,
    /// includes the probability of the choice.
    pub(crate) fn sample(
        &self,
        lights: &[Light],
        entries: &[SurfaceEntry],
        from: DVec3,
        time: f64,
        [choose, x, y]: [f64; 3],
        company: Company,
    ) -> Option<LightSample> {
        let u = DVec2::new(x, y);
        let (sample, probability) = if choose < self.share_elsewhere {
            let choice = self.elsewhere.as_ref()?.sample(choose / self.share_elsewhere);
            let sample = match &lights[self.elsewhere_ids[choice.index] as usize] {
                Light::Environment(light) if company == Company::BesideOthers => {
                    light.sample_beside_others(u)
                }
                light => light.sample(entries, from, time, u),
            };
            (sample?, self.share_elsewhere * choice.probability)
        } else {
            let share = 1.0 - self.share_elsewhere;
            let chosen = self.tree.as_ref()?.choose(from, (choose - self.share_elsewhere) / share)?;
            let (light, piece) = self.emitters[chosen.emitter];
            let sample = match (&lights[light as usize], piece) {
                (Light::Mesh(light), Some(piece)) => {
                    light.sample_piece(&entries[light.entry as usize], piece, from, u)
                }
                (light, _) => light.sample(entries, from, time, u),
            };
            (sample?, share * chosen.probability)
        };
        Some(sample.of_density(probability))
    }

    /// The density per unit solid angle with which [`LightChoice::sample`], beside others, samples what a ray hit of a light: see
    /// [`Light::pdf`].
    pub(crate) fn pdf(
        &self,
        lights: &[Light],
        id: LightId,
        ray: &Ray,
        surface: Option<(&Surface, u32)>,
    ) -> f64 {
        let light = &lights[id.0 as usize];
        let Some(first) = self.firsts[id.0 as usize] else {
            let Ok(index) = self.elsewhere_ids.binary_search(&id.0) else { return 0.0 };
            let probability = self.elsewhere.as_ref().map_or(0.0, |choice| choice.probability(index));
            let density = match (light, surface) {
                (Light::Environment(light), None) => light.pdf_beside_others(ray.direction),
                _ => light.pdf(ray, surface),
            };
            return self.share_elsewhere * probability * density;
        };
        let Some(tree) = &self.tree else { return 0.0 };
        let probability =
            |emitter: u32| (1.0 - self.share_elsewhere) * tree.probability(ray.origin, emitter as usize);
        match (light, surface) {
            (Light::Mesh(light), Some((surface, triangle))) => light
                .piece_of(triangle)
                .map_or(0.0, |piece| probability(first + piece) * light.piece_pdf(ray, surface, piece)),
            _ => probability(first) * light.pdf(ray, surface),
        }
    }
}
