//! The tree and its queries.

use std::io;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

use lumbre_geometry::{Aabb, Ray, Surface};
use lumbre_math::{DVec3, Transform};

use crate::batch;
use crate::build::error::BuildError;
use crate::build::options::BuildOptions;
use crate::build::refit::RefitError;
use crate::build::{input, rebuild, refit};
use crate::columns::{HitColumns, RayColumns};
use crate::hit::{Hit, Target};
use crate::intersect::Isa;
use crate::io::bytes::LoadError;
use crate::io::mapped::MapError;
use crate::io::{bytes, mapped};
use crate::point::closest_point::{ClosestPoint, ClosestPointError};
use crate::point::winding::{self, WindingNumberError};
use crate::point::{closest_point, inside};
use crate::query::Query;
use crate::ray32::{Hit32, Ray32};
use crate::trace::f32_ray::{self, F32Queries};
use crate::trace::filtered::{self, Queries};
use crate::trace::stack::{AnyHit, ClosestHit};
use crate::trace::visitors::{Count, NextHits};
use crate::trace::{ContextRef, Outcome, exact};
use crate::tree::flats::Flats;
use crate::tree::geometry::Placement;
use crate::tree::moments::Moments;
use crate::tree::picture_start::PictureRounding;
use crate::tree::{Geometry, Instance, Tree};
use crate::{listing, surface};

/// A bounding volume hierarchy over geometries, ready for queries from any number of threads.
///
/// The same geometries give the same tree from any number of threads, and every query the same answer on any machine:
/// hits do not depend on the order of the visit, nor on the instruction set.
///
/// A clone shares the tree, and so do [instances](Accel::instance). None sees it change: see [`Accel::refit`].
#[derive(Clone, Debug)]
pub struct Accel {
    pub(crate) tree: Arc<Tree>,
    pub(crate) isa: Isa,
    pub(crate) queries: Queries,
    /// Those of rays in single precision, where these are not asked in double.
    pub(crate) f32_queries: Option<F32Queries>,
}

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
        input::build(geometries, options).map(Self::over)
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
    /// Where an instance was opened (see [`Preset::Balanced`](crate::Preset::Balanced)) and its new tree has other nodes, it is whole
    /// again, until a tree comes that has these nodes.
    ///
    /// Where an instance or a clone shares the tree, a copy is refitted, and they keep the old one. So trees that hold this one as an
    /// instance are to be refitted after it, with its new [`Accel::instance`], from the inside out. To save the copy, drop the others
    /// first.
    ///
    /// # Errors
    /// [`RefitError`] when the geometries are not sound, or not of the same kinds and sizes, or something that has no place
    /// in the tree would now need one. The tree is then as it was.
    pub fn refit(&mut self, geometries: Vec<Geometry>) -> Result<f64, RefitError> {
        self.change(|tree| refit::refit(tree, geometries))
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
        self.change(|tree| rebuild::rebuild_partially(tree, options))
    }

    /// The queries of a tree.
    pub(crate) fn over(tree: Tree) -> Self {
        let isa = Isa::best();
        let queries = Queries::of(isa, &tree);
        let f32_queries = F32Queries::of(isa, &tree);
        Self { tree: Arc::new(tree), isa, queries, f32_queries }
    }

    /// Changes the tree, or a copy of it where it is shared.
    fn change<T>(&mut self, change: impl FnOnce(&mut Tree) -> T) -> T {
        let result = change(Arc::make_mut(&mut self.tree));
        self.queries = Queries::of(self.isa, &self.tree);
        self.f32_queries = F32Queries::of(self.isa, &self.tree);
        result
    }

    /// The tree, placed: what stands in another tree as [`GeometryKind::Instance`](crate::GeometryKind::Instance).
    pub fn instance(&self, world_from_object: impl Into<Placement>) -> Instance {
        Instance { tree: Arc::clone(&self.tree), world_from_object: world_from_object.into() }
    }

    /// How the tree is put together, as bytes for a file: some six a triangle, whatever the machine. The geometries are not
    /// in them. Trees that stand in this one as instances are saved by themselves.
    pub fn to_bytes(&self) -> Vec<u8> {
        bytes::to_bytes(&self.tree)
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
        bytes::from_bytes(bytes, geometries).map(Self::over)
    }

    /// Writes the tree to a file that [`Accel::map`] uses in place: thirty to sixty bytes a triangle. The geometries are not in it,
    /// nor the trees that stand in this one as instances. A file that is there already is replaced as a whole once the new one
    /// is complete; who has it mapped keeps the old one.
    ///
    /// # Errors
    /// When the file cannot be written, or the machine is not little-endian.
    pub fn save(&self, path: impl AsRef<Path>) -> io::Result<()> {
        mapped::save(&self.tree, path.as_ref())
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
        mapped::map(path.as_ref(), geometries).map(Self::over)
    }

    /// The closest hit in the ray's range. Of hits at the same `t`, the one whose (path, geometry, primitive) comes
    /// first, by positions in the lists that the trees were built from.
    #[inline]
    pub fn closest(&self, ray: &Ray) -> Option<Hit> {
        self.queries.closest.ask(&self.tree, ray)
    }

    /// Whether anything is hit in the ray's range.
    #[inline]
    pub fn any(&self, ray: &Ray) -> bool {
        self.queries.any.ask(&self.tree, ray)
    }

    /// [`Accel::closest`] among what a query takes into account. Of a shape, each crossing counts by itself.
    #[inline]
    pub fn closest_with(&self, ray: &Ray, query: &Query) -> Option<Hit> {
        if query.takes_all(&self.tree) {
            self.closest(ray)
        } else {
            self.closest_with_at(self.isa, ray, query)
        }
    }

    /// [`Accel::any`] among what a query takes into account.
    #[inline]
    pub fn any_with(&self, ray: &Ray, query: &Query) -> bool {
        if query.takes_all(&self.tree) { self.any(ray) } else { self.any_with_at(self.isa, ray, query) }
    }

    pub(crate) fn closest_with_at(&self, isa: Isa, ray: &Ray, query: &Query) -> Option<Hit> {
        match filtered::with_query::<ClosestHit>(isa, &self.tree, ray, query) {
            Outcome::Certain(found) => found.into_hit(&self.tree, ContextRef::OUTSIDE),
            Outcome::Uncertain => exact::closest(isa, &self.tree, ray, Some(query)),
        }
    }

    pub(crate) fn any_with_at(&self, isa: Isa, ray: &Ray, query: &Query) -> bool {
        match filtered::with_query::<AnyHit>(isa, &self.tree, ray, query) {
            Outcome::Certain(is_hit) => is_hit,
            Outcome::Uncertain => exact::any(isa, &self.tree, ray, Some(query)),
        }
    }

    /// [`Accel::closest`] by double precision alone: the same answer to the bit, slower. To be measured beside it.
    #[doc(hidden)]
    pub fn closest_exact(&self, ray: &Ray) -> Option<Hit> {
        exact::closest(self.isa, &self.tree, ray, None)
    }

    /// [`Accel::any`] by double precision alone. To be measured beside it.
    #[doc(hidden)]
    pub fn any_exact(&self, ray: &Ray) -> bool {
        exact::any(self.isa, &self.tree, ray, None)
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
            exact::traverse(isa, &self.tree, ray, &mut visitor);
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
        exact::traverse(isa, &self.tree, ray, &mut visitor);
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
            Some(queries) => queries.closest.ask(&self.tree, ray),
            None => f32_ray::closest_widened(self.isa, &self.tree, ray),
        }
    }

    /// Whether a ray in single precision hits anything in its range: whether there is an answer of [`Accel::closest_f32`].
    #[inline]
    pub fn any_f32(&self, ray: &Ray32) -> bool {
        match &self.f32_queries {
            Some(queries) => queries.any.ask(&self.tree, ray),
            None => f32_ray::any_widened(self.isa, &self.tree, ray),
        }
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
        batch::closest(self.isa, &self.tree, rays, hits);
    }

    /// [`Accel::any`] for every ray: see [`Accel::closest_batch`].
    ///
    /// # Panics
    /// When `rays` and `hits` differ in length.
    pub fn any_batch(&self, rays: &[Ray], hits: &mut [bool]) {
        assert_eq!(rays.len(), hits.len(), "a slot for the answer of every ray");
        batch::any(self.isa, &self.tree, rays, hits);
    }

    /// [`Accel::closest_f32`] for every ray: see [`Accel::closest_batch`].
    ///
    /// # Panics
    /// When `rays` and `hits` differ in length.
    pub fn closest_batch_f32(&self, rays: &[Ray32], hits: &mut [Option<Hit32>]) {
        assert_eq!(rays.len(), hits.len(), "a slot for the hit of every ray");
        batch::closest_f32(self.isa, &self.tree, rays, hits);
    }

    /// [`Accel::any_f32`] for every ray: see [`Accel::closest_batch`].
    ///
    /// # Panics
    /// When `rays` and `hits` differ in length.
    pub fn any_batch_f32(&self, rays: &[Ray32], hits: &mut [bool]) {
        assert_eq!(rays.len(), hits.len(), "a slot for the answer of every ray");
        batch::any_f32(self.isa, &self.tree, rays, hits);
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
        self.tree.picture_start().map(|picture| picture.rounding)
    }

    /// [`Accel::surface`] at a hit of [`Accel::closest_columns`], with an error by which rays of pictures that leave it by
    /// [`Surface::offset_origin`] do not hit its triangle: see [`Accel::picture_rounding`].
    ///
    /// # Panics
    /// When `hit` comes from another tree and names what is not in this one.
    pub fn picture_surface(&self, ray: &Ray, hit: &Hit) -> Surface {
        surface::picture_surface(&self.tree, ray, hit)
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
        batch::columns::closest(self.isa, &self.tree, rays, exact, hits);
    }

    /// Whether anything is hit by the rays of a picture: whether [`Accel::closest_columns`] finds something.
    ///
    /// # Panics
    /// When columns differ in length.
    pub fn any_columns(&self, rays: &RayColumns, exact: bool, occluded: &mut Vec<bool>) {
        batch::columns::any(self.isa, &self.tree, rays, exact, occluded);
    }

    /// The tree with a mask for each of its geometries, by position, for [`Query::mask`]; without, all bits are set.
    /// They are saved with it, and stay through a refit.
    ///
    /// # Panics
    /// When there are not as many masks as geometries.
    #[must_use]
    pub fn with_masks(mut self, masks: Vec<u32>) -> Self {
        assert_eq!(masks.len(), self.tree.geometries.len(), "a mask for each geometry");
        Arc::make_mut(&mut self.tree).masks = masks;
        self
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
    /// [`ClosestPointError`] where something may be nearer that has no answer: a shape without a method, or custom geometry
    /// that offers none. What is farther away than the nearest point does no harm.
    pub fn closest_point(
        &self,
        point: DVec3,
        max_distance: f64,
    ) -> Result<Option<ClosestPoint>, ClosestPointError> {
        closest_point::closest_point(&self.tree, point, max_distance, 0.0)
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
    ) -> Result<Option<ClosestPoint>, ClosestPointError> {
        closest_point::closest_point(&self.tree, point, max_distance, time)
    }

    /// Whether a point is inside of what stands here, even-odd: inside of two bodies that overlap, or in a body within a
    /// body, it is outside again. See [`Accel::winding_number`] for another answer.
    ///
    /// Solid shapes say it by themselves. Of everything else, crossings are counted along five fixed directions, and most
    /// of them decide: of closed meshes all say the same. What is open has no inside, and the answer there is some guess,
    /// always the same one. Nothing is around a point that is not finite.
    pub fn is_inside(&self, point: DVec3) -> bool {
        inside::is_inside(&self.tree, point, 0.0)
    }

    /// [`Accel::is_inside`] at a time, in the unit of the keys of what moves; without one, it is 0.
    pub fn is_inside_at(&self, point: DVec3, time: f64) -> bool {
        inside::is_inside(&self.tree, point, time)
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
    /// [`WindingNumberError`] where there are open shapes (other than triangles), or custom geometry that offers none.
    pub fn winding_number(&self, point: DVec3) -> Result<f64, WindingNumberError> {
        winding::winding_number(&self.tree, point, 0.0, Some(winding::FAR))
    }

    /// [`Accel::winding_number`] at a time, in the unit of the keys of what moves; without one, it is 0.
    ///
    /// # Errors
    /// As there.
    pub fn winding_number_at(&self, point: DVec3, time: f64) -> Result<f64, WindingNumberError> {
        winding::winding_number(&self.tree, point, time, Some(winding::FAR))
    }

    /// [`Accel::winding_number`] as the sum over every triangle, exact up to rounding.
    ///
    /// # Errors
    /// As there.
    pub fn winding_number_exact(&self, point: DVec3) -> Result<f64, WindingNumberError> {
        winding::winding_number(&self.tree, point, 0.0, None)
    }

    /// The surface at a hit of this tree, in the space of this tree. For triangles `uv` are the barycentrics (b1, b2).
    ///
    /// # Panics
    /// When `hit` comes from another tree and names what is not in this one.
    pub fn surface(&self, ray: &Ray, hit: &Hit) -> Surface {
        surface::surface(&self.tree, ray, hit)
    }

    /// The surface at a hit of this tree, in the space of the hit's innermost instance.
    ///
    /// # Panics
    /// When `hit` comes from another tree and names what is not in this one.
    pub fn surface_in_object(&self, ray: &Ray, hit: &Hit) -> Surface {
        surface::surface_in_object(&self.tree, ray, hit)
    }

    /// The map from the space of the hit's innermost instance to the space of this tree, at the time of the ray.
    ///
    /// # Panics
    /// When `hit` comes from another tree and names what is not in this one.
    pub fn world_from_object(&self, ray: &Ray, hit: &Hit) -> Transform {
        surface::world_from_object(&self.tree, ray, hit)
    }

    /// What was hit, and where it stands at the time of the ray.
    ///
    /// # Panics
    /// When `hit` comes from another tree and names what is not in this one.
    pub fn target(&self, ray: &Ray, hit: &Hit) -> Target<'_> {
        surface::target(&self.tree, ray, hit)
    }

    /// Visits every primitive, also those that no ray meets, as a hit without a crossing (its `t` is not a number), until `visit`
    /// breaks; the primitives of an instance come once for each instance. [`Accel::target`] says what each is, and where it stands.
    pub fn each_primitive(&self, mut visit: impl FnMut(&Hit) -> ControlFlow<()>) {
        let _ = listing::each(&self.tree, &mut visit);
    }

    /// A box around everything finite in it.
    pub fn bounds(&self) -> Aabb {
        self.tree.bounds
    }

    /// How many primitives it holds itself, those of its instances not counted.
    pub fn primitive_count(&self) -> usize {
        self.tree.primitives
    }

    /// Bytes of the tree itself: nodes, leaves and references, not the meshes, not the instances' trees, and not what lies in a
    /// mapped file.
    pub fn memory_bytes(&self) -> usize {
        fn bytes<T>(v: &Vec<T>) -> usize {
            v.capacity() * size_of::<T>()
        }
        size_of::<Self>()
            + size_of::<Tree>()
            + bytes(&self.tree.geometries)
            + self.tree.packed.nodes.own_bytes()
            + self.tree.packed.blocks.own_bytes()
            + self.tree.packed.names.own_bytes()
            + self.tree.packed.entries.own_bytes()
            + self.tree.packed.sphere_blocks.own_bytes()
            + self.tree.packed.sphere_ids.own_bytes()
            + self.tree.bounding_volumes.memory_bytes()
            + bytes(&self.tree.infinite)
            + bytes(&self.tree.masks)
            + self.tree.moments.get().map_or(0, Moments::memory_bytes)
            + self.tree.flats.get().map_or(0, Flats::memory_bytes)
    }
}
