//! Staging options: ground, light, background, and turntable.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;
use clap::builder::{OsStringValueParser, TypedValueParser};
use lumbre::description::{ClearSky, GroundPlane, SkyDesc, SunPositionError};
use lumbre::formats::Limits;
use lumbre::formats::diagnostic::nearest_name;
use lumbre::formats::image::ImageFormat;
use lumbre::image::{Image, Rgb};
use lumbre::{Background, EnvironmentDesc, Ground, Prepared, Stage, Surroundings};

use crate::animation::{ENDINGS, is_animation};
use crate::failure::Failure;
use crate::names::one_of;
use crate::units;

/// How a model is shown.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Showing a model")]
pub(crate) struct StagingArguments {
    /// What the model stands on: none, shadow (ground of which only the shadow is seen) or plane (matte grey). By
    /// default a shadow where both camera and light are automatic.
    #[arg(long, value_name = "WHAT", value_parser = one_of(&Ground::NAMES, Ground::from_name))]
    ground: Option<Ground>,
    /// Light from all around: a picture (.hdr, .exr, …), studio, sky:TIME,LATITUDE,LONGITUDE or none. A picture is
    /// twice as wide as high, or square in pbrt's equal-area mapping; a sky is the sun and a clear sky there and then
    /// (sky:2026-06-21T12:00+02:00,40.4,-3.7), with north behind the model; with none the file's own lights are all. By
    /// default studio for what brings no light, and for a glTF without a camera.
    #[arg(long, value_name = "FILE|studio|sky:TIME,LATITUDE,LONGITUDE|none", value_parser = OsStringValueParser::new().try_map(|text| around(&text)))]
    env: Option<AroundArgument>,
    /// What is behind everything: env (the light from there), studio (grey paper), transparent, a colour (white,
    /// "#e8e0d8") or an image file. By default studio where the light is automatic, else env.
    #[arg(long, value_name = "WHAT", value_parser = background)]
    background: Option<BackgroundArgument>,
    /// Frame the whole model even if the file has a camera.
    #[arg(long, conflicts_with = "camera", help_heading = "View")]
    fit: bool,
    /// Render N pictures from all around the model, as -o frame.####.png, or into one file, as -o turn.gif or turn.mp4
    /// (by ffmpeg).
    #[arg(long, value_name = "N", value_parser = units::whole(2_u32..=100_000),
          conflicts_with = "camera", help_heading = "View")]
    turntable: Option<u32>,
}

/// The values of `--env`.
#[derive(Clone, Debug, PartialEq)]
enum AroundArgument {
    None,
    Studio,
    Sky(Box<ClearSky>),
    File(PathBuf),
}

fn around(text: &OsStr) -> Result<AroundArgument, String> {
    match text.to_str() {
        Some("none") => return Ok(AroundArgument::None),
        Some("studio") => return Ok(AroundArgument::Studio),
        _ => {}
    }
    let Some(at) = text.to_str().and_then(|text| text.strip_prefix("sky:")) else {
        return Ok(AroundArgument::File(text.into()));
    };
    let sun = at.parse().map_err(|error: SunPositionError| error.to_string())?;
    let sky = ClearSky::new(SkyDesc { sun, ..SkyDesc::default() }).map_err(|error| error.to_string())?;
    Ok(AroundArgument::Sky(Box::new(sky)))
}

/// The values of `--background`.
#[derive(Clone, Debug, PartialEq)]
enum BackgroundArgument {
    Lights,
    Transparent,
    Studio,
    Colour(Rgb),
    File(PathBuf),
}

fn background(text: &str) -> Result<BackgroundArgument, String> {
    let lower = text.to_ascii_lowercase();
    match &*lower {
        "env" => return Ok(BackgroundArgument::Lights),
        "transparent" | "none" => return Ok(BackgroundArgument::Transparent),
        "studio" => return Ok(BackgroundArgument::Studio),
        _ => {}
    }
    if let Some(colour) = lumbre::colour(text) {
        return Ok(BackgroundArgument::Colour(colour));
    }
    if lower.starts_with('#') {
        return Err("expected a colour of three or six hexadecimal digits, as #fa0 or #e8e0d8".to_owned());
    }
    if Path::new(text).extension().is_some() || text.contains(std::path::is_separator) {
        return Ok(BackgroundArgument::File(text.into()));
    }
    let names: Vec<&str> = lumbre::colour_names().collect();
    let near = nearest_name(text, names.iter().copied().chain(["env", "studio", "transparent"]));
    let tip = near.map_or_else(String::new, |near| format!("; did you mean {near}?"));
    Err(format!(
        "expected env, studio, transparent, a colour ({}, or as #e8e0d8) or an image file{tip}",
        names.join(", ")
    ))
}

/// The background of a picture.
pub(crate) enum Backdrop {
    /// The infinite lights.
    Lights,
    /// Transparent: the picture has alpha.
    Nothing,
    /// This background.
    Background(Background),
}

impl Backdrop {
    /// Whether the picture is rendered without its background.
    pub(crate) fn is_transparent(&self) -> bool {
        !matches!(self, Self::Lights)
    }
}

impl StagingArguments {
    /// Rejects combinations that are invalid for this output name.
    ///
    /// # Errors
    /// [`Failure::Usage`].
    pub(crate) fn check(&self, output: Option<&Path>) -> Result<(), Failure> {
        let Some(output) = output else { return Ok(()) };
        let name = output.file_name().map(|name| name.to_string_lossy()).unwrap_or_default();
        let has_number = name.contains('#');
        if self.turntable.is_some() && !has_number && !is_animation(output) {
            return Err(Failure::Usage(format!(
                "{}: --turntable makes many pictures (expected a name with # for their number, as frame.####.png, or one that ends in {ENDINGS})",
                output.display()
            )));
        }
        let has_alpha = matches!(
            ImageFormat::from_path(output),
            Some(ImageFormat::Png | ImageFormat::Exr | ImageFormat::WebP | ImageFormat::Qoi)
        );
        if self.background == Some(BackgroundArgument::Transparent) && !has_alpha {
            return Err(Failure::Usage(format!(
                "{}: --background transparent needs a picture that holds coverage (expected .png, .webp, .qoi or .exr)",
                output.display()
            )));
        }
        Ok(())
    }

    /// The number of pictures of a turntable.
    pub(crate) fn turntable(&self) -> Option<u32> {
        self.turntable
    }

    /// The stage of a picture of this size, rotated.
    ///
    /// # Errors
    /// Unreadable files, and [`Failure::Usage`] for an image that is not an environment map.
    pub(crate) fn stage(&self, size: Option<(u32, u32)>, limits: Limits) -> Result<Stage, Failure> {
        let surroundings = match &self.env {
            None => Surroundings::Automatic,
            Some(AroundArgument::None) => Surroundings::Own,
            Some(AroundArgument::Studio) => Surroundings::Studio,
            Some(AroundArgument::Sky(sky)) => Surroundings::Sky(sky.clone()),
            Some(AroundArgument::File(path)) => Surroundings::Map(environment(path, limits)?),
        };
        let ground = self.ground.unwrap_or_default();
        let mut stage = Stage::default();
        (stage.fit, stage.size) = (self.fit, size);
        (stage.surroundings, stage.ground) = (surroundings, ground);
        Ok(stage)
    }

    /// The background of a picture of a staged description.
    ///
    /// # Errors
    /// Unreadable files.
    pub(crate) fn behind(&self, prepared: &Prepared, limits: Limits) -> Result<Backdrop, Failure> {
        Ok(match &self.background {
            None => prepared.background().map_or(Backdrop::Lights, Backdrop::Background),
            Some(BackgroundArgument::Lights) => Backdrop::Lights,
            Some(BackgroundArgument::Transparent) => Backdrop::Nothing,
            Some(BackgroundArgument::Studio) => Backdrop::Background(Background::studio()),
            Some(BackgroundArgument::Colour(colour)) => Backdrop::Background(Background::Colour(*colour)),
            Some(BackgroundArgument::File(path)) => {
                Backdrop::Background(Background::Picture(opaque(lumbre::read_image_within(path, limits)?)))
            }
        })
    }

    /// The background argument of pictures; the studio's by default.
    pub(crate) fn background_name(&self) -> Option<String> {
        match &self.background {
            Some(BackgroundArgument::Lights | BackgroundArgument::Transparent) => None,
            None | Some(BackgroundArgument::Studio) => Some("studio".to_owned()),
            Some(BackgroundArgument::Colour(colour)) => {
                let [r, g, b] = colour.to_array().map(f32::to_bits);
                Some(format!("colour {r:08x} {g:08x} {b:08x}"))
            }
            Some(BackgroundArgument::File(path)) => Some(format!("file {}", path.display())),
        }
    }

    /// The image that is the background.
    pub(crate) fn background_file(&self) -> Option<&Path> {
        match &self.background {
            Some(BackgroundArgument::File(path)) => Some(path.as_path()),
            _ => None,
        }
    }

    /// The same in the light of a picture from all around.
    pub(crate) fn in_light_of(&self, picture: &Path) -> Self {
        Self { env: Some(AroundArgument::File(picture.to_owned())), ..self.clone() }
    }

    /// The files that the stage is made of.
    pub(crate) fn inputs(&self) -> impl Iterator<Item = &Path> {
        let map = match &self.env {
            Some(AroundArgument::File(path)) => Some(path.as_path()),
            _ => None,
        };
        map.into_iter().chain(self.background_file())
    }
}

fn environment(path: &Path, limits: Limits) -> Result<EnvironmentDesc, Failure> {
    let image = Arc::new(lumbre::read_image_within(path, limits)?);
    let found = (image.width(), image.height());
    EnvironmentDesc::of_image(image).ok_or_else(|| {
        Failure::Input(format!(
            "{}: no environment map (found {} by {} pixels; expected twice as wide as high, or square in pbrt's equal-area mapping)",
            path.display(),
            found.0,
            found.1
        ))
    })
}

/// An image over black, without alpha.
pub(crate) fn opaque(image: Image) -> Image {
    Image::from_pixels(image.width(), image.height(), image.pixels().to_vec()).unwrap_or(image)
}

/// The name of a frame: the number replaces the last run of `#`, padded to its length.
pub(crate) fn frame_name(pattern: &Path, number: u32) -> PathBuf {
    let name = pattern.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let Some(last) = name.rfind('#') else { return pattern.to_owned() };
    let first = name[..=last]
        .rfind(|c| c != '#')
        .map_or(0, |at| at + name[at..].chars().next().map_or(1, char::len_utf8));
    let digits = last + 1 - first;
    pattern.with_file_name(format!("{}{number:0digits$}{}", &name[..first], &name[last + 1..]))
}

/// Whether a camera at this position is below the ground, which hides everything from it.
pub(crate) fn is_below(ground: &GroundPlane, place: lumbre::DVec3) -> bool {
    (place - ground.point).dot(ground.normal) < 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn backgrounds_are_understood() {
        assert_eq!(background("env"), Ok(BackgroundArgument::Lights));
        assert_eq!(background("Transparent"), Ok(BackgroundArgument::Transparent));
        assert_eq!(background("#fff"), Ok(BackgroundArgument::Colour(Rgb::WHITE)));
        assert_eq!(background("#FF0000"), Ok(BackgroundArgument::Colour(Rgb::new(1.0, 0.0, 0.0))));
        assert_eq!(background("sky.png"), Ok(BackgroundArgument::File("sky.png".into())));
        for text in ["", "#", "#ff", "#12345", "#+12345", "#ggg", "wite"] {
            assert!(background(text).is_err(), "{text}");
        }
    }

    #[test]
    fn what_is_around_is_understood() {
        let around = |text: &str| around(OsStr::new(text));
        assert_eq!(around("none"), Ok(AroundArgument::None));
        assert_eq!(around("studio"), Ok(AroundArgument::Studio));
        assert_eq!(around("sky.hdr"), Ok(AroundArgument::File("sky.hdr".into())));
        let sun = "2026-06-21T12:00+02:00,40.4,-3.7".parse().unwrap();
        let sky = ClearSky::new(SkyDesc { sun, ..SkyDesc::default() }).unwrap();
        assert_eq!(around("sky:2026-06-21T12:00+02:00,40.4,-3.7"), Ok(AroundArgument::Sky(Box::new(sky))));
        for (text, said) in [
            ("sky:", "expected a date"),
            ("sky:2026-06-21T12:00,40.4,-3.7", "its zone"),
            ("sky:2026-06-21T12:00Z,140.4,-3.7", "latitude"),
            ("sky:2026-06-21T00:00+02:00,40.4,-3.7", "below the horizon"),
        ] {
            assert!(around(text).unwrap_err().contains(said), "{text}");
        }
    }

    #[test]
    fn frames_have_their_number_in_their_name() {
        for (pattern, expected) in [
            ("a/frame.####.png", "a/frame.0017.png"),
            ("#.png", "17.png"),
            ("a#b##.exr", "a#b17.exr"),
            ("ä#.png", "ä17.png"),
        ] {
            assert_eq!(frame_name(Path::new(pattern), 17), Path::new(expected));
        }
    }
}
