//! Triangles packed by eight, in blocks of whole cache lines.
//!
//! A block that shares its vertices takes three cache lines, one that does not takes five. References in nodes hold the
//! line where the first block of a leaf begins; its other blocks follow. Primitive ids are in an array of their own,
//! because only the winner of a search needs them.
//!
//! If vertices are shared, one line holds x, the next y and the third z: fourteen numbers between two words of the
//! block's head. The first four triangles have seven of the vertices and the last four the other seven. AVX2 cannot
//! look up across the middle of a 256-bit vector quickly. So a line is read as two vectors, and each half of the lanes
//! finds its numbers in the same half of both:
//!
//! | | first vector | second vector |
//! |---|---|---|
//! | first four triangles | 1 to 3 | 8 to 11 |
//! | last four triangles | 4 to 7 | 12 to 14 |
//!
//! Four neighbouring triangles usually have six vertices. The triangles are divided so that neither half needs more
//! than seven; if that is impossible, nothing is shared.

use bytemuck::{Pod, Zeroable};

use crate::simd;
use crate::tree::node::{out_of_tree, tag};
use crate::tree::{BLOCK, Corners, PrimitiveId};

/// The primitives of a block.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct BlockIds {
    /// Positions in the mesh's list.
    pub(crate) primitives: [u32; BLOCK],
    /// Position of the mesh in the tree's list.
    pub(crate) geometry: u32,
}

impl BlockIds {
    /// A bit for each used lane.
    pub(crate) fn lanes(&self) -> u32 {
        let lane = |(lane, &primitive): (usize, &u32)| u32::from(primitive != u32::MAX) << lane;
        self.primitives.iter().enumerate().map(lane).sum()
    }

    /// The ids of a block without triangles.
    pub(crate) fn empty(geometry: u32) -> Self {
        Self { primitives: [u32::MAX; BLOCK], geometry }
    }

    /// For one to eight primitives of one geometry.
    pub(crate) fn of(ids: &[PrimitiveId]) -> Self {
        let mut named = Self::empty(ids[0][0]);
        for (place, name) in named.primitives.iter_mut().zip(ids) {
            *place = name[1];
        }
        named
    }

    /// The positions in used lanes.
    #[inline(always)]
    pub(crate) fn primitives(&self) -> impl Iterator<Item = u32> {
        self.primitives.into_iter().take_while(|&primitive| primitive != u32::MAX)
    }
}

/// A cache line of a list of blocks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C, align(64))]
pub(crate) struct Line([u32; 16]);

/// The head of a block, in words between the coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Head {
    /// The number of blocks before this one, which is the index of its ids.
    pub(crate) number: u32,
    /// A bit for each lane that has a triangle.
    pub(crate) taken: u32,
    /// Whether each corner has a vertex of its own.
    pub(crate) is_unshared: bool,
    /// Number of blocks of the same leaf that follow.
    pub(crate) followers: u32,
    /// The vertex of each corner, four bits for each lane. An empty lane has the first vertex of its half; an unshared
    /// block has zeros.
    pub(crate) corners: [u32; 3],
}

/// Set in words of the head that are read together with coordinates: as an `f32` they are never subnormal, which would
/// be slow.
const NORMAL: u32 = 1 << 30;
/// The word of the flags: used lanes, whether vertices are unshared, and how many blocks follow.
const FLAGS: usize = 0;
const UNSHARED_AT: u32 = BLOCK as u32;
const FOLLOWERS_AT: u32 = 16;
/// The words of the corners, if vertices are shared.
const CORNERS: [usize; 3] = [LINE_WORDS, 2 * LINE_WORDS - 1, 2 * LINE_WORDS];

/// The word of the number.
#[inline(always)]
const fn number_at(is_unshared: bool) -> usize {
    if is_unshared { FLAGS + 1 } else { LINE_WORDS - 1 }
}

impl Head {
    /// The head of the block that begins with these words.
    #[inline(always)]
    pub(crate) fn of(words: &[u32]) -> Self {
        let flags = words[FLAGS];
        let is_unshared = flags >> UNSHARED_AT & 1 != 0;
        Self {
            number: words[number_at(is_unshared)] & !NORMAL,
            taken: flags & ((1 << BLOCK) - 1),
            is_unshared,
            followers: flags >> FOLLOWERS_AT & (tag::MAX_BLOCKS - 1),
            corners: if is_unshared { [0; 3] } else { CORNERS.map(|at| words[at]) },
        }
    }

    /// Writes it into the block that begins with these words.
    #[inline(always)]
    pub(crate) fn put(&self, words: &mut [u32]) {
        let Self { number, taken, is_unshared, followers, corners } = *self;
        words[FLAGS] = taken | u32::from(is_unshared) << UNSHARED_AT | followers << FOLLOWERS_AT | NORMAL;
        words[number_at(is_unshared)] = number | NORMAL;
        if !is_unshared {
            for (at, corner) in CORNERS.into_iter().zip(corners) {
                words[at] = corner;
            }
        }
    }
}

/// Lanes in half a block; 128 bits hold this many numbers.
pub(crate) const QUAD: usize = BLOCK / 2;
/// Maximum shared vertices of either half of a block.
pub(crate) const MAX_IN_HALF: usize = 7;
/// Vertex numbers in a row of a block that shares vertices.
pub(crate) const SHARED_NUMBERS: usize = 16;
const SHARED_LINES: usize = 3;
const UNSHARED_LINES: usize = 5;
const LINE_WORDS: usize = size_of::<Line>() / size_of::<u32>();
/// Words of the longer block.
pub(crate) const BLOCK_WORDS: usize = UNSHARED_LINES * LINE_WORDS;

/// The first word of an axis's row in a block that shares vertices: a cache line, with 1 to 14 vertices.
pub(crate) const fn shared_row(axis: usize) -> usize {
    LINE_WORDS * axis
}

/// The first word of an axis's row in a block that does not: eight aligned numbers for each corner.
pub(crate) const fn unshared_row(axis: usize) -> usize {
    BLOCK + 3 * BLOCK * axis
}

const _: () = assert!(SHARED_NUMBERS == LINE_WORDS && shared_row(3) == SHARED_LINES * LINE_WORDS);
const _: () = assert!(unshared_row(0) > number_at(true) && unshared_row(3) == BLOCK_WORDS);
const _: () = assert!(tag::BLOCK_PLACES + tag::MAX_BLOCKS < NORMAL);
// Lines are indexed by `u32` and by the index bits of a reference.
const _: () = assert!((tag::BLOCK_PLACES + tag::MAX_BLOCKS) as usize * UNSHARED_LINES <= tag::PLACE as usize);

/// Up to eight triangles of one mesh: the head, and coordinates relative to the mesh's origin. If vertices are shared,
/// the last lines belong to the next block.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(64))]
pub(crate) struct TriangleBlock([u32; BLOCK_WORDS]);

/// The vertex of a corner in a lane, as its number in a row.
#[inline(always)]
pub(crate) fn vertex_at(head: &Head, corner: usize, lane: usize) -> usize {
    if head.is_unshared { BLOCK * corner + lane } else { shared_vertex(head.corners[corner], lane) }
}

/// The vertex in a lane, from four bits for each lane.
#[inline(always)]
fn shared_vertex(corners: u32, lane: usize) -> usize {
    (corners >> (4 * lane)) as usize % SHARED_NUMBERS
}

/// The number of a vertex of one half, counted from 0 there, in a block that shares vertices.
#[inline(always)]
pub(crate) fn shared_number(half: usize, index: u32) -> u32 {
    let number = [1, QUAD as u32][half] + index;
    // Vertices that do not fit the first vector follow those of the other half.
    let is_far = number >= (QUAD * (half + 1)) as u32;
    number + QUAD as u32 * u32::from(is_far)
}

/// Whether a triangle in a lane may have the vertex of that number.
fn is_within_reach(lane: usize, number: usize) -> bool {
    number / QUAD % 2 == lane / QUAD && number != 0 && number != SHARED_NUMBERS - 1
}

/// The start of an axis's row in a block.
#[inline(always)]
pub(crate) fn row(is_unshared: bool, axis: usize) -> usize {
    if is_unshared { unshared_row(axis) } else { shared_row(axis) }
}

pub(crate) const fn lines_of(is_unshared: bool) -> usize {
    if is_unshared { UNSHARED_LINES } else { SHARED_LINES }
}

impl TriangleBlock {
    /// The index of its ids.
    #[inline(always)]
    pub(crate) fn number(&self) -> u32 {
        self.0[number_at(self.is_unshared())] & !NORMAL
    }

    /// A bit for each lane that has a triangle.
    #[inline(always)]
    pub(crate) fn taken(&self) -> u32 {
        self.0[FLAGS] & ((1 << BLOCK) - 1)
    }

    /// Whether each corner has a vertex of its own.
    #[inline(always)]
    pub(crate) fn is_unshared(&self) -> bool {
        self.0[FLAGS] >> UNSHARED_AT & 1 != 0
    }

    /// Number of blocks of the same leaf that follow.
    #[inline(always)]
    fn followers(&self) -> u32 {
        self.0[FLAGS] >> FOLLOWERS_AT & (tag::MAX_BLOCKS - 1)
    }

    /// The vertex of each corner, four bits for each lane, if vertices are shared.
    #[inline(always)]
    pub(crate) fn corners(&self) -> [u32; 3] {
        // No closures: they do not inherit target features.
        [self.0[CORNERS[0]], self.0[CORNERS[1]], self.0[CORNERS[2]]]
    }

    /// The whole block as numbers: see [`shared_row`] and [`unshared_row`].
    #[inline(always)]
    pub(crate) fn words(&self) -> &[f32; BLOCK_WORDS] {
        bytemuck::cast_ref(self)
    }

    /// The vertices of the corners in a lane, as their numbers in a row: below 16, or below 24 if they are not shared.
    #[inline(always)]
    pub(crate) fn vertices_at(&self, lane: usize) -> [usize; 3] {
        let lane = lane % BLOCK;
        if self.is_unshared() {
            return [lane, BLOCK + lane, 2 * BLOCK + lane];
        }
        let [a, b, c] = self.corners();
        [shared_vertex(a, lane), shared_vertex(b, lane), shared_vertex(c, lane)]
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

    /// The corners of the triangles, if each has a vertex of its own.
    #[inline(always)]
    pub(crate) fn own_corners(&self) -> &Corners {
        let own = self.words()[unshared_row(0)..].first_chunk::<{ 9 * BLOCK }>();
        bytemuck::cast_ref(own.expect("a block is as long"))
    }

    /// Prefetches the block.
    #[inline(always)]
    pub(crate) fn fetch(&self) {
        let lines: &[Line; UNSHARED_LINES] = bytemuck::cast_ref(self);
        lines.first_chunk::<SHARED_LINES>().map(simd::fetch);
    }

    /// Whether it is the last of its leaf.
    #[inline(always)]
    pub(crate) fn is_last(&self) -> bool {
        self.followers() == 0
    }

    /// The line after this block, if the block begins at `place`.
    #[inline(always)]
    pub(crate) fn place_behind(&self, place: u32) -> u32 {
        place + lines_of(self.is_unshared()) as u32
    }

    /// The start of the next block of its leaf, if this one begins at `place`.
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

    /// The block of a reference in the tree.
    ///
    /// # Panics
    /// If there is no such block.
    #[inline(always)]
    pub(crate) fn block(self, place: u32) -> &'a TriangleBlock {
        match self.at(place) {
            Some(block) => block,
            None => out_of_tree(),
        }
    }

    /// The numbers of the blocks of a leaf.
    pub(crate) fn numbers(self, leaf: u32) -> Option<std::ops::Range<usize>> {
        let block = self.at(tag::place(leaf) as u32)?;
        let first = block.number() as usize;
        Some(first..first + block.followers() as usize + 1)
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

    /// How many blocks of its leaf follow each of the first `count` blocks.
    pub(crate) fn followers(self, count: usize) -> Vec<u8> {
        let mut followers = Vec::with_capacity(count);
        let mut place = 0;
        while followers.len() < count
            && let Some(block) = self.at(place)
        {
            followers.push(block.followers() as u8);
            place = block.place_behind(place);
        }
        followers
    }

    /// The line where every block begins, for blocks that [`pack`] makes of these ids.
    pub(crate) fn places(self, ids: &[BlockIds]) -> Option<Vec<u32>> {
        let mut places = Vec::with_capacity(ids.len());
        let (mut place, mut followers) = (0, 0);
        for (number, ids) in ids.iter().enumerate() {
            let block = self.at(place)?;
            let head = Head::of(&block.0);
            let mut same = *block;
            head.put(&mut same.0);
            let named = ids.primitives.iter().enumerate();
            let named = named.fold(0, |lanes, (lane, &name)| lanes | u32::from(name != u32::MAX) << lane);
            let are_there = |lane: usize| block.vertices_at(lane).iter().all(|&v| is_within_reach(lane, v));
            let is_sound = same.0 == block.0
                && head.number as usize == number
                && head.taken & !named == 0
                && (head.is_unshared || (0..BLOCK).all(are_there))
                && (followers == 0 || head.followers == followers - 1);
            if !is_sound {
                return None;
            }
            followers = head.followers;
            places.push(place);
            place = block.place_behind(place);
        }
        let all = if ids.is_empty() { 0 } else { place as usize + MARGIN };
        (followers == 0 && self.0.len() == all).then_some(places)
    }
}

/// Lines after the last block, so that it can be read as the longer one.
pub(crate) const MARGIN: usize = UNSHARED_LINES - SHARED_LINES;
