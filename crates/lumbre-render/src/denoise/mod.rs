//! Less noise without more samples: a filter of the picture that knows what every pixel shows, and how sure it is.
//!
//! What is filtered is light over reflectance, so that textures stay as they are. Pixels are averaged that show the same surface and
//! whose neighbourhoods are the same but for noise (non-local means); the samples are in two halves, each of which is averaged by
//! weights from the other, so that no noise chooses itself (F. Rousselle, M. Manzi, M. Zwicker, "Robust Denoising using Feature and
//! Color Information", Computer Graphics Forum 32, 2013). Where they choose among three filters by an estimate of the error, here is one.

mod means;
mod planes;
#[cfg(test)]
mod tests;

use lumbre_image::{Image, Rgb};

use crate::film::{GuideSums, RatioSums};
use crate::workers::Workers;
use crate::{CancelToken, Rendered, denoise::means::Layer};

/// Reflectance below which light is not divided by it.
const LEAST_REFLECTANCE: f32 = 0.01;
/// Ground in a pixel below which its share of shadow is not known.
const LEAST_GROUND: f32 = 1e-3;

/// Bytes a pixel that the filter needs: two halves of three channels, what comes out of them, and the features with their variance.
pub(crate) const BYTES_A_PIXEL: usize = 4 * (2 * 6 + 2 * 7 + 14);

/// A picture without noise.
#[derive(Clone, Debug, PartialEq)]
pub struct Denoised {
    /// The pixels, with coverage where the rendered picture has it.
    pub image: Image,
    /// Coverage by colour, where the rendered picture has it: [`Rendered::coverage`].
    pub coverage: Option<Image>,
}

/// Takes the noise out of a picture that was rendered with [`crate::RenderOptions::guides`], on so many threads, 0 for one a core; the
/// pixels do not depend on it. `None` where there are no guides, and where not every pixel has a sample of its own.
///
/// Pixels whose samples all agree, and that look like no other, stay as they are. Coverage is filtered only where the ground catches
/// shadows, so that outlines stay sharp.
pub fn denoise(rendered: &Rendered, threads: usize) -> Option<Denoised> {
    denoise_unless(rendered, threads, &CancelToken::new())
}

/// The same, unless it is cancelled: `None` soon after that.
pub fn denoise_unless(rendered: &Rendered, threads: usize, cancel: &CancelToken) -> Option<Denoised> {
    let guides = rendered.guides.as_deref().filter(|_| rendered.stats.stride == Some(1))?;
    let size = (rendered.image.width() as usize, rendered.image.height() as usize);
    let workers = Workers::start(threads);
    let surfaces = planes::surfaces(guides, size);
    let filtered = |layer: &Layer| means::filter(layer, &surfaces, &workers, cancel);

    // Where a picture is transparent, there is no light of what lets one through.
    let is_opaque = rendered.image.alpha().is_none();
    let light = filtered(&planes::layer(guides, size, |guide| &guide.light, LEAST_REFLECTANCE, is_opaque))?;
    let colours = (0..guides.len()).map(|i| {
        let colour = |c: usize| light[c][i] * share(&guides[i], &guides[i].light, c, LEAST_REFLECTANCE);
        Rgb::new(colour(0), colour(1), colour(2))
    });
    let image = Image::from_pixels(rendered.image.width(), rendered.image.height(), colours.collect())?;
    let Some(alpha) = rendered.image.alpha() else { return Some(Denoised { image, coverage: None }) };
    if guides.iter().all(|guide| guide.shadow == RatioSums::default()) {
        let image = image.with_alpha(alpha.to_vec())?;
        return Some(Denoised { image, coverage: rendered.coverage.clone() });
    }

    let shadow = filtered(&planes::layer(guides, size, |guide| &guide.shadow, LEAST_GROUND, false))?;
    // What is not ground, and covers as it did, and what is.
    let covered = |i: usize, before: Rgb| {
        let (guide, sums) = (&guides[i], &guides[i].shadow);
        let channel = |c: usize, before: f32| {
            let ground = share(guide, sums, c, LEAST_GROUND);
            let rest = before - sums.value(c, guide.count, LEAST_GROUND) * ground;
            let now = if guide.count.samples > 0 { rest + shadow[c][i] * ground } else { before };
            now.clamp(0.0, 1.0)
        };
        Rgb::new(channel(0, before.r), channel(1, before.g), channel(2, before.b))
    };
    let before = |i: usize| rendered.coverage.as_ref().map_or(Rgb::splat(alpha[i]), |all| all.pixels()[i]);
    let coverage: Vec<Rgb> = (0..guides.len()).map(|i| covered(i, before(i))).collect();
    let image = image.with_alpha(coverage.iter().map(|c| c.average()).collect())?;
    let by_colour = || Image::from_pixels(image.width(), image.height(), coverage.clone());
    let coverage = if rendered.coverage.is_some() { Some(by_colour()?) } else { None };
    Some(Denoised { image, coverage })
}

/// What the ratio of a pixel is multiplied by again.
fn share(guide: &GuideSums, sums: &RatioSums, c: usize, least: f32) -> f32 {
    let has_part = guide.count.weight > 0.0 && !sums.is_absent(c);
    if has_part { sums.denominator(c, guide.count).max(least) } else { 0.0 }
}
