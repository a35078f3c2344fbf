//! Area lights of triangle meshes: a triangle, or a rectangle of two, is chosen by power, then a direction to it.

use lumbre_geometry::{Aabb, Ray, Surface, Triangle};
use lumbre_kernel::TriangleMesh;
use lumbre_math::distribution::AliasTable;
use lumbre_math::{DVec2, DVec3, Vec2};
use lumbre_shading::{Scatter, Spectrum};

use super::area::intensity;
use super::brightness::{Brightness, Cells};
use super::pairs::{Pair, pairs};
use super::rectangle::Rectangle;
use super::sample::per_solid_angle;
use super::tree::{Emitter, Facing};
use super::{LightPoint, LightSample, area};
use crate::Emission;
use crate::surface::{MeshAttributes, SurfaceEntry};

/// Emissive triangles.
#[derive(Clone, Debug)]
pub struct MeshLight {
    pub(crate) entry: u32,
    pub(crate) power: f64,
    /// By weight.
    by_power: AliasTable,
    pub(super) pieces: Vec<Piece>,
    /// The piece of each triangle; empty if each triangle is its own piece.
    piece_of: Vec<u32>,
}

/// A unit of sampling, in the space of the mesh's tree, with precomputed data.
#[derive(Clone, Debug)]
pub(super) struct Piece {
    pub form: Form,
    pub corner: DVec3,
    pub sides: [DVec3; 2],
    pub normal: DVec3,
    pub area: f64,
    /// 1 if it faces as its normal does, or −1 if it is flipped; `None` if only a part is.
    pub outward: Option<f64>,
    /// The area times the brightness, relative to other pieces.
    weight: f64,
    /// The distribution of its brightness, unless it is nearly uniform.
    cells: Option<Cells>,
    pub center: DVec3,
    // The squared distance from the centre to the farthest corner.
    pub reach_squared: f64,
    // A bound on the error of each coordinate of its points.
    pub error: DVec3,
}

#[derive(Clone, Debug)]
pub(super) enum Form {
    /// Without area.
    Nothing,
    /// The triangle with this index.
    Triangle(Triangle, u32),
    /// Two triangles of a uniformly emissive light.
    Rectangle(Rectangle),
}

/// The share of the mean brightness that every triangle gets: look-ups may have missed bright areas.
const OF_MEAN: f64 = 1e-3;
/// The share of solid-angle samples of a near triangle that is not uniform.
const BY_ANGLE: f64 = 0.5;
/// At this many radii and beyond, sampling by area is as good as by solid angle, and faster.
const FAR: f64 = 2.0;

impl MeshLight {
    /// `None` if no triangle has an area. Also returns the total area.
    pub(crate) fn new(entry: u32, mesh: &TriangleMesh) -> Option<(Self, f64)> {
        let pieces: Vec<Piece> = (0..mesh.indices.len() as u32).map(|i| Piece::triangle(mesh, i)).collect();
        let total = pieces.iter().map(|piece| piece.area).sum();
        Some((Self::of(entry, pieces, Vec::new())?, total))
    }

    fn of(entry: u32, pieces: Vec<Piece>, piece_of: Vec<u32>) -> Option<Self> {
        let weights: Vec<f64> = pieces.iter().map(|piece| piece.weight).collect();
        Some(Self { entry, power: 0.0, by_power: AliasTable::new(&weights)?, pieces, piece_of })
    }

    /// As [`MeshLight::new`], for a light with a picture or vertex colours: brighter triangles are chosen more often,
    /// and so are brighter parts of triangles that are not uniform. Also returns the sum of the areas, each times its
    /// mean radiance; `None` for a black light.
    pub(crate) fn with_brightness(
        mut self,
        emission: &Emission,
        attributes: &MeshAttributes,
    ) -> Option<(Self, f64)> {
        let brightness = Brightness::all(emission, attributes);
        let total: f64 = self.pieces.iter().map(|piece| piece.area).sum();
        let whole: f64 = self.pieces.iter().zip(&brightness).map(|(piece, b)| piece.area * b.mean).sum();
        for (piece, Brightness { mean, cells }) in self.pieces.iter_mut().zip(brightness) {
            piece.weight = piece.area * (mean + OF_MEAN * (whole / total));
            piece.cells = cells;
        }
        Some((Self::of(self.entry, self.pieces, self.piece_of)?, whole))
    }

    /// Adds the known sides of the triangles.
    pub(crate) fn with_sides(mut self, entry: &SurfaceEntry) -> Self {
        for (triangle, piece) in (0..).zip(&mut self.pieces) {
            piece.outward = entry.outward(triangle);
        }
        self
    }

    /// Replaces pairs of triangles that form rectangles, for a uniformly emissive light.
    pub(crate) fn with_rectangles(self, mesh: &TriangleMesh) -> Self {
        let mut pairs = pairs(mesh);
        let outward = |triangle: u32| self.pieces[triangle as usize].outward;
        pairs.retain(|pair| {
            let [first, second] = pair.triangles.map(outward);
            first.is_some() && first == second
        });
        if pairs.is_empty() {
            return self;
        }
        let mut pieces = Vec::with_capacity(self.pieces.len() - pairs.len());
        let mut piece_of = vec![None; self.pieces.len()];
        for pair in pairs {
            for triangle in pair.triangles {
                piece_of[triangle as usize] = Some(pieces.len() as u32);
            }
            let outward = self.pieces[pair.triangles[0] as usize].outward;
            pieces.push(Piece { outward, ..Piece::rectangle(&pair) });
        }
        let piece_of = piece_of.into_iter().zip(&self.pieces).map(|(piece, triangle)| {
            piece.unwrap_or_else(|| {
                pieces.push(triangle.clone());
                pieces.len() as u32 - 1
            })
        });
        let piece_of = piece_of.collect();
        Self::of(self.entry, pieces, piece_of).unwrap_or(self)
    }

    /// The piece of a triangle of the mesh; `None` beyond the last.
    pub(super) fn piece_of(&self, triangle: u32) -> Option<u32> {
        if self.piece_of.is_empty() {
            return ((triangle as usize) < self.pieces.len()).then_some(triangle);
        }
        self.piece_of.get(triangle as usize).copied()
    }

    pub(super) fn sample(&self, entry: &SurfaceEntry, from: DVec3, u: DVec2) -> Option<LightSample> {
        let choice = self.by_power.sample(u.x);
        let sample = self.sample_piece(entry, choice.index as u32, from, DVec2::new(choice.rest, u.y))?;
        Some(sample.of_density(choice.probability))
    }

    /// A sample of one piece.
    pub(super) fn sample_piece(
        &self,
        entry: &SurfaceEntry,
        piece: u32,
        from: DVec3,
        u: DVec2,
    ) -> Option<LightSample> {
        let piece = &self.pieces[piece as usize];
        let plain = entry.uniform_emission().zip(piece.outward);
        match (&piece.form, plain) {
            (Form::Nothing, _) => None,
            (Form::Rectangle(_), None) => None,
            (_, Some((emission, outward))) => piece.sample(emission, outward, from, u),
            (Form::Triangle(shape, triangle), None) => {
                let (surface, pdf) = piece.sample_varied(shape, from, u)?;
                area::arriving(entry, &surface, *triangle, surface.uv, from, pdf)
            }
        }
    }

    pub(super) fn pdf(&self, ray: &Ray, surface: &Surface, triangle: u32) -> f64 {
        let Some(piece) = self.piece_of(triangle) else { return 0.0 };
        self.by_power.probability(piece as usize) * self.piece_pdf(ray.origin, surface.point, piece)
    }

    /// The density of [`MeshLight::sample_piece`] from a place at a point of the piece.
    pub(super) fn piece_pdf(&self, from: DVec3, point: DVec3, piece: u32) -> f64 {
        let piece = &self.pieces[piece as usize];
        let by_area = || per_solid_angle(piece.area, point - from, piece.normal).unwrap_or(0.0);
        match &piece.form {
            Form::Nothing => 0.0,
            Form::Triangle(shape, _) if piece.cells.is_some() => piece.pdf_varied(shape, from, point),
            _ if piece.is_far(from) => by_area(),
            Form::Triangle(shape, _) => {
                shape.pdf_direction(&Ray::new(from, point - from), &piece.surface_at(point))
            }
            Form::Rectangle(shape) => {
                shape.seen_from(from).map_or_else(by_area, |view| 1.0 / view.solid_angle)
            }
        }
    }

    /// The surface at a point, with the data that densities need; it depends on the point only.
    pub(super) fn surface_at(&self, point: DVec3) -> Surface {
        self.pieces[0].surface_at(point)
    }

    /// The entries of all pieces in a light tree.
    pub(super) fn emitters(&self, entry: &SurfaceEntry) -> Vec<Emitter> {
        let Some(emission) = &entry.emission else { return Vec::new() };
        let total: f64 = self.pieces.iter().map(|piece| piece.weight).sum();
        let strength = intensity(self.power, emission) / total;
        let pieces = self.pieces.iter();
        pieces
            .map(|piece| {
                let side = piece.outward.filter(|_| !emission.two_sided);
                let facing = side.map_or(Facing::ANY, |side| Facing::side(side * piece.normal));
                Emitter { bounds: Aabb::around(piece.corners()), facing, strength: strength * piece.weight }
            })
            .collect()
    }
}

impl Piece {
    fn triangle(mesh: &TriangleMesh, triangle: u32) -> Self {
        let [a, b, c] = mesh.indices[triangle as usize].map(|i| corner(mesh, i));
        let shape = Triangle::new(a, b, c).ok().filter(|shape| shape.area() > 0.0);
        let area = shape.as_ref().map_or(0.0, Triangle::area);
        let center = (a + b + c) / 3.0;
        let reach_squared = [a, b, c].map(|p| (p - center).length_squared()).into_iter().fold(0.0, f64::max);
        // Nine roundings of terms whose sum is at most the largest corner, as for a point of a triangle.
        let error = 9.0 * f64::EPSILON * a.abs().max(b.abs()).max(c.abs());
        let normal = shape.as_ref().map_or(DVec3::Z, |shape| {
            shape.surface_at(0, DVec2::splat(1.0 / 3.0)).map_or(DVec3::Z, |surface| surface.normal)
        });
        let form = shape.map_or(Form::Nothing, |shape| Form::Triangle(shape, triangle));
        let (sides, weight) = ([b - a, c - a], area);
        let (outward, cells) = (None, None);
        Self { form, corner: a, sides, normal, area, outward, weight, cells, center, reach_squared, error }
    }

    fn rectangle(pair: &Pair) -> Self {
        let Pair { rectangle, corner, sides: [a, b], gap, .. } = *pair;
        let cross = a.cross(b);
        let (normal, area) = (cross.normalize(), cross.length());
        let center = corner + 0.5 * (a + b);
        let reach_squared = 0.25 * (a + b).length_squared().max((a - b).length_squared());
        let error = 9.0 * f64::EPSILON * (corner.abs() + a.abs() + b.abs()) + gap;
        let (form, sides, weight) = (Form::Rectangle(rectangle), [a, b], area);
        let (outward, cells) = (None, None);
        Self { form, corner, sides, normal, area, outward, weight, cells, center, reach_squared, error }
    }

    /// The surface at a point of it.
    fn surface_at(&self, point: DVec3) -> Surface {
        let [dpdu, dpdv] = self.sides;
        let none = DVec3::ZERO;
        let normal = self.normal;
        Surface {
            point,
            point_error: self.error,
            normal,
            uv: DVec2::ZERO,
            dpdu,
            dpdv,
            dndu: none,
            dndv: none,
        }
    }

    fn corners(&self) -> impl Iterator<Item = DVec3> {
        let [a, b] = self.sides;
        let opposite = matches!(self.form, Form::Rectangle(_)).then_some(self.corner + a + b);
        [self.corner, self.corner + a, self.corner + b].into_iter().chain(opposite)
    }

    #[inline]
    fn is_far(&self, from: DVec3) -> bool {
        (from - self.center).length_squared() > FAR * FAR * self.reach_squared
    }

    /// A point of a triangle that is not uniform, and its density per unit solid angle.
    fn sample_varied(&self, shape: &Triangle, from: DVec3, u: DVec2) -> Option<(Surface, f64)> {
        let is_far = self.is_far(from);
        let by_angle = |u: DVec2| shape.sample_direction(from, u).map(|sample| (sample.surface, sample.pdf));
        let Some(cells) = &self.cells else {
            if !is_far {
                return by_angle(u);
            }
            let surface = shape.sample_area(u)?.surface;
            return Some((surface, per_solid_angle(self.area, surface.point - from, self.normal)?));
        };
        let by_cells = |u: DVec2| shape.surface_at(0, cells.sample(u).0);
        let surface = if is_far {
            by_cells(u)?
        } else if u.x < BY_ANGLE {
            by_angle(DVec2::new(u.x / BY_ANGLE, u.y))?.0
        } else {
            by_cells(DVec2::new((u.x - BY_ANGLE) / (1.0 - BY_ANGLE), u.y))?
        };
        let pdf = self.pdf_varied(shape, from, surface.point);
        (pdf > 0.0 && pdf.is_finite()).then_some((surface, pdf))
    }

    /// The density of [`Piece::sample_varied`] with cells.
    fn pdf_varied(&self, shape: &Triangle, from: DVec3, point: DVec3) -> f64 {
        let Some(cells) = &self.cells else { return 0.0 };
        let [a, b] = self.sides;
        let (cross, arm) = (a.cross(b), point - self.corner);
        let weights = DVec2::new(arm.cross(b).dot(cross), a.cross(arm).dot(cross)) / cross.length_squared();
        let by_area = per_solid_angle(self.area, point - from, self.normal).unwrap_or(0.0);
        let by_cells = by_area * cells.pdf(weights);
        if self.is_far(from) {
            return by_cells;
        }
        let by_angle = shape.pdf_direction(&Ray::new(from, point - from), &self.surface_at(point));
        BY_ANGLE * by_angle + (1.0 - BY_ANGLE) * by_cells
    }

    /// A sample of a uniformly emissive piece, on the side of its normal times `outward`.
    #[inline]
    fn sample(&self, emission: &Emission, outward: f64, from: DVec3, u: DVec2) -> Option<LightSample> {
        let front = outward * self.normal.dot(self.corner - from) < 0.0;
        let radiance = emission.at(front, Vec2::ZERO, Spectrum::WHITE);
        if radiance.is_black() {
            return None;
        }
        let (point, pdf) = self.sample_point(from, u)?;
        Some(LightSample {
            towards: (point - from).try_normalize()?,
            end: Some(LightPoint { point, error: self.error, normal: outward * self.normal }),
            radiance,
            scatter: Scatter::Density(pdf as f32),
        })
    }

    /// A point, and its density per unit solid angle.
    #[inline]
    fn sample_point(&self, from: DVec3, u: DVec2) -> Option<(DVec3, f64)> {
        let [a, b] = self.sides;
        let at = |part: DVec2| self.corner + part.x * a + part.y * b;
        let by_area = |part: DVec2| {
            let point = at(part);
            Some((point, per_solid_angle(self.area, point - from, self.normal)?))
        };
        let is_near = !self.is_far(from);
        match &self.form {
            Form::Nothing => None,
            Form::Triangle(shape, _) if is_near => {
                shape.sample_direction(from, u).map(|sample| (sample.surface.point, sample.pdf))
            }
            // The map of E. Heitz, "A low-distortion map between triangle and square", 2019.
            Form::Triangle(..) if u.y > u.x => by_area(DVec2::new(0.5 * u.x, u.y - 0.5 * u.x)),
            Form::Triangle(..) => by_area(DVec2::new(u.x - 0.5 * u.y, 0.5 * u.y)),
            Form::Rectangle(shape) => match is_near.then(|| shape.seen_from(from)).flatten() {
                Some(view) => Some((at(shape.sample(&view, u)), 1.0 / view.solid_angle)),
                None => by_area(u),
            },
        }
    }
}

fn corner(mesh: &TriangleMesh, vertex: u32) -> DVec3 {
    mesh.origin + mesh.positions[vertex as usize].as_dvec3()
}
