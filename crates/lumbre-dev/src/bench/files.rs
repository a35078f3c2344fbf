//! Meshes from files, by the readers of `lumbre-formats`.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, bail};
use lumbre_formats::{ReadOptions, open_scene};
use lumbre_kernel::TriangleMesh;
use lumbre_math::DVec3;
use lumbre_scene::GeometryDesc;

use crate::scene::Scene;

/// The meshes under `shared/data/meshes` next to the repository or a worktree of it; none where there is no such
/// folder.
pub(crate) fn found() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let folders = ["../shared/data/meshes", "../../shared/data/meshes"].map(|folder| root.join(folder));
    let Some(folder) = folders.iter().find(|folder| folder.is_dir()) else { return Vec::new() };
    let mut meshes = Vec::new();
    let mut folders = vec![folder.clone()];
    while let Some(folder) = folders.pop() {
        let Ok(entries) = std::fs::read_dir(&folder) else { continue };
        for path in entries.flatten().map(|entry| entry.path()) {
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|ending| ending == "ply" || ending == "obj") {
                meshes.push(path);
            }
        }
    }
    meshes.sort();
    meshes
}

/// What the table calls the scene of a file.
pub(crate) fn name(path: &Path) -> String {
    path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned())
}

/// All meshes of a file as one, in single precision.
///
/// # Errors
/// What the reader says, and when there are no triangles in it.
pub(crate) fn read(path: &Path) -> Result<Scene> {
    let (scene, _) = open_scene(path, &ReadOptions::default()).map_err(|e| anyhow!("{e}"))?;
    let mut whole = TriangleMesh { origin: DVec3::ZERO, ..TriangleMesh::default() };
    for shape in &scene.shapes {
        let GeometryDesc::Mesh(mesh) = &shape.geometry else {
            bail!("{} holds more than meshes", path.display());
        };
        let first = u32::try_from(whole.positions.len()).context("too many vertices")?;
        whole.positions.extend_from_slice(&mesh.positions);
        whole.indices.extend(mesh.triangles.iter().map(|triangle| triangle.map(|i| first + i)));
        for quad in &mesh.quads {
            let [a, b, c, d] = quad.map(|i| first + i);
            whole.indices.extend([[a, b, c], [a, c, d]]);
        }
    }
    if whole.indices.is_empty() {
        bail!("{} has no triangles", path.display());
    }
    Ok(Scene::of_mesh(name(path), whole))
}
