//! Lumbre's kernel.

use std::hint::black_box;
use std::sync::Arc;

use anyhow::{Context, Result};
use lumbre_geometry::{PlacedShape, Ray, Sphere};
use lumbre_kernel::{
    Accel, BuildOptions, Geometry, GeometryKind, Hit, Hit32, PreciseMesh, Preset, TriangleMesh,
};
use lumbre_math::{DVec3, Transform, Vec3};

use crate::program::{Built, Pass, Program, Query, Tree};
use crate::rays::Ray32;
use crate::rust_heap;
use crate::scene::Scene;

/// Lumbre.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lumbre {
    /// How its trees are built.
    pub preset: Preset,
    /// How it is asked.
    pub asked: Asked,
    /// In which precision.
    pub precision: Precision,
    /// Whether every sphere is a shape of its own, not one of a cloud.
    pub places_spheres: bool,
}

/// The precision of rays and answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Precision {
    /// As the rays are made, and as other programs have it.
    Single,
    /// The same rays in double precision.
    Double,
}

/// How a tree is asked: the same answers in every way. In single precision, in the first three.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Asked {
    /// One ray at a time.
    Each,
    /// By batches of [`BATCH`] rays: coherent ones as packets, the others interleaved.
    ByBatches,
    /// One ray at a time, each written number by number just before, as by who makes it.
    Fresh,
    /// One ray at a time, in double precision from the start.
    Plainly,
    /// One ray at a time, with options that leave nothing out.
    WithOptions,
    /// The same with masks on all geometries, which let all rays through.
    WithMasks,
    /// One ray at a time, but for a primitive that is nowhere.
    Excluding,
    /// One ray at a time, with a closure that takes every hit.
    Filtered,
    /// One ray at a time, of meshes whose vertices are in double precision, too.
    OfPreciseMeshes,
}

impl Asked {
    /// All but the first: what else costs what.
    pub(crate) const OTHERS: [Self; 8] = [
        Self::ByBatches,
        Self::Fresh,
        Self::Plainly,
        Self::WithOptions,
        Self::WithMasks,
        Self::Excluding,
        Self::Filtered,
        Self::OfPreciseMeshes,
    ];

    fn name(self) -> &'static str {
        match self {
            Self::Each => "",
            Self::ByBatches => " batches",
            Self::Fresh => " fresh",
            Self::Plainly => " alone",
            Self::WithOptions => " options",
            Self::WithMasks => " masks",
            Self::Excluding => " excluding",
            Self::Filtered => " filtered",
            Self::OfPreciseMeshes => " f64 meshes",
        }
    }
}

/// Masks that share a bit with what is asked.
const MASK_OF_ALL: u32 = 0b0110;
const MASK_ASKED: u32 = 0b1010;

/// Rays that a batch has at most.
const BATCH: usize = 4096;

impl Program for Lumbre {
    fn name(&self) -> String {
        let version = env!("CARGO_PKG_VERSION");
        let preset = match self.preset {
            Preset::Fast => " fast",
            Preset::Balanced => "",
            Preset::Best => " best",
        };
        let asked = self.asked.name();
        let placed = if self.places_spheres { " placed" } else { "" };
        let precision = match self.precision {
            Precision::Single => "",
            Precision::Double => " double",
        };
        format!("Lumbre {version}{preset}{precision}{asked}{placed}")
    }

    fn refuses(&self, scene: &Scene) -> Option<&'static str> {
        let has_meshes = !scene.meshes.is_empty() || !scene.placed_meshes.is_empty();
        match self.asked {
            Asked::OfPreciseMeshes if !has_meshes => Some("there is no mesh"),
            _ => None,
        }
    }

    fn takes_squares(&self) -> bool {
        self.asked == Asked::ByBatches
    }

    fn build<'a>(&'a self, scene: &'a Scene, threads: usize) -> Result<Built<'a>> {
        // Lists of shapes are what the program takes.
        let is_precise = self.asked == Asked::OfPreciseMeshes;
        let list = list(scene, self.places_spheres, is_precise);
        let count = list.len();
        let list_bytes = list.capacity() * size_of::<Geometry>();
        let (accel, seconds, mut bytes) =
            rust_heap::measure(threads, || build_list(scene, list, self.preset, is_precise))?;
        // The tree keeps the list.
        bytes.kept += list_bytes;
        bytes.peak += list_bytes;
        let mut accel = accel?;
        if self.asked == Asked::WithMasks {
            accel = accel.with_masks(vec![MASK_OF_ALL; count]);
        }
        let tree = Queried { accel, asked: self.asked, precision: self.precision, nowhere: nowhere()? };
        Ok(Built { tree: Box::new(tree), seconds, bytes })
    }
}

/// The kernel's tree of a scene.
pub(crate) fn build(scene: &Scene, preset: Preset) -> Result<Accel> {
    build_list(scene, list(scene, false, false), preset, false)
}

/// What stands in a scene; instances for now of nothing.
fn list(scene: &Scene, places_spheres: bool, is_precise: bool) -> Vec<Geometry> {
    let nothing = Arc::new(Accel::build(Vec::new(), &BuildOptions::default()).expect("nothing is sound"));
    let meshes = scene.meshes.iter().map(|mesh| mesh_kind(mesh, is_precise));
    let has_cloud = !places_spheres && scene.sphere_count() > 0;
    let cloud = has_cloud.then(|| GeometryKind::Spheres(Arc::clone(&scene.spheres)));
    let placed = if places_spheres { &scene.spheres.spheres[..] } else { &[] };
    let spheres = placed.iter().map(|sphere| GeometryKind::Shape(placed_sphere(*sphere))).chain(cloud);
    let shapes = scene.shapes.iter().map(|shape| GeometryKind::Shape(shape.clone()));
    let instances = scene.placements.iter().map(|placement| {
        let world_from_object = placement.transform();
        GeometryKind::Instance(nothing.instance(world_from_object))
    });
    let hair =
        (!scene.curves.points.is_empty()).then(|| GeometryKind::Custom(Arc::new(scene.curves.curves()) as _));
    let kinds = meshes.chain(spheres).chain(hair).chain(shapes).chain(instances);
    kinds.enumerate().map(|(i, kind)| Geometry { id: i as u32, kind }).collect()
}

fn mesh_kind(mesh: &Arc<TriangleMesh>, is_precise: bool) -> GeometryKind {
    if !is_precise {
        return GeometryKind::Mesh(Arc::clone(mesh));
    }
    let positions = mesh.positions.iter().map(|p| mesh.origin + p.as_dvec3()).collect();
    GeometryKind::PreciseMesh(Arc::new(PreciseMesh { positions, indices: mesh.indices.clone() }))
}

fn build_list(scene: &Scene, mut list: Vec<Geometry>, preset: Preset, is_precise: bool) -> Result<Accel> {
    let options = BuildOptions { preset };
    let placed: Result<Vec<_>, _> = scene
        .placed_meshes
        .iter()
        .map(|mesh| {
            let kind = mesh_kind(mesh, is_precise);
            Accel::build(vec![Geometry { id: 0, kind }], &options).map(Arc::new)
        })
        .collect();
    let placed = placed.context("a placed mesh")?;
    let first = list.len() - scene.placements.len();
    for (geometry, placement) in list[first..].iter_mut().zip(&scene.placements) {
        if let GeometryKind::Instance(instance) = &mut geometry.kind {
            *instance = placed[placement.mesh].instance(instance.world_from_object.clone());
        }
    }
    Accel::build(list, &options).context("the scene")
}

fn placed_sphere([x, y, z, radius]: [f32; 4]) -> PlacedShape {
    let center = DVec3::new(x.into(), y.into(), z.into());
    let sphere = Sphere::new(center, radius.into()).expect("spheres have radii");
    PlacedShape::new(sphere.into(), Transform::IDENTITY)
}

/// A tree, and how it is asked.
struct Queried {
    accel: Accel,
    asked: Asked,
    precision: Precision,
    /// Of the first geometry, but no primitive of that.
    nowhere: Hit,
}

fn nowhere() -> Result<Hit> {
    let kind = GeometryKind::Shape(placed_sphere([0.0, 0.0, 0.0, 1.0]));
    let ball = Accel::build(vec![Geometry { id: 0, kind }], &BuildOptions::default())?;
    let mut hit = ball.closest(&Ray::new(DVec3::ZERO, DVec3::X)).context("a ball from within")?;
    hit.primitive = u32::MAX - 1;
    Ok(hit)
}

impl Tree for Queried {
    fn prepare<'a>(&'a self, query: Query, rays: &[Ray32]) -> Box<dyn Pass + 'a> {
        let tree = self;
        if self.precision == Precision::Single {
            let rays: Vec<_> = rays.iter().map(|ray| ray.to_ours()).collect();
            return match query {
                Query::Closest => {
                    if self.asked == Asked::ByBatches {
                        let hits = vec![None; rays.len()];
                        return Box::new(SingleClosestBatches { tree, rays, hits });
                    }
                    let found = vec![SingleFound::MISS; rays.len()];
                    Box::new(SingleClosest { tree, rays, found })
                }
                Query::Any => {
                    let found = vec![false; rays.len()];
                    Box::new(SingleAny { tree, rays, found })
                }
            };
        }
        let rays: Vec<Ray> = rays.iter().map(|ray| ray.to_f64()).collect();
        match query {
            Query::Closest => {
                let found = vec![Found::MISS; rays.len()];
                Box::new(Closest { tree, rays, found, batch: vec![None; BATCH] })
            }
            Query::Any => {
                let found = vec![false; rays.len()];
                Box::new(Any { tree, rays, found })
            }
        }
    }
}

fn masked() -> lumbre_kernel::Query<'static> {
    lumbre_kernel::Query::new().mask(MASK_ASKED)
}

fn excluding(hit: &Hit) -> lumbre_kernel::Query<'_> {
    lumbre_kernel::Query::new().exclude(hit)
}

/// What is written down of a hit: about what Embree writes.
#[derive(Clone, Copy)]
struct Found {
    t_and_barycentrics: [f64; 3],
    geometry_and_primitive: [u32; 2],
}

impl Found {
    const MISS: Self = Self { t_and_barycentrics: [f64::INFINITY; 3], geometry_and_primitive: [u32::MAX; 2] };

    fn put(&mut self, hit: Option<&Hit>) {
        if let Some(hit) = hit {
            self.t_and_barycentrics = [hit.root.t, hit.root.local.x, hit.root.local.y];
            self.geometry_and_primitive = [hit.geometry, hit.primitive];
        }
    }
}

/// The same ray, written number by number.
#[inline(always)]
fn written_now(ray: &Ray) -> Ray {
    let vector = |v: &DVec3| DVec3::new(black_box(v.x), black_box(v.y), black_box(v.z));
    Ray {
        origin: vector(&ray.origin),
        direction: vector(&ray.direction),
        t_min: black_box(ray.t_min),
        t_max: black_box(ray.t_max),
        time: ray.time,
    }
}

/// The same in single precision.
#[inline(always)]
fn written_now_f32(ray: &lumbre_kernel::Ray32) -> lumbre_kernel::Ray32 {
    let vector = |v: &Vec3| Vec3::new(black_box(v.x), black_box(v.y), black_box(v.z));
    lumbre_kernel::Ray32 {
        origin: vector(&ray.origin),
        t_min: black_box(ray.t_min),
        direction: vector(&ray.direction),
        t_max: black_box(ray.t_max),
    }
}

struct Closest<'a> {
    tree: &'a Queried,
    rays: Vec<Ray>,
    found: Vec<Found>,
    batch: Vec<Option<Hit>>,
}

impl Closest<'_> {
    // A loop of its own for every way of asking.
    #[inline(always)]
    fn each(&mut self, ask: impl Fn(&Ray) -> Option<Hit>) {
        for (ray, found) in self.rays.iter().zip(&mut self.found) {
            found.put(ask(ray).as_ref());
        }
    }
}

impl Pass for Closest<'_> {
    fn reset(&mut self) {
        self.found.fill(Found::MISS);
    }

    fn run(&mut self) {
        let Queried { accel, asked, nowhere, .. } = self.tree;
        if *asked == Asked::ByBatches {
            for (rays, found) in self.rays.chunks(BATCH).zip(self.found.chunks_mut(BATCH)) {
                let hits = &mut self.batch[..rays.len()];
                accel.closest_batch(rays, hits);
                found.iter_mut().zip(hits).for_each(|(found, hit)| found.put(hit.as_ref()));
            }
            return;
        }
        match asked {
            Asked::Fresh => self.each(|ray| accel.closest(&written_now(ray))),
            Asked::Plainly => self.each(|ray| accel.closest_exact(ray)),
            Asked::WithOptions => self.each(|ray| accel.closest_with(ray, &lumbre_kernel::Query::new())),
            Asked::WithMasks => self.each(|ray| accel.closest_with(ray, &masked())),
            Asked::Excluding => self.each(|ray| accel.closest_with(ray, &excluding(nowhere))),
            Asked::Filtered => {
                let accept = |hit: &Hit| hit.primitive != nowhere.primitive;
                self.each(|ray| accel.closest_with(ray, &lumbre_kernel::Query::new().filter(&accept)));
            }
            _ => self.each(|ray| accel.closest(ray)),
        }
    }

    fn answers(&self) -> Vec<Option<f64>> {
        let is_hit = |found: &Found| found.geometry_and_primitive[0] != u32::MAX;
        self.found.iter().map(|found| is_hit(found).then_some(found.t_and_barycentrics[0])).collect()
    }
}

struct Any<'a> {
    tree: &'a Queried,
    rays: Vec<Ray>,
    found: Vec<bool>,
}

impl Any<'_> {
    #[inline(always)]
    fn each(&mut self, ask: impl Fn(&Ray) -> bool) {
        for (ray, found) in self.rays.iter().zip(&mut self.found) {
            *found = ask(ray);
        }
    }
}

impl Pass for Any<'_> {
    fn reset(&mut self) {
        self.found.fill(false);
    }

    fn run(&mut self) {
        let Queried { accel, asked, nowhere, .. } = self.tree;
        if *asked == Asked::ByBatches {
            for (rays, found) in self.rays.chunks(BATCH).zip(self.found.chunks_mut(BATCH)) {
                accel.any_batch(rays, found);
            }
            return;
        }
        match asked {
            Asked::Fresh => self.each(|ray| accel.any(&written_now(ray))),
            Asked::Plainly => self.each(|ray| accel.any_exact(ray)),
            Asked::WithOptions => self.each(|ray| accel.any_with(ray, &lumbre_kernel::Query::new())),
            Asked::WithMasks => self.each(|ray| accel.any_with(ray, &masked())),
            Asked::Excluding => self.each(|ray| accel.any_with(ray, &excluding(nowhere))),
            Asked::Filtered => {
                let accept = |hit: &Hit| hit.primitive != nowhere.primitive;
                self.each(|ray| accel.any_with(ray, &lumbre_kernel::Query::new().filter(&accept)));
            }
            _ => self.each(|ray| accel.any(ray)),
        }
    }

    fn answers(&self) -> Vec<Option<f64>> {
        self.found.iter().map(|found| found.then_some(0.0)).collect()
    }
}

/// What is written down of a hit in single precision, alike.
#[derive(Clone, Copy)]
struct SingleFound {
    t_and_barycentrics: [f32; 3],
    geometry_and_primitive: [u32; 2],
}

impl SingleFound {
    const MISS: Self = Self { t_and_barycentrics: [f32::INFINITY; 3], geometry_and_primitive: [u32::MAX; 2] };

    // Field by field: a whole that was written in parts is slow to be read at once.
    #[inline(always)]
    fn put(&mut self, hit: Option<&Hit32>) {
        if let Some(hit) = hit {
            self.t_and_barycentrics = [hit.t, hit.local[0], hit.local[1]];
            self.geometry_and_primitive = [hit.geometry, hit.primitive];
        }
    }
}

struct SingleClosest<'a> {
    tree: &'a Queried,
    rays: Vec<lumbre_kernel::Ray32>,
    found: Vec<SingleFound>,
}

impl Pass for SingleClosest<'_> {
    fn reset(&mut self) {
        self.found.fill(SingleFound::MISS);
    }

    fn run(&mut self) {
        let Queried { accel, asked, .. } = self.tree;
        if *asked == Asked::Fresh {
            for (ray, found) in self.rays.iter().zip(&mut self.found) {
                found.put(accel.closest_f32(&written_now_f32(ray)).as_ref());
            }
            return;
        }
        for (ray, found) in self.rays.iter().zip(&mut self.found) {
            found.put(accel.closest_f32(ray).as_ref());
        }
    }

    fn answers(&self) -> Vec<Option<f64>> {
        let is_hit = |found: &SingleFound| found.geometry_and_primitive[0] != u32::MAX;
        self.found.iter().map(|found| is_hit(found).then(|| found.t_and_barycentrics[0].into())).collect()
    }
}

/// Batches write the hits themselves.
struct SingleClosestBatches<'a> {
    tree: &'a Queried,
    rays: Vec<lumbre_kernel::Ray32>,
    hits: Vec<Option<Hit32>>,
}

impl Pass for SingleClosestBatches<'_> {
    fn reset(&mut self) {
        self.hits.fill(None);
    }

    fn run(&mut self) {
        for (rays, hits) in self.rays.chunks(BATCH).zip(self.hits.chunks_mut(BATCH)) {
            self.tree.accel.closest_batch_f32(rays, hits);
        }
    }

    fn answers(&self) -> Vec<Option<f64>> {
        self.hits.iter().map(|hit| hit.map(|hit| hit.t.into())).collect()
    }
}

struct SingleAny<'a> {
    tree: &'a Queried,
    rays: Vec<lumbre_kernel::Ray32>,
    found: Vec<bool>,
}

impl Pass for SingleAny<'_> {
    fn reset(&mut self) {
        self.found.fill(false);
    }

    fn run(&mut self) {
        let Queried { accel, asked, .. } = self.tree;
        if *asked == Asked::ByBatches {
            for (rays, found) in self.rays.chunks(BATCH).zip(self.found.chunks_mut(BATCH)) {
                accel.any_batch_f32(rays, found);
            }
            return;
        }
        if *asked == Asked::Fresh {
            for (ray, found) in self.rays.iter().zip(&mut self.found) {
                *found = accel.any_f32(&written_now_f32(ray));
            }
            return;
        }
        for (ray, found) in self.rays.iter().zip(&mut self.found) {
            *found = accel.any_f32(ray);
        }
    }

    fn answers(&self) -> Vec<Option<f64>> {
        self.found.iter().map(|found| found.then_some(0.0)).collect()
    }
}
