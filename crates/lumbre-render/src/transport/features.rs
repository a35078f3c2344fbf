//! Features, which are written as AOVs: reflectance, normals, depth and surface parameters.

use lumbre_geometry::{Ray, Surface};
use lumbre_math::{Vec2, Vec3};
use lumbre_scene::{GroundPlane, View};
use lumbre_shading::Spectrum;

use crate::transport::PrimaryHit;

/// A feature of the first hit: an AOV.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Feature {
    /// Reflectance.
    Albedo,
    /// The shading normal in world space.
    Normal,
    /// Distance along the camera's axis.
    Depth,
    /// Surface parameters.
    Uv,
}

impl Feature {
    /// Every feature, in the order of the enum.
    pub const ALL: [Self; 4] = [Self::Albedo, Self::Normal, Self::Depth, Self::Uv];
    /// Their names, in the same order: those of layers in files and of the command line.
    pub const NAMES: [&'static str; 4] = ["albedo", "normal", "depth", "uv"];

    /// Its name, one of [`Self::NAMES`].
    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }

    /// The names of its channels in file layers, after its own: `albedo.R`.
    pub fn channels(self) -> &'static [&'static str] {
        match self {
            Self::Albedo => &["R", "G", "B"],
            Self::Normal => &["X", "Y", "Z"],
            Self::Depth => &["Z"],
            Self::Uv => &["U", "V"],
        }
    }

    /// The feature of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|feature| feature.name() == name)
    }
}

/// The features of a first hit. All are zero without a hit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Features {
    /// Reflectance; for a black emitter its emission, clamped to 1.
    pub albedo: Spectrum,
    /// The shading normal in world space, on the side of the viewer.
    pub normal: Vec3,
    /// Distance along the camera's axis.
    pub depth: f32,
    /// Surface parameters.
    pub uv: Vec2,
}

impl Features {
    /// The features behind media that transmit a part of the light; light that media scatter counts as white, without a
    /// normal.
    pub(crate) fn behind(self, left: Spectrum) -> Self {
        let albedo = self.albedo * left + (Spectrum::WHITE - left);
        Self { albedo, normal: self.normal * left.average(), ..self }
    }

    /// The features of a first hit, if any.
    pub fn of(view: &View, primary_hit: &PrimaryHit) -> Option<Self> {
        let met = primary_hit.met.as_ref()?;
        let scattering = met.scattering();
        let (normal, albedo) = match &scattering {
            Some((frame, bsdf)) => (frame.n, bsdf.albedo()),
            None => (met.shading.normal, Spectrum::BLACK),
        };
        let towards = met.towards_origin.as_vec3();
        Some(Self {
            albedo: if albedo.is_black() { met.emitted().clamp(0.0, 1.0) } else { albedo },
            normal: if normal.dot(towards) < 0.0 { -normal } else { normal },
            depth: view.depth(met.surface.point, met.time) as f32,
            uv: met.uv(),
        })
    }

    /// The features of the ground, at a ray's hit of its surface.
    pub(crate) fn of_ground(view: &View, ground: &GroundPlane, ray: &Ray, surface: &Surface) -> Self {
        let normal = if ground.normal.dot(ray.direction) < 0.0 { ground.normal } else { -ground.normal };
        Self {
            albedo: ground.albedo,
            normal: normal.as_vec3(),
            depth: view.depth(surface.point, ray.time) as f32,
            uv: surface.uv.as_vec2(),
        }
    }

    /// One feature as a colour: the signed normal; uv in red and green.
    pub fn get(&self, feature: Feature) -> Spectrum {
        match feature {
            Feature::Albedo => self.albedo,
            Feature::Normal => self.normal.to_array().into(),
            Feature::Depth => Spectrum::splat(self.depth),
            Feature::Uv => Spectrum::new(self.uv.x, self.uv.y, 0.0),
        }
    }
}
