//! `--denoise`: which denoiser, found before anything is rendered.

use std::time::{Duration, Instant};

use lumbre::Picture;

use crate::failure::Failure;
use crate::oidn::Oidn;

/// The values of `--denoise`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Choice {
    /// Lumbre's own filter.
    Own,
    /// Open Image Denoise.
    Oidn,
    /// None.
    None,
}

impl Choice {
    /// The names; `auto` is the own filter.
    pub(crate) const NAMES: [&'static str; 4] = ["auto", "own", "oidn", "none"];

    /// The choice of that name.
    pub(crate) fn from_name(name: &str) -> Option<Self> {
        match name {
            "auto" | "own" => Some(Self::Own),
            "oidn" => Some(Self::Oidn),
            "none" => Some(Self::None),
            _ => None,
        }
    }
}

/// What takes the noise out of pictures.
pub(crate) enum Denoiser {
    /// Lumbre's own filter.
    Own,
    /// Open Image Denoise.
    Oidn(Oidn),
}

impl Denoiser {
    /// Finds it; `None` where there shall be none.
    ///
    /// # Errors
    /// [`Failure::Usage`] where Open Image Denoise is asked for and not there.
    pub(crate) fn find(choice: Choice) -> Result<Option<Self>, Failure> {
        match choice {
            Choice::None => Ok(None),
            Choice::Own => Ok(Some(Self::Own)),
            Choice::Oidn => match Oidn::load() {
                Ok(oidn) => Ok(Some(Self::Oidn(oidn))),
                Err(why) => Err(Failure::Usage(format!("--denoise oidn: {why}"))),
            },
        }
    }

    /// What it is called in the last line.
    pub(crate) fn name(&self) -> &'static str {
        match self {
            Self::Own => "own filter",
            Self::Oidn(_) => "Open Image Denoise",
        }
    }

    /// Whether it takes a picture with one sample per square of this many pixels a side: [`lumbre::Stats::stride`].
    pub(crate) fn takes(&self, stride: Option<u32>) -> bool {
        match self {
            Self::Own => stride.is_some(),
            Self::Oidn(_) => stride == Some(1),
        }
    }

    /// Takes the noise out of a picture, and says how long that took.
    ///
    /// # Errors
    /// [`Failure::Limit`] where the denoiser gives up.
    pub(crate) fn apply(&self, picture: &mut Picture, threads: usize) -> Result<Duration, Failure> {
        let start = Instant::now();
        match self {
            Self::Own => picture.denoise(threads)?,
            Self::Oidn(oidn) => {
                let denoised = oidn
                    .denoise(picture, threads)
                    .map_err(|why| Failure::Limit(format!("{}: {why}", self.name())))?;
                picture.set_denoised(denoised, self.name())?;
            }
        }
        Ok(start.elapsed())
    }
}
