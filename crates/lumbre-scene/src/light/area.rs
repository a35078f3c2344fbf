//! Area lights of one exact shape.

use std::sync::Arc;

use lumbre_geometry::{PlacedShape, Ray, Roots, Shape, Surface};
use lumbre_math::{DVec2, DVec3};
use lumbre_shading::{FloatTexture, Scatter, Spectrum};

use super::texels::Texels;
use super::tree::{Emitter, Facing};
use super::{LightPoint, LightSample};
use crate::Emission;
use crate::surface::SurfaceEntry;

/// A bounded, emissive exact shape.
#[derive(Clone, Debug)]
pub struct ShapeLight {
    /// Its surface entry in the scene.
    pub(crate) entry: u32,
    shape: PlacedShape,
    power: f64,
    /// Where its image shines, if that is far from uniform.
    texels: Option<Arc<Texels>>,
}

impl ShapeLight {
    /// The light of the entry with this number. Areas in the world are larger by a factor. `None` if it does not emit.
    pub(crate) fn new(
        number: u32,
        entry: &SurfaceEntry,
        shape: PlacedShape,
        area_factor: f64,
    ) -> Option<Self> {
        let emission = entry.emission.as_ref()?;
        let texels = Texels::of(entry, &shape).map(Arc::new);
        let mean =
            texels.as_ref().map_or_else(|| emission.mean(), |texels| Spectrum::splat(texels.mean as f32));
        let power = power(mean, emission.sides(), area_factor * shape.area());
        Some(Self { entry: number, shape, power, texels })
    }

    pub(super) fn power(&self) -> f64 {
        self.power
    }

    pub(super) fn sample(&self, entry: &SurfaceEntry, from: DVec3, u: DVec2) -> Option<LightSample> {
        let Some(texels) = &self.texels else {
            let sample = self.shape.sample_direction(from, u)?;
            // The coordinates of a face are its uv, unless vertices override them.
            return arriving(entry, &sample.surface, 0, sample.surface.uv, from, sample.pdf);
        };
        // Half of the samples by direction: the texels say nothing of what is near.
        let surface = if u.x < 0.5 {
            self.shape.sample_direction(from, DVec2::new(2.0 * u.x, u.y))?.surface
        } else {
            texels.sample(&self.shape, DVec2::new(2.0 * u.x - 1.0, u.y))?
        };
        let pdf = self.pdf(&Ray::new(from, surface.point - from), &surface);
        arriving(entry, &surface, 0, surface.uv, from, pdf)
    }

    pub(super) fn pdf(&self, ray: &Ray, surface: &Surface) -> f64 {
        let by_direction = self.shape.pdf_direction(ray, surface);
        match &self.texels {
            None => by_direction,
            Some(texels) => 0.5 * (by_direction + texels.pdf(&self.shape, ray.origin, surface)),
        }
    }

    /// The surface at this point of a ray from `from`.
    pub(super) fn surface_at(&self, from: DVec3, point: DVec3) -> Option<Surface> {
        let ray = Ray::new(from, point - from);
        let mut roots = Roots::new();
        self.shape.roots(&ray, &mut roots);
        let root = roots.iter().min_by(|a, b| (a.t - 1.0).abs().total_cmp(&(b.t - 1.0).abs()))?;
        Some(self.shape.surface(&ray, root))
    }

    /// Its entry in a light tree; `None` if it has no bounds.
    pub(super) fn emitter(&self, entry: &SurfaceEntry) -> Option<Emitter> {
        let is_flat = matches!(self.shape.shape(), Shape::Disk(_) | Shape::Triangle(_));
        let normal =
            is_flat.then(|| self.shape.sample_area(DVec2::splat(0.5))).flatten().map(|s| s.surface.normal);
        let facing = match (normal, side(entry)) {
            (Some(normal), Some(side)) => Facing::side(side * normal),
            _ => Facing::ANY,
        };
        let strength = intensity(self.power, entry.emission.as_ref()?);
        Some(Emitter { bounds: self.shape.bounds()?, facing, strength })
    }
}

/// The light arriving at `from` from a point of a surface.
pub(super) fn arriving(
    entry: &SurfaceEntry,
    geometric: &Surface,
    primitive: u32,
    local: DVec2,
    from: DVec3,
    pdf: f64,
) -> Option<LightSample> {
    let shaded = entry.shading_geometry(geometric, primitive, local, None, 0.0);
    let towards = (shaded.surface.point - from).try_normalize()?;
    let front = shaded.surface.normal.dot(towards) < 0.0;
    let emission = entry.emission.as_ref()?;
    let uv = shaded.surface.uv.as_vec2();
    let mut radiance = emission.at(front, uv, shaded.vertex.colour);
    let mut scatter = Scatter::Density(pdf as f32);
    if let Some(alpha) = &entry.alpha {
        if matches!(**alpha, FloatTexture::Constant(0.0)) {
            // A cut-out still emits, but no ray hits it.
            radiance *= (1.0 / pdf) as f32;
            scatter = Scatter::Delta;
        } else {
            radiance *= alpha.evaluate(&shaded.point_context()).clamp(0.0, 1.0);
        }
    }
    (pdf > 0.0 && !radiance.is_black()).then(|| LightSample {
        towards,
        end: Some(LightPoint::on(&shaded.surface)),
        radiance,
        scatter,
    })
}

/// The factor that turns the normal of a geometry to the emissive side, if there is only one and it is known.
fn side(entry: &SurfaceEntry) -> Option<f64> {
    let emission = entry.emission.as_ref()?;
    entry.outward(0).filter(|_| !emission.two_sided)
}

/// The greatest radiant intensity of a flat surface of this power.
pub(super) fn intensity(power: f64, emission: &Emission) -> f64 {
    power / (std::f64::consts::PI * f64::from(emission.sides()))
}

/// The power of a surface from its mean emission and its area.
pub(crate) fn power(mean: Spectrum, sides: f32, area: f64) -> f64 {
    std::f64::consts::PI * area * f64::from(sides * mean.average())
}
