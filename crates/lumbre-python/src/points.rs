//! Point queries of arrays.

use std::sync::Mutex;

use lumbre::{Error, Scene};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::cast::{each_chunk, each_piece, piece_size};
use crate::columns::{NONE, Outputs, Row};
use crate::errors::raised;
use crate::rays::{Real, Triples, triple};

/// The first error of many threads.
#[derive(Default)]
struct First(Mutex<Option<Error>>);

impl First {
    fn keep(&self, error: Error) {
        if let Ok(mut first) = self.0.lock() {
            first.get_or_insert(error);
        }
    }

    fn result(self) -> PyResult<()> {
        match self.0.into_inner() {
            Ok(Some(error)) => Err(raised(error)),
            _ => Ok(()),
        }
    }
}

/// The nearest point of all surfaces, for every point: its distance as `t`, and the columns of a hit that have a
/// meaning here. A point that has no answer has nan for distance; then it says why the first of them has none.
pub(crate) fn closest<T: Real>(
    py: Python<'_>,
    scene: &Scene,
    points: &Triples<'_, T>,
    max_distance: f64,
    out: &Bound<'_, PyDict>,
) -> PyResult<Option<String>> {
    const UNKNOWN: Row = Row { t: f64::NAN, ..Row::MISS };
    let (points, count) = (points.view(), points.len());
    let mut outputs = Outputs::<T>::new(out, count)?;
    let pieces = outputs.columns(count)?.pieces(piece_size(count)?)?;
    let first = First::default();
    each_piece(py, count, pieces, |mut piece| {
        for (row, number) in piece.range().enumerate() {
            let values = match scene.closest_point(triple(&points, number), max_distance) {
                Ok(None) => Row::MISS,
                Ok(Some(found)) => Row {
                    t: found.distance,
                    point: found.point,
                    shape: found.shape as i32,
                    prim: found.primitive as i32,
                    instance: found.instance.map_or(NONE, |instance| instance as i32),
                    ..Row::MISS
                },
                Err(error) => {
                    first.keep(error);
                    UNKNOWN
                }
            };
            piece.write(row, &values);
        }
    })?;
    Ok(first.0.into_inner().ok().flatten().map(|error| error.to_string()))
}

/// Whether every point is inside of what stands here, even-odd.
pub(crate) fn inside<T: Real>(
    py: Python<'_>,
    scene: &Scene,
    points: &Triples<'_, T>,
    out: &Bound<'_, PyAny>,
) -> PyResult<()> {
    let (points, count) = (points.view(), points.len());
    each_chunk::<bool>(py, out, count, |first, out| {
        for (number, out) in (first..).zip(out) {
            *out = scene.is_inside(triple(&points, number));
        }
    })
}

/// How often surfaces wind around every point.
pub(crate) fn winding_number<T: Real>(
    py: Python<'_>,
    scene: &Scene,
    points: &Triples<'_, T>,
    out: &Bound<'_, PyArray1<T>>,
) -> PyResult<()> {
    let (points, count) = (points.view(), points.len());
    let errors = First::default();
    each_chunk::<T>(py, out, count, |first, out| {
        for (number, out) in (first..).zip(out) {
            match scene.winding_number(triple(&points, number)) {
                Ok(winding) => *out = T::rounded(winding),
                Err(error) => return errors.keep(error),
            }
        }
    })?;
    errors.result()
}
