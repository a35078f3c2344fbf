//! Formulas: LaTeX to MathML, which browsers show without a script or a font from elsewhere.

use std::fmt::Write;

use anyhow::{Context, Result, anyhow};
use pulldown_latex::config::{DisplayMode, RenderConfig};
use pulldown_latex::{Parser, Storage, push_mathml};

/// A formula as HTML in a line of Markdown.
pub(crate) fn html(latex: &str, is_displayed: bool) -> Result<String> {
    // What is wrong would be shown in red in the page.
    let storage = Storage::new();
    for event in Parser::new(latex, &storage) {
        event.map_err(|error| anyhow!("wrong formula {latex}: {error}"))?;
    }
    let storage = Storage::new();
    let display_mode = if is_displayed { DisplayMode::Block } else { DisplayMode::Inline };
    let config = RenderConfig { display_mode, ..RenderConfig::default() };
    let mut mathml = String::new();
    push_mathml(&mut mathml, Parser::new(latex, &storage), config).context("cannot write MathML")?;
    let mathml = protected(&with_sided_bars(&mathml, latex)?);
    Ok(if is_displayed { format!("<span class=\"formula\">{mathml}</span>") } else { mathml })
}

/// With bars that open before what they hold and close after it. Without a form, a bar within a row counts as one
/// between two, and stands apart from both.
fn with_sided_bars(mathml: &str, latex: &str) -> Result<String> {
    const BAR: &str = ">|</mo>";
    let forms = latex.match_indices("vert").map(|(at, _)| match latex[..at].strip_suffix('r') {
        Some(_) => " form=\"postfix\"",
        None => " form=\"prefix\"",
    });
    let forms: Vec<&str> = forms.collect();
    let parts: Vec<&str> = mathml.split(BAR).collect();
    anyhow::ensure!(parts.len() == forms.len() + 1, "a bar is \\lvert or \\rvert in {latex}");
    let sided = parts.iter().zip(&forms).map(|(part, form)| format!("{part}{form}{BAR}"));
    Ok(sided.chain([parts[forms.len()].to_owned()]).collect())
}

/// The same elements, with text that Markdown takes for nothing else.
fn protected(mathml: &str) -> String {
    let mut protected = String::new();
    let (mut in_tag, mut is_quoted, mut in_entity) = (false, false, false);
    let mut characters = mathml.chars().peekable();
    while let Some(character) = characters.next() {
        // Characters of the formula itself may stand as they are.
        let opens = characters.peek().is_some_and(|next| next.is_ascii_alphabetic() || "/#".contains(*next));
        in_tag |= character == '<' && opens;
        in_entity |= character == '&' && opens && !in_tag;
        if character == '\n' {
            protected.push(' ');
        } else if character.is_ascii_punctuation() && !in_tag && !in_entity {
            write!(protected, "&#{};", u32::from(character)).expect("a string can be written to");
        } else {
            protected.push(character);
        }
        // Some attributes stand without a space between them.
        if in_tag && character == '"' && characters.peek().is_some_and(char::is_ascii_alphabetic) && is_quoted
        {
            protected.push(' ');
        }
        is_quoted ^= in_tag && character == '"';
        in_tag &= character != '>';
        in_entity &= character != ';';
    }
    protected
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_formula_has_no_marks_of_markdown() {
        let shown = html(r"a * b_1 * [c] \quad x < y", false).expect("a formula");
        assert!(shown.starts_with("<math"), "{shown}");
        let text: String =
            shown.split('<').filter_map(|part| part.split_once('>')).map(|(_, text)| text).collect();
        assert!(text.contains("&#91;") && text.contains("&#60;"), "{text}");
        assert!(!text.contains(['*', '_', '[']), "{text}");
    }

    #[test]
    fn attributes_stand_apart() {
        let shown = html(r"\bigl( x \bigr)", false).expect("a formula");
        assert!(shown.contains("stretchy=\"true\" minsize=\"1.2em\" maxsize="), "{shown}");
    }

    #[test]
    fn bars_stand_at_what_they_hold() {
        let shown = html(r"a - \lvert b \rvert^2", false).expect("a formula");
        let (before, after) = shown.split_once("<mi>b</mi>").expect("what is between the bars");
        assert!(before.contains("form=\"prefix\"") && !before.contains("postfix"), "{shown}");
        assert!(after.contains("form=\"postfix\"") && !after.contains("prefix"), "{shown}");
    }

    #[test]
    fn a_wrong_formula_is_refused() {
        assert!(html(r"\frac{1}{", true).is_err());
        assert!(html(r"\nosuchcommand", false).is_err());
    }
}
