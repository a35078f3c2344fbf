//! Loads the buffers of a file, and decompresses what extensions compress in them.

#[cfg(feature = "draco")]
use super::draco;
use super::file::{File, List};
use super::json::Read;
use super::meshopt;

/// Finds the lists and loads every buffer. `binary` is the GLB's own buffer.
pub(super) fn load<'a>(file: &mut File<'a>, binary: Option<&'a [u8]>, is_glb: bool) -> Read<()> {
    file.load_buffers(binary, is_glb)?;
    for index in 0..file.list(List::BufferViews).len() {
        let bytes = meshopt::unpacked(file, file.list(List::BufferViews)[index])?;
        file.add_unpacked(bytes);
    }
    #[cfg(feature = "draco")]
    {
        let filled = draco::filled(file)?;
        file.set_filled(filled);
    }
    Ok(())
}
