//! Mapped trees: the same answers, and no file that makes a query panic or go on for ever.

use std::path::PathBuf;
use std::sync::Arc;

use lumbre_geometry::Ray;
use lumbre_math::DVec3;
use tempfile::TempDir;

use super::oracle::check;
use super::scenes::{Random, build, cube, icosphere, mixture, precise, ray, with_every_preset};
use crate::tree::node::tag;
use crate::{Accel, Geometry, GeometryKind, LoadError, MapError, RefitError, TriangleMesh};

const CENTER: DVec3 = DVec3::new(1.5, -2.25, 4.0);

fn folder() -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tree.lumbre");
    (folder, path)
}

#[test]
fn a_mapped_tree_answers_as_the_one_that_was_saved() {
    with_every_preset(|| {
        for (seed, depth, infinite) in [(90, 0, false), (91, 1, true)] {
            let (folder, path) = folder();
            let mut random = Random(seed);
            let accel = mixture(&mut random, CENTER, 3.0, depth, infinite);
            let masks = (0..accel.tree.geometries.len() as u32).collect();
            let accel = accel.with_masks(masks);
            accel.save(&path).unwrap();
            let mapped = Accel::map(&path, accel.tree.geometries.clone()).unwrap();
            assert_eq!(format!("{mapped:?}"), format!("{accel:?}"));
            assert!(mapped.memory_bytes() < accel.memory_bytes());
            assert_eq!(mapped.to_bytes(), accel.to_bytes());
            let hits: usize = (0..500).map(|_| check(&mapped, &ray(&mut random, CENTER, 3.0))).sum();
            assert!(hits > 100, "{hits}");
            // Nothing else is left in the folder.
            assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        }
    });
}

#[test]
fn a_mapped_tree_is_refitted_in_memory_and_its_file_stays() {
    let (_folder, path) = folder();
    let ball = icosphere(3, DVec3::ZERO, 2.5);
    let at = |origin: DVec3| {
        let mesh = GeometryKind::Mesh(Arc::new(TriangleMesh { origin, ..ball.clone() }));
        vec![
            Geometry { id: 4, kind: mesh },
            Geometry { id: 5, kind: GeometryKind::PreciseMesh(Arc::new(precise(&cube()))) },
        ]
    };
    Accel::build(at(CENTER), &Default::default()).unwrap().save(&path).unwrap();
    let before = std::fs::read(&path).unwrap();
    let mut mapped = Accel::map(&path, at(CENTER)).unwrap();
    assert!(mapped.memory_bytes() < 2000, "{}", mapped.memory_bytes());
    mapped.refit(at(-CENTER)).unwrap();
    let mut random = Random(92);
    let hits: usize = (0..300).map(|_| check(&mapped, &ray(&mut random, -CENTER, 3.0))).sum();
    assert!(hits > 100, "{hits}");
    assert_eq!(std::fs::read(&path).unwrap(), before);
    // Moved geometries are not for the file.
    assert!(matches!(Accel::map(&path, at(-CENTER)), Err(MapError::Load(LoadError::Moved))));
    // A new file in its place leaves the mapped one as it is.
    let mapped = Accel::map(&path, at(CENTER)).unwrap();
    build(vec![GeometryKind::Mesh(Arc::new(cube()))]).save(&path).unwrap();
    (0..100).for_each(|_| {
        check(&mapped, &ray(&mut random, CENTER, 3.0));
    });
}

#[test]
fn an_empty_tree_is_mapped_too() {
    let (_folder, path) = folder();
    build(vec![]).save(&path).unwrap();
    let mapped = Accel::map(&path, vec![]).unwrap();
    assert_eq!(mapped.primitive_count(), 0);
    assert!(!mapped.any(&Ray::new(CENTER, DVec3::X)));
}

fn two_meshes() -> Accel {
    build(vec![GeometryKind::Mesh(Arc::new(icosphere(2, CENTER, 2.5))), GeometryKind::Mesh(Arc::new(cube()))])
}

#[test]
fn what_is_wrong_with_a_file_is_said() {
    let (folder, path) = folder();
    let accel = two_meshes();
    accel.save(&path).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let load = |bytes: &[u8], geometries: Vec<Geometry>| {
        std::fs::write(&path, bytes).unwrap();
        match Accel::map(&path, geometries) {
            Err(MapError::Load(error)) => error,
            other => panic!("{other:?}"),
        }
    };
    let with = |bytes: &[u8]| load(bytes, accel.tree.geometries.clone());
    assert_eq!(with(b"something else altogether"), LoadError::NotATree);
    assert_eq!(with(&bytes[..100]), LoadError::WrongLength { found: 100, expected: 256 });
    for cut in [256, 300, bytes.len() - 64, bytes.len() - 1] {
        let error = with(&bytes[..cut]);
        assert!(matches!(error, LoadError::WrongLength { found, .. } if found == cut), "{cut}: {error}");
    }
    let mut longer = bytes.clone();
    longer.extend([0; 64]);
    assert!(matches!(with(&longer), LoadError::WrongLength { .. }));
    let mut later = bytes.clone();
    later[8] = 10;
    assert_eq!(with(&later), LoadError::OtherVersion { found: 10, expected: 9 });
    for place in (12..bytes.len()).step_by(61) {
        let mut damaged = bytes.clone();
        damaged[place] ^= 0x10;
        match Accel::map(
            {
                std::fs::write(&path, &damaged).unwrap();
                &path
            },
            accel.tree.geometries.clone(),
        ) {
            Err(MapError::Load(LoadError::Damaged)) => {}
            // Between the arrays nothing stands.
            Ok(mapped) => assert_eq!(format!("{mapped:?}"), format!("{accel:?}")),
            other => panic!("{place}: {other:?}"),
        }
    }
    let fewer = load(&bytes, accel.tree.geometries[..1].to_vec());
    assert_eq!(fewer, LoadError::OtherGeometries(RefitError::OtherLength { expected: 2, found: 1 }));
    let mut exchanged = accel.tree.geometries.clone();
    exchanged.reverse();
    assert_eq!(load(&bytes, exchanged), LoadError::Moved);
    assert!(matches!(Accel::map(folder.path().join("nowhere"), vec![]), Err(MapError::Io(_))));
    assert!(accel.save(folder.path().join("no folder").join("tree")).is_err());
}

/// The file with the right checksums.
fn sealed(mut bytes: Vec<u8>) -> Vec<u8> {
    crate::io::mapped::seal(&mut bytes);
    bytes
}

#[test]
fn hostile_files_are_refused_or_harmless() {
    let (_folder, path) = folder();
    let mut random = Random(93);
    let accel = mixture(&mut random, CENTER, 3.0, 1, true);
    accel.save(&path).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    assert_eq!(sealed(bytes.clone()), bytes);
    let (mut refused, mut taken) = (0, 0);
    for _ in 0..4000 {
        let mut hostile = bytes.clone();
        for _ in 0..1 + random.below(3) {
            let word = 4 + random.below(hostile.len() / 4 - 4);
            let place = 4 * word..4 * word + 4;
            let other = random.below(bytes.len() / 4);
            let number = match random.below(5) {
                0 => [0, 1, 2, 8, 9, u32::MAX, 1 << 28, 1 << 31, tag::reference(tag::PRECISE, 3)]
                    [random.below(9)],
                1 => u32::from_le_bytes(bytes[4 * other..][..4].try_into().unwrap()),
                2 => [f32::NAN, f32::INFINITY, -f32::MAX, 0.5][random.below(4)].to_bits(),
                3 => random.0 as u32,
                _ => u32::from_le_bytes(hostile[place.clone()].try_into().unwrap()) ^ (1 << random.below(32)),
            };
            hostile[place].copy_from_slice(&number.to_le_bytes());
        }
        std::fs::write(&path, sealed(hostile)).unwrap();
        match Accel::map(&path, accel.tree.geometries.clone()) {
            Ok(mapped) => {
                taken += 1;
                for _ in 0..8 {
                    let ray = ray(&mut random, CENTER, 3.0);
                    let whole = ray.with_range(f64::NEG_INFINITY, f64::INFINITY);
                    if let Some(hit) = mapped.closest(&ray) {
                        mapped.surface(&ray, &hit);
                    }
                    mapped.any(&ray);
                    mapped.count(&whole);
                    let p = CENTER + 3.0 * random.vector();
                    let _ = (mapped.closest_point(p, 9.0), mapped.is_inside(p), mapped.winding_number(p));
                }
            }
            Err(MapError::Load(_)) => refused += 1,
            Err(other) => panic!("{other}"),
        }
    }
    assert!(refused > 500 && taken > 500, "{refused} refused, {taken} taken");
}
