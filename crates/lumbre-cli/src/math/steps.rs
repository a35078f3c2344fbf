//! The steps of a calculation as they are shown: formulas, with matrices set side by side.

use super::texts::Texts;
use super::value::{Matrix, aligned, number};

/// One operation: what it is, and its lines.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Step {
    /// The operation, as `cross(a, b)`.
    pub(super) title: String,
    pub(super) lines: Vec<String>,
}

/// What a calculation leaves behind besides its result.
#[derive(Debug)]
pub(super) struct Work {
    pub(super) texts: &'static Texts,
    pub(super) steps: Vec<Step>,
}

impl Work {
    pub(super) fn new(texts: &'static Texts) -> Self {
        Self { texts, steps: vec![] }
    }

    /// Adds an operation, whose lines follow.
    pub(super) fn begin(&mut self, title: impl Into<String>) {
        self.steps.push(Step { title: title.into(), lines: vec![] });
    }

    /// Adds a line to the last operation.
    pub(super) fn line(&mut self, line: impl Into<String>) {
        if let Some(step) = self.steps.last_mut() {
            step.lines.push(line.into());
        }
    }

    /// Adds blocks side by side.
    pub(super) fn beside(&mut self, blocks: &[Block]) {
        for line in beside(blocks) {
            self.line(line);
        }
    }
}

/// Lines that stand together: a matrix, or a sign between two.
pub(super) struct Block(Vec<String>);

impl From<&str> for Block {
    fn from(text: &str) -> Self {
        Self(vec![text.to_owned()])
    }
}

impl From<String> for Block {
    fn from(text: String) -> Self {
        Self(vec![text])
    }
}

impl From<&Matrix> for Block {
    fn from(m: &Matrix) -> Self {
        Self(aligned(m, "  ").iter().map(|row| format!("| {row} |")).collect())
    }
}

/// Blocks from left to right, each in the middle of the height.
fn beside(blocks: &[Block]) -> Vec<String> {
    let height = blocks.iter().map(|block| block.0.len()).max().unwrap_or(0);
    let mut lines = vec![String::new(); height];
    for block in blocks {
        let width = block.0.iter().map(|line| line.chars().count()).max().unwrap_or(0);
        let top = (height - block.0.len()) / 2;
        for (i, line) in lines.iter_mut().enumerate() {
            let part = i.checked_sub(top).and_then(|k| block.0.get(k)).map_or("", |part| part);
            let gap = if line.is_empty() && width == 0 { "" } else { " " };
            *line = format!("{line}{gap}{part:<width$}");
        }
    }
    lines.into_iter().map(|line| line.strip_prefix(' ').unwrap_or(&line).trim_end().to_owned()).collect()
}

/// A number as a factor: in parentheses where it has a sign.
pub(super) fn factor(x: f64) -> String {
    let written = number(x);
    if written.starts_with('-') { format!("({written})") } else { written }
}

/// `a1·b1 + a2·b2 + …`.
pub(super) fn sum_of_products(a: &[f64], b: &[f64]) -> String {
    let products = a.iter().zip(b).map(|(a, b)| format!("{}·{}", factor(*a), factor(*b)));
    products.collect::<Vec<_>>().join(" + ")
}

/// `a·b - c·d`.
pub(super) fn difference_of_products(a: f64, b: f64, c: f64, d: f64) -> String {
    format!("{}·{} - {}·{}", factor(a), factor(b), factor(c), factor(d))
}
