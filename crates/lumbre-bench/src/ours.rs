//! Lumbre's kernel.

use std::sync::Arc;

use anyhow::{Context, Result};
use lumbre_geometry::{PlacedShape, Ray, Sphere};
use lumbre_kernel::{Accel, BuildOptions, Geometry, GeometryKind, Instance, Preset};
use lumbre_math::{DVec3, Transform};

use crate::program::{Built, Pass, Program, Query, Tree};
use crate::rays::Ray32;
use crate::rust_heap;
use crate::scene::Scene;

/// Lumbre, one ray at a time.
pub struct Lumbre {
    /// How its trees are built.
    pub preset: Preset,
}

/// Every way in which it takes part.
pub fn programs(preset: Preset) -> Vec<Box<dyn Program>> {
    vec![Box::new(Lumbre { preset })]
}

impl Program for Lumbre {
    fn name(&self) -> String {
        let version = env!("CARGO_PKG_VERSION");
        match self.preset {
            Preset::Fast => format!("Lumbre {version} fast"),
            Preset::Balanced => format!("Lumbre {version}"),
            Preset::Best => format!("Lumbre {version} best"),
        }
    }

    fn refuses(&self, _: &Scene) -> Option<&'static str> {
        None
    }

    fn build<'a>(&'a self, scene: &'a Scene, threads: usize) -> Result<Built<'a>> {
        // Lists of shapes are what the program takes.
        let list = list(scene);
        let list_bytes = list.capacity() * size_of::<Geometry>();
        let (accel, seconds, mut bytes) =
            rust_heap::measure(threads, || build_list(scene, list, self.preset))?;
        // The tree keeps the list.
        bytes.kept += list_bytes;
        bytes.peak += list_bytes;
        Ok(Built { tree: Box::new(accel?), seconds, bytes })
    }
}

/// The kernel's tree of a scene.
pub fn build(scene: &Scene, preset: Preset) -> Result<Accel> {
    build_list(scene, list(scene), preset)
}

/// What stands in a scene; instances for now of nothing.
fn list(scene: &Scene) -> Vec<Geometry> {
    let nothing = Arc::new(Accel::build(Vec::new(), &BuildOptions::default()).expect("nothing is sound"));
    let meshes = scene.meshes.iter().map(|mesh| GeometryKind::Mesh(Arc::clone(mesh)));
    let spheres = scene.spheres.iter().map(|sphere| GeometryKind::Shape(placed_sphere(*sphere)));
    let shapes = scene.shapes.iter().map(|shape| GeometryKind::Shape(shape.clone()));
    let instances = scene.placements.iter().map(|placement| {
        let world_from_object = placement.transform();
        GeometryKind::Instance(Instance { accel: Arc::clone(&nothing), world_from_object })
    });
    let kinds = meshes.chain(spheres).chain(shapes).chain(instances);
    kinds.enumerate().map(|(i, kind)| Geometry { id: i as u32, kind }).collect()
}

fn build_list(scene: &Scene, mut list: Vec<Geometry>, preset: Preset) -> Result<Accel> {
    let options = BuildOptions { preset };
    let placed: Result<Vec<_>, _> = scene
        .placed_meshes
        .iter()
        .map(|mesh| {
            let kind = GeometryKind::Mesh(Arc::clone(mesh));
            Accel::build(vec![Geometry { id: 0, kind }], &options).map(Arc::new)
        })
        .collect();
    let placed = placed.context("a placed mesh")?;
    let first = list.len() - scene.placements.len();
    for (geometry, placement) in list[first..].iter_mut().zip(&scene.placements) {
        if let GeometryKind::Instance(instance) = &mut geometry.kind {
            instance.accel = Arc::clone(&placed[placement.mesh]);
        }
    }
    Accel::build(list, &options).context("the scene")
}

fn placed_sphere([x, y, z, radius]: [f32; 4]) -> PlacedShape {
    let center = DVec3::new(x.into(), y.into(), z.into());
    let sphere = Sphere::new(center, radius.into()).expect("spheres have radii");
    PlacedShape::new(sphere.into(), Transform::IDENTITY)
}

impl Tree for Accel {
    fn prepare<'a>(&'a self, query: Query, rays: &[Ray32]) -> Box<dyn Pass + 'a> {
        let rays: Vec<Ray> = rays.iter().map(|ray| ray.to_f64()).collect();
        match query {
            Query::Closest => {
                let found = vec![Found::MISS; rays.len()];
                Box::new(Closest { accel: self, rays, found })
            }
            Query::Any => {
                let found = vec![false; rays.len()];
                Box::new(Any { accel: self, rays, found })
            }
        }
    }
}

/// What is written down of a hit: about what Embree writes.
#[derive(Clone, Copy)]
struct Found {
    t_and_barycentrics: [f64; 3],
    geometry_and_primitive: [u32; 2],
}

impl Found {
    const MISS: Self = Self { t_and_barycentrics: [f64::INFINITY; 3], geometry_and_primitive: [u32::MAX; 2] };
}

struct Closest<'a> {
    accel: &'a Accel,
    rays: Vec<Ray>,
    found: Vec<Found>,
}

impl Pass for Closest<'_> {
    fn reset(&mut self) {
        self.found.fill(Found::MISS);
    }

    fn run(&mut self) {
        for (ray, found) in self.rays.iter().zip(&mut self.found) {
            if let Some(hit) = self.accel.closest(ray) {
                *found = Found {
                    t_and_barycentrics: [hit.root.t, hit.root.local.x, hit.root.local.y],
                    geometry_and_primitive: [hit.geometry, hit.primitive],
                };
            }
        }
    }

    fn answers(&self) -> Vec<Option<f64>> {
        let is_hit = |found: &Found| found.geometry_and_primitive[0] != u32::MAX;
        self.found.iter().map(|found| is_hit(found).then_some(found.t_and_barycentrics[0])).collect()
    }
}

struct Any<'a> {
    accel: &'a Accel,
    rays: Vec<Ray>,
    found: Vec<bool>,
}

impl Pass for Any<'_> {
    fn reset(&mut self) {
        self.found.fill(false);
    }

    fn run(&mut self) {
        for (ray, found) in self.rays.iter().zip(&mut self.found) {
            *found = self.accel.any(ray);
        }
    }

    fn answers(&self) -> Vec<Option<f64>> {
        self.found.iter().map(|found| found.then_some(0.0)).collect()
    }
}
