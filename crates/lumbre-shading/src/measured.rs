//! Measured materials, as the files of the RGL material database tabulate them.
//!
//! Dupuy and Jakob, "An Adaptive Parameterization for Efficient Material Acquisition and Rendering", SIGGRAPH
//! Asia 2018. A BRDF is a table over a square that is warped so that samples lie where the material scatters most: its
//! warp samples the normals of visible facets, estimated from backscattering. The tables depend on the direction
//! towards the viewer, from which directions are sampled.

mod table;

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::sync::Arc;

use lumbre_math::{DVec3, Elementary, Vec2, Vec3};
use lumbre_simd::{MAX_LANES, Mask, Real, V3};

use crate::lanes::{LaneBsdf, LaneSample, Row, colour, field};
use crate::spectrum::Sigmoid;
use crate::{BsdfSample, LocalDir, Scatter, Spectrum};
use table::{Between, Table, Warp};

/// The tables of a measured material as its file has them; each with its last index fastest.
#[derive(Clone, Debug, Default)]
pub struct MeasuredParts {
    /// Angles between the normal and the viewer, ascending, in radians.
    pub theta_i: Vec<f32>,
    /// Azimuths of the viewer, ascending, in radians; one or two where the material is isotropic.
    pub phi_i: Vec<f32>,
    /// Rows and columns of `ndf`, `sigma` and `vndf`; and of `luminance` and `colours`. At least 2 each.
    pub size: [[usize; 2]; 4],
    /// The density of facet normals.
    pub ndf: Vec<f32>,
    /// The projected area of facets towards a direction.
    pub sigma: Vec<f32>,
    /// The density of visible facet normals, for each azimuth and angle of the viewer.
    pub vndf: Vec<f32>,
    /// The brightness over the warped square, for each azimuth and angle of the viewer.
    pub luminance: Vec<f32>,
    /// The colour over the warped square in linear Rec. 709, for each azimuth and angle of the viewer: all of red, of
    /// green and of blue.
    pub colours: [Vec<f32>; 3],
}

/// A measured BRDF, ready to be evaluated.
#[derive(Debug, PartialEq)]
pub struct MeasuredTables {
    theta_i: Vec<f32>,
    phi_i: Vec<f32>,
    ndf: Table,
    sigma: Table,
    vndf: Warp,
    luminance: Warp,
    colours: [Table; 3],
}

impl MeasuredTables {
    /// `None` where sizes do not fit: angles that are missing or do not ascend, fewer than two rows or columns, or
    /// tables that do not have a slice for each direction of the viewer. Numbers must be finite, and none of the
    /// densities negative.
    pub fn new(parts: MeasuredParts) -> Option<Self> {
        let MeasuredParts { theta_i, phi_i, size, ndf, sigma, vndf, luminance, colours: [red, green, blue] } =
            parts;
        let ascends = |angles: &[f32]| !angles.is_empty() && angles.windows(2).all(|pair| pair[0] < pair[1]);
        let [of_normals, of_area, of_visible, of_colour] = size;
        let tables = Self {
            ndf: Table::new(of_normals, ndf)?,
            sigma: Table::new(of_area, sigma)?,
            vndf: Warp::new(Table::new(of_visible, vndf)?),
            luminance: Warp::new(Table::new(of_colour, luminance)?),
            colours: [
                Table::new(of_colour, red)?,
                Table::new(of_colour, green)?,
                Table::new(of_colour, blue)?,
            ],
            theta_i,
            phi_i,
        };
        let slices = tables.theta_i.len() * tables.phi_i.len();
        let counts = [tables.vndf.slices(), tables.luminance.slices()];
        let fits = ascends(&tables.theta_i)
            && ascends(&tables.phi_i)
            && tables.ndf.slices() == 1
            && tables.sigma.slices() == 1
            && counts == [slices; 2]
            && tables.colours.iter().all(|colour| colour.slices() == slices);
        fits.then_some(tables)
    }

    /// Whether facets are given relative to the azimuth of the viewer.
    fn is_relative(&self) -> bool {
        self.phi_i.len() <= 2
    }

    /// Whether it looks the same however it is turned about its normal.
    pub fn is_isotropic(&self) -> bool {
        self.phi_i.len() == 1
    }

    /// The slices for a viewer.
    fn between(&self, theta: f64, phi: f64) -> Between {
        Between::new(&self.phi_i, phi, &self.theta_i, theta)
    }

    /// f · |cos θi| and the density of [`MeasuredTables::sample`].
    fn eval(&self, wo: Vec3, wi: Vec3) -> (Spectrum, f32) {
        const NONE: (Spectrum, f32) = (Spectrum::BLACK, 0.0);
        let on_one_side = wo.z * wi.z > 0.0;
        if !on_one_side {
            return NONE;
        }
        let flip = if wo.z < 0.0 { -1.0 } else { 1.0 };
        let (wo, wi) = (flip * wo.as_dvec3(), flip * wi.as_dvec3());
        let Some(m) = (wo + wi).try_normalize() else { return NONE };
        let (theta_o, phi_o) = angles(wo);
        let (theta_m, phi_m) = angles(m);
        let at_o = [from_theta(theta_o), from_phi(phi_o)];
        let mut at_m =
            [from_theta(theta_m), from_phi(if self.is_relative() { phi_m - phi_o } else { phi_m })];
        at_m[1] -= at_m[1].floor();

        let between = self.between(theta_o, phi_o);
        let (u, visible) = self.vndf.invert(&between, at_m);
        let (_, bright) = self.luminance.invert(&between, u);
        let area = self.sigma.single(at_o);
        let facets = self.ndf.single(at_m);
        let scale = if area > 0.0 { facets / (4.0 * area) } else { 0.0 };
        let [r, g, b] = [0, 1, 2].map(|c| (self.colours[c].value(&between, u).max(0.0) * scale) as f32);
        let jacobian = (2.0 * PI * PI * at_m[0] * theta_m.sine()).max(1e-6);
        let pdf = visible * bright / (4.0 * wo.dot(m) * jacobian);
        (Spectrum::new(r, g, b), if pdf.is_finite() { pdf as f32 } else { 0.0 })
    }

    /// A direction, f · |cos θi| over its density, and the density; `None` where none is on the side of the viewer.
    fn sample(&self, wo: Vec3, u: [f32; 2]) -> Option<(Vec3, Spectrum, f32)> {
        let wi = self.direction(wo, u)?;
        // Of the direction as rounded.
        let (value, pdf) = self.eval(wo, wi);
        (pdf > 0.0).then(|| (wi, value / pdf, pdf))
    }

    fn direction(&self, wo: Vec3, u: [f32; 2]) -> Option<Vec3> {
        let has_side = wo.z.abs() > 0.0;
        if !has_side {
            return None;
        }
        let flip = if wo.z < 0.0 { -1.0 } else { 1.0 };
        let up = flip * wo.as_dvec3();
        let (theta_o, phi_o) = angles(up);
        let between = self.between(theta_o, phi_o);
        let (u, _) = self.luminance.sample(&between, u.map(f64::from));
        let (at_m, _) = self.vndf.sample(&between, u);
        let theta = at_m[0] * at_m[0] * FRAC_PI_2;
        let phi = (2.0 * at_m[1] - 1.0) * PI + if self.is_relative() { phi_o } else { 0.0 };
        let ((sin, cos), (sin_phi, cos_phi)) = (theta.sine_cosine(), phi.sine_cosine());
        let m = DVec3::new(sin * cos_phi, sin * sin_phi, cos);
        let wi = (2.0 * up.dot(m) * m - up).normalize();
        (wi.z > 0.0).then(|| (flip * wi).as_vec3())
    }
}

/// The angle to the normal and the azimuth.
fn angles(w: DVec3) -> (f64, f64) {
    // Exact near the normal, where an arc cosine is not.
    (w.x.hypotenuse(w.y).angle_from(w.z), w.y.angle_from(w.x))
}

/// The place of an angle to the normal in a table.
fn from_theta(theta: f64) -> f64 {
    (theta / FRAC_PI_2).max(0.0).sqrt()
}

/// The place of an azimuth in a table.
fn from_phi(phi: f64) -> f64 {
    phi / TAU + 0.5
}

/// A measured surface. It reflects on both sides; it is reciprocal as far as its measurement is.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// Its tables.
    pub tables: Arc<MeasuredTables>,
    /// The wavelengths in nm that its channels are; `None` where they are linear Rec. 709.
    pub nm: Option<[f32; 3]>,
}

/// A colour at some wavelengths in nm: tables keep colours, which smooth spectra stand for; 0 in place of the first
/// where there are none.
fn at_wavelengths(colour: Spectrum, nm: [f32; 3]) -> Spectrum {
    let most = 2.0 * colour.max_component();
    if nm[0] == 0.0 || most <= 0.0 {
        return colour;
    }
    let sigmoid = Sigmoid::by_table(colour / most);
    let [r, g, b] = nm.map(|nm| most * sigmoid.at(nm));
    Spectrum::new(r, g, b)
}

impl Measured {
    /// A surface of these tables, in linear Rec. 709.
    pub fn new(tables: Arc<MeasuredTables>) -> Self {
        Self { tables, nm: None }
    }

    /// f · |cos θi|.
    pub fn eval(&self, wo: LocalDir, wi: LocalDir) -> Spectrum {
        at_wavelengths(self.tables.eval(wo.vec(), wi.vec()).0, self.nm.unwrap_or_default())
    }

    /// The density of [`Measured::sample`].
    pub fn pdf(&self, wo: LocalDir, wi: LocalDir) -> f32 {
        self.tables.eval(wo.vec(), wi.vec()).1
    }

    /// A reflection, about as bright as the surface is in its direction.
    pub fn sample(&self, wo: LocalDir, u: Vec2) -> Option<BsdfSample> {
        let (wi, weight, pdf) = self.tables.sample(wo.vec(), u.to_array())?;
        let weight = at_wavelengths(weight, self.nm.unwrap_or_default());
        let wi = LocalDir(wi);
        Some(BsdfSample { wi, weight, scatter: Scatter::Density(pdf), transmitted: false, eta: 1.0 })
    }

    /// The reflectance towards the normal, over some even directions: see [`crate::Bsdf::albedo`].
    pub(crate) fn albedo_estimate(&self) -> Spectrum {
        const SIDE: u32 = 8;
        let cell = |i: u32| (i as f32 + 0.5) / SIDE as f32;
        let mut sum = Spectrum::BLACK;
        for i in 0..SIDE * SIDE {
            let sample = self.tables.sample(Vec3::Z, [cell(i % SIDE), cell(i / SIDE)]);
            sum += sample.map_or(Spectrum::BLACK, |(_, weight, _)| weight);
        }
        let mean = at_wavelengths(sum / (SIDE * SIDE) as f32, self.nm.unwrap_or_default());
        mean.map(crate::unit)
    }

    /// Its row, but for the place of its tables.
    pub(crate) fn row(&self) -> Row {
        let [r, g, b] = self.nm.unwrap_or_default();
        Row::from_slice(&[0.0, r, g, b])
    }
}

/// The tables of all measured surfaces that lanes may read.
pub type MeasuredList = Arc<Vec<Arc<MeasuredTables>>>;

/// [`Measured`] over lanes. Each lane is evaluated separately, because table look-ups diverge.
#[derive(Clone, Debug)]
pub struct MeasuredLanes<R: Real> {
    /// Which of the tables, as a whole number.
    row: R,
    /// The wavelengths in nm; 0 where channels are linear Rec. 709.
    nm: V3<R>,
    tables: Option<MeasuredList>,
}

impl<R: Real> MeasuredLanes<R> {
    fn tables(&self, lane: usize, rows: &[f32; MAX_LANES]) -> &MeasuredTables {
        let tables = self.tables.as_ref().expect("lanes are given their tables");
        &tables[rows[lane] as usize]
    }
}

/// Vectors of each lane.
#[inline(always)]
fn each<R: Real>(v: V3<R>) -> [Vec3; MAX_LANES] {
    let (x, y, z) = (v.x.to_lanes(), v.y.to_lanes(), v.z.to_lanes());
    let mut lanes = [Vec3::ZERO; MAX_LANES];
    for (i, lane) in lanes.iter_mut().enumerate() {
        *lane = Vec3::new(x[i], y[i], z[i]);
    }
    lanes
}

#[inline(always)]
fn together<R: Real>(lanes: &[Vec3; MAX_LANES]) -> V3<R> {
    let mut columns = [[0.0; MAX_LANES]; 3];
    for (i, lane) in lanes.iter().enumerate() {
        [columns[0][i], columns[1][i], columns[2][i]] = lane.to_array();
    }
    V3::new(R::from_lanes(&columns[0]), R::from_lanes(&columns[1]), R::from_lanes(&columns[2]))
}

impl<R: Real> LaneBsdf<R> for MeasuredLanes<R> {
    const ROW: usize = 4;

    #[inline(always)]
    fn load(table: &[f32], at: R::UInt) -> Self {
        Self { row: field(table, at, 0), nm: colour(table, at, 1), tables: None }
    }

    #[inline(always)]
    fn with_measured(self, tables: &MeasuredList) -> Self {
        Self { tables: Some(tables.clone()), ..self }
    }

    #[inline(always)]
    fn eval(&self, wo: V3<R>, wi: V3<R>) -> (V3<R>, R) {
        let (rows, nm, wo, wi) = (self.row.to_lanes(), each(self.nm), each(wo), each(wi));
        let (mut values, mut pdfs) = ([Vec3::ZERO; MAX_LANES], [0.0; MAX_LANES]);
        for i in 0..R::LANES {
            let (value, pdf) = self.tables(i, &rows).eval(wo[i], wi[i]);
            values[i] = Vec3::from_array(at_wavelengths(value, nm[i].to_array()).to_array());
            pdfs[i] = pdf;
        }
        (together(&values), R::from_lanes(&pdfs))
    }

    #[inline(always)]
    fn sample(&self, wo: V3<R>, _: R, u: [R; 2]) -> LaneSample<R> {
        let (rows, nm, wo, u) = (self.row.to_lanes(), each(self.nm), each(wo), u.map(R::to_lanes));
        let (mut directions, mut weights) = ([Vec3::Z; MAX_LANES], [Vec3::ZERO; MAX_LANES]);
        let (mut pdfs, mut valid) = ([0.0; MAX_LANES], 0);
        for i in 0..R::LANES {
            let tables = self.tables(i, &rows);
            let Some((wi, weight, pdf)) = tables.sample(wo[i], [u[0][i], u[1][i]]) else { continue };
            valid |= 1 << i;
            directions[i] = wi;
            weights[i] = Vec3::from_array(at_wavelengths(weight, nm[i].to_array()).to_array());
            pdfs[i] = pdf;
        }
        LaneSample {
            wi: together(&directions),
            weight: together(&weights),
            pdf: R::from_lanes(&pdfs),
            valid: R::Mask::from_bitmask(valid),
            delta: R::Mask::splat(false),
            transmitted: R::Mask::splat(false),
            eta: R::one(),
        }
    }

    #[inline(always)]
    fn is_delta(&self) -> R::Mask {
        R::Mask::splat(false)
    }

    #[inline(always)]
    fn regularized(self, _: R::Mask) -> Self {
        self
    }
}
