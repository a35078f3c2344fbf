//! Lenses of several spherical surfaces, traced ray by ray from the film to the scene.
//!
//! Kolb, Mitchell, Hanrahan, "A Realistic Camera Model for Computer Graphics", SIGGRAPH 1995. Without dispersion and
//! without reflections at the surfaces.

use std::f64::consts::FRAC_PI_4;

use lumbre_math::{DVec2, DVec3, Elementary};
use thiserror::Error;

/// A surface of a lens. Lengths are in metres, which are the units of the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LensSurface {
    /// The radius of curvature, positive if its centre is on the side of the film; 0 is the plane of the stop.
    pub curvature: f64,
    /// The distance along the axis to the next surface towards the film, and from the last one to the film.
    pub thickness: f64,
    /// The index of refraction behind it, on the side of the film; 0 counts as 1.
    pub eta: f64,
    /// The radius of the transparent part.
    pub aperture: f64,
}

/// The transmittance at each point of the square around the stop; nothing passes outside.
#[derive(Clone, Debug, PartialEq)]
pub struct ApertureImage {
    width: usize,
    height: usize,
    /// Rows from bottom to top.
    values: Vec<f32>,
}

impl ApertureImage {
    /// From rows from bottom to top, scaled to transmit as much light as a round stop. `None` if there are fewer or
    /// more numbers as pixels, some are negative or not finite, or all are 0.
    pub fn new(width: usize, height: usize, mut values: Vec<f32>) -> Option<Self> {
        let mean = values.iter().map(|&v| f64::from(v)).sum::<f64>() / values.len() as f64;
        let fits = width > 0 && height > 0 && width.checked_mul(height) == Some(values.len());
        let is_transmissive = mean > 0.0 && mean.is_finite() && values.iter().all(|&v| v >= 0.0);
        if !fits || !is_transmissive {
            return None;
        }
        let scale = (FRAC_PI_4 / mean) as f32;
        values.iter_mut().for_each(|v| *v *= scale);
        Some(Self { width, height, values })
    }

    /// pbrt's named stops: "gaussian", "square", "pentagon" and "star".
    pub fn named(name: &str) -> Option<Self> {
        const SIDE: usize = 256;
        let turn = std::f64::consts::TAU / 5.0;
        // The corners of a regular pentagon, and of a star whose inner corners are where its edges cross.
        let at = |radius: f64, angle: f64| DVec2::new(radius * angle.sine(), radius * angle.cosine());
        let pentagon: Vec<DVec2> = (0..5).map(|i| at(0.8, turn * f64::from(i))).collect();
        let inner = turn.cosine() / (0.5 * turn).cosine();
        let star: Vec<DVec2> = (0..10)
            .map(|i| {
                let angle = 0.5 * turn * f64::from(i);
                let radius = if i % 2 == 1 { 1.0 } else { inner };
                DVec2::new(radius * angle.cosine(), radius * angle.sine())
            })
            .collect();
        let value = |p: DVec2| match name {
            "gaussian" => ((-p.length_squared()).exponential() - (-1_f64).exponential()).max(0.0),
            "square" => f64::from(u8::from(p.abs().max_element() < 0.5)),
            "pentagon" => f64::from(u8::from(is_inside(&pentagon, p))),
            _ => f64::from(u8::from(is_inside(&star, p))),
        };
        let place = |i: usize| -1.0 + 2.0 * (i as f64 + 0.5) / SIDE as f64;
        let pixel = |i: usize| value(DVec2::new(place(i % SIDE), place(i / SIDE))) as f32;
        Self::NAMES
            .contains(&name)
            .then(|| Self::new(SIDE, SIDE, (0..SIDE * SIDE).map(pixel).collect()))
            .flatten()
    }

    /// The names that [`ApertureImage::named`] knows.
    pub const NAMES: [&str; 4] = ["gaussian", "square", "pentagon", "star"];

    /// The transmittance at a point of the stop, whose square is [-1, 1]²: linear between the middles of pixels.
    fn at(&self, point: DVec2) -> f64 {
        let is_inside = point.abs().max_element() <= 1.0;
        if !is_inside {
            return 0.0;
        }
        let place = |v: f64, count: usize| {
            let place = (0.5 * (v + 1.0) * count as f64 - 0.5).clamp(0.0, (count - 1) as f64);
            let low = (place as usize).min(count.saturating_sub(2));
            (low, (low + 1).min(count - 1), place - low as f64)
        };
        let ((x0, x1, x), (y0, y1, y)) = (place(point.x, self.width), place(point.y, self.height));
        let value = |x: usize, y: usize| f64::from(self.values[y * self.width + x]);
        let row = |y: usize| value(x0, y) + (value(x1, y) - value(x0, y)) * x;
        row(y0) + (row(y1) - row(y0)) * y
    }
}

/// Whether a polygon, whose edges may cross, winds about a point.
fn is_inside(corners: &[DVec2], p: DVec2) -> bool {
    let mut turns = 0;
    for (i, &a) in corners.iter().enumerate() {
        let b = corners[(i + 1) % corners.len()];
        let side = (b - a).perp_dot(p - a);
        if a.y <= p.y && p.y < b.y && side > 0.0 {
            turns += 1;
        } else if b.y <= p.y && p.y < a.y && side < 0.0 {
            turns -= 1;
        }
    }
    turns != 0
}

/// Why surfaces make no lens.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum LensError {
    /// There are none, or a number is not finite, a thickness or an index negative, or an aperture not positive.
    #[error("a surface of the lens is not one")]
    Surface,
    /// Rays near the axis are blocked, or stay parallel.
    #[error("the lens makes no picture: rays along its axis do not meet behind it")]
    NoFocus,
    /// No film position focuses at this distance.
    #[error("the lens cannot be focused at this distance")]
    TooNear,
}

/// Intervals of the distance from the middle of the film, each with its own bounds of the exit pupil.
const PUPILS: usize = 64;
/// Points of the rear surface along each axis that are tried to find the exit pupil; the second number applies if the
/// first finds no light.
const PUPIL_STEPS: [usize; 2] = [256, 1024];
/// The searched part of the plane of the rear surface, larger than light can pass through, as a multiple of its radius.
const PUPIL_REACH: f64 = 1.5;

/// A lens in focus, and the film behind it. The axis is z, from the film at 0 to the scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Lens {
    /// From the scene to the film.
    surfaces: Vec<LensSurface>,
    stop: Option<ApertureImage>,
    diagonal: f64,
    focal_length: f64,
    /// The exit pupil as seen from the film at growing distances along x: its least and greatest x and y on the plane
    /// of the rear surface; `None` if no light arrives.
    pupils: Vec<Option<[DVec2; 2]>>,
}

/// A ray inside or outside a lens.
#[derive(Clone, Copy)]
struct Line {
    origin: DVec3,
    direction: DVec3,
}

impl Line {
    fn at(&self, t: f64) -> DVec3 {
        self.origin + t * self.direction
    }
}

impl Lens {
    /// A lens of surfaces from the scene to the film, moved to focus at `focus_distance` from the film, for a film of
    /// this diagonal; all in metres. `stop` replaces a round stop.
    ///
    /// # Errors
    /// [`LensError`].
    pub fn new(
        surfaces: Vec<LensSurface>,
        stop: Option<ApertureImage>,
        focus_distance: f64,
        diagonal: f64,
    ) -> Result<Self, LensError> {
        let is_surface = |s: &LensSurface| {
            let numbers = [s.curvature, s.thickness, s.eta, s.aperture];
            numbers.iter().all(|v| v.is_finite()) && s.thickness >= 0.0 && s.eta >= 0.0 && s.aperture > 0.0
        };
        let has_film = diagonal > 0.0;
        if surfaces.is_empty() || !surfaces.iter().all(is_surface) || !has_film {
            return Err(LensError::Surface);
        }
        let mut lens = Self { surfaces, stop, diagonal, focal_length: 0.0, pupils: vec![] };
        lens.focus(focus_distance)?;
        let pupil = |i| PUPIL_STEPS.iter().find_map(|&steps| lens.pupil(i, steps));
        lens.pupils = (0..PUPILS).map(pupil).collect();
        Ok(lens)
    }

    /// The diagonal of the film, in metres.
    pub fn diagonal(&self) -> f64 {
        self.diagonal
    }

    /// The focal length, in metres.
    pub fn focal_length(&self) -> f64 {
        self.focal_length
    }

    /// The distance from the rear surface to the film, in metres.
    pub fn film_distance(&self) -> f64 {
        self.surfaces[self.surfaces.len() - 1].thickness
    }

    /// The half width and height of the film for a picture of this aspect ratio, width over height.
    pub(crate) fn half_film(&self, aspect: f64) -> DVec2 {
        let height = self.diagonal / (1.0 + aspect * aspect).sqrt();
        0.5 * DVec2::new(aspect * height, height)
    }

    /// The ray that leaves the lens from a film point through a point of the exit pupil (two uniform numbers): its
    /// origin, its direction, and the factor from radiance to the film's irradiance. `None` if no light arrives.
    pub(crate) fn ray(&self, film: DVec2, u: DVec2) -> Option<(DVec3, DVec3, f64)> {
        let r = film.length();
        let place = (r / (0.5 * self.diagonal) * PUPILS as f64) as usize;
        let [low, high] = self.pupils[place.min(PUPILS - 1)]?;
        let point = low + u * (high - low);
        let along = if r > 0.0 { film / r } else { DVec2::X };
        let rear = self.film_distance();
        let target = along.rotate(point).extend(rear);
        let direction = (target - film.extend(0.0)).normalize();
        let (line, share) = self.to_scene(Line { origin: film.extend(0.0), direction })?;
        let area = (high - low).element_product();
        let weight = direction.z.powi(4) * area / (rear * rear) * share;
        (weight > 0.0).then(|| (line.origin, line.direction.normalize(), weight))
    }

    /// Traces a ray from the film, with the transmittance of the stop; `None` if it is blocked.
    fn to_scene(&self, mut line: Line) -> Option<(Line, f64)> {
        let (mut z, mut share) = (0.0, 1.0);
        for (i, surface) in self.surfaces.iter().enumerate().rev() {
            z += surface.thickness;
            let before = i.checked_sub(1).map_or(1.0, |before| index(self.surfaces[before].eta));
            share *= self.cross(&mut line, surface, z, index(surface.eta), before)?;
        }
        Some((line, share))
    }

    /// Traces a ray from the scene; `None` if it is blocked.
    fn to_film(&self, mut line: Line) -> Option<Line> {
        let mut z: f64 = self.surfaces.iter().map(|surface| surface.thickness).sum();
        let mut before = 1.0;
        for surface in &self.surfaces {
            let behind = index(surface.eta);
            self.cross(&mut line, surface, z, before, behind)?;
            z -= surface.thickness;
            before = behind;
        }
        Some(line)
    }

    /// Traces a ray through the surface whose vertex is at z, from one index of refraction to the other, and returns
    /// the transmittance. `None` if the ray misses the surface, is blocked or totally reflected.
    fn cross(&self, line: &mut Line, surface: &LensSurface, z: f64, from: f64, to: f64) -> Option<f64> {
        let forward = line.direction.z > 0.0;
        let is_stop = surface.curvature == 0.0;
        let t = if is_stop {
            (z - line.origin.z) / line.direction.z
        } else {
            let center = DVec3::new(0.0, 0.0, z - surface.curvature);
            let offset = line.origin - center;
            let a = line.direction.length_squared();
            let half = offset.dot(line.direction);
            let c = offset.length_squared() - surface.curvature * surface.curvature;
            let root = half * half - a * c;
            let meets = root >= 0.0;
            if !meets {
                return None;
            }
            // The hemisphere that contains the vertex.
            let is_nearer = forward == (surface.curvature < 0.0);
            let root = root.sqrt();
            (-half + if is_nearer { -root } else { root }) / a
        };
        let point = line.at(t);
        let goes_on = t >= 0.0 && point.is_finite();
        if !goes_on {
            return None;
        }
        let off_axis = point.truncate();
        let share = match &self.stop {
            Some(stop) if is_stop => stop.at(off_axis / surface.aperture),
            _ if off_axis.length_squared() > surface.aperture * surface.aperture => return None,
            _ => 1.0,
        };
        let passes = share > 0.0;
        if !passes {
            return None;
        }
        line.origin = point;
        if !is_stop && from != to {
            let normal = (point - DVec3::new(0.0, 0.0, z - surface.curvature)).normalize();
            line.direction = refracted(line.direction.normalize(), normal, from / to)?;
        }
        Some(share)
    }

    /// Moves the lens so that the distance is in focus, by the equation of a thick lens.
    fn focus(&mut self, distance: f64) -> Result<(), LensError> {
        const FAR: f64 = 1.0;
        let height = 0.001 * self.diagonal;
        let front: f64 = self.surfaces.iter().map(|surface| surface.thickness).sum();
        let from_scene =
            Line { origin: DVec3::new(height, 0.0, front + FAR), direction: DVec3::new(0.0, 0.0, -1.0) };
        let from_film =
            Line { origin: DVec3::new(height, 0.0, self.film_distance() - FAR), direction: DVec3::Z };
        // Where a ray that arrives parallel to the axis crosses it, and where the ray that leaves is as far from it as
        // the one that arrived.
        let cardinal = |line: Line| {
            let focus = line.at(-line.origin.x / line.direction.x).z;
            let principal = line.at((height - line.origin.x) / line.direction.x).z;
            (focus, principal)
        };
        let (focus, film_side) = cardinal(self.to_film(from_scene).ok_or(LensError::NoFocus)?);
        let (_, scene_side) = cardinal(self.to_scene(from_film).ok_or(LensError::NoFocus)?.0);
        let focal_length = film_side - focus;
        if !(focal_length.is_finite() && film_side.is_finite() && scene_side.is_finite()) {
            return Err(LensError::NoFocus);
        }
        // The distance from the object to the film, without the part between the principal planes: object and image
        // distance together.
        let between = distance - scene_side + film_side;
        let under = between * (between - 4.0 * focal_length);
        let can = under > 0.0 && between > 0.0;
        if !can {
            return Err(LensError::TooNear);
        }
        let image = 0.5 * (between - under.sqrt());
        let last = self.surfaces.len() - 1;
        let thickness = self.surfaces[last].thickness + image - film_side;
        let is_before = thickness > 0.0;
        if !is_before {
            return Err(LensError::TooNear);
        }
        self.surfaces[last].thickness = thickness;
        self.focal_length = focal_length;
        Ok(())
    }

    /// Bounds of the exit pupil, from the points of an interval along x.
    fn pupil(&self, interval: usize, steps: usize) -> Option<[DVec2; 2]> {
        let at = |t: f64| 0.5 * self.diagonal * (interval as f64 + t) / PUPILS as f64;
        let rear = self.film_distance();
        let reach = PUPIL_REACH * self.surfaces[self.surfaces.len() - 1].aperture;
        let step = 2.0 * reach / steps as f64;
        let place = |i: usize| -reach + step * (i as f64 + 0.5);
        let passes = |x: f64, point: DVec2| {
            let origin = DVec3::new(x, 0.0, 0.0);
            self.to_scene(Line { origin, direction: point.extend(rear) - origin }).is_some()
        };
        let mut bounds: Option<[DVec2; 2]> = None;
        // The lens is symmetric about the axis, except for the stop.
        let first = if self.stop.is_some() { 0 } else { steps / 2 };
        for y in first..steps {
            for x in 0..steps {
                let point = DVec2::new(place(x), place(y));
                let [low, high] = bounds.unwrap_or([DVec2::INFINITY, DVec2::NEG_INFINITY]);
                let is_known = point.cmpge(low).all() && point.cmple(high).all();
                if !is_known && [0.0, 0.5, 1.0].iter().any(|&t| passes(at(t), point)) {
                    bounds = Some([low.min(point), high.max(point)]);
                }
            }
        }
        let [mut low, mut high] = bounds?;
        if self.stop.is_none() {
            low.y = low.y.min(-high.y);
        }
        low -= 2.0 * step;
        high += 2.0 * step;
        Some([low, high])
    }
}

/// An index of refraction as given in files.
fn index(eta: f64) -> f64 {
    if eta == 0.0 { 1.0 } else { eta }
}

/// A unit direction behind a surface, where `eta` is the index before it over that behind; `None` for total reflection.
fn refracted(direction: DVec3, normal: DVec3, eta: f64) -> Option<DVec3> {
    let normal = if direction.dot(normal) > 0.0 { -normal } else { normal };
    let cos = -direction.dot(normal);
    let sin2 = eta * eta * (1.0 - cos * cos).max(0.0);
    (sin2 < 1.0).then(|| eta * direction + (eta * cos - (1.0 - sin2).sqrt()) * normal)
}

#[cfg(test)]
#[path = "lens/tests.rs"]
mod tests;
