//! An explanation as one page of HTML: formulas as MathML, figures as SVG, and a script that adds a slider and steps.
//! Nothing is loaded from anywhere, and without the script nothing is missing but these two.

use std::collections::BTreeSet;
use std::fmt::Write;

use super::document::{Item, Quantity, Section, Textbook, Value};
use super::figure::{Figure, Marked};
use super::formula::{UNMARKED, escaped, mathml};
use super::numbers::exact;
use super::texts::Texts;

const STYLE: &str = include_str!("page.css");
/// The script of the page, which is the same on every page.
const SCRIPT: &str = include_str!("page.js");
/// Its hash, as a Content Security Policy names it.
pub(super) const SCRIPT_HASH: &str = "sha256-4CcvE4dkaCxdppEduiLZuItqR5GQR3vMcHoFHWbXGsc=";

/// The page.
pub(super) fn html(title: &str, sections: &[Section], texts: &'static Texts) -> String {
    let mut page = Page { texts, marks: Vec::new(), keys: BTreeSet::new(), out: String::new() };
    for section in sections {
        page.section(section, 2);
    }
    let Page { keys, out: body, .. } = page;
    let mut rules = String::new();
    for key in keys.iter().map(|key| quoted(key)) {
        // What is pointed at lights up everywhere in its section, without a script.
        let _ = writeln!(
            rules,
            ".figured:has([data-mark={key}]:is(:hover, :focus)) [data-mark={key}] {{ --here: var(--lit); --wide: 2.5px; }}"
        );
    }
    format!(
        "<!doctype html>\n<html lang=\"{language}\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{title}</title>\n\
         <style>{STYLE}{rules}</style>\n</head>\n<body>\n<main>\n<h1>{title}</h1>\n{body}</main>\n{steps}\n<script>{SCRIPT}</script>\n</body>\n</html>\n",
        language = texts.code,
        title = escaped(title),
        steps = steps(texts)
    )
}

/// A text between quotes, for a selector.
fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace(['"', '\\', '<'], ""))
}

/// What goes from step to step; it is hidden without the script.
fn steps(texts: &Texts) -> String {
    let [one, before, next, all] =
        [texts.step_by_step, texts.previous, texts.next, texts.show_all].map(escaped);
    format!(
        "<nav id=\"steps\" aria-label=\"{one}\" hidden>\n<button id=\"begin\">{one}</button>\n<span id=\"going\" hidden>\
         <button id=\"previous\" aria-keyshortcuts=\"ArrowLeft\"><span aria-hidden=\"true\">← </span>{before}</button>\n\
         <span id=\"where\" role=\"status\" data-text=\"{}\"></span>\n\
         <button id=\"next\" aria-keyshortcuts=\"ArrowRight\">{next}<span aria-hidden=\"true\"> →</span></button>\n\
         <button id=\"all\">{all}</button></span>\n</nav>",
        escaped(texts.step_of)
    )
}

/// A page in the making.
struct Page {
    texts: &'static Texts,
    /// The symbols that are marked in the figure of the section that is written, those of inner sections last.
    marks: Marked,
    /// The keys of all marks.
    keys: BTreeSet<String>,
    out: String,
}

impl Page {
    fn section(&mut self, section: &Section, level: usize) {
        let heading = level.min(6);
        let title = escaped(&section.title);
        let outside = self.marks.len();
        self.marks.extend(section.marked.iter().cloned());
        let is_figured = section.items.iter().any(|item| matches!(item, Item::Figure(_)));
        let class = if is_figured { " class=\"figured\"" } else { "" };
        // Each folds, and is open at first.
        let _ = writeln!(
            self.out,
            "<section{class}>\n<details open><summary><h{heading}>{title}</h{heading}></summary>"
        );
        for item in &section.items {
            self.item(item);
        }
        for section in &section.sections {
            self.section(section, level + 1);
        }
        self.out.push_str("</details>\n</section>\n");
        self.marks.truncate(outside);
    }

    fn item(&mut self, item: &Item) {
        match item {
            Item::Quantity(quantity) => self.quantity(quantity),
            Item::Text(text) => {
                let _ = writeln!(self.out, "<p>{}</p>", escaped(text));
            }
            Item::Remark(text) => {
                let _ = writeln!(self.out, "<p class=\"remark\">{}</p>", escaped(text));
            }
            Item::Table { columns, rows, .. } => {
                self.out.push_str("<table class=\"rows\" role=\"table\">\n<tr role=\"row\">");
                for column in columns {
                    let _ = write!(self.out, "<th role=\"columnheader\">{}</th>", escaped(&column.title));
                }
                self.out.push_str("</tr>\n");
                for row in rows {
                    self.out.push_str("<tr role=\"row\">");
                    for (column, cell) in columns.iter().zip(row) {
                        let (title, cell) = (escaped(&column.title), escaped(&cell.in_full()));
                        let _ = write!(self.out, "<td role=\"cell\" data-title=\"{title}\">{cell}</td>");
                    }
                    self.out.push_str("</tr>\n");
                }
                self.out.push_str("</table>\n");
            }
            Item::Figure(figure) => self.figure(figure),
        }
    }

    /// A formula, with the symbols in it that are marked.
    fn formula(&self, formula: &str) -> String {
        mathml(formula, &|symbol| key(&self.marks, symbol))
    }

    fn quantity(&mut self, quantity: &Quantity) {
        let Quantity { symbol, label, value, .. } = quantity;
        let label_after = if label.is_empty() || symbol.is_empty() {
            String::new()
        } else {
            format!(" <span class=\"label\">{}</span>", escaped(label))
        };
        let before = if symbol.is_empty() { format!("{}: ", escaped(label)) } else { String::new() };
        let mut line = before;
        for (part, sign) in quantity.chain() {
            let formula = match key(&self.marks, symbol) {
                // Where it is told what it is, it can be reached by the keyboard.
                Some(key) if part == symbol => format!(
                    "<span data-mark={} tabindex=\"0\">{}</span>",
                    quoted(key),
                    mathml(part, UNMARKED)
                ),
                _ => self.formula(part),
            };
            let _ = write!(line, "{formula} {sign} ");
        }
        // A table cannot stand in a paragraph.
        let (open, close) = if value.rows().is_some() { ("<div>", "</div>") } else { ("<p>", "</p>") };
        let _ = writeln!(self.out, "{open}{line}{}{label_after}{close}", shown(value));
        if let Some(Textbook { formula, sign, value }) = &quantity.schoolbook {
            let schoolbook = self.texts.schoolbook;
            let formula = self.formula(formula);
            let _ =
                writeln!(self.out, "<p class=\"book\">{schoolbook}: {formula} {sign} {}</p>", shown(value));
        }
    }

    fn figure(&mut self, figure: &Figure) {
        let texts = self.texts;
        let Figure { panels, plot, ray, places, keys } = figure;
        self.keys.extend(keys.iter().cloned());
        let numbers = |numbers: &[f64]| numbers.iter().map(|x| exact(*x)).collect::<Vec<_>>().join(" ");
        let line = [ray.origin.to_array(), ray.direction.to_array()].concat();
        let _ = writeln!(self.out, "<figure data-ray=\"{}\">\n<div class=\"panels\">", numbers(&line));
        for panel in panels {
            let _ = writeln!(
                self.out,
                "<div class=\"panel\"><p>{}</p>\n{}</div>",
                escaped(panel.title),
                panel.svg
            );
        }
        if let Some(plot) = plot {
            let title = if plot.formula.is_some() { texts.plot } else { texts.plot_of_intervals };
            let formula = plot.formula.as_ref().map(|formula| format!(": {}", self.formula(formula)));
            let pieces: Vec<String> = plot.pieces.iter().map(|piece| numbers(piece)).collect();
            let _ = writeln!(
                self.out,
                "<div class=\"panel\"><p>{}{}</p>\n{}</div>\n</div>",
                escaped(title),
                formula.unwrap_or_default(),
                plot.svg
            );
            let [from, to] = plot.range;
            let _ = write!(
                self.out,
                "<div class=\"slider\" data-pieces=\"{}\" hidden>\n<input type=\"range\" aria-label=\"{}\" min=\"{}\" max=\"{}\" step=\"any\">\n",
                pieces.join("; "),
                escaped(texts.slider),
                exact(from),
                exact(to)
            );
            for (name, t) in places.iter().filter(|(_, t)| from <= *t && *t <= to) {
                let Some(label) = &name.label else { continue };
                let _ = writeln!(
                    self.out,
                    "<button data-t=\"{}\" data-mark={}>{}</button>",
                    exact(*t),
                    quoted(&name.key),
                    escaped(label)
                );
            }
            self.out.push_str("<output></output></div>\n");
        } else {
            self.out.push_str("</div>\n");
        }
        let definitions: Vec<String> =
            plot.iter().flat_map(|plot| &plot.definitions).map(|text| self.formula(text)).collect();
        let definitions =
            if definitions.is_empty() { String::new() } else { format!("<br>{}", definitions.join(", ")) };
        let _ =
            writeln!(self.out, "<figcaption>{}{definitions}</figcaption>\n</figure>", escaped(texts.sketch));
    }
}

/// The key of the mark that a symbol has, that of the innermost section.
fn key<'m>(marks: &'m Marked, symbol: &str) -> Option<&'m str> {
    marks.iter().rev().find(|(marked, _)| marked == symbol).map(|(_, key)| &**key)
}

fn shown(value: &Value) -> String {
    match value.rows().zip(value.short_rows()) {
        Some((rows, short)) => {
            // A narrow screen has no room for all digits.
            let cell = |(full, short): (&String, &String)| match full == short {
                true => format!("<td>{full}</td>"),
                false => {
                    format!(
                        "<td><span class=\"stacked\">{full}</span><span class=\"flat\">{short}</span></td>"
                    )
                }
            };
            let row = |(full, short): (&[String; 4], &[String; 4])| {
                format!("<tr>{}</tr>", full.iter().zip(short).map(cell).collect::<String>())
            };
            let rows = rows.iter().zip(&short).map(row).collect::<String>();
            format!("<table class=\"matrix\">{rows}</table>")
        }
        None => match value {
            Value::Text(text) => escaped(text),
            _ => mathml(&value.in_full(), UNMARKED),
        },
    }
}

#[cfg(test)]
mod tests {
    use sha2::{Digest, Sha256};

    use super::*;

    #[test]
    fn the_hash_is_that_of_the_script() {
        const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
        let digest = Sha256::digest(SCRIPT.as_bytes());
        // Base64 of 32 bytes: 43 letters and a sign.
        let bit = |i: usize| digest.get(i / 8).is_some_and(|byte| byte >> (7 - i % 8) & 1 == 1);
        let letter = |i: usize| LETTERS[(0..6).fold(0, |sum, j| 2 * sum + usize::from(bit(6 * i + j)))];
        let base64: String = (0..43).map(|i| char::from(letter(i))).collect();
        assert_eq!(SCRIPT_HASH, format!("sha256-{base64}="));
        // Nothing in it ends the element, or needs another file.
        assert!(!SCRIPT.contains("</") && !SCRIPT.contains("import"), "{SCRIPT}");
    }
}
