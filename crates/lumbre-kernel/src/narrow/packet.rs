//! Sixteen rays together, where they are much alike: as [`packet`](crate::packet) has them in double precision, by the operations of
//! [`NarrowRay`], so that an answer has the bits that it has alone.
//!
//! What is said there of boxes and triangles holds here. A ray's margin among boxes is that of its triangles and of the arithmetic; of
//! the latter, which a frustum does in another order, twice as much is added. Triangles that none of the rays can meet are left out by
//! the same bounds, which allow 32u of their size for the roundings of a ray's sheared corners and of the middle's, where these are off by
//! 8.1u and a little more.

use super::{Goal, NarrowRay, Precise, TINY, within};
use crate::batch::Ends;
use crate::blocks::{Blocks, TriangleBlock};
use crate::holds::SingleStart;
use crate::lanes::{self, Axes, Corners, CornersRoom, Eight, Lanes, Row, Sides, Vector, WIDE, Wide};
use crate::node::{END_FACTOR, LITTLE, Node, START_FACTOR, Units, tag};
use crate::packet::{
    ALL, CULL_ERROR, Effort, Frustum, LEAST, Margins, PACKET, SlabRows, Together, meet_children,
};
use crate::single::{Exact, Outcome};
use crate::stack::{Order, Stack};
use crate::triangles::{BEYOND, BLOCK, beyond};
use crate::{Accel, Hit32, Ray32};

/// How far from their middle rays may start on an axis, in tree units.
const MOST_DISTANCE: f32 = 0.125;
/// How far from their middle directions may be, by the largest component.
const MOST_SPREAD: f32 = 0.3;
/// No triangle.
const NONE: u32 = u32::MAX;

/// The rays among triangles, and what holds them all.
struct Bundle {
    axes: &'static Axes,
    origin: [Row<f32>; 3],
    shear: [Row<f32>; 2],
    minus_inverse: Row<f32>,
    t_min: Row<f32>,
    /// Ends at the nearest.
    t_max: Row<f32>,
    precise: Precise,
    least_size: f32,
    middle: [f32; 3],
    middle_shear: [f32; 2],
    apart: [f32; 3],
    spread: [f32; 2],
}

/// Rays under way together, and then others.
pub(crate) struct Packet<'a> {
    exact: Exact<'a>,
    triangles: Blocks<'a>,
    /// The rays, number by number: origin, start, direction, end.
    rows: [Row<f32>; 8],
    frustum: Frustum,
    /// Whether they start where the first does.
    has_one_origin: bool,
    bundle: Bundle,
    is_among_triangles: bool,
    /// Those that are asked for; the others go along with one of them.
    chosen: u32,
    /// Each among boxes by itself; of where they start, only unless that is one place.
    slabs: SlabRows,
    /// The nearest: eight times the place of the block, and the lane.
    triangle: Row<f32>,
    /// Its weights: of the second and the third corner, and of all.
    weights: [Row<f32>; 3],
    alive: u32,
    met: u32,
    work: u32,
}

/// Less than in double precision, since rays in flight are faster.
const fn effort<L: Lanes>(is_any: bool, has_one_origin: bool) -> Effort {
    let effort = match (has_one_origin, is_any) {
        (true, true) => Effort { most: 112, paying: 70 },
        (true, false) => Effort { most: 210, paying: 84 },
        (false, _) => Effort { most: 50, paying: 40 },
    };
    effort.among_triangles::<L>()
}

impl<'a> Packet<'a> {
    #[inline(always)]
    pub(super) fn new(accel: &'a Accel, start: &'a SingleStart) -> Self {
        let (none, row) = ([0.0; 3], Row::of(0.0));
        Self {
            exact: Exact::new(accel, start),
            triangles: accel.tree.blocks(),
            rows: [row; 8],
            frustum: Frustum {
                center: none,
                least_inverse: none,
                most_inverse: none,
                width: none,
                s_min: 0.0,
                s_max: 0.0,
                sides: Sides::new(0),
            },
            has_one_origin: false,
            bundle: Bundle {
                axes: Axes::by_bits(0, 0),
                origin: [row; 3],
                shear: [row; 2],
                minus_inverse: row,
                t_min: row,
                t_max: row,
                precise: start.precise,
                least_size: start.least_size,
                middle: none,
                middle_shear: [0.0; 2],
                apart: none,
                spread: [0.0; 2],
            },
            is_among_triangles: false,
            chosen: 0,
            slabs: SlabRows::NONE,
            triangle: row,
            weights: [row; 3],
            alive: 0,
            met: 0,
            work: 0,
        }
    }

    /// Searches along rays together, the first of which has this position. Those that go another way than others do so together, too.
    #[inline(always)]
    pub(super) fn search<G: Goal, L: Lanes>(
        &mut self,
        rays: &[Ray32; PACKET],
        first: usize,
        ends: &mut impl Ends<G::Answer>,
    ) -> Together {
        let mut together = Together { answered: 0, pays: true, is_done: true };
        while together.answered != ALL {
            L::narrow_rows(rays, &mut self.rows);
            let (alike, signs, axes) = self.ways::<L>((!together.answered).trailing_zeros());
            self.chosen = alike & !together.answered;
            if !self.start::<L>(signs, axes) {
                // A few are left, or all.
                together.pays &= together.answered.count_ones() >= ALL.count_ones() / 2;
                break;
            }
            let is_done = self.run::<G, L>();
            if !is_done {
                // Any hit will do for those that have one.
                self.chosen &= if G::IS_ANY { !self.alive } else { 0 };
            }
            G::answer_together::<L>(self, first, ends);
            together.answered |= self.chosen;
            together.pays &=
                is_done && effort::<L>(G::IS_ANY, self.has_one_origin).pays(self.work, self.chosen);
            if !is_done {
                together.is_done = false;
                break;
            }
        }
        together
    }

    /// Which rays go the way of one: with its signs and its last axis.
    #[inline(always)]
    fn ways<L: Lanes>(&self, one: u32) -> (u32, u32, &'static Axes) {
        let zero = L::Wide::splat(0.0);
        let plus = L::Wide::splat(1.0);
        let (x, y, z) =
            (L::Wide::load(&self.rows[4].0), L::Wide::load(&self.rows[5].0), L::Wide::load(&self.rows[6].0));
        let negative =
            [plus.turned_by(x).below(zero), plus.turned_by(y).below(zero), plus.turned_by(z).below(zero)];
        let (x, y, z) = (x.abs(), y.abs(), z.abs());
        // Where x is no shorter than y, y than z, and x than z.
        let x_is_last = y.at_most(x) & z.at_most(x);
        let y_is_last = z.at_most(y) & !x_is_last;
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
        (alike, signs, Axes::by_bits(signs, bits))
    }

    /// Makes those that are not chosen like one that is.
    #[inline(always)]
    fn fill_up<L: Lanes>(&mut self) {
        let one = self.chosen.trailing_zeros() as usize % PACKET;
        for row in &mut self.rows {
            let (own, all) = (L::Wide::splat(row.0[one]), L::Wide::load(&row.0));
            L::Wide::select(self.chosen, all, own).store(row);
        }
    }

    /// Sets out among boxes with those that are chosen; false where they are few, where one is not from nearby or not sound, or where
    /// they are too far apart.
    #[inline(always)]
    fn start<L: Lanes>(&mut self, signs: u32, axes: &'static Axes) -> bool {
        if self.chosen.count_ones() < LEAST {
            return false;
        }
        if self.chosen != ALL {
            self.fill_up::<L>();
        }
        let Self { rows, frustum, bundle, slabs, exact: Exact { start, .. }, .. } = self;
        let splat = L::Wide::splat;
        let zero = splat(0.0);
        let (t_min, t_max) = (L::Wide::load(&rows[3].0), L::Wide::load(&rows[7].0));
        // As of a ray alone: minus zero is none.
        let is_before = splat(1.0).turned_by(t_min).below(zero);
        let mut fits = zero.at_most(t_min) & t_min.at_most(t_max) & !is_before;
        let (mut is_long, mut is_near) = (0, true);
        let (x, y, z) = (L::Wide::load(&rows[0].0), L::Wide::load(&rows[1].0), L::Wide::load(&rows[2].0));
        self.has_one_origin = x.are_equal() & y.are_equal() & z.are_equal();
        let has_one_origin = self.has_one_origin;
        let (mut inverse, mut off) = ([zero; 3], [zero; 3]);
        let margins = Margins { least: start.narrow_margin, per_distance: Units::NARROW_MARGIN_PER_DISTANCE };
        for axis in 0..3 {
            let direction = L::Wide::load(&rows[4 + axis].0);
            let length = direction.abs();
            fits &= length.at_most(splat(start.longest[axis]));
            is_long |= splat(start.shortest).at_most(length);
            inverse[axis] =
                splat(start.space_per_unit).over(length.max(splat(start.tiny))).turned_by(direction);
            inverse[axis].store(&mut slabs.inverse[axis]);
            if has_one_origin {
                let local = (f64::from(rows[axis].0[0]) - start.mesh_origin[axis]) as f32;
                splat(local).store(&mut rows[axis]);
                let center = local * start.units_per_space - start.shift[axis];
                is_near &= center.abs() <= start.farthest[axis];
                frustum.center[axis] = center;
            } else {
                let local = L::Wide::load(&rows[axis].0).rounded_less(start.mesh_origin[axis]);
                local.store(&mut rows[axis]);
                let from = local * splat(start.units_per_space) - splat(start.shift[axis]);
                let center = from.middle();
                fits &= from.abs().at_most(splat(start.farthest[axis]));
                let [near, far] = margins.offsets(from, inverse[axis]);
                near.store(&mut slabs.near_offset[axis]);
                far.store(&mut slabs.far_offset[axis]);
                off[axis] = (from - center).abs();
                frustum.center[axis] = center.first();
            }
        }
        if fits & is_long != ALL || !is_near {
            return false;
        }
        let s_max = t_max * splat(END_FACTOR) + splat(LITTLE as f32);
        L::Wide::select(self.chosen, s_max, splat(-1.0)).store(&mut slabs.s_max);
        (t_min * splat(START_FACTOR)).store(&mut slabs.s_min);
        let [x, y, z] = inverse;
        let [minus_x, minus_y, minus_z] = [zero - x, zero - y, zero - z];
        let minus_s_min = t_min * splat(-START_FACTOR);
        let most = L::Wide::most_of_eight([x, y, z, s_max, minus_x, minus_y, minus_z, minus_s_min]);
        let off = if has_one_origin { [0.0; 3] } else { [off[0].most(), off[1].most(), off[2].most()] };
        for axis in 0..3 {
            let (most_inverse, minus_least, off) = (most[axis], most[4 + axis], off[axis]);
            let distance = frustum.center[axis].abs() + off;
            // That of a ray alone, and twice that of its arithmetic among boxes.
            let margin = distance * Units::NARROW_MARGIN_PER_DISTANCE + start.narrow_margin;
            let more = distance * start.margin_per_distance + start.margin;
            frustum.most_inverse[axis] = most_inverse;
            frustum.least_inverse[axis] = -minus_least;
            let largest = if most_inverse > minus_least { most_inverse } else { minus_least };
            frustum.width[axis] = largest * (off + (margin + 2.0 * more));
            is_near &= off <= MOST_DISTANCE;
        }
        (frustum.s_max, frustum.s_min, frustum.sides) = (most[3], -most[7], Sides::new(signs));
        (bundle.axes, self.is_among_triangles) = (axes, false);
        is_near
    }

    /// Sets out among triangles; false where directions are too far apart.
    #[inline(always)]
    fn start_triangles<L: Lanes>(&mut self) -> bool {
        let Self { rows, bundle, exact: Exact { start, .. }, .. } = self;
        let splat = L::Wide::splat;
        let order = bundle.axes.order();
        let inverse = L::Wide::load(&self.slabs.inverse[order[2]].0) * splat(start.units_per_space);
        (splat(0.0) - inverse).store(&mut bundle.minus_inverse);
        let mut off = [splat(0.0); 3];
        for (place, &axis) in order.iter().enumerate() {
            let origin = L::Wide::load(&rows[axis].0);
            origin.store(&mut bundle.origin[place]);
            let middle = if self.has_one_origin { origin } else { origin.middle() };
            off[place] = origin - middle;
            bundle.middle[place] = middle.first();
        }
        let mut are_alike = true;
        for place in 0..2 {
            let shear = L::Wide::load(&rows[4 + order[place]].0) * inverse;
            let middle = shear.middle();
            shear.store(&mut bundle.shear[place]);
            bundle.middle_shear[place] = middle.first();
            bundle.spread[place] = (shear - middle).abs().most();
            are_alike &= bundle.spread[place] <= MOST_SPREAD;
            bundle.apart[place] =
                if self.has_one_origin { 0.0 } else { off[2].times_from(shear, off[place]).abs().most() };
        }
        bundle.apart[2] = if self.has_one_origin { 0.0 } else { off[2].abs().most() };
        bundle.t_min = rows[3];
        bundle.t_max = rows[7];
        splat(f32::from_bits(NONE)).store(&mut self.triangle);
        self.is_among_triangles = true;
        are_alike
    }

    /// A bit for each triangle of a block that any of the rays may meet; those of lanes without one mean nothing.
    #[inline(always)]
    fn left<V: Eight>(&self, corners: &Corners) -> u32 {
        let bundle = lanes::opaque(&self.bundle);
        let [kx, ky, kz] = bundle.axes.order();
        let [ox, oy, oz] = bundle.middle;
        let (ox, oy, oz) = (V::splat(ox), V::splat(oy), V::splat(oz));
        let (sx, sy) = (V::splat(bundle.middle_shear[0]), V::splat(bundle.middle_shear[1]));
        let (az, bz, cz) =
            (oz - V::load(&corners[kz][0]), oz - V::load(&corners[kz][1]), oz - V::load(&corners[kz][2]));
        let (ax, bx, cx) = (
            sx.times_from(az, ox - V::load(&corners[kx][0])),
            sx.times_from(bz, ox - V::load(&corners[kx][1])),
            sx.times_from(cz, ox - V::load(&corners[kx][2])),
        );
        let (ay, by, cy) = (
            sy.times_from(az, oy - V::load(&corners[ky][0])),
            sy.times_from(bz, oy - V::load(&corners[ky][1])),
            sy.times_from(cz, oy - V::load(&corners[ky][2])),
        );
        let (low_x, high_x) = (ax.min(bx).min(cx), ax.max(bx).max(cx));
        let (low_y, high_y) = (ay.min(by).min(cy), ay.max(by).max(cy));
        let along = az.abs().max(bz.abs()).max(cz.abs());
        let zero = V::splat(0.0);
        let wide_x = along.times_plus(V::splat(bundle.spread[0]), V::splat(bundle.apart[0]));
        let wide_y = along.times_plus(V::splat(bundle.spread[1]), V::splat(bundle.apart[1]));
        let (across_x, across_y) = ((zero - low_x).max(high_x), (zero - low_y).max(high_y));
        let across = (across_x + wide_x).max(across_y + wide_y);
        let size = across + along + V::splat(bundle.apart[2] + bundle.least_size);
        let slack = size * V::splat(CULL_ERROR);
        let (wide_x, wide_y) = (wide_x + slack, wide_y + slack);
        // The edge functions seen from the middle, and by how much those of the rays may differ.
        let u = cx.times_minus(by, cy * bx);
        let v = ax.times_minus(cy, ay * cx);
        let w = bx.times_minus(ay, by * ax);
        let off = across_y.times_plus(wide_x, wide_y.times_plus(wide_x, across_x * wide_y));
        let off = off * V::splat(2.0 + 8.0 * CULL_ERROR) + V::splat(TINY);
        low_x.at_most(wide_x)
            & (zero - wide_x).at_most(high_x)
            & low_y.at_most(wide_y)
            & (zero - wide_y).at_most(high_y)
            & ((zero - off).at_most(u.min(v).min(w)) | u.max(v).max(w).at_most(off))
    }

    /// Tests all the rays against a triangle.
    #[inline(always)]
    fn meet_triangle<G: Goal, L: Lanes>(
        &mut self,
        corners: &Corners,
        block: &TriangleBlock,
        place: u32,
        lane: usize,
    ) {
        let bundle = lanes::opaque(&self.bundle);
        let [kx, ky, kz] = bundle.axes.order();
        let load = L::Wide::load;
        let (ox, oy, oz) = (load(&bundle.origin[0].0), load(&bundle.origin[1].0), load(&bundle.origin[2].0));
        let (sx, sy) = (load(&bundle.shear[0].0), load(&bundle.shear[1].0));
        let lane = lane % BLOCK;
        let splat = L::Wide::splat;
        // As `NarrowRay::pass`, with the signs turned.
        let az = oz - splat(corners[kz][0][lane]);
        let bz = oz - splat(corners[kz][1][lane]);
        let cz = oz - splat(corners[kz][2][lane]);
        let ax = (ox - splat(corners[kx][0][lane])) - sx * az;
        let bx = (ox - splat(corners[kx][1][lane])) - sx * bz;
        let cx = (ox - splat(corners[kx][2][lane])) - sx * cz;
        let ay = (oy - splat(corners[ky][0][lane])) - sy * az;
        let by = (oy - splat(corners[ky][1][lane])) - sy * bz;
        let cy = (oy - splat(corners[ky][2][lane])) - sy * cz;
        let (bc, ca, ab) = (cx * by, ax * cy, bx * ay);
        let (u, v, w) = (bc - cy * bx, ca - ay * cx, ab - by * ax);
        let within = within([u, v, w]);
        let mask = splat(0.0).at_most(within) & self.alive;
        // Where any hit will do, to go on is less than to foresee wrongly.
        if mask == 0 && !G::IS_ANY {
            return;
        }
        let det = u + v + w;
        let height = u * az + v * bz + w * cz;
        let precise = bundle.precise.of(mask, bc.larger(ca).larger(ab), within, det, [az, bz, cz]);
        let t = height.over(det) * load(&bundle.minus_inverse.0);
        let t_max = load(&bundle.t_max.0);
        let in_range = mask & precise & load(&bundle.t_min.0).at_most(t) & t.at_most(t_max);
        let unclear = mask & !precise;
        if G::IS_ANY {
            self.met |= in_range;
            self.alive &= !in_range;
        } else if in_range != 0 {
            let triangle = load(&self.triangle.0);
            let mut nearer = t.below(t_max) | triangle.with_bits(NONE);
            if in_range & !nearer != 0 {
                nearer |= self.before(in_range & !nearer, place, lane as u32);
            }
            let nearer = nearer & in_range;
            let own = splat(f32::from_bits(place << 3 | lane as u32));
            L::Wide::select(nearer, own, triangle).store(&mut self.triangle);
            for (row, weight) in self.weights.iter_mut().zip([v, w, det]) {
                L::Wide::select(nearer, weight, load(&row.0)).store(row);
            }
            let t_max = L::Wide::select(nearer, t, t_max);
            t_max.store(&mut self.bundle.t_max);
            let end = t * splat(BEYOND) + splat(f32::MIN_POSITIVE);
            let s_max = L::Wide::select(nearer, end, load(&self.slabs.s_max.0));
            s_max.store(&mut self.slabs.s_max);
            self.frustum.s_max = s_max.most();
        }
        if unclear != 0 {
            self.meet_exactly(G::IS_ANY, unclear, block, place, lane as u32);
        }
    }

    /// Those of some rays for which a triangle that they meet where their nearest is comes before that.
    #[cold]
    #[inline(never)]
    fn before(&self, mut those: u32, place: u32, lane: u32) -> u32 {
        let mut before = 0;
        while those != 0 {
            let i = those.trailing_zeros() as usize % PACKET;
            those &= those - 1;
            let own = self.triangle.0[i].to_bits();
            let comes_first = self.exact.names(place, lane) < self.exact.names(own >> 3, own & 7);
            before |= u32::from(comes_first) << i;
        }
        before
    }

    /// One of the rays among triangles.
    fn ray(&self, i: usize) -> NarrowRay {
        let bundle = &self.bundle;
        let [x, y, z] = [0, 1, 2].map(|axis| bundle.origin[axis].0[i]);
        NarrowRay {
            axes: bundle.axes,
            origin: [x, y, z, bundle.t_min.0[i]],
            shear: [bundle.shear[0].0[i], bundle.shear[1].0[i], 1.0, bundle.t_max.0[i]],
            minus_inverse: bundle.minus_inverse.0[i],
        }
    }

    /// Looks closer at a triangle that these rays may meet.
    #[cold]
    #[inline(never)]
    fn meet_exactly(&mut self, is_any: bool, mut those: u32, block: &TriangleBlock, place: u32, lane: u32) {
        while those != 0 {
            let i = those.trailing_zeros() as usize % PACKET;
            those &= those - 1;
            let Some((t, weights)) = self.ray(i).cross_exactly(block, lane) else { continue };
            if is_any {
                self.met |= 1 << i;
                self.alive &= !(1 << i);
                continue;
            }
            let is_first = self.triangle.0[i].to_bits() == NONE || t < self.bundle.t_max.0[i];
            if is_first || self.before(1 << i, place, lane) != 0 {
                self.triangle.0[i] = f32::from_bits(place << 3 | lane);
                for (row, weight) in self.weights.iter_mut().zip(weights) {
                    row.0[i] = weight;
                }
                self.bundle.t_max.0[i] = t;
                self.slabs.s_max.0[i] = beyond(t);
            }
        }
        self.frustum.s_max =
            self.slabs.s_max.0.iter().fold(-1.0, |most, &s_max| if s_max > most { s_max } else { most });
    }

    /// Goes through the tree; false where it gave up.
    #[inline(always)]
    fn run<G: Goal, L: Lanes>(&mut self) -> bool {
        (self.alive, self.met, self.work) = (self.chosen, 0, 0);
        let nodes: &[Node] = self.exact.nodes();
        let most_work = effort::<L>(G::IS_ANY, self.has_one_origin).most;
        let mut stack: Stack<<G::Order as Order>::Entry> = Stack::new();
        let mut reference = self.exact.start.root;
        let mut room = CornersRoom::new();
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
            let mut following = Some(reference & tag::PLACE);
            while let Some(place) = following {
                let block = self.triangles.block(place);
                following = block.next(place);
                let corners = L::corners(block, &mut room);
                let mut rest = self.left::<L::Eight>(corners) & block.taken();
                self.work += 2 + 2 * rest.count_ones();
                while rest != 0 {
                    let lane = rest.trailing_zeros() as usize;
                    rest &= rest - 1;
                    self.meet_triangle::<G, L>(corners, block, place, lane);
                }
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

    /// The nearest hits of those that were chosen.
    #[inline(always)]
    pub(super) fn put_nearest<L: Lanes>(&self, first: usize, ends: &mut impl Ends<Option<Hit32>>) {
        let load = L::Wide::load;
        let triangle = load(&self.triangle.0);
        let hits = if self.is_among_triangles { self.chosen & !triangle.with_bits(NONE) } else { 0 };
        let row = Row::of(0.0);
        let (mut local, mut id, mut primitive, mut geometry) = ([row; 2], row, row, row);
        if hits != 0 {
            let det = load(&self.weights[2].0);
            for (local, weight) in local.iter_mut().zip(&self.weights) {
                load(&weight.0).over(det).store(local);
            }
            let mut names = [L::Wide::splat(0.0); 3];
            let mut rest = hits;
            while rest != 0 {
                // Many may have met the same.
                let own = self.triangle.0[rest.trailing_zeros() as usize % PACKET].to_bits();
                let with_this = triangle.with_bits(own);
                rest &= !with_this;
                let (geometry, primitive) = self.exact.names(own >> 3, own & 7);
                let id = self.exact.accel().geometries[geometry as usize].id;
                for (name, own) in names.iter_mut().zip([id, primitive, geometry]) {
                    *name = L::Wide::select(with_this, L::Wide::splat(f32::from_bits(own)), *name);
                }
            }
            names[0].store(&mut id);
            names[1].store(&mut primitive);
            names[2].store(&mut geometry);
        }
        let hit = |i: usize| Hit32 {
            t: self.bundle.t_max.0[i],
            local: [local[0].0[i], local[1].0[i]],
            id: id.0[i].to_bits(),
            primitive: primitive.0[i].to_bits(),
            geometry: geometry.0[i].to_bits(),
            instance: Hit32::NO_INSTANCE,
        };
        if hits == ALL {
            ends.put_row(first, |i| Some(hit(i)));
        } else {
            self.put_chosen(first, |i| (hits >> i & 1 != 0).then(|| hit(i)), ends);
        }
    }

    /// Whether each that was chosen met anything.
    #[inline(always)]
    pub(super) fn put_met(&self, first: usize, ends: &mut impl Ends<bool>) {
        self.put_chosen(first, |i| self.met >> i & 1 != 0, ends);
    }

    /// The answers to those that were chosen, by their places.
    #[inline(always)]
    fn put_chosen<A>(&self, first: usize, answer: impl Fn(usize) -> A, ends: &mut impl Ends<A>) {
        if self.chosen == ALL {
            ends.put_row(first, answer);
            return;
        }
        let mut rest = self.chosen;
        while rest != 0 {
            let i = rest.trailing_zeros() as usize % PACKET;
            rest &= rest - 1;
            ends.put(first + i, Outcome::Settled(answer(i)));
        }
    }
}

const _: () = assert!(PACKET == WIDE);
