//! Meshes put together from boxes, prisms, lathes and grids.

use lumbre_kernel::TriangleMesh;
use lumbre_math::random::RandomStream;
use lumbre_math::{DVec3, Vec3};

/// A mesh that grows.
#[derive(Default)]
pub(crate) struct Shaper {
    positions: Vec<Vec3>,
    indices: Vec<[u32; 3]>,
}

impl Shaper {
    /// What was put together.
    pub(crate) fn finish(self) -> TriangleMesh {
        TriangleMesh { origin: DVec3::ZERO, positions: self.positions, indices: self.indices }
    }

    /// Two triangles.
    pub(crate) fn quad(&mut self, corners: [DVec3; 4]) {
        let first = self.positions.len() as u32;
        self.positions.extend(corners.map(|p| p.as_vec3()));
        self.indices.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    }

    /// One triangle.
    pub(crate) fn triangle(&mut self, corners: [DVec3; 3]) {
        let first = self.positions.len() as u32;
        self.positions.extend(corners.map(|p| p.as_vec3()));
        self.indices.push([first, first + 1, first + 2]);
    }

    /// A box of twelve triangles, turned about y by `yaw` radians.
    pub(crate) fn cuboid(&mut self, center: DVec3, half: DVec3, yaw: f64) {
        let first = self.positions.len() as u32;
        let (sin, cos) = yaw.sin_cos();
        for corner in 0..8 {
            let side = |bit: u32, half: f64| if corner >> bit & 1 == 1 { half } else { -half };
            let (x, y, z) = (side(0, half.x), side(1, half.y), side(2, half.z));
            self.positions.push((center + DVec3::new(cos * x + sin * z, y, cos * z - sin * x)).as_vec3());
        }
        let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        for [a, b, c, d] in faces.map(|face| face.map(|corner| first + corner)) {
            self.indices.extend([[a, b, c], [a, c, d]]);
        }
    }

    /// `rows` by `columns` quadrilaterals over the points `at(row, column)`, `0..=rows` and `0..=columns`.
    pub(crate) fn grid(&mut self, rows: u32, columns: u32, at: impl Fn(u32, u32) -> DVec3) {
        let first = self.positions.len() as u32;
        let wide = columns + 1;
        for row in 0..=rows {
            self.positions.extend((0..=columns).map(|column| at(row, column).as_vec3()));
        }
        for row in 0..rows {
            for column in 0..columns {
                let a = first + row * wide + column;
                let (b, c, d) = (a + 1, a + wide + 1, a + wide);
                self.indices.extend([[a, d, c], [a, c, b]]);
            }
        }
    }

    /// A surface of revolution about the vertical through `center`: `profile(s)` is (radius, height), s in [0, 1].
    pub(crate) fn lathe(
        &mut self,
        center: DVec3,
        around: u32,
        along: u32,
        profile: impl Fn(f64) -> (f64, f64),
    ) {
        self.grid(along, around, |row, column| {
            let (radius, height) = profile(f64::from(row) / f64::from(along));
            // The seam closes to the bit.
            let azimuth = std::f64::consts::TAU * f64::from(column % around) / f64::from(around);
            center + DVec3::new(radius * azimuth.cos(), height, radius * azimuth.sin())
        });
    }

    /// A tube of varying radius about a curve: `curve(s)` is (middle, radius), s in [0, 1]. Its cross sections lie
    /// across the x and y of the curve's plane, so the curve should stay near a plane of constant z.
    pub(crate) fn tube(&mut self, around: u32, along: u32, curve: impl Fn(f64) -> (DVec3, f64)) {
        self.grid(along, around, |row, column| {
            let s = f64::from(row) / f64::from(along);
            let (middle, radius) = curve(s);
            let tangent = (curve(s + 1e-3).0 - curve(s - 1e-3).0).normalize();
            let across = tangent.cross(DVec3::Z).normalize();
            let azimuth = std::f64::consts::TAU * f64::from(column % around) / f64::from(around);
            middle + radius * (azimuth.cos() * across + azimuth.sin() * DVec3::Z)
        });
    }

    /// A sphere by parallels and meridians.
    pub(crate) fn ball(&mut self, center: DVec3, radius: f64, around: u32) {
        self.lathe(center, around, around / 2, |s| {
            let polar = std::f64::consts::PI * s;
            (radius * polar.sin(), -radius * polar.cos())
        });
    }
}

/// A number between two.
pub(crate) fn between(random: &mut RandomStream, low: f64, high: f64) -> f64 {
    low + (high - low) * random.next_f64()
}

/// A direction, all as likely.
pub(crate) fn direction(random: &mut RandomStream) -> DVec3 {
    let z = between(random, -1.0, 1.0);
    let azimuth = std::f64::consts::TAU * random.next_f64();
    let across = (1.0 - z * z).sqrt();
    DVec3::new(across * azimuth.cos(), across * azimuth.sin(), z)
}
