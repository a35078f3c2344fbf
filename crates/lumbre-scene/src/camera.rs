//! The closed set of cameras.

use lumbre_math::Transform;

/// How the sphere of directions fills the picture of a spherical camera.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SphericalMapping {
    /// Equal areas (Clarberg 2008).
    #[default]
    EqualArea,
    /// Longitude and latitude.
    Equirectangular,
}

/// The kinds of camera. Camera space is pbrt's: x right, y up, z forward (left-handed).
#[derive(Clone, Debug, PartialEq)]
pub enum CameraKind {
    /// A pinhole or a thin lens.
    Perspective {
        /// Full angle in degrees along the shorter side of the picture.
        fov: f64,
        /// 0 for a pinhole.
        lens_radius: f64,
        /// Distance of the plane in focus along z.
        focal_distance: f64,
    },
    /// Parallel rays.
    Orthographic {
        /// 0 for no lens.
        lens_radius: f64,
        /// Distance of the plane in focus along z.
        focal_distance: f64,
    },
    /// All directions at once.
    Spherical {
        /// Where each direction falls.
        mapping: SphericalMapping,
    },
}

/// Where the picture is taken from.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Its name, where the file gives one.
    pub name: Option<String>,
    /// Its kind.
    pub kind: CameraKind,
    /// Where it stands.
    pub world_from_camera: Transform,
    /// Width over height of the picture, where it is not that of its pixels.
    pub frame_aspect: Option<f64>,
    /// Window on the screen (x min, x max, y min, y max), where it is not the default: [-1, 1] along the shorter side.
    pub screen_window: Option<[f64; 4]>,
    /// When the shutter opens.
    pub shutter_open: f64,
    /// When it closes.
    pub shutter_close: f64,
}
