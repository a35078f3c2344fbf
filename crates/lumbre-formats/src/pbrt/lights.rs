//! Lights, with the photometric rules of pbrt: emission is divided by the luminance of its spectrum, which for `rgb` is
//! that of the colour space's white; a power or an illuminance in photometric units multiplies that.

use std::f64::consts::PI;
use std::sync::Arc;

use lumbre_image::Image;
use lumbre_math::{DAffine3, DMat3, DVec3, Elementary, Transform};
use lumbre_scene::{
    AreaLightDesc, ClearSky, EnvironmentDesc, EnvironmentMapping, LightDesc, SkyDesc, SkyError, SunPosition,
    SunPositionError,
};
use lumbre_shading::spectrum::LightCurve;
use lumbre_shading::{ImageFilter, Spectrum, SpectrumValue, Wrap};

use super::colour;
use super::convert::{Converter, file_fault};
use super::params::{Params, Type};
use super::source::{AtSpot, Result, SourcePosition};
use super::state::{AreaLight, State};
use super::textures::{LightSpectrum, SpectrumUse, single};
use crate::Diagnostic;
use crate::diagnostic::quoted;

pub(super) const KNOWN: [&str; 7] =
    ["point", "spot", "distant", "infinite", "sky", "goniometric", "projection"];

impl Converter<'_, '_> {
    pub fn light(&mut self, ty: &str, params: Params, state: &State) -> Result<()> {
        let spot = params.spot;
        let ctm = state.ctm[0];
        // pbrt-v3.
        for old in ["nsamples", "samples"] {
            if params.has(old) {
                self.upgraded(params.spot_of(old));
                params.ignore(&[old]);
            }
        }
        if self.open_object.is_some() {
            self.note(spot, "a light inside an object stands in the world, once");
        }
        let light = match ty {
            "point" => {
                let scale = self.light_scale(&params)?;
                let LightSpectrum { colour, curve } = self.emission(&params, "I", state)?;
                let intensity = colour * scale * power(&params, 4.0 * PI)?;
                let from = ctm.point(params.triple("from", Type::Point3, DVec3::ZERO)?);
                spectral(LightDesc::Point { from, intensity }, curve, scale)
            }
            "spot" => {
                let scale = self.light_scale(&params)?;
                let angle = params.float("coneangle", 30.0)?;
                if !(0.0 < angle && angle < 180.0) {
                    return params.out_of_range("coneangle", angle, "more than 0 and less than 180 degrees");
                }
                let delta = params.float("conedeltaangle", 5.0)?;
                if !(0.0 <= delta && delta <= angle) {
                    return params.out_of_range("conedeltaangle", delta, "0 to coneangle");
                }
                let (inner, outer) = ((angle - delta).to_radians().cosine(), angle.to_radians().cosine());
                let around = 2.0 * PI * ((1.0 - inner) + 0.5 * (inner - outer));
                let LightSpectrum { colour, curve } = self.emission(&params, "I", state)?;
                let intensity = colour * scale * power(&params, around)?;
                let from = params.triple("from", Type::Point3, DVec3::ZERO)?;
                let to = params.triple("to", Type::Point3, DVec3::Z)?;
                let Some(turn) = frame_along(to - from) else {
                    return Err(params
                        .spot_of("to")
                        .error("a spot shines from a point to itself: from and to are equal"));
                };
                let light = LightDesc::Spot {
                    world_from_light: ctm * Transform::translate(from) * turn,
                    intensity,
                    cone_angle: angle as f32,
                    cone_delta_angle: delta as f32,
                };
                spectral(light, curve, scale)
            }
            "distant" => {
                let scale = self.light_scale(&params)?;
                let LightSpectrum { colour, curve } = self.emission(&params, "L", state)?;
                let lux = positive(&params, "illuminance")?.unwrap_or(1.0);
                let from = params.triple("from", Type::Point3, DVec3::ZERO)?;
                let to = params.triple("to", Type::Point3, DVec3::Z)?;
                let towards = unit(ctm.vector(from - to));
                if !towards.is_finite() {
                    let message = "a distant light shines from a point to itself: from and to are equal";
                    return Err(params.spot_of("to").error(message));
                }
                let irradiance = colour * scale * lux as f32;
                let angle = params.float("angle", 0.0)?;
                let light = match angle {
                    0.0 => LightDesc::Distant { towards, irradiance },
                    _ if 0.0 < angle && angle <= 180.0 => LightDesc::Disc { towards, angle, irradiance },
                    _ => return params.out_of_range("angle", angle, "0 to 180 degrees"),
                };
                spectral(light, curve, scale)
            }
            "infinite" => self.infinite(&params, state)?,
            "sky" => {
                let lights = self.sky(&params, state)?;
                self.done(&params);
                return self.keep_lights(lights, spot);
            }
            "goniometric" => self.goniometric(&params, state)?,
            "projection" => self.projection(&params, state)?,
            _ => {
                params.ignore_all();
                self.unknown(spot, "light", ty, &KNOWN, "it is left out");
                return Ok(());
            }
        };
        self.done(&params);
        self.keep_lights(vec![light], spot)
    }

    fn keep_lights(&mut self, lights: Vec<LightDesc>, spot: SourcePosition) -> Result<()> {
        self.budget.elements(lights.len() as u64, "lights").at(spot)?;
        self.keep(size_of_val(&*lights), "lights", spot)?;
        self.scene.lights.extend(lights);
        Ok(())
    }

    /// The sun and a clear sky: two lights.
    fn sky(&mut self, params: &Params, state: &State) -> Result<Vec<LightDesc>> {
        let base = SkyDesc::default();
        let sun = sun_position(params, base.sun)?;
        let factor = |name| -> Result<f32> {
            let factor = single(params, name, 1.0)?;
            if factor < 0.0 {
                return params.out_of_range(name, f64::from(factor), "0 or more");
            }
            Ok(factor)
        };
        let scale = factor("scale")?;
        let sun_angle = params.float("sunangle", base.sun_angle)?;
        if !(0.0 < sun_angle && sun_angle <= 180.0) {
            return params.out_of_range("sunangle", sun_angle, "more than 0, to 180 degrees");
        }
        let desc = SkyDesc {
            sun,
            turbidity: params.float("turbidity", base.turbidity)?,
            albedo: params.float("albedo", base.albedo)?,
            sun_scale: scale * factor("sunscale")?,
            sky_scale: scale * factor("skyscale")?,
            sun_angle,
        };
        let sky = ClearSky::new(desc).map_err(|error| {
            let name = match error {
                SkyError::Turbidity(_) => "turbidity",
                SkyError::Albedo(_) => "albedo",
                SkyError::Elevation(_) if params.has("at") => "at",
                SkyError::Elevation(_) => "elevation",
            };
            params.spot_of(name).error(error.to_string())
        })?;
        self.keep(ClearSky::MAP_BYTES, "sky", params.spot)?;
        Ok(sky.lights(&state.ctm[0]))
    }

    /// The colour of a light: the parameter of this name, else the white of the colour space.
    fn emission(&mut self, params: &Params, name: &'static str, state: &State) -> Result<LightSpectrum> {
        let given = self.light_colour(params, name)?;
        let white = || LightSpectrum { colour: colour::light(&state.space, [1.0; 3]), curve: None };
        Ok(given.unwrap_or_else(white))
    }

    /// `scale`, a number; a colour in pbrt-v3.
    fn light_scale(&mut self, params: &Params) -> Result<Spectrum> {
        let types = [Type::Float, Type::Integer, Type::Rgb, Type::Spectrum];
        let param = params.typed("scale", &types)?;
        if param.is_some_and(|p| matches!(p.ty, Type::Rgb | Type::Spectrum)) {
            self.upgraded(params.spot_of("scale"));
            let value = self.spectrum_value(params, "scale", SpectrumUse::Coefficient)?;
            return Ok(value.as_ref().map_or(Spectrum::WHITE, SpectrumValue::unbounded_rgb));
        }
        let scale = single(params, "scale", 1.0)?;
        if scale < 0.0 {
            return params.out_of_range("scale", f64::from(scale), "0 or more");
        }
        Ok(Spectrum::splat(scale))
    }

    fn infinite(&mut self, params: &Params, state: &State) -> Result<LightDesc> {
        let spot = params.spot;
        let world_from_light = state.ctm[0];
        let mut scale = self.light_scale(params)?;
        let given = self.light_colour(params, "L")?;
        let lux = positive(params, "illuminance")?;
        let portal = portal(params)?;
        let through_portal = |light: LightDesc| match (light, portal) {
            (LightDesc::Infinite { world_from_light, radiance, image }, Some(corners)) => {
                LightDesc::Portal { world_from_light, radiance, image, corners }
            }
            (light, _) => light,
        };
        let is_old = params.has("mapname");
        if is_old {
            self.upgraded(params.spot_of("mapname"));
        }
        let key = if is_old { "mapname" } else { "filename" };
        let Some(filename) = params.string(key)?.map(str::to_owned) else {
            let white = || colour::light(&state.space, [1.0; 3]);
            let (colour, curve) = given.map_or_else(|| (white(), None), |given| (given.colour, given.curve));
            let radiance = colour * scale * lux.map_or(1.0, |lux| lux / PI) as f32;
            let light = through_portal(LightDesc::Infinite { world_from_light, radiance, image: None });
            return Ok(spectral(light, curve, scale));
        };
        let at = params.spot_of(key);
        match given {
            // A factor in pbrt-v3.
            Some(l) if is_old => scale *= l.colour,
            Some(_) => return Err(spot.error("an infinite light has both L and filename: give one of them")),
            None => {}
        }
        let file = self.image_file(&filename, at)?;
        let image = file.to_image(self.budget).map_err(|e| file_fault(at, e))?;
        self.budget.release(file.bitmap.bytes() as u64);
        let mapping = environment_mapping(&image, &filename, at)?;
        if let Some(lux) = lux {
            let found = upper_illuminance(&image, mapping);
            if !(found > 0.0 && found.is_finite()) {
                let message = "an illuminance is asked of an environment whose upper half is black";
                return Err(params.spot_of("illuminance").error(message));
            }
            // In pbrt-v4 each pixel of a square map counts for half of what it shines.
            let counted = match mapping {
                EnvironmentMapping::EqualArea => 0.5 * found,
                EnvironmentMapping::LatitudeLongitude => found,
            };
            scale *= (lux / counted) as f32;
        }
        // The edge of a latitude-longitude map is towards +x, as converters for pbrt write it; in our
        // description that is the middle.
        let world_from_light = match mapping {
            EnvironmentMapping::EqualArea => world_from_light,
            EnvironmentMapping::LatitudeLongitude => world_from_light * half_turn(),
        };
        let image = Some(EnvironmentDesc { image: image.into(), mapping });
        Ok(through_portal(LightDesc::Infinite { world_from_light, radiance: scale, image }))
    }

    /// A point light whose intensity by direction is the mean of an image's channels. Its y and z are swapped.
    fn goniometric(&mut self, params: &Params, state: &State) -> Result<LightDesc> {
        let ctm = state.ctm[0];
        let LightSpectrum { colour, curve } = self.emission(params, "I", state)?;
        let scale = self.light_scale(params)?;
        let intensity = colour * scale;
        let lumens = positive(params, "power")?;
        let is_old = params.has("mapname");
        if is_old {
            self.upgraded(params.spot_of("mapname"));
        }
        let key = if is_old { "mapname" } else { "filename" };
        let Some(filename) = params.string(key)?.map(str::to_owned) else {
            self.note(
                params.spot,
                "a goniometric light without a filename shines the same in all directions",
            );
            let around = lumens.map_or(1.0, |lumens| lumens / (4.0 * PI));
            let intensity = intensity * around as f32;
            let light = LightDesc::Point { from: ctm.point(DVec3::ZERO), intensity };
            return Ok(spectral(light, curve, scale));
        };
        let at = params.spot_of(key);
        let file = self.image_file(&filename, at)?;
        let image = file.to_image(self.budget).map_err(|e| file_fault(at, e))?;
        self.budget.release(file.bitmap.bytes() as u64);
        let image = image.map(|c| Spectrum::splat((c.r + c.g + c.b) / 3.0));
        let mapping = environment_mapping(&image, &filename, at)?;
        let factor = match lumens {
            None => 1.0,
            Some(lumens) => {
                let found = flux(&image, mapping);
                if !(found > 0.0 && found.is_finite()) {
                    let message = "a power is asked of a goniometric light whose image is black";
                    return Err(params.spot_of("power").error(message));
                }
                lumens / found
            }
        };
        let turned = match mapping {
            EnvironmentMapping::EqualArea => ctm * exchanged(),
            EnvironmentMapping::LatitudeLongitude => ctm * exchanged() * half_turn(),
        };
        let image = EnvironmentDesc { image: image.into(), mapping };
        let intensity = intensity * factor as f32;
        let light = LightDesc::Goniometric { world_from_light: turned, intensity, image };
        Ok(spectral(light, curve, scale))
    }

    /// A point light that throws an image along +z.
    fn projection(&mut self, params: &Params, state: &State) -> Result<LightDesc> {
        let mut intensity = self.light_scale(params)?;
        let lumens = positive(params, "power")?;
        let fov = single(params, "fov", 90.0)?;
        if !(0.0 < fov && fov < 180.0) {
            return params.out_of_range("fov", f64::from(fov), "more than 0 and less than 180 degrees");
        }
        let is_old = params.has("mapname");
        if is_old {
            self.upgraded(params.spot_of("mapname"));
            intensity *= self.emission(params, "I", state)?.colour;
        }
        let key = if is_old { "mapname" } else { "filename" };
        let Some(filename) = params.string(key)?.map(str::to_owned) else {
            return Err(params.spot.error("a projection light has no \"string filename\""));
        };
        let at = params.spot_of(key);
        let file = self.image_file(&filename, at)?;
        let image = file.to_image(self.budget).map_err(|e| file_fault(at, e))?;
        self.budget.release(file.bitmap.bytes() as u64);
        if let Some(lumens) = lumens {
            let found = projected_flux(&image, f64::from(fov));
            if !(found > 0.0 && found.is_finite()) {
                let message = "a power is asked of a projection light whose image is black";
                return Err(params.spot_of("power").error(message));
            }
            intensity *= (lumens / found) as f32;
        }
        Ok(LightDesc::Projection { world_from_light: state.ctm[0], intensity, image: image.into(), fov })
    }

    /// The area light of the following shapes.
    pub fn area_light(&mut self, ty: &str, params: Params, state: &State) -> Result<Option<AreaLight>> {
        let spot = params.spot;
        match ty {
            "diffuse" => {}
            "area" => self.upgraded(spot),
            _ => {
                params.ignore_all();
                self.unknown(spot, "area light", ty, &["diffuse"], "it is left out");
                return Ok(None);
            }
        }
        for old in ["nsamples", "samples"] {
            if params.has(old) {
                self.upgraded(params.spot_of(old));
                params.ignore(&[old]);
            }
        }
        let scale = self.light_scale(&params)?;
        let given = self.light_colour(&params, "L")?;
        let filename = params.string("filename")?.map(str::to_owned);
        let (LightSpectrum { colour, curve }, image) = match (given, filename) {
            (Some(_), Some(_)) => {
                return Err(spot.error("an area light has both L and filename: give one of them"));
            }
            (None, Some(filename)) => {
                let at = params.spot_of("filename");
                let image = self.mip_map(&filename, at, None, Wrap::Clamp, ImageFilter::Bilinear)?;
                (LightSpectrum { colour: Spectrum::WHITE, curve: None }, Some(image))
            }
            (given, None) => {
                let white = || LightSpectrum { colour: colour::light(&state.space, [1.0; 3]), curve: None };
                (given.unwrap_or_else(white), None)
            }
        };
        let desc = AreaLightDesc {
            radiance: colour * scale,
            image,
            by_vertices: false,
            two_sided: params.boolean("twosided", false)?,
            power: positive(&params, "power")?.map(|lumens| lumens as f32),
            spectrum: curve.filter(|_| is_grey(scale)),
        };
        self.done(&params);
        Ok(Some(AreaLight { desc, spot }))
    }
}

/// A light with the spectrum that it was given; a coloured factor leaves its colour alone.
fn spectral(light: LightDesc, curve: Option<Arc<LightCurve>>, scale: Spectrum) -> LightDesc {
    match curve.filter(|_| is_grey(scale)) {
        Some(spectrum) => LightDesc::Spectral { light: Box::new(light), spectrum },
        None => light,
    }
}

/// Where the sun stands: at a time and a place, or by angles.
fn sun_position(params: &Params, default: SunPosition) -> Result<SunPosition> {
    let Some(text) = params.string("at")? else {
        let azimuth = params.float("azimuth", default.azimuth)?;
        return Ok(SunPosition { azimuth, elevation: params.float("elevation", default.elevation)? });
    };
    for name in ["azimuth", "elevation"] {
        if params.has(name) {
            let message = format!("a sky has both \"at\" and {}: give one of them", quoted(name));
            return Err(params.spot_of(name).error(message));
        }
    }
    text.parse().map_err(|error: SunPositionError| {
        params.spot_of("at").error(format!("wrong value for parameter \"at\": {error}"))
    })
}

fn is_grey(colour: Spectrum) -> bool {
    colour.r == colour.g && colour.g == colour.b
}

/// The corners of the portal of an infinite light, which are in the world.
fn portal(params: &Params) -> Result<Option<[DVec3; 4]>> {
    let Some(param) = params.typed("portal", &[Type::Point3])? else { return Ok(None) };
    let numbers = param.exactly::<12>()?;
    let corners = std::array::from_fn(|i| DVec3::from_slice(&numbers[3 * i..3 * i + 3]));
    let [p0, p1, p2, p3]: [DVec3; 4] = corners;
    let (across, up) = (p3 - p0, p1 - p0);
    let size = across.length().max(up.length());
    let is_rectangle = across.length().min(up.length()) > 0.0
        && across.dot(up).abs() < 1e-3 * across.length() * up.length()
        && (p0 + across + up - p2).length() < 1e-3 * size;
    if is_rectangle {
        Ok(Some(corners))
    } else {
        Err(param.refuse("the 4 corners of a rectangle, around it"))
    }
}

/// The factor for a total power in lumens, where a factor of 1 gives `around` lumens.
fn power(params: &Params, around: f64) -> Result<f32> {
    Ok(positive(params, "power")?.map_or(1.0, |lumens| lumens / around) as f32)
}

/// A photometric quantity, which is used if it is more than 0.
fn positive(params: &Params, name: &'static str) -> Result<Option<f64>> {
    let value = f64::from(single(params, name, -1.0)?);
    Ok((value > 0.0).then_some(value))
}

fn unit(v: DVec3) -> DVec3 {
    (v / v.abs().max_element()).normalize()
}

/// A rotation of +z to `v`.
fn frame_along(v: DVec3) -> Option<Transform> {
    let z = unit(v);
    let x = unit(z.any_orthogonal_vector());
    let axes = DMat3::from_cols(x, z.cross(x), z);
    axes.is_finite().then(|| Transform::from_affine(DAffine3::from_mat3(axes)).ok()).flatten()
}

/// y and z swapped, which is a mirror.
fn exchanged() -> Transform {
    let axes = DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::Y);
    Transform::from_affine(DAffine3::from_mat3(axes)).unwrap_or_default()
}

/// Half a turn about z.
fn half_turn() -> Transform {
    Transform::rotate(DVec3::Z, 180.0).unwrap_or_default()
}

/// The mapping of an image to the sphere, by its aspect ratio.
fn environment_mapping(image: &Image, filename: &str, at: SourcePosition) -> Result<EnvironmentMapping> {
    let (width, height) = (image.width(), image.height());
    if width == height {
        return Ok(EnvironmentMapping::EqualArea);
    }
    if width == height.saturating_mul(2) {
        return Ok(EnvironmentMapping::LatitudeLongitude);
    }
    let wrong = Diagnostic::error(format!("{} is no environment map", quoted(filename)));
    let wrong = wrong.found(format!("{width} by {height} pixels"));
    Err(at.wrong(wrong.expected("a square (equal area) or twice as wide as high")))
}

/// The integral of an image over all directions.
fn flux(image: &Image, mapping: EnvironmentMapping) -> f64 {
    let (width, height) = (f64::from(image.width()), f64::from(image.height()));
    let cosine = |y: u32| (PI * f64::from(y) / height).cosine();
    let row = |y: u32| {
        let solid_angle = match mapping {
            EnvironmentMapping::EqualArea => 4.0 * PI / (width * height),
            EnvironmentMapping::LatitudeLongitude => 2.0 * PI * (cosine(y) - cosine(y + 1)) / width,
        };
        (0..image.width()).map(|x| f64::from(image.pixel(x, y).luminance())).sum::<f64>() * solid_angle
    };
    (0..image.height()).map(row).sum()
}

/// The luminous flux of an image that is thrown with this angle between its nearer sides.
fn projected_flux(image: &Image, fov: f64) -> f64 {
    let (width, height) = (f64::from(image.width()), f64::from(image.height()));
    let tangent = (0.5 * fov.to_radians()).tangent();
    let [x, y] = [width, height].map(|side| tangent * side / width.min(height));
    let row = |row: u32| {
        let v = y * (1.0 - 2.0 * (f64::from(row) + 0.5) / height);
        let of_column = |column: u32| {
            let u = x * (2.0 * (f64::from(column) + 0.5) / width - 1.0);
            let squared = 1.0 + u * u + v * v;
            f64::from(image.pixel(column, row).luminance()) / (squared * squared.sqrt())
        };
        (0..image.width()).map(of_column).sum::<f64>()
    };
    (0..image.height()).map(row).sum::<f64>() * 4.0 * x * y / (width * height)
}

/// Illuminance, in units of the image, of a horizontal surface under the upper half of an environment.
fn upper_illuminance(image: &Image, mapping: EnvironmentMapping) -> f64 {
    let (width, height) = (f64::from(image.width()), f64::from(image.height()));
    let mut sum = 0.0;
    for y in 0..image.height() {
        let v = (f64::from(y) + 0.5) / height;
        // The projected part of a row of latitudes above the horizon.
        let edge = |y: u32| (PI * f64::from(y) / height).min(0.5 * PI).sine().powi(2);
        let row = PI * (edge(y + 1) - edge(y)) / width;
        for x in 0..image.width() {
            let u = (f64::from(x) + 0.5) / width;
            let projected = match mapping {
                EnvironmentMapping::EqualArea => 4.0 * PI * equal_area_cos(u, v).max(0.0) / (width * height),
                EnvironmentMapping::LatitudeLongitude => row,
            };
            sum += f64::from(image.pixel(x, y).luminance()) * projected;
        }
    }
    sum
}

/// The height on the unit sphere of a point of the equal-area square (P. Clarberg, "Fast equal-area mapping of the
/// (hemi)sphere using SIMD", Journal of Graphics Tools, 2008).
fn equal_area_cos(u: f64, v: f64) -> f64 {
    let signed = 1.0 - ((2.0 * u - 1.0).abs() + (2.0 * v - 1.0).abs());
    let r = 1.0 - signed.abs();
    (1.0 - r * r).copysign(signed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_uniform_sky_of_one_gives_pi() {
        for (mapping, width) in
            [(EnvironmentMapping::EqualArea, 64), (EnvironmentMapping::LatitudeLongitude, 128)]
        {
            let white = Image::filled(width, 64, Spectrum::WHITE);
            let found = upper_illuminance(&white, mapping);
            assert!((found - PI).abs() < 4e-3, "{mapping:?}: {found}");
            assert!((flux(&white, mapping) - 4.0 * PI).abs() < 1e-6, "{mapping:?}");
        }
    }
}
