//! The language from within: no text makes it panic, and what it prints reads back.

use lumbre::math::random::RandomStream;

use super::english::ENGLISH;
use super::functions;
use super::session::{Outcome, Session};
use super::spanish::SPANISH;
use super::value::Value;
use super::{Form, message, shown};

/// The value of the last statement.
fn value(text: &str) -> Result<Value, String> {
    let mut last = None;
    let run = Session::new(&ENGLISH).run(text, |outcome| {
        last = Some(outcome);
        Ok::<(), ()>(())
    });
    run.map_err(|wrong| message("expression", text, &wrong, &ENGLISH))?.expect("nothing stops it");
    match last {
        Some(Outcome::Value { value, .. }) => Ok(value),
        other => Err(format!("{text}: {other:?}")),
    }
}

fn line(text: &str) -> String {
    value(text).unwrap_or_else(|message| panic!("{message}")).line()
}

#[test]
fn random_tokens_are_evaluated_or_refused_and_never_panic() {
    let mut words: Vec<String> = functions::all().map(|function| format!("{}(", function.name)).collect();
    let others = "0 1 -1 2 1e308 -1e-308 5e-324 90 0.5 pi x y z i j k a ans = ( ) [ ] , ; + - * / ^ ^-1 \
        [1,2] [1,2,3] [0,0,0] [1,2,3,4] [[1,2],[3,4]] [[1,0,0],[0,1,0],[0,0,1]] [[0,0,0],[0,0,0],[0,0,0]] [1e200,0,-1e200] \
        rotate_x(30) translate([1,2,3]) perspective(60,1,1,9) quat(1,2,3,4) quat(0,0,0,0) help € \u{0} \" . .. 1e 2x | ° 2( ñ # ";
    words.extend(others.split(' ').map(str::to_owned));
    words.push("\n".into());
    let simple: Vec<&String> = words.iter().filter(|word| value(word).is_ok()).collect();
    let mut random = RandomStream::new(5);
    let (mut values, mut mistakes) = (0, 0);
    for _ in 0..6000 {
        let count = 1 + random.next_below(9);
        let mut text = String::new();
        for _ in 0..count {
            text += &words[random.next_below(words.len())];
            text += if random.next_below(4) == 0 { "" } else { " " };
        }
        // Half of them are calls that are well formed, so that the functions see odd values.
        if random.next_below(2) == 0 {
            let function =
                functions::all().nth(random.next_below(functions::all().count())).expect("it is below");
            let form = function.forms[random.next_below(function.forms.len())];
            let arguments = form.split(',').map(|_| simple[random.next_below(simple.len())].as_str());
            text = format!("{}({})", function.name, arguments.collect::<Vec<_>>().join(", "));
        }
        let texts = if random.next_below(2) == 0 { &ENGLISH } else { &SPANISH };
        let mut session = Session::new(texts);
        let run = session.run(&text, |outcome| {
            assert!(!shown(&outcome, Form::Text).is_empty());
            let json = shown(&outcome, Form::Json);
            assert!(
                serde_json::from_str::<serde_json::Value>(&json).is_ok_and(|json| json.is_object()),
                "{json}"
            );
            if let Outcome::Value { value, .. } = outcome {
                assert!(value.is_finite(), "{text}: {value:?}");
                values += 1;
            }
            Ok::<(), ()>(())
        });
        if let Err(wrong) = run {
            assert!(wrong.offset <= text.len(), "{text}");
            assert!(message("expression", &text, &wrong, texts).starts_with("expression:"), "{text}");
            mistakes += 1;
        }
    }
    assert!(values > 500 && mistakes > 2000, "{values} values, {mistakes} mistakes");
}

#[test]
fn deep_brackets_signs_and_long_sums_do_not_exhaust_the_stack() {
    for open in ["(", "[", "-(", "2^", "sqrt("] {
        let message = value(&open.repeat(100_000)).expect_err("it has no end");
        assert!(message.contains("at most 100"), "{open}: {message}");
    }
    assert_eq!(line(&format!("{}1", "-".repeat(100_001))), "-1");
    assert_eq!(line(&vec!["1"; 100_000].join("+")), "100000");
}

#[test]
fn what_is_printed_reads_back() {
    for text in [
        "1/3",
        "[1/3, -1e-7, 1e300]",
        "rotate([1, 2, 3], 40) * translate([0.1, 0.2, 0.3])",
        "quat_about([1, 2, 3], 77)",
        "[[1/3, 2], [1e17, -4]]",
        "perspective(50, 1.5, 0.1, 90)",
    ] {
        let first = value(text).expect("it is right");
        assert_eq!(line(text), line(&line(text)));
        assert_eq!(value(&first.lines().join("\n")).expect("it reads back").line(), first.line());
    }
}

#[test]
fn operators_bind_as_in_mathematics() {
    for (text, expected) in [
        ("1 + 2 * 3", "7"),
        ("(1 + 2) * 3", "9"),
        ("7 - 2 - 1", "4"),
        ("-2^2", "-4"),
        ("2^3^2", "512"),
        ("2^-1", "0.5"),
        ("a = 2; b = a * 3; a + b", "8"),
        ("2; ans * 5", "10"),
        ("i*j", "quat(0, 0, 0, 1)"),
        ("1 + 2*i - j/2", "quat(1, 2, -0.5, 0)"),
        ("[1, 2,\n 3] # a comment", "[1, 2, 3]"),
        (
            "[[1, 7], [2, 3], [5, 4]] * [[2, 5, 8, 10], [2.2, 3, -2.5, 5]]",
            "[[17.400000000000002, 26, -9.5, 45], [10.600000000000001, 19, 8.5, 35], [18.8, 37, 30, 70]]",
        ),
        ("[1, 0, 0] * transpose(translate([5, 6, 7]))", "[6, 6, 7]"),
        ("[1, 0, 0, 1] * transpose(translate([5, 6, 7]))", "[6, 6, 7, 1]"),
    ] {
        assert_eq!(line(text), expected, "{text}");
    }
}

#[test]
fn mistakes_say_where_what_and_what_would_do() {
    for (text, expected) in [
        (
            "1 + crosss(x, y)",
            "expression:1:5: unknown function (found \"crosss\"; expected a name that `help` lists; did you mean \"cross\"?)\n  1 + crosss(x, y)\n      ^",
        ),
        (
            "dot(x, 3)",
            "expression:1:8: wrong argument 2 of dot (found 3; expected a vector of 2 or 3)\n  dot(x, 3)\n         ^",
        ),
        (
            "a = x\ndot(a)",
            "expression:2:1: wrong number of arguments of dot (found 1; expected dot(a, b))\n  dot(a)\n  ^",
        ),
        (
            "x * y",
            "expression:1:3: cannot multiply two vectors with * (expected dot(a, b) or cross(a, b))\n  x * y\n    ^",
        ),
        (
            "x + 2",
            "expression:1:3: + is not defined for these (found a vector of 3 + a number; expected two numbers, vectors, matrices or quaternions of the same size)\n  x + 2\n    ^",
        ),
        ("norm", "expression:1:1: this is a function (found \"norm\"; expected norm(a))\n  norm\n  ^"),
        (
            "1/2x",
            "expression:1:3: after / and ^ a product without * can be read in two ways (expected parentheses, as in 1/(2*x) or (1/2)*x)\n  1/2x\n    ^",
        ),
        (
            "3 + |[1, 2]",
            "expression:1:12: unexpected here (found the end; expected one of + - * / ^, or \"|\")\n  3 + |[1, 2]\n             ^",
        ),
        (
            "|rotate(90)|",
            "expression:1:2: wrong argument 1 of length (found a 2×2 matrix; expected a number, a vector or a quaternion; det(M) is the determinant)\n  |rotate(90)|\n   ^",
        ),
        (
            "eigenvalues(rotate(90))",
            "expression:1:1: no eigenvalue is real, and the result is a vector of real ones (found 0 ± 1 i; expected a matrix with a real eigenvalue, such as a symmetric one or one of 3 rows)\n  eigenvalues(rotate(90))\n  ^",
        ),
        (
            "1 / 0",
            "expression:1:3: division by 0 (found 1 / 0; expected a divisor that is not 0)\n  1 / 0\n    ^",
        ),
        (
            "1e200 * 1e200",
            "expression:1:7: the result is not finite (found inf; expected numbers that stay finite)\n  1e200 * 1e200\n        ^",
        ),
        (
            "0^0",
            "expression:1:2: 0^0 has no value: x^0 is 1 and 0^y is 0, so that no value suits both (found 0^0; expected a base or an exponent above 0)\n  0^0\n   ^",
        ),
        (
            "sqrt(-1)",
            "expression:1:6: wrong argument 1 of sqrt (found -1; expected 0 or more: the square of a real number is not negative)\n  sqrt(-1)\n       ^",
        ),
        (
            "asin(2)",
            "expression:1:6: wrong argument 1 of asin (found 2; expected a number from -1 to 1, as sines and cosines are)\n  asin(2)\n       ^",
        ),
        (
            "solve(cross_matrix([0.1, 0.2, 0.3]), [1, 2, 3])",
            "expression:1:1: M x = b has no solution: its equations contradict one another (found det M = 0; expected equations whose determinant is not 0)\n  solve(cross_matrix([0.1, 0.2, 0.3]), [1, 2, 3])\n  ^",
        ),
        (
            "solve([[1, 2], [2, 4]], [3, 6])",
            "expression:1:1: M x = b has more than one solution: its equations are not independent (found det M = 0; expected equations whose determinant is not 0)\n  solve([[1, 2], [2, 4]], [3, 6])\n  ^",
        ),
        (
            "[1, 2",
            "expression:1:6: unexpected here (found the end; expected \",\" or \"]\")\n  [1, 2\n       ^",
        ),
        (
            "look_at(x, x, y)",
            "expression:1:12: wrong argument 2 of look_at (found [1, 0, 0]; expected a target away from the eye)\n  look_at(x, x, y)\n             ^",
        ),
        (
            "dot = 3",
            "expression:1:1: this name is already used (found \"dot\"; expected another name)\n  dot = 3\n  ^",
        ),
        (
            "1.2.3",
            "expression:1:1: this is not a number (found \"1.2.3\"; expected a number such as 2, 0.5 or 1e-3)\n  1.2.3\n  ^",
        ),
    ] {
        assert_eq!(value(text).expect_err(text), expected);
    }
}

#[test]
fn what_is_written_on_paper_is_taken() {
    for (text, expected) in [
        ("norm([3, 4, 12])", "13"),
        ("|[3, 4, 12]|", "13"),
        ("|-7| * |[3, 4]|", "35"),
        ("1 + |[2, 4, 5, 6]|", "10"),
        ("normalize([0, 3, 4])", "[0, 0.6, 0.8]"),
        ("sin(30°) + sin(30º)", "1"),
        ("2pi - 2*pi", "0"),
        ("2π / 2", "3.141592653589793"),
        ("2x + 3y", "[2, 3, 0]"),
        ("a = 3; 2a^2", "18"),
        ("-2(3 + 4)", "-14"),
        ("2[1, 2]", "[2, 4]"),
        ("2sin(30)", "1"),
        ("3e2x", "[300, 0, 0]"),
        ("e = 5; 2e + 1e1", "20"),
        ("1 + 2i + 3j", "quat(1, 2, 3, 0)"),
        ("ángulo = 30; ñandú_2 = 2ángulo; ñandú_2", "60"),
        ("norm = 4; norm + norm([3, 4])", "9"),
        ("rank([[1, 2], [2, 4]])", "1"),
        ("rank([[1, 2, 3], [4, 5, 6]])", "2"),
        ("rank(cross_matrix([0.1, 0.2, 0.3]))", "2"),
        ("rank([[0, 0], [0, 0]])", "0"),
        ("rank(translate([1, 2, 3]))", "4"),
        ("eigenvalues([[2, 1], [1, 2]])", "[1, 3]"),
        ("eigenvalues([[2, 1, 1], [1, 2, 1], [1, 1, 2]])", "[1, 1, 4]"),
        ("eigenvalues(linear(rotate_z(90)))", "[1]"),
        ("eigenvalues(translate([1, 2, 3]))", "[1, 1, 1, 1]"),
    ] {
        assert_eq!(line(text), expected, "{text}");
    }
    // A space before a factor may be a comma that is missing.
    for text in ["2 x", "[1 y]", "2 (3)", "x 2", "2deg", "2|x|"] {
        assert!(value(text).is_err(), "{text}");
    }
    // Seven digits make a rotation, four do not.
    let seven = "quat([[0.7071068, -0.7071068, 0], [0.7071068, 0.7071068, 0], [0, 0, 1]])";
    let Ok(Value::Quaternion(q)) = value(seven) else { panic!("{:?}", value(seven)) };
    let half_turn = std::f64::consts::FRAC_PI_8;
    assert!((q.w - half_turn.cos()).abs() < 1e-7 && (q.z - half_turn.sin()).abs() < 1e-7);
    assert!((q.length() - 1.0).abs() < 1e-15);
    assert!(value(&seven.replace("0.7071068", "0.7071")).is_err());
}

#[test]
fn steps_of_eigenvalues_and_ranks_prove_them() {
    let steps = |text: &str| {
        let mut lines = vec![];
        let run = Session::new(&ENGLISH).run(text, |outcome| {
            if let Outcome::Value { steps, .. } = outcome {
                lines.extend(steps.into_iter().flat_map(|step| step.lines));
            }
            Ok::<(), ()>(())
        });
        run.unwrap_or_else(|wrong| panic!("{text}: {wrong:?}")).expect("nothing stops it");
        lines.join("\n")
    };
    let pair = steps("eigenvalues([[0, -1, 0], [1, 0, 0], [0, 0, -2]])");
    for line in [
        "det(λ I - M) = λ³ + 2 λ² + λ + 2 = 0",
        "λ1 = -2",
        "λ2, λ3 = 0 ± 1 i",
        "the result has the real ones",
    ] {
        assert!(pair.contains(line), "{line}: {pair}");
    }
    let two = steps("eigenvalues([[2, 1], [1, 2]])");
    for line in ["λ² - 4 λ + 3 = 0", "symmetric", "= (2 + 2)/2 ± √(((2 - 2)/2)² + 1·1)", "λ2 = 3"] {
        assert!(two.contains(line), "{line}: {two}");
    }
    let rank = steps("rank([[1, 2, 3], [2, 4, 7], [3, 6, 10]])");
    for line in [
        "rows: 1, 2; columns: 1, 3; their determinant is not 0",
        "| 1  3 |",
        "every determinant of 3 rows and 3 columns is 0",
    ] {
        assert!(rank.contains(line), "{line}: {rank}");
    }
    let rounded = steps("rank([[0.1, 0.3], [0.3, 0.9]])");
    assert!(rounded.contains("nearly singular"), "{rounded}");
    let seven = steps("quat([[0.7071068, -0.7071068, 0], [0.7071068, 0.7071068, 0], [0, 0, 1]])");
    assert!(seven.contains("a rotation with rounded entries: RᵀR differs from I by "), "{seven}");
}

#[test]
fn every_synonym_names_a_function_and_is_none_itself() {
    for (function, words) in functions::SYNONYMS {
        assert!(functions::named(function).is_some(), "{function}");
        for word in words {
            assert!(functions::named(word).is_none(), "{word}");
            assert_eq!(functions::find(word).map(|found| found.name), Some(function));
        }
    }
}

#[test]
fn every_function_is_described_and_nothing_else() {
    for texts in [&ENGLISH, &SPANISH] {
        for function in functions::all() {
            assert!(!texts.about(function.name).is_empty(), "{}", function.name);
        }
        let unknown = texts.functions.iter().find(|(name, _)| functions::find(name).is_none());
        assert_eq!(unknown, None);
    }
}
