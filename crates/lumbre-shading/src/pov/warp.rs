//! Warps: how the points of a texture are moved before its pattern is looked at.

use std::sync::Arc;

use lumbre_math::{DVec2, DVec3, Elementary, Transform};

use super::noise::{Octaves, hash3, random};

/// The way of a point from the surface to the pattern, the last written first.
#[derive(Clone, Debug, Default)]
pub struct Warps(pub Vec<Warp>);

/// One step of that way.
#[derive(Clone, Debug)]
pub enum Warp {
    /// The pattern was moved: the point goes the other way.
    Transform(Arc<Transform>),
    /// Noise moves the point.
    Turbulence {
        /// By how much in each direction.
        amount: DVec3,
        /// The octaves of the noise.
        octaves: Octaves,
    },
    /// The space between two planes is repeated along an axis.
    Repeat {
        /// 0, 1 or 2.
        axis: usize,
        /// The width of a copy, of either sign.
        width: f64,
        /// What each further copy is moved by.
        offset: DVec3,
        /// Which axes are mirrored in every second copy.
        flip: [bool; 3],
    },
    /// Points near a centre are drawn to it, or pushed away.
    BlackHole(Box<BlackHole>),
    /// Space is unrolled from around something.
    Unrolled {
        /// What it was around.
        shape: Unrolling,
        /// The unit vector to which the depth goes.
        orientation: DVec3,
        /// The exponent of the distance, by which the unrolled space grows outwards.
        exponent: f64,
    },
    /// x and y at a distance.
    Planar {
        /// The unit vector to which the distance goes.
        normal: DVec3,
        /// The distance.
        distance: f64,
    },
    /// The faces of a cube.
    Cubic,
}

/// What space is unrolled from around.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unrolling {
    /// The y axis.
    Cylinder,
    /// The origin.
    Sphere,
    /// A ring about the y axis of this radius.
    Torus(f64),
}

/// A place that draws points to itself.
#[derive(Clone, Debug)]
pub struct BlackHole {
    /// Its centre.
    pub center: DVec3,
    /// How far it reaches.
    pub radius: f64,
    /// The exponent of its pull.
    pub falloff: f64,
    /// Its pull.
    pub strength: f64,
    /// The distances of its copies; zero along an axis for none.
    pub repeat: DVec3,
    /// By how much copies are moved at most, at random.
    pub turbulence: DVec3,
    /// Whether it pushes.
    pub inverse: bool,
}

impl Warps {
    /// The point of the pattern for a point of the surface.
    pub fn apply(&self, p: DVec3) -> DVec3 {
        self.0.iter().rev().fold(p, |p, warp| warp.apply(p))
    }

    /// A normal, or a direction from the light's point of view, in the space of the pattern, and back: by the
    /// transforms alone.
    pub fn normal_to_pattern(&self, n: DVec3) -> DVec3 {
        self.0.iter().rev().fold(n, |n, warp| match warp {
            Warp::Transform(map) => map.inverse_normal(n),
            _ => n,
        })
    }

    /// The other way.
    pub fn normal_from_pattern(&self, n: DVec3) -> DVec3 {
        self.0.iter().fold(n, |n, warp| match warp {
            Warp::Transform(map) => map.normal(n),
            _ => n,
        })
    }

    /// Moves the pattern.
    pub fn transform(&mut self, map: &Arc<Transform>) {
        self.0.push(Warp::Transform(Arc::clone(map)));
    }
}

impl Warp {
    fn apply(&self, p: DVec3) -> DVec3 {
        match self {
            Self::Transform(map) => map.inverse_point(p),
            Self::Turbulence { amount, octaves } => p + *amount * octaves.vector_turbulence(p),
            Self::Repeat { axis, width, offset, flip } => repeated(p, *axis, *width, *offset, flip),
            Self::BlackHole(hole) => hole.apply(p),
            Self::Unrolled { shape, orientation, exponent } => unrolled(p, *shape, *orientation, *exponent),
            Self::Planar { normal, distance } => oriented(DVec3::new(p.x, p.y, *distance), *normal),
            Self::Cubic => cubic(p),
        }
    }
}

fn repeated(mut p: DVec3, axis: usize, width: f64, offset: DVec3, flip: &[bool; 3]) -> DVec3 {
    let block = (p[axis] / width).floor();
    p[axis] -= block * width;
    if block.rem_euclid(2.0) == 1.0 {
        for (i, &flips) in flip.iter().enumerate() {
            if flips {
                p[i] = -p[i];
                if i == axis {
                    p[i] += width;
                }
            }
        }
    }
    p + offset * block
}

impl BlackHole {
    fn apply(&self, p: DVec3) -> DVec3 {
        let mut center = self.center;
        let mut local = p;
        if self.repeat != DVec3::ZERO {
            let mut cell = DVec3::ZERO;
            for axis in 0..3 {
                if self.repeat[axis] > 0.0 {
                    cell[axis] = (p[axis] / self.repeat[axis]).floor();
                    local[axis] -= cell[axis] * self.repeat[axis];
                }
            }
            if self.turbulence != DVec3::ZERO {
                let seed = hash3(cell.x as i64, cell.y as i64, cell.z as i64);
                center += self.turbulence * DVec3::new(random(seed), random(seed + 1), random(seed + 2));
            }
        }
        let away = local - center;
        let distance = away.length();
        if distance >= self.radius {
            return p;
        }
        let pull = ((self.radius - distance) / self.radius).power(self.falloff) * self.strength;
        let moved = away * pull.min(1.0);
        if self.inverse { p - moved } else { p + moved }
    }
}

/// The angle from +x through +z, in [0, 1).
fn turn(x: f64, z: f64) -> f64 {
    let angle = z.angle_from(x) / std::f64::consts::TAU;
    if angle < 0.0 { angle + 1.0 } else { angle }
}

fn unrolled(p: DVec3, shape: Unrolling, orientation: DVec3, exponent: f64) -> DVec3 {
    let grow = |length: f64| if exponent == 0.0 { 1.0 } else { length.power(exponent) };
    let across = p.x.hypotenuse(p.z);
    let (u, v, depth) = match shape {
        Unrolling::Cylinder => (turn(p.x, p.z) * grow(across), p.y, across),
        Unrolling::Sphere => {
            let length = p.length();
            let latitude = if length > 0.0 { (p.y / length).clamp(-1.0, 1.0).arc_sine() } else { 0.0 };
            let (u, v) = (turn(p.x, p.z), 0.5 + latitude / std::f64::consts::PI);
            (u * grow(length), v * grow(length), length)
        }
        Unrolling::Torus(major) => {
            let from_ring = across - major;
            let length = from_ring.hypotenuse(p.y);
            let cosine = if length > 0.0 { (-from_ring / length).clamp(-1.0, 1.0) } else { 1.0 };
            let v = cosine.arc_cosine() / std::f64::consts::TAU;
            let v = if p.y > 0.0 { 1.0 - v } else { v };
            (turn(p.x, p.z) * grow(length), v * grow(length), length)
        }
    };
    oriented(DVec3::new(u, v, depth), orientation)
}

/// A point whose z is along the z axis, for a z along another one. Axes that are askew are mixed of the three.
fn oriented(DVec3 { x: u, y: v, z: depth }: DVec3, axis: DVec3) -> DVec3 {
    axis.x * DVec3::new(depth, v, -u) + axis.y * DVec3::new(u, -depth, v) + axis.z * DVec3::new(u, v, depth)
}

fn cubic(p: DVec3) -> DVec3 {
    let size = p.abs();
    let depth = size.max_element();
    if depth == 0.0 {
        return DVec3::ZERO;
    }
    unfolded(0.5 + 0.5 * p / depth).extend(depth)
}

/// The unfolded faces of the unit cube.
pub(super) fn unfolded(p: DVec3) -> DVec2 {
    let DVec3 { x, y, z } = p;
    let faces = [x.abs(), (1.0 - x).abs(), y.abs(), (1.0 - y).abs(), z.abs(), (1.0 - z).abs()];
    let nearest = (0..6).min_by(|&a, &b| faces[a].total_cmp(&faces[b])).unwrap_or(0);
    let [u, v] = match nearest {
        0 => [z / 4.0, (1.0 + y) / 3.0],
        1 => [0.75 - z / 4.0, (1.0 + y) / 3.0],
        2 => [(1.0 + x) / 4.0, z / 3.0],
        3 => [(1.0 + x) / 4.0, 1.0 - z / 3.0],
        4 => [1.0 - x / 4.0, (1.0 + y) / 3.0],
        _ => [(1.0 + x) / 4.0, (1.0 + y) / 3.0],
    };
    DVec2::new(u, v)
}
