//! The first test of hulls: eight of them against a ray, or one against sixteen rays.

use super::{Eight, Lanes, LastEight, Row, Vector, WIDE, Wide};
use crate::hulls::{
    HullBlock, HullRay, LEAST_COMPONENT, LEAST_TOLERANCE, LEAST_TUBE_ERROR, TOLERANCE_PER_MARGIN,
    TUBE_ERROR_PER_MARGIN,
};
use crate::triangles::{BLOCK, HeightRange};

/// What came of eight hulls.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MetHulls {
    /// A bit for each that the ray may meet within the range: among them all whose shapes it does.
    pub(crate) mask: u32,
    /// A bit for each whose shape it certainly does meet, where that was asked.
    pub(crate) sure: u32,
    /// No shape among them is met at a lesser height.
    pub(crate) near: [f32; BLOCK],
}

impl MetHulls {
    pub(crate) const NONE: Self = Self { mask: 0, sure: 0, near: [0.0; BLOCK] };
}

/// Hulls, side by side: see [`HullBlock`].
trait Bodies<V> {
    fn center(&self, axis: usize) -> V;
    fn row(&self, axis: usize) -> [V; 3];
    fn height(&self) -> V;
    fn profile(&self) -> [V; 3];
    fn tube(&self) -> V;
    fn margins(&self) -> [V; 2];
}

/// Lines in their ranges, side by side: see [`HullRay`] and [`HeightRange`].
pub(crate) trait Lines<V> {
    fn origin(&self, axis: usize) -> V;
    fn rest(&self, axis: usize) -> V;
    fn direction(&self, axis: usize) -> V;
    /// Where they begin and end at the farthest.
    fn range(&self) -> [V; 2];
    /// By how much planes are moved outwards, of hulls with this margin, of which so much is for each unit of distance.
    #[inline(always)]
    fn widened(&self, margin: V, _per_distance: V) -> V {
        margin
    }
}

/// Lines of which more is known.
pub(crate) trait SureLines<V>: Lines<V> {
    /// Where they have surely begun, and not yet ended.
    fn sure_range(&self) -> [V; 2];
}

/// The hulls of a block.
struct AllHulls<'a>(&'a HullBlock);

impl<V: Eight> Bodies<V> for AllHulls<'_> {
    #[inline(always)]
    fn center(&self, axis: usize) -> V {
        V::load(&self.0.centers[axis])
    }

    #[inline(always)]
    fn row(&self, axis: usize) -> [V; 3] {
        let row = &self.0.rows[axis];
        [V::load(&row[0]), V::load(&row[1]), V::load(&row[2])]
    }

    #[inline(always)]
    fn height(&self) -> V {
        V::load(&self.0.heights)
    }

    #[inline(always)]
    fn profile(&self) -> [V; 3] {
        let profile = &self.0.profiles;
        [V::load(&profile[0]), V::load(&profile[1]), V::load(&profile[2])]
    }

    #[inline(always)]
    fn tube(&self) -> V {
        V::load(&self.0.tubes)
    }

    #[inline(always)]
    fn margins(&self) -> [V; 2] {
        [V::load(&self.0.margins), V::load(&self.0.least_margins)]
    }
}

/// The hulls of two blocks: those of the first, and those of the second.
struct TwoBlocks<'a>([&'a HullBlock; 2]);

impl TwoBlocks<'_> {
    #[inline(always)]
    fn load<V: Wide>(&self, row: impl Fn(&HullBlock) -> &[f32; BLOCK]) -> V {
        let Self([first, second]) = self;
        V::of_two(V::Half::load(row(first)), V::Half::load(row(second)))
    }
}

impl<V: Wide> Bodies<V> for TwoBlocks<'_> {
    #[inline(always)]
    fn center(&self, axis: usize) -> V {
        self.load(
            #[inline(always)]
            |block| &block.centers[axis],
        )
    }

    #[inline(always)]
    fn row(&self, axis: usize) -> [V; 3] {
        [
            self.load(
                #[inline(always)]
                |block| &block.rows[axis][0],
            ),
            self.load(
                #[inline(always)]
                |block| &block.rows[axis][1],
            ),
            self.load(
                #[inline(always)]
                |block| &block.rows[axis][2],
            ),
        ]
    }

    #[inline(always)]
    fn height(&self) -> V {
        self.load(
            #[inline(always)]
            |block| &block.heights,
        )
    }

    #[inline(always)]
    fn profile(&self) -> [V; 3] {
        [
            self.load(
                #[inline(always)]
                |block| &block.profiles[0],
            ),
            self.load(
                #[inline(always)]
                |block| &block.profiles[1],
            ),
            self.load(
                #[inline(always)]
                |block| &block.profiles[2],
            ),
        ]
    }

    #[inline(always)]
    fn tube(&self) -> V {
        self.load(
            #[inline(always)]
            |block| &block.tubes,
        )
    }

    #[inline(always)]
    fn margins(&self) -> [V; 2] {
        [
            self.load(
                #[inline(always)]
                |block| &block.margins,
            ),
            self.load(
                #[inline(always)]
                |block| &block.least_margins,
            ),
        ]
    }
}

/// A hull, in a lane of a block below eight.
struct OneHull<'a>(&'a HullBlock, usize);

impl<V: Vector> Bodies<V> for OneHull<'_> {
    #[inline(always)]
    fn center(&self, axis: usize) -> V {
        V::splat(self.0.centers[axis][self.1])
    }

    #[inline(always)]
    fn row(&self, axis: usize) -> [V; 3] {
        let row = &self.0.rows[axis];
        [V::splat(row[0][self.1]), V::splat(row[1][self.1]), V::splat(row[2][self.1])]
    }

    #[inline(always)]
    fn height(&self) -> V {
        V::splat(self.0.heights[self.1])
    }

    #[inline(always)]
    fn profile(&self) -> [V; 3] {
        let profile = &self.0.profiles;
        [V::splat(profile[0][self.1]), V::splat(profile[1][self.1]), V::splat(profile[2][self.1])]
    }

    #[inline(always)]
    fn tube(&self) -> V {
        V::splat(self.0.tubes[self.1])
    }

    #[inline(always)]
    fn margins(&self) -> [V; 2] {
        [V::splat(self.0.margins[self.1]), V::splat(self.0.least_margins[self.1])]
    }
}

/// A ray.
struct OneLine<'a>(&'a HullRay, &'a HeightRange);

impl<V: Vector> Lines<V> for OneLine<'_> {
    #[inline(always)]
    fn origin(&self, axis: usize) -> V {
        V::splat(self.0.origin[axis])
    }

    #[inline(always)]
    fn rest(&self, axis: usize) -> V {
        V::splat(self.0.rest[axis])
    }

    #[inline(always)]
    fn direction(&self, axis: usize) -> V {
        V::splat(self.0.direction[axis])
    }

    #[inline(always)]
    fn range(&self) -> [V; 2] {
        [V::splat(self.1.first), V::splat(self.1.last)]
    }
}

impl<V: Vector> SureLines<V> for OneLine<'_> {
    #[inline(always)]
    fn sure_range(&self) -> [V; 2] {
        [V::splat(self.1.surely_first), V::splat(self.1.surely_last)]
    }
}

/// Two rays, each for eight.
struct TwoLines<'a> {
    rays: [&'a HullRay; 2],
    ranges: [&'a HeightRange; 2],
    last: LastEight,
}

impl TwoLines<'_> {
    #[inline(always)]
    fn splat<V: Wide>(&self, [first, second]: [f32; 2]) -> V {
        V::splat_two(first, second, self.last)
    }
}

impl<V: Wide> Lines<V> for TwoLines<'_> {
    #[inline(always)]
    fn origin(&self, axis: usize) -> V {
        self.splat([self.rays[0].origin[axis], self.rays[1].origin[axis]])
    }

    #[inline(always)]
    fn rest(&self, axis: usize) -> V {
        self.splat([self.rays[0].rest[axis], self.rays[1].rest[axis]])
    }

    #[inline(always)]
    fn direction(&self, axis: usize) -> V {
        self.splat([self.rays[0].direction[axis], self.rays[1].direction[axis]])
    }

    #[inline(always)]
    fn range(&self) -> [V; 2] {
        let [first, second] = self.ranges;
        [self.splat([first.first, second.first]), self.splat([first.last, second.last])]
    }
}

impl<V: Wide> SureLines<V> for TwoLines<'_> {
    #[inline(always)]
    fn sure_range(&self) -> [V; 2] {
        let [first, second] = self.ranges;
        [
            self.splat([first.surely_first, second.surely_first]),
            self.splat([first.surely_last, second.surely_last]),
        ]
    }
}

/// What lines have between the planes of cubes.
struct Passages<V> {
    /// Where they start in the cubes, and whither they go.
    p: [V; 3],
    d: [V; 3],
    margin: V,
    enters: V,
    leaves: V,
    /// The same within their ranges.
    from: V,
    to: V,
    /// A bit for each that is not there.
    missed: u32,
}

/// From centres to where lines start, on an axis.
#[inline(always)]
fn offset<V: Vector>(bodies: &impl Bodies<V>, lines: &impl Lines<V>, axis: usize) -> V {
    (lines.origin(axis) - bodies.center(axis)) + lines.rest(axis)
}

/// Lines between the planes of cubes.
#[inline(always)]
fn pass<V: Vector>(bodies: &impl Bodies<V>, lines: &impl Lines<V>) -> Passages<V> {
    let (zero, one) = (V::splat(0.0), V::splat(1.0));
    let w = [offset(bodies, lines, 0), offset(bodies, lines, 1), offset(bodies, lines, 2)];
    let distance = w[0].abs().max(w[1].abs().max(w[2].abs()));
    let [per_distance, least_margin] = bodies.margins();
    let margin = per_distance.times_plus(distance, least_margin);
    let least = per_distance * V::splat(LEAST_COMPONENT);
    let around = lines.widened(margin, per_distance);
    let half = [one + around, bodies.height() + around, one + around];
    let (mut p, mut d) = ([zero; 3], [zero; 3]);
    let (mut near, mut far) = ([zero; 3], [zero; 3]);
    for axis in 0..3 {
        let [x, y, z] = bodies.row(axis);
        p[axis] = x.times_plus(w[0], y.times_plus(w[1], z * w[2]));
        d[axis] = x.times_plus(lines.direction(0), y.times_plus(lines.direction(1), z * lines.direction(2)));
        let inverse = one.over(least.max(d[axis].abs()));
        let at = p[axis].turned_by(d[axis]);
        near[axis] = (zero - (at + half[axis])) * inverse;
        far[axis] = (half[axis] - at) * inverse;
    }
    let enters = near[0].max(near[1]).max(near[2]);
    let leaves = far[0].min(far[1]).min(far[2]);
    let [first, last] = lines.range();
    let (from, to) = (enters.max(first), leaves.min(last));
    // Every comparison with a NaN is false, so that what is none is met.
    Passages { p, d, margin, enters, leaves, from, to, missed: to.below(from) }
}

/// What lines have in hulls: `p + k d` for k from -1 to 1, at the heights `middle + k reach`.
struct Chords<V> {
    p: [V; 3],
    d: [V; 3],
    middle: V,
    reach: V,
    margin: V,
    from: V,
    /// A bit for each that may be met, as far as is seen without a look at tubes: among them all that are.
    mask: u32,
    /// A bit for each that certainly is met, tubes left aside, where that was asked.
    sure: u32,
    /// A bit for each whose line certainly is outside somewhere, alike.
    outside: u32,
}

/// Lines in hulls, between the planes of whose cubes they pass; with `SURE`, also what is certain: see [`HullRay`].
#[inline(always)]
fn look_into<V: Vector, const SURE: bool>(
    bodies: &impl Bodies<V>,
    lines: &impl SureLines<V>,
    passages: &Passages<V>,
) -> Chords<V> {
    let &Passages { p, d, margin, enters, leaves, from, to, missed } = passages;
    let (zero, half, one) = (V::splat(0.0), V::splat(0.5), V::splat(1.0));
    let (middle, reach) = (half * (from + to), half * (to - from));
    let [px, py, pz] =
        [middle.times_plus(d[0], p[0]), middle.times_plus(d[1], p[1]), middle.times_plus(d[2], p[2])];
    let [dx, dy, dz] = [reach * d[0], reach * d[1], reach * d[2]];
    let [c, linear, e] = bodies.profile();
    let tolerance =
        (V::splat(TOLERANCE_PER_MARGIN) * margin).times_plus(one + margin, V::splat(LEAST_TOLERANCE));
    let a = dx.times_plus(dx, dy.times_plus(dy, c * dz * dz));
    let slope = c.times_plus(pz, half * linear);
    let b = px.times_plus(dx, py.times_plus(dy, slope * dz));
    let k = px.times_plus(px, py.times_plus(py, c.times_plus(pz, linear).times_plus(pz, e)));
    let twice = b + b;
    let (first, last) = (k + (a - twice), k + (a + twice));
    let is_beside_between = a.at_most(b.abs()) | (b * b).below((k - tolerance) * a);
    let is_beside = tolerance.below(first) & tolerance.below(last) & is_beside_between;
    let mask = !(missed | is_beside) & V::ALL;
    let mut chords =
        Chords { p: [px, py, pz], d: [dx, dy, dz], middle, reach, margin, from, mask, sure: 0, outside: 0 };
    if SURE {
        let [start, end] = lines.sure_range();
        let comes = start.below(enters) | tolerance.below(first);
        let goes = leaves.below(end) | tolerance.below(last);
        chords.outside = comes | goes;
        let deep = one - margin;
        // Some place between the ends, near to where the parabola is least.
        let least_at = ((zero - b).over(a)).max(zero - one).min(one);
        let least = least_at.times_plus(least_at.times_plus(a, twice), k);
        let x = least_at.times_plus(dx, px).abs();
        let y = least_at.times_plus(dy, py).abs();
        let z = least_at.times_plus(dz, pz).abs();
        let height = least_at.times_plus(reach, middle);
        let is_inside = x.max(y).max(z).at_most(deep)
            & start.at_most(height)
            & height.at_most(end)
            & least.below(zero - tolerance)
            & bodies.tube().below(zero);
        chords.sure = is_inside & chords.outside & mask;
    }
    chords
}

/// What is seen of a tube from sixteen places on a chord.
struct SeenTube {
    /// Whether none of it is met in between, either.
    misses: bool,
    /// Whether a place that is surely in range is surely inside.
    is_inside: bool,
    /// The same for outside.
    is_outside: bool,
}

/// k of places on a chord: the middles of pieces of equal lengths.
static MIDDLES: Row<f32> = {
    let mut middles = [0.0; WIDE];
    let mut i = 0;
    while i < WIDE {
        middles[i] = (2 * i + 1) as f32 / WIDE as f32 - 1.0;
        i += 1;
    }
    Row(middles)
};

/// One of [`Chords`].
struct Chord {
    p: [f32; 3],
    d: [f32; 3],
    middle: f32,
    reach: f32,
    margin: f32,
}

impl Chord {
    /// Looks at a tube of this radius; `start` and `end` are between which the line surely is in its range.
    #[inline(always)]
    fn meet_tube<W: Wide>(&self, tube: f32, [start, end]: [f32; 2]) -> SeenTube {
        let Self { p: [px, py, pz], d: [dx, dy, dz], .. } = *self;
        let error = TUBE_ERROR_PER_MARGIN * self.margin + LEAST_TUBE_ERROR;
        // In the space of x, y and r z.
        let (pz, dz) = (tube * pz, tube * dz);
        let half_piece = (dx * dx + dy * dy + dz * dz).sqrt() * ((1.0 + 1e-6) / WIDE as f32);
        let splat = W::splat;
        let k = W::load(&MIDDLES.0);
        let x = k.times_plus(splat(dx), splat(px));
        let y = k.times_plus(splat(dy), splat(py));
        let z = k.times_plus(splat(dz), splat(pz));
        let from_circle = x.times_plus(x, y * y).sqrt() - splat(1.0 - tube);
        let out = from_circle.times_plus(from_circle, z * z).sqrt() - splat(tube);
        let height = k.times_plus(splat(self.reach), splat(self.middle));
        let in_range = splat(start).at_most(height) & height.at_most(splat(end));
        SeenTube {
            misses: splat(half_piece + error).below(out) == W::ALL,
            is_inside: out.below(splat(-error)) & in_range != 0,
            is_outside: splat(error).below(out) & in_range != 0,
        }
    }
}

impl<V: Vector> Chords<V> {
    /// Looks closer at those that pass tubes: a bit for each that may be met, among them all that are, and for each that certainly is.
    /// `bodies` and `lines` are what these are of.
    #[inline(always)]
    fn meet_tubes<W: Wide, const SURE: bool>(
        &self,
        bodies: &impl Bodies<V>,
        lines: &impl SureLines<V>,
    ) -> (u32, u32) {
        let (mut mask, mut sure) = (self.mask, self.sure);
        let tubes = bodies.tube();
        let mut rings = V::splat(0.0).below(tubes) & mask;
        if rings == 0 {
            return (mask, sure);
        }
        let [px, py, pz] = [self.p[0].to_array(), self.p[1].to_array(), self.p[2].to_array()];
        let [dx, dy, dz] = [self.d[0].to_array(), self.d[1].to_array(), self.d[2].to_array()];
        let (middle, reach) = (self.middle.to_array(), self.reach.to_array());
        let (margin, tubes) = (self.margin.to_array(), tubes.to_array());
        let [start, end] = lines.sure_range();
        let (start, end) = (start.to_array(), end.to_array());
        while rings != 0 {
            let i = rings.trailing_zeros() as usize % V::COUNT;
            rings &= rings - 1;
            let chord = Chord {
                p: [px[i], py[i], pz[i]],
                d: [dx[i], dy[i], dz[i]],
                middle: middle[i],
                reach: reach[i],
                margin: margin[i],
            };
            let seen = chord.meet_tube::<W>(tubes[i], [start[i], end[i]]);
            mask &= !(u32::from(seen.misses) << i);
            let is_outside = seen.is_outside || self.outside >> i & 1 == 1;
            if SURE && seen.is_inside && is_outside {
                sure |= 1 << i;
            }
        }
        (mask, sure)
    }
}

/// Tries a ray against the hulls of a block; with `SURE`, also what is certain: see [`HullRay`].
#[inline(always)]
pub(crate) fn meet_hulls<L: Lanes, const SURE: bool>(
    block: &HullBlock,
    ray: &HullRay,
    range: &HeightRange,
) -> MetHulls {
    let (hulls, line) = (AllHulls(block), OneLine(ray, range));
    let passages = pass::<L::Eight>(&hulls, &line);
    if passages.missed == <L::Eight as Vector>::ALL {
        return MetHulls::NONE;
    }
    let chords = look_into::<L::Eight, SURE>(&hulls, &line, &passages);
    if chords.mask == 0 {
        return MetHulls::NONE;
    }
    let (mask, sure) = chords.meet_tubes::<L::Wide, SURE>(&hulls, &line);
    MetHulls { mask, sure, near: chords.from.to_array() }
}

/// The same without a branch, and without a look at tubes: beside it stands a bit for each ring that has yet to be looked at.
#[inline(always)]
fn glance_at_hulls<L: Lanes, const SURE: bool>(
    block: &HullBlock,
    ray: &HullRay,
    range: &HeightRange,
) -> (MetHulls, u32) {
    let (hulls, line) = (AllHulls(block), OneLine(ray, range));
    let passages = pass::<L::Eight>(&hulls, &line);
    let Chords { mask, sure, from, .. } = look_into::<L::Eight, SURE>(&hulls, &line, &passages);
    let tubes: L::Eight = hulls.tube();
    (MetHulls { mask, sure, near: from.to_array() }, L::Eight::splat(0.0).below(tubes) & mask)
}

/// What came of a glance at eight hulls, and at eight others: a bit for each of the first, and for each of the others.
pub(crate) struct Glanced {
    /// As [`MetHulls::mask`] and [`MetHulls::sure`].
    pub(crate) mask: u32,
    pub(crate) sure: u32,
    /// Rings of the mask: they have yet to be looked at.
    pub(crate) rings: u32,
    /// As [`MetHulls::near`].
    pub(crate) near: [[f32; BLOCK]; 2],
}

impl Glanced {
    pub(crate) const NOTHING: Self = Self { mask: 0, sure: 0, rings: 0, near: [[0.0; BLOCK]; 2] };
}

/// [`glance_at_hulls`] of two rays, each with the hulls of its block.
#[inline(always)]
pub(crate) fn glance_by_two<L: Lanes, const SURE: bool>(
    blocks: [&HullBlock; 2],
    rays: [&HullRay; 2],
    ranges: [&HeightRange; 2],
) -> Glanced {
    if !L::MEETS_BY_TWO {
        let (first, rings) = glance_at_hulls::<L, SURE>(blocks[0], rays[0], ranges[0]);
        let (second, others) = glance_at_hulls::<L, SURE>(blocks[1], rays[1], ranges[1]);
        return Glanced {
            mask: first.mask | second.mask << BLOCK,
            sure: first.sure | second.sure << BLOCK,
            rings: rings | others << BLOCK,
            near: [first.near, second.near],
        };
    }
    let (hulls, lines) = (TwoBlocks(blocks), TwoLines { rays, ranges, last: LastEight::new() });
    let passages = pass::<L::Wide>(&hulls, &lines);
    let Chords { mask, sure, from, .. } = look_into::<L::Wide, SURE>(&hulls, &lines, &passages);
    let tubes: L::Wide = hulls.tube();
    let rings = L::Wide::splat(0.0).below(tubes) & mask;
    Glanced { mask, sure, rings, near: bytemuck::cast(from.to_array()) }
}

/// Which of the cubes of a block lines may pass, a bit for each, and no sooner than where; by `lines` that stand for more.
#[inline(always)]
pub(crate) fn pass_hulls<L: Lanes>(block: &HullBlock, lines: &impl Lines<L::Eight>) -> (u32, [f32; BLOCK]) {
    let passages = pass(&AllHulls(block), lines);
    (!passages.missed & L::Eight::ALL, passages.from.to_array())
}

/// Tries sixteen rays against the hull in a lane: a bit for each that may meet it within its range, among them all that do, and for
/// each that certainly does, where that is asked.
#[inline(always)]
pub(crate) fn meet_one_hull<W: Wide, const SURE: bool>(
    block: &HullBlock,
    lane: usize,
    lines: &impl SureLines<W>,
) -> (u32, u32) {
    let hull = OneHull(block, lane % BLOCK);
    let passages = pass::<W>(&hull, lines);
    if passages.missed == W::ALL {
        return (0, 0);
    }
    look_into::<W, SURE>(&hull, lines, &passages).meet_tubes::<W, SURE>(&hull, lines)
}

/// What [`glance_by_two`] gives at a level of two blocks, and what [`glance_at_hulls`] gives of each: masks, those that are certain, rings,
/// and how near what is in the mask is; for tests.
#[cfg(test)]
pub(crate) fn glances_at(
    level: super::Level,
    blocks: [&HullBlock; 2],
    rays: [&HullRay; 2],
    ranges: [&HeightRange; 2],
) -> [[Glance; 2]; 2] {
    struct Glancing<'a>([&'a HullBlock; 2], [&'a HullRay; 2], [&'a HeightRange; 2]);
    impl super::Task for Glancing<'_> {
        type Output = [[Glance; 2]; 2];
        #[inline(always)]
        fn run<L: Lanes>(self) -> Self::Output {
            let Self(blocks, rays, ranges) = self;
            let glance = |mask: u32, sure, rings, near: &[f32; BLOCK]| {
                let near = std::array::from_fn(|lane| (mask >> lane & 1) * near[lane].to_bits());
                ([mask, sure, rings], near)
            };
            let Glanced { mask, sure, rings, near } = glance_by_two::<L, true>(blocks, rays, ranges);
            let unsure = glance_by_two::<L, false>(blocks, rays, ranges);
            assert_eq!((unsure.mask, unsure.sure, unsure.rings), (mask, 0, rings));
            let together = [
                glance(mask & L::Eight::ALL, sure & L::Eight::ALL, rings & L::Eight::ALL, &near[0]),
                glance(mask >> BLOCK, sure >> BLOCK, rings >> BLOCK, &near[1]),
            ];
            let alone = [0, 1].map(|which| {
                let (MetHulls { mask, sure, near }, rings) =
                    glance_at_hulls::<L, true>(blocks[which], rays[which], ranges[which]);
                glance(mask, sure, rings, &near)
            });
            [together, alone]
        }
    }
    level.run(Glancing(blocks, rays, ranges))
}

/// See [`glances_at`].
#[cfg(test)]
type Glance = ([u32; 3], [u32; BLOCK]);

/// What [`meet_hulls`] gives at a level, for tests.
#[cfg(test)]
pub(crate) fn meet_hulls_at(
    level: super::Level,
    block: &HullBlock,
    ray: &HullRay,
    range: &HeightRange,
) -> MetHulls {
    struct Hulls<'a>(&'a HullBlock, &'a HullRay, &'a HeightRange);
    impl super::Task for Hulls<'_> {
        type Output = MetHulls;
        #[inline(always)]
        fn run<L: Lanes>(self) -> Self::Output {
            let met = meet_hulls::<L, true>(self.0, self.1, self.2);
            let same = meet_hulls::<L, false>(self.0, self.1, self.2);
            assert_eq!((same.mask, same.sure), (met.mask, 0));
            // At a glance, all but what is seen of rings by a closer look.
            let (glanced, rings) = glance_at_hulls::<L, true>(self.0, self.1, self.2);
            assert_eq!((glanced.mask & !rings, glanced.sure), (met.mask & !rings, met.sure & !rings));
            assert_eq!(met.mask & !glanced.mask, 0);
            (0..BLOCK).filter(|lane| met.mask >> lane & 1 != 0).for_each(|lane| {
                assert_eq!(glanced.near[lane].to_bits(), met.near[lane].to_bits());
            });
            met
        }
    }
    level.run(Hulls(block, ray, range))
}
