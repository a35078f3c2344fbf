//! Building a scene in Rust.

use std::sync::Arc;

use lumbre_geometry::Shape;
use lumbre_image::Rgb;
use lumbre_math::Transform;
use lumbre_scene::{
    AreaLightDesc, Camera, FilmDesc, GeometryDesc, IntegratorDesc, LightDesc, MaterialId, MeshDesc,
    NamedMaterial, SamplerDesc, SceneDesc, ShapeDesc,
};
use lumbre_shading::Material;

use crate::{Error, Scene};

/// Builds a scene piece by piece. Defaults are an automatic camera that frames everything, studio light, and a
/// grey material.
#[derive(Clone, Debug, Default)]
pub struct SceneBuilder {
    desc: SceneDesc,
}

/// A shape with its material, before it is added to a scene.
#[derive(Clone, Debug)]
pub struct ShapeBuilder {
    geometry: GeometryDesc,
    world_from_object: Transform,
    material: Option<Material>,
    light: Option<AreaLightDesc>,
}

impl ShapeBuilder {
    /// An exact shape.
    pub fn exact(shape: impl Into<Shape>) -> Self {
        Self::new(GeometryDesc::Exact(shape.into()))
    }

    /// A mesh.
    pub fn mesh(mesh: MeshDesc) -> Self {
        Self::new(GeometryDesc::Mesh(Arc::new(mesh)))
    }

    /// A shape of any geometry, in its own space, grey.
    pub fn new(geometry: GeometryDesc) -> Self {
        Self { geometry, world_from_object: Transform::IDENTITY, material: None, light: None }
    }

    /// Sets the transform.
    #[must_use]
    pub fn at(self, world_from_object: Transform) -> Self {
        Self { world_from_object, ..self }
    }

    /// Sets the material.
    #[must_use]
    pub fn material(self, material: Material) -> Self {
        Self { material: Some(material), ..self }
    }

    /// Makes its front emit a radiance.
    #[must_use]
    pub fn shining(self, radiance: Rgb) -> Self {
        let light =
            AreaLightDesc { radiance, image: None, by_vertices: false, two_sided: false, power: None };
        Self { light: Some(light), ..self }
    }
}

impl SceneBuilder {
    /// An empty scene.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a shape.
    #[must_use]
    pub fn shape(mut self, shape: ShapeBuilder) -> Self {
        let ShapeBuilder { geometry, world_from_object, material, light } = shape;
        let id = MaterialId(self.desc.materials.len() as u32);
        let material = Arc::new(material.unwrap_or_else(Material::default_diffuse));
        self.desc.materials.push(NamedMaterial { name: None, material });
        self.desc.shapes.push(ShapeDesc {
            index: self.desc.shapes.len() as u32,
            geometry,
            world_from_object,
            reverse_orientation: false,
            material: Some(id),
            area_light: light,
            alpha: None,
        });
        self
    }

    /// Adds a light other than a shape.
    #[must_use]
    pub fn light(mut self, light: LightDesc) -> Self {
        self.desc.lights.push(light);
        self
    }

    /// Adds a camera; the first is the default.
    #[must_use]
    pub fn camera(mut self, camera: Camera) -> Self {
        self.desc.cameras.push(camera);
        self
    }

    /// Sets the picture's size and exposure.
    #[must_use]
    pub fn film(mut self, film: FilmDesc) -> Self {
        self.desc.film = film;
        self
    }

    /// Sets the integrator.
    #[must_use]
    pub fn integrator(mut self, integrator: IntegratorDesc) -> Self {
        self.desc.integrator = integrator;
        self
    }

    /// Sets the sampler.
    #[must_use]
    pub fn sampler(mut self, sampler: SamplerDesc) -> Self {
        self.desc.sampler = sampler;
        self
    }

    /// The current description.
    pub fn description(&self) -> &SceneDesc {
        &self.desc
    }

    /// Builds the scene.
    ///
    /// # Errors
    /// [`Error::Build`].
    pub fn build(self) -> Result<Scene, Error> {
        Scene::from_description(self.desc)
    }
}
