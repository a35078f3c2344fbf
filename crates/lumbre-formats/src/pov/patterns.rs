//! The words of patterns, with what modifies them.

use std::rc::Rc;

use lumbre_math::{DVec2, DVec3};
use lumbre_shading::pov::{
    BlackHole, Crackle, Fractal, Magnet, NoiseGenerator, Octaves, Pattern, PatternKind, Slope, Unrolling,
    Warp, Warps, Wave,
};

use super::{Parser, Result};

/// A pattern that is being written, with what moves it.
pub(super) struct Draft {
    pub pattern: Option<Pattern>,
    pub warps: Warps,
    pub uv: bool,
    /// The octaves that stand before the pattern.
    pub octaves: Octaves,
    /// Whether the first of the warps is the turbulence of what has no pattern of its own.
    has_turbulence: bool,
    /// The word that the pattern began with.
    pub word: Rc<str>,
}

impl Draft {
    pub(super) fn new(pattern: Option<Pattern>, warps: Warps, uv: bool) -> Self {
        let octaves = pattern.as_ref().map_or_else(Octaves::default, |pattern| pattern.octaves);
        Self { pattern, warps, uv, octaves, has_turbulence: false, word: Rc::from("") }
    }

    /// Begins a pattern, with the octaves that stood before it.
    pub(super) fn begin(&mut self, kind: PatternKind, generator: NoiseGenerator) {
        let octaves = self.octaves;
        self.pattern = Some(Pattern { octaves, ..Pattern::new(kind, generator) });
    }
}

impl Parser<'_, '_> {
    /// The pattern of a word, which comes next, with its parameters.
    pub(super) fn pattern_kind(&mut self, word: &str) -> Result<Option<PatternKind>> {
        let kind = match word {
            "agate" => PatternKind::Agate(1.0),
            "bozo" | "spotted" | "bumps" => PatternKind::Noise,
            "boxed" => PatternKind::Boxed,
            "brick" => PatternKind::Brick { size: DVec3::new(8.0, 3.0, 4.5), mortar: 0.5 },
            "cells" => PatternKind::Cells,
            "checker" => PatternKind::Checker,
            "crackle" => PatternKind::Crackle(Box::new(Crackle {
                form: DVec3::new(-1.0, 1.0, 0.0),
                metric: 2.0,
                offset: 0.0,
                is_solid: false,
            })),
            "cubic" => PatternKind::Cubic,
            "cylindrical" => PatternKind::Cylindrical,
            "dents" => PatternKind::Dents,
            "granite" => PatternKind::Granite,
            "hexagon" => PatternKind::Hexagon,
            "leopard" => PatternKind::Leopard,
            "marble" => PatternKind::Marble,
            "onion" => PatternKind::Onion,
            "planar" => PatternKind::Planar,
            "quilted" => PatternKind::Quilted { control0: 1.0, control1: 1.0 },
            "radial" => PatternKind::Radial,
            "ripples" => PatternKind::Ripples(self.settings.number_of_waves),
            "waves" => PatternKind::Waves(self.settings.number_of_waves),
            "spherical" => PatternKind::Spherical,
            "square" => PatternKind::Square,
            "triangular" => PatternKind::Triangular,
            "wood" => PatternKind::Wood,
            "wrinkles" => PatternKind::Wrinkles,
            "aoi" => PatternKind::AngleOfIncidence,
            "gradient" | "spiral1" | "spiral2" | "mandel" | "julia" | "magnet" | "function" | "slope"
            | "pigment_pattern" | "image_pattern" => {
                self.peeked = None;
                return self.pattern_with_parameters(word).map(Some);
            }
            _ => return Ok(None),
        };
        self.peeked = None;
        Ok(Some(kind))
    }

    fn pattern_with_parameters(&mut self, word: &str) -> Result<PatternKind> {
        Ok(match word {
            "gradient" => match self.vector()?.try_normalize() {
                Some(along) => PatternKind::Gradient(along),
                None => return Err(self.error("a gradient along a vector of length 0")),
            },
            "spiral1" => PatternKind::Spiral1(self.float()?),
            "spiral2" => PatternKind::Spiral2(self.float()?),
            "mandel" | "julia" | "magnet" => {
                let magnet = match word {
                    "magnet" if self.whole(1.0, 2.0)? == 1 => Some(Magnet::First),
                    "magnet" => Some(Magnet::Second),
                    _ => None,
                };
                let has_point = word == "julia"
                    || magnet.is_some() && {
                        let is_mandel = self.take_word("mandel")?;
                        !is_mandel && self.take_word("julia")?
                    };
                let julia = if has_point {
                    let c = self.vector()?.truncate();
                    self.comma()?;
                    Some(c)
                } else {
                    None
                };
                let iterations = self.whole(1.0, 10_000.0)?;
                PatternKind::Fractal(Box::new(Fractal {
                    magnet,
                    julia,
                    exponent: 2,
                    iterations,
                    exterior: (1, 1.0),
                    interior: (0, 1.0),
                }))
            }
            "function" => {
                let function = self.function_block(&["x", "y", "z"])?;
                PatternKind::Function(function)
            }
            "slope" => PatternKind::Slope(Box::new(self.slope()?)),
            "pigment_pattern" => {
                self.expect(b'{')?;
                PatternKind::Pigment(self.pigment_body(None, b'}')?)
            }
            _ => {
                self.expect(b'{')?;
                PatternKind::Image(Box::new(self.image_body()?))
            }
        })
    }

    fn slope(&mut self) -> Result<Slope> {
        let has_braces = self.take(b'{')?;
        let direction = self.vector()?.normalize_or(DVec3::Y);
        let mut slope =
            Slope { direction, range: DVec2::ZERO, altitude: DVec3::ZERO, altitude_range: DVec2::ZERO };
        if has_braces {
            if self.take(b',')? {
                let low = self.float()?;
                self.comma()?;
                slope.range = DVec2::new(low, self.float()?);
            }
            if self.take_word("altitude")? {
                slope.altitude = self.vector()?.normalize_or_zero();
                if self.take(b',')? {
                    let low = self.float()?;
                    self.comma()?;
                    slope.altitude_range = DVec2::new(low, self.float()?);
                }
            }
            self.expect(b'}')?;
        } else if self.take_word("altitude")? {
            slope.altitude = self.vector()?.normalize_or_zero();
        }
        Ok(slope)
    }

    /// Takes a modifier of patterns, if a word of one comes next.
    pub(super) fn pattern_modifier(&mut self, word: &str, draft: &mut Draft) -> Result<bool> {
        if let Some(map) = self.transform()? {
            draft.warps.transform(&map);
            return Ok(true);
        }
        match word {
            "warp" => {
                self.peeked = None;
                let warp = self.warp()?;
                draft.warps.0.extend(warp);
                return Ok(true);
            }
            "uv_mapping" => {
                self.peeked = None;
                draft.uv = self.optional_bool()?;
                return Ok(true);
            }
            "turbulence" | "octaves" | "omega" | "lambda" => {
                self.peeked = None;
                match word {
                    "turbulence" => {
                        let amount = self.vector()?;
                        match &mut draft.pattern {
                            Some(pattern) => pattern.turbulence = amount,
                            // Of what has no pattern of its own, such as an average or an image: a warp that acts
                            // first.
                            None => {
                                let octaves = draft.octaves;
                                draft.warps.0.insert(0, Warp::Turbulence { amount, octaves });
                                draft.has_turbulence = true;
                            }
                        }
                    }
                    "octaves" => draft.octaves.octaves = self.whole(1.0, 10.0)?,
                    // In single precision, as POV-Ray keeps them.
                    "omega" => draft.octaves.omega = f64::from(self.finite()? as f32),
                    _ => draft.octaves.lambda = f64::from(self.finite()? as f32),
                }
                if let Some(pattern) = &mut draft.pattern {
                    pattern.octaves = draft.octaves;
                } else if draft.has_turbulence
                    && let Some(Warp::Turbulence { octaves, .. }) = draft.warps.0.first_mut()
                {
                    *octaves = draft.octaves;
                }
                return Ok(true);
            }
            _ => {}
        }
        let Some(pattern) = &mut draft.pattern else { return Ok(false) };
        let wave = match word {
            "ramp_wave" => Wave::Ramp,
            "sine_wave" => Wave::Sine,
            "triangle_wave" => Wave::Triangle,
            "scallop_wave" => Wave::Scallop,
            "cubic_wave" => Wave::Cubic,
            "poly_wave" => Wave::Power(1.0),
            _ => return self.pattern_parameter(word, pattern),
        };
        self.peeked = None;
        pattern.wave = wave;
        if word == "poly_wave" {
            pattern.wave = Wave::Power(self.float()?);
        }
        Ok(true)
    }

    fn pattern_parameter(&mut self, word: &str, pattern: &mut Pattern) -> Result<bool> {
        match (word, &mut pattern.kind) {
            ("frequency", _) => {
                self.peeked = None;
                pattern.frequency = self.finite()?;
            }
            ("phase", _) => {
                self.peeked = None;
                pattern.phase = self.finite()?;
            }
            ("noise_generator", _) => {
                self.peeked = None;
                pattern.generator = generator(self.float()?);
            }
            ("agate_turb", PatternKind::Agate(amount)) => {
                self.peeked = None;
                *amount = self.finite()?;
            }
            ("brick_size", PatternKind::Brick { size, .. }) => {
                self.peeked = None;
                *size = self.vector()?;
            }
            ("mortar", PatternKind::Brick { mortar, .. }) => {
                self.peeked = None;
                *mortar = self.finite()?;
            }
            ("form", PatternKind::Crackle(crackle)) => {
                self.peeked = None;
                crackle.form = self.vector()?;
            }
            ("metric", PatternKind::Crackle(crackle)) => {
                self.peeked = None;
                crackle.metric = self.finite()?;
            }
            ("offset", PatternKind::Crackle(crackle)) => {
                self.peeked = None;
                crackle.offset = self.finite()?;
            }
            ("solid", PatternKind::Crackle(crackle)) => {
                self.peeked = None;
                crackle.is_solid = true;
            }
            ("control0", PatternKind::Quilted { control0, .. }) => {
                self.peeked = None;
                *control0 = self.finite()?;
            }
            ("control1", PatternKind::Quilted { control1, .. }) => {
                self.peeked = None;
                *control1 = self.finite()?;
            }
            ("exponent", PatternKind::Fractal(fractal)) => {
                self.peeked = None;
                fractal.exponent = self.whole(2.0, 33.0)?;
            }
            ("exterior" | "interior", PatternKind::Fractal(fractal)) => {
                self.peeked = None;
                let kind = self.whole(0.0, 8.0)?;
                self.comma()?;
                let factor = self.finite()?;
                let target = if word == "exterior" { &mut fractal.exterior } else { &mut fractal.interior };
                *target = (kind, factor);
            }
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// A truth that may be left out.
    pub(super) fn optional_bool(&mut self) -> Result<bool> {
        Ok(self.ends_here()? || !self.is_number()? || self.float()? != 0.0)
    }

    fn warp(&mut self) -> Result<Vec<Warp>> {
        self.expect(b'{')?;
        let Some(word) = self.word()? else { return Err(self.unexpected("a warp")) };
        self.peeked = None;
        let warp = match &*word {
            "repeat" => {
                let along = self.vector()?;
                let axis = (0..3).find(|&i| along[i] != 0.0);
                let Some(axis) = axis else { return Err(self.error("a repeat along a vector of length 0")) };
                let (mut offset, mut flip) = (DVec3::ZERO, [false; 3]);
                loop {
                    if self.take_word("offset")? {
                        offset = self.vector()?;
                    } else if self.take_word("flip")? {
                        let v = self.vector()?;
                        flip = v.to_array().map(|x| x != 0.0);
                    } else {
                        break;
                    }
                }
                Warp::Repeat { axis, width: along[axis], offset, flip }
            }
            "turbulence" => {
                let amount = self.vector()?;
                let octaves = self.octaves()?;
                Warp::Turbulence { amount, octaves }
            }
            "black_hole" => Warp::BlackHole(Box::new(self.black_hole()?)),
            "planar" => {
                let (mut normal, mut distance) = (DVec3::Z, 0.0);
                if !self.is_mark(b'}')? {
                    normal = self.vector()?.normalize_or(DVec3::Z);
                    if self.take(b',')? {
                        distance = self.finite()?;
                    }
                }
                Warp::Planar { normal, distance }
            }
            "cylindrical" | "spherical" | "toroidal" => {
                let (mut orientation, mut exponent, mut major) = (DVec3::Z, 0.0, 1.0);
                loop {
                    if self.take_word("orientation")? {
                        orientation = self.vector()?.normalize_or(DVec3::Z);
                    } else if self.take_word("dist_exp")? {
                        exponent = self.finite()?;
                    } else if self.take_word("major_radius")? {
                        major = self.finite()?;
                    } else {
                        break;
                    }
                }
                let shape = match &*word {
                    "cylindrical" => Unrolling::Cylinder,
                    "spherical" => Unrolling::Sphere,
                    _ => Unrolling::Torus(major),
                };
                Warp::Unrolled { shape, orientation, exponent }
            }
            "cubic" => Warp::Cubic,
            _ => {
                // Transforms may stand in a warp, too.
                self.peeked = None;
                return Err(self.error("a warp that is not known"));
            }
        };
        self.expect(b'}')?;
        Ok(vec![warp])
    }

    fn octaves(&mut self) -> Result<Octaves> {
        let mut octaves = Octaves::default();
        loop {
            if self.take_word("octaves")? {
                octaves.octaves = self.whole(1.0, 10.0)?;
            } else if self.take_word("omega")? {
                octaves.omega = f64::from(self.finite()? as f32);
            } else if self.take_word("lambda")? {
                octaves.lambda = f64::from(self.finite()? as f32);
            } else {
                return Ok(octaves);
            }
        }
    }

    fn black_hole(&mut self) -> Result<BlackHole> {
        let center = self.vector()?;
        self.comma()?;
        let radius = self.finite()?;
        let mut hole = BlackHole {
            center,
            radius,
            falloff: 2.0,
            strength: 1.0,
            repeat: DVec3::ZERO,
            turbulence: DVec3::ZERO,
            inverse: false,
        };
        loop {
            if self.take_word("falloff")? {
                hole.falloff = self.finite()?;
            } else if self.take_word("strength")? {
                hole.strength = self.finite()?;
            } else if self.take_word("repeat")? {
                hole.repeat = self.vector()?;
            } else if self.take_word("turbulence")? {
                hole.turbulence = self.vector()?;
            } else if self.take_word("inverse")? {
                hole.inverse = true;
            } else {
                break;
            }
        }
        hole.repeat = hole.repeat.max(DVec3::ZERO);
        for axis in 0..3 {
            // Copies lie in their blocks as a whole.
            if hole.repeat[axis] > 0.0 {
                hole.center[axis] = hole.center[axis].max(radius);
                let needed = hole.center[axis] + radius + hole.turbulence[axis];
                hole.repeat[axis] = hole.repeat[axis].max(needed);
            }
        }
        Ok(hole)
    }

    /// A pattern with its modifiers, as `function { pattern { … } }` has it.
    pub(super) fn pattern_block(&mut self) -> Result<Pattern> {
        self.expect(b'{')?;
        let mut draft = Draft::new(None, Warps::default(), false);
        while !self.take(b'}')? {
            let Some(word) = self.word()? else { return Err(self.unexpected("a pattern")) };
            if draft.pattern.is_none()
                && let Some(kind) = self.pattern_kind(&word)?
            {
                draft.pattern = Some(Pattern::new(kind, self.settings.generator));
                continue;
            }
            if !self.pattern_modifier(&word, &mut draft)? {
                return Err(self.unexpected("a pattern or what modifies it"));
            }
        }
        let Some(mut pattern) = draft.pattern else { return Err(self.error("a pattern is missing")) };
        pattern.warps = draft.warps;
        Ok(pattern)
    }
}

/// The noise of a number.
pub(super) fn generator(number: f64) -> NoiseGenerator {
    match number as i64 {
        1 => NoiseGenerator::Original,
        3 => NoiseGenerator::Perlin,
        _ => NoiseGenerator::Corrected,
    }
}
