//! Options in words, all of them, for messages and for the identity of a render.

use std::fmt::Debug;

/// The fields and values of options in words: `max_depth: 5` is `max depth 5`, and what is not set is `none`. Different
/// options have different texts. It goes by what the type says of itself, so that no field is forgotten.
pub fn in_words(options: &impl Debug) -> String {
    let text = format!("{options:?}");
    let mut out = String::with_capacity(text.len());
    let mut rest = &*text;
    let is_name = |c: char| c.is_alphanumeric() || c == '_';
    while let Some(c) = rest.chars().next() {
        let end = match c {
            '"' => end_of_quotes(rest),
            _ if is_name(c) || c == '-' => {
                // A name, or a number with its sign, point and exponent.
                let is_number = !c.is_alphabetic();
                let is_part = |(at, c): (usize, char)| {
                    let is_sign = matches!(c, '-' | '+') && (at == 0 || rest[..at].ends_with('e'));
                    is_name(c) || (is_number && (c == '.' || is_sign))
                };
                rest.char_indices().find(|&place| !is_part(place)).map_or(rest.len(), |(at, _)| at)
            }
            _ => c.len_utf8(),
        };
        let (token, after) = rest.split_at(end);
        let is_type = out.is_empty() && after.starts_with(" {");
        match token {
            "(" if out.ends_with(is_name) => out.push(' '),
            "{" | "}" | "(" | ")" | ":" | "Some" => {}
            " " if out.is_empty() || out.ends_with([' ', '[']) => {}
            _ if is_type => {}
            _ if is_name(c) && !c.is_numeric() => push_words(token.trim_start_matches('_'), &mut out),
            _ => out.push_str(token),
        }
        rest = after;
    }
    // What closes a list of fields leaves the blank before it.
    out.trim_end().replace(" ,", ",").replace(" ]", "]")
}

/// `max_depth` and `MaxDepth` as `max depth`.
fn push_words(name: &str, out: &mut String) {
    let mut before = '_';
    for c in name.chars() {
        if c == '_' || (c.is_uppercase() && before.is_lowercase()) {
            out.push(' ');
        }
        if c != '_' {
            out.extend(c.to_lowercase());
        }
        before = c;
    }
}

/// Where a text in quotes ends.
fn end_of_quotes(text: &str) -> usize {
    let mut is_escaped = false;
    for (at, c) in text.char_indices().skip(1) {
        match c {
            '"' if !is_escaped => return at + 1,
            _ => is_escaped = c == '\\' && !is_escaped,
        }
    }
    text.len()
}

#[cfg(test)]
mod tests {
    use super::in_words;

    #[derive(Debug)]
    struct Options {
        _max_depth: Option<u32>,
        _kind: Kind,
        _names: Vec<(String, f64)>,
    }

    #[derive(Debug)]
    enum Kind {
        PathTraced { _is_regular: bool },
        Plain,
    }

    #[test]
    fn options_are_told_in_words() {
        let names = vec![("a, \"b: {".to_owned(), -1.5e-300), ("c".to_owned(), 2.0)];
        let options =
            Options { _max_depth: Some(5), _kind: Kind::PathTraced { _is_regular: false }, _names: names };
        assert_eq!(
            in_words(&options),
            r#"max depth 5, kind path traced is regular false, names ["a, \"b: {", -1.5e-300, "c", 2.0]"#
        );
        let options = Options { _max_depth: None, _kind: Kind::Plain, _names: Vec::new() };
        assert_eq!(in_words(&options), "max depth none, kind plain, names []");
        assert_eq!((in_words(&Some(3)), in_words(&None::<u32>)), ("3".to_owned(), "none".to_owned()));
        #[derive(Debug)]
        struct Pair(#[expect(dead_code)] f32, #[expect(dead_code)] Option<(u32, i32)>);
        assert_eq!(
            in_words(&(true, Pair(1.5, Some((20, -14))), None::<f64>)),
            "true, pair 1.5, 20, -14, none"
        );
    }
}
