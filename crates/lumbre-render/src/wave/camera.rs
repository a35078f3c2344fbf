//! The first stage: sample positions on the film, and camera rays.

use lumbre_scene::{Pinhole, SamplerKind};
use lumbre_simd::{Double, Job, Real, UInt, V3};

use crate::transport::sampler::LaneNumbers;
use crate::wave::flat::{put3, put64};
use crate::wave::paths::{Paths, Slots, grow};

/// The random numbers that aim samples, and the resulting film points, in columns.
#[derive(Debug, Default)]
pub(crate) struct Aims {
    /// See [`crate::transport::SampleNumbers::aim`].
    numbers: [Vec<f32>; 4],
    /// In pixels.
    pub(crate) film: [Vec<f64>; 2],
}

impl Aims {
    /// The numbers of a sample.
    pub(crate) fn numbers(&self, slot: usize) -> [f32; 4] {
        [0, 1, 2, 3].map(|k| self.numbers[k][slot])
    }

    /// The numbers that choose wavelengths.
    pub(crate) fn wavelengths(&self) -> &[f32] {
        &self.numbers[3]
    }
}

/// Computes the numbers that aim samples.
pub(crate) struct AimNumbers<'a, 's> {
    pub(crate) kind: SamplerKind,
    pub(crate) slots: &'a Slots<'s>,
    pub(crate) aims: &'a mut Aims,
}

impl Job for AimNumbers<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<R: Real>(self) {
        let Self { kind, slots, aims } = self;
        aims.numbers.iter_mut().for_each(|column| grow(column, slots.len));
        aims.film.iter_mut().for_each(|column| grow(column, slots.len));
        let mut done = 0;
        while done < slots.len {
            let [p, q] = &slots.pixel;
            let pixel = [R::UInt::from_slice(&p[done..]), R::UInt::from_slice(&q[done..])];
            let numbers =
                LaneNumbers::<R> { kind, pixel, index: R::UInt::from_slice(&slots.index[done..]) }.aim();
            numbers[0].copy_to_slice(&mut aims.numbers[0][done..]);
            numbers[1].copy_to_slice(&mut aims.numbers[1][done..]);
            numbers[2].copy_to_slice(&mut aims.numbers[2][done..]);
            numbers[3].copy_to_slice(&mut aims.numbers[3][done..]);
            done += R::LANES;
        }
    }
}

/// Computes rays through the film points.
pub(crate) struct PinholeRays<'a, 's> {
    pub(crate) pinhole: &'a Pinhole,
    /// Distance of the neighbours that define footprints, in pixels; `None` for rays without.
    pub(crate) spacing: Option<f64>,
    pub(crate) film: &'a [Vec<f64>; 2],
    pub(crate) slots: &'a mut Slots<'s>,
    pub(crate) paths: &'a mut Paths,
}

impl Job for PinholeRays<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<R: Real>(self) {
        let Self { pinhole, spacing, film, slots, paths } = self;
        let len = paths.len;
        if spacing.is_some() {
            slots.neighbours.iter_mut().flatten().for_each(|column| grow(column, len));
            slots.has_neighbours = true;
        }
        let mut done = 0;
        while done < len {
            let (x, y) = (R::Double::from_slice(&film[0][done..]), R::Double::from_slice(&film[1][done..]));
            let direction: V3<R> = pinhole.directions::<R>([x, y]).to_single();
            put3::<R>(&mut paths.direction, done, direction);
            if let Some(spacing) = spacing {
                let spacing = R::Double::splat(spacing);
                let right = pinhole.directions::<R>([x + spacing, y]);
                let below = pinhole.directions::<R>([x, y + spacing]);
                let direction = direction.to_double();
                let (across, down) = (right - direction, below - direction);
                let spread = R::Double::splat(0.5) * (across.dot(across).sqrt() + down.dot(down).sqrt());
                spread.to_single().copy_to_slice(&mut paths.spread[done..]);
                put64::<R>(&mut slots.neighbours[0], done, right);
                put64::<R>(&mut slots.neighbours[1], done, below);
            }
            done += R::LANES;
        }
        let origin = pinhole.origin().to_array();
        paths.origin.iter_mut().zip(origin).for_each(|(column, x)| column[..len].fill(x));
    }
}
