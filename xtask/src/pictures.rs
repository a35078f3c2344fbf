//! The pictures next to the scenes.

use std::path::Path;

use anyhow::{Result, bail};
use xtask::command::{release_program, root, run};

use crate::files;

/// Renders every scene under `scenes/` whose path contains `filter` to a PNG next to it, denoised.
pub(crate) fn render_all(filter: Option<&str>) -> Result<()> {
    let program = release_program()?;
    let program = program.to_string_lossy();
    let folder = root().join("scenes");
    let mut scenes = files::with_ending(&folder, "pbrt")?;
    // Files that other scenes include are not scenes.
    let is_part =
        |scene: &Path| scene.strip_prefix(&folder).is_ok_and(|name| name.iter().any(|it| it == "parts"));
    scenes.retain(|scene| !is_part(scene));
    scenes.retain(|scene| filter.is_none_or(|wanted| scene.to_string_lossy().contains(wanted)));
    if scenes.is_empty() {
        bail!("no scene matches");
    }
    for scene in scenes {
        let picture = scene.with_extension("png");
        let (scene, picture) = (scene.to_string_lossy(), picture.to_string_lossy());
        run(&program, &["render", &scene, "--denoise", "own", "-o", &picture])?;
    }
    Ok(())
}
