//! Packets in double precision: triangles are tested like single rays, with the bounds of [`BlockRay`].

use std::marker::PhantomData;

use lumbre_geometry::Ray;
use lumbre_math::DVec2;

use super::packet::{ALL, Bundle, Cull, CullBounds, PACKET, Signs, Start, State, WorkBudget, record};
use super::sink::Sink;
use crate::intersect::box_ray::SlabRows;
use crate::intersect::box_ray::Slabs;
use crate::intersect::watertight::{
    self, BEYOND, EDGE_ERROR, ERRORS_OF_EDGES, ERRORS_OF_EXTENT, FAR, HEIGHT_ERROR, Meeting, Met, Pairs,
    ROUNDINGS, SIZE_ERROR, TINY, beyond,
};
use crate::intersect::{Axes, Dispatch, Isa, Simd};
use crate::simd::{self, F32x16, Row, Vector};
use crate::trace::decide::{Candidate, Decider, heights};
use crate::trace::filtered_ray::{FilteredGoal, FilteredRay};
use crate::trace::largest_component;
use crate::trace::{ContextRef, Outcome, Winner};
use crate::tree::Corners;
use crate::tree::filter_start::FilterStart;
use crate::tree::triangle_block::TriangleBlock;

/// The rays of a packet.
pub(super) struct F64Bundle<'a, 'd, G, const GENERAL: bool> {
    decider: &'d Decider<'a>,
    /// The rays, transposed: origin, direction, range.
    columns: [Row<f64>; 8],
    axes: &'static Axes,
    /// Each ray among triangles, as a [`BlockRay`](watertight::BlockRay).
    origin: [Row<f32>; 3],
    rest: [Row<f32>; 3],
    shear: [Row<f32>; 2],
    first: Row<f32>,
    last: Row<f32>,
    surely_first: Row<f32>,
    surely_last: Row<f32>,
    s_per_height: Row<f32>,
    /// A zero, negative if the last components of the directions are positive.
    turn: f32,
    /// The intervals of heights of the closest hits; a triangle is eight times the line of its block, plus the lane.
    from: Row<f32>,
    to: Row<f32>,
    triangle: Row<f32>,
    /// Each ray in other leaves, once the rays have come to some.
    others: Vec<Option<FilteredRay<'a, 'd, GENERAL, false>>>,
    others_started: bool,
    goal: PhantomData<G>,
}

/// No triangle: no hit, or a hit of another primitive.
const NONE: u32 = u32::MAX;
const OTHER: u32 = u32::MAX - 1;

/// The inverse of a direction in tree units, as for a single ray.
#[inline(always)]
fn inverse_of<W: F32x16>(start: &FilterStart, direction: W) -> W {
    let size = W::splat(start.space_per_unit) / direction.abs().max(W::splat(start.tiny));
    size.xor_sign(direction)
}

impl<'a, 'd, G: FilteredGoal, const GENERAL: bool> F64Bundle<'a, 'd, G, GENERAL> {
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

    /// Decides about a triangle that these rays may hit, for any hit.
    #[cold]
    #[inline(never)]
    fn decide_any(&self, state: &mut State, mut mask: u32, place: u32, lane: u32, rays: &[Ray; PACKET]) {
        while mask != 0 {
            let i = mask.trailing_zeros() as usize % PACKET;
            mask &= mask - 1;
            match self.decider.intersect(&rays[i], place, lane) {
                Meeting::Miss => {}
                Meeting::Hit { .. } => state.stop_at_hits(1 << i),
                Meeting::Touch { .. } => state.give_up(i),
            }
        }
    }

    /// Decides about a triangle that these rays may hit, for the closest hit.
    #[cold]
    #[inline(never)]
    fn decide_closest(
        &mut self,
        state: &mut State,
        isa: Isa,
        mut mask: u32,
        (place, lane): (u32, u32),
        rays: &[Ray; PACKET],
    ) {
        while mask != 0 {
            let i = mask.trailing_zeros() as usize % PACKET;
            mask &= mask - 1;
            let (decider, ray, axes) = (self.decider, &rays[i], self.axes);
            let (best, exact) = (self.best(i), self.exact(i));
            match isa.run(Comparison { decider, ray, axes, triangle: (place, lane), best, exact }) {
                Outcome::Certain(None) => {}
                Outcome::Certain(Some(t)) => {
                    self.keep(state, i, heights(t, largest_component(ray)), place << 3 | lane);
                }
                Outcome::Uncertain => state.give_up(i),
            }
        }
        state.end_frustum();
    }

    /// Takes a closer hit of a ray.
    #[inline(always)]
    fn keep(&mut self, state: &mut State, i: usize, (from, to): (f32, f32), triangle: u32) {
        (self.from.0[i], self.to.0[i]) = (from, to);
        self.triangle.0[i] = f32::from_bits(triangle);
        self.last.0[i] = to;
        state.slabs.s_max.0[i] = beyond(to * self.s_per_height.0[i]);
    }

    /// The closest hit of a ray so far.
    #[inline(always)]
    fn best(&self, i: usize) -> Candidate {
        let (triangle, heights) = (self.triangle.0[i].to_bits(), (self.from.0[i], self.to.0[i]));
        match triangle {
            NONE => Candidate::NONE,
            OTHER => Candidate::exact(heights),
            _ => Candidate { block: triangle >> 3, lane: triangle & 7, from: heights.0, to: heights.1 },
        }
    }

    /// The closest hit of a ray so far, if it is not a triangle.
    #[inline(always)]
    fn exact(&self, i: usize) -> Option<Winner> {
        let is_other = GENERAL && self.triangle.0[i].to_bits() == OTHER;
        if is_other { self.others[i].as_ref().and_then(FilteredRay::exact) } else { None }
    }

    /// Tests other leaves than triangles, or unbounded geometry, for the live rays, by the code of single rays.
    #[inline(always)]
    fn test_others<L: Simd>(&mut self, state: &mut State, leaf: Option<u32>, rays: &[Ray; PACKET]) {
        if !self.others_started {
            self.start_others::<L>(state, rays);
        }
        let mut rest = state.alive;
        while rest != 0 {
            let i = rest.trailing_zeros() as usize % PACKET;
            rest &= rest - 1;
            let best = self.best(i);
            let Some(Some(other)) = self.others.get_mut(i) else { continue };
            other.continue_from(best);
            let mut slabs = Slabs::ZERO;
            let stop = match leaf {
                Some(leaf) => other.test_leaf::<G, L>(leaf, &rays[i], &mut slabs),
                None => other.test_infinite::<G, L>(&rays[i], &mut slabs),
            };
            let best = other.best;
            if best.is_exact() {
                self.keep(state, i, (best.from, best.to), OTHER);
            }
            record(state, i, stop);
        }
        state.end_frustum();
    }

    /// Starts the live rays among leaves of any kind.
    #[inline(always)]
    fn start_others<L: Simd>(&mut self, state: &mut State, rays: &[Ray; PACKET]) {
        let (decider, alive) = (self.decider, state.alive);
        self.others.clear();
        for (i, ray) in rays.iter().enumerate() {
            let slabs = if alive >> i & 1 != 0 { L::start_filter(decider.start, ray) } else { None };
            self.others.push(slabs.map(|slabs| {
                let blocks = L::start_blocks(decider.start, ray, &slabs);
                FilteredRay::new(decider, blocks, None, ContextRef::OUTSIDE)
            }));
            if alive >> i & 1 != 0 && slabs.is_none() {
                state.give_up(i);
            }
        }
        self.others_started = true;
    }
}

/// See [`F64Bundle::decide_closest`].
struct Comparison<'s, 'a> {
    decider: &'s Decider<'a>,
    ray: &'s Ray,
    axes: &'static Axes,
    triangle: (u32, u32),
    best: Candidate,
    exact: Option<Winner>,
}

impl Dispatch for Comparison<'_, '_> {
    type Output = Outcome<Option<f64>>;

    #[inline(always)]
    fn run<L: Simd>(self) -> Self::Output {
        let Self { decider, ray, axes, triangle, best, exact } = self;
        decider.compare::<L>(ray, axes, triangle, (&best, exact))
    }
}

/// [`F64Bundle::test_others`] out of line: it is long and rarely called.
struct TestOthers<'s, 'a, 'd, G, const GENERAL: bool> {
    bundle: &'s mut F64Bundle<'a, 'd, G, GENERAL>,
    state: &'s mut State,
    leaf: Option<u32>,
    rays: &'s [Ray; PACKET],
}

impl<G: FilteredGoal, const GENERAL: bool> Dispatch for TestOthers<'_, '_, '_, G, GENERAL> {
    type Output = ();

    #[inline(always)]
    fn run<L: Simd>(self) {
        self.bundle.test_others::<L>(self.state, self.leaf, self.rays);
    }
}

impl<'a, 'd, G: FilteredGoal, const GENERAL: bool> Bundle<'a, 'd> for F64Bundle<'a, 'd, G, GENERAL> {
    type Goal = G;
    type Ray = Ray;
    type Answer = G::Found;
    const GENERAL: bool = GENERAL;
    const NEEDS_BOUNDS: bool = true;
    const MAX_SPREAD: f32 = 0.125;

    #[inline(always)]
    fn new(decider: &'d Decider<'a>) -> Self {
        let row = Row::of(0.0);
        Self {
            decider,
            columns: [Row::of(0.0); 8],
            axes: Axes::by_bits(0, 0),
            origin: [row; 3],
            rest: [row; 3],
            shear: [row; 2],
            first: row,
            last: row,
            surely_first: row,
            surely_last: row,
            s_per_height: row,
            turn: 0.0,
            from: row,
            to: row,
            triangle: row,
            others: Vec::new(),
            others_started: false,
            goal: PhantomData,
        }
    }

    // Less for any hit, which a single ray finds faster, and for rays from different places, which soon diverge; more
    // if there are other primitives than triangles, which cost a single ray more.
    #[inline(always)]
    fn effort(has_one_origin: bool) -> WorkBudget {
        match (GENERAL, has_one_origin, G::IS_ANY) {
            (false, true, true) => WorkBudget { most: 160, paying: 100 },
            (false, true, false) => WorkBudget { most: 300, paying: 120 },
            (false, false, _) => WorkBudget { most: 70, paying: 50 },
            (true, _, true) => WorkBudget { most: 600, paying: 400 },
            (true, _, false) => WorkBudget { most: 800, paying: 400 },
        }
    }

    #[inline(always)]
    fn load<L: Simd>(&mut self, rays: &[Ray; PACKET]) {
        L::columns(rays, &mut self.columns);
    }

    #[inline(always)]
    fn alike<L: Simd>(&self, one: u32) -> (u32, Signs) {
        let zero = L::F32x16::splat(0.0);
        let (mut length, mut negative) = ([zero; 3], [0; 3]);
        for axis in 0..3 {
            let direction = L::F32x16::rounded(&self.columns[3 + axis]);
            length[axis] = direction.abs();
            negative[axis] = L::F32x16::splat(1.0).xor_sign(direction).simd_lt(zero);
        }
        // For each pair of components, where the first is longer and where the second is: rounding keeps their order,
        // or makes them equal.
        let [x, y, z] = length;
        let mut longer = [y.simd_lt(x), z.simd_lt(y), z.simd_lt(x)];
        let shorter = [x.simd_lt(y), y.simd_lt(z), x.simd_lt(z)];
        if (longer[0] | shorter[0]) & (longer[1] | shorter[1]) & (longer[2] | shorter[2]) != ALL {
            longer = self.no_shorter();
        }
        let x_is_last = longer[0] & longer[2];
        let y_is_last = longer[1] & !x_is_last;
        Signs::of(one, negative, x_is_last, y_is_last)
    }

    #[inline(always)]
    fn fill_up<L: Simd>(&mut self, mask: u32) {
        let one = mask.trailing_zeros() as usize % PACKET;
        for Row(column) in &mut self.columns {
            let own = column[one];
            for (i, number) in column.iter_mut().enumerate() {
                *number = if mask >> i & 1 != 0 { *number } else { own };
            }
        }
    }

    #[inline(always)]
    fn start<L: Simd>(&mut self, decider: &Decider, slabs: &mut SlabRows) -> Option<Start<L::F32x16>> {
        let (columns, start, splat) = (&self.columns, decider.start, L::F32x16::splat);
        let has_one_origin = L::F32x16::are_same(&columns[0])
            && L::F32x16::are_same(&columns[1])
            && L::F32x16::are_same(&columns[2]);
        let zero = splat(0.0);
        let (t_min, t_max) = (L::F32x16::rounded(&columns[6]), L::F32x16::rounded(&columns[7]));
        let mut fits = zero.simd_le(t_min) & t_min.simd_le(t_max);
        let (mut is_long, mut is_near) = (0, true);
        let (mut inverse, mut center, mut off) = ([zero; 3], [0.0; 3], [0.0; 3]);
        for axis in 0..3 {
            let direction = L::F32x16::rounded(&columns[3 + axis]);
            fits &= direction.abs().simd_le(splat(start.longest[axis]));
            is_long |= splat(start.shortest).simd_le(direction.abs());
            inverse[axis] = inverse_of(start, direction);
            let (origin, scale) = (start.tree_origin[axis], start.scale);
            if has_one_origin {
                center[axis] = ((columns[axis].0[0] - origin) * scale) as f32;
                is_near &= center[axis].abs() <= start.farthest[axis];
            } else {
                let from = L::F32x16::rounded_from(&columns[axis], origin, scale);
                let middle = from.midpoint();
                fits &= from.abs().simd_le(splat(start.farthest[axis]));
                slabs.set_axis(axis, from, inverse[axis], [start.margin, start.margin_per_distance]);
                off[axis] = (from - middle).abs().reduce_max();
                center[axis] = middle.first();
            }
        }
        (fits == ALL && is_long == ALL && is_near).then_some(Start {
            inverse,
            range: [t_min, t_max],
            center,
            off,
            margin_per_distance: 3.0 * start.margin_per_distance,
            margin: 3.0 * start.margin,
            has_one_origin,
        })
    }

    #[inline(always)]
    fn start_triangles<L: Simd>(
        &mut self,
        decider: &Decider,
        axes: &'static Axes,
        _: &SlabRows,
        cull: &mut Cull,
    ) {
        let (start, splat) = (decider.start, L::F32x16::splat);
        let zero = splat(0.0);
        let order = axes.order();
        let columns = &self.columns;
        let has_one_origin = L::F32x16::are_same(&columns[0])
            && L::F32x16::are_same(&columns[1])
            && L::F32x16::are_same(&columns[2]);
        let last = L::F32x16::rounded(&columns[3 + order[2]]);
        let inverse = inverse_of(start, last) * splat(start.units_per_space);
        inverse.abs().store(&mut self.s_per_height);
        self.turn = if columns[3 + order[2]].0[0].is_sign_negative() { 0.0 } else { -0.0 };
        let (mut rest, mut off) = ([zero; 3], [zero; 3]);
        for (place, &axis) in order.iter().enumerate() {
            let mesh_origin = start.mesh_origin[axis];
            if has_one_origin {
                let exact = columns[axis].0[0] - mesh_origin;
                let origin = exact as f32;
                let more = (exact - f64::from(origin)) as f32;
                rest[place] = splat(more);
                splat(origin).store(&mut self.origin[place]);
                (cull.middle[place], cull.apart[place]) = (origin, more.abs());
            } else {
                let (origin, more) = L::F32x16::parted_from(&columns[axis], mesh_origin);
                let middle = origin.midpoint();
                (rest[place], off[place]) = (more, origin - middle);
                origin.store(&mut self.origin[place]);
                cull.middle[place] = middle.first();
            }
        }
        rest[2].store(&mut self.rest[2]);
        for place in 0..2 {
            let shear = L::F32x16::rounded(&columns[3 + order[place]]) * inverse;
            let sheared = rest[2].neg_mul_add(shear, rest[place]);
            let middle = shear.midpoint();
            shear.store(&mut self.shear[place]);
            sheared.store(&mut self.rest[place]);
            cull.middle_shear[place] = middle.first();
            cull.spread[place] = (shear - middle).abs().reduce_max();
            cull.apart[place] = if has_one_origin {
                // The error of the rest alone, with a shear of at most one and few roundings.
                1.5 * (cull.apart[place] + cull.apart[2])
            } else {
                off[2].neg_mul_add(shear, off[place] + sheared).abs().reduce_max()
            };
        }
        cull.apart[2] = if has_one_origin { 0.0 } else { off[2].abs().reduce_max() };
        let (t_min, t_max) = (L::F32x16::rounded(&columns[6]), L::F32x16::rounded(&columns[7]));
        let (far, roundings) = (splat(FAR), splat(ROUNDINGS));
        let heights = [(t_min * last.abs()).min(far), (t_max * last.abs()).min(far)];
        let errors = [heights[0] * roundings, heights[1] * roundings];
        (heights[0] - errors[0]).store(&mut self.first);
        (heights[0] + errors[0]).store(&mut self.surely_first);
        (heights[1] - errors[1]).store(&mut self.surely_last);
        (heights[1] + errors[1]).store(&mut self.last);
        let infinity = splat(f32::INFINITY);
        infinity.store(&mut self.from);
        infinity.store(&mut self.to);
        splat(f32::from_bits(NONE)).store(&mut self.triangle);
        (self.axes, self.others_started) = (axes, false);
    }

    #[inline(always)]
    fn test_triangle<L: Simd>(
        &mut self,
        state: &mut State,
        _: &Cull,
        (place, _, corners): (u32, &TriangleBlock, &Corners),
        lane: usize,
        bounds: &CullBounds,
        rays: &[Ray; PACKET],
    ) {
        let own = simd::opaque(self);
        let (load, splat) = (L::F32x16::load, L::F32x16::splat);
        let [kx, ky, kz] = own.axes.order();
        let (ox, oy, oz) = (load(&own.origin[0].0), load(&own.origin[1].0), load(&own.origin[2].0));
        let (rx, ry) = (load(&own.rest[0].0), load(&own.rest[1].0));
        let (sx, sy) = (load(&own.shear[0].0), load(&own.shear[1].0));
        let at = |axis: usize, corner: usize| splat(corners[axis][corner][lane]);
        // As `Simd::intersect_triangles`, with signs flipped.
        let (az, bz, cz) = (oz - at(kz, 0), oz - at(kz, 1), oz - at(kz, 2));
        let ax = sx.neg_mul_add(az, ox - at(kx, 0) + rx);
        let bx = sx.neg_mul_add(bz, ox - at(kx, 1) + rx);
        let cx = sx.neg_mul_add(cz, ox - at(kx, 2) + rx);
        let ay = sy.neg_mul_add(az, oy - at(ky, 0) + ry);
        let by = sy.neg_mul_add(bz, oy - at(ky, 1) + ry);
        let cy = sy.neg_mul_add(cz, oy - at(ky, 2) + ry);
        let u = cx.mul_sub(by, cy * bx);
        let v = ax.mul_sub(cy, ay * cx);
        let w = bx.mul_sub(ay, by * ax);
        let (size, across) = (bounds.size[lane], bounds.across[lane]);
        let error = size * EDGE_ERROR * (size * SIZE_ERROR + across) + TINY;
        let (low, high) = (u.min(v).min(w), u.max(v).max(w));
        let mask = (splat(-error).simd_le(low) | high.simd_le(splat(error))) & state.alive;
        if mask == 0 {
            return;
        }
        let det = u + v + w;
        let weight = det.abs();
        let height = det.mul_add(load(&own.rest[2].0), w.mul_add(cz, v.mul_add(bz, u * az)));
        let ahead = height.xor_sign(det).xor_sign(splat(own.turn));
        let height_error = size * HEIGHT_ERROR;
        let extent = bounds.extent[lane] + height_error;
        let least_spread = error * (ERRORS_OF_EXTENT * extent + ERRORS_OF_EDGES * height_error) + TINY;
        let spread = weight.mul_add(splat(height_error), splat(least_spread));
        let (from, to) = (ahead - spread, ahead + spread);
        // NaN may be in range.
        let is_out = to.simd_lt(weight * load(&own.first.0)) | (weight * load(&own.last.0)).simd_lt(from);
        let in_range = mask & !is_out;
        if in_range == 0 {
            return;
        }
        let inside = splat(error).simd_lt(low) | high.simd_lt(splat(-error));
        let certain = in_range
            & inside
            & (weight * load(&own.surely_first.0)).simd_le(from)
            & to.simd_le(weight * load(&own.surely_last.0));
        if G::IS_ANY {
            state.stop_at_hits(certain);
            let uncertain = in_range & !certain;
            if uncertain != 0 {
                self.decide_any(state, uncertain, place, lane as u32, rays);
            }
            return;
        }
        let inverse = splat(1.0) / weight;
        let (from, to) = (from * inverse, to * inverse);
        let (best_from, best_to) = (load(&own.from.0), load(&own.to.0));
        let closer = certain & to.simd_lt(best_from);
        let doubtful = in_range & !closer & !best_to.simd_lt(from);
        if closer != 0 {
            let triangle = splat(f32::from_bits(place << 3 | lane as u32));
            L::F32x16::select(closer, from, best_from).store(&mut self.from);
            let to = L::F32x16::select(closer, to, best_to);
            to.store(&mut self.to);
            L::F32x16::select(closer, triangle, load(&self.triangle.0)).store(&mut self.triangle);
            L::F32x16::select(closer, to, load(&self.last.0)).store(&mut self.last);
            let s = to * load(&self.s_per_height.0);
            let end = s.mul_add(splat(BEYOND), splat(f32::MIN_POSITIVE));
            let s_max = L::F32x16::select(closer, end, load(&state.slabs.s_max.0));
            s_max.store(&mut state.slabs.s_max);
            state.frustum.s_max = s_max.reduce_max();
        }
        if doubtful != 0 {
            self.decide_closest(state, L::isa(), doubtful, (place, lane as u32), rays);
        }
    }

    #[inline(always)]
    fn test_infinite<L: Simd>(&mut self, state: &mut State, rays: &[Ray; PACKET]) {
        L::isa().run(TestOthers { bundle: self, state, leaf: None, rays });
    }

    #[inline(always)]
    fn test_leaf<L: Simd>(&mut self, state: &mut State, leaf: u32, rays: &[Ray; PACKET]) {
        L::isa().run(TestOthers { bundle: self, state, leaf: Some(leaf), rays });
    }

    #[inline(always)]
    fn put<L: Simd>(
        &mut self,
        decider: &Decider,
        state: &State,
        rays: &[Ray; PACKET],
        first: usize,
        sink: &mut impl Sink<G::Found>,
    ) {
        let triangle = L::F32x16::load(&self.triangle.0);
        let (mut on_triangles, mut on_others) = (0, 0);
        if !G::IS_ANY && state.is_among_triangles {
            on_triangles = !triangle.with_bits(NONE) & !state.uncertain & state.chosen;
            on_others = if GENERAL { on_triangles & triangle.with_bits(OTHER) } else { 0 };
            on_triangles &= !on_others;
        }
        let met = if on_triangles != 0 { self.intersect_all::<L>(decider, on_triangles) } else { Met::NONE };
        let mut rest = state.chosen;
        while rest != 0 {
            let i = rest.trailing_zeros() as usize % PACKET;
            rest &= rest - 1;
            let outcome = if state.uncertain >> i & 1 != 0 {
                Outcome::Uncertain
            } else if state.met >> i & 1 != 0 {
                Outcome::Certain(G::hit())
            } else if on_triangles >> i & 1 != 0 {
                match self.winner::<L>(decider, &met, i, &rays[i]) {
                    Some(winner) => Outcome::Certain(G::closest(winner)),
                    None => Outcome::Uncertain,
                }
            } else if on_others >> i & 1 != 0 {
                let other = self.others[i].as_mut().expect("it has a hit");
                G::end::<L, GENERAL, false>(other, &rays[i])
            } else {
                Outcome::Certain(G::nothing())
            };
            sink.put(first + i, outcome);
        }
    }
}

impl<G: FilteredGoal, const GENERAL: bool> F64Bundle<'_, '_, G, GENERAL> {
    /// Intersects the triangles of these closest hits in double precision, all in one call.
    #[inline(always)]
    fn intersect_all<L: Simd>(&self, decider: &Decider, hits: u32) -> Met {
        let (axes, triangle) = (self.axes, L::F32x16::load(&self.triangle.0));
        // Many rays may have hit the same triangle.
        let mut corners = [[Row::of(0.0); 3]; 3];
        let mut rest = hits;
        while rest != 0 {
            let one = self.triangle.0[rest.trailing_zeros() as usize % PACKET].to_bits();
            let with_this = triangle.with_bits(one);
            rest &= !with_this;
            let these = axes.gather(decider.block(one >> 3), (one & 7) as usize);
            for (rows, corner) in corners.iter_mut().zip(these) {
                for (row, coordinate) in rows.iter_mut().zip(corner) {
                    L::F32x16::select(with_this, L::F32x16::splat(coordinate), L::F32x16::load(&row.0))
                        .store(row);
                }
            }
        }
        let [x, y, z] = axes.order();
        let columns = &self.columns;
        let mesh_origin = &decider.start.mesh_origin;
        let pairs = Pairs {
            origin: [&columns[x], &columns[y], &columns[z]],
            mesh_origin: [mesh_origin[x], mesh_origin[y], mesh_origin[z]],
            direction: [&columns[3 + x], &columns[3 + y], &columns[3 + z]],
            corners: &corners,
        };
        pairs.meet()
    }

    /// The closest hit of a ray, on a triangle; `None` if double precision denies it.
    #[inline(always)]
    fn winner<L: Simd>(&self, decider: &Decider, met: &Met, i: usize, ray: &Ray) -> Option<Winner> {
        let (best, t) = (self.best(i), met.t.0[i]);
        if t.is_nan() {
            // Uncertain: decided exactly, for this ray alone.
            return decider.winner::<L>(ray, self.axes, &best);
        }
        let (geometry, primitive) = decider.ids(best.block, best.lane);
        let local = DVec2::new(met.local[0].0[i], met.local[1].0[i]);
        Some(Winner { root: watertight::root(t, local), geometry, primitive })
    }
}
