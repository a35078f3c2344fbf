//! What fills shapes: participating media.

use std::sync::Arc;

use lumbre::shading::medium::{HomogeneousMedium, Medium as MediumDesc, preset, preset_names};
use pyo3::prelude::*;

use crate::errors::{invalid, unknown};
use crate::material::colour;

/// A medium, which is the same everywhere. Shapes that are made of it share it.
#[pyclass(frozen, module = "lumbre._lumbre")]
pub(crate) struct Medium(pub(crate) Arc<MediumDesc>);

#[pymethods]
impl Medium {
    /// By its coefficients, per unit of length of the world.
    #[new]
    fn new(absorption: [f32; 3], scattering: [f32; 3], asymmetry: f32, glow: [f32; 3]) -> PyResult<Self> {
        if !(-1.0 < asymmetry && asymmetry < 1.0) {
            return Err(invalid(format!(
                "asymmetry is out of range (found {asymmetry}; expected a number between -1 and 1)"
            )));
        }
        let (absorption, scattering) = (colour("absorption", absorption)?, colour("scattering", scattering)?);
        let extinction = absorption + scattering;
        let albedo = scattering.zip(extinction, |s, t| if t > 0.0 { s / t } else { 0.0 });
        let medium = HomogeneousMedium { extinction, albedo, asymmetry };
        Ok(Self(Arc::new(MediumDesc::Homogeneous { medium, glow: colour("emission", glow)?, spectra: None })))
    }

    /// The absorption and the reduced scattering coefficient of a measured medium, per millimetre.
    #[staticmethod]
    fn measured(name: &str) -> PyResult<([f32; 3], [f32; 3])> {
        let names: Vec<&str> = preset_names().collect();
        let (scattering, absorption) = preset(name).ok_or_else(|| unknown("medium", name, &names))?;
        Ok((absorption.to_array(), scattering.to_array()))
    }
}
