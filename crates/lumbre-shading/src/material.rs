//! The closed set of materials.

use std::sync::Arc;

use lumbre_math::Vec3;

use crate::{Bsdf, FloatTexture, ImageTexture, ShadingFrame, Spectrum, SpectrumTexture, TextureContext};

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
    /// world space).
    pub fn resolve(&self, _at: &TextureContext, _wo: Vec3) -> &Self {
        unimplemented!("skeleton")
    }

    /// The frame to shade in: bump and normal maps applied.
    pub fn frame(&self, _at: &TextureContext, _surface: &LocalSurface) -> ShadingFrame {
        unimplemented!("skeleton")
    }

    /// How the surface scatters here; `None` for [`MaterialKind::Interface`]. Mixtures must be resolved first.
    pub fn bsdf(&self, _at: &TextureContext) -> Option<Bsdf> {
        unimplemented!("skeleton")
    }

    /// The default material: diffuse, 0.5.
    pub fn default_diffuse() -> Self {
        Self::new(MaterialKind::Diffuse {
            reflectance: Arc::new(SpectrumTexture::Constant(Spectrum::splat(0.5))),
        })
    }
}
