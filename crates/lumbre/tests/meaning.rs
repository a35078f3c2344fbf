//! What the words of a scene file mean for the picture: lights in their units, images the right way up, surfaces the
//! right way round. Each scene is rendered, and each pixel compared with a closed form.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::f64::consts::PI;
use std::path::Path;

use lumbre::description::IntegratorKind;
use lumbre::formats::{Budget, Diagnostics, Limits, pbrt};
use lumbre::image::{Image, Rgb};
use lumbre::{Picture, SaveOptions, Scene, write_image};
use tempfile::TempDir;

const REFLECTANCE: f64 = 0.6;
/// Where the floor is looked at.
const PLACE: [f64; 3] = [3.0, -2.0, 0.5];

fn open(folder: Option<&Path>, text: &str) -> Scene {
    let mut diagnostics = Diagnostics::new();
    let budget = Budget::new(Limits::default());
    let desc = pbrt::read_bytes("meaning.pbrt", text.as_bytes(), folder, &budget, &mut diagnostics)
        .unwrap_or_else(|e| panic!("{e}\n{text}"));
    assert_eq!(diagnostics.lines(), Vec::<String>::new(), "{text}");
    Scene::from_description(desc).unwrap()
}

fn render(folder: Option<&Path>, text: &str) -> Picture {
    let scene = open(folder, text);
    let picture = scene.render(&scene.options()).unwrap();
    assert_eq!(picture.stats().dropped, 0);
    picture
}

/// The mean of a picture of four by four pixels, of what lies straight before the eye.
fn seen(folder: Option<&Path>, integrator: &str, from: [f64; 3], to: [f64; 3], world: &str) -> [f64; 3] {
    seen_by(256, folder, integrator, from, to, world)
}

/// The same with this many samples a pixel.
fn seen_by(
    samples: u32,
    folder: Option<&Path>,
    integrator: &str,
    from: [f64; 3],
    to: [f64; 3],
    world: &str,
) -> [f64; 3] {
    let along: Vec<f64> = (0..3).map(|axis| to[axis] - from[axis]).collect();
    let up =
        if along[1].abs() > 0.9 * along.iter().map(|x| x.abs()).sum::<f64>() { "0 0 1" } else { "0 1 0" };
    let text = format!(
        r#"Film "rgb" "integer xresolution" 4 "integer yresolution" 4
        Sampler "sobol" "integer pixelsamples" {samples}
        PixelFilter "box"
        Integrator {integrator}
        LookAt {} {} {}  {} {} {}  {up}
        Camera "perspective" "float fov" 0.01
        WorldBegin
        {world}"#,
        from[0], from[1], from[2], to[0], to[1], to[2]
    );
    let mean = render(folder, &text).image().mean();
    mean.to_array().map(f64::from)
}

/// A floor at the height of [`PLACE`], under `light`, by direct light alone.
fn floor(folder: Option<&Path>, light: &str) -> [f64; 3] {
    let [x, y, z] = PLACE;
    let world = format!(
        r#"{light}
        Material "diffuse" "rgb reflectance" [{REFLECTANCE} {REFLECTANCE} {REFLECTANCE}]
        Translate {x} {y} {z}
        Shape "disk" "float radius" 40"#
    );
    // Skies are found by two strategies; each is noisy where the other is not.
    seen_by(2048, folder, r#""path" "integer maxdepth" 1"#, [x, y, z + 9.0], PLACE, &world)
}

fn assert_near(found: [f64; 3], expected: [f64; 3], share: f64, what: &str) {
    for channel in 0..3 {
        let (found, expected) = (found[channel], expected[channel]);
        assert!((found - expected).abs() <= share * expected.abs() + 1e-9, "{what}: {found}, not {expected}");
    }
}

/// What a white floor sends back of an irradiance.
fn grey(irradiance: f64) -> [f64; 3] {
    [REFLECTANCE / PI * irradiance; 3]
}

fn luminance(c: [f64; 3]) -> f64 {
    0.212_639 * c[0] + 0.715_169 * c[1] + 0.072_192 * c[2]
}

#[test]
fn a_point_light_shines_by_its_intensity_or_its_power() {
    // One to the side, three above: 11 is the square of the distance.
    let point = |how: &str| floor(None, &format!(r#"LightSource "point" "point3 from" [4 -1 3.5] {how}"#));
    let cosine_by_square = 3.0 / 11_f64.powf(1.5);
    let expected = [2.0, 4.0, 8.0].map(|intensity| grey(intensity * cosine_by_square)[0]);
    assert_near(point(r#""rgb I" [2 4 8]"#), expected, 1e-4, "intensity");
    assert_near(point(r#""rgb I" [2 4 8] "float scale" 3"#), expected.map(|x| 3.0 * x), 1e-4, "scale");
    assert_near(point(r#""float power" 500"#), grey(500.0 / (4.0 * PI) * cosine_by_square), 1e-4, "power");
}

#[test]
fn the_power_of_a_spot_is_what_leaves_its_cone() {
    let found = floor(
        None,
        r#"LightSource "spot" "point3 from" [3 -2 4.5] "point3 to" [3 -2 0] "float power" 500
           "float coneangle" 40 "float conedeltaangle" 10"#,
    );
    // Over the edge the smooth step averages to a half, by the cosine.
    let (inner, outer) = (30_f64.to_radians().cos(), 40_f64.to_radians().cos());
    let intensity = 500.0 / (2.0 * PI * (1.0 - inner + 0.5 * (inner - outer)));
    assert_near(found, grey(intensity / 16.0), 1e-4, "spot");
}

#[test]
fn an_illuminance_is_that_of_a_surface_across_the_light() {
    let distant = r#"LightSource "distant" "point3 from" [3 0 4] "point3 to" [0 0 0]"#;
    assert_near(floor(None, &format!(r#"{distant} "float illuminance" 800"#)), grey(640.0), 1e-4, "lux");
    assert_near(floor(None, &format!(r#"{distant} "rgb L" [5 5 5]"#)), grey(4.0), 1e-4, "L");
    let sky = r#"LightSource "infinite""#;
    assert_near(floor(None, &format!(r#"{sky} "float illuminance" 2.5"#)), grey(2.5), 2e-3, "sky");
    assert_near(floor(None, &format!(r#"{sky} "rgb L" [0.5 0.5 0.5]"#)), grey(0.5 * PI), 2e-3, "sky");
}

/// The radiance of a shape that shines, seen from above and from below its place.
fn shining(light: &str, shape: &str) -> [[f64; 3]; 2] {
    let [x, y, z] = PLACE;
    let world = format!("AreaLightSource \"diffuse\" {light}\n Translate {x} {y} {z}\n {shape}");
    [1.0, -1.0]
        .map(|side| seen(None, r#""path" "integer maxdepth" 1"#, [x, y, z + 6.0 * side], PLACE, &world))
}

#[test]
fn the_power_of_a_shape_leaves_its_shining_sides() {
    let disk = r#"Shape "disk" "float radius" 2"#;
    let area = 4.0 * PI;
    let [above, below] = shining(r#""float power" 60"#, disk);
    assert_near(above, [60.0 / (PI * area); 3], 1e-4, "one side");
    assert_near(below, [0.0; 3], 0.0, "the dark side");
    for side in shining(r#""float power" 60 "bool twosided" true"#, disk) {
        assert_near(side, [30.0 / (PI * area); 3], 1e-4, "two sides");
    }
    let sphere = r#"Shape "sphere" "float radius" 0.5"#;
    // L stays a factor on it, as in pbrt-v4.
    for side in shining(r#""float power" 60 "rgb L" [7 7 7]"#, sphere) {
        assert_near(side, [7.0 * 60.0 / (PI * PI); 3], 1e-4, "sphere");
    }
}

#[test]
fn spectra_of_lights_count_by_their_luminance() {
    let disk = r#"Shape "disk" "float radius" 2"#;
    let candle = shining(r#""blackbody L" [2000]"#, disk)[0];
    assert!(candle[0] > 2.0 * candle[1] && candle[1] > 4.0 * candle[2].max(0.0), "{candle:?}");
    assert!((luminance(candle) - 1.0).abs() < 0.01, "{candle:?}");
    let day = shining(r#""spectrum L" "stdillum-D65" "float scale" 3"#, disk)[0];
    assert_near(day, [3.0; 3], 0.01, "D65");
    let bulb = shining(r#""spectrum L" "stdillum-A""#, disk)[0];
    assert!(bulb[0] > bulb[1] && bulb[1] > bulb[2], "{bulb:?}");
    assert!((luminance(bulb) - 1.0).abs() < 0.01, "{bulb:?}");
}

#[test]
fn one_sided_light_leaves_where_the_outward_normal_points() {
    let disk = r#"Shape "disk" "float radius" 2"#;
    let bright = |sides: [[f64; 3]; 2]| sides.map(|side| side[0] > 0.0);
    let light = r#""rgb L" [2 2 2]"#;
    assert_eq!(bright(shining(light, disk)), [true, false]);
    assert_eq!(bright(shining(light, &format!("ReverseOrientation {disk}"))), [false, true]);
    // The outside of what stands in a mirror is its image's.
    assert_eq!(bright(shining(light, &format!("Scale 1 1 -1 {disk}"))), [false, true]);
    assert_eq!(bright(shining(light, &format!("Scale -1 1 1 {disk}"))), [true, false]);
    let sphere = r#"Shape "sphere" "float radius" 0.5"#;
    assert_eq!(bright(shining(light, &format!("Scale 1 -1 1 {sphere}"))), [true, true]);
    assert_eq!(bright(shining(light, &format!("ReverseOrientation Scale 1 -1 1 {sphere}"))), [false, false]);
    let triangle = r#"Shape "trianglemesh" "integer indices" [0 1 2] "point3 P" [-2 -2 0 2 -2 0 0 3 0]"#;
    assert_eq!(bright(shining(light, triangle)), [true, false]);
    assert_eq!(bright(shining(light, &format!("ReverseOrientation {triangle}"))), [false, true]);
    assert_eq!(bright(shining(light, &format!("Scale -1 1 1 {triangle}"))), [true, false]);
}

fn folder_with(images: &[(&str, Image)]) -> TempDir {
    let folder = TempDir::new().unwrap();
    for (name, image) in images {
        write_image(&folder.path().join(name), image, &SaveOptions::default()).unwrap();
    }
    folder
}

/// An image of the colour that `at` gives to the middle of each pixel, with (0, 0) at its upper left corner.
fn painted(width: u32, height: u32, at: impl Fn(f64, f64) -> [f32; 3]) -> Image {
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| {
        let [r, g, b] = at((f64::from(x) + 0.5) / f64::from(width), (f64::from(y) + 0.5) / f64::from(height));
        Rgb::new(r, g, b)
    });
    Image::from_pixels(width, height, pixels.collect()).unwrap()
}

const RED: [f32; 3] = [4.0, 0.0, 0.0];
const GREEN: [f32; 3] = [0.0, 4.0, 0.0];
const BLUE: [f32; 3] = [0.0, 0.0, 4.0];
const WHITE: [f32; 3] = [4.0, 4.0, 4.0];
const GREY: [f32; 3] = [0.5, 0.5, 0.5];

/// What is seen of an environment along the six axes: +x, -x, +y, -y, +z, -z.
fn around(folder: &TempDir, file: &str, turn: &str) -> [[f64; 3]; 6] {
    let world =
        format!(r#"AttributeBegin {turn} LightSource "infinite" "string filename" "{file}" AttributeEnd"#);
    let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let [x, y, z] = PLACE;
    std::array::from_fn(|i| {
        let s = if i % 2 == 0 { 5.0 } else { -5.0 };
        let [dx, dy, dz] = axes[i / 2];
        let to = [x + s * dx, y + s * dy, z + s * dz];
        seen(Some(folder.path()), r#""path" "integer maxdepth" 1"#, PLACE, to, &world)
    })
}

#[test]
fn latitude_longitude_maps_have_z_up_and_turn_x_to_y() {
    // The left edge is towards +x, a quarter to the right +y, the middle -x.
    let map = painted(64, 32, |u, v| match ((8.0 * u).floor() as u32, v) {
        (_, v) if v < 0.2 => WHITE,
        (_, v) if v > 0.8 => GREY,
        (0 | 7, _) => RED,
        (1 | 2, _) => GREEN,
        (3 | 4, _) => BLUE,
        _ => [4.0, 4.0, 0.0],
    });
    let folder = folder_with(&[("sky.exr", map)]);
    let colours = [RED, BLUE, GREEN, [4.0, 4.0, 0.0], WHITE, GREY].map(|c| c.map(f64::from));
    let found = around(&folder, "sky.exr", "");
    for i in 0..6 {
        assert_near(found[i], colours[i], 1e-3, &format!("direction {i}"));
    }
    // A quarter turn about z takes what was towards +x towards +y.
    let turned = around(&folder, "sky.exr", "Rotate 90 0 0 1");
    assert_near(turned[2], colours[0], 1e-3, "turned");
    assert_near(turned[1], colours[2], 1e-3, "turned");
}

#[test]
fn equal_area_maps_have_z_in_the_middle() {
    let map = painted(64, 64, |u, v| {
        let (x, y) = (2.0 * u - 1.0, 2.0 * v - 1.0);
        match () {
            () if x.abs() + y.abs() < 0.4 => WHITE,
            () if x.abs() + y.abs() > 1.6 => GREY,
            () if x.abs() > y.abs() => {
                if x > 0.0 {
                    RED
                } else {
                    BLUE
                }
            }
            () => {
                if y > 0.0 {
                    GREEN
                } else {
                    [4.0, 4.0, 0.0]
                }
            }
        }
    });
    let folder = folder_with(&[("sky.exr", map)]);
    let colours = [RED, BLUE, GREEN, [4.0, 4.0, 0.0], WHITE, GREY].map(|c| c.map(f64::from));
    let found = around(&folder, "sky.exr", "");
    for i in 0..6 {
        assert_near(found[i], colours[i], 1e-3, &format!("direction {i}"));
    }
}

#[test]
fn illuminance_is_that_of_the_upper_half_on_the_ground() {
    let bright_spot = |u: f64, v: f64| if (u - 0.4).abs() < 0.1 && v < 0.3 { WHITE } else { GREY };
    let folder = folder_with(&[
        ("wide.exr", painted(128, 64, bright_spot)),
        ("square.exr", painted(64, 64, |u, v| if (u - 0.4).abs() < 0.1 && v < 0.6 { WHITE } else { GREY })),
    ]);
    // pbrt-v4 makes a square map twice as bright.
    for (file, lux) in [("wide.exr", 70.0), ("square.exr", 140.0)] {
        let sky = format!(r#"LightSource "infinite" "string filename" "{file}" "float illuminance" 70"#);
        assert_near(floor(Some(folder.path()), &sky), grey(lux), 4e-3, file);
    }
}

/// A square from (-2, -2, 0) to (2, 2, 0) about [`PLACE`], with (u, v) from (0, 0) to (1, 1), and other stuff before
/// it.
fn square(before: &str) -> String {
    let [x, y, z] = PLACE;
    format!(
        r#"Translate {x} {y} {z}
        {before}
        Shape "trianglemesh" "integer indices" [0 1 2 0 2 3] "point3 P" [-2 -2 0 2 -2 0 2 2 0 -2 2 0]
          "point2 uv" [0 0 1 0 1 1 0 1]"#
    )
}

/// The colours of the square at places given by (u, v).
fn on_square<const N: usize>(folder: Option<&Path>, before: &str, places: [[f64; 2]; N]) -> [[f64; 3]; N] {
    let [x, y, z] = PLACE;
    places.map(|[u, v]| {
        let at = [x - 2.0 + 4.0 * u, y - 2.0 + 4.0 * v, z];
        seen(folder, r#""albedo""#, [at[0], at[1], z + 5.0], at, &square(before))
    })
}

#[test]
fn images_have_their_lower_left_corner_at_the_uv_origin() {
    let image = painted(2, 2, |u, v| match (u < 0.5, v < 0.5) {
        (true, true) => [0.75, 0.0, 0.0],
        (false, true) => [0.0, 0.75, 0.0],
        (true, false) => [0.0, 0.0, 0.75],
        (false, false) => [0.75, 0.75, 0.75],
    });
    let folder = folder_with(&[("four.exr", image)]);
    let folder = Some(folder.path());
    let textured = |wrap: &str, scale: f64| {
        format!(
            r#"Texture "four" "spectrum" "imagemap" "string filename" "four.exr" "string filter" "point"
               "string wrap" "{wrap}" "float uscale" {scale} "float vscale" {scale}
            Material "diffuse" "texture reflectance" "four""#
        )
    };
    let quarters = [[0.25, 0.25], [0.75, 0.25], [0.25, 0.75], [0.75, 0.75]];
    let [blue, white, red, green] =
        [[0.0, 0.0, 0.75], [0.75, 0.75, 0.75], [0.75, 0.0, 0.0], [0.0, 0.75, 0.0]];
    for (found, expected) in
        on_square(folder, &textured("repeat", 1.0), quarters).into_iter().zip([blue, white, red, green])
    {
        assert_near(found, expected, 1e-4, "corners");
    }
    // Twice over the square: beyond its first half the image has ended.
    let beyond = [[0.125, 0.125], [0.625, 0.125], [0.7575, 0.7575]];
    for (wrap, expected) in [
        ("repeat", [blue, blue, green]),
        ("clamp", [blue, white, green]),
        ("black", [blue, [0.0; 3], [0.0; 3]]),
    ] {
        for (found, expected) in on_square(folder, &textured(wrap, 2.0), beyond).into_iter().zip(expected) {
            assert_near(found, expected, 1e-4, wrap);
        }
    }
}

#[test]
fn procedural_textures_are_what_their_parameters_say() {
    let bilerp = r#"Texture "b" "spectrum" "bilerp" "rgb v00" [0.1 0.2 0.3] "rgb v01" [0.9 0.2 0.3]
        "rgb v10" [0.1 0.8 0.3] "rgb v11" [0.1 0.2 0.7] Material "diffuse" "texture reflectance" "b""#;
    let [found] = on_square(None, bilerp, [[0.25, 0.5]]);
    assert_near(found, [0.4, 0.275, 0.35], 1e-3, "bilerp");
    let checks = r#"Texture "c" "spectrum" "checkerboard" "float uscale" 4 "float vscale" 2
        "rgb tex1" [0.8 0.1 0.1] "rgb tex2" [0.1 0.1 0.8] Material "diffuse" "texture reflectance" "c""#;
    let found = on_square(None, checks, [[0.125, 0.25], [0.375, 0.25], [0.125, 0.75], [0.375, 0.75]]);
    for (i, found) in found.into_iter().enumerate() {
        let first = i == 0 || i == 3;
        let expected = if first { [0.8, 0.1, 0.1] } else { [0.1, 0.1, 0.8] };
        assert_near(found, expected, 1e-4, "checkerboard");
    }
    let mixed = r#"Texture "m" "spectrum" "mix" "rgb tex1" [0.8 0.4 0.2] "rgb tex2" [0.2 0.4 0.8]
        "float amount" 0.25
        Texture "s" "spectrum" "scale" "texture tex" "m" "float scale" 0.5
        Material "diffuse" "texture reflectance" "s""#;
    let [found] = on_square(None, mixed, [[0.3, 0.6]]);
    assert_near(found, [0.325, 0.2, 0.175], 1e-4, "scale of a mix");
}

#[test]
fn alpha_lets_its_share_of_the_light_through() {
    let [x, y, z] = PLACE;
    let behind = format!(
        r#"AttributeBegin AreaLightSource "diffuse" "rgb L" [2 2 2]
        Translate {x} {y} {} Shape "disk" "float radius" 3 AttributeEnd
        Material "diffuse" "rgb reflectance" [0 0 0]"#,
        z - 4.0
    );
    let seen_through = |before: &str, alpha: &str, u: f64| {
        let at = [x - 2.0 + 4.0 * u, y, z];
        let world = format!("{behind} {} {alpha}", square(before));
        seen(None, r#""path" "integer maxdepth" 1"#, [at[0], at[1], z + 5.0], at, &world)
    };
    assert_near(seen_through("", r#""float alpha" 0.25"#, 0.5), [1.5; 3], 0.03, "a quarter");
    assert_near(seen_through("", r#""float alpha" 0"#, 0.5), [2.0; 3], 1e-6, "nothing there");
    let half = r#"Texture "a" "float" "checkerboard" "float uscale" 2 "float vscale" 1 "float tex1" 1 "float tex2" 0"#;
    let masked = |u| seen_through(half, r#""texture alpha" "a""#, u);
    assert_near(masked(0.25), [0.0; 3], 0.0, "the solid half");
    assert_near(masked(0.75), [2.0; 3], 1e-6, "the open half");
    // Shadows too: the lamp beneath lights what is above through three quarters of the square.
    let shadow = |alpha: f64| {
        let world = format!(
            r#"LightSource "point" "point3 from" [{x} {y} {}] "rgb I" [90 90 90]
            AttributeBegin Material "diffuse" "rgb reflectance" [0.6 0.6 0.6]
              Translate {x} {y} {} Shape "disk" "float radius" 3 AttributeEnd
            {} "float alpha" {alpha}"#,
            z + 3.0,
            z - 4.0,
            square("")
        );
        seen(None, r#""path" "integer maxdepth" 1"#, [x + 7.0, y, z - 3.0], [x, y, z - 4.0], &world)
    };
    assert_near(shadow(0.25), grey(0.75 * 90.0 / 49.0), 0.03, "a quarter of a shadow");
}

#[test]
fn normal_maps_and_displacements_tilt_what_light_falls_on() {
    // (0.6, 0, 0.8) as a colour: towards +u.
    let folder = folder_with(&[("tilt.exr", painted(2, 2, |_, _| [0.8, 0.5, 0.9]))]);
    let lit = |how: &str| {
        let world = format!(
            r#"LightSource "distant" "point3 from" [3 0 4] "point3 to" [0 0 0] "rgb L" [5 5 5] {}"#,
            square(&format!(r#"{how} "rgb reflectance" [{REFLECTANCE} {REFLECTANCE} {REFLECTANCE}]"#))
        );
        let [x, y, z] = PLACE;
        seen(
            Some(folder.path()),
            r#""path" "integer maxdepth" 1"#,
            [x + 0.7, y, z + 5.0],
            [x + 0.7, y, z],
            &world,
        )
    };
    assert_near(lit(r#"Material "diffuse""#), grey(4.0), 1e-4, "flat");
    // The light comes along the tilted normal itself.
    assert_near(lit(r#"Material "diffuse" "string normalmap" "tilt.exr""#), grey(5.0), 1e-3, "normal map");
    // A height of -3 u over a width of 4 falls by 3/4: the same normal.
    let slope = r#"Texture "h" "float" "bilerp" "float v00" 0 "float v01" 0 "float v10" -3 "float v11" -3
        Material "diffuse" "texture displacement" "h""#;
    assert_near(lit(slope), grey(5.0), 1e-3, "displacement");
}

#[test]
fn the_film_applies_its_crop_and_exposure() {
    let scene = |film: &str, camera: &str| {
        format!(
            r#"Film "rgb" "integer xresolution" 24 "integer yresolution" 16 {film}
            Sampler "sobol" "integer pixelsamples" 4
            PixelFilter "box"
            LookAt 3 -9 4  3 0 1  0 0 1
            Camera "perspective" "float fov" 50 {camera}
            WorldBegin
            LightSource "infinite" "rgb L" [0.3 0.4 0.5]
            Material "diffuse" "rgb reflectance" [0.7 0.4 0.2]
            Translate 3 0 1
            Shape "sphere" "float radius" 2"#
        )
    };
    let whole = render(None, &scene("", ""));
    let part = render(None, &scene(r#""float cropwindow" [0.25 0.75 0.5 1]"#, ""));
    let bounds = part.bounds();
    assert_eq!((bounds.x0, bounds.y0, bounds.x1, bounds.y1), (6, 8, 18, 16));
    for y in 0..8 {
        for x in 0..12 {
            assert_eq!(part.image().pixel(x, y), whole.image().pixel(x + 6, y + 8));
        }
    }
    let same = render(None, &scene(r#""integer pixelbounds" [6 18 8 16]"#, ""));
    assert_eq!(same.image().pixels(), part.image().pixels());
    let bright = whole.image().mean().to_array().map(f64::from);
    assert!(bright[2] > 0.1, "{bright:?}");
    for (film, camera, factor) in
        [(r#""float iso" 350"#, "", 3.5), ("", r#""float shutteropen" 0.5 "float shutterclose" 0.75"#, 0.25)]
    {
        let mean = render(None, &scene(film, camera)).image().mean().to_array().map(f64::from);
        assert_near(mean, bright.map(|x| factor * x), 1e-5, film);
    }
}

#[test]
fn a_scene_file_without_light_is_black() {
    let world = r#"Material "diffuse" Shape "disk" "float radius" 5"#;
    assert_eq!(seen(None, r#""path""#, [3.0, 1.0, 6.0], [2.5, 1.5, 0.0], world), [0.0; 3]);
    let text = "WorldBegin\nShape \"sphere\"";
    let scene = open(None, text);
    assert!(scene.is_dark() && scene.is_dark_by(IntegratorKind::Path { regularize: false }));
    assert!(!scene.is_dark_by(IntegratorKind::Normals) && !scene.is_dark_by(IntegratorKind::Pov));
}

#[test]
fn voxels_with_colours_of_their_own_shine_in_the_units_of_pbrt() {
    // One voxel: coefficient and radiance fall from the middle to half on the faces.
    let (absorption, radiance) = (1.5, [0.002, 0.004, 0.001]);
    let world = format!(
        r#"MakeNamedMedium "m" "string type" "rgbgrid" "point3 p0" [-1 -1 0] "point3 p1" [1 1 1]
           "rgb sigma_a" [{absorption} {absorption} {absorption}] "rgb sigma_s" [0 0 0]
           "rgb Le" [{} {} {}] "float Lescale" 2
        MediumInterface "m" "" Material "interface"
        Shape "box" "point3 p0" [-1 -1 0] "point3 p1" [1 1 1]"#,
        radiance[0], radiance[1], radiance[2]
    );
    let (mut depth, mut shine) = (0.0_f64, 0.0);
    const STEPS: u32 = 4096;
    for i in 0..STEPS {
        let share = 1.0 - ((f64::from(i) + 0.5) / f64::from(STEPS) - 0.5).abs();
        let step = absorption * share / f64::from(STEPS);
        shine += (-depth).exp() * (1.0 - (-step).exp()) * share;
        depth += step;
    }
    let found = seen(None, "\"volpath\"", [0.0, 0.0, -3.0], [0.0, 0.0, 0.0], &world);
    for (found, radiance) in found.into_iter().zip(radiance) {
        let expected = 106.856_895 * 2.0 * radiance * shine;
        assert!((found / expected - 1.0).abs() < 0.02, "{found}, expected {expected}");
    }
    // It is light of its own: the scene is not dark.
    let text = format!("WorldBegin\n{world}");
    assert!(!open(None, &text).is_dark());
    let without = text.replace("\"float Lescale\" 2", "\"float Lescale\" 0");
    assert!(open(None, &without).is_dark());
}

#[test]
fn a_square_map_has_twice_the_illuminance_asked_for_as_in_pbrt() {
    for (width, factor) in [(64, 2.0), (128, 1.0)] {
        let name = "map.pfm";
        let folder = folder_with(&[(name, Image::filled(width, 64, Rgb::splat(0.3)))]);
        let world =
            format!("LightSource \"infinite\" \"string filename\" \"{name}\" \"float illuminance\" 5");
        let found = seen(Some(folder.path()), "\"path\"", [0.0; 3], [0.0, 0.6, 1.0], &world);
        let expected = factor * 5.0 / PI;
        assert!((found[0] / expected - 1.0).abs() < 2e-3, "{width}: {found:?}, expected {expected}");
    }
}
