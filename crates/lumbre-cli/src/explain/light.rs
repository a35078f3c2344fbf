//! The light that comes along a ray: what happens along its path, and what each light gives.

use lumbre::description::{Footprint, Interaction, LightId};
use lumbre::journal::{End, Event, MergedPhoton, Met, SampledLight, Scattered, Source};
use lumbre::math::optics::{facing, reflect, refract};
use lumbre::shading::{Material, MaterialKind, Scatter, Spectrum};
use lumbre::{DVec2, DVec3, Ray, Scene};

use super::document::{Column, Item, Section, Value};
use super::formula::Scope;
use super::surfaces::surfaces;
use super::texts::Texts;
use super::things::Things;
use crate::language::filled;

/// Lights that are told of one by one at most.
const MOST_LIGHTS: usize = 16;

/// What is told of the light of one path.
pub(super) struct Path<'a> {
    pub(super) scene: &'a Scene,
    pub(super) things: &'a Things,
    pub(super) texts: &'a Texts,
    /// Rays after the first whose crossings are told as well.
    pub(super) depth: u32,
}

impl Path<'_> {
    /// What happens along a path, and the light that it comes to.
    pub(super) fn tell(&self, radiance: Spectrum, events: &[Event]) -> Section {
        let texts = self.texts;
        let mut section = Section::new("light", texts.light);
        let mut rows = Vec::new();
        let mut vertex: Option<Section> = None;
        let mut met: Option<&Met> = None;
        for event in events {
            if let Event::Met(_) | Event::Left { .. } = event {
                section.sections.extend(vertex.take());
            }
            let place = vertex.get_or_insert_with(|| Section::new("start", texts.start));
            match event {
                Event::Met(here) => {
                    met = Some(here);
                    *place = self.vertex(here);
                }
                Event::Left { ray } => {
                    *place = Section::new("left", texts.left);
                    place.fact("O", ray.origin);
                    place.fact("D", ray.direction);
                }
                Event::Sampled(light) => place.sections.push(self.sampled(light, met)),
                Event::Added { source, radiance, weight, throughput, added } => {
                    let mut scope = Scope::default();
                    let mut told = Section::new("added", source_of(*source, texts));
                    told.quantity(&mut scope, "β", texts.throughput, "", *throughput);
                    told.quantity(&mut scope, "L", texts.radiance, "", *radiance);
                    if *weight != 1.0 {
                        told.quantity(&mut scope, "w", texts.mis_weight, "", *weight);
                        told.quantity(&mut scope, "A", texts.added, "β·L·w", *added);
                    } else {
                        told.quantity(&mut scope, "A", texts.added, "β·L", *added);
                    }
                    place.sections.push(told);
                    let from = Value::from(source_of(*source, texts));
                    rows.push(vec![
                        from,
                        (*throughput).into(),
                        (*radiance).into(),
                        (*weight).into(),
                        (*added).into(),
                    ]);
                }
                Event::Photons(photons) => place.sections.push(self.photons(photons)),
                Event::Scattered(scattered) => place.sections.push(self.scattered(scattered)),
                Event::Roulette { probability, survives } => {
                    let text = if *survives { texts.survives } else { texts.does_not_survive };
                    place.text(filled(text, &[&Value::from(*probability).in_full()]));
                }
                Event::Medium { distance, scattered, throughput } => {
                    let mut told = Section::new("medium", texts.medium);
                    told.fact(texts.distance, *distance);
                    told.text(if *scattered { texts.medium_scattered } else { texts.medium_passed });
                    told.fact(texts.throughput, *throughput);
                    place.sections.push(told);
                }
                Event::Caught { blocked } => place.fact(texts.blocked, *blocked),
                Event::Looked { ray, is_occluded } => {
                    place.fact("D", ray.direction);
                    place.text(if *is_occluded { texts.occluded } else { texts.open });
                }
                Event::Ended(end) => place.text(end_of(*end, texts)),
            }
        }
        section.sections.extend(vertex);
        section.sections.push(self.sum(radiance, rows));
        section
    }

    fn sum(&self, radiance: Spectrum, rows: Vec<Vec<Value>>) -> Section {
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
        section.fact(texts.radiance_of_sample, radiance);
        section
    }

    fn vertex(&self, met: &Met) -> Section {
        let texts = self.texts;
        let what = filled(texts.shape, &[&met.shape.to_string(), self.things.kind(met.shape)]);
        let mut section = Section::new(
            format!("vertex {}", met.depth),
            filled(texts.vertex, &[&met.depth.to_string(), &what]),
        );
        let mut scope = Scope::default();
        scope.set("D", Value::from(met.ray.direction).in_short());
        section.quantity(&mut scope, "P", texts.point, "", met.point);
        section.quantity(&mut scope, "N", texts.normal, "", met.normal);
        let shading = met.shading_normal.as_dvec3();
        if (shading - met.normal).length() > 1e-6 {
            section.quantity(&mut scope, "Nₛ", texts.shading_normal, "", shading);
        }
        section.text(if met.front { texts.front } else { texts.back });
        section.quantity(&mut scope, "β", texts.throughput, "", met.throughput);
        if let Some(material) = self.things.material(met.shape) {
            section.fact(texts.material, material.name.clone());
            for (name, numbers) in &material.parameters {
                let value = match numbers {
                    Some(numbers) => Value::Numbers(numbers.iter().map(|x| as_written(*x)).collect()),
                    None => Value::from(texts.texture),
                };
                section.fact(name.clone(), value);
            }
        }
        if met.depth > 0 && met.depth <= self.depth {
            let told = surfaces(self.scene, &met.ray, self.things, true, false, texts);
            section.sections.push(told.section);
        }
        if let Some(here) = self.interaction(met) {
            section.sections.push(self.mirrors(met, &here));
            if met.depth <= self.depth.max(1) {
                section.sections.extend(self.every_light(&here));
            }
        }
        section
    }

    fn interaction(&self, met: &Met) -> Option<Interaction<'_>> {
        let scene = self.scene.resolved();
        let hit = if met.depth == 0 { scene.closest_seen(&met.ray) } else { scene.closest(&met.ray) }?;
        Some(scene.interaction(&met.ray, &hit, &Footprint::Point))
    }

    /// Where a mirror and a smooth boundary of the material would send the ray.
    fn mirrors(&self, met: &Met, here: &Interaction<'_>) -> Section {
        let texts = self.texts;
        let mut section = Section::new("mirror", texts.mirror);
        let direction = met.ray.direction;
        let normal = facing(here.shading.normal.as_dvec3().normalize(), direction);
        let mut scope = Scope::default();
        section.quantity(&mut scope, "D", texts.direction, "", direction);
        section.quantity(&mut scope, "n", texts.facing, "", normal);
        section.quantity(&mut scope, "R", texts.reflected, "D − 2·(D·n)·n", reflect(direction, normal));
        let Some(index) = here.resolved().and_then(index) else {
            return section;
        };
        // From outside to inside, or back.
        let eta = if met.front { 1.0 / index } else { index };
        section.fact(texts.index, index);
        let formula = if met.front { "1/i" } else { "i" };
        scope.set("i", Value::from(index).in_short());
        section.quantity(&mut scope, "η", texts.eta, formula, eta);
        let cosine = -direction.dot(normal);
        section.quantity(&mut scope, "c₁", texts.cos_incident, "−(D·n)", cosine);
        let k = 1.0 - eta * eta * (1.0 - cosine * cosine);
        section.quantity(&mut scope, "k", texts.cos_squared, "1 − η²·(1 − c₁²)", k);
        match refract(direction, normal, eta) {
            Some(refracted) => {
                section.quantity(&mut scope, "T", texts.refracted, "η·D + (η·c₁ − √(k))·n", refracted);
            }
            None => section.text(texts.total_reflection),
        }
        section
    }

    /// What each light gives here, where one looks at its middle.
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
        for (id, light) in (0..).zip(scene.lights()).take(MOST_LIGHTS) {
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
                Value::Text(format!("{id} ({})", light.name())),
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
        if scene.lights().len() > MOST_LIGHTS {
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
        if let (Some(end), Some(met)) = (sample.end, met) {
            section.fact(texts.distance, (end.point - met.point).length());
        }
        section.quantity(&mut scope, "Lᵢ", texts.arriving, "", sample.radiance);
        section.quantity(&mut scope, "f", texts.scattered, "", *scattered);
        let Some(shadow_ray) = shadow_ray else {
            section.text(texts.no_shadow_ray);
            return section;
        };
        self.shadow(&mut section, shadow_ray, *passes);
        scope.set("V", Value::from(*passes).in_short());
        match sample.scatter {
            Scatter::Density(pdf) => {
                section.quantity(&mut scope, "p", texts.pdf, "", pdf);
                section.quantity(&mut scope, "q", texts.bsdf_pdf, "", *bsdf_pdf);
                section.quantity(&mut scope, "w", texts.mis_weight, "p²/(p² + q²)", *weight);
                let given = *scattered * sample.radiance * (weight / pdf) * *passes;
                section.quantity(&mut scope, "L", texts.contribution, "f·Lᵢ·(w/p)·V", given);
            }
            Scatter::Delta => {
                let given = *scattered * sample.radiance * *passes;
                section.quantity(&mut scope, "L", texts.contribution, "f·Lᵢ·V", given);
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
        section.quantity(&mut scope, "V", texts.visibility, "", passes);
        if passes.is_black()
            && let Some(hit) = self.scene.resolved().closest(ray)
        {
            let shape = self.scene.resolved().shape_index(&hit);
            let what = filled(texts.shape, &[&shape.to_string(), self.things.kind(shape)]);
            section.text(filled(texts.blocked_by, &[&what, &super::document::exact(hit.root.t)]));
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
            column("weight", "w"),
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

    fn scattered(&self, scattered: &Scattered) -> Section {
        let texts = self.texts;
        let Scattered { ray, weight, scatter, transmitted, eta, throughput } = scattered;
        let mut section = Section::new("scattered", texts.goes_on);
        section.text(if *transmitted { texts.transmitted } else { texts.is_reflected });
        section.fact("O", ray.origin);
        section.fact("D", ray.direction);
        if *transmitted && *eta != 1.0 {
            section.fact("η", *eta);
        }
        match scatter {
            Scatter::Density(pdf) => section.fact(texts.pdf, *pdf),
            Scatter::Delta => section.text(texts.only_direction),
        }
        section.fact(texts.bsdf_weight, *weight);
        section.fact(texts.throughput_after, *throughput);
        section
    }
}

/// The index of refraction of a material that light gets into.
fn index(material: &Material) -> Option<f64> {
    let index = match &material.kind {
        MaterialKind::Dielectric { eta, .. } => Some(*eta),
        _ => material.interior_index(),
    };
    index.map(f64::from)
}

/// A parameter with the digits that it was given with: most are kept in single precision.
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

/// The points of a path, from vertex to vertex: for the sketch.
pub(super) fn corners(events: &[Event]) -> Vec<DVec3> {
    events
        .iter()
        .filter_map(|event| if let Event::Met(met) = event { Some(met.point) } else { None })
        .collect()
}
