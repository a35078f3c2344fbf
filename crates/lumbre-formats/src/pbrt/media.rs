//! Participating media.

use std::sync::Arc;

use lumbre_math::{DVec3, Transform};
use lumbre_scene::MediumId;
use lumbre_shading::medium::{
    Cloud, Coefficients, Density, Factor, Glow, Grid, Heat, HeterogeneousMedium, HomogeneousMedium, Medium,
    MediumSpectra, preset, preset_names,
};
use lumbre_shading::spectrum::{BlackbodyColours, LightCurve};
use lumbre_shading::{Spectrum, SpectrumValue};

use super::colour;
use super::convert::{Converter, MediumSlot, file_fault};
use super::params::{AT_MOST_F32, Param, Params, Type};
use super::source::{AtSpot, Result, SourcePosition};
use super::textures::{LightSpectrum, SpectrumUse};
use crate::diagnostic::{number, quoted};
use crate::nanovdb::{self, NanoGrid, Values};
use crate::{Diagnostic, Input};

/// The types of media.
pub(super) const MEDIA: [&str; 5] = ["homogeneous", "uniformgrid", "rgbgrid", "cloud", "nanovdb"];

/// What says how a medium glows by its temperature, and does nothing without.
const OF_HEAT: [&str; 3] = ["temperatureoffset", "temperaturecutoff", "temperaturescale"];

/// The integral of the observer's ȳ, by which pbrt-v4 divides the light of all but voxels with colours of their own.
const OF_VOXELS: f64 = 106.856_895;

/// Beyond this, light goes all but straight on or back.
const MAX_ASYMMETRY: f64 = 0.99;

impl Converter<'_, '_> {
    /// `MakeNamedMedium`: its space is the one in which it is made.
    pub fn medium(
        &mut self,
        name: &str,
        at: SourcePosition,
        params: Params,
        ctm: &[Transform; 2],
    ) -> Result<()> {
        let id = self.medium_named(name, at)?;
        if self.media[id.0 as usize].medium.is_some() {
            return Err(at.error(format!("medium {} is defined twice", quoted(name))));
        }
        if ctm[0] != ctm[1] {
            self.note(params.spot, "the motion of this medium is left out: it stays where it starts");
        }
        let medium = self.medium_of(&params, ctm[0])?;
        self.done(&params);
        self.media[id.0 as usize].medium = Some(Arc::new(medium));
        Ok(())
    }

    /// A medium by its name, which may be defined later; none for the empty name.
    pub fn medium_of_side(&mut self, name: &str, at: SourcePosition) -> Result<Option<MediumId>> {
        if name.is_empty() { Ok(None) } else { self.medium_named(name, at).map(Some) }
    }

    fn medium_named(&mut self, name: &str, at: SourcePosition) -> Result<MediumId> {
        if let Some(id) = self.medium_names.get(name) {
            return Ok(*id);
        }
        let name = self.kept_name(name, at)?;
        self.keep(size_of::<MediumSlot>() + size_of::<Medium>(), "media", at)?;
        let id = MediumId(self.media.len() as u32);
        self.media.push(MediumSlot { name: name.clone(), medium: None, first_use: at });
        self.medium_names.insert(name, id);
        Ok(id)
    }

    fn medium_of(&mut self, params: &Params, world_from_medium: Transform) -> Result<Medium> {
        let Some(ty) = params.string("type")?.map(str::to_owned) else {
            let wrong = Diagnostic::error(format!("{} has no type", params.owner));
            return Err(params.spot.wrong(wrong.expected("\"string type\" with one of its types")));
        };
        match &*ty {
            "homogeneous" => self.homogeneous(params),
            "uniformgrid" => self.uniform_grid(params, world_from_medium),
            "heterogeneous" => {
                self.upgraded(params.spot);
                self.old_grid(params, world_from_medium)
            }
            "rgbgrid" => self.rgb_grid(params, world_from_medium),
            "cloud" => self.cloud(params, world_from_medium),
            "nanovdb" => self.nanovdb(params, world_from_medium),
            _ => {
                params.ignore_all();
                self.unknown(params.spot, "medium", &ty, &MEDIA, "a vacuum takes its place");
                Ok(Medium::Homogeneous {
                    medium: HomogeneousMedium {
                        extinction: Spectrum::BLACK,
                        albedo: Spectrum::BLACK,
                        asymmetry: 0.0,
                    },
                    glow: Spectrum::BLACK,
                    spectra: None,
                })
            }
        }
    }

    fn homogeneous(&mut self, params: &Params) -> Result<Medium> {
        let asymmetry = self.asymmetry(params)?;
        let scale = params.float_at_least_zero("scale", 1.0)? as f32;
        let named = match params.string("preset")?.map(str::to_owned) {
            None => None,
            Some(name) => self.preset_of(params, &name),
        };
        let (mut scattering_spectrum, mut absorption_spectrum) = (None, None);
        let (scattering, absorption) = match named {
            Some(coefficients) => coefficients,
            None => {
                let (scattering, absorption);
                (scattering, scattering_spectrum) = self.coefficient(params, "sigma_s")?;
                (absorption, absorption_spectrum) = self.coefficient(params, "sigma_a")?;
                (scattering, absorption)
            }
        };
        let extinction = (scattering + absorption) * scale;
        let albedo = scattering.zip(scattering + absorption, |s, t| if t > 0.0 { s / t } else { 0.0 });
        let glow = self.glow(params)?;
        let (glow, curve) = glow.map_or((Spectrum::BLACK, None), |glow| (glow.colour, glow.curve));
        let glow = glow * params.float_at_least_zero("Lescale", 1.0)? as f32;
        let spectra = spectra([absorption_spectrum, scattering_spectrum], scale, curve);
        Ok(Medium::Homogeneous {
            medium: HomogeneousMedium { extinction, albedo, asymmetry },
            glow,
            spectra: spectra.map(Box::new),
        })
    }

    /// The coefficients of scattering and absorption of a measured medium, in place of those that are given.
    fn preset_of(&mut self, params: &Params, name: &str) -> Option<(Spectrum, Spectrum)> {
        let Some(coefficients) = preset(name) else {
            let wrong = Diagnostic::warning(format!("unknown preset {}", quoted(name)));
            let wrong = wrong.suggest(name, preset_names());
            self.warn(params.spot_of("preset"), wrong.expected("the name of a measured medium"));
            return None;
        };
        for name in ["sigma_a", "sigma_s"] {
            if params.has(name) {
                params.ignore(&[name]);
                let message = format!("{} is not used where a preset is given", quoted(name));
                self.note(params.spot_of(name), message);
            }
        }
        Some(coefficients)
    }

    fn uniform_grid(&mut self, params: &Params, world_from_medium: Transform) -> Result<Medium> {
        let (absorption, of_absorption) = self.coefficient(params, "sigma_a")?;
        let (scattering, of_scattering) = self.coefficient(params, "sigma_s")?;
        let values = [(absorption, of_absorption), (scattering, of_scattering)];
        self.grid_with(params, world_from_medium, values)
    }

    /// pbrt-v3's grid, whose coefficients are those of whole milk by default, or of a preset.
    fn old_grid(&mut self, params: &Params, world_from_medium: Transform) -> Result<Medium> {
        let named = match params.string("preset")?.map(str::to_owned) {
            None => None,
            Some(name) => self.preset_of(params, &name),
        };
        let (scattering, absorption) = match named {
            Some(coefficients) => coefficients,
            None => {
                let mut given = |name, default| -> Result<(Spectrum, Option<SpectrumValue>)> {
                    if params.has(name) { self.coefficient(params, name) } else { Ok((default, None)) }
                };
                let scattering = given("sigma_s", Spectrum::new(2.55, 3.21, 3.77))?;
                let absorption = given("sigma_a", Spectrum::new(0.0011, 0.0024, 0.014))?;
                return self.grid_with(params, world_from_medium, [absorption, scattering]);
            }
        };
        self.grid_with(params, world_from_medium, [(absorption, None), (scattering, None)])
    }

    /// A grid with these coefficients, of absorption and of scattering.
    fn grid_with(
        &mut self,
        params: &Params,
        world_from_medium: Transform,
        [(absorption, of_absorption), (scattering, of_scattering)]: [(Spectrum, Option<SpectrumValue>); 2],
    ) -> Result<Medium> {
        let size = size(params)?;
        let Some(density) = self.voxels(params, "density", size)? else {
            let wrong = Diagnostic::error(format!("{} has no density", params.owner));
            return Err(params.spot.wrong(wrong.expected("\"float density\" with a number for each voxel")));
        };
        let scale = params.float_at_least_zero("scale", 1.0)? as f32;
        let (glow, curve) = self.grid_glow(params, size)?;
        let coefficients = Coefficients::Scaled {
            density: Density::Grid(density),
            absorption: absorption * scale,
            scattering: scattering * scale,
        };
        let spectra = spectra([of_absorption, of_scattering], scale, curve);
        self.heterogeneous(params, world_from_medium, coefficients, glow, spectra)
    }

    fn rgb_grid(&mut self, params: &Params, world_from_medium: Transform) -> Result<Medium> {
        let size = size(params)?;
        let absorption = self.coloured_voxels(params, "sigma_a", size, SpectrumUse::Coefficient)?;
        let scattering = self.coloured_voxels(params, "sigma_s", size, SpectrumUse::Coefficient)?;
        if absorption.is_none() && scattering.is_none() {
            let wrong = Diagnostic::error(format!("{} has neither sigma_a nor sigma_s", params.owner));
            return Err(params
                .spot
                .wrong(wrong.expected("\"rgb sigma_a\" or \"rgb sigma_s\" of all voxels")));
        }
        let radiance = self.coloured_voxels(params, "Le", size, SpectrumUse::Light)?;
        let scale = (params.float_at_least_zero("Lescale", 1.0)? * OF_VOXELS) as f32;
        let glow = match radiance {
            None => Glow::None,
            Some(_) if absorption.is_none() => {
                return Err(params.spot_of("Le").error("a medium that emits needs \"rgb sigma_a\", too"));
            }
            Some(radiance) => Glow::Coloured { radiance, scale },
        };
        let scale = params.float_at_least_zero("scale", 1.0)? as f32;
        let coefficients = Coefficients::Coloured { absorption, scattering, scale };
        self.heterogeneous(params, world_from_medium, coefficients, glow, None)
    }

    fn cloud(&mut self, params: &Params, world_from_medium: Transform) -> Result<Medium> {
        let cloud = Cloud {
            density: params.float_at_least_zero("density", 1.0)?,
            wispiness: params.float_at_least_zero("wispiness", 1.0)?,
            frequency: params.float("frequency", 5.0)?,
        };
        let (absorption, of_absorption) = self.coefficient(params, "sigma_a")?;
        let (scattering, of_scattering) = self.coefficient(params, "sigma_s")?;
        let coefficients = Coefficients::Scaled { density: Density::Cloud(cloud), absorption, scattering };
        let spectra = spectra([of_absorption, of_scattering], 1.0, None);
        self.heterogeneous(params, world_from_medium, coefficients, Glow::None, spectra)
    }

    /// Grids of a file, whose world is the space of the medium.
    fn nanovdb(&mut self, params: &Params, world_from_medium: Transform) -> Result<Medium> {
        let Some(filename) = params.typed("filename", &[Type::String])? else {
            let wrong = Diagnostic::error(format!("{} has no file", params.owner));
            return Err(params.spot.wrong(wrong.expected("\"string filename\" with a NanoVDB file")));
        };
        let at = filename.spot;
        let path = self.resolve(filename.one_string()?, at)?;
        let fault = |error| file_fault(at, error);
        let input = Input::open(&path, self.budget).map_err(fault)?;
        let name = input.name().clone();
        let bytes = input.into_bytes();
        let names = || -> Result<String> {
            let names = nanovdb::grid_names(&bytes, &name, self.budget).map_err(fault)?;
            let names: Vec<String> = names.iter().map(|name| quoted(name)).collect();
            Ok(if names.is_empty() { "a file with grids".to_owned() } else { names.join(" or ") })
        };
        let grid = |wanted: &str, values: Values| {
            nanovdb::read(&bytes, &name, wanted, values, self.budget).map_err(fault)
        };
        let wanted = params.string("gridname")?.unwrap_or("density");
        let Some(density) = grid(wanted, Values::NotNegative)? else {
            let wrong = Diagnostic::error(format!("the file has no grid {}", quoted(wanted)));
            return Err(params.spot_of("gridname").wrong(wrong.expected(names()?)));
        };
        let of_heat = params.string("temperaturename")?.unwrap_or("temperature").to_owned();
        let temperature = grid(&of_heat, Values::Finite)?;
        // A file may have no temperatures: it is said where they are asked for by a name of their own.
        if temperature.is_none() && of_heat != "temperature" {
            let message = format!("the file has no grid {}: the medium does not glow", quoted(&of_heat));
            self.warn(params.spot_of("temperaturename"), Diagnostic::warning(message).expected(names()?));
        }
        let NanoGrid { grid: density, world_bounds: [mut low, mut high] } = density;
        let factor = Factor::Constant(params.float_at_least_zero("Lescale", 1.0)? as f32);
        let glow = match temperature {
            None => {
                params.ignore(&OF_HEAT);
                Glow::None
            }
            Some(NanoGrid { grid, world_bounds }) => {
                (low, high) = (low.min(world_bounds[0]), high.max(world_bounds[1]));
                let hottest = grid.greatest();
                self.heat(params, Density::Sparse(Box::new(grid)), hottest, factor)?
            }
        };
        let scale = params.float_at_least_zero("scale", 1.0)? as f32;
        let (absorption, of_absorption) = self.coefficient(params, "sigma_a")?;
        let (scattering, of_scattering) = self.coefficient(params, "sigma_s")?;
        let coefficients = Coefficients::Scaled {
            density: Density::Sparse(Box::new(density)),
            absorption: absorption * scale,
            scattering: scattering * scale,
        };
        let asymmetry = self.asymmetry(params)?;
        let medium_from_world = world_from_medium.inverse();
        let medium = HeterogeneousMedium::new(medium_from_world, [low, high], asymmetry, coefficients, glow)
            .with_spectra(spectra([of_absorption, of_scattering], scale, None));
        Ok(Medium::Heterogeneous(Box::new(medium)))
    }

    /// A medium in the box from `p0` to `p1`.
    fn heterogeneous(
        &mut self,
        params: &Params,
        world_from_medium: Transform,
        coefficients: Coefficients,
        glow: Glow,
        spectra: Option<MediumSpectra>,
    ) -> Result<Medium> {
        let p0 = params.triple("p0", Type::Point3, DVec3::ZERO)?;
        let p1 = params.triple("p1", Type::Point3, DVec3::ONE)?;
        if p0.cmpeq(p1).any() {
            let spot = params.spot_of(if params.has("p1") { "p1" } else { "p0" });
            let wrong = Diagnostic::error("the box of this medium is flat");
            return Err(spot.wrong(wrong.expected("p0 and p1 that differ on every axis")));
        }
        let asymmetry = self.asymmetry(params)?;
        let medium_from_world = world_from_medium.inverse();
        let medium = HeterogeneousMedium::new(medium_from_world, [p0, p1], asymmetry, coefficients, glow)
            .with_spectra(spectra);
        Ok(Medium::Heterogeneous(Box::new(medium)))
    }

    /// What a grid emits: one colour, or by temperature.
    fn grid_glow(&mut self, params: &Params, size: [usize; 3]) -> Result<(Glow, Option<Arc<LightCurve>>)> {
        let radiance = self.glow(params)?;
        let temperature = self.voxels(params, "temperature", size)?;
        // A factor of one number is a grid of one voxel, as in pbrt: it falls to half on the faces.
        let factor = match params.typed("Lescale", &[Type::Float])? {
            None => None,
            Some(param) if param.values.len() == 1 && size != [1; 3] => {
                return Err(param.refuse("a number for each voxel"));
            }
            Some(_) => self.voxels(params, "Lescale", size)?,
        };
        let factor = Factor::Grid(match factor {
            Some(factor) => factor,
            None => Grid::new([1; 3], vec![1.0]).expect("one voxel"),
        });
        match (radiance, temperature) {
            (Some(_), Some(_)) => {
                let wrong = Diagnostic::error("a medium has Le and a temperature");
                Err(params.spot_of("temperature").wrong(wrong.expected("one of both")))
            }
            (None, None) => {
                params.ignore(&OF_HEAT);
                Ok((Glow::None, None))
            }
            (Some(LightSpectrum { colour: radiance, curve }), None) => {
                params.ignore(&OF_HEAT);
                Ok((Glow::Scaled { radiance, factor }, curve))
            }
            (None, Some(temperature)) => {
                let hottest = temperature.greatest();
                Ok((self.heat(params, Density::Grid(temperature), hottest, factor)?, None))
            }
        }
    }

    /// What is emitted by temperature.
    fn heat(&mut self, params: &Params, temperature: Density, hottest: f32, factor: Factor) -> Result<Glow> {
        let cutoff = params.float("temperaturecutoff", 0.0)?;
        let offset = params.float("temperatureoffset", cutoff)? as f32;
        let scale = params.float("temperaturescale", 1.0)? as f32;
        let colours = BlackbodyColours::up_to((hottest - offset) * scale);
        Ok(Glow::Heat(Box::new(Heat { temperature, offset, scale, factor, colours })))
    }

    /// A coefficient of absorption or scattering, 1 where none is given, and its spectrum where it is more than a
    /// colour.
    fn coefficient(
        &mut self,
        params: &Params,
        name: &'static str,
    ) -> Result<(Spectrum, Option<SpectrumValue>)> {
        let value = self.spectrum_value(params, name, SpectrumUse::Coefficient)?;
        let colour = value.as_ref().map_or(Spectrum::WHITE, SpectrumValue::unbounded_rgb);
        let spectrum = value.filter(|value| !matches!(value, SpectrumValue::Rgb(_)));
        if let Some(SpectrumValue::Sampled(pairs)) = &spectrum {
            self.keep(size_of_val(pairs.as_slice()), "spectra", params.spot_of(name))?;
        }
        Ok((colour, spectrum))
    }

    fn glow(&mut self, params: &Params) -> Result<Option<LightSpectrum>> {
        self.light_colour(params, "Le")
    }

    fn asymmetry(&mut self, params: &Params) -> Result<f32> {
        let g = params.float("g", 0.0)?;
        if g.abs() > MAX_ASYMMETRY {
            let wrong = Diagnostic::warning("the asymmetry of this medium is held to 0.99 either way");
            self.warn(params.spot_of("g"), wrong.found(number(g)).expected("more than -1 and less than 1"));
        }
        Ok(g.clamp(-MAX_ASYMMETRY, MAX_ASYMMETRY) as f32)
    }

    /// A number that is not negative for each voxel.
    fn voxels(&mut self, params: &Params, name: &'static str, size: [usize; 3]) -> Result<Option<Grid<f32>>> {
        let Some(param) = params.typed(name, &[Type::Float])? else { return Ok(None) };
        let numbers = counted(param, size, 1)?;
        self.budget.bytes((numbers.len() * size_of::<f32>()) as u64, "voxels").at(param.spot)?;
        let values = numbers.iter().map(|&value| value as f32).collect();
        Ok(Some(Grid::new(size, values).expect("they are counted")))
    }

    /// Three numbers that are not negative for each voxel.
    fn coloured_voxels(
        &mut self,
        params: &Params,
        name: &'static str,
        size: [usize; 3],
        usage: SpectrumUse,
    ) -> Result<Option<Grid<Spectrum>>> {
        let Some(param) = params.typed(name, &[Type::Rgb])? else { return Ok(None) };
        let numbers = counted(param, size, 3)?;
        self.budget.bytes((numbers.len() * size_of::<f32>()) as u64, "voxels").at(param.spot)?;
        let colour = |rgb: &[f64]| {
            let rgb = [rgb[0], rgb[1], rgb[2]];
            match usage {
                SpectrumUse::Light => colour::light(&param.space, rgb),
                _ => colour::factor(&param.space, rgb),
            }
        };
        let values = numbers.chunks_exact(3).map(colour).collect();
        Ok(Some(Grid::new(size, values).expect("they are counted")))
    }
}

/// What is known of a medium by wavelength; `None` where that is only colours.
fn spectra(
    [absorption, scattering]: [Option<SpectrumValue>; 2],
    scale: f32,
    glow: Option<Arc<LightCurve>>,
) -> Option<MediumSpectra> {
    let is_more = absorption.is_some() || scattering.is_some() || glow.is_some();
    is_more.then_some(MediumSpectra { absorption, scattering, scale, glow })
}

/// Voxels along x, y and z.
fn size(params: &Params) -> Result<[usize; 3]> {
    Ok([params.count("nx", 1, 1)?, params.count("ny", 1, 1)?, params.count("nz", 1, 1)?].map(|n| n as usize))
}

/// The numbers of a parameter: one per voxel, not negative.
fn counted(param: &Param, size: [usize; 3], each: usize) -> Result<&[f64]> {
    let numbers = param.numbers()?;
    let voxels = size.into_iter().try_fold(each, usize::checked_mul);
    if voxels != Some(numbers.len()) {
        let [x, y, z] = size;
        let every = if each == 1 { "a number".to_owned() } else { format!("{each} numbers") };
        return Err(param.refuse(&format!("{every} for each of {x} × {y} × {z} voxels")));
    }
    let most = f64::from(f32::MAX);
    if let Some(i) = numbers.iter().position(|v| !(0.0..=most).contains(v)) {
        let wrong = Diagnostic::error(format!("wrong value for parameter {}", quoted(&param.name)));
        let wrong = wrong.found(format!("{} at position {i}", number(numbers[i])));
        let expected = if numbers[i] < 0.0 { "numbers that are not negative" } else { AT_MOST_F32 };
        return Err(param.spot.wrong(wrong.expected(expected)));
    }
    Ok(numbers)
}
