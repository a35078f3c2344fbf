//! Normals: how the normal of a surface is tilted.

use std::sync::Arc;

use lumbre_math::DVec3;

use super::Eye;
use super::noise::{noise, vector_noise, wave_sources};
use super::pattern::{Pattern, PatternKind, quilt_slope};
use super::pigment::between;
use super::warp::Warps;

/// A way to tilt normals.
#[derive(Clone, Debug)]
pub struct Normal {
    /// What it is.
    pub kind: NormalKind,
    /// How points come to it, after those of its pattern.
    pub warps: Warps,
    /// By how much.
    pub amount: f64,
    /// The distance of the points that slopes are taken from.
    pub accuracy: f64,
    /// Whether normals are not scaled with the pattern.
    pub no_bump_scale: bool,
    /// Whether it lies in the coordinates of the surface.
    pub uv: bool,
}

/// A value of a pattern, with the height and the slope there.
pub(super) type HeightAt = (f64, [f64; 2]);

/// The kinds of normal.
#[derive(Clone, Debug)]
pub enum NormalKind {
    /// The slope of a pattern.
    Slope {
        /// The pattern.
        pattern: Box<Pattern>,
        /// Heights and slopes by its values.
        map: Option<Arc<[HeightAt]>>,
    },
    /// Noise: `bumps`.
    Bumps(Box<Pattern>),
    /// Noise by its third power: `dents`.
    Dents(Box<Pattern>),
    /// Noise of ten octaves: `wrinkles`.
    Wrinkles(Box<Pattern>),
    /// The tilt of `ripples` or `waves`, which have the pattern.
    Waves(Box<Pattern>),
    /// The tilt of `quilted`.
    Quilted(Box<Pattern>),
    /// A pattern by a map of normals.
    Normals(Box<Pattern>, Arc<[(f64, Arc<Normal>)]>),
    /// The slope of an image whose grey is a height.
    BumpMap(Box<super::ImageMap>),
    /// A weighted mean.
    Average(Arc<[(f64, Arc<Normal>)]>),
}

impl Normal {
    /// The unit normal at a point of the surface, of a unit normal there.
    pub fn tilted(&self, p: DVec3, normal: DVec3, eye: &Eye) -> DVec3 {
        let p = if self.uv { eye.uv.extend(0.0) } else { p };
        let inner = self.pattern().map(|pattern| &pattern.warps);
        let mut n = self.warps.normal_to_pattern(normal);
        if let Some(inner) = inner {
            n = inner.normal_to_pattern(n);
        }
        if !self.no_bump_scale {
            n = n.normalize_or(normal);
        }
        let p = self.warps.apply(p);
        let p = self.pattern().map_or(p, |pattern| pattern.point(p));
        let mut n = self.in_pattern(p, n, eye);
        if let Some(inner) = inner {
            n = inner.normal_from_pattern(n);
        }
        self.warps.normal_from_pattern(n).try_normalize().unwrap_or(normal)
    }

    fn pattern(&self) -> Option<&Pattern> {
        match &self.kind {
            NormalKind::Slope { pattern, .. }
            | NormalKind::Bumps(pattern)
            | NormalKind::Dents(pattern)
            | NormalKind::Wrinkles(pattern)
            | NormalKind::Waves(pattern)
            | NormalKind::Quilted(pattern)
            | NormalKind::Normals(pattern, _) => Some(pattern),
            NormalKind::BumpMap(_) | NormalKind::Average(_) => None,
        }
    }

    fn in_pattern(&self, p: DVec3, n: DVec3, eye: &Eye) -> DVec3 {
        match &self.kind {
            NormalKind::Bumps(_) => n + self.amount * vector_noise(p),
            NormalKind::Dents(pattern) => {
                n + self.amount * noise(p, pattern.generator).powi(3) * vector_noise(p)
            }
            NormalKind::Wrinkles(_) => {
                let octave = |i: i32| vector_noise(p * f64::from(1 << i)).abs() / f64::from(1 << i);
                n + self.amount * (0..10).map(octave).sum::<DVec3>()
            }
            NormalKind::Waves(pattern) => n + self.amount * rings(pattern, p),
            NormalKind::Quilted(pattern) => {
                let PatternKind::Quilted { control0, control1 } = pattern.kind else { return n };
                let q = p - p.floor() - DVec3::splat(0.5);
                n + self.amount * quilt_slope(q.length(), control0, control1) * q
            }
            NormalKind::BumpMap(image) => n + self.amount * image.tilt(p, n),
            NormalKind::Slope { pattern, map } => n + self.slope(pattern, map.as_deref(), p, eye),
            NormalKind::Normals(pattern, map) => {
                let ([(_, first), (_, second)], share) = between(map, pattern.value(p, eye));
                let first = first.tilted(p, n, eye);
                if share <= 0.0 {
                    return first;
                }
                first * (1.0 - share) + second.tilted(p, n, eye) * share
            }
            NormalKind::Average(normals) => {
                let (mut sum, mut total) = (DVec3::ZERO, 0.0);
                for (weight, normal) in normals.iter() {
                    sum += *weight * normal.tilted(p, n, eye);
                    total += weight;
                }
                if total == 0.0 { n } else { sum / total }
            }
        }
    }

    /// The slope of a pattern, from four points around one.
    fn slope(&self, pattern: &Pattern, map: Option<&[(f64, [f64; 2])]>, p: DVec3, eye: &Eye) -> DVec3 {
        const CORNERS: [DVec3; 4] = [
            DVec3::new(0.942_809, -1.0 / 3.0, 0.0),
            DVec3::new(-0.471_404, -1.0 / 3.0, 0.816_497),
            DVec3::new(-0.471_404, -1.0 / 3.0, -0.816_497),
            DVec3::Y,
        ];
        let scale = -5.0 * self.amount * (0.02 / self.accuracy);
        let height = |p: DVec3| {
            let v = pattern.value(p, eye);
            map.map_or(v, |map| hermite(map, v))
        };
        CORNERS.into_iter().map(|corner| scale * height(p + self.accuracy * corner) * corner).sum()
    }
}

/// Heights between entries of height and slope: cubics.
fn hermite(map: &[(f64, [f64; 2])], v: f64) -> f64 {
    let ([(_, [from, leaving]), (_, [to, arriving])], x) = between(map, v);
    let (x2, x3) = (x * x, x * x * x);
    (2.0 * x3 - 3.0 * x2 + 1.0) * from
        + (3.0 * x2 - 2.0 * x3) * to
        + (x3 - 2.0 * x2 + x) * leaving
        + (x3 - x2) * arriving
}

/// The tilt of rings from random sources.
fn rings(pattern: &Pattern, p: DVec3) -> DVec3 {
    use lumbre_math::Elementary;
    let (PatternKind::Ripples(count) | PatternKind::Waves(count)) = pattern.kind else { return DVec3::ZERO };
    let has_lengths = matches!(pattern.kind, PatternKind::Waves(_));
    let ring = |(source, f): (DVec3, f64)| {
        let away = p - source;
        let length = if away == DVec3::ZERO { 1.0 } else { away.length() };
        let f = if has_lengths { f } else { 1.0 };
        let wave = (std::f64::consts::TAU * (pattern.frequency * f * length + pattern.phase)).sine();
        away * (wave / (f * length * f64::from(count)))
    };
    wave_sources(count).map(ring).sum()
}
