//! Rendered pictures.

use std::borrow::Cow;
use std::path::Path;

use lumbre_formats::image::{ImageFormat, encode_image, encode_layers, write_image, write_layers};
use lumbre_image::{Image, Layer, Layers, ToneMap};
use lumbre_render::{
    CancelToken, Denoised, Feature, FilmLayers, PixelBounds, Rendered, Stats, denoise_unless,
};

use crate::{Background, Error, SaveOptions};

/// A rendered picture, with statistics.
#[derive(Clone, Debug)]
pub struct Picture {
    pub(crate) rendered: Rendered,
    pub(crate) whole: (u32, u32),
    pub(crate) background: Option<Background>,
    pub(crate) noisy: Option<Noisy>,
}

/// What a picture was before it was denoised.
#[derive(Clone, Debug)]
pub(crate) struct Noisy {
    image: Image,
    coverage: Option<Image>,
    /// What it was denoised by.
    denoiser: &'static str,
}

impl Picture {
    /// The pixels, in linear light.
    pub fn image(&self) -> &Image {
        &self.rendered.image
    }

    /// A picture that was rendered before: its image (by its alpha, if it has coverage), its coverage by colour, and
    /// its features, of these pixels of a whole of this size.
    pub fn restored(
        image: Image,
        coverage: Option<Image>,
        bounds: PixelBounds,
        whole: (u32, u32),
        features: Vec<(Feature, Image)>,
    ) -> Self {
        let rendered = Rendered::restored(image, coverage, bounds, features);
        Self { rendered, whole, background: None, noisy: None }
    }

    /// Width and height of the picture that this is the whole of, or a part.
    pub fn whole(&self) -> (u32, u32) {
        self.whole
    }

    /// Puts the picture over a background, for saving. It shows where the picture is transparent
    /// ([`crate::RenderOptions::transparent`]): with its exact colours in display formats, and as light in the
    /// others.
    #[must_use]
    pub fn over(self, background: Background) -> Self {
        Self { background: Some(background), ..self }
    }

    /// The picture over its background, as light: what formats of light have of it.
    pub fn lit(&self) -> Cow<'_, Image> {
        self.shown(None, &SaveOptions::default()).0
    }

    /// Takes the noise out of the picture by Lumbre's own filter ([`lumbre_render::denoise`()]) on this many threads, 0
    /// for one a core; the same for any number. It keeps the noisy picture, which an .exr shows in channels of its own:
    /// `noisy.R` and so on.
    ///
    /// # Errors
    /// [`Error::Options`] where [`crate::RenderOptions::guides`] were not asked for, and where not every pixel has a
    /// sample.
    pub fn denoise(&mut self, threads: usize) -> Result<(), Error> {
        self.denoise_unless(threads, &CancelToken::new())
    }

    /// The same, unless it is cancelled: then the picture stays as it is, soon after that.
    ///
    /// # Errors
    /// As for [`Picture::denoise`].
    pub fn denoise_unless(&mut self, threads: usize, cancel: &CancelToken) -> Result<(), Error> {
        match denoise_unless(&self.rendered, threads, cancel) {
            Some(denoised) => self.set_denoised(denoised, "Lumbre"),
            None if cancel.is_cancelled() => Ok(()),
            None => {
                let why = "a picture is denoised that has guides, and a sample in every pixel";
                Err(Error::Options(why.to_owned()))
            }
        }
    }

    /// Takes what a denoiser of this name made of [`Picture::image`] and [`Picture::coverage`] for the picture, and
    /// keeps the noisy one as [`Picture::denoise`] does.
    ///
    /// # Errors
    /// [`Error::Options`] where it is of another size, or has alpha and the picture none, or the other way round.
    pub fn set_denoised(&mut self, denoised: Denoised, denoiser: &'static str) -> Result<(), Error> {
        let kind = |image: &Image| (image.width(), image.height(), image.alpha().is_some());
        let same_coverage = denoised.coverage.is_some() == self.rendered.coverage.is_some();
        if kind(&denoised.image) != kind(&self.rendered.image) || !same_coverage {
            return Err(Error::Options("the denoised picture is of another size or kind".to_owned()));
        }
        let image = std::mem::replace(&mut self.rendered.image, denoised.image);
        let coverage = std::mem::replace(&mut self.rendered.coverage, denoised.coverage);
        self.noisy.get_or_insert(Noisy { image, coverage, denoiser }).denoiser = denoiser;
        Ok(())
    }

    /// Coverage by colour, where a transparent picture has coloured shadows on its ground.
    pub fn coverage(&self) -> Option<&Image> {
        self.rendered.coverage.as_ref()
    }

    /// An AOV, if it was rendered.
    pub fn feature(&self, feature: Feature) -> Option<&Image> {
        self.rendered.features.iter().find(|(kind, _)| *kind == feature).map(|(_, image)| image)
    }

    /// What the film has besides colours: the channels that pbrt's films `gbuffer` and `spectral` have. An .exr file
    /// holds them too.
    pub fn film(&self) -> &FilmLayers {
        &self.rendered.film
    }

    /// The same picture with other channels of the film.
    #[must_use]
    pub fn with_film(mut self, film: FilmLayers) -> Self {
        self.rendered.film = film;
        self
    }

    /// The rendered part of the whole picture.
    pub fn bounds(&self) -> PixelBounds {
        self.rendered.bounds
    }

    /// The rendering statistics.
    pub fn stats(&self) -> &Stats {
        &self.rendered.stats
    }

    /// Saves the picture in the format of the path's extension: .exr, .png, .jpg, .webp, .qoi, .hdr or .pfm.
    ///
    /// # Errors
    /// [`Error::Format`].
    pub fn save(&self, path: impl AsRef<Path>) -> Result<(), Error> {
        self.save_with(path.as_ref(), &SaveOptions::default(), &[])
    }

    /// Saves the picture with options, and with AOVs as layers of an .exr file: `albedo.R`, `normal.X`,
    /// `depth.Z`, `uv.U` and so on.
    ///
    /// # Errors
    /// [`Error::Format`]; [`Error::Options`] when layers are requested for another format, or were not
    /// rendered.
    pub fn save_with(&self, path: &Path, options: &SaveOptions, layers: &[Feature]) -> Result<(), Error> {
        if !layers.is_empty() && path.extension().is_none_or(|e| !e.eq_ignore_ascii_case("exr")) {
            return Err(Error::Options(format!("{}: only .exr files hold feature layers", path.display())));
        }
        let (image, options) = self.shown(ImageFormat::from_path(path), options);
        if layers.is_empty() && !self.has_more_than_colours(ImageFormat::from_path(path)) {
            return Ok(write_image(path, &image, &options)?);
        }
        Ok(write_layers(path, &self.layers(&image, layers)?, &options)?)
    }

    /// The bytes of the file that [`Picture::save_with`] writes.
    ///
    /// # Errors
    /// [`Error::Options`] as for [`Picture::save_with`], and when the format cannot hold the picture.
    pub fn encode(
        &self,
        format: ImageFormat,
        options: &SaveOptions,
        layers: &[Feature],
    ) -> Result<Vec<u8>, Error> {
        if !layers.is_empty() && format != ImageFormat::Exr {
            return Err(Error::Options(format!("{} does not hold feature layers", format.name())));
        }
        let (image, options) = self.shown(Some(format), options);
        let encoded = if layers.is_empty() && !self.has_more_than_colours(Some(format)) {
            encode_image(&image, format, &options)
        } else {
            encode_layers(&self.layers(&image, layers)?, &options)
        };
        encoded.map_err(|e| Error::Options(format!("{}: {e}", format.name())))
    }

    /// The picture over its background, as it is for displays, and what is left to be done to it: how
    /// [`Picture::encode`] begins with a PNG. `shown.tone_map.encode(light, shown.exposure)` of a pixel, divided by its
    /// alpha, is what the PNG has there.
    pub fn displayed(&self, options: &SaveOptions) -> (Cow<'_, Image>, SaveOptions) {
        self.shown(Some(ImageFormat::Png), options)
    }

    /// The picture over its background, in linear light: the numbers that [`Picture::encode`] writes into a PFM.
    pub fn light(&self) -> Cow<'_, Image> {
        self.shown(Some(ImageFormat::Pfm), &SaveOptions::default()).0
    }

    /// The image over its background, and the options for writing what is left to do to it.
    fn shown(&self, format: Option<ImageFormat>, options: &SaveOptions) -> (Cow<'_, Image>, SaveOptions) {
        let PixelBounds { x0, y0, .. } = self.bounds();
        let part = (self.image().width(), self.image().height()) != self.whole;
        let mut options = options.clone();
        options.exr_window = part.then_some((x0 as i32, y0 as i32, self.whole.0, self.whole.1));
        let is_for_displays = format.is_some_and(|format| !format.is_high_range());
        options.exr_attributes.clone_from(&self.rendered.film.attributes);
        options.denoiser = self.noisy.as_ref().map(|noisy| noisy.denoiser);
        let coverage = self.rendered.coverage.as_ref();
        let Some(background) = &self.background else { return (Cow::Borrowed(self.image()), options) };
        let image = if is_for_displays {
            let (tone_map, exposure) = (options.tone_map, options.exposure);
            (options.tone_map, options.exposure) = (ToneMap::None, 0.0);
            background.under_shown(self.image(), coverage, self.bounds(), self.whole, tone_map, exposure)
        } else {
            background.under_light(self.image(), coverage, self.bounds(), self.whole)
        };
        (Cow::Owned(image), options)
    }

    /// Whether a file of this format has the noisy picture too, or channels of the film.
    fn has_more_than_colours(&self, format: Option<ImageFormat>) -> bool {
        let has_more = self.noisy.is_some() || !self.rendered.film.layers.is_empty();
        has_more && format == Some(ImageFormat::Exr)
    }

    fn layers(&self, image: &Image, features: &[Feature]) -> Result<Layers, Error> {
        let stands_twice = |layer: Layer| Error::Options(format!("layer {} stands twice", layer.name));
        let mut all = Layers::from_image(image);
        if let Some(Noisy { image, coverage, .. }) = &self.noisy {
            let behind = |background: &Background| {
                Cow::Owned(background.under_light(image, coverage.as_ref(), self.bounds(), self.whole))
            };
            let shown = self.background.as_ref().map_or(Cow::Borrowed(image), behind);
            all.push_image("noisy", &shown).map_err(stands_twice)?;
        }
        for feature in features {
            let image = self
                .feature(*feature)
                .ok_or_else(|| Error::Options(format!("the {} layer was not rendered", feature.name())))?;
            for (channel, letter) in feature.channels().iter().enumerate() {
                let layer = Layer {
                    name: format!("{}.{letter}", feature.name()),
                    samples: image.channel(channel).collect(),
                    full_precision: true,
                };
                all.push(layer).map_err(stands_twice)?;
            }
        }
        for layer in &self.rendered.film.layers {
            all.push(layer.clone()).map_err(stands_twice)?;
        }
        Ok(all)
    }
}
