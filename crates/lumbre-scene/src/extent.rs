//! The points spanned by a description, before anything is built.

use std::cell::RefCell;
use std::collections::HashMap;
use std::rc::Rc;
use std::sync::Arc;

use lumbre_geometry::Aabb;
use lumbre_kernel::Placement;
use lumbre_math::{DVec3, Elementary, Transform};

use crate::object_order::inside_out;
use crate::{GeometryDesc, MeshDesc, ObjectDesc, SceneDesc, ShapeDesc, custom};

/// Directions of an object's support points; what lies between them is missed by less than a hundredth of its
/// size.
const DIRECTIONS: usize = 300;

/// Points with the same convex hull as everything finite in a description: used vertices of meshes, corners of
/// the bounding boxes of exact shapes, and the support points of objects.
pub(crate) struct Extent<'d> {
    desc: &'d SceneDesc,
    /// For each object.
    outlines: Vec<Vec<DVec3>>,
    used: Used,
}

/// The vertices used by a mesh's faces, if not all are: files may share one list of vertices among meshes.
#[derive(Default)]
struct Used(RefCell<HashMap<*const MeshDesc, Option<Rc<Vec<bool>>>>>);

impl Used {
    fn of(&self, mesh: &Arc<MeshDesc>) -> Option<Rc<Vec<bool>>> {
        let mut known = self.0.borrow_mut();
        let used = known.entry(Arc::as_ptr(mesh)).or_insert_with(|| {
            let mut is_used = vec![false; mesh.positions.len()];
            let triangles = mesh.triangles.iter().flatten();
            for &corner in triangles.chain(mesh.quads.iter().flatten()) {
                if let Some(used) = is_used.get_mut(corner as usize) {
                    *used = true;
                }
            }
            is_used.contains(&false).then(|| Rc::new(is_used))
        });
        used.clone()
    }
}

impl<'d> Extent<'d> {
    pub(crate) fn new(desc: &'d SceneDesc) -> Self {
        // A cycle of objects is reported when the scene is built.
        let order = inside_out(&desc.objects).unwrap_or_default();
        let mut outlines = vec![Vec::new(); desc.objects.len()];
        let used = Used::default();
        for object in order {
            outlines[object] = outline(&desc.objects[object], &outlines, &used);
        }
        Self { desc, outlines, used }
    }

    pub(crate) fn each_point(&self, visit: &mut dyn FnMut(DVec3)) {
        self.desc.shapes.iter().for_each(|shape| each_point_of(shape, &self.used, visit));
        for instance in &self.desc.instances {
            let outline = self.outlines.get(instance.object.0 as usize).map_or(&[][..], Vec::as_slice);
            for map in places(&instance.world_from_object) {
                outline.iter().for_each(|&p| visit(map.point(p)));
            }
        }
    }

    /// The bounds of one shape; empty where it has none.
    pub(crate) fn bounds_of(&self, shape: &ShapeDesc) -> Aabb {
        let mut bounds = Aabb::EMPTY;
        each_point_of(shape, &self.used, &mut |p| bounds = bounds.union(Aabb { min: p, max: p }));
        bounds
    }

    pub(crate) fn bounds(&self) -> Aabb {
        let mut bounds = Aabb::EMPTY;
        self.each_point(&mut |p| bounds = bounds.union(Aabb { min: p, max: p }));
        bounds
    }
}

/// The transforms of an instance; of a moving one, at each key.
pub(crate) fn places(placement: &Placement) -> Vec<Transform> {
    match placement {
        Placement::Still(map) => vec![*map],
        Placement::Moving(motion) => motion.keys().iter().map(|&(_, map)| map).collect(),
    }
}

fn outline(object: &ObjectDesc, outlines: &[Vec<DVec3>], used: &Used) -> Vec<DVec3> {
    let mut points = Vec::new();
    object.shapes.iter().for_each(|shape| each_point_of(shape, used, &mut |p| points.push(p)));
    for instance in &object.instances {
        let inner = outlines.get(instance.object.0 as usize).map_or(&[][..], Vec::as_slice);
        for map in places(&instance.world_from_object) {
            points.extend(inner.iter().map(|&p| map.point(p)));
        }
    }
    if points.len() <= DIRECTIONS {
        return points;
    }
    let farthest =
        directions().filter_map(|d| points.iter().copied().max_by(|a, b| a.dot(d).total_cmp(&b.dot(d))));
    farthest.collect()
}

/// Unit vectors spread evenly over the sphere, by the golden angle.
fn directions() -> impl Iterator<Item = DVec3> {
    (0..DIRECTIONS).map(|i| {
        let z = 1.0 - 2.0 * (i as f64 + 0.5) / DIRECTIONS as f64;
        let (sin, cos) = (i as f64 * 2.399_963_229_728_653).sine_cosine();
        let r = (1.0 - z * z).sqrt();
        DVec3::new(r * cos, r * sin, z)
    })
}

fn each_point_of(shape: &ShapeDesc, used: &Used, visit: &mut dyn FnMut(DVec3)) {
    // Operands may be CSG themselves.
    let mut open: Vec<(&ShapeDesc, Transform)> = vec![(shape, Transform::IDENTITY)];
    while let Some((shape, outer)) = open.pop() {
        let placement = outer * shape.world_from_object;
        match &shape.geometry {
            GeometryDesc::Exact(exact) => {
                let bounds = exact.bounds(&placement).filter(|bounds| !bounds.is_empty());
                bounds.iter().flat_map(corners).for_each(&mut *visit);
            }
            GeometryDesc::Coloured(coloured) => {
                let bounds = coloured.shape.bounds(&placement).filter(|bounds| !bounds.is_empty());
                bounds.iter().flat_map(corners).for_each(&mut *visit);
            }
            GeometryDesc::Mesh(mesh) | GeometryDesc::BilinearMesh(mesh) => {
                each_vertex(mesh, used, &mut |p| visit(placement.point(p)));
            }
            GeometryDesc::Curves(curves) => {
                let bounds = custom::bounds(&**curves, &placement).filter(|bounds| !bounds.is_empty());
                bounds.iter().flat_map(corners).for_each(&mut *visit);
            }
            GeometryDesc::Custom(geometry) => {
                let bounds = custom::bounds(&**geometry, &placement).filter(|bounds| !bounds.is_empty());
                bounds.iter().flat_map(corners).for_each(&mut *visit);
            }
            GeometryDesc::Csg(csg) => {
                open.extend(
                    csg.operands.iter().flat_map(|operand| &**operand).map(|operand| (operand, placement)),
                );
            }
        }
    }
}

/// Every finite vertex used by a face.
fn each_vertex(mesh: &Arc<MeshDesc>, used: &Used, visit: &mut dyn FnMut(DVec3)) {
    let used = used.of(mesh);
    for (i, p) in mesh.positions.iter().enumerate() {
        if p.is_finite() && used.as_ref().is_none_or(|used| used[i]) {
            visit(p.as_dvec3());
        }
    }
}

pub(crate) fn corners(bounds: &Aabb) -> impl Iterator<Item = DVec3> + use<> {
    let Aabb { min, max } = *bounds;
    (0..8).map(move |i| {
        let pick = |bit: usize| if i >> bit & 1 == 1 { max } else { min };
        DVec3::new(pick(0).x, pick(1).y, pick(2).z)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::placed_bounds::moved;
    use crate::{InstanceDesc, MaterialId, ObjectId};
    use lumbre_geometry::Sphere;
    use lumbre_math::Vec3;

    fn shape(geometry: GeometryDesc, world_from_object: Transform) -> ShapeDesc {
        ShapeDesc {
            index: 3,
            geometry,
            world_from_object,
            reverse_orientation: false,
            material: Some(MaterialId(0)),
            boundary: None,
            area_light: None,
            alpha: None,
        }
    }

    #[test]
    fn vertices_that_no_face_uses_do_not_count() {
        let mesh = MeshDesc {
            positions: vec![
                Vec3::new(2.0, 1.0, 4.0),
                Vec3::splat(900.0),
                Vec3::new(3.0, 1.0, 4.0),
                Vec3::new(2.0, 5.0, 7.0),
            ],
            triangles: vec![[0, 2, 3]],
            ..MeshDesc::default()
        };
        let placement = Transform::translate(DVec3::new(10.0, 20.0, 30.0));
        let desc = SceneDesc {
            shapes: vec![shape(GeometryDesc::Mesh(Arc::new(mesh)), placement)],
            ..SceneDesc::default()
        };
        let bounds = Extent::new(&desc).bounds();
        assert_eq!((bounds.min, bounds.max), (DVec3::new(12.0, 21.0, 34.0), DVec3::new(13.0, 25.0, 37.0)));
    }

    #[test]
    fn objects_in_objects_reach_as_far_as_their_shapes() {
        let ball = Sphere::new(DVec3::new(1.0, 2.0, 3.0), 2.5).unwrap();
        let inner = ObjectDesc {
            name: "inner".into(),
            shapes: vec![shape(GeometryDesc::Exact(ball.into()), Transform::IDENTITY); 60],
            instances: vec![],
        };
        let place = |object, x| InstanceDesc {
            object: ObjectId(object),
            world_from_object: Transform::translate(DVec3::new(x, 0.0, 0.0)).into(),
        };
        let outer = ObjectDesc {
            name: "outer".into(),
            shapes: vec![],
            instances: vec![place(0, 5.0), place(0, -6.0)],
        };
        let desc = SceneDesc {
            objects: vec![inner, outer],
            instances: vec![place(1, 100.0)],
            ..SceneDesc::default()
        };
        let bounds = Extent::new(&desc).bounds();
        assert!((bounds.min - DVec3::new(92.5, -0.5, 0.5)).abs().max_element() < 1e-9, "{bounds:?}");
        assert!((bounds.max - DVec3::new(108.5, 4.5, 5.5)).abs().max_element() < 1e-9, "{bounds:?}");
        // A cycle ends, too.
        let cycle = SceneDesc {
            objects: vec![ObjectDesc { name: "a".into(), shapes: vec![], instances: vec![place(0, 2.0)] }],
            instances: vec![place(0, 3.0)],
            ..SceneDesc::default()
        };
        assert!(Extent::new(&cycle).bounds().is_empty());
    }

    #[test]
    fn corners_of_a_moved_box_are_those_of_its_hull() {
        let bounds = Aabb { min: DVec3::new(1.0, 2.0, 3.0), max: DVec3::new(2.0, 5.0, 9.0) };
        assert_eq!(Aabb::around(corners(&bounds)), bounds);
        let shifted = moved(&bounds, &Transform::translate(DVec3::X));
        assert_eq!(shifted.min, DVec3::new(2.0, 2.0, 3.0));
    }
}
