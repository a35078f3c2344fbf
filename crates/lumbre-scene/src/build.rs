//! From a description to a scene.

use std::collections::HashMap;
use std::sync::Arc;

use lumbre_geometry::{Aabb, BilinearPatch, PlacedShape, Shape};
use lumbre_kernel::{Accel, BuildOptions, Geometry, GeometryKind, Placement, TriangleMesh};
use lumbre_math::{DVec3, Elementary, Transform};
use lumbre_shading::{Material, MaterialKind, Spectrum};

use crate::freeing::freeing;
use crate::light::environment::first_not_finite;
use crate::light::{
    DiscLight, DistantLight, Environment, GoniometricLight, Light, Lighting, MeshLight, MovingLight,
    PlacedLight, PointLight, PortalLight, ProjectionLight, ShapeLight, SpotLight, UniformLight,
    portal::PortalError, power,
};
use crate::light_colour::LightColour;
use crate::media::{self, Boundaries, Media};
use crate::mesh::{self, QuadOrder};
use crate::object_order::inside_out;
use crate::placed_bounds::{mesh_bounds, moved, near};
use crate::scene::SceneTraits;
use crate::specular::Specular;
use crate::surface::{ColourRamp, Form, SurfaceEntry};
use crate::{
    AreaLightDesc, BuildError, BuildWarning, Camera, Emission, FilmDesc, GeometryDesc, GroundPlane,
    InstanceDesc, LightDesc, LightId, MaterialId, MeshDesc, NamedMaterial, ObjectDesc, Scene, SceneDesc,
    ShapeDesc, SurfaceTable, camera, csg, custom, extent, framing, ground, stage, studio,
};

impl Scene {
    /// Resolves a description: one tree of everything, and lights ready for sampling. A description without
    /// cameras gets one that frames everything, one without any light what [`SceneDesc::without_light`]
    /// specifies.
    ///
    /// # Errors
    /// [`BuildError`], naming the shape, camera or light at fault.
    pub fn build(mut desc: SceneDesc) -> Result<Self, BuildError> {
        if stage::wants_studio(&desc) {
            desc.lights.push(studio::light(desc.up, 0.0));
        }
        let ground = ground::lay(&mut desc)?;
        let uses_media = media::check(&desc)?;
        let separated = media::split(&mut desc);
        let specular = Specular::of(&desc);
        let SceneDesc {
            cameras,
            film,
            filter,
            sampler,
            integrator,
            materials,
            media,
            shapes,
            objects,
            instances,
            lights,
            without_light: _,
            up,
            ground: _,
            up_is_guessed: _,
            pov,
            listing: _,
        } = desc;
        camera::check(&cameras)?;
        let mut builder = Builder { materials: numbered(materials), ..Builder::default() };

        let is_moving = |i: &InstanceDesc| matches!(i.world_from_object, Placement::Moving(_));
        let deforms = |shape: &ShapeDesc| matches!(&shape.geometry, GeometryDesc::Mesh(mesh) | GeometryDesc::BilinearMesh(mesh) if mesh.motion.is_some());
        let moves = objects.iter().flat_map(|object| &object.instances).chain(&instances).any(is_moving)
            || objects.iter().flat_map(|object| &object.shapes).chain(&shapes).any(deforms)
            || lights.iter().any(|light| matches!(light.bare(), LightDesc::Moving { .. }));
        let boundaries = separated.map(|separated| builder.boundaries(separated, &instances)).transpose()?;
        let objects = builder.objects(objects, &instances)?;
        let accel = Arc::new(builder.tree(shapes, &instances, &objects)?);
        let beyond = boundaries.as_ref().map_or(Aabb::EMPTY, |boundaries| boundaries.accel.bounds());
        let bounds = accel.bounds().union(beyond);

        let cameras = if cameras.is_empty() {
            let aspect = film.width.zip(film.height).map_or(1.0, |(w, h)| f64::from(w) / f64::from(h));
            let corners = |visit: &mut dyn FnMut(DVec3)| {
                if !bounds.is_empty() {
                    extent::corners(&bounds).for_each(visit);
                }
            };
            vec![framing::still(&corners, up, aspect)]
        } else {
            cameras
        };
        let glows = uses_media && media.iter().any(|medium| medium.glows());
        if lights.is_empty() && !glows && !builder.entries.iter().any(SurfaceEntry::is_emissive) {
            builder.warnings.push(BuildWarning::NoLight);
        }
        builder.place_lights(lights)?;
        builder.entries.shrink_to_fit();
        let entries = Arc::new(builder.entries);
        let lighting = Lighting::new(builder.lights, builder.light_colours, &entries, &bounds);
        let has_cutouts = entries.iter().any(SurfaceEntry::has_cutouts);
        let is_transmissive = entries.iter().any(SurfaceEntry::is_transmissive);
        let has_delta_transmission = entries.iter().any(SurfaceEntry::has_delta_transmission);
        let has_solids = entries.iter().any(SurfaceEntry::may_be_solid);
        let has_one_sided = entries.iter().any(SurfaceEntry::is_one_sided_anywhere);
        let is_textured = entries.iter().any(SurfaceEntry::looks_up_anywhere);
        let all_stop_pov_light = entries.iter().all(SurfaceEntry::stops_pov_light_everywhere);
        Ok(Self {
            accel,
            cameras,
            film,
            filter,
            sampler,
            integrator,
            pov,
            bounds,
            traits: SceneTraits {
                has_cutouts,
                is_transmissive,
                has_delta_transmission,
                has_solids,
                has_one_sided,
                has_instances: !objects.is_empty(),
                moves,
                is_textured,
                all_stop_pov_light,
            },
            specular_spheres: specular.spheres(&bounds),
            ground: ground.map(|desc| GroundPlane::new(desc, lighting.lights())),
            lighting,
            tables: Arc::new(SurfaceTable::new(&entries)),
            entries,
            media: Media {
                media: if uses_media { media } else { vec![] },
                boundaries: boundaries.map(Arc::new),
            },
            warnings: builder.warnings,
        })
    }

    /// The same surfaces under other lights, on the film of other cameras. The tree and all surface data are shared,
    /// and lights that are surfaces stay.
    ///
    /// # Errors
    /// [`BuildError`], naming the camera or light at fault, or if there is no camera.
    pub fn relit(
        &self,
        cameras: Vec<Camera>,
        film: FilmDesc,
        lights: Vec<LightDesc>,
    ) -> Result<Self, BuildError> {
        if cameras.is_empty() {
            return Err(BuildError::NoSuchCamera { position: 0, count: 0 });
        }
        cameras.iter().try_for_each(|camera| self.check_camera(camera))?;
        // Surfaces refer to their lights by index.
        let surfaces = self.lights().iter().take_while(|light| light.is_surface()).cloned().collect();
        let warnings = self.warnings.iter().filter(|warning| !warning.is_of_lights()).cloned().collect();
        let mut builder = Builder { lights: surfaces, warnings, ..Builder::default() };
        let glows = self.media.media.iter().any(|medium| medium.glows());
        if lights.is_empty() && !glows && !self.entries.iter().any(SurfaceEntry::is_emissive) {
            builder.warnings.push(BuildWarning::NoLight);
        }
        let moves =
            self.traits.moves || lights.iter().any(|light| matches!(light.bare(), LightDesc::Moving { .. }));
        builder.place_lights(lights)?;
        let lighting = Lighting::new(builder.lights, builder.light_colours, &self.entries, &self.bounds);
        let ground = self.ground.as_ref().map(|ground| GroundPlane::new(ground.desc(), lighting.lights()));
        Ok(Self {
            accel: Arc::clone(&self.accel),
            entries: Arc::clone(&self.entries),
            tables: Arc::clone(&self.tables),
            media: self.media.clone(),
            lighting,
            cameras,
            film,
            filter: self.filter,
            sampler: self.sampler,
            integrator: self.integrator,
            pov: self.pov.clone(),
            bounds: self.bounds,
            ground,
            specular_spheres: self.specular_spheres.clone(),
            warnings: builder.warnings,
            traits: SceneTraits { moves, ..self.traits },
        })
    }

    /// Whether both scenes share one tree: one is [`Scene::relit`] from the other, or both are from a third.
    pub fn shares_tree(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.accel, &other.accel)
    }
}

/// The placement of a tree's shapes, as far as their light is concerned.
#[derive(Clone, Debug)]
enum Standing {
    /// In the world itself.
    World,
    /// In an object that is placed once in the world, here.
    Once(Placement),
    /// In an object with several placements, or one inside another object.
    Anywhere,
}

impl Standing {
    /// The factor of areas from the tree to the world: exact for similarities, else an approximate mean; for a
    /// moving object, at the first key.
    fn area_factor(&self) -> f64 {
        let Self::Once(placement) = self else { return 1.0 };
        let first = extent::places(placement)[0];
        first.determinant().abs().cube_root().powi(2)
    }
}

/// Materials, each with the number of the first that is the same one: a material may be listed several times.
fn numbered(materials: Vec<NamedMaterial>) -> Vec<(MaterialId, Arc<Material>)> {
    let mut firsts = HashMap::new();
    let numbers = (0..).zip(materials).map(|(number, NamedMaterial { material, .. })| {
        let first = *firsts.entry(Arc::as_ptr(&material)).or_insert(MaterialId(number));
        (first, material)
    });
    numbers.collect()
}

/// The state of building trees.
#[derive(Default)]
pub(crate) struct Builder {
    pub materials: Vec<(MaterialId, Arc<Material>)>,
    pub entries: Vec<SurfaceEntry>,
    lights: Vec<Light>,
    /// One for each light.
    light_colours: Vec<LightColour>,
    pub warnings: Vec<BuildWarning>,
}

impl Builder {
    /// The trees of all objects, nested ones first. `in_world` are the instances in the world. Objects that are
    /// not placed have an empty tree.
    fn objects(
        &mut self,
        objects: Vec<ObjectDesc>,
        in_world: &[InstanceDesc],
    ) -> Result<Vec<Arc<Accel>>, BuildError> {
        let order = inside_out(&objects)?;
        let mut uses = vec![0_usize; objects.len()];
        for instance in objects.iter().flat_map(|object| &object.instances).chain(in_world) {
            if let Some(uses) = uses.get_mut(instance.object.0 as usize) {
                *uses += 1;
            }
        }
        let mut standing = vec![Standing::Anywhere; objects.len()];
        for instance in in_world {
            let object = instance.object.0 as usize;
            if uses.get(object) == Some(&1) {
                standing[object] = Standing::Once(instance.world_from_object.clone());
            }
        }
        let mut is_placed = vec![false; objects.len()];
        for instance in in_world {
            if let Some(is_placed) = is_placed.get_mut(instance.object.0 as usize) {
                *is_placed = true;
            }
        }
        for &outer in order.iter().rev() {
            if is_placed[outer] {
                objects[outer].instances.iter().for_each(|inner| is_placed[inner.object.0 as usize] = true);
            }
        }
        let mut objects: Vec<Option<ObjectDesc>> = objects.into_iter().map(Some).collect();
        let mut trees: Vec<Option<Arc<Accel>>> = vec![None; objects.len()];
        let nothing = Arc::new(Accel::build(vec![], &BuildOptions::default())?);
        for position in order {
            let Some(object) = objects[position].take() else { continue };
            if !is_placed[position] {
                trees[position] = Some(nothing.clone());
                continue;
            }
            let inner = |trees: &[Option<Arc<Accel>>], i: &InstanceDesc| trees[i.object.0 as usize].clone();
            let built: Vec<Arc<Accel>> = object.instances.iter().filter_map(|i| inner(&trees, i)).collect();
            let tree = self.tree_of(object.shapes, &object.instances, &built, &standing[position])?;
            trees[position] = Some(Arc::new(tree));
        }
        Ok(trees.into_iter().flatten().collect())
    }

    /// The tree of shapes that only separate media, and of the objects that contain such shapes.
    fn boundaries(
        &mut self,
        (shapes, objects): (Vec<ShapeDesc>, Vec<ObjectDesc>),
        instances: &[InstanceDesc],
    ) -> Result<Boundaries, BuildError> {
        let mut own = Self { materials: self.materials.clone(), ..Self::default() };
        let objects = own.objects(objects, instances)?;
        let accel = Arc::new(own.tree(shapes, instances, &objects)?);
        self.warnings.extend(own.warnings);
        Ok(Boundaries { accel, entries: own.entries })
    }

    /// The tree of the world, whose instances refer to the objects.
    fn tree(
        &mut self,
        shapes: Vec<ShapeDesc>,
        instances: &[InstanceDesc],
        objects: &[Arc<Accel>],
    ) -> Result<Accel, BuildError> {
        let find = |i: &InstanceDesc| {
            objects
                .get(i.object.0 as usize)
                .cloned()
                .ok_or(BuildError::NoSuchObject { object: i.object.0, count: objects.len() })
        };
        let accels = instances.iter().map(find).collect::<Result<Vec<_>, _>>()?;
        self.tree_of(shapes, instances, &accels, &Standing::World)
    }

    fn tree_of(
        &mut self,
        shapes: Vec<ShapeDesc>,
        instances: &[InstanceDesc],
        accels: &[Arc<Accel>],
        standing: &Standing,
    ) -> Result<Accel, BuildError> {
        let origin = origin(&shapes, instances, accels);
        let mut geometries = Vec::with_capacity(shapes.len() + instances.len());
        self.entries.reserve(shapes.len());
        for shape in freeing(shapes) {
            self.shape(shape, origin, standing, &mut geometries)?;
        }
        for ((id, instance), accel) in (0..).zip(instances).zip(accels) {
            let kind = GeometryKind::Instance(accel.instance(instance.world_from_object.clone()));
            geometries.push(Geometry { id, kind });
        }
        Ok(Accel::build(geometries, &BuildOptions::default())?)
    }

    fn shape(
        &mut self,
        desc: ShapeDesc,
        origin: DVec3,
        standing: &Standing,
        geometries: &mut Vec<Geometry>,
    ) -> Result<(), BuildError> {
        let mut entry = self.entry(&desc)?;
        let is_csg = matches!(desc.geometry, GeometryDesc::Csg(_));
        let area_light = if is_csg { None } else { self.wanted_light(&desc, &entry) };
        match desc.geometry {
            GeometryDesc::Exact(shape) => {
                let placed = PlacedShape::new(shape, desc.world_from_object);
                self.exact(entry, placed, area_light, standing, geometries)?;
            }
            GeometryDesc::Coloured(coloured) => {
                entry.form = Form::Coloured(Box::new(ColourRamp::new(&coloured, &desc.world_from_object)));
                let placed = PlacedShape::new(coloured.shape, desc.world_from_object);
                self.exact(entry, placed, area_light, standing, geometries)?;
            }
            GeometryDesc::Mesh(mesh) => {
                let order = QuadOrder::Around;
                self.mesh(
                    entry,
                    mesh,
                    order,
                    &desc.world_from_object,
                    origin,
                    area_light,
                    standing,
                    geometries,
                )?;
            }
            GeometryDesc::BilinearMesh(mesh) => {
                let order = QuadOrder::Patch;
                self.mesh(
                    entry,
                    mesh,
                    order,
                    &desc.world_from_object,
                    origin,
                    area_light,
                    standing,
                    geometries,
                )?;
            }
            GeometryDesc::Csg(csg) => {
                let placement = desc.world_from_object;
                let form = csg::build(self, desc.index, csg, &placement, desc.reverse_orientation)?;
                if form.leaves.iter().any(SurfaceEntry::is_emissive) {
                    self.warnings.push(BuildWarning::UnsampledLight { shape: desc.index });
                }
                let placed = csg::shape_of(&form);
                entry.form = Form::Csg(Arc::new(form));
                self.push(entry, geometries, GeometryKind::Shape(placed))?;
            }
            GeometryDesc::Curves(curves) => {
                if let Some(light) = area_light {
                    let growth = desc.world_from_object.determinant().abs().cube_root().powi(2);
                    entry.emission =
                        Some(emission(light, || standing.area_factor() * growth * curves.area()));
                    self.warnings.push(BuildWarning::UnsampledLight { shape: desc.index });
                }
                entry.form = Form::Curves(curves.clone(), Box::new(desc.world_from_object));
                let placed = custom::placed(curves, desc.world_from_object);
                self.push(entry, geometries, GeometryKind::Custom(placed))?;
            }
            GeometryDesc::Custom(geometry) => {
                if let Some(light) = area_light {
                    if light.power.is_some() {
                        return Err(BuildError::LightWithoutArea { shape: desc.index });
                    }
                    entry.emission = Some(emission(light, || 0.0));
                    self.warnings.push(BuildWarning::UnsampledLight { shape: desc.index });
                }
                entry.form = Form::Custom;
                let placed = custom::placed(geometry, desc.world_from_object);
                self.push(entry, geometries, GeometryKind::Custom(placed))?;
            }
        }
        Ok(())
    }

    fn exact(
        &mut self,
        mut entry: SurfaceEntry,
        placed: PlacedShape,
        area_light: Option<AreaLightDesc>,
        standing: &Standing,
        geometries: &mut Vec<Geometry>,
    ) -> Result<(), BuildError> {
        if area_light.is_some() && placed.bounds().is_none() {
            return Err(BuildError::InfiniteLight { shape: entry.shape, name: placed.shape().name() });
        }
        entry.emission = area_light.map(|light| emission(light, || standing.area_factor() * placed.area()));
        let id = self.push(entry, geometries, GeometryKind::Shape(placed.clone()))?;
        self.shape_light(id, placed, standing);
        Ok(())
    }

    #[expect(clippy::too_many_arguments, reason = "one call for each order of corners")]
    fn mesh(
        &mut self,
        entry: SurfaceEntry,
        desc: Arc<MeshDesc>,
        order: QuadOrder,
        placement: &Transform,
        origin: DVec3,
        area_light: Option<AreaLightDesc>,
        standing: &Standing,
        geometries: &mut Vec<Geometry>,
    ) -> Result<(), BuildError> {
        let shape = entry.shape;
        // Light is sampled by the triangles that are there.
        let may_split = area_light.is_none();
        let baked = mesh::bake(shape, desc, placement, origin, order, may_split)?;
        let attributes = baked.attributes;
        let mesh = attributes.mesh.clone();
        // Relative to the origin of the mesh, so that corners are rounded as those of neighbouring triangles: no ray
        // passes between them.
        let place = Transform::translate(mesh.origin);
        let patches = baked.patches.iter().map(|corners| {
            let [p00, p10, p01, p11] = corners.map(|i| mesh.positions[i as usize].as_dvec3());
            BilinearPatch::new(p00, p10, p01, p11)
                .map(|patch| PlacedShape::new(Shape::from(patch), place))
                .map_err(|source| BuildError::Shape { shape, source })
        });
        let patches = patches.collect::<Result<Vec<_>, _>>()?;

        // The entry of the triangles comes first, if there are any; its light has their total area.
        let first = self.entries.len() as u32;
        let light = area_light.as_ref().and_then(|_| MeshLight::new(first, &mesh));
        let emission = area_light.map(|light_desc| {
            let triangles = light.as_ref().map_or(0.0, |(_, area)| *area);
            emission(light_desc, || {
                standing.area_factor() * (triangles + patches.iter().map(PlacedShape::area).sum::<f64>())
            })
        });
        if !mesh.indices.is_empty() {
            let form = Form::Mesh(attributes.clone());
            let entry = SurfaceEntry { emission: emission.clone(), form, ..entry.clone() };
            match attributes.moving.as_deref() {
                None => {
                    let kind = match &attributes.precise {
                        None => GeometryKind::Mesh(mesh.clone()),
                        Some(precise) => GeometryKind::PreciseMesh(precise.clone()),
                    };
                    let id = self.push(entry, geometries, kind)?;
                    self.mesh_light(id, light, &mesh, standing);
                }
                Some(moving) => {
                    let id = self.push(entry, geometries, GeometryKind::Custom(moving.mesh.clone()))?;
                    self.mesh_light(id, light, &mesh, &Standing::Anywhere);
                }
            }
        }
        let triangle_count = mesh.indices.len() as u32;
        for ((i, placed), &corners) in (0..).zip(patches).zip(&baked.patches) {
            let form = Form::Patch { attributes: attributes.clone(), corners, primitive: triangle_count + i };
            let entry = SurfaceEntry { emission: emission.clone(), form, ..entry.clone() };
            let id = self.push(entry, geometries, GeometryKind::Shape(placed.clone()))?;
            self.shape_light(id, placed, standing);
        }
        Ok(())
    }

    /// The material and properties of a shape, without its geometry and its light.
    pub(crate) fn entry(&self, desc: &ShapeDesc) -> Result<SurfaceEntry, BuildError> {
        let (material_id, material) = match desc.material {
            None => (MaterialId(u32::MAX), None),
            Some(id) => {
                let (id, material) = self.materials.get(id.0 as usize).ok_or(BuildError::NoSuchMaterial {
                    shape: desc.index,
                    material: id.0,
                    count: self.materials.len(),
                })?;
                (*id, (!matches!(material.kind, MaterialKind::Interface)).then(|| material.clone()))
            }
        };
        Ok(SurfaceEntry {
            shape: desc.index,
            is_textured: material.as_ref().is_some_and(|material| !material.is_uniform())
                || desc.alpha.as_ref().is_some_and(|alpha| !alpha.is_constant()),
            stops_pov_light: match material.as_ref().map(|material| &material.kind) {
                Some(MaterialKind::Pov(material)) => desc.alpha.is_none() && material.stops_light(),
                _ => false,
            },
            material,
            material_id,
            emission: None,
            light: None,
            alpha: desc.alpha.clone(),
            boundary: desc.boundary.filter(|boundary| boundary.inside != boundary.outside),
            reverse: desc.reverse_orientation,
            form: Form::Exact,
        })
    }

    /// The area light of a shape, unless it has no surface that could emit.
    pub(crate) fn wanted_light(&mut self, desc: &ShapeDesc, entry: &SurfaceEntry) -> Option<AreaLightDesc> {
        let light = desc.area_light.clone()?;
        if !entry.is_visible() {
            self.warnings.push(BuildWarning::LightOnInterface { shape: desc.index });
            return None;
        }
        Some(light)
    }

    fn push(
        &mut self,
        entry: SurfaceEntry,
        geometries: &mut Vec<Geometry>,
        kind: GeometryKind,
    ) -> Result<u32, BuildError> {
        let id = u32::try_from(self.entries.len()).map_err(|_| BuildError::TooMany)?;
        self.entries.push(entry);
        geometries.push(Geometry { id, kind });
        Ok(id)
    }

    fn shape_light(&mut self, id: u32, shape: PlacedShape, standing: &Standing) {
        let light = ShapeLight::new(id, &self.entries[id as usize], shape, standing.area_factor());
        if let Some(light) = light {
            self.area_light(id, Light::Shape(light), standing);
        }
    }

    fn mesh_light(
        &mut self,
        id: u32,
        light: Option<(MeshLight, f64)>,
        mesh: &TriangleMesh,
        standing: &Standing,
    ) {
        let entry = &self.entries[id as usize];
        let Some(emission) = &entry.emission else { return };
        let Some((light, area)) = light else {
            self.warnings.push(BuildWarning::Empty { shape: entry.shape });
            return;
        };
        let power_of = |mean| power(mean, emission.sides(), standing.area_factor() * area);
        let is_varied = emission.image.is_some() || emission.by_vertices;
        let light = light.with_sides(entry);
        let (mut light, power) = match &entry.form {
            Form::Mesh(attributes) if is_varied => {
                match light.clone().with_brightness(emission, attributes) {
                    Some((light, whole)) => {
                        let mean = lumbre_image::Rgb::splat((whole / area) as f32);
                        (light, power_of(mean))
                    }
                    None => (light, 0.0),
                }
            }
            _ if entry.uniform_emission().is_some() => {
                (light.with_rectangles(mesh), power_of(emission.mean()))
            }
            _ => (light, power_of(emission.mean())),
        };
        light.power = power;
        self.area_light(id, Light::Mesh(light), standing);
    }

    fn area_light(&mut self, entry: u32, light: Light, standing: &Standing) {
        let entry = &mut self.entries[entry as usize];
        let light = match standing {
            Standing::World => light,
            Standing::Once(placement) => Light::Placed(PlacedLight::new(light, placement.clone())),
            Standing::Anywhere => {
                let warning = BuildWarning::UnsampledLight { shape: entry.shape };
                if self.warnings.last() != Some(&warning) {
                    self.warnings.push(warning);
                }
                return;
            }
        };
        entry.light = Some(LightId(self.lights.len() as u32));
        self.lights.push(light);
    }

    /// Adds the lights other than shapes, after shapes.
    fn place_lights(&mut self, lights: Vec<LightDesc>) -> Result<(), BuildError> {
        self.light_colours = vec![LightColour::Surface; self.lights.len()];
        for (position, light) in lights.into_iter().enumerate() {
            let colour = colour_of(&light);
            self.light(position, light)?;
            // A light that does not emit was dropped.
            self.light_colours.resize(self.lights.len(), colour);
        }
        Ok(())
    }

    fn light(&mut self, position: usize, desc: LightDesc) -> Result<(), BuildError> {
        let wrong = |reason| BuildError::Light { light: position, reason };
        let picture = match &desc {
            LightDesc::Infinite { image, .. } | LightDesc::Portal { image, .. } => image.as_ref(),
            LightDesc::Goniometric { image, .. } => Some(image),
            _ => None,
        };

        let picture = match &desc {
            LightDesc::Projection { image, .. } => Some(image),
            _ => picture.map(|picture| &picture.image),
        };
        if let Some((x, y)) = picture.and_then(|picture| first_not_finite(picture)) {
            self.warnings.push(BuildWarning::NotFiniteTexel { light: position, x, y });
        }
        let light = match desc {
            LightDesc::Spectral { light, .. } => return self.light(position, *light),
            LightDesc::Moving { light, world_from_light } => {
                let before = self.lights.len();
                self.light(position, *light)?;
                // A light that does not emit was dropped.
                let Some(light) = self.lights.drain(before..).next() else { return Ok(()) };
                let moving = MovingLight::new(light, world_from_light);
                Light::Moving(moving.ok_or(wrong("it is infinite and moves, or its motion stretches it"))?)
            }
            LightDesc::Point { from, intensity } => {
                if !from.is_finite() || !intensity.is_finite() {
                    return Err(wrong("its place or intensity is not finite"));
                }
                Light::Point(PointLight { from, intensity })
            }
            LightDesc::Spot { world_from_light, intensity, cone_angle, cone_delta_angle } => {
                if !intensity.is_finite()
                    || !(0.0..=180.0).contains(&cone_angle)
                    || !cone_delta_angle.is_finite()
                {
                    return Err(wrong(
                        "its intensity is not finite, or its angle not between 0 and 180 degrees",
                    ));
                }
                Light::Spot(SpotLight::new(&world_from_light, intensity, cone_angle, cone_delta_angle))
            }
            LightDesc::Goniometric { world_from_light, intensity, image } => {
                if !intensity.is_finite() {
                    return Err(wrong("its intensity is not finite"));
                }
                match GoniometricLight::new(&world_from_light, intensity, image) {
                    Some(light) => Light::Goniometric(light),
                    None => {
                        self.warnings.push(BuildWarning::DarkEnvironment { light: position });
                        return Ok(());
                    }
                }
            }
            LightDesc::Projection { world_from_light, intensity, image, fov } => {
                if !(intensity.is_finite() && 0.0 < fov && fov < 180.0) {
                    return Err(wrong(
                        "its intensity is not finite, or its angle not between 0 and 180 degrees",
                    ));
                }
                match ProjectionLight::new(world_from_light, intensity, image, f64::from(fov)) {
                    Some(light) => Light::Projection(light),
                    None => {
                        self.warnings.push(BuildWarning::DarkEnvironment { light: position });
                        return Ok(());
                    }
                }
            }
            LightDesc::Distant { towards, irradiance } => {
                let towards = towards.try_normalize().ok_or(wrong("its direction is zero or not finite"))?;
                if !irradiance.is_finite() {
                    return Err(wrong("its irradiance is not finite"));
                }
                Light::Distant(DistantLight { towards, irradiance })
            }
            LightDesc::Disc { towards, angle, irradiance } => {
                let light = DiscLight::new(towards, angle, irradiance);
                Light::Disc(light.ok_or(wrong(
                    "its direction is zero, its irradiance not finite, or its diameter not between 0 and 180 degrees",
                ))?)
            }
            LightDesc::Pov(light) => {
                if !(light.from.is_finite() && light.point_at.is_finite() && light.colour.is_finite()) {
                    return Err(wrong("its place or its colour is not finite"));
                }
                Light::Pov(light)
            }
            LightDesc::Infinite { radiance, .. } | LightDesc::Portal { radiance, .. }
                if !radiance.is_finite() =>
            {
                return Err(wrong("its radiance is not finite"));
            }
            LightDesc::Infinite { radiance, image: None, .. } => Light::Uniform(UniformLight { radiance }),
            LightDesc::Portal { world_from_light, radiance, image, corners } => {
                match PortalLight::new(world_from_light, radiance, image, corners) {
                    Ok(light) => Light::Portal(light),
                    Err(PortalError::NoRectangle) => return Err(wrong("its portal is not a rectangle")),
                    Err(PortalError::Dark) => {
                        self.warnings.push(BuildWarning::DarkEnvironment { light: position });
                        return Ok(());
                    }
                }
            }
            LightDesc::Infinite { world_from_light, radiance, image: Some(picture) } => {
                match Environment::new(picture.image, picture.mapping, world_from_light, radiance) {
                    Some(environment) => Light::Environment(environment),
                    None => {
                        self.warnings.push(BuildWarning::DarkEnvironment { light: position });
                        return Ok(());
                    }
                }
            }
        };
        self.lights.push(light);
        Ok(())
    }
}

/// The colours of a light.
fn colour_of(desc: &LightDesc) -> LightColour {
    let one = |colour: &Spectrum| LightColour::Constant { colour: *colour, spectrum: None };
    match desc {
        LightDesc::Point { intensity, .. } | LightDesc::Spot { intensity, .. } => one(intensity),
        LightDesc::Distant { irradiance, .. } | LightDesc::Disc { irradiance, .. } => one(irradiance),
        LightDesc::Infinite { radiance, image: None, .. }
        | LightDesc::Portal { radiance, image: None, .. } => one(radiance),
        LightDesc::Infinite { .. }
        | LightDesc::Portal { .. }
        | LightDesc::Goniometric { .. }
        | LightDesc::Projection { .. }
        | LightDesc::Pov(_) => LightColour::Varied,
        LightDesc::Moving { light, .. } => colour_of(light),
        LightDesc::Spectral { light, spectrum } => {
            let spectrum = Some(spectrum.clone());
            match (colour_of(light), &**light) {
                (LightColour::Constant { colour, .. }, _) => LightColour::Constant { colour, spectrum },
                (_, LightDesc::Goniometric { intensity, .. }) => {
                    LightColour::Constant { colour: *intensity, spectrum }
                }
                (other, _) => other,
            }
        }
    }
}

/// The emission of an area light, with its power converted to radiance.
pub(crate) fn emission(desc: AreaLightDesc, area: impl FnOnce() -> f64) -> Emission {
    let AreaLightDesc { radiance, image, by_vertices, two_sided, power, spectrum } = desc;
    let mut emission = Emission { radiance, image, by_vertices, two_sided, spectrum };
    if let Some(power) = power {
        // L stays a factor, as in pbrt-v4: the power is that of a radiance of 1, or of the image.
        let of_image = Emission { radiance: lumbre_image::Rgb::WHITE, ..emission.clone() }.mean().luminance();
        let per_radiance = std::f64::consts::PI * area() * f64::from(emission.sides() * of_image);
        let factor = f64::from(power) / per_radiance;
        emission.radiance =
            if factor.is_finite() { radiance * factor as f32 } else { lumbre_image::Rgb::BLACK };
    }
    emission
}

/// An origin near all meshes and exact shapes, relative to which single precision suffices: zero where that is
/// near enough, else a multiple of a power of two, so that translating a whole scene changes its vertices by no
/// more than their rounding.
fn origin(shapes: &[ShapeDesc], instances: &[InstanceDesc], accels: &[Arc<Accel>]) -> DVec3 {
    let mut bounds = Aabb::EMPTY;
    for shape in shapes {
        let own = match &shape.geometry {
            GeometryDesc::Exact(exact) => exact.bounds(&shape.world_from_object),
            GeometryDesc::Coloured(coloured) => coloured.shape.bounds(&shape.world_from_object),
            GeometryDesc::Mesh(mesh) | GeometryDesc::BilinearMesh(mesh) => {
                Some(mesh_bounds(mesh, &shape.world_from_object))
            }
            GeometryDesc::Curves(curves) => custom::bounds(&**curves, &shape.world_from_object),
            GeometryDesc::Custom(geometry) => custom::bounds(&**geometry, &shape.world_from_object),
            GeometryDesc::Csg(_) => None,
        };
        bounds = own.map_or(bounds, |own| bounds.union(own));
    }
    for (instance, accel) in instances.iter().zip(accels) {
        for map in extent::places(&instance.world_from_object) {
            bounds = bounds.union(moved(&accel.bounds(), &map));
        }
    }
    near(&bounds)
}
