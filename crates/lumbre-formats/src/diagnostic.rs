//! Places, diagnostics, their collector, and the error type of every reader.

use std::collections::HashMap;
use std::fmt::{self, Display, Formatter, Write as _};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use thiserror::Error;

use crate::budget::LimitError;

/// A place in an input file.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Place {
    /// The file's name as the user gave it.
    pub file: Arc<str>,
    /// The position in the file.
    pub position: Position,
}

/// A position in a file.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Position {
    /// The whole file.
    Whole,
    /// In a text; line and column are counted from 1, the column in characters.
    Text {
        /// The line.
        line: u64,
        /// The column.
        column: u64,
    },
    /// An element of a structured text.
    Element {
        /// The line.
        line: u64,
        /// The column.
        column: u64,
        /// The element's path, such as `/accessors/3/count`.
        path: String,
    },
    /// In binary data.
    Binary {
        /// Bytes from the start of the (unpacked) file.
        offset: u64,
        /// The element's path, such as `/vertex/3/x`; empty when there is none.
        path: String,
    },
}

impl Place {
    /// A file as a whole.
    pub fn whole(file: impl Into<Arc<str>>) -> Self {
        Self { file: file.into(), position: Position::Whole }
    }

    /// A line and a column of a text, both counted from 1.
    pub fn text(file: impl Into<Arc<str>>, line: u64, column: u64) -> Self {
        Self { file: file.into(), position: Position::Text { line, column } }
    }

    /// A byte of binary data, with the path of the element that it belongs to.
    pub fn binary(file: impl Into<Arc<str>>, offset: u64, path: impl Into<String>) -> Self {
        Self { file: file.into(), position: Position::Binary { offset, path: path.into() } }
    }

    /// The same line and column of a text, with the path of the element there; other places, and an empty path,
    /// change nothing.
    #[must_use]
    pub fn with_path(self, path: String) -> Self {
        match self.position {
            Position::Text { line, column } if !path.is_empty() => {
                Self { position: Position::Element { line, column, path }, ..self }
            }
            _ => self,
        }
    }

    /// The line and column of byte `offset` in `text`.
    ///
    /// Lines end with LF, CRLF or a lone CR. Linear in `offset`: for errors.
    pub fn of_offset(file: impl Into<Arc<str>>, text: &[u8], offset: usize) -> Self {
        let (line, column) = walked(text, 0..offset.min(text.len()), (1, 1));
        Self::text(file, line, column)
    }
}

/// The line and column at the end of a range of a text, from those at its start.
fn walked(text: &[u8], range: std::ops::Range<usize>, (mut line, mut column): (u64, u64)) -> (u64, u64) {
    for i in range {
        let byte = text[i];
        let ends = byte == b'\n' || (byte == b'\r' && text.get(i + 1) != Some(&b'\n'));
        if ends {
            (line, column) = (line + 1, 1);
        } else if byte & 0xC0 != 0x80 {
            // UTF-8 continuation bytes belong to the character before them.
            column += 1;
        }
    }
    (line, column)
}

/// The places of one text, for readers that name many of them: as [`Place::of_offset`], but all
/// look-ups together take one pass over the text.
#[derive(Debug, Default)]
pub(crate) struct TextPlaces {
    /// The line and column of every byte whose offset is a multiple of [`TextPlaces::STEP`], as far as known.
    marks: Mutex<Vec<(u64, u64)>>,
}

impl TextPlaces {
    const STEP: usize = 1 << 10;

    /// The line and column of byte `offset` in `text`, always the same text.
    pub(crate) fn place(&self, file: impl Into<Arc<str>>, text: &[u8], offset: usize) -> Place {
        let offset = offset.min(text.len());
        let mut marks = self.marks.lock().unwrap_or_else(PoisonError::into_inner);
        let wanted = offset / Self::STEP;
        let mut mark = marks.last().copied().unwrap_or((1, 1));
        for end in marks.len()..=wanted {
            mark = walked(text, end.saturating_sub(1) * Self::STEP..end * Self::STEP, mark);
            marks.push(mark);
        }
        let (line, column) = walked(text, wanted * Self::STEP..offset, marks[wanted]);
        Place::text(file, line, column)
    }
}

impl Display for Place {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(&self.file)?;
        match &self.position {
            Position::Whole => Ok(()),
            Position::Text { line, column } => write!(f, ":{line}:{column}"),
            Position::Element { line, column, path } => write!(f, ":{line}:{column} {path}"),
            Position::Binary { offset, path } if path.is_empty() => write!(f, ":byte {offset}"),
            Position::Binary { offset, path } => write!(f, ":byte {offset} {path}"),
        }
    }
}

/// The severity of a diagnostic.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Severity {
    /// The input can be used, but a part of it is ignored.
    Warning,
    /// The input cannot be used.
    Error,
    /// A flaw that changes no picture and no answer: [`Strictness::Strict`] ignores it.
    Note,
}

impl Display for Severity {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Warning => "warning",
            Self::Error => "error",
            Self::Note => "note",
        })
    }
}

/// A problem of an input.
///
/// Displayed as `error: FILE:LINE:COL: what: why (found X; expected Y)`, followed by a line for each file that
/// included this one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostic {
    /// The severity.
    pub severity: Severity,
    /// The place, if known.
    pub place: Option<Place>,
    /// What is wrong: the same for all diagnostics of one kind.
    pub message: String,
    /// Why, where that differs from one to the next.
    pub reason: Option<String>,
    /// What was found.
    pub found: Option<String>,
    /// What would have been accepted.
    pub expected: Option<String>,
    /// The nearest valid name to a wrong one.
    pub suggestion: Option<String>,
    /// The places of the includes that led to the file, innermost first.
    pub included_from: Vec<Place>,
}

impl Diagnostic {
    /// A problem that makes the input unusable.
    pub fn error(message: impl Into<String>) -> Self {
        Self::new(Severity::Error, message.into())
    }

    /// A part of the input that was not used.
    pub fn warning(message: impl Into<String>) -> Self {
        Self::new(Severity::Warning, message.into())
    }

    /// A flaw of the input that changes nothing.
    pub fn note(message: impl Into<String>) -> Self {
        Self::new(Severity::Note, message.into())
    }

    fn new(severity: Severity, message: String) -> Self {
        Self {
            severity,
            place: None,
            message,
            reason: None,
            found: None,
            expected: None,
            suggestion: None,
            included_from: vec![],
        }
    }

    /// Adds the place.
    #[must_use]
    pub fn at(self, place: Place) -> Self {
        Self { place: Some(place), ..self }
    }

    /// Adds why.
    #[must_use]
    pub fn because(self, reason: impl Display) -> Self {
        Self { reason: Some(reason.to_string()), ..self }
    }

    /// Adds what was found. Text from the input should have gone through [`quoted`].
    #[must_use]
    pub fn found(self, found: impl Display) -> Self {
        Self { found: Some(found.to_string()), ..self }
    }

    /// Adds what would have been accepted.
    #[must_use]
    pub fn expected(self, expected: impl Display) -> Self {
        Self { expected: Some(expected.to_string()), ..self }
    }

    /// Adds the nearest of the `known` names to `name`, if any is near.
    #[must_use]
    pub fn suggest<'a>(self, name: &str, known: impl IntoIterator<Item = &'a str>) -> Self {
        Self { suggestion: nearest_name(name, known).map(str::to_owned), ..self }
    }

    /// Adds the include that led here; call it from the innermost include outwards.
    #[must_use]
    pub fn included_from(mut self, place: Place) -> Self {
        self.included_from.push(place);
        self
    }

    /// The text without `error: `, `warning: ` or `note: `.
    pub fn body(&self) -> String {
        let mut text = String::new();
        if let Some(place) = &self.place {
            let _ = write!(text, "{place}: ");
        }
        text.push_str(&self.message);
        if let Some(reason) = &self.reason {
            let _ = write!(text, ": {reason}");
        }
        let details: Vec<String> = [
            self.found.as_ref().map(|found| format!("found {found}")),
            self.expected.as_ref().map(|expected| format!("expected {expected}")),
            self.suggestion.as_ref().map(|name| format!("did you mean {}?", quoted(name))),
        ]
        .into_iter()
        .flatten()
        .collect();
        if !details.is_empty() {
            let _ = write!(text, " ({})", details.join("; "));
        }
        for place in &self.included_from {
            let _ = write!(text, "\n  included from {place}");
        }
        text
    }
}

impl Display for Diagnostic {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.severity, self.body())
    }
}

/// Why an input could not be read or an output could not be written.
///
/// Displayed without `error: ` in front; [`FormatError::to_diagnostic`] has the whole line.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum FormatError {
    /// The input is invalid.
    #[error("{}", .0.body())]
    Input(Box<Diagnostic>),
    /// The operating system refused.
    #[error("{}: {action}: {source}", .path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The attempted action, such as `cannot open`.
        action: &'static str,
        /// The system's error.
        source: io::Error,
    },
    /// The input exceeds a limit.
    #[error("{}{source}", place_prefix(.place))]
    Limit {
        /// The place, if known.
        place: Option<Place>,
        /// The limit, and the flag that raises it.
        source: LimitError,
    },
}

fn place_prefix(place: &Option<Place>) -> String {
    place.as_ref().map_or_else(String::new, |place| format!("{place}: "))
}

impl FormatError {
    /// The error of the system for `action` on the file `path`.
    pub fn io(path: &Path, action: &'static str, source: io::Error) -> Self {
        Self::Io { path: path.to_owned(), action, source }
    }

    /// As a diagnostic, whose text starts with `error: `.
    pub fn to_diagnostic(&self) -> Diagnostic {
        match self {
            Self::Input(diagnostic) => (**diagnostic).clone(),
            Self::Io { path, action, source } => {
                Diagnostic::error(format!("{action}: {source}")).at(Place::whole(path.display().to_string()))
            }
            Self::Limit { place, source } => {
                Diagnostic { place: place.clone(), ..Diagnostic::error(source.to_string()) }
            }
        }
    }

    /// Adds the place that includes or names the file; call it from the innermost include outwards.
    #[must_use]
    pub fn included_from(mut self, place: Place) -> Self {
        match &mut self {
            Self::Input(diagnostic) => diagnostic.included_from.push(place),
            Self::Limit { place: at @ None, .. } => *at = Some(place),
            Self::Limit { .. } | Self::Io { .. } => {}
        }
        self
    }

    /// Adds a place, unless it has one.
    #[must_use]
    pub fn or_at(mut self, at: impl FnOnce() -> Place) -> Self {
        match &mut self {
            Self::Input(diagnostic) if diagnostic.place.is_none() => diagnostic.place = Some(at()),
            Self::Limit { place, .. } if place.is_none() => *place = Some(at()),
            _ => {}
        }
        self
    }
}

impl From<Diagnostic> for FormatError {
    /// A warning becomes an error.
    fn from(diagnostic: Diagnostic) -> Self {
        Self::Input(Box::new(Diagnostic { severity: Severity::Error, ..diagnostic }))
    }
}

impl From<LimitError> for FormatError {
    fn from(source: LimitError) -> Self {
        Self::Limit { place: None, source }
    }
}

/// How to treat invalid input.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Strictness {
    /// Drop what cannot be used, such as a face with a NaN vertex, with a warning (`--lenient`).
    Lenient,
    /// Errors are errors, and warnings are warnings.
    #[default]
    Normal,
    /// Warnings are errors, too (`--strict`).
    Strict,
}

/// Collects diagnostics: all are counted, and the first few of each kind are kept.
///
/// Diagnostics of the same severity and message are of one kind, whatever their places and findings.
#[derive(Clone, Debug, Default)]
pub struct Diagnostics {
    strictness: Strictness,
    kept: Vec<Diagnostic>,
    /// The counts of each kind, by message: warnings, errors, then notes.
    kinds: [HashMap<String, u64>; 3],
    warnings: u64,
    errors: u64,
    notes: u64,
    files: Vec<PathBuf>,
    memory_held: u64,
}

impl Diagnostics {
    /// The number of diagnostics kept of one kind.
    pub const KEPT_OF_A_KIND: u64 = 8;
    /// The number of diagnostics kept in all.
    pub const KEPT_IN_ALL: usize = 1000;

    /// An empty collection with [`Strictness::Normal`].
    pub fn new() -> Self {
        Self::default()
    }

    /// An empty collection.
    pub fn with_strictness(strictness: Strictness) -> Self {
        Self { strictness, ..Self::default() }
    }

    /// How to treat invalid input.
    pub fn strictness(&self) -> Strictness {
        self.strictness
    }

    /// Whether unusable parts are dropped with a warning.
    pub fn is_lenient(&self) -> bool {
        self.strictness == Strictness::Lenient
    }

    /// The files that were read for a scene, by the names given: its own, and the files that they name. Also files that
    /// were missing.
    pub fn files_read(&self) -> &[PathBuf] {
        &self.files
    }

    /// The bytes that what was read holds, as charged to its [`crate::Budget`].
    pub fn memory_held(&self) -> u64 {
        self.memory_held
    }

    pub(crate) fn set_read(&mut self, budget: &crate::Budget) {
        self.files = budget.paths();
        self.memory_held = budget.memory_held();
    }

    /// Adds a diagnostic.
    pub fn push(&mut self, diagnostic: Diagnostic) {
        let severity = diagnostic.severity;
        let message = diagnostic.message.clone();
        self.push_with(severity, &message, || diagnostic);
    }

    /// Adds a warning of this kind. `make` is called only if this one is kept: finding a place can be slow.
    pub fn warn(&mut self, message: &str, make: impl FnOnce(Diagnostic) -> Diagnostic) {
        self.push_with(Severity::Warning, message, || make(Diagnostic::warning(message)));
    }

    /// Adds a note of this kind, as [`Diagnostics::warn`] does.
    pub fn note(&mut self, message: &str, make: impl FnOnce(Diagnostic) -> Diagnostic) {
        self.push_with(Severity::Note, message, || make(Diagnostic::note(message)));
    }

    fn push_with(&mut self, severity: Severity, message: &str, make: impl FnOnce() -> Diagnostic) {
        match severity {
            Severity::Warning => self.warnings += 1,
            Severity::Error => self.errors += 1,
            Severity::Note => self.notes += 1,
        }
        let room = self.kinds.iter().map(HashMap::len).sum::<usize>() < Self::KEPT_IN_ALL;
        let kinds = &mut self.kinds[severity as usize];
        let count = match kinds.get_mut(message) {
            Some(count) => {
                *count += 1;
                *count
            }
            None if room => {
                kinds.insert(message.to_owned(), 1);
                1
            }
            None => return,
        };
        if count <= Self::KEPT_OF_A_KIND && self.kept.len() < Self::KEPT_IN_ALL {
            self.kept.push(make());
        }
    }

    /// Appends the diagnostics of another collection. Parallel readers collect separately and are joined in a
    /// fixed order.
    pub fn append(&mut self, other: Self) {
        let (warnings, errors) = (self.warnings + other.warnings, self.errors + other.errors);
        let notes = self.notes + other.notes;
        let mut pushed: [HashMap<String, u64>; 3] = Default::default();
        for diagnostic in other.kept {
            *pushed[diagnostic.severity as usize].entry(diagnostic.message.clone()).or_default() += 1;
            self.push(diagnostic);
        }
        for (severity, kinds) in other.kinds.into_iter().enumerate() {
            for (message, count) in kinds {
                let pushed = pushed[severity].get(&message).copied().unwrap_or(0);
                let room = self.kinds.iter().map(HashMap::len).sum::<usize>() < Self::KEPT_IN_ALL;
                if let Some(mine) = self.kinds[severity].get_mut(&message) {
                    *mine += count - pushed;
                } else if room {
                    self.kinds[severity].insert(message, count);
                }
            }
        }
        (self.warnings, self.errors, self.notes) = (warnings, errors, notes);
    }

    /// The diagnostics kept, in order.
    pub fn kept(&self) -> &[Diagnostic] {
        &self.kept
    }

    /// The number of warnings, kept or not.
    pub fn warnings(&self) -> u64 {
        self.warnings
    }

    /// The number of errors, kept or not.
    pub fn errors(&self) -> u64 {
        self.errors
    }

    /// The number of diagnostics of this severity and message, kept or not.
    pub fn count(&self, severity: Severity, message: &str) -> u64 {
        self.kinds[severity as usize].get(message).copied().unwrap_or(0)
    }

    /// The lines to print: those kept, and for each kind with more the number omitted.
    pub fn lines(&self) -> Vec<String> {
        let mut lines: Vec<String> = self.kept.iter().map(Diagnostic::to_string).collect();
        let severities = [Severity::Warning, Severity::Error, Severity::Note];
        for (severity, kinds) in severities.into_iter().zip(&self.kinds) {
            let mut more: Vec<_> = kinds.iter().filter(|&(_, &count)| count > Self::KEPT_OF_A_KIND).collect();
            more.sort();
            lines.extend(more.into_iter().map(|(message, count)| {
                format!("{severity}: {message} ({} more)", count - Self::KEPT_OF_A_KIND)
            }));
        }
        let counted: u64 = self.kinds.iter().flat_map(HashMap::values).sum();
        let uncounted = self.warnings + self.errors + self.notes - counted;
        if uncounted > 0 {
            lines.push(format!("warning: {uncounted} more of other kinds"));
        }
        lines
    }

    /// The first error, or under [`Strictness::Strict`] the first warning or error.
    ///
    /// # Errors
    /// That diagnostic.
    pub fn check(&self) -> Result<(), FormatError> {
        let strict = self.strictness == Strictness::Strict;
        let is_refused = |severity| match severity {
            Severity::Error => true,
            Severity::Warning => strict,
            Severity::Note => false,
        };
        let first = self.kept.iter().find(|d| is_refused(d.severity));
        first.map_or(Ok(()), |diagnostic| Err(diagnostic.clone().into()))
    }
}

/// Text from an input, made safe for a message: in double quotes, without control characters, truncated after
/// 60 characters.
pub fn quoted(text: &str) -> String {
    let mut out = String::from("\"");
    for (i, c) in text.chars().enumerate() {
        if i == 60 {
            out.push('…');
            break;
        }
        match c {
            '"' | '\\' => out.extend(['\\', c]),
            c if is_printable(c) => out.push(c),
            c => out.extend(c.escape_default()),
        }
    }
    out.push('"');
    out
}

/// Whether a character is harmless in a message: control characters could drive the terminal, and bidirectional
/// marks could disguise the text.
pub fn is_printable(c: char) -> bool {
    !c.is_control()
        && !matches!(c, '\u{200E}' | '\u{200F}' | '\u{202A}'..='\u{202E}' | '\u{2066}'..='\u{2069}')
}

/// The words of a decoder, made safe for a message: one line without control characters, truncated after 120.
pub fn in_one_line(text: &str) -> String {
    let safe = text.chars().map(|c| if is_printable(c) { c } else { ' ' });
    safe.take(120).collect()
}

/// A number from an input for a message; very large and very small ones in scientific notation.
pub fn number(value: f64) -> String {
    let size = value.abs();
    if size.is_finite() && size != 0.0 && !(1e-5..1e10).contains(&size) {
        format!("{value:e}")
    } else {
        value.to_string()
    }
}

/// [`quoted`] for bytes that should have been text.
pub fn quoted_bytes(bytes: &[u8]) -> String {
    quoted(&String::from_utf8_lossy(&bytes[..bytes.len().min(256)]))
}

/// The nearest of `known` to `name`, if at most a third of the longer name's letters are wrong. Insertions,
/// deletions, substitutions and transpositions count one each (the optimal string alignment distance of F. J.
/// Damerau, "A technique for computer detection and correction of spelling errors", CACM 1964). Case is
/// ignored. The first one wins a tie.
pub fn nearest_name<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let letters = |s: &str| s.chars().take(LONGEST + 1).flat_map(char::to_lowercase).collect::<Vec<_>>();
    let wrong = letters(name);
    if wrong.len() > LONGEST {
        return None;
    }
    let mut best: Option<(usize, &str)> = None;
    for candidate in known {
        let right = letters(candidate);
        let allowed = (wrong.len().max(right.len()) / 3).max(1);
        // The difference in length is a lower bound that excludes most candidates.
        let at_least = wrong.len().abs_diff(right.len());
        let at_most = best.map_or(allowed, |(least, _)| allowed.min(least - 1));
        if at_least > at_most || right.len() > LONGEST {
            continue;
        }
        let distance = edit_distance(&wrong, &right);
        if distance <= at_most && distance < right.len() {
            best = Some((distance, candidate));
            if distance == 0 {
                break;
            }
        }
    }
    best.map(|(_, name)| name)
}

/// Longer names are not compared.
const LONGEST: usize = 64;

/// For words of at most [`LONGEST`] letters.
fn edit_distance(a: &[char], b: &[char]) -> usize {
    let mut before_last;
    let mut last = [0; LONGEST + 1];
    let mut row: [usize; LONGEST + 1] = std::array::from_fn(|j| j);
    for i in 1..=a.len() {
        (before_last, last) = (last, row);
        row[0] = i;
        for j in 1..=b.len() {
            let change = last[j - 1] + usize::from(a[i - 1] != b[j - 1]);
            row[j] = change.min(last[j] + 1).min(row[j - 1] + 1);
            let exchanged = i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1];
            if exchanged {
                row[j] = row[j].min(before_last[j - 2] + 1);
            }
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::{Budget, Limits};

    #[test]
    fn places_in_any_order_are_those_of_a_walk_from_the_start() {
        let text = "é a\r\nb\rc\n\n0123456789 ".repeat(400).into_bytes();
        let places = TextPlaces::default();
        let offsets = (0..900).map(|i| i * 7919 % (text.len() + 3)).chain([0, text.len()]);
        for offset in offsets {
            assert_eq!(places.place("a", &text, offset), Place::of_offset("a", &text, offset), "{offset}");
        }
    }

    #[test]
    fn a_diagnostic_reads_as_the_contract_says() {
        let d = Diagnostic::error("wrong number of values")
            .at(Place::text("a/b.pbrt", 12, 7))
            .found(3)
            .expected("a multiple of 2");
        assert_eq!(
            d.to_string(),
            "error: a/b.pbrt:12:7: wrong number of values (found 3; expected a multiple of 2)"
        );
        let w = Diagnostic::warning("unknown parameter")
            .at(Place::text("x.pbrt", 4, 2))
            .found(quoted("rougness"))
            .suggest("rougness", ["reflectance", "roughness"])
            .included_from(Place::text("top.pbrt", 9, 1));
        assert_eq!(
            w.to_string(),
            "warning: x.pbrt:4:2: unknown parameter (found \"rougness\"; did you mean \"roughness\"?)\n  \
             included from top.pbrt:9:1"
        );
        let b = Diagnostic::error("not finite").at(Place::binary("m.ply", 812, "/vertex/3/x")).found("NaN");
        assert_eq!(b.to_string(), "error: m.ply:byte 812 /vertex/3/x: not finite (found NaN)");
        assert_eq!(Diagnostic::error("nothing to render").to_string(), "error: nothing to render");
        let r =
            Diagnostic::warning("image is left out").because("a.png: cannot open: gone").found("\"a.png\"");
        assert_eq!(r.to_string(), "warning: image is left out: a.png: cannot open: gone (found \"a.png\")");
    }

    #[test]
    fn an_error_is_shown_as_its_diagnostic_without_the_prefix() {
        let input: FormatError = Diagnostic::warning("odd").at(Place::text("f", 2, 3)).into();
        let limit = FormatError::from(
            Budget::new(Limits { memory: 9, ..Limits::default() }).bytes(10, "pixels").unwrap_err(),
        )
        .or_at(|| Place::whole("big.png"));
        let io = FormatError::io(Path::new("a/b.obj"), "cannot open", io::ErrorKind::NotFound.into());
        assert_eq!(input.to_string(), "f:2:3: odd");
        assert!(limit.to_string().starts_with("big.png: pixels: needs 10 bytes of memory, limit 9"));
        assert!(io.to_string().starts_with("a/b.obj: cannot open: "));
        for error in [input, limit, io] {
            assert_eq!(error.to_diagnostic().to_string(), format!("error: {error}"));
        }
    }

    #[test]
    fn lines_and_columns_count_characters_and_line_ends() {
        let text = "ab\r\nçd\rx\n\nyz".as_bytes();
        let at = |needle: u8| {
            let offset = text.iter().position(|&b| b == needle).unwrap();
            let Position::Text { line, column } = Place::of_offset("t", text, offset).position else {
                panic!()
            };
            (line, column)
        };
        assert_eq!(at(b'b'), (1, 2));
        assert_eq!(at(b'd'), (2, 2));
        assert_eq!(at(b'x'), (3, 1));
        assert_eq!(at(b'z'), (5, 2));
        assert_eq!(Place::of_offset("t", text, 10_000), Place::text("t", 5, 3));
    }

    #[test]
    fn repeats_are_counted_though_not_kept() {
        let mut all = Diagnostics::new();
        for i in 0..50 {
            all.push(Diagnostic::warning("dropped face").at(Place::text("m.obj", i, 1)).found(i));
        }
        all.push(Diagnostic::error("bad"));
        assert_eq!((all.warnings(), all.errors()), (50, 1));
        assert_eq!(all.kept().len(), 9);
        assert_eq!(all.count(Severity::Warning, "dropped face"), 50);
        assert!(all.lines().contains(&"warning: dropped face (42 more)".to_owned()));

        let mut joined = Diagnostics::new();
        joined.push(Diagnostic::warning("dropped face"));
        joined.append(all);
        assert_eq!((joined.warnings(), joined.errors()), (51, 1));
        assert_eq!(joined.count(Severity::Warning, "dropped face"), 51);
        assert_eq!(joined.count(Severity::Error, "bad"), 1);
    }

    #[test]
    fn endless_kinds_are_counted_in_bounded_memory() {
        let mut all = Diagnostics::new();
        for i in 0..5000 {
            all.push(Diagnostic::warning(format!("unknown thing {i}")));
        }
        assert_eq!(all.warnings(), 5000);
        assert_eq!(all.kept().len(), Diagnostics::KEPT_IN_ALL);
        assert_eq!(all.lines().last().unwrap(), "warning: 4000 more of other kinds");
    }

    #[test]
    fn strict_turns_the_first_warning_into_an_error() {
        let mut normal = Diagnostics::new();
        let mut strict = Diagnostics::with_strictness(Strictness::Strict);
        for all in [&mut normal, &mut strict] {
            all.push(Diagnostic::warning("first"));
            all.push(Diagnostic::warning("second"));
        }
        assert!(normal.check().is_ok());
        assert_eq!(strict.check().unwrap_err().to_diagnostic().to_string(), "error: first");
    }

    #[test]
    fn the_nearest_name_is_found_only_when_it_is_near() {
        let known = ["roughness", "uroughness", "reflectance", "eta", "k"];
        assert_eq!(nearest_name("rougness", known), Some("roughness"));
        assert_eq!(nearest_name("rouhgness", known), Some("roughness"));
        assert_eq!(nearest_name("Reflectence", known), Some("reflectance"));
        assert_eq!(nearest_name("etta", known), Some("eta"));
        assert_eq!(nearest_name("x", known), None);
        assert_eq!(nearest_name("subsurface", known), None);
        assert_eq!(nearest_name(&"a".repeat(1_000_000), known), None);
    }

    #[test]
    fn exchanged_neighbours_count_once() {
        let d =
            |a: &str, b: &str| edit_distance(&a.chars().collect::<Vec<_>>(), &b.chars().collect::<Vec<_>>());
        assert_eq!(d("speher", "sphere"), 2);
        assert_eq!(d("ab", "ba"), 1);
        assert_eq!(d("", "abc"), 3);
        assert_eq!(d("kitten", "sitting"), 3);
    }

    #[test]
    fn text_from_an_input_cannot_drive_the_terminal() {
        assert_eq!(quoted("a\x1b[31m\"b\"\n"), r#""a\u{1b}[31m\"b\"\n""#);
        assert_eq!(quoted(&"y".repeat(1000)).chars().count(), 63);
        assert_eq!(quoted_bytes(&[0xFF, b'a']), "\"\u{FFFD}a\"");
    }
}
