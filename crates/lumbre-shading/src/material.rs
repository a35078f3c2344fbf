//! The closed set of materials.

use std::sync::Arc;

use lumbre_math::random::{combine, hash_dvec3, hash_vec3, uniform_f32};
use lumbre_math::{Vec2, Vec3};
use lumbre_simd::V3;
use smallvec::{SmallVec, smallvec};

use crate::coated::{Coat, CoatedConductor, CoatedDiffuse};
use crate::conductor::Conductor;
use crate::dielectric::{Dielectric, ThinDielectric};
use crate::diffuse::{Diffuse, DiffuseTransmission};
use crate::hair::HairParams;
use crate::measured::{Measured, MeasuredTables};
use crate::microfacet::Microfacets;
use crate::spectrum::Wavelengths;
use crate::subsurface::SubsurfaceParams;
use crate::uber::UberParams;
use crate::{
    Bsdf, FloatTexture, HomogeneousMedium, ImageTexture, PrincipledParams, ShadingFrame, ShadingNormals,
    Spectrum, SpectrumTexture, SpectrumValue, Texture, TextureContext,
};

/// The roughness group of parameters.
#[derive(Clone, Debug)]
pub struct Roughness {
    /// Along ∂p/∂u.
    pub u: Arc<FloatTexture>,
    /// Along ∂p/∂v.
    pub v: Arc<FloatTexture>,
    /// Whether α is the square root of the given value, or the value.
    pub remap: bool,
}

/// The metal under a coat, by its index of refraction or by its reflectance at normal incidence. Both are given
/// against vacuum; under the coat, the index is divided by the coat's.
#[derive(Clone, Debug)]
pub enum Metal {
    /// By its index of refraction.
    Index {
        /// Real part.
        eta: Arc<SpectrumTexture>,
        /// Imaginary part.
        k: Arc<SpectrumTexture>,
    },
    /// By its reflectance.
    Reflectance(Arc<SpectrumTexture>),
}

impl Metal {
    fn conductor(&self, at: &TextureContext, facets: Microfacets) -> Conductor {
        match self {
            Self::Index { eta, k } => by_index(eta, k, at, facets),
            Self::Reflectance(reflectance) => by_reflectance(reflectance, at, facets),
        }
    }
}

/// The appearance of a surface, as a function of position.
#[derive(Clone, Debug)]
pub struct Material {
    /// The kind, with its parameters.
    pub kind: MaterialKind,
    /// Bump map: a displacement whose slope tilts the shading normal.
    pub displacement: Option<Arc<FloatTexture>>,
    /// A tangent-space normal map.
    pub normal_map: Option<ImageTexture>,
    /// Whether camera rays pass through its back. Light does not: it still casts shadows.
    pub one_sided: bool,
    /// The index of refraction of a dielectric, or of a coat, by wavelength, which takes the place of its number where
    /// paths carry wavelengths.
    pub dispersion: Option<Arc<SpectrumValue>>,
}

/// The kinds of material. Parameters and defaults are those of the scene language.
#[derive(Clone, Debug)]
pub enum MaterialKind {
    /// Lambert.
    Diffuse {
        /// Albedo.
        reflectance: Arc<SpectrumTexture>,
    },
    /// A metal by its index of refraction.
    Conductor {
        /// Real part.
        eta: Arc<SpectrumTexture>,
        /// Imaginary part.
        k: Arc<SpectrumTexture>,
        /// Roughness.
        roughness: Roughness,
    },
    /// A metal by its reflectance at normal incidence.
    ConductorReflectance {
        /// Reflectance at normal incidence.
        reflectance: Arc<SpectrumTexture>,
        /// Roughness.
        roughness: Roughness,
    },
    /// Glass.
    Dielectric {
        /// Index of refraction, inside over outside.
        eta: f32,
        /// Roughness.
        roughness: Roughness,
    },
    /// A pane of glass without thickness.
    ThinDielectric {
        /// Index of refraction of the pane over that of its surroundings.
        eta: f32,
    },
    /// A diffuse base under a rough dielectric coat with a medium between.
    CoatedDiffuse {
        /// Reflectance of the base.
        reflectance: Arc<SpectrumTexture>,
        /// Roughness of the coat.
        roughness: Roughness,
        /// Thickness of the coat, in mean free paths.
        thickness: Arc<FloatTexture>,
        /// Index of refraction of the coat.
        eta: f32,
        /// Henyey–Greenstein asymmetry of the medium.
        g: Arc<FloatTexture>,
        /// Single-scattering albedo of the medium.
        albedo: Arc<SpectrumTexture>,
        /// Maximal number of bounces of the random walk.
        max_depth: u32,
        /// Random walks per evaluation.
        samples: u32,
    },
    /// A metal under a rough dielectric coat with a medium between.
    CoatedConductor {
        /// The base.
        metal: Metal,
        /// Roughness of the base.
        roughness: Roughness,
        /// Roughness of the coat.
        interface_roughness: Roughness,
        /// Thickness of the coat, in mean free paths.
        thickness: Arc<FloatTexture>,
        /// Index of refraction of the coat.
        interface_eta: f32,
        /// Henyey–Greenstein asymmetry of the medium.
        g: Arc<FloatTexture>,
        /// Single-scattering albedo of the medium.
        albedo: Arc<SpectrumTexture>,
        /// Maximal number of bounces of the random walk.
        max_depth: u32,
        /// Random walks per evaluation.
        samples: u32,
    },
    /// Lambert on both sides.
    DiffuseTransmission {
        /// Albedo of reflection.
        reflectance: Arc<SpectrumTexture>,
        /// Albedo of transmission.
        transmittance: Arc<SpectrumTexture>,
        /// A factor on both.
        scale: f32,
    },
    /// Layers of metal, plastic, glass, cloth and lacquer: all that glTF can express.
    Principled(Box<PrincipledParams>),
    /// pbrt-v3's `uber` and `plastic`: lobes side by side.
    Uber(Box<UberParams>),
    /// Hair and fur, on curves.
    Hair(Box<HairParams>),
    /// A measured surface.
    Measured(Arc<MeasuredTables>),
    /// A body that light wanders through below its surface.
    Subsurface(Box<SubsurfaceParams>),
    /// A texture of a POV-Ray scene.
    Pov(Arc<crate::pov::PovMaterial>),
    /// One of two, chosen at random by position and direction.
    Mix {
        /// The materials at amount 0 and 1.
        materials: [Arc<Material>; 2],
        /// The share of the second.
        amount: Arc<FloatTexture>,
    },
    /// No scattering: an interface between media.
    Interface,
}

impl MaterialKind {
    /// The names of the kinds in the scene language, in the order of this enum, which has others that it cannot say.
    pub const NAMES: [&str; 14] = [
        "diffuse",
        "conductor",
        "dielectric",
        "thindielectric",
        "coateddiffuse",
        "coatedconductor",
        "diffusetransmission",
        "principled",
        "uber",
        "hair",
        "measured",
        "subsurface",
        "mix",
        "interface",
    ];

    /// The name in the scene language.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Diffuse { .. } => "diffuse",
            Self::Conductor { .. } | Self::ConductorReflectance { .. } => "conductor",
            Self::Dielectric { .. } => "dielectric",
            Self::ThinDielectric { .. } => "thindielectric",
            Self::CoatedDiffuse { .. } => "coateddiffuse",
            Self::CoatedConductor { .. } => "coatedconductor",
            Self::DiffuseTransmission { .. } => "diffusetransmission",
            Self::Principled(_) => "principled",
            Self::Uber(_) => "uber",
            Self::Hair(_) => "hair",
            Self::Measured(_) => "measured",
            Self::Subsurface(_) => "subsurface",
            Self::Pov(_) => "pov",
            Self::Mix { .. } => "mix",
            Self::Interface => "interface",
        }
    }
}

/// The materials of a mixture, with their shares.
type Parts<'m> = SmallVec<[(f32, &'m Material); 2]>;

/// The local surface that bump and normal maps tilt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalSurface {
    /// Shading normal, unit, on the geometric normal's side.
    pub normal: Vec3,
    /// ∂p/∂u of the shading surface.
    pub dpdu: Vec3,
    /// ∂p/∂v of the shading surface.
    pub dpdv: Vec3,
    /// ∂n/∂u.
    pub dndu: Vec3,
    /// ∂n/∂v.
    pub dndv: Vec3,
    /// The geometric normal, unit.
    pub geometric: Vec3,
    /// The side of the bitangent of normal maps: 1 for normal × tangent, -1 where the texture is mirrored.
    pub handedness: f32,
}

impl Material {
    /// A material of a kind, without bump or normal map.
    pub fn new(kind: MaterialKind) -> Self {
        Self { kind, displacement: None, normal_map: None, one_sided: false, dispersion: None }
    }

    /// Resolves mixtures to the one material that applies at a position. The choice is a hash of the position
    /// and `wo` (unit, world space), so it is deterministic. An amount of 0 or less always gives the first, of
    /// 1 or more always the second.
    pub fn resolve(&self, at: &TextureContext, wo: Vec3) -> &Self {
        let mut material = self;
        let mut key = None;
        while let MaterialKind::Mix { materials, amount } = &material.kind {
            let amount = amount.evaluate(at);
            let second = if amount <= 0.0 {
                false
            } else if amount >= 1.0 {
                true
            } else {
                // Rehashed for each level, or nested mixtures would be correlated.
                let k = key.map_or_else(|| combine(hash_dvec3(at.point), hash_vec3(wo)), |k| combine(k, 1));
                key = Some(k);
                uniform_f32(k) < amount
            };
            material = &materials[usize::from(second)];
        }
        material
    }

    /// Whether it is known to be uniform, so that it needs no footprint; kinds with many parameters count as
    /// textured.
    pub fn is_uniform(&self) -> bool {
        let smooth = |roughness: &Roughness| roughness.u.is_constant() && roughness.v.is_constant();
        let mut rest: SmallVec<[&Self; 4]> = smallvec![self];
        // Mixtures may share materials, so the number of steps is bounded.
        for _ in 0..64 {
            let Some(material) = rest.pop() else { return true };
            let is_uniform = match &material.kind {
                MaterialKind::Diffuse { reflectance } => reflectance.is_constant(),
                MaterialKind::Conductor { eta, k, roughness } => {
                    eta.is_constant() && k.is_constant() && smooth(roughness)
                }
                MaterialKind::ConductorReflectance { reflectance, roughness } => {
                    reflectance.is_constant() && smooth(roughness)
                }
                MaterialKind::Dielectric { roughness, .. } => smooth(roughness),
                MaterialKind::ThinDielectric { .. } | MaterialKind::Measured(_) | MaterialKind::Interface => {
                    true
                }
                MaterialKind::CoatedDiffuse { reflectance, roughness, thickness, g, albedo, .. } => {
                    let base = reflectance.is_constant() && smooth(roughness);
                    base && thickness.is_constant() && g.is_constant() && albedo.is_constant()
                }
                MaterialKind::Principled(params) => params.is_uniform(),
                MaterialKind::Uber(params) => params.is_uniform(),
                MaterialKind::Mix { materials, amount } => {
                    rest.extend(materials.iter().map(|material| &**material));
                    amount.is_constant()
                }
                MaterialKind::CoatedConductor { .. }
                | MaterialKind::DiffuseTransmission { .. }
                | MaterialKind::Hair(_)
                | MaterialKind::Subsurface(_)
                | MaterialKind::Pov(_) => false,
            };
            if !is_uniform || material.displacement.is_some() || material.normal_map.is_some() {
                return false;
            }
        }
        false
    }

    /// Whether it has a bump map, which looks at how the surface curves; of a mixture, any part; true when in doubt.
    pub fn has_displacement(&self) -> bool {
        let mut rest: SmallVec<[&Self; 4]> = smallvec![self];
        // Mixtures may share materials, so the number of steps is bounded.
        for _ in 0..64 {
            let Some(material) = rest.pop() else { return false };
            if material.displacement.is_some() {
                return true;
            }
            if let MaterialKind::Mix { materials, .. } = &material.kind {
                rest.extend(materials.iter().map(|material| &**material));
            }
        }
        true
    }

    /// Whether light may pass to the other side; of a mixture, through any part.
    pub fn is_transmissive(&self) -> bool {
        self.has_part(|kind| match kind {
            MaterialKind::Dielectric { .. }
            | MaterialKind::ThinDielectric { .. }
            | MaterialKind::DiffuseTransmission { .. }
            | MaterialKind::Hair(_)
            | MaterialKind::Subsurface(_) => true,
            MaterialKind::Principled(params) => params.is_transmissive(),
            MaterialKind::Uber(params) => params.is_transmissive(),
            MaterialKind::Pov(material) => material.is_transmissive(),
            MaterialKind::Diffuse { .. }
            | MaterialKind::Conductor { .. }
            | MaterialKind::ConductorReflectance { .. }
            | MaterialKind::CoatedDiffuse { .. }
            | MaterialKind::CoatedConductor { .. }
            | MaterialKind::Measured(_)
            | MaterialKind::Mix { .. }
            | MaterialKind::Interface => false,
        })
    }

    /// Whether [`Bsdf::straight_on`] may be other than black anywhere on it; of a mixture, on any part.
    pub fn has_delta_transmission(&self) -> bool {
        self.has_part(|kind| match kind {
            MaterialKind::ThinDielectric { .. } => true,
            MaterialKind::Dielectric { eta, .. } => index(*eta) == 1.0,
            MaterialKind::Principled(params) => params.has_delta_transmission(),
            MaterialKind::Uber(params) => params.has_delta_transmission(),
            MaterialKind::Pov(material) => material.has_delta_transmission(),
            MaterialKind::Diffuse { .. }
            | MaterialKind::Conductor { .. }
            | MaterialKind::ConductorReflectance { .. }
            | MaterialKind::CoatedDiffuse { .. }
            | MaterialKind::CoatedConductor { .. }
            | MaterialKind::DiffuseTransmission { .. }
            | MaterialKind::Hair(_)
            | MaterialKind::Measured(_)
            | MaterialKind::Subsurface(_)
            | MaterialKind::Mix { .. }
            | MaterialKind::Interface => false,
        })
    }

    /// Whether [`Bsdf::specular`] may have any part anywhere on it: a mirror, smooth glass, a smooth coat; of a
    /// mixture, on any part.
    pub fn may_be_specular(&self) -> bool {
        self.has_part(|kind| match kind {
            MaterialKind::Conductor { roughness, .. }
            | MaterialKind::ConductorReflectance { roughness, .. }
            | MaterialKind::Dielectric { roughness, .. }
            | MaterialKind::CoatedDiffuse { roughness, .. }
            | MaterialKind::CoatedConductor { interface_roughness: roughness, .. } => {
                roughness.may_be_smooth()
            }
            MaterialKind::ThinDielectric { .. } => true,
            MaterialKind::Principled(params) => params.may_be_specular(),
            MaterialKind::Uber(params) => params.may_be_specular(),
            MaterialKind::Subsurface(params) => params.roughness.may_be_smooth(),
            MaterialKind::Pov(material) => material.may_be_specular(),
            MaterialKind::Diffuse { .. } | MaterialKind::DiffuseTransmission { .. } => false,
            MaterialKind::Hair(_) | MaterialKind::Measured(_) => false,
            MaterialKind::Mix { .. } | MaterialKind::Interface => false,
        })
    }

    /// Whether it, or a part of the mixture, is of some kind; true when in doubt, for mixtures of very many
    /// parts.
    fn has_part(&self, is: impl Fn(&MaterialKind) -> bool) -> bool {
        self.any_part(&|part| is(&part.kind))
    }

    /// [`Self::has_part`] of whole materials.
    fn any_part(&self, is: &dyn Fn(&Self) -> bool) -> bool {
        let mut rest: SmallVec<[&Self; 4]> = smallvec![self];
        // Mixtures may share materials, so the number of steps is bounded.
        for _ in 0..64 {
            let Some(material) = rest.pop() else { return false };
            match &material.kind {
                MaterialKind::Mix { materials, .. } => {
                    rest.extend(materials.iter().map(|material| &**material));
                }
                _ if is(material) => return true,
                _ => {}
            }
        }
        true
    }

    /// The parts of a mixture at a position, each material with its share; a simple material is its only part.
    /// A mixture whose own share is less than `least` is not split but represented by the material that
    /// [`Material::resolve`] chooses. Shares sum to 1, and the number of parts is at most the number of
    /// mixtures and of shares above `least`.
    pub fn parts<'m>(
        &'m self,
        at: &TextureContext,
        wo: Vec3,
        least: f32,
    ) -> impl Iterator<Item = (f32, &'m Self)> + use<'m> {
        let mut parts = Parts::new();
        let mut rest: Parts = smallvec![(1.0, self)];
        while let Some((share, material)) = rest.pop() {
            let MaterialKind::Mix { materials: [first, second], amount } = &material.kind else {
                parts.push((share, material));
                continue;
            };
            let amount = amount.evaluate(at);
            if amount >= 1.0 {
                rest.push((share, second));
            } else if amount > 0.0 && share < least {
                parts.push((share, material.resolve(at, wo)));
            } else if amount > 0.0 {
                rest.extend([(share * amount, &**second), (share * (1.0 - amount), first)]);
            } else {
                rest.push((share, first));
            }
        }
        parts.into_iter()
    }

    /// The shading frame after bump and normal maps. A normal map takes precedence over a displacement. The
    /// frame stays on the side of the surface's normal; the surface's own is used where a map gives nothing
    /// finite.
    pub fn frame(&self, at: &TextureContext, surface: &LocalSurface) -> ShadingFrame {
        let plain = || ShadingFrame::new(surface.normal, surface.dpdu);
        if let MaterialKind::Pov(material) = &self.kind {
            let normal = material.tilted(at, surface.normal);
            return turned(normal, surface.dpdu, surface).unwrap_or_else(plain);
        }
        if let Some(map) = &self.normal_map {
            return mapped(map, at, surface);
        }
        if let Some(displacement) = &self.displacement {
            if let Texture::Constant(_) = **displacement {
                return plain();
            }
            let (dpdu, dpdv) = bumped(displacement, at, surface);
            let normal = dpdu.cross(dpdv);
            return turned(normal, dpdu, surface).unwrap_or_else(plain);
        }
        plain()
    }

    /// The shading frame towards `towards` (unit, world space) and the BSDF: [`Material::frame`] and
    /// [`Material::bsdf`], with a clear coat oriented by its own normal map or, without one, by the surface
    /// without the base's bump map.
    ///
    /// With [`ShadingNormals::Lumbre`] a normal that faces away from the visible side of the surface is turned back
    /// just far enough: otherwise the silhouettes of coarse meshes with smooth normals, and steep bumps, would be
    /// black.
    pub fn shading(
        &self,
        at: &TextureContext,
        surface: &LocalSurface,
        towards: Vec3,
        normals: ShadingNormals,
    ) -> Option<(ShadingFrame, Bsdf)> {
        let mut bsdf = self.bsdf(at)?;
        let mut frame = self.frame(at, surface);
        let seen = |normal: Vec3| match normals {
            ShadingNormals::Pbrt if ShadingNormals::differ(normal, surface.geometric) => normal,
            _ => facing(normal, surface.geometric, towards),
        };
        let normal = seen(frame.n);
        if normal != frame.n {
            frame = ShadingFrame::new(normal, frame.s);
        }
        if let (Bsdf::Principled(bsdf), MaterialKind::Principled(params)) = (&mut bsdf, &self.kind) {
            if surface.handedness < 0.0 {
                bsdf.tangent.y = -bsdf.tangent.y;
            }
            if bsdf.coat.weight > 0.0 {
                let map = params.clearcoat_normal.as_ref();
                let normal = seen(map.map_or(surface.normal, |map| mapped(map, at, surface).n));
                let local = frame.to_local(normal).vec();
                // The coat is not visible from below.
                if 0.0 < local.z && frame.n != normal {
                    bsdf.coat.normal = local.normalize();
                }
            }
        }
        // Across the fibre as it is seen, whichever way v runs.
        if let Bsdf::Hair(hair) = &mut bsdf
            && surface.dpdv.dot(towards.cross(frame.s)) < 0.0
        {
            hair.h = -hair.h;
        }
        Some((frame, bsdf))
    }

    /// The absorption of a solid of this material, the coefficient σ of the Beer–Lambert law, per unit of
    /// world-space length: exp(−σ d) of the light remains after a distance d. `None` where nothing is absorbed,
    /// or light cannot get inside. The normal points out of the solid.
    ///
    /// The caller tracks the distance travelled inside. Channels are those of linear Rec. 709, or the wavelengths that
    /// are given.
    pub fn interior_attenuation(&self, wavelengths: Option<&Wavelengths>) -> Option<Spectrum> {
        match &self.kind {
            MaterialKind::Principled(params) => params.interior_attenuation(wavelengths),
            MaterialKind::Diffuse { .. }
            | MaterialKind::Conductor { .. }
            | MaterialKind::ConductorReflectance { .. }
            | MaterialKind::Dielectric { .. }
            | MaterialKind::ThinDielectric { .. }
            | MaterialKind::CoatedDiffuse { .. }
            | MaterialKind::CoatedConductor { .. }
            | MaterialKind::DiffuseTransmission { .. }
            | MaterialKind::Uber(_)
            | MaterialKind::Hair(_)
            | MaterialKind::Measured(_)
            | MaterialKind::Subsurface(_)
            | MaterialKind::Pov(_)
            | MaterialKind::Mix { .. }
            | MaterialKind::Interface => None,
        }
    }

    /// The medium inside a solid of this material, if it scatters light; else `None`. Its extinction is that of
    /// [`Material::interior_attenuation`].
    ///
    /// Where it is not the same for all light, it is that which enters at a position.
    pub fn interior_medium(&self, at: &TextureContext) -> Option<HomogeneousMedium> {
        match &self.kind {
            MaterialKind::Principled(params) => {
                params.interior_medium(at.spectral.as_ref().map(|spectral| &spectral.wavelengths))
            }
            MaterialKind::Subsurface(params) => Some(params.medium(at)),
            MaterialKind::Diffuse { .. }
            | MaterialKind::Conductor { .. }
            | MaterialKind::ConductorReflectance { .. }
            | MaterialKind::Dielectric { .. }
            | MaterialKind::ThinDielectric { .. }
            | MaterialKind::CoatedDiffuse { .. }
            | MaterialKind::CoatedConductor { .. }
            | MaterialKind::DiffuseTransmission { .. }
            | MaterialKind::Uber(_)
            | MaterialKind::Hair(_)
            | MaterialKind::Measured(_)
            | MaterialKind::Pov(_)
            | MaterialKind::Mix { .. }
            | MaterialKind::Interface => None,
        }
    }

    /// The body below the surface, if it is one that light wanders through.
    pub fn subsurface(&self) -> Option<&SubsurfaceParams> {
        match &self.kind {
            MaterialKind::Subsurface(params) => Some(params),
            _ => None,
        }
    }

    /// Whether it encloses a solid that light passes through, with [`Material::interior_attenuation`] and
    /// [`Material::interior_index`].
    pub fn is_solid(&self) -> bool {
        self.interior_index().is_some()
    }

    /// Whether it, or a part of the mixture, may be solid: see [`Material::is_solid`].
    pub fn may_be_solid(&self) -> bool {
        self.has_part(|kind| match kind {
            MaterialKind::Principled(params) => params.interior_index().is_some(),
            MaterialKind::Subsurface(_) => true,
            MaterialKind::Diffuse { .. }
            | MaterialKind::Conductor { .. }
            | MaterialKind::ConductorReflectance { .. }
            | MaterialKind::Dielectric { .. }
            | MaterialKind::ThinDielectric { .. }
            | MaterialKind::CoatedDiffuse { .. }
            | MaterialKind::CoatedConductor { .. }
            | MaterialKind::DiffuseTransmission { .. }
            | MaterialKind::Uber(_)
            | MaterialKind::Hair(_)
            | MaterialKind::Measured(_)
            | MaterialKind::Pov(_)
            | MaterialKind::Mix { .. }
            | MaterialKind::Interface => false,
        })
    }

    /// The index of refraction inside a solid of this material, against vacuum; `None` where light cannot get
    /// inside, and for the kinds whose index is relative to the outside.
    pub fn interior_index(&self) -> Option<f32> {
        match &self.kind {
            MaterialKind::Principled(params) => params.interior_index(),
            MaterialKind::Subsurface(params) => Some(index(params.eta)),
            MaterialKind::Diffuse { .. }
            | MaterialKind::Conductor { .. }
            | MaterialKind::ConductorReflectance { .. }
            | MaterialKind::Dielectric { .. }
            | MaterialKind::ThinDielectric { .. }
            | MaterialKind::CoatedDiffuse { .. }
            | MaterialKind::CoatedConductor { .. }
            | MaterialKind::DiffuseTransmission { .. }
            | MaterialKind::Uber(_)
            | MaterialKind::Hair(_)
            | MaterialKind::Measured(_)
            | MaterialKind::Pov(_)
            | MaterialKind::Mix { .. }
            | MaterialKind::Interface => None,
        }
    }

    /// The BSDF at a position; `None` for [`MaterialKind::Interface`]. Mixtures must be resolved first; an
    /// unresolved one gives `None` too.
    ///
    /// Albedos are clamped to [0, 1], and an index of refraction that is not a positive number counts as 1.
    pub fn bsdf(&self, at: &TextureContext) -> Option<Bsdf> {
        let bsdf = match &self.kind {
            MaterialKind::Diffuse { reflectance } => {
                Bsdf::Diffuse(Diffuse { reflectance: albedo(reflectance.evaluate(at)) })
            }
            MaterialKind::Conductor { eta, k, roughness } => {
                Bsdf::Conductor(by_index(eta, k, at, roughness.facets(at)))
            }
            MaterialKind::ConductorReflectance { reflectance, roughness } => {
                Bsdf::Conductor(by_reflectance(reflectance, at, roughness.facets(at)))
            }
            MaterialKind::Dielectric { eta, roughness } => {
                Bsdf::Dielectric(Dielectric { eta: self.index_at(*eta, at), facets: roughness.facets(at) })
            }
            MaterialKind::ThinDielectric { eta } => {
                Bsdf::ThinDielectric(ThinDielectric { eta: self.index_at(*eta, at) })
            }
            MaterialKind::CoatedDiffuse {
                reflectance,
                roughness,
                thickness,
                eta,
                g,
                albedo: medium,
                max_depth,
                samples,
            } => Bsdf::CoatedDiffuse(CoatedDiffuse {
                base: Diffuse { reflectance: albedo(reflectance.evaluate(at)) },
                coat: Coat {
                    face: Dielectric { eta: self.index_at(*eta, at), facets: roughness.facets(at) },
                    thickness: thickness.evaluate(at).max(0.0),
                    g: asymmetry(g.evaluate(at)),
                    albedo: albedo(medium.evaluate(at)),
                    max_depth: *max_depth,
                    samples: *samples,
                },
            }),
            MaterialKind::CoatedConductor {
                metal,
                roughness,
                interface_roughness,
                thickness,
                interface_eta,
                g,
                albedo: medium,
                max_depth,
                samples,
            } => {
                let interface_eta = self.index_at(*interface_eta, at);
                let base = metal.conductor(at, roughness.facets(at));
                Bsdf::CoatedConductor(CoatedConductor {
                    // The index was given against vacuum.
                    base: Conductor { eta: base.eta / interface_eta, k: base.k / interface_eta, ..base },
                    coat: Coat {
                        face: Dielectric { eta: interface_eta, facets: interface_roughness.facets(at) },
                        thickness: thickness.evaluate(at).max(0.0),
                        g: asymmetry(g.evaluate(at)),
                        albedo: albedo(medium.evaluate(at)),
                        max_depth: *max_depth,
                        samples: *samples,
                    },
                })
            }
            MaterialKind::DiffuseTransmission { reflectance, transmittance, scale } => {
                Bsdf::DiffuseTransmission(DiffuseTransmission {
                    reflectance: albedo(reflectance.evaluate(at) * *scale),
                    transmittance: albedo(transmittance.evaluate(at) * *scale),
                })
            }
            MaterialKind::Principled(params) => Bsdf::Principled(Box::new(params.bsdf(at))),
            MaterialKind::Uber(params) => Bsdf::Uber(params.bsdf(at)),
            MaterialKind::Hair(params) => Bsdf::Hair(params.bsdf(at)),
            MaterialKind::Measured(tables) => Bsdf::Measured(Measured {
                tables: tables.clone(),
                nm: at.spectral.map(|spectral| spectral.wavelengths.nm()),
            }),
            MaterialKind::Subsurface(params) => Bsdf::Subsurface(params.bsdf(at)),
            MaterialKind::Pov(material) => {
                let bsdf = material.bsdf(at);
                Bsdf::Uber(match &at.spectral {
                    None => bsdf,
                    Some(spectral) => bsdf.with_colours(|colour| spectral.varied(colour)),
                })
            }
            MaterialKind::Mix { .. } | MaterialKind::Interface => return None,
        };
        Some(bsdf)
    }

    /// The index of refraction at a place: that of the hero wavelength, where there are wavelengths and the index
    /// depends on them.
    fn index_at(&self, eta: f32, at: &TextureContext) -> f32 {
        let spectral = self.dispersion.as_ref().zip(at.spectral.as_ref());
        let of_hero = spectral.and_then(|(index, spectral)| index.at(spectral.wavelengths.nm()[0].into()));
        index(of_hero.map_or(eta, |eta| eta as f32))
    }

    /// Whether it bends each wavelength by an index of its own, so that a path through it can follow the hero
    /// wavelength alone. Mixtures must be resolved first.
    pub fn disperses(&self) -> bool {
        match &self.kind {
            MaterialKind::Dielectric { .. }
            | MaterialKind::ThinDielectric { .. }
            | MaterialKind::CoatedDiffuse { .. }
            | MaterialKind::CoatedConductor { .. } => self.dispersion.is_some(),
            MaterialKind::Principled(params) => params.disperses(),
            _ => false,
        }
    }

    /// Whether it, or a part of the mixture, has an index of refraction by wavelength.
    pub fn has_dispersion(&self) -> bool {
        match &self.kind {
            MaterialKind::Mix { .. } => self.any_part(&|part| part.dispersion.is_some()),
            _ => self.dispersion.is_some(),
        }
    }

    /// The default material: diffuse, 0.5.
    pub fn default_diffuse() -> Self {
        Self::diffuse(Spectrum::splat(0.5))
    }

    /// A matt surface that reflects this share of each colour, in [0, 1].
    pub fn diffuse(reflectance: Spectrum) -> Self {
        Self::new(MaterialKind::Diffuse { reflectance: Arc::new(SpectrumTexture::Constant(reflectance)) })
    }

    /// A metal by its reflectance at normal incidence, in [0, 1]; `roughness` is α of its facets, 0 for a mirror.
    pub fn metal(reflectance: Spectrum, roughness: f32) -> Self {
        Self::new(MaterialKind::ConductorReflectance {
            reflectance: Arc::new(SpectrumTexture::Constant(reflectance)),
            roughness: Roughness::isotropic(roughness, false),
        })
    }

    /// Smooth, clear glass, or water, of an index of refraction over that of what is around it: about 1.5, or 1.33.
    pub fn glass(eta: f32) -> Self {
        Self::new(MaterialKind::Dielectric { eta, roughness: Roughness::smooth() })
    }

    /// What most things are made of, with the parameters of glTF's core: a base colour, from 0 for plastic to 1 for
    /// metal, and a roughness, all in [0, 1].
    pub fn principled(base_color: Spectrum, metallic: f32, roughness: f32) -> Self {
        let number = |x: f32| Arc::new(FloatTexture::Constant(x));
        Self::new(MaterialKind::Principled(Box::new(PrincipledParams {
            base_color: Arc::new(SpectrumTexture::Constant(base_color)),
            metallic: number(metallic),
            roughness: number(roughness),
            ..PrincipledParams::default()
        })))
    }
}

impl Roughness {
    /// A mirror-smooth surface.
    pub fn smooth() -> Self {
        Self::isotropic(0.0, false)
    }

    /// The same roughness in both directions.
    pub fn isotropic(roughness: f32, remap: bool) -> Self {
        let texture = Arc::new(FloatTexture::Constant(roughness));
        Self { u: Arc::clone(&texture), v: texture, remap }
    }

    /// The microfacets at a position.
    pub(crate) fn facets(&self, at: &TextureContext) -> Microfacets {
        let u = self.alpha(self.u.evaluate(at));
        let v = if Arc::ptr_eq(&self.u, &self.v) { u } else { self.alpha(self.v.evaluate(at)) };
        Microfacets::new(u, v)
    }

    /// The width α of the microfacets of a roughness.
    fn alpha(&self, roughness: f32) -> f32 {
        let roughness = roughness.max(0.0);
        if self.remap { roughness.sqrt() } else { roughness }
    }

    /// Whether the surface may be smooth anywhere: surely not where the roughness is a number that makes it rough.
    fn may_be_smooth(&self) -> bool {
        let is_rough = |texture: &FloatTexture| match texture {
            Texture::Constant(roughness) => !Microfacets::new(self.alpha(*roughness), 0.0).is_smooth(),
            _ => false,
        };
        !is_rough(&self.u) && !is_rough(&self.v)
    }
}

fn by_index(
    eta: &SpectrumTexture,
    k: &SpectrumTexture,
    at: &TextureContext,
    facets: Microfacets,
) -> Conductor {
    let not_negative = |c: Spectrum| c.map(|c| c.max(0.0));
    let index = eta.evaluate_unbounded(at);
    // Of known metals alone a channel may reflect more than all.
    let is_spectrum = matches!(eta, SpectrumTexture::Spectrum { .. });
    Conductor {
        eta: if is_spectrum { index } else { not_negative(index) },
        k: not_negative(k.evaluate_unbounded(at)),
        facets,
    }
}

fn by_reflectance(reflectance: &SpectrumTexture, at: &TextureContext, facets: Microfacets) -> Conductor {
    Conductor::from_reflectance(albedo(reflectance.evaluate(at)), facets)
}

/// The frame of a normal map.
fn mapped(map: &ImageTexture, at: &TextureContext, surface: &LocalSurface) -> ShadingFrame {
    let texel: Spectrum = map.evaluate(at);
    let local = Vec3::new(2.0 * texel.r - 1.0, 2.0 * texel.g - 1.0, 2.0 * texel.b - 1.0);
    let frame = ShadingFrame::new(surface.normal, surface.dpdu);
    let Some(local) = local.try_normalize() else { return frame };
    let normal = frame.s * local.x + frame.t * (surface.handedness * local.y) + frame.n * local.z;
    turned(normal, surface.dpdu, surface).unwrap_or(frame)
}

/// Each channel clamped to [0, 1]; 0 for NaN.
pub(crate) fn albedo(colour: Spectrum) -> Spectrum {
    colour.map(crate::unit)
}

/// An asymmetry clamped to the open interval (-1, 1), where the phase function is defined; 0 for NaN.
fn asymmetry(g: f32) -> f32 {
    if g.is_nan() { 0.0 } else { g.clamp(-0.999, 0.999) }
}

/// A valid index of refraction.
pub(crate) fn index(eta: f32) -> f32 {
    if eta > 0.0 && eta.is_finite() { eta } else { 1.0 }
}

/// [`crate::lanes::facing`] of one surface.
fn facing(normal: Vec3, geometric: Vec3, towards: Vec3) -> Vec3 {
    let lane = |v: Vec3| V3::new(v.x, v.y, v.z);
    let V3 { x, y, z } = crate::lanes::facing::<f32>(lane(normal), lane(geometric), lane(towards));
    Vec3::new(x, y, z)
}

/// The frame about a tilted normal of any length.
fn turned(normal: Vec3, dpdu: Vec3, surface: &LocalSurface) -> Option<ShadingFrame> {
    let normal = (normal / normal.abs().max_element()).try_normalize()?;
    let normal = if normal.dot(surface.normal) < 0.0 { -normal } else { normal };
    Some(ShadingFrame::new(normal, dpdu))
}

/// The derivatives of the displaced surface, by finite differences over half a pixel.
///
/// Blinn, "Simulation of Wrinkled Surfaces", SIGGRAPH 1978.
fn bumped(displacement: &FloatTexture, at: &TextureContext, surface: &LocalSurface) -> (Vec3, Vec3) {
    let here = displacement.evaluate(at);
    let derivative = |step: f32, axis: Vec2, dp: Vec3, dn: Vec3| {
        // The fallback where the pixel footprint is unknown.
        let step = if step > 0.0 && step.is_finite() { step } else { 0.0005 };
        let shifted = TextureContext {
            point: at.point + (step * dp).as_dvec3(),
            uv: at.uv + step * axis,
            normal: (surface.normal + step * dn).try_normalize().unwrap_or(surface.normal),
            ..*at
        };
        let slope = (displacement.evaluate(&shifted) - here) / step;
        dp + slope * surface.normal + here * dn
    };
    let step_u = 0.5 * (at.duv_dx.x.abs() + at.duv_dy.x.abs());
    let step_v = 0.5 * (at.duv_dx.y.abs() + at.duv_dy.y.abs());
    (
        derivative(step_u, Vec2::X, surface.dpdu, surface.dndu),
        derivative(step_v, Vec2::Y, surface.dpdv, surface.dndv),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ImageFilter, Mapping2d, MipMap, MipMapOptions, Wrap};
    use lumbre_image::{Bitmap, Channels, Encoding, PixelData};
    use lumbre_math::{DVec3, Transform};

    fn at(point: DVec3, uv: Vec2) -> TextureContext {
        TextureContext {
            point,
            normal: Vec3::Z,
            uv,
            dpdx: Vec3::ZERO,
            dpdy: Vec3::ZERO,
            duv_dx: Vec2::splat(1e-3),
            duv_dy: Vec2::splat(1e-3),
            vertex: crate::VertexData::NONE,
            spectral: None,
        }
    }

    fn diffuse(albedo: f32) -> Arc<Material> {
        let reflectance = Arc::new(Texture::Constant(Spectrum::splat(albedo)));
        Arc::new(Material::new(MaterialKind::Diffuse { reflectance }))
    }

    fn mix(a: &Arc<Material>, b: &Arc<Material>, amount: f32) -> Arc<Material> {
        let amount = Arc::new(Texture::Constant(amount));
        Arc::new(Material::new(MaterialKind::Mix { materials: [Arc::clone(a), Arc::clone(b)], amount }))
    }

    fn surface() -> LocalSurface {
        LocalSurface {
            normal: Vec3::new(0.6, 0.0, 0.8),
            dpdu: Vec3::new(0.8, 0.0, -0.6) * 2.0,
            dpdv: Vec3::Y * 3.0,
            dndu: Vec3::ZERO,
            dndv: Vec3::ZERO,
            geometric: Vec3::new(0.6, 0.0, 0.8),
            handedness: 1.0,
        }
    }

    #[test]
    fn a_mixture_has_the_share_it_says_and_answers_the_same_twice() {
        let (a, b, c) = (diffuse(0.1), diffuse(0.2), diffuse(0.3));
        let nested = mix(&mix(&a, &b, 0.5), &c, 0.25);
        let mut counts = [0; 3];
        let wo = Vec3::new(0.3, -0.4, 0.8).normalize();
        for i in 0..40_000 {
            let here = at(DVec3::new(f64::from(i) * 0.37, 2.0, -f64::from(i)), Vec2::ZERO);
            let resolved = nested.resolve(&here, wo);
            assert!(std::ptr::eq(resolved, nested.resolve(&here, wo)));
            for (count, material) in counts.iter_mut().zip([&a, &b, &c]) {
                *count += usize::from(std::ptr::eq(resolved, &**material));
            }
        }
        for (count, share) in counts.into_iter().zip([0.375, 0.375, 0.25]) {
            assert!((count as f64 / 40_000.0 - share).abs() < 0.01, "{counts:?}");
        }
        for (amount, expected) in [(0.0, &a), (-2.0, &a), (1.0, &b), (7.0, &b)] {
            let all = mix(&a, &b, amount);
            for i in 0..100 {
                let here = at(DVec3::new(f64::from(i), 2.0, 3.0), Vec2::ZERO);
                assert!(std::ptr::eq(all.resolve(&here, wo), &**expected));
            }
        }
    }

    #[test]
    fn a_slope_turns_the_normal_against_it() {
        // Displacement 0.5 u: the surface rises along ∂p/∂u, which is 2 long, by a quarter of the way.
        let ramp = Texture::Bilerp { mapping: Mapping2d::IDENTITY, corners: [0.0, 0.0, 0.5, 0.5] };
        let material = Material { displacement: Some(Arc::new(ramp)), ..(*diffuse(0.5)).clone() };
        let frame = material.frame(&at(DVec3::ONE, Vec2::new(0.3, 0.6)), &surface());
        let (n, u) = (surface().normal, surface().dpdu.normalize());
        let expected = (n - 0.25 * u).normalize();
        assert!((frame.n - expected).length() < 1e-3, "{:?} {expected:?}", frame.n);
        assert!(frame.s.dot(frame.n).abs() < 1e-6 && frame.s.dot(u) > 0.9);
        let plain = diffuse(0.5).frame(&at(DVec3::ONE, Vec2::ZERO), &surface());
        assert_eq!(plain.n, n);
    }

    #[test]
    fn a_bump_in_space_follows_the_point() {
        // Displacement 0.3 y of the world, on a surface whose ∂p/∂v is 3 y: slope 0.3 along y.
        let ramp = Texture::Bilerp {
            mapping: Mapping2d::Planar {
                texture_from_world: Transform::IDENTITY.into(),
                vs: DVec3::Y * 0.01,
                vt: DVec3::X * 0.01,
                delta: Vec2::ZERO,
            },
            corners: [0.0, 0.0, 30.0, 30.0],
        };
        let material = Material { displacement: Some(Arc::new(ramp)), ..(*diffuse(0.5)).clone() };
        let flat = LocalSurface { dpdv: Vec3::Y * 3.0, ..surface() };
        let frame = material.frame(&at(DVec3::new(2.0, 0.0, 1.0), Vec2::new(0.3, 0.6)), &flat);
        let expected = (flat.normal - 0.3 * Vec3::Y).normalize();
        assert!((frame.n - expected).length() < 2e-3, "{:?} {expected:?}", frame.n);
    }

    fn normal_map(texel: [f32; 3]) -> Material {
        let data = PixelData::F32(texel.repeat(4));
        let bitmap = Bitmap::new(2, 2, Channels::Rgb, data, Encoding::Linear).unwrap();
        let options = MipMapOptions { wrap: Wrap::Repeat, filter: ImageFilter::Bilinear };
        let image = Arc::new(MipMap::new(Arc::new(bitmap), options));
        let map = ImageTexture { mapping: Mapping2d::IDENTITY, image, scale: 1.0, invert: false };
        Material { normal_map: Some(map), ..(*diffuse(0.5)).clone() }
    }

    #[test]
    fn a_normal_map_is_in_the_tangent_frame() {
        let local = Vec3::new(0.48, -0.6, 0.64);
        let texel = (0.5 * (local + Vec3::ONE)).to_array();
        let frame = normal_map(texel).frame(&at(DVec3::ONE, Vec2::new(0.3, 0.6)), &surface());
        let plain = ShadingFrame::new(surface().normal, surface().dpdu);
        let expected = plain.s * local.x + plain.t * local.y + plain.n * local.z;
        assert!((frame.n - expected).length() < 1e-5, "{:?} {expected:?}", frame.n);
    }

    #[test]
    fn normals_stay_on_their_side_and_empty_maps_do_nothing() {
        let here = at(DVec3::ONE, Vec2::new(0.3, 0.6));
        let down = normal_map([0.6, 0.5, 0.0]).frame(&here, &surface());
        assert!(down.n.dot(surface().normal) > 0.0);
        for texel in [[0.5; 3], [f32::NAN; 3], [f32::INFINITY; 3]] {
            let frame = normal_map(texel).frame(&here, &surface());
            assert!(frame.n.is_finite() && (frame.n.length() - 1.0).abs() < 1e-5, "{texel:?}: {frame:?}");
        }
    }

    #[test]
    fn bsdfs_hold_their_parameters_within_what_is_possible() {
        let here = at(DVec3::ONE, Vec2::ZERO);
        let Some(Bsdf::Diffuse(bright)) = diffuse(3.0).bsdf(&here) else { panic!() };
        assert_eq!(bright.reflectance, Spectrum::WHITE);
        let glass = Material::new(MaterialKind::Dielectric {
            eta: -1.0,
            roughness: Roughness::isotropic(0.25, true),
        });
        let Some(Bsdf::Dielectric(glass)) = glass.bsdf(&here) else { panic!() };
        assert_eq!((glass.eta, glass.facets.alpha()), (1.0, Vec2::splat(0.5)));
        assert!(Material::new(MaterialKind::Interface).bsdf(&here).is_none());
        assert!(mix(&diffuse(0.1), &diffuse(0.2), 0.5).bsdf(&here).is_none());
    }

    #[test]
    fn materials_tell_whether_their_light_goes_straight_on() {
        let here = at(DVec3::ONE, Vec2::ZERO);
        let number = |v: f32| Arc::new(Texture::Constant(v));
        let clear = |ior: f32, roughness: f32, metallic: f32| PrincipledParams {
            metallic: number(metallic),
            roughness: number(roughness),
            transmission: number(1.0),
            ior,
            ..PrincipledParams::default()
        };
        let solid = |ior: f32| PrincipledParams {
            volume: Some(crate::VolumeParams::default()),
            ..clear(ior, 0.0, 0.0)
        };
        let principled = |params| Material::new(MaterialKind::Principled(Box::new(params)));
        let glass = |eta| Material::new(MaterialKind::Dielectric { eta, roughness: Roughness::smooth() });
        let cases = [
            (Material::new(MaterialKind::ThinDielectric { eta: 1.5 }), true),
            (principled(clear(1.5, 0.0, 0.0)), true),
            (principled(clear(1.5, 0.03, 0.5)), true),
            (principled(clear(1.5, 0.04, 0.0)), false),
            (principled(clear(1.5, 0.0, 1.0)), false),
            (principled(solid(1.5)), false),
            (principled(solid(1.0)), true),
            (principled(PrincipledParams::default()), false),
            (glass(1.5), false),
            (glass(1.0), true),
            ((*diffuse(0.5)).clone(), false),
        ];
        let wo = crate::LocalDir(Vec3::new(0.6, -0.2, 0.4).normalize());
        for (material, expected) in cases {
            assert_eq!(material.has_delta_transmission(), expected, "{material:?}");
            let left = material.bsdf(&here).unwrap().straight_on(wo);
            assert_eq!(!left.is_black(), expected, "{material:?}");
            let mixture = mix(&Arc::new(material), &diffuse(0.5), 0.5);
            assert_eq!(mixture.has_delta_transmission(), expected);
        }
    }

    #[test]
    fn every_kind_has_a_name_of_the_list() {
        let kinds = [
            diffuse(0.5).kind.clone(),
            mix(&diffuse(0.1), &diffuse(0.2), 0.5).kind.clone(),
            MaterialKind::Interface,
            MaterialKind::ThinDielectric { eta: 1.5 },
        ];
        for kind in kinds {
            assert!(MaterialKind::NAMES.contains(&kind.name()));
        }
    }
}
