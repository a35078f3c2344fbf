//! Scenes resolved for rendering, with the queries of light transport.

use std::sync::Arc;

use lumbre_geometry::{Aabb, Curves, Ray, Surface};
use lumbre_kernel::{Accel, Hit, Query};
use lumbre_math::random::{combine, hash_dvec3, uniform_f32};
use lumbre_math::{DVec2, DVec3, Transform, Vec3};
use lumbre_shading::{FloatTexture, Material, Spectrum};
use smallvec::SmallVec;

use crate::footprint::SurfaceFootprint;
use crate::light::lanes::LaneLights;
use crate::light::{Light, LightSample, Lighting, Place, Sampling};
use crate::media::Media;
use crate::surface::{Form, ShadingGeometry, SurfaceEntry};
use crate::{
    BoundingSphere, BuildError, Camera, FilmDesc, FilterDesc, Footprint, GroundPlane, IntegratorDesc,
    Interaction, LightId, MediumId, SamplerDesc, SurfaceTable, camera,
};

/// What a hit is on.
#[derive(Clone, Copy)]
struct Leaf<'s> {
    /// The surface entry, that of a leaf for a CSG.
    entry: &'s SurfaceEntry,
    /// The primitive; of a triangle that was split, the whole.
    part: u32,
    /// The barycentrics of a triangle.
    local: DVec2,
    /// Whether it is flipped because the leaf is subtracted.
    turned: bool,
}

/// An immutable scene, which any number of threads can render.
#[derive(Debug)]
pub struct Scene {
    pub(crate) accel: Arc<Accel>,
    pub(crate) entries: Arc<Vec<SurfaceEntry>>,
    pub(crate) tables: Arc<SurfaceTable>,
    pub(crate) media: Media,
    pub(crate) lighting: Lighting,
    pub(crate) cameras: Vec<Camera>,
    pub(crate) film: FilmDesc,
    pub(crate) filter: FilterDesc,
    pub(crate) sampler: SamplerDesc,
    pub(crate) integrator: IntegratorDesc,
    pub(crate) pov: Option<Arc<crate::pov::PovWorld>>,
    pub(crate) bounds: Aabb,
    pub(crate) ground: Option<GroundPlane>,
    pub(crate) specular_spheres: Vec<BoundingSphere>,
    pub(crate) warnings: Vec<BuildWarning>,
    pub(crate) traits: SceneTraits,
}

/// What a shadow ray meets by POV-Ray's rules.
#[derive(Clone, Debug)]
pub enum PovObstacle {
    /// No surface.
    Nothing,
    /// At first a surface that may let light pass, here.
    Clear(Hit),
    /// A surface that stops all light, anywhere or at first.
    Opaque,
}

/// What a scene has, so that rays can skip what it has not.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SceneTraits {
    /// Whether shadow rays must check every hit: there are cut-outs or interfaces.
    pub(crate) has_cutouts: bool,
    /// Whether any material transmits light.
    pub(crate) is_transmissive: bool,
    /// Whether any material transmits light straight on.
    pub(crate) has_delta_transmission: bool,
    /// Whether any material encloses a solid that light passes through.
    pub(crate) has_solids: bool,
    /// Whether any material is one-sided.
    pub(crate) has_one_sided: bool,
    /// Whether there are instances.
    pub(crate) has_instances: bool,
    /// Whether anything moves.
    pub(crate) moves: bool,
    /// Whether any material has textures, so that rays need footprints.
    pub(crate) is_textured: bool,
    /// Whether all surfaces stop light by POV-Ray's rules.
    pub(crate) all_stop_pov_light: bool,
}

impl BuildWarning {
    /// Whether it is about lights other than shapes.
    pub(crate) fn is_of_lights(&self) -> bool {
        matches!(self, Self::NoLight | Self::DarkEnvironment { .. } | Self::NotFiniteTexel { .. })
    }
}

/// Below this cosine between shading and geometric normal, the mesh approximates a smooth surface.
const SMOOTH: f32 = 1.0 - 1e-6;

/// A part of a description that was dropped, or makes rendering slower or noisier.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum BuildWarning {
    /// The area light of an interface is dropped, since an interface is no surface.
    #[error("shape {shape}: an area light on an interface gives no light")]
    LightOnInterface {
        /// The shape.
        shape: u32,
    },
    /// An emissive shape that cannot be sampled, as part of an object with several placements, of a CSG, or of
    /// a deforming mesh: its light is found only by rays that hit it.
    #[error(
        "shape {shape}: its light is found by chance only, for it is in one of many instances, a CSG, custom geometry, or a mesh that changes its form (slow to converge)"
    )]
    UnsampledLight {
        /// The shape.
        shape: u32,
    },
    /// A shape has no area, and is dropped.
    #[error("shape {shape}: without area, nothing can be seen of it")]
    Empty {
        /// The shape.
        shape: u32,
    },
    /// There is no light: pictures of light are black.
    #[error("the scene has no light: its picture is black")]
    NoLight,
    /// An environment map that is black is dropped.
    #[error("light {light}: its picture is black, it gives no light")]
    DarkEnvironment {
        /// The index of the light.
        light: usize,
    },
    /// Texels of an environment map that are not finite count as black.
    #[error("light {light}: texel ({x}, {y}) of its picture is not finite, and taken for black")]
    NotFiniteTexel {
        /// The index of the light.
        light: usize,
        /// The column of the first such texel, from the left.
        x: u32,
        /// Its row, from the top.
        y: u32,
    },
}

impl Scene {
    /// The tree, for queries unrelated to light. [`Scene::shape_index`] gives the shape of a hit.
    pub fn accel(&self) -> &Accel {
        &self.accel
    }

    /// The cameras, the default first; at least one.
    pub fn cameras(&self) -> &[Camera] {
        &self.cameras
    }

    /// Replaces a camera: a viewer that moves rebuilds nothing.
    ///
    /// # Errors
    /// [`BuildError`] for a camera that [`Scene::build`] would refuse, and for a position without a camera.
    pub fn replace_camera(&mut self, position: usize, camera: Camera) -> Result<(), BuildError> {
        let mut cameras = self.cameras.clone();
        let count = cameras.len();
        *cameras.get_mut(position).ok_or(BuildError::NoSuchCamera { position, count })? = camera;
        camera::check(&cameras)?;
        self.cameras = cameras;
        Ok(())
    }

    /// Whether a camera is valid for this scene.
    ///
    /// # Errors
    /// [`BuildError`] for a camera that [`Scene::build`] would refuse.
    pub fn check_camera(&self, camera: &Camera) -> Result<(), BuildError> {
        camera::check(std::slice::from_ref(camera))?;
        let count = self.media.media.len();
        match camera.medium {
            Some(MediumId(medium)) if medium as usize >= count => {
                Err(BuildError::NoSuchMedium { medium, count })
            }
            _ => Ok(()),
        }
    }

    /// The film settings of the description.
    pub fn film(&self) -> &FilmDesc {
        &self.film
    }

    /// The pixel filter of the description.
    pub fn filter(&self) -> FilterDesc {
        self.filter
    }

    /// The sampler settings of the description.
    pub fn sampler(&self) -> SamplerDesc {
        self.sampler
    }

    /// The integrator settings of the description.
    pub fn integrator(&self) -> IntegratorDesc {
        self.integrator
    }

    /// The surroundings of a POV-Ray scene.
    pub fn pov(&self) -> Option<&crate::pov::PovWorld> {
        self.pov.as_deref()
    }

    /// Whether anything moves, other than cameras.
    pub fn moves(&self) -> bool {
        self.traits.moves
    }

    /// The bounding box of everything finite; may be empty.
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// The ground plane, if any.
    pub fn ground(&self) -> Option<&GroundPlane> {
        self.ground.as_ref()
    }

    /// Every light.
    pub fn lights(&self) -> &[Light] {
        self.lighting.lights()
    }

    /// Dropped parts, and causes of slow rendering.
    pub fn warnings(&self) -> &[BuildWarning] {
        &self.warnings
    }

    /// The index in its file of the shape that was hit.
    pub fn shape_index(&self, hit: &Hit) -> u32 {
        self.leaf(hit).entry.shape
    }

    /// The triangle of a mesh that was hit, without the other data of [`Scene::interaction`]; 0 for other shapes.
    pub fn primitive_index(&self, hit: &Hit) -> u32 {
        let Leaf { entry, part, .. } = self.leaf(hit);
        entry.primitive(part)
    }

    /// The part of what has an id in the tree that results give for one that queries of points find there: of a
    /// triangle that was split, the whole.
    ///
    /// # Panics
    /// When there is no such id.
    pub fn whole_primitive(&self, id: u32, part: u32) -> u32 {
        self.entries[id as usize].whole(part, DVec2::ZERO).0
    }

    /// The curves of a hit, in their own space, and the map from there to the innermost instance; `None` for other
    /// shapes.
    pub fn curves_at(&self, hit: &Hit) -> Option<(&Curves, &Transform)> {
        match &self.leaf(hit).entry.form {
            Form::Curves(curves, place) => Some((curves, place)),
            _ => None,
        }
    }

    /// Whether any material transmits light: glass, panes, leaves. Cut-outs do not count.
    pub fn is_transmissive(&self) -> bool {
        self.traits.is_transmissive
    }

    /// Whether any material encloses a solid that light passes through.
    pub fn has_solids(&self) -> bool {
        self.traits.has_solids
    }

    /// Whether any material transmits light straight on ([`lumbre_shading::Bsdf::straight_on`]), such as a thin
    /// smooth pane.
    pub fn has_delta_transmission(&self) -> bool {
        self.traits.has_delta_transmission
    }

    /// Whether the hit surface may transmit light straight on.
    pub fn is_pane(&self, hit: &Hit) -> bool {
        self.leaf(hit).entry.has_delta_transmission()
    }

    /// Whether the hit surface may reflect or refract without blur: see [`lumbre_shading::Material::may_be_specular`].
    pub fn may_be_specular(&self, hit: &Hit) -> bool {
        self.leaf(hit).entry.material.as_ref().is_some_and(|material| material.may_be_specular())
    }

    /// The closest hit, skipping cut-outs and interfaces.
    pub fn closest(&self, ray: &Ray) -> Option<Hit> {
        if self.traits.has_cutouts {
            let is_solid = |hit: &Hit| self.is_solid(ray, hit);
            self.accel.closest_with(ray, &Query::new().filter(&is_solid))
        } else {
            self.accel.closest(ray)
        }
    }

    /// The closest hit visible to a camera: as [`Scene::closest`], also skipping the backs of one-sided
    /// materials. Each of the two nearest surfaces that cover the ray is hit if its coverage is above its number, in
    /// [0, 1): numbers that are stratified over the rays of a pixel leave little noise in its alpha. A hash decides
    /// about surfaces behind.
    pub fn closest_seen(&self, ray: &Ray, numbers: [f32; 2]) -> Option<Hit> {
        if !self.traits.has_one_sided && !self.traits.has_cutouts {
            return self.accel.closest(ray);
        }
        let mut passed = SmallVec::<[u64; 2]>::new();
        for number in numbers {
            let covers = |hit: &Hit| {
                !passed.contains(&self.place_of(hit))
                    && !self.is_back_of_one_sided(ray, hit)
                    && self.coverage(ray, hit) > 0.0
            };
            let hit = self.accel.closest_with(ray, &Query::new().filter(&covers))?;
            if number < self.coverage(ray, &hit) {
                return Some(hit);
            }
            let place = self.place_of(&hit);
            passed.push(place);
        }
        let is_seen = |hit: &Hit| {
            !passed.contains(&self.place_of(hit))
                && !self.is_back_of_one_sided(ray, hit)
                && self.is_solid(ray, hit)
        };
        self.accel.closest_with(ray, &Query::new().filter(&is_seen))
    }

    /// [`Scene::closest`] for every ray.
    ///
    /// # Panics
    /// If the numbers of hits and rays differ.
    pub fn closest_batch(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        if self.traits.has_cutouts {
            assert_eq!(rays.len(), hits.len(), "a place for each hit");
            hits.iter_mut().zip(rays).for_each(|(hit, ray)| *hit = self.closest(ray));
        } else {
            self.accel.closest_batch(rays, hits);
        }
    }

    /// [`Scene::closest_seen`] for every ray, with its numbers by its index.
    ///
    /// # Panics
    /// If the numbers of hits and rays differ.
    pub fn closest_seen_batch(
        &self,
        rays: &[Ray],
        numbers: impl Fn(usize) -> [f32; 2],
        hits: &mut [Option<Hit>],
    ) {
        if self.traits.has_one_sided || self.traits.has_cutouts {
            assert_eq!(rays.len(), hits.len(), "a place for each hit");
            for (i, (hit, ray)) in hits.iter_mut().zip(rays).enumerate() {
                *hit = self.closest_seen(ray, numbers(i));
            }
        } else {
            self.accel.closest_batch(rays, hits);
        }
    }

    /// [`Scene::is_occluded`] for every ray.
    ///
    /// # Panics
    /// If the numbers of answers and rays differ.
    pub fn occluded_batch(&self, rays: &[Ray], occluded: &mut [bool]) {
        if self.traits.has_cutouts {
            assert_eq!(rays.len(), occluded.len(), "an answer for each ray");
            occluded.iter_mut().zip(rays).for_each(|(occluded, ray)| *occluded = self.is_occluded(ray));
        } else {
            self.accel.any_batch(rays, occluded);
        }
    }

    /// Whether a shadow ray is occluded.
    pub fn is_occluded(&self, ray: &Ray) -> bool {
        if self.traits.has_cutouts {
            let is_solid = |hit: &Hit| self.is_solid(ray, hit);
            self.accel.any_with(ray, &Query::new().filter(&is_solid))
        } else {
            self.accel.any(ray)
        }
    }

    /// What a shadow ray meets by POV-Ray's rules. Cut-outs and interfaces count as clear.
    pub fn pov_obstacle(&self, ray: &Ray) -> PovObstacle {
        if self.traits.all_stop_pov_light {
            return if self.accel.any(ray) { PovObstacle::Opaque } else { PovObstacle::Nothing };
        }
        // A query for opaque surfaces alone has to look at every crossing of each, and takes longer.
        match self.closest(ray) {
            None => PovObstacle::Nothing,
            Some(hit) if self.leaf(&hit).entry.stops_pov_light => PovObstacle::Opaque,
            Some(hit) => PovObstacle::Clear(hit),
        }
    }

    /// The [`crate::ShapeDesc::index`] of the shape with an id in the tree.
    ///
    /// # Panics
    /// If there is no such id.
    pub fn shape_of(&self, id: u32) -> u32 {
        self.entries[id as usize].shape
    }

    /// Whether the surface with an id in the tree is the ground.
    ///
    /// # Panics
    /// If there is no such id.
    pub fn is_ground(&self, id: u32) -> bool {
        self.entries[id as usize].shape == crate::ground::SHAPE
    }

    /// Surfaces as rows of numbers.
    pub fn tables(&self) -> &SurfaceTable {
        &self.tables
    }

    /// Whether any index of refraction depends on the wavelength, which only a spectral render shows.
    pub fn disperses(&self) -> bool {
        self.entries.iter().any(SurfaceEntry::disperses)
    }

    /// Whether shadow rays and paths pass through some surfaces: cut-outs and interfaces.
    pub fn has_cutouts(&self) -> bool {
        self.traits.has_cutouts
    }

    /// Whether cameras look through the backs of some surfaces.
    pub fn has_one_sided(&self) -> bool {
        self.traits.has_one_sided
    }

    /// Whether any material has textures, so that rays need footprints.
    pub fn is_textured(&self) -> bool {
        self.traits.is_textured
    }

    /// The interaction at a hit.
    pub fn interaction(&self, ray: &Ray, hit: &Hit, footprint: &Footprint) -> Interaction<'_> {
        self.interaction_at(ray, hit, footprint, self.accel.surface(ray, hit))
    }

    /// [`Scene::interaction`] at a hit of [`Accel::closest_columns`]: picture rays that leave it do not hit it again.
    pub fn picture_interaction(&self, ray: &Ray, hit: &Hit, footprint: &Footprint) -> Interaction<'_> {
        self.interaction_at(ray, hit, footprint, self.accel.picture_surface(ray, hit))
    }

    /// The surface at a hit, its unit shading normal and its material.
    pub(crate) fn pov_surface(&self, ray: &Ray, hit: &Hit) -> (Surface, Vec3, Option<&Material>) {
        let leaf = self.leaf(hit);
        let shaded = self.shading_geometry(&leaf, &self.accel.surface(ray, hit), ray, hit);
        (shaded.surface, shaded.shading.normal, leaf.entry.material.as_deref())
    }

    fn interaction_at(
        &self,
        ray: &Ray,
        hit: &Hit,
        footprint: &Footprint,
        geometric: Surface,
    ) -> Interaction<'_> {
        let leaf = self.leaf(hit);
        let Leaf { entry, part, local, .. } = leaf;
        let shaded = self.shading_geometry(&leaf, &geometric, ray, hit);
        let primitive = entry.primitive(part);
        let length = ray.direction.length();
        let direction = ray.direction / length;
        let front = shaded.surface.normal.dot(direction) < 0.0;
        let surface = shaded.surface;
        let spot = if entry.is_textured {
            let (dpdu, dpdv) = (surface.dpdu, surface.dpdv);
            footprint.on_plane(surface.point, surface.normal, dpdu, dpdv, direction, hit.root.t * length)
        } else if self.traits.is_textured {
            footprint.across(surface.point, surface.normal, direction, hit.root.t * length)
        } else {
            SurfaceFootprint::default()
        };
        let incident_origin = surface.offset_origin(-direction);
        let is_smooth = shaded.shading.normal.dot(shaded.shading.geometric) < SMOOTH;
        let terminator_offset = is_smooth.then(|| {
            let placement = self.placement(ray, hit);
            let terminator_offset =
                entry.terminator_offset(&geometric, part, local, placement.as_ref(), ray.time, -direction)?;
            // A smaller offset is within the error of the point.
            (terminator_offset.dot(surface.normal).abs() > (incident_origin - surface.point).length())
                .then_some(terminator_offset)
        });
        let light = entry.light;
        let geometric = light.map(|_| {
            let is_placed = !hit.instances.is_empty();
            Box::new(if is_placed { self.accel.surface_in_object(ray, hit) } else { geometric })
        });
        Interaction {
            at: shaded.context(spot.dpdx, spot.dpdy, spot.duv_dx, spot.duv_dy),
            surface,
            shading: shaded.shading,
            towards_origin: -direction,
            front,
            material: entry.material.as_deref(),
            material_id: entry.material_id,
            emission: entry.emission.as_ref(),
            light,
            boundary: self.entries[hit.id as usize].boundary,
            shape: entry.shape,
            primitive,
            geometric,
            time: ray.time,
            incident_origin,
            terminator_offset: terminator_offset.flatten(),
            width: spot.width,
            spread: spot.spread,
        }
    }

    /// A light sample for `from` at a time: a light chosen by `choose`, and a direction by `u`. Its density, or
    /// the radiance of a delta light, includes the probability of the light.
    ///
    /// `normal` is the unit geometric normal of an opaque surface, on the viewer's side: lights below its horizon are
    /// not chosen, and others by the cosine. It is zero if light from every side counts: for a transmissive surface,
    /// and in a medium.
    ///
    /// Use it if other rays find light too, and both are weighted by [`Scene::light_pdf`] and [`Scene::escaped`]: it
    /// rarely samples the dim parts of an environment map. Otherwise use [`Scene::sample_light_alone`].
    pub fn sample_light(
        &self,
        from: DVec3,
        normal: DVec3,
        time: f64,
        choose: f64,
        u: DVec2,
    ) -> Option<LightSample> {
        Some(self.sample_light_for(Sampling::Mis, from, normal, time, choose, u)?.1)
    }

    /// [`Scene::sample_light`] for code that finds light in no other way.
    pub fn sample_light_alone(
        &self,
        from: DVec3,
        normal: DVec3,
        time: f64,
        choose: f64,
        u: DVec2,
    ) -> Option<LightSample> {
        Some(self.sample_light_for(Sampling::LightsOnly, from, normal, time, choose, u)?.1)
    }

    /// [`Scene::sample_light`] or [`Scene::sample_light_alone`], with the sampled light.
    pub fn sample_light_for(
        &self,
        sampling: Sampling,
        from: DVec3,
        normal: DVec3,
        time: f64,
        choose: f64,
        u: DVec2,
    ) -> Option<(LightId, LightSample)> {
        let place = Place { from, normal };
        self.lighting.sample(&place, time, [choose, u.x, u.y], sampling)
    }

    /// The lights over lanes: as [`Scene::sample_light`], [`Scene::light_pdf`] and [`Scene::escaped`].
    pub fn lane_lights(&self) -> &LaneLights {
        &self.lighting.lanes
    }

    /// [`Interaction::terminator_origin`], unless something lies between it and the face.
    pub fn unoccluded_terminator_origin(&self, at: &Interaction) -> Option<DVec3> {
        let offset = at.terminator_offset?;
        let way = at.leave_from(at.incident_origin, offset).with_range(0.0, 1.0);
        (!self.is_occluded(&way)).then(|| at.incident_origin + offset)
    }

    /// A light chosen by power, with its probability; `None` without lights.
    pub fn choose_light(&self, choose: f64) -> Option<(LightId, f64)> {
        self.lighting.choose_by_power(choose)
    }

    /// A sample of one light for `from` at a time, in a direction chosen by `u`.
    pub fn sample_one_light(&self, light: LightId, from: DVec3, time: f64, u: DVec2) -> Option<LightSample> {
        self.lights()[light.0 as usize].sample(&self.entries, from, time, u)
    }

    /// The density per unit solid angle with which [`Scene::sample_light`] samples `hit` from `from` with a normal; 0
    /// if it never does.
    pub fn light_pdf(&self, from: DVec3, normal: DVec3, hit: &Interaction) -> f32 {
        let (Some(light), Some(geometric)) = (hit.light, &hit.geometric) else { return 0.0 };
        let surface = Some((&**geometric, hit.primitive));
        let ray = Ray::new(from, -hit.towards_origin).at_time(hit.time);
        self.lighting.pdf(light, &ray, normal, surface) as f32
    }

    /// The radiance of each infinite light along a ray that leaves the scene, with the density with which
    /// [`Scene::sample_light`] samples that direction from the ray's origin with a normal.
    pub fn escaped<'s>(&'s self, ray: &'s Ray, normal: DVec3) -> impl Iterator<Item = (Spectrum, f32)> + 's {
        self.lighting.infinite.iter().map(move |&id| {
            let light = &self.lights()[id.0 as usize];
            let pdf = self.lighting.pdf(id, ray, normal, None);
            (light.escaped(ray.origin, ray.direction), pdf as f32)
        })
    }

    /// The radiance of each infinite light along a ray that leaves the scene.
    pub fn background<'s>(&'s self, ray: &'s Ray) -> impl Iterator<Item = Spectrum> + 's {
        let lights = self.lights();
        self.lighting.infinite.iter().map(move |&id| lights[id.0 as usize].escaped(ray.origin, ray.direction))
    }

    fn leaf(&self, hit: &Hit) -> Leaf<'_> {
        let entry = &self.entries[hit.id as usize];
        let local = hit.root.local;
        match &entry.form {
            Form::Csg(csg) => match csg.leaf(&hit.root) {
                Some((leaf, found)) => {
                    let (part, local) = leaf.whole(found.part, local);
                    Leaf { entry: leaf, part, local, turned: found.flipped }
                }
                None => Leaf { entry, part: 0, local, turned: false },
            },
            _ => {
                let (part, local) = entry.whole(hit.primitive, local);
                Leaf { entry, part, local, turned: false }
            }
        }
    }

    /// The transform of the innermost instance of a hit; `None` in the world itself.
    fn placement(&self, ray: &Ray, hit: &Hit) -> Option<Transform> {
        (self.traits.has_instances && !hit.instances.is_empty())
            .then(|| self.accel.world_from_object(ray, hit))
    }

    fn shading_geometry(
        &self,
        leaf: &Leaf<'_>,
        geometric: &Surface,
        ray: &Ray,
        hit: &Hit,
    ) -> ShadingGeometry {
        let Leaf { entry, part, local, turned } = *leaf;
        let placement = self.placement(ray, hit);
        if !turned {
            return entry.shading_geometry(geometric, part, local, placement.as_ref(), ray.time);
        }
        let outward =
            Surface { normal: -geometric.normal, dndu: -geometric.dndu, dndv: -geometric.dndv, ..*geometric };
        let mut shaded = entry.shading_geometry(&outward, part, local, placement.as_ref(), ray.time);
        shaded.turn();
        shaded
    }

    /// Whether rays may pass through the surface with an id in the tree: a cut-out or an interface.
    ///
    /// # Panics
    /// If there is no such id.
    pub fn may_be_cutout(&self, id: u32) -> bool {
        self.traits.has_cutouts && self.entries[id as usize].has_cutouts()
    }

    /// Whether cameras may look through the back of the surface with an id in the tree.
    ///
    /// # Panics
    /// If there is no such id.
    pub fn may_be_one_sided(&self, id: u32) -> bool {
        self.traits.has_one_sided && self.entries[id as usize].is_one_sided_anywhere()
    }

    /// Whether a hit is on the back of a one-sided surface, which cameras look through.
    pub fn is_back_of_one_sided(&self, ray: &Ray, hit: &Hit) -> bool {
        let Leaf { entry, turned, .. } = self.leaf(hit);
        entry.is_one_sided() && {
            // By the orientation of its faces, not by vertex normals.
            let along = self.accel.surface(ray, hit).normal.dot(ray.direction) > 0.0;
            along != (turned != entry.reverse)
        }
    }

    /// The share of the rays through a hit that it stops, from its alpha: 0 of an interface.
    pub fn coverage(&self, ray: &Ray, hit: &Hit) -> f32 {
        let leaf = self.leaf(hit);
        if !leaf.entry.is_visible() {
            return 0.0;
        }
        match leaf.entry.alpha.as_deref() {
            None => 1.0,
            Some(FloatTexture::Constant(coverage)) => *coverage,
            Some(alpha) => {
                let geometric = self.accel.surface(ray, hit);
                let shaded = self.shading_geometry(&leaf, &geometric, ray, hit);
                alpha.evaluate(&shaded.point_context())
            }
        }
    }

    /// Whether a hit blocks light. Partial alpha is decided by a hash of the ray and what it hit, so the result is
    /// deterministic.
    pub fn is_solid(&self, ray: &Ray, hit: &Hit) -> bool {
        let coverage = self.coverage(ray, hit);
        if coverage <= 0.0 || coverage >= 1.0 {
            return coverage >= 1.0;
        }
        let line = combine(hash_dvec3(ray.origin), hash_dvec3(ray.direction));
        uniform_f32(combine(line, self.place_of(hit))) < coverage
    }

    /// A hash of what a hit is on: the same for all hits of a triangle.
    fn place_of(&self, hit: &Hit) -> u64 {
        let place = u64::from(hit.id) << 32 | u64::from(hit.primitive);
        let place = hit.instances.iter().fold(place, |place, &instance| combine(place, instance.into()));
        if matches!(self.leaf(hit).entry.form, Form::Mesh(_)) {
            return place;
        }
        // A ray may hit it more than once. Of a triangle, `t` would depend on the precision.
        combine(place, hit.root.t.to_bits())
    }
}
