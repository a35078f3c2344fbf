//! The closed set of lights: sampling from a point, and densities of rays that hit a light.

mod area;
mod brightness;
pub(crate) mod choice;
mod colour;
mod delta;
mod disc;
pub(crate) mod environment;
pub mod lanes;
mod mesh;
mod moving;
mod pairs;
mod placed;
pub(crate) mod portal;
mod projection;
mod rectangle;
mod texels;
mod tree;

use lumbre_geometry::{Aabb, Ray, Surface};
use lumbre_math::{DVec2, DVec3};
use lumbre_shading::{Scatter, Spectrum};

pub use area::ShapeLight;
pub(crate) use area::power;
pub use choice::Sampling;
pub use delta::{DistantLight, GoniometricLight, PointLight, SpotLight};
pub use disc::DiscLight;
pub use environment::{Environment, UniformLight};
pub use mesh::MeshLight;
pub use moving::MovingLight;
pub(crate) use moving::swept;
pub use placed::PlacedLight;
pub use portal::PortalLight;
pub use projection::ProjectionLight;
pub(crate) use tree::Place;
use tree::{Emitter, Facing};

use crate::surface::SurfaceEntry;

/// A light of a [`crate::Scene`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct LightId(pub u32);

/// The kinds of light.
#[derive(Clone, Debug)]
pub enum Light {
    /// The same intensity in all directions from a point.
    Point(PointLight),
    /// A cone from a point.
    Spot(SpotLight),
    /// From a point, with an image of intensity by direction.
    Goniometric(GoniometricLight),
    /// A picture projected from a point.
    Projection(ProjectionLight),
    /// Parallel light.
    Distant(DistantLight),
    /// A disc at infinity.
    Disc(DiscLight),
    /// Uniform radiance from all directions.
    Uniform(UniformLight),
    /// An image over all directions.
    Environment(Environment),
    /// Light from all directions, through a rectangle.
    Portal(PortalLight),
    /// One exact shape.
    Shape(ShapeLight),
    /// Triangles.
    Mesh(MeshLight),
    /// A shape or mesh light in an object with one placement, moving or not.
    Placed(PlacedLight),
    /// A light by POV-Ray's laws.
    Pov(std::sync::Arc<crate::pov::PovLight>),
    /// A moving point light, or a moving light in one direction.
    Moving(MovingLight),
}

/// Light that arrives at a point from a sampled direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSample {
    /// Unit, towards the light.
    pub towards: DVec3,
    /// Its source; `None` for a light at infinity.
    pub end: Option<LightPoint>,
    /// The radiance that arrives if unoccluded; for [`Scatter::Delta`], the irradiance on a surface perpendicular to
    /// it.
    pub radiance: Spectrum,
    /// How the direction was chosen, per unit solid angle.
    pub scatter: Scatter,
}

/// The end of a shadow ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightPoint {
    /// The point.
    pub point: DVec3,
    /// An error bound of each component; zero for exact points.
    pub error: DVec3,
    /// The normal there; zero without a surface.
    pub normal: DVec3,
}

impl LightSample {
    /// The sample with directions more likely by this factor: the density grows by it; the radiance of a delta light,
    /// which includes the division by the density, shrinks.
    fn of_density(mut self, factor: f64) -> Self {
        match &mut self.scatter {
            Scatter::Density(pdf) => *pdf *= factor as f32,
            Scatter::Delta => self.radiance *= (1.0 / factor) as f32,
        }
        self
    }
}

impl LightPoint {
    fn on(surface: &Surface) -> Self {
        Self { point: surface.point, error: surface.point_error, normal: surface.normal }
    }

    fn bare(point: DVec3) -> Self {
        Self { point, error: DVec3::ZERO, normal: DVec3::ZERO }
    }
}

impl Light {
    /// Light that arrives at `from` at a time, from two uniform numbers. `None` if no light arrives from the chosen
    /// direction.
    pub(crate) fn sample(
        &self,
        entries: &[SurfaceEntry],
        from: DVec3,
        time: f64,
        u: DVec2,
    ) -> Option<LightSample> {
        match self {
            Self::Point(light) => light.sample(from),
            Self::Spot(light) => light.sample(from),
            Self::Goniometric(light) => light.sample(from),
            Self::Projection(light) => light.sample(from),
            Self::Distant(light) => Some(light.sample()),
            Self::Disc(light) => {
                let (towards, pdf) = light.sample(u);
                let radiance = light.radiance(towards);
                Some(LightSample { towards, end: None, radiance, scatter: Scatter::Density(pdf as f32) })
            }
            Self::Uniform(light) => Some(light.sample(u)),
            Self::Environment(light) => light.sample(u),
            Self::Portal(light) => light.sample(from, u),
            Self::Shape(light) => light.sample(&entries[light.entry as usize], from, u),
            Self::Mesh(light) => light.sample(&entries[light.entry as usize], from, u),
            Self::Placed(light) => light.sample(entries, from, time, u),
            Self::Pov(light) => light.sample(from, u),
            Self::Moving(light) => light.sample(entries, from, time, u),
        }
    }

    /// The light's entries in a light tree, piece by piece; empty for lights that are everywhere.
    pub(crate) fn emitters(&self, entries: &[SurfaceEntry]) -> Vec<Emitter> {
        let mean = |colour: Spectrum| f64::from(colour.average());
        let at =
            |from: DVec3, facing, strength| vec![Emitter { bounds: Aabb::around([from]), facing, strength }];
        match self {
            Self::Point(light) => at(light.from, Facing::ANY, mean(light.intensity)),
            Self::Goniometric(light) => at(light.from, Facing::ANY, light.mean()),
            Self::Spot(light) => at(
                light.from,
                Facing::cone(light.axis, light.cos_start, light.cos_end),
                mean(light.intensity),
            ),
            Self::Projection(light) => {
                at(light.from, Facing::cone(light.axis, light.cos_corner, light.cos_corner), light.mean())
            }
            Self::Shape(light) => light.emitter(&entries[light.entry as usize]).into_iter().collect(),
            Self::Mesh(light) => light.emitters(&entries[light.entry as usize]),
            Self::Placed(light) => light.emitter(entries).into_iter().collect(),
            Self::Moving(light) => light.emitter(entries).into_iter().collect(),
            Self::Distant(_)
            | Self::Disc(_)
            | Self::Uniform(_)
            | Self::Environment(_)
            | Self::Portal(_)
            | Self::Pov(_) => Vec::new(),
        }
    }

    /// The direction of parallel light at a time, and of the centre of a disc; `None` for other lights.
    fn towards(&self, time: f64) -> Option<DVec3> {
        match self {
            Self::Distant(light) => Some(light.towards),
            Self::Disc(light) => Some(light.towards()),
            Self::Moving(light) => light.towards(time),
            Self::Point(_)
            | Self::Spot(_)
            | Self::Goniometric(_)
            | Self::Projection(_)
            | Self::Pov(_)
            | Self::Uniform(_)
            | Self::Environment(_)
            | Self::Portal(_) => None,
            Self::Shape(_) | Self::Mesh(_) | Self::Placed(_) => None,
        }
    }

    /// The sine of the angle between [`Light::towards`] and the edge of a disc; 0 for other lights.
    fn half_width(&self) -> f64 {
        if let Self::Disc(light) = self { light.sine() } else { 0.0 }
    }

    /// The density per unit solid angle with which the light samples what `ray` hit. `surface` is the surface in the
    /// space of its tree, for lights that have one. 0 for lights that no ray can hit.
    pub(crate) fn pdf(&self, ray: &Ray, surface: Option<(&Surface, u32)>) -> f64 {
        match (self, surface) {
            (Self::Uniform(_), None) => UniformLight::pdf(),
            (Self::Disc(light), None) => light.pdf(ray.direction),
            (Self::Environment(light), None) => light.pdf(ray.direction),
            (Self::Portal(light), None) => light.pdf(ray.origin, ray.direction),
            (Self::Shape(light), Some((surface, _))) => light.pdf(ray, surface),
            (Self::Mesh(light), Some((surface, triangle))) => light.pdf(ray, surface, triangle),
            (Self::Placed(light), Some(surface)) => light.pdf(ray, surface),
            (Self::Disc(_) | Self::Uniform(_) | Self::Environment(_) | Self::Portal(_), Some(_))
            | (Self::Shape(_) | Self::Mesh(_) | Self::Placed(_), None)
            | (Self::Point(_) | Self::Spot(_) | Self::Goniometric(_) | Self::Projection(_), _)
            | (Self::Distant(_) | Self::Moving(_) | Self::Pov(_), _) => 0.0,
        }
    }

    /// The light's surface, in the space of its tree, at this point of a ray from `from`; both points are in the world.
    /// For a mesh, only the data that densities need. `None` for lights without a surface, and for a point off the
    /// surface.
    fn surface_at(&self, from: DVec3, point: DVec3, time: f64) -> Option<Surface> {
        match self {
            Self::Shape(light) => light.surface_at(from, point),
            Self::Mesh(light) => Some(light.surface_at(point)),
            Self::Placed(light) => light.surface_at(from, point, time),
            Self::Point(_)
            | Self::Spot(_)
            | Self::Goniometric(_)
            | Self::Projection(_)
            | Self::Distant(_)
            | Self::Pov(_)
            | Self::Moving(_) => None,
            Self::Disc(_) | Self::Uniform(_) | Self::Environment(_) | Self::Portal(_) => None,
        }
    }

    /// The radiance that arrives at `from` along the unit `direction` from infinity.
    pub fn escaped(&self, from: DVec3, direction: DVec3) -> Spectrum {
        match self {
            Self::Disc(light) => light.radiance(direction),
            Self::Uniform(light) => light.radiance,
            Self::Environment(light) => light.radiance(direction),
            Self::Portal(light) => light.radiance(from, direction),
            Self::Point(_)
            | Self::Spot(_)
            | Self::Goniometric(_)
            | Self::Projection(_)
            | Self::Distant(_)
            | Self::Pov(_)
            | Self::Moving(_) => Spectrum::BLACK,
            Self::Shape(_) | Self::Mesh(_) | Self::Placed(_) => Spectrum::BLACK,
        }
    }

    /// The unoccluded irradiance at a time on a surface at `at` with the unit `normal`; `None` for lights that are
    /// surfaces.
    pub fn irradiance(&self, at: DVec3, time: f64, normal: DVec3) -> Option<Spectrum> {
        let of = |sample: Option<LightSample>| {
            sample.map_or(Spectrum::BLACK, |s| s.radiance * normal.dot(s.towards).max(0.0) as f32)
        };
        match self {
            Self::Point(light) => Some(of(light.sample(at))),
            Self::Spot(light) => Some(of(light.sample(at))),
            Self::Goniometric(light) => Some(of(light.sample(at))),
            Self::Projection(light) => Some(of(light.sample(at))),
            Self::Distant(light) => Some(of(Some(light.sample()))),
            Self::Pov(light) => Some(of(light.sample(at, DVec2::splat(0.5)))),
            Self::Disc(light) => Some(light.irradiance(normal)),
            Self::Uniform(light) => Some(light.radiance * std::f32::consts::PI),
            Self::Environment(light) => Some(light.irradiance(normal)),
            Self::Portal(light) => Some(light.irradiance(at, normal)),
            Self::Moving(light) => light.irradiance(at, time, normal),
            Self::Shape(_) | Self::Mesh(_) | Self::Placed(_) => None,
        }
    }

    /// Whether rays that leave the scene hit it.
    pub fn is_infinite(&self) -> bool {
        match self {
            Self::Disc(_) | Self::Uniform(_) | Self::Environment(_) | Self::Portal(_) => true,
            Self::Point(_)
            | Self::Spot(_)
            | Self::Goniometric(_)
            | Self::Projection(_)
            | Self::Distant(_)
            | Self::Pov(_)
            | Self::Moving(_) => false,
            Self::Shape(_) | Self::Mesh(_) | Self::Placed(_) => false,
        }
    }

    /// Whether its light arrives at each point from a single direction.
    pub fn is_delta(&self) -> bool {
        match self {
            Self::Point(_)
            | Self::Spot(_)
            | Self::Goniometric(_)
            | Self::Projection(_)
            | Self::Distant(_)
            | Self::Pov(_)
            | Self::Moving(_) => true,
            Self::Disc(_) | Self::Uniform(_) | Self::Environment(_) | Self::Portal(_) => false,
            Self::Shape(_) | Self::Mesh(_) | Self::Placed(_) => false,
        }
    }

    /// Whether it is a surface, which rays can hit.
    pub(crate) fn is_surface(&self) -> bool {
        match self {
            Self::Shape(_) | Self::Mesh(_) | Self::Placed(_) => true,
            Self::Point(_)
            | Self::Spot(_)
            | Self::Goniometric(_)
            | Self::Projection(_)
            | Self::Distant(_)
            | Self::Pov(_)
            | Self::Moving(_) => false,
            Self::Disc(_) | Self::Uniform(_) | Self::Environment(_) | Self::Portal(_) => false,
        }
    }

    /// An estimate of its power in a scene of this radius, for choosing among lights.
    pub fn power(&self, scene_radius: f64) -> f64 {
        use std::f64::consts::PI;
        let disk = PI * scene_radius * scene_radius;
        let mean = |colour: Spectrum| f64::from(colour.average());
        match self {
            Self::Point(light) => 4.0 * PI * mean(light.intensity),
            Self::Goniometric(light) => 4.0 * PI * light.mean(),
            Self::Projection(light) => light.flux(),
            Self::Spot(light) => light.solid_angle() * mean(light.intensity),
            Self::Distant(light) => disk * mean(light.irradiance),
            Self::Disc(light) => disk * mean(light.facing()),
            Self::Pov(light) => disk * mean(light.irradiance()),
            Self::Uniform(light) => PI * disk * mean(light.radiance),
            Self::Environment(light) => PI * disk * light.mean(),
            Self::Portal(light) => light.power(),
            Self::Shape(light) => light.power(),
            Self::Mesh(light) => light.power,
            Self::Placed(light) => light.power(scene_radius),
            Self::Moving(light) => light.light.power(scene_radius),
        }
    }

    /// The name in the scene language.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Point(_) => "point",
            Self::Spot(_) => "spot",
            Self::Goniometric(_) => "goniometric",
            Self::Projection(_) => "projection",
            Self::Distant(_) | Self::Disc(_) => "distant",
            Self::Pov(_) => "pov",
            Self::Uniform(_) | Self::Environment(_) | Self::Portal(_) => "infinite",
            Self::Shape(_) | Self::Mesh(_) | Self::Placed(_) => "diffuse",
            Self::Moving(light) => light.light.name(),
        }
    }
}
