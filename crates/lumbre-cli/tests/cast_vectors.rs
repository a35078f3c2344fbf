//! The reference vectors, through the program: a scene file in, CSV out, to the last bits of double precision.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

use serde_json::Value;

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().map_or_else(|| vec![number(value)], |list| list.iter().map(number).collect())
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is not a number"))
}

/// Numbers in the scene language, each reading back to the same bits.
fn text(value: &Value) -> String {
    numbers(value).iter().map(|v| format!("{v:?}")).collect::<Vec<_>>().join(" ")
}

/// A record's shape and transform as a scene.
fn scene(record: &Value) -> String {
    let mut out = String::from("WorldBegin\n");
    let no_ops = Vec::new();
    let ops = record["transform"]["ops"].as_array().unwrap_or(&no_ops);
    // The last to act on a point is the outermost, and stands first in a scene file.
    for op in ops.iter().rev() {
        let args: Vec<f64> = op.as_array().unwrap()[1..].iter().map(number).collect();
        let a = |i: usize| args[i];
        let line = match op[0].as_str().unwrap() {
            "scale" => format!("Scale {:?} {:?} {:?}", a(0), a(1), a(2)),
            "translate" => format!("Translate {:?} {:?} {:?}", a(0), a(1), a(2)),
            "rotate_x_deg" => format!("Rotate {:?} 1 0 0", a(0)),
            "rotate_y_deg" => format!("Rotate {:?} 0 1 0", a(0)),
            "rotate_z_deg" => format!("Rotate {:?} 0 0 1", a(0)),
            // Column by column: xy, xz, yx, yz, zx, zy are given.
            "shear" => format!(
                "ConcatTransform [1 {:?} {:?} 0  {:?} 1 {:?} 0  {:?} {:?} 1 0  0 0 0 1]",
                a(2),
                a(4),
                a(0),
                a(5),
                a(1),
                a(3)
            ),
            other => panic!("unknown transform {other}"),
        };
        let _ = writeln!(out, "{line}");
    }
    let p = |name: &str| text(&record["params"][name]);
    let shape = match record["shape"].as_str().unwrap() {
        "sphere" => {
            format!("\"sphere\" \"point3 center\" [{}] \"float radius\" {}", p("center"), p("radius"))
        }
        "plane" => format!("\"plane\" \"point3 point\" [{}] \"normal normal\" [{}]", p("point"), p("normal")),
        "disk" => format!(
            "\"disk\" \"point3 center\" [{}] \"normal normal\" [{}] \"float radius\" {} \"float innerradius\" {}",
            p("center"),
            p("normal"),
            p("radius"),
            p("inner_radius")
        ),
        "box" => format!("\"box\" \"point3 p0\" [{}] \"point3 p1\" [{}]", p("min"), p("max")),
        "cylinder_y" => {
            let _ = writeln!(out, "Translate {} 0 {}\nRotate -90 1 0 0", p("x0"), p("z0"));
            format!("\"cylinder\" \"float radius\" {} \"float zmin\" -inf \"float zmax\" inf", p("radius"))
        }
        "cylinder" => format!(
            "\"cylinder\" \"point3 p0\" [{}] \"point3 p1\" [{}] \"float radius\" {} \"bool caps\" true",
            p("p1"),
            p("p2"),
            p("radius")
        ),
        "cone" => format!(
            "\"cone\" \"point3 apex\" [{}] \"vector3 axis\" [{}] \"float angle\" {}",
            p("apex"),
            p("axis"),
            p("half_angle_deg")
        ),
        "frustum" => format!(
            "\"cone\" \"point3 p0\" [{}] \"point3 p1\" [{}] \"float radius\" {} \"float topradius\" {} \"bool caps\" true",
            p("p1"),
            p("p2"),
            p("r1"),
            p("r2")
        ),
        "torus" => format!(
            "\"torus\" \"point3 center\" [{}] \"float majorradius\" {} \"float minorradius\" {}",
            p("center"),
            p("major"),
            p("minor")
        ),
        "triangle" => {
            format!(
                "\"triangle\" \"point3 p0\" [{}] \"point3 p1\" [{}] \"point3 p2\" [{}]",
                p("a"),
                p("b"),
                p("c")
            )
        }
        other => panic!("unknown shape {other}"),
    };
    let _ = writeln!(out, "Shape {shape}");
    out
}

fn ray(record: &Value) -> String {
    let ray = &record["ray"];
    let mut values = numbers(&ray["origin"]);
    values.extend(numbers(&ray["direction"]));
    values.push(number(&ray["tmin"]));
    values.push(ray["tmax"].as_f64().unwrap_or(f64::INFINITY));
    values.iter().map(|v| format!("{v:?}")).collect::<Vec<_>>().join(",")
}

fn cast(folder: &Path, record: &Value, query: &str) -> Vec<Vec<String>> {
    let scene_path = folder.join("scene.pbrt");
    let rays_path = folder.join("rays.csv");
    std::fs::write(&scene_path, scene(record)).unwrap();
    std::fs::write(&rays_path, format!("ox,oy,oz,dx,dy,dz,tmin,tmax\n{}\n", ray(record))).unwrap();
    let out = Command::new(env!("CARGO_BIN_EXE_lumbre"))
        .args(["cast", "--query", query, "--threads", "1", "--strict", "--rays"])
        .arg(&rays_path)
        .arg(&scene_path)
        .output()
        .unwrap();
    assert!(
        out.status.success(),
        "{}: {}\n{}",
        record["id"],
        String::from_utf8_lossy(&out.stderr),
        scene(record)
    );
    let stdout = String::from_utf8(out.stdout).unwrap();
    stdout.lines().skip(1).map(|line| line.split(',').map(str::to_owned).collect()).collect()
}

/// The crossings that `lumbre explain` prints for a record's ray: t and normal.
fn explained(folder: &Path, record: &Value) -> Vec<(f64, Vec<f64>)> {
    let scene_path = folder.join("scene.pbrt");
    std::fs::write(&scene_path, scene(record)).unwrap();
    let out = Command::new(env!("CARGO_BIN_EXE_lumbre"))
        .args(["explain", "--strict", "--quiet", "--format", "json", "--env", "none", "--ground", "none"])
        .arg(format!("--ray={}", ray(record)))
        .arg(&scene_path)
        .output()
        .unwrap();
    assert!(out.status.success(), "{}: {}", record["id"], String::from_utf8_lossy(&out.stderr));
    let told: Value = serde_json::from_slice(&out.stdout).unwrap();
    let sections = |of: &Value| of["sections"].as_array().cloned().unwrap_or_default();
    let met = sections(&told).into_iter().find(|section| section["key"] == "surfaces").unwrap();
    let hits = sections(&met)
        .iter()
        .flat_map(sections)
        .filter(|section| section["key"] == "hit")
        .collect::<Vec<_>>();
    let of = |hit: &Value, symbol: &str| {
        let mut quantities = hit["quantities"].as_array().unwrap().iter();
        quantities.find(|quantity| quantity["symbol"] == symbol).unwrap()["value"].clone()
    };
    hits.iter().map(|hit| (number(&of(hit, "t")), numbers(&of(hit, "N")))).collect()
}

#[test]
fn every_reference_ray_is_explained_as_it_is_answered() {
    let vectors: Value = serde_json::from_str(include_str!("../../../tests/data/vectors.json")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let mut count = 0;
    for record in vectors["intersection"].as_array().unwrap() {
        let rows = cast(folder.path(), record, "all");
        let told = explained(folder.path(), record);
        assert_eq!(told.len(), rows.len(), "{}", record["id"]);
        for (row, (t, normal)) in rows.iter().zip(told) {
            let value = |i: usize| row[i].parse::<f64>().unwrap();
            assert_eq!(t.to_bits(), value(2).to_bits(), "{}: t", record["id"]);
            assert_eq!(normal, [value(6), value(7), value(8)], "{}: normal", record["id"]);
            count += 1;
        }
    }
    assert!(count >= 300, "{count}");
}

#[test]
fn every_reference_ray_is_answered_to_double_precision() {
    let vectors: Value = serde_json::from_str(include_str!("../../../tests/data/vectors.json")).unwrap();
    let records = vectors["intersection"].as_array().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let mut wrong = Vec::new();
    let mut hits_seen = 0;
    for record in records {
        let none = Vec::new();
        let expected = record["hits"].as_array().unwrap_or(&none);
        let rows = cast(folder.path(), record, "all");
        let id = &record["id"];
        if rows.len() != expected.len() {
            wrong.push(format!("{id}: {} hits, not {}", rows.len(), expected.len()));
            continue;
        }
        for (row, hit) in rows.iter().zip(expected) {
            hits_seen += 1;
            let value = |i: usize| row[i].parse::<f64>().unwrap();
            let (t, t_tol) = (number(&hit["t"]), number(&hit["t_tol"]));
            if (value(2) - t).abs() > t_tol {
                wrong.push(format!("{id}: t = {}, not {t} within {t_tol:e}", value(2)));
            }
            let normal = [value(6), value(7), value(8)];
            // Where no normal is defined there is no tolerance for it either.
            let n_tol = hit["n_tol"].as_f64().unwrap_or(0.0);
            let near = |reference: &Value| {
                numbers(reference).iter().zip(normal).all(|(r, n)| (r - n).abs() <= n_tol)
            };
            let admissible = if hit["normal"].is_null() {
                hit["normals"].as_array().is_none_or(|normals| normals.iter().any(near))
            } else {
                near(&hit["normal"])
            };
            if !admissible {
                wrong.push(format!("{id}: normal {normal:?}, not {}", hit["normal"]));
            }
            if let Some(front) = hit["front"].as_bool()
                && row[11] != (if front { "1" } else { "0" })
            {
                wrong.push(format!("{id}: front {}, not {front}", row[11]));
            }
        }
    }
    assert!(records.len() >= 400 && hits_seen >= 300, "{} records, {hits_seen} hits", records.len());
    assert!(wrong.is_empty(), "{} wrong:\n{}", wrong.len(), wrong.join("\n"));
}
