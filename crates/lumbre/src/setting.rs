//! Parameters of a description by their names: `material.NAME.PARAM=VALUE`, and those of lights, cameras and the film.

use std::str::FromStr;
use std::sync::Arc;

use lumbre_formats::diagnostic::{nearest_name, number, quoted};
use lumbre_image::Rgb;
use lumbre_math::{DVec3, Transform};
use lumbre_scene::{Camera, CameraKind, FilmDesc, GeometryDesc, LightDesc, SceneDesc, ShapeDesc};
use lumbre_shading::hair::HairColour;
use lumbre_shading::{
    FloatTexture, Material, MaterialKind, Metal, PrincipledParams, Roughness, SpectrumTexture, Texture,
};

use crate::colour;

/// A value for a parameter of a description, of any format. It is parsed from
///
/// - `material.NAME.PARAM=VALUE`, where NAME is the name in the file or the 0-based index; the value replaces a
///   texture;
/// - `light.INDEX.PARAM=VALUE` of lights other than shapes, and `light.area.scale=VALUE` of all shapes that emit;
/// - `camera.NAME.PARAM=VALUE`, or `camera.PARAM=VALUE` of all cameras;
/// - `film.PARAM=VALUE` with the parameters of the scene language, and `film.exposure`, the whole factor of the
///   exposure.
///
/// Values are numbers, colours (one number, three separated by commas, a name such as `red`, or `#rrggbb` in sRGB) or
/// points. `color`, or `colour`, is the main colour of a material (its `reflectance`, `base_color` or `Kd`) and that of
/// a light. The error for an unknown parameter lists the known ones.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Setting {
    of: Owner,
    name: String,
    parameter: String,
    value: String,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Owner {
    Material,
    Light,
    Camera,
    Film,
}

impl FromStr for Setting {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!(
                "found {}; expected material.NAME.PARAM=VALUE, light.INDEX.PARAM=VALUE, camera.PARAM=VALUE or film.PARAM=VALUE",
                quoted(text)
            )
        };
        // Names may contain `=`, values do not.
        let (path, value) = text.rsplit_once('=').ok_or_else(wrong)?;
        let (owner, rest) = path.trim().split_once('.').ok_or_else(wrong)?;
        let (of, is_one) = match owner {
            "material" => (Owner::Material, false),
            "light" => (Owner::Light, false),
            "camera" => (Owner::Camera, true),
            "film" => (Owner::Film, true),
            _ => return Err(wrong()),
        };
        // Names may contain dots, parameters do not.
        let (name, parameter) = match rest.rsplit_once('.') {
            Some(parts) => parts,
            None if is_one => ("", rest),
            None => return Err(wrong()),
        };
        // Either spelling.
        let parameter = parameter.trim().replace("colour", "color");
        let value = value.trim().to_owned();
        if parameter.is_empty() || value.is_empty() || (of == Owner::Film && !name.is_empty()) {
            return Err(wrong());
        }
        Ok(Self { of, name: name.trim().to_owned(), parameter, value })
    }
}

impl Setting {
    /// Sets the parameter.
    ///
    /// # Errors
    /// An unknown name, with the known ones, or a wrong value, with the accepted ones.
    pub fn apply(&self, desc: &mut SceneDesc) -> Result<(), String> {
        match self.of {
            Owner::Material => self.set_material(desc),
            Owner::Light => self.set_light(desc),
            Owner::Camera => self.set_camera(desc),
            Owner::Film => self.set_film(&mut desc.film),
        }
    }

    fn set_film(&self, film: &mut FilmDesc) -> Result<(), String> {
        match &*self.parameter {
            "exposure" => self.set(Slot::Plain(&mut film.exposure, ABOVE_ZERO))?,
            "maxcomponent" | "maxcomponentvalue" => {
                self.set(Slot::Plain(&mut film.max_component, ABOVE_ZERO))?;
            }
            "iso" => {
                let before = film.iso;
                self.set(Slot::Plain(&mut film.iso, ABOVE_ZERO))?;
                film.exposure *= film.iso / before;
            }
            "xresolution" => film.width = Some(self.pixels()?),
            "yresolution" => film.height = Some(self.pixels()?),
            "pixelbounds" => {
                let bounds = self.numbers(Range(0.0, f64::from(u32::MAX)));
                let bounds = bounds.filter(|all| all.iter().all(|v| v.fract() == 0.0)).map(|all| {
                    let [x0, x1, y0, y1] = all.map(|v| v as u32);
                    let clip = |v: u32, size: Option<u32>| size.map_or(v, |size| v.min(size));
                    [clip(x0, film.width), clip(x1, film.width), clip(y0, film.height), clip(y1, film.height)]
                });
                let bounds = bounds.filter(|[x0, x1, y0, y1]| x0 < x1 && y0 < y1);
                let said = "x0,x1,y0,y1 in pixels of the film, such as 0,320,120,240";
                film.pixel_bounds = Some(bounds.ok_or_else(|| self.refused(said))?);
            }
            "cropwindow" => {
                let window = self.numbers(UNIT).filter(|[x0, x1, y0, y1]| x0 < x1 && y0 < y1);
                let said = "x0,x1,y0,y1 from 0 to 1, such as 0,0.5,0.25,1";
                film.crop_window = Some(window.ok_or_else(|| self.refused(said))?);
            }
            "savefp16" => {
                let value = self.value.parse::<bool>();
                film.single_precision = !value.map_err(|_| self.refused("true or false"))?;
            }
            "filename" => film.filename = Some(self.value.clone()),
            _ => return Err(self.unknown("the film", &FILM_PARAMETERS)),
        }
        Ok(())
    }

    fn pixels(&self) -> Result<u32, String> {
        self.value.parse().ok().filter(|&n| n > 0).ok_or_else(|| self.refused("a whole number from 1"))
    }

    fn set_material(&self, desc: &mut SceneDesc) -> Result<(), String> {
        let named = |i: usize| desc.materials[i].name.as_deref() == Some(&*self.name);
        let mut found: Vec<usize> = (0..desc.materials.len()).filter(|&i| named(i)).collect();
        if found.is_empty() {
            found.extend(self.name.parse().ok().filter(|i: &usize| *i < desc.materials.len()));
        }
        if found.is_empty() {
            let names = desc.materials.iter().enumerate();
            let names: Vec<String> =
                names.map(|(i, m)| m.name.clone().unwrap_or_else(|| i.to_string())).collect();
            return Err(self.missing("material", &names));
        }
        for i in found {
            let old = desc.materials[i].material.clone();
            let mut new = Material::clone(&old);
            let owner = format!("material {} ({})", quoted(&self.name), new.kind.name());
            let (mut known, mut result) = (Vec::new(), None);
            each_material_slot(&mut new.kind, &mut |names, slot| {
                known.push(names[0]);
                if names.contains(&&*self.parameter) {
                    result = Some(self.set(slot));
                }
            });
            result.unwrap_or_else(|| Err(self.unknown(&owner, &known)))?;
            let new = Arc::new(new);
            for material in &mut desc.materials {
                replace(&mut material.material, &old, &new);
            }
        }
        Ok(())
    }

    fn set_light(&self, desc: &mut SceneDesc) -> Result<(), String> {
        if self.name == "area" {
            if self.parameter != "scale" {
                return Err(self.unknown("light area", &["scale"]));
            }
            let mut factor = 1.0;
            self.set(Slot::Plain(&mut factor, FROM_ZERO))?;
            let in_objects = desc.objects.iter_mut().flat_map(|object| &mut object.shapes);
            for shape in desc.shapes.iter_mut().chain(in_objects) {
                scale_emission(shape, factor);
            }
            return Ok(());
        }
        let index = self.name.parse().ok().filter(|i: &usize| *i < desc.lights.len());
        let Some(index) = index else {
            let mut names: Vec<String> = (0..desc.lights.len()).map(|i| i.to_string()).collect();
            names.push("area".to_owned());
            return Err(self.missing("light", &names));
        };
        let mut light = &mut desc.lights[index];
        let is_color = self.parameter == "color";
        if is_color || ["intensity", "irradiance", "radiance"].contains(&&*self.parameter) {
            // The colour replaces the spectrum.
            *light = light.bare().clone();
        }
        while let LightDesc::Moving { light: inner, .. } | LightDesc::Spectral { light: inner, .. } = light {
            light = inner;
        }
        let known: &[&str] = match light {
            LightDesc::Point { .. } => &["from", "intensity", "scale"],
            LightDesc::Spot { .. } => &["from", "intensity", "coneangle", "conedeltaangle", "scale"],
            LightDesc::Goniometric { .. } => &["from", "intensity", "scale"],
            LightDesc::Projection { .. } => &["from", "intensity", "fov", "scale"],
            LightDesc::Distant { .. } => &["irradiance", "scale"],
            LightDesc::Disc { .. } => &["irradiance", "angle", "scale"],
            LightDesc::Infinite { .. } | LightDesc::Portal { .. } => &["radiance", "scale"],
            LightDesc::Pov(_) => &["scale"],
            LightDesc::Moving { .. } | LightDesc::Spectral { .. } => &[],
        };
        if self.parameter == "scale" {
            let mut factor = 1.0;
            self.set(Slot::Plain(&mut factor, FROM_ZERO))?;
            match light {
                LightDesc::Point { intensity: light, .. }
                | LightDesc::Spot { intensity: light, .. }
                | LightDesc::Goniometric { intensity: light, .. }
                | LightDesc::Projection { intensity: light, .. }
                | LightDesc::Distant { irradiance: light, .. }
                | LightDesc::Disc { irradiance: light, .. }
                | LightDesc::Infinite { radiance: light, .. }
                | LightDesc::Portal { radiance: light, .. } => *light *= factor,
                LightDesc::Pov(light) => Arc::make_mut(light).colour *= factor,
                LightDesc::Moving { .. } | LightDesc::Spectral { .. } => {}
            }
            return Ok(());
        }
        if self.parameter == "from"
            && let LightDesc::Spot { world_from_light, .. }
            | LightDesc::Goniometric { world_from_light, .. }
            | LightDesc::Projection { world_from_light, .. } = light
        {
            let before = world_from_light.point(DVec3::ZERO);
            let mut from = before;
            self.set(Slot::Point(&mut from))?;
            *world_from_light = Transform::translate(from - before) * *world_from_light;
            return Ok(());
        }
        let parameter = match light {
            _ if !is_color => &*self.parameter,
            LightDesc::Distant { .. } | LightDesc::Disc { .. } => "irradiance",
            LightDesc::Infinite { .. } | LightDesc::Portal { .. } => "radiance",
            _ => "intensity",
        };
        let slot = match (light, parameter) {
            (LightDesc::Point { from, .. }, "from") => Slot::Point(from),
            (
                LightDesc::Point { intensity, .. }
                | LightDesc::Spot { intensity, .. }
                | LightDesc::Goniometric { intensity, .. }
                | LightDesc::Projection { intensity, .. },
                "intensity",
            ) => Slot::Light(intensity),
            (LightDesc::Disc { angle, .. }, "angle") => Slot::Double(angle, ANGLE),
            (LightDesc::Spot { cone_angle, .. }, "coneangle") => Slot::Plain(cone_angle, ANGLE),
            (LightDesc::Projection { fov, .. }, "fov") => Slot::Plain(fov, ANGLE),
            (LightDesc::Spot { cone_delta_angle, .. }, "conedeltaangle") => {
                Slot::Plain(cone_delta_angle, ANGLE)
            }
            (LightDesc::Distant { irradiance, .. } | LightDesc::Disc { irradiance, .. }, "irradiance") => {
                Slot::Light(irradiance)
            }
            (LightDesc::Infinite { radiance, .. } | LightDesc::Portal { radiance, .. }, "radiance") => {
                Slot::Light(radiance)
            }
            _ => return Err(self.unknown(&format!("light {index}"), known)),
        };
        self.set(slot)
    }

    fn set_camera(&self, desc: &mut SceneDesc) -> Result<(), String> {
        if desc.cameras.is_empty() {
            return Err("the scene has no camera: use --fov and the other options of the view".to_owned());
        }
        let by_name = |camera: &Camera| camera.name.as_deref() == Some(&*self.name);
        let has_name = desc.cameras.iter().any(by_name);
        let index = self.name.parse().ok().filter(|_| !has_name);
        let mut is_found = false;
        for (i, camera) in desc.cameras.iter_mut().enumerate() {
            if !(self.name.is_empty() || by_name(camera) || index == Some(i)) {
                continue;
            }
            is_found = true;
            let (known, kind): (&[&str], &str) = match camera.kind {
                CameraKind::Perspective { .. } => (&["fov", "lensradius", "focaldistance"], "perspective"),
                CameraKind::Orthographic { .. } => (&["lensradius", "focaldistance"], "orthographic"),
                CameraKind::Spherical { .. } => (&[], "spherical"),
                CameraKind::Realistic(_) => (&[], "realistic"),
                CameraKind::Mesh(_) => (&[], "mesh"),
            };
            let slot = match (&mut camera.kind, &*self.parameter) {
                (CameraKind::Perspective { fov, .. }, "fov") => Slot::Double(fov, Range(0.001, 179.0)),
                (
                    CameraKind::Perspective { lens_radius, .. }
                    | CameraKind::Orthographic { lens_radius, .. },
                    "lensradius",
                ) => Slot::Double(lens_radius, FROM_ZERO),
                (
                    CameraKind::Perspective { focal_distance, .. }
                    | CameraKind::Orthographic { focal_distance, .. },
                    "focaldistance",
                ) => Slot::Double(focal_distance, ABOVE_ZERO),
                _ => return Err(self.unknown(&format!("the {kind} camera"), known)),
            };
            self.set(slot)?;
        }
        if is_found {
            return Ok(());
        }
        let names = desc.cameras.iter().enumerate();
        let names: Vec<String> =
            names.map(|(i, c)| c.name.clone().unwrap_or_else(|| i.to_string())).collect();
        Err(self.missing("camera", &names))
    }

    fn missing(&self, noun: &str, names: &[String]) -> String {
        /// Maximum names in a message.
        const MAX_NAMES: usize = 20;
        let mut known: Vec<String> = names.iter().take(MAX_NAMES).map(|name| quoted(name)).collect();
        if names.len() > MAX_NAMES {
            known.push("…".to_owned());
        }
        let tip = nearest_name(&self.name, names.iter().map(String::as_str));
        let tip = tip.map_or_else(String::new, |near| format!("; did you mean {}?", quoted(near)));
        format!("there is no {noun} {} (expected {}{tip})", quoted(&self.name), known.join(", "))
    }

    fn unknown(&self, owner: &str, known: &[&str]) -> String {
        let expected = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
        let tip = nearest_name(&self.parameter, known.iter().copied());
        let tip = tip.map_or_else(String::new, |near| format!("; did you mean {near}?"));
        format!("{owner} has no parameter {} (expected {expected}{tip})", quoted(&self.parameter))
    }

    fn set(&self, slot: Slot<'_>) -> Result<(), String> {
        match slot {
            Slot::Colour(texture) => *texture = Arc::new(Texture::Constant(self.colour(UNIT)?)),
            Slot::Light(light) => *light = self.colour(FROM_ZERO)?,
            Slot::Number(texture, range) => {
                *texture = Arc::new(Texture::Constant(self.number(range)? as f32))
            }
            Slot::Roughness(roughness) => {
                let alpha: Arc<FloatTexture> = Arc::new(Texture::Constant(self.number(FROM_ZERO)? as f32));
                (roughness.u, roughness.v) = (alpha.clone(), alpha);
            }
            Slot::Plain(value, range) => *value = self.number(range)? as f32,
            Slot::Double(value, range) => *value = self.number(range)?,
            Slot::Point(point) => {
                let [x, y, z] = self
                    .numbers(Range(-1e30, 1e30))
                    .ok_or_else(|| self.refused("three numbers, such as 1,-2.5,3"))?;
                *point = DVec3::new(x, y, z);
            }
        }
        Ok(())
    }

    fn number(&self, range: Range) -> Result<f64, String> {
        self.numbers(range).map(|[x]| x).ok_or_else(|| self.refused(&range.said()))
    }

    fn colour(&self, range: Range) -> Result<Rgb, String> {
        if let Some([r, g, b]) = self.numbers(range) {
            return Ok(Rgb::new(r as f32, g as f32, b as f32));
        }
        if let Some([grey]) = self.numbers(range) {
            return Ok(Rgb::splat(grey as f32));
        }
        if let Some(colour) = colour(&self.value) {
            return Ok(colour);
        }
        Err(self.refused(&format!("{}, three of them or a colour such as red or #e8e0d8", range.said())))
    }

    /// `N` numbers in the range, if the value is a list of them.
    fn numbers<const N: usize>(&self, Range(low, high): Range) -> Option<[f64; N]> {
        let numbers: Vec<f64> =
            self.value.split(',').map(|part| part.trim().parse().ok()).collect::<Option<_>>()?;
        numbers.try_into().ok().filter(|numbers: &[f64; N]| numbers.iter().all(|v| low <= *v && *v <= high))
    }

    fn refused(&self, expected: &str) -> String {
        format!(
            "wrong value of {} (found {}; expected {expected})",
            quoted(&self.parameter),
            quoted(&self.value)
        )
    }
}

/// The parameters of the film: those of the scene language, and the whole factor of the exposure.
const FILM_PARAMETERS: [&str; 9] = [
    "exposure",
    "iso",
    "maxcomponentvalue",
    "xresolution",
    "yresolution",
    "pixelbounds",
    "cropwindow",
    "savefp16",
    "filename",
];

/// A closed range: low, high.
#[derive(Clone, Copy)]
pub(crate) struct Range(pub(crate) f64, pub(crate) f64);

/// Numbers above 0 that f32 can hold.
const ABOVE_ZERO: Range = Range(1e-30, 1e30);
const FROM_ZERO: Range = Range(0.0, 1e30);
const UNIT: Range = Range(0.0, 1.0);
const ANGLE: Range = Range(0.0, 180.0);
const INDEX: Range = Range(0.1, 10.0);
const ASYMMETRY: Range = Range(-0.99, 0.99);

impl Range {
    fn said(self) -> String {
        match self {
            Self(low, 1e30) if low > 0.0 => "a number above 0".to_owned(),
            Self(low, 1e30) => format!("a number from {} up", number(low)),
            Self(low, high) => format!("a number from {} to {}", number(low), number(high)),
        }
    }
}

/// The place of a value.
pub(crate) enum Slot<'a> {
    /// In [0, 1].
    Colour(&'a mut Arc<SpectrumTexture>),
    /// From 0 up.
    Light(&'a mut Rgb),
    Number(&'a mut Arc<FloatTexture>, Range),
    /// In both directions.
    Roughness(&'a mut Roughness),
    Plain(&'a mut f32, Range),
    Double(&'a mut f64, Range),
    Point(&'a mut DVec3),
}

/// The names of the main colour of most materials.
const REFLECTANCE: [&str; 2] = ["reflectance", "color"];

/// Calls `visit` for each parameter of a material that settings change, with its names: that of the scene language or
/// of [`PrincipledParams`], then aliases.
///
/// This is the only list of these parameters and their ranges: `-D`, the viewer and Python read it.
pub(crate) fn each_material_slot(
    kind: &mut MaterialKind,
    visit: &mut dyn FnMut(&'static [&'static str], Slot<'_>),
) {
    use MaterialKind as Kind;
    match kind {
        Kind::Diffuse { reflectance } => visit(&REFLECTANCE, Slot::Colour(reflectance)),
        Kind::Conductor { roughness, .. } => roughness_slots(roughness, visit),
        Kind::ConductorReflectance { reflectance, roughness } => {
            visit(&REFLECTANCE, Slot::Colour(reflectance));
            roughness_slots(roughness, visit);
        }
        Kind::Dielectric { eta, roughness } => {
            visit(&["eta"], Slot::Plain(eta, INDEX));
            roughness_slots(roughness, visit);
        }
        Kind::ThinDielectric { eta } => visit(&["eta"], Slot::Plain(eta, INDEX)),
        Kind::CoatedDiffuse { reflectance, roughness, thickness, eta, g, albedo, .. } => {
            visit(&REFLECTANCE, Slot::Colour(reflectance));
            roughness_slots(roughness, visit);
            visit(&["thickness"], Slot::Number(thickness, FROM_ZERO));
            visit(&["eta"], Slot::Plain(eta, INDEX));
            visit(&["g"], Slot::Number(g, ASYMMETRY));
            visit(&["albedo"], Slot::Colour(albedo));
        }
        Kind::CoatedConductor {
            metal,
            roughness,
            interface_roughness,
            interface_eta,
            thickness,
            g,
            albedo,
            ..
        } => {
            if let Metal::Reflectance(reflectance) = metal {
                visit(&REFLECTANCE, Slot::Colour(reflectance));
            }
            visit(&["roughness"], Slot::Roughness(roughness));
            visit(&["interface_roughness"], Slot::Roughness(interface_roughness));
            visit(&["interface_eta"], Slot::Plain(interface_eta, INDEX));
            visit(&["thickness"], Slot::Number(thickness, FROM_ZERO));
            visit(&["g"], Slot::Number(g, ASYMMETRY));
            visit(&["albedo"], Slot::Colour(albedo));
        }
        Kind::DiffuseTransmission { reflectance, transmittance, scale } => {
            visit(&REFLECTANCE, Slot::Colour(reflectance));
            visit(&["transmittance"], Slot::Colour(transmittance));
            visit(&["scale"], Slot::Plain(scale, FROM_ZERO));
        }
        Kind::Principled(params) => principled_slots(params, visit),
        Kind::Uber(params) => {
            visit(&["Kd", "color"], Slot::Colour(&mut params.kd));
            visit(&["Ks"], Slot::Colour(&mut params.ks));
            visit(&["Kr"], Slot::Colour(&mut params.kr));
            visit(&["Kt"], Slot::Colour(&mut params.kt));
            visit(&["opacity"], Slot::Colour(&mut params.opacity));
            visit(&["index", "eta"], Slot::Number(&mut params.eta, INDEX));
            roughness_slots(&mut params.roughness, visit);
        }
        Kind::Hair(params) => {
            match &mut params.colour {
                HairColour::Absorption(_) => {}
                HairColour::Reflectance(colour) => visit(&REFLECTANCE, Slot::Colour(colour)),
                HairColour::Melanin { eumelanin, pheomelanin } => {
                    visit(&["eumelanin"], Slot::Number(eumelanin, FROM_ZERO));
                    visit(&["pheomelanin"], Slot::Number(pheomelanin, FROM_ZERO));
                }
            }
            visit(&["eta"], Slot::Number(&mut params.eta, INDEX));
            visit(&["beta_m"], Slot::Number(&mut params.beta_m, UNIT));
            visit(&["beta_n"], Slot::Number(&mut params.beta_n, UNIT));
            visit(&["alpha"], Slot::Number(&mut params.alpha, Range(-90.0, 90.0)));
        }
        Kind::Mix { amount, .. } => visit(&["amount"], Slot::Number(amount, UNIT)),
        Kind::Subsurface(params) => {
            visit(&["eta"], Slot::Plain(&mut params.eta, INDEX));
            roughness_slots(&mut params.roughness, visit);
            visit(&["g"], Slot::Plain(&mut params.asymmetry, ASYMMETRY));
            visit(&["scale"], Slot::Plain(&mut params.scale, FROM_ZERO));
        }
        Kind::Measured(_) | Kind::Pov(_) | Kind::Interface => {}
    }
}

fn roughness_slots(roughness: &mut Roughness, visit: &mut dyn FnMut(&'static [&'static str], Slot<'_>)) {
    visit(&["roughness"], Slot::Roughness(roughness));
    visit(&["uroughness"], Slot::Number(&mut roughness.u, FROM_ZERO));
    visit(&["vroughness"], Slot::Number(&mut roughness.v, FROM_ZERO));
}

fn principled_slots(params: &mut PrincipledParams, visit: &mut dyn FnMut(&'static [&'static str], Slot<'_>)) {
    visit(&["base_color", "color"], Slot::Colour(&mut params.base_color));
    visit(&["metallic"], Slot::Number(&mut params.metallic, UNIT));
    visit(&["roughness"], Slot::Number(&mut params.roughness, UNIT));
    visit(&["anisotropy", "anisotropic"], Slot::Number(&mut params.anisotropy, UNIT));
    visit(&["ior", "eta"], Slot::Plain(&mut params.ior, Range(1.0, 10.0)));
    visit(&["specular"], Slot::Number(&mut params.specular, UNIT));
    visit(&["transmission", "spec_trans"], Slot::Number(&mut params.transmission, UNIT));
    visit(&["dispersion"], Slot::Plain(&mut params.dispersion, Range(0.0, 100.0)));
    visit(&["diffuse_transmission", "diff_trans"], Slot::Number(&mut params.diffuse_transmission, UNIT));
    visit(&["diffuse_transmission_color"], Slot::Colour(&mut params.diffuse_transmission_color));
    visit(&["clearcoat"], Slot::Number(&mut params.clearcoat, UNIT));
    visit(&["clearcoat_roughness"], Slot::Number(&mut params.clearcoat_roughness, UNIT));
    visit(&["clearcoat_color", "coat_color"], Slot::Colour(&mut params.clearcoat_color));
    visit(&["clearcoat_ior", "coat_ior"], Slot::Plain(&mut params.clearcoat_ior, Range(1.0, 4.0)));
    visit(&["sheen_color"], Slot::Colour(&mut params.sheen_color));
    visit(&["sheen_roughness"], Slot::Number(&mut params.sheen_roughness, UNIT));
    visit(&["iridescence"], Slot::Number(&mut params.iridescence, UNIT));
    visit(&["iridescence_ior"], Slot::Plain(&mut params.iridescence_ior, Range(1.0, 10.0)));
    visit(&["iridescence_thickness"], Slot::Number(&mut params.iridescence_thickness, FROM_ZERO));
}

/// Puts a material in the place of another, also in mixtures.
fn replace(material: &mut Arc<Material>, old: &Arc<Material>, new: &Arc<Material>) {
    if Arc::ptr_eq(material, old) {
        *material = new.clone();
    } else if contains(material, old)
        && let MaterialKind::Mix { materials, .. } = &mut Arc::make_mut(material).kind
    {
        materials.iter_mut().for_each(|part| replace(part, old, new));
    }
}

fn contains(material: &Arc<Material>, part: &Arc<Material>) -> bool {
    match &material.kind {
        MaterialKind::Mix { materials, .. } => {
            materials.iter().any(|inner| Arc::ptr_eq(inner, part) || contains(inner, part))
        }
        _ => false,
    }
}

fn scale_emission(shape: &mut ShapeDesc, factor: f32) {
    if let Some(light) = &mut shape.area_light {
        // With a power, the radiance is only the colour.
        match &mut light.power {
            Some(power) => *power *= factor,
            None => light.radiance *= factor,
        }
    }
    if let GeometryDesc::Csg(csg) = &mut shape.geometry {
        for operand in &mut csg.operands {
            Arc::make_mut(operand).iter_mut().for_each(|shape| scale_emission(shape, factor));
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use lumbre_formats::{Budget, Diagnostics, ReadOptions, open_scenes, pbrt};
    use lumbre_shading::Spectrum;

    use super::*;

    fn scene(world: &str) -> SceneDesc {
        let text =
            format!("LookAt 0 -9 2 0 0 0 0 0 1 Camera \"perspective\" \"float fov\" 50 WorldBegin {world}");
        pbrt::read_bytes("a.pbrt", text.as_bytes(), None, &Budget::default(), &mut Diagnostics::new())
            .unwrap()
    }

    fn set(desc: &mut SceneDesc, text: &str) -> Result<(), String> {
        text.parse::<Setting>()?.apply(desc)
    }

    fn diffuse(desc: &SceneDesc, name: &str) -> Spectrum {
        let named = desc.materials.iter().find(|m| m.name.as_deref() == Some(name)).unwrap();
        match &named.material.kind {
            MaterialKind::Diffuse { reflectance } => match **reflectance {
                Texture::Constant(colour) => colour,
                _ => panic!("a texture"),
            },
            _ => panic!("not diffuse"),
        }
    }

    #[test]
    fn the_main_colour_of_everything_is_its_color_by_name_or_code() {
        for (material, names) in [
            ("diffuse", &["reflectance"][..]),
            ("coateddiffuse", &["reflectance", "albedo"]),
            ("diffusetransmission", &["reflectance", "transmittance"]),
            ("principled", &["base_color", "base_colour", "sheen_colour", "diffuse_transmission_color"]),
            ("uber", &["Kd", "Ks", "Kr", "Kt", "opacity"]),
        ] {
            let named = format!("MakeNamedMaterial \"m\" \"string type\" \"{material}\"");
            let mut desc = scene(&format!("{named} NamedMaterial \"m\" Shape \"sphere\""));
            for name in names.iter().chain(&["color", "colour"]) {
                for value in ["red", "#ff8800", "#F80", "0.25", "0.1,0.2,0.3"] {
                    assert_eq!(
                        set(&mut desc, &format!("material.m.{name}={value}")),
                        Ok(()),
                        "{material} {name}"
                    );
                }
                assert!(set(&mut desc, &format!("material.m.{name}=reddish")).is_err());
            }
        }
        let mut desc =
            scene("MakeNamedMaterial \"m\" \"string type\" \"diffuse\" NamedMaterial \"m\" Shape \"sphere\"");
        set(&mut desc, "material.m.colour=#ff0000").unwrap();
        assert_eq!(diffuse(&desc, "m"), Spectrum::new(1.0, 0.0, 0.0));
        let lights = ["point", "spot", "distant", "infinite"];
        let mut desc = scene(&lights.map(|light| format!("LightSource \"{light}\"")).concat());
        for (i, light) in lights.iter().enumerate() {
            assert_eq!(set(&mut desc, &format!("light.{i}.colour=lime")), Ok(()), "{light}");
            let (LightDesc::Point { intensity: colour, .. }
            | LightDesc::Spot { intensity: colour, .. }
            | LightDesc::Distant { irradiance: colour, .. }
            | LightDesc::Infinite { radiance: colour, .. }) = &desc.lights[i]
            else {
                panic!("{light}")
            };
            assert_eq!(*colour, Rgb::new(0.0, 1.0, 0.0), "{light}");
        }
        let refused = set(&mut desc, "light.0.scale=red").unwrap_err();
        assert!(refused.contains("a number from 0 up"), "{refused}");
    }

    #[test]
    fn a_material_changes_wherever_it_is_used() {
        let mut desc = scene(
            "MakeNamedMaterial \"the.wood\" \"string type\" \"diffuse\" \"rgb reflectance\" [.2 .3 .4]
            MakeNamedMaterial \"tin\" \"string type\" \"conductor\" \"float roughness\" 0.1
            MakeNamedMaterial \"both\" \"string type\" \"mix\" \"string materials\" [\"the.wood\" \"tin\"]",
        );
        set(&mut desc, "material.the.wood.reflectance=0.5,0.25,0.125").unwrap();
        let expected = Rgb::new(0.5, 0.25, 0.125);
        assert_eq!(diffuse(&desc, "the.wood"), expected);
        let both = desc.materials.iter().find(|m| m.name.as_deref() == Some("both")).unwrap();
        let MaterialKind::Mix { materials, .. } = &both.material.kind else { panic!() };
        let MaterialKind::Diffuse { reflectance } = &materials[0].kind else { panic!() };
        assert!(matches!(**reflectance, Texture::Constant(colour) if colour == expected));
        set(&mut desc, "material.the.wood.reflectance = #ff0000").unwrap();
        assert_eq!(diffuse(&desc, "the.wood"), Rgb::new(1.0, 0.0, 0.0));
        set(&mut desc, "material.tin.roughness=0.375").unwrap();
        let tin = desc.materials.iter().find(|m| m.name.as_deref() == Some("tin")).unwrap();
        let MaterialKind::Conductor { roughness, .. } = &tin.material.kind else { panic!() };
        assert!(
            matches!((&*roughness.u, &*roughness.v), (Texture::Constant(u), Texture::Constant(v)) if *u == 0.375 && *v == 0.375)
        );
    }

    #[test]
    fn what_is_not_there_is_answered_with_what_is() {
        let mut desc = scene(
            "MakeNamedMaterial \"wood\" \"string type\" \"diffuse\" LightSource \"point\" Shape \"sphere\"",
        );
        for (text, expected) in [
            ("material.wod.reflectance=1", "did you mean \"wood\"?"),
            ("material.wood.reflectence=1", "did you mean reflectance?"),
            ("material.wood.reflectance=2", "a number from 0 to 1"),
            ("material.wood.reflectance=1,2", "three of them"),
            ("light.3.intensity=1", "there is no light \"3\" (expected \"0\", \"area\")"),
            ("light.0.radiance=1", "expected from, intensity, scale"),
            ("camera.fov=-3", "a number from 0.001 to 179"),
            ("camera.left.fov=30", "there is no camera \"left\" (expected \"0\")"),
            ("film.izo=3", "expected exposure, iso, maxcomponentvalue"),
            ("film.iso=0", "expected a number above 0"),
            ("film.xresolution=0", "a whole number from 1"),
            ("film.cropwindow=0.5,0.5,0,1", "x0,x1,y0,y1 from 0 to 1"),
            ("film.pixelbounds=0,5.5,0,1", "x0,x1,y0,y1 in pixels"),
            ("film.pixelbounds=5000,6000,0,1", "x0,x1,y0,y1 in pixels"),
            ("film.savefp16=1", "true or false"),
            ("wood.reflectance=1", "expected material.NAME.PARAM=VALUE"),
            ("material.reflectance=1", "expected material.NAME.PARAM=VALUE"),
            ("material.wood.reflectance", "expected material.NAME.PARAM=VALUE"),
        ] {
            let said = set(&mut desc, text).unwrap_err();
            assert!(said.contains(expected), "{text}: {said}");
        }
    }

    #[test]
    fn lights_cameras_and_the_film_are_set() {
        let mut desc = scene(
            "LightSource \"point\" \"rgb I\" [1 2 3] AreaLightSource \"diffuse\" \"rgb L\" [2 2 2] Shape \"sphere\"",
        );
        set(&mut desc, "light.0.from=1,-2,3").unwrap();
        set(&mut desc, "light.0.scale=2.5").unwrap();
        set(&mut desc, "light.area.scale=0.5").unwrap();
        set(&mut desc, "camera.fov=35").unwrap();
        set(&mut desc, "camera.0.lensradius=0.25").unwrap();
        set(&mut desc, "film.exposure=2").unwrap();
        let mut spot = desc.clone();
        spot.lights[0] = LightDesc::Spot {
            world_from_light: Transform::translate(DVec3::ONE) * Transform::rotate(DVec3::Y, 30.0).unwrap(),
            intensity: Rgb::splat(1.0),
            cone_angle: 30.0,
            cone_delta_angle: 5.0,
        };
        let axis = |desc: &SceneDesc| match &desc.lights[0] {
            LightDesc::Spot { world_from_light: map, .. } => (map.point(DVec3::ZERO), map.vector(DVec3::Z)),
            _ => panic!(),
        };
        let before = axis(&spot);
        set(&mut spot, "light.0.from=4,-2,3").unwrap();
        assert!((before.0 - DVec3::ONE).length() < 1e-12);
        assert!((axis(&spot).0 - DVec3::new(4.0, -2.0, 3.0)).length() < 1e-12);
        assert_eq!(axis(&spot).1, before.1, "it still points there");
        let LightDesc::Point { from, intensity } = &desc.lights[0] else { panic!() };
        assert_eq!((*from, *intensity), (DVec3::new(1.0, -2.0, 3.0), Rgb::new(2.5, 5.0, 7.5)));
        let light = desc.shapes[0].area_light.as_ref().unwrap();
        assert!(
            (light.radiance.g
                / scene("AreaLightSource \"diffuse\" \"rgb L\" [2 2 2] Shape \"sphere\"").shapes[0]
                    .area_light
                    .as_ref()
                    .unwrap()
                    .radiance
                    .g
                - 0.5)
                .abs()
                < 1e-6
        );
        let CameraKind::Perspective { fov, lens_radius, .. } = desc.cameras[0].kind else { panic!() };
        assert_eq!((fov, lens_radius, desc.film.exposure), (35.0, 0.25, 2.0));
    }

    #[test]
    fn every_parameter_of_a_film_is_set() {
        let film_of = |settings: &[&str]| {
            let mut desc = scene("Shape \"sphere\"");
            (desc.film.iso, desc.film.exposure) = (50.0, 3.0);
            settings.iter().for_each(|text| set(&mut desc, text).unwrap());
            desc.film
        };
        // The shutter's share of the exposure stays.
        let film = film_of(&["film.iso=200"]);
        assert_eq!((film.iso, film.exposure), (200.0, 12.0));
        assert_eq!(film_of(&["film.iso=200", "film.iso=50"]).exposure, 3.0);
        let film = film_of(&["film.xresolution=300", "film.yresolution=200", "film.maxcomponentvalue=7"]);
        assert_eq!((film.width, film.height, film.max_component), (Some(300), Some(200), 7.0));
        let film = film_of(&[
            "film.xresolution=300",
            "film.pixelbounds=10,999,20,40",
            "film.cropwindow=0,0.5,0.25,1",
        ]);
        assert_eq!(film.pixel_bounds, Some([10, 300, 20, 40]));
        assert_eq!(film.crop_window, Some([0.0, 0.5, 0.25, 1.0]));
        let film = film_of(&["film.savefp16=false", "film.filename=a b.exr"]);
        assert_eq!((film.single_precision, film.filename.as_deref()), (true, Some("a b.exr")));
        assert!(!film_of(&["film.savefp16=true"]).single_precision);
        for name in FILM_PARAMETERS {
            let said = set(&mut scene("Shape \"sphere\""), &format!("film.{name}=")).unwrap_err();
            assert!(said.contains("expected material.NAME.PARAM=VALUE"), "{said}");
            let said = set(&mut scene("Shape \"sphere\""), &format!("film.{name}=?"));
            assert!(name == "filename" || said.unwrap_err().contains("wrong value"), "{name}");
        }
    }

    #[test]
    fn every_kind_of_material_has_the_parameters_it_lists() {
        let plain = "MakeNamedMaterial \"a\" \"string type\" \"diffuse\"";
        for kind in MaterialKind::NAMES {
            let more = match kind {
                // It has a file, and no parameters that can be set.
                "measured" => continue,
                "mix" => "\"string materials\" [\"a\" \"a\"]",
                _ => "",
            };
            let desc = scene(&format!("{plain} MakeNamedMaterial \"m\" \"string type\" \"{kind}\" {more}"));
            let material = desc.materials.iter().find(|m| m.name.as_deref() == Some("m")).unwrap();
            let mut names = Vec::new();
            each_material_slot(&mut material.material.kind.clone(), &mut |all, _| names.extend(all));
            assert_eq!(names.is_empty(), kind == "interface", "{kind}");
            for name in names {
                let said = set(&mut desc.clone(), &format!("material.m.{name}=0.7"));
                assert!(
                    said.is_ok()
                        || ["ior", "eta", "iridescence_ior", "clearcoat_ior", "coat_ior"].contains(&name),
                    "{name}: {said:?}"
                );
                assert!(set(&mut desc.clone(), &format!("material.m.{name}=1.25e31")).is_err(), "{name}");
            }
        }
    }

    #[test]
    fn materials_of_other_formats_have_the_same_parameters() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("a.mtl"), "newmtl red\nKd 1 0 0\n").unwrap();
        let path = folder.path().join("a.obj");
        std::fs::write(&path, "mtllib a.mtl\nusemtl red\nv 0 0 0\nv 2 0 0\nv 0 3 0\nf 1 2 3\n").unwrap();
        let (mut desc, _) = open_scenes(&[Path::new(&path)], &ReadOptions::default()).unwrap();
        set(&mut desc, "material.red.reflectance=0,0.5,0").unwrap();
        assert_eq!(diffuse(&desc, "red"), Rgb::new(0.0, 0.5, 0.0));
    }
}
