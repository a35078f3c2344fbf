//! Functions of quaternions and Euler angles.

use lumbre::math::quaternion::{self, Euler};
use lumbre::math::{DQuat, Elementary, vector};

use crate::language::filled;

use super::functions::{Call, Function};
use super::lexer::Wrong;
use super::steps::{Work, factor};
use super::value::{Value, number};

pub(super) const FUNCTIONS: &[Function] = &[
    Function::new("quat", &["w, x, y, z", "w, v", "R"], quat),
    Function::new("quat_about", &["axis, degrees"], quat_about),
    Function::new("conjugate", &["q"], conjugate),
    Function::new("slerp", &["p, q, s"], slerp),
    Function::new("euler", &["heading, attitude, bank", "angles"], euler),
    Function::new("angles", &["q"], angles),
];

/// By how much an entry of `Rᵀ R` may differ from that of the unit matrix: entries of seven digits make a rotation.
const ROTATION_SLACK: f64 = 1e-6;
/// From where on that is said, and the quaternion is given length 1.
const ROUNDED_ROTATION: f64 = 1e-9;

/// The product, part by part.
pub(super) fn product(p: DQuat, q: DQuat, work: &mut Work) -> DQuat {
    let result = p * q;
    work.begin("p q");
    show_product(p, q, result, work);
    result
}

/// The parts of a product.
pub(super) fn show_product(p: DQuat, q: DQuat, result: DQuat, work: &mut Work) {
    let ([a1, b1, c1, d1], [a2, b2, c2, d2]) = (quaternion::to_wxyz(p), quaternion::to_wxyz(q));
    let [a, b, c, d] = quaternion::to_wxyz(result);
    let line = |name: &str, formula: &str, terms: [(&str, f64, f64); 4], part: f64| {
        let written = terms.map(|(sign, x, y)| format!("{sign}{}·{}", factor(x), factor(y)));
        format!("{name}  {formula} = {} = {}", written.concat(), number(part))
    };
    let (p, m) = (" + ", " - ");
    work.line(line(
        "1:",
        "a1a2 - b1b2 - c1c2 - d1d2",
        [("", a1, a2), (m, b1, b2), (m, c1, c2), (m, d1, d2)],
        a,
    ));
    work.line(line(
        "i:",
        "a1b2 + b1a2 + c1d2 - d1c2",
        [("", a1, b2), (p, b1, a2), (p, c1, d2), (m, d1, c2)],
        b,
    ));
    work.line(line(
        "j:",
        "a1c2 - b1d2 + c1a2 + d1b2",
        [("", a1, c2), (m, b1, d2), (p, c1, a2), (p, d1, b2)],
        c,
    ));
    work.line(line(
        "k:",
        "a1d2 + b1c2 - c1b2 + d1a2",
        [("", a1, d2), (p, b1, c2), (m, c1, b2), (p, d1, a2)],
        d,
    ));
}

fn quat(call: &mut Call) -> Result<Value, Wrong> {
    let q = match call.count() {
        4 => quaternion::from_wxyz(call.numbers(0)?),
        2 => {
            let (w, v) = (call.number(0)?, call.vec3(1)?);
            quaternion::from_wxyz([w, v.x, v.y, v.z])
        }
        _ => {
            let linear = call.transform(0)?.linear();
            let rest = (linear.transpose() * linear - lumbre::math::DMat3::IDENTITY).to_cols_array();
            let away = rest.iter().fold(0.0_f64, |most, entry| most.max(entry.abs()));
            let texts = call.work.texts;
            if linear.determinant() <= 0.0 || away > ROTATION_SLACK {
                return Err(call.wrong(0, texts.rotation_matrix));
            }
            call.work.line(texts.largest_part);
            let q = quaternion::from_matrix(&linear);
            if away > ROUNDED_ROTATION {
                let away: f64 = format!("{away:.1e}").parse().unwrap_or(away);
                call.work.line(filled(texts.nearly_rotation, &[&number(away)]));
            }
            quaternion::unit(q).filter(|_| away > ROUNDED_ROTATION).unwrap_or(q)
        }
    };
    let [w, x, y, z] = quaternion::to_wxyz(q).map(factor);
    call.work.line(format!("q = {w} + {x} i + {y} j + {z} k"));
    Ok(Value::Quaternion(q))
}

fn quat_about(call: &mut Call) -> Result<Value, Wrong> {
    let (axis, degrees) = (call.direction(0)?, call.number(1)?);
    let Some((a, q)) = vector::unit(axis).zip(quaternion::from_axis_angle(axis, degrees)) else {
        return Err(call.wrong(1, call.work.texts.finite));
    };
    call.work.line("q = (cos θ/2, a sin θ/2)");
    let half = number(0.5 * degrees);
    call.work.line(format!("a = {},  θ/2 = {half}°", super::value::list(&a.to_array())));
    Ok(Value::Quaternion(q))
}

fn conjugate(call: &mut Call) -> Result<Value, Wrong> {
    let q = call.quaternion(0)?;
    call.work.line("conj q = a - b i - c j - d k");
    Ok(Value::Quaternion(q.conjugate()))
}

fn slerp(call: &mut Call) -> Result<Value, Wrong> {
    let (p, q, s) = (call.rotation(0)?, call.rotation(1)?, call.number(2)?);
    let Some(result) = quaternion::slerp(p, q, s) else {
        return Err(call.wrong(2, call.work.texts.finite));
    };
    let Some((p, mut q)) = quaternion::unit(p).zip(quaternion::unit(q)) else {
        return Err(call.wrong(0, call.work.texts.not_zero));
    };
    let line = |q: DQuat| Value::Quaternion(q).line();
    call.work.line("(sin((1-s)θ) p + sin(sθ) q) / sin θ,  |p| = |q| = 1,  cos θ = p·q");
    call.work.line(format!("p = {},  q = {}", line(p), line(q)));
    if p.dot(q) < 0.0 {
        call.work.line(call.work.texts.shorter_way);
        q = -q;
    }
    let angle = 2.0 * (p - q).length().angle_from((p + q).length());
    call.work.line(format!("p·q = {},  θ = {}°", number(p.dot(q)), number(angle.to_degrees())));
    if angle > 0.0 {
        let [from, to] = [1.0 - s, s].map(|share| number((share * angle).sine() / angle.sine()));
        call.work.line(format!("= {from} p + {} q", factor_of(&to)));
    }
    Ok(Value::Quaternion(result))
}

/// A number that is written already, in parentheses where it has a sign.
fn factor_of(written: &str) -> String {
    if written.starts_with('-') { format!("({written})") } else { written.to_owned() }
}

fn euler(call: &mut Call) -> Result<Value, Wrong> {
    let [heading, attitude, bank] =
        if call.count() == 1 { call.vec3(0)?.to_array() } else { call.numbers(0)? };
    let q = Euler { heading, attitude, bank }.to_quaternion();
    let texts = call.work.texts;
    call.work.line(format!("R = Ry({}) Rz({}) Rx({})", texts.heading, texts.attitude, texts.bank));
    call.work.line("a = c1c2c3 - s1s2s3,  b = s1s2c3 + c1c2s3,  c = s1c2c3 + c1s2s3,  d = c1s2c3 - s1c2s3");
    for (i, angle) in [heading, attitude, bank].into_iter().enumerate() {
        let (sin, cos) = lumbre::math::transform::sin_cos_degrees(0.5 * angle);
        let n = i + 1;
        let half = number(0.5 * angle);
        call.work.line(format!(
            "c{n} = cos {half}° = {},  s{n} = sin {half}° = {}",
            number(cos),
            number(sin)
        ));
    }
    Ok(Value::Quaternion(q))
}

fn angles(call: &mut Call) -> Result<Value, Wrong> {
    let q = call.rotation(0)?;
    let Euler { heading, attitude, bank } = Euler::from_quaternion(q);
    let [a, b, c, d] = quaternion::to_wxyz(q);
    let texts = call.work.texts;
    let names = [texts.heading, texts.attitude, texts.bank];
    let [of_heading, of_attitude, of_bank] = names;
    call.work.line(format!("S = |(a+d, b+c)|,  M = |(a-d, c-b)|,  {of_attitude} = 2 atan2(S, M) - 90°"));
    let pair = |x: f64, y: f64| format!("({}, {})", number(x), number(y));
    call.work.line(format!("(a+d, b+c) = {},  (a-d, c-b) = {}", pair(a + d, b + c), pair(a - d, c - b)));
    let (sum, difference) = ((a + d).hypotenuse(b + c), (a - d).hypotenuse(c - b));
    call.work.line(match () {
        () if difference <= 1e-15 * sum => texts.north.to_owned(),
        () if sum <= 1e-15 * difference => texts.south.to_owned(),
        () => format!("σ = atan2(b+c, a+d),  δ = atan2(c-b, a-d),  {of_heading} = σ + δ,  {of_bank} = σ - δ"),
    });
    let told =
        names.iter().zip([heading, attitude, bank]).map(|(name, x)| format!("{name} = {}°", number(x)));
    call.work.line(told.collect::<Vec<_>>().join(",  "));
    Ok(Value::Vector(vec![heading, attitude, bank]))
}
