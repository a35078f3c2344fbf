//! Sums, products, quotients and powers of values.

use lumbre::formats::diagnostic::Diagnostic;
use lumbre::math::{DVec3, Elementary, Transform, matrix, quaternion};

use crate::language::filled;

use super::steps::{Work, factor, sum_of_products};
use super::value::{Matrix, Value, list, number};
use super::{matrices, quaternions};

/// That these two do not go together.
fn mismatch(sign: &str, a: &Value, b: &Value, expected: &str, work: &Work) -> Box<Diagnostic> {
    let (a, b) = (a.described(work.texts), b.described(work.texts));
    Diagnostic::error(filled(work.texts.no_operation, &[sign]))
        .found(format!("{a} {sign} {b}"))
        .expected(expected)
        .into()
}

pub(super) fn negated(value: &Value) -> Value {
    scaled(value, -1.0)
}

fn scaled(value: &Value, factor: f64) -> Value {
    match value {
        Value::Number(x) => Value::Number(factor * x),
        Value::Vector(v) => Value::Vector(v.iter().map(|x| factor * x).collect()),
        Value::Quaternion(q) => Value::Quaternion(*q * factor),
        Value::Matrix(m) => Value::Matrix(each(m, |x| factor * x)),
        Value::Transform(map) => Value::Matrix(each(&(&**map).into(), |x| factor * x)),
    }
}

fn each(m: &Matrix, f: impl Fn(f64) -> f64) -> Matrix {
    Matrix::from_fn(m.rows, m.columns, |i, j| f(m.cells[i][j]))
}

/// The sum, or the difference.
pub(super) fn add(a: &Value, b: &Value, is_sum: bool, work: &mut Work) -> Result<Value, Box<Diagnostic>> {
    let sign = if is_sum { "+" } else { "-" };
    let f = |x: f64, y: f64| if is_sum { x + y } else { x - y };
    let real = |x: f64| quaternion::from_wxyz([x, 0.0, 0.0, 0.0]);
    let result = match (a, b) {
        (Value::Number(x), Value::Number(y)) => return Ok(Value::Number(f(*x, *y))),
        (Value::Vector(v), Value::Vector(w)) if v.len() == w.len() => {
            Value::Vector(v.iter().zip(w).map(|(x, y)| f(*x, *y)).collect())
        }
        (Value::Quaternion(p), Value::Quaternion(q)) => {
            Value::Quaternion(if is_sum { *p + *q } else { *p - *q })
        }
        (Value::Number(x), Value::Quaternion(q)) => {
            Value::Quaternion(if is_sum { real(*x) + *q } else { real(*x) - *q })
        }
        (Value::Quaternion(q), Value::Number(x)) => {
            Value::Quaternion(if is_sum { *q + real(*x) } else { *q - real(*x) })
        }
        _ => match (a.as_matrix(), b.as_matrix()) {
            (Some(m), Some(n)) if (m.rows, m.columns) == (n.rows, n.columns) => {
                let sum = Matrix::from_fn(m.rows, m.columns, |i, j| f(m.cells[i][j], n.cells[i][j]));
                work.begin(format!("A {sign} B"));
                work.beside(&[(&m).into(), sign.into(), (&n).into(), "=".into(), (&sum).into()]);
                return Ok(Value::Matrix(sum));
            }
            _ => return Err(mismatch(sign, a, b, work.texts.same_kind, work)),
        },
    };
    work.begin(format!("a {sign} b"));
    work.line(format!("{} {sign} {} = {}", a.line(), b.line(), result.line()));
    if let Value::Quaternion(sum) = &result {
        let parts = |value: &Value| match value {
            Value::Quaternion(q) => quaternion::to_wxyz(*q),
            Value::Number(x) => [*x, 0.0, 0.0, 0.0],
            _ => [0.0; 4],
        };
        let (a, b, sum) = (parts(a), parts(b), quaternion::to_wxyz(*sum));
        for (i, name) in ["1:", "i:", "j:", "k:"].into_iter().enumerate() {
            work.line(format!("{name}  {} {sign} {} = {}", factor(a[i]), factor(b[i]), number(sum[i])));
        }
    }
    Ok(result)
}

/// The product: of vectors there are two, which have names.
pub(super) fn multiply(a: &Value, b: &Value, work: &mut Work) -> Result<Value, Box<Diagnostic>> {
    match (a, b) {
        (Value::Number(x), Value::Number(y)) => Ok(Value::Number(x * y)),
        (Value::Number(factor), value) | (value, Value::Number(factor)) => {
            let result = scaled(value, *factor);
            work.begin("s a");
            work.line(format!("{} · {} = {}", number(*factor), value.line(), result.line()));
            Ok(result)
        }
        (Value::Vector(_), Value::Vector(_)) => {
            Err(Diagnostic::error(work.texts.no_vector_product).expected(work.texts.two_products).into())
        }
        (Value::Quaternion(p), Value::Quaternion(q)) => {
            Ok(Value::Quaternion(quaternions::product(*p, *q, work)))
        }
        (Value::Quaternion(_), _) | (_, Value::Quaternion(_)) => {
            Err(mismatch("*", a, b, work.texts.rotate_by_quaternion, work))
        }
        (Value::Transform(map), Value::Vector(v)) if v.len() == 3 => {
            let image = map.point(DVec3::from_slice(v));
            show_image(&(&**map).into(), v, &image.to_array(), None, work);
            Ok(image.into())
        }
        (Value::Transform(outer), Value::Transform(inner)) => {
            let product = **outer * **inner;
            let sides: [Matrix; 3] = [(&**outer).into(), (&**inner).into(), (&product).into()];
            work.begin("A B");
            work.beside(&[(&sides[0]).into(), (&sides[1]).into(), "=".into(), (&sides[2]).into()]);
            work.line(work.texts.right_first);
            Ok(product.into())
        }
        (_, Value::Vector(v)) => match column_product(a, v) {
            Some(image) => column_image(a, v, &image, work),
            None => Err(mismatch("*", a, b, work.texts.sizes_fit, work)),
        },
        (Value::Vector(v), _) => match row_product(v, b, work) {
            Some(image) => Ok(image),
            None => Err(mismatch("*", a, b, work.texts.sizes_fit, work)),
        },
        _ => {
            let (Some(m), Some(n)) = (a.as_matrix(), b.as_matrix()) else {
                return Err(mismatch("*", a, b, work.texts.sizes_fit, work));
            };
            let Some(product) = m.times(&n) else {
                return Err(mismatch("*", a, b, work.texts.sizes_fit, work));
            };
            work.begin("A B");
            work.line("(A B)ij = Σk Aik Bkj");
            work.beside(&[(&m).into(), (&n).into(), "=".into(), (&product).into()]);
            let (row, column) = (m.cells[0], n.transpose().cells[0]);
            let first = sum_of_products(&row[..m.columns], &column[..m.columns]);
            work.line(format!("(A B)11 = {first} = {}", number(product.cells[0][0])));
            Ok(Value::Matrix(product))
        }
    }
}

/// A matrix times a column; three numbers stand for a point where the matrix has four columns.
fn column_product(a: &Value, v: &[f64]) -> Option<Vec<f64>> {
    let m = a.as_matrix()?;
    let mut column = v.to_vec();
    if m.is_square(4) && v.len() == 3 {
        column.push(1.0);
    }
    let product = m.times(&Matrix::column(&column))?;
    Some(product.entries().collect())
}

fn column_image(a: &Value, v: &[f64], image: &[f64], work: &mut Work) -> Result<Value, Box<Diagnostic>> {
    let Some(m) = a.as_matrix() else { return Ok(Value::Vector(image.to_vec())) };
    if image.len() == 4 && v.len() == 3 {
        let homogeneous = [image[0], image[1], image[2], image[3]];
        let Some(point) = matrix::point_of_homogeneous(homogeneous.into()) else {
            return Err(Diagnostic::error(work.texts.no_image)
                .found(list(image))
                .expected(work.texts.w_not_zero)
                .into());
        };
        show_image(&m, v, image, Some(image[3]), work);
        return Ok(point.into());
    }
    work.begin("A v");
    work.beside(&[(&m).into(), (&Matrix::column(v)).into(), "=".into(), (&Matrix::column(image)).into()]);
    match image {
        [x] => Ok(Value::Number(*x)),
        _ => Ok(Value::Vector(image.to_vec())),
    }
}

/// The image of a point in homogeneous coordinates, and the division where w is not 1.
fn show_image(m: &Matrix, p: &[f64], image: &[f64], w: Option<f64>, work: &mut Work) {
    let mut homogeneous = [0.0, 0.0, 0.0, 1.0];
    homogeneous[..image.len()].copy_from_slice(image);
    work.begin("M p");
    work.line(work.texts.point_has_w_1);
    let column = Matrix::column(&[p, &[1.0]].concat());
    work.beside(&[m.into(), (&column).into(), "=".into(), (&Matrix::column(&homogeneous)).into()]);
    if let Some(w) = w
        && w != 1.0
    {
        work.line(format!("{} {}", work.texts.divided_by_w, number(w)));
    }
}

/// A row times a matrix; three numbers stand for a point where the matrix has four rows.
fn row_product(v: &[f64], b: &Value, work: &mut Work) -> Option<Value> {
    let m = b.as_matrix()?;
    let is_point = m.is_square(4) && v.len() == 3;
    let row = if is_point { [v, &[1.0]].concat() } else { v.to_vec() };
    let image = Matrix::row(&row).times(&m)?;
    let entries: Vec<f64> = image.entries().collect();
    let point = match entries[..] {
        [x, y, z, w] if is_point => Some(matrix::point_of_homogeneous([x, y, z, w].into())?),
        _ => None,
    };
    work.begin("v A");
    work.line(work.texts.row_on_the_left);
    work.beside(&[(&Matrix::row(&row)).into(), (&m).into(), "=".into(), (&image).into()]);
    Some(match (point, &entries[..]) {
        (Some(point), _) => point.into(),
        (None, [x]) => Value::Number(*x),
        _ => Value::Vector(entries),
    })
}

/// The quotient by a number, or of quaternions.
pub(super) fn divide(a: &Value, b: &Value, work: &mut Work) -> Result<Value, Box<Diagnostic>> {
    if let Value::Number(0.0) = b {
        let found = format!("{} / 0", a.line());
        return Err(Diagnostic::error(work.texts.division_by_0)
            .found(found)
            .expected(work.texts.divisor_not_zero)
            .into());
    }
    let p = match (a, b) {
        (Value::Number(x), Value::Number(y)) => return Ok(Value::Number(x / y)),
        (_, Value::Number(divisor)) => {
            let result = match a {
                Value::Vector(v) => Value::Vector(v.iter().map(|x| x / divisor).collect()),
                Value::Quaternion(q) => Value::Quaternion(*q / *divisor),
                _ => match a.as_matrix() {
                    Some(m) => Value::Matrix(each(&m, |x| x / divisor)),
                    None => return Err(mismatch("/", a, b, work.texts.divisors, work)),
                },
            };
            work.begin("a / s");
            work.line(format!("{} / {} = {}", a.line(), number(*divisor), result.line()));
            return Ok(result);
        }
        (Value::Quaternion(p), Value::Quaternion(_)) => *p,
        (Value::Number(x), Value::Quaternion(_)) => quaternion::from_wxyz([*x, 0.0, 0.0, 0.0]),
        _ => return Err(mismatch("/", a, b, work.texts.divisors, work)),
    };
    let Value::Quaternion(q) = b else { return Err(mismatch("/", a, b, work.texts.divisors, work)) };
    let quotient = quaternion::divide(p, *q);
    let Some((inverse, quotient)) = quaternion::inverse(*q).zip(quotient) else {
        return Err(Diagnostic::error(work.texts.no_inverse)
            .found(b.line())
            .expected(work.texts.invertible)
            .into());
    };
    work.begin("p / q");
    let line = |q| Value::Quaternion(q).line();
    let (conjugate, length) = (line(q.conjugate()), number(quaternion::length(*q)));
    work.line(format!("p / q = p q⁻¹,  q⁻¹ = conj q / |q|² = {conjugate} / {length}² = {}", line(inverse)));
    quaternions::show_product(p, inverse, quotient, work);
    Ok(Value::Quaternion(quotient))
}

/// A power of a number, or a whole power of a matrix, transform or quaternion.
pub(super) fn power(base: &Value, exponent: &Value, work: &mut Work) -> Result<Value, Box<Diagnostic>> {
    let is_square = base.as_matrix().is_none_or(|m| m.rows == m.columns);
    match (base, exponent) {
        (Value::Number(x), Value::Number(y)) => power_of_number(*x, *y, work),
        (Value::Matrix(_) | Value::Transform(_) | Value::Quaternion(_), Value::Number(-1.0)) => {
            inverse(base, work)
        }
        (Value::Matrix(_) | Value::Transform(_) | Value::Quaternion(_), Value::Number(n))
            if is_square && n.fract() == 0.0 && n.abs() <= LARGEST_POWER =>
        {
            whole_power(base, *n as i32, work)
        }
        _ => Err(mismatch("^", base, exponent, work.texts.powers, work)),
    }
}

/// The largest exponent of a matrix, transform or quaternion.
const LARGEST_POWER: f64 = 1000.0;

fn power_of_number(x: f64, y: f64, work: &Work) -> Result<Value, Box<Diagnostic>> {
    let texts = work.texts;
    let (message, expected) = if x == 0.0 && y == 0.0 {
        (texts.zero_to_0, texts.power_not_of_zero)
    } else if x == 0.0 && y < 0.0 {
        (texts.zero_to_negative, texts.power_not_of_zero)
    } else if x < 0.0 && y.fract() != 0.0 {
        (texts.negative_base, texts.whole_exponent)
    } else {
        return Ok(Value::Number(x.power(y)));
    };
    let found = format!("{}^{}", factor(x), factor(y));
    Err(Diagnostic::error(message).found(found).expected(expected).into())
}

/// By repeated squares: the power 5 is that of 4 times that of 1.
fn whole_power(base: &Value, n: i32, work: &mut Work) -> Result<Value, Box<Diagnostic>> {
    let base = if n < 0 { inverse(base, work)? } else { base.clone() };
    let name = if n < 0 { "(M⁻¹)" } else { "M" };
    let mut rest = n.unsigned_abs();
    let (mut square, mut of_square) = (base.clone(), 1_u32);
    let mut result: Option<Value> = None;
    let mut factors = vec![];
    let mut squares = vec![];
    loop {
        if rest & 1 == 1 {
            factors.push(format!("{name}^{of_square}"));
            result = Some(match result {
                Some(found) => times(&found, &square),
                None => square.clone(),
            });
        }
        rest >>= 1;
        if rest == 0 {
            break;
        }
        square = times(&square, &square);
        of_square *= 2;
        squares.push((of_square, square.clone()));
    }
    work.begin(format!("M^{n}"));
    if squares.len() + factors.len() > 1 {
        work.line(format!("{} {name}^{} = {}", work.texts.by_squares, n.unsigned_abs(), factors.join(" ")));
    }
    for (exponent, value) in squares.iter().take(4) {
        match value.as_matrix() {
            Some(m) => work.beside(&[format!("{name}^{exponent} =").into(), (&m).into()]),
            None => work.line(format!("{name}^{exponent} = {}", value.line())),
        }
    }
    Ok(result.unwrap_or_else(|| unit_like(&base)))
}

/// The product of two values of one kind.
fn times(a: &Value, b: &Value) -> Value {
    match (a, b) {
        (Value::Transform(a), Value::Transform(b)) => (**a * **b).into(),
        (Value::Quaternion(a), Value::Quaternion(b)) => Value::Quaternion(*a * *b),
        (Value::Matrix(a), Value::Matrix(b)) => a.times(b).map_or_else(|| Value::Matrix(*a), Value::Matrix),
        _ => a.clone(),
    }
}

/// What changes nothing by a product.
fn unit_like(value: &Value) -> Value {
    match value {
        Value::Transform(_) => Transform::IDENTITY.into(),
        Value::Quaternion(_) => Value::Quaternion(quaternion::from_wxyz([1.0, 0.0, 0.0, 0.0])),
        _ => {
            let size = value.as_matrix().map_or(1, |m| m.rows);
            Value::Matrix(Matrix::from_fn(size, size, |i, j| f64::from(u8::from(i == j))))
        }
    }
}

/// The inverse of a matrix, transform or quaternion.
pub(super) fn inverse(value: &Value, work: &mut Work) -> Result<Value, Box<Diagnostic>> {
    let result = match value {
        Value::Quaternion(q) => quaternion::inverse(*q).map(Value::Quaternion),
        Value::Transform(map) => Some(map.inverse().into()),
        Value::Matrix(m) if m.rows == m.columns => matrices::inverted(m).map(Value::Matrix),
        Value::Matrix(_) => None,
        _ => {
            let what = Diagnostic::error(work.texts.no_inverse).found(value.described(work.texts));
            return Err(what.expected(work.texts.inverted_kinds).into());
        }
    };
    let Some(result) = result.filter(Value::is_finite) else {
        let what = Diagnostic::error(work.texts.no_inverse).found(value.line());
        return Err(what.expected(work.texts.invertible).into());
    };
    match (value, &result) {
        (Value::Quaternion(q), _) => {
            work.begin("q⁻¹");
            let conjugate = Value::Quaternion(q.conjugate()).line();
            let length = number(quaternion::length(*q));
            work.line(format!("conj q / |q|² = {conjugate} / {length}² = {}", result.line()));
        }
        (Value::Matrix(m), Value::Matrix(inverse)) => {
            work.begin("M⁻¹");
            matrices::show_inverse(m, inverse, work);
        }
        (Value::Transform(map), Value::Transform(inverse)) => {
            work.begin("M⁻¹");
            work.line(work.texts.affine_inverse);
            matrices::show_unit_product(&(&**map).into(), &(&**inverse).into(), work);
        }
        _ => {}
    }
    Ok(result)
}
