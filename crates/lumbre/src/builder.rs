//! Building a scene in Rust.

use std::sync::Arc;

use lumbre_geometry::{Curves, Shape};
use lumbre_image::Rgb;
use lumbre_kernel::CustomGeometry;
use lumbre_math::Transform;
use lumbre_scene::{
    AreaLightDesc, Boundary, Camera, CsgDesc, CsgOperation, FilmDesc, GeometryDesc, InstanceDesc,
    IntegratorDesc, LightDesc, MaterialId, MediumId, MeshDesc, NamedMaterial, ObjectDesc, ObjectId,
    SamplerDesc, SceneDesc, ShapeDesc,
};
use lumbre_shading::medium::Medium;
use lumbre_shading::{Material, MaterialKind};

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
    form: Form,
    world_from_object: Transform,
    material: Option<Arc<Material>>,
    light: Option<AreaLightDesc>,
    medium: Option<Arc<Medium>>,
}

#[derive(Clone, Debug)]
enum Form {
    Geometry(GeometryDesc),
    // Shared, so that bodies which are made of one another take no more memory than they are many.
    Csg { operation: CsgOperation, operands: Arc<Vec<Vec<ShapeBuilder>>> },
}

impl ShapeBuilder {
    /// An exact shape.
    pub fn exact(shape: impl Into<Shape>) -> Self {
        Self::new(GeometryDesc::Exact(shape.into()))
    }

    /// Curves with a width: hair, grass.
    pub fn curves(curves: Curves) -> Self {
        Self::new(GeometryDesc::Curves(Arc::new(curves)))
    }

    /// An implicit surface `F(x, y, z) = 0`, or other geometry of a program's own.
    pub fn custom(geometry: impl CustomGeometry + 'static) -> Self {
        Self::new(GeometryDesc::Custom(Arc::new(geometry)))
    }

    /// A mesh.
    pub fn mesh(mesh: MeshDesc) -> Self {
        Self::new(GeometryDesc::Mesh(Arc::new(mesh)))
    }

    /// A shape of any geometry, in its own space, grey.
    pub fn new(geometry: GeometryDesc) -> Self {
        Self::of(Form::Geometry(geometry))
    }

    /// Constructive solid geometry of two or more operands, each the union of its shapes. Shapes without a material or
    /// light take those of the whole. In results, each shape counts in its place, and the whole has no number of its
    /// own.
    ///
    /// ```
    /// use lumbre::description::CsgOperation;
    /// use lumbre::geometry::{Cuboid, Sphere};
    /// use lumbre::{DVec3, Ray, SceneBuilder, ShapeBuilder};
    ///
    /// let block = ShapeBuilder::exact(Cuboid::new(-2.0 * DVec3::ONE, 2.0 * DVec3::ONE)?);
    /// let hole = ShapeBuilder::exact(Sphere::new(2.0 * DVec3::Z, 1.5)?);
    /// let dented = ShapeBuilder::csg(CsgOperation::Difference, vec![vec![block], vec![hole]]);
    /// let scene = SceneBuilder::new().shape(dented).build()?;
    /// let hit = scene.closest(&Ray::new(5.0 * DVec3::Z, -DVec3::Z)).expect("the bottom of the dent is there");
    /// assert_eq!((hit.t, hit.shape, hit.front), (4.5, 1, true));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn csg(operation: CsgOperation, operands: Vec<Vec<Self>>) -> Self {
        Self::of(Form::Csg { operation, operands: Arc::new(operands) })
    }

    fn of(form: Form) -> Self {
        Self { form, world_from_object: Transform::IDENTITY, material: None, light: None, medium: None }
    }

    /// Sets the transform.
    #[must_use]
    pub fn at(self, world_from_object: Transform) -> Self {
        Self { world_from_object, ..self }
    }

    /// Sets the material, which many shapes may share.
    #[must_use]
    pub fn material(self, material: impl Into<Arc<Material>>) -> Self {
        Self { material: Some(material.into()), ..self }
    }

    /// Fills its inside with a medium. Without a material its surface is not seen: light goes straight on through it.
    ///
    /// ```
    /// use lumbre::geometry::Sphere;
    /// use lumbre::shading::medium::{HomogeneousMedium, Medium};
    /// use lumbre::shading::Spectrum;
    /// use lumbre::{DVec3, SceneBuilder, ShapeBuilder};
    ///
    /// let haze = HomogeneousMedium { extinction: Spectrum::splat(0.2), albedo: Spectrum::splat(0.9), asymmetry: 0.3 };
    /// let haze = Medium::Homogeneous { medium: haze, glow: Spectrum::BLACK, spectra: None };
    /// let cloud = ShapeBuilder::exact(Sphere::new(DVec3::ZERO, 3.0)?).medium(haze);
    /// assert!(SceneBuilder::new().shape(cloud).build()?.resolved().has_media());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn medium(self, medium: impl Into<Arc<Medium>>) -> Self {
        Self { medium: Some(medium.into()), ..self }
    }

    /// Makes its front emit a radiance.
    #[must_use]
    pub fn shining(self, radiance: Rgb) -> Self {
        let light = AreaLightDesc {
            radiance,
            image: None,
            by_vertices: false,
            two_sided: false,
            power: None,
            spectrum: None,
        };
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
        let shape = self.described(shape);
        self.desc.shapes.push(shape);
        self
    }

    /// Adds instances of a group of shapes, one for each map, at the memory of one; none without a map.
    ///
    /// ```
    /// use lumbre::geometry::Sphere;
    /// use lumbre::{DVec3, Ray, SceneBuilder, ShapeBuilder, Transform};
    ///
    /// let ball = ShapeBuilder::exact(Sphere::new(DVec3::ZERO, 0.5)?);
    /// let places = (0..3).map(|i| Transform::translate(DVec3::new(0.0, 0.0, 2.0 * f64::from(i))));
    /// let scene = SceneBuilder::new().instances([ball], places).build()?;
    /// let hit = scene.closest(&Ray::new(DVec3::new(-5.0, 0.0, 4.0), DVec3::X)).expect("the third is there");
    /// assert_eq!((hit.t, hit.instance), (4.5, Some(2)));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn instances(
        mut self,
        shapes: impl IntoIterator<Item = ShapeBuilder>,
        places: impl IntoIterator<Item = Transform>,
    ) -> Self {
        let shapes = shapes.into_iter().map(|shape| self.described(shape)).collect();
        let object = ObjectId(self.desc.objects.len() as u32);
        self.desc.objects.push(ObjectDesc { name: String::new(), shapes, instances: Vec::new() });
        let place = |place: Transform| InstanceDesc { object, world_from_object: place.into() };
        self.desc.instances.extend(places.into_iter().map(place));
        self
    }

    /// The description of a shape, with an index and a material of its own.
    fn described(&mut self, shape: ShapeBuilder) -> ShapeDesc {
        let ShapeBuilder { form, world_from_object, material, light, medium } = shape;
        let boundary =
            medium.map(|medium| Boundary { inside: Some(self.described_medium(medium)), outside: None });
        let material =
            material.or_else(|| boundary.map(|_| Arc::new(Material::new(MaterialKind::Interface))));
        // Every shape has a material, so that their numbers are the same; a CSG has those of its first shape.
        let id = MaterialId(self.desc.materials.len() as u32);
        let index = id.0;
        let geometry = match form {
            Form::Geometry(geometry) => {
                let material = material.unwrap_or_else(|| Material::default_diffuse().into());
                self.desc.materials.push(NamedMaterial { name: None, material });
                geometry
            }
            Form::Csg { operation, operands } => {
                let mut part = |shape: ShapeBuilder| {
                    self.described(ShapeBuilder {
                        material: shape.material.or_else(|| material.clone()),
                        light: shape.light.or_else(|| light.clone()),
                        ..shape
                    })
                };
                let operands = Arc::unwrap_or_clone(operands).into_iter();
                let operands = operands.map(|shapes| Arc::new(shapes.into_iter().map(&mut part).collect()));
                GeometryDesc::Csg(CsgDesc { operation, operands: operands.collect() })
            }
        };
        let light = if matches!(geometry, GeometryDesc::Csg(_)) { None } else { light };
        ShapeDesc {
            index,
            geometry,
            world_from_object,
            reverse_orientation: false,
            material: Some(id),
            boundary,
            area_light: light,
            alpha: None,
        }
    }

    /// The number of a medium, the same for all shapes that share it.
    fn described_medium(&mut self, medium: Arc<Medium>) -> MediumId {
        let media = &mut self.desc.media;
        let position = media.iter().position(|known| Arc::ptr_eq(known, &medium));
        MediumId(position.unwrap_or_else(|| {
            media.push(medium);
            media.len() - 1
        }) as u32)
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
