//! Staging of a model: a camera, light, and the ground.

use std::sync::Arc;

use lumbre_geometry::Aabb;
use lumbre_image::{Image, Rgb};
use lumbre_math::{DAffine3, DMat3, DVec3, Transform};

use crate::extent::Extent;
use crate::framing::{self, axes};
use crate::{
    ClearSky, EnvironmentDesc, EnvironmentMapping, GeometryDesc, GroundDesc, LightDesc, SceneDesc, ShapeDesc,
    UpAxis, Viewpoint, WithoutLight, studio,
};

/// How a description is staged. Its own parts are kept, unless stated otherwise here.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Stage {
    /// Whether to replace the description's cameras by one that frames everything.
    pub fit: bool,
    /// The picture's width and height in pixels, which the automatic camera frames for; by default the description's
    /// own, or 1200 by 900.
    pub size: Option<(u32, u32)>,
    /// The rotation of the automatic camera about the model, as a fraction of a turn; the model stays in view
    /// for all rotations. The studio rotates with the camera, as if the model turned in front of both. `None`
    /// for the still view.
    pub turns: Option<f64>,
    /// The requested view. Unless it only changes the lens, it replaces the description's cameras; the studio moves
    /// with it.
    pub view: Viewpoint,
    /// The up axis, if it differs from the description's.
    pub up: Option<UpAxis>,
    /// The environment light.
    pub surroundings: Surroundings,
    /// The ground plane.
    pub ground: Ground,
}

/// The environment light of a model.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum Surroundings {
    /// Studio light, if the description asks for it ([`SceneDesc::without_light`]).
    #[default]
    Automatic,
    /// The description's own.
    Own,
    /// Studio light in place of the description's infinite lights.
    Studio,
    /// An image in place of the description's infinite lights. The centre of a latitude-longitude image is
    /// behind the model as seen from the unrotated automatic camera.
    Map(EnvironmentDesc),
    /// A light at infinity, unrotated, instead of the description's infinite lights.
    Light(Box<LightDesc>),
    /// The sun and a clear sky instead of the description's infinite lights. North is behind the model as seen from the
    /// unrotated automatic camera.
    Sky(Box<ClearSky>),
}

/// The ground under a model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Ground {
    /// A shadow catcher if both camera and environment light are automatic; else nothing.
    #[default]
    Automatic,
    /// Nothing.
    None,
    /// A shadow catcher.
    Shadow,
    /// A matte grey plane.
    Plane,
}

impl Ground {
    /// The names, in the order of the enum.
    pub const NAMES: [&'static str; 4] = ["auto", "none", "shadow", "plane"];

    /// The ground of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        const ALL: [Ground; 4] = [Ground::Automatic, Ground::None, Ground::Shadow, Ground::Plane];
        Self::NAMES.iter().position(|known| *known == name).map(|i| ALL[i])
    }
}

/// What a [`Stage`] changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Staged {
    /// Whether the camera is automatic.
    pub framed: bool,
    /// The source of light.
    pub light: StageLight,
    /// Whether there is ground.
    pub grounded: bool,
    /// Whether the description has lights in candelas or lux but no exposure, as in glTF.
    pub photometric: bool,
    /// Whether the automatic camera uses a guessed up axis: [`SceneDesc::up_is_guessed`].
    pub guessed_up: bool,
}

/// The source of light of a staged description.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum StageLight {
    /// The description's own lights, if any.
    Own,
    /// Studio light, and the rest of the description's.
    Studio,
    /// [`Surroundings::Map`] or [`Surroundings::Light`], and the rest of the description's lights.
    Given,
}

/// The reflectance of the ground: that of light wood or concrete.
const GROUND: f32 = 0.5;
/// The distance of the ground below the lowest point, relative to the model's size, so that flat objects on it are
/// visible.
const GAP: f64 = 1e-4;
/// The size of a picture if neither the description nor its camera specifies one.
const SIZE: (u32, u32) = (1200, 900);

impl EnvironmentDesc {
    /// The mapping of an image by its aspect ratio: square, or twice as wide as high; `None` for others.
    pub fn of_image(image: Arc<Image>) -> Option<Self> {
        let (width, height) = (image.width(), image.height());
        let mapping = if width == height {
            EnvironmentMapping::EqualArea
        } else if width == height.saturating_mul(2) {
            EnvironmentMapping::LatitudeLongitude
        } else {
            return None;
        };
        Some(Self { image, mapping })
    }
}

impl Stage {
    /// Adds the missing parts of a description.
    pub fn set(&self, desc: &mut SceneDesc) -> Staged {
        let is_model = desc.without_light != WithoutLight::Dark;
        let framed =
            desc.cameras.is_empty() || self.fit || self.turns.is_some() || self.view.replaces_cameras();
        desc.up = self.up.unwrap_or(desc.up);
        let (camera, bounds) = {
            let extent = Extent::new(desc);
            (framed.then(|| self.framed(&extent, desc)), extent.bounds())
        };
        let turns = camera.as_ref().map_or(0.0, |framed| framed.turns);
        let photometric = desc.without_light == WithoutLight::StudioUnlessStaged
            && desc.lights.iter().any(|light| !matches!(light.bare(), LightDesc::Infinite { .. }));

        let light = match &self.surroundings {
            Surroundings::Map(map) => {
                remove_infinite_lights(desc);
                desc.lights.push(around(desc.up, map));
                StageLight::Given
            }
            Surroundings::Light(light) => {
                remove_infinite_lights(desc);
                desc.lights.push(LightDesc::clone(light));
                StageLight::Given
            }
            Surroundings::Sky(sky) => {
                remove_infinite_lights(desc);
                desc.lights.extend(sky.lights(&world_from_sky(desc.up)));
                StageLight::Given
            }
            Surroundings::Studio => {
                remove_infinite_lights(desc);
                StageLight::Studio
            }
            Surroundings::Automatic if wants_studio(desc) => StageLight::Studio,
            Surroundings::Automatic | Surroundings::Own => StageLight::Own,
        };
        if light == StageLight::Studio {
            desc.lights.push(studio::light(desc.up, turns));
        }
        // The build must add nothing more.
        desc.without_light = WithoutLight::Dark;

        let casts_shadow_by_default = is_model && framed && light != StageLight::Own;
        let kind = match self.ground {
            Ground::Automatic if casts_shadow_by_default => Ground::Shadow,
            Ground::Automatic => Ground::None,
            asked => asked,
        };
        let catcher = kind == Ground::Shadow;
        let ground = (kind != Ground::None).then(|| ground(&bounds, desc, catcher)).flatten();
        // Seen from below, automatic ground would hide everything.
        let is_seen_from_below = |ground: &GroundDesc| {
            let eye = camera.as_ref().map(|framed| framed.camera.world_from_camera.point(DVec3::ZERO));
            eye.is_some_and(|eye| (eye - ground.point).dot(ground.normal) < 0.0)
        };
        let ground = ground.filter(|ground| self.ground != Ground::Automatic || !is_seen_from_below(ground));
        let grounded = ground.is_some();
        desc.ground = ground.or(desc.ground);
        let aspect = self.aspect(desc);
        if !framed {
            desc.cameras.iter_mut().for_each(|camera| self.view.set_lens(camera, aspect));
        }
        if let Some(framing::Framed { camera, .. }) = camera {
            desc.cameras = vec![camera];
            if let ((None, None), None) = ((desc.film.width, desc.film.height), self.size) {
                (desc.film.width, desc.film.height) = (Some(SIZE.0), Some(SIZE.1));
            }
        }
        let guessed_up = framed && self.up.is_none() && desc.up_is_guessed;
        Staged { framed, light, grounded, photometric, guessed_up }
    }

    /// The camera that replaces those of the description, with the shutter and the handedness of the first.
    fn framed(&self, extent: &Extent, desc: &SceneDesc) -> framing::Framed {
        let points = |visit: &mut dyn FnMut(DVec3)| extent.each_point(visit);
        let own = desc.cameras.first();
        let mut framed = framing::Framing {
            up: desc.up,
            // Camera space is left-handed: only a mirror maps it to a right-handed world.
            is_left_handed: own.is_some_and(|own| !own.world_from_camera.is_mirror()),
            aspect: self.aspect(desc),
            viewpoint: &self.view,
            turns: self.turns,
        }
        .camera(&points);
        if let Some(own) = own {
            (framed.camera.shutter_open, framed.camera.shutter_close) = (own.shutter_open, own.shutter_close);
        }
        framed
    }

    fn aspect(&self, desc: &SceneDesc) -> f64 {
        let (width, height) = self.size.or(desc.film.width.zip(desc.film.height)).unwrap_or(SIZE);
        f64::from(width) / f64::from(height.max(1))
    }
}

/// Removes the lights that stand for the surroundings, also those with a spectrum.
fn remove_infinite_lights(desc: &mut SceneDesc) {
    desc.lights.retain(|light| {
        !matches!(
            light.bare(),
            LightDesc::Infinite { .. } | LightDesc::Portal { .. } | LightDesc::Disc { .. }
        )
    });
}

/// The placement of a sky: east is to the right of the automatic camera, and north away from it.
fn world_from_sky(up: UpAxis) -> Transform {
    let [right, upward, front] = axes(up, 0.0);
    Transform::from_affine(DAffine3::from_mat3(DMat3::from_cols(right, -front, upward))).unwrap_or_default()
}

/// An environment map, with the centre of a latitude-longitude image at the back.
fn around(up: UpAxis, map: &EnvironmentDesc) -> LightDesc {
    let [right, upward, front] = axes(up, 0.0);
    // x to the back, z up.
    let space = DAffine3::from_mat3(DMat3::from_cols(-front, -right, upward));
    LightDesc::Infinite {
        world_from_light: Transform::from_affine(space).unwrap_or_default(),
        radiance: Rgb::WHITE,
        image: Some(map.clone()),
    }
}

/// Whether a description has so little light of its own that it needs studio light.
pub(crate) fn wants_studio(desc: &SceneDesc) -> bool {
    match desc.without_light {
        WithoutLight::Dark => false,
        WithoutLight::StudioUnlessStaged => desc.lights.is_empty() || desc.cameras.is_empty(),
        WithoutLight::Studio => desc.lights.is_empty() && !is_emissive(desc),
    }
}

/// Whether any shape or medium emits light.
fn is_emissive(desc: &SceneDesc) -> bool {
    if desc.media.iter().any(|medium| medium.glows()) {
        return true;
    }
    let in_objects = desc.objects.iter().flat_map(|object| &object.shapes);
    let mut open: Vec<&ShapeDesc> = desc.shapes.iter().chain(in_objects).collect();
    while let Some(shape) = open.pop() {
        if shape.area_light.is_some() {
            return true;
        }
        if let GeometryDesc::Csg(csg) = &shape.geometry {
            open.extend(csg.operands.iter().flat_map(|operand| &**operand));
        }
    }
    false
}

/// The plane under everything; `None` if there is nothing.
fn ground(bounds: &Aabb, desc: &SceneDesc, catcher: bool) -> Option<GroundDesc> {
    if bounds.is_empty() || !bounds.min.is_finite() || !bounds.max.is_finite() {
        return None;
    }
    let [_, normal, _] = axes(desc.up, 0.0);
    let center = bounds.center();
    let half_height = 0.5 * bounds.size().dot(normal.abs());
    let drop = half_height + GAP * bounds.size().max_element();
    Some(GroundDesc { point: center - drop * normal, normal, reflectance: Rgb::splat(GROUND), catcher })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{AreaLightDesc, Camera, CameraKind, MaterialId, NamedMaterial, Scene};
    use lumbre_geometry::{Ray, Sphere};
    use lumbre_shading::spectrum::LightCurve;
    use lumbre_shading::{Material, SpectrumValue};

    fn ball() -> SceneDesc {
        let ball = Sphere::new(DVec3::new(3.0, 7.0, -4.0), 2.5).unwrap();
        SceneDesc {
            shapes: vec![ShapeDesc {
                index: 0,
                geometry: GeometryDesc::Exact(ball.into()),
                world_from_object: Transform::IDENTITY,
                reverse_orientation: false,
                material: Some(MaterialId(0)),
                boundary: None,
                area_light: None,
                alpha: None,
            }],
            materials: vec![NamedMaterial { name: None, material: Arc::new(Material::default_diffuse()) }],
            ..SceneDesc::default()
        }
    }

    fn camera() -> Camera {
        let kind = CameraKind::Perspective { fov: 50.0, lens_radius: 0.0, focal_distance: 1.0 };
        Camera { name: Some("own".into()), ..Camera::new(kind, Transform::IDENTITY) }
    }

    fn lamp() -> LightDesc {
        LightDesc::Point { from: DVec3::new(1.0, 2.0, 3.0), intensity: Rgb::WHITE }
    }

    #[test]
    fn a_model_alone_gets_a_camera_a_studio_and_its_shadow() {
        for up in [UpAxis::Y, UpAxis::Z] {
            let mut desc = SceneDesc { up, ..ball() };
            let staged = Stage::default().set(&mut desc);
            let expected = Staged {
                framed: true,
                light: StageLight::Studio,
                grounded: true,
                photometric: false,
                guessed_up: false,
            };
            assert_eq!(staged, expected);
            assert_eq!((desc.cameras.len(), desc.lights.len()), (1, 1));
            assert_eq!((desc.film.width, desc.film.height), (Some(1200), Some(900)));
            let scene = Scene::build(desc).unwrap();
            let ground = scene.ground().unwrap();
            assert!(ground.catcher);
            // It lies under the ball, just so that it does not touch it.
            let [_, upward, _] = axes(up, 0.0);
            let down = Ray::new(DVec3::new(3.0, 7.0, -4.0) + 9.0 * upward, -upward);
            let hits = scene.accel().count(&down);
            assert_eq!(hits, 3);
            let last = (ground.point - down.origin).dot(-upward);
            assert!(last > 11.5 && last < 11.501, "{last}");
        }
    }

    #[test]
    fn a_scene_of_its_own_is_left_alone() {
        for without_light in [WithoutLight::Studio, WithoutLight::StudioUnlessStaged, WithoutLight::Dark] {
            let mut desc =
                SceneDesc { cameras: vec![camera()], lights: vec![lamp()], without_light, ..ball() };
            let staged = Stage::default().set(&mut desc);
            let photometric = without_light == WithoutLight::StudioUnlessStaged;
            let expected = Staged {
                framed: false,
                light: StageLight::Own,
                grounded: false,
                photometric,
                guessed_up: false,
            };
            assert_eq!(staged, expected);
            assert_eq!((desc.cameras, desc.lights.len(), desc.ground), (vec![camera()], 1, None));
            assert_eq!(desc.film.width, None);
        }
    }

    #[test]
    fn a_studio_lights_what_the_description_wants_lit() {
        let glow = AreaLightDesc {
            radiance: Rgb::WHITE,
            image: None,
            by_vertices: false,
            two_sided: false,
            power: None,
            spectrum: None,
        };
        let light = |without_light, cameras: Vec<Camera>, lights: Vec<LightDesc>, glows: bool| {
            let mut desc = SceneDesc { cameras, lights, without_light, ..ball() };
            desc.shapes[0].area_light = glows.then(|| glow.clone());
            Stage::default().set(&mut desc).light
        };
        use {StageLight as L, WithoutLight as W};
        assert_eq!(light(W::Studio, vec![], vec![], true), L::Own);
        assert_eq!(light(W::Studio, vec![], vec![lamp()], false), L::Own);
        assert_eq!(light(W::StudioUnlessStaged, vec![], vec![], true), L::Studio);
        assert_eq!(light(W::StudioUnlessStaged, vec![camera()], vec![], true), L::Studio);
        assert_eq!(light(W::StudioUnlessStaged, vec![], vec![lamp()], false), L::Studio);
        assert_eq!(light(W::Dark, vec![], vec![], false), L::Own);
    }

    #[test]
    fn surroundings_replace_infinite_lights_of_any_spectrum() {
        let sky =
            LightDesc::Infinite { world_from_light: Transform::IDENTITY, radiance: Rgb::WHITE, image: None };
        let spectral = || LightDesc::Spectral {
            light: Box::new(sky.clone()),
            spectrum: Arc::new(LightCurve::of(&SpectrumValue::Blackbody(4000.0)).unwrap()),
        };
        let image = Image::filled(8, 4, Rgb::new(0.5, 1.0, 2.0));
        let map = EnvironmentDesc::of_image(Arc::new(image)).unwrap();
        let given = LightDesc::Infinite {
            world_from_light: Transform::IDENTITY,
            radiance: Rgb::new(0.2, 0.3, 0.4),
            image: None,
        };
        for surroundings in
            [Surroundings::Map(map), Surroundings::Light(Box::new(given)), Surroundings::Studio]
        {
            let mut desc = SceneDesc { lights: vec![spectral(), lamp()], ..ball() };
            Stage { surroundings, ..Stage::default() }.set(&mut desc);
            assert_eq!(desc.lights.len(), 2);
            assert!(matches!(desc.lights[0], LightDesc::Point { .. }));
            assert!(!matches!(desc.lights[1], LightDesc::Spectral { .. }));
        }
    }

    #[test]
    fn a_map_replaces_infinite_lights_only() {
        let image = Image::filled(8, 4, Rgb::new(0.5, 1.0, 2.0));
        let map = EnvironmentDesc::of_image(Arc::new(image)).unwrap();
        let sky =
            LightDesc::Infinite { world_from_light: Transform::IDENTITY, radiance: Rgb::WHITE, image: None };
        let mut desc = SceneDesc { lights: vec![sky, lamp()], ..ball() };
        let surroundings = Surroundings::Map(map);
        let staged = Stage { surroundings, ..Stage::default() }.set(&mut desc);
        assert_eq!(staged.light, StageLight::Given);
        assert_eq!(desc.lights.len(), 2);
        assert!(matches!(desc.lights[0], LightDesc::Point { .. }));
        assert!(EnvironmentDesc::of_image(Arc::new(Image::filled(9, 4, Rgb::WHITE))).is_none());
    }

    #[test]
    fn the_middle_of_a_map_is_behind_the_model() {
        // Bright in the middle columns alone.
        let pixels = (0..32 * 16).map(|i| if i % 32 == 15 || i % 32 == 16 { Rgb::WHITE } else { Rgb::BLACK });
        let image = Image::from_pixels(32, 16, pixels.collect()).unwrap();
        let map = EnvironmentDesc::of_image(Arc::new(image)).unwrap();
        for up in [UpAxis::Y, UpAxis::Z] {
            let mut desc = SceneDesc { up, ..ball() };
            Stage { surroundings: Surroundings::Map(map.clone()), ..Stage::default() }.set(&mut desc);
            let scene = Scene::build(desc).unwrap();
            let [right, _, front] = axes(up, 0.0);
            let from =
                |direction| scene.background(&Ray::new(DVec3::ZERO, direction)).map(|c| c.g).sum::<f32>();
            assert!(from(-front) > 0.99 && from(front) == 0.0 && from(right) == 0.0);
        }
    }

    #[test]
    fn the_studio_turns_with_the_camera() {
        let seen = |turns: f64| {
            let mut desc = ball();
            Stage { turns: Some(turns), ..Stage::default() }.set(&mut desc);
            let camera = desc.cameras[0].clone();
            let scene = Scene::build(desc).unwrap();
            let towards = |x, y, z| camera.world_from_camera.vector(DVec3::new(x, y, z)).normalize();
            [towards(-1.0, 0.5, 0.2), towards(1.0, 1.0, -0.5)]
                .map(|d| scene.background(&Ray::new(DVec3::ZERO, d)).map(|c| c.g).sum::<f32>())
        };
        let (start, later) = (seen(0.0), seen(0.375));
        assert!(start[0] != start[1]);
        for (a, b) in start.into_iter().zip(later) {
            assert!((a / b - 1.0).abs() < 1e-3, "{a} {b}");
        }
    }

    #[test]
    fn an_asked_view_replaces_a_camera_and_a_lens_changes_it() {
        let staged = |view: Viewpoint| {
            let mut desc = SceneDesc { cameras: vec![Camera { shutter_close: 0.25, ..camera() }], ..ball() };
            let framed = Stage { view, ..Stage::default() }.set(&mut desc).framed;
            (framed, desc.cameras[0].clone())
        };
        let lens = Viewpoint { fov: Some(20.0), ..Viewpoint::default() };
        let (framed, changed) = staged(lens);
        let narrow = CameraKind::Perspective { fov: 20.0, lens_radius: 0.0, focal_distance: 1.0 };
        assert_eq!((framed, changed), (false, Camera { kind: narrow, shutter_close: 0.25, ..camera() }));
        let eye = DVec3::new(-6.0, 2.0, 5.0);
        let (framed, placed) = staged(Viewpoint { eye: Some(eye), ..Viewpoint::default() });
        assert!(framed && placed.shutter_close == 0.25);
        assert!((placed.world_from_camera.point(DVec3::ZERO) - eye).length() < 1e-12);
        // At the middle of the model.
        let forward = placed.world_from_camera.vector(DVec3::Z);
        assert!((forward - (DVec3::new(3.0, 7.0, -4.0) - eye).normalize()).length() < 1e-12);
        // The file's camera has its right hand where x goes, so the new one has too.
        assert!(!placed.world_from_camera.is_mirror());
        assert!(staged(Viewpoint { azimuth: 30.0, ..Viewpoint::default() }).0);
    }

    #[test]
    fn the_studio_goes_around_with_the_azimuth_as_with_turns() {
        let lights = |turns: Option<f64>, azimuth: f64| {
            let mut desc = ball();
            let view = Viewpoint { azimuth, ..Viewpoint::default() };
            Stage { turns, view, ..Stage::default() }.set(&mut desc);
            let LightDesc::Infinite { world_from_light, .. } = &desc.lights[0] else { panic!() };
            world_from_light.vector(DVec3::X)
        };
        assert!((lights(Some(0.125), 0.0) - lights(None, 45.0)).length() < 1e-12);
        assert!((lights(None, 0.0) - lights(None, 45.0)).length() > 0.1);
    }

    #[test]
    fn ground_follows_the_up_axis_and_stays_below_the_camera() {
        let up = Some(UpAxis::Z);
        let mut desc = ball();
        Stage { up, ..Stage::default() }.set(&mut desc);
        let ground = desc.ground.unwrap();
        assert_eq!(ground.normal, DVec3::Z);
        assert!((ground.point.z + 6.5).abs() < 1e-3, "{ground:?}");
        let view = Viewpoint { elevation: -60.0, ..Viewpoint::default() };
        let mut desc = ball();
        let staged = Stage { view: view.clone(), ..Stage::default() }.set(&mut desc);
        assert!(!staged.grounded && desc.ground.is_none());
        let staged = Stage { view, ground: Ground::Plane, ..Stage::default() }.set(&mut ball());
        assert!(staged.grounded);
    }

    #[test]
    fn every_ground_has_its_name() {
        for (name, ground) in
            Ground::NAMES.into_iter().zip([Ground::Automatic, Ground::None, Ground::Shadow, Ground::Plane])
        {
            assert_eq!(Ground::from_name(name), Some(ground));
        }
        assert_eq!(Ground::from_name("floor"), None);
    }
}
