//! Things to build trees of, and rays to send at them.

use std::cell::Cell;
use std::sync::Arc;

use lumbre_geometry::{
    Aabb, BilinearPatch, Cone, Cuboid, Cylinder, Disk, NearestPoint, NearestPointError, Paraboloid,
    PlacedShape, Plane, Ray, Root, Roots, Shape, Sphere, Surface, Torus, Triangle,
};
use lumbre_math::{DVec2, DVec3, Transform, Vec3};

use crate::{
    Accel, BuildOptions, CustomGeometry, Geometry, GeometryKind, PreciseMesh, Preset, SphereCloud,
    TriangleMesh,
};

/// SplitMix64 (G. Steele, D. Lea, C. Flood, OOPSLA 2014).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// In [0, 1).
    pub(crate) fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    pub(crate) fn below(&mut self, n: usize) -> usize {
        (self.unit() * n as f64) as usize
    }

    /// Each component in [-1, 1).
    pub(crate) fn vector(&mut self) -> DVec3 {
        DVec3::new(self.between(-1.0, 1.0), self.between(-1.0, 1.0), self.between(-1.0, 1.0))
    }

    pub(crate) fn placement(&mut self, center: DVec3, spread: f64, size: f64) -> Transform {
        let factors =
            DVec3::new(self.between(0.3, 1.8), self.between(0.3, 1.8), self.between(0.3, 1.8)) * size;
        let mirror = if self.unit() < 0.3 { DVec3::new(-1.0, 1.0, 1.0) } else { DVec3::ONE };
        Transform::translate(center + spread * self.vector())
            * Transform::rotate(self.vector(), self.between(-180.0, 180.0)).unwrap()
            * Transform::scale(factors * mirror).unwrap()
    }
}

thread_local! {
    static PRESET: Cell<Preset> = const { Cell::new(Preset::Balanced) };
}

/// How often a test repeats what it does: a quarter of `long`, and all of it by `cargo xtask test --all`.
pub(crate) fn repeats(long: usize) -> usize {
    if std::env::var_os("LUMBRE_LONG_TESTS").is_some() { long } else { long.div_ceil(4) }
}

/// Runs a test once with every preset for what it builds.
pub(crate) fn with_every_preset(mut run: impl FnMut()) {
    for preset in Preset::ALL {
        PRESET.set(preset);
        run();
    }
    PRESET.set(Preset::default());
}

pub(crate) fn build(kinds: Vec<GeometryKind>) -> Accel {
    let geometries =
        kinds.into_iter().enumerate().map(|(i, kind)| Geometry { id: 1000 + 7 * i as u32, kind }).collect();
    Accel::build(geometries, &options()).unwrap()
}

pub(crate) fn options() -> BuildOptions {
    BuildOptions { preset: PRESET.get() }
}

pub(crate) fn mesh(positions: Vec<DVec3>, indices: Vec<[u32; 3]>) -> TriangleMesh {
    TriangleMesh {
        origin: DVec3::ZERO,
        positions: positions.into_iter().map(|p| p.as_vec3()).collect(),
        indices,
    }
}

/// A closed cube, 12 triangles, not at the origin.
pub(crate) fn cube() -> TriangleMesh {
    let positions = (0..8)
        .map(|i| {
            DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2)) * 2.5
                + DVec3::new(0.5, -1.0, 3.0)
        })
        .collect();
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let indices = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    mesh(positions, indices)
}

/// A closed sphere by subdivision of an icosahedron: 20 · 4^levels triangles.
pub(crate) fn icosphere(levels: u32, center: DVec3, radius: f64) -> TriangleMesh {
    let golden = 0.5 * (1.0 + 5.0f64.sqrt());
    let mut positions = Vec::new();
    for (a, b) in [(-1.0, golden), (1.0, golden), (-1.0, -golden), (1.0, -golden)] {
        positions.push(DVec3::new(a, b, 0.0).normalize());
    }
    for (a, b) in [(-1.0, golden), (1.0, golden), (-1.0, -golden), (1.0, -golden)] {
        positions.push(DVec3::new(0.0, a, b).normalize());
    }
    for (a, b) in [(golden, -1.0), (golden, 1.0), (-golden, -1.0), (-golden, 1.0)] {
        positions.push(DVec3::new(a, 0.0, b).normalize());
    }
    let mut indices: Vec<[u32; 3]> = vec![
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    for _ in 0..levels {
        let mut middles = std::collections::HashMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                positions.push((positions[a as usize] + positions[b as usize]).normalize());
                positions.len() as u32 - 1
            })
        };
        indices = indices
            .iter()
            .flat_map(|&[a, b, c]| {
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    mesh(positions.into_iter().map(|p| center + radius * p).collect(), indices)
}

/// A closed mesh that is no convex body, but seen whole from its centre: an icosphere with its vertices moved in and
/// out.
pub(crate) fn bumpy(levels: u32, center: DVec3, radius: f64) -> TriangleMesh {
    let mut random = Random(29);
    let mut ball = icosphere(levels, DVec3::ZERO, radius);
    for p in &mut ball.positions {
        *p = (center + p.as_dvec3() * random.between(0.6, 1.4)).as_vec3();
    }
    ball
}

/// A closed torus of `n` by `m` quads. With a small `minor` and few `m` its triangles are needles.
pub(crate) fn torus(n: u32, m: u32, major: f64, minor: f64) -> TriangleMesh {
    let turn = std::f64::consts::TAU;
    let mut positions = Vec::new();
    let mut indices = Vec::new();
    for i in 0..n {
        for j in 0..m {
            let (sin_u, cos_u) = (turn * f64::from(i) / f64::from(n)).sin_cos();
            let (sin_v, cos_v) = (turn * f64::from(j) / f64::from(m)).sin_cos();
            let ring = major + minor * cos_v;
            positions
                .push(DVec3::new(ring * cos_u, ring * sin_u, minor * sin_v) + DVec3::new(-0.7, 0.4, 1.1));
            let at = |i: u32, j: u32| (i % n) * m + j % m;
            let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
            indices.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh(positions, indices)
}

/// Loose triangles of many sizes, a few of them without area.
pub(crate) fn soup(random: &mut Random, count: usize, origin: DVec3, extent: f64) -> TriangleMesh {
    let mut positions = Vec::new();
    let mut indices = Vec::new();
    for _ in 0..count {
        let size = extent * 0.4 * random.unit().powi(3);
        let center = extent * random.vector();
        let base = positions.len() as u32;
        for _ in 0..3 {
            positions.push((center + size * random.vector()).as_vec3());
        }
        indices.push(if random.unit() < 0.02 { [base, base + 1, base] } else { [base, base + 1, base + 2] });
    }
    TriangleMesh { origin, positions, indices }
}

/// Walls and boards of two triangles each every which way, and among them, in heaps, a hundred small triangles for each
/// of these.
pub(crate) fn room(random: &mut Random, walls: usize) -> TriangleMesh {
    let mut positions = Vec::new();
    let mut indices = Vec::new();
    for wall in 0..walls {
        let center = random.vector();
        let [u, v] = [1, 2].map(|turn| DVec3::AXES[(wall + turn) % 3] * random.between(0.1, 0.5));
        let corners = [center - u - v, center + u - v, center + u + v, center - u + v];
        let base = positions.len() as u32;
        positions.extend(corners);
        indices.extend([[base, base + 1, base + 2], [base, base + 2, base + 3]]);
        let heap = random.vector();
        for _ in 0..200 {
            let at = heap + 0.1 * random.vector();
            let base = positions.len() as u32;
            positions.extend([(); 3].map(|()| at + 0.01 * random.vector()));
            indices.push([base, base + 1, base + 2]);
        }
    }
    mesh(positions, indices)
}

/// The same mesh in double precision.
pub(crate) fn precise(mesh: &TriangleMesh) -> PreciseMesh {
    let positions = mesh.positions.iter().map(|p| mesh.origin + p.as_dvec3()).collect();
    PreciseMesh { positions, indices: mesh.indices.clone() }
}

/// Spheres as a user would bring them; the last primitive is the infinite slab |y - floor| ≤ 0.125 where asked.
#[derive(Debug)]
pub(crate) struct Balls {
    pub(crate) balls: Vec<(DVec3, f64)>,
    pub(crate) floor: Option<f64>,
}

impl CustomGeometry for Balls {
    fn primitive_count(&self) -> u32 {
        self.balls.len() as u32 + u32::from(self.floor.is_some())
    }

    fn bounds(&self, primitive: u32) -> Option<Aabb> {
        let &(center, radius) = self.balls.get(primitive as usize)?;
        Some(Aabb { min: center - radius, max: center + radius }.outward(2))
    }

    fn closest(&self, primitive: u32, ray: &Ray) -> Option<Root> {
        let mut roots = Roots::new();
        self.roots(primitive, ray, &mut roots);
        roots.first().copied()
    }

    fn closest_point(&self, primitive: u32, point: DVec3) -> Result<NearestPoint, NearestPointError> {
        let &(center, radius) = self.balls.get(primitive as usize).ok_or(NearestPointError::NotOffered)?;
        let arm = (point - center).try_normalize().unwrap_or(DVec3::X);
        let distance = ((point - center).length() - radius).abs();
        Ok(NearestPoint { point: center + radius * arm, distance, part: 0, uv: DVec2::ZERO })
    }

    fn roots(&self, primitive: u32, ray: &Ray, out: &mut Roots) {
        let ts = match self.balls.get(primitive as usize) {
            Some(&(center, radius)) => {
                let size = ray.direction.abs().max_element();
                let direction = ray.direction / size;
                let to_center = center - ray.origin;
                let nearest = to_center.dot(direction) / direction.length_squared();
                let across = to_center - nearest * direction;
                let half = ((radius * radius - across.length_squared()) / direction.length_squared()).sqrt();
                [(nearest - half) / size, (nearest + half) / size]
            }
            None => {
                let floor = self.floor.expect("the last primitive");
                let (a, b) = (
                    (floor - 0.125 - ray.origin.y) / ray.direction.y,
                    (floor + 0.125 - ray.origin.y) / ray.direction.y,
                );
                if a < b { [a, b] } else { [b, a] }
            }
        };
        for t in ts {
            if ray.contains(t) && t.is_finite() {
                out.push(Root { t, part: 0, multiplicity: 1, local: DVec2::ZERO });
            }
        }
    }

    fn surface(&self, primitive: u32, ray: &Ray, root: &Root) -> Surface {
        let point = ray.at(root.t);
        let normal = match self.balls.get(primitive as usize) {
            Some(&(center, _)) => (point - center).normalize(),
            None => DVec3::Y,
        };
        Surface {
            point,
            point_error: DVec3::splat(1e-9),
            normal,
            uv: DVec2::ZERO,
            dpdu: DVec3::X,
            dpdv: DVec3::Z,
            dndu: DVec3::ZERO,
            dndv: DVec3::ZERO,
        }
    }
}

pub(crate) fn balls(
    random: &mut Random,
    count: usize,
    center: DVec3,
    extent: f64,
    floor: Option<f64>,
) -> Balls {
    let balls =
        (0..count).map(|_| (center + extent * random.vector(), extent * random.between(0.02, 0.3))).collect();
    Balls { balls, floor }
}

/// Spheres in a cloud of their own, a few of them without a radius.
pub(crate) fn cloud(
    random: &mut Random,
    count: usize,
    origin: DVec3,
    center: DVec3,
    extent: f64,
) -> SphereCloud {
    let sphere = |random: &mut Random| {
        let [x, y, z] = (center - origin + extent * random.vector()).as_vec3().to_array();
        let radius = extent * 0.3 * random.unit().powi(2);
        [x, y, z, if random.unit() < 0.03 { 0.0 } else { radius as f32 }]
    };
    SphereCloud { origin, spheres: (0..count).map(|_| sphere(random)).collect() }
}

/// An exact shape somewhere.
pub(crate) fn shape(random: &mut Random, center: DVec3, extent: f64) -> PlacedShape {
    let shape: Shape = match random.below(10) {
        0 => Sphere::new(0.2 * random.vector(), random.between(0.3, 1.3)).unwrap().into(),
        1 => Triangle::new(random.vector(), random.vector(), random.vector()).unwrap().into(),
        2 => Cuboid::new(DVec3::new(-0.7, -0.4, -0.9), DVec3::new(0.6, 0.8, 0.3)).unwrap().into(),
        3 => Cylinder::new(random.vector(), random.vector(), 0.4, random.unit() < 0.5).unwrap().into(),
        4 => Cone::new(random.vector(), random.vector(), 0.6, random.between(0.0, 0.5), true).unwrap().into(),
        5 => {
            Torus::new(0.2 * random.vector(), random.vector(), 0.9, random.between(0.1, 0.5)).unwrap().into()
        }
        6 => Disk::new(0.2 * random.vector(), random.vector(), 1.1, random.between(0.0, 0.6)).unwrap().into(),
        7 => BilinearPatch::new(random.vector(), random.vector(), random.vector(), random.vector())
            .unwrap()
            .into(),
        8 => Paraboloid::new(0.8, 0.1, 1.2, 300.0).unwrap().into(),
        _ => Sphere::new(DVec3::ZERO, 1.1).unwrap().partial(-0.6, 0.9, 250.0).unwrap().into(),
    };
    let placement = random.placement(center, extent, 0.15 * extent);
    PlacedShape::new(shape, placement)
}

/// A bit of everything around `center`, instances to `depth`.
pub(crate) fn mixture(random: &mut Random, center: DVec3, extent: f64, depth: u32, infinite: bool) -> Accel {
    let mut kinds = Vec::new();
    kinds.push(GeometryKind::Mesh(Arc::new(soup(random, 60, center, extent))));
    for _ in 0..30 {
        kinds.push(GeometryKind::Shape(shape(random, center, extent)));
    }
    kinds.push(GeometryKind::PreciseMesh(Arc::new(precise(&soup(random, 40, center, extent)))));
    let floor = infinite.then_some(center.y - 0.7 * extent);
    kinds.push(GeometryKind::Custom(Arc::new(balls(random, 10, center, extent, floor))));
    let mut ball = icosphere(1, DVec3::ZERO, 0.4 * extent);
    ball.origin = center;
    kinds.push(GeometryKind::Mesh(Arc::new(ball)));
    for origin in [center, center - 0.5 * extent] {
        kinds.push(GeometryKind::Spheres(Arc::new(cloud(random, 14, origin, center, extent))));
    }
    if infinite {
        let plane = Plane::new(center - 0.6 * extent, random.vector()).unwrap();
        kinds.push(GeometryKind::Shape(PlacedShape::new(plane.into(), Transform::IDENTITY)));
    }
    if depth > 0 {
        let inner_center = DVec3::new(3.0, -2.0, 5.0);
        let inner = Arc::new(mixture(random, inner_center, 2.0, depth - 1, infinite && depth == 1));
        for _ in 0..4 {
            let world_from_object =
                random.placement(center, extent, 0.2 * extent) * Transform::translate(-inner_center);
            kinds.push(GeometryKind::Instance(inner.instance(world_from_object)));
        }
    }
    build(kinds)
}

/// Rays of every sort around `center`: from outside, from within, along axes, with signed zeros, cut ranges, any
/// length.
pub(crate) fn ray(random: &mut Random, center: DVec3, extent: f64) -> Ray {
    let target = center + extent * random.vector();
    let origin = match random.below(4) {
        0 => center + extent * random.vector(),
        1 => center + 3.0 * extent * random.vector(),
        2 => center + 3.0 * extent * random.vector().normalize(),
        _ => center + 1e4 * extent * random.vector(),
    };
    let mut direction = match random.below(3) {
        0 => target - origin,
        1 => random.vector(),
        _ => (target - origin) * 10f64.powf(random.between(-6.0, 6.0)),
    };
    if random.unit() < 0.15 {
        let axis = random.below(3);
        direction[axis] = [0.0, -0.0, 1e-310, -5e-324][random.below(4)];
        if random.unit() < 0.3 {
            direction[(axis + 1) % 3] = -0.0;
        }
    }
    let ray = Ray::new(origin, direction);
    let reach = (target - origin).length() / direction.length();
    match random.below(6) {
        0 => ray.with_range(0.0, random.between(0.0, 2.0) * reach),
        1 => ray.with_range(f64::NEG_INFINITY, f64::INFINITY),
        2 => ray.with_range(-reach, random.between(-1.0, 1.0) * reach),
        3 => ray.with_range(random.between(0.0, 1.5) * reach, f64::INFINITY),
        _ => ray,
    }
}

/// A vertex somewhere within single precision's reach.
pub(crate) fn vertex(mesh: &TriangleMesh, index: u32) -> DVec3 {
    let position: Vec3 = mesh.positions[index as usize];
    mesh.origin + position.as_dvec3()
}
