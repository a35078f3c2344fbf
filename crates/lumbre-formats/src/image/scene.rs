//! An image file as scenes use it: over its display window, and finite.

use std::path::Path;

use lumbre_image::Window;

use super::{ImageFile, open_image};
use crate::budget::Budget;
use crate::diagnostic::{Diagnostic, Diagnostics, FormatError, Place};

/// [`open_image`] for a texture or a light.
///
/// # Errors
/// As for [`open_image`].
pub(crate) fn open_scene_image(
    path: &Path,
    budget: &Budget,
    diagnostics: &mut Diagnostics,
) -> Result<ImageFile, FormatError> {
    let file = open_image(path, budget, diagnostics)?;
    file.for_scene(|| Place::whole(path.to_string_lossy().into_owned()), budget, diagnostics)
}

impl ImageFile {
    /// The image over its display window, black and transparent where the file has no pixels. Texels that are not
    /// finite are black, and a warning names the first of them.
    ///
    /// # Errors
    /// [`FormatError::Limit`] when the budget does not allow this many pixels.
    pub(crate) fn for_scene(
        mut self,
        place: impl Fn() -> Place,
        budget: &Budget,
        diagnostics: &mut Diagnostics,
    ) -> Result<Self, FormatError> {
        let (data, display) = (self.data_window, self.display_window);
        if data != display {
            let channels = self.bitmap.channels().count() as u64;
            let each = channels * self.bitmap.data().bytes_each() as u64;
            let bytes = (u64::from(display.width) * u64::from(display.height)).saturating_mul(each);
            let limit = |e| FormatError::from(e).or_at(&place);
            budget.bytes(bytes, "image").map_err(limit)?;
            let before = self.bitmap.bytes() as u64;
            let (x, y) = (data.x.saturating_sub(display.x), data.y.saturating_sub(display.y));
            self.bitmap = self.bitmap.placed(x, y, display.width, display.height);
            budget.release(before);
            let window = Window { x: 0, y: 0, ..display };
            (self.data_window, self.display_window) = (window, window);
        }
        let (x, y) = match self.bitmap.blacken_not_finite() {
            (0, _) => return Ok(self),
            (_, first) => first,
        };
        let found = format!("texel ({x}, {y}) of {} by {}", self.bitmap.width(), self.bitmap.height());
        let said = Diagnostic::warning("a texel of an image is not finite, and taken for black");
        diagnostics.push(said.at(place()).found(found));
        Ok(self)
    }
}
