//! A surface as a path meets it, and light that arrives at it straight from a light.

use lumbre_math::{DVec3, Vec2, Vec3};
use lumbre_scene::{Interaction, LightSample, Scene};
use lumbre_shading::{Bsdf, LocalDir, Material, Scatter, ShadingFrame, Spectrum};

use crate::RayCounts;
use crate::interior::Interiors;

/// A surface as seen along a path, ready to scatter.
///
/// A shading normal is a lie about the surface, and some directions that a BSDF scatters to on its side of it lie on
/// the other side of the surface as it is. They are folded back: mirrored in the plane of the surface. What goes through
/// likewise stays on the far side. So nothing is lost that the BSDF gives (a white surface stays white whatever its normals),
/// and no light leaks. At grazing angles, where a reflection would point into the surface, it comes to point out of it as
/// far. Others let it be (and have dark specks at silhouettes of coarse meshes), or turn the normal: A. Keller and others,
/// "The Iray Light Transport Simulation and Rendering System", 2017, A.3.
pub(crate) struct Vertex<'a, 's> {
    pub met: &'a Interaction<'s>,
    pub bsdf: Bsdf,
    pub material: &'s Material,
    frame: ShadingFrame,
    wo: LocalDir,
    /// The geometric normal, on the side of `wo`; `None` where it is the shading normal.
    geometric: Option<Vec3>,
}

/// A direction in which a path goes on.
pub(crate) struct Bounce {
    /// Unit.
    pub direction: DVec3,
    /// f · |cos θ| / pdf.
    pub weight: Spectrum,
    /// How it was chosen; the density counts every way to the same direction.
    pub scatter: Scatter,
    /// Whether it crosses the surface.
    pub transmitted: bool,
    /// η of the side that it enters over that of the side it leaves.
    pub eta: f32,
}

impl<'a, 's> Vertex<'a, 's> {
    /// `None` where nothing scatters.
    pub fn new(met: &'a Interaction<'s>, interiors: &Interiors<'s>) -> Option<Self> {
        Self::of(met, met.resolved()?, interiors)
    }

    /// One vertex for each material of a mixture, with its share: see [`Interaction::parts`].
    pub fn parts(
        met: &'a Interaction<'s>,
        least: f32,
        interiors: &'a Interiors<'s>,
    ) -> impl Iterator<Item = (f32, Self)> {
        let parts = met.parts(least).into_iter();
        parts.filter_map(move |(share, material)| Some((share, Self::of(met, material, interiors)?)))
    }

    fn of(met: &'a Interaction<'s>, material: &'s Material, interiors: &Interiors<'s>) -> Option<Self> {
        let towards = met.towards_origin.as_vec3();
        let (frame, mut bsdf) = material.shading(&met.at, &met.shading, towards)?;
        if material.is_solid() {
            let outside = interiors.index_outside(material, met.front);
            if outside != 1.0 {
                bsdf = bsdf.immersed(outside);
            }
        }
        let wo = frame.to_local(towards);
        let geometric = met.shading.geometric;
        let geometric =
            (frame.n.dot(geometric) < 1.0 - 1e-6).then(|| if met.front { geometric } else { -geometric });
        Some(Self { met, bsdf, material, frame, wo, geometric })
    }

    /// Whether a direction leaves on the side of `wo`.
    fn reflects(&self, wi: Vec3) -> bool {
        match self.geometric {
            Some(normal) => normal.dot(wi) > 0.0,
            None => self.wo.same_hemisphere(self.frame.to_local(wi)),
        }
    }

    /// The directions of the BSDF that come to be this one: itself, and what is folded onto it.
    fn unfolded(&self, wi: Vec3) -> impl Iterator<Item = LocalDir> {
        let folded = self.geometric.map(|normal| mirrored(wi, normal));
        let reflects = self.reflects(wi);
        [Some(wi), folded].into_iter().flatten().filter_map(move |wi| {
            let wi = self.frame.to_local(wi);
            (self.wo.same_hemisphere(wi) == reflects).then_some(wi)
        })
    }

    /// f · |cos θ| towards a unit direction of the world.
    pub fn eval(&self, wi: DVec3) -> Spectrum {
        self.unfolded(wi.as_vec3()).map(|wi| self.bsdf.eval(self.wo, wi)).sum()
    }

    /// The density with which [`Vertex::sample`] chooses a unit direction of the world, delta parts left out.
    pub fn pdf(&self, wi: DVec3) -> f32 {
        self.unfolded(wi.as_vec3()).map(|wi| self.bsdf.pdf(self.wo, wi)).sum()
    }

    /// Chooses a direction to go on in.
    pub fn sample(&self, lobe: f32, u: Vec2) -> Option<Bounce> {
        let sample = self.bsdf.sample(self.wo, lobe, u)?;
        let mut bounce = self.bounce(&sample);
        if let (Scatter::Density(_), Some(_)) = (sample.scatter, self.geometric) {
            let pdf = self.pdf(bounce.direction);
            // On the very border between the sides rounding may find no way at all.
            if pdf > 0.0 {
                bounce.scatter = Scatter::Density(pdf);
            }
        }
        Some(bounce)
    }

    /// Its mirrors and its glass: every delta part.
    pub fn specular(&self) -> impl Iterator<Item = Bounce> {
        self.bsdf.specular(self.wo).into_iter().map(|sample| self.bounce(&sample))
    }

    fn bounce(&self, sample: &lumbre_shading::BsdfSample) -> Bounce {
        let mut direction = self.frame.to_world(sample.wi);
        if let Some(normal) = self.geometric
            && (normal.dot(direction) > 0.0) == sample.transmitted
        {
            direction = mirrored(direction, normal);
        }
        Bounce {
            direction: direction.as_dvec3().normalize(),
            weight: sample.weight,
            scatter: sample.scatter,
            transmitted: sample.transmitted,
            eta: sample.eta,
        }
    }

    /// What the vertex scatters of a light's sample towards the path, weighed against the other way to find the same
    /// light: the density with which the BSDF would have chosen it.
    pub fn scattered(
        &self,
        scene: &Scene,
        sample: &LightSample,
        interiors: &Interiors<'s>,
        weigh: impl FnOnce(f32, f32) -> f32,
        rays: &mut RayCounts,
    ) -> Spectrum {
        let scattered = self.eval(sample.towards) * sample.radiance;
        if scattered.is_black() {
            return Spectrum::BLACK;
        }
        let weight = match sample.scatter {
            Scatter::Delta => 1.0,
            Scatter::Density(pdf) => weigh(pdf, self.pdf(sample.towards)) / pdf,
        };
        if weight <= 0.0 {
            return Spectrum::BLACK;
        }
        rays.shadow += 1;
        if scene.is_occluded(&self.met.shadow_ray(sample)) {
            return Spectrum::BLACK;
        }
        scattered * weight * self.passes(sample, interiors)
    }

    /// What the solids around leave of a light's sample.
    pub fn passes(&self, sample: &LightSample, interiors: &Interiors<'s>) -> Spectrum {
        // Light from infinitely far away was not inside anything.
        let Some(end) = sample.end else { return Spectrum::WHITE };
        let crosses = self.material.is_solid() && !self.reflects(sample.towards.as_vec3());
        if !crosses && !interiors.attenuates() {
            return Spectrum::WHITE;
        }
        let mut interiors = interiors.clone();
        if crosses {
            interiors.cross(self.material, self.met.front);
        }
        interiors.transmittance((end.point - self.met.surface.point).length())
    }
}

fn mirrored(w: Vec3, normal: Vec3) -> Vec3 {
    w - normal * (2.0 * normal.dot(w))
}

/// The power heuristic (Veach, "Robust Monte Carlo Methods for Light Transport Simulation", 1997) for two ways.
pub(crate) fn power_heuristic(this: f32, other: f32) -> f32 {
    if this.is_infinite() {
        return 1.0;
    }
    // By the ratio, for a square may overflow.
    let ratio = other / this;
    1.0 / (1.0 + ratio * ratio)
}

#[cfg(test)]
mod tests {
    use super::power_heuristic;

    #[test]
    fn the_weights_of_both_ways_sum_to_one_at_any_size() {
        for (a, b) in [(2.0, 3.0), (1e30, 2e30), (1e-30, 5e-30), (7.0, 0.0), (0.5, 1e25)] {
            let sum = power_heuristic(a, b) + if b > 0.0 { power_heuristic(b, a) } else { 0.0 };
            assert!((sum - 1.0).abs() < 1e-6, "{a} {b} {sum}");
        }
        assert_eq!(power_heuristic(f32::INFINITY, 2.0), 1.0);
    }
}
