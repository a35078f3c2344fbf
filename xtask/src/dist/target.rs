//! The platforms that programs and wheels are made for, and what compiles and links for them.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::Result;
use xtask::command::{self, root, succeeds};

use super::tools::Tools;

/// The oldest glibc that programs of Linux run with: that of manylinux_2_28, of Debian 10 and of RHEL 8.
pub(super) const GLIBC: &str = "2.28";

/// A platform.
#[derive(Debug)]
pub(crate) struct Target {
    /// What files are named after.
    pub name: &'static str,
    /// Rust's name.
    pub triple: &'static str,
    linker: Linker,
    /// Whether wheels are made for it.
    pub has_wheel: bool,
}

/// What links for a platform.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Linker {
    /// Zig's, by cargo-zigbuild, which has the libraries of every glibc and of musl.
    Zig,
    /// GCC of MinGW-w64.
    MinGw,
    /// That of the machine itself, which is to be such a one.
    Own,
}

/// All platforms.
pub(super) const TARGETS: &[Target] = &[
    Target { name: "linux-x86_64", triple: "x86_64-unknown-linux-gnu", linker: Linker::Zig, has_wheel: true },
    Target {
        name: "linux-x86_64-musl",
        triple: "x86_64-unknown-linux-musl",
        linker: Linker::Zig,
        has_wheel: false,
    },
    Target {
        name: "linux-aarch64",
        triple: "aarch64-unknown-linux-gnu",
        linker: Linker::Zig,
        has_wheel: true,
    },
    Target {
        name: "windows-x86_64",
        triple: "x86_64-pc-windows-gnu",
        linker: Linker::MinGw,
        has_wheel: true,
    },
    Target { name: "macos-aarch64", triple: "aarch64-apple-darwin", linker: Linker::Own, has_wheel: true },
];

impl Target {
    /// Windows.
    pub(crate) fn windows() -> &'static Self {
        Self::named("windows-x86_64")
    }

    /// Linux on ARM.
    pub(crate) fn aarch64() -> &'static Self {
        Self::named("linux-aarch64")
    }

    fn named(name: &str) -> &'static Self {
        TARGETS.iter().find(|target| target.name == name).expect("it is in the table")
    }

    /// Whether it is Windows.
    pub(super) fn is_windows(&self) -> bool {
        self.triple.contains("windows")
    }

    /// The licences of what is linked to programs besides Rust's packages, by the names of these.
    pub(super) fn linked(&self, tools: &Tools) -> Result<Vec<(&'static str, String)>> {
        let linked: &[(&str, &str)] = match self.linker {
            Linker::Zig if self.triple.ends_with("musl") => {
                &[("musl", "libc/musl/COPYRIGHT"), ("LLVM libunwind", "libunwind/LICENSE.TXT")]
            }
            Linker::Zig => &[("LLVM libunwind", "libunwind/LICENSE.TXT")],
            Linker::MinGw => &[("MinGW-w64", "libc/mingw/COPYING")],
            Linker::Own => &[],
        };
        linked.iter().map(|&(name, path)| Ok((name, tools.licence(path)?))).collect()
    }

    /// A command of cargo for it, by Zig's linker where tools have it, or what is to be installed.
    ///
    /// # Errors
    /// What is to be installed.
    pub(crate) fn cargo(&self, subcommand: &str, tools: Option<&Tools>) -> Result<Command, String> {
        let toolchain = self.toolchain()?;
        let zig = tools.filter(|_| self.linker == Linker::Zig);
        let mut command = match zig {
            Some(tools) => {
                let mut command = tools.command("cargo-zigbuild");
                command.arg("zigbuild");
                command
            }
            None => {
                let mut command = Command::new(&toolchain.cargo);
                command.arg(subcommand);
                command
            }
        };
        toolchain.prepare(&mut command, tools);
        command.args(["--target", &self.named_for(zig.is_some())]);
        if toolchain.builds_std {
            command.arg("-Zbuild-std");
        }
        Ok(command)
    }

    /// The target that cargo builds for; cargo-zigbuild also gets the version of glibc.
    fn named_for(&self, is_zig: bool) -> String {
        let has_glibc = is_zig && self.triple.ends_with("linux-gnu");
        if has_glibc { format!("{}.{GLIBC}", self.triple) } else { self.triple.to_owned() }
    }

    /// Builds the program and says where it lies, or what that needs.
    pub(super) fn program(&self, tools: &Tools, profile: &str) -> Result<Result<PathBuf, String>> {
        let mut command = match self.cargo("build", Some(tools)) {
            Ok(command) => command,
            Err(lacks) => return Ok(Err(lacks)),
        };
        command.args(["--package", "lumbre-cli", "--bin", "lumbre", "--profile", profile]);
        command::run_command(&mut command)?;
        let folder = if profile == "dev" { "debug" } else { profile };
        let name = if self.is_windows() { "lumbre.exe" } else { "lumbre" };
        Ok(Ok(command::target().join(self.triple).join(folder).join(name)))
    }

    /// Builds the Python package into a folder, or says what that needs.
    pub(super) fn wheel(&self, tools: &Tools, profile: &str, folder: &Path) -> Result<Result<(), String>> {
        let toolchain = match self.toolchain() {
            Ok(toolchain) => toolchain,
            Err(lacks) => return Ok(Err(lacks)),
        };
        let mut command = tools.command("maturin");
        toolchain.prepare(&mut command, Some(tools));
        command.args(["build", "--manifest-path", "crates/lumbre-python/Cargo.toml", "--profile", profile]);
        command.args(["--target", self.triple, "--out"]).arg(folder);
        if self.linker == Linker::Zig {
            command.args(["--zig", "--compatibility", &format!("manylinux_{}", GLIBC.replace('.', "_"))]);
        }
        if toolchain.builds_std {
            command.args(["-Z", "build-std"]);
        }
        command::run_command(&mut command)?;
        Ok(Ok(()))
    }

    /// A tool chain that compiles for it, or what is to be installed.
    fn toolchain(&self) -> Result<Toolchain, String> {
        let is_here = std::env::consts::OS == "macos";
        match self.linker {
            Linker::Own if !is_here => return Err("it is made on a Mac".to_owned()),
            Linker::MinGw if !succeeds("x86_64-w64-mingw32-gcc", &["--version"]) => {
                return Err("it needs MinGW-w64 (apt-get install gcc-mingw-w64-x86-64)".to_owned());
            }
            _ => {}
        }
        Toolchain::find(self.triple).ok_or_else(|| {
            format!("no compiler here has the standard library for it (rustup target add {})", self.triple)
        })
    }
}

/// A compiler with what it needs for a target.
struct Toolchain {
    cargo: OsString,
    rustc: OsString,
    /// Whether the standard library is compiled, from its sources. That takes a switch of nightly compilers, which a
    /// variable allows.
    builds_std: bool,
}

impl Toolchain {
    /// The first that has the library, or else one that has its sources: that of the path, or of the system.
    fn find(triple: &str) -> Option<Self> {
        let known = [("cargo", "rustc"), ("/usr/bin/cargo", "/usr/bin/rustc")];
        let with = |builds_std: bool| {
            known.into_iter().find_map(|(cargo, rustc)| {
                let has = if builds_std { has_sources(rustc) } else { has_library(rustc, triple) };
                has.then(|| Self { cargo: cargo.into(), rustc: rustc.into(), builds_std })
            })
        };
        with(false).or_else(|| with(true))
    }

    /// Has cargo, or what calls it, take this tool chain.
    fn prepare(&self, command: &mut Command, tools: Option<&Tools>) {
        // `cargo run`, which started this program, has these lead to its own.
        for variable in ["LD_LIBRARY_PATH", "CARGO", "RUSTC"] {
            command.env_remove(variable);
        }
        command.current_dir(root()).env("CARGO_TARGET_DIR", command::target());
        let mut folders: Vec<PathBuf> = tools.map(Tools::folder).into_iter().collect();
        if Path::new(&self.cargo).is_absolute() {
            command.env("CARGO", &self.cargo).env("RUSTC", &self.rustc);
            folders.extend(Path::new(&self.cargo).parent().map(Path::to_owned));
        }
        if self.builds_std {
            command.env("RUSTC_BOOTSTRAP", "1");
        }
        let path = std::env::var_os("PATH").unwrap_or_default();
        folders.extend(std::env::split_paths(&path));
        if let Ok(path) = std::env::join_paths(folders) {
            command.env("PATH", path);
        }
    }
}

/// Whether a compiler has the standard library of a target.
fn has_library(rustc: &str, triple: &str) -> bool {
    let folder = command::output(rustc, &["--print", "target-libdir", "--target", triple]);
    let Ok(files) = folder.and_then(|folder| Ok(std::fs::read_dir(folder.trim())?)) else { return false };
    files.flatten().any(|file| {
        let name = file.file_name().to_string_lossy().into_owned();
        name.starts_with("libstd-") && name.ends_with(".rlib")
    })
}

fn has_sources(rustc: &str) -> bool {
    let root = command::output(rustc, &["--print", "sysroot"]);
    root.is_ok_and(|root| Path::new(root.trim()).join("lib/rustlib/src/rust/library/std").is_dir())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_zig_is_told_of_the_glibc() {
        let arm = Target::aarch64();
        assert_eq!(arm.named_for(true), "aarch64-unknown-linux-gnu.2.28");
        assert_eq!(arm.named_for(false), "aarch64-unknown-linux-gnu");
        assert_eq!(Target::named("linux-x86_64-musl").named_for(true), "x86_64-unknown-linux-musl");
        assert_eq!(Target::windows().named_for(false), "x86_64-pc-windows-gnu");
    }
}
