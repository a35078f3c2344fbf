//! The mirrors, smooth glass and smooth coats of a scene, which cast caustics.

use std::collections::HashSet;
use std::sync::Arc;

use lumbre_geometry::Aabb;
use lumbre_kernel::Placement;
use lumbre_math::DVec3;
use lumbre_shading::Material;

use crate::build::{inside_out, moved};
use crate::extent::Extent;
use crate::light::swept;
use crate::{GeometryDesc, Scene, SceneDesc, ShapeDesc};

/// Maximum number of spheres of [`Scene::specular_spheres`].
const MAX_SPHERES: usize = 16;

/// A ball of space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundingSphere {
    /// The center.
    pub center: DVec3,
    /// The radius.
    pub radius: f64,
}

impl BoundingSphere {
    /// Whether a point is inside or on it.
    pub fn contains(&self, point: DVec3) -> bool {
        point.distance_squared(self.center) <= self.radius * self.radius
    }

    /// The sphere around a box, through its corners.
    pub fn around(bounds: &Aabb) -> Self {
        Self { center: bounds.center(), radius: 0.5 * bounds.size().length() }
    }
}

impl Scene {
    /// Spheres that together contain every surface that may reflect or refract without blur (see
    /// [`Material::may_be_specular`]); for an unbounded one, its part within the reach of the rest of the scene. They
    /// may overlap; without specular surfaces there are none.
    pub fn specular_spheres(&self) -> &[BoundingSphere] {
        &self.specular_spheres
    }
}

/// Boxes around specular shapes, and whether some of them have no bounds.
#[derive(Clone, Debug, Default)]
pub(crate) struct Specular {
    boxes: Vec<Aabb>,
    is_unbounded: bool,
}

impl Specular {
    /// The specular shapes of a description.
    pub(crate) fn of(desc: &SceneDesc) -> Self {
        let is_specular: Vec<bool> =
            desc.materials.iter().map(|named| Material::may_be_specular(&named.material)).collect();
        if !is_specular.contains(&true) {
            return Self::default();
        }
        let extent = Extent::new(desc);
        let mut all = Self::default();
        all.add_shapes(&desc.shapes, &extent, &is_specular);
        let mut objects = vec![Self::default(); desc.objects.len()];
        // A cycle of objects is reported when the scene is built.
        for position in inside_out(&desc.objects).unwrap_or_default() {
            let object = &desc.objects[position];
            let mut own = Self::default();
            own.add_shapes(&object.shapes, &extent, &is_specular);
            for instance in &object.instances {
                if let Some(inner) = objects.get(instance.object.0 as usize) {
                    own.add_placed(inner, &instance.world_from_object);
                }
            }
            own.boxes = own.boxes.iter().copied().reduce(Aabb::union).into_iter().collect();
            objects[position] = own;
        }
        for instance in &desc.instances {
            if let Some(object) = objects.get(instance.object.0 as usize) {
                all.add_placed(object, &instance.world_from_object);
            }
        }
        all
    }

    fn add_shapes(&mut self, shapes: &[ShapeDesc], extent: &Extent<'_>, is_specular: &[bool]) {
        for shape in shapes.iter().filter(|shape| has_specular(shape, is_specular)) {
            let bounds = extent.bounds_of(shape);
            if bounds.is_empty() {
                self.is_unbounded |=
                    !matches!(&shape.geometry, GeometryDesc::Mesh(_) | GeometryDesc::BilinearMesh(_));
            } else {
                self.boxes.push(bounds);
            }
        }
    }

    fn add_placed(&mut self, object: &Self, placement: &Placement) {
        self.is_unbounded |= object.is_unbounded;
        self.boxes.extend(object.boxes.iter().map(|bounds| match placement {
            Placement::Still(map) => moved(bounds, map),
            Placement::Moving(motion) => swept(bounds, motion),
        }));
    }

    /// The spheres, in a scene with these bounds.
    pub(crate) fn spheres(mut self, scene: &Aabb) -> Vec<BoundingSphere> {
        let mut groups = vec![std::mem::take(&mut self.boxes)];
        // The largest group is split at the median of its longest side.
        while groups.len() < MAX_SPHERES
            && let Some(position) =
                (0..groups.len()).filter(|&i| groups[i].len() > 1).max_by_key(|&i| groups[i].len())
        {
            let group = &mut groups[position];
            let size = group.iter().copied().fold(Aabb::EMPTY, Aabb::union).size();
            let axis = (0..3).max_by(|&a, &b| size[a].total_cmp(&size[b])).unwrap_or(0);
            group.sort_by(|a, b| a.center()[axis].total_cmp(&b.center()[axis]));
            let half = group.split_off(group.len() / 2);
            groups.push(half);
        }
        let bounds = groups.iter().filter_map(|group| group.iter().copied().reduce(Aabb::union));
        let mut spheres: Vec<_> = bounds.map(|bounds| BoundingSphere::around(&bounds)).collect();
        if self.is_unbounded && !scene.is_empty() {
            spheres.push(BoundingSphere::around(scene));
        }
        spheres.retain(|sphere| sphere.radius > 0.0 && sphere.radius.is_finite());
        spheres
    }
}

/// Whether a shape or one of its operands is specular.
fn has_specular(shape: &ShapeDesc, is_specular: &[bool]) -> bool {
    let own = shape.material.and_then(|id| is_specular.get(id.0 as usize)).is_some_and(|&is| is);
    let mut operands: Vec<&Arc<Vec<ShapeDesc>>> = match &shape.geometry {
        GeometryDesc::Csg(csg) => csg.operands.iter().collect(),
        _ => return own,
    };
    // Operands may be shared many times.
    let mut seen = HashSet::new();
    while let Some(operand) = operands.pop() {
        if !seen.insert(Arc::as_ptr(operand)) {
            continue;
        }
        for shape in operand.iter() {
            match &shape.geometry {
                GeometryDesc::Csg(csg) => operands.extend(&csg.operands),
                _ if shape.material.and_then(|id| is_specular.get(id.0 as usize)).is_some_and(|&is| is) => {
                    return true;
                }
                _ => {}
            }
        }
    }
    own
}

#[cfg(test)]
mod tests {
    use lumbre_geometry::{Plane, Sphere};
    use lumbre_math::Transform;
    use lumbre_shading::{MaterialKind, Roughness};

    use super::*;
    use crate::{InstanceDesc, MaterialId, NamedMaterial, ObjectDesc, ObjectId};

    fn shape(geometry: GeometryDesc, material: u32, at: DVec3) -> ShapeDesc {
        ShapeDesc {
            index: 0,
            geometry,
            world_from_object: Transform::translate(at),
            reverse_orientation: false,
            material: Some(MaterialId(material)),
            boundary: None,
            area_light: None,
            alpha: None,
        }
    }

    fn ball(material: u32, at: DVec3) -> ShapeDesc {
        shape(GeometryDesc::Exact(Sphere::new(DVec3::ZERO, 1.0).unwrap().into()), material, at)
    }

    /// Material 0 is rough, 1 is glass.
    fn scene(shapes: Vec<ShapeDesc>, objects: Vec<ObjectDesc>, instances: Vec<InstanceDesc>) -> Scene {
        let glass = |roughness| MaterialKind::Dielectric { eta: 1.5, roughness };
        let named = |kind| NamedMaterial { name: None, material: Arc::new(Material::new(kind)) };
        let materials =
            vec![named(glass(Roughness::isotropic(0.3, true))), named(glass(Roughness::smooth()))];
        Scene::build(SceneDesc { materials, shapes, objects, instances, ..SceneDesc::default() }).unwrap()
    }

    #[test]
    fn spheres_hold_what_is_specular_and_nothing_else() {
        let at = DVec3::new(5.0, 0.0, 0.0);
        let spheres =
            scene(vec![ball(0, DVec3::ZERO), ball(1, at)], vec![], vec![]).specular_spheres().to_vec();
        assert_eq!(spheres.len(), 1);
        assert!(spheres[0].contains(at + DVec3::Y) && !spheres[0].contains(DVec3::ZERO));
        assert!(scene(vec![ball(0, at)], vec![], vec![]).specular_spheres().is_empty());
    }

    #[test]
    fn an_unbounded_mirror_counts_as_far_as_the_scene_reaches() {
        let plane =
            shape(GeometryDesc::Exact(Plane::new(DVec3::ZERO, DVec3::Y).unwrap().into()), 1, DVec3::ZERO);
        let spheres = scene(vec![plane, ball(0, DVec3::Y)], vec![], vec![]).specular_spheres().to_vec();
        assert_eq!(spheres.len(), 1);
        assert!(spheres[0].contains(DVec3::ZERO) && !spheres[0].contains(DVec3::new(9.0, 0.0, 0.0)));
    }

    #[test]
    fn instances_are_held_and_many_are_grouped() {
        let object = ObjectDesc { name: "a".into(), shapes: vec![ball(1, DVec3::ZERO)], instances: vec![] };
        let place = |i: u32| InstanceDesc {
            object: ObjectId(0),
            world_from_object: Placement::Still(Transform::translate(DVec3::X * (9.0 * f64::from(i)))),
        };
        let scene = scene(vec![], vec![object], (0..40).map(place).collect());
        let spheres = scene.specular_spheres();
        assert_eq!(spheres.len(), MAX_SPHERES);
        for i in 0..40 {
            let top = DVec3::new(9.0 * f64::from(i), 1.0, 0.0);
            assert!(spheres.iter().any(|sphere| sphere.contains(top)), "{i}");
        }
    }
}
