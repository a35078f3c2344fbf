//! Answers as Python has them: numpy arrays that are written in place, in pieces by many threads.

use std::ops::Range;

use lumbre::DVec3;
use numpy::ndarray::Array2;
use numpy::{Element, PyArray1, PyArray2, PyReadwriteArray1, PyReadwriteArray2, PyUntypedArrayMethods};
use pyo3::intern;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString, PyTuple};

use crate::errors::{filled, invalid, list, tuple};
use crate::rays::Real;

/// Up to this many numbers are copied faster than shared.
const FEW: usize = 256;

/// What stands for no shape, primitive or instance.
pub(crate) const NONE: i32 = -1;

/// The arrays to write, each with a row for every ray; only the requested ones.
pub(crate) struct Outputs<'py, T: Real> {
    t: Option<PyReadwriteArray1<'py, T>>,
    point: Option<PyReadwriteArray2<'py, T>>,
    normal: Option<PyReadwriteArray2<'py, T>>,
    uv: Option<PyReadwriteArray2<'py, T>>,
    front: Option<PyReadwriteArray1<'py, bool>>,
    shape: Option<PyReadwriteArray1<'py, i32>>,
    prim: Option<PyReadwriteArray1<'py, i32>>,
    instance: Option<PyReadwriteArray1<'py, i32>>,
}

/// Arrays that are made here, of the fields that are wanted.
pub(crate) struct Fresh<T> {
    t: Option<Vec<T>>,
    point: Option<Vec<T>>,
    normal: Option<Vec<T>>,
    uv: Option<Vec<T>>,
    front: Option<Vec<bool>>,
    shape: Option<Vec<i32>>,
    prim: Option<Vec<i32>>,
    instance: Option<Vec<i32>>,
}

impl<T: Real> Fresh<T> {
    /// Rows for this many rays. Names that are no fields are for Python to refuse: `None`.
    pub(crate) fn new(fields: &Bound<'_, PyTuple>, count: usize) -> PyResult<Option<Self>> {
        let mut fresh = Self {
            t: None,
            point: None,
            normal: None,
            uv: None,
            front: None,
            shape: None,
            prim: None,
            instance: None,
        };
        let zero = T::rounded(0.0);
        for field in fields {
            match field.cast::<PyString>()?.to_cow()?.as_ref() {
                "t" => fresh.t = Some(filled(zero, count)?),
                "point" => fresh.point = Some(filled(zero, 3 * count)?),
                "normal" => fresh.normal = Some(filled(zero, 3 * count)?),
                "uv" => fresh.uv = Some(filled(zero, 2 * count)?),
                "front" => fresh.front = Some(filled(false, count)?),
                "shape" => fresh.shape = Some(filled(0, count)?),
                "prim" => fresh.prim = Some(filled(0, count)?),
                "instance" => fresh.instance = Some(filled(0, count)?),
                _ => return Ok(None),
            }
        }
        Ok(Some(fresh))
    }

    pub(crate) fn columns(&mut self, count: usize) -> Columns<'_, T> {
        Columns {
            first: 0,
            count,
            t: self.t.as_deref_mut(),
            point: self.point.as_deref_mut(),
            normal: self.normal.as_deref_mut(),
            uv: self.uv.as_deref_mut(),
            front: self.front.as_deref_mut(),
            shape: self.shape.as_deref_mut(),
            prim: self.prim.as_deref_mut(),
            instance: self.instance.as_deref_mut(),
        }
    }

    /// The arrays by their names.
    pub(crate) fn into_dict<'py>(self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let columns = PyDict::new(py);
        put(&columns, intern!(py, "t"), self.t)?;
        put_table(&columns, intern!(py, "point"), self.point, 3)?;
        put_table(&columns, intern!(py, "normal"), self.normal, 3)?;
        put_table(&columns, intern!(py, "uv"), self.uv, 2)?;
        put(&columns, intern!(py, "front"), self.front)?;
        put(&columns, intern!(py, "shape"), self.shape)?;
        put(&columns, intern!(py, "prim"), self.prim)?;
        put(&columns, intern!(py, "instance"), self.instance)?;
        Ok(columns)
    }
}

fn put<T: Element>(
    columns: &Bound<'_, PyDict>,
    name: &Bound<'_, PyString>,
    column: Option<Vec<T>>,
) -> PyResult<()> {
    let Some(column) = column else { return Ok(()) };
    let py = columns.py();
    // To hand over few numbers takes longer than to copy them.
    let array =
        if column.len() <= FEW { PyArray1::from_slice(py, &column) } else { PyArray1::from_vec(py, column) };
    columns.set_item(name, array)
}

fn put_table<T: Element>(
    columns: &Bound<'_, PyDict>,
    name: &Bound<'_, PyString>,
    column: Option<Vec<T>>,
    width: usize,
) -> PyResult<()> {
    let Some(column) = column else { return Ok(()) };
    let rows = column.len() / width;
    let py = columns.py();
    let is_small = column.len() <= FEW;
    let table = Array2::from_shape_vec((rows, width), column).map_err(invalid)?;
    let array =
        if is_small { PyArray2::from_array(py, &table) } else { PyArray2::from_owned_array(py, table) };
    columns.set_item(name, array)
}

/// The rows of a range of rays.
#[derive(Default)]
pub(crate) struct Columns<'a, T> {
    /// The first ray.
    pub first: usize,
    /// How many.
    pub count: usize,
    pub t: Option<&'a mut [T]>,
    pub point: Option<&'a mut [T]>,
    pub normal: Option<&'a mut [T]>,
    pub uv: Option<&'a mut [T]>,
    pub front: Option<&'a mut [bool]>,
    pub shape: Option<&'a mut [i32]>,
    pub prim: Option<&'a mut [i32]>,
    pub instance: Option<&'a mut [i32]>,
}

/// A row.
#[derive(Clone, Copy)]
pub(crate) struct Row {
    pub t: f64,
    pub point: DVec3,
    pub normal: DVec3,
    pub uv: [f64; 2],
    pub front: bool,
    pub shape: i32,
    pub prim: i32,
    pub instance: i32,
}

impl Row {
    /// That of a ray that hits nothing.
    pub(crate) const MISS: Self = Self {
        t: f64::INFINITY,
        point: DVec3::NAN,
        normal: DVec3::NAN,
        uv: [f64::NAN; 2],
        front: false,
        shape: NONE,
        prim: NONE,
        instance: NONE,
    };
}

impl<'py, T: Real> Outputs<'py, T> {
    /// The arrays of `out` by their names.
    pub(crate) fn new(out: &Bound<'py, PyDict>, count: usize) -> PyResult<Self> {
        Ok(Self {
            t: column(out, "t", count)?,
            point: table(out, "point", count, 3)?,
            normal: table(out, "normal", count, 3)?,
            uv: table(out, "uv", count, 2)?,
            front: column(out, "front", count)?,
            shape: column(out, "shape", count)?,
            prim: column(out, "prim", count)?,
            instance: column(out, "instance", count)?,
        })
    }

    pub(crate) fn columns(&mut self, count: usize) -> PyResult<Columns<'_, T>> {
        Ok(Columns {
            first: 0,
            count,
            t: slice(&mut self.t)?,
            point: slice(&mut self.point)?,
            normal: slice(&mut self.normal)?,
            uv: slice(&mut self.uv)?,
            front: slice(&mut self.front)?,
            shape: slice(&mut self.shape)?,
            prim: slice(&mut self.prim)?,
            instance: slice(&mut self.instance)?,
        })
    }
}

fn column<'py, T: Element>(
    out: &Bound<'py, PyDict>,
    name: &str,
    count: usize,
) -> PyResult<Option<PyReadwriteArray1<'py, T>>> {
    let Some(array) = out.get_item(name)? else { return Ok(None) };
    let array: PyReadwriteArray1<'py, T> = array.extract().map_err(|e| wrong(name, &e))?;
    if array.len() == count {
        return Ok(Some(array));
    }
    Err(invalid(format!("out: {name} has the wrong length (found {}; expected {count})", array.len())))
}

fn table<'py, T: Element>(
    out: &Bound<'py, PyDict>,
    name: &str,
    count: usize,
    width: usize,
) -> PyResult<Option<PyReadwriteArray2<'py, T>>> {
    let Some(array) = out.get_item(name)? else { return Ok(None) };
    let array: PyReadwriteArray2<'py, T> = array.extract().map_err(|e| wrong(name, &e))?;
    if *array.shape() == [count, width] {
        return Ok(Some(array));
    }
    let found = tuple(array.shape());
    Err(invalid(format!("out: {name} has the wrong shape (found {found}; expected ({count}, {width}))")))
}

fn wrong(name: &str, error: &PyErr) -> PyErr {
    invalid(format!("out: {name}: {error}"))
}

fn slice<'a, T: Element, D: numpy::ndarray::Dimension>(
    array: &'a mut Option<numpy::PyReadwriteArray<'_, T, D>>,
) -> PyResult<Option<&'a mut [T]>> {
    let Some(array) = array else { return Ok(None) };
    if !array.is_c_contiguous() {
        return Err(invalid("out: an array is not contiguous (expected C order, without gaps)"));
    }
    Ok(Some(array.as_slice_mut()?))
}

impl<'a, T: Real> Columns<'a, T> {
    /// The same rows in pieces of this many rays.
    pub(crate) fn pieces(mut self, size: usize) -> PyResult<Vec<Self>> {
        let mut pieces = list(self.count.div_ceil(size).max(1))?;
        while self.count > size {
            let rest = self.split_off(size);
            pieces.push(std::mem::replace(&mut self, rest));
        }
        pieces.push(self);
        Ok(pieces)
    }

    /// Keeps the first rays, and returns the others.
    fn split_off(&mut self, at: usize) -> Self {
        let rest = Self {
            first: self.first + at,
            count: self.count - at,
            t: tail(&mut self.t, at),
            point: tail(&mut self.point, 3 * at),
            normal: tail(&mut self.normal, 3 * at),
            uv: tail(&mut self.uv, 2 * at),
            front: tail(&mut self.front, at),
            shape: tail(&mut self.shape, at),
            prim: tail(&mut self.prim, at),
            instance: tail(&mut self.instance, at),
        };
        self.count = at;
        rest
    }

    /// The rays of these rows.
    pub(crate) fn range(&self) -> Range<usize> {
        self.first..self.first + self.count
    }

    /// Whether anything requested needs the surface.
    pub(crate) fn wants_surface(&self) -> bool {
        self.point.is_some() || self.normal.is_some() || self.uv.is_some() || self.front.is_some()
    }

    pub(crate) fn write(&mut self, row: usize, values: &Row) {
        let rounded = T::rounded;
        if let Some(t) = &mut self.t {
            t[row] = rounded(values.t);
        }
        if let Some(point) = &mut self.point {
            point[3 * row..3 * row + 3].copy_from_slice(&values.point.to_array().map(rounded));
        }
        if let Some(normal) = &mut self.normal {
            normal[3 * row..3 * row + 3].copy_from_slice(&values.normal.to_array().map(rounded));
        }
        if let Some(uv) = &mut self.uv {
            uv[2 * row..2 * row + 2].copy_from_slice(&values.uv.map(rounded));
        }
        if let Some(front) = &mut self.front {
            front[row] = values.front;
        }
        if let Some(shape) = &mut self.shape {
            shape[row] = values.shape;
        }
        if let Some(prim) = &mut self.prim {
            prim[row] = values.prim;
        }
        if let Some(instance) = &mut self.instance {
            instance[row] = values.instance;
        }
    }
}

/// What is behind a place of a list, which keeps what is before it.
fn tail<'a, T>(list: &mut Option<&'a mut [T]>, at: usize) -> Option<&'a mut [T]> {
    let (head, tail) = list.take()?.split_at_mut(at);
    *list = Some(head);
    Some(tail)
}
