//! Ray queries of arrays.

use std::ops::ControlFlow;

use lumbre::description::Footprint;
use lumbre::kernel::Hit;
use lumbre::{CastHit, Ray, Scene};
use numpy::{PyArray1, PyArrayMethods, PyReadwriteArray1};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use rayon::prelude::*;

use crate::columns::{Columns, Fresh, NONE, Outputs, Row};
use crate::errors::invalid;
use crate::rays::{Rays, Real};
use crate::work::{Stop, interruptible, pool};

/// Rays that a thread takes at a time: enough for the batches of the kernel, and soon done.
pub(crate) const PIECE: usize = 4096;
/// The least that is worth the way to another thread.
const LEAST: usize = 256;
/// So few are not worth waking threads for.
const FEW: usize = 256;

/// Into how large pieces to cut a list, so that all threads have work to its end.
pub(crate) fn piece_size(count: usize) -> PyResult<usize> {
    Ok(if count <= FEW { FEW } else { (count / (4 * pool()?.current_num_threads())).clamp(LEAST, PIECE) })
}

/// Does `work` for every piece: here where there are few rays, else on all threads without the interpreter's lock.
pub(crate) fn each_piece<P: Send>(
    py: Python<'_>,
    count: usize,
    pieces: Vec<P>,
    work: impl Fn(P) + Send + Sync,
) -> PyResult<()> {
    if count <= FEW {
        pieces.into_iter().for_each(work);
        return Ok(());
    }
    let all = |stop: &Stop| {
        pieces.into_par_iter().for_each(|piece| {
            if !stop.is_asked_for() {
                work(piece);
            }
        });
    };
    interruptible(py, all, |_| Ok(()))
}

/// The closest hit of every ray, into the arrays of `out`.
pub(crate) fn closest<T: Real>(
    py: Python<'_>,
    scene: &Scene,
    rays: &Rays<'_, T>,
    out: &Bound<'_, PyDict>,
) -> PyResult<()> {
    let rays = rays.view();
    let count = rays.len();
    let mut outputs = Outputs::<T>::new(out, count)?;
    let pieces = outputs.columns(count)?.pieces(piece_size(count)?);
    each_piece(py, count, pieces, |mut piece| closest_of(scene, &rays.read(piece.range()), &mut piece))
}

/// The same into arrays that are made here; `None` where a field is none.
pub(crate) fn closest_fresh<'py, T: Real>(
    py: Python<'py>,
    scene: &Scene,
    rays: &Rays<'_, T>,
    fields: &Bound<'_, PyTuple>,
) -> PyResult<Option<Bound<'py, PyDict>>> {
    let rays = rays.view();
    let count = rays.len();
    let Some(mut fresh) = Fresh::<T>::new(fields, count)? else { return Ok(None) };
    let pieces = fresh.columns(count).pieces(piece_size(count)?);
    each_piece(py, count, pieces, |mut piece| closest_of(scene, &rays.read(piece.range()), &mut piece))?;
    fresh.into_dict(py).map(Some)
}

/// The same of one ray.
pub(crate) fn closest_single<'py, T: Real>(
    py: Python<'py>,
    scene: &Scene,
    ray: Ray,
    fields: &Bound<'_, PyTuple>,
) -> PyResult<Option<Bound<'py, PyDict>>> {
    let Some(mut fresh) = Fresh::<T>::new(fields, 1)? else { return Ok(None) };
    closest_of(scene, &[ray], &mut fresh.columns(1));
    fresh.into_dict(py).map(Some)
}

fn closest_of<T: Real>(scene: &Scene, rays: &[Ray], out: &mut Columns<'_, T>) {
    let mut hits = vec![None; rays.len()];
    match (rays, &mut hits[..]) {
        ([ray], [hit]) => *hit = scene.resolved().accel().closest(ray),
        _ => scene.resolved().accel().closest_batch(rays, &mut hits),
    }
    let wants_surface = out.wants_surface();
    for (row, (ray, hit)) in rays.iter().zip(&hits).enumerate() {
        let values = hit.as_ref().map_or(Row::MISS, |hit| row_of(scene, ray, hit, wants_surface));
        out.write(row, &values);
    }
}

fn row_of(scene: &Scene, ray: &Ray, hit: &Hit, wants_surface: bool) -> Row {
    let resolved = scene.resolved();
    let row = Row {
        t: hit.root.t,
        shape: resolved.shape_index(hit) as i32,
        prim: resolved.primitive_index(hit) as i32,
        instance: hit.instances.first().map_or(NONE, |instance| *instance as i32),
        ..Row::MISS
    };
    if !wants_surface {
        return row;
    }
    let at = resolved.interaction(ray, hit, &Footprint::Point);
    let surface = at.surface;
    Row { point: surface.point, normal: surface.normal, uv: surface.uv.to_array(), front: at.front, ..row }
}

/// Whether anything is hit, for every ray.
pub(crate) fn any<T: Real>(
    py: Python<'_>,
    scene: &Scene,
    rays: &Rays<'_, T>,
    out: &Bound<'_, PyAny>,
) -> PyResult<()> {
    let mut out: PyReadwriteArray1<'_, bool> = out.extract()?;
    any_into(py, scene, rays, out.as_slice_mut()?)
}

/// The same as a new array.
pub(crate) fn any_fresh<'py, T: Real>(
    py: Python<'py>,
    scene: &Scene,
    rays: &Rays<'_, T>,
) -> PyResult<Bound<'py, PyArray1<bool>>> {
    let mut out = vec![false; rays.view().len()];
    any_into(py, scene, rays, &mut out)?;
    Ok(PyArray1::from_vec(py, out))
}

fn any_into<T: Real>(py: Python<'_>, scene: &Scene, rays: &Rays<'_, T>, out: &mut [bool]) -> PyResult<()> {
    let rays = rays.view();
    fill(py, out, rays.len(), |first, out| {
        let rays = rays.read(first..first + out.len());
        scene.resolved().accel().any_batch(&rays, out);
    })
}

/// The number of hits of every ray.
pub(crate) fn count<T: Real>(
    py: Python<'_>,
    scene: &Scene,
    rays: &Rays<'_, T>,
    out: &Bound<'_, PyAny>,
) -> PyResult<()> {
    let rays = rays.view();
    each_chunk::<i64>(py, out, rays.len(), |first, out| {
        for (number, out) in (first..).zip(out) {
            *out = scene.count(&rays.ray(number)) as i64;
        }
    })
}

/// Fills an array of one number a row in pieces, each by the number of its first row.
pub(crate) fn each_chunk<O: numpy::Element + Send>(
    py: Python<'_>,
    out: &Bound<'_, PyAny>,
    count: usize,
    work: impl Fn(usize, &mut [O]) + Send + Sync,
) -> PyResult<()> {
    let mut out: PyReadwriteArray1<'_, O> = out.extract()?;
    fill(py, out.as_slice_mut()?, count, work)
}

fn fill<O: Send>(
    py: Python<'_>,
    out: &mut [O],
    count: usize,
    work: impl Fn(usize, &mut [O]) + Send + Sync,
) -> PyResult<()> {
    if out.len() != count {
        return Err(invalid(format!("out has the wrong length (found {}; expected {count})", out.len())));
    }
    let size = piece_size(count)?;
    let pieces = out.chunks_mut(size).enumerate().collect();
    each_piece(py, count, pieces, |(number, piece): (usize, &mut [O])| work(number * size, piece))
}

/// Every hit of every ray by ascending t: its columns by name, and `offsets`, by which those of ray i are `offsets[i]..offsets[i + 1]`.
pub(crate) fn all<'py, T: Real>(
    py: Python<'py>,
    scene: &Scene,
    rays: &Rays<'_, T>,
) -> PyResult<Bound<'py, PyDict>> {
    let rays = rays.view();
    let count = rays.len();
    let size = piece_size(count)?;
    let mut found: Vec<(Vec<CastHit>, Vec<i64>)> = vec![Default::default(); count.div_ceil(size)];
    let pieces = found.iter_mut().enumerate().collect();
    each_piece(py, count, pieces, |(number, (hits, ends))| {
        for ray in number * size..count.min((number + 1) * size) {
            scene.all(&rays.ray(ray), |hit| {
                hits.push(hit);
                ControlFlow::Continue(())
            });
            ends.push(hits.len() as i64);
        }
    })?;
    let mut offsets = Vec::with_capacity(count + 1);
    offsets.push(0);
    let mut before = 0;
    for (hits, ends) in &found {
        offsets.extend(ends.iter().map(|end| before + end));
        before += hits.len() as i64;
    }
    let hits = || found.iter().flat_map(|(hits, _)| hits);
    let columns = PyDict::new(py);
    columns.set_item("offsets", PyArray1::from_vec(py, offsets))?;
    let number = |of: fn(&CastHit) -> i64| PyArray1::from_iter(py, hits().map(|hit| of(hit) as i32));
    let table = |width: usize, of: fn(&CastHit) -> [f64; 3]| {
        let rows = hits().flat_map(|hit| of(hit).into_iter().take(width).map(T::rounded));
        PyArray1::from_vec(py, rows.collect()).reshape([before as usize, width])
    };
    columns.set_item("t", PyArray1::from_iter(py, hits().map(|hit| T::rounded(hit.t))))?;
    columns.set_item("point", table(3, |hit| hit.point.to_array())?)?;
    columns.set_item("normal", table(3, |hit| hit.normal.to_array())?)?;
    columns.set_item("uv", table(2, |hit| [hit.uv.x, hit.uv.y, 0.0])?)?;
    columns.set_item("front", PyArray1::from_iter(py, hits().map(|hit| hit.front)))?;
    columns.set_item("shape", number(|hit| hit.shape.into()))?;
    columns.set_item("prim", number(|hit| hit.primitive.into()))?;
    columns.set_item("instance", number(|hit| hit.instance.map_or(NONE.into(), i64::from)))?;
    Ok(columns)
}
