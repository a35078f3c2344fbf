//! Joins descriptions, such as those of several files.

use std::sync::Arc;

use crate::{
    Boundary, Camera, GeometryDesc, InstanceDesc, MaterialId, MediumId, ObjectId, SceneDesc, ShapeDesc,
    WithoutLight,
};

impl SceneDesc {
    /// Adds everything of another description, in the same world.
    ///
    /// The settings of the picture (film, filter, sampler, integrator) and the up axis are those of the first
    /// description with a camera, or else of the first. Without any light, [`SceneDesc::without_light`] of the first
    /// description that asks for light applies. Indices of shapes ([`ShapeDesc::index`]) continue after the existing
    /// ones.
    pub fn append(&mut self, other: Self) {
        let Self {
            cameras,
            film,
            filter,
            sampler,
            integrator,
            materials,
            media,
            shapes,
            objects,
            instances,
            lights,
            without_light,
            up,
            up_is_guessed,
            ground,
            pov,
            listing,
        } = other;
        if self.cameras.is_empty() && !cameras.is_empty() {
            (self.film, self.filter, self.sampler, self.integrator) = (film, filter, sampler, integrator);
            (self.up, self.up_is_guessed) = (up, up_is_guessed);
        }
        if self.without_light == WithoutLight::Dark {
            self.without_light = without_light;
        }
        self.ground = self.ground.or(ground);
        self.pov = self.pov.take().or(pov);
        let after = After {
            index: next_index(self),
            material: self.materials.len() as u32,
            medium: self.media.len() as u32,
            object: self.objects.len() as u32,
        };
        self.listing.append(listing, after.index);
        let cameras = cameras.into_iter();
        self.cameras.extend(cameras.map(|camera| Camera { medium: after.medium(camera.medium), ..camera }));
        self.materials.extend(materials);
        self.media.extend(media);
        self.lights.extend(lights);
        self.shapes.extend(shapes.into_iter().map(|shape| after.shape(shape)));
        self.instances.extend(instances.into_iter().map(|instance| after.instance(instance)));
        self.objects.extend(objects.into_iter().map(|mut object| {
            object.shapes = object.shapes.into_iter().map(|shape| after.shape(shape)).collect();
            object.instances =
                object.instances.into_iter().map(|instance| after.instance(instance)).collect();
            object
        }));
    }
}

/// The first index after those of all shapes, operands of CSG included.
fn next_index(desc: &SceneDesc) -> u32 {
    let mut next = 0;
    let in_objects = desc.objects.iter().flat_map(|object| &object.shapes);
    let mut open: Vec<&ShapeDesc> = desc.shapes.iter().chain(in_objects).collect();
    while let Some(shape) = open.pop() {
        next = next.max(shape.index.saturating_add(1));
        if let GeometryDesc::Csg(csg) = &shape.geometry {
            open.extend(csg.operands.iter().flat_map(|operand| &**operand));
        }
    }
    next
}

/// The lengths of the lists before the description is added.
struct After {
    index: u32,
    material: u32,
    medium: u32,
    object: u32,
}

impl After {
    fn shape(&self, mut shape: ShapeDesc) -> ShapeDesc {
        shape.index = shape.index.saturating_add(self.index);
        shape.material = shape.material.map(|MaterialId(id)| MaterialId(id + self.material));
        shape.boundary = shape.boundary.map(|Boundary { inside, outside }| Boundary {
            inside: self.medium(inside),
            outside: self.medium(outside),
        });
        if let GeometryDesc::Csg(csg) = &mut shape.geometry {
            for operand in &mut csg.operands {
                let shapes = Arc::unwrap_or_clone(std::mem::take(operand)).into_iter();
                *operand = Arc::new(shapes.map(|shape| self.shape(shape)).collect());
            }
        }
        shape
    }

    fn medium(&self, medium: Option<MediumId>) -> Option<MediumId> {
        medium.map(|MediumId(id)| MediumId(id + self.medium))
    }

    fn instance(&self, instance: InstanceDesc) -> InstanceDesc {
        InstanceDesc { object: ObjectId(instance.object.0 + self.object), ..instance }
    }
}

#[cfg(test)]
mod tests {
    use lumbre_geometry::Sphere;
    use lumbre_math::{DVec3, Transform};
    use lumbre_shading::Material;

    use super::*;
    use crate::{CameraKind, CsgDesc, CsgOperation, FilmDesc, NamedMaterial, ObjectDesc, Placement, UpAxis};

    fn ball(index: u32, material: u32) -> ShapeDesc {
        ShapeDesc {
            index,
            geometry: GeometryDesc::Exact(Sphere::new(DVec3::new(3.0, 7.0, -4.0), 2.5).unwrap().into()),
            world_from_object: Transform::IDENTITY,
            reverse_orientation: false,
            material: Some(MaterialId(material)),
            boundary: None,
            area_light: None,
            alpha: None,
        }
    }

    /// A ball, a difference of two, and an object of one with its instance.
    fn scene(name: &str) -> SceneDesc {
        let named = |part: &str| NamedMaterial {
            name: Some(format!("{name} {part}")),
            material: Arc::new(Material::default_diffuse()),
        };
        let csg = CsgDesc {
            operation: CsgOperation::Difference,
            operands: vec![Arc::new(vec![ball(1, 0)]), Arc::new(vec![ball(2, 1)])],
        };
        let instance =
            InstanceDesc { object: ObjectId(0), world_from_object: Placement::Still(Transform::IDENTITY) };
        SceneDesc {
            materials: vec![named("a"), named("b")],
            shapes: vec![ball(0, 1), ShapeDesc { geometry: GeometryDesc::Csg(csg), ..ball(3, 0) }],
            objects: vec![ObjectDesc { name: name.into(), shapes: vec![ball(4, 1)], instances: vec![] }],
            instances: vec![instance],
            ..SceneDesc::default()
        }
    }

    #[test]
    fn everything_refers_to_its_own_after_joining() {
        let mut joined = scene("first");
        joined.append(scene("second"));
        let material =
            |shape: &ShapeDesc| joined.materials[shape.material.unwrap().0 as usize].name.clone().unwrap();
        assert_eq!(joined.shapes.iter().map(|s| s.index).collect::<Vec<_>>(), [0, 3, 5, 8]);
        assert_eq!(
            (material(&joined.shapes[0]), material(&joined.shapes[2])),
            ("first b".into(), "second b".into())
        );
        let GeometryDesc::Csg(csg) = &joined.shapes[3].geometry else { panic!() };
        assert_eq!((csg.operands[0][0].index, material(&csg.operands[0][0])), (6, "second a".into()));
        let objects: Vec<&str> =
            joined.instances.iter().map(|i| &*joined.objects[i.object.0 as usize].name).collect();
        assert_eq!(objects, ["first", "second"]);
        assert_eq!(material(&joined.objects[1].shapes[0]), "second b");
    }

    #[test]
    fn the_picture_is_that_of_the_first_camera() {
        let staged = || SceneDesc {
            cameras: vec![Camera::new(
                CameraKind::Perspective { fov: 50.0, lens_radius: 0.0, focal_distance: 1.0 },
                Transform::IDENTITY,
            )],
            film: FilmDesc { width: Some(70), height: Some(30), ..FilmDesc::default() },
            without_light: WithoutLight::Dark,
            ..SceneDesc::default()
        };
        let model = || SceneDesc { up: UpAxis::Z, ..scene("model") };
        let mut joined = model();
        joined.append(staged());
        assert_eq!(
            (joined.film.width, joined.cameras.len(), joined.without_light),
            (Some(70), 1, WithoutLight::Studio)
        );
        let mut joined = staged();
        joined.append(model());
        assert_eq!(
            (joined.film.width, joined.cameras.len(), joined.without_light),
            (Some(70), 1, WithoutLight::Studio)
        );
        let mut joined = staged();
        joined.append(staged());
        assert_eq!((joined.cameras.len(), joined.without_light), (2, WithoutLight::Dark));
    }
}
