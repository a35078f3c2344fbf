//! An optional journal of an integrator's steps along one path.

use lumbre_geometry::Ray;
use lumbre_math::{DVec2, DVec3, Vec3};
use lumbre_scene::{Interaction, LightSample};
use lumbre_shading::{Scatter, Spectrum};

use crate::transport::RayCounts;
use crate::transport::direct::Bounce;

/// Counts of an integrator's rays, and their journal if requested.
#[derive(Clone, Debug, Default)]
pub struct Record {
    /// The counts.
    pub counts: RayCounts,
    /// The events; `None` costs nothing.
    pub journal: Option<Vec<Event>>,
}

/// The events along a path, in order. The light of a path is the sum of its [`Event::Added`], in their order.
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
    /// Light was added to the path.
    Added {
        /// Its source.
        source: Source,
        /// The light.
        radiance: Spectrum,
        /// The weight against the other strategy.
        weight: f32,
        /// The throughput of the path.
        throughput: Spectrum,
        /// The product.
        added: Spectrum,
    },
    /// Photons were found near the point; their light is added next.
    Photons(Vec<MergedPhoton>),
    /// The next direction was sampled.
    Scattered(Box<Scattered>),
    /// Russian roulette.
    Roulette {
        /// The survival probability; the throughput is divided by it.
        probability: f32,
        /// Whether the path survives.
        survives: bool,
    },
    /// The path crossed a medium, or scattered in it.
    Medium {
        /// The distance.
        distance: f64,
        /// Whether it scattered there.
        scattered: bool,
        /// The throughput after that.
        throughput: Spectrum,
    },
    /// A shadow catcher: the share of its light that is blocked.
    Caught {
        /// The share.
        blocked: Spectrum,
    },
    /// A ray tested ambient occlusion.
    Looked {
        /// The ray.
        ray: Ray,
        /// Whether it is occluded.
        is_occluded: bool,
    },
    /// The path ends.
    Ended(End),
}

/// The source of light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// The surface that the ray met.
    Surface,
    /// A light at infinity.
    Infinity,
    /// The medium along the path.
    Medium,
    /// The surface's scattering of a sampled light.
    Sampled,
    /// The surface's scattering of all lights.
    Direct,
    /// The surface's scattering of photons near the point.
    Caustics,
}

/// Why a path ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// It has the maximum number of bounces.
    Depth,
    /// Nothing scatters there.
    Nothing,
    /// All light is absorbed.
    Absorbed,
    /// By Russian roulette: see [`Event::Roulette`].
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
    /// The triangle of a mesh, otherwise 0.
    pub primitive: u32,
    /// The throughput of the path there.
    pub throughput: Spectrum,
}

/// A light that was sampled from a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct SampledLight {
    /// The sample.
    pub sample: LightSample,
    /// f · |cos θ| of the surface towards the light.
    pub scattered: Spectrum,
    /// The density with which the BSDF would have chosen the direction; 0 if it does not matter.
    pub bsdf_pdf: f32,
    /// The weight against that, before the division by the light's density.
    pub weight: f32,
    /// The ray towards the light; `None` if no light would come along it.
    pub shadow_ray: Option<Ray>,
    /// The transmittance between the light and the surface; black if occluded.
    pub passes: Spectrum,
}

/// A photon near a point, and its contribution to the path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MergedPhoton {
    /// The unit direction that it came from.
    pub towards: Vec3,
    /// Its irradiance on a surface perpendicular to it: its power divided by the area in which photons are collected
    /// and the number of light paths. In a medium, the radiance from all directions, per volume.
    pub irradiance: Spectrum,
    /// The weight against the other strategy for its light.
    pub weight: f32,
    /// The weighted light that is scattered towards the viewer.
    pub scattered: Spectrum,
}

/// The next direction of a path.
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
    /// η of the side that it enters over that of the side that it leaves.
    pub eta: f32,
    /// The throughput after that.
    pub throughput: Spectrum,
}

impl Record {
    /// A record with a journal.
    pub fn with_journal() -> Self {
        Self { counts: RayCounts::default(), journal: Some(Vec::new()) }
    }

    /// Appends an event, if there is a journal.
    #[inline]
    pub(crate) fn note(&mut self, event: impl FnOnce() -> Event) {
        if let Some(journal) = &mut self.journal {
            journal.push(event());
        }
    }

    /// Light to add to a path.
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
