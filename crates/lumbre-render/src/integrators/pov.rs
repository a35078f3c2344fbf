//! POV-Ray's local illumination: ambient, diffuse and highlights of each layer, mirrors, refraction, filtered shadows
//! and fog.

mod media;

use std::f64::consts::FRAC_PI_2;

use lumbre_geometry::Ray;
use lumbre_math::{DVec2, DVec3, Elementary};
use lumbre_scene::pov::{PovArea, PovLight, PovRadiosity, PovWorld};
use lumbre_scene::{Light, PovHit, PovObstacle, Scene};
use lumbre_shading::Spectrum;
use lumbre_shading::pov::{Asked, Eye, Finish, LayerAt, PovMaterial};
use smallvec::{SmallVec, smallvec};

use crate::integrators::Integrator;
use crate::transport::{Record, Sampler};
use crate::wave::PrimaryHits;

/// The light of POV-Ray's scenes as POV-Ray computes it, after its reference manual. Colours are in the scene's working
/// space until they are summed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pov;

/// Surfaces that a shadow ray passes, at most.
const MAX_SURFACES: u32 = 256;
/// Hits nearer than this are no hits.
const NEAR: f64 = 1e-4;
/// Light that grazes a surface by less than this cosine does not reach it.
const GRAZING: f64 = 1e-10;

/// From how many directions light is gathered by radiosity, where the camera sees a surface …
const MIN_GATHERED: u32 = 64;
const MAX_GATHERED: u32 = 256;
/// … and where that light comes from.
const GATHERED_FURTHER: u32 = 4;

/// The exponent of the cosine by which `caustics 1` gathers light.
const CAUSTICS: f32 = 45.0;

/// The solids that a ray is in.
type Inside<'s> = SmallVec<[&'s PovMaterial; 4]>;

/// A ray with what it carries.
struct Traced<'s> {
    ray: Ray,
    inside: Inside<'s>,
    level: u32,
    /// Whether it goes on where another passed a surface straight: such a ray has the level of that other, and is not
    /// followed at the last level.
    is_straight: bool,
    /// The most that it can add to the picture.
    weight: f32,
    is_mirrored: bool,
    is_camera: bool,
    /// How many surfaces have gathered light by radiosity on its way.
    gathers: u32,
    /// By how much the directions are shifted from which light is gathered.
    shift: DVec2,
}

/// What all rays of a picture need.
struct Tracer<'s> {
    scene: &'s Scene,
    world: &'s PovWorld,
    lights: Vec<&'s PovLight>,
}

impl Integrator for Pov {
    fn estimate(&self, primary_hits: &mut PrimaryHits<'_, '_>, _: &Sampler, record: &mut Record) {
        let scene = primary_hits.scene();
        let Some(world) = scene.pov() else { return };
        let lights = scene.lights().iter().filter_map(|light| match light {
            Light::Pov(light) => Some(&**light),
            _ => None,
        });
        let tracer = Tracer { scene, world, lights: lights.collect() };
        primary_hits.each_ray(|ray, numbers| tracer.seen_by_camera(ray, numbers.light_point(0), record));
    }

    /// Its patterns need points in double precision, which it finds itself.
    fn uses_primary_hits(&self) -> bool {
        false
    }
}

impl<'s> Tracer<'s> {
    /// The linear light along a ray from the camera, with a shift of the directions that light is gathered from.
    fn seen_by_camera(&self, ray: Ray, shift: DVec2, record: &mut Record) -> Spectrum {
        let world = self.world;
        let is_at_eye = ray.origin.distance(world.eye) <= NEAR * (1.0 + world.eye.length());
        let first = Traced {
            inside: if is_at_eye {
                world.around_eye.iter().map(|solid| &**solid).collect()
            } else {
                Inside::new()
            },
            ray,
            level: 0,
            is_straight: false,
            weight: 1.0,
            is_mirrored: false,
            is_camera: true,
            gathers: 0,
            shift,
        };
        let colour = self.trace(&first, record);
        if world.gamma == 1.0 { colour } else { colour.map(|c| c.max(0.0).power(world.gamma)) }
    }

    /// The first surface along a ray that is not hidden from it.
    fn closest(&self, traced: &Traced<'s>) -> Option<(PovHit<'s>, &'s PovMaterial, f64)> {
        let mut ray = traced.ray;
        for _ in 0..MAX_SURFACES {
            let hit = self.scene.closest(&ray)?;
            let here = self.scene.pov_hit(&ray, &hit);
            let material = here.material?;
            let visible = material.visibility;
            let is_hidden =
                (visible.no_image && traced.is_camera) || (visible.no_reflection && traced.is_mirrored);
            let distance = (here.surface.point - traced.ray.origin).length();
            if !is_hidden && distance >= NEAR {
                return Some((here, material, distance));
            }
            ray = here.leave(ray.direction);
        }
        None
    }

    fn trace(&self, traced: &Traced<'s>, record: &mut Record) -> Spectrum {
        if traced.level + u32::from(traced.is_straight) >= self.world.max_trace_level
            || traced.weight < self.world.adc_bailout
        {
            return Spectrum::BLACK;
        }
        let direction = traced.ray.direction.normalize();
        let (colour, length) = match self.closest(traced) {
            Some((here, material, distance)) => {
                // Inside of solids light fades, by the way to where it leaves them.
                let fade = |left: Spectrum, solid: &&PovMaterial| {
                    left * solid.interior.transmittance(distance as f32)
                };
                let left = traced.inside.iter().fold(Spectrum::WHITE, fade);
                (self.shade(traced, &here, material, left, record), distance)
            }
            None => (self.world.sky_colour(direction), f64::INFINITY),
        };
        if traced.inside.iter().any(|solid| !solid.hollow) {
            return colour;
        }
        let colour = self.through_media(traced, direction, length, colour, record);
        self.in_fog(colour, traced.ray.origin, direction, length)
    }

    /// Light through all fogs: what each leaves is multiplied, and what each adds is added.
    fn in_fog(&self, colour: Spectrum, origin: DVec3, direction: DVec3, length: f64) -> Spectrum {
        let (mut left, mut added) = (Spectrum::WHITE, Spectrum::BLACK);
        for fog in &self.world.fogs {
            let passes = fog.transmittance(origin, direction, length);
            let tint = Spectrum::splat(1.0 - fog.filter) + fog.rgb * fog.filter;
            left = left * tint * passes;
            added += fog.rgb * (1.0 - passes);
        }
        colour * left + added
    }

    fn shade(
        &self,
        traced: &Traced<'s>,
        here: &PovHit<'s>,
        material: &'s PovMaterial,
        left: Spectrum,
        record: &mut Record,
    ) -> Spectrum {
        let direction = traced.ray.direction.normalize();
        let smooth = here.smooth;
        let normal = if smooth.dot(direction) > 0.0 { -smooth } else { smooth };
        let eye = Eye { normal, direction: -direction, uv: material.surface_uv(here.surface.point, here.uv) };
        // A solid that the ray is in is left.
        let is_inside = traced.inside.iter().any(|solid| solid.is_of_solid(material));
        let mut sum = Spectrum::BLACK;
        for (share, layers) in &material.stacks(here.surface.point, &eye, here.front, Asked::Normals) {
            sum += self.stack(traced, here, material, layers, left, is_inside, record) * *share;
        }
        sum
    }

    /// The light of layers, the bottom first. What the solids that a ray is in leave of light dims what passes the
    /// layers, and neither their own light nor mirrors.
    #[allow(clippy::too_many_arguments, reason = "layers are seen by a ray, from inside or outside")]
    fn stack(
        &self,
        traced: &Traced<'s>,
        here: &PovHit<'s>,
        material: &'s PovMaterial,
        layers: &[LayerAt<'_>],
        fade: Spectrum,
        is_inside: bool,
        record: &mut Record,
    ) -> Spectrum {
        let mut sum = Spectrum::BLACK;
        let mut left = Spectrum::WHITE;
        // What the lights give is the same for layers of the same normal.
        let mut shadows: SmallVec<[Option<Spectrum>; 8]> = smallvec![None; self.lights.len()];
        let mut gathered = None;
        let has_ambient = self.world.radiosity.is_none_or(|radiosity| radiosity.has_ambient);
        for layer in layers.iter().rev() {
            let (colour, finish) = (layer.colour, layer.finish);
            let opacity = material.opacity(colour);
            let mut own = finish.emission;
            if has_ambient {
                own += finish.ambient * self.world.ambient_light;
            }
            if let Some(radiosity) = &self.world.radiosity
                && finish.diffuse * opacity != 0.0
            {
                own += *gathered.get_or_insert_with(|| self.gathered(traced, here, radiosity, record))
                    * finish.diffuse;
            }
            sum += left * colour.rgb * own * opacity;
            for (light, shadow) in self.lights.iter().zip(&mut shadows) {
                sum += left * self.lit(traced, here, material, layer, light, opacity, shadow, record);
            }
            sum += self.mirror(traced, here, material, layer, record);
            left *= colour.passing();
            if finish.conserve_energy {
                let mirrored = self.reflectance(traced, material, layer);
                left *= (Spectrum::WHITE - mirrored).map(|c| c.clamp(0.0, 1.0));
            }
        }
        if let Some(top) = layers.last()
            && gray((left * fade).map(f32::abs)) >= self.world.adc_bailout
        {
            sum += self.passing(traced, here, material, top, [left * fade, fade], is_inside, record);
        }
        sum
    }

    /// The mean of the light that comes to a surface from all directions, by the cosine of each.
    fn gathered(
        &self,
        traced: &Traced<'s>,
        here: &PovHit<'s>,
        radiosity: &PovRadiosity,
        record: &mut Record,
    ) -> Spectrum {
        if traced.gathers >= radiosity.bounces {
            return Spectrum::BLACK;
        }
        let count = match traced.gathers {
            0 => radiosity.count.clamp(MIN_GATHERED, MAX_GATHERED),
            _ => GATHERED_FURTHER,
        };
        let d = traced.ray.direction;
        let smooth = here.smooth;
        let normal = if smooth.dot(d) > 0.0 { -smooth } else { smooth };
        let raw = if here.surface.normal.dot(d) > 0.0 { -here.surface.normal } else { here.surface.normal };
        let (side, up) = normal.any_orthonormal_pair();
        let mut sum = Spectrum::BLACK;
        for i in 0..count {
            // The sequence R2 of Martin Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018.
            let u = DVec2::new(0.754_877_666_246_692_8, 0.569_840_290_998_053_2) * (f64::from(i) + 0.5);
            let u = u + traced.shift;
            let u = u - u.floor();
            let (sine, cosine) = (std::f64::consts::TAU * u.y).sine_cosine();
            let across = u.x.sqrt();
            let direction = side * (across * cosine) + up * (across * sine) + normal * (1.0 - u.x).sqrt();
            if direction.dot(raw) <= 0.0 {
                continue;
            }
            let next = Traced {
                ray: here.leave(direction.normalize()),
                inside: traced.inside.clone(),
                level: 0,
                is_straight: false,
                weight: 1.0,
                is_mirrored: false,
                is_camera: false,
                gathers: traced.gathers + 1,
                shift: u,
            };
            record.counts.bounce += 1;
            sum += self.trace(&next, record);
        }
        let mean = sum * (radiosity.brightness / count as f32);
        mean * (1.0 - radiosity.grayness) + Spectrum::splat(gray(mean) * radiosity.grayness)
    }

    /// Diffuse light and highlights of a light on a layer.
    #[allow(
        clippy::too_many_arguments,
        reason = "a layer under a light is seen by a ray, and leaves its shadow"
    )]
    fn lit(
        &self,
        traced: &Traced<'s>,
        here: &PovHit<'s>,
        material: &PovMaterial,
        layer: &LayerAt<'_>,
        light: &PovLight,
        opacity: f32,
        shadow: &mut Option<Spectrum>,
        record: &mut Record,
    ) -> Spectrum {
        let lights_it = match light.group {
            Some(group) => material.light_groups.contains(&group),
            None => material.global_lights,
        };
        let p = here.surface.point;
        let needs_light = layer.finish.diffuse != 0.0
            || layer.finish.diffuse_back != 0.0
            || layer.finish.phong != 0.0
            || layer.finish.specular != 0.0;
        if !lights_it || !needs_light {
            return Spectrum::BLACK;
        }
        // Of all points of an area or of its middle; what comes through is a factor of its own, as POV-Ray has it.
        let shaded = match &light.area {
            Some(area) if area.illumination => {
                let [n, m] = area.counts;
                let mut sum = Spectrum::BLACK;
                for i in 0..n * m {
                    let from = light.place(DVec2::new(step(i / m, n), step(i % m, m)), p);
                    let arriving = light.arriving(p, from);
                    sum += self.shaded(traced, here, material, layer, light, from, arriving, opacity);
                }
                sum * ((n * m) as f32).recip()
            }
            _ => {
                let arriving = light.arriving(p, light.from);
                self.shaded(traced, here, material, layer, light, light.from, arriving, opacity)
            }
        };
        if shaded.is_black() || light.shadowless {
            return shaded;
        }
        let passes = *shadow.get_or_insert_with(|| self.shadows(here, light, record));
        shaded * passes
    }

    /// What a layer makes of light that arrives from a place.
    #[allow(clippy::too_many_arguments, reason = "a layer under a light is seen by a ray")]
    fn shaded(
        &self,
        traced: &Traced<'s>,
        here: &PovHit<'s>,
        material: &PovMaterial,
        layer: &LayerAt<'_>,
        light: &PovLight,
        from: DVec3,
        arriving: Spectrum,
        opacity: f32,
    ) -> Spectrum {
        let Some((towards, _)) = light.towards(here.surface.point, from) else { return Spectrum::BLACK };
        if arriving.is_black() {
            return Spectrum::BLACK;
        }
        let (n, finish) = (layer.normal, layer.finish);
        let cosine = n.dot(towards);
        let is_behind = cosine < GRAZING;
        if is_behind && !material.double_illuminate && finish.diffuse_back == 0.0 {
            return Spectrum::BLACK;
        }
        let strength = if is_behind && !material.double_illuminate {
            finish.diffuse_strength() * (finish.diffuse_back / finish.diffuse.max(1e-9))
        } else {
            finish.diffuse_strength()
        };
        let cosine = cosine.abs();
        let falloff =
            if finish.brilliance == 1.0 { cosine as f32 } else { (cosine as f32).power(finish.brilliance) };
        let mut sum = layer.colour.rgb * arriving * (opacity * strength * falloff);
        let d = traced.ray.direction.normalize();
        if !light.shadowless && !is_behind {
            sum += self.highlights(finish, layer, d, towards, arriving);
        }
        if finish.irid[0] != 0.0 {
            sum *= self.irid(finish, cosine, n.dot(d).abs(), here.surface.point);
        }
        sum
    }

    fn highlights(
        &self,
        finish: &Finish,
        layer: &LayerAt<'_>,
        d: DVec3,
        towards: DVec3,
        arriving: Spectrum,
    ) -> Spectrum {
        let n = layer.normal;
        let mut strength = 0.0;
        if finish.phong > 0.0 {
            let mirrored = d - n * (2.0 * n.dot(d));
            let cosine = mirrored.dot(towards);
            if cosine > 0.0 {
                strength += finish.phong_strength() * (cosine as f32).power(finish.phong_size);
            }
        }
        if finish.specular > 0.0 {
            let half = (towards - d).normalize_or_zero();
            let cosine = n.dot(half);
            if cosine > 0.0 {
                strength +=
                    finish.specular_strength() * (cosine as f32).power(1.0 / finish.roughness.max(1e-9));
            }
        }
        if strength == 0.0 {
            return Spectrum::BLACK;
        }
        arriving * metallic(finish.metallic, n.dot(towards), layer.colour.rgb) * strength
    }

    fn irid(&self, finish: &Finish, to_light: f64, to_eye: f64, p: DVec3) -> Spectrum {
        let [amount, thickness, turbulence] = finish.irid;
        let mut thickness = f64::from(thickness);
        if turbulence != 0.0 {
            let noise = lumbre_shading::pov::Octaves { octaves: 5, ..Default::default() }
                .turbulence(p, lumbre_shading::pov::NoiseGenerator::Corrected);
            thickness *= 1.0 + f64::from(turbulence) * (2.0 * noise - 1.0);
        }
        let wave = |length: f32| {
            let phase = std::f64::consts::TAU * thickness * (to_light + to_eye) / f64::from(length);
            1.0 + amount * phase.cosine() as f32
        };
        self.world.irid_wavelength.map(wave)
    }

    fn reflectance(&self, traced: &Traced<'s>, material: &PovMaterial, layer: &LayerAt<'_>) -> Spectrum {
        let mirror = &layer.finish.reflection;
        if mirror.is_none() {
            return Spectrum::BLACK;
        }
        let d = traced.ray.direction.normalize();
        let cosine = -layer.normal.dot(d);
        let is_inside = traced.inside.iter().any(|solid| solid.is_of_solid(material));
        let eta = if is_inside { 1.0 / material.interior.ior } else { material.interior.ior };
        let reflectance = mirror.at(cosine.clamp(0.0, 1.0) as f32, eta);
        reflectance * metallic(mirror.metallic, cosine, layer.colour.rgb)
    }

    fn mirror(
        &self,
        traced: &Traced<'s>,
        here: &PovHit<'s>,
        material: &'s PovMaterial,
        layer: &LayerAt<'_>,
        record: &mut Record,
    ) -> Spectrum {
        let reflectance = self.reflectance(traced, material, layer);
        let weight = traced.weight * reflectance.max_component();
        if weight < self.world.adc_bailout {
            return Spectrum::BLACK;
        }
        let d = traced.ray.direction.normalize();
        let raw = if here.surface.normal.dot(d) > 0.0 { -here.surface.normal } else { here.surface.normal };
        let mut direction = d - layer.normal * (2.0 * layer.normal.dot(d));
        if direction.dot(raw) < 0.0 {
            // What would enter the surface is bent back at it.
            direction -= raw * (2.0 * direction.dot(raw));
        }
        let next = Traced {
            ray: here.leave(direction.normalize()),
            inside: traced.inside.clone(),
            level: traced.level + 1,
            is_straight: false,
            weight,
            is_mirrored: true,
            is_camera: false,
            gathers: traced.gathers,
            shift: traced.shift,
        };
        record.counts.bounce += 1;
        let mut seen = self.trace(&next, record);
        if layer.finish.irid[0] != 0.0 {
            let (to_light, to_eye) = (layer.normal.dot(direction).abs(), layer.normal.dot(d).abs());
            seen *= self.irid(layer.finish, to_light, to_eye, here.surface.point);
        }
        let exponent = layer.finish.reflection.exponent;
        let seen = if exponent == 1.0 { seen } else { seen.map(|c| c.max(0.0).power(1.0 / exponent)) };
        reflectance * seen
    }

    /// What is seen through a surface.
    #[allow(
        clippy::too_many_arguments,
        reason = "a ray passes a layer of a solid, in or out, with what is left of it"
    )]
    fn passing(
        &self,
        traced: &Traced<'s>,
        here: &PovHit<'s>,
        material: &'s PovMaterial,
        layer: &LayerAt<'_>,
        [left, fade]: [Spectrum; 2],
        is_inside: bool,
        record: &mut Record,
    ) -> Spectrum {
        let d = traced.ray.direction.normalize();
        let index = |inside: &Inside<'s>| inside.last().map_or(1.0, |solid| f64::from(solid.interior.ior));
        let from = index(&traced.inside);
        let mut inside = traced.inside.clone();
        if is_inside {
            inside.retain(|solid| !solid.is_of_solid(material));
        } else {
            inside.push(material);
        }
        let to = index(&inside);
        let eta = from / to;
        let n = layer.normal;
        let cosine = -n.dot(d);
        let under = 1.0 - eta * eta * (1.0 - cosine * cosine);
        let is_straight = (eta - 1.0).abs() < 1e-12;
        let is_total = under < 0.0 && !is_straight;
        let (direction, inside) = if is_straight {
            (d, inside)
        } else if is_total {
            // All light is mirrored, and layers filter nothing.
            (d + n * (2.0 * cosine), traced.inside.clone())
        } else {
            (d * eta + n * (eta * cosine - under.sqrt()), inside)
        };
        let next = Traced {
            ray: here.leave(direction.normalize()),
            inside,
            level: if is_straight { traced.level } else { traced.level + 1 },
            is_straight,
            // A transparency below 0 shows what is behind in negative.
            weight: traced.weight * gray(left.map(f32::abs)),
            is_mirrored: traced.is_mirrored || is_total,
            is_camera: traced.is_camera,
            gathers: traced.gathers,
            shift: traced.shift,
        };
        record.counts.bounce += 1;
        let seen = self.trace_straight(next, is_straight, record);
        if is_total { fade * seen } else { left * seen }
    }

    /// A ray that goes straight on counts as the same ray, but not without end.
    fn trace_straight(&self, mut next: Traced<'s>, is_straight: bool, record: &mut Record) -> Spectrum {
        if is_straight {
            next.weight *= 1.0 - 1.0 / MAX_SURFACES as f32;
        }
        self.trace(&next, record)
    }

    /// What comes through of a light, by its area.
    fn shadows(&self, here: &PovHit<'s>, light: &PovLight, record: &mut Record) -> Spectrum {
        match &light.area {
            Some(area) if area.counts != [1, 1] => self.mean_of_area(area, record, &mut |u, record| {
                self.shadow(here, light, light.place(u, here.surface.point), record)
            }),
            _ => self.shadow(here, light, light.from, record),
        }
    }

    /// The mean over the grid of an area of what is asked for at places in the unit square.
    fn mean_of_area(
        &self,
        area: &PovArea,
        record: &mut Record,
        at: &mut dyn FnMut(DVec2, &mut Record) -> Spectrum,
    ) -> Spectrum {
        let [n, m] = area.counts;
        let mut known: SmallVec<[Option<Spectrum>; 64]> = smallvec![None; (n * m) as usize];
        let mut corner = |u: u32, v: u32| {
            *known[(u * m + v) as usize].get_or_insert_with(|| at(DVec2::new(step(u, n), step(v, m)), record))
        };
        mean_of_grid(area.adaptive, [0, 0, n - 1, m - 1], 0, &mut corner)
    }

    /// What comes through to a point of a surface from a place of a light.
    fn shadow(&self, here: &PovHit<'s>, light: &PovLight, from: DVec3, record: &mut Record) -> Spectrum {
        let p = here.surface.point;
        let Some((towards, distance)) = light.towards(p, from) else { return Spectrum::WHITE };
        self.between(here.leave(towards), p + towards * distance, Inside::new(), light, record)
    }

    /// What comes through of a light from a target to where a ray begins that goes there, inside of some solids.
    fn between(
        &self,
        mut ray: Ray,
        target: DVec3,
        mut inside: Inside<'s>,
        light: &PovLight,
        record: &mut Record,
    ) -> Spectrum {
        record.counts.shadow += 1;
        let towards = ray.direction;
        let rest = (target - ray.origin).dot(towards);
        let mut first = match self.scene.pov_obstacle(&ray.with_range(NEAR, rest - NEAR)) {
            PovObstacle::Opaque => return Spectrum::BLACK,
            PovObstacle::Nothing => return self.media_passing(&inside, &ray, rest, light),
            PovObstacle::Clear(hit) => Some(hit),
        };
        let mut left = Spectrum::WHITE;
        for _ in 0..MAX_SURFACES {
            let rest = (target - ray.origin).dot(towards);
            let further = || self.scene.closest(&ray.with_range(0.0, rest - NEAR));
            let Some(hit) = first.take().or_else(further) else {
                return left * self.media_passing(&inside, &ray, rest, light);
            };
            let there = self.scene.pov_hit(&ray, &hit);
            let Some(material) = there.material else { return left };
            let step = (there.surface.point - ray.origin).length();
            left *= self.media_passing(&inside, &ray, step, light);
            if !material.visibility.no_shadow {
                let smooth = there.smooth;
                let normal = if smooth.dot(towards) > 0.0 { -smooth } else { smooth };
                let eye = Eye {
                    normal,
                    direction: -towards,
                    uv: material.surface_uv(there.surface.point, there.uv),
                };
                // A ray that begins at a surface may begin inside of a solid.
                let is_inside = !there.front || inside.iter().any(|solid| solid.is_of_solid(material));
                let mut passes = Spectrum::BLACK;
                let asked = if material.interior.caustics == 0.0 { Asked::Colours } else { Asked::Normals };
                for (share, layers) in &material.stacks(there.surface.point, &eye, there.front, asked) {
                    let mut stack = layers
                        .iter()
                        .fold(Spectrum::splat(*share), |left, layer| left * layer.colour.passing());
                    if material.interior.caustics != 0.0
                        && let Some(top) = layers.last()
                    {
                        // Light gathers behind bumps, too.
                        let focus = CAUSTICS * material.interior.caustics;
                        stack *= 1.0 + (top.normal.dot(towards).abs() as f32).power(focus);
                    }
                    passes += stack;
                }
                left *= passes;
                if is_inside {
                    left *= material.interior.transmittance(step as f32);
                    inside.retain(|solid| !solid.is_of_solid(material));
                } else {
                    inside.push(material);
                }
                if left.max_component() < self.world.adc_bailout {
                    return Spectrum::BLACK;
                }
            }
            ray = there.leave(towards);
        }
        left
    }
}

/// The mean over a part of a grid, as its quarters where its corners differ.
fn mean_of_grid(
    adaptive: u32,
    [u1, v1, u2, v2]: [u32; 4],
    level: u32,
    corner: &mut dyn FnMut(u32, u32) -> Spectrum,
) -> Spectrum {
    let corners = [corner(u1, v1), corner(u2, v1), corner(u1, v2), corner(u2, v2)];
    let differ = |a: usize, b: usize| (corners[a] - corners[b]).map(f32::abs).max_component() > 0.1;
    let is_uneven = differ(0, 1) || differ(2, 3) || differ(0, 2) || differ(1, 3);
    let is_wide = u2 - u1 > 1 || v2 - v1 > 1;
    if !is_wide || !(level < adaptive || is_uneven) {
        return corners.into_iter().sum::<Spectrum>() * 0.25;
    }
    let (ul, uh) = ((u1 + u2) / 2, (u1 + u2).div_ceil(2));
    let (vl, vh) = ((v1 + v2) / 2, (v1 + v2).div_ceil(2));
    let mut sum = Spectrum::BLACK;
    for quarter in [[u1, v1, ul, vl], [uh, v1, u2, vl], [u1, vh, ul, v2], [uh, vh, u2, v2]] {
        sum += mean_of_grid(adaptive, quarter, level + 1, corner);
    }
    sum * 0.25
}

/// The position of one of several points between 0 and 1; a single one is in the middle.
fn step(i: u32, count: u32) -> f64 {
    if count <= 1 { 0.5 } else { f64::from(i) / f64::from(count - 1) }
}

fn gray(c: Spectrum) -> f32 {
    0.297 * c.r + 0.589 * c.g + 0.114 * c.b
}

/// How highlights and mirrors of metal are tinted, at a cosine.
fn metallic(amount: f32, cosine: f64, colour: Spectrum) -> Spectrum {
    if amount == 0.0 {
        return Spectrum::WHITE;
    }
    let x = cosine.clamp(-1.0, 1.0).abs().arc_cosine() / FRAC_PI_2;
    let m = (0.014_567_225 / (x - 1.12).powi(2) - 0.011_612_903).clamp(0.0, 1.0);
    Spectrum::WHITE + (colour - Spectrum::WHITE) * (amount * (1.0 - m) as f32)
}
