//! The core of the page, as any machine runs it.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::time::Duration;

use lumbre::formats::HeldFiles;
use lumbre_web::{Explained, ProblemKind, Session, Wanted, calculate};

const SCENE: &str = "Film \"rgb\" \"integer xresolution\" 40 \"integer yresolution\" 28
Sampler \"independent\" \"integer pixelsamples\" 6
LookAt 1 -7 3  0 0 0.5  0 0 1
Camera \"perspective\" \"float fov\" 35
WorldBegin
LightSource \"infinite\" \"rgb L\" [0.5 0.6 0.7]
Material \"diffuse\" \"rgb reflectance\" [0.7 0.2 0.1]
Shape \"sphere\" \"float radius\" 1.25
";

fn held(files: &[(&str, &[u8])]) -> HeldFiles {
    let mut held = HeldFiles::default();
    files.iter().for_each(|(name, bytes)| held.insert(name, *bytes));
    held
}

fn open(text: &str) -> Session {
    Session::open(held(&[("scene.pbrt", text.as_bytes())]), "scene.pbrt", &Wanted::default()).unwrap()
}

#[test]
fn a_picture_is_the_same_however_its_time_is_cut() {
    let mut whole = open(SCENE);
    let pass = whole.step(Duration::from_secs(600)).unwrap();
    assert!(pass.done && pass.spp == 6 && pass.size == (40, 28), "{pass:?}");
    let mut cut = open(SCENE);
    let mut steps = 1;
    while !cut.step(Duration::from_micros(300)).unwrap().done {
        steps += 1;
        assert_eq!(cut.pixels().len(), 4 * 40 * 28);
        assert!(steps < 100_000);
    }
    assert!(steps > 2, "{steps}");
    assert_eq!(cut.pixels(), whole.pixels());
    // Of what is done, nothing more is rendered.
    assert_eq!(cut.step(Duration::from_secs(1)).unwrap(), pass);
}

#[test]
fn sessions_of_some_rows_each_have_those_of_the_whole() {
    let mut whole = open(SCENE);
    whole.step(Duration::from_secs(600)).unwrap();
    let mut rows = Vec::new();
    for (from, to) in [(0, 9), (9, 20), (20, 28)] {
        let mut part = open(SCENE);
        assert!(part.is_divisible());
        part.limit_rows(from, to).unwrap();
        let pass = part.step(Duration::from_secs(600)).unwrap();
        assert_eq!((pass.size, pass.bounds, pass.done), ((40, 28), [0, from, 40, to], true));
        rows.extend(part.pixels());
    }
    assert_eq!(rows, whole.pixels());
    assert_eq!(open(SCENE).limit_rows(28, 40).unwrap_err().kind, ProblemKind::Usage);
    // A film's own part of the picture is where it belongs.
    let cropped = SCENE.replacen("Film \"rgb\"", "Film \"rgb\" \"integer pixelbounds\" [ 5 25 4 14 ]", 1);
    let mut session = open(&cropped);
    let pass = session.step(Duration::from_secs(600)).unwrap();
    assert_eq!((pass.size, pass.bounds), ((40, 28), [5, 4, 25, 14]));
    assert_eq!(session.pixels().len(), 4 * 20 * 10);
    // What is denoised is no picture of some rows.
    let model = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let mut model = Session::open(held(&[("a.obj", model)]), "a.obj", &Wanted::default()).unwrap();
    if !model.is_divisible() {
        assert_eq!(model.limit_rows(0, 4).unwrap_err().kind, ProblemKind::Usage);
    }
}

#[test]
fn a_picture_has_the_pixels_of_a_png_of_the_facade() {
    let folder = std::env::temp_dir().join(format!("lumbre-web-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("scene.pbrt");
    std::fs::write(&path, SCENE).unwrap();
    let scene = lumbre::open(&path).unwrap();
    let picture = scene.render(&scene.options()).unwrap();
    let png = picture
        .encode(lumbre::formats::image::ImageFormat::Png, &lumbre::SaveOptions::default(), &[])
        .unwrap();
    std::fs::remove_dir_all(&folder).unwrap();
    let limits = lumbre::formats::Limits::default();
    let image = lumbre::read_image_from("scene.png", &png[..], limits).unwrap();
    let expected: Vec<u8> = image
        .pixels()
        .iter()
        .flat_map(|&light| [&lumbre::image::ToneMap::None.encode(light, 0.0).to_u8()[..], &[255]].concat())
        .collect();
    let mut session = open(SCENE);
    assert!(session.light().is_empty());
    session.step(Duration::from_secs(600)).unwrap();
    assert_eq!(session.pixels(), expected);
    let light: Vec<f32> = picture.image().pixels().iter().flat_map(|light| light.to_array()).collect();
    assert_eq!(session.light(), light);
}

#[test]
fn a_mistake_has_its_place_and_words() {
    let text = SCENE.replace("1.25", "-1.25");
    let files = held(&[("scene.pbrt", text.as_bytes())]);
    let problem = Session::open(files, "scene.pbrt", &Wanted::default()).unwrap_err();
    assert_eq!(problem.kind, ProblemKind::Input);
    assert_eq!((problem.file.as_deref(), problem.line), (Some("scene.pbrt"), Some(8)));
    assert!(problem.message.starts_with("scene.pbrt:8:16: parameter \"radius\""), "{problem}");
    let text = SCENE.replace("\"sphere\"", "\"spere\"");
    assert!(open(&text).warnings()[0].contains("scene.pbrt:8:1: unknown shape \"spere\""), "{text}");
    let missing = Session::open(held(&[]), "scene.pbrt", &Wanted::default()).unwrap_err();
    assert_eq!(missing.kind, ProblemKind::Files);
}

#[test]
fn no_file_outside_of_those_given_is_read() {
    let own = concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml");
    for directive in ["Include", "Import"] {
        let text = format!("{SCENE}{directive} \"{own}\"\n");
        let files = held(&[("scene.pbrt", text.as_bytes())]);
        let problem = Session::open(files, "scene.pbrt", &Wanted::default()).unwrap_err();
        assert!(problem.message.contains("no such file among those that are held"), "{problem}");
    }
}

#[test]
fn what_is_too_large_for_a_page_is_refused() {
    let files = || held(&[("scene.pbrt", SCENE.as_bytes())]);
    let wanted = Wanted { size: Some((65_536, 65_536)), ..Wanted::default() };
    let problem = Session::open(files(), "scene.pbrt", &wanted).unwrap_err();
    assert_eq!(problem.kind, ProblemKind::Limit, "{problem}");
    let wanted = Wanted { size: Some((0, 5)), ..Wanted::default() };
    assert_eq!(Session::open(files(), "scene.pbrt", &wanted).unwrap_err().kind, ProblemKind::Usage);
    let wanted = Wanted { integrator: Some("pth".to_owned()), ..Wanted::default() };
    let problem = Session::open(files(), "scene.pbrt", &wanted).unwrap_err();
    assert!(problem.message.contains("no integrator \"pth\""), "{problem}");
}

#[test]
fn rays_are_answered_as_the_program_prints_them() {
    let session = open(SCENE);
    let rays = b"ox,oy,oz,dx,dy,dz\n0,0,-5,0,0,1\n7,0,-5,0,0,1\n".to_vec();
    let answers = session.cast(rays.clone(), "closest").unwrap();
    let lines: Vec<&str> = answers.lines().collect();
    assert!(lines[0].starts_with("ray,hit,t,px,py,pz") && lines[1].starts_with("0,1,3.75,"), "{answers}");
    assert!(lines[2].starts_with("1,0,") && lines.len() == 3, "{answers}");
    assert_eq!(session.cast(rays, "count").unwrap(), "ray,count\n0,2\n1,0\n");
    assert_eq!(session.cast(b"x,y,z\n0,0,3.25\n".to_vec(), "distance").unwrap(), "point,distance\n0,2.0\n");
    let problem = session.cast(b"ox,oy\n1,2\n".to_vec(), "closest").unwrap_err();
    assert!(problem.message.starts_with("rays:1:"), "{problem}");
    assert!(
        session.cast(Vec::new(), "closet").unwrap_err().message.contains("expected one of: closest, any")
    );
}

#[test]
fn pixels_and_rays_are_explained_in_every_format() {
    let session = open(SCENE);
    for format in lumbre_cli::Format::NAMES {
        for lang in lumbre_cli::Language::NAMES {
            let asked = Explained {
                pixel: Some((20, 13)),
                format: Some(format.to_owned()),
                lang: Some(lang.to_owned()),
                ..Explained::default()
            };
            assert!(session.explain(&asked).unwrap().contains("1.25"), "{format} has the radius");
        }
    }
    let ray = |ray: &[f64]| Explained { ray: Some(ray.to_vec()), ..Explained::default() };
    assert!(session.explain(&ray(&[0.0, 0.0, -5.0, 0.0, 0.0, 1.0])).unwrap().contains("3.75"));
    for wrong in [&[0.0; 6][..], &[1.0; 5], &[1.0; 7], &[0.0, 0.0, 0.0, 1.0, 0.0, f64::NAN]] {
        assert_eq!(session.explain(&ray(wrong)).unwrap_err().kind, ProblemKind::Usage, "{wrong:?}");
    }
    let outside = Explained { pixel: Some((40, 3)), ..Explained::default() };
    assert!(session.explain(&outside).unwrap_err().message.contains("40,28"));
    assert_eq!(session.explain(&Explained::default()).unwrap_err().kind, ProblemKind::Usage);
}

#[test]
fn expressions_are_calculated_with_their_steps() {
    assert!(calculate("cross([1, 2, 2], [2, -1, 2])", "en", false).unwrap().ends_with("= [6, 2, -5]\n"));
    let json: serde_json::Value = serde_json::from_str(&calculate("2 + 3", "es", true).unwrap()).unwrap();
    assert_eq!(json["value"], 5.0);
    let problem = calculate("cross([1, 2, 2]", "en", false).unwrap_err();
    assert_eq!(problem.kind, ProblemKind::Usage);
    assert!(problem.message.contains('^'), "{problem}");
    assert!(calculate("1", "de", false).is_err());
}

/// Every beginning of a scene, and the scene with each of its bytes damaged, is opened or refused with a message.
#[test]
fn damaged_scenes_are_refused_or_opened() {
    let mut refused = 0;
    for i in 0..SCENE.len() {
        let mut damaged = SCENE.as_bytes().to_vec();
        damaged[i] ^= 0x15;
        for bytes in [&SCENE.as_bytes()[..i], &damaged] {
            let wanted = Wanted { size: Some((5, 3)), spp: Some(2), ..Wanted::default() };
            match Session::open(held(&[("scene.pbrt", bytes)]), "scene.pbrt", &wanted) {
                Ok(mut session) => assert!(session.step(Duration::from_secs(60)).unwrap().done),
                Err(problem) => {
                    refused += 1;
                    assert!(!problem.message.is_empty());
                }
            }
        }
    }
    assert!(refused > 300, "{refused}");
}
