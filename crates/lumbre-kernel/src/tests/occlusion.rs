//! In which order the children of nodes stand, against what is computed of all triangles in double precision.

use std::sync::Arc;

use lumbre_math::DVec3;

use super::refit::moved;
use super::scenes::{Random, build, icosphere, mesh, mixture, options, room, soup, with_every_preset};
use crate::intersect::Isa;
use crate::tree::node::{Node, tag};
use crate::{Accel, GeometryKind, TriangleMesh, build::occlusion_order};

const CENTER: DVec3 = DVec3::new(1.5, -2.25, 4.0);

/// What is to be expected of a ray that meets a box: how likely it is stopped there, and what that takes.
#[derive(Clone, Copy)]
struct Odds {
    stops: f64,
    cost: f64,
    /// By how much the first may be off in single precision, where triangles are long and narrow.
    unsure: f64,
}

fn half_area(low: DVec3, high: DVec3) -> f64 {
    let size = (high - low).max(DVec3::ZERO);
    size.x * size.y + size.y * size.z + size.z * size.x
}

/// The box of a child.
fn corners(node: &Node, lane: usize) -> [DVec3; 2] {
    [0, 1].map(|side| DVec3::from_array([0, 2, 4].map(|axis| f64::from(node.planes[axis + side][lane]))))
}

/// Checks the order of all children below a node, and counts those that were checked; what is to be expected of it,
/// where there are nothing but triangles below.
fn check_order(accel: &Accel, reference: u32, checked: &mut usize) -> Option<Odds> {
    let tree = &accel.tree.packed;
    let node = &tree.nodes[reference as usize];
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let mut children = Vec::new();
    for (lane, &child) in node.children[..node.len()].iter().enumerate() {
        let [from, to] = corners(node, lane);
        (low, high) = (low.min(from), high.max(to));
        let area = half_area(from, to);
        let odds = match tag::of(child) {
            tag::INNER => check_order(accel, child, checked),
            tag::TRIANGLES => {
                let (mut triangles, mut cost, mut unsure) = (0.0, 0.0, 0.0);
                for block in tree.blocks().leaf(child) {
                    cost += 1.0;
                    for lane in (0..8).filter(|lane| block.taken() >> lane & 1 != 0) {
                        let [a, b, c] =
                            block.triangle(lane).map(|corner| DVec3::from_array(corner.map(f64::from)));
                        let (b, c) =
                            ((b - a) * accel.tree.tree_space.scale, (c - a) * accel.tree.tree_space.scale);
                        triangles += 0.5 * b.cross(c).length();
                        unsure += 1e-6 * b.length() * c.length();
                    }
                }
                Some(Odds {
                    stops: (triangles / area).min(1.0),
                    cost,
                    unsure: 1e-5 + (unsure / area).min(1.0),
                })
            }
            _ => None,
        };
        children.push((area, odds));
    }
    let known: Option<Vec<(f64, Odds)>> = children.iter().map(|&(area, odds)| Some((area, odds?))).collect();
    let known = known?;
    let keys: Vec<[f64; 2]> =
        known.iter().map(|(_, odds)| [odds.stops, odds.unsure].map(|x| x / odds.cost)).collect();
    for pair in keys.windows(2) {
        assert!(pair[0][0] - pair[0][1] <= pair[1][0] + pair[1][1], "{keys:?}");
    }
    *checked += keys.len();
    let (mut goes_on, mut cost, mut unsure) = (1.0, 1.0, 0.0);
    for (area, odds) in known.iter().rev() {
        // Of what has no box, either.
        let share = (area / half_area(low, high)).min(1.0);
        cost += goes_on * share * odds.cost;
        goes_on *= 1.0 - share * odds.stops;
        unsure += share * odds.unsure;
    }
    Some(Odds { stops: 1.0 - goes_on, cost, unsure })
}

/// How many children stand in order, of how many there are.
fn checked(accel: &Accel) -> (usize, usize) {
    let mut checked = 0;
    check_order(accel, accel.tree.packed.root.unwrap(), &mut checked);
    (checked, accel.tree.packed.nodes.iter().map(Node::len).sum())
}

#[test]
fn children_are_ordered_by_occlusion_per_cost() {
    with_every_preset(|| {
        let random = &mut Random(911);
        let meshes = [
            soup(random, 3000, CENTER, 2.0),
            room(random, 300),
            icosphere(4, 1e5 * CENTER, 30.0),
            // Where units of space are far from those of the tree.
            soup(random, 500, 1e-9 * CENTER, 1e-12),
        ];
        for mesh in meshes {
            let mut accel = build(vec![GeometryKind::Mesh(Arc::new(mesh))]);
            let (found, all) = checked(&accel);
            assert_eq!(found, all);
            let extent = accel.bounds().size().max_element();
            accel.refit(moved(&accel, random, accel.bounds().center(), extent)).unwrap();
            let before = format!("{:?}", accel.tree.packed.nodes);
            accel.rebuild_partially(&options());
            if before != format!("{:?}", accel.tree.packed.nodes) {
                let (found, all) = checked(&accel);
                assert_eq!(found, all);
            }
        }
        // What else there is has its order from elsewhere; triangles stand apart from it.
        let (found, all) = checked(&mixture(random, CENTER, 3.0, 1, false));
        assert!(0 < found && found < all, "{found} of {all}");
    });
}

#[test]
fn a_wall_is_asked_before_a_larger_bush() {
    let random = &mut Random(912);
    let mut corners = Vec::new();
    // Leaves of a bush, each small in the box of several.
    for _ in 0..400 {
        let place = CENTER + 4.0 * random.vector();
        corners.extend([0, 1, 2].map(|_| place + 0.02 * random.vector()));
    }
    let wall = [[0.0, 0.0], [1.5, 0.0], [1.5, 1.5], [0.0, 1.5]].map(|[y, z]| CENTER + DVec3::new(12.0, y, z));
    corners.extend([0, 1, 2, 0, 2, 3].map(|corner| wall[corner]));
    let triangles = (0..corners.len() as u32 / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let mesh: TriangleMesh = mesh(corners, triangles);
    let count = mesh.indices.len() as u32;
    with_every_preset(|| {
        let accel = build(vec![GeometryKind::Mesh(Arc::new(mesh.clone()))]);
        let root = &accel.tree.packed.nodes[accel.tree.packed.root.unwrap() as usize];
        let last = root.children[root.len() - 1];
        assert_eq!(tag::of(last), tag::TRIANGLES);
        let ids = &accel.tree.packed.ids[accel.tree.packed.numbers(last).start];
        assert!(ids.primitives().any(|primitive| primitive >= count - 2), "{ids:?}");
        let areas: Vec<f64> = (0..root.len())
            .map(|lane| {
                let [low, high] = self::corners(root, lane);
                half_area(low, high)
            })
            .collect();
        assert!(areas.iter().any(|&area| area > 2.0 * areas[areas.len() - 1]), "{areas:?}");
    });
}

#[test]
fn the_order_is_the_same_by_every_instruction_set() {
    let random = &mut Random(913);
    for mesh in [soup(random, 3000, CENTER, 2.0), room(random, 300)] {
        let accel = build(vec![GeometryKind::Mesh(Arc::new(mesh))]);
        // Which is another one.
        let reversed: Vec<Node> = accel
            .tree
            .packed
            .nodes
            .iter()
            .map(|node| {
                let mut reversed = *node;
                reversed.planes.iter_mut().for_each(|row| row[..node.len()].reverse());
                reversed.children[..node.len()].reverse();
                reversed
            })
            .collect();
        let sorted: Vec<String> = Isa::all()
            .into_iter()
            .map(|isa| {
                let mut nodes = reversed.clone();
                occlusion_order::sort_children(
                    isa,
                    &accel.tree.tree_space,
                    &mut nodes,
                    accel.tree.packed.blocks(),
                );
                format!("{nodes:?}")
            })
            .collect();
        assert_ne!(sorted[0], format!("{reversed:?}"));
        assert!(sorted.iter().all(|nodes| *nodes == sorted[0]));
    }
}
