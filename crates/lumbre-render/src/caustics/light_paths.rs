//! Paths of light over mirrors and smooth glass, to the first surfaces that scatter it otherwise.
//!
//! They do not begin at lights, for most of what lights send out meets nothing specular. They begin on what is specular: lines that are
//! even over all lines through a sphere around it meet its surfaces in points that are even over their area (M. W. Crofton, "On the Theory
//! of Local Probability", 1868). From each such point a light is sampled, as from any other point that is shaded, and followed over the
//! specular bounces that begin there.

use std::f64::consts::TAU;
use std::ops::{ControlFlow, Range};

use lumbre_geometry::Ray;
use lumbre_math::rounding::offset_point;
use lumbre_math::{DVec3, orthonormal_basis, warp64};
use lumbre_scene::{BoundingSphere, Footprint, Interaction, LightSample, MediumId, Scene, View};
use lumbre_shading::{Scatter, ShadingNormals, Spectrum};
use smallvec::SmallVec;

use super::photons::Photon;
use crate::transport::direct::{Bounce, Vertex};
use crate::transport::interior::Interiors;
use crate::transport::{Draw, Sampler};
use crate::wave::paths::{of_column, sides, to_column};

/// Random numbers of a vertex of the first light path of a line; those of each further one follow after so many vertices.
const VERTICES_A_PATH: u32 = 1 << 10;
/// Points on a line that light paths begin in, at most.
const MAX_POINTS: u32 = 64;
/// Bounces that every light path may take before Russian roulette.
const ROULETTE_START: u32 = 6;

/// Where light paths begin: on surfaces in spheres that may overlap.
#[derive(Debug)]
pub(crate) struct Beginnings<'s> {
    spheres: &'s [BoundingSphere],
    /// 2π times the sum of the squares of all radii: the inverse of the density of a point in one sphere, per line and area.
    whole: f64,
}

impl<'s> Beginnings<'s> {
    /// `None` where nothing is specular.
    pub(crate) fn new(scene: &'s Scene) -> Option<Self> {
        let spheres = scene.specular_spheres();
        let squares: f64 = spheres.iter().map(|sphere| sphere.radius * sphere.radius).sum();
        (squares > 0.0 && squares.is_finite()).then_some(Self { spheres, whole: TAU * squares })
    }

    /// The number of points that a line begins light paths in, per unit of area of a surface there.
    pub(crate) fn density(&self, point: DVec3) -> f64 {
        self.spheres.iter().filter(|sphere| sphere.contains(point)).count() as f64 / self.whole
    }

    /// The line of a draw: the chord of a sphere. The probability of a sphere is that of its share of [`Beginnings::whole`].
    fn line(&self, draw: &Draw) -> Ray {
        let mut left = f64::from(draw.survival(0)) * self.whole / TAU;
        let is_chosen = |sphere: &&BoundingSphere| {
            left -= sphere.radius * sphere.radius;
            left < 0.0
        };
        let sphere = self.spheres.iter().find(is_chosen).unwrap_or(&self.spheres[self.spheres.len() - 1]);
        let direction = warp64::square_to_sphere(draw.lens());
        let (across, up) = orthonormal_basis(direction);
        let offset = sphere.radius * warp64::square_to_disk(draw.filter());
        let start = sphere.center + offset.x * across + offset.y * up - sphere.radius * direction;
        Ray::new(start, direction).with_range(0.0, 2.0 * sphere.radius)
    }
}

/// Follows the light paths of lines.
pub(crate) struct Tracer<'s> {
    pub(crate) scene: &'s Scene,
    pub(crate) view: &'s View,
    pub(crate) beginnings: &'s Beginnings<'s>,
    pub(crate) sampler: Sampler,
    pub(crate) normals: ShadingNormals,
    /// Specular bounces at most.
    pub(crate) max_bounces: u32,
    /// Whether light that goes straight on through panes is found by other means, too: that of points and in one direction.
    pub(crate) goes_straight_on: bool,
}

/// A light path on its way.
struct LightPath<'s> {
    interiors: Interiors<'s>,
    medium: Option<MediumId>,
    /// The power that it carries, of one line; and the greatest of its channels where it began.
    flux: Spectrum,
    flux_at_start: f32,
    density: f64,
    bounces: u32,
    /// Whether it can be found by other means so far.
    is_straight: bool,
}

impl<'s> Tracer<'s> {
    /// The photons of some lines of a pass.
    pub(crate) fn trace(&self, pass: u32, lines: Range<u32>, photons: &mut Vec<Photon>) {
        for line in lines {
            // No pixel is there.
            let draw = self.sampler.draw(u32::MAX, pass, line);
            let time = self.view.time(draw.time());
            let chord = self.beginnings.line(&draw).at_time(time);
            let mut points = 0;
            self.scene.accel().all(&chord, |hit| {
                if self.scene.may_be_specular(hit) {
                    points += 1;
                    self.begin(chord.at(hit.root.t), time, &draw, points * VERTICES_A_PATH, photons);
                }
                if points < MAX_POINTS { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
            });
        }
    }

    /// Follows light that arrives at a point of a surface.
    fn begin(&self, point: DVec3, time: f64, draw: &Draw, vertex: u32, photons: &mut Vec<Photon>) {
        let (choose, u) = (draw.light_choice(vertex), draw.light_point(vertex));
        let Some(sample) = self.scene.sample_light(point, DVec3::ZERO, time, choose, u) else { return };
        let ray = self.ray_to(point, &sample).at_time(time);
        let Some(hit) = self.scene.closest(&ray) else { return };
        let here = self.scene.interaction(&ray, &hit, &Footprint::Point);
        let size = point.abs().max_element() + (point - ray.origin).length();
        if here.surface.point.distance(point) > 1e-7 * size {
            // Something is in the way.
            return;
        }
        let pdf = match sample.scatter {
            Scatter::Density(pdf) => f64::from(pdf),
            Scatter::Delta => f64::INFINITY,
        };
        let density = self.beginnings.density(point);
        let cosine = here.surface.normal.dot(sample.towards).abs();
        let share = if pdf == f64::INFINITY { 1.0 } else { 1.0 / pdf };
        let flux = sample.radiance * (cosine * share / density) as f32;
        if flux.is_black() || !flux.is_finite() {
            return;
        }
        let mut path = LightPath {
            interiors: Interiors::default(),
            medium: None,
            flux,
            flux_at_start: flux.max_component(),
            density: density * pdf,
            bounces: 0,
            is_straight: pdf == f64::INFINITY && self.goes_straight_on,
        };
        self.arrive(&mut path, &sample, &here, draw);
        self.follow(path, ray, here, draw, vertex, photons);
    }

    /// The ray from a light to a point.
    fn ray_to(&self, point: DVec3, sample: &LightSample) -> Ray {
        let origin = match sample.end {
            Some(end) => offset_point(end.point, end.error, end.normal, point - end.point),
            None => {
                let bounds = self.scene.bounds();
                let reach = if bounds.is_empty() {
                    1.0
                } else {
                    bounds.size().length() + point.distance(bounds.center())
                };
                point + 2.0 * reach * sample.towards
            }
        };
        Ray::new(origin, (point - origin).normalize_or_zero())
    }

    /// What is left of the light on its way to the first surface, and the medium there.
    fn arrive(&self, path: &mut LightPath<'s>, sample: &LightSample, here: &Interaction<'s>, draw: &Draw) {
        path.interiors.arrive(here, here.resolved());
        // Light from infinitely far away was not inside anything.
        if let Some(end) = sample.end {
            path.flux *= path.interiors.transmittance(end.point.distance(here.surface.point));
        }
        if self.scene.has_media() {
            let around = to_column(self.view.medium());
            path.medium = of_column(sides(here.boundary, here.front, around)[0]);
            let start = here.start(sample.towards);
            let back = match sample.end {
                Some(end) => Ray::new(start, end.point - start).with_range(0.0, 1.0),
                None => Ray::new(start, sample.towards),
            };
            path.flux *= self.scene.transmittance(path.medium, &back, draw.along(&back));
        }
    }

    /// Follows a light path over its specular bounces.
    fn follow(
        &self,
        mut path: LightPath<'s>,
        mut ray: Ray,
        mut here: Interaction<'s>,
        draw: &Draw,
        first: u32,
        photons: &mut Vec<Photon>,
    ) {
        loop {
            let Some(vertex) = Vertex::new(self.scene, &here, &path.interiors, self.normals) else { return };
            if path.bounces > 0 && !path.is_straight && !vertex.bsdf.is_delta() {
                photons.push(photon(&path, &ray, &here));
            }
            if path.bounces == self.max_bounces {
                return;
            }
            let number = first + path.bounces;
            let Some(part) = self.bounce(&mut path, &vertex, draw.lobe(number), draw.survival(number)) else {
                return;
            };
            if part.crosses {
                path.interiors.cross(vertex.material, here.front);
            }
            path.medium = of_column(
                sides(here.boundary, here.front, to_column(path.medium))[usize::from(part.crosses)],
            );
            ray = vertex.leave(&part);
            let Some(hit) = self.scene.closest(&ray) else { return };
            let next = self.scene.interaction(&ray, &hit, &Footprint::Point);
            path.interiors.arrive(&next, next.resolved());
            let way = next.surface.point.distance(ray.origin);
            path.flux *= path.interiors.transmittance(way);
            if self.scene.has_media() {
                self.cross_media(&mut path, &ray.with_range(0.0, way), draw);
            }
            if path.flux.is_black() || !path.flux.is_finite() {
                return;
            }
            here = next;
        }
    }

    /// The bounce that a light path takes at a vertex, chosen by the power of each; `None` where it ends.
    fn bounce(
        &self,
        path: &mut LightPath<'s>,
        vertex: &Vertex<'_, 's>,
        lobe: f32,
        survival: f32,
    ) -> Option<Bounce> {
        // Weights are those of radiance, which refraction squeezes; power it does not.
        let power = |part: &Bounce| part.weight * if part.transmitted { part.eta * part.eta } else { 1.0 };
        let parts: SmallVec<[Bounce; 3]> = vertex.specular().collect();
        let sum: f32 = parts.iter().map(|part| power(part).max_component()).sum();
        let mut left = lobe * sum;
        let is_chosen = |part: &Bounce| {
            left -= power(part).max_component();
            left < 0.0
        };
        let part = parts.into_iter().find(is_chosen)?;
        let chosen = power(&part);
        path.flux *= chosen * (sum / chosen.max_component() * vertex.concentration(part.direction));
        path.bounces += 1;
        path.is_straight &= part.transmitted && part.eta == 1.0;
        if path.bounces > ROULETTE_START {
            let likely = path.flux.max_component() / path.flux_at_start;
            if survival >= likely {
                return None;
            }
            path.flux = path.flux / likely.min(1.0);
        }
        Some(part)
    }

    /// Takes a light path through media along its next segment.
    fn cross_media(&self, path: &mut LightPath<'s>, segment: &Ray, draw: &Draw) {
        path.flux *= self.scene.transmittance(path.medium, segment, draw.along(segment));
        let mut crossings = Vec::new();
        self.scene.crossings(segment, &mut crossings);
        if let Some(last) = crossings.last() {
            path.medium = last.beyond;
        }
    }
}

/// The photon of a light path that arrives at a surface.
fn photon(path: &LightPath<'_>, ray: &Ray, here: &Interaction<'_>) -> Photon {
    let normal = here.surface.normal;
    let facing = if normal.dot(ray.direction) > 0.0 { -normal } else { normal };
    Photon {
        point: here.surface.point,
        towards: -ray.direction.as_vec3(),
        normal: facing.as_vec3(),
        flux: path.flux,
        density: path.density as f32,
        bounces: path.bounces,
    }
}
