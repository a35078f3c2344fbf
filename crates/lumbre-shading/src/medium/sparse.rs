//! Values on a sparse grid of voxels.

use lumbre_math::glam::IVec3;
use lumbre_math::{DVec3, Transform};

use super::grid::interpolate;

/// Voxels along a side of a brick, and bricks along a side of a block.
const BRICK: i32 = 8;
const BLOCK: i32 = 16;
/// Voxels along a side of a block.
const SPAN: i32 = BRICK * BLOCK;
/// Blocks at most of a grid: in practice some thousand.
const MAX_BLOCKS: usize = 1 << 24;

/// Values at whole coordinates of index space, in bricks of 8³ voxels where they vary, interpolated linearly; a
/// background value elsewhere. The layout that sparse volumes have in files (K. Museth, "VDB: High-Resolution Sparse
/// Volumes with Dynamic Topology", ACM Transactions on Graphics 32, 2013).
#[derive(Clone, Debug)]
pub struct SparseGrid {
    index_from_medium: Transform,
    /// The voxels that count, both ends included.
    bounds: [IVec3; 2],
    background: f32,
    /// The first block, in blocks, and how many there are along each axis.
    first: IVec3,
    count: IVec3,
    blocks: Vec<Cell>,
    /// The bricks of each block that is split: [`BLOCK`]³ cells a block.
    split: Vec<Cell>,
    bricks: Vec<[f32; 512]>,
}

/// What a block or a brick holds.
#[derive(Clone, Copy, Debug)]
enum Cell {
    /// One value.
    Constant(f32),
    /// What has this place in the list below.
    Split(u32),
}

/// The values of a brick.
#[derive(Clone, Debug)]
pub enum Brick {
    /// One value.
    Constant(f32),
    /// A value for each voxel: z fastest, then y, then x.
    Values(Box<[f32; 512]>),
}

/// A sparse grid that cannot be held.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SparseGridError {
    /// Its bounds are empty.
    #[error("the grid has no voxel")]
    Empty,
    /// Its bounds are too wide.
    #[error("the grid reaches over too many blocks of 128³ voxels: {0}, and at most 16,777,216 are taken")]
    TooWide(u64),
    /// A block or brick does not start at a multiple of its size within the bounds.
    #[error("a brick at {0}, {1}, {2} is out of place")]
    OutOfPlace(i32, i32, i32),
    /// It has more bricks than can be counted or held.
    #[error("the grid has too many bricks: {0}")]
    TooMany(u64),
}

impl SparseGrid {
    /// A grid that holds the background everywhere. `bounds` are the first and last voxels that count, in index space.
    ///
    /// # Errors
    /// [`SparseGridError::Empty`] and [`SparseGridError::TooWide`].
    pub fn new(
        index_from_medium: Transform,
        bounds: [IVec3; 2],
        background: f32,
    ) -> Result<Self, SparseGridError> {
        if bounds[0].cmpgt(bounds[1]).any() {
            return Err(SparseGridError::Empty);
        }
        let [first, last] = bounds.map(|voxel| voxel.map(|x| x.div_euclid(SPAN)));
        let count = last - first + 1;
        let blocks = count.to_array().into_iter().fold(1_u64, |blocks, n| blocks.saturating_mul(n as u64));
        if blocks > MAX_BLOCKS as u64 {
            return Err(SparseGridError::TooWide(blocks));
        }
        let blocks = vec![Cell::Constant(background); blocks as usize];
        let (split, bricks) = (Vec::new(), Vec::new());
        Ok(Self { index_from_medium, bounds, background, first, count, blocks, split, bricks })
    }

    /// Bytes that a grid takes, with this many blocks within its bounds, this many split ones, and this many bricks of
    /// values.
    pub fn memory_of(blocks: u64, split: u64, bricks: u64) -> u64 {
        let cells = blocks.saturating_add(split.saturating_mul((BLOCK * BLOCK * BLOCK) as u64));
        let bricks = bricks.saturating_mul(size_of::<[f32; 512]>() as u64);
        cells.saturating_mul(size_of::<Cell>() as u64).saturating_add(bricks)
    }

    /// Makes room for this many blocks that are split, and bricks of values, so that the grid takes no more than
    /// [`SparseGrid::memory_of`] them.
    ///
    /// # Errors
    /// [`SparseGridError::TooMany`].
    pub fn reserve(&mut self, split: u64, bricks: u64) -> Result<(), SparseGridError> {
        let cells = split.saturating_mul((BLOCK * BLOCK * BLOCK) as u64);
        if cells.max(bricks) > u64::from(u32::MAX) {
            return Err(SparseGridError::TooMany(split.max(bricks)));
        }
        let split = self.split.try_reserve_exact(cells as usize);
        split
            .and_then(|()| self.bricks.try_reserve_exact(bricks as usize))
            .map_err(|_| SparseGridError::TooMany(bricks))
    }

    /// Fills a block of 128³ voxels, whose first voxel is given, with one value; what of it is out of bounds is left.
    ///
    /// # Errors
    /// [`SparseGridError::OutOfPlace`].
    pub fn set_block(&mut self, voxel: IVec3, value: f32) -> Result<(), SparseGridError> {
        let place = self.block(voxel).filter(|_| voxel.map(|x| x.rem_euclid(SPAN)) == IVec3::ZERO);
        let place = place.ok_or(SparseGridError::OutOfPlace(voxel.x, voxel.y, voxel.z))?;
        self.blocks[place] = Cell::Constant(value);
        Ok(())
    }

    /// Fills a brick of 8³ voxels, whose first voxel is given.
    ///
    /// # Errors
    /// [`SparseGridError::OutOfPlace`].
    pub fn set_brick(&mut self, voxel: IVec3, brick: Brick) -> Result<(), SparseGridError> {
        let place = self.block(voxel).filter(|_| voxel.map(|x| x.rem_euclid(BRICK)) == IVec3::ZERO);
        let place = place.ok_or(SparseGridError::OutOfPlace(voxel.x, voxel.y, voxel.z))?;
        let first = match self.blocks[place] {
            Cell::Split(first) => first,
            Cell::Constant(value) => {
                let first = self.split.len() as u32;
                let cells = (BLOCK * BLOCK * BLOCK) as usize;
                self.split.resize(self.split.len() + cells, Cell::Constant(value));
                self.blocks[place] = Cell::Split(first);
                first
            }
        };
        let cell = match brick {
            Brick::Constant(value) => Cell::Constant(value),
            Brick::Values(values) => {
                self.bricks.push(*values);
                Cell::Split(self.bricks.len() as u32 - 1)
            }
        };
        self.split[first as usize + within_block(voxel)] = cell;
        Ok(())
    }

    /// Index space from the space of the medium.
    pub fn index_from_medium(&self) -> &Transform {
        &self.index_from_medium
    }

    /// The first and the last voxel that count.
    pub fn bounds(&self) -> [IVec3; 2] {
        self.bounds
    }

    /// Bytes that it takes.
    pub(super) fn memory(&self) -> usize {
        size_of_val(self.blocks.as_slice())
            + size_of_val(self.split.as_slice())
            + size_of_val(self.bricks.as_slice())
    }

    /// The value of a voxel.
    pub fn voxel(&self, voxel: IVec3) -> f32 {
        let brick = match self.brick(voxel) {
            Cell::Constant(value) => return value,
            Cell::Split(brick) => brick,
        };
        self.bricks[brick as usize][within_brick(voxel)]
    }

    /// The value at a point of the medium's space.
    pub fn at(&self, p: DVec3) -> f32 {
        let p = self.index_from_medium.point(p);
        let first = p.floor();
        if first.cmplt(DVec3::splat(f64::from(i32::MIN))).any() || first.cmpge(DVec3::splat(2.0e9)).any() {
            return self.background;
        }
        let corner = first.as_ivec3();
        let last = BRICK - 1;
        let local = corner.map(|x| x.rem_euclid(BRICK));
        if local.cmplt(IVec3::splat(last)).all() {
            // All eight voxels are in one brick.
            let values = match self.brick(corner) {
                Cell::Constant(value) => return value,
                Cell::Split(brick) => &self.bricks[brick as usize],
            };
            let base = corner.as_i64vec3();
            return interpolate(p, |[x, y, z]| {
                let [x, y, z] = [x - base.x, y - base.y, z - base.z].map(|x| x as i32);
                values[((local.x + x) * 64 + (local.y + y) * 8 + local.z + z) as usize]
            });
        }
        interpolate(p, |voxel| {
            let [x, y, z] = voxel.map(|x| x as i32);
            self.voxel(IVec3::new(x, y, z))
        })
    }

    /// The greatest value.
    pub fn greatest(&self) -> f32 {
        let mut greatest = self.background;
        self.each(|_, most| greatest = greatest.max(most));
        greatest
    }

    /// Visits parts that may hold more than the background, by their first and last voxels, with the most that each
    /// holds.
    pub(super) fn each(&self, mut visit: impl FnMut([IVec3; 2], f32)) {
        let mut visit = |first: IVec3, side: i32, most: f32| {
            if most > self.background {
                visit([first, first + (side - 1)], most);
            }
        };
        for (place, block) in (0..).zip(&self.blocks) {
            let (across, down) = (self.count.z * self.count.y, self.count.z);
            let at = IVec3::new(place / across, place / down % self.count.y, place % down);
            let block_at = (self.first + at) * SPAN;
            let split = match *block {
                Cell::Constant(value) => {
                    visit(block_at, SPAN, value);
                    continue;
                }
                Cell::Split(split) => split as usize,
            };
            for (i, cell) in (0..).zip(&self.split[split..][..(BLOCK * BLOCK * BLOCK) as usize]) {
                let at = block_at + BRICK * IVec3::new(i / (BLOCK * BLOCK), i / BLOCK % BLOCK, i % BLOCK);
                match *cell {
                    Cell::Constant(value) => visit(at, BRICK, value),
                    Cell::Split(brick) => {
                        let values = &self.bricks[brick as usize];
                        const HALF: i32 = BRICK / 2;
                        for octant in 0..8 {
                            let corner = HALF * IVec3::new(octant >> 2, octant >> 1 & 1, octant & 1);
                            let voxels = (0..HALF * HALF * HALF).map(|i| {
                                let voxel = corner + IVec3::new(i / (HALF * HALF), i / HALF % HALF, i % HALF);
                                values[within_brick(voxel)]
                            });
                            visit(at + corner, HALF, voxels.fold(f32::NEG_INFINITY, f32::max));
                        }
                    }
                }
            }
        }
    }

    fn block(&self, voxel: IVec3) -> Option<usize> {
        let at = voxel.map(|x| x.div_euclid(SPAN)) - self.first;
        let is_inside = at.cmpge(IVec3::ZERO).all() && at.cmplt(self.count).all();
        is_inside.then(|| ((at.x * self.count.y + at.y) * self.count.z + at.z) as usize)
    }

    fn brick(&self, voxel: IVec3) -> Cell {
        let Some(block) = self.block(voxel) else { return Cell::Constant(self.background) };
        match self.blocks[block] {
            Cell::Split(first) => self.split[first as usize + within_block(voxel)],
            constant @ Cell::Constant(_) => constant,
        }
    }
}

fn within_block(voxel: IVec3) -> usize {
    let at = voxel.map(|x| x.rem_euclid(SPAN) / BRICK);
    ((at.x * BLOCK + at.y) * BLOCK + at.z) as usize
}

fn within_brick(voxel: IVec3) -> usize {
    let at = voxel.map(|x| x.rem_euclid(BRICK));
    (at.x * 64 + at.y * 8 + at.z) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A number that depends on the voxel.
    fn value(voxel: IVec3) -> f32 {
        (voxel.dot(IVec3::new(1, 2, 3)).rem_euclid(5)) as f32
    }

    fn grid() -> SparseGrid {
        let bounds = [IVec3::new(-130, -9, 3), IVec3::new(140, 20, 40)];
        let mut grid = SparseGrid::new(Transform::IDENTITY, bounds, 0.25).unwrap();
        for origin in [IVec3::new(-136, -16, 0), IVec3::new(-8, 0, 8), IVec3::new(0, 0, 8)] {
            let values = std::array::from_fn(|i| {
                let i = i as i32;
                value(origin + IVec3::new(i / 64, i / 8 % 8, i % 8))
            });
            grid.set_brick(origin, Brick::Values(Box::new(values))).unwrap();
        }
        grid.set_brick(IVec3::new(8, 0, 8), Brick::Constant(7.0)).unwrap();
        grid.set_block(IVec3::new(128, -128, 0), 9.0).unwrap();
        grid
    }

    #[test]
    fn voxels_hold_what_was_put_there() {
        let grid = grid();
        for voxel in [IVec3::new(-130, -10, 3), IVec3::new(-1, 5, 12), IVec3::new(7, 7, 15)] {
            assert_eq!(grid.voxel(voxel), value(voxel), "{voxel}");
        }
        assert_eq!(grid.voxel(IVec3::new(9, 3, 9)), 7.0);
        assert_eq!(grid.voxel(IVec3::new(135, -1, 39)), 9.0);
        assert_eq!(grid.voxel(IVec3::new(60, 0, 8)), 0.25);
        assert_eq!(grid.voxel(IVec3::splat(i32::MAX)), 0.25);
    }

    #[test]
    fn values_are_interpolated_across_bricks() {
        let grid = grid();
        for (p, step) in [(DVec3::new(-3.25, 2.0, 10.0), IVec3::X), (DVec3::new(-0.75, 2.0, 10.0), IVec3::X)]
        {
            let low = p.floor().as_ivec3();
            let t = (p - p.floor()).x as f32;
            let expected = value(low) * (1.0 - t) + value(low + step) * t;
            assert!((grid.at(p) - expected).abs() < 1e-5, "{p}");
        }
        assert_eq!(grid.at(DVec3::splat(1e300)), 0.25);
        assert_eq!(grid.at(DVec3::splat(-1e12)), 0.25);
    }

    #[test]
    fn every_part_above_the_background_is_visited_with_its_most() {
        let grid = grid();
        let mut parts = Vec::new();
        grid.each(|part, most| parts.push((part, most)));
        let size = |[low, high]: [IVec3; 2]| (high - low + 1).as_i64vec3();
        let voxels: i64 = parts.iter().map(|&(part, _)| size(part).element_product()).sum();
        assert_eq!(voxels, 3 * 512 + 512 + 128 * 128 * 128);
        for i in 0..4000 {
            let voxel = IVec3::new(i * 7 % 24 - 8, i * 5 % 8, 8 + i % 8);
            let holds =
                |&&([low, high], _): &&([IVec3; 2], f32)| low.cmple(voxel).all() && voxel.cmple(high).all();
            let most = parts.iter().find(holds).map_or(0.25, |part| part.1);
            assert!(grid.voxel(voxel) <= most, "{voxel}");
        }
    }

    #[test]
    fn what_cannot_be_held_is_refused() {
        let wide = [IVec3::splat(i32::MIN / 2), IVec3::splat(i32::MAX / 2)];
        assert!(matches!(SparseGrid::new(Transform::IDENTITY, wide, 0.0), Err(SparseGridError::TooWide(_))));
        let empty = [IVec3::ONE, IVec3::ZERO];
        assert_eq!(SparseGrid::new(Transform::IDENTITY, empty, 0.0).err(), Some(SparseGridError::Empty));
        let mut grid = grid();
        assert!(grid.set_brick(IVec3::new(1, 0, 8), Brick::Constant(1.0)).is_err());
        assert!(grid.set_brick(IVec3::new(0, 0, 8000), Brick::Constant(1.0)).is_err());
        assert!(grid.set_block(IVec3::new(8, 0, 0), 1.0).is_err());
    }
}
