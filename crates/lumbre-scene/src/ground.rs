//! The plane that everything stands on.

use std::sync::Arc;

use lumbre_geometry::Plane;
use lumbre_math::{DVec3, Transform};
use lumbre_shading::{Material, MaterialKind, Spectrum, Texture};

use crate::light::{Light, LightId};
use crate::{
    BuildError, GeometryDesc, GroundDesc, Interaction, MaterialId, NamedMaterial, SceneDesc, ShapeDesc,
};

/// The position that the ground has among the shapes of its file, where no shape of a file is.
pub(crate) const SHAPE: u32 = u32::MAX;

/// The ground of a scene.
#[derive(Clone, Debug)]
pub struct GroundPlane {
    /// Unit, up from it.
    pub normal: DVec3,
    /// A point of it.
    pub point: DVec3,
    /// Whether a camera sees only the shadow on it.
    pub catcher: bool,
    /// Its irradiance in the open by lights at infinity, the same everywhere.
    open: Spectrum,
    /// Lights whose part in that changes from place to place or with time, and are no surfaces.
    local: Vec<Light>,
    /// All lights that are no surfaces.
    lights: Vec<LightId>,
}

impl GroundPlane {
    pub(crate) fn new(desc: GroundDesc, lights: &[Light]) -> Self {
        let normal = desc.normal.normalize();
        let mut open = Spectrum::BLACK;
        let mut local = vec![];
        for light in lights {
            match light {
                Light::Point(_) | Light::Spot(_) | Light::Goniometric(_) | Light::Moving(_) => {
                    local.push(light.clone());
                }
                // These are the same at all times.
                Light::Distant(_) | Light::Uniform(_) | Light::Environment(_) => {
                    open += light.irradiance(desc.point, 0.0, normal).unwrap_or(Spectrum::BLACK);
                }
                Light::Shape(_) | Light::Mesh(_) | Light::Placed(_) => {}
            }
        }
        let ids = (0..).zip(lights).filter(|(_, light)| !light.is_surface()).map(|(id, _)| LightId(id));
        Self { normal, point: desc.point, catcher: desc.catcher, open, local, lights: ids.collect() }
    }

    /// Whether a place is on the ground.
    pub fn holds(&self, met: &Interaction) -> bool {
        met.shape == SHAPE
    }

    /// The lights that count for [`GroundPlane::open_irradiance`].
    pub fn lights(&self) -> &[LightId] {
        &self.lights
    }

    /// The irradiance at a point of it and at a time if nothing else were there, of all lights that are no surfaces.
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
    desc.shapes.push(ShapeDesc {
        index: SHAPE,
        geometry: GeometryDesc::Exact(plane.into()),
        world_from_object: Transform::IDENTITY,
        reverse_orientation: false,
        material: Some(MaterialId(desc.materials.len() as u32)),
        area_light: None,
        alpha: None,
    });
    desc.materials.push(NamedMaterial { name: None, material: Arc::new(material) });
    Ok(Some(ground))
}
