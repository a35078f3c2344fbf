//! Renders that carry wavelengths: how they are asked for, what is refused, and what does not mix.

use crate::files::{Folder, answer};

const SCENE: &str = r#"
Film "rgb" "integer xresolution" 21 "integer yresolution" 15 "string filename" "film.exr"
Sampler "zsobol" "integer pixelsamples" 4
LookAt 0 -6 2  0 0 0.5  0 0 1
Camera "perspective" "float fov" 40
WorldBegin
LightSource "infinite" "rgb L" [0.4 0.5 0.6]
Material "diffuse" "rgb reflectance" [0.8 0.3 0.1]
Shape "disk" "float radius" 4
Material "dielectric" "spectrum eta" "glass-F11"
Translate 0 0 1
Shape "sphere"
"#;

fn run(folder: &Folder, arguments: &str) -> (i32, String) {
    let arguments: Vec<&str> = arguments.split_whitespace().collect();
    answer(folder.command(&arguments).output().expect("the program starts"))
}

fn folder() -> Folder {
    let folder = Folder::new();
    folder.write("scene.pbrt", SCENE);
    let asking = SCENE.replacen("Camera", "Integrator \"path\" \"bool spectral\" true Camera", 1);
    folder.write("asking.pbrt", &asking);
    folder
}

fn bytes(folder: &Folder, name: &str) -> Vec<u8> {
    std::fs::read(folder.path(name)).expect("a picture")
}

#[test]
fn dispersive_glass_is_noted_and_disperses_wavelengths() {
    let folder = folder();
    let (status, said) = run(&folder, "render scene.pbrt -o rgb.pfm");
    assert!(status == 0 && said.contains("--spectral") && said.contains("587.6 nm"), "{said}");
    let (status, said) = run(&folder, "render scene.pbrt --spectral -o spectral.pfm");
    assert!(status == 0 && !said.contains("warning"), "{said}");
    assert_ne!(bytes(&folder, "rgb.pfm"), bytes(&folder, "spectral.pfm"));
    // A scene may ask for it, and threads do not show.
    let (status, said) = run(&folder, "render asking.pbrt --threads 2 -o asked.pfm");
    assert!(status == 0 && !said.contains("warning"), "{said}");
    assert_eq!(bytes(&folder, "asked.pfm"), bytes(&folder, "spectral.pfm"));
}

#[test]
fn what_follows_colours_refuses_wavelengths_or_says_so() {
    let folder = folder();
    for integrator in ["whitted", "caustics", "ambientocclusion", "normals"] {
        let (status, said) =
            run(&folder, &format!("render scene.pbrt --spectral --integrator {integrator} -o a.pfm"));
        assert!(status != 0 && said.contains("does not carry wavelengths"), "{integrator}: {status} {said}");
        // Where the scene asks, another integrator is asked for instead.
        let (status, said) = run(&folder, &format!("render asking.pbrt --integrator {integrator} -o b.pfm"));
        assert_eq!(status, 0, "{integrator}: {said}");
    }
    let (status, said) = run(&folder, "explain asking.pbrt --pixel 10,12");
    assert!(status == 0 && said.contains("a path of red, green and blue"), "{said}");
}

#[test]
fn parts_of_colours_and_of_wavelengths_do_not_mix() {
    let folder = folder();
    assert_eq!(run(&folder, "render scene.pbrt --samples 0..2 -o rgb.part").0, 0);
    assert_eq!(run(&folder, "render scene.pbrt --spectral --samples 2..4 -o other.part").0, 0);
    let (status, said) = run(&folder, "merge rgb.part other.part -o all.exr");
    assert!(status != 0 && said.contains("spectral"), "{status} {said}");
    // Those of wavelengths come to the whole.
    assert_eq!(run(&folder, "render scene.pbrt --spectral --samples 0..2 -o one.part").0, 0);
    assert_eq!(run(&folder, "merge one.part other.part -o merged.exr").0, 0);
    assert_eq!(run(&folder, "render scene.pbrt --spectral --spp 4 -o whole.exr").0, 0);
    let picture = |name: &str| lumbre::read_image(&folder.path(name)).expect("a picture");
    assert_eq!(picture("merged.exr"), picture("whole.exr"));
}
