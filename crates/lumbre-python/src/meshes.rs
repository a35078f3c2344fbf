//! The meshes of a scene as arrays.

use std::sync::Arc;

use lumbre::description::{GeometryDesc, InstanceDesc, MeshDesc, Placement, ShapeDesc};
use lumbre::math::{DMat4, Vec3};
use lumbre::{SceneDesc, Transform};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;

use crate::errors::list;

/// A mesh in one of its places. Its arrays are made when they are asked for.
#[pyclass(frozen, module = "lumbre._lumbre")]
pub(crate) struct PlacedMesh {
    mesh: Arc<MeshDesc>,
    world_from_object: Transform,
    /// Whether faces are to be reversed, so that they run counter-clockwise from their front.
    is_turned: bool,
    shape: u32,
    instance: Option<u32>,
}

#[pymethods]
impl PlacedMesh {
    /// The number of its shape, and of the outermost instance that it is in.
    fn place(&self) -> (u32, Option<u32>) {
        (self.shape, self.instance)
    }

    /// Its place: world from object, row by row.
    fn transform(&self) -> [[f64; 4]; 4] {
        DMat4::from(*self.world_from_object.affine()).transpose().to_cols_array_2d()
    }

    /// (V, 3) places in the world.
    fn vertices<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let map = &self.world_from_object;
        match &self.mesh.precise_positions {
            Some(precise) => table(py, precise.len(), precise.iter().map(|&p| map.point(p).to_array())),
            None => {
                let places = &self.mesh.positions;
                table(py, places.len(), places.iter().map(|p| map.point(p.as_dvec3()).to_array()))
            }
        }
    }

    /// (F, 3) triangles; quads are two, after the others.
    fn faces<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<i64>>> {
        let MeshDesc { triangles, quads, .. } = &*self.mesh;
        let halves = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
        let corners = triangles.iter().copied().chain(halves);
        let turned = corners.map(|[a, b, c]| if self.is_turned { [a, c, b] } else { [a, b, c] });
        table(py, triangles.len() + 2 * quads.len(), turned.map(|face| face.map(i64::from)))
    }

    /// (V, 3) unit vectors in the world.
    fn normals<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        let Some(normals) = &self.mesh.normals else { return Ok(None) };
        let unit = |n: &Vec3| {
            let normal = self.world_from_object.normal(n.as_dvec3());
            normal.try_normalize().unwrap_or_default().to_array()
        };
        table(py, normals.len(), normals.iter().map(unit)).map(Some)
    }

    /// (V, 2) texture coordinates.
    fn uvs<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        let Some(uvs) = &self.mesh.uvs else { return Ok(None) };
        table(py, uvs.len(), uvs.iter().map(|uv| uv.as_dvec2().to_array())).map(Some)
    }
}

fn table<'py, const N: usize, T: numpy::Element>(
    py: Python<'py>,
    count: usize,
    rows: impl Iterator<Item = [T; N]>,
) -> PyResult<Bound<'py, PyArray2<T>>> {
    let mut numbers = list(N * count)?;
    numbers.extend(rows.flatten());
    PyArray1::from_vec(py, numbers).reshape([count, N])
}

/// The meshes of a description, by shape, those of instances in each of their places.
pub(crate) fn meshes(desc: &SceneDesc) -> Vec<PlacedMesh> {
    let mut found = Vec::new();
    add(&desc.shapes, &Transform::IDENTITY, None, &mut found);
    for (number, instance) in (0..).zip(&desc.instances) {
        add_instance(desc, instance, &Transform::IDENTITY, number, &mut found);
    }
    found
}

fn add_instance(
    desc: &SceneDesc,
    instance: &InstanceDesc,
    outer: &Transform,
    number: u32,
    found: &mut Vec<PlacedMesh>,
) {
    let place = match &instance.world_from_object {
        Placement::Still(place) => *place,
        // Where it is when the exposure begins.
        Placement::Moving(motion) => {
            motion.at(desc.cameras.first().map_or(0.0, |camera| camera.shutter_open))
        }
    };
    let Some(object) = desc.objects.get(instance.object.0 as usize) else { return };
    let place = *outer * place;
    add(&object.shapes, &place, Some(number), found);
    for inner in &object.instances {
        add_instance(desc, inner, &place, number, found);
    }
}

fn add(shapes: &[ShapeDesc], outer: &Transform, instance: Option<u32>, found: &mut Vec<PlacedMesh>) {
    for shape in shapes {
        let GeometryDesc::Mesh(mesh) = &shape.geometry else { continue };
        let world_from_object = *outer * shape.world_from_object;
        let is_turned = world_from_object.is_mirror() != shape.reverse_orientation;
        let (mesh, shape) = (Arc::clone(mesh), shape.index);
        found.push(PlacedMesh { mesh, world_from_object, is_turned, shape, instance });
    }
}
