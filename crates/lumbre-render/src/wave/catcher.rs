//! Ground that catches shadows, in lanes: the light that objects block from the points that samples see.

use lumbre_math::DVec3;
use lumbre_scene::light::lanes::Receiver;
use lumbre_scene::{GroundPlane, SamplerKind, Scene};
use lumbre_shading::Spectrum;
use lumbre_simd::{Double, InstructionSet, Job, Mask, Real, UInt, V3};

use crate::transport::sampler::LaneNumbers;
use crate::transport::seen::{MAX_LIGHTS, SAMPLES};
use crate::transport::{Record, Seen};
use crate::wave::paths::{PAD, Paths, Slots, grow};
use crate::wave::shadows::{Segment, Shadows};
use crate::wave::vertices::{gather3, gather64};

/// A shadow catcher for few lights, all of them distributed everywhere: the estimate of [`crate::transport::caught`],
/// with the same random numbers, for many points together.
#[derive(Debug)]
pub(crate) struct Catcher<'s> {
    scene: &'s Scene,
    ground: &'s GroundPlane,
    /// Indices for [`lumbre_scene::light::lanes::LaneLights::sample_one`].
    lights: Vec<usize>,
    instruction_set: InstructionSet,
}

/// Points on the ground that samples see.
#[derive(Debug, Default)]
pub(crate) struct Places {
    pub(crate) slots: Vec<u32>,
    points: Vec<DVec3>,
    /// Origins of the shadow rays.
    origin: [Vec<f64>; 3],
}

impl Places {
    pub(crate) fn push(&mut self, slot: usize, point: DVec3, origin: DVec3) {
        self.slots.push(slot as u32);
        self.points.push(point);
        for (column, x) in self.origin.iter_mut().zip(origin.to_array()) {
            column.push(x);
        }
    }
}

impl<'s> Catcher<'s> {
    /// The catcher of a scene; `None` without one, and if light must be followed one path at a time: from lamps, and
    /// through clear surfaces.
    pub(crate) fn of(scene: &'s Scene) -> Option<Self> {
        let is_simple = !scene.is_transmissive() && !scene.has_media();
        let ground = scene.ground().filter(|ground| ground.catcher && is_simple)?;
        let lights: Option<Vec<usize>> =
            ground.lights().iter().map(|&light| scene.lane_lights().position(light)).collect();
        let lights = lights.filter(|lights| lights.len() <= MAX_LIGHTS)?;
        Some(Self { scene, ground, lights, instruction_set: InstructionSet::detect() })
    }

    /// The ground.
    pub(crate) fn ground(&self) -> &'s GroundPlane {
        self.ground
    }

    /// What samples see at these points, in their order.
    #[expect(clippy::too_many_arguments, reason = "columns of a wave")]
    pub(crate) fn see(
        &self,
        places: &mut Places,
        slots: &Slots<'s>,
        paths: &Paths,
        shadows: &mut Shadows<'s>,
        sampler: SamplerKind,
        is_single: bool,
        lights_are_seen: bool,
        record: &mut Record,
    ) -> Vec<Seen> {
        let count = places.slots.len();
        let Some(&last) = places.slots.last() else { return Vec::new() };
        // Vector loads read beyond the last element.
        places.slots.resize(count + PAD, last);
        places.origin.iter_mut().for_each(|column| grow(column, count));
        shadows.reset(count * self.lights.len() * SAMPLES as usize);
        for sample in 0..SAMPLES {
            // The scalar code numbers the samples of all lights consecutively.
            for (k, &light) in self.lights.iter().enumerate() {
                let number = sample * self.lights.len() as u32 + k as u32;
                self.instruction_set.run(Light {
                    catcher: self,
                    places,
                    slots,
                    count,
                    sampler,
                    light,
                    number,
                    shadows,
                });
            }
        }
        record.counts.shadow += shadows.len as u64;
        shadows.search(self.scene, is_single, slots);
        let mut lost = vec![Spectrum::BLACK; slots.time.len()];
        for segment in (0..shadows.len).filter(|&segment| shadows.blocked[segment]) {
            lost[shadows.slot[segment] as usize] += shadows.contribution(segment);
        }
        let mut behind: [Vec<f32>; 3] = Default::default();
        behind.iter_mut().for_each(|column| grow(column, count));
        if lights_are_seen {
            self.instruction_set.run(Background {
                scene: self.scene,
                places,
                paths,
                count,
                behind: &mut behind,
            });
        }
        places.slots.truncate(count);
        let seen = places.slots.iter().zip(&places.points).enumerate().map(|(at, (&slot, &point))| {
            let open = self.ground.open_irradiance(point, slots.time[slot as usize]);
            let behind = Spectrum::new(behind[0][at], behind[1][at], behind[2][at]);
            Seen::of_catcher(lost[slot as usize], open, lights_are_seen, behind, record)
        });
        seen.collect()
    }
}

/// Traces a segment from each point to a sample of a light.
struct Light<'a, 's> {
    catcher: &'a Catcher<'s>,
    places: &'a Places,
    slots: &'a Slots<'s>,
    count: usize,
    sampler: SamplerKind,
    light: usize,
    /// The number of the sample among those of a point.
    number: u32,
    shadows: &'a mut Shadows<'s>,
}

impl Job for Light<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<R: Real>(self) {
        let Self { catcher, places, slots, count, sampler, light, number, shadows } = self;
        let scene = catcher.scene;
        let normal = V3::<R>::constant(catcher.ground.normal.as_vec3().to_array());
        let mut done = 0;
        while done < count {
            let lanes = R::Mask::first(count - done);
            let slot = R::UInt::from_slice(&places.slots[done..]);
            let numbers = LaneNumbers::<R> {
                kind: sampler,
                pixel: [R::UInt::gather(&slots.pixel[0], slot), R::UInt::gather(&slots.pixel[1], slot)],
                index: R::UInt::gather(&slots.index, slot),
            };
            let u = numbers.light(R::UInt::splat(number));
            let [x, y, z] = &places.origin;
            let receiver = Receiver::<R> {
                from: V3 {
                    x: R::Double::from_slice(&x[done..]),
                    y: R::Double::from_slice(&y[done..]),
                    z: R::Double::from_slice(&z[done..]),
                },
                normal,
                time: if scene.moves() { Some(R::Double::gather(&slots.time, slot)) } else { None },
            };
            let sample = scene.lane_lights().sample_one(light, lanes, &receiver, [u[0], u[1], u[3]]);
            let cosine = normal.dot(sample.towards);
            let density = R::select(sample.delta, R::one(), sample.pdf);
            let is_lit = lanes & sample.valid & R::zero().simd_lt(cosine) & R::zero().simd_lt(density);
            let share = cosine / (density * R::splat(SAMPLES as f32));
            shadows.push(
                is_lit,
                &Segment {
                    slot,
                    origin: receiver.from,
                    to_light: sample.towards.to_double(),
                    end: R::Double::splat(f64::INFINITY),
                    contribution: sample.radiance * share,
                },
            );
            done += R::LANES;
        }
    }
}

/// The light at infinity along the camera rays.
struct Background<'a> {
    scene: &'a Scene,
    places: &'a Places,
    paths: &'a Paths,
    count: usize,
    behind: &'a mut [Vec<f32>; 3],
}

impl Job for Background<'_> {
    type Output = ();

    #[inline(always)]
    fn run<R: Real>(self) {
        let Self { scene, places, paths, count, behind } = self;
        let lights = scene.lane_lights();
        let mut done = 0;
        while done < count {
            let lanes = R::Mask::first(count - done);
            // Camera rays are in the order of their samples.
            let path = R::UInt::from_slice(&places.slots[done..]);
            let direction = gather3::<R>(&paths.direction, path);
            let from = gather64::<R>(&paths.origin, path);
            let receiver = Receiver { from, normal: V3::splat(R::zero()), time: None };
            let mut sum = V3::splat(R::zero());
            let mut light = 0;
            while light < lights.infinite_count() {
                sum = sum + lights.background(light, lanes, &receiver, direction);
                light += 1;
            }
            sum.x.copy_to_slice(&mut behind[0][done..]);
            sum.y.copy_to_slice(&mut behind[1][done..]);
            sum.z.copy_to_slice(&mut behind[2][done..]);
            done += R::LANES;
        }
    }
}
