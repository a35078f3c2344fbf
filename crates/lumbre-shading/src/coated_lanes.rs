//! [`crate::coated`] over lanes. A walk goes on until it has ended in all lanes.

use std::f32::consts::FRAC_1_PI;

use lumbre_simd::math::{exp, ln};
use lumbre_simd::random::{pcg4d, uniform};
use lumbre_simd::{Mask, Real, Task, UInt, V3};

use crate::conductor::{ConductorLanes, mirrored};
use crate::dielectric::{DielectricLanes, Ways, refract};
use crate::diffuse::{DiffuseLanes, cosine_direction, has_side};
use crate::fresnel;
use crate::lanes::{LaneBsdf, LaneSample, colour, field};
use crate::medium::{henyey_greenstein, sample_henyey_greenstein_lanes};
use crate::microfacet::FacetLanes;

/// [`crate::coated::Coat`] over lanes.
#[derive(Clone, Copy, Debug)]
pub struct CoatLanes<R: Real> {
    /// The outer interface, inside over outside.
    pub face: DielectricLanes<R>,
    /// In mean free paths, ≥ 0.
    pub thickness: R,
    /// Henyey–Greenstein asymmetry of the medium, within (-1, 1).
    pub g: R,
    /// Single-scattering albedo of the medium, in [0, 1].
    pub albedo: V3<R>,
    /// The maximal number of bounces of a walk.
    pub max_depth: R,
    /// Walks per evaluation, at least 1.
    pub samples: R,
}

/// [`crate::coated::CoatedDiffuse`] over lanes.
#[derive(Clone, Copy, Debug)]
pub struct CoatedDiffuseLanes<R: Real> {
    /// The base.
    pub base: DiffuseLanes<R>,
    /// The coat.
    pub coat: CoatLanes<R>,
}

/// [`crate::coated::CoatedConductor`] over lanes.
#[derive(Clone, Copy, Debug)]
pub struct CoatedConductorLanes<R: Real> {
    /// The base, with its index of refraction relative to the coat's.
    pub base: ConductorLanes<R>,
    /// The coat.
    pub coat: CoatLanes<R>,
}

/// The random numbers of the walks between two directions: a hash of both.
struct WalkRandom<R: Real>([R::UInt; 4]);

impl<R: Real> WalkRandom<R> {
    #[inline(always)]
    fn new(wo: V3<R>, wi: V3<R>) -> Self {
        let [a, b, c, d] = pcg4d([bits(wo.x), bits(wo.y), bits(wo.z), bits(wi.x)]);
        Self(pcg4d([a ^ bits(wi.y), b ^ bits(wi.z), c, d]))
    }

    /// The numbers of one step of one walk.
    #[inline(always)]
    fn numbers(&self, walk: u32, step: u32) -> [R; 4] {
        let [a, b, c, d] = self.0;
        let [a, b, c, d] = pcg4d([a, b, c + R::UInt::splat(walk), d + R::UInt::splat(step)]);
        [uniform(a), uniform(b), uniform(c), uniform(d)]
    }
}

/// The bits of a coordinate, those of 0 for −0.
#[inline(always)]
fn bits<R: Real>(x: R) -> R::UInt {
    (x + R::zero()).to_bits()
}

/// The base under a coat; all directions are above it.
trait Base<R: Real>: LaneBsdf<R> {
    /// One estimate of the light that enters the coat and leaves it again, times |cos θi|; 0 in inactive lanes.
    fn walk_once(&self, coat: &CoatLanes<R>, way: &Way<R>, walk: u32, active: R::Mask) -> V3<R>;
}

/// Two directions above a coat, and their random numbers.
struct Way<R: Real> {
    wo: V3<R>,
    wi: V3<R>,
    random: WalkRandom<R>,
}

impl<R: Real> Base<R> for DiffuseLanes<R> {
    #[inline(always)]
    fn walk_once(&self, coat: &CoatLanes<R>, way: &Way<R>, walk: u32, active: R::Mask) -> V3<R> {
        let scatters = coat.scatters();
        let mut sum = V3::splat(R::zero());
        if (active & scatters).any() {
            sum = coat.walk(self, way, walk, active & scatters);
        }
        if (active & !scatters).any() {
            sum = sum + coat.walk_over_diffuse(self.reflectance, way, walk, active & !scatters);
        }
        sum
    }
}

impl<R: Real> Base<R> for ConductorLanes<R> {
    #[inline(always)]
    fn walk_once(&self, coat: &CoatLanes<R>, way: &Way<R>, walk: u32, active: R::Mask) -> V3<R> {
        coat.walk(self, way, walk, active)
    }
}

impl<R: Real> CoatedDiffuseLanes<R> {
    /// f · |cos θi|, without the mirror reflection of a smooth coat.
    #[inline(always)]
    pub(crate) fn value(&self, wo: V3<R>, wi: V3<R>) -> V3<R> {
        let (wo, wi, fits) = from_above(wo, wi);
        self.coat.value(&self.base, wo, wi, fits)
    }

    /// The density of [`LaneBsdf::sample`] without its delta part.
    #[inline(always)]
    pub(crate) fn pdf(&self, wo: V3<R>, wi: V3<R>) -> R {
        let (wo, wi, fits) = from_above(wo, wi);
        self.pdf_above(wo, wi).or_zero(fits)
    }

    #[inline(always)]
    fn pdf_above(&self, wo: V3<R>, wi: V3<R>) -> R {
        let coat = self.coat_probability(wo);
        coat * self.coat.face.pdf_of(wo, wi, Ways::Reflection)
            + (R::one() - coat) * R::splat(FRAC_1_PI) * wi.z.abs()
    }

    /// The probability of sampling the coat.
    #[inline(always)]
    fn coat_probability(&self, wo: V3<R>) -> R {
        let coat = fresnel::dielectric(wo.z.abs(), self.coat.face.eta);
        let medium = R::splat(0.5) * self.coat.albedo.max_component();
        let below = (R::one() - coat) * self.base.reflectance.max_component().simd_max(medium);
        // A rough coat transmits at any angle, so neither part may have a tiny probability.
        let share = coat / (coat + below).simd_max(R::splat(1e-6));
        let share = share.simd_max(R::splat(0.1)).simd_min(R::splat(0.9));
        share.or_zero(self.coat.face.eta.simd_ne(R::one()))
    }
}

impl<R: Real> LaneBsdf<R> for CoatedDiffuseLanes<R> {
    const ROW: usize = 3 + CoatLanes::<f32>::ROW;

    #[inline(always)]
    fn load(table: &[f32], at: R::UInt) -> Self {
        Self { base: DiffuseLanes::load(table, at), coat: CoatLanes::load(table, at + R::UInt::splat(3)) }
    }

    #[inline(always)]
    fn eval(&self, wo: V3<R>, wi: V3<R>) -> (V3<R>, R) {
        let (wo, wi, fits) = from_above(wo, wi);
        (self.coat.value(&self.base, wo, wi, fits), self.pdf_above(wo, wi).or_zero(fits))
    }

    #[inline(always)]
    fn sample(&self, wo: V3<R>, lobe: R, u: [R; 2]) -> LaneSample<R> {
        let is_below = wo.z.simd_lt(R::zero());
        let wo = V3::select(is_below, -wo, wo);
        let probability = self.coat_probability(wo);
        let from_coat = lobe.simd_lt(probability);
        let reflection = self.coat.face.sample_of(wo, R::zero(), u, Ways::Reflection);
        let wi = V3::select(from_coat, reflection.wi, cosine_direction(u, R::one()));
        let exists = has_side(wo) & (!from_coat | reflection.valid);
        let delta = from_coat & reflection.delta;
        let delta_weight = reflection.weight / probability;
        let pdf = self.pdf_above(wo, wi);
        let value = self.coat.value(&self.base, wo, wi, exists & !delta);
        finish(wi, value, pdf, exists, (delta, delta_weight), is_below)
    }

    #[inline(always)]
    fn is_delta(&self) -> R::Mask {
        R::Mask::splat(false)
    }

    #[inline(always)]
    fn regularized(self, mask: R::Mask) -> Self {
        Self { coat: self.coat.regularized(mask), ..self }
    }
}

impl<R: Real> CoatedConductorLanes<R> {
    /// Whether both layers are smooth.
    #[inline(always)]
    pub(crate) fn both_smooth(&self) -> R::Mask {
        self.coat.face.is_delta() & self.base.is_delta()
    }

    /// f · |cos θi|, without mirror reflections.
    #[inline(always)]
    pub(crate) fn value(&self, wo: V3<R>, wi: V3<R>) -> V3<R> {
        let (wo, wi, fits) = from_above(wo, wi);
        self.coat.value(&self.base, wo, wi, fits & !self.is_delta())
    }

    /// The density of [`LaneBsdf::sample`] without its delta part.
    #[inline(always)]
    pub(crate) fn pdf(&self, wo: V3<R>, wi: V3<R>) -> R {
        let (wo, wi, fits) = from_above(wo, wi);
        self.pdf_above(wo, wi).or_zero(fits)
    }

    /// The probabilities of the coat's reflection (if both layers are smooth, of that of the whole) and of one
    /// reflection from the metal through the coat. The rest is cosine-weighted, for scattering in the medium and
    /// multiple bounces.
    #[inline(always)]
    fn lobes(&self, wo: V3<R>) -> [R; 2] {
        let (scatters, both_smooth) = (self.coat.scatters(), self.both_smooth());
        let coat = fresnel::dielectric(wo.z.abs(), self.coat.face.eta);
        let off_metal = self.base.fresnel(R::one()).max_component().simd_max(R::splat(0.1));
        let metal = (R::one() - coat) * off_metal;
        let rest = R::select(scatters, R::splat(0.3), R::splat(0.15));
        let coat = (coat / (coat + metal)).simd_max(R::splat(0.1)).simd_min(R::splat(0.9));
        let coat = coat.or_zero(self.coat.face.eta.simd_ne(R::one()));
        let whole = R::select(scatters, R::splat(0.7), R::one());
        [
            R::select(both_smooth, whole, coat * (R::one() - rest)),
            ((R::one() - coat) * (R::one() - rest)).or_zero(!both_smooth),
        ]
    }

    /// The metal as seen through a rough coat: a lobe of approximately the right width. Refraction widens the
    /// metal's lobe, and each crossing of the coat deflects by (η − 1) times the slope of its facets.
    #[inline(always)]
    fn seen_through(&self) -> ConductorLanes<R> {
        let (metal, coat) = (self.base.facets, self.coat.face.facets);
        let facets = FacetLanes {
            alpha_x: self.alpha_through(metal.alpha_x, coat.alpha_x),
            alpha_y: self.alpha_through(metal.alpha_y, coat.alpha_y),
        };
        ConductorLanes { facets, ..self.base }
    }

    #[inline(always)]
    fn alpha_through(&self, metal: R, coat: R) -> R {
        let eta = self.coat.face.eta;
        let bent = eta - R::one();
        let alpha2 = eta * eta * metal * metal + R::splat(0.5) * bent * bent * coat * coat;
        alpha2.sqrt().simd_max(R::splat(0.02)).simd_min(R::one())
    }

    /// The density of the metal's lobe.
    #[inline(always)]
    fn metal_pdf(&self, wo: V3<R>, wi: V3<R>) -> R {
        let through_rough = self.seen_through().pdf(wo, wi);
        let (up, eta) = (V3::constant([0.0, 0.0, 1.0]), self.coat.face.eta);
        let ((o, enters), (i, leaves)) = (refract(wo, up, eta), refract(wi, up, eta));
        // |dω below / dω above| = cos above / (η² cos below)
        let through_smooth = self.base.pdf(-o, -i) * wi.z.abs() / (eta * eta * i.z.abs());
        R::select(self.coat.face.is_delta(), through_smooth.or_zero(enters & leaves), through_rough)
    }

    /// A direction sampled from the metal's lobe, and where there is one.
    #[inline(always)]
    fn sample_metal(&self, wo: V3<R>, u: [R; 2]) -> (V3<R>, R::Mask) {
        let through_rough = self.seen_through().sample(wo, R::zero(), u);
        let (up, eta) = (V3::constant([0.0, 0.0, 1.0]), self.coat.face.eta);
        let (o, enters) = refract(wo, up, eta);
        let reflected = self.base.sample(-o, R::zero(), u);
        let (out, leaves) = refract(-reflected.wi, up, eta.recip());
        let smooth = self.coat.face.is_delta();
        let exists = (smooth & enters & reflected.valid & leaves) | (!smooth & through_rough.valid);
        (V3::select(smooth, out, through_rough.wi), exists)
    }

    #[inline(always)]
    fn pdf_above(&self, wo: V3<R>, wi: V3<R>) -> R {
        let [coat, metal] = self.lobes(wo);
        let rest = (R::one() - coat - metal).simd_max(R::zero()) * R::splat(FRAC_1_PI) * wi.z.abs();
        let off_metal = (metal * self.metal_pdf(wo, wi)).or_zero(metal.simd_gt(R::zero()));
        coat * self.coat.face.pdf_of(wo, wi, Ways::Reflection) + off_metal + rest
    }

    /// The reflectance of two smooth layers, with all bounces between coat and metal summed up to the maximal
    /// depth.
    #[inline(always)]
    pub(crate) fn mirror(&self, wo: V3<R>) -> V3<R> {
        let eta = self.coat.face.eta;
        let outside = fresnel::dielectric(wo.z.abs(), eta);
        let (inside, enters) = refract(wo, V3::constant([0.0, 0.0, 1.0]), eta);
        let cos = inside.z.abs();
        let back = fresnel::dielectric(-cos, eta);
        let there_and_back = exp(R::splat(-2.0) * self.coat.thickness / cos);
        let off_metal = self.base.fresnel(cos) * there_and_back;
        let mut term = off_metal * ((R::one() - outside) * (R::one() - back));
        let mut sum = V3::splat(outside);
        // Every second bounce is one off the metal. The terms decrease geometrically by `back`.
        let bounces = (R::splat(0.5) * (self.coat.max_depth + R::one())).floor().simd_min(R::splat(64.0));
        let mut bounce = R::zero();
        loop {
            let goes_on = enters & bounce.simd_lt(bounces);
            if goes_on.none() {
                return sum;
            }
            sum = sum + term.or_zero(goes_on);
            term = term * off_metal * back;
            bounce = bounce + R::one();
        }
    }
}

impl<R: Real> LaneBsdf<R> for CoatedConductorLanes<R> {
    const ROW: usize = 8 + CoatLanes::<f32>::ROW;

    #[inline(always)]
    fn load(table: &[f32], at: R::UInt) -> Self {
        Self { base: ConductorLanes::load(table, at), coat: CoatLanes::load(table, at + R::UInt::splat(8)) }
    }

    #[inline(always)]
    fn eval(&self, wo: V3<R>, wi: V3<R>) -> (V3<R>, R) {
        let (wo, wi, fits) = from_above(wo, wi);
        let value = self.coat.value(&self.base, wo, wi, fits & !self.is_delta());
        (value, self.pdf_above(wo, wi).or_zero(fits))
    }

    #[inline(always)]
    fn sample(&self, wo: V3<R>, lobe: R, u: [R; 2]) -> LaneSample<R> {
        let is_below = wo.z.simd_lt(R::zero());
        let wo = V3::select(is_below, -wo, wo);
        let [coat, metal] = self.lobes(wo);
        let from_coat = lobe.simd_lt(coat);
        let from_metal = !from_coat & lobe.simd_lt(coat + metal);
        let reflection = self.coat.face.sample_of(wo, R::zero(), u, Ways::Reflection);
        let (off_metal, metal_exists) = self.sample_metal(wo, u);
        let wi = V3::select(from_metal, off_metal, cosine_direction(u, R::one()));
        let wi = V3::select(from_coat, reflection.wi, wi);
        let both_smooth = self.both_smooth();
        let wi = V3::select(from_coat & both_smooth, mirrored(wo), wi);
        let exists = has_side(wo)
            & (!from_coat | reflection.valid | both_smooth)
            & (!from_metal | metal_exists)
            & (wo.z * wi.z).simd_gt(R::zero());
        let delta = from_coat & (reflection.delta | both_smooth);
        let mut delta_weight = reflection.weight;
        if (from_coat & both_smooth).any() {
            delta_weight = V3::select(both_smooth, self.mirror(wo), delta_weight);
        }
        let pdf = self.pdf_above(wo, wi);
        let value = self.coat.value(&self.base, wo, wi, exists & !delta & !self.is_delta());
        finish(wi, value, pdf, exists, (delta, delta_weight / coat), is_below)
    }

    #[inline(always)]
    fn is_delta(&self) -> R::Mask {
        self.both_smooth() & !self.coat.scatters()
    }

    #[inline(always)]
    fn regularized(self, mask: R::Mask) -> Self {
        Self { base: self.base.regularized(mask), coat: self.coat.regularized(mask) }
    }
}

/// Both directions as seen from the coat's side, and where there is one: both are on one side, neither is in the
/// surface.
#[inline(always)]
fn from_above<R: Real>(wo: V3<R>, wi: V3<R>) -> (V3<R>, V3<R>, R::Mask) {
    let is_above = wo.z.simd_gt(R::zero()) & wi.z.simd_gt(R::zero());
    let is_below = wo.z.simd_lt(R::zero()) & wi.z.simd_lt(R::zero());
    (V3::select(is_below, -wo, wo), V3::select(is_below, -wi, wi), is_above | is_below)
}

/// A sample computed above, moved to its side: of known density and value, or a delta of this weight.
#[inline(always)]
fn finish<R: Real>(
    wi: V3<R>,
    value: V3<R>,
    pdf: R,
    exists: R::Mask,
    (delta, delta_weight): (R::Mask, V3<R>),
    is_below: R::Mask,
) -> LaneSample<R> {
    LaneSample {
        wi: V3::select(is_below, -wi, wi),
        weight: V3::select(delta, delta_weight, value / pdf),
        pdf: R::select(delta, R::one(), pdf),
        valid: exists & (delta | (pdf.simd_gt(R::zero()) & pdf.is_finite())),
        delta,
        transmitted: R::Mask::splat(false),
        eta: R::one(),
    }
}

impl CoatLanes<f32> {
    /// The numbers of a coat in a row.
    pub(crate) const ROW: usize = 10;
}

impl<R: Real> CoatLanes<R> {
    #[inline(always)]
    fn load(table: &[f32], at: R::UInt) -> Self {
        Self {
            face: DielectricLanes::load(table, at),
            thickness: field(table, at, 3),
            g: field(table, at, 4),
            albedo: colour(table, at, 5),
            max_depth: field(table, at, 8),
            samples: field(table, at, 9),
        }
    }

    #[inline(always)]
    fn regularized(self, mask: R::Mask) -> Self {
        Self { face: self.face.regularized(mask), ..self }
    }

    #[inline(always)]
    fn scatters(&self) -> R::Mask {
        self.albedo.max_component().simd_gt(R::zero())
    }

    /// The transmittance of the whole layer of the medium along `w`.
    #[inline(always)]
    fn across(&self, w: V3<R>) -> R {
        transmittance(self.thickness, w)
    }

    /// f · |cos θi| of the coat over a base, both directions above, without mirror reflections: its own and the mean of
    /// some walks. 0 in inactive lanes.
    #[inline(always)]
    fn value<B: Base<R>>(&self, base: &B, wo: V3<R>, wi: V3<R>, active: R::Mask) -> V3<R> {
        R::call(Value { coat: self, base, wo, wi, active })
    }

    #[inline(always)]
    fn value_inlined<B: Base<R>>(&self, base: &B, wo: V3<R>, wi: V3<R>, active: R::Mask) -> V3<R> {
        let way = Way { wo, wi, random: WalkRandom::new(wo, wi) };
        let mut sum = V3::splat(R::zero());
        let (mut walk, mut goes_on) = (0, active);
        while goes_on.any() {
            sum = sum + base.walk_once(self, &way, walk, goes_on);
            walk += 1;
            goes_on = goes_on & R::splat(walk as f32).simd_lt(self.samples);
        }
        let (own, _) = self.face.eval(wo, wi);
        (sum / self.samples + own).or_zero(active)
    }

    /// One estimate of the light that enters the coat and leaves it again, times |cos θi|.
    #[inline(always)]
    fn walk<B: LaneBsdf<R>>(&self, base: &B, way: &Way<R>, walk: u32, active: R::Mask) -> V3<R> {
        let Way { wo, wi, random } = way;
        let [a, b, c, d] = random.numbers(walk, 0);
        let entry = self.face.sample_of(*wo, R::zero(), [a, b], Ways::Transmission);
        let exit = Exit::new(self, base, *wi, [c, d]);
        let (scatters, base_is_delta) = (self.scatters(), base.is_delta());
        let mut alive = active & entry.valid & exit.valid & R::zero().simd_lt(self.max_depth);
        let mut sum = V3::splat(R::zero());
        if (alive & exit.by_mirror).any() {
            let from_face = exit.from_face * exit.face_to_mirror(self, *wo, Ways::Transmission);
            sum = from_face.or_zero(alive & exit.by_mirror);
        }
        let mut throughput = entry.weight;
        let mut w = entry.wi;
        // The density with which `w` was last sampled, if it has one; a mirror reflection preserves it.
        let (mut chosen, mut has_density) = (entry.pdf, !entry.delta);
        let mut height = self.thickness;
        let mut depth = 0;
        while alive.any() {
            let [survival, path, u, v] = random.numbers(walk, depth + 1);
            if depth > 3 {
                (throughput, alive) = roulette(throughput, alive, survival);
            }
            let is_down = w.z.simd_lt(R::zero());
            // The distance to the next collision: 1 - path is in (0, 1].
            let free_path = -(ln(R::one() - path) * w.z.abs());
            let next = R::select(is_down, height - free_path, height + free_path);
            let is_within = R::zero().simd_lt(next) & next.simd_lt(self.thickness);
            let collides = alive & scatters & is_within;
            let crosses = alive & !collides;
            if collides.any() {
                height = R::select(collides, next, height);
                throughput = V3::select(collides, throughput * self.albedo, throughput);
                let found = throughput * exit.weight * exit.scattered_in_medium(self, w, height);
                sum = sum + found.or_zero(collides);
                let (scattered, pdf) = sample_henyey_greenstein_lanes(w, self.g, [u, v]);
                alive = alive & (!collides | scattered.z.simd_ne(R::zero()));
                let goes_on = alive & collides;
                w = V3::select(goes_on, scattered, w);
                chosen = R::select(goes_on, pdf, chosen);
                has_density = has_density | goes_on;
                let leaves = goes_on & exit.has_density & w.z.simd_gt(R::zero());
                if leaves.any() {
                    let left = self.leave(w, *wi, chosen, has_density);
                    let left = left * transmittance(self.thickness - height, w);
                    sum = sum + (throughput * left).or_zero(leaves);
                }
            }
            throughput = V3::select(crosses & !scatters, throughput * self.across(w), throughput);
            let at_face = crosses & !is_down;
            if at_face.any() {
                height = R::select(at_face, self.thickness, height);
                if (at_face & exit.by_mirror).any() {
                    let found = exit.from_face * exit.face_to_mirror(self, -w, Ways::Reflection);
                    sum = sum + (throughput * found).or_zero(at_face & exit.by_mirror);
                }
                let back = self.face.sample_of(-w, R::zero(), [u, v], Ways::Reflection);
                alive = alive & (!at_face | back.valid);
                throughput = V3::select(at_face, throughput * back.weight, throughput);
                w = V3::select(at_face, back.wi, w);
                chosen = R::select(at_face, back.pdf, chosen);
                has_density = (has_density & !at_face) | (at_face & !back.delta);
            }
            let at_base = crosses & is_down;
            if at_base.any() {
                height = R::select(at_base, R::zero(), height);
                let (reflected, pdf) = base.eval(-w, -exit.wi);
                let share = balance(exit.density, exit.has_density, pdf) * self.across(exit.wi);
                let found = throughput * exit.weight * reflected * share;
                sum = sum + found.or_zero(at_base & !base_is_delta);
                let up = base.sample(-w, R::zero(), [u, v]);
                alive = alive & (!at_base | up.valid);
                throughput = V3::select(at_base, throughput * up.weight, throughput);
                w = V3::select(at_base, up.wi, w);
                chosen = R::select(at_base & !base_is_delta, up.pdf, chosen);
                has_density = has_density | (at_base & !base_is_delta);
                let leaves = at_base & alive & exit.has_density;
                if leaves.any() {
                    let left = self.leave(w, *wi, chosen, has_density) * self.across(w);
                    sum = sum + (throughput * left).or_zero(leaves);
                }
            }
            depth += 1;
            alive = alive & R::splat(depth as f32).simd_lt(self.max_depth);
        }
        sum
    }

    /// [`CoatLanes::walk`] over a diffuse base, where nothing scatters in the medium. The base forgets where light came
    /// from, so that one way out, sampled from `wi`, serves for all its reflections.
    #[inline(always)]
    fn walk_over_diffuse(&self, reflectance: V3<R>, way: &Way<R>, walk: u32, active: R::Mask) -> V3<R> {
        let Way { wo, wi, random } = way;
        let [a, b, c, d] = random.numbers(walk, 0);
        let entry = self.face.sample_of(*wo, R::zero(), [a, b], Ways::Transmission);
        let exit = self.face.sample_of(*wi, R::zero(), [c, d], Ways::Transmission);
        let mut alive = active & entry.valid & exit.valid & R::zero().simd_lt(self.max_depth);
        let mut throughput = entry.weight * self.across(entry.wi);
        let mut reflections = V3::splat(R::zero());
        // Every second bounce is one off the base.
        let mut depth = 0;
        while alive.any() {
            throughput = throughput * reflectance;
            reflections = reflections + throughput.or_zero(alive);
            alive = alive & R::splat((depth + 1) as f32).simd_lt(self.max_depth);
            if depth > 1 {
                let [survival, ..] = random.numbers(walk, depth + 1);
                (throughput, alive) = roulette(throughput, alive, survival);
            }
            if alive.none() {
                break;
            }
            let [a, b, c, d] = random.numbers(walk, depth + 2);
            let up = cosine_direction([a, b], R::one());
            let back = self.face.sample_of(-up, R::zero(), [c, d], Ways::Reflection);
            let both_ways = self.across(up) * self.across(back.wi);
            throughput = throughput * (back.weight * both_ways);
            depth += 2;
            alive = alive & back.valid & R::splat(depth as f32).simd_lt(self.max_depth);
        }
        // Traced backwards, the exit carries importance, which is not scaled by η².
        let out = exit.eta * exit.eta * wi.z.abs() * self.across(exit.wi);
        (reflections * exit.weight * (R::splat(FRAC_1_PI) * out)).or_zero(active & entry.valid & exit.valid)
    }

    /// The sum of the bounces between a mirror base and a smooth interface before the exit along `exit`.
    #[inline(always)]
    fn bounces(&self, mirror: V3<R>, exit: V3<R>) -> V3<R> {
        let face = fresnel::dielectric(-exit.z.abs(), self.face.eta);
        let again = mirror * (face * transmittance(R::splat(2.0) * self.thickness, exit));
        let most = V3::splat(R::splat(0.999_999));
        V3::splat(R::one()) / (V3::splat(R::one()) - again.min(most))
    }

    /// The contribution of a walk that leaves through a rough interface to `wi`, going up along `w` with
    /// density `chosen`, if it has one; weighted against the exit sampled from `wi`.
    #[inline(always)]
    fn leave(&self, w: V3<R>, wi: V3<R>, chosen: R, has_density: R::Mask) -> R {
        let found = self.face.pdf_of(wi, -w, Ways::Transmission).or_zero(has_density);
        let (value, _) = self.face.eval(-w, wi);
        value.x * balance(chosen, has_density, found)
    }
}

/// [`CoatLanes::value`].
struct Value<'a, R: Real, B> {
    coat: &'a CoatLanes<R>,
    base: &'a B,
    wo: V3<R>,
    wi: V3<R>,
    active: R::Mask,
}

impl<R: Real, B: Base<R>> Task<R> for Value<'_, R, B> {
    type Output = V3<R>;
    #[inline(always)]
    fn run(self) -> V3<R> {
        self.coat.value_inlined(self.base, self.wo, self.wi, self.active)
    }
}

/// The transmittance of a layer of the medium of this height along `w`.
#[inline(always)]
fn transmittance<R: Real>(height: R, w: V3<R>) -> R {
    exp(-(height / w.z.abs()))
}

/// Russian roulette below a quarter: the throughput, and the lanes that live on.
#[inline(always)]
fn roulette<R: Real>(throughput: V3<R>, alive: R::Mask, survival: R) -> (V3<R>, R::Mask) {
    let brightest = throughput.max_component();
    let is_faint = brightest.simd_lt(R::splat(0.25));
    let survives = !is_faint | survival.simd_lt(brightest);
    (V3::select(is_faint, throughput / brightest, throughput), alive & survives)
}

/// The end of a walk: the direction below the interface that refracts to `wi`, and how it is reached.
struct Exit<R: Real> {
    /// Where there is one.
    valid: R::Mask,
    /// Inside the coat; light leaves against it.
    wi: V3<R>,
    weight: V3<R>,
    /// Undefined for a smooth interface, which has no density.
    density: R,
    has_density: R::Mask,
    /// The reflectance of a mirror base towards the exit; black for other bases.
    mirror: V3<R>,
    mirror_base: R::Mask,
    /// Whether a mirror base connects a rough interface to the exit.
    by_mirror: R::Mask,
    /// The downward direction that a mirror base reflects into the exit.
    way_down: V3<R>,
    /// The weight along `way_down` from the interface, by the mirror, to the exit.
    from_face: V3<R>,
}

impl<R: Real> Exit<R> {
    #[inline(always)]
    fn new<B: LaneBsdf<R>>(coat: &CoatLanes<R>, base: &B, wi: V3<R>, u: [R; 2]) -> Self {
        let exit = coat.face.sample_of(wi, R::zero(), u, Ways::Transmission);
        // Traced backwards, the exit carries importance, which is not scaled by η².
        let weight = exit.weight * (exit.eta * exit.eta * wi.z.abs() / exit.wi.z.abs());
        // A mirror base connects light scattered downwards to the exit, too: a smooth interface would transmit
        // none of it otherwise, and a rough one rarely.
        let mirror_base = base.is_delta();
        let mut mirror = V3::splat(R::zero());
        if mirror_base.any() {
            let reflection = base.sample(-exit.wi, R::zero(), [R::zero(); 2]);
            mirror = reflection.weight.or_zero(mirror_base & reflection.valid);
        }
        Self {
            valid: exit.valid,
            wi: exit.wi,
            weight,
            density: exit.pdf,
            has_density: !exit.delta,
            mirror,
            mirror_base,
            by_mirror: !exit.delta & mirror_base,
            way_down: mirrored(exit.wi),
            from_face: weight * mirror * transmittance(R::splat(2.0) * coat.thickness, exit.wi),
        }
    }

    /// The weighted scattering at the interface from `v` into the way down.
    #[inline(always)]
    fn face_to_mirror(&self, coat: &CoatLanes<R>, v: V3<R>, ways: Ways) -> R {
        let found = coat.face.pdf_of(v, self.way_down, ways);
        let (value, _) = coat.face.eval(v, self.way_down);
        value.x * balance(self.density, self.has_density, found)
    }

    /// The weighted scattering at a collision from `w` into the exit, directly or by a mirror base.
    #[inline(always)]
    fn scattered_in_medium(&self, coat: &CoatLanes<R>, w: V3<R>, height: R) -> V3<R> {
        let wi = self.wi;
        let direct = henyey_greenstein(w.dot(-wi), coat.g);
        let share = balance(self.density, self.has_density, direct);
        let mut out = V3::splat(direct * share * transmittance(coat.thickness - height, wi));
        if self.mirror_base.any() {
            let turned = henyey_greenstein(w.dot(self.way_down), coat.g);
            let share = balance(self.density, self.has_density, turned);
            let by_mirror = turned * share * transmittance(height + coat.thickness, wi);
            let both = out + self.mirror * by_mirror;
            let all = V3::select(self.has_density, both, both * coat.bounces(self.mirror, wi));
            out = V3::select(self.mirror_base, all, out);
        }
        out
    }
}

/// The power heuristic for a direction of density `own` that another strategy samples with `other`; 1 if only
/// one can sample it.
#[inline(always)]
fn balance<R: Real>(own: R, has_density: R::Mask, other: R) -> R {
    let ratio = other / own;
    R::select(has_density, (R::one() + ratio * ratio).recip(), R::one())
}

#[cfg(test)]
mod tests {
    use lumbre_math::Vec3;

    use super::*;
    use crate::dielectric::Dielectric;
    use crate::lanes::lane;
    use crate::microfacet::Microfacets;

    #[test]
    fn a_walk_over_a_diffuse_base_has_the_mean_of_the_general_one() {
        let count = if std::env::var_os("LUMBRE_LONG_TESTS").is_some() { 2_000_000 } else { 60_000 };
        let base = DiffuseLanes { reflectance: V3::new(0.9, 0.4, 0.05) };
        let local = |x, y, z| lane(Vec3::new(x, y, z).normalize());
        for (alpha, thickness, max_depth) in
            [((0.0, 0.0), 0.3, 10.0), ((0.3, 0.1), 0.1, 3.0), ((0.8, 0.8), 0.0, 40.0), ((0.2, 0.6), 1.0, 2.0)]
        {
            let face = Dielectric { eta: 1.5, facets: Microfacets::new(alpha.0, alpha.1) }.lane();
            let coat = CoatLanes { face, thickness, g: 0.0, albedo: V3::splat(0.0), max_depth, samples: 1.0 };
            for (wo, wi) in
                [(local(0.1, 0.2, 0.9), local(-0.5, 0.3, 0.6)), (local(0.9, 0.1, 0.3), local(0.6, 0.6, 0.2))]
            {
                let way = Way { wo, wi, random: WalkRandom::new(wo, wi) };
                let mean = |walk: &dyn Fn(u32) -> V3<f32>| {
                    let (mut sum, mut squares) = ([0.0; 3], [0.0; 3]);
                    for i in 0..count {
                        let V3 { x, y, z } = walk(i);
                        for (i, value) in [x, y, z].into_iter().enumerate() {
                            sum[i] += f64::from(value);
                            squares[i] += f64::from(value) * f64::from(value);
                        }
                    }
                    let n = f64::from(count);
                    std::array::from_fn::<_, 3, _>(|i| {
                        (sum[i] / n, (squares[i] / n - (sum[i] / n).powi(2)).max(0.0) / n)
                    })
                };
                let general = mean(&|i| coat.walk(&base, &way, i, true));
                let short = mean(&|i| coat.walk_over_diffuse(base.reflectance, &way, count + i, true));
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
