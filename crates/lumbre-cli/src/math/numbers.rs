//! Functions of numbers. Angles are in degrees.

use lumbre::math::Elementary;
use lumbre::math::transform::sin_cos_degrees;

use super::functions::{Call, Function};
use super::lexer::Wrong;
use super::value::Value;

pub(super) const FUNCTIONS: &[Function] = &[
    Function::new("sqrt", &["x"], |call| of_one(call, f64::sqrt)),
    Function::new("sin", &["degrees"], |call| of_one(call, |x| sin_cos_degrees(x).0)),
    Function::new("cos", &["degrees"], |call| of_one(call, |x| sin_cos_degrees(x).1)),
    Function::new("tan", &["degrees"], |call| {
        of_one(call, |x| {
            let (sin, cos) = sin_cos_degrees(x);
            sin / cos
        })
    }),
    Function::new("asin", &["x"], |call| of_one(call, |x| x.arc_sine().to_degrees())),
    Function::new("acos", &["x"], |call| of_one(call, |x| x.arc_cosine().to_degrees())),
    Function::new("atan2", &["y, x"], |call| {
        let [y, x] = call.numbers(0)?;
        Ok(Value::Number(y.angle_from(x).to_degrees()))
    }),
    Function::new("radians", &["degrees"], |call| of_one(call, f64::to_radians)),
    Function::new("degrees", &["radians"], |call| of_one(call, f64::to_degrees)),
];

fn of_one(call: &mut Call, f: impl Fn(f64) -> f64) -> Result<Value, Wrong> {
    Ok(Value::Number(f(call.number(0)?)))
}
