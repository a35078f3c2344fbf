//! Shapes that rays together may meet.
//!
//! Of the hulls in a leaf, those that none of them can meet are left out eight at a time. Each of the others is tried against all
//! sixteen, by the operations and with the bounds of [`HullRay`](crate::hulls::HullRay), and each shape whose hull is met by each ray
//! that does, in double precision, as alone: so an answer has the same bits.
//!
//! # Why none of the rays loses a hull
//!
//! Let o and e be the start and the direction of the middle ray, by the largest component as there, and o + a and e + b those of
//! another; b is zero on that axis. At a hit at the height h, it is at (o + h e) + (a + h b), and |h| ≤ W + |a| + S, for W the
//! largest coordinate from the hull's centre to o, and S of a point of the hull. So the middle ray is beside the hull at h by no more
//! than |a| (1 + |b|) + |b| (W + S) on each axis, and in the cube by N times that. N is 2¹⁸ times the margin for each unit of distance,
//! and N (W + S) no more than 2¹⁸ times the whole margin, so that planes are moved by that much more, with room for what is rounded;
//! |b| is no more than an eighth.

use lumbre_geometry::{Ray, Root};

use super::{Bundle, CROSSED, Others, Packet, greater};
use crate::GeometryKind;
use crate::collapse::Entry;
use crate::lanes::{self, Lanes, Lines, Row, SureLines, Vector, Wide};
use crate::node::tag;
use crate::packet::PACKET;
use crate::single::{Goal, Outcome, Winner, heights, largest_component, nearest_of};
use crate::traverse;
use crate::triangles::BLOCK;

/// What rays have among shapes.
pub(super) struct AmongShapes {
    /// Whether the rest is known.
    pub(super) is_started: bool,
    lines: Lined,
    middle: Middle,
    /// The last of each one's nearest hits that was of no triangle.
    pub(super) crossed: [Option<Winner>; PACKET],
}

/// The rays, each as a [`HullRay`](crate::hulls::HullRay).
struct Lined {
    origin: [Row<f32>; 3],
    rest: [Row<f32>; 3],
    direction: [Row<f32>; 3],
}

/// The ray in their middle, and what the others are off.
struct Middle {
    origin: [f32; 3],
    direction: [f32; 3],
    /// Where the first begins and the last ends.
    first: f32,
    last: f32,
    /// By how much more planes are moved, for each unit of the margin and of that which is for each unit of distance.
    per_margin: f32,
    per_distance: f32,
}

/// By how much a map is more than the margins for each unit of distance, and by how much these are to make room for what is rounded,
/// and for an eighth in the second of them.
const PER_MARGIN: f32 = (1 << 18) as f32 * 1.01;
const PER_DISTANCE: f32 = (1 << 18) as f32 * 1.2;

impl AmongShapes {
    pub(super) fn new() -> Self {
        let (none, rows) = ([0.0; 3], [Row::of(0.0); 3]);
        let middle = Middle {
            origin: none,
            direction: none,
            first: 0.0,
            last: 0.0,
            per_margin: 0.0,
            per_distance: 0.0,
        };
        let lines = Lined { origin: rows, rest: rows, direction: rows };
        Self { is_started: false, lines, middle, crossed: [None; PACKET] }
    }
}

/// The rays in their ranges.
struct InRange<'a>(&'a Lined, &'a Bundle);

impl<W: Wide> Lines<W> for InRange<'_> {
    #[inline(always)]
    fn origin(&self, axis: usize) -> W {
        W::load(&self.0.origin[axis].0)
    }

    #[inline(always)]
    fn rest(&self, axis: usize) -> W {
        W::load(&self.0.rest[axis].0)
    }

    #[inline(always)]
    fn direction(&self, axis: usize) -> W {
        W::load(&self.0.direction[axis].0)
    }

    #[inline(always)]
    fn range(&self) -> [W; 2] {
        [W::load(&self.1.first.0), W::load(&self.1.last.0)]
    }
}

impl<W: Wide> SureLines<W> for InRange<'_> {
    #[inline(always)]
    fn sure_range(&self) -> [W; 2] {
        [W::load(&self.1.surely_first.0), W::load(&self.1.surely_last.0)]
    }
}

impl<V: Vector> Lines<V> for Middle {
    #[inline(always)]
    fn origin(&self, axis: usize) -> V {
        V::splat(self.origin[axis])
    }

    #[inline(always)]
    fn rest(&self, _: usize) -> V {
        V::splat(0.0)
    }

    #[inline(always)]
    fn direction(&self, axis: usize) -> V {
        V::splat(self.direction[axis])
    }

    #[inline(always)]
    fn range(&self) -> [V; 2] {
        [V::splat(self.first), V::splat(self.last)]
    }

    #[inline(always)]
    fn widened(&self, margin: V, per_distance: V) -> V {
        margin + margin.times_plus(V::splat(self.per_margin), per_distance * V::splat(self.per_distance))
    }
}

impl<'a, const MIXED: bool> Packet<'a, MIXED> {
    /// Tests what has no bounds, which stands before the tree; false where the rays are too far apart for that, or it is more work
    /// than they may do.
    #[inline(always)]
    pub(super) fn meet_infinite<G: Goal, L: Lanes, O: Others<'a, G>>(
        &mut self,
        most_work: u32,
        rays: &[Ray; PACKET],
        others: &mut O,
    ) -> bool {
        let accel = self.exact.accel();
        let infinite = &accel.infinite;
        if infinite.is_empty() {
            return true;
        }
        if !self.start_triangles::<L>() {
            return false;
        }
        for entry in infinite {
            if matches!(accel.geometries[entry.geometry as usize].kind, GeometryKind::Instance(_)) {
                let left = most_work.saturating_sub(self.work);
                if !others.meet_instance::<L, MIXED>(self, entry, left, rays) {
                    return false;
                }
            } else {
                self.meet_entry::<G>(entry, self.alive, rays);
            }
        }
        true
    }

    /// Sets out among shapes.
    #[inline(always)]
    fn start_shapes<L: Lanes>(&mut self) {
        let Self { columns, bundle, exact, shapes: AmongShapes { lines, middle, is_started, .. }, .. } = self;
        let (mut apart, mut spread) = (0.0, 0.0);
        let [_, _, last] = bundle.axes.order();
        let mut inverse = Row::of(0.0);
        for (inverse, length) in inverse.0.iter_mut().zip(&columns[3 + last].0) {
            *inverse = 1.0 / length.abs();
        }
        for axis in 0..3 {
            let (origin, rest) = L::Wide::parted_from(&columns[axis], exact.start.tree_origin[axis]);
            origin.store(&mut lines.origin[axis]);
            rest.store(&mut lines.rest[axis]);
            for i in 0..PACKET {
                lines.direction[axis].0[i] = (columns[3 + axis].0[i] * inverse.0[i]) as f32;
            }
            let direction = L::Wide::load(&lines.direction[axis].0);
            let (from, along) = (origin.middle(), direction.middle());
            (middle.origin[axis], middle.direction[axis]) = (from.first(), along.first());
            apart = greater(apart, ((origin - from).abs() + rest.abs()).most());
            spread = greater(spread, (direction - along).abs().most());
        }
        middle.first = -(L::Wide::splat(0.0) - L::Wide::load(&bundle.first.0)).most();
        (middle.per_margin, middle.per_distance) = (spread * PER_MARGIN, apart * PER_DISTANCE);
        *is_started = true;
    }

    /// Tests a leaf of shapes; false where they have no hulls, or it is of something else.
    #[inline(always)]
    pub(super) fn meet_shapes<G: Goal, L: Lanes>(&mut self, leaf: u32, rays: &[Ray; PACKET]) -> bool {
        if leaf >> tag::SHIFT != tag::SHAPES {
            return false;
        }
        if !self.shapes.is_started {
            self.start_shapes::<L>();
        }
        let accel = self.exact.accel();
        let mut first = (leaf & tag::PLACE) as usize;
        loop {
            let Some((block, goes_on)) = accel.hulls.block(first) else { return false };
            let entries = &accel.tree.entries[first..];
            self.shapes.middle.last = L::Wide::load(&self.bundle.last.0).most();
            let (mut hulls, near) = lanes::pass_hulls::<L>(block, lanes::opaque(&self.shapes.middle));
            self.work += 2 + 3 * hulls.count_ones();
            while hulls != 0 {
                let lane = if G::IS_ANY { hulls.trailing_zeros() as usize } else { nearest_of(hulls, &near) };
                hulls &= !(1 << lane);
                let lines = &InRange(&self.shapes.lines, &self.bundle);
                let (those, sure) = if G::IS_ANY {
                    lanes::meet_one_hull::<L::Wide, true>(block, lane, lines)
                } else {
                    lanes::meet_one_hull::<L::Wide, false>(block, lane, lines)
                };
                self.met |= sure & self.alive;
                self.alive &= !sure;
                let those = those & self.alive;
                if those != 0 {
                    self.meet_entry::<G>(&entries[lane], those, rays);
                }
                if self.alive == 0 {
                    return true;
                }
            }
            if !goes_on {
                return true;
            }
            first += BLOCK;
        }
    }

    /// Tests these rays against what is no triangle, in double precision.
    fn meet_entry<G: Goal>(&mut self, entry: &Entry, mut those: u32, rays: &[Ray; PACKET]) {
        let names @ (geometry, primitive) = (entry.geometry, entry.primitive());
        let kind = &self.exact.accel().geometries[geometry as usize].kind;
        while those != 0 {
            let i = those.trailing_zeros() as usize % PACKET;
            those &= those - 1;
            if !G::IS_ANY {
                if let Some(root) = traverse::first_crossing(kind, primitive, &rays[i]) {
                    self.meet_root(root, names, i, &rays[i]);
                }
            } else if traverse::is_crossed(kind, primitive, &rays[i]) {
                self.met |= 1 << i;
                self.alive &= !(1 << i);
            }
        }
        if !G::IS_ANY {
            self.end_frustum();
        }
    }

    /// Takes a crossing of what is no triangle, if it is the nearest of that ray.
    #[inline(always)]
    fn meet_root(&mut self, root: Root, names: (u32, u32), i: usize, ray: &Ray) {
        let heights @ (from, to) = heights(root.t, largest_component(ray));
        // Also keeps out a NaN.
        if !ray.contains(root.t) || from > self.to.0[i] {
            return;
        }
        let is_nearer =
            if to < self.from.0[i] { Outcome::Settled(true) } else { self.is_better(ray, i, root.t, names) };
        match is_nearer {
            Outcome::Settled(false) => {}
            Outcome::Settled(true) => {
                let (geometry, primitive) = names;
                self.shapes.crossed[i] = Some(Winner { root, geometry, primitive });
                self.keep(i, heights, CROSSED);
            }
            Outcome::Unsettled => self.give_up(i),
        }
    }
}
