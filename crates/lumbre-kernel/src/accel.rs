//! The tree and its queries.

use std::fmt;
use std::io;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::OnceLock;

use lumbre_geometry::{Aabb, Ray, Surface};
use lumbre_math::{DVec3, Transform};

use crate::build::{input, rebuild, refit};
use crate::columns::PictureStart;
use crate::intersect::Isa;
use crate::intersect::filter_start::FilterStart;
use crate::io::{bytes, mapped};
use crate::point::flats::Flats;
use crate::point::winding::{self, Moments};
use crate::point::{closest_point, inside};
use crate::trace::f32_ray::{self, F32Queries};
use crate::trace::filtered::{self, Queries};
use crate::trace::stack::{AnyHit, ClosestHit};
use crate::trace::visitors::{Count, NextHits};
use crate::trace::{ContextRef, Outcome, exact};
use crate::tree::bounding_block::BoundingVolumes;
use crate::tree::node::{TreeSpace, tag};
use crate::tree::packed::{Entry, Packed};
use crate::tree::summary::Sizes;
use crate::tree::summary::Summary;
use crate::{
    ClosestPoint, Geometry, GeometryKind, Hit, Hit32, HitColumns, LoadError, MapError, NoClosestPoint,
    NoWindingNumber, PictureRounding, Query, Ray32, RayColumns, RefitError, SphereCloud, Target, batch,
    surface,
};

/// A bounding volume hierarchy over geometries, ready for queries from any number of threads.
///
/// The same geometries give the same tree from any number of threads, and every query the same answer on any machine:
/// hits do not depend on the order of the visit, nor on the instruction set.
#[derive(Debug)]
pub struct Accel {
    pub(crate) geometries: Vec<Geometry>,
    pub(crate) tree_space: TreeSpace,
    pub(crate) tree: Packed,
    // Kept out of the tree, and asked by every ray.
    pub(crate) infinite: Vec<Entry>,
    pub(crate) bounds: Aabb,
    pub(crate) primitives: usize,
    pub(crate) isa: Isa,
    pub(crate) summary: Summary,
    /// Where single precision can traverse the tree.
    pub(crate) single: Option<FilterStart>,
    /// Where rays of pictures traverse it in single precision.
    pub(crate) picture: Option<PictureStart>,
    pub(crate) queries: Queries,
    /// Those of rays in single precision, where these are not asked in double.
    pub(crate) f32_queries: Option<F32Queries>,
    /// What is asked of shapes first.
    pub(crate) bounding_volumes: BoundingVolumes,
    /// What a ray cost after the build, once that was asked for.
    pub(crate) built_cost: Option<f64>,
    // One for each geometry, or none.
    pub(crate) masks: Vec<u32>,
    /// For winding numbers, once one was asked for.
    pub(crate) moments: OnceLock<Moments>,
    /// For closest points, once one was asked for.
    pub(crate) flats: OnceLock<Flats>,
}

/// What a build, or a file, makes.
pub(crate) struct AccelParts {
    pub(crate) tree_space: TreeSpace,
    pub(crate) tree: Packed,
    pub(crate) sizes: Sizes,
    pub(crate) bounds: Aabb,
    pub(crate) infinite: Vec<Entry>,
    pub(crate) primitives: usize,
}

/// How a tree is built. Answers do not depend on it; how soon they come does.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BuildOptions {
    /// How much care is taken.
    pub preset: Preset,
}

/// How much care is taken over a tree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Preset {
    /// Built soonest, for what changes from picture to picture: primitives are sorted along a curve (C. Lauterbach and
    /// others, "Fast BVH Construction on GPUs", 2009), and only the ends of the tree are chosen by the surface area
    /// heuristic.
    Fast,
    /// Binned by the surface area heuristic at every instruction set (I. Wald, "On fast Construction of SAH-based Bounding Volume
    /// Hierarchies", 2007). Among the upper nodes of meshes, subtrees are put elsewhere where that makes the tree much better, as in
    /// `Best`. Instances whose parts have much smaller boxes than the whole are entered part by part (after C. Benthin
    /// and others, "Improved Two-Level BVHs using Partial Re-Braiding", 2017): at most eight parts for each on average, and 64.
    #[default]
    Balanced,
    /// The balanced tree, then made better by putting subtrees of any size elsewhere (D. Meister, J. Bittner, "Parallel Reinsertion for
    /// Bounding Volume Hierarchy Optimization", 2018): for what is built once and asked often.
    Best,
}

impl Preset {
    /// All of them, from the soonest to the best.
    pub const ALL: [Self; 3] = [Self::Fast, Self::Balanced, Self::Best];
}

/// Why a tree cannot be built.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum BuildError {
    /// A mesh names a vertex that it does not have.
    VertexOutOfRange {
        /// Position of the geometry in the list.
        geometry: usize,
        /// The triangle.
        triangle: usize,
    },
    /// A coordinate or a radius is not finite.
    NotFinite {
        /// Position of the geometry in the list.
        geometry: usize,
        /// The vertex, sphere or primitive.
        element: usize,
    },
    /// More primitives than a tree can name (2^28 - 1), or so many small leaves of triangles or of spheres that they fill
    /// more than 2^25 blocks of eight.
    TooMany,
}

impl fmt::Display for BuildError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::VertexOutOfRange { geometry, triangle } => {
                write!(f, "triangle {triangle} of geometry {geometry} names a vertex that is not there")
            }
            Self::NotFinite { geometry, element } => {
                write!(f, "element {element} of geometry {geometry} has a coordinate that is not finite")
            }
            Self::TooMany => write!(
                f,
                "too many primitives for one tree: at most {}, in {} blocks of eight triangles or spheres",
                input::MOST_PRIMITIVES,
                tag::BLOCK_PLACES
            ),
        }
    }
}

impl std::error::Error for BuildError {}

impl Accel {
    /// Builds a tree over `geometries`. Zero-area triangles and spheres without a radius are kept out: they are never hit.
    ///
    /// It works on the threads of the rayon pool that it is called in. A thread that is none of these waits until they have woken up,
    /// which may take as long as a small tree; one that joined the pool by `use_current_thread` begins at once.
    ///
    /// # Errors
    /// [`BuildError`] when a mesh names vertices that it lacks, a coordinate or a radius is not finite, or there are 2^28 primitives
    /// or more.
    pub fn build(geometries: Vec<Geometry>, options: &BuildOptions) -> Result<Self, BuildError> {
        input::build(geometries, options)
    }

    /// Moves what stands in the tree: `geometries` are those that it was built from, with other vertices, shapes,
    /// transforms or trees of instances. The tree keeps its structure; its boxes become those of what is now in them.
    /// Queries answer as after a build.
    ///
    /// This takes a sixth of the time of a build, or half of it where meshes have other indices than before; but the boxes of what was
    /// near and no longer is grow, and queries become slower. The answer says by how much, about: the cost of a ray as a multiple of
    /// that after the build, 1 or so where everything moved together. As a rule, [rebuild in part](Self::rebuild_partially) where it
    /// passes 1.1, and build again where it is still more than 1.5 then: with more than a few rays for every primitive, queries lose
    /// more time than that takes.
    ///
    /// Where an instance was opened (see [`Preset::Balanced`]) and its new tree has other nodes, it is whole again, until a tree
    /// comes that has these nodes.
    ///
    /// Trees that hold this one as an instance are to be refitted after it, from the inside out. It is no part of
    /// them: they hold it in an [`Arc`](std::sync::Arc), which [`Arc::get_mut`](std::sync::Arc::get_mut) opens only for its
    /// one owner.
    ///
    /// # Errors
    /// [`RefitError`] when the geometries are not sound, or not of the same kinds and sizes, or something that has no place
    /// in the tree would now need one. The tree is then as it was.
    pub fn refit(&mut self, geometries: Vec<Geometry>) -> Result<f64, RefitError> {
        refit::refit(self, geometries)
    }

    /// Puts together anew what refits have moved: a partial rebuild. Queries answer as before, to the bit.
    ///
    /// Leaves of triangles and of spheres stay as they are, up to eight in each, and are put together as a build would put
    /// triangles; shapes, instances and custom geometry are all put together anew. That takes about a third of the time of a build, and
    /// is as good where what shares a leaf has moved together, as the surfaces of bodies do that bend, turn or go their ways.
    /// Where it has not, as in a cloud of dust, only a build helps. A tree that would be worse than what there is is not taken.
    ///
    /// The answer is as that of [`refit`](Self::refit): the cost of a ray as a multiple of that after the build. What
    /// is said there of trees that hold this one holds here, too.
    pub fn rebuild_partially(&mut self, options: &BuildOptions) -> f64 {
        rebuild::rebuild_partially(self, options)
    }

    /// Puts a tree together of what a build, or a file, makes.
    pub(crate) fn assemble(isa: Isa, geometries: Vec<Geometry>, parts: AccelParts) -> Self {
        let AccelParts { tree_space, tree, sizes, bounds, infinite, primitives } = parts;
        let summary = Summary::new(&geometries, sizes);
        let single = FilterStart::new(&summary, &tree_space, tree.root);
        let picture = PictureStart::new(&geometries, single.as_ref());
        Self {
            bounding_volumes: BoundingVolumes::new(&geometries, &tree.entries, &tree_space),
            queries: Queries::new(isa, single.as_ref()),
            f32_queries: F32Queries::new(isa, single.as_ref()),
            picture,
            single,
            tree_space,
            summary,
            tree,
            infinite,
            bounds,
            primitives,
            isa,
            built_cost: None,
            masks: Vec::new(),
            moments: OnceLock::new(),
            flats: OnceLock::new(),
            geometries,
        }
    }

    /// The tree with these masks: one for each of its geometries, or none.
    pub(crate) fn with_masks_unchecked(self, masks: Vec<u32>) -> Self {
        Self { masks, ..self }
    }

    /// Makes anew what traversals keep of the tree, which has changed.
    pub(crate) fn follow_tree(&mut self) {
        self.single = FilterStart::new(&self.summary, &self.tree_space, self.tree.root);
        self.queries = Queries::new(self.isa, self.single.as_ref());
        self.f32_queries = F32Queries::new(self.isa, self.single.as_ref());
        self.picture = PictureStart::new(&self.geometries, self.single.as_ref());
        self.bounding_volumes = BoundingVolumes::new(&self.geometries, &self.tree.entries, &self.tree_space);
        self.moments = OnceLock::new();
        self.flats = OnceLock::new();
    }

    /// How the tree is put together, as bytes for a file: some six a triangle, whatever the machine. The geometries are not
    /// in them. Trees that stand in this one as instances are saved by themselves.
    pub fn to_bytes(&self) -> Vec<u8> {
        bytes::to_bytes(self)
    }

    /// The tree that [`Accel::to_bytes`] wrote down, over the geometries that it was built from: it is the same to the bit,
    /// and comes in a fraction of the time of a build. Where vertices, shapes or transforms moved meanwhile, it comes
    /// refitted, as by [`Accel::refit`].
    ///
    /// Bytes may come from anywhere: whatever is in them, the tree answers as it should, or they are refused.
    ///
    /// # Errors
    /// [`LoadError`] when the bytes are no tree, of another version, incomplete or damaged, or the geometries do not fit.
    pub fn from_bytes(bytes: &[u8], geometries: Vec<Geometry>) -> Result<Self, LoadError> {
        bytes::from_bytes(bytes, geometries)
    }

    /// Writes the tree to a file that [`Accel::map`] uses in place: thirty to sixty bytes a triangle. The geometries are not in it,
    /// nor the trees that stand in this one as instances. A file that is there already is replaced as a whole once the new one
    /// is complete; who has it mapped keeps the old one.
    ///
    /// # Errors
    /// When the file cannot be written, or the machine is not little-endian.
    pub fn save(&self, path: impl AsRef<Path>) -> io::Result<()> {
        mapped::save(self, path.as_ref())
    }

    /// The tree that [`Accel::save`] wrote, over the geometries that it was saved with: its nodes and leaves stay in the file,
    /// which is mapped into memory, so that little is read before it is needed, and processes share what is.
    ///
    /// The file is looked through once, for its checksum and for every reference in it; the boxes in it are believed. Of
    /// geometries that moved meanwhile, it is refused: [`Accel::from_bytes`] takes them. A later [`Accel::refit`] takes the
    /// tree over into memory.
    ///
    /// **While it is mapped, nobody may write to the file or make it shorter**: reading what another process cut off ends
    /// this one (by the signal SIGBUS, on Unix), and of what is changed in place nothing is promised. Replacing the file, as
    /// `save` does, and removing it are fine.
    ///
    /// # Errors
    /// [`MapError`] when the file cannot be mapped, is damaged, of another version or of other geometries.
    pub fn map(path: impl AsRef<Path>, geometries: Vec<Geometry>) -> Result<Self, MapError> {
        mapped::map(path.as_ref(), geometries)
    }

    /// The closest hit in the ray's range. Of hits at the same `t`, the one whose (path, geometry, primitive) comes
    /// first, by positions in the lists that the trees were built from.
    #[inline]
    pub fn closest(&self, ray: &Ray) -> Option<Hit> {
        self.queries.closest.ask(self, ray)
    }

    /// Whether anything is hit in the ray's range.
    #[inline]
    pub fn any(&self, ray: &Ray) -> bool {
        self.queries.any.ask(self, ray)
    }

    /// [`Accel::closest`] among what a query takes into account. Of a shape, each crossing counts by itself.
    #[inline]
    pub fn closest_with(&self, ray: &Ray, query: &Query) -> Option<Hit> {
        if query.takes_all(self) { self.closest(ray) } else { self.closest_with_at(self.isa, ray, query) }
    }

    /// [`Accel::any`] among what a query takes into account.
    #[inline]
    pub fn any_with(&self, ray: &Ray, query: &Query) -> bool {
        if query.takes_all(self) { self.any(ray) } else { self.any_with_at(self.isa, ray, query) }
    }

    pub(crate) fn closest_with_at(&self, isa: Isa, ray: &Ray, query: &Query) -> Option<Hit> {
        match filtered::with_query::<ClosestHit>(isa, self, ray, query) {
            Outcome::Certain(found) => found.into_hit(self, ContextRef::OUTSIDE),
            Outcome::Uncertain => exact::closest(isa, self, ray, Some(query)),
        }
    }

    pub(crate) fn any_with_at(&self, isa: Isa, ray: &Ray, query: &Query) -> bool {
        match filtered::with_query::<AnyHit>(isa, self, ray, query) {
            Outcome::Certain(is_hit) => is_hit,
            Outcome::Uncertain => exact::any(isa, self, ray, Some(query)),
        }
    }

    /// [`Accel::closest`] by double precision alone: the same answer to the bit, slower. To be measured beside it.
    #[doc(hidden)]
    pub fn closest_exact(&self, ray: &Ray) -> Option<Hit> {
        exact::closest(self.isa, self, ray, None)
    }

    /// [`Accel::any`] by double precision alone. To be measured beside it.
    #[doc(hidden)]
    pub fn any_exact(&self, ray: &Ray) -> bool {
        exact::any(self.isa, self, ray, None)
    }

    /// Every hit in the ray's range in ascending order of `t` (ties by path, geometry, primitive), until `visit` breaks.
    ///
    /// Hits are found 32, 128, 512 and so on at a time, so that an early end costs little and memory is at most
    /// proportional to the hits visited.
    pub fn all(&self, ray: &Ray, visit: impl FnMut(&Hit) -> ControlFlow<()>) {
        self.all_at(self.isa, ray, visit);
    }

    pub(crate) fn all_at(&self, isa: Isa, ray: &Ray, mut visit: impl FnMut(&Hit) -> ControlFlow<()>) {
        let mut size = 32;
        let mut last = None;
        loop {
            let mut visitor = NextHits::new(ray, size, last.as_ref());
            exact::traverse(isa, self, ray, &mut visitor);
            let (mut hits, may_go_on) = visitor.into_hits();
            if hits.iter().any(|ranked| visit(&ranked.hit).is_break()) || !may_go_on {
                return;
            }
            last = hits.pop();
            size = size.saturating_mul(4);
        }
    }

    /// How many hits the ray's range holds.
    pub fn count(&self, ray: &Ray) -> usize {
        self.count_at(self.isa, ray)
    }

    pub(crate) fn count_at(&self, isa: Isa, ray: &Ray) -> usize {
        let mut visitor = Count::new(ray);
        exact::traverse(isa, self, ray, &mut visitor);
        visitor.hits
    }

    /// The closest hit of a ray in single precision: faster than [`Accel::closest`], and as watertight.
    ///
    /// A tree of nothing but meshes answers in single precision. It tests the triangles as they are seen from the ray, with their
    /// corners rounded: a ray that passes through a closed mesh hits it, at edges and corners, too, which belong to all triangles that
    /// have them. The point at `t` lies within some 2⁻²⁰ of its distance and of the tree's size from the triangle; so near to an edge,
    /// another triangle may be hit than in double precision, and where a triangle is seen nearly on edge, `t` may differ by more. Of hits
    /// at the same `t`, the one whose geometry and primitive come first is the answer. It is the same on any machine, and however the
    /// tree was built.
    ///
    /// Other trees, and rays that come from afar (sixteen sizes of the tree), answer in double precision; the answer is rounded.
    #[inline]
    pub fn closest_f32(&self, ray: &Ray32) -> Option<Hit32> {
        match &self.f32_queries {
            Some(queries) => queries.closest.ask(self, ray),
            None => self.closest_widened(ray),
        }
    }

    /// Whether a ray in single precision hits anything in its range: whether there is an answer of [`Accel::closest_f32`].
    #[inline]
    pub fn any_f32(&self, ray: &Ray32) -> bool {
        match &self.f32_queries {
            Some(queries) => queries.any.ask(self, ray),
            None => self.any_widened(ray),
        }
    }

    /// [`Accel::closest`] of a ray in single precision, rounded.
    #[inline(never)]
    pub(crate) fn closest_widened(&self, ray: &Ray32) -> Option<Hit32> {
        self.closest(&ray.to_f64()).as_ref().map(f32_ray::rounded)
    }

    /// [`Accel::any`] of a ray in single precision.
    #[inline(never)]
    pub(crate) fn any_widened(&self, ray: &Ray32) -> bool {
        self.any(&ray.to_f64())
    }

    /// [`Accel::closest`] for every ray, with the same answers to the bit; `hits` has a slot for each.
    ///
    /// In a tree with triangles, sixteen rays in a row that are coherent (those of a square of four by four pixels, rather than of
    /// sixteen pixels in a line) are traversed as a packet, which takes down to two fifths of the time; many of the others are
    /// interleaved. A thousand rays or more at a time are answered fastest. Leaves of anything but triangles, and all trees on a machine
    /// without AVX2, are traversed ray by ray. It works on the calling thread: to use more, split `rays` and `hits`.
    ///
    /// # Panics
    /// When `rays` and `hits` differ in length.
    pub fn closest_batch(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        assert_eq!(rays.len(), hits.len(), "a slot for the hit of every ray");
        batch::closest(self.isa, self, rays, hits);
    }

    /// [`Accel::any`] for every ray: see [`Accel::closest_batch`].
    ///
    /// # Panics
    /// When `rays` and `hits` differ in length.
    pub fn any_batch(&self, rays: &[Ray], hits: &mut [bool]) {
        assert_eq!(rays.len(), hits.len(), "a slot for the answer of every ray");
        batch::any(self.isa, self, rays, hits);
    }

    /// [`Accel::closest_f32`] for every ray: see [`Accel::closest_batch`].
    ///
    /// # Panics
    /// When `rays` and `hits` differ in length.
    pub fn closest_batch_f32(&self, rays: &[Ray32], hits: &mut [Option<Hit32>]) {
        assert_eq!(rays.len(), hits.len(), "a slot for the hit of every ray");
        batch::closest_f32(self.isa, self, rays, hits);
    }

    /// [`Accel::any_f32`] for every ray: see [`Accel::closest_batch`].
    ///
    /// # Panics
    /// When `rays` and `hits` differ in length.
    pub fn any_batch_f32(&self, rays: &[Ray32], hits: &mut [bool]) {
        assert_eq!(rays.len(), hits.len(), "a slot for the answer of every ray");
        batch::any_f32(self.isa, self, rays, hits);
    }

    /// By how much the rays of a picture are rounded where they start, and triangles of meshes in the tree itself with them;
    /// `None` where rays are traversed in double precision.
    ///
    /// A point of such a triangle that rays leave has to be farther off it by that: [`PictureRounding::error`] is to be added to
    /// [`Surface::point_error`]. [`Accel::picture_surface`] does so, in instances, too; what is met in double precision needs nothing.
    ///
    /// # Error bound
    ///
    /// Let u = 2⁻²⁴, n the unit normal of a triangle, |n|₁ the sum of the sizes of its components, and lengths be in tree units. A ray
    /// that leaves the triangle starts at a distance D from its plane and does not come nearer to it. Its start is rounded by
    /// u |o - origin| on each axis; in an instance, its direction too, by u on each axis, which takes it nearer by less than 3.5u |n|₁ on
    /// its way through the tree. Where single precision finds a hit, the point of the rounded ray lies within
    /// u(47 + 14·1.01) < 61.2u of the triangle on each axis (see `trace::f32_ray`), and so within 61.2u |n|₁ of the plane.
    /// There is none where D > u Σ |nᵢ| |oᵢ - originᵢ| + 64.7u |n|₁.
    ///
    /// With the error e on each axis, [`Surface::offset_origin`] moves the point by Σ |nᵢ| eᵢ + 4 max e, and 4 max e is at least
    /// 4/√3 Σ |nᵢ| eᵢ as |n|₁ ≤ √3: altogether 3.3 Σ |nᵢ| eᵢ. So e = 2u |p - origin| + 20u has room for it, and for how far o is from p.
    /// What moves points by less than that needs a larger error.
    ///
    /// Under the map L of an instance, the error is |L| e, and the unit normal m = L⁻ᵀn / |L⁻ᵀn|. A move by d along m is one by
    /// d |L⁻ᵀn| across the plane of the triangle in its own space, and Σ |mᵢ| (|L| e)ᵢ ≥ Σ |nᵢ| eᵢ / |L⁻ᵀn|: there, too, it is moved by
    /// 3.3 Σ |nᵢ| eᵢ or more.
    pub fn picture_rounding(&self) -> Option<PictureRounding> {
        PictureStart::of(self).map(|picture| picture.rounding)
    }

    /// [`Accel::surface`] at a hit of [`Accel::closest_columns`], with an error by which rays of pictures that leave it by
    /// [`Surface::offset_origin`] do not hit its triangle: see [`Accel::picture_rounding`].
    ///
    /// # Panics
    /// When `hit` comes from another tree and names what is not in this one.
    pub fn picture_surface(&self, ray: &Ray, hit: &Hit) -> Surface {
        surface::picture_surface(self, ray, hit)
    }

    /// The closest hits of the rays of a picture.
    ///
    /// For triangles of meshes, rays are rounded to single precision once, relative to what the meshes are relative to (in an instance,
    /// after they are taken into its space), and tested as [`Accel::closest_f32`] tests them: a ray through a closed mesh hits
    /// it. All else is met by the ray as it is, in double precision. Trees that have no [`Accel::picture_rounding`], rays from afar
    /// (sixteen sizes of the tree) and all rays where `exact` is asked for are answered as [`Accel::closest`] answers. Answers are the
    /// same on any machine, and do not depend on what else is asked. Rays in a row that are coherent are traversed as in
    /// [`Accel::closest_batch`].
    ///
    /// # Panics
    /// When columns differ in length.
    pub fn closest_columns(&self, rays: &RayColumns, exact: bool, hits: &mut HitColumns) {
        batch::columns::closest(self.isa, self, rays, exact, hits);
    }

    /// Whether anything is hit by the rays of a picture: whether [`Accel::closest_columns`] finds something.
    ///
    /// # Panics
    /// When columns differ in length.
    pub fn any_columns(&self, rays: &RayColumns, exact: bool, occluded: &mut Vec<bool>) {
        batch::columns::any(self.isa, self, rays, exact, occluded);
    }

    /// The tree with a mask for each of its geometries, by position, for [`Query::mask`]; without, all bits are set.
    /// They are saved with it, and stay through a refit.
    ///
    /// # Panics
    /// When there are not as many masks as geometries.
    #[must_use]
    pub fn with_masks(self, masks: Vec<u32>) -> Self {
        assert_eq!(masks.len(), self.geometries.len(), "a mask for each geometry");
        Self { masks, ..self }
    }

    /// The queries at an instruction set.
    pub(crate) fn queries_at(&self, isa: Isa) -> Queries {
        if isa == self.isa { self.queries } else { Queries::new(isa, self.single.as_ref()) }
    }

    /// The same in single precision; `None` where they are asked in double.
    pub(crate) fn f32_queries_at(&self, isa: Isa) -> Option<F32Queries> {
        if isa == self.isa { self.f32_queries } else { F32Queries::new(isa, self.single.as_ref()) }
    }

    /// The nearest point of all surfaces within `max_distance` (itself included; infinite for anywhere), or `None` where there
    /// is none so near. Of points as near, the one whose (path, geometry, primitive) comes first. Triangles without area and spheres
    /// without a radius count as the lines and points that they are, although no ray hits them: the first call looks for them. Nothing
    /// is near a point that is not finite.
    ///
    /// Distances to triangles are exact up to rounding under any map; those to shapes wherever
    /// [`Shape::closest_point`](lumbre_geometry::Shape::closest_point) has a method.
    ///
    /// # Errors
    /// [`NoClosestPoint`] where something may be nearer that has no answer: a shape without a method, or custom geometry
    /// that offers none. What is farther away than the nearest point does no harm.
    pub fn closest_point(
        &self,
        point: DVec3,
        max_distance: f64,
    ) -> Result<Option<ClosestPoint>, NoClosestPoint> {
        closest_point::closest_point(self, point, max_distance, 0.0)
    }

    /// [`Accel::closest_point`] at a time, in the unit of the keys of what moves; without one, it is 0.
    ///
    /// # Errors
    /// As there.
    pub fn closest_point_at(
        &self,
        point: DVec3,
        max_distance: f64,
        time: f64,
    ) -> Result<Option<ClosestPoint>, NoClosestPoint> {
        closest_point::closest_point(self, point, max_distance, time)
    }

    /// Whether a point is inside of what stands here, even-odd: inside of two bodies that overlap, or in a body within a
    /// body, it is outside again. See [`Accel::winding_number`] for another answer.
    ///
    /// Solid shapes say it by themselves. Of everything else, crossings are counted along five fixed directions, and most
    /// of them decide: of closed meshes all say the same. What is open has no inside, and the answer there is some guess,
    /// always the same one. Nothing is around a point that is not finite.
    pub fn is_inside(&self, point: DVec3) -> bool {
        inside::is_inside(self, point, 0.0)
    }

    /// [`Accel::is_inside`] at a time, in the unit of the keys of what moves; without one, it is 0.
    pub fn is_inside_at(&self, point: DVec3, time: f64) -> bool {
        inside::is_inside(self, point, time)
    }

    /// How often surfaces wind around a point: 1 inside of a closed mesh whose triangles run counter-clockwise as seen from
    /// without, -1 where they run clockwise, 0 outside, the sum where bodies overlap; a number in between where a mesh is
    /// open, by how much of the sky it fills. More than 0.5 is a good rule for "inside" where meshes have gaps.
    ///
    /// Of solid shapes, it is 1 within and 0 without. Mirrored instances keep the sides of their meshes. Nothing winds around
    /// a point that is not finite.
    ///
    /// Meshes far away are taken together, which may be wrong by a thousandth; [`Accel::winding_number_exact`] is not.
    /// The first call looks at every triangle and keeps some 350 bytes for every node of the tree. In instances whose maps do
    /// not keep angles, every triangle is looked at.
    ///
    /// # Errors
    /// [`NoWindingNumber`] where there are open shapes (other than triangles), or custom geometry that offers none.
    pub fn winding_number(&self, point: DVec3) -> Result<f64, NoWindingNumber> {
        winding::winding_number(self, point, 0.0, Some(winding::FAR))
    }

    /// [`Accel::winding_number`] at a time, in the unit of the keys of what moves; without one, it is 0.
    ///
    /// # Errors
    /// As there.
    pub fn winding_number_at(&self, point: DVec3, time: f64) -> Result<f64, NoWindingNumber> {
        winding::winding_number(self, point, time, Some(winding::FAR))
    }

    /// [`Accel::winding_number`] as the sum over every triangle, exact up to rounding.
    ///
    /// # Errors
    /// As there.
    pub fn winding_number_exact(&self, point: DVec3) -> Result<f64, NoWindingNumber> {
        winding::winding_number(self, point, 0.0, None)
    }

    /// The surface at a hit of this tree, in the space of this tree. For triangles `uv` are the barycentrics (b1, b2).
    ///
    /// # Panics
    /// When `hit` comes from another tree and names what is not in this one.
    pub fn surface(&self, ray: &Ray, hit: &Hit) -> Surface {
        surface::surface(self, ray, hit)
    }

    /// The surface at a hit of this tree, in the space of the hit's innermost instance.
    ///
    /// # Panics
    /// When `hit` comes from another tree and names what is not in this one.
    pub fn surface_in_object(&self, ray: &Ray, hit: &Hit) -> Surface {
        surface::surface_in_object(self, ray, hit)
    }

    /// The map from the space of the hit's innermost instance to the space of this tree, at the time of the ray.
    ///
    /// # Panics
    /// When `hit` comes from another tree and names what is not in this one.
    pub fn world_from_object(&self, ray: &Ray, hit: &Hit) -> Transform {
        surface::world_from_object(self, ray, hit)
    }

    /// What was hit, and where it stands at the time of the ray.
    ///
    /// # Panics
    /// When `hit` comes from another tree and names what is not in this one.
    pub fn target(&self, ray: &Ray, hit: &Hit) -> Target<'_> {
        surface::target(self, ray, hit)
    }

    /// A box around everything finite in it.
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// How many primitives it holds itself, those of its instances not counted.
    pub fn primitive_count(&self) -> usize {
        self.primitives
    }

    /// Bytes of the tree itself: nodes, leaves and references, not the meshes, not the instances' trees, and not what lies in a
    /// mapped file.
    pub fn memory_bytes(&self) -> usize {
        fn bytes<T>(v: &Vec<T>) -> usize {
            v.capacity() * size_of::<T>()
        }
        size_of::<Self>()
            + bytes(&self.geometries)
            + self.tree.nodes.own_bytes()
            + self.tree.blocks.own_bytes()
            + self.tree.names.own_bytes()
            + self.tree.entries.own_bytes()
            + self.tree.sphere_blocks.own_bytes()
            + self.tree.sphere_names.own_bytes()
            + self.bounding_volumes.memory_bytes()
            + bytes(&self.infinite)
            + bytes(&self.masks)
            + self.moments.get().map_or(0, Moments::memory_bytes)
            + self.flats.get().map_or(0, Flats::memory_bytes)
    }

    /// What the corners of a mesh are relative to.
    pub(crate) fn mesh_origin(&self, geometry: u32) -> DVec3 {
        match &self.geometries[geometry as usize].kind {
            GeometryKind::Mesh(mesh) => mesh.origin,
            _ => unreachable!("blocks are of meshes"),
        }
    }

    /// The corners of a triangle in double precision.
    pub(crate) fn precise_corners(&self, geometry: u32, primitive: u32) -> [DVec3; 3] {
        match &self.geometries[geometry as usize].kind {
            GeometryKind::PreciseMesh(mesh) => mesh.corners(primitive),
            _ => unreachable!("the leaf says so"),
        }
    }

    /// A cloud of spheres.
    #[inline(always)]
    pub(crate) fn cloud(&self, geometry: u32) -> &SphereCloud {
        match &self.geometries[geometry as usize].kind {
            GeometryKind::Spheres(cloud) => cloud,
            _ => unreachable!("blocks of spheres are of clouds"),
        }
    }

    /// The entry of an instance: those in the tree count first, then those outside it.
    #[inline(always)]
    pub(crate) fn instance_entry(&self, index: usize) -> &Entry {
        let inside = &self.tree.entries;
        inside.get(index).unwrap_or_else(|| &self.infinite[index - inside.len()])
    }
}
