//! Media that differ from place to place.
//!
//! A majorant is a bound on the extinction in a part of the medium, for all channels. Tentative collisions are as
//! frequent as if it were the extinction; each is then taken as a real one, or as one with nothing, by chance: E.
//! Woodcock and others, "Techniques Used in the GEM Code for Monte Carlo Neutronics Calculations", 1965. Probabilities
//! come from what the light carries in all channels, which are weighed by what is true of them, so that coloured media
//! have no channel that seldom counts for much: P. Kutz and others, "Spectral and Decomposition Tracking for Rendering
//! Heterogeneous Volumes", ACM Transactions on Graphics 36, 2017.

use lumbre_math::glam::IVec3;
use lumbre_math::{DVec3, Elementary, Transform};

use crate::Spectrum;
use crate::medium::{Cloud, DistanceSample, Grid, MediumSpectra, Passage, PassageNumbers, SparseGrid, Way};
use crate::spectrum::{BlackbodyColours, Wavelengths};

/// A medium that differs from place to place within a box; there is nothing outside of it.
#[derive(Clone, Debug)]
pub struct HeterogeneousMedium {
    medium_from_world: Transform,
    bounds: [DVec3; 2],
    coefficients: Coefficients,
    glow: Glow,
    /// Henyey–Greenstein asymmetry.
    pub(super) asymmetry: f32,
    majorants: Majorants,
    spectra: Option<Box<MediumSpectra>>,
}

/// A number for each place.
#[derive(Clone, Debug)]
pub enum Density {
    /// Of voxels that fill the medium's box.
    Grid(Grid<f32>),
    /// Of voxels with a map of their own.
    Sparse(Box<SparseGrid>),
    /// Procedural.
    Cloud(Cloud),
}

/// How a medium absorbs and scatters.
#[derive(Clone, Debug)]
pub enum Coefficients {
    /// In proportion to a density.
    Scaled {
        /// The density.
        density: Density,
        /// The absorption coefficient σ_a at density 1.
        absorption: Spectrum,
        /// The scattering coefficient σ_s at density 1.
        scattering: Spectrum,
    },
    /// By voxels that fill the medium's box; 1 everywhere where there are none.
    Coloured {
        /// The absorption coefficient.
        absorption: Option<Grid<Spectrum>>,
        /// The scattering coefficient.
        scattering: Option<Grid<Spectrum>>,
        /// A factor on both.
        scale: f32,
    },
}

/// The radiance that a medium tends to where it is deep and does not scatter.
#[derive(Clone, Debug)]
pub enum Glow {
    /// None.
    None,
    /// One colour, times a factor by place.
    Scaled {
        /// The colour.
        radiance: Spectrum,
        /// The factor.
        factor: Factor,
    },
    /// By voxels that fill the medium's box.
    Coloured {
        /// The radiance.
        radiance: Grid<Spectrum>,
        /// A factor on it.
        scale: f32,
    },
    /// By temperature.
    Heat(Box<Heat>),
}

/// The radiance of black bodies; none at 100 K and below.
#[derive(Clone, Debug)]
pub struct Heat {
    /// The temperature before the offset and the scale.
    pub temperature: Density,
    /// What is subtracted from it.
    pub offset: f32,
    /// What the difference is multiplied by: kelvins.
    pub scale: f32,
    /// A factor on the radiance.
    pub factor: Factor,
    /// The colours by temperature.
    pub colours: BlackbodyColours,
}

/// A factor on what a medium emits.
#[derive(Clone, Debug)]
pub enum Factor {
    /// The same everywhere.
    Constant(f32),
    /// By voxels that fill the medium's box.
    Grid(Grid<f32>),
}

impl Factor {
    fn is_zero(&self) -> bool {
        matches!(self, Self::Constant(factor) if *factor == 0.0)
    }

    fn at(&self, within: DVec3) -> f32 {
        match self {
            Self::Constant(factor) => *factor,
            Self::Grid(grid) => grid.at(within),
        }
    }

    fn memory(&self) -> usize {
        match self {
            Self::Constant(_) => 0,
            Self::Grid(grid) => grid.memory(),
        }
    }
}

/// What a medium is like at a place.
#[derive(Clone, Copy, Debug)]
struct Local {
    absorption: Spectrum,
    scattering: Spectrum,
}

impl Local {
    const BLACK: Self = Self { absorption: Spectrum::BLACK, scattering: Spectrum::BLACK };
}

/// What the channels of light are on a way: linear Rec. 709, or wavelengths.
#[derive(Clone, Copy)]
struct Channels<'w> {
    wavelengths: Option<&'w Wavelengths>,
    /// The coefficients at density 1, where they are in proportion to one.
    unit: Local,
    /// By how much majorants may be more.
    of_majorant: f32,
}

/// Bounds on the extinction in cells of the medium's box.
#[derive(Clone, Debug)]
struct Majorants {
    size: [usize; 3],
    most: Vec<f32>,
}

/// Tentative collisions at most on one way: beyond, nothing is left of the light.
const MAX_COLLISIONS: u32 = 1 << 16;
/// Below this part of what it was, light goes on by chance only.
const FAINT: f32 = 0.1;
/// Rounding may take an interpolated value this much beyond the values that it is between.
const ROUNDED: f32 = 1.0 + 1e-5;

impl HeterogeneousMedium {
    /// A medium in the box between two points of its own space. Densities and coefficients are neither negative nor
    /// infinite.
    pub fn new(
        medium_from_world: Transform,
        bounds: [DVec3; 2],
        asymmetry: f32,
        coefficients: Coefficients,
        glow: Glow,
    ) -> Self {
        let bounds = [bounds[0].min(bounds[1]), bounds[0].max(bounds[1])];
        let majorants = Majorants::new(&coefficients, bounds);
        Self { medium_from_world, bounds, coefficients, glow, asymmetry, majorants, spectra: None }
    }

    /// With what is known by wavelength of coefficients in proportion to a density, and of a glow of one colour.
    #[must_use]
    pub fn with_spectra(self, spectra: Option<MediumSpectra>) -> Self {
        Self { spectra: spectra.map(Box::new), ..self }
    }

    /// What channels are.
    fn channels<'w>(&self, wavelengths: Option<&'w Wavelengths>) -> Channels<'w> {
        let mut channels = Channels { wavelengths, unit: Local::BLACK, of_majorant: 1.0 };
        if let Coefficients::Scaled { absorption, scattering, .. } = &self.coefficients {
            channels.unit = Local { absorption: *absorption, scattering: *scattering };
        }
        let Some(wavelengths) = wavelengths else { return channels };
        let Local { absorption, scattering } = channels.unit;
        match self.coefficients {
            Coefficients::Scaled { .. } => {
                let [at_absorption, at_scattering] = MediumSpectra::coefficients(
                    self.spectra.as_deref(),
                    [absorption, scattering],
                    wavelengths,
                );
                let most = (absorption + scattering).max_component();
                if most > 0.0 {
                    channels.of_majorant = (at_absorption + at_scattering).max_component() / most;
                }
                channels.unit = Local { absorption: at_absorption, scattering: at_scattering };
            }
            // A spectrum may be twice as large as the greatest channel of its colour, and that of absorption another
            // than that of scattering.
            Coefficients::Coloured { .. } => channels.of_majorant = 4.0,
        }
        channels
    }

    pub(super) fn glows(&self) -> bool {
        match &self.glow {
            Glow::None => false,
            Glow::Scaled { radiance, factor } => !radiance.is_black() && !factor.is_zero(),
            Glow::Coloured { scale, .. } => *scale > 0.0,
            Glow::Heat(heat) => !heat.factor.is_zero(),
        }
    }

    pub(super) fn memory(&self) -> usize {
        let coefficients = match &self.coefficients {
            Coefficients::Scaled { density, .. } => density.memory(),
            Coefficients::Coloured { absorption, scattering, .. } => {
                [absorption, scattering].into_iter().flatten().map(Grid::memory).sum()
            }
        };
        let glow = match &self.glow {
            Glow::None => 0,
            Glow::Scaled { factor, .. } => factor.memory(),
            Glow::Coloured { radiance, .. } => radiance.memory(),
            Glow::Heat(heat) => heat.temperature.memory() + heat.factor.memory(),
        };
        coefficients + glow + size_of_val(self.majorants.most.as_slice())
    }

    /// See [`super::Medium::sample`].
    pub(super) fn sample(
        &self,
        way: &Way,
        carried: Spectrum,
        numbers: &mut PassageNumbers,
        wavelengths: Option<&Wavelengths>,
    ) -> Passage {
        let channels = self.channels(wavelengths);
        let mut weight = Spectrum::WHITE;
        let mut emitted = Spectrum::BLACK;
        let start = carried.max_component();
        let mut tentative = self.tentative(way, channels.of_majorant);
        while let Some((t, majorant)) = tentative.next(numbers) {
            let p = tentative.point(t);
            let Local { absorption, scattering } = self.at(p, &channels);
            let extinction = absorption + scattering;
            if extinction.is_black() {
                continue;
            }
            if self.glows() {
                emitted += weight * absorption * self.glow_at(p, wavelengths) / majorant;
            }
            let null = extinction.map(|extinction| (majorant - extinction).max(0.0));
            let carries = carried * weight;
            let (scatters, passes) = (sum(carries * scattering), sum(carries * null));
            if scatters + passes <= 0.0 {
                return Passage { outcome: DistanceSample::Through(Spectrum::BLACK), emitted };
            }
            let probability = scatters / (scatters + passes);
            if (numbers.next() as f32) < probability {
                let weight = weight * scattering / (majorant * probability);
                return Passage { outcome: DistanceSample::Collision { distance: t, weight }, emitted };
            }
            weight = weight * null / (majorant * (1.0 - probability));
            let part = (carried * weight).max_component() / start;
            if !goes_on(&mut weight, part, numbers) {
                return Passage { outcome: DistanceSample::Through(Spectrum::BLACK), emitted };
            }
        }
        let left = if tentative.is_lost() { Spectrum::BLACK } else { weight };
        Passage { outcome: DistanceSample::Through(left), emitted }
    }

    /// See [`super::Medium::transmittance`]: the product over all tentative collisions of what is not there (J. Novák
    /// and others, "Residual Ratio Tracking for Estimating Attenuation in Participating Media", ACM Transactions on
    /// Graphics 33, 2014).
    pub(super) fn transmittance(
        &self,
        way: &Way,
        numbers: &mut PassageNumbers,
        wavelengths: Option<&Wavelengths>,
    ) -> Spectrum {
        let channels = self.channels(wavelengths);
        let mut left = Spectrum::WHITE;
        let mut tentative = self.tentative(way, channels.of_majorant);
        while let Some((t, majorant)) = tentative.next(numbers) {
            let Local { absorption, scattering } = self.at(tentative.point(t), &channels);
            left *= (absorption + scattering).map(|extinction| (1.0 - extinction / majorant).max(0.0));
            let part = left.max_component();
            if !goes_on(&mut left, part, numbers) {
                return Spectrum::BLACK;
            }
        }
        if tentative.is_lost() { Spectrum::BLACK } else { left }
    }

    /// Absorption and scattering at a point of the medium's space, in its box.
    fn at(&self, p: DVec3, channels: &Channels<'_>) -> Local {
        match &self.coefficients {
            Coefficients::Scaled { density, .. } => {
                let density = density.at(p, &self.bounds);
                let Local { absorption, scattering } = channels.unit;
                Local { absorption: absorption * density, scattering: scattering * density }
            }
            Coefficients::Coloured { absorption, scattering, scale } => {
                let within = within(p, &self.bounds);
                let of = |grid: &Option<Grid<Spectrum>>| {
                    let Some(grid) = grid else { return Spectrum::splat(*scale) };
                    let colour = grid.at(within);
                    channels.wavelengths.map_or(colour, |w| w.varied_coefficient(colour)) * *scale
                };
                Local { absorption: of(absorption), scattering: of(scattering) }
            }
        }
    }

    fn glow_at(&self, p: DVec3, wavelengths: Option<&Wavelengths>) -> Spectrum {
        match &self.glow {
            Glow::None => Spectrum::BLACK,
            Glow::Scaled { radiance, factor } => {
                let spectra = self.spectra.as_deref();
                let radiance =
                    wavelengths.map_or(*radiance, |w| MediumSpectra::glow_at(spectra, *radiance, w));
                radiance * factor.at(within(p, &self.bounds))
            }
            Glow::Coloured { radiance, scale } => {
                let colour = radiance.at(within(p, &self.bounds));
                wavelengths.map_or(colour, |w| w.varied_light(colour)) * *scale
            }
            Glow::Heat(heat) => {
                let Heat { temperature, offset, scale, factor, colours } = &**heat;
                let kelvin = (temperature.at(p, &self.bounds) - offset) * scale;
                if kelvin > 100.0 {
                    let colour = wavelengths.map_or_else(|| colours.at(kelvin), |w| w.blackbody(kelvin));
                    colour * factor.at(within(p, &self.bounds))
                } else {
                    Spectrum::BLACK
                }
            }
        }
    }

    fn tentative<'a>(&'a self, way: &Way, of_majorant: f32) -> Tentative<'a> {
        let origin = self.medium_from_world.point(way.origin);
        let direction = self.medium_from_world.vector(way.direction);
        let cells = Cells::new(&self.majorants, &self.bounds, origin, direction, way.length);
        Tentative {
            origin,
            direction,
            cells,
            of_majorant,
            at: 0.0,
            end: 0.0,
            majorant: 0.0,
            depth: None,
            count: 0,
        }
    }
}

fn sum(c: Spectrum) -> f32 {
    c.r + c.g + c.b
}

/// A point of a box as one of the unit cube.
fn within(p: DVec3, bounds: &[DVec3; 2]) -> DVec3 {
    (p - bounds[0]) / (bounds[1] - bounds[0])
}

/// Russian roulette on the remaining light: whether it continues; its weight compensates.
fn goes_on(weight: &mut Spectrum, part: f32, numbers: &mut PassageNumbers) -> bool {
    if part.is_nan() || part <= 0.0 {
        return false;
    }
    if part >= FAINT {
        return true;
    }
    let probability = part / FAINT;
    *weight = *weight / probability;
    (numbers.next() as f32) < probability
}

impl Density {
    fn at(&self, p: DVec3, bounds: &[DVec3; 2]) -> f32 {
        match self {
            Self::Grid(grid) => grid.at(within(p, bounds)),
            Self::Sparse(grid) => grid.at(p),
            Self::Cloud(cloud) => cloud.at(p) as f32,
        }
    }

    fn memory(&self) -> usize {
        match self {
            Self::Grid(grid) => grid.memory(),
            Self::Sparse(grid) => grid.memory(),
            Self::Cloud(_) => 0,
        }
    }
}

impl Majorants {
    fn new(coefficients: &Coefficients, bounds: [DVec3; 2]) -> Self {
        match coefficients {
            Coefficients::Scaled { density, absorption, scattering } => {
                let most = (*absorption + *scattering).max_component() * ROUNDED;
                let mut majorants = match density {
                    Density::Cloud(_) => Self { size: [1; 3], most: vec![1.0] },
                    Density::Grid(grid) => {
                        Self::by_cells(grid.size(), |low, high| grid.between(low, high).fold(0.0, f32::max))
                    }
                    Density::Sparse(grid) => Self::of_sparse(grid, bounds),
                };
                majorants.most.iter_mut().for_each(|density| *density *= most);
                majorants
            }
            Coefficients::Coloured { absorption, scattering, scale } => {
                let size = |grid: &Option<Grid<Spectrum>>| grid.as_ref().map_or([1; 3], Grid::size);
                let (a, b) = (size(absorption), size(scattering));
                let size = std::array::from_fn(|axis| a[axis].max(b[axis]));
                let most = |grid: &Option<Grid<Spectrum>>, low, high| match grid {
                    None => Spectrum::WHITE,
                    Some(grid) => {
                        grid.between(low, high).fold(Spectrum::BLACK, |most, voxel| most.zip(voxel, f32::max))
                    }
                };
                Self::by_cells(size, |low, high| {
                    let both = most(absorption, low, high) + most(scattering, low, high);
                    both.max_component() * scale * ROUNDED
                })
            }
        }
    }

    /// Cells for a grid of voxels: several a voxel where these are few, and several voxels a cell where they are many.
    fn cells(voxels: usize) -> usize {
        (voxels / 4).clamp((2 * voxels).min(16), 64)
    }

    fn by_cells(voxels: [usize; 3], most: impl Fn(DVec3, DVec3) -> f32) -> Self {
        let size = voxels.map(Self::cells);
        let whole = DVec3::from_array(size.map(|n| n as f64));
        let mut cells = Vec::with_capacity(size.iter().product());
        for z in 0..size[2] {
            for y in 0..size[1] {
                for x in 0..size[0] {
                    let low = DVec3::from_array([x, y, z].map(|i| i as f64));
                    cells.push(most(low / whole, (low + 1.0) / whole));
                }
            }
        }
        Self { size, most: cells }
    }

    fn of_sparse(grid: &SparseGrid, bounds: [DVec3; 2]) -> Self {
        let [first, last] = grid.bounds();
        let voxels = (last.as_i64vec3() - first.as_i64vec3() + 1).to_array();
        let size = voxels.map(|n| Self::cells(usize::try_from(n).unwrap_or(usize::MAX / 2)));
        let whole = DVec3::from_array(size.map(|n| n as f64));
        let background = grid.voxel(IVec3::MIN);
        let mut most = vec![background.max(0.0); size.iter().product()];
        grid.each(|[low, high], value| {
            // A voxel shows up to the next ones.
            let (low, high) = (low.as_dvec3() - 1.0, high.as_dvec3() + 1.0);
            let (mut least, mut greatest) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
            for corner in 0..8 {
                let pick = |bit: usize| if corner >> bit & 1 == 1 { high } else { low };
                let p = grid.index_from_medium().inverse_point(DVec3::new(pick(0).x, pick(1).y, pick(2).z));
                let cell = within(p, &bounds) * whole;
                (least, greatest) = (least.min(cell), greatest.max(cell));
            }
            if least.cmpge(whole).any() || greatest.cmplt(DVec3::ZERO).any() {
                return;
            }
            let least = (least - 1e-6).floor().clamp(DVec3::ZERO, whole - 1.0).as_usizevec3();
            let greatest = (greatest + 1e-6).floor().clamp(DVec3::ZERO, whole - 1.0).as_usizevec3();
            for z in least.z..=greatest.z {
                for y in least.y..=greatest.y {
                    for x in least.x..=greatest.x {
                        let cell = &mut most[(z * size[1] + y) * size[0] + x];
                        *cell = cell.max(value);
                    }
                }
            }
        });
        Self { size, most }
    }
}

/// The tentative collisions along a way, in their order.
struct Tentative<'a> {
    origin: DVec3,
    direction: DVec3,
    cells: Cells<'a>,
    /// A factor on majorants.
    of_majorant: f32,
    /// The part of the way that is still to go in the present cell.
    at: f64,
    end: f64,
    majorant: f32,
    /// The optical depth to the next collision; `None` where that is not known yet.
    depth: Option<f64>,
    count: u32,
}

impl Tentative<'_> {
    /// How far along the way the next one is, and the majorant there.
    fn next(&mut self, numbers: &mut PassageNumbers) -> Option<(f64, f32)> {
        if self.count >= MAX_COLLISIONS {
            return None;
        }
        let depth = self.depth.take();
        // 1 - u is in (0, 1].
        let mut depth = depth.unwrap_or_else(|| -(1.0 - numbers.next()).logarithm());
        loop {
            let majorant = f64::from(self.majorant);
            let next = self.at + depth / majorant;
            if next < self.end {
                self.at = next;
                self.count += 1;
                return Some((next, self.majorant));
            }
            depth -= ((self.end - self.at) * majorant).max(0.0);
            (self.at, self.end, self.majorant) = self.cells.next()?;
            self.majorant *= self.of_majorant;
            depth = depth.max(0.0);
        }
    }

    fn point(&self, t: f64) -> DVec3 {
        self.origin + t * self.direction
    }

    /// Whether the limit of collisions was reached.
    fn is_lost(&self) -> bool {
        self.count >= MAX_COLLISIONS
    }
}

/// The cells that a way goes through, in their order. (J. Amanatides, A. Woo, "A Fast Voxel Traversal Algorithm for Ray
/// Tracing", Eurographics 1987.)
struct Cells<'a> {
    majorants: &'a Majorants,
    cell: [i64; 3],
    /// Where the way leaves the present cell along each axis.
    leaves: DVec3,
    /// From cell to cell along each axis.
    stride: DVec3,
    forward: [bool; 3],
    at: f64,
    end: f64,
}

impl<'a> Cells<'a> {
    fn new(
        majorants: &'a Majorants,
        bounds: &[DVec3; 2],
        origin: DVec3,
        direction: DVec3,
        length: f64,
    ) -> Self {
        let (mut at, mut end) = (0.0_f64, length);
        for axis in 0..3 {
            let (low, high) = (bounds[0][axis] - origin[axis], bounds[1][axis] - origin[axis]);
            let d = direction[axis];
            if d == 0.0 {
                if low > 0.0 || high < 0.0 {
                    end = -1.0;
                }
                continue;
            }
            let (a, b) = (low / d, high / d);
            at = at.max(a.min(b));
            end = end.min(a.max(b));
        }
        let size = DVec3::from_array(majorants.size.map(|n| n as f64));
        let cell_size = (bounds[1] - bounds[0]) / size;
        let start = ((origin + at.min(f64::MAX) * direction - bounds[0]) / cell_size).floor();
        let cell = start.clamp(DVec3::ZERO, size - 1.0);
        let (mut leaves, mut stride) = (DVec3::INFINITY, DVec3::INFINITY);
        let forward = [direction.x >= 0.0, direction.y >= 0.0, direction.z >= 0.0];
        for axis in 0..3 {
            let d = direction[axis];
            if d != 0.0 {
                let wall = cell[axis] + if forward[axis] { 1.0 } else { 0.0 };
                leaves[axis] = (bounds[0][axis] + wall * cell_size[axis] - origin[axis]) / d;
                stride[axis] = (cell_size[axis] / d).abs();
            }
        }
        Self { majorants, cell: cell.as_i64vec3().to_array(), leaves, stride, forward, at, end }
    }

    /// Where the next cell that is not empty begins and ends, and its majorant.
    fn next(&mut self) -> Option<(f64, f64, f32)> {
        loop {
            let [nx, ny, nz] = self.majorants.size.map(|n| n as i64);
            let [x, y, z] = self.cell;
            let is_inside = (0..nx).contains(&x) && (0..ny).contains(&y) && (0..nz).contains(&z);
            if !is_inside || self.at >= self.end {
                return None;
            }
            let most = self.majorants.most[((z * ny + y) * nx + x) as usize];
            let axis = if self.leaves.x <= self.leaves.y && self.leaves.x <= self.leaves.z {
                0
            } else if self.leaves.y <= self.leaves.z {
                1
            } else {
                2
            };
            let (from, to) = (self.at, self.leaves[axis].clamp(self.at, self.end));
            self.at = to;
            self.leaves[axis] += self.stride[axis];
            self.cell[axis] += if self.forward[axis] { 1 } else { -1 };
            if most > 0.0 && from < to {
                return Some((from, to, most));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumbre_math::random::RandomStream;

    /// A coloured medium of uneven density in a box that is turned and stretched.
    fn medium() -> HeterogeneousMedium {
        let voxels = (0..60_u16).map(|i| f32::from(i * 7 % 11) * 0.3).collect();
        let turn = Transform::rotate(DVec3::new(1.0, 2.0, 3.0), 40.0).unwrap();
        let stretch = Transform::scale(DVec3::new(1.5, 0.7, 1.0)).unwrap();
        HeterogeneousMedium::new(
            turn * stretch,
            [DVec3::new(-1.0, -2.0, -1.0), DVec3::new(1.0, 1.0, 2.0)],
            0.0,
            Coefficients::Scaled {
                density: Density::Grid(Grid::new([5, 4, 3], voxels).unwrap()),
                absorption: Spectrum::new(0.1, 0.3, 0.9),
                scattering: Spectrum::new(0.5, 0.2, 0.0),
            },
            Glow::Scaled {
                radiance: Spectrum::new(1.0, 2.0, 3.0),
                factor: Factor::Grid(Grid::new([1, 1, 1], vec![1.0]).unwrap()),
            },
        )
    }

    fn way() -> Way {
        let direction = DVec3::new(2.0, 1.0, -2.0) / 3.0;
        Way { origin: DVec3::new(0.1, 0.2, -0.3) - 2.0 * direction, direction, length: 3.1 }
    }

    /// What is left, what is scattered and what is emitted, by small steps.
    fn marched(medium: &HeterogeneousMedium, way: &Way) -> [Spectrum; 3] {
        let steps = 20_000;
        let dt = way.length / f64::from(steps);
        let (mut depth, mut scattered, mut emitted) = ([0.0_f64; 3], [0.0_f64; 3], [0.0_f64; 3]);
        for i in 0..steps {
            let t = (f64::from(i) + 0.5) * dt;
            let p = medium.medium_from_world.point(way.origin + t * way.direction);
            if p.cmplt(medium.bounds[0]).any() || p.cmpgt(medium.bounds[1]).any() {
                continue;
            }
            let (local, glow) = (medium.at(p, &medium.channels(None)), medium.glow_at(p, None).to_array());
            let (absorption, scattering) = (local.absorption.to_array(), local.scattering.to_array());
            for c in 0..3 {
                let extinction = f64::from(absorption[c] + scattering[c]);
                depth[c] += 0.5 * extinction * dt;
                let left = (-depth[c]).exp();
                scattered[c] += left * f64::from(scattering[c]) * dt;
                emitted[c] += left * f64::from(absorption[c] * glow[c]) * dt;
                depth[c] += 0.5 * extinction * dt;
            }
        }
        let colour = |c: [f64; 3]| Spectrum::from(c.map(|x| x as f32));
        [colour(depth.map(|depth| (-depth).exp())), colour(scattered), colour(emitted)]
    }

    #[test]
    fn flights_leave_scatter_and_emit_what_marching_finds() {
        let (medium, way) = (medium(), way());
        let [left, scattered, emitted] = marched(&medium, &way);
        let carried = Spectrum::new(0.3, 0.5, 0.9);
        let mut random = RandomStream::new(7);
        let count = 400_000;
        let mut sums = [[0.0_f64; 3]; 4];
        let mut add = |which: usize, colour: Spectrum| {
            (0..3).for_each(|c| sums[which][c] += f64::from(colour.to_array()[c]));
        };
        for _ in 0..count {
            let mut numbers =
                || PassageNumbers::new([random.next_f64(), random.next_f64()], random.next_u64());
            let passage = medium.sample(&way, carried, &mut numbers(), None);
            add(2, passage.emitted);
            match passage.outcome {
                DistanceSample::Through(weight) => add(0, weight),
                DistanceSample::Collision { weight, distance } => {
                    assert!(distance < way.length);
                    add(1, weight);
                }
            }
            add(3, medium.transmittance(&way, &mut numbers(), None));
        }
        for (which, expected) in [(0, left), (1, scattered), (2, emitted), (3, left)] {
            for (sum, expected) in sums[which].iter().zip(expected.to_array()) {
                let mean = sum / f64::from(count);
                let expected = f64::from(expected);
                assert!((mean - expected).abs() < 0.01 * expected + 5e-4, "{which}: {mean} for {expected}");
            }
        }
    }

    #[test]
    fn majorants_hold_everywhere() {
        let medium = medium();
        let mut random = RandomStream::new(11);
        for _ in 0..50_000 {
            let u = DVec3::new(random.next_f64(), random.next_f64(), random.next_f64());
            let p = medium.bounds[0] + u * (medium.bounds[1] - medium.bounds[0]);
            let Local { absorption, scattering } = medium.at(p, &medium.channels(None));
            let size = medium.majorants.size;
            let cell = (u * DVec3::from_array(size.map(|n| n as f64))).floor().as_usizevec3();
            let most = medium.majorants.most[(cell.z * size[1] + cell.y) * size[0] + cell.x];
            assert!((absorption + scattering).max_component() <= most, "{p}");
        }
    }

    #[test]
    fn empty_and_infinitely_long_ways_and_walls_are_no_trouble() {
        let medium = medium();
        let numbers = || PassageNumbers::new([0.5, 0.0], 3);
        let away = Way { origin: DVec3::splat(100.0), direction: DVec3::X, length: f64::INFINITY };
        assert_eq!(medium.transmittance(&away, &mut numbers(), None), Spectrum::WHITE);
        let through = Way { length: f64::INFINITY, ..way() };
        assert!(medium.transmittance(&through, &mut numbers(), None).is_finite());
        let dense = HeterogeneousMedium::new(
            Transform::IDENTITY,
            [DVec3::ZERO, DVec3::ONE],
            0.0,
            Coefficients::Scaled {
                density: Density::Grid(Grid::new([2, 1, 1], vec![1e30, 0.0]).unwrap()),
                absorption: Spectrum::BLACK,
                scattering: Spectrum::WHITE,
            },
            Glow::None,
        );
        let way = Way { origin: DVec3::new(-1.0, 0.5, 0.5), direction: DVec3::X, length: f64::INFINITY };
        let passage = dense.sample(&way, Spectrum::WHITE, &mut numbers(), None);
        assert!(matches!(passage.outcome, DistanceSample::Collision { .. }), "{passage:?}");
        assert_eq!(dense.transmittance(&way, &mut numbers(), None), Spectrum::BLACK);
    }
}
