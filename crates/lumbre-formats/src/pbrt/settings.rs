//! Camera, film, filter, sampler, integrator and options.

use std::path::Path;
use std::sync::Arc;

use lumbre_image::ColourSpace;
use lumbre_math::{DMat3, Transform, Vec2};
use lumbre_scene::{
    Buckets, Camera, CameraKind, FilmKind, FilmSpace, FilterDesc, IntegratorDesc, IntegratorKind, MediumId,
    SamplerDesc, SamplerKind, SphericalMapping,
};
use lumbre_shading::ShadingNormals;
use lumbre_shading::spectrum::SensorCurves;

use super::convert::Converter;
use super::lexer::{parse_number, whole};
use super::params::{Params, Type};
use super::source::{Result, SourcePosition};
use super::{colour, sensors};
use crate::Diagnostic;
use crate::diagnostic::{number, quoted};
use crate::image::ImageFormat;

/// The types of cameras.
pub(super) const CAMERAS: [&str; 4] = ["perspective", "orthographic", "spherical", "realistic"];

/// The types of films.
pub(super) const FILMS: [&str; 3] = ["rgb", "gbuffer", "spectral"];

/// The names of options.
pub(super) const OPTIONS: [&str; 11] = [
    "seed",
    "wavefront",
    "rendercoordsys",
    "displacementedgescale",
    "pixelstats",
    "msereferenceimage",
    "msereferenceout",
    "disablepixeljitter",
    "disabletexturefiltering",
    "disablewavelengthjitter",
    "forcediffuse",
];

/// The types of samplers.
pub(super) const SAMPLERS: [&str; 7] =
    ["zsobol", "paddedsobol", "sobol", "halton", "pmj02bn", "independent", "stratified"];

/// The types of pixel filters.
pub(super) const FILTERS: [&str; 5] = ["gaussian", "box", "mitchell", "sinc", "triangle"];

/// The types of acceleration structures.
pub(super) const ACCELERATORS: [&str; 2] = ["bvh", "kdtree"];

/// The types of integrators.
pub(super) const INTEGRATORS: [&str; 16] = [
    "path",
    "caustics",
    "volpath",
    "simplepath",
    "simplevolpath",
    "whitted",
    "ambientocclusion",
    "normals",
    "depth",
    "albedo",
    "uv",
    "bdpt",
    "mlt",
    "sppm",
    "lightpath",
    "randomwalk",
];

impl Converter<'_, '_> {
    pub fn camera(
        &mut self,
        ty: &str,
        params: Params,
        world_from_camera: &[Transform; 2],
        medium: Option<MediumId>,
    ) -> Result<()> {
        let spot = params.spot;
        let shutter_open = params.float("shutteropen", 0.0)?;
        let shutter_close = params.float("shutterclose", 1.0)?;
        if shutter_close <= shutter_open {
            let wrong = Diagnostic::error("the shutter closes before it opens").found(number(shutter_close));
            let at = params.spot_of("shutterclose");
            return Err(at.wrong(
                wrong.expected(format!("shutterclose after shutteropen = {}", number(shutter_open))),
            ));
        }
        self.lens = None;
        self.exposure.shutter = shutter_close - shutter_open;
        let frame_aspect = params.float_opt("frameaspectratio")?;
        if let Some(aspect) = frame_aspect.filter(|a| *a <= 0.0) {
            return params.out_of_range("frameaspectratio", aspect, "more than 0");
        }
        let screen_window = match params.typed("screenwindow", &[Type::Float])? {
            None => None,
            Some(param) => {
                let window = param.exactly::<4>()?;
                if window[0] == window[1] || window[2] == window[3] {
                    return Err(param.refuse("xmin, xmax, ymin, ymax of a window with an area"));
                }
                Some(window)
            }
        };
        let lens_radius = params.float_at_least_zero("lensradius", 0.0)?;
        let focal_distance = params.float_above("focaldistance", 1e6, 0.0)?;
        let perspective = |fov| CameraKind::Perspective { fov, lens_radius, focal_distance };
        let kind = match ty {
            "perspective" => {
                let half = params.float_opt("halffov")?;
                let fov = params.float("fov", half.map_or(90.0, |half| 2.0 * half))?;
                if half.is_some() {
                    self.upgraded(params.spot_of("halffov"));
                }
                if !(0.0 < fov && fov < 180.0) {
                    return params.out_of_range("fov", fov, "more than 0 and less than 180 degrees");
                }
                perspective(fov)
            }
            "orthographic" => CameraKind::Orthographic { lens_radius, focal_distance },
            "spherical" => {
                let mappings = [
                    ("equalarea", SphericalMapping::EqualArea),
                    ("equirectangular", SphericalMapping::Equirectangular),
                ];
                CameraKind::Spherical {
                    mapping: params.choice("mapping", &mappings, SphericalMapping::EqualArea)?,
                }
            }
            "environment" => {
                self.upgraded(spot);
                CameraKind::Spherical { mapping: SphericalMapping::Equirectangular }
            }
            "realistic" => {
                self.lens = Some(self.lens(&params)?);
                perspective(90.0)
            }
            _ => {
                params.ignore_all();
                self.unknown(spot, "camera", ty, &CAMERAS, "a perspective one takes its place");
                perspective(90.0)
            }
        };
        self.done(&params);
        let motion = self.motion(spot, world_from_camera, "camera")?;
        self.scene.cameras = vec![Camera {
            name: None,
            kind,
            world_from_camera: motion.as_ref().map_or(world_from_camera[0], |motion| motion.at(shutter_open)),
            motion,
            frame_aspect,
            screen_window,
            shutter_open,
            shutter_close,
            medium,
            clip: None,
        }];
        Ok(())
    }

    pub fn film(&mut self, ty: &str, params: Params, space: ColourSpace) -> Result<()> {
        let spot = params.spot;
        let kind = match ty {
            "rgb" => FilmKind::Rgb,
            "image" => {
                self.upgraded(spot);
                FilmKind::Rgb
            }
            "spectral" => FilmKind::Spectral(buckets(&params)?),
            "gbuffer" => {
                let spaces = [("camera", FilmSpace::Camera), ("world", FilmSpace::World)];
                FilmKind::GBuffer(params.choice("coordinatesystem", &spaces, FilmSpace::Camera)?)
            }
            _ => {
                self.unknown(spot, "film", ty, &FILMS, "an rgb one takes its place");
                FilmKind::Rgb
            }
        };
        let width = params.count("xresolution", 1280, 1)?;
        let height = params.count("yresolution", 720, 1)?;
        let pixel_bounds = match params.integers("pixelbounds")? {
            None => None,
            Some(&[x0, x1, y0, y1]) => {
                let clip = |v: i32, size: u32| u32::try_from(v).unwrap_or(0).min(size);
                let clipped = [clip(x0, width), clip(x1, width), clip(y0, height), clip(y1, height)];
                if clipped[0] >= clipped[1] || clipped[2] >= clipped[3] {
                    let wrong = Diagnostic::error("pixelbounds hold no pixel of the film");
                    let wrong = wrong.found(format!("{x0} {x1} {y0} {y1}"));
                    let expected = format!("x0 x1 y0 y1 within 0 {width} 0 {height}");
                    return Err(params.spot_of("pixelbounds").wrong(wrong.expected(expected)));
                }
                Some(clipped)
            }
            Some(other) => {
                let wrong = Diagnostic::error("wrong value for parameter \"pixelbounds\"");
                let wrong = wrong.found(format!("{} integers", other.len())).expected("4 integers");
                return Err(params.spot_of("pixelbounds").wrong(wrong));
            }
        };
        let crop_window = match params.typed("cropwindow", &[Type::Float])? {
            None => None,
            Some(param) => {
                let [x0, x1, y0, y1] = param.exactly::<4>()?.map(|v| v.clamp(0.0, 1.0));
                // pbrt accepts either order.
                let window = [x0.min(x1), x0.max(x1), y0.min(y1), y0.max(y1)];
                if window[0] == window[1] || window[2] == window[3] {
                    return Err(param.refuse("x0 x1 y0 y1 in [0, 1] of a window with an area"));
                }
                Some(window)
            }
        };
        self.exposure.iso = params.float_above("iso", 100.0, 0.0)?;
        // pbrt-v3: a factor on the image, and the largest luminance of a sample.
        self.exposure.scale = params.float_above("scale", 1.0, 0.0)?;
        params.ignore(&["maxsampleluminance"]);
        for old in ["scale", "maxsampleluminance"] {
            if params.has(old) {
                self.upgraded(params.spot_of(old));
            }
        }
        let (sensor, camera) = self.sensor(&params)?;
        let max_component = params.float_or_infinite("maxcomponentvalue", f64::INFINITY)?;
        if max_component <= 0.0 {
            return params.out_of_range("maxcomponentvalue", max_component, "more than 0");
        }
        self.film_diagonal = params.float_above("diagonal", 35.0, 0.0)?;
        let single_precision = !params.boolean("savefp16", true)?;
        if space != ColourSpace::REC709 {
            self.note(spot, "the film is in the colour space of sRGB: the picture has the colours of the scene, in other numbers");
        }
        let filename = params.string("filename")?.map(str::to_owned);
        if let (Some(name), true) = (&filename, kind != FilmKind::Rgb)
            && ImageFormat::from_path(Path::new(name)) != Some(ImageFormat::Exr)
        {
            let wrong = Diagnostic::error(format!("the channels of film {} need an EXR file", quoted(ty)));
            let wrong = wrong.found(quoted(name)).expected("a name that ends in .exr");
            return Err(params.spot_of("filename").wrong(wrong));
        }
        self.done(&params);
        let film = &mut self.scene.film;
        film.kind = kind;
        film.filename = filename;
        (film.width, film.height) = (Some(width), Some(height));
        (film.pixel_bounds, film.crop_window) = (pixel_bounds, crop_window);
        film.max_component = max_component as f32;
        film.sensor = sensor;
        film.camera = camera.map(Arc::new);
        film.spectral |= matches!(kind, FilmKind::Spectral(_));
        film.single_precision = single_precision;
        Ok(())
    }

    /// What the sensor of a film makes of colours, and of wavelengths where it is a camera's.
    fn sensor(&mut self, params: &Params) -> Result<([[f32; 3]; 3], Option<SensorCurves>)> {
        const CIE1931: &str = "cie1931";
        let name = params.string("sensor")?.unwrap_or(CIE1931).to_owned();
        let kelvin = params.float_at_least_zero("whitebalance", 0.0)?;
        let balanced = (kelvin > 0.0).then_some(kelvin);
        let mut camera = None;
        let matrix = if name == CIE1931 {
            match balanced {
                None => Some(DMat3::IDENTITY),
                Some(kelvin) => colour::balanced(kelvin),
            }
        } else {
            const DEFAULT_KELVIN: f64 = 6500.0;
            let Some(matrix) = sensors::matrix(&name, balanced.unwrap_or(DEFAULT_KELVIN)) else {
                let wrong = Diagnostic::error(format!("unknown sensor {}", quoted(&name)));
                let known = sensors::names().chain([CIE1931]);
                return Err(params.spot_of("sensor").wrong(wrong.suggest(&name, known)));
            };
            camera = sensors::spectral(&name, balanced.unwrap_or(DEFAULT_KELVIN));
            Some(matrix)
        };
        let Some(matrix) = matrix else {
            return params.out_of_range(
                "whitebalance",
                kelvin,
                "0, or a temperature at which bodies glow, in kelvin",
            );
        };
        Ok((matrix.transpose().to_cols_array_2d().map(|row| row.map(|v| v as f32)), camera))
    }

    pub fn sampler(&mut self, ty: &str, params: Params) -> Result<()> {
        let spot = params.spot;
        let kind = match ty {
            "independent" => SamplerKind::Independent,
            "random" => {
                self.upgraded(spot);
                SamplerKind::Independent
            }
            "02sequence" | "lowdiscrepancy" | "maxmindist" => {
                self.upgraded(spot);
                SamplerKind::Sobol
            }
            _ if SAMPLERS.contains(&ty) => SamplerKind::Sobol,
            _ => {
                self.unknown(spot, "sampler", ty, &SAMPLERS, "zsobol takes its place");
                SamplerKind::Sobol
            }
        };
        let spp = if ty == "stratified" {
            let (x, y) = (params.count("xsamples", 4, 1)?, params.count("ysamples", 4, 1)?);
            params.ignore(&["dimensions"]);
            x.saturating_mul(y)
        } else {
            params.count("pixelsamples", if kind == SamplerKind::Independent { 4 } else { 16 }, 1)?
        };
        if let Some(how) = params.string("randomization")? {
            let choices = ["fastowen", "owen", "permutedigits", "none"];
            if !choices.contains(&how) {
                let wrong = Diagnostic::error("wrong value for parameter \"randomization\"");
                let wrong = wrong.found(quoted(how)).suggest(how, choices).expected(choices.join(", "));
                return Err(params.spot_of("randomization").wrong(wrong));
            }
            if how == "none" {
                let message = "samples are always randomised: randomization \"none\" is left out";
                self.note(params.spot_of("randomization"), message);
            }
        }
        if !params.boolean("jitter", true)? {
            self.note(params.spot_of("jitter"), "samples are always randomised: jitter false is left out");
        }
        let seed = params.integer("seed", 0)?;
        self.done(&params);
        // The bits of the number, so that -1 is a valid seed.
        self.scene.sampler = SamplerDesc { kind, spp: Some(spp), seed: u64::from(seed as u32) };
        Ok(())
    }

    pub fn filter(&mut self, ty: &str, params: Params) -> Result<()> {
        let spot = params.spot;
        let radius = |default: f64| -> Result<Vec2> {
            let x = params.float_above("xradius", params_v3(&params, "xwidth", default)?, 0.0)?;
            let y = params.float_above("yradius", params_v3(&params, "ywidth", default)?, 0.0)?;
            Ok(Vec2::new(x as f32, y as f32))
        };
        let filter = match ty {
            "gaussian" => {
                // pbrt-v3 has exp(-alpha x²).
                let sigma = match params.float_opt("alpha")? {
                    Some(alpha) if alpha > 0.0 => (0.5 / alpha).sqrt(),
                    Some(alpha) => return params.out_of_range("alpha", alpha, "more than 0"),
                    None => 0.5,
                };
                let sigma = params.float_above("sigma", sigma, 0.0)?;
                FilterDesc::Gaussian { radius: radius(1.5)?, sigma: sigma as f32 }
            }
            "box" => FilterDesc::Box { radius: radius(0.5)? },
            "mitchell" => {
                let (b, c) = (params.float("B", 1.0 / 3.0)?, params.float("C", 1.0 / 3.0)?);
                FilterDesc::Mitchell { radius: radius(2.0)?, b: b as f32, c: c as f32 }
            }
            "sinc" => {
                let tau = params.float_above("tau", 3.0, 0.0)?;
                FilterDesc::Sinc { radius: radius(4.0)?, tau: tau as f32 }
            }
            "triangle" => FilterDesc::Triangle { radius: radius(2.0)? },
            _ => {
                params.ignore_all();
                self.unknown(spot, "filter", ty, &FILTERS, "gaussian takes its place");
                FilterDesc::default()
            }
        };
        for old in ["alpha", "xwidth", "ywidth"] {
            if params.has(old) {
                self.upgraded(params.spot_of(old));
            }
        }
        self.scene.filter = filter;
        Ok(())
    }

    pub fn integrator(&mut self, ty: &str, params: Params) -> Result<()> {
        let spot = params.spot;
        let path = |params: &Params| -> Result<IntegratorKind> {
            Ok(IntegratorKind::Path { regularize: params.boolean("regularize", false)? })
        };
        // Ours: pbrt-v4 is always so.
        let carries_wavelengths = matches!(
            ty,
            "path"
                | "volpath"
                | "simplepath"
                | "simplevolpath"
                | "randomwalk"
                | "caustics"
                | "bdpt"
                | "mlt"
                | "sppm"
                | "lightpath"
        );
        if carries_wavelengths && params.boolean("spectral", false)? {
            self.scene.film.spectral = true;
        }
        let kind = match ty {
            "path" | "volpath" | "simplepath" | "simplevolpath" => path(&params)?,
            "whitted" => {
                let light_samples = params.count("lightsamples", 1, 1)?;
                IntegratorKind::Whitted { light_samples, sky: params.boolean("sky", false)? }
            }
            "directlighting" => {
                self.upgraded(spot);
                IntegratorKind::Whitted { light_samples: 1, sky: true }
            }
            "ambientocclusion" => {
                let max_distance = params.float_or_infinite("maxdistance", f64::INFINITY)?;
                if max_distance <= 0.0 {
                    return params.out_of_range("maxdistance", max_distance, "more than 0");
                }
                IntegratorKind::AmbientOcclusion { cosine: params.boolean("cossample", true)?, max_distance }
            }
            "normals" => IntegratorKind::Normals,
            "depth" => IntegratorKind::Depth,
            "albedo" => IntegratorKind::Albedo,
            "uv" => IntegratorKind::Uv,
            "caustics" => IntegratorKind::Caustics,
            "bdpt" | "mlt" | "sppm" | "lightpath" => {
                params.ignore_all();
                let differs = match ty {
                    "bdpt" => "it connects no vertices: light around corners is found as by path",
                    "mlt" => "it mutates no paths: samples are independent",
                    "sppm" => "its radius is a few pixels, and photons are for caustics alone",
                    _ => "what is seen in mirrors and through glass is not black",
                };
                let message = format!("integrator {} is rendered by caustics: {differs}", quoted(ty));
                self.warn(spot, Diagnostic::note(message));
                IntegratorKind::Caustics
            }
            "randomwalk" => {
                let kind = path(&params)?;
                let message = "integrator \"randomwalk\" is rendered by path, which samples lights, too: those without size are not black";
                self.warn(spot, Diagnostic::note(message));
                kind
            }
            "function" => {
                let wrong = Diagnostic::error(
                    "integrator \"function\" measures samplers, and makes no picture of a scene",
                );
                return Err(spot.wrong(wrong.expected(INTEGRATORS.join(", "))));
            }
            _ => {
                let kind = path(&params)?;
                self.unknown(spot, "integrator", ty, &INTEGRATORS, "path takes its place");
                kind
            }
        };
        let max_depth = params.count("maxdepth", 5, 0)?;
        // They affect the speed of convergence, not the image.
        params.ignore(&["lightsampler", "samplelights", "samplebsdf"]);
        for old in ["lightsamplestrategy", "rrthreshold", "strategy"] {
            if params.has(old) {
                params.ignore(&[old]);
                self.upgraded(params.spot_of(old));
            }
        }
        // Ours: pbrt-v4 has no choice.
        let normals = [("lumbre", ShadingNormals::Lumbre), ("pbrt", ShadingNormals::Pbrt)];
        let shading_normals = params.choice("shadingnormals", &normals, ShadingNormals::default())?;
        self.done(&params);
        self.scene.integrator = IntegratorDesc { kind, max_depth, shading_normals };
        Ok(())
    }

    pub fn accelerator(&mut self, ty: &str, params: Params) -> Result<()> {
        // Lumbre builds its own tree, which does not affect the image.
        params.ignore_all();
        if !ACCELERATORS.contains(&ty) {
            self.unknown(params.spot, "accelerator", ty, &ACCELERATORS, "none is needed");
        }
        Ok(())
    }

    pub fn option(&mut self, name: &str, at: SourcePosition, value: &str) -> Result<()> {
        let plain: String = name.chars().filter(|c| !matches!(c, '-' | '_')).collect();
        match plain.to_ascii_lowercase().as_str() {
            "seed" => match parse_number(value.as_bytes()).and_then(whole) {
                Some(seed) => self.sampler_seed = Some(u64::from(seed as u32)),
                None => {
                    let wrong = Diagnostic::error("wrong value of the option \"seed\"").found(quoted(value));
                    return Err(at.wrong(wrong.expected("an integer")));
                }
            },
            // No effect: there is no GPU pass, and nothing to gain from another space.
            "displacementedgescale" => {
                let scale = parse_number(value.as_bytes()).filter(|scale| 0.0 < *scale && scale.is_finite());
                let Some(scale) = scale else {
                    let wrong = Diagnostic::error("wrong value of the option \"displacementedgescale\"");
                    return Err(at.wrong(wrong.found(quoted(value)).expected("a number above 0")));
                };
                self.displaced_edge_scale = scale;
            }
            "wavefront" | "rendercoordsys" => {}
            "pixelstats" | "msereferenceimage" | "msereferenceout" => {
                self.note(at, format!("the option {} is left out: it is not of the picture", quoted(name)));
            }
            "disablepixeljitter" | "disabletexturefiltering" | "disablewavelengthjitter" | "forcediffuse" => {
                match value {
                    "false" => {}
                    "true" => self.note(
                        at,
                        format!("the option {} is left out: it is for tests of pbrt", quoted(name)),
                    ),
                    _ => {
                        let wrong = Diagnostic::error(format!("wrong value of the option {}", quoted(name)));
                        return Err(at.wrong(wrong.found(quoted(value)).expected("true or false")));
                    }
                }
            }
            other => {
                let unknown = Diagnostic::warning(format!("unknown option {}", quoted(name)));
                self.warn(at, unknown.suggest(other, OPTIONS));
            }
        }
        Ok(())
    }

    /// Settings that depend on several directives: exposure, the seed, and a default camera.
    pub fn finish_settings(&mut self) -> Result<()> {
        let exposure = self.exposure.shutter * self.exposure.iso / 100.0 * self.exposure.scale;
        self.scene.film.exposure = exposure as f32;
        self.scene.film.iso = self.exposure.iso as f32;
        if let Some(seed) = self.sampler_seed {
            self.scene.sampler.seed = seed;
        }
        self.finish_lens()?;
        if self.scene.cameras.is_empty() {
            self.scene.cameras.push(Camera {
                name: None,
                kind: CameraKind::Perspective { fov: 90.0, lens_radius: 0.0, focal_distance: 1e6 },
                world_from_camera: Transform::IDENTITY,
                motion: None,
                frame_aspect: None,
                screen_window: None,
                shutter_open: 0.0,
                shutter_close: 1.0,
                medium: None,
                clip: None,
            });
        }
        Ok(())
    }
}

/// The buckets of a film that keeps light by wavelength.
fn buckets(params: &Params) -> Result<Buckets> {
    const LEAST: f64 = 360.0;
    const GREATEST: f64 = 830.0;
    let count = params.count("nbuckets", 16, 1)?;
    if count > Buckets::MAX {
        return params.out_of_range("nbuckets", f64::from(count), &format!("1 to {}", Buckets::MAX));
    }
    let (low, high) = (params.float("lambdamin", LEAST)?, params.float("lambdamax", GREATEST)?);
    for (name, nm) in [("lambdamin", low), ("lambdamax", high)] {
        if !(LEAST..=GREATEST).contains(&nm) {
            return params.out_of_range(name, nm, "360 to 830 nm");
        }
    }
    let buckets = Buckets { count, low: low as f32, high: high as f32 };
    if buckets.low >= buckets.high {
        return params.out_of_range("lambdamin", low, "less than lambdamax");
    }
    Ok(buckets)
}

/// The value under its pbrt-v3 name, else the default.
fn params_v3(params: &Params, name: &'static str, default: f64) -> Result<f64> {
    if params.has(name) { params.float_above(name, default, 0.0) } else { Ok(default) }
}
