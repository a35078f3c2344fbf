//! Trees as bytes: the same ones back, and no others.

use std::sync::Arc;

use lumbre_geometry::Ray;
use lumbre_math::DVec3;

use super::oracle::check;
use super::scenes::{Random, build, cube, icosphere, mixture, ray, with_every_preset};
use crate::io::bytes::check_structure;
use crate::tree::node::{Node, tag};
use crate::tree::packed::Packed;
use crate::tree::triangle_block::BlockIds;
use crate::{Accel, BuildError, Geometry, GeometryKind, LoadError, Query, RefitError, TriangleMesh};

const CENTER: DVec3 = DVec3::new(1.5, -2.25, 4.0);

#[test]
fn a_saved_tree_comes_back_to_the_bit() {
    with_every_preset(|| {
        for (seed, depth, infinite) in [(60, 0, false), (61, 1, true)] {
            let mut random = Random(seed);
            let accel = mixture(&mut random, CENTER, 3.0, depth, infinite);
            let bytes = accel.to_bytes();
            let loaded = Accel::from_bytes(&bytes, accel.tree.geometries.clone()).unwrap();
            assert_eq!(format!("{:?}", loaded.tree.packed), format!("{:?}", accel.tree.packed));
            assert_eq!(format!("{loaded:?}"), format!("{accel:?}"));
            assert_eq!(loaded.to_bytes(), bytes);
        }
    });
}

#[test]
fn a_saved_tree_is_small_and_may_be_empty() {
    let ball = GeometryKind::Mesh(Arc::new(icosphere(6, CENTER, 2.5)));
    let accel = build(vec![ball]);
    let bytes = accel.to_bytes().len() as f64 / accel.primitive_count() as f64;
    assert!(bytes < 7.0, "{bytes}");
    let empty = build(vec![]);
    let loaded = Accel::from_bytes(&empty.to_bytes(), vec![]).unwrap();
    assert_eq!(loaded.primitive_count(), 0);
}

#[test]
fn over_moved_geometries_it_comes_refitted() {
    let mut random = Random(62);
    let accel = mixture(&mut random, CENTER, 3.0, 0, false);
    let mut moved = accel.tree.geometries.clone();
    for geometry in &mut moved {
        if let GeometryKind::Mesh(mesh) = &mut geometry.kind {
            Arc::make_mut(mesh).origin += DVec3::new(2.0, -3.0, 0.5);
        }
    }
    let loaded = Accel::from_bytes(&accel.to_bytes(), moved).unwrap();
    let hits: usize = (0..1000).map(|_| check(&loaded, &ray(&mut random, CENTER, 3.0))).sum();
    assert!(hits > 300, "{hits}");
}

/// The bytes with the right checksum.
fn sealed(mut bytes: Vec<u8>) -> Vec<u8> {
    let end = bytes.len() - 8;
    let sum = bytes[..end].iter().fold(0xcbf2_9ce4_8422_2325_u64, |hash, &byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    });
    bytes[end..].copy_from_slice(&sum.to_le_bytes());
    bytes
}

fn two_meshes() -> Accel {
    build(vec![GeometryKind::Mesh(Arc::new(icosphere(2, CENTER, 2.5))), GeometryKind::Mesh(Arc::new(cube()))])
}

#[test]
fn what_is_wrong_with_bytes_is_said() {
    let accel = two_meshes();
    let (bytes, geometries) = (accel.to_bytes(), accel.tree.geometries.clone());
    let load = |bytes: &[u8]| Accel::from_bytes(bytes, geometries.clone()).map(|_| ()).unwrap_err();
    assert_eq!(load(b"something else altogether"), LoadError::NotATree);
    assert_eq!(load(&[]), LoadError::NotATree);
    let found = bytes.len();
    for cut in [9, 30, 100, found - 4, found - 1] {
        let error = load(&bytes[..cut]);
        let is_said = matches!(error, LoadError::WrongLength { .. } | LoadError::Damaged);
        assert!(is_said, "{cut}: {error}");
    }
    let mut later = bytes.clone();
    later[8] = 9;
    assert_eq!(load(&later), LoadError::OtherVersion { found: 9, expected: 8 });
    let mut longer = bytes.clone();
    longer.extend([0; 4]);
    assert_eq!(load(&longer), LoadError::Damaged);
    let longer = sealed(longer);
    assert_eq!(load(&longer), LoadError::WrongLength { found: found + 4, expected: found });
    for place in (12..found).step_by(97) {
        let mut damaged = bytes.clone();
        damaged[place] ^= 0x10;
        let error = load(&damaged);
        assert!(matches!(error, LoadError::Damaged | LoadError::WrongLength { .. }), "{place}: {error}");
    }
}

#[test]
fn geometries_that_do_not_fit_are_refused() {
    let accel = two_meshes();
    let bytes = accel.to_bytes();
    let load = |geometries: Vec<Geometry>| match Accel::from_bytes(&bytes, geometries) {
        Err(LoadError::OtherGeometries(error)) => error,
        other => panic!("{other:?}"),
    };
    assert_eq!(load(vec![]), RefitError::OtherLength { expected: 2, found: 0 });
    let mut exchanged = accel.tree.geometries.clone();
    exchanged.reverse();
    assert_eq!(load(exchanged), RefitError::OtherTopology { geometry: 0 });
    let mut broken = accel.tree.geometries.clone();
    let mesh = TriangleMesh { origin: DVec3::new(2.0, f64::NAN, 3.0), ..cube() };
    broken[1].kind = GeometryKind::Mesh(Arc::new(mesh));
    assert_eq!(load(broken), RefitError::Unsound(BuildError::NotFinite { geometry: 1, element: 0 }));
}

#[test]
fn hostile_bytes_are_refused_or_harmless() {
    let mut random = Random(63);
    let accel = mixture(&mut random, CENTER, 3.0, 1, false);
    let bytes = accel.to_bytes();
    let (mut refused, mut taken) = (0, 0);
    for _ in 0..4000 {
        let mut hostile = bytes.clone();
        for _ in 0..1 + random.below(3) {
            let word = 3 + random.below(hostile.len() / 4 - 5);
            let place = 4 * word..4 * word + 4;
            let other = random.below(bytes.len() / 4);
            let number = match random.below(4) {
                0 => [0, 1, 2, 8, 9, u32::MAX, 1 << 28, 1 << 31, tag::reference(tag::CUSTOM, 3)]
                    [random.below(9)],
                1 => u32::from_le_bytes(bytes[4 * other..][..4].try_into().unwrap()),
                2 => random.0 as u32,
                _ => u32::from_le_bytes(hostile[place.clone()].try_into().unwrap()) ^ (1 << random.below(32)),
            };
            hostile[place].copy_from_slice(&number.to_le_bytes());
        }
        match Accel::from_bytes(&sealed(hostile), accel.tree.geometries.clone()) {
            Ok(loaded) => {
                taken += 1;
                (0..3).for_each(|_| {
                    check(&loaded, &ray(&mut random, CENTER, 3.0));
                });
            }
            Err(_) => refused += 1,
        }
    }
    assert!(refused > 2000 && taken > 20, "{refused} refused, {taken} taken");
}

#[test]
fn masks_are_saved_and_stay_through_a_refit() {
    let accel = two_meshes().with_masks(vec![1, 6]);
    let bytes = accel.to_bytes();
    let mut loaded = Accel::from_bytes(&bytes, accel.tree.geometries.clone()).unwrap();
    assert_eq!(loaded.to_bytes(), bytes);
    let ray = Ray::new(CENTER - 9.0 * DVec3::Z, DVec3::Z);
    let both = |accel: &Accel| {
        [1, 2, 8].map(|mask| {
            let options = Query { mask, ..Query::new() };
            accel.closest_with(&ray, &options).map(|hit| hit.geometry)
        })
    };
    let expected = [Some(0), None, None];
    assert_eq!(both(&accel), expected);
    assert_eq!(both(&loaded), expected);
    loaded.refit(accel.tree.geometries.clone()).unwrap();
    assert_eq!(both(&loaded), expected);
    // One per geometry, or none.
    let mut fewer = bytes.clone();
    let place = fewer.len() - 16;
    fewer.drain(place..place + 4);
    fewer[32] = 1;
    let error = Accel::from_bytes(&sealed(fewer), accel.tree.geometries.clone()).unwrap_err();
    assert!(matches!(error, LoadError::Inconsistent { .. }), "{error}");
}

#[test]
fn a_leaf_with_blocks_of_two_meshes_is_refused() {
    let accel = two_meshes();
    let mut tree = Packed { root: Some(0), ..Packed::default() };
    tree.ids = vec![BlockIds::empty(0), BlockIds::empty(1)].into();
    let mut apart = Node::EMPTY;
    (apart.children[0], apart.children[1]) = (tag::triangles(0, 1), tag::triangles(1, 1));
    let mut together = Node::EMPTY;
    together.children[0] = tag::triangles(0, 2);
    for (node, is_sound) in [(apart, true), (together, false)] {
        tree.nodes = vec![node].into();
        let numbers = |leaf| Some(tag::blocks(leaf));
        assert_eq!(check_structure(&tree, &accel.tree.geometries, numbers).is_ok(), is_sound);
    }
}
