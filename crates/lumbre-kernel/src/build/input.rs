//! Checks geometries, measures them and splits them into primitives.

use std::sync::Arc;

use lumbre_geometry::Aabb;
use lumbre_math::{DMat3, DVec3, Elementary, Transform, Vec3};
use rayon::prelude::*;
use rustc_hash::FxHashMap;

use crate::build::binary::{GrownTree, PARALLEL, binary_tree};
use crate::build::boxes::Boxes;
use crate::build::clouds::CloudSurvey;
use crate::build::collapse::lay_out;
use crate::build::error::{BuildError, MAX_PRIMITIVES};
use crate::build::open_instances;
use crate::build::options::{BuildOptions, Preset};
use crate::build::outline::Outline;
use crate::build::primitive::{Bounds, Kind, Primitive, Traits};
use crate::intersect::{Dispatch, Isa, Simd};
use crate::tree::BLOCK;
use crate::tree::assemble::TreeParts;
use crate::tree::geometry::has_area;
use crate::tree::geometry::{Placement, TriangleMesh};
use crate::tree::node::TreeSpace;
use crate::tree::packed::{Entry, Packed};
use crate::tree::precise_mesh;
use crate::tree::precise_mesh::PreciseMesh;
use crate::tree::summary::Sizes;
use crate::tree::{Geometry, GeometryKind, Tree};

/// See [`Accel::build`].
pub(crate) fn build(geometries: Vec<Geometry>, options: &BuildOptions) -> Result<Tree, BuildError> {
    if geometries.len() > MAX_PRIMITIVES {
        return Err(BuildError::TooMany);
    }
    // Enters the pool once for the whole build. A build for one thread does not enter it.
    let preset = options.preset;
    let mut work = 0;
    let is_much = geometries.iter().any(|geometry| {
        work += size_of_geometry(geometry);
        work > PARALLEL
    });
    if is_much { rayon::scope(|_| build_here(geometries, preset)) } else { build_here(geometries, preset) }
}

/// Approximate number of primitives.
fn size_of_geometry(geometry: &Geometry) -> usize {
    match &geometry.kind {
        GeometryKind::Mesh(mesh) => mesh.indices.len(),
        GeometryKind::PreciseMesh(mesh) => mesh.indices.len(),
        GeometryKind::Spheres(cloud) => cloud.spheres.len(),
        GeometryKind::Custom(custom) => custom.primitive_count() as usize,
        GeometryKind::Shape(_) => 1,
        // It may be opened into parts.
        GeometryKind::Instance(_) => 8,
    }
}

/// Builds on the calling thread and its pool.
fn build_here(geometries: Vec<Geometry>, preset: Preset) -> Result<Tree, BuildError> {
    let mut parts = take_apart(&geometries)?;
    let tree_space = units_of(&geometries, &parts);
    let traits: Vec<Traits> = geometries.iter().map(traits_of).collect();
    let isa = Isa::best();

    let count = parts.count();
    let room = parts.room();
    let near = |part: &Boxed| Bounds::near(&tree_space, &part.bounds, part.geometry, part.primitive);
    let mut others: Vec<Primitive> =
        std::mem::take(&mut parts.boxed).par_iter().with_min_len(1024).map(near).collect();
    if preset != Preset::Fast {
        open_instances::open(&mut others, &geometries, &tree_space, room);
    }
    let packed = parts.triangles + parts.spheres;
    let tree = if others.len() + packed == 0 {
        Packed::default()
    } else {
        let mut primitives = Boxes::empty(packed);
        let mut rest = &mut primitives[..];
        // They are freed: a scene of many meshes has many.
        for survey in std::mem::take(&mut parts.surveys) {
            if let GeometryKind::Mesh(mesh) = &geometries[survey.geometry as usize].kind {
                let own = rest.split_off_mut(..survey.triangles).expect("they were counted");
                box_triangles(mesh, &survey, &tree_space, own);
            }
        }
        for survey in &parts.clouds {
            if let GeometryKind::Spheres(cloud) = &geometries[survey.geometry as usize].kind {
                let own = rest.split_off_mut(..survey.spheres).expect("they were counted");
                survey.put_boxes(cloud, &tree_space, own);
            }
        }
        let GrownTree { tree, ids, instances } = binary_tree(isa, preset, others, &mut primitives, &traits);
        let layout = lay_out(&traits, &tree, &ids, &instances)?;
        drop((tree, instances));
        drop(primitives);
        layout.pack(isa, &tree_space, &geometries, ids)
    };
    let (sizes, bounds, infinite) = (parts.sizes, parts.bounds, parts.infinite);
    Ok(Tree::assemble(
        geometries,
        TreeParts { tree_space, packed: tree, sizes, bounds, infinite, primitives: count },
    ))
}

/// A tree over these geometries without nodes.
pub(crate) fn empty_over(geometries: Vec<Geometry>) -> Tree {
    let parts = TreeParts {
        tree_space: TreeSpace::new(DVec3::ZERO, 1.0, 0.0, 1.0),
        packed: Packed::default(),
        sizes: Sizes::default(),
        bounds: Aabb::EMPTY,
        infinite: Vec::new(),
        primitives: 0,
    };
    Tree::assemble(geometries, parts)
}

/// The contents of the geometries, without the triangles.
pub(crate) struct Parts {
    /// Bounds of all finite geometry, including the finite geometry in infinite instances.
    pub(crate) bounds: Aabb,
    /// Bounds of the finite geometry in the tree.
    pub(crate) tree_bounds: Aabb,
    pub(crate) boxed: Vec<Boxed>,
    pub(crate) infinite: Vec<Entry>,
    /// One for each mesh.
    pub(crate) surveys: Vec<Survey>,
    /// Triangles of all meshes.
    pub(crate) triangles: usize,
    /// Whether any primitive has no area.
    pub(crate) has_flat: bool,
    /// One for each cloud of spheres.
    pub(crate) clouds: Vec<CloudSurvey>,
    /// Spheres of all clouds.
    pub(crate) spheres: usize,
    /// The sizes of all meshes and clouds.
    pub(crate) sizes: Sizes,
}

/// What the build knows of a mesh.
pub(crate) struct Survey {
    pub(crate) geometry: u32,
    /// Triangles that have an area.
    pub(crate) triangles: usize,
    /// Those in each [`CHUNK`] triangles; empty if there is one chunk, as scenes have many small meshes.
    pub(crate) chunks: Vec<u32>,
}

/// A primitive other than a triangle, with its box. A list of them is sorted by id.
pub(crate) struct Boxed {
    pub(crate) bounds: Aabb,
    pub(crate) geometry: u32,
    pub(crate) primitive: u32,
}

/// Checks geometries, and measures their contents.
pub(crate) fn take_apart(geometries: &[Geometry]) -> Result<Parts, BuildError> {
    let mut parts = Parts {
        bounds: Aabb::EMPTY,
        tree_bounds: Aabb::EMPTY,
        boxed: Vec::new(),
        infinite: Vec::new(),
        surveys: Vec::new(),
        triangles: 0,
        has_flat: false,
        clouds: Vec::new(),
        spheres: 0,
        sizes: Sizes::default(),
    };
    let boxes = boxes_of(geometries);
    for (position, geometry) in geometries.iter().enumerate() {
        let room = parts.room();
        match &geometry.kind {
            GeometryKind::Mesh(mesh) => {
                if mesh.indices.len() > room {
                    return Err(BuildError::TooMany);
                }
                let (survey, bounds, sizes) = survey_mesh(position, mesh)?;
                parts.sizes.grow(&sizes);
                parts.tree_bounds = parts.tree_bounds.union(bounds);
                parts.triangles += survey.triangles;
                parts.has_flat |= survey.triangles < mesh.indices.len();
                parts.surveys.push(survey);
            }
            GeometryKind::Spheres(cloud) => {
                if cloud.spheres.len() > room {
                    return Err(BuildError::TooMany);
                }
                let survey = CloudSurvey::of(position, cloud)?;
                parts.sizes.grow(&Sizes { sphere_reach: survey.reach, ..Sizes::default() });
                parts.tree_bounds = parts.tree_bounds.union(survey.bounds);
                parts.spheres += survey.spheres;
                parts.clouds.push(survey);
            }
            GeometryKind::PreciseMesh(mesh) => parts.add_precise(position, mesh, room)?,
            GeometryKind::Shape(_) => parts.add(position, 0, boxes[position], room)?,
            GeometryKind::Custom(custom) => {
                for primitive in 0..custom.primitive_count() {
                    let room = parts.room();
                    parts.add(position, primitive, custom.bounds(primitive), room)?;
                }
            }
            GeometryKind::Instance(instance) => {
                let is_infinite = !instance.tree.infinite.is_empty();
                let bounds = boxes[position].unwrap_or(Aabb::EMPTY);
                if is_infinite {
                    parts.bounds = parts.bounds.union(bounds);
                    parts.add(position, 0, None, room)?;
                } else if !bounds.is_empty() {
                    parts.add(position, 0, Some(bounds), room)?;
                }
            }
        }
    }
    parts.bounds = parts.bounds.union(parts.tree_bounds);
    Ok(parts)
}

/// The boxes of all shapes and instances, by position; `None` for infinite geometry and other kinds. Empty if there are
/// neither shapes nor instances.
fn boxes_of(geometries: &[Geometry]) -> Vec<Option<Aabb>> {
    let has_box = |kind: &GeometryKind| matches!(kind, GeometryKind::Shape(_) | GeometryKind::Instance(_));
    if !geometries.iter().any(|geometry| has_box(&geometry.kind)) {
        return Vec::new();
    }
    // A tree is often placed by many instances.
    let mut outlines: FxHashMap<usize, Outline> = FxHashMap::default();
    for geometry in geometries {
        if let GeometryKind::Instance(instance) = &geometry.kind {
            outlines.entry(Arc::as_ptr(&instance.tree).addr()).or_insert_with(|| Outline::of(&instance.tree));
        }
    }
    let bounds = |geometry: &Geometry| match &geometry.kind {
        GeometryKind::Shape(shape) => shape.bounds(),
        GeometryKind::Instance(instance) => {
            let outline = &outlines[&Arc::as_ptr(&instance.tree).addr()];
            Some(outline.at(&instance.world_from_object))
        }
        GeometryKind::Mesh(_)
        | GeometryKind::PreciseMesh(_)
        | GeometryKind::Spheres(_)
        | GeometryKind::Custom(_) => None,
    };
    geometries.par_iter().with_min_len(64).map(bounds).collect()
}

impl Parts {
    /// Number of primitives.
    pub(crate) fn count(&self) -> usize {
        self.boxed.len() + self.infinite.len() + self.triangles + self.spheres
    }

    /// How many more primitives a tree can index.
    fn room(&self) -> usize {
        MAX_PRIMITIVES - self.count()
    }

    /// Adds the triangles of a double-precision mesh that have an area.
    fn add_precise(&mut self, position: usize, mesh: &PreciseMesh, room: usize) -> Result<(), BuildError> {
        if mesh.indices.len() > room {
            return Err(BuildError::TooMany);
        }
        if let Some(element) = mesh.positions.iter().position(|p| !p.is_finite()) {
            return Err(BuildError::NotFinite { geometry: position, element });
        }
        let is_there = |vertex: &u32| (*vertex as usize) < mesh.positions.len();
        if let Some(triangle) = mesh.indices.iter().position(|triangle| !triangle.iter().all(is_there)) {
            return Err(BuildError::VertexOutOfRange { geometry: position, triangle });
        }
        for primitive in 0..mesh.indices.len() as u32 {
            let corners = mesh.corners(primitive);
            if precise_mesh::has_area(&corners) {
                let bounds = Aabb::around(corners);
                self.tree_bounds = self.tree_bounds.union(bounds);
                self.boxed.push(Boxed { bounds, geometry: position as u32, primitive });
            }
        }
        Ok(())
    }

    fn add(
        &mut self,
        position: usize,
        primitive: u32,
        bounds: Option<Aabb>,
        room: usize,
    ) -> Result<(), BuildError> {
        if room == 0 {
            return Err(BuildError::TooMany);
        }
        let geometry = position as u32;
        match bounds {
            Some(bounds) if bounds.min.is_nan() || bounds.max.is_nan() => {
                return Err(BuildError::NotFinite { geometry: position, element: primitive as usize });
            }
            Some(bounds) if bounds.is_empty() => {}
            Some(bounds) if bounds.min.is_finite() && bounds.max.is_finite() => {
                self.tree_bounds = self.tree_bounds.union(bounds);
                self.boxed.push(Boxed { bounds, geometry, primitive });
            }
            _ => self.infinite.push(Entry::new(geometry, primitive, true)),
        }
        Ok(())
    }
}

/// Triangles per task.
const CHUNK: usize = 1 << 11;

/// Minimum chunks of a mesh per thread.
fn least_chunks(mesh: &TriangleMesh) -> usize {
    if mesh.indices.len() > PARALLEL { 1 } else { usize::MAX }
}

/// Checks a mesh, and finds the box around its triangles with an area, and their sizes.
fn survey_mesh(position: usize, mesh: &TriangleMesh) -> Result<(Survey, Aabb, Sizes), BuildError> {
    if !mesh.origin.is_finite() {
        return Err(BuildError::NotFinite { geometry: position, element: 0 });
    }
    let is_broken = |chunk: &&[Vec3]| chunk.iter().any(|p| !p.is_finite());
    let least = least_chunks(mesh);
    if mesh.positions.par_chunks(CHUNK).with_min_len(least).find_first(is_broken).is_some() {
        let element = mesh.positions.iter().position(|p| !p.is_finite()).unwrap_or_default();
        return Err(BuildError::NotFinite { geometry: position, element });
    }
    let isa = Isa::best();
    let survey_chunk = |(chunk, triangles): (usize, &[[u32; 3]])| {
        isa.run(SurveyChunk { mesh, triangles }).map_err(|place| {
            let triangle = chunk * CHUNK + place;
            BuildError::VertexOutOfRange { geometry: position, triangle }
        })
    };
    let chunks: Vec<_> =
        mesh.indices.par_chunks(CHUNK).with_min_len(least).enumerate().map(survey_chunk).collect();
    let has_many_chunks = chunks.len() > 1;
    let counts = Vec::with_capacity(if has_many_chunks { chunks.len() } else { 0 });
    let mut survey = Survey { geometry: position as u32, triangles: 0, chunks: counts };
    let (mut bounds, mut longest_side) = (MeshBox::EMPTY, 0.0f32);
    for chunk in chunks {
        let (around, longest, count) = chunk?;
        bounds.grow(&around);
        longest_side = longest_side.max(longest);
        survey.triangles += count as usize;
        if has_many_chunks {
            survey.chunks.push(count);
        }
    }
    if survey.triangles == 0 {
        return Ok((survey, Aabb::EMPTY, Sizes::default()));
    }
    let [low, high] = bounds.corners();
    let largest_corner = low.abs().max(high.abs()).max_element();
    let bounds = Aabb { min: mesh.origin + low.as_dvec3(), max: mesh.origin + high.as_dvec3() };
    Ok((survey, bounds, Sizes { largest_corner, longest_side, ..Sizes::default() }))
}

/// Surveys some triangles: the box around those with an area, the longest side of a triangle's box, and their number;
/// or the first triangle that lacks a vertex.
struct SurveyChunk<'a> {
    mesh: &'a TriangleMesh,
    triangles: &'a [[u32; 3]],
}

impl Dispatch for SurveyChunk<'_> {
    type Output = Result<(MeshBox, f32, u32), usize>;

    #[inline(always)]
    fn run<L: Simd>(self) -> Self::Output {
        let Self { mesh, triangles } = self;
        let (mut bounds, mut sides, mut count) = (MeshBox::EMPTY, [0.0f32; 4], 0);
        for (place, triangle) in triangles.iter().enumerate() {
            let Some(corners) = corners(mesh, triangle) else { return Err(place) };
            if has_area(&corners) {
                count += 1;
                let around = MeshBox::around(&corners);
                bounds.grow(&around);
                for (longest, side) in sides.iter_mut().zip(around.sides()) {
                    *longest = if *longest > side { *longest } else { side };
                }
            }
        }
        Ok((bounds, sides.into_iter().fold(0.0, f32::max), count))
    }
}

/// `None` if the mesh lacks a vertex.
#[inline(always)]
fn corners(mesh: &TriangleMesh, triangle: &[u32; 3]) -> Option<[Vec3; 3]> {
    let [a, b, c] = triangle.map(|vertex| mesh.positions.get(vertex as usize).copied());
    Some([a?, b?, c?])
}

/// A box in mesh space: the lower corner and the negated upper corner. The fourth and eighth lanes are unused.
#[derive(Clone, Copy)]
struct MeshBox([f32; 8]);

impl MeshBox {
    const EMPTY: Self = Self([f32::INFINITY; 8]);

    #[inline(always)]
    fn at(p: Vec3) -> Self {
        Self([p.x, p.y, p.z, 0.0, -p.x, -p.y, -p.z, 0.0])
    }

    #[inline(always)]
    fn around(&[a, b, c]: &[Vec3; 3]) -> Self {
        let mut around = Self::at(a);
        around.grow(&Self::at(b));
        around.grow(&Self::at(c));
        around
    }

    #[inline(always)]
    fn grow(&mut self, other: &Self) {
        for (own, &other) in self.0.iter_mut().zip(&other.0) {
            // One instruction, unlike `f32::min`.
            *own = if *own < other { *own } else { other };
        }
    }

    /// The extent on each axis; the last lane is unused.
    #[inline(always)]
    fn sides(&self) -> [f32; 4] {
        let [x, y, z, last, minus_x, minus_y, minus_z, minus_last] = self.0;
        [-(x + minus_x), -(y + minus_y), -(z + minus_z), -(last + minus_last)]
    }

    /// The lower and the upper corner.
    fn corners(&self) -> [Vec3; 2] {
        let [x, y, z, _, minus_x, minus_y, minus_z, _] = self.0;
        [Vec3::new(x, y, z), -Vec3::new(minus_x, minus_y, minus_z)]
    }
}

/// Makes boxes of a mesh's triangles, in tree units.
pub(crate) struct Boxer {
    /// In the layout of a [`MeshBox`].
    shift: [f64; 8],
    scale: f64,
    shift_single: [f32; 8],
    is_single: bool,
}

impl Boxer {
    pub(crate) fn new(mesh: &TriangleMesh, tree_space: &TreeSpace) -> Self {
        // If the shift is exact in single precision, the one subtraction rounds once, as in double precision, and the
        // scale is a power of two.
        let shift = tree_space.origin - mesh.origin;
        let shift_single = shift.as_vec3();
        let is_single = shift_single.as_dvec3() == shift
            && (1e-37..1e38).contains(&tree_space.scale)
            && shift_single.abs().max_element() < 1e37;
        Self {
            shift: [shift.x, shift.y, shift.z, 0.0, -shift.x, -shift.y, -shift.z, 0.0],
            scale: tree_space.scale,
            shift_single: MeshBox::at(shift_single).0,
            is_single,
        }
    }

    #[inline(always)]
    pub(crate) fn around<L: Simd>(&self, corners: &[Vec3; 3], first: u32, second: u32) -> Bounds {
        self.of_box::<L>(&MeshBox::around(corners)).with_ids(first, second)
    }

    /// The box around all of these: the same as the union of their boxes.
    #[inline(always)]
    pub(crate) fn around_all<L: Simd>(&self, triangles: impl Iterator<Item = [[f32; 3]; 3]>) -> Bounds {
        let (mut around, mut is_any) = (MeshBox::EMPTY, false);
        for corners in triangles {
            around.grow(&MeshBox::around(&corners.map(Vec3::from_array)));
            is_any = true;
        }
        if is_any { self.of_box::<L>(&around) } else { Bounds::EMPTY }
    }

    #[inline(always)]
    fn of_box<L: Simd>(&self, MeshBox(around): &MeshBox) -> Bounds {
        let mut numbers = [0.0; 8];
        if self.is_single {
            let scale = self.scale as f32;
            for lane in 0..8 {
                numbers[lane] = (around[lane] - self.shift_single[lane]) * scale;
            }
        } else {
            for lane in 0..8 {
                numbers[lane] = ((f64::from(around[lane]) - self.shift[lane]) * self.scale) as f32;
            }
        }
        Bounds::of_lanes::<L>(numbers)
    }
}

/// Writes the boxes of the triangles that have an area.
fn box_triangles(mesh: &TriangleMesh, survey: &Survey, tree_space: &TreeSpace, mut places: &mut [Primitive]) {
    let (boxer, isa) = (&Boxer::new(mesh, tree_space), Isa::best());
    let geometry = survey.geometry;
    if survey.chunks.is_empty() {
        isa.run(BoxChunk { mesh, boxer, geometry, first: 0, places });
        return;
    }
    let chunks: Vec<(usize, &mut [Primitive])> = survey
        .chunks
        .iter()
        .enumerate()
        .map(|(chunk, &count)| (chunk, places.split_off_mut(..count as usize).expect("they were counted")))
        .collect();
    chunks.into_par_iter().with_min_len(least_chunks(mesh)).for_each(|(chunk, places)| {
        isa.run(BoxChunk { mesh, boxer, geometry, first: chunk * CHUNK, places });
    });
}

/// Writes the boxes of some triangles.
struct BoxChunk<'a> {
    mesh: &'a TriangleMesh,
    boxer: &'a Boxer,
    geometry: u32,
    first: usize,
    places: &'a mut [Primitive],
}

impl Dispatch for BoxChunk<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Simd>(self) {
        let Self { mesh, boxer, geometry, first, places } = self;
        let rest = &mesh.indices[first..];
        let triangles = &rest[..rest.len().min(CHUNK)];
        // Skips the test for an area when all triangles have one.
        let all_have_area = places.len() == triangles.len();
        let mut places = places.iter_mut();
        for (primitive, triangle) in (first as u32..).zip(triangles) {
            let Some(corners) = corners(mesh, triangle) else { continue };
            if (all_have_area || has_area(&corners))
                && let Some(place) = places.next()
            {
                *place = boxer.around::<L>(&corners, geometry, primitive);
            }
        }
    }
}

/// The units in which the tree's boxes are about 1 in size.
pub(crate) fn units_of(geometries: &[Geometry], parts: &Parts) -> TreeSpace {
    let bounds = if parts.tree_bounds.is_empty() {
        Aabb { min: DVec3::ZERO, max: DVec3::ZERO }
    } else {
        parts.tree_bounds
    };
    let origin = rounded_center(geometries, &bounds);
    let half = (bounds.max - origin).max(origin - bounds.min);
    let largest = half.max_element();
    // The power of two that brings the largest half edge into (0.5, 1].
    let scale = if largest > 0.0 && largest.is_finite() {
        let exponent = largest.logarithm_2().ceil().clamp(-1000.0, 1000.0);
        f64::from_bits((1023.0 - exponent) as u64 * (1 << 52))
    } else {
        1.0
    };
    let condition = |geometry: &Geometry| match &geometry.kind {
        GeometryKind::Shape(shape) => condition_of(&shape.world_from_object()),
        GeometryKind::Instance(instance) => {
            let inner = instance.tree.tree_space.condition;
            let outer = match &instance.world_from_object {
                Placement::Still(map) => condition_of(map),
                Placement::Moving(motion) => motion.condition(),
            };
            outer * inner + 2.0
        }
        _ => 1.0,
    };
    let condition = geometries.par_iter().with_min_len(1024).map(condition).reduce(|| 1.0, f64::max);
    TreeSpace::new(origin, scale, (half * scale).length(), condition)
}

/// Roughly the middle of the box. If it is near enough, its offset from the first mesh's origin is exact in single
/// precision, so that boxes of triangles can be made in single precision.
fn rounded_center(geometries: &[Geometry], bounds: &Aabb) -> DVec3 {
    let center = bounds.center();
    let mesh = geometries.iter().find_map(|geometry| match &geometry.kind {
        GeometryKind::Mesh(mesh) => Some(mesh),
        _ => None,
    });
    let Some(mesh) = mesh else { return center };
    let rounded = mesh.origin + (center - mesh.origin).as_vec3().as_dvec3();
    let is_near = (rounded - center).abs().max_element() <= bounds.size().max_element() / 256.0;
    if is_near { rounded } else { center }
}

/// By how much a map and its inverse together may enlarge rounding errors: the lesser of two bounds. One is 1 for every
/// rotation with a uniform scale, the other for every scale along the axes.
fn condition_of(map: &Transform) -> f64 {
    let (there, back) = (map.linear(), map.inverse_affine().matrix3);
    let size = |m: DMat3| m.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt();
    let sizes = |m: DMat3| DMat3::from_cols(m.x_axis.abs(), m.y_axis.abs(), m.z_axis.abs());
    let by_norm = size(there) * size(back) / 3.0;
    let by_component = (sizes(there) * sizes(back) * DVec3::ONE).max_element();
    by_norm.min(by_component).max(1.0)
}

/// What the build needs to know of a geometry.
pub(crate) fn traits_of(geometry: &Geometry) -> Traits {
    let (kind, cost, most) = match &geometry.kind {
        GeometryKind::Mesh(_) => (Kind::Triangle, Traits::COST_OF_PACKED, BLOCK),
        GeometryKind::Spheres(_) => (Kind::Sphere, Traits::COST_OF_PACKED, BLOCK),
        // Its share of the bounding test of eight, which nearly always rejects the others. Its own cost is the same in
        // any leaf.
        GeometryKind::Shape(_) => (Kind::Shape, 4, BLOCK),
        GeometryKind::Instance(_) => (Kind::Instance, 96, 1),
        GeometryKind::Custom(_) => (Kind::Custom, 48, 4),
        GeometryKind::PreciseMesh(_) => (Kind::Precise, 16, 4),
    };
    Traits { kind, cost, most }
}
