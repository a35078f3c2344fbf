//! Packing triangles into blocks, and moving packed ones.

use lumbre_math::Vec3;
use rayon::prelude::*;

use crate::intersect::{Dispatch, Isa, Simd};
use crate::simd;
use crate::tree::BLOCK;
use crate::tree::geometry::TriangleMesh;
use crate::tree::geometry::has_area;
use crate::tree::node::{Node, tag};
use crate::tree::triangle_block::{
    BlockIds, Blocks, Head, Line, MARGIN, MAX_IN_HALF, QUAD, lines_of, row, shared_number, vertex_at,
};
use crate::tree::{Geometry, GeometryKind};

/// Blocks, and the line where each begins.
pub(crate) struct Filled {
    pub(crate) lines: Vec<Line>,
    pub(crate) places: Vec<u32>,
    /// The order of the ids of each block.
    pub(crate) orders: Vec<LaneOrder>,
}

/// For each lane of a block, the lane it comes from: four bits each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct LaneOrder(u32);

impl LaneOrder {
    const SAME: Self = Self(0x7654_3210);

    /// The order that puts the four lanes of this mask first.
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

    /// Whether every lane stays in place.
    pub(crate) fn is_same(self) -> bool {
        self == Self::SAME
    }

    /// The lane that this one comes from.
    #[inline(always)]
    pub(crate) fn lane_before(self, lane: usize) -> usize {
        (self.0 >> (4 * lane)) as usize % BLOCK
    }

    /// Reorders the ids of a block.
    pub(crate) fn put(self, ids: &mut BlockIds) {
        let before = ids.primitives;
        for (lane, primitive) in ids.primitives.iter_mut().enumerate() {
            *primitive = before[self.lane_before(lane)];
        }
    }
}

/// Blocks per task; one task for up to 640 blocks.
pub(crate) fn share_of(blocks: usize) -> usize {
    const FEW: usize = 640;
    if blocks > FEW { 64 } else { FEW }
}

/// Whether a tree of this many blocks shares vertices. A block that does not is faster, but five megabytes of them no
/// longer fit a cache. Tests use both.
pub(crate) fn is_worth_sharing(blocks: usize) -> bool {
    const MAX_UNSHARED: usize = if cfg!(test) { 24 } else { 1 << 14 };
    blocks > MAX_UNSHARED
}

/// Packs the triangles with these ids; `followers` says how many blocks of the same leaf follow each. Leaves out
/// triangles without an area; skips that test if all have one.
pub(crate) fn pack(
    isa: Isa,
    may_share: bool,
    geometries: &[Geometry],
    ids: &[BlockIds],
    followers: &[u8],
    may_lack_area: bool,
) -> Filled {
    let share = share_of(ids.len());
    let mut plans = vec![Plan::UNSHARED; ids.len()];
    if may_share {
        plans.par_chunks_mut(share).zip(ids.par_chunks(share)).for_each(|(plans, ids)| {
            isa.run(MakePlans { geometries, ids, plans });
        });
    }
    let mut places = Vec::with_capacity(ids.len());
    let mut end = 0;
    for plan in &plans {
        places.push(end as u32);
        end += lines_of(plan.is_unshared);
    }
    let all = if ids.is_empty() { 0 } else { end + MARGIN };
    let mut lines = vec![Line::default(); all];
    let mut rest = &mut lines[..end];
    let mut shares = Vec::with_capacity(ids.len().div_ceil(share));
    for (i, plans) in plans.chunks(share).enumerate() {
        let first = i * share;
        let len = plans.iter().map(|plan| lines_of(plan.is_unshared)).sum();
        shares.push(PackShare {
            geometries,
            ids: &ids[first..],
            followers: &followers[first..],
            plans,
            first: first as u32,
            may_lack_area,
            lines: rest.split_off_mut(..len).expect("there are as many lines"),
        });
    }
    shares.into_par_iter().for_each(PackShare::run);
    let orders = plans.iter().map(|plan| plan.order).collect();
    Filled { lines, places, orders }
}

/// Plans blocks with these ids.
struct MakePlans<'a> {
    geometries: &'a [Geometry],
    ids: &'a [BlockIds],
    plans: &'a mut [Plan],
}

impl Dispatch for MakePlans<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Simd>(self) {
        for (plan, ids) in self.plans.iter_mut().zip(self.ids) {
            let mesh = mesh(self.geometries, ids.geometry);
            *plan = Halves::of::<L>(mesh, ids).plan();
        }
    }
}

/// Some of the blocks that [`pack`] fills.
struct PackShare<'a> {
    geometries: &'a [Geometry],
    /// From its first block on.
    ids: &'a [BlockIds],
    followers: &'a [u8],
    /// Only of its own blocks.
    plans: &'a [Plan],
    /// The number of the first block.
    first: u32,
    may_lack_area: bool,
    lines: &'a mut [Line],
}

impl PackShare<'_> {
    fn run(self) {
        let Self { geometries, ids, followers, plans, first, may_lack_area, mut lines } = self;
        for (((number, plan), ids), &followers) in (first..).zip(plans).zip(ids).zip(followers) {
            let own = lines.split_off_mut(..lines_of(plan.is_unshared)).expect("there are as many lines");
            let mesh = mesh(geometries, ids.geometry);
            let Plan { corners, is_unshared, order } = *plan;
            let mut head = Head { number, taken: 0, is_unshared, followers: followers.into(), corners };
            let words = bytemuck::cast_slice_mut(own);
            for lane in 0..ids.primitives().count() {
                let primitive = ids.primitives[order.lane_before(lane)];
                let corners = mesh.indices[primitive as usize].map(|vertex| mesh.positions[vertex as usize]);
                head.taken |= u32::from(!may_lack_area || has_area(&corners)) << lane;
                put_corners(words, &head, lane, &corners);
            }
            head.put(words);
        }
    }
}

/// Moves the triangles of packed blocks to the current vertices. Returns false if triangles no longer coincide in a
/// vertex that they shared: some blocks are changed by then, and all must be packed again. Leaves out triangles without
/// an area, as [`pack`] does.
pub(crate) fn move_triangles(
    isa: Isa,
    geometries: &[Geometry],
    ids: &[BlockIds],
    may_lack_area: bool,
    lines: &mut [Line],
) -> bool {
    let mut lines = lines;
    let share = share_of(ids.len());
    let mut shares = Vec::with_capacity(ids.len().div_ceil(share));
    for ids in ids.chunks(share) {
        let len = ids.iter().fold(0, |place, _| Blocks::new(lines).block(place).place_behind(place));
        let lines = lines.split_off_mut(..len as usize).expect("their heads are there");
        shares.push(MoveShare { geometries, ids, may_lack_area, lines });
    }
    shares.into_par_iter().all(|share| isa.run(share))
}

/// Some of the triangles that [`move_triangles`] moves.
struct MoveShare<'a> {
    geometries: &'a [Geometry],
    ids: &'a [BlockIds],
    may_lack_area: bool,
    lines: &'a mut [Line],
}

impl Dispatch for MoveShare<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<L: Simd>(self) -> bool {
        let Self { geometries, ids: all, may_lack_area, mut lines } = self;
        let mut do_fit = true;
        for (place, ids) in all.iter().enumerate() {
            // Prefetches the vertices of the next block, and the indices of the one after it.
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
            let mesh = mesh(geometries, ids.geometry);
            let mut head = Head::of(bytemuck::cast_slice(lines));
            let own = lines.split_off_mut(..lines_of(head.is_unshared)).expect("there are as many lines");
            let words: &mut [u32] = bytemuck::cast_slice_mut(own);
            let mut triangles = [[Vec3::ZERO; 3]; BLOCK];
            let mut len = 0;
            head.taken = 0;
            for (lane, primitive) in ids.primitives().enumerate() {
                let corners = mesh.indices[primitive as usize].map(|vertex| mesh.positions[vertex as usize]);
                head.taken |= u32::from(!may_lack_area || has_area(&corners)) << lane;
                put_corners(words, &head, lane, &corners);
                triangles[lane] = corners;
                len += 1;
            }
            for (lane, corners) in triangles[..len].iter().enumerate() {
                for (corner, position) in corners.iter().enumerate() {
                    let vertex = vertex_at(&head, corner, lane);
                    for axis in 0..3 {
                        let stands = words[row(head.is_unshared, axis) + vertex];
                        do_fit &= stands == position[axis].to_bits();
                    }
                }
            }
            head.put(words);
        }
        do_fit
    }
}

/// Writes the corners of a triangle into a block with this head.
#[inline(always)]
fn put_corners(words: &mut [u32], head: &Head, lane: usize, corners: &[Vec3; 3]) {
    for (corner, position) in corners.iter().enumerate() {
        let vertex = vertex_at(head, corner, lane);
        for axis in 0..3 {
            words[row(head.is_unshared, axis) + vertex] = position[axis].to_bits();
        }
    }
}

/// Whether the triangles of meshes have the same vertex indices as before. Otherwise they may share more vertices.
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

/// How to pack a block.
#[derive(Clone, Copy)]
struct Plan {
    /// As in the head of a block.
    corners: [u32; 3],
    is_unshared: bool,
    order: LaneOrder,
}

impl Plan {
    const UNSHARED: Self = Self { corners: [0; 3], is_unshared: true, order: LaneOrder::SAME };
}

/// The triangles of a block in two halves. Each vertex is one bit: that of its first corner.
#[derive(Clone, Copy)]
struct Halves {
    /// For each lane, the bits of its corners' vertices; zero in an empty lane.
    corners: [[u32; 3]; BLOCK],
    /// The vertices of either half.
    vertices: [u32; 2],
    order: LaneOrder,
    /// Number of triangles.
    len: usize,
}

/// The ways to choose four of five, six, seven and eight triangles, as masks; of eight, only those with the first
/// triangle.
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
    /// The halves for the triangles with these ids. Compares every corner with all before it, almost without branches.
    /// If too few share a vertex index, compares positions.
    #[inline(always)]
    fn of<L: Simd>(mesh: &TriangleMesh, ids: &BlockIds) -> Self {
        let mut all = [0; 3 * BLOCK];
        let (triangles, _) = all.as_chunks_mut::<3>();
        let mut len = 0;
        for (triangle, primitive) in triangles.iter_mut().zip(ids.primitives()) {
            *triangle = mesh.indices[primitive as usize];
            len += 1;
        }
        let first = triangles[0];
        triangles[len..].fill(first);
        let halves = Self::by_equals(&L::equals_before(&all), len);
        if halves.do_fit() {
            return halves;
        }
        let mut equals = [u32::MAX; 3 * BLOCK];
        for axis in 0..3 {
            let mut coordinates = all;
            for vertex in &mut coordinates {
                *vertex = mesh.positions[*vertex as usize][axis].to_bits();
            }
            for (equals, own) in equals.iter_mut().zip(L::equals_before(&coordinates)) {
                *equals &= own;
            }
        }
        Self::by_equals(&equals, len)
    }

    /// For each corner, a mask of the equal corners before it.
    #[inline(always)]
    fn by_equals(equals: &[u32; 3 * BLOCK], len: usize) -> Self {
        let mut corners = [[0u32; 3]; BLOCK];
        for (at, (corner, before)) in corners[..len].as_flattened_mut().iter_mut().zip(equals).enumerate() {
            let same = before | 1 << at;
            *corner = same & same.wrapping_neg();
        }
        let halves = Self::of_corners(corners, len, LaneOrder::SAME);
        let vertex_count = (halves.vertices[0] | halves.vertices[1]).count_ones() as usize;
        if halves.do_fit() || vertex_count > 2 * MAX_IN_HALF || len <= QUAD {
            return halves;
        }
        halves.divided_better()
    }

    /// The halves for these corners, in this order.
    #[inline(always)]
    fn of_corners(corners: [[u32; 3]; BLOCK], len: usize, order: LaneOrder) -> Self {
        let mut vertices = [0; 2];
        for (lane, [a, b, c]) in corners.iter().enumerate() {
            vertices[lane / QUAD] |= a | b | c;
        }
        Self { corners, vertices, order, len }
    }

    /// Redistributes the triangles so that the larger half has as few vertices as possible.
    #[inline(always)]
    fn divided_better(self) -> Self {
        // The vertices of each subset of the first four triangles, and of the last four.
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
        // The vertex count in the upper bits, the mask below; the smallest mask wins a tie.
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

    /// The same halves in another order, which changes the first corner of a vertex.
    #[inline(always)]
    fn in_order(self, order: LaneOrder) -> Self {
        let mut first_of = [0u32; 3 * BLOCK];
        let mut corners = [[0u32; 3]; BLOCK];
        for (lane, triangle) in corners[..self.len].iter_mut().enumerate() {
            let before = self.corners[order.lane_before(lane)];
            for (i, (corner, before)) in triangle.iter_mut().zip(before).enumerate() {
                let first = &mut first_of[before.trailing_zeros() as usize % (3 * BLOCK)];
                *first = if *first == 0 { 1 << (3 * lane + i) } else { *first };
                *corner = *first;
            }
        }
        Self::of_corners(corners, self.len, order)
    }

    /// Vertices of the larger half.
    #[inline(always)]
    fn most_in_half(&self) -> u32 {
        self.vertices[0].count_ones().max(self.vertices[1].count_ones())
    }

    /// Whether a block can share these vertices.
    #[inline(always)]
    fn do_fit(&self) -> bool {
        self.most_in_half() as usize <= MAX_IN_HALF
    }

    #[inline(always)]
    fn plan(&self) -> Plan {
        if !self.do_fit() {
            return Plan::UNSHARED;
        }
        let mut words = [0u32; 3];
        for (lane, corners) in self.corners.iter().enumerate() {
            let half = lane / QUAD;
            for (word, corner) in words.iter_mut().zip(corners) {
                // An empty lane counts no vertices.
                let before = self.vertices[half] & corner.saturating_sub(1);
                *word |= shared_number(half, before.count_ones()) << (4 * lane);
            }
        }
        Plan { corners: words, is_unshared: false, order: self.order }
    }
}

/// Rewrites references to leaves of triangles: from the number of the first block, as `number_of` returns it, to the
/// line where that block begins.
pub(crate) fn refer(
    nodes: &mut [Node],
    root: &mut Option<u32>,
    places: &[u32],
    number_of: impl Fn(u32) -> usize + Sync,
) {
    let refer = |reference: &mut u32| {
        if tag::of(*reference) == tag::TRIANGLES {
            *reference = tag::reference(tag::TRIANGLES, places[number_of(*reference)]);
        }
    };
    root.iter_mut().for_each(refer);
    nodes.par_iter_mut().with_min_len(64).for_each(|node| {
        let len = node.len();
        node.children[..len].iter_mut().for_each(refer);
    });
}

/// How many blocks of its leaf follow each block, for nodes whose references number blocks.
pub(crate) fn followers_of(nodes: &[Node], root: Option<u32>, blocks: usize) -> Vec<u8> {
    let mut followers = vec![0; blocks];
    let children = nodes.iter().flat_map(|node| &node.children[..node.len()]);
    for &reference in children.chain(&root).filter(|&&reference| tag::of(reference) == tag::TRIANGLES) {
        for (behind, followers) in followers[tag::blocks(reference)].iter_mut().rev().enumerate() {
            *followers = behind as u8;
        }
    }
    followers
}
