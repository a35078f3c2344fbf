//! The microfacet distribution of Trowbridge and Reitz (GGX).

use std::f32::consts::PI;

use lumbre_math::{Vec2, Vec3};
use lumbre_simd::math::sin_cos_turns;
use lumbre_simd::{Real, V3};

use crate::lanes::{lane, square, vector};

/// An anisotropic Trowbridge–Reitz distribution of microfacet normals, with Smith's height-correlated
/// shadowing.
///
/// Sources: Walter, Marschner, Li, Torrance, "Microfacet Models for Refraction through Rough Surfaces", EGSR
/// 2007; Heitz, "Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs", JCGT 3(2), 2014;
/// sampling by Dupuy and Benyoub, "Sampling Visible GGX Normals with Spherical Caps", Computer Graphics Forum
/// 42(8), 2023.
///
/// Single scattering only: rough surfaces lose the energy of light that bounces twice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Microfacets {
    // Both zero for a surface that counts as smooth; otherwise both positive.
    alpha: Vec2,
}

impl Microfacets {
    /// Below this largest α a surface counts as smooth.
    pub const SMOOTH_BELOW: f32 = 1e-3;

    /// A distribution by its two α ≥ 0, along x and y of the shading frame. NaN counts as zero.
    pub fn new(alpha_x: f32, alpha_y: f32) -> Self {
        let alpha = Vec2::new(alpha_x.max(0.0), alpha_y.max(0.0)).min(Vec2::splat(1e4));
        let smooth = alpha.max_element() < Self::SMOOTH_BELOW;
        // The smaller α of a very anisotropic pair is clamped to where the arithmetic below stays finite.
        Self { alpha: if smooth { Vec2::ZERO } else { alpha.max(Vec2::splat(1e-4)) } }
    }

    /// A mirror.
    pub const SMOOTH: Self = Self { alpha: Vec2::ZERO };

    /// The roughest: α = 1.
    pub const ROUGH: Self = Self { alpha: Vec2::ONE };

    /// Whether the surface counts as smooth; if so, the other methods are meaningless.
    pub fn is_smooth(&self) -> bool {
        self.alpha == Vec2::ZERO
    }

    /// The two α.
    pub fn alpha(&self) -> Vec2 {
        self.alpha
    }

    /// A rougher distribution: each α below 0.3 is doubled and clamped to [0.1, 0.3].
    #[must_use]
    pub fn regularized(&self) -> Self {
        let FacetLanes { alpha_x, alpha_y } = self.lane().regularized(true);
        Self { alpha: Vec2::new(alpha_x, alpha_y) }
    }

    /// The density D of facets with the unit normal `m` (of either sign), per unit of solid angle and surface
    /// area: ∫ D(m) cos θ dm = 1 over the hemisphere.
    pub fn density(&self, m: Vec3) -> f32 {
        self.lane().density(lane(m))
    }

    /// G₁(w) / |cos θ|: the fraction of facets visible from `w`, per projected surface area.
    pub fn visible_per_cosine(&self, w: Vec3) -> f32 {
        self.lane().visible_per_cosine(lane(w))
    }

    /// G₂(wo, wi) / (|cos θo| |cos θi|): the fraction of facets visible from both; the directions may be on
    /// different sides.
    pub fn both_visible_per_cosines(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.lane().both_visible_per_cosines(lane(wo), lane(wi))
    }

    /// G₂ / G₁(wo): the fraction of the facets visible from `wo` that are visible from `wi`, too.
    pub fn also_visible(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.lane().also_visible(lane(wo), lane(wi))
    }

    /// The density per solid angle of visible normals from `w`: that of [`Microfacets::sample_visible`].
    pub fn visible_density(&self, w: Vec3, m: Vec3) -> f32 {
        self.lane().visible_density(lane(w), lane(m))
    }

    /// A facet normal sampled among those visible from `w`, pointing up (z ≥ 0) on its side of the surface.
    pub fn sample_visible(&self, w: Vec3, u: Vec2) -> Vec3 {
        vector(self.lane().sample_visible(lane(w), square(u)))
    }

    /// The same in one lane.
    pub(crate) fn lane(&self) -> FacetLanes<f32> {
        FacetLanes { alpha_x: self.alpha.x, alpha_y: self.alpha.y }
    }
}

/// [`Microfacets`] over lanes. Where they are smooth, only [`FacetLanes::is_smooth`] and [`FacetLanes::regularized`]
/// mean anything.
#[derive(Clone, Copy, Debug)]
pub struct FacetLanes<R: Real> {
    /// α along x; with `alpha_y` as [`Microfacets::new`] makes them: both zero or both positive.
    pub alpha_x: R,
    /// α along y.
    pub alpha_y: R,
}

impl<R: Real> FacetLanes<R> {
    /// [`Microfacets::is_smooth`].
    #[inline(always)]
    pub fn is_smooth(&self) -> R::Mask {
        self.alpha_x.simd_eq(R::zero())
    }

    /// [`Microfacets::regularized`] where the mask is true.
    #[inline(always)]
    #[must_use]
    pub fn regularized(self, mask: R::Mask) -> Self {
        Self {
            alpha_x: R::select(mask, rougher(self.alpha_x), self.alpha_x),
            alpha_y: R::select(mask, rougher(self.alpha_y), self.alpha_y),
        }
    }

    /// [`Microfacets::density`].
    #[inline(always)]
    pub fn density(&self, m: V3<R>) -> R {
        let h2 = V3::new(m.x / self.alpha_x, m.y / self.alpha_y, m.z).length_squared();
        (R::splat(PI) * self.alpha_x * self.alpha_y * h2 * h2).recip()
    }

    /// |(α ∘ w.xy, w.z)|: Smith's auxiliary function is Λ(w) = (stretch(w) / |w.z| − 1) / 2. In terms of
    /// it nothing divides by a cosine, and grazing directions need no special case.
    #[inline(always)]
    fn stretch(&self, w: V3<R>) -> R {
        V3::new(self.alpha_x * w.x, self.alpha_y * w.y, w.z).length()
    }

    /// [`Microfacets::visible_per_cosine`].
    #[inline(always)]
    pub fn visible_per_cosine(&self, w: V3<R>) -> R {
        R::splat(2.0) / (w.z.abs() + self.stretch(w))
    }

    /// [`Microfacets::both_visible_per_cosines`].
    #[inline(always)]
    pub fn both_visible_per_cosines(&self, wo: V3<R>, wi: V3<R>) -> R {
        R::splat(2.0) / (self.stretch(wo) * wi.z.abs() + self.stretch(wi) * wo.z.abs())
    }

    /// [`Microfacets::also_visible`].
    #[inline(always)]
    pub fn also_visible(&self, wo: V3<R>, wi: V3<R>) -> R {
        self.both_visible_per_cosines(wo, wi) * wi.z.abs() / self.visible_per_cosine(wo)
    }

    /// [`Microfacets::visible_density`].
    #[inline(always)]
    pub fn visible_density(&self, w: V3<R>, m: V3<R>) -> R {
        self.visible_per_cosine(w) * self.density(m) * w.dot(m).abs()
    }

    /// [`Microfacets::sample_visible`].
    #[inline(always)]
    pub fn sample_visible(&self, w: V3<R>, u: [R; 2]) -> V3<R> {
        let up = V3::select(w.z.simd_lt(R::zero()), -w, w);
        // With facets stretched to those of a unit hemisphere, reflections of `view` are uniform on a spherical
        // cap.
        let view = V3::new(up.x * self.alpha_x, up.y * self.alpha_y, up.z).normalize();
        let below_pole = u[1] * (R::one() + view.z);
        let z = R::one() - below_pole;
        // 1 − z² without cancellation near the pole.
        let sin = (below_pole * (R::one() + z)).simd_max(R::zero()).sqrt();
        let (sin_phi, cos_phi) = sin_cos_turns(u[0]);
        let half = V3::new(sin * cos_phi, sin * sin_phi, z) + view;
        let m = V3::new(half.x * self.alpha_x, half.y * self.alpha_y, half.z.simd_max(R::zero()));
        let has_direction = m.length_squared().simd_gt(R::zero());
        V3::select(has_direction, m.normalize(), V3::constant([0.0, 0.0, 1.0]))
    }
}

#[inline(always)]
fn rougher<R: Real>(alpha: R) -> R {
    let doubled = (R::splat(2.0) * alpha).simd_max(R::splat(0.1)).simd_min(R::splat(0.3));
    R::select(alpha.simd_lt(R::splat(0.3)), doubled, alpha)
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALPHAS: [(f32, f32); 4] = [(0.02, 0.02), (0.3, 0.3), (0.1, 0.7), (1.0, 0.4)];

    /// ∫ f over the upper hemisphere, finest about the pole, where the facets of a polished surface point.
    fn integrate(mut f: impl FnMut(Vec3) -> f64) -> f64 {
        let (rings, sectors) = (1500, 720);
        let mut sum = 0.0;
        for i in 0..rings {
            // θ = (π/2) t³
            let t = (f64::from(i) + 0.5) / f64::from(rings);
            let theta = 0.5 * std::f64::consts::PI * t.powi(3);
            let d_theta = 0.5 * std::f64::consts::PI * 3.0 * t * t / f64::from(rings);
            for j in 0..sectors {
                let phi = (f64::from(j) + 0.5) / f64::from(sectors) * std::f64::consts::TAU;
                let (sin_phi, cos_phi) = phi.sin_cos();
                let m = Vec3::new(
                    (theta.sin() * cos_phi) as f32,
                    (theta.sin() * sin_phi) as f32,
                    theta.cos() as f32,
                );
                sum += f(m) * theta.sin() * d_theta * std::f64::consts::TAU / f64::from(sectors);
            }
        }
        sum
    }

    #[test]
    fn the_facets_cover_the_surface_once() {
        for (ax, ay) in ALPHAS {
            let facets = Microfacets::new(ax, ay);
            let covered = integrate(|m| f64::from(facets.density(m) * m.z));
            assert!((covered - 1.0).abs() < 2e-3, "{ax} {ay}: {covered}");
        }
    }

    #[test]
    fn the_visible_facets_cover_the_projected_surface() {
        for (ax, ay) in ALPHAS {
            let facets = Microfacets::new(ax, ay);
            for w in [Vec3::new(0.1, 0.2, 0.9), Vec3::new(0.8, -0.3, 0.3), Vec3::new(0.2, 0.97, -0.05)] {
                let w = w.normalize();
                let up = if w.z < 0.0 { -w } else { w };
                let visible =
                    integrate(
                        |m| {
                            if up.dot(m) > 0.0 { f64::from(facets.visible_density(w, m)) } else { 0.0 }
                        },
                    );
                assert!((visible - 1.0).abs() < 3e-3, "{ax} {ay} {w}: {visible}");
            }
        }
    }

    #[test]
    fn below_a_thousandth_a_surface_is_smooth() {
        assert!(Microfacets::new(9e-4, 0.0).is_smooth());
        assert!(Microfacets::new(f32::NAN, -3.0).is_smooth());
        assert!(!Microfacets::new(1e-3, 0.0).is_smooth());
        assert!(!Microfacets::new(0.0, 2.0).is_smooth());
    }

    #[test]
    fn grazing_directions_give_finite_values() {
        let w = Vec3::new(1.0, 0.0, 0.0);
        for (ax, ay) in ALPHAS {
            let facets = Microfacets::new(ax, ay);
            for u in [Vec2::ZERO, Vec2::new(0.3, 0.999_999_9), Vec2::new(0.999_999_9, 0.5)] {
                let m = facets.sample_visible(w, u);
                assert!((m.length() - 1.0).abs() < 1e-5 && m.z >= 0.0);
                assert!(facets.visible_density(w, m).is_finite());
                assert!(facets.also_visible(w, Vec3::Z).is_finite());
            }
        }
    }
}
