//! BSDFs over lanes: each kind is written once over [`Real`], and the scalar [`Bsdf`] is its `f32` instance.
//!
//! A kind is loaded from rows of a table of numbers, which [`Bsdf::row`] writes; the lanes of one value may have rows
//! of different surfaces, but of one kind. All results have the same bits at every instruction set. Directions are unit
//! vectors in the local frame, whose z axis is the shading normal.

use std::sync::Arc;

use lumbre_math::{Vec2, Vec3};
use lumbre_simd::{Real, UInt, V3};
use smallvec::SmallVec;

pub use crate::coated_lanes::{CoatLanes, CoatedConductorLanes, CoatedDiffuseLanes};
pub use crate::conductor::ConductorLanes;
pub use crate::dielectric::{DielectricLanes, ThinDielectricLanes};
pub use crate::diffuse::{DiffuseLanes, DiffuseTransmissionLanes};
pub use crate::hair::HairLanes;
pub use crate::measured::{MeasuredLanes, MeasuredList};
pub use crate::microfacet::FacetLanes;
pub use crate::principled_lanes::{ClearcoatLanes, PrincipledLanes};
pub use crate::sheen::SheenLanes;
pub use crate::subsurface::SubsurfaceLanes;
pub use crate::thin_film::ThinFilmLanes;
pub use crate::uber_lanes::UberLanes;

use crate::{Bsdf, BsdfSample, LocalDir, Scatter, Spectrum};

/// The smallest cosine between a shading normal and the viewing direction.
const MIN_SEEN: f32 = 1e-3;

/// A shading normal, turned just far enough to be on the side of `towards` that the geometric normal is on; the
/// geometric normal where that gives no direction.
#[inline(always)]
pub fn facing<R: Real>(normal: V3<R>, geometric: V3<R>, towards: V3<R>) -> V3<R> {
    let is_below = geometric.dot(towards).simd_lt(R::zero());
    let side = V3::select(is_below, -towards, towards);
    let missing = R::splat(MIN_SEEN) - normal.dot(side);
    let turned = normal + side * missing;
    let scale = turned.length().recip();
    let has_direction = scale.is_finite() & R::zero().simd_lt(scale);
    let turned = V3::select(has_direction, turned * scale, geometric);
    V3::select(missing.simd_le(R::zero()), normal, turned)
}

/// A direction sampled from a BSDF in each lane: see [`BsdfSample`].
#[derive(Clone, Copy, Debug)]
pub struct LaneSample<R: Real> {
    /// The direction of incidence.
    pub wi: V3<R>,
    /// f · |cos θi| / pdf.
    pub weight: V3<R>,
    /// The density per unit solid angle; 1 for a delta.
    pub pdf: R,
    /// Whether there is a sample. Otherwise the light is absorbed, and the other members are undefined.
    pub valid: R::Mask,
    /// Where the direction is the only possible one.
    pub delta: R::Mask,
    /// Where the direction is on the other side of the surface.
    pub transmitted: R::Mask,
    /// η of the side of `wi` over that of the side of `wo`; 1 for a reflection or an unbent transmission.
    pub eta: R,
}

/// A kind of BSDF over lanes.
pub trait LaneBsdf<R: Real>: Sized {
    /// The numbers in a row of parameters.
    const ROW: usize;

    /// Reads the row that begins at `table[at]` in each lane.
    ///
    /// # Panics
    /// If a row reaches beyond the table.
    fn load(table: &[f32], at: R::UInt) -> Self;

    /// The same with the tables of measured surfaces, to which rows refer.
    #[inline(always)]
    #[must_use]
    fn with_measured(self, _: &MeasuredList) -> Self {
        self
    }

    /// f · |cos θi|, and the density of [`LaneBsdf::sample`]: both without delta parts.
    fn eval(&self, wo: V3<R>, wi: V3<R>) -> (V3<R>, R);

    /// Samples a direction from three uniform numbers in [0, 1): `lobe` selects a part, `u` the direction.
    fn sample(&self, wo: V3<R>, lobe: R, u: [R; 2]) -> LaneSample<R>;

    /// Where all parts are deltas, so that light sampling is useless.
    fn is_delta(&self) -> R::Mask;

    /// [`Bsdf::regularized`] in the lanes of the mask.
    #[must_use]
    fn regularized(self, mask: R::Mask) -> Self;
}

/// The kinds of [`Bsdf`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum BsdfKind {
    /// [`DiffuseLanes`].
    Diffuse,
    /// [`DiffuseTransmissionLanes`].
    DiffuseTransmission,
    /// [`ConductorLanes`].
    Conductor,
    /// [`DielectricLanes`].
    Dielectric,
    /// [`ThinDielectricLanes`].
    ThinDielectric,
    /// [`CoatedDiffuseLanes`].
    CoatedDiffuse,
    /// [`CoatedConductorLanes`].
    CoatedConductor,
    /// [`PrincipledLanes`].
    Principled,
    /// [`UberLanes`].
    Uber,
    /// [`HairLanes`].
    Hair,
    /// [`MeasuredLanes`].
    Measured,
    /// [`SubsurfaceLanes`].
    Subsurface,
}

impl BsdfKind {
    /// How many there are.
    pub const COUNT: usize = Self::Subsurface as usize + 1;
}

/// The parameters of a BSDF as plain numbers: [`LaneBsdf::ROW`] of them.
pub type Row = SmallVec<[f32; 8]>;

impl Bsdf {
    /// Its kind.
    pub fn kind(&self) -> BsdfKind {
        match self {
            Self::Diffuse(_) => BsdfKind::Diffuse,
            Self::DiffuseTransmission(_) => BsdfKind::DiffuseTransmission,
            Self::Conductor(_) => BsdfKind::Conductor,
            Self::Dielectric(_) => BsdfKind::Dielectric,
            Self::ThinDielectric(_) => BsdfKind::ThinDielectric,
            Self::CoatedDiffuse(_) => BsdfKind::CoatedDiffuse,
            Self::CoatedConductor(_) => BsdfKind::CoatedConductor,
            Self::Principled(_) => BsdfKind::Principled,
            Self::Uber(_) => BsdfKind::Uber,
            Self::Hair(_) => BsdfKind::Hair,
            Self::Measured(_) => BsdfKind::Measured,
            Self::Subsurface(_) => BsdfKind::Subsurface,
        }
    }

    /// The row from which [`LaneBsdf::load`] of its kind makes the same BSDF. That of a measured surface refers to the
    /// first of the tables; [`Rows::push`] writes the right one.
    pub fn row(&self) -> Row {
        match self {
            Self::Diffuse(bsdf) => Row::from_slice(&bsdf.row()),
            Self::DiffuseTransmission(bsdf) => Row::from_slice(&bsdf.row()),
            Self::Conductor(bsdf) => Row::from_slice(&bsdf.row()),
            Self::Dielectric(bsdf) => Row::from_slice(&bsdf.row()),
            Self::ThinDielectric(bsdf) => Row::from_slice(&[bsdf.eta]),
            Self::CoatedDiffuse(bsdf) => bsdf.row().collect(),
            Self::CoatedConductor(bsdf) => bsdf.row().collect(),
            Self::Principled(bsdf) => bsdf.row(),
            Self::Uber(bsdf) => bsdf.row(),
            Self::Hair(bsdf) => bsdf.row(),
            Self::Measured(bsdf) => bsdf.row(),
            Self::Subsurface(bsdf) => Row::from_slice(&bsdf.row()),
        }
    }
}

/// Rows of BSDFs, one after the other, and the tables of measured surfaces that they refer to.
#[derive(Clone, Debug, Default)]
pub struct Rows {
    numbers: Vec<f32>,
    measured: MeasuredList,
}

impl Rows {
    /// Appends the row of a BSDF; returns where it begins.
    pub fn push(&mut self, bsdf: &Bsdf) -> u32 {
        let at = self.numbers.len() as u32;
        let mut row = bsdf.row();
        if let Bsdf::Measured(bsdf) = bsdf {
            let place = self.measured.iter().position(|known| Arc::ptr_eq(known, &bsdf.tables));
            row[0] = place.unwrap_or(self.measured.len()) as f32;
            if place.is_none() {
                Arc::make_mut(&mut self.measured).push(bsdf.tables.clone());
            }
        }
        self.numbers.extend(row);
        at
    }

    /// Forgets all rows but those of `first`, with which they began or begin now.
    pub fn reset(&mut self, first: &Self) {
        if self.numbers.len() < first.numbers.len() {
            *self = Self { numbers: first.numbers.clone(), measured: Arc::new(first.measured.to_vec()) };
        }
        self.numbers.truncate(first.numbers.len());
    }

    /// All rows, one after the other.
    pub fn numbers(&self) -> &[f32] {
        &self.numbers
    }

    /// The BSDF of one kind whose row begins here, in each lane.
    ///
    /// # Panics
    /// If a row reaches beyond the last one.
    #[inline(always)]
    pub fn load<R: Real, B: LaneBsdf<R>>(&self, at: R::UInt) -> B {
        B::load(&self.numbers, at).with_measured(&self.measured)
    }
}

/// The number at this place of each row.
#[inline(always)]
pub(crate) fn field<R: Real>(table: &[f32], at: R::UInt, place: u32) -> R {
    R::gather(table, at + R::UInt::splat(place))
}

/// The colour from this place on of each row.
#[inline(always)]
pub(crate) fn colour<R: Real>(table: &[f32], at: R::UInt, place: u32) -> V3<R> {
    V3::new(field(table, at, place), field(table, at, place + 1), field(table, at, place + 2))
}

// Between the types of scalar code and one lane.

impl LaneSample<f32> {
    /// The sample, if there is one.
    pub(crate) fn scalar(self) -> Option<BsdfSample> {
        self.valid.then(|| BsdfSample {
            wi: LocalDir(vector(self.wi)),
            weight: spectrum(self.weight),
            scatter: if self.delta { Scatter::Delta } else { Scatter::Density(self.pdf) },
            transmitted: self.transmitted,
            eta: self.eta,
        })
    }
}

impl LocalDir {
    pub(crate) fn lane(self) -> V3<f32> {
        lane(self.0)
    }
}

pub(crate) fn lane(v: Vec3) -> V3<f32> {
    V3::new(v.x, v.y, v.z)
}

pub(crate) fn vector(v: V3<f32>) -> Vec3 {
    Vec3::new(v.x, v.y, v.z)
}

pub(crate) fn colour_lane(c: Spectrum) -> V3<f32> {
    V3::new(c.r, c.g, c.b)
}

pub(crate) fn spectrum(c: V3<f32>) -> Spectrum {
    Spectrum::new(c.x, c.y, c.z)
}

pub(crate) fn square(u: Vec2) -> [f32; 2] {
    [u.x, u.y]
}
