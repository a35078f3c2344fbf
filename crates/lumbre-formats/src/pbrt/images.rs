//! Images that a scene names, each read once.

use std::path::PathBuf;
use std::sync::Arc;

use lumbre_image::Encoding;
use lumbre_shading::{ImageFilter, MipMap, MipMapOptions, Wrap};

use super::convert::{Converter, file_fault};
use super::source::{Fault, Result, SourcePosition};
use super::textures::unreadable;
use crate::image::{ImageFile, open_scene_image};
use crate::{Diagnostic, FormatError};

/// A scene says exactly what to render, so an image that is missing is an error; of a model it is a warning.
const LENIENT: &str = "a file that can be opened; --lenient takes grey for images that cannot";

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
        at: SourcePosition,
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
        let bitmap = match self.bitmaps.get(&path).cloned() {
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
        self.keep(bitmap.bytes() / 3 + 2 * name.len() + 256, name, at)?;
        self.bitmaps.entry(path).or_insert_with(|| bitmap.clone());
        let image = Arc::new(MipMap::new(bitmap, options));
        self.images.insert(key, image.clone());
        Ok(image)
    }

    /// The image of this name as stored in its file.
    pub fn image_file(&mut self, name: &str, at: SourcePosition) -> Result<ImageFile> {
        let path = self.resolve(name, at)?;
        match open_scene_image(&path, self.budget, self.diagnostics) {
            Ok(image) => {
                self.scene.listing.add_texture(name, image.bitmap.width(), image.bitmap.height());
                Ok(image)
            }
            Err(error @ (FormatError::Io { .. } | FormatError::Input(_)))
                if self.diagnostics.is_lenient() =>
            {
                let message = "a grey image takes the place of one that cannot be read";
                self.warn(at, Diagnostic::warning(message).found(unreadable(name, &error).message));
                self.missing.insert(path);
                Ok(ImageFile::grey())
            }
            Err(error @ FormatError::Io { .. }) => Err(match file_fault(at, error) {
                Fault::Input(at, wrong) => at.wrong(wrong.expected(LENIENT)),
                fault => fault,
            }),
            Err(error) => Err(file_fault(at, error)),
        }
    }
}
