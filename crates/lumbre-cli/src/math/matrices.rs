//! Functions of matrices: inverse, transpose, determinant, equations, and the forms for columns and rows.

use lumbre::formats::diagnostic::Diagnostic;
use lumbre::math::exact::{self, Solutions};
use lumbre::math::{Elementary, quaternion, vector};

use crate::language::filled;

use super::functions::{Call, Function};
use super::lexer::Wrong;
use super::operators;
use super::steps::{Block, Work, difference_of_products, factor};
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

/// A square matrix of size 1 to 4, as the rows of that size. The match is on the size.
macro_rules! of_size {
    ($m:expr, $rows:ident => $body:expr) => {
        match $m.rows {
            1 => {
                let $rows = rows::<1>($m);
                $body
            }
            2 => {
                let $rows = rows::<2>($m);
                $body
            }
            3 => {
                let $rows = rows::<3>($m);
                $body
            }
            _ => {
                let $rows = rows::<4>($m);
                $body
            }
        }
    };
}

fn rows<const N: usize>(m: &Matrix) -> [[f64; N]; N] {
    std::array::from_fn(|i| std::array::from_fn(|j| m.cells[i][j]))
}

fn square(call: &Call, i: usize) -> Result<Matrix, Wrong> {
    let m = call.matrix(i)?;
    if m.rows == m.columns { Ok(m) } else { Err(call.wrong(i, call.work.texts.square_matrix)) }
}

/// The determinant of a square matrix, exact and rounded once.
pub(super) fn determinant(m: &Matrix) -> f64 {
    of_size!(m, rows => exact::determinant(&rows))
}

/// What is left without a row and a column.
fn without(m: &Matrix, row: usize, column: usize) -> Matrix {
    let after = |i: usize, left: usize| if i < left { i } else { i + 1 };
    Matrix::from_fn(m.rows - 1, m.columns - 1, |i, j| m.cells[after(i, row)][after(j, column)])
}

/// The determinant of a matrix of 2 in numbers.
fn of_two(m: &Matrix) -> String {
    difference_of_products(m.cells[0][0], m.cells[1][1], m.cells[0][1], m.cells[1][0])
}

/// That the matrix is so nearly singular that the rounding of its entries decides; `None` where it is not.
fn nearly_singular(m: &Matrix, determinant: f64, work: &Work) -> Option<String> {
    let mut share = determinant.abs();
    for row in &m.cells[..m.rows] {
        let length = vector::length([row[0], row[1], row[2]].into()).hypotenuse(row[3]);
        share /= length;
    }
    let is_near = 0.0 < share && share < 1e-12;
    is_near.then(|| filled(work.texts.nearly_singular, &[&number(two_digits(share))]))
}

/// A number with two digits.
fn two_digits(x: f64) -> f64 {
    format!("{x:.1e}").parse().unwrap_or(x)
}

fn det(call: &mut Call) -> Result<Value, Wrong> {
    let m = square(call, 0)?;
    let result = determinant(&m);
    let written = number(result);
    let first = &m.cells[0];
    let minors: Vec<Matrix> = (0..m.columns).map(|j| without(&m, 0, j)).collect();
    let texts = call.work.texts;
    let sum = |factors: &dyn Fn(usize) -> String| {
        let terms = (0..m.columns).map(|j| {
            let sign = ["", " - ", " + ", " - "][j];
            format!("{sign}{}{}", factor(first[j]), factors(j))
        });
        terms.collect::<String>()
    };
    let by_minors = || sum(&|j| format!("·{}", factor(determinant(&minors[j]))));
    match m.rows {
        1 => call.work.line(format!("m11 = {written}")),
        2 => call.work.line(format!("m11 m22 - m12 m21 = {} = {written}", of_two(&m))),
        3 => {
            call.work.line("m11 (m22 m33 - m23 m32) - m12 (m21 m33 - m23 m31) + m13 (m21 m32 - m22 m31)");
            call.work.line(format!("= {}", sum(&|j| format!("·({})", of_two(&minors[j])))));
            call.work.line(format!("= {} = {written}", by_minors()));
        }
        _ => {
            call.work.line(texts.minors);
            for (j, minor) in minors.iter().enumerate() {
                let name = format!("M1{} =", j + 1);
                let value = format!("= {}", number(determinant(minor)));
                call.work.beside(&[name.into(), "det".into(), minor.into(), value.into()]);
            }
            call.work.line("m11 M11 - m12 M12 + m13 M13 - m14 M14");
            call.work.line(format!("= {} = {written}", by_minors()));
        }
    }
    if m.rows > 1 {
        call.work.line(texts.exact_sum);
    }
    call.work.line(if result < 0.0 {
        texts.mirrors
    } else if result == 0.0 {
        texts.flattens
    } else {
        texts.keeps_hand
    });
    if let Some(line) = nearly_singular(&m, result, call.work) {
        call.work.line(line);
    }
    Ok(Value::Number(result))
}

/// The inverse of a square matrix by its cofactors; `None` for a singular one, and where it is not finite.
pub(super) fn inverted(m: &Matrix) -> Option<Matrix> {
    of_size!(m, rows => {
        let inverse = exact::inverse(&rows)?;
        Some(Matrix::from_fn(m.rows, m.columns, |i, j| inverse[i][j]))
    })
}

/// How the inverse comes from the cofactors.
pub(super) fn show_inverse(m: &Matrix, inverse: &Matrix, work: &mut Work) {
    let whole = determinant(m);
    let cofactors = of_size!(m, rows => {
        let all = exact::cofactors(&rows).unwrap_or(rows);
        Matrix::from_fn(m.rows, m.columns, |i, j| all[i][j])
    });
    if m.rows > 1 {
        work.line(work.texts.by_cofactors);
    }
    if m.rows == 3 {
        for (i, j) in (0..3).flat_map(|i| (0..3).map(move |j| (i, j))) {
            let sign = if (i + j) % 2 == 0 { "" } else { "-" };
            let products = of_two(&without(m, i, j));
            let value = number(cofactors.cells[i][j]);
            work.line(format!("C{}{} = {sign}({products}) = {value}", i + 1, j + 1));
        }
    }
    if m.rows > 1 {
        let end = format!("  det M = {}", number(whole));
        work.beside(&["C =".into(), (&cofactors).into(), end.into()]);
    }
    if let Some(line) = nearly_singular(m, whole, work) {
        work.line(line);
    }
    show_unit_product(m, inverse, work);
}

/// The product of a matrix and its inverse, which is the unit matrix up to rounding.
pub(super) fn show_unit_product(m: &Matrix, inverse: &Matrix, work: &mut Work) {
    let Some(product) = m.times(inverse) else { return };
    let is_unit = product == Matrix::from_fn(m.rows, m.columns, |i, j| f64::from(u8::from(i == j)));
    work.line(if is_unit { "M M⁻¹ = I" } else { "M M⁻¹ ≈ I" });
    work.beside(&[m.into(), inverse.into(), "=".into(), (&product).into()]);
}

fn solve(call: &mut Call) -> Result<Value, Wrong> {
    let m = square(call, 0)?;
    let b = match call.value(1) {
        Value::Number(x) if m.rows == 1 => vec![*x],
        Value::Vector(v) if v.len() == m.rows => v.clone(),
        _ => return Err(call.wrong(1, &filled(call.work.texts.size_of, &[&m.rows.to_string()]))),
    };
    let texts = call.work.texts;
    let refused = |call: &Call, message: &str| {
        let found = format!("det M = {}", number(determinant(&m)));
        let what = Diagnostic::error(message).found(found).expected(texts.independent);
        Wrong::new(call.offset(), what)
    };
    let (x, parts): (Vec<f64>, Vec<f64>) = of_size!(&m, rows => {
        let right = std::array::from_fn(|i| b[i]);
        match exact::solve(&rows, &right) {
            Solutions::One(x) => (x.to_vec(), exact::numerators(&rows, &right).unwrap_or(x).to_vec()),
            Solutions::None => return Err(refused(call, texts.no_solution)),
            Solutions::Many => return Err(refused(call, texts.many_solutions)),
            Solutions::NotFinite => return Err(refused(call, texts.not_finite)),
        }
    });
    let columns: Vec<String> = (1..=m.rows).map(|j| format!("c{j}")).collect();
    let whole = determinant(&m);
    call.work.line(format!("{} {}", texts.cramer, columns.join(", ")));
    let all = columns.join(" ");
    call.work.line(format!("det[{all}] = {}", number(whole)));
    for (i, (part, x)) in parts.iter().zip(&x).enumerate() {
        let mut replaced = columns.clone();
        replaced[i] = "b".to_owned();
        let (replaced, name) = (replaced.join(" "), ["x", "y", "z", "w"][i]);
        let quotient = format!("{} / {}", number(*part), factor(whole));
        call.work.line(format!("{name} = det[{replaced}] / det[{all}] = {quotient} = {}", number(*x)));
    }
    if let Some(line) = nearly_singular(&m, whole, call.work) {
        call.work.line(line);
    }
    Ok(Value::Vector(x))
}

fn as_matrix(call: &mut Call) -> Result<Value, Wrong> {
    if let Value::Quaternion(_) = call.value(0) {
        let q = call.rotation(0)?;
        let result = Matrix::from(quaternion::to_matrix(q));
        call.work.line(call.work.texts.divided_by_square);
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
