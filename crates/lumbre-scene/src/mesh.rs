//! Meshes baked for the tree: in single precision relative to a nearby origin, with flat quads split.

use std::mem::take;
use std::sync::{Arc, LazyLock};

use lumbre_kernel::{DeformingMesh, PreciseMesh, TriangleMesh};
use lumbre_math::{DVec3, Transform, Vec3};

use crate::seams;
use crate::surface::{Deforming, MeshAttributes, Turned};
use crate::{BuildError, MeshDesc, MeshMotion};

/// A mesh in the space of a tree.
pub(crate) struct BakedMesh {
    pub attributes: Arc<MeshAttributes>,
    /// Quads that are not flat, with their corners in the order p00, p10, p01, p11.
    pub patches: Vec<[u32; 4]>,
}

/// The order of a quad's corners.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum QuadOrder {
    /// Counter-clockwise.
    Around,
    /// p00, p10, p01, p11.
    Patch,
}

/// What is left of meshes without attributes: files have many small ones, and their descriptions are larger than they
/// are.
static BARE: LazyLock<Arc<MeshDesc>> = LazyLock::new(Arc::default);

/// Transforms a mesh into the space of its tree. Where it may be split, triangles are that have vertices of others on
/// their edges: see [`seams`].
///
/// # Errors
/// Lists of the wrong length, faces with missing vertices, and vertices that are not finite.
pub(crate) fn bake(
    shape: u32,
    desc: Arc<MeshDesc>,
    tree_from_object: &Transform,
    origin: DVec3,
    order: QuadOrder,
    may_split: bool,
) -> Result<BakedMesh, BuildError> {
    check(shape, &desc)?;
    // A shared description is copied only where the transform changes it; an unshared one gives up its lists.
    let mut shared = desc;
    let (mut positions, mut triangles, quads) = match Arc::get_mut(&mut shared) {
        Some(own) => (take(&mut own.positions), take(&mut own.triangles), take(&mut own.quads)),
        None => (shared.positions.clone(), shared.triangles.clone(), shared.quads.clone()),
    };

    let motion = match Arc::get_mut(&mut shared) {
        Some(own) => own.motion.take(),
        None => shared.motion.clone(),
    };
    let precise = match Arc::get_mut(&mut shared) {
        Some(own) => own.precise_positions.take(),
        None => shared.precise_positions.clone(),
    };
    let precise = precise.map(|list| list.into_iter().map(|p| tree_from_object.point(p)).collect::<Vec<_>>());
    if let Some(vertex) = precise.iter().flatten().position(|p| !p.is_finite()) {
        return Err(BuildError::NotFinite { shape, vertex });
    }
    let stays = tree_from_object.is_identity() && origin == DVec3::ZERO;
    if !stays {
        for p in &mut positions {
            *p = (tree_from_object.point(p.as_dvec3()) - origin).as_vec3();
        }
    }
    if let Some(vertex) = positions.iter().position(|p| !p.is_finite()) {
        return Err(BuildError::NotFinite { shape, vertex });
    }
    let mut turned = Turned::default();
    if !tree_from_object.is_identity() {
        (turned.normals, turned.tangents) = match Arc::get_mut(&mut shared) {
            Some(own) => (own.normals.take(), own.tangents.take()),
            None => (shared.normals.clone(), shared.tangents.clone()),
        };
        let unit = |v: DVec3| v.try_normalize().unwrap_or(DVec3::ZERO).as_vec3();
        for n in turned.normals.iter_mut().flatten() {
            *n = unit(tree_from_object.normal(n.as_dvec3()));
        }
        let side = if tree_from_object.is_mirror() { -1.0 } else { 1.0 };
        for t in turned.tangents.iter_mut().flatten() {
            *t = unit(tree_from_object.vector(t.truncate().as_dvec3())).extend(side * t.w);
        }
    }

    // The front face follows the object: behind a mirror its vertices are in reverse order.
    let swapped = tree_from_object.is_mirror();
    let first_half = triangles.len() as u32;
    let mut patches = Vec::new();
    for [a, b, c, d] in quads {
        let [a, b, c, d] = if order == QuadOrder::Patch { [a, b, d, c] } else { [a, b, c, d] };
        let corners = [a, b, c, d].map(|i| positions[i as usize]);
        let splits = is_parallelogram(corners) || (order == QuadOrder::Around && is_flat_and_convex(corners));
        if splits || motion.is_some() {
            triangles.extend([[a, b, c], [a, c, d]]);
        } else {
            patches.push(if swapped { [a, d, b, c] } else { [a, b, d, c] });
        }
    }
    if swapped {
        for triangle in &mut triangles {
            triangle.swap(1, 2);
        }
    }
    let is_still = motion.is_none() && precise.is_none();
    let pieces = if may_split && is_still { seams::split(&positions, &mut triangles) } else { None };
    let pieces = pieces.map(Box::new);
    let mesh = Arc::new(TriangleMesh { origin, positions, indices: triangles });
    let precise = precise.map(|positions| Arc::new(PreciseMesh { positions, indices: mesh.indices.clone() }));
    let moving =
        motion.map(|motion| deforming(shape, motion, tree_from_object, &mesh).map(Box::new)).transpose()?;
    let turned = (turned.normals.is_some() || turned.tangents.is_some()).then(|| Box::new(turned));
    let is_bare = Arc::get_mut(&mut shared).is_some_and(|own| *own == MeshDesc::default());
    let rest = if is_bare { BARE.clone() } else { shared };
    let attributes =
        Arc::new(MeshAttributes { mesh, swapped, first_half, turned, moving, precise, pieces, rest });
    Ok(BakedMesh { attributes, patches })
}

/// The vertices at all keys, in the space of the tree of `mesh`.
fn deforming(
    shape: u32,
    motion: MeshMotion,
    tree_from_object: &Transform,
    mesh: &TriangleMesh,
) -> Result<Deforming, BuildError> {
    let expected = mesh.positions.len();
    let (mut places, mut normals) = (Vec::new(), Vec::new());
    for moment in motion.moments {
        let lists =
            [("moving positions", Some(&moment.positions)), ("moving normals", moment.normals.as_ref())];
        for (list, found) in lists {
            if let Some(found) = found.map(Vec::len).filter(|&found| found != expected) {
                return Err(BuildError::ListLength { shape, list, found, expected });
            }
        }
        let place = |p: &Vec3| (tree_from_object.point(p.as_dvec3()) - mesh.origin).as_vec3();
        places.push(moment.positions.iter().map(place).collect());
        let turned = |n: &Vec3| {
            let n = tree_from_object.normal(n.as_dvec3());
            n.try_normalize().unwrap_or(DVec3::ZERO).as_vec3()
        };
        normals.extend(moment.normals.map(|list| list.iter().map(turned).collect::<Vec<Vec3>>()));
    }
    let normals = (normals.len() == places.len()).then_some(normals);
    let times = [motion.start, motion.end];
    match DeformingMesh::new(mesh.origin, times, places, mesh.indices.clone()) {
        Ok(mesh) => Ok(Deforming { mesh: Arc::new(mesh), normals }),
        Err(lumbre_kernel::BuildError::NotFinite { element: vertex, .. }) => {
            Err(BuildError::NotFinite { shape, vertex })
        }
        Err(error) => Err(error.into()),
    }
}

fn check(shape: u32, desc: &MeshDesc) -> Result<(), BuildError> {
    let expected = desc.positions.len();
    let further = |set: usize| desc.further_uvs[set].as_ref().map(Vec::len);
    let lists = [
        ("precise positions", desc.precise_positions.as_ref().map(Vec::len)),
        ("normals", desc.normals.as_ref().map(Vec::len)),
        ("texture coordinates", desc.uvs.as_ref().map(Vec::len)),
        ("tangents", desc.tangents.as_ref().map(Vec::len)),
        ("second texture coordinates", further(0)),
        ("third texture coordinates", further(1)),
        ("fourth texture coordinates", further(2)),
        ("colours", desc.colours.as_ref().map(Vec::len)),
        ("coverages", desc.coverages.as_ref().map(Vec::len)),
    ];
    for (list, found) in lists {
        if let Some(found) = found.filter(|&found| found != expected) {
            return Err(BuildError::ListLength { shape, list, found, expected });
        }
    }
    let faces = (desc.triangles.iter().map(|t| &t[..])).chain(desc.quads.iter().map(|q| &q[..]));
    for (face, corners) in faces.enumerate() {
        if let Some(&vertex) = corners.iter().find(|&&i| i as usize >= expected) {
            return Err(BuildError::NoSuchVertex { shape, face, vertex, count: expected });
        }
    }
    match desc.positions.iter().position(|p| !p.is_finite()) {
        Some(vertex) => Err(BuildError::NotFinite { shape, vertex }),
        None => Ok(()),
    }
}

/// The rounding error of a corner in single precision, relative to the largest coordinate.
const ROUNDING: f64 = 4.0 / (1_u64 << 23) as f64;

/// Whether the corners (counter-clockwise) form a parallelogram up to rounding: then two triangles equal the
/// patch.
fn is_parallelogram(corners: [Vec3; 4]) -> bool {
    let [a, b, c, d] = corners.map(Vec3::as_dvec3);
    let gap = ((a - b) + (c - d)).abs().max_element();
    let size = [a, b, c, d].iter().map(|p| p.abs().max_element()).fold(0.0, f64::max);
    let edge = (b - a).length().min((d - a).length());
    gap <= ROUNDING * size && gap <= 1e-3 * edge
}

fn is_flat_and_convex(corners: [Vec3; 4]) -> bool {
    let [a, b, c, d] = corners.map(Vec3::as_dvec3);
    let normal = (c - a).cross(d - b);
    let length = normal.length();
    let longest = (c - a).length().max((d - b).length());
    if length.is_nan() || length <= 0.0 {
        // Without area, or folded: triangles represent what remains.
        return true;
    }
    let height = normal.dot(b - a).abs() / length;
    let turns = [(a, b, c), (b, c, d), (c, d, a), (d, a, b)];
    let convex = turns.iter().all(|&(p, q, r)| (q - p).cross(r - q).dot(normal) >= 0.0);
    height <= 1e-6 * longest && convex
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumbre_math::Vec2;

    fn quad(last: Vec3) -> Arc<MeshDesc> {
        Arc::new(MeshDesc {
            positions: vec![
                Vec3::new(2.0, 3.0, 4.0),
                Vec3::new(5.0, 3.0, 4.0),
                Vec3::new(5.0, 7.0, 4.0),
                last,
            ],
            quads: vec![[0, 1, 2, 3]],
            ..MeshDesc::default()
        })
    }

    #[test]
    fn a_flat_quad_splits_and_a_bent_one_does_not() {
        let flat = bake(
            7,
            quad(Vec3::new(2.0, 7.0, 4.0)),
            &Transform::IDENTITY,
            DVec3::ZERO,
            QuadOrder::Around,
            true,
        )
        .unwrap();
        assert_eq!((flat.attributes.mesh.indices.len(), flat.patches.len()), (2, 0));
        let trapezium = bake(
            7,
            quad(Vec3::new(3.0, 7.0, 4.0)),
            &Transform::IDENTITY,
            DVec3::ZERO,
            QuadOrder::Around,
            true,
        )
        .unwrap();
        assert_eq!((trapezium.attributes.mesh.indices.len(), trapezium.patches.len()), (2, 0));
        let bent = bake(
            7,
            quad(Vec3::new(2.0, 7.0, 4.5)),
            &Transform::IDENTITY,
            DVec3::ZERO,
            QuadOrder::Around,
            true,
        )
        .unwrap();
        assert_eq!((bent.attributes.mesh.indices.len(), bent.patches), (0, vec![[0, 1, 3, 2]]));
        let dented = bake(
            7,
            quad(Vec3::new(4.5, 4.0, 4.0)),
            &Transform::IDENTITY,
            DVec3::ZERO,
            QuadOrder::Around,
            true,
        )
        .unwrap();
        assert_eq!((dented.attributes.mesh.indices.len(), dented.patches.len()), (0, 1));
    }

    #[test]
    fn a_mesh_baked_through_a_mirror_keeps_its_front() {
        let desc = || {
            Arc::new(MeshDesc {
                positions: vec![Vec3::new(2.0, 3.0, 4.0), Vec3::new(5.0, 3.5, 4.0), Vec3::new(5.0, 7.0, 6.0)],
                triangles: vec![[0, 1, 2]],
                ..MeshDesc::default()
            })
        };
        let front = |baked: &BakedMesh| {
            let [a, b, c] = baked.attributes.mesh.indices[0]
                .map(|i| baked.attributes.mesh.positions[i as usize].as_dvec3());
            (b - a).cross(c - a).normalize()
        };
        let plain = bake(0, desc(), &Transform::IDENTITY, DVec3::ZERO, QuadOrder::Around, true).unwrap();
        let mirror = Transform::scale(DVec3::new(-2.0, 3.0, 0.5)).unwrap();
        let mirrored = bake(0, desc(), &mirror, DVec3::ZERO, QuadOrder::Around, true).unwrap();
        let expected = mirror.normal(front(&plain)).normalize();
        assert!((front(&mirrored) - expected).length() < 1e-6);
    }

    #[test]
    fn meshes_of_one_description_share_what_does_not_move() {
        let desc = Arc::new(MeshDesc {
            uvs: Some(vec![Vec2::new(0.25, 0.75); 4]),
            normals: Some(vec![Vec3::Z; 4]),
            ..(*quad(Vec3::new(2.0, 7.0, 4.0))).clone()
        });
        let bake_at =
            |place: &Transform| bake(3, desc.clone(), place, DVec3::ZERO, QuadOrder::Around, true).unwrap();
        let turn = Transform::rotate(DVec3::X, 90.0).unwrap();
        let (here, there) = (bake_at(&Transform::IDENTITY), bake_at(&turn));
        assert!(Arc::ptr_eq(&here.attributes.rest, &there.attributes.rest));
        assert_eq!(here.attributes.normals().unwrap()[2], Vec3::Z);
        assert!((there.attributes.normals().unwrap()[2] - Vec3::NEG_Y).length() < 1e-6);
        assert_eq!(desc.positions.len(), 4);
        // The last one that holds it needs no copy.
        let own = bake(3, desc, &turn, DVec3::ZERO, QuadOrder::Around, true).unwrap();
        assert!(own.attributes.rest.uvs.is_some() && own.attributes.mesh.positions.len() == 4);
    }

    #[test]
    fn what_is_wrong_with_a_mesh_is_said() {
        let bake = |desc: MeshDesc| {
            bake(9, Arc::new(desc), &Transform::IDENTITY, DVec3::ZERO, QuadOrder::Around, true).err()
        };
        let whole = (*quad(Vec3::new(2.0, 7.0, 4.0))).clone();
        assert_eq!(
            bake(MeshDesc { triangles: vec![[0, 1, 4]], ..whole.clone() }),
            Some(BuildError::NoSuchVertex { shape: 9, face: 0, vertex: 4, count: 4 })
        );
        assert_eq!(
            bake(MeshDesc { uvs: Some(vec![Vec2::ZERO; 3]), ..whole.clone() }),
            Some(BuildError::ListLength { shape: 9, list: "texture coordinates", found: 3, expected: 4 })
        );
        let mut broken = whole;
        broken.positions[2].y = f32::NAN;
        assert_eq!(bake(broken), Some(BuildError::NotFinite { shape: 9, vertex: 2 }));
    }
}
