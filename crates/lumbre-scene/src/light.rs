//! The closed set of lights: sampled from a point, and asked for the density of what a ray found.

mod area;
mod brightness;
pub(crate) mod choice;
mod colour;
mod delta;
pub(crate) mod environment;
pub mod lanes;
mod mesh;
mod moving;
mod pairs;
mod placed;
pub(crate) mod portal;
mod projection;
mod rectangle;
mod tree;

use lumbre_geometry::{Aabb, Ray, Surface};
use lumbre_math::{DVec2, DVec3};
use lumbre_shading::{Scatter, Spectrum};

pub use area::ShapeLight;
pub(crate) use area::power;
pub use choice::Sampling;
pub use delta::{DistantLight, GoniometricLight, PointLight, SpotLight};
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
    /// The same in all directions from a point.
    Point(PointLight),
    /// A cone from a point.
    Spot(SpotLight),
    /// From a point, by direction as a picture says.
    Goniometric(GoniometricLight),
    /// From a point, a picture.
    Projection(ProjectionLight),
    /// Parallel light.
    Distant(DistantLight),
    /// The same from all around.
    Uniform(UniformLight),
    /// A picture all around.
    Environment(Environment),
    /// Light from all around, through a rectangle.
    Portal(PortalLight),
    /// One exact shape.
    Shape(ShapeLight),
    /// Triangles.
    Mesh(MeshLight),
    /// One of the two in an object that stands in the world once, moving or not.
    Placed(PlacedLight),
    /// A light by POV-Ray's laws.
    Pov(std::sync::Arc<crate::pov::PovLight>),
    /// A light from a point or in one direction that moves.
    Moving(MovingLight),
}

/// Light that arrives at a point, from a direction that a light chose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSample {
    /// Unit, towards the light.
    pub towards: DVec3,
    /// Where it comes from; `None` for what is infinitely far away.
    pub end: Option<LightPoint>,
    /// The radiance that arrives, if nothing stands in its way; for [`Scatter::Delta`], the irradiance on a surface that
    /// faces it.
    pub radiance: Spectrum,
    /// How the direction was chosen, per unit solid angle.
    pub scatter: Scatter,
}

/// Where a shadow ray ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightPoint {
    /// The point.
    pub point: DVec3,
    /// A bound on the error of each component of it; zero for points given exactly.
    pub error: DVec3,
    /// The normal there; zero where there is no surface.
    pub normal: DVec3,
}

impl LightSample {
    /// The same where directions are more likely by this factor: the density grows by it, or the radiance of a delta light, which
    /// stands for its own division by it, shrinks.
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
    /// Light that arrives at `from` at a time, by two uniform numbers. `None` where the light chose a direction from which nothing
    /// comes.
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

    /// What a tree knows of it, piece by piece; nothing for lights that are everywhere.
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
            Self::Distant(_) | Self::Uniform(_) | Self::Environment(_) | Self::Portal(_) | Self::Pov(_) => {
                Vec::new()
            }
        }
    }

    /// The direction of parallel light at a time; `None` for all other.
    fn towards(&self, time: f64) -> Option<DVec3> {
        match self {
            Self::Distant(light) => Some(light.towards),
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

    /// The density per unit solid angle with which the light chooses what `ray` hit: a surface, in the space of its tree,
    /// for lights that have one.
    /// 0 for lights that no ray can hit.
    pub(crate) fn pdf(&self, ray: &Ray, surface: Option<(&Surface, u32)>) -> f64 {
        match (self, surface) {
            (Self::Uniform(_), None) => UniformLight::pdf(),
            (Self::Environment(light), None) => light.pdf(ray.direction),
            (Self::Portal(light), None) => light.pdf(ray.origin, ray.direction),
            (Self::Shape(light), Some((surface, _))) => light.pdf(ray, surface),
            (Self::Mesh(light), Some((surface, triangle))) => light.pdf(ray, surface, triangle),
            (Self::Placed(light), Some(surface)) => light.pdf(ray, surface),
            (Self::Uniform(_) | Self::Environment(_) | Self::Portal(_), Some(_))
            | (Self::Shape(_) | Self::Mesh(_) | Self::Placed(_), None)
            | (Self::Point(_) | Self::Spot(_) | Self::Goniometric(_) | Self::Projection(_), _)
            | (Self::Distant(_) | Self::Moving(_) | Self::Pov(_), _) => 0.0,
        }
    }

    /// The surface, in the space of its tree, of which a ray from `from` met this point, both in the world; of a mesh, as far as densities
    /// depend on it. `None` for what is no surface, and for a point that is not on it.
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
            Self::Uniform(_) | Self::Environment(_) | Self::Portal(_) => None,
        }
    }

    /// The radiance that arrives at `from` along the unit `direction` from infinitely far away.
    pub fn escaped(&self, from: DVec3, direction: DVec3) -> Spectrum {
        match self {
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

    /// The irradiance at a time of a surface at `at` that faces `normal` (unit), if nothing stands in the way; `None` for lights
    /// that are surfaces.
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
            Self::Uniform(light) => Some(light.radiance * std::f32::consts::PI),
            Self::Environment(light) => Some(light.irradiance(normal)),
            Self::Portal(light) => Some(light.irradiance(at, normal)),
            Self::Moving(light) => light.irradiance(at, time, normal),
            Self::Shape(_) | Self::Mesh(_) | Self::Placed(_) => None,
        }
    }

    /// Whether rays that leave the scene meet it.
    pub fn is_infinite(&self) -> bool {
        match self {
            Self::Uniform(_) | Self::Environment(_) | Self::Portal(_) => true,
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

    /// Whether its light comes from one direction alone at each place.
    pub fn is_delta(&self) -> bool {
        match self {
            Self::Point(_)
            | Self::Spot(_)
            | Self::Goniometric(_)
            | Self::Projection(_)
            | Self::Distant(_)
            | Self::Pov(_)
            | Self::Moving(_) => true,
            Self::Uniform(_) | Self::Environment(_) | Self::Portal(_) => false,
            Self::Shape(_) | Self::Mesh(_) | Self::Placed(_) => false,
        }
    }

    /// Whether it is a surface, which rays meet.
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
            Self::Uniform(_) | Self::Environment(_) | Self::Portal(_) => false,
        }
    }

    /// An estimate of the power that it sends into a scene of this radius, by which it is chosen.
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
            Self::Pov(light) => disk * mean(light.irradiance()),
            Self::Uniform(light) => PI * disk * mean(light.radiance),
            Self::Environment(light) => PI * disk * light.mean(),
            Self::Portal(light) => light.power(),
            Self::Shape(light) => light.power,
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
            Self::Distant(_) => "distant",
            Self::Pov(_) => "pov",
            Self::Uniform(_) | Self::Environment(_) | Self::Portal(_) => "infinite",
            Self::Shape(_) | Self::Mesh(_) | Self::Placed(_) => "diffuse",
            Self::Moving(light) => light.light.name(),
        }
    }
}
