//! Triangles packed by eight, each block with the vertices that its triangles share.
//!
//! Eight neighbours have some nine or ten vertices among them, where corners of their own would be twenty-four. A block has room
//! for ten or twelve of them, for sixteen, or for all, and is as long as that. Blocks stand one behind another in a list of units of sixteen bytes, and references in nodes name the unit where
//! the first block of a leaf begins. What a block's triangles are called stands elsewhere, for only the winner of a search is
//! asked.
//!
//! Vertices stand where lanes find them without a look across the middle of a vector of 256 bits, which takes AVX2 several times as
//! long: those of the first four triangles are 0 to 3 and 8 to 11, those of the last four 4 to 7 and 8 to 11, or 12 to 15 in a room of
//! sixteen. Which triangles are the first four is chosen so that this takes as little room as it can: a strip of eight has ten vertices,
//! four of either half alone and two between them.
//!
//! Where a tree is so small that caches hold it anyway, nothing is shared, for it takes time to find eight vertices among sixteen:
//! see [`Vertices`].

use std::mem::offset_of;

use bytemuck::{Pod, Zeroable};
use lumbre_math::Vec3;
use rayon::prelude::*;

use crate::geometry::has_area;
use crate::intersect::{Lanes, Level, Task};
use crate::simd;
use crate::tree::BLOCK;
use crate::tree::Corners;
use crate::tree::Name;
use crate::tree::node::out_of_tree;
use crate::tree::node::{Node, tag};
use crate::{BuildError, Geometry, GeometryKind, TriangleMesh};

/// What the triangles of a block are called.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct BlockNames {
    /// Positions in the mesh's list.
    pub(crate) primitives: [u32; BLOCK],
    /// Position of the mesh in the tree's list.
    pub(crate) geometry: u32,
}

impl BlockNames {
    /// The names in a block without triangles.
    pub(crate) fn empty(geometry: u32) -> Self {
        Self { primitives: [u32::MAX; BLOCK], geometry }
    }

    /// Of primitives of one geometry: one or more, and no more than fit.
    pub(crate) fn of(names: &[Name]) -> Self {
        let mut named = Self::empty(names[0][0]);
        for (place, name) in named.primitives.iter_mut().zip(names) {
            *place = name[1];
        }
        named
    }

    /// A bit for each lane that is taken.
    pub(crate) fn lanes(&self) -> u32 {
        let lane = |(lane, &primitive): (usize, &u32)| u32::from(primitive != u32::MAX) << lane;
        self.primitives.iter().enumerate().map(lane).sum()
    }

    /// The positions of those that are there.
    #[inline(always)]
    pub(crate) fn primitives(&self) -> impl Iterator<Item = u32> {
        self.primitives.into_iter().take_while(|&primitive| primitive != u32::MAX)
    }
}

/// Sixteen bytes of a list of blocks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C, align(16))]
pub(crate) struct Unit([u32; 4]);

/// A cache line of them. The list consists of these, for where each corner has a vertex of its own a block is five, and no eight
/// coordinates lie in two.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C, align(64))]
pub(crate) struct Line([Unit; LINE]);

const LINE: usize = 4;

/// What stands before the vertices of a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
struct Head {
    /// How many blocks there are before this one: the place of its names.
    number: u32,
    /// A bit for each lane that has a triangle.
    taken: u8,
    /// How many vertices it has room for.
    room: u8,
    /// How many blocks of the same leaf come behind it.
    followers: u8,
    // So that no byte of it is left open.
    rest: u8,
    /// Which vertex each corner is, four bits for each lane; lanes without a triangle have the first that their half could have. Means
    /// nothing where each corner has a vertex of its own.
    corners: [u32; 3],
}

const _: () = assert!(size_of::<Head>() == 20);

/// The rooms for vertices of which a tree has one as its usual: the first where nine of ten blocks do with it, as of scans, else the
/// second. So it is foreseen where coordinates stand, before a block's head has come.
pub(crate) const USUAL: [usize; 2] = [10, 12];
/// As many as 512 bits hold.
pub(crate) const MOST_SHARED: usize = 16;
/// Half of a block's lanes, and as many vertices as 128 bits hold.
pub(crate) const QUAD: usize = BLOCK / 2;
/// Where triangles share less: each corner has a vertex of its own, corner by corner and lane by lane.
const UNSHARED: usize = 3 * BLOCK;
/// The number of the first of those: what is before it is open, so that eight coordinates begin at a multiple of their size. Where
/// vertices are shared, the first is 0.
pub(crate) const FIRST_UNSHARED: usize = 3;

const _: () = assert!((size_of::<Head>() + FIRST_UNSHARED * size_of::<f32>()).is_multiple_of(32));
const _: () = assert!(units_of(UNSHARED).is_multiple_of(LINE));
/// All rooms that there are.
pub(crate) const ROOMS: [usize; 4] = [USUAL[0], USUAL[1], MOST_SHARED, UNSHARED];
/// Rooms and vertices are taken modulo this, so that they lead nowhere whatever they are.
const VERTEX_NUMBERS: usize = 32;
/// Coordinates that may be looked at from where those of a block begin.
const COORDINATES: usize = 3 * VERTEX_NUMBERS;

/// Up to eight triangles of one mesh, and what follows them in the list.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(16))]
pub(crate) struct TriangleBlock {
    head: Head,
    /// The x of the vertices, relative to the mesh's origin, then y, then z; then what is of other blocks.
    coordinates: [f32; COORDINATES],
    // Up to whole units.
    rest: [u32; 3],
}

/// A block and what may be looked at behind it.
const WINDOW: usize = size_of::<TriangleBlock>() / size_of::<Unit>();

/// Units that a block with room for so many vertices takes.
const fn units_of(room: usize) -> usize {
    let first = if room > MOST_SHARED { FIRST_UNSHARED } else { 0 };
    (size_of::<Head>() + first * size_of::<f32>() + room * size_of::<[f32; 3]>()).div_ceil(size_of::<Unit>())
}

/// Lines that so many units take.
const fn lines_of(units: usize) -> usize {
    units.div_ceil(LINE)
}

/// Which vertex a corner in a lane, below eight, is: see [`Head::corners`].
#[inline(always)]
fn vertex_at(corners: &[u32; 3], is_unshared: bool, corner: usize, lane: usize) -> usize {
    if is_unshared {
        return FIRST_UNSHARED + BLOCK * corner + lane;
    }
    (corners[corner] >> (4 * lane)) as usize % MOST_SHARED
}

/// Where the second four vertices begin that the last four lanes of a block with a room for no more than sixteen have: the first four
/// have theirs from twice [`QUAD`] on, and so do these but in a room of sixteen.
#[inline(always)]
pub(crate) const fn far_of_last(room: usize) -> usize {
    2 * QUAD + (room & MOST_SHARED) / QUAD
}

/// Whether a lane may have that vertex.
fn is_within_reach(room: usize, lane: usize, vertex: usize) -> bool {
    let is_last = lane / QUAD != 0;
    let far = if is_last { far_of_last(room) } else { 2 * QUAD };
    vertex / QUAD == usize::from(is_last) || vertex / QUAD == far / QUAD
}

impl TriangleBlock {
    /// The place of its names.
    #[inline(always)]
    pub(crate) fn number(&self) -> u32 {
        self.head.number
    }

    /// A bit for each lane that has a triangle.
    #[inline(always)]
    pub(crate) fn taken(&self) -> u32 {
        self.head.taken.into()
    }

    /// How many vertices it has room for: 10, 12, 16 or 24, and below 32 at any rate.
    #[inline(always)]
    pub(crate) fn room(&self) -> usize {
        usize::from(self.head.room) % VERTEX_NUMBERS
    }

    /// Whether each corner has a vertex of its own: lane by lane, eight for each corner.
    #[inline(always)]
    pub(crate) fn is_unshared(&self) -> bool {
        self.room() > MOST_SHARED
    }

    /// Which vertex each corner is, four bits for each lane, where they share any.
    #[inline(always)]
    pub(crate) fn corners(&self) -> &[u32; 3] {
        &self.head.corners
    }

    /// The same, and what stands behind them.
    #[inline(always)]
    pub(crate) fn corners_and_more(&self) -> &[u32; 4] {
        const FIRST: usize = offset_of!(TriangleBlock, head) / 4 + offset_of!(Head, corners) / 4;
        let words: &[u32] = bytemuck::cast_slice(std::slice::from_ref(self));
        (&words[FIRST..FIRST + 4]).try_into().expect("four")
    }

    /// The x of as many vertices as there is room for, then y, then z, and then what means nothing. Where each corner has a vertex of its
    /// own, all stand [`FIRST_UNSHARED`] places further on.
    #[inline(always)]
    pub(crate) fn coordinates(&self) -> &[f32; COORDINATES] {
        &self.coordinates
    }

    /// Which vertex a corner in a lane is, below 32: its x stands there, y and z each a room behind.
    #[inline(always)]
    pub(crate) fn vertex_at(&self, corner: usize, lane: usize) -> usize {
        vertex_at(&self.head.corners, self.is_unshared(), corner, lane % BLOCK)
    }

    /// The same of all corners in a lane.
    #[inline(always)]
    pub(crate) fn vertices_at(&self, lane: usize) -> [usize; 3] {
        // No closure: those do not take on the instruction set of who calls them.
        [self.vertex_at(0, lane), self.vertex_at(1, lane), self.vertex_at(2, lane)]
    }

    /// The corners of the triangle in a lane.
    pub(crate) fn triangle(&self, lane: usize) -> [[f32; 3]; 3] {
        self.vertices_at(lane)
            .map(|vertex| [0, 1, 2].map(|axis| self.coordinates[axis * self.room() + vertex]))
    }

    /// The corners of each triangle.
    pub(crate) fn triangles(&self) -> impl Iterator<Item = [[f32; 3]; 3]> {
        (0..BLOCK).filter(|lane| self.taken() >> lane & 1 != 0).map(|lane| self.triangle(lane))
    }

    /// The corners of its triangles, where each has a vertex of its own.
    #[inline(always)]
    pub(crate) fn own_corners(&self) -> &Corners {
        let own = self.coordinates[FIRST_UNSHARED..].first_chunk::<{ 3 * UNSHARED }>();
        bytemuck::cast_ref(own.expect("there is room for more"))
    }

    /// Asks for it to be brought near, before it is needed.
    #[inline(always)]
    pub(crate) fn fetch(&self) {
        // Most have no more.
        let units: &[Unit; WINDOW] = bytemuck::cast_ref(self);
        units.first_chunk::<{ units_of(USUAL[1]) }>().map(simd::fetch);
    }

    /// Whether it is the last of its leaf.
    #[inline(always)]
    pub(crate) fn is_last(&self) -> bool {
        self.head.followers == 0
    }

    /// The place behind it, where it stands at `place`.
    #[inline(always)]
    pub(crate) fn place_behind(&self, place: u32) -> u32 {
        place + units_of(self.room()) as u32
    }

    /// The place of the next block of its leaf, where this one stands at `place`.
    #[inline(always)]
    pub(crate) fn next(&self, place: u32) -> Option<u32> {
        (!self.is_last()).then(|| self.place_behind(place))
    }
}

/// The blocks of a tree.
#[derive(Clone, Copy)]
pub(crate) struct Blocks<'a>(&'a [Unit]);

impl<'a> Blocks<'a> {
    #[inline(always)]
    pub(crate) fn new(lines: &'a [Line]) -> Self {
        Self(bytemuck::cast_slice(lines))
    }

    /// The block at a unit, which a reference names.
    #[inline(always)]
    pub(crate) fn at(self, place: u32) -> Option<&'a TriangleBlock> {
        let window = self.0.get(place as usize..place as usize + WINDOW)?;
        Some(bytemuck::cast_ref::<[Unit; WINDOW], TriangleBlock>(window.try_into().ok()?))
    }

    /// The same of a reference that stands in the tree.
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
        let head = self.at(leaf & tag::PLACE)?.head;
        let first = head.number as usize;
        Some(first..first + usize::from(head.followers) + 1)
    }

    /// The blocks of a leaf.
    pub(crate) fn leaf(self, leaf: u32) -> impl Iterator<Item = &'a TriangleBlock> {
        let mut place = Some(leaf & tag::PLACE);
        std::iter::from_fn(move || {
            let block = self.at(place?)?;
            place = block.next(place?);
            Some(block)
        })
    }

    /// How many blocks of its leaf stand behind each of so many.
    pub(crate) fn followers(self, count: usize) -> Vec<u8> {
        let mut followers = Vec::with_capacity(count);
        let mut place = 0;
        while followers.len() < count
            && let Some(block) = self.at(place)
        {
            followers.push(block.head.followers);
            place += units_of(block.room()) as u32;
        }
        followers
    }

    /// Where every block begins, if they are such as [`pack`] makes them of so many names.
    pub(crate) fn places(self, names: &[BlockNames]) -> Option<Vec<u32>> {
        let mut places = Vec::with_capacity(names.len());
        let (mut place, mut followers) = (0, 0);
        for (number, names) in names.iter().enumerate() {
            let block = self.at(place)?;
            let head = &block.head;
            let named = names.primitives.iter().enumerate();
            let named = named.fold(0, |lanes, (lane, &name)| lanes | u8::from(name != u32::MAX) << lane);
            let mut corners = (0..3).flat_map(|corner| (0..BLOCK).map(move |lane| (corner, lane)));
            let are_there = corners.all(|(corner, lane)| {
                let (vertex, room) = (block.vertex_at(corner, lane), block.room());
                block.is_unshared() || vertex < room && is_within_reach(room, lane, vertex)
            });
            let is_sound = head.number as usize == number
                && head.taken & !named == 0
                && ROOMS.contains(&head.room.into())
                && are_there
                && usize::from(head.followers) < tag::MOST_BLOCKS as usize
                && (followers == 0 || head.followers == followers - 1);
            if !is_sound {
                return None;
            }
            followers = head.followers;
            places.push(place);
            place += units_of(block.room()) as u32;
        }
        let all = if names.is_empty() { 0 } else { LINE * lines_of(place as usize + MARGIN) };
        (followers == 0 && self.0.len() == all).then_some(places)
    }
}

/// Behind the last block, so that the window of each is there.
const MARGIN: usize = WINDOW - 1;

/// Blocks, and where each begins.
pub(crate) struct Filled {
    pub(crate) lines: Vec<Line>,
    pub(crate) places: Vec<u32>,
    /// In which order the names of each are to stand from now on.
    pub(crate) orders: Vec<LaneOrder>,
}

/// Of the lanes of a block, in which each comes from: four bits for each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct LaneOrder(u32);

impl LaneOrder {
    const SAME: Self = Self(0x7654_3210);

    /// With those first of which there is a bit: four of them.
    #[inline(always)]
    fn of_first(first: usize) -> Self {
        let (mut order, mut ends) = (0, [0, QUAD]);
        for lane in 0..BLOCK {
            let end = &mut ends[usize::from(first >> lane & 1 == 0)];
            order |= lane << (4 * *end);
            *end += 1;
        }
        Self(order as u32)
    }

    /// Whether none goes elsewhere.
    pub(crate) fn is_same(self) -> bool {
        self == Self::SAME
    }

    /// In which lane that stood which now stands there.
    #[inline(always)]
    pub(crate) fn lane_before(self, lane: usize) -> usize {
        (self.0 >> (4 * lane)) as usize % BLOCK
    }

    /// Puts the names of a block in this order.
    pub(crate) fn put(self, names: &mut BlockNames) {
        let before = names.primitives;
        for (lane, primitive) in names.primitives.iter_mut().enumerate() {
            *primitive = before[self.lane_before(lane)];
        }
    }
}

/// Blocks that are packed at once, one lot after another.
const WAVE: usize = 1 << 14;
/// Of how many blocks threads share the work, and how many are left to one of them: those of as many triangles as one thread takes
/// alone fill some six hundred.
const SHARED: usize = 640;
const SHARE: usize = 64;

/// Of so many blocks, how many are left to one thread.
pub(crate) fn share_of(blocks: usize) -> usize {
    if blocks > SHARED { SHARE } else { SHARED }
}

/// What the blocks of a tree will be like.
struct Survey {
    /// The usual room.
    usual: usize,
    /// Whether any share more when vertices of different names in one place are taken for one.
    by_place: bool,
    /// About how many units they take together: rather more.
    units: usize,
}

/// Looks at some of the blocks with these names.
struct Look<'a> {
    geometries: &'a [Geometry],
    names: &'a [BlockNames],
}

impl Task for Look<'_> {
    type Output = Survey;

    #[inline(always)]
    fn run<L: Lanes>(self) -> Survey {
        const SOME: usize = 256;
        let some = self.names.iter().step_by((self.names.len() / SOME).max(4));
        let (count, mut usual, mut units) = (some.len().max(1), [0; 2], [0; 2]);
        let mut by_place = false;
        for names in some {
            let mesh = mesh(self.geometries, names.geometry);
            let halves = Halves::of::<L, true>(mesh, names, USUAL[0]);
            by_place |= halves.do_share() && !Halves::of::<L, false>(mesh, names, USUAL[0]).do_share();
            for i in 0..2 {
                let room = halves.room(USUAL[i]);
                usual[i] += usize::from(room == USUAL[i]);
                units[i] += units_of(room);
            }
        }
        let i = usize::from(10 * usual[0] < 9 * count);
        let all = units[i] * self.names.len() / count;
        Survey { usual: USUAL[i], by_place, units: all + all / 32 }
    }
}

/// Whether the triangles of a block have vertices together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Vertices {
    /// Those that they share stand there once.
    Shared,
    /// Each corner has one of its own.
    Apart,
}

impl Vertices {
    /// So many blocks take twice the room where vertices are apart, some five megabytes: where caches do not hold that, it costs more
    /// than it gains. In tests there are both.
    const MOST_APART: usize = if cfg!(test) { 24 } else { 1 << 14 };

    /// As a ray meets so many blocks soonest. To bring vertices to eight corners takes a third of the instructions of a block with AVX2,
    /// and with AVX-512, which has one for it, longer than to read twice as much from a cache.
    pub(crate) fn of_fastest(blocks: usize) -> Self {
        if blocks > Self::MOST_APART { Self::Shared } else { Self::Apart }
    }
}

/// Packs triangles with these names. Behind each block stand so many more of its leaf. Those without an area are left out; where
/// there may be none, it is not asked.
///
/// # Errors
/// [`BuildError::TooMany`] when there are more units than references can name.
pub(crate) fn pack(
    level: Level,
    vertices: Vertices,
    geometries: &[Geometry],
    names: &[BlockNames],
    followers: &[u8],
    may_lack_area: bool,
) -> Result<Filled, BuildError> {
    let survey = match vertices {
        Vertices::Shared => Some(level.run(Look { geometries, names })),
        Vertices::Apart => None,
    };
    let expected = survey.as_ref().map_or(units_of(UNSHARED) * names.len(), |survey| survey.units);
    let mut filled = Filled {
        lines: Vec::new(),
        places: Vec::with_capacity(names.len()),
        orders: Vec::with_capacity(names.len()),
    };
    let is_all_at_once = names.len() <= WAVE;
    let mut shared = Vec::new();
    let mut end = 0;
    let share = share_of(names.len());
    for (wave, (names, followers)) in names.chunks(WAVE).zip(followers.chunks(WAVE)).enumerate() {
        shared.resize(names.len(), Shared::NOTHING);
        if let Some(Survey { usual, by_place, .. }) = survey {
            shared.par_chunks_mut(share).zip(names.par_chunks(share)).for_each(|(shared, names)| {
                level.run(FindShared { geometries, names, usual, by_place, shared });
            });
        }
        let start = end;
        for shared in &shared {
            filled.places.push(end as u32);
            filled.orders.push(shared.order);
            end += units_of(shared.room());
        }
        if end > tag::PLACE as usize {
            return Err(BuildError::TooMany);
        }
        if wave == 0 {
            let len = if is_all_at_once { end } else { end.max(expected) };
            filled.lines = vec![Line::default(); lines_of(len + MARGIN)];
        } else if filled.lines.len() < lines_of(end + MARGIN) {
            filled.lines.resize(lines_of(end + end / 8 + MARGIN), Line::default());
        }
        let mut rest = &mut bytemuck::cast_slice_mut::<Line, Unit>(&mut filled.lines)[start..end];
        let mut shares = Vec::with_capacity(names.len().div_ceil(share));
        let mut first = wave * WAVE;
        for ((names, followers), shared) in
            names.chunks(share).zip(followers.chunks(share)).zip(shared.chunks(share))
        {
            let len = shared.iter().map(|shared| units_of(shared.room())).sum();
            let units = rest.split_off_mut(..len).expect("there is room for all");
            shares.push(PackShare {
                geometries,
                names,
                followers,
                shared,
                first: first as u32,
                may_lack_area,
                units,
            });
            first += names.len();
        }
        shares.into_par_iter().for_each(PackShare::run);
    }
    if !is_all_at_once {
        filled.lines.truncate(lines_of(end + MARGIN));
        filled.lines.shrink_to_fit();
    }
    Ok(filled)
}

/// Finds which vertices the triangles of each block share.
struct FindShared<'a> {
    geometries: &'a [Geometry],
    names: &'a [BlockNames],
    usual: usize,
    by_place: bool,
    shared: &'a mut [Shared],
}

impl Task for FindShared<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        if self.by_place { self.find::<L, true>() } else { self.find::<L, false>() }
    }
}

impl FindShared<'_> {
    #[inline(always)]
    fn find<L: Lanes, const BY_PLACE: bool>(self) {
        for (shared, names) in self.shared.iter_mut().zip(self.names) {
            let mesh = mesh(self.geometries, names.geometry);
            *shared = Halves::of::<L, BY_PLACE>(mesh, names, self.usual).in_room(self.usual);
        }
    }
}

/// Some of the triangles to be packed, as [`pack`] does.
struct PackShare<'a> {
    geometries: &'a [Geometry],
    names: &'a [BlockNames],
    followers: &'a [u8],
    shared: &'a [Shared],
    /// The number of the first block.
    first: u32,
    may_lack_area: bool,
    /// As many as they take.
    units: &'a mut [Unit],
}

impl PackShare<'_> {
    fn run(self) {
        let Self { geometries, names, followers, shared, first, may_lack_area, mut units } = self;
        for (((number, names), &followers), shared) in (first..).zip(names).zip(followers).zip(shared) {
            let mesh = mesh(geometries, names.geometry);
            let room = shared.room();
            let own = units.split_off_mut(..units_of(room)).expect("there is room for all");
            let (head, coordinates) = parts_of_first(own);
            let mut taken = 0;
            for lane in 0..names.primitives().count() {
                let primitive = names.primitives[shared.order.lane_before(lane)];
                let triangle = mesh.indices[primitive as usize];
                let corners = triangle.map(|vertex| mesh.positions[vertex as usize]);
                taken |= u8::from(!may_lack_area || has_area(&corners)) << lane;
                put_corners(coordinates, room, &corners, |corner| shared.vertex_at(corner, lane));
            }
            *head = Head { number, taken, room: shared.room, followers, rest: 0, corners: shared.corners };
        }
    }
}

/// Puts the triangles of blocks that [`pack`] made, with these names, where their vertices are now. False where triangles lie apart
/// that shared a vertex: the blocks, some of which are changed then, are to be packed again. Those without an area are left out, as
/// there.
pub(crate) fn move_triangles(
    level: Level,
    geometries: &[Geometry],
    names: &[BlockNames],
    may_lack_area: bool,
    lines: &mut [Line],
) -> bool {
    let mut units = bytemuck::cast_slice_mut::<Line, Unit>(lines);
    let share = share_of(names.len());
    let mut shares = Vec::with_capacity(names.len().div_ceil(share));
    for names in names.chunks(share) {
        let mut len = 0;
        for _ in names {
            len += units_of(Blocks(units).block(len as u32).room());
        }
        let units = units.split_off_mut(..len).expect("their heads are there");
        shares.push(MoveShare { geometries, names, may_lack_area, units });
    }
    shares.into_par_iter().all(|share| level.run(share))
}

/// Some of the triangles to be moved, as [`move_triangles`] does.
struct MoveShare<'a> {
    geometries: &'a [Geometry],
    names: &'a [BlockNames],
    may_lack_area: bool,
    units: &'a mut [Unit],
}

impl Task for MoveShare<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<L: Lanes>(self) -> bool {
        let Self { geometries, names: all, may_lack_area, mut units } = self;
        let mut do_fit = true;
        for (place, names) in all.iter().enumerate() {
            // Where the vertices of the next are, and where that stands of the one behind it.
            if let Some(next) = all.get(place + 1) {
                let mesh = mesh(geometries, next.geometry);
                for primitive in next.primitives() {
                    for vertex in mesh.indices[primitive as usize] {
                        simd::fetch(&mesh.positions[vertex as usize]);
                    }
                }
            }
            if let Some(later) = all.get(place + 2) {
                let mesh = mesh(geometries, later.geometry);
                for primitive in later.primitives() {
                    simd::fetch(&mesh.indices[primitive as usize]);
                }
            }
            let mesh = mesh(geometries, names.geometry);
            let (head, coordinates) = parts_of_first(units);
            let room = usize::from(head.room);
            let vertices =
                |corner: usize, lane: usize| vertex_at(&head.corners, room > MOST_SHARED, corner, lane);
            let mut triangles = [[Vec3::ZERO; 3]; BLOCK];
            let (mut taken, mut len) = (0, 0);
            for (lane, primitive) in names.primitives().enumerate() {
                let triangle = mesh.indices[primitive as usize];
                let corners = triangle.map(|vertex| mesh.positions[vertex as usize]);
                taken |= u8::from(!may_lack_area || has_area(&corners)) << lane;
                put_corners(coordinates, room, &corners, |corner| vertices(corner, lane));
                triangles[lane] = corners;
                len += 1;
            }
            for (lane, corners) in triangles[..len].iter().enumerate() {
                for (corner, position) in corners.iter().enumerate() {
                    let place = vertices(corner, lane);
                    for axis in 0..3 {
                        let stands = coordinates[axis * room + place];
                        do_fit &= stands.to_bits() == position[axis].to_bits();
                    }
                }
            }
            head.taken = taken;
            units = &mut units[units_of(room)..];
        }
        do_fit
    }
}

/// The head of the first of these blocks, and the coordinates in it, with what is behind them.
#[inline(always)]
fn parts_of_first(units: &mut [Unit]) -> (&mut Head, &mut [f32]) {
    let (head, coordinates) = bytemuck::cast_slice_mut::<Unit, u8>(units).split_at_mut(size_of::<Head>());
    (bytemuck::from_bytes_mut(head), bytemuck::cast_slice_mut(coordinates))
}

/// Writes down the corners of a triangle, each as the vertex that it is, in a block with such a room.
#[inline(always)]
fn put_corners(
    coordinates: &mut [f32],
    room: usize,
    corners: &[Vec3; 3],
    vertex_of: impl Fn(usize) -> usize,
) {
    for (corner, position) in corners.iter().enumerate() {
        let vertex = vertex_of(corner);
        for axis in 0..3 {
            coordinates[axis * room + vertex] = position[axis];
        }
    }
}

/// Whether the triangles of meshes name the same vertices as those of the same geometries before. Else they may share more of them.
pub(crate) fn name_same_vertices(before: &[Geometry], geometries: &[Geometry]) -> bool {
    const CHUNK: usize = 1 << 14;
    before.iter().zip(geometries).all(|(old, new)| match (&old.kind, &new.kind) {
        (GeometryKind::Mesh(old), GeometryKind::Mesh(new)) => {
            let (old, new) = (&old.indices, &new.indices);
            let chunks = old.par_chunks(CHUNK).zip(new.par_chunks(CHUNK));
            old.len() == new.len() && chunks.all(|(old, new)| old.as_flattened() == new.as_flattened())
        }
        _ => true,
    })
}

fn mesh(geometries: &[Geometry], geometry: u32) -> &TriangleMesh {
    match &geometries[geometry as usize].kind {
        GeometryKind::Mesh(mesh) => mesh,
        _ => unreachable!("triangles come from meshes"),
    }
}

/// Which vertices the triangles of a block share, as they stand in a room.
#[derive(Clone, Copy)]
struct Shared {
    /// As in the head of a block.
    corners: [u32; 3],
    order: LaneOrder,
    room: u8,
}

impl Shared {
    /// Each corner has a vertex of its own.
    const NOTHING: Self = Self { corners: [0; 3], order: LaneOrder::SAME, room: UNSHARED as u8 };

    fn room(&self) -> usize {
        self.room.into()
    }

    /// See [`TriangleBlock::vertex_at`].
    #[inline(always)]
    fn vertex_at(&self, corner: usize, lane: usize) -> usize {
        vertex_at(&self.corners, self.room() > MOST_SHARED, corner, lane)
    }
}

/// The triangles of a block in two halves, and their vertices. Of corners that are the same vertex, a bit stands for the first.
#[derive(Clone, Copy)]
struct Halves {
    /// For the corners in each lane, the bit of its vertex; nothing where there is no triangle.
    corners: [[u32; 3]; BLOCK],
    /// The vertices of either half.
    vertices: [u32; 2],
    order: LaneOrder,
    /// How many triangles there are.
    len: usize,
}

/// The ways to choose four of five, six, seven and eight triangles, a bit for each that is; of eight, those with the first triangle.
static FOURS: [([u8; 35], usize); 4] = {
    let mut fours = [([0; 35], 0); 4];
    let mut len = QUAD + 1;
    while len <= BLOCK {
        let (mut four, mut count) = (0u32, 0);
        while four < 1 << len {
            if four.count_ones() == QUAD as u32 && (len < BLOCK || four & 1 != 0) {
                fours[len - QUAD - 1].0[count] = four as u8;
                count += 1;
            }
            four += 1;
        }
        fours[len - QUAD - 1].1 = count;
        len += 1;
    }
    fours
};

impl Halves {
    /// Of the triangles with these names, so that they do with the usual room if they can. Almost without branches that could not be
    /// foreseen: every corner is compared with all before it; and where that is not enough and `BY_PLACE`, so is where they stand.
    #[inline(always)]
    fn of<L: Lanes, const BY_PLACE: bool>(mesh: &TriangleMesh, names: &BlockNames, usual: usize) -> Self {
        let mut all = [0; UNSHARED];
        let (triangles, _) = all.as_chunks_mut::<3>();
        let mut len = 0;
        for (triangle, primitive) in triangles.iter_mut().zip(names.primitives()) {
            *triangle = mesh.indices[primitive as usize];
            len += 1;
        }
        let first = triangles[0];
        triangles[len..].fill(first);
        let halves = Self::by_equals(&L::equals_before(&all), len, usual);
        if !BY_PLACE || halves.do_share() {
            return halves;
        }
        // Vertices of different names may stand in one place.
        let mut equals = [u32::MAX; UNSHARED];
        for axis in 0..3 {
            let mut coordinates = all;
            for vertex in &mut coordinates {
                *vertex = mesh.positions[*vertex as usize][axis].to_bits();
            }
            for (equals, own) in equals.iter_mut().zip(L::equals_before(&coordinates)) {
                *equals &= own;
            }
        }
        Self::by_equals(&equals, len, usual)
    }

    /// Where for each corner there is a bit for each equal one before it.
    #[inline(always)]
    fn by_equals(equals: &[u32; UNSHARED], len: usize, usual: usize) -> Self {
        let mut corners = [[0u32; 3]; BLOCK];
        for (at, (corner, before)) in corners[..len].as_flattened_mut().iter_mut().zip(equals).enumerate() {
            let same = before | 1 << at;
            *corner = same & same.wrapping_neg();
        }
        let as_they_are = Self::of_corners(corners, len, LaneOrder::SAME);
        // For the usual room, or any that is shared.
        let count = as_they_are.vertex_count() as usize;
        let enough = if count <= usual { usual - QUAD } else { 2 * QUAD };
        if as_they_are.most_in_half() as usize <= enough || count > MOST_SHARED || len <= QUAD {
            return as_they_are;
        }
        as_they_are.divided_better()
    }

    /// As these corners stand, which are in this order.
    #[inline(always)]
    fn of_corners(corners: [[u32; 3]; BLOCK], len: usize, order: LaneOrder) -> Self {
        let mut vertices = [0; 2];
        for (lane, [a, b, c]) in corners.iter().enumerate() {
            vertices[lane / QUAD] |= a | b | c;
        }
        Self { corners, vertices, order, len }
    }

    /// With other triangles in the halves, so that neither has more vertices than it must.
    #[inline(always)]
    fn divided_better(self) -> Self {
        // The vertices of some of the first four triangles, and of some of the last four.
        let mut some = [[0u32; 1 << QUAD]; 2];
        for (half, some) in some.iter_mut().enumerate() {
            for lane in 0..QUAD {
                let [a, b, c] = self.corners[half * QUAD + lane];
                for others in 0..1 << lane {
                    some[others | 1 << lane] = some[others] | a | b | c;
                }
            }
        }
        let vertices = |of: usize| (some[0][of % (1 << QUAD)] | some[1][of >> QUAD]).count_ones();
        let all = (1 << self.len) - 1;
        // How many there are above, and which they are below: of as few, the first.
        let mut best = self.most_in_half() << BLOCK | 0b1111;
        let (fours, count) = &FOURS[(self.len - QUAD - 1) % FOURS.len()];
        for &first in &fours[..*count] {
            let own = usize::from(first);
            let most = vertices(own).max(vertices(all ^ own));
            best = best.min(most << BLOCK | u32::from(first));
        }
        let first = best as usize % (1 << BLOCK);
        if first == 0b1111 { self } else { self.in_order(LaneOrder::of_first(first)) }
    }

    /// The same in another order, in which other corners are the first of their vertices.
    #[inline(always)]
    fn in_order(self, order: LaneOrder) -> Self {
        let mut first_of = [0u32; UNSHARED];
        let mut corners = [[0u32; 3]; BLOCK];
        for (lane, triangle) in corners[..self.len].iter_mut().enumerate() {
            let before = self.corners[order.lane_before(lane)];
            for (i, (corner, before)) in triangle.iter_mut().zip(before).enumerate() {
                let first = &mut first_of[before.trailing_zeros() as usize % UNSHARED];
                *first = if *first == 0 { 1 << (3 * lane + i) } else { *first };
                *corner = *first;
            }
        }
        Self::of_corners(corners, self.len, order)
    }

    /// How many vertices there are.
    #[inline(always)]
    fn vertex_count(&self) -> u32 {
        (self.vertices[0] | self.vertices[1]).count_ones()
    }

    /// How many the half has that has more.
    #[inline(always)]
    fn most_in_half(&self) -> u32 {
        self.vertices[0].count_ones().max(self.vertices[1].count_ones())
    }

    /// Whether there is a room where they share vertices.
    #[inline(always)]
    fn do_share(&self) -> bool {
        self.most_in_half() as usize <= 2 * QUAD
    }

    /// The room that they take, of those that there are. Where both halves find vertices, there is room for all that are more than
    /// eight, and for all but four of either half: those that both have may stand with each.
    #[inline(always)]
    fn room(&self, usual: usize) -> usize {
        let (all, most) = (self.vertex_count() as usize, self.most_in_half() as usize);
        if all.max(most + QUAD) <= usual {
            usual
        } else if self.do_share() {
            MOST_SHARED
        } else {
            UNSHARED
        }
    }

    /// As they stand in that room.
    #[inline(always)]
    fn in_room(&self, usual: usize) -> Shared {
        let room = self.room(usual);
        if room == UNSHARED {
            return Shared::NOTHING;
        }
        let [a, b] = self.vertices;
        let far_of_last = far_of_last(room) as u32;
        let is_apart = far_of_last != 2 * QUAD as u32;
        // Those that stand with either half, and those that stand far off: of both, but in a room where each has its own.
        let both = if is_apart { 0 } else { a & b };
        let mut near = [a & !both, b & !both];
        let far_of_either = near.map(|near| without_first(near)[QUAD]);
        near = [near[0] ^ far_of_either[0], near[1] ^ far_of_either[1]];
        // Those of both stand with each as far as there is room for that.
        let room_for_both = QUAD as u32 - near[0].count_ones().max(near[1].count_ones());
        let far_of_both = without_first(both)[room_for_both as usize];
        near = near.map(|near| near | both ^ far_of_both);
        let far_of_all = far_of_either[0] | far_of_either[1] | far_of_both;
        let far = if is_apart { far_of_either } else { [far_of_all; 2] };
        let mut words = [0u32; 3];
        for half in 0..2 {
            let (near, far) = (near[half], far[half]);
            let (near_from, far_from) = (QUAD * half, if half == 0 { 2 * QUAD as u32 } else { far_of_last });
            for lane in near_from..near_from + QUAD {
                for (word, corner) in words.iter_mut().zip(self.corners[lane]) {
                    let is_far = far & corner != 0;
                    let (from, all) = if is_far { (far_from, far) } else { (near_from as u32, near) };
                    // Where there is no triangle, none comes before it.
                    let before = all & corner.saturating_sub(1);
                    *word |= (from + before.count_ones()) << (4 * lane);
                }
            }
        }
        Shared { corners: words, order: self.order, room: room as u8 }
    }
}

/// The bits of a word but for the first of them: none, one, and so on.
#[inline(always)]
fn without_first(word: u32) -> [u32; QUAD + 1] {
    let mut rest = [word; QUAD + 1];
    for count in 0..QUAD {
        rest[count + 1] = rest[count] & rest[count].wrapping_sub(1);
    }
    rest
}

/// Turns references to leaves of triangles, of which `number_of` tells the number of the first block, into ones to where this
/// begins.
pub(crate) fn refer(
    nodes: &mut [Node],
    root: &mut Option<u32>,
    places: &[u32],
    number_of: impl Fn(u32) -> usize + Sync,
) {
    let refer = |reference: &mut u32| {
        if *reference >> tag::SHIFT == tag::TRIANGLES {
            *reference = tag::reference(tag::TRIANGLES, places[number_of(*reference)]);
        }
    };
    root.iter_mut().for_each(refer);
    nodes.par_iter_mut().with_min_len(64).for_each(|node| {
        let len = node.len();
        node.children[..len].iter_mut().for_each(refer);
    });
}

/// How many blocks of its leaf stand behind each, where the references in nodes number them.
pub(crate) fn followers_of(nodes: &[Node], root: Option<u32>, blocks: usize) -> Vec<u8> {
    let mut followers = vec![0; blocks];
    let children = nodes.iter().flat_map(|node| &node.children[..node.len()]);
    for &reference in children.chain(&root).filter(|&&reference| reference >> tag::SHIFT == tag::TRIANGLES) {
        for (behind, followers) in followers[tag::blocks(reference)].iter_mut().rev().enumerate() {
            *followers = behind as u8;
        }
    }
    followers
}
