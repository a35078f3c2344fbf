//! Area lights of triangle meshes: a triangle is sampled by area, then a direction to it.

use lumbre_geometry::{Aabb, DirectionSample, Ray, Surface, Triangle};
use lumbre_kernel::TriangleMesh;
use lumbre_math::distribution::AliasTable;
use lumbre_math::{DVec2, DVec3, Vec2};
use lumbre_shading::{Scatter, Spectrum};

use super::area::{intensity, side};
use super::tree::{Emitter, Facing};
use super::{LightPoint, LightSample, area};
use crate::Emission;
use crate::surface::SurfaceEntry;

/// Emissive triangles.
#[derive(Clone, Debug)]
pub struct MeshLight {
    pub(crate) entry: u32,
    pub(crate) power: f64,
    pub(crate) by_area: AliasTable,
    pub(crate) facets: Vec<Facet>,
}

/// A triangle of the mesh, in the space of its tree, with data shared by its samples; without a shape it has no
/// area.
#[derive(Clone, Debug)]
pub(crate) struct Facet {
    shape: Option<Triangle>,
    corner: DVec3,
    sides: [DVec3; 2],
    normal: DVec3,
    area: f64,
    center: DVec3,
    // The squared distance from the centre to the farthest corner.
    reach_squared: f64,
    // A bound on the error of each coordinate of its points.
    error: DVec3,
}

/// From this many radii away, sampling by area is as good as by solid angle, and faster.
const FAR: f64 = 2.0;

impl MeshLight {
    /// `None` if no triangle has an area. Also returns the total area.
    pub(crate) fn new(entry: u32, mesh: &TriangleMesh) -> Option<(Self, f64)> {
        let facets: Vec<Facet> = mesh.indices.iter().map(|&corners| Facet::new(mesh, corners)).collect();
        let areas: Vec<f64> = facets.iter().map(|facet| facet.area).collect();
        let total: f64 = areas.iter().sum();
        let by_area = AliasTable::new(&areas)?;
        Some((Self { entry, power: 0.0, by_area, facets }, total))
    }

    pub(super) fn sample(&self, entry: &SurfaceEntry, from: DVec3, u: DVec2) -> Option<LightSample> {
        let choice = self.by_area.sample(u.x);
        let sample = self.sample_triangle(entry, choice.index, from, DVec2::new(choice.rest, u.y))?;
        Some(sample.of_density(choice.probability))
    }

    /// A sample of one triangle.
    pub(super) fn sample_triangle(
        &self,
        entry: &SurfaceEntry,
        triangle: usize,
        from: DVec3,
        u: DVec2,
    ) -> Option<LightSample> {
        let facet = &self.facets[triangle];
        if facet.is_far(from)
            && let Some((emission, outward)) = entry.plain_emission()
        {
            return facet.sample_by_area(emission, outward, from, u);
        }
        let sample = match &facet.shape {
            Some(shape) if !facet.is_far(from) => shape.sample_direction(from, u)?,
            Some(shape) => {
                let sample = shape.sample_area(u)?;
                let pdf = per_solid_angle(facet.area, sample.surface.point - from, facet.normal)?;
                DirectionSample { surface: sample.surface, pdf }
            }
            None => return None,
        };
        area::arriving(entry, &sample.surface, triangle as u32, sample.surface.uv, from, sample.pdf)
    }

    pub(super) fn pdf(&self, ray: &Ray, surface: &Surface, chosen: u32) -> f64 {
        self.by_area.probability(chosen as usize) * self.triangle_pdf(ray, surface, chosen)
    }

    /// The density of [`MeshLight::sample_triangle`].
    pub(super) fn triangle_pdf(&self, ray: &Ray, surface: &Surface, chosen: u32) -> f64 {
        let Some(facet) = self.facets.get(chosen as usize) else { return 0.0 };
        match &facet.shape {
            Some(shape) if !facet.is_far(ray.origin) => shape.pdf_direction(ray, surface),
            Some(_) => per_solid_angle(facet.area, surface.point - ray.origin, facet.normal).unwrap_or(0.0),
            None => 0.0,
        }
    }

    /// What a tree knows of every triangle.
    pub(super) fn emitters(&self, entry: &SurfaceEntry) -> Vec<Emitter> {
        let Some(emission) = &entry.emission else { return Vec::new() };
        let total: f64 = self.facets.iter().map(|facet| facet.area).sum();
        let strength = intensity(self.power, emission) / total;
        let side = side(entry);
        let facets = self.facets.iter();
        facets
            .map(|facet| {
                let [a, b] = facet.sides;
                let bounds = Aabb::around([facet.corner, facet.corner + a, facet.corner + b]);
                let facing = side.map_or(Facing::ANY, |side| Facing::side(side * facet.normal));
                Emitter { bounds, facing, strength: strength * facet.area }
            })
            .collect()
    }
}

impl Facet {
    fn new(mesh: &TriangleMesh, corners: [u32; 3]) -> Self {
        let [a, b, c] = corners.map(|i| mesh.origin + mesh.positions[i as usize].as_dvec3());
        let shape = Triangle::new(a, b, c).ok().filter(|shape| shape.area() > 0.0);
        let area = shape.as_ref().map_or(0.0, Triangle::area);
        let center = (a + b + c) / 3.0;
        let reach_squared = [a, b, c].map(|p| (p - center).length_squared()).into_iter().fold(0.0, f64::max);
        // Nine roundings of terms whose sum is at most the largest corner, as for a point of a triangle.
        let error = 9.0 * f64::EPSILON * a.abs().max(b.abs()).max(c.abs());
        let normal = shape.as_ref().map_or(DVec3::Z, |shape| {
            shape.surface_at(0, DVec2::splat(1.0 / 3.0)).map_or(DVec3::Z, |surface| surface.normal)
        });
        Self { shape, corner: a, sides: [b - a, c - a], normal, area, center, reach_squared, error }
    }

    #[inline]
    fn is_far(&self, from: DVec3) -> bool {
        (from - self.center).length_squared() > FAR * FAR * self.reach_squared
    }

    /// A point uniform by area. The emissive side is determined by the normal, `outward` times the triangle's.
    #[inline]
    fn sample_by_area(
        &self,
        emission: &Emission,
        outward: f64,
        from: DVec3,
        u: DVec2,
    ) -> Option<LightSample> {
        // The map of E. Heitz, "A low-distortion map between triangle and square", 2019.
        let (b1, b2) = if u.y > u.x { (0.5 * u.x, u.y - 0.5 * u.x) } else { (u.x - 0.5 * u.y, 0.5 * u.y) };
        let point = self.corner + b1 * self.sides[0] + b2 * self.sides[1];
        let arm = point - from;
        let front = outward * self.normal.dot(arm) < 0.0;
        let radiance = emission.at(front, Vec2::ZERO, Spectrum::WHITE);
        if radiance.is_black() {
            return None;
        }
        let pdf = per_solid_angle(self.area, arm, self.normal)?;
        Some(LightSample {
            towards: arm.normalize(),
            end: Some(LightPoint { point, error: self.error, normal: outward * self.normal }),
            radiance,
            scatter: Scatter::Density(pdf as f32),
        })
    }
}

/// The density per unit solid angle of uniform sampling by area: distance² / (|cos θ| area). `None` when seen
/// edge-on.
#[inline]
fn per_solid_angle(area: f64, arm: DVec3, normal: DVec3) -> Option<f64> {
    let squared = arm.length_squared();
    let pdf = squared * squared.sqrt() / (normal.dot(arm).abs() * area);
    (pdf > 0.0 && pdf.is_finite()).then_some(pdf)
}
