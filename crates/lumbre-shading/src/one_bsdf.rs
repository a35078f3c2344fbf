//! Any BSDF in one lane.

use lumbre_math::{Vec2, Vec3};
use lumbre_simd::V3;

use crate::lanes::{LaneBsdf, LaneSample};
use crate::{Bsdf, LocalDir, Scatter};

/// A [`Bsdf`] of any kind, in one lane.
#[derive(Clone, Copy, Debug)]
pub struct OneBsdf<'a>(pub &'a Bsdf);

fn local(w: V3<f32>) -> LocalDir {
    LocalDir(Vec3::new(w.x, w.y, w.z))
}

impl LaneBsdf<f32> for OneBsdf<'_> {
    fn eval(&self, wo: V3<f32>, wi: V3<f32>) -> (V3<f32>, f32) {
        let (wo, wi) = (local(wo), local(wi));
        let [x, y, z] = self.0.eval(wo, wi).to_array();
        (V3::new(x, y, z), self.0.pdf(wo, wi))
    }

    fn sample(&self, wo: V3<f32>, lobe: f32, u: [f32; 2]) -> LaneSample<f32> {
        let Some(sample) = self.0.sample(local(wo), lobe, Vec2::new(u[0], u[1])) else {
            let nothing = V3::splat(0.0);
            let up = V3::new(0.0, 0.0, 1.0);
            return LaneSample {
                wi: up,
                weight: nothing,
                pdf: 0.0,
                valid: false,
                delta: false,
                transmitted: false,
                eta: 1.0,
            };
        };
        let (wi, [x, y, z]) = (sample.wi.vec(), sample.weight.to_array());
        LaneSample {
            wi: V3::new(wi.x, wi.y, wi.z),
            weight: V3::new(x, y, z),
            pdf: match sample.scatter {
                Scatter::Density(pdf) => pdf,
                Scatter::Delta => 0.0,
            },
            valid: true,
            delta: sample.scatter == Scatter::Delta,
            transmitted: sample.transmitted,
            eta: sample.eta,
        }
    }

    fn is_delta(&self) -> bool {
        self.0.is_delta()
    }
}
