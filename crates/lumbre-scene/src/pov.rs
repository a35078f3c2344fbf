//! POV-Ray's lights, and the surroundings of its scenes.

use std::sync::Arc;

use lumbre_math::{DVec2, DVec3, Elementary};
use lumbre_shading::pov::{Eye, Media, NoiseGenerator, Octaves, Pigment, PovMaterial};
use lumbre_shading::{Scatter, Spectrum};

use crate::light::{LightPoint, LightSample};

/// A light by POV-Ray's laws: no falloff with distance, unless it fades.
#[derive(Clone, Debug, PartialEq)]
pub struct PovLight {
    /// The position.
    pub from: DVec3,
    /// The point that it is aimed at.
    pub point_at: DVec3,
    /// Its colour in the working space; it may be negative.
    pub colour: Spectrum,
    /// The cone or the cylinder of its light.
    pub cone: Option<PovCone>,
    /// Whether its rays are parallel.
    pub is_parallel: bool,
    /// Whether it casts no shadows and has no highlights.
    pub shadowless: bool,
    /// The distance at which its fading factor is 1; 0 for no fading.
    pub fade_distance: f64,
    /// The exponent of its fading.
    pub fade_power: f64,
    /// Its extent.
    pub area: Option<PovArea>,
    /// The group of objects that it lights; `None` for all.
    pub group: Option<u32>,
    /// The exponent from the working space to linear light.
    pub gamma: f32,
    /// Whether media scatter its light.
    pub media_interaction: bool,
    /// Whether media in the air attenuate its light.
    pub media_attenuation: bool,
}

/// The cone or cylinder of a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PovCone {
    /// Whether it is a cylinder, with lengths instead of angles.
    pub is_cylinder: bool,
    /// The angle in degrees, or the length, from the axis within which it is full.
    pub radius: f64,
    /// The angle or length beyond which there is no light.
    pub falloff: f64,
    /// The exponent of the decrease from the axis.
    pub tightness: f64,
}

/// A grid of lights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PovArea {
    /// Its sides.
    pub sides: [DVec3; 2],
    /// The number of lights along each.
    pub counts: [u32; 2],
    /// Number of subdivisions even where its corners agree.
    pub adaptive: u32,
    /// Whether lights are moved at random.
    pub jitter: bool,
    /// Whether it is round.
    pub circular: bool,
    /// Whether it turns to the point that it lights.
    pub orient: bool,
    /// Whether each light shades separately; otherwise all shade from the middle.
    pub illumination: bool,
}

impl PovLight {
    /// A light from a point in all directions.
    pub fn new(from: DVec3, colour: Spectrum) -> Self {
        Self {
            from,
            point_at: DVec3::Z,
            colour,
            cone: None,
            is_parallel: false,
            shadowless: false,
            fade_distance: 0.0,
            fade_power: 0.0,
            area: None,
            group: None,
            gamma: 1.0,
            media_interaction: true,
            media_attenuation: false,
        }
    }

    fn axis(&self) -> DVec3 {
        (self.point_at - self.from).normalize_or(DVec3::Z)
    }

    /// The unit direction from a point to the light, and the distance; `from` is the point of an area light.
    pub fn towards(&self, p: DVec3, from: DVec3) -> Option<(DVec3, f64)> {
        // In a cylinder of light all rays are parallel to its axis, too.
        if self.is_parallel || self.cone.is_some_and(|cone| cone.is_cylinder) {
            let axis = self.axis();
            return Some((-axis, (p - from).dot(axis)));
        }
        let way = from - p;
        Some((way.try_normalize()?, way.length()))
    }

    /// The colour that arrives at a point if unoccluded.
    pub fn arriving(&self, p: DVec3, from: DVec3) -> Spectrum {
        let Some((_, distance)) = self.towards(p, from) else { return Spectrum::BLACK };
        if self.is_parallel && distance <= 0.0 {
            return Spectrum::BLACK;
        }
        let strength = self.cone.map_or(1.0, |cone| self.in_cone(&cone, p, from)) * self.fading(distance);
        self.colour * strength as f32
    }

    fn fading(&self, distance: f64) -> f64 {
        if self.fade_power <= 0.0 || self.fade_distance <= 0.0 {
            return 1.0;
        }
        2.0 / (1.0 + (distance / self.fade_distance).power(self.fade_power))
    }

    fn in_cone(&self, cone: &PovCone, p: DVec3, from: DVec3) -> f64 {
        let axis = self.axis();
        let along = (p - from).dot(axis);
        if along <= 0.0 && cone.is_cylinder {
            return 0.0;
        }
        if cone.is_cylinder {
            let across = ((p - from) - axis * along).length();
            if across >= cone.falloff {
                return 0.0;
            }
            let x = 1.0 - across / cone.falloff;
            let edge = 1.0 - cone.radius / cone.falloff;
            return x.power(cone.tightness) * smooth_step(x, 0.0, edge);
        }
        // Parallel rays all go along the axis of the cone.
        if self.is_parallel {
            return 1.0;
        }
        let length = (p - from).length();
        let cosine = if length > 0.0 { along / length } else { 0.0 };
        if cosine <= 0.0 {
            return 0.0;
        }
        let at = |degrees: f64| degrees.to_radians().cosine();
        cosine.power(cone.tightness) * smooth_step(cosine, at(cone.falloff), at(cone.radius))
    }

    /// A point of its area, from two numbers in [0, 1], as seen from a point.
    pub fn place(&self, u: DVec2, seen_from: DVec3) -> DVec3 {
        let Some(area) = &self.area else { return self.from };
        let mut sides = area.sides;
        let mut at = u - DVec2::splat(0.5);
        if area.orient {
            // Turned so that its normal points to the lit point.
            let lengths = sides.map(DVec3::length);
            let normal = (seen_from - self.from).normalize_or(DVec3::Y);
            let side = sides[0] - normal * normal.dot(sides[0]);
            let side = side.try_normalize().unwrap_or_else(|| normal.any_orthonormal_vector());
            sides = [side * lengths[0], normal.cross(side) * lengths[1]];
        }
        if area.circular {
            // Maps the square to a disk.
            let extent = at.abs().max_element();
            let length = at.length();
            if length > 0.0 {
                at *= extent / length;
            }
        }
        self.from + sides[0] * at.x + sides[1] * at.y
    }

    /// Light that arrives at a point, for path tracers: from a point on its area, by two uniform numbers.
    pub(crate) fn sample(&self, at: DVec3, u: DVec2) -> Option<LightSample> {
        let from = self.place(u, at);
        let (towards, distance) = self.towards(at, from)?;
        let arriving = self.arriving(at, from);
        if arriving.is_black() || distance <= 0.0 {
            return None;
        }
        // A white surface of albedo 1 that faces it has its colour.
        let radiance = self.linear(arriving) * std::f32::consts::PI;
        let end =
            Some(LightPoint { point: at + towards * distance, error: DVec3::ZERO, normal: DVec3::ZERO });
        Some(LightSample { towards, end, radiance, scatter: Scatter::Delta })
    }

    fn linear(&self, colour: Spectrum) -> Spectrum {
        colour.map(|c| c.max(0.0).power(self.gamma))
    }

    /// The irradiance of a surface that faces it, in linear light.
    pub fn irradiance(&self) -> Spectrum {
        self.linear(self.colour) * std::f32::consts::PI
    }
}

/// 0 below `low`, 1 above `high`, smooth between.
fn smooth_step(x: f64, low: f64, high: f64) -> f64 {
    if high <= low {
        return if x >= low { 1.0 } else { 0.0 };
    }
    let x = ((x - low) / (high - low)).clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// The surroundings of a POV-Ray scene, and its global settings.
#[derive(Clone, Debug)]
pub struct PovWorld {
    /// A factor on the ambient light of finishes.
    pub ambient_light: Spectrum,
    /// Maximum depth of rays.
    pub max_trace_level: u32,
    /// Rays that carry less than this are not traced.
    pub adc_bailout: f32,
    /// The exponent from the working space to linear light.
    pub gamma: f32,
    /// The colour behind everything, in the working space.
    pub background: Spectrum,
    /// The sky over it, the bottom layer first.
    pub sky: Vec<Arc<Pigment>>,
    /// Whether the layers of the sky are blended by the rule before version 3.7.
    pub old_sky: bool,
    /// How surfaces light one another, if they do.
    pub radiosity: Option<PovRadiosity>,
    /// Fogs.
    pub fogs: Vec<PovFog>,
    /// The wavelengths of red, green and blue for thin films.
    pub irid_wavelength: Spectrum,
    /// The media of the air.
    pub air: Vec<Media>,
    /// Whether there is fog or are media, in the air or in solids: path tracers do not have them.
    pub has_media: bool,
    /// The position of the scene's camera.
    pub eye: DVec3,
    /// The solids around the scene's camera.
    pub around_eye: Vec<Arc<PovMaterial>>,
}

/// Radiosity: the light that surfaces give one another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PovRadiosity {
    /// From how many directions a surface that the camera sees gathers light.
    pub count: u32,
    /// How often light is passed on from surface to surface, at most.
    pub bounces: u32,
    /// A factor on the light that is gathered.
    pub brightness: f32,
    /// How much of its hue is lost, from 0 to 1.
    pub grayness: f32,
    /// Whether surfaces have their ambient light besides, as before version 3.7.
    pub has_ambient: bool,
}

impl PovWorld {
    /// The colour of the sky in a unit direction, in the working space.
    pub fn sky_colour(&self, direction: DVec3) -> Spectrum {
        let eye = Eye { normal: -direction, direction: -direction, uv: DVec2::ZERO };
        let layers = self.sky.iter().map(|pigment| pigment.colour(direction, &eye));
        if !self.old_sky || self.sky.is_empty() {
            return layers.fold(self.background, |below, colour| {
                colour.rgb * colour.opacity(false) + below * colour.passing()
            });
        }
        // Layers do not tint one another; together they tint what is behind all of them.
        let (mut sum, mut left) = (Spectrum::BLACK, 1.0);
        let (mut tint, mut filter, mut transmit) = (Spectrum::WHITE, 1.0, 1.0);
        for colour in layers.rev() {
            sum += colour.rgb * (colour.opacity(false) * left);
            left *= colour.filter + colour.transmit;
            tint *= colour.rgb;
            filter *= colour.filter;
            transmit *= colour.transmit;
        }
        sum + self.background * (tint * filter + Spectrum::splat(transmit))
    }
}

/// Fog over an infinite distance is that over this length.
const FAR: f64 = 1e7;

/// A fog.
#[derive(Clone, Debug, PartialEq)]
pub struct PovFog {
    /// The distance at which e⁻¹ of light remains.
    pub distance: f64,
    /// Its colour in the working space.
    pub rgb: Spectrum,
    /// By how much it tints objects behind it.
    pub filter: f32,
    /// Minimum transmittance.
    pub transmit: f32,
    /// For ground fog: the height up to which it is full, and the height over which it thins out.
    pub ground: Option<[f64; 2]>,
    /// The unit direction of height.
    pub up: DVec3,
    /// By how much turbulence thins it, from 0, and a factor on the places where that is looked up.
    pub turbulence: Option<(f64, DVec3)>,
    /// The octaves of its turbulence, and their noise.
    pub octaves: (Octaves, NoiseGenerator),
}

impl PovFog {
    /// The transmittance over a distance from a point, which may be infinite.
    pub fn transmittance(&self, origin: DVec3, direction: DVec3, length: f64) -> f32 {
        if self.distance <= 0.0 {
            return 1.0;
        }
        let length = length.min(FAR);
        let density = match self.ground {
            None => 1.0,
            Some([offset, altitude]) => self.mean_density(origin, direction, length, offset, altitude),
        };
        let mut depth = if density == 0.0 { 0.0 } else { length * density / self.distance };
        if let Some((amount, scale)) = self.turbulence {
            // One number for the whole way, by its middle, and the less the longer it is.
            let middle = origin + direction * (0.5 * length);
            let (octaves, generator) = &self.octaves;
            let thinned = (amount * octaves.turbulence(middle * scale, *generator)).min(1.0);
            depth *= 1.0 - (-length / self.distance).exponential() * thinned;
        }
        ((-depth).exponential() as f32).max(self.transmit)
    }

    /// The mean of the density along a segment: 1 below the offset, 1 / (1 + (h / altitude)²) above it.
    fn mean_density(&self, origin: DVec3, direction: DVec3, length: f64, offset: f64, altitude: f64) -> f64 {
        let at = |t: f64| (origin + direction * t).dot(self.up) - offset;
        let (from, to) = (at(0.0), at(length));
        let difference = to - from;
        let density = |h: f64| if h <= 0.0 { 1.0 } else { 1.0 / (1.0 + (h / altitude).powi(2)) };
        if difference.abs() < 1e-9 * (1.0 + from.abs()) || altitude <= 0.0 {
            return density(0.5 * (from + to));
        }
        // The integral of the density over height.
        let integral = |h: f64| if h <= 0.0 { h } else { altitude * (h / altitude).arc_tangent() };
        (integral(to) - integral(from)) / difference
    }
}
