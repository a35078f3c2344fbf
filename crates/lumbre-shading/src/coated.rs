//! Paint or metal under varnish: layered surfaces evaluated by random walks.

use std::f32::consts::FRAC_1_PI;

use lumbre_math::random::{RandomStream, combine, hash_vec3};
use lumbre_math::{Elementary, Vec2, Vec3};

use crate::conductor::Conductor;
use crate::dielectric::{Dielectric, Ways, refract};
use crate::diffuse::{Diffuse, cosine_direction};
use crate::medium::{henyey_greenstein, sample_henyey_greenstein};
use crate::microfacet::Microfacets;
use crate::{BsdfSample, LocalDir, Scatter, Spectrum, fresnel};

/// A dielectric coat with a scattering or absorbing medium below it.
///
/// Transport below the interface is estimated by a random walk whose random numbers are a hash of the two
/// directions: the result is deterministic, and right in the mean over directions. The walk is that of Guo,
/// Hašan, Zhao, "Position-Free Monte Carlo Simulation for Arbitrary Layered BSDFs", SIGGRAPH Asia 2018, with
/// the parameters of pbrt-v4: extinction 1 per unit of thickness, even where nothing scatters; Russian roulette
/// from the fifth bounce.
///
/// Unlike there, directions are sampled not by a walk but from a few lobes of known density, so weights,
/// densities and values agree exactly, and a weight includes multiple bounces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coat {
    /// The outer interface, inside over outside.
    pub face: Dielectric,
    /// In mean free paths, ≥ 0.
    pub thickness: f32,
    /// Henyey–Greenstein asymmetry of the medium, within (-1, 1).
    pub g: f32,
    /// Single-scattering albedo of the medium, in [0, 1].
    pub albedo: Spectrum,
    /// The maximal number of bounces of a walk.
    pub max_depth: u32,
    /// Walks per evaluation.
    pub samples: u32,
}

/// A diffuse base under a coat; the same from both sides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoatedDiffuse {
    /// The base.
    pub base: Diffuse,
    /// The coat.
    pub coat: Coat,
}

/// A metal under a coat; the same from both sides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoatedConductor {
    /// The base, with its index of refraction relative to the coat's.
    pub base: Conductor,
    /// The coat.
    pub coat: Coat,
}

/// The base under a coat; all directions are above it.
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
    /// f · |cos θi|, without the mirror reflection of a smooth coat.
    pub fn eval(&self, wo: LocalDir, wi: LocalDir) -> Spectrum {
        let Some((wo, wi)) = from_above(wo, wi) else { return Spectrum::BLACK };
        let (coat, base) = (&self.coat, &self.base);
        if coat.scatters() {
            coat.eval(wo, wi, |random| coat.walk(base, wo, wi, random))
        } else {
            coat.eval(wo, wi, |random| coat.walk_over_diffuse(base, wo, wi, random))
        }
    }

    /// The probability of sampling the coat.
    fn coat_probability(&self, wo: LocalDir) -> f32 {
        if self.coat.face.eta == 1.0 {
            return 0.0;
        }
        let coat = fresnel::dielectric(wo.abs_cos_theta(), self.coat.face.eta);
        let below = self.base.reflectance.max_component().max(0.5 * self.coat.albedo.max_component());
        let below = (1.0 - coat) * below;
        // A rough coat transmits at any angle, so neither part may have a tiny probability.
        (coat / (coat + below).max(1e-6)).clamp(0.1, 0.9)
    }

    /// The density of [`CoatedDiffuse::sample`] without its delta part.
    pub fn pdf(&self, wo: LocalDir, wi: LocalDir) -> f32 {
        let Some((wo, wi)) = from_above(wo, wi) else { return 0.0 };
        let coat = self.coat_probability(wo);
        coat * self.coat.face.pdf_of(wo, wi, Ways::Reflection) + (1.0 - coat) * FRAC_1_PI * wi.abs_cos_theta()
    }

    /// A direction sampled from the coat or by the cosine.
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

    /// The mirror reflection of a smooth coat.
    pub(crate) fn specular(&self, wo: LocalDir) -> Option<BsdfSample> {
        self.coat.mirror_image(wo)
    }

    /// A rough estimate of its albedo, from the coat's reflectance at normal incidence and the base's for the
    /// rest.
    pub fn albedo_estimate(&self) -> Spectrum {
        let coat = fresnel::dielectric(1.0, self.coat.face.eta);
        Spectrum::splat(coat) + self.base.reflectance * (1.0 - coat)
    }
}

/// The probabilities of the lobes of a coated metal. They sum to 1.
struct Lobes {
    /// The coat's reflection; if both layers are smooth, that of the whole.
    coat: f32,
    /// One reflection from the metal through the coat.
    metal: f32,
    // The rest is cosine-weighted, for scattering in the medium and multiple bounces.
}

impl CoatedConductor {
    /// Whether it is a mirror.
    pub fn is_delta(&self) -> bool {
        self.both_smooth() && !self.coat.scatters()
    }

    fn both_smooth(&self) -> bool {
        self.coat.face.is_delta() && self.base.facets.is_smooth()
    }

    /// f · |cos θi|, without mirror reflections.
    pub fn eval(&self, wo: LocalDir, wi: LocalDir) -> Spectrum {
        if self.is_delta() {
            return Spectrum::BLACK;
        }
        let Some((wo, wi)) = from_above(wo, wi) else { return Spectrum::BLACK };
        self.coat.eval(wo, wi, |random| self.coat.walk(&self.base, wo, wi, random))
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

    /// The metal as seen through a rough coat: a lobe of approximately the right width. Refraction widens the
    /// metal's lobe, and each crossing of the coat deflects by (η − 1) times the slope of its facets.
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

    /// A direction sampled from the metal's lobe.
    fn sample_metal(&self, wo: LocalDir, u: Vec2) -> Option<LocalDir> {
        if !self.coat.face.is_delta() {
            return Some(self.seen_through().sample(wo, u)?.wi);
        }
        let eta = self.coat.face.eta;
        let up = self.base.sample(-refract(wo, Vec3::Z, eta)?, u)?.wi;
        refract(-up, Vec3::Z, 1.0 / eta)
    }

    /// The density of [`CoatedConductor::sample`] without its delta part.
    pub fn pdf(&self, wo: LocalDir, wi: LocalDir) -> f32 {
        let Some((wo, wi)) = from_above(wo, wi) else { return 0.0 };
        let Lobes { coat, metal } = self.lobes(wo);
        let rest = (1.0 - coat - metal).max(0.0) * FRAC_1_PI * wi.abs_cos_theta();
        let metal = if metal > 0.0 { metal * self.metal_pdf(wo, wi) } else { 0.0 };
        coat * self.coat.face.pdf_of(wo, wi, Ways::Reflection) + metal + rest
    }

    /// A direction sampled from the coat, from the metal or by the cosine.
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

    /// The mirror reflection of the smooth layers.
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

    /// The reflectance of two smooth layers, with all bounces between coat and metal summed up to the maximal
    /// depth.
    fn mirror(&self, wo: LocalDir) -> Spectrum {
        let outside = fresnel::dielectric(wo.abs_cos_theta(), self.coat.face.eta);
        let Some(inside) = refract(wo, Vec3::Z, self.coat.face.eta) else { return Spectrum::splat(outside) };
        let cos = inside.abs_cos_theta();
        let back = fresnel::dielectric(-cos, self.coat.face.eta);
        let there_and_back = (-2.0 * self.coat.thickness / cos).exponential();
        let off_metal = self.base.fresnel(cos) * there_and_back;
        let (mut term, mut sum) = (off_metal * ((1.0 - outside) * (1.0 - back)), Spectrum::splat(outside));
        // Every second bounce is one off the metal. The terms decrease geometrically by `back`.
        for _ in 0..self.coat.max_depth.div_ceil(2).min(64) {
            sum += term;
            term = term * off_metal * back;
        }
        sum
    }

    /// A rough estimate of its albedo, from both layers at normal incidence.
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

/// A sample computed above, moved to its side.
fn turn(sample: BsdfSample, below: bool) -> BsdfSample {
    if below { BsdfSample { wi: -sample.wi, ..sample } } else { sample }
}

/// A sample of known density and value, computed above.
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

    /// The mirror reflection of a smooth interface.
    fn mirror_image(&self, wo: LocalDir) -> Option<BsdfSample> {
        if !self.face.is_delta() || self.face.eta == 1.0 {
            return None;
        }
        let below = wo.cos_theta() < 0.0;
        let above = if below { -wo } else { wo };
        Some(turn(self.face.sample_of(above, 0.0, Vec2::ZERO, Ways::Reflection)?, below))
    }

    /// The transmittance of a layer of the medium of this height along `w`.
    fn transmittance(height: f32, w: LocalDir) -> f32 {
        (-height / w.abs_cos_theta()).exponential()
    }

    /// f · |cos θi| of the coat over a base, both directions above, without mirror reflections: its own and the mean of some walks.
    fn eval(&self, wo: LocalDir, wi: LocalDir, walk: impl Fn(&mut RandomStream) -> Spectrum) -> Spectrum {
        let mut random = RandomStream::new(combine(hash_vec3(wo.vec()), hash_vec3(wi.vec())));
        let samples = self.samples.max(1);
        let mut sum = Spectrum::BLACK;
        for _ in 0..samples {
            sum += walk(&mut random);
        }
        sum / samples as f32 + Spectrum::splat(self.face.eval(wo, wi))
    }

    /// One estimate of the light that enters the coat and leaves it again, times |cos θi|.
    fn walk<B: Base>(&self, base: &B, wo: LocalDir, wi: LocalDir, random: &mut RandomStream) -> Spectrum {
        let mut pair = || Vec2::new(random.next_f32(), random.next_f32());
        let Some(entry) = self.face.sample_of(wo, 0.0, pair(), Ways::Transmission) else {
            return Spectrum::BLACK;
        };
        let Some(exit) = Exit::new(self, base, wi, pair()) else {
            return Spectrum::BLACK;
        };
        let mut sum = Spectrum::BLACK;
        if exit.by_mirror && self.max_depth > 0 {
            sum += exit.from_face * exit.face_to_mirror(wo, Ways::Transmission);
        }
        let mut throughput = entry.weight;
        let mut w = entry.wi;
        // The density with which `w` was last sampled; a mirror reflection preserves it.
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
                // The distance to the next collision: 1 - u is in (0, 1].
                let free_path = -(1.0 - random.next_f32()).logarithm() * w.abs_cos_theta();
                let next = if down { height - free_path } else { height + free_path };
                if 0.0 < next && next < self.thickness {
                    height = next;
                    throughput *= self.albedo;
                    let to_face = self.thickness - height;
                    sum += throughput * exit.weight * exit.scattered_in_medium(w, height);
                    let u = Vec2::new(random.next_f32(), random.next_f32());
                    let (scattered, pdf) = sample_henyey_greenstein(w.vec(), self.g, u);
                    let scattered = LocalDir(scattered);
                    if scattered.cos_theta() == 0.0 {
                        break;
                    }
                    (w, chosen) = (scattered, Some(pdf));
                    if exit.density.is_some() && w.cos_theta() > 0.0 {
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
                if exit.by_mirror {
                    sum += throughput * exit.from_face * exit.face_to_mirror(-w, Ways::Reflection);
                }
                let Some(back) = self.face.sample_of(-w, 0.0, u, Ways::Reflection) else { break };
                throughput *= back.weight;
                (w, chosen) = (back.wi, density(&back));
                continue;
            }
            height = 0.0;
            if !base.is_delta() {
                let share = balance(exit.density, base.pdf(-w, -exit.wi));
                let reflected = base.eval(-w, -exit.wi);
                sum += throughput
                    * exit.weight
                    * reflected
                    * (share * Self::transmittance(self.thickness, exit.wi));
            }
            let Some(up) = base.sample(-w, u) else { break };
            throughput *= up.weight;
            w = up.wi;
            chosen = if base.is_delta() { chosen } else { density(&up) };
            if exit.density.is_some() {
                let left = self.leave(w, wi, chosen) * Self::transmittance(self.thickness, w);
                sum += throughput * left;
            }
        }
        sum
    }

    /// [`Coat::walk`] over a diffuse base, where nothing scatters in the medium. The base forgets where light came from, so that one
    /// way out, sampled from `wi`, serves for all its reflections.
    fn walk_over_diffuse(
        &self,
        base: &Diffuse,
        wo: LocalDir,
        wi: LocalDir,
        random: &mut RandomStream,
    ) -> Spectrum {
        let mut pair = || Vec2::new(random.next_f32(), random.next_f32());
        let entry = self.face.sample_of(wo, 0.0, pair(), Ways::Transmission);
        let exit = self.face.sample_of(wi, 0.0, pair(), Ways::Transmission);
        let (Some(entry), Some(exit)) = (entry, exit) else { return Spectrum::BLACK };
        let mut throughput = entry.weight * Self::transmittance(self.thickness, entry.wi);
        let mut reflections = Spectrum::BLACK;
        // Every second bounce is one off the base.
        for depth in (0..self.max_depth).step_by(2) {
            throughput *= base.reflectance;
            reflections += throughput;
            if depth + 1 == self.max_depth {
                break;
            }
            let brightest = throughput.max_component();
            if depth > 1 && brightest < 0.25 {
                if random.next_f32() >= brightest {
                    break;
                }
                throughput = throughput / brightest;
            }
            let mut pair = || Vec2::new(random.next_f32(), random.next_f32());
            let Some(up) = cosine_direction(pair(), 1.0) else { break };
            let Some(back) = self.face.sample_of(-up, 0.0, pair(), Ways::Reflection) else { break };
            let both_ways =
                Self::transmittance(self.thickness, up) * Self::transmittance(self.thickness, back.wi);
            throughput *= back.weight * both_ways;
        }
        // Traced backwards, the exit carries importance, which is not scaled by η².
        let out = exit.eta * exit.eta * wi.abs_cos_theta() * Self::transmittance(self.thickness, exit.wi);
        reflections * exit.weight * (FRAC_1_PI * out)
    }

    /// The sum of the bounces between a mirror base and a smooth interface before the exit along `exit`.
    fn bounces(&self, mirror: Spectrum, exit: LocalDir) -> Spectrum {
        let face = fresnel::dielectric(-exit.abs_cos_theta(), self.face.eta);
        let again = mirror * (face * Self::transmittance(2.0 * self.thickness, exit));
        again.map(|again| 1.0 / (1.0 - again.min(0.999_999)))
    }

    /// The contribution of a walk that leaves through a rough interface to `wi`, going up along `w` with
    /// density `chosen`; weighted against the exit sampled from `wi`.
    fn leave(&self, w: LocalDir, wi: LocalDir, chosen: Option<f32>) -> f32 {
        let found = if chosen.is_some() { self.face.pdf_of(wi, -w, Ways::Transmission) } else { 0.0 };
        self.face.eval(-w, wi) * balance(chosen, found)
    }
}

/// The end of a walk: the direction below the interface that refracts to `wi`, and how it is reached.
struct Exit<'a> {
    coat: &'a Coat,
    /// Inside the coat; light leaves against it.
    wi: LocalDir,
    weight: Spectrum,
    /// `None` for a smooth interface.
    density: Option<f32>,
    /// The reflectance of a mirror base towards the exit; black for other bases.
    mirror: Spectrum,
    mirror_base: bool,
    /// Whether a mirror base connects a rough interface to the exit.
    by_mirror: bool,
    /// The downward direction that a mirror base reflects into the exit.
    way_down: LocalDir,
    /// The weight along `way_down` from the interface, by the mirror, to the exit.
    from_face: Spectrum,
}

impl<'a> Exit<'a> {
    fn new<B: Base>(coat: &'a Coat, base: &B, wi: LocalDir, u: Vec2) -> Option<Self> {
        let exit = coat.face.sample_of(wi, 0.0, u, Ways::Transmission)?;
        let density = density(&exit);
        // Traced backwards, the exit carries importance, which is not scaled by η².
        let weight = exit.weight * (exit.eta * exit.eta * wi.abs_cos_theta() / exit.wi.abs_cos_theta());
        // A mirror base connects light scattered downwards to the exit, too: a smooth interface would transmit
        // none of it otherwise, and a rough one rarely.
        let mirror = if base.is_delta() { base.sample(-exit.wi, Vec2::ZERO) } else { None };
        let mirror = mirror.map_or(Spectrum::BLACK, |mirror| mirror.weight);
        Some(Self {
            coat,
            wi: exit.wi,
            weight,
            density,
            mirror,
            mirror_base: base.is_delta(),
            by_mirror: density.is_some() && base.is_delta(),
            way_down: exit.wi.mirrored(),
            from_face: weight * mirror * Coat::transmittance(2.0 * coat.thickness, exit.wi),
        })
    }

    /// The weighted scattering at the interface from `v` into the way down.
    fn face_to_mirror(&self, v: LocalDir, ways: Ways) -> f32 {
        let face = &self.coat.face;
        let share = balance(self.density, face.pdf_of(v, self.way_down, ways));
        face.eval(v, self.way_down) * share
    }

    /// The weighted scattering at a collision from `w` into the exit, directly or by a mirror base.
    fn scattered_in_medium(&self, w: LocalDir, height: f32) -> Spectrum {
        let (coat, wi) = (self.coat, self.wi);
        let direct = henyey_greenstein(w.vec().dot(-wi.vec()), coat.g);
        let share = balance(self.density, direct);
        let mut out = Spectrum::splat(direct * share * Coat::transmittance(coat.thickness - height, wi));
        if self.mirror_base {
            let turned = henyey_greenstein(w.vec().dot(self.way_down.vec()), coat.g);
            let share = balance(self.density, turned);
            let way = Coat::transmittance(height + coat.thickness, wi);
            out += self.mirror * (turned * share * way);
            if self.density.is_none() {
                out *= coat.bounces(self.mirror, wi);
            }
        }
        out
    }
}

/// The density of a sample, `None` for a delta.
fn density(sample: &BsdfSample) -> Option<f32> {
    match sample.scatter {
        Scatter::Density(pdf) => Some(pdf),
        Scatter::Delta => None,
    }
}

/// The power heuristic for a direction of density `own` that another strategy samples with `other`; 1 if only
/// one can sample it.
fn balance(own: Option<f32>, other: f32) -> f32 {
    let Some(own) = own else { return 1.0 };
    let ratio = other / own;
    1.0 / (1.0 + ratio * ratio)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_walk_over_a_diffuse_base_has_the_mean_of_the_general_one() {
        let count = if std::env::var_os("LUMBRE_LONG_TESTS").is_some() { 2_000_000 } else { 60_000 };
        let base = Diffuse { reflectance: Spectrum::new(0.9, 0.4, 0.05) };
        let local = |x, y, z| LocalDir(Vec3::new(x, y, z).normalize());
        for (alpha, thickness, max_depth) in
            [((0.0, 0.0), 0.3, 10), ((0.3, 0.1), 0.1, 3), ((0.8, 0.8), 0.0, 40), ((0.2, 0.6), 1.0, 2)]
        {
            let face = Dielectric { eta: 1.5, facets: Microfacets::new(alpha.0, alpha.1) };
            let coat = Coat { face, thickness, g: 0.0, albedo: Spectrum::BLACK, max_depth, samples: 1 };
            for (wo, wi) in
                [(local(0.1, 0.2, 0.9), local(-0.5, 0.3, 0.6)), (local(0.9, 0.1, 0.3), local(0.6, 0.6, 0.2))]
            {
                let mut random = RandomStream::new(7);
                let mut mean = |walk: &dyn Fn(&mut RandomStream) -> Spectrum| {
                    let (mut sum, mut squares) = ([0.0; 3], [0.0; 3]);
                    for _ in 0..count {
                        for (i, value) in walk(&mut random).to_array().into_iter().enumerate() {
                            sum[i] += f64::from(value);
                            squares[i] += f64::from(value) * f64::from(value);
                        }
                    }
                    let n = f64::from(count);
                    std::array::from_fn::<_, 3, _>(|i| {
                        (sum[i] / n, (squares[i] / n - (sum[i] / n).powi(2)).max(0.0) / n)
                    })
                };
                let general = mean(&|random| coat.walk(&base, wo, wi, random));
                let short = mean(&|random| coat.walk_over_diffuse(&base, wo, wi, random));
                for ((a, of_a), (b, of_b)) in general.into_iter().zip(short) {
                    let spread = (of_a + of_b).sqrt() + 1e-6 * a;
                    assert!(
                        a > 0.0 && (a - b).abs() < 4.5 * spread,
                        "{alpha:?} {max_depth}: {a} {b} {spread}"
                    );
                }
            }
        }
    }
}
