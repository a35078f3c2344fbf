//! How the picture of a staged scene is made and shown where nobody says otherwise: for the program, and for other
//! front ends.

use lumbre::description::IntegratorKind;
use lumbre::image::ToneMap;
use lumbre::math::Elementary;
use lumbre::{Background, Error, Ground, RenderOptions, Scene, SceneDesc, Stage, StageLight, Staged};

/// Samples per pixel of a bare model, which is denoised.
const MODEL_SPP: u32 = 16;

/// What is to be known of a scene on its stage.
#[derive(Clone, Copy, Debug)]
pub struct Defaults {
    staged: Staged,
    is_of_light: bool,
}

impl Defaults {
    /// Sets a description on the stage that nobody has asked to be otherwise, for a picture of this size. `integrator`
    /// is the one in place of the description's own.
    pub fn stage(desc: &mut SceneDesc, size: Option<(u32, u32)>, integrator: Option<IntegratorKind>) -> Self {
        let mut stage = Stage::default();
        stage.size = size;
        Self::on(&stage, desc, integrator)
    }

    /// Sets a description on this stage, as [`Defaults::stage`] does on that which nobody has asked to be otherwise.
    pub fn on(stage: &Stage, desc: &mut SceneDesc, integrator: Option<IntegratorKind>) -> Self {
        let is_of_light = integrator.unwrap_or(desc.integrator.kind).needs_light();
        let mut stage = stage.clone();
        stage.ground = Self::ground(stage.ground, is_of_light);
        Self::new(stage.set(desc), is_of_light)
    }

    /// Those of a description that was set on a stage.
    pub(crate) fn new(staged: Staged, is_of_light: bool) -> Self {
        Self { staged, is_of_light }
    }

    /// The ground of a picture: those of normals and the like show the model alone, unless ground is asked for.
    pub(crate) fn ground(asked: Ground, is_of_light: bool) -> Ground {
        if is_of_light || matches!(asked, Ground::Shadow | Ground::Plane) { asked } else { Ground::None }
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
    /// where [`Defaults::denoises`] holds.
    pub fn spp(&self, scene: &Scene) -> Option<u32> {
        (self.denoises() && scene.resolved().sampler().spp.is_none()).then_some(MODEL_SPP)
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
