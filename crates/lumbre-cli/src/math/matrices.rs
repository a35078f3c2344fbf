//! Functions of matrices: inverse, transpose, determinant, equations, and the forms for columns and rows.

use lumbre::math::{matrix, quadratic, quaternion, vector};

use crate::language::filled;

use super::functions::{Call, Function};
use super::lexer::Wrong;
use super::operators;
use super::steps::{Block, difference_of_products, factor};
use super::value::{Matrix, Value, number};

pub(super) const FUNCTIONS: &[Function] = &[
    Function::new("inverse", &["M"], inverse),
    Function::new("transpose", &["M"], transpose),
    Function::new("det", &["M"], det),
    Function::new("solve", &["M, b"], solve),
    Function::new("matrix", &["T"], as_matrix),
    Function::new("linear", &["T"], linear),
    Function::new("row_form", &["M", "M, p"], row_form),
];

fn inverse(call: &mut Call) -> Result<Value, Wrong> {
    // The step is that of the power -1.
    call.work.steps.pop();
    let offset = call.offset();
    operators::inverse(&call.value(0).clone(), call.work).map_err(|what| Wrong::new(offset, what))
}

fn transpose(call: &mut Call) -> Result<Value, Wrong> {
    let m = call.matrix(0)?;
    let result = m.transpose();
    call.work.beside(&["M =".into(), (&m).into(), "  Mᵀ =".into(), (&result).into()]);
    Ok(Value::Matrix(result))
}

fn det(call: &mut Call) -> Result<Value, Wrong> {
    let m = call.matrix(0)?;
    let c = &m.cells;
    let result = match (m.rows, m.columns) {
        (2, 2) => {
            let products = difference_of_products(c[0][0], c[1][1], c[0][1], c[1][0]);
            call.work.line(format!("m11 m22 - m12 m21 = {products}"));
            quadratic::dop(c[0][0], c[1][1], c[0][1], c[1][0])
        }
        (3, 3) => {
            let linear = m.mat3();
            call.work.line("m1 · (m2 × m3)");
            vector::mixed_product(linear.x_axis, linear.y_axis, linear.z_axis)
        }
        (4, 4) => match call.value(0) {
            Value::Transform(map) => map.determinant(),
            _ => m.mat4().determinant(),
        },
        _ => return Err(call.wrong(0, call.work.texts.square_matrix)),
    };
    let texts = call.work.texts;
    call.work.line(if result < 0.0 {
        texts.mirrors
    } else if result == 0.0 {
        texts.flattens
    } else {
        texts.keeps_hand
    });
    Ok(Value::Number(result))
}

fn solve(call: &mut Call) -> Result<Value, Wrong> {
    let (m, b) = (call.matrix(0)?, call.vec3(1)?);
    if !m.is_square(3) {
        return Err(call.wrong(0, &filled(call.work.texts.matrix_of, &["3", "3"])));
    }
    let linear = m.mat3();
    let Some(x) = matrix::solve(&linear, b) else { return Err(call.wrong(0, call.work.texts.invertible)) };
    let [p, q, r] = [linear.x_axis, linear.y_axis, linear.z_axis];
    let whole = vector::mixed_product(p, q, r);
    call.work.line(call.work.texts.cramer);
    call.work.line(format!("det[c1 c2 c3] = {}", number(whole)));
    let replaced = [("x", "b c2 c3", [b, q, r]), ("y", "c1 b c3", [p, b, r]), ("z", "c1 c2 b", [p, q, b])];
    for (i, (name, columns, [u, v, w])) in replaced.into_iter().enumerate() {
        let part = vector::mixed_product(u, v, w);
        let quotient = format!("{} / {}", number(part), factor(whole));
        call.work.line(format!("{name} = det[{columns}] / det[c1 c2 c3] = {quotient} = {}", number(x[i])));
    }
    Ok(x.into())
}

fn as_matrix(call: &mut Call) -> Result<Value, Wrong> {
    if let Value::Quaternion(_) = call.value(0) {
        let q = call.rotation(0)?;
        let result = Matrix::from(quaternion::to_matrix(q));
        call.work.line("q = (a, b, c, d), divided by |q|²:");
        call.work.line("| a²+b²-c²-d²  2(bc-ad)      2(bd+ac)    |");
        call.work.line("| 2(bc+ad)     a²-b²+c²-d²   2(cd-ab)    |");
        call.work.line("| 2(bd-ac)     2(cd+ab)      a²-b²-c²+d² |");
        return Ok(Value::Matrix(result));
    }
    call.value(0)
        .as_matrix()
        .map(Value::Matrix)
        .ok_or_else(|| call.wrong(0, call.work.texts.transform_or_quaternion))
}

fn linear(call: &mut Call) -> Result<Value, Wrong> {
    Ok(Value::Matrix(call.transform(0)?.linear().into()))
}

fn row_form(call: &mut Call) -> Result<Value, Wrong> {
    let m = call.matrix(0)?;
    let rows = m.transpose();
    let texts = call.work.texts;
    if call.count() == 1 {
        call.work.line(format!("{}  p' = M p,  {}  p' = p Mᵀ", texts.columns, texts.rows));
        call.work.beside(&["M =".into(), (&m).into(), "  Mᵀ =".into(), (&rows).into()]);
        return Ok(Value::Matrix(rows));
    }
    let mut p = call.vector(1)?.to_vec();
    if m.is_square(4) && p.len() == 3 {
        p.push(1.0);
    }
    let (Some(column), Some(row)) = (m.times(&Matrix::column(&p)), Matrix::row(&p).times(&rows)) else {
        return Err(call.wrong(1, texts.sizes_fit));
    };
    let [column_side, row_side]: [Vec<Block>; 2] = [
        vec![(&m).into(), (&Matrix::column(&p)).into(), "=".into(), (&column).into()],
        vec![(&Matrix::row(&p)).into(), (&rows).into(), "=".into(), (&row).into()],
    ];
    call.work.line(format!("{}  p' = M p", texts.columns));
    call.work.beside(&column_side);
    call.work.line(format!("{}  p' = p Mᵀ", texts.rows));
    call.work.beside(&row_side);
    Ok(Value::Matrix(rows))
}
