//! Paint or metal under varnish: layers between which light walks at random.

use std::f32::consts::FRAC_1_PI;

use lumbre_math::random::{RandomStream, combine, hash_vec3};
use lumbre_math::{Vec2, Vec3};

use crate::conductor::Conductor;
use crate::dielectric::{Dielectric, Ways, refract};
use crate::diffuse::{Diffuse, cosine_direction};
use crate::medium::{henyey_greenstein, sample_henyey_greenstein};
use crate::microfacet::Microfacets;
use crate::{BsdfSample, LocalDir, Scatter, Spectrum, fresnel};

/// A dielectric coat with a scattering or absorbing medium below it.
///
/// The light that enters it is found by a random walk between its face and the base whose random numbers are a hash of
/// the two directions: asking twice gives the same answer, and the mean over directions is right. The walk is that of
/// Guo, Hašan, Zhao, "Position-Free Monte Carlo Simulation for Arbitrary Layered BSDFs", SIGGRAPH Asia 2018, with the
/// parameters of pbrt-v4: extinction 1 per unit of thickness, also where nothing scatters; roulette from the fifth bounce.
///
/// We differ in how directions are chosen: not by a walk, but off one of a few lobes of known density. So weights,
/// densities and values agree exactly, and each weight is that of an estimate with multiple bounces in one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coat {
    /// The outer face: inside over outside.
    pub face: Dielectric,
    /// In mean free paths, ≥ 0.
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

/// A diffuse base under a coat; the same from both sides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoatedDiffuse {
    /// The paint.
    pub base: Diffuse,
    /// The varnish.
    pub coat: Coat,
}

/// A metal under a coat; the same from both sides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoatedConductor {
    /// The metal, its index of refraction relative to the coat's.
    pub base: Conductor,
    /// The varnish.
    pub coat: Coat,
}

/// What lies under a coat; all directions above it.
trait Base {
    /// f · |cos θi|.
    fn eval(&self, wo: LocalDir, wi: LocalDir) -> Spectrum;
    fn pdf(&self, wo: LocalDir, wi: LocalDir) -> f32;
    fn sample(&self, wo: LocalDir, u: Vec2) -> Option<BsdfSample>;
    fn is_delta(&self) -> bool;
}

impl Base for Diffuse {
    fn eval(&self, wo: LocalDir, wi: LocalDir) -> Spectrum {
        self.eval(wo, wi)
    }

    fn pdf(&self, wo: LocalDir, wi: LocalDir) -> f32 {
        self.pdf(wo, wi)
    }

    fn sample(&self, wo: LocalDir, u: Vec2) -> Option<BsdfSample> {
        self.sample(wo, u)
    }

    fn is_delta(&self) -> bool {
        false
    }
}

impl Base for Conductor {
    fn eval(&self, wo: LocalDir, wi: LocalDir) -> Spectrum {
        self.eval(wo, wi)
    }

    fn pdf(&self, wo: LocalDir, wi: LocalDir) -> f32 {
        self.pdf(wo, wi)
    }

    fn sample(&self, wo: LocalDir, u: Vec2) -> Option<BsdfSample> {
        self.sample(wo, u)
    }

    fn is_delta(&self) -> bool {
        self.facets.is_smooth()
    }
}

impl CoatedDiffuse {
    /// f · |cos θi|, without the mirror image in a smooth coat.
    pub fn eval(&self, wo: LocalDir, wi: LocalDir) -> Spectrum {
        let Some((wo, wi)) = from_above(wo, wi) else { return Spectrum::BLACK };
        self.coat.eval(&self.base, wo, wi)
    }

    /// The probability of a direction off the coat.
    fn coat_probability(&self, wo: LocalDir) -> f32 {
        if self.coat.face.eta == 1.0 {
            return 0.0;
        }
        let coat = fresnel::dielectric(wo.abs_cos_theta(), self.coat.face.eta);
        let below = self.base.reflectance.max_component().max(0.5 * self.coat.albedo.max_component());
        let below = (1.0 - coat) * below;
        // A rough coat is seen from its base at any angle: neither part may starve.
        (coat / (coat + below).max(1e-6)).clamp(0.1, 0.9)
    }

    /// The density of [`CoatedDiffuse::sample`] but for its delta part.
    pub fn pdf(&self, wo: LocalDir, wi: LocalDir) -> f32 {
        let Some((wo, wi)) = from_above(wo, wi) else { return 0.0 };
        let coat = self.coat_probability(wo);
        coat * self.coat.face.pdf_of(wo, wi, Ways::Reflection) + (1.0 - coat) * FRAC_1_PI * wi.abs_cos_theta()
    }

    /// A direction off the coat or by the cosine law.
    pub fn sample(&self, wo: LocalDir, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let below = wo.cos_theta() < 0.0;
        let wo = if below { -wo } else { wo };
        let coat = self.coat_probability(wo);
        if lobe >= coat {
            let wi = cosine_direction(u, wo.cos_theta())?;
            return finish(wi, self.pdf(wo, wi), self.eval(wo, wi), below);
        }
        let sample = self.coat.face.sample_of(wo, 0.0, u, Ways::Reflection)?;
        if sample.scatter == Scatter::Delta {
            return Some(turn(BsdfSample { weight: sample.weight / coat, ..sample }, below));
        }
        finish(sample.wi, self.pdf(wo, sample.wi), self.eval(wo, sample.wi), below)
    }

    /// The mirror image in a smooth coat.
    pub(crate) fn specular(&self, wo: LocalDir) -> Option<BsdfSample> {
        self.coat.mirror_image(wo)
    }

    /// A rough estimate of its albedo: the coat's reflectance at normal incidence, and the base's for the rest.
    pub fn albedo_estimate(&self) -> Spectrum {
        let coat = fresnel::dielectric(1.0, self.coat.face.eta);
        Spectrum::splat(coat) + self.base.reflectance * (1.0 - coat)
    }
}

/// The probabilities of the lobes of a coated metal. They sum to 1.
struct Lobes {
    /// The coat's own reflection: of the whole of both layers where both are smooth.
    coat: f32,
    /// Once off the metal and out again.
    metal: f32,
    // The rest: the cosine law, for what the medium scatters and what bounces more often.
}

impl CoatedConductor {
    /// Whether it is a mirror.
    pub fn is_delta(&self) -> bool {
        self.both_smooth() && !self.coat.scatters()
    }

    fn both_smooth(&self) -> bool {
        self.coat.face.is_delta() && self.base.facets.is_smooth()
    }

    /// f · |cos θi|, without mirror images.
    pub fn eval(&self, wo: LocalDir, wi: LocalDir) -> Spectrum {
        if self.is_delta() {
            return Spectrum::BLACK;
        }
        let Some((wo, wi)) = from_above(wo, wi) else { return Spectrum::BLACK };
        self.coat.eval(&self.base, wo, wi)
    }

    fn lobes(&self, wo: LocalDir) -> Lobes {
        if self.both_smooth() {
            let coat = if self.coat.scatters() { 0.7 } else { 1.0 };
            return Lobes { coat, metal: 0.0 };
        }
        let coat = fresnel::dielectric(wo.abs_cos_theta(), self.coat.face.eta);
        let metal = (1.0 - coat) * self.base.fresnel(1.0).max_component().max(0.1);
        let rest = if self.coat.scatters() { 0.3 } else { 0.15 };
        let coat = if self.coat.face.eta == 1.0 { 0.0 } else { (coat / (coat + metal)).clamp(0.1, 0.9) };
        Lobes { coat: coat * (1.0 - rest), metal: (1.0 - coat) * (1.0 - rest) }
    }

    /// The metal as it looks through a rough coat: a lobe of about the right width about the mirror direction. Refraction
    /// widens what the metal's facets turn, and each crossing of the coat turns by (η − 1) times the slope of its facets.
    fn seen_through(&self) -> Conductor {
        let eta = self.coat.face.eta;
        let (metal, coat) = (self.base.facets.alpha(), self.coat.face.facets.alpha());
        let alpha2 = eta * eta * metal * metal + 0.5 * (eta - 1.0) * (eta - 1.0) * coat * coat;
        let alpha = Vec2::new(alpha2.x.sqrt(), alpha2.y.sqrt()).clamp(Vec2::splat(0.02), Vec2::ONE);
        Conductor { facets: Microfacets::new(alpha.x, alpha.y), ..self.base }
    }

    /// The density of the metal's lobe.
    fn metal_pdf(&self, wo: LocalDir, wi: LocalDir) -> f32 {
        if !self.coat.face.is_delta() {
            return self.seen_through().pdf(wo, wi);
        }
        let eta = self.coat.face.eta;
        let (Some(o), Some(i)) = (refract(wo, Vec3::Z, eta), refract(wi, Vec3::Z, eta)) else { return 0.0 };
        // |dω below / dω above| = cos above / (η² cos below)
        self.base.pdf(-o, -i) * wi.abs_cos_theta() / (eta * eta * i.abs_cos_theta())
    }

    /// A direction of the metal's lobe.
    fn sample_metal(&self, wo: LocalDir, u: Vec2) -> Option<LocalDir> {
        if !self.coat.face.is_delta() {
            return Some(self.seen_through().sample(wo, u)?.wi);
        }
        let eta = self.coat.face.eta;
        let up = self.base.sample(-refract(wo, Vec3::Z, eta)?, u)?.wi;
        refract(-up, Vec3::Z, 1.0 / eta)
    }

    /// The density of [`CoatedConductor::sample`] but for its delta part.
    pub fn pdf(&self, wo: LocalDir, wi: LocalDir) -> f32 {
        let Some((wo, wi)) = from_above(wo, wi) else { return 0.0 };
        let Lobes { coat, metal } = self.lobes(wo);
        let rest = (1.0 - coat - metal).max(0.0) * FRAC_1_PI * wi.abs_cos_theta();
        let metal = if metal > 0.0 { metal * self.metal_pdf(wo, wi) } else { 0.0 };
        coat * self.coat.face.pdf_of(wo, wi, Ways::Reflection) + metal + rest
    }

    /// A direction off the coat, off the metal or by the cosine law.
    pub fn sample(&self, wo: LocalDir, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let below = wo.cos_theta() < 0.0;
        let wo = if below { -wo } else { wo };
        if wo.cos_theta() == 0.0 || wo.cos_theta().is_nan() {
            return None;
        }
        let Lobes { coat, metal } = self.lobes(wo);
        let wi = if lobe < coat {
            if self.both_smooth() {
                let weight = self.mirror(wo) / coat;
                let mirror = BsdfSample {
                    wi: wo.mirrored(),
                    weight,
                    scatter: Scatter::Delta,
                    transmitted: false,
                    eta: 1.0,
                };
                return Some(turn(mirror, below));
            }
            let sample = self.coat.face.sample_of(wo, 0.0, u, Ways::Reflection)?;
            if sample.scatter == Scatter::Delta {
                return Some(turn(BsdfSample { weight: sample.weight / coat, ..sample }, below));
            }
            sample.wi
        } else if lobe < coat + metal {
            self.sample_metal(wo, u)?
        } else {
            cosine_direction(u, wo.cos_theta())?
        };
        if !wo.same_hemisphere(wi) {
            return None;
        }
        finish(wi, self.pdf(wo, wi), self.eval(wo, wi), below)
    }

    /// The mirror image in the smooth layers.
    pub(crate) fn specular(&self, wo: LocalDir) -> Option<BsdfSample> {
        if !self.both_smooth() {
            return self.coat.mirror_image(wo);
        }
        if wo.cos_theta() == 0.0 || wo.cos_theta().is_nan() {
            return None;
        }
        let above = if wo.cos_theta() < 0.0 { -wo } else { wo };
        let weight = self.mirror(above);
        Some(BsdfSample { wi: wo.mirrored(), weight, scatter: Scatter::Delta, transmitted: false, eta: 1.0 })
    }

    /// What two smooth layers reflect, all bounces in the one direction summed: those of the coat and of the metal, up to
    /// the depth of a walk.
    fn mirror(&self, wo: LocalDir) -> Spectrum {
        let outside = fresnel::dielectric(wo.abs_cos_theta(), self.coat.face.eta);
        let Some(inside) = refract(wo, Vec3::Z, self.coat.face.eta) else { return Spectrum::splat(outside) };
        let cos = inside.abs_cos_theta();
        let back = fresnel::dielectric(-cos, self.coat.face.eta);
        let there_and_back = (-2.0 * self.coat.thickness / cos).exp();
        let off_metal = self.base.fresnel(cos) * there_and_back;
        let (mut term, mut sum) = (off_metal * ((1.0 - outside) * (1.0 - back)), Spectrum::splat(outside));
        // Every second bounce is one off the metal; the terms shrink by `back` each, or are not there at all.
        for _ in 0..self.coat.max_depth.div_ceil(2).min(64) {
            sum += term;
            term = term * off_metal * back;
        }
        sum
    }

    /// A rough estimate of its albedo: both layers at normal incidence.
    pub fn albedo_estimate(&self) -> Spectrum {
        let through = 1.0 - fresnel::dielectric(1.0, self.coat.face.eta);
        Spectrum::splat(1.0 - through) + self.base.fresnel(1.0) * (through * through)
    }
}

/// Both directions as seen from the coat's side; `None` where they are on different sides, or in the surface.
fn from_above(wo: LocalDir, wi: LocalDir) -> Option<(LocalDir, LocalDir)> {
    if wo.cos_theta() > 0.0 && wi.cos_theta() > 0.0 {
        return Some((wo, wi));
    }
    (wo.cos_theta() < 0.0 && wi.cos_theta() < 0.0).then_some((-wo, -wi))
}

/// A sample made above, where it belongs.
fn turn(sample: BsdfSample, below: bool) -> BsdfSample {
    if below { BsdfSample { wi: -sample.wi, ..sample } } else { sample }
}

/// A sample of known density and value, made above.
fn finish(wi: LocalDir, pdf: f32, value: Spectrum, below: bool) -> Option<BsdfSample> {
    let possible = pdf > 0.0 && pdf.is_finite();
    let sample = possible.then(|| BsdfSample {
        wi,
        weight: value / pdf,
        scatter: Scatter::Density(pdf),
        transmitted: false,
        eta: 1.0,
    })?;
    Some(turn(sample, below))
}

impl Coat {
    fn scatters(&self) -> bool {
        self.albedo.max_component() > 0.0
    }

    /// The mirror image in the face, where it is smooth.
    fn mirror_image(&self, wo: LocalDir) -> Option<BsdfSample> {
        if !self.face.is_delta() || self.face.eta == 1.0 {
            return None;
        }
        let below = wo.cos_theta() < 0.0;
        let above = if below { -wo } else { wo };
        Some(turn(self.face.sample_of(above, 0.0, Vec2::ZERO, Ways::Reflection)?, below))
    }

    /// The share that crosses a height of the medium along `w`.
    fn transmittance(height: f32, w: LocalDir) -> f32 {
        (-height / w.abs_cos_theta()).exp()
    }

    /// f · |cos θi| of the coat over a base, both directions above, without mirror images.
    fn eval<B: Base>(&self, base: &B, wo: LocalDir, wi: LocalDir) -> Spectrum {
        let mut random = RandomStream::new(combine(hash_vec3(wo.vec()), hash_vec3(wi.vec())));
        let samples = self.samples.max(1);
        let mut sum = Spectrum::BLACK;
        for _ in 0..samples {
            sum += self.walk(base, wo, wi, &mut random);
        }
        sum / samples as f32 + Spectrum::splat(self.face.eval(wo, wi))
    }

    /// One estimate of what enters the coat and leaves it again, times |cos θi|.
    fn walk<B: Base>(&self, base: &B, wo: LocalDir, wi: LocalDir, random: &mut RandomStream) -> Spectrum {
        let mut pair = || Vec2::new(random.next_f32(), random.next_f32());
        let Some(entry) = self.face.sample_of(wo, 0.0, pair(), Ways::Transmission) else {
            return Spectrum::BLACK;
        };
        // The way out, from its end: light that comes from `wi`, once it is below the face.
        let Some(exit) = self.face.sample_of(wi, 0.0, pair(), Ways::Transmission) else {
            return Spectrum::BLACK;
        };
        let exit_density = density(&exit);
        let rough = exit_density.is_some();
        // Seen from its end the way carries importance, which does not gather in the denser medium.
        let exit_weight = exit.weight * (exit.eta * exit.eta * wi.abs_cos_theta() / exit.wi.abs_cos_theta());

        // A mirror below joins what is scattered down to the end as well as what is scattered up: without it, a smooth face
        // would let out nothing of that, and a rough one would seldom.
        let mirror = if base.is_delta() { base.sample(-exit.wi, Vec2::ZERO) } else { None };
        let mirror = mirror.map_or(Spectrum::BLACK, |mirror| mirror.weight);
        let by_mirror = rough && base.is_delta();
        // The way down that the mirror turns into the way out, and what is left of it from face to face.
        let way_down = exit.wi.mirrored();
        let from_face = exit_weight * mirror * Self::transmittance(2.0 * self.thickness, exit.wi);

        let mut sum = Spectrum::BLACK;
        if by_mirror && self.max_depth > 0 {
            let share = balance(exit_density, self.face.pdf_of(wo, way_down, Ways::Transmission));
            sum += from_face * (self.face.eval(wo, way_down) * share);
        }
        let mut throughput = entry.weight;
        let mut w = entry.wi;
        // The density with which `w` was chosen where it last had a choice: a mirror leaves it as it is.
        let mut chosen = density(&entry);
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
            if self.scatters() {
                // Free flight to the next collision: 1 - u is in (0, 1].
                let flight = -(1.0 - random.next_f32()).ln() * w.abs_cos_theta();
                let next = if down { height - flight } else { height + flight };
                if 0.0 < next && next < self.thickness {
                    height = next;
                    throughput *= self.albedo;
                    let to_face = self.thickness - height;
                    let direct = henyey_greenstein(w.vec().dot(-exit.wi.vec()), self.g);
                    let share = balance(exit_density, direct);
                    let mut out = Spectrum::splat(direct * share * Self::transmittance(to_face, exit.wi));
                    if base.is_delta() {
                        let turned = henyey_greenstein(w.vec().dot(way_down.vec()), self.g);
                        let share = balance(exit_density, turned);
                        let way = Self::transmittance(height + self.thickness, exit.wi);
                        out += mirror * (turned * share * way);
                        if !rough {
                            out *= self.bounces(mirror, exit.wi);
                        }
                    }
                    sum += throughput * exit_weight * out;
                    let u = Vec2::new(random.next_f32(), random.next_f32());
                    let (scattered, pdf) = sample_henyey_greenstein(w.vec(), self.g, u);
                    let scattered = LocalDir(scattered);
                    if scattered.cos_theta() == 0.0 {
                        break;
                    }
                    (w, chosen) = (scattered, Some(pdf));
                    if rough && w.cos_theta() > 0.0 {
                        let left = self.leave(w, wi, chosen) * Self::transmittance(to_face, w);
                        sum += throughput * left;
                    }
                    continue;
                }
            } else {
                throughput *= Self::transmittance(self.thickness, w);
            }
            let u = Vec2::new(random.next_f32(), random.next_f32());
            if !down {
                height = self.thickness;
                if by_mirror {
                    let share = balance(exit_density, self.face.pdf_of(-w, way_down, Ways::Reflection));
                    sum += throughput * from_face * (self.face.eval(-w, way_down) * share);
                }
                let Some(back) = self.face.sample_of(-w, 0.0, u, Ways::Reflection) else { break };
                throughput *= back.weight;
                (w, chosen) = (back.wi, density(&back));
                continue;
            }
            height = 0.0;
            if !base.is_delta() {
                let share = balance(exit_density, base.pdf(-w, -exit.wi));
                let reflected = base.eval(-w, -exit.wi);
                sum += throughput
                    * exit_weight
                    * reflected
                    * (share * Self::transmittance(self.thickness, exit.wi));
            }
            let Some(up) = base.sample(-w, u) else { break };
            throughput *= up.weight;
            w = up.wi;
            chosen = if base.is_delta() { chosen } else { density(&up) };
            if rough {
                let left = self.leave(w, wi, chosen) * Self::transmittance(self.thickness, w);
                sum += throughput * left;
            }
        }
        sum
    }

    /// The bounces between a mirror below and a smooth face that a way out along `exit` may have had, summed.
    fn bounces(&self, mirror: Spectrum, exit: LocalDir) -> Spectrum {
        let face = fresnel::dielectric(-exit.abs_cos_theta(), self.face.eta);
        let again = mirror * (face * Self::transmittance(2.0 * self.thickness, exit));
        again.map(|again| 1.0 / (1.0 - again.min(0.999_999)))
    }

    /// What a walk that goes up along `w`, chosen with density `chosen`, sends out of a rough face to `wi`, weighted against
    /// having been found from `wi`.
    fn leave(&self, w: LocalDir, wi: LocalDir, chosen: Option<f32>) -> f32 {
        let found = if chosen.is_some() { self.face.pdf_of(wi, -w, Ways::Transmission) } else { 0.0 };
        self.face.eval(-w, wi) * balance(chosen, found)
    }
}

/// The density of a sample, `None` for a delta.
fn density(sample: &BsdfSample) -> Option<f32> {
    match sample.scatter {
        Scatter::Density(pdf) => Some(pdf),
        Scatter::Delta => None,
    }
}

/// The power heuristic: the weight of a direction of density `own` that another way finds with `other`. 1 for what only
/// one way finds.
fn balance(own: Option<f32>, other: f32) -> f32 {
    let Some(own) = own else { return 1.0 };
    let ratio = other / own;
    1.0 / (1.0 + ratio * ratio)
}
