//! `lumbre math` against reference data computed with 120 digits, and as a person or a script meets it.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::io::Write;
use std::process::{Command, Output, Stdio};

use serde_json::Value;

use crate::program::{Desk, code, stderr, stdout};

/// Expressions with what each should give, as numbers row by row.
#[derive(Default)]
struct Checks {
    script: String,
    expected: Vec<(String, Vec<f64>)>,
}

impl Checks {
    fn add(&mut self, expression: String, expected: &Value) {
        let numbers = numbers(expected);
        assert!(!numbers.is_empty(), "{expression} = {expected}");
        self.script += &format!("{expression}\n");
        self.expected.push((expression, numbers));
    }

    /// All of them in one script, whose answers are JSON.
    fn check(&self) {
        let desk = Desk::new();
        desk.write("script.txt", &self.script);
        let out = desk.lumbre(&["math", "--json", "--file", "script.txt"]);
        assert_eq!(code(&out), 0, "{}", stderr(&out));
        let text = stdout(&out);
        let answers: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
        assert_eq!(answers.len(), self.expected.len());
        for (answer, (expression, expected)) in answers.iter().zip(&self.expected) {
            let found = numbers(&answer["value"]);
            assert_eq!(found.len(), expected.len(), "{expression}: {answer}");
            let scale = expected.iter().fold(0.0_f64, |most, e| most.max(e.abs()));
            let slack = 1e-13 * if scale > 0.0 { scale } else { 1.0 };
            for (f, e) in found.iter().zip(expected) {
                assert!((f - e).abs() <= slack, "{expression}: {found:?}, not {expected:?}");
            }
        }
    }
}

/// The numbers of nested lists in their order.
fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(items) => items.iter().flat_map(numbers).collect(),
        other => vec![other.as_f64().unwrap_or_else(|| panic!("{other} is no number"))],
    }
}

/// A list as a matrix with rows of this length.
fn rows(value: &Value, length: usize) -> String {
    let rows: Vec<String> = numbers(value).chunks(length).map(|row| format!("{row:?}")).collect();
    format!("[{}]", rows.join(", "))
}

fn quat(value: &Value) -> String {
    format!("quat({})", format!("{:?}", numbers(value)).trim_matches(['[', ']']))
}

#[test]
fn reference_vectors_hold() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/vectors.json");
    let all: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let mut seen = 0;
    let mut family = |name: &str, count: usize| {
        let records = all[name].as_array().unwrap().clone();
        assert_eq!(records.len(), count, "{name}");
        seen += count;
        records
    };
    let mut checks = Checks::default();
    let in_degrees = |radians: &Value| Value::from(radians.as_f64().unwrap().to_degrees());
    for r in family("vector", 6) {
        let (a, b) = (&r["a"], &r["b"]);
        checks.add(format!("dot({a}, {b})"), &r["dot"]);
        checks.add(format!("cross({a}, {b})"), &r["cross"]);
        checks.add(format!("cross_matrix({a}) * {b}"), &r["cross"]);
        checks.add(format!("angle({a}, {b})"), &in_degrees(&r["angle_rad"]));
        checks.add(format!("projected_length({a}, {b})"), &r["proj_len_b_on_a"]);
        checks.add(format!("project({a}, {b})"), &r["proj_b_on_a"]);
        checks.add(format!("project({a}, {b}) + reject({a}, {b})"), b);
    }
    for r in family("matrix_product", 3) {
        let is_number = r["product"]
            .as_array()
            .is_some_and(|rows| rows.len() == 1 && rows[0].as_array().unwrap().len() == 1);
        let product = if is_number { &r["product"][0] } else { &r["product"] };
        checks.add(format!("{} * {}", r["a"], r["b"]), product);
    }
    for r in family("axis_angle", 12) {
        let (axis, angle, v) = (&r["axis"], &r["angle_deg"], &r["v"]);
        checks.add(format!("linear(rotate({axis}, {angle}))"), &r["matrix3"]);
        checks.add(format!("rotate({axis}, {angle}, {v})"), &r["rotated"]);
        checks.add(format!("rotate({axis}, {angle}) * {v}"), &r["rotated"]);
        checks.add(format!("quat_about({axis}, {angle})"), &r["quaternion"]);
        checks.add(format!("rotate(quat_about({axis}, {angle}), {v})"), &r["rotated"]);
    }
    let mut recovered = 0;
    for r in family("euler", 18) {
        let euler = format!("euler({}, {}, {})", r["heading_deg"], r["attitude_deg"], r["bank_deg"]);
        checks.add(euler.clone(), &r["quaternion"]);
        checks.add(format!("matrix({euler})"), &r["matrix3"]);
        checks.add(format!("matrix(euler(angles({euler})))"), &r["matrix3"]);
        // Next to a pole, not at it, single angles are uncertain by about 1e-16 / cos(attitude).
        let attitude = r["attitude_deg"].as_f64().unwrap().abs();
        if attitude < 89.0 || !r["pole"].is_null() {
            checks.add(format!("angles({euler})"), &r["recovered_deg"]);
            recovered += 1;
        }
    }
    for r in family("quaternion", 10) {
        let (p, q) = (quat(&r["p"]), quat(&r["q"]));
        checks.add(format!("{p} + {q}"), &r["sum"]);
        checks.add(format!("{p} * {q}"), &r["product"]);
        checks.add(format!("conjugate({p})"), &r["conjugate_p"]);
        checks.add(format!("length({p})"), &r["norm_p"]);
        checks.add(format!("inverse({p})"), &r["inverse_p"]);
    }
    for r in family("quaternion_rotate", 6) {
        let q = quat(&r["quaternion"]);
        checks.add(format!("rotate({q}, {})", r["v"]), &r["rotated"]);
        checks.add(format!("matrix({q})"), &r["matrix3"]);
    }
    let mut parallel = 0;
    for r in family("frame", 7) {
        let expression = format!("frame({}, {})", r["a"], r["b"]);
        if r["u"].is_null() {
            let out = Desk::new().lumbre(&["math", &expression]);
            assert_eq!(code(&out), 2);
            assert!(stderr(&out).contains("not parallel to the first"), "{}", stderr(&out));
            parallel += 1;
        } else {
            checks.add(expression, &Value::from(vec![r["u"].clone(), r["v"].clone(), r["w"].clone()]));
        }
    }
    assert!(parallel > 0);
    for r in family("onb", 10) {
        let axes = vec![r["b1"].clone(), r["b2"].clone(), r["unit_n"].clone()];
        checks.add(format!("frame({})", r["n"]), &Value::from(axes));
    }
    for r in family("look_at", 12) {
        let name = if r["handedness"] == "right" { "look_at" } else { "look_at_left" };
        let expression = format!("{name}({}, {}, {})", r["eye"], r["center"], r["up"]);
        checks.add(expression.clone(), &r["matrix"]);
        checks.add(format!("{expression} * {}", r["center"]), &r["center_image"]);
    }
    for r in family("ortho", 5) {
        let sides =
            ["left", "right", "bottom", "top", "near", "far"].map(|side| r[side].to_string()).join(", ");
        checks.add(format!("ortho({sides})"), &r["matrix"]);
        checks.add(format!("ortho({sides}) * {}", r["point"]), &r["image"]);
    }
    for r in family("perspective", 5) {
        let m = format!("perspective({}, {}, {}, {})", r["fovy_deg"], r["aspect"], r["near"], r["far"]);
        checks.add(m.clone(), &r["matrix"]);
        for point in r["points"].as_array().unwrap() {
            checks.add(format!("clip({m}, {})", point["point"]), &point["clip"]);
            checks.add(format!("{m} * {}", point["point"]), &point["ndc"]);
        }
    }
    for r in family("simple_projection", 3) {
        checks.add(format!("simple_perspective({})", r["d"]), &r["matrix"]);
        checks.add(format!("simple_perspective({}) * {}", r["d"], r["point"]), &r["image"]);
    }
    for r in family("normal_transform", 8) {
        checks.add(format!("normal({}, {})", rows(&r["matrix3"], 3), r["normal"]), &r["transformed"]);
    }
    for r in family("composition", 6) {
        let arguments = format!("{}, {}, {}", r["scale"], r["angles_deg"], r["translate"]);
        let p = &r["point"];
        checks.add(format!("row_chain({arguments})"), &r["row_matrix"]);
        checks.add(format!("{p} * row_chain({arguments})"), &r["row_image"]);
        checks.add(format!("transpose(row_chain({arguments}))"), &r["column_matrix_equivalent"]);
        checks.add(format!("chain({arguments})"), &r["column_matrix_same_angles"]);
        checks.add(format!("chain({arguments}) * {p}"), &r["column_image_same_angles"]);
        checks.add(format!("{p} * row_form(chain({arguments}))"), &r["column_image_same_angles"]);
        checks.add(format!("inverse(chain({arguments})) * (chain({arguments}) * {p})"), p);
    }
    for r in family("camera_ray", 8) {
        let size = format!("[{}, {}]", r["width"], r["height"]);
        let view = format!("{}, {}, {}, {}", r["eye"], r["center"], r["up"], r["fovy_deg"]);
        checks.add(format!("camera_ray({view}, {size}, {})", r["pixel"]), &r["direction_unit"]);
    }
    assert_eq!(seen, 119);
    assert!(recovered >= 14, "{recovered}");
    checks.check();
}

fn piped(arguments: &[&str], input: &str) -> Output {
    let mut child = Command::new(env!("CARGO_BIN_EXE_lumbre"))
        .args(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // It may end before it has read everything.
    let _ = child.stdin.take().unwrap().write_all(input.as_bytes());
    child.wait_with_output().unwrap()
}

#[test]
fn an_expression_prints_its_steps_and_then_its_value() {
    let out = Desk::new().lumbre(&["math", "rotate_z(90) * [2, 3, 5]"]);
    assert_eq!(code(&out), 0, "{}", stderr(&out));
    let text = stdout(&out);
    assert!(text.starts_with("rotate_z(degrees)\n  R = cos θ I"), "{text}");
    assert!(
        text.contains("\n  | 0  -1  0  0 | | 2 |   | -3 |\n  | 1   0  0  0 | | 3 | = |  2 |\n"),
        "{text}"
    );
    assert!(text.ends_with("\n= [-3, 2, 5]\n"), "{text}");
    for (words, result) in [
        (&["-1", "+", "2", "*", "3"][..], "= 5\n"),
        (&["-2^2 + 1"], "= -3\n"),
        (&["-x"], "= [-1, 0, 0]\n"),
        (&["7", "-", "3"], "= 4\n"),
    ] {
        let out = Desk::new().lumbre(&[&["math"], words].concat());
        assert_eq!(stdout(&out), result, "{}", stderr(&out));
    }
}

#[test]
fn steps_help_and_mistakes_are_told_in_spanish_too() {
    let desk = Desk::new();
    for (expression, expected) in [
        (
            "dot([1, 2], [3, 4])",
            "dot(a, b)\n  a·b = ax bx + ay by\n  = 1·3 + 2·4 = 11\n  > 0: el ángulo es menor que 90°\n= 11\n",
        ),
        (
            "perspective(90, 2, 1, 3) * [1, 2, -4]",
            "perspective(fovy, aspect, near, far)
  k = cot(fovy/2) = 1
  | k/aspect  0   0            0          |
  | 0         k   0            0          |
  | 0         0   (f+n)/(n-f)  2fn/(n-f)  |
  | 0         0  -1            0          |
  tras dividir entre w = -z: z = -near va a -1, z = -far va a 1
M p
  un punto: w = 1
  | 0.5  0   0   0 | |  1 |   | 0.5 |
  |   0  1   0   0 | |  2 | = |   2 |
  |   0  0  -2  -3 | | -4 |   |   5 |
  |   0  0  -1   0 | |  1 |   |   4 |
  dividido entre w = 4
= [0.125, 0.5, 1.25]
",
        ),
        (
            "det([[0, 2], [3, 0]])",
            "det(M)\n  m11 m22 - m12 m21 = 0·0 - 2·3 = -6\n  la suma es exacta y se redondea una sola vez\n  < 0: refleja\n= -6\n",
        ),
        ("help angles", "angles(q)\n    rumbo, actitud e inclinación de un cuaternión, en grados\n"),
    ] {
        let out = desk.lumbre(&["math", "--lang", "es", expression]);
        assert_eq!(code(&out), 0, "{}", stderr(&out));
        assert_eq!(stdout(&out), expected);
    }
    for (expression, expected) in [
        (
            "x + dott(x, y)",
            "error: expresión:1:5: función desconocida (se encontró: \"dott\"; se esperaba: un nombre de la lista que da `help`; ¿quería decir \"dot\"?)
  x + dott(x, y)
      ^
",
        ),
        (
            "cross([1, 2, 3], [4, 5])",
            "error: expresión:1:18: el argumento 2 de cross no es válido (se encontró: [4, 5]; se esperaba: un vector de 3)
  cross([1, 2, 3], [4, 5])
                   ^
",
        ),
    ] {
        let out = desk.lumbre(&["math", expression, "--lang", "es"]);
        assert_eq!((code(&out), stdout(&out).as_str()), (2, ""));
        assert_eq!(stderr(&out), expected);
    }
    let out = piped(&["math", "--lang", "es"], "1 +\n");
    assert_eq!(code(&out), 3);
    assert!(
        stderr(&out).starts_with(
            "error: entrada estándar:1:4: aquí no se esperaba esto (se encontró: el final de la expresión"
        ),
        "{}",
        stderr(&out)
    );
    desk.write("nota.txt", "translate([1, 2, 3])");
    let steps = |lang: &str| {
        let out = desk.lumbre(&["math", "--json", "--lang", lang, "--file", "nota.txt"]);
        serde_json::from_str::<Value>(&stdout(&out)).unwrap()
    };
    let (english, spanish) = (steps("en"), steps("es"));
    assert_eq!(english["value"], spanish["value"]);
    assert_eq!(spanish["steps"][0]["lines"][0], "mueve puntos (w = 1), no direcciones (w = 0)");
    assert_eq!(english["steps"][0]["lines"][1], spanish["steps"][0]["lines"][1]);
}

#[test]
fn json_has_the_value_its_kind_and_the_steps() {
    let out = Desk::new().lumbre(&["math", "T = translate([1, 2, 3]); [1, 2] / 2", "--json"]);
    assert_eq!(code(&out), 0, "{}", stderr(&out));
    let results: Vec<Value> = stdout(&out).lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(results.len(), 2);
    assert_eq!((&results[0]["name"], &results[0]["type"]), (&"T".into(), &"transform".into()));
    assert_eq!(results[0]["value"][1], serde_json::json!([0.0, 1.0, 0.0, 2.0]));
    assert_eq!(results[0]["steps"][0]["operation"], "translate(v)");
    assert!(results[0]["steps"][0]["lines"].as_array().unwrap().len() > 3);
    assert_eq!((&results[1]["name"], &results[1]["value"]), (&Value::Null, &serde_json::json!([0.5, 1.0])));
}

#[test]
fn input_lines_share_names_and_continue_in_brackets() {
    let out = piped(&["math"], "v = [3,\n 4]\nlength(v)\nans * 2\n\nquit\n1 / 0\n");
    assert_eq!(code(&out), 0, "{}", stderr(&out));
    let text = stdout(&out);
    let results: Vec<&str> =
        text.lines().filter(|line| !line.starts_with(' ') && line.contains("= ")).collect();
    assert_eq!(results, ["v = [3, 4]", "= 5", "= 10"]);
}

#[test]
fn errors_have_a_place_and_the_right_exit_status() {
    let desk = Desk::new();
    let out = desk.lumbre(&["math", "dott(x, y)"]);
    assert_eq!((code(&out), stdout(&out).as_str()), (2, ""));
    assert!(
        stderr(&out).starts_with("error: expression:1:1: unknown function (found \"dott\""),
        "{}",
        stderr(&out)
    );
    assert!(stderr(&out).contains("did you mean \"dot\"?)\n  dott(x, y)\n  ^\n"), "{}", stderr(&out));

    desk.write("script.txt", "\u{feff}a = 2 # fine\r\n\r\na * x * y\r\n");
    let out = desk.lumbre(&["math", "--file", "script.txt"]);
    assert_eq!(code(&out), 3);
    assert!(
        stderr(&out).starts_with("error: script.txt:3:7: cannot multiply two vectors with *"),
        "{}",
        stderr(&out)
    );
    assert!(stdout(&out).starts_with("a = 2\n"), "what comes before is done: {}", stdout(&out));

    let out = piped(&["math"], "1\n2 +\n");
    assert_eq!(code(&out), 3);
    assert!(stderr(&out).starts_with("error: standard input:2:4: unexpected here"), "{}", stderr(&out));

    // Minutes, if each line were read again with those before it.
    let out = piped(&["math"], &format!("[{}", "1,\n".repeat(400_000)));
    assert_eq!(code(&out), 3);
    assert!(stderr(&out).contains("an expression of 1048576 bytes or more"), "{}", stderr(&out));
    let out = desk.lumbre(&["math", &format!("[{}", "1, ".repeat(1000))]);
    assert!(
        stderr(&out).contains("too many values between brackets (expected at most 16)"),
        "{}",
        stderr(&out)
    );

    desk.write("deep.txt", &"-(sqrt([2^".repeat(50_000));
    let out = desk.lumbre(&["math", "--file", "deep.txt"]);
    assert_eq!(code(&out), 3);
    assert!(
        stderr(&out).contains("too many brackets within each other (expected at most 100)"),
        "{}",
        stderr(&out)
    );

    let out = desk.lumbre(&["math", "--file", "missing.txt"]);
    assert_eq!(code(&out), 4);
    std::fs::write(desk.path("bytes"), [0xff, 0xfe, 0]).unwrap();
    let out = desk.lumbre(&["math", "--file", "bytes"]);
    assert_eq!((code(&out), stderr(&out).trim_end()), (3, "error: bytes: not text in UTF-8"));
    assert_eq!(code(&desk.lumbre(&["math", "--jsn", "1"])), 2);
}

#[test]
fn help_lists_the_functions() {
    let desk = Desk::new();
    let all = stdout(&desk.lumbre(&["math", "help"]));
    for name in ["dot(a, b)", "look_at(eye, target, up)", "euler(heading, attitude, bank)"] {
        assert!(all.contains(name), "{all}");
    }
    let one = desk.lumbre(&["math", "help angles"]);
    assert_eq!(stdout(&one), "angles(q)\n    heading, attitude and bank of a quaternion, in degrees\n");
}

/// Rows of its tables of functions are: call, meaning, example, result.
#[test]
fn every_function_has_a_correct_example_in_the_manual() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/math.md");
    let manual = std::fs::read_to_string(path).unwrap();
    let desk = Desk::new();
    let help = stdout(&desk.lumbre(&["math", "help"]));
    let calls =
        help.lines().filter(|line| line.contains('(') && line.ends_with(')') && !line.starts_with(' '));
    let forms: Vec<&str> = calls.flat_map(|line| line.split(" | ")).collect();
    assert!(forms.len() > 60, "{forms:?}");
    let (mut script, mut shown) = (String::new(), vec![]);
    for form in forms {
        let start = format!("| `{form}` |");
        let row = manual.lines().find(|row| row.starts_with(&start));
        assert!(row.is_some(), "{form} is missing");
    }
    for row in manual.lines().filter(|row| row.starts_with("| `")) {
        let cells: Vec<&str> =
            row.trim_matches('|').split(" | ").map(|cell| cell.trim().trim_matches('`')).collect();
        if let [_, _, example, result] = cells[..] {
            script += &format!("{example}\n{result}\n");
            shown.push(row);
        }
    }
    desk.write("examples.txt", &script);
    let out = desk.lumbre(&["math", "--json", "--file", "examples.txt"]);
    assert_eq!(code(&out), 0, "{}", stderr(&out));
    let text = stdout(&out);
    let values: Vec<Value> =
        text.lines().map(|line| serde_json::from_str::<Value>(line).unwrap()["value"].take()).collect();
    assert_eq!(values.len(), 2 * shown.len());
    for (pair, row) in values.chunks(2).zip(shown) {
        // The sign of zero is not printed.
        assert_eq!(numbers(&pair[0]), numbers(&pair[1]), "{row}");
    }
}

/// The text that an expression prints.
fn told(expression: &str) -> String {
    let out = Desk::new().lumbre(&["math", expression]);
    assert_eq!(code(&out), 0, "{expression}: {}", stderr(&out));
    stdout(&out)
}

#[test]
fn matrices_are_singular_by_one_rule() {
    let desk = Desk::new();
    let singular = [
        "cross_matrix([0.1, 0.2, 0.3])",
        "[[1, 2], [2, 4]]",
        "[[0.1, 0.3], [0.2, 0.6]]",
        "[[1, 2, 3], [4, 5, 6], [7, 8, 9]]",
    ];
    for matrix in singular {
        assert!(told(&format!("det({matrix})")).ends_with("= 0: no inverse\n= 0\n"), "{matrix}");
        let size = if matrix.matches('[').count() == 3 { "[1, 5]" } else { "[1, 2, 4]" };
        let out = desk.lumbre(&["math", &format!("inverse({matrix})")]);
        assert!(stderr(&out).contains("this has no inverse"), "{matrix}: {}", stderr(&out));
        let out = desk.lumbre(&["math", &format!("solve({matrix}, {size})")]);
        assert!(stderr(&out).contains("M x = b has no solution"), "{matrix}: {}", stderr(&out));
        let zero = if size == "[1, 5]" { "[0, 0]" } else { "[0, 0, 0]" };
        let out = desk.lumbre(&["math", &format!("solve({matrix}, {zero})")]);
        assert!(stderr(&out).contains("M x = b has more than one solution"), "{matrix}: {}", stderr(&out));
    }
    // Nearly singular is not singular, and it is said.
    let near = told("solve([[1, 1], [1, 1 + 2^-50]], [2, 2 + 2^-50])");
    assert!(
        near.contains("nearly singular: rows of these lengths allow a determinant 1/4.4e-16 times as large"),
        "{near}"
    );
    assert!(near.ends_with("= [1, 1]\n"), "{near}");
    for (expression, result) in [
        ("solve([[2]], 3)", "= [1.5]\n"),
        (
            "solve([[2, 0, 0, 0], [0, 4, 0, 0], [0, 0, 8, 0], [1, 1, 1, 1]], [2, 4, 8, 10])",
            "= [1, 1, 1, 7]\n",
        ),
        (
            "inverse([[2, 0, 0, 0], [0, 4, 0, 0], [0, 0, 8, 0], [2, 4, 8, 1]]) * [2, 4, 8, 1]",
            "= [1, 1, 1, -13]\n",
        ),
        ("det([[1, 2, 0, 0], [3, 4, 0, 0], [0, 0, 5, 6], [0, 0, 7, 8]])", "= 4\n"),
    ] {
        assert!(told(expression).ends_with(result), "{expression}: {}", told(expression));
    }
}

#[test]
fn steps_explain_determinants_inverses_and_powers() {
    let det = told("det([[2, 0, 1], [0, 3, 0], [1, 0, 1]])");
    assert!(
        det.contains("= 2·(3·1 - 0·0) - 0·(0·1 - 0·1) + 1·(0·0 - 3·1)\n  = 2·3 - 0·0 + 1·(-3) = 3\n"),
        "{det}"
    );
    let inverse = told("inverse([[1, 2], [3, 4]])");
    assert!(
        inverse.contains("C = |  4  -3 |   det M = -2\n      | -2   1 |") || inverse.contains("  det M = -2"),
        "{inverse}"
    );
    assert!(inverse.contains("M M⁻¹ = I"), "{inverse}");
    assert!(told("inverse([[0.1, 0.7], [0.3, 0.9]])").contains("M M⁻¹ ≈ I"));
    let power = told("[[1, 1], [0, 1]]^5");
    assert!(
        power.contains("by squares: M^5 = M^1 M^4") && power.ends_with("= [[1, 5],\n   [0, 1]]\n"),
        "{power}"
    );
    assert!(told("rotate_z(90)^3 * x").ends_with("= [0, -1, 0]\n"));
    assert!(told("[[2, 0], [0, 4]]^-2").ends_with("= [[0.25,      0],\n   [   0, 0.0625]]\n"));
    assert!(told("[[2, 5], [7, 4]]^0").ends_with("= [[1, 0],\n   [0, 1]]\n"));
    assert!(told("quat(0, 1, 0, 0)^2").ends_with("= quat(-1, 0, 0, 0)\n"));
    let sum = told("quat(1, 2, 3, 4) + quat(1, -1, 1, 1)");
    assert!(sum.contains("  i:  2 + (-1) = 1\n"), "{sum}");
    let quotient = told("quat(1, 1, 0, 0) / quat(1, 0, 1, 0)");
    assert!(
        quotient.contains("q⁻¹ = conj q / |q|² =") && quotient.contains("  k:  a1d2 + b1c2 - c1b2 + d1a2 ="),
        "{quotient}"
    );
    assert!(quotient.ends_with("= quat(0.5, 0.5, -0.5, -0.5)\n"), "{quotient}");
    let slerp = told("slerp(quat_about(z, 0), quat_about(z, 90), 0.5) * 1");
    assert!(slerp.contains("cos θ = p·q"), "{slerp}");
    let half = told("angles(slerp(quat_about(y, 10), quat_about(y, 50), 0.25))");
    let heading: f64 =
        half.lines().last().unwrap().trim_start_matches("= [").split(',').next().unwrap().parse().unwrap();
    assert!((heading - 20.0).abs() < 1e-12, "{half}");
}

#[test]
fn vectors_of_any_length_have_angles_and_parts() {
    for (expression, result) in [
        ("angle([1e-200, 0, 0], [0, 1e-200, 0])", "= 90\n"),
        ("angle([1e200, 0, 0], [1e200, 1e200, 0])", "= 45\n"),
        ("project([1e200, 0, 0], [1, 1, 0])", "= [1, 0, 0]\n"),
        ("reject([1e200, 0, 0], [1, 1, 0])", "= [0, 1, 0]\n"),
        ("projected_length([1e-200, 0, 0], [3, 1, 0])", "= 3\n"),
        ("normal(scale([1e200, 1e200, 1]), [0, 0, 2])", "= [0, 0, 1]\n"),
        ("inverse(quat(2^700, 0, 0, 0)) * 2^700", "= quat(1, 0, 0, 0)\n"),
        ("length(quat(3 * 2^700, 0, 0, 4 * 2^700)) / 2^700", "= 5\n"),
        ("rotate(quat(1e-200, 0, 0, 1e-200), [1, 0, 0])", "= [0, 1, 0]\n"),
        ("quat(2^-699, 0, 0, 0) / quat(2^-700, 0, 0, 0)", "= quat(2, 0, 0, 0)\n"),
        ("angles(quat(1e-200, 0, 1e-200, 0))", "= [90, 0, 0]\n"),
    ] {
        let text = told(expression);
        assert!(text.ends_with(result), "{expression}: {text}");
        assert!(!text.contains("inf") && !text.contains("NaN"), "{text}");
    }
}

/// The logarithm to base 2 of a number as `1.5·2^-9`.
fn logarithm_of(written: &str) -> f64 {
    let (share, power) = written.trim_matches(['(', ')']).split_once("·2^").unwrap();
    share.parse::<f64>().unwrap().log2() + power.parse::<f64>().unwrap()
}

#[test]
fn determinants_beyond_all_doubles_are_told_as_they_are() {
    let desk = Desk::new();
    let told = |expression: &str| stdout(&desk.lumbre(&["math", expression]));
    let small = told("det([[1e-200, 0], [0, 3e-200]])");
    assert!(small.contains("> 0: it keeps the hand") && small.contains("less than all doubles"), "{small}");
    assert!(!small.contains("no inverse") && small.ends_with("= 0\n"), "{small}");
    let written = small.lines().find_map(|line| line.strip_prefix("  m11 m22 - m12 m21 = ")).unwrap();
    let (_, written) = written.split_once(" = ").unwrap();
    let expected = 3.0_f64.log2() - 400.0 * 10.0_f64.log2();
    assert!((logarithm_of(written) - expected).abs() < 1e-9, "{written}");
    assert!(told("det([[1e-200, 2e-200], [2e-200, 4e-200]])").contains("= 0: no inverse"));
    for (m, b) in
        [("[[1e-200, 0], [0, 1e-200]]", "[1e-200, 2e-200]"), ("[[1e200, 0], [0, 1e200]]", "[1e200, 2e200]")]
    {
        let solved = told(&format!("solve({m}, {b})"));
        assert!(solved.ends_with("= [1, 2]\n"), "{solved}");
        assert!(!solved.contains("0 / 0") && !solved.contains("inf"), "{solved}");
        let line =
            solved.lines().find_map(|line| line.strip_prefix("  y = det[c1 b] / det[c1 c2] = ")).unwrap();
        let (over, under) = line.split_once(" = ").unwrap().0.split_once(" / ").unwrap();
        assert!((logarithm_of(over) - logarithm_of(under) - 1.0).abs() < 1e-9, "{line}");
        let inverse = told(&format!("inverse({m})"));
        assert!(inverse.contains("M' = M / 2^") && !inverse.contains("det M' = 0"), "{inverse}");
    }
    let spanish = stdout(&desk.lumbre(&["math", "--lang", "es", "det([[1e-200, 0], [0, 3e-200]])"]));
    assert!(spanish.contains("no es 0, pero es menor"), "{spanish}");
}
