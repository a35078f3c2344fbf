//! A prompt: lines from a terminal, with a history, or from a pipe.

use std::io::{BufRead, IsTerminal, Read};

use rustyline::error::ReadlineError;
use rustyline::{Config, DefaultEditor};

use crate::failure::{Failure, print};
use crate::language::filled;

use super::lexer::open_brackets;
use super::session::Session;
use super::texts::Texts;
use super::{Form, evaluate, message};

/// The most bytes that a line, or the lines of one bracket, may have.
const LONGEST: usize = 1 << 20;

/// Evaluates lines of standard input until their end or `quit`.
pub(super) fn run(session: &mut Session, form: Form) -> Result<(), Failure> {
    if std::io::stdin().is_terminal() && std::io::stdout().is_terminal() {
        from_terminal(session, form)
    } else {
        from_pipe(std::io::stdin().lock(), session, form)
    }
}

fn is_farewell(text: &str) -> bool {
    matches!(text.trim(), "quit" | "exit")
}

/// A mistake is said, and the next line may do better. The history is that of this run: arrow up and down.
fn from_terminal(session: &mut Session, form: Form) -> Result<(), Failure> {
    let texts = session.texts;
    let failed = |e: ReadlineError| Failure::Io(format!("the terminal: {e}"));
    let config = Config::builder().auto_add_history(true).build();
    let mut editor = DefaultEditor::with_config(config).map_err(failed)?;
    print(&format!("{}\n", texts.welcome))?;
    let (mut text, mut open) = (String::new(), 0);
    loop {
        match editor.readline(if text.is_empty() { "> " } else { "| " }) {
            Ok(line) => {
                open = open_brackets(&line, open, texts);
                text += &format!("{line}\n");
            }
            // Ctrl-C gives up what was typed.
            Err(ReadlineError::Interrupted) => (text, open) = (String::new(), 0),
            Err(ReadlineError::Eof) => return Ok(()),
            Err(e) => return Err(failed(e)),
        }
        if is_farewell(&text) {
            return Ok(());
        }
        if open > 0 {
            continue;
        }
        if let Err(wrong) = evaluate(session, &text, form)? {
            say!("error: {}", message(texts.expression, &text, &wrong, texts));
        }
        text.clear();
    }
}

/// A mistake ends the program, as in a file; its line is counted from the start of the input.
fn from_pipe(mut input: impl BufRead, session: &mut Session, form: Form) -> Result<(), Failure> {
    let texts = session.texts;
    let mut lines_before = 0;
    loop {
        let (mut text, mut open) = (String::new(), 0);
        let is_end = loop {
            let line_start = text.len();
            let is_end = !read_line(&mut input, &mut text, texts)?;
            open = open_brackets(&text[line_start..], open, texts);
            if is_end || open == 0 {
                break is_end;
            }
        };
        if is_farewell(&text) {
            return Ok(());
        }
        if let Err(mut wrong) = evaluate(session, &text, form)? {
            let before = "\n".repeat(lines_before);
            wrong.offset += before.len();
            return Err(Failure::Input(message(texts.standard_input, &(before + &text), &wrong, texts)));
        }
        if is_end {
            return Ok(());
        }
        lines_before += text.matches('\n').count();
    }
}

/// Adds a line to the text; `false` at the end of the input.
fn read_line(input: &mut impl BufRead, text: &mut String, texts: &Texts) -> Result<bool, Failure> {
    let room = (LONGEST - text.len()) as u64;
    let count = input.take(room).read_line(text).map_err(|e| match e.kind() {
        std::io::ErrorKind::InvalidData => {
            Failure::Input(format!("{}: {}", texts.standard_input, texts.not_utf8))
        }
        _ => Failure::Io(format!("{}: {e}", texts.standard_input)),
    })?;
    if text.len() >= LONGEST {
        let what = filled(texts.too_long, &[&LONGEST.to_string()]);
        return Err(Failure::Input(format!("{}: {what}", texts.standard_input)));
    }
    Ok(count > 0)
}
