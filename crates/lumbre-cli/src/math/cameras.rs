//! Functions of cameras: look-at of both hands, projections, and rays.

use lumbre::math::view::{Handedness, View};
use lumbre::math::{DVec3, projection, vector};

use crate::language::filled;

use super::functions::{Call, Function};
use super::lexer::Wrong;
use super::value::{Matrix, Value, list, number};

pub(super) const FUNCTIONS: &[Function] = &[
    Function::new("look_at", &["eye, target, up"], |call| look_at(call, Handedness::Right)),
    Function::new("look_at_left", &["eye, target, up"], |call| look_at(call, Handedness::Left)),
    Function::new("ortho", &["left, right, bottom, top, near, far"], ortho),
    Function::new("perspective", &["fovy, aspect, near, far"], perspective),
    Function::new("simple_perspective", &["d"], simple_perspective),
    Function::new("clip", &["M, p"], clip),
    Function::new("camera_ray", &["eye, target, up, fovy, size, pixel"], camera_ray),
];

fn text(v: DVec3) -> String {
    list(&v.to_array())
}

fn view(call: &Call, handedness: Handedness) -> Result<View, Wrong> {
    let (eye, target, up) = (call.vec3(0)?, call.vec3(1)?, call.vec3(2)?);
    let texts = call.work.texts;
    View::look_at(eye, target, up, handedness).ok_or_else(|| {
        if eye == target { call.wrong(1, texts.away_from_eye) } else { call.wrong(2, texts.not_along_view) }
    })
}

fn look_at(call: &mut Call, handedness: Handedness) -> Result<Value, Wrong> {
    let view = view(call, handedness)?;
    let map = view.camera_from_world();
    let (w, along) = match handedness {
        Handedness::Right => ("w = (eye - target)/|eye - target|", call.work.texts.looks_along_minus_z),
        Handedness::Left => ("w = (target - eye)/|target - eye|", call.work.texts.looks_along_z),
    };
    let frame = view.frame;
    call.work.line(along);
    call.work.line(format!("{w} = {}", text(frame.z)));
    call.work.line(format!("u = (up×w)/|up×w| = {}", text(frame.x)));
    call.work.line(format!("v = w×u = {}", text(frame.y)));
    call.work.line(call.work.texts.eye_to_origin);
    call.work.beside(&["V = R T(-eye) =".into(), (&Matrix::from(&map)).into()]);
    Ok(map.into())
}

fn ortho(call: &mut Call) -> Result<Value, Wrong> {
    let [left, right, bottom, top, near, far] = call.numbers(0)?;
    let Some(m) = projection::orthographic(left, right, bottom, top, near, far) else {
        let coinciding = if left == right {
            1
        } else if bottom == top {
            3
        } else {
            5
        };
        return Err(call.wrong(coinciding, call.work.texts.another_side));
    };
    call.work.line("| 2/(r-l)  0        0         -(r+l)/(r-l) |");
    call.work.line("| 0        2/(t-b)  0         -(t+b)/(t-b) |");
    call.work.line("| 0        0        -2/(f-n)  -(f+n)/(f-n) |");
    call.work.line("| 0        0        0          1           |");
    call.work.line(call.work.texts.box_to_cube);
    Ok(Value::Matrix(m.into()))
}

fn perspective(call: &mut Call) -> Result<Value, Wrong> {
    let [fovy, aspect, near, far] = call.numbers(0)?;
    let texts = call.work.texts;
    let Some(m) = projection::perspective(fovy, aspect, near, far) else {
        return Err(match () {
            () if !(0.0 < fovy && fovy < 180.0) => call.wrong(0, texts.opening),
            () if aspect <= 0.0 => call.wrong(1, texts.above_0),
            () if near <= 0.0 => call.wrong(2, texts.above_0),
            () => call.wrong(3, texts.beyond_near),
        });
    };
    let k = m.col(1)[1];
    call.work.line(format!("k = cot(fovy/2) = {}", number(k)));
    call.work.line("| k/aspect  0   0            0          |");
    call.work.line("| 0         k   0            0          |");
    call.work.line("| 0         0   (f+n)/(n-f)  2fn/(n-f)  |");
    call.work.line("| 0         0  -1            0          |");
    call.work.line(texts.depth_range);
    Ok(Value::Matrix(m.into()))
}

fn simple_perspective(call: &mut Call) -> Result<Value, Wrong> {
    let m = projection::simple_perspective(call.number(0)?);
    let m = m.ok_or_else(|| call.wrong(0, call.work.texts.not_zero))?;
    call.work.line("(x, y, z) → (-d x/z, -d y/z, -d)");
    call.work.line(call.work.texts.depth_is_lost);
    Ok(Value::Matrix(m.into()))
}

fn clip(call: &mut Call) -> Result<Value, Wrong> {
    let (m, p) = (call.matrix(0)?, call.vec3(1)?);
    if !m.is_square(4) {
        return Err(call.wrong(0, &filled(call.work.texts.matrix_of, &["4", "4"])));
    }
    let image = projection::clip_coordinates(&m.mat4(), p).to_array();
    let column = Matrix::column(&[p.x, p.y, p.z, 1.0]);
    call.work.beside(&[(&m).into(), (&column).into(), "=".into(), (&Matrix::column(&image)).into()]);
    Ok(Value::Vector(image.to_vec()))
}

fn camera_ray(call: &mut Call) -> Result<Value, Wrong> {
    let view = view(call, Handedness::Right)?;
    let (fovy, size, pixel) = (call.number(3)?, call.vec2(4)?, call.vec2(5)?);
    let texts = call.work.texts;
    if !(0.0 < fovy && fovy < 180.0) {
        return Err(call.wrong(3, texts.opening));
    }
    if size.min_element() <= 0.0 {
        return Err(call.wrong(4, texts.above_0));
    }
    let direction = view.perspective_direction(fovy, size, pixel + 0.5);
    let unit = vector::unit(direction).ok_or_else(|| call.wrong(5, texts.finite))?;
    call.work.line(
        "d = f + sx u + sy v,  sx = (2(px+½)/w - 1) tan(fovy/2) w/h,  sy = (1 - 2(py+½)/h) tan(fovy/2)",
    );
    call.work.line(format!("f = {}", text(view.forward())));
    call.work.line(format!("u = {},  v = {}", text(view.frame.x), text(view.frame.y)));
    let (sx, sy) = (direction.dot(view.frame.x), direction.dot(view.frame.y));
    call.work.line(format!("sx = {},  sy = {}", number(sx), number(sy)));
    call.work.line(format!("d = {},  |d| = {}", text(direction), number(vector::length(direction))));
    Ok(unit.into())
}
