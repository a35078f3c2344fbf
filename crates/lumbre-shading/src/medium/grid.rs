//! Values on a regular grid of voxels.

use std::ops::{Add, Mul};

use lumbre_math::DVec3;

use crate::Spectrum;

/// What a voxel holds.
pub trait Voxel: Copy + Default + Add<Output = Self> + Mul<f32, Output = Self> {}
impl Voxel for f32 {}
impl Voxel for Spectrum {}

/// Values at the centres of voxels that fill the unit cube, interpolated linearly; 0 beyond them, so that a grid of one
/// value falls to half of it on each face.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid<V> {
    size: [usize; 3],
    /// x fastest, then y, then z.
    values: Vec<V>,
}

/// The numbers of values and voxels differ, or there is no voxel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{} values for {} × {} × {} voxels", .values, .size[0], .size[1], .size[2])]
pub struct GridError {
    /// Voxels along x, y and z.
    pub size: [usize; 3],
    /// The number of values.
    pub values: usize,
}

impl<V: Voxel> Grid<V> {
    /// A grid of `size` voxels along x, y and z, whose values go along x first, then y, then z.
    ///
    /// # Errors
    /// [`GridError`] unless there is one value for each of at least one voxel.
    pub fn new(size: [usize; 3], values: Vec<V>) -> Result<Self, GridError> {
        let count = size[0].checked_mul(size[1]).and_then(|count| count.checked_mul(size[2]));
        if values.is_empty() || count != Some(values.len()) {
            return Err(GridError { size, values: values.len() });
        }
        Ok(Self { size, values })
    }

    /// The value of a voxel; 0 where there is none.
    pub(super) fn voxel(&self, [x, y, z]: [i64; 3]) -> V {
        let [nx, ny, nz] = self.size.map(|n| n as i64);
        if !((0..nx).contains(&x) && (0..ny).contains(&y) && (0..nz).contains(&z)) {
            return V::default();
        }
        self.values[((z * ny + y) * nx + x) as usize]
    }

    /// Voxels along x, y and z.
    pub fn size(&self) -> [usize; 3] {
        self.size
    }

    /// Bytes that it takes.
    pub(super) fn memory(&self) -> usize {
        size_of_val(self.values.as_slice())
    }

    /// The value at a point of the unit cube.
    pub fn at(&self, p: DVec3) -> V {
        let size = DVec3::from_array(self.size.map(|n| n as f64));
        interpolate(p * size - 0.5, |voxel| self.voxel(voxel))
    }

    /// All voxels whose values may show between two points of the unit cube.
    pub(super) fn between(&self, low: DVec3, high: DVec3) -> impl Iterator<Item = V> + '_ {
        let size = DVec3::from_array(self.size.map(|n| n as f64));
        let most = size - 1.0;
        let first = (low * size - 0.5).floor().clamp(DVec3::ZERO, most).as_i64vec3();
        let last = ((high * size - 0.5).floor() + 1.0).clamp(DVec3::ZERO, most).as_i64vec3();
        (first.z..=last.z).flat_map(move |z| {
            (first.y..=last.y).flat_map(move |y| (first.x..=last.x).map(move |x| self.voxel([x, y, z])))
        })
    }
}

impl Grid<f32> {
    /// The greatest value.
    pub fn greatest(&self) -> f32 {
        self.values.iter().copied().fold(f32::NEG_INFINITY, f32::max)
    }
}

/// Linear interpolation between values at whole coordinates.
pub(super) fn interpolate<V: Voxel>(p: DVec3, mut value: impl FnMut([i64; 3]) -> V) -> V {
    let cell = p.floor();
    let high = (p - cell).as_vec3();
    let low = 1.0 - high;
    let [x, y, z] = cell.as_i64vec3().to_array();
    let mut along_x = |y: i64, z: i64| value([x, y, z]) * low.x + value([x + 1, y, z]) * high.x;
    let mut along_y = |z: i64| along_x(y, z) * low.y + along_x(y + 1, z) * high.y;
    along_y(z) * low.z + along_y(z + 1) * high.z
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grid_of_one_value_falls_to_half_on_its_faces() {
        let grid = Grid::new([4, 1, 1], vec![2.0_f32; 4]).unwrap();
        let at = |x, y, z| grid.at(DVec3::new(x, y, z));
        assert_eq!(at(0.5, 0.5, 0.5), 2.0);
        assert_eq!(at(0.0, 0.5, 0.5), 1.0);
        assert_eq!(at(0.5, 0.0, 0.5), 1.0);
        assert_eq!(at(1.0, 1.0, 1.0), 0.25);
        // The mean of a row of n voxels is 1 - 1/(4n).
        let mean: f32 = (0..1000).map(|i| at((f64::from(i) + 0.5) / 1000.0, 0.5, 0.5)).sum::<f32>() / 1000.0;
        assert!((mean / 2.0 - (1.0 - 1.0 / 16.0)).abs() < 1e-4, "{mean}");
    }

    #[test]
    fn values_go_along_x_then_y_then_z() {
        let grid = Grid::new([2, 3, 4], (0..24_u8).map(f32::from).collect()).unwrap();
        assert_eq!(grid.at(DVec3::new(0.75, 0.5, 0.875)), 1.0 + 2.0 + 18.0);
        assert_eq!(grid.at(DVec3::new(0.25, 5.0 / 6.0, 0.125)), 4.0);
    }

    #[test]
    fn what_may_show_in_a_part_has_all_that_shows_there() {
        let grid = Grid::new([5, 4, 3], (0..60_u16).map(|i| f32::from(i * 37 % 60)).collect()).unwrap();
        let (low, high) = (DVec3::new(0.25, 0.0, 0.5), DVec3::new(0.5, 0.4, 1.0));
        let most = grid.between(low, high).fold(0.0, f32::max);
        for i in 0..1000 {
            let i = f64::from(i);
            let u = DVec3::new(0.31 * i, 0.17 * i, 0.71 * i).fract();
            assert!(grid.at(low + u * (high - low)) <= most);
        }
    }

    #[test]
    fn a_grid_without_its_values_is_refused() {
        assert!(Grid::new([2, 2, 2], vec![0.0_f32; 7]).is_err());
        assert!(Grid::new([0, 2, 2], Vec::<f32>::new()).is_err());
        assert!(Grid::new([usize::MAX, 2, 2], vec![0.0_f32; 4]).is_err());
    }
}
