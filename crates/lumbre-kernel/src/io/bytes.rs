//! A tree as bytes, and back.
//!
//! The bytes hold the structure of the tree: the nesting of nodes, and the primitives of each leaf, about six bytes per
//! triangle. Boxes and packed corners are recomputed from the geometries when the bytes are read, in a fraction of the
//! time of a build. So bytes from elsewhere cannot make a tree that answers wrongly: they are refused, or they only
//! rearrange the given geometry. To map a tree into memory as it is, see `mapped`.
//!
//! All numbers are little-endian u32. The file: eight bytes of magic; the version; the numbers of geometries, nodes,
//! blocks, blocks of spheres, entries and masks; the reference to the root, or 2³² - 1; for each geometry its kind and
//! number of primitives; for each node the number of its children, and references to them; for each block its geometry
//! and eight triangles, 2³² - 1 for none; the same for each block of spheres; for each entry its geometry and primitive
//! (for an opened instance, the node of its tree where it is entered: see `open_instances`), with the top bit set in
//! the last of a leaf; the masks. Then an eight-byte checksum of everything before it: 64-bit FNV-1a (G. Fowler, L.
//! Noll, K. Vo, D. Eastlake, "The FNV Non-Cryptographic Hash Algorithm").

use std::collections::BTreeSet;
use std::fmt;
use std::ops::Range;

use crate::build::error::BuildError;
use crate::build::input::{empty_over, take_apart};
use crate::build::open_instances::is_part;
use crate::build::refit::{self, RefitError};
use crate::intersect::Isa;
use crate::tree::Tree;
use crate::tree::node::{Node, WIDTH, tag};
use crate::tree::packed::{Entry, Packed};
use crate::tree::sphere_block::SphereBlock;
use crate::tree::triangle_block::BlockIds;
use crate::tree::{Geometry, GeometryKind};

const MAGIC: [u8; 8] = *b"LumbTree";
/// Changes with the format, and with the meaning of its numbers.
const VERSION: u32 = 8;
const NONE: u32 = u32::MAX;

/// Why bytes are no tree over these geometries.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum LoadError {
    /// They do not begin like a saved tree.
    NotATree,
    /// They are of another version of the format.
    OtherVersion {
        /// The version of the bytes.
        found: u32,
        /// The version that this crate reads.
        expected: u32,
    },
    /// They are too short or too long.
    WrongLength {
        /// Number of bytes.
        found: usize,
        /// Expected number of bytes; a lower bound if they end within the header.
        expected: usize,
    },
    /// The checksum differs: some bytes were changed.
    Damaged,
    /// A reference or a primitive id is out of range, or used twice: no version of this crate wrote that.
    Inconsistent {
        /// The fault and its place.
        what: String,
    },
    /// The geometries have the right kinds and sizes, but differ from the ones that the mapped tree was saved with:
    /// vertices, shapes or transforms moved.
    Moved,
    /// The tree was built of other geometries, or these changed too much.
    OtherGeometries(RefitError),
}

impl fmt::Display for LoadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotATree => write!(f, "these bytes are no saved tree"),
            Self::OtherVersion { found, expected } => {
                write!(f, "the tree was saved in version {found} of the format, and {expected} is read")
            }
            Self::WrongLength { found, expected } => {
                write!(f, "the saved tree has {found} bytes instead of {expected}")
            }
            Self::Damaged => write!(f, "the saved tree is damaged: its checksum is wrong"),
            Self::Inconsistent { what } => write!(f, "the saved tree is inconsistent: {what}"),
            Self::Moved => write!(f, "the saved tree does not fit: the geometries moved since"),
            Self::OtherGeometries(error) => write!(f, "the saved tree does not fit: {error}"),
        }
    }
}

impl std::error::Error for LoadError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::OtherGeometries(error) => Some(error),
            _ => None,
        }
    }
}

fn checksum(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

/// The kind of a geometry in a file, and its number of primitives.
pub(crate) fn signature(geometry: &Geometry) -> [u32; 2] {
    match &geometry.kind {
        GeometryKind::Mesh(mesh) => [tag::TRIANGLES, mesh.indices.len() as u32],
        GeometryKind::Spheres(cloud) => [tag::SPHERES, cloud.spheres.len() as u32],
        GeometryKind::PreciseMesh(mesh) => [tag::PRECISE, mesh.indices.len() as u32],
        GeometryKind::Shape(_) => [tag::SHAPES, 1],
        GeometryKind::Instance(_) => [tag::INSTANCE, 1],
        GeometryKind::Custom(custom) => [tag::CUSTOM, custom.primitive_count()],
    }
}

/// See [`Accel::to_bytes`].
pub(crate) fn to_bytes(tree: &Tree) -> Vec<u8> {
    let packed = &tree.packed;
    let mut bytes = MAGIC.to_vec();
    let mut put = |number: u32| bytes.extend_from_slice(&number.to_le_bytes());
    put(VERSION);
    put(tree.geometries.len() as u32);
    put(packed.nodes.len() as u32);
    put(packed.ids.len() as u32);
    put(packed.sphere_ids.len() as u32);
    put(packed.entries.len() as u32);
    put(tree.masks.len() as u32);
    // References to triangles hold block numbers; the lines of the blocks are recomputed.
    let numbered = |reference: u32| {
        if tag::of(reference) == tag::TRIANGLES {
            let numbers = packed.numbers(reference);
            tag::triangles(numbers.start as u32, numbers.len() as u32)
        } else {
            reference
        }
    };
    put(packed.root.map_or(NONE, numbered));
    tree.geometries.iter().flat_map(signature).for_each(&mut put);
    for node in &packed.nodes {
        put(node.len() as u32);
        node.children[..node.len()].iter().map(|&child| numbered(child)).for_each(&mut put);
    }
    for ids in packed.ids.iter().chain(&packed.sphere_ids) {
        put(ids.geometry);
        ids.primitives.iter().copied().for_each(&mut put);
    }
    for entry in &packed.entries {
        entry.to_words().into_iter().for_each(&mut put);
    }
    tree.masks.iter().copied().for_each(&mut put);
    let checksum = checksum(&bytes);
    bytes.extend_from_slice(&checksum.to_le_bytes());
    bytes
}

/// Reads numbers from the front.
struct Words<'a> {
    words: &'a [[u8; 4]],
}

impl Words<'_> {
    /// A number; `None` at the end.
    fn next(&mut self) -> Option<u32> {
        self.words.split_off_first().map(|word| u32::from_le_bytes(*word))
    }

    fn array<const N: usize>(&mut self) -> Option<[u32; N]> {
        let mut words = [0; N];
        for word in &mut words {
            *word = self.next()?;
        }
        Some(words)
    }
}

const HEADER: usize = MAGIC.len() + 8 * 4;
const CHECKSUM: usize = 8;

/// See [`Accel::from_bytes`].
pub(crate) fn from_bytes(bytes: &[u8], geometries: Vec<Geometry>) -> Result<Tree, LoadError> {
    let found = bytes.len();
    let Some(rest) = bytes.strip_prefix(&MAGIC) else { return Err(LoadError::NotATree) };
    if found < HEADER + CHECKSUM {
        return Err(LoadError::WrongLength { found, expected: HEADER + CHECKSUM });
    }
    // The version first: nothing else is known of other versions.
    let (all, _) = rest.as_chunks::<4>();
    let mut words = Words { words: all };
    let version = words.next().unwrap_or_default();
    if version != VERSION {
        return Err(LoadError::OtherVersion { found: version, expected: VERSION });
    }
    let [geometry_count, node_count, block_count, sphere_block_count, entry_count, mask_count, root] =
        words.array().unwrap_or_default();
    let counted = |count: u32, least: u64| u64::from(count) * least;
    // A node has at least a length and one child.
    let least = (HEADER + CHECKSUM) as u64
        + counted(geometry_count, 8)
        + counted(node_count, 8)
        + counted(block_count, 36)
        + counted(sphere_block_count, 36)
        + counted(entry_count, 8)
        + counted(mask_count, 4);
    if (found as u64) < least || !found.is_multiple_of(4) {
        let expected = usize::try_from(least).unwrap_or(usize::MAX);
        return Err(LoadError::WrongLength { found, expected });
    }
    let (content, sum) = bytes.split_at(found - CHECKSUM);
    if checksum(content).to_le_bytes() != *sum {
        return Err(LoadError::Damaged);
    }
    words.words = &words.words[..words.words.len() - CHECKSUM / 4];
    let ends = || LoadError::WrongLength { found, expected: found + 4 };

    if geometries.len() != geometry_count as usize {
        let error = RefitError::OtherLength { expected: geometry_count as usize, found: geometries.len() };
        return Err(LoadError::OtherGeometries(error));
    }
    for (geometry, standing) in geometries.iter().enumerate() {
        if words.array().ok_or_else(ends)? != signature(standing) {
            return Err(LoadError::OtherGeometries(RefitError::OtherTopology { geometry }));
        }
    }
    let mut packed = Packed { root: (root != NONE).then_some(root), ..Packed::default() };
    let mut nodes = Vec::with_capacity(node_count as usize);
    for place in 0..node_count {
        let len = words.next().ok_or_else(ends)?;
        if len == 0 || len as usize > WIDTH {
            return inconsistent(format!("node {place} has {len} children"));
        }
        let mut node = Node::EMPTY;
        for child in &mut node.children[..len as usize] {
            *child = words.next().ok_or_else(ends)?;
        }
        if node.len() != len as usize {
            return inconsistent(format!("node {place} lacks a child"));
        }
        nodes.push(node);
    }
    packed.nodes = nodes.into();
    let mut ids = Vec::with_capacity(block_count as usize);
    for _ in 0..block_count {
        let geometry = words.next().ok_or_else(ends)?;
        ids.push(BlockIds { geometry, primitives: words.array().ok_or_else(ends)? });
    }
    packed.ids = ids.into();
    let mut ids = Vec::with_capacity(sphere_block_count as usize);
    for _ in 0..sphere_block_count {
        let geometry = words.next().ok_or_else(ends)?;
        ids.push(BlockIds { geometry, primitives: words.array().ok_or_else(ends)? });
    }
    packed.sphere_ids = ids.into();
    let mut entries = Vec::with_capacity(entry_count as usize);
    for _ in 0..entry_count {
        entries.push(Entry::from_words(words.array().ok_or_else(ends)?));
    }
    packed.entries = entries.into();
    if mask_count != 0 && mask_count != geometry_count {
        return inconsistent(format!("{mask_count} masks for {geometry_count} geometries"));
    }
    let mut masks = Vec::with_capacity(mask_count as usize);
    for _ in 0..mask_count {
        masks.push(words.next().ok_or_else(ends)?);
    }
    if !words.words.is_empty() {
        return Err(LoadError::WrongLength { found, expected: found - 4 * words.words.len() });
    }
    let unsound = |error: BuildError| LoadError::OtherGeometries(RefitError::Unsound(error));
    let parts = take_apart(&geometries).map_err(unsound)?;
    check_structure(&packed, &geometries, |leaf| Some(tag::blocks(leaf)))?;
    check_ids(&packed, &geometries)?;
    packed.pack_triangles(Isa::best(), &geometries, parts.has_flat);
    packed.sphere_blocks = vec![SphereBlock::EMPTY; packed.sphere_ids.len()].into();

    let mut tree = empty_over(geometries);
    tree.packed = packed;
    tree.masks = masks;
    let places = refit::check_places(&tree, &parts).map_err(LoadError::OtherGeometries)?;
    refit::fit(&mut tree, parts, places);
    Ok(tree)
}

fn inconsistent<T>(what: String) -> Result<T, LoadError> {
    Err(LoadError::Inconsistent { what })
}

/// Checks that exactly one reference, from an earlier node, refers to every node but the first, to every block and to
/// every entry. `numbers` returns the block numbers of a leaf of triangles.
pub(crate) fn check_structure(
    packed: &Packed,
    geometries: &[Geometry],
    numbers: impl Fn(u32) -> Option<Range<usize>>,
) -> Result<(), LoadError> {
    let mut nodes = vec![false; packed.nodes.len()];
    let mut blocks = vec![false; packed.ids.len()];
    let mut sphere_blocks = vec![false; packed.sphere_ids.len()];
    let mut entries = vec![false; packed.entries.len()];
    let mut take = |reference: u32, parent: Option<usize>| -> Option<()> {
        let once = |taken: &mut [bool], place: usize| {
            let taken = taken.get_mut(place)?;
            (!std::mem::replace(taken, true)).then_some(())
        };
        let place = tag::place(reference);
        match tag::of(reference) {
            tag::INNER => {
                let is_behind = parent.map_or(place == 0, |parent| place > parent);
                if is_behind { once(&mut nodes, place) } else { None }
            }
            tag::TRIANGLES => {
                let numbers = numbers(reference)?;
                are_of_one(packed.ids.get(numbers.clone())?)?;
                numbers.into_iter().try_for_each(|block| once(&mut blocks, block))
            }
            tag::SPHERES => {
                are_of_one(packed.sphere_ids.get(tag::blocks(reference))?)?;
                tag::blocks(reference).try_for_each(|block| once(&mut sphere_blocks, block))
            }
            kind @ (tag::SHAPES | tag::INSTANCE | tag::CUSTOM | tag::PRECISE) => {
                for (place, entry) in packed.entries.iter().enumerate().skip(place) {
                    once(&mut entries, place)?;
                    if signature(geometries.get(entry.geometry as usize)?)[0] != kind {
                        return None;
                    }
                    if entry.is_last() {
                        return Some(());
                    }
                    if kind == tag::INSTANCE {
                        return None;
                    }
                }
                None
            }
            _ => None,
        }
    };
    if let Some(root) = packed.root
        && take(root, None).is_none()
    {
        return inconsistent(format!("the root's reference {root:#010x} is out of range"));
    }
    for (place, node) in packed.nodes.iter().enumerate() {
        for &child in &node.children[..node.len()] {
            if take(child, Some(place)).is_none() {
                return inconsistent(format!(
                    "reference {child:#010x} of node {place} is out of range or used twice"
                ));
            }
        }
    }
    let unused =
        [("node", &nodes), ("block", &blocks), ("block of spheres", &sphere_blocks), ("entry", &entries)]
            .into_iter()
            .find_map(|(what, taken)| Some((what, taken.iter().position(|taken| !taken)?)));
    match unused {
        Some((what, place)) => inconsistent(format!("{what} {place} is named nowhere")),
        None => Ok(()),
    }
}

/// Checks that the blocks of a leaf are of one geometry: the leaf has one origin.
fn are_of_one(ids: &[BlockIds]) -> Option<()> {
    ids.iter().all(|block| block.geometry == ids[0].geometry).then_some(())
}

/// Checks that every id is of a primitive, and that no primitive appears twice, except opened instances.
pub(crate) fn check_ids(packed: &Packed, geometries: &[Geometry]) -> Result<(), LoadError> {
    // The index of each geometry's first primitive, in one list.
    let mut starts = Vec::with_capacity(geometries.len());
    let mut all = 0;
    for geometry in geometries {
        starts.push(all);
        all += signature(geometry)[1] as usize;
    }
    let mut named = vec![false; all];
    let is_packed = |kind: u32| matches!(kind, tag::TRIANGLES | tag::SPHERES);
    let mut name = |kind: Option<u32>, geometry: u32, primitive: u32| {
        let [found, count] = signature(geometries.get(geometry as usize)?);
        let is_right = kind.map_or(!is_packed(found), |kind| kind == found) && primitive < count;
        if !is_right {
            return None;
        }
        let place = starts[geometry as usize] + primitive as usize;
        (!std::mem::replace(&mut named[place], true)).then_some(())
    };
    let of_triangles = (&packed.ids, tag::TRIANGLES, ["block", "triangle", "mesh"]);
    let of_spheres = (&packed.sphere_ids, tag::SPHERES, ["block of spheres", "sphere", "cloud"]);
    for (list, kind, [what, one, all]) in [of_triangles, of_spheres] {
        for (block, ids) in list.iter().enumerate() {
            let geometry = ids.geometry;
            // An empty block must still belong to a geometry of its kind.
            let is_right = geometries.get(geometry as usize).is_some_and(|g| signature(g)[0] == kind);
            for primitive in ids.primitives.into_iter().filter(|&primitive| primitive != NONE) {
                if name(Some(kind), geometry, primitive).is_none() {
                    return inconsistent(format!(
                        "{what} {block} names {one} {primitive} of geometry {geometry}, which is not there or was named"
                    ));
                }
            }
            if !is_right {
                return inconsistent(format!("{what} {block} is of geometry {geometry}, which is no {all}"));
            }
        }
    }
    let mut opened = BTreeSet::new();
    for (place, entry) in packed.entries.iter().enumerate() {
        // A later check, with boxes, sees whether the parts of an instance are complete.
        let is_part = is_part(entry, geometries);
        if is_part && !opened.insert(entry.geometry) {
            continue;
        }
        if name(None, entry.geometry, if is_part { 0 } else { entry.primitive() }).is_none() {
            return inconsistent(format!("entry {place} names a primitive that is not there or was named"));
        }
    }
    Ok(())
}
