//! The first test of spheres by eight: see [`SphereRay`].

use bytemuck::Zeroable;

use super::{Eight, Lanes, LastEight, Vector, Wide};
use crate::spheres::{SphereBlock, SphereRay};

/// How lines pass spheres.
#[derive(Clone, Copy, Zeroable)]
pub(crate) struct SpherePass<V> {
    /// How far along the line is what is nearest to the centre.
    along: V,
    /// The square of how far from there the centre is.
    beside: V,
    radii: V,
}

/// Where rays meet spheres.
pub(crate) struct SphereCrossings<V> {
    /// A bit for each that is certainly met.
    pub(crate) met: u32,
    /// A bit for each other that may be met.
    pub(crate) unclear: u32,
    /// The first crossing of one that is, or may be, met lies not before this.
    pub(crate) from: V,
    /// That of one that is certainly met, not behind this.
    pub(crate) to: V,
}

/// Spheres, and for each the line that they are tested against.
struct Facing<V> {
    centers: [V; 3],
    radii: V,
    origin: [V; 3],
    direction: [V; 3],
    margin: V,
}

impl<V: Vector> Facing<V> {
    /// A bit for each sphere that its line may cross: none for unused lanes, whose comparisons with a NaN are false.
    #[inline(always)]
    fn pass(&self) -> (u32, SpherePass<V>) {
        let &Self { centers, radii, origin, direction: [ex, ey, ez], margin } = self;
        let x = centers[0] - origin[0];
        let y = centers[1] - origin[1];
        let z = centers[2] - origin[2];
        let along = x.times_plus(ex, y.times_plus(ey, z * ez));
        let px = along.times_from(ex, x);
        let py = along.times_from(ey, y);
        let pz = along.times_from(ez, z);
        let beside = px.times_plus(px, py.times_plus(py, pz * pz));
        let size = radii + margin;
        let mask = V::splat(0.0).at_most(size.times_minus(size, beside));
        (mask, SpherePass { along, beside, radii })
    }
}

impl<W: Wide> SpherePass<W> {
    /// That of one of the two: `which` is 0 or 1.
    #[inline(always)]
    pub(crate) fn half(&self, which: usize) -> SpherePass<W::Half> {
        let Self { along, beside, radii } = self;
        SpherePass { along: along.half(which), beside: beside.half(which), radii: radii.half(which) }
    }
}

/// How a line passes the spheres of a block, and a bit for each that it may cross.
#[inline(always)]
pub(crate) fn pass_spheres<L: Lanes>(block: &SphereBlock, ray: &SphereRay) -> (u32, SpherePass<L::Eight>) {
    let ([x, y, z], [ox, oy, oz], [ex, ey, ez]) = (&block.centers, ray.origin, ray.direction);
    let facing = Facing {
        centers: [L::Eight::load(x), L::Eight::load(y), L::Eight::load(z)],
        radii: L::Eight::load(&block.radii),
        origin: [L::Eight::splat(ox), L::Eight::splat(oy), L::Eight::splat(oz)],
        direction: [L::Eight::splat(ex), L::Eight::splat(ey), L::Eight::splat(ez)],
        margin: L::Eight::splat(ray.margin),
    };
    facing.pass()
}

/// The same of two, each those of its block: eight bits for those of the first, and eight for those of the second.
#[inline(always)]
pub(crate) fn pass_spheres_by_two<L: Lanes>(
    blocks: [&SphereBlock; 2],
    rays: [&SphereRay; 2],
) -> (u32, SpherePass<L::Wide>) {
    let ([a, b], [first, second], last) = (blocks, rays, LastEight::new());
    let splat = L::Wide::splat_two;
    let facing = Facing {
        centers: [
            of_two::<L>(&a.centers[0], &b.centers[0]),
            of_two::<L>(&a.centers[1], &b.centers[1]),
            of_two::<L>(&a.centers[2], &b.centers[2]),
        ],
        radii: of_two::<L>(&a.radii, &b.radii),
        origin: [
            splat(first.origin[0], second.origin[0], last),
            splat(first.origin[1], second.origin[1], last),
            splat(first.origin[2], second.origin[2], last),
        ],
        direction: [
            splat(first.direction[0], second.direction[0], last),
            splat(first.direction[1], second.direction[1], last),
            splat(first.direction[2], second.direction[2], last),
        ],
        margin: splat(first.margin, second.margin, last),
    };
    facing.pass()
}

#[inline(always)]
fn of_two<L: Lanes>(first: &[f32; 8], second: &[f32; 8]) -> L::Wide {
    L::Wide::of_two(L::Eight::load(first), L::Eight::load(second))
}

/// Where a ray meets the spheres that its line passes so, of those in the mask. Where `IS_ANY`, crossings are not placed from behind, which
/// is not asked then.
#[inline(always)]
pub(crate) fn cross_spheres<E: Eight, const IS_ANY: bool>(
    mask: u32,
    pass: &SpherePass<E>,
    ray: &SphereRay,
) -> SphereCrossings<E> {
    let &SpherePass { along, beside, radii } = pass;
    let margin = E::splat(ray.margin);
    let size = radii + margin;
    let half = size.times_minus(size, beside).sqrt();
    let (from, last) = (along - half, along + half);
    let in_range = mask & from.at_most(E::splat(ray.far)) & E::splat(ray.near).at_most(last);
    let inner = radii - margin;
    let rest = inner.times_minus(inner, beside);
    let to = if IS_ANY { along } else { along - rest.sqrt() };
    let is_crossed = E::splat(0.0).below(inner) & E::splat(0.0).at_most(rest);
    let [start, end] = ray.surely_in;
    let met = in_range & is_crossed & E::splat(start).at_most(from) & to.at_most(E::splat(end));
    SphereCrossings { met, unclear: in_range & !met, from, to }
}

/// A bit for each sphere of a block that the ray may hit within its range, among them all that it does; and for each that it certainly
/// hits.
#[inline(always)]
pub(crate) fn meet_spheres<L: Lanes>(block: &SphereBlock, ray: &SphereRay) -> (u32, u32) {
    let (mask, pass) = pass_spheres::<L>(block, ray);
    if mask == 0 {
        return (0, 0);
    }
    let SphereCrossings { met, unclear, .. } = cross_spheres::<L::Eight, true>(mask, &pass, ray);
    (met | unclear, met)
}

/// What [`cross_spheres`] gives at a level where it is not any that is asked for, and [`meet_spheres`], for tests; the first also of two at
/// once.
#[cfg(test)]
pub(crate) fn meet_spheres_at(
    level: super::Level,
    block: &SphereBlock,
    ray: &SphereRay,
) -> ([SphereCrossings<[f32; 8]>; 2], (u32, u32)) {
    struct Spheres<'a>(&'a SphereBlock, &'a SphereRay);
    impl super::Task for Spheres<'_> {
        type Output = ([SphereCrossings<[f32; 8]>; 2], (u32, u32));
        #[inline(always)]
        fn run<L: Lanes>(self) -> Self::Output {
            let Self(block, ray) = self;
            let (mask, pass) = pass_spheres::<L>(block, ray);
            let (both, passes) =
                pass_spheres_by_two::<L>([&SphereBlock::EMPTY, block], [&SphereRay::NONE, ray]);
            assert_eq!(both & L::Eight::ALL, 0);
            let placed = |mask, pass: &SpherePass<L::Eight>| {
                let SphereCrossings { met, unclear, from, to } = cross_spheres::<_, false>(mask, pass, ray);
                SphereCrossings { met, unclear, from: from.to_array(), to: to.to_array() }
            };
            let two = [placed(mask, &pass), placed(both >> 8, &passes.half(1))];
            (two, meet_spheres::<L>(block, ray))
        }
    }
    level.run(Spheres(block, ray))
}
