//! The tree and its queries.

use std::fmt;
use std::io;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::OnceLock;

use lumbre_geometry::{Aabb, Ray, Surface};
use lumbre_math::{DVec3, Transform};

use crate::anything::{self, Sought};
use crate::batch::Ends;
use crate::collapse::{Entry, Packed};
use crate::holds::{Contents, Holds, SingleStart};
use crate::hulls::Hulls;
use crate::lanes::{self, Level};
use crate::narrow::{self, NarrowQuestions};
use crate::node::{Units, tag};
use crate::query::{All, Any, Batch, Closest, Count, Filter, If};
use crate::single::{self, Nearest, Outcome, Questions, Whether, Winner};
use crate::traverse::{Place, Standing};
use crate::winding::{self, Moments};
use crate::{
    ClosestPoint, Geometry, GeometryKind, Hit, Hit32, LoadError, MapError, NoClosestPoint, NoWindingNumber,
    QueryOptions, Ray32, RefitError, SphereCloud, batch, file, inside, nearest, prepare, rebuild, refit,
    save, surface, traverse,
};

/// A bounding volume hierarchy over geometries, ready for queries from any number of threads.
///
/// The same geometries give the same tree from any number of threads, and every query the same answer on any machine:
/// hits do not depend on the order of the visit, nor on the instruction set.
#[derive(Debug)]
pub struct Accel {
    pub(crate) geometries: Vec<Geometry>,
    pub(crate) units: Units,
    pub(crate) tree: Packed,
    // Kept out of the tree, and asked by every ray.
    pub(crate) infinite: Vec<Entry>,
    pub(crate) bounds: Aabb,
    pub(crate) primitives: usize,
    pub(crate) level: Level,
    pub(crate) holds: Holds,
    /// Where single precision can search the tree.
    pub(crate) single: Option<SingleStart>,
    /// What is asked of it at the best level.
    pub(crate) questions: Questions,
    /// The same of rays in single precision.
    pub(crate) narrow_questions: NarrowQuestions,
    /// What is asked of shapes first.
    pub(crate) hulls: Hulls,
    /// What a ray cost after the build, once that was asked for.
    pub(crate) built_cost: Option<f64>,
    // One for each geometry, or none.
    pub(crate) masks: Vec<u32>,
    /// For winding numbers, once one was asked for.
    pub(crate) moments: OnceLock<Moments>,
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
    /// Binned by the surface area heuristic at every level (I. Wald, "On fast Construction of SAH-based Bounding Volume
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
                prepare::MOST_PRIMITIVES,
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
        prepare::build(geometries, options)
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

    /// Makes anew what searches keep of the tree, which has changed.
    pub(crate) fn follow_tree(&mut self) {
        self.single = SingleStart::new(&self.holds, &self.units, self.tree.root);
        self.questions = Questions::new(self.level, self.single.as_ref());
        self.narrow_questions = NarrowQuestions::new(self.level, self.single.as_ref());
        self.hulls = Hulls::new(&self.geometries, &self.tree.entries, &self.units);
        self.moments = OnceLock::new();
    }

    /// How the tree is put together, as bytes for a file: some six a triangle, whatever the machine. The geometries are not
    /// in them. Trees that stand in this one as instances are saved by themselves.
    pub fn to_bytes(&self) -> Vec<u8> {
        save::to_bytes(self)
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
        save::from_bytes(bytes, geometries)
    }

    /// Writes the tree to a file that [`Accel::map`] uses in place: thirty to sixty bytes a triangle. The geometries are not in it,
    /// nor the trees that stand in this one as instances. A file that is there already is replaced as a whole once the new one
    /// is complete; who has it mapped keeps the old one.
    ///
    /// # Errors
    /// When the file cannot be written, or the machine is not little-endian.
    pub fn save(&self, path: impl AsRef<Path>) -> io::Result<()> {
        file::save(self, path.as_ref())
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
        file::map(path.as_ref(), geometries)
    }

    /// The nearest hit in the ray's range. Of hits at the same `t`, the one whose (path, geometry, primitive) comes
    /// first, by positions in the lists that the trees were built from.
    #[inline]
    pub fn closest(&self, ray: &Ray) -> Option<Hit> {
        self.questions.closest.ask(self, ray)
    }

    /// The nearest hit of a ray in single precision: faster than [`Accel::closest`], and as watertight.
    ///
    /// A tree of nothing but meshes answers in single precision. It meets the triangles as they are seen from the ray, with their
    /// corners rounded: a ray that passes through a closed mesh meets it, at edges and corners, too, which belong to all triangles that
    /// have them. The point at `t` lies within some 2⁻²⁰ of its distance and of the tree's size from the triangle; so near to an edge,
    /// another triangle may be met than in double precision, and where a triangle is seen nearly on edge, `t` may differ by more. Of hits
    /// at the same `t`, the one whose geometry and primitive come first is the answer. It is the same on any machine, and however the
    /// tree was built.
    ///
    /// Other trees, and rays that come from afar (sixteen sizes of the tree), answer in double precision; the answer is rounded.
    #[inline]
    pub fn closest_f32(&self, ray: &Ray32) -> Option<Hit32> {
        self.narrow_questions.closest.ask(self, ray)
    }

    /// Whether a ray in single precision hits anything in its range: whether there is an answer of [`Accel::closest_f32`].
    #[inline]
    pub fn any_f32(&self, ray: &Ray32) -> bool {
        self.narrow_questions.any.ask(self, ray)
    }

    #[cfg(test)]
    pub(crate) fn closest_f32_at(&self, level: Level, ray: &Ray32) -> Option<Hit32> {
        NarrowQuestions::new(level, self.single.as_ref()).closest.ask(self, ray)
    }

    #[cfg(test)]
    pub(crate) fn any_f32_at(&self, level: Level, ray: &Ray32) -> bool {
        NarrowQuestions::new(level, self.single.as_ref()).any.ask(self, ray)
    }

    /// [`Accel::closest_f32`] for every ray, with the same answers to the bit; `hits` has a place for each.
    ///
    /// Which go together and which are in flight: as in [`Accel::closest_batch`].
    ///
    /// # Panics
    /// When `rays` and `hits` differ in length.
    pub fn closest_batch_f32(&self, rays: &[Ray32], hits: &mut [Option<Hit32>]) {
        self.closest_batch_f32_at(self.level, rays, hits);
    }

    pub(crate) fn closest_batch_f32_at(&self, level: Level, rays: &[Ray32], hits: &mut [Option<Hit32>]) {
        assert_eq!(rays.len(), hits.len(), "a place for the hit of every ray");
        narrow::search_all::<narrow::Closest>(level, self, rays, hits);
    }

    /// [`Accel::any_f32`] for every ray: see [`Accel::closest_batch_f32`].
    ///
    /// # Panics
    /// When `rays` and `hits` differ in length.
    pub fn any_batch_f32(&self, rays: &[Ray32], hits: &mut [bool]) {
        self.any_batch_f32_at(self.level, rays, hits);
    }

    pub(crate) fn any_batch_f32_at(&self, level: Level, rays: &[Ray32], hits: &mut [bool]) {
        assert_eq!(rays.len(), hits.len(), "a place for the answer of every ray");
        narrow::search_all::<narrow::Any>(level, self, rays, hits);
    }

    #[cfg(test)]
    pub(crate) fn closest_at(&self, level: Level, ray: &Ray) -> Option<Hit> {
        self.questions_at(level).closest.ask(self, ray)
    }

    /// The same by the search that knows no other precision than double.
    #[inline(never)]
    pub(crate) fn closest_plainly_at(&self, level: Level, ray: &Ray) -> Option<Hit> {
        let mut search = Closest::new(ray, &All);
        traverse::search(level, self, ray, &mut search);
        search.take_hit()
    }

    /// [`Accel::closest`] by the search that knows no other precision than double: the same answer to the bit. To be
    /// measured beside it.
    #[doc(hidden)]
    pub fn closest_plainly(&self, ray: &Ray) -> Option<Hit> {
        self.closest_plainly_at(self.level, ray)
    }

    /// [`Accel::closest`] and [`Accel::any`] as they would be if triangles were met in single precision alone and boxes had no margin:
    /// rays may then pass between two triangles, and answers are rounded. To be measured beside them; whether there is such a thing
    /// for this tree and on this machine.
    #[cfg(feature = "measure")]
    #[doc(hidden)]
    pub fn leak(&mut self) -> bool {
        let leaking = Questions::leaking(self.level, self.single.as_ref());
        if let Some(leaking) = leaking {
            self.questions = leaking;
        }
        leaking.is_some()
    }

    /// [`Accel::closest`] among what the options leave. Of the crossings of a shape, each is asked by itself.
    #[inline]
    pub fn closest_with(&self, ray: &Ray, options: &QueryOptions) -> Option<Hit> {
        if options.take_all(self) {
            self.closest(ray)
        } else {
            self.closest_with_at(self.level, ray, options)
        }
    }

    pub(crate) fn closest_with_at(&self, level: Level, ray: &Ray, options: &QueryOptions) -> Option<Hit> {
        if let Outcome::Settled(found) = self.ask_singly::<Nearest, _>(level, ray, options) {
            return found;
        }
        self.closest_with_plainly_at(level, ray, options)
    }

    /// The same by the search that knows no other precision than double.
    #[inline(never)]
    pub(crate) fn closest_with_plainly_at(
        &self,
        level: Level,
        ray: &Ray,
        options: &QueryOptions,
    ) -> Option<Hit> {
        let mut search = Closest::new(ray, options);
        traverse::search(level, self, ray, &mut search);
        search.take_hit()
    }

    /// [`Accel::any`] among what the options leave.
    #[inline]
    pub fn any_with(&self, ray: &Ray, options: &QueryOptions) -> bool {
        if options.take_all(self) { self.any(ray) } else { self.any_with_at(self.level, ray, options) }
    }

    pub(crate) fn any_with_at(&self, level: Level, ray: &Ray, options: &QueryOptions) -> bool {
        if let Outcome::Settled(is_hit) = self.ask_singly::<Whether, _>(level, ray, options) {
            return is_hit;
        }
        self.any_with_plainly_at(level, ray, options)
    }

    /// The same by the search that knows no other precision than double.
    #[inline(never)]
    pub(crate) fn any_with_plainly_at(&self, level: Level, ray: &Ray, options: &QueryOptions) -> bool {
        let mut search = Any::new(ray, options);
        traverse::search(level, self, ray, &mut search);
        search.is_hit
    }

    /// The tree with a mask for each of its geometries, by position, for [`QueryOptions::mask`]; without, all bits are set.
    /// They are saved with it, and stay through a refit.
    ///
    /// # Panics
    /// When there are not as many masks as geometries.
    #[must_use]
    pub fn with_masks(self, masks: Vec<u32>) -> Self {
        assert_eq!(masks.len(), self.geometries.len(), "a mask for each geometry");
        Self { masks, ..self }
    }

    /// [`Accel::closest`] for every ray, with the same answers to the bit; `hits` has a place for each.
    ///
    /// In a tree of triangles, or of shapes too, sixteen rays in a row that are much alike (those of a square of four by four pixels,
    /// say, rather than of sixteen pixels in a line) are traced together, which takes down to two fifths of the time. There, many of the
    /// others are in flight at the same time, where there are enough of them: in a tree that the nearest caches hold, from about a
    /// hundred on, so that a thousand rays or more at a time are answered soonest. In a tree of nothing but clouds of spheres that have one
    /// origin, all of them are. In trees of anything else, the others are traced one after another; without AVX2, they are in all trees but
    /// large ones of triangles or of spheres. It works on the calling thread: to use more, split `rays` and `hits`.
    ///
    /// # Panics
    /// When `rays` and `hits` differ in length.
    pub fn closest_batch(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        self.closest_batch_at(self.level, rays, hits);
    }

    pub(crate) fn closest_batch_at(&self, level: Level, rays: &[Ray], hits: &mut [Option<Hit>]) {
        assert_eq!(rays.len(), hits.len(), "a place for the hit of every ray");
        let Some(start) = &self.single else {
            let asked = self.questions_at(level).closest;
            hits.iter_mut().zip(rays).for_each(|(hit, ray)| *hit = asked.ask(self, ray));
            return;
        };
        let ends = Answers { accel: self, level, rays, places: hits };
        if start.contents == Contents::Anything {
            batch::search_anything::<Nearest, _>(level, self, start, rays, ends);
        } else {
            batch::search_all::<Nearest>(level, self, start, rays, ends);
        }
    }

    /// [`Accel::any`] for every ray: see [`Accel::closest_batch`].
    ///
    /// # Panics
    /// When `rays` and `hits` differ in length.
    pub fn any_batch(&self, rays: &[Ray], hits: &mut [bool]) {
        self.any_batch_at(self.level, rays, hits);
    }

    pub(crate) fn any_batch_at(&self, level: Level, rays: &[Ray], hits: &mut [bool]) {
        assert_eq!(rays.len(), hits.len(), "a place for the answer of every ray");
        let Some(start) = &self.single else {
            let asked = self.questions_at(level).any;
            hits.iter_mut().zip(rays).for_each(|(hit, ray)| *hit = asked.ask(self, ray));
            return;
        };
        let ends = Answers { accel: self, level, rays, places: hits };
        if start.contents == Contents::Anything {
            batch::search_anything::<Whether, _>(level, self, start, rays, ends);
        } else {
            batch::search_all::<Whether>(level, self, start, rays, ends);
        }
    }

    /// Puts what comes of rays in flight, once each, and tells how many the plain search had to answer. It is the search that batches take:
    /// what takes answers otherwise has a search of its own compiled, at every level.
    #[cfg(test)]
    pub(crate) fn fly_at<'a, G: single::Goal, T>(
        &'a self,
        level: Level,
        rays: &'a [Ray],
        places: &'a mut [T],
        flying: batch::Flying,
    ) -> usize
    where
        Answers<'a, T>: Ends<G::Answer>,
    {
        let start = self.single.as_ref().expect("what single precision searches");
        let ends = Answers { accel: self, level, rays, places };
        ANSWERED.set([0; 2]);
        batch::search_as_said::<G>(level, self, start, rays, ends, Some(flying), false);
        let [all, plainly] = ANSWERED.get();
        assert_eq!(all, rays.len(), "each once");
        plainly
    }

    fn questions_at(&self, level: Level) -> Questions {
        if level == self.level { self.questions } else { Questions::new(level, self.single.as_ref()) }
    }

    /// The nearest hit that `accept` takes; it may be asked in any order of `t`, but about no crossing twice, and its answer must
    /// depend on the hit alone.
    pub fn closest_filtered(&self, ray: &Ray, mut accept: impl FnMut(&Hit) -> bool) -> Option<Hit> {
        self.closest_filtered_at(self.level, ray, &mut accept)
    }

    pub(crate) fn closest_filtered_at(
        &self,
        level: Level,
        ray: &Ray,
        accept: &mut dyn FnMut(&Hit) -> bool,
    ) -> Option<Hit> {
        let filter = If::new(accept);
        if let Outcome::Settled(found) = self.ask_singly::<Nearest, _>(level, ray, &filter) {
            return found;
        }
        let mut search = Closest::new(ray, &filter);
        traverse::search(level, self, ray, &mut search);
        search.take_hit()
    }

    /// Whether anything is hit in the ray's range.
    #[inline]
    pub fn any(&self, ray: &Ray) -> bool {
        self.questions.any.ask(self, ray)
    }

    #[cfg(test)]
    pub(crate) fn any_at(&self, level: Level, ray: &Ray) -> bool {
        self.questions_at(level).any.ask(self, ray)
    }

    /// The same by the search that knows no other precision than double.
    #[inline(never)]
    pub(crate) fn any_plainly_at(&self, level: Level, ray: &Ray) -> bool {
        let mut search = Any::new(ray, &All);
        traverse::search(level, self, ray, &mut search);
        search.is_hit
    }

    /// [`Accel::any`] by the search that knows no other precision than double. To be measured beside it.
    #[doc(hidden)]
    pub fn any_plainly(&self, ray: &Ray) -> bool {
        self.any_plainly_at(self.level, ray)
    }

    /// Whether anything that `accept` takes, asked as by [`Accel::closest_filtered`], is hit in the ray's range.
    pub fn any_filtered(&self, ray: &Ray, mut accept: impl FnMut(&Hit) -> bool) -> bool {
        self.any_filtered_at(self.level, ray, &mut accept)
    }

    /// Among what a filter takes, in single precision; where that cannot tell, a filter that asks keeps what was answered.
    fn ask_singly<G: Sought, F: Filter>(&self, level: Level, ray: &Ray, filter: &F) -> Outcome<G::Found> {
        // What is left out among spheres is for the plain search: no filter is asked before.
        let Some(start) = self.single.as_ref().filter(|start| start.contents != Contents::Spheres) else {
            return Outcome::Unsettled;
        };
        let found = if start.contents == Contents::Anything {
            anything::search::<G, F>(level, self, start, ray, filter)
        } else {
            let place = Place::default();
            let selection = filter.select(self, Standing::at(&place));
            match single::search_among::<G, _>(level, self, start, ray, selection) {
                Outcome::Settled(answer) => Outcome::Settled(G::found(self, answer)),
                Outcome::Unsettled => Outcome::Unsettled,
            }
        };
        if matches!(found, Outcome::Unsettled) {
            filter.keep_answers();
        }
        found
    }

    pub(crate) fn any_filtered_at(
        &self,
        level: Level,
        ray: &Ray,
        accept: &mut dyn FnMut(&Hit) -> bool,
    ) -> bool {
        let filter = If::new(accept);
        if let Outcome::Settled(is_hit) = self.ask_singly::<Whether, _>(level, ray, &filter) {
            return is_hit;
        }
        let mut search = Any::new(ray, &filter);
        traverse::search(level, self, ray, &mut search);
        search.is_hit
    }

    /// Every hit in the ray's range in ascending order of `t` (ties by path, geometry, primitive), until `visit` breaks.
    ///
    /// Hits are sought in batches of 32, 128, 512 and so on, so that an early end costs little and memory is at most
    /// proportional to the hits visited.
    pub fn all(&self, ray: &Ray, visit: impl FnMut(&Hit) -> ControlFlow<()>) {
        self.all_at(self.level, ray, visit);
    }

    pub(crate) fn all_at(&self, level: Level, ray: &Ray, mut visit: impl FnMut(&Hit) -> ControlFlow<()>) {
        let mut size = 32;
        let mut last = None;
        loop {
            let mut search = Batch::new(ray, size, last.as_ref());
            traverse::search(level, self, ray, &mut search);
            let (mut hits, may_go_on) = search.into_hits();
            if hits.iter().any(|ranked| visit(&ranked.hit).is_break()) || !may_go_on {
                return;
            }
            last = hits.pop();
            size = size.saturating_mul(4);
        }
    }

    /// How many hits the ray's range holds.
    pub fn count(&self, ray: &Ray) -> usize {
        self.count_at(self.level, ray)
    }

    pub(crate) fn count_at(&self, level: Level, ray: &Ray) -> usize {
        let mut search = Count::new(ray);
        traverse::search(level, self, ray, &mut search);
        search.hits
    }

    /// The nearest point of all surfaces within `max_distance` (itself included; infinite for anywhere), or `None` where there
    /// is none so near. Of points as near, the one whose (path, geometry, primitive) comes first. Triangles without area do
    /// not count. Nothing is near a point that is not finite.
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
        nearest::closest_point(self, point, max_distance, 0.0)
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
        nearest::closest_point(self, point, max_distance, time)
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
            + self.hulls.memory_bytes()
            + bytes(&self.infinite)
            + bytes(&self.masks)
            + self.moments.get().map_or(0, Moments::memory_bytes)
    }

    /// What the corners of a mesh are relative to.
    pub(crate) fn mesh_origin(&self, geometry: u32) -> DVec3 {
        match &self.geometries[geometry as usize].kind {
            GeometryKind::Mesh(mesh) => mesh.origin,
            _ => unreachable!("blocks are of meshes"),
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

/// The places for what came of a batch of rays.
pub(crate) struct Answers<'a, T> {
    accel: &'a Accel,
    level: Level,
    rays: &'a [Ray],
    places: &'a mut [T],
}

#[cfg(test)]
thread_local! {
    /// How many rays of batches were answered, and how many of them by the plain search.
    static ANSWERED: std::cell::Cell<[usize; 2]> = const { std::cell::Cell::new([0; 2]) };
}

/// Counts a ray of a batch.
#[cfg(test)]
fn count<A>(outcome: &Outcome<A>) {
    let [all, plainly] = ANSWERED.get();
    ANSWERED.set([all + 1, plainly + usize::from(matches!(outcome, Outcome::Unsettled))]);
}

impl Ends<Option<Winner>> for Answers<'_, Option<Hit>> {
    #[inline(always)]
    fn put(&mut self, position: usize, outcome: Outcome<Option<Winner>>) {
        #[cfg(test)]
        count(&outcome);
        let place = &mut self.places[position];
        match outcome {
            Outcome::Settled(Some(winner)) => winner.put(self.accel, place),
            Outcome::Settled(None) => *place = None,
            Outcome::Unsettled => *place = self.accel.closest_plainly_at(self.level, &self.rays[position]),
        }
    }

    #[inline(always)]
    fn fetch(&self, position: usize) {
        self.places.get(position).map(lanes::fetch);
    }
}

impl Ends<Option<Hit>> for Answers<'_, Option<Hit>> {
    #[inline(always)]
    fn put(&mut self, position: usize, outcome: Outcome<Option<Hit>>) {
        #[cfg(test)]
        count(&outcome);
        self.places[position] = match outcome {
            Outcome::Settled(hit) => hit,
            Outcome::Unsettled => self.accel.closest_plainly_at(self.level, &self.rays[position]),
        };
    }
}

impl Ends<bool> for Answers<'_, bool> {
    #[inline(always)]
    fn put(&mut self, position: usize, outcome: Outcome<bool>) {
        #[cfg(test)]
        count(&outcome);
        self.places[position] = match outcome {
            Outcome::Settled(is_hit) => is_hit,
            Outcome::Unsettled => self.accel.any_plainly_at(self.level, &self.rays[position]),
        };
    }
}
