//! Packets in single precision: triangles are tested by the operations of [`F32Ray`].
//!
//! The error bounds of [`packet`](super::packet) for boxes and triangles hold here. A ray's margin among boxes is that
//! of its triangles plus that of the arithmetic; a frustum uses another order of operations, so twice the latter is
//! added. Triangles are culled by the same bounds, which allow 32u of their size for the rounding of the sheared
//! corners of the rays and of the middle; these have errors of slightly more than 8.1u.

use std::marker::PhantomData;

use lumbre_geometry::Ray;

use super::packet::{ALL, Bundle, Cull, CullBounds, PACKET, Signs, Start, State, WorkBudget};
use super::sink::Sink;
use crate::intersect::box_ray::SlabRows;
use crate::intersect::f32_ray::{F32Ray, within};
use crate::intersect::watertight::{BEYOND, beyond};
use crate::intersect::{Axes, Dispatch, Simd};
use crate::ray32::{Hit32, Ray32};
use crate::simd::{self, F32x16, Row, Vector};
use crate::trace::decide::Decider;
use crate::trace::f32_ray::SOME_HIT;
use crate::trace::picture::{Crossing, LocalRay, Others};
use crate::trace::stack::Goal;
use crate::trace::{Outcome, precedes};
use crate::tree::Corners;
use crate::tree::node::TreeSpace;
use crate::tree::triangle_block::TriangleBlock;

/// A ray of a packet: alone, in trees of triangles, or with the same ray in double precision, in trees of any
/// primitives.
pub(super) trait PacketRay: Sized + 'static {
    type Answer;
    /// Whether the tree has other leaves than triangles.
    const GENERAL: bool;

    /// In single precision.
    fn local(&self) -> &Ray32;

    /// In double precision, for other leaves than triangles.
    fn in_f64(&self) -> Option<&Ray>;

    /// Hands out the answers of a packet's rays: see [`Bundle::put`].
    fn put<G: Goal, L: Simd>(
        bundle: &mut F32Bundle<'_, '_, G, Self>,
        state: &State,
        rays: &[Self; PACKET],
        first: usize,
        sink: &mut impl Sink<Self::Answer>,
    );
}

/// A picture ray in a tree of any primitives.
#[derive(Clone, Copy)]
pub(super) struct PictureRay {
    /// Relative to the mesh, and rounded.
    pub(super) local: Ray32,
    /// The original ray.
    pub(super) ray: Ray,
}

/// The rays of a packet.
pub(super) struct F32Bundle<'a, 'd, G, R> {
    decider: &'d Decider<'a>,
    /// The rays, transposed: origin (relative to the mesh after the start), first `t`, direction, last `t`.
    rows: [Row<f32>; 8],
    axes: &'static Axes,
    /// Each ray among triangles, as a [`F32Ray`].
    origin: [Row<f32>; 3],
    shear: [Row<f32>; 2],
    minus_inverse: Row<f32>,
    t_min: Row<f32>,
    /// Ends at the closest hit.
    t_max: Row<f32>,
    /// The triangle of the closest hit: eight times the line of its block, plus the lane.
    triangle: Row<f32>,
    /// Its weights: of the second and the third corner, and of all.
    weights: [Row<f32>; 3],
    has_one_origin: bool,
    /// The crossings of each ray with other primitives, once the rays have come to some.
    others: Vec<Others<'a>>,
    others_started: bool,
    goal: PhantomData<(G, R)>,
}

/// No triangle.
const NONE: u32 = u32::MAX;

impl<G: Goal, R: PacketRay> F32Bundle<'_, '_, G, R> {
    /// The rays for which a triangle hit at the same `t` as the best comes first. `enters` has a bit for each ray that
    /// enters through it.
    #[cold]
    #[inline(never)]
    fn those_before(&self, mut mask: u32, place: u32, lane: u32, enters: u32) -> u32 {
        let mut first = 0;
        while mask != 0 {
            let i = mask.trailing_zeros() as usize % PACKET;
            mask &= mask - 1;
            let best = self.triangle.0[i].to_bits();
            let is_first = precedes(
                (enters >> i & 1 != 0, self.decider.ids(place, lane)),
                (self.weights[2].0[i] > 0.0, self.decider.ids(best >> 3, best & 7)),
            );
            first |= u32::from(is_first) << i;
        }
        first
    }

    /// Tests other leaves than triangles, or unbounded geometry, ray by ray.
    #[inline(always)]
    fn test_others<L: Simd>(&mut self, state: &mut State, leaf: Option<u32>, rays: &[R; PACKET]) {
        if !self.others_started {
            self.others_started = true;
            self.others.clear();
            for ray in rays {
                let limit = ray.in_f64().map_or(f64::NEG_INFINITY, |ray| ray.t_max);
                self.others.push(Others::new(self.decider.tree(), limit));
            }
        }
        let mut alive = state.alive;
        while alive != 0 {
            let i = alive.trailing_zeros() as usize % PACKET;
            alive &= alive - 1;
            let (Some(ray), Some(others)) = (rays[i].in_f64(), self.others.get_mut(i)) else { continue };
            let local = LocalRay::new(*rays[i].local());
            if !G::IS_ANY {
                others.shorten(local.t(self.t_max.0[i]));
            }
            let (is_met, nearer) = others.test::<G, L>(leaf, ray);
            if is_met {
                state.stop_at_hits(1 << i);
            } else if let Some(t) = nearer {
                let end = local.end(t);
                if end < self.t_max.0[i] {
                    self.t_max.0[i] = end;
                    state.slabs.s_max.0[i] = beyond(end);
                }
            }
        }
        state.end_frustum();
    }

    /// One of the rays among triangles.
    fn ray(&self, i: usize) -> F32Ray {
        let [x, y, z] = [0, 1, 2].map(|axis| self.origin[axis].0[i]);
        F32Ray {
            axes: self.axes,
            origin: [x, y, z, self.t_min.0[i]],
            shear: [self.shear[0].0[i], self.shear[1].0[i], 1.0, self.t_max.0[i]],
            minus_inverse: self.minus_inverse.0[i],
        }
    }

    /// Decides exactly about a triangle that these rays may hit.
    #[cold]
    #[inline(never)]
    fn decide(&mut self, state: &mut State, mut mask: u32, block: &TriangleBlock, place: u32, lane: u32) {
        while mask != 0 {
            let i = mask.trailing_zeros() as usize % PACKET;
            mask &= mask - 1;
            let Some((t, weights)) = self.ray(i).cross_exactly(block, lane) else { continue };
            if G::IS_ANY {
                state.stop_at_hits(1 << i);
                continue;
            }
            let is_first = self.triangle.0[i].to_bits() == NONE || t < self.t_max.0[i];
            let enters = u32::from(weights[2] > 0.0) << i;
            if is_first || self.those_before(1 << i, place, lane, enters) != 0 {
                self.triangle.0[i] = f32::from_bits(place << 3 | lane);
                for (row, weight) in self.weights.iter_mut().zip(weights) {
                    row.0[i] = weight;
                }
                self.t_max.0[i] = t;
                state.slabs.s_max.0[i] = beyond(t);
            }
        }
        state.end_frustum();
    }
}

/// [`F32Bundle::test_others`] out of line: it is long and rarely called.
struct TestOthers<'s, 'a, 'd, G, R> {
    bundle: &'s mut F32Bundle<'a, 'd, G, R>,
    state: &'s mut State,
    leaf: Option<u32>,
    rays: &'s [R; PACKET],
}

impl<G: Goal, R: PacketRay> Dispatch for TestOthers<'_, '_, '_, G, R> {
    type Output = ();

    #[inline(always)]
    fn run<L: Simd>(self) {
        self.bundle.test_others::<L>(self.state, self.leaf, self.rays);
    }
}

impl<'a, 'd, G: Goal, R: PacketRay> Bundle<'a, 'd> for F32Bundle<'a, 'd, G, R> {
    type Goal = G;
    type Ray = R;
    type Answer = R::Answer;
    const GENERAL: bool = R::GENERAL;
    const NEEDS_BOUNDS: bool = false;
    const MAX_SPREAD: f32 = 0.3;

    #[inline(always)]
    fn new(decider: &'d Decider<'a>) -> Self {
        let row = Row::of(0.0);
        Self {
            decider,
            rows: [row; 8],
            axes: Axes::by_bits(0, 0),
            origin: [row; 3],
            shear: [row; 2],
            minus_inverse: row,
            t_min: row,
            t_max: row,
            triangle: row,
            weights: [row; 3],
            has_one_origin: false,
            others: Vec::new(),
            others_started: false,
            goal: PhantomData,
        }
    }

    // Less than in double precision, since single rays are faster; as much if there are other primitives than
    // triangles.
    #[inline(always)]
    fn effort(has_one_origin: bool) -> WorkBudget {
        match (R::GENERAL, has_one_origin, G::IS_ANY) {
            (false, true, true) => WorkBudget { most: 112, paying: 70 },
            (false, true, false) => WorkBudget { most: 210, paying: 84 },
            (false, false, _) => WorkBudget { most: 50, paying: 40 },
            (true, _, true) => WorkBudget { most: 600, paying: 400 },
            (true, _, false) => WorkBudget { most: 800, paying: 400 },
        }
    }

    #[inline(always)]
    fn load<L: Simd>(&mut self, rays: &[R; PACKET]) {
        // No closures: they do not inherit target features.
        let mut local = [*rays[0].local(); PACKET];
        for (local, ray) in local.iter_mut().zip(rays) {
            *local = *ray.local();
        }
        L::f32_rows(&local, &mut self.rows);
    }

    #[inline(always)]
    fn alike<L: Simd>(&self, one: u32) -> (u32, Signs) {
        let zero = L::F32x16::splat(0.0);
        let plus = L::F32x16::splat(1.0);
        let (x, y, z) = (
            L::F32x16::load(&self.rows[4].0),
            L::F32x16::load(&self.rows[5].0),
            L::F32x16::load(&self.rows[6].0),
        );
        let negative =
            [plus.xor_sign(x).simd_lt(zero), plus.xor_sign(y).simd_lt(zero), plus.xor_sign(z).simd_lt(zero)];
        let (x, y, z) = (x.abs(), y.abs(), z.abs());
        let x_is_last = y.simd_le(x) & z.simd_le(x);
        let y_is_last = z.simd_le(y) & !x_is_last;
        Signs::of(one, negative, x_is_last, y_is_last)
    }

    #[inline(always)]
    fn fill_up<L: Simd>(&mut self, mask: u32) {
        let one = mask.trailing_zeros() as usize % PACKET;
        for row in &mut self.rows {
            let (own, all) = (L::F32x16::splat(row.0[one]), L::F32x16::load(&row.0));
            L::F32x16::select(mask, all, own).store(row);
        }
    }

    #[inline(always)]
    fn start<L: Simd>(&mut self, decider: &Decider, slabs: &mut SlabRows) -> Option<Start<L::F32x16>> {
        let (rows, start, splat) = (&mut self.rows, decider.start, L::F32x16::splat);
        let zero = splat(0.0);
        let (t_min, t_max) = (L::F32x16::load(&rows[3].0), L::F32x16::load(&rows[7].0));
        // As for a single ray: minus zero is negative.
        let is_before = splat(1.0).xor_sign(t_min).simd_lt(zero);
        let mut fits = zero.simd_le(t_min) & t_min.simd_le(t_max) & !is_before;
        let (mut is_long, mut is_near) = (0, true);
        let (x, y, z) =
            (L::F32x16::load(&rows[0].0), L::F32x16::load(&rows[1].0), L::F32x16::load(&rows[2].0));
        let has_one_origin = x.are_equal() & y.are_equal() & z.are_equal();
        self.has_one_origin = has_one_origin;
        let (mut inverse, mut center, mut off) = ([zero; 3], [0.0; 3], [0.0; 3]);
        for axis in 0..3 {
            let direction = L::F32x16::load(&rows[4 + axis].0);
            let length = direction.abs();
            fits &= length.simd_le(splat(start.longest[axis]));
            is_long |= splat(start.shortest).simd_le(length);
            inverse[axis] = (splat(start.space_per_unit) / length.max(splat(start.tiny))).xor_sign(direction);
            inverse[axis].store(&mut slabs.inverse[axis]);
            if has_one_origin {
                let local = (f64::from(rows[axis].0[0]) - start.mesh_origin[axis]) as f32;
                splat(local).store(&mut rows[axis]);
                center[axis] = local * start.units_per_space - start.shift[axis];
                is_near &= center[axis].abs() <= start.farthest[axis];
            } else {
                let local = L::F32x16::load(&rows[axis].0).rounded_less(start.mesh_origin[axis]);
                local.store(&mut rows[axis]);
                let from = local * splat(start.units_per_space) - splat(start.shift[axis]);
                let middle = from.midpoint();
                fits &= from.abs().simd_le(splat(start.farthest[axis]));
                let margins = [start.f32_margin, TreeSpace::F32_MARGIN_PER_DISTANCE];
                slabs.set_axis(axis, from, inverse[axis], margins);
                off[axis] = (from - middle).abs().reduce_max();
                center[axis] = middle.first();
            }
        }
        (fits & is_long == ALL && is_near).then_some(Start {
            inverse,
            range: [t_min, t_max],
            center,
            off,
            // The margin of a single ray, and twice that of its arithmetic among boxes.
            margin_per_distance: TreeSpace::F32_MARGIN_PER_DISTANCE + 2.0 * start.margin_per_distance,
            margin: start.f32_margin + 2.0 * start.margin,
            has_one_origin,
        })
    }

    #[inline(always)]
    fn start_triangles<L: Simd>(
        &mut self,
        decider: &Decider,
        axes: &'static Axes,
        slabs: &SlabRows,
        cull: &mut Cull,
    ) {
        let (splat, order) = (L::F32x16::splat, axes.order());
        let inverse = L::F32x16::load(&slabs.inverse[order[2]].0) * splat(decider.start.units_per_space);
        (splat(0.0) - inverse).store(&mut self.minus_inverse);
        let mut off = [splat(0.0); 3];
        for (place, &axis) in order.iter().enumerate() {
            let origin = L::F32x16::load(&self.rows[axis].0);
            origin.store(&mut self.origin[place]);
            let middle = if self.has_one_origin { origin } else { origin.midpoint() };
            off[place] = origin - middle;
            cull.middle[place] = middle.first();
        }
        for place in 0..2 {
            let shear = L::F32x16::load(&self.rows[4 + order[place]].0) * inverse;
            let middle = shear.midpoint();
            shear.store(&mut self.shear[place]);
            cull.middle_shear[place] = middle.first();
            cull.spread[place] = (shear - middle).abs().reduce_max();
            cull.apart[place] = if self.has_one_origin {
                0.0
            } else {
                off[2].neg_mul_add(shear, off[place]).abs().reduce_max()
            };
        }
        cull.apart[2] = if self.has_one_origin { 0.0 } else { off[2].abs().reduce_max() };
        (self.t_min, self.t_max, self.axes) = (self.rows[3], self.rows[7], axes);
        self.others_started = false;
        splat(f32::from_bits(NONE)).store(&mut self.triangle);
    }

    #[inline(always)]
    fn test_triangle<L: Simd>(
        &mut self,
        state: &mut State,
        _: &Cull,
        (place, block, corners): (u32, &TriangleBlock, &Corners),
        lane: usize,
        _: &CullBounds,
        _: &[R; PACKET],
    ) {
        let own = simd::opaque(self);
        let (load, splat) = (L::F32x16::load, L::F32x16::splat);
        let [kx, ky, kz] = own.axes.order();
        let (ox, oy, oz) = (load(&own.origin[0].0), load(&own.origin[1].0), load(&own.origin[2].0));
        let (sx, sy) = (load(&own.shear[0].0), load(&own.shear[1].0));
        let at = |axis: usize, corner: usize| splat(corners[axis][corner][lane]);
        // As `F32Ray::pass`, with signs flipped.
        let (az, bz, cz) = (oz - at(kz, 0), oz - at(kz, 1), oz - at(kz, 2));
        let ax = (ox - at(kx, 0)) - sx * az;
        let bx = (ox - at(kx, 1)) - sx * bz;
        let cx = (ox - at(kx, 2)) - sx * cz;
        let ay = (oy - at(ky, 0)) - sy * az;
        let by = (oy - at(ky, 1)) - sy * bz;
        let cy = (oy - at(ky, 2)) - sy * cz;
        let (bc, ca, ab) = (cx * by, ax * cy, bx * ay);
        let (u, v, w) = (bc - cy * bx, ca - ay * cx, ab - by * ax);
        let within = within([u, v, w]);
        let mask = splat(0.0).simd_le(within) & state.alive;
        // For any hit, continuing costs less than a branch that is often mispredicted.
        if mask == 0 && !G::IS_ANY {
            return;
        }
        let det = u + v + w;
        let height = u * az + v * bz + w * cz;
        let precise = &own.decider.start.precise;
        let precise = precise.of(mask, bc.max_abs(ca).max_abs(ab), within, det, [az, bz, cz]);
        let t = height / det * load(&own.minus_inverse.0);
        let t_max = load(&own.t_max.0);
        let in_range = mask & precise & load(&own.t_min.0).simd_le(t) & t.simd_le(t_max);
        let uncertain = mask & !precise;
        if G::IS_ANY {
            state.stop_at_hits(in_range);
        } else if in_range != 0 {
            let triangle = load(&self.triangle.0);
            let mut closer = t.simd_lt(t_max) | triangle.with_bits(NONE);
            if in_range & !closer != 0 {
                let enters = splat(0.0).simd_lt(det);
                closer |= self.those_before(in_range & !closer, place, lane as u32, enters);
            }
            let closer = closer & in_range;
            let own = splat(f32::from_bits(place << 3 | lane as u32));
            L::F32x16::select(closer, own, triangle).store(&mut self.triangle);
            for (row, weight) in self.weights.iter_mut().zip([v, w, det]) {
                L::F32x16::select(closer, weight, load(&row.0)).store(row);
            }
            let t_max = L::F32x16::select(closer, t, t_max);
            t_max.store(&mut self.t_max);
            let end = t * splat(BEYOND) + splat(f32::MIN_POSITIVE);
            let s_max = L::F32x16::select(closer, end, load(&state.slabs.s_max.0));
            s_max.store(&mut state.slabs.s_max);
            state.frustum.s_max = s_max.reduce_max();
        }
        if uncertain != 0 {
            self.decide(state, uncertain, block, place, lane as u32);
        }
    }

    #[inline(always)]
    fn test_infinite<L: Simd>(&mut self, state: &mut State, rays: &[R; PACKET]) {
        L::isa().run(TestOthers { bundle: self, state, leaf: None, rays });
    }

    #[inline(always)]
    fn test_leaf<L: Simd>(&mut self, state: &mut State, leaf: u32, rays: &[R; PACKET]) {
        L::isa().run(TestOthers { bundle: self, state, leaf: Some(leaf), rays });
    }

    #[inline(always)]
    fn put<L: Simd>(
        &mut self,
        _: &Decider,
        state: &State,
        rays: &[R; PACKET],
        first: usize,
        sink: &mut impl Sink<R::Answer>,
    ) {
        R::put::<G, L>(self, state, rays, first, sink);
    }
}

impl PacketRay for Ray32 {
    type Answer = Option<Hit32>;
    const GENERAL: bool = false;

    #[inline(always)]
    fn local(&self) -> &Ray32 {
        self
    }

    #[inline(always)]
    fn in_f64(&self) -> Option<&Ray> {
        None
    }

    #[inline(always)]
    fn put<G: Goal, L: Simd>(
        bundle: &mut F32Bundle<'_, '_, G, Self>,
        state: &State,
        _: &[Self; PACKET],
        first: usize,
        sink: &mut impl Sink<Option<Hit32>>,
    ) {
        let decider = bundle.decider;
        if G::IS_ANY {
            return put_chosen(state.chosen, first, |i| (state.met >> i & 1 != 0).then_some(SOME_HIT), sink);
        }
        let load = L::F32x16::load;
        let triangle = load(&bundle.triangle.0);
        let hits = if state.is_among_triangles { state.chosen & !triangle.with_bits(NONE) } else { 0 };
        let row = Row::of(0.0);
        let (mut local, mut id, mut primitive, mut geometry) = ([row; 2], row, row, row);
        if hits != 0 {
            let det = load(&bundle.weights[2].0);
            for (local, weight) in local.iter_mut().zip(&bundle.weights) {
                (load(&weight.0) / det).store(local);
            }
            let mut ids = [L::F32x16::splat(0.0); 3];
            let mut rest = hits;
            while rest != 0 {
                // Many rays may have hit the same triangle.
                let own = bundle.triangle.0[rest.trailing_zeros() as usize % PACKET].to_bits();
                let with_this = triangle.with_bits(own);
                rest &= !with_this;
                let (geometry, primitive) = decider.ids(own >> 3, own & 7);
                let id = decider.tree().geometries[geometry as usize].id;
                for (row, own) in ids.iter_mut().zip([id, primitive, geometry]) {
                    *row = L::F32x16::select(with_this, L::F32x16::splat(f32::from_bits(own)), *row);
                }
            }
            ids[0].store(&mut id);
            ids[1].store(&mut primitive);
            ids[2].store(&mut geometry);
        }
        let hit = |i: usize| Hit32 {
            t: bundle.t_max.0[i],
            local: [local[0].0[i], local[1].0[i]],
            id: id.0[i].to_bits(),
            primitive: primitive.0[i].to_bits(),
            geometry: geometry.0[i].to_bits(),
            instance: Hit32::NO_INSTANCE,
        };
        if hits == ALL {
            sink.put_row(first, |i| Some(hit(i)));
        } else {
            put_chosen(state.chosen, first, |i| (hits >> i & 1 != 0).then(|| hit(i)), sink);
        }
    }
}

impl PacketRay for PictureRay {
    type Answer = Option<Crossing>;
    const GENERAL: bool = true;

    #[inline(always)]
    fn local(&self) -> &Ray32 {
        &self.local
    }

    #[inline(always)]
    fn in_f64(&self) -> Option<&Ray> {
        Some(&self.ray)
    }

    #[inline(always)]
    fn put<G: Goal, L: Simd>(
        bundle: &mut F32Bundle<'_, '_, G, Self>,
        state: &State,
        rays: &[Self; PACKET],
        first: usize,
        sink: &mut impl Sink<Option<Crossing>>,
    ) {
        let decider = bundle.decider;
        let mut rest = state.chosen;
        while rest != 0 {
            let i = rest.trailing_zeros() as usize % PACKET;
            rest &= rest - 1;
            if G::IS_ANY {
                let answer = if state.met >> i & 1 != 0 { Some(Crossing::some()) } else { None };
                sink.put(first + i, Outcome::Certain(answer));
                continue;
            }
            let (ray, triangle) = (&rays[i].ray, bundle.triangle.0[i].to_bits());
            let mut answer = None;
            if state.is_among_triangles && triangle != NONE {
                let [v, w, det] = [0, 1, 2].map(|corner| bundle.weights[corner].0[i]);
                let t = LocalRay::new(rays[i].local).t(bundle.t_max.0[i]);
                let ids = decider.ids(triangle >> 3, triangle & 7);
                answer = Some(Crossing::on_triangle(ids, t, [v / det, w / det], det > 0.0, ray));
            }
            if state.is_among_triangles && bundle.others_started {
                let other = bundle.others[i].nearest.take();
                answer = Crossing::nearer(answer, other, decider.tree(), ray);
            }
            sink.put(first + i, Outcome::Certain(answer));
        }
    }
}

/// Hands out the answers of the rays in the mask.
#[inline(always)]
fn put_chosen(
    mut mask: u32,
    first: usize,
    answer: impl Fn(usize) -> Option<Hit32>,
    sink: &mut impl Sink<Option<Hit32>>,
) {
    if mask == ALL {
        return sink.put_row(first, answer);
    }
    while mask != 0 {
        let i = mask.trailing_zeros() as usize % PACKET;
        mask &= mask - 1;
        sink.put(first + i, Outcome::Certain(answer(i)));
    }
}
