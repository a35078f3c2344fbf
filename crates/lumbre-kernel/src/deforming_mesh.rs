//! Meshes whose vertices move during a render: skins and morph targets.

use lumbre_geometry::{Aabb, Ray, Root, Roots, Surface};
use lumbre_math::{DVec3, Vec3};

use crate::build::error::BuildError;
use crate::intersect::watertight::{Meeting, Shear, intersect};
use crate::surface;
use crate::tree::geometry::has_area;
use crate::tree::geometry::{CustomGeometry, TriangleMesh};

/// An indexed mesh whose vertices move on straight lines between the positions of successive moments.
///
/// A tree contains it as [`crate::GeometryKind::Custom`]. A ray meets it as it would meet the [`TriangleMesh`] at its
/// time ([`DeformingMesh::at`]), to the bit, and as watertight: a vertex is interpolated once for all triangles around
/// it, and rounded to single precision. If the mesh is not closed, rays exactly through an edge of its border may miss
/// it.
#[derive(Clone, Debug, PartialEq)]
pub struct DeformingMesh {
    // At least one moment; each has the finite positions that the triangles need; the start is before the end.
    origin: DVec3,
    start: f64,
    end: f64,
    moments: Vec<Vec<Vec3>>,
    indices: Vec<[u32; 3]>,
}

/// A time of a deforming mesh: a moment, and the fraction of the way to the next.
#[derive(Clone, Copy)]
struct Moment {
    from: usize,
    part: f64,
}

impl DeformingMesh {
    /// `moments` are the positions of all vertices, relative to `origin`, at times evenly spaced from `start` to `end`.
    /// Before and after, the mesh does not move.
    ///
    /// # Errors
    /// [`BuildError::VertexOutOfRange`] if a triangle refers to a vertex that some moment lacks, and
    /// [`BuildError::NotFinite`], both for geometry 0, the latter also for times that are not finite or do not ascend.
    pub fn new(
        origin: DVec3,
        [start, end]: [f64; 2],
        moments: Vec<Vec<Vec3>>,
        indices: Vec<[u32; 3]>,
    ) -> Result<Self, BuildError> {
        let not_finite = |element| BuildError::NotFinite { geometry: 0, element };
        if !(origin.is_finite() && start.is_finite() && end.is_finite() && start < end) {
            return Err(not_finite(0));
        }
        if let Some(element) = moments.iter().find_map(|list| list.iter().position(|p| !p.is_finite())) {
            return Err(not_finite(element));
        }
        let vertices = moments.iter().map(Vec::len).min().unwrap_or(0);
        let is_beyond = |corners: &[u32; 3]| corners.iter().any(|&vertex| vertex as usize >= vertices);
        if let Some(triangle) = indices.iter().position(is_beyond) {
            return Err(BuildError::VertexOutOfRange { geometry: 0, triangle });
        }
        let moments = if moments.is_empty() { vec![vec![]] } else { moments };
        Ok(Self { origin, start, end, moments, indices })
    }

    /// The triangles.
    pub fn indices(&self) -> &[[u32; 3]] {
        &self.indices
    }

    /// The mesh at a time.
    pub fn at(&self, time: f64) -> TriangleMesh {
        let moment = self.moment(time);
        let vertices = self.moments.iter().map(Vec::len).min().unwrap_or(0);
        let positions = (0..vertices).map(|vertex| self.vertex(vertex as u32, moment)).collect();
        TriangleMesh { origin: self.origin, positions, indices: self.indices.clone() }
    }

    /// The moment of a time, and the fraction of the way to the next, for interpolating other vertex attributes. If the
    /// fraction is not 0, the moment has a next one.
    pub fn part(&self, time: f64) -> (usize, f64) {
        let Moment { from, part } = self.moment(time);
        (from, part)
    }

    fn moment(&self, time: f64) -> Moment {
        let last = self.moments.len() - 1;
        let along = (time - self.start) / (self.end - self.start) * last as f64;
        // NaN counts as before the start.
        if along > 0.0 {
            let from = (along as usize).min(last);
            Moment { from, part: if from == last { 0.0 } else { along - from as f64 } }
        } else {
            Moment { from: 0, part: 0.0 }
        }
    }

    /// Lies between the two positions in every coordinate.
    fn vertex(&self, vertex: u32, Moment { from, part }: Moment) -> Vec3 {
        let here = self.moments[from][vertex as usize];
        if part == 0.0 {
            return here;
        }
        let next = self.moments[from + 1][vertex as usize];
        let (start, way) = (here.as_dvec3(), next.as_dvec3() - here.as_dvec3());
        // Rounding might overshoot if one position is far from the origin and the other near it.
        (start + part * way).as_vec3().clamp(here.min(next), here.max(next))
    }

    fn corners(&self, triangle: u32, time: f64) -> [Vec3; 3] {
        let moment = self.moment(time);
        self.indices[triangle as usize].map(|vertex| self.vertex(vertex, moment))
    }
}

impl CustomGeometry for DeformingMesh {
    fn primitive_count(&self) -> u32 {
        self.indices.len() as u32
    }

    /// Between two moments, each vertex stays between its two positions, so the box around the positions at all moments
    /// bounds the triangle at every time.
    fn bounds(&self, triangle: u32) -> Option<Aabb> {
        let corners = self.indices[triangle as usize];
        let places = self.moments.iter().flat_map(|list| corners.map(|vertex| list[vertex as usize]));
        let (low, high) =
            places.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
        Some(Aabb { min: self.origin + low.as_dvec3(), max: self.origin + high.as_dvec3() })
    }

    fn closest(&self, triangle: u32, ray: &Ray) -> Option<Root> {
        let corners = self.corners(triangle, ray.time);
        // Without an area it could be hit from the side.
        if !has_area(&corners) {
            return None;
        }
        let shear = Shear::new(&ray.direction);
        let origin = shear.local_origin(&ray.origin, &self.origin);
        let permuted = corners.map(|corner| shear.axes.permute(&corner.as_dvec3()).map(|x| x as f32));
        match intersect(ray, shear, origin, permuted) {
            Meeting::Hit { root, .. } => Some(root),
            Meeting::Touch { root, is_owned, .. } if is_owned && ray.contains(root.t) => Some(root),
            Meeting::Touch { .. } | Meeting::Miss => None,
        }
    }

    fn roots(&self, triangle: u32, ray: &Ray, out: &mut Roots) {
        out.extend(self.closest(triangle, ray));
    }

    fn surface(&self, triangle: u32, ray: &Ray, root: &Root) -> Surface {
        surface::triangle_surface(self.origin, self.corners(triangle, ray.time), root.local)
    }
}
