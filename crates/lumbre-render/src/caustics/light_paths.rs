//! Light paths over mirrors and smooth glass to the first non-specular surfaces.
//!
//! They do not start at lights, because most of a light's emission meets nothing specular. They start on specular
//! objects: lines that are uniform over all lines through a sphere meet the surfaces in it in points that are uniform
//! over their area (M. W. Crofton, "On the Theory of Local Probability", 1868). At each such point a light is sampled,
//! as at any other shaded point, and followed over the specular bounces that start there.

use std::f64::consts::TAU;
use std::ops::{ControlFlow, Range};

use lumbre_geometry::Ray;
use lumbre_kernel::Hit;
use lumbre_math::rounding::offset_point;
use lumbre_math::{DVec3, Vec3, orthonormal_basis, warp64};
use lumbre_scene::light::Sampling;
use lumbre_scene::{BoundingSphere, Footprint, Interaction, LightSample, MediumId, Scene, View};
use lumbre_shading::spectrum::{SpectralLookup, WavelengthDensity, Wavelengths};
use lumbre_shading::{Scatter, ShadingNormals, Spectrum};
use smallvec::SmallVec;

use super::photons::Photon;
use crate::transport::direct::{Bounce, Vertex};
use crate::transport::interior::MediumStack;
use crate::transport::through::hero_alone;
use crate::transport::{SampleNumbers, Sampler};
use crate::wave::paths::{of_column, sides, to_column};

/// Number of random vertices per light path; the first path of a line starts at 0.
const VERTICES_A_PATH: u32 = 1 << 10;
/// Maximum starting points on a line.
const MAX_POINTS: u32 = 64;
/// A ray reaches a point if it comes this near to it, relative to the size of its coordinates and to the length of the
/// ray.
const NEARLY_THERE: f64 = 1e-7;
/// Minimum bounces before Russian roulette.
const ROULETTE_START: u32 = 6;

/// The starting points of light paths: on surfaces in spheres that may overlap.
#[derive(Debug)]
pub(crate) struct ChordSampler<'s> {
    spheres: &'s [BoundingSphere],
    /// 2π times the sum of the squares of all radii: the inverse of the density of a point in one sphere, per line and
    /// area.
    whole: f64,
}

impl<'s> ChordSampler<'s> {
    /// For the specular objects of a scene; `None` without any.
    pub(crate) fn new(scene: &'s Scene) -> Option<Self> {
        Self::within(scene.specular_spheres())
    }

    /// For these spheres; `None` if they have no volume.
    pub(crate) fn within(spheres: &'s [BoundingSphere]) -> Option<Self> {
        let squares: f64 = spheres.iter().map(|sphere| sphere.radius * sphere.radius).sum();
        (squares > 0.0 && squares.is_finite()).then_some(Self { spheres, whole: TAU * squares })
    }

    /// The number of light paths that a line starts per unit of surface area at this point.
    pub(crate) fn density(&self, point: DVec3) -> f64 {
        self.spheres.iter().filter(|sphere| sphere.contains(point)).count() as f64 / self.whole
    }

    /// The line of a sample: the chord of a sphere, chosen by its share of [`ChordSampler::whole`].
    fn line(&self, numbers: &SampleNumbers) -> Ray {
        let mut left = f64::from(numbers.survival(0)) * self.whole / TAU;
        let is_chosen = |sphere: &&BoundingSphere| {
            left -= sphere.radius * sphere.radius;
            left < 0.0
        };
        let sphere = self.spheres.iter().find(is_chosen).unwrap_or(&self.spheres[self.spheres.len() - 1]);
        let direction = warp64::square_to_sphere(numbers.lens());
        let (across, up) = orthonormal_basis(direction);
        let offset = sphere.radius * warp64::square_to_disk(numbers.filter());
        let half = (sphere.radius * sphere.radius - offset.length_squared()).max(0.0).sqrt();
        let middle = sphere.center + offset.x * across + offset.y * up;
        // Clipped to the sphere: points outside would be counted more often than their density.
        Ray::new(middle - half * direction, direction).with_range(0.0, 2.0 * half)
    }
}

/// Follows the light paths of lines.
pub(crate) struct LightTracer<'s> {
    pub(crate) scene: &'s Scene,
    pub(crate) view: &'s View,
    pub(crate) chords: &'s ChordSampler<'s>,
    pub(crate) sampler: Sampler,
    pub(crate) normals: ShadingNormals,
    /// Specular bounces at most.
    pub(crate) max_bounces: u32,
    /// Whether light straight through panes is found by other strategies too: that of point lights and of lights in one
    /// direction.
    pub(crate) goes_straight_on: bool,
    /// How the wavelengths of a pass are chosen, by [`Sampler::shared_wavelengths`]; `None` in RGB.
    pub(crate) density: Option<WavelengthDensity>,
}

/// What the light paths of a line share.
struct Line<'a> {
    numbers: &'a SampleNumbers,
    time: f64,
    /// `None` in RGB.
    wavelengths: Option<Wavelengths>,
}

/// Light that arrives at a surface directly from a lamp.
struct Lit<'s> {
    sample: LightSample,
    /// From the lamp.
    ray: Ray,
    here: Interaction<'s>,
    /// The density with which the lamp was sampled, per unit solid angle; infinite for point lights and lights in one
    /// direction.
    pdf: f64,
    /// The power, per line.
    flux: Spectrum,
}

/// An active light path.
struct LightPath<'s> {
    interiors: MediumStack<'s>,
    medium: Option<MediumId>,
    /// Its power, per line; and its greatest channel at the start.
    flux: Spectrum,
    flux_at_start: f32,
    density: f64,
    /// The solid angle of the lamp at the start of the path; its area across the path, unless it is at infinity; and
    /// the length of the path so far, including the segment from the lamp.
    lamp: f64,
    lamp_area: Option<f64>,
    length: f64,
    bounces: u32,
    /// Whether other strategies can find it so far.
    is_straight: bool,
    /// Whether only the hero wavelength continues.
    is_alone: bool,
}

impl<'s> LightTracer<'s> {
    /// The photons of some lines of a pass.
    pub(crate) fn trace(&self, pass: u32, lines: Range<u32>, photons: &mut Vec<Photon>) {
        for line in lines {
            self.each_point(pass, line, true, |point, line, vertex| self.begin(point, line, vertex, photons));
        }
    }

    /// The power, per line, of light directly from lamps on non-specular surfaces.
    pub(crate) fn direct_power(&self, pass: u32, lines: Range<u32>) -> f64 {
        let count = f64::from(lines.end - lines.start);
        let mut sum = 0.0;
        for line in lines {
            self.each_point(pass, line, false, |point, line, vertex| {
                let lit = self.light(point, line, vertex);
                sum += lit.map_or(0.0, |lit| f64::from(lit.flux.average()));
            });
        }
        sum / count
    }

    /// Visits the points in which a line meets surfaces that may be specular, or those that certainly are not. Each has
    /// the first vertex of its random numbers.
    fn each_point(
        &self,
        pass: u32,
        line: u32,
        are_specular: bool,
        mut visit: impl FnMut(DVec3, &Line<'_>, u32),
    ) {
        // Not a pixel of any picture.
        let numbers = self.sampler.numbers(u32::MAX, pass, line);
        let time = self.view.time(numbers.time());
        let wavelengths = self.density.map(|density| density.sample(self.sampler.shared_wavelengths(pass)));
        let line = Line { numbers: &numbers, time, wavelengths };
        let chord = self.chords.line(&numbers).at_time(time);
        let mut points = 0;
        self.scene.accel().all(&chord, |hit| {
            if self.scene.may_be_specular(hit) == are_specular {
                points += 1;
                visit(chord.at(hit.root.t), &line, points * VERTICES_A_PATH);
            }
            if points < MAX_POINTS { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        });
    }

    /// Follows light that arrives at a point of a surface.
    fn begin(&self, point: DVec3, line: &Line<'_>, vertex: u32, photons: &mut Vec<Photon>) {
        let Some(Lit { sample, ray, here, pdf, flux }) = self.light(point, line, vertex) else { return };
        let length = point.distance(ray.origin);
        let mut path = LightPath {
            interiors: MediumStack::of(line.wavelengths),
            medium: None,
            flux,
            flux_at_start: flux.max_component(),
            density: self.chords.density(point) * pdf,
            lamp: 1.0 / pdf,
            lamp_area: sample.end.map(|_| length * length / pdf),
            length,
            bounces: 0,
            is_straight: pdf == f64::INFINITY && self.goes_straight_on,
            is_alone: false,
        };
        self.arrive(&mut path, &sample, &here, line);
        self.follow(path, ray, here, line, vertex, photons);
    }

    /// The light of one sample that arrives at a point of a surface on a line.
    fn light(&self, point: DVec3, line: &Line<'_>, vertex: u32) -> Option<Lit<'s>> {
        let (choose, u) = (line.numbers.light_choice(vertex), line.numbers.light_point(vertex));
        let (id, mut sample) =
            self.scene.sample_light_for(Sampling::Mis, point, DVec3::ZERO, line.time, choose, u)?;
        if let Some(wavelengths) = &line.wavelengths {
            sample.radiance = self.scene.light_at_wavelengths(id, sample.radiance, wavelengths);
        }
        let ray = self.ray_to(point, &sample).at_time(line.time);
        let hit = self.scene.closest(&ray)?;
        let here = self.interaction(&ray, &hit, line);
        let size = point.abs().max_element() + (point - ray.origin).length();
        if here.surface.point.distance(point) > NEARLY_THERE * size {
            // Occluded.
            return None;
        }
        let (pdf, share) = match sample.scatter {
            Scatter::Density(pdf) => (f64::from(pdf), 1.0 / f64::from(pdf)),
            Scatter::Delta => (f64::INFINITY, 1.0),
        };
        let cosine = here.surface.normal.dot(sample.towards).abs();
        let flux = sample.radiance * (cosine * share / self.chords.density(point)) as f32;
        (!flux.is_black() && flux.is_finite()).then_some(Lit { sample, ray, here, pdf, flux })
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

    /// The transmittance of the light's way to the first surface, and the medium there.
    fn arrive(
        &self,
        path: &mut LightPath<'s>,
        sample: &LightSample,
        here: &Interaction<'s>,
        line: &Line<'_>,
    ) {
        path.interiors.arrive(here, here.resolved());
        // Light from infinity was not inside any solid.
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
            path.flux *= self.scene.transmittance(
                path.medium,
                &back,
                line.numbers.along(&back),
                line.wavelengths.as_ref(),
            );
        }
    }

    /// Follows a light path over its specular bounces.
    fn follow(
        &self,
        mut path: LightPath<'s>,
        mut ray: Ray,
        mut here: Interaction<'s>,
        line: &Line<'_>,
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
            if line.wavelengths.is_some() && vertex.material.disperses() && !path.is_alone {
                // Each wavelength would refract differently.
                path.is_alone = true;
                path.flux = hero_alone(path.flux);
            }
            let number = first + path.bounces;
            let (lobe, survival) = (line.numbers.lobe(number), line.numbers.survival(number));
            let Some(part) = self.bounce(&mut path, &vertex, lobe, survival) else { return };
            if part.crosses {
                match vertex.material.interior_medium(&here.at) {
                    Some(medium) if here.front => path.interiors.enter(vertex.solid(), medium),
                    _ => path.interiors.cross(vertex.solid(), here.front),
                }
            }
            path.medium = of_column(
                sides(here.boundary, here.front, to_column(path.medium))[usize::from(part.crosses)],
            );
            ray = vertex.leave(&part);
            let hit = self.scene.closest(&ray);
            if self.scene.has_media() && !path.is_straight {
                let end = hit.as_ref().map_or(f64::INFINITY, |hit| hit.root.t);
                photons.extend(self.photon_in_medium(&path, &ray.with_range(0.0, end), line, number));
            }
            let Some(hit) = hit else { return };
            let next = self.interaction(&ray, &hit, line);
            path.interiors.arrive(&next, next.resolved());
            let way = next.surface.point.distance(ray.origin);
            path.flux *= path.interiors.transmittance(way);
            path.length += way;
            if self.scene.has_media() {
                self.cross_media(&mut path, &ray.with_range(0.0, way), line);
            }
            if path.flux.is_black() || !path.flux.is_finite() {
                return;
            }
            here = next;
        }
    }

    /// The bounce of a light path at a vertex, chosen by power; `None` if the path ends.
    fn bounce(
        &self,
        path: &mut LightPath<'s>,
        vertex: &Vertex<'_, 's>,
        lobe: f32,
        survival: f32,
    ) -> Option<Bounce> {
        // Weights are those of radiance, which refraction concentrates; power is unchanged.
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

    /// A photon at a random point on a light path's next segment, if that is in a medium. Half of the points are nearer
    /// than the [`typical_way`].
    fn photon_in_medium(
        &self,
        path: &LightPath<'s>,
        segment: &Ray,
        line: &Line<'_>,
        vertex: u32,
    ) -> Option<Photon> {
        if path.interiors.attenuates() {
            return None;
        }
        let typical = typical_way(self.scene);
        let u = f64::from(line.numbers.direction(vertex).x);
        let at = typical * u / (1.0 - u);
        if at >= segment.t_max {
            return None;
        }
        let density = typical / ((typical + at) * (typical + at));
        let before = segment.with_range(0.0, at);
        let mut crossings = Vec::new();
        self.scene.crossings(&before, &mut crossings);
        let medium = crossings.last().map_or(path.medium, |crossing| crossing.beyond)?;
        let transmittance = self.transmittance(path, &before, line);
        let photon = Photon {
            point: segment.at(at),
            towards: -segment.direction.as_vec3(),
            normal: Vec3::ZERO,
            medium: to_column(Some(medium)),
            flux: path.flux * transmittance / density as f32,
            density: path.density as f32,
            lamp: path.lamp_seen(path.length + at),
            bounces: path.bounces,
            is_alone: path.is_alone,
        };
        (!photon.flux.is_black() && photon.flux.is_finite()).then_some(photon)
    }

    /// Traces a light path through media along its next segment.
    fn cross_media(&self, path: &mut LightPath<'s>, segment: &Ray, line: &Line<'_>) {
        path.flux *= self.transmittance(path, segment, line);
        let mut crossings = Vec::new();
        self.scene.crossings(segment, &mut crossings);
        if let Some(last) = crossings.last() {
            path.medium = last.beyond;
        }
    }

    fn transmittance(&self, path: &LightPath<'s>, segment: &Ray, line: &Line<'_>) -> Spectrum {
        let seed = line.numbers.along(segment);
        self.scene.transmittance(path.medium, segment, seed, line.wavelengths.as_ref())
    }

    /// A hit that looks up materials at the wavelengths of the line.
    fn interaction(&self, ray: &Ray, hit: &Hit, line: &Line<'_>) -> Interaction<'s> {
        let mut here = self.scene.interaction(ray, hit, &Footprint::Point);
        here.at.spectral =
            line.wavelengths.map(|wavelengths| SpectralLookup { wavelengths, is_unbounded: false });
        here
    }
}

impl LightPath<'_> {
    /// Approximate solid angle of the lamp, from this distance.
    fn lamp_seen(&self, length: f64) -> f32 {
        self.lamp_area.map_or(self.lamp, |area| area / (length * length)) as f32
    }
}

/// A typical distance between two surfaces of a scene: a quarter of its diagonal.
pub(crate) fn typical_way(scene: &Scene) -> f64 {
    let bounds = scene.bounds();
    if bounds.is_empty() { 1.0 } else { bounds.size().length() / 4.0 }
}

/// The photon of a light path that arrives at a surface.
fn photon(path: &LightPath<'_>, ray: &Ray, here: &Interaction<'_>) -> Photon {
    let normal = here.surface.normal;
    let facing = if normal.dot(ray.direction) > 0.0 { -normal } else { normal };
    Photon {
        point: here.surface.point,
        towards: -ray.direction.as_vec3(),
        normal: facing.as_vec3(),
        medium: to_column(path.medium),
        flux: path.flux,
        density: path.density as f32,
        lamp: path.lamp_seen(path.length),
        bounces: path.bounces,
        is_alone: path.is_alone,
    }
}
