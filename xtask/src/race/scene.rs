//! A scene as plain data, which is written for every program from here.

/// A colour, linear RGB of the sRGB primaries.
pub(crate) type Rgb = [f64; 3];

/// A point or a direction; y is up.
pub(crate) type Point = [f64; 3];

/// What is seen, and how.
#[derive(Debug)]
pub(crate) struct Scene {
    /// A word; files are named after it.
    pub(crate) name: &'static str,
    /// What is in it, in a sentence.
    pub(crate) about: &'static str,
    /// The most bounces of a path: surfaces between the camera and the light.
    pub(crate) bounces: u32,
    pub(crate) camera: Camera,
    pub(crate) materials: Vec<Material>,
    pub(crate) objects: Vec<Object>,
    pub(crate) sky: Option<Sky>,
    pub(crate) volume: Option<Volume>,
    pub(crate) hair: Option<Hair>,
    /// Whether most of what is interesting is light that comes through glass from a small lamp: programs that have an
    /// integrator for it use it.
    pub(crate) has_caustics: bool,
}

/// A pinhole camera of a square picture.
#[derive(Debug)]
pub(crate) struct Camera {
    pub(crate) eye: Point,
    pub(crate) target: Point,
    /// The field of view in degrees, along either side.
    pub(crate) fov: f64,
}

/// Materials that all programs have, some more exactly than others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Material {
    /// Lambert's.
    Diffuse { reflectance: Rgb },
    /// A rough conductor (GGX of width `alpha`) that reflects `reflectance` of the light that falls on it straight.
    Metal { reflectance: Rgb, alpha: f64 },
    /// A diffuse base under a rough dielectric boundary.
    Coated { reflectance: Rgb, eta: f64, alpha: f64 },
    /// A smooth dielectric.
    Glass { eta: f64 },
    /// The base colour, metalness and roughness of glTF: a metal, or a diffuse base under facets of index 1.5.
    Principled { base: Rgb, metallic: f64, roughness: f64 },
}

/// A mesh of one material, which may shine.
#[derive(Debug)]
pub(crate) struct Object {
    pub(crate) mesh: Mesh,
    /// The place of its material in the scene's list.
    pub(crate) material: usize,
    /// The radiance that leaves its outer side.
    pub(crate) emission: Option<Rgb>,
}

/// Triangles, counterclockwise from outside.
#[derive(Clone, Debug, Default)]
pub(crate) struct Mesh {
    pub(crate) points: Vec<[f32; 3]>,
    pub(crate) faces: Vec<[u32; 3]>,
    /// A normal for each point; none for flat triangles.
    pub(crate) normals: Vec<[f32; 3]>,
}

/// Light from all around.
#[derive(Debug)]
pub(crate) struct Sky {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Row by row from the zenith down; the middle of a row lies towards -z, and +x is a quarter to its right.
    pub(crate) pixels: Vec<Rgb>,
}

/// A medium in a box, whose density is a grid.
#[derive(Debug)]
pub(crate) struct Volume {
    /// The corners of the box.
    pub(crate) low: Point,
    pub(crate) high: Point,
    /// Voxels along x, y and z.
    pub(crate) cells: [usize; 3],
    /// In their middles, x fastest, then y; 0 at the sides, so that programs need not agree on what is between the
    /// outermost voxels and the box.
    pub(crate) density: Vec<f32>,
    /// Extinction per length where the density is 1.
    pub(crate) extinction: f64,
    /// How much of it scatters.
    pub(crate) albedo: Rgb,
    /// The mean cosine of Henyey's and Greenstein's phase function.
    pub(crate) g: f64,
}

/// Uniform cubic B-splines with circular cross sections, and the hair of M. Chiang and others, "A Practical and
/// Controllable Hair and Fur Model for Production Path Tracing", 2016.
#[derive(Debug)]
pub(crate) struct Hair {
    /// The control points of each strand, four or more, as many for all.
    pub(crate) strands: Vec<Vec<Point>>,
    /// The radius at the first control point and at the last; linear between them.
    pub(crate) radii: [f64; 2],
    /// Absorption per diameter of a hair.
    pub(crate) sigma_a: Rgb,
    /// Roughness along and around.
    pub(crate) beta: [f64; 2],
    /// The angle of the scales in degrees.
    pub(crate) alpha: f64,
    pub(crate) eta: f64,
}

impl Hair {
    /// The radius at a place from the first control point to the last, 0 to 1.
    pub(crate) fn radius(&self, share: f64) -> f64 {
        self.radii[0] + (self.radii[1] - self.radii[0]) * share
    }

    /// The widths at both ends of the curve of a strand, which begins at its second control point and ends at the last
    /// but one.
    pub(crate) fn widths(&self) -> [f64; 2] {
        let steps = (self.strands[0].len() - 1) as f64;
        [2.0 * self.radius(1.0 / steps), 2.0 * self.radius(1.0 - 1.0 / steps)]
    }
}

impl Volume {
    /// The box, facing outwards.
    pub(crate) fn hull(&self) -> Mesh {
        let middle = [0, 1, 2].map(|k| f64::midpoint(self.low[k], self.high[k]));
        let half = [0, 1, 2].map(|k| 0.5 * (self.high[k] - self.low[k]));
        Mesh::block(middle, half, 0.0)
    }
}

impl Mesh {
    /// A parallelogram or any other flat quadrilateral.
    pub(crate) fn quad(corners: [Point; 4]) -> Self {
        Self { points: corners.map(single).to_vec(), faces: vec![[0, 1, 2], [0, 2, 3]], ..Self::default() }
    }

    /// A box turned about the upright axis through its centre.
    pub(crate) fn block(centre: Point, half: [f64; 3], degrees: f64) -> Self {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let corner = |i: usize| {
            let side = |axis: usize| if i >> axis & 1 == 1 { half[axis] } else { -half[axis] };
            let (x, y, z) = (side(0), side(1), side(2));
            single([centre[0] + cos * x + sin * z, centre[1] + y, centre[2] - sin * x + cos * z])
        };
        let sides = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        Self {
            points: (0..8).map(corner).collect(),
            faces: sides.iter().flat_map(|s| [[s[0], s[1], s[2]], [s[0], s[2], s[3]]]).collect(),
            ..Self::default()
        }
    }

    /// An icosahedron whose faces are cut in four `level` times: 20 * 4^level triangles on a sphere.
    pub(crate) fn ball(centre: Point, radius: f64, level: u32) -> Self {
        let golden = f64::midpoint(1.0, 5.0_f64.sqrt());
        let mut directions: Vec<Point> = Vec::new();
        for (a, b) in [(-1.0, golden), (1.0, golden), (-1.0, -golden), (1.0, -golden)] {
            directions.extend([[a, b, 0.0], [0.0, a, b], [b, 0.0, a]]);
        }
        // Any three corners at the least distance are a face.
        let near = |a: Point, b: Point| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>() < 4.1;
        let mut triangles: Vec<[Point; 3]> = Vec::new();
        for i in 0..12 {
            for j in i + 1..12 {
                for k in j + 1..12 {
                    let [a, b, c] = [directions[i], directions[j], directions[k]];
                    if near(a, b) && near(b, c) && near(c, a) {
                        let outwards = dot(cross(minus(b, a), minus(c, a)), a) > 0.0;
                        triangles.push(if outwards { [a, b, c] } else { [a, c, b] }.map(normalized));
                    }
                }
            }
        }
        for _ in 0..level {
            let middle = |a: Point, b: Point| normalized([a[0] + b[0], a[1] + b[1], a[2] + b[2]]);
            triangles = triangles
                .iter()
                .flat_map(|&[a, b, c]| {
                    let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                    [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
                })
                .collect();
        }
        let mut mesh = Self::default();
        for triangle in triangles {
            let first = mesh.points.len() as u32;
            mesh.points.extend(triangle.map(|d| single(along(centre, radius, d))));
            mesh.faces.push([first, first + 1, first + 2]);
        }
        mesh
    }

    /// A grid over [0,1]² that `place` bends: 2 * columns * rows triangles. Their outer side is that of ∂v × ∂u.
    pub(crate) fn grid(columns: u32, rows: u32, place: impl Fn(f64, f64) -> Point) -> Self {
        let mut mesh = Self::default();
        for j in 0..=rows {
            for i in 0..=columns {
                mesh.points
                    .push(single(place(f64::from(i) / f64::from(columns), f64::from(j) / f64::from(rows))));
            }
        }
        for j in 0..rows {
            for i in 0..columns {
                let a = j * (columns + 1) + i;
                let (b, c, d) = (a + 1, a + columns + 1, a + columns + 2);
                mesh.faces.extend([[a, c, b], [b, c, d]]);
            }
        }
        mesh
    }

    /// A ring in an upright plane that is turned by `degrees`, knotted by waves, with the normals of the smooth
    /// surface: 4 * cells² triangles.
    pub(crate) fn ring(centre: Point, radii: [f64; 2], degrees: f64, waves: f64, cells: u32) -> Self {
        use std::f64::consts::TAU;
        let (sin, cos) = degrees.to_radians().sin_cos();
        let place = |u: f64, v: f64| {
            let ([a, b], around, across) = ([TAU * u, TAU * v], radii[0], radii[1]);
            let across = across * (1.0 + 0.2 * (waves * a).sin());
            let out = around + across * b.cos();
            let (x, y, z) = (out * a.cos(), out * a.sin(), -across * b.sin());
            [centre[0] + cos * x + sin * z, centre[1] + y, centre[2] - sin * x + cos * z]
        };
        let (columns, rows) = (2 * cells, cells);
        let mut mesh = Self::grid(columns, rows, place);
        for j in 0..=rows {
            for i in 0..=columns {
                let (u, v) = (f64::from(i) / f64::from(columns), f64::from(j) / f64::from(rows));
                let by_u = minus(place(u + 1e-4, v), place(u - 1e-4, v));
                let by_v = minus(place(u, v + 1e-4), place(u, v - 1e-4));
                mesh.normals.push(single(normalized(cross(by_v, by_u))));
            }
        }
        mesh
    }

    /// A line of points (distance from the y axis, height) turned about that axis: 2 * cells triangles for each of its
    /// segments, half of that where one ends on the axis. Their outer side is to the right of the line.
    pub(crate) fn turned(line: &[[f64; 2]], cells: u32) -> Self {
        let mut mesh = Self::default();
        for &[radius, height] in line {
            for i in 0..cells {
                let (sin, cos) = (std::f64::consts::TAU * f64::from(i) / f64::from(cells)).sin_cos();
                mesh.points.push(single([radius * cos, height, -radius * sin]));
            }
        }
        for (j, ends) in (0..).zip(line.windows(2)) {
            for i in 0..cells {
                let (a, b) = (j * cells + i, j * cells + (i + 1) % cells);
                let (c, d) = (a + cells, b + cells);
                mesh.faces.extend((ends[0][0] > 0.0).then_some([a, b, c]));
                mesh.faces.extend((ends[1][0] > 0.0).then_some([b, d, c]));
            }
        }
        mesh
    }

    /// Adds the triangles of another mesh; both have normals, or none has.
    pub(crate) fn add(&mut self, other: &Self) {
        let first = self.points.len() as u32;
        self.points.extend(&other.points);
        self.normals.extend(&other.normals);
        self.faces.extend(other.faces.iter().map(|face| face.map(|i| i + first)));
    }
}

/// Random numbers by Steele, Lea and Flood, "Fast splittable pseudorandom number generators", OOPSLA 2014.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    /// Uniform in [0, 1).
    pub(crate) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((bits ^ (bits >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}

pub(crate) fn normalized(v: Point) -> Point {
    let length = dot(v, v).sqrt();
    v.map(|x| x / length)
}

pub(crate) fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: Point, b: Point) -> Point {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn minus(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn along(from: Point, distance: f64, direction: Point) -> Point {
    [0, 1, 2].map(|k| from[k] + distance * direction[k])
}

fn single(p: Point) -> [f32; 3] {
    p.map(|x| x as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Six times the volume that a closed mesh encloses: positive where its faces are counterclockwise from outside.
    fn six_volumes(mesh: &Mesh) -> f64 {
        let corner = |i: u32| mesh.points[i as usize].map(f64::from);
        mesh.faces.iter().map(|&[a, b, c]| dot(corner(a), cross(corner(b), corner(c)))).sum()
    }

    #[test]
    fn a_ring_has_its_volume_and_normals_that_face_outwards() {
        let ring = Mesh::ring([3.0, -2.0, 5.0], [2.5, 0.7], 30.0, 0.0, 64);
        let volume = six_volumes(&ring) / 6.0;
        let torus = 2.0 * std::f64::consts::PI.powi(2) * 2.5 * 0.7_f64.powi(2);
        assert!((volume / torus - 1.0).abs() < 0.01, "{volume} {torus}");
        assert_eq!(ring.normals.len(), ring.points.len());
        let corner = |i: u32| ring.points[i as usize].map(f64::from);
        for &[a, b, c] in &ring.faces {
            let face = normalized(cross(minus(corner(b), corner(a)), minus(corner(c), corner(a))));
            let normal = ring.normals[a as usize].map(f64::from);
            assert!(dot(face, normal) > 0.98, "{face:?} {normal:?}");
        }
    }

    #[test]
    fn a_turned_line_has_its_volume_and_faces_outwards() {
        let cone = Mesh::turned(&[[0.0, 0.0], [2.0, 0.0], [1.0, 3.0], [0.0, 3.0]], 256);
        let volume = std::f64::consts::PI * 3.0 * (4.0 + 2.0 + 1.0) / 3.0;
        assert_eq!(cone.faces.len(), 256 * 4);
        assert!(
            (six_volumes(&cone) / 6.0 / volume - 1.0).abs() < 1e-3,
            "{} {volume}",
            six_volumes(&cone) / 6.0
        );
    }

    #[test]
    fn a_block_and_a_ball_have_their_volume_and_face_outwards() {
        let block = Mesh::block([3.0, -2.0, 5.0], [0.5, 1.5, 2.5], 30.0);
        assert!((six_volumes(&block) / 6.0 - 15.0).abs() < 1e-4, "{}", six_volumes(&block) / 6.0);
        let ball = Mesh::ball([3.0, -2.0, 5.0], 2.5, 4);
        assert_eq!(ball.faces.len(), 20 << 8);
        let sphere = 4.0 / 3.0 * std::f64::consts::PI * 2.5_f64.powi(3);
        let volume = six_volumes(&ball) / 6.0;
        assert!(0.99 * sphere < volume && volume < sphere, "{volume} of {sphere}");
    }
}
