//! Sparse volumes in NanoVDB files (`.nvdb`) of major version 32: grids of numbers, packed or not.
//!
//! K. Museth, "NanoVDB: A GPU-Friendly and Portable VDB Data Structure For Real-Time Rendering And Simulation",
//! SIGGRAPH Talks 2021. Read are grids of single and double precision and of quantised numbers that are fog volumes;
//! they stay as sparse as they are stored.

mod codec;
mod tree;

#[cfg(test)]
mod tests;

use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

use lumbre_math::DVec3;
use lumbre_shading::medium::SparseGrid;

use crate::budget::{Budget, Hold};
use crate::diagnostic::{FormatError, quoted};

use crate::bytes::Bytes;
use codec::Codec;

/// A grid of numbers, and where it is.
#[derive(Clone, Debug)]
pub struct NanoGrid {
    /// The voxels. The space of its medium is the world of the file.
    pub grid: SparseGrid,
    /// The box around the active voxels, each taken as a cube that begins at its whole coordinates, in the world of the
    /// file: the least and the largest coordinates.
    pub world_bounds: [DVec3; 2],
}

/// The numbers that a grid may hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Values {
    /// Any finite ones.
    Finite,
    /// Finite ones that are not negative, such as densities.
    NotNegative,
}

/// The names of the grids of a file, in their order.
///
/// # Errors
/// As for [`read`].
pub fn grid_names(bytes: &[u8], name: &Arc<str>, budget: &Budget) -> Result<Vec<String>, FormatError> {
    Ok(grids(Bytes::new(bytes, name), budget)?.into_iter().map(|grid| grid.name).collect())
}

/// Reads the first grid of this name; `None` where the file has none. What is read is charged to the budget.
///
/// # Errors
/// [`FormatError::Input`] with the byte of what is wrong, which for packed grids is a byte of the unpacked one, and
/// [`FormatError::Limit`].
pub fn read(
    bytes: &[u8],
    name: &Arc<str>,
    grid_name: &str,
    values: Values,
    budget: &Budget,
) -> Result<Option<NanoGrid>, FormatError> {
    let bytes = Bytes::new(bytes, name);
    let Some(grid) = grids(bytes, budget)?.into_iter().find(|grid| grid.name == grid_name) else {
        return Ok(None);
    };
    let mut hold = budget.hold_nothing();
    let unpacked = unpacked(bytes, &grid, &mut hold, budget)?;
    let path = format!("of the unpacked grid {}", quoted(grid_name));
    let grid = match grid.codec {
        Codec::None => bytes.slice(grid.data.start as u64..grid.data.end as u64)?,
        Codec::Zip | Codec::Blosc => Bytes::new(&unpacked, name).at_path(&path),
    };
    tree::read(grid, values, budget).map(Some)
}

/// A grid as it lies in the file.
#[derive(Debug)]
struct Stored {
    name: String,
    codec: Codec,
    /// Where its bytes are.
    data: Range<usize>,
    /// Their number when unpacked.
    size: u64,
}

fn unpacked<'a>(
    bytes: Bytes<'a>,
    grid: &Stored,
    hold: &mut Hold<'_>,
    budget: &Budget,
) -> Result<Cow<'a, [u8]>, FormatError> {
    let data = bytes.slice(grid.data.start as u64..grid.data.end as u64)?;
    if grid.codec == Codec::None {
        return Ok(Cow::Borrowed(data.all()));
    }
    budget.expansion(data.len(), grid.size, "NanoVDB grid")?;
    hold.grow(grid.size, "NanoVDB grid")?;
    codec::unpack(data, grid.codec, grid.size).map(Cow::Owned)
}

/// Bytes of the header of a grid.
const GRID_HEADER: u64 = 672;
/// Bytes of the header of a segment, and of what it says of each grid.
const SEGMENT_HEADER: u64 = 16;
const METADATA: u64 = 176;

/// The grids of a file: of segments, or one after the other without any.
fn grids(bytes: Bytes<'_>, budget: &Budget) -> Result<Vec<Stored>, FormatError> {
    if bytes.all().starts_with(b" BDV") {
        let wrong = bytes.fault(0, "this is an OpenVDB file, not a NanoVDB one");
        return Err(wrong
            .expected("a .nvdb file, as \"nanovdb_convert FILE.vdb FILE.nvdb\" makes it")
            .into());
    }
    let magic = bytes.array::<8>(0, "NanoVDB file")?;
    match &magic {
        b"NanoVDB1" => raw_grids(bytes, budget),
        b"NanoVDB0" if is_raw(bytes) => raw_grids(bytes, budget),
        b"NanoVDB0" | b"NanoVDB2" => segments(bytes, budget),
        [b'0'..=b'9', b'B', b'D', b'V', b'o', b'n', b'a', b'N'] => {
            Err(bytes.fault(0, "a NanoVDB file of big-endian numbers").expected("little-endian ones").into())
        }
        _ => {
            let wrong = bytes.fault(0, "not a NanoVDB file").found(crate::diagnostic::quoted_bytes(&magic));
            Err(wrong.expected("\"NanoVDB0\", \"NanoVDB1\" or \"NanoVDB2\"").into())
        }
    }
}

/// Whether bytes with the older magic number are a grid, and not a segment.
fn is_raw(bytes: Bytes<'_>) -> bool {
    let version = bytes.u32(16, "").is_ok_and(|version| version >> 21 == MAJOR);
    let size = bytes.u64(32, "").is_ok_and(|size| GRID_HEADER <= size && size <= bytes.len());
    version && size && bytes.len() >= GRID_HEADER
}

/// The major version whose grids are read.
const MAJOR: u32 = 32;

fn check_version(bytes: Bytes<'_>, at: u64) -> Result<(), FormatError> {
    let version = bytes.u32(at, "version")?;
    if version >> 21 == MAJOR {
        return Ok(());
    }
    let found = format!("{}.{}.{}", version >> 21, version >> 10 & 0x7FF, version & 0x3FF);
    let wrong = bytes.fault(at, "a NanoVDB file of another version").found(found);
    Err(wrong.expected("version 32").into())
}

/// A name that ends at its first NUL.
fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|&b| b == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).into_owned()
}

fn raw_grids(bytes: Bytes<'_>, budget: &Budget) -> Result<Vec<Stored>, FormatError> {
    let mut grids = vec![];
    let mut hold = budget.hold_nothing();
    let mut at = 0;
    while at < bytes.len() {
        let grid = bytes.slice(at..bytes.len())?;
        check_version(grid, 16)?;
        let size = grid.u64(32, "size of a grid")?;
        if !(GRID_HEADER..=grid.len()).contains(&size) {
            let wrong = grid.fault(32, "wrong size of a grid").found(size);
            return Err(wrong.expected(format!("{GRID_HEADER} to {} bytes", grid.len())).into());
        }
        hold.room_in(&mut grids, "grids of a NanoVDB file")?;
        let data = at as usize..(at + size) as usize;
        grids.push(Stored { name: text(grid.part(40..296, "name")?), codec: Codec::None, data, size });
        at += size;
    }
    Ok(grids)
}

fn segments(bytes: Bytes<'_>, budget: &Budget) -> Result<Vec<Stored>, FormatError> {
    let mut grids: Vec<Stored> = vec![];
    let mut hold = budget.hold_nothing();
    let mut at = 0;
    while at < bytes.len() {
        let magic = bytes.array::<8>(at, "segment")?;
        if !matches!(&magic, b"NanoVDB0" | b"NanoVDB2") {
            let wrong = bytes.fault(at, "no segment of a NanoVDB file");
            return Err(wrong.found(crate::diagnostic::quoted_bytes(&magic)).expected("\"NanoVDB2\"").into());
        }
        check_version(bytes, at + 8)?;
        let count = bytes.u16(at + 12, "number of grids")?;
        let first = grids.len();
        at += SEGMENT_HEADER;
        for _ in 0..count {
            let part = bytes.part(at..at.saturating_add(METADATA), "metadata of a grid")?;
            let metadata = Bytes::new(part, bytes.name()).from(at + bytes.base());
            let (size, packed) = (metadata.u64(0, "size")?, metadata.u64(8, "size")?);
            let codec = metadata.u16(168, "codec")?;
            let codec = Codec::of(codec).ok_or_else(|| {
                let wrong = metadata.fault(168, "unknown codec of a NanoVDB grid").found(codec);
                wrong.expected("0 (none), 1 (ZIP) or 2 (Blosc)")
            })?;
            if size < GRID_HEADER || (codec == Codec::None && size != packed) {
                let wrong = metadata.fault(0, "wrong size of a grid").found(size);
                return Err(wrong
                    .expected(format!("{GRID_HEADER} bytes or more, as many as are stored"))
                    .into());
            }
            let name_size = u64::from(metadata.u32(136, "length of a name")?);
            at += METADATA;
            let name = text(bytes.part(at..at.saturating_add(name_size), "name of a grid")?);
            at += name_size;
            hold.grow(name.len() as u64, "names of grids")?;
            hold.room_in(&mut grids, "grids of a NanoVDB file")?;
            // The place follows below.
            grids.push(Stored { name, codec, data: 0..usize::try_from(packed).unwrap_or(usize::MAX), size });
        }
        for grid in &mut grids[first..] {
            let end = at.saturating_add(grid.data.end as u64);
            bytes.part(at..end, "grid")?;
            grid.data = at as usize..end as usize;
            at = end;
        }
    }
    Ok(grids)
}
