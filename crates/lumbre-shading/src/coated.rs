//! Paint under varnish: layers between which light walks at random.

use std::f32::consts::{FRAC_1_PI, PI};

use lumbre_math::random::{RandomStream, combine, hash_vec3};
use lumbre_math::{Vec2, Vec3, frame::orthonormal_basis_f32};

use crate::dielectric::{Dielectric, Ways};
use crate::diffuse::cosine_direction;
use crate::{BsdfSample, LocalDir, Scatter, Spectrum, fresnel};

/// A diffuse base under a dielectric coat, with a scattering or absorbing medium between; the same from both sides.
///
/// The light that enters the coat is found by a random walk between the layers whose random numbers are a hash of the two
/// directions: asking twice gives the same answer, and the mean over directions is right. The walk is that of Guo,
/// Hašan, Zhao, "Position-Free Monte Carlo Simulation for Arbitrary Layered BSDFs", SIGGRAPH Asia 2018, with the
/// parameters of pbrt-v4: extinction 1 per unit of thickness, also where nothing scatters; roulette from the fifth bounce.
///
/// We differ in how directions are chosen: not by a walk, but either off the coat or by the cosine law, which is about how
/// the rest leaves. So the density is known exactly, and weights are those of an estimate with multiple bounces in one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoatedDiffuse {
    /// Of the base, in [0, 1].
    pub reflectance: Spectrum,
    /// The coat's outer face: inside over outside.
    pub coat: Dielectric,
    /// Of the coat, in mean free paths, ≥ 0.
    pub thickness: f32,
    /// Henyey–Greenstein asymmetry of the medium, within (-1, 1).
    pub g: f32,
    /// Single-scattering albedo of the medium, in [0, 1].
    pub albedo: Spectrum,
    /// Bounces of a walk at most.
    pub max_depth: u32,
    /// Walks an evaluation.
    pub samples: u32,
}

/// Where a walk is, beside its height.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Layer {
    Base,
    Coat,
}

impl CoatedDiffuse {
    /// Both directions as seen from the coat's side.
    fn from_above(wo: LocalDir, wi: LocalDir) -> Option<(LocalDir, LocalDir)> {
        match (wo.cos_theta() > 0.0, wi.cos_theta() > 0.0) {
            (true, true) => Some((wo, wi)),
            (false, false) if wo.cos_theta() < 0.0 && wi.cos_theta() < 0.0 => Some((-wo, -wi)),
            _ => None,
        }
    }

    /// f · |cos θi|, without the mirror image in a smooth coat.
    pub fn eval(&self, wo: LocalDir, wi: LocalDir) -> Spectrum {
        let Some((wo, wi)) = Self::from_above(wo, wi) else { return Spectrum::BLACK };
        let mut random = RandomStream::new(combine(hash_vec3(wo.vec()), hash_vec3(wi.vec())));
        let samples = self.samples.max(1);
        let mut sum = Spectrum::BLACK;
        for _ in 0..samples {
            sum += self.walk(wo, wi, &mut random);
        }
        sum / samples as f32 + Spectrum::splat(self.coat.eval(wo, wi))
    }

    /// One estimate of what enters the coat and leaves it again, times |cos θi|.
    fn walk(&self, wo: LocalDir, wi: LocalDir, random: &mut RandomStream) -> Spectrum {
        let mut pair = || Vec2::new(random.next_f32(), random.next_f32());
        let Some(entry) = self.coat.sample_of(wo, 0.0, pair(), Ways::Transmission) else {
            return Spectrum::BLACK;
        };
        // The way out, from its end: light that comes from `wi`, once it is below the coat.
        let Some(exit) = self.coat.sample_of(wi, 0.0, pair(), Ways::Transmission) else {
            return Spectrum::BLACK;
        };
        let exit_density = density(&exit);
        let rough = exit_density.is_some();
        // Seen from its end the way carries importance, which does not gather in the denser medium.
        let exit_weight = exit.weight * (exit.eta * exit.eta) * wi.abs_cos_theta();
        let exit_cos = exit.wi.abs_cos_theta();
        let scatters = self.albedo.max_component() > 0.0;
        let transmittance = |height: f32, w: LocalDir| (-height / w.abs_cos_theta()).exp();

        let mut sum = Spectrum::BLACK;
        let mut throughput = entry.weight;
        let mut w = entry.wi;
        let mut height = self.thickness;
        for depth in 0..self.max_depth {
            let brightest = throughput.max_component();
            if depth > 3 && brightest < 0.25 {
                if random.next_f32() >= brightest {
                    break;
                }
                throughput = throughput / brightest;
            }
            let down = w.cos_theta() < 0.0;
            if scatters {
                // Free flight to the next collision: 1 - u is in (0, 1].
                let flight = -(1.0 - random.next_f32()).ln() * w.abs_cos_theta();
                let next = if down { height - flight } else { height + flight };
                if 0.0 < next && next < self.thickness {
                    height = next;
                    let to_coat = self.thickness - height;
                    let direct = henyey_greenstein(w.vec().dot(-exit.wi.vec()), self.g);
                    let share = if rough { balance(exit_density, direct) } else { 1.0 };
                    sum += throughput
                        * self.albedo
                        * exit_weight
                        * (direct * share * transmittance(to_coat, exit.wi) / exit_cos);
                    let u = Vec2::new(random.next_f32(), random.next_f32());
                    let (scattered, chosen) = sample_henyey_greenstein(w.vec(), self.g, u);
                    if scattered.cos_theta() == 0.0 {
                        break;
                    }
                    throughput *= self.albedo;
                    w = scattered;
                    if rough && w.cos_theta() > 0.0 {
                        sum += throughput * (self.leave(w, wi, chosen) * transmittance(to_coat, w));
                    }
                    continue;
                }
            } else {
                throughput *= transmittance(self.thickness, w);
            }
            let layer = if down { Layer::Base } else { Layer::Coat };
            match layer {
                Layer::Coat => {
                    height = self.thickness;
                    let u = Vec2::new(random.next_f32(), random.next_f32());
                    let Some(back) = self.coat.sample_of(-w, 0.0, u, Ways::Reflection) else { break };
                    throughput *= back.weight;
                    w = back.wi;
                }
                Layer::Base => {
                    height = 0.0;
                    let u = Vec2::new(random.next_f32(), random.next_f32());
                    throughput *= self.reflectance;
                    let share = if rough { balance(exit_density, FRAC_1_PI * exit_cos) } else { 1.0 };
                    sum += throughput
                        * exit_weight
                        * (FRAC_1_PI * share * transmittance(self.thickness, exit.wi));
                    let Some(up) = cosine_direction(u, 1.0) else { break };
                    w = up;
                    if rough {
                        let chosen = FRAC_1_PI * w.abs_cos_theta();
                        sum += throughput * (self.leave(w, wi, chosen) * transmittance(self.thickness, w));
                    }
                }
            }
            if throughput.max_component() == 0.0 {
                break;
            }
        }
        sum
    }

    /// What a walk that goes up along `w`, chosen with density `chosen`, sends out of a rough coat to `wi`, weighted
    /// against having been found from `wi`.
    fn leave(&self, w: LocalDir, wi: LocalDir, chosen: f32) -> f32 {
        let found = self.coat.pdf_of(wi, -w, Ways::Transmission);
        self.coat.eval(-w, wi) * balance(Some(chosen), found)
    }

    /// The probability of a direction off the coat.
    fn coat_probability(&self, wo: LocalDir) -> f32 {
        let coat = fresnel::dielectric(wo.abs_cos_theta(), self.coat.eta);
        let below = (1.0 - coat) * self.reflectance.max_component().max(0.5 * self.albedo.max_component());
        // A rough coat is seen from its base at any angle: neither part may starve.
        if self.coat.eta == 1.0 { 0.0 } else { (coat / (coat + below).max(1e-6)).clamp(0.1, 0.9) }
    }

    /// The density of [`CoatedDiffuse::sample`] but for its delta part.
    pub fn pdf(&self, wo: LocalDir, wi: LocalDir) -> f32 {
        let Some((wo, wi)) = Self::from_above(wo, wi) else { return 0.0 };
        let coat = self.coat_probability(wo);
        coat * self.coat.pdf_of(wo, wi, Ways::Reflection) + (1.0 - coat) * FRAC_1_PI * wi.abs_cos_theta()
    }

    /// A direction off the coat or by the cosine law.
    pub fn sample(&self, wo: LocalDir, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let above = if wo.cos_theta() < 0.0 { -wo } else { wo };
        let coat = self.coat_probability(above);
        let wi = if lobe < coat {
            let sample = self.coat.sample_of(above, 0.0, u, Ways::Reflection)?;
            if sample.scatter == Scatter::Delta {
                let wi = if wo.cos_theta() < 0.0 { -sample.wi } else { sample.wi };
                return Some(BsdfSample { wi, weight: sample.weight / coat, ..sample });
            }
            sample.wi
        } else {
            cosine_direction(u, above.cos_theta())?
        };
        let pdf = self.pdf(above, wi);
        if !(pdf > 0.0 && pdf.is_finite()) {
            return None;
        }
        Some(BsdfSample {
            weight: self.eval(above, wi) / pdf,
            wi: if wo.cos_theta() < 0.0 { -wi } else { wi },
            scatter: Scatter::Density(pdf),
            transmitted: false,
            eta: 1.0,
        })
    }

    /// A rough estimate of its albedo: the coat's reflectance at normal incidence, and the base's for the rest.
    pub fn albedo_estimate(&self) -> Spectrum {
        let coat = fresnel::dielectric(1.0, self.coat.eta);
        Spectrum::splat(coat) + self.reflectance * (1.0 - coat)
    }
}

/// The density of a sample, `None` for a delta.
fn density(sample: &BsdfSample) -> Option<f32> {
    match sample.scatter {
        Scatter::Density(pdf) => Some(pdf),
        Scatter::Delta => None,
    }
}

/// The power heuristic: the weight of a direction of density `own` that another way finds with `other`.
fn balance(own: Option<f32>, other: f32) -> f32 {
    let Some(own) = own else { return 1.0 };
    let ratio = other / own;
    1.0 / (1.0 + ratio * ratio)
}

/// The density per solid angle of scattering by the angle with this cosine: 1 goes straight on.
///
/// Henyey and Greenstein, "Diffuse Radiation in the Galaxy", Astrophysical Journal 93, 1941.
fn henyey_greenstein(cos: f32, g: f32) -> f32 {
    let d = (1.0 + g * g - 2.0 * g * cos).max(1e-12);
    (1.0 - g * g) / (4.0 * PI * d * d.sqrt())
}

/// A direction about `forward` by [`henyey_greenstein`], with its density.
fn sample_henyey_greenstein(forward: Vec3, g: f32, u: Vec2) -> (LocalDir, f32) {
    let cos = if g.abs() < 1e-3 {
        1.0 - 2.0 * u.x
    } else {
        let s = (1.0 - g * g) / (1.0 + g - 2.0 * g * u.x);
        ((1.0 + g * g - s * s) / (2.0 * g)).clamp(-1.0, 1.0)
    };
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    let (sin_phi, cos_phi) = (2.0 * PI * u.y).sin_cos();
    let (x, y) = orthonormal_basis_f32(forward);
    let w = (x * (sin * cos_phi) + y * (sin * sin_phi) + forward * cos).normalize();
    (LocalDir(w), henyey_greenstein(cos, g))
}
