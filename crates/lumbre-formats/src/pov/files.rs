//! Files that a scene writes and reads: they are in memory, and nothing reaches the disk.

use std::cell::RefCell;
use std::fmt::Write as _;
use std::rc::Rc;

use super::lexer::{Kind, Token, tokens};
use super::value::{Cell, File, Num, Value};
use super::{Parser, Result};
use crate::Diagnostic;
use crate::diagnostic::quoted;
use crate::input::lossy_text;

impl Parser<'_, '_> {
    pub(super) fn open_file(&mut self) -> Result<()> {
        let Some(kind) = self.raw()? else { return Err(self.error("the name of a file is missing")) };
        let Kind::Word(handle) = kind else { return Err(self.error("the name of a file is missing")) };
        let name = self.file_name()?;
        let Some(mode) = self.word()? else { return Err(self.unexpected("read, write or append")) };
        self.peeked = None;
        let reading = match &*mode {
            "read" => Some(self.tokens_of_file(&name)?),
            "write" => {
                self.written.insert(name.clone(), String::new());
                None
            }
            "append" => {
                self.written.entry(name.clone()).or_default();
                None
            }
            _ => return Err(self.error("a file is opened to read, write or append")),
        };
        if reading.is_none() {
            let note = Diagnostic::note("what a scene writes to a file stays in memory").found(quoted(&name));
            let note = self.diagnostic(note);
            self.diagnostics.push(note);
        }
        let file = Value::File(Rc::new(RefCell::new(File { name, is_open: true, reading, at: 0 })));
        let cell: Cell = Rc::new(RefCell::new(file));
        self.globals.insert(handle, cell);
        self.semicolon()
    }

    fn tokens_of_file(&mut self, name: &str) -> Result<Vec<Token>> {
        let text = if let Some(text) = self.written.get(name) {
            text.clone()
        } else {
            let Some(path) = self.find(name) else {
                let wrong = Diagnostic::error("a file that is not there").found(quoted(name));
                return Err(self.diagnostic(wrong).into());
            };
            lossy_text(&crate::Input::open(&path, self.budget)?).into_owned()
        };
        self.budget.bytes(40 * text.len() as u64, "files that a scene reads")?;
        Ok(tokens(&text, &mut self.words).collect())
    }

    fn handle(&mut self) -> Result<Rc<RefCell<File>>> {
        let Some(kind) = self.raw()? else { return Err(self.error("the name of a file is missing")) };
        let Kind::Word(handle) = kind else { return Err(self.error("the name of a file is missing")) };
        match self.lookup(&handle).map(|cell| cell.borrow().clone()) {
            Some(Value::File(file)) => Ok(file),
            _ => Err(self.error("the file is not open")),
        }
    }

    pub(super) fn close_file(&mut self) -> Result<()> {
        self.handle()?.borrow_mut().is_open = false;
        self.semicolon()
    }

    pub(super) fn write_file(&mut self) -> Result<()> {
        self.expect(b'(')?;
        let file = self.handle()?;
        let mut text = String::new();
        while !self.take(b')')? {
            if self.take(b',')? {
                continue;
            }
            if self.is_text()? {
                text.push_str(&self.string()?);
                continue;
            }
            let num = self.expression()?;
            if num.n == 1 {
                text.push_str(&general(num.v[0]));
            } else {
                text.push('<');
                for (i, x) in num.v[..num.n].iter().enumerate() {
                    let _ = write!(text, "{}{}", if i == 0 { "" } else { ", " }, general(*x));
                }
                text.push('>');
            }
        }
        self.budget.bytes(text.len() as u64, "files that a scene writes")?;
        if let Some(content) = self.written.get_mut(&file.borrow().name) {
            content.push_str(&text);
        }
        self.semicolon()
    }

    pub(super) fn read_file(&mut self) -> Result<()> {
        self.expect(b'(')?;
        let file = self.handle()?;
        while !self.take(b')')? {
            if self.take(b',')? {
                continue;
            }
            let Some(name) = self.word()? else { return Err(self.unexpected("an identifier")) };
            self.peeked = None;
            if super::words::is_reserved(&name) {
                return Err(self.reserved(&name));
            }
            let value = self.read_value(&mut file.borrow_mut())?;
            let cell: Cell = match self.lookup(&name) {
                Some(cell) => Rc::clone(cell),
                None => {
                    let cell: Cell = Rc::new(RefCell::new(Value::Nothing));
                    self.globals.insert(name, Rc::clone(&cell));
                    cell
                }
            };
            if self.is_mark(b'[')? {
                let Value::Array(array) = cell.borrow().clone() else {
                    return Err(self.error("what has an index is no array"));
                };
                let index = self.index(&array)?;
                drop(array);
                if let Value::Array(array) = &mut *cell.borrow_mut() {
                    Rc::make_mut(array).elements[index] = value;
                }
            } else {
                *cell.borrow_mut() = value;
            }
        }
        // A comma behind the last value is no value.
        let mut file = file.borrow_mut();
        let at = file.at;
        let is_comma = |token: &Token| token.kind == Kind::Mark(b',');
        if file.reading.as_ref().and_then(|tokens| tokens.get(at)).is_some_and(is_comma) {
            file.at += 1;
        }
        drop(file);
        self.semicolon()
    }

    fn read_value(&self, file: &mut File) -> Result<Value> {
        let Some(tokens) = &file.reading else { return Err(self.error("the file is not open to read")) };
        let mut at = file.at;
        let mut next = || {
            let kind = tokens.get(at).map(|token| token.kind.clone());
            at += 1;
            kind
        };
        let number = |first: Option<Kind>, next: &mut dyn FnMut() -> Option<Kind>| match first {
            Some(Kind::Number(x)) => Some(x),
            Some(Kind::Mark(b'-')) => match next() {
                Some(Kind::Number(x)) => Some(-x),
                _ => None,
            },
            Some(Kind::Mark(b'+')) => match next() {
                Some(Kind::Number(x)) => Some(x),
                _ => None,
            },
            _ => None,
        };
        let wrong = || self.error(format!("{} has no number, vector or text here", quoted(&file.name)));
        let mut first = next();
        while first == Some(Kind::Mark(b',')) {
            first = next();
        }
        let value = match first {
            None => return Err(self.error(format!("{} ends here", quoted(&file.name)))),
            Some(Kind::Text(text)) => Value::Text(super::lexer::unescaped(&text).into()),
            Some(Kind::Mark(b'<')) => {
                let (mut v, mut n) = ([0.0; 5], 0);
                loop {
                    match next() {
                        Some(Kind::Mark(b'>')) => break,
                        Some(Kind::Mark(b',')) => {}
                        other if n < 5 => {
                            v[n] = number(other, &mut next).ok_or_else(wrong)?;
                            n += 1;
                        }
                        _ => return Err(wrong()),
                    }
                }
                if n == 0 {
                    return Err(wrong());
                }
                Value::Num(Num { v, n, is_colour: false })
            }
            other => Value::Num(Num::float(number(other, &mut next).ok_or_else(wrong)?)),
        };
        file.at = at;
        Ok(value)
    }
}

/// A number as C's `%g` prints it: six significant digits.
fn general(x: f64) -> String {
    if x == 0.0 || !x.is_finite() {
        return format!("{x}");
    }
    let scientific = format!("{x:.5e}");
    let Some((digits, exponent)) = scientific.split_once('e') else { return scientific };
    let power: i32 = exponent.parse().unwrap_or(0);
    let trimmed = |text: &str| {
        if text.contains('.') {
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        } else {
            text.to_owned()
        }
    };
    if (-4..6).contains(&power) {
        return trimmed(&format!("{x:.*}", (5 - power).max(0) as usize));
    }
    let sign = if power < 0 { '-' } else { '+' };
    format!("{}e{sign}{:02}", trimmed(digits), power.abs())
}
