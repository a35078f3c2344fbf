//! The delta parts of BSDFs: the few directions that a Whitted ray tracer follows one by one.

use lumbre_math::Vec2;
use smallvec::SmallVec;

use crate::dielectric::Ways;
use crate::{Bsdf, BsdfSample, LocalDir, Spectrum};

/// Delta parts: a reflection, a transmission, and what goes straight on.
pub(crate) type Specular = SmallVec<[BsdfSample; 2]>;

impl Bsdf {
    /// Every delta part with its own weight: together with [`Bsdf::eval`] they are the whole BSDF. Equal to the
    /// mean of [`Bsdf::sample`] over its delta samples.
    pub fn specular(&self, wo: LocalDir) -> impl ExactSizeIterator<Item = BsdfSample> + use<> {
        self.delta_parts(wo).into_iter()
    }

    fn delta_parts(&self, wo: LocalDir) -> Specular {
        let nowhere = Vec2::ZERO;
        match self {
            Self::Diffuse(_) | Self::DiffuseTransmission(_) | Self::Hair(_) | Self::Measured(_) => {
                Specular::new()
            }
            Self::Conductor(bsdf) if bsdf.facets.is_smooth() => {
                bsdf.sample(wo, nowhere).into_iter().collect()
            }
            Self::Conductor(_) => Specular::new(),
            Self::Dielectric(bsdf) if bsdf.is_delta() => [Ways::Reflection, Ways::Transmission]
                .into_iter()
                .filter_map(|way| bsdf.sample_of(wo, 0.0, nowhere, way))
                .collect(),
            Self::Dielectric(_) => Specular::new(),
            Self::Subsurface(bsdf) if wo.cos_theta() > 0.0 => Self::Dielectric(bsdf.face).delta_parts(wo),
            Self::Subsurface(_) => Specular::new(),
            Self::ThinDielectric(bsdf) => bsdf.specular(wo),
            Self::CoatedDiffuse(bsdf) => bsdf.specular(wo).into_iter().collect(),
            Self::CoatedConductor(bsdf) => bsdf.specular(wo).into_iter().collect(),
            Self::Principled(bsdf) => bsdf.specular(wo),
            Self::Uber(bsdf) => bsdf.specular(wo),
        }
    }

    /// The weight of unbent delta transmission along `wo`: through a smooth pane without thickness, or an
    /// interface between equal indices. Black for everything else, such as rough panes and refracting glass.
    ///
    /// Since the direction is unchanged, the way to a light beyond is known, and its light is attenuated by
    /// exactly this factor. Only for point and directional lights, which no ray can hit: the light of surfaces
    /// and of the environment is found by [`Bsdf::sample`], which samples these parts, too, and would count
    /// twice.
    pub fn straight_on(&self, wo: LocalDir) -> Spectrum {
        let straight = |part: &BsdfSample| part.transmitted && part.eta == 1.0;
        self.specular(wo).filter(straight).map(|part| part.weight).sum()
    }
}

#[cfg(test)]
mod tests {
    use lumbre_math::Vec3;

    use crate::coated::{Coat, CoatedConductor, CoatedDiffuse};
    use crate::conductor::Conductor;
    use crate::dielectric::{Dielectric, ThinDielectric};
    use crate::diffuse::Diffuse;
    use crate::microfacet::Microfacets;
    use crate::principled::{Body, Principled};
    use crate::uber::Uber;
    use crate::{Scatter, Spectrum};

    use super::*;

    #[test]
    fn delta_parts_are_what_sampling_finds_in_the_mean() {
        let smooth = Microfacets::new(0.0, 0.0);
        let rough = Microfacets::new(0.3, 0.3);
        let metal = |facets| Conductor::from_reflectance(Spectrum::new(0.9, 0.6, 0.2), facets);
        let coat = |facets, albedo: f32| Coat {
            face: Dielectric { eta: 1.4, facets },
            thickness: 0.25,
            g: 0.3,
            albedo: Spectrum::splat(albedo),
            max_depth: 10,
            samples: 1,
        };
        let base = Diffuse { reflectance: Spectrum::new(0.7, 0.5, 0.3) };
        let layered = |bsdf| Bsdf::Principled(Box::new(bsdf));
        let uber = Uber {
            diffuse: Spectrum::splat(0.2),
            glossy: Spectrum::splat(0.1),
            mirror: Spectrum::new(0.4, 0.3, 0.2),
            refracted: Spectrum::splat(0.3),
            passed: Spectrum::new(0.1, 0.2, 0.3),
            eta: 1.5,
            facets: rough,
        };
        let bsdfs = [
            (Bsdf::Diffuse(base), 0),
            (Bsdf::Conductor(metal(smooth)), 1),
            (Bsdf::Conductor(metal(rough)), 0),
            (Bsdf::Dielectric(Dielectric { eta: 1.5, facets: smooth }), 2),
            (Bsdf::Dielectric(Dielectric { eta: 1.5, facets: rough }), 0),
            (Bsdf::ThinDielectric(ThinDielectric { eta: 1.5 }), 2),
            (Bsdf::CoatedDiffuse(CoatedDiffuse { base, coat: coat(smooth, 0.0) }), 1),
            (Bsdf::CoatedDiffuse(CoatedDiffuse { base, coat: coat(rough, 0.0) }), 0),
            (Bsdf::CoatedConductor(CoatedConductor { base: metal(smooth), coat: coat(smooth, 0.0) }), 1),
            (Bsdf::CoatedConductor(CoatedConductor { base: metal(smooth), coat: coat(smooth, 0.4) }), 1),
            (Bsdf::CoatedConductor(CoatedConductor { base: metal(rough), coat: coat(smooth, 0.0) }), 1),
            (Bsdf::CoatedConductor(CoatedConductor { base: metal(smooth), coat: coat(rough, 0.0) }), 0),
            (layered(Principled { transmission: 0.6, facets: smooth, ..Principled::DEFAULT }), 2),
            (layered(Principled { metallic: 0.5, facets: rough, ..Principled::DEFAULT }), 0),
            (Bsdf::Uber(uber), 3),
        ];
        const LOBES: u32 = 4096;
        for (bsdf, parts) in bsdfs {
            for height in [0.4, -0.9] {
                let wo = LocalDir(Vec3::new(0.6, -0.2, height).normalize());
                let specular = bsdf.delta_parts(wo);
                assert_eq!(specular.len(), parts, "{bsdf:?} from {height}");
                let mut sums = [Spectrum::BLACK; 3];
                for i in 0..LOBES {
                    let lobe = (i as f32 + 0.5) / LOBES as f32;
                    let Some(sample) = bsdf.sample(wo, lobe, Vec2::new(0.3, 0.8)) else { continue };
                    if sample.scatter == Scatter::Delta {
                        let part = specular.iter().position(|part| part.wi == sample.wi);
                        sums[part.expect("no other delta direction")] += sample.weight / LOBES as f32;
                    }
                }
                for (part, sum) in specular.iter().zip(sums) {
                    let error = (part.weight + sum * -1.0).map(f32::abs).max_component();
                    assert!(error < 2e-3, "{bsdf:?} from {height}: {part:?}, sampled {sum:?}");
                }
            }
        }
    }

    #[test]
    fn straight_on_goes_what_is_clear_smooth_and_thin() {
        let smooth = Microfacets::SMOOTH;
        let stain = Spectrum::new(0.9, 0.5, 0.125);
        let pane = Principled {
            facets: smooth,
            transmission: 0.5,
            metallic: 0.25,
            transmission_color: stain,
            ..Principled::DEFAULT
        };
        let solid = Body::Solid { spread: 0.0 };
        let layered = |bsdf| Bsdf::Principled(Box::new(bsdf));
        let glass = |eta, facets| Bsdf::Dielectric(Dielectric { eta, facets });
        for height in [0.4, -0.9] {
            let wo = LocalDir(Vec3::new(0.6, -0.2, height).normalize());
            let left = 1.0 - ThinDielectric { eta: 1.5 }.reflected(wo.cos_theta());
            let rough = Microfacets::new(0.1, 0.1);
            let cases = [
                (Bsdf::ThinDielectric(ThinDielectric { eta: 1.5 }), Spectrum::splat(left)),
                (layered(pane), stain * (0.375 * left)),
                (layered(pane.regularized()), Spectrum::BLACK),
                (layered(Principled { facets: rough, ..pane }), Spectrum::BLACK),
                (layered(Principled { body: solid, ..pane }), Spectrum::BLACK),
                (glass(1.5, smooth), Spectrum::BLACK),
                (glass(1.5, rough), Spectrum::BLACK),
                (glass(1.0, smooth), Spectrum::WHITE),
                (Bsdf::Diffuse(Diffuse { reflectance: stain }), Spectrum::BLACK),
            ];
            for (bsdf, expected) in cases {
                let error = (bsdf.straight_on(wo) - expected).map(f32::abs).max_component();
                assert!(error < 1e-6, "{bsdf:?} from {height}: {:?}", bsdf.straight_on(wo));
            }
        }
    }

    #[test]
    fn glass_beyond_the_critical_angle_is_a_mirror_alone() {
        let glass = Bsdf::Dielectric(Dielectric { eta: 1.5, facets: Microfacets::new(0.0, 0.0) });
        let parts = glass.delta_parts(LocalDir(Vec3::new(0.9, 0.1, -0.3).normalize()));
        assert_eq!(parts.len(), 1);
        assert!(!parts[0].transmitted && (parts[0].weight.max_component() - 1.0).abs() < 1e-6);
    }
}
