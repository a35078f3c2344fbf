//! The whole way from the bytes of rays to the bytes of answers.

use std::fmt::Write as _;
use std::io::{Cursor, Read, Seek};

use super::*;
use crate::cast::bytes::Bytes;

const QUERIES: [Query; 4] = [Query::Closest, Query::Any, Query::All, Query::Count];

fn scene(folder: &Path) -> Scene {
    let path = folder.join("scene.pbrt");
    let text = "WorldBegin
        Shape \"sphere\" \"point3 center\" [1 2 3] \"float radius\" 2
        Shape \"trianglemesh\" \"point3 P\" [-5 -5 2.5  5 -5 2.5  0 7 2.5] \"integer indices\" [0 1 2]
        ObjectBegin \"thing\"
        Shape \"torus\" \"float majorradius\" 1.5 \"float minorradius\" 0.5
        ObjectEnd
        Translate -3 0 1
        ObjectInstance \"thing\"
        ObjectInstance \"thing\"";
    std::fs::write(&path, text).unwrap();
    lumbre::open(path).unwrap()
}

/// Rays about the scene, of which some miss it.
fn rays() -> String {
    let mut text = String::from("ox,oy,oz,dx,dy,dz,tmax\n");
    for i in 0..203 {
        let x = f64::from(i % 17) * 0.7 - 6.0;
        let y = f64::from(i % 13) * 0.6 - 3.0;
        let _ = writeln!(text, "{x},{y},-9,{},0.01,{},{}", -0.01 * x, 0.5 + y / 10.0, 30 - i % 5);
    }
    text
}

fn bytes(scene: &Scene, query: Query, form: Form, threads: usize, at_a_time: usize) -> Vec<u8> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let progress = Progress::new(true);
    let cast = Cast { scene, query, form, pool: Some(&pool), progress: &progress, at_a_time };
    let rays = RayReader::new(Bytes::from_reader("rays.csv", Cursor::new(rays().into_bytes()))).unwrap();
    let mut file = tempfile::tempfile().unwrap();
    let output = Output::in_file(&mut file, form, query.table(), &std::env::temp_dir()).unwrap();
    let mut failure = None;
    cast.write(rays, output, &mut failure).unwrap();
    assert!(failure.is_none());
    let mut bytes = Vec::new();
    file.rewind().unwrap();
    file.read_to_end(&mut bytes).unwrap();
    bytes
}

#[test]
fn every_number_of_threads_and_every_size_of_pieces_gives_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene(folder.path());
    for query in QUERIES {
        for form in [Form::Csv, Form::Npy, Form::Npz] {
            let whole = bytes(&scene, query, form, 1, 1000);
            assert!(500 < whole.len(), "{query:?} {form:?}");
            for (threads, at_a_time) in [(1, 1), (2, 7), (3, 100), (2, 203)] {
                let pieces = bytes(&scene, query, form, threads, at_a_time);
                assert!(pieces == whole, "{query:?} {form:?}, {at_a_time} at a time on {threads} threads");
            }
        }
    }
}

#[test]
fn batches_give_the_answers_of_single_rays() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene(folder.path());
    let mut reader =
        RayReader::new(Bytes::from_reader("rays.csv", Cursor::new(rays().into_bytes()))).unwrap();
    let piece = reader.next(1000).unwrap().unwrap();
    let rays = reader.decoder().rays(&piece).unwrap();
    let hits = scene.closest_batch(&rays);
    let is_hit = scene.any_batch(&rays);
    for ((ray, hit), is_hit) in rays.iter().zip(&hits).zip(&is_hit) {
        assert_eq!((*hit, *is_hit), (scene.closest(ray), scene.any(ray)));
    }
    let met = is_hit.iter().filter(|hit| **hit).count();
    assert!((30..=190).contains(&met), "{met}");
    assert!(hits.iter().flatten().any(|hit| hit.instance.is_some()));
}

#[test]
fn no_rays_have_no_answers() {
    for form in [Form::Csv, Form::Npy, Form::Npz] {
        for query in QUERIES {
            let folder = tempfile::tempdir().unwrap();
            let scene = scene(folder.path());
            let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
            let progress = Progress::new(true);
            let cast =
                Cast { scene: &scene, query, form, pool: Some(&pool), progress: &progress, at_a_time: 100 };
            let path = folder.path().join("answers");
            let text = Cursor::new(b"dx,dy,dz,ox,oy,oz\n \n".to_vec());
            let rays = RayReader::new(Bytes::from_reader("rays.csv", text)).unwrap();
            cast.to_file(rays, &path).unwrap();
            let written = std::fs::read(&path).unwrap();
            match form {
                Form::Csv => assert_eq!(written, format!("{}\n", query.table().header()).into_bytes()),
                Form::Npy => assert_eq!(written, npy::header(&query.table().descr(), 0)),
                Form::Npz => {
                    let mut archive = zip::ZipArchive::new(Cursor::new(written)).unwrap();
                    assert_eq!(archive.len(), query.table().arrays().len());
                    for (i, (name, descr)) in query.table().arrays().iter().enumerate() {
                        let mut array = Vec::new();
                        let mut entry = archive.by_index(i).unwrap();
                        assert_eq!(entry.name().unwrap(), format!("{name}.npy"));
                        entry.read_to_end(&mut array).unwrap();
                        assert_eq!(array, npy::header(descr, 0));
                    }
                }
            }
        }
    }
}

#[test]
fn a_header_keeps_its_length_when_the_number_of_answers_is_known() {
    for table in QUERIES.map(Query::table) {
        let descrs = table.arrays().into_iter().map(|(_, descr)| descr).chain([table.descr()]);
        for descr in descrs {
            assert_eq!(npy::header(&descr, 0).len(), npy::header(&descr, u64::MAX).len());
        }
    }
}
