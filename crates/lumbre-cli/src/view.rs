//! View options: where the camera stands and what it sees.

use clap::Args;
use lumbre::description::CameraKind;
use lumbre::formats::diagnostic::quoted;
use lumbre::{DVec3, Scene, Stage, UpAxis, Viewpoint};

use crate::failure::Failure;

/// Where a picture is taken from. Without a camera in the file, or with any of the options that move it, a camera is
/// made that has everything in its picture.
#[derive(Args, Debug)]
#[command(next_help_heading = "View")]
pub(crate) struct ViewArguments {
    /// Go around the model to the right by this angle in degrees, from the automatic view, or from --eye.
    #[arg(long, value_name = "DEGREES", allow_negative_numbers = true, value_parser = angle, conflicts_with = "camera")]
    azimuth: Option<f64>,
    /// Go up by this angle in degrees, at most 90° (straight down).
    #[arg(long, value_name = "DEGREES", allow_negative_numbers = true, value_parser = angle, conflicts_with = "camera")]
    elevation: Option<f64>,
    /// Enlarge everything by this factor.
    #[arg(long, value_name = "FACTOR", value_parser = factor)]
    zoom: Option<f64>,
    /// Field of view in degrees along the shorter side of the picture.
    #[arg(long, value_name = "DEGREES", value_parser = field_of_view, conflicts_with = "ortho")]
    fov: Option<f64>,
    /// Orthographic projection.
    #[arg(long, conflicts_with = "camera")]
    ortho: bool,
    /// Where the camera stands.
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = point, conflicts_with = "camera")]
    eye: Option<DVec3>,
    /// The point in the middle of the picture. By default the middle of the model.
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = point, conflicts_with = "camera")]
    target: Option<DVec3>,
    /// Which direction is up: x, y, z, -x, -y, -z or X,Y,Z. By default z for .stl, and for an .obj or .ply that plainly
    /// stands on a plane of z; y for all others.
    #[arg(long, value_name = "AXIS|X,Y,Z", allow_hyphen_values = true, value_parser = up_axis)]
    up: Option<UpAxis>,
}

fn number(text: &str, accepted: impl Fn(f64) -> bool, expected: &str) -> Result<f64, String> {
    text.parse().ok().filter(|x| accepted(*x)).ok_or_else(|| format!("expected {expected}"))
}

fn angle(text: &str) -> Result<f64, String> {
    number(text, |x| x.abs() <= 1e6, "degrees, such as 30 or -90")
}

fn factor(text: &str) -> Result<f64, String> {
    number(text, |x| (1e-6..=1e6).contains(&x), "a factor from 1e-6 to 1e6, such as 1.5")
}

fn field_of_view(text: &str) -> Result<f64, String> {
    number(text, |x| (0.001..=179.0).contains(&x), "degrees from 0.001 to 179, such as 40")
}

fn point(text: &str) -> Result<DVec3, String> {
    let wrong = || "expected three numbers, such as 1,-2.5,3".to_owned();
    let numbers: Vec<f64> =
        text.split(',').map(|part| part.trim().parse()).collect::<Result<_, _>>().map_err(|_| wrong())?;
    match numbers[..] {
        [x, y, z] if numbers.iter().all(|v| v.abs() <= 1e100) => Ok(DVec3::new(x, y, z)),
        _ => Err(wrong()),
    }
}

fn up_axis(text: &str) -> Result<UpAxis, String> {
    Ok(match text.trim_start_matches('+').to_ascii_lowercase().as_str() {
        "y" => UpAxis::Y,
        "z" => UpAxis::Z,
        "x" => UpAxis::Towards(DVec3::X),
        "-x" => UpAxis::Towards(-DVec3::X),
        "-y" => UpAxis::Towards(-DVec3::Y),
        "-z" => UpAxis::Towards(-DVec3::Z),
        _ => match point(text) {
            Ok(up) if up.length() > 0.0 => UpAxis::Towards(up),
            _ => return Err("expected x, y, z, -x, -y, -z or a direction such as 0,1,1".to_owned()),
        },
    })
}

impl ViewArguments {
    /// Sets what the stage's camera is asked for.
    ///
    /// # Errors
    /// [`Failure::Usage`] when the camera stands in what it is to look at.
    pub(crate) fn set(&self, stage: &mut Stage) -> Result<(), Failure> {
        if self.eye.is_some() && self.eye == self.target {
            return Err(Failure::Usage(
                "--eye and --target are the same point (expected two points)".to_owned(),
            ));
        }
        let mut view = Viewpoint::default();
        view.azimuth = self.azimuth.unwrap_or(view.azimuth);
        view.elevation = self.elevation.unwrap_or(view.elevation);
        view.zoom = self.zoom.unwrap_or(view.zoom);
        (view.fov, view.orthographic) = (self.fov, self.ortho);
        (view.eye, view.target) = (self.eye, self.target);
        stage.view = view;
        stage.up = self.up;
        Ok(())
    }

    /// Whether the camera looks from where a model's front is taken to be.
    pub(crate) fn is_from_front(&self) -> bool {
        self.azimuth.is_none() && self.eye.is_none() && self.target.is_none() && self.up.is_none()
    }

    /// Refuses a lens for a camera of the file that has none.
    ///
    /// # Errors
    /// [`Failure::Usage`].
    pub(crate) fn check_camera(&self, scene: &Scene, camera: usize) -> Result<(), Failure> {
        let Some(camera) = scene.resolved().cameras().get(camera) else { return Ok(()) };
        let name = camera
            .name
            .as_deref()
            .map_or_else(|| "the camera".to_owned(), |name| format!("camera {}", quoted(name)));
        let refused = match camera.kind {
            CameraKind::Perspective { .. } => None,
            CameraKind::Orthographic { .. } => {
                self.fov.map(|_| ("--fov", "is orthographic (expected --zoom)"))
            }
            CameraKind::Spherical { .. } => {
                let option = self.fov.map(|_| "--fov").or(self.zoom.map(|_| "--zoom"));
                option.map(|option| (option, "sees all directions"))
            }
            CameraKind::Realistic(_) => {
                let option = self.fov.map(|_| "--fov").or(self.zoom.map(|_| "--zoom"));
                option.map(|option| (option, "has the lens of the scene"))
            }
            CameraKind::Mesh(_) => {
                let option = self.fov.map(|_| "--fov").or(self.zoom.map(|_| "--zoom"));
                option.map(|option| (option, "has the faces of meshes"))
            }
        };
        match refused {
            Some((option, why)) => Err(Failure::Usage(format!("{option}: {name} {why}"))),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_and_axes_are_understood() {
        assert_eq!(point("1,-2.5, 3e2"), Ok(DVec3::new(1.0, -2.5, 300.0)));
        assert_eq!(up_axis("Z"), Ok(UpAxis::Z));
        assert_eq!(up_axis("+y"), Ok(UpAxis::Y));
        assert_eq!(up_axis("-x"), Ok(UpAxis::Towards(-DVec3::X)));
        assert_eq!(up_axis("0,1,1"), Ok(UpAxis::Towards(DVec3::new(0.0, 1.0, 1.0))));
        for text in ["", "1,2", "1,2,3,4", "a,b,c", "1,nan,3", "inf,0,0"] {
            assert!(point(text).is_err() && up_axis(text).is_err(), "{text}");
        }
        assert!(up_axis("0,0,0").is_err() && up_axis("w").is_err());
        assert!(field_of_view("180").is_err() && factor("0").is_err() && angle("nan").is_err());
    }
}
