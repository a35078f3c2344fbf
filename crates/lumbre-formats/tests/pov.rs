//! POV-Ray's scene language: its values, its errors, and what becomes of a scene.

use std::path::Path;

use lumbre_formats::pov::{PovOptions, written_files};
use lumbre_formats::{Budget, Diagnostics, FormatError, Input, Limits};
use lumbre_scene::SceneDesc;

/// Reads a scene from a text.
fn read(text: &str) -> (Result<SceneDesc, FormatError>, Diagnostics) {
    let mut limits = Limits::default();
    (limits.memory, limits.elements) = (64 << 20, 1_000_000);
    let budget = Budget::new(limits);
    let mut diagnostics = Diagnostics::new();
    let input = Input::from_reader("a.pov", text.as_bytes(), &budget).expect("it can be read");
    let scene = lumbre_formats::pov::pov_scene(
        &input,
        Path::new("/nowhere"),
        &PovOptions::default(),
        &budget,
        &mut diagnostics,
    );
    (scene, diagnostics)
}

/// What `#write(F, …)` writes.
fn written(statements: &str) -> String {
    let text = format!("#fopen F \"f\" write\n{statements}\n#fclose F");
    let budget = Budget::default();
    let options = PovOptions::default();
    let files =
        written_files(&text, "a.pov", Path::new("/nowhere"), &options, &budget, &mut Diagnostics::new());
    files.unwrap_or_else(|error| panic!("{statements}: {error}"))["f"].clone()
}

/// The value of an expression, as `str` prints it.
fn value(expression: &str) -> String {
    written(&format!("#write(F, str(({expression}), 0, 6))"))
}

#[test]
fn operators_have_the_ranks_and_values_of_the_language() {
    for (expression, expected) in [
        ("1 | 0 & 0", "0.000000"),
        ("-2*3+4/8-1", "-6.500000"),
        ("2-3-4", "-5.000000"),
        ("1e-11 ? 5 : 6", "6.000000"),
        ("2 = 2.00000000001", "1.000000"),
        ("mod(-7.5, 2)", "-1.500000"),
        ("div(-7, 2)", "-3.000000"),
        ("(<1,2,3>+1).z", "4.000000"),
        ("(<1,2,3>*<4,5>).z", "0.000000"),
        ("(rgb<.2,.4,.8>).gray", "0.386200"),
        ("vlength(vcross(x, y) - z)", "0.000000"),
        ("strcmp(\"abc\", \"abd\")", "-1.000000"),
        ("strlen(concat(\"ab\", str(1.5, -8, 2)))", "10.000000"),
    ] {
        assert_eq!(value(expression), expected, "{expression}");
    }
}

#[test]
fn a_macro_changes_the_identifier_that_it_is_given() {
    let text = "#macro Next(A, B) #declare B = A*2; #local A2 = A + 1; A2 #end
        #declare R = 0; #declare I = 3; #declare J = Next(I, R);
        #macro Twice(X) X*2 #end
        #write(F, R, \" \", J, \" \", Twice(1+2), \" \", <Twice(1), 2, 3>)";
    assert_eq!(written(text), "6 4 6 <2, 2, 3>");
}

/// What a value comes from, such as a macro or a branch, is left before the next statement is read.
#[test]
fn a_value_is_declared_before_the_next_statement() {
    let text = "#macro Pair() #local P = array[2] { 3, 4 } P #end
        #macro Outer() #local A = Pair() #local B = A[1]; B #end
        #macro Sign(S) #if (S < 0) -1 #else 1 #end #end
        #declare R = Outer(); #declare S = Sign(-5) #declare T = S * 2;
        #declare U = #if (T < 0) 7 #else 8 #end #declare V = U + 1;
        #macro Own() #local X1 = 10; X1 #end #macro Keep() #local X1 = Own(); #local Y1 = X1 + 1; Y1 #end
        #declare W = Keep();
        #macro Ended() #local Q1 = 12; #if (Q1) Q1; #else 0; #end #end #macro Use() #local Q2 = Ended() Q2 #end
        #declare Z1 = Use();
        #declare deprecated once \"not this\" Old = 5; #declare deprecated = 6;
        #write(F, R, \" \", S, \" \", T, \" \", U, \" \", V, \" \", W, \" \", Z1, \" \", Old, \" \", deprecated)";
    assert_eq!(written(text), "4 -1 -2 7 8 11 12 5 6");
}

#[test]
fn parts_of_textures_come_from_arrays_and_maps_without_weights() {
    let text = "#version 3.7; global_settings { assumed_gamma 1 }
        default { finish { ambient 0.2 } }
        camera { location <0, 1, -5> look_at 0# }
        #declare Finishes = array[2] { finish { ambient 0.3 }, finish { phong 0.4 } }
        #declare Balls = array[2] { sphere { 0, 1 }, sphere { x*3, 1 } }
        union { Balls[0] object { Balls[1] } finish { Finishes[1] } }
        plane { y, -2 pigment { average pigment_map { [gradient x] [2 bozo] [1 rgb 0.5] } } }
        sphere_sweep { linear_spline 2, <0, 3, 0>, 0.4, <1, 3, 0>, 0.2 }
        julia_fractal { <-0.083, 0, -0.83, -0.025> quaternion cube max_iteration 6 precision 30 translate y*5 }
        union { light_group { light_source { 9, 1 } sphere { 0, 1 } global_lights on translate x } }
        box { -1, 1 hollow pigment { object { sphere { 0, 1.2 } rgb 1, rgb x } }
          interior { ior 1.2 media { scattering { 5, 0.2 eccentricity 0.3 } density { spherical density_map { [0 rgb 0] [1 rgb 2] } } } } }";
    let (scene, diagnostics) = read(text);
    let scene = scene.unwrap();
    assert_eq!((scene.shapes.len(), scene.lights.len()), (7, 1));
    let lines = diagnostics.lines();
    assert_eq!(diagnostics.warnings(), 1, "{lines:?}");
    assert!(lines[0].contains("a # without the word of a directive"), "{lines:?}");
}

#[test]
fn loops_and_choices_go_where_they_should() {
    let text = "#declare I = 0; #while (I < 3) #write(F, I) #declare I = I + 1 #end
        #for (A, 0, 1, 0.25) #if (A > 0.6) #break #end #write(F, \" \", A) #end #write(F, \" then \", A)
        #switch (5) #case (1) #write(F, \"no\") #range (4, 6) #write(F, \" a\") #case (9) #write(F, \" b\") #break #else #write(F, \"no\") #end
        #ifdef (Nothing) #write(F, \"no\") #else #write(F, \" c\") #end";
    assert_eq!(written(text), "012 0 0.25 0.5 then 0.75 a b c");
}

#[test]
fn branches_that_are_passed_over_say_and_declare_nothing() {
    let text = "#if (0) #macro M(A) #if (A) #error \"no\" #end #end #elseif (0) #declare B = 1;
        #else #declare C = 3; #end
        #switch (2) #case (1) #declare B = 1; #break #case (2) #declare C = C + 4; #end
        #while (0) #for (I, 1, 3) #declare B = 2; #end #end
        #write(F, str(C, 0, 0), \" \", defined(B), \" \", defined(M))";
    assert_eq!(written(text), "7 0 0");
}

#[test]
fn what_a_scene_writes_it_can_read() {
    let text = "#fopen G \"g\" write #write(G, 1.5, \",\", <1, -2, 3>, \",\\\"text\\\"\") #fclose G
        #fopen G \"g\" read #read(G, A, B, C) #write(F, A, B, C) #ifdef (G) #write(F, \"no\") #end";
    assert_eq!(written(text), "1.5<1, -2, 3>text");
}

#[test]
fn malformed_scenes_are_errors_with_places() {
    for (text, expected) in [
        ("sphere { 0, ", "a.pov:1:11: unexpected (found the end of the scene; "),
        ("sphere { 0, 1", "found the end of the scene"),
        ("#if (1) sphere { 0, 1 }", "a.pov:1:1: a directive without its #end"),
        ("#while (1) #end", "a.pov:1:1: a loop that has not ended after"),
        ("#declare x = 1;", "a.pov:1:10: a word of the language cannot be declared (found \"x\")"),
        ("#declare A = B;", "an identifier that is not declared (found \"B\")"),
        ("#declare Sphere1 = 1; #declare B = Sphere2;", "did you mean \"Sphere1\"?"),
        ("#include \"missing.inc\"", "the file of an #include is not there (found \"missing.inc\""),
        ("#include \"../secret\"", "the file of an #include is not there"),
        (
            "#declare A = array[2] { 1, 2 } #declare B = A[2];",
            "an index that the array does not have (found 2; expected 0 to 1)",
        ),
        ("#declare A = array[1000000000][1000000000];", "--max-memory"),
        ("#macro M(A) M(A) #end M(1)", "--max-nesting"),
        ("#macro M(A) sphere { 0, A * } #end M(1)", "by the macro M"),
        ("#error \"no\"", "the scene says: \"no\""),
        ("/* sphere", "a comment without an end"),
        ("#declare A = \"b", "a text without an end"),
        ("#break", "#break outside of a loop"),
        ("#foo", "unknown directive (found \"foo\")"),
        ("camera { direction x right x }", "the axes of the camera lie in a plane"),
        ("quartic { <1, 2> }", "too few coefficients (found 2; expected 35)"),
        ("sphere_sweep { b_spline 3, 0, 1, x, 1, y, 1 }", "too few spheres for a sphere_sweep"),
        ("sphere_sweep { bezier_spline 4, 0, 1 }", "expected linear_spline, b_spline or cubic_spline"),
        ("sphere_sweep { linear_spline 1000000000, 0, 1 }", "unexpected (found \"}\""),
        (
            "julia_fractal { <0, 0, 0, 0> slice x, 0 }",
            "the slice of a julia_fractal whose normal has no fourth",
        ),
        ("julia_fractal { 1e999 }", "a vector that is not finite"),
        ("media { scattering { 1 } }", "unexpected (found \"}\""),
        ("media { glow 1 }", "glow has no meaning in a medium"),
        ("sphere { 0, 1 interior { media { density { [ } } } }", "unexpected (found \"[\""),
        ("plane { y, 0 pigment { object { 5 } } }", "expected the name of an object"),
        ("superellipsoid { <-1, 1> }", "a superellipsoid has two exponents that are not negative"),
        ("#declare deprecated once", "the name of an identifier is missing"),
        (
            "mesh2 { vertex_vectors { 3, 0, x, y } face_indices { 1, <0, 1, 2>, 7 } }",
            "a texture that the mesh2 does not have",
        ),
        ("pigment { mandel }", "an object, a light, a camera or a directive"),
        ("#macro M(A, B) sphere { 0, A } #end M(1)", "a.pov:1:40: the macro M has 2 parameters"),
        ("#macro M(A sphere { 0, A } #end", "the parameters of a macro are names in parentheses"),
        ("#macro M(A) sphere { 0, A }", "a directive without its #end"),
        (
            "#declare F = function(a, b) { a + };",
            "a.pov:1:35: unexpected (found \"}\"; expected an expression of a",
        ),
        (
            "#declare F = function(a, b) { a + b }; sphere { 0, F(1) }",
            "a function is called with a wrong number of arguments (found 1; expected 2)",
        ),
        ("#declare F = function { G(x) }", "an identifier that is not declared (found \"G\")"),
        ("#declare F = function { x } #declare F = function { y }", "a function cannot be declared again"),
        ("#declare F = function { pattern { } }", "a pattern is missing"),
        ("#declare F = function { pigment { bozo } }; sphere { 0, F(1, 2, 3).foo }", "no component of a"),
        ("#declare S = spline { };", "a spline without entries"),
        ("isosurface { threshold 0 }", "unexpected (found \"threshold\"; expected function)"),
        (
            "isosurface { function { x } contained_by { cone { 0, 1 } } }",
            "what contains an isosurface is a box or a sphere",
        ),
        (
            "isosurface { function { x } contained_by { sphere { 0, 1 } } max_gradient }",
            "unexpected (found \"}\"",
        ),
        ("#include", "unexpected (found the end of the scene; expected a text)"),
        ("#include 5", "a.pov:1:10: unexpected (found 5; expected a text)"),
        ("#fopen F \"f\" read", "a file that is not there (found \"f\")"),
        ("#fopen F \"f\" burn", "a file is opened to read, write or append"),
        ("#write(F, 1)", "a.pov:1:8: the file is not open"),
        ("#fclose F", "a.pov:1:9: the file is not open"),
        ("#fopen F \"f\" write #read(F, A)", "the file is not open to read"),
        (
            "#fopen F \"f\" write #write(F, \"x\") #fclose F #fopen F \"f\" read #read(F, A)",
            "\"f\" has no number, vector or text here",
        ),
        ("height_field { png \"nothing.png\" }", "an image that is not there (found \"nothing.png\")"),
        ("sphere { 0, 1 normal { bump_map { png \"nothing.png\" } } }", "an image that is not there"),
        (
            "sphere { 0, 1 normal { bump_map { function 4, 4 { x } burn } } }",
            "burn has no meaning for an image",
        ),
        ("camera { mesh_camera { 1 0 } }", "a.pov:1:28: a mesh_camera without meshes"),
        (
            "camera { mesh_camera { 1 7 mesh { triangle { 0, x, y } } } }",
            "the distribution of a mesh_camera is",
        ),
        ("camera { mesh_camera { 1 0 mesh { sphere { 0, 1 } } } }", "a.pov:1:35: "),
    ] {
        let (scene, _) = read(text);
        let error = scene.map(|_| ()).expect_err(text).to_diagnostic().to_string();
        assert!(error.contains(expected), "{text}\n  {error}\n  expected {expected}");
    }
    let deep = format!("#declare A = {}1{};", "(".repeat(5000), ")".repeat(5000));
    assert!(read(&deep).0.is_err());
    let deep = format!("{}sphere {{ 0, 1 }}{}", "union { ".repeat(5000), " }".repeat(5000));
    assert!(read(&deep).0.is_err());
}

/// The place is in the file that is included, with where that was asked for.
#[test]
fn errors_in_included_files_name_both_places() {
    let folder = std::env::temp_dir().join(format!("lumbre-pov-includes-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("wrong.inc"), "#declare A = 1;\n#macro Ball(R)\nsphere { 0, * R }\n#end")
        .unwrap();
    std::fs::write(folder.join("itself.inc"), "#declare N = 1;\n#include \"itself.inc\"").unwrap();
    std::fs::write(folder.join("open.inc"), "#if (1)\nsphere { 0, 1 }").unwrap();
    let error = |text: &str| {
        let budget = Budget::default();
        let input = Input::from_reader("a.pov", text.as_bytes(), &budget).unwrap();
        let options = PovOptions::default();
        let scene =
            lumbre_formats::pov::pov_scene(&input, &folder, &options, &budget, &mut Diagnostics::new());
        scene.map(|_| ()).expect_err(text).to_diagnostic().to_string()
    };
    let in_macro = error("#include \"wrong.inc\"\n\nBall(2)");
    let without_end = error("\n#include \"open.inc\" #end");
    let without_limit = error("#include \"itself.inc\"");
    std::fs::remove_dir_all(&folder).unwrap();
    assert!(in_macro.contains("wrong.inc:3:13"), "{in_macro}");
    assert!(in_macro.contains("included from a.pov:3:7 by the macro Ball"), "{in_macro}");
    assert!(without_end.contains("open.inc:1:1: a directive without its #end"), "{without_end}");
    assert!(without_limit.contains("--max-nesting"), "{without_limit}");
}

#[test]
fn a_scene_becomes_shapes_lights_and_a_camera() {
    let text = "#version 3.7; global_settings { assumed_gamma 1 }
        camera { location <0, 1, -5> look_at 0 angle 40 right x*4/3 }
        light_source { <2, 3, -5> rgb 1 }
        difference { box { -1, 1 } sphere { <0, 0, -1>, 0.7 } pigment { rgb <1, 0, 0> } translate x }
        plane { y, -1 pigment { checker rgb 1, rgb 0 } }
        text { ttf \"timrom.ttf\" \"A\" 1, 0 }";
    let (scene, diagnostics) = read(text);
    let scene = scene.unwrap();
    assert_eq!((scene.shapes.len(), scene.lights.len(), scene.cameras.len()), (3, 1, 1));
    assert_eq!(diagnostics.warnings(), 1, "{:?}", diagnostics.lines());
    assert!(diagnostics.lines()[0].contains("text"), "{:?}", diagnostics.lines());
}

#[test]
fn focal_blur_has_the_samples_of_its_camera() {
    let samples = |camera: &str| read(&format!("camera {{ {camera} }}")).0.unwrap().sampler.spp;
    assert_eq!(samples("location <0, 0, -5> look_at 0"), None);
    assert_eq!(samples("location <0, 0, -5> look_at 0 blur_samples 100"), None);
    assert_eq!(
        samples("location <0, 0, -5> look_at 0 aperture 0.4 focal_point 0 blur_samples 100"),
        Some(100)
    );
    assert_eq!(
        samples("location <0, 0, -5> look_at 0 aperture 0.4 focal_point 0 blur_samples 4, 200"),
        Some(200)
    );
    assert_eq!(samples("location <0, 0, -5> look_at 0 aperture 0.4 focal_point 0"), Some(64));
}

/// POV-Ray 3.7 spreads a point at twice the distance of the focal point over a disc of radius 0.25, of aperture 1.
#[test]
fn a_lens_is_half_as_wide_as_its_aperture() {
    for frame in ["", "right 2*x angle 12", "direction 8*z", "right x up 2*y angle 6"] {
        let text = format!("camera {{ {frame} aperture 1.2 focal_point z*5 blur_samples 9 }}");
        let scene = read(&text).0.unwrap();
        let lumbre_scene::CameraKind::Perspective { lens_radius, focal_distance, .. } = scene.cameras[0].kind
        else {
            panic!("{text}")
        };
        assert!((lens_radius - 0.3).abs() < 1e-12 && (focal_distance - 5.0).abs() < 1e-12, "{text}");
    }
}

/// The rays of meshes, and where POV-Ray 3.7 shows the planes z = -3 and z = 3 by them.
#[test]
fn a_mesh_camera_has_a_ray_for_each_face() {
    let meshes = "mesh {
            triangle { <0, 0, 0>, <1, 0, 0>, <0, 1, 0> }
            triangle { <2, 0, 0>, <2, 1, 0>, <3, 0, 0> }
            smooth_triangle { <4, 0, 0>, z, <5, 0, 0>, z, <4, 1, 0>, z }
            smooth_triangle { <4, 0, 0>, -z, <5, 0, 0>, -z, <4, 1, 0>, -z }
            smooth_triangle { <-4, 0, 0>, z, <-4, 1, 0>, z, <-3, 0, 0>, z }
            smooth_triangle { <-4, 0, 0>, -z, <-4, 1, 0>, -z, <-3, 0, 0>, -z }
        }";
    let text = format!("camera {{ mesh_camera {{ 1 0 {meshes} }} location <0, 0, -.01> }}");
    let (scene, diagnostics) = read(&text);
    assert_eq!(diagnostics.warnings(), 0, "{:?}", diagnostics.lines());
    let scene = scene.unwrap();
    assert_eq!(scene.sampler.spp, None);
    let view = lumbre_scene::View::new(&scene.cameras[0], 7, 1);
    let middle = lumbre_math::DVec2::splat(0.5);
    let seen = (0..7).map(|x| {
        let film = lumbre_math::DVec2::new(f64::from(x) + 0.5, 0.5);
        let camera = view.bare_ray(film, middle, 0.0);
        let (o, d) = (camera.ray.origin, camera.ray.direction);
        (camera.weight > 0.0).then(|| (((o + d * (3.0 / d.z.abs())).x * 1e3).round(), d.z > 0.0))
    });
    let expected = [(333.0, false), (2333.0, true), (4333.0, false), (4333.0, false)];
    let expected = expected.into_iter().chain([(-3667.0, true); 2]).map(Some).chain([None]);
    assert_eq!(seen.collect::<Vec<_>>(), expected.collect::<Vec<_>>());

    let (scene, _) = read(&format!("camera {{ mesh_camera {{ 3, 1, 9.5 {meshes} {meshes} smooth }} }}"));
    let scene = scene.unwrap();
    assert_eq!(scene.sampler.spp, Some(64));
    let lumbre_scene::CameraKind::Mesh(meshes) = &scene.cameras[0].kind else { panic!() };
    assert_eq!(meshes.rays(), 3);
}

/// The normals that POV-Ray 3.7 has for the same bump maps.
#[test]
fn bump_maps_tilt_normals_by_the_slope_of_their_grey() {
    use lumbre_math::DVec3;
    use lumbre_shading::MaterialKind;
    use lumbre_shading::pov::{Eye, TextureKind};

    let normal = |text: &str, p: DVec3, n: DVec3| {
        let scene = format!("sphere {{ 0, 1 pigment {{ rgb 1 }} normal {{ {text} }} }}");
        let scene = read(&scene).0.unwrap();
        let MaterialKind::Pov(material) = &scene.materials[0].material.kind else { panic!() };
        let TextureKind::Plain(layer) = &material.texture.kind else { panic!() };
        let n = n.normalize();
        layer.normal.as_ref().unwrap().tilted(p, n, &Eye { normal: n, ..Eye::NOWHERE })
    };
    let at = |x: f64, y: f64| DVec3::new(x, y, 0.0);
    let (flat, tilted) = (-DVec3::Z, DVec3::new(0.3, 0.2, -1.0));
    for (text, p, n, expected) in [
        ("bump_map { function 8, 8 { x } bump_size 1 }", at(0.3, 0.3), flat, [-0.141, 0.0, -0.990]),
        ("bump_map { function 8, 8 { x } bump_size 1 }", at(0.05, 0.3), flat, [0.349, 0.465, -0.814]),
        ("bump_map { function 8, 8 { x } bump_size 1 }", at(0.95, 0.3), flat, [0.349, -0.465, -0.814]),
        ("bump_map { function 8, 8 { x } } 3", at(0.3, 0.3), flat, [-0.394, 0.0, -0.919]),
        ("bump_map { function 8, 8 { x } }", at(0.3, 0.3), flat, [-0.071, 0.0, -0.997]),
        (
            "bump_map { function 8, 8 { x } bump_size 3 } bump_size 2",
            at(0.3, 0.3),
            flat,
            [-0.275, 0.0, -0.962],
        ),
        ("bump_map { function 8, 8 { x } bump_size 3 }", at(0.3, 0.3), tilted, [-0.118, 0.173, -0.978]),
        ("bump_map { function 8, 8 { 1-y } bump_size 3 }", at(0.3, 0.3), tilted, [0.281, -0.214, -0.936]),
        (
            "bump_map { function 8, 8 { x*.5 + y*.2 } bump_size 3 } scale 0.5",
            at(0.15, 0.3),
            tilted,
            [0.070, 0.265, -0.962],
        ),
        (
            "bump_map { function 8, 8 { x*.5 + y*.2 } bump_size 3 } scale <0.5, 0.5, 2>",
            at(0.15, 0.3),
            tilted,
            [-0.438, 0.426, -0.792],
        ),
    ] {
        let found = normal(text, p, n);
        assert!(found.distance(DVec3::from_array(expected)) < 2e-3, "{text}: {found}");
    }
}

/// Grey 60 of 255 in the working space, as POV-Ray 3.7 reads it from PNG files with and without a gamma.
#[test]
fn images_are_decoded_by_their_gamma_and_the_version() {
    use lumbre_shading::MaterialKind;
    use lumbre_shading::pov::{PigmentKind, TextureKind};

    let folder = std::env::temp_dir().join(format!("lumbre-pov-gamma-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    for (name, gamma) in [("none.png", None), ("screen.png", Some(45_455)), ("light.png", Some(100_000))] {
        let file = std::fs::File::create(folder.join(name)).unwrap();
        let mut encoder = png::Encoder::new(file, 3, 2);
        encoder.set_color(png::ColorType::Rgb);
        if let Some(gamma) = gamma {
            encoder.set_source_gamma(png::ScaledFloat::from_scaled(gamma));
        }
        encoder.write_header().unwrap().write_image_data(&[60; 18]).unwrap();
    }
    let (stored, screen) = (60.0 / 255.0, 0.0415);
    for (version, settings, image, expected) in [
        ("3.6", "assumed_gamma 1", "\"none.png\"", stored),
        ("3.6", "assumed_gamma 1", "\"screen.png\"", screen),
        ("3.6", "assumed_gamma 1", "\"light.png\"", stored),
        ("3.6", "assumed_gamma 2.2", "\"none.png\"", stored),
        ("3.6", "assumed_gamma 2.2", "\"screen.png\"", stored),
        ("3.6", "", "\"none.png\"", stored),
        ("3.6", "", "\"screen.png\"", stored),
        ("3.7", "assumed_gamma 1", "\"none.png\"", 0.0452),
        ("3.7", "assumed_gamma 1", "\"screen.png\"", screen),
        ("3.7", "assumed_gamma 1", "\"light.png\"", stored),
        ("3.7", "assumed_gamma 2.2", "\"light.png\"", 0.518),
        ("3.7", "", "\"screen.png\"", screen),
        ("3.7", "assumed_gamma 1", "\"none.png\" gamma 1", stored),
        ("3.7", "assumed_gamma 1", "\"none.png\" gamma 2.2", screen),
    ] {
        let text = format!(
            "#version {version}; global_settings {{ {settings} }} sphere {{ 0, 1 pigment {{ image_map {{ png {image} }} }} }}"
        );
        let budget = Budget::default();
        let input = Input::from_reader("a.pov", text.as_bytes(), &budget).unwrap();
        let options = PovOptions::default();
        let mut diagnostics = Diagnostics::new();
        let scene = lumbre_formats::pov::pov_scene(&input, &folder, &options, &budget, &mut diagnostics);
        let scene = scene.unwrap_or_else(|error| panic!("{text}: {error}"));
        let MaterialKind::Pov(material) = &scene.materials[0].material.kind else { panic!() };
        let TextureKind::Plain(layer) = &material.texture.kind else { panic!() };
        let PigmentKind::Image(image) = &layer.pigment.kind else { panic!() };
        let found = image.colour(lumbre_math::DVec3::new(0.3, 0.7, 0.0)).rgb.g;
        assert!((found - expected).abs() < 1e-3, "{text}: {found}, not {expected}");
    }
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn switches_may_be_identifiers() {
    let text = "#macro Settings(Normal) radiosity { count 9 normal Normal media off brightness 0.5 } #end
        #declare No = 0; #declare Yes = 1;
        global_settings { Settings(No) }
        sphere { 0, 1 hollow Yes }
        sphere { x*3, 1 hollow No pigment { rgb 1 } }";
    let scene = read(text).0.unwrap();
    let hollow = scene.materials.iter().map(|named| {
        let lumbre_shading::MaterialKind::Pov(material) = &named.material.kind else { panic!() };
        material.hollow
    });
    assert_eq!(hollow.collect::<Vec<_>>(), [true, false]);
}

/// POV-Ray 3.7 gives the normals of maps the `bump_size` of the default normal, too.
#[test]
fn the_default_normal_says_how_strong_others_are() {
    use lumbre_math::DVec3;
    use lumbre_shading::MaterialKind;
    use lumbre_shading::pov::{Eye, TextureKind};

    let entry = "gradient x scale 3 translate -x";
    let map = format!("bumps normal_map {{ [0 {entry}] [1 {entry}] }}");
    let blocks = format!("checker normal {{ {entry} }} normal {{ {entry} }}");
    for (default, normal, expected) in [
        ("", entry, [-0.067, 0.0, -0.998]),
        ("#default { normal { bump_size 1.5 } }", entry, [-0.196, 0.0, -0.981]),
        ("#default { normal { bumps 1.5 } }", entry, [-0.196, 0.0, -0.981]),
        ("", &map, [-0.067, 0.0, -0.998]),
        ("#default { normal { bump_size 1.5 } }", &map, [-0.196, 0.0, -0.981]),
        ("#default { normal { bump_size 1.5 } }", &blocks, [-0.196, 0.0, -0.981]),
    ] {
        let scene = read(&format!("{default} sphere {{ 0, 1 normal {{ {normal} }} }}")).0.unwrap();
        let MaterialKind::Pov(material) = &scene.materials[0].material.kind else { panic!() };
        let TextureKind::Plain(layer) = &material.texture.kind else { panic!() };
        let n = -DVec3::Z;
        let eye = Eye { normal: n, ..Eye::NOWHERE };
        let found = layer.normal.as_ref().unwrap().tilted(DVec3::new(0.5, 0.5, 0.0), n, &eye);
        assert!(found.distance(DVec3::from_array(expected)) < 2e-3, "{default} {normal}: {found}");
    }
}

/// The octaves of an image's turbulence may stand behind it.
#[test]
fn octaves_behind_the_turbulence_of_an_image_count() {
    use lumbre_math::DVec3;
    use lumbre_shading::MaterialKind;
    use lumbre_shading::pov::TextureKind;

    let place = |modifiers: &str| {
        let text = format!(
            "sphere {{ 0, 1 pigment {{ image_map {{ function 4, 4 {{ x }} }} scale 2 {modifiers} rotate 90*z }} }}"
        );
        let scene = read(&text).0.unwrap();
        let MaterialKind::Pov(material) = &scene.materials[0].material.kind else { panic!() };
        let TextureKind::Plain(layer) = &material.texture.kind else { panic!() };
        layer.pigment.warps.apply(DVec3::new(0.3, -0.8, 0.45))
    };
    let two = place("octaves 2 omega 0.7 turbulence 0.4*x");
    assert_eq!(place("turbulence 0.4*x octaves 2 omega 0.7"), two);
    assert_ne!(place("turbulence 0.4*x"), two);
    assert_ne!(place(""), two);
}
