//! Films that keep more than colours: what files have of them, and what is refused.

use std::sync::Arc;

use lumbre::formats::image::read_layers;
use lumbre::formats::{Budget, Diagnostics, Limits};

use crate::files::{Folder, answer};

fn scene(film: &str) -> String {
    format!(
        r#"
Film {film} "integer xresolution" 21 "integer yresolution" 15
Sampler "zsobol" "integer pixelsamples" 4
LookAt 0 -6 2  0 0 0.5  0 0 1
Camera "perspective" "float fov" 40
WorldBegin
LightSource "infinite" "rgb L" [0.4 0.5 0.6]
Material "diffuse" "rgb reflectance" [0.8 0.3 0.1]
Shape "disk" "float radius" 4
"#
    )
}

fn folder() -> Folder {
    let folder = Folder::new();
    folder.write("surfaces.pbrt", &scene("\"gbuffer\""));
    folder.write(
        "spectral.pbrt",
        &scene("\"spectral\" \"integer nbuckets\" 3 \"string filename\" \"light.exr\""),
    );
    folder
}

fn run(folder: &Folder, arguments: &str) -> (i32, String) {
    let arguments: Vec<&str> = arguments.split_whitespace().collect();
    answer(folder.command(&arguments).output().expect("the program starts"))
}

fn bytes(folder: &Folder, name: &str) -> Vec<u8> {
    std::fs::read(folder.path(name)).expect("a picture")
}

fn channels(bytes: &[u8]) -> Vec<String> {
    let budget = Budget::new(Limits::default());
    let layers = read_layers(bytes, &Arc::from("picture.exr"), &budget, &mut Diagnostics::default());
    layers.expect("a picture").iter().map(|layer| layer.name.clone()).collect()
}

fn has(bytes: &[u8], text: &str) -> bool {
    bytes.windows(text.len()).any(|window| window == text.as_bytes())
}

#[test]
fn channels_are_named_as_in_pbrt_and_files_say_what_they_are() {
    let folder = folder();
    let (status, said) = run(&folder, "render surfaces.pbrt");
    assert!(status == 0 && !said.contains("warning"), "{said}");
    let mut expected = vec!["R", "G", "B", "dzdx", "dzdy", "u", "v"];
    for (group, letters) in
        [("Albedo", "RGB"), ("P", "XYZ"), ("N", "XYZ"), ("Ns", "XYZ"), ("Variance", "RGB")]
    {
        expected.extend(letters.chars().map(|letter| &*format!("{group}.{letter}").leak()));
    }
    expected.extend(["RelativeVariance.R", "RelativeVariance.G", "RelativeVariance.B"]);
    expected.sort_unstable();
    // Next to the scene, with a format that holds them.
    let mut found = channels(&bytes(&folder, "surfaces.exr"));
    found.sort_unstable();
    assert_eq!(found, expected);
    let (status, said) = run(&folder, "render spectral.pbrt");
    assert!(status == 0 && !said.contains("warning"), "{said}");
    let picture = bytes(&folder, "light.exr");
    let mut found = channels(&picture);
    found.sort_unstable();
    assert_eq!(found, ["B", "G", "R", "S0.438,333nm", "S0.595,000nm", "S0.751,667nm"]);
    for text in ["spectralLayoutVersion\0string\0\u{3}\0\0\0", "emissiveUnits\0string\0", "W.m^-2.sr^-1"] {
        assert!(has(&picture, text), "{text:?}");
    }
    // The same bytes however often it is done: attributes have an order.
    for threads in [1, 2, 3] {
        let command = format!("render spectral.pbrt --threads {threads} --denoise -o again{threads}.exr");
        assert_eq!(run(&folder, &command).0, 0);
    }
    assert_eq!(bytes(&folder, "again1.exr"), bytes(&folder, "again2.exr"));
    assert_eq!(bytes(&folder, "again1.exr"), bytes(&folder, "again3.exr"));
    assert!(has(&bytes(&folder, "again1.exr"), "denoiser\0string\0"));
}

#[test]
fn parts_come_to_the_bytes_of_the_whole_and_films_do_not_mix() {
    let folder = folder();
    for name in ["surfaces", "spectral"] {
        for command in [
            format!("render {name}.pbrt --samples 0..3 --crop 0,0,12,15 -o a.part"),
            format!("render {name}.pbrt --samples 0..3 --crop 12,0,21,15 -o b.part"),
            format!("render {name}.pbrt --samples 3..4 -o {name}.part"),
            format!("merge {name}.part b.part a.part -o merged.exr"),
            format!("render {name}.pbrt -o whole.exr"),
        ] {
            let (status, said) = run(&folder, &command);
            assert_eq!(status, 0, "{command}: {said}");
        }
        assert_eq!(bytes(&folder, "merged.exr"), bytes(&folder, "whole.exr"), "{name}");
    }
    folder.write("surfaces.pbrt", &scene("\"gbuffer\" \"string coordinatesystem\" \"world\""));
    assert_eq!(run(&folder, "render surfaces.pbrt --samples 0..3 -o other.part").0, 0);
    let (status, said) = run(&folder, "merge surfaces.part other.part -o mixed.exr");
    assert!(status == 3 && said.contains("film"), "{status} {said}");
}

#[test]
fn a_render_that_was_stopped_goes_on_to_the_same_file() {
    let folder = folder();
    for name in ["surfaces", "spectral"] {
        for command in [
            format!("render {name}.pbrt --spp 3 --keep-sums -o kept.exr"),
            format!("render {name}.pbrt --spp 8 --resume --keep-sums -o kept.exr"),
            format!("render {name}.pbrt --spp 8 --keep-sums -o whole.exr"),
        ] {
            let (status, said) = run(&folder, &command);
            assert_eq!(status, 0, "{command}: {said}");
        }
        assert_eq!(bytes(&folder, "kept.exr"), bytes(&folder, "whole.exr"), "{name}");
    }
}

#[test]
fn what_cannot_hold_the_channels_is_refused() {
    let folder = folder();
    for (name, film) in [("surfaces", "gbuffer"), ("spectral", "spectral")] {
        let (status, said) = run(&folder, &format!("render {name}.pbrt -o a.png"));
        let expected = format!("a.png: the channels of film \"{film}\" need an .exr file");
        assert!(status == 2 && said.contains(&expected), "{status} {said}");
        // A picture of normals has no such channels.
        assert_eq!(run(&folder, &format!("render {name}.pbrt --integrator normals -o n.png")).0, 0);
    }
    let (status, said) = run(&folder, "render spectral.pbrt --integrator whitted -o a.exr");
    assert!(
        status != 0 && said.contains("film \"spectral\" works only with a spectral render"),
        "{status} {said}"
    );
    let (status, said) = run(&folder, "render surfaces.pbrt --integrator caustics -o a.exr");
    assert_eq!(status, 0, "{said}");
    assert_eq!(channels(&bytes(&folder, "a.exr")).len(), 25);
}

#[test]
fn the_memory_of_channels_is_counted_before_it_is_taken() {
    let folder = folder();
    let many = scene("\"spectral\" \"integer nbuckets\" 471")
        .replace("\" 21", "\" 2100")
        .replace("\" 15", "\" 1500");
    folder.write("many.pbrt", &many);
    let (status, said) = run(&folder, "render many.pbrt --max-memory 2GiB -o a.exr");
    assert!(status == 5 && said.contains("a picture of 2100 by 1500 pixels: needs "), "{status} {said}");
    assert!(said.contains("--max-memory"), "{said}");
}
