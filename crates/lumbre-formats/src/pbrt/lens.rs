//! The realistic camera: surfaces of a lens in a file, and its stop.

use std::sync::Arc;

use lumbre_scene::{ApertureImage, CameraKind, Lens, LensError, LensSurface};

use super::convert::Converter;
use super::params::{Params, Type};
use super::source::{Result, SourcePosition};
use crate::Diagnostic;
use crate::diagnostic::{number, quoted};

/// A lens that waits for its film.
pub(super) struct LensLater {
    surfaces: Vec<LensSurface>,
    stop: Option<ApertureImage>,
    focus_distance: f64,
    spot: SourcePosition,
}

/// Numbers of a surface in a file.
const EACH: usize = 4;
const METRES_PER_MM: f64 = 1e-3;

impl Converter<'_, '_> {
    pub fn lens(&mut self, params: &Params) -> Result<LensLater> {
        let Some(filename) = params.typed("lensfile", &[Type::String])? else {
            let wrong = Diagnostic::error(format!("{} has no lens", params.owner));
            let wrong = wrong.expected("\"string lensfile\" with a file of its surfaces");
            return Err(params.spot.wrong(wrong));
        };
        let (spot, name) = (filename.spot, filename.one_string()?.to_owned());
        let path = self.resolve(&name, spot)?;
        let numbers = self.numbers_in_file(&path, "a lens", spot)?;
        if numbers.is_empty() || numbers.len() % EACH != 0 {
            let wrong = Diagnostic::error(format!("wrong lens {}", quoted(&name)));
            let found = format!("{} numbers", numbers.len());
            let expected = "curvature, thickness, index and diameter of each surface, in mm";
            return Err(spot.wrong(wrong.found(found).expected(expected)));
        }
        let diameter = params.float_above("aperturediameter", 1.0, 0.0)?;
        let mut surfaces = Vec::with_capacity(numbers.len() / EACH);
        self.keep(numbers.len() * size_of::<f64>(), "surfaces of a lens", spot)?;
        for (i, row) in numbers.chunks_exact(EACH).enumerate() {
            let [curvature, thickness, eta, mut aperture] = [row[0], row[1], row[2], row[3]];
            let is_surface = thickness >= 0.0 && eta >= 0.0 && aperture > 0.0;
            if !is_surface {
                let wrong = Diagnostic::error(format!("wrong surface {} of lens {}", i + 1, quoted(&name)));
                let found: Vec<String> = row.iter().map(|&v| number(v)).collect();
                let expected = "a thickness and an index that are not negative, and a diameter above 0";
                return Err(spot.wrong(wrong.found(found.join(" ")).expected(expected)));
            }
            if curvature == 0.0 {
                if diameter > aperture {
                    let wrong = Diagnostic::warning("the stop of this lens is not as wide: it is wide open");
                    let wrong = wrong.found(format!("{} mm", number(diameter)));
                    let wrong = wrong.expected(format!("at most {} mm", number(aperture)));
                    self.warn(params.spot_of("aperturediameter"), wrong);
                } else {
                    aperture = diameter;
                }
            }
            let [curvature, thickness, aperture] =
                [curvature, thickness, 0.5 * aperture].map(|mm| METRES_PER_MM * mm);
            surfaces.push(LensSurface { curvature, thickness, eta, aperture });
        }
        let stop = self.stop(params)?;
        let focus_distance = params.float_above("focusdistance", 10.0, 0.0)?;
        Ok(LensLater { surfaces, stop, focus_distance, spot: params.spot })
    }

    /// What lets light through in place of a round stop: a known shape, or an image.
    fn stop(&mut self, params: &Params) -> Result<Option<ApertureImage>> {
        let Some(name) = params.string("aperture")?.map(str::to_owned) else { return Ok(None) };
        if name.is_empty() {
            return Ok(None);
        }
        if let Some(known) = ApertureImage::named(&name) {
            return Ok(Some(known));
        }
        let at = params.spot_of("aperture");
        if !self.budget.exists(&self.resolve(&name, at)?) {
            let wrong = Diagnostic::error(format!("unknown aperture {}", quoted(&name)));
            let wrong = wrong.suggest(&name, ApertureImage::NAMES);
            return Err(at.wrong(wrong.expected(format!("{} or an image", ApertureImage::NAMES.join(", ")))));
        }
        let file = self.image_file(&name, at)?;
        let bitmap = &file.bitmap;
        let (width, height) = (bitmap.width(), bitmap.height());
        self.keep(width as usize * height as usize * size_of::<f32>(), "aperture", at)?;
        let rows = (0..height).rev();
        let values = rows.flat_map(|y| (0..width).map(move |x| bitmap.rgb(x, y).average())).collect();
        self.budget.release(bitmap.bytes() as u64);
        let stop = ApertureImage::new(width as usize, height as usize, values);
        match stop {
            Some(stop) => Ok(Some(stop)),
            None => {
                let wrong = Diagnostic::error(format!("no light passes the aperture {}", quoted(&name)));
                Err(at.wrong(wrong.expected("an image of numbers that are not negative, and not all 0")))
            }
        }
    }

    /// Puts the lens before the film.
    pub fn finish_lens(&mut self) -> Result<()> {
        let Some(LensLater { surfaces, stop, focus_distance, spot }) = self.lens.take() else {
            return Ok(());
        };
        let diagonal = METRES_PER_MM * self.film_diagonal;
        let lens = Lens::new(surfaces, stop, focus_distance, diagonal).map_err(|error| {
            let wrong = Diagnostic::error(error.to_string());
            spot.wrong(match error {
                LensError::TooNear => wrong
                    .found(format!("focusdistance {}", number(focus_distance)))
                    .expected("a distance in metres, from the film, of several focal lengths"),
                _ => wrong,
            })
        })?;
        if let Some(camera) = self.scene.cameras.first_mut() {
            camera.kind = CameraKind::Realistic(Arc::new(lens));
        }
        Ok(())
    }
}
