//! What an integrator does along one path, step by step, for those who want to see it.

use lumbre_geometry::Ray;
use lumbre_math::{DVec2, DVec3, Vec3};
use lumbre_scene::{Interaction, LightSample};
use lumbre_shading::{Scatter, Spectrum};

use crate::transport::RayCounts;
use crate::transport::direct::Bounce;

/// What is kept of the rays that an integrator casts: how many there were, and what became of them where that is asked for.
#[derive(Clone, Debug, Default)]
pub struct Record {
    /// How many there were.
    pub counts: RayCounts,
    /// What became of them; `None` where nobody asks, which costs nothing.
    pub journal: Option<Vec<Event>>,
}

/// What happens along a path, in order. The light of a path is the sum of what its [`Event::Added`] add, in their order.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// A ray met a surface.
    Met(Box<Met>),
    /// A ray left the scene.
    Left {
        /// The ray.
        ray: Ray,
    },
    /// A light was sampled, or every light was.
    Sampled(Box<SampledLight>),
    /// Light was added to that of the path.
    Added {
        /// Where it comes from.
        source: Source,
        /// The light.
        radiance: Spectrum,
        /// The weight against the other way to find it.
        weight: f32,
        /// What the path lets through of it.
        throughput: Spectrum,
        /// The product.
        added: Spectrum,
    },
    /// Photons were found near the point; the light that they bring is added next.
    Photons(Vec<MergedPhoton>),
    /// A direction was chosen to go on in.
    Scattered(Box<Scattered>),
    /// The path goes on by chance.
    Roulette {
        /// The probability to go on; the throughput grows by its inverse.
        probability: f32,
        /// Whether it goes on.
        survives: bool,
    },
    /// The path came through a medium, or scattered in it.
    Medium {
        /// How far it came.
        distance: f64,
        /// Whether it scattered there.
        scattered: bool,
        /// What it carries after that.
        throughput: Spectrum,
    },
    /// Ground that catches shadows: the share of the light on it that something blocks.
    Caught {
        /// The share.
        blocked: Spectrum,
    },
    /// A ray looked whether a place is open.
    Looked {
        /// The ray.
        ray: Ray,
        /// Whether something is in its way.
        is_occluded: bool,
    },
    /// The path ends.
    Ended(End),
}

/// Where light comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// The surface that the ray met.
    Surface,
    /// A light at infinity.
    Infinity,
    /// The medium that the path goes through.
    Medium,
    /// What the surface scatters of a sampled light.
    Sampled,
    /// What the surface scatters of all lights.
    Direct,
    /// What the surface scatters of photons near the point.
    Caustics,
}

/// Why a path ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// It has as many bounces as it may have.
    Depth,
    /// Nothing scatters there.
    Nothing,
    /// All is absorbed.
    Absorbed,
    /// By chance: see [`Event::Roulette`].
    Roulette,
    /// In a medium.
    Medium,
}

/// A surface that a ray met.
#[derive(Clone, Debug, PartialEq)]
pub struct Met {
    /// The ray.
    pub ray: Ray,
    /// The number of bounces before.
    pub depth: u32,
    /// The point.
    pub point: DVec3,
    /// The geometric normal, outward.
    pub normal: DVec3,
    /// The shading normal.
    pub shading_normal: Vec3,
    /// Surface parameters.
    pub uv: DVec2,
    /// Whether the ray met the outside.
    pub front: bool,
    /// [`lumbre_scene::ShapeDesc::index`] of the shape.
    pub shape: u32,
    /// The triangle of a mesh, else 0.
    pub primitive: u32,
    /// What the path carries there.
    pub throughput: Spectrum,
}

/// A light that was sampled from a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct SampledLight {
    /// The sample.
    pub sample: LightSample,
    /// f · |cos θ| of the surface towards the light.
    pub scattered: Spectrum,
    /// The density with which the BSDF would have chosen the direction; 0 where it does not matter.
    pub bsdf_pdf: f32,
    /// The weight against that, before the division by the light's density.
    pub weight: f32,
    /// The ray towards the light; `None` where no light would come along it.
    pub shadow_ray: Option<Ray>,
    /// What comes through between the light and the surface; black where something is in its way.
    pub passes: Spectrum,
}

/// A photon near a point, and what the path gets of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MergedPhoton {
    /// The unit direction that it came from.
    pub towards: Vec3,
    /// Its irradiance on what it falls on straight: its power over the area in which photons are collected and the number of light paths.
    /// In a medium it is the radiance from all directions, by the volume.
    pub irradiance: Spectrum,
    /// The weight against the other way to find its light.
    pub weight: f32,
    /// What is scattered of it towards the viewer, weighed.
    pub scattered: Spectrum,
}

/// A direction that was chosen to go on in.
#[derive(Clone, Debug, PartialEq)]
pub struct Scattered {
    /// The ray that goes on.
    pub ray: Ray,
    /// f · |cos θ| / pdf.
    pub weight: Spectrum,
    /// How the direction was chosen.
    pub scatter: Scatter,
    /// Whether it is transmitted.
    pub transmitted: bool,
    /// η of the side that it enters over that of the side it leaves.
    pub eta: f32,
    /// What the path carries after that.
    pub throughput: Spectrum,
}

impl Record {
    /// A record that keeps what happens.
    pub fn with_journal() -> Self {
        Self { counts: RayCounts::default(), journal: Some(Vec::new()) }
    }

    /// Notes what happens, where somebody asks.
    #[inline]
    pub(crate) fn note(&mut self, event: impl FnOnce() -> Event) {
        if let Some(journal) = &mut self.journal {
            journal.push(event());
        }
    }

    /// Light to be added to that of a path.
    #[inline]
    pub(crate) fn added(
        &mut self,
        source: Source,
        throughput: Spectrum,
        radiance: Spectrum,
        weight: f32,
    ) -> Spectrum {
        let added = throughput * radiance * weight;
        self.note(|| Event::Added { source, radiance, weight, throughput, added });
        added
    }
}

impl Met {
    pub(crate) fn of(ray: &Ray, here: &Interaction, depth: u32, throughput: Spectrum) -> Box<Self> {
        Box::new(Self {
            ray: *ray,
            depth,
            point: here.surface.point,
            normal: here.surface.normal,
            shading_normal: here.shading.normal,
            uv: here.surface.uv,
            front: here.front,
            shape: here.shape,
            primitive: here.primitive,
            throughput,
        })
    }
}

impl Scattered {
    pub(crate) fn of(ray: &Ray, bounce: &Bounce, throughput: Spectrum) -> Box<Self> {
        Box::new(Self {
            ray: *ray,
            weight: bounce.weight,
            scatter: bounce.scatter,
            transmitted: bounce.transmitted,
            eta: bounce.eta,
            throughput,
        })
    }
}
