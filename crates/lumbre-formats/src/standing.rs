//! Which way is up in a mesh whose format does not say.

use lumbre_math::DVec3;
use lumbre_scene::{MeshDesc, UpAxis};

/// What is up, and whether that is a guess: y, but z where meshes plainly stand on a plane of z (see [`stands_on_z`]);
/// `origin` is what their positions are relative to.
pub(crate) fn up_of<'m>(meshes: impl Iterator<Item = &'m MeshDesc> + Clone, origin: DVec3) -> (UpAxis, bool) {
    if stands_on_z(meshes, origin) { (UpAxis::Z, true) } else { (UpAxis::Y, false) }
}

/// Whether meshes stand on a plane z = const and not on one of y: their lowest faces along z lie flat in one plane and
/// make up most of what is seen from below, and
///
/// - along y no face is lowest and flat (a terrain, a scan on its table, a car in its street), or
/// - that plane is z = 0, while y goes from one side of 0 to the other, and they are high (a tower that was drawn
///   upwards from its plan).
///
/// What is flat as a whole, a picture or a letter, stands on nothing.
fn stands_on_z<'m>(meshes: impl Iterator<Item = &'m MeshDesc> + Clone, origin: DVec3) -> bool {
    const SUPPORT: f64 = 0.5;
    const NO_SUPPORT: f64 = 1e-3;
    const FLAT: f64 = 0.05;
    const HIGH: f64 = 0.5;
    const ASIDE: f64 = 0.1;
    let triangles = || meshes.clone().flat_map(triangles);
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for corner in triangles().flatten() {
        (low, high) = (low.min(corner), high.max(corner));
    }
    let size = high - low;
    let width = size.x.max(size.y);
    if !(size.x > 0.0 && size.y > 0.0 && FLAT * width < size.z) {
        return false;
    }
    // The faces in the lowest plane along an axis, as a share of what the box covers there.
    let support = |axis: usize| {
        let top = low[axis] + 1e-4 * size[axis];
        let lowest = triangles().filter(|corners| corners.iter().all(|corner| corner[axis] <= top));
        let area: f64 = lowest.map(|[a, b, c]| 0.5 * (b - a).cross(c - a)[axis].abs()).sum();
        area * size[axis] / (size.x * size.y * size.z)
    };
    if support(2) < SUPPORT {
        return false;
    }
    let (from, to) = (low + origin, high + origin);
    let is_on_zero = from.z.abs() <= 1e-6 * size.z;
    let is_about_zero = from.y < -ASIDE * size.y && ASIDE * size.y < to.y;
    (is_on_zero && is_about_zero && HIGH * width <= size.z) || support(1) < NO_SUPPORT
}

fn triangles(mesh: &MeshDesc) -> impl Iterator<Item = [DVec3; 3]> {
    let halves = mesh.quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
    let triangles = mesh.triangles.iter().copied().chain(halves);
    triangles.map(|corners| corners.map(|i| mesh.positions[i as usize].as_dvec3()))
}

#[cfg(test)]
mod tests {
    use lumbre_math::Vec3;

    use super::*;

    /// Faces of a closed box, each turned outwards.
    fn cuboid(low: Vec3, high: Vec3) -> MeshDesc {
        let positions = (0..8u32)
            .map(|i| {
                let pick = |axis: usize| if i >> axis & 1 == 1 { high[axis] } else { low[axis] };
                Vec3::new(pick(0), pick(1), pick(2))
            })
            .collect();
        let quads = vec![[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        MeshDesc { positions, quads, ..MeshDesc::default() }
    }

    fn pyramid_on(ground: bool) -> MeshDesc {
        // Its apex up along z, its base of corners that lie in no plane of y.
        let corners = [(-2.0, -1.0), (3.0, -1.5), (2.0, 2.5), (-1.0, 2.0)];
        let mut positions: Vec<Vec3> = corners.iter().map(|&(x, y)| Vec3::new(x, y, 7.5)).collect();
        positions.push(Vec3::new(0.5, 0.25, 9.5));
        let quads = if ground { vec![[0, 3, 2, 1]] } else { vec![] };
        let triangles = vec![[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]];
        MeshDesc { positions, quads, triangles, ..MeshDesc::default() }
    }

    /// The same with y up: (x, y, z) to (x, z, -y).
    fn lying(mesh: &MeshDesc) -> MeshDesc {
        let positions = mesh.positions.iter().map(|p| Vec3::new(p.x, p.z, -p.y)).collect();
        MeshDesc { positions, ..mesh.clone() }
    }

    #[test]
    fn only_what_plainly_stands_on_a_plane_of_z_has_z_up() {
        let tower = [
            cuboid(Vec3::new(-1.0, -1.5, 0.0), Vec3::new(1.0, 1.5, 4.0)),
            cuboid(Vec3::new(-0.5, -0.5, 4.0), Vec3::new(0.5, 0.5, 6.0)),
        ];
        let raised = [cuboid(Vec3::new(-1.0, -1.5, 2.0), Vec3::new(1.0, 1.5, 6.0))];
        let corner = [cuboid(Vec3::ZERO, Vec3::new(2.0, 3.0, 4.0))];
        let frame = [cuboid(Vec3::new(-3.0, -2.0, 0.0), Vec3::new(3.0, 2.0, 0.4))];
        let card = [cuboid(Vec3::new(-3.0, -2.0, 0.0), Vec3::new(3.0, 2.0, 0.0))];
        let cases: [(&str, &[MeshDesc], DVec3, bool); 9] = [
            ("a tower on its plan", &tower, DVec3::ZERO, true),
            ("a tower on its plan, far away", &raised, DVec3::new(0.0, 0.0, -2.0), true),
            ("a box that stands on nothing that is known", &raised, DVec3::ZERO, false),
            ("a box from a corner", &corner, DVec3::ZERO, false),
            ("a frame for a wall", &frame, DVec3::ZERO, false),
            ("a card", &card, DVec3::ZERO, false),
            ("a pyramid on its ground", &[pyramid_on(true)], DVec3::ZERO, true),
            ("a pyramid without one", &[pyramid_on(false)], DVec3::ZERO, false),
            ("nothing", &[], DVec3::ZERO, false),
        ];
        for (name, meshes, origin, expected) in cases {
            assert_eq!(stands_on_z(meshes.iter(), origin), expected, "{name}");
            let lying: Vec<MeshDesc> = meshes.iter().map(lying).collect();
            let moved = DVec3::new(origin.x, origin.z, -origin.y);
            assert!(!stands_on_z(lying.iter(), moved), "{name}, with y up");
        }
    }
}
