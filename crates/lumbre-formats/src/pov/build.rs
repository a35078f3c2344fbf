//! From the objects of a scene to a description of it.

use std::collections::HashMap;
use std::rc::Rc;
use std::sync::Arc;

use lumbre_geometry::Shape;
use lumbre_image::{Image, Rgb};
use lumbre_math::{DVec3, Elementary, Transform, Vec2};
use lumbre_scene::pov::{PovRadiosity, PovWorld};
use lumbre_scene::{
    AreaLightDesc, Boundary, EnvironmentDesc, EnvironmentMapping, FilterDesc, GeometryDesc, IntegratorDesc,
    IntegratorKind, LightDesc, MaterialId, MediumId, NamedMaterial, SceneDesc, ShapeDesc, UpAxis,
    WithoutLight,
};
use lumbre_shading::medium::{HomogeneousMedium, Medium};
use lumbre_shading::pov::{Interior, PovMaterial, Texture, TextureKind, UvForm};
use lumbre_shading::{Material, MaterialKind, Spectrum};

use super::camera::CameraStatement;
use super::objects::{Form, Object};
use super::solids::{Clipped, Leaf, Solid, leaves};
use super::textures::moved_interior;
use super::{Parser, Result};
use crate::Diagnostic;

/// A place as the bits of its map.
type MapBits = [u64; 12];

/// What makes two materials the same.
#[derive(PartialEq, Eq, Hash)]
struct Key {
    texture: usize,
    inside: usize,
    interior: usize,
    flags: [bool; 5],
    groups: Vec<u32>,
    global: bool,
}

/// The least number of samples per pixel of a camera with a lens, or with several rays for each pixel: the mean of
/// fewer is noise.
const MIN_BLUR_SAMPLES: u32 = 64;

/// A description that is being made.
struct Builder {
    scene: SceneDesc,
    materials: HashMap<Key, MaterialId>,
    /// Textures and interiors by whose addresses materials are told apart stay as long as that.
    kept: Vec<(Arc<Texture>, Option<Arc<Texture>>)>,
    gamma: f32,
    old_opacity: bool,
    default_texture: Arc<Texture>,
    groups: Vec<u32>,
    global: bool,
    group_count: u32,
    problems: Vec<String>,
    /// Interiors of objects that were moved by what they are part of: one for all surfaces of a solid.
    moved_interiors: HashMap<(usize, MapBits), (Arc<Interior>, Arc<Interior>)>,
    /// The media of interiors that fade light, by the addresses of these, which materials keep.
    fadings: HashMap<usize, MediumId>,
    /// Whether dispersion was said to be left out.
    has_dispersion: bool,
    /// Where the camera is, and what it is inside of.
    eye: DVec3,
    around_eye: Vec<Arc<PovMaterial>>,
}

impl Parser<'_, '_> {
    /// The description of the scene that was read.
    pub(super) fn build(mut self) -> Result<SceneDesc> {
        if !self.settings.has_version {
            self.diagnostics.push(Diagnostic::note("the scene has no #version: it counts as 3.62"));
        }
        let gamma = self.settings.gamma() as f32;
        let camera = self.camera.clone().unwrap_or(CameraStatement { ..self.default_camera.clone() });
        let mut builder = Builder {
            scene: SceneDesc::default(),
            materials: HashMap::new(),
            kept: Vec::new(),
            gamma,
            old_opacity: self.settings.version < 3.7,
            default_texture: self.defaults.texture(),
            groups: Vec::new(),
            global: true,
            group_count: 0,
            problems: Vec::new(),
            moved_interiors: HashMap::new(),
            fadings: HashMap::new(),
            has_dispersion: false,
            eye: camera.location,
            around_eye: Vec::new(),
        };
        for object in std::mem::take(&mut self.objects) {
            builder.object(&object);
        }
        for problem in std::mem::take(&mut builder.problems) {
            self.diagnostics.push(Diagnostic::warning(problem));
        }
        let mut scene = builder.scene;
        self.around(&mut scene, gamma, camera.location, builder.around_eye);
        match camera.camera() {
            Some(made) => {
                scene.sampler.spp = camera.samples().map(|samples| samples.max(MIN_BLUR_SAMPLES));
                scene.cameras.push(made);
            }
            None => return Err(Diagnostic::error("the axes of the camera lie in a plane").into()),
        }
        let (width, height) = (self.options.width, self.options.height);
        let aspect = camera.aspect();
        scene.film.width = Some(width);
        let is_usual = (aspect - 4.0 / 3.0).abs() < 0.01;
        let fitting = (f64::from(width) / aspect).rounded().clamp(1.0, 65_536.0) as u32;
        scene.film.height = Some(if is_usual { height } else { fitting });
        scene.filter = FilterDesc::Box { radius: Vec2::splat(0.5) };
        scene.integrator = IntegratorDesc { kind: IntegratorKind::Pov, ..IntegratorDesc::default() };
        scene.without_light = WithoutLight::Dark;
        scene.up = UpAxis::Y;
        Ok(scene)
    }

    /// Background, sky and fog.
    fn around(&self, scene: &mut SceneDesc, gamma: f32, eye: DVec3, around_eye: Vec<Arc<PovMaterial>>) {
        let settings = &self.settings;
        let background = self.background.map_or(Spectrum::BLACK, |[r, g, b]| Spectrum::new(r, g, b));
        let is_filled = |named: &NamedMaterial| matches!(&named.material.kind, MaterialKind::Pov(material) if !material.interior.media.is_empty());
        let has_media =
            !self.fogs.is_empty() || !self.air.is_empty() || scene.materials.iter().any(is_filled);
        let world = PovWorld {
            has_media,
            ambient_light: settings.ambient_light,
            max_trace_level: settings.max_trace_level,
            adc_bailout: settings.adc_bailout,
            gamma,
            background,
            sky: self.sky.clone(),
            old_sky: settings.version < 3.7,
            radiosity: settings
                .radiosity
                .map(|radiosity| PovRadiosity { has_ambient: settings.version < 3.7, ..radiosity }),
            fogs: self.fogs.clone(),
            irid_wavelength: settings.irid_wavelength,
            air: self.air.clone(),
            eye,
            around_eye,
        };
        let light = if world.sky.is_empty() {
            (!background.is_black()).then(|| LightDesc::Infinite {
                world_from_light: Transform::IDENTITY,
                radiance: linear(background, gamma),
                image: None,
            })
        } else {
            Some(LightDesc::Infinite {
                world_from_light: Transform::IDENTITY,
                radiance: Rgb::new(1.0, 1.0, 1.0),
                image: Some(sky_image(&world)),
            })
        };
        scene.lights.extend(light);
        scene.pov = Some(Arc::new(world));
    }
}

/// A colour of the working space as linear light.
fn linear(c: Spectrum, gamma: f32) -> Rgb {
    let c = c.map(|c| c.max(0.0).power(gamma));
    Rgb::new(c.r, c.g, c.b)
}

/// The sky by longitude and latitude, for path tracers.
fn sky_image(world: &PovWorld) -> EnvironmentDesc {
    const WIDTH: u32 = 256;
    const HEIGHT: u32 = 128;
    let mut pixels = Vec::with_capacity((WIDTH * HEIGHT) as usize);
    for row in 0..HEIGHT {
        for column in 0..WIDTH {
            use std::f64::consts::{PI, TAU};
            let theta = PI * (f64::from(row) + 0.5) / f64::from(HEIGHT);
            // The centre is towards +x, and three quarters of the width towards +y.
            let phi = TAU * ((f64::from(column) + 0.5) / f64::from(WIDTH) - 0.5);
            let ((st, ct), (sp, cp)) = (theta.sine_cosine(), phi.sine_cosine());
            let direction = DVec3::new(st * cp, st * sp, ct);
            pixels.push(linear(world.sky_colour(direction), world.gamma));
        }
    }
    let image = Image::from_pixels(WIDTH, HEIGHT, pixels)
        .unwrap_or_else(|| Image::filled(1, 1, Rgb::new(0.0, 0.0, 0.0)));
    EnvironmentDesc { image: Arc::new(image), mapping: EnvironmentMapping::LatitudeLongitude }
}

impl Builder {
    fn object(&mut self, object: &Rc<Object>) {
        self.placed(object, &Transform::IDENTITY);
    }

    fn placed(&mut self, object: &Rc<Object>, parent: &Transform) {
        if let Form::LightGroup(parts, global) = &object.form {
            self.light_group(parts, *global, &(*parent * object.transform));
            return;
        }
        let mut found: Vec<(Leaf<'_>, Vec<&Object>)> = Vec::new();
        leaves(object, parent, &[], false, &mut Vec::new(), &mut |leaf, around| {
            found.push((leaf, around.to_vec()))
        });
        for (leaf, around) in found {
            self.leaf(&leaf, &around, parent);
        }
    }

    fn light_group(&mut self, parts: &[Rc<Object>], global: bool, map: &Transform) {
        self.group_count += 1;
        let outer_global = self.global;
        self.groups.push(self.group_count);
        self.global = outer_global && global;
        for part in parts {
            self.placed(part, map);
        }
        self.groups.pop();
        self.global = outer_global;
    }

    fn leaf(&mut self, leaf: &Leaf<'_>, around: &[&Object], parent: &Transform) {
        match &leaf.object.form {
            Form::Nothing => return,
            Form::Light(statement) => {
                let outside = leaf.map * leaf.object.transform.inverse();
                let moved = statement.moved(&outside);
                let mut light = moved.light;
                light.group = self.groups.last().copied();
                light.gamma = self.gamma;
                self.scene.lights.push(LightDesc::Pov(Arc::new(light)));
                if let Some(object) = moved.looks_like {
                    self.placed(&Rc::new(*object), &Transform::IDENTITY);
                }
                return;
            }
            Form::LightGroup(parts, global) => {
                if !leaf.regions.is_empty() {
                    self.problems.push("a light_group in CSG, or clipped, is shown whole".to_owned());
                }
                self.light_group(parts, *global, &leaf.map);
                return;
            }
            _ => {}
        }
        let material = self.material(leaf, around, parent);
        let Some((geometry, map, is_around_eye)) = self.geometry(leaf) else { return };
        let has_interior = around.iter().chain([&leaf.object]).any(|object| object.interior.is_some());
        let id = self.material_id(material, has_interior);
        if is_around_eye
            && let MaterialKind::Pov(material) = &self.scene.materials[id.0 as usize].material.kind
            && !self.around_eye.iter().any(|known| known.is_of_solid(material))
        {
            self.around_eye.push(Arc::clone(material));
        }
        // What is infinite cannot be sampled as a light.
        let is_plane = matches!(leaf.object.form, Form::Plane(..));
        let area_light = if is_plane { None } else { self.glow(id) };
        // What has no inside cannot be filled.
        let is_open = matches!(&leaf.object.form, Form::Mesh(_, None));
        let boundary = if is_open { None } else { self.fading(id) };
        let index = self.scene.shapes.len() as u32;
        self.scene.shapes.push(ShapeDesc {
            index,
            geometry,
            world_from_object: map,
            reverse_orientation: false,
            material: Some(id),
            boundary,
            area_light,
            alpha: None,
        });
    }

    /// The surface of a leaf with its place, and whether the camera is inside of it.
    fn geometry(&mut self, leaf: &Leaf<'_>) -> Option<(GeometryDesc, Transform, bool)> {
        if let Form::Mesh(mesh, enclosure) = &leaf.object.form {
            if mesh.triangles.is_empty() {
                return None;
            }
            if leaf.regions.is_empty() && !leaf.is_flipped {
                let eye = leaf.map.inverse_point(self.eye);
                let is_around_eye = enclosure.as_ref().is_some_and(|enclosure| enclosure.contains(eye));
                return Some((GeometryDesc::Mesh(Arc::clone(mesh)), leaf.map, is_around_eye));
            }
        }
        let solid = match Solid::new(&leaf.object.form, &leaf.map) {
            Ok(Some(solid)) => solid,
            Ok(None) => return None,
            Err(error) => {
                self.problems.push(format!("an object is not shown: {error}"));
                return None;
            }
        };
        let is_around_eye = solid.contains(self.eye) != leaf.is_flipped
            && leaf.regions.iter().all(|region| region.contains(self.eye));
        match solid {
            Solid::Exact { surface, .. } if leaf.regions.is_empty() => {
                let shape: Shape = surface.shape().clone();
                Some((GeometryDesc::Exact(shape), surface.world_from_object(), is_around_eye))
            }
            Solid::Implicit { surface, world_from_object } if leaf.regions.is_empty() => {
                Some((GeometryDesc::Custom(Arc::new(surface)), world_from_object, is_around_eye))
            }
            solid => {
                let clipped = Clipped::new(Arc::new(solid), leaf.regions.clone(), leaf.is_flipped);
                Some((GeometryDesc::Custom(Arc::new(clipped)), Transform::IDENTITY, is_around_eye))
            }
        }
    }

    fn material(&mut self, leaf: &Leaf<'_>, around: &[&Object], parent: &Transform) -> PovMaterial {
        // From the object itself outwards, the first that has one.
        let mut maps = vec![*parent];
        for object in around {
            let last = *maps.last().unwrap_or(&Transform::IDENTITY);
            maps.push(last * object.transform);
        }
        let chain: Vec<(&Object, &Transform)> =
            around.iter().copied().chain([leaf.object]).zip(&maps).collect();
        let any = |of: &dyn Fn(&Object) -> bool| chain.iter().any(|(object, _)| of(object));
        let uses_uv = any(&|object| object.uv_mapping);
        let placed = |texture: &Arc<Texture>, map: &Transform| {
            if uses_uv || map.is_identity() { Arc::clone(texture) } else { texture.carried(&Arc::new(*map)) }
        };
        let from = |of: &dyn Fn(&Object) -> Option<Arc<Texture>>| {
            chain.iter().rev().find_map(|(object, map)| Some(placed(&of(object)?, map)))
        };
        let texture = from(&|object| object.texture.clone());
        let interior_texture = from(&|object| object.interior_texture.clone());
        let interior = chain.iter().rev().find_map(|(object, map)| Some((object.interior.clone()?, **map)));
        let mut texture = texture.unwrap_or_else(|| Arc::clone(&self.default_texture));
        if uses_uv {
            texture = mapped(&texture);
        }
        let uv = match &leaf.object.form {
            Form::Sphere(center, radius) => (UvForm::Sphere(*center, *radius), Some(Arc::new(leaf.map))),
            Form::Cuboid(low, high) => {
                (UvForm::Cuboid(low.min(*high), low.max(*high)), Some(Arc::new(leaf.map)))
            }
            Form::Torus(major, _) => (UvForm::Torus(*major), Some(Arc::new(leaf.map))),
            Form::Mesh(..) | Form::Heights(_) => (UvForm::Surface, None),
            Form::Swept(swept) if swept.is_turned() => (UvForm::Surface, None),
            _ => (UvForm::Plane, None),
        };
        let interior = match interior {
            Some((interior, map)) => {
                if interior.dispersion != 1.0 && !std::mem::replace(&mut self.has_dispersion, true) {
                    self.problems.push("dispersion is not rendered".to_owned());
                }
                self.moved_interior(interior, &map)
            }
            None => Arc::new(Interior::DEFAULT),
        };
        let visibility = lumbre_shading::pov::Visibility {
            no_shadow: any(&|object| object.visibility.no_shadow),
            no_image: any(&|object| object.visibility.no_image),
            no_reflection: any(&|object| object.visibility.no_reflection),
        };
        PovMaterial {
            texture,
            interior_texture,
            interior,
            visibility,
            double_illuminate: any(&|object| object.double_illuminate),
            hollow: any(&|object| object.hollow),
            light_groups: self.groups.clone().into(),
            global_lights: self.global,
            uv,
            gamma: self.gamma,
            old_opacity: self.old_opacity,
        }
    }

    /// An interior where its object is: the same one for all surfaces of that object.
    fn moved_interior(&mut self, interior: Arc<Interior>, map: &Transform) -> Arc<Interior> {
        if interior.media.is_empty() || map.is_identity() {
            return interior;
        }
        let bits = map.affine().to_cols_array().map(f64::to_bits);
        let key = (Arc::as_ptr(&interior) as usize, bits);
        let made = || (Arc::clone(&interior), moved_interior(Arc::clone(&interior), &Arc::new(*map)));
        Arc::clone(&self.moved_interiors.entry(key).or_insert_with(made).1)
    }

    fn material_id(&mut self, material: PovMaterial, has_interior: bool) -> MaterialId {
        let is_mapped = matches!(&material.texture.kind, TextureKind::Plain(layer) if layer.pigment.uniform().is_none())
            && material.uv.1.is_some();
        let key = Key {
            texture: Arc::as_ptr(&material.texture) as usize,
            inside: material.interior_texture.as_ref().map_or(0, |texture| Arc::as_ptr(texture) as usize),
            interior: if has_interior { Arc::as_ptr(&material.interior) as usize } else { 0 },
            flags: [
                material.visibility.no_shadow,
                material.visibility.no_image,
                material.visibility.no_reflection,
                material.double_illuminate,
                material.hollow,
            ],
            groups: material.light_groups.to_vec(),
            global: material.global_lights,
        };
        if !is_mapped && let Some(id) = self.materials.get(&key) {
            return *id;
        }
        let id = MaterialId(self.scene.materials.len() as u32);
        self.kept.push((Arc::clone(&material.texture), material.interior_texture.clone()));
        if !is_mapped {
            self.materials.insert(key, id);
        }
        let material = Material::new(MaterialKind::Pov(Arc::new(material)));
        self.scene.materials.push(NamedMaterial { name: None, material: Arc::new(material) });
        id
    }

    /// What solids that fade light are filled with for path tracers: a medium that absorbs as much at the distance of
    /// fading, if the solid is not to be seen as clear.
    fn fading(&mut self, id: MaterialId) -> Option<Boundary> {
        let MaterialKind::Pov(material) = &self.scene.materials[id.0 as usize].material.kind else {
            return None;
        };
        let interior = &material.interior;
        let distance = interior.fade_distance;
        if distance <= 0.0 {
            return None;
        }
        let key = Arc::as_ptr(interior) as usize;
        let known = self.fadings.get(&key).copied();
        let inside = known.unwrap_or_else(|| {
            let left = interior.transmittance(distance).map(|c| c.clamp(1e-6, 1.0).power(self.gamma));
            let medium = HomogeneousMedium {
                extinction: left.map(|c| -c.logarithm() / distance),
                albedo: Spectrum::BLACK,
                asymmetry: 0.0,
            };
            let medium = Medium::Homogeneous { medium, glow: Spectrum::BLACK, spectra: None };
            let made = MediumId(self.scene.media.len() as u32);
            self.scene.media.push(Arc::new(medium));
            self.fadings.insert(key, made);
            made
        });
        Some(Boundary { inside: Some(inside), outside: None })
    }

    /// The light that a surface gives to path tracers: its emission, and ambient light where it scatters next to
    /// nothing.
    fn glow(&self, id: MaterialId) -> Option<AreaLightDesc> {
        let MaterialKind::Pov(material) = &self.scene.materials[id.0 as usize].material.kind else {
            return None;
        };
        let TextureKind::Plain(layer) = &material.texture.kind else { return None };
        let colour = layer.pigment.uniform()?;
        let finish = &layer.finish;
        let mut strength = finish.emission;
        if finish.diffuse < 0.05 && finish.ambient.max_component() > 0.3 {
            strength += finish.ambient;
        }
        let radiance = linear(colour.rgb * strength * material.opacity(colour).max(0.0), self.gamma);
        let is_dark = radiance.r <= 0.0 && radiance.g <= 0.0 && radiance.b <= 0.0;
        (!is_dark).then_some(AreaLightDesc {
            radiance,
            image: None,
            by_vertices: false,
            two_sided: true,
            power: None,
            spectrum: None,
        })
    }
}

/// A texture in the coordinates of its surface.
fn mapped(texture: &Arc<Texture>) -> Arc<Texture> {
    Arc::new(Texture { uv: true, ..(**texture).clone() })
}
