//! What there is, resolved for rendering, and the questions that light transport asks.

use std::sync::Arc;

use lumbre_geometry::{Aabb, Ray, Surface};
use lumbre_kernel::{Accel, Hit, Query};
use lumbre_math::distribution::AliasTable;
use lumbre_math::random::{combine, hash_dvec3, uniform_f32};
use lumbre_math::{DVec2, DVec3, Transform};
use lumbre_shading::{FloatTexture, Scatter, Spectrum};

use crate::footprint::Spot;
use crate::interaction::offset;
use crate::light::{Light, LightId, LightSample};
use crate::surface::{Dressed, Form, SurfaceEntry};
use crate::{Camera, FilmDesc, FilterDesc, Footprint, GroundPlane, IntegratorDesc, Interaction, SamplerDesc};

/// A scene, ready to be rendered from any number of threads. Nothing changes it.
#[derive(Debug)]
pub struct Scene {
    pub(crate) accel: Arc<Accel>,
    pub(crate) entries: Vec<SurfaceEntry>,
    pub(crate) lights: Vec<Light>,
    // By power; `None` where there is no light.
    pub(crate) light_choice: Option<AliasTable>,
    pub(crate) infinite: Vec<LightId>,
    pub(crate) cameras: Vec<Camera>,
    pub(crate) film: FilmDesc,
    pub(crate) filter: FilterDesc,
    pub(crate) sampler: SamplerDesc,
    pub(crate) integrator: IntegratorDesc,
    pub(crate) bounds: Aabb,
    pub(crate) ground: Option<GroundPlane>,
    pub(crate) warnings: Vec<BuildWarning>,
    // Whether rays of light must ask every hit if it counts: something is cut out, or is an interface.
    pub(crate) has_holes: bool,
    /// Whether anything is made of glass, or of what else light goes through.
    pub(crate) lets_light_through: bool,
    /// Whether light may go straight on through anything.
    pub(crate) lets_light_straight_on: bool,
    // Whether a camera looks through the back of something.
    pub(crate) has_one_sided: bool,
    pub(crate) has_instances: bool,
    pub(crate) moves: bool,
    // Whether any surface looks up a texture, so that rays have to know how wide they are.
    pub(crate) looks_up: bool,
}

/// Where the cosine between shading and geometric normal is less, the surface stands for a smooth one.
const SMOOTH: f32 = 1.0 - 1e-6;

/// Something in a description that was left out of the scene, or is slower or noisier than it could be.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum BuildWarning {
    /// The area light of an interface is dropped, for an interface is no surface.
    #[error("shape {shape}: an area light on an interface gives no light")]
    LightOnInterface {
        /// Which shape.
        shape: u32,
    },
    /// Light in an object that does not stand in the world just once, on a CSG, or on a mesh that changes its form, is found only by rays that happen to hit it.
    #[error(
        "shape {shape}: its light is found by chance only, for it is in one of many instances, a CSG, or a mesh that changes its form (slow to converge)"
    )]
    UnsampledLight {
        /// Which shape.
        shape: u32,
    },
    /// A shape has no area, and was left out.
    #[error("shape {shape}: without area, nothing can be seen of it")]
    Empty {
        /// Which shape.
        shape: u32,
    },
    /// There is no light at all: what does not look at light alone is black.
    #[error("the scene has no light: its picture is black")]
    NoLight,
    /// An environment that is black or not finite gives no light.
    #[error("light {light}: its picture is black or not finite, it gives no light")]
    DarkEnvironment {
        /// Its position among the lights.
        light: usize,
    },
}

impl Scene {
    /// The tree, for queries that are not about light. The id of a hit leads to [`Scene::shape_index`].
    pub fn accel(&self) -> &Accel {
        &self.accel
    }

    /// Cameras, the one to use first. There is always one.
    pub fn cameras(&self) -> &[Camera] {
        &self.cameras
    }

    /// What the description says of the film.
    pub fn film(&self) -> &FilmDesc {
        &self.film
    }

    /// What the description says of the pixel filter.
    pub fn filter(&self) -> FilterDesc {
        self.filter
    }

    /// What the description says of the sampler.
    pub fn sampler(&self) -> SamplerDesc {
        self.sampler
    }

    /// What the description says of the integrator.
    pub fn integrator(&self) -> IntegratorDesc {
        self.integrator
    }

    /// Whether anything in it moves, cameras apart.
    pub fn moves(&self) -> bool {
        self.moves
    }

    /// A box around everything finite; empty where there is nothing.
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// What everything stands on, where there is such a thing.
    pub fn ground(&self) -> Option<&GroundPlane> {
        self.ground.as_ref()
    }

    /// Every light.
    pub fn lights(&self) -> &[Light] {
        &self.lights
    }

    /// What was left out or will be slow.
    pub fn warnings(&self) -> &[BuildWarning] {
        &self.warnings
    }

    /// The position in its file of the shape that was hit.
    pub fn shape_index(&self, hit: &Hit) -> u32 {
        self.leaf(hit).0.shape
    }

    /// Whether anything is made of what light goes through: glass, panes, leaves. Cut-outs do not count.
    pub fn lets_light_through(&self) -> bool {
        self.lets_light_through
    }

    /// Whether light may go straight on through anything ([`lumbre_shading::Bsdf::straight_on`]): smooth panes without
    /// thickness, mostly.
    pub fn lets_light_straight_on(&self) -> bool {
        self.lets_light_straight_on
    }

    /// Whether light may go straight on through what was hit.
    pub fn is_pane(&self, hit: &Hit) -> bool {
        self.leaf(hit).0.lets_light_straight_on()
    }

    /// The nearest hit that light sees: cut-outs and interfaces let it pass.
    pub fn closest(&self, ray: &Ray) -> Option<Hit> {
        if self.has_holes {
            let is_solid = |hit: &Hit| self.is_solid(ray, hit);
            self.accel.closest_with(ray, &Query::new().filter(&is_solid))
        } else {
            self.accel.closest(ray)
        }
    }

    /// The nearest hit that a camera sees: as [`Scene::closest`], but for the backs of what is one-sided.
    pub fn closest_seen(&self, ray: &Ray) -> Option<Hit> {
        if self.has_one_sided {
            let is_seen = |hit: &Hit| !self.is_back_of_one_sided(ray, hit) && self.is_solid(ray, hit);
            self.accel.closest_with(ray, &Query::new().filter(&is_seen))
        } else {
            self.closest(ray)
        }
    }

    /// Whether something stands in the way of light.
    pub fn is_occluded(&self, ray: &Ray) -> bool {
        if self.has_holes {
            let is_solid = |hit: &Hit| self.is_solid(ray, hit);
            self.accel.any_with(ray, &Query::new().filter(&is_solid))
        } else {
            self.accel.any(ray)
        }
    }

    /// What there is at a hit.
    pub fn interaction(&self, ray: &Ray, hit: &Hit, footprint: &Footprint) -> Interaction<'_> {
        let (entry, part, turned) = self.leaf(hit);
        let bare = self.accel.surface(ray, hit);
        let dressed = self.dressed(entry, &bare, ray, hit, part, turned);
        let primitive = match entry.form {
            Form::Patch { primitive, .. } => primitive,
            Form::Mesh(_) => part,
            Form::Exact | Form::Coloured(_) | Form::Csg(_) => 0,
        };
        let length = ray.direction.length();
        let direction = ray.direction / length;
        let front = dressed.surface.normal.dot(direction) < 0.0;
        let surface = dressed.surface;
        let spot = if entry.looks_up {
            let (dpdu, dpdv) = (surface.dpdu, surface.dpdv);
            footprint.on_plane(surface.point, surface.normal, dpdu, dpdv, direction, hit.root.t * length)
        } else if self.looks_up {
            footprint.across(surface.point, surface.normal, direction, hit.root.t * length)
        } else {
            Spot::default()
        };
        let before = offset(surface.point, surface.point_error, surface.normal, -direction);
        let is_smooth = dressed.shading.normal.dot(dressed.shading.geometric) < SMOOTH;
        let rise = is_smooth.then(|| {
            let placement = self.placement(ray, hit);
            let rise = entry.rise(&bare, part, hit.root.local, placement.as_ref(), ray.time, -direction)?;
            // Else it is lost in the error of the point.
            (rise.dot(surface.normal).abs() > (before - surface.point).length()).then_some(rise)
        });
        let light = entry.light;
        let bare = light.map(|_| {
            let is_placed = !hit.instances.is_empty();
            Box::new(if is_placed { self.accel.surface_in_object(ray, hit) } else { bare })
        });
        Interaction {
            at: dressed.context(spot.dpdx, spot.dpdy, spot.duv_dx, spot.duv_dy),
            surface,
            shading: dressed.shading,
            towards_origin: -direction,
            front,
            material: entry.material.as_deref(),
            emission: entry.emission.as_ref(),
            light,
            shape: entry.shape,
            primitive,
            bare,
            time: ray.time,
            before,
            rise: rise.flatten(),
            width: spot.width,
            spread: spot.spread,
        }
    }

    /// Light that arrives at `from` at a time, from a light chosen by `choose`, in a direction chosen by `u`. Its density, or
    /// its radiance where it has none, counts the choice.
    pub fn sample_light(&self, from: DVec3, time: f64, choose: f64, u: DVec2) -> Option<LightSample> {
        let choice = self.light_choice.as_ref()?.sample(choose);
        let mut sample = self.lights[choice.index].sample(&self.entries, from, time, u)?;
        match &mut sample.scatter {
            Scatter::Density(pdf) => *pdf *= choice.probability as f32,
            Scatter::Delta => sample.radiance *= (1.0 / choice.probability) as f32,
        }
        Some(sample)
    }

    /// A light chosen by its power, with the probability of the choice; `None` where there is no light.
    pub fn choose_light(&self, choose: f64) -> Option<(LightId, f64)> {
        let choice = self.light_choice.as_ref()?.sample(choose);
        Some((LightId(choice.index as u32), choice.probability))
    }

    /// Light that arrives at `from` at a time from one light, in a direction chosen by `u`.
    pub fn sample_one_light(&self, light: LightId, from: DVec3, time: f64, u: DVec2) -> Option<LightSample> {
        self.lights[light.0 as usize].sample(&self.entries, from, time, u)
    }

    /// The density per unit solid angle with which [`Scene::sample_light`] chooses at `from` what a ray from there hit; 0
    /// where it never does.
    pub fn light_pdf(&self, from: DVec3, hit: &Interaction) -> f32 {
        let (Some(light), Some(bare)) = (hit.light, &hit.bare) else { return 0.0 };
        let surface = Some((&**bare, hit.primitive));
        let ray = Ray::new(from, -hit.towards_origin).at_time(hit.time);
        (self.light_probability(light) * self.lights[light.0 as usize].pdf(&ray, surface)) as f32
    }

    /// What arrives along the unit direction of a ray that leaves the scene: for each light at infinity its radiance, and
    /// the density with which [`Scene::sample_light`] chooses the direction for it.
    pub fn escaped<'s>(&'s self, ray: &'s Ray) -> impl Iterator<Item = (Spectrum, f32)> + 's {
        self.infinite.iter().map(move |&id| {
            let light = &self.lights[id.0 as usize];
            let pdf = self.light_probability(id) * light.pdf(ray, None);
            (light.escaped(ray.direction), pdf as f32)
        })
    }

    /// What arrives along the unit direction of a ray that leaves the scene, from each light at infinity.
    pub fn background<'s>(&'s self, ray: &'s Ray) -> impl Iterator<Item = Spectrum> + 's {
        self.infinite.iter().map(move |&id| self.lights[id.0 as usize].escaped(ray.direction))
    }

    fn light_probability(&self, light: LightId) -> f64 {
        self.light_choice.as_ref().map_or(0.0, |choice| choice.probability(light.0 as usize))
    }

    /// The surface that was hit, that of a leaf for a CSG; which primitive of it; and whether it was turned inside out
    /// because the leaf was taken away.
    fn leaf(&self, hit: &Hit) -> (&SurfaceEntry, u32, bool) {
        let entry = &self.entries[hit.id as usize];
        match &entry.form {
            Form::Csg(csg) => match csg.leaf(&hit.root) {
                Some((leaf, part)) => (leaf, part.part, part.flipped),
                None => (entry, 0, false),
            },
            _ => (entry, hit.primitive, false),
        }
    }

    /// The map from the innermost instance of a hit; `None` in the world itself.
    fn placement(&self, ray: &Ray, hit: &Hit) -> Option<Transform> {
        (self.has_instances && !hit.instances.is_empty()).then(|| self.accel.world_from_object(ray, hit))
    }

    fn dressed(
        &self,
        entry: &SurfaceEntry,
        bare: &Surface,
        ray: &Ray,
        hit: &Hit,
        primitive: u32,
        turned: bool,
    ) -> Dressed {
        let placement = self.placement(ray, hit);
        if !turned {
            return entry.dress(bare, primitive, hit.root.local, placement.as_ref(), ray.time);
        }
        let outward = Surface { normal: -bare.normal, dndu: -bare.dndu, dndv: -bare.dndv, ..*bare };
        let mut dressed = entry.dress(&outward, primitive, hit.root.local, placement.as_ref(), ray.time);
        dressed.turn();
        dressed
    }

    fn is_back_of_one_sided(&self, ray: &Ray, hit: &Hit) -> bool {
        let (entry, _, turned) = self.leaf(hit);
        entry.is_one_sided() && {
            // The way its faces run decides, not the normals of vertices.
            let along = self.accel.surface(ray, hit).normal.dot(ray.direction) > 0.0;
            along != (turned != entry.reverse)
        }
    }

    /// Whether a hit stops light. Where coverage is partial, a hash of the ray and of the place decides: the same
    /// wherever it is asked.
    fn is_solid(&self, ray: &Ray, hit: &Hit) -> bool {
        let (entry, part, turned) = self.leaf(hit);
        if !entry.is_visible() {
            return false;
        }
        let Some(alpha) = &entry.alpha else { return true };
        let coverage = match **alpha {
            FloatTexture::Constant(coverage) => coverage,
            _ => {
                let bare = self.accel.surface(ray, hit);
                let dressed = self.dressed(entry, &bare, ray, hit, part, turned);
                alpha.evaluate(&dressed.bare_context())
            }
        };
        if coverage >= 1.0 {
            return true;
        }
        let line = combine(hash_dvec3(ray.origin), hash_dvec3(ray.direction));
        let place = combine(u64::from(hit.id) << 32 | u64::from(hit.primitive), hit.root.t.to_bits());
        uniform_f32(combine(line, place)) < coverage
    }
}
