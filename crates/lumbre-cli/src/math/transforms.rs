//! Functions that make, join and apply transforms.

use lumbre::math::glam::DMat2;
use lumbre::math::transform::sin_cos_degrees;
use lumbre::math::{DVec3, Transform, matrix, optics, quaternion, vector};

use super::functions::{Call, Function};
use super::lexer::Wrong;
use super::steps::Work;
use super::value::{Matrix, Value, list, number};

pub(super) const FUNCTIONS: &[Function] = &[
    Function::new("translate", &["v"], translate),
    Function::new("scale", &["v"], scale),
    Function::new("shear", &["xy, yx", "xy, xz, yx, yz, zx, zy"], shear),
    Function::new("rotate", &["degrees", "axis, degrees", "q, v", "axis, degrees, v"], rotate),
    Function::new("rotate_x", &["degrees"], |call| about(call, DVec3::X)),
    Function::new("rotate_y", &["degrees"], |call| about(call, DVec3::Y)),
    Function::new("rotate_z", &["degrees"], |call| about(call, DVec3::Z)),
    Function::new("mirror", &["n"], mirror),
    Function::new("chain", &["scale, degrees, offset"], chain),
    Function::new("row_chain", &["scale, degrees, offset"], row_chain),
    Function::new("orders", &["A, B"], orders),
    Function::new("direction", &["T, v"], direction),
    Function::new("normal", &["T, n"], normal),
    Function::new("other_hand", &["T"], other_hand),
];

fn shown(name: &str, map: &Transform, work: &mut Work) {
    work.beside(&[name.into(), (&Matrix::from(map)).into()]);
}

fn translate(call: &mut Call) -> Result<Value, Wrong> {
    let map = Transform::translate(call.vec3(0)?);
    call.work.line(call.work.texts.moves_points);
    shown("T =", &map, call.work);
    Ok(map.into())
}

fn scale(call: &mut Call) -> Result<Value, Wrong> {
    if let Value::Vector(v) = call.value(0)
        && v.len() == 2
    {
        let result = Matrix::from(matrix::scale2(call.vec2(0)?));
        call.work.beside(&["S =".into(), (&result).into()]);
        return Ok(Value::Matrix(result));
    }
    if let Value::Vector(v) = call.value(0)
        && v.len() != 3
    {
        return Err(call.wrong(0, call.work.texts.vector_2_or_3));
    }
    let map = Transform::scale(call.vec3(0)?).map_err(|_| call.wrong(0, call.work.texts.factors_not_zero))?;
    call.work.beside(&[
        "S =".into(),
        (&Matrix::from(&map)).into(),
        "  S⁻¹ =".into(),
        (&Matrix::from(&map.inverse())).into(),
    ]);
    Ok(map.into())
}

fn shear(call: &mut Call) -> Result<Value, Wrong> {
    if call.count() == 2 {
        let [xy, yx] = call.numbers(0)?;
        let result = Matrix::from(matrix::shear2(xy, yx));
        call.work.line("x' = x + xy·y,  y' = y + yx·x");
        call.work.beside(&["H =".into(), (&result).into()]);
        return Ok(Value::Matrix(result));
    }
    let [xy, xz, yx, yz, zx, zy] = call.numbers(0)?;
    let map = Transform::shear(xy, xz, yx, yz, zx, zy)
        .map_err(|_| call.wrong(0, call.work.texts.affine_invertible))?;
    call.work.line("x' = x + xy·y + xz·z,  y' = y + yx·x + yz·z,  z' = z + zx·x + zy·y");
    shown("H =", &map, call.work);
    Ok(map.into())
}

fn cosine_and_sine(degrees: f64, work: &mut Work) {
    let (sin, cos) = sin_cos_degrees(degrees);
    work.line(format!("θ = {}°:  cos θ = {},  sin θ = {}", number(degrees), number(cos), number(sin)));
}

fn rotate(call: &mut Call) -> Result<Value, Wrong> {
    match (call.count(), call.value(0)) {
        (1, _) => {
            let degrees = call.number(0)?;
            let result = Matrix::from(matrix::rotation2(degrees));
            cosine_and_sine(degrees, call.work);
            call.work.line("R = [[cos θ, -sin θ], [sin θ, cos θ]]");
            call.work.beside(&["R =".into(), (&result).into()]);
            Ok(Value::Matrix(result))
        }
        (2, Value::Quaternion(_)) => {
            let (q, v) = (call.rotation(0)?, call.vec3(1)?);
            call.work.steps.pop();
            call.work.begin("rotate(q, v)");
            rotate_by(q, v, call.work)
        }
        (2, _) => {
            let axis = call.direction(0)?;
            about(call, axis)
        }
        _ => {
            let (axis, degrees, v) = (call.direction(0)?, call.number(1)?, call.vec3(2)?);
            let turned = matrix::rotate_vector(axis, degrees, v);
            let Some((a, turned)) = vector::unit(axis).zip(turned) else {
                return Err(call.wrong(1, call.work.texts.finite));
            };
            let along = vector::project(a, v);
            call.work.line("v' = v∥ + cos θ v⊥ + sin θ a×v,  v∥ = (a·v) a,  v⊥ = v - v∥");
            cosine_and_sine(degrees, call.work);
            let text = |v: DVec3| list(&v.to_array());
            let (rest, across) = (text(v - along), text(a.cross(v)));
            call.work.line(format!("a = {},  v∥ = {},  v⊥ = {rest},  a×v = {across}", text(a), text(along)));
            Ok(turned.into())
        }
    }
}

/// `q v q⁻¹`, in two products.
fn rotate_by(q: lumbre::math::DQuat, v: DVec3, work: &mut Work) -> Result<Value, Wrong> {
    let result = quaternion::rotate(q, v);
    let [line, pure] = [q, quaternion::from_wxyz([0.0, v.x, v.y, v.z])].map(|q| Value::Quaternion(q).line());
    work.line("v' = q (0, v) q⁻¹");
    work.line(format!("q = {line},  (0, v) = {pure}"));
    if let Some(inverse) = quaternion::inverse(q) {
        let half = q * quaternion::from_wxyz([0.0, v.x, v.y, v.z]);
        let [half, inverse] = [half, inverse].map(|q| Value::Quaternion(q).line());
        work.line(format!("q (0, v) = {half},  q⁻¹ = {inverse}"));
    }
    Ok(result.into())
}

/// The rotation about an axis by the last argument, an angle.
fn about(call: &mut Call, axis: DVec3) -> Result<Value, Wrong> {
    let last = call.count() - 1;
    let degrees = call.number(last)?;
    let map = Transform::rotate(axis, degrees).map_err(|_| call.wrong(last, call.work.texts.finite))?;
    call.work.line("R = cos θ I + (1 - cos θ) a aᵀ + sin θ [a]×");
    if let Some(a) = vector::unit(axis) {
        call.work.line(format!("a = {}", list(&a.to_array())));
    }
    cosine_and_sine(degrees, call.work);
    shown("R =", &map, call.work);
    Ok(map.into())
}

fn mirror(call: &mut Call) -> Result<Value, Wrong> {
    let (n, size) = call.flat_or_space(0)?;
    let Some(n) = vector::unit(n) else { return Err(call.wrong(0, call.work.texts.not_zero)) };
    call.work.line("M = I - 2 n nᵀ / |n|²");
    let images = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| optics::reflect(axis, n));
    if size == 2 {
        let result = Matrix::from(DMat2::from_cols(images[0].truncate(), images[1].truncate()));
        call.work.beside(&["M =".into(), (&result).into()]);
        return Ok(Value::Matrix(result));
    }
    let linear = lumbre::math::DMat3::from_cols(images[0], images[1], images[2]);
    let map = Transform::from_matrix(lumbre::math::DMat4::from_mat3(linear))
        .map_err(|_| call.wrong(0, call.work.texts.not_zero))?;
    shown("M =", &map, call.work);
    Ok(map.into())
}

/// The elementary maps of a chain, the first to act first.
fn links(call: &Call, degrees: DVec3) -> Result<[(&'static str, Transform); 5], Wrong> {
    let (factors, offset) = (call.vec3(0)?, call.vec3(2)?);
    let turn = |axis: DVec3, angle: f64| {
        Transform::rotate(axis, angle).map_err(|_| call.wrong(1, call.work.texts.finite))
    };
    Ok([
        ("S =", Transform::scale(factors).map_err(|_| call.wrong(0, call.work.texts.factors_not_zero))?),
        ("Rx =", turn(DVec3::X, degrees.x)?),
        ("Ry =", turn(DVec3::Y, degrees.y)?),
        ("Rz =", turn(DVec3::Z, degrees.z)?),
        ("T =", Transform::translate(offset)),
    ])
}

fn chain(call: &mut Call) -> Result<Value, Wrong> {
    let links = links(call, call.vec3(1)?)?;
    let whole = links.iter().fold(Transform::IDENTITY, |inner, (_, outer)| *outer * inner);
    call.work.line("M = T Rz Ry Rx S");
    for (name, link) in &links {
        shown(name, link, call.work);
    }
    shown("M =", &whole, call.work);
    Ok(whole.into())
}

fn row_chain(call: &mut Call) -> Result<Value, Wrong> {
    let degrees = call.vec3(1)?;
    links(call, -degrees)?;
    let row = matrix::row_chain_with_column_rotations(call.vec3(0)?, degrees, call.vec3(2)?);
    let column = matrix::from_row_convention(row);
    call.work.line("M = S Rx Ry Rz T,  p' = p M");
    call.work.line(call.work.texts.rows_turn_back);
    call.work.beside(&[
        "M =".into(),
        (&Matrix::from(row)).into(),
        "  Mᵀ =".into(),
        (&Matrix::from(column)).into(),
    ]);
    Ok(Value::Matrix(row.into()))
}

fn orders(call: &mut Call) -> Result<Value, Wrong> {
    let (a, b) = (call.transform(0)?, call.transform(1)?);
    let (ab, ba) = (a * b, b * a);
    let [m, n] = [&ab, &ba].map(Matrix::from);
    call.work.line(call.work.texts.b_first);
    call.work.beside(&["A B =".into(), (&m).into(), "  B A =".into(), (&n).into()]);
    let most = m.entries().zip(n.entries()).fold(0.0, |most: f64, (p, q)| most.max((p - q).abs()));
    call.work.line(format!("max |A B - B A| = {}", number(most)));
    let of_product =
        Transform::from_affine(*ab.affine()).map_err(|_| call.wrong(0, call.work.texts.affine_invertible))?;
    let [direct, reversed] = [of_product.inverse(), b.inverse() * a.inverse()].map(|map| Matrix::from(&map));
    call.work.line("(A B)⁻¹ = B⁻¹ A⁻¹");
    call.work.beside(&["(A B)⁻¹ =".into(), (&direct).into(), "  B⁻¹ A⁻¹ =".into(), (&reversed).into()]);
    Ok(ab.into())
}

fn direction(call: &mut Call) -> Result<Value, Wrong> {
    let (map, v) = (call.transform(0)?, call.vec3(1)?);
    let image = map.vector(v);
    call.work.line(call.work.texts.direction_has_w_0);
    call.work.beside(&[
        (&Matrix::from(&map)).into(),
        (&Matrix::column(&[v.x, v.y, v.z, 0.0])).into(),
        "=".into(),
        (&Matrix::column(&[image.x, image.y, image.z, 0.0])).into(),
    ]);
    Ok(image.into())
}

fn normal(call: &mut Call) -> Result<Value, Wrong> {
    let (map, n) = (call.transform(0)?, call.direction(1)?);
    let inverse_transpose = Matrix::from(map.inverse().linear().transpose());
    let image = map.normal(n);
    call.work.line("n' = L⁻ᵀ n / |L⁻ᵀ n|");
    call.work.beside(&[
        "L⁻ᵀ n =".into(),
        (&inverse_transpose).into(),
        (&Matrix::column(&n.to_array())).into(),
        "=".into(),
        (&Matrix::column(&image.to_array())).into(),
    ]);
    let unit = matrix::transform_normal(&map.linear(), n);
    unit.map(Value::from).ok_or_else(|| call.wrong(1, call.work.texts.not_zero))
}

fn other_hand(call: &mut Call) -> Result<Value, Wrong> {
    call.work.line("Σ = diag(1, 1, -1)");
    if let Value::Vector(_) = call.value(0) {
        call.work.line("p' = Σ p");
        return Ok((matrix::mirror_z() * call.vec3(0)?).into());
    }
    let map = call.transform(0)?;
    let result = map.change_handedness();
    call.work.line("M' = Σ M Σ");
    let [m, n] = [&map, &result].map(Matrix::from);
    call.work.beside(&["M =".into(), (&m).into(), "  Σ M Σ =".into(), (&n).into()]);
    Ok(result.into())
}
