//! Pigments: colours of a surface, with how much light passes through it.

use std::sync::Arc;

use lumbre_math::{DVec3, Elementary};

use super::pattern::Pattern;
use super::warp::Warps;
use super::{Eye, Function};
use crate::Spectrum;

/// A colour with two kinds of transparency.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Colour {
    /// Red, green and blue.
    pub rgb: Spectrum,
    /// The share of light that passes, tinted.
    pub filter: f32,
    /// The share that passes as it is.
    pub transmit: f32,
}

impl Colour {
    /// An opaque colour.
    pub const fn opaque(rgb: Spectrum) -> Self {
        Self { rgb, filter: 0.0, transmit: 0.0 }
    }

    /// Red, green, blue, filter, transmit.
    pub fn from_array([r, g, b, filter, transmit]: [f32; 5]) -> Self {
        Self { rgb: Spectrum::new(r, g, b), filter, transmit }
    }

    /// Red, green, blue, filter, transmit.
    pub fn to_array(self) -> [f32; 5] {
        [self.rgb.r, self.rgb.g, self.rgb.b, self.filter, self.transmit]
    }

    /// (1 - share) · this + share · other, in all five.
    #[must_use]
    pub fn mixed(self, other: Self, share: f32) -> Self {
        let keep = 1.0 - share;
        Self {
            rgb: self.rgb * keep + other.rgb * share,
            filter: self.filter * keep + other.filter * share,
            transmit: self.transmit * keep + other.transmit * share,
        }
    }

    /// The grey of its red, green and blue.
    pub fn gray(self) -> f32 {
        0.297 * self.rgb.r + 0.589 * self.rgb.g + 0.114 * self.rgb.b
    }

    /// How much of its own light is shown; by the rule before version 3.7, a filter is as clear as it is bright.
    pub fn opacity(self, is_old: bool) -> f32 {
        let filtered = if is_old { self.filter * self.rgb.max_component() } else { self.filter };
        1.0 - (filtered + self.transmit)
    }

    /// Whether it filters or transmits light.
    pub(super) fn is_clear(self) -> bool {
        self.filter != 0.0 || self.transmit != 0.0
    }

    /// What light that passes is multiplied by.
    pub fn passing(self) -> Spectrum {
        self.rgb * self.filter + Spectrum::splat(self.transmit)
    }
}

/// A pigment.
#[derive(Clone, Debug)]
pub struct Pigment {
    /// What it is.
    pub kind: PigmentKind,
    /// How points come to it, after those of its pattern.
    pub warps: Warps,
    /// Whether it lies in the coordinates of the surface.
    pub uv: bool,
}

/// The kinds of pigment.
#[derive(Clone, Debug)]
pub enum PigmentKind {
    /// One colour.
    Colour(Colour),
    /// A pattern by a map of colours.
    Map(Box<Pattern>, Arc<ColourMap>),
    /// A pattern by a map of pigments.
    Pigments(Box<Pattern>, Arc<[(f64, Arc<Pigment>)]>),
    /// A pattern of blocks of pigments.
    Blocks(Box<Pattern>, Arc<[Arc<Pigment>]>),
    /// A weighted mean.
    Average(Arc<[(f64, Arc<Pigment>)]>),
    /// An image.
    Image(Box<ImageMap>),
}

impl Pigment {
    /// One colour.
    pub fn plain(colour: Colour) -> Self {
        Self { kind: PigmentKind::Colour(colour), warps: Warps::default(), uv: false }
    }

    /// Whether it is the same everywhere.
    pub fn uniform(&self) -> Option<Colour> {
        match self.kind {
            PigmentKind::Colour(colour) => Some(colour),
            _ => None,
        }
    }

    /// Whether its colours depend on the normal of a surface.
    pub(super) fn looks_at_normals(&self) -> bool {
        match &self.kind {
            PigmentKind::Colour(_) | PigmentKind::Image(_) => false,
            PigmentKind::Map(pattern, _) => pattern.looks_at_normals(),
            PigmentKind::Pigments(pattern, map) => {
                pattern.looks_at_normals() || map.iter().any(|(_, pigment)| pigment.looks_at_normals())
            }
            PigmentKind::Blocks(pattern, pigments) => {
                pattern.looks_at_normals() || pigments.iter().any(|pigment| pigment.looks_at_normals())
            }
            PigmentKind::Average(pigments) => pigments.iter().any(|(_, pigment)| pigment.looks_at_normals()),
        }
    }

    /// The colour at a point of its surface.
    pub fn colour(&self, p: DVec3, eye: &Eye) -> Colour {
        let p = if self.uv { eye.uv.extend(0.0) } else { p };
        match &self.kind {
            PigmentKind::Colour(colour) => *colour,
            PigmentKind::Map(pattern, map) => {
                let p = pattern.point(self.warps.apply(p));
                map.at(pattern.value(p, eye))
            }
            PigmentKind::Pigments(pattern, map) => {
                let p = pattern.point(self.warps.apply(p));
                let ([(_, first), (_, second)], share) = between(map, pattern.value(p, eye));
                if share <= 0.0 {
                    return first.colour(p, eye);
                }
                first.colour(p, eye).mixed(second.colour(p, eye), share as f32)
            }
            PigmentKind::Blocks(pattern, pigments) => {
                let p = pattern.point(self.warps.apply(p));
                let index = pattern.value(p, eye) as usize;
                pigments
                    .get(index)
                    .or(pigments.last())
                    .map_or(Colour::default(), |pigment| pigment.colour(p, eye))
            }
            PigmentKind::Average(pigments) => {
                let p = self.warps.apply(p);
                let mut sum = [0.0; 5];
                let mut total = 0.0;
                for (weight, pigment) in pigments.iter() {
                    let weight = *weight as f32;
                    total += weight;
                    for (sum, c) in sum.iter_mut().zip(pigment.colour(p, eye).to_array()) {
                        *sum += weight * c;
                    }
                }
                Colour::from_array(sum.map(|c| if total == 0.0 { 0.0 } else { c / total }))
            }
            PigmentKind::Image(image) => image.colour(self.warps.apply(p)),
        }
    }
}

/// The two entries of a map around a value, and the share of the second.
pub(super) fn between<T>(map: &[(f64, T)], v: f64) -> ([&(f64, T); 2], f64) {
    let i = map.partition_point(|entry| entry.0 <= v);
    if i == 0 {
        return ([&map[0], &map[0]], 0.0);
    }
    if i == map.len() {
        return ([&map[i - 1], &map[i - 1]], 0.0);
    }
    let (below, above) = (&map[i - 1], &map[i]);
    ([below, above], (v - below.0) / (above.0 - below.0))
}

/// Colours by a value, linear between entries.
#[derive(Clone, Debug, PartialEq)]
pub struct ColourMap {
    entries: Vec<(f64, Colour)>,
}

impl ColourMap {
    /// A map of entries in ascending order; of none it is black.
    pub fn new(mut entries: Vec<(f64, Colour)>) -> Self {
        if entries.is_empty() {
            entries.push((0.0, Colour::default()));
        }
        Self { entries }
    }

    /// Whether any of its colours lets light pass.
    pub(super) fn may_pass(&self) -> bool {
        self.entries.iter().any(|(_, colour)| colour.is_clear())
    }

    /// The colour of a value.
    pub fn at(&self, v: f64) -> Colour {
        let ([below, above], share) = between(&self.entries, v);
        if share <= 0.0 { below.1 } else { below.1.mixed(above.1, share as f32) }
    }
}

/// An image on a surface.
#[derive(Clone, Debug)]
pub struct ImageMap {
    /// Where its colours come from.
    pub source: ImageSource,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// How it lies in space.
    pub projection: ImageProjection,
    /// Whether it is not repeated.
    pub once: bool,
    /// Whether colours between pixels are interpolated.
    pub interpolate: bool,
    /// Added to the filter of all its colours.
    pub filter: f32,
    /// Added to the transparency of all its colours.
    pub transmit: f32,
}

/// Where the colours of an image come from.
#[derive(Clone, Debug)]
pub enum ImageSource {
    /// Pixels in the working space, row by row from the top; a transparent one transmits.
    Pixels(Arc<[Colour]>),
    /// A function of the plane, from the top.
    Function(Arc<Function>),
}

/// How an image lies in space.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageProjection {
    /// In x and y.
    Planar,
    /// Around a sphere.
    Spherical,
    /// Around y, from y = 0 to 1.
    Cylindrical,
    /// Around a torus of radius 1.
    Toroidal,
}

impl ImageMap {
    /// The colour at a point.
    pub fn colour(&self, p: DVec3) -> Colour {
        let none = Colour { rgb: Spectrum::BLACK, filter: 0.0, transmit: 1.0 };
        let Some([u, v]) = self.place(p) else { return none };
        let mut colour = self.at(u, v);
        colour.filter += self.filter;
        colour.transmit += self.transmit;
        colour
    }

    /// Its grey as a pattern.
    pub fn value(&self, p: DVec3) -> f64 {
        f64::from(self.colour(p).gray())
    }

    /// The colour at a place on the image in [0, 1), without what is added to all.
    pub(super) fn at(&self, u: f64, v: f64) -> Colour {
        if self.interpolate { self.interpolated(u, v) } else { self.nearest(u, v) }
    }

    /// The place on the image in [0, 1), from its lower left corner; `None` where there is no image.
    pub(super) fn place(&self, p: DVec3) -> Option<[f64; 2]> {
        use std::f64::consts::{PI, TAU};
        let around = |x: f64, z: f64| {
            let turn = z.angle_from(x) / TAU;
            if turn < 0.0 { turn + 1.0 } else { turn }
        };
        let [u, v] = match self.projection {
            ImageProjection::Planar => [p.x, p.y],
            ImageProjection::Spherical => {
                let length = p.length();
                if length == 0.0 {
                    return None;
                }
                [around(p.x, p.z), 0.5 + (p.y / length).clamp(-1.0, 1.0).arc_sine() / PI]
            }
            ImageProjection::Cylindrical => [around(p.x, p.z), p.y],
            ImageProjection::Toroidal => {
                let across = p.x.hypotenuse(p.z) - 1.0;
                [around(p.x, p.z), around(-across, -p.y)]
            }
        };
        let is_outside = |x: f64| !(0.0..1.0).contains(&x);
        if self.once && (is_outside(u) || is_outside(v)) {
            return None;
        }
        Some([u - u.floor(), v - v.floor()])
    }

    fn nearest(&self, u: f64, v: f64) -> Colour {
        let column = (u * f64::from(self.width)).floor() as i64;
        let row = i64::from(self.height) - 1 - (v * f64::from(self.height)).floor() as i64;
        self.pixel(column, row)
    }

    fn interpolated(&self, u: f64, v: f64) -> Colour {
        let x = u * f64::from(self.width) - 0.5;
        let y = (1.0 - v) * f64::from(self.height) - 0.5;
        let (column, row) = (x.floor(), y.floor());
        let (fx, fy) = ((x - column) as f32, (y - row) as f32);
        let at = |dx: i64, dy: i64| self.pixel(column as i64 + dx, row as i64 + dy);
        at(0, 0).mixed(at(1, 0), fx).mixed(at(0, 1).mixed(at(1, 1), fx), fy)
    }

    fn pixel(&self, column: i64, row: i64) -> Colour {
        let fold = |i: i64, n: u32| {
            let n = i64::from(n.max(1));
            if self.once { i.clamp(0, n - 1) } else { i.rem_euclid(n) }
        };
        let (column, row) = (fold(column, self.width), fold(row, self.height));
        match &self.source {
            ImageSource::Pixels(pixels) => {
                pixels.get((row * i64::from(self.width) + column) as usize).copied().unwrap_or_default()
            }
            ImageSource::Function(function) => {
                let step = |i: i64, n: u32| i as f64 / f64::from((n.max(2)) - 1);
                let place = [step(column, self.width), step(row, self.height), 0.0];
                let gray = function.call(&place);
                if function.results() == 5 {
                    return Colour::from_array(gray.map(|c| c as f32));
                }
                Colour::opaque(Spectrum::splat(gray[0] as f32))
            }
        }
    }
}
