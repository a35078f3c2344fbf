//! What scenes of pbrt-v4 can say, with inputs varied: turned, mirrored, scaled and far away; with a texture in each
//! parameter; each against a closed form or against the same thing said in another way.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::fmt::Write;

use lumbre::{Picture, Scene, Stop};

fn opened(text: &str, files: &[(&str, &[u8])]) -> Scene {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in files {
        std::fs::write(folder.path().join(name), bytes).unwrap();
    }
    let path = folder.path().join("scene.pbrt");
    std::fs::write(&path, text).unwrap();
    lumbre::open(&path).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

fn rendered(scene: &Scene, spp: u32) -> Picture {
    let mut options = scene.options();
    options.stop = Stop::at(spp);
    scene.render(&options).unwrap()
}

/// The mean of all pixels.
fn mean(scene: &Scene, spp: u32) -> [f64; 3] {
    let picture = rendered(scene, spp);
    let pixels = picture.image().pixels();
    let sum = |channel: usize| pixels.iter().map(|pixel| f64::from(pixel.to_array()[channel])).sum::<f64>();
    [0, 1, 2].map(|channel| sum(channel) / pixels.len() as f64)
}

fn assert_near(found: [f64; 3], expected: [f64; 3], slack: f64, what: &str) {
    let away =
        found.iter().zip(&expected).map(|(x, e)| (x - e).abs() / e.abs().max(0.02)).fold(0.0, f64::max);
    assert!(away < slack, "{what}: {found:?}, not {expected:?}");
}

/// Places of a shape; the picture of a ball, in an even sky, is the same in all.
const PLACES: [&str; 6] = [
    "",
    "Rotate 40 1 2 3",
    "Scale -1 1 1",
    "Scale 3 3 3 Rotate -70 0 1 2 Scale .333333333333 .333333333333 .333333333333",
    "Rotate 20 0 1 1 Scale 1 1 -1 Rotate 15 1 0 0",
    "CoordSysTransform \"far\"",
];

/// A ball of this material that fills most of the picture. All stands at `origin`.
fn ball(material: &str, place: &str, origin: [f64; 3], lights: &str) -> String {
    let [x, y, z] = origin;
    format!(
        "Film \"rgb\" \"integer xresolution\" 16 \"integer yresolution\" 16
         LookAt {x} {} {} {x} {y} {z} 0 0 1 Camera \"perspective\" \"float fov\" 12
         Integrator \"volpath\" \"integer maxdepth\" 400
         WorldBegin
         Translate {x} {y} {z}
         {lights}
         AttributeBegin {place} {material} Shape \"sphere\" AttributeEnd",
        y - 9.0,
        z + 1.0
    )
}

/// [`PLACES`], with the place far from the origin taken apart.
fn everywhere(material: &str, lights: &str) -> impl Iterator<Item = (&'static str, String)> {
    PLACES.into_iter().map(move |place| {
        let is_far = place.contains("far");
        let origin = if is_far { [1e6, -2e6, 3e6] } else { [0.0; 3] };
        (place, ball(material, if is_far { "" } else { place }, origin, lights))
    })
}

#[test]
fn white_materials_stay_white_wherever_they_are() {
    let lights = "LightSource \"infinite\"";
    for (material, spp, slack) in [
        ("\"openpbr\" \"rgb base_color\" [1 1 1]", 16, 0.004),
        ("\"openpbr\" \"rgb base_color\" [1 1 1] \"float coat_weight\" 1 \"float coat_ior\" 2.2", 16, 0.006),
        (
            "\"openpbr\" \"rgb base_color\" [1 1 1] \"float coat_weight\" .5 \"float coat_roughness\" .4",
            16,
            0.006,
        ),
        (
            "\"openpbr\" \"rgb base_color\" [1 1 1] \"float base_metalness\" 1 \"float specular_roughness\" .7",
            16,
            0.006,
        ),
        (
            "\"openpbr\" \"rgb base_color\" [1 1 1] \"float base_metalness\" 1 \"float specular_roughness_anisotropy\" .7",
            16,
            0.01,
        ),
        ("\"openpbr\" \"rgb base_color\" [1 1 1] \"float transmission_weight\" 1", 256, 0.01),
        (
            "\"openpbr\" \"float subsurface_weight\" 1 \"rgb subsurface_color\" [1 1 1] \"float subsurface_radius\" .2",
            256,
            0.01,
        ),
        ("\"subsurface\" \"rgb reflectance\" [1 1 1] \"rgb mfp\" [.1 .1 .1]", 256, 0.01),
    ] {
        for (place, text) in everywhere(&format!("Material {material}"), lights) {
            assert_near(mean(&opened(&text, &[]), spp), [1.0; 3], slack, &format!("{material} {place}"));
        }
    }
}

#[test]
fn a_measured_ball_is_the_same_wherever_it_is() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/pictures/images/satin.bsdf");
    let bytes = std::fs::read(path).unwrap();
    let material = "Material \"measured\" \"string filename\" \"satin.bsdf\"";
    let means = everywhere(material, "LightSource \"infinite\"")
        .map(|(place, text)| (place, mean(&opened(&text, &[("satin.bsdf", &bytes)]), 64)));
    let means: Vec<(&str, [f64; 3])> = means.collect();
    let (_, first) = means[0];
    assert!(first.iter().all(|share| (0.05..1.0).contains(share)), "{first:?}");
    for (place, found) in means {
        assert_near(found, first, 0.01, place);
    }
}

#[test]
fn a_texture_in_every_parameter_gives_what_its_number_gives() {
    let lights = "LightSource \"infinite\" \"rgb L\" [.2 .3 .4]
                  LightSource \"point\" \"point3 from\" [3 -5 6] \"rgb I\" [60 50 40]";
    let mut count = 0;
    for (ty, parameters) in [
        (
            "openpbr",
            "base_weight .7;base_color .6 .4 .2;base_metalness .4;specular_weight .6;specular_color .9 .6 .3;\
             specular_roughness .5;specular_roughness_anisotropy .6;transmission_weight .5;coat_weight .6;\
             coat_roughness .3;coat_color .9 .7 .4;fuzz_weight .5;fuzz_color .9 .4 .6;fuzz_roughness .4;\
             thin_film_weight .7;thin_film_thickness .35",
        ),
        (
            "principled",
            "base_color .6 .4 .2;metallic .4;roughness .5;anisotropic .6;spec_tint .5;spec_trans .4;clearcoat .7;\
             sheen .6;sheen_tint .5",
        ),
        ("coateddiffuse", "reflectance .6 .4 .2;roughness .3;thickness .2;g .3;albedo .6 .2 .1"),
        (
            "coatedconductor",
            "reflectance .6 .4 .2;interface.roughness .3;conductor.roughness .3;thickness .2;g .3;albedo .6 .2 .1",
        ),
        ("hair", "eumelanin .8;pheomelanin .4;beta_m .5;beta_n .6;alpha 4;eta 1.4"),
        ("subsurface", "reflectance .6 .4 .2;mfp .2 .1 .3;roughness .3"),
        ("diffusetransmission", "reflectance .6 .4 .2;transmittance .2 .4 .1"),
        ("conductor", "reflectance .5 .6 .7;roughness .3"),
        ("dielectric", "roughness .3"),
        ("uber", "Kd .6 .4 .2;Ks .2 .3 .4;Kr .1 .2 .1;Kt .3 .1 .1;opacity .8 .6 .9;roughness .2;eta 1.4"),
    ] {
        let (mut textures, mut numbers, mut named) = (String::new(), String::new(), String::new());
        for (i, parameter) in parameters.split(';').enumerate() {
            let (name, value) = parameter.trim().split_once(' ').unwrap();
            let (of, kind) = if value.contains(' ') { ("spectrum", "rgb") } else { ("float", "float") };
            // Two squares of one value, which is not known to be constant.
            writeln!(
                textures,
                "Texture \"t{i}\" \"{of}\" \"checkerboard\" \"{kind} tex1\" [{value}] \"{kind} tex2\" [{value}]"
            )
            .unwrap();
            write!(numbers, " \"{kind} {name}\" [{value}]").unwrap();
            write!(named, " \"texture {name}\" \"t{i}\"").unwrap();
            count += 1;
        }
        let of_numbers = ball(&format!("Material \"{ty}\"{numbers}"), "Scale -1 1 1", [0.0; 3], lights);
        let of_textures =
            ball(&format!("{textures}Material \"{ty}\"{named}"), "Scale -1 1 1", [0.0; 3], lights);
        let [numbers, textures] = [of_numbers, of_textures].map(|text| mean(&opened(&text, &[]), 16));
        assert_near(textures, numbers, 2e-3, ty);
        assert!(numbers.iter().all(|light| *light > 0.01), "{ty}: {numbers:?}");
    }
    assert_eq!(count, 57);
}

/// A closed room with a window at x = 2 through which the sky shines in.
fn room(sky: &str) -> String {
    let panel = |points: &str| format!("Shape \"bilinearmesh\" \"point3 P\" [{points}]\n");
    let walls = [
        "-2 -2 -1  2 -2 -1  -2 2 -1  2 2 -1",
        "-2 -2 1  2 -2 1  -2 2 1  2 2 1",
        "-2 -2 -1  2 -2 -1  -2 -2 1  2 -2 1",
        "-2 2 -1  2 2 -1  -2 2 1  2 2 1",
        "-2 -2 -1  -2 2 -1  -2 -2 1  -2 2 1",
        "2 -2 -1  2 -.5 -1  2 -2 1  2 -.5 1",
        "2 .5 -1  2 2 -1  2 .5 1  2 2 1",
        "2 -.5 -1  2 .5 -1  2 -.5 -.4  2 .5 -.4",
        "2 -.5 .6  2 .5 .6  2 -.5 1  2 .5 1",
    ];
    format!(
        "Film \"rgb\" \"integer xresolution\" 12 \"integer yresolution\" 12
         LookAt -1 0 0 -1.9 .3 -.2 0 0 1 Camera \"perspective\" \"float fov\" 80
         Integrator \"path\" \"integer maxdepth\" 2
         WorldBegin
         {sky}
         Material \"diffuse\" \"rgb reflectance\" [.5 .5 .5]
         {}",
        walls.map(panel).concat()
    )
}

#[test]
fn a_portal_changes_the_noise_and_not_the_light() {
    let side = 32_usize;
    let mut image = format!("PF\n{side} {side}\n-1.0\n").into_bytes();
    for (y, x) in (0..side).flat_map(|y| (0..side).map(move |x| (y, x))) {
        let pixel = [0.2 + x as f32 / 10.0, 0.5 + (x * y % 7) as f32 / 3.0, 0.1 + y as f32 / 8.0];
        image.extend(pixel.iter().flat_map(|value| value.to_le_bytes()));
    }
    let portal = "\"point3 portal\" [2 -.5 -.4  2 -.5 .6  2 .5 .6  2 .5 -.4]";
    for (sky, turned) in [
        ("\"rgb L\" [2 3 4]", ""),
        ("\"string filename\" \"sky.pfm\"", ""),
        ("\"string filename\" \"sky.pfm\" \"float scale\" 2", "Rotate 70 1 2 0"),
        ("\"string filename\" \"sky.pfm\"", "Scale -1 1 1"),
    ] {
        let light = |portal: &str| {
            let sky = format!("AttributeBegin {turned} LightSource \"infinite\" {sky} {portal} AttributeEnd");
            opened(&room(&sky), &[("sky.pfm", &image)])
        };
        let (plain, through) = (mean(&light(""), 4096), mean(&light(portal), 256));
        assert_near(through, plain, 0.05, &format!("{sky} {turned}"));
    }
}

/// A sphere of triangles with normals and texture coordinates, as a PLY.
fn round_ply(radius: f64) -> Vec<u8> {
    let (across, down) = (48, 24);
    let mut vertices = String::new();
    for (j, i) in (0..=down).flat_map(|j| (0..=across).map(move |i| (j, i))) {
        let (theta, phi) =
            (std::f64::consts::PI * f64::from(j) / f64::from(down), 360.0 * f64::from(i) / 48.0);
        let (s, c) = phi.to_radians().sin_cos();
        let [x, y, z] = [theta.sin() * c, theta.sin() * s, theta.cos()];
        let at = [radius * x, radius * y, radius * z, x, y, z, f64::from(i) / 48.0, f64::from(j) / 24.0];
        writeln!(vertices, "{}", at.map(|v| format!("{v:.9}")).join(" ")).unwrap();
    }
    let mut faces = String::new();
    for (j, i) in (0..down).flat_map(|j| (0..across).map(move |i| (j, i))) {
        let first = j * (across + 1) + i;
        let below = first + across + 1;
        if j > 0 {
            writeln!(faces, "3 {first} {below} {}", first + 1).unwrap();
        }
        if j < down - 1 {
            writeln!(faces, "3 {} {below} {}", first + 1, below + 1).unwrap();
        }
    }
    let properties =
        ["x", "y", "z", "nx", "ny", "nz", "u", "v"].map(|name| format!("property float {name}\n"));
    format!(
        "ply\nformat ascii 1.0\nelement vertex {}\n{}element face {}\nproperty list uchar int vertex_indices\nend_header\n{vertices}{faces}",
        vertices.lines().count(),
        properties.concat(),
        faces.lines().count()
    )
    .into_bytes()
}

#[test]
fn a_constant_displacement_is_a_larger_ball() {
    let files: [(&str, &[u8]); 2] = [("one.ply", &round_ply(1.0)), ("larger.ply", &round_ply(1.25))];
    let scene = |shape: &str, place: &str, [x, y, z]: [f64; 3]| {
        let text = format!(
            "Film \"rgb\" \"integer xresolution\" 24 \"integer yresolution\" 24
             LookAt {x} {} {} {x} {y} {z} 0 0 1 Camera \"perspective\" \"float fov\" 30
             WorldBegin Translate {x} {y} {z}
             LightSource \"distant\" \"point3 from\" [1 -2 3] \"point3 to\" [0 0 0]
             Texture \"d\" \"float\" \"constant\" \"float value\" .25
             Material \"diffuse\" \"rgb reflectance\" [.8 .6 .4]
             AttributeBegin {place} Shape \"plymesh\" {shape} AttributeEnd",
            y - 9.0,
            z + 2.0
        );
        mean(&opened(&text, &files), 64)
    };
    let displaced = |edge: &str| {
        format!("\"string filename\" \"one.ply\" \"texture displacement\" \"d\" \"float edgelength\" {edge}")
    };
    for (place, origin) in [
        ("", [0.0; 3]),
        ("Scale -1 1 1", [0.0; 3]),
        ("Rotate 40 1 2 3 Scale .5 2 1", [0.0; 3]),
        ("Translate 1 0 .5 Scale .7 .7 -.7", [0.0; 3]),
        ("ReverseOrientation", [0.0; 3]),
        ("", [1e6, -2e6, 3e6]),
    ] {
        let expected = scene("\"string filename\" \"larger.ply\"", place, origin);
        assert!(expected[0] > 0.005, "{expected:?}");
        for edge in ["100", ".1"] {
            let found = scene(&displaced(edge), place, origin);
            assert_near(found, expected, 0.02, &format!("{place} {origin:?} {edge}"));
        }
    }
}

#[test]
fn a_nurbs_of_a_quarter_cylinder_is_one() {
    // x² + z² = 1 from (1, 0) to (0, 1), along y from 0 to 2: the weight in the middle is 1/√2.
    let w = std::f64::consts::FRAC_1_SQRT_2;
    let mut points = String::new();
    for y in [0.0, 2.0] {
        for (x, z, w) in [(1.0, 0.0, 1.0), (1.0, 1.0, w), (0.0, 1.0, 1.0)] {
            write!(points, "{} {} {} {w} ", x * w, y * w, z * w).unwrap();
        }
    }
    let nurbs = format!(
        "Shape \"nurbs\" \"integer nu\" 3 \"integer nv\" 2 \"integer uorder\" 3 \"integer vorder\" 2
         \"float uknots\" [0 0 0 1 1 1] \"float vknots\" [0 0 1 1] \"float Pw\" [{points}]"
    );
    let cylinder =
        "Rotate 90 1 0 0 Shape \"cylinder\" \"float zmin\" -2 \"float zmax\" 0 \"float phimax\" 90";
    for place in [
        "",
        "Scale 1 1 -1 Translate 0 0 -1",
        "Rotate 33 0 1 0 Scale 1 .5 2",
        "Scale 2 2 2 Translate .1 .2 -.3",
    ] {
        let [found, expected] = [nurbs.as_str(), cylinder].map(|shape| {
            let text = format!(
                "Film \"rgb\" \"integer xresolution\" 32 \"integer yresolution\" 32
                 LookAt 4 -5 3 .4 1 .4 0 0 1 Camera \"perspective\" \"float fov\" 50
                 WorldBegin LightSource \"distant\" \"point3 from\" [1 -2 3] \"point3 to\" [0 0 0]
                 LightSource \"infinite\" \"rgb L\" [.1 .2 .3]
                 Material \"diffuse\" \"rgb reflectance\" [.8 .6 .4]
                 AttributeBegin {place} {shape} AttributeEnd"
            );
            mean(&opened(&text, &[]), 16)
        });
        assert_near(found, expected, 0.03, place);
    }
}

#[test]
fn glass_reflects_each_wavelength_by_its_index() {
    // An index from 1.3 at 360 nm to 2.24 at 830 nm, seen head-on before black: ((n - 1)/(n + 1))².
    let text = "Film \"spectral\" \"integer nbuckets\" 4 \"float lambdamin\" 400 \"float lambdamax\" 700
           \"integer xresolution\" 12 \"integer yresolution\" 12
         LookAt 3 4 10 3 4 0 0 1 0 Camera \"perspective\" \"float fov\" 2
         WorldBegin LightSource \"infinite\" \"spectrum L\" [300 1 900 1]
         Material \"dielectric\" \"spectrum eta\" [360 1.3 830 2.24]
         Shape \"bilinearmesh\" \"point3 P\" [-50 -50 0  50 -50 0  -50 50 0  50 50 0]
         Material \"diffuse\" \"rgb reflectance\" [0 0 0]
         Shape \"bilinearmesh\" \"point3 P\" [-50 -50 -1  50 -50 -1  -50 50 -1  50 50 -1]";
    let picture = rendered(&opened(text, &[]), 1024);
    // Against a mirror of the same light: the buckets' own unit.
    let plain = text.replace(
        "\"dielectric\" \"spectrum eta\" [360 1.3 830 2.24]",
        "\"conductor\" \"rgb reflectance\" [1 1 1]",
    );
    let mirror = rendered(&opened(&plain, &[]), 64);
    let values = |picture: &Picture| -> Vec<f64> {
        let layers = &picture.film().layers;
        let mean =
            |samples: &[f32]| samples.iter().copied().map(f64::from).sum::<f64>() / samples.len() as f64;
        layers.iter().map(|layer| mean(&layer.samples)).collect()
    };
    let (found, whole) = (values(&picture), values(&mirror));
    assert_eq!((found.len(), whole.len()), (4, 4));
    for (i, (found, whole)) in found.iter().zip(&whole).enumerate() {
        let steps = 50;
        let share = |k: usize| {
            let nm = 400.0 + 75.0 * (i as f64 + (k as f64 + 0.5) / f64::from(steps));
            let n = 1.3 + 0.002 * (nm - 360.0);
            ((n - 1.0) / (n + 1.0)).powi(2)
        };
        let expected = (0..steps as usize).map(share).sum::<f64>() / f64::from(steps);
        let found = found / whole;
        assert!((found / expected - 1.0).abs() < 0.05, "bucket {i}: {found}, not {expected}");
    }
}

#[test]
fn a_prism_bends_each_wavelength_by_its_index() {
    // Rays along z enter a wedge head-on, leave its slanted back, and see a wall that shines beyond x = 1.
    let (wedge, wall, edge) = (15_f64.to_radians(), 8.0, 1.0);
    let (thin, thick) = (2.0 - 5.0 * wedge.tan(), 2.0 + 5.0 * wedge.tan());
    let text = format!(
        "Film \"spectral\" \"integer nbuckets\" 3 \"float lambdamin\" 400 \"float lambdamax\" 700
           \"integer xresolution\" 64 \"integer yresolution\" 4
         PixelFilter \"box\" Integrator \"path\" \"integer maxdepth\" 2
         LookAt 0 0 -10 0 0 0 0 1 0 Camera \"orthographic\" \"float screenwindow\" [-1 1 -1 1]
         WorldBegin
         AttributeBegin AreaLightSource \"diffuse\" \"spectrum L\" [300 1 900 1] \"bool twosided\" true
         Shape \"bilinearmesh\" \"point3 P\" [{edge} -40 {wall}  40 -40 {wall}  {edge} 40 {wall}  40 40 {wall}]
         AttributeEnd
         Material \"dielectric\" \"spectrum eta\" [360 1.6 760 1.4]
         Shape \"trianglemesh\" \"point3 P\" [-5 -5 0  5 -5 0  5 5 0  -5 5 0
           -5 -5 {thin}  5 -5 {thick}  5 5 {thick}  -5 5 {thin}]
           \"integer indices\" [0 2 1 0 3 2  4 5 6 4 6 7  0 1 5 0 5 4  2 3 7 2 7 6  0 4 7 0 7 3  1 2 6 1 6 5]"
    );
    let picture = rendered(&opened(&text, &[]), 512);
    assert_eq!(picture.film().layers.len(), 3);
    for (i, layer) in picture.film().layers.iter().enumerate() {
        let mean_of = |columns: std::ops::Range<usize>| {
            let rows = layer.samples.chunks(64).map(|row| row[columns.clone()].iter().sum::<f32>());
            f64::from(rows.sum::<f32>()) / (4 * columns.len()) as f64
        };
        let found = mean_of(0..64) / mean_of(44..64);
        let steps = 100;
        let lit = |k: u32| {
            let nm = 400.0 + 100.0 * (i as f64 + (f64::from(k) + 0.5) / f64::from(steps));
            let index = 1.6 - 0.0005 * (nm - 360.0);
            let bend = ((index * wedge.sin()).asin() - wedge).tan();
            let first = (edge - (wall - 2.0) * bend) / (1.0 - wedge.tan() * bend);
            0.5 * (1.0 - first)
        };
        let expected = (0..steps).map(lit).sum::<f64>() / f64::from(steps);
        assert!((found - expected).abs() < 0.008, "bucket {i}: {found}, not {expected}");
    }
}

#[test]
fn integrators_of_every_name_see_the_same_light() {
    let scene = |integrator: &str| {
        format!(
            "Film \"rgb\" \"integer xresolution\" 24 \"integer yresolution\" 18
             Integrator {integrator} \"integer maxdepth\" 6
             LookAt 0 -6 3 0 0 .5 0 0 1 Camera \"perspective\" \"float fov\" 40
             WorldBegin
             LightSource \"point\" \"point3 from\" [2 -2 4] \"rgb I\" [6 5 4]
             AttributeBegin AreaLightSource \"diffuse\" \"rgb L\" [3 4 5] Translate -1 0 3 ReverseOrientation
             Shape \"disk\" \"float radius\" .7 AttributeEnd
             Material \"diffuse\" \"rgb reflectance\" [.6 .5 .4]
             Shape \"bilinearmesh\" \"point3 P\" [-4 -4 0  4 -4 0  -4 4 0  4 4 0]
             Material \"conductor\" \"float roughness\" .3 Translate 0 0 .8 Shape \"sphere\" \"float radius\" .8"
        )
    };
    let expected = mean(&opened(&scene("\"path\""), &[]), 256);
    assert!(expected.iter().all(|mean| (0.02..2.0).contains(mean)), "{expected:?}");
    let names = ["volpath", "simplepath", "simplevolpath", "bdpt", "mlt", "sppm", "lightpath", "randomwalk"];
    for name in names {
        let found = mean(&opened(&scene(&format!("\"{name}\"")), &[]), 256);
        assert_near(found, expected, 0.03, name);
    }
}
