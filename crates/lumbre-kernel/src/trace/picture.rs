//! Picture rays in trees of any primitives: triangles in single precision, everything else in double.
//!
//! Each ray exists twice. The rounded ray, relative to the mesh, goes through boxes and triangles, as
//! [`f32_ray`](super::f32_ray) describes. The original ray meets shapes, spheres, custom geometry and triangles in
//! double precision, and is transformed into the space of an instance, where the same starts again. Crossings are
//! compared by `t` in double precision, and by the order of [`precedes`] if that is equal. So the answer is that of a
//! loop over everything: it depends neither on the order of the visit nor on unnecessary visits.
//!
//! A crossing at an edge of a bilinear patch or of a double-precision triangle counts: they are closed, like
//! single-precision triangles.
//!
//! # Error bound: a ray in an instance
//!
//! Let u = 2⁻²⁴, and lengths be in the units of the instance's tree. The ray is transformed into its space in double
//! precision; one that starts farther than [`NEARBY`] = 4 from the tree's origin on some axis is moved along its line,
//! to slightly before the tree. Then it is rounded: its start by u (4 + shift) on each axis, where shift is the
//! distance between the origins of the tree and of its mesh, and its direction by u of each component, which makes 5.1u
//! on the way through the tree. As `f32_ray` shows, a hit lies within u (47 + 14·4) of its triangle. So it lies within
//! u (113 + shift) of the triangle as seen from the unrounded ray. [`PictureStart::deviation`] is larger, and the boxes
//! around the instance are widened by its image under the instance's map. So no box with a hit is skipped.
//!
//! Around exact shapes, the margin of triangles also covers the rounding of the start, u (|o| + shift), and the `slop`
//! of double precision.

use lumbre_geometry::{Ray, Root};
use lumbre_math::{DVec2, DVec3};

use super::cloud_ray::CloudRay;
use super::cursor::NodeCursor;
use super::decide::{Decider, enters};
use super::edges::{self, Patch};
use super::exact;
use super::f32_ray::Nearest;
use super::instances::Placed;
use super::leaves::nearest_of;
use super::stack::{Goal, Stack};
use super::{Context, ContextRef, Outcome, Winner, first_crossing, is_crossed, largest_component};
use crate::hit::{Hit, InstancePath};
use crate::intersect::box_ray::Slabs;
use crate::intersect::f32_ray::F32Ray;
use crate::intersect::watertight::{self, Feature, HeightRange, Meeting, beyond};
use crate::intersect::{self, BoundingHits, Dispatch, Isa, Simd};
use crate::ray32::Ray32;
use crate::simd;
use crate::tree::BLOCK;
use crate::tree::bounding_block::BoundingVolumeRay;
use crate::tree::node::tag;
use crate::tree::packed::{Entry, Start};
use crate::tree::picture_start::PictureStart;
use crate::tree::{GeometryKind, Tree};

/// How far from a tree's origin a ray may start on each axis, in tree units, to enter an instance without being moved.
const NEARBY: f64 = 4.0;
/// A ray that starts farther away cannot be moved nearer.
const MOVABLE: f64 = (1u64 << 30) as f64;
/// Bound on the distance of a tree's points from its origin: its planes are within 1.01.
const RADIUS: f64 = 1.8;

/// A crossing in a tree.
#[derive(Clone)]
pub(crate) struct Crossing {
    pub(crate) winner: Winner,
    /// Whether the ray enters there, if known.
    enters: Option<bool>,
    /// The position of the instance that contains it.
    instance: Option<u32>,
    /// The hit in the tree of that instance, if it is in a nested instance.
    nested: Option<Box<Hit>>,
}

impl Crossing {
    /// A crossing with a triangle of the tree, by geometry and primitive.
    #[inline(always)]
    pub(crate) fn on_triangle(
        (geometry, primitive): (u32, u32),
        t: f64,
        [u, v]: [f32; 2],
        enters: bool,
        ray: &Ray,
    ) -> Self {
        // A `t` that rounding moved beyond the end is in range.
        let t = if t < ray.t_max { t } else { ray.t_max };
        let root = watertight::root(t, DVec2::new(u.into(), v.into()));
        Self::of(Winner { root, geometry, primitive }, Some(enters))
    }

    /// The order of two crossings.
    #[inline(always)]
    pub(crate) fn nearer(one: Option<Self>, other: Option<Self>, tree: &Tree, ray: &Ray) -> Option<Self> {
        match (one, other) {
            (Some(one), Some(other)) => {
                let (t, other_t) = (one.winner.root.t, other.winner.root.t);
                let is_first = t < other_t || t == other_t && one.precedes(&other, tree, ray);
                Some(if is_first { one } else { other })
            }
            (one, None) => one,
            (None, other) => other,
        }
    }

    /// Stands for any hit.
    pub(crate) fn some() -> Self {
        Self::of(Winner { root: Root::at(0.0), geometry: 0, primitive: 0 }, None)
    }

    /// Outside of instances.
    #[inline(always)]
    fn of(winner: Winner, enters: Option<bool>) -> Self {
        Self { winner, enters, instance: None, nested: None }
    }

    /// Whether it is on a triangle of a mesh in the tree itself.
    #[inline(always)]
    pub(crate) fn is_plain(&self, tree: &Tree) -> bool {
        self.instance.is_none()
            && matches!(tree.geometries[self.winner.geometry as usize].kind, GeometryKind::Mesh(_))
    }

    /// The id of the geometry, and position and id of the instance that contains it; `None` in nested instances.
    #[inline(always)]
    pub(crate) fn placed(&self, tree: &Tree) -> Option<(u32, Option<(u32, u32)>)> {
        let geometry = self.winner.geometry as usize;
        let Some(position) = self.instance else { return Some((tree.geometries[geometry].id, None)) };
        let placed = &tree.geometries[position as usize];
        match &placed.kind {
            GeometryKind::Instance(instance) if self.nested.is_none() => {
                Some((instance.tree.geometries[geometry].id, Some((position, placed.id))))
            }
            _ => None,
        }
    }

    /// Converts to a hit of the tree.
    pub(crate) fn into_hit(self, tree: &Tree) -> Hit {
        let Some(position) = self.instance else { return self.winner.to_hit(tree) };
        let placed = &tree.geometries[position as usize];
        let GeometryKind::Instance(instance) = &placed.kind else { unreachable!("it was an instance") };
        match self.nested {
            None => {
                let context = ContextRef::OUTSIDE.within(position, placed.id);
                self.winner.to_hit_in(&instance.tree, context)
            }
            Some(mut hit) => {
                hit.route.insert(0, position);
                hit.instances.insert(0, placed.id);
                *hit
            }
        }
    }

    /// The order of two crossings at the same `t`.
    #[cold]
    #[inline(never)]
    fn precedes(&self, other: &Self, tree: &Tree, ray: &Ray) -> bool {
        let key = |crossing: &Self| {
            let Hit { root, geometry, primitive, route, .. } = crossing.clone().into_hit(tree);
            let winner = Winner { root, geometry, primitive };
            let enters = crossing.enters.or_else(|| enters(tree, ray, &route, &winner)).unwrap_or(false);
            (!enters, !route.is_empty(), route, geometry, primitive)
        };
        key(self) < key(other)
    }
}

/// A ray in single precision for a tree. Its `t` in double precision are `zero + factor * t`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LocalRay {
    pub(crate) ray: Ray32,
    zero: f64,
    /// A power of two, and its inverse.
    factor: f64,
    inverse: f64,
}

impl LocalRay {
    /// For a ray with the same `t`.
    #[inline(always)]
    pub(crate) fn new(ray: Ray32) -> Self {
        Self { ray, zero: 0.0, factor: 1.0, inverse: 1.0 }
    }

    #[inline(always)]
    pub(crate) fn t(&self, t: f32) -> f64 {
        self.zero + self.factor * f64::from(t)
    }

    /// A bound above every single-precision `t` that is not beyond this one.
    #[inline(always)]
    pub(crate) fn end(&self, t: f64) -> f32 {
        // The possible error of the difference.
        const LOST: f64 = 8.0 * f64::EPSILON;
        let t = (t - self.zero + LOST * self.zero) * self.inverse;
        beyond(if t > 0.0 { t as f32 } else { 0.0 })
    }
}

/// How a ray comes to the tree of an instance.
enum Approach {
    Ray(LocalRay),
    PassesBy,
    /// Only double precision can decide.
    Unknown,
}

/// The single-precision ray for a tree, without anything beyond `limit`.
#[inline(always)]
fn approach(tree: &Tree, picture: &PictureStart, ray: &Ray, limit: f64) -> Approach {
    let start = &picture.start;
    let size = largest_component(ray) * start.scale;
    if !(f64::MIN_POSITIVE..=f64::MAX).contains(&size) {
        return Approach::Unknown;
    }
    // Makes its largest component about 1, in tree units.
    let factor = if (1.0 / 1024.0..=1024.0).contains(&size) { 1.0 } else { power_of_two_over(size) };
    let direction = ray.direction * factor;
    let from = (ray.origin - DVec3::from_slice(&start.tree_origin)) * start.scale;
    let mut zero = 0.0;
    let distance = from.abs().max_element();
    let is_nearby = distance <= NEARBY;
    if !is_nearby {
        let is_movable = distance <= MOVABLE && tree.infinite.is_empty();
        if !is_movable {
            return Approach::Unknown;
        }
        let along = direction * start.scale;
        let (length, middle) = (along.length(), -from.dot(along) / along.length_squared());
        if (from + middle * along).length_squared() > RADIUS * RADIUS {
            return Approach::PassesBy;
        }
        zero = (middle - 2.0 * RADIUS / length) * factor;
        if zero > limit || middle + RADIUS / length < 0.0 {
            return Approach::PassesBy;
        }
    }
    if zero == 0.0 && factor == 1.0 {
        let origin = (ray.origin - picture.rounding.origin).as_vec3();
        let direction = ray.direction.as_vec3();
        let ray = Ray32 { origin, t_min: 0.0, direction, t_max: ray.t_max as f32 };
        return Approach::Ray(LocalRay::new(ray));
    }
    let (inverse, origin) = (1.0 / factor, ray.origin + zero * ray.direction - picture.rounding.origin);
    // The same for all callers, and no earlier than the ray's own end.
    let t_max = (((ray.t_max - zero) * inverse) as f32).next_up();
    let ray = Ray32 { origin: origin.as_vec3(), t_min: 0.0, direction: direction.as_vec3(), t_max };
    Approach::Ray(LocalRay { ray, zero, factor, inverse })
}

/// The power of two that brings a number to between 1 and 2; within the range of `f64`.
#[cold]
fn power_of_two_over(size: f64) -> f64 {
    let exponent = (size.to_bits() >> 52) as i64 - 1023;
    2f64.powi((-exponent).clamp(-1000, 1000) as i32)
}

/// The crossings of a ray other than those of the tree's own single-precision triangles.
pub(crate) struct Others<'a> {
    tree: &'a Tree,
    pub(crate) nearest: Option<Crossing>,
    /// Nothing beyond this counts.
    limit: f64,
    /// For shapes; created at the first one.
    bounding_volumes: Option<BoundingVolumeRay>,
    /// For the last cloud of spheres that the ray came to.
    cloud: Option<CloudRay>,
}

impl<'a> Others<'a> {
    #[inline(always)]
    pub(crate) fn new(tree: &'a Tree, limit: f64) -> Self {
        Self { tree, nearest: None, limit, bounding_volumes: None, cloud: None }
    }

    /// Shortens the ray to this `t`.
    #[inline(always)]
    pub(crate) fn shorten(&mut self, limit: f64) {
        self.limit = if limit < self.limit { limit } else { self.limit };
    }

    /// Tests a leaf, or unbounded geometry. Returns whether any hit suffices and there is one. Otherwise, a nearer
    /// crossing shortens the ray.
    #[inline(always)]
    pub(crate) fn test<G: Goal, L: Simd>(&mut self, leaf: Option<u32>, ray: &Ray) -> (bool, Option<f64>) {
        let limit = self.limit;
        let is_met = match leaf {
            Some(leaf) => self.test_leaf::<G, L>(leaf, ray),
            None => self.test_infinite::<G, L>(ray),
        };
        (is_met, (!G::IS_ANY && self.limit < limit).then_some(self.limit))
    }

    /// Takes a crossing in range, if it is the nearest.
    #[inline(always)]
    fn offer(&mut self, crossing: Crossing, ray: &Ray) {
        let t = crossing.winner.root.t;
        let is_wanted = t <= self.limit;
        if !is_wanted {
            return;
        }
        let is_first = match &self.nearest {
            Some(nearest) if nearest.winner.root.t == t => crossing.precedes(nearest, self.tree, ray),
            nearest => nearest.as_ref().is_none_or(|nearest| t < nearest.winner.root.t),
        };
        if is_first {
            self.nearest = Some(crossing);
            self.limit = t;
        }
    }

    /// Tests a leaf; returns whether any hit suffices and there is one.
    #[inline(always)]
    fn test_leaf<G: Goal, L: Simd>(&mut self, leaf: u32, ray: &Ray) -> bool {
        match tag::of(leaf) {
            tag::SHAPES => self.test_shapes::<G, L>(leaf, ray),
            tag::SPHERES => self.test_spheres::<G, L>(leaf, ray),
            tag::PRECISE => self.test_precise::<G>(leaf, ray),
            tag::INSTANCE => {
                let entry = &self.tree.packed.entries[tag::place(leaf)];
                self.test_instance::<G, L>(entry, ray)
            }
            _ => self.test_entries::<G>(leaf, ray),
        }
    }

    /// As [`Self::test_leaf`], for unbounded geometry.
    #[inline(always)]
    fn test_infinite<G: Goal, L: Simd>(&mut self, ray: &Ray) -> bool {
        let tree = self.tree;
        // No closures: they do not inherit target features.
        for entry in &*tree.infinite {
            let is_met = match tree.geometries[entry.geometry as usize].kind {
                GeometryKind::Instance(_) => self.test_instance::<G, L>(entry, ray),
                _ => self.test_entry::<G>(entry, ray),
            };
            if is_met {
                return true;
            }
        }
        false
    }

    /// The range of heights along the ray that counts.
    #[inline(always)]
    fn heights(&self, ray: &Ray) -> HeightRange {
        let length = largest_component(ray);
        HeightRange::ahead((ray.t_min * length) as f32, (self.limit * length) as f32)
    }

    /// Tests the shapes of a leaf whose bounding volumes are hit, the nearest first.
    #[inline(always)]
    fn test_shapes<G: Goal, L: Simd>(&mut self, leaf: u32, ray: &Ray) -> bool {
        let tree = self.tree;
        let make = || BoundingVolumeRay::new(&tree.tree_space, ray, largest_component(ray));
        let volumes = *self.bounding_volumes.get_or_insert_with(make);
        let mut first = tag::place(leaf);
        loop {
            let Some((block, goes_on)) = tree.bounding_volumes.block(first) else {
                return self.test_entries::<G>(leaf, ray);
            };
            let entries = &tree.packed.entries[first..];
            let mut range = self.heights(ray);
            let BoundingHits { mut mask, sure, near } = if G::IS_ANY {
                intersect::intersect_bounding_volumes::<L, true>(block, simd::opaque(&volumes), &range)
            } else {
                intersect::intersect_bounding_volumes::<L, false>(block, simd::opaque(&volumes), &range)
            };
            if G::IS_ANY && sure != 0 {
                return true;
            }
            while mask != 0 {
                let lane =
                    if G::IS_ANY { mask.trailing_zeros() as usize % BLOCK } else { nearest_of(mask, &near) };
                mask &= !(1 << lane);
                if !G::IS_ANY && near[lane] > range.last {
                    continue;
                }
                if self.test_entry::<G>(&entries[lane], ray) {
                    return true;
                }
                range = self.heights(ray);
            }
            if !goes_on {
                return false;
            }
            first += BLOCK;
        }
    }

    /// A leaf of custom geometry, or of shapes one by one.
    #[inline(never)]
    fn test_entries<G: Goal>(&mut self, leaf: u32, ray: &Ray) -> bool {
        for entry in &self.tree.packed.entries[tag::place(leaf)..] {
            if self.test_entry::<G>(entry, ray) {
                return true;
            }
            if entry.is_last() {
                break;
            }
        }
        false
    }

    /// A shape, or a primitive of custom geometry.
    #[inline(always)]
    fn test_entry<G: Goal>(&mut self, entry: &Entry, ray: &Ray) -> bool {
        let (geometry, primitive) = (entry.geometry, entry.primitive());
        let kind = &self.tree.geometries[geometry as usize].kind;
        let root = if let Some(patch) = Patch::of(kind) {
            patch
                .line_crossings(ray)
                .of_line
                .iter()
                .map(|crossing| crossing.root)
                .find(|root| ray.contains(root.t))
        } else if G::IS_ANY {
            return is_crossed(kind, primitive, ray);
        } else {
            first_crossing(kind, primitive, ray).filter(|root| ray.contains(root.t))
        };
        if let Some(root) = root {
            if G::IS_ANY {
                return true;
            }
            self.offer(Crossing::of(Winner { root, geometry, primitive }, None), ray);
        }
        false
    }

    /// A leaf of spheres of clouds, eight at a time.
    #[inline(always)]
    fn test_spheres<G: Goal, L: Simd>(&mut self, leaf: u32, ray: &Ray) -> bool {
        let (tree, places) = (self.tree, tag::blocks(leaf));
        let range = [ray.t_min, self.limit];
        for (ids, block) in
            tree.packed.sphere_ids[places.clone()].iter().zip(&tree.packed.sphere_blocks[places])
        {
            let cloud = CloudRay::turn(&mut self.cloud, tree, ray, ids.geometry);
            let origin = cloud.origin();
            let (mut mask, certain) = match cloud.within(range) {
                Some(spheres) => intersect::intersect_spheres::<L>(block, spheres),
                None => (ids.lanes(), 0),
            };
            if G::IS_ANY && certain != 0 {
                return true;
            }
            while mask != 0 {
                let lane = mask.trailing_zeros() as usize % BLOCK;
                mask &= mask - 1;
                let Some(root) = block.sphere(lane, &origin).closest(ray) else { continue };
                if G::IS_ANY {
                    return true;
                }
                let winner = Winner { root, geometry: ids.geometry, primitive: ids.primitives[lane] };
                self.offer(Crossing::of(winner, None), ray);
            }
        }
        false
    }

    /// A leaf of triangles in double precision.
    #[inline(never)]
    fn test_precise<G: Goal>(&mut self, leaf: u32, ray: &Ray) -> bool {
        for entry in &self.tree.packed.entries[tag::place(leaf)..] {
            let (geometry, primitive) = (entry.geometry, entry.primitive());
            let met =
                match edges::intersect_precise(self.tree, ray, geometry, primitive) {
                    Meeting::Hit { root, is_front } => Some((root, is_front)),
                    Meeting::Touch {
                        root, feature: Feature::Edge(_) | Feature::Vertex(_), is_front, ..
                    } if ray.contains(root.t) => Some((root, is_front)),
                    Meeting::Miss | Meeting::Touch { .. } => None,
                };
            if let Some((root, is_front)) = met {
                if G::IS_ANY {
                    return true;
                }
                self.offer(Crossing::of(Winner { root, geometry, primitive }, Some(is_front)), ray);
            }
            if entry.is_last() {
                break;
            }
        }
        false
    }

    /// An instance: a tree of triangles is entered inline, any other by a call.
    #[inline(always)]
    fn test_instance<G: Goal, L: Simd>(&mut self, entry: &Entry, ray: &Ray) -> bool {
        let Some(placed) = Placed::of(self.tree, entry) else { return false };
        let inner = &*placed.instance.tree;
        let object_ray = &placed.instance.world_from_object.object_ray(ray);
        let mut found = Outcome::Uncertain;
        if let Some(picture) = &inner.picture {
            match approach(inner, picture, object_ray, self.limit) {
                Approach::PassesBy => return false,
                Approach::Unknown => {}
                Approach::Ray(local) => {
                    let search = Search {
                        tree: inner,
                        picture,
                        from: placed.from,
                        ray: object_ray,
                        local,
                        limit: self.limit,
                    };
                    found = if picture.start.only_triangles {
                        search.run::<G, L, false>()
                    } else {
                        L::isa().run(General::<G>(search, std::marker::PhantomData))
                    };
                }
            }
        }
        let found = match found {
            Outcome::Certain(found) => found,
            Outcome::Uncertain => exactly::<G>(L::isa(), inner, placed.from, object_ray, self.limit),
        };
        let Some(found) = found else { return false };
        if G::IS_ANY {
            return true;
        }
        let (winner, enters) = (found.winner, found.enters);
        let nested = if found.instance.is_some() { Some(Box::new(found.into_hit(inner))) } else { None };
        self.offer(Crossing { winner, enters, instance: Some(placed.geometry), nested }, ray);
        false
    }
}

/// A part of a tree in double precision alone.
#[cold]
#[inline(never)]
fn exactly<G: Goal>(isa: Isa, tree: &Tree, from: Start, ray: &Ray, limit: f64) -> Option<Crossing> {
    let context = &Context::default();
    if G::IS_ANY {
        return exact::any_from(isa, tree, from, context, ray, None).then(Crossing::some);
    }
    let ray = &ray.with_range(ray.t_min, limit);
    let hit = exact::closest_from(isa, tree, from, context, ray, None)?;
    let winner = Winner { root: hit.root, geometry: hit.geometry, primitive: hit.primitive };
    if hit.route.is_empty() {
        return Some(Crossing::of(winner, None));
    }
    let mut nested = Box::new(hit);
    let behind_first = |path: &InstancePath| InstancePath::from_slice(&path[1..]);
    let instance = Some(nested.route[0]);
    let is_nested = nested.route.len() > 1;
    (nested.route, nested.instances) = (behind_first(&nested.route), behind_first(&nested.instances));
    Some(Crossing { winner, enters: None, instance, nested: is_nested.then_some(nested) })
}

/// The search of a ray in a part of a tree.
pub(crate) struct Search<'a, 'r> {
    pub(crate) tree: &'a Tree,
    pub(crate) picture: &'a PictureStart,
    pub(crate) from: Start,
    pub(crate) ray: &'r Ray,
    pub(crate) local: LocalRay,
    /// Nothing beyond this counts.
    pub(crate) limit: f64,
}

impl Search<'_, '_> {
    /// The nearest crossing, or any. `GENERAL`: in a tree of any primitives, not only triangles.
    #[inline(always)]
    pub(crate) fn run<G: Goal, L: Simd, const GENERAL: bool>(self) -> Outcome<Option<Crossing>> {
        let Self { tree, picture, from, ray, local, limit } = self;
        let start = &picture.start;
        let Some(slabs) = L::start_f32(start, simd::opaque(&local.ray)) else { return Outcome::Uncertain };
        let decider = &Decider::new(tree, start);
        let mut cursor = NodeCursor::<L>::new(decider.nodes(), slabs);
        let mut stack = Stack::new();
        if !G::IS_ANY && limit < ray.t_max {
            shorten(&mut cursor.slabs, local.end(limit));
        }
        let mut next = cursor.descend::<G>(from.below(start.root), &mut stack);
        if next.is_none() && (!GENERAL || tree.infinite.is_empty()) {
            return Outcome::Certain(None);
        }
        let mut triangles = L::start_f32_blocks(start, simd::opaque(&local.ray), &cursor.slabs);
        if !G::IS_ANY && limit < ray.t_max {
            triangles.shorten(local.end(limit));
        }
        let mut nearest = Nearest::NONE;
        let mut others = Others::new(tree, limit);
        if GENERAL && !tree.infinite.is_empty() {
            let (is_met, nearer) = others.test::<G, L>(None, ray);
            if is_met {
                return Outcome::Certain(Some(Crossing::some()));
            }
            if let Some(t) = nearer {
                end_at(&mut triangles, &mut cursor.slabs, local.end(t));
            }
        }
        while let Some(leaf) = next {
            if !GENERAL || tag::of(leaf) == tag::TRIANGLES {
                if triangles.test_leaf::<G, L>(decider, leaf, &mut nearest, &mut cursor.slabs) {
                    return Outcome::Certain(Some(Crossing::some()));
                }
                if GENERAL && !G::IS_ANY {
                    others.shorten(local.t(triangles.t_max()));
                }
            } else {
                let (is_met, nearer) = others.test::<G, L>(Some(leaf), ray);
                if is_met {
                    return Outcome::Certain(Some(Crossing::some()));
                }
                if let Some(t) = nearer {
                    end_at(&mut triangles, &mut cursor.slabs, local.end(t));
                }
            }
            next = cursor.next_leaf::<G>(&mut stack);
        }
        let mut triangle = None;
        if let Some((ids, uv, enters)) = nearest.crossing(decider) {
            triangle = Some(Crossing::on_triangle(ids, local.t(triangles.t_max()), uv, enters, ray));
        }
        Outcome::Certain(if GENERAL {
            Crossing::nearer(triangle, others.nearest, tree, ray)
        } else {
            triangle
        })
    }
}

/// Shortens the ray to a crossing.
#[inline(always)]
fn end_at(triangles: &mut F32Ray, slabs: &mut Slabs, end: f32) {
    triangles.shorten(end);
    shorten(slabs, end);
}

#[inline(always)]
fn shorten(slabs: &mut Slabs, end: f32) {
    let end = beyond(end);
    if end < slabs.s_max() {
        slabs.end_at(end);
    }
}

/// [`Search::run`] in a tree of any primitives, out of line.
pub(crate) struct General<'a, 'r, G>(pub(crate) Search<'a, 'r>, pub(crate) std::marker::PhantomData<G>);

impl<G: Goal> Dispatch for General<'_, '_, G> {
    type Output = Outcome<Option<Crossing>>;

    #[inline(always)]
    fn run<L: Simd>(self) -> Self::Output {
        self.0.run::<G, L, true>()
    }
}
