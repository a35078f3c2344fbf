//! Where an exact shape with an image shines.

use lumbre_geometry::{PlacedShape, Surface};
use lumbre_math::distribution::PiecewiseConstant2D;
use lumbre_math::{DVec2, DVec3, Vec2};

use super::sample::per_solid_angle;
use crate::surface::{Form, SurfaceEntry};

/// A density over the uv of a shape, proportional to the light of its cells.
#[derive(Clone, Debug)]
pub(super) struct Texels {
    cells: PiecewiseConstant2D,
    /// The mean radiance, over the area and over colours.
    pub mean: f64,
}

/// Look-ups per texel along an edge, so that interpolated texels are not missed.
const LOOKUPS_PER_TEXEL: u32 = 2;
/// Look-ups along an edge.
const MAX_LOOKUPS: u32 = 1024;
/// Cells along an edge.
const MAX_CELLS: u32 = 128;
/// A shape is sampled by cells if its brightest cell is this many times its mean.
const VARIED: f64 = 4.0;

impl Texels {
    /// `None` for a shape that is nearly uniform, or whose points are not known by their uv.
    pub(super) fn of(entry: &SurfaceEntry, shape: &PlacedShape) -> Option<Self> {
        let emission = entry.emission.as_ref()?;
        let image = emission.image.as_ref()?;
        // The uv of several parts overlap.
        let middle = DVec2::splat(0.5);
        let has_parts = (1..3).any(|part| shape.shape().surface_at(part, middle).is_some());
        if !matches!(entry.form, Form::Exact) || has_parts {
            return None;
        }
        let texels = [image.bitmap().width(), image.bitmap().height()];
        let wanted = texels.map(|count| count.saturating_mul(LOOKUPS_PER_TEXEL).max(2));
        let [columns, rows] = wanted.map(|count| count.min(MAX_CELLS) as usize);
        let per_cell = wanted.map(|count| count.min(MAX_LOOKUPS).div_ceil(MAX_CELLS) as usize);
        let step = Vec2::new(1.0 / (columns * per_cell[0]) as f32, 1.0 / (rows * per_cell[1]) as f32);
        // With fewer look-ups than texels, each is the mean of its surroundings.
        let is_coarse = wanted.iter().any(|&count| count > MAX_LOOKUPS);
        let [along_u, along_v] =
            if is_coarse { [Vec2::new(step.x, 0.0), Vec2::new(0.0, step.y)] } else { [Vec2::ZERO; 2] };
        let (mut light, mut stretches) = (Vec::with_capacity(columns * rows), 0.0);
        for cell in 0..columns * rows {
            let corner = [cell % columns * per_cell[0], cell / columns * per_cell[1]];
            let mut brightness = 0.0;
            for k in 0..per_cell[0] * per_cell[1] {
                let at = [corner[0] + k % per_cell[0], corner[1] + k / per_cell[0]];
                let uv = (Vec2::new(at[0] as f32, at[1] as f32) + 0.5) * step;
                let radiance = emission.radiance * image.lookup(uv, along_u, along_v);
                let radiance = f64::from(radiance.map(|c| c.max(0.0)).average());
                brightness += if radiance.is_finite() { radiance } else { 0.0 };
            }
            let middle = DVec2::new((cell % columns) as f64 + 0.5, (cell / columns) as f64 + 0.5)
                / DVec2::new(columns as f64, rows as f64);
            let stretch = stretch(&surface_at(shape, middle)?);
            stretches += stretch;
            light.push(brightness / (per_cell[0] * per_cell[1]) as f64 * stretch);
        }
        let mean = light.iter().sum::<f64>() / stretches;
        let brightest = light.iter().copied().fold(0.0, f64::max);
        if !mean.is_finite() || brightest <= VARIED * mean * stretches / light.len() as f64 {
            return None;
        }
        let cells =
            PiecewiseConstant2D::from_fn(columns, rows, |x, y| (light[y * columns + x] / brightest) as f32)?;
        Some(Self { cells, mean })
    }

    /// A point of the shape, more likely where it is bright.
    pub(super) fn sample(&self, shape: &PlacedShape, u: DVec2) -> Option<Surface> {
        surface_at(shape, self.cells.sample(u).0)
    }

    /// The density of [`Texels::sample`] per unit solid angle at `from`.
    pub(super) fn pdf(&self, shape: &PlacedShape, from: DVec3, surface: &Surface) -> f64 {
        let density = self.cells.pdf(surface.uv.clamp(DVec2::ZERO, DVec2::splat(1.0 - f64::EPSILON)));
        // By its uv alone: what a ray has met may lack derivatives.
        let Some(at) = surface_at(shape, surface.uv).filter(|_| density > 0.0) else { return 0.0 };
        per_solid_angle(stretch(&at) / density, surface.point - from, at.normal).unwrap_or(0.0)
    }
}

fn surface_at(shape: &PlacedShape, uv: DVec2) -> Option<Surface> {
    Some(shape.shape().surface_at(0, uv)?.placed(&shape.world_from_object()))
}

/// The area per unit of uv.
fn stretch(surface: &Surface) -> f64 {
    surface.dpdu.cross(surface.dpdv).length()
}
