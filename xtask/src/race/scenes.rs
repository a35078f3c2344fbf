//! The scenes of the race, each drawn by a few lines.

use super::scene::{
    Camera, Hair, Material, Mesh, Object, Point, Random, Rgb, Scene, Sky, Volume, dot, normalized,
};

/// All of them.
pub(crate) fn all() -> Vec<Scene> {
    vec![
        cornell(),
        interior(),
        lights(),
        terrain(1000, 500),
        glass(),
        coats(),
        models(),
        tumbler(),
        pool(),
        cloud(),
        smoke(),
        hair(),
    ]
}

const WHITE: Material = Material::Diffuse { reflectance: [0.75, 0.75, 0.75] };

/// Scenes are put together from materials and what is made of them.
#[derive(Default)]
pub(super) struct Parts {
    materials: Vec<Material>,
    objects: Vec<Object>,
}

impl Parts {
    pub(super) fn add(&mut self, mesh: Mesh, material: Material) {
        let material = self.material(material);
        self.objects.push(Object { mesh, material, emission: None });
    }

    /// What shines is black itself, so that programs need not agree on what a lamp reflects.
    pub(super) fn add_light(&mut self, mesh: Mesh, radiance: Rgb) {
        let material = self.material(Material::Diffuse { reflectance: [0.0; 3] });
        self.objects.push(Object { mesh, material, emission: Some(radiance) });
    }

    fn material(&mut self, material: Material) -> usize {
        self.materials.iter().position(|&m| m == material).unwrap_or_else(|| {
            self.materials.push(material);
            self.materials.len() - 1
        })
    }

    pub(super) fn scene(
        self,
        name: &'static str,
        about: &'static str,
        bounces: u32,
        camera: Camera,
    ) -> Scene {
        Scene {
            name,
            about,
            bounces,
            camera,
            materials: self.materials,
            objects: self.objects,
            sky: None,
            volume: None,
            hair: None,
            has_caustics: false,
        }
    }
}

pub(super) fn diffuse(reflectance: Rgb) -> Material {
    Material::Diffuse { reflectance }
}

fn metal(reflectance: Rgb, alpha: f64) -> Material {
    Material::Metal { reflectance, alpha }
}

fn coated(reflectance: Rgb, alpha: f64) -> Material {
    Material::Coated { reflectance, eta: 1.5, alpha }
}

/// A horizontal rectangle that faces up.
pub(super) fn floor(x: [f64; 2], y: f64, z: [f64; 2]) -> Mesh {
    Mesh::quad([[x[0], y, z[1]], [x[1], y, z[1]], [x[1], y, z[0]], [x[0], y, z[0]]])
}

/// A horizontal rectangle that faces down.
pub(super) fn ceiling(x: [f64; 2], y: f64, z: [f64; 2]) -> Mesh {
    Mesh::quad([[x[0], y, z[0]], [x[1], y, z[0]], [x[1], y, z[1]], [x[0], y, z[1]]])
}

/// A rectangle that faces +z.
fn back(x: [f64; 2], y: [f64; 2], z: f64) -> Mesh {
    Mesh::quad([[x[0], y[0], z], [x[1], y[0], z], [x[1], y[1], z], [x[0], y[1], z]])
}

/// A rectangle that faces -z.
fn front(x: [f64; 2], y: [f64; 2], z: f64) -> Mesh {
    Mesh::quad([[x[1], y[0], z], [x[0], y[0], z], [x[0], y[1], z], [x[1], y[1], z]])
}

/// A rectangle that faces +x.
fn left(x: f64, y: [f64; 2], z: [f64; 2]) -> Mesh {
    Mesh::quad([[x, y[0], z[1]], [x, y[0], z[0]], [x, y[1], z[0]], [x, y[1], z[1]]])
}

/// A rectangle that faces -x.
fn right(x: f64, y: [f64; 2], z: [f64; 2]) -> Mesh {
    Mesh::quad([[x, y[0], z[0]], [x, y[0], z[1]], [x, y[1], z[1]], [x, y[1], z[0]]])
}

fn cornell() -> Scene {
    let mut parts = Parts::default();
    let side = [-1.0, 1.0];
    parts.add(floor(side, -1.0, side), WHITE);
    parts.add(ceiling(side, 1.0, side), WHITE);
    parts.add(back(side, side, -1.0), WHITE);
    parts.add(left(-1.0, side, side), diffuse([0.6, 0.06, 0.05]));
    parts.add(right(1.0, side, side), diffuse([0.12, 0.42, 0.1]));
    parts.add(Mesh::block([-0.35, -0.4, -0.3], [0.29, 0.6, 0.29], 18.0), WHITE);
    parts.add(Mesh::block([0.35, -0.7, 0.35], [0.29, 0.3, 0.29], -17.0), WHITE);
    parts.add_light(ceiling([-0.24, 0.24], 0.99, [-0.2, 0.2]), [18.0, 14.0, 8.0]);
    let camera = Camera { eye: [0.0, 0.0, 3.9], target: [0.0, 0.0, 0.0], fov: 39.3 };
    parts.scene("cornell", "The Cornell box: diffuse walls, two blocks, a lamp below the ceiling.", 7, camera)
}

fn interior() -> Scene {
    let mut parts = Parts::default();
    let (x, y, z) = ([-2.5, 2.5], [0.0, 2.6], [-3.0, 3.5]);
    parts.add(floor(x, 0.0, z), coated([0.35, 0.22, 0.12], 0.15));
    parts.add(ceiling(x, 2.6, z), WHITE);
    parts.add(back(x, y, -3.0), diffuse([0.55, 0.6, 0.65]));
    parts.add(front(x, y, 3.5), WHITE);
    parts.add(left(-2.5, y, z), diffuse([0.6, 0.5, 0.35]));
    parts.add(right(2.5, y, z), WHITE);
    // A table of lacquer, with a kettle and two cups on it.
    let lacquer = coated([0.5, 0.06, 0.05], 0.08);
    parts.add(Mesh::block([0.1, 0.72, -0.9], [1.0, 0.04, 0.55], 0.0), lacquer);
    for (dx, dz) in [(-0.9, -0.45), (0.9, -0.45), (-0.9, 0.45), (0.9, 0.45)] {
        parts.add(
            Mesh::block([0.1 + dx, 0.34, -0.9 + dz], [0.04, 0.34, 0.04], 0.0),
            metal([0.6, 0.6, 0.62], 0.25),
        );
    }
    parts.add(Mesh::ball([0.0, 1.02, -1.0], 0.26, 5), metal([0.9, 0.65, 0.4], 0.2));
    parts.add(Mesh::ball([0.55, 0.88, -0.75], 0.12, 4), coated([0.1, 0.25, 0.5], 0.1));
    parts.add(Mesh::ball([-0.5, 0.88, -0.7], 0.12, 4), diffuse([0.7, 0.68, 0.6]));
    // A locker of steel, a screen of brass and a chest.
    parts.add(Mesh::block([-1.9, 0.8, -2.2], [0.5, 0.8, 0.45], 12.0), metal([0.55, 0.56, 0.58], 0.3));
    parts.add(Mesh::block([1.9, 1.0, -2.2], [0.45, 1.0, 0.04], -35.0), metal([0.85, 0.7, 0.35], 0.25));
    parts.add(Mesh::block([1.6, 0.3, 0.2], [0.45, 0.3, 0.35], 25.0), coated([0.2, 0.4, 0.25], 0.2));
    parts.add_light(ceiling([-0.3, 0.3], 2.55, [-0.7, -0.1]), [31.0, 26.0, 19.0]);
    let camera = Camera { eye: [-0.6, 1.5, 3.2], target: [0.1, 0.95, -1.0], fov: 55.0 };
    let about = "A closed room with a small lamp: lacquer, rough metals and painted walls, so that most light has bounced.";
    parts.scene("interior", about, 12, camera)
}

fn lights() -> Scene {
    let mut parts = Parts::default();
    let mut random = Random(11);
    parts.add(floor([-55.0, 55.0], 0.0, [-55.0, 55.0]), diffuse([0.5, 0.5, 0.5]));
    let mut towers = Mesh::default();
    for _ in 0..300 {
        let place = [random.next() * 100.0 - 50.0, random.next() * 100.0 - 50.0];
        let height = 0.5 + 2.5 * random.next();
        let half = [0.4 + random.next(), height / 2.0, 0.4 + random.next()];
        towers.add(&Mesh::block([place[0], height / 2.0, place[1]], half, 90.0 * random.next()));
    }
    parts.add(towers, diffuse([0.6, 0.55, 0.5]));
    // A hundred rows of a hundred lamps that hang, in eight colours.
    let mut lamps = vec![Mesh::default(); 8];
    for i in 0..100 {
        for j in 0..100 {
            let x = f64::from(i) - 49.5 + 0.6 * (random.next() - 0.5);
            let z = f64::from(j) - 49.5 + 0.6 * (random.next() - 0.5);
            let y = 3.5 + 2.0 * random.next();
            let size = 0.03 + 0.05 * random.next();
            let colour = (random.next() * 8.0) as usize;
            lamps[colour].add(&ceiling([x - size, x + size], y, [z - size, z + size]));
        }
    }
    for (k, mesh) in lamps.into_iter().enumerate() {
        let warmth = k as f64 / 7.0;
        let power = 40.0 * 1.6_f64.powi(k as i32 % 4);
        parts.add_light(mesh, [power, power * (0.9 - 0.3 * warmth), power * (0.8 - 0.6 * warmth)]);
    }
    let camera = Camera { eye: [-8.0, 9.0, 44.0], target: [2.0, 0.0, 14.0], fov: 50.0 };
    parts.scene("lights", "A town under 10,000 small lamps of eight colours.", 3, camera)
}

/// With two triangles per cell.
pub(super) fn terrain(columns: u32, rows: u32) -> Scene {
    let mut parts = Parts::default();
    parts.add(
        Mesh::grid(columns, rows, |u, v| {
            let (x, z) = (12.0 * u - 6.0, 9.0 * v - 7.5);
            [x, height(x, z), z]
        }),
        diffuse([0.45, 0.38, 0.3]),
    );
    let camera = Camera { eye: [0.0, 2.2, 3.0], target: [0.0, 0.1, -2.0], fov: 45.0 };
    let about = "Mountains of a million triangles under a sky with a low, soft sun.";
    Scene { sky: Some(evening()), ..parts.scene("terrain", about, 5, camera) }
}

/// Waves, each half as long as the last, turned so that they do not line up.
fn height(x: f64, z: f64) -> f64 {
    let (mut x, mut z) = (x, z);
    let (mut sum, mut size) = (0.0, 0.45);
    for _ in 0..8 {
        sum += size * (1.0 - 2.0 * (x * 0.9).sin().abs()) * (z * 0.8 + 0.5 * x.cos()).cos();
        (x, z) = (1.56 * x - 1.25 * z + 1.3, 1.25 * x + 1.56 * z - 0.7);
        size *= 0.48;
    }
    sum
}

fn evening() -> Sky {
    let (width, height) = (1024, 512);
    let sun = normalized([0.75, 0.38, -0.35]);
    let mut pixels = Vec::with_capacity(width * height);
    for row in 0..height {
        let down = std::f64::consts::PI * (row as f64 + 0.5) / height as f64;
        for column in 0..width {
            let around = std::f64::consts::TAU * ((column as f64 + 0.5) / width as f64 - 0.5);
            let towards: Point = [down.sin() * around.sin(), down.cos(), -down.sin() * around.cos()];
            let up = towards[1].max(0.0);
            let below = if towards[1] < 0.0 { 0.3 } else { 1.0 };
            let glow = (40.0 * (dot(towards, sun) - 1.0)).exp();
            let disc = (2500.0 * (dot(towards, sun) - 1.0)).exp();
            let blue = [0.25 + 0.35 * (1.0 - up), 0.4 + 0.2 * (1.0 - up), 0.75 - 0.15 * (1.0 - up)];
            let glowing = [1.6, 1.0, 0.5];
            let shining = [1500.0, 1150.0, 700.0];
            pixels.push([0, 1, 2].map(|k| below * blue[k] + glow * glowing[k] + disc * shining[k]));
        }
    }
    Sky { width, height, pixels }
}

fn glass() -> Scene {
    let mut parts = Parts::default();
    let clear = Material::Glass { eta: 1.5 };
    parts.add(floor([-6.0, 6.0], 0.0, [-6.0, 6.0]), diffuse([0.6, 0.6, 0.55]));
    parts.add(back([-6.0, 6.0], [0.0, 6.0], -3.0), diffuse([0.35, 0.45, 0.6]));
    parts.add(Mesh::ball([-1.25, 0.752, -0.4], 0.75, 4), clear);
    parts.add(Mesh::ball([0.35, 0.552, 0.5], 0.55, 1), clear);
    parts.add(Mesh::block([1.35, 0.702, -0.7], [0.4, 0.7, 0.4], 33.0), clear);
    parts.add(Mesh::block([0.1, 0.252, -1.2], [0.25, 0.25, 0.25], 10.0), diffuse([0.7, 0.25, 0.15]));
    parts.add_light(ceiling([-1.4, 1.0], 4.5, [-0.8, 1.6]), [14.0, 13.0, 11.0]);
    let camera = Camera { eye: [0.0, 2.4, 5.2], target: [0.0, 0.55, 0.0], fov: 38.0 };
    parts.scene("glass", "A ball, a gem and a block of clear glass, their shadows and caustics.", 12, camera)
}

fn coats() -> Scene {
    let mut parts = Parts::default();
    parts.add(floor([-8.0, 8.0], 0.0, [-8.0, 8.0]), diffuse([0.4, 0.4, 0.42]));
    parts.add(back([-8.0, 8.0], [0.0, 8.0], -4.0), WHITE);
    let colours = [[0.6, 0.08, 0.06], [0.1, 0.35, 0.12], [0.08, 0.16, 0.5], [0.65, 0.6, 0.5]];
    let metals = [[0.95, 0.64, 0.54], [0.9, 0.75, 0.35], [0.92, 0.92, 0.9], [0.56, 0.57, 0.58]];
    for (k, alpha) in [0.05, 0.12, 0.25, 0.45].into_iter().enumerate() {
        let x = 1.3 * k as f64 - 1.95;
        parts.add(Mesh::ball([x, 0.502, 0.8], 0.5, 5), coated(colours[k], alpha));
        parts.add(Mesh::ball([x + 0.3, 0.602, -0.9], 0.6, 5), metal(metals[k], alpha));
    }
    parts.add_light(ceiling([-3.5, -1.5], 4.2, [0.0, 2.0]), [16.0, 15.0, 13.0]);
    parts.add_light(ceiling([2.0, 2.6], 3.5, [1.2, 1.8]), [40.0, 48.0, 60.0]);
    let camera = Camera { eye: [0.0, 2.3, 6.0], target: [0.0, 0.55, 0.0], fov: 40.0 };
    parts.scene("coats", "Plastics and metals of growing roughness under two lamps.", 7, camera)
}

fn principled(base: Rgb, metallic: f64, roughness: f64) -> Material {
    Material::Principled { base, metallic, roughness }
}

/// Smooth meshes of what glTF brings.
fn models() -> Scene {
    let mut parts = Parts::default();
    parts.add(floor([-8.0, 8.0], 0.0, [-8.0, 8.0]), diffuse([0.4, 0.4, 0.42]));
    let plastics = [[0.7, 0.12, 0.08], [0.1, 0.4, 0.5], [0.75, 0.6, 0.15], [0.3, 0.55, 0.15]];
    let metals = [[0.95, 0.64, 0.54], [0.9, 0.75, 0.35], [0.92, 0.92, 0.9], [0.56, 0.57, 0.58]];
    for (k, roughness) in [0.25, 0.35, 0.5, 0.7].into_iter().enumerate() {
        let (x, turned) = (1.4 * k as f64 - 2.1, 25.0 * k as f64 - 30.0);
        let front = Mesh::ring([x, 0.56, 0.9], [0.38, 0.14], turned, 5.0, 64);
        parts.add(front, principled(plastics[k], 0.0, roughness));
        let back = Mesh::ring([x + 0.4, 0.85, -0.9], [0.55, 0.25], -turned, 3.0, 64);
        parts.add(back, principled(metals[k], 1.0, roughness));
    }
    let camera = Camera { eye: [0.0, 2.0, 6.0], target: [0.0, 0.6, 0.0], fov: 40.0 };
    let about =
        "Smooth rings of plastic and metal, as glTF describes them, under a sky with a low, soft sun.";
    Scene { sky: Some(evening()), ..parts.scene("models", about, 5, camera) }
}

/// A glass with water in it, as closed boundaries between two media each: so no program needs to know which medium goes
/// before another.
fn tumbler() -> Scene {
    let mut parts = Parts::default();
    parts.add(floor([-6.0, 6.0], 0.0, [-6.0, 6.0]), diffuse([0.6, 0.58, 0.52]));
    parts.add(back([-6.0, 6.0], [0.0, 6.0], -4.0), diffuse([0.45, 0.5, 0.55]));
    let (glass, water) = (1.5, 1.33);
    // The glass from outside, over its rim, and down inside to the water.
    let wall = [[0.0, 0.02], [0.62, 0.02], [0.66, 0.06], [0.8, 1.9], [0.78, 1.92], [0.74, 1.9], [0.682, 1.2]];
    parts.add(Mesh::turned(&wall, 128), Material::Glass { eta: glass });
    // Below the water, from its edge down to the middle of the bottom: water behind glass.
    let below = [[0.682, 1.2], [0.6, 0.2], [0.57, 0.16], [0.0, 0.16]];
    parts.add(Mesh::turned(&below, 128), Material::Glass { eta: water / glass });
    let surface = [[0.682, 1.2], [0.0, 1.2]];
    parts.add(Mesh::turned(&surface, 128), Material::Glass { eta: water });
    parts.add_light(ceiling([-3.3, -2.7], 3.6, [0.7, 1.3]), [140.0, 130.0, 115.0]);
    let camera = Camera { eye: [0.6, 3.0, 5.6], target: [0.5, 0.6, 0.0], fov: 36.0 };
    let about = "A glass of water under a small lamp: all that is bright on the table came through it.";
    Scene { has_caustics: true, ..parts.scene("tumbler", about, 16, camera) }
}

/// Water in a basin, with waves.
fn pool() -> Scene {
    let mut parts = Parts::default();
    let (side, depth) = ([-2.0, 2.0], [-1.4, 0.4]);
    parts.add(floor(side, -1.4, side), diffuse([0.55, 0.7, 0.72]));
    parts.add(back(side, depth, -2.0), diffuse([0.6, 0.66, 0.7]));
    parts.add(front(side, depth, 2.0), diffuse([0.6, 0.66, 0.7]));
    parts.add(left(-2.0, depth, side), diffuse([0.7, 0.5, 0.4]));
    parts.add(right(2.0, depth, side), diffuse([0.4, 0.55, 0.7]));
    parts.add(Mesh::block([0.6, -1.1, 0.2], [0.35, 0.299, 0.35], 24.0), diffuse([0.75, 0.6, 0.2]));
    let waves = |u: f64, v: f64| {
        let (x, z) = (4.0 * u - 2.0, 4.0 * v - 2.0);
        let height = 0.03 * (5.1 * x + 1.3 * z).sin() + 0.025 * (2.2 * x - 6.3 * z + 1.0).sin();
        [x, height + 0.012 * (9.0 * z + 7.0 * x).cos(), z]
    };
    parts.add(Mesh::grid(160, 160, waves), Material::Glass { eta: 1.33 });
    parts.add_light(ceiling([-0.75, -0.45], 5.0, [3.25, 3.55]), [1100.0, 1060.0, 980.0]);
    let camera = Camera { eye: [0.0, 4.8, 2.4], target: [0.0, -0.9, 0.0], fov: 36.0 };
    let about = "A basin of water with waves under a small lamp: its floor is lit by caustics alone.";
    Scene { has_caustics: true, ..parts.scene("pool", about, 12, camera) }
}

/// A density by the place in the box, from 0 to 1 along each axis, in this many voxels.
fn voxels(cells: [usize; 3], density: impl Fn(Point) -> f64) -> Vec<f32> {
    let [nx, ny, nz] = cells;
    let place = |i: usize, n: usize| (i as f64 + 0.5) / n as f64;
    let is_side = |i: usize, n: usize| i == 0 || i + 1 == n;
    let mut all = Vec::with_capacity(nx * ny * nz);
    for z in 0..nz {
        for y in 0..ny {
            for x in 0..nx {
                let is_outermost = is_side(x, nx) || is_side(y, ny) || is_side(z, nz);
                let at = [place(x, nx), place(y, ny), place(z, nz)];
                all.push(if is_outermost { 0.0 } else { density(at).clamp(0.0, 1.0) as f32 });
            }
        }
    }
    all
}

/// Waves in three directions, each half as long as the last: from about -1 to 1.
fn ripples(at: Point, mut length: f64, octaves: u32) -> f64 {
    let (mut sum, mut size, mut at) = (0.0, 0.5, at);
    for _ in 0..octaves {
        let [x, y, z] = at.map(|c| std::f64::consts::TAU * c / length);
        sum += size * (x.sin() * y.cos() + y.sin() * z.cos() + z.sin() * x.cos()) / 1.5;
        at = [0.8 * at[0] + 0.6 * at[2] + 0.31, at[1] + 0.17, 0.8 * at[2] - 0.6 * at[0] + 0.53];
        (length, size) = (0.5 * length, 0.5 * size);
    }
    sum
}

fn cloud() -> Scene {
    let mut parts = Parts::default();
    parts.add(floor([-30.0, 30.0], -2.0, [-30.0, 30.0]), diffuse([0.25, 0.3, 0.2]));
    let density = |at: Point| {
        // Three balls, whose sides are frayed.
        let balls = [([0.35, 0.45, 0.5], 0.27), ([0.62, 0.5, 0.45], 0.3), ([0.5, 0.4, 0.62], 0.25)];
        let inside = balls.iter().map(|&(middle, radius)| {
            let away = [0, 1, 2].map(|k| at[k] - middle[k]);
            1.0 - dot(away, away).sqrt() / radius
        });
        let depth = inside.fold(f64::MIN, f64::max) + 0.45 * ripples(at, 0.4, 4);
        (6.0 * depth).clamp(0.0, 1.0)
    };
    let cells = [56, 40, 56];
    let volume = Volume {
        low: [-1.8, -0.6, -1.8],
        high: [1.8, 1.6, 1.8],
        cells,
        density: voxels(cells, density),
        extinction: 9.0,
        albedo: [0.999, 0.998, 0.996],
        g: 0.6,
    };
    let camera = Camera { eye: [0.0, 0.4, 6.0], target: [0.0, 0.4, 0.0], fov: 38.0 };
    let about = "A dense white cloud under a sky with a low, soft sun.";
    let scene = parts.scene("cloud", about, 100, camera);
    Scene { sky: Some(evening()), volume: Some(volume), ..scene }
}

fn smoke() -> Scene {
    let mut parts = Parts::default();
    parts.add(floor([-5.0, 5.0], 0.0, [-5.0, 5.0]), diffuse([0.5, 0.5, 0.5]));
    parts.add(back([-5.0, 5.0], [0.0, 6.0], -3.0), diffuse([0.45, 0.5, 0.6]));
    parts.add(Mesh::block([0.0, 0.1, 0.0], [0.3, 0.099, 0.3], 20.0), diffuse([0.3, 0.25, 0.2]));
    parts.add_light(ceiling([-2.6, -1.8], 4.0, [0.6, 1.4]), [60.0, 56.0, 50.0]);
    parts.add_light(ceiling([1.6, 2.0], 3.5, [-1.6, -1.2]), [40.0, 60.0, 90.0]);
    let density = |at: Point| {
        // A column that winds and widens upwards.
        let [x, y, z] = at;
        let middle = [0.5 + 0.12 * (7.0 * y).sin(), 0.5 + 0.1 * (5.0 * y + 1.0).cos()];
        let away = ((x - middle[0]).powi(2) + (z - middle[1]).powi(2)).sqrt();
        let width = 0.07 + 0.2 * y;
        let thin = (1.0 - away / width).max(0.0) * (1.3 - y);
        thin * (1.0 + 1.4 * ripples(at, 0.3, 4)).max(0.0)
    };
    let cells = [40, 64, 40];
    let volume = Volume {
        low: [-1.1, 0.2, -1.1],
        high: [1.1, 3.4, 1.1],
        cells,
        density: voxels(cells, density),
        extinction: 7.0,
        albedo: [0.7, 0.68, 0.65],
        g: 0.3,
    };
    let camera = Camera { eye: [0.0, 2.0, 6.5], target: [0.0, 1.6, 0.0], fov: 40.0 };
    let about = "A column of grey smoke between two lamps.";
    Scene { volume: Some(volume), ..parts.scene("smoke", about, 32, camera) }
}

fn hair() -> Scene {
    let mut parts = Parts::default();
    parts.add(floor([-8.0, 8.0], -1.2, [-8.0, 8.0]), diffuse([0.4, 0.38, 0.35]));
    parts.add(Mesh::ball([0.0, 0.0, 0.0], 0.98, 5), diffuse([0.35, 0.2, 0.15]));
    let mut random = Random(5);
    let mut strands = Vec::new();
    while strands.len() < 16_000 {
        let towards = [0, 1, 2].map(|_| 2.0 * random.next() - 1.0);
        // The face is free.
        if !(0.1..1.0).contains(&dot(towards, towards)) || towards[1] < 0.6 * towards[2] - 0.35 {
            continue;
        }
        let out = normalized(towards);
        let length = 0.8 + 0.5 * random.next();
        let wave = [random.next(), random.next(), random.next()].map(|u| std::f64::consts::TAU * u);
        let (mut at, mut way) = (out.map(|c| 0.97 * c), out);
        let mut strand = vec![];
        for step in 0..7 {
            strand.push(at);
            let curl = wave.map(|phase| 0.25 * (1.7 * f64::from(step) + phase).sin());
            way = normalized([0, 1, 2].map(|k| way[k] + curl[k] - if k == 1 { 0.33 } else { 0.0 }));
            at = [0, 1, 2].map(|k| at[k] + length / 6.0 * way[k]);
        }
        strands.push(strand);
    }
    let hair = Hair {
        strands,
        radii: [0.006, 0.003],
        sigma_a: [0.25, 0.45, 0.95],
        beta: [0.3, 0.3],
        alpha: 2.0,
        eta: 1.55,
    };
    let camera = Camera { eye: [1.4, 0.9, 4.6], target: [0.0, -0.1, 0.0], fov: 36.0 };
    let about = "A head of 16,000 blond hairs under a sky with a low, soft sun.";
    Scene { sky: Some(evening()), hair: Some(hair), ..parts.scene("hair", about, 40, camera) }
}
