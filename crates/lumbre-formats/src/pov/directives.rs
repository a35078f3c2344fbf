//! Directives: what begins with `#`.

use std::cell::RefCell;
use std::rc::Rc;

use super::lexer::Kind;
use super::source::{Block, BlockKind, Frame, Macro};
use super::value::{Array, Cell, Names, Num, Value};
use super::words::is_reserved;
use super::{Parser, Result};
use crate::Diagnostic;
use crate::diagnostic::quoted;

/// Two numbers this close are equal.
const EPSILON: f64 = 1e-10;

/// Messages of a scene are cut off after this.
const MAX_SHOWN: usize = 500;

impl Parser<'_, '_> {
    /// What follows a `#`.
    pub(super) fn directive(&mut self) -> Result<()> {
        let at = self.frames.last().map_or(0, |frame| frame.at.saturating_sub(1));
        if !matches!(self.raw_ahead(0), Some(Kind::Word(_))) {
            self.warn("a # without the word of a directive is left out");
            return Ok(());
        }
        let Some(Kind::Word(word)) = self.raw()? else { return Ok(()) };
        match &*word {
            "declare" | "local" => self.declare(&*word == "local"),
            "undef" => self.undef(),
            "include" => self.include(),
            "macro" => self.define_macro(),
            "if" | "ifdef" | "ifndef" => {
                let is_true = self.if_condition(&word)?;
                self.begin_if(at, is_true)
            }
            "else" | "elseif" => self.end_branch(&word),
            "end" => self.end_block(),
            "while" => {
                let start = self.position();
                self.push_block(BlockKind::While(start), at)?;
                self.go_round_while(start)
            }
            "for" => self.begin_for(at),
            "switch" => self.begin_switch(at),
            // Reached from the branch before.
            "case" | "range" => self.parenthesised().map(|_| ()),
            "break" => self.leave_loop(),
            "default" => self.default_directive(),
            "version" => self.version(),
            "debug" | "warning" | "render" | "statistics" => self.show(&word),
            "error" => {
                let text = self.string()?;
                Err(self.error(format!("the scene says: {}", quoted(&text))))
            }
            "fopen" => self.open_file(),
            "fclose" => self.close_file(),
            "write" => self.write_file(),
            "read" => self.read_file(),
            other => {
                let wrong = Diagnostic::error("unknown directive").found(quoted(other));
                Err(self.diagnostic(wrong).into())
            }
        }
    }

    fn position(&self) -> usize {
        self.frames.last().map_or(0, |frame| frame.at)
    }

    fn go_to(&mut self, at: usize) {
        if let Some(frame) = self.frames.last_mut() {
            frame.at = at;
        }
    }

    fn push_block(&mut self, kind: BlockKind, at: usize) -> Result<()> {
        let depth = self.frames.last().map_or(0, |frame| frame.blocks.len());
        self.budget.nesting(depth + 1, "directives")?;
        if let Some(frame) = self.frames.last_mut() {
            frame.blocks.push(Block { kind, at, rounds: 0 });
        }
        Ok(())
    }

    /// An expression in parentheses, where comparisons are allowed.
    pub(super) fn parenthesised(&mut self) -> Result<f64> {
        let outer = self.declaring.take();
        self.expect(b'(')?;
        let value = self.full_expression()?;
        self.expect(b')')?;
        self.declaring = outer;
        self.as_float(&value)
    }

    fn if_condition(&mut self, word: &str) -> Result<bool> {
        if word == "if" {
            return Ok(self.parenthesised()?.abs() >= EPSILON);
        }
        self.expect(b'(')?;
        let is_defined = self.is_defined()?;
        self.expect(b')')?;
        Ok(is_defined == (word == "ifdef"))
    }

    /// Whether the name that comes next, or an element of the array of that name, is defined.
    pub(super) fn is_defined(&mut self) -> Result<bool> {
        let Some(kind) = self.raw()? else { return Err(self.error("a name is missing")) };
        let Kind::Word(name) = kind else { return Err(self.error("a name is missing")) };
        let value = self.lookup(&name).map(|cell| cell.borrow().clone());
        let value = match value {
            Some(Value::Array(array)) if self.is_mark(b'[')? => self.element(&array)?,
            Some(Value::File(file)) => {
                let file = file.borrow();
                let is_over = file.reading.as_ref().is_some_and(|tokens| file.at >= tokens.len());
                return Ok(file.is_open && !is_over);
            }
            Some(value) => Some(value),
            None => None,
        };
        Ok(!matches!(value, None | Some(Value::Nothing)))
    }

    fn begin_if(&mut self, at: usize, is_true: bool) -> Result<()> {
        self.push_block(BlockKind::If, at)?;
        if is_true { Ok(()) } else { self.next_branch() }
    }

    /// Skips to the branch of an `#if` that is to be taken, or past its end.
    fn next_branch(&mut self) -> Result<()> {
        loop {
            match &*self.skip(true)? {
                "end" => {
                    self.pop_block();
                    return Ok(());
                }
                "elseif" => {
                    if self.parenthesised()?.abs() >= EPSILON {
                        return Ok(());
                    }
                }
                _ => return Ok(()),
            }
        }
    }

    fn pop_block(&mut self) -> Option<Block> {
        self.frames.last_mut()?.blocks.pop()
    }

    /// A branch was taken to its end.
    fn end_branch(&mut self, word: &str) -> Result<()> {
        match self.frames.last().and_then(|frame| frame.blocks.last()) {
            Some(Block { kind: BlockKind::If | BlockKind::Switch, .. }) => {
                self.skip_to_end(1)?;
                self.pop_block();
                Ok(())
            }
            _ => Err(self.error(format!("#{word} without #if"))),
        }
    }

    /// Skips past this many `#end`s.
    fn skip_to_end(&mut self, count: usize) -> Result<()> {
        for _ in 0..count {
            while &*self.skip(false)? != "end" {}
        }
        Ok(())
    }

    /// Skips to the `#end` of the open block, or to its next `#else`, `#elseif`, `#case` or `#range`, and gives its
    /// word.
    fn skip(&mut self, stops_at_branches: bool) -> Result<Rc<str>> {
        let mut depth = 0_u32;
        loop {
            if !self.skip_to_directive()? {
                return Err(self.error("a directive without its #end"));
            }
            let Some(kind) = self.raw()? else { continue };
            let Kind::Word(word) = kind else { continue };
            match &*word {
                "if" | "ifdef" | "ifndef" | "while" | "for" | "switch" | "macro" => depth += 1,
                "end" if depth > 0 => depth -= 1,
                "end" => return Ok(word),
                "else" | "elseif" | "case" | "range" if depth == 0 && stops_at_branches => return Ok(word),
                _ => {}
            }
        }
    }

    fn end_block(&mut self) -> Result<()> {
        let Some(frame) = self.frames.last_mut() else { return Ok(()) };
        let Some(block) = frame.blocks.last_mut() else {
            return Err(self.error("#end without a directive that it ends"));
        };
        block.rounds += 1;
        match &block.kind {
            BlockKind::If | BlockKind::Switch => {
                frame.blocks.pop();
                Ok(())
            }
            BlockKind::While(start) => {
                let start = *start;
                self.go_round_while(start)
            }
            BlockKind::For { variable, to, step, body } => {
                let (to, step, body) = (*to, *step, *body);
                let variable = Rc::clone(variable);
                let Value::Num(now) = *variable.borrow() else {
                    return Err(self.error("the variable of #for is no longer a number"));
                };
                let next = now.v[0] + step;
                *variable.borrow_mut() = Value::Num(Num::float(next));
                if is_within(next, to, step) {
                    self.go_to(body);
                } else {
                    self.pop_block();
                }
                Ok(())
            }
        }
    }

    fn go_round_while(&mut self, start: usize) -> Result<()> {
        self.go_to(start);
        if self.parenthesised()?.abs() >= EPSILON {
            return Ok(());
        }
        self.skip_to_end(1)?;
        self.pop_block();
        Ok(())
    }

    fn begin_for(&mut self, at: usize) -> Result<()> {
        self.expect(b'(')?;
        let Some(kind) = self.raw()? else { return Err(self.error("the variable of #for is missing")) };
        let Kind::Word(name) = kind else {
            return Err(self.error("the variable of #for is missing"));
        };
        if is_reserved(&name) {
            return Err(self.reserved(&name));
        }
        self.expect(b',')?;
        let from = self.float()?;
        self.comma()?;
        let to = self.float()?;
        let step = if self.take(b',')? { self.float()? } else { 1.0 };
        self.expect(b')')?;
        if step == 0.0 {
            return Err(self.error("the step of #for is 0"));
        }
        let variable = self.local_cell(&name);
        *variable.borrow_mut() = Value::Num(Num::float(from));
        let body = self.position();
        self.push_block(BlockKind::For { variable, to, step, body }, at)?;
        if !is_within(from, to, step) {
            self.skip_to_end(1)?;
            self.pop_block();
        }
        Ok(())
    }

    fn begin_switch(&mut self, at: usize) -> Result<()> {
        let value = self.parenthesised()?;
        self.push_block(BlockKind::Switch, at)?;
        loop {
            let word = self.skip(true)?;
            match &*word {
                "end" => {
                    self.pop_block();
                    return Ok(());
                }
                "case" => {
                    if (self.parenthesised()? - value).abs() < EPSILON {
                        return Ok(());
                    }
                }
                "range" => {
                    self.expect(b'(')?;
                    let low = self.full_expression()?;
                    let low = self.as_float(&low)?;
                    self.comma()?;
                    let high = self.full_expression()?;
                    let high = self.as_float(&high)?;
                    self.expect(b')')?;
                    if low - EPSILON <= value && value <= high + EPSILON {
                        return Ok(());
                    }
                }
                _ => return Ok(()),
            }
        }
    }

    /// `#break`: leaves a loop, a switch or a macro.
    fn leave_loop(&mut self) -> Result<()> {
        let Some(frame) = self.frames.last_mut() else { return Ok(()) };
        let is_left = |block: &Block| !matches!(block.kind, BlockKind::If);
        match frame.blocks.iter().rposition(is_left) {
            Some(position) => {
                let count = frame.blocks.len() - position;
                self.skip_to_end(count)?;
                if let Some(frame) = self.frames.last_mut() {
                    frame.blocks.truncate(position);
                }
                Ok(())
            }
            None if frame.of_macro.is_some() => {
                frame.blocks.clear();
                frame.at = frame.end;
                Ok(())
            }
            None => Err(self.error("#break outside of a loop")),
        }
    }

    fn define_macro(&mut self) -> Result<()> {
        let Some(kind) = self.raw()? else { return Err(self.error("the name of a macro is missing")) };
        let Kind::Word(name) = kind else { return Err(self.error("the name of a macro is missing")) };
        if is_reserved(&name) {
            return Err(self.reserved(&name));
        }
        let mut parameters = Vec::new();
        let wrong = |parser: &Self| parser.error("the parameters of a macro are names in parentheses");
        if self.raw()? != Some(Kind::Mark(b'(')) {
            return Err(wrong(self));
        }
        let mut is_optional = false;
        loop {
            match self.raw()? {
                Some(Kind::Mark(b')')) => break,
                Some(Kind::Mark(b',')) => {}
                Some(Kind::Word(word)) if &*word == "optional" => is_optional = true,
                Some(Kind::Word(word)) => parameters.push((word, std::mem::take(&mut is_optional))),
                _ => return Err(wrong(self)),
            }
        }
        let Some(frame) = self.frames.last() else { return Ok(()) };
        let (source, start) = (Rc::clone(&frame.source), frame.at);
        self.skip_to_end(1)?;
        // Without the `#end`.
        let end = self.position().saturating_sub(2);
        let made = Macro { name: Rc::clone(&name), parameters, source, start, end };
        self.macro_count += 1;
        self.assign(&name, false, Value::Macro(Rc::new(made)))
    }

    /// Reads the arguments of a macro, and enters its body.
    pub(super) fn call(&mut self, called: &Rc<Macro>) -> Result<()> {
        self.budget.nesting((self.frames.len() + 1) / 4, "macros")?;
        let outer = self.declaring.take();
        let held = self.peeked.take();
        if self.raw_ahead(0) != Some(&Kind::Mark(b'(')) {
            return Err(self.error(format!("the macro {} is called without its arguments", called.name)));
        }
        self.raw()?;
        let mut locals = Names::with_capacity(called.parameters.len());
        for (i, (parameter, is_optional)) in called.parameters.iter().enumerate() {
            if i > 0 && !*is_optional {
                self.comma()?;
            } else if i > 0 {
                self.take(b',')?;
            }
            if self.peeked.is_none() && self.raw_ahead(0) == Some(&Kind::Mark(b')')) || self.is_closing() {
                if *is_optional {
                    continue;
                }
                let count = called.parameters.len();
                return Err(self.error(format!("the macro {} has {count} parameters", called.name)));
            }
            let cell = match self.reference()? {
                Some(cell) => cell,
                None => Rc::new(RefCell::new(self.value()?)),
            };
            locals.insert(Rc::clone(parameter), cell);
        }
        if !self.take(b')')? {
            let count = called.parameters.len();
            let wrong = Diagnostic::error(format!("the macro {} has {count} parameters", called.name));
            return Err(self.diagnostic(wrong).into());
        }
        self.peeked = held;
        self.declaring = outer;
        let version = self.settings.version;
        self.frames.push(Frame {
            source: Rc::clone(&called.source),
            at: called.start,
            end: called.end,
            of_macro: Some(Rc::clone(&called.name)),
            locals,
            blocks: Vec::new(),
            version,
        });
        Ok(())
    }

    fn is_closing(&self) -> bool {
        self.peeked.as_ref().is_some_and(|kind| *kind == Kind::Mark(b')'))
    }

    /// The identifier that an argument is, where it is nothing but a name.
    fn reference(&mut self) -> Result<Option<Cell>> {
        if self.peeked.is_some() {
            return Ok(None);
        }
        let (Some(Kind::Word(name)), Some(Kind::Mark(b',' | b')'))) = (self.raw_ahead(0), self.raw_ahead(1))
        else {
            return Ok(None);
        };
        let name = Rc::clone(name);
        if is_reserved(&name) {
            return Ok(None);
        }
        let cell = match self.lookup(&name) {
            Some(cell) if matches!(*cell.borrow(), Value::Macro(_)) => return Ok(None),
            Some(cell) => Rc::clone(cell),
            // The macro may declare it.
            None => {
                let cell: Cell = Rc::new(RefCell::new(Value::Nothing));
                self.globals.insert(name, Rc::clone(&cell));
                cell
            }
        };
        self.raw()?;
        Ok(Some(cell))
    }

    fn declared_name(&mut self) -> Result<Rc<str>> {
        match self.raw()? {
            Some(Kind::Word(name)) => Ok(name),
            _ => Err(self.error("the name of an identifier is missing")),
        }
    }

    fn declare(&mut self, is_local: bool) -> Result<()> {
        let mut name = self.declared_name()?;
        // `deprecated once "message"` before a name asks for a warning where the name is used.
        if &*name == "deprecated" && self.raw_ahead(0) != Some(&Kind::Mark(b'=')) {
            if matches!(self.raw_ahead(0), Some(Kind::Word(word)) if &**word == "once") {
                self.raw()?;
            }
            if matches!(self.raw_ahead(0), Some(Kind::Text(_))) {
                self.raw()?;
            }
            name = self.declared_name()?;
        }
        if is_reserved(&name) {
            return Err(self.reserved(&name));
        }
        if self.raw_ahead(0) == Some(&Kind::Mark(b'[')) {
            return self.declare_element(&name);
        }
        if self.raw_ahead(0) == Some(&Kind::Mark(b'(')) {
            return Err(self.error("functions are declared without parentheses behind their name"));
        }
        if self.raw()? != Some(Kind::Mark(b'=')) {
            return Err(self.error("an = is missing"));
        }
        if let Some(cell) = self.lookup(&name)
            && let Value::Function(_) = *cell.borrow()
            && !is_local
        {
            return Err(self.error("a function cannot be declared again: #undef it first"));
        }
        let value = self.declared_value()?;
        self.assign(&name, is_local, value)
    }

    /// What stands behind the = of a declaration, up to its semicolon.
    fn declared_value(&mut self) -> Result<Value> {
        let blocks = self.frames.last().map_or(0, |frame| frame.blocks.len());
        let outer = self.declaring.replace((self.frames.len(), blocks));
        let value = self.value()?;
        self.ends_here()?;
        self.semicolon()?;
        // That was perhaps the semicolon of a macro, behind the value that it yields.
        self.ends_here()?;
        self.semicolon()?;
        self.declaring = outer;
        Ok(value)
    }

    fn declare_element(&mut self, name: &str) -> Result<()> {
        let Some(cell) = self.lookup(name).cloned() else {
            return Err(self.undeclared(name));
        };
        let Value::Array(array) = cell.borrow().clone() else {
            return Err(self.error("what has an index is no array"));
        };
        let index = self.index(&array)?;
        if self.raw()? != Some(Kind::Mark(b'=')) {
            return Err(self.error("an = is missing"));
        }
        drop(array);
        let value = self.declared_value()?;
        let mut target = cell.borrow_mut();
        let Value::Array(array) = &mut *target else {
            return Err(self.error("what has an index is no array"));
        };
        let array: &mut Array = Rc::make_mut(array);
        if let Some(element) = array.elements.get_mut(index) {
            *element = value;
        }
        Ok(())
    }

    /// The cell of a local identifier, made if need be.
    fn local_cell(&mut self, name: &Rc<str>) -> Cell {
        let is_top = self.frames.len() <= 1;
        let table = match self.frames.last_mut() {
            Some(frame) if !is_top => &mut frame.locals,
            _ => &mut self.globals,
        };
        Rc::clone(table.entry(Rc::clone(name)).or_insert_with(|| Rc::new(RefCell::new(Value::Nothing))))
    }

    fn assign(&mut self, name: &Rc<str>, is_local: bool, value: Value) -> Result<()> {
        let cell = if is_local {
            self.local_cell(name)
        } else if let Some(cell) = self.lookup(name) {
            Rc::clone(cell)
        } else {
            self.budget.bytes(name.len() as u64 + 128, "identifiers")?;
            let cell: Cell = Rc::new(RefCell::new(Value::Nothing));
            self.globals.insert(Rc::clone(name), Rc::clone(&cell));
            cell
        };
        *cell.borrow_mut() = value;
        Ok(())
    }

    fn undef(&mut self) -> Result<()> {
        let Some(kind) = self.raw()? else { return Ok(()) };
        let Kind::Word(name) = kind else { return Err(self.error("a name is missing")) };
        for frame in self.frames.iter_mut().rev() {
            if frame.locals.remove(&name).is_some() {
                return Ok(());
            }
        }
        self.globals.remove(&name);
        Ok(())
    }

    fn include(&mut self) -> Result<()> {
        let name = self.file_name()?;
        let Some(path) = self.find(&name) else {
            let wrong = Diagnostic::error("the file of an #include is not there").found(quoted(&name));
            let expected = "a file beside the scene, or in a folder of --pov-include (Debian has POV-Ray's own in povray-includes)";
            return Err(self.diagnostic(wrong.expected(expected)).into());
        };
        self.semicolon()?;
        let source = self.source(&path).map_err(|error| error.included_from(self.place()))?;
        // What was looked at ahead comes after the file: no directive is looked past.
        self.enter(source)
    }

    fn show(&mut self, word: &str) -> Result<()> {
        let text = self.string()?;
        let shown: String = text.trim().chars().take(MAX_SHOWN).collect();
        if !shown.is_empty() {
            let message = format!("the scene says: {}", quoted(&shown));
            let made =
                if word == "warning" { Diagnostic::warning(message) } else { Diagnostic::note(message) };
            let made = self.diagnostic(made);
            self.diagnostics.push(made);
        }
        self.semicolon()
    }

    fn version(&mut self) -> Result<()> {
        let blocks = self.frames.last().map_or(0, |frame| frame.blocks.len());
        let outer = self.declaring.replace((self.frames.len(), blocks));
        let version = self.float()?;
        self.declaring = outer;
        self.semicolon()?;
        self.settings.set_version(version);
        Ok(())
    }
}

fn is_within(value: f64, to: f64, step: f64) -> bool {
    if step > 0.0 { value <= to + EPSILON } else { value >= to - EPSILON }
}
