//! `lumbre explain` reports what the render does, in every format and language.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use crate::files::Folder;
use serde_json::Value;

use crate::program::{Desk, code, stderr, stdout};

/// A ball that is twice as wide as high, a mirror behind it, and a lamp; of one sample a pixel each.
const SCENE: &str = r#"
LookAt 0 0 -6  0 0 0  0 1 0
Camera "perspective" "float fov" 40
Film "rgb" "integer xresolution" 24 "integer yresolution" 16 "string filename" "a.pfm"
PixelFilter "box" "float xradius" 0.5 "float yradius" 0.5
Sampler "independent" "integer pixelsamples" 1
Integrator "path" "integer maxdepth" 6
WorldBegin
LightSource "infinite" "rgb L" [0.1 0.1 0.2]
LightSource "point" "point3 from" [2 4 -5] "rgb I" [30 28 25]
AttributeBegin
  AreaLightSource "diffuse" "rgb L" [4 4 4]
  Translate -2 3 0
  Shape "sphere" "float radius" 0.5
AttributeEnd
MakeNamedMaterial "clay" "string type" "diffuse" "rgb reflectance" [0.6 0.4 0.3]
NamedMaterial "clay"
AttributeBegin
  Scale 2 1 1
  Shape "sphere" "float radius" 1
AttributeEnd
Material "conductor"
Shape "disk" "float radius" 5 "float height" 4
Material "dielectric" "float eta" 1.5
Translate 0 -1.6 0
Shape "sphere" "float radius" 0.5
"#;

fn explained(desk: &Desk, arguments: &[&str]) -> Value {
    let out = desk.lumbre(&[&["explain", "a.pbrt", "--format", "json"], arguments].concat());
    assert_eq!(code(&out), 0, "{}", stderr(&out));
    serde_json::from_str(&stdout(&out)).unwrap()
}

fn list(value: &Value) -> &[Value] {
    value.as_array().map_or(&[], Vec::as_slice)
}

/// The first section with this key, at any depth.
fn section<'v>(within: &'v Value, key: &str) -> Option<&'v Value> {
    let sections = list(&within["sections"]);
    sections
        .iter()
        .find(|section| section["key"] == key)
        .or_else(|| sections.iter().find_map(|it| section(it, key)))
}

/// The value of the first quantity with this symbol or label.
fn quantity<'v>(section: &'v Value, name: &str) -> &'v Value {
    let mut quantities = list(&section["quantities"]).iter();
    let found = quantities.find(|quantity| quantity["symbol"] == name || quantity["label"] == name);
    &found.unwrap_or_else(|| panic!("no {name} in {section}"))["value"]
}

/// The pixels of a picture in PFM, from the lower left corner.
fn pfm(bytes: &[u8]) -> Vec<[f32; 3]> {
    let start = bytes.iter().enumerate().filter(|(_, byte)| **byte == b'\n').nth(2).unwrap().0 + 1;
    let numbers: Vec<f32> =
        bytes[start..].chunks(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
    numbers.chunks(3).map(|rgb| [rgb[0], rgb[1], rgb[2]]).collect()
}

#[test]
fn the_radiance_that_is_told_is_that_of_the_picture_to_the_bit() {
    let desk = Desk::new();
    desk.write("a.pbrt", SCENE);
    assert_eq!(code(&desk.lumbre(&["render", "a.pbrt", "-q", "-o", "a.pfm"])), 0);
    let pixels = pfm(&std::fs::read(desk.path("a.pfm")).unwrap());
    let mut lit = 0;
    for (x, y) in [(0, 0), (12, 8), (12, 7), (3, 3), (20, 12), (12, 13), (11, 14), (8, 8), (15, 9), (5, 1)] {
        let told = explained(&desk, &["--pixel", &format!("{x},{y}")]);
        let radiance = section(&told, "radiance").unwrap();
        let label = "radiance of this sample, as the render adds it to the pixel";
        let rgb: Vec<f32> =
            list(quantity(radiance, label)).iter().map(|x| x.as_f64().unwrap() as f32).collect();
        assert_eq!(rgb, pixels[(15 - y) * 24 + x], "({x}, {y})");
        lit += u32::from(rgb[1] > 0.0);
        // The contributions sum to it, in their order.
        let added = list(&radiance["tables"]["added"]);
        let sum = added.iter().fold([0.0_f32; 3], |sum, row| {
            std::array::from_fn(|i| sum[i] + row["added"][i].as_f64().unwrap() as f32)
        });
        assert_eq!(rgb, sum, "({x}, {y})");
    }
    assert!(lit >= 5, "{lit}");
}

#[test]
fn the_numbers_of_a_scaled_sphere_are_those_of_pencil_and_paper() {
    let desk = Desk::new();
    desk.write("a.pbrt", SCENE);
    // Along x through the ellipsoid of half-axes 2, 1, 1: in its own space the ray begins at -4 and is half as long.
    let told = explained(&desk, &["--ray", "-8,0,0,1,0,0", "--nearest"]);
    let transform = section(&told, "transform").unwrap();
    assert_eq!(quantity(transform, "O′"), &serde_json::json!([-4.0, 0.0, 0.0]));
    assert_eq!(quantity(transform, "D′"), &serde_json::json!([0.5, 0.0, 0.0]));
    assert_eq!(quantity(transform, "|D′|"), 0.5);
    assert_eq!(
        quantity(section(transform, "transform 0").unwrap(), "scale S along x, y, z"),
        &serde_json::json!([2.0, 1.0, 1.0])
    );
    let quadratic = section(&told, "Quadratic").unwrap();
    let [a, h, c] = ["a", "h", "c"].map(|symbol| quantity(quadratic, symbol).as_f64().unwrap());
    assert_eq!([a, h, c], [0.25, -2.0, 15.0]);
    assert_eq!(quantity(section(&told, "Discriminant").unwrap(), "Δ"), 0.25);
    let crossings = list(&section(&told, "crossings").unwrap()["tables"]["crossings"]);
    let t: Vec<f64> = crossings.iter().map(|row| row["t"].as_f64().unwrap()).collect();
    assert_eq!(t, [6.0, 10.0]);
    let hit = section(&told, "hit").unwrap();
    assert_eq!(quantity(hit, "P"), &serde_json::json!([-2.0, 0.0, 0.0]));
    assert_eq!(quantity(hit, "N"), &serde_json::json!([-1.0, 0.0, 0.0]));
    // The normal of an ellipsoid is not its direction from the middle: at (√2, 1/√2, 0) it is (1, 2, 0)/√5.
    let told = explained(&desk, &["--ray", "1.4142135623730951,8,0,0,-1,0", "--nearest"]);
    let normal: Vec<f64> =
        list(quantity(section(&told, "hit").unwrap(), "N")).iter().map(|x| x.as_f64().unwrap()).collect();
    let expected = [1.0 / 5.0_f64.sqrt(), 2.0 / 5.0_f64.sqrt(), 0.0];
    assert!(
        normal.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-15),
        "{normal:?}"
    );
}

#[test]
fn glass_tells_its_refraction_and_shadows_what_is_in_their_way() {
    let desk = Desk::new();
    desk.write("a.pbrt", SCENE);
    let told = explained(&desk, &["--ray", "0.25,-1.6,-3,0,0,1", "--nearest", "--depth", "2"]);
    let mirror = section(&told, "mirror").unwrap();
    let eta = quantity(mirror, "η").as_f64().unwrap();
    assert!((eta - 1.0 / 1.5).abs() < 1e-7, "{eta}");
    let vector = |name: &str| -> Vec<f64> {
        list(quantity(mirror, name)).iter().map(|x| x.as_f64().unwrap()).collect()
    };
    let (normal, refracted) = (vector("Nᵢ"), vector("Dₜ"));
    // Snell: the sines of both angles are as 1.5 to 1. The ball's normal is a quarter over a half off the axis: a sine
    // of 1/2.
    let cosine: f64 = -normal.iter().zip(&refracted).map(|(n, t)| n * t).sum::<f64>();
    assert!(((1.0 - cosine * cosine).sqrt() - 0.5 / 1.5).abs() < 1e-6, "{cosine}");
    // The rays that follow are explained too.
    assert!(section(section(&told, "vertex 1").unwrap(), "surfaces").is_some());
    // From the front the lamps are seen, from below the clay is in the way of both.
    let seen = |ray: &str| -> Vec<bool> {
        let told = explained(&desk, &["--ray", ray]);
        let lights = list(&section(&told, "lights").unwrap()["tables"]["lights"]).to_vec();
        let lamps = lights.iter().filter(|light| light["distance"].is_number());
        lamps.map(|light| light["visible"] == "yes").collect()
    };
    assert_eq!(seen("0,0.5,-6,0,0,1"), [true, true]);
    assert_eq!(seen("1,-3,0.2,0,1,0"), [false, false]);
}

/// Everything but the words.
fn numbers(section: &Value, out: &mut Vec<String>) {
    out.push(section["key"].to_string());
    for quantity in list(&section["quantities"]) {
        let value = &quantity["value"];
        let value = if value.is_string() { String::new() } else { value.to_string() };
        out.push(format!("{} {} {value}", quantity["symbol"], quantity["formula"]));
    }
    list(&section["sections"]).iter().for_each(|inner| numbers(inner, out));
}

#[test]
fn both_languages_tell_the_same_numbers() {
    let desk = Desk::new();
    desk.write("a.pbrt", SCENE);
    let tell = |lang: &str| {
        let told = explained(&desk, &["--pixel", "12,8", "--depth", "3", "--lang", lang]);
        let mut all = Vec::new();
        numbers(&told, &mut all);
        (told["title"].as_str().unwrap().to_owned(), all)
    };
    let (english, spanish) = (tell("en"), tell("es"));
    assert_eq!(english.1, spanish.1);
    assert!(english.1.len() > 50, "{}", english.1.len());
    assert_ne!(english.0, spanish.0);
}

#[test]
fn only_the_sections_that_are_asked_for_are_told() {
    let desk = Desk::new();
    desk.write("a.pbrt", SCENE);
    let whole = explained(&desk, &["--pixel", "12,8", "--nearest"]);
    let told = explained(&desk, &["--pixel", "12,8", "--nearest", "--only", "radiance,equation,Roots"]);
    let sections = list(&told["sections"]);
    assert_eq!(sections.len(), 2, "the roots are told with the equation: {told}");
    assert_eq!(Some(&sections[0]), section(&whole, "equation"));
    assert_eq!(Some(&sections[1]), section(&whole, "radiance"));
    let out = desk.lumbre(&["explain", "a.pbrt", "--pixel", "12,8", "--nearest", "--only", "Discriminant"]);
    let text = stdout(&out);
    assert!(text.starts_with("The discriminant (a quarter of the textbook's)\n  l = W − "), "{text}");
    assert_eq!(text.lines().count(), 4, "{text}");
}

#[test]
fn every_form_is_whole() {
    let desk = Desk::new();
    desk.write("a <b> & c.pbrt", SCENE);
    let tell = |format: &str| {
        let out = desk.lumbre(&[
            "explain",
            "a <b> & c.pbrt",
            "--pixel",
            "12,8",
            "--depth",
            "1",
            "--format",
            format,
        ]);
        assert_eq!(code(&out), 0, "{}", stderr(&out));
        stdout(&out)
    };
    let text = tell("text");
    assert!(text.contains("THE CAMERA") && text.contains("W·W − r²"), "{text}");
    let markdown = tell("markdown");
    for line in markdown.lines() {
        assert!(line.matches('$').count() % 2 == 0, "{line}");
        assert_eq!(line.matches('{').count(), line.matches('}').count(), "{line}");
    }
    assert!(markdown.contains("W\\cdot W - r^{2}"), "{markdown}");
    let html = tell("html");
    for tag in
        ["math", "section", "svg", "table", "msqrt", "msup", "p", "td", "figure", "g", "span", "button"]
    {
        let opened = html.matches(&format!("<{tag}>")).count() + html.matches(&format!("<{tag} ")).count();
        let closed = html.matches(&format!("</{tag}>")).count();
        assert!(opened > 0 && opened == closed, "{tag}: {opened} and {closed}");
    }
    assert!(!html.contains("<b>") && html.contains("a &lt;b&gt; &amp; c.pbrt"));
    assert!(
        !html.contains("http://")
            || html.matches("http://").count() == html.matches("http://www.w3.org").count()
    );
}

#[test]
fn what_cannot_be_explained_is_said() {
    let desk = Desk::new();
    desk.write("a.pbrt", SCENE);
    for (arguments, status, expected) in [
        (&["a.pbrt"][..], 2, "--pixel"),
        (&["a.pbrt", "--pixel", "24,0"], 2, "outside of the picture (expected less than 24,16"),
        (&["a.pbrt", "--pixel", "1"], 2, "two whole numbers"),
        (&["a.pbrt", "--ray", "1,2,3,0,0,0"], 2, "a direction other than 0,0,0"),
        (&["a.pbrt", "--ray", "1,2,3"], 2, "six numbers"),
        (&["a.pbrt", "--ray", "0,0,0,0,0,1,5,1"], 2, "the least and the greatest t"),
        (&["a.pbrt", "--pixel", "1,1", "--ray", "0,0,0,0,0,1"], 2, "cannot be used with"),
        (&["a.pbrt", "--pixel", "1,1", "-o", "a.pbrt"], 2, "a.pbrt"),
        (&["b.pbrt", "--pixel", "1,1"], 4, "b.pbrt"),
        (&["a.pbrt", "--pixel", "12,8", "--only", "hit,colour"], 2, "--only colour: no section has this key"),
        (
            &["a.pbrt", "--pixel", "12,8", "--only", "colour"],
            2,
            "camera, crossings, equation, hit, left, light, lights",
        ),
    ] {
        let out = desk.lumbre(&[&["explain"], arguments].concat());
        assert_eq!(code(&out), status, "{arguments:?}: {}", stderr(&out));
        assert!(stderr(&out).contains(expected), "{arguments:?}: {}", stderr(&out));
    }
    assert_eq!(std::fs::read_to_string(desk.path("a.pbrt")).unwrap(), SCENE);
    let out = desk.lumbre(&["explain", "a.pbrt", "--ray", "0,100,0,0,1,0", "-o", "a.txt"]);
    assert_eq!(code(&out), 0, "{}", stderr(&out));
    assert!(
        std::fs::read_to_string(desk.path("a.txt")).unwrap().contains("Nothing: the ray leaves the scene.")
    );
}

#[test]
fn names_are_text_in_markdown_and_drive_no_terminal() {
    let folder = Folder::new();
    let name = "<img src=x onerror=alert(1)><b>[x](http://a)![y](z)|$\\frac{1}{0}$ \u{1b}[31m&amp;";
    folder.write(
        "scene.pbrt",
        &format!(
            "LookAt 0 -6 2  0 0 0.5  0 0 1 Camera \"perspective\" Film \"rgb\" \"integer xresolution\" 40 \"integer yresolution\" 30 WorldBegin\n\
             LightSource \"infinite\" MakeNamedMaterial \"{name}\" \"string type\" \"diffuse\" NamedMaterial \"{name}\"\n\
             Shape \"sphere\" \"float radius\" 1.75"
        ),
    );
    let tell = |format: &str| {
        let out = folder
            .command(&["explain", "scene.pbrt", "--pixel", "20,15", "-q", "--format", format])
            .output()
            .unwrap();
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        String::from_utf8(out.stdout).unwrap()
    };
    let markdown = tell("markdown");
    assert!(markdown.contains("&lt;img src=x onerror=alert(1)&gt;&lt;b&gt;[x]&#40;http://a)"), "{markdown}");
    for active in ["<img", "<b>", "](", " $\\frac{1}"] {
        let lines = markdown.lines().filter(|line| line.contains("onerror"));
        assert!(
            lines.clone().count() > 0 && !lines.clone().any(|line| line.contains(active)),
            "{active}: {markdown}"
        );
    }
    for format in ["text", "markdown", "html", "json"] {
        let told = tell(format);
        assert!(format == "html" || told.chars().all(|c| c == '\n' || !c.is_control()), "{format}: {told:?}");
        assert!(told.contains("onerror"), "{format}");
    }
}

/// The texts of a section and of all below it.
fn texts(section: &Value, out: &mut Vec<String>) {
    for kind in ["texts", "remarks"] {
        out.extend(list(&section[kind]).iter().filter_map(|text| text.as_str().map(str::to_owned)));
    }
    list(&section["sections"]).iter().for_each(|inner| texts(inner, out));
}

fn all_texts(told: &Value) -> Vec<String> {
    let mut all = Vec::new();
    texts(told, &mut all);
    all
}

const BARE: &str = r#"LookAt 0 0 -5 0 0 0 0 1 0 Camera "perspective" "float fov" 40
Film "rgb" "integer xresolution" 40 "integer yresolution" 30 "string filename" "a.pfm" FILM
PixelFilter "box" "float xradius" 0.5 "float yradius" 0.5
Sampler "independent" "integer pixelsamples" 1
INTEGRATOR WorldBegin LightSource "infinite" "rgb L" [0.5 0.25 2]
"#;

/// A scene of shapes, with parameters of the film and an integrator.
fn bare(shapes: &str, film: &str, integrator: &str) -> String {
    BARE.replace("FILM", film).replace("INTEGRATOR", integrator) + shapes
}

#[test]
fn a_shape_that_is_missed_is_explained_and_by_how_much() {
    let desk = Desk::new();
    let shapes = r#"MakeNamedMaterial "clay" "string type" "diffuse" NamedMaterial "clay" Shape "sphere" "float radius" 1
        AttributeBegin Translate 40 0 0 Scale 2 2 2 Shape "sphere" "float radius" 1 AttributeEnd
        AttributeBegin Translate 0 0 7 Shape "trianglemesh" "point3 P" [-4 -3 0  -2 -3 0  -4 -1 0] "integer indices" [0 1 2] AttributeEnd"#;
    desk.write("a.pbrt", &bare(shapes, "", ""));
    let miss = ["--ray", "0,2,-5,0,0,1"];
    let told = explained(&desk, &miss);
    let surfaces = section(&told, "surfaces").unwrap();
    let keys: Vec<_> = list(&surfaces["sections"]).iter().map(|section| section["key"].clone()).collect();
    // The nearest first: 1, then the triangle, whose edge is from (-2, -3) to (-4, -1), then 36 beside and 2 above.
    assert_eq!(keys, ["shape 0", "shape 2", "shape 1"], "{surfaces}");
    let ball = &surfaces["sections"][0];
    let said = all_texts(ball);
    assert!(said.contains(&"It passes it at a distance of 1, nearest at t = 5.".to_owned()), "{said:?}");
    assert!(said.contains(&"The line misses it.".to_owned()), "{said:?}");
    let discriminant = section(ball, "Discriminant").unwrap();
    assert_eq!(quantity(discriminant, "Δ"), -3.0);
    let far = all_texts(&surfaces["sections"][2]);
    let distance = 1604.0_f64.sqrt() - 2.0;
    assert!(
        far.iter()
            .any(|text| text.starts_with(&format!("It passes it at a distance of {distance:.9}")[..40])),
        "{far:?}"
    );
    // Why a triangle is missed: a weight is negative.
    let triangle = section(&surfaces["sections"][1], "crossings").unwrap();
    assert!(
        triangle["tables"]["crossings"][0]["fate"].as_str().unwrap().starts_with("outside the edges"),
        "{triangle}"
    );
    // By name, by number and by material, whether it is met or not.
    for (name, expected) in [("sphere", 2), ("1", 1), ("clay", 3), ("mesh", 1)] {
        let told = explained(&desk, &[&miss[..], &["--shape", name]].concat());
        assert_eq!(list(&section(&told, "surfaces").unwrap()["sections"]).len(), expected, "{name}");
    }
    let all = explained(&desk, &["--ray", "0,0,-5,0,0,1", "--all-shapes"]);
    let sections = list(&section(&all, "surfaces").unwrap()["sections"]).to_vec();
    assert_eq!(sections.len(), 3);
    assert!(section(&sections[0], "hit").is_some() && section(&sections[1], "hit").is_none());
    // What a miss has not is no mistake.
    let out = desk.lumbre(&["explain", "a.pbrt", "--ray", "0,2,-5,0,0,1", "--only", "hit"]);
    assert_eq!((code(&out), stdout(&out).as_str()), (0, "There is no such section for this ray.\n"));
    let out = desk.lumbre(&["explain", "a.pbrt", "--ray", "0,2,-5,0,0,1", "--shape", "cone"]);
    assert_eq!(code(&out), 2);
    assert!(stderr(&out).contains("--shape cone: no shape has this number, kind or material (expected a number, or one of clay, mesh, sphere)"), "{}", stderr(&out));
}

#[test]
fn a_line_in_a_surface_or_inside_of_it_is_not_said_to_miss_it() {
    let desk = Desk::new();
    let tube = r#"Shape "cylinder" "float radius" 1 "float zmin" -1 "float zmax" 1"#;
    let cone = r#"Shape "cone" "float radius" 1 "float height" 2"#;
    let disk = r#"Shape "disk" "float radius" 2"#;
    let triangle = r#"Shape "trianglemesh" "point3 P" [0 0 0  1 0 0  0 1 0]"#;
    let patch = r#"Shape "bilinearmesh" "point3 P" [0 0 0  4 0 0  0 4 0  4 4 0]"#;
    let hyperboloid = r#"Shape "hyperboloid" "point3 p1" [1 0 -1] "point3 p2" [1 1 1]"#;
    for (shape, ray, english, spanish) in [
        (tube, "1,0,-5,0,0,1", "The ray lies in its surface", "El rayo está en su superficie"),
        (tube, "0,0,-5,0,0,1", "The ray runs inside of it", "El rayo va por dentro de ella"),
        (cone, "1,0,0,-1,0,2", "The ray lies in its surface", "El rayo está en su superficie"),
        (disk, "0,-5,0,0,1,0", "The ray lies in its surface", "El rayo está en su superficie"),
        (triangle, "-1,0.25,0,1,0,0", "The ray lies in its surface", "El rayo está en su superficie"),
        (patch, "-1,0.25,0,1,0,0", "The ray lies in its surface", "El rayo está en su superficie"),
        (hyperboloid, "1,0,-1,0,1,2", "The ray lies in its surface", "El rayo está en su superficie"),
        (tube, "2,0,-5,0,0,1", "The ray misses it.", "El rayo no la corta."),
        (disk, "3,-5,0,0,1,0", "The ray misses it.", "El rayo no la corta."),
    ] {
        desk.write("a.pbrt", &bare(shape, "", ""));
        for (language, expected) in [("en", english), ("es", spanish)] {
            let told = explained(&desk, &["--ray", ray, "--lang", language]);
            let shape = &section(&told, "surfaces").unwrap()["sections"][0];
            let said = all_texts(shape);
            assert!(said.iter().any(|text| text.starts_with(expected)), "{ray}: {said:?}");
            let misses = said.iter().any(|text| text.contains("misses"));
            assert_eq!(misses, language == "en" && english.contains("misses"), "{ray}: {said:?}");
        }
    }
}

#[test]
fn csg_intervals_cover_the_line_and_operands_have_names() {
    let desk = Desk::new();
    let shapes = r#"ObjectBegin "ball" Translate 0 0 -2 Shape "sphere" "float radius" 1.5 ObjectEnd
        ObjectBegin "block" Translate 0 0 0.5 Shape "box" "point3 p0" [-1 -1 -1] "point3 p1" [1 1 1] ObjectEnd
        Shape "csg" "string operation" "union" "string operands" ["ball" "block"]"#;
    desk.write("a.pbrt", &bare(shapes, "", ""));
    // The ray begins in the gap, or behind both: the intervals are the same.
    for (start, shift) in [("0,0,0", 0.0), ("0,0,-0.5", 0.5), ("0,0,5", -5.0)] {
        let told = explained(&desk, &["--ray", &format!("{start},0,0,1"), "--all-shapes"]);
        let intervals = section(&told, "Intervals").unwrap();
        let expected = [[-3.5 + shift, -0.5 + shift], [-0.5 + shift, 1.5 + shift]];
        assert_eq!(quantity(intervals, "I₁"), &serde_json::json!([expected[0]]), "{start}");
        assert_eq!(quantity(intervals, "I₂"), &serde_json::json!([expected[1]]), "{start}");
        assert_eq!(quantity(intervals, "I"), &serde_json::json!([[-3.5 + shift, 1.5 + shift]]), "{start}");
    }
    let told = explained(&desk, &["--ray", "0,0,-9,0,0,1", "--all-shapes", "--lang", "es"]);
    let titles = told.to_string();
    assert!(titles.contains("Operando 0, esfera") && titles.contains("operando 1 (caja)"), "{titles}");
}

#[test]
fn u_and_v_of_a_mesh_are_those_of_its_file() {
    let desk = Desk::new();
    let shapes = r#"Shape "trianglemesh" "point3 P" [0 0 0  1 0 0  0 1 0] "integer indices" [0 1 2] "point2 uv" [0 0  10 0  0 20]"#;
    desk.write("a.pbrt", &bare(shapes, "", ""));
    let told = explained(&desk, &["--ray", "0.125,0.5,-5,0,0,1", "--nearest"]);
    let hit = section(&told, "hit").unwrap();
    assert_eq!(quantity(hit, "u, v"), &serde_json::json!([1.25, 10.0]));
    assert_eq!(quantity(hit, "b₁, b₂ (barycentric coordinates)"), &serde_json::json!([0.125, 0.5]));
    // Flat and curved patches, under a map that mirrors: the corners of the file, and its own uv.
    for (height, told_corners) in [(0.0, 3), (1.0, 4)] {
        let shapes = format!(
            r#"Translate 0 0 3 Scale -2 1 1 Shape "bilinearmesh" "point3 P" [0 0 0  1 0 0  0 1 0  1 1 {height}] "integer indices" [0 1 2 3] "point2 uv" [0 0  4 0  0 8  4 8]"#
        );
        desk.write("a.pbrt", &bare(&shapes, "", ""));
        let told = explained(&desk, &["--ray", "-0.5,0.5,-5,0,0,1", "--nearest"]);
        let mesh = section(&told, "mesh").unwrap();
        assert_eq!(quantity(mesh, "F₁"), &serde_json::json!([1.0, 0.0, 0.0]));
        assert_eq!(quantity(mesh, "u, v (F₃)"), &serde_json::json!([4.0, 8.0]));
        assert_eq!(quantity(mesh, "M")[0], serde_json::json!([-2.0, 0.0, 0.0, 0.0]));
        let uv: Vec<f64> = list(quantity(section(&told, "hit").unwrap(), "u, v"))
            .iter()
            .map(|x| x.as_f64().unwrap())
            .collect();
        assert!((uv[0] - 1.0).abs() < 1e-6 && (uv[1] - 4.0).abs() < 1e-6, "{uv:?}");
        let said = all_texts(mesh);
        assert_eq!(said.iter().any(|text| text.contains("two triangles")), told_corners == 3, "{said:?}");
        assert!(said.iter().any(|text| text.contains("M mirrors")), "{said:?}");
    }
}

#[test]
fn the_radiance_is_told_as_the_film_adds_it() {
    let desk = Desk::new();
    let ball = r#"Material "diffuse" "rgb reflectance" [0.5 0.5 0.5] Shape "sphere" "float radius" 1"#;
    for film in [r#""float iso" 250"#, r#""float iso" 400 "float maxcomponentvalue" 1.5"#] {
        desk.write("a.pbrt", &bare(ball, film, ""));
        assert_eq!(code(&desk.lumbre(&["render", "a.pbrt", "-q", "-o", "a.pfm"])), 0);
        let pixels = pfm(&std::fs::read(desk.path("a.pfm")).unwrap());
        for (x, y) in [(20, 15), (0, 0)] {
            let told = explained(&desk, &["--pixel", &format!("{x},{y}")]);
            let radiance = section(&told, "radiance").unwrap();
            let label = "radiance of this sample, as the render adds it to the pixel";
            let rgb: Vec<f32> =
                list(quantity(radiance, label)).iter().map(|x| x.as_f64().unwrap() as f32).collect();
            assert_eq!(rgb, pixels[(29 - y) * 40 + x], "{film} ({x}, {y})");
            // What the path adds up to is that before the film.
            let sum: Vec<f32> = list(&radiance["tables"]["added"]).iter().fold(vec![0.0; 3], |sum, row| {
                (0..3).map(|i| sum[i] + row["added"][i].as_f64().unwrap() as f32).collect()
            });
            let before: Vec<f32> =
                list(quantity(radiance, "Lₛ")).iter().map(|x| x.as_f64().unwrap() as f32).collect();
            assert_eq!(before, sum, "{film}");
        }
    }
}

#[test]
fn what_is_no_light_and_no_surface_is_not_called_so() {
    let desk = Desk::new();
    let ball = r#"Material "diffuse" Shape "sphere" "float radius" 1"#;
    for (integrator, expected) in [
        ("normals", "the shading normal as a colour, (n + 1)/2"),
        ("ambientocclusion", "1 where nothing near is in that direction, else 0"),
    ] {
        desk.write("a.pbrt", &bare(ball, "", &format!("Integrator \"{integrator}\"")));
        let told = explained(&desk, &["--pixel", "20,15"]);
        let added = section(section(&told, "light").unwrap(), "added").unwrap();
        assert_eq!(added["title"], expected);
        assert!(!added.to_string().contains("light"), "{added}");
    }
    // In a medium there is no cosine.
    let fog = r#"MakeNamedMedium "fog" "string type" "homogeneous" "rgb sigma_a" [0.01 0.01 0.01] "rgb sigma_s" [9 9 9]
        LightSource "point" "point3 from" [2 4 -5] "rgb I" [30 30 30]
        MediumInterface "fog" "" Material "interface" Shape "sphere" "float radius" 1"#;
    desk.write("a.pbrt", &bare(fog, "", r#"Integrator "path" "integer maxdepth" 8"#));
    let mut phases = 0;
    for sample in 0..12 {
        let told = explained(&desk, &["--pixel", "20,15", "--sample", &sample.to_string()]);
        let said = told.to_string();
        assert!(!said.contains("|cos θ|"), "{said}");
        phases += said.matches("phase function towards it").count();
    }
    assert!(phases > 5, "{phases}");
}

#[test]
fn whitteds_rays_are_told_as_a_tree() {
    let desk = Desk::new();
    let glass = r#"Material "dielectric" "float eta" 1.5 Shape "sphere" "float radius" 1
        Material "diffuse" Translate 0 0 4 Shape "disk" "float radius" 3"#;
    desk.write("a.pbrt", &bare(glass, "", r#"Integrator "whitted" "integer maxdepth" 4"#));
    let told = explained(&desk, &["--ray", "0.3,0.2,-5,0,0,1"]);
    let light = section(&told, "light").unwrap();
    // One root, which has two branches: what is reflected leaves the scene, what is refracted meets the back.
    let roots: Vec<_> = list(&light["sections"]).iter().map(|section| section["key"].clone()).collect();
    assert_eq!(roots, ["vertex 0", "radiance"]);
    let branches: Vec<_> = list(&light["sections"][0]["sections"])
        .iter()
        .map(|section| section["key"].as_str().unwrap().to_owned())
        .filter(|key| key.starts_with("vertex") || key == "left")
        .collect();
    assert_eq!(branches.len(), 2, "{branches:?}");
    assert!(
        branches.contains(&"vertex 1".to_owned()) && branches.contains(&"left".to_owned()),
        "{branches:?}"
    );
}

#[test]
fn the_matrices_of_the_camera_lead_back_to_the_pixel() {
    let desk = Desk::new();
    for (look, hand) in
        [("LookAt 0 0 -5 0 0 0 0 1 0", "with the other hand"), ("Scale -1 1 1 LookAt 0 0 -5 0 0 0 0 1 0", "")]
    {
        let scene = bare(r#"Shape "sphere""#, "", "").replace("LookAt 0 0 -5 0 0 0 0 1 0", look);
        desk.write("a.pbrt", &scene);
        let told = explained(&desk, &["--pixel", "7,22"]);
        let camera = section(&told, "camera").unwrap();
        let place = |label: &str| -> Vec<f64> {
            list(quantity(camera, label)).iter().map(|x| x.as_f64().unwrap()).collect()
        };
        let forth = place("point of the film, in pixels from the upper left corner");
        let back = place("point of the film, in pixels from the upper left corner, y downwards");
        assert!(forth.iter().zip(&back).all(|(x, y)| (x - y).abs() < 1e-5), "{forth:?} {back:?}");
        let [u, v, w] = ["e₁", "e₂", "e₃"].map(place);
        let turn = (u[1] * v[2] - u[2] * v[1]) * w[0]
            + (u[2] * v[0] - u[0] * v[2]) * w[1]
            + (u[0] * v[1] - u[1] * v[0]) * w[2];
        let said = all_texts(camera);
        let expected = if turn > 0.0 { "has the same hand" } else { "camera space is left-handed" };
        assert!(said.iter().any(|text| text.contains(expected)), "{hand}: {said:?}");
    }
}

#[test]
fn light_comes_in_steps_with_their_own_numbers() {
    let desk = Desk::new();
    desk.write("a.pbrt", SCENE);
    // The lamp's light thins out with the square of the distance, and hits the ball at an angle.
    for sample in 0..16 {
        let told = explained(&desk, &["--pixel", "12,6", "--sample", &sample.to_string()]);
        let Some(light) = section(&told, "sampled light") else { continue };
        let symbols: Vec<_> = list(&light["quantities"]).iter().map(|q| q["symbol"].clone()).collect();
        if !symbols.contains(&"d".into()) {
            continue;
        }
        let numbers = |name: &str| -> Vec<f64> {
            match quantity(light, name) {
                Value::Array(all) => all.iter().map(|x| x.as_f64().unwrap()).collect(),
                one => vec![one.as_f64().unwrap(); 3],
            }
        };
        let (d, intensity, arriving) = (numbers("d"), numbers("Iₗ"), numbers("Lᵢ"));
        for i in 0..3 {
            assert!((intensity[i] / (d[i] * d[i]) - arriving[i]).abs() < 1e-6 * arriving[i]);
            assert!(
                (intensity[i] / intensity[0] - [1.0, 28.0 / 30.0, 25.0 / 30.0][i]).abs() < 1e-6,
                "{intensity:?}"
            );
        }
        // A Lambertian surface scatters its reflectance over π.
        let bsdf = numbers("f");
        for i in 0..3 {
            assert!((bsdf[i] - [0.6, 0.4, 0.3][i] / std::f64::consts::PI).abs() < 1e-6, "{bsdf:?}");
        }
        // The glass below has a Fresnel reflectance of (0.5 / 2.5)² where the ray is straight.
        let told = explained(&desk, &["--ray", "0,-1.6,-3,0,0,1", "--nearest"]);
        let reflectance = quantity(section(&told, "mirror").unwrap(), "Fᵣ").as_f64().unwrap();
        assert!((reflectance - 0.04).abs() < 1e-7, "{reflectance}");
        return;
    }
    panic!("the lamp was never sampled");
}

/// The symbols of a formula: a letter or a word, with its primes and subscripts.
fn symbols(formula: &str) -> Vec<String> {
    let is_low = |c: char| ('₀'..='ₜ').contains(&c) || ['ᵢ', 'ᵣ', 'ᵤ', 'ᵥ', 'ⱼ', '′'].contains(&c);
    let is_raised = |c: char| ['ᵀ', '⁻', 'ⁿ', '²', '³', '¹'].contains(&c);
    let mut found = Vec::new();
    let mut word = String::new();
    for c in formula.chars().chain([' ']) {
        if c.is_alphabetic() && !is_low(c) && !is_raised(c) && !word.ends_with(is_low)
            || is_low(c) && !word.is_empty()
        {
            word.push(c);
            continue;
        }
        found.extend(Some(std::mem::take(&mut word)).filter(|word| !word.is_empty()));
        if c.is_alphabetic() && !is_low(c) && !is_raised(c) {
            word.push(c);
        }
    }
    found
}

/// A symbol with its meaning, and the formulas that it stands in, in the order of a page.
fn meanings(section: &Value, out: &mut Vec<(String, String, String)>) {
    for quantity in list(&section["quantities"]) {
        let text = |name: &str| quantity[name].as_str().unwrap_or_default().to_owned();
        out.push((text("symbol"), text("label"), text("formula")));
    }
    list(&section["sections"]).iter().for_each(|inner| meanings(inner, out));
}

/// The sections with a key, at any depth.
fn sections_called<'v>(section: &'v Value, key: &str, out: &mut Vec<&'v Value>) {
    for inner in list(&section["sections"]) {
        if inner["key"] == key { out.push(inner) } else { sections_called(inner, key, out) }
    }
}

/// The same explanation without the equations of shapes.
fn without_equations(section: &Value) -> Value {
    let mut copy = section.clone();
    let inner = list(&section["sections"]).iter().filter(|inner| inner["key"] != "equation");
    copy["sections"] = inner.map(without_equations).collect();
    copy
}

#[test]
fn a_symbol_has_one_meaning_and_is_defined_before_its_use() {
    let desk = Desk::new();
    let glass = r#"Material "dielectric""#;
    let lamp = r#"LightSource "point" "point3 from" [0 3 -5] AttributeBegin AreaLightSource "diffuse" Translate 3 3 -4
        Shape "sphere" AttributeEnd Material "diffuse" Translate 0 0 9 Shape "disk" "float radius" 30 Translate 0 0 -9"#;
    let pages = DRAWN.iter().map(|(shape, ray, _, _)| {
        let shapes = format!("{lamp} {glass} AttributeBegin {shape} AttributeEnd");
        let near = format!("{lamp} AttributeBegin {shape} AttributeEnd");
        [(shapes, vec!["--ray", *ray, "--depth", "2"]), (near, vec!["--pixel", "20,15", "--all-shapes"])]
    });
    for (shapes, arguments) in pages.flatten() {
        desk.write("a.pbrt", &bare(&shapes, r#""float iso" 250"#, ""));
        let told = explained(&desk, &arguments);
        let context = format!("{shapes} {arguments:?}");
        let mut page = Vec::new();
        meanings(&without_equations(&told), &mut page);
        // The ray, its t, the point and its normal are what they are elsewhere.
        let shared = ["O", "D", "O′", "D′", "P", "N", "P′", "N′", "t", "u", "v"];
        let mut equations = Vec::new();
        sections_called(&told, "equation", &mut equations);
        assert!(!equations.is_empty(), "{context}");
        for equation in equations {
            let mut own = Vec::new();
            meanings(equation, &mut own);
            for (symbol, label, formula) in own.iter().filter(|(symbol, ..)| !symbol.is_empty()) {
                assert!(!label.is_empty() || !formula.is_empty(), "{symbol} is not defined: {context}");
                let is_shared = shared.contains(&symbol.as_str());
                let elsewhere = page.iter().find(|(other, ..)| other == symbol && !is_shared);
                assert!(elsewhere.is_none(), "{symbol} is {label} {formula} and {elsewhere:?}: {context}");
            }
            // A capsule is three shapes, and a plane cuts each end of a cone. On a patch, u is that of a ruling, then
            // that of a crossing.
            if ["capsule", "csg", "bilinear"].iter().any(|kind| shapes.contains(kind)) {
                continue;
            }
            for (i, (symbol, label, formula)) in own.iter().enumerate() {
                let is_repeated = ["μ", "δ", "t", "P", "det", "b₁", "b₂"].contains(&symbol.as_str());
                let other =
                    own[..i].iter().find(|(other, ..)| other == symbol && !is_repeated && !symbol.is_empty());
                assert!(other.is_none(), "{symbol} is {label} {formula} and {other:?}: {context}");
            }
        }
        let mut all = Vec::new();
        meanings(&told, &mut all);
        let mut defined: Vec<String> = ["O", "D", "M", "min", "max"].map(str::to_owned).to_vec();
        for (symbol, label, formula) in all {
            let unknown = symbols(&formula).into_iter().find(|one| !defined.contains(one));
            assert!(
                unknown.is_none(),
                "{unknown:?} of {symbol} = {formula} ({label}): {defined:?} {context}"
            );
            defined.push(symbol);
        }
    }
}

#[test]
fn an_equation_that_holds_to_its_digits_only_is_nearly_one() {
    let desk = Desk::new();
    desk.write("a.pbrt", &bare(r#"Shape "sphere" "float radius" 1"#, "", ""));
    let out = stdout(&desk.lumbre(&[
        "explain",
        "a.pbrt",
        "--ray",
        "-3,0.6,0,2,0,0",
        "--only",
        "Discriminant,Roots",
    ]));
    // 8.36/7.6 is 1.1, and the discriminant of the textbook 10.24.
    for line in [
        "Δ = a·(r² − l·l) = 4·(1² − (0, 0.6, 0)·(0, 0.6, 0)) = 2.56",
        "b² − 4·a·c = (-12)² − 4·4·8.36 ≈ 10.24000000000000",
        "t₁ = c/q = 8.36/7.6 ≈ 1.09999999999999",
        "t₂ = q/a = 7.6/4 = 1.9",
    ] {
        assert!(out.contains(line), "{line}: {out}");
    }
}

#[test]
fn roulette_and_the_next_direction_come_in_steps() {
    let desk = Desk::new();
    let room = r#"AreaLightSource "diffuse" Material "diffuse" "rgb reflectance" [0.875 0.5 0.25]
        Shape "sphere" "float radius" 3"#;
    desk.write("a.pbrt", &bare(room, "", r#"Integrator "path" "integer maxdepth" 40"#));
    let vector = |section: &Value, name: &str| -> Vec<f64> {
        match quantity(section, name) {
            Value::Array(all) => all.iter().map(|x| x.as_f64().unwrap()).collect(),
            one => vec![one.as_f64().unwrap(); 3],
        }
    };
    let is_close = |a: f64, b: f64| (a - b).abs() <= 1e-3 * b.abs();
    let mut survived = 0;
    for sample in 0..16 {
        let told =
            explained(&desk, &["--ray", "0,0,0,0,0,1", "--sample", &sample.to_string(), "--only", "light"]);
        for vertex in list(&told["sections"][0]["sections"]) {
            let Some(next) = section(vertex, "scattered") else { continue };
            let symbols: Vec<&Value> = list(&vertex["quantities"]).iter().map(|one| &one["symbol"]).collect();
            let is_after = symbols.contains(&&Value::from("βᵣ"));
            let mut before = vector(vertex, "β");
            if is_after {
                let (probability, after) = (vector(vertex, "pᵣ")[0], vector(vertex, "βᵣ"));
                assert!(before.iter().zip(&after).all(|(b, a)| is_close(*a, b / probability)), "{vertex}");
                before = after;
                survived += 1;
            }
            // f is the reflectance over π, and the density of the direction |cos θ|/π.
            let (f, cosine, density) = (vector(next, "f"), vector(next, "cₛ")[0], vector(next, "pₛ")[0]);
            assert!(is_close(f[1], 0.5 / std::f64::consts::PI), "{next}");
            assert!(is_close(density, cosine / std::f64::consts::PI), "{next}");
            let (kept, carried) = (vector(next, "α"), vector(next, "β′"));
            for i in 0..3 {
                assert!(is_close(kept[i], f[i] * cosine / density), "{next}");
                assert!(is_close(carried[i], before[i] * kept[i]), "{next}");
            }
        }
    }
    assert!(survived >= 3, "{survived}");
}

#[test]
fn rounded_numbers_in_a_formula_are_nearly_equal() {
    let desk = Desk::new();
    desk.write("a.pbrt", &bare(r#"Shape "sphere" "float radius" 1"#, "", ""));
    let out = stdout(&desk.lumbre(&["explain", "a.pbrt", "--ray", "0,0,-5,0,0,1", "--only", "Quadratic"]));
    assert!(out.contains("h = W·D = (0, 0, -5)·(0, 0, 1) = -5\n"), "{out}");
    let out =
        stdout(&desk.lumbre(&["explain", "a.pbrt", "--ray", "0,0.1234567,-5,0,0,1", "--only", "Quadratic"]));
    assert!(out.contains("c = W·W − r² ≈ (0, 0.123457, -5)·(0, 0.123457, -5) − 1² ≈ 24."), "{out}");
}

#[test]
fn kinds_and_mistakes_are_told_in_spanish() {
    let desk = Desk::new();
    desk.write("a.pbrt", SCENE);
    let told = explained(&desk, &["--pixel", "12,8", "--lang", "es", "--depth", "2"]).to_string();
    assert!(
        told.contains(", esfera") && told.contains("clay (difuso)") && told.contains("(puntual)"),
        "{told}"
    );
    for english in ["sphere", "disk", "dielectric", "(diffuse)", "(point)"] {
        assert!(
            !told.contains(&format!("\"{english}")) && !told.contains(&format!(", {english}")),
            "{english}: {told}"
        );
    }
    let out = desk.lumbre(&["explain", "a.pbrt", "--pixel", "99,0", "--lang", "es"]);
    assert!(
        stderr(&out).contains("--pixel 99,0: fuera de la imagen (se esperaba menos de 24,16"),
        "{}",
        stderr(&out)
    );
    let out = desk.lumbre(&["explain", "a.pbrt", "--pixel", "1,0", "--only", "colour", "--lang", "es"]);
    assert!(stderr(&out).contains("--only colour: ninguna sección tiene esta clave"), "{}", stderr(&out));
    // Parameters, and shapes by their names in Spanish.
    assert!(told.contains("reflectancia (reflectance)"), "{told}");
    let out = desk.lumbre(&["explain", "a.pbrt", "--ray", "0,9,0,0,0,1", "--shape", "disco", "--lang", "es"]);
    assert!(stdout(&out).contains("forma 3, disco") || stdout(&out).contains(", disco"), "{}", stdout(&out));
    let out = desk.lumbre(&["explain", "a.pbrt", "--ray", "0,9,0,0,0,1", "--shape", "cubo", "--lang", "es"]);
    assert!(stderr(&out).contains("clay, disco, esfera"), "{}", stderr(&out));
    // Files.
    let out = desk.lumbre(&["explain", "b.pbrt", "--pixel", "1,0", "--lang", "es"]);
    assert!(stderr(&out).contains("b.pbrt: no se puede abrir: no existe"), "{}", stderr(&out));
    desk.write("b.pbrt", r#"WorldBegin Shape "sphere" "float radio" 2"#);
    let out = desk.lumbre(&["explain", "b.pbrt", "--ray", "0,0,-5,0,0,1", "--lang", "es"]);
    let warned = stderr(&out);
    assert!(
        warned.contains("aviso: b.pbrt:1:27: parámetro desconocido \"radio\" de la forma \"sphere\""),
        "{warned}"
    );
    assert!(warned.ends_with("1 aviso\n"), "{warned}");
}

/// The page of an explanation.
fn page(desk: &Desk, arguments: &[&str]) -> String {
    let out = desk.lumbre(&[&["explain", "a.pbrt", "--format", "html"], arguments].concat());
    assert_eq!(code(&out), 0, "{}", stderr(&out));
    stdout(&out)
}

/// The pictures of a kind on a page, each from its beginning to its end.
fn pictures<'p>(page: &'p str, class: &str) -> Vec<&'p str> {
    let begin = format!("<svg class=\"{class}\"");
    page.split(&begin).skip(1).map(|rest| rest.split("</svg>").next().unwrap()).collect()
}

/// The number of an attribute in an element.
fn number(element: &str, name: &str) -> f64 {
    attribute(element, name).parse().unwrap_or_else(|_| panic!("{name} in {element}"))
}

fn attribute<'e>(element: &'e str, name: &str) -> &'e str {
    let begin = format!(" {name}=\"");
    let rest = element.split_once(&begin).unwrap_or_else(|| panic!("no {name} in {element}")).1;
    rest.split('"').next().unwrap()
}

/// Shapes, a ray, and the labels that its sketches have; every shape that has an F, and others.
const DRAWN: [(&str, &str, &[&str], &[&str]); 14] = [
    (
        r#"Shape "sphere" "float radius" 1.5"#,
        "0.5,0.3,-5,0,0,1",
        &["O", "O + t·D", "C", "r", "t₁", "t₂", "N"],
        &[],
    ),
    (
        r#"Translate 0.5 0 0 Scale 2 1 1 Shape "sphere""#,
        "-6,0.3,0.2,1,0,0",
        &["O", "O + t·D", "M C", "t₁", "t₂", "N"],
        &["O′", "O′ + t·D′", "C", "r", "t₁", "t₂", "N′"],
    ),
    (
        r#"Shape "cylinder" "float radius" 1"#,
        "-4,0.3,0.2,1,0,0.1",
        &["O", "P₁", "P₂", "r₁", "t₁", "t₂", "N"],
        &[],
    ),
    (
        r#"Shape "cone" "float radius" 1.5 "float height" 2"#,
        "-4,0.3,0.5,1,0,0.05",
        &["O", "P₁", "P₂", "r₁", "t₁", "t₂", "N"],
        &[],
    ),
    (r#"Shape "paraboloid" "float radius" 1"#, "-4,0.2,0.5,1,0,0", &["O", "r", "t₁", "t₂", "N"], &[]),
    (
        r#"Shape "hyperboloid" "point3 p1" [1 0 0] "point3 p2" [1 1 1.5]"#,
        "-4,0.2,0.5,1,0,0",
        &["O", "P₁", "P₂", "t₁", "t₂", "N"],
        &[],
    ),
    (
        r#"Shape "torus" "float majorradius" 2 "float minorradius" 0.5"#,
        "-5,0.3,0.1,1,0,0",
        &["O", "C", "R", "r", "t₁", "t₂", "t₃", "t₄", "N"],
        &[],
    ),
    (
        r#"Shape "box" "point3 p0" [-1 -1 -1] "point3 p1" [1 1 1]"#,
        "-5,0.3,0.1,1,0.1,0",
        &["O", "P₀", "P₁", "t₁", "t₂", "N"],
        &[],
    ),
    (
        r#"Shape "capsule" "point3 p0" [0 0 -1] "point3 p1" [0 0.5 1]"#,
        "-5,0.3,0.1,1,0.05,0.1",
        &["O", "P₁", "P₂", "r₁", "t₁", "t₂", "N"],
        &[],
    ),
    (r#"Shape "plane""#, "-5,0.3,2,1,0.1,-0.5", &["O", "P₀", "t", "N"], &[]),
    (r#"Shape "disk" "float radius" 900"#, "-5,0.3,2,1,0.1,-0.5", &["O", "t", "N"], &[]),
    (
        r#"Shape "bilinearmesh" "point3 P" [-1 -1 0  1 -1 1  -1 1 1  1 1 -0.5]"#,
        "0.2,0.3,5,0,0.1,-1",
        &["O", "P₀₀", "P₁₀", "P₀₁", "P₁₁", "t₁", "N"],
        &[],
    ),
    (
        r#"Shape "trianglemesh" "point3 P" [-1 -1 0  1 -1 1  -1 1 1]"#,
        "-0.2,-0.3,5,0,0.1,-1",
        &["O", "P₀", "P₁", "P₂", "t", "N"],
        &[],
    ),
    (
        r#"ObjectBegin "a" Shape "sphere" ObjectEnd ObjectBegin "b" Translate 0.8 0 0 Shape "sphere" ObjectEnd
           Shape "csg" "string operation" "difference" "string operands" ["a" "b"]"#,
        "-5,0.1,0.3,1,0,0",
        &["O", "O + t·D", "t = 4.051", "N"],
        &[],
    ),
];

/// The labels of a picture with the boxes that they are in, by the width that a letter has at most.
fn labels(picture: &str) -> Vec<(String, [f64; 4])> {
    let texts = picture.split("<text ").skip(1);
    let labels = texts.filter(|text| !text.starts_with("class=\"name\""));
    labels
        .map(|text| {
            let text = format!(" {text}");
            let content = text.split_once('>').unwrap().1.split('<').next().unwrap().to_owned();
            let (x, y) = (number(&text, "x"), number(&text, "y"));
            let half = 4.3 * content.chars().count() as f64;
            (content, [x - half, y - 11.0, x + half, y + 3.9])
        })
        .collect()
}

/// All points of the lines of a picture.
fn points(picture: &str) -> Vec<[f64; 2]> {
    let lines = picture.split("<polyline points=\"").skip(1).map(|rest| rest.split('"').next().unwrap());
    let pairs = lines.flat_map(|line| line.split(' '));
    let point = |pair: &str| {
        let (x, y) = pair.split_once(',').unwrap();
        [x.parse().unwrap(), y.parse().unwrap()]
    };
    pairs.map(point).collect()
}

#[test]
fn sketches_have_their_labels_clear_of_each_other_and_inside() {
    let desk = Desk::new();
    for (shape, ray, world, object) in DRAWN {
        desk.write("a.pbrt", &bare(&format!("AttributeBegin {shape} AttributeEnd"), "", ""));
        let page = page(&desk, &["--ray", ray]);
        let sketches = pictures(&page, "sketch");
        assert_eq!(sketches.len(), if object.is_empty() { 1 } else { 2 }, "{shape}");
        for (sketch, expected) in sketches.iter().zip([world, object]) {
            let [width, height] = [number(sketch, "width"), number(sketch, "height")];
            let found = labels(sketch);
            for label in expected {
                assert_eq!(
                    found.iter().filter(|(text, _)| text == label).count(),
                    1,
                    "{label} of {shape}: {found:?}"
                );
            }
            for (i, (text, [left, top, right, bottom])) in found.iter().enumerate() {
                let is_inside = *left >= 0.0 && *top >= 0.0 && *right <= width && *bottom <= height;
                assert!(is_inside, "{text} of {shape} is at {left}, {top}");
                for (other, [l, t, r, b]) in &found[..i] {
                    let overlaps = l < right && left < r && t < bottom && top < b;
                    // The letters of the axes are in a corner of their own.
                    let are_axes =
                        [text, other].iter().all(|label| ["x", "y", "z"].contains(&label.as_str()));
                    assert!(!overlaps || are_axes, "{text} and {other} of {shape}");
                }
            }
            let points = points(sketch);
            assert!(points.len() > 8, "{shape}");
            for [x, y] in points {
                assert!((0.0..=width).contains(&x) && (0.0..=height).contains(&y), "{x}, {y} of {shape}");
            }
        }
    }
}

#[test]
fn roots_are_marked_at_the_numbers_that_are_told() {
    let desk = Desk::new();
    for (shape, ray, _, _) in DRAWN {
        desk.write("a.pbrt", &bare(&format!("AttributeBegin {shape} AttributeEnd"), "", ""));
        let page = page(&desk, &["--ray", ray]);
        let plots = pictures(&page, "plot");
        assert_eq!(plots.len(), 1, "{shape}");
        let [from, to, left, right] =
            ["data-from", "data-to", "data-left", "data-right"].map(|name| number(plots[0], name));
        let marks = plots[0].split("<g class=\"mark").skip(1);
        let marks: Vec<f64> = marks
            .map(|mark| {
                let t = number(mark, "data-t");
                let (x, y) = (number(mark, "cx"), number(mark, "cy"));
                assert!(
                    (x - (left + (t - from) / (to - from) * (right - left))).abs() < 0.01,
                    "{shape}: {t} at {x}"
                );
                assert!((y - number(plots[0], "data-zero")).abs() < 0.01, "{shape}: {t} at {y}");
                t
            })
            .collect();
        let told = explained(&desk, &["--ray", ray]);
        let crossings = list(&section(&told, "crossings").unwrap()["tables"]["crossings"]);
        // Of an operand come the crossings of that first.
        let mut expected: Vec<f64> = crossings.iter().map(|row| row["t"].as_f64().unwrap()).collect();
        expected.dedup();
        if !shape.contains("csg") {
            assert_eq!(marks, expected, "{shape}");
        }
        let hits =
            list(&told["sections"][1]["sections"][0]["sections"]).iter().filter(|it| it["key"] == "hit");
        let hits: Vec<f64> = hits.map(|hit| quantity(hit, "t").as_f64().unwrap()).collect();
        assert!(!hits.is_empty() && hits.iter().all(|t| marks.contains(t)), "{shape}: {hits:?} in {marks:?}");
        // The slider goes over the same t.
        let slider = page.split_once("type=\"range\"").unwrap().1;
        assert_eq!([number(slider, "min"), number(slider, "max")], [from, to], "{shape}");
    }
}

#[test]
fn what_is_up_is_up_in_the_sketch_and_a_floor_does_not_fill_it() {
    let desk = Desk::new();
    for (look, up) in [("0 -5 1 0 0 1 0 0 1", "z"), ("0 1 -5 0 1 0 0 1 0", "y")] {
        // The last ray goes straight down.
        for ray in ["-5,0.3,2,1,0.1,-0.5", "0.5,-4,3,0.2,1,-0.6", "0.5,0.2,8,0,0,-1"] {
            let shapes = r#"Shape "disk" "float radius" 5000"#;
            desk.write("a.pbrt", &bare(shapes, "", "").replace("0 0 -5 0 0 0 0 1 0", look));
            let page = page(&desk, &["--ray", ray]);
            let sketch = pictures(&page, "sketch")[0];
            let axis =
                sketch.split("<line ").find(|line| line.starts_with(&format!("data-axis=\"{up}\""))).unwrap();
            let axis = format!(" {axis}");
            let rise = number(&axis, "y1") - number(&axis, "y2");
            assert!(
                rise > 10.0 && (number(&axis, "x1") - number(&axis, "x2")).abs() < 0.5 * rise,
                "{up}: {axis}"
            );
            // The crossing is in the middle of the picture, and the ray is as long as half of it.
            let mark = |class: &str| sketch.split(&format!("<g class=\"mark {class}\"")).nth(1).unwrap();
            let ([x, y], [ox, oy]) = (
                ["cx", "cy"].map(|name| number(mark("crossing"), name)),
                ["cx", "cy"].map(|name| number(mark("origin"), name)),
            );
            assert!((100.0..320.0).contains(&x) && (60.0..250.0).contains(&y), "{x}, {y} along {ray}");
            assert!((x - ox).hypot(y - oy) > 100.0, "from {ox}, {oy} to {x}, {y} along {ray}");
        }
    }
}

#[test]
fn marks_light_up_and_sliders_wait_for_the_script() {
    let desk = Desk::new();
    desk.write("a.pbrt", SCENE);
    let page = page(&desk, &["--pixel", "12,8"]);
    for key in ["O", "D", "O′", "C", "r", "t₁", "t₂"] {
        let marked = page.matches(&format!("data-mark=\"{key}\"")).count();
        // In a sketch, in a rule, and in a formula at least.
        assert!(marked >= 4, "{key}: {marked}");
        assert!(
            page.contains(&format!(
                ".figured:has([data-mark=\"{key}\"]:is(:hover, :focus)) [data-mark=\"{key}\"]"
            )),
            "{key}"
        );
    }
    assert!(page.contains("<span data-mark=\"t₁\" tabindex=\"0\"><math>"));
    assert!(page.contains("<nav id=\"steps\" aria-label=\"Step by step\" hidden>"));
    for part in page.split("<div class=\"slider\"").skip(1) {
        assert!(part.split('>').next().unwrap().ends_with(" hidden"), "{part}");
    }
    assert!(page.matches("<div class=\"slider\"").count() >= 1);
    // Without it, everything is open.
    assert_eq!(page.matches("<details>").count(), 0);
}
