//! Light samples in lanes, and what solids and panes do to them.

use lumbre_math::{DVec2, DVec3};
use lumbre_scene::light::LightPoint;
use lumbre_scene::{LightSample, Scene};
use lumbre_shading::{Scatter, Spectrum};
use lumbre_simd::{Double, Mask, Real, UInt, V3};

use crate::transport::Strategy;
use crate::transport::interior::Interiors;
use crate::wave::Setting;
use crate::wave::paths::Slots;
use crate::wave::shade::Shade;
use crate::wave::shadows::Pane;

/// A light sample in each lane: see [`LightSample`].
#[derive(Clone, Copy)]
pub(crate) struct LightLanes<R: Real> {
    /// Unit, towards the light.
    pub(crate) towards: V3<R>,
    /// Where it comes from, a bound on the error of that, and the normal there; zero where there is no surface.
    pub(crate) point: V3<R::Double>,
    pub(crate) error: V3<R::Double>,
    pub(crate) normal: V3<R>,
    /// Whether it is infinitely far away.
    pub(crate) infinite: R::Mask,
    pub(crate) radiance: V3<R>,
    pub(crate) pdf: R,
    pub(crate) delta: R::Mask,
    pub(crate) valid: R::Mask,
}

/// Samples a light for each lane.
#[inline(always)]
pub(crate) fn sample_lights<R: Real>(
    setting: &Setting<'_>,
    slots: &Slots<'_>,
    useful: R::Mask,
    slot: R::UInt,
    from: V3<R::Double>,
    u: [R; 4],
) -> LightLanes<R> {
    let from = [from.x.to_lanes(), from.y.to_lanes(), from.z.to_lanes()];
    let u = [u[0].to_lanes(), u[1].to_lanes(), u[2].to_lanes(), u[3].to_lanes()];
    let mut samples = OneByOne::default();
    samples.take(setting, slots, useful.to_bitmask(), &slot.to_lanes(), &from, &u);
    samples.lanes::<R>()
}

/// Light samples one after the other.
#[derive(Default)]
struct OneByOne {
    towards: [[f32; 16]; 3],
    point: [[f64; 16]; 3],
    error: [[f64; 16]; 3],
    normal: [[f32; 16]; 3],
    radiance: [[f32; 16]; 3],
    pdf: [f32; 16],
    infinite: u32,
    delta: u32,
    valid: u32,
}

impl OneByOne {
    #[inline(never)]
    fn take(
        &mut self,
        setting: &Setting<'_>,
        slots: &Slots<'_>,
        mut lanes: u32,
        slot: &[u32; 16],
        from: &[[f64; 16]; 3],
        u: &[[f32; 16]; 4],
    ) {
        let sample_light = match setting.strategy {
            Strategy::Lights => Scene::sample_light_alone,
            Strategy::Both | Strategy::Bsdf => Scene::sample_light,
        };
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize;
            lanes &= lanes - 1;
            let from = DVec3::new(from[0][lane], from[1][lane], from[2][lane]);
            let choice = f64::from(u[2][lane]) + f64::from(u[3][lane]) * (1.0 / 16_777_216.0);
            let point = DVec2::new(u[0][lane].into(), u[1][lane].into());
            let time = slots.camera[slot[lane] as usize].ray.time;
            if let Some(sample) = sample_light(setting.scene, from, time, choice, point) {
                self.put(lane, &sample);
            }
        }
    }

    fn put(&mut self, lane: usize, sample: &LightSample) {
        let bit = 1 << lane;
        self.valid |= bit;
        for k in 0..3 {
            self.towards[k][lane] = sample.towards[k] as f32;
            self.radiance[k][lane] = sample.radiance.to_array()[k];
        }
        match sample.end {
            None => self.infinite |= bit,
            Some(end) => {
                for k in 0..3 {
                    self.point[k][lane] = end.point[k];
                    self.error[k][lane] = end.error[k];
                    self.normal[k][lane] = end.normal[k] as f32;
                }
            }
        }
        match sample.scatter {
            Scatter::Density(pdf) => self.pdf[lane] = pdf,
            Scatter::Delta => self.delta |= bit,
        }
    }

    #[inline(always)]
    fn lanes<R: Real>(&self) -> LightLanes<R> {
        LightLanes {
            towards: from_lanes(&self.towards),
            point: from_lanes64::<R>(&self.point),
            error: from_lanes64::<R>(&self.error),
            normal: from_lanes(&self.normal),
            infinite: R::Mask::from_bitmask(self.infinite),
            radiance: from_lanes(&self.radiance),
            pdf: R::from_lanes(&self.pdf),
            delta: R::Mask::from_bitmask(self.delta),
            valid: R::Mask::from_bitmask(self.valid),
        }
    }
}

#[inline(always)]
fn from_lanes<R: Real>(lanes: &[[f32; 16]; 3]) -> V3<R> {
    V3 { x: R::from_lanes(&lanes[0]), y: R::from_lanes(&lanes[1]), z: R::from_lanes(&lanes[2]) }
}

#[inline(always)]
fn from_lanes64<R: Real>(lanes: &[[f64; 16]; 3]) -> V3<R::Double> {
    V3 {
        x: R::Double::from_lanes(&lanes[0]),
        y: R::Double::from_lanes(&lanes[1]),
        z: R::Double::from_lanes(&lanes[2]),
    }
}

/// Light samples as one lane after the other sees them.
#[inline(always)]
fn to_samples<R: Real>(light: &LightLanes<R>) -> Samples {
    Samples {
        towards: [light.towards.x.to_lanes(), light.towards.y.to_lanes(), light.towards.z.to_lanes()],
        point: [light.point.x.to_lanes(), light.point.y.to_lanes(), light.point.z.to_lanes()],
        error: [light.error.x.to_lanes(), light.error.y.to_lanes(), light.error.z.to_lanes()],
        normal: [light.normal.x.to_lanes(), light.normal.y.to_lanes(), light.normal.z.to_lanes()],
        radiance: [light.radiance.x.to_lanes(), light.radiance.y.to_lanes(), light.radiance.z.to_lanes()],
        pdf: light.pdf.to_lanes(),
        infinite: light.infinite.to_bitmask(),
        delta: light.delta.to_bitmask(),
    }
}

struct Samples {
    towards: [[f32; 16]; 3],
    point: [[f64; 16]; 3],
    error: [[f64; 16]; 3],
    normal: [[f32; 16]; 3],
    radiance: [[f32; 16]; 3],
    pdf: [f32; 16],
    infinite: u32,
    delta: u32,
}

impl Samples {
    fn get(&self, lane: usize) -> LightSample {
        let single = |v: &[[f32; 16]; 3]| DVec3::new(v[0][lane].into(), v[1][lane].into(), v[2][lane].into());
        let double = |v: &[[f64; 16]; 3]| DVec3::new(v[0][lane], v[1][lane], v[2][lane]);
        let is = |bits: u32| bits >> lane & 1 == 1;
        let end = LightPoint {
            point: double(&self.point),
            error: double(&self.error),
            normal: single(&self.normal),
        };
        LightSample {
            towards: single(&self.towards),
            end: (!is(self.infinite)).then_some(end),
            radiance: Spectrum::new(self.radiance[0][lane], self.radiance[1][lane], self.radiance[2][lane]),
            scatter: if is(self.delta) { Scatter::Delta } else { Scatter::Density(self.pdf[lane]) },
        }
    }
}

/// A light sample of the first lane.
pub(crate) fn first_sample<R: Real>(light: &LightLanes<R>) -> LightSample {
    to_samples(light).get(0)
}

/// The solids around a path on one side of the surface that it is at, or the other.
fn around<'s>(shade: &Shade<'_, 's>, path: usize, slot: u32, crosses: bool) -> Interiors<'s> {
    let mut around = shade.slots.interiors.get(slot as usize).cloned().unwrap_or_default();
    if let (true, Some(&Some((solid, front)))) = (crosses, shade.vertices.solids.get(path)) {
        around.cross(solid, front);
    }
    around
}

/// What the solids around leave of the light that arrives from samples, in the lanes of a mask.
#[inline(always)]
pub(crate) fn pass_solids<R: Real>(
    shade: &Shade<'_, '_>,
    lanes: R::Mask,
    at: R::UInt,
    slot: R::UInt,
    crosses: R::Mask,
    light: &LightLanes<R>,
    arriving: V3<R>,
) -> V3<R> {
    let samples = to_samples(light);
    let mut left = [[1.0; 16]; 3];
    let crosses = crosses.to_bitmask();
    passes(shade, lanes.to_bitmask(), &at.to_lanes(), &slot.to_lanes(), crosses, &samples, &mut left);
    arriving * from_lanes(&left)
}

#[inline(never)]
fn passes(
    shade: &Shade<'_, '_>,
    mut lanes: u32,
    at: &[u32; 16],
    slot: &[u32; 16],
    crosses: u32,
    samples: &Samples,
    left: &mut [[f32; 16]; 3],
) {
    while lanes != 0 {
        let lane = lanes.trailing_zeros() as usize;
        lanes &= lanes - 1;
        // Light from infinitely far away was not inside anything.
        let Some(end) = samples.get(lane).end else { continue };
        let around = around(shade, at[lane] as usize, slot[lane], crosses >> lane & 1 == 1);
        if around.attenuates() {
            let way = end.point - shade.vertices.point(at[lane] as usize);
            let passes = around.transmittance(way.length()).to_array();
            (0..3).for_each(|k| left[k][lane] = passes[k]);
        }
    }
}

/// Notes which segments go through panes: those of `some` among those of `all`, which were appended from `first` on.
#[inline(always)]
#[expect(clippy::too_many_arguments, reason = "lanes, as they stand in registers")]
pub(crate) fn push_panes<R: Real>(
    shade: &mut Shade<'_, '_>,
    first: usize,
    all: R::Mask,
    some: R::Mask,
    at: R::UInt,
    slot: R::UInt,
    crosses: R::Mask,
    light: &LightLanes<R>,
) {
    let samples = to_samples(light);
    let masks = [all.to_bitmask(), some.to_bitmask(), crosses.to_bitmask()];
    panes(shade, first, masks, &at.to_lanes(), &slot.to_lanes(), &samples);
}

#[inline(never)]
fn panes(
    shade: &mut Shade<'_, '_>,
    first: usize,
    [all, mut some, crosses]: [u32; 3],
    at: &[u32; 16],
    slot: &[u32; 16],
    samples: &Samples,
) {
    while some != 0 {
        let lane = some.trailing_zeros() as usize;
        some &= some - 1;
        let before = (all & ((1 << lane) - 1)).count_ones();
        let around = around(shade, at[lane] as usize, slot[lane], crosses >> lane & 1 == 1);
        let segment = first as u32 + before;
        shade.shadows.panes.push(Pane { segment, sample: samples.get(lane), around });
    }
}
