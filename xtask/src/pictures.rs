//! The pictures that stand beside the scenes.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use xtask::command::{release_program, root, run};

/// Renders every scene under `scenes/` whose path contains `filter` to a PNG beside it.
pub(crate) fn render_all(filter: Option<&str>) -> Result<()> {
    let program = release_program()?;
    let program = program.to_string_lossy();
    let mut scenes = Vec::new();
    collect(&root().join("scenes"), &mut scenes)?;
    scenes.sort();
    scenes.retain(|scene| filter.is_none_or(|wanted| scene.to_string_lossy().contains(wanted)));
    if scenes.is_empty() {
        bail!("no scene matches");
    }
    for scene in scenes {
        let picture = scene.with_extension("png");
        run(&program, &["render", &scene.to_string_lossy(), "-o", &picture.to_string_lossy()])?;
    }
    Ok(())
}

/// Scenes below a folder; files that other scenes include are not scenes.
fn collect(folder: &Path, scenes: &mut Vec<PathBuf>) -> Result<()> {
    for entry in fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))? {
        let path = entry?.path();
        if path.is_dir() && !path.ends_with("parts") {
            collect(&path, scenes)?;
        } else if path.extension().is_some_and(|extension| extension == "pbrt") {
            scenes.push(path);
        }
    }
    Ok(())
}
