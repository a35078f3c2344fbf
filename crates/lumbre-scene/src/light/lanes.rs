//! The lights of a scene over lanes: samples, densities, and the light that rays find which leave the scene.

mod scalar;

use lumbre_geometry::Ray;
use lumbre_math::DVec3;
use lumbre_simd::{MAX_LANES, Mask, Real, UInt, V3};

use self::scalar::{Receivers, Samples, doubles, lanes_of, point_of, singles, vector};
use super::Sampling;
use crate::Scene;

/// Light that arrives at a place in each lane, from a direction that a light chose. Where it is not `valid`, the rest is unspecified.
#[derive(Clone, Copy, Debug)]
pub struct LaneLightSample<R: Real> {
    /// Unit, towards the light.
    pub towards: V3<R>,
    /// Where the shadow segment ends, for what is not infinitely far away.
    pub point: V3<R::Double>,
    /// A bound on the error of each component of the point.
    pub error: V3<R::Double>,
    /// The unit normal there, on the side that shines; zero where there is no surface.
    pub normal: V3<R>,
    /// Whether it is infinitely far away.
    pub infinite: R::Mask,
    /// The radiance that arrives, if nothing stands in its way. Of a delta light, the irradiance on a surface that faces it, over the
    /// probability of the choice.
    pub radiance: V3<R>,
    /// How the direction was chosen, per unit solid angle, with the probability of the choice.
    pub pdf: R,
    /// Whether the light is a delta light, which has no density.
    pub delta: R::Mask,
    /// Whether any light arrives.
    pub valid: R::Mask,
}

/// Who is lit, in each lane.
#[derive(Clone, Copy, Debug)]
pub struct Receiver<R: Real> {
    /// The place.
    pub from: V3<R::Double>,
    /// The unit geometric normal on the side of the viewer; zero where light from every side counts: where the surface transmits, and in a
    /// medium.
    pub normal: V3<R>,
    /// The time; `None` where nothing moves.
    pub time: Option<R::Double>,
}

/// The lights of a scene, laid out for lanes.
#[derive(Clone, Debug, Default)]
pub struct LaneLights {
    infinite_count: usize,
}

impl LaneLights {
    pub(crate) fn new(infinite_count: usize) -> Self {
        Self { infinite_count }
    }

    /// A sample of light for each lane of `active`. `u` are four uniform numbers: the choice of a light, a point of it, and further digits
    /// of the choice, which one number of 24 bits has too few of for thousands of lights.
    #[inline(always)]
    pub fn sample<R: Real>(
        &self,
        scene: &Scene,
        active: R::Mask,
        receiver: &Receiver<R>,
        u: [R; 4],
        sampling: Sampling,
    ) -> LaneLightSample<R> {
        let u = [u[0].to_lanes(), u[1].to_lanes(), u[2].to_lanes(), u[3].to_lanes()];
        let mut samples = Samples::none();
        sample(scene, active.to_bitmask(), &Receivers::new(receiver), &u, sampling, &mut samples);
        samples.to_lanes()
    }

    /// The density per unit solid angle with which [`LaneLights::sample`] with [`Sampling::Mis`] would have chosen what a ray met: the point
    /// of triangle `primitive` of the geometry with the id `entry`. 0 for what it never chooses.
    #[inline(always)]
    pub fn pdf<R: Real>(
        &self,
        scene: &Scene,
        active: R::Mask,
        receiver: &Receiver<R>,
        entry: R::UInt,
        primitive: R::UInt,
        point: V3<R::Double>,
    ) -> R {
        let mut pdf = [0.0; MAX_LANES];
        let met = (entry.to_lanes(), primitive.to_lanes(), doubles::<R>(point));
        pdf_of(scene, active.to_bitmask(), &Receivers::new(receiver), &met, &mut pdf);
        R::from_lanes(&pdf)
    }

    /// The number of lights that rays meet which leave the scene.
    pub fn infinite_count(&self) -> usize {
        self.infinite_count
    }

    /// The radiance of one of the [`LaneLights::infinite_count`] infinite lights along a unit direction, and the density with which
    /// [`LaneLights::sample`] with [`Sampling::Mis`] samples that direction for a receiver.
    #[inline(always)]
    pub fn escaped<R: Real>(
        &self,
        scene: &Scene,
        position: usize,
        active: R::Mask,
        receiver: &Receiver<R>,
        direction: V3<R>,
    ) -> (V3<R>, R) {
        let (mut radiance, mut pdf) = ([[0.0; MAX_LANES]; 3], [0.0; MAX_LANES]);
        let receivers = Receivers::new(receiver);
        escaped(
            scene,
            position,
            active.to_bitmask(),
            &receivers,
            &singles(direction),
            &mut radiance,
            &mut pdf,
        );
        (scalar::from_singles(&radiance), R::from_lanes(&pdf))
    }
}

#[inline(never)]
fn sample(
    scene: &Scene,
    active: u32,
    receivers: &Receivers,
    u: &[[f32; MAX_LANES]; 4],
    sampling: Sampling,
    samples: &mut Samples,
) {
    for lane in lanes_of(active) {
        let (place, point) = (receivers.place(lane), point_of(u, lane));
        let choose = [f64::from(u[0][lane]), point.x, point.y];
        let (choice, time) = (&scene.light_choice, receivers.time(lane));
        let sample = choice.sample(&scene.lights, &scene.entries, &place, time, choose, sampling);
        if let Some(sample) = sample {
            samples.set(lane, &sample);
        }
    }
}

#[inline(never)]
fn pdf_of(
    scene: &Scene,
    active: u32,
    receivers: &Receivers,
    (entry, primitive, point): &([u32; MAX_LANES], [u32; MAX_LANES], [[f64; MAX_LANES]; 3]),
    pdf: &mut [f32; MAX_LANES],
) {
    for lane in lanes_of(active) {
        let (place, time) = (receivers.place(lane), receivers.time(lane));
        let Some(id) = scene.entries[entry[lane] as usize].light else { continue };
        let point = DVec3::from(vector(point, lane));
        let light = &scene.lights[id.0 as usize];
        let Some(surface) = light.surface_at(place.from, point, time) else { continue };
        let ray = Ray::new(place.from, (point - place.from).normalize_or_zero()).at_time(time);
        let met = Some((&surface, primitive[lane]));
        pdf[lane] = scene.light_choice.pdf(&scene.lights, id, &ray, place.normal, met) as f32;
    }
}

#[inline(never)]
fn escaped(
    scene: &Scene,
    position: usize,
    active: u32,
    receivers: &Receivers,
    direction: &[[f32; MAX_LANES]; 3],
    radiance: &mut [[f32; MAX_LANES]; 3],
    pdf: &mut [f32; MAX_LANES],
) {
    let id = scene.infinite[position];
    for lane in lanes_of(active) {
        let (place, time) = (receivers.place(lane), receivers.time(lane));
        let direction = DVec3::from(vector(direction, lane).map(f64::from)).normalize();
        let ray = Ray::new(place.from, direction).at_time(time);
        pdf[lane] = scene.light_choice.pdf(&scene.lights, id, &ray, place.normal, None) as f32;
        let found = scene.lights[id.0 as usize].escaped(direction).to_array();
        for k in 0..3 {
            radiance[k][lane] = found[k];
        }
    }
}
