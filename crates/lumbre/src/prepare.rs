//! How the picture of a staged scene is made and shown unless the caller chooses otherwise: for the program, the
//! viewer, Python and the browser alike.

use lumbre_formats::image::ExrPrecision;
use lumbre_image::ToneMap;
use lumbre_math::Elementary;
use lumbre_render::Stop;
use lumbre_scene::{FilmKind, Ground, IntegratorKind, Stage, StageLight, Staged};

use crate::{Background, Error, RenderOptions, SaveOptions, Scene, SceneDesc};

/// Samples per pixel of a bare model, which is denoised.
const MODEL_SPP: u32 = 16;

/// What a description became on its stage, and so how its picture is made and shown unless the caller chooses
/// otherwise.
#[derive(Clone, Copy, Debug)]
pub struct Prepared {
    staged: Staged,
    is_of_light: bool,
}

/// Sets a description on a stage for its picture, as all front ends do before they build it; `integrator` replaces the
/// description's own.
///
/// A picture of normals and the like shows the model alone, unless the stage asks for ground.
///
/// ```no_run
/// use lumbre::{ReadOptions, Scene, Stage};
///
/// let (mut desc, _) = lumbre::describe(&["model.glb".as_ref()], &ReadOptions::default())?;
/// let prepared = lumbre::prepare(&mut desc, &Stage::default(), None);
/// let scene = Scene::from_description(desc)?;
/// let options = prepared.options(&scene, None, None);
/// let mut picture = scene.render(&options)?;
/// if prepared.denoises() {
///     picture.denoise(options.threads)?;
/// }
/// if let Some(background) = prepared.background() {
///     picture = picture.over(background);
/// }
/// picture.save_with("model.png".as_ref(), &prepared.save_options(&scene), &[])?;
/// # Ok::<(), lumbre::Error>(())
/// ```
pub fn prepare(desc: &mut SceneDesc, stage: &Stage, integrator: Option<IntegratorKind>) -> Prepared {
    let is_of_light = integrator.unwrap_or(desc.integrator.kind).needs_light();
    let mut stage = stage.clone();
    let asks_for_ground = matches!(stage.ground, Ground::Shadow | Ground::Plane);
    if !is_of_light && !asks_for_ground {
        stage.ground = Ground::None;
    }
    Prepared { staged: stage.set(desc), is_of_light }
}

impl Prepared {
    /// What the stage changed.
    pub fn staged(&self) -> &Staged {
        &self.staged
    }

    /// Whether its pictures show light, and not features such as normals.
    pub fn is_of_light(&self) -> bool {
        self.is_of_light
    }

    /// Whether the stage has changed nothing, so that the scene of the bare description is that of its pictures, too.
    pub fn is_bare(&self) -> bool {
        !self.staged.framed && !self.staged.grounded && self.staged.light == StageLight::Own
    }

    /// Whether there is ground under what the description has.
    pub fn is_grounded(&self) -> bool {
        self.staged.grounded
    }

    /// What is behind the picture, which then is rendered without its background: the paper of a studio. `None` for
    /// what the scene has.
    pub fn background(&self) -> Option<Background> {
        (self.is_of_light && self.staged.light == StageLight::Studio).then(Background::studio)
    }

    /// Whether the noise is taken out of its picture, where nobody says otherwise: in the light of the studio, and of a
    /// model without a camera in that of an environment map.
    pub fn denoises(&self) -> bool {
        let is_staged = match self.staged.light {
            StageLight::Studio => true,
            StageLight::Given => self.staged.framed,
            _ => false,
        };
        is_staged && self.is_of_light
    }

    /// Samples per pixel of a picture whose noise is taken out, where neither the caller nor the file says how many: 16
    /// where [`Prepared::denoises`] holds.
    pub fn spp(&self, scene: &Scene) -> Option<u32> {
        (self.denoises() && scene.resolved().sampler().spp.is_none()).then_some(MODEL_SPP)
    }

    /// The options of the picture of the built scene; `integrator` and `size` replace the scene's own. With
    /// [`Prepared::denoises`], samples suffice for that, and the guides are rendered.
    pub fn options(
        &self,
        scene: &Scene,
        integrator: Option<IntegratorKind>,
        size: Option<(u32, u32)>,
    ) -> RenderOptions {
        let mut options = scene.options();
        options.integrator.kind = integrator.unwrap_or(options.integrator.kind);
        let kind = options.integrator.kind;
        if kind.is_feature() {
            options.film = FilmKind::Rgb;
        }
        options.spectral &= kind.carries_wavelengths();
        if let Some((width, height)) = size {
            options.resize(scene.resolved().film(), width, height);
        }
        options.transparent = self.background().is_some();
        options.guides = self.denoises();
        options.stop = Stop::usual(kind, self.spp(scene).or(scene.resolved().sampler().spp));
        options
    }

    /// How the picture is saved; [`Prepared::exposure`] tells the exposure.
    pub fn save_options(&self, scene: &Scene) -> SaveOptions {
        let mut save = SaveOptions::default();
        save.tone_map = self.tone_map();
        if scene.resolved().film().single_precision {
            save.exr_precision = ExrPrecision::Float;
        }
        save
    }

    /// The tone mapping of pictures for displays: neutral in the light of a stage.
    pub fn tone_map(&self) -> ToneMap {
        let is_shown = self.is_of_light && self.staged.light != StageLight::Own;
        if is_shown { ToneMap::Neutral } else { ToneMap::None }
    }

    /// The stops of pictures for displays: 0, unless a glTF's own lights would make the picture white or black.
    ///
    /// # Errors
    /// [`Error::Render`] where no picture can be rendered with these options.
    pub fn exposure(&self, scene: &Scene, options: &RenderOptions) -> Result<f32, Error> {
        if !self.staged.photometric || !self.is_of_light {
            return Ok(0.0);
        }
        // In tenths, if white is more than one stop too bright or three too dark.
        Ok(match scene.white_level(options)? {
            Some(level) if !(0.125..=2.0).contains(&level) => {
                (-10.0 * level.logarithm_2()).rounded().clamp(-1000.0, 1000.0) / 10.0
            }
            _ => 0.0,
        })
    }
}
