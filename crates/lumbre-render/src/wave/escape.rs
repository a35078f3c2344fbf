//! The light at infinity for rays that leave the scene, in lanes.

use lumbre_scene::light::lanes::Receiver;
use lumbre_shading::Spectrum;
use lumbre_simd::{Double, Job, Mask, Real, UInt};

use crate::wave::paths::{Paths, Slots};
use crate::wave::setting::{Found, Setting};
use crate::wave::vertices::{gather3, gather64};

/// Adds the light of one infinite light to all paths of a queue.
pub(crate) struct Escape<'a, 's> {
    pub(crate) setting: &'a Setting<'s>,
    pub(crate) slots: &'a Slots<'s>,
    pub(crate) paths: &'a Paths,
    /// Paths that left the scene, padded to a full vector.
    pub(crate) queue: &'a [u32],
    pub(crate) count: usize,
    /// Index of the infinite light.
    pub(crate) light: usize,
    pub(crate) found: &'a mut Vec<Found>,
}

impl Job for Escape<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<R: Real>(self) {
        let Self { setting, slots, paths, queue, count, light, found } = self;
        let lights = setting.scene.lane_lights();
        let mut done = 0;
        while done < count {
            let lanes = R::Mask::first(count - done);
            let at = R::UInt::from_slice(&queue[done..]);
            done += R::LANES;
            let receiver = Receiver::<R> {
                from: gather64::<R>(&paths.origin, at),
                normal: gather3(&paths.receiver_normal, at),
                time: setting
                    .moves
                    .then_some(R::Double::gather(&slots.time, R::UInt::gather(&paths.slot, at))),
            };
            let direction = gather3(&paths.direction, at);
            let (radiance, pdf) = lights.escaped(light, lanes, &receiver, direction);
            let [r, g, b] = [radiance.x.to_lanes(), radiance.y.to_lanes(), radiance.z.to_lanes()];
            let (at, pdf) = (at.to_lanes(), pdf.to_lanes());
            let mut bits = lanes.to_bitmask();
            while bits != 0 {
                let lane = bits.trailing_zeros() as usize;
                bits &= bits - 1;
                let radiance = Spectrum::new(r[lane], g[lane], b[lane]);
                found.push(Found { path: at[lane], radiance, light_pdf: pdf[lane] });
            }
        }
    }
}
