//! The whole way from the bytes of rays to the bytes of answers.

use std::fmt::Write as _;
use std::io::{Cursor, Read, Seek};

use super::*;
use crate::cast::bytes::Bytes;
use crate::cast::npy;
use crate::cast::rays::Rows;

const QUERIES: [Query; 8] = [
    Query::Closest,
    Query::Any,
    Query::All,
    Query::Count,
    Query::ClosestPoint,
    Query::Distance,
    Query::Inside,
    Query::Winding,
];

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

/// Rays around the scene; some miss it.
fn rays() -> String {
    let mut text = String::from("ox,oy,oz,dx,dy,dz,tmax\n");
    for i in 0..203 {
        let x = f64::from(i % 17) * 0.7 - 6.0;
        let y = f64::from(i % 13) * 0.6 - 3.0;
        let _ = writeln!(text, "{x},{y},-9,{},0.01,{},{}", -0.01 * x, 0.5 + y / 10.0, 30 - i % 5);
    }
    text
}

/// Points around the scene; some are inside.
fn points() -> String {
    let mut text = String::from("x,y,z\n");
    for i in 0..203 {
        let number = |step: i32, size: f64| f64::from(i * step % 23) / 23.0 * size - 0.5 * size;
        let _ = writeln!(text, "{},{},{}", number(3, 12.0), number(5, 7.0), number(7, 9.0) + 2.0);
    }
    text
}

fn reader(query: Query, text: String) -> RayReader {
    let bytes = Bytes::from_reader("rays.csv", Cursor::new(text.into_bytes())).unwrap();
    RayReader::new(bytes, query.rows()).unwrap()
}

fn bytes(scene: &Scene, query: Query, form: Form, threads: usize, at_a_time: usize) -> Vec<u8> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let progress = RayProgress::new(true);
    let cast = Cast { scene, query, form, pool: Some(&pool), progress: &progress, at_a_time };
    let rays = reader(query, if query.rows() == Rows::Rays { rays() } else { points() });
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
fn threads_and_piece_sizes_give_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene(folder.path());
    for query in QUERIES {
        for form in [Form::Csv, Form::Npy, Form::Npz] {
            let whole = bytes(&scene, query, form, 1, 1000);
            assert!(200 < whole.len(), "{query:?} {form:?}");
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
    let mut reader = reader(Query::Closest, rays());
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
fn points_have_the_answers_of_the_scene() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene(folder.path());
    let lines = |query| {
        let text = String::from_utf8(bytes(&scene, query, Form::Csv, 2, 50)).unwrap();
        text.lines().skip(1).map(str::to_owned).collect::<Vec<_>>()
    };
    let mut reader = reader(Query::Inside, points());
    let piece = reader.next(1000).unwrap().unwrap();
    let points = reader.decoder().rays(&piece).unwrap();
    let [nearest, distances, inside, winding] =
        [Query::ClosestPoint, Query::Distance, Query::Inside, Query::Winding].map(lines);
    let mut within = 0;
    for (i, point) in points.iter().enumerate() {
        let expected = scene.closest_point(point.origin, f64::INFINITY).unwrap().unwrap();
        assert_eq!(distances[i], format!("{i},{:?}", expected.distance));
        assert!(nearest[i].starts_with(&format!("{i},1,{:?},{:?},", expected.distance, expected.point.x)));
        let is_inside = scene.is_inside(point.origin);
        assert_eq!(inside[i], format!("{i},{}", u8::from(is_inside)));
        assert_eq!(winding[i], format!("{i},{:?}", scene.winding_number(point.origin).unwrap()));
        within += usize::from(is_inside);
    }
    assert!((5..150).contains(&within), "{within} points are inside");
}

#[test]
fn no_rays_have_no_answers() {
    for form in [Form::Csv, Form::Npy, Form::Npz] {
        for query in QUERIES {
            let folder = tempfile::tempdir().unwrap();
            let scene = scene(folder.path());
            let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
            let progress = RayProgress::new(true);
            let cast =
                Cast { scene: &scene, query, form, pool: Some(&pool), progress: &progress, at_a_time: 100 };
            let path = folder.path().join("answers");
            let header = if query.rows() == Rows::Rays { "dx,dy,dz,ox,oy,oz" } else { "z,y,x" };
            let rays = reader(query, format!("{header}\n \n"));
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
fn a_header_keeps_its_length_once_answers_are_counted() {
    for table in QUERIES.map(Query::table) {
        let descrs = table.arrays().into_iter().map(|(_, descr)| descr).chain([table.descr()]);
        for descr in descrs {
            assert_eq!(npy::header(&descr, 0).len(), npy::header(&descr, u64::MAX).len());
        }
    }
}
