//! Functions of vectors and frames.

use lumbre::math::{DVec3, Elementary, Frame, exact, orthonormal_basis, quaternion, vector};

use crate::language::filled;

use super::functions::{Call, Function};
use super::lexer::Wrong;
use super::steps::{difference_of_products, factor, sum_of_products};
use super::value::{Matrix, Value, list, number};

pub(super) const FUNCTIONS: &[Function] = &[
    Function::new("dot", &["a, b"], dot),
    Function::new("cross", &["a, b"], cross),
    Function::new("cross_matrix", &["a"], cross_matrix),
    Function::new("mixed", &["a, b, c"], mixed),
    Function::new("length", &["a"], length),
    Function::new("unit", &["a"], unit),
    Function::new("angle", &["a, b"], angle),
    Function::new("project", &["a, b"], project),
    Function::new("projected_length", &["a, b"], projected_length),
    Function::new("reject", &["a, b"], reject),
    Function::new("perpendicular", &["a"], perpendicular),
    Function::new("frame", &["a", "a, b"], frame),
];

/// Two vectors of the same size, as vectors of space, and their size.
fn pair(call: &Call) -> Result<(DVec3, DVec3, usize), Wrong> {
    let (a, size) = call.flat_or_space(0)?;
    let (b, other) = call.flat_or_space(1)?;
    if size != other {
        return Err(call.wrong(1, &filled(call.work.texts.vector_of, &[&size.to_string()])));
    }
    Ok((a, b, size))
}

/// A vector with the same number of components as the arguments.
fn sized(v: DVec3, size: usize) -> Value {
    Value::Vector(v.to_array()[..size].to_vec())
}

fn line(v: DVec3, size: usize) -> String {
    list(&v.to_array()[..size])
}

fn dot(call: &mut Call) -> Result<Value, Wrong> {
    let (a, b, size) = pair(call)?;
    let result = vector::dot(a, b);
    let products = sum_of_products(&a.to_array()[..size], &b.to_array()[..size]);
    call.work.line(if size == 2 { "a·b = ax bx + ay by" } else { "a·b = ax bx + ay by + az bz" });
    call.work.line(format!("= {products} = {}", number(result)));
    let texts = call.work.texts;
    call.work.line(match result {
        r if r > 0.0 => texts.acute,
        r if r < 0.0 => texts.obtuse,
        _ => texts.right_angle,
    });
    Ok(Value::Number(result))
}

fn cross(call: &mut Call) -> Result<Value, Wrong> {
    let (a, b) = (call.vec3(0)?, call.vec3(1)?);
    let result = vector::cross(a, b);
    let component = |p: usize, q: usize| difference_of_products(a[p], b[q], a[q], b[p]);
    call.work.line("a×b = [ay bz - az by, az bx - ax bz, ax by - ay bx]");
    call.work.line(format!("= [{}, {}, {}]", component(1, 2), component(2, 0), component(0, 1)));
    call.work.line(format!("|a×b| = |a| |b| sin θ = {}", number(vector::length(result))));
    Ok(result.into())
}

fn cross_matrix(call: &mut Call) -> Result<Value, Wrong> {
    let result = Matrix::from(vector::cross_matrix(call.vec3(0)?));
    call.work.line("[a]× b = a×b");
    call.work.beside(&["[a]× =".into(), (&result).into()]);
    Ok(Value::Matrix(result))
}

fn mixed(call: &mut Call) -> Result<Value, Wrong> {
    let (a, b, c) = (call.vec3(0)?, call.vec3(1)?, call.vec3(2)?);
    let across = vector::cross(b, c);
    let result = exact::determinant(&[a.to_array(), b.to_array(), c.to_array()]);
    call.work.line(format!("b×c = {}", line(across, 3)));
    let products = sum_of_products(&a.to_array(), &across.to_array());
    call.work.line(format!("a·(b×c) = det[a b c] = {products} = {}", number(result)));
    Ok(Value::Number(result))
}

fn length(call: &mut Call) -> Result<Value, Wrong> {
    let (squares, result) = match call.value(0) {
        Value::Number(x) => {
            let result = x.abs();
            call.work.line(format!("|{}| = {}", number(*x), number(result)));
            return Ok(Value::Number(result));
        }
        Value::Quaternion(q) => (quaternion::to_wxyz(*q).to_vec(), quaternion::length(*q)),
        Value::Vector(v) => {
            let at = |i: usize| v.get(i).copied().unwrap_or(0.0);
            (v.clone(), quaternion::length(quaternion::from_wxyz([at(0), at(1), at(2), at(3)])))
        }
        _ => return Err(call.wrong(0, call.work.texts.measured)),
    };
    let sum: Vec<String> = squares.iter().map(|x| format!("{}²", factor(*x))).collect();
    call.work.line(format!("|a| = √({}) = {}", sum.join(" + "), number(result)));
    Ok(Value::Number(result))
}

fn unit(call: &mut Call) -> Result<Value, Wrong> {
    if let Value::Quaternion(_) = call.value(0) {
        let q = call.rotation(0)?;
        let Some(result) = quaternion::unit(q) else { return Err(call.wrong(0, call.work.texts.not_zero)) };
        call.work.line(format!("q/|q|,  |q| = {}", number(quaternion::length(q))));
        return Ok(Value::Quaternion(result));
    }
    let (a, size) = call.flat_or_space(0)?;
    let Some(result) = vector::unit(a) else { return Err(call.wrong(0, call.work.texts.not_zero)) };
    call.work.line(format!(
        "a/|a| = {} / {} = {}",
        line(a, size),
        number(vector::length(a)),
        line(result, size)
    ));
    Ok(sized(result, size))
}

fn angle(call: &mut Call) -> Result<Value, Wrong> {
    let (a, b, _) = pair(call)?;
    for (i, v) in [a, b].into_iter().enumerate() {
        if v == DVec3::ZERO {
            return Err(call.wrong(i, call.work.texts.not_zero));
        }
    }
    let (sine, cosine) = (vector::length(vector::cross(a, b)), vector::dot(a, b));
    let radians = vector::angle(a, b);
    let degrees = radians.to_degrees();
    if are_ordinary(&[sine.hypotenuse(cosine)]) {
        call.work.line(format!(
            "|a×b| = |a| |b| sin θ = {},  a·b = |a| |b| cos θ = {}",
            number(sine),
            number(cosine)
        ));
        call.work.line(format!("θ = atan2(|a×b|, a·b) = {} rad = {}°", number(radians), number(degrees)));
    } else if let (Some(a), Some(b)) = (vector::unit(a), vector::unit(b)) {
        // The products of the vectors as they are have no place among doubles.
        let (sine, cosine) = (vector::length(vector::cross(a, b)), vector::dot(a, b));
        call.work.line(format!("a' = a/|a| = {},  b' = b/|b| = {}", line(a, 3), line(b, 3)));
        call.work.line(format!("|a'×b'| = sin θ = {},  a'·b' = cos θ = {}", number(sine), number(cosine)));
        call.work.line(format!("θ = atan2(|a'×b'|, a'·b') = {} rad = {}°", number(radians), number(degrees)));
    }
    Ok(Value::Number(degrees))
}

fn project(call: &mut Call) -> Result<Value, Wrong> {
    let (a, b, size) = along(call)?;
    let result = vector::project(a, b);
    let (dot, square) = (vector::dot(a, b), a.length_squared());
    if are_ordinary(&[dot, square]) || dot == 0.0 && are_ordinary(&[square]) {
        call.work.line("(a·b / |a|²) a");
        let (dot, square) = (number(dot), number(square));
        call.work.line(format!("= ({dot} / {square}) {} = {}", line(a, size), line(result, size)));
    } else if let Some(unit) = vector::unit(a) {
        call.work.line("(a'·b) a',  a' = a/|a|");
        let along = number(vector::projected_length(a, b));
        call.work.line(format!("= {along} {} = {}", line(unit, size), line(result, size)));
    }
    Ok(sized(result, size))
}

/// Whether these products have all their digits: none is beyond the doubles, or near their least.
fn are_ordinary(products: &[f64]) -> bool {
    products.iter().all(|product| (1e-280..1e280).contains(&product.abs()))
}

/// As [`pair`], with the first one not zero.
fn along(call: &Call) -> Result<(DVec3, DVec3, usize), Wrong> {
    let both = pair(call)?;
    if both.0 == DVec3::ZERO { Err(call.wrong(0, call.work.texts.not_zero)) } else { Ok(both) }
}

fn projected_length(call: &mut Call) -> Result<Value, Wrong> {
    let (a, b, _) = along(call)?;
    let result = vector::projected_length(a, b);
    let (dot, length) = (vector::dot(a, b), vector::length(a));
    if are_ordinary(&[dot]) || dot == 0.0 && result == 0.0 {
        call.work.line(format!("a·b / |a| = {} / {} = {}", number(dot), number(length), number(result)));
    } else if let Some(unit) = vector::unit(a) {
        call.work.line(format!("a'·b = {},  a' = a/|a| = {}", number(result), line(unit, 3)));
    }
    call.work.line(call.work.texts.signed_length);
    Ok(Value::Number(result))
}

fn reject(call: &mut Call) -> Result<Value, Wrong> {
    let (a, b, size) = along(call)?;
    let (parallel, result) = (vector::project(a, b), vector::reject(a, b));
    call.work.line("b - (a·b / |a|²) a = a×(b×a) / |a|²");
    call.work.line(format!("= {} - {} = {}", line(b, size), line(parallel, size), line(result, size)));
    Ok(sized(result, size))
}

fn perpendicular(call: &mut Call) -> Result<Value, Wrong> {
    let a = call.direction(0)?;
    let result = vector::perpendicular(a);
    call.work.line(call.work.texts.smallest_component);
    let products = sum_of_products(&a.to_array(), &result.to_array());
    call.work.line(format!("{}:  a·p = {products} = {}", line(result, 3), number(vector::dot(a, result))));
    Ok(result.into())
}

fn frame(call: &mut Call) -> Result<Value, Wrong> {
    let a = call.direction(0)?;
    let Some(w) = vector::unit(a) else { return Err(call.wrong(0, call.work.texts.not_zero)) };
    call.work.line(format!("w = a/|a| = {}", line(w, 3)));
    let frame = if call.count() == 1 {
        let (x, y) = orthonormal_basis(w);
        call.work.line(call.work.texts.one_direction);
        call.work.line(format!("u = {},  v = {}", line(x, 3), line(y, 3)));
        Frame::from_z(w)
    } else {
        let b = call.direction(1)?;
        let Some(frame) = Frame::from_two(a, b) else {
            return Err(call.wrong(1, call.work.texts.not_parallel));
        };
        call.work.line(format!("b×w = {}", line(b.cross(w), 3)));
        call.work.line(format!("u = (b×w)/|b×w| = {}", line(frame.x, 3)));
        call.work.line(format!("v = w×u = {}", line(frame.y, 3)));
        frame
    };
    call.work.line(call.work.texts.frame_rows);
    Ok(Value::Matrix(frame.matrix().transpose().into()))
}
