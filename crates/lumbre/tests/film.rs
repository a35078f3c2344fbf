//! What films keep besides colours: surfaces and wavelengths.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use lumbre::{DVec3, Picture, Scene, Stop};

fn scene(text: &str) -> Scene {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.pbrt");
    std::fs::write(&path, text).unwrap();
    lumbre::open(&path).unwrap()
}

fn render(scene: &Scene, spp: u32, threads: usize) -> Picture {
    let mut options = scene.options();
    (options.stop, options.threads) = (Stop::at(spp), threads);
    scene.render(&options).unwrap()
}

/// The channel of that name.
fn channel<'p>(picture: &'p Picture, name: &str) -> &'p [f32] {
    let layer = picture.film().layers.iter().find(|layer| layer.name == name);
    &layer.unwrap_or_else(|| panic!("no channel {name}")).samples
}

const WIDTH: usize = 24;
const HEIGHT: usize = 18;

/// A plane through the origin, 30 degrees out of upright, that covers the lower part of the picture.
fn plane(film: &str) -> String {
    format!(
        r#"Film {film} "integer xresolution" {WIDTH} "integer yresolution" {HEIGHT}
PixelFilter "box"
LookAt 1 2 -5  1 2 0  0 1 0
Camera "perspective" "float fov" 40
WorldBegin
LightSource "infinite" "rgb L" [0.5 0.6 0.7]
Material "diffuse" "rgb reflectance" [0.2 0.4 0.8]
Rotate 30 1 0 0
Shape "bilinearmesh" "point3 P" [-40 -40 0  40 -40 0  -40 2 0  40 2 0] "point2 uv" [0 0  1 0  0 1  1 1]
"#
    )
}

#[test]
fn the_channels_of_a_plane_are_those_of_its_equation() {
    let eye = DVec3::new(1.0, 2.0, -5.0);
    // Of the plane: on the side of the camera, which looks along z.
    let (sine, cosine) = 30_f64.to_radians().sin_cos();
    let normal = DVec3::new(0.0, sine, -cosine);
    let picture = render(&scene(&plane("\"gbuffer\"")), 16, 0);
    let world = render(&scene(&plane("\"gbuffer\" \"string coordinatesystem\" \"world\"")), 16, 0);
    let point = |picture: &Picture, at: usize| {
        DVec3::from_array(["P.X", "P.Y", "P.Z"].map(|name| f64::from(channel(picture, name)[at])))
    };
    let is_covered = |at: usize| channel(&world, "v")[at] > 0.0;
    let (mut covered, mut empty) = (0, 0);
    for at in 0..WIDTH * HEIGHT {
        let values = |name: &str| f64::from(channel(&picture, name)[at]);
        if !is_covered(at) {
            empty += 1;
            assert_eq!((point(&picture, at), values("N.Z"), values("Albedo.B")), (DVec3::ZERO, 0.0, 0.0));
            continue;
        }
        covered += 1;
        // A mean of points of a plane is on it.
        let here = point(&world, at);
        assert!(here.dot(normal).abs() < 1e-4 * here.length(), "{here}");
        assert!((point(&picture, at) - (here - eye)).length() < 1e-4 * here.length(), "{here}");
        for names in [["N.X", "N.Y", "N.Z"], ["Ns.X", "Ns.Y", "Ns.Z"]] {
            let found = DVec3::from_array(names.map(values));
            assert!((found - normal).length() < 1e-5, "{found}");
        }
        for (name, value) in [("Albedo.R", 0.2), ("Albedo.G", 0.4), ("Albedo.B", 0.8)] {
            assert!((values(name) - value).abs() < 1e-5, "{name}: {}", values(name));
        }
        let along = (here.x + 40.0) / 80.0;
        assert!((values("u") - along).abs() < 1e-4, "{} {along}", values("u"));
        // By how much the distance grows from the row above to the row below.
        if at >= WIDTH && at + WIDTH < WIDTH * HEIGHT && is_covered(at - WIDTH) && at > 2 * WIDTH {
            let depth = |at: usize| point(&picture, at).z;
            let change = 0.5 * (depth(at + WIDTH) - depth(at - WIDTH)).abs();
            let found = values("dzdy");
            assert!((found / change - 1.0).abs() < 0.05, "{found} {change}");
            assert!(values("dzdx") < 1e-4 * values("dzdy"), "{}", values("dzdx"));
        }
        let mean = f64::from(picture.image().pixels()[at].r);
        let (variance, relative) = (values("Variance.R"), values("RelativeVariance.R"));
        assert!(variance >= 0.0 && (relative * mean - variance).abs() < 0.02 * variance + 1e-7, "{variance}");
    }
    assert!(covered > 150 && empty > 40, "{covered} {empty}");
}

#[test]
fn films_with_channels_keep_colours_for_any_threads() {
    let plain = render(&scene(&plane("\"rgb\"")), 4, 2);
    let mut films = ["\"gbuffer\"", "\"gbuffer\" \"string coordinatesystem\" \"world\""]
        .map(|film| render(&scene(&plane(film)), 4, 2));
    for film in &mut films {
        assert_eq!(film.image(), plain.image());
        assert_eq!(film.film().layers.len(), 22);
    }
    assert!(plain.film().layers.is_empty());
    for film in ["\"gbuffer\"", "\"spectral\""] {
        let scene = scene(&plane(film));
        let (one, two) = (render(&scene, 4, 1), render(&scene, 4, 2));
        assert_eq!((one.image(), one.film()), (two.image(), two.film()), "{film}");
    }
}

/// Light from everywhere, which is all that there is to see.
fn sky(film: &str, light: &str) -> Scene {
    scene(&format!(
        "Film \"spectral\" {film} \"integer xresolution\" 32 \"integer yresolution\" 32
         WorldBegin LightSource \"infinite\" \"spectrum L\" [{light}]"
    ))
}

#[test]
fn buckets_have_the_radiance_of_their_wavelengths() {
    let mean = |samples: &[f32]| samples.iter().copied().map(f64::from).sum::<f64>() / samples.len() as f64;
    // A constant spectrum: all are alike, and that is the luminance.
    let picture = render(&sky("\"integer nbuckets\" 5", "300 2 900 2"), 16, 0);
    let names: Vec<&str> = picture.film().layers.iter().map(|layer| &*layer.name).collect();
    assert_eq!(names, ["S0.407,000nm", "S0.501,000nm", "S0.595,000nm", "S0.689,000nm", "S0.783,000nm"]);
    let first = mean(channel(&picture, names[0]));
    for name in &names {
        let values = channel(&picture, name);
        assert!(values.iter().all(|value| (f64::from(*value) / first - 1.0).abs() < 1e-5), "{name}");
    }
    let luminance: Vec<f32> = picture.image().pixels().iter().map(|pixel| pixel.luminance()).collect();
    assert!((mean(&luminance) / first - 1.0).abs() < 0.01, "{} {first}", mean(&luminance));
    // One that grows with the wavelength, over a part of the range.
    let film = "\"integer nbuckets\" 4 \"float lambdamin\" 500 \"float lambdamax\" 700";
    let picture = render(&sky(film, "400 0 800 4"), 64, 0);
    let values: Vec<f64> = picture.film().layers.iter().map(|layer| mean(&layer.samples)).collect();
    for (i, value) in values.iter().enumerate() {
        let expected = (125.0 + 50.0 * i as f64) / 125.0;
        assert!((value / values[0] / expected - 1.0).abs() < 0.01, "{i}: {values:?}");
    }
    assert_eq!(picture.film().attributes[0], ("spectralLayoutVersion".to_owned(), "1.0".to_owned()));
}

#[test]
fn glass_that_disperses_leaves_the_buckets_their_means() {
    // Light that is the same from everywhere is so through glass that absorbs nothing, whichever wavelengths go on.
    let scene = scene(
        r#"Film "spectral" "integer nbuckets" 4 "integer xresolution" 16 "integer yresolution" 16
Integrator "path" "integer maxdepth" 40
LookAt 0 0 -4  0 0 0  0 1 0
Camera "perspective" "float fov" 20
WorldBegin
LightSource "infinite" "spectrum L" [300 1 900 1]
Material "dielectric" "spectrum eta" "glass-F11"
Shape "sphere"
"#,
    );
    let picture = render(&scene, 256, 0);
    let means: Vec<f64> = picture
        .film()
        .layers
        .iter()
        .map(|layer| layer.samples.iter().copied().map(f64::from).sum::<f64>() / layer.samples.len() as f64)
        .collect();
    let luminance =
        picture.image().pixels().iter().map(|pixel| f64::from(pixel.luminance())).sum::<f64>() / 256.0;
    for mean in &means {
        assert!((mean / luminance - 1.0).abs() < 0.03, "{means:?} {luminance}");
    }
}

#[test]
fn films_that_keep_wavelengths_refuse_paths_of_colours() {
    let scene = scene(&plane("\"spectral\""));
    let mut options = scene.options();
    assert!(options.spectral);
    options.spectral = false;
    let error = scene.render(&options).unwrap_err().to_string();
    assert!(error.contains("film \"spectral\""), "{error}");
}

#[test]
fn the_memory_of_a_film_is_predicted() {
    let bytes = |film: &str| scene(&plane(film)).options().memory_bytes().unwrap() / (WIDTH * HEIGHT) as u64;
    let plain = bytes("\"rgb\"");
    // 23 sums of 16 bytes and 22 channels of 4; two sums and a channel for each bucket.
    assert_eq!(bytes("\"gbuffer\"") - plain, 23 * 16 + 22 * 4);
    assert_eq!(bytes("\"spectral\" \"integer nbuckets\" 100") - plain, 100 * (2 * 16 + 4));
}
