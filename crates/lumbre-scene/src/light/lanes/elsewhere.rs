//! Lights that are everywhere, in lanes: chosen by what they give to a place.

use std::f32::consts::FRAC_1_PI;

use lumbre_math::DVec3;
use lumbre_simd::{Double, MAX_LANES, Mask, Real, UInt, V3, math};

use super::sample::{LaneLightSample, Receiver};
use super::scalar::{self, Receivers, Samples, lanes_of};
use super::tree::{LanePlace, SLACK};
use crate::light::choice::LightChoice;
use crate::light::{Light, LightSources, Sampling};

/// A light that is everywhere.
#[derive(Clone, Copy, Debug)]
pub(super) struct LaneElsewhere {
    /// Among the lights of the scene.
    pub light: u32,
    /// Relative to the greatest.
    power: f32,
    kind: Kind,
}

#[derive(Clone, Copy, Debug)]
enum Kind {
    Uniform {
        radiance: [f32; 3],
    },
    Environment,
    Distant {
        towards: [f32; 3],
        irradiance: [f32; 3],
    },
    /// A disc at infinity: by scalar code.
    Disc {
        towards: [f32; 3],
        /// [`SLACK`] for all of it.
        slack: f32,
    },
    /// Parallel light that moves: by scalar code.
    Moving,
    /// From all around, by scalar code.
    Scalar,
}

impl LaneElsewhere {
    pub(super) fn all(lights: &[Light], choice: &LightChoice) -> Vec<Self> {
        let lane = |light: u32| match &lights[light as usize] {
            Light::Uniform(light) => Kind::Uniform { radiance: light.radiance.to_array() },
            Light::Environment(light) if light.has_lanes() => Kind::Environment,
            Light::Distant(light) => Kind::Distant {
                towards: light.towards.as_vec3().to_array(),
                irradiance: light.irradiance.to_array(),
            },
            Light::Disc(light) => Kind::Disc {
                towards: light.towards().as_vec3().to_array(),
                slack: SLACK + light.sine() as f32,
            },
            Light::Moving(_) => Kind::Moving,
            _ => Kind::Scalar,
        };
        let elsewhere = choice.elsewhere.iter();
        elsewhere
            .map(|light| {
                let power = light.power as f32;
                // Never 0 for what shines.
                let power = if light.power > 0.0 { power.max(1e-30) } else { 0.0 };
                Self { light: light.light, power, kind: lane(light.light) }
            })
            .collect()
    }

    /// What it gives to a place, in arbitrary units.
    #[inline(always)]
    pub(super) fn given<R: Real>(
        &self,
        sources: &LightSources,
        active: R::Mask,
        place: &LanePlace<R>,
        receiver: &Receiver<R>,
    ) -> R {
        let power = R::splat(self.power);
        let towards = match self.kind {
            Kind::Uniform { .. } | Kind::Environment | Kind::Scalar => return power,
            Kind::Distant { towards, .. } | Kind::Disc { towards, .. } => V3::constant(towards),
            Kind::Moving => {
                let mut towards = [[0.0; MAX_LANES]; 3];
                directions(sources, self.light, active.to_bitmask(), &Receivers::new(receiver), &mut towards);
                scalar::from_singles(&towards)
            }
        };
        let slack = R::splat(if let Kind::Disc { slack, .. } = self.kind { slack } else { SLACK });
        let cosine = place.normal.dot(towards);
        let is_above = cosine.simd_ge(-slack);
        let given = (power * cosine.simd_max(slack)).or_zero(is_above);
        R::select(place.is_oriented, given, power)
    }

    /// A sample of it, without the probability of its choice. `u` is a point, and further digits of its first
    /// coordinate.
    #[inline(always)]
    pub(super) fn sample<R: Real>(
        &self,
        sources: &LightSources,
        active: R::Mask,
        receiver: &Receiver<R>,
        u: [R; 3],
        sampling: Sampling,
    ) -> LaneLightSample<R> {
        let nowhere = V3::splat(R::Double::splat(0.0));
        let none = R::Mask::splat(false);
        let far_away = LaneLightSample {
            towards: V3::splat(R::zero()),
            point: nowhere,
            error: nowhere,
            normal: V3::splat(R::zero()),
            infinite: active,
            radiance: V3::splat(R::zero()),
            pdf: R::zero(),
            delta: none,
            valid: active,
            source: R::UInt::splat(0),
        };
        match (self.kind, &sources.lights[self.light as usize]) {
            (Kind::Uniform { radiance }, _) => {
                let two = R::splat(2.0);
                let (sin, cos) = math::sin_cos_turns(u[1]);
                // √(1 − z²) without cancellation near the poles.
                let radius = two * (u[0] * (R::one() - u[0])).simd_max(R::zero()).sqrt();
                LaneLightSample {
                    towards: V3::new(radius * cos, radius * sin, R::one() - two * u[0]),
                    radiance: V3::constant(radiance),
                    pdf: R::splat(0.25 * FRAC_1_PI),
                    ..far_away
                }
            }
            (Kind::Distant { towards, irradiance }, _) => LaneLightSample {
                towards: V3::constant(towards),
                radiance: V3::constant(irradiance),
                delta: active,
                ..far_away
            },
            (Kind::Environment, Light::Environment(light)) => light.lane_sample(active, u, sampling),
            _ => {
                let u = [u[0].to_lanes(), u[1].to_lanes()];
                let mut samples = Samples::none();
                let receivers = Receivers::new(receiver);
                sample_scalar(
                    sources,
                    self.light,
                    active.to_bitmask(),
                    &receivers,
                    &u,
                    sampling,
                    &mut samples,
                );
                samples.to_lanes()
            }
        }
    }

    /// The radiance at a receiver along a unit direction, and its density without the probability of the choice.
    #[inline(always)]
    pub(super) fn escaped<R: Real>(
        &self,
        sources: &LightSources,
        active: R::Mask,
        receiver: &Receiver<R>,
        direction: V3<R>,
    ) -> (V3<R>, R) {
        match (self.kind, &sources.lights[self.light as usize]) {
            (Kind::Uniform { radiance }, _) => (V3::constant(radiance), R::splat(0.25 * FRAC_1_PI)),
            (Kind::Environment, Light::Environment(light)) => light.lane_escaped(direction),
            _ => {
                let (mut radiance, mut pdf) = ([[0.0; MAX_LANES]; 3], [0.0; MAX_LANES]);
                let directions = scalar::singles(direction);
                let (lanes, receivers) = (active.to_bitmask(), Receivers::new(receiver));
                escaped_scalar(sources, self.light, lanes, &receivers, &directions, &mut radiance, &mut pdf);
                (scalar::from_singles(&radiance), R::from_lanes(&pdf))
            }
        }
    }
}

#[inline(never)]
fn directions(
    sources: &LightSources,
    light: u32,
    active: u32,
    receivers: &Receivers,
    towards: &mut [[f32; MAX_LANES]; 3],
) {
    let light = &sources.lights[light as usize];
    for lane in lanes_of(active) {
        let Some(direction) = light.towards(receivers.time(lane)) else { continue };
        for (column, number) in towards.iter_mut().zip(direction.as_vec3().to_array()) {
            column[lane] = number;
        }
    }
}

#[inline(never)]
fn sample_scalar(
    sources: &LightSources,
    light: u32,
    active: u32,
    receivers: &Receivers,
    u: &[[f32; MAX_LANES]; 2],
    sampling: Sampling,
    samples: &mut Samples,
) {
    for lane in lanes_of(active) {
        let u = lumbre_math::DVec2::new(f64::from(u[0][lane]), f64::from(u[1][lane]));
        let (place, time) = (receivers.place(lane), receivers.time(lane));
        let sample = match &sources.lights[light as usize] {
            Light::Environment(light) if sampling == Sampling::Mis => light.sample_beside_others(u),
            light => light.sample(&sources.entries, place.from, time, u),
        };
        if let Some(sample) = sample {
            samples.set(lane, &sample);
        }
    }
}

#[inline(never)]
fn escaped_scalar(
    sources: &LightSources,
    light: u32,
    active: u32,
    receivers: &Receivers,
    directions: &[[f32; MAX_LANES]; 3],
    radiance: &mut [[f32; MAX_LANES]; 3],
    pdf: &mut [f32; MAX_LANES],
) {
    let light = &sources.lights[light as usize];
    for lane in lanes_of(active) {
        let direction = DVec3::from(scalar::vector(directions, lane).map(f64::from)).normalize();
        let from = receivers.place(lane).from;
        pdf[lane] = match light {
            Light::Environment(light) => light.pdf_beside_others(direction) as f32,
            Light::Portal(light) => light.pdf(from, direction) as f32,
            Light::Disc(light) => light.pdf(direction) as f32,
            _ => 0.0,
        };
        for (column, number) in radiance.iter_mut().zip(light.escaped(from, direction).to_array()) {
            column[lane] = number;
        }
    }
}
