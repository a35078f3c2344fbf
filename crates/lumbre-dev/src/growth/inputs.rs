//! The inputs: for each list that a file can hold, a file with many items.

use std::fmt::Write as _;

/// Makes files with this many items, the scene first: each name with its bytes.
pub(crate) type Write = fn(usize) -> Vec<(String, Vec<u8>)>;

/// Each by name.
pub(crate) const INPUTS: &[(&str, Write)] = &[
    ("pbrt spheres", |n| pbrt(&"Shape \"sphere\"\n".repeat(n))),
    ("pbrt boxes", |n| pbrt(&"Shape \"box\"\n".repeat(n))),
    ("pbrt placed spheres", |n| pbrt(&each(n, |i| format!("Translate 0 0 {i} Shape \"sphere\"\n")))),
    ("pbrt quadrics", |n| {
        pbrt(&"Shape \"quadric\" \"float coefficients\" [1 1 1 0 0 0 0 0 0 -1]\n".repeat(n))
    }),
    ("pbrt small meshes", |n| pbrt(&each(n, |i| format!("{MESH} \"point3 P\" [0 0 0 1 0 0 0 1 {i}]\n")))),
    ("pbrt one mesh", |n| {
        let points = each(n, |i| format!("{i} 0 0 {i} 1 0 {i} 0 1 "));
        let indices = each(3 * n, |i| format!("{i} "));
        pbrt(&format!("{MESH} \"point3 P\" [{points}] \"integer indices\" [{indices}]\n"))
    }),
    ("pbrt lights on shapes", |n| {
        pbrt(&format!("AreaLightSource \"diffuse\"\n{}", "Shape \"sphere\"\n".repeat(n)))
    }),
    ("pbrt lights", |n| pbrt(&each(n, |i| format!("LightSource \"point\" \"point3 from\" [0 0 {i}]\n")))),
    ("pbrt materials", |n| pbrt(&"Material \"diffuse\"\n".repeat(n))),
    ("pbrt principled materials", |n| pbrt(&"Material \"principled\"\n".repeat(n))),
    ("pbrt named materials", |n| {
        pbrt(&each(n, |i| {
            format!("MakeNamedMaterial \"{i}\" \"string type\" \"diffuse\"\nNamedMaterial \"{i}\"\n")
        }))
    }),
    ("pbrt undefined materials", |n| pbrt(&each(n, |i| format!("NamedMaterial \"{i}\"\n")))),
    ("pbrt mixtures", |n| {
        let mix = "\"string type\" \"mix\" \"string materials\" [\"a\" \"a\"]";
        let first = "MakeNamedMaterial \"a\" \"string type\" \"diffuse\"\n";
        pbrt(&(first.to_owned() + &each(n, |i| format!("MakeNamedMaterial \"{i}\" {mix}\n"))))
    }),
    ("pbrt textures", |n| {
        pbrt(&each(n, |i| format!("Texture \"{i}\" \"float\" \"constant\" \"float value\" {i}\n")))
    }),
    ("pbrt checkerboards", |n| {
        pbrt(&each(n, |i| {
            format!("Texture \"{i}\" \"spectrum\" \"checkerboard\" \"string mapping\" \"planar\"\n")
        }))
    }),
    ("pbrt textures to come", |n| {
        let use_of = |i| format!("Material \"diffuse\" \"texture reflectance\" \"{i}\"\nShape \"sphere\"\n");
        pbrt(&(each(n, use_of) + &each(n, |i| format!("Texture \"{i}\" \"spectrum\" \"constant\"\n"))))
    }),
    ("pbrt alphas to come", |n| {
        let use_of = |i| format!("Shape \"sphere\" \"texture alpha\" \"{i}\"\n");
        pbrt(&(each(n, use_of) + &each(n, |i| format!("Texture \"{i}\" \"float\" \"constant\"\n"))))
    }),
    ("pbrt missing pictures", |n| {
        pbrt(&each(n, |i| {
            format!("Texture \"{i}\" \"float\" \"imagemap\" \"string filename\" \"{i}.png\"\n")
        }))
    }),
    ("pbrt objects", |n| pbrt(&each(n, |i| format!("ObjectBegin \"{i}\"\nShape \"sphere\"\nObjectEnd\n")))),
    ("pbrt objects with instances", |n| {
        pbrt(&each(n, |i| {
            format!("ObjectBegin \"{i}\"\nShape \"sphere\"\nObjectEnd\nObjectInstance \"{i}\"\n")
        }))
    }),
    ("pbrt instances", |n| {
        let object = "ObjectBegin \"a\"\nShape \"sphere\"\nObjectEnd\n".to_owned();
        pbrt(&(object + &each(n, |i| format!("Translate 0 0 {i} ObjectInstance \"a\"\n"))))
    }),
    ("pbrt moving shapes", |n| {
        let move_on = "ActiveTransform EndTime Translate 0 0 1 ActiveTransform All\n".to_owned();
        pbrt(&(move_on + &"Shape \"sphere\"\n".repeat(n)))
    }),
    ("pbrt csg", |n| {
        let object = "ObjectBegin \"a\"\nShape \"sphere\"\nObjectEnd\n".to_owned();
        pbrt(&(object + &"Shape \"csg\" \"string operands\" [\"a\" \"a\"]\n".repeat(n)))
    }),
    ("pbrt operands", |n| {
        let object = "ObjectBegin \"a\"\nShape \"sphere\"\nObjectEnd\n";
        pbrt(&format!("{object}Shape \"csg\" \"string operands\" [{}]\n", "\"a\" ".repeat(n.min(10_000))))
    }),
    ("pbrt scopes", |n| pbrt(&"AttributeBegin\nAttributeEnd\n".repeat(n))),
    ("pbrt attributes", |n| pbrt(&each(n, |i| format!("Attribute \"shape\" \"float p{}\" {i}\n", i % 1000)))),
    ("pbrt scopes with attributes", |n| {
        let names = each(1000, |i| format!("Attribute \"shape\" \"float p{i}\" 1\n"));
        let scope = "AttributeBegin\nAttribute \"shape\" \"float p7\" 2\nShape \"sphere\"\nAttributeEnd\n";
        pbrt(&(names + &scope.repeat(n)))
    }),
    ("pbrt coordinate systems", |n| pbrt(&each(n, |i| format!("CoordinateSystem \"{i}\"\n")))),
    ("pbrt media", |n| {
        pbrt(&each(n, |i| {
            format!("MakeNamedMedium \"{i}\" \"string type\" \"homogeneous\"\nMediumInterface \"{i}\"\n")
        }))
    }),
    ("pbrt undefined media", |n| pbrt(&each(n, |i| format!("MediumInterface \"{i}\" \"\"\n")))),
    ("pbrt parameters of one", |n| {
        pbrt(&format!("Shape \"sphere\" {}\n", each(n, |i| format!("\"float p{i}\" {i} "))))
    }),
    ("pbrt numbers of one", |n| {
        pbrt(&format!("Shape \"sphere\" \"float radius\" [{}]\n", "1 ".repeat(4 * n)))
    }),
    ("pbrt strings of one", |n| {
        pbrt(&format!("Material \"diffuse\" \"string type\" [{}]\n", "\"a\" ".repeat(4 * n)))
    }),
    ("pbrt unknown words", |n| pbrt(&each(n, |i| format!("Word{i} 1 2\n")))),
    ("pbrt unknown shapes", |n| pbrt(&each(n, |i| format!("Shape \"none{i}\"\n")))),
    ("pbrt comments", |n| pbrt(&"# nothing\n".repeat(4 * n))),
    ("pbrt includes", |n| {
        let mut files = pbrt(&"Include \"part.pbrt\"\n".repeat(n.min(20_000)));
        files.push(("part.pbrt".into(), b"Shape \"sphere\"\n".to_vec()));
        files
    }),
    ("pbrt mesh files", |n| {
        let mut files = pbrt(&"Shape \"plymesh\" \"string filename\" \"part.ply\"\n".repeat(n));
        files.push(("part.ply".into(), ply(3, "0 0 0\n1 0 0\n0 1 0\n", 1, "3 0 1 2\n")));
        files
    }),
    ("obj vertices", |n| one("a.obj", &(each(n, |i| format!("v {i} 0 1\n")) + "f 1 2 3\n"))),
    ("obj faces", |n| one("a.obj", &(VERTICES.to_owned() + &"f 1 2 3\n".repeat(n)))),
    ("obj faces with their own", |n| {
        one(
            "a.obj",
            &each(n, |i| {
                format!("v {i} 0 0\nv {i} 1 0\nv {i} 0 1\nvn 0 0 1\nvt 0 {i}\nf -3/-1/-1 -2/-1/-1 -1/-1/-1\n")
            }),
        )
    }),
    ("obj corners of a position", |n| {
        let texture = each(n, |i| format!("vt {i} 0\n"));
        one(
            "a.obj",
            &(VERTICES.to_owned() + &texture + &each(n, |i| format!("f 1/{0} 2/{0} 3/{0}\n", i + 1))),
        )
    }),
    ("obj faces before vertices", |n| one("a.obj", &("f 1 2 3\n".repeat(n) + VERTICES))),
    ("obj smoothing groups", |n| {
        one("a.obj", &(VERTICES.to_owned() + &each(n, |i| format!("s {}\nf 1 2 3\n", i + 1))))
    }),
    ("obj groups", |n| one("a.obj", &(VERTICES.to_owned() + &each(n, |i| format!("g g{i}\nf 1 2 3\n"))))),
    ("obj objects", |n| one("a.obj", &(VERTICES.to_owned() + &each(n, |i| format!("o o{i}\nf 1 2 3\n"))))),
    ("obj unknown materials", |n| {
        one("a.obj", &(VERTICES.to_owned() + &each(n, |i| format!("usemtl m{i}\nf 1 2 3\n"))))
    }),
    ("obj materials", |n| {
        let uses = each(n, |i| format!("usemtl m{i}\nf 1 2 3\n"));
        let mut files = one("a.obj", &format!("mtllib a.mtl\n{VERTICES}{uses}"));
        files.push(("a.mtl".into(), each(n, |i| format!("newmtl m{i}\nKd 1 0 0\n")).into_bytes()));
        files
    }),
    ("obj physical materials", |n| {
        let uses = each(n, |i| format!("usemtl m{i}\nf 1 2 3\n"));
        let mut files = one("a.obj", &format!("mtllib a.mtl\n{VERTICES}{uses}"));
        files.push(("a.mtl".into(), each(n, |i| format!("newmtl m{i}\nPr 0.5\n")).into_bytes()));
        files
    }),
    ("obj unused materials", |n| {
        let mut files = one("a.obj", &format!("mtllib a.mtl\n{VERTICES}f 1 2 3\n"));
        files.push(("a.mtl".into(), each(n, |i| format!("newmtl m{i}\n")).into_bytes()));
        files
    }),
    ("obj missing libraries", |n| {
        one("a.obj", &(each(n, |i| format!("mtllib m{i}\n")) + VERTICES + "f 1 2 3\n"))
    }),
    ("obj points", |n| one("a.obj", &(VERTICES.to_owned() + &"p 1\n".repeat(n)))),
    ("obj lines", |n| one("a.obj", &(VERTICES.to_owned() + "l" + &" 1 2".repeat(n) + "\n"))),
    ("obj one polygon", |n| {
        let count = n.min(2_500);
        let around = each(count, |i| format!("v {i} {} 0\n", i * i));
        one("a.obj", &(around + "f" + &each(count, |i| format!(" {}", i + 1)) + "\n"))
    }),
    ("ply vertices", |n| vec![("a.ply".into(), ply(n, &"0 0 1\n".repeat(n), 1, "3 0 1 2\n"))]),
    ("ply faces", |n| vec![("a.ply".into(), ply(3, "0 0 0\n1 0 0\n0 1 0\n", n, &"3 0 1 2\n".repeat(n)))]),
    ("ply points", |n| vec![("a.ply".into(), ply(n, &each(n, |i| format!("{i} 0 1\n")), 0, ""))]),
    ("ply properties", |n| {
        let properties = each(n, |i| format!("property float p{i}\n"));
        let header = format!("ply\nformat ascii 1.0\nelement thing 0\n{properties}");
        one(
            "a.ply",
            &(header
                + "element vertex 0\nproperty float x\nproperty float y\nproperty float z\nend_header\n"),
        )
    }),
    ("stl facets", |n| one("a.stl", &format!("solid a\n{}endsolid a\n", facets(n)))),
    ("stl solids", |n| one("a.stl", &format!("solid a\n{}endsolid a\n", facets(1)).repeat(n))),
    ("stl binary facets", |n| {
        let mut bytes = vec![b'x'; 80];
        bytes.extend((n as u32).to_le_bytes());
        for i in 0..n {
            let numbers = [0.0, 0.0, 1.0, 0.0, 0.0, i as f32, 1.0, 0.0, i as f32, 0.0, 1.0, i as f32];
            bytes.extend(numbers.iter().flat_map(|x: &f32| x.to_le_bytes()));
            bytes.extend([0, 0]);
        }
        vec![("a.stl".into(), bytes)]
    }),
    ("gltf nodes", |n| gltf(&[("nodes", list(n, |_| r#"{"mesh":0}"#.into())), ("scenes", scene(n))])),
    ("gltf meshes", |n| {
        let nodes = list(n, |i| format!(r#"{{"mesh":{i}}}"#));
        gltf(&[("meshes", list(n, |_| MESH_OF_GLTF.into())), ("nodes", nodes), ("scenes", scene(n))])
    }),
    ("gltf primitives", |n| {
        let primitives = list(n, |_| r#"{"attributes":{"POSITION":0}}"#.into());
        gltf(&[("meshes", format!(r#"[{{"primitives":{primitives}}}]"#))])
    }),
    ("gltf materials", |n| {
        let primitives = list(n, |i| format!(r#"{{"attributes":{{"POSITION":0}},"material":{i}}}"#));
        gltf(&[
            ("meshes", format!(r#"[{{"primitives":{primitives}}}]"#)),
            ("materials", list(n, |i| format!(r#"{{"name":"m{i}"}}"#))),
        ])
    }),
    ("gltf unused materials", |n| gltf(&[("materials", list(n, |i| format!(r#"{{"name":"m{i}"}}"#)))])),
    ("gltf unused accessors", |n| {
        gltf(&[(
            "accessors",
            list(n, |_| r#"{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}"#.into()),
        )])
    }),
    ("gltf views", |n| gltf(&[("bufferViews", list(n, |_| r#"{"buffer":0,"byteLength":36}"#.into()))])),
    ("gltf buffers", |n| gltf(&[("buffers", list(n, |_| BUFFER.into()))])),
    ("gltf images", |n| {
        let primitives =
            list(n, |i| format!(r#"{{"attributes":{{"POSITION":0,"TEXCOORD_0":0}},"material":{i}}}"#));
        let of = |i| format!(r#"{{"pbrMetallicRoughness":{{"baseColorTexture":{{"index":{i}}}}}}}"#);
        gltf(&[
            ("meshes", format!(r#"[{{"primitives":{primitives}}}]"#)),
            ("materials", list(n, of)),
            ("textures", list(n, |i| format!(r#"{{"source":{i}}}"#))),
            ("images", list(n, |i| format!(r#"{{"uri":"{i}.png"}}"#))),
        ])
    }),
    ("gltf animations", |n| {
        gltf(&[("animations", list(n, |i| format!(r#"{{"name":"a{i}","channels":[],"samplers":[]}}"#)))])
    }),
    ("gltf variants", |n| {
        let names = list(n, |i| format!(r#"{{"name":"v{i}"}}"#));
        gltf(&[("extensions", format!(r#"{{"KHR_materials_variants":{{"variants":{names}}}}}"#))])
    }),
    ("gltf cameras", |n| {
        let camera = r#"{"type":"perspective","perspective":{"yfov":1,"znear":1}}"#;
        gltf(&[
            ("cameras", list(n, |_| camera.into())),
            ("nodes", list(n, |i| format!(r#"{{"camera":{i}}}"#))),
            ("scenes", scene(n)),
        ])
    }),
    ("gltf lights", |n| {
        let lights = list(n, |_| r#"{"type":"point"}"#.into());
        gltf(&[
            ("extensions", format!(r#"{{"KHR_lights_punctual":{{"lights":{lights}}}}}"#)),
            ("nodes", list(n, |i| format!(r#"{{"extensions":{{"KHR_lights_punctual":{{"light":{i}}}}}}}"#))),
            ("scenes", scene(n)),
        ])
    }),
    ("gltf unknown extensions", |n| gltf(&[("extensionsUsed", list(n, |i| format!(r#""X_{i}""#)))])),
    ("gltf attributes of one", |n| {
        let more = each(n, |i| format!(r#","_A{i}":0"#));
        gltf(&[("meshes", format!(r#"[{{"primitives":[{{"attributes":{{"POSITION":0{more}}}}}]}}]"#))])
    }),
    ("gltf members of extras", |n| {
        gltf(&[("extras", format!("{{{}}}", each(n, |i| format!(r#""k{i}":{i},"#)) + r#""z":0"#))])
    }),
];

const MESH: &str = "Shape \"trianglemesh\"";
const VERTICES: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
const MESH_OF_GLTF: &str = r#"{"primitives":[{"attributes":{"POSITION":0}}]}"#;
/// The triangle (0, 0, 0), (1, 0, 0), (0, 1, 0).
const BUFFER: &str = r#"{"byteLength":36,"uri":"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}"#;

fn each(count: usize, item: impl Fn(usize) -> String) -> String {
    let mut text = String::new();
    (0..count).for_each(|i| text += &item(i));
    text
}

fn one(name: &str, text: &str) -> Vec<(String, Vec<u8>)> {
    vec![(name.into(), text.as_bytes().to_vec())]
}

fn pbrt(world: &str) -> Vec<(String, Vec<u8>)> {
    one("a.pbrt", &format!("Camera \"perspective\"\nWorldBegin\n{world}"))
}

fn ply(vertices: usize, positions: &str, faces: usize, corners: &str) -> Vec<u8> {
    let vertex = format!("element vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n");
    let face = format!("element face {faces}\nproperty list uchar int vertex_indices\n");
    format!("ply\nformat ascii 1.0\n{vertex}{face}end_header\n{positions}{corners}").into_bytes()
}

fn facets(count: usize) -> String {
    each(count, |i| {
        format!(
            "facet normal 0 0 1\nouter loop\nvertex 0 0 {i}\nvertex 1 0 {i}\nvertex 0 1 {i}\nendloop\nendfacet\n"
        )
    })
}

fn list(count: usize, item: impl Fn(usize) -> String) -> String {
    let items: Vec<String> = (0..count).map(item).collect();
    format!("[{}]", items.join(","))
}

fn scene(nodes: usize) -> String {
    format!(r#"[{{"nodes":{}}}]"#, list(nodes, |i| i.to_string()))
}

/// A triangle, with other members instead of its own, or in addition.
fn gltf(members: &[(&str, String)]) -> Vec<(String, Vec<u8>)> {
    let own = [
        ("meshes", format!("[{MESH_OF_GLTF}]")),
        ("nodes", r#"[{"mesh":0}]"#.to_owned()),
        ("scenes", r#"[{"nodes":[0]}]"#.to_owned()),
        (
            "accessors",
            r#"[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}]"#
                .to_owned(),
        ),
        ("bufferViews", r#"[{"buffer":0,"byteLength":36}]"#.to_owned()),
        ("buffers", format!("[{BUFFER}]")),
    ];
    let is_replaced = |name: &str| members.iter().any(|(other, _)| *other == name);
    let mut text = r#"{"asset":{"version":"2.0"}"#.to_owned();
    for (name, value) in own.iter().filter(|(name, _)| !is_replaced(name)).chain(members) {
        let _ = write!(text, ",\"{name}\":{value}");
    }
    one("a.gltf", &(text + "}"))
}
