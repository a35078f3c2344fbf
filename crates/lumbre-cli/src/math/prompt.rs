//! A prompt: lines from standard input, one after the other.

use std::io::{BufRead, IsTerminal, Read};

use crate::failure::{Failure, print};

use super::english::ENGLISH;
use super::lexer::is_unfinished;
use super::session::Session;
use super::{Form, evaluate, message};

/// The most bytes that open brackets may collect.
const LONGEST: usize = 1 << 16;

/// Evaluates lines until their end or `quit`. At a terminal a mistake is said and the next line may do better; otherwise
/// it ends the program, as in a file.
pub(super) fn run(session: &mut Session, form: Form) -> Result<(), Failure> {
    let stdin = std::io::stdin().lock();
    let is_terminal = stdin.is_terminal();
    if is_terminal {
        print(&format!("{}\n", ENGLISH.welcome))?;
    }
    converse(stdin, is_terminal, session, form)
}

fn converse(
    mut input: impl BufRead,
    is_terminal: bool,
    session: &mut Session,
    form: Form,
) -> Result<(), Failure> {
    let mut lines_before = 0;
    loop {
        if is_terminal {
            print("> ")?;
        }
        let mut text = String::new();
        let is_end = loop {
            let is_end = !read_line(&mut input, &mut text)?;
            if is_end || !is_unfinished(&text, &ENGLISH) {
                break is_end;
            }
            if is_terminal {
                print("| ")?;
            }
        };
        if matches!(text.trim(), "quit" | "exit") {
            return Ok(());
        }
        if let Err(mut wrong) = evaluate(session, &text, form)? {
            // At a terminal, what was typed last is what is meant; elsewhere lines are counted from the start.
            if is_terminal {
                say!("error: {}", message("expression", &text, &wrong));
            } else {
                let before = "\n".repeat(lines_before);
                wrong.offset += before.len();
                return Err(Failure::Input(message("standard input", &(before + &text), &wrong)));
            }
        }
        if is_end {
            return if is_terminal { print("\n") } else { Ok(()) };
        }
        lines_before += text.matches('\n').count();
    }
}

/// Adds a line to the text; `false` at the end of the input.
fn read_line(input: &mut impl BufRead, text: &mut String) -> Result<bool, Failure> {
    let room = (LONGEST - text.len()) as u64;
    let count = input.take(room).read_line(text).map_err(|e| match e.kind() {
        std::io::ErrorKind::InvalidData => Failure::Input("standard input: not text in UTF-8".into()),
        _ => Failure::Io(format!("standard input: {e}")),
    })?;
    if text.len() >= LONGEST {
        return Err(Failure::Input(format!("standard input: an expression of more than {LONGEST} bytes")));
    }
    Ok(count > 0)
}
