//! Functions of numbers. Angles are in degrees.

use lumbre::math::Elementary;
use lumbre::math::transform::sin_cos_degrees;

use super::functions::{Call, Function};
use super::lexer::Wrong;
use super::value::Value;

pub(super) const FUNCTIONS: &[Function] = &[
    Function::new("sqrt", &["x"], sqrt),
    Function::new("sin", &["degrees"], |call| of_one(call, |x| sin_cos_degrees(x).0)),
    Function::new("cos", &["degrees"], |call| of_one(call, |x| sin_cos_degrees(x).1)),
    Function::new("tan", &["degrees"], tan),
    Function::new("asin", &["x"], |call| of_sine(call, Elementary::arc_sine)),
    Function::new("acos", &["x"], |call| of_sine(call, Elementary::arc_cosine)),
    Function::new("atan2", &["y, x"], atan2),
    Function::new("radians", &["degrees"], |call| of_one(call, f64::to_radians)),
    Function::new("degrees", &["radians"], |call| of_one(call, f64::to_degrees)),
];

fn of_one(call: &mut Call, f: impl Fn(f64) -> f64) -> Result<Value, Wrong> {
    Ok(Value::Number(f(call.number(0)?)))
}

fn sqrt(call: &mut Call) -> Result<Value, Wrong> {
    let x = call.number(0)?;
    if x < 0.0 { Err(call.wrong(0, call.work.texts.not_negative)) } else { Ok(Value::Number(x.sqrt())) }
}

fn tan(call: &mut Call) -> Result<Value, Wrong> {
    let (sin, cos) = sin_cos_degrees(call.number(0)?);
    if cos == 0.0 { Err(call.wrong(0, call.work.texts.has_tangent)) } else { Ok(Value::Number(sin / cos)) }
}

/// The angle of a sine or cosine.
fn of_sine(call: &mut Call, f: impl Fn(f64) -> f64) -> Result<Value, Wrong> {
    let x = call.number(0)?;
    if x.abs() > 1.0 {
        return Err(call.wrong(0, call.work.texts.from_minus_1_to_1));
    }
    Ok(Value::Number(f(x).to_degrees()))
}

fn atan2(call: &mut Call) -> Result<Value, Wrong> {
    let [y, x] = call.numbers(0)?;
    // The origin is in no direction.
    if y == 0.0 && x == 0.0 {
        return Err(call.wrong(1, call.work.texts.not_zero));
    }
    Ok(Value::Number(y.angle_from(x).to_degrees()))
}
