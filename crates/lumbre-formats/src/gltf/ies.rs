//! Lights by measured profiles (`EXT_lights_ies`, NVIDIA and PTC, 2022).

use std::collections::HashMap;
use std::sync::Arc;

use lumbre_image::{Image, Rgb};
use lumbre_math::{DAffine3, Transform};
use lumbre_scene::{EnvironmentDesc, EnvironmentMapping, LightDesc};

use super::file::{File, List};
use super::json::{Read, Value};
use crate::FormatError;
use crate::ies::read_ies;

/// The profiles of a file, read on first use.
pub(super) struct Profiles<'f> {
    file: &'f File<'f>,
    images: HashMap<usize, Arc<Image>>,
}

impl<'f> Profiles<'f> {
    pub(super) fn new(file: &'f File<'f>) -> Self {
        Self { file, images: HashMap::new() }
    }

    /// Checks a profile without reading it.
    pub(super) fn check(file: &File<'_>, value: Value<'_>) -> Read<()> {
        match (value.get("uri")?, value.get("bufferView")?) {
            (Some(uri), None) => drop(uri.string()?),
            (None, Some(view)) => {
                let mime = value.need("mimeType")?;
                if mime.string()? != "application/x-ies-lm-63" {
                    file.breach(
                        mime.wrong("wrong media type of a light profile").expected("application/x-ies-lm-63"),
                    )?;
                }
                file.at(List::BufferViews, view)?;
            }
            (Some(_), Some(view)) => {
                file.breach(view.wrong("light profile with a URI and with a buffer view"))?;
            }
            (None, None) => {
                let wrong = value.wrong("light profile without data");
                return Err(wrong.expected("\"uri\" or \"bufferView\"").into());
            }
        }
        Ok(())
    }

    /// The profile of a node, and the factor on it.
    pub(super) fn instance(file: &File<'_>, extension: Value<'_>) -> Read<(usize, Rgb)> {
        let (index, _) = file.at(List::Profiles, extension.need("light")?)?;
        let multiplier = extension.number_or("multiplier", 1.0, 0.0..=f64::INFINITY)?;
        let [r, g, b] = extension.numbers_or("color", [1.0; 3], 0.0..=1.0)?;
        Ok((index, Rgb::new(r as f32, g as f32, b as f32) * multiplier as f32))
    }

    /// The light of a node with the transform `world`, aimed along its -z.
    pub(super) fn light(&mut self, extension: Value<'_>, world: &DAffine3) -> Read<LightDesc> {
        let (index, intensity) = Self::instance(self.file, extension)?;
        let world_from_light = Transform::from_affine(*world)
            .map_err(|_| FormatError::from(extension.wrong("light at a place that is not finite")))?;
        let image =
            EnvironmentDesc { image: self.image(index)?, mapping: EnvironmentMapping::LatitudeLongitude };
        Ok(LightDesc::Goniometric { world_from_light, intensity, image })
    }

    fn image(&mut self, index: usize) -> Read<Arc<Image>> {
        if let Some(image) = self.images.get(&index) {
            return Ok(image.clone());
        }
        let file = self.file;
        let value = file.list(List::Profiles)[index];
        let profile = if let Some(uri) = value.get("uri")? {
            let (name, bytes) = file.data(uri, &[])?;
            let profile = read_ies(&bytes, &name, file.budget)?;
            file.budget.release(bytes.len() as u64);
            profile
        } else {
            let name: Arc<str> = value.place().to_string().into();
            let (_, view) = file.view(value.need("bufferView")?)?;
            let bytes = view.bytes.ok_or_else(|| {
                FormatError::from(value.wrong("the buffer of what is needed here has no data"))
            })?;
            read_ies(bytes, &name, file.budget)?
        };
        let image = profile.image();
        file.budget.bytes(size_of_val(image.pixels()) as u64, "light profile")?;
        let image = Arc::new(image);
        self.images.insert(index, image.clone());
        Ok(image)
    }
}
