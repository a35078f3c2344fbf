//! The brightness of a textured light's triangles, and its distribution over them.

use std::sync::Arc;

use lumbre_math::distribution::PiecewiseConstant2D;
use lumbre_math::{DVec2, DVec3, Vec2, Vec3, warp, warp64};
use lumbre_shading::Spectrum;

use crate::Emission;
use crate::surface::MeshAttributes;

/// The brightness of a triangle.
#[derive(Clone, Debug)]
pub(super) struct Brightness {
    /// The mean radiance, over the triangle and over colours.
    pub mean: f64,
    /// The distribution of its brightness, unless it is nearly uniform.
    pub cells: Option<Cells>,
}

/// A density over a triangle, by cells of the square that [`warp64::square_to_triangle`] maps to it.
#[derive(Clone, Debug)]
pub(super) struct Cells(Arc<PiecewiseConstant2D>);

/// Look-ups per texel along an edge, so that interpolated texels are not missed.
const LOOKUPS_PER_TEXEL: f32 = 2.0;
/// Look-ups along an edge.
const MAX_LOOKUPS: f32 = 1024.0;
/// Look-ups for all triangles of a mesh, about one second.
const LOOKUPS_OF_ALL: f32 = 1.6e7;
/// Cells along an edge.
const MAX_CELLS: f32 = 128.0;
/// Cells for all triangles of a mesh, of four bytes each.
const CELLS_OF_ALL: f32 = 4e6;
/// A triangle is sampled by cells if its brightest cell is this many times its mean.
const VARIED: f32 = 4.0;
/// The share that a cell gets of its neighbours on each side, and of the mean: look-ups may have missed the edge of a
/// bright area.
const OF_NEIGHBOURS: f32 = 1.0 / 16.0;
const OF_MEAN: f32 = 0.02;

impl Brightness {
    /// For the triangles of a mesh, one after the other.
    pub(super) fn all(emission: &Emission, attributes: &MeshAttributes) -> Vec<Self> {
        let count = attributes.mesh.indices.len();
        let limit = |most: f32, of_all: f32| (of_all / count as f32).sqrt().clamp(2.0, most);
        let limits = [limit(MAX_LOOKUPS, LOOKUPS_OF_ALL), limit(MAX_CELLS, CELLS_OF_ALL)];
        (0..count as u32).map(|triangle| Self::of(emission, attributes, triangle, limits)).collect()
    }

    fn of(
        emission: &Emission,
        attributes: &MeshAttributes,
        triangle: u32,
        [max_lookups, max_cells]: [f32; 2],
    ) -> Self {
        let uvs = attributes.corner_uvs(triangle);
        let colours = attributes.corner_colours(triangle).filter(|_| emission.by_vertices);
        let colour = |b: Vec3| match colours {
            Some([first, second, third]) => first * b.x + second * b.y + third * b.z,
            None => Spectrum::WHITE,
        };
        let Some(image) = &emission.image else {
            let mean = emission.at(true, uvs[0], colour(Vec3::splat(1.0 / 3.0)));
            return Self { mean: f64::from(mean.map(|c| c.max(0.0)).average()), cells: None };
        };
        let edges = [uvs[1] - uvs[0], uvs[2] - uvs[0], uvs[2] - uvs[1]];
        let size = Vec2::new(image.bitmap().width() as f32, image.bitmap().height() as f32);
        let texels = edges.map(|edge| (edge * size).abs().max_element()).into_iter().fold(0.0, f32::max);
        let wanted = (LOOKUPS_PER_TEXEL * texels).ceil();
        // The minimum if the number is not finite.
        let lookups = if wanted >= 2.0 { wanted.min(max_lookups) } else { 2.0 };
        let side = lookups.min(max_cells) as usize;
        let per_cell = (lookups / side as f32).ceil() as usize;
        let lookups = side * per_cell;
        // With fewer look-ups than texels, each is the mean of its surroundings.
        let is_coarse = (lookups as f32) < wanted;
        let step = 1.0 / lookups as f32;
        let (along_a, along_b) =
            if is_coarse { (edges[0] * step, edges[1] * step) } else { (Vec2::ZERO, Vec2::ZERO) };
        let at = |x: usize, y: usize| {
            let b = warp::square_to_triangle(Vec2::new(x as f32 + 0.5, y as f32 + 0.5) * step);
            let uv = uvs[0] * b.x + uvs[1] * b.y + uvs[2] * b.z;
            let radiance = emission.radiance * colour(b) * image.lookup(uv, along_a, along_b);
            let brightness = radiance.map(|c| c.max(0.0)).average();
            if brightness.is_finite() { brightness } else { 0.0 }
        };
        let mut cells = vec![0.0; side * side];
        for y in 0..lookups {
            for x in 0..lookups {
                cells[y / per_cell * side + x / per_cell] += at(x, y);
            }
        }
        let share = 1.0 / (per_cell * per_cell) as f32;
        cells.iter_mut().for_each(|cell| *cell *= share);
        let mean = cells.iter().map(|&cell| f64::from(cell)).sum::<f64>() / cells.len() as f64;
        let brightest = cells.iter().copied().fold(0.0, f32::max);
        let is_varied = brightest > VARIED * mean as f32;
        let cells = if is_varied { Cells::new(&cells, side, mean as f32) } else { None };
        Self { mean, cells }
    }
}

impl Cells {
    fn new(brightness: &[f32], side: usize, mean: f32) -> Option<Self> {
        let weight = |x: usize, y: usize| {
            let (left, right) = (x.saturating_sub(1), (x + 1).min(side - 1));
            let (above, below) = (y.saturating_sub(1), (y + 1).min(side - 1));
            let around = (above..=below).flat_map(|y| (left..=right).map(move |x| brightness[y * side + x]));
            let own = brightness[y * side + x];
            own + OF_NEIGHBOURS * (around.sum::<f32>() - own) + OF_MEAN * mean
        };
        Some(Self(Arc::new(PiecewiseConstant2D::from_fn(side, side, weight)?)))
    }

    /// The weights of the second and third corner of a point, and its density for a triangle of area 1.
    pub(super) fn sample(&self, u: DVec2) -> (DVec2, f64) {
        let (square, density) = self.0.sample(u);
        let b = warp64::square_to_triangle(square);
        (DVec2::new(b.y, b.z), density)
    }

    /// The density of [`Cells::sample`].
    pub(super) fn pdf(&self, b: DVec2) -> f64 {
        let b = b.max(DVec2::ZERO);
        let b = b / (b.x + b.y).max(1.0);
        let square = warp64::triangle_to_square(DVec3::new(1.0 - b.x - b.y, b.x, b.y));
        self.0.pdf(square.clamp(DVec2::ZERO, DVec2::splat(1.0 - f64::EPSILON)))
    }
}
