//! Lumbre for the browser: the package and the playground, made and tried, as far as there is what they need.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::Args;
use xtask::command::{self, root, run, run_with, succeeds, target};

/// The sources of the package and the playground.
const FOLDER: &str = "crates/lumbre-web/npm";
/// What WebAssembly is compiled for.
pub(crate) const TARGET: &str = "wasm32-unknown-unknown";
/// How it is compiled.
const PROFILE: &str = "web";
/// Vectors of 128 bits, which all browsers have since 2023, and a stack as large as threads of the program have.
const FLAGS: &str = "-C target-feature=+simd128,+bulk-memory -C link-arg=-zstack-size=8388608";
/// Debian's own compiler, whose standard library for WebAssembly is compiled from its sources.
const DEBIAN: [(&str, &str); 3] =
    [("RUSTC_BOOTSTRAP", "1"), ("RUSTC", "/usr/bin/rustc"), ("PATH", "/usr/bin:/bin")];

/// What of it is wanted.
#[derive(Args)]
pub(crate) struct Web {
    /// Only make them; do not try them.
    #[arg(long)]
    no_tests: bool,
    /// Leave screenshots of the playground in this folder.
    #[arg(long, value_name = "FOLDER")]
    pictures: Option<PathBuf>,
}

/// A compiler for WebAssembly.
enum Compiler {
    /// The toolchain's own, with the standard library of the target.
    Rustup,
    /// Debian's.
    Debian,
}

impl Compiler {
    fn find() -> Option<Self> {
        let sysroot = std::process::Command::new("rustc").args(["--print", "sysroot"]).output().ok()?;
        let sysroot = PathBuf::from(String::from_utf8_lossy(&sysroot.stdout).trim());
        if sysroot.join("lib/rustlib").join(TARGET).is_dir() {
            return Some(Self::Rustup);
        }
        let sources = Path::new("/usr/bin/rustc").is_file() && debian_sources();
        (sources && succeeds("/usr/bin/cargo", &["--version"])).then_some(Self::Debian)
    }
}

/// Whether the sources of Debian's standard library are there.
fn debian_sources() -> bool {
    let sysroot = std::process::Command::new("/usr/bin/rustc").args(["--print", "sysroot"]).output();
    sysroot.is_ok_and(|out| {
        let sysroot = PathBuf::from(String::from_utf8_lossy(&out.stdout).trim());
        sysroot.join("lib/rustlib/src/rust/library/std").is_dir()
    })
}

/// What is missing, each with how it is installed.
fn missing() -> Result<Vec<String>> {
    let mut missing = Vec::new();
    if Compiler::find().is_none() {
        let how = "rustup target add wasm32-unknown-unknown, or Debian: apt-get install rustc-web cargo-web rust-web-src lld";
        missing.push(format!("a compiler for {TARGET} ({how})"));
    }
    if matches!(Compiler::find(), Some(Compiler::Debian)) && !succeeds("wasm-ld", &["--version"]) {
        missing.push("wasm-ld (Debian: apt-get install lld)".to_owned());
    }
    let version = bindgen_version()?;
    if bindgen(&version).is_none() {
        missing.push(format!("wasm-bindgen {version} (cargo install wasm-bindgen-cli --version {version})"));
    }
    for (program, package) in [("node", "nodejs"), ("npm", "npm")] {
        if !succeeds(program, &["--version"]) {
            missing.push(format!("{program} (Debian: apt-get install {package})"));
        }
    }
    Ok(missing)
}

/// The version of wasm-bindgen that the code is compiled with: the program has to be of the same.
fn bindgen_version() -> Result<String> {
    let lock = std::fs::read_to_string(root().join("Cargo.lock"))?;
    let after =
        lock.split_once("name = \"wasm-bindgen\"\nversion = \"").context("Cargo.lock has no wasm-bindgen")?;
    Ok(after.1.chars().take_while(|c| *c != '"').collect())
}

/// `wasm-bindgen` of this version: what the variable `WASM_BINDGEN` names, or what is on the path.
fn bindgen(version: &str) -> Option<String> {
    let program = std::env::var("WASM_BINDGEN").unwrap_or_else(|_| "wasm-bindgen".to_owned());
    let said = std::process::Command::new(&program).arg("--version").output().ok()?;
    (String::from_utf8_lossy(&said.stdout).trim() == format!("wasm-bindgen {version}")).then_some(program)
}

/// Makes both, and tries them.
pub(crate) fn make(wanted: &Web) -> Result<()> {
    let missing = missing()?;
    if !missing.is_empty() {
        bail!("cargo xtask web needs\n  {}", missing.join("\n  "));
    }
    let pictures = wanted.pictures.as_ref().map(std::path::absolute).transpose()?;
    build()?;
    if wanted.no_tests { Ok(()) } else { test(pictures.as_deref()) }
}

/// Makes the package for Node.js and pages, and says where it lies, or what that needs.
pub(crate) fn package() -> Result<Result<PathBuf, String>> {
    let missing = missing()?;
    if !missing.is_empty() {
        return Ok(Err(format!("it needs {}", missing.join("; "))));
    }
    build()?;
    Ok(Ok(out().join("npm")))
}

/// The part of the test command: the code for WebAssembly compiles where there is a compiler; what is not made and
/// tried is named.
pub(crate) fn check() -> Result<()> {
    let missing = missing()?;
    if missing.is_empty() && std::env::var_os("LUMBRE_WEB").is_some() {
        build()?;
        return test(None);
    }
    if let Some(compiler) = Compiler::find() {
        compiler.run(&["check"])?;
    }
    let why = match missing.is_empty() {
        true => "it takes minutes: LUMBRE_WEB=1 includes it, and cargo xtask web is it alone".to_owned(),
        false => format!("it needs {}", missing.join("; ")),
    };
    eprintln!("\nThe package for the browser is not built and tried, only its core: {why}");
    Ok(())
}

/// Where cargo builds for WebAssembly.
fn folder() -> PathBuf {
    target().join("wasm")
}

impl Compiler {
    /// Runs cargo on the library for the browser.
    fn run(&self, command: &[&str]) -> Result<()> {
        let folder = folder().to_string_lossy().into_owned();
        let environment = [("CARGO_TARGET_DIR", folder.as_str()), ("RUSTFLAGS", FLAGS)];
        let plain = [command, &["--package", "lumbre-web", "--lib", "--target", TARGET]].concat();
        match self {
            Self::Rustup => run_with("cargo", &plain, &environment),
            Self::Debian => {
                let own = [&plain[..], &["-Zbuild-std=std,panic_abort"]].concat();
                // Debian has no rust-lld.
                let linker = [("CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER", "wasm-ld")];
                run_with("/usr/bin/cargo", &own, &[&environment[..], &DEBIAN, &linker].concat())
            }
        }
    }
}

fn build() -> Result<()> {
    let compiler = Compiler::find().context("no compiler for WebAssembly")?;
    compiler.run(&["build", "--profile", PROFILE])?;
    let generated = format!("{FOLDER}/generated");
    std::fs::create_dir_all(root().join(&generated))?;
    let compiled = folder().join(TARGET).join(PROFILE).join("lumbre_web.wasm");
    let compiled = compiled.to_string_lossy();
    let bindgen = bindgen(&bindgen_version()?).context("wasm-bindgen")?;
    let module = [
        "--target",
        "no-modules",
        "--no-typescript",
        "--remove-name-section",
        "--out-dir",
        &generated,
        &compiled,
    ];
    run(&bindgen, &module)?;
    let install = ["ci", "--prefix", FOLDER, "--ignore-scripts", "--no-audit", "--no-fund"];
    run("npm", &install)?;
    run("npm", &["run", "--prefix", FOLDER, "check"])?;
    let out = out();
    run("node", &[&format!("{FOLDER}/build.mjs"), &out.to_string_lossy()])
}

/// Where the package and the playground lie.
fn out() -> PathBuf {
    target().join("web")
}

fn test(pictures: Option<&Path>) -> Result<()> {
    let program = match std::env::var_os("LUMBRE") {
        Some(named) => named.into(),
        None => command::tested_program()?,
    };
    let (package, playground) = (out().join("npm"), out().join("playground"));
    let [program, package, playground] =
        [&program, &package, &playground].map(|path: &PathBuf| path.to_string_lossy());
    run_with("node", &[&format!("{FOLDER}/tests/node.mjs")], &[("LUMBRE", &program), ("PACKAGE", &package)])?;
    run_with("node", &[&format!("{FOLDER}/tests/shell.mjs")], &[("PACKAGE", &package)])?;
    let Some(browser) = crate::page::browser() else {
        eprintln!("\nThe playground is not tried: it needs Chromium (Debian: apt-get install chromium)");
        return Ok(());
    };
    let browser = browser.to_string_lossy();
    let test = format!("{FOLDER}/tests/browser.mjs");
    let mut words = vec![test.as_str()];
    let pictures = pictures.map(Path::to_string_lossy);
    if let Some(pictures) = &pictures {
        words.extend(["--pictures", pictures]);
    }
    run_with("node", &words, &[("LUMBRE", &program), ("CHROMIUM", &browser), ("PLAYGROUND", &playground)])
}

/// Tries the live parts of a built book, as far as there is what that needs.
pub(crate) fn test_book(html: &Path, program: &Path) -> Result<()> {
    let is_installed = root().join(FOLDER).join("node_modules/playwright-core").is_dir();
    let (true, Some(browser)) = (is_installed, crate::page::browser()) else {
        eprintln!("\nThe live parts of the book are not tried: they need cargo xtask web, and Chromium");
        return Ok(());
    };
    let [browser, html, program] = [&browser, html, program].map(Path::to_string_lossy);
    let environment = [("LUMBRE", &*program), ("CHROMIUM", &*browser), ("BOOK", &*html)];
    run_with("node", &[&format!("{FOLDER}/tests/book.mjs")], &environment)
}
