//! Patterns: a number for each point, and what waves make of it.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use lumbre_math::{DVec2, DVec3, Elementary};

use super::blocks;
use super::function::Function;
use super::noise::{self, NoiseGenerator, Octaves};
use super::warp::Warps;
use super::{Eye, fractal};

/// A pattern with its place, its wave and its noise.
#[derive(Clone, Debug)]
pub struct Pattern {
    /// What it is.
    pub kind: PatternKind,
    /// How points come to it.
    pub warps: Warps,
    /// The wave that its values go through.
    pub wave: Wave,
    /// A factor on its values; 0 leaves them as they are.
    pub frequency: f64,
    /// Added to its values.
    pub phase: f64,
    /// Its noise.
    pub generator: NoiseGenerator,
    /// The octaves of its turbulence.
    pub octaves: Octaves,
    /// Its turbulence: the patterns that have it in their formula use it there, others move points by it.
    pub turbulence: DVec3,
}

impl Pattern {
    /// A pattern as its name alone makes it.
    pub fn new(kind: PatternKind, generator: NoiseGenerator) -> Self {
        let wave = match kind {
            PatternKind::Marble | PatternKind::Wood | PatternKind::Spiral1(_) | PatternKind::Spiral2(_) => {
                Wave::Triangle
            }
            _ => Wave::Ramp,
        };
        let frequency = if matches!(kind, PatternKind::Quilted { .. }) { 0.0 } else { 1.0 };
        Self {
            kind,
            warps: Warps::default(),
            wave,
            frequency,
            phase: 0.0,
            generator,
            octaves: Octaves::default(),
            turbulence: DVec3::ZERO,
        }
    }
}

/// The kinds of pattern.
#[derive(Clone, Debug)]
pub enum PatternKind {
    /// Bands of turbulence, with its amount.
    Agate(f64),
    /// Noise: bozo, spotted, bumps.
    Noise,
    /// The distance from the origin inside a cube.
    Boxed,
    /// Bricks in mortar.
    Brick {
        /// The size of a brick with its mortar.
        size: DVec3,
        /// The width of the mortar.
        mortar: f64,
    },
    /// A random number for each cube.
    Cells,
    /// Cubes of two kinds.
    Checker,
    /// Distances to random points.
    Crackle(Box<Crackle>),
    /// The face of a cube, 0 to 5.
    Cubic,
    /// The distance from the y axis.
    Cylindrical,
    /// Noise to its third power.
    Dents,
    /// A function of the point.
    Function(Arc<Function>),
    /// The distance along a unit vector.
    Gradient(DVec3),
    /// Folded noise.
    Granite,
    /// Hexagons of three kinds.
    Hexagon,
    /// The squared mean of three sines.
    Leopard,
    /// The Mandelbrot set or a Julia set.
    Fractal(Box<fractal::Fractal>),
    /// Planes across x.
    Marble,
    /// Spheres about the origin.
    Onion,
    /// The distance from the plane y = 0.
    Planar,
    /// Cushions.
    Quilted {
        /// The slope at their seams.
        control0: f64,
        /// The slope in their middle.
        control1: f64,
    },
    /// The angle about y.
    Radial,
    /// Rings from this many random sources.
    Ripples(u32),
    /// The angle between the normal and a direction.
    Slope(Box<Slope>),
    /// The angle between the normal and the eye.
    AngleOfIncidence,
    /// The distance from the origin.
    Spherical,
    /// This many arms about z.
    Spiral1(f64),
    /// Arms both ways.
    Spiral2(f64),
    /// Four squares.
    Square,
    /// Six triangles.
    Triangular,
    /// Waves of many lengths from this many random sources.
    Waves(u32),
    /// Cylinders about z.
    Wood,
    /// Noise of ten octaves.
    Wrinkles,
    /// The grey of a pigment.
    Pigment(Arc<super::Pigment>),
    /// An image.
    Image(Box<super::ImageMap>),
    /// 1 inside of an object, 0 outside.
    Inside(InsideTest),
}

/// Whether a point is inside of an object.
#[derive(Clone)]
pub struct InsideTest(pub Arc<dyn Fn(DVec3) -> bool + Send + Sync>);

impl std::fmt::Debug for InsideTest {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        out.write_str("InsideTest")
    }
}

/// What is made of the distances to random points.
#[derive(Clone, Debug, PartialEq)]
pub struct Crackle {
    /// The factors on the three least distances.
    pub form: DVec3,
    /// The exponent of the metric.
    pub metric: f64,
    /// Added to distances.
    pub offset: f64,
    /// Whether it is noise at the nearest point.
    pub is_solid: bool,
}

/// The steepness of a surface, and its height.
#[derive(Clone, Debug, PartialEq)]
pub struct Slope {
    /// The unit direction.
    pub direction: DVec3,
    /// The steepnesses that become 0 and 1.
    pub range: DVec2,
    /// The direction of height, of length 1, or 0 for none.
    pub altitude: DVec3,
    /// The heights that become 0 and 1.
    pub altitude_range: DVec2,
}

/// What a value becomes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Wave {
    /// Itself.
    Ramp,
    /// A sine.
    Sine,
    /// Up and down.
    Triangle,
    /// The absolute value of a sine.
    Scallop,
    /// A smooth step.
    Cubic,
    /// A power.
    Power(f64),
}

impl Wave {
    fn of(self, v: f64) -> f64 {
        match self {
            Self::Ramp => v,
            Self::Sine => 0.5 * (1.0 + (TAU * v).sine()),
            Self::Triangle => {
                if v < 0.5 {
                    2.0 * v
                } else {
                    2.0 - 2.0 * v
                }
            }
            Self::Scallop => (PI * v).sine().abs(),
            Self::Cubic => v * v * (3.0 - 2.0 * v),
            Self::Power(exponent) => v.power(exponent),
        }
    }
}

/// One full turn in one unit.
fn cycle(v: f64) -> f64 {
    (TAU * v).sine()
}

impl Pattern {
    /// Where in the pattern a point of its surface lies.
    pub fn point(&self, p: DVec3) -> DVec3 {
        let p = self.warps.apply(p);
        if self.turbulence == DVec3::ZERO || self.has_own_turbulence() {
            return p;
        }
        p + self.turbulence * self.octaves.vector_turbulence(p)
    }

    /// Whether turbulence is in its formula alone. Spirals and agate have it there, too, at points that it has moved.
    fn has_own_turbulence(&self) -> bool {
        matches!(self.kind, PatternKind::Marble | PatternKind::Wood)
    }

    /// Whether its values are whole numbers that name one of several.
    pub fn is_block(&self) -> bool {
        self.block_count().is_some()
    }

    /// Of how many it names one; `None` for continuous patterns.
    pub fn block_count(&self) -> Option<usize> {
        match self.kind {
            PatternKind::Checker | PatternKind::Brick { .. } | PatternKind::Inside(_) => Some(2),
            PatternKind::Hexagon => Some(3),
            PatternKind::Square => Some(4),
            PatternKind::Cubic | PatternKind::Triangular => Some(6),
            _ => None,
        }
    }

    /// Whether its values depend on the normal of a surface.
    pub(super) fn looks_at_normals(&self) -> bool {
        match &self.kind {
            PatternKind::Slope(_) | PatternKind::AngleOfIncidence => true,
            PatternKind::Pigment(pigment) => pigment.looks_at_normals(),
            _ => false,
        }
    }

    /// The value at a point of the pattern ([`Pattern::point`]), after its wave.
    pub fn value(&self, p: DVec3, eye: &Eye) -> f64 {
        let mut v = self.raw(p, eye);
        if self.is_block() {
            return v;
        }
        if self.frequency != 0.0 {
            v = (v * self.frequency + self.phase) % 1.000_01;
        }
        if v < 0.0 {
            v -= v.floor();
        }
        self.wave.of(v)
    }

    /// The value before frequency, phase and wave.
    fn raw(&self, p: DVec3, eye: &Eye) -> f64 {
        let noise = |p: DVec3| noise::noise(p, self.generator);
        let is_original = self.generator == NoiseGenerator::Original;
        match &self.kind {
            PatternKind::Agate(amount) => {
                let t = self.octaves.turbulence(p, self.generator);
                (0.5 * (cycle(1.3 * amount * t + 1.1 * p.z) + 1.0)).clamp(0.0, 1.0).power(0.77)
            }
            PatternKind::Noise => noise(p),
            PatternKind::Boxed => (1.0 - p.abs().max_element()).clamp(0.0, 1.0),
            PatternKind::Spherical => (1.0 - p.length()).clamp(0.0, 1.0),
            PatternKind::Cylindrical => (1.0 - p.x.hypotenuse(p.z)).clamp(0.0, 1.0),
            PatternKind::Planar => (1.0 - p.y.abs()).clamp(0.0, 1.0),
            PatternKind::Brick { size, mortar } => blocks::brick(p, *size, *mortar),
            PatternKind::Cells => blocks::cell(p),
            PatternKind::Checker => blocks::checker(p),
            PatternKind::Crackle(crackle) => blocks::crackle(p, crackle, self.generator),
            PatternKind::Cubic => blocks::cube_face(p),
            PatternKind::Hexagon => blocks::hexagon(p),
            PatternKind::Square => blocks::square(p),
            PatternKind::Triangular => blocks::triangular(p),
            PatternKind::Dents => noise(p).powi(3),
            PatternKind::Function(function) => within_one(function.value(&p.to_array())),
            PatternKind::Gradient(along) => within_one(p.dot(*along)),
            PatternKind::Granite => {
                let octave = |i: i32| {
                    let n = noise(p * (4.0 * f64::from(1 << i)));
                    let folded = if is_original { (0.5 - n).abs() } else { (1.0 - 2.0 * n).abs().min(0.5) };
                    folded / f64::from(1 << i)
                };
                (0..6).map(octave).sum()
            }
            PatternKind::Leopard => ((p.x.sine() + p.y.sine() + p.z.sine()) / 3.0).powi(2),
            PatternKind::Fractal(fractal) => fractal.value(p),
            PatternKind::Marble => p.x + self.own_turbulence(p),
            PatternKind::Onion => p.length() % 1.0,
            PatternKind::Quilted { control0, control1 } => quilted(p, *control0, *control1),
            PatternKind::Radial => radial(p),
            PatternKind::Ripples(count) => {
                let waves = noise::wave_sources(*count)
                    .map(|(source, _)| cycle_of(self.frequency * (p - source).length() + self.phase));
                0.5 * (1.0 + waves.sum::<f64>() / f64::from(*count))
            }
            PatternKind::Waves(count) => {
                let waves = noise::wave_sources(*count)
                    .map(|(source, f)| cycle_of(self.frequency * f * (p - source).length() + self.phase) / f);
                0.2 * (2.5 + waves.sum::<f64>() / f64::from(*count))
            }
            PatternKind::Slope(slope) => slope.value(p, eye),
            PatternKind::AngleOfIncidence => {
                (-eye.normal.dot(eye.direction)).clamp(-1.0, 1.0).arc_cosine() / PI
            }
            PatternKind::Spiral1(arms) => spiral(p, *arms, self.own_turbulence(p)).0,
            PatternKind::Spiral2(arms) => {
                let (turned, radius) = spiral(p, *arms, self.own_turbulence(p));
                let radius = triangle(radius);
                let v = triangle(turned);
                radius + v
            }
            PatternKind::Wood => {
                let (mut x, mut y) = (p.x, p.y);
                if self.turbulence != DVec3::ZERO {
                    let d = self.octaves.vector_turbulence(p);
                    x += cycle((p.x + d.x) * self.turbulence.x);
                    y += cycle((p.y + d.y) * self.turbulence.y);
                }
                x.hypotenuse(y)
            }
            PatternKind::Wrinkles => {
                let octave = |i: i32| {
                    let n = noise(p * f64::from(1 << i));
                    let n = if is_original { n } else { (2.0 * n - 0.5).clamp(0.0, 1.0) };
                    n / f64::from(1 << i)
                };
                0.5 * (0..10).map(octave).sum::<f64>()
            }
            PatternKind::Pigment(pigment) => f64::from(pigment.colour(p, eye).gray()),
            PatternKind::Image(image) => image.value(p),
            PatternKind::Inside(test) => f64::from(u8::from((test.0)(p))),
        }
    }

    /// The turbulence in the formula of a pattern.
    fn own_turbulence(&self, p: DVec3) -> f64 {
        if self.turbulence.x == 0.0 {
            return 0.0;
        }
        self.turbulence.x * self.octaves.turbulence(p, self.generator)
    }
}

/// What is above 1 begins again at 0.
fn within_one(v: f64) -> f64 {
    if v > 1.0 { v % 1.0 } else { v }
}

/// The wave of ripples.
fn cycle_of(v: f64) -> f64 {
    cycle(v)
}

/// Up and down, once a unit.
fn triangle(v: f64) -> f64 {
    let v = v - v.floor();
    if v < 0.5 { 2.0 * v } else { 2.0 - 2.0 * v }
}

fn quilted(p: DVec3, control0: f64, control1: f64) -> f64 {
    let q = p - p.floor() - DVec3::splat(0.5);
    let l = q.length();
    let s = quilt_slope(l, control0, control1);
    (q.x.abs() + q.y.abs() + q.z.abs()) * s / 3.0
}

/// The height of a quilt at a distance from the middle of a cushion.
pub(super) fn quilt_slope(l: f64, control0: f64, control1: f64) -> f64 {
    let rest = 1.0 - l;
    (l.powi(3) + 3.0 * l * rest * rest * control0 + 3.0 * l * l * rest * control1) * 1.154_700_538
}

fn radial(p: DVec3) -> f64 {
    if p.x.abs() < 1e-3 && p.z.abs() < 1e-3 {
        return 0.25;
    }
    0.25 + (p.x.angle_from(p.z) + PI) / TAU
}

/// The pattern of spirals, with the distance from the axis.
fn spiral(p: DVec3, arms: f64, turbulence: f64) -> (f64, f64) {
    let radius = p.x.hypotenuse(p.y);
    let angle = if radius == 0.0 {
        0.5 * PI
    } else {
        let lift = (p.y / radius).clamp(-1.0, 1.0).arc_sine();
        if p.x < 0.0 { 1.5 * PI - lift } else { 0.5 * PI + lift }
    };
    (p.z + radius + arms * angle / TAU + turbulence, radius)
}

impl Slope {
    fn value(&self, p: DVec3, eye: &Eye) -> f64 {
        let within = |v: f64, range: DVec2| {
            let width = range.y - range.x;
            if width == 0.0 { v } else { ((v - range.x) / width).clamp(0.0, 1.0) }
        };
        let steep = 0.5 + eye.normal.dot(self.direction).clamp(-1.0, 1.0).arc_sine() / PI;
        let steep = within(steep, self.range);
        if self.altitude == DVec3::ZERO {
            return steep;
        }
        0.5 * (steep + within(p.dot(self.altitude), self.altitude_range))
    }
}
