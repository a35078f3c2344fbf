//! POV-Ray's scenes against the pictures that POV-Ray renders of them, where their folder is present.
//!
//! A pixel differs by its largest channel. At most a share of the pixels may differ by more than 0.004, and the others
//! on average by next to nothing: `cases/pov/EXPECTED.md` says how much.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::path::{Path, PathBuf};

use lumbre::Scene;
use lumbre::formats::image::open_image;
use lumbre::formats::pov::{PovOptions, SYSTEM_LIBRARY, written_files};
use lumbre::formats::{Budget, Diagnostics, ReadOptions, open_scene};

/// Scenes that are not as expected yet. One that is has to be taken off.
const NOT_YET: &[&str] = &["pat-blocks"];

const SIZE: [u32; 2] = [48, 36];
/// Pixels that differ by more than this count by their share.
const DIFFERENT: f32 = 0.004;

fn folder() -> Option<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let folders = ["../shared", "../../shared"].map(|shared| root.join(shared).join("cases/pov"));
    folders.into_iter().find(|folder| folder.join("EXPECTED.md").exists())
}

/// The share of pixels that may differ, and how much the others may on average.
fn allowed(name: &str) -> (f64, f64) {
    let share = match name {
        "fin-reflection" => 0.01,
        "obj-isosurface" | "obj-sweep-blob" | "int-refraction" | "pat-fractal" | "pat-function-slope"
        | "pat-geometric" => 0.02,
        "obj-text" => 0.03,
        _ if name.starts_with("obj-") || name.starts_with("csg-") || name == "uv-mapping" => 0.01,
        _ => 0.005,
    };
    let is_solid = ["obj-", "csg-", "pat-"].iter().any(|start| name.starts_with(start));
    let rest = if is_solid || matches!(name, "uv-mapping" | "int-refraction") { 0.0005 } else { 0.0003 };
    (share, rest)
}

/// What is not as expected of a scene.
fn faults(path: &Path, name: &str) -> Vec<String> {
    let (desc, diagnostics) = match open_scene(path, &ReadOptions::default()) {
        Ok(read) => read,
        Err(error) => return vec![error.to_string()],
    };
    let mut faults: Vec<String> =
        diagnostics.lines().into_iter().filter(|line| line.starts_with("warning")).collect();
    let scene = match Scene::from_description(desc) {
        Ok(scene) => scene,
        Err(error) => return vec![error.to_string()],
    };
    let mut options = scene.options();
    (options.width, options.height) = (SIZE[0], SIZE[1]);
    options.stop.spp = 1;
    options.stop.noise = None;
    let picture = scene.render(&options).unwrap();
    let (budget, mut said) = (Budget::default(), Diagnostics::new());
    // Its numbers are linear, whatever a reader takes them for.
    let expected = open_image(&path.with_extension("png"), &budget, &mut said).unwrap().bitmap;
    let (mut different, mut sum, mut same) = (0, 0.0, 0);
    // By cards of a sheet, so that a message names the one that is wrong.
    let mut cards = [0; 12];
    let mut sums = [[[0.0; 2]; 3]; 12];
    for y in 0..SIZE[1] {
        for x in 0..SIZE[0] {
            let found = picture.image().pixel(x, y).to_array().map(|c| c.clamp(0.0, 1.0));
            let expected = [0, 1, 2].map(|c| expected.stored(x, y, c));
            let card = (y / 12 * 4 + x / 12) as usize;
            for c in 0..3 {
                sums[card][c][0] += f64::from(found[c]);
                sums[card][c][1] += f64::from(expected[c]);
            }
            let most = found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            if most > DIFFERENT || most.is_nan() {
                different += 1;
                cards[card] += 1;
            } else {
                sum += f64::from(most);
                same += 1;
            }
        }
    }
    if name.starts_with("media-") {
        // POV-Ray's own sampling of media is off by up to a tenth.
        let is_off = |[found, expected]: &[f64; 2]| (found - expected).abs() > 0.1 * expected;
        for (card, sums) in sums.iter().enumerate() {
            if sums.iter().any(is_off) {
                faults.push(format!("the mean of card {card} is off: {sums:?}"));
            }
        }
        return faults;
    }
    let (share, rest) = allowed(name);
    let found = f64::from(different) / f64::from(SIZE[0] * SIZE[1]);
    let mean = sum / f64::from(same.max(1));
    if found > share || mean > rest {
        faults.push(format!("{:.1} % differ, the rest by {mean:.5}; by cards {cards:?}", 100.0 * found));
    }
    faults
}

#[test]
fn pictures_are_those_of_povray() {
    let Some(folder) = folder() else { return };
    let mut names: Vec<String> = std::fs::read_dir(&folder)
        .unwrap()
        .filter_map(|entry| {
            let path = entry.unwrap().path();
            let is_case = path.extension().is_some_and(|e| e == "pov") && path.with_extension("png").exists();
            is_case.then(|| path.file_stem().unwrap().to_string_lossy().into_owned())
        })
        .collect();
    names.sort();
    assert!(names.len() > 40, "{names:?}");
    let only = std::env::var("LUMBRE_POV_CASE").ok();
    let mut wrong = Vec::new();
    let mut right = 0;
    for name in names.iter().filter(|name| only.as_ref().is_none_or(|only| only == *name)) {
        let faults = faults(&folder.join(name).with_extension("pov"), name);
        match (faults.is_empty(), NOT_YET.contains(&&**name)) {
            (true, true) => wrong.push(format!("{name}: is right by now")),
            (false, false) => wrong.push(format!("{name}: {}", faults.join("\n    "))),
            (true, false) => right += 1,
            (false, true) => {}
        }
    }
    assert!(wrong.is_empty(), "{right} of {} are right:\n{}", names.len(), wrong.join("\n"));
}

/// The values that POV-Ray itself prints, where they are.
#[test]
fn values_are_those_of_povray() {
    let Some(folder) = folder() else { return };
    let library = Path::new(SYSTEM_LIBRARY[0]);
    let (Ok(scene), Ok(expected)) = (
        std::fs::read_to_string(folder.join("values.pov")),
        std::fs::read_to_string(folder.join("values.csv")),
    ) else {
        return;
    };
    if !library.is_dir() {
        return;
    }
    let mut options = PovOptions::default();
    options.library.push(library.to_owned());
    let mut diagnostics = Diagnostics::new();
    let budget = Budget::default();
    let files = written_files(&scene, "values.pov", &folder, &options, &budget, &mut diagnostics);
    let found = &files.unwrap_or_else(|error| panic!("{error}"))["values.csv"];
    let mut wrong: Vec<String> = Vec::new();
    for (i, expected) in expected.lines().enumerate() {
        let found = found.lines().nth(i).unwrap_or("");
        if !VALUES_NOT_YET.iter().any(|name| expected.starts_with(name)) && !is_near(found, expected) {
            wrong.push(format!("{found}   expected   {expected}"));
        }
    }
    assert!(wrong.is_empty(), "{} wrong:\n{}", wrong.len(), wrong.join("\n"));
}

/// Rows of values that are not there yet.
const VALUES_NOT_YET: &[&str] = &[
    "f_hetero_mf",
    "f_spiral",
    "f_hex_x",
    "f_hex_y",
    "f_mesh1",
    "normal prism cubic_spline",
    "trace ovus",
    "normal ovus",
    "trace julia",
    "normal julia",
    "text A",
    "text Lumbre",
];

/// Whether two rows say the same, to some digits.
fn is_near(found: &str, expected: &str) -> bool {
    let (found, expected): (Vec<&str>, Vec<&str>) =
        (found.split(',').collect(), expected.split(',').collect());
    found.len() == expected.len()
        && found.iter().zip(&expected).all(|(a, b)| match (a.parse::<f64>(), b.parse::<f64>()) {
            (Ok(a), Ok(b)) => (a - b).abs() <= 2e-6 * (1.0 + b.abs()),
            _ => a == b,
        })
}

/// The colour in the middle of a small picture.
fn colour(scene: &str) -> [f32; 3] {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.pov");
    std::fs::write(&path, scene).unwrap();
    let (desc, _) =
        open_scene(&path, &ReadOptions::default()).unwrap_or_else(|error| panic!("{scene}: {error}"));
    let scene = Scene::from_description(desc).unwrap();
    let mut options = scene.options();
    (options.width, options.height) = (3, 3);
    options.stop.spp = 1;
    options.stop.noise = None;
    scene.render(&options).unwrap().image().pixel(1, 1).to_array()
}

/// Colours of scenes that show one colour each, as POV-Ray 3.7 renders them.
#[test]
fn colours_are_those_of_povray() {
    let camera = "camera { orthographic location -10*z direction z right 0.01*x up 0.01*y }";
    let behind = "background { rgb 1 }";
    let glass = "box { <-3,-3,0>, <3,3,1> pigment { rgb 0.5 transmit 0.4 } finish { FINISH } \
                 interior { fade_distance 1 fade_power POWER } }";
    let faded = |finish: &str, power: &str, rest: &str| {
        format!("{}\n{rest}", glass.replace("FINISH", finish).replace("POWER", power))
    };
    let layers =
        "sky_sphere { pigment { rgbft <0.2,0.3,0.4,0.5,0.2> } pigment { rgbft <0.5,0.6,0.7,0.4,0.3> } }";
    let gathering = |settings: &str, finish: &str| {
        format!(
            "global_settings {{ radiosity {{ {settings} }} }} background {{ rgb <1,0.8,0.6> }} \
             plane {{ -z, 0 pigment {{ rgb 0.8 }} finish {{ {finish} }} }}"
        )
    };
    let slabs: String = (0..3)
        .map(|i| {
            format!(
                "box {{ <-3,-3,{0}>, <3,3,{0}+1> pigment {{ rgb 0 transmit 0.8 }} finish {{ ambient 0 diffuse 0 }} }}",
                2 * i
            )
        })
        .collect();
    let mirror = "box { <-3,-3,0>, <3,3,0.1> rotate x*45 translate z*10 pigment { rgb 0 } \
                  finish { ambient 0 diffuse 0 reflection 0.5 } } \
                  box { <-3,5,5>, <3,6,15> pigment { rgb 0 transmit 0.8 } finish { ambient 0 diffuse 0 } }";
    let levels =
        |most: u32, scene: &str| format!("global_settings {{ max_trace_level {most} }} {behind} {scene}");
    let fog = |turbulence: &str| {
        format!(
            "plane {{ -z, 0 pigment {{ rgb 1 }} finish {{ ambient 1 diffuse 0 }} }} \
             fog {{ distance 20 rgb 0 turbulence {turbulence} }}"
        )
    };
    let film = "light_source { <-2.75,0,-100000> rgb 1 } plane { -z, 0 pigment { rgb 0.5 } \
                finish { ambient 0 diffuse 1 irid { 0.5 thickness 0.05 turbulence 0.5 } } }";
    let declared = "#declare T = texture { pigment { rgb <1,0.5,0.25> } finish { ambient 0.5 diffuse 0 } }";
    let textured = |texture: &str| format!("{declared} plane {{ -z, 0 {texture} }}");
    // The map that shows v, on a ball that is seen where v is 0.5 + 40 / 180.
    let ball = |object: &str, texture: &str, after: &str| {
        let map = "pigment { gradient y color_map { [0 rgb 0] [1 rgb 1] } } finish { ambient 1 diffuse 0 }";
        format!("sphere {{ 0, 0.6 {object} texture {{ {texture} {map} {after} }} rotate -40*x }}")
    };
    let cube = |clips: &str| {
        format!(
            "{behind} box {{ -0.5, 0.5 pigment {{ rgb <1,0,0> }} finish {{ ambient 1 diffuse 0 }} {clips} }}"
        )
    };
    let beam = "light_source { <0,0,-3> rgb 1 spotlight point_at <0,0,0> radius 10 falloff 25 translate x";
    let white = "plane { -z, 0 pigment { rgb 0.5 } finish { ambient 0 diffuse 1 } }";
    let thin = |behind: &str, reflection: &str| {
        format!(
            "background {{ rgb {behind} }} light_source {{ <0,0,-1000> rgb 1 }} plane {{ -z, 0 pigment {{ rgb 0.5 }} \
             finish {{ ambient 0 diffuse 0.5 reflection {reflection} irid {{ 0.5 thickness 0.3 }} }} }}"
        )
    };
    let turned =
        "camera { orthographic location <0.7,0,-3> look_at <0.2,0,0> direction z right 0.01*x up 0.01*y }";
    let ramp = "plane { z, 0 pigment { gradient x color_map { [0 rgb 0] [1 rgb 1] } } finish { ambient 1 diffuse 0 } }";
    let oblique = "light_source { <0,1732.05,-1000> rgb 1 }";
    for (version, scene, expected) in [
        // Layers of a sky are blended by another rule before 3.7.
        (3.6, format!("{behind} {layers}"), [0.272, 0.339, 0.41]),
        (3.7, format!("{behind} {layers}"), [0.33, 0.4176, 0.5116]),
        // Solids fade what passes them, not their own light.
        (3.7, faded("ambient 1 diffuse 0", "1", ""), [0.42; 3]),
        (3.7, faded("ambient 0 diffuse 0", "1", behind), [0.08; 3]),
        (3.7, faded("ambient 0 diffuse 0", "0", behind), [0.08; 3]),
        (3.7, faded("ambient 0 diffuse 1", "1", oblique), [0.158; 3]),
        (3.7, faded("ambient 0 diffuse 0 reflection 0.5", "1", behind), [0.65; 3]),
        // Surfaces gather light, and have their ambient light besides before 3.7.
        (3.7, gathering("count 200", "ambient 0.3 diffuse 0.5"), [0.4, 0.32, 0.24]),
        (3.6, gathering("count 200", "ambient 0.3 diffuse 0.5"), [0.64, 0.56, 0.48]),
        (3.7, gathering("brightness 0.5", "diffuse 0.5"), [0.2, 0.16, 0.12]),
        (3.7, gathering("gray_threshold 0.5", "diffuse 0.5"), [0.3673, 0.3273, 0.2873]),
        (3.7, gathering("count 9", "diffuse albedo 0.5 brilliance 2"), [0.4, 0.32, 0.24]),
        // Rays that go straight on have no level of their own, but end at the last.
        (3.7, levels(1, &slabs), [0.0; 3]),
        (3.7, levels(2, &slabs), [0.26215; 3]),
        (3.7, levels(2, mirror), [0.0; 3]),
        (3.7, levels(3, mirror), [0.32; 3]),
        // Turbulence thins fog; octaves of thin films are five.
        (3.7, fog("1"), [0.6954; 3]),
        (3.7, fog("0.5"), [0.6889; 3]),
        (3.7, fog("1 turb_depth 1"), [0.7973; 3]),
        (3.7, fog("1 fog_type 2 fog_offset 0 fog_alt 1"), [0.8422; 3]),
        (3.7, film.to_owned(), [0.4572, 0.325, 0.2936]),
        // What changes a texture changes what it is of.
        (3.7, textured("texture { T pigment { quick_color rgb 1 } }"), [0.5, 0.25, 0.125]),
        (3.7, textured("texture { T } finish { phong 0.2 }"), [0.5, 0.25, 0.125]),
        (3.7, textured("texture { T finish { ambient 1 } }"), [1.0, 0.5, 0.25]),
        // What is in the coordinates of a surface stays on it, whichever of object and texture says so.
        (3.7, ball("uv_mapping", "", ""), [0.7222; 3]),
        (3.7, ball("", "uv_mapping", ""), [0.7222; 3]),
        (3.7, ball("", "uv_mapping", "scale 2"), [0.3611; 3]),
        // An object may be clipped by its bounds, which else cut nothing.
        (3.7, cube("bounded_by { sphere { 0.2, 0.4 } } clipped_by { bounded_by }"), [1.0; 3]),
        (3.7, cube("clipped_by { sphere { 0.2, 0.4 } } bounded_by { clipped_by }"), [1.0; 3]),
        // Before version 3.5 the words of a camera take effect in their order.
        (3.1, format!("{turned} {ramp}"), [0.7; 3]),
        (3.5, format!("{turned} {ramp}"), [0.2; 3]),
        // Of a spotlight with parallel rays the cone is of no effect.
        (3.7, format!("{beam} parallel }} {white}"), [0.5; 3]),
        (3.7, format!("{beam} }} {white}"), [0.2654; 3]),
        // Mirrored light has the colours of thin films, too.
        (3.7, thin("0", "0.3"), [0.3279, 0.321, 0.25]),
        (3.7, thin("1", "0.3"), [0.7215, 0.7062, 0.55]),
        // Blocks that are not given are black beside pigments.
        (3.7, textured("texture { T } pigment { checker pigment { rgb 1 } translate 0.5*(x+y) }"), [0.5; 3]),
        (
            3.7,
            textured("texture { T } pigment { checker pigment { rgb 1 } translate <0.5,1.5,0> }"),
            [0.0; 3],
        ),
    ] {
        let camera = if scene.starts_with("camera") {
            String::new()
        } else if scene.contains("fog_type") {
            camera.replace("-10*z", "<-2.625,1,-10>")
        } else if scene.contains("fog") || scene.contains("turbulence 0.5") {
            camera.replace("-10*z", "<-2.75,0,-10>")
        } else {
            camera.to_owned()
        };
        let text = format!("#version {version:.1}; global_settings {{ assumed_gamma 1 }} {camera}\n{scene}");
        let found = colour(&text);
        let is_right = found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 5e-4);
        assert!(is_right, "{found:?}, not {expected:?}: {text}");
    }
}
