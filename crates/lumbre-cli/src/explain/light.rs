//! The light along a ray: the events of its path, and the contribution of each light.

use lumbre::description::{Footprint, IntegratorKind, Interaction, LightId};
use lumbre::journal::{End, Event, MergedPhoton, Met, SampledLight, Scattered, Source};
use lumbre::math::optics::{facing, reflect, refract};
use lumbre::shading::{Material, MaterialKind, Scatter, Spectrum};
use lumbre::{DVec2, DVec3, Exposure, Ray, Scene};

use super::document::{Column, Item, Section, Value};
use super::formula::Scope;
use super::surfaces::{Wanted, material_of, surfaces};
use super::texts::Texts;
use super::things::SceneNames;
use crate::language::filled;

/// Maximum lights that are listed one by one.
const MAX_LIGHTS: usize = 16;

/// Writes the section on the light of one path.
pub(super) struct Path<'a> {
    pub(super) scene: &'a Scene,
    pub(super) things: &'a SceneNames,
    pub(super) texts: &'static Texts,
    /// Number of rays after the first whose crossings are shown too.
    pub(super) depth: u32,
    /// The integrator.
    pub(super) kind: &'a IntegratorKind,
    /// What is up in the world.
    pub(super) up: DVec3,
    /// What decides about the surfaces that cover the camera ray.
    pub(super) coverage: [f32; 2],
}

/// How the radiance of a sample is exposed and added to its pixel.
#[derive(Clone, Copy)]
pub(super) struct Exposed {
    pub(super) radiance: Spectrum,
    pub(super) exposure: Exposure,
    /// The weight of the pixel's filter.
    pub(super) weight: f64,
}

/// A vertex of a ray tree, or the end of a ray that leaves the scene.
struct Place {
    section: Section,
    /// The vertex that its ray comes from.
    parent: Option<usize>,
    /// The rays that leave it.
    rays: Vec<Ray>,
}

impl Place {
    fn new(section: Section, parent: Option<usize>) -> Self {
        Self { section, parent, rays: Vec::new() }
    }
}

impl Path<'_> {
    /// Writes the section on the events along a path, and their total light.
    pub(super) fn tell(&self, exposed: Option<Exposed>, radiance: Spectrum, events: &[Event]) -> Section {
        let texts = self.texts;
        let mut section = Section::new("light", self.title());
        let mut rows = Vec::new();
        let mut places: Vec<Place> = Vec::new();
        let mut met: Option<&Met> = None;
        // What the path carries, and its symbol.
        let mut carried: Option<(&str, Spectrum)> = None;
        for event in events {
            let begun = match event {
                Event::Met(here) => {
                    met = Some(here);
                    carried = Some(("β", here.throughput));
                    Some((self.vertex(here), &here.ray))
                }
                Event::Left { ray } => {
                    let mut left = Section::new("left", texts.left);
                    let mut scope = Scope::default();
                    left.quantity(&mut scope, "O", texts.origin, "", ray.origin);
                    left.quantity(&mut scope, "D", texts.direction, "", ray.direction);
                    Some((left, ray))
                }
                _ => None,
            };
            if let Some((begun, ray)) = begun {
                let parent = places.iter().rposition(|place| place.rays.contains(ray));
                places.push(Place::new(begun, parent));
                continue;
            }
            if places.is_empty() {
                places.push(Place::new(Section::new("start", texts.start), None));
            }
            let Some(Place { section: place, rays, .. }) = places.last_mut() else { continue };
            match event {
                Event::Met(_) | Event::Left { .. } => {}
                Event::Sampled(light) => place.sections.push(self.sampled(light, met)),
                Event::Added { source, radiance, weight, throughput, added } => {
                    let mut scope = Scope::default();
                    let source = self.source_of(*source);
                    let mut told = Section::new("added", source);
                    told.quantity(&mut scope, "β", texts.throughput, "", *throughput);
                    told.quantity(&mut scope, "L", self.label_of(event), "", *radiance);
                    if *weight != 1.0 {
                        told.quantity(&mut scope, "w", texts.mis_weight, "", *weight);
                        told.quantity(&mut scope, "A", texts.added, "β·L·w", *added);
                    } else {
                        told.quantity(&mut scope, "A", texts.added, "β·L", *added);
                    }
                    place.sections.push(told);
                    rows.push(vec![
                        Value::from(source),
                        (*throughput).into(),
                        (*radiance).into(),
                        (*weight).into(),
                        (*added).into(),
                    ]);
                }
                Event::Photons(photons) => place.sections.push(self.photons(photons)),
                Event::Scattered(scattered) => {
                    rays.push(scattered.ray);
                    place.sections.push(self.scattered(scattered, met, carried));
                }
                Event::Roulette { probability, survives } => {
                    let text = if *survives { texts.survives } else { texts.does_not_survive };
                    place.text(filled(text, &[&Value::from(*probability).in_full()]));
                    if let (true, Some((symbol, before))) = (*survives, carried) {
                        let mut scope = Scope::default();
                        scope.set(symbol, &Value::from(before));
                        place.quantity(&mut scope, "pᵣ", texts.going_on, "", *probability);
                        let after = before / *probability;
                        let formula = format!("{symbol}/pᵣ");
                        place.quantity(&mut scope, "βᵣ", texts.after_roulette, &formula, after);
                        carried = Some(("βᵣ", after));
                    }
                }
                Event::Medium { distance, scattered, throughput } => {
                    // Samples from here on belong to no surface.
                    met = met.filter(|_| !*scattered);
                    let mut told = Section::new("medium", texts.medium);
                    told.fact(texts.distance, *distance);
                    told.text(if *scattered { texts.medium_scattered } else { texts.medium_passed });
                    told.quantity(&mut Scope::default(), "β", texts.throughput, "", *throughput);
                    carried = Some(("β", *throughput));
                    place.sections.push(told);
                }
                Event::Caught { blocked } => place.fact(texts.blocked, *blocked),
                Event::Looked { ray, is_occluded } => {
                    place.quantity(&mut Scope::default(), "D", texts.direction, "", ray.direction);
                    place.text(if *is_occluded { texts.occluded } else { texts.open });
                }
                Event::Ended(end) => place.text(end_of(*end, texts)),
            }
        }
        if matches!(self.kind, IntegratorKind::Whitted { .. } | IntegratorKind::Pov) {
            section.text(texts.tree);
            // Children follow their parent in the list: from the last on, each goes in front of its parent's later
            // children.
            let own: Vec<usize> = places.iter().map(|place| place.section.sections.len()).collect();
            for i in (0..places.len()).rev() {
                if let Some(parent) = places[i].parent {
                    let branch = std::mem::take(&mut places[i].section);
                    places[parent].section.sections.insert(own[parent], branch);
                }
            }
            places.retain(|place| place.parent.is_none());
        }
        section.sections.extend(places.into_iter().map(|place| place.section));
        section.sections.push(self.sum(exposed, radiance, rows));
        section
    }

    /// The title of the section.
    fn title(&self) -> &'static str {
        match self.kind {
            IntegratorKind::Normals | IntegratorKind::Depth | IntegratorKind::Albedo | IntegratorKind::Uv => {
                self.texts.shown_feature
            }
            IntegratorKind::AmbientOcclusion { .. } => self.texts.openness,
            _ => self.texts.light,
        }
    }

    /// The label of the light's number, for other integrators.
    fn arriving(&self) -> &'static str {
        let texts = self.texts;
        match self.kind {
            IntegratorKind::Normals => texts.normal_as_colour,
            IntegratorKind::Depth => texts.depth_along_axis,
            IntegratorKind::Albedo => texts.reflectance,
            IntegratorKind::Uv => texts.uv_as_colour,
            IntegratorKind::AmbientOcclusion { .. } => texts.is_open,
            _ => texts.radiance,
        }
    }

    /// The label of the light that an event adds: it arrives from somewhere, or it is scattered by the surface.
    fn label_of(&self, added: &Event) -> &'static str {
        let is_scattered =
            matches!(added, Event::Added { source: Source::Sampled | Source::Direct | Source::Caustics, .. });
        if is_scattered && self.is_of_light() { self.texts.contribution } else { self.arriving() }
    }

    /// Whether the integrator computes light, and not a feature of the surface.
    fn is_of_light(&self) -> bool {
        matches!(
            self.kind,
            IntegratorKind::Path { .. }
                | IntegratorKind::Caustics
                | IntegratorKind::Whitted { .. }
                | IntegratorKind::Pov
        )
    }

    fn source_of(&self, source: Source) -> &'static str {
        match source {
            Source::Surface | Source::Sampled if !self.is_of_light() => self.arriving(),
            _ => source_of(source, self.texts),
        }
    }

    fn sum(&self, exposed: Option<Exposed>, radiance: Spectrum, rows: Vec<Vec<Value>>) -> Section {
        let texts = self.texts;
        let mut section = Section::new("radiance", texts.sum);
        let column = |key, title: &str| Column { key, title: title.to_owned() };
        let columns = vec![
            column("source", texts.source),
            column("throughput", "β"),
            column("radiance", "L"),
            column("weight", "w"),
            column("added", "A"),
        ];
        if rows.is_empty() {
            section.text(texts.no_light);
        } else {
            section.items.push(Item::Table { key: "added", columns, rows });
        }
        match exposed {
            Some(exposed) => expose(&mut section, &exposed, texts),
            None => section.fact(texts.radiance_along_ray, radiance),
        }
        section
    }

    fn vertex(&self, met: &Met) -> Section {
        let texts = self.texts;
        let what = self.shape(met.shape);
        let mut section = Section::new(
            format!("vertex {}", met.depth),
            filled(texts.vertex, &[&met.depth.to_string(), &what]),
        );
        let mut scope = Scope::default();
        scope.set("D", &Value::from(met.ray.direction));
        section.quantity(&mut scope, "P", texts.point, "", met.point);
        section.quantity(&mut scope, "N", texts.normal, "", met.normal);
        let shading = met.shading_normal.as_dvec3();
        section.quantity(&mut scope, "Nₛ", texts.shading_normal, "", shading);
        section.text(if met.front { texts.front } else { texts.back });
        section.quantity(&mut scope, "β", texts.throughput, "", met.throughput);
        if let Some(material) = self.things.material(met.shape) {
            section.fact(texts.material, material_of(self.things, met.shape, texts));
            for (name, numbers) in &material.parameters {
                let value = match numbers {
                    Some(numbers) => Value::Numbers(numbers.iter().map(|x| as_written(*x)).collect()),
                    None => Value::from(texts.texture),
                };
                let label = match (texts.parameter)(name) {
                    "" => name.clone(),
                    word => format!("{word} ({name})"),
                };
                section.fact(label, value);
            }
        }
        if met.depth > 0 && met.depth <= self.depth {
            let wanted = Wanted { nearest: true, from_camera: None, shapes: None, up: self.up, path: &[] };
            let told = surfaces(self.scene, &met.ray, self.things, &wanted, texts);
            section.sections.extend(told.ok());
        }
        if let Some(here) = self.interaction(met) {
            section.sections.push(self.mirrors(met, &here));
            if met.depth <= self.depth.max(1) {
                section.sections.extend(self.every_light(&here));
            }
        }
        section
    }

    /// The number and the kind of a shape.
    fn shape(&self, shape: u32) -> String {
        filled(self.texts.shape, &[&shape.to_string(), (self.texts.kind_of)(self.things.kind(shape))])
    }

    fn interaction(&self, met: &Met) -> Option<Interaction<'_>> {
        let scene = self.scene.resolved();
        let hit = if met.depth == 0 {
            scene.closest_seen(&met.ray, self.coverage)
        } else {
            scene.closest(&met.ray)
        }?;
        Some(scene.interaction(&met.ray, &hit, &Footprint::Point))
    }

    /// The mirrored and refracted rays of the material.
    fn mirrors(&self, met: &Met, here: &Interaction<'_>) -> Section {
        let texts = self.texts;
        let mut section = Section::new("mirror", texts.mirror);
        let direction = met.ray.direction;
        let normal = facing(here.shading.normal.as_dvec3().normalize(), direction);
        let mut scope = Scope::default();
        section.quantity(&mut scope, "D", texts.direction, "", direction);
        section.quantity(&mut scope, "Nᵢ", texts.facing, "", normal);
        let reflected = reflect(direction, normal);
        section.quantity(&mut scope, "Dᵣ", texts.reflected, "D − 2·(D·Nᵢ)·Nᵢ", reflected);
        let Some(index) = here.resolved().and_then(index) else {
            return section;
        };
        // From outside to inside, or the reverse.
        let [from, to] = if met.front { [1.0, index] } else { [index, 1.0] };
        section.quantity(&mut scope, "n₁", texts.index_here, "", from);
        section.quantity(&mut scope, "n₂", texts.index_beyond, "", to);
        let eta = from / to;
        section.quantity(&mut scope, "η", "", "n₁/n₂", eta);
        let cosine = -direction.dot(normal);
        section.quantity(&mut scope, "cᵢ", texts.cos_incident, "−(D·Nᵢ)", cosine);
        let squared = 1.0 - eta * eta * (1.0 - cosine * cosine);
        section.quantity(&mut scope, "κ", texts.cos_squared, "1 − η²·(1 − cᵢ²)", squared);
        match refract(direction, normal, eta) {
            Some(refracted) => {
                let formula = "η·D + (η·cᵢ − √(κ))·Nᵢ";
                section.quantity(&mut scope, "Dₜ", texts.refracted, formula, refracted);
                let beyond = squared.sqrt();
                section.quantity(&mut scope, "cₜ", texts.cos_refracted, "√(κ)", beyond);
                let across = (eta * cosine - beyond) / (eta * cosine + beyond);
                let formula = "(η·cᵢ − cₜ)/(η·cᵢ + cₜ)";
                section.quantity(&mut scope, "rₛ", texts.perpendicular, formula, across);
                let along = (cosine - eta * beyond) / (cosine + eta * beyond);
                let formula = "(cᵢ − η·cₜ)/(cᵢ + η·cₜ)";
                section.quantity(&mut scope, "rₚ", texts.parallel, formula, along);
                let reflectance = 0.5 * (across * across + along * along);
                section.quantity(&mut scope, "Fᵣ", texts.fresnel, "(rₛ² + rₚ²)/2", reflectance);
            }
            None => section.text(texts.total_reflection),
        }
        section
    }

    /// The contribution of each light here, at its middle.
    fn every_light(&self, here: &Interaction<'_>) -> Option<Section> {
        let texts = self.texts;
        let scene = self.scene.resolved();
        let (frame, bsdf) = here.scattering()?;
        if scene.lights().is_empty() || bsdf.is_delta() {
            return None;
        }
        let mut section = Section::new("lights", texts.each_light);
        section.text(texts.each_light_is);
        let column = |key, title: &str| Column { key, title: title.to_owned() };
        let columns = vec![
            column("light", texts.light_number),
            column("direction", texts.towards_light),
            column("distance", texts.distance),
            column("radiance", texts.arriving),
            column("pdf", texts.pdf),
            column("scattered", "f·|cos θ|"),
            column("visible", texts.visible),
            column("contribution", texts.contribution),
        ];
        let mut rows = Vec::new();
        for (id, light) in (0..).zip(scene.lights()).take(MAX_LIGHTS) {
            let sample =
                scene.sample_one_light(LightId(id), here.shadow_origin(), here.time, DVec2::splat(0.5));
            let Some(sample) = sample else { continue };
            let wo = frame.to_local(here.towards_origin.as_vec3());
            let scattered = bsdf.eval(wo, frame.to_local(sample.towards.as_vec3()));
            let is_visible = !scene.is_occluded(&here.shadow_ray(&sample));
            let (pdf, divisor) = match sample.scatter {
                Scatter::Density(pdf) => (Value::from(pdf), pdf),
                Scatter::Delta => (Value::from("δ"), 1.0),
            };
            let contribution =
                if is_visible { scattered * sample.radiance / divisor } else { Spectrum::BLACK };
            rows.push(vec![
                Value::Text(format!("{id} ({})", (texts.kind_of_light)(light.name()))),
                sample.towards.into(),
                sample.end.map_or(Value::from(f64::INFINITY), |end| {
                    (end.point - here.surface.point).length().into()
                }),
                sample.radiance.into(),
                pdf,
                scattered.into(),
                Value::from(if is_visible { texts.yes } else { texts.no }),
                contribution.into(),
            ]);
        }
        section.items.push(Item::Table { key: "lights", columns, rows });
        if scene.lights().len() > MAX_LIGHTS {
            section.remark(filled(texts.more_lights, &[&scene.lights().len().to_string()]));
        }
        Some(section)
    }

    /// A light that the path sampled.
    fn sampled(&self, light: &SampledLight, met: Option<&Met>) -> Section {
        let texts = self.texts;
        let SampledLight { sample, scattered, bsdf_pdf, weight, shadow_ray, passes } = light;
        let mut section = Section::new("sampled light", texts.sampled_light);
        let mut scope = Scope::default();
        section.quantity(&mut scope, "ω", texts.towards_light, "", sample.towards);
        let is_point = matches!(sample.scatter, Scatter::Delta);
        let distance = sample.end.zip(met).map(|(end, met)| (end.point - met.point).length());
        match distance {
            Some(distance) if is_point => {
                // The light of a point falls off with the square of the distance.
                section.quantity(&mut scope, "d", texts.distance, "", distance);
                let intensity = sample.radiance * (distance * distance) as f32;
                section.quantity(&mut scope, "Iₗ", texts.intensity, "", intensity);
                section.quantity(&mut scope, "Lᵢ", texts.arriving, "Iₗ/d²", sample.radiance);
            }
            _ => {
                if let Some(distance) = distance {
                    section.quantity(&mut scope, "d", texts.distance, "", distance);
                }
                section.quantity(&mut scope, "Lᵢ", texts.arriving, "", sample.radiance);
            }
        }
        // What is scattered of it, as a formula.
        let scatters = match met {
            Some(met) => {
                scope.set("Nₛ", &Value::from(met.shading_normal.as_dvec3()));
                let cosine = met.shading_normal.as_dvec3().dot(sample.towards).abs();
                section.quantity(&mut scope, "cₗ", texts.cos_light, "|Nₛ·ω|", cosine);
                match bsdf_alone(*scattered, cosine) {
                    Some(bsdf) => {
                        section.quantity(&mut scope, "f", texts.bsdf_alone, "", bsdf);
                        "f·cₗ"
                    }
                    None => {
                        section.quantity(&mut scope, "f", texts.scattered, "", *scattered);
                        "f"
                    }
                }
            }
            None => {
                section.quantity(&mut scope, "f", texts.phase, "", *scattered);
                "f"
            }
        };
        let Some(shadow_ray) = shadow_ray else {
            section.text(texts.no_shadow_ray);
            return section;
        };
        self.shadow(&mut section, shadow_ray, *passes);
        scope.set("Vₛ", &Value::from(*passes));
        match sample.scatter {
            Scatter::Density(pdf) => {
                section.quantity(&mut scope, "pₗ", texts.pdf, "", pdf);
                section.quantity(&mut scope, "pₛ", texts.bsdf_pdf, "", *bsdf_pdf);
                section.quantity(&mut scope, "w", texts.mis_weight, "pₗ²/(pₗ² + pₛ²)", *weight);
                let given = *scattered * sample.radiance * (weight / pdf) * *passes;
                let formula = format!("{scatters}·Lᵢ·(w/pₗ)·Vₛ");
                section.quantity(&mut scope, "L", texts.contribution, &formula, given);
            }
            Scatter::Delta => {
                let given = *scattered * sample.radiance * *passes;
                let formula = format!("{scatters}·Lᵢ·Vₛ");
                section.quantity(&mut scope, "L", texts.contribution, &formula, given);
            }
        }
        section
    }

    fn shadow(&self, section: &mut Section, ray: &Ray, passes: Spectrum) {
        let texts = self.texts;
        let mut scope = Scope::default();
        section.quantity(&mut scope, "Oₛ", texts.shadow_origin, "", ray.origin);
        section.quantity(&mut scope, "Dₛ", texts.shadow_direction, "", ray.direction);
        section.fact(texts.range, Value::Intervals(vec![[ray.t_min, ray.t_max]]));
        section.quantity(&mut scope, "Vₛ", texts.visibility, "", passes);
        if passes.is_black()
            && let Some(hit) = self.scene.resolved().closest(ray)
        {
            let shape = self.scene.resolved().shape_index(&hit);
            section.text(filled(texts.blocked_by, &[&self.shape(shape), &super::numbers::exact(hit.root.t)]));
        }
    }

    /// The photons near a point: the brightest one by one, the others together.
    fn photons(&self, photons: &[MergedPhoton]) -> Section {
        const MOST: usize = 6;
        let texts = self.texts;
        let mut section = Section::new("photons", texts.photons);
        let mut sorted = photons.to_vec();
        sorted.sort_by(|a, b| b.scattered.max_component().total_cmp(&a.scattered.max_component()));
        let column = |key, title: &str| Column { key, title: title.to_owned() };
        let columns = vec![
            column("direction", texts.photon_from),
            column("irradiance", texts.photon_irradiance),
            column("weight", "wₚ"),
            column("scattered", texts.photon_scattered),
        ];
        let (told, others) = sorted.split_at(sorted.len().min(MOST));
        let row = |photon: &MergedPhoton| {
            vec![
                photon.towards.as_dvec3().into(),
                photon.irradiance.into(),
                photon.weight.into(),
                photon.scattered.into(),
            ]
        };
        section.items.push(Item::Table { key: "photons", columns, rows: told.iter().map(row).collect() });
        if !others.is_empty() {
            let rest = others.iter().fold(Spectrum::BLACK, |sum, photon| sum + photon.scattered);
            let rest = Value::from(rest).in_full();
            section.text(filled(texts.more_photons, &[&others.len().to_string(), &rest]));
        }
        section
    }

    /// The next direction, chosen at a surface that was `met` or in a medium, by a path that carries something, with
    /// its symbol.
    fn scattered(&self, next: &Scattered, met: Option<&Met>, carried: Option<(&str, Spectrum)>) -> Section {
        let texts = self.texts;
        let Scattered { ray, weight, scatter, transmitted, eta, throughput } = next;
        let mut section = Section::new("scattered", texts.goes_on);
        section.text(match (met, *transmitted) {
            (None, _) => texts.is_scattered,
            (Some(_), true) => texts.transmitted,
            (Some(_), false) => texts.is_reflected,
        });
        let mut scope = Scope::default();
        section.quantity(&mut scope, "O", texts.origin, "", ray.origin);
        section.quantity(&mut scope, "D", texts.direction, "", ray.direction);
        if *transmitted && *eta != 1.0 {
            section.fact(format!("1/η: {}", texts.eta_entered), *eta);
        }
        let label = if met.is_some() { texts.bsdf_weight } else { texts.phase_weight };
        let mut formula = "";
        match scatter {
            Scatter::Density(pdf) => {
                section.quantity(&mut scope, "pₛ", texts.pdf, "", *pdf);
                if let Some(met) = met {
                    scope.set("Nₛ", &Value::from(met.shading_normal.as_dvec3()));
                    let cosine = met.shading_normal.as_dvec3().dot(ray.direction).abs();
                    if let Some(bsdf) = bsdf_alone(*weight * *pdf, cosine) {
                        section.quantity(&mut scope, "cₛ", texts.cos_light, "|Nₛ·D|", cosine);
                        section.quantity(&mut scope, "f", texts.bsdf_alone, "", bsdf);
                        formula = "f·cₛ/pₛ";
                    }
                }
            }
            Scatter::Delta => section.text(texts.only_direction),
        }
        section.quantity(&mut scope, "α", label, formula, *weight);
        // Of what a medium took on the way there is no step.
        let is_product = |before: Spectrum| {
            let mut both = (before * *weight).to_array().into_iter().zip(throughput.to_array());
            both.all(|(a, b)| (a - b).abs() <= 1e-5 * b.abs())
        };
        let formula = match carried {
            Some((symbol, before)) if is_product(before) => {
                scope.set(symbol, &Value::from(before));
                format!("{symbol}·α")
            }
            _ => String::new(),
        };
        section.quantity(&mut scope, "β′", texts.throughput_after, &formula, *throughput);
        section
    }
}

/// f, from f·|cos θ|; `None` where the cosine is too small to divide by.
fn bsdf_alone(scattered: Spectrum, cosine: f64) -> Option<Spectrum> {
    (cosine > 1e-6).then(|| scattered * (1.0 / cosine) as f32)
}

/// Shows how the film exposes the radiance of a sample, step by step.
fn expose(section: &mut Section, &Exposed { radiance, exposure, weight }: &Exposed, texts: &Texts) {
    let Exposure { factor, max_component, sensor } = exposure;
    let colour = exposure.colour(radiance);
    let is_sensor = sensor != Exposure::default().sensor;
    let is_plain = factor == 1.0 && max_component == f32::INFINITY && !is_sensor;
    let mut scope = Scope::default();
    if !is_plain {
        section.quantity(&mut scope, "Lₛ", texts.radiance_before_film, "", radiance);
        section.quantity(&mut scope, "e", texts.exposure, "", factor);
        let exposed = radiance * factor;
        section.quantity(&mut scope, "Cₛ", texts.exposed, "e·Lₛ", exposed);
        let most = exposed.max_component();
        if most > max_component {
            section.quantity(&mut scope, "m", texts.max_component, "", max_component);
            section.fact(texts.held, exposed * (max_component / most));
        }
        if is_sensor {
            let rows = sensor.map(|row| Value::Numbers(row.map(f64::from).to_vec()).in_full());
            section.fact(texts.sensor, format!("[{}]", rows.map(|row| format!("[{row}]")).join(", ")));
        }
    }
    section.fact(texts.radiance_of_sample, colour);
    if weight != 1.0 {
        section.quantity(&mut scope, "φ", texts.filter_weight, "", weight);
        let weighted = colour.to_array().map(|c| f64::from(c) * weight);
        section.fact(texts.weighted, Value::Numbers(weighted.to_vec()));
    }
}

/// The index of refraction of a transmissive material.
fn index(material: &Material) -> Option<f64> {
    let index = match &material.kind {
        MaterialKind::Dielectric { eta, .. } => Some(*eta),
        _ => material.interior_index(),
    };
    index.map(f64::from)
}

/// A parameter with the digits of its file: most are stored in single precision.
fn as_written(x: f64) -> f64 {
    let single = x as f32;
    if f64::from(single) == x { single.to_string().parse().unwrap_or(x) } else { x }
}

fn source_of(source: Source, texts: &Texts) -> &'static str {
    match source {
        Source::Surface => texts.from_surface,
        Source::Infinity => texts.from_infinity,
        Source::Medium => texts.from_medium,
        Source::Sampled => texts.from_sampled,
        Source::Direct => texts.from_direct,
        Source::Caustics => texts.from_caustics,
    }
}

fn end_of(end: End, texts: &Texts) -> &'static str {
    match end {
        End::Depth => texts.end_depth,
        End::Nothing => texts.end_nothing,
        End::Absorbed => texts.end_absorbed,
        End::Roulette => texts.end_roulette,
        End::Medium => texts.end_medium,
    }
}

/// The vertices of a path, for the sketch.
pub(super) fn corners(events: &[Event]) -> Vec<DVec3> {
    events
        .iter()
        .filter_map(|event| if let Event::Met(met) = event { Some(met.point) } else { None })
        .collect()
}
