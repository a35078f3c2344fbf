//! The tests of the Python package, in a virtual environment under `target`.

use std::path::Path;
use std::{env, fs};

use anyhow::{Context, Result};
use xtask::command::{built_as_for_tests, root, run, run_with, succeeds, target};

/// What the environment needs besides Python.
const REQUIREMENTS: &str = "crates/lumbre-python/tests/requirements.txt";
/// Whether it has that: what is slow to be installed is installed once.
const HAS_ALL: &str = "import distributed, manifold3d, mypy, numpy, pytest, rtree, scipy, trimesh";
/// Whether an interpreter is of a version that the package is for, and makes environments.
const IS_FIT: &str = "import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 10))";

/// Builds the native module with the profile of the tests, and runs pytest and the checks of types. Where Python or
/// what the tests need is not there and cannot be installed, they are left out, and that is said.
pub(crate) fn test() -> Result<()> {
    let Some(python) = environment() else { return Ok(()) };
    let package = root().join("crates/lumbre-python");
    build_module(&package)?;
    let (sources, tests) = (text(&package.join("python")), text(&package.join("tests")));
    let config = text(&package.join("pyproject.toml"));
    let own_tests = trimesh_tests(&python).unwrap_or_default();
    let place = [("PYTHONPATH", &*sources), ("MYPYPATH", &*sources), ("TRIMESH_TESTS", &*own_tests)];
    let modules = text(&package.join("python/lumbre"));
    let arguments =
        ["-m", "pytest", "--quiet", "-p", "no:cacheprovider", "--rootdir", &text(&package), "-c", &config];
    run_with(&python, &[&arguments[..], &["--doctest-modules", &modules, &tests]].concat(), &place)?;
    let strict = ["-m", "mypy", "--strict", "--config-file", &config, "--cache-dir"];
    let cache = text(&target().join("python/mypy"));
    let examples = text(&package.join("examples"));
    run_with(&python, &[&strict[..], &[&cache, &modules, &examples]].concat(), &place)?;
    let stubs = ["-m", "mypy.stubtest", "--mypy-config-file", &config, "lumbre._lumbre"];
    run_with(&python, &stubs, &place)
}

/// The interpreter of an environment that has all that the tests need; `None`, which is said, where there is none.
fn environment() -> Option<String> {
    let folder = target().join("python/venv");
    let python = text(&folder.join(if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" }));
    if succeeds(&python, &["-c", HAS_ALL]) {
        return Some(python);
    }
    let system = ["python3", "python"].into_iter().find(|python| succeeds(python, &["-c", IS_FIT]));
    let Some(system) = system else {
        eprintln!(
            "\nThe Python package is left out: it needs Python 3.10 or later with venv (apt-get install python3-venv)"
        );
        return None;
    };
    let made = run(system, &["-m", "venv", &text(&folder)])
        .and_then(|()| run(&python, &["-m", "pip", "install", "--quiet", "--requirement", REQUIREMENTS]));
    match made {
        Ok(()) => Some(python),
        Err(error) => {
            eprintln!("\nThe Python package is left out: {error}");
            None
        }
    }
}

/// The folder of trimesh's own tests, which are in its source package alone; `None`, which is said, where that is not
/// to be had.
fn trimesh_tests(python: &str) -> Option<String> {
    let requirements = fs::read_to_string(root().join(REQUIREMENTS)).ok()?;
    let wanted = requirements.lines().find(|line| line.starts_with("trimesh=="))?;
    let folder = target().join("python");
    let name = wanted.replace("==", "-");
    let tests = folder.join(&name).join("tests");
    if tests.is_dir() {
        return Some(text(&tests));
    }
    let download = ["-m", "pip", "download", "--quiet", "--no-deps", "--no-binary", "trimesh", "--dest"];
    let archive = text(&folder.join(format!("{name}.tar.gz")));
    let fetched = run(python, &[&download[..], &[&text(&folder), wanted]].concat())
        .and_then(|()| run(python, &["-m", "tarfile", "--extract", &archive, &text(&folder)]));
    if let Err(error) = &fetched {
        eprintln!("\nTrimesh's own tests are left out: {error}");
    }
    fetched.ok().map(|()| text(&tests))
}

/// Builds the native module and puts it next to the sources, where Python finds it.
fn build_module(package: &Path) -> Result<()> {
    let built = built_as_for_tests()?;
    let name = format!("{}_lumbre{}", env::consts::DLL_PREFIX, env::consts::DLL_SUFFIX);
    let built = built.join(name);
    let module =
        package.join("python/lumbre").join(if cfg!(windows) { "_lumbre.pyd" } else { "_lumbre.abi3.so" });
    // What is loaded somewhere keeps the old file.
    drop(fs::remove_file(&module));
    fs::copy(&built, &module).with_context(|| format!("cannot copy {}", built.display()))?;
    Ok(())
}

fn text(path: &Path) -> String {
    path.to_string_lossy().into_owned()
}
