//! Materials, with those of pbrt-v3 upgraded.

use std::sync::Arc;

use lumbre_image::Encoding;
use lumbre_math::Vec2;
use lumbre_scene::MaterialId;
use lumbre_shading::hair::{HairColour, HairParams};
use lumbre_shading::medium::{preset, preset_names};
use lumbre_shading::spectrum::conductor_rgb;
use lumbre_shading::subsurface::{Inside, SubsurfaceParams};
use lumbre_shading::uber::UberParams;
use lumbre_shading::{
    ImageFilter, ImageTexture, Mapping2d, Material, MaterialKind, Metal, NamedSpectrum, Roughness, Spectrum,
    SpectrumTexture, SpectrumValue, Texture, Wrap,
};

use super::convert::{Converter, FloatArc, Known, SpectrumArc, file_fault};
use super::params::{Params, Type, Values};
use super::source::{Result, SourcePosition};
use super::textures::{SpectrumUse, single};
use crate::diagnostic::quoted;
use crate::{Diagnostic, Input, measured};

/// The material types: those of pbrt-v4, `principled` and `openpbr`.
pub(super) const KNOWN: [&str; 14] = [
    "diffuse",
    "coateddiffuse",
    "coatedconductor",
    "conductor",
    "dielectric",
    "thindielectric",
    "diffusetransmission",
    "mix",
    "interface",
    "hair",
    "measured",
    "subsurface",
    "principled",
    "openpbr",
];

/// The maximal depth of nested mixtures.
const MAX_MIX_DEPTH: usize = 64;

impl Converter<'_, '_> {
    /// The current material from here on; `None` for an interface.
    pub fn material(&mut self, ty: &str, params: Params) -> Result<Option<MaterialId>> {
        if self.must_wait(ty, &params) {
            let id = self.add_material(None, None, 1, params.spot)?;
            self.keep(params.bytes(), "materials", params.spot)?;
            self.waiting.insert(id.0);
            self.materials_later.push((id, ty.to_owned(), params));
            return Ok(Some(id));
        }
        let (material, depth) = self.build_material(ty, &params)?;
        self.done(&params);
        if matches!(material.kind, MaterialKind::Interface) {
            return Ok(None);
        }
        Ok(Some(self.add_material(None, Some(material), depth, params.spot)?))
    }

    pub fn named_material(&mut self, name: &str, at: SourcePosition, params: Params) -> Result<()> {
        let id = self.material_named(name, at)?;
        if self.materials[id.0 as usize].material.is_some() {
            return Err(at.error(format!("material {} is defined twice", quoted(name))));
        }
        let Some(ty) = params.string("type")?.map(str::to_owned) else {
            return Err(params.spot.error(format!("material {} has no \"string type\"", quoted(name))));
        };
        if self.must_wait(&ty, &params) {
            if self.is_waiting(id) {
                return Err(at.error(format!("material {} is defined twice", quoted(name))));
            }
            self.keep(params.bytes(), "materials", params.spot)?;
            self.waiting.insert(id.0);
            self.materials_later.push((id, ty, params));
            return Ok(());
        }
        let (material, depth) = self.build_material(&ty, &params)?;
        self.done(&params);
        let slot = &mut self.materials[id.0 as usize];
        slot.material = Some(Arc::new(material));
        slot.depth = depth;
        Ok(())
    }

    /// Whether a material is made after the whole scene is read: textures may be defined after the materials that
    /// name them, as in pbrt-v4, which makes textures first.
    fn must_wait(&self, ty: &str, params: &Params) -> bool {
        if params.all().any(|param| self.is_texture_to_come(param)) {
            return true;
        }
        let is_waiting = |name: &String| {
            let id = self.material_names.get(&**name);
            id.is_some_and(|id| self.is_waiting(*id))
        };
        let of_mix = ["materials", "namedmaterial1", "namedmaterial2"];
        ty == "mix"
            && !self.materials_later.is_empty()
            && params
                .all()
                .filter(|param| of_mix.contains(&&*param.name))
                .any(|param| matches!(&param.values, Values::Strings(names) if names.iter().any(is_waiting)))
    }

    fn is_waiting(&self, id: MaterialId) -> bool {
        self.waiting.contains(&id.0)
    }

    /// Makes the materials that waited.
    pub fn finish_materials(&mut self) -> Result<()> {
        for (id, ty, params) in std::mem::take(&mut self.materials_later) {
            let (material, depth) = self.build_material(&ty, &params)?;
            self.done(&params);
            let slot = &mut self.materials[id.0 as usize];
            slot.material = Some(Arc::new(material));
            slot.depth = depth;
        }
        Ok(())
    }

    /// A material, and its depth of nested mixtures.
    fn build_material(&mut self, ty: &str, params: &Params) -> Result<(Material, usize)> {
        let Some((kind, depth)) = self.material_kind(ty, params)? else {
            return Ok((Material::default_diffuse(), 1));
        };
        // Names that pbrt-v4 gives to the shape and the medium, and `MakeNamedMaterial` to the type.
        params.ignore(&["type"]);
        let mut material = Material::new(kind);
        material.dispersion = self.dispersion(params, &material.kind)?;
        if !matches!(material.kind, MaterialKind::Mix { .. } | MaterialKind::Interface) {
            material.displacement = self.float_texture(params, "displacement")?;
            if params.has("bumpmap") {
                self.upgraded(params.spot_of("bumpmap"));
                material.displacement = self.float_texture(params, "bumpmap")?;
            }
            if let Some(filename) = params.string("normalmap")?.map(str::to_owned) {
                let at = params.spot_of("normalmap");
                let image =
                    self.mip_map(&filename, at, Some(Encoding::Linear), Wrap::Repeat, ImageFilter::Bilinear)?;
                let mapping = Mapping2d::Uv { scale: Vec2::ONE, delta: Vec2::ZERO };
                let is_missing = self.missing.contains(&self.resolve(&filename, at)?);
                material.normal_map =
                    (!is_missing).then_some(ImageTexture { mapping, image, scale: 1.0, invert: false });
            }
        }
        Ok((material, depth))
    }

    /// The kind of a material, and its depth of nested mixtures; `None` for an unknown one, after a warning.
    fn material_kind(&mut self, ty: &str, params: &Params) -> Result<Option<(MaterialKind, usize)>> {
        let spot = params.spot;
        let mut depth = 1;
        let kind = match ty {
            "diffuse" => self.diffuse(params)?,
            "conductor" => {
                let roughness = self.roughness(params, ROUGHNESS, 0.0)?;
                match self.metal(params, ["eta", "k", "reflectance"])? {
                    Metal::Index { eta, k } => MaterialKind::Conductor { eta, k, roughness },
                    Metal::Reflectance(reflectance) => {
                        MaterialKind::ConductorReflectance { reflectance, roughness }
                    }
                }
            }
            "dielectric" => MaterialKind::Dielectric {
                eta: self.index_of_refraction(params, "eta", 1.5)?,
                roughness: self.roughness(params, ROUGHNESS, 0.0)?,
            },
            "thindielectric" => {
                MaterialKind::ThinDielectric { eta: self.index_of_refraction(params, "eta", 1.5)? }
            }
            "coateddiffuse" => {
                let roughness = self.roughness(params, ROUGHNESS, 0.0)?;
                self.coated_diffuse(params, ["reflectance", "eta"], 0.5, roughness)?
            }
            "coatedconductor" => {
                let names = ["conductor.roughness", "conductor.uroughness", "conductor.vroughness"];
                let coat = ["interface.roughness", "interface.uroughness", "interface.vroughness"];
                MaterialKind::CoatedConductor {
                    metal: self.metal(params, ["conductor.eta", "conductor.k", "reflectance"])?,
                    roughness: self.roughness(params, names, 0.0)?,
                    interface_roughness: self.roughness(params, coat, 0.0)?,
                    thickness: self.float_texture_or(params, "thickness", 0.01)?,
                    interface_eta: self.index_of_refraction(params, "interface.eta", 1.5)?,
                    g: self.float_texture_or(params, "g", 0.0)?,
                    albedo: self.reflectance(params, "albedo", 0.0)?,
                    max_depth: params.count("maxdepth", 10, 1)?,
                    samples: params.count("nsamples", 1, 1)?,
                }
            }
            "diffusetransmission" => MaterialKind::DiffuseTransmission {
                reflectance: self.reflectance(params, "reflectance", 0.25)?,
                transmittance: self.reflectance(params, "transmittance", 0.25)?,
                scale: single(params, "scale", 1.0)?,
            },
            "mix" => {
                let (kind, mixed) = self.mix(params)?;
                depth = mixed;
                kind
            }
            "interface" => MaterialKind::Interface,
            "" | "none" => {
                let message = format!("material {} is an old name of \"interface\"", quoted(ty));
                self.note(spot, message);
                MaterialKind::Interface
            }
            "principled" => self.principled(params)?,
            "hair" => self.hair(params)?,
            "measured" => self.measured(params)?,
            "subsurface" => self.subsurface(params, "reflectance", 1.33)?,
            "openpbr" => self.openpbr(params)?,
            _ => match self.old_material(ty, params)? {
                Some(kind) => {
                    self.upgraded(spot);
                    kind
                }
                None => {
                    params.ignore_all();
                    self.unknown(spot, "material", ty, &KNOWN, "a diffuse one takes its place");
                    return Ok(None);
                }
            },
        };
        Ok(Some((kind, depth)))
    }

    /// A measured material by its file.
    fn measured(&mut self, params: &Params) -> Result<MaterialKind> {
        let Some(filename) = params.typed("filename", &[Type::String])? else {
            let wrong = Diagnostic::error(format!("{} has no file", params.owner));
            let wrong = wrong.expected("\"string filename\" with a .bsdf file of the RGL material database");
            return Err(params.spot.wrong(wrong));
        };
        let at = filename.spot;
        let path = self.resolve(filename.one_string()?, at)?;
        if let Some(known) = self.measured.get(&path) {
            return Ok(MaterialKind::Measured(known.clone()));
        }
        let fault = |error| file_fault(at, error);
        let input = Input::open(&path, self.budget).map_err(fault)?;
        let tables = Arc::new(measured::read(&input, input.name(), self.budget).map_err(fault)?);
        self.keep(path.as_os_str().len() + 128, "measured materials", at)?;
        self.measured.insert(path, tables.clone());
        Ok(MaterialKind::Measured(tables))
    }

    /// A body that light wanders through; `reflectance` names the parameter of its albedo.
    fn subsurface(
        &mut self,
        params: &Params,
        reflectance: &'static str,
        default_eta: f32,
    ) -> Result<MaterialKind> {
        let mut asymmetry = params.float("g", 0.0)?;
        if !(-1.0 < asymmetry && asymmetry < 1.0) {
            return params.out_of_range("g", asymmetry, "more than -1 and less than 1");
        }
        let scale = params.float_above("scale", 1.0, 0.0)? as f32;
        let has = |name| params.find(name).is_some();
        let of_old = reflectance == "Kd";
        let usage = SpectrumUse::Coefficient;
        let inside = if let Some(name) = params.string("name")?.map(str::to_owned) {
            let Some((scattering, absorption)) = preset(&name) else {
                let wrong = Diagnostic::error(format!("unknown medium {}", quoted(&name)));
                let wrong = wrong.suggest(&name, preset_names());
                return Err(params.spot_of("name").wrong(wrong.expected("the name of a measured medium")));
            };
            params.ignore(&["sigma_a", "sigma_s", "mfp"]);
            params.ignore(&[reflectance]);
            if asymmetry != 0.0 {
                let message = "measured media scatter evenly in all directions: g is left out";
                self.note(params.spot_of("g"), message);
                asymmetry = 0.0;
            }
            Inside::Coefficients { absorption: constant(absorption), scattering: constant(scattering) }
        } else if !of_old && (has("sigma_a") || has("sigma_s")) {
            for (given, missing) in [("sigma_a", "sigma_s"), ("sigma_s", "sigma_a")] {
                if !has(missing) {
                    let wrong = Diagnostic::error(format!("{} without {}", quoted(given), quoted(missing)));
                    return Err(params.spot_of(given).wrong(wrong.expected("both or neither")));
                }
            }
            params.ignore(&["mfp"]);
            params.ignore(&[reflectance]);
            Inside::Coefficients {
                absorption: self.spectrum_texture_or(params, "sigma_a", usage, 1.0)?,
                scattering: self.spectrum_texture_or(params, "sigma_s", usage, 1.0)?,
            }
        } else if of_old || has(reflectance) {
            let mean_free_path = self.spectrum_texture(params, "mfp", usage)?;
            if let Some(path) = mean_free_path.as_ref().and_then(Known::value)
                && path.min_component() <= 0.0
            {
                return params.out_of_range("mfp", f64::from(path.min_component()), "more than 0");
            }
            Inside::Reflectance {
                reflectance: self.reflectance(params, reflectance, 0.5)?,
                mean_free_path: mean_free_path
                    .map_or_else(|| constant(Spectrum::splat(1.0)), |known| known.texture),
            }
        } else {
            params.ignore(&["mfp"]);
            // Whole milk, per millimetre.
            Inside::Coefficients {
                absorption: constant(Spectrum::new(0.0011, 0.0024, 0.014)),
                scattering: constant(Spectrum::new(2.55, 3.21, 3.77)),
            }
        };
        Ok(MaterialKind::Subsurface(Box::new(SubsurfaceParams {
            inside,
            scale,
            asymmetry: asymmetry as f32,
            eta: self.index_of_refraction(params, "eta", default_eta)?,
            roughness: self.roughness(params, ROUGHNESS, 0.0)?,
        })))
    }

    // Parts.

    fn reflectance(&mut self, params: &Params, name: &'static str, default: f32) -> Result<SpectrumArc> {
        self.spectrum_texture_or(params, name, SpectrumUse::Reflectance, default)
    }

    fn diffuse(&mut self, params: &Params) -> Result<MaterialKind> {
        Ok(MaterialKind::Diffuse { reflectance: self.reflectance(params, "reflectance", 0.5)? })
    }

    /// The roughness parameters; `names` are those of both axes, of u and of v.
    fn roughness(&mut self, params: &Params, names: [&'static str; 3], default: f32) -> Result<Roughness> {
        let both = self.float_texture_or(params, names[0], default)?;
        let u = self.float_texture(params, names[1])?.unwrap_or_else(|| both.clone());
        let v = self.float_texture(params, names[2])?.unwrap_or(both);
        Ok(Roughness { u, v, remap: params.boolean("remaproughness", true)? })
    }

    /// An index of refraction: a number, or a spectrum's value at the yellow helium line.
    fn index_of_refraction(&mut self, params: &Params, name: &'static str, default: f32) -> Result<f32> {
        Ok(self.index_and_dispersion(params, name, default)?.0)
    }

    /// The index of refraction of a dielectric or a coat by wavelength, where it is given so.
    fn dispersion(&mut self, params: &Params, kind: &MaterialKind) -> Result<Option<Arc<SpectrumValue>>> {
        let name = match kind {
            MaterialKind::CoatedConductor { .. } => "interface.eta",
            MaterialKind::Dielectric { .. } | MaterialKind::ThinDielectric { .. } => "eta",
            MaterialKind::CoatedDiffuse { .. } => "eta",
            MaterialKind::Diffuse { .. }
            | MaterialKind::Conductor { .. }
            | MaterialKind::ConductorReflectance { .. }
            | MaterialKind::DiffuseTransmission { .. }
            | MaterialKind::Principled(_)
            | MaterialKind::Uber(_)
            | MaterialKind::Hair(_)
            | MaterialKind::Measured(_)
            | MaterialKind::Subsurface(_)
            | MaterialKind::Pov(_)
            | MaterialKind::Mix { .. }
            | MaterialKind::Interface => return Ok(None),
        };
        let is_spectrum = |name| params.find(name).is_some_and(|param| param.ty == Type::Spectrum);
        // pbrt-v3 has another name, which comes first.
        let Some(name) = ["index", name].into_iter().find(|name| params.has(name)) else { return Ok(None) };
        if !is_spectrum(name) {
            return Ok(None);
        }
        let value = self.spectrum_value(params, name, SpectrumUse::Coefficient)?;
        if let Some(SpectrumValue::Sampled(pairs)) = &value {
            self.keep(size_of_val(pairs.as_slice()), "spectra", params.spot_of(name))?;
        }
        Ok(value.map(Arc::new))
    }

    /// An index of refraction, and its dispersion: 20 over the Abbe number.
    pub fn index_and_dispersion(
        &mut self,
        params: &Params,
        name: &'static str,
        default: f32,
    ) -> Result<(f32, f32)> {
        let mut dispersion = 0.0;
        let types = [Type::Float, Type::Integer, Type::Rgb, Type::Blackbody, Type::Spectrum];
        let eta = match params.typed(name, &types)? {
            None => default,
            Some(param) if matches!(param.ty, Type::Float | Type::Integer) => single(params, name, default)?,
            Some(_) => match self.spectrum_value(params, name, SpectrumUse::Coefficient)? {
                Some(value) => {
                    // Outside its wavelengths a list is 0, and there is no boundary, as in pbrt-v4.
                    let index = match value.index_of_refraction() {
                        0.0 if matches!(value, SpectrumValue::Sampled(_)) => 1.0,
                        index => index,
                    };
                    // The F and C lines of hydrogen.
                    if let (Some(blue), Some(red)) = (value.at(486.1), value.at(656.3)) {
                        dispersion = (20.0 * (blue - red) / (f64::from(index) - 1.0)) as f32;
                    }
                    index
                }
                None => default,
            },
        };
        if 0.0 < eta && eta.is_finite() {
            return Ok((eta, if dispersion.is_finite() { dispersion } else { 0.0 }));
        }
        params.out_of_range(name, f64::from(eta), "more than 0")
    }

    /// A metal, by the parameters of these names: η, k and the reflectance that excludes them.
    fn metal(&mut self, params: &Params, [eta, k, reflectance]: [&'static str; 3]) -> Result<Metal> {
        if let Some(known) = self.spectrum_texture(params, reflectance, SpectrumUse::Reflectance)? {
            for other in [eta, k] {
                if params.find(other).is_some() {
                    let message = format!("{} excludes {}", quoted(reflectance), quoted(other));
                    return Err(params.spot_of(other).error(message));
                }
            }
            return Ok(Metal::Reflectance(known.texture));
        }
        let (eta, k) = self.conductor_indices(params, eta, k)?;
        Ok(Metal::Index { eta, k })
    }

    fn conductor_indices(
        &mut self,
        params: &Params,
        eta: &'static str,
        k: &'static str,
    ) -> Result<(SpectrumArc, SpectrumArc)> {
        let is_texture = |name| params.find(name).is_some_and(|p| p.ty == Type::Texture);
        let copper = |name| {
            NamedSpectrum::from_name(name).map_or(SpectrumValue::Rgb(Spectrum::WHITE), SpectrumValue::Named)
        };
        if is_texture(eta) || is_texture(k) {
            let mut one = |name, default| -> Result<SpectrumArc> {
                let known = self.spectrum_texture(params, name, SpectrumUse::Coefficient)?;
                match known {
                    Some(known) => Ok(known.texture),
                    None => {
                        let copper = copper(default);
                        self.spectrum_constant(copper.unbounded_rgb(), copper, params.spot)
                    }
                }
            };
            return Ok((one(eta, "metal-Cu-eta")?, one(k, "metal-Cu-k")?));
        }
        let usage = SpectrumUse::Coefficient;
        let eta = self.spectrum_value(params, eta, usage)?.unwrap_or_else(|| copper("metal-Cu-eta"));
        let k = self.spectrum_value(params, k, usage)?.unwrap_or_else(|| copper("metal-Cu-k"));
        let (eta_rgb, k_rgb) = conductor_rgb(&eta, &k);
        let spot = params.spot;
        Ok((self.spectrum_constant(eta_rgb, eta, spot)?, self.spectrum_constant(k_rgb, k, spot)?))
    }

    fn coated_diffuse(
        &mut self,
        params: &Params,
        [reflectance, eta]: [&'static str; 2],
        default: f32,
        roughness: Roughness,
    ) -> Result<MaterialKind> {
        Ok(MaterialKind::CoatedDiffuse {
            reflectance: self.reflectance(params, reflectance, default)?,
            roughness,
            thickness: self.float_texture_or(params, "thickness", 0.01)?,
            eta: self.index_of_refraction(params, eta, 1.5)?,
            g: self.float_texture_or(params, "g", 0.0)?,
            albedo: self.reflectance(params, "albedo", 0.0)?,
            max_depth: params.count("maxdepth", 10, 1)?,
            samples: params.count("nsamples", 1, 1)?,
        })
    }

    fn hair(&mut self, params: &Params) -> Result<MaterialKind> {
        // Of several, the first counts.
        let names = ["sigma_a", "reflectance", "color", "eumelanin", "pheomelanin"];
        let counts = names.into_iter().find(|name| params.has(name));
        let is_melanin = |name: &str| name.ends_with("melanin");
        for name in names {
            let is_part = counts.is_none_or(|first| first == name || is_melanin(first) && is_melanin(name));
            if let (Some(first), true, false) = (counts, params.has(name), is_part) {
                params.ignore(&[name]);
                let message = format!("{} is not used where {} is given", quoted(name), quoted(first));
                self.note(params.spot_of(name), message);
            }
        }
        let colour = match counts {
            Some(name @ "sigma_a") => {
                HairColour::Absorption(self.hair_texture(params, name, SpectrumUse::Coefficient)?)
            }
            Some(name @ ("reflectance" | "color")) => {
                HairColour::Reflectance(self.hair_texture(params, name, SpectrumUse::Reflectance)?)
            }
            _ => HairColour::Melanin {
                eumelanin: self.hair_number(
                    params,
                    "eumelanin",
                    if counts.is_none() { 1.3 } else { 0.0 },
                    0.0,
                )?,
                pheomelanin: self.hair_number(params, "pheomelanin", 0.0, 0.0)?,
            },
        };
        Ok(MaterialKind::Hair(Box::new(HairParams {
            colour,
            eta: self.hair_number(params, "eta", 1.55, f32::MIN_POSITIVE)?,
            beta_m: self.hair_number(params, "beta_m", 0.3, 0.0)?,
            beta_n: self.hair_number(params, "beta_n", 0.3, 0.0)?,
            alpha: self.hair_number(params, "alpha", 2.0, f32::MIN)?,
        })))
    }

    fn hair_texture(
        &mut self,
        params: &Params,
        name: &'static str,
        usage: SpectrumUse,
    ) -> Result<SpectrumArc> {
        let colour = self.spectrum_texture_or(params, name, usage, 0.0)?;
        if let Texture::Constant(Spectrum { r, g, b }) = *colour
            && let Some(negative) = [r, g, b].into_iter().find(|c| *c < 0.0)
        {
            return params.out_of_range(name, f64::from(negative), "0 or more");
        }
        Ok(colour)
    }

    /// A number or a texture; a number that is too small is refused.
    fn hair_number(
        &mut self,
        params: &Params,
        name: &'static str,
        default: f32,
        least: f32,
    ) -> Result<FloatArc> {
        let found = self.float_texture_or(params, name, default)?;
        match *found {
            Texture::Constant(v) if v < least || !v.is_finite() => {
                let expected = if least > 0.0 { "more than 0" } else { "0 or more" };
                params.out_of_range(name, f64::from(v), expected)
            }
            _ => Ok(found),
        }
    }

    fn mix(&mut self, params: &Params) -> Result<(MaterialKind, usize)> {
        let old = params.has("namedmaterial1") || params.has("namedmaterial2");
        let names: [String; 2] = if old {
            self.upgraded(params.spot);
            let one = |name| -> Result<String> {
                let given = params.string(name)?.map(str::to_owned);
                given.ok_or_else(|| params.spot.error(format!("a mix has no \"string {name}\"")))
            };
            [one("namedmaterial1")?, one("namedmaterial2")?]
        } else {
            let Some(param) = params.typed("materials", &[Type::String])? else {
                return Err(params.spot.error("a mix has no \"string materials\""));
            };
            match param.strings()? {
                [a, b] => [a.clone(), b.clone()],
                _ => return Err(param.refuse("the names of two materials")),
            }
        };
        let at = params.spot_of(if old { "namedmaterial1" } else { "materials" });
        let mut depth = 1;
        let mut find = |name: &str| -> Result<Arc<Material>> {
            let slot = self.material_names.get(name).map(|id| &self.materials[id.0 as usize]);
            let Some((material, slot)) = slot.and_then(|slot| Some((slot.material.clone()?, slot))) else {
                let wrong =
                    Diagnostic::error(format!("material {} is not defined before this mix", quoted(name)));
                return Err(at.wrong(wrong.suggest(name, self.material_names.keys().map(|name| &**name))));
            };
            if matches!(material.kind, MaterialKind::Interface) {
                return Err(at.error(format!("an interface such as {} cannot be mixed", quoted(name))));
            }
            depth = depth.max(1 + slot.depth);
            Ok(material)
        };
        let materials = [find(&names[0])?, find(&names[1])?];
        if depth > MAX_MIX_DEPTH {
            let message = format!("mixtures stand in each other more than {MAX_MIX_DEPTH} deep");
            return Err(params.spot.error(message));
        }
        let amount =
            if old { self.old_amount(params)? } else { self.float_texture_or(params, "amount", 0.5)? };
        Ok((MaterialKind::Mix { materials, amount }, depth))
    }

    // pbrt-v3.

    /// pbrt-v3's weight of the first material, a colour, as the weight of the second, a number.
    fn old_amount(&mut self, params: &Params) -> Result<FloatArc> {
        let types = [Type::Float, Type::Rgb, Type::Spectrum, Type::Texture];
        let Some(param) = params.typed("amount", &types)? else { return Ok(number(0.5)) };
        let first = match param.ty {
            Type::Float => number(single(params, "amount", 0.5)?),
            Type::Texture if matches!(&param.values, Values::Strings(v) if v.len() == 1 && self.float_textures.contains_key(&v[0])) => {
                self.float_texture_or(params, "amount", 0.5)?
            }
            Type::Texture => {
                self.note(param.spot, "a coloured amount of a mix is not rendered: one half takes its place");
                number(0.5)
            }
            _ => {
                let value = self.spectrum_value(params, "amount", SpectrumUse::Reflectance)?;
                number(value.map_or(0.5, |v| v.reflectance_rgb().average()))
            }
        };
        Ok(match *first {
            Texture::Constant(v) => number(1.0 - v),
            _ => Arc::new(Texture::Mix { textures: [number(1.0), number(0.0)], amount: first }),
        })
    }

    /// pbrt-v3's `uber`, or `plastic`, which has less of it.
    fn uber(&mut self, ty: &str, params: &Params) -> Result<MaterialKind> {
        let is_whole = ty == "uber";
        let colour = |converter: &mut Self, name, default| converter.reflectance(params, name, default);
        let [kr, kt, opacity] = if is_whole {
            [colour(self, "Kr", 0.0)?, colour(self, "Kt", 0.0)?, colour(self, "opacity", 1.0)?]
        } else {
            [self.colour(Spectrum::BLACK), self.colour(Spectrum::BLACK), self.colour(Spectrum::WHITE)]
        };
        let index = if params.has("index") { "index" } else { "eta" };
        Ok(MaterialKind::Uber(Box::new(UberParams {
            kd: colour(self, "Kd", 0.25)?,
            ks: colour(self, "Ks", 0.25)?,
            kr,
            kt,
            opacity,
            eta: self.float_texture_or(params, index, 1.5)?,
            roughness: self.roughness(params, ROUGHNESS, 0.1)?,
        })))
    }

    /// A material of pbrt-v3 as one of pbrt-v4; `None` for an unknown name.
    fn old_material(&mut self, ty: &str, params: &Params) -> Result<Option<MaterialKind>> {
        let spot = params.spot;
        // Parameters without an equivalent in pbrt-v4.
        let dropped = |converter: &mut Self, names: &[&'static str]| {
            for name in names.iter().filter(|name| params.has(name)) {
                params.ignore(&[name]);
                let message = format!("{} of pbrt-v3's material {} is left out", quoted(name), quoted(ty));
                converter.note(params.spot_of(name), message);
            }
        };
        Ok(Some(match ty {
            "matte" => {
                dropped(self, &["sigma"]);
                MaterialKind::Diffuse { reflectance: self.reflectance(params, "Kd", 0.5)? }
            }
            "uber" | "plastic" => self.uber(ty, params)?,
            "substrate" => {
                dropped(self, &["Ks"]);
                let roughness = self.roughness(params, ROUGHNESS, 0.1)?;
                let index = if params.has("index") { "index" } else { "eta" };
                self.coated_diffuse(params, ["Kd", index], 0.5, roughness)?
            }
            "mirror" => {
                let roughness = Roughness { u: number(0.0), v: number(0.0), remap: false };
                let reflectance = self.reflectance(params, "Kr", 0.9)?;
                MaterialKind::ConductorReflectance { reflectance, roughness }
            }
            "metal" => {
                let roughness = self.roughness(params, ROUGHNESS, 0.01)?;
                let (eta, k) = self.conductor_indices(params, "eta", "k")?;
                MaterialKind::Conductor { eta, k, roughness }
            }
            "glass" => {
                dropped(self, &["Kr", "Kt"]);
                let name = if params.has("index") { "index" } else { "eta" };
                MaterialKind::Dielectric {
                    eta: self.index_of_refraction(params, name, 1.5)?,
                    roughness: self.roughness(params, ROUGHNESS, 0.0)?,
                }
            }
            "translucent" => {
                dropped(self, &["Ks", "roughness"]);
                params.ignore(&["remaproughness"]);
                let base = self.spectrum_texture(params, "Kd", SpectrumUse::Reflectance)?;
                let mut share = |name| -> Result<Spectrum> {
                    let known = self.spectrum_texture(params, name, SpectrumUse::Reflectance)?;
                    Ok(known.map_or(Some(Spectrum::splat(0.5)), |known| known.value()).unwrap_or_else(|| {
                        // A texture of it has no equivalent.
                        Spectrum::splat(0.5)
                    }))
                };
                let (reflect, transmit) = (share("reflect")?, share("transmit")?);
                match base.as_ref().map_or(Some(Spectrum::splat(0.25)), |known| known.value()) {
                    Some(kd) => MaterialKind::DiffuseTransmission {
                        reflectance: constant(kd * reflect),
                        transmittance: constant(kd * transmit),
                        scale: 1.0,
                    },
                    None => {
                        let texture =
                            base.map_or_else(|| constant(Spectrum::splat(0.25)), |known| known.texture);
                        let by = |share: Spectrum| -> SpectrumArc {
                            let scale = number(share.average());
                            Arc::new(Texture::Scale { texture: texture.clone(), scale })
                        };
                        MaterialKind::DiffuseTransmission {
                            reflectance: by(reflect),
                            transmittance: by(transmit),
                            scale: 1.0,
                        }
                    }
                }
            }
            "disney" => self.disney(params)?,
            "kdsubsurface" => {
                dropped(self, &["Kr", "Kt"]);
                self.subsurface(params, "Kd", 1.3)?
            }
            "fourier" => {
                let reflectance = self.reflectance(params, "Kd", 0.5)?;
                params.ignore_all();
                let message = "tabulated Fourier series are of pbrt-v3 alone and are not read: a diffuse material takes \
                               the place of \"fourier\"";
                self.note(spot, message);
                MaterialKind::Diffuse { reflectance }
            }
            _ => return Ok(None),
        }))
    }
}

/// The names of the roughness parameters.
const ROUGHNESS: [&str; 3] = ["roughness", "uroughness", "vroughness"];

fn number(v: f32) -> FloatArc {
    Arc::new(Texture::Constant(v))
}

fn constant(colour: Spectrum) -> SpectrumArc {
    Arc::new(SpectrumTexture::Constant(colour))
}
