//! The ground plane.

use std::sync::Arc;

use lumbre_geometry::Plane;
use lumbre_math::{DVec3, Transform};
use lumbre_shading::{Material, MaterialKind, Spectrum, Texture};

use crate::light::Light;
use crate::{
    BuildError, GeometryDesc, GroundDesc, Interaction, LightId, MaterialId, NamedMaterial, SceneDesc,
    ShapeDesc,
};

/// The shape index of the ground, which no shape of a file has.
pub(crate) const SHAPE: u32 = u32::MAX;

/// The ground of a scene.
#[derive(Clone, Debug)]
pub struct GroundPlane {
    /// The upward unit normal.
    pub normal: DVec3,
    /// A point of it.
    pub point: DVec3,
    /// Whether it is a shadow catcher.
    pub catcher: bool,
    /// Its albedo: that of a diffuse surface.
    pub albedo: Spectrum,
    /// Its unoccluded irradiance from infinite lights, equal everywhere.
    open: Spectrum,
    /// Lights other than surfaces whose contribution varies with position or time.
    local: Vec<Light>,
    /// All lights other than surfaces.
    lights: Vec<LightId>,
}

impl GroundPlane {
    pub(crate) fn new(desc: GroundDesc, lights: &[Light]) -> Self {
        let normal = desc.normal.normalize();
        let mut open = Spectrum::BLACK;
        let mut local = vec![];
        for light in lights {
            match light {
                Light::Point(_)
                | Light::Spot(_)
                | Light::Goniometric(_)
                | Light::Projection(_)
                | Light::Portal(_)
                | Light::Pov(_)
                | Light::Moving(_) => {
                    local.push(light.clone());
                }
                // These are constant over time.
                Light::Distant(_) | Light::Disc(_) | Light::Uniform(_) | Light::Environment(_) => {
                    open += light.irradiance(desc.point, 0.0, normal).unwrap_or(Spectrum::BLACK);
                }
                Light::Shape(_) | Light::Mesh(_) | Light::Placed(_) => {}
            }
        }
        let ids = (0..).zip(lights).filter(|(_, light)| !light.is_surface()).map(|(id, _)| LightId(id));
        let albedo = desc.reflectance.map(|share| if share > 0.0 { share.min(1.0) } else { 0.0 });
        let lights = ids.collect();
        Self { normal, point: desc.point, catcher: desc.catcher, albedo, open, local, lights }
    }

    /// What it was made of.
    pub(crate) fn desc(&self) -> GroundDesc {
        let Self { normal, point, catcher, albedo, .. } = *self;
        GroundDesc { point, normal, reflectance: albedo, catcher }
    }

    /// Whether an interaction is on the ground.
    pub fn holds(&self, met: &Interaction) -> bool {
        met.shape == SHAPE
    }

    /// The lights that contribute to [`GroundPlane::open_irradiance`].
    pub fn lights(&self) -> &[LightId] {
        &self.lights
    }

    /// The unoccluded irradiance at a point and a time from all lights other than surfaces.
    pub fn open_irradiance(&self, at: DVec3, time: f64) -> Spectrum {
        let local = self.local.iter().filter_map(|light| light.irradiance(at, time, self.normal));
        local.fold(self.open, |sum, irradiance| sum + irradiance)
    }
}

/// Adds the ground of a description to its shapes.
pub(crate) fn lay(desc: &mut SceneDesc) -> Result<Option<GroundDesc>, BuildError> {
    let Some(ground) = desc.ground else { return Ok(None) };
    let plane = Plane::new(ground.point, ground.normal)
        .map_err(|source| BuildError::Shape { shape: SHAPE, source })?;
    let reflectance = Arc::new(Texture::Constant(ground.reflectance));
    let material = Material::new(MaterialKind::Diffuse { reflectance });
    // Growing a full list would double its memory.
    desc.shapes.reserve_exact(1);
    desc.shapes.push(ShapeDesc {
        index: SHAPE,
        geometry: GeometryDesc::Exact(plane.into()),
        world_from_object: Transform::IDENTITY,
        reverse_orientation: false,
        material: Some(MaterialId(desc.materials.len() as u32)),
        boundary: None,
        area_light: None,
        alpha: None,
    });
    desc.materials.push(NamedMaterial { name: None, material: Arc::new(material) });
    Ok(Some(ground))
}
