//! Any bytes are a scene or an error at a place of it, and what a scene says does not change when it is printed in
//! another form: a token a line, without comments, its numbers as the shortest decimal ones or in hexadecimal.

use lumbre_formats::{Budget, Diagnostics, Limits, pbrt};

use super::read_both_ways;

pub(crate) fn run(bytes: &[u8]) {
    read_both_ways(100_000, "error: fuzz.pbrt", |budget, diagnostics| {
        pbrt::read_bytes("fuzz.pbrt", bytes, None, budget, diagnostics)
    });
    let as_written = read(bytes);
    let Some(tokens) = tokens(bytes) else {
        assert!(as_written.is_none(), "a reader took what is no row of tokens");
        return;
    };
    assert_eq!(as_written, read(&printed(&tokens, decimal)), "in decimals");
    assert_eq!(as_written, read(&printed(&tokens, hexadecimal)), "in hexadecimal");
}

/// All that a scene holds, in words; `None` where it is refused.
fn read(bytes: &[u8]) -> Option<String> {
    let mut limits = Limits::default();
    limits.memory = 64 << 20;
    let scene = pbrt::read_bytes("fuzz.pbrt", bytes, None, &Budget::new(limits), &mut Diagnostics::new());
    scene.ok().map(|scene| format!("{scene:?}"))
}

/// Splits a file as the language says, byte by byte: the plain twin of the reader's lexer.
fn tokens(bytes: &[u8]) -> Option<Vec<&[u8]>> {
    if bytes.starts_with(&[0xFF, 0xFE])
        || bytes.starts_with(&[0xFE, 0xFF])
        || bytes.starts_with(&[0, 0, 0xFE, 0xFF])
    {
        return None;
    }
    let mut left = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    let mut tokens = vec![];
    while let Some(&first) = left.first() {
        let length = match first {
            b' ' | b'\t' | b'\r' | b'\n' => {
                left = &left[1..];
                continue;
            }
            b'#' => {
                let ends = left.iter().position(|b| matches!(b, b'\r' | b'\n'));
                left = &left[ends.unwrap_or(left.len())..];
                continue;
            }
            b'[' | b']' => 1,
            b'"' => string_length(left)?,
            0..=0x1F | 0x7F => return None,
            _ => {
                let ends = left
                    .iter()
                    .position(|b| matches!(b, b' ' | b'\t' | b'\r' | b'\n' | b'"' | b'[' | b']' | 0));
                ends.unwrap_or(left.len())
            }
        };
        let (token, rest) = left.split_at(length);
        tokens.push(token);
        left = rest;
    }
    Some(tokens)
}

/// The length of a string in quotes with both of them; `None` where it does not end on its line.
fn string_length(text: &[u8]) -> Option<usize> {
    let mut is_escaped = false;
    for (at, byte) in text.iter().enumerate().skip(1) {
        match byte {
            b'\r' | b'\n' => return None,
            _ if is_escaped => is_escaped = false,
            b'\\' => is_escaped = true,
            b'"' => return Some(at + 1),
            _ => {}
        }
    }
    None
}

/// A token a line, each number that Rust reads as `number` writes it.
fn printed(tokens: &[&[u8]], number: fn(f64) -> String) -> Vec<u8> {
    let mut out = vec![];
    for token in tokens {
        match value(token) {
            Some(value) => out.extend(number(value).into_bytes()),
            None => out.extend_from_slice(token),
        }
        out.push(b'\n');
    }
    out
}

/// The value of a finite decimal number.
fn value(token: &[u8]) -> Option<f64> {
    let text = std::str::from_utf8(token).ok()?;
    let value: f64 = text.parse().ok()?;
    value.is_finite().then_some(value)
}

fn decimal(value: f64) -> String {
    value.to_string()
}

fn hexadecimal(value: f64) -> String {
    let bits = value.to_bits();
    let (sign, exponent, fraction) =
        (if bits >> 63 == 1 { "-" } else { "" }, bits >> 52 & 0x7FF, bits & ((1 << 52) - 1));
    let (whole, exponent) = if exponent == 0 { (0, -1022) } else { (1, exponent as i32 - 1023) };
    format!("{sign}0x{whole}.{fraction:013x}p{exponent}")
}

#[test]
fn what_a_scene_says_does_not_depend_on_how_it_is_written() {
    let scene = b"\xEF\xBB\xBFOption \"seed\" +0x10 # [\n\tFilm \"rgb\"\"integer xresolution\"[8e0]\r\
        WorldBegin Shape\"trianglemesh\" \"point3 P\"[0 0 0 1. 0 -.5 0 1e-0 0.3333333333333333]";
    let words = read(scene).unwrap();
    assert!(words.contains("-0.5") && words.contains("seed: 16"), "{words}");
    assert_ne!(read(scene), read(&scene.map(|byte| if byte == b'5' { b'6' } else { byte })));
    run(scene);
}
