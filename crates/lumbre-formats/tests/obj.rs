//! OBJ and MTL files: everything that faces, names and materials can say.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::sync::Arc;

use crate::common::{files_below, shared};
use lumbre_formats::obj::{ObjFile, open_obj, read_mtl, read_obj};
use lumbre_formats::{Budget, Diagnostics, FormatError, Input, Strictness};
use lumbre_geometry::Shape;
use lumbre_image::Rgb;
use lumbre_math::{DVec3, Transform, Vec3};
use lumbre_scene::{GeometryDesc, Scene, Stage, StageLight};
use lumbre_shading::{MaterialKind, Texture};

fn name() -> Arc<str> {
    "m.obj".into()
}

fn read(text: &str) -> Result<ObjFile, FormatError> {
    read_obj(text.as_bytes(), &name(), &Budget::default(), &mut Diagnostics::new())
}

fn said(text: &str, strictness: Strictness) -> (ObjFile, Vec<String>) {
    let mut said = Diagnostics::with_strictness(strictness);
    let file = read_obj(text.as_bytes(), &name(), &Budget::default(), &mut said).unwrap();
    (file, said.lines())
}

const SQUARE: &str = "v 1 1 5\nv 4 1 5\nv 4 3 5\nv 1 3 5\n";

#[test]
fn corners_with_different_attributes_are_separate_vertices() {
    let file = read(
        "v 1 1 5\nv 4 1 5\nv 4 3 5\nv 1 3 5\nvt 0.25 0.5\nvt 0.75 0.5 9\nvt 0.5\nvn 0 0 1\nvn 0 1 0\n\
         f 1/1/1 2/2/1 3/3/1\nf 1/1/1 3/3/1 4/2/1\nf 1/1/2 2/2/1 4/2/1\n",
    )
    .unwrap();
    let mesh = &file.meshes[0].mesh;
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [4, 1, 3]]);
    assert_eq!(mesh.positions[4].to_array(), [1.0, 1.0, 5.0]);
    assert_eq!(mesh.normals.as_ref().unwrap()[4].to_array(), [0.0, 1.0, 0.0]);
    assert_eq!(mesh.uvs.as_ref().unwrap()[2].to_array(), [0.5, 0.0]);
}

#[test]
fn negative_indices_count_backwards_from_where_they_stand() {
    let file = read(&format!("{SQUARE}f -4 -3 -2\nv 9 9 9\nf -5 -3 -1\n")).unwrap();
    let mesh = &file.meshes[0].mesh;
    let places: Vec<_> = mesh.triangles[1].iter().map(|&i| mesh.positions[i as usize].to_array()).collect();
    assert_eq!(places, [[1., 1., 5.], [4., 3., 5.], [9., 9., 9.]]);
}

#[test]
fn many_corners_lines_that_go_on_and_comments_are_read() {
    let file =
        read("# a\nv 0 0 2 # b\nv 4 0 2\nv 1 1 2\nv 0 4 2\n\tf 1 \\\r\n 2 3 \\\n4 # c\nf 1 2 3").unwrap();
    assert_eq!(file.meshes[0].mesh.triangles.len(), 3);
    let areas: f32 = file.meshes[0].mesh.triangles[..2]
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|i| file.meshes[0].mesh.positions[i as usize]);
            (b - a).cross(c - a).z / 2.0
        })
        .sum();
    assert_eq!(areas, 4.0);
}

#[test]
fn meshes_part_by_object_material_and_attributes() {
    let text = format!(
        "mtllib a.mtl b.mtl\n{SQUARE}vt 0.5 0.5\no first thing\nusemtl red paint\nf 1 2 3\ng ignored\nf 1 3 4\n\
         usemtl blue\nf 1 2 4\no second\nf 1/1 2/1 3/1\nf 2 3 4\no first thing\nusemtl red paint\nf 2 3 4\n"
    );
    let file = read(&text.replace("g ignored\n", "")).unwrap();
    let parts: Vec<_> = file
        .meshes
        .iter()
        .map(|m| (m.name.as_str(), m.material.as_ref().unwrap().0.as_str(), m.mesh.triangles.len()))
        .collect();
    assert_eq!(
        parts,
        [
            ("first thing", "red paint", 3),
            ("first thing", "blue", 1),
            ("second", "blue", 1),
            ("second", "blue", 1)
        ]
    );
    assert!(file.meshes[2].mesh.uvs.is_some() && file.meshes[3].mesh.uvs.is_none());
    assert_eq!(file.libraries[0].0, "a.mtl b.mtl");
    assert_eq!(file.meshes[1].material.as_ref().unwrap().1.to_string(), "m.obj:11:8");
}

#[test]
fn a_file_without_any_normals_may_name_them() {
    let (file, lines) = said(&format!("{SQUARE}f 1//1 2//2 3//3\nf 1/4/1 3/4/2 4/4/7\n"), Strictness::Normal);
    assert_eq!(file.meshes[0].mesh.triangles.len(), 2);
    assert!(file.meshes[0].mesh.normals.is_none());
    assert_eq!(
        lines,
        [
            "warning: m.obj: faces name texture coordinates, and the file has none",
            "warning: m.obj: faces name normals, and the file has none",
        ]
    );
}

#[test]
fn faces_may_stand_before_what_they_name() {
    let early = read(
        "v 9 9 9\no a\nf 2//1 3//-1 -1//1\nf 2//1 3//1 4//1 5//1\nvn 0 0 1\no b\nv 1 1 5\nv 4 1 5\nv 4 3 5\nv 1 3 5\n",
    );
    let wrong = early.unwrap_err().to_string();
    assert_eq!(wrong, "m.obj:3:11: face with a normal that does not exist (found -1; expected 1 or -1)");
    let file = read(
        "v 9 9 9\no a\nf 2//1 3//1 -1//1\nf 2//1 3//1 4//1 5//1\nvn 0 0 1\no b\nv 1 1 5\nv 4 1 5\nv 4 3 5\nv 1 3 5\n",
    );
    let file = file.unwrap();
    assert_eq!((file.meshes.len(), file.meshes[0].name.as_str()), (1, "a"));
    let mesh = &file.meshes[0].mesh;
    let third = mesh.positions[mesh.triangles[0][2] as usize];
    assert_eq!(third.to_array(), [9.0, 9.0, 9.0], "-1 counts from where it stands");
    assert_eq!(mesh.triangles.len(), 3);
}

#[test]
fn groups_name_meshes_where_there_are_no_objects() {
    let file = read(&format!("{SQUARE}g wheel left\nf 1 2 3\ng\nf 1 3 4\n")).unwrap();
    let names: Vec<_> = file.meshes.iter().map(|m| m.name.as_str()).collect();
    assert_eq!(names, ["wheel left", ""]);
}

#[test]
fn colours_of_vertices_are_light_and_others_white() {
    let file =
        read("v 1 2 3\nv 2 2 3 0.25 0.5 0.75\nv 1 4 3 1\nv 1 2 9 1 0.125 0 0\nf 1 2 3\nf 2 3 4\n").unwrap();
    let colours = file.meshes[0].mesh.colours.as_ref().unwrap();
    assert_eq!(colours[..], [Rgb::WHITE, Rgb::new(0.25, 0.5, 0.75), Rgb::WHITE, Rgb::new(0.125, 0.0, 0.0)]);
}

#[test]
fn long_lines_and_many_attributes_take_linear_time() {
    let corners = 200_000;
    let mut text = String::new();
    for i in 0..corners {
        let a = i as f64 * std::f64::consts::TAU / f64::from(corners);
        text += &format!("v {} {} 3\n", 100.0 * a.cos(), 100.0 * a.sin());
    }
    text += "f";
    for i in 1..=corners {
        text += &format!(" {i}");
    }
    text += "\nvt 0.5 0.5\n";
    for i in 0..100_000 {
        text += &format!("vt {i} 1\n");
    }
    for i in 1..=100_000 {
        text += &format!("f 1/{i} 2/1 3/1\n");
    }
    let start = std::time::Instant::now();
    let file = read(&text).unwrap();
    assert!(file.meshes[0].mesh.triangles.len() >= 190_000);
    assert_eq!(file.meshes[1].mesh.positions.len(), 100_002);
    assert!(start.elapsed().as_secs() < 10, "{:?}", start.elapsed());
}

#[test]
fn what_is_dropped_is_said() {
    let (file, lines) =
        said(&format!("{SQUARE}\n\nf 1 2\nfaces 1 2 3\ncurv 0 1\ns 1\nf 1 2 3\n"), Strictness::Normal);
    assert_eq!(file.meshes[0].mesh.triangles.len(), 1);
    assert_eq!(
        lines,
        [
            "warning: m.obj:7:1: face with fewer than three vertices is left out",
            "warning: m.obj:8:1: line with an unknown keyword is left out (found \"faces\")",
            "warning: m.obj:9:1: free-form curves and surfaces are not supported, and left out",
        ]
    );
}

#[test]
fn lenient_drops_what_cannot_be_used_and_counts_it() {
    let text =
        format!("{SQUARE}v nan 0 0\nvt inf 0\nf 1 2 5\nf 1 2 9\nf 0 1 2\nf 1/1 2/1 3/1\nf 1/2 2/2 3/2\n");
    assert_eq!(read(&text).unwrap_err().to_string(), "m.obj:5:3: vertex 5 is not finite (found (NaN, 0, 0))");
    let (file, lines) = said(&text, Strictness::Lenient);
    assert_eq!(file.meshes.len(), 1);
    assert_eq!(file.meshes[0].mesh.triangles.len(), 1);
    assert_eq!(lines.len(), 5, "{lines:#?}");
    assert!(
        lines.iter().filter(|l| l.contains("with a vertex that does not exist is left out")).count() == 3
    );
}

#[test]
fn every_key_of_a_material_is_read() {
    let text = "newmtl first one\nKd 0.1 0.2 0.3\nKs 0.5\nKe 1 2 3\nNs 100\nNi 1.33\nd 0.75\nillum 7\nPr 0.4\nPm 1\n\
        map_Kd -s 2 3 -o 0.25 0.5 0 -mm 0 0.5 -clamp on my tex\\a b.png\nmap_bump -bm 0.02 b.png\nnorm n.png\nmap_d d.png\n\
        map_Pr 2 3.png -bm 1.5 -clamp on\nmap_Ke e.png\nKa 1 1 1\nPs 0.6\nPc 0.7\nPcr 0.8\naniso 0.9\nanisor 0.25\n\
        map_Pm m.png\nmap_Ps s.png\n\nnewmtl second\nTr 0.25\nmap_Kd -s 4 4.png\n";
    let mut said = Diagnostics::new();
    let materials = read_mtl(text.as_bytes(), &"m.mtl".into(), &Budget::default(), &mut said).unwrap();
    assert_eq!(said.lines(), Vec::<String>::new());
    let m = &materials[0];
    assert_eq!(m.name, "first one");
    assert_eq!((m.diffuse, m.specular), (Some(Rgb::new(0.1, 0.2, 0.3)), Some(Rgb::splat(0.5))));
    assert_eq!(
        (m.emission, m.shininess, m.refraction),
        (Some(Rgb::new(1.0, 2.0, 3.0)), Some(100.0), Some(1.33))
    );
    assert_eq!((m.opacity, m.illumination), (Some(0.75), Some(7)));
    assert_eq!((m.roughness, m.metallic), (Some(0.4), Some(1.0)));
    assert_eq!((m.sheen, m.clearcoat, m.clearcoat_roughness), (Some(0.6), Some(0.7), Some(0.8)));
    assert_eq!((m.anisotropy, m.anisotropy_rotation), (Some(0.9), Some(0.25)));
    let files = [&m.metallic_map, &m.sheen_map].map(|map| map.as_ref().unwrap().file.as_str());
    assert_eq!(files, ["m.png", "s.png"]);
    let map = m.diffuse_map.as_ref().unwrap();
    assert_eq!((map.scale, map.offset), ([2.0, 3.0], [0.25, 0.5]));
    assert_eq!((map.range, map.clamp, map.file.as_str()), ([0.0, 0.5], true, "my tex\\a b.png"));
    assert_eq!(map.place.to_string(), "m.mtl:11:49");
    assert_eq!(m.bump_map.as_ref().unwrap().bump_multiplier, 0.02);
    let behind = m.roughness_map.as_ref().unwrap();
    assert_eq!((behind.file.as_str(), behind.bump_multiplier, behind.clamp), ("2 3.png", 1.5, true));
    let second = materials[1].diffuse_map.as_ref().unwrap();
    assert_eq!((second.scale, second.file.as_str()), ([4.0, 1.0], "4.png"), "a file may look like a number");
    assert_eq!(materials[1].opacity, Some(0.75));
}

#[test]
fn a_scene_has_its_materials_and_says_what_is_missing() {
    let folder = tempfile::tempdir().unwrap();
    let put = |file: &str, text: &str| std::fs::write(folder.path().join(file), text).unwrap();
    put(
        "my scene.mtl",
        "newmtl lamp\nKe 5 4 3\nnewmtl glass\nillum 7\nNi 1.7\nnewmtl gold\nPm 1\nPr 0.5\nPc 0.25\nKd 1 0.8 0.3\nnewmtl matte\n\
         Kd 0.2 0.4 0.6\nmap_Kd absent.png\nd 0.5\nnewmtl gloss\nKs 0.5 0.5 0.5\nNs 48\n",
    );
    let faces = ["lamp", "glass", "gold", "matte", "gloss", "mate"]
        .map(|m| format!("usemtl {m}\nf 1 2 3\n"))
        .concat();
    put("a.obj", &format!("mtllib my scene.mtl\nmtllib absent.mtl\n{SQUARE}{faces}"));
    let mut said = Diagnostics::new();
    let path = folder.path().join("a.obj");
    let scene = open_obj(&path, &Budget::default(), &mut said).unwrap();
    assert_eq!(scene.shapes.len(), 6);
    let kind =
        |shape: usize| &scene.materials[scene.shapes[shape].material.unwrap().0 as usize].material.kind;
    assert_eq!(scene.shapes[0].area_light.as_ref().unwrap().radiance, Rgb::new(5.0, 4.0, 3.0));
    assert!(matches!(kind(1), MaterialKind::Dielectric { eta: 1.7, .. }));
    let MaterialKind::Principled(gold) = kind(2) else { panic!() };
    let number = |texture: &Texture<f32>| if let Texture::Constant(v) = texture { *v } else { panic!() };
    assert_eq!((number(&gold.metallic), number(&gold.roughness), number(&gold.clearcoat)), (1.0, 0.5, 0.25));
    assert!(matches!(*gold.base_color, Texture::Constant(c) if c == Rgb::new(1.0, 0.8, 0.3)));
    assert!(matches!(kind(3), MaterialKind::Diffuse { .. }));
    let MaterialKind::CoatedDiffuse { roughness, .. } = kind(4) else { panic!() };
    assert!(
        matches!(*roughness.u, Texture::Constant(alpha) if (alpha - 0.2).abs() < 1e-6),
        "2 / (48 + 2) is 0.2 squared"
    );
    assert!(matches!(kind(5), MaterialKind::Diffuse { .. }));
    assert!(matches!(scene.shapes[3].alpha.as_deref(), Some(Texture::Constant(0.5))));
    let lines = said.lines();
    assert_eq!(lines.len(), 3, "{lines:#?}");
    assert!(lines[0].contains("my scene.mtl:13:8: texture is left out"), "{}", lines[0]);
    assert!(lines[1].contains("a.obj:2:8: material file is left out"), "{}", lines[1]);
    assert!(
        lines[2].contains(
            "a.obj:17:8: unknown material, taken for grey (found \"mate\"; did you mean \"matte\"?)"
        )
    );
    let GeometryDesc::Mesh(mesh) = &scene.shapes[2].geometry else { panic!() };
    assert_eq!(mesh.triangles.len(), 1);
}

#[test]
fn files_of_others_are_read_or_refused_with_a_place() {
    let mut read = 0;
    let mut refused = vec![];
    for part in ["formats/tinyobjloader", "formats/tobj", "meshes"] {
        let Some(folder) = shared(part) else { continue };
        for path in files_below(&folder, &[".obj"]) {
            let budget = Budget::default();
            let mut said = Diagnostics::new();
            match open_obj(&path, &budget, &mut said) {
                Ok(_) => read += 1,
                Err(e) => refused.push(e.to_string()),
            }
            let input = Input::open(&path, &budget).unwrap();
            let start = std::time::Instant::now();
            let _ = read_obj(&input, input.name(), &budget, &mut Diagnostics::new());
            if input.len() > 1 << 20 {
                println!("{:.0} MB/s", input.len() as f64 / 1e6 / start.elapsed().as_secs_f64());
            }
        }
    }
    if read > 0 {
        assert!(read > 40, "{read}");
        for wrong in ["invalid-relative-vertex-index", "issue-140-zero-face-idx", "test-nan", "invalid_index"]
        {
            assert!(refused.iter().any(|r| r.contains(wrong)), "{wrong} {refused:#?}");
        }
    }
}

#[test]
fn faces_of_a_smoothing_group_are_smooth_and_others_flat() {
    // A roof of two squares that meet at a right angle along x.
    let roof = "v 0 0 0\nv 2 0 0\nv 2 3 3\nv 0 3 3\nv 0 6 0\nv 2 6 0\n";
    let normals = |faces: &str| {
        let file = read(&format!("{roof}{faces}")).unwrap();
        file.meshes.iter().map(|mesh| mesh.mesh.normals.clone()).collect::<Vec<_>>()
    };
    let smooth = normals("s 1\nf 1 2 3 4\nf 4 3 6 5\n").remove(0).unwrap();
    let ridge = smooth.iter().filter(|n| n.abs_diff_eq(Vec3::Z, 1e-6)).count();
    assert_eq!((smooth.len(), ridge), (6, 2));
    let half = std::f32::consts::FRAC_1_SQRT_2;
    assert!(smooth.iter().any(|n| n.abs_diff_eq(Vec3::new(0.0, -half, half), 1e-6)));
    // Groups meet in an edge, `off` is flat, and normals of the file count for more.
    let apart = normals("s 1\nf 1 2 3 4\ns 2\nf 4 3 6 5\n").remove(0).unwrap();
    assert!(apart.len() == 8 && apart.iter().all(|n| (n.z - half).abs() < 1e-6));
    assert_eq!(normals("s off\nf 1 2 3 4\n"), [None]);
    assert_eq!(normals("vn 0 0 1\ns 1\nf 1//1 2//1 3//1\n"), [Some(vec![Vec3::Z; 3])]);
}

#[test]
fn points_and_lines_are_spheres_and_cylinders_of_their_material() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("m.obj");
    std::fs::write(&path, "v 0 0 5\nv 30 0 5\nv 30 40 5\nl 1 2 3\np 2 -1\n").unwrap();
    let mut said = Diagnostics::new();
    let scene = open_obj(&path, &Budget::default(), &mut said).unwrap();
    assert_eq!(said.lines(), [""; 0]);
    let count = |is: fn(&Shape) -> bool| {
        scene.shapes.iter().filter(|s| matches!(&s.geometry, GeometryDesc::Exact(shape) if is(shape))).count()
    };
    // Two points, and a joint between the two segments.
    assert_eq!(
        (count(|s| matches!(s, Shape::Sphere(_))), count(|s| matches!(s, Shape::Cylinder(_)))),
        (3, 2)
    );
    Scene::build(scene).unwrap();
}

#[test]
fn a_model_far_from_zero_keeps_the_digits_of_its_file() {
    let text = "v 500000.25 4649781.5 100.125\nv 500000.26 4649781.5 100.125\nv 500000.25 4649781.53 100.125\nf 1 2 3\n";
    let file = read(text).unwrap();
    let at = |i: usize| file.meshes[0].mesh.positions[i].as_dvec3() + file.origin;
    assert!((at(1) - DVec3::new(500_000.26, 4_649_781.5, 100.125)).abs().max_element() < 1e-8);
    assert!((at(2) - at(0) - DVec3::new(0.0, 0.03, 0.0)).abs().max_element() < 1e-8);
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("m.obj");
    std::fs::write(&path, text).unwrap();
    let scene = open_obj(&path, &Budget::default(), &mut Diagnostics::new()).unwrap();
    assert_eq!(scene.shapes[0].world_from_object, Transform::translate(file.origin));
}

#[test]
fn faces_without_area_are_said_to_show_nothing() {
    let (_, lines) = said("v 5 6 7\nv 5 6 7\nv 5 6 7\nf 1 2 3\n", Strictness::Normal);
    assert_eq!(lines, ["warning: m.obj: all faces are without area: nothing of them is seen"]);
}

#[test]
fn text_in_sixteen_bits_is_read_by_its_byte_order_mark() {
    let text = "\u{FEFF}# é\nv 1 2 3\nv 4 2 3\nv 1 5 3\no é\nf 1 2 3\n";
    for order in [u16::to_le_bytes, u16::to_be_bytes] {
        let bytes: Vec<u8> = text.encode_utf16().flat_map(order).collect();
        let file = read_obj(&bytes, &name(), &Budget::default(), &mut Diagnostics::new()).unwrap();
        assert_eq!((file.meshes[0].name.as_str(), file.meshes[0].mesh.triangles.len()), ("é", 1));
    }
}

#[test]
fn tr_of_one_is_opaque_and_d_takes_precedence() {
    let opacity = |keys: &str| {
        let mut said = Diagnostics::new();
        let text = format!("newmtl a\n{keys}\n");
        let materials = read_mtl(text.as_bytes(), &"m.mtl".into(), &Budget::default(), &mut said).unwrap();
        (materials[0].opacity, said.lines().join("; "))
    };
    let (found, said) = opacity("Tr 1");
    assert!(
        found == Some(1.0) && said.contains("Tr of a material makes it invisible, taken for opaque"),
        "{said}"
    );
    assert_eq!(opacity("Tr 0.25"), (Some(0.75), String::new()));
    assert_eq!(opacity("d 0.5\nTr 0.5"), (Some(0.5), String::new()));
    assert_eq!(opacity("Tr 0.25\nd 0.75"), (Some(0.75), String::new()));
    let (found, said) = opacity("d 1\nTr 1");
    assert!(found == Some(1.0) && said.contains("d and Tr of a material disagree"), "{said}");
}

#[test]
fn libraries_are_read_once_and_faint_lights_keep_the_studio() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("m.obj");
    let light = |emission: &str| {
        std::fs::write(dir.path().join("m.mtl"), format!("newmtl m\nKe {emission}\nwrong 1\n")).unwrap();
        std::fs::write(&path, format!("{}{SQUARE}usemtl m\nf 1 2 3\n", "mtllib m.mtl\n".repeat(5))).unwrap();
        let mut said = Diagnostics::new();
        let scene = open_obj(&path, &Budget::default(), &mut said).unwrap();
        assert_eq!(said.warnings(), 1);
        let staged = Stage::default().set(&mut scene.clone()).light;
        (scene.shapes[0].area_light.is_some(), staged)
    };
    assert_eq!(light("0 0 0.1"), (true, StageLight::Studio));
    assert_eq!(light("9 8 7"), (true, StageLight::Own));
}

#[test]
fn a_material_that_is_invisible_does_not_shine() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("m.obj");
    let is_emissive = |keys: &str| {
        std::fs::write(dir.path().join("m.mtl"), format!("newmtl m\nKe 9 9 9\n{keys}\n")).unwrap();
        std::fs::write(&path, format!("mtllib m.mtl\n{SQUARE}usemtl m\nf 1 2 3\n")).unwrap();
        let scene = open_obj(&path, &Budget::default(), &mut Diagnostics::new()).unwrap();
        let staged = Stage::default().set(&mut scene.clone()).light;
        (scene.shapes[0].area_light.is_some(), staged)
    };
    assert_eq!(is_emissive("d 1"), (true, StageLight::Own));
    assert_eq!(is_emissive("d 0.25"), (true, StageLight::Own));
    assert_eq!(is_emissive("d 0"), (false, StageLight::Studio));
    assert_eq!(is_emissive("d -1"), (false, StageLight::Studio));
}

#[test]
fn what_is_not_finite_where_nothing_is_seen_is_a_note() {
    let start = "v 0 0 0\nv 1 0 0\nv 2 0 0\nv 0 3 0\nvn nan 0 1\nvn 0 0 1\nvt 0 inf\nvt 0 0\n";
    let check = |faces: &str| {
        let mut said = Diagnostics::with_strictness(Strictness::Strict);
        read_obj(format!("{start}{faces}").as_bytes(), &name(), &Budget::default(), &mut said).unwrap();
        let notes = said.lines().iter().filter(|line| line.starts_with("note: m.obj:")).count() as u64;
        assert_eq!(said.check().is_ok(), said.warnings() == 0);
        (said.warnings(), notes)
    };
    // Next to a visible face, with other normals, or none.
    assert_eq!(check("f 1/2/2 2/2/2 4/2/2\nf 1/1/1 2/1/1 3/1/1\n"), (0, 2));
    assert_eq!(check("f 1 2 4\nf 1//1 2//1 3//1\n"), (0, 2));
    assert_eq!(check("f 1//2 2//1 4//2\n"), (1, 1));
    assert_eq!(check("f 1/1/2 2/2/1 4/2/2\n"), (2, 0));
    assert_eq!(check("s 1\nf 1/2 2/2 4/1\n"), (1, 1));
}
