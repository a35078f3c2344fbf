//! Whether a point is inside: by the parity of crossings, and by the solids that contain it.

use lumbre_geometry::Ray;
use lumbre_math::DVec3;

use crate::intersect::Isa;
use crate::trace::exact;
use crate::trace::visitor::{Crossing, Visitor, Wanted};
use crate::tree::node::tag;
use crate::tree::packed::Start;
use crate::tree::sphere_block::ExactSphere;
use crate::tree::{GeometryKind, Tree};

/// The directions of the rays: no likely axes of symmetry, and no two nearly parallel.
const DIRECTIONS: [DVec3; 5] = [
    DVec3::new(0.610_372_4, 0.353_853_7, 0.708_106_1),
    DVec3::new(-0.421_117_3, 0.801_921_9, -0.423_771_1),
    DVec3::new(0.297_314_8, -0.879_341_7, 0.371_911_3),
    DVec3::new(-0.718_281_8, -0.314_159_3, 0.620_771_9),
    DVec3::new(0.143_310_7, -0.271_828_2, -0.951_743_1),
];

/// See [`Accel::is_inside`].
pub(crate) fn is_inside(tree: &Tree, point: DVec3, time: f64) -> bool {
    if !point.is_finite() {
        return false;
    }
    let in_solids = solids_around(tree, point, time) % 2 == 1;
    let is_odd = |direction: &&DVec3| {
        let mut crossings = Parity { odd: false };
        exact::traverse(Isa::best(), tree, &Ray::new(point, **direction).at_time(time), &mut crossings);
        crossings.odd
    };
    let odd = if has_surfaces(tree) { DIRECTIONS.iter().filter(is_odd).count() } else { 0 };
    let is_in_surfaces = 2 * odd > DIRECTIONS.len();
    in_solids != is_in_surfaces
}

/// Whether it is a shape, or a cloud of shapes, that answers directly what it contains.
fn is_solid(kind: &GeometryKind) -> bool {
    match kind {
        GeometryKind::Shape(shape) => shape.shape().is_solid(),
        GeometryKind::Spheres(_) => true,
        GeometryKind::Mesh(_)
        | GeometryKind::PreciseMesh(_)
        | GeometryKind::Instance(_)
        | GeometryKind::Custom(_) => false,
    }
}

/// Whether there is any other geometry than such shapes.
fn has_surfaces(tree: &Tree) -> bool {
    !tree.geometries.iter().all(|geometry| is_solid(&geometry.kind))
}

/// The number of solid shapes that contain the point, in all instances.
fn solids_around(tree: &Tree, point: DVec3, time: f64) -> usize {
    let mut count = 0;
    let mut trees = vec![(tree, point, Start::WHOLE)];
    let mut stack = Vec::new();
    while let Some((tree, point, start)) = trees.pop() {
        let mut meet = |geometry: u32, primitive: u32| match &tree.geometries[geometry as usize].kind {
            GeometryKind::Shape(shape) => {
                let local = shape.world_from_object().inverse_point(point);
                count += usize::from(shape.shape().contains(local));
            }
            GeometryKind::Instance(instance) => {
                let local = instance.world_from_object.at(time).inverse_point(point);
                let start = Start::of(primitive);
                trees.extend((!start.is_nothing()).then_some((&*instance.tree, local, start)));
            }
            GeometryKind::Spheres(cloud) => {
                count += usize::from(ExactSphere::of(cloud, primitive).contains(point));
            }
            GeometryKind::Mesh(_) | GeometryKind::PreciseMesh(_) | GeometryKind::Custom(_) => {}
        };
        tree.infinite.iter().for_each(|entry| meet(entry.geometry, entry.primitive()));
        let tree_space = &tree.tree_space;
        let (local, slop) = ((point - tree_space.origin) * tree_space.scale, 4.0 * tree_space.slop_of(point));
        stack.extend(tree.packed.root.map(|root| start.below(root)));
        while let Some(reference) = stack.pop() {
            match tag::of(reference) {
                tag::INNER => {
                    let node = &tree.packed.nodes[reference as usize];
                    for lane in 0..node.len() {
                        // In doubt the point is inside, also if the slop is NaN.
                        let is_beyond = (0..3).any(|axis| {
                            let (low, high) = (node.planes[2 * axis][lane], node.planes[2 * axis + 1][lane]);
                            local[axis] < f64::from(low) - slop || f64::from(high) + slop < local[axis]
                        });
                        if !is_beyond {
                            stack.push(node.children[lane]);
                        }
                    }
                }
                tag::TRIANGLES => {}
                tag::SPHERES => {
                    for ids in &tree.packed.sphere_ids[tag::blocks(reference)] {
                        let there = ids.primitives.iter().filter(|&&primitive| primitive != u32::MAX);
                        there.for_each(|&primitive| meet(ids.geometry, primitive));
                    }
                }
                _ => {
                    for entry in &tree.packed.entries[tag::place(reference)..] {
                        meet(entry.geometry, entry.primitive());
                        if entry.is_last() {
                            break;
                        }
                    }
                }
            }
        }
    }
    count
}

/// The parity of the crossings with geometry other than solid shapes.
struct Parity {
    odd: bool,
}

impl Visitor for Parity {
    fn wanted(&self) -> Wanted {
        Wanted::Every
    }

    fn range(&self) -> [f64; 2] {
        [0.0, f64::INFINITY]
    }

    fn visit(&mut self, crossing: &Crossing) -> bool {
        let crosses = crossing.root.multiplicity % 2 == 1;
        self.odd ^= crosses && !is_solid(&crossing.tree.geometries[crossing.geometry as usize].kind);
        false
    }
}
