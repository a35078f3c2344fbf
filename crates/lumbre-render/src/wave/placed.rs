//! Triangles in instances, taken into the world, so that the stages for triangles of top-level meshes serve them.

use lumbre_kernel::{Accel, PictureRounding};
use lumbre_math::{DVec3, Transform};
use lumbre_simd::{Double, Real, V3};

use crate::wave::flat::{FlatHits, put_corners};
use crate::wave::paths::grow;

/// The instances around triangles, in columns.
#[derive(Debug, Default)]
pub(crate) struct Placements {
    /// Their positions in the tree.
    instances: Vec<u32>,
    /// What the points are wrong by because they were mapped, and by the rounding of rays in the instance.
    error: [Vec<f64>; 3],
    /// −1 where a mirror swaps the sides of the corners.
    side: Vec<f32>,
}

impl Placements {
    pub(crate) fn clear(&mut self) {
        self.instances.clear();
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.instances.is_empty()
    }

    /// Appends the instance of the next triangle, which stands still.
    pub(crate) fn push(&mut self, instance: u32) {
        self.instances.push(instance);
    }

    /// The map of a triangle's instance; `None` for those of top-level meshes.
    pub(crate) fn map<'s>(&self, accel: &'s Accel, at: usize) -> Option<&'s Transform> {
        Some(accel.still_instance(*self.instances.get(at)?)?.0)
    }

    /// Takes the corners of triangles and the normals there from their instances into the world.
    pub(crate) fn apply(
        &mut self,
        accel: &Accel,
        is_single: bool,
        hits: &mut FlatHits,
        normals: &mut [Vec<f32>; 9],
    ) {
        grow(&mut self.side, self.instances.len());
        self.error.iter_mut().for_each(|column| grow(column, self.instances.len()));
        for (at, &instance) in self.instances.iter().enumerate() {
            let Some((map, rounding)) = accel.still_instance(instance) else { continue };
            let corners = [0, 3, 6].map(|first| vector(&hits.corners, first, at));
            let origin = vector(&hits.origin, 0, at);
            let local = [hits.local[0][at], hits.local[1][at]].map(f64::from);
            let error = error(map, rounding.filter(|_| is_single), origin, &corners, local);
            put_corners(&mut hits.corners, at, corners.map(|corner| map.vector(corner).to_array()));
            for (axis, x) in map.point(origin).to_array().into_iter().enumerate() {
                hits.origin[axis][at] = x;
                self.error[axis][at] = error[axis];
            }
            self.side[at] = if map.is_mirror() { -1.0 } else { 1.0 };
            let mapped = [0, 3, 6].map(|first| {
                let [x, y, z] = [0, 1, 2].map(|axis| f64::from(normals[first + axis][at]));
                map.normal(DVec3::new(x, y, z))
            });
            // One factor for all, so that they keep their weights: a map may leave the range of f32.
            let most = mapped.iter().fold(0.0f64, |most, normal| most.max(normal.abs().max_element()));
            let scale = if most > 0.0 { most.recip() } else { 1.0 };
            put_corners(normals, at, mapped.map(|normal| (normal * scale).as_vec3().to_array()));
        }
    }

    /// The errors of points and the normals of faces, as the instances leave them.
    #[inline(always)]
    pub(crate) fn adjust<R: Real>(
        &self,
        at: usize,
        error: V3<R::Double>,
        face: V3<R>,
    ) -> (V3<R::Double>, V3<R>) {
        let mapped = V3 {
            x: R::Double::from_slice(&self.error[0][at..]),
            y: R::Double::from_slice(&self.error[1][at..]),
            z: R::Double::from_slice(&self.error[2][at..]),
        };
        (error + mapped, face * R::from_slice(&self.side[at..]))
    }
}

/// What a point of a triangle is wrong by when its corners and the origin of its mesh are mapped.
///
/// # Error bound
///
/// The image is L o + τ + Σ bᵢ (L cᵢ), with weights bᵢ of the corners whose sum is 1: its products and sums are rounded
/// as those of the image of a point of size |o| + max |cᵢ|. The rounding of rays in the instance is an error of the
/// point that is mapped.
fn error(
    map: &Transform,
    rounding: Option<PictureRounding>,
    origin: DVec3,
    [p0, p1, p2]: &[DVec3; 3],
    [b1, b2]: [f64; 2],
) -> DVec3 {
    let size = origin.abs() + p0.abs().max(p1.abs()).max(p2.abs());
    let point = origin + ((1.0 - b1 - b2) * p0 + b1 * p1 + b2 * p2);
    map.point_error(size, rounding.map_or(DVec3::ZERO, |rounding| rounding.error(point)))
}

fn vector<const N: usize>(columns: &[Vec<f64>; N], first: usize, at: usize) -> DVec3 {
    DVec3::new(columns[first][at], columns[first + 1][at], columns[first + 2][at])
}
