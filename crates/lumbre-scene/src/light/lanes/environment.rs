//! Environment maps in lanes: look-up, density and samples.

use std::f32::consts::{FRAC_1_PI, FRAC_2_PI, PI, TAU};

use lumbre_math::DVec3;
use lumbre_math::distribution::{PiecewiseConstant1D, PiecewiseConstant2D};
use lumbre_simd::{Double, Mask, Real, UInt, V3, math};

use super::sample::{LaneLightSample, below_one};
use crate::EnvironmentMapping;
use crate::light::Sampling;
use crate::light::environment::{Environment, Panorama};

/// The maps between the world and the space of a light, as columns. Both are up to a factor, since directions are
/// normalized.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LaneMaps {
    light_from_world: [[f32; 3]; 3],
    world_from_light: [[f32; 3]; 3],
    /// Of the second.
    per_determinant: f32,
}

/// Beyond this many numbers an index does not fit.
const MAX_NUMBERS: usize = 1 << 31;

impl LaneMaps {
    pub(in crate::light) fn new(picture: &Panorama) -> Self {
        let map = &picture.world_from_light;
        let columns = |of: &dyn Fn(DVec3) -> DVec3| {
            let columns = DVec3::AXES.map(of);
            let largest = columns.iter().map(|column| column.abs().max_element()).fold(0.0, f64::max);
            (columns.map(|column| (column / largest).as_vec3().to_array()), largest)
        };
        let (world_from_light, largest) = columns(&|axis| map.vector(axis));
        let per_determinant = (largest.powi(3) / map.determinant().abs()) as f32;
        let (light_from_world, _) = columns(&|axis| map.inverse_vector(axis));
        Self { light_from_world, world_from_light, per_determinant }
    }
}

#[inline(always)]
fn times<R: Real>(columns: &[[f32; 3]; 3], v: V3<R>) -> V3<R> {
    let [x, y, z] = columns;
    V3::constant(*x) * v.x + V3::constant(*y) * v.y + V3::constant(*z) * v.z
}

/// A whole number below 2³², to the nearest.
#[inline(always)]
fn to_real<R: Real>(x: R::UInt) -> R {
    let high = R::from_int(x.shr::<8>()) * R::splat(256.0);
    high + R::from_int(x & R::UInt::splat(0xff))
}

/// A place in a table of probabilities for a uniform number of 24 bits, with eight more.
#[inline(always)]
fn fixed<R: Real>(u: R, more: R) -> R::UInt {
    let high = (u * R::splat(16_777_216.0)).to_int().shl::<8>();
    let x = high | (more * R::splat(256.0)).to_int();
    let total = R::UInt::splat(PiecewiseConstant1D::TOTAL);
    R::UInt::select(x.simd_lt(total), x, R::UInt::splat(PiecewiseConstant1D::TOTAL - 1))
}

/// The probability of a cell of a list that begins at `base`, out of the total, and where it starts.
#[inline(always)]
fn cell_of<R: Real>(starts: &[u32], base: R::UInt, count: u32, cell: R::UInt) -> (R::UInt, R::UInt) {
    let start = R::UInt::gather(starts, base + cell);
    let has_next = (cell + R::UInt::splat(1)).simd_lt(R::UInt::splat(count));
    let next = R::UInt::select(has_next, cell + R::UInt::splat(1), cell);
    let next = R::UInt::gather(starts, base + next);
    let next = R::UInt::select(has_next, next, R::UInt::splat(PiecewiseConstant1D::TOTAL));
    (next - start, start)
}

/// The cell of a list that holds `x`, its probability out of the total, and the place in it.
#[inline(always)]
fn find<R: Real>(starts: &[u32], base: R::UInt, count: u32, x: R::UInt) -> (R::UInt, R, R) {
    let mut cell = R::UInt::splat(0);
    let mut size = count;
    while size > 1 {
        let half = size / 2;
        let middle = cell + R::UInt::splat(half);
        let is_before = x.simd_lt(R::UInt::gather(starts, base + middle));
        cell = R::UInt::select(is_before, cell, middle);
        size -= half;
    }
    let (width, start) = cell_of::<R>(starts, base, count, cell);
    let width = to_real::<R>(width);
    let offset = (to_real::<R>(x - start) / width).simd_min(below_one());
    (cell, width, offset)
}

/// What a density is of probabilities out of the total, for this many cells.
#[inline(always)]
fn per_cell(count: usize) -> f32 {
    (count as f64 / f64::from(PiecewiseConstant1D::TOTAL)) as f32
}

/// A point of the square by a table, and its density.
#[inline(always)]
fn sample_table<R: Real>(table: &PiecewiseConstant2D, [u, v, more]: [R; 3]) -> ([R; 2], R) {
    let (columns, rows) = table.size();
    let zero = R::UInt::splat(0);
    let marginal = table.marginal().starts();
    let (y, down, in_row) = find::<R>(marginal, zero, rows as u32, fixed(v, R::zero()));
    let base = y * R::UInt::splat(columns as u32);
    let (x, along, in_column) = find::<R>(table.row_starts(), base, columns as u32, fixed(u, more));
    let density = along * R::splat(per_cell(columns)) * (down * R::splat(per_cell(rows)));
    let uv = [
        (R::from_int(x) + in_column) * R::splat(1.0 / columns as f32),
        (R::from_int(y) + in_row) * R::splat(1.0 / rows as f32),
    ];
    (uv, density)
}

/// The density of [`sample_table`].
#[inline(always)]
fn table_pdf<R: Real>(table: &PiecewiseConstant2D, uv: [R; 2]) -> R {
    let (columns, rows) = table.size();
    let x = cell_at(uv[0], columns);
    let y = cell_at(uv[1], rows);
    let (down, _) = cell_of::<R>(table.marginal().starts(), R::UInt::splat(0), rows as u32, y);
    let base = y * R::UInt::splat(columns as u32);
    let (along, _) = cell_of::<R>(table.row_starts(), base, columns as u32, x);
    to_real::<R>(along) * R::splat(per_cell(columns)) * (to_real::<R>(down) * R::splat(per_cell(rows)))
}

/// The cell of a number of [0, 1]; of any other, one that there is.
#[inline(always)]
fn cell_at<R: Real>(x: R, count: usize) -> R::UInt {
    let scaled = (x * R::splat(count as f32)).simd_max(R::zero());
    scaled.simd_min(R::splat((count - 1) as f32)).to_int()
}

/// 1 − z of a unit vector with z ≥ 0, without cancellation.
#[inline(always)]
fn one_minus_z<R: Real>(w: V3<R>) -> R {
    (w.x * w.x + w.y * w.y) / (R::one() + w.z)
}

impl Panorama {
    /// The point of the unit square of a unit direction in light space: see [`lumbre_math::warp`].
    #[inline(always)]
    fn lane_square<R: Real>(&self, w: V3<R>) -> [R; 2] {
        match self.mapping {
            EnvironmentMapping::EqualArea => {
                let a = w.abs();
                let radius = one_minus_z(a).simd_max(R::zero()).sqrt().simd_min(R::one());
                let y = radius * (math::atan2(a.y, a.x) * R::splat(FRAC_2_PI));
                let x = radius - y;
                let is_below = R::one().copysign(w.z).simd_lt(R::zero());
                let p = [
                    R::select(is_below, R::one() - y, x).copysign(w.x),
                    R::select(is_below, R::one() - x, y).copysign(w.y),
                ];
                let half = R::splat(0.5);
                [half * (p[0] + R::one()), half * (p[1] + R::one())]
            }
            EnvironmentMapping::LatitudeLongitude => {
                // Half a turn more than the azimuth: the middle of the picture is along x.
                let turns = math::atan2(w.y, w.x) * R::splat(1.0 / TAU) + R::splat(0.5);
                let across = (w.x * w.x + w.y * w.y).sqrt();
                [turns, math::atan2(across, w.z) * R::splat(FRAC_1_PI)]
            }
        }
    }

    /// The unit direction in light space of a point of the unit square.
    #[inline(always)]
    fn lane_direction<R: Real>(&self, uv: [R; 2]) -> V3<R> {
        match self.mapping {
            EnvironmentMapping::EqualArea => {
                let one = R::one();
                let (px, py) = (uv[0] + uv[0] - one, uv[1] + uv[1] - one);
                let (x, y) = (px.abs(), py.abs());
                let signed = one - (x + y);
                let radius = R::select(signed.simd_ge(R::zero()), x + y, (one - x) + (one - y));
                let ratio = ((y - x) / radius).or_zero(radius.simd_gt(R::zero()));
                let (sin, cos) = math::sin_cos_turns(R::splat(0.125) * (ratio + one));
                let squared = radius * radius;
                let across = radius * (R::splat(2.0) - squared).simd_max(R::zero()).sqrt();
                V3::new(
                    (across * cos).abs().copysign(px),
                    (across * sin).abs().copysign(py),
                    (one - squared).abs().copysign(signed),
                )
            }
            EnvironmentMapping::LatitudeLongitude => {
                let (sin_phi, cos_phi) = math::sin_cos_turns(uv[0] + R::splat(0.5));
                let (sin_theta, cos_theta) = math::sin_cos_turns(R::splat(0.5) * uv[1]);
                V3::new(sin_theta * cos_phi, sin_theta * sin_phi, cos_theta)
            }
        }
    }

    /// Bilinear interpolation at a point of the unit square; of any other, at one that there is.
    #[inline(always)]
    fn lane_lookup<R: Real>(&self, uv: [R; 2]) -> V3<R> {
        let half = R::splat(0.5);
        let size = [R::splat(self.width as f32), R::splat(self.height as f32)];
        // `simd_max` and `simd_min` give their argument for a NaN.
        let x = (uv[0] * size[0] - half).simd_max(-half).simd_min(size[0] - half);
        let y = (uv[1] * size[1] - half).simd_max(-half).simd_min(size[1] - half);
        let (column, row) = (x.floor(), y.floor());
        let (part_x, part_y) = (x - column, y - row);
        let one = R::UInt::splat(1);
        let stride = R::UInt::splat(3 * (self.width + 2));
        let above = (row.to_int() + one) * stride + (column.to_int() + one) * R::UInt::splat(3);
        let below = above + stride;
        let (upper, lower) = (self.lane_pair(above, part_x), self.lane_pair(below, part_x));
        let value = upper + (lower - upper) * part_y;
        value * V3::constant(self.scale.to_array())
    }

    /// Between a texel and the next one in its row.
    #[inline(always)]
    fn lane_pair<R: Real>(&self, at: R::UInt, part: R) -> V3<R> {
        let (left, right) = (self.lane_texel::<R>(at), self.lane_texel::<R>(at + R::UInt::splat(3)));
        left + (right - left) * part
    }

    #[inline(always)]
    fn lane_texel<R: Real>(&self, at: R::UInt) -> V3<R> {
        V3::new(
            R::gather(&self.texels, at),
            R::gather(&self.texels, at + R::UInt::splat(1)),
            R::gather(&self.texels, at + R::UInt::splat(2)),
        )
    }
}

impl Environment {
    /// Whether every index of its tables fits.
    pub(super) fn has_lanes(&self) -> bool {
        self.picture.texels.len() < MAX_NUMBERS
    }

    /// The ratio of area in the square to world-space solid angle, for a unit direction in light space.
    #[inline(always)]
    fn lane_density_of_map<R: Real>(&self, local: V3<R>) -> R {
        let in_light = match self.picture.mapping {
            EnvironmentMapping::EqualArea => R::splat(0.25 * FRAC_1_PI),
            EnvironmentMapping::LatitudeLongitude => {
                let sine = (local.x * local.x + local.y * local.y).sqrt();
                (R::splat(TAU * PI) * sine).recip()
            }
        };
        let stretch = times(&self.maps.world_from_light, local).length();
        in_light * (stretch * stretch * stretch * R::splat(self.maps.per_determinant))
    }

    /// The radiance from a unit direction of the world, and the density with which [`Environment::lane_sample`] with
    /// [`Sampling::Mis`] chooses it.
    #[inline(always)]
    pub(super) fn lane_escaped<R: Real>(&self, direction: V3<R>) -> (V3<R>, R) {
        let local = times(&self.maps.light_from_world, direction).normalize();
        let uv = self.picture.lane_square(local);
        let pdf = table_pdf(&self.beside_others, uv) * self.lane_density_of_map(local);
        (self.picture.lane_lookup(uv), pdf)
    }

    /// A direction by brightness, for two numbers and further digits of the first.
    #[inline(always)]
    pub(super) fn lane_sample<R: Real>(
        &self,
        active: R::Mask,
        u: [R; 3],
        sampling: Sampling,
    ) -> LaneLightSample<R> {
        let table = match sampling {
            Sampling::LightsOnly => &self.by_brightness,
            Sampling::Mis => &self.beside_others,
        };
        let (uv, density) = sample_table(table, u);
        let local = self.picture.lane_direction(uv);
        let pdf = density * self.lane_density_of_map(local);
        let radiance = self.picture.lane_lookup(uv);
        let nowhere = V3::splat(R::Double::splat(0.0));
        LaneLightSample {
            towards: times(&self.maps.world_from_light, local).normalize(),
            point: nowhere,
            error: nowhere,
            normal: V3::splat(R::zero()),
            infinite: active,
            radiance,
            pdf,
            delta: R::Mask::splat(false),
            source: R::UInt::splat(0),
            valid: active
                & pdf.simd_gt(R::zero())
                & pdf.is_finite()
                & radiance.max_component().simd_gt(R::zero()),
        }
    }
}
