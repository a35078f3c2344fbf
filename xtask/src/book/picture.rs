//! Pictures of the book: each is rendered from the scene next to it, and again only if that or the program has changed.
//! The repository keeps them small, for readers of the pages there.

use std::collections::BTreeMap;
use std::fs;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};

/// Renders pictures, or finds them in the cache.
#[derive(Debug)]
pub(crate) struct Pictures<'a> {
    pub(crate) program: &'a Path,
    /// Where rendered pictures are kept by what they are made of.
    pub(crate) kept: &'a Path,
    pub(crate) quick: bool,
}

impl Pictures<'_> {
    /// The picture of a scene, which may be rendered without a warning: but that it is of pbrt-v3, as what shows
    /// pbrt-v3's materials is.
    pub(crate) fn picture_of(&self, scene: &Path) -> Result<PathBuf> {
        let mut files = BTreeMap::new();
        read_with_named(scene, &mut files)?;
        let program = fs::metadata(self.program).context("cannot read the program")?;
        let mut hasher = DefaultHasher::new();
        files.hash(&mut hasher);
        (program.len(), program.modified()?, self.quick).hash(&mut hasher);
        let picture = self.kept.join(format!("{:016x}.png", hasher.finish()));
        if picture.exists() {
            return Ok(picture);
        }
        fs::create_dir_all(self.kept).with_context(|| format!("cannot make {}", self.kept.display()))?;
        let mut render = Command::new(self.program);
        render.arg("render").arg(scene).args(["--progress", "none", "--no-checkpoint", "-o"]).arg(&picture);
        if self.quick {
            let side = |name| files.values().find_map(|text| number_after(text, name)).unwrap_or(320);
            let (width, height) = (side("xresolution").div_ceil(4), side("yresolution").div_ceil(4));
            render.args(["--spp", "1", "--size", &format!("{width}x{height}")]);
        }
        let output = render.output().context("cannot start the program")?;
        let said = String::from_utf8_lossy(&output.stderr);
        let is_warning = |line: &str| line.starts_with("warning:") && !line.contains("this is of pbrt-v3");
        if !output.status.success() || said.lines().any(is_warning) {
            // What has a warning is not to be found the next time.
            drop(fs::remove_file(&picture));
            bail!("{}: {}\n{}", scene.display(), output.status, said.trim_end());
        }
        Ok(picture)
    }
}

/// Pixels across of a picture that the repository keeps.
const SMALL: u32 = 256;
/// The least samples of a pixel of it; a scene with more than four times this number gets a quarter of its own.
const MIN_SMALL_SPP: u32 = 16;
/// The file that says from which scenes the small pictures were made, in the folder of the pages.
const SUMS: &str = "pictures.sums";

/// The small pictures of the repository: by name the sum of the scene that each was rendered of.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct Kept {
    sums: BTreeMap<String, String>,
}

impl Kept {
    /// Reads which there are.
    pub(crate) fn read(pages: &Path) -> Result<Self> {
        let file = pages.join(SUMS);
        let text = match fs::read_to_string(&file) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => String::new(),
            Err(error) => return Err(error).with_context(|| format!("cannot read {}", file.display())),
        };
        let line = |line: &str| line.split_once(' ').map(|(sum, name)| (name.to_owned(), sum.to_owned()));
        Ok(Self { sums: text.lines().filter_map(line).collect() })
    }

    /// Says which there are.
    pub(crate) fn write(&self, pages: &Path) -> Result<()> {
        let lines = self.sums.iter().map(|(name, sum)| format!("{sum} {name}\n"));
        let file = pages.join(SUMS);
        fs::write(&file, lines.collect::<String>())
            .with_context(|| format!("cannot write {}", file.display()))
    }

    /// Whether the picture of this name is of this scene as it is now.
    pub(crate) fn is_current(&self, name: &Path, scene: &Path) -> Result<bool> {
        Ok(self.sums.get(&slashed(name)) == Some(&sum(scene)?))
    }

    /// Renders the picture of this name into a file, unless it is current: as large as [`SMALL`], without noise.
    pub(crate) fn update(&mut self, name: &Path, scene: &Path, to: &Path, program: &Path) -> Result<()> {
        if to.exists() && self.is_current(name, scene)? {
            return Ok(());
        }
        let mut files = BTreeMap::new();
        read_with_named(scene, &mut files)?;
        let side = |name| files.values().find_map(|text| number_after(text, name));
        let (width, height) = (side("xresolution").unwrap_or(1280), side("yresolution").unwrap_or(720));
        let small = width.min(SMALL);
        let size = format!("{small}x{}", (height * small).div_ceil(width));
        let asked = files.values().filter_map(|text| number_after(text, "pixelsamples")).max();
        let samples = MIN_SMALL_SPP.max(asked.unwrap_or(0) / 4).to_string();
        // A picture of normals and the like has no noise, and is not denoised.
        let mut said = String::new();
        for denoiser in ["own", "none"] {
            let output = Command::new(program)
                .arg("render")
                .arg(scene)
                .args(["--progress", "none", "--no-checkpoint", "--size", &size, "--spp", &samples])
                .args(["--denoise", denoiser, "-o"])
                .arg(to)
                .output()
                .context("cannot start the program")?;
            if output.status.success() {
                eprintln!("{}", to.display());
                self.sums.insert(slashed(name), sum(scene)?);
                return Ok(());
            }
            said = String::from_utf8_lossy(&output.stderr).into_owned();
        }
        bail!("{}: {}", scene.display(), said.trim_end())
    }
}

/// A name of a file as it is on all systems.
fn slashed(name: &Path) -> String {
    name.to_string_lossy().replace('\\', "/")
}

/// A sum of all bytes of a scene and what it names (G. Fowler, L. C. Noll, K.-P. Vo, FNV-1a, 64 bits).
fn sum(scene: &Path) -> Result<String> {
    let mut files = BTreeMap::new();
    read_with_named(scene, &mut files)?;
    let mut sum = 0xcbf2_9ce4_8422_2325_u64;
    let folder = scene.parent().unwrap_or(scene);
    for (path, bytes) in &files {
        let name = slashed(path.strip_prefix(folder).unwrap_or(path));
        for byte in name.bytes().chain([0]).chain(bytes.iter().copied()) {
            sum = (sum ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3);
        }
    }
    Ok(format!("{sum:016x}"))
}

/// The bytes of a file, and of the files that it names in quotes, relative to itself.
fn read_with_named(file: &Path, files: &mut BTreeMap<PathBuf, Vec<u8>>) -> Result<()> {
    if files.contains_key(file) {
        return Ok(());
    }
    let bytes = fs::read(file).with_context(|| format!("cannot read {}", file.display()))?;
    files.insert(file.to_owned(), bytes.clone());
    let (Some(folder), Ok(text)) = (file.parent(), std::str::from_utf8(&bytes)) else { return Ok(()) };
    for named in text.split('"').skip(1).step_by(2).filter(|name| name.contains('.')) {
        let path = folder.join(named);
        if path.is_file() {
            read_with_named(&path, files)?;
        }
    }
    Ok(())
}

/// The first integer after a word.
fn number_after(text: &[u8], word: &str) -> Option<u32> {
    let text = std::str::from_utf8(text).ok()?;
    let (_, rest) = text.split_once(word)?;
    let digits = rest.trim_start_matches(['"', ' ', '[']);
    digits.split(|c: char| !c.is_ascii_digit()).next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_depends_on_all_that_its_scene_names() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = |name: &str, text: &str| {
            fs::write(folder.path().join(name), text).expect("a file");
            folder.path().join(name)
        };
        let scene =
            file("scene.pbrt", "Include \"studio.pbrt\" Texture \"t\" \"string filename\" \"missing.png\"");
        file("studio.pbrt", "Include \"scene.pbrt\" Film \"rgb\" \"integer xresolution\" [ 320 ] ");
        file("other.pbrt", "");
        let mut files = BTreeMap::new();
        read_with_named(&scene, &mut files).expect("both can be read");
        let names: Vec<_> = files.keys().filter_map(|path| path.file_name()?.to_str()).collect();
        assert_eq!(names, ["scene.pbrt", "studio.pbrt"]);
        let before = sum(&scene).expect("both can be read");
        let mut kept = Kept::default();
        kept.sums.insert("sub/scene.png".to_owned(), before.clone());
        kept.write(folder.path()).expect("it can be written");
        let kept = Kept::read(folder.path()).expect("it is there");
        assert!(kept.is_current(Path::new("sub/scene.png"), &scene).expect("both can be read"));
        file("studio.pbrt", "Film \"rgb\" \"integer xresolution\" [ 320 ] ");
        assert!(!kept.is_current(Path::new("sub/scene.png"), &scene).expect("both can be read"));
        let widths: Vec<_> = files.values().filter_map(|text| number_after(text, "xresolution")).collect();
        assert_eq!(widths, [320]);
    }
}
