//! Opening any scene, by its file extension or its bytes.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use lumbre_scene::SceneDesc;

use crate::diagnostic::quoted;
use crate::gltf::{GltfOptions, read_gltf};
use crate::obj::obj_scene;
use crate::ply::ply_scene;
use crate::stl::stl_scene;
use crate::{
    Budget, Diagnostic, Diagnostics, FormatError, HeldFiles, Input, Limits, Place, Strictness, open_regular,
    pbrt,
};

/// Options of reading a scene.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct ReadOptions {
    /// How to treat invalid input.
    pub strictness: Strictness,
    /// The resource limits.
    pub limits: Limits,
    /// The format of input without a known extension, such as standard input; `None` to recognise it by its bytes.
    pub format: Option<SceneFormat>,
    /// The time in seconds at which animations are evaluated; `None` ignores them.
    pub frame: Option<f64>,
    /// The exposure in seconds, centred on `frame`: see [`GltfOptions::shutter`].
    pub shutter: f64,
    /// The animation of a glTF to play: see [`GltfOptions::animation`].
    pub animation: Option<String>,
    /// The material variant of a glTF.
    pub variant: Option<String>,
    /// Options of a POV-Ray scene.
    pub pov: crate::pov::PovOptions,
    /// Whether the scene may read only the named files: for a scene from a stranger.
    pub only_named_files: bool,
    /// Another folder whose files the scene may use; it must hold no links.
    pub folder: Option<PathBuf>,
    /// The files in place of the system's; `None` for those of the system.
    pub held: Option<Arc<HeldFiles>>,
}

/// The supported scene formats.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SceneFormat {
    /// The scene language of pbrt-v4.
    Pbrt,
    /// Wavefront OBJ.
    Obj,
    /// PLY.
    Ply,
    /// STL, text or binary.
    Stl,
    /// glTF, as JSON or as GLB.
    Gltf,
    /// The scene language of POV-Ray.
    Pov,
}

/// The extensions of [`open_scene`].
const ENDINGS: &str = ".pbrt, .pbrt.gz, .pov, .gltf, .glb, .obj, .ply, .ply.gz, .stl, .stl.gz";

impl SceneFormat {
    /// The names for options, which are extensions without their dot.
    pub const NAMES: [&'static str; 7] = ["pbrt", "pov", "gltf", "glb", "obj", "ply", "stl"];

    /// The format of a name among [`SceneFormat::NAMES`].
    pub fn from_name(name: &str) -> Option<Self> {
        match name {
            "pbrt" => Some(Self::Pbrt),
            "pov" => Some(Self::Pov),
            "obj" => Some(Self::Obj),
            "ply" => Some(Self::Ply),
            "stl" => Some(Self::Stl),
            "gltf" | "glb" => Some(Self::Gltf),
            _ => None,
        }
    }

    /// The format of the file `path` by its extension in any case; one of `.gz` is skipped.
    pub fn from_path(path: &Path) -> Option<Self> {
        let is_packed = path.extension()?.eq_ignore_ascii_case("gz");
        let path = if is_packed { Path::new(path.file_stem()?) } else { path };
        Self::from_name(&path.extension()?.to_str()?.to_ascii_lowercase())
    }

    /// The format of a file by its bytes, unpacked: by its signature, or else by its first word.
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        if bytes.starts_with(b"glTF") {
            return Some(Self::Gltf);
        }
        // Binary STL has no signature, but its count of facets gives its size; its title may say anything.
        let count = bytes.get(80..84).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
        if count.is_some_and(|n| 84 + 50 * u64::from(n) == bytes.len() as u64) {
            return Some(Self::Stl);
        }
        let mut rest = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes).trim_ascii_start();
        while rest.starts_with(b"#") {
            let end = rest.iter().position(|b| matches!(b, b'\n' | b'\r')).unwrap_or(rest.len());
            rest = rest[end..].trim_ascii_start();
        }
        let end = rest.iter().position(|b| b.is_ascii_whitespace() || *b == b'"').unwrap_or(rest.len());
        match &rest[..end] {
            b"ply" => Some(Self::Ply),
            word if word.eq_ignore_ascii_case(b"solid") => Some(Self::Stl),
            word if word.starts_with(b"{") => Some(Self::Gltf),
            b"v" | b"vn" | b"vt" | b"vp" | b"f" | b"l" | b"p" | b"o" | b"g" | b"s" | b"mtllib"
            | b"usemtl" => Some(Self::Obj),
            word if std::str::from_utf8(word).is_ok_and(pbrt::is_directive) => Some(Self::Pbrt),
            _ => None,
        }
    }
}

/// Whether these bytes, which are of no known format yet, are comments and spaces before the first word of a text.
fn may_begin_a_text(bytes: &[u8]) -> bool {
    let mut lines = bytes.split(|&b| matches!(b, b'\n' | b'\r')).map(<[u8]>::trim_ascii_start);
    !bytes.contains(&0) && lines.all(|line| line.is_empty() || line.starts_with(b"#"))
}

/// Whether a binary STL of at most this many bytes may begin with these.
fn may_begin_an_stl(bytes: &[u8], most: u64) -> bool {
    let count = bytes.get(80..84).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    count.is_none_or(|n| (bytes.len() as u64..=most).contains(&(84 + 50 * u64::from(n))))
}

/// Reads the scene or the mesh in the file `path`: `.pbrt`, `.ply` and `.stl`, each also with `.gz`, `.gltf`,
/// `.glb` and `.obj`. A file with another extension is recognised by its bytes, and so is standard input, `-`.
///
/// Returns the description and the diagnostics: the warnings, their counts, and the files that were read.
///
/// # Errors
/// [`FormatError`], with the place in the file.
pub fn open_scene(path: &Path, options: &ReadOptions) -> Result<(SceneDesc, Diagnostics), FormatError> {
    open_scenes(&[path], options)
}

/// Reads several scene files as one scene: those in the pbrt language one after another as if they were one, each
/// independently of the others; [`SceneDesc::append`] says how they are joined.
///
/// # Errors
/// As for [`open_scene`], and when there is no file at all.
pub fn open_scenes(
    paths: &[impl AsRef<Path>],
    options: &ReadOptions,
) -> Result<(SceneDesc, Diagnostics), FormatError> {
    let mut budget = Budget::new(options.limits).of_held(options.held.clone());
    if options.only_named_files {
        budget = budget.only(paths.iter().map(|path| path.as_ref().to_owned()));
        if let Some(folder) = &options.folder {
            budget = budget.and_in(folder.clone());
        }
    }
    let mut diagnostics = Diagnostics::with_strictness(options.strictness);
    let mut groups: Vec<Vec<Source>> = Vec::with_capacity(paths.len());
    for path in paths {
        let source = Source::new(path.as_ref(), options, &budget)?;
        let is_pbrt = |source: &Source| source.format == SceneFormat::Pbrt;
        match groups.iter_mut().find(|group| is_pbrt(&group[0])) {
            Some(group) if is_pbrt(&source) => group.push(source),
            _ => groups.push(vec![source]),
        }
    }
    let mut scene: Option<SceneDesc> = None;
    for group in groups {
        let more = read_group(group, options, &budget, &mut diagnostics)?;
        match &mut scene {
            None => scene = Some(more),
            Some(scene) => scene.append(more),
        }
    }
    let Some(scene) = scene else { return Err(Diagnostic::error("no scene is given").into()) };
    diagnostics.check()?;
    diagnostics.set_read(&budget);
    Ok((scene, diagnostics))
}

/// Whether there is a file of this name that can be read as a scene, judged by its name, or else by its bytes; it is
/// not parsed.
///
/// # Errors
/// As for [`open_scene`].
pub fn check_scene_file(path: &Path, options: &ReadOptions) -> Result<(), FormatError> {
    let budget = Budget::new(options.limits);
    if Source::new(path, options, &budget)?.input.is_none() {
        open_regular(path)?;
    }
    Ok(())
}

/// A file to read, or the bytes that were read to recognise its format.
struct Source<'p, 'b> {
    path: &'p Path,
    format: SceneFormat,
    input: Option<Input<'b>>,
}

impl<'p, 'b> Source<'p, 'b> {
    fn new(path: &'p Path, options: &ReadOptions, budget: &'b Budget) -> Result<Self, FormatError> {
        let is_standard_input = path.as_os_str() == "-";
        let by_name = SceneFormat::from_path(path).filter(|_| !is_standard_input);
        if let Some(format) = by_name {
            return Ok(Self { path, format, input: None });
        }
        if !is_standard_input && budget.is_folder(path) {
            return Err(folder(path));
        }
        let is_elsewhere = OTHERS.iter().any(|(endings, _)| has_ending(path, endings));
        // Whether or not there is such a file, its name does not say what it is.
        if !is_standard_input && options.format.is_none() && (!budget.is_file(path) || is_elsewhere) {
            // A name that says enough, and there is no such file: that is said first.
            if is_elsewhere && !budget.exists(path) {
                Input::open(path, budget)?;
            }
            return Err(unknown(path, path.display().to_string().into()));
        }
        let input = if is_standard_input {
            Input::from_stream("standard input", std::io::stdin().lock(), budget, |first| {
                match options.format.or_else(|| SceneFormat::from_bytes(first)) {
                    Some(SceneFormat::Pbrt | SceneFormat::Obj | SceneFormat::Pov) => Ok(true),
                    // Both have a binary form.
                    Some(SceneFormat::Ply | SceneFormat::Stl) => Ok(false),
                    Some(SceneFormat::Gltf) => Ok(!first.starts_with(b"glTF")),
                    None if may_begin_a_text(first) => Ok(true),
                    None if may_begin_an_stl(first, options.limits.memory) => Ok(false),
                    None => Err(unknown(path, "standard input".into())),
                }
            })?
        } else {
            Input::open(path, budget)?
        };
        match options.format.or_else(|| SceneFormat::from_bytes(&input)) {
            Some(format) => Ok(Self { path, format, input: Some(input) }),
            None => Err(unknown(path, input.name().clone())),
        }
    }

    fn folder(&self) -> &'p Path {
        self.path.parent().unwrap_or(Path::new(""))
    }

    fn open(self, budget: &'b Budget) -> Result<Input<'b>, FormatError> {
        self.input.map_or_else(|| Input::open(self.path, budget), Ok)
    }
}

/// Formats of other programs that are not read, by their endings, and what makes a file of them that is.
const OTHERS: [(&[&str], &str); 4] = [
    (&["fbx", "dae", "blend", "3ds", "abc", "usd", "usda", "usdc", "usdz"], "a .glb, as Blender exports it"),
    (&["step", "stp", "iges", "igs", "3dm", "f3d"], "an .stl, as FreeCAD exports it"),
    (&["3mf", "off", "amf", "x3d", "wrl"], "a .ply or an .stl, as MeshLab exports it"),
    (&["xml", "mtlx"], "a .pbrt"),
];

fn has_ending(path: &Path, endings: &[&str]) -> bool {
    path.extension().is_some_and(|ending| endings.iter().any(|known| ending.eq_ignore_ascii_case(known)))
}

/// A folder is no scene; one that is in it is named.
fn folder(path: &Path) -> FormatError {
    let files = std::fs::read_dir(path).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut scenes: Vec<_> = files.filter(|file| SceneFormat::from_path(file).is_some()).collect();
    scenes.sort();
    let wrong = Diagnostic::error("this is a folder").at(Place::whole(path.display().to_string()));
    let expected = match scenes.first() {
        Some(scene) => format!("a file, such as {}", scene.display()),
        None => "a file".to_owned(),
    };
    wrong.expected(expected).into()
}

fn unknown(path: &Path, name: Arc<str>) -> FormatError {
    if let Some((_, made)) = OTHERS.iter().find(|(endings, _)| has_ending(path, endings)) {
        let wrong = Diagnostic::error("files of this kind are not read").at(Place::whole(name));
        return wrong.expected(format!("{made}; {ENDINGS} are read")).into();
    }
    let found = match path.extension() {
        _ if path.as_os_str() == "-" => "bytes of no known format".to_owned(),
        Some(ending) => quoted(&ending.to_string_lossy()),
        None => "no ending".to_owned(),
    };
    let wrong = Diagnostic::error("unknown kind of scene file").at(Place::whole(name)).found(found);
    wrong.expected(format!("{ENDINGS}, or --input-format")).into()
}

/// Reads files in the pbrt language, or one file of another format.
fn read_group<'b>(
    mut group: Vec<Source<'_, 'b>>,
    options: &ReadOptions,
    budget: &'b Budget,
    diagnostics: &mut Diagnostics,
) -> Result<SceneDesc, FormatError> {
    let (format, folder) = (group[0].format, group[0].folder());
    if format == SceneFormat::Pbrt {
        let sources = group.into_iter().map(|Source { path, input, .. }| (path, input));
        return pbrt::read_sources(sources, folder, budget, diagnostics);
    }
    let input = group.remove(0).open(budget)?;
    match format {
        SceneFormat::Ply => ply_scene(input, folder, budget, diagnostics),
        SceneFormat::Obj => obj_scene(input, folder, budget, diagnostics),
        SceneFormat::Stl => stl_scene(input, budget, diagnostics),
        SceneFormat::Pov => {
            let mut pov = options.pov.clone();
            pov.library.extend(crate::pov::SYSTEM_LIBRARY.iter().map(PathBuf::from));
            crate::pov::pov_scene(&input, folder, &pov, budget, diagnostics)
        }
        SceneFormat::Gltf | SceneFormat::Pbrt => {
            let gltf = GltfOptions {
                frame: options.frame,
                shutter: options.shutter,
                animation: options.animation.clone(),
                variant: options.variant.clone(),
            };
            read_gltf(&input, input.name(), folder, &gltf, budget, diagnostics)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_format_is_told_by_its_extension_or_else_by_its_bytes() {
        for (name, expected) in [
            ("a.pbrt", Some(SceneFormat::Pbrt)),
            ("a.b.PBRT.gz", Some(SceneFormat::Pbrt)),
            ("x/a.GLB", Some(SceneFormat::Gltf)),
            ("a.stl.GZ", Some(SceneFormat::Stl)),
            ("a.png", None),
            ("obj", None),
            ("a.gz", None),
            ("-", None),
        ] {
            assert_eq!(SceneFormat::from_path(Path::new(name)), expected, "{name}");
        }
        let mut binary = b"solid but binary".to_vec();
        binary.resize(84 + 2 * 50, 0);
        binary[80] = 2;
        for (bytes, expected) in [
            (&b"glTF\x02\0\0\0"[..], Some(SceneFormat::Gltf)),
            (b"\xEF\xBB\xBF {\"asset\":{}}", Some(SceneFormat::Gltf)),
            (b"ply\r\nformat ascii 1.0", Some(SceneFormat::Ply)),
            (b"solid\nfacet", Some(SceneFormat::Stl)),
            (&binary, Some(SceneFormat::Stl)),
            (b"# Blender\n\nmtllib a.mtl", Some(SceneFormat::Obj)),
            (b"v 1 2 3", Some(SceneFormat::Obj)),
            (b"# a scene\nLookAt 0 0 0", Some(SceneFormat::Pbrt)),
            (b"Film\"rgb\"", Some(SceneFormat::Pbrt)),
            (b"\x89PNG\r\n", None),
            (b"hello", None),
            (b"#", None),
            (b"", None),
        ] {
            assert_eq!(SceneFormat::from_bytes(bytes), expected, "{}", String::from_utf8_lossy(bytes));
        }
        // Of a stream, as far as it is there.
        let comments = "# nothing yet\n".repeat(5000);
        let title = [&[b'x'; 80][..], &2000_u32.to_le_bytes(), &[0; 900]].concat();
        let (zeros, letters) = ([0; 64 << 10], [b'x'; 64 << 10]);
        for (first, is_text, is_stl) in [
            (comments.as_bytes(), true, false),
            (b" \r\n", true, true),
            (&title, false, true),
            (b"hello", false, true),
            (&zeros, false, false),
            (&letters, false, false),
        ] {
            assert_eq!(SceneFormat::from_bytes(first), None);
            assert_eq!((may_begin_a_text(first), may_begin_an_stl(first, 1 << 30)), (is_text, is_stl));
        }
        for name in SceneFormat::NAMES {
            assert_eq!(SceneFormat::from_name(name), SceneFormat::from_path(Path::new(&format!("a.{name}"))));
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_name_that_is_not_utf8_is_told_by_its_ending_or_its_bytes() {
        use std::os::unix::ffi::OsStrExt;
        let name = |bytes: &'static [u8]| PathBuf::from(std::ffi::OsStr::from_bytes(bytes));
        assert_eq!(SceneFormat::from_path(&name(b"caf\xE9.obj")), Some(SceneFormat::Obj));
        assert_eq!(SceneFormat::from_path(&name(b"caf\xE9.ply.gz")), Some(SceneFormat::Ply));
        let folder = tempfile::tempdir().unwrap();
        for (bytes, text) in [
            (&b"caf\xE9.obj"[..], "v 1 2 3\nv 4 2 3\nv 1 7 3\nf 1 2 3\n"),
            (b"caf\xE9", "v 1 2 3\nv 4 2 3\nv 1 7 3\nf 1 2 3\n"),
        ] {
            let path = folder.path().join(name(bytes));
            std::fs::write(&path, text).unwrap();
            assert_eq!(open_scene(&path, &ReadOptions::default()).unwrap().0.shapes.len(), 1);
        }
    }

    #[test]
    fn files_of_several_kinds_are_one_scene_in_their_order() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| {
            std::fs::write(folder.path().join(name), text).unwrap();
            folder.path().join(name)
        };
        let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
            element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n2 0 0\n0 3 0\n3 0 1 2\n";
        let paths = [
            write(
                "a.pbrt",
                "LookAt 9 0 0  0 0 0  0 0 1 Camera \"perspective\" WorldBegin Shape \"sphere\"\n",
            ),
            write("b.ply", ply),
            write("c.pbrt", "Shape \"cylinder\"\nShape \"disk\"\n"),
        ];
        let (scene, _) = open_scenes(&paths, &ReadOptions::default()).unwrap();
        assert_eq!(scene.shapes.iter().map(|shape| shape.index).collect::<Vec<_>>(), [0, 1, 2, 3]);
        assert!(matches!(scene.shapes[3].geometry, lumbre_scene::GeometryDesc::Mesh(_)));
        assert_eq!(scene.cameras.len(), 1);
        let (scene, _) = open_scenes(&[&paths[1], &paths[1], &paths[0]], &ReadOptions::default()).unwrap();
        assert_eq!(scene.shapes.len(), 3);
        assert!(matches!(scene.shapes[2].geometry, lumbre_scene::GeometryDesc::Exact(_)));
        assert!(open_scenes(&[] as &[&Path], &ReadOptions::default()).is_err());
    }
}
