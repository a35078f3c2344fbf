//! Lights without lanes: one lane after the other, by scalar code.

use lumbre_math::{DVec2, DVec3};
use lumbre_shading::Scatter;
use lumbre_simd::{Double, MAX_LANES, Mask, Real, UInt, V3};

use super::sample::{LaneLightSample, Receiver};
use crate::light::{LightSample, Place};

/// A receiver, lane by lane.
pub(super) struct Receivers {
    from: [[f64; MAX_LANES]; 3],
    normal: [[f32; MAX_LANES]; 3],
    time: Option<[f64; MAX_LANES]>,
}

impl Receivers {
    #[inline(always)]
    pub(super) fn new<R: Real>(receiver: &Receiver<R>) -> Self {
        let mut time = None;
        // No closures: they do not inherit target features.
        if let Some(at) = receiver.time {
            time = Some(at.to_lanes());
        }
        Self { from: doubles::<R>(receiver.from), normal: singles(receiver.normal), time }
    }

    pub(super) fn place(&self, lane: usize) -> Place {
        let normal = vector(&self.normal, lane).map(f64::from);
        Place { from: DVec3::from(vector(&self.from, lane)), normal: DVec3::from(normal).normalize_or_zero() }
    }

    pub(super) fn time(&self, lane: usize) -> f64 {
        self.time.map_or(0.0, |time| time[lane])
    }
}

/// Samples, lane by lane.
pub(super) struct Samples {
    towards: [[f32; MAX_LANES]; 3],
    point: [[f64; MAX_LANES]; 3],
    error: [[f64; MAX_LANES]; 3],
    normal: [[f32; MAX_LANES]; 3],
    radiance: [[f32; MAX_LANES]; 3],
    pdf: [f32; MAX_LANES],
    infinite: u32,
    delta: u32,
    valid: u32,
}

impl Samples {
    pub(super) fn none() -> Self {
        let (none, nowhere) = ([[0.0; MAX_LANES]; 3], [[0.0; MAX_LANES]; 3]);
        Self {
            towards: none,
            point: nowhere,
            error: nowhere,
            normal: none,
            radiance: none,
            pdf: [0.0; MAX_LANES],
            infinite: 0,
            delta: 0,
            valid: 0,
        }
    }

    pub(super) fn set(&mut self, lane: usize, sample: &LightSample) {
        let set = |to: &mut [[f32; MAX_LANES]; 3], from: [f32; 3]| {
            for k in 0..3 {
                to[k][lane] = from[k];
            }
        };
        set(&mut self.towards, sample.towards.as_vec3().to_array());
        set(&mut self.radiance, sample.radiance.to_array());
        match &sample.end {
            None => self.infinite |= 1 << lane,
            Some(end) => {
                set(&mut self.normal, end.normal.as_vec3().to_array());
                for k in 0..3 {
                    self.point[k][lane] = end.point[k];
                    self.error[k][lane] = end.error[k];
                }
            }
        }
        match sample.scatter {
            Scatter::Delta => self.delta |= 1 << lane,
            Scatter::Density(pdf) => self.pdf[lane] = pdf,
        }
        self.valid |= 1 << lane;
    }

    #[inline(always)]
    pub(super) fn to_lanes<R: Real>(&self) -> LaneLightSample<R> {
        LaneLightSample {
            towards: from_singles(&self.towards),
            point: from_doubles::<R>(&self.point),
            error: from_doubles::<R>(&self.error),
            normal: from_singles(&self.normal),
            infinite: R::Mask::from_bitmask(self.infinite),
            radiance: from_singles(&self.radiance),
            pdf: R::from_lanes(&self.pdf),
            delta: R::Mask::from_bitmask(self.delta),
            valid: R::Mask::from_bitmask(self.valid),
            source: R::UInt::splat(0),
        }
    }
}

/// The lanes of a mask, in order.
pub(super) fn lanes_of(mask: u32) -> impl Iterator<Item = usize> {
    (0..MAX_LANES).filter(move |lane| mask >> lane & 1 == 1)
}

pub(super) fn vector<T: Copy>(columns: &[[T; MAX_LANES]; 3], lane: usize) -> [T; 3] {
    [columns[0][lane], columns[1][lane], columns[2][lane]]
}

pub(super) fn point_of(u: &[[f32; MAX_LANES]; 4], lane: usize) -> DVec2 {
    DVec2::new(f64::from(u[1][lane]), f64::from(u[2][lane]))
}

#[inline(always)]
pub(super) fn singles<R: Real>(v: V3<R>) -> [[f32; MAX_LANES]; 3] {
    [v.x.to_lanes(), v.y.to_lanes(), v.z.to_lanes()]
}

#[inline(always)]
pub(super) fn doubles<R: Real>(v: V3<R::Double>) -> [[f64; MAX_LANES]; 3] {
    [v.x.to_lanes(), v.y.to_lanes(), v.z.to_lanes()]
}

#[inline(always)]
pub(super) fn from_singles<R: Real>(v: &[[f32; MAX_LANES]; 3]) -> V3<R> {
    V3::new(R::from_lanes(&v[0]), R::from_lanes(&v[1]), R::from_lanes(&v[2]))
}

#[inline(always)]
pub(super) fn from_doubles<R: Real>(v: &[[f64; MAX_LANES]; 3]) -> V3<R::Double> {
    V3::new(R::Double::from_lanes(&v[0]), R::Double::from_lanes(&v[1]), R::Double::from_lanes(&v[2]))
}
