//! The tree of a grid: a root of blocks of 4096³ voxels, nodes of 32³ blocks of 128³, nodes of 16³ leaves of 8³.

use std::collections::HashSet;

use lumbre_math::glam::{DAffine3, DMat3, IVec3};
use lumbre_math::{DVec3, Transform};
use lumbre_shading::medium::{Brick, SparseGrid};

use super::{GRID_HEADER, NanoGrid, Values, check_version};
use crate::budget::Budget;
use crate::bytes::Bytes;
use crate::diagnostic::FormatError;

/// Voxels along a side of what a root, an upper and a lower node list.
const ROOT_SPAN: i32 = 4096;
const UPPER_SPAN: i32 = 128;
const LOWER_SPAN: i32 = 8;

const UPPER_SIZE: u64 = 270_400;
const LOWER_SIZE: u64 = 33_856;

/// How the numbers of a grid are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Single,
    Double,
    /// This many bits a voxel of a leaf, which interpolate between the leaf's least and largest value.
    Quantised(u32),
    /// The same, and each leaf says how many bits.
    QuantisedByLeaf,
}

impl Kind {
    fn of(number: u32) -> Option<Self> {
        Some(match number {
            1 => Self::Single,
            2 => Self::Double,
            13 => Self::Quantised(4),
            14 => Self::Quantised(8),
            15 => Self::Quantised(16),
            16 => Self::QuantisedByLeaf,
            _ => return None,
        })
    }

    /// Bytes of a leaf, the least there are.
    fn leaf_size(self) -> u64 {
        match self {
            Self::Single => 2144,
            Self::Double => 4224,
            Self::Quantised(bits) => 96 + 64 * u64::from(bits),
            Self::QuantisedByLeaf => 96 + 64,
        }
    }

    /// A number that stands on its own.
    fn number(self, bytes: Bytes<'_>, at: u64) -> Result<f64, FormatError> {
        match self {
            Self::Double => bytes.f64(at, "tree"),
            _ => bytes.f32(at, "tree").map(f64::from),
        }
    }

    /// Of the root: its bytes, and where its background and the value of a tile are.
    fn root(self) -> (u64, u64, u64) {
        match self {
            Self::Double => (96, 32, 24),
            _ => (64, 28, 20),
        }
    }
}

/// Where the nodes of a level are.
#[derive(Clone, Copy, Debug)]
struct Level {
    first: u64,
    count: u64,
    size: u64,
    /// How many of them were met.
    met: u64,
    what: &'static str,
}

struct Reader<'a> {
    bytes: Bytes<'a>,
    kind: Kind,
    values: Values,
    bounds: [IVec3; 2],
    background: f32,
    leaves: Level,
    lowers: Level,
    uppers: Level,
}

/// Reads a grid of these bytes.
pub(super) fn read(bytes: Bytes<'_>, values: Values, budget: &Budget) -> Result<NanoGrid, FormatError> {
    let magic = bytes.array::<8>(0, "grid")?;
    if !matches!(&magic, b"NanoVDB0" | b"NanoVDB1") {
        return Err(bytes.fault(0, "not a NanoVDB grid").expected("\"NanoVDB0\" or \"NanoVDB1\"").into());
    }
    check_version(bytes, 16)?;
    let size = bytes.u64(32, "grid")?;
    if size != bytes.len() || size < GRID_HEADER + 64 {
        let wrong = bytes.fault(32, "wrong size of a grid").found(size);
        return Err(wrong.expected(format!("the {} bytes that are there", bytes.len())).into());
    }
    let class = bytes.u32(632, "grid")?;
    match class {
        0 | 2 => {}
        1 => {
            let wrong = bytes.fault(632, "a grid that is a surface (a level set), not a volume");
            return Err(wrong.expected("a fog volume").into());
        }
        _ => {
            return Err(bytes
                .fault(632, "a grid of another class")
                .found(class)
                .expected("a fog volume")
                .into());
        }
    }
    let number = bytes.u32(636, "grid")?;
    let kind = Kind::of(number).ok_or_else(|| {
        let wrong = bytes.fault(636, "a grid of values that are not read").found(format!("type {number}"));
        wrong.expected("1 (float), 2 (double), 13, 14, 15 or 16 (quantised)")
    })?;
    let world_from_index = map(bytes)?;
    let tree = GRID_HEADER;
    let level = |place: u64, size: u64, what: &'static str| -> Result<Level, FormatError> {
        let first = bytes.i64(tree + 8 * place, "tree")?;
        let count = match place {
            3 => 1,
            _ => u64::from(bytes.u32(tree + 32 + 4 * place, "tree")?),
        };
        let first_at = u64::try_from(first).ok().filter(|first| first % 8 == 0).map(|first| first + tree);
        let end = first_at.and_then(|first| first.checked_add(count.checked_mul(size)?));
        match (first_at, end) {
            (Some(first), Some(end)) if end <= bytes.len() => Ok(Level { first, count, size, met: 0, what }),
            (Some(first), _) if count == 0 => Ok(Level { first, count, size, met: 0, what }),
            _ => {
                let wrong = bytes.fault(tree + 8 * place, format!("the tree's {what} are not in the grid"));
                Err(wrong.found(format!("{count} at {first}")).into())
            }
        }
    };
    let (root_size, background_at, _) = kind.root();
    let leaves = level(0, kind.leaf_size(), "leaves")?;
    let lowers = level(1, LOWER_SIZE, "lower nodes")?;
    let uppers = level(2, UPPER_SIZE, "upper nodes")?;
    let root = level(3, root_size, "roots")?.first;
    let (first, last) = (corner(bytes, root)?, corner(bytes, root + 12)?);
    if first.cmpgt(last).any() {
        return Err(bytes.fault(root, "a grid without any active voxel").into());
    }
    if first.cmplt(IVec3::splat(i32::MIN / 2)).any() || last.cmpgt(IVec3::splat(i32::MAX / 2)).any() {
        return Err(bytes
            .fault(root, "a grid that reaches too far")
            .found(format!("{first} to {last}"))
            .into());
    }
    let mut reader =
        Reader { bytes, kind, values, bounds: [first, last], background: 0.0, leaves, lowers, uppers };
    reader.background = reader.value(root + background_at)?;
    let blocks = (last.map(|x| x.div_euclid(UPPER_SPAN)) - first.map(|x| x.div_euclid(UPPER_SPAN)) + 1)
        .to_array()
        .into_iter()
        .fold(1_u64, |blocks, side| blocks.saturating_mul(side as u64));
    budget.bytes(SparseGrid::memory_of(blocks, lowers.count, leaves.count), "voxels of a grid")?;
    let grid = SparseGrid::new(world_from_index.inverse(), reader.bounds, reader.background);
    let grid = grid.and_then(|mut grid| {
        grid.reserve(lowers.count, leaves.count)?;
        Ok(grid)
    });
    let mut grid = grid.map_err(|error| bytes.fault(root, error.to_string()))?;
    reader.root(root, &mut grid)?;
    for level in [reader.uppers, reader.lowers, reader.leaves] {
        if level.met != level.count {
            let wrong =
                bytes.fault(tree, format!("the tree does not have as many {} as it says", level.what));
            return Err(wrong.found(level.met).expected(level.count).into());
        }
    }
    let world_bounds = world_bounds(&world_from_index, reader.bounds);
    if !world_bounds.iter().all(|corner| corner.is_finite()) {
        return Err(bytes.fault(root, "a grid whose map makes it endless").into());
    }
    Ok(NanoGrid { grid, world_bounds })
}

/// World from index space.
fn map(bytes: Bytes<'_>) -> Result<Transform, FormatError> {
    const MAP: u64 = 296;
    let mut numbers = [0.0; 12];
    for (i, number) in (0..).zip(&mut numbers[..9]) {
        *number = bytes.f64(MAP + 88 + 8 * i, "map of a grid")?;
    }
    for (i, number) in (0..).zip(&mut numbers[9..]) {
        *number = bytes.f64(MAP + 232 + 8 * i, "map of a grid")?;
    }
    let [a, b, c, d, e, f, g, h, i, x, y, z] = numbers;
    // By rows.
    let matrix = DMat3::from_cols_array(&[a, d, g, b, e, h, c, f, i]);
    let affine = DAffine3::from_mat3_translation(matrix, DVec3::new(x, y, z));
    if !affine.is_finite() {
        return Err(bytes.fault(MAP + 88, "the map of a grid is not finite").into());
    }
    Transform::from_affine(affine)
        .map_err(|_| bytes.fault(MAP + 88, "the map of a grid cannot be undone").into())
}

/// The box around what the active voxels are mapped to.
fn world_bounds(world_from_index: &Transform, [first, last]: [IVec3; 2]) -> [DVec3; 2] {
    let ends = [first.as_dvec3(), last.as_dvec3() + 1.0];
    let corners = (0..8).map(|i| {
        let side = |axis: usize| ends[i >> axis & 1][axis];
        world_from_index.point(DVec3::new(side(0), side(1), side(2)))
    });
    corners.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], p| [low.min(p), high.max(p)])
}

fn corner(bytes: Bytes<'_>, at: u64) -> Result<IVec3, FormatError> {
    Ok(IVec3::new(bytes.i32(at, "tree")?, bytes.i32(at + 4, "tree")?, bytes.i32(at + 8, "tree")?))
}

/// The corner of entry `n` of a node that begins at `origin`, with `1 << bits` entries along each axis.
fn entry_corner(origin: IVec3, n: u64, bits: u32, span: i32) -> IVec3 {
    let mask = (1 << bits) - 1;
    let along = |shift: u32| (n >> shift & mask) as i32 * span;
    origin + IVec3::new(along(2 * bits), along(bits), along(0))
}

impl Reader<'_> {
    /// A number, which must be one that the grid may hold.
    fn value(&self, at: u64) -> Result<f32, FormatError> {
        let value = self.kind.number(self.bytes, at)?;
        self.checked(value, at)
    }

    fn checked(&self, value: f64, at: u64) -> Result<f32, FormatError> {
        let single = value as f32;
        let fits = single.is_finite() && (self.values == Values::Finite || single >= 0.0);
        if fits {
            return Ok(single);
        }
        let wrong = self.bytes.fault(at, "wrong value in a grid").found(value);
        Err(wrong
            .expected(match self.values {
                Values::Finite => "a finite number",
                Values::NotNegative => "a finite number that is not negative",
            })
            .into())
    }

    fn root(&mut self, root: u64, grid: &mut SparseGrid) -> Result<(), FormatError> {
        let (header, _, value_at) = self.kind.root();
        let tiles = u64::from(self.bytes.u32(root + 24, "root")?);
        self.bytes.part(root..(root + header).saturating_add(32 * tiles), "table of the root")?;
        let mut keys = HashSet::new();
        for tile in 0..tiles {
            let at = root + header + 32 * tile;
            let key = self.bytes.u64(at, "root")?;
            if !keys.insert(key) {
                return Err(self.bytes.fault(at, "a root has two tiles of one place").into());
            }
            // Each part of the key is a coordinate's upper 20 bits, as of a number with a sign.
            let part = |shift: u32| ((key >> shift & 0xF_FFFF) as i32) << 12;
            let origin = IVec3::new(part(42), part(21), part(0));
            let child = self.bytes.i64(at + 8, "root")?;
            if child == 0 {
                let value = self.value(at + value_at)?;
                self.tile(origin, value, grid)?;
                continue;
            }
            let place = self.child(root, child, at + 8, |reader| &mut reader.uppers)?;
            self.check_origin(place, origin, ROOT_SPAN)?;
            self.upper(place, origin, grid)?;
        }
        Ok(())
    }

    /// A value for all of a root's block.
    fn tile(&self, origin: IVec3, value: f32, grid: &mut SparseGrid) -> Result<(), FormatError> {
        if value == self.background {
            return Ok(());
        }
        let [first, last] = self.bounds.map(|voxel| voxel.map(|x| x.div_euclid(UPPER_SPAN)));
        let block = origin.map(|x| x.div_euclid(UPPER_SPAN));
        let low = first.max(block);
        let high = last.min(block + (ROOT_SPAN / UPPER_SPAN - 1));
        for x in low.x..=high.x {
            for y in low.y..=high.y {
                for z in low.z..=high.z {
                    self.put_block(UPPER_SPAN * IVec3::new(x, y, z), value, grid)?;
                }
            }
        }
        Ok(())
    }

    fn put_block(&self, voxel: IVec3, value: f32, grid: &mut SparseGrid) -> Result<(), FormatError> {
        grid.set_block(voxel, value).map_err(|error| self.bytes.fault(0, error.to_string()).into())
    }

    /// Whether a cube of voxels reaches into the bounds.
    fn counts(&self, origin: IVec3, span: i32) -> bool {
        let [first, last] = self.bounds;
        origin.cmple(last).all() && (origin + (span - 1)).cmpge(first).all()
    }

    fn upper(&mut self, node: u64, origin: IVec3, grid: &mut SparseGrid) -> Result<(), FormatError> {
        let children = self.bytes.part(node + 4128..node + 8224, "upper node")?;
        for n in 0..32 * 32 * 32 {
            let at = node + 8256 + 8 * n;
            let block = entry_corner(origin, n, 5, UPPER_SPAN);
            if children[n as usize >> 3] >> (n & 7) & 1 == 0 {
                let value = self.value(at)?;
                if value != self.background && self.counts(block, UPPER_SPAN) {
                    self.put_block(block, value, grid)?;
                }
                continue;
            }
            let offset = self.bytes.i64(at, "upper node")?;
            let place = self.child(node, offset, at, |reader| &mut reader.lowers)?;
            self.check_origin(place, block, UPPER_SPAN)?;
            self.lower(place, block, grid)?;
        }
        Ok(())
    }

    fn lower(&mut self, node: u64, origin: IVec3, grid: &mut SparseGrid) -> Result<(), FormatError> {
        let children = self.bytes.part(node + 544..node + 1056, "lower node")?;
        for n in 0..16 * 16 * 16 {
            let at = node + 1088 + 8 * n;
            let voxel = entry_corner(origin, n, 4, LOWER_SPAN);
            let brick = if children[n as usize >> 3] >> (n & 7) & 1 == 0 {
                let value = self.value(at)?;
                if value == self.background {
                    continue;
                }
                Brick::Constant(value)
            } else {
                let offset = self.bytes.i64(at, "lower node")?;
                let place = self.child(node, offset, at, |reader| &mut reader.leaves)?;
                if corner(self.bytes, place)?.map(|x| x & !7) != voxel {
                    return Err(self
                        .bytes
                        .fault(place, "a leaf stands in another place than it says")
                        .into());
                }
                Brick::Values(self.leaf(place)?)
            };
            if self.counts(origin, UPPER_SPAN) {
                let put = grid.set_brick(voxel, brick);
                put.map_err(|error| self.bytes.fault(at, error.to_string()))?;
            }
        }
        Ok(())
    }

    fn leaf(&self, leaf: u64) -> Result<Box<[f32; 512]>, FormatError> {
        let mut values = Box::new([0.0; 512]);
        match self.kind {
            Kind::Single | Kind::Double => {
                let (first, size) = if self.kind == Kind::Single { (96, 4) } else { (128, 8) };
                for (n, value) in (0..).zip(values.iter_mut()) {
                    *value = self.value(leaf + first + size * n)?;
                }
            }
            Kind::Quantised(_) | Kind::QuantisedByLeaf => {
                let [flags] = self.bytes.array::<1>(leaf + 15, "leaf")?;
                let bits = match self.kind {
                    Kind::Quantised(bits) => bits,
                    _ => 1 << (flags >> 5),
                };
                if bits > 16 {
                    return Err(self.bytes.fault(leaf + 15, "a leaf of too many bits a voxel").into());
                }
                let least = f64::from(self.bytes.f32(leaf + 80, "leaf")?);
                let quantum = f64::from(self.bytes.f32(leaf + 84, "leaf")?);
                let codes = self.bytes.part(leaf + 96..leaf + 96 + 64 * u64::from(bits), "leaf")?;
                for (n, value) in values.iter_mut().enumerate() {
                    let bit = n * bits as usize;
                    let code = match bits {
                        16 => u32::from(u16::from_le_bytes([codes[2 * n], codes[2 * n + 1]])),
                        _ => u32::from(codes[bit / 8]) >> (bit % 8) & ((1 << bits) - 1),
                    };
                    // What rounding makes of a least value of 0 is no negative density.
                    *value = self.checked(least + f64::from(code) * quantum, leaf + 80)?;
                }
            }
        }
        Ok(values)
    }

    /// The place of a node of a level, `offset` bytes from `from`.
    fn child(
        &mut self,
        from: u64,
        offset: i64,
        at: u64,
        level: impl Fn(&mut Self) -> &mut Level,
    ) -> Result<u64, FormatError> {
        let bytes = self.bytes;
        let is_of_leaves = self.kind == Kind::QuantisedByLeaf && level(self).what == "leaves";
        let level = level(self);
        level.met += 1;
        let place = from.checked_add_signed(offset).filter(|place| {
            let end = level.first + level.count * level.size;
            // The offsets of leaves of different sizes do not follow from their index.
            let is_inside = if is_of_leaves {
                (level.first..=bytes.len() - level.size).contains(place) && place % 8 == 0
            } else {
                (level.first..end).contains(place) && (place - level.first).is_multiple_of(level.size)
            };
            is_inside && level.met <= level.count
        });
        place.ok_or_else(|| {
            let wrong = bytes.fault(at, format!("a node that is none of the tree's {}", level.what));
            wrong.found(format!("offset {offset}")).into()
        })
    }

    /// A node says where its voxels are, if it has active ones.
    fn check_origin(&self, node: u64, origin: IVec3, span: i32) -> Result<(), FormatError> {
        let (first, last) = (corner(self.bytes, node)?, corner(self.bytes, node + 12)?);
        if first.cmpgt(last).any() || first.map(|x| x & !(span - 1)) == origin {
            return Ok(());
        }
        Err(self.bytes.fault(node, "a node stands in another place than it says").into())
    }
}
