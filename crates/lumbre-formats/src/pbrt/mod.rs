//! Scenes in the language of pbrt-v4, with Lumbre's additions to it.
//!
//! The whole grammar is read. Features that are not rendered yet are ignored or replaced by the nearest one,
//! with a warning at the place. Scenes of pbrt-v3 are upgraded while they are read, with a one-line notice.
//!
//! Lumbre is more lenient than pbrt: unknown parameters and types are warnings, numbers of a directive may be
//! in brackets, integers are accepted as floats, latitude-longitude environment maps are accepted in addition to
//! equal-area ones, and reflectances above 1 are clamped to 1. `strict` makes each warning an error.
//!
//! [`ShapeDesc::index`](lumbre_scene::ShapeDesc::index) counts the `Shape` directives in the order in which
//! they are read, including those in objects, in included files and ignored ones.

mod colour;
mod convert;
#[cfg(test)]
mod coverage;
mod curves;
mod displacement;
mod exact_shapes;
mod images;
mod lens;
mod lexer;
mod lights;
mod materials;
mod media;
mod old_shapes;
mod openpbr;
#[cfg(test)]
mod pages;
mod params;
mod parser;
mod principled;
mod sensors;
mod settings;
mod shapes;
mod source;
mod state;
mod subdivision;
mod textures;

use std::path::{Path, PathBuf};

use lumbre_scene::SceneDesc;

use crate::{Budget, Diagnostics, FormatError, Input};
use convert::Converter;
use parser::Parser;
use source::Result;

/// Reads scene files, one after another as if they were one; `-` is standard input.
///
/// Relative names of other files start at the folder of the first one.
///
/// # Errors
/// What is wrong, with its place; see the [module](self).
pub fn read_files(
    paths: &[impl AsRef<Path>],
    budget: &Budget,
    diagnostics: &mut Diagnostics,
) -> std::result::Result<SceneDesc, FormatError> {
    let folder = paths.first().and_then(|path| path.as_ref().parent()).unwrap_or(Path::new(""));
    read_sources(paths.iter().map(|path| (path.as_ref(), None)), folder, budget, diagnostics)
}

/// [`read_files`] of files that may have been opened already, with relative names starting at `folder`.
pub(crate) fn read_sources<'b, 'p>(
    sources: impl Iterator<Item = (&'p Path, Option<Input<'b>>)>,
    folder: &Path,
    budget: &'b Budget,
    diagnostics: &mut Diagnostics,
) -> std::result::Result<SceneDesc, FormatError> {
    read(Some(folder.to_owned()), budget, diagnostics, |parser| {
        for (path, input) in sources {
            let is_standard_input = path.as_os_str() == "-";
            let input = match input {
                Some(input) => input,
                None if is_standard_input => {
                    Input::from_stream("standard input", std::io::stdin().lock(), budget, |_| Ok(true))?
                }
                None => Input::open(path, budget)?,
            };
            parser.read(input, budget.canonical(path).filter(|_| !is_standard_input))?;
        }
        Ok(())
    })
}

/// Whether this word begins a directive.
pub(crate) fn is_directive(word: &str) -> bool {
    Parser::is_directive(word)
}

/// Reads a scene from bytes, such as standard input, with a name for messages.
///
/// Relative names of other files start at `directory`; without one, no other file is read, and a scene that
/// names one is an error.
///
/// # Errors
/// What is wrong, with its place; see the [module](self).
pub fn read_bytes(
    name: &str,
    bytes: &[u8],
    directory: Option<&Path>,
    budget: &Budget,
    diagnostics: &mut Diagnostics,
) -> std::result::Result<SceneDesc, FormatError> {
    read(directory.map(Path::to_owned), budget, diagnostics, |parser| {
        parser.read(Input::from_reader(name, bytes, budget)?, None)
    })
}

fn read<'b>(
    directory: Option<PathBuf>,
    budget: &'b Budget,
    diagnostics: &mut Diagnostics,
    inputs: impl FnOnce(&mut Parser<'b, '_>) -> Result<()>,
) -> std::result::Result<SceneDesc, FormatError> {
    let mut parser = Parser::new(Converter::new(budget, diagnostics, directory));
    let outcome = inputs(&mut parser).and_then(|()| parser.finish());
    let scene = match outcome {
        Ok(()) => std::mem::take(&mut parser.converter.scene),
        Err(fault) => return Err(fault.into_format_error(&parser.converter.files)),
    };
    diagnostics.check()?;
    Ok(scene)
}
