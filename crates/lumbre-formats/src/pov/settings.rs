//! `global_settings`, the version, and what is around the objects: background, sky and fog.

use std::rc::Rc;
use std::sync::Arc;

use lumbre_math::{DVec3, Elementary};
use lumbre_scene::pov::{PovFog, PovRadiosity};
use lumbre_shading::Spectrum;
use lumbre_shading::pov::{NoiseGenerator, Octaves, Pigment};

use super::patterns::generator;
use super::value::Value;
use super::{Parser, Result};

/// What holds for the whole scene.
#[derive(Clone, Debug)]
pub(super) struct Settings {
    pub version: f64,
    pub has_version: bool,
    pub assumed_gamma: Option<f64>,
    pub is_srgb: bool,
    pub ambient_light: Spectrum,
    pub max_trace_level: u32,
    pub adc_bailout: f32,
    pub number_of_waves: u32,
    pub generator: NoiseGenerator,
    pub has_generator: bool,
    pub irid_wavelength: Spectrum,
    pub radiosity: Option<PovRadiosity>,
}

pub(super) type Fog = PovFog;
/// The pigments of a sky, the first at the bottom.
pub(super) type SkySphere = Vec<Arc<Pigment>>;

impl Settings {
    pub(super) fn new() -> Self {
        Self {
            version: 3.62,
            has_version: false,
            assumed_gamma: None,
            is_srgb: false,
            ambient_light: Spectrum::WHITE,
            max_trace_level: 5,
            adc_bailout: 1.0 / 255.0,
            number_of_waves: 10,
            generator: NoiseGenerator::Corrected,
            has_generator: false,
            irid_wavelength: Spectrum::new(0.70, 0.52, 0.48),
            radiosity: None,
        }
    }

    pub(super) fn set_version(&mut self, version: f64) {
        // Versions were written as hundreds once.
        self.version = if version >= 100.0 { version / 100.0 } else { version };
        self.has_version = true;
        if !self.has_generator {
            self.generator =
                if self.version < 3.5 { NoiseGenerator::Original } else { NoiseGenerator::Corrected };
        }
    }

    /// The exponent from the working space to linear light.
    pub(super) fn gamma(&self) -> f64 {
        // Without one, versions before 3.7 write values as they are: as if they were those of a screen.
        self.assumed_gamma.unwrap_or(if self.version < 3.7 { 2.2 } else { 1.0 })
    }

    /// Linear light in the working space.
    #[expect(clippy::wrong_self_convention, reason = "from linear numbers or sRGB, by the settings")]
    pub(super) fn from_linear(&self, c: Spectrum) -> Spectrum {
        let gamma = self.gamma();
        if gamma == 1.0 { c } else { c.map(|c| c.max(0.0).power((1.0 / gamma) as f32)) }
    }

    /// A colour of sRGB in the working space.
    #[expect(clippy::wrong_self_convention, reason = "from linear numbers or sRGB, by the settings")]
    pub(super) fn from_srgb(&self, v: [f64; 5]) -> [f64; 5] {
        let gamma = self.gamma();
        let decode = |c: f64| {
            let linear = if c <= 0.040_45 { c / 12.92 } else { ((c + 0.055) / 1.055).power(2.4) };
            if gamma == 1.0 { linear } else { linear.max(0.0).power(1.0 / gamma) }
        };
        [decode(v[0]), decode(v[1]), decode(v[2]), v[3], v[4]]
    }
}

impl Parser<'_, '_> {
    /// `global_settings { … }`, whose word was taken.
    pub(super) fn global_settings(&mut self) -> Result<()> {
        self.expect(b'{')?;
        while !self.take(b'}')? {
            let Some(word) = self.word()? else { return Err(self.unexpected("a setting")) };
            self.peeked = None;
            match &*word {
                "assumed_gamma" => {
                    if self.take_word("srgb")? {
                        self.settings.assumed_gamma = Some(2.2);
                        self.settings.is_srgb = true;
                    } else {
                        self.settings.assumed_gamma = Some(self.finite()?.clamp(0.01, 100.0));
                    }
                }
                "ambient_light" => self.settings.ambient_light = self.rgb()?,
                "max_trace_level" => self.settings.max_trace_level = self.whole(1.0, 256.0)?,
                "adc_bailout" => self.settings.adc_bailout = self.finite()? as f32,
                "number_of_waves" => self.settings.number_of_waves = self.whole(1.0, 256.0)?,
                "noise_generator" => {
                    self.settings.generator = generator(self.float()?);
                    self.settings.has_generator = true;
                }
                "irid_wavelength" => self.settings.irid_wavelength = self.rgb()?,
                "max_intersections" | "mm_per_unit" => {
                    self.float()?;
                }
                "hf_gray_16" => {
                    self.optional_bool()?;
                }
                "charset" => {
                    self.next()?;
                }
                "radiosity" => self.settings.radiosity = Some(self.radiosity_block()?),
                "photons" | "subsurface" => {
                    if &*word != "subsurface" || self.is_mark(b'{')? {
                        self.expect(b'{')?;
                        self.skip_to(b'}')?;
                    }
                    let instead = match &*word {
                        "photons" => ": --integrator caustics has light that glass and mirrors gather",
                        _ => "",
                    };
                    self.warn(&format!("{word} is not rendered by the integrator pov{instead}"));
                }
                _ => return Err(self.error(format!("{word} is no setting"))),
            }
        }
        Ok(())
    }

    /// Radiosity in braces: what says how light is gathered; how POV-Ray keeps and reuses it is passed over.
    fn radiosity_block(&mut self) -> Result<PovRadiosity> {
        let mut radiosity =
            PovRadiosity { count: 35, bounces: 2, brightness: 1.0, grayness: 0.0, has_ambient: false };
        self.expect(b'{')?;
        while !self.take(b'}')? {
            if self.take(b',')? {
                continue;
            }
            let Some(word) = self.word()? else { return Err(self.unexpected("a setting of radiosity")) };
            self.peeked = None;
            match &*word {
                "count" => radiosity.count = self.whole(1.0, 1e6)?,
                "recursion_limit" => radiosity.bounces = self.whole(1.0, 20.0)?,
                "brightness" => radiosity.brightness = self.finite()? as f32,
                "gray_threshold" => radiosity.grayness = self.finite()?.clamp(0.0, 1.0) as f32,
                "normal" | "media" | "always_sample" | "subsurface" => {
                    self.optional_bool()?;
                }
                "load_file" | "save_file" => {
                    self.next()?;
                }
                "adc_bailout" | "distance_maximum" | "error_bound" | "low_error_factor" | "max_sample"
                | "maximum_reuse" | "minimum_reuse" | "nearest_count" | "pretrace_end" | "pretrace_start" => {
                    self.float()?;
                }
                _ => return Err(self.error(format!("{word} is no setting of radiosity"))),
            }
            // Further numbers of the same setting.
            while self.take(b',')? {
                self.float()?;
            }
        }
        Ok(radiosity)
    }

    /// A fog in braces.
    pub(super) fn fog_block(&mut self) -> Result<Fog> {
        self.expect(b'{')?;
        let mut fog = PovFog {
            distance: 0.0,
            rgb: Spectrum::BLACK,
            filter: 0.0,
            transmit: 0.0,
            ground: None,
            up: DVec3::Y,
            turbulence: None,
            octaves: (Octaves::default(), self.settings.generator),
        };
        let (mut turbulence, mut turbulent_depth) = (DVec3::ZERO, 0.5);
        let (mut is_ground, mut offset, mut altitude) = (false, 0.0, 0.0);
        while !self.take(b'}')? {
            if self.take(b',')? {
                continue;
            }
            if self.is_colour()? {
                let colour = self.colour()?.as_colour();
                (fog.rgb, fog.filter, fog.transmit) = (colour.rgb, colour.filter, colour.transmit);
                continue;
            }
            if self.transform()?.is_some() {
                continue;
            }
            let Some(word) = self.word()? else { return Err(self.unexpected("what a fog has")) };
            self.peeked = None;
            match &*word {
                "fog_type" => is_ground = self.float()? == 2.0,
                "distance" => fog.distance = self.finite()?,
                "fog_offset" => offset = self.finite()?,
                "fog_alt" => altitude = self.finite()?,
                "up" => fog.up = self.vector()?.normalize_or(DVec3::Y),
                "turbulence" => turbulence = self.vector()?,
                "turb_depth" => turbulent_depth = self.finite()?,
                "octaves" => fog.octaves.0.octaves = self.whole(1.0, 10.0)?,
                // In single precision, as POV-Ray keeps them.
                "omega" => fog.octaves.0.omega = f64::from(self.finite()? as f32),
                "lambda" => fog.octaves.0.lambda = f64::from(self.finite()? as f32),
                _ => match self.known(&word)? {
                    Some(Value::Fog(known)) => {
                        fog = (*known).clone();
                        if let Some((amount, scale)) = fog.turbulence {
                            (turbulent_depth, turbulence) = (amount, scale);
                        }
                        if let Some([o, a]) = fog.ground {
                            (is_ground, offset, altitude) = (true, o, a);
                        }
                    }
                    _ => return Err(self.error(format!("{word} has no meaning for a fog"))),
                },
            }
        }
        fog.ground = is_ground.then_some([offset, altitude]);
        fog.turbulence = (turbulence != DVec3::ZERO).then_some((turbulent_depth, turbulence));
        Ok(fog)
    }

    /// A sky sphere in braces.
    pub(super) fn sky_sphere_block(&mut self) -> Result<SkySphere> {
        self.expect(b'{')?;
        let mut sky: SkySphere = Vec::new();
        while !self.take(b'}')? {
            if let Some(map) = self.transform()? {
                for pigment in &mut sky {
                    let mut moved = (**pigment).clone();
                    moved.warps.transform(&map);
                    *pigment = Arc::new(moved);
                }
                continue;
            }
            let Some(word) = self.word()? else { return Err(self.unexpected("the pigment of a sky")) };
            self.peeked = None;
            match &*word {
                "pigment" => {
                    self.expect(b'{')?;
                    sky.push(self.pigment_body(None, b'}')?);
                }
                "emission" => {
                    self.rgb()?;
                }
                _ => match self.known(&word)? {
                    Some(Value::SkySphere(known)) => sky = (*known).clone(),
                    _ => return Err(self.error(format!("{word} has no meaning for a sky"))),
                },
            }
        }
        Ok(sky)
    }
}

/// A fog for values.
pub(super) fn shared(fog: Fog) -> Value {
    Value::Fog(Rc::new(fog))
}
