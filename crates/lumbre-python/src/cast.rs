//! Ray queries of arrays.

use std::ops::ControlFlow;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::atomic::{AtomicBool, AtomicU64};

use lumbre::description::Footprint;
use lumbre::kernel::Hit;
use lumbre::{CastHit, Ray, Scene};
use lumbre_cli::memory_left;
use numpy::{PyArray1, PyArrayMethods, PyReadwriteArray1};
use pyo3::exceptions::PyMemoryError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use rayon::prelude::*;

use crate::columns::{Columns, Fresh, NONE, Outputs, Row};
use crate::errors::{filled, invalid, list};
use crate::rays::{Rays, Real};
use crate::work::{Stop, interruptible, pool};

/// Rays that a thread takes at a time: enough for the batches of the kernel, and soon done.
pub(crate) const PIECE: usize = 4096;
/// The least that is worth the way to another thread.
const LEAST: usize = 256;
/// So few are not worth waking threads for.
const FEW: usize = 256;
/// The answers of more rays are arrays that Python makes, which knows how much memory there is.
const MAX_FRESH: usize = 1 << 16;

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
    let pieces = outputs.columns(count)?.pieces(piece_size(count)?)?;
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
    if count > MAX_FRESH {
        return Ok(None);
    }
    let Some(mut fresh) = Fresh::<T>::new(fields, count)? else { return Ok(None) };
    let pieces = fresh.columns(count).pieces(piece_size(count)?)?;
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

/// The same as a new array; `None` where it is for Python to make.
pub(crate) fn any_fresh<'py, T: Real>(
    py: Python<'py>,
    scene: &Scene,
    rays: &Rays<'_, T>,
) -> PyResult<Option<Bound<'py, PyArray1<bool>>>> {
    let count = rays.view().len();
    if count > MAX_FRESH {
        return Ok(None);
    }
    let mut out = filled(false, count)?;
    any_into(py, scene, rays, &mut out)?;
    Ok(Some(PyArray1::from_vec(py, out)))
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
    let mut pieces = list(count.div_ceil(size))?;
    pieces.extend(out.chunks_mut(size).enumerate());
    each_piece(py, count, pieces, |(number, piece): (usize, &mut [O])| work(number * size, piece))
}

/// Every hit of every ray by ascending t: its columns by name, and `offsets`, by which those of ray i are
/// `offsets[i]..offsets[i + 1]`.
pub(crate) fn all<'py, T: Real>(
    py: Python<'py>,
    scene: &Scene,
    rays: &Rays<'_, T>,
) -> PyResult<Bound<'py, PyDict>> {
    let rays = rays.view();
    let count = rays.len();
    let size = piece_size(count)?;
    let mut found: Vec<(Vec<CastHit>, Vec<i64>)> = filled(Default::default(), count.div_ceil(size))?;
    let mut pieces = list(found.len())?;
    pieces.extend(found.iter_mut().enumerate());
    // The hits themselves, and the columns that are made of them.
    let left = memory_left();
    let most = left / (size_of::<CastHit>() + 8 * size_of::<T>() + 3 * size_of::<i32>() + 1) as u64;
    let (held, is_full) = (AtomicU64::new(0), AtomicBool::new(false));
    each_piece(py, count, pieces, |(number, (hits, ends))| {
        let rays_of_piece = number * size..count.min((number + 1) * size);
        if ends.try_reserve_exact(rays_of_piece.len()).is_err() {
            is_full.store(true, Relaxed);
        }
        for ray in rays_of_piece {
            if is_full.load(Relaxed) {
                return;
            }
            let before = hits.len();
            scene.all(&rays.ray(ray), |hit| {
                let is_beyond = (hits.len() - before) as u64 >= most;
                if is_beyond || hits.try_reserve(1).is_err() {
                    is_full.store(true, Relaxed);
                    return ControlFlow::Break(());
                }
                hits.push(hit);
                ControlFlow::Continue(())
            });
            let more = (hits.len() - before) as u64;
            if held.fetch_add(more, Relaxed).saturating_add(more) > most {
                is_full.store(true, Relaxed);
            }
            ends.push(hits.len() as i64);
        }
    })?;
    if is_full.into_inner() {
        return Err(PyMemoryError::new_err(format!(
            "the hits of {count} rays do not fit into {left} bytes of memory (cast fewer rays at a time)"
        )));
    }
    let mut offsets = list(count.saturating_add(1))?;
    offsets.push(0);
    let mut before = 0;
    for (hits, ends) in &found {
        offsets.extend(ends.iter().map(|end| before + end));
        before += hits.len() as i64;
    }
    let all = before as usize;
    let hits = || found.iter().flat_map(|(hits, _)| hits);
    let columns = PyDict::new(py);
    columns.set_item("offsets", PyArray1::from_vec(py, offsets))?;
    let number = |of: fn(&CastHit) -> i64| column(py, all, hits().map(|hit| of(hit) as i32));
    let table = |width: usize, of: fn(&CastHit) -> [f64; 3]| {
        let rows = hits().flat_map(|hit| of(hit).into_iter().take(width).map(T::rounded));
        column(py, all * width, rows)?.reshape([all, width])
    };
    columns.set_item("t", column(py, all, hits().map(|hit| T::rounded(hit.t)))?)?;
    columns.set_item("point", table(3, |hit| hit.point.to_array())?)?;
    columns.set_item("normal", table(3, |hit| hit.normal.to_array())?)?;
    columns.set_item("uv", table(2, |hit| [hit.uv.x, hit.uv.y, 0.0])?)?;
    columns.set_item("front", column(py, all, hits().map(|hit| hit.front))?)?;
    columns.set_item("shape", number(|hit| hit.shape.into())?)?;
    columns.set_item("prim", number(|hit| hit.primitive.into())?)?;
    columns.set_item("instance", number(|hit| hit.instance.map_or(NONE.into(), i64::from))?)?;
    Ok(columns)
}

/// An array of `count` numbers.
fn column<'py, N: numpy::Element>(
    py: Python<'py>,
    count: usize,
    numbers: impl Iterator<Item = N>,
) -> PyResult<Bound<'py, PyArray1<N>>> {
    let mut column = list(count)?;
    column.extend(numbers);
    Ok(PyArray1::from_vec(py, column))
}
