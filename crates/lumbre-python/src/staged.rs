//! A scene as its pictures show it: on a stage, with overrides. Pictures that differ in cameras and lights alone share
//! a tree.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use lumbre::description::{ClearSky, GroundPlane, IntegratorKind, LightDesc};
use lumbre::{DVec3, EnvironmentDesc, Ground, Prepared, SceneDesc, Setting, Stage, Surroundings, Viewpoint};

/// How a scene is to be shown.
#[derive(Clone, Debug, Default)]
pub(crate) struct SceneRequest {
    /// For which pictures; only the camera that frames everything depends on it.
    pub(crate) size: Option<(u32, u32)>,
    pub(crate) integrator: Option<IntegratorKind>,
    /// What is asked of the camera that frames everything.
    pub(crate) view: Viewpoint,
    /// Whether that camera stands in the place of the scene's own.
    pub(crate) fit: bool,
    /// The place of a camera that is not the scene's.
    pub(crate) eye: Option<DVec3>,
    pub(crate) ground: Ground,
    pub(crate) surroundings: Around,
    /// Parameters of the description, as `material.NAME.PARAM=VALUE`.
    pub(crate) overrides: Vec<String>,
}

/// The light from all around.
#[derive(Clone, Debug, Default)]
pub(crate) enum Around {
    #[default]
    Automatic,
    Own,
    Studio,
    /// A map, with its middle behind the model.
    Map(EnvironmentDesc),
    /// A light as it stands.
    Light(Arc<LightDesc>),
    /// The sun and a clear sky.
    Sky(Box<ClearSky>),
}

impl Around {
    /// Whether it is the very same.
    fn is(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Map(a), Self::Map(b)) => Arc::ptr_eq(&a.image, &b.image),
            (Self::Light(a), Self::Light(b)) => Arc::ptr_eq(a, b),
            (Self::Sky(a), Self::Sky(b)) => a == b,
            _ => std::mem::discriminant(self) == std::mem::discriminant(other),
        }
    }
}

/// A scene on its stage, as the program shows it.
pub(crate) struct PreparedScene {
    pub(crate) scene: Arc<lumbre::Scene>,
    pub(crate) prepared: Prepared,
}

/// A description with its overrides, and the trees of it.
struct Base {
    overrides: Vec<String>,
    desc: Arc<SceneDesc>,
    /// Of what is there alone.
    scene: Arc<lumbre::Scene>,
    /// With ground under it.
    grounded: Mutex<Vec<Arc<lumbre::Scene>>>,
}

/// What is built for the pictures of one scene; the last of it is kept.
pub(crate) struct Stages {
    own: Arc<Base>,
    others: Mutex<Vec<Arc<Base>>>,
    shown: Mutex<Vec<(SceneRequest, Arc<PreparedScene>)>>,
    /// Trees that were built so far.
    trees: AtomicUsize,
    /// Held by the thread of Python that builds, so that threads which ask for the same build it once.
    pub(crate) building: Mutex<()>,
}

/// How many of the last stages, descriptions with overrides, and trees with ground are kept.
const KEPT: usize = 2;

impl Stages {
    pub(crate) fn new(desc: Arc<SceneDesc>, scene: Arc<lumbre::Scene>) -> Self {
        let own = Base { overrides: Vec::new(), desc, scene, grounded: Mutex::default() };
        Self {
            own: Arc::new(own),
            others: Mutex::default(),
            shown: Mutex::default(),
            trees: AtomicUsize::new(1),
            building: Mutex::default(),
        }
    }

    /// Trees that were built so far, that of ray queries included.
    pub(crate) fn trees(&self) -> usize {
        self.trees.load(Ordering::Relaxed)
    }

    /// The stage of a picture: that of an earlier one where it shows the same.
    pub(crate) fn shown(&self, wish: &SceneRequest) -> Result<Arc<PreparedScene>, lumbre::Error> {
        let mut wish = wish.clone();
        if wish.eye.is_some() {
            // The camera that frames everything is not looked through.
            (wish.size, wish.view) = (None, Viewpoint::default());
        }
        let shown = self.kept_or_staged(&wish)?;
        let is_hidden =
            |ground: &GroundPlane| wish.eye.is_some_and(|eye| (eye - ground.point).dot(ground.normal) < 0.0);
        // From below, ground that nobody asked for would hide everything.
        if wish.ground == Ground::Automatic
            && shown.prepared.is_grounded()
            && shown.scene.resolved().ground().is_some_and(is_hidden)
        {
            return self.kept_or_staged(&SceneRequest { ground: Ground::None, ..wish });
        }
        Ok(shown)
    }

    fn kept_or_staged(&self, wish: &SceneRequest) -> Result<Arc<PreparedScene>, lumbre::Error> {
        if let Some((_, shown)) = found(&self.shown, |(other, _)| wish.shows_the_same(other)) {
            return Ok(shown);
        }
        let shown = Arc::new(self.staged(wish)?);
        keep(&self.shown, (wish.clone(), Arc::clone(&shown)));
        Ok(shown)
    }

    fn staged(&self, wish: &SceneRequest) -> Result<PreparedScene, lumbre::Error> {
        let base = self.base(&wish.overrides)?;
        let mut desc = SceneDesc::clone(&base.desc);
        let mut stage = Stage::default();
        (stage.size, stage.view, stage.ground) = (wish.size, wish.view.clone(), wish.ground);
        stage.fit = wish.fit || wish.eye.is_some();
        stage.surroundings = match &wish.surroundings {
            Around::Automatic => Surroundings::Automatic,
            Around::Own => Surroundings::Own,
            Around::Studio => Surroundings::Studio,
            Around::Map(map) => Surroundings::Map(map.clone()),
            Around::Light(light) => Surroundings::Light(Box::new(LightDesc::clone(light))),
            Around::Sky(sky) => Surroundings::Sky(sky.clone()),
        };
        let prepared = lumbre::prepare(&mut desc, &stage, wish.integrator);
        if prepared.is_bare() && !wish.view.changes_lens() {
            return Ok(PreparedScene { scene: Arc::clone(&base.scene), prepared });
        }
        if !prepared.is_grounded() {
            return Ok(PreparedScene { scene: Arc::new(base.scene.relit(&desc)?), prepared });
        }
        let wanted = desc.ground;
        let stands_on = |scene: &Arc<lumbre::Scene>| {
            scene.resolved().ground().zip(wanted).is_some_and(|(has, wants)| {
                (has.point, has.catcher) == (wants.point, wants.catcher)
                    && has.normal == wants.normal.normalize()
            })
        };
        if let Some(tree) = found(&base.grounded, stands_on) {
            return Ok(PreparedScene { scene: Arc::new(tree.relit(&desc)?), prepared });
        }
        let scene = Arc::new(self.built(desc)?);
        keep(&base.grounded, Arc::clone(&scene));
        Ok(PreparedScene { scene, prepared })
    }

    fn built(&self, desc: SceneDesc) -> Result<lumbre::Scene, lumbre::Error> {
        self.trees.fetch_add(1, Ordering::Relaxed);
        lumbre::Scene::from_description(desc)
    }

    /// The description with these overrides.
    fn base(&self, overrides: &[String]) -> Result<Arc<Base>, lumbre::Error> {
        if overrides.is_empty() {
            return Ok(Arc::clone(&self.own));
        }
        if let Some(found) = found(&self.others, |base| base.overrides == overrides) {
            return Ok(found);
        }
        let mut desc = SceneDesc::clone(&self.own.desc);
        for text in overrides {
            let setting = text.parse::<Setting>().and_then(|setting| setting.apply(&mut desc));
            setting.map_err(|wrong| lumbre::Error::Options(format!("overrides: {wrong}")))?;
        }
        let scene = Arc::new(self.built(desc.clone())?);
        let overrides = overrides.to_vec();
        let base = Arc::new(Base { overrides, desc: Arc::new(desc), scene, grounded: Mutex::default() });
        keep(&self.others, Arc::clone(&base));
        Ok(base)
    }
}

impl SceneRequest {
    /// Whether pictures of both are of one stage, wherever their cameras stand.
    fn shows_the_same(&self, other: &Self) -> bool {
        let needs_light = |wish: &Self| wish.integrator.map(|kind| kind.needs_light());
        (self.size, &self.view, self.fit, self.ground, &self.overrides)
            == (other.size, &other.view, other.fit, other.ground, &other.overrides)
            && needs_light(self) == needs_light(other)
            && self.eye.is_some() == other.eye.is_some()
            && self.surroundings.is(&other.surroundings)
    }

    /// What a picture depends on of this, by name.
    pub(crate) fn settings(&self) -> Vec<(String, String)> {
        let default = Self::default();
        let mut settings = Vec::new();
        let mut add = |name: &str, text: String| settings.push((name.to_owned(), text));
        if self.view != default.view {
            add("viewpoint", lumbre::in_words(&self.view));
        }
        if self.fit {
            add("fit", "true".to_owned());
        }
        if self.ground != default.ground {
            add("ground", lumbre::in_words(&self.ground));
        }
        match &self.surroundings {
            Around::Automatic => {}
            Around::Own => add("env", "none".to_owned()),
            Around::Studio => add("env", "studio".to_owned()),
            Around::Map(map) => add("env", format!("map {}", hash(&map.image))),
            Around::Sky(sky) => add("env", format!("sky {}", lumbre::in_words(sky.desc()))),
            Around::Light(light) => match light.bare() {
                LightDesc::Infinite { world_from_light, radiance, image } => {
                    let image = image.as_ref().map_or_else(String::new, |map| hash(&map.image));
                    let light = [lumbre::in_words(world_from_light), lumbre::in_words(radiance), image];
                    add("env", format!("light {}", light.join(" ")));
                }
                other => add("env", lumbre::in_words(other)),
            },
        }
        if !self.overrides.is_empty() {
            add("overrides", self.overrides.join("; "));
        }
        settings
    }
}

/// One of the last that were kept; it counts as the last from now on.
fn found<T: Clone>(kept: &Mutex<Vec<T>>, is_wanted: impl Fn(&T) -> bool) -> Option<T> {
    // Nothing is built while this is locked: a thread of the pool that waits for its work takes up other work, which
    // may want this, too.
    let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
    let position = kept.iter().position(is_wanted)?;
    let wanted = kept.remove(position);
    kept.push(wanted.clone());
    Some(wanted)
}

fn keep<T>(kept: &Mutex<Vec<T>>, last: T) {
    let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
    kept.push(last);
    let surplus = kept.len().saturating_sub(KEPT);
    kept.drain(..surplus);
}

/// A hash of an image's pixels, the same in every process of this version.
fn hash(image: &lumbre::image::Image) -> String {
    // FNV-1a, by whole numbers.
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    let numbers = image.pixels().iter().flat_map(|pixel| pixel.to_array());
    for bits in [image.width(), image.height()].into_iter().chain(numbers.map(f32::to_bits)) {
        hash = (hash ^ u64::from(bits)).wrapping_mul(0x0000_0100_0000_01b3);
    }
    format!("{hash:016x}")
}
