//! The scene language, directive by directive: small scenes and what they describe.

use std::fs;

use lumbre_formats::{
    Budget, Diagnostics, FormatError, Limits, ReadOptions, Strictness, open_scene, open_scenes, pbrt,
};
use lumbre_geometry::{Ray, Shape};
use lumbre_image::Rgb;
use lumbre_math::{DVec3, Transform, Vec2, Vec3};
use lumbre_scene::*;
use lumbre_shading::hair::HairColour;
use lumbre_shading::{
    Convention, Mapping2d, MaterialKind, PrincipledParams, ShadingNormals, Spectrum, Texture,
};

fn try_read(text: &str) -> (Result<SceneDesc, FormatError>, Diagnostics) {
    let mut diagnostics = Diagnostics::new();
    let scene = pbrt::read_bytes("scene.pbrt", text.as_bytes(), None, &Budget::default(), &mut diagnostics);
    (scene, diagnostics)
}

/// Reads a scene that must be read without a word.
fn read(text: &str) -> SceneDesc {
    let (scene, diagnostics) = try_read(text);
    assert_eq!(diagnostics.lines(), [""; 0], "{text}");
    scene.unwrap_or_else(|e| panic!("{e}\n{text}"))
}

/// Reads what stands after `WorldBegin`.
fn world(text: &str) -> SceneDesc {
    read(&format!("WorldBegin\n{text}"))
}

/// Reads what stands after `WorldBegin` (on the same line), and answers the warnings too.
fn warned(text: &str) -> (SceneDesc, Vec<String>) {
    let (scene, diagnostics) = try_read(&format!("WorldBegin {text}"));
    (scene.unwrap_or_else(|e| panic!("{e}\n{text}")), diagnostics.lines())
}

fn origin(shape: &ShapeDesc) -> DVec3 {
    shape.world_from_object.point(DVec3::ZERO)
}

fn near(a: DVec3, b: DVec3) {
    assert!((a - b).length() < 1e-12, "{a} is not {b}");
}

fn near_rgb(a: Rgb, b: [f32; 3]) {
    let b = Rgb::from(b);
    let worst = a.zip(b, |x, y| (x - y).abs() / (1.0 + y.abs())).max_component();
    assert!(worst < 1e-5, "{a:?} is not {b:?}");
}

fn exact(shape: &ShapeDesc) -> &Shape {
    match &shape.geometry {
        GeometryDesc::Exact(shape) => shape,
        other => panic!("{other:?}"),
    }
}

fn mesh(shape: &ShapeDesc) -> &MeshDesc {
    match &shape.geometry {
        GeometryDesc::Mesh(mesh) | GeometryDesc::BilinearMesh(mesh) => mesh,
        other => panic!("{other:?}"),
    }
}

fn kind(scene: &SceneDesc, shape: usize) -> &MaterialKind {
    let id = scene.shapes[shape].material.expect("a surface");
    &scene.materials[id.0 as usize].material.kind
}

fn constant<T: lumbre_shading::TextureValue>(texture: &Texture<T>) -> T {
    match texture {
        Texture::Constant(v) | Texture::Spectrum { value: v, .. } => *v,
        other => panic!("{other:?}"),
    }
}

// Transforms.

#[test]
fn transforms_multiply_from_the_right() {
    let scene = world("Translate 3 4 5 Rotate 90 0 0 1 Scale 2 3 4 Shape \"sphere\"");
    near(scene.shapes[0].world_from_object.point(DVec3::new(1.0, 1.0, 1.0)), DVec3::new(0.0, 6.0, 9.0));
}

#[test]
fn a_matrix_is_given_column_by_column_with_brackets_or_without() {
    for text in [
        "Transform [1 0 0 0  0 2 0 0  0 0 3 0  7 8 9 1]",
        "Translate 1 1 1 Transform 1 0 0 0  0 2 0 0  0 0 3 0  7 8 9 1",
        "Translate 7 8 9 ConcatTransform [1 0 0 0  0 2 0 0  0 0 3 0  0 0 0 1]",
        "Scale 9 9 9 Identity Translate [7 8 9] Scale 1 2 3",
    ] {
        let scene = world(&format!("{text} Shape \"sphere\""));
        near(scene.shapes[0].world_from_object.point(DVec3::ONE), DVec3::new(8.0, 10.0, 12.0));
    }
}

#[test]
fn world_begin_starts_again_from_the_identity() {
    let scene = read("Translate 5 6 7 WorldBegin Shape \"sphere\"");
    assert_eq!(origin(&scene.shapes[0]), DVec3::ZERO);
}

#[test]
fn the_camera_is_where_look_at_says_and_left_handed() {
    let scene = read("LookAt 4 5 6  4 5 16  0 1 0 Camera \"perspective\" WorldBegin");
    let t = scene.cameras[0].world_from_camera;
    near(t.point(DVec3::ZERO), DVec3::new(4.0, 5.0, 6.0));
    near(t.vector(DVec3::Z), DVec3::Z);
    near(t.vector(DVec3::Y), DVec3::Y);
    near(t.vector(DVec3::X), DVec3::X);
    // From above, tilted.
    let scene = read("LookAt 0 0 0  3 0 4  0 10 0 Camera \"perspective\" WorldBegin");
    let t = scene.cameras[0].world_from_camera;
    near(t.vector(DVec3::Z), DVec3::new(0.6, 0.0, 0.8));
    near(t.vector(DVec3::X), DVec3::new(0.8, 0.0, -0.6));
}

#[test]
fn named_coordinate_systems_come_back() {
    let scene = read(
        "Translate -2 -3 -4 Camera \"perspective\" WorldBegin
         AttributeBegin CoordSysTransform \"camera\" Shape \"sphere\" AttributeEnd
         Translate 1 2 3 CoordinateSystem \"here\" Identity Shape \"sphere\"
         CoordSysTransform \"here\" Shape \"sphere\"
         CoordSysTransform \"world\" Shape \"sphere\"",
    );
    let at: Vec<DVec3> = scene.shapes.iter().map(origin).collect();
    assert_eq!(at, [DVec3::new(2.0, 3.0, 4.0), DVec3::ZERO, DVec3::new(1.0, 2.0, 3.0), DVec3::ZERO]);
}

#[test]
fn shapes_move_between_the_two_transforms() {
    let moving =
        "ActiveTransform EndTime Translate 5 0 0 ActiveTransform All Translate 0 2 0 Shape \"sphere\"";
    let scene = read(&format!(
        "TransformTimes 1 3 WorldBegin {moving}
         ActiveTransform StartTime Identity ActiveTransform EndTime Identity Shape \"disk\""
    ));
    // What moves stands in an object of its own, under the number that it has in the file.
    let [ref instance] = scene.instances[..] else { panic!("{:?}", scene.instances) };
    let object = &scene.objects[instance.object.0 as usize];
    assert_eq!((object.shapes[0].index, scene.shapes[0].index), (0, 1));
    assert_eq!(object.shapes[0].world_from_object, Transform::IDENTITY);
    for (time, x) in [(0.0, 0.0), (1.0, 0.0), (1.5, 1.25), (3.0, 5.0), (9.0, 5.0)] {
        near(instance.world_from_object.at(time).point(DVec3::ZERO), DVec3::new(x, 2.0, 0.0));
    }
    let scene = read("TransformTimes 0 2 WorldBegin ActiveTransform All Translate 1 2 3 Shape \"sphere\"");
    assert_eq!(origin(&scene.shapes[0]), DVec3::new(1.0, 2.0, 3.0));
    assert!(!Scene::build(scene).unwrap().moves());
}

#[test]
fn instances_and_cameras_move_too() {
    let scene = read(
        "TransformTimes 0 2
         LookAt 0 0 -9 0 0 0 0 1 0
         ActiveTransform EndTime Rotate 90 0 1 0 ActiveTransform All
         Camera \"perspective\" \"float shutteropen\" 0.5 \"float shutterclose\" 1.5
         WorldBegin
         ObjectBegin \"a\" Shape \"sphere\" ActiveTransform EndTime Translate 0 3 0 Shape \"disk\" ObjectEnd
         ActiveTransform EndTime Translate 0 0 8 ActiveTransform All
         ObjectInstance \"a\"",
    );
    let camera = &scene.cameras[0];
    assert_eq!((camera.shutter_open, camera.shutter_close), (0.5, 1.5));
    let place = |time: f64| camera.motion.as_ref().unwrap().at(time).point(DVec3::ZERO);
    // The camera comes last: the world turns about its own origin before it.
    near(place(0.0), DVec3::new(0.0, 0.0, -9.0));
    near(place(2.0), Transform::rotate(DVec3::Y, -90.0).unwrap().point(DVec3::new(0.0, 0.0, -9.0)));
    assert_eq!(camera.world_from_camera, camera.motion.as_ref().unwrap().at(0.5));
    near(scene.instances[0].world_from_object.at(1.5).point(DVec3::ZERO), DVec3::new(0.0, 0.0, 6.0));
    // And what moves in the object.
    let object = &scene.objects[scene.instances[0].object.0 as usize];
    near(object.instances[0].world_from_object.at(1.0).point(DVec3::ZERO), DVec3::new(0.0, 1.5, 0.0));
    assert!(Scene::build(scene).unwrap().moves());
}

#[test]
fn lamps_that_move_are_sampled_where_they_are() {
    let scene = world(
        "AttributeBegin AreaLightSource \"diffuse\" ActiveTransform EndTime Translate 5 0 0 ActiveTransform All
         Shape \"sphere\" AttributeEnd Shape \"disk\" \"float radius\" 9",
    );
    let scene = Scene::build(scene).unwrap();
    assert_eq!(scene.warnings(), []);
    let from = DVec3::new(0.0, 0.0, -20.0);
    for time in [0.0, 0.5, 1.0] {
        let sample =
            scene.sample_light(from, DVec3::ZERO, time, 0.5, lumbre_math::DVec2::new(0.3, 0.6)).unwrap();
        let end = sample.end.unwrap().point;
        assert!((end - DVec3::new(5.0 * time, 0.0, 0.0)).length() < 1.0 + 1e-9, "{end}");
    }
}

#[test]
fn motion_that_cannot_be_is_said() {
    let (scene, warnings) =
        warned("ActiveTransform EndTime Scale 1 1 -1 ActiveTransform All Translate 0 2 0 Shape \"sphere\"");
    near(origin(&scene.shapes[0]), DVec3::new(0.0, 2.0, 0.0));
    assert_eq!(
        warnings,
        [
            "warning: scene.pbrt:1:85: this shape stays where it starts: between moment 1 and the one before it lies a mirror"
        ]
    );
    let (_, warnings) = warned("ActiveTransform EndTime Translate 0 2 0 LightSource \"point\"");
    assert!(warnings[0].contains("the motion of this light is left out"), "{warnings:?}");
    let error = |text: &str| try_read(text).0.unwrap_err().to_string();
    let late = error("TransformTimes 2 2 WorldBegin");
    assert!(late.contains("1:1: the motion ends before it starts (found 2; expected more than 2)"), "{late}");
    let csg = error(
        "WorldBegin ObjectBegin \"a\" ActiveTransform EndTime Translate 1 0 0 Shape \"sphere\" ObjectEnd
         Shape \"csg\" \"string operands\" [ \"a\" \"a\" ]",
    );
    assert!(csg.contains("object \"a\" has a shape that moves: it is no operand of a csg"), "{csg}");
}

#[test]
fn numbers_stay_double_into_exact_shapes_and_transforms() {
    let scene =
        world("Translate 0.1234567890123456 0 0 Shape \"sphere\" \"float radius\" 0.1234567890123456");
    assert_eq!(origin(&scene.shapes[0]).x, 0.1234567890123456);
    let bounds = exact(&scene.shapes[0]).bounds(&Transform::IDENTITY).unwrap();
    assert!((bounds.max.x - 0.1234567890123456).abs() < 1e-15);
}

// State.

#[test]
fn scopes_give_back_the_whole_state() {
    let scene = world(
        "Material \"diffuse\" \"rgb reflectance\" [.1 .2 .3]
         AttributeBegin
           Translate 1 2 3 ReverseOrientation ColorSpace \"rec2020\"
           Material \"diffuse\" \"rgb reflectance\" [.4 .4 .4]
           AreaLightSource \"diffuse\" Shape \"sphere\"
         AttributeEnd
         Shape \"sphere\" \"float radius\" 2",
    );
    let [a, b] = &scene.shapes[..] else { panic!() };
    assert!(a.reverse_orientation && !b.reverse_orientation);
    assert!(a.area_light.is_some() && b.area_light.is_none());
    assert_eq!((origin(a), origin(b)), (DVec3::new(1.0, 2.0, 3.0), DVec3::ZERO));
    let MaterialKind::Diffuse { reflectance } = kind(&scene, 1) else { panic!() };
    assert_eq!(constant(reflectance), Rgb::new(0.1, 0.2, 0.3));
    assert_eq!((a.index, b.index), (0, 1));
}

#[test]
fn attribute_defaults_yield_to_parameters_and_end_with_scope() {
    let scene = world(
        "AttributeBegin
           Attribute \"shape\" \"float radius\" 3 \"float alpha\" .5 \"float unused\" 1
           Shape \"sphere\" Shape \"sphere\" \"float radius\" 4
         AttributeEnd
         Shape \"sphere\"
         Attribute \"material\" \"rgb reflectance\" [.2 .3 .4] Attribute \"light\" \"float scale\" 7
         Material \"diffuse\" Shape \"sphere\" LightSource \"infinite\" \"rgb L\" [1 2 3]",
    );
    let radii: Vec<f64> =
        scene.shapes.iter().map(|s| exact(s).bounds(&Transform::IDENTITY).unwrap().max.x.round()).collect();
    assert_eq!(radii, [3.0, 4.0, 1.0, 1.0]);
    assert_eq!(constant(scene.shapes[1].alpha.as_ref().unwrap()), 0.5);
    assert!(scene.shapes[2].alpha.is_none());
    let MaterialKind::Diffuse { reflectance } = kind(&scene, 3) else { panic!() };
    assert_eq!(constant(reflectance), Rgb::new(0.2, 0.3, 0.4));
    let LightDesc::Infinite { radiance, .. } = scene.lights[0] else { panic!() };
    assert_eq!(radiance, Rgb::new(7.0, 14.0, 21.0));
}

#[test]
fn the_last_of_a_repeated_parameter_wins() {
    let scene = world("Shape \"sphere\" \"float radius\" 3 \"float radius\" 5");
    assert!((exact(&scene.shapes[0]).bounds(&Transform::IDENTITY).unwrap().max.y - 5.0).abs() < 1e-9);
}

#[test]
fn named_materials_may_be_used_before_they_are_made() {
    let scene = world(
        "NamedMaterial \"later\" Shape \"sphere\"
         MakeNamedMaterial \"later\" \"string type\" \"dielectric\" \"float eta\" 1.7
         MakeNamedMaterial \"none\" \"string type\" \"interface\"
         NamedMaterial \"none\" Shape \"sphere\"",
    );
    assert!(matches!(kind(&scene, 0), MaterialKind::Dielectric { eta, .. } if *eta == 1.7));
    assert_eq!(scene.shapes[1].material, None);
    assert!(scene.materials.iter().any(|m| m.name.as_deref() == Some("later")));
}

#[test]
fn objects_keep_their_own_transform_and_instances_add_theirs() {
    let scene = world(
        "Translate 1 0 0
         ObjectBegin \"thing\" Translate 0 2 0 Shape \"sphere\" Material \"dielectric\" Shape \"disk\" ObjectEnd
         Translate 0 0 5 ObjectInstance \"thing\" Shape \"sphere\"",
    );
    assert_eq!(scene.objects.len(), 1);
    assert_eq!(scene.objects[0].name, "thing");
    assert_eq!(origin(&scene.objects[0].shapes[0]), DVec3::new(1.0, 2.0, 0.0));
    assert_eq!(scene.instances[0].object, ObjectId(0));
    let placed = scene.instances[0].world_from_object.at(0.0).point(DVec3::ZERO);
    assert_eq!(placed, DVec3::new(1.0, 0.0, 5.0));
    // The object's scope gave its state back, and its shapes count.
    assert_eq!(origin(&scene.shapes[0]), DVec3::new(1.0, 0.0, 5.0));
    let indices: Vec<u32> = scene.objects[0].shapes.iter().chain(&scene.shapes).map(|s| s.index).collect();
    assert_eq!(indices, [0, 1, 2]);
    assert_ne!(scene.objects[0].shapes[1].material, scene.shapes[0].material);
}

// Shapes.

#[test]
fn every_exact_shape_is_read() {
    let cases = [
        (
            "sphere",
            r#""point3 center" [1 2 3] "float radius" 2 "float zmin" -1 "float zmax" 1 "float phimax" 90"#,
        ),
        ("plane", r#""point3 point" [0 0 5] "normal normal" [0 1 1]"#),
        ("disk", r#""float height" 2 "float radius" 3 "float innerradius" 1 "float phimax" 180"#),
        ("triangle", r#""point3 p0" [0 0 1] "point3 p1" [2 0 1] "point3 p2" [0 3 1]"#),
        ("box", r#""point3 p0" [-2 -3 -4] "point3 p1" [5 6 7]"#),
        ("cylinder", r#""float radius" 2 "float zmin" -inf "float zmax" 3"#),
        ("cylinder", r#""point3 p0" [1 1 1] "point3 p1" [2 3 4] "float radius" .5 "bool caps" true"#),
        ("capsule", r#""point3 p0" [1 1 1] "point3 p1" [2 3 4] "float radius" .7"#),
        ("capsule", r#""float radius" 2.5"#),
        ("cone", r#""float radius" 2 "float height" 3 "float topradius" .5 "bool caps" true"#),
        ("cone", r#""point3 apex" [0 0 4] "vector3 axis" [0 0 -2] "float angle" 30 "float height" inf"#),
        (
            "torus",
            r#""float majorradius" 2 "float minorradius" .5 "point3 center" [1 1 1] "vector3 axis" [0 1 0]"#,
        ),
        ("paraboloid", r#""float radius" 2 "float zmin" .5 "float zmax" 3 "float phimax" 270"#),
        ("hyperboloid", r#""point3 p1" [1 0 0] "point3 p2" [0 1 2] "float phimax" 200"#),
        (
            "quadric",
            r#""float coefficients" [1 2 3 0 0 0 0 0 0 -4] "point3 p0" [-1 -1 -1] "point3 p1" [1 1 1]"#,
        ),
    ];
    for (name, parameters) in cases {
        let scene = world(&format!("Shape \"{name}\" {parameters}"));
        assert_eq!(exact(&scene.shapes[0]).name(), name);
    }
}

#[test]
fn placement_parameters_stand_before_the_transform() {
    let scene = world("Scale 2 2 2 Shape \"sphere\" \"point3 center\" [1 2 3] \"float radius\" 2");
    let bounds = exact(&scene.shapes[0]).bounds(&scene.shapes[0].world_from_object).unwrap();
    assert!((bounds.min - DVec3::new(-2.0, 0.0, 2.0)).length() < 1e-9);
    let scene =
        world("Shape \"disk\" \"float height\" 3 \"normal normal\" [0 2 0] \"point3 center\" [1 1 1]");
    let bounds = exact(&scene.shapes[0]).bounds(&Transform::IDENTITY).unwrap();
    assert!((bounds.center() - DVec3::new(1.0, 4.0, 1.0)).length() < 1e-9);
}

#[test]
fn triangle_meshes_have_all_their_parts() {
    let scene = world(
        r#"Shape "trianglemesh" "integer indices" [0 1 2  2 1 3] "point3 P" [0 0 0  2 0 0  0 3 0  2 3 1]
           "normal N" [0 0 1 0 0 1 0 0 1 0 0 1] "point2 uv" [0 0 1 0 0 1 1 1]
           "vector3 S" [1 0 0 1 0 0 1 0 0 1 0 0] "integer faceIndices" [7 9]"#,
    );
    let m = mesh(&scene.shapes[0]);
    assert_eq!(m.triangles, [[0, 1, 2], [2, 1, 3]]);
    assert_eq!(m.positions[3], Vec3::new(2.0, 3.0, 1.0));
    assert_eq!(m.uvs.as_ref().unwrap()[2], Vec2::new(0.0, 1.0));
    assert_eq!(m.normals.as_ref().unwrap().len(), 4);
    assert_eq!(m.tangents.as_ref().unwrap()[1], Vec3::X.extend(0.0));
    assert_eq!(m.face_indices, Some(vec![7, 9]));
    // Three points need no indices.
    let scene = world(r#"Shape "trianglemesh" "point3 P" [0 0 0  2 0 0  0 3 0]"#);
    assert_eq!(mesh(&scene.shapes[0]).triangles, [[0, 1, 2]]);
}

#[test]
fn bilinear_meshes_keep_the_order_of_their_corners() {
    let scene = world(
        r#"Shape "bilinearmesh" "point3 P" [0 0 0  2 0 0  0 3 0  2 3 1]
           Shape "bilinearmesh" "integer indices" [4 0 1 2  3 2 1 0] "point3 P" [0 0 0  2 0 0  0 3 0  2 3 1  5 5 5]"#,
    );
    assert!(matches!(scene.shapes[0].geometry, GeometryDesc::BilinearMesh(_)));
    assert_eq!(mesh(&scene.shapes[0]).quads, [[0, 1, 2, 3]]);
    assert_eq!(mesh(&scene.shapes[1]).quads, [[4, 0, 1, 2], [3, 2, 1, 0]]);
}

#[test]
fn loop_subdivision_is_done_while_reading() {
    let scene = world(
        r#"Shape "loopsubdiv" "integer levels" 2 "integer indices" [0 2 1  0 1 3  1 2 3  2 0 3]
           "point3 P" [0 0 0  4 0 0  0 4 0  0 0 4]"#,
    );
    let m = mesh(&scene.shapes[0]);
    assert_eq!((m.triangles.len(), m.positions.len()), (4 * 16, 34));
    assert_eq!(m.normals.as_ref().unwrap().len(), 34);
}

#[test]
fn solids_combine_and_nest() {
    let scene = world(
        r#"ObjectBegin "ball" Translate 1 0 0 Shape "sphere" ObjectEnd
           ObjectBegin "brick" Shape "box" Shape "torus" ObjectEnd
           ObjectBegin "both" Shape "csg" "string operation" "union" "string operands" ["ball" "brick"] ObjectEnd
           Scale 2 2 2
           Shape "csg" "string operation" "difference" "string operands" ["both" "ball" "brick"]"#,
    );
    let GeometryDesc::Csg(csg) = &scene.shapes[0].geometry else { panic!() };
    assert_eq!(csg.operation, CsgOperation::Difference);
    assert_eq!(csg.operands.iter().map(|shapes| shapes.len()).collect::<Vec<_>>(), [1, 1, 2]);
    assert_eq!(origin(&csg.operands[1][0]), DVec3::new(1.0, 0.0, 0.0));
    let GeometryDesc::Csg(inner) = &csg.operands[0][0].geometry else { panic!() };
    assert_eq!(inner.operation, CsgOperation::Union);
    assert_eq!(scene.shapes[0].index, 4);
    assert!(scene.instances.is_empty());
}

#[test]
fn csg_shapes_of_the_same_objects_share_them() {
    let mut text = "ObjectBegin \"o0\" Shape \"sphere\" \"texture alpha\" \"later\" ObjectEnd\n".to_owned();
    for i in 1..=12 {
        let inner = i - 1;
        text += &format!(
            "ObjectBegin \"o{i}\" Shape \"csg\" \"string operands\" [\"o{inner}\" \"o{inner}\"] ObjectEnd\n"
        );
    }
    let scene = world(&(text + "Texture \"later\" \"float\" \"constant\" \"float value\" 0.25"));
    assert_eq!(scene.objects[12].name, "o12");
    let mut shape = &scene.objects[12].shapes[0];
    for depth in 0..12 {
        let GeometryDesc::Csg(csg) = &shape.geometry else { panic!("{depth}") };
        assert!(std::sync::Arc::ptr_eq(&csg.operands[0], &csg.operands[1]), "{depth}");
        shape = &csg.operands[0][0];
    }
    // What is known at the end came to the innermost, too.
    assert!(matches!(shape.alpha.as_deref(), Some(Texture::Constant(0.25))), "{:?}", shape.alpha);
}

#[test]
fn closed_meshes_are_solids_whatever_their_vertices_share() {
    let tetrahedron = r#"Shape "trianglemesh" "integer indices" [0 2 1  0 1 3  1 2 3  2 4 3]
        "point3 P" [0 0 0  4 0 0  0 4 0  0 0 4  0 0 0]"#;
    let text = format!(
        "ObjectBegin \"a\" {tetrahedron} ObjectEnd ObjectBegin \"b\" Shape \"sphere\" ObjectEnd
         Shape \"csg\" \"string operation\" \"intersection\" \"string operands\" [\"a\" \"b\"]"
    );
    let GeometryDesc::Csg(csg) = &world(&text).shapes[0].geometry.clone() else { panic!() };
    assert_eq!(csg.operation, CsgOperation::Intersection);
    let open = text.replace("  2 4 3]", "]");
    let error = try_read(&format!("WorldBegin {open}")).0.unwrap_err().to_string();
    assert!(error.contains("not closed"), "{error}");
}

#[test]
fn what_is_not_rendered_is_said_and_still_counts() {
    let (scene, warnings) = warned(
        r#"Shape "blob" "integer n" 4
           Shape "sphere""#,
    );
    assert!(warnings[0].contains("unknown shape \"blob\": it is left out"), "{warnings:?}");
    assert_eq!((scene.shapes.len(), scene.shapes[0].index), (1, 1));
}

// Curves and hair.

#[test]
fn curves_that_differ_in_their_points_alone_are_one_shape() {
    let scene = world(
        r#"Shape "curve" "point3 P" [0 0 0 1 0 0 1 1 0 2 2 0] "float width" .1
           Shape "curve" "point3 P" [3 0 0 4 0 0 4 1 0] "integer degree" 2 "float width0" .5 "float width1" .25
           Shape "curve" "string basis" "bspline" "integer splitdepth" 5 "point3 P" [0 0 0 1 0 0 1 1 0 2 2 0 3 2 0]
           Shape "curve" "string type" "cylinder" "point3 P" [0 0 0 1 0 0 1 1 0 2 2 0]
           Translate 0 0 2
           Shape "curve" "string type" "cylinder" "point3 P" [0 0 0 1 0 0 1 1 0 2 2 0]
           Material "hair"
           Shape "curve" "string type" "cylinder" "point3 P" [0 0 0 1 0 0 1 1 0 2 2 0]
           ReverseOrientation
           Shape "curve" "string type" "cylinder" "point3 P" [0 0 0 1 0 0 1 1 0 2 2 0]
           Shape "curve" "string type" "ribbon" "normal N" [0 0 1 0 1 0] "point3 P" [0 0 0 1 0 0 1 1 0 2 2 0]
           Material "diffuse" Shape "sphere""#,
    );
    let curves = |i: usize| {
        let GeometryDesc::Curves(curves) = &scene.shapes[i].geometry else { panic!("{i}") };
        curves
    };
    let indices: Vec<u32> = scene.shapes.iter().map(|shape| shape.index).collect();
    assert_eq!(indices, [0, 3, 4, 5, 6, 7, 8]);
    let sizes: Vec<_> = (0..6).map(|i| (curves(i).len(), curves(i).segment_count())).collect();
    assert_eq!(sizes, [(3, 4), (1, 1), (1, 1), (1, 1), (1, 1), (1, 1)]);
    let joined = (**curves(0)).clone().with_splits(0);
    assert_eq!(
        (joined.width(0, 0.5), joined.width(1, 0.0), joined.width(1, 1.0)),
        (0.1f32.into(), 0.5, 0.25)
    );
    assert_eq!((joined.width(2, 0.0), joined.width(3, 0.3)), (1.0, 1.0));
    let [p0, p1, _, p3] = joined.control_points(1);
    let near = |p: DVec3, x: f64, y: f64| assert!((p - DVec3::new(x, y, 0.0)).length() < 1e-6, "{p}");
    near(p0, 3.0, 0.0);
    near(p1, 3.0 + 2.0 / 3.0, 0.0);
    near(p3, 4.0, 1.0);
    near(joined.control_points(2)[0], 5.0 / 6.0, 1.0 / 6.0);
    assert_eq!([1, 2, 3].map(|i| joined.strand_of(i)), [(1, 0), (2, 0), (2, 1)]);
}

#[test]
fn normals_of_other_curves_than_ribbons_are_ignored() {
    let (scene, warnings) =
        warned(r#"Shape "curve" "normal N" [0 0 1 0 1 0] "point3 P" [0 0 0 1 0 0 1 1 0 2 2 0]"#);
    assert_eq!(warnings, ["warning: scene.pbrt:1:26: normals are of use to curves of type \"ribbon\" only"]);
    assert_eq!(scene.shapes.len(), 1);
}

#[test]
fn hair_is_coloured_by_one_of_its_parameters() {
    let colour = |text: &str| {
        let curve = "Shape \"curve\" \"point3 P\" [0 0 0 1 0 0 1 1 0 2 2 0]";
        let scene = world(&format!("Material \"hair\" {text} {curve}"));
        let MaterialKind::Hair(params) = kind(&scene, 0) else { panic!() };
        params.clone()
    };
    let plain = colour("");
    let HairColour::Melanin { eumelanin, pheomelanin } = &plain.colour else { panic!() };
    assert_eq!((constant(eumelanin), constant(pheomelanin)), (1.3, 0.0));
    let numbers = [&plain.eta, &plain.beta_m, &plain.beta_n, &plain.alpha].map(|texture| constant(texture));
    assert_eq!(numbers, [1.55, 0.3, 0.3, 2.0]);
    let HairColour::Melanin { eumelanin, pheomelanin } = colour("\"float pheomelanin\" 2").colour else {
        panic!()
    };
    assert_eq!((constant(&eumelanin), constant(&pheomelanin)), (0.0, 2.0));
    for name in ["reflectance", "color"] {
        let HairColour::Reflectance(colour) = colour(&format!("\"rgb {name}\" [.1 .2 .3]")).colour else {
            panic!()
        };
        assert_eq!(constant(&colour), Rgb::new(0.1, 0.2, 0.3));
    }
    let HairColour::Absorption(sigma) = colour("\"rgb sigma_a\" [1 2 30]").colour else { panic!() };
    assert_eq!(constant(&sigma), Rgb::new(1.0, 2.0, 30.0));
    let (_, warnings) =
        warned(r#"Material "hair" "rgb sigma_a" [1 2 3] "float eumelanin" 1 "rgb color" [1 1 1]"#);
    assert_eq!(warnings.len(), 2, "{warnings:?}");
    assert!(warnings[0].ends_with("\"color\" is not used where \"sigma_a\" is given"), "{warnings:?}");
}

// Materials and textures.

#[test]
fn every_material_is_read() {
    let scene = world(
        r#"Material "diffuse" "rgb reflectance" [.1 .2 .3] Shape "sphere"
           Material "conductor" "spectrum eta" "metal-Ag-eta" "spectrum k" "metal-Ag-k" "float roughness" .3 Shape "sphere"
           Material "conductor" "rgb reflectance" [.9 .8 .7] "float uroughness" .2 "bool remaproughness" false Shape "sphere"
           Material "dielectric" "spectrum eta" [400 1.5168 700 1.5168] Shape "sphere"
           Material "thindielectric" "float eta" 1.4 Shape "sphere"
           Material "coateddiffuse" "rgb reflectance" [.5 .6 .7] "float roughness" .1 "integer maxdepth" 20 "integer nsamples" 3 "float thickness" .02 Shape "sphere"
           Material "diffusetransmission" "rgb transmittance" [.1 .1 .2] "float scale" .5 Shape "sphere"
           Material "interface" Shape "sphere""#,
    );
    assert!(matches!(kind(&scene, 0), MaterialKind::Diffuse { .. }));
    let MaterialKind::Conductor { eta, k, roughness } = kind(&scene, 1) else { panic!() };
    assert!(constant(eta).r < 0.3 && constant(k).r > 3.0);
    assert!(roughness.remap && constant(&roughness.u) == 0.3 && constant(&roughness.v) == 0.3);
    let MaterialKind::ConductorReflectance { reflectance, roughness } = kind(&scene, 2) else { panic!() };
    assert_eq!(constant(reflectance), Rgb::new(0.9, 0.8, 0.7));
    assert!(!roughness.remap && constant(&roughness.u) == 0.2 && constant(&roughness.v) == 0.0);
    let MaterialKind::Dielectric { eta, .. } = kind(&scene, 3) else { panic!() };
    assert!((eta - 1.5168).abs() < 1e-3, "{eta}");
    assert!(matches!(kind(&scene, 4), MaterialKind::ThinDielectric { eta } if *eta == 1.4));
    let MaterialKind::CoatedDiffuse { thickness, eta, max_depth, samples, .. } = kind(&scene, 5) else {
        panic!()
    };
    assert_eq!((constant(thickness), *eta, *max_depth, *samples), (0.02, 1.5, 20, 3));
    let MaterialKind::DiffuseTransmission { reflectance, transmittance, scale } = kind(&scene, 6) else {
        panic!()
    };
    assert_eq!(constant(reflectance), Rgb::splat(0.25));
    assert_eq!(constant(transmittance), Rgb::new(0.1, 0.1, 0.2));
    assert_eq!(*scale, 0.5);
    assert_eq!(scene.shapes[7].material, None);
}

fn principled(scene: &SceneDesc, shape: usize) -> &PrincipledParams {
    let MaterialKind::Principled(params) = kind(scene, shape) else { panic!("{:?}", kind(scene, shape)) };
    params
}

#[test]
fn the_principled_material_has_the_words_of_mitsuba_and_more() {
    let scene = world(
        r#"Material "principled" Shape "sphere"
           Material "principled" "rgb base_color" [.1 .2 .3] "float metallic" .25 "float roughness" .75 "float anisotropic" .5
             "float specular" .25 "float spec_tint" .1 "float sheen" .4 "float sheen_tint" .6 "float clearcoat" .8
             "float clearcoat_gloss" 1 "float spec_trans" .3 "bool thin" true "float diff_trans" 1
             "float anisotropic_rotation" 90 Shape "sphere"
           Material "principled" "float spec_trans" 1 "spectrum eta" "glass-BK7" "rgb attenuation_color" [.9 .5 .25]
             "float attenuation_distance" 2 "float clearcoat_roughness" .3 "float dispersion" .5 "float sheen_roughness" .2
             "float iridescence" 1 "float iridescence_ior" 1.8 "float iridescence_thickness" 550 Shape "sphere""#,
    );
    let plain = principled(&scene, 0);
    assert_eq!((constant(&plain.base_color), plain.ior), (Rgb::splat(0.5), 1.5));
    assert_eq!((constant(&plain.metallic), constant(&plain.roughness)), (0.0, 0.5));
    assert_eq!((constant(&plain.transmission), constant(&plain.clearcoat)), (0.0, 0.0));
    let all = principled(&scene, 1);
    assert_eq!(all.convention, Convention::Burley);
    assert_eq!((constant(&all.base_color), constant(&all.metallic)), (Rgb::new(0.1, 0.2, 0.3), 0.25));
    assert_eq!((constant(&all.roughness), constant(&all.anisotropy)), (0.75, 0.5));
    // 0.08 times 0.25 is reflected head-on.
    let f0 = ((all.ior - 1.0) / (all.ior + 1.0)).powi(2);
    assert!((f0 - 0.02).abs() < 1e-6, "{f0}");
    assert_eq!((constant(&all.specular_tint), constant(&all.sheen_tint)), (0.1, 0.6));
    assert_eq!((constant(&all.sheen_color), constant(&all.clearcoat)), (Rgb::splat(0.4), 0.2));
    assert!((constant(&all.clearcoat_roughness).powi(2) - 0.001).abs() < 1e-6);
    assert!(constant(&all.transmission) == 0.3 && all.volume.is_none());
    assert_eq!(constant(&all.diffuse_transmission), 0.5);
    assert!((all.anisotropy_rotation - std::f32::consts::FRAC_PI_2).abs() < 1e-6);
    let glass = principled(&scene, 2);
    let volume = glass.volume.unwrap();
    assert!((glass.ior - 1.5168).abs() < 1e-3);
    near_rgb(volume.attenuation_color, [0.9, 0.5, 0.25]);
    assert_eq!((volume.attenuation_distance, constant(&glass.clearcoat_roughness)), (2.0, 0.3));
    assert_eq!((glass.dispersion, constant(&glass.sheen_roughness)), (0.5, 0.2));
    assert_eq!((constant(&glass.iridescence), glass.iridescence_ior), (1.0, 1.8));
    assert_eq!(constant(&glass.iridescence_thickness), 550.0);

    let wrong = |text: &str| try_read(&format!("WorldBegin {text}")).0.unwrap_err().to_string();
    let both = wrong(r#"Material "principled" "float eta" 1.4 "float specular" .5"#);
    assert!(both.contains("\"specular\" excludes \"eta\""), "{both}");
    let endless = wrong(r#"Material "principled" "float attenuation_distance" 0"#);
    assert!(endless.contains("expected more than 0"), "{endless}");
    let (_, warnings) = warned(r#"Material "principled" "float flatness" .5 "float metalic" 1"#);
    assert_eq!(warnings.len(), 2, "{warnings:?}");
    assert!(warnings[1].contains("metallic"), "{warnings:?}");
}

#[test]
fn disney_of_the_last_version_is_the_principled_one() {
    let (scene, warnings) = warned(
        r#"Material "disney" "rgb color" [.1 .2 .3] "float metallic" .5 "float roughness" .25 "float eta" 1.6
           "float speculartint" .1 "float clearcoat" 1 "float clearcoatgloss" 0 "float spectrans" .2 Shape "sphere""#,
    );
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    let disney = principled(&scene, 0);
    assert_eq!((constant(&disney.base_color), constant(&disney.metallic)), (Rgb::new(0.1, 0.2, 0.3), 0.5));
    assert_eq!((constant(&disney.roughness), disney.ior), (0.25, 1.6));
    assert_eq!((constant(&disney.clearcoat), constant(&disney.transmission)), (0.25, 0.2));
    assert!((constant(&disney.clearcoat_roughness).powi(2) - 0.1).abs() < 1e-6);
}

#[test]
fn the_default_material_is_grey() {
    let scene = world("Shape \"sphere\"");
    let MaterialKind::Diffuse { reflectance } = kind(&scene, 0) else { panic!() };
    assert_eq!(constant(reflectance), Rgb::splat(0.5));
}

#[test]
fn mixtures_take_materials_that_stand_before_them() {
    let scene = world(
        r#"Texture "half" "float" "constant" "float value" .3
           MakeNamedMaterial "a" "string type" "diffuse" MakeNamedMaterial "b" "string type" "dielectric"
           MakeNamedMaterial "ab" "string type" "mix" "string materials" ["a" "b"] "texture amount" "half"
           Material "mix" "string materials" ["ab" "b"] Shape "sphere""#,
    );
    let MaterialKind::Mix { materials, amount } = kind(&scene, 0) else { panic!() };
    assert_eq!(constant(amount), 0.5);
    let MaterialKind::Mix { materials: inner, amount } = &materials[0].kind else { panic!() };
    assert_eq!(constant(amount), 0.3);
    assert!(matches!(inner[1].kind, MaterialKind::Dielectric { .. }));
}

#[test]
fn textures_refer_to_each_other_by_kind() {
    let scene = world(
        r#"Texture "x" "float" "constant" "float value" .25
           Texture "x" "spectrum" "constant" "rgb value" [.1 .5 .9]
           Texture "y" "spectrum" "scale" "texture tex" "x" "texture scale" "x"
           Texture "z" "spectrum" "mix" "texture tex1" "y" "rgb tex2" [1 0 0] "float amount" .2
           Material "diffuse" "texture reflectance" "z" "texture displacement" "x" Shape "sphere" "texture alpha" "x""#,
    );
    let MaterialKind::Diffuse { reflectance } = kind(&scene, 0) else { panic!() };
    let Texture::Mix { textures, amount } = &**reflectance else { panic!() };
    assert_eq!(constant(amount), 0.2);
    assert_eq!(constant(&textures[1]), Rgb::new(1.0, 0.0, 0.0));
    let Texture::Scale { texture, scale } = &*textures[0] else { panic!() };
    assert_eq!((constant(texture), constant(scale)), (Rgb::new(0.1, 0.5, 0.9), 0.25));
    assert_eq!(constant(scene.shapes[0].alpha.as_ref().unwrap()), 0.25);
}

#[test]
fn textures_remember_where_they_were_made() {
    let scene = world(
        r#"AttributeBegin Translate 5 6 7
           Texture "c" "spectrum" "checkerboard" "integer dimension" 3 "rgb tex1" [.2 .2 .2] "rgb tex2" [.8 .8 .8]
           Texture "b" "float" "bilerp" "float v00" 1 "float v01" 2 "float v10" 3 "float v11" 4
             "string mapping" "planar" "vector3 v1" [2 0 0] "float udelta" .5
           Texture "d" "float" "directionmix" "vector3 dir" [0 3 4]
           Texture "k" "float" "checkerboard" "float uscale" 8 "float vdelta" .25
           AttributeEnd
           Material "diffuse" "texture reflectance" "c" "texture displacement" "b" Shape "sphere" "texture alpha" "d"
           Shape "sphere" "texture alpha" "k""#,
    );
    let MaterialKind::Diffuse { reflectance } = kind(&scene, 0) else { panic!() };
    let Texture::Checkerboard3d { texture_from_world, textures } = &**reflectance else { panic!() };
    assert_eq!(texture_from_world.point(DVec3::new(5.0, 6.0, 7.0)), DVec3::ZERO);
    assert_eq!(constant(&textures[1]), Rgb::splat(0.8));
    let id = scene.shapes[0].material.unwrap().0 as usize;
    let bump = scene.materials[id].material.displacement.clone().unwrap();
    let Texture::Bilerp { mapping: Mapping2d::Planar { vs, vt, delta, .. }, corners } = &*bump else {
        panic!()
    };
    assert_eq!((*vs, *vt, *delta), (DVec3::new(2.0, 0.0, 0.0), DVec3::Y, Vec2::new(0.5, 0.0)));
    assert_eq!(corners, &[1.0, 2.0, 3.0, 4.0]);
    let Texture::DirectionMix { direction, .. } = &**scene.shapes[0].alpha.as_ref().unwrap() else {
        panic!()
    };
    assert!((*direction - Vec3::new(0.0, 0.6, 0.8)).length() < 1e-6);
    let alpha = scene.shapes[1].alpha.as_ref().unwrap();
    let Texture::Checkerboard2d { mapping: Mapping2d::Uv { scale, delta }, .. } = &**alpha else { panic!() };
    assert_eq!((*scale, *delta), (Vec2::new(8.0, 1.0), Vec2::new(0.0, 0.25)));
}

#[test]
fn an_image_map_is_found_beside_the_scene_and_read_once() {
    let dir = tempfile::tempdir().unwrap();
    let picture = lumbre_image::Image::filled(3, 2, Rgb::new(0.25, 0.5, 1.0));
    let options = lumbre_formats::image::WriteOptions::default();
    lumbre_formats::image::write_image(&dir.path().join("p.pfm"), &picture, &options).unwrap();
    let path = dir.path().join("s.pbrt");
    fs::write(
        &path,
        r#"WorldBegin
           Texture "a" "spectrum" "imagemap" "string filename" "p.pfm" "float scale" 2 "string wrap" "clamp" "string filter" "ewa"
           Texture "b" "spectrum" "imagemap" "string filename" "p.pfm" "string encoding" "gamma 2" "bool invert" true
           Material "diffuse" "texture reflectance" "a" "string normalmap" "p.pfm" Shape "sphere"
           Material "diffuse" "texture reflectance" "b" Shape "sphere"
           LightSource "infinite" "string filename" "p.pfm""#,
    )
    .unwrap();
    let error = open_scene(&path, &ReadOptions::default()).unwrap_err().to_string();
    assert!(error.contains("s.pbrt:6:35: \"p.pfm\" is no environment map (found 3 by 2 pixels"), "{error}");
    fs::write(&path, fs::read_to_string(&path).unwrap().replace("LightSource", "#")).unwrap();
    let (scene, diagnostics) = open_scene(&path, &ReadOptions::default()).unwrap();
    assert_eq!(diagnostics.warnings(), 0);
    let image = |shape| match kind(&scene, shape) {
        MaterialKind::Diffuse { reflectance } => match &**reflectance {
            Texture::Image(image) => image.clone(),
            other => panic!("{other:?}"),
        },
        other => panic!("{other:?}"),
    };
    assert_eq!((image(0).scale, image(0).invert, image(1).invert), (2.0, false, true));
    assert_eq!(image(0).image.options().wrap, lumbre_shading::Wrap::Clamp);
    near_rgb(image(0).image.bitmap().rgb(1, 1), [0.25, 0.5, 1.0]);
    near_rgb(image(1).image.bitmap().rgb(1, 1), [0.0625, 0.25, 1.0]);
    let id = scene.shapes[0].material.unwrap().0 as usize;
    let bump = scene.materials[id].material.normal_map.as_ref().unwrap();
    assert_eq!(bump.image.bitmap().width(), 3);
}

#[test]
fn colour_spaces_change_reflectances_and_lights() {
    let scene = world(
        r#"ColorSpace "aces2065-1" Material "diffuse" "rgb reflectance" [.5 .5 .5] Shape "sphere"
           LightSource "infinite" "rgb L" [2 2 2]"#,
    );
    let MaterialKind::Diffuse { reflectance } = kind(&scene, 0) else { panic!() };
    near_rgb(constant(reflectance), [0.5; 3]);
    let LightDesc::Infinite { radiance, .. } = scene.lights[0] else { panic!() };
    assert!(radiance.r > radiance.b && (radiance.luminance() - 2.0).abs() < 2e-3, "{radiance:?}");
}

// Lights.

#[test]
fn rgb_lights_keep_numbers_and_spectra_become_one_nit() {
    let scene = world(
        r#"LightSource "point" "rgb I" [3 4 5] "float scale" 2 "point3 from" [1 2 3]
           LightSource "point" "blackbody I" 3000 "float scale" 2
           LightSource "point" "spectrum I" [400 7 700 7]
           LightSource "point" "spectrum I" "stdillum-A"
           LightSource "point""#,
    );
    let intensity = |i: usize| match scene.lights[i].bare() {
        LightDesc::Point { intensity, .. } => *intensity,
        other => panic!("{other:?}"),
    };
    // A spectrum is kept in addition to the colour.
    let has_spectrum = |i: usize| matches!(scene.lights[i], LightDesc::Spectral { .. });
    assert_eq!([0, 1, 2, 3, 4].map(has_spectrum), [false, true, true, true, false]);
    near_rgb(intensity(0), [6.0, 8.0, 10.0]);
    assert!((intensity(1).luminance() - 2.0).abs() < 1e-4 && intensity(1).r > intensity(1).b);
    assert!((intensity(2).luminance() - 1.0).abs() < 1e-4);
    assert!((intensity(3).luminance() - 1.0).abs() < 1e-4);
    near_rgb(intensity(4), [1.0; 3]);
    let LightDesc::Point { from, .. } = scene.lights[0] else { panic!() };
    assert_eq!(from, DVec3::new(1.0, 2.0, 3.0));
}

#[test]
fn photometric_units_replace_the_normalisation() {
    let scene = world(
        r#"LightSource "point" "float power" 100
           LightSource "spot" "blackbody I" 5000 "float power" 100 "float coneangle" 60 "float conedeltaangle" 60
           LightSource "distant" "float illuminance" 1000 "point3 from" [0 0 5] "point3 to" [0 0 0]
           LightSource "infinite" "float illuminance" 1000
           AreaLightSource "diffuse" "rgb L" [1 2 3] "float power" 50 "bool twosided" true "float scale" 2 Shape "sphere""#,
    );
    let pi = std::f32::consts::PI;
    let LightDesc::Point { intensity, .. } = scene.lights[0] else { panic!() };
    near_rgb(intensity, [100.0 / (4.0 * pi); 3]);
    let LightDesc::Spot { intensity, .. } = *scene.lights[1].bare() else { panic!() };
    // 2π((1 − cos 0) + (cos 0 − cos 60°)/2)
    assert!((intensity.luminance() - 100.0 / (2.0 * pi * 0.25)).abs() < 1e-3);
    let LightDesc::Distant { towards, irradiance } = scene.lights[2] else { panic!() };
    near_rgb(irradiance, [1000.0; 3]);
    assert_eq!(towards, DVec3::Z);
    let LightDesc::Infinite { radiance, .. } = scene.lights[3] else { panic!() };
    near_rgb(radiance, [1000.0 / pi; 3]);
    let light = scene.shapes[0].area_light.as_ref().unwrap();
    assert_eq!((light.power, light.two_sided), (Some(50.0), true));
    near_rgb(light.radiance, [2.0, 4.0, 6.0]);
}

#[test]
fn a_sky_is_a_sun_and_what_is_around() {
    let scene = world(
        r#"LightSource "sky" "float azimuth" 90 "float elevation" 30 "float scale" 2
           Rotate -90 1 0 0
           LightSource "sky" "string at" "2026-06-21T12:00Z,90,0" "float skyscale" 0 "float sunangle" 2
           LightSource "sky" "float sunscale" 0 "float turbidity" 5 "float albedo" 0
           LightSource "distant" "point3 from" [0 0 5] "point3 to" [0 0 0] "float angle" 3"#,
    );
    let disc = |light: &LightDesc| match *light.bare() {
        LightDesc::Disc { towards, angle, irradiance } => (towards, angle, irradiance),
        _ => panic!(),
    };
    let sky = |light: &LightDesc| matches!(light, LightDesc::Infinite { image: Some(_), .. });
    assert_eq!(scene.lights.len(), 5);
    let (towards, angle, twice) = disc(&scene.lights[0]);
    assert!(towards.distance(DVec3::new(0.75_f64.sqrt(), 0.0, 0.5)) < 1e-9 && angle == 0.533);
    assert!(sky(&scene.lights[1]) && sky(&scene.lights[3]));
    // At the pole, in y: the elevation is the declination, 23.44 degrees.
    let (towards, angle, once) = disc(&scene.lights[2]);
    assert!((towards.y - 23.44_f64.to_radians().sin()).abs() < 1e-3 && angle == 2.0, "{towards}");
    assert!(twice.luminance() > 2.0 * once.luminance());
    let (towards, angle, irradiance) = disc(&scene.lights[4]);
    assert_eq!((towards, angle), (DVec3::Y, 3.0));
    near_rgb(irradiance, [1.0; 3]);
}

#[test]
fn a_spot_opens_along_z_of_its_space() {
    let scene = world(
        r#"Translate 10 0 0 LightSource "spot" "point3 from" [1 2 3] "point3 to" [4 2 3] "rgb I" [2 2 2]
           "float coneangle" 40 "float conedeltaangle" 10"#,
    );
    let LightDesc::Spot { world_from_light, cone_angle, cone_delta_angle, .. } = scene.lights[0] else {
        panic!()
    };
    near(world_from_light.point(DVec3::ZERO), DVec3::new(11.0, 2.0, 3.0));
    near(world_from_light.vector(DVec3::Z), DVec3::X);
    assert_eq!((cone_angle, cone_delta_angle), (40.0, 10.0));
}

#[test]
fn environments_are_equal_area_or_latitude_longitude() {
    let dir = tempfile::tempdir().unwrap();
    let options = lumbre_formats::image::WriteOptions::default();
    for (name, width) in [("square.pfm", 4), ("wide.pfm", 8)] {
        let picture = lumbre_image::Image::filled(width, 4, Rgb::new(1.0, 2.0, 4.0));
        lumbre_formats::image::write_image(&dir.path().join(name), &picture, &options).unwrap();
    }
    let path = dir.path().join("s.pbrt");
    fs::write(
        &path,
        r#"WorldBegin LightSource "infinite" "string filename" "square.pfm" "float scale" 3
           Rotate 90 0 0 1 LightSource "infinite" "string filename" "wide.pfm" "float illuminance" 10"#,
    )
    .unwrap();
    let (scene, _) = open_scene(&path, &ReadOptions::default()).unwrap();
    let light = |i: usize| match &scene.lights[i] {
        LightDesc::Infinite { world_from_light, radiance, image: Some(image) } => {
            (world_from_light, *radiance, image)
        }
        other => panic!("{other:?}"),
    };
    assert_eq!(light(0).2.mapping, EnvironmentMapping::EqualArea);
    near_rgb(light(0).1, [3.0; 3]);
    assert_eq!(light(1).2.mapping, EnvironmentMapping::LatitudeLongitude);
    let y = light(1).2.image.pixel(3, 2).luminance() * std::f32::consts::PI;
    assert!((light(1).1.r * y / 10.0 - 1.0).abs() < 1e-5);
    // The map's edge is at +x, its middle at -x, which the rotation takes to -y.
    near(light(1).0.vector(DVec3::X), DVec3::NEG_Y);
}

#[test]
fn goniometric_lights_exchange_y_and_z_of_their_image() {
    let dir = tempfile::tempdir().unwrap();
    let options = lumbre_formats::image::WriteOptions::default();
    // The mean of the channels counts. In the square the middle is +z of the image's own space, which is +y of the
    // light's.
    let square: Vec<Rgb> = (0..8 * 8)
        .map(|i| if (2..6).contains(&(i % 8)) && (2..6).contains(&(i / 8)) { 4.0 } else { 1.0 })
        .map(|level| Rgb::new(0.5, 1.0, 1.5) * level)
        .collect();
    let square = lumbre_image::Image::from_pixels(8, 8, square).unwrap();
    lumbre_formats::image::write_image(&dir.path().join("square.pfm"), &square, &options).unwrap();
    let path = dir.path().join("s.pbrt");
    fs::write(
        &path,
        r#"WorldBegin Translate 1 2 3
           LightSource "goniometric" "string filename" "square.pfm" "rgb I" [2 4 6]
           LightSource "goniometric" "string filename" "square.pfm" "float power" 100
           LightSource "goniometric" "float power" 100"#,
    )
    .unwrap();
    let (scene, diagnostics) = open_scene(&path, &ReadOptions::default()).unwrap();
    let warnings = diagnostics.lines();
    assert!(warnings.len() == 1 && warnings[0].contains("without a filename"), "{warnings:?}");
    let resolved = Scene::build(scene.clone()).unwrap();
    let found = |light: usize, direction: DVec3| {
        let at = DVec3::new(1.0, 2.0, 3.0) + 2.0 * direction;
        resolved.lights()[light].irradiance(at, 0.0, -direction).unwrap() * 4.0
    };
    near_rgb(found(0, DVec3::Y), [8.0, 16.0, 24.0]);
    for other in [DVec3::NEG_Y, DVec3::new(0.8, -0.6, 0.0), DVec3::new(0.0, -0.6, -0.8)] {
        near_rgb(found(0, other), [2.0, 4.0, 6.0]);
    }
    let LightDesc::Goniometric { intensity, image, .. } = &scene.lights[1] else { panic!() };
    let mean = image.image.mean().g;
    assert!((mean - 1.75).abs() < 1e-6);
    near_rgb(*intensity, [100.0 / (4.0 * std::f32::consts::PI * mean); 3]);
    let LightDesc::Point { from, intensity } = scene.lights[2] else { panic!() };
    assert_eq!(from, DVec3::new(1.0, 2.0, 3.0));
    near_rgb(intensity, [100.0 / (4.0 * std::f32::consts::PI); 3]);
}

#[test]
fn interfaces_and_objects_give_no_light_and_say_so() {
    let (scene, warnings) = warned(
        r#"MakeNamedMaterial "i" "string type" "interface" AreaLightSource "diffuse"
           AttributeBegin NamedMaterial "i" Shape "sphere" AttributeEnd
           ObjectBegin "o" Shape "sphere" ObjectEnd Shape "disk""#,
    );
    assert_eq!(warnings.len(), 2, "{warnings:?}");
    assert!(warnings.iter().any(|w| w.contains(":2:45: an interface gives no light")), "{warnings:?}");
    assert!(warnings.iter().any(|w| w.contains(":3:28: a shape inside an object gives no light")));
    assert!(scene.shapes[0].area_light.is_none() && scene.shapes[1].area_light.is_some());
    assert!(scene.objects[0].shapes[0].area_light.is_none());
}

// Settings.

#[test]
fn what_a_scene_leaves_open_is_what_the_language_says() {
    let scene = read("WorldBegin");
    assert_eq!((scene.film.width, scene.film.height), (Some(1280), Some(720)));
    assert_eq!(scene.sampler, SamplerDesc { kind: SamplerKind::Sobol, spp: Some(16), seed: 0 });
    assert_eq!(scene.integrator, IntegratorDesc::default());
    assert_eq!(scene.filter, FilterDesc::default());
    let CameraKind::Perspective { fov, lens_radius, focal_distance } = scene.cameras[0].kind else {
        panic!()
    };
    assert_eq!((fov, lens_radius, focal_distance), (90.0, 0.0, 1e6));
}

#[test]
fn cameras_are_read() {
    let cases = [
        (
            r#""perspective" "float fov" 35 "float lensradius" .25 "float focaldistance" 7"#,
            CameraKind::Perspective { fov: 35.0, lens_radius: 0.25, focal_distance: 7.0 },
        ),
        (r#""orthographic""#, CameraKind::Orthographic { lens_radius: 0.0, focal_distance: 1e6 }),
        (r#""spherical""#, CameraKind::Spherical { mapping: SphericalMapping::EqualArea }),
        (
            r#""spherical" "string mapping" "equirectangular""#,
            CameraKind::Spherical { mapping: SphericalMapping::Equirectangular },
        ),
    ];
    for (text, kind) in cases {
        let window =
            r#""float screenwindow" [-2 3 -1 1] "float frameaspectratio" 2.5 "float shutterclose" .5"#;
        let scene = read(&format!("Camera {text} {window} WorldBegin"));
        let camera = &scene.cameras[0];
        assert_eq!(camera.kind, kind);
        assert_eq!(camera.screen_window, Some([-2.0, 3.0, -1.0, 1.0]));
        assert_eq!(camera.frame_aspect, Some(2.5));
        assert_eq!((camera.shutter_open, camera.shutter_close), (0.0, 0.5));
    }
}

#[test]
fn the_film_is_read_and_its_exposure_is_that_of_shutter_and_iso() {
    let scene = read(
        r#"Film "rgb" "string filename" "out.png" "integer xresolution" 300 "integer yresolution" 200
           "integer pixelbounds" [10 500 20 100] "float cropwindow" [.75 .25 0 1] "float iso" 200
           "float maxcomponentvalue" 9
           Camera "perspective" "float shutteropen" 1 "float shutterclose" 1.25 WorldBegin"#,
    );
    let film = &scene.film;
    assert_eq!(film.filename.as_deref(), Some("out.png"));
    assert_eq!((film.width, film.height), (Some(300), Some(200)));
    assert_eq!(film.pixel_bounds, Some([10, 300, 20, 100]));
    assert_eq!(film.crop_window, Some([0.25, 0.75, 0.0, 1.0]));
    assert_eq!((film.exposure, film.max_component), (0.5, 9.0));
}

#[test]
fn filters_are_read() {
    let radius = Vec2::new(3.0, 2.5);
    let cases = [
        (r#""box""#, FilterDesc::Box { radius }),
        (r#""triangle""#, FilterDesc::Triangle { radius }),
        (r#""gaussian" "float sigma" .7"#, FilterDesc::Gaussian { radius, sigma: 0.7 }),
        (r#""mitchell" "float B" .5 "float C" .25"#, FilterDesc::Mitchell { radius, b: 0.5, c: 0.25 }),
        (r#""sinc" "float tau" 4"#, FilterDesc::Sinc { radius, tau: 4.0 }),
    ];
    for (text, filter) in cases {
        let scene = read(&format!("PixelFilter {text} \"float xradius\" 3 \"float yradius\" 2.5 WorldBegin"));
        assert_eq!(scene.filter, filter);
    }
    assert_eq!(read("PixelFilter \"box\" WorldBegin").filter, FilterDesc::Box { radius: Vec2::splat(0.5) });
}

#[test]
fn samplers_and_integrators_are_read_and_the_last_wins() {
    let scene = read(
        r#"Sampler "halton" "integer pixelsamples" 5 Sampler "stratified" "integer xsamples" 3 "integer ysamples" 5
           Integrator "path" Integrator "ambientocclusion" "bool cossample" false "float maxdistance" 3 WorldBegin"#,
    );
    assert_eq!(scene.sampler, SamplerDesc { kind: SamplerKind::Sobol, spp: Some(15), seed: 0 });
    let ambient = IntegratorKind::AmbientOcclusion { cosine: false, max_distance: 3.0 };
    assert_eq!(scene.integrator.kind, ambient);
    for (name, kind) in [
        ("path", IntegratorKind::Path { regularize: true }),
        ("volpath", IntegratorKind::Path { regularize: true }),
    ] {
        let scene = read(&format!(
            "Integrator \"{name}\" \"bool regularize\" true \"integer maxdepth\" 9 Option \"seed\" 42
             Sampler \"independent\" \"integer seed\" 7 \"integer pixelsamples\" 3 WorldBegin"
        ));
        assert_eq!(scene.integrator, IntegratorDesc { kind, max_depth: 9, ..IntegratorDesc::default() });
        assert_eq!(scene.sampler, SamplerDesc { kind: SamplerKind::Independent, spp: Some(3), seed: 42 });
    }
    for (name, kind) in [
        ("caustics", IntegratorKind::Caustics),
        ("whitted", IntegratorKind::Whitted { light_samples: 1, sky: false }),
        ("normals", IntegratorKind::Normals),
        ("depth", IntegratorKind::Depth),
        ("albedo", IntegratorKind::Albedo),
        ("uv", IntegratorKind::Uv),
    ] {
        assert_eq!(read(&format!("Integrator \"{name}\" WorldBegin")).integrator.kind, kind);
    }
    let scene = read("Integrator \"whitted\" \"integer lightsamples\" 9 \"bool sky\" true WorldBegin");
    assert_eq!(scene.integrator.kind, IntegratorKind::Whitted { light_samples: 9, sky: true });
}

#[test]
fn integrators_for_caustics_map_to_caustics() {
    for (name, differs) in [
        ("sppm", "its radius is a few pixels"),
        ("bdpt", "it connects no vertices"),
        ("mlt", "it mutates no paths"),
        ("lightpath", "is not black"),
    ] {
        let (scene, diagnostics) =
            try_read(&format!("Integrator \"{name}\" \"integer maxdepth\" 7 WorldBegin"));
        let integrator = scene.unwrap().integrator;
        assert_eq!((integrator.kind, integrator.max_depth), (IntegratorKind::Caustics, 7));
        let lines = diagnostics.lines();
        let is_note = |line: &String| line.starts_with("note") && line.contains(differs);
        assert!(lines.len() == 1 && lines.iter().all(is_note), "{lines:?}");
    }
}

#[test]
fn every_integrator_says_what_it_makes_of_shading_normals() {
    for name in ["path", "caustics", "whitted", "ambientocclusion"] {
        for (value, expected) in [
            ("", ShadingNormals::Lumbre),
            ("\"string shadingnormals\" \"lumbre\"", ShadingNormals::Lumbre),
            ("\"string shadingnormals\" \"pbrt\"", ShadingNormals::Pbrt),
        ] {
            let scene = read(&format!("Integrator \"{name}\" {value} WorldBegin"));
            assert_eq!(scene.integrator.shading_normals, expected, "{name} {value}");
        }
    }
    let (refused, _) = try_read("Integrator \"path\" \"string shadingnormals\" \"pbtr\" WorldBegin");
    let wrong = refused.unwrap_err().to_string();
    assert!(wrong.contains("one of lumbre, pbrt; did you mean \"pbrt\"?"), "{wrong}");
}

// Files.

#[test]
fn includes_are_textual_and_imports_leave_the_state_alone() {
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| fs::write(dir.path().join(name), text).unwrap();
    fs::create_dir(dir.path().join("sub")).unwrap();
    // Names start at the folder of the first file, and a parameter list may go on behind the include.
    write("sub/a.pbrt", "Translate 1 0 0\nInclude \"sub/b.pbrt\"");
    write("sub/b.pbrt", "Translate 0 2 0 Material \"diffuse\"");
    write("sub/c.pbrt", "Translate 0 0 9 Shape \"sphere\" Material \"dielectric\"");
    write(
        "main.pbrt",
        "WorldBegin Include \"sub/a.pbrt\" \"rgb reflectance\" [.1 .2 .3] Shape \"disk\" Import \"sub/c.pbrt\" Shape \"sphere\"",
    );
    let (scene, diagnostics) = open_scene(&dir.path().join("main.pbrt"), &ReadOptions::default()).unwrap();
    assert_eq!(diagnostics.lines(), [""; 0]);
    let at: Vec<DVec3> = scene.shapes.iter().map(origin).collect();
    assert_eq!(at, [DVec3::new(1.0, 2.0, 0.0), DVec3::new(1.0, 2.0, 9.0), DVec3::new(1.0, 2.0, 0.0)]);
    for shape in [0, 2] {
        let MaterialKind::Diffuse { reflectance } = kind(&scene, shape) else { panic!() };
        assert_eq!(constant(reflectance), Rgb::new(0.1, 0.2, 0.3));
    }
    let indices: Vec<u32> = scene.shapes.iter().map(|s| s.index).collect();
    assert_eq!(indices, [0, 1, 2]);
}

#[test]
fn several_files_are_read_as_one_and_gzip_is_unpacked() {
    use std::io::Write;
    let dir = tempfile::tempdir().unwrap();
    let (a, b) = (dir.path().join("a.pbrt"), dir.path().join("b.pbrt.gz"));
    fs::write(&a, "Camera \"orthographic\" WorldBegin Translate 1 2 3").unwrap();
    let mut packer =
        flate2::write::GzEncoder::new(fs::File::create(&b).unwrap(), flate2::Compression::fast());
    packer.write_all(b"Shape \"sphere\"").unwrap();
    packer.finish().unwrap();
    let (scene, _) = open_scenes(&[a, b], &ReadOptions::default()).unwrap();
    assert_eq!(origin(&scene.shapes[0]), DVec3::new(1.0, 2.0, 3.0));
}

#[test]
fn meshes_are_read_from_files_and_shared() {
    let dir = tempfile::tempdir().unwrap();
    let ply = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
               element face 2\nproperty list uchar int vertex_indices\nend_header\n\
               0 0 0\n2 0 0\n0 3 0\n0 0 4\n3 0 1 2\n3 0 1 3\n";
    fs::write(dir.path().join("m.ply"), ply).unwrap();
    let path = dir.path().join("s.pbrt");
    fs::write(
        &path,
        r#"WorldBegin Shape "plymesh" "string filename" "m.ply" Translate 5 0 0 Shape "plymesh" "string filename" "m.ply"
           ObjectBegin "o" Shape "plymesh" "string filename" "m.ply" ObjectEnd"#,
    )
    .unwrap();
    let (scene, _) = open_scene(&path, &ReadOptions::default()).unwrap();
    let pointer = |shape: &ShapeDesc| match &shape.geometry {
        GeometryDesc::Mesh(mesh) => std::sync::Arc::as_ptr(mesh),
        other => panic!("{other:?}"),
    };
    assert_eq!(mesh(&scene.shapes[0]).triangles, [[0, 1, 2], [0, 1, 3]]);
    assert_eq!(pointer(&scene.shapes[0]), pointer(&scene.shapes[1]));
    assert_eq!(pointer(&scene.shapes[0]), pointer(&scene.objects[0].shapes[0]));
}

// Kindness.

#[test]
fn wrong_names_are_warnings_with_the_right_one() {
    let (scene, warnings) = warned(
        r#"Shape "spere" "float radius" 2
Shape "sphere" "float raduis" 2
Shap "sphere" "float radius" [1 2]
Material "difuse" "rgb reflectance" [1 0 0] Shape "sphere"
LightSource "poitn" Option "sead" 3"#,
    );
    assert_eq!(
        warnings,
        [
            r#"warning: scene.pbrt:1:12: unknown shape "spere": it is left out (did you mean "sphere"?)"#,
            r#"warning: scene.pbrt:2:16: unknown parameter "raduis" of shape "sphere" (did you mean "radius"?)"#,
            r#"warning: scene.pbrt:3:1: unknown directive "Shap" (did you mean "Shape"?)"#,
            r#"warning: scene.pbrt:4:1: unknown material "difuse": a diffuse one takes its place (did you mean "diffuse"?)"#,
            r#"warning: scene.pbrt:5:1: unknown light "poitn": it is left out (did you mean "point"?)"#,
            r#"warning: scene.pbrt:5:28: unknown option "sead" (did you mean "seed"?)"#,
        ]
    );
    assert_eq!(scene.shapes.len(), 2);
}

#[test]
fn strict_makes_warnings_errors_and_lenient_drops_faces() {
    let read_as = |text: &str, strictness| {
        let mut diagnostics = Diagnostics::with_strictness(strictness);
        let budget = Budget::new(Limits::default());
        let scene = pbrt::read_bytes("s.pbrt", text.as_bytes(), None, &budget, &mut diagnostics);
        scene.map(|scene| (scene, diagnostics)).map_err(|e| e.to_string())
    };
    let text = "WorldBegin Shape \"sphere\" \"float raduis\" 2";
    assert_eq!(
        read_as(text, Strictness::Strict).unwrap_err(),
        r#"s.pbrt:1:27: unknown parameter "raduis" of shape "sphere" (did you mean "radius"?)"#
    );
    let text = r#"WorldBegin Shape "trianglemesh" "integer indices" [0 1 2  0 1 7  1 2 3] "point3 P" [0 0 0 2 0 0 0 3 0 0 0 4]"#;
    assert!(read_as(text, Strictness::Normal).is_err());
    let (scene, diagnostics) = read_as(text, Strictness::Lenient).unwrap();
    assert_eq!(mesh(&scene.shapes[0]).triangles, [[0, 1, 2], [1, 2, 3]]);
    assert_eq!(diagnostics.warnings(), 1);
}

#[test]
fn reflectances_above_one_are_held_there() {
    let (scene, warnings) = warned(r#"Material "diffuse" "rgb reflectance" [2 .5 .5] Shape "sphere""#);
    let MaterialKind::Diffuse { reflectance } = kind(&scene, 0) else { panic!() };
    assert_eq!(constant(reflectance), Rgb::new(1.0, 0.5, 0.5));
    assert_eq!(warnings.len(), 1);
}

// pbrt-v3.

#[test]
fn scenes_of_the_last_version_are_upgraded_with_one_line() {
    let (scene, diagnostics) = try_read(
        r#"LookAt 0 0 -5 0 0 0 0 1 0
Camera "perspective" "float fov" 30
Film "image" "integer xresolution" [40] "integer yresolution" [30] "string filename" "old.exr"
Sampler "lowdiscrepancy" "integer pixelsamples" 8
SurfaceIntegrator "directlighting"
WorldBegin
Texture "t" "color" "scale" "color tex1" [.2 .4 .6] "color tex2" [.5 .5 .5]
MakeNamedMaterial "m" "string type" "matte" "texture Kd" "t"
NamedMaterial "m"
Shape "trianglemesh" "point P" [0 0 0 2 0 0 0 3 0] "float uv" [0 0 1 0 0 1] "integer indices" [0 1 2]
Material "plastic" "color Kd" [.1 .2 .3] "float roughness" .2 "bool remaproughness" "false" Shape "sphere"
Material "mirror" Shape "sphere"
Material "glass" "float index" 1.6 Shape "sphere"
Material "metal" "spectrum eta" "metal-Au-eta" "spectrum k" "metal-Au-k" Shape "sphere"
Material "translucent" "color Kd" [.8 .8 .4] "rgb transmit" [.25 .25 .25] Shape "sphere"
MakeNamedMaterial "g" "string type" "glass"
Material "mix" "string namedmaterial1" "m" "string namedmaterial2" "g" "color amount" [.25 .25 .25] Shape "sphere"
TransformBegin Translate 1 2 3 Material "matte" "rgb Kd" [.9 .9 .9] TransformEnd Shape "sphere"
LightSource "distant" "color L" [1 2 3] "color scale" [2 2 2] "point from" [0 0 9]
LightSource "point" "blackbody I" [4000 3]
WorldEnd"#,
    );
    assert_eq!(
        diagnostics.lines(),
        ["warning: scene.pbrt:3:1: this is of pbrt-v3: the scene is upgraded to pbrt-v4 while it is read"]
    );
    let scene = scene.unwrap();
    assert_eq!((scene.film.width, scene.sampler.spp), (Some(40), Some(8)));
    assert_eq!(scene.integrator.kind, IntegratorKind::Whitted { light_samples: 1, sky: true });
    let MaterialKind::Diffuse { reflectance } = kind(&scene, 0) else { panic!() };
    let Texture::Scale { texture, scale } = &**reflectance else { panic!() };
    assert_eq!((constant(texture), constant(scale)), (Rgb::new(0.2, 0.4, 0.6), 0.5));
    assert_eq!(mesh(&scene.shapes[0]).uvs.as_ref().unwrap()[1], Vec2::new(1.0, 0.0));
    let MaterialKind::Uber(plastic) = kind(&scene, 1) else { panic!() };
    assert_eq!(constant(&plastic.kd), Rgb::new(0.1, 0.2, 0.3));
    assert!(!plastic.roughness.remap && constant(&plastic.roughness.u) == 0.2);
    let MaterialKind::ConductorReflectance { reflectance, .. } = kind(&scene, 2) else { panic!() };
    assert_eq!(constant(reflectance), Rgb::splat(0.9));
    assert!(matches!(kind(&scene, 3), MaterialKind::Dielectric { eta, .. } if *eta == 1.6));
    let MaterialKind::Conductor { eta, roughness, .. } = kind(&scene, 4) else { panic!() };
    assert!(constant(eta).b > constant(eta).r && constant(&roughness.u) == 0.01);
    let MaterialKind::DiffuseTransmission { reflectance, transmittance, .. } = kind(&scene, 5) else {
        panic!()
    };
    near_rgb(constant(reflectance), [0.4, 0.4, 0.2]);
    near_rgb(constant(transmittance), [0.2, 0.2, 0.1]);
    let MaterialKind::Mix { amount, materials } = kind(&scene, 6) else { panic!() };
    assert_eq!(constant(amount), 0.75);
    assert!(matches!(materials[1].kind, MaterialKind::Dielectric { .. }));
    // Its TransformEnd gives the transform back and leaves the material.
    assert_eq!(origin(&scene.shapes[7]), DVec3::ZERO);
    let MaterialKind::Diffuse { reflectance } = kind(&scene, 7) else { panic!() };
    assert_eq!(constant(reflectance), Spectrum::splat(0.9));
    let LightDesc::Distant { irradiance, .. } = scene.lights[0] else { panic!() };
    near_rgb(irradiance, [2.0, 4.0, 6.0]);
    let LightDesc::Point { intensity, .. } = *scene.lights[1].bare() else { panic!() };
    assert!((intensity.luminance() - 3.0).abs() < 1e-3);
}

#[test]
fn transform_begin_of_the_current_version_saves_everything() {
    let scene = world(
        r#"Material "dielectric" TransformBegin Translate 1 2 3 Material "diffuse" TransformEnd Shape "sphere""#,
    );
    assert!(matches!(kind(&scene, 0), MaterialKind::Dielectric { .. }));
}

#[test]
fn textures_may_be_defined_after_their_use() {
    let scene = world(
        r#"Material "diffuse" "texture reflectance" "later" Shape "sphere" "texture alpha" "holes"
           MakeNamedMaterial "a" "string type" "diffuse" "texture reflectance" "later"
           MakeNamedMaterial "b" "string type" "mix" "string materials" ["a" "a"]
           NamedMaterial "b" Shape "disk"
           Texture "later" "spectrum" "constant" "rgb value" [.2 .4 .6]
           Texture "holes" "float" "constant" "float value" .25"#,
    );
    let MaterialKind::Diffuse { reflectance } = kind(&scene, 0) else { panic!() };
    assert_eq!(constant(reflectance), Rgb::new(0.2, 0.4, 0.6));
    assert_eq!(constant(scene.shapes[0].alpha.as_ref().unwrap()), 0.25);
    let MaterialKind::Mix { materials, .. } = kind(&scene, 1) else { panic!() };
    assert!(matches!(materials[0].kind, MaterialKind::Diffuse { .. }));
    for wrong in [
        r#"Material "diffuse" "texture reflectance" "nowhere" Shape "sphere""#,
        r#"Shape "sphere" "texture alpha" "nowhere""#,
    ] {
        let error = try_read(&format!("WorldBegin\n{wrong}")).0.unwrap_err().to_string();
        assert!(error.contains("texture \"nowhere\" is not defined"), "{error}");
    }
}

#[test]
fn a_missing_image_matters_where_it_is_used() {
    let dir = tempfile::tempdir().unwrap();
    let read = |text: &str, strictness| {
        let mut said = Diagnostics::with_strictness(strictness);
        let text = format!("WorldBegin\n{text}");
        let scene =
            pbrt::read_bytes("s.pbrt", text.as_bytes(), Some(dir.path()), &Budget::default(), &mut said);
        (scene, said.lines())
    };
    let unused = r#"Texture "u" "spectrum" "imagemap" "string filename" "gone.png" Shape "sphere""#;
    let (scene, said) = read(unused, Strictness::Normal);
    assert!(scene.is_ok() && said.len() == 1 && said[0].contains("2:35: gone.png: cannot open"), "{said:?}");
    let used = format!("{unused} Material \"diffuse\" \"texture reflectance\" \"u\" Shape \"disk\"");
    let error = read(&used, Strictness::Normal).0.unwrap_err().to_string();
    assert!(error.starts_with("s.pbrt:2:35: gone.png: cannot open"), "{error}");
    // Lenient reading goes on and names all that is missing.
    let many = format!(
        r#"{used} Include "gone.pbrt" Shape "plymesh" "string filename" "gone.ply"
           LightSource "infinite" "string filename" "gone.exr"
           Material "diffuse" "string normalmap" "flat.png" Shape "sphere""#
    );
    let (scene, said) = read(&many, Strictness::Lenient);
    let last = scene.unwrap().materials.pop().unwrap();
    assert!(last.material.normal_map.is_none());
    for name in ["gone.png", "gone.pbrt", "gone.ply", "gone.exr", "flat.png"] {
        assert!(said.iter().any(|line| line.contains(name)), "{name}: {said:?}");
    }
}

#[test]
fn what_a_film_and_old_materials_ask_for_is_kept() {
    let single = |film: &str| read(&format!("Film \"rgb\" {film}\nWorldBegin")).film.single_precision;
    assert_eq!(
        [single(""), single("\"bool savefp16\" true"), single("\"bool savefp16\" false")],
        [false, false, true]
    );
    for old in ["uber", "plastic", "substrate"] {
        let text = format!("WorldBegin Material \"{old}\" \"float index\" 2.5 Shape \"sphere\"");
        let (scene, _) = try_read(&text);
        let eta = match kind(&scene.unwrap(), 0) {
            MaterialKind::CoatedDiffuse { eta, .. } => *eta,
            MaterialKind::Uber(params) => constant(&params.eta),
            _ => panic!("{old}"),
        };
        assert_eq!(eta, 2.5, "{old}");
    }
}

#[test]
fn every_parameter_of_uber_and_plastic_is_kept() {
    let whole = |text: &str| {
        let (scene, said) = warned(text);
        assert_eq!(said.len(), 1, "only that it is of pbrt-v3: {said:?}");
        scene
    };
    let scene = whole(
        r#"Texture "t" "color" "checkerboard" "color tex1" [.2 .4 .6]
           Material "uber" "rgb Kd" [.1 .2 .3] "rgb Ks" [.4 .5 .6] "rgb Kr" [.7 .8 .9] "texture Kt" "t" "rgb opacity" [.3 .6 .9]
             "float uroughness" .2 "float vroughness" .4 "float index" 1.7 "bool remaproughness" "false" Shape "sphere"
           Material "uber" Shape "sphere"
           Material "plastic" "color Ks" [.3 .2 .1] Shape "sphere""#,
    );
    let uber = |shape: usize| {
        let MaterialKind::Uber(params) = kind(&scene, shape) else { panic!("{:?}", kind(&scene, shape)) };
        params
    };
    let all = uber(0);
    assert_eq!(constant(&all.kd), Rgb::new(0.1, 0.2, 0.3));
    assert_eq!(constant(&all.ks), Rgb::new(0.4, 0.5, 0.6));
    assert_eq!(constant(&all.kr), Rgb::new(0.7, 0.8, 0.9));
    assert!(!all.kt.is_constant());
    assert_eq!(constant(&all.opacity), Rgb::new(0.3, 0.6, 0.9));
    let roughness = [constant(&all.roughness.u), constant(&all.roughness.v)];
    assert_eq!((constant(&all.eta), roughness, all.roughness.remap), (1.7, [0.2, 0.4], false));
    for (shape, ks) in [(1, Rgb::splat(0.25)), (2, Rgb::new(0.3, 0.2, 0.1))] {
        let params = uber(shape);
        assert_eq!((constant(&params.kd), constant(&params.ks)), (Rgb::splat(0.25), ks));
        assert_eq!((constant(&params.kr), constant(&params.kt)), (Rgb::BLACK, Rgb::BLACK));
        assert_eq!((constant(&params.opacity), constant(&params.eta)), (Rgb::WHITE, 1.5));
        assert!(params.roughness.remap && constant(&params.roughness.u) == 0.1);
    }
    // Plastic has no more than that.
    let (_, said) = warned(r#"Material "plastic" "rgb Kr" [.5 .5 .5] Shape "sphere""#);
    assert!(said.iter().any(|line| line.contains("\"Kr\"")), "{said:?}");
}

#[test]
fn a_scene_asks_for_wavelengths_by_its_film_or_its_integrator() {
    for (asks, text) in [
        (false, "Film \"rgb\" Integrator \"path\""),
        (true, "Film \"spectral\" \"integer nbuckets\" 12 \"float lambdamin\" 400 \"float lambdamax\" 700"),
        (true, "Integrator \"volpath\" \"bool spectral\" true Film \"rgb\""),
        (true, "Film \"rgb\" Integrator \"path\" \"bool spectral\" true"),
    ] {
        assert_eq!(try_read(&format!("{text} WorldBegin")).0.unwrap().film.spectral, asks, "{text}");
    }
    for (wrong, expected) in [
        ("\"float lambdamin\" 300", "360 to 830 nm"),
        ("\"float lambdamax\" 900", "360 to 830 nm"),
        ("\"float lambdamin\" 700 \"float lambdamax\" 500", "less than lambdamax"),
        ("\"integer nbuckets\" 0", "nbuckets"),
        ("\"integer nbuckets\" 1000", "1 to 471"),
    ] {
        let error = try_read(&format!("Film \"spectral\" {wrong} WorldBegin")).0.unwrap_err().to_string();
        assert!(error.contains(expected), "{wrong}: {error}");
    }
}

#[test]
fn the_dispersion_of_a_glass_is_kept() {
    let text = |material: &str| {
        format!("WorldBegin Material {material} \"spectrum eta\" \"glass-F11\" Shape \"sphere\"")
    };
    for material in ["\"dielectric\"", "\"thindielectric\""] {
        let scene = read(&text(material));
        let index = scene.materials.iter().find_map(|named| named.material.dispersion.as_ref()).unwrap();
        // At the d line and in the blue, by the catalogue of SF11.
        for (nm, expected) in [(587.6, 1.78472), (435.8, 1.82518)] {
            let found = index.at(nm).unwrap();
            assert!((found - expected).abs() < 2e-4, "{material} at {nm}: {found}");
        }
    }
    let scene = read(&text("\"principled\" \"float spec_trans\" 1"));
    // The language's F11 is SF11, whose Abbe number is 25.76 by its catalogue.
    let found = 20.0 / principled(&scene, 0).dispersion;
    assert!((found - 25.76).abs() < 0.05, "{found}");
}

#[test]
fn the_power_of_an_area_light_keeps_the_factor_of_its_colour() {
    // As pbrt-v4: L x scale x power / (area x pi x sides), whatever the luminance of L.
    let scene = world(
        r#"AreaLightSource "diffuse" "rgb L" [9 8 7] "float scale" 2 "float power" 100 "bool twosided" true
           Translate 0 0 3 Shape "disk" "float radius" 1.5"#,
    );
    // Each face of a mesh is a shape that has the whole power.
    let roof = world(
        r#"AreaLightSource "diffuse" "float power" 100
           Shape "trianglemesh" "integer indices" [0 1 2 0 2 3] "point3 P" [0 0 0 2 0 0 2 3 0 0 9 0] "point2 uv" [0 0 1 0 1 1 0 1]"#,
    );
    assert_eq!(roof.shapes.len(), 2);
    assert_eq!(mesh(&roof.shapes[1]).positions[2].to_array(), [0.0, 9.0, 0.0]);
    let scene = Scene::build(scene).unwrap();
    let ray = Ray::new(DVec3::ZERO, DVec3::Z);
    let seen =
        scene.closest(&ray).map(|hit| scene.interaction(&ray, &hit, &Footprint::Point).emitted()).unwrap();
    let factor = (200.0 / (std::f64::consts::PI.powi(2) * 2.25 * 2.0)) as f32;
    let expected = Rgb::new(9.0, 8.0, 7.0) * factor;
    assert!((seen - expected).map(f32::abs).max_component() < 1e-4, "{seen:?} {expected:?}");
}

#[test]
fn inline_meshes_far_away_keep_their_digits() {
    // A metre of a map, with millimetres.
    let (east, north) = (500_000.125, 4_649_781.25);
    let corners: Vec<DVec3> = [(0.0, 0.0), (1.003, 0.0), (1.003, 1.007), (0.0, 1.007)]
        .map(|(x, y)| DVec3::new(east + x, north + y, 12.5))
        .to_vec();
    let points: Vec<String> = corners.iter().map(|p| format!("{} {} {}", p.x, p.y, p.z)).collect();
    let near = |scene: &SceneDesc, shape: &ShapeDesc, by: DVec3| {
        let (GeometryDesc::Mesh(mesh) | GeometryDesc::BilinearMesh(mesh)) = &shape.geometry else { panic!() };
        assert_eq!(mesh.positions.len(), 4);
        for (found, corner) in mesh.positions.iter().zip(&corners) {
            let found = shape.world_from_object.point(found.as_dvec3());
            assert!((found - *corner - by).abs().max_element() < 1e-6, "{found}");
        }
        assert!(scene.materials.len() < 3);
    };
    for (shape, indices) in [("trianglemesh", "0 1 2 0 2 3"), ("bilinearmesh", "0 1 3 2")] {
        let shape = format!(
            "Shape \"{shape}\" \"integer indices\" [ {indices} ] \"point3 P\" [ {} ]",
            points.join(" ")
        );
        let scene = world(&shape);
        near(&scene, &scene.shapes[0], DVec3::ZERO);
        let scene = world(&format!("Translate -500000 2 3 {shape}"));
        near(&scene, &scene.shapes[0], DVec3::new(-500_000.0, 2.0, 3.0));
        // One that moves stands in an object, to which its motion comes.
        let scene = world(&format!("ActiveTransform EndTime Translate 0 0 9 ActiveTransform All {shape}"));
        near(&scene, &scene.objects[0].shapes[0], DVec3::ZERO);
        let Placement::Moving(motion) = &scene.instances[0].world_from_object else { panic!() };
        assert_eq!(motion.at(1.0).point(DVec3::ZERO), DVec3::new(0.0, 0.0, 9.0));
    }
    // What is near stays what it is, and under the transform that is written.
    let scene = world("Translate 1 2 3 Shape \"trianglemesh\" \"point3 P\" [ 0.1 0.2 0.3  1 0 0  0 1 0 ]");
    assert_eq!(origin(&scene.shapes[0]), DVec3::new(1.0, 2.0, 3.0));
    assert_eq!(mesh(&scene.shapes[0]).positions[0], Vec3::new(0.1, 0.2, 0.3));
    // A loop subdivision of an octahedron is the same far away as near.
    let octahedron = |at: f64| {
        let points = [
            [1.1, 0.0, 0.0],
            [-1.1, 0.0, 0.0],
            [0.0, 1.1, 0.0],
            [0.0, -1.1, 0.0],
            [0.0, 0.0, 1.1],
            [0.0, 0.0, -1.1],
        ];
        let points: Vec<String> = points.iter().map(|[x, y, z]| format!("{} {y} {z}", at + x)).collect();
        let scene = world(&format!(
            "Shape \"loopsubdiv\" \"integer levels\" 2 \"integer indices\" \
             [ 0 2 4 2 1 4 1 3 4 3 0 4 2 0 5 1 2 5 3 1 5 0 3 5 ] \"point3 P\" [ {} ]",
            points.join(" ")
        ));
        let shape = &scene.shapes[0];
        let places = mesh(shape).positions.iter().map(|p| shape.world_from_object.point(p.as_dvec3()));
        places.map(|p| p - DVec3::new(at, 0.0, 0.0)).collect::<Vec<DVec3>>()
    };
    let far = octahedron(16_777_217.0);
    for (a, b) in octahedron(0.0).iter().zip(&far) {
        assert!((*a - *b).abs().max_element() < 1e-6, "{a} {b}");
    }
}

#[test]
fn heightfields_and_nurbs_of_pbrt_v3_become_triangles() {
    let upgraded = |text: &str| {
        let (scene, warnings) = warned(text);
        assert!(warnings.len() == 1 && warnings[0].contains("upgraded"), "{warnings:?}");
        scene
    };
    let scene = upgraded(r#"Shape "heightfield" "integer nu" 3 "integer nv" 2 "float Pz" [0 1 2  3 4 5]"#);
    let field = mesh(&scene.shapes[0]);
    assert_eq!(field.positions[4], Vec3::new(0.5, 1.0, 4.0));
    assert_eq!(field.triangles, [[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]]);
    assert_eq!((field.uvs.as_ref().unwrap()[2], &field.normals), (Vec2::new(1.0, 0.0), &None));

    // A quarter of a cylinder of radius 2 about z: a rational arc by a straight line.
    let w = 0.5_f64.sqrt();
    let scene = upgraded(&format!(
        r#"Shape "nurbs" "integer nu" 3 "integer uorder" 3 "float uknots" [0 0 0 1 1 1]
           "integer nv" 2 "integer vorder" 2 "float vknots" [0 0 3 3]
           "float Pw" [2 0 0 1  {p} {p} 0 {w}  0 2 0 1   2 0 5 1  {p} {p} {q} {w}  0 2 5 1]"#,
        p = 2.0 * w,
        q = 5.0 * w
    ));
    let arc = mesh(&scene.shapes[0]);
    assert_eq!((arc.positions.len(), arc.triangles.len()), (900, 2 * 29 * 29));
    for (position, normal) in arc.positions.iter().zip(arc.normals.as_ref().unwrap()) {
        assert!((position.truncate().length() - 2.0).abs() < 1e-5 && position.z <= 5.0, "{position}");
        let outwards = position.truncate().normalize().extend(0.0);
        assert!((*normal - outwards).length() < 1e-4, "{normal} {outwards}");
    }
    assert_eq!(arc.positions[899], Vec3::new(0.0, 2.0, 5.0));
    assert_eq!(arc.uvs.as_ref().unwrap()[899], Vec2::new(1.0, 3.0));
}

#[test]
fn a_plymesh_is_displaced_by_a_texture_that_may_come_later() {
    let folder = tempfile::tempdir().unwrap();
    let ply = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
               property float u\nproperty float v\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
               0 0 0 0 0\n2 0 0 1 0\n2 2 0 1 1\n0 2 0 0 1\n4 0 1 2 3\n";
    fs::write(folder.path().join("square.ply"), ply).unwrap();
    let scene = |rest: &str| {
        let text = format!(
            "Option \"displacementedgescale\" 0.5\nWorldBegin Scale 3 3 3\n\
             Shape \"plymesh\" \"string filename\" \"square.ply\" \"texture displacement\" \"h\" {rest}\n\
             Shape \"plymesh\" \"string filename\" \"square.ply\"\nTexture \"h\" \"float\" \"constant\" \"float value\" 0.25"
        );
        let path = folder.path().join("scene.pbrt");
        fs::write(&path, text).unwrap();
        let mut diagnostics = Diagnostics::new();
        let scene = pbrt::read_files(&[&*path], &Budget::default(), &mut diagnostics);
        assert_eq!(diagnostics.lines(), [""; 0]);
        scene
    };
    let read = scene("\"float edgelength\" 2").unwrap();
    let (moved, plain) = (mesh(&read.shapes[0]), mesh(&read.shapes[1]));
    assert_eq!(plain.positions.len(), 4);
    assert!(moved.triangles.len() > 100 && moved.positions.iter().all(|p| (p.z - 0.25).abs() < 1e-6));
    for face in &moved.triangles {
        for i in 0..3 {
            let [a, b] = [face[i], face[(i + 1) % 3]].map(|i| moved.positions[i as usize]);
            assert!(3.0 * (a - b).length() < 1.0, "{a} {b}");
        }
    }
    let refused = scene("\"float edgelength\" 1e-7").unwrap_err().to_diagnostic().to_string();
    assert!(refused.contains("edgelength") && refused.contains("--max-"), "{refused}");
}

#[test]
fn subsurface_and_openpbr_take_their_parameters_by_name() {
    let scene = world(
        r#"Material "subsurface" "string name" "Marble" "float scale" 10 Shape "sphere"
           Material "subsurface" "rgb reflectance" [.2 .4 .6] "rgb mfp" [1 2 4] "float g" .5 "float eta" 1.4 Shape "sphere"
           Material "openpbr" "rgb base_color" [.5 .25 .125] "float base_weight" .5 "float specular_ior" 1.7
             "float transmission_weight" 0 "float thin_film_thickness" .3 "float fuzz_weight" .5 Shape "sphere""#,
    );
    let MaterialKind::Subsurface(marble) = kind(&scene, 0) else { panic!("{:?}", kind(&scene, 0)) };
    let anywhere = |params: &lumbre_shading::subsurface::SubsurfaceParams| {
        let at = lumbre_shading::TextureContext {
            point: DVec3::ONE,
            normal: Vec3::Z,
            uv: Vec2::ZERO,
            dpdx: Vec3::ZERO,
            dpdy: Vec3::ZERO,
            duv_dx: Vec2::ZERO,
            duv_dy: Vec2::ZERO,
            vertex: lumbre_shading::VertexData::NONE,
            spectral: None,
        };
        params.medium(&at)
    };
    near_rgb(anywhere(marble).extinction, [21.921, 26.241, 30.071]);
    assert_eq!(marble.eta, 1.33);
    let MaterialKind::Subsurface(wax) = kind(&scene, 1) else { panic!("{:?}", kind(&scene, 1)) };
    near_rgb(anywhere(wax).extinction, [1.0, 0.5, 0.25]);
    assert_eq!((wax.eta, wax.asymmetry, anywhere(wax).asymmetry), (1.4, 0.5, 0.5));
    let MaterialKind::Principled(cloth) = kind(&scene, 2) else { panic!("{:?}", kind(&scene, 2)) };
    near_rgb(constant(&cloth.base_color), [0.25, 0.125, 0.0625]);
    near_rgb(constant(&cloth.sheen_color), [0.5, 0.5, 0.5]);
    assert_eq!((cloth.ior, constant(&cloth.iridescence_thickness)), (1.7, 300.0));
    let (_, warnings) = warned(
        r#"Material "openpbr" "float subsurface_weight" .5 "rgb subsurface_color" [1 .5 1] Shape "sphere""#,
    );
    assert!(warnings.len() == 1 && warnings[0].contains("subsurface_weight"), "{warnings:?}");
    let (scene, warnings) = warned(
        r#"Material "openpbr" "float subsurface_weight" 1 "rgb subsurface_color" [.2 .4 .6] "float subsurface_radius" 4
             "float subsurface_scatter_anisotropy" .5 "float specular_ior" 1.4 "float specular_roughness" .5
             "rgb base_color" [1 0 0] "float coat_weight" .5 "rgb coat_color" [1 0 1] Shape "sphere""#,
    );
    assert!(warnings.len() == 1 && warnings[0].contains("coat_weight"), "{warnings:?}");
    let MaterialKind::Subsurface(skin) = kind(&scene, 0) else { panic!("{:?}", kind(&scene, 0)) };
    near_rgb(anywhere(skin).extinction, [0.25, 0.5, 1.0]);
    assert_eq!((skin.eta, skin.asymmetry, skin.roughness.remap), (1.4, 0.5, false));
    assert!(matches!(*skin.roughness.u, Texture::Constant(0.25)));
    let scene = world(
        r#"Material "openpbr" "float coat_weight" 1 "rgb coat_color" [1 .5 .25] "float coat_ior" 2 "float coat_darkening" .5
             Shape "sphere"
           Material "openpbr" Shape "sphere""#,
    );
    let coats = [0, 1].map(|shape| match kind(&scene, shape) {
        MaterialKind::Principled(params) => {
            (constant(&params.clearcoat_color), params.clearcoat_ior, params.clearcoat_darkening)
        }
        other => panic!("{other:?}"),
    });
    assert_eq!(coats, [(Rgb::new(1.0, 0.5, 0.25), 2.0, 0.5), (Rgb::WHITE, 1.6, 1.0)]);
}

// What is of pbrt alone.

#[test]
fn a_list_is_zero_outside_its_wavelengths() {
    let scene = world(
        r#"Material "diffuse" "spectrum reflectance" [450 0.5 650 0.5] Shape "sphere"
           Material "diffuse" "spectrum reflectance" [350 0.5 850 0.5] Shape "sphere"
           Material "dielectric" "spectrum eta" [600 1.5 700 1.4] Shape "sphere"
           Material "diffuse" "spectrum reflectance" "metal-Cu-eta" Shape "sphere""#,
    );
    let reflectance = |shape: usize| match kind(&scene, shape) {
        MaterialKind::Diffuse { reflectance } => match &**reflectance {
            Texture::Spectrum { value, spectrum } => (*value, spectrum.clone()),
            other => panic!("{other:?}"),
        },
        other => panic!("{other:?}"),
    };
    let (part, spectrum) = reflectance(0);
    let at = [449.0, 450.0, 550.0, 650.0, 651.0, 830.0].map(|nm| spectrum.at(nm));
    assert_eq!(at, [0.0, 0.5, 0.5, 0.5, 0.0, 0.0].map(Some));
    assert!(part.r < 0.5 && part.b < 0.45, "{part:?}");
    let (whole, spectrum) = reflectance(1);
    near_rgb(whole, [0.5; 3]);
    assert_eq!([360.0, 830.0].map(|nm| spectrum.at(nm)), [Some(0.5); 2]);
    // Without an index at the yellow line there is no boundary.
    let MaterialKind::Dielectric { eta, .. } = kind(&scene, 2) else { panic!() };
    assert_eq!(*eta, 1.0);
    // A known name goes on.
    assert!(reflectance(3).1.at(360.0).unwrap() > 0.0);
}

#[test]
fn a_grid_of_pbrt_v3_is_one_of_pbrt_v4_with_other_coefficients() {
    let medium = |text: &str| {
        let (scene, warnings) = warned(&format!("MakeNamedMedium \"m\" {text}"));
        (format!("{:?}", scene.media[0]), warnings)
    };
    let voxels = r#""integer nx" 2 "float density" [0.5 2] "float g" 0.2"#;
    let milk = r#""rgb sigma_a" [0.0011 0.0024 0.014] "rgb sigma_s" [2.55 3.21 3.77]"#;
    let old = medium(&format!(r#""string type" "heterogeneous" {voxels}"#));
    assert_eq!(old.1.len(), 1, "{:?}", old.1);
    let new = medium(&format!(r#""string type" "uniformgrid" {voxels} {milk}"#));
    assert_eq!((old.0, new.1.len()), (new.0, 0));
    let old = medium(&format!(r#""string type" "heterogeneous" {voxels} "string preset" "Coke""#));
    let coke = r#""rgb sigma_a" [0.10014 0.16503 0.2468] "rgb sigma_s" [8.9053e-05 8.372e-05 0]"#;
    assert_eq!(old.0, medium(&format!(r#""string type" "uniformgrid" {voxels} {coke}"#)).0);
}

#[test]
fn what_has_no_effect_is_said() {
    let medium = r#"MakeNamedMedium "m" "string type" "homogeneous" "string preset" "Coke""#;
    let (_, said) = warned(&format!("{medium} \"rgb sigma_a\" [1 1 1]"));
    assert_eq!(said, ["warning: scene.pbrt:1:83: \"sigma_a\" is not used where a preset is given"],);
    let hair = r#"Material "hair" Shape "curve" "point3 P" [0 0 0 1 0 0 2 0 0 3 0 0]"#;
    assert_eq!(warned(hair).1, [""; 0]);
    let (_, said) = warned(&format!("{hair} Shape \"sphere\" Shape \"sphere\""));
    assert_eq!(
        said,
        ["warning: scene.pbrt:1:12: hair on a shape that is no curve: its v says where light meets a fibre"],
    );
}
