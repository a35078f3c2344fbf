//! An explanation as one HTML page: formulas as MathML, the sketch as SVG, nothing from a network.

use std::fmt::Write;

use super::document::{Item, Quantity, Section, Value};
use super::formula::{escaped, mathml, sign_after};

const STYLE: &str = "
:root { color-scheme: light dark; --line: #8884; --weak: light-dark(#5c6370, #a9b0bb); --mark: #b50; }
body { background: Canvas; color: CanvasText; font: 16px/1.5 system-ui, sans-serif; max-width: 62rem; margin: 1rem auto; padding: 0 1rem; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.25rem; margin-top: 2rem; border-bottom: 1px solid var(--line); }
h3 { font-size: 1.1rem; } h4, h5, h6 { font-size: 1rem; margin-bottom: .2rem; }
summary { cursor: pointer; } summary > * { display: inline; margin: .6rem 0 .2rem; } body { overflow-wrap: anywhere; }
section section { margin-left: .8rem; padding-left: .8rem; border-left: 2px solid var(--line); }
@media (max-width: 40rem) { section section { margin-left: .2rem; padding-left: .4rem; } body { padding: 0 .5rem; } }
p { margin: .25rem 0; overflow: auto hidden; }
.matrix { display: inline-table; vertical-align: middle; border-left: 1px solid; border-right: 1px solid; border-radius: .5rem; margin: .2rem; }
.matrix td { border: 0; text-align: right; padding: 0 .5rem; } math { font-size: 1.05em; }
.label, .book { color: var(--weak); } .book { margin-left: 1.5rem; }
.remark { border-left: 4px solid var(--mark); padding-left: .6rem; }
.wide { overflow-x: auto; } table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
td, th { padding: .15rem .6rem; border: 1px solid var(--line); text-align: left; }
svg { max-width: 100%; height: auto; display: block; margin: .5rem 0; }
";

/// The page.
pub(super) fn html(title: &str, language: &str, sections: &[Section], schoolbook: &str) -> String {
    let mut out = format!(
        "<!doctype html>\n<html lang=\"{language}\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{title}</title>\n\
         <style>{STYLE}</style>\n</head>\n<body>\n<main>\n<h1>{title}</h1>\n",
        title = escaped(title)
    );
    for section in sections {
        write_section(section, 2, schoolbook, &mut out);
    }
    out.push_str("</main>\n</body>\n</html>\n");
    out
}

fn write_section(section: &Section, level: usize, schoolbook: &str, out: &mut String) {
    let heading = level.min(6);
    let title = escaped(&section.title);
    // Each can be folded, and is open at first.
    let _ = writeln!(out, "<section>\n<details open><summary><h{heading}>{title}</h{heading}></summary>");
    for item in &section.items {
        match item {
            Item::Quantity(quantity) => write_quantity(quantity, schoolbook, out),
            Item::Text(text) => {
                let _ = writeln!(out, "<p>{}</p>", escaped(text));
            }
            Item::Remark(text) => {
                let _ = writeln!(out, "<p class=\"remark\">{}</p>", escaped(text));
            }
            Item::Table { columns, rows, .. } => {
                out.push_str("<div class=\"wide\"><table>\n<tr>");
                for column in columns {
                    let _ = write!(out, "<th>{}</th>", escaped(&column.title));
                }
                out.push_str("</tr>\n");
                for row in rows {
                    out.push_str("<tr>");
                    for cell in row {
                        let _ = write!(out, "<td>{}</td>", escaped(&cell.in_full()));
                    }
                    out.push_str("</tr>\n");
                }
                out.push_str("</table></div>\n");
            }
            Item::Sketch(svg) => {
                let _ = writeln!(out, "{svg}");
            }
        }
    }
    for section in &section.sections {
        write_section(section, level + 1, schoolbook, out);
    }
    out.push_str("</details>\n</section>\n");
}

fn write_quantity(quantity: &Quantity, schoolbook: &str, out: &mut String) {
    let Quantity { symbol, label, value, .. } = quantity;
    let label_after = if label.is_empty() || symbol.is_empty() {
        String::new()
    } else {
        format!(" <span class=\"label\">{}</span>", escaped(label))
    };
    let before = if symbol.is_empty() { format!("{}: ", escaped(label)) } else { String::new() };
    let chain = quantity.chain();
    let parts = chain.iter().map(|(part, sign)| format!("{} {sign} ", mathml(part)));
    // A table cannot be inside a paragraph.
    let (open, close) =
        if value.rows().is_some() { ("<div class=\"wide\">", "</div>") } else { ("<p>", "</p>") };
    let _ = writeln!(out, "{open}{before}{}{}{label_after}{close}", parts.collect::<String>(), shown(value));
    if let Some((formula, value)) = &quantity.schoolbook {
        let sign = sign_after(formula);
        let _ =
            writeln!(out, "<p class=\"book\">{schoolbook}: {} {sign} {}</p>", mathml(formula), shown(value));
    }
}

fn shown(value: &Value) -> String {
    match value.rows() {
        Some(rows) => {
            let row = |row: &[String; 4]| {
                let cells = row.iter().map(|cell| format!("<td>{cell}</td>")).collect::<String>();
                format!("<tr>{cells}</tr>")
            };
            let rows = rows.iter().map(row).collect::<String>();
            format!("<table class=\"matrix\">{rows}</table>")
        }
        None => match value {
            Value::Text(text) => escaped(text),
            _ => mathml(&value.in_full()),
        },
    }
}
