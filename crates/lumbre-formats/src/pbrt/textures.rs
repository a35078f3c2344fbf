//! Spectra and textures.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use lumbre_image::Encoding;
use lumbre_math::noise::Octaves;
use lumbre_math::{DVec3, Transform, Vec2, Vec3};
use lumbre_shading::spectrum::LightCurve;
use lumbre_shading::{
    ImageFilter, ImageTexture, Mapping2d, NamedSpectrum, Pattern, PatternKind, Spectrum, SpectrumTexture,
    SpectrumValue, Texture, TextureValue, Wrap,
};

use super::colour;
use super::convert::{Converter, FloatArc, Known, MAX_TEXTURE_LEAVES, SpectrumArc, file_fault};
use super::lexer::{Lexer, TokenKind, parse_number};
use super::params::{AT_MOST_F32, Param, Params, Type, Values};
use super::source::{AtSpot, Fault, Result, SourcePosition};
use crate::diagnostic::quoted;
use crate::{Diagnostic, FormatError, Input};

/// The use of a spectrum, which determines the meaning and the range of `rgb`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SpectrumUse {
    /// A reflectance, at most 1.
    Reflectance,
    /// Any factor or coefficient.
    Coefficient,
    /// Emitted light.
    Light,
}

/// The types that say a spectrum.
const SPECTRAL: [Type; 3] = [Type::Rgb, Type::Blackbody, Type::Spectrum];

/// The two kinds of texture value.
pub(super) trait SceneValue: TextureValue {
    const NAME: &'static str;
    /// The value that replaces a texture that cannot be rendered.
    fn grey(v: f32) -> Self;
    /// The number, if it is equal on all channels.
    fn as_number(self) -> Option<f32>;
    fn table<'a>(converter: &'a mut Converter<'_, '_>) -> &'a mut HashMap<String, Known<Self>>;
    fn get(
        converter: &mut Converter<'_, '_>,
        params: &Params,
        name: &'static str,
    ) -> Result<Option<Known<Self>>>;
}

impl SceneValue for f32 {
    const NAME: &'static str = "float";

    fn grey(v: f32) -> Self {
        v
    }

    fn as_number(self) -> Option<f32> {
        Some(self)
    }

    fn table<'a>(converter: &'a mut Converter<'_, '_>) -> &'a mut HashMap<String, Known<Self>> {
        &mut converter.float_textures
    }

    fn get(
        converter: &mut Converter<'_, '_>,
        params: &Params,
        name: &'static str,
    ) -> Result<Option<Known<Self>>> {
        let Some(param) = params.typed(name, &[Type::Float, Type::Integer, Type::Texture])? else {
            return Ok(None);
        };
        if param.ty == Type::Texture {
            return converter.texture_named(param).map(Some);
        }
        let value = single(params, name, 0.0)?;
        Ok(Some(Known::of(converter.number(value))))
    }
}

impl SceneValue for Spectrum {
    const NAME: &'static str = "spectrum";

    fn grey(v: f32) -> Self {
        Self::splat(v)
    }

    fn as_number(self) -> Option<f32> {
        (self.r == self.g && self.g == self.b).then_some(self.r)
    }

    fn table<'a>(converter: &'a mut Converter<'_, '_>) -> &'a mut HashMap<String, Known<Self>> {
        &mut converter.spectrum_textures
    }

    fn get(
        converter: &mut Converter<'_, '_>,
        params: &Params,
        name: &'static str,
    ) -> Result<Option<Known<Self>>> {
        converter.spectrum_texture(params, name, SpectrumUse::Coefficient)
    }
}

/// A number in single precision.
pub(super) fn single(params: &Params, name: &'static str, default: f32) -> Result<f32> {
    let value = params.float(name, f64::from(default))?;
    if value.abs() <= f64::from(f32::MAX) {
        return Ok(value as f32);
    }
    params.out_of_range(name, value, "a number of single precision")
}

/// The colour of a light, and its spectrum with luminance 1, where it is more than a colour.
pub(super) struct LightSpectrum {
    pub colour: Spectrum,
    pub curve: Option<Arc<LightCurve>>,
}

/// Why an image cannot be had, and where it is named.
type Missing = (SourcePosition, Box<Diagnostic>);

/// The kinds of texture.
pub(super) const KNOWN_KINDS: [&str; 13] = [
    "constant",
    "scale",
    "mix",
    "directionmix",
    "bilerp",
    "imagemap",
    "checkerboard",
    "dots",
    "fbm",
    "wrinkled",
    "windy",
    "marble",
    "ptex",
];

impl Converter<'_, '_> {
    // Spectra.

    /// The spectrum of a parameter, and the factor that pbrt-v3 may write after a temperature.
    fn spectrum(&mut self, param: &Param, usage: SpectrumUse) -> Result<(SpectrumValue, f32)> {
        match (param.ty, &param.values) {
            (Type::Rgb, _) => {
                let rgb = param.exactly::<3>()?;
                let representable = |v: &f64| (0.0..=f64::from(f32::MAX)).contains(v);
                if !rgb.iter().all(representable) {
                    let is_negative = rgb.iter().any(|v| *v < 0.0);
                    let expected = if is_negative { "3 numbers that are not negative" } else { AT_MOST_F32 };
                    return Err(param.refuse_numbers(expected));
                }
                let colour = match usage {
                    SpectrumUse::Light => colour::light(&param.space, rgb),
                    _ => colour::factor(&param.space, rgb),
                };
                if usage == SpectrumUse::Reflectance && rgb.iter().any(|v| *v > 1.0) {
                    let message = format!("{} reflects more than all: it is held to 1", quoted(&param.name));
                    let found = format!("{} {} {}", rgb[0], rgb[1], rgb[2]);
                    self.warn(param.spot, Diagnostic::warning(message).found(found));
                }
                let reflectance = usage == SpectrumUse::Reflectance;
                let colour = if reflectance { colour.clamp(0.0, 1.0) } else { colour };
                Ok((SpectrumValue::Rgb(colour), 1.0))
            }
            (Type::Blackbody, Values::Numbers(v)) => {
                let scale = match v[..] {
                    [_] => 1.0,
                    [_, scale] => {
                        self.upgraded(param.spot);
                        scale as f32
                    }
                    _ => return Err(param.refuse("one temperature in kelvin")),
                };
                let in_range = 0.0 < v[0] && v[0].is_finite() && (0.0..f32::INFINITY).contains(&scale);
                if !in_range {
                    return Err(param.refuse("a temperature in kelvin, more than 0"));
                }
                Ok((SpectrumValue::Blackbody(v[0]), scale))
            }
            (Type::Spectrum, Values::Strings(_)) => {
                let name = param.one_string()?.to_owned();
                Ok((self.spectrum_named(&name, param.spot)?, 1.0))
            }
            (Type::Spectrum, Values::Numbers(_)) => {
                let pairs = pairs(param.numbers()?).map_err(|what| param.refuse(what))?;
                Ok((SpectrumValue::Sampled(pairs), 1.0))
            }
            _ => Err(param.refuse("a spectrum")),
        }
    }

    /// A built-in spectrum, else a file of pairs.
    fn spectrum_named(&mut self, name: &str, at: SourcePosition) -> Result<SpectrumValue> {
        if let Some(named) = NamedSpectrum::from_name(name) {
            return Ok(SpectrumValue::Named(named));
        }
        let path = match self.resolve(name, at) {
            Ok(path) if self.budget.exists(&path) => path,
            _ => {
                let wrong = Diagnostic::error(format!("unknown spectrum {}", quoted(name)));
                let wrong = wrong.suggest(name, NamedSpectrum::names());
                return Err(at.wrong(wrong.expected("the name of a built-in spectrum or of a file")));
            }
        };
        let numbers = self.numbers_in_file(&path, "a spectrum", at)?;
        let pairs = pairs(&numbers).map_err(|expected| {
            let wrong = Diagnostic::error(format!("wrong spectrum {}", quoted(name)));
            at.wrong(wrong.found(format!("{} numbers", numbers.len())).expected(expected))
        })?;
        Ok(SpectrumValue::Sampled(pairs))
    }

    /// The numbers of a text file, which `what` names.
    pub fn numbers_in_file(&mut self, path: &Path, what: &str, at: SourcePosition) -> Result<Vec<f64>> {
        let input = Input::open(path, self.budget).map_err(|e| file_fault(at, e))?;
        let file = self.files.add(input.name().clone(), Some(at));
        let numbers_at_most = input.len() as u64 / 2 + 1;
        let mut lexer = Lexer::new(input, file)?;
        // A vector that grows may be twice as long.
        let most = numbers_at_most * 2 * size_of::<f64>() as u64;
        let _while_read = self.budget.hold(most, &format!("numbers of {what}")).at(at)?;
        let mut numbers = vec![];
        while let Some(token) = lexer.next()? {
            match parse_number(lexer.raw(token)).filter(|v| v.is_finite()) {
                Some(v) if token.kind == TokenKind::Bare => numbers.push(v),
                _ => {
                    let wrong = Diagnostic::error(format!("wrong value in {what}")).found(lexer.shown(token));
                    return Err(lexer.spot(token).wrong(wrong.expected("a number")));
                }
            }
        }
        Ok(numbers)
    }

    /// A spectrum by wavelength or as a colour, but not a texture.
    pub fn spectrum_value(
        &mut self,
        params: &Params,
        name: &'static str,
        usage: SpectrumUse,
    ) -> Result<Option<SpectrumValue>> {
        let Some(param) = params.typed(name, &SPECTRAL)? else { return Ok(None) };
        Ok(Some(self.spectrum(param, usage)?.0))
    }

    /// A photometric colour of light: `rgb` times the colour space's white, whose luminance is 1; any other
    /// spectrum with luminance 1.
    pub fn light_colour(&mut self, params: &Params, name: &'static str) -> Result<Option<LightSpectrum>> {
        let Some(param) = params.typed(name, &SPECTRAL)? else { return Ok(None) };
        let (spectrum, scale) = self.spectrum(param, SpectrumUse::Light)?;
        let colour = spectrum.illuminant_rgb() * scale;
        Ok(Some(LightSpectrum { colour, curve: self.light_curve(spectrum, param.spot)? }))
    }

    /// The curve of a light's spectrum, shared with the light before where that has the same.
    fn light_curve(
        &mut self,
        spectrum: SpectrumValue,
        spot: SourcePosition,
    ) -> Result<Option<Arc<LightCurve>>> {
        if let Some((last, curve)) = &self.last_light
            && *last == spectrum
        {
            return Ok(Some(curve.clone()));
        }
        let Some(curve) = LightCurve::of(&spectrum) else { return Ok(None) };
        self.keep(LightCurve::BYTES, "spectra", spot)?;
        let curve = Arc::new(curve);
        self.last_light = Some((spectrum, curve.clone()));
        Ok(Some(curve))
    }

    /// A texture that is a spectrum of this colour; of a colour alone, that colour.
    pub fn spectrum_constant(
        &mut self,
        colour: Spectrum,
        spectrum: SpectrumValue,
        spot: SourcePosition,
    ) -> Result<SpectrumArc> {
        let pairs = match &spectrum {
            SpectrumValue::Rgb(_) => return Ok(self.colour(colour)),
            SpectrumValue::Sampled(pairs) => size_of_val(pairs.as_slice()),
            SpectrumValue::Blackbody(_) | SpectrumValue::Named(_) => 0,
        };
        self.keep(size_of::<SpectrumTexture>() + size_of::<SpectrumValue>() + pairs, "spectra", spot)?;
        Ok(Arc::new(Texture::Spectrum { value: colour, spectrum: Arc::new(spectrum) }))
    }

    // Textures as parameters.

    /// A colour or a texture of colours.
    pub fn spectrum_texture(
        &mut self,
        params: &Params,
        name: &'static str,
        usage: SpectrumUse,
    ) -> Result<Option<Known<Spectrum>>> {
        let types = [Type::Rgb, Type::Spectrum, Type::Blackbody, Type::Texture];
        let Some(param) = params.typed(name, &types)? else { return Ok(None) };
        if param.ty == Type::Texture {
            return self.texture_named(param).map(Some);
        }
        let value = self.spectrum(param, usage)?.0;
        let colour = match usage {
            SpectrumUse::Reflectance => value.reflectance_rgb(),
            SpectrumUse::Coefficient => value.unbounded_rgb(),
            SpectrumUse::Light => value.illuminant_rgb(),
        };
        let texture = match usage {
            // The spectrum of a light is of another scale than its colour.
            SpectrumUse::Light => self.colour(colour),
            SpectrumUse::Reflectance | SpectrumUse::Coefficient => {
                self.spectrum_constant(colour, value, param.spot)?
            }
        };
        Ok(Some(Known::of(texture)))
    }

    /// [`Self::spectrum_texture`] with a grey default.
    pub fn spectrum_texture_or(
        &mut self,
        params: &Params,
        name: &'static str,
        usage: SpectrumUse,
        default: f32,
    ) -> Result<SpectrumArc> {
        let known = self.spectrum_texture(params, name, usage)?;
        Ok(known.map_or_else(|| self.colour(Spectrum::splat(default)), |known| known.texture))
    }

    /// A number or a texture of numbers.
    pub fn float_texture(&mut self, params: &Params, name: &'static str) -> Result<Option<FloatArc>> {
        Ok(f32::get(self, params, name)?.map(|known| known.texture))
    }

    pub fn float_texture_or(
        &mut self,
        params: &Params,
        name: &'static str,
        default: f32,
    ) -> Result<FloatArc> {
        Ok(self.float_texture(params, name)?.unwrap_or_else(|| self.number(default)))
    }

    /// Whether a parameter names a texture that is not defined yet.
    pub fn is_texture_to_come(&self, param: &Param) -> bool {
        let Values::Strings(names) = &param.values else { return false };
        param.ty == Type::Texture
            && names.iter().any(|name| {
                let is_broken = |kind| self.broken_textures.contains_key(&(kind, name.clone()));
                !self.float_textures.contains_key(name)
                    && !self.spectrum_textures.contains_key(name)
                    && !is_broken(f32::NAME)
                    && !is_broken(Spectrum::NAME)
            })
    }

    /// The texture named by a parameter.
    pub fn texture_named<T: SceneValue>(&mut self, param: &Param) -> Result<Known<T>> {
        let name = param.one_string()?;
        if let Some(known) = T::table(self).get(name) {
            return Ok(known.clone());
        }
        if let Some((spot, wrong)) = self.broken_textures.get(&(T::NAME, name.to_owned())) {
            return Err(spot.wrong(wrong.clone()));
        }
        let in_floats = self.float_textures.contains_key(name);
        let in_spectra = self.spectrum_textures.contains_key(name);
        let wrong =
            Diagnostic::error(format!("{} texture {} is not defined before this", T::NAME, quoted(name)));
        let wrong = match (in_floats, in_spectra) {
            (true, _) => wrong.found("a float texture of this name").expected("a spectrum texture"),
            (_, true) => wrong.found("a spectrum texture of this name").expected("a float texture"),
            _ => wrong.suggest(name, T::table(self).keys().map(String::as_str)),
        };
        Err(param.spot.wrong(wrong))
    }

    // Texture directives.

    pub fn texture(
        &mut self,
        name: &str,
        (value, value_at): (&str, SourcePosition),
        ty: &str,
        params: Params,
        ctm: Transform,
    ) -> Result<()> {
        match value {
            "float" => self.typed_texture::<f32>(name, ty, params, ctm),
            "spectrum" => self.typed_texture::<Spectrum>(name, ty, params, ctm),
            "color" => {
                self.upgraded(value_at);
                self.typed_texture::<Spectrum>(name, ty, params, ctm)
            }
            _ => {
                let wrong = Diagnostic::error("unknown kind of texture").found(quoted(value));
                let wrong = wrong.suggest(value, ["float", "spectrum"]);
                Err(value_at.wrong(wrong.expected("\"float\" or \"spectrum\"")))
            }
        }
    }

    fn typed_texture<T: SceneValue>(
        &mut self,
        name: &str,
        ty: &str,
        params: Params,
        ctm: Transform,
    ) -> Result<()> {
        let spot = params.spot;
        let key = (T::NAME, name.to_owned());
        if T::table(self).contains_key(name) || self.broken_textures.contains_key(&key) {
            return Err(spot.error(format!("{} texture {} is defined twice", T::NAME, quoted(name))));
        }
        let texture_from_world = Arc::new(ctm.inverse());
        let known = match ty {
            "constant" => self.part::<T>(&params, "value", 1.0)?,
            "scale" => self.scale_texture::<T>(&params)?,
            "mix" => {
                let parts = [self.part::<T>(&params, "tex1", 0.0)?, self.part(&params, "tex2", 1.0)?];
                let amount = self.part::<f32>(&params, "amount", 0.5)?;
                let size = [size(&parts[0]), size(&parts[1]), size(&amount)];
                let textures = parts.map(|p| p.texture);
                whole(Texture::Mix { textures, amount: amount.texture }, &size, spot)?
            }
            "directionmix" => {
                let parts = [self.part::<T>(&params, "tex1", 0.0)?, self.part(&params, "tex2", 1.0)?];
                let direction = params.triple("dir", Type::Vector3, DVec3::Y)?;
                let direction = ctm.vector(direction).normalize_or_zero();
                if direction == DVec3::ZERO {
                    return Err(params.spot_of("dir").error("the direction of a directionmix is zero"));
                }
                let size = [size(&parts[0]), size(&parts[1])];
                let textures = parts.map(|p| p.texture);
                whole(Texture::DirectionMix { textures, direction: direction.as_vec3() }, &size, spot)?
            }
            "bilerp" => {
                let mut corner = |name, default| -> Result<T> {
                    let part = self.part::<T>(&params, name, default)?;
                    part.value()
                        .ok_or_else(|| params.spot_of(name).error("a bilerp is between values, not textures"))
                };
                let corners =
                    [corner("v00", 0.0)?, corner("v01", 1.0)?, corner("v10", 0.0)?, corner("v11", 1.0)?];
                let mapping = mapping(&params, texture_from_world)?;
                whole(Texture::Bilerp { mapping, corners }, &[], spot)?
            }
            "checkerboard" => {
                let parts = [self.part::<T>(&params, "tex1", 1.0)?, self.part(&params, "tex2", 0.0)?];
                let size = [size(&parts[0]), size(&parts[1])];
                let textures = parts.map(|p| p.texture);
                params.ignore(&["aamode"]);
                match params.integer("dimension", 2)? {
                    2 => {
                        let mapping = mapping(&params, texture_from_world)?;
                        whole(Texture::Checkerboard2d { mapping, textures }, &size, spot)?
                    }
                    3 => whole(Texture::Checkerboard3d { texture_from_world, textures }, &size, spot)?,
                    other => return params.out_of_range("dimension", f64::from(other), "2 or 3"),
                }
            }
            "imagemap" => match self.image_texture(&params, texture_from_world)? {
                Ok(known) => known,
                Err((spot, wrong)) => {
                    self.done(&params);
                    self.kept_name(name, spot)?;
                    self.keep(size_of::<Diagnostic>() + 512, "textures", spot)?;
                    self.broken_textures.insert(key, (spot, *wrong));
                    return Ok(());
                }
            },
            "dots" => {
                let parts = [self.part::<T>(&params, "inside", 1.0)?, self.part(&params, "outside", 0.0)?];
                let size = [size(&parts[0]), size(&parts[1])];
                let textures = parts.map(|p| p.texture);
                let mapping = mapping(&params, texture_from_world)?;
                whole(Texture::Dots { mapping, textures }, &size, spot)?
            }
            "fbm" | "wrinkled" | "windy" | "marble" => {
                let kind = match ty {
                    "fbm" => PatternKind::Fbm(octaves(&params)?),
                    "wrinkled" => PatternKind::Wrinkled(octaves(&params)?),
                    "windy" => PatternKind::Windy,
                    _ => PatternKind::Marble {
                        octaves: octaves(&params)?,
                        scale: f64::from(single(&params, "scale", 1.0)?),
                        variation: f64::from(single(&params, "variation", 0.2)?),
                    },
                };
                whole(Texture::Pattern(Pattern { texture_from_world, kind }), &[], spot)?
            }
            "ptex" => {
                params.ignore_all();
                let message = "Ptex textures are not read: the constant 1 takes its place";
                self.note(spot, message);
                Known::constant(T::grey(1.0))
            }
            _ => {
                params.ignore_all();
                self.unknown(spot, "texture", ty, &KNOWN_KINDS, "the constant 0.5 takes its place");
                Known::constant(T::grey(0.5))
            }
        };
        self.done(&params);
        self.kept_name(name, spot)?;
        self.keep(
            size_of::<Known<T>>() + 2 * size_of::<Texture<T>>() + size_of::<Transform>(),
            "textures",
            spot,
        )?;
        T::table(self).insert(name.to_owned(), known);
        Ok(())
    }

    /// An operand of a texture: a value or another texture.
    fn part<T: SceneValue>(&mut self, params: &Params, name: &'static str, default: f32) -> Result<Known<T>> {
        Ok(T::get(self, params, name)?.unwrap_or_else(|| Known::constant(T::grey(default))))
    }

    fn scale_texture<T: SceneValue>(&mut self, params: &Params) -> Result<Known<T>> {
        let old = params.has("tex1") || params.has("tex2");
        let (value, factor) = if old {
            // pbrt-v3: a product of two of a kind. One of them must be a number.
            self.upgraded(params.spot);
            let (a, b) = (self.part::<T>(params, "tex1", 1.0)?, self.part::<T>(params, "tex2", 1.0)?);
            let grey = |known: &Known<T>| known.value().and_then(T::as_number);
            match (grey(&a), grey(&b)) {
                (_, Some(number)) => (a, Known::constant(number)),
                (Some(number), _) => (b, Known::constant(number)),
                _ => {
                    let message = "a product of two textures is not rendered: the second is left out";
                    self.note(params.spot, message);
                    (a, Known::constant(1.0))
                }
            }
        } else {
            (self.part::<T>(params, "tex", 1.0)?, self.part::<f32>(params, "scale", 1.0)?)
        };
        let size = [size(&value), size(&factor)];
        whole(Texture::Scale { texture: value.texture, scale: factor.texture }, &size, params.spot)
    }

    fn image_texture<T: SceneValue>(
        &mut self,
        params: &Params,
        texture_from_world: Arc<Transform>,
    ) -> Result<std::result::Result<Known<T>, Missing>> {
        let mapping = mapping(params, texture_from_world)?;
        let anisotropy = params.float_above("maxanisotropy", 8.0, 0.0)?;
        let filters = [
            ("point", ImageFilter::Point),
            ("bilinear", ImageFilter::Bilinear),
            ("trilinear", ImageFilter::Trilinear),
            ("ewa", ImageFilter::Ewa(anisotropy as f32)),
            ("EWA", ImageFilter::Ewa(anisotropy as f32)),
        ];
        let mut filter = params.choice("filter", &filters, ImageFilter::Bilinear)?;
        let wraps = [
            ("repeat", Wrap::Repeat),
            ("clamp", Wrap::Clamp),
            ("black", Wrap::Black),
            ("octahedralsphere", Wrap::OctahedralSphere),
        ];
        let wrap = params.choice("wrap", &wraps, Wrap::Repeat)?;
        let mut encoding = encoding(params)?;
        // pbrt-v3.
        if params.has("trilinear") {
            self.upgraded(params.spot_of("trilinear"));
            if params.boolean("trilinear", false)? {
                filter = ImageFilter::Trilinear;
            }
        }
        if params.has("gamma") {
            self.upgraded(params.spot_of("gamma"));
            let is_srgb = match params.find("gamma").map(|p| p.ty) {
                Some(Type::Bool) => params.boolean("gamma", true)?,
                _ => params.float("gamma", 2.2)? != 1.0,
            };
            encoding = Some(if is_srgb { Encoding::Srgb } else { Encoding::Linear });
        }
        let scale = single(params, "scale", 1.0)?;
        let invert = params.boolean("invert", false)?;
        let Some(filename) = params.string("filename")?.map(str::to_owned) else {
            return Err(params.spot.error("an imagemap has no \"string filename\""));
        };
        let at = params.spot_of("filename");
        let image = match self.mip_map(&filename, at, encoding, wrap, filter) {
            Ok(image) => image,
            // Only a texture that is used needs its file.
            Err(Fault::Input(spot, wrong)) => return Ok(Err((spot, wrong))),
            Err(Fault::Other(error)) if matches!(*error, FormatError::Input(_)) => {
                return Ok(Err((at, Box::new(unreadable(&filename, &error)))));
            }
            Err(fault) => return Err(fault),
        };
        whole(Texture::Image(ImageTexture { mapping, image, scale, invert }), &[], params.spot).map(Ok)
    }
}

/// An image that is not what it should be, for a message at the place that names it.
pub(super) fn unreadable(name: &str, error: &FormatError) -> Diagnostic {
    match error {
        FormatError::Io { .. } => Diagnostic::error(error.to_string()),
        _ => Diagnostic::error(format!("cannot read {}: {error}", quoted(name))),
    }
}

/// The encoding of a texture's image.
pub(super) fn encoding(params: &Params) -> Result<Option<Encoding>> {
    let Some(name) = params.string("encoding")? else { return Ok(None) };
    match Encoding::from_name(name) {
        Some(encoding) => Ok(Some(encoding)),
        None => {
            let wrong = Diagnostic::error("wrong value for parameter \"encoding\"").found(quoted(name));
            Err(params.spot_of("encoding").wrong(wrong.expected("sRGB, linear or gamma G")))
        }
    }
}

/// The octaves of a pattern of noise.
fn octaves(params: &Params) -> Result<Octaves> {
    const MOST: u32 = 64;
    let count = params.count("octaves", 8, 0)?;
    if count > MOST {
        return params.out_of_range("octaves", f64::from(count), &format!("0 to {MOST}"));
    }
    Ok(Octaves { count, roughness: f64::from(single(params, "roughness", 0.5)?) })
}

/// The mapping from the surface to the plane of a texture.
fn mapping(params: &Params, texture_from_world: Arc<Transform>) -> Result<Mapping2d> {
    #[derive(Clone, Copy)]
    enum Kind {
        Uv,
        Spherical,
        Cylindrical,
        Planar,
    }
    let kinds = [
        ("uv", Kind::Uv),
        ("spherical", Kind::Spherical),
        ("cylindrical", Kind::Cylindrical),
        ("planar", Kind::Planar),
    ];
    let delta =
        || -> Result<Vec2> { Ok(Vec2::new(single(params, "udelta", 0.0)?, single(params, "vdelta", 0.0)?)) };
    Ok(match params.choice("mapping", &kinds, Kind::Uv)? {
        Kind::Uv => {
            let scale = Vec2::new(single(params, "uscale", 1.0)?, single(params, "vscale", 1.0)?);
            Mapping2d::Uv { scale, delta: delta()? }
        }
        Kind::Spherical => Mapping2d::Spherical { texture_from_world },
        Kind::Cylindrical => Mapping2d::Cylindrical { texture_from_world },
        Kind::Planar => {
            let vs = params.triple("v1", Type::Vector3, DVec3::X)?;
            let vt = params.triple("v2", Type::Vector3, DVec3::Y)?;
            Mapping2d::Planar { texture_from_world, vs, vt, delta: delta()? }
        }
    })
}

fn size<T: TextureValue>(known: &Known<T>) -> (usize, u64) {
    (known.depth, known.leaves)
}

/// A composite texture, checked against the limits on depth and evaluations.
fn whole<T: TextureValue>(
    texture: Texture<T>,
    parts: &[(usize, u64)],
    spot: SourcePosition,
) -> Result<Known<T>> {
    let depth = 1 + parts.iter().map(|(depth, _)| *depth).max().unwrap_or(0);
    let leaves = parts.iter().fold(1u64, |sum, (_, leaves)| sum.saturating_add(*leaves));
    if depth > Texture::<T>::MAX_DEPTH {
        let message = format!("textures stand in each other more than {} deep", Texture::<T>::MAX_DEPTH);
        return Err(spot.error(message));
    }
    if leaves > MAX_TEXTURE_LEAVES {
        let message = format!("a texture is made of more than {MAX_TEXTURE_LEAVES} others");
        return Err(spot.error(message));
    }
    Ok(Known { texture: Arc::new(texture), depth, leaves })
}

/// The wavelengths of rendering, in nm.
const VISIBLE_NM: [f64; 2] = [360.0, 830.0];

/// Wavelengths with their values, or what is wrong with them.
fn pairs(numbers: &[f64]) -> std::result::Result<Vec<(f64, f64)>, &'static str> {
    let pairs: Vec<(f64, f64)> = numbers.chunks_exact(2).map(|c| (c[0], c[1])).collect();
    if !numbers.len().is_multiple_of(2) || pairs.is_empty() {
        return Err("pairs of a wavelength and a value");
    }
    if pairs.windows(2).any(|w| w[0].0 >= w[1].0) {
        return Err("wavelengths that ascend");
    }
    if pairs.iter().any(|(_, v)| *v < 0.0) {
        return Err("values that are not negative");
    }
    if pairs.iter().any(|(_, v)| *v > f64::from(f32::MAX)) {
        return Err(AT_MOST_F32);
    }
    // As in pbrt-v4, a list is 0 outside its wavelengths.
    let mut pairs = pairs;
    let [(first, _), (last, _)] = [pairs[0], pairs[pairs.len() - 1]];
    if first > VISIBLE_NM[0] {
        pairs.insert(0, (first.next_down(), 0.0));
    }
    if last < VISIBLE_NM[1] {
        pairs.push((last.next_up(), 0.0));
    }
    Ok(pairs)
}

/// A vector of a mesh or a light in the range of single precision.
pub(super) fn vec3(numbers: &[f64]) -> Option<Vec3> {
    let v = Vec3::new(numbers[0] as f32, numbers[1] as f32, numbers[2] as f32);
    v.is_finite().then_some(v)
}
