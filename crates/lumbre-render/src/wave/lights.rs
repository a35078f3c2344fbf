//! The effect of solids and panes on light samples.

use lumbre_math::DVec3;
use lumbre_scene::LightSample;
use lumbre_scene::light::LightPoint;
use lumbre_scene::light::lanes::LaneLightSample;
use lumbre_shading::{Scatter, Spectrum};
use lumbre_simd::{Double, Mask, Real, UInt, V3};

use crate::transport::interior::MediumStack;
use crate::wave::shade::Shade;
use crate::wave::shadows::Pane;

#[inline(always)]
fn from_lanes<R: Real>(lanes: &[[f32; 16]; 3]) -> V3<R> {
    V3 { x: R::from_lanes(&lanes[0]), y: R::from_lanes(&lanes[1]), z: R::from_lanes(&lanes[2]) }
}

/// Light samples, lane by lane.
#[inline(always)]
fn to_samples<R: Real>(light: &LaneLightSample<R>) -> Samples {
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

/// The radiance of samples at the wavelengths of their paths, in the lanes of a mask.
#[inline(always)]
pub(crate) fn at_wavelengths<R: Real>(
    shade: &Shade<'_, '_>,
    lanes: R::Mask,
    slot: R::UInt,
    light: &LaneLightSample<R>,
) -> V3<R> {
    let V3 { x, y, z } = light.radiance;
    let mut radiance = [x.to_lanes(), y.to_lanes(), z.to_lanes()];
    colour(shade, lanes.to_bitmask(), &slot.to_lanes(), &light.source.to_lanes(), &mut radiance);
    from_lanes(&radiance)
}

#[inline(never)]
fn colour(
    shade: &Shade<'_, '_>,
    mut lanes: u32,
    slot: &[u32; 16],
    source: &[u32; 16],
    radiance: &mut [[f32; 16]; 3],
) {
    let scene = shade.setting.scene;
    while lanes != 0 {
        let lane = lanes.trailing_zeros() as usize;
        lanes &= lanes - 1;
        let id = scene.lane_lights().light_of(source[lane]);
        let colour = Spectrum::new(radiance[0][lane], radiance[1][lane], radiance[2][lane]);
        let wavelengths = &shade.slots.wavelengths[slot[lane] as usize];
        let values = scene.light_at_wavelengths(id, colour, wavelengths).to_array();
        (0..3).for_each(|k| radiance[k][lane] = values[k]);
    }
}

/// A light sample of the first lane.
#[inline(always)]
pub(crate) fn first_sample<R: Real>(light: &LaneLightSample<R>) -> LightSample {
    to_samples(light).get(0)
}

/// The solids around a path, on either side of the surface at its vertex.
fn around<'s>(shade: &Shade<'_, 's>, vertex: usize, slot: u32, crosses: bool) -> MediumStack<'s> {
    let mut around = shade.slots.interiors.get(slot as usize).cloned().unwrap_or_default();
    if let (true, Some((solid, front))) = (crosses, shade.vertices.solid(vertex)) {
        around.cross(solid, front);
    }
    around
}

/// Attenuates light samples by the solids around, in the lanes of a mask.
#[inline(always)]
pub(crate) fn pass_solids<R: Real>(
    shade: &Shade<'_, '_>,
    lanes: R::Mask,
    at: R::UInt,
    slot: R::UInt,
    crosses: R::Mask,
    light: &LaneLightSample<R>,
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
        // Light from infinity was not inside any solid.
        let Some(end) = samples.get(lane).end else { continue };
        let around = around(shade, at[lane] as usize, slot[lane], crosses >> lane & 1 == 1);
        if around.attenuates() {
            let way = end.point - shade.vertices.point(at[lane] as usize);
            let passes = around.transmittance(way.length()).to_array();
            (0..3).for_each(|k| left[k][lane] = passes[k]);
        }
    }
}

/// Records which segments go through panes: those of `some` among those of `all`, which were appended from `first` on.
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
    light: &LaneLightSample<R>,
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
