//! Sixteen rays together, where they are much alike: rays of a camera, or shadow rays of neighbours.
//!
//! They go from box to box as one frustum, of which a node costs little more than of one ray. Where they start at different places,
//! there is much in a frustum that none of them meets: then those of a node's boxes that it meets are tested once more, each against
//! all sixteen. At a leaf, triangles that none of them can meet are left out eight at a time; each of the others is tested against all
//! sixteen, by the operations and with the bounds of [`BlockRay`](crate::triangles::BlockRay), so that an answer has the bits that it
//! has alone. Where that turns out to be more work than it is worth, they go alone after all.
//!
//! # Why the frustum loses no box
//!
//! On each axis the directions have one sign. A single ray meets a plane p at `p r + c`, with a margin in c; see `node`. Here it
//! is `(p - q) r + (q - o) r`, where q is a place among the starts o, which are all within an eighth of it. That is another order
//! of the same operations, with one more subtraction and one more sum: together wrong by less than 4u|r| (1.3 + |q|), where a
//! ray's margin is at least 8u|r| (1.01 + |o|). Twice that margin is added. The frustum takes the least of `(p - q) r` over all
//! rays, as it is computed, and from it the largest |r| times the sum of the largest |q - o| and thrice the largest margin by |r|:
//! with three roundings of something below |r|/2, for which those margins have room. So it is no later than any ray with its
//! margin, and likewise no earlier where it leaves.
//!
//! # Why none of its rays loses a triangle
//!
//! Let (X, Y, Z) be a corner as seen from the middle of the rays' starts, sheared by the middle of their shears. For a ray whose
//! start and shear are off by a and b, the corner is at X + (a_x - s_x a_z) - b_x Z, and within |a_z| of Z. So |x| is below
//! |X| + `apart` + `spread` |Z|, the largest of these over all rays; the roundings of both are below 32us with s as there, taken of
//! these larger bounds. A triangle all of whose corners are beyond that on one side is met by no ray; and with the larger m, h
//! and s the errors are no smaller than those of every ray.

mod instances;
mod shapes;

use lumbre_geometry::Ray;
use lumbre_math::DVec2;

pub(crate) use self::instances::{AmongInstances, Companion};
use self::shapes::AmongShapes;
use crate::batch::{self, Ends};
use crate::blocks::Blocks;
use crate::collapse::Entry;
use crate::holds::SingleStart;
use crate::lanes::{self, Axes, Corners, CornersRoom, Lanes, Level, Row, Sides, Task, Vector, WIDE, Wide};
use crate::node::{END_FACTOR, LITTLE, Node, START_FACTOR, tag};
#[cfg(test)]
use crate::single::Nearest;
use crate::single::{Candidate, Exact, Goal, Outcome, Winner, heights, largest_component};
use crate::stack::{Order, Stack};
use crate::triangles::{
    self, BEYOND, BLOCK, EDGE_ERROR, ERRORS_OF_EDGES, ERRORS_OF_EXTENT, FAR, HEIGHT_ERROR, Meeting, Pairs,
    ROUNDINGS, SIZE_ERROR, TINY, beyond,
};
use crate::{Accel, Faces};

/// Rays in a packet.
pub(crate) const PACKET: usize = WIDE;

/// How far from their middle rays may start on an axis, in tree units: an eighth, see above; where there are shapes, no farther than
/// pays.
const fn most_distance(is_mixed: bool) -> f32 {
    if is_mixed { 0.015625 } else { 0.125 }
}

/// How far from their middle directions may be, by the largest component.
const MOST_SPREAD: f32 = 0.125;
/// How many there have to be.
pub(crate) const LEAST: u32 = 4;

/// How much rays may do together, in nodes met; a block of triangles is as much as two, and so is a triangle.
#[derive(Clone, Copy)]
pub(crate) struct Effort {
    /// Before they go alone: where boxes and triangles are small beside the distances between the rays, that is faster.
    pub(crate) most: u32,
    /// And have it pay, if they are all of a packet; for fewer, as much less.
    pub(crate) paying: u32,
}

impl Effort {
    /// Less for any hit, which a ray alone has sooner, and where they start at different places, and soon meet others; more where there is
    /// anything but triangles, of which one alone has more to do.
    const fn new<L: Lanes>(is_any: bool, is_mixed: bool, has_one_origin: bool) -> Self {
        match (is_mixed, has_one_origin, is_any) {
            (false, true, true) => Self { most: 160, paying: 100 }.among_triangles::<L>(),
            (false, true, false) => Self { most: 300, paying: 120 }.among_triangles::<L>(),
            (false, false, _) => Self { most: 70, paying: 50 }.among_triangles::<L>(),
            (true, _, true) => Self { most: 600, paying: 400 },
            (true, _, false) => Self { most: 800, paying: 400 },
        }
    }

    /// The same by these lanes, where there is nothing but triangles.
    pub(crate) const fn among_triangles<L: Lanes>(self) -> Self {
        if L::GOES_ON_TOGETHER { self } else { Self { most: self.paying, paying: self.paying } }
    }

    /// Whether so much work paid for these rays.
    #[inline(always)]
    pub(crate) fn pays(self, work: u32, those: u32) -> bool {
        work * ALL.count_ones() <= self.paying * those.count_ones()
    }
}

/// Of children for whose boxes each ray is asked, so many are as much to do as a node.
const CHILDREN_AS_A_NODE: u32 = 4;

/// What the corners of triangles may be wrong by, by their size: 32u, see above.
pub(crate) const CULL_ERROR: f32 = 32.0 / (1 << 24) as f32;

/// What holds all the rays among boxes: see above.
pub(crate) struct Frustum {
    pub(crate) center: [f32; 3],
    pub(crate) least_inverse: [f32; 3],
    pub(crate) most_inverse: [f32; 3],
    /// What is taken from where they enter, and added to where they leave.
    pub(crate) width: [f32; 3],
    pub(crate) s_min: f32,
    pub(crate) s_max: f32,
    pub(crate) sides: &'static Sides,
}

/// The rays among boxes, each as [`Slabs`](crate::node::Slabs).
pub(crate) struct SlabRows {
    pub(crate) inverse: [Row<f32>; 3],
    pub(crate) near_offset: [Row<f32>; 3],
    pub(crate) far_offset: [Row<f32>; 3],
    pub(crate) s_min: Row<f32>,
    /// Where each need no longer meet boxes.
    pub(crate) s_max: Row<f32>,
}

impl SlabRows {
    pub(crate) const NONE: Self = {
        let row = Row::of(0.0);
        Self { inverse: [row; 3], near_offset: [row; 3], far_offset: [row; 3], s_min: row, s_max: row }
    };
}

/// By how much planes are moved, and by how much more for each unit of the ray's start.
pub(crate) struct Margins {
    pub(crate) least: f32,
    pub(crate) per_distance: f32,
}

impl Margins {
    /// What is added to planes that are met first, and last, on an axis where rays start there.
    #[inline(always)]
    pub(crate) fn offsets<W: Wide>(&self, from: W, inverse: W) -> [W; 2] {
        let distance = from.abs();
        let margin = inverse.abs() * distance.times_plus(W::splat(self.per_distance), W::splat(self.least));
        [from.times_from(inverse, W::splat(0.0) - margin), from.times_from(inverse, margin)]
    }
}

/// The children of a node whose boxes rays that are alive may meet, where they enter each at the earliest, and how much it was to find
/// that out, in nodes. With rows for `each` ray, only children that one of them meets, and, if `is_ordered`, where the first of them does.
#[inline(always)]
pub(crate) fn meet_children<W: Wide>(
    node: &Node,
    frustum: &Frustum,
    each: Option<&SlabRows>,
    alive: u32,
    is_ordered: bool,
) -> (u32, W, u32) {
    let (mask, enters) = lanes::meet_frustum::<W>(node, frustum);
    let Some(each) = each else { return (mask, enters, 1) };
    let work = 1 + mask.count_ones() / CHILDREN_AS_A_NODE;
    let (mask, enters) = lanes::meet_each::<W>(node, each, frustum.sides, (mask, enters), alive, is_ordered);
    (mask, enters, work)
}

#[inline(always)]
fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// The rays among triangles: each as a [`BlockRay`](crate::triangles::BlockRay), and what holds them all.
struct Bundle {
    axes: &'static Axes,
    origin: [Row<f32>; 3],
    rest: [Row<f32>; 3],
    shear: [Row<f32>; 2],
    first: Row<f32>,
    last: Row<f32>,
    surely_first: Row<f32>,
    surely_last: Row<f32>,
    place_per_height: Row<f32>,
    /// A zero, negative where the last components of the directions are positive.
    turn: f32,
    least_size: f32,
    middle: [f32; 3],
    middle_shear: [f32; 2],
    apart: [f32; 3],
    spread: [f32; 2],
}

/// The signs of directions, a bit for each negative component, and their axes.
struct Direction {
    signs: u32,
    axes: &'static Axes,
}

/// What a direction is to planes, as for a ray alone.
#[inline(always)]
fn inverse_of<W: Wide>(start: &SingleStart, direction: W) -> W {
    let size = W::splat(start.space_per_unit).over(direction.abs().max(W::splat(start.tiny)));
    size.turned_by(direction)
}

/// A mask of all the rays.
pub(crate) const ALL: u32 = (1 << PACKET) - 1;

/// What is known of the triangles of a block for all the rays: which may be met, and the errors to reckon with.
struct Bounds {
    mask: u32,
    error: Row<f32>,
    height_error: Row<f32>,
    extent: Row<f32>,
}

/// Rays under way together, and then others. `MIXED` where there is anything but triangles.
pub(crate) struct Packet<'a, const MIXED: bool> {
    exact: Exact<'a>,
    triangles: Blocks<'a>,
    /// The rays, number by number.
    columns: [Row<f64>; 8],
    frustum: Frustum,
    /// Whether they start where the first does.
    has_one_origin: bool,
    /// Once they have come to some triangles.
    bundle: Bundle,
    is_among_triangles: bool,
    /// Those that are asked for; the others go along with one of them.
    chosen: u32,
    /// Each among boxes by itself: where it ends, and the rest only unless they start at one place.
    slabs: SlabRows,
    /// The nearest so far, by heights; its triangle is one of eight times the place of the block, and the lane. Where it is none,
    /// what it is stands among the shapes.
    from: Row<f32>,
    to: Row<f32>,
    triangle: Row<f32>,
    shapes: AmongShapes,
    /// Those that go on, those for which any hit will do and that have one, and those that the plain search has to answer.
    alive: u32,
    met: u32,
    unsettled: u32,
    /// What it has done, in nodes met.
    work: u32,
}

/// No triangle, and no hit or one of something else.
const NONE: u32 = u32::MAX;
const CROSSED: u32 = u32::MAX - 1;

impl<'a, const MIXED: bool> Packet<'a, MIXED> {
    /// Without rays yet.
    #[inline(always)]
    pub(crate) fn new(accel: &'a Accel, single: &'a SingleStart) -> Self {
        let (none, row) = ([0.0; 3], Row::of(0.0));
        let frustum = Frustum {
            center: none,
            least_inverse: none,
            most_inverse: none,
            width: none,
            s_min: 0.0,
            s_max: 0.0,
            sides: Sides::new(0),
        };
        let bundle = Bundle {
            axes: Axes::by_bits(0, 0),
            origin: [row; 3],
            rest: [row; 3],
            shear: [row; 2],
            first: row,
            last: row,
            surely_first: row,
            surely_last: row,
            place_per_height: row,
            turn: 0.0,
            least_size: single.least_size,
            middle: none,
            middle_shear: [0.0; 2],
            apart: none,
            spread: [0.0; 2],
        };
        Self {
            exact: Exact::new(accel, single),
            triangles: accel.tree.blocks(),
            columns: [Row::of(0.0); 8],
            frustum,
            bundle,
            has_one_origin: false,
            is_among_triangles: false,
            chosen: 0,
            slabs: SlabRows::NONE,
            from: row,
            to: row,
            triangle: row,
            shapes: AmongShapes::new(),
            alive: 0,
            met: 0,
            unsettled: 0,
            work: 0,
        }
    }

    /// All there is, from the root on.
    #[inline(always)]
    pub(crate) fn whole(&self) -> Asked {
        Asked { those: ALL, root: self.exact.start.root, most_work: u32::MAX }
    }

    /// Searches along some of these rays together, from a node on. Those that go another way than others do so together, too.
    #[inline(always)]
    pub(crate) fn search<G: Goal, L: Lanes, O: Others<'a, G>>(
        &mut self,
        rays: &[Ray; PACKET],
        Asked { those, root, most_work }: Asked,
        others: &mut O,
        ends: &mut impl Ends<O::Found>,
    ) -> Together {
        let mut together = Together { answered: ALL & !those, pays: true, is_done: true };
        while together.answered != ALL {
            L::columns(rays, &mut self.columns);
            let (alike, way) = self.ways::<L>((!together.answered).trailing_zeros());
            self.chosen = alike & !together.answered;
            if !self.start::<L>(way) {
                together.pays = false;
                break;
            }
            let effort = Effort::new::<L>(G::IS_ANY, MIXED, self.has_one_origin);
            let is_done = self.run::<G, L, O>(root, most_work.min(effort.most), rays, others);
            if !is_done {
                // Any hit will do for those that have one.
                self.chosen &= if G::IS_ANY { !self.alive } else { 0 };
            }
            let mut answers = batch::ends(
                #[inline(always)]
                |place, outcome| others.put(place, outcome, ends),
            );
            G::answer_together::<L, MIXED>(self, rays, &mut answers);
            together.answered |= self.chosen;
            together.pays &= is_done && effort.pays(self.work, self.chosen);
            if !is_done {
                together.is_done = false;
                break;
            }
        }
        together.answered &= those;
        together
    }

    /// Which rays go the way of one: with its signs and its last axis.
    #[inline(always)]
    fn ways<L: Lanes>(&self, one: u32) -> (u32, Direction) {
        let zero = L::Wide::splat(0.0);
        let (mut length, mut negative) = ([zero; 3], [0; 3]);
        for axis in 0..3 {
            let direction = L::Wide::rounded(&self.columns[3 + axis]);
            length[axis] = direction.abs();
            negative[axis] = L::Wide::splat(1.0).turned_by(direction).below(zero);
        }
        // For each pair, where the first is longer and where the second is: rounding keeps their order, or makes them equal.
        let [x, y, z] = length;
        let mut longer = [y.below(x), z.below(y), z.below(x)];
        let shorter = [x.below(y), y.below(z), x.below(z)];
        if (longer[0] | shorter[0]) & (longer[1] | shorter[1]) & (longer[2] | shorter[2]) != ALL {
            longer = self.no_shorter();
        }
        // Which axis is the last: of the others, either may be larger.
        let x_is_last = longer[0] & longer[2];
        let y_is_last = longer[1] & !x_is_last;
        let (mut alike, mut signs) = (ALL, 0);
        for (axis, &negative) in negative.iter().enumerate() {
            let is_negative = negative >> one & 1;
            signs |= is_negative << axis;
            alike &= if is_negative != 0 { negative } else { !negative };
        }
        let bits = if x_is_last >> one & 1 != 0 {
            alike &= x_is_last;
            0b101
        } else if y_is_last >> one & 1 != 0 {
            alike &= y_is_last;
            0b010
        } else {
            alike &= !(x_is_last | y_is_last);
            0
        };
        (alike, Direction { signs, axes: Axes::by_bits(signs, bits) })
    }

    /// Where x is no shorter than y, y than z, and x than z, in double precision.
    #[cold]
    #[inline(never)]
    fn no_shorter(&self) -> [u32; 3] {
        let [_, _, _, Row(x), Row(y), Row(z), ..] = &self.columns;
        let mut no_shorter = [0; 3];
        for i in 0..PACKET {
            let [x, y, z] = [x[i].abs(), y[i].abs(), z[i].abs()];
            no_shorter[0] |= u32::from(x >= y) << i;
            no_shorter[1] |= u32::from(y >= z) << i;
            no_shorter[2] |= u32::from(x >= z) << i;
        }
        no_shorter
    }

    /// Makes those that are not chosen like one that is.
    #[inline(always)]
    fn fill_up(&mut self) {
        let one = self.chosen.trailing_zeros() as usize % PACKET;
        for Row(column) in &mut self.columns {
            let own = column[one];
            for (i, number) in column.iter_mut().enumerate() {
                *number = if self.chosen >> i & 1 != 0 { *number } else { own };
            }
        }
    }

    /// Sets out among boxes with those that are chosen; false where they are few, where one is not from nearby or not sound, or where
    /// they are too far apart.
    #[inline(always)]
    fn start<L: Lanes>(&mut self, Direction { signs, axes }: Direction) -> bool {
        if self.chosen.count_ones() < LEAST {
            return false;
        }
        if self.chosen != ALL {
            self.fill_up();
        }
        self.has_one_origin = L::Wide::are_same(&self.columns[0])
            && L::Wide::are_same(&self.columns[1])
            && L::Wide::are_same(&self.columns[2]);
        let Self { columns, frustum, slabs, exact: Exact { start, .. }, .. } = self;
        let splat = L::Wide::splat;
        let zero = splat(0.0);
        let (t_min, t_max) = (L::Wide::rounded(&columns[6]), L::Wide::rounded(&columns[7]));
        let mut fits = zero.at_most(t_min) & t_min.at_most(t_max);
        let (mut is_long, mut is_near) = (0, true);
        let (mut inverse, mut off) = ([zero; 3], [zero; 3]);
        let has_one_origin = self.has_one_origin;
        let margins = Margins { least: start.margin, per_distance: start.margin_per_distance };
        for axis in 0..3 {
            let direction = L::Wide::rounded(&columns[3 + axis]);
            fits &= direction.abs().at_most(splat(start.longest[axis]));
            is_long |= splat(start.shortest).at_most(direction.abs());
            inverse[axis] = inverse_of(start, direction);
            let (origin, scale) = (start.tree_origin[axis], start.scale);
            if has_one_origin {
                frustum.center[axis] = ((columns[axis].0[0] - origin) * scale) as f32;
                is_near &= frustum.center[axis].abs() <= start.farthest[axis];
            } else {
                let from = L::Wide::rounded_from(&columns[axis], origin, scale);
                let center = from.middle();
                fits &= from.abs().at_most(splat(start.farthest[axis]));
                let [near, far] = margins.offsets(from, inverse[axis]);
                inverse[axis].store(&mut slabs.inverse[axis]);
                near.store(&mut slabs.near_offset[axis]);
                far.store(&mut slabs.far_offset[axis]);
                off[axis] = (from - center).abs();
                frustum.center[axis] = center.first();
            }
        }
        if fits != ALL || is_long != ALL || !is_near {
            return false;
        }
        let s_max = t_max.times_plus(splat(END_FACTOR), splat(LITTLE as f32));
        L::Wide::select(self.chosen, s_max, splat(-1.0)).store(&mut slabs.s_max);
        (t_min * splat(START_FACTOR)).store(&mut slabs.s_min);

        let [x, y, z] = inverse;
        let [minus_x, minus_y, minus_z] = [zero - x, zero - y, zero - z];
        let minus_s_min = t_min * splat(-START_FACTOR);
        #[rustfmt::skip]
        let Row(most) = L::Wide::most_of_each([
            x, y, z, s_max,
            minus_x, minus_y, minus_z, minus_s_min,
            off[0], off[1], off[2], zero,
            zero, zero, zero, zero,
        ]);
        for axis in 0..3 {
            let (most_inverse, minus_least, off) = (most[axis], most[4 + axis], most[8 + axis]);
            let distance = frustum.center[axis].abs() + off;
            let margin = distance * start.margin_per_distance + start.margin;
            frustum.most_inverse[axis] = most_inverse;
            frustum.least_inverse[axis] = -minus_least;
            frustum.width[axis] = greater(most_inverse, minus_least) * (off + 3.0 * margin);
            is_near &= off <= most_distance(MIXED);
        }
        (frustum.s_max, frustum.s_min, frustum.sides) = (most[3], -most[7], Sides::new(signs));
        (self.bundle.axes, self.is_among_triangles) = (axes, false);
        self.shapes.is_started = false;
        is_near
    }

    /// Sets out among triangles; false where directions are too far apart.
    #[inline(always)]
    fn start_triangles<L: Lanes>(&mut self) -> bool {
        let Self { columns, bundle, exact: Exact { start, .. }, .. } = self;
        let splat = L::Wide::splat;
        let zero = splat(0.0);
        let order = bundle.axes.order();
        let last = L::Wide::rounded(&columns[3 + order[2]]);
        let inverse = inverse_of(start, last) * splat(start.units_per_space);
        inverse.abs().store(&mut bundle.place_per_height);
        bundle.turn = if columns[3 + order[2]].0[0].is_sign_negative() { 0.0 } else { -0.0 };
        let (mut rest, mut off) = ([zero; 3], [zero; 3]);
        for (place, &axis) in order.iter().enumerate() {
            let mesh_origin = start.mesh_origin[axis];
            if self.has_one_origin {
                let exact = columns[axis].0[0] - mesh_origin;
                let origin = exact as f32;
                let more = (exact - f64::from(origin)) as f32;
                rest[place] = splat(more);
                splat(origin).store(&mut bundle.origin[place]);
                (bundle.middle[place], bundle.apart[place]) = (origin, more.abs());
            } else {
                let (origin, more) = L::Wide::parted_from(&columns[axis], mesh_origin);
                let middle = origin.middle();
                (rest[place], off[place]) = (more, origin - middle);
                origin.store(&mut bundle.origin[place]);
                bundle.middle[place] = middle.first();
            }
        }
        rest[2].store(&mut bundle.rest[2]);
        let mut are_alike = true;
        for place in 0..2 {
            let shear = L::Wide::rounded(&columns[3 + order[place]]) * inverse;
            let sheared = rest[2].times_from(shear, rest[place]);
            let middle = shear.middle();
            shear.store(&mut bundle.shear[place]);
            sheared.store(&mut bundle.rest[place]);
            bundle.middle_shear[place] = middle.first();
            bundle.spread[place] = (shear - middle).abs().most();
            are_alike &= bundle.spread[place] <= MOST_SPREAD;
            if self.has_one_origin {
                // Of the rest alone, with a shear of no more than one and few roundings.
                bundle.apart[place] = 1.5 * (bundle.apart[place] + bundle.apart[2]);
            } else {
                bundle.apart[place] = off[2].times_from(shear, off[place] + sheared).abs().most();
            }
        }
        bundle.apart[2] = if self.has_one_origin { 0.0 } else { off[2].abs().most() };
        let (t_min, t_max) = (L::Wide::rounded(&columns[6]), L::Wide::rounded(&columns[7]));
        let (far, roundings) = (splat(FAR), splat(ROUNDINGS));
        let heights = [(t_min * last.abs()).min(far), (t_max * last.abs()).min(far)];
        let errors = [heights[0] * roundings, heights[1] * roundings];
        (heights[0] - errors[0]).store(&mut bundle.first);
        (heights[0] + errors[0]).store(&mut bundle.surely_first);
        (heights[1] - errors[1]).store(&mut bundle.surely_last);
        (heights[1] + errors[1]).store(&mut bundle.last);
        let infinity = splat(f32::INFINITY);
        infinity.store(&mut self.from);
        infinity.store(&mut self.to);
        splat(f32::from_bits(NONE)).store(&mut self.triangle);
        self.is_among_triangles = true;
        are_alike
    }

    /// Which triangles of a block are left.
    #[inline(always)]
    fn bounds<W: Wide>(&self, corners: &Corners, taken: u32) -> Bounds {
        let bundle = lanes::opaque(&self.bundle);
        let [kx, ky, kz] = bundle.axes.order();
        let [ox, oy, oz] = bundle.middle;
        let (ox, oy, oz) = (W::splat(ox), W::splat(oy), W::splat(oz));
        let (sx, sy) = (W::splat(bundle.middle_shear[0]), W::splat(bundle.middle_shear[1]));
        let (az, bz, cz) = (
            oz - W::load_twice(&corners[kz][0]),
            oz - W::load_twice(&corners[kz][1]),
            oz - W::load_twice(&corners[kz][2]),
        );
        let (ax, bx, cx) = (
            sx.times_from(az, ox - W::load_twice(&corners[kx][0])),
            sx.times_from(bz, ox - W::load_twice(&corners[kx][1])),
            sx.times_from(cz, ox - W::load_twice(&corners[kx][2])),
        );
        let (ay, by, cy) = (
            sy.times_from(az, oy - W::load_twice(&corners[ky][0])),
            sy.times_from(bz, oy - W::load_twice(&corners[ky][1])),
            sy.times_from(cz, oy - W::load_twice(&corners[ky][2])),
        );
        let (low_x, high_x) = (ax.min(bx).min(cx), ax.max(bx).max(cx));
        let (low_y, high_y) = (ay.min(by).min(cy), ay.max(by).max(cy));
        let (low_z, high_z) = (az.min(bz).min(cz), az.max(bz).max(cz));
        let zero = W::splat(0.0);
        let along = (zero - low_z).max(high_z);
        let wide_x = along.times_plus(W::splat(bundle.spread[0]), W::splat(bundle.apart[0]));
        let wide_y = along.times_plus(W::splat(bundle.spread[1]), W::splat(bundle.apart[1]));
        let (across_x, across_y) = ((zero - low_x).max(high_x), (zero - low_y).max(high_y));
        let across = (across_x + wide_x).max(across_y + wide_y);
        let size = across + along + W::splat(bundle.apart[2] + bundle.least_size);
        let slack = size * W::splat(CULL_ERROR);
        let (wide_x, wide_y) = (wide_x + slack, wide_y + slack);
        // The edge functions seen from the middle, and by how much those of the rays may differ.
        let u = cx.times_minus(by, cy * bx);
        let v = ax.times_minus(cy, ay * cx);
        let w = bx.times_minus(ay, by * ax);
        let off = across_y.times_plus(wide_x, wide_y.times_plus(wide_x, across_x * wide_y));
        let off = off * W::splat(2.0 + 8.0 * CULL_ERROR) + W::splat(TINY);
        let mask = low_x.at_most(wide_x)
            & (zero - wide_x).at_most(high_x)
            & low_y.at_most(wide_y)
            & (zero - wide_y).at_most(high_y)
            & ((zero - off).at_most(u.min(v).min(w)) | u.max(v).max(w).at_most(off))
            & taken;
        let mut bounds =
            Bounds { mask, error: Row::of(0.0), height_error: Row::of(0.0), extent: Row::of(0.0) };
        if mask != 0 {
            let across = across + slack;
            let size = size + slack + slack;
            let error = (size * W::splat(EDGE_ERROR))
                .times_plus(size.times_plus(W::splat(SIZE_ERROR), across), W::splat(TINY));
            error.store(&mut bounds.error);
            let height_error = size * W::splat(HEIGHT_ERROR);
            height_error.store(&mut bounds.height_error);
            (high_z - low_z + height_error).store(&mut bounds.extent);
        }
        bounds
    }

    /// Tests all the rays against a triangle.
    #[inline(always)]
    fn meet_triangle<G: Goal, L: Lanes>(
        &mut self,
        corners: &Corners,
        number: u32,
        lane: usize,
        bounds: &Bounds,
        rays: &[Ray; PACKET],
    ) {
        let bundle = lanes::opaque(&self.bundle);
        let [kx, ky, kz] = bundle.axes.order();
        let (ox, oy, oz) = (
            L::Wide::load(&bundle.origin[0].0),
            L::Wide::load(&bundle.origin[1].0),
            L::Wide::load(&bundle.origin[2].0),
        );
        let (rx, ry) = (L::Wide::load(&bundle.rest[0].0), L::Wide::load(&bundle.rest[1].0));
        let (sx, sy) = (L::Wide::load(&bundle.shear[0].0), L::Wide::load(&bundle.shear[1].0));
        let lane = lane % BLOCK;
        let at = |corner: usize, axis: usize| corners[axis][corner][lane];
        // As `Lanes::meet_triangles`, with the signs turned.
        let az = oz - L::Wide::splat(at(0, kz));
        let bz = oz - L::Wide::splat(at(1, kz));
        let cz = oz - L::Wide::splat(at(2, kz));
        let ax = sx.times_from(az, ox - L::Wide::splat(at(0, kx)) + rx);
        let bx = sx.times_from(bz, ox - L::Wide::splat(at(1, kx)) + rx);
        let cx = sx.times_from(cz, ox - L::Wide::splat(at(2, kx)) + rx);
        let ay = sy.times_from(az, oy - L::Wide::splat(at(0, ky)) + ry);
        let by = sy.times_from(bz, oy - L::Wide::splat(at(1, ky)) + ry);
        let cy = sy.times_from(cz, oy - L::Wide::splat(at(2, ky)) + ry);
        let u = cx.times_minus(by, cy * bx);
        let v = ax.times_minus(cy, ay * cx);
        let w = bx.times_minus(ay, by * ax);
        let error = bounds.error.0[lane];
        let (low, high) = (u.min(v).min(w), u.max(v).max(w));
        let mask = (L::Wide::splat(-error).at_most(low) | high.at_most(L::Wide::splat(error))) & self.alive;
        if mask == 0 {
            return;
        }
        let det = u + v + w;
        let weight = det.abs();
        let height =
            det.times_plus(L::Wide::load(&bundle.rest[2].0), w.times_plus(cz, v.times_plus(bz, u * az)));
        let ahead = height.turned_by(det).turned_by(L::Wide::splat(bundle.turn));
        let height_error = bounds.height_error.0[lane];
        let least_spread =
            error * (ERRORS_OF_EXTENT * bounds.extent.0[lane] + ERRORS_OF_EDGES * height_error) + TINY;
        let spread = weight.times_plus(L::Wide::splat(height_error), L::Wide::splat(least_spread));
        let (from, to) = (ahead - spread, ahead + spread);
        // What is no number may be in range.
        let is_out = to.below(weight * L::Wide::load(&bundle.first.0))
            | (weight * L::Wide::load(&bundle.last.0)).below(from);
        let in_range = mask & !is_out;
        if in_range == 0 {
            return;
        }
        let inside = L::Wide::splat(error).below(low) | high.below(L::Wide::splat(-error));
        let sure = in_range
            & inside
            & (weight * L::Wide::load(&bundle.surely_first.0)).at_most(from)
            & to.at_most(weight * L::Wide::load(&bundle.surely_last.0));
        if G::IS_ANY {
            self.met |= sure;
            self.alive &= !sure;
            let unsure = in_range & !sure;
            if unsure != 0 {
                self.settle_any(unsure, number, lane as u32, rays);
            }
            return;
        }
        let inverse = L::Wide::splat(1.0).over(weight);
        let (from, to) = (from * inverse, to * inverse);
        let (best_from, best_to) = (L::Wide::load(&self.from.0), L::Wide::load(&self.to.0));
        let better = sure & to.below(best_from);
        if better != 0 {
            let triangle = L::Wide::splat(f32::from_bits(number << 3 | lane as u32));
            L::Wide::select(better, from, best_from).store(&mut self.from);
            let to = L::Wide::select(better, to, best_to);
            to.store(&mut self.to);
            L::Wide::select(better, triangle, L::Wide::load(&self.triangle.0)).store(&mut self.triangle);
            L::Wide::select(better, to, L::Wide::load(&self.bundle.last.0)).store(&mut self.bundle.last);
            let place = to * L::Wide::load(&self.bundle.place_per_height.0);
            let end = place.times_plus(L::Wide::splat(BEYOND), L::Wide::splat(f32::MIN_POSITIVE));
            let s_max = L::Wide::select(better, end, L::Wide::load(&self.slabs.s_max.0));
            s_max.store(&mut self.slabs.s_max);
            self.frustum.s_max = s_max.most();
        }
        let doubtful = in_range & !better & !best_to.below(from);
        if doubtful != 0 {
            self.settle_closest(L::level(), doubtful, number, lane as u32, rays);
        }
    }

    /// Looks closer at a triangle that these rays may meet.
    #[cold]
    #[inline(never)]
    fn settle_any(&mut self, mut those: u32, number: u32, lane: u32, rays: &[Ray; PACKET]) {
        while those != 0 {
            let i = those.trailing_zeros() as usize % PACKET;
            those &= those - 1;
            let ray = &rays[i];
            match self.exact.meet(ray, number, lane) {
                Meeting::Miss => continue,
                Meeting::Hit { .. } => self.met |= 1 << i,
                Meeting::Touch { .. } => self.unsettled |= 1 << i,
            }
            self.alive &= !(1 << i);
        }
    }

    /// The same, where a hit may be nearer than the best.
    #[cold]
    #[inline(never)]
    fn settle_closest(&mut self, level: Level, those: u32, number: u32, lane: u32, rays: &[Ray; PACKET]) {
        level.run(Settle { packet: self, those, number, lane, rays });
        self.end_frustum();
    }

    /// One ray at a triangle that may be nearer than its best.
    #[inline(always)]
    fn settle<L: Lanes>(&mut self, i: usize, number: u32, lane: u32, ray: &Ray) {
        let (axes, best) = (self.bundle.axes, self.best(i));
        match self.exact.contest::<L>(ray, axes, (number, lane), (&best, self.crossed(i)), Faces::Both) {
            Outcome::Settled(None) => {}
            Outcome::Settled(Some(t)) => {
                self.keep(i, heights(t, largest_component(ray)), number << 3 | lane);
            }
            Outcome::Unsettled => self.give_up(i),
        }
    }

    /// Makes this the nearest hit of one.
    #[inline(always)]
    fn keep(&mut self, i: usize, (from, to): (f32, f32), triangle: u32) {
        (self.from.0[i], self.to.0[i]) = (from, to);
        self.triangle.0[i] = f32::from_bits(triangle);
        self.bundle.last.0[i] = to;
        self.slabs.s_max.0[i] = beyond(to * self.bundle.place_per_height.0[i]);
    }

    /// Leaves one to the plain search.
    #[inline(always)]
    fn give_up(&mut self, i: usize) {
        self.unsettled |= 1 << i;
        self.alive &= !(1 << i);
        self.slabs.s_max.0[i] = -1.0;
    }

    /// Lets the frustum end where none of the rays goes on.
    #[inline(always)]
    fn end_frustum(&mut self) {
        self.frustum.s_max = self.slabs.s_max.0.iter().fold(-1.0, |most, &s_max| greater(most, s_max));
    }

    /// Whether a crossing, of what has these names, is nearer than the nearest of one so far, or as near and before it.
    fn is_better(&self, ray: &Ray, i: usize, t: f64, names: (u32, u32)) -> Outcome<bool> {
        self.exact.is_better(ray, t, names, &self.best(i), self.crossed(i))
    }

    /// The nearest hit of one so far, where that is of no triangle.
    #[inline(always)]
    fn crossed(&self, i: usize) -> Option<Winner> {
        if MIXED && self.triangle.0[i].to_bits() == CROSSED { self.shapes.crossed[i] } else { None }
    }

    /// The nearest hit of one so far.
    #[inline(always)]
    fn best(&self, i: usize) -> Candidate {
        let triangle = self.triangle.0[i].to_bits();
        if triangle == NONE {
            return Candidate::NONE;
        }
        Candidate { block: triangle >> 3, lane: triangle & 7, from: self.from.0[i], to: self.to.0[i] }
    }

    /// The nearest hits.
    #[inline(always)]
    pub(crate) fn put_nearest<L: Lanes>(&self, rays: &[Ray; PACKET], ends: &mut impl Ends<Option<Winner>>) {
        let axes = self.bundle.axes;
        let triangle = L::Wide::load(&self.triangle.0);
        let mut hits = 0;
        if self.is_among_triangles {
            hits = !triangle.with_bits(NONE) & !self.unsettled & self.chosen;
        }
        let mut crossed = if MIXED { triangle.with_bits(CROSSED) & hits } else { 0 };
        let mut others = !hits & self.chosen;
        while others != 0 {
            let i = others.trailing_zeros() as usize % PACKET;
            others &= others - 1;
            let is_settled = self.unsettled >> i & 1 == 0;
            ends.put(i, if is_settled { Outcome::Settled(None) } else { Outcome::Unsettled });
        }
        hits &= !crossed;
        while crossed != 0 {
            let i = crossed.trailing_zeros() as usize % PACKET;
            crossed &= crossed - 1;
            ends.put(i, Outcome::Settled(self.shapes.crossed[i]));
        }
        if hits == 0 {
            return;
        }
        // Many may have met the same.
        let mut corners = [[Row::of(0.0); 3]; 3];
        let mut rest = hits;
        while rest != 0 {
            let one = self.triangle.0[rest.trailing_zeros() as usize % PACKET].to_bits();
            let with_this = triangle.with_bits(one);
            rest &= !with_this;
            let these = axes.gather(self.triangles.block(one >> 3), (one & 7) as usize);
            for (rows, corner) in corners.iter_mut().zip(these) {
                for (row, coordinate) in rows.iter_mut().zip(corner) {
                    L::Wide::select(with_this, L::Wide::splat(coordinate), L::Wide::load(&row.0)).store(row);
                }
            }
        }
        let [x, y, z] = axes.order();
        let columns = &self.columns;
        let mesh_origin = &self.exact.start.mesh_origin;
        let pairs = Pairs {
            origin: [&columns[x], &columns[y], &columns[z]],
            mesh_origin: [mesh_origin[x], mesh_origin[y], mesh_origin[z]],
            direction: [&columns[3 + x], &columns[3 + y], &columns[3 + z]],
            corners: &corners,
        };
        let met = pairs.meet();
        let mut rest = hits;
        while rest != 0 {
            let i = rest.trailing_zeros() as usize % PACKET;
            rest &= rest - 1;
            let best = self.best(i);
            let t = met.t.0[i];
            // An answer that goes through memory is waited for: hence each by itself.
            if t.is_nan() {
                // Unclear: by itself, and closer.
                let winner = self.exact.winner::<L>(&rays[i], axes, &best);
                ends.put(i, winner.map_or(Outcome::Unsettled, |winner| Outcome::Settled(Some(winner))));
            } else {
                let (geometry, primitive) = self.exact.names(best.block, best.lane);
                let local = DVec2::new(met.local[0].0[i], met.local[1].0[i]);
                let root = triangles::root(t, local);
                ends.put(i, Outcome::Settled(Some(Winner { root, geometry, primitive })));
            }
        }
    }

    /// Whether each met anything.
    #[inline(always)]
    pub(crate) fn put_met(&self, ends: &mut impl Ends<bool>) {
        if self.chosen & !self.unsettled == ALL {
            for i in 0..PACKET {
                ends.put(i, Outcome::Settled(self.met >> i & 1 != 0));
            }
            return;
        }
        let mut rest = self.chosen;
        while rest != 0 {
            let i = rest.trailing_zeros() as usize % PACKET;
            rest &= rest - 1;
            let is_settled = self.unsettled >> i & 1 == 0;
            let is_met = self.met >> i & 1 != 0;
            ends.put(i, if is_settled { Outcome::Settled(is_met) } else { Outcome::Unsettled });
        }
    }

    /// Tests a leaf of triangles.
    #[inline(always)]
    fn meet_triangles<G: Goal, L: Lanes>(&mut self, leaf: u32, rays: &[Ray; PACKET]) {
        let mut following = Some(leaf & tag::PLACE);
        let mut room = CornersRoom::new();
        while let Some(place) = following {
            let block = self.triangles.block(place);
            following = block.next(place);
            let corners = L::corners(block, &mut room);
            let bounds = self.bounds::<L::Wide>(corners, block.taken());
            let mut rest = bounds.mask;
            self.work += 2 + 2 * rest.count_ones();
            while rest != 0 {
                let lane = rest.trailing_zeros() as usize;
                rest &= rest - 1;
                self.meet_triangle::<G, L>(corners, place, lane, &bounds, rays);
            }
        }
    }

    /// Goes through the tree; false where it gave up.
    #[inline(always)]
    fn run<G: Goal, L: Lanes, O: Others<'a, G>>(
        &mut self,
        root: u32,
        most_work: u32,
        rays: &[Ray; PACKET],
        others: &mut O,
    ) -> bool {
        (self.alive, self.met, self.unsettled, self.work) = (self.chosen, 0, 0, 0);
        let nodes: &[Node] = self.exact.nodes();
        let mut stack: Stack<<G::Order as Order>::Entry> = Stack::new();
        let mut reference = root;
        if MIXED {
            if !self.meet_infinite::<G, L, O>(most_work, rays, others) {
                return false;
            }
            if self.alive == 0 {
                return true;
            }
        }
        loop {
            while reference >> tag::SHIFT == tag::INNER {
                let node = &nodes[reference as usize];
                let each = if self.has_one_origin { None } else { Some(lanes::opaque(&self.slabs)) };
                let frustum = lanes::opaque(&self.frustum);
                let (mask, keys, work) =
                    meet_children::<L::Wide>(node, frustum, each, self.alive, !G::IS_ANY);
                self.work += work;
                if mask & mask.wrapping_sub(1) != 0 {
                    reference = stack.put(
                        #[inline(always)]
                        |room| G::Order::push_children::<L>(node, mask, keys, room),
                    );
                } else if mask != 0 {
                    reference = lanes::only_child(node, mask);
                } else {
                    match self.pop::<G>(&mut stack) {
                        Some(next) => reference = next,
                        None => return true,
                    }
                }
            }
            if !self.is_among_triangles && !self.start_triangles::<L>() {
                return false;
            }
            if !MIXED || reference >> tag::SHIFT == tag::TRIANGLES {
                self.meet_triangles::<G, L>(reference, rays);
            } else if reference >> tag::SHIFT == tag::INSTANCE {
                let entry = &self.exact.accel().tree.entries[(reference & tag::PLACE) as usize];
                let left = most_work.saturating_sub(self.work);
                if !others.meet_instance::<L, MIXED>(self, entry, left, rays) {
                    return false;
                }
            } else if !self.meet_shapes::<G, L>(reference, rays) {
                return false;
            }
            if self.alive == 0 {
                return true;
            }
            if self.work > most_work {
                return false;
            }
            match self.pop::<G>(&mut stack) {
                Some(next) => reference = next,
                None => return true,
            }
        }
    }

    #[inline(always)]
    fn pop<G: Goal>(&self, stack: &mut Stack<<G::Order as Order>::Entry>) -> Option<u32> {
        loop {
            let entry = stack.pop()?;
            if !G::Order::is_beyond(entry, self.frustum.s_max) {
                return Some(G::Order::reference(entry));
            }
        }
    }
}

/// What takes part in a search by packets in a tree: instances.
pub(crate) trait Others<'a, G: Goal> {
    /// What is handed out.
    type Found;

    /// Has those that go on meet an instance, or a part of one; false where that is more work than they may do.
    fn meet_instance<L: Lanes, const MIXED: bool>(
        &mut self,
        packet: &mut Packet<'a, MIXED>,
        entry: &Entry,
        most_work: u32,
        rays: &[Ray; PACKET],
    ) -> bool;

    /// Hands out what came of a ray.
    fn put(&mut self, place: usize, outcome: Outcome<G::Answer>, ends: &mut impl Ends<Self::Found>);
}

/// Nothing: triangles and shapes are all there is.
pub(crate) struct NoOthers;

impl<'a, G: Goal> Others<'a, G> for NoOthers {
    type Found = G::Answer;

    #[inline(always)]
    fn meet_instance<L: Lanes, const MIXED: bool>(
        &mut self,
        _: &mut Packet<'a, MIXED>,
        _: &Entry,
        _: u32,
        _: &[Ray; PACKET],
    ) -> bool {
        unreachable!("there are no instances");
    }

    #[inline(always)]
    fn put(&mut self, place: usize, outcome: Outcome<G::Answer>, ends: &mut impl Ends<G::Answer>) {
        ends.put(place, outcome);
    }
}

/// Rays that may meet a triangle, and nearer than anything so far: see [`Packet::settle_closest`].
struct Settle<'p, 'a, const MIXED: bool> {
    packet: &'p mut Packet<'a, MIXED>,
    those: u32,
    number: u32,
    lane: u32,
    rays: &'p [Ray; PACKET],
}

impl<const MIXED: bool> Task for Settle<'_, '_, MIXED> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self { packet, mut those, number, lane, rays } = self;
        while those != 0 {
            let i = those.trailing_zeros() as usize % PACKET;
            those &= those - 1;
            packet.settle::<L>(i, number, lane, &rays[i]);
        }
    }
}

/// How rays went together.
pub(crate) struct Together {
    /// A bit for each that was answered.
    pub(crate) answered: u32,
    /// Whether that is faster than each alone.
    pub(crate) pays: bool,
    /// Whether none was given up under way.
    pub(crate) is_done: bool,
}

/// What is asked of a packet.
#[derive(Clone, Copy)]
pub(crate) struct Asked {
    /// A bit for each ray that is asked for.
    pub(crate) those: u32,
    /// The node that they start at.
    pub(crate) root: u32,
    /// What is left that they may do before they go alone, where that is less than their [`Effort`].
    pub(crate) most_work: u32,
}

/// Those of some rays that a packet answers, at a level, for tests.
#[cfg(test)]
pub(crate) fn answered_together(level: Level, accel: &Accel, rays: &[Ray; PACKET]) -> u32 {
    use crate::holds::Contents;

    struct Searching<'a, const MIXED: bool>(Packet<'a, MIXED>, &'a [Ray; PACKET]);
    impl<const MIXED: bool> Task for Searching<'_, MIXED> {
        type Output = u32;
        #[inline(always)]
        fn run<L: Lanes>(mut self) -> u32 {
            let whole = self.0.whole();
            self.0.search::<Nearest, L, _>(self.1, whole, &mut NoOthers, &mut |_, _| {}).answered
        }
    }
    let single = accel.single.as_ref().expect("what single precision searches");
    match single.contents {
        Contents::Triangles => level.run(Searching(Packet::<false>::new(accel, single), rays)),
        Contents::Shapes => level.run(Searching(Packet::<true>::new(accel, single), rays)),
        Contents::Spheres => unreachable!("they do not go together"),
        Contents::Anything => level.run(instances::Searching(accel, single, rays)),
    }
}
