//! What expressions are made of: numbers, vectors, matrices, transforms and quaternions.

use lumbre::math::glam::{DMat2, DMat3, DMat4, DQuat, DVec3};
use lumbre::math::{Transform, matrix, quaternion};
use serde_json::{Value as Json, json};

use crate::language::filled;

use super::texts::Texts;
pub(super) use crate::units::number;

/// A matrix of up to 4×4 entries; what is outside of its size is 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Matrix {
    pub(super) rows: usize,
    pub(super) columns: usize,
    pub(super) cells: [[f64; 4]; 4],
}

impl Matrix {
    /// The matrix with these entries, row by row.
    pub(super) fn from_fn(rows: usize, columns: usize, entry: impl Fn(usize, usize) -> f64) -> Self {
        let cell = |i: usize, j: usize| if i < rows && j < columns { entry(i, j) } else { 0.0 };
        let cells = std::array::from_fn(|i| std::array::from_fn(|j| cell(i, j)));
        Self { rows, columns, cells }
    }

    pub(super) fn column(entries: &[f64]) -> Self {
        Self::from_fn(entries.len(), 1, |i, _| entries[i])
    }

    pub(super) fn row(entries: &[f64]) -> Self {
        Self::from_fn(1, entries.len(), |_, j| entries[j])
    }

    pub(super) fn transpose(&self) -> Self {
        Self { rows: self.columns, columns: self.rows, cells: matrix::transpose(&self.cells) }
    }

    /// The product; `None` where the sizes do not fit.
    pub(super) fn times(&self, other: &Self) -> Option<Self> {
        // The zeros around both add nothing.
        let cells = matrix::product(&self.cells, &other.cells);
        (self.columns == other.rows).then_some(Self { rows: self.rows, columns: other.columns, cells })
    }

    pub(super) fn is_square(&self, size: usize) -> bool {
        self.rows == size && self.columns == size
    }

    /// All entries, row by row.
    pub(super) fn entries(&self) -> impl Iterator<Item = f64> {
        self.cells[..self.rows].iter().flat_map(|row| row[..self.columns].iter().copied())
    }

    pub(super) fn mat3(&self) -> DMat3 {
        let c = &self.cells;
        matrix::rows3([c[0][0], c[0][1], c[0][2], c[1][0], c[1][1], c[1][2], c[2][0], c[2][1], c[2][2]])
    }

    pub(super) fn mat4(&self) -> DMat4 {
        DMat4::from_cols_array_2d(&self.cells).transpose()
    }
}

impl From<DMat2> for Matrix {
    fn from(m: DMat2) -> Self {
        Self::from_fn(2, 2, |i, j| m.col(j)[i])
    }
}

impl From<DMat3> for Matrix {
    fn from(m: DMat3) -> Self {
        Self::from_fn(3, 3, |i, j| m.col(j)[i])
    }
}

impl From<DMat4> for Matrix {
    fn from(m: DMat4) -> Self {
        Self::from_fn(4, 4, |i, j| m.col(j)[i])
    }
}

impl From<&Transform> for Matrix {
    fn from(map: &Transform) -> Self {
        DMat4::from(*map.affine()).into()
    }
}

/// The value of an expression. All its numbers are finite.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    Number(f64),
    /// One to four components.
    Vector(Vec<f64>),
    Matrix(Matrix),
    /// An invertible affine map, which brings its inverse.
    Transform(Box<Transform>),
    Quaternion(DQuat),
}

impl From<DVec3> for Value {
    fn from(v: DVec3) -> Self {
        Self::Vector(v.to_array().to_vec())
    }
}

impl From<Transform> for Value {
    fn from(map: Transform) -> Self {
        Self::Transform(Box::new(map))
    }
}

impl Value {
    /// What kind of value it is, for messages: "a vector of 3".
    pub(super) fn described(&self, texts: &Texts) -> String {
        match self {
            Self::Number(_) => texts.number.to_owned(),
            Self::Vector(v) => filled(texts.vector_of, &[&v.len().to_string()]),
            Self::Matrix(m) => filled(texts.matrix_of, &[&m.rows.to_string(), &m.columns.to_string()]),
            Self::Transform(_) => texts.transform.to_owned(),
            Self::Quaternion(_) => texts.quaternion.to_owned(),
        }
    }

    /// The matrix of a matrix or a transform.
    pub(super) fn as_matrix(&self) -> Option<Matrix> {
        match self {
            Self::Matrix(m) => Some(*m),
            Self::Transform(map) => Some((&**map).into()),
            _ => None,
        }
    }

    pub(super) fn is_finite(&self) -> bool {
        match self {
            Self::Number(x) => x.is_finite(),
            Self::Vector(v) => v.iter().all(|x| x.is_finite()),
            Self::Matrix(m) => m.entries().all(f64::is_finite),
            Self::Transform(map) => map.affine().is_finite() && map.inverse_affine().is_finite(),
            Self::Quaternion(q) => q.is_finite(),
        }
    }

    /// One line that reads back as the same value, but that a transform becomes its matrix.
    pub(super) fn line(&self) -> String {
        match self {
            Self::Number(x) => number(*x),
            Self::Vector(v) => list(v),
            Self::Quaternion(q) => format!("quat({})", quaternion::to_wxyz(*q).map(number).join(", ")),
            Self::Matrix(_) | Self::Transform(_) => {
                let m = self.as_matrix().unwrap_or_else(|| Matrix::from_fn(0, 0, |_, _| 0.0));
                let rows: Vec<String> = m.cells[..m.rows].iter().map(|row| list(&row[..m.columns])).collect();
                format!("[{}]", rows.join(", "))
            }
        }
    }

    /// Lines that read back, with the columns of a matrix aligned.
    pub(super) fn lines(&self) -> Vec<String> {
        let Some(m) = self.as_matrix() else { return vec![self.line()] };
        let rows = aligned(&m, ", ");
        let last = rows.len().saturating_sub(1);
        let framed = rows.iter().enumerate().map(|(i, row)| {
            let (open, close) = (if i == 0 { "[[" } else { " [" }, if i == last { "]]" } else { "]," });
            format!("{open}{row}{close}")
        });
        framed.collect()
    }

    /// The kind and the numbers, for programs: matrices row by row, quaternions real part first.
    pub(super) fn json(&self) -> (&'static str, Json) {
        let rows =
            |m: &Matrix| json!(m.cells[..m.rows].iter().map(|row| &row[..m.columns]).collect::<Vec<_>>());
        match self {
            Self::Number(x) => ("number", json!(x)),
            Self::Vector(v) => ("vector", json!(v)),
            Self::Matrix(m) => ("matrix", rows(m)),
            Self::Transform(map) => ("transform", rows(&(&**map).into())),
            Self::Quaternion(q) => ("quaternion", json!(quaternion::to_wxyz(*q))),
        }
    }
}

/// A vector in brackets.
pub(super) fn list(v: &[f64]) -> String {
    format!("[{}]", v.iter().map(|x| number(*x)).collect::<Vec<_>>().join(", "))
}

/// The rows of a matrix, its columns aligned to the right.
pub(super) fn aligned(m: &Matrix, separator: &str) -> Vec<String> {
    let cells: Vec<String> = m.entries().map(number).collect();
    let width = |j: usize| (0..m.rows).map(|i| cells[i * m.columns + j].len()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..m.columns).map(width).collect();
    let row = |i: usize| {
        let row = (0..m.columns).map(|j| format!("{:>1$}", cells[i * m.columns + j], widths[j]));
        row.collect::<Vec<_>>().join(separator)
    };
    (0..m.rows).map(row).collect()
}
