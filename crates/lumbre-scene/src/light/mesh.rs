//! Light from a triangle mesh: a triangle is chosen by its area, then a direction towards it.

use std::sync::Arc;

use lumbre_geometry::{Ray, Surface, Triangle};
use lumbre_kernel::TriangleMesh;
use lumbre_math::distribution::AliasTable;
use lumbre_math::{DVec2, DVec3};

use super::{LightSample, area};
use crate::surface::SurfaceEntry;

/// Triangles that shine.
#[derive(Clone, Debug)]
pub struct MeshLight {
    pub(crate) entry: u32,
    pub(crate) power: f64,
    pub(crate) mesh: Arc<TriangleMesh>,
    pub(crate) by_area: AliasTable,
}

impl MeshLight {
    /// `None` where no triangle has an area. Returns the total area too.
    pub(crate) fn new(entry: u32, mesh: Arc<TriangleMesh>) -> Option<(Self, f64)> {
        let areas: Vec<f64> =
            (0..mesh.indices.len()).map(|i| triangle(&mesh, i as u32).map_or(0.0, |t| t.area())).collect();
        let total: f64 = areas.iter().sum();
        let by_area = AliasTable::new(&areas)?;
        Some((Self { entry, power: 0.0, mesh, by_area }, total))
    }

    pub(super) fn sample(&self, entry: &SurfaceEntry, from: DVec3, u: DVec2) -> Option<LightSample> {
        let choice = self.by_area.sample(u.x);
        let chosen = choice.index as u32;
        let shape = triangle(&self.mesh, chosen)?;
        let sample = shape.sample_direction(from, DVec2::new(choice.rest, u.y))?;
        let pdf = choice.probability * sample.pdf;
        area::arriving(entry, &sample.surface, chosen, sample.surface.uv, from, pdf)
    }

    pub(super) fn pdf(&self, ray: &Ray, surface: &Surface, chosen: u32) -> f64 {
        let Some(shape) = triangle(&self.mesh, chosen) else { return 0.0 };
        self.by_area.probability(chosen as usize) * shape.pdf_direction(ray, surface)
    }
}

/// A triangle of a mesh, in the space of its tree.
fn triangle(mesh: &TriangleMesh, index: u32) -> Option<Triangle> {
    let corner = |i: u32| mesh.origin + mesh.positions[i as usize].as_dvec3();
    let [a, b, c] = mesh.indices[index as usize];
    Triangle::new(corner(a), corner(b), corner(c)).ok()
}
