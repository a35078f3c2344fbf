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
    Function::new("rank", &["M"], rank),
    Function::new("eigenvalues", &["M"], eigenvalues),
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

fn is_singular(m: &Matrix) -> bool {
    of_size!(m, rows => exact::is_singular(&rows))
}

/// The exponent of the power of two that is the largest of these numbers or less; 0 where all are 0.
fn exponent(numbers: &[f64]) -> i32 {
    let most = numbers.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    // A subnormal number has fewer digits than 53.
    let (most, less) = if most < f64::MIN_POSITIVE { (most * 2.0_f64.powi(60), 60) } else { (most, 0) };
    let field = ((most.to_bits() >> 52) & 0x7FF) as i32;
    if most == 0.0 { 0 } else { field - 1023 - less }
}

/// `x · 2^n`, without a power that is no number.
fn times_power(x: f64, n: i32) -> f64 {
    let half = n / 2;
    x * 2.0_f64.powi(half) * 2.0_f64.powi(n - half)
}

/// The matrix with each row divided by a power of two, so that its largest entry is from 1 to 2; and the exponent of
/// the product of these powers.
fn with_rows_near_one(m: &Matrix) -> (Matrix, i32) {
    let exponents: Vec<i32> = m.cells[..m.rows].iter().map(|row| exponent(&row[..m.columns])).collect();
    let scaled = Matrix::from_fn(m.rows, m.columns, |i, j| times_power(m.cells[i][j], -exponents[i]));
    (scaled, exponents.iter().sum())
}

/// The determinant as it is written: one that is no double for its size, as a number times a power of two.
fn written_determinant(m: &Matrix) -> String {
    let whole = determinant(m);
    let is_in_range = whole.is_finite() && whole.abs() >= f64::MIN_POSITIVE;
    if is_in_range || is_singular(m) {
        return number(whole);
    }
    let (scaled, power) = with_rows_near_one(m);
    let share = determinant(&scaled);
    if share.is_normal() { format!("{}·2^{power}", number(share)) } else { number(whole) }
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
fn nearly_singular(m: &Matrix, work: &Work) -> Option<String> {
    let (scaled, _) = with_rows_near_one(m);
    let mut share = determinant(&scaled).abs();
    for row in &scaled.cells[..scaled.rows] {
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
    let written = written_determinant(&m);
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
    let by_minors = || {
        sum(&|j| {
            let minor = written_determinant(&minors[j]);
            if minor.starts_with('-') { format!("·({minor})") } else { format!("·{minor}") }
        })
    };
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
                let value = format!("= {}", written_determinant(minor));
                call.work.beside(&[name.into(), "det".into(), minor.into(), value.into()]);
            }
            call.work.line("m11 M11 - m12 M12 + m13 M13 - m14 M14");
            call.work.line(format!("= {} = {written}", by_minors()));
        }
    }
    if m.rows > 1 {
        call.work.line(texts.exact_sum);
    }
    // By the sign that is written, for a determinant may be less than all doubles.
    call.work.line(if is_singular(&m) {
        texts.flattens
    } else if written.starts_with('-') {
        texts.mirrors
    } else {
        texts.keeps_hand
    });
    if result == 0.0 && !is_singular(&m) {
        call.work.line(texts.less_than_all);
    }
    if let Some(line) = nearly_singular(&m, call.work) {
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
    // Products of this many entries are doubles.
    let power = exponent(m.cells[..m.rows].as_flattened());
    let power = if power.abs() > 200 { power } else { 0 };
    let scaled = Matrix::from_fn(m.rows, m.columns, |i, j| times_power(m.cells[i][j], -power));
    let name = if power == 0 { "M" } else { "M'" };
    if power != 0 && m.rows > 1 {
        work.line(format!("M' = M / 2^{power},  M⁻¹ = M'⁻¹ / 2^{power}"));
    }
    let cofactors = of_size!(&scaled, rows => {
        let all = exact::cofactors(&rows).unwrap_or(rows);
        Matrix::from_fn(m.rows, m.columns, |i, j| all[i][j])
    });
    if m.rows > 1 {
        work.line(work.texts.by_cofactors.replace('M', name));
    }
    if m.rows == 3 {
        for (i, j) in (0..3).flat_map(|i| (0..3).map(move |j| (i, j))) {
            let sign = if (i + j) % 2 == 0 { "" } else { "-" };
            let products = of_two(&without(&scaled, i, j));
            let value = number(cofactors.cells[i][j]);
            work.line(format!("C{}{} = {sign}({products}) = {value}", i + 1, j + 1));
        }
    }
    if m.rows > 1 {
        let end = format!("  det {name} = {}", written_determinant(&scaled));
        work.beside(&["C =".into(), (&cofactors).into(), end.into()]);
    }
    if let Some(line) = nearly_singular(m, work) {
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

/// Numbers from 0 on as places from 1 on: `1, 3`.
fn places(of: &[usize]) -> String {
    of.iter().map(|i| (i + 1).to_string()).collect::<Vec<_>>().join(", ")
}

/// All choices of this many of the numbers below `count`, in order.
fn choices(count: usize, chosen: usize) -> Vec<Vec<usize>> {
    let sets = (0_u32..1 << count).filter(|set| set.count_ones() as usize == chosen);
    let mut all: Vec<Vec<usize>> =
        sets.map(|set| (0..count).filter(|i| set >> i & 1 == 1).collect()).collect();
    all.sort();
    all
}

fn rank(call: &mut Call) -> Result<Value, Wrong> {
    let m = call.matrix(0)?;
    let texts = call.work.texts;
    let most = m.rows.min(m.columns);
    let part = |rows: &[usize], columns: &[usize]| {
        Matrix::from_fn(rows.len(), columns.len(), |i, j| m.cells[rows[i]][columns[j]])
    };
    // The rank is the size of the largest part with a determinant that is not 0.
    let largest = (1..=most).rev().find_map(|size| {
        let columns = choices(m.columns, size);
        choices(m.rows, size).into_iter().find_map(|rows| {
            let columns = columns.iter().find(|columns| !is_singular(&part(&rows, columns)))?;
            Some((rows, columns.clone()))
        })
    });
    let Some((rows, columns)) = largest else {
        call.work.line(texts.all_zero);
        return Ok(Value::Number(0.0));
    };
    let (rank, minor) = (rows.len(), part(&rows, &columns));
    let value = format!("= {}", written_determinant(&minor));
    call.work.line(filled(texts.some_minor, &[&places(&rows), &places(&columns)]));
    call.work.beside(&["det".into(), (&minor).into(), value.into()]);
    if rank < most {
        call.work.line(filled(texts.no_minor, &[&(rank + 1).to_string()]));
    }
    if let Some(line) = nearly_singular(&minor, call.work) {
        call.work.line(line);
    }
    Ok(Value::Number(rank as f64))
}

/// `λ² - 4 λ + 3`, from the coefficient of the highest power down, which is 1.
fn written_polynomial(coefficients: &[f64]) -> String {
    let degree = coefficients.len() - 1;
    let mut written = String::new();
    for (i, c) in coefficients.iter().enumerate().filter(|(_, c)| **c != 0.0) {
        let power = ["", "λ", "λ²", "λ³", "λ⁴"][degree - i];
        let sign = match (i, *c < 0.0) {
            (0, _) => "",
            (_, true) => " - ",
            (_, false) => " + ",
        };
        let size = number(c.abs());
        written += &match (power, c.abs() == 1.0) {
            ("", _) => format!("{sign}{size}"),
            (_, true) => format!("{sign}{power}"),
            (_, false) => format!("{sign}{size} {power}"),
        };
    }
    written
}

fn eigenvalues(call: &mut Call) -> Result<Value, Wrong> {
    let m = square(call, 0)?;
    let texts = call.work.texts;
    let (coefficients, all) = of_size!(&m, rows => {
        (exact::characteristic_polynomial(&rows), exact::eigenvalues(&rows).unwrap_or_default())
    });
    call.work.line(texts.characteristic);
    if let Some(coefficients) = coefficients.filter(|all| all.iter().all(|c| c.is_finite())) {
        call.work.line(format!("det(λ I - M) = {} = 0", written_polynomial(&coefficients)));
    }
    if m.rows > 1 && m == m.transpose() {
        call.work.line(texts.symmetric);
    }
    if m.rows == 2 {
        let [[a, b], [c, d]] =
            [[m.cells[0][0], m.cells[0][1]], [m.cells[1][0], m.cells[1][1]]].map(|row| row.map(factor));
        call.work.line("λ = (m11 + m22)/2 ± √(((m11 - m22)/2)² + m12 m21)");
        call.work.line(format!("= ({a} + {d})/2 ± √((({a} - {d})/2)² + {b}·{c})"));
    }
    for (i, value) in all.real.iter().enumerate() {
        call.work.line(format!("λ{} = {}", i + 1, number(*value)));
    }
    let pair = |[a, b]: [f64; 2]| format!("{} ± {} i", number(a), number(b));
    for (i, values) in all.pairs.iter().enumerate() {
        let first = all.real.len() + 2 * i + 1;
        call.work.line(format!("λ{first}, λ{} = {}", first + 1, pair(*values)));
    }
    if all.real.is_empty() {
        let found: Vec<String> = all.pairs.into_iter().map(pair).collect();
        let what = Diagnostic::error(texts.no_real_eigenvalue).found(found.join(", "));
        return Err(Wrong::new(call.offset(), what.expected(texts.real_eigenvalue)));
    }
    if !all.pairs.is_empty() {
        call.work.line(texts.only_real);
    }
    Ok(Value::Vector(all.real))
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
        let found = format!("det M = {}", written_determinant(&m));
        let what = Diagnostic::error(message).found(found).expected(texts.independent);
        Wrong::new(call.offset(), what)
    };
    let x: Vec<f64> = of_size!(&m, rows => {
        let right = std::array::from_fn(|i| b[i]);
        match exact::solve(&rows, &right) {
            Solutions::One(x) => x.to_vec(),
            Solutions::None => return Err(refused(call, texts.no_solution)),
            Solutions::Many => return Err(refused(call, texts.many_solutions)),
            Solutions::NotFinite => return Err(refused(call, texts.not_finite)),
        }
    });
    let columns: Vec<String> = (1..=m.rows).map(|j| format!("c{j}")).collect();
    let whole = written_determinant(&m);
    call.work.line(format!("{} {}", texts.cramer, columns.join(", ")));
    let all = columns.join(" ");
    call.work.line(format!("det[{all}] = {whole}"));
    let whole = if whole.starts_with('-') || whole.contains('·') { format!("({whole})") } else { whole };
    for (i, x) in x.iter().enumerate() {
        let part = Matrix::from_fn(m.rows, m.columns, |row, j| if i == j { b[row] } else { m.cells[row][j] });
        let mut replaced = columns.clone();
        replaced[i] = "b".to_owned();
        let (replaced, name) = (replaced.join(" "), ["x", "y", "z", "w"][i]);
        let quotient = format!("{} / {whole}", written_determinant(&part));
        call.work.line(format!("{name} = det[{replaced}] / det[{all}] = {quotient} = {}", number(*x)));
    }
    if let Some(line) = nearly_singular(&m, call.work) {
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
