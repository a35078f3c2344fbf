//! The closed set of cameras.

use std::borrow::Cow;
use std::sync::Arc;

use lumbre_geometry::Ray;
use lumbre_math::warp64::{equal_area_square_to_sphere, equal_area_wrap, square_to_disk};
use lumbre_math::{
    AnimatedTransform, DAffine3, DMat3, DVec2, DVec3, Elementary, SingularTransformError, Transform,
};
use lumbre_simd::{Double, Real, V3};

use crate::viewpoint::half_window;
use crate::{BuildError, Footprint, Lens, MediumId, MeshCamera};

/// The mapping of directions to the picture of a spherical camera.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum SphericalMapping {
    /// Equal areas (Clarberg 2008).
    #[default]
    EqualArea,
    /// Longitude and latitude.
    Equirectangular,
    /// One of POV-Ray's wide projections.
    Wide(WideProjection),
}

/// POV-Ray's projections of wide views. The picture is around +z, with y up; angles are in degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum WideProjection {
    /// The distance from the middle of the picture is the angle from the axis: `angle` across the unit circle, outside
    /// outside of which the picture is black. `size` is the size of the picture.
    Fisheye {
        /// Across the circle.
        angle: f64,
        /// Width and height of the picture, in radii of the circle halved.
        size: DVec2,
    },
    /// Angles to the side and upwards.
    UltraWide {
        /// Across and upwards.
        angles: DVec2,
    },
    /// Half a turn across; straight upwards.
    Panoramic {
        /// The lengths of the vectors to the right, up and forwards.
        axes: DVec3,
    },
    /// A turn about the vertical axis; straight upwards.
    UprightCylinder {
        /// Across.
        angle: f64,
        /// The height of the picture at distance 1.
        height: f64,
        /// Whether heights move the eye and not the view.
        moves: bool,
    },
    /// A turn about the horizontal axis; straight sideways.
    LyingCylinder {
        /// From bottom to top.
        angle: f64,
        /// The width of the picture at distance 1.
        width: f64,
        /// Whether widths move the eye and not the view.
        moves: bool,
    },
    /// Longitude and latitude.
    Sphere {
        /// Across and upwards.
        angles: DVec2,
    },
}

impl WideProjection {
    /// The origin and the direction of the ray at a point of the picture, both coordinates from -1/2 to 1/2; `None`
    /// outside of the visible part.
    fn line(&self, at: DVec2) -> Option<(DVec3, DVec3)> {
        let center = DVec3::ZERO;
        Some(match *self {
            Self::Fisheye { angle, size } => {
                let place = 2.0 * at * size;
                let radius = place.length();
                if radius > 1.0 {
                    return None;
                }
                let (sine, cosine) = (radius * 0.5 * angle.to_radians()).sine_cosine();
                let side = if radius > 0.0 { place / radius } else { DVec2::ZERO };
                (center, (side * sine).extend(cosine))
            }
            Self::UltraWide { angles } => {
                let (sx, cx) = (at.x * angles.x.to_radians()).sine_cosine();
                let (sy, cy) = (at.y * angles.y.to_radians()).sine_cosine();
                (center, DVec3::new(sx, sy, cx * cy))
            }
            Self::Panoramic { axes } => {
                let (sine, cosine) = (std::f64::consts::PI * (0.5 - at.x)).sine_cosine();
                let height = (std::f64::consts::PI * at.y).tangent();
                (center, DVec3::new(cosine, height, sine) * axes)
            }
            Self::UprightCylinder { angle, height, moves } => {
                let (sine, cosine) = (at.x * angle.to_radians()).sine_cosine();
                let y = at.y * height;
                if moves {
                    (DVec3::Y * y, DVec3::new(sine, 0.0, cosine))
                } else {
                    (center, DVec3::new(sine, y, cosine))
                }
            }
            Self::LyingCylinder { angle, width, moves } => {
                let (sine, cosine) = (at.y * angle.to_radians()).sine_cosine();
                let x = at.x * width;
                if moves {
                    (DVec3::X * x, DVec3::new(0.0, sine, cosine))
                } else {
                    (center, DVec3::new(x, sine, cosine))
                }
            }
            Self::Sphere { angles } => {
                let (sx, cx) = (at.x * angles.x.to_radians()).sine_cosine();
                let (sy, cy) = (at.y * angles.y.to_radians()).sine_cosine();
                (center, DVec3::new(sx * cy, sy, cx * cy))
            }
        })
    }
}

/// The kinds of camera. Camera space is pbrt's: x right, y up, z forward (left-handed).
#[derive(Clone, Debug, PartialEq)]
pub enum CameraKind {
    /// A pinhole or a thin lens.
    Perspective {
        /// Full field of view in degrees along the shorter side of the picture.
        fov: f64,
        /// 0 for a pinhole.
        lens_radius: f64,
        /// Distance of the focal plane along z.
        focal_distance: f64,
    },
    /// An orthographic camera.
    Orthographic {
        /// 0 for no lens.
        lens_radius: f64,
        /// Distance of the focal plane along z.
        focal_distance: f64,
    },
    /// All directions at once.
    Spherical {
        /// The mapping of directions.
        mapping: SphericalMapping,
    },
    /// A lens of several surfaces before a film; units of the world are metres.
    Realistic(Arc<Lens>),
    /// Faces of meshes in the world, each of which a ray leaves; the placement of the camera does not move them.
    Mesh(Arc<MeshCamera>),
}

impl CameraKind {
    /// Its name in the scene language.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Perspective { .. } => "perspective",
            Self::Orthographic { .. } => "orthographic",
            Self::Spherical { .. } => "spherical",
            Self::Realistic(_) => "realistic",
            Self::Mesh(_) => "mesh",
        }
    }
}

/// A camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Its name, if the file gives one.
    pub name: Option<String>,
    /// Its kind.
    pub kind: CameraKind,
    /// Its placement; if it moves, the one when the shutter opens.
    pub world_from_camera: Transform,
    /// Its motion while the shutter is open, if it moves.
    pub motion: Option<Arc<AnimatedTransform>>,
    /// The aspect ratio, width over height, if it is not that of the pixels.
    pub frame_aspect: Option<f64>,
    /// The screen window (x min, x max, y min, y max); default [-1, 1] along the shorter side.
    pub screen_window: Option<[f64; 4]>,
    /// The time when the shutter opens, in the units of animation keys.
    pub shutter_open: f64,
    /// The time when it closes; not before it opens.
    pub shutter_close: f64,
    /// The medium around it; `None` is a vacuum.
    pub medium: Option<MediumId>,
    /// What is in front of this plane the camera does not see.
    pub clip: Option<ClipPlane>,
}

/// A plane that hides everything in front of it from the camera. Camera rays begin behind it; light and shadows ignore
/// it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClipPlane {
    /// A point of it.
    pub point: DVec3,
    /// The unit normal: what is on its side is not seen.
    pub normal: DVec3,
}

impl ClipPlane {
    /// Where a ray from `origin` begins to see.
    fn start(&self, origin: DVec3, direction: DVec3) -> DVec3 {
        // Of a ray that stays in front, only what is infinitely far away is left.
        const FAR: f64 = 1e9;
        let height = (origin - self.point).dot(self.normal);
        if height <= 0.0 {
            return origin;
        }
        let distance = -height / direction.dot(self.normal);
        let is_reached = 0.0 < distance && distance < FAR * (1.0 + height);
        origin + direction * if is_reached { distance } else { FAR * (1.0 + height) }
    }
}

impl Camera {
    /// A static camera without a name, with the aspect ratio of its picture, and with the shutter open from time 0 to
    /// 1.
    pub fn new(kind: CameraKind, world_from_camera: Transform) -> Self {
        Self {
            name: None,
            kind,
            world_from_camera,
            motion: None,
            frame_aspect: None,
            screen_window: None,
            shutter_open: 0.0,
            shutter_close: 1.0,
            medium: None,
            clip: None,
        }
    }

    /// The part of the image plane that the picture shows, whatever its size: x0, x1, y0, y1, in units of half the
    /// field of view, or for an orthographic camera in those of the world; `None` if that follows from the size.
    pub fn window(&self) -> Option<[f64; 4]> {
        self.screen_window.or_else(|| self.frame_aspect.map(window))
    }

    /// A pinhole camera at `eye` that looks at `target`, with `up` upwards in the picture, in a right-handed world:
    /// objects on the right are on the right of the picture. `fov` is the full field of view in degrees along the
    /// shorter side.
    ///
    /// # Errors
    /// [`SingularTransformError`] if eye and target coincide, the view is along `up`, or something is not finite.
    pub fn perspective(
        eye: DVec3,
        target: DVec3,
        up: DVec3,
        fov: f64,
    ) -> Result<Self, SingularTransformError> {
        let focal_distance = eye.distance(target);
        let kind = CameraKind::Perspective { fov, lens_radius: 0.0, focal_distance };
        Ok(Self::new(kind, Self::looking(eye, target, up)?))
    }

    /// The same camera without perspective: the shorter side of the picture is `height` long in the world.
    ///
    /// # Errors
    /// As for [`Camera::perspective`].
    pub fn orthographic(
        eye: DVec3,
        target: DVec3,
        up: DVec3,
        height: f64,
    ) -> Result<Self, SingularTransformError> {
        let kind = CameraKind::Orthographic { lens_radius: 0.0, focal_distance: eye.distance(target) };
        // The screen window of unit half height, scaled.
        let scale = Transform::scale(DVec3::new(0.5 * height, 0.5 * height, 1.0))?;
        Ok(Self::new(kind, Self::looking(eye, target, up)? * scale))
    }

    /// All directions at once, by longitude and latitude, with `target` in the middle of the picture.
    ///
    /// # Errors
    /// As for [`Camera::perspective`].
    pub fn panorama(eye: DVec3, target: DVec3, up: DVec3) -> Result<Self, SingularTransformError> {
        let kind = CameraKind::Spherical { mapping: SphericalMapping::Equirectangular };
        // -x is in the middle of the picture, and -z to the right of it.
        let turn = DAffine3::from_mat3(DMat3::from_cols(-DVec3::Z, DVec3::Y, -DVec3::X));
        Ok(Self::new(kind, Self::looking(eye, target, up)? * Transform::from_affine(turn)?))
    }

    /// Adds a thin lens of this radius, focused at the distance of `target`; a panorama has no lens.
    #[must_use]
    pub fn with_lens(mut self, radius: f64) -> Self {
        if let CameraKind::Perspective { lens_radius, .. } | CameraKind::Orthographic { lens_radius, .. } =
            &mut self.kind
        {
            *lens_radius = radius;
        }
        self
    }

    /// Camera space is left-handed: in a right-handed world its x axis is mirrored.
    fn looking(eye: DVec3, target: DVec3, up: DVec3) -> Result<Transform, SingularTransformError> {
        let mirror = Transform::scale(DVec3::new(-1.0, 1.0, 1.0))?;
        Ok(Transform::look_at_left(eye, target, up)?.inverse() * mirror)
    }
}

/// A camera ray with its footprint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraRay {
    /// The ray; its direction is unit.
    pub ray: Ray,
    /// The rays through neighbouring points of the film.
    pub footprint: Footprint,
    /// The factor from the radiance of the ray to the picture: 1, except for real lenses. 0 if the lens stops the ray,
    /// outside of the visible part of a wide camera, or where a mesh has no face for it.
    pub weight: f64,
}

/// A camera with a picture size, which gives the ray for every point of the film.
///
/// Points of the film are in pixels: (0, 0) is the upper left corner of the upper left pixel, whose centre is
/// (½, ½).
#[derive(Clone, Debug)]
pub struct View {
    kind: CameraKind,
    world_from_camera: Transform,
    motion: Option<Arc<AnimatedTransform>>,
    shutter_open: f64,
    shutter_close: f64,
    medium: Option<MediumId>,
    clip: Option<ClipPlane>,
    // The screen position of the film's (0, 0), and the size of a pixel on the screen. The screen of a
    // perspective camera is at z = 1, that of a spherical one is the unit square, that of a lens its film, that of
    // meshes the film in pixels.
    corner: DVec2,
    step: DVec2,
    size: [u32; 2],
}

/// The part of the image plane that a picture of an aspect ratio shows: see [`Camera::window`].
fn window(aspect: f64) -> [f64; 4] {
    let half = half_window(aspect);
    [-half.x, half.x, -half.y, half.y]
}

impl View {
    /// `camera` with a picture of `width` × `height` pixels, both at least 1.
    pub fn new(camera: &Camera, width: u32, height: u32) -> Self {
        let pixels = DVec2::new(f64::from(width.max(1)), f64::from(height.max(1)));
        let [x0, x1, y0, y1] = camera.window().unwrap_or_else(|| window(pixels.x / pixels.y));
        let (corner, opposite) = match camera.kind {
            CameraKind::Perspective { fov, .. } => {
                let slope = (0.5 * fov.to_radians()).tangent();
                (slope * DVec2::new(x0, y1), slope * DVec2::new(x1, y0))
            }
            CameraKind::Orthographic { .. } => (DVec2::new(x0, y1), DVec2::new(x1, y0)),
            CameraKind::Spherical { .. } => (DVec2::ZERO, DVec2::ONE),
            CameraKind::Mesh(_) => (DVec2::ZERO, pixels),
            // A lens inverts its picture.
            CameraKind::Realistic(ref lens) => {
                let half = lens.half_film(pixels.x / pixels.y);
                (DVec2::new(half.x, -half.y), DVec2::new(-half.x, half.y))
            }
        };
        Self {
            kind: camera.kind.clone(),
            world_from_camera: camera.world_from_camera,
            motion: camera.motion.clone(),
            shutter_open: camera.shutter_open,
            shutter_close: camera.shutter_close,
            medium: camera.medium,
            clip: camera.clip,
            corner,
            step: (opposite - corner) / pixels,
            size: [width.max(1), height.max(1)],
        }
    }

    /// The pixels of the picture: how many across and down.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// The time at a fraction of the exposure: 0 is when the shutter opens, 1 when it closes.
    pub fn time(&self, part: f64) -> f64 {
        self.shutter_open + part * (self.shutter_close - self.shutter_open)
    }

    /// The medium around the camera.
    pub fn medium(&self) -> Option<MediumId> {
        self.medium
    }

    /// Whether the camera moves.
    pub fn moves(&self) -> bool {
        self.motion.is_some()
    }

    /// The ray at a time through a point of the film and a point of the lens (two uniform numbers). Its
    /// footprint is given by the rays `spacing` pixels to the right and below.
    pub fn ray(&self, film: DVec2, lens: DVec2, time: f64, spacing: f64) -> CameraRay {
        let placement = self.placement(time);
        let line = |film| self.line(&placement, film, lens);
        let (origin, direction, weight) = line(film);
        let (x_origin, x_direction, x_weight) = line(film + DVec2::new(spacing, 0.0));
        let (y_origin, y_direction, y_weight) = line(film + DVec2::new(0.0, spacing));
        let footprint = if x_weight > 0.0 && y_weight > 0.0 {
            Footprint::Neighbours { x_origin, x_direction, y_origin, y_direction }
        } else {
            Footprint::Point
        };
        CameraRay { ray: Ray::new(origin, direction).at_time(time), footprint, weight }
    }

    /// [`View::ray`] without a footprint.
    pub fn bare_ray(&self, film: DVec2, lens: DVec2, time: f64) -> CameraRay {
        let (origin, direction, weight) = self.line(&self.placement(time), film, lens);
        CameraRay { ray: Ray::new(origin, direction).at_time(time), footprint: Footprint::Point, weight }
    }

    /// The depth of a world-space point along the camera's axis at a time; for a spherical camera, the
    /// distance; for one of meshes, which has no axis, the distance from the origin of its space.
    pub fn depth(&self, point: DVec3, time: f64) -> f64 {
        let placement = self.placement(time);
        let local = placement.inverse_point(point);
        match self.kind {
            CameraKind::Spherical { .. } | CameraKind::Mesh(_) => placement.vector(local).length(),
            _ => placement.vector(DVec3::Z).length() * local.z,
        }
    }

    /// The placement at a time: from camera space to the world.
    pub fn placement(&self, time: f64) -> Cow<'_, Transform> {
        match &self.motion {
            None => Cow::Borrowed(&self.world_from_camera),
            Some(motion) => Cow::Owned(motion.at(time)),
        }
    }

    /// The screen position of a film point: for a perspective camera at z = 1 of camera space, with x to the right and
    /// y up; for an orthographic one at z = 0; for a spherical one in the unit square; for a real lens on its film at z
    /// = 0, in metres, with the picture inverted; for meshes the film point itself.
    pub fn on_screen(&self, film: DVec2) -> DVec2 {
        self.corner + self.step * film
    }

    /// Whether rays depend on points of a lens: where they start, or which of the rays of a pixel they are.
    pub fn has_lens(&self) -> bool {
        match self.kind {
            CameraKind::Perspective { lens_radius, .. } | CameraKind::Orthographic { lens_radius, .. } => {
                lens_radius > 0.0
            }
            CameraKind::Spherical { .. } => false,
            CameraKind::Realistic(_) => true,
            CameraKind::Mesh(ref meshes) => meshes.rays() > 1,
        }
    }

    /// The rays of a static perspective camera with a pinhole; `None` for others.
    pub fn pinhole(&self) -> Option<Pinhole> {
        let CameraKind::Perspective { lens_radius, .. } = self.kind else { return None };
        let has_one_origin = lens_radius <= 0.0 && self.motion.is_none() && self.clip.is_none();
        has_one_origin.then(|| Pinhole {
            origin: self.world_from_camera.point(DVec3::ZERO),
            axes: self.world_from_camera.linear(),
            corner: self.corner,
            step: self.step,
        })
    }

    /// The world-space origin, the unit direction, and the weight.
    fn line(&self, placement: &Transform, film: DVec2, lens: DVec2) -> (DVec3, DVec3, f64) {
        let on_screen = self.on_screen(film);
        let mut weight = 1.0;
        let (origin, direction) = match self.kind {
            CameraKind::Perspective { lens_radius, focal_distance, .. } => {
                let towards = on_screen.extend(1.0);
                through_lens(DVec3::ZERO, towards, lens_radius, focal_distance, lens)
            }
            CameraKind::Orthographic { lens_radius, focal_distance } => {
                through_lens(on_screen.extend(0.0), DVec3::Z, lens_radius, focal_distance, lens)
            }
            CameraKind::Spherical { mapping: SphericalMapping::Equirectangular } => {
                let (sin_theta, cos_theta) = (std::f64::consts::PI * on_screen.y).sine_cosine();
                let (sin_phi, cos_phi) = (std::f64::consts::TAU * on_screen.x).sine_cosine();
                (DVec3::ZERO, DVec3::new(sin_theta * cos_phi, cos_theta, sin_theta * sin_phi))
            }
            CameraKind::Spherical { mapping: SphericalMapping::Wide(wide) } => {
                let line = wide.line(DVec2::new(on_screen.x - 0.5, 0.5 - on_screen.y));
                if line.is_none() {
                    weight = 0.0;
                }
                line.unwrap_or((DVec3::ZERO, DVec3::Z))
            }
            CameraKind::Spherical { mapping: SphericalMapping::EqualArea } => {
                let d = equal_area_square_to_sphere(equal_area_wrap(on_screen));
                (DVec3::ZERO, DVec3::new(d.x, d.z, d.y))
            }
            CameraKind::Realistic(ref glass) => {
                let (origin, direction, share) =
                    glass.ray(on_screen, lens).unwrap_or((DVec3::ZERO, DVec3::Z, 0.0));
                weight = share;
                (origin, direction)
            }
            CameraKind::Mesh(ref meshes) => {
                let Some((origin, direction)) = meshes.line(film, lens.x, self.size) else {
                    return (DVec3::ZERO, DVec3::Z, 0.0);
                };
                return (origin, direction.normalize(), 1.0);
            }
        };
        let (origin, direction) = (placement.point(origin), placement.vector(direction).normalize());
        let origin = self.clip.map_or(origin, |clip| clip.start(origin, direction));
        (origin, direction, weight)
    }
}

/// The rays of a perspective camera that start at one point: the same bits as [`View::bare_ray`], for lanes.
#[derive(Clone, Copy, Debug)]
pub struct Pinhole {
    origin: DVec3,
    /// From camera space to the world.
    axes: DMat3,
    corner: DVec2,
    step: DVec2,
}

impl Pinhole {
    /// The origin of all rays.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// The unit directions of the rays through points of the film, in pixels.
    #[inline(always)]
    pub fn directions<R: Real>(&self, [x, y]: [R::Double; 2]) -> V3<R::Double> {
        let splat = R::Double::splat;
        let x = splat(self.corner.x) + splat(self.step.x) * x;
        let y = splat(self.corner.y) + splat(self.step.y) * y;
        let DMat3 { x_axis, y_axis, z_axis } = self.axes;
        let (right, up) = (V3::constant_f64(x_axis.to_array()), V3::constant_f64(y_axis.to_array()));
        (right * x + up * y + V3::constant_f64(z_axis.to_array())).normalize_f64()
    }
}

/// The line from a point of the lens to the intersection of the line through the lens's centre with the focal
/// plane. `towards.z` is 1.
fn through_lens(
    center: DVec3,
    towards: DVec3,
    lens_radius: f64,
    focal_distance: f64,
    lens: DVec2,
) -> (DVec3, DVec3) {
    if lens_radius <= 0.0 {
        return (center, towards);
    }
    let offset = (lens_radius * square_to_disk(lens)).extend(0.0);
    (center + offset, focal_distance * towards - offset)
}

/// Checks the parameters of cameras.
///
/// # Errors
/// [`BuildError::Camera`], naming the camera and the parameter.
pub(crate) fn check(cameras: &[Camera]) -> Result<(), BuildError> {
    for (position, camera) in cameras.iter().enumerate() {
        let wrong =
            |parameter, found, expected| BuildError::Camera { camera: position, parameter, found, expected };
        let lens = match camera.kind {
            CameraKind::Perspective { fov, lens_radius, focal_distance } => {
                if !(fov > 0.0 && fov < 180.0) {
                    return Err(wrong("fov", fov, "more than 0 and less than 180 degrees"));
                }
                Some((lens_radius, focal_distance))
            }
            CameraKind::Orthographic { lens_radius, focal_distance } => Some((lens_radius, focal_distance)),
            CameraKind::Spherical { .. } | CameraKind::Realistic(_) | CameraKind::Mesh(_) => None,
        };
        if let Some((radius, distance)) = lens {
            if !(radius >= 0.0 && radius.is_finite()) {
                return Err(wrong("lensradius", radius, "0 or more"));
            }
            if radius > 0.0 && !(distance > 0.0 && distance.is_finite()) {
                return Err(wrong("focaldistance", distance, "more than 0"));
            }
        }
        if let Some(aspect) = camera.frame_aspect.filter(|a| !(*a > 0.0 && a.is_finite())) {
            return Err(wrong("frameaspectratio", aspect, "more than 0"));
        }
        if let Some([x0, x1, y0, y1]) = camera.screen_window {
            let window = (x1 - x0) * (y1 - y0);
            if !window.is_finite() || window == 0.0 {
                return Err(wrong("screenwindow", window, "a window with an area"));
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(kind: CameraKind) -> Camera {
        Camera::new(kind, Transform::translate(DVec3::new(7.0, -2.0, 3.0)))
    }

    fn perspective(fov: f64, lens_radius: f64, focal_distance: f64) -> CameraKind {
        CameraKind::Perspective { fov, lens_radius, focal_distance }
    }

    const MIDDLE: DVec2 = DVec2::new(0.5, 0.5);

    #[test]
    fn look_at_cameras_do_not_mirror_right_handed_worlds() {
        let (eye, target, up) = (DVec3::new(3.0, -8.0, 2.0), DVec3::new(3.0, 5.0, 2.0), DVec3::Z);
        let size = DVec2::new(400.0, 200.0);
        let cameras = [
            Camera::perspective(eye, target, up, 40.0).unwrap(),
            Camera::orthographic(eye, target, up, 6.0).unwrap(),
            Camera::panorama(eye, target, up).unwrap(),
        ];
        for camera in cameras {
            let view = View::new(&camera, 400, 200);
            // The points at the distance of the target that are in the middle, to the right and above.
            let at = |x: f64, y: f64| {
                let ray = view.ray(DVec2::new(x, y), DVec2::splat(0.5), 0.0, 1.0).ray;
                ray.at((target.y - ray.origin.y) / ray.direction.y)
            };
            let middle = at(0.5 * size.x, 0.5 * size.y);
            assert!((middle - target).length() < 1e-9, "{camera:?}: {middle}");
            // Looking along +y with +z up, +x is to the right.
            assert!(at(0.5 * size.x + 10.0, 0.5 * size.y).x > target.x + 0.1, "{camera:?}");
            assert!(at(0.5 * size.x, 0.5 * size.y - 10.0).z > target.z + 0.1, "{camera:?}");
        }
        // The shorter side of the orthographic picture is six long.
        let view = View::new(&Camera::orthographic(eye, target, up, 6.0).unwrap(), 400, 200);
        let top = view.ray(DVec2::new(200.0, 0.0), DVec2::splat(0.5), 0.0, 1.0).ray.origin;
        assert!((top - eye - 3.0 * up).length() < 1e-12, "{top}");
        assert!(Camera::perspective(eye, eye, up, 40.0).is_err());
        assert!(Camera::perspective(eye, eye + up, up, 40.0).is_err());
    }

    #[test]
    fn a_pinhole_has_the_rays_of_its_view_to_the_bit() {
        let place = Transform::translate(DVec3::new(0.3, -7.1, 2.9))
            * Transform::rotate(DVec3::new(1.0, 2.0, -0.5), 0.7).unwrap();
        let view = View::new(&Camera::new(perspective(37.0, 0.0, 1.0), place), 300, 170);
        let pinhole = view.pinhole().unwrap();
        for i in 0..1000 {
            let film = DVec2::new(f64::from(i % 40) * 7.3, f64::from(i / 40) * 6.9);
            let V3 { x, y, z } = pinhole.directions::<f32>([film.x, film.y]);
            let ray = view.bare_ray(film, MIDDLE, 0.0).ray;
            assert_eq!((pinhole.origin(), DVec3::new(x, y, z)), (ray.origin, ray.direction), "{film}");
        }
        assert!(View::new(&camera(perspective(37.0, 0.1, 1.0)), 30, 20).pinhole().is_none());
        let clip = Some(ClipPlane { point: DVec3::ZERO, normal: DVec3::Y });
        let clipped = Camera { clip, ..camera(perspective(37.0, 0.0, 1.0)) };
        assert!(View::new(&clipped, 30, 20).pinhole().is_none());
        assert!(
            View::new(&camera(CameraKind::Spherical { mapping: Default::default() }), 30, 20)
                .pinhole()
                .is_none()
        );
    }

    #[test]
    fn rays_begin_where_the_clip_plane_is_and_only_in_front_of_it() {
        let camera =
            Camera::perspective(DVec3::new(0.0, -9.0, 2.0), DVec3::new(0.0, 0.0, 2.0), DVec3::Z, 60.0);
        let ray = |clip: ClipPlane, x: f64| {
            let camera = Camera { clip: Some(clip), ..camera.clone().unwrap() };
            View::new(&camera, 100, 100).ray(DVec2::new(x, 50.0), MIDDLE, 0.0, 1.0).ray
        };
        let plane = |y: f64, normal: DVec3| ClipPlane { point: DVec3::new(7.0, y, -3.0), normal };
        for x in [50.0, 80.0] {
            let free =
                View::new(camera.as_ref().unwrap(), 100, 100).ray(DVec2::new(x, 50.0), MIDDLE, 0.0, 1.0).ray;
            let cut = ray(plane(1.5, -DVec3::Y), x);
            assert!((cut.origin.y - 1.5).abs() < 1e-12 && cut.direction == free.direction, "{cut:?}");
            let along = (cut.origin - free.origin).normalize();
            assert!((along - free.direction).length() < 1e-12, "on the same line");
            // Behind the plane, nothing changes; and what never comes behind it sees nothing near.
            assert_eq!(ray(plane(-12.0, -DVec3::Y), x).origin, free.origin);
            assert!(ray(plane(-12.0, DVec3::Y), x).origin.length() > 1e9);
        }
    }

    #[test]
    fn the_field_of_view_spans_the_shorter_side() {
        let direction = |width, height, x, y| {
            let view = View::new(&camera(perspective(60.0, 0.0, 1.0)), width, height);
            view.ray(DVec2::new(x, y), MIDDLE, 0.0, 1.0).ray.direction
        };
        let slope = 30_f64.to_radians().tan();
        // Wide: the upper edge is at half the angle, the right edge at 1.5 times its slope; y goes up and x right.
        let top = direction(300, 200, 150.0, 0.0);
        assert!((top / top.z - DVec3::new(0.0, slope, 1.0)).length() < 1e-12, "{top}");
        let right = direction(300, 200, 300.0, 100.0);
        assert!((right / right.z - DVec3::new(1.5 * slope, 0.0, 1.0)).length() < 1e-12, "{right}");
        let right = direction(200, 300, 200.0, 150.0);
        assert!((right / right.z - DVec3::new(slope, 0.0, 1.0)).length() < 1e-12, "{right}");
    }

    #[test]
    fn every_point_of_a_lens_looks_at_the_plane_in_focus() {
        let view = View::new(&camera(perspective(40.0, 0.25, 6.0)), 120, 80);
        let film = DVec2::new(31.0, 62.0);
        let pinhole =
            View::new(&camera(perspective(40.0, 0.0, 6.0)), 120, 80).ray(film, MIDDLE, 0.0, 1.0).ray;
        let target = pinhole.at(6.0 / pinhole.direction.z);
        let mut widest: f64 = 0.0;
        for i in 0..100 {
            let lens = DVec2::new(f64::from(i % 10) + 0.5, f64::from(i / 10) + 0.5) / 10.0;
            let ray = view.ray(film, lens, 0.0, 1.0).ray;
            assert!((ray.at(6.0 / ray.direction.z) - target).length() < 1e-12);
            widest = widest.max((ray.origin - pinhole.origin).length());
        }
        assert!(widest > 0.2 && widest <= 0.25, "{widest}");
    }

    #[test]
    fn orthographic_rays_are_parallel_and_depth_runs_along_them() {
        let kind = CameraKind::Orthographic { lens_radius: 0.0, focal_distance: 1.0 };
        let view = View::new(&Camera { screen_window: Some([-3.0, 5.0, -2.0, 4.0]), ..camera(kind) }, 80, 60);
        let ray = view.ray(DVec2::new(20.0, 15.0), MIDDLE, 0.0, 1.0).ray;
        assert_eq!(ray.direction, DVec3::Z);
        assert!((ray.origin - DVec3::new(7.0 - 1.0, -2.0 + 2.5, 3.0)).length() < 1e-12, "{}", ray.origin);
        assert!((view.depth(ray.at(4.25), 0.0) - 4.25).abs() < 1e-12);
    }

    #[test]
    fn a_camera_that_moves_looks_from_where_it_is() {
        let kind = CameraKind::Orthographic { lens_radius: 0.0, focal_distance: 1.0 };
        let still = camera(kind);
        let turned =
            Transform::translate(DVec3::new(9.0, -2.0, 3.0)) * Transform::rotate(DVec3::Y, 90.0).unwrap();
        let keys = vec![(0.5, still.world_from_camera), (2.5, turned)];
        let motion = Some(Arc::new(AnimatedTransform::new(keys).unwrap()));
        let view = View::new(&Camera { motion, shutter_open: 1.0, shutter_close: 2.0, ..still }, 80, 60);
        assert_eq!((view.time(0.0), view.time(0.5), view.time(1.0)), (1.0, 1.5, 2.0));
        let ray = view.ray(DVec2::new(40.0, 30.0), MIDDLE, view.time(0.5), 1.0).ray;
        assert_eq!(ray.time, 1.5);
        assert!((ray.origin - DVec3::new(8.0, -2.0, 3.0)).length() < 1e-14, "{}", ray.origin);
        assert!(
            (ray.direction - DVec3::new(1.0, 0.0, 1.0).normalize()).length() < 1e-14,
            "{}",
            ray.direction
        );
        assert!((view.depth(ray.at(2.75), ray.time) - 2.75).abs() < 1e-14);
    }

    #[test]
    fn spherical_cameras_see_every_direction_once() {
        for mapping in [SphericalMapping::EqualArea, SphericalMapping::Equirectangular] {
            let view = View::new(&camera(CameraKind::Spherical { mapping }), 256, 256);
            let mut sum = DVec3::ZERO;
            let mut squares = DVec3::ZERO;
            let mut weights = 0.0;
            for i in 0..256 * 256 {
                let film = DVec2::new(f64::from(i % 256) + 0.5, f64::from(i / 256) + 0.5);
                let direction = view.ray(film, MIDDLE, 0.0, 1.0).ray.direction;
                assert!((direction.length() - 1.0).abs() < 1e-12);
                // A row of the equirectangular picture covers less of the sphere towards the poles, which are at y.
                let is_even = matches!(mapping, SphericalMapping::EqualArea);
                let weight = if is_even { 1.0 } else { (1.0 - direction.y * direction.y).sqrt() };
                sum += weight * direction;
                squares += weight * direction * direction;
                weights += weight;
            }
            assert!((sum / weights).length() < 1e-6, "{mapping:?}");
            assert!((squares / weights - DVec3::splat(1.0 / 3.0)).length() < 1e-4, "{mapping:?}");
        }
    }

    #[test]
    fn the_footprint_is_as_wide_as_the_pixels_are_apart() {
        let view = View::new(&camera(perspective(60.0, 0.0, 1.0)), 200, 200);
        let at = view.ray(DVec2::new(100.0, 100.0), MIDDLE, 0.0, 0.25);
        let distance = 8.0;
        let point = at.ray.at(distance);
        let spot = at.footprint.on_plane(
            point,
            -DVec3::Z,
            2.0 * DVec3::X,
            4.0 * DVec3::Y,
            at.ray.direction,
            distance,
        );
        let pixel = 8.0 * 2.0 * 30_f64.to_radians().tan() / 200.0 * 0.25;
        assert!((spot.dpdx.x as f64 / pixel - 1.0).abs() < 1e-5 && spot.dpdx.y.abs() < 1e-7, "{spot:?}");
        assert!((spot.dpdy.y as f64 / -pixel - 1.0).abs() < 1e-5, "{spot:?}");
        assert!((spot.duv_dx.x as f64 / (pixel / 2.0) - 1.0).abs() < 1e-5, "{spot:?}");
        assert!((spot.duv_dy.y as f64 / (-pixel / 4.0) - 1.0).abs() < 1e-5, "{spot:?}");
        // A cone of the same width gives a spot of the same size.
        let cone = Footprint::Cone { width: 0.0, spread: spot.spread };
        let round =
            cone.on_plane(point, -DVec3::Z, 2.0 * DVec3::X, 4.0 * DVec3::Y, at.ray.direction, distance);
        assert!((round.dpdx.length() as f64 / pixel - 1.0).abs() < 1e-3, "{round:?}");
    }
}
