//! Splits by planes: triangles on both sides of one stand on both, each side with its part.
//!
//! M. Stich, H. Friedrich, A. Dietrich, "Spatial Splits in Bounding Volume Hierarchies", High Performance Graphics, 2009. It
//! differs from theirs in three ways. A subtree may use no more than its share of the places for parts, so that threads need not
//! wait for each other and always make the same tree (as in V. Fuetterling, C. Lojewski, F.-J. Pfreundt, A. Ebert, "Parallel
//! Spatial Splits in Bounding Volume Hierarchies", Eurographics Symposium on Parallel Graphics and Visualization, 2016). Parts
//! are cut from whole triangles, by all their planes (see `carve`). And the tree is taken only where it is much better than the
//! one without: subtrees that are put elsewhere later (see `reinsert`) gain as much in most scenes, and parts stand in their way.

use rayon::prelude::*;

use super::{Binary, Builder, CHUNK, Name, PARALLEL, Plot, Range, SAH_DEPTH, Tools, fill};
use crate::bins::{Binning, Bins};
use crate::carve::{Carver, Cell, Corners, part_of, plane_at, reach};
use crate::clouds::box_of;
use crate::few::FEW;
use crate::lanes::{Lanes, Task};
use crate::node::Units;
use crate::primitive::{Bounds, ONE, Primitive};
use crate::triangles::BLOCK;
use crate::{Geometry, GeometryKind};

/// How many more parts there may be than triangles, as a share of these. Of 100 000 needles, a ray meets 14 % less with 0.3, and
/// with 0.6 another 11 %, but that is another third of their memory.
const MORE: f64 = 0.3;
/// A tree with parts is tried where the empty places in the boxes of triangles have more area than this share of what a ray
/// meets in the tree without. Of needles every which way this is 1.07; of rooms, statues and landscapes, whose trees would become
/// no better, 0.1 to 0.56.
const LEAST_WASTE: f64 = 0.75;
/// And taken where a ray meets no more than this share of what it does in the tree without.
const MOST_COST: f64 = 0.95;
/// A split by a plane is tried where the sides of one by objects have more than this share of the tree's area in common. With
/// a fiftieth of it, the build of needles takes twice as long, and rays gain nothing that could be measured.
const LEAST_OVERLAP: f32 = 0.05;
/// And by a plane it is where that costs no more than this share of what the split by objects does: its boxes are the smaller ones,
/// which further splits gain by. Of two sets of needles, one then has a tree that is better by 7 % and not the same one.
const MOST_PLANE_COST: f32 = 1.05;
/// Slabs that an axis is divided into; planes lie between them. With sixteen, the tree of needles becomes no better, and takes a fifth
/// longer; with five, rays take up to an eighth longer through it.
const SLABS: usize = 8;
/// How many triangles ahead the vertices of one are asked for.
const SOON: usize = 8;

/// How little is enough.
#[derive(Clone, Copy)]
pub(crate) struct Eagerness {
    least_waste: f64,
    most_cost: f64,
    least_overlap: f32,
    /// Whether a plane is taken even where it costs more.
    is_blind: bool,
}

impl Eagerness {
    /// The usual one; in tests, that which the calling thread was told.
    pub(super) fn now() -> Self {
        #[cfg(test)]
        if tests::IS_FORCED.get() {
            let (least_waste, most_cost) = (0.0, f64::INFINITY);
            return Self { least_waste, most_cost, least_overlap: 0.0, is_blind: true };
        }
        let (least_waste, most_cost, least_overlap) = (LEAST_WASTE, MOST_COST, LEAST_OVERLAP);
        Self { least_waste, most_cost, least_overlap, is_blind: false }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use std::cell::Cell;

    thread_local! {
        /// Whether the best preset splits triangles wherever it can.
        pub(crate) static IS_FORCED: Cell<bool> = const { Cell::new(false) };
    }
}

/// A tree whose triangles may be in parts.
pub(super) struct InParts {
    pub(super) tree: Binary<'static>,
    /// Those of its leaves; there are gaps between leaves.
    pub(super) names: Vec<Name>,
    pub(super) cells: Vec<Cell>,
}

/// A tree over the same triangles, and spheres, with triangles in parts, where that is much better. `names` are the tree's own,
/// the first of which has the place `first`.
pub(super) fn in_parts(
    builder: &Builder,
    eagerness: Eagerness,
    geometries: &[Geometry],
    units: &Units,
    tree: &Binary,
    names: &[Name],
    first: usize,
) -> Option<InParts> {
    let carvers = &*Carver::of_all(geometries, units);
    let old_cost = cost_of(tree);
    // Whatever is no number counts as too much.
    let is_promising = waste(carvers, names) > eagerness.least_waste * old_cost || eagerness.is_blind;
    let slack = (MORE * names.len() as f64) as usize;
    if !is_promising || names.len() + slack > crate::prepare::MOST_PRIMITIVES {
        return None;
    }
    let boxed = |&[geometry, primitive]: &Name| match (
        &carvers[geometry as usize],
        &geometries[geometry as usize].kind,
    ) {
        (Some(carver), _) => carver.whole(geometry, primitive),
        (None, GeometryKind::Spheres(cloud)) => {
            box_of(cloud, primitive, units).with_names(geometry, primitive)
        }
        _ => unreachable!("triangles and spheres are packed"),
    };
    let boxes: Vec<Primitive> = names.par_iter().with_min_len(1024).map(boxed).collect();
    let (whole, _) = builder.measure(&boxes);
    let least_overlap = eagerness.least_overlap * whole.half_area();
    let spatial = Spatial { builder, carvers, least_overlap, is_blind: eagerness.is_blind };
    let mut names = fill(boxes.len() + slack, [0; 2]);
    let mut cells = fill(boxes.len() + slack, Cell::WHOLE);
    let room = Room { names: &mut names, cells: &mut cells, first };
    let all = Parts { cells: fill(boxes.len(), Cell::WHOLE), boxes };
    let tree = spatial.grow(all, slack, room, 0);
    (cost_of(&tree) <= eagerness.most_cost * old_cost).then_some(InParts { tree, names, cells })
}

/// What a ray meets in a tree: the areas of its wide nodes and of its leaves, in tree units.
fn cost_of(tree: &Binary) -> f64 {
    let mut sum = f64::from(tree.costs()[1]);
    let mut pending = vec![tree];
    while let Some(tree) = pending.pop() {
        match tree {
            Binary::Fork(fork) => pending.extend(&fork.children),
            Binary::Twig(twig) => {
                let leaves = twig.nodes.iter().filter(|node| node.names().is_some());
                sum += leaves.map(|leaf| f64::from(leaf.bounds().half_area())).sum::<f64>();
            }
        }
    }
    sum / (ONE * ONE)
}

/// By how much the boxes of triangles are larger than they themselves as seen along the axes: half the areas, in tree units.
fn waste(carvers: &[Option<Carver>], names: &[Name]) -> f64 {
    let of_one = |&[geometry, triangle]: &Name| {
        let Some(carver) = &carvers[geometry as usize] else { return 0.0 };
        let corners = carver.corners(triangle);
        let size = |axis: usize| {
            let [low, high] = reach(&corners, axis);
            high - low
        };
        let side = |corner: usize, axis: usize| corners[corner][axis] - corners[0][axis];
        let shadow = |x: usize, y: usize| 0.5 * (side(1, x) * side(2, y) - side(1, y) * side(2, x)).abs();
        let empty = |x: usize, y: usize| size(x) * size(y) - shadow(x, y);
        empty(0, 1) + empty(1, 2) + empty(2, 0)
    };
    // Sums of chunks, so that threads make no difference.
    let sums: Vec<f64> = names.par_chunks(CHUNK).map(|names| names.iter().map(of_one).sum()).collect();
    sums.into_iter().sum()
}

/// Triangles on their way into the tree, whole or in parts.
struct Parts {
    boxes: Vec<Primitive>,
    cells: Vec<Cell>,
}

impl Parts {
    fn with_room(count: usize) -> Self {
        Self { boxes: Vec::with_capacity(count), cells: Vec::with_capacity(count) }
    }

    fn push(&mut self, bounds: Primitive, cell: Cell) {
        self.boxes.push(bounds);
        self.cells.push(cell);
    }

    fn len(&self) -> usize {
        self.boxes.len()
    }
}

/// Where the leaves of a subtree put what is in them.
struct Room<'a> {
    names: &'a mut [Name],
    cells: &'a mut [Cell],
    /// The place of the first name.
    first: usize,
}

impl Room<'_> {
    fn cut(self, left: usize) -> [Self; 2] {
        let (names, right_names) = self.names.split_at_mut(left);
        let (cells, right_cells) = self.cells.split_at_mut(left);
        let right = Self { names: right_names, cells: right_cells, first: self.first + left };
        [Self { names, cells, first: self.first }, right]
    }
}

/// A plane that would split a node.
#[derive(Clone, Copy)]
struct Plane {
    cost: f32,
    axis: usize,
    /// In fixed-point numbers.
    at: f64,
    /// What is on each side, and how much.
    bounds: [Bounds; 2],
    counts: [usize; 2],
}

struct Spatial<'b, 'a> {
    builder: &'b Builder<'b>,
    carvers: &'b [Option<Carver<'a>>],
    least_overlap: f32,
    is_blind: bool,
}

impl Spatial<'_, '_> {
    /// `slack` is how many parts more it may make; there is room for them. The depth of its recursion is bounded.
    fn grow(&self, parts: Parts, slack: usize, room: Room, depth: u32) -> Binary<'static> {
        let count = parts.len();
        let is_over = slack == 0 || count <= FEW || depth >= SAH_DEPTH;
        let Some([left, right]) = (if is_over { None } else { self.divide(&parts, slack, depth) }) else {
            return self.grow_on(parts, room, depth);
        };
        drop(parts);
        let all = left.len() + right.len();
        let rest = slack - (all - count);
        let to_left = (rest as u64 * left.len() as u64 / all as u64) as usize;
        let [left_room, right_room] = room.cut(left.len() + to_left);
        let grow_left = || self.grow(left, to_left, left_room, depth + 1);
        let grow_right = || self.grow(right, rest - to_left, right_room, depth + 1);
        let (left, right) =
            if all > PARALLEL { rayon::join(grow_left, grow_right) } else { (grow_left(), grow_right()) };
        Binary::over([left, right])
    }

    /// The rest without planes.
    fn grow_on(&self, parts: Parts, room: Room, depth: u32) -> Binary<'static> {
        let Parts { mut boxes, cells } = parts;
        let count = boxes.len();
        // For now they are called by their places.
        let triangles: Vec<u32> = boxes.iter().map(Bounds::second).collect();
        for (place, bounds) in boxes.iter_mut().enumerate() {
            *bounds = bounds.with_names(bounds.first(), place as u32);
        }
        let names = &mut room.names[..count];
        let tree = if count <= PARALLEL {
            let mut there = vec![Bounds::EMPTY; count];
            let mut nodes = Vec::new();
            let mut bins = Box::new(Bins::EMPTY);
            let (here, there) = (&mut boxes[..], &mut there[..]);
            let range = Range { here, there, names, first: room.first, depth, is_away: false };
            self.builder.twig::<false>(range, None, &mut Tools { nodes: &mut nodes, bins: &mut bins });
            Binary::twig(nodes)
        } else {
            let sketch = self.builder.sketch::<false>(&mut boxes, depth, None);
            let plot = Plot {
                primitives: &mut boxes,
                names: Some(names),
                first: room.first,
                keeps: false,
                moves: false,
            };
            self.builder.grow::<false>(&sketch, &[], plot)
        };
        for (name, cell) in room.names[..count].iter_mut().zip(room.cells) {
            let place = name[1] as usize;
            (name[1], *cell) = (triangles[place], cells[place]);
        }
        tree
    }

    /// The two sides of a node; `None` where planes are of no use.
    #[inline(never)]
    fn divide(&self, parts: &Parts, slack: usize, depth: u32) -> Option<[Parts; 2]> {
        let count = parts.len();
        let (whole, centers) = self.builder.measure(&parts.boxes);
        if centers.are_one() || whole.half_area() <= self.least_overlap {
            return None;
        }
        let binning = Binning::new(&centers, count);
        let mut bins = Bins::EMPTY;
        let split = self.builder.binned::<false>(&parts.boxes, binning, &mut bins, depth)?;
        let mut around = [Bounds::EMPTY; 2];
        for bounds in &parts.boxes {
            around[usize::from(!split.is_left(bounds))].grow(bounds);
        }
        let counts = [split.left, count - split.left];
        if around[0].common(&around[1]).half_area() > self.least_overlap
            && let Some(plane) = self.best_plane(&parts.boxes, &whole)
            && (plane.cost < MOST_PLANE_COST * cost(&around, counts) || self.is_blind)
            && let Some(sides) = self.divide_at(parts, &plane, slack)
        {
            return Some(sides);
        }
        let mut sides = counts.map(Parts::with_room);
        for (bounds, cell) in parts.boxes.iter().zip(&parts.cells) {
            sides[usize::from(!split.is_left(bounds))].push(*bounds, *cell);
        }
        Some(sides)
    }

    fn slabs(&self, boxes: &[Primitive], whole: &Bounds) -> Slabs {
        if boxes.len() <= CHUNK {
            let mut slabs = Slabs::EMPTY;
            let carvers = self.carvers;
            self.builder.level.run(FillSlabs { carvers, boxes, whole, slabs: &mut slabs });
            return slabs;
        }
        let (left, right) = boxes.split_at(boxes.len() / 2);
        let (mut slabs, other) = rayon::join(|| self.slabs(left, whole), || self.slabs(right, whole));
        slabs.join(&other);
        slabs
    }

    /// The cheapest plane, if there is any that leaves something on both sides.
    fn best_plane(&self, boxes: &[Primitive], whole: &Bounds) -> Option<Plane> {
        let slabs = self.slabs(boxes, whole);
        let mut best: Option<Plane> = None;
        for axis in 0..3 {
            let (bounds, starts, ends) = (&slabs.bounds[axis], &slabs.starts[axis], &slabs.ends[axis]);
            let mut rights = [(Bounds::EMPTY, 0); SLABS];
            for slab in (1..SLABS).rev() {
                let (mut right, count) = *rights.get(slab + 1).unwrap_or(&(Bounds::EMPTY, 0));
                right.grow(&bounds[slab]);
                rights[slab] = (right, count + ends[slab] as usize);
            }
            let (mut left, mut left_count) = (Bounds::EMPTY, 0);
            for slab in 1..SLABS {
                left.grow(&bounds[slab - 1]);
                left_count += starts[slab - 1] as usize;
                let (right, right_count) = rights[slab];
                let (bounds, counts) = ([left, right], [left_count, right_count]);
                let cost = cost(&bounds, counts);
                if !counts.contains(&0) && best.is_none_or(|best| cost < best.cost) {
                    let [start, end] = whole.range(axis).map(f64::from);
                    let at = start + (end - start) * slab as f64 / SLABS as f64;
                    best = Some(Plane { cost, axis, at, bounds, counts });
                }
            }
        }
        best
    }

    /// `None` where that needs too much room, or leads nowhere.
    fn divide_at(&self, parts: &Parts, plane: &Plane, slack: usize) -> Option<[Parts; 2]> {
        let &Plane { axis, at, bounds: around, counts, .. } = plane;
        let mut sides = counts.map(Parts::with_room);
        for (bounds, cell) in parts.boxes.iter().zip(&parts.cells) {
            let [low, high] = bounds.range(axis).map(f64::from);
            let is_across = low < at && at < high;
            let (goes_right, halves) = if is_across {
                let (is_cut, goes_right) = on_both_or_one(bounds, &around, counts);
                (goes_right, if is_cut || self.is_blind { self.halves(bounds, cell, axis, at) } else { None })
            } else {
                (at <= low, None)
            };
            match halves {
                Some(halves) => {
                    for (side, (bounds, cell)) in sides.iter_mut().zip(halves) {
                        side.push(bounds, cell);
                    }
                }
                None => sides[usize::from(goes_right)].push(*bounds, *cell),
            }
        }
        let used = sides[0].len() + sides[1].len() - parts.len();
        let is_less = |side: &Parts| (1..parts.len()).contains(&side.len());
        (used <= slack && sides.iter().all(is_less)).then_some(sides)
    }

    /// The parts on both sides of a plane; `None` where one would be empty, or the plane cannot be told from the end of the cell.
    fn halves(
        &self,
        bounds: &Primitive,
        cell: &Cell,
        axis: usize,
        at: f64,
    ) -> Option<[(Primitive, Cell); 2]> {
        let carver = self.carvers[bounds.first() as usize].as_ref()?;
        let corners = carver.corners(bounds.second());
        let [low, high] = reach(&corners, axis);
        let fraction = ((at / ONE - low) / (high - low) * f64::from(u16::MAX)).round();
        if !(f64::from(cell.low[axis]) < fraction && fraction < f64::from(cell.high[axis])) {
            return None;
        }
        let plane = plane_at(low, high, fraction as u16);
        if !(low < plane && plane < high) {
            return None;
        }
        let [left, right] = cell.cut(axis, fraction as u16);
        let named = |part: Bounds| part.with_names(bounds.first(), bounds.second());
        let (left_part, right_part) = (part_of(&corners, &left)?, part_of(&corners, &right)?);
        Some([(named(left_part), left), (named(right_part), right)])
    }
}

/// Areas by blocks.
fn cost(bounds: &[Bounds; 2], counts: [usize; 2]) -> f32 {
    let side = |side: usize| bounds[side].half_area() * counts[side].div_ceil(BLOCK) as f32;
    side(0) + side(1)
}

/// Whether what a plane goes through is cut by it; and whether it goes to the right where it is not.
fn on_both_or_one(bounds: &Bounds, around: &[Bounds; 2], counts: [usize; 2]) -> (bool, bool) {
    let [left, right] = around.map(|side| side.half_area());
    let [all_left, all_right] = around.map(|mut side| {
        side.grow(bounds);
        side.half_area()
    });
    let [on_left, on_right] = counts.map(|count| count as f32);
    let both = left * on_left + right * on_right;
    let only_left = all_left * on_left + right * (on_right - 1.0);
    let only_right = left * (on_left - 1.0) + all_right * on_right;
    (both < only_left.min(only_right), only_right < only_left)
}

/// What the slabs of a node hold.
struct Slabs {
    bounds: [[Bounds; SLABS]; 3],
    /// How many begin there.
    starts: [[u32; SLABS]; 3],
    /// How many end there.
    ends: [[u32; SLABS]; 3],
}

impl Slabs {
    const EMPTY: Self =
        Self { bounds: [[Bounds::EMPTY; SLABS]; 3], starts: [[0; SLABS]; 3], ends: [[0; SLABS]; 3] };

    fn join(&mut self, other: &Self) {
        for axis in 0..3 {
            for slab in 0..SLABS {
                self.bounds[axis][slab].grow(&other.bounds[axis][slab]);
                self.starts[axis][slab] += other.starts[axis][slab];
                self.ends[axis][slab] += other.ends[axis][slab];
            }
        }
    }
}

/// Adds what triangles have in each slab of a node.
struct FillSlabs<'s> {
    carvers: &'s [Option<Carver<'s>>],
    boxes: &'s [Primitive],
    whole: &'s Bounds,
    slabs: &'s mut Slabs,
}

impl Task for FillSlabs<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self { carvers, boxes, whole, slabs } = self;
        let starts = [0, 1, 2].map(|axis| whole.range(axis)[0] as f32);
        let widths = [0, 1, 2].map(|axis| (whole.range(axis)[1] as f32 - starts[axis]) / SLABS as f32);
        for (place, bounds) in boxes.iter().enumerate() {
            if let (Some(soon), Some(later)) = (boxes.get(place + SOON), boxes.get(place + 2 * SOON))
                && soon.first() == later.first()
                && let Some(carver) = &carvers[soon.first() as usize]
            {
                carver.fetch(soon.second(), later.second());
            }
            // Spheres stay whole.
            let carver = carvers[bounds.first() as usize].as_ref();
            let mut corners = None;
            for axis in 0..3 {
                let (start, width) = (starts[axis], widths[axis]);
                // Too thin to be split, and a box of no width is in every slab.
                if width < 16.0 {
                    continue;
                }
                let slab_of = |x: f32| (((x - start) / width) as usize).min(SLABS - 1);
                let [low, high] = bounds.range(axis);
                let (low, high) = (low as f32, high as f32);
                let own = &mut slabs.bounds[axis];
                let (first, last) = if carver.is_some() {
                    (slab_of(low), slab_of(high))
                } else {
                    let slab = slab_of(0.5 * (low + high));
                    (slab, slab)
                };
                slabs.starts[axis][first] += 1;
                slabs.ends[axis][last] += 1;
                let Some(carver) = carver.filter(|_| first < last) else {
                    own[first].grow(bounds);
                    continue;
                };
                let corners = corners.get_or_insert_with(|| points_of(&carver.corners(bounds.second())));
                let mut parts = [Bounds::EMPTY; SLABS];
                for edge in 0..3 {
                    let ends = [corners[edge], corners[(edge + 1) % 3]];
                    let Some([a, b]) = between(ends, axis, low, high) else { continue };
                    let from = slab_of(a[axis]).clamp(first, last);
                    let to = slab_of(b[axis]).clamp(first, last);
                    parts[from].grow(&at_point::<L>(&a));
                    parts[to].grow(&at_point::<L>(&b));
                    let step = 1.0 / (b[axis] - a[axis]);
                    for slab in from + 1..=to {
                        let along = (start + slab as f32 * width - a[axis]) * step;
                        let point = at_point::<L>(&towards(&a, &b, along.clamp(0.0, 1.0)));
                        parts[slab - 1].grow(&point);
                        parts[slab].grow(&point);
                    }
                }
                for slab in first..=last {
                    own[slab].grow(&parts[slab].common(bounds));
                }
            }
        }
    }
}

/// A point in fixed-point numbers; the last of four means nothing.
type Point = [f32; 4];

#[inline(always)]
fn points_of(corners: &Corners) -> [Point; 3] {
    corners.map(|[x, y, z]| [(x * ONE) as f32, (y * ONE) as f32, (z * ONE) as f32, 0.0])
}

#[inline(always)]
fn at_point<L: Lanes>(&[x, y, z, w]: &Point) -> Bounds {
    Bounds::truncated::<L>(&[x, y, z, w, -x, -y, -z, -w])
}

#[inline(always)]
fn towards(a: &Point, b: &Point, along: f32) -> Point {
    let mut point = *a;
    for (x, (a, b)) in point.iter_mut().zip(a.iter().zip(b)) {
        *x = a + along * (b - a);
    }
    point
}

/// What of an edge lies between two planes, from the lower to the upper end, about.
#[inline(always)]
fn between([a, b]: [Point; 2], axis: usize, low: f32, high: f32) -> Option<[Point; 2]> {
    let (a, b) = if a[axis] <= b[axis] { (a, b) } else { (b, a) };
    if b[axis] < low || high < a[axis] {
        return None;
    }
    let at = |plane: f32| towards(&a, &b, (plane - a[axis]) / (b[axis] - a[axis]));
    let start = if a[axis] < low { at(low) } else { a };
    let end = if high < b[axis] { at(high) } else { b };
    Some([start, end])
}
