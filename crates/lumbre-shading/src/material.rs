//! The closed set of materials.

use std::sync::Arc;

use lumbre_math::random::{combine, hash_dvec3, hash_vec3, uniform_f32};
use lumbre_math::{Vec2, Vec3};

use crate::coated::CoatedDiffuse;
use crate::conductor::Conductor;
use crate::dielectric::{Dielectric, ThinDielectric};
use crate::diffuse::{Diffuse, DiffuseTransmission};
use crate::microfacet::Microfacets;
use crate::{
    Bsdf, FloatTexture, ImageTexture, ShadingFrame, Spectrum, SpectrumTexture, Texture, TextureContext,
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

/// How a surface looks, as a function of place.
#[derive(Clone, Debug)]
pub struct Material {
    /// Its kind with its parameters.
    pub kind: MaterialKind,
    /// Bump: a displacement whose slope turns the shading normal.
    pub displacement: Option<Arc<FloatTexture>>,
    /// A tangent-space normal map.
    pub normal_map: Option<ImageTexture>,
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
        /// Inside over outside.
        eta: f32,
        /// Roughness.
        roughness: Roughness,
    },
    /// A pane of glass without thickness.
    ThinDielectric {
        /// Of the pane over its surroundings.
        eta: f32,
    },
    /// A diffuse base under a rough dielectric coat with a medium between.
    CoatedDiffuse {
        /// Of the base.
        reflectance: Arc<SpectrumTexture>,
        /// Of the coat.
        roughness: Roughness,
        /// Of the coat.
        thickness: Arc<FloatTexture>,
        /// Of the coat.
        eta: f32,
        /// Henyey–Greenstein asymmetry of the medium.
        g: Arc<FloatTexture>,
        /// Single-scattering albedo of the medium.
        albedo: Arc<SpectrumTexture>,
        /// Bounces of the random walk.
        max_depth: u32,
        /// Random walks an evaluation.
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
    /// One of two, chosen at random by place and direction.
    Mix {
        /// At amount 0 and 1.
        materials: [Arc<Material>; 2],
        /// How much of the second.
        amount: Arc<FloatTexture>,
    },
    /// No surface at all: a border between media.
    Interface,
}

impl MaterialKind {
    /// The names of the kinds in the scene language, in the order of this enum.
    pub const NAMES: [&str; 8] = [
        "diffuse",
        "conductor",
        "dielectric",
        "thindielectric",
        "coateddiffuse",
        "diffusetransmission",
        "mix",
        "interface",
    ];

    /// Its name in the scene language.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Diffuse { .. } => "diffuse",
            Self::Conductor { .. } | Self::ConductorReflectance { .. } => "conductor",
            Self::Dielectric { .. } => "dielectric",
            Self::ThinDielectric { .. } => "thindielectric",
            Self::CoatedDiffuse { .. } => "coateddiffuse",
            Self::DiffuseTransmission { .. } => "diffusetransmission",
            Self::Mix { .. } => "mix",
            Self::Interface => "interface",
        }
    }
}

/// The local shape of the surface that bump and normal maps turn.
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
}

impl Material {
    /// A material of a kind, without bumps.
    pub fn new(kind: MaterialKind) -> Self {
        Self { kind, displacement: None, normal_map: None }
    }

    /// Follows mixtures to the one material that applies at a place: the choice is a hash of the place and `wo` (unit,
    /// world space), so that asking again gives the same answer. An amount of 0 or less is always the first, of 1 or more
    /// always the second.
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
                // One step further for each level, or nested mixtures would all choose alike.
                let k = key.map_or_else(|| combine(hash_dvec3(at.point), hash_vec3(wo)), |k| combine(k, 1));
                key = Some(k);
                uniform_f32(k) < amount
            };
            material = &materials[usize::from(second)];
        }
        material
    }

    /// The frame to shade in: bump and normal maps applied. A normal map goes before a displacement. The frame stays on
    /// the side of the surface's normal, and the surface's own is taken where a map gives nothing finite.
    pub fn frame(&self, at: &TextureContext, surface: &LocalSurface) -> ShadingFrame {
        let plain = || ShadingFrame::new(surface.normal, surface.dpdu);
        if let Some(map) = &self.normal_map {
            let texel: Spectrum = map.evaluate(at);
            let local = Vec3::new(2.0 * texel.r - 1.0, 2.0 * texel.g - 1.0, 2.0 * texel.b - 1.0);
            let frame = plain();
            let Some(local) = local.try_normalize() else { return frame };
            let normal = frame.s * local.x + frame.t * local.y + frame.n * local.z;
            return turned(normal, surface.dpdu, surface).unwrap_or(frame);
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

    /// How the surface scatters here; `None` for [`MaterialKind::Interface`]. Mixtures must be resolved first: one that is
    /// not scatters as `None` too.
    ///
    /// Albedos are held within [0, 1], and an index of refraction that is not a positive number counts as 1.
    pub fn bsdf(&self, at: &TextureContext) -> Option<Bsdf> {
        let bsdf = match &self.kind {
            MaterialKind::Diffuse { reflectance } => {
                Bsdf::Diffuse(Diffuse { reflectance: albedo(reflectance.evaluate(at)) })
            }
            MaterialKind::Conductor { eta, k, roughness } => Bsdf::Conductor(Conductor {
                eta: eta.evaluate(at).map(|eta| eta.max(0.0)),
                k: k.evaluate(at).map(|k| k.max(0.0)),
                facets: roughness.facets(at),
            }),
            MaterialKind::ConductorReflectance { reflectance, roughness } => Bsdf::Conductor(
                Conductor::from_reflectance(albedo(reflectance.evaluate(at)), roughness.facets(at)),
            ),
            MaterialKind::Dielectric { eta, roughness } => {
                Bsdf::Dielectric(Dielectric { eta: index(*eta), facets: roughness.facets(at) })
            }
            MaterialKind::ThinDielectric { eta } => Bsdf::ThinDielectric(ThinDielectric { eta: index(*eta) }),
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
                reflectance: albedo(reflectance.evaluate(at)),
                coat: Dielectric { eta: index(*eta), facets: roughness.facets(at) },
                thickness: thickness.evaluate(at).max(0.0),
                g: asymmetry(g.evaluate(at)),
                albedo: albedo(medium.evaluate(at)),
                max_depth: *max_depth,
                samples: *samples,
            }),
            MaterialKind::DiffuseTransmission { reflectance, transmittance, scale } => {
                Bsdf::DiffuseTransmission(DiffuseTransmission {
                    reflectance: albedo(reflectance.evaluate(at) * *scale),
                    transmittance: albedo(transmittance.evaluate(at) * *scale),
                })
            }
            MaterialKind::Mix { .. } | MaterialKind::Interface => return None,
        };
        Some(bsdf)
    }

    /// The default material: diffuse, 0.5.
    pub fn default_diffuse() -> Self {
        Self::new(MaterialKind::Diffuse {
            reflectance: Arc::new(SpectrumTexture::Constant(Spectrum::splat(0.5))),
        })
    }
}

impl Roughness {
    /// A surface as smooth as a mirror.
    pub fn smooth() -> Self {
        Self::isotropic(0.0, false)
    }

    /// The same roughness both ways.
    pub fn isotropic(roughness: f32, remap: bool) -> Self {
        let texture = Arc::new(FloatTexture::Constant(roughness));
        Self { u: Arc::clone(&texture), v: texture, remap }
    }

    /// The facets at a place.
    fn facets(&self, at: &TextureContext) -> Microfacets {
        let alpha = |texture: &FloatTexture| {
            let roughness = texture.evaluate(at).max(0.0);
            if self.remap { roughness.sqrt() } else { roughness }
        };
        let u = alpha(&self.u);
        let v = if Arc::ptr_eq(&self.u, &self.v) { u } else { alpha(&self.v) };
        Microfacets::new(u, v)
    }
}

/// Each lane within [0, 1]; 0 for what is not a number.
fn albedo(colour: Spectrum) -> Spectrum {
    colour.map(crate::unit)
}

/// An asymmetry within the open interval (-1, 1), where the phase function has values; 0 for what is not a number.
fn asymmetry(g: f32) -> f32 {
    if g.is_nan() { 0.0 } else { g.clamp(-0.999, 0.999) }
}

/// An index of refraction that is one.
fn index(eta: f32) -> f32 {
    if eta > 0.0 && eta.is_finite() { eta } else { 1.0 }
}

/// The frame about a turned normal of any length.
fn turned(normal: Vec3, dpdu: Vec3, surface: &LocalSurface) -> Option<ShadingFrame> {
    let normal = (normal / normal.abs().max_element()).try_normalize()?;
    let normal = if normal.dot(surface.normal) < 0.0 { -normal } else { normal };
    Some(ShadingFrame::new(normal, dpdu))
}

/// The derivatives of the displaced surface, by differences over half a pixel.
///
/// Blinn, "Simulation of Wrinkled Surfaces", SIGGRAPH 1978.
fn bumped(displacement: &FloatTexture, at: &TextureContext, surface: &LocalSurface) -> (Vec3, Vec3) {
    let here = displacement.evaluate(at);
    let derivative = |step: f32, axis: Vec2, dp: Vec3, dn: Vec3| {
        // Where the pixel's size on the surface is not known.
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
