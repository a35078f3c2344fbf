//! Chooses a light, or a piece of one, for a point.

use lumbre_geometry::{Ray, Surface};
use lumbre_math::{DVec2, DVec3};

use super::tree::{Emitter, HORIZON_SLACK, LightTree, Place};
use super::{Light, LightSample};
use crate::LightId;
use crate::surface::SurfaceEntry;

/// The purpose of light samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sampling {
    /// They alone find light.
    LightsOnly,
    /// Other rays find light too, and both are weighted: multiple importance sampling.
    Mis,
}

/// Chooses among all lights: those with a position by a tree, the others by their irradiance at a point.
#[derive(Clone, Debug, Default)]
pub(crate) struct LightChoice {
    pub(super) tree: Option<LightTree>,
    /// The light of each emitter of the tree, and its piece, if it is one of many.
    pub(super) emitters: Vec<(u32, Option<u32>)>,
    /// The first emitter of each light; `None` for those that are not in the tree.
    pub(super) firsts: Vec<Option<u32>>,
    pub(super) elsewhere: Vec<Elsewhere>,
    /// The probability of lights that are everywhere, if others may contribute.
    pub(super) share_elsewhere: f64,
}

/// A light that is everywhere.
#[derive(Clone, Copy, Debug)]
pub(super) struct Elsewhere {
    pub light: u32,
    /// Relative to the greatest.
    pub power: f64,
}

/// Minimum probability of lights with a position, and of lights that are everywhere, if there are both: their powers
/// are a poor measure of their contributions at a point.
const MIN_SHARE: f64 = 0.25;

impl LightChoice {
    /// For a scene of this radius.
    pub(crate) fn new(lights: &[Light], entries: &[SurfaceEntry], scene_radius: f64) -> Self {
        let mut choice = Self::default();
        let mut all: Vec<Emitter> = Vec::new();
        let mut power = 0.0;
        for (id, light) in (0..).zip(lights) {
            let found = light.emitters(entries);
            let first = choice.emitters.len() as u32;
            choice.firsts.push((!found.is_empty()).then_some(first));
            if found.is_empty() {
                choice.elsewhere.push(Elsewhere { light: id, power: light.power(scene_radius) });
                continue;
            }
            power += light.power(scene_radius);
            let is_mesh = matches!(light, Light::Mesh(_));
            choice.emitters.extend((0..).zip(&found).map(|(piece, _)| (id, is_mesh.then_some(piece))));
            all.extend(found);
        }
        choice.tree = LightTree::new(&all);
        let elsewhere: f64 = choice.elsewhere.iter().map(|light| light.power).sum();
        let share = elsewhere / (elsewhere + power);
        // Both infinite: equal shares.
        let share = if share.is_nan() { 0.5 } else { share.clamp(MIN_SHARE, 1.0 - MIN_SHARE) };
        let has_elsewhere = choice.elsewhere.iter().any(|light| light.power > 0.0);
        choice.share_elsewhere = match (&choice.tree, has_elsewhere) {
            (Some(_), true) => share,
            (None, true) => 1.0,
            (_, false) => 0.0,
        };
        let greatest = choice.elsewhere.iter().map(|light| light.power).fold(0.0, f64::max);
        for light in &mut choice.elsewhere {
            let relative = light.power / greatest;
            light.power = if relative.is_finite() { relative.max(0.0) } else { 1.0 };
        }
        choice
    }

    /// The light that `choose` selects for a point, and a sample of it in a direction by `x` and `y`. Its density, or
    /// the radiance of a delta light, includes the probability of the choice.
    pub(crate) fn sample(
        &self,
        lights: &[Light],
        entries: &[SurfaceEntry],
        place: &Place,
        time: f64,
        [choose, x, y]: [f64; 3],
        sampling: Sampling,
    ) -> Option<(LightId, LightSample)> {
        let u = DVec2::new(x, y);
        let sum = self.sum_elsewhere(lights, place.normal, time);
        let share_elsewhere = self.share_elsewhere_at(place, sum);
        let (id, sample, probability) = if choose < share_elsewhere {
            let (id, probability) =
                self.choose_elsewhere(lights, place.normal, time, choose / share_elsewhere * sum)?;
            let sample = match &lights[id as usize] {
                Light::Environment(light) if sampling == Sampling::Mis => light.sample_beside_others(u),
                light => light.sample(entries, place.from, time, u),
            };
            (id, sample?, share_elsewhere * (probability / sum))
        } else {
            let share = 1.0 - share_elsewhere;
            let chosen = self.tree.as_ref()?.choose(place, (choose - share_elsewhere) / share)?;
            (
                self.emitters[chosen.emitter].0,
                self.sample_emitter(lights, entries, chosen.emitter, place.from, time, u)?,
                share * chosen.probability,
            )
        };
        Some((LightId(id), sample.of_density(probability)))
    }

    /// A sample of an emitter of the tree.
    pub(super) fn sample_emitter(
        &self,
        lights: &[Light],
        entries: &[SurfaceEntry],
        emitter: usize,
        from: DVec3,
        time: f64,
        u: DVec2,
    ) -> Option<LightSample> {
        let (light, piece) = self.emitters[emitter];
        match (&lights[light as usize], piece) {
            (Light::Mesh(light), Some(piece)) => {
                light.sample_piece(&entries[light.entry as usize], piece, from, u)
            }
            (light, _) => light.sample(entries, from, time, u),
        }
    }

    /// The probability of the lights that are everywhere at a point where their contributions add up to `sum`.
    fn share_elsewhere_at(&self, place: &Place, sum: f64) -> f64 {
        // False for NaN.
        let shines = sum > 0.0;
        if !shines {
            return 0.0;
        }
        let is_alone =
            self.share_elsewhere < 1.0 && !self.tree.as_ref().is_some_and(|tree| tree.shines_on(place));
        if is_alone { 1.0 } else { self.share_elsewhere }
    }

    /// The contribution of all lights that are everywhere at a point with this normal, in arbitrary units.
    fn sum_elsewhere(&self, lights: &[Light], normal: DVec3, time: f64) -> f64 {
        self.elsewhere.iter().map(|light| light.given(lights, normal, time)).sum()
    }

    /// The light at which the running sum of contributions passes `up_to`, and its own contribution.
    fn choose_elsewhere(&self, lights: &[Light], normal: DVec3, time: f64, up_to: f64) -> Option<(u32, f64)> {
        let (mut sum, mut last) = (0.0, None);
        for light in &self.elsewhere {
            let given = light.given(lights, normal, time);
            if given > 0.0 {
                sum += given;
                last = Some((light.light, given));
                if up_to < sum {
                    break;
                }
            }
        }
        last
    }

    /// The density per unit solid angle with which [`LightChoice::sample`] with [`Sampling::Mis`] samples a ray's hit
    /// on a light, from a point with this normal: see [`Light::pdf`].
    pub(crate) fn pdf(
        &self,
        lights: &[Light],
        id: LightId,
        ray: &Ray,
        normal: DVec3,
        surface: Option<(&Surface, u32)>,
    ) -> f64 {
        let light = &lights[id.0 as usize];
        let place = Place { from: ray.origin, normal };
        let sum = self.sum_elsewhere(lights, normal, ray.time);
        let share_elsewhere = self.share_elsewhere_at(&place, sum);
        let Some(first) = self.firsts[id.0 as usize] else {
            let position = self.elsewhere.binary_search_by_key(&id.0, |light| light.light);
            let Ok(index) = position else { return 0.0 };
            let given = self.elsewhere[index].given(lights, normal, ray.time);
            let density = match (light, surface) {
                (Light::Environment(light), None) => light.pdf_beside_others(ray.direction),
                _ => light.pdf(ray, surface),
            };
            return if given > 0.0 { share_elsewhere * (given / sum) * density } else { 0.0 };
        };
        let Some(tree) = &self.tree else { return 0.0 };
        let probability = |emitter: u32| (1.0 - share_elsewhere) * tree.probability(&place, emitter as usize);
        match (light, surface) {
            (Light::Mesh(light), Some((surface, triangle))) => {
                light.piece_of(triangle).map_or(0.0, |piece| {
                    probability(first + piece) * light.piece_pdf(ray.origin, surface.point, piece)
                })
            }
            _ => probability(first) * light.pdf(ray, surface),
        }
    }
}

impl Elsewhere {
    /// Its contribution at a point with this normal, or at one that faces it if the normal is zero; in arbitrary units.
    fn given(&self, lights: &[Light], normal: DVec3, time: f64) -> f64 {
        if normal == DVec3::ZERO {
            return self.power;
        }
        let light = &lights[self.light as usize];
        let cosine = light.towards(time).map_or(1.0, |towards| normal.dot(towards));
        // As for lights in the tree: rounding may light a surface in the light's own plane. A disc may be above it in
        // part.
        let slack = HORIZON_SLACK + light.half_width();
        if cosine < -slack { 0.0 } else { self.power * cosine.max(slack) }
    }
}
