//! The grammar: files and includes, directives and where they may appear, parameter lists.

mod directives;
mod parameters;
mod scopes;
mod tokens;
mod transforms;

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use lumbre_math::Transform;

use super::convert::{Converter, io_message};
use super::lexer::{Lexer, Token, TokenKind};
use super::source::{AtSpot, Fault, Result, SourcePosition};
use super::state::{Scope, State};
use crate::diagnostic::quoted;
use crate::{Budget, Diagnostic, FormatError, Hold, Input};

/// A file that is being read.
struct Frame<'b> {
    lexer: Lexer<Input<'b>>,
    // Its canonical path, to detect cycles; `None` if it is not a file.
    canonical: Option<PathBuf>,
    // The state and the scopes to restore after an `Import`.
    import: Option<Box<(State, usize)>>,
    is_top: bool,
}

/// What was read by includes. A short scene may have a long file read any number of times, as a short compressed one
/// may unpack to a long one, and it is held to the same limit.
#[derive(Debug, Default)]
struct Included {
    files: HashSet<PathBuf>,
    /// Bytes of the different files.
    stored: u64,
    /// Bytes read, those of a file counted each time.
    read: u64,
}

impl Included {
    /// Counts a file that is included, and answers the bytes stored and read so far.
    fn count(&mut self, path: &Path, bytes: u64) -> [u64; 2] {
        if !self.files.contains(path) {
            self.files.insert(path.to_owned());
            self.stored += bytes;
        }
        self.read += bytes;
        [self.stored, self.read]
    }
}

/// Parses the scene language and passes each entity to the [`Converter`].
pub(in crate::pbrt) struct Parser<'b, 'd> {
    frames: Vec<Frame<'b>>,
    peeked: Option<Token>,
    in_world: bool,
    state: State,
    scopes: Vec<Scope>,
    coordinate_systems: HashMap<String, [Transform; 2]>,
    included: Included,
    /// What the parameters of the current directive take.
    room: Hold<'b>,
    pub converter: Converter<'b, 'd>,
}

impl<'b, 'd> Parser<'b, 'd> {
    pub fn new(mut converter: Converter<'b, 'd>) -> Self {
        let state = State::new(converter.default_material());
        let room = converter.budget.hold_nothing();
        Self {
            frames: vec![],
            peeked: None,
            in_world: false,
            state,
            scopes: vec![],
            coordinate_systems: HashMap::new(),
            included: Included::default(),
            room,
            converter,
        }
    }

    /// Reads another top-level input to its end.
    pub fn read(&mut self, input: Input<'b>, canonical: Option<PathBuf>) -> Result<()> {
        let file = self.converter.files.add(input.name().clone(), None);
        let lexer = Lexer::new(input, file)?;
        self.frames.push(Frame { lexer, canonical, import: None, is_top: true });
        loop {
            let Some(token) = self.next()? else {
                if self.leave_file()? {
                    return Ok(());
                }
                continue;
            };
            let spot = self.spot(token);
            if token.kind == TokenKind::Bare {
                let name = self.bare(token);
                self.directive(&name, spot)?;
                self.room.empty();
            } else {
                let wrong = Diagnostic::error("no directive before this").found(self.shown(token));
                return Err(spot.wrong(wrong.expected("a directive such as Shape")));
            }
        }
    }

    /// After the last input: checks for open scopes, and completes deferred work.
    pub fn finish(&mut self) -> Result<()> {
        if let Some(scope) = self.scopes.pop() {
            return Err(scope.spot.error(format!("{} without its {}", scope.kind.begin(), scope.kind.end())));
        }
        if !self.in_world {
            let spot = SourcePosition { file: 0, line: 1, column: 1 };
            return Err(spot.error("the scene has no WorldBegin"));
        }
        self.converter.finish()
    }

    fn include(&mut self, spot: SourcePosition) -> Result<()> {
        self.include_file("Include", spot)
    }

    fn import(&mut self, spot: SourcePosition) -> Result<()> {
        self.include_file("Import", spot)
    }

    fn include_file(&mut self, directive: &str, spot: SourcePosition) -> Result<()> {
        let (name, at) = self.string(directive, "a file name in quotes")?;
        let path = self.converter.resolve(&name, at)?;
        let canonical = self.converter.budget.canonical(&path);
        let cycle = self.frames.iter().any(|f| f.canonical.is_some() && f.canonical == canonical);
        if cycle {
            return Err(at.wrong(Diagnostic::error("a file includes itself").found(quoted(&name))));
        }
        self.converter.budget.nesting(self.frames.len() + 1, directive).at(at)?;
        let input = match Input::open(&path, self.converter.budget) {
            Ok(input) => input,
            Err(FormatError::Io { action, source, path }) => {
                let message = io_message(&path, action, &source);
                if !self.converter.diagnostics.is_lenient() {
                    return Err(at.error(message));
                }
                self.converter.note(at, format!("{message}; the scene is read without it"));
                return Ok(());
            }
            Err(FormatError::Limit { source, .. }) => return Err(Fault::Limit(at, Box::new(source))),
            Err(other) => return Err(other.into()),
        };
        let [stored, read] = self.included.count(canonical.as_deref().unwrap_or(&path), input.len() as u64);
        let what = format!("{directive} of {} once more", quoted(&name));
        self.converter.budget.expansion(stored, read, &what).at(at)?;
        let file = self.converter.files.add(input.name().clone(), Some(spot));
        let lexer = Lexer::new(input, file)?;
        let import = (directive == "Import").then(|| Box::new((self.state.clone(), self.scopes.len())));
        self.frames.push(Frame { lexer, canonical, import, is_top: false });
        Ok(())
    }

    /// Ends the current file; returns whether it was a top-level one.
    fn leave_file(&mut self) -> Result<bool> {
        let Some(frame) = self.frames.pop() else { return Ok(true) };
        if let Some((state, depth)) = frame.import.map(|import| *import) {
            if let Some(scope) = self.scopes.get(depth) {
                let message = format!("{} without its {}", scope.kind.begin(), scope.kind.end());
                return Err(scope.spot.error(message));
            }
            self.state = state;
        }
        Ok(frame.is_top)
    }
}

/// The path of the file `name` of a scene in `directory`: relative to it if it exists there, else the name as
/// given.
pub(in crate::pbrt) fn resolve(directory: &Path, name: &str, budget: &Budget) -> PathBuf {
    let beside = directory.join(name);
    if budget.exists(&beside) { beside } else { PathBuf::from(name) }
}
