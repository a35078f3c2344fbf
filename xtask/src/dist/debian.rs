//! The program as a package of Debian.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use xtask::command::{self, root};

use super::VERSION;
use super::target::GLIBC;
use crate::files;

/// The platform whose program it holds.
pub(super) const TARGET: &str = "linux-x86_64";

/// Lays everything out where Debian's policy has it, and packs it into `folder`. The path of the package.
pub(super) fn package(
    staged: &Path,
    program: &Path,
    pages: &Path,
    notices: &str,
    folder: &Path,
) -> Result<PathBuf> {
    let place = |path: &str| -> Result<PathBuf> {
        let path = staged.join(path);
        fs::create_dir_all(path.parent().context("it lies in a folder")?)?;
        Ok(path)
    };
    fs::copy(program, place("usr/bin/lumbre")?)
        .with_context(|| format!("cannot copy {}", program.display()))?;
    for page in files::with_ending(&pages.join("man"), "1")? {
        let name = page.file_name().context("a page has a name")?.to_string_lossy().into_owned();
        zip(&fs::read(&page)?, &place(&format!("usr/share/man/man1/{name}.gz"))?)?;
    }
    for (name, path) in [
        ("lumbre.bash", "usr/share/bash-completion/completions/lumbre"),
        ("_lumbre", "usr/share/zsh/vendor-completions/_lumbre"),
        ("lumbre.fish", "usr/share/fish/vendor_completions.d/lumbre.fish"),
    ] {
        fs::copy(pages.join("completions").join(name), place(path)?)?;
    }
    let mit = fs::read_to_string(root().join("LICENSE-MIT"))?;
    let copyright = format!(
        "Lumbre is under the MIT licence, below, or the Apache License, Version 2.0, which is in\n\
         /usr/share/common-licenses/Apache-2.0. What it is made of is in THIRD-PARTY.md.gz.\n\n{mit}"
    );
    fs::write(place("usr/share/doc/lumbre/copyright")?, copyright)?;
    zip(notices.as_bytes(), &place("usr/share/doc/lumbre/THIRD-PARTY.md.gz")?)?;
    zip(&fs::read(root().join("CHANGELOG.md"))?, &place("usr/share/doc/lumbre/changelog.gz")?)?;
    let size: u64 =
        files::below(staged)?.iter().map(|file| fs::metadata(file).map_or(0, |meta| meta.len())).sum();
    let control = format!(
        "Package: lumbre\nVersion: {VERSION}\nArchitecture: amd64\nMaintainer: The Lumbre authors <lumbre@lumbre.invalid>\n\
         Section: graphics\nPriority: optional\nInstalled-Size: {}\nDepends: libc6 (>= {GLIBC})\n\
         Homepage: {}\nDescription: exact, reproducible ray tracer\n \
         Renders scenes of pbrt-v4 and POV-Ray and models in glTF, OBJ, PLY and STL,\n \
         answers ray queries, and shows the mathematics of every pixel.\n",
        size.div_ceil(1024),
        env!("CARGO_PKG_REPOSITORY"),
    );
    fs::write(place("DEBIAN/control")?, control)?;
    let package = folder.join(format!("lumbre_{VERSION}_amd64.deb"));
    let (from, to) = (staged.to_string_lossy(), package.to_string_lossy());
    command::run("dpkg-deb", &["--root-owner-group", "--build", &from, &to])?;
    Ok(package)
}

/// Writes a file in gzip, without the time.
fn zip(bytes: &[u8], path: &Path) -> Result<()> {
    let file = fs::File::create(path).with_context(|| format!("cannot write {}", path.display()))?;
    let mut encoder = flate2::GzBuilder::new().write(file, flate2::Compression::best());
    encoder.write_all(bytes)?;
    encoder.finish()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everything_lies_where_debian_has_it() {
        if !command::succeeds("dpkg-deb", &["--version"]) {
            return eprintln!("left out: there is no dpkg-deb");
        }
        let folder = tempfile::tempdir().expect("a folder");
        let (pages, staged) = (folder.path().join("pages"), folder.path().join("staged"));
        for (name, text) in [
            ("man/lumbre.1", ".TH lumbre 1"),
            ("man/lumbre-render.1", ".TH lumbre-render 1"),
            ("completions/lumbre.bash", "complete"),
            ("completions/_lumbre", "#compdef lumbre"),
            ("completions/lumbre.fish", "complete"),
            ("completions/_lumbre.ps1", "Register"),
        ] {
            let path = pages.join(name);
            fs::create_dir_all(path.parent().expect("a folder")).expect("it is made");
            fs::write(path, text).expect("it is written");
        }
        // Any program: this one.
        let program = std::env::current_exe().expect("a program");
        let package = package(&staged, &program, &pages, "licences", folder.path()).expect("a package");
        let package = package.to_string_lossy();
        let listed = command::output("dpkg-deb", &["--contents", &package]).expect("it is one");
        for name in [
            "usr/bin/lumbre",
            "usr/share/man/man1/lumbre.1.gz",
            "usr/share/man/man1/lumbre-render.1.gz",
            "usr/share/bash-completion/completions/lumbre",
            "usr/share/zsh/vendor-completions/_lumbre",
            "usr/share/fish/vendor_completions.d/lumbre.fish",
            "usr/share/doc/lumbre/copyright",
            "usr/share/doc/lumbre/THIRD-PARTY.md.gz",
            "usr/share/doc/lumbre/changelog.gz",
        ] {
            let line = listed.lines().find(|line| line.ends_with(&format!("./{name}")));
            let line = line.unwrap_or_else(|| panic!("{name}: {listed}"));
            assert!(line.contains("root/root"), "{line}");
            assert_eq!(line.starts_with("-rwxr-xr-x"), name == "usr/bin/lumbre", "{line}");
        }
        let field = |name: &str| command::output("dpkg-deb", &["--field", &package, name]).expect("a field");
        assert_eq!((field("Package").trim(), field("Version").trim()), ("lumbre", VERSION));
        assert_eq!(field("Depends").trim(), format!("libc6 (>= {GLIBC})"));
    }
}
