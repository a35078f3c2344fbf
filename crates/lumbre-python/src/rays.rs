//! Rays and points as Python has them: numpy arrays of either precision, in any order, read where they lie.

use std::ops::Range;

use lumbre::{DVec3, Ray};
use numpy::ndarray::{ArrayView1, ArrayView2};
use numpy::{
    PyArray2, PyArrayDescrMethods, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use crate::errors::invalid;

/// The precision of an array's numbers. All is computed in double precision; answers are rounded once.
pub(crate) trait Real: numpy::Element + Copy + Send + Sync {
    /// In double precision, exactly.
    fn widened(self) -> f64;
    /// The nearest number of this precision.
    fn rounded(x: f64) -> Self;
}

impl Real for f64 {
    fn widened(self) -> f64 {
        self
    }

    fn rounded(x: f64) -> Self {
        x
    }
}

impl Real for f32 {
    fn widened(self) -> f64 {
        self.into()
    }

    fn rounded(x: f64) -> Self {
        x as Self
    }
}

/// An array of points or directions, (N, 3).
pub(crate) struct Triples<'py, T: Real>(PyReadonlyArray2<'py, T>);

impl<'py, T: Real> Triples<'py, T> {
    /// An array that is ready to be read; `None` for what Python has to look at first.
    pub(crate) fn ready(array: &Bound<'py, PyAny>) -> Option<Self> {
        let array: PyReadonlyArray2<'py, T> = array.extract().ok()?;
        (is_aligned(&array) && array.shape()[1] == 3).then_some(Self(array))
    }

    pub(crate) fn new(name: &str, array: &Bound<'py, PyAny>) -> PyResult<Self> {
        let array: PyReadonlyArray2<'py, T> = array.extract()?;
        let &[count, width] = array.shape() else { return Err(invalid(format!("{name} has no two axes"))) };
        if width != 3 {
            return Err(invalid(format!(
                "{name} has the wrong shape (found ({count}, {width}); expected ({count}, 3))"
            )));
        }
        Ok(Self(array))
    }

    pub(crate) fn view(&self) -> ArrayView2<'_, T> {
        self.0.as_array()
    }

    pub(crate) fn len(&self) -> usize {
        self.0.shape()[0]
    }
}

fn is_aligned<T: Real>(array: &Bound<'_, PyArray2<T>>) -> bool {
    let is_whole = |stride: &isize| stride.unsigned_abs().is_multiple_of(size_of::<T>());
    array.strides().iter().all(is_whole) && array.data().is_aligned()
}

/// The ray of arrays that are ready to be read and have one; `None` for others. Its numbers are copied, for to borrow
/// the arrays takes longer than the ray.
pub(crate) fn single<T: Real>(
    origins: &Bound<'_, PyAny>,
    directions: &Bound<'_, PyAny>,
    t_min: f64,
    t_max: f64,
) -> Option<Ray> {
    let only = |array: &Bound<'_, PyAny>| {
        let array = array.cast::<PyArray2<T>>().ok()?;
        if array.shape() != [1, 3] || !is_aligned(array) {
            return None;
        }
        let at = |column| array.get_owned([0, column]).map(T::widened);
        Some(DVec3::new(at(0)?, at(1)?, at(2)?))
    };
    Some(Ray::new(only(origins)?, only(directions)?).with_range(t_min, t_max))
}

/// The triple in this row.
pub(crate) fn triple<T: Real>(view: &ArrayView2<'_, T>, row: usize) -> DVec3 {
    DVec3::new(view[[row, 0]].widened(), view[[row, 1]].widened(), view[[row, 2]].widened())
}

/// One number for all rays, or one for each.
pub(crate) enum Limit<'py, T: Real> {
    All(f64),
    Each(PyReadonlyArray1<'py, T>),
}

/// A [`Limit`] without the interpreter.
#[derive(Clone, Copy)]
enum LimitView<'a, T> {
    All(f64),
    Each(ArrayView1<'a, T>),
}

impl<'py, T: Real> Limit<'py, T> {
    pub(crate) fn new(name: &str, limit: &Bound<'py, PyAny>, count: usize) -> PyResult<Self> {
        if let Ok(number) = limit.extract::<f64>() {
            return Ok(Self::All(number));
        }
        let array: PyReadonlyArray1<'py, T> = limit.extract()?;
        if array.len() == count {
            return Ok(Self::Each(array));
        }
        Err(invalid(format!("{name} has the wrong length (found {}; expected {count})", array.len())))
    }

    fn view(&self) -> LimitView<'_, T> {
        match self {
            Self::All(number) => LimitView::All(*number),
            Self::Each(array) => LimitView::Each(array.as_array()),
        }
    }
}

impl<T: Real> LimitView<'_, T> {
    fn at(&self, ray: usize) -> f64 {
        match self {
            Self::All(number) => *number,
            Self::Each(array) => array[ray].widened(),
        }
    }
}

/// The arrays of a list of rays.
pub(crate) struct Rays<'py, T: Real> {
    origins: Triples<'py, T>,
    directions: Triples<'py, T>,
    t_min: Limit<'py, T>,
    t_max: Limit<'py, T>,
}

impl<'py, T: Real> Rays<'py, T> {
    pub(crate) fn new(
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        t_min: &Bound<'py, PyAny>,
        t_max: &Bound<'py, PyAny>,
    ) -> PyResult<Self> {
        let (origins, directions) =
            (Triples::new("origins", origins)?, Triples::new("directions", directions)?);
        let count = origins.len();
        if directions.len() != count {
            return Err(invalid(format!(
                "there are {count} origins and {} directions (expected as many)",
                directions.len()
            )));
        }
        let (t_min, t_max) = (Limit::new("tmin", t_min, count)?, Limit::new("tmax", t_max, count)?);
        Ok(Self { origins, directions, t_min, t_max })
    }

    /// Rays whose arrays are ready to be read, within one range; `None` for what Python has to look at first.
    pub(crate) fn ready(
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        t_min: f64,
        t_max: f64,
    ) -> Option<Self> {
        let (origins, directions) = (Triples::ready(origins)?, Triples::ready(directions)?);
        let (t_min, t_max) = (Limit::All(t_min), Limit::All(t_max));
        (origins.len() == directions.len()).then_some(Self { origins, directions, t_min, t_max })
    }

    pub(crate) fn view(&self) -> RaysView<'_, T> {
        RaysView {
            origins: self.origins.view(),
            directions: self.directions.view(),
            t_min: self.t_min.view(),
            t_max: self.t_max.view(),
        }
    }
}

/// [`Rays`] without the interpreter.
pub(crate) struct RaysView<'a, T> {
    origins: ArrayView2<'a, T>,
    directions: ArrayView2<'a, T>,
    t_min: LimitView<'a, T>,
    t_max: LimitView<'a, T>,
}

impl<T: Real> RaysView<'_, T> {
    pub(crate) fn len(&self) -> usize {
        self.origins.nrows()
    }

    pub(crate) fn ray(&self, number: usize) -> Ray {
        Ray::new(triple(&self.origins, number), triple(&self.directions, number))
            .with_range(self.t_min.at(number), self.t_max.at(number))
    }

    pub(crate) fn read(&self, range: Range<usize>) -> Vec<Ray> {
        range.map(|number| self.ray(number)).collect()
    }
}

/// Whether an array is of single precision; Python hands over no other than single and double.
pub(crate) fn is_single(array: &Bound<'_, PyAny>) -> PyResult<bool> {
    let array = array.cast::<numpy::PyUntypedArray>()?;
    Ok(array.dtype().is_equiv_to(&numpy::dtype::<f32>(array.py())))
}
