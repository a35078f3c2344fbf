//! The share of a scene's light that paths hardly find.

use lumbre_math::Vec3;
use lumbre_scene::{BoundingSphere, Scene, View};

use super::{ChordSampler, LightTracer, Photon};
use crate::transport::Sampler;
use crate::{RenderError, RenderOptions};

/// Lines of the trial.
const LINES: u32 = 1 << 12;
/// A lamp of this solid angle is found by about one in a thousand diffuse bounces.
const SMALL: f32 = 0.003;
/// The pass of the trial; no picture uses it.
const PASS: u32 = u32::MAX;

/// An estimate of the share of all light from lamps on surfaces that arrives over mirrors and smooth glass from lamps
/// so small that paths hardly or never find them: the light that [`crate::integrators::Caustics`] is for. In [0, 1],
/// from a trial of a few thousand light paths; the same for the same scene, camera and seed.
///
/// # Errors
/// As for [`RenderOptions::camera_of`].
pub fn caustic_share(scene: &Scene, options: &RenderOptions) -> Result<f64, RenderError> {
    let camera = options.camera_of(scene)?;
    let Some(chords) = ChordSampler::new(scene).filter(|_| !scene.lights().is_empty()) else {
        return Ok(0.0);
    };
    let whole = [BoundingSphere::around(&scene.bounds())];
    let everywhere = ChordSampler::within(&whole);
    let view = View::new(camera, options.width, options.height);
    let tracer = |chords| LightTracer {
        scene,
        view: &view,
        chords,
        sampler: Sampler::new(&options.sampler),
        normals: options.integrator.shading_normals,
        max_bounces: options.integrator.max_depth.saturating_sub(1),
        goes_straight_on: scene.has_delta_transmission(),
        density: None,
    };
    let mut photons = Vec::new();
    tracer(&chords).trace(PASS, 0..LINES, &mut photons);
    let is_on_surface = |photon: &&Photon| photon.normal != Vec3::ZERO;
    let hard = photons.iter().filter(is_on_surface).filter(|photon| photon.lamp <= SMALL);
    let hard = hard.map(|photon| f64::from(photon.flux.average())).sum::<f64>() / f64::from(LINES);
    if hard <= 0.0 {
        return Ok(0.0);
    }
    let direct =
        everywhere.as_ref().map_or(0.0, |everywhere| tracer(everywhere).direct_power(PASS, 0..LINES));
    Ok(hard / (hard + direct))
}
