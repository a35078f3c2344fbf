//! Shadow segments between vertices and lights, with the light that they bring if unoccluded.

use lumbre_geometry::Ray;
use lumbre_kernel::RayColumns;
use lumbre_math::DVec3;
use lumbre_scene::{LightSample, Scene};
use lumbre_shading::Spectrum;
use lumbre_simd::{Double, Mask, Real, UInt, V3};

use crate::transport::Record;
use crate::transport::interior::MediumStack;
use crate::transport::through::straight_on;
use crate::wave::paths::{PAD, Slots, grow, of_column};
use crate::wave::setting::{Setting, TerminatorSegment};

/// Shadow segments, in columns.
#[derive(Debug, Default)]
pub(crate) struct Shadows<'s> {
    pub(crate) len: usize,
    pub(crate) slot: Vec<u32>,
    pub(crate) origin: [Vec<f64>; 3],
    /// To the light, or, where [`Shadows::end`] is infinite, the unit direction of one that is infinitely far away.
    pub(crate) to_light: [Vec<f64>; 3],
    /// The end of a segment, as a factor of [`Shadows::to_light`].
    pub(crate) end: Vec<f64>,
    /// What the path receives if the segment is unoccluded.
    pub(crate) contribution: [Vec<f32>; 3],
    /// The medium at the start of a segment, as [`of_column`] reads it; empty in a scene without media.
    pub(crate) medium: Vec<u32>,
    /// What must be unoccluded, too, for segments that start on a smooth surface over a face.
    pub(crate) terminator_segments: Vec<TerminatorSegment>,
    /// Segments that pass through panes.
    pub(crate) panes: Vec<Pane<'s>>,
    rays: Vec<Ray>,
    /// The direction and the end, rounded for rays in single precision.
    direction: [Vec<f32>; 3],
    t_max: Vec<f32>,
    times: Vec<f64>,
    /// Whether each segment is occluded, after the search.
    pub(crate) blocked: Vec<bool>,
}

/// A segment straight through panes.
#[derive(Clone, Debug)]
pub(crate) struct Pane<'s> {
    pub(crate) segment: u32,
    pub(crate) sample: LightSample,
    /// The solids around its start.
    pub(crate) around: MediumStack<'s>,
}

/// A segment in each lane.
#[derive(Clone, Copy)]
pub(crate) struct Segment<R: Real> {
    pub(crate) slot: R::UInt,
    pub(crate) origin: V3<R::Double>,
    pub(crate) to_light: V3<R::Double>,
    pub(crate) end: R::Double,
    pub(crate) contribution: V3<R>,
}

/// One segment: see [`Shadows`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct OneSegment {
    pub(crate) slot: u32,
    pub(crate) origin: DVec3,
    pub(crate) to_light: DVec3,
    pub(crate) end: f64,
    pub(crate) contribution: Spectrum,
    pub(crate) medium: u32,
}

/// The fraction of the distance to a point that a segment covers: allows for rounding of its direction and of `t`.
pub(crate) const NEARLY_WHOLE: f64 = 1.0 - 1.0 / (1_u64 << 40) as f64;

impl<'s> Shadows<'s> {
    /// Clears the columns and reserves `len` segments.
    pub(crate) fn reset(&mut self, len: usize) {
        self.len = 0;
        self.terminator_segments.clear();
        self.panes.clear();
        self.reserve(len);
    }

    /// Reserves `len` segments.
    pub(crate) fn reserve(&mut self, len: usize) {
        grow(&mut self.slot, len);
        let f64s = self.origin.iter_mut().chain(&mut self.to_light).chain([&mut self.end]);
        f64s.for_each(|column| grow(column, len));
        let f32s = self.contribution.iter_mut().chain(&mut self.direction).chain([&mut self.t_max]);
        f32s.for_each(|column| grow(column, len));
        grow(&mut self.medium, len);
    }

    /// Number of segments that are reserved.
    pub(crate) fn capacity(&self) -> usize {
        self.slot.len().saturating_sub(PAD)
    }

    /// Appends a segment; the columns must have been reserved.
    pub(crate) fn push_one(&mut self, segment: &OneSegment) {
        let at = self.len;
        self.len += 1;
        self.slot[at] = segment.slot;
        for axis in 0..3 {
            self.origin[axis][at] = segment.origin[axis];
            self.to_light[axis][at] = segment.to_light[axis];
            self.direction[axis][at] = segment.to_light[axis] as f32;
            self.contribution[axis][at] = segment.contribution[axis];
        }
        (self.end[at], self.t_max[at]) = (segment.end, segment.end as f32);
        self.medium[at] = segment.medium;
    }

    /// Appends the lanes of a mask.
    #[inline(always)]
    pub(crate) fn push<R: Real>(&mut self, mask: R::Mask, segment: &Segment<R>) {
        let to = self.len;
        segment.slot.compress_store(mask, &mut self.slot[to..]);
        segment.origin.x.compress_store(mask, &mut self.origin[0][to..]);
        segment.origin.y.compress_store(mask, &mut self.origin[1][to..]);
        segment.origin.z.compress_store(mask, &mut self.origin[2][to..]);
        segment.to_light.x.compress_store(mask, &mut self.to_light[0][to..]);
        segment.to_light.y.compress_store(mask, &mut self.to_light[1][to..]);
        segment.to_light.z.compress_store(mask, &mut self.to_light[2][to..]);
        segment.end.compress_store(mask, &mut self.end[to..]);
        let direction: V3<R> = segment.to_light.to_single();
        direction.x.compress_store(mask, &mut self.direction[0][to..]);
        direction.y.compress_store(mask, &mut self.direction[1][to..]);
        direction.z.compress_store(mask, &mut self.direction[2][to..]);
        segment.end.to_single().compress_store(mask, &mut self.t_max[to..]);
        segment.contribution.x.compress_store(mask, &mut self.contribution[0][to..]);
        segment.contribution.y.compress_store(mask, &mut self.contribution[1][to..]);
        segment.contribution.z.compress_store(mask, &mut self.contribution[2][to..]);
        self.len += mask.count();
    }

    /// What a segment brings if unoccluded.
    pub(crate) fn contribution(&self, segment: usize) -> Spectrum {
        Spectrum::new(
            self.contribution[0][segment],
            self.contribution[1][segment],
            self.contribution[2][segment],
        )
    }

    /// The ray along a segment.
    pub(crate) fn ray(&self, segment: usize, time: f64) -> Ray {
        let at = |columns: &[Vec<f64>; 3]| {
            DVec3::new(columns[0][segment], columns[1][segment], columns[2][segment])
        };
        Ray::new(at(&self.origin), at(&self.to_light)).with_range(0.0, self.end[segment]).at_time(time)
    }

    /// Adds to each path the light that arrives, and reports the unoccluded share of each segment.
    pub(crate) fn resolve(
        &mut self,
        setting: &Setting<'s>,
        is_single: bool,
        slots: &mut Slots<'_>,
        record: &mut Record,
        mut resolved: impl FnMut(usize, Spectrum),
    ) {
        let scene = setting.scene;
        record.counts.shadow += (self.len - self.panes.len()) as u64;
        self.search(scene, is_single, slots);
        for &TerminatorSegment { ray: segment, from } in &self.terminator_segments {
            let segment = segment as usize;
            if !self.blocked[segment] {
                let ray = self.ray(segment, slots.time[self.slot[segment] as usize]);
                let before = Ray::new(from, ray.origin - from).with_range(0.0, 1.0).at_time(ray.time);
                record.counts.shadow += 1;
                self.blocked[segment] = scene.is_occluded(&before);
            }
        }
        let mut panes = std::mem::take(&mut self.panes);
        let mut next_panes = panes.iter_mut().peekable();
        for i in 0..self.len {
            let mut passes = if self.blocked[i] { Spectrum::BLACK } else { Spectrum::WHITE };
            if let Some(pane) = next_panes.next_if(|pane| pane.segment as usize == i) {
                let ray = self.ray(i, slots.time[self.slot[i] as usize]);
                passes = straight_on(
                    scene,
                    ray,
                    &pane.sample,
                    std::mem::take(&mut pane.around),
                    setting.regularize,
                    slots.is_alone.get(self.slot[i] as usize).is_some_and(|&alone| alone),
                    record,
                );
            }
            if setting.has_media && !passes.is_black() {
                let slot = self.slot[i] as usize;
                let ray = self.ray(i, slots.time[slot]);
                let seed = slots.numbers(slot).along(&ray);
                let wavelengths = slots.wavelengths.get(slot);
                passes *= scene.transmittance(of_column(self.medium[i]), &ray, seed, wavelengths);
            }
            if !passes.is_black() {
                slots.radiance[self.slot[i] as usize] += self.contribution(i) * passes;
            }
            resolved(i, passes);
        }
        self.panes = panes;
    }

    /// Tests whether each segment is occluded.
    pub(crate) fn search(&mut self, scene: &Scene, is_single: bool, slots: &Slots<'_>) {
        let len = self.len;
        let time = |slot: &u32| slots.time[*slot as usize];
        if !is_single {
            let mut rays = std::mem::take(&mut self.rays);
            rays.clear();
            rays.extend((0..len).map(|i| self.ray(i, time(&self.slot[i]))));
            self.blocked.clear();
            self.blocked.resize(len, false);
            scene.occluded_batch(&rays, &mut self.blocked);
            self.rays = rays;
            return;
        }
        self.times.clear();
        if scene.moves() {
            self.times.extend(self.slot[..len].iter().map(time));
        }
        let rays = RayColumns {
            origin: self.origin.each_ref().map(|column| &column[..len]),
            direction: self.direction.each_ref().map(|column| &column[..len]),
            t_max: Some(&self.t_max[..len]),
            time: scene.moves().then_some(&self.times),
        };
        scene.accel().any_columns(&rays, false, &mut self.blocked);
        if scene.has_cutouts() {
            self.pass_through(scene, slots);
        }
    }

    /// Tests segments again that are occluded, perhaps by cut-outs alone.
    fn pass_through(&mut self, scene: &Scene, slots: &Slots<'_>) {
        for segment in 0..self.len {
            if self.blocked[segment] {
                let ray = self.ray(segment, slots.time[self.slot[segment] as usize]);
                self.blocked[segment] = scene.is_occluded(&ray);
            }
        }
    }
}
