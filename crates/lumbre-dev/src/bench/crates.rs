//! Peers that are Rust crates: `obvhs` and `bvh`. They hold boxes; the primitives and their tests are the user's, here
//! in single precision: T. Möller, B. Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection", Journal of Graphics
//! Tools 2(1), 1997, and the quadratic formula.

use std::cell::Cell;
use std::time::Duration;

use anyhow::Result;
use bvh::aabb::{Aabb, Bounded, IntersectsAabb};
use bvh::bounding_hierarchy::{BHShape, BoundingHierarchy};
use bvh::bvh::Bvh;
use lumbre_math::Vec3;
use lumbre_math::glam::Vec3A;
use nalgebra::Point3;
use obvhs::Boundable;
use obvhs::cwbvh::CwBvh;

use crate::program::{Built, Pass, Program, Query, Tree};
use crate::rays::Ray32;
use crate::rust_heap;
use crate::scene::Scene;

const REFUSAL: &str = "it is given triangles alone or spheres alone";

fn refuses(scene: &Scene) -> Option<&'static str> {
    (!scene.is_triangles_only() && !scene.is_spheres_only()).then_some(REFUSAL)
}

/// A primitive in single precision.
trait Primitive: Copy + Send + Sync + 'static {
    fn bounds(&self) -> [Vec3; 2];
    /// Where the ray meets it in 0 to `t_max`; infinity for a miss.
    fn meet(&self, origin: Vec3A, direction: Vec3A, t_max: f32) -> f32;
}

#[derive(Clone, Copy)]
struct Triangle {
    corner: Vec3A,
    edges: [Vec3A; 2],
}

impl Primitive for Triangle {
    fn bounds(&self) -> [Vec3; 2] {
        let [a, b, c] =
            [self.corner, self.corner + self.edges[0], self.corner + self.edges[1]].map(Vec3::from);
        [a.min(b).min(c), a.max(b).max(c)]
    }

    #[inline(always)]
    fn meet(&self, origin: Vec3A, direction: Vec3A, t_max: f32) -> f32 {
        let across = direction.cross(self.edges[1]);
        let inverse = 1.0 / self.edges[0].dot(across);
        let from = origin - self.corner;
        let u = from.dot(across) * inverse;
        let along = from.cross(self.edges[0]);
        let v = direction.dot(along) * inverse;
        let t = self.edges[1].dot(along) * inverse;
        let is_hit = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (t >= 0.0) & (t <= t_max);
        if is_hit { t } else { f32::INFINITY }
    }
}

#[derive(Clone, Copy)]
struct Ball {
    center: Vec3A,
    radius: f32,
}

impl Primitive for Ball {
    fn bounds(&self) -> [Vec3; 2] {
        let center = Vec3::from(self.center);
        [center - self.radius, center + self.radius]
    }

    #[inline(always)]
    fn meet(&self, origin: Vec3A, direction: Vec3A, t_max: f32) -> f32 {
        let to_center = self.center - origin;
        let a = direction.length_squared();
        let middle = to_center.dot(direction) / a;
        let beside = to_center - middle * direction;
        let rest = self.radius * self.radius - beside.length_squared();
        if rest < 0.0 {
            return f32::INFINITY;
        }
        let half = (rest / a).sqrt();
        let [near, far] = [middle - half, middle + half];
        if 0.0 <= near && near <= t_max {
            near
        } else if 0.0 <= far && far <= t_max {
            far
        } else {
            f32::INFINITY
        }
    }
}

fn triangles(scene: &Scene) -> Vec<Triangle> {
    let of_mesh = |mesh: &lumbre_kernel::TriangleMesh| {
        let triangle = |indices: &[u32; 3]| {
            let [a, b, c] = indices.map(|i| Vec3A::from(mesh.positions[i as usize]));
            Triangle { corner: a, edges: [b - a, c - a] }
        };
        mesh.indices.iter().map(triangle).collect::<Vec<_>>()
    };
    scene.meshes.iter().flat_map(|mesh| of_mesh(mesh)).collect()
}

fn balls(scene: &Scene) -> Vec<Ball> {
    let ball = |&[x, y, z, radius]: &[f32; 4]| Ball { center: Vec3A::new(x, y, z), radius };
    scene.spheres.spheres.iter().map(ball).collect()
}

/// A tree of one of the crates with the primitives that it was made of.
trait Search: Send + Sync {
    /// The nearest hit: t and the primitive; infinity for a miss.
    fn closest(&self, ray: &Ray32) -> (f32, u32);
    /// Whether there is one.
    fn any(&self, ray: &Ray32) -> bool;
}

struct Searched<S>(S);

impl<S: Search> Tree for Searched<S> {
    fn prepare<'a>(&'a self, query: Query, rays: &[Ray32]) -> Box<dyn Pass + 'a> {
        let found = vec![(f32::INFINITY, u32::MAX); rays.len()];
        Box::new(Searching { search: &self.0, query, rays: rays.to_vec(), found })
    }
}

struct Searching<'a, S> {
    search: &'a S,
    query: Query,
    rays: Vec<Ray32>,
    found: Vec<(f32, u32)>,
}

impl<S: Search> Pass for Searching<'_, S> {
    fn reset(&mut self) {
        self.found.fill((f32::INFINITY, u32::MAX));
    }

    fn run(&mut self) {
        let rays = self.rays.iter().zip(&mut self.found);
        match self.query {
            Query::Closest => rays.for_each(|(ray, found)| *found = self.search.closest(ray)),
            Query::Any => rays.for_each(|(ray, found)| {
                found.0 = if self.search.any(ray) { 0.0 } else { f32::INFINITY };
            }),
        }
    }

    fn answers(&self) -> Vec<Option<f64>> {
        self.found.iter().map(|(t, _)| (*t < f32::INFINITY).then_some(f64::from(*t))).collect()
    }
}

/// The crate `obvhs`: compressed nodes of eight, its medium preset.
pub(crate) struct Obvhs;

struct ObvhsTree<P> {
    tree: CwBvh,
    // In the order of the leaves.
    primitives: Vec<P>,
}

struct BoxOf<P>(P);

impl<P: Primitive> Boundable for BoxOf<P> {
    fn aabb(&self) -> obvhs::aabb::Aabb {
        let [low, high] = self.0.bounds();
        obvhs::aabb::Aabb::new(low.into(), high.into())
    }
}

fn obvhs_tree<P: Primitive>(primitives: Vec<P>) -> Searched<ObvhsTree<P>> {
    let bounded: Vec<_> = primitives.into_iter().map(BoxOf).collect();
    let parameters = obvhs::BvhBuildParams::medium_build();
    let tree = obvhs::cwbvh::builder::build_cwbvh(&bounded, parameters, &mut Duration::default());
    let primitives = tree.primitive_indices.iter().map(|&i| bounded[i as usize].0).collect();
    Searched(ObvhsTree { tree, primitives })
}

impl<P: Primitive> Search for ObvhsTree<P> {
    fn closest(&self, ray: &Ray32) -> (f32, u32) {
        let ray = obvhs_ray(ray);
        let mut hit = obvhs::ray::RayHit::none();
        self.tree.ray_traverse(ray, &mut hit, |ray, i| {
            self.primitives[i].meet(ray.origin, ray.direction, ray.tmax)
        });
        (hit.t, hit.primitive_id)
    }

    fn any(&self, ray: &Ray32) -> bool {
        !self.tree.ray_traverse_miss(obvhs_ray(ray), |ray, i| {
            self.primitives[i].meet(ray.origin, ray.direction, ray.tmax)
        })
    }
}

fn obvhs_ray(ray: &Ray32) -> obvhs::ray::Ray {
    obvhs::ray::Ray::new(ray.origin.into(), ray.direction.into(), 0.0, ray.t_max)
}

impl Program for Obvhs {
    fn name(&self) -> String {
        "obvhs 0.4".to_owned()
    }

    fn refuses(&self, scene: &Scene) -> Option<&'static str> {
        refuses(scene)
    }

    fn build<'a>(&'a self, scene: &'a Scene, threads: usize) -> Result<Built<'a>> {
        let (tree, seconds, bytes) = rust_heap::measure(threads, || -> Box<dyn Tree> {
            if scene.is_triangles_only() {
                Box::new(obvhs_tree(triangles(scene)))
            } else {
                Box::new(obvhs_tree(balls(scene)))
            }
        })?;
        Ok(Built { tree, seconds, bytes })
    }
}

/// The crate `bvh`: two children a node, visited in its own order, with boxes beyond the nearest hit left out.
pub(crate) struct BinaryBvh;

struct BvhTree<P> {
    tree: Bvh<f32, 3>,
    primitives: Vec<BvhShape<P>>,
}

struct BvhShape<P> {
    primitive: P,
    node: usize,
    index: u32,
}

impl<P: Primitive> Bounded<f32, 3> for BvhShape<P> {
    fn aabb(&self) -> Aabb<f32, 3> {
        let [low, high] = self.primitive.bounds();
        Aabb::with_bounds(Point3::from(low.to_array()), Point3::from(high.to_array()))
    }
}

impl<P: Primitive> BHShape<f32, 3> for BvhShape<P> {
    fn set_bh_node_index(&mut self, node: usize) {
        self.node = node;
    }

    fn bh_node_index(&self) -> usize {
        self.node
    }
}

/// The part of a ray that is still of interest: the crate's own ray has no end.
struct Segment {
    origin: Vec3A,
    inverse: Vec3A,
    t_max: Cell<f32>,
}

impl Segment {
    fn new(ray: &Ray32) -> Self {
        let inverse = Vec3A::from(ray.direction).recip();
        Self { origin: ray.origin.into(), inverse, t_max: Cell::new(ray.t_max) }
    }
}

impl IntersectsAabb<f32, 3> for Segment {
    #[inline(always)]
    fn intersects_aabb(&self, aabb: &Aabb<f32, 3>) -> bool {
        let side = |i: usize| Vec3A::from(<[f32; 3]>::from(aabb[i].coords));
        let first = (side(0) - self.origin) * self.inverse;
        let second = (side(1) - self.origin) * self.inverse;
        let enter = first.min(second).max_element().max(0.0);
        let leave = first.max(second).min_element().min(self.t_max.get());
        enter <= leave
    }
}

fn bvh_tree<P: Primitive>(primitives: Vec<P>) -> Searched<BvhTree<P>> {
    let shape = |(index, primitive): (usize, P)| BvhShape { primitive, node: 0, index: index as u32 };
    let mut primitives: Vec<_> = primitives.into_iter().enumerate().map(shape).collect();
    let tree = Bvh::build_par(&mut primitives);
    Searched(BvhTree { tree, primitives })
}

impl<P: Primitive> Search for BvhTree<P> {
    fn closest(&self, ray: &Ray32) -> (f32, u32) {
        let segment = Segment::new(ray);
        let (origin, direction) = (ray.origin.into(), ray.direction.into());
        let mut best = (f32::INFINITY, u32::MAX);
        for shape in self.tree.traverse_iterator(&segment, &self.primitives) {
            let t = shape.primitive.meet(origin, direction, segment.t_max.get());
            if t < best.0 {
                best = (t, shape.index);
                segment.t_max.set(t);
            }
        }
        best
    }

    fn any(&self, ray: &Ray32) -> bool {
        let segment = Segment::new(ray);
        let (origin, direction) = (ray.origin.into(), ray.direction.into());
        let mut shapes = self.tree.traverse_iterator(&segment, &self.primitives);
        shapes.any(|shape| shape.primitive.meet(origin, direction, ray.t_max) < f32::INFINITY)
    }
}

impl Program for BinaryBvh {
    fn name(&self) -> String {
        "bvh 0.13".to_owned()
    }

    fn refuses(&self, scene: &Scene) -> Option<&'static str> {
        refuses(scene)
    }

    fn build<'a>(&'a self, scene: &'a Scene, threads: usize) -> Result<Built<'a>> {
        let (tree, seconds, bytes) = rust_heap::measure(threads, || -> Box<dyn Tree> {
            if scene.is_triangles_only() {
                Box::new(bvh_tree(triangles(scene)))
            } else {
                Box::new(bvh_tree(balls(scene)))
            }
        })?;
        Ok(Built { tree, seconds, bytes })
    }
}
