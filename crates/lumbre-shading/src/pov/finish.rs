//! Finishes: what a surface does with light.

use crate::Spectrum;

/// A finish. Colours are in the working space.
#[derive(Clone, Debug, PartialEq)]
pub struct Finish {
    /// Light that is there without lights.
    pub ambient: Spectrum,
    /// Light that the surface gives.
    pub emission: Spectrum,
    /// The share of light that is scattered.
    pub diffuse: f32,
    /// The share that is scattered where light comes from behind.
    pub diffuse_back: f32,
    /// Whether `diffuse` is an albedo.
    pub diffuse_albedo: bool,
    /// The exponent of the cosine.
    pub brilliance: f32,
    /// Noise on what is scattered.
    pub crand: f32,
    /// The strength of a highlight about the mirrored eye.
    pub phong: f32,
    /// Its exponent.
    pub phong_size: f32,
    /// Whether `phong` is an albedo.
    pub phong_albedo: bool,
    /// The strength of a highlight by the half vector.
    pub specular: f32,
    /// One over its exponent.
    pub roughness: f32,
    /// Whether `specular` is an albedo.
    pub specular_albedo: bool,
    /// How far highlights have the colour of the surface.
    pub metallic: f32,
    /// The mirror.
    pub reflection: Reflection,
    /// Whether what is mirrored is taken off what passes.
    pub conserve_energy: bool,
    /// Thin film: amount, thickness, turbulence; none for amount 0.
    pub irid: [f32; 3],
}

impl Finish {
    /// The finish that surfaces have unless the scene says otherwise.
    pub const DEFAULT: Self = Self {
        ambient: Spectrum::new(0.1, 0.1, 0.1),
        emission: Spectrum::BLACK,
        diffuse: 0.6,
        diffuse_back: 0.0,
        diffuse_albedo: false,
        brilliance: 1.0,
        crand: 0.0,
        phong: 0.0,
        phong_size: 40.0,
        phong_albedo: false,
        specular: 0.0,
        roughness: 0.05,
        specular_albedo: false,
        metallic: 0.0,
        reflection: Reflection::NONE,
        conserve_energy: false,
        irid: [0.0; 3],
    };

    /// The factor on cos^brilliance.
    pub fn diffuse_strength(&self) -> f32 {
        if self.diffuse_albedo { self.diffuse * 0.5 * (self.brilliance + 1.0) } else { self.diffuse }
    }

    /// The factor on the phong highlight.
    pub fn phong_strength(&self) -> f32 {
        if self.phong_albedo { self.phong * 0.5 * (self.phong_size + 1.0) } else { self.phong }
    }

    /// The factor on the specular highlight.
    pub fn specular_strength(&self) -> f32 {
        if !self.specular_albedo || self.roughness <= 0.0 {
            return self.specular;
        }
        let e = f64::from(self.roughness).recip();
        let halved = lumbre_math::Elementary::exponential_2(-0.5 * e);
        self.specular * ((e + 2.0) / (4.0 * (2.0 - halved))) as f32
    }
}

/// The mirror of a finish.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reflection {
    /// Its reflectance where it is looked at head on.
    pub least: Spectrum,
    /// Its reflectance at grazing angles.
    pub most: Spectrum,
    /// The exponent between them.
    pub falloff: f32,
    /// Whether Fresnel's law is between them.
    pub fresnel: bool,
    /// The exponent of what is mirrored, by its inverse.
    pub exponent: f32,
    /// How far it has the colour of the surface.
    pub metallic: f32,
}

impl Reflection {
    /// No mirror.
    pub const NONE: Self = Self {
        least: Spectrum::BLACK,
        most: Spectrum::BLACK,
        falloff: 1.0,
        fresnel: false,
        exponent: 1.0,
        metallic: 0.0,
    };

    /// Whether it mirrors nothing.
    pub fn is_none(&self) -> bool {
        self.least.is_black() && self.most.is_black()
    }

    /// The reflectance at a cosine, of a surface with an index of refraction inside over outside.
    pub fn at(&self, cosine: f32, eta: f32) -> Spectrum {
        if self.least == self.most && !self.fresnel {
            return self.least;
        }
        let share = if self.fresnel {
            crate::fresnel::dielectric(cosine, eta)
        } else {
            lumbre_math::Elementary::power((1.0 - cosine).max(0.0), self.falloff)
        };
        self.least + (self.most - self.least) * share
    }
}
