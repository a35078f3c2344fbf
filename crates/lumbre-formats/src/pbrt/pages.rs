//! The pages of the book about the scene language, held against the reader: every name that it knows has a page, every
//! parameter on a page is known, and every default is the one that is taken.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::fs;
use std::path::PathBuf;

use super::{lights, materials, media, read_bytes, settings, shapes, textures};
use crate::{Budget, Diagnostics};

/// A row of a table of parameters.
#[derive(Clone, Debug)]
struct Row {
    ty: String,
    name: String,
    /// As it is written in a scene; `None` where there is none, or where words say what it is.
    default: Option<String>,
    is_required: bool,
}

pub(super) fn docs() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../docs")
}

/// The tables of parameters of a page.
fn tables(page: &str) -> Vec<Vec<Row>> {
    let mut tables = vec![];
    let mut inside = false;
    for line in page.lines() {
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        match &cells[..] {
            ["", "parameter", "default", ..] => {
                inside = true;
                tables.push(vec![]);
            }
            ["", parameter, default, ..] if inside && !parameter.starts_with('-') => {
                let code = |cell: &str| Some(cell.strip_prefix('`')?.strip_suffix('`')?.to_owned());
                let parameter = code(parameter).unwrap_or_else(|| panic!("no parameter: {line}"));
                let (ty, name) = parameter.split_once(' ').unwrap_or_else(|| panic!("no type: {line}"));
                tables.last_mut().unwrap().push(Row {
                    ty: ty.to_owned(),
                    name: name.to_owned(),
                    default: code(default),
                    is_required: *default == "required",
                });
            }
            [_, _, ..] => {}
            _ => inside = false,
        }
    }
    tables
}

/// A value of a parameter whose type does not determine it.
pub(super) fn special(page: &str, name: &str) -> Option<&'static str> {
    Some(match (page, name) {
        ("triangle", "p1") => "1 0 0",
        ("triangle", "p2") => "0 1 0",
        ("quadric", "coefficients") => "1 2 3 0 0 0 0 0 0 -1",
        ("bilinearmesh", "P") => "0 0 0 1 0 0 0 1 0 1 1 1",
        ("bilinearmesh", "N" | "S") => "0 0 1 0 0 1 0 0 1 0 0 1",
        ("bilinearmesh", "uv") => "0 0 1 0 0 1 1 1",
        ("bilinearmesh", "indices") => "0 1 2 3",
        ("csg", "operands") => r#""one" "other""#,
        ("mix", "materials") => r#""one" "other""#,
        ("plymesh", "filename") => r#""star.ply""#,
        ("imagemap" | "diffuse", "filename") => r#""images/letter.png""#,
        ("infinite", "filename") => r#""images/sky.pfm""#,
        ("goniometric", "filename") => r#""images/lobes.png""#,
        ("projection", "filename") => r#""images/letter.png""#,
        ("sky", "at") => r#""2026-06-21T12:00+02:00,40.4,-3.7""#,
        ("infinite", "portal") => "0 0 0 0 1 0 2 1 0 2 0 0",
        ("curve", "P") => "0 0 0 1 0 0 1 1 0 2 2 0",
        (_, "P") => "0 0 0 1 0 0 0 1 0",
        (_, "N" | "S") => "0 0 1 0 0 1 0 0 1",
        (_, "uv") => "0 0 1 0 0 1",
        (_, "indices") => "0 1 2",
        (_, "faceIndices") => "5",
        ("uniformgrid" | "heterogeneous", "density" | "temperature" | "Lescale") => "0.5",
        // Shares of a body are left out.
        ("openpbr", "subsurface_weight") => "1",
        ("measured", "filename") => r#""images/satin.bsdf""#,
        ("realistic", "lensfile") => r#""images/triplet.txt""#,
        ("realistic", "aperture") => r#""star""#,
        ("subsurface", "name") => r#""Skin1""#,
        ("nanovdb", "temperaturename") => r#""density""#,
        ("nanovdb", "filename") => r#""images/cloud.nvdb""#,
        ("homogeneous" | "heterogeneous", "preset") => r#""Wholemilk""#,
        (_, "encoding") => r#""linear""#,
        (_, "screenwindow") => "-1 1 -2 2",
        (_, "p1") => "3 4 5",
        _ => return None,
    })
}

/// A value of a parameter that has no default, or not one that could be written.
fn sample(page: &str, row: &Row) -> &'static str {
    special(page, &row.name).unwrap_or_else(|| match &*row.ty {
        "float" => "0.3",
        "rgb" => "0.2 0.3 0.4",
        "point3" => "0 0 0",
        other => panic!("{page}: no value is known for a {other} {}", row.name),
    })
}

/// The parameters that things of this name need, as they are given.
pub(super) fn required(kind: &str, name: &str) -> String {
    let Ok(page) = fs::read_to_string(docs().join(kind).join(format!("{name}.md"))) else {
        return String::new();
    };
    let rows = tables(&page).into_iter().next().unwrap_or_default();
    rows.iter().filter(|row| row.is_required).map(|row| given(row, sample(name, row))).collect()
}

/// What a parameter is of no use without.
fn context(row: &Row) -> &'static str {
    match &*row.name {
        "v1" | "v2" => " \"string mapping\" \"planar\"",
        "mfp" => " \"rgb reflectance\" [0.5 0.5 0.5]",
        _ => "",
    }
}

fn given(row: &Row, value: &str) -> String {
    let is_text = matches!(&*row.ty, "string" | "spectrum") && !value.contains('"');
    let value = if is_text { format!("\"{value}\"") } else { value.to_owned() };
    format!(" \"{} {}\" [ {value} ]", row.ty, row.name)
}

/// A scene with one thing of this kind and type.
pub(super) fn scene(kind: &str, name: &str, params: &str) -> String {
    match kind {
        "films" => format!("Film \"{name}\" {params}\nWorldBegin"),
        "samplers" => format!("Sampler \"{name}\" {params}\nWorldBegin"),
        "filters" => format!("PixelFilter \"{name}\" {params}\nWorldBegin"),
        "accelerators" => format!("Accelerator \"{name}\" {params}\nWorldBegin"),
        "cameras" => format!("Camera \"{name}\" {params}\nWorldBegin"),
        "integrators" => format!("Integrator \"{name}\" {params}\nWorldBegin"),
        "shapes" => format!(
            "WorldBegin ObjectBegin \"one\" Shape \"sphere\" ObjectEnd ObjectBegin \"other\" Shape \"box\" ObjectEnd\n\
             Shape \"{name}\" {params}"
        ),
        "materials" if name == "hair" => {
            let curve = "Shape \"curve\" \"point3 P\" [0 0 0 1 0 0 1 1 0 2 2 0]";
            format!("WorldBegin Material \"hair\" {params} {curve}")
        }
        "materials" => format!(
            "WorldBegin MakeNamedMaterial \"one\" \"string type\" \"diffuse\"\n\
             MakeNamedMaterial \"other\" \"string type\" \"conductor\"\nMaterial \"{name}\" {params} Shape \"sphere\""
        ),
        "textures" => format!(
            "WorldBegin Texture \"t\" \"float\" \"{name}\" {params}\n\
             Material \"diffuse\" \"texture displacement\" \"t\" Shape \"sphere\""
        ),
        "lights" if name == "diffuse" => {
            format!("WorldBegin AreaLightSource \"{name}\" {params} Shape \"sphere\"")
        }
        "arealights" => format!("WorldBegin AreaLightSource \"{name}\" {params} Shape \"sphere\""),
        "media" => format!("MakeNamedMedium \"m\" \"string type\" \"{name}\" {params}\nWorldBegin"),
        "lights" => format!("WorldBegin LightSource \"{name}\" {params}"),
        other => panic!("{other}"),
    }
}

/// What a scene describes, as text, and the warnings.
fn described(text: &str) -> (String, Vec<String>) {
    let mut said = Diagnostics::new();
    let folder = docs().join("pictures");
    let desc = read_bytes("scene.pbrt", text.as_bytes(), Some(&folder), &Budget::default(), &mut said);
    let desc = desc.unwrap_or_else(|error| panic!("{error}\n{text}"));
    let warnings = said.lines().into_iter().filter(|line| !line.contains("the scene is upgraded")).collect();
    (format!("{desc:?}"), warnings)
}

pub(super) const KINDS: [(&str, &[&str]); 7] = [
    ("shapes", shapes::KNOWN),
    ("materials", &materials::KNOWN),
    ("textures", &textures::KNOWN_KINDS),
    ("lights", &lights::KNOWN),
    ("media", &media::MEDIA),
    ("cameras", &settings::CAMERAS),
    ("integrators", &settings::INTEGRATORS),
];

#[test]
fn every_name_of_the_reader_has_a_page() {
    let left_out = fs::read_to_string(docs().join("not-rendered.md")).unwrap();
    for (kind, names) in KINDS {
        for name in names {
            let page = docs().join(kind).join(format!("{name}.md"));
            let row = format!("`{name}`");
            let is_left_out = left_out.lines().any(|line| {
                let cells: Vec<&str> = line.split('|').map(str::trim).collect();
                matches!(cells[..], ["", of, names, ..] if of == kind && names.contains(&row))
            });
            assert!(page.exists() != is_left_out, "{kind} {name}: a page, or a line in not-rendered.md");
        }
    }
}

#[test]
fn parameters_and_defaults_of_the_pages_are_those_of_the_reader() {
    let (mut parameters, mut defaults) = (0, 0);
    for (kind, _) in KINDS {
        for entry in fs::read_dir(docs().join(kind)).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_stem().unwrap().to_string_lossy().into_owned();
            if name == "README" || name == "instances" {
                continue;
            }
            let tables = tables(&fs::read_to_string(&path).unwrap());
            // What stands in the first table is needed by all forms, what stands in another by that one.
            let required = |rows: &[Row]| -> String {
                rows.iter().filter(|row| row.is_required).map(|row| given(row, sample(&name, row))).collect()
            };
            for (number, rows) in tables.iter().enumerate() {
                let base = required(&tables[0]) + &if number > 0 { required(rows) } else { String::new() };
                for row in rows.iter().filter(|row| !row.is_required) {
                    let base = base.clone() + context(row);
                    let (plain, warnings) = described(&scene(kind, &name, &base));
                    assert_eq!(warnings, [""; 0], "{kind} {name}: {base}");
                    let value = row.default.clone().unwrap_or_else(|| sample(&name, row).to_owned());
                    let mut text = given(row, &value);
                    // One end of a segment or of a box is given with the other.
                    if row.default.is_none() && matches!(&*row.name, "p0" | "p1") {
                        let other =
                            rows.iter().find(|r| r.name != row.name && r.name.starts_with('p')).unwrap();
                        text += &given(other, sample(&name, other));
                    }
                    let (with, warnings) = described(&scene(kind, &name, &format!("{base}{text}")));
                    assert_eq!(warnings, [""; 0], "{kind} {name}: {text}");
                    parameters += 1;
                    if row.default.is_some() {
                        assert_eq!(plain, with, "{kind} {name}: another default than {text}");
                        defaults += 1;
                    }
                }
            }
        }
    }
    println!("{parameters} parameters, {defaults} defaults");
    assert!(parameters > 150 && defaults > 120, "{parameters} parameters, {defaults} defaults");
}

#[test]
fn a_wrong_name_or_default_would_be_noticed() {
    let (plain, _) = described(&scene("shapes", "sphere", ""));
    let (with, warnings) = described(&scene("shapes", "sphere", " \"float radius\" 2"));
    assert!(plain != with && warnings.is_empty());
    assert_eq!(described(&scene("shapes", "sphere", " \"float radios\" 1")).1.len(), 1);
}
