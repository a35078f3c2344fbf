//! Triangles packed by eight, in blocks of whole cache lines.
//!
//! A block that shares its vertices takes three cache lines, one that does not takes five. References in nodes name the line where
//! the first block of a leaf begins; its other blocks follow. Primitive ids stand in an array of their own, because only the winner
//! of a search needs them.
//!
//! A block that shares its vertices has seven for its first four triangles and seven for its last four, in rows of x, y and z. AVX2
//! cannot look up across the middle of a 256-bit vector quickly, so a row is read as sixteen numbers of which either half of the
//! lanes finds its own in the same half of two vectors:
//!
//! | | near | far |
//! |---|---|---|
//! | first four triangles | 1 to 3 | 8 to 11 |
//! | last four triangles | 4 to 7 | 12 to 14 |
//!
//! Numbers 0 and 15 belong to what stands before and behind the row. Four neighbouring triangles have six vertices as a rule. Which
//! four come first is chosen so that neither half needs more than seven; where that is not possible, nothing is shared.

use bytemuck::{Pod, Zeroable};

use crate::simd;
use crate::tree::node::{out_of_tree, tag};
use crate::tree::{BLOCK, Corners, Name};

/// The primitives of a block.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct BlockNames {
    /// Positions in the mesh's list.
    pub(crate) primitives: [u32; BLOCK],
    /// Position of the mesh in the tree's list.
    pub(crate) geometry: u32,
}

impl BlockNames {
    /// A bit for each lane that is taken.
    pub(crate) fn lanes(&self) -> u32 {
        let lane = |(lane, &primitive): (usize, &u32)| u32::from(primitive != u32::MAX) << lane;
        self.primitives.iter().enumerate().map(lane).sum()
    }

    /// The names in a block without triangles.
    pub(crate) fn empty(geometry: u32) -> Self {
        Self { primitives: [u32::MAX; BLOCK], geometry }
    }

    /// Of one to eight primitives of one geometry.
    pub(crate) fn of(names: &[Name]) -> Self {
        let mut named = Self::empty(names[0][0]);
        for (place, name) in named.primitives.iter_mut().zip(names) {
            *place = name[1];
        }
        named
    }

    /// The positions of those that are there.
    #[inline(always)]
    pub(crate) fn primitives(&self) -> impl Iterator<Item = u32> {
        self.primitives.into_iter().take_while(|&primitive| primitive != u32::MAX)
    }
}

/// A cache line of a list of blocks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C, align(64))]
pub(crate) struct Line([u32; 16]);

/// What stands before the vertices of a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Head {
    /// How many blocks there are before this one: the index of its names.
    pub(crate) number: u32,
    /// A bit for each lane that has a triangle.
    pub(crate) taken: u8,
    /// 1 where each corner has a vertex of its own, otherwise 0.
    pub(crate) is_unshared: u8,
    /// How many blocks of the same leaf follow.
    pub(crate) followers: u8,
    pub(crate) padding: u8,
    /// The vertex of each corner, four bits for each lane. An empty lane has the first vertex of its half; an unshared block has zeros.
    pub(crate) corners: [u32; 3],
}

impl Head {
    /// Where the corners begin, in words.
    const CORNERS: usize = 2;
    const WORDS: usize = size_of::<Self>() / size_of::<u32>();
}

const _: () = assert!(std::mem::offset_of!(Head, corners) == 4 * Head::CORNERS);

/// Half of a block's lanes, and as many numbers as 128 bits hold.
pub(crate) const QUAD: usize = BLOCK / 2;
/// The most vertices that either half of a block shares.
pub(crate) const MOST_IN_HALF: usize = 7;
/// The numbers that a vertex may have in a row of a block that shares them.
pub(crate) const SHARED_NUMBERS: usize = 16;
const SHARED_LINES: usize = 3;
const UNSHARED_LINES: usize = 5;
const LINE_WORDS: usize = size_of::<Line>() / size_of::<u32>();
/// Words of the longer block.
pub(crate) const BLOCK_WORDS: usize = UNSHARED_LINES * LINE_WORDS;

/// The word where an axis's row begins in a block that shares its vertices: the sixteen numbers of one row overlap those of the next.
pub(crate) const fn shared_row(axis: usize) -> usize {
    Head::WORDS - 1 + 2 * MOST_IN_HALF * axis
}

/// The word where an axis's row begins in a block that does not: eight aligned numbers for each corner.
pub(crate) const fn unshared_row(axis: usize) -> usize {
    BLOCK + 3 * BLOCK * axis
}

const _: () = assert!(shared_row(2) + SHARED_NUMBERS == SHARED_LINES * LINE_WORDS);
const _: () = assert!(unshared_row(0) >= Head::WORDS && unshared_row(3) == BLOCK_WORDS);
// Lines are numbered by `u32`, and by the place of a reference.
const _: () =
    assert!((tag::BLOCK_PLACES + tag::MOST_BLOCKS) as usize * UNSHARED_LINES <= tag::PLACE as usize);

/// Up to eight triangles of one mesh. Where vertices are shared, the last lines belong to the next block.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(64))]
pub(crate) struct TriangleBlock {
    head: Head,
    /// Coordinates relative to the mesh's origin.
    coordinates: [f32; BLOCK_WORDS - Head::WORDS],
}

const _: () = assert!(size_of::<TriangleBlock>() == size_of::<[Line; UNSHARED_LINES]>());

/// The vertex of a corner in a lane, as its number in a row.
#[inline(always)]
pub(crate) fn vertex_at(head: &Head, corner: usize, lane: usize) -> usize {
    if head.is_unshared != 0 {
        return BLOCK * corner + lane;
    }
    (head.corners[corner] >> (4 * lane)) as usize % SHARED_NUMBERS
}

/// The number of a vertex of one half of a block that shares them, counted from 0 there.
#[inline(always)]
pub(crate) fn shared_number(half: usize, index: u32) -> u32 {
    let number = [1, QUAD as u32][half] + index;
    // Behind the near ones of this half stand those of the other.
    let is_far = number >= (QUAD * (half + 1)) as u32;
    number + QUAD as u32 * u32::from(is_far)
}

/// Whether a triangle in a lane may have the vertex of that number.
fn is_within_reach(lane: usize, number: usize) -> bool {
    number / QUAD % 2 == lane / QUAD && number != 0 && number != SHARED_NUMBERS - 1
}

/// Where an axis's row begins in a block.
#[inline(always)]
pub(crate) fn row(is_unshared: bool, axis: usize) -> usize {
    if is_unshared { unshared_row(axis) } else { shared_row(axis) }
}

pub(crate) const fn lines_of(is_unshared: bool) -> usize {
    if is_unshared { UNSHARED_LINES } else { SHARED_LINES }
}

impl TriangleBlock {
    /// The index of its names.
    #[inline(always)]
    pub(crate) fn number(&self) -> u32 {
        self.head.number
    }

    /// A bit for each lane that has a triangle.
    #[inline(always)]
    pub(crate) fn taken(&self) -> u32 {
        self.head.taken.into()
    }

    /// Whether each corner has a vertex of its own.
    #[inline(always)]
    pub(crate) fn is_unshared(&self) -> bool {
        self.head.is_unshared != 0
    }

    /// The vertex of each corner, four bits for each lane, where vertices are shared.
    #[inline(always)]
    pub(crate) fn corners(&self) -> &[u32; 3] {
        &self.head.corners
    }

    /// The same with the word behind them, so that four can be loaded at once.
    #[inline(always)]
    pub(crate) fn corners_and_more(&self) -> &[u32; 4] {
        let words: &[u32; BLOCK_WORDS] = bytemuck::cast_ref(self);
        words[Head::CORNERS..].first_chunk().expect("four")
    }

    /// The whole block as numbers: see [`shared_row`] and [`unshared_row`].
    #[inline(always)]
    pub(crate) fn words(&self) -> &[f32; BLOCK_WORDS] {
        bytemuck::cast_ref(self)
    }

    /// The vertices of the corners in a lane, as their numbers in a row: below 16, or below 24 where they are not shared.
    #[inline(always)]
    pub(crate) fn vertices_at(&self, lane: usize) -> [usize; 3] {
        // No closure: it would not take on the instruction set of its caller.
        let (head, lane) = (&self.head, lane % BLOCK);
        [vertex_at(head, 0, lane), vertex_at(head, 1, lane), vertex_at(head, 2, lane)]
    }

    /// The corners of the triangle in a lane.
    pub(crate) fn triangle(&self, lane: usize) -> [[f32; 3]; 3] {
        let rows = [0, 1, 2].map(|axis| row(self.is_unshared(), axis));
        self.vertices_at(lane).map(|vertex| rows.map(|row| self.words()[row + vertex]))
    }

    /// The corners of each triangle.
    pub(crate) fn triangles(&self) -> impl Iterator<Item = [[f32; 3]; 3]> {
        (0..BLOCK).filter(|lane| self.taken() >> lane & 1 != 0).map(|lane| self.triangle(lane))
    }

    /// The corners of its triangles, where each has a vertex of its own.
    #[inline(always)]
    pub(crate) fn own_corners(&self) -> &Corners {
        let own = self.words()[unshared_row(0)..].first_chunk::<{ 9 * BLOCK }>();
        bytemuck::cast_ref(own.expect("a block is as long"))
    }

    /// Prefetches it.
    #[inline(always)]
    pub(crate) fn fetch(&self) {
        let lines: &[Line; UNSHARED_LINES] = bytemuck::cast_ref(self);
        lines.first_chunk::<SHARED_LINES>().map(simd::fetch);
    }

    /// Whether it is the last of its leaf.
    #[inline(always)]
    pub(crate) fn is_last(&self) -> bool {
        self.head.followers == 0
    }

    /// Where the block behind it begins, if this one begins at `place`.
    #[inline(always)]
    pub(crate) fn place_behind(&self, place: u32) -> u32 {
        place + lines_of(self.is_unshared()) as u32
    }

    /// Where the next block of its leaf begins, if this one begins at `place`.
    #[inline(always)]
    pub(crate) fn next(&self, place: u32) -> Option<u32> {
        (!self.is_last()).then(|| self.place_behind(place))
    }
}

/// The blocks of a tree.
#[derive(Clone, Copy)]
pub(crate) struct Blocks<'a>(&'a [Line]);

impl<'a> Blocks<'a> {
    #[inline(always)]
    pub(crate) fn new(lines: &'a [Line]) -> Self {
        Self(lines)
    }

    /// The block that begins at a line.
    #[inline(always)]
    pub(crate) fn at(self, place: u32) -> Option<&'a TriangleBlock> {
        let lines = self.0.get(place as usize..place as usize + UNSHARED_LINES)?;
        Some(bytemuck::cast_ref::<[Line; UNSHARED_LINES], TriangleBlock>(lines.try_into().ok()?))
    }

    /// The same, for a reference in the tree.
    ///
    /// # Panics
    /// When there is none.
    #[inline(always)]
    pub(crate) fn block(self, place: u32) -> &'a TriangleBlock {
        match self.at(place) {
            Some(block) => block,
            None => out_of_tree(),
        }
    }

    /// The numbers of the blocks of a leaf.
    pub(crate) fn numbers(self, leaf: u32) -> Option<std::ops::Range<usize>> {
        let head = self.at(tag::place(leaf) as u32)?.head;
        let first = head.number as usize;
        Some(first..first + usize::from(head.followers) + 1)
    }

    /// The blocks of a leaf.
    pub(crate) fn leaf(self, leaf: u32) -> impl Iterator<Item = &'a TriangleBlock> {
        let mut place = Some(tag::place(leaf) as u32);
        std::iter::from_fn(move || {
            let block = self.at(place?)?;
            place = block.next(place?);
            Some(block)
        })
    }

    /// How many blocks of its leaf follow each of the first `count`.
    pub(crate) fn followers(self, count: usize) -> Vec<u8> {
        let mut followers = Vec::with_capacity(count);
        let mut place = 0;
        while followers.len() < count
            && let Some(block) = self.at(place)
        {
            followers.push(block.head.followers);
            place = block.place_behind(place);
        }
        followers
    }

    /// Where every block begins, if they are such as [`pack`] makes of so many names.
    pub(crate) fn places(self, names: &[BlockNames]) -> Option<Vec<u32>> {
        let mut places = Vec::with_capacity(names.len());
        let (mut place, mut followers) = (0, 0);
        for (number, names) in names.iter().enumerate() {
            let block = self.at(place)?;
            let head = &block.head;
            let named = names.primitives.iter().enumerate();
            let named = named.fold(0, |lanes, (lane, &name)| lanes | u8::from(name != u32::MAX) << lane);
            let are_there = |lane: usize| block.vertices_at(lane).iter().all(|&v| is_within_reach(lane, v));
            let is_sound = head.number as usize == number
                && head.taken & !named == 0
                && head.is_unshared <= 1
                && (block.is_unshared() || (0..BLOCK).all(are_there))
                && usize::from(head.followers) < tag::MOST_BLOCKS as usize
                && (followers == 0 || head.followers == followers - 1);
            if !is_sound {
                return None;
            }
            followers = head.followers;
            places.push(place);
            place = block.place_behind(place);
        }
        let all = if names.is_empty() { 0 } else { place as usize + MARGIN };
        (followers == 0 && self.0.len() == all).then_some(places)
    }
}

/// Lines behind the last block, so that it can be read as the longer one.
pub(crate) const MARGIN: usize = UNSHARED_LINES - SHARED_LINES;
