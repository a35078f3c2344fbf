//! The lights of a scene in lanes: samples, densities, and the light that escaping rays find.

mod elsewhere;
mod environment;
mod piece;
mod point;
mod sample;
mod scalar;
mod table;
mod tree;

use std::sync::Arc;

use lumbre_geometry::Ray;
use lumbre_math::DVec3;
use lumbre_simd::{MAX_LANES, Mask, Real, Task, UInt, V3};

use self::elsewhere::LaneElsewhere;
pub(crate) use self::environment::LaneMaps;
use self::sample::below_one;
pub use self::sample::{LaneLightSample, Receiver};
use self::scalar::{Receivers, Samples, doubles, lanes_of, point_of, vector};
use self::table::{NONE, Table, kind};
use self::tree::LanePlace;
use super::{Light, LightSources, Sampling};
use crate::LightId;

/// The lights of a scene, laid out for lanes.
///
/// Uniformly emissive triangles and rectangles, point, spot and directional lights, uniform light and environment maps
/// are sampled in lanes, and so is the choice among all lights. Other lights are sampled by the code of
/// [`crate::Scene::sample_light`], lane by lane.
#[derive(Clone, Debug, Default)]
pub struct LaneLights {
    sources: Arc<LightSources>,
    table: Table,
    elsewhere: Vec<LaneElsewhere>,
    /// The probability of lights that are everywhere, if others may contribute.
    share_elsewhere: f32,
    /// The infinite lights, as indices in `elsewhere`.
    infinite: Vec<u32>,
}

/// The bit of a source that marks an index among the lights that are everywhere; without it, the source is an emitter.
const ELSEWHERE: u32 = 1 << 31;

/// The spacing of uniform numbers.
const STEP: f32 = 1.0 / 16_777_216.0;

impl LaneLights {
    pub(crate) fn new(sources: &Arc<LightSources>, infinite: &[LightId]) -> Self {
        let LightSources { lights, entries, choice } = &**sources;
        let elsewhere = LaneElsewhere::all(lights, choice);
        let position = |id: &LightId| elsewhere.iter().position(|light| light.light == id.0);
        let infinite = infinite.iter().filter_map(position).map(|position| position as u32).collect();
        Self {
            table: Table::new(lights, entries, choice),
            share_elsewhere: choice.share_elsewhere as f32,
            infinite,
            elsewhere,
            sources: Arc::clone(sources),
        }
    }

    /// A sample of light for each lane of `active`. `u` are four uniform numbers: the choice of a light, a point of it,
    /// and further digits of the choice, because 24 bits are too few for thousands of lights.
    #[inline(always)]
    pub fn sample<R: Real>(
        &self,
        active: R::Mask,
        receiver: &Receiver<R>,
        u: [R; 4],
        sampling: Sampling,
    ) -> LaneLightSample<R> {
        R::call(SampleTask { lights: self, active, receiver, u, sampling })
    }

    #[inline(always)]
    fn sample_inlined<R: Real>(
        &self,
        active: R::Mask,
        receiver: &Receiver<R>,
        u: [R; 4],
        sampling: Sampling,
    ) -> LaneLightSample<R> {
        let place = LanePlace::new(&self.table, receiver);
        let sum = self.sum_elsewhere(active, &place, receiver);
        let share = self.share_elsewhere_at(active, &place, sum);
        let is_elsewhere = active & u[0].simd_lt(share);
        let mut sample = LaneLightSample::none();
        if is_elsewhere.any() {
            let chosen = self.choose_elsewhere(is_elsewhere, &place, receiver, u[0] / share * sum);
            let probability = share * (chosen.1 / sum);
            let mut position = 0;
            while position < self.elsewhere.len() {
                let here = is_elsewhere & chosen.0.simd_eq(R::UInt::splat(position as u32));
                if here.any() {
                    let light = &self.elsewhere[position];
                    let of_light = light.sample(&self.sources, here, receiver, [u[1], u[2], u[3]], sampling);
                    let source = R::UInt::splat(ELSEWHERE | position as u32);
                    sample = sample.with(here, of_light, probability, source);
                }
                position += 1;
            }
        }
        let in_tree = active & !is_elsewhere;
        if in_tree.any() && !self.table.next.is_empty() {
            let rest = (R::one() - share).recip();
            let choose = ((u[0] - share) * rest).simd_max(R::zero()).simd_min(below_one());
            let step = R::splat(STEP) * rest;
            let chosen = tree::choose(&self.table, in_tree, &place, choose, step, u[3]);
            let probability = (R::one() - share) * chosen.probability;
            let kinds = R::UInt::gather(&self.table.kinds, chosen.emitter);
            let pieces = chosen.valid & kinds.simd_eq(R::UInt::splat(kind::PIECE));
            if pieces.any() {
                let of_piece =
                    piece::sample(&self.table, pieces, chosen.emitter, receiver.from, [u[1], u[2]]);
                sample = sample.with(pieces, of_piece, probability, chosen.emitter);
            }
            let points = chosen.valid & kinds.simd_eq(R::UInt::splat(kind::POINT));
            if points.any() {
                let of_point = point::sample(&self.table, points, chosen.emitter, receiver.from);
                sample = sample.with(points, of_point, probability, chosen.emitter);
            }
            let others = chosen.valid & kinds.simd_eq(R::UInt::splat(kind::SCALAR));
            if others.any() {
                let u = [u[0].to_lanes(), u[1].to_lanes(), u[2].to_lanes(), u[3].to_lanes()];
                let mut samples = Samples::none();
                let receivers = Receivers::new(receiver);
                let emitters = chosen.emitter.to_lanes();
                sample_emitters(&self.sources, others.to_bitmask(), &emitters, &receivers, &u, &mut samples);
                sample = sample.with(others, samples.to_lanes(), probability, chosen.emitter);
            }
        }
        sample
    }

    /// The light of a sample by its [`LaneLightSample::source`].
    pub fn light_of(&self, source: u32) -> LightId {
        LightId(match source & ELSEWHERE {
            0 => self.sources.choice.emitters[source as usize].0,
            _ => self.elsewhere[(source & !ELSEWHERE) as usize].light,
        })
    }

    /// One of the [`LaneLights::infinite_count`] infinite lights.
    pub fn infinite_light(&self, position: usize) -> LightId {
        LightId(self.elsewhere[self.infinite[position] as usize].light)
    }

    /// The index of a light that is everywhere, for [`LaneLights::sample_one`]; `None` for other lights.
    pub fn position(&self, light: LightId) -> Option<usize> {
        self.elsewhere.iter().position(|elsewhere| elsewhere.light == light.0)
    }

    /// A sample of one light that is everywhere, for code that finds light in no other way: as
    /// [`crate::Scene::sample_one_light`]. `u` is a point of it, and further digits of the first coordinate.
    #[inline(always)]
    pub fn sample_one<R: Real>(
        &self,
        position: usize,
        active: R::Mask,
        receiver: &Receiver<R>,
        u: [R; 3],
    ) -> LaneLightSample<R> {
        self.elsewhere[position].sample(&self.sources, active, receiver, u, Sampling::LightsOnly)
    }

    /// The density per unit solid angle with which [`LaneLights::sample`] with [`Sampling::Mis`] would have sampled a
    /// ray's hit: the point of triangle `primitive` of the geometry with the id `entry`. 0 if it never would.
    #[inline(always)]
    pub fn pdf<R: Real>(
        &self,
        active: R::Mask,
        receiver: &Receiver<R>,
        entry: R::UInt,
        primitive: R::UInt,
        point: V3<R::Double>,
    ) -> R {
        let emitter = self.table.emitter::<R>(active, entry, primitive);
        let listed = active & !emitter.simd_eq(R::UInt::splat(NONE));
        if listed.none() {
            return R::zero();
        }
        let emitter = R::UInt::select(listed, emitter, R::UInt::splat(0));
        R::call(PdfTask { lights: self, listed, receiver, emitter, primitive, point })
    }

    /// The density of a point of an emitter in each listed lane.
    #[inline(always)]
    fn pdf_inlined<R: Real>(
        &self,
        listed: R::Mask,
        receiver: &Receiver<R>,
        emitter: R::UInt,
        primitive: R::UInt,
        point: V3<R::Double>,
    ) -> R {
        let place = LanePlace::new(&self.table, receiver);
        let sum = self.sum_elsewhere(listed, &place, receiver);
        let share = self.share_elsewhere_at(listed, &place, sum);
        let probability = (R::one() - share) * tree::probability(&self.table, listed, &place, emitter);
        let kinds = R::UInt::gather(&self.table.kinds, emitter);
        let mut pdf = R::zero();
        let pieces = listed & kinds.simd_eq(R::UInt::splat(kind::PIECE));
        if pieces.any() {
            pdf = piece::pdf(&self.table, pieces, emitter, receiver.from, point);
        }
        let others = listed & kinds.simd_eq(R::UInt::splat(kind::SCALAR));
        if others.any() {
            let mut of_others = [0.0; MAX_LANES];
            let met = (emitter.to_lanes(), primitive.to_lanes(), doubles::<R>(point));
            pdf_of_emitters(
                &self.sources,
                others.to_bitmask(),
                &Receivers::new(receiver),
                &met,
                &mut of_others,
            );
            pdf = R::select(others, R::from_lanes(&of_others), pdf);
        }
        (probability * pdf).or_zero(listed)
    }

    /// The number of lights that escaping rays hit.
    pub fn infinite_count(&self) -> usize {
        self.infinite.len()
    }

    /// The radiance of one of the [`LaneLights::infinite_count`] infinite lights along a unit direction from a
    /// receiver.
    #[inline(always)]
    pub fn background<R: Real>(
        &self,
        position: usize,
        active: R::Mask,
        receiver: &Receiver<R>,
        direction: V3<R>,
    ) -> V3<R> {
        self.elsewhere[self.infinite[position] as usize].escaped(&self.sources, active, receiver, direction).0
    }

    /// The radiance of one of the [`LaneLights::infinite_count`] infinite lights along a unit direction, and the
    /// density with which [`LaneLights::sample`] with [`Sampling::Mis`] samples that direction for a receiver.
    #[inline(always)]
    pub fn escaped<R: Real>(
        &self,
        position: usize,
        active: R::Mask,
        receiver: &Receiver<R>,
        direction: V3<R>,
    ) -> (V3<R>, R) {
        R::call(EscapeTask { lights: self, position, active, receiver, direction })
    }

    #[inline(always)]
    fn escaped_inlined<R: Real>(
        &self,
        position: usize,
        active: R::Mask,
        receiver: &Receiver<R>,
        direction: V3<R>,
    ) -> (V3<R>, R) {
        let light = &self.elsewhere[self.infinite[position] as usize];
        let (radiance, pdf) = light.escaped(&self.sources, active, receiver, direction);
        let place = LanePlace::new(&self.table, receiver);
        let sum = self.sum_elsewhere(active, &place, receiver);
        let share = self.share_elsewhere_at(active, &place, sum);
        let given = light.given(&self.sources, active, &place, receiver);
        let probability = (share * (given / sum)).or_zero(given.simd_gt(R::zero()));
        (radiance, probability * pdf)
    }

    /// The contribution of all lights that are everywhere at a point, in arbitrary units.
    #[inline(always)]
    fn sum_elsewhere<R: Real>(&self, active: R::Mask, place: &LanePlace<R>, receiver: &Receiver<R>) -> R {
        let mut sum = R::zero();
        for light in &self.elsewhere {
            sum = sum + light.given(&self.sources, active, place, receiver);
        }
        sum
    }

    /// The probability of the lights that are everywhere at a point where their contributions add up to `sum`.
    #[inline(always)]
    fn share_elsewhere_at<R: Real>(&self, active: R::Mask, place: &LanePlace<R>, sum: R) -> R {
        let share = R::splat(self.share_elsewhere).or_zero(sum.simd_gt(R::zero()));
        if self.share_elsewhere <= 0.0 || self.share_elsewhere >= 1.0 {
            return share;
        }
        let others_shine = tree::shines_on(&self.table, active, place);
        R::select(others_shine | share.simd_eq(R::zero()), share, R::one())
    }

    /// The index of the light at which the running sum of contributions passes `up_to`, and its own contribution.
    #[inline(always)]
    fn choose_elsewhere<R: Real>(
        &self,
        active: R::Mask,
        place: &LanePlace<R>,
        receiver: &Receiver<R>,
        up_to: R,
    ) -> (R::UInt, R) {
        let (mut before, mut chosen, mut of_chosen) = (R::zero(), R::UInt::splat(0), R::zero());
        for (position, light) in self.elsewhere.iter().enumerate() {
            let given = light.given(&self.sources, active, place, receiver);
            // The last one that starts before it.
            let is_later = given.simd_gt(R::zero()) & before.simd_le(up_to);
            chosen = R::UInt::select(is_later, R::UInt::splat(position as u32), chosen);
            of_chosen = R::select(is_later, given, of_chosen);
            before = before + given;
        }
        (chosen, of_chosen)
    }
}

struct SampleTask<'t, R: Real> {
    lights: &'t LaneLights,
    active: R::Mask,
    receiver: &'t Receiver<R>,
    u: [R; 4],
    sampling: Sampling,
}

impl<R: Real> Task<R> for SampleTask<'_, R> {
    type Output = LaneLightSample<R>;

    #[inline(always)]
    fn run(self) -> LaneLightSample<R> {
        let Self { lights, active, receiver, u, sampling } = self;
        lights.sample_inlined(active, receiver, u, sampling)
    }
}

struct PdfTask<'t, R: Real> {
    lights: &'t LaneLights,
    listed: R::Mask,
    receiver: &'t Receiver<R>,
    emitter: R::UInt,
    primitive: R::UInt,
    point: V3<R::Double>,
}

impl<R: Real> Task<R> for PdfTask<'_, R> {
    type Output = R;

    #[inline(always)]
    fn run(self) -> R {
        let Self { lights, listed, receiver, emitter, primitive, point } = self;
        lights.pdf_inlined(listed, receiver, emitter, primitive, point)
    }
}

struct EscapeTask<'t, R: Real> {
    lights: &'t LaneLights,
    position: usize,
    active: R::Mask,
    receiver: &'t Receiver<R>,
    direction: V3<R>,
}

impl<R: Real> Task<R> for EscapeTask<'_, R> {
    type Output = (V3<R>, R);

    #[inline(always)]
    fn run(self) -> (V3<R>, R) {
        let Self { lights, position, active, receiver, direction } = self;
        lights.escaped_inlined(position, active, receiver, direction)
    }
}

#[inline(never)]
fn sample_emitters(
    sources: &LightSources,
    active: u32,
    emitters: &[u32; MAX_LANES],
    receivers: &Receivers,
    u: &[[f32; MAX_LANES]; 4],
    samples: &mut Samples,
) {
    for lane in lanes_of(active) {
        let (place, time) = (receivers.place(lane), receivers.time(lane));
        let emitter = emitters[lane] as usize;
        let u = point_of(u, lane);
        let LightSources { lights, entries, choice } = sources;
        let sample = choice.sample_emitter(lights, entries, emitter, place.from, time, u);
        if let Some(sample) = sample {
            samples.set(lane, &sample);
        }
    }
}

#[inline(never)]
fn pdf_of_emitters(
    sources: &LightSources,
    active: u32,
    receivers: &Receivers,
    (emitter, primitive, point): &([u32; MAX_LANES], [u32; MAX_LANES], [[f64; MAX_LANES]; 3]),
    pdf: &mut [f32; MAX_LANES],
) {
    for lane in lanes_of(active) {
        let (place, time) = (receivers.place(lane), receivers.time(lane));
        let (light, piece) = sources.choice.emitters[emitter[lane] as usize];
        let light = &sources.lights[light as usize];
        let point = DVec3::from(vector(point, lane));
        if let (Light::Mesh(light), Some(piece)) = (light, piece) {
            pdf[lane] = light.piece_pdf(place.from, point, piece) as f32;
            continue;
        }
        let Some(surface) = light.surface_at(place.from, point, time) else { continue };
        let ray = Ray::new(place.from, (point - place.from).normalize_or_zero()).at_time(time);
        pdf[lane] = light.pdf(&ray, Some((&surface, primitive[lane]))) as f32;
    }
}
