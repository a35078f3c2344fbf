//! Decides in double precision what single precision leaves uncertain.
//!
//! A hit that is certain in single precision (see [`BlockRay`]) is kept as its position in the tree and an interval of
//! heights around it. Double precision decides three questions: whether a ray near an edge or the end of its range hits
//! a triangle, which of two hits is nearer if their intervals overlap, and, once per ray, what the closest hit is
//! exactly.

use lumbre_geometry::{Ray, Root};
use lumbre_math::DVec3;

use super::{IN_INSTANCE, Outcome, Winner, edges, largest_component, meets_front, precedes};
use crate::intersect::watertight::{self, EdgeTest, Inside, Meeting, Shear};
use crate::intersect::{Axes, Simd};
use crate::simd;
use crate::tree::BLOCK;
use crate::tree::filter_start::FilterStart;
use crate::tree::node::Node;
use crate::tree::triangle_block::{Blocks, TriangleBlock};
use crate::tree::{GeometryKind, Tree};

/// The closest hit so far in single precision: the position of a triangle in the tree, or a mark for other primitives,
/// and the interval of heights along the ray that contains the crossing.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Candidate {
    pub(crate) block: u32,
    pub(crate) lane: u32,
    pub(crate) from: f32,
    pub(crate) to: f32,
}

impl Candidate {
    pub(crate) const NONE: Self = Self { block: u32::MAX, lane: 0, from: f32::INFINITY, to: f32::INFINITY };
    /// Marks a hit known in double precision: no triangle, or one that a query was asked about.
    const EXACT: u32 = u32::MAX - 1;

    /// A crossing that is known in double precision.
    #[inline(always)]
    pub(crate) fn exact((from, to): (f32, f32)) -> Self {
        Self { block: Self::EXACT, lane: 0, from, to }
    }

    #[inline(always)]
    pub(crate) fn is_some(&self) -> bool {
        self.block != u32::MAX
    }

    #[inline(always)]
    pub(crate) fn is_exact(&self) -> bool {
        self.block == Self::EXACT
    }

    /// The largest possible `t` of the hit.
    #[inline(always)]
    pub(crate) fn limit(&self, ray: &Ray) -> f64 {
        if !self.is_some() {
            return ray.t_max;
        }
        // Rounds the whole computation upwards.
        const UP: f64 = 1.0 + 4.0 * f64::EPSILON;
        let limit = f64::from(self.to) / largest_component(ray) * UP;
        if limit < ray.t_max { limit } else { ray.t_max }
    }
}

/// The interval of heights that contains a crossing in double precision, for a direction whose largest component has
/// this length.
#[inline(always)]
pub(crate) fn heights(t: f64, length: f64) -> (f32, f32) {
    let height = (t * length) as f32;
    let error = height.abs() * watertight::ROUNDINGS + f32::MIN_POSITIVE;
    (height - error, height + error)
}

/// Whether the ray, in the space of a tree, meets the front of its hit in the instance that `route` leads to. `None` if
/// only the exact traversal can decide.
#[cold]
#[inline(never)]
pub(crate) fn enters(
    mut tree: &Tree,
    ray: &Ray,
    route: &[u32],
    &Winner { ref root, geometry, primitive }: &Winner,
) -> Option<bool> {
    let mut ray = *ray;
    for &position in route {
        let GeometryKind::Instance(instance) = &tree.geometries[position as usize].kind else { return None };
        ray = instance.world_from_object.object_ray(&ray);
        tree = &instance.tree;
    }
    let kind = &tree.geometries[geometry as usize].kind;
    let meeting = match kind {
        GeometryKind::Shape(_) | GeometryKind::Spheres(_) | GeometryKind::Custom(_) => {
            return Some(meets_front(kind, primitive, &ray, root));
        }
        GeometryKind::PreciseMesh(_) => edges::intersect_precise(tree, &ray, geometry, primitive),
        GeometryKind::Mesh(mesh) => {
            let shear = Shear::new(&ray.direction);
            let origin = shear.local_origin(&ray.origin, &mesh.origin);
            let corners = mesh.indices[primitive as usize].map(|vertex| {
                shear.axes.permute(&mesh.positions[vertex as usize].as_dvec3()).map(|x| x as f32)
            });
            watertight::intersect(&ray, shear, origin, corners)
        }
        GeometryKind::Instance(_) => return None,
    };
    match meeting {
        Meeting::Hit { is_front, .. } => Some(is_front),
        Meeting::Miss | Meeting::Touch { .. } => None,
    }
}

/// A tree and the double-precision decisions about its triangles.
#[derive(Clone, Copy)]
pub(crate) struct Decider<'a> {
    tree: &'a Tree,
    pub(crate) start: &'a FilterStart,
    // Those of the tree, which may be mapped from a file.
    blocks: Blocks<'a>,
}

impl<'a> Decider<'a> {
    #[inline(always)]
    pub(crate) fn new(tree: &'a Tree, start: &'a FilterStart) -> Self {
        Self { tree, start, blocks: tree.packed.blocks() }
    }

    #[inline(always)]
    pub(crate) fn tree(&self) -> &'a Tree {
        self.tree
    }

    #[inline(always)]
    pub(crate) fn block(&self, place: u32) -> &'a TriangleBlock {
        self.blocks.block(place)
    }

    #[inline(always)]
    pub(crate) fn blocks(&self) -> Blocks<'a> {
        self.blocks
    }

    #[inline(always)]
    pub(crate) fn nodes(&self) -> &'a [Node] {
        &self.tree.packed.nodes
    }

    /// Geometry and primitive of a triangle.
    #[inline(always)]
    pub(crate) fn ids(&self, block: u32, lane: u32) -> (u32, u32) {
        self.ids_in(self.block(block), lane)
    }

    #[inline(always)]
    fn ids_in(&self, block: &TriangleBlock, lane: u32) -> (u32, u32) {
        let ids = &self.tree.packed.ids[block.number() as usize];
        (ids.geometry, ids.primitives[lane as usize % BLOCK])
    }

    /// A quick reject: whether the ray certainly misses a triangle, or hits it outside its range.
    #[inline(always)]
    pub(crate) fn misses<L: Simd>(
        &self,
        ray: &Ray,
        axes: &'static Axes,
        block: &TriangleBlock,
        lane: u32,
    ) -> bool {
        let ray = simd::opaque(ray);
        let (shear, origin) = L::shear(ray, axes, &self.start.mesh_origin);
        match L::pass(block, lane as usize, &shear, &origin) {
            (EdgeTest::Outside, _) => true,
            (EdgeTest::Inside, inside) => !watertight::is_in_range(ray, inside.t(&shear)),
            (EdgeTest::Uncertain, _) => false,
        }
    }

    /// The crossing of a triangle that is closer than the best so far; `exact` is the best, if it is known in double
    /// precision.
    #[inline(always)]
    pub(crate) fn compare<L: Simd>(
        &self,
        ray: &Ray,
        axes: &'static Axes,
        (block, lane): (u32, u32),
        (best, exact): (&Candidate, Option<Winner>),
    ) -> Outcome<Option<f64>> {
        let closely = || self.compare_closely(ray, (block, lane), (best, exact));
        let (shear, origin) = L::shear(ray, axes, &self.start.mesh_origin);
        let inside = match self.pass::<L>(&shear, &origin, block, lane) {
            (EdgeTest::Inside, inside) => inside,
            (EdgeTest::Outside, _) => return Outcome::Certain(None),
            (EdgeTest::Uncertain, _) => return closely(),
        };
        let t = inside.t(&shear);
        if !watertight::is_in_range(ray, t) {
            return Outcome::Certain(None);
        }
        let is_closer = if let Some(exact) = exact {
            if t == exact.root.t {
                return closely();
            }
            t < exact.root.t
        } else if best.is_some() {
            let (EdgeTest::Inside, nearest) = self.pass::<L>(&shear, &origin, best.block, best.lane) else {
                return closely();
            };
            let nearest_t = nearest.t(&shear);
            let ids = (self.ids(block, lane), self.ids(best.block, best.lane));
            t < nearest_t || t == nearest_t && precedes((inside.det > 0.0, ids.0), (nearest.det > 0.0, ids.1))
        } else {
            true
        };
        Outcome::Certain(is_closer.then_some(t))
    }

    /// [`Self::compare`] if the quick test of one of the two is uncertain.
    #[inline(never)]
    fn compare_closely(
        &self,
        ray: &Ray,
        (block, lane): (u32, u32),
        (best, exact): (&Candidate, Option<Winner>),
    ) -> Outcome<Option<f64>> {
        let (t, is_front) = match self.intersect(ray, block, lane) {
            Meeting::Miss => return Outcome::Certain(None),
            Meeting::Touch { .. } => return Outcome::Uncertain,
            Meeting::Hit { root, is_front } => (root.t, is_front),
        };
        match self.is_closer(ray, t, || Some(is_front), self.ids(block, lane), best, exact) {
            Outcome::Certain(is_closer) => Outcome::Certain(is_closer.then_some(t)),
            Outcome::Uncertain => Outcome::Uncertain,
        }
    }

    /// Whether a crossing at `t` of the primitive with these ids is closer than the best, or equally close and first in
    /// order; uncertain if that depends on unknown faces.
    /// that depends on faces that are not known.
    pub(crate) fn is_closer(
        &self,
        ray: &Ray,
        t: f64,
        is_front: impl FnOnce() -> Option<bool>,
        ids: (u32, u32),
        best: &Candidate,
        exact: Option<Winner>,
    ) -> Outcome<bool> {
        let &Candidate { block, lane, .. } = best;
        let (best_t, best_is_front, best_ids) = if let Some(exact) = exact {
            let is_front = if t == exact.root.t { self.meets_front(ray, &exact) } else { None };
            (exact.root.t, is_front, (exact.geometry, exact.primitive))
        } else if best.is_some() {
            match self.intersect(ray, block, lane) {
                Meeting::Hit { root, is_front } => (root.t, Some(is_front), self.ids(block, lane)),
                Meeting::Miss | Meeting::Touch { .. } => return Outcome::Uncertain,
            }
        } else {
            return Outcome::Certain(true);
        };
        if t != best_t {
            return Outcome::Certain(t < best_t);
        }
        match (is_front(), best_is_front) {
            (Some(is_front), Some(best_is_front)) => {
                Outcome::Certain(precedes((is_front, ids), (best_is_front, best_ids)))
            }
            _ => Outcome::Uncertain,
        }
    }

    /// Whether a crossing in the tree meets the front; `None` for a crossing in an instance.
    fn meets_front(&self, ray: &Ray, winner: &Winner) -> Option<bool> {
        if winner.geometry == IN_INSTANCE { None } else { enters(self.tree, ray, &[], winner) }
    }

    /// The interval of heights of a crossing known in double precision, if it is in range and closer than the best.
    #[inline(always)]
    pub(crate) fn compare_exact(
        &self,
        ray: &Ray,
        root: Root,
        ids: impl Fn() -> (u32, u32),
        (best, exact): (&Candidate, Option<Winner>),
    ) -> Outcome<Option<(f32, f32)>> {
        let t = root.t;
        let heights @ (from, to) = heights(t, largest_component(ray));
        // Also rejects NaN.
        if !ray.contains(t) || from > best.to {
            return Outcome::Certain(None);
        }
        if to < best.from {
            return Outcome::Certain(Some(heights));
        }
        let is_front = || {
            let (geometry, primitive) = ids();
            self.meets_front(ray, &Winner { root, geometry, primitive })
        };
        match self.is_closer(ray, t, is_front, ids(), best, exact) {
            Outcome::Certain(is_closer) => Outcome::Certain(is_closer.then_some(heights)),
            Outcome::Uncertain => Outcome::Uncertain,
        }
    }

    #[inline(always)]
    fn pass<L: Simd>(&self, shear: &Shear, origin: &[f64; 3], block: u32, lane: u32) -> (EdgeTest, Inside) {
        L::pass(self.block(block), lane as usize, shear, origin)
    }

    /// The watertight test of a triangle.
    #[cold]
    #[inline(never)]
    pub(crate) fn intersect(&self, ray: &Ray, block: u32, lane: u32) -> Meeting {
        let shear = Shear::new(&ray.direction);
        let origin = shear.local_origin(&ray.origin, &DVec3::from_slice(&self.start.mesh_origin));
        let corners = shear.axes.gather(self.block(block), lane as usize);
        watertight::intersect(ray, shear, origin, corners)
    }

    /// The crossing of a triangle in the ray's range, if any, and whether it meets the front.
    #[inline(always)]
    pub(crate) fn crossing<L: Simd>(
        &self,
        ray: &Ray,
        axes: &'static Axes,
        block: u32,
        lane: u32,
    ) -> Outcome<Option<(Winner, bool)>> {
        let (shear, origin) = L::shear(ray, axes, &self.start.mesh_origin);
        let corners = self.block(block);
        let found = match L::pass(corners, lane as usize, &shear, &origin) {
            (EdgeTest::Outside, _) => None,
            (EdgeTest::Inside, inside) => {
                let t = inside.t(&shear);
                watertight::is_in_range(ray, t).then(|| (inside.root(t), inside.det > 0.0))
            }
            (EdgeTest::Uncertain, _) => match self.intersect(ray, block, lane) {
                Meeting::Miss => None,
                Meeting::Hit { root, is_front } => Some((root, is_front)),
                Meeting::Touch { .. } => return Outcome::Uncertain,
            },
        };
        let (geometry, primitive) = self.ids_in(corners, lane);
        Outcome::Certain(found.map(|(root, is_front)| (Winner { root, geometry, primitive }, is_front)))
    }

    /// The closest hit in double precision: `exact` if known, otherwise the triangle's crossing.
    #[inline(always)]
    pub(crate) fn closest<L: Simd>(
        &self,
        ray: &Ray,
        axes: &'static Axes,
        (best, exact): (&Candidate, Option<Winner>),
    ) -> Outcome<Option<Winner>> {
        if exact.is_some() || !best.is_some() {
            return Outcome::Certain(exact);
        }
        match self.winner::<L>(ray, axes, best) {
            Some(winner) => Outcome::Certain(Some(winner)),
            None => Outcome::Uncertain,
        }
    }

    /// The crossing of a triangle that is hit; `None` if double precision disagrees.
    #[inline(always)]
    pub(crate) fn winner<L: Simd>(
        &self,
        ray: &Ray,
        axes: &'static Axes,
        &Candidate { block, lane, .. }: &Candidate,
    ) -> Option<Winner> {
        let (shear, origin) = L::shear(simd::opaque(ray), axes, &self.start.mesh_origin);
        let corners = self.block(block);
        let (edge_test, inside) = L::pass(corners, lane as usize, &shear, &origin);
        let (t, local) = if edge_test == EdgeTest::Inside {
            (inside.t(&shear), inside.local())
        } else {
            match self.intersect(ray, block, lane) {
                Meeting::Hit { root, .. } => (root.t, root.local),
                Meeting::Miss | Meeting::Touch { .. } => return None,
            }
        };
        let (geometry, primitive) = self.ids_in(corners, lane);
        Some(Winner { root: watertight::root(t, local), geometry, primitive })
    }
}
