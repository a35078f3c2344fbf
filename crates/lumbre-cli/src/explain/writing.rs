//! Explanations as text for a terminal, as Markdown and as JSON.

use std::fmt::Write;

use serde_json::{Map, Value as Json, json};

use super::document::{Item, Quantity, Section, Textbook, Value};
use super::formula::latex;

/// As text, indented by two spaces a level. Chapter titles of a whole explanation are in capitals; titles of single
/// sections may contain formulas.
pub(super) fn text(sections: &[Section], has_chapters: bool, schoolbook: &str) -> String {
    let mut out = String::new();
    for section in sections {
        if !out.is_empty() {
            out.push('\n');
        }
        let title = if has_chapters { section.title.to_uppercase() } else { section.title.clone() };
        write_text(section, &title, 0, schoolbook, &mut out);
    }
    out
}

fn write_text(section: &Section, title: &str, level: usize, schoolbook: &str, out: &mut String) {
    let indent = "  ".repeat(level);
    let _ = writeln!(out, "{indent}{title}");
    let indent = "  ".repeat(level + 1);
    for item in &section.items {
        match item {
            Item::Quantity(quantity) => write_quantity(quantity, &indent, schoolbook, out),
            Item::Text(text) => {
                let _ = writeln!(out, "{indent}{text}");
            }
            Item::Remark(text) => {
                let _ = writeln!(out, "{indent}! {text}");
            }
            Item::Table { columns, rows, .. } => {
                let titles = columns.iter().map(|column| column.title.clone()).collect();
                let cells: Vec<Vec<String>> = std::iter::once(titles)
                    .chain(rows.iter().map(|row| row.iter().map(Value::in_full).collect()))
                    .collect();
                let width = |i: usize| cells.iter().map(|row| row[i].chars().count()).max().unwrap_or(0);
                let widths: Vec<usize> = (0..columns.len()).map(width).collect();
                for row in &cells {
                    let padded = row.iter().zip(&widths).map(|(cell, width)| format!("{cell:<width$}"));
                    let line = padded.collect::<Vec<_>>().join("  ");
                    let _ = writeln!(out, "{indent}{}", line.trim_end());
                }
            }
            Item::Figure(_) => {}
        }
    }
    for section in &section.sections {
        write_text(section, &section.title, level + 1, schoolbook, out);
    }
}

/// `symbol = formula = numbers = value`; parts may be missing.
fn chain(quantity: &Quantity, value: &str) -> String {
    let mut chain = String::new();
    for (part, sign) in quantity.chain() {
        let _ = write!(chain, "{part} {sign} ");
    }
    chain + value
}

fn write_quantity(quantity: &Quantity, indent: &str, schoolbook: &str, out: &mut String) {
    let Quantity { symbol, label, value, .. } = quantity;
    match value.rows() {
        Some(rows) => {
            let name = if symbol.is_empty() { format!("{label}:") } else { format!("{symbol} =") };
            let _ = writeln!(out, "{indent}{name}");
            let widths: [usize; 4] =
                std::array::from_fn(|j| rows.iter().map(|row| row[j].chars().count()).max().unwrap_or(0));
            for row in &rows {
                let cells: Vec<String> =
                    row.iter().zip(widths).map(|(cell, width)| format!("{cell:>width$}")).collect();
                let _ = writeln!(out, "{indent}  | {} |", cells.join("  "));
            }
        }
        None if symbol.is_empty() => {
            let _ = writeln!(out, "{indent}{label}: {}", value.in_full());
        }
        None => {
            let told = chain(quantity, &value.in_full());
            let label = if label.is_empty() { String::new() } else { format!("   ({label})") };
            let _ = writeln!(out, "{indent}{told}{label}");
        }
    }
    if let Some(Textbook { formula, sign, value }) = &quantity.schoolbook {
        let _ = writeln!(out, "{indent}  {schoolbook}: {formula} {sign} {}", value.in_full());
    }
}

/// As Markdown, with formulas in LaTeX between dollars.
pub(super) fn markdown(sections: &[Section], schoolbook: &str) -> String {
    let mut out = String::new();
    for section in sections {
        write_markdown(section, 2, schoolbook, &mut out);
    }
    out
}

fn write_markdown(section: &Section, level: usize, schoolbook: &str, out: &mut String) {
    // There are six levels of headings.
    let _ = writeln!(out, "{} {}\n", "#".repeat(level.min(6)), literal(&section.title));
    let mut is_list = false;
    for item in &section.items {
        let line = match item {
            Item::Quantity(quantity) => markdown_of(quantity, schoolbook),
            Item::Text(text) => format!("- {}", literal(text)),
            Item::Remark(text) => format!("- **!** {}", literal(text)),
            Item::Table { columns, rows, .. } => {
                if is_list {
                    out.push('\n');
                }
                let row = |cells: Vec<String>| {
                    format!(
                        "| {} |\n",
                        cells
                            .iter()
                            .map(|cell| literal(cell).replace('|', "\\|"))
                            .collect::<Vec<_>>()
                            .join(" | ")
                    )
                };
                out.push_str(&row(columns.iter().map(|column| column.title.clone()).collect()));
                out.push_str(&row(columns.iter().map(|_| "---".to_owned()).collect()));
                for cells in rows {
                    out.push_str(&row(cells.iter().map(Value::in_full).collect()));
                }
                out.push('\n');
                is_list = false;
                continue;
            }
            Item::Figure(figure) => {
                if is_list {
                    out.push('\n');
                }
                for svg in figure.pictures() {
                    let _ = writeln!(out, "{svg}\n");
                }
                is_list = false;
                continue;
            }
        };
        let _ = writeln!(out, "{line}");
        is_list = true;
    }
    if is_list {
        out.push('\n');
    }
    for section in &section.sections {
        write_markdown(section, level + 1, schoolbook, out);
    }
}

/// Text that Markdown shows literally, on one line: names in a scene add no HTML, links, images or formulas.
pub(super) fn literal(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '$' => out.push_str("\\$"),
            '(' if out.ends_with(']') => out.push_str("&#40;"),
            c if c.is_control() => out.extend(c.escape_default()),
            c => out.push(c),
        }
    }
    out
}

fn markdown_of(quantity: &Quantity, schoolbook: &str) -> String {
    let Quantity { symbol, label, value, .. } = quantity;
    let label_after =
        if label.is_empty() || symbol.is_empty() { String::new() } else { format!(" ({})", literal(label)) };
    let latex =
        |formula: &str| latex(formula).replace('<', "\\lt ").replace('>', "\\gt ").replace('$', "\\$");
    let mut line = match (value.rows(), symbol.is_empty()) {
        (Some(rows), _) => {
            let rows = rows.map(|row| row.map(|cell| latex(&cell)).join(" & ")).join(" \\\\ ");
            let name = if symbol.is_empty() { label } else { symbol };
            let is_symbol = name.chars().count() <= 3;
            let matrix = format!("\\begin{{pmatrix}} {rows} \\end{{pmatrix}}");
            if is_symbol {
                format!("- ${} = {matrix}$", latex(name))
            } else {
                format!("- {}: ${matrix}$", literal(name))
            }
        }
        (None, true) => format!("- {}: {}", literal(label), literal(&value.in_full())),
        (None, false) => format!("- ${}${label_after}", latex(&chain(quantity, &value.in_full()))),
    };
    if let Some(Textbook { formula, sign, value }) = &quantity.schoolbook {
        let _ =
            write!(line, "\n  - {schoolbook}: ${}$", latex(&format!("{formula} {sign} {}", value.in_full())));
    }
    line
}

/// As JSON: each section with its key, quantities, sentences, tables and sections.
pub(super) fn json(section: &Section) -> Json {
    let quantities: Vec<Json> = section
        .items
        .iter()
        .filter_map(|item| match item {
            Item::Quantity(quantity) => Some(json_of(quantity)),
            _ => None,
        })
        .collect();
    let mut tables = Map::new();
    let mut texts = Vec::new();
    let mut remarks = Vec::new();
    for item in &section.items {
        match item {
            Item::Text(text) => texts.push(text.clone()),
            Item::Remark(text) => remarks.push(text.clone()),
            Item::Table { key, columns, rows } => {
                let row = |row: &Vec<Value>| {
                    let cells =
                        columns.iter().zip(row).map(|(column, cell)| (column.key.to_owned(), cell.json()));
                    Json::Object(cells.collect())
                };
                tables.insert((*key).to_owned(), rows.iter().map(row).collect());
            }
            Item::Quantity(_) | Item::Figure(_) => {}
        }
    }
    let sections: Vec<Json> = section.sections.iter().map(json).collect();
    let mut object =
        Map::from_iter([("key".to_owned(), json!(section.key)), ("title".to_owned(), json!(section.title))]);
    let parts = [
        ("quantities", Json::from(quantities)),
        ("tables", Json::Object(tables)),
        ("texts", json!(texts)),
        ("remarks", json!(remarks)),
        ("sections", Json::from(sections)),
    ];
    let is_empty = |part: &Json| {
        part.as_array().is_some_and(Vec::is_empty) || part.as_object().is_some_and(Map::is_empty)
    };
    object.extend(
        parts.into_iter().filter(|(_, part)| !is_empty(part)).map(|(key, part)| (key.to_owned(), part)),
    );
    Json::Object(object)
}

fn json_of(quantity: &Quantity) -> Json {
    let Quantity { symbol, label, formula, value, schoolbook, .. } = quantity;
    let mut object = Map::new();
    for (key, text) in [("symbol", symbol), ("label", label), ("formula", formula)] {
        if !text.is_empty() {
            object.insert(key.to_owned(), json!(text));
        }
    }
    object.insert("value".to_owned(), value.json());
    if let Some(Textbook { formula, value, .. }) = schoolbook {
        object.insert("schoolbook".to_owned(), json!({ "formula": formula, "value": value.json() }));
    }
    Json::Object(object)
}

impl Value {
    /// As JSON. JSON has no infinities: they are the texts "inf" and "-inf", and NaN is "nan".
    fn json(&self) -> Json {
        let number = |x: f64| {
            if x.is_finite() {
                json!(x)
            } else if x.is_nan() {
                json!("nan")
            } else {
                json!(if x > 0.0 { "inf" } else { "-inf" })
            }
        };
        // The fewest digits that identify the single-precision number.
        let single = |x: &f32| number(x.to_string().parse().unwrap_or(f64::NAN));
        let list = |numbers: &[f64]| numbers.iter().map(|x| number(*x)).collect::<Json>();
        match self {
            Self::Number(x) => number(*x),
            Self::Single(x) => single(x),
            Self::Vector(v) => list(&v.to_array()),
            Self::Colour(rgb) => rgb.iter().map(single).collect(),
            Self::Numbers(numbers) => list(numbers),
            Self::Intervals(intervals) => intervals.iter().map(|interval| list(interval)).collect(),
            Self::Matrix(m) => m.transpose().to_cols_array_2d().iter().map(|row| list(row)).collect(),
            Self::Text(text) => json!(text),
        }
    }
}
