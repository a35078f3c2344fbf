//! A user's files: none that was read is written, and none that Lumbre did not write under a name that it chose.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use lumbre::image::{Image, Rgb};
use tempfile::TempDir;

/// A folder to work in.
pub(crate) struct Folder(TempDir);

impl Folder {
    pub(crate) fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub(crate) fn write(&self, name: &str, text: &str) {
        fs::write(self.path(name), text).unwrap();
    }

    pub(crate) fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_lumbre"));
        command.args(arguments).current_dir(self.0.path()).stdin(Stdio::null());
        command
    }

    pub(crate) fn lumbre(&self, arguments: &[&str]) -> (i32, String) {
        answer(self.command(arguments).output().unwrap())
    }

    /// The names of everything there, sorted.
    pub(crate) fn names(&self) -> Vec<String> {
        let names = fs::read_dir(self.0.path()).unwrap();
        let mut names: Vec<_> =
            names.map(|e| e.unwrap().file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }
}

/// The exit status, as shells say it, and what was said.
pub(crate) fn answer(output: Output) -> (i32, String) {
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    #[cfg(unix)]
    let signal = std::os::unix::process::ExitStatusExt::signal(&output.status);
    #[cfg(not(unix))]
    let signal: Option<i32> = None;
    // A signal that comes before it listens ends it as it ends any program.
    (output.status.code().or(signal.map(|signal| 128 + signal)).unwrap(), said)
}

/// A picture that another program made: without Lumbre's mark.
fn foreign_png(path: &Path) -> Vec<u8> {
    let picture = Image::filled(6, 5, Rgb::new(0.2, 0.5, 0.1));
    lumbre::write_image(path, &picture, &lumbre::SaveOptions::default()).unwrap();
    let mut bytes = fs::read(path).unwrap();
    // The chunk tEXt of length 15 is taken out, with its name and checksum.
    let at = bytes.windows(4).position(|kind| kind == b"tEXt").unwrap() - 4;
    bytes.drain(at..at + 12 + 15);
    fs::write(path, &bytes).unwrap();
    assert!(lumbre::read_image(path).is_ok());
    bytes
}

const SQUARE: &str = "mtllib chair.mtl\nv -2 -2 0\nv 2 -2 0\nv 2 2 0\nv -2 2 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
    usemtl m\nf 1/1 2/2 3/3 4/4\n";

/// Three corners with texture coordinates, and a picture of the same name.
const TRIANGLE: &str = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
    "meshes":[{"primitives":[{"attributes":{"POSITION":0,"TEXCOORD_0":1},"material":0}]}],
    "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]},
    {"bufferView":1,"componentType":5126,"count":3,"type":"VEC2"}],
    "bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteLength":24}],
    "buffers":[{"uri":"chair.bin","byteLength":36}],
    "materials":[{"pbrMetallicRoughness":{"baseColorTexture":{"index":0}}}],"textures":[{"source":0}],
    "images":[{"uri":"chair.png"}]}"#;

const TEXTURED: &str = r#"
Film "rgb" "integer xresolution" 12 "integer yresolution" 9 "string filename" "FILM"
Sampler "independent" "integer pixelsamples" 1
LookAt 0 -8 3  0 0 0  0 0 1
Camera "perspective" "float fov" 40
WorldBegin
LightSource "infinite" "rgb L" [0.6 0.7 0.8]
Texture "t" "spectrum" "imagemap" "string filename" "skin.png"
Material "diffuse" "texture reflectance" "t"
Include "body.pbrt"
"#;

/// Each kind of scene with the files that it reads.
fn models(folder: &Folder) -> [&'static str; 3] {
    foreign_png(&folder.path("chair.png"));
    folder.write("chair.obj", SQUARE);
    folder.write("chair.mtl", "newmtl m\nmap_Kd chair.png\n");
    let corners: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    fs::write(folder.path("chair.bin"), corners.map(f32::to_le_bytes).as_flattened()).unwrap();
    folder.write("chair.gltf", TRIANGLE);
    foreign_png(&folder.path("skin.png"));
    folder.write("chair.pbrt", &TEXTURED.replace("FILM", "skin.png"));
    folder.write(
        "body.pbrt",
        "Shape \"sphere\" \"float radius\" 1.75\nShape \"plymesh\" \"string filename\" \"m.ply\"\n",
    );
    folder.write(
        "m.ply",
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
         element face 1\nproperty list uchar int vertex_indices\nend_header\n2 0 0\n3 0 0\n2 1 0\n3 0 1 2\n",
    );
    ["chair.obj", "chair.gltf", "chair.pbrt"]
}

const SMALL: [&str; 4] = ["--size", "12x9", "--spp", "1"];

fn render(folder: &Folder, arguments: &[&str]) -> (i32, String) {
    folder.lumbre(&[&["render"], arguments, &SMALL].concat())
}

/// What must be as it was.
fn bytes(folder: &Folder, names: &[&str]) -> Vec<Vec<u8>> {
    names.iter().map(|name| fs::read(folder.path(name)).unwrap()).collect()
}

const READ: [&str; 9] = [
    "chair.png",
    "chair.obj",
    "chair.mtl",
    "chair.bin",
    "chair.gltf",
    "skin.png",
    "chair.pbrt",
    "body.pbrt",
    "m.ply",
];

#[test]
fn a_default_name_gives_way_to_a_texture_of_that_name() {
    let folder = Folder::new();
    let scenes = models(&folder);
    let before = bytes(&folder, &READ);
    for scene in scenes {
        let (code, said) = render(&folder, &[scene]);
        assert_eq!(code, 0, "{said}");
        assert!(
            said.contains("is an input") && said.contains("the picture is saved as chair.render.png"),
            "{said}"
        );
        assert_eq!(bytes(&folder, &READ), before, "{scene}");
        // A picture of Lumbre's own is replaced, which is said.
        let (code, said) = render(&folder, &[scene]);
        assert_eq!(code, 0, "{said}");
        assert!(said.contains("chair.render.png: replaced"), "{said}");
        let (code, said) = render(&folder, &[scene, "-q"]);
        assert_eq!((code, &*said), (0, ""));
        fs::remove_file(folder.path("chair.render.png")).unwrap();
    }
    assert_eq!(folder.names().len(), READ.len(), "{:?}", folder.names());
}

#[test]
fn no_file_that_a_scene_names_is_written_by_any_option() {
    let folder = Folder::new();
    models(&folder);
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("chair.png", folder.path("link.png")).unwrap();
        fs::hard_link(folder.path("skin.png"), folder.path("hard.png")).unwrap();
    }
    fs::create_dir(folder.path("sub")).unwrap();
    let before = bytes(&folder, &READ);
    let cases: &[&[&str]] = &[
        &["chair.obj", "-o", "chair.png"],
        &["chair.obj", "-o", "./sub/../chair.png"],
        &["chair.gltf", "-o", "chair.png"],
        &["chair.pbrt", "-o", "skin.png"],
        &["chair.obj", "-o", "x.png", "--stats", "chair.mtl"],
        &["chair.gltf", "-o", "x.png", "--stats", "chair.bin"],
        &["chair.pbrt", "-o", "x.png", "--stats", "body.pbrt"],
        &["chair.pbrt", "-o", "x.png", "--stats", "./m.ply"],
        &["chair.obj", "-o", "x.png", "--stats", "x.png"],
        &["chair.obj", "-o", "x.png", "--stats", "sub/../x.png"],
        #[cfg(unix)]
        &["chair.obj", "-o", "link.png"],
        #[cfg(unix)]
        &["chair.pbrt", "-o", "hard.png"],
    ];
    for arguments in cases {
        let (code, said) = render(&folder, arguments);
        assert_eq!(code, 2, "{arguments:?}: {said}");
        assert!(said.starts_with("error: ") && !said.contains("samples"), "{arguments:?}: {said}");
        assert_eq!(bytes(&folder, &READ), before, "{arguments:?}");
        assert!(!folder.path("x.png").exists(), "{arguments:?}");
    }
    folder.write("rays.csv", "ox,oy,oz,dx,dy,dz\n1,2,-5,0,0,2\n");
    fs::copy(folder.path("m.ply"), folder.path("m.csv")).unwrap();
    folder.write("cast.pbrt", "WorldBegin\nShape \"plymesh\" \"string filename\" \"m.csv\"\n");
    let (code, said) = folder.lumbre(&["cast", "cast.pbrt", "--rays", "rays.csv", "-o", "m.csv"]);
    assert_eq!(code, 2, "{said}");
    assert_eq!(fs::read(folder.path("m.csv")).unwrap(), fs::read(folder.path("m.ply")).unwrap());
    let (code, said) = folder.lumbre(&["diff", "skin.png", "skin.png", "-o", "skin.png"]);
    assert_eq!(code, 2, "{said}");
    assert_eq!(bytes(&folder, &READ), before);
}

#[test]
fn frames_spare_textures_with_similar_names() {
    let folder = Folder::new();
    models(&folder);
    let texture = foreign_png(&folder.path("f.3.png"));
    folder.write("chair.mtl", "newmtl m\nmap_Kd f.3.png\n");
    let (code, said) = render(&folder, &["chair.obj", "--turntable", "3", "-o", "f.#.png"]);
    assert_eq!(code, 2, "{said}");
    assert!(!folder.path("f.1.png").exists() && fs::read(folder.path("f.3.png")).unwrap() == texture);
    folder.write("turn.gltf", &TRIANGLE.replace("chair.png", "turn.turn.0002.png"));
    foreign_png(&folder.path("turn.turn.0002.png"));
    let (code, said) = render(&folder, &["turn.gltf", "--turntable", "2"]);
    assert_eq!(code, 0, "{said}");
    let (code, said) = render(&folder, &["turn.gltf", "--frames", "1..2"]);
    assert_eq!(code, 0, "{said}");
    // One run's pictures are not the other's.
    for name in ["turn.render.turn.0001.png", "turn.render.turn.0002.png", "turn.0001.png", "turn.0002.png"] {
        assert!(folder.path(name).exists(), "{name}: {:?}", folder.names());
    }
    assert!(!folder.path("turn.turn.0001.png").exists());
}

#[test]
fn a_default_name_replaces_no_file_that_lumbre_did_not_write() {
    let folder = Folder::new();
    models(&folder);
    folder.write("plain.obj", "v 0 0 0\nv 2 0 0\nv 0 3 0\nf 1 2 3\n");
    let own = foreign_png(&folder.path("plain.png"));
    let (code, said) = render(&folder, &["plain.obj"]);
    assert_eq!(code, 0, "{said}");
    assert!(said.contains("plain.png exists and was not written by Lumbre"), "{said}");
    assert!(fs::read(folder.path("plain.png")).unwrap() == own && folder.path("plain.render.png").exists());
    // Nor the other name; but what is asked for is done.
    let other = foreign_png(&folder.path("plain.render.png"));
    let (code, said) = render(&folder, &["plain.obj"]);
    assert_eq!(code, 2, "{said}");
    assert!(said.contains("-o"), "{said}");
    assert!(fs::read(folder.path("plain.render.png")).unwrap() == other);
    let (code, said) = render(&folder, &["plain.obj", "-o", "plain.png"]);
    assert_eq!(code, 0, "{said}");
    assert!(said.contains("plain.png: replaced"), "{said}");
    // Now it is Lumbre's.
    let (code, said) = render(&folder, &["plain.obj"]);
    assert_eq!((code, said.contains("plain.render.png")), (0, false), "{said}");
    // The same for each format that a film may name; a PFM cannot say who wrote it.
    for (film, first, second) in [
        ("a.exr", "a.exr", "a.exr"),
        ("a.hdr", "a.hdr", "a.hdr"),
        ("a.jpg", "a.jpg", "a.jpg"),
        ("a.pfm", "a.pfm", "chair.render.exr"),
    ] {
        folder.write("chair.pbrt", &TEXTURED.replace("FILM", film));
        for name in [first, second] {
            let (code, said) = render(&folder, &["chair.pbrt"]);
            assert_eq!(code, 0, "{said}");
            let is_named = said.lines().any(|line| line.starts_with(&format!("{name}: 12x9")));
            assert!(is_named, "{film}: {said}");
        }
    }
    folder.write("b.exr", "another program's");
    folder.write("chair.pbrt", &TEXTURED.replace("FILM", "b.exr"));
    assert_eq!(render(&folder, &["chair.pbrt"]).0, 0);
    assert_eq!(fs::read(folder.path("b.exr")).unwrap(), b"another program's");
}

/// Where processes can be asked for.
#[cfg(target_os = "linux")]
#[test]
fn temporary_files_of_dead_runs_are_removed_and_no_others() {
    let folder = Folder::new();
    models(&folder);
    let mut gone = Command::new("true").spawn().unwrap();
    gone.wait().unwrap();
    let (dead, alive) = (gone.id(), std::process::id());
    let removed = format!(".x.png.{dead}-0.lumbre.part");
    let kept = [
        format!(".x.png.{alive}-0.lumbre.part"),
        format!(".x.png.{dead}-0.part"),
        format!("x.png.{dead}-0.lumbre.part"),
        ".x.png.lumbre.part".to_owned(),
        format!(".y.png.{dead}-1.lumbre.part"),
    ];
    folder.write(&removed, "half of");
    kept.iter().for_each(|name| folder.write(name, "half of"));
    // As one in a container of its own holds it.
    let held = fs::File::open(folder.path(&kept[4])).unwrap();
    held.lock().unwrap();
    assert_eq!(render(&folder, &["chair.obj", "-o", "z.png"]).0, 0);
    assert!(!folder.path(&removed).exists());
    for name in kept {
        assert!(folder.path(&name).exists(), "{name}");
    }
}
