//! Moving lights without a surface, sampled at the time of the ray.

use std::sync::Arc;

use lumbre_geometry::Aabb;
use lumbre_math::{AnimatedTransform, DMat3, DVec2, DVec3};
use lumbre_shading::Spectrum;

use super::tree::{Emitter, Facing};
use super::{Light, LightSample};
use crate::placed_bounds::moved;
use crate::surface::SurfaceEntry;

/// A light in its own space, and the rigid motion of that space.
#[derive(Clone, Debug)]
pub struct MovingLight {
    /// A point, spot, goniometric, projection or directional light.
    pub(super) light: Box<Light>,
    // Rotations, mirrors and translations only.
    motion: Arc<AnimatedTransform>,
}

/// The tolerance of unit lengths and right angles of a rigid motion's columns.
const RIGID: f64 = 1e-6;

impl MovingLight {
    /// `None` for an area light or an infinite one, and for a motion that stretches.
    pub(crate) fn new(light: Light, motion: Arc<AnimatedTransform>) -> Option<Self> {
        let is_rigid = |m: DMat3| (m.transpose() * m).abs_diff_eq(DMat3::IDENTITY, RIGID);
        let is_sound = light.is_delta() && motion.keys().iter().all(|(_, map)| is_rigid(map.linear()));
        is_sound.then(|| Self { light: Box::new(light), motion })
    }

    pub(super) fn sample(
        &self,
        entries: &[SurfaceEntry],
        from: DVec3,
        time: f64,
        u: DVec2,
    ) -> Option<LightSample> {
        let map = self.motion.at(time);
        let mut sample = self.light.sample(entries, map.inverse_point(from), time, u)?;
        sample.towards = map.vector(sample.towards).try_normalize()?;
        if let Some(end) = &mut sample.end {
            end.point = map.point(end.point);
            // From the point itself: the transform there and back may have rounded the direction.
            sample.towards = (end.point - from).try_normalize()?;
        }
        Some(sample)
    }

    /// The direction of parallel light at a time; `None` for a light with a position.
    pub(super) fn towards(&self, time: f64) -> Option<DVec3> {
        self.motion.at(time).vector(self.light.towards(time)?).try_normalize()
    }

    /// Its entry in a light tree at all times; `None` for parallel light.
    pub(super) fn emitter(&self, entries: &[SurfaceEntry]) -> Option<Emitter> {
        let inner = self.light.emitters(entries);
        let [Emitter { bounds, strength, .. }] = inner[..] else { return None };
        Some(Emitter { bounds: swept(&bounds, &self.motion), facing: Facing::ANY, strength })
    }

    pub(super) fn irradiance(&self, at: DVec3, time: f64, normal: DVec3) -> Option<Spectrum> {
        let map = self.motion.at(time);
        let normal = map.inverse_vector(normal).try_normalize()?;
        self.light.irradiance(map.inverse_point(at), time, normal)
    }
}

/// A box that contains another one at all times of its motion.
pub(crate) fn swept(bounds: &Aabb, motion: &AnimatedTransform) -> Aabb {
    if motion.is_still() {
        return moved(bounds, &motion.keys()[0].1).outward(8);
    }
    let (center, half) = (bounds.center(), 0.5 * bounds.size());
    let places = motion.keys().iter().fold(Aabb::EMPTY, |all, (_, map)| all.union(moved(bounds, map)));
    let reach = |bounds: &Aabb| bounds.min.abs().max(bounds.max.abs()).max_element();
    let rounding = 64.0 * f64::EPSILON * motion.condition() * reach(&places);
    // As fine as worthwhile: a hundredth of its path.
    let tolerance = (0.01 * places.size().max_element()).max(rounding).max(f64::MIN_POSITIVE);
    motion.steps(center, half, tolerance).fold(places, |all, (maps, beyond)| {
        let step = maps.iter().fold(Aabb::EMPTY, |step, map| step.union(moved(bounds, map)));
        let margin = DVec3::splat(beyond + rounding);
        all.union(Aabb { min: step.min - margin, max: step.max + margin })
    })
}
