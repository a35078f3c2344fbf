//! Trees in files that are mapped and used in place.
//!
//! The file holds the arrays of a tree as they are in memory, so that mapping it computes and copies nothing, and
//! processes share its pages. It is a machine format: little-endian, with the crate's own layout. For other uses, see
//! [`Accel::to_bytes`].
//!
//! A header of 256 bytes: eight bytes of magic; as u32 the version, a byte-order mark, the numbers of geometries and
//! masks, the reference to the root, and a zero; as u64 the length of each array; a fingerprint of the geometries; a
//! checksum of everything after the header; a fingerprint of the parts of opened instances; and a checksum of the
//! header so far. Then the arrays, each at a multiple of 64 bytes: nodes, lines of blocks (see `triangle_block`),
//! primitive ids of triangles, those of spheres, entries, masks.
//!
//! The file is checked when it is mapped: checksums, the length, every reference and every primitive id, that unused
//! lanes are marked as such, and that the geometries are the ones that it was saved with. A carefully crafted file may
//! have boxes that hide their contents, and so lose hits; it cannot make a query panic or loop forever.

use std::fmt;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use bytemuck::Pod;
use memmap2::Mmap;

use crate::build::input::{Parts, take_apart, units_of};
use crate::build::refit::RefitError;
use crate::build::refit::{Places, check_places};
use crate::io::bytes::LoadError;
use crate::io::bytes::{check_ids, check_structure, signature};
use crate::tree::assemble::TreeParts;
use crate::tree::node::{Node, WIDTH, tag};
use crate::tree::packed::Start;
use crate::tree::packed::{Entry, Packed};
use crate::tree::sphere_block::SphereBlock;
use crate::tree::storage::Store;
use crate::tree::triangle_block::{BlockIds, Line};
use crate::tree::{Geometry, GeometryKind, Tree};

const MAGIC: [u8; 8] = *b"LumbMap\0";
/// Changes with the format, and with the layout of its contents.
const VERSION: u32 = 9;
const BYTE_ORDER: u32 = 0x0102_0304;
const NONE: u32 = u32::MAX;
const HEADER: usize = 256;
/// Offset of the header's own checksum, after everything that it covers.
const SEAL: usize = 128;
const ARRAYS: usize = 7;
const ALIGNMENT: usize = 64;

/// Why a file is not mapped.
#[derive(Debug)]
#[non_exhaustive]
pub enum MapError {
    /// The file cannot be opened or mapped.
    Io(io::Error),
    /// Its contents are no tree over these geometries.
    Load(LoadError),
    /// This machine has another byte order than the files.
    ByteOrder,
}

impl fmt::Display for MapError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Io(error) => error.fmt(f),
            Self::Load(error) => error.fmt(f),
            Self::ByteOrder => write!(f, "mapped trees are little-endian, and this machine is not"),
        }
    }
}

impl std::error::Error for MapError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Io(error) => Some(error),
            Self::Load(error) => Some(error),
            Self::ByteOrder => None,
        }
    }
}

impl From<LoadError> for MapError {
    fn from(error: LoadError) -> Self {
        Self::Load(error)
    }
}

/// A 64-bit checksum over whole words, in four lanes for speed. It detects damage, not malice. Xor, then multiply, is
/// from FNV-1a (G. Fowler, L. Noll, K. Vo), here with words instead of bytes.
struct Sum {
    lanes: [u64; 4],
    words: u64,
}

impl Sum {
    fn new() -> Self {
        Self { lanes: [0xcbf2_9ce4_8422_2325, 0x9e37_79b9, 0x7f4a_7c15, 0x94d0_49bb], words: 0 }
    }

    fn add(&mut self, bytes: &[u8]) {
        let mix = |lane: &mut u64, word: u64| {
            *lane = (*lane ^ word).wrapping_mul(0x0000_0100_0000_01b3).rotate_left(23);
        };
        let (fours, rest) = bytes.as_chunks::<32>();
        for four in fours {
            let (words, _) = four.as_chunks::<8>();
            for (lane, word) in self.lanes.iter_mut().zip(words) {
                mix(lane, u64::from_le_bytes(*word));
            }
        }
        for (i, tail) in rest.chunks(8).enumerate() {
            let mut word = [0; 8];
            word[..tail.len()].copy_from_slice(tail);
            mix(&mut self.lanes[i % 4], u64::from_le_bytes(word));
        }
        self.words = self.words.wrapping_add(bytes.len() as u64);
    }

    fn finish(&self) -> u64 {
        self.lanes
            .iter()
            .fold(self.words, |sum, lane| (sum ^ lane).wrapping_mul(0x0000_0100_0000_01b3).rotate_left(31))
    }
}

/// A fingerprint of what the boxes and blocks of a tree depend on.
fn fingerprint(geometries: &[Geometry], parts: &Parts) -> u64 {
    let mut sum = Sum::new();
    for geometry in geometries {
        sum.add(bytemuck::cast_slice(&signature(geometry)));
        match &geometry.kind {
            GeometryKind::Mesh(mesh) => {
                sum.add(bytemuck::cast_slice(&mesh.origin.to_array()));
                sum.add(bytemuck::cast_slice(&mesh.positions));
                sum.add(bytemuck::cast_slice(&mesh.indices));
            }
            GeometryKind::PreciseMesh(mesh) => {
                sum.add(bytemuck::cast_slice(&mesh.positions));
                sum.add(bytemuck::cast_slice(&mesh.indices));
            }
            GeometryKind::Spheres(cloud) => {
                sum.add(bytemuck::cast_slice(&cloud.origin.to_array()));
                sum.add(bytemuck::cast_slice(&cloud.spheres));
            }
            // Only the boxes of these are in a tree.
            GeometryKind::Shape(_) | GeometryKind::Instance(_) | GeometryKind::Custom(_) => {}
        }
    }
    for boxed in &parts.boxed {
        sum.add(bytemuck::cast_slice(&[boxed.geometry, boxed.primitive]));
        sum.add(bytemuck::cast_slice(&boxed.bounds.min.to_array()));
        sum.add(bytemuck::cast_slice(&boxed.bounds.max.to_array()));
    }
    for entry in &parts.infinite {
        sum.add(bytemuck::cast_slice(&entry.to_words()));
    }
    sum.finish()
}

/// A fingerprint of what else the boxes of opened instances depend on.
fn fingerprint_of_parts(packed: &Packed, places: &Places) -> u64 {
    let mut sum = Sum::new();
    for (place, start) in &places.starts {
        sum.add(bytemuck::cast_slice(&[packed.entries[*place].geometry, start.word()]));
        if let Some(bounds) = &places.boxes[*place] {
            sum.add(bytemuck::cast_slice(&bounds.min.to_array()));
            sum.add(bytemuck::cast_slice(&bounds.max.to_array()));
        }
    }
    sum.finish()
}

/// The arrays of a tree as bytes, in the order of the file.
fn arrays(tree: &Tree) -> [&[u8]; ARRAYS] {
    let packed = &tree.packed;
    [
        bytemuck::cast_slice(&packed.nodes),
        bytemuck::cast_slice(&packed.blocks),
        bytemuck::cast_slice(&packed.ids),
        bytemuck::cast_slice(&packed.sphere_blocks),
        bytemuck::cast_slice(&packed.sphere_ids),
        bytemuck::cast_slice(&packed.entries),
        bytemuck::cast_slice(&tree.masks),
    ]
}

const SIZES: [usize; ARRAYS] = [
    size_of::<Node>(),
    size_of::<Line>(),
    size_of::<BlockIds>(),
    size_of::<SphereBlock>(),
    size_of::<BlockIds>(),
    size_of::<Entry>(),
    size_of::<u32>(),
];

fn padding(len: usize) -> usize {
    len.next_multiple_of(ALIGNMENT) - len
}

/// See [`Accel::save`].
pub(crate) fn save(tree: &Tree, path: &Path) -> io::Result<()> {
    if cfg!(target_endian = "big") {
        return Err(io::Error::new(io::ErrorKind::Unsupported, MapError::ByteOrder));
    }
    let invalid = |error| io::Error::new(io::ErrorKind::InvalidData, error);
    let parts = take_apart(&tree.geometries).map_err(|error| invalid(RefitError::Unsound(error)))?;
    let places = check_places(tree, &parts).map_err(invalid)?;
    let arrays = arrays(tree);
    let mut content = Sum::new();
    for array in arrays {
        content.add(array);
    }
    let mut header = MAGIC.to_vec();
    let words = [
        VERSION,
        BYTE_ORDER,
        tree.geometries.len() as u32,
        tree.masks.len() as u32,
        tree.packed.root.unwrap_or(NONE),
        0,
    ];
    words.iter().for_each(|word| header.extend_from_slice(&word.to_le_bytes()));
    for (array, size) in arrays.iter().zip(SIZES) {
        header.extend_from_slice(&((array.len() / size) as u64).to_le_bytes());
    }
    header.extend_from_slice(&fingerprint(&tree.geometries, &parts).to_le_bytes());
    header.extend_from_slice(&content.finish().to_le_bytes());
    header.extend_from_slice(&fingerprint_of_parts(&tree.packed, &places).to_le_bytes());
    header.resize(SEAL, 0);
    let mut seal = Sum::new();
    seal.add(&header);
    header.extend_from_slice(&seal.finish().to_le_bytes());
    header.resize(HEADER, 0);

    // Written next to the file, then renamed over it: processes that have the old file mapped keep it.
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(format!(".{}.part", std::process::id()));
    let beside = path.with_file_name(name);
    let write = || {
        let mut file = BufWriter::new(File::create(&beside)?);
        file.write_all(&header)?;
        for array in arrays {
            file.write_all(array)?;
            file.write_all(&[0; ALIGNMENT][..padding(array.len())])?;
        }
        file.into_inner().map_err(io::IntoInnerError::into_error)?.sync_all()?;
        std::fs::rename(&beside, path)
    };
    write().inspect_err(|_| {
        // It may not exist.
        let _ = std::fs::remove_file(&beside);
    })
}

/// The contents of a header.
struct Header {
    geometries: u32,
    root: u32,
    arrays: [Range<usize>; ARRAYS],
    fingerprint: u64,
    fingerprint_of_parts: u64,
}

fn read_header(bytes: &[u8]) -> Result<Header, LoadError> {
    let found = bytes.len();
    if !bytes.starts_with(&MAGIC) {
        return Err(LoadError::NotATree);
    }
    let Some((header, content)) = bytes.split_at_checked(HEADER) else {
        return Err(LoadError::WrongLength { found, expected: HEADER });
    };
    let word = |at: usize| u32::from_le_bytes(std::array::from_fn(|i| header[at + i]));
    let long = |at: usize| u64::from_le_bytes(std::array::from_fn(|i| header[at + i]));
    let version = word(8);
    if version != VERSION {
        return Err(LoadError::OtherVersion { found: version, expected: VERSION });
    }
    let mut seal = Sum::new();
    seal.add(&header[..SEAL]);
    let is_padded = header[SEAL + 8..].iter().all(|&byte| byte == 0);
    if seal.finish() != long(SEAL) || word(12) != BYTE_ORDER || !is_padded {
        return Err(LoadError::Damaged);
    }
    let mut start = HEADER;
    let mut arrays = [const { 0..0 }; ARRAYS];
    for (i, array) in arrays.iter_mut().enumerate() {
        let count = usize::try_from(long(32 + 8 * i)).unwrap_or(usize::MAX);
        let len = count.checked_mul(SIZES[i]).and_then(|len| len.checked_next_multiple_of(ALIGNMENT));
        let end = len.and_then(|len| start.checked_add(len));
        let Some(end) = end.filter(|&end| end <= found) else {
            return Err(LoadError::WrongLength { found, expected: end.unwrap_or(usize::MAX) });
        };
        *array = start..start + count * SIZES[i];
        start = end;
    }
    if start != found {
        return Err(LoadError::WrongLength { found, expected: start });
    }
    let mut sum = Sum::new();
    for array in &arrays {
        sum.add(&content[array.start - HEADER..array.end - HEADER]);
    }
    if sum.finish() != long(32 + 8 * ARRAYS + 8) {
        return Err(LoadError::Damaged);
    }
    let masks = (arrays[ARRAYS - 1].len() / SIZES[ARRAYS - 1]) as u64;
    if masks != u64::from(word(20)) || masks != 0 && masks != u64::from(word(16)) {
        return Err(LoadError::Inconsistent { what: format!("{masks} masks for {} geometries", word(16)) });
    }
    Ok(Header {
        geometries: word(16),
        root: word(24),
        arrays,
        fingerprint: long(32 + 8 * ARRAYS),
        fingerprint_of_parts: long(32 + 8 * ARRAYS + 16),
    })
}

/// Recomputes the checksums of a file whose header has the offsets of its arrays.
#[cfg(test)]
pub(crate) fn seal(bytes: &mut [u8]) {
    let long = |bytes: &[u8], at: usize| u64::from_le_bytes(std::array::from_fn(|i| bytes[at + i]));
    let mut content = Sum::new();
    let mut start = HEADER;
    for (i, size) in SIZES.iter().enumerate() {
        let Some(len) =
            usize::try_from(long(bytes, 32 + 8 * i)).ok().and_then(|count| count.checked_mul(*size))
        else {
            return;
        };
        let Some(array) = bytes.get(start..start.saturating_add(len)) else { return };
        content.add(array);
        start += len + padding(len);
    }
    bytes[32 + 8 * ARRAYS + 8..][..8].copy_from_slice(&content.finish().to_le_bytes());
    let mut seal = Sum::new();
    seal.add(&bytes[..SEAL]);
    bytes[SEAL..SEAL + 8].copy_from_slice(&seal.finish().to_le_bytes());
}

/// See [`Accel::map`].
pub(crate) fn map(path: &Path, geometries: Vec<Geometry>) -> Result<Tree, MapError> {
    if cfg!(target_endian = "big") {
        return Err(MapError::ByteOrder);
    }
    let file = File::open(path).map_err(MapError::Io)?;
    Ok(over_mapped(Arc::new(map_file(&file).map_err(MapError::Io)?), geometries)?)
}

/// The one call whose safety the compiler cannot check.
#[allow(unsafe_code)]
fn map_file(file: &File) -> io::Result<Mmap> {
    // SAFETY: the bytes must not change while they are mapped, which no program can ensure: `Accel::map` requires it of
    // its callers. `save` never changes files in place, but replaces them.
    unsafe { Mmap::map(file) }
}

fn over_mapped(file: Arc<Mmap>, geometries: Vec<Geometry>) -> Result<Tree, LoadError> {
    let header = read_header(&file)?;
    if geometries.len() != header.geometries as usize {
        let error = RefitError::OtherLength { expected: header.geometries as usize, found: geometries.len() };
        return Err(LoadError::OtherGeometries(error));
    }
    let unsound = |error| LoadError::OtherGeometries(RefitError::Unsound(error));
    let parts = take_apart(&geometries).map_err(unsound)?;
    if fingerprint(&geometries, &parts) != header.fingerprint {
        return Err(LoadError::Moved);
    }
    fn array<T: Pod>(file: &Arc<Mmap>, header: &Header, i: usize) -> Result<Store<T>, LoadError> {
        let what = || LoadError::Inconsistent { what: format!("array {i} is not aligned") };
        Store::mapped(file, header.arrays[i].clone()).ok_or_else(what)
    }
    let packed = Packed {
        nodes: array(&file, &header, 0)?,
        blocks: array(&file, &header, 1)?,
        ids: array(&file, &header, 2)?,
        sphere_blocks: array(&file, &header, 3)?,
        sphere_ids: array(&file, &header, 4)?,
        entries: array(&file, &header, 5)?,
        root: (header.root != NONE).then_some(header.root),
    };
    check_lanes(&packed)?;
    let places = packed.blocks().places(&packed.ids).ok_or_else(|| LoadError::Inconsistent {
        what: "the blocks of triangles are not such as their names say".to_owned(),
    })?;
    check_structure(&packed, &geometries, |leaf| {
        let numbers = packed.blocks().numbers(leaf)?;
        (places.get(numbers.start) == Some(&(tag::place(leaf) as u32))).then_some(numbers)
    })?;
    check_ids(&packed, &geometries)?;
    let masks: Store<u32> = array(&file, &header, 6)?;
    let tree_space = units_of(&geometries, &parts);
    let (sizes, bounds, primitives) = (parts.sizes, parts.bounds, parts.count());
    let tree_parts = TreeParts { tree_space, packed, sizes, bounds, infinite: Vec::new(), primitives };
    let tree = Tree { masks: masks.to_vec(), ..Tree::assemble(geometries, tree_parts) };
    let places = check_places(&tree, &parts).map_err(LoadError::OtherGeometries)?;
    let is_as_saved =
        |&(place, start): &(usize, Start)| tree.packed.entries[place].primitive() == start.word();
    let print = fingerprint_of_parts(&tree.packed, &places);
    if !places.starts.iter().all(is_as_saved) || print != header.fingerprint_of_parts {
        return Err(LoadError::Moved);
    }
    Ok(Tree { infinite: parts.infinite, ..tree })
}

/// Checks that no ray can meet an unused lane, so that its reference is never followed.
fn check_lanes(packed: &Packed) -> Result<(), LoadError> {
    if packed.sphere_blocks.len() != packed.sphere_ids.len() {
        return Err(LoadError::Inconsistent {
            what: "there are not as many names as blocks of spheres".to_owned(),
        });
    }
    for (place, node) in packed.nodes.iter().enumerate() {
        let len = node.len();
        if len == 0 {
            return Err(LoadError::Inconsistent { what: format!("node {place} has no child") });
        }
        let is_empty = |lane: usize| {
            node.children[lane] == Node::ABSENT
                && (0..6)
                    .all(|side| node.planes[side][lane].to_bits() == Node::EMPTY.planes[side][lane].to_bits())
        };
        if !(len..WIDTH).all(is_empty) {
            let what = format!("node {place} has a box without a child");
            return Err(LoadError::Inconsistent { what });
        }
    }
    let unnamed = |ids: &BlockIds| ids.primitives.map(|primitive| primitive == NONE);
    for (place, (block, ids)) in packed.sphere_blocks.iter().zip(&packed.sphere_ids).enumerate() {
        let is_nothing =
            |lane: usize| block.radii[lane].is_nan() && block.centers.iter().all(|axis| axis[lane].is_nan());
        if unnamed(ids).into_iter().enumerate().any(|(lane, is_unnamed)| is_unnamed && !is_nothing(lane)) {
            let what = format!("block of spheres {place} has something without a name");
            return Err(LoadError::Inconsistent { what });
        }
    }
    Ok(())
}
