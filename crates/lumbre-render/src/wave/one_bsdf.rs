//! Any BSDF in one lane: for kinds that have no lanes.

use lumbre_math::{Vec2, Vec3};
use lumbre_shading::lanes::LaneSample;
use lumbre_shading::{Bsdf, LocalDir, Scatter};
use lumbre_simd::{Real, UInt, V3};

use crate::wave::shade::{Bsdfs, Scatters};

/// A [`Bsdf`] of any kind, in one lane.
pub(crate) struct OneBsdf<'a>(&'a Bsdf);

impl<'a> Bsdfs<f32> for &'a [Bsdf] {
    type Bsdf = OneBsdf<'a>;

    fn load(&self, at: <f32 as Real>::UInt) -> OneBsdf<'a> {
        OneBsdf(&self[at.to_lanes()[0] as usize])
    }
}

fn local(w: V3<f32>) -> LocalDir {
    LocalDir::new(Vec3::new(w.x, w.y, w.z))
}

impl Scatters<f32> for OneBsdf<'_> {
    fn eval(&self, wo: V3<f32>, wi: V3<f32>) -> (V3<f32>, f32) {
        let (wo, wi) = (local(wo), local(wi));
        let [x, y, z] = self.0.eval(wo, wi).to_array();
        (V3::new(x, y, z), self.0.pdf(wo, wi))
    }

    fn sample(&self, wo: V3<f32>, lobe: f32, u: [f32; 2]) -> LaneSample<f32> {
        let Some(sample) = self.0.sample(local(wo), lobe, Vec2::new(u[0], u[1])) else {
            return LaneSample {
                wi: V3::new(0.0, 0.0, 1.0),
                weight: V3::splat(0.0),
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
                Scatter::Delta => 1.0,
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
