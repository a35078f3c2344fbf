//! Image files.

use std::io::Read;
use std::path::Path;

use lumbre_formats::image::{WriteOptions, open_image};
use lumbre_formats::{Budget, Diagnostics, Input, Limits};
use lumbre_image::Image;

use crate::Error;

/// Options of writing images.
pub type SaveOptions = WriteOptions;

/// Reads an image file: EXR, PNG, HDR, PFM, JPEG, TGA, BMP or QOI.
///
/// # Errors
/// [`Error::Format`].
pub fn read_image(path: &Path) -> Result<Image, Error> {
    read_image_within(path, Limits::default())
}

/// [`read_image`] within limits.
///
/// # Errors
/// [`Error::Format`].
pub fn read_image_within(path: &Path, limits: Limits) -> Result<Image, Error> {
    let budget = Budget::new(limits);
    let file = open_image(path, &budget, &mut Diagnostics::new())?;
    Ok(file.to_image(&budget)?)
}

/// [`read_image_within`] of bytes from elsewhere, such as standard input, whose format is recognised by their content;
/// `name` is for messages.
///
/// # Errors
/// [`Error::Format`].
pub fn read_image_from(name: &str, reader: impl Read, limits: Limits) -> Result<Image, Error> {
    let budget = Budget::new(limits);
    let input = Input::from_reader(name, reader, &budget)?;
    let file = lumbre_formats::image::read_image(&input, input.name(), &budget, &mut Diagnostics::new())?;
    Ok(file.to_image(&budget)?)
}

/// Writes an image atomically, in the format of the path's extension.
///
/// # Errors
/// [`Error::Format`].
pub fn write_image(path: &Path, image: &Image, options: &SaveOptions) -> Result<(), Error> {
    Ok(lumbre_formats::image::write_image(path, image, options)?)
}
