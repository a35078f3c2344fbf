//! Images that a scene names, each read once.

use std::path::PathBuf;
use std::sync::Arc;

use lumbre_image::Encoding;
use lumbre_shading::{ImageFilter, MipMap, MipMapOptions, Wrap};

use super::convert::{Converter, file_fault};
use super::source::{AtSpot, Result, Spot};
use crate::image::{ImageFile, open_image};

/// The key of an image with its lookup: its path, and how it is decoded and filtered.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct ImageKey {
    path: PathBuf,
    // The encoding and the options as text, as their floats have no hash.
    how: String,
}

impl Converter<'_, '_> {
    /// The image of this name; `encoding` overrides the file's.
    pub fn mip_map(
        &mut self,
        name: &str,
        at: Spot,
        encoding: Option<Encoding>,
        wrap: Wrap,
        filter: ImageFilter,
    ) -> Result<Arc<MipMap>> {
        let path = self.resolve(name, at)?;
        let options = MipMapOptions { wrap, filter };
        let key = ImageKey { path: path.clone(), how: format!("{encoding:?} {options:?}") };
        if let Some(image) = self.images.get(&key) {
            return Ok(image.clone());
        }
        // The same pixels with other options are shared.
        let same = self.images.iter().find(|(other, _)| other.path == path);
        let bitmap = match same.map(|(_, image)| image.bitmap().clone()) {
            Some(bitmap) if encoding.is_none_or(|e| e == bitmap.encoding()) => bitmap,
            _ => {
                let bitmap = self.image_file(name, at)?.bitmap;
                Arc::new(match encoding {
                    Some(encoding) => bitmap.with_encoding(encoding),
                    None => bitmap,
                })
            }
        };
        // The smaller levels take another third.
        self.budget.bytes(bitmap.bytes() as u64 / 3, name).at(at)?;
        let image = Arc::new(MipMap::new(bitmap, options));
        self.images.insert(key, image.clone());
        Ok(image)
    }

    /// The image of this name as stored in its file.
    pub fn image_file(&mut self, name: &str, at: Spot) -> Result<ImageFile> {
        let path = self.resolve(name, at)?;
        let file = open_image(&path, self.budget, self.diagnostics).map_err(|e| file_fault(at, e))?;
        self.scene.listing.add_texture(name, file.bitmap.width(), file.bitmap.height());
        Ok(file)
    }
}
