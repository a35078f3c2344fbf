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
use crate::tree::{Geometry, GeometryKind, Instance, Tree};
use crate::{listing, surface};

/// A bounding volume hierarchy over geometries, ready for queries from any number of threads.
///
/// The same geometries give the same tree with any number of threads, and every query the same answer on any machine:
/// hits depend neither on the order of the traversal nor on the instruction set.
///
/// A clone shares the tree, and so do [instances](Accel::instance). They never see it change: see [`Accel::refit`].
#[derive(Clone, Debug)]
pub struct Accel {
    pub(crate) tree: Arc<Tree>,
    pub(crate) isa: Isa,
    pub(crate) queries: Queries,
    /// The queries of single-precision rays, unless those are answered in double precision.
    pub(crate) f32_queries: Option<F32Queries>,
}

impl Accel {
    /// Builds a tree over `geometries`. Zero-area triangles and spheres without a radius are left out: they are never
    /// hit.
    ///
    /// The build runs on the threads of the rayon pool that it is called in. A calling thread outside the pool waits
    /// until its threads have woken up, which may take as long as a small build; a thread that joined the pool by
    /// `use_current_thread` begins immediately.
    ///
    /// # Errors
    /// [`BuildError`] if a mesh refers to vertices that it lacks, a coordinate or a radius is not finite, or there are
    /// 2^28 primitives or more.
    pub fn build(geometries: Vec<Geometry>, options: &BuildOptions) -> Result<Self, BuildError> {
        input::build(geometries, options).map(Self::over)
    }

    /// Moves the contents of the tree: `geometries` are the ones that it was built from, with other vertices, shapes,
    /// transforms or trees of instances. The tree keeps its structure and gets new boxes. Queries answer as after a
    /// build.
    ///
    /// A refit takes a sixth of the time of a build, or half of it if meshes have other indices than before. But boxes
    /// grow where neighbours move apart, and queries become slower. The return value says by how much: the approximate
    /// cost of a ray as a multiple of that after the build, about 1 if everything moved together. As a rule of thumb,
    /// [rebuild partially](Self::rebuild_partially) above 1.1, and build again if it is still above 1.5 then: with more
    /// than a few rays per primitive, queries lose more time than that takes.
    ///
    /// An opened instance (see [`Preset::Balanced`](crate::Preset::Balanced)) whose new tree has other nodes is entered
    /// as a whole, until a tree comes that has these nodes.
    ///
    /// If an instance or a clone shares the tree, a copy is refitted, and they keep the old one. So refit trees from
    /// the inside out: after a tree, refit the trees that contain it, with its new [`Accel::instance`]. To save the
    /// copy, drop the others first.
    ///
    /// # Errors
    /// [`RefitError`] if the geometries are invalid, or not of the same kinds and sizes, or something that was left out
    /// of the tree would now have to be in it. The tree stays unchanged then.
    pub fn refit(&mut self, geometries: Vec<Geometry>) -> Result<f64, RefitError> {
        self.change(|tree| refit::refit(tree, geometries))
    }

    /// Rebuilds partially what refits have moved. Queries answer as before, to the bit.
    ///
    /// Leaves of triangles and of spheres stay as they are, with up to eight primitives each, and get new nodes as
    /// triangles do in a build; shapes, instances and custom geometry are rebuilt completely. That takes about a third
    /// of the time of a build. It is as good as a build if primitives of a leaf have moved together, as on the surfaces
    /// of bodies that bend, turn or move. Otherwise, as in a cloud of dust, only a build helps. A result that would be
    /// worse than the present tree is discarded.
    ///
    /// The return value is that of [`refit`](Self::refit): the cost of a ray as a multiple of that after the build. The
    /// rules there for trees that contain this one apply here too.
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

    /// Changes the tree, or a copy of it if it is shared.
    fn change<T>(&mut self, change: impl FnOnce(&mut Tree) -> T) -> T {
        let result = change(Arc::make_mut(&mut self.tree));
        self.queries = Queries::of(self.isa, &self.tree);
        self.f32_queries = F32Queries::of(self.isa, &self.tree);
        result
    }

    /// The tree, placed, for use in another tree as [`GeometryKind::Instance`](crate::GeometryKind::Instance).
    pub fn instance(&self, world_from_object: impl Into<Placement>) -> Instance {
        Instance { tree: Arc::clone(&self.tree), world_from_object: world_from_object.into() }
    }

    /// The structure of the tree as bytes for a file: about six per triangle, on any machine. The geometries are not
    /// included. Save trees of instances separately.
    pub fn to_bytes(&self) -> Vec<u8> {
        bytes::to_bytes(&self.tree)
    }

    /// The tree that [`Accel::to_bytes`] wrote, over the geometries that it was built from: the same to the bit, in a
    /// fraction of the time of a build. If vertices, shapes or transforms have moved since, it is refitted, as by
    /// [`Accel::refit`].
    ///
    /// The bytes need not be trusted: for any bytes, the tree either answers correctly or is refused.
    ///
    /// # Errors
    /// [`LoadError`] if the bytes are no tree, of another version, incomplete or damaged, or the geometries do not
    /// match.
    pub fn from_bytes(bytes: &[u8], geometries: Vec<Geometry>) -> Result<Self, LoadError> {
        bytes::from_bytes(bytes, geometries).map(Self::over)
    }

    /// Writes the tree to a file that [`Accel::map`] uses in place: thirty to sixty bytes per triangle. The geometries
    /// and the trees of instances are not included. An existing file is replaced as a whole once the new one is
    /// complete; processes that have it mapped keep the old one.
    ///
    /// # Errors
    /// If the file cannot be written, or the machine is not little-endian.
    pub fn save(&self, path: impl AsRef<Path>) -> io::Result<()> {
        mapped::save(&self.tree, path.as_ref())
    }

    /// The tree that [`Accel::save`] wrote, over the geometries that it was saved with. Its nodes and leaves stay in
    /// the file, which is mapped into memory, so that little is read before it is needed, and processes share the
    /// pages.
    ///
    /// The whole file is checked once: its checksum and every reference in it; the boxes in it are trusted. If
    /// geometries have moved since, it is refused: use [`Accel::from_bytes`] for that. A later [`Accel::refit`] copies
    /// the tree into memory.
    ///
    /// **While it is mapped, nobody may write to the file or truncate it.** Reading what another process truncated ends
    /// this process (by the signal SIGBUS, on Unix), and changes in place have undefined results. Replacing the file,
    /// as `save` does, and removing it are fine.
    ///
    /// # Errors
    /// [`MapError`] if the file cannot be mapped, is damaged, or is of another version or of other geometries.
    pub fn map(path: impl AsRef<Path>, geometries: Vec<Geometry>) -> Result<Self, MapError> {
        mapped::map(path.as_ref(), geometries).map(Self::over)
    }

    /// The closest hit in the ray's range. Of hits at the same `t`, one that enters comes before one that leaves, then
    /// the one whose (path, geometry, primitive) comes first, by positions in the lists that the trees were built from.
    #[inline]
    pub fn closest(&self, ray: &Ray) -> Option<Hit> {
        self.queries.closest.ask(&self.tree, ray)
    }

    /// Whether anything is hit in the ray's range.
    #[inline]
    pub fn any(&self, ray: &Ray) -> bool {
        self.queries.any.ask(&self.tree, ray)
    }

    /// [`Accel::closest`] among the hits that a query includes. Each crossing of a shape counts separately.
    #[inline]
    pub fn closest_with(&self, ray: &Ray, query: &Query) -> Option<Hit> {
        if query.takes_all(&self.tree) {
            self.closest(ray)
        } else {
            self.closest_with_at(self.isa, ray, query)
        }
    }

    /// [`Accel::any`] among the hits that a query includes.
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

    /// [`Accel::closest`] in double precision only: the same answer to the bit, slower. For measurements.
    #[doc(hidden)]
    pub fn closest_exact(&self, ray: &Ray) -> Option<Hit> {
        exact::closest(self.isa, &self.tree, ray, None)
    }

    /// [`Accel::any`] in double precision only. For measurements.
    #[doc(hidden)]
    pub fn any_exact(&self, ray: &Ray) -> bool {
        exact::any(self.isa, &self.tree, ray, None)
    }

    /// Visits every hit in the ray's range in ascending order of `t` (ties by path, geometry, primitive), until `visit`
    /// breaks.
    ///
    /// Hits are found in batches of 32, 128, 512 and so on, so that an early end costs little and memory is at most
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

    /// The number of hits in the ray's range.
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
    /// A tree of meshes only answers in single precision. It tests the triangles as seen from the ray, with rounded
    /// corners: a ray through a closed mesh hits it, also at edges and corners, which belong to all their triangles.
    /// The point at `t` lies within about 2⁻²⁰ of its distance and of the tree's size from the triangle. So near an
    /// edge, another triangle may be hit than in double precision, and on a triangle seen nearly on edge, `t` may
    /// differ by more. Of hits at the same `t`, the one whose geometry and primitive come first is the answer. It is
    /// the same on any machine and for any build.
    ///
    /// Other trees, and rays from farther than sixteen sizes of the tree, answer in double precision, rounded.
    #[inline]
    pub fn closest_f32(&self, ray: &Ray32) -> Option<Hit32> {
        match &self.f32_queries {
            Some(queries) => queries.closest.ask(&self.tree, ray),
            None => f32_ray::closest_widened(self.isa, &self.tree, ray),
        }
    }

    /// Whether a ray in single precision hits anything in its range: whether [`Accel::closest_f32`] returns a hit.
    #[inline]
    pub fn any_f32(&self, ray: &Ray32) -> bool {
        match &self.f32_queries {
            Some(queries) => queries.any.ask(&self.tree, ray),
            None => f32_ray::any_widened(self.isa, &self.tree, ray),
        }
    }

    /// [`Accel::closest`] for every ray, with the same answers to the bit; `hits` has a slot for each.
    ///
    /// In a tree with triangles, sixteen consecutive coherent rays (of a square of four by four pixels rather than of
    /// sixteen pixels in a line) are traversed as a packet, which takes down to two fifths of the time; many of the
    /// others are interleaved. A thousand rays or more per call are answered fastest. Other leaves than triangles, and
    /// all trees on a machine without AVX2, are traversed ray by ray. The call runs on the calling thread: to use more
    /// threads, split `rays` and `hits`.
    ///
    /// # Panics
    /// If `rays` and `hits` differ in length.
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

    /// The rounding of picture rays at their start, and of triangles of meshes in the tree itself; `None` if rays are
    /// traversed in double precision.
    ///
    /// A point on such a triangle from which rays leave must be farther off by that: add [`PictureRounding::error`] to
    /// [`Surface::point_error`]. [`Accel::picture_surface`] does so, in instances too; other primitives, met in double
    /// precision, need nothing.
    ///
    /// # Error bound
    ///
    /// Let u = 2⁻²⁴, n the unit normal of a triangle, |n|₁ the sum of its absolute components, and lengths be in tree
    /// units. A ray that leaves the triangle starts at a distance D from its plane and does not come nearer to it. Its
    /// start is rounded by u |o - origin| on each axis; in an instance, its direction too, by u on each axis, which
    /// brings it nearer by less than 3.5u |n|₁ on its way through the tree. If single precision finds a hit, the point
    /// of the rounded ray lies within u(47 + 14·1.01) < 61.2u of the triangle on each axis (see `trace::f32_ray`), and
    /// so within 61.2u |n|₁ of the plane. There is no hit if D > u Σ |nᵢ| |oᵢ - originᵢ| + 64.7u |n|₁.
    ///
    /// With the error e on each axis, [`Surface::offset_origin`] moves the point by Σ |nᵢ| eᵢ + 4 max e, and 4 max e is
    /// at least 4/√3 Σ |nᵢ| eᵢ as |n|₁ ≤ √3: 3.3 Σ |nᵢ| eᵢ in total. So e = 2u |p - origin| + 20u covers it, and the
    /// distance of o from p. Code that moves points by less needs a larger error.
    ///
    /// Under the map L of an instance, the error is |L| e, and the unit normal m = L⁻ᵀn / |L⁻ᵀn|. A move by d along m
    /// is one by d |L⁻ᵀn| across the plane of the triangle in its own space, and Σ |mᵢ| (|L| e)ᵢ ≥ Σ |nᵢ| eᵢ / |L⁻ᵀn|:
    /// there, too, it is moved by 3.3 Σ |nᵢ| eᵢ or more.
    pub fn picture_rounding(&self) -> Option<PictureRounding> {
        self.tree.picture_start().map(|picture| picture.rounding)
    }

    /// [`Accel::surface`] at a hit of [`Accel::closest_columns`]. Its error is large enough that picture rays that
    /// leave the point by [`Surface::offset_origin`] do not hit its triangle: see [`Accel::picture_rounding`].
    ///
    /// # Panics
    /// If `hit` comes from another tree and refers to geometry that this one lacks.
    pub fn picture_surface(&self, ray: &Ray, hit: &Hit) -> Surface {
        surface::picture_surface(&self.tree, ray, hit)
    }

    /// The map of an instance of the tree that stands still, by its position in the list that the tree was built from,
    /// and the rounding of picture rays at triangles of meshes that are directly in it, in its own space.
    pub fn still_instance(&self, position: u32) -> Option<(&Transform, Option<PictureRounding>)> {
        let GeometryKind::Instance(Instance { tree, world_from_object: Placement::Still(map) }) =
            &self.tree.geometries.get(position as usize)?.kind
        else {
            return None;
        };
        // Without a picture start, all rays are in double precision, in instances too.
        let picture = self.tree.picture_start().and(tree.picture.as_ref());
        Some((map, picture.map(|picture| picture.rounding)))
    }

    /// The closest hits of picture rays.
    ///
    /// For triangles of meshes, rays are rounded to single precision once, relative to the origin of the meshes (in an
    /// instance, after they are transformed into its space), and tested as [`Accel::closest_f32`] tests them: a ray
    /// through a closed mesh hits it. All other primitives are met by the original ray in double precision. Trees
    /// without [`Accel::picture_rounding`], rays from farther than sixteen sizes of the tree, and all rays if `exact`
    /// is set answer as [`Accel::closest`]. Answers are the same on any machine, and do not depend on the other rays.
    /// Consecutive coherent rays are traversed as in [`Accel::closest_batch`].
    ///
    /// # Panics
    /// If columns differ in length.
    pub fn closest_columns(&self, rays: &RayColumns, exact: bool, hits: &mut HitColumns) {
        batch::columns::closest(self.isa, &self.tree, rays, exact, hits);
    }

    /// Whether picture rays hit anything: whether [`Accel::closest_columns`] finds a hit.
    ///
    /// # Panics
    /// If columns differ in length.
    pub fn any_columns(&self, rays: &RayColumns, exact: bool, occluded: &mut Vec<bool>) {
        batch::columns::any(self.isa, &self.tree, rays, exact, occluded);
    }

    /// The tree with a mask for each of its geometries, by position, for [`Query::mask`]. Without masks, all bits are
    /// set. They are saved with the tree, and stay through a refit.
    ///
    /// # Panics
    /// If the numbers of masks and geometries differ.
    #[must_use]
    pub fn with_masks(mut self, masks: Vec<u32>) -> Self {
        assert_eq!(masks.len(), self.tree.geometries.len(), "a mask for each geometry");
        Arc::make_mut(&mut self.tree).masks = masks;
        self
    }

    /// The nearest point of all surfaces within `max_distance` (inclusive; may be infinite), or `None` if there is
    /// none. Of points at the same distance, the one whose (path, geometry, primitive) comes first. Triangles without
    /// area and spheres without a radius count as lines and points, although no ray hits them: the first call collects
    /// them. A point that is not finite has no nearest point.
    ///
    /// Distances to triangles are exact up to rounding under any map; distances to shapes are where
    /// [`Shape::closest_point`](lumbre_geometry::Shape::closest_point) has a method.
    ///
    /// # Errors
    /// [`ClosestPointError`] if something without an answer may be nearer: a shape without a method, or custom geometry
    /// that offers none. Such geometry farther away than the nearest point does no harm.
    pub fn closest_point(
        &self,
        point: DVec3,
        max_distance: f64,
    ) -> Result<Option<ClosestPoint>, ClosestPointError> {
        closest_point::closest_point(&self.tree, point, max_distance, 0.0)
    }

    /// [`Accel::closest_point`] at a time, in the unit of motion keys; without one, it is 0.
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

    /// Whether a point is inside the surfaces, even-odd: inside two overlapping bodies, or in a body within a body, it
    /// is outside again. See [`Accel::winding_number`] for another answer.
    ///
    /// Solid shapes answer directly. For everything else, crossings are counted along five fixed directions, and the
    /// majority decides: for closed meshes all agree. An open surface has no inside; the answer is arbitrary but always
    /// the same. Nothing is around a point that is not finite.
    pub fn is_inside(&self, point: DVec3) -> bool {
        inside::is_inside(&self.tree, point, 0.0)
    }

    /// [`Accel::is_inside`] at a time, in the unit of motion keys; without one, it is 0.
    pub fn is_inside_at(&self, point: DVec3, time: f64) -> bool {
        inside::is_inside(&self.tree, point, time)
    }

    /// How often surfaces wind around a point: 1 inside a closed mesh whose triangles run counter-clockwise as seen
    /// from outside, -1 if they run clockwise, 0 outside, the sum where bodies overlap; a fraction if a mesh is open,
    /// by the share of directions that it covers. More than 0.5 is a good rule for "inside" if meshes have gaps.
    ///
    /// Solid shapes count 1 inside and 0 outside. Mirrored instances keep the sides of their meshes. Nothing winds
    /// around a point that is not finite.
    ///
    /// Distant meshes are approximated, with an error of up to a thousandth; [`Accel::winding_number_exact`] is exact.
    /// The first call visits every triangle and keeps about 350 bytes for every node of the tree. In instances whose
    /// maps do not preserve angles, every triangle is visited.
    ///
    /// # Errors
    /// [`WindingNumberError`] if there are open shapes (other than triangles), or custom geometry that offers no
    /// answer.
    pub fn winding_number(&self, point: DVec3) -> Result<f64, WindingNumberError> {
        winding::winding_number(&self.tree, point, 0.0, Some(winding::FAR))
    }

    /// [`Accel::winding_number`] at a time, in the unit of motion keys; without one, it is 0.
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
    /// If `hit` comes from another tree and refers to geometry that this one lacks.
    pub fn surface(&self, ray: &Ray, hit: &Hit) -> Surface {
        surface::surface(&self.tree, ray, hit)
    }

    /// The surface at a hit of this tree, in the space of the hit's innermost instance.
    ///
    /// # Panics
    /// If `hit` comes from another tree and refers to geometry that this one lacks.
    pub fn surface_in_object(&self, ray: &Ray, hit: &Hit) -> Surface {
        surface::surface_in_object(&self.tree, ray, hit)
    }

    /// The map from the space of the hit's innermost instance to the space of this tree, at the time of the ray.
    ///
    /// # Panics
    /// If `hit` comes from another tree and refers to geometry that this one lacks.
    pub fn world_from_object(&self, ray: &Ray, hit: &Hit) -> Transform {
        surface::world_from_object(&self.tree, ray, hit)
    }

    /// What was hit, and where it is at the time of the ray.
    ///
    /// # Panics
    /// If `hit` comes from another tree and refers to geometry that this one lacks.
    pub fn target(&self, ray: &Ray, hit: &Hit) -> Target<'_> {
        surface::target(&self.tree, ray, hit)
    }

    /// Visits every primitive, including ones that no ray can hit, as a hit without a crossing (its `t` is NaN), until
    /// `visit` breaks. The primitives of an instance are visited once for each instance. [`Accel::target`] says what
    /// each is, and where it is.
    pub fn each_primitive(&self, mut visit: impl FnMut(&Hit) -> ControlFlow<()>) {
        let _ = listing::each(&self.tree, &mut visit);
    }

    /// Bounds of all finite geometry in the tree.
    pub fn bounds(&self) -> Aabb {
        self.tree.bounds
    }

    /// Number of primitives in the tree itself, not counting those of its instances.
    pub fn primitive_count(&self) -> usize {
        self.tree.primitives
    }

    /// Bytes of the tree itself: nodes, leaves and references, without meshes, trees of instances, and mapped files.
    pub fn memory_bytes(&self) -> usize {
        fn bytes<T>(v: &Vec<T>) -> usize {
            v.capacity() * size_of::<T>()
        }
        size_of::<Self>()
            + size_of::<Tree>()
            + bytes(&self.tree.geometries)
            + self.tree.packed.nodes.own_bytes()
            + self.tree.packed.blocks.own_bytes()
            + self.tree.packed.ids.own_bytes()
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
