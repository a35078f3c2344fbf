//! What systems do differently, and what a scene from another one looks like.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::fs;

use crate::files::Folder;

/// A textured sphere and a mesh, each in a folder of its own.
const SCENE: &str = r#"# A scene of several files
Film "rgb" "integer xresolution" 12 "integer yresolution" 9 "string filename" "a.png"
Sampler "independent" "integer pixelsamples" 2
LookAt 0 -8 3  0 0 0  0 0 1
Camera "perspective" "float fov" 40
WorldBegin
LightSource "infinite" "rgb L" [0.6 0.7 0.8]
Texture "t" "spectrum" "imagemap" "string filename" "IMAGE"
Material "diffuse" "texture reflectance" "t" # a comment
Shape "sphere" "float radius" 1.75
Shape "plymesh" "string filename" "MESH"
"#;

const MESH: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
    element face 1\nproperty list uchar int vertex_indices\nend_header\n2 0 0\n3 0 0\n2 1 0\n3 0 1 2\n";

/// Writes the files of [`SCENE`], with names of these folders in it.
fn write(folder: &Folder, scene: &str, images: &str, meshes: &str) {
    for name in [images, meshes] {
        fs::create_dir_all(folder.path(name)).unwrap();
    }
    let picture = lumbre::image::Image::filled(3, 2, lumbre::image::Rgb::new(0.2, 0.5, 0.1));
    lumbre::write_image(&folder.path(images).join("skin.png"), &picture, &lumbre::SaveOptions::default())
        .unwrap();
    fs::write(folder.path(meshes).join("m.ply"), MESH).unwrap();
    folder.write(scene, &scene_of(images, meshes, '/'));
}

fn scene_of(images: &str, meshes: &str, separator: char) -> String {
    let escaped = if separator == '\\' { "\\\\".to_owned() } else { separator.to_string() };
    let scene =
        SCENE.replace("IMAGE", &format!("{images}/skin.png")).replace("MESH", &format!("{meshes}/m.ply"));
    scene.replace("/skin", &format!("{escaped}skin")).replace("/m.ply", &format!("{escaped}m.ply"))
}

/// The bytes of the picture of a scene, in a format without a note of the scene's name.
fn picture(folder: &Folder, scene: &str, name: &str) -> Vec<u8> {
    let (code, said) = folder.lumbre(&["render", scene, "-o", name, "-q", "--strict"]);
    assert_eq!((code, &*said), (0, ""), "{scene}");
    fs::read(folder.path(name)).unwrap()
}

#[test]
fn lines_that_end_as_on_windows_make_the_same_picture() {
    let folder = Folder::new();
    write(&folder, "a.pbrt", "images", "meshes");
    let expected = picture(&folder, "a.pbrt", "a.pfm");
    folder.write("b.pbrt", &scene_of("images", "meshes", '/').replace('\n', "\r\n"));
    fs::write(folder.path("meshes/m.ply"), MESH.replace('\n', "\r\n")).unwrap();
    assert!(picture(&folder, "b.pbrt", "b.pfm") == expected);
    folder.write("rays.csv", "ox,oy,oz,dx,dy,dz\r\n0,-8,0.25,0,1,0\r\n0,-8,0,0,0,1\r\n");
    let output =
        folder.command(&["cast", "b.pbrt", "--rays", "rays.csv", "--query", "any"]).output().unwrap();
    assert_eq!(String::from_utf8(output.stdout).unwrap(), "ray,hit\n0,1\n1,0\n");
    let model = "mtllib m.mtl\nv -2 -2 0\nv 2 -2 0\nv 2 2 0\nusemtl red\nf 1 2 3\n";
    folder.write("m.mtl", "newmtl red\nKd 0.8 0.1 0.1\n");
    folder.write("m.obj", model);
    let expected = picture(&folder, "m.obj", "m.pfm");
    folder.write("m.mtl", "newmtl red\r\nKd 0.8 0.1 0.1\r\n");
    folder.write("m.obj", &model.replace('\n', "\r\n"));
    assert!(picture(&folder, "m.obj", "n.pfm") == expected);
}

#[test]
fn names_have_spaces_and_any_script() {
    let folder = Folder::new();
    write(&folder, "plain.pbrt", "images", "meshes");
    let expected = picture(&folder, "plain.pbrt", "plain.pfm");
    write(&folder, "Ñandú 雪 сцена.pbrt", "mis imágenes", "сетка 🙂");
    assert!(picture(&folder, "Ñandú 雪 сцена.pbrt", "una imagen – 雪.pfm") == expected);
    let (code, said) = folder.lumbre(&["render", "Ñandú 雪 сцена.pbrt", "--spp", "1"]);
    assert_eq!((code, folder.path("a.png").exists()), (0, true), "{said}");
    // A name that is not there is said as it is.
    let (code, said) = folder.lumbre(&["info", "雪 fehlt.obj"]);
    assert_eq!((code, said.starts_with("error: 雪 fehlt.obj: cannot open")), (4, true), "{said}");
}

#[cfg(windows)]
mod windows {
    use std::os::windows::fs::OpenOptionsExt;
    use std::path::PathBuf;
    use std::process::Stdio;
    use std::time::{Duration, Instant};

    use super::*;

    #[test]
    fn paths_have_drives_and_either_separator() {
        let folder = Folder::new();
        write(&folder, "a.pbrt", "images", "meshes");
        let expected = picture(&folder, "a.pbrt", "a.png");
        folder.write("b.pbrt", &scene_of("images", "meshes", '\\'));
        assert!(picture(&folder, ".\\b.pbrt", "images\\b.png") == expected);
        // With its drive: the file, what it names, and the picture.
        let whole = |name: &str| folder.path(name).canonicalize().unwrap().to_string_lossy().into_owned();
        let plain = |name: &str| whole(name).trim_start_matches(r"\\?\").to_owned();
        assert_eq!(&plain("images")[1..3], ":\\", "{}", plain("images"));
        let scene = SCENE.replace("IMAGE", &(plain("images").replace('\\', "/") + "/skin.png"));
        folder.write("c.pbrt", &scene.replace("MESH", &(plain("meshes") + "\\m.ply").replace('\\', "\\\\")));
        let output = plain("images") + "\\c.png";
        assert!(picture(&folder, &plain("c.pbrt"), &output) == expected);
        // With the prefix that lifts limits.
        assert!(picture(&folder, &whole("a.pbrt"), &(whole("images") + "\\d.png")) == expected);
    }

    #[test]
    fn paths_may_be_long() {
        let folder = Folder::new();
        let deep = ["a folder whose name is long, as names of exported projects are"; 6].join("\\");
        assert!(folder.path(&deep).as_os_str().len() > 300);
        write(&folder, "a.pbrt", "images", &deep);
        let expected = picture(&folder, "a.pbrt", "a.png");
        let scene = format!("{deep}\\scene.pbrt");
        let up = "../".repeat(6) + "images";
        fs::write(folder.path(&scene), scene_of(&up, ".", '/')).unwrap();
        let output = format!("{deep}\\picture.png");
        assert!(picture(&folder, &scene, &output) == expected);
        let whole = folder.path(&scene).to_string_lossy().into_owned();
        let (code, said) = folder.lumbre(&["info", &whole]);
        assert_eq!(code, 0, "{said}");
    }

    #[test]
    fn devices_are_no_files() {
        let folder = Folder::new();
        write(&folder, "a.pbrt", "images", "meshes");
        for arguments in [
            &["render", "a.pbrt", "-o", "con.png"][..],
            &["render", "a.pbrt", "-o", "nul.png"],
            &["render", "a.pbrt", "-o", "images\\Com1.exr"],
            &["render", "a.pbrt", "-o", "a.exr", "--checkpoint", "aux"],
            &["cast", "a.pbrt", "--rays", "nul.csv"],
            &["info", "con"],
            &["info", "nul"],
            &["info", "lpt1.obj"],
            &["info", r"\\.\pipe\lumbre.obj"],
            &["diff", "prn.png", "con.png"],
        ] {
            let (code, said) = folder.lumbre(arguments);
            assert_eq!(code, 4, "{arguments:?}: {said}");
            assert!(said.contains("device") || said.contains("not a regular file"), "{arguments:?}: {said}");
        }
        let (code, said) = folder.lumbre(&["render", "a.pbrt", "-o", "a.png", "--stats", "NUL", "-q"]);
        assert_eq!((code, &*said), (0, ""));
        assert_eq!(folder.names(), ["a.pbrt", "a.png", "images", "meshes"]);
    }

    /// From Windows 10 on; Wine cannot.
    #[test]
    fn an_open_picture_is_replaced_if_its_reader_allows() {
        let folder = Folder::new();
        write(&folder, "a.pbrt", "images", "meshes");
        let expected = picture(&folder, "a.pbrt", "a.png");
        fs::write(folder.path("b.pfm"), "the old picture").unwrap();
        let held = fs::File::open(folder.path("b.pfm")).unwrap();
        fs::write(folder.path("c.png"), "another").unwrap();
        if fs::rename(folder.path("c.png"), folder.path("b.pfm")).is_err() {
            return eprintln!("left out: this system replaces no open file");
        }
        assert!(picture_over(&folder) == expected);
        assert_eq!(std::io::read_to_string(&held).unwrap(), "the old picture");
    }

    /// Renders over `b.png`.
    fn picture_over(folder: &Folder) -> Vec<u8> {
        let (code, said) = folder.lumbre(&["render", "a.pbrt", "-o", "b.png"]);
        assert_eq!(code, 0, "{said}");
        fs::read(folder.path("b.pfm")).unwrap()
    }

    #[test]
    fn a_picture_that_a_program_holds_is_waited_for_and_then_kept() {
        const FILE_SHARE_READ: u32 = 1;
        let folder = Folder::new();
        write(&folder, "a.pbrt", "images", "meshes");
        let expected = picture(&folder, "a.pbrt", "a.png");
        fs::write(folder.path("b.pfm"), "the old picture").unwrap();
        let hold =
            || fs::File::options().read(true).share_mode(FILE_SHARE_READ).open(folder.path("b.pfm")).unwrap();
        let held = hold();
        let (code, said) = folder.lumbre(&["render", "a.pbrt", "-o", "b.png"]);
        assert_eq!((code, said.contains("Another program has it open")), (4, true), "{said}");
        // What was rendered is not lost.
        assert!(folder.names().iter().any(|name| name.starts_with("b.png.rescued.")), "{said}");
        assert!(!folder.names().iter().any(|name| name.ends_with(".lumbre.part")), "{:?}", folder.names());
        drop(held);
        assert_eq!(fs::read(folder.path("b.pfm")).unwrap(), b"the old picture");
        // A scanner is done in a moment.
        let held = hold();
        let child = folder.command(&["render", "a.pbrt", "-o", "b.png", "-q"]).spawn().unwrap();
        std::thread::sleep(Duration::from_millis(300));
        drop(held);
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(0));
        assert!(fs::read(folder.path("b.pfm")).unwrap() == expected);
    }

    #[test]
    fn an_input_is_one_by_any_case_and_any_link() {
        let folder = Folder::new();
        write(&folder, "a.pbrt", "images", "meshes");
        fs::hard_link(folder.path("images\\skin.png"), folder.path("hard.png")).unwrap();
        let before = fs::read(folder.path("images\\skin.png")).unwrap();
        for output in ["images\\skin.png", "IMAGES/Skin.PNG", "hard.png", ".\\images\\..\\hard.png"] {
            let (code, said) = folder.lumbre(&["render", "a.pbrt", "-o", output]);
            assert_eq!((code, said.contains("it is an input")), (2, true), "{output}: {said}");
        }
        assert_eq!(fs::read(folder.path("images\\skin.png")).unwrap(), before);
        // Nor are two outputs one file by their case.
        let (code, said) = folder.lumbre(&["render", "a.pbrt", "-o", "x.png", "--stats", "X.PNG"]);
        assert_eq!((code, said.contains("both the picture and its statistics")), (2, true), "{said}");
    }

    #[test]
    fn one_run_holds_a_checkpoint_and_its_lock_goes_with_it() {
        let folder = Folder::new();
        write(&folder, "a.pbrt", "images", "meshes");
        let long = ["render", "a.pbrt", "-o", "a.exr", "--checkpoint", "ck", "--checkpoint-every", "1ms"];
        let mut first = folder.command(&[&long[..], &["--spp", "100000000"]].concat());
        let mut first = first.stderr(Stdio::null()).spawn().unwrap();
        until_there(folder.path("ck"));
        for name in ["ck", ".\\CK"] {
            let again = ["render", "a.pbrt", "-o", "b.exr", "--checkpoint", name, "--resume"];
            let (code, said) = folder.lumbre(&again);
            assert_eq!((code, said.contains("another run writes this checkpoint")), (2, true), "{said}");
        }
        first.kill().unwrap();
        first.wait().unwrap();
        assert!(!folder.path("ck.lock").exists(), "{:?}", folder.names());
        let (code, said) = folder.lumbre(&[&long[..], &["--spp", "2", "--resume"]].concat());
        assert_eq!(code, 0, "{said}");
    }

    /// Waits for a file, far longer than it should take.
    fn until_there(path: PathBuf) {
        let start = Instant::now();
        while !path.exists() {
            assert!(start.elapsed() < Duration::from_secs(120), "{} does not come", path.display());
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}
