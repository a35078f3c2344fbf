//! Frames in one file: an animated GIF, or a video that ffmpeg encodes.

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};

use lumbre::formats::atomic_write;
use lumbre::formats::image::{GifWriter, rgb8};
use lumbre::{Picture, SaveOptions};

use crate::failure::Failure;

/// The endings of names that stand for all frames.
const GIF: &str = "gif";
const VIDEOS: [&str; 4] = ["mp4", "webm", "mkv", "mov"];
/// The same in words.
pub(crate) const ENDINGS: &str = ".gif, .mp4, .webm, .mkv or .mov";

/// What encodes a file of frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Gif,
    Video,
}

impl Kind {
    fn of(path: &Path) -> Option<Self> {
        let ending = path.extension()?.to_str()?.to_ascii_lowercase();
        match &*ending {
            GIF => Some(Self::Gif),
            ending if VIDEOS.contains(&ending) => Some(Self::Video),
            _ => None,
        }
    }
}

/// Whether a file of this name has all frames, by its ending. Names with `#` are those of single frames.
pub(crate) fn is_animation(path: &Path) -> bool {
    let has_number = path.file_name().is_some_and(|name| name.to_string_lossy().contains('#'));
    Kind::of(path).is_some() && !has_number
}

/// A file of frames while it is made. It is written when all are there.
pub(crate) struct Animation {
    path: PathBuf,
    kind: Kind,
    frames_per_second: f64,
    /// From the first frame on.
    writer: Option<Writer>,
}

enum Writer {
    Gif(Box<GifWriter>),
    Video(Video),
}

impl Animation {
    /// The animation of this name; `None` for names of pictures.
    ///
    /// # Errors
    /// [`Failure::Usage`] for a video where there is no ffmpeg.
    pub(crate) fn of(path: &Path, frames_per_second: f64) -> Result<Option<Self>, Failure> {
        let Some(kind) = Kind::of(path).filter(|_| is_animation(path)) else { return Ok(None) };
        if kind == Kind::Video && !has_ffmpeg() {
            return Err(Failure::Usage(format!(
                "{}: videos are encoded by ffmpeg, which was not found (expected it on the PATH, a .gif, or a name with # for pictures, as frame.####.png)",
                path.display()
            )));
        }
        Ok(Some(Self { path: path.to_owned(), kind, frames_per_second, writer: None }))
    }

    /// Whether a picture was added.
    pub(crate) fn has_frames(&self) -> bool {
        self.writer.is_some()
    }

    /// Adds a picture as it is displayed.
    ///
    /// # Errors
    /// [`Failure::Io`] where it cannot be encoded.
    pub(crate) fn add(&mut self, picture: &Picture, options: &SaveOptions) -> Result<(), Failure> {
        let (image, options) = picture.displayed(options);
        let size = (image.width(), image.height());
        let added = self.writer(size).and_then(|writer| match writer {
            Writer::Gif(gif) => gif.add(&image, &options),
            Writer::Video(video) => video.add(size, &rgb8(&image, &options)),
        });
        added.map_err(|e| self.failure(&e))
    }

    fn writer(&mut self, (width, height): (u32, u32)) -> io::Result<&mut Writer> {
        let made = match (self.writer.take(), self.kind) {
            (Some(writer), _) => writer,
            (None, Kind::Gif) => {
                Writer::Gif(Box::new(GifWriter::new(width, height, self.frames_per_second)?))
            }
            (None, Kind::Video) => {
                Writer::Video(Video::begin(&self.path, (width, height), self.frames_per_second)?)
            }
        };
        Ok(self.writer.insert(made))
    }

    /// Writes the file, if there is a frame.
    ///
    /// # Errors
    /// [`Failure::Io`] where it cannot be encoded or written.
    pub(crate) fn finish(mut self) -> Result<(), Failure> {
        match self.writer.take() {
            None => Ok(()),
            Some(Writer::Gif(gif)) => {
                let bytes = gif.finish().map_err(|e| self.failure(&e))?;
                self.write(|out| out.write_all(&bytes))
            }
            Some(Writer::Video(video)) => {
                let folder = video.finish().map_err(|e| self.failure(&e))?;
                self.write(|out| {
                    let mut made = std::fs::File::open(made_in(folder.path(), &self.path))?;
                    io::copy(&mut made, out).map(|_| ())
                })
            }
        }
    }

    fn write(&self, write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<(), Failure> {
        atomic_write(&self.path, write).map_err(|e| Failure::from(lumbre::Error::from(e)))
    }

    fn failure(&self, error: &io::Error) -> Failure {
        Failure::Io(format!("{}: {error}", self.path.display()))
    }
}

fn has_ffmpeg() -> bool {
    let mut ffmpeg = Command::new("ffmpeg");
    ffmpeg.arg("-version").stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    ffmpeg.status().is_ok_and(|status| status.success())
}

/// ffmpeg at work: it takes pixels from a pipe and writes a file in a folder of its own.
struct Video {
    ffmpeg: Child,
    pixels: Option<ChildStdin>,
    size: (u32, u32),
    folder: tempfile::TempDir,
}

/// The file that ffmpeg makes for this output.
fn made_in(folder: &Path, output: &Path) -> PathBuf {
    let ending = output.extension().unwrap_or_default();
    folder.join("video").with_extension(ending.to_ascii_lowercase())
}

impl Video {
    fn begin(output: &Path, size: (u32, u32), frames_per_second: f64) -> io::Result<Self> {
        let folder = tempfile::tempdir()?;
        let mut ffmpeg = Command::new("ffmpeg");
        ffmpeg.args(["-v", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s"]);
        ffmpeg.arg(format!("{}x{}", size.0, size.1)).arg("-r").arg(frames_per_second.to_string());
        ffmpeg.args(["-i", "-", "-pix_fmt", "yuv420p"]);
        // Chroma has half the resolution: sides are even.
        ffmpeg.args(["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-crf", "18"]);
        ffmpeg.arg(made_in(folder.path(), output));
        ffmpeg.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped());
        // Ctrl-C ends the render, and the video has the frames that there are.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut ffmpeg, 0);
        let mut ffmpeg = ffmpeg.spawn()?;
        let pixels = ffmpeg.stdin.take();
        Ok(Self { ffmpeg, pixels, size, folder })
    }

    fn add(&mut self, size: (u32, u32), pixels: &[u8]) -> io::Result<()> {
        if size != self.size {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, "a frame of another size"));
        }
        let written = self.pixels.as_mut().map_or(Ok(()), |pipe| pipe.write_all(pixels));
        // What ffmpeg has to say of it comes with its end.
        written.map_err(|e| self.end().err().unwrap_or(e))
    }

    /// Waits for ffmpeg.
    fn end(&mut self) -> io::Result<()> {
        drop(self.pixels.take());
        let mut said = String::new();
        if let Some(mut errors) = self.ffmpeg.stderr.take() {
            io::Read::read_to_string(&mut errors, &mut said)?;
        }
        if self.ffmpeg.wait()?.success() {
            return Ok(());
        }
        let said = said.lines().last().unwrap_or("it failed");
        Err(io::Error::other(format!("ffmpeg: {said}")))
    }

    /// The folder with the file.
    fn finish(mut self) -> io::Result<tempfile::TempDir> {
        self.end()?;
        Ok(self.folder)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_file_of_frames_is_known_by_its_ending() {
        for (name, is) in
            [("a.gif", true), ("a.MP4", true), ("a.webm", true), ("a.####.gif", false), ("a.png", false)]
        {
            assert_eq!(is_animation(Path::new(name)), is, "{name}");
        }
        assert!(ENDINGS.contains(GIF) && VIDEOS.iter().all(|ending| ENDINGS.contains(ending)));
    }
}
