//! What to render, and when to stop.

use std::sync::Arc;
use std::time::Duration;

use lumbre_image::Rgb;
use lumbre_math::DVec2;
use lumbre_scene::{
    Buckets, Camera, FilmDesc, FilmKind, FilterDesc, IntegratorDesc, IntegratorKind, SamplerDesc, Scene,
};
use lumbre_shading::spectrum::{SensorCurves, WavelengthDensity};

use crate::RenderError;
use crate::denoise;
use crate::film::{
    BucketSums, Exposure, FeatureSums, Filter, FilterShape, GuideSums, MAX_PIXELS, Pixel, PixelBounds,
    RatioSums, SurfaceSums,
};
use crate::transport::Sampler;
use crate::workers::Workers;

/// Everything about a picture that is not in the scene.
///
/// [`RenderOptions::of`] takes them from the scene's description. [`RenderOptions::default`] is 1280 by 720 pixels of
/// 64 samples, path traced.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct RenderOptions {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// The pixels to render; the others are not in the result.
    pub crop: Option<PixelBounds>,
    /// Position of the camera among those of the scene.
    pub camera: usize,
    /// A camera instead of that one. Pictures of a scene from many places need no rebuild.
    pub view: Option<Camera>,
    /// The integrator.
    pub integrator: IntegratorDesc,
    /// The sampler; its `spp` is ignored.
    pub sampler: SamplerDesc,
    /// The pixel filter.
    pub filter: FilterDesc,
    /// The film. Films that keep wavelengths need [`Self::spectral`].
    pub film: FilmKind,
    /// Factor from radiance to pixel values, and the limit of a sample.
    pub exposure: Exposure,
    /// Whether the background is transparent: the picture then has alpha. Lights at infinity still light the scene.
    pub transparent: bool,
    /// Whether samples carry wavelengths instead of linear Rec. 709: see
    /// [`Wavelengths`](lumbre_shading::spectrum::Wavelengths). Only the path integrator does.
    pub spectral: bool,
    /// The sensor of a spectral render, instead of that of the exposure.
    pub sensor_curves: Option<Arc<SensorCurves>>,
    /// When to stop.
    pub stop: Stop,
    /// The index of the first sample of every pixel, for parts of a render.
    pub first_sample: u32,
    /// Whether to render albedo, normals, depth and uv too.
    pub features: bool,
    /// Whether to gather the guides of [`crate::denoise`]. The picture is the same.
    pub guides: bool,
    /// Threads; 0 for one per core.
    pub threads: usize,
}

/// When a render stops: at the limit that comes first.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Stop {
    /// At this many samples a pixel.
    pub spp: u32,
    /// After this much time.
    pub time: Option<Duration>,
    /// For each pixel, when its noise is estimated to be below this: the standard error of its luminance, divided by
    /// luminance (plus a tenth of the mean of a small picture, so that black pixels do not count for much). A pixel is
    /// checked when it has [`Stop::min_spp`] samples, and then at 16, 24, 32, 48, 64 samples and so on. The result
    /// depends only on its own samples and on those of the small picture, which is taken first. The noise of a picture
    /// is the root mean square of that of its pixels.
    pub noise: Option<f64>,
    /// Minimum samples per pixel before its noise is checked. By default 16, or up to 256 if the small picture finds
    /// that much of the light is in rare samples.
    pub min_spp: Option<u32>,
}

/// Default samples per pixel.
const DEFAULT_SPP: u32 = 64;
/// Samples of a pixel of [`IntegratorKind::Pov`], whose light is free of noise but at edges: about as many as POV-Ray
/// takes there. A noise target would cost more than it spares, by its trial of the whole picture.
const POV_SPP: u32 = 8;
/// Default width and height in pixels.
const DEFAULT_SIZE: (u32, u32) = (1280, 720);
const MAX_SIDE: u32 = 65_536;

impl Stop {
    /// The most samples per pixel of a render to a noise, without a limit given. A sum of samples can hold sixteen
    /// times this number.
    pub const MAX_FOR_NOISE: u32 = 1 << 20;

    /// At this many samples a pixel.
    pub fn at(spp: u32) -> Self {
        Self { spp, time: None, noise: None, min_spp: None }
    }

    /// Where a scene may say how many samples a pixel has, and nobody else says when to stop: at 64. Light of
    /// [`IntegratorKind::Pov`] is free of noise but at edges: at 8.
    pub fn usual(kind: IntegratorKind, spp: Option<u32>) -> Self {
        match (spp, kind) {
            (Some(spp), _) => Self::at(spp),
            (None, IntegratorKind::Pov) => Self::at(POV_SPP),
            (None, _) => Self::at(DEFAULT_SPP),
        }
    }
}

/// The exposure of a film.
fn exposure_of(film: &FilmDesc) -> Exposure {
    Exposure { factor: film.exposure, max_component: film.max_component, sensor: film.sensor }
}

impl Default for RenderOptions {
    fn default() -> Self {
        let (width, height) = DEFAULT_SIZE;
        let film = FilmDesc::default();
        Self {
            width,
            height,
            crop: None,
            camera: 0,
            view: None,
            integrator: IntegratorDesc::default(),
            sampler: SamplerDesc::default(),
            filter: FilterDesc::default(),
            film: film.kind,
            exposure: exposure_of(&film),
            transparent: false,
            spectral: false,
            sensor_curves: None,
            stop: Stop::at(DEFAULT_SPP),
            first_sample: 0,
            features: false,
            guides: false,
            threads: 0,
        }
    }
}

impl RenderOptions {
    /// The options of the scene's description; by default 1280 by 720 pixels of 64 samples.
    pub fn of(scene: &Scene) -> Self {
        let film = scene.film();
        let (width, height) = (film.width.unwrap_or(DEFAULT_SIZE.0), film.height.unwrap_or(DEFAULT_SIZE.1));
        let mut options = Self {
            width,
            height,
            integrator: scene.integrator(),
            sampler: scene.sampler(),
            filter: scene.filter(),
            film: film.kind,
            exposure: exposure_of(film),
            spectral: film.spectral && scene.integrator().kind.carries_wavelengths(),
            sensor_curves: film.camera.clone(),
            stop: Stop::usual(scene.integrator().kind, scene.sampler().spp),
            ..Self::default()
        };
        let window = film.crop_window.map(|window| options.pixels_of(window));
        let bounds = film.pixel_bounds.map(|[x0, x1, y0, y1]| PixelBounds { x0, y0, x1, y1 });
        options.crop = match (bounds, window) {
            (Some(a), Some(b)) => Some(a.intersection(&b)),
            (a, b) => a.or(b),
        };
        options
    }

    /// The same with this many samples a pixel: [`Stop::spp`].
    ///
    /// ```
    /// use lumbre_render::RenderOptions;
    ///
    /// assert_eq!(RenderOptions::default().with_spp(16).stop.spp, 16);
    /// ```
    #[doc(alias = "spp")]
    #[must_use]
    pub fn with_spp(mut self, spp: u32) -> Self {
        self.stop.spp = spp;
        self
    }

    /// The camera of a picture of this scene: [`RenderOptions::view`], or else the scene's own at
    /// [`RenderOptions::camera`].
    ///
    /// # Errors
    /// [`RenderError::NoSuchCamera`], and [`RenderError::Camera`] for a view that makes no picture.
    pub fn camera_of<'a>(&'a self, scene: &'a Scene) -> Result<&'a Camera, RenderError> {
        if let Some(view) = &self.view {
            scene.check_camera(view)?;
            return Ok(view);
        }
        let cameras = scene.cameras();
        cameras.get(self.camera).ok_or(RenderError::NoSuchCamera { index: self.camera, count: cameras.len() })
    }

    /// The numbers by which a sample of a pixel meets surfaces that cover it, or passes through: see
    /// [`Scene::closest_seen`].
    pub fn coverage_numbers(&self, (x, y): (u32, u32), index: u32) -> [f32; 2] {
        Sampler::new(&self.sampler).numbers(x, y, index).coverage()
    }

    /// Another size; the film's crop keeps its share of it.
    pub fn resize(&mut self, film: &FilmDesc, width: u32, height: u32) {
        let before = (f64::from(self.width), f64::from(self.height));
        (self.width, self.height) = (width, height);
        let of_pixels = |[x0, x1, y0, y1]: [u32; 4]| {
            let along = |pixel: u32, count: f64| f64::from(pixel) / count;
            [along(x0, before.0), along(x1, before.0), along(y0, before.1), along(y1, before.1)]
        };
        let windows = film.pixel_bounds.map(of_pixels).into_iter().chain(film.crop_window);
        self.crop = windows.map(|window| self.pixels_of(window)).reduce(|a, b| a.intersection(&b));
    }

    /// The options of the whole picture in a size whose longer side has this many pixels.
    #[must_use]
    pub fn smaller(&self, longer_side: f64) -> Self {
        let longer = f64::from(self.width.max(self.height).max(1));
        let side = |pixels: u32| (f64::from(pixels) * longer_side / longer).ceil().max(1.0) as u32;
        Self { width: side(self.width), height: side(self.height), crop: None, ..self.clone() }
    }

    /// The pixels whose upper left corners lie in a window x0, x1, y0, y1 of the picture, as shares in [0, 1].
    pub fn pixels_of(&self, [x0, x1, y0, y1]: [f64; 4]) -> PixelBounds {
        // A cast from a float saturates; NaN gives 0.
        let along =
            |share: f64, count: u32| (share * f64::from(count)).ceil().clamp(0.0, f64::from(count)) as u32;
        PixelBounds {
            x0: along(x0, self.width),
            y0: along(y0, self.height),
            x1: along(x1, self.width),
            y1: along(y1, self.height),
        }
    }

    /// The pixels to render.
    ///
    /// # Errors
    /// [`RenderError::Size`] and [`RenderError::EmptyCrop`].
    pub fn bounds(&self) -> Result<PixelBounds, RenderError> {
        let (width, height) = (self.width, self.height);
        let whole = PixelBounds::whole(width, height);
        if whole.is_empty() || width.max(height) > MAX_SIDE || whole.area() > MAX_PIXELS {
            return Err(RenderError::Size { width, height });
        }
        let bounds = self.crop.map_or(whole, |crop| crop.intersection(&whole));
        match self.crop {
            Some(crop) if bounds.is_empty() => Err(RenderError::EmptyCrop { crop, width, height }),
            _ => Ok(bounds),
        }
    }

    /// Bytes that a render with these options needs besides the scene: the sums of every pixel, and the pictures made
    /// of them. Small parts are not counted: coverage by channel, for coloured shadows, and twofold sums of a denoiser,
    /// for tiles that show both a shadow catcher and other things.
    ///
    /// # Errors
    /// As for [`RenderOptions::bounds`].
    pub fn memory_bytes(&self) -> Result<u64, RenderError> {
        let mut each = size_of::<Pixel>() + size_of::<Rgb>();
        if self.transparent {
            each += size_of::<f32>();
        }
        if self.features {
            each += size_of::<FeatureSums>() + 4 * size_of::<Rgb>();
        }
        each += match self.film {
            FilmKind::Rgb => 0,
            FilmKind::GBuffer(_) => size_of::<SurfaceSums>(),
            FilmKind::Spectral(buckets) => buckets.count as usize * size_of::<BucketSums>(),
        };
        each += self.film_channels() * size_of::<f32>();
        let pixels = self.bounds()?.area();
        let mut all = pixels.saturating_mul(each as u64);
        if self.guides {
            const EACH: usize = size_of::<GuideSums>() - size_of::<RatioSums<1>>();
            all = all.saturating_add(pixels.saturating_mul(EACH as u64));
            all = all.saturating_add(denoise::memory_bytes(pixels, Workers::wanted(self.threads)));
        }
        let photons = match self.integrator.kind {
            IntegratorKind::Caustics => crate::caustics::memory_bytes(self.width, self.height),
            _ => 0,
        };
        Ok(all.saturating_add(photons))
    }

    /// Number of channels of the film besides red, green and blue.
    pub fn film_channels(&self) -> usize {
        match self.film {
            FilmKind::Rgb => 0,
            FilmKind::GBuffer(_) => SurfaceSums::CHANNELS.len(),
            FilmKind::Spectral(buckets) => buckets.count as usize,
        }
    }

    /// The wavelengths of samples; `None` in RGB.
    pub(crate) fn wavelengths(&self) -> Option<WavelengthDensity> {
        let density = match self.film {
            FilmKind::Spectral(Buckets { low, high, .. }) => WavelengthDensity::Even { low, high },
            FilmKind::Rgb | FilmKind::GBuffer(_) => WavelengthDensity::Visible,
        };
        self.spectral.then_some(density)
    }

    /// How samples become the colours of pixels.
    pub(crate) fn sample_exposure(&self) -> Exposure {
        match &self.sensor_curves {
            Some(curves) if self.spectral => Exposure { sensor: curves.rec709, ..self.exposure },
            _ => self.exposure,
        }
    }

    pub(crate) fn pixel_filter(&self) -> Result<Filter, RenderError> {
        let (shape, radius) = match self.filter {
            FilterDesc::Gaussian { radius, sigma } => (FilterShape::Gaussian { sigma: sigma.into() }, radius),
            FilterDesc::Box { radius } => (FilterShape::Box, radius),
            FilterDesc::Mitchell { radius, b, c } => {
                (FilterShape::Mitchell { b: b.into(), c: c.into() }, radius)
            }
            FilterDesc::Sinc { radius, tau } => (FilterShape::Sinc { tau: tau.into() }, radius),
            FilterDesc::Triangle { radius } => (FilterShape::Triangle, radius),
        };
        Filter::new(shape, DVec2::new(radius.x.into(), radius.y.into())).ok_or(RenderError::Filter)
    }
}

#[cfg(test)]
mod tests {
    use lumbre_scene::SceneDesc;

    use super::*;

    #[test]
    fn another_size_keeps_the_share_of_the_film_s_crop() {
        let bounds = |film: FilmDesc, size: Option<(u32, u32)>| {
            let scene = Scene::build(SceneDesc { film: film.clone(), ..SceneDesc::default() }).unwrap();
            let mut options = RenderOptions::of(&scene);
            if let Some((width, height)) = size {
                options.resize(&film, width, height);
            }
            let PixelBounds { x0, y0, x1, y1 } = options.bounds().unwrap();
            [x0, x1, y0, y1]
        };
        let film = |crop_window, pixel_bounds| FilmDesc {
            width: Some(200),
            height: Some(100),
            crop_window,
            pixel_bounds,
            ..FilmDesc::default()
        };
        let window = film(Some([0.25, 0.5, 0.1, 0.9]), None);
        assert_eq!(bounds(window.clone(), None), [50, 100, 10, 90]);
        assert_eq!(bounds(window, Some((64, 64))), [16, 32, 7, 58]);
        let pixels = film(None, Some([50, 150, 20, 100]));
        assert_eq!(bounds(pixels.clone(), None), [50, 150, 20, 100]);
        assert_eq!(bounds(pixels, Some((40, 10))), [10, 30, 2, 10]);
        assert_eq!(bounds(film(None, None), Some((40, 10))), [0, 40, 0, 10]);
    }
}
