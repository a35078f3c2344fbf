//! Parts of triangles: what of a triangle lies in a cell, and a box around it.
//!
//! A tree of the best preset may have a triangle in several leaves, each for a part of it, so that the boxes of long and slanted
//! triangles are small. The parts of a triangle are what lies in the cells that its own box is cut into, each cell by one plane
//! into two. A plane is kept as a fraction of the triangle's box, so that cells that tile the box still do when the triangle
//! has moved.
//!
//! # Why no point is lost
//!
//! Let T be the triangle, its corners rounded to tree units, where |x| < 2; H₁, H₂, … the half-spaces of its cell, and Sₖ what of
//! T lies in the first k. [`part_of`] cuts a polygon by them one after the other (I. Sutherland, G. Hodgman, "Reentrant
//! Polygon Clipping", Communications of the ACM 17(1), 1974), but by planes that are 2⁻⁴⁰ (`SLACK`) farther out. To show: there is a
//! convex polygon Qₖ ⊇ Sₖ in T whose corners are those that were computed, but for errors of at most kη, where η = 2⁻⁴⁸.
//!
//! It holds for k = 0. Let it hold for k, and take Hₖ₊₁ to be x ≤ c. Corners v that were computed are kept where v.x ≤ c + 2⁻⁴⁰;
//! where an edge from v to w leaves that, the corner v + τ(w - v) is put in, with a τ in [0, 1] as it was rounded. Let Qₖ₊₁
//! be made of the corners of Qₖ that belong to those which were kept, and the points of its edges at the same τ. Sums with the
//! same weights keep the errors of corners to what they were; roundings add less than η. It remains to be seen that what was
//! cut off Qₖ lies beyond c. That is, for each run of corners that were dropped, the hull of them and of the two new ones. The
//! dropped ones were computed beyond c + 2⁻⁴⁰, so they lie beyond c + 2⁻⁴⁰ - kη. The quotient τ of two differences is wrong by
//! three roundings of itself, so that a new corner was computed within η of c + 2⁻⁴⁰, and belongs to a point beyond
//! c + 2⁻⁴⁰ - (k + 2)η. With k ≤ 6 all that is more than c, and so is their hull.
//!
//! So each point of T in the cell is within 2⁻⁴⁰ of the box around the computed corners, cut by the planes of the cell. Boxes are
//! widened by 2⁻²⁸ more than their rounding needs (see [`Bounds`]). A point of T is in one cell or another, as both sides of a
//! cut have the same plane to the bit.

use std::collections::BTreeMap;

use bytemuck::{Pod, Zeroable};
use lumbre_math::DVec3;

use crate::lanes::{self, Portable};
use crate::node::Units;
use crate::prepare::Boxer;
use crate::primitive::Bounds;
use crate::triangles::BLOCK;
use crate::{Geometry, GeometryKind, TriangleMesh};

/// A part of a triangle's box, between fractions of its size; the least and the greatest fraction are no planes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Cell {
    pub(crate) low: [u16; 3],
    pub(crate) high: [u16; 3],
}

impl Cell {
    /// All of it.
    pub(crate) const WHOLE: Self = Self { low: [0; 3], high: [u16::MAX; 3] };

    /// What is on both sides of a plane within.
    pub(crate) fn cut(self, axis: usize, at: u16) -> [Self; 2] {
        let mut sides = [self; 2];
        sides[0].high[axis] = at;
        sides[1].low[axis] = at;
        sides
    }

    /// Whether it has a size on every axis.
    pub(crate) fn is_sound(&self) -> bool {
        (0..3).all(|axis| self.low[axis] < self.high[axis])
    }
}

/// The cell of a triangle in a lane of a block, where that is not all of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct LaneCell {
    /// The number of the block, times eight, plus that of the lane.
    pub(crate) lane: u32,
    pub(crate) cell: Cell,
}

/// Those in a block, of a list in the order of lanes.
#[inline]
pub(crate) fn cells_in(cells: &[LaneCell], block: usize) -> &[LaneCell] {
    let place_of = |block: usize| cells.partition_point(|at| (at.lane as usize) < block * BLOCK);
    if cells.is_empty() { &[] } else { &cells[place_of(block)..place_of(block + 1)] }
}

/// Whether what is in a lane is but a part of a triangle, of which others are elsewhere.
#[inline]
pub(crate) fn is_part(cells: &[LaneCell], block: u32, lane: u32) -> bool {
    !cells.is_empty() && cells.binary_search_by_key(&(block * BLOCK as u32 + lane), |at| at.lane).is_ok()
}

/// By how much farther out than its planes a cell is cut.
const SLACK: f64 = 1.0 / (1u64 << 40) as f64;
/// Corners of what is left of a triangle: each of six cuts adds one, and there is room for what roundings may do.
const CORNERS: usize = 16;

/// The corners of a triangle in tree units.
pub(crate) type Corners = [[f64; 3]; 3];

/// What cuts the triangles of a mesh.
pub(crate) struct Carver<'a> {
    boxer: Boxer,
    mesh: &'a TriangleMesh,
    shift: DVec3,
    scale: f64,
}

impl<'a> Carver<'a> {
    pub(crate) fn new(mesh: &'a TriangleMesh, units: &Units) -> Self {
        let boxer = Boxer::new(mesh, units);
        Self { boxer, mesh, shift: units.origin - mesh.origin, scale: units.scale }
    }

    /// Of every mesh, by position.
    pub(crate) fn of_all(geometries: &'a [Geometry], units: &Units) -> Vec<Option<Self>> {
        let carver = |geometry: &'a Geometry| match &geometry.kind {
            GeometryKind::Mesh(mesh) => Some(Self::new(mesh, units)),
            _ => None,
        };
        geometries.iter().map(carver).collect()
    }

    #[inline(always)]
    pub(crate) fn corners(&self, triangle: u32) -> Corners {
        self.mesh.indices[triangle as usize].map(|vertex| {
            let position = self.mesh.positions[vertex as usize].as_dvec3();
            ((position - self.shift) * self.scale).to_array()
        })
    }

    /// Asks for the vertices of a triangle to be brought near, and for what names them of another, whose vertices come next.
    #[inline(always)]
    pub(crate) fn fetch(&self, triangle: u32, next: u32) {
        if let Some(vertices) = self.mesh.indices.get(triangle as usize) {
            for vertex in vertices {
                self.mesh.positions.get(*vertex as usize).map(lanes::fetch);
            }
        }
        self.mesh.indices.get(next as usize).map(lanes::fetch);
    }

    /// The box around a triangle, under the names of its geometry and of itself.
    pub(crate) fn whole(&self, geometry: u32, triangle: u32) -> Bounds {
        let corners = self.mesh.indices[triangle as usize].map(|vertex| self.mesh.positions[vertex as usize]);
        self.boxer.around::<Portable>(&corners, geometry, triangle)
    }

    /// The box around triangles that stand in the mesh's space.
    pub(crate) fn around(&self, triangles: impl Iterator<Item = [[f32; 3]; 3]>) -> Bounds {
        self.boxer.around_all::<Portable>(triangles)
    }
}

/// Where a fraction of what reaches from `low` to `high` is.
#[inline(always)]
pub(crate) fn plane_at(low: f64, high: f64, fraction: u16) -> f64 {
    low + (high - low) * (f64::from(fraction) / f64::from(u16::MAX))
}

/// From where to where a triangle reaches on an axis.
#[inline(always)]
pub(crate) fn reach(corners: &Corners, axis: usize) -> [f64; 2] {
    let [a, b, c] = corners.map(|corner| corner[axis]);
    [a.min(b).min(c), a.max(b).max(c)]
}

/// The box around what of a triangle lies in a cell; `None` where that is nothing.
pub(crate) fn part_of(corners: &Corners, cell: &Cell) -> Option<Bounds> {
    let mut polygon = Polygon::of(corners);
    let (mut low, mut high) = ([f64::NEG_INFINITY; 3], [f64::INFINITY; 3]);
    for axis in 0..3 {
        let [start, end] = reach(corners, axis);
        if cell.low[axis] != 0 {
            low[axis] = plane_at(start, end, cell.low[axis]);
            polygon.cut(axis, low[axis] - SLACK, -1.0);
        }
        if cell.high[axis] != u16::MAX {
            high[axis] = plane_at(start, end, cell.high[axis]);
            polygon.cut(axis, high[axis] + SLACK, 1.0);
        }
    }
    if polygon.len == 0 {
        return None;
    }
    for axis in 0..3 {
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        for corner in &polygon.corners[..polygon.len] {
            least = least.min(corner[axis]);
            most = most.max(corner[axis]);
        }
        // Both are within `SLACK` of the cell.
        (low[axis], high[axis]) = (least.max(low[axis]).min(high[axis]), most.min(high[axis]).max(low[axis]));
    }
    Some(Bounds::new(low.map(|x| x as f32), high.map(|x| x as f32), 0, 0))
}

/// A triangle, or what is left of it.
struct Polygon {
    corners: [[f64; 3]; CORNERS],
    len: usize,
}

impl Polygon {
    fn of(corners: &Corners) -> Self {
        let mut polygon = Self { corners: [[0.0; 3]; CORNERS], len: 3 };
        polygon.corners[..3].copy_from_slice(corners);
        polygon
    }

    /// Drops what is beyond a plane: above it where `sign` is 1, below where it is -1. Where that would need too much room,
    /// everything stays, which holds as much.
    fn cut(&mut self, axis: usize, plane: f64, sign: f64) {
        let Some(mut last) = self.corners[..self.len].last().copied() else { return };
        let mut kept = [[0.0; 3]; CORNERS];
        let mut len = 0;
        for &corner in &self.corners[..self.len] {
            if len + 2 > CORNERS {
                return;
            }
            let (from, to) = ((plane - last[axis]) * sign, (plane - corner[axis]) * sign);
            if (from < 0.0) != (to < 0.0) {
                let along = from / (from - to);
                kept[len] = std::array::from_fn(|i| last[i] + along * (corner[i] - last[i]));
                len += 1;
            }
            if to >= 0.0 {
                kept[len] = corner;
                len += 1;
            }
            last = corner;
        }
        (self.corners, self.len) = (kept, len);
    }
}

/// How often each cell may be looked at to see that those of a triangle tile its box: four times for each level on which a build
/// cuts them.
const MOST_WORK: usize = 256;

/// Whether all triangles that are in parts have all of them: a triangle that has not, if there is one. Each part comes with
/// the name of its triangle.
pub(crate) fn find_incomplete(parts: impl Iterator<Item = ([u32; 2], Cell)>) -> Option<[u32; 2]> {
    let mut all: BTreeMap<[u32; 2], Vec<Cell>> = BTreeMap::new();
    for (name, cell) in parts {
        all.entry(name).or_default().push(cell);
    }
    all.into_iter().find_map(|(name, cells)| (!do_tile(cells)).then_some(name))
}

/// Whether cells tile all of a box, as those do that came about by cuts of one into two.
fn do_tile(mut cells: Vec<Cell>) -> bool {
    let mut work = MOST_WORK * cells.len();
    let mut pending = vec![(Cell::WHOLE, 0..cells.len())];
    while let Some((whole, range)) = pending.pop() {
        let some = &mut cells[range.clone()];
        if let [one] = some {
            if *one != whole {
                return false;
            }
            continue;
        }
        if work < some.len() {
            return false;
        }
        work -= some.len();
        // The cut nearest to the middle that no cell crosses.
        let mut best: Option<(usize, usize, u16)> = None;
        for axis in 0..3 {
            some.sort_unstable_by_key(|cell| (cell.low[axis], *cell));
            let mut end = 0;
            for place in 1..some.len() {
                end = end.max(some[place - 1].high[axis]);
                let distance = |place: usize| place.abs_diff(some.len() / 2);
                if end == some[place].low[axis]
                    && best.is_none_or(|(_, other, _)| distance(place) < distance(other))
                {
                    best = Some((axis, place, end));
                }
            }
        }
        let Some((axis, place, at)) = best else { return false };
        if !(whole.low[axis] < at && at < whole.high[axis]) {
            return false;
        }
        some.sort_unstable_by_key(|cell| (cell.low[axis], *cell));
        let [low, high] = whole.cut(axis, at);
        pending.push((low, range.start..range.start + place));
        pending.push((high, range.start + place..range.end));
    }
    true
}
