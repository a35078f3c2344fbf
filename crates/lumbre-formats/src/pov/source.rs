//! Where tokens come from: files, the bodies of macros and loops, and what directives choose of them.

use std::path::{Path, PathBuf};
use std::rc::Rc;

use super::lexer::{Kind, Token, tokens};
use super::value::{Cell, Names, Value};
use super::{Parser, Result};
use crate::budget::LimitError;
use crate::input::lossy_text;
use crate::{Diagnostic, FormatError, Input, LimitKind, Place};

/// A file as tokens.
#[derive(Debug)]
pub(super) struct Source {
    pub name: Rc<str>,
    pub tokens: Vec<Token>,
}

/// A macro: its parameters and where its body is.
#[derive(Debug)]
pub(super) struct Macro {
    pub name: Rc<str>,
    pub parameters: Vec<(Rc<str>, bool)>,
    pub source: Rc<Source>,
    pub start: usize,
    pub end: usize,
}

/// A file or the body of a macro that is being read.
#[derive(Debug)]
pub(super) struct Frame {
    pub source: Rc<Source>,
    pub at: usize,
    pub end: usize,
    /// The macro whose body this is; `None` for a file.
    pub of_macro: Option<Rc<str>>,
    pub locals: Names,
    pub blocks: Vec<Block>,
    /// The version of the scene before this file.
    pub version: f64,
}

/// A directive that is open until its `#end`.
#[derive(Debug)]
pub(super) struct Block {
    pub kind: BlockKind,
    /// The token of the directive.
    pub at: usize,
    /// How often it went round.
    pub rounds: u64,
}

#[derive(Debug)]
pub(super) enum BlockKind {
    /// A branch was taken.
    If,
    Switch,
    /// The token after the word.
    While(usize),
    For {
        variable: Cell,
        to: f64,
        step: f64,
        body: usize,
    },
}

/// The steps that reading may take for each element of the budget, and how many there are at least and at most.
const STEPS: (u64, u64) = (1 << 20, 1 << 30);

impl Parser<'_, '_> {
    /// Reads a file's tokens, once.
    pub(super) fn source(&mut self, path: &Path) -> Result<Rc<Source>> {
        if let Some(source) = self.sources.get(path) {
            return Ok(Rc::clone(source));
        }
        let input = Input::open(path, self.budget)?;
        let source = self.cut(&lossy_text(&input), input.name())?;
        self.sources.insert(path.to_owned(), Rc::clone(&source));
        Ok(source)
    }

    /// The tokens of a text.
    pub(super) fn cut(&mut self, text: &str, name: &str) -> Result<Rc<Source>> {
        let mut list = Vec::new();
        let mut hold = self.budget.hold_nothing();
        for token in tokens(text.strip_prefix('\u{FEFF}').unwrap_or(text), &mut self.words) {
            hold.room_in(&mut list, "tokens of a scene")?;
            // A name that is held by this token and the table alone is new.
            let kept = match &token.kind {
                Kind::Word(name) if Rc::strong_count(name) <= 2 => name.len() as u64 + 64,
                Kind::Text(text) => text.len() as u64 + 16,
                _ => 0,
            };
            hold.grow(kept, "tokens of a scene")?;
            list.push(token);
        }
        hold.keep();
        Ok(Rc::new(Source { name: name.into(), tokens: list }))
    }

    /// Enters a file.
    pub(super) fn enter(&mut self, source: Rc<Source>) -> Result<()> {
        self.budget.nesting(self.frames.len() + 1, "#include")?;
        let end = source.tokens.len();
        let version = self.settings.version;
        self.frames.push(Frame {
            source,
            at: 0,
            end,
            of_macro: None,
            locals: Names::default(),
            blocks: Vec::new(),
            version,
        });
        Ok(())
    }

    /// The file of an `#include`: beside the scene, or in the folders of the library.
    pub(super) fn find(&self, name: &str) -> Option<PathBuf> {
        let name = Path::new(name);
        // No scene reads files of its reader's computer by a path of its own.
        let is_inside = |path: &Path| {
            path.components()
                .all(|part| matches!(part, std::path::Component::Normal(_) | std::path::Component::CurDir))
        };
        if !is_inside(name) {
            return None;
        }
        let folders = std::iter::once(&self.folder).chain(self.library.iter());
        folders.map(|folder| folder.join(name)).find(|path| self.budget.is_file(path))
    }

    /// Goes past the next token as it stands, without directives; `false` at the end of a frame.
    fn advance(&mut self) -> Result<bool> {
        self.step()?;
        let Some(frame) = self.frames.last_mut() else { return Ok(false) };
        if frame.at >= frame.end {
            return Ok(false);
        }
        let token = &frame.source.tokens[frame.at];
        frame.at += 1;
        if !Rc::ptr_eq(&self.here.0, &frame.source.name) {
            self.here.0 = Rc::clone(&frame.source.name);
        }
        (self.here.1, self.here.2) = (token.line, token.column);
        if let Kind::Bad(what) = token.kind {
            return Err(self.error(what));
        }
        Ok(true)
    }

    /// The token that was gone past last.
    fn passed(&self) -> Option<&Token> {
        let frame = self.frames.last()?;
        frame.source.tokens.get(frame.at.checked_sub(1)?)
    }

    /// The next token as it stands, without directives; `None` at the end of a frame.
    pub(super) fn raw(&mut self) -> Result<Option<Kind>> {
        Ok(if self.advance()? { self.passed().map(|token| token.kind.clone()) } else { None })
    }

    /// The token this far behind the next one, unexpanded, in the same frame.
    pub(super) fn raw_ahead(&self, ahead: usize) -> Option<&Kind> {
        let frame = self.frames.last()?;
        let at = frame.at + ahead;
        (at < frame.end).then(|| &frame.source.tokens[at].kind)
    }

    /// Passes all tokens up to the next `#`, and takes that; `false` at the end of a frame.
    pub(super) fn skip_to_directive(&mut self) -> Result<bool> {
        let Some(frame) = self.frames.last_mut() else { return Ok(false) };
        let rest = &frame.source.tokens[frame.at..frame.end];
        let passed = rest.iter().position(|token| matches!(token.kind, Kind::Mark(b'#') | Kind::Bad(_)));
        let passed = passed.unwrap_or(rest.len());
        frame.at += passed;
        self.steps += passed as u64;
        self.advance()
    }

    /// Counts a step of reading.
    fn step(&mut self) -> Result<()> {
        self.steps += 1;
        let most = self.budget.limits().elements.clamp(STEPS.0, STEPS.1);
        if self.steps <= most { Ok(()) } else { Err(self.endless(most)) }
    }

    /// The error of a scene that has taken more steps than it may.
    #[cold]
    fn endless(&self, most: u64) -> FormatError {
        // The loop that went round most often is the one that does not end.
        let busiest =
            self.frames.iter().flat_map(|frame| frame.blocks.iter().map(move |block| (frame, block)));
        let busiest = busiest.filter(|(_, block)| block.rounds > 0).max_by_key(|(_, block)| block.rounds);
        let limit = LimitError {
            what: "the steps of a scene".to_owned(),
            kind: LimitKind::Elements,
            needed: self.steps,
            limit: most,
        };
        let place = match busiest {
            Some((frame, block)) => {
                let token = &frame.source.tokens[block.at];
                Place::text(&*frame.source.name, u64::from(token.line), u64::from(token.column))
            }
            None => self.place(),
        };
        let message = match busiest {
            Some((_, block)) => format!("a loop that has not ended after {} rounds", block.rounds),
            None => "a scene that does not end".to_owned(),
        };
        Diagnostic::error(message).at(place).found(limit).into()
    }

    /// The next token that is no directive and no call of a macro; `None` at the end of the scene.
    pub(super) fn fetch(&mut self) -> Result<Option<Kind>> {
        loop {
            if !self.advance()? {
                if self.leave_frame()? {
                    continue;
                }
                return Ok(None);
            }
            let Some(token) = self.passed() else { return Ok(None) };
            match &token.kind {
                Kind::Mark(b'#') => {
                    self.directive()?;
                    if let Some(kind) = self.peeked.take() {
                        return Ok(Some(kind));
                    }
                }
                Kind::Word(name) if !token.is_reserved => match self.lookup_macro(name) {
                    Some(called) => self.call(&called)?,
                    None => return Ok(Some(Kind::Word(Rc::clone(name)))),
                },
                kind => return Ok(Some(kind.clone())),
            }
        }
    }

    fn lookup_macro(&self, name: &str) -> Option<Rc<Macro>> {
        if self.macro_count == 0 {
            return None;
        }
        match &*self.lookup(name)?.borrow() {
            Value::Macro(called) => Some(Rc::clone(called)),
            _ => None,
        }
    }

    /// Goes back to what a file or a macro was entered from; `false` at the end of the scene.
    fn leave_frame(&mut self) -> Result<bool> {
        if let Some(frame) = self.frames.last()
            && let Some(block) = frame.blocks.last()
        {
            let token = &frame.source.tokens[block.at];
            let place = Place::text(&*frame.source.name, u64::from(token.line), u64::from(token.column));
            return Err(Diagnostic::error("a directive without its #end").at(place).into());
        }
        // The main file stays, for what is asked after its end.
        if self.frames.len() <= self.least_frames {
            return Ok(false);
        }
        if let Some(frame) = self.frames.pop()
            && frame.of_macro.is_none()
        {
            self.settings.version = frame.version;
        }
        Ok(true)
    }

    /// The next token, which stays.
    pub(super) fn peek(&mut self) -> Result<Option<&Kind>> {
        if self.peeked.is_none() {
            self.peeked = self.fetch()?;
        }
        Ok(self.peeked.as_ref())
    }

    /// The next token.
    pub(super) fn next(&mut self) -> Result<Kind> {
        let kind = match self.peeked.take() {
            Some(kind) => Some(kind),
            None => self.fetch()?,
        };
        kind.ok_or_else(|| self.error("the scene ends here"))
    }

    /// Whether a mark comes next.
    pub(super) fn is_mark(&mut self, mark: u8) -> Result<bool> {
        Ok(matches!(self.peek()?, Some(Kind::Mark(found)) if *found == mark))
    }

    /// Takes a mark, if it comes next.
    pub(super) fn take(&mut self, mark: u8) -> Result<bool> {
        let is = self.is_mark(mark)?;
        if is {
            self.peeked = None;
        }
        Ok(is)
    }

    /// Takes a mark that has to come next.
    pub(super) fn expect(&mut self, mark: u8) -> Result<()> {
        if self.take(mark)? {
            return Ok(());
        }
        Err(self.unexpected(&format!("{}", mark as char)))
    }

    /// Takes a comma, if one comes next.
    pub(super) fn comma(&mut self) -> Result<()> {
        self.take(b',').map(|_| ())
    }

    /// The word that comes next.
    pub(super) fn word(&mut self) -> Result<Option<Rc<str>>> {
        Ok(match self.peek()? {
            Some(Kind::Word(word)) => Some(Rc::clone(word)),
            _ => None,
        })
    }

    /// Takes a word, if it comes next.
    pub(super) fn take_word(&mut self, word: &str) -> Result<bool> {
        let is = matches!(self.peek()?, Some(Kind::Word(found)) if **found == *word);
        if is {
            self.peeked = None;
        }
        Ok(is)
    }

    /// Where an operator may come, whether what comes next is a directive that begins another statement. What a value
    /// came from, such as a macro or a branch of an `#if`, is left first.
    pub(super) fn ends_here(&mut self) -> Result<bool> {
        while let Some((frames, blocks)) = self.declaring
            && self.peeked.is_none()
        {
            let Some(frame) = self.frames.last() else { return Ok(false) };
            let is_deeper = self.frames.len() > frames;
            if frame.at >= frame.end {
                if !is_deeper || !self.leave_frame()? {
                    return Ok(false);
                }
                continue;
            }
            let (Some(Kind::Mark(b'#')), Some(Kind::Word(word))) = (self.raw_ahead(0), self.raw_ahead(1))
            else {
                return Ok(false);
            };
            let closes = matches!(&**word, "else" | "elseif" | "end" | "break" | "case" | "range");
            if !(is_deeper || closes && frame.blocks.len() > blocks) {
                return Ok(true);
            }
            self.raw()?;
            self.directive()?;
        }
        Ok(false)
    }

    /// Takes a semicolon, if it comes next as it stands.
    pub(super) fn semicolon(&mut self) -> Result<()> {
        if self.peeked.is_none() {
            if self.raw_ahead(0) == Some(&Kind::Mark(b';')) {
                self.raw()?;
            }
            return Ok(());
        }
        self.take(b';').map(|_| ())
    }

    /// The place of the last token.
    pub(super) fn place(&self) -> Place {
        Place::text(&*self.here.0, u64::from(self.here.1), u64::from(self.here.2))
    }

    /// An error at the last token, with the way that led there.
    pub(super) fn error(&self, message: impl Into<String>) -> FormatError {
        self.diagnostic(Diagnostic::error(message)).into()
    }

    /// A diagnostic at the last token, with the way that led there.
    pub(super) fn diagnostic(&self, diagnostic: Diagnostic) -> Diagnostic {
        const MOST: usize = 8;
        let mut diagnostic = diagnostic.at(self.place());
        for pair in self.frames.windows(2).rev().take(MOST) {
            let [outer, inner] = pair else { continue };
            let Some(token) = outer.source.tokens.get(outer.at.saturating_sub(1)) else { continue };
            let place = Place::text(&*outer.source.name, u64::from(token.line), u64::from(token.column));
            let place = match &inner.of_macro {
                Some(name) => place.with_path(format!("by the macro {name}")),
                None => place,
            };
            diagnostic = diagnostic.included_from(place);
        }
        diagnostic
    }

    /// An error that says what comes next, and what would have been accepted.
    pub(super) fn unexpected(&mut self, expected: &str) -> FormatError {
        let found = match self.peek() {
            Ok(kind) => shown(kind),
            Err(error) => return error,
        };
        self.diagnostic(Diagnostic::error("unexpected").found(found).expected(expected)).into()
    }

    /// A warning at the last token.
    pub(super) fn warn(&mut self, message: &str) {
        let diagnostic = self.diagnostic(Diagnostic::warning(message));
        self.diagnostics.push(diagnostic);
    }

    /// The identifier of a name, the innermost first.
    pub(super) fn lookup(&self, name: &str) -> Option<&Cell> {
        self.frames.iter().rev().find_map(|frame| frame.locals.get(name)).or_else(|| self.globals.get(name))
    }
}

/// A token for a message.
pub(super) fn shown(kind: Option<&Kind>) -> String {
    use crate::diagnostic::quoted;
    match kind {
        None => "the end of the scene".to_owned(),
        Some(Kind::Word(word)) => quoted(word),
        Some(Kind::Number(x)) => x.to_string(),
        Some(Kind::Text(text)) => format!("the text {}", quoted(text)),
        Some(Kind::Mark(super::lexer::LESS_OR_EQUAL)) => "\"<=\"".to_owned(),
        Some(Kind::Mark(super::lexer::GREATER_OR_EQUAL)) => "\">=\"".to_owned(),
        Some(Kind::Mark(super::lexer::NOT_EQUAL)) => "\"!=\"".to_owned(),
        Some(Kind::Mark(mark)) => quoted(&(*mark as char).to_string()),
        Some(Kind::Bad(what)) => (*what).to_owned(),
    }
}
