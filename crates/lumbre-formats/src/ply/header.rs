//! The header of a PLY file.

use std::collections::HashSet;
use std::sync::Arc;

use crate::diagnostic::{
    Diagnostic, Diagnostics, FormatError, Place, Severity, TextPlaces, quoted, quoted_bytes,
};

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Encoding {
    Text,
    Little,
    Big,
}

impl Encoding {
    pub(super) fn place(
        self,
        name: &Arc<str>,
        bytes: &[u8],
        at: usize,
        element: &str,
        index: u64,
        property: &str,
    ) -> Place {
        match self {
            Self::Text => Place::of_offset(name.clone(), bytes, at),
            _ => Place::binary(name.clone(), at as u64, format!("/{element}/{index}/{property}")),
        }
    }

    /// In a text, the start of the first word after `at`.
    pub(super) fn start(self, bytes: &[u8], at: usize) -> usize {
        match self {
            Self::Text => at + bytes[at..].iter().take_while(|b| b.is_ascii_whitespace()).count(),
            _ => at,
        }
    }
}

/// The types of numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Number {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Number {
    pub(super) const NAMES: [(&'static str, Self); 16] = [
        ("char", Self::I8),
        ("uchar", Self::U8),
        ("short", Self::I16),
        ("ushort", Self::U16),
        ("int", Self::I32),
        ("uint", Self::U32),
        ("float", Self::F32),
        ("double", Self::F64),
        ("int8", Self::I8),
        ("uint8", Self::U8),
        ("int16", Self::I16),
        ("uint16", Self::U16),
        ("int32", Self::I32),
        ("uint32", Self::U32),
        ("float32", Self::F32),
        ("float64", Self::F64),
    ];

    pub(super) fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    pub(super) fn is_float(self) -> bool {
        matches!(self, Self::F32 | Self::F64)
    }

    /// The integer that represents 1 in normalised colours.
    pub(super) fn one(self) -> f64 {
        match self {
            Self::I8 => 127.0,
            Self::U8 => 255.0,
            Self::I16 => 32767.0,
            Self::U16 => 65535.0,
            Self::I32 => 2_147_483_647.0,
            Self::U32 => 4_294_967_295.0,
            Self::F32 | Self::F64 => 1.0,
        }
    }
}

#[derive(Clone, Debug)]
pub(super) struct Property {
    pub(super) name: String,
    /// The type of a list's length.
    pub(super) list: Option<Number>,
    pub(super) number: Number,
}

#[derive(Clone, Debug)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
    /// The place of the count in the header.
    pub(super) place: Place,
}

impl Element {
    /// The size of an element in bytes; with lists, a lower bound.
    pub(super) fn least_bytes(&self, encoding: Encoding) -> u64 {
        match encoding {
            // A digit and a space for each.
            Encoding::Text => 2 * self.properties.len() as u64,
            _ => self.properties.iter().map(|p| p.list.unwrap_or(p.number).bytes() as u64).sum(),
        }
    }

    pub(super) fn has_lists(&self) -> bool {
        self.properties.iter().any(|p| p.list.is_some())
    }
}

pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    /// The image that a comment names.
    pub(super) texture: Option<String>,
    /// The offset of the data.
    pub(super) end: usize,
}

impl Header {
    pub(super) fn read(
        bytes: &[u8],
        name: &Arc<str>,
        diagnostics: &mut Diagnostics,
    ) -> Result<Self, FormatError> {
        const LONGEST: usize = 1 << 20;
        let places = TextPlaces::default();
        let place = |at: usize| places.place(name.clone(), bytes, at);
        let mut encoding = None;
        let mut texture = None;
        let mut elements: Vec<Element> = vec![];
        let mut names: HashSet<String> = HashSet::new();
        let mut at = if bytes.starts_with(b"\xEF\xBB\xBF") { 3 } else { 0 };
        let mut first = true;
        loop {
            let start = at;
            let rest = &bytes[start..bytes.len().min(LONGEST)];
            let Some(length) = rest.iter().position(|&b| b == b'\n' || b == b'\r') else {
                let message = if first { "not a PLY file" } else { "PLY header without end_header" };
                let wrong = Diagnostic::error(message).at(place(start)).found(quoted_bytes(rest));
                return Err(wrong.expected(if first { "a line \"ply\"" } else { "a line" }).into());
            };
            let crlf = rest[length] == b'\r' && rest.get(length + 1) == Some(&b'\n');
            at = start + length + if crlf { 2 } else { 1 };
            let line = String::from_utf8_lossy(&rest[..length]);
            let words: Vec<&str> = line.split_ascii_whitespace().collect();
            // The column of a word, for errors.
            let of =
                |word: &str| place(start + (word.as_ptr() as usize).saturating_sub(line.as_ptr() as usize));
            let wrong = |word: &str, what: &str| Diagnostic::error(what).at(of(word)).found(quoted(word));
            let whole = |what: &str| Diagnostic::error(what).at(place(start)).found(quoted(line.trim()));
            if first {
                if words[..] != ["ply"] {
                    return Err(whole("not a PLY file").expected("a line \"ply\"").into());
                }
                first = false;
                continue;
            }
            match words[..] {
                // As MeshLab and others write; the name may have spaces.
                ["comment", "TextureFile", name, ..] if texture.is_none() => {
                    let at = (name.as_ptr() as usize).saturating_sub(line.as_ptr() as usize);
                    texture = line.get(at..).map(|name| name.trim_end().to_owned());
                }
                ["comment", "TextureFile", name, ..] => {
                    diagnostics
                        .warn("a PLY file names several textures: the first is that of all faces", |said| {
                            said.at(of(name)).found(quoted(name))
                        });
                }
                [] | ["comment" | "obj_info", ..] => {}
                ["format", kind, version] => {
                    encoding = Some(match kind {
                        "ascii" => Encoding::Text,
                        "binary_little_endian" => Encoding::Little,
                        "binary_big_endian" => Encoding::Big,
                        _ => {
                            let known = "ascii, binary_little_endian or binary_big_endian";
                            return Err(wrong(kind, "unknown PLY format").expected(known).into());
                        }
                    });
                    if version != "1.0" {
                        return Err(wrong(version, "unknown PLY version").expected("1.0").into());
                    }
                }
                ["element", element, count] => {
                    let parsed = count.parse::<u64>();
                    let Ok(parsed) = parsed else {
                        return Err(wrong(count, "wrong count of elements")
                            .expected("a whole number")
                            .into());
                    };
                    if !names.insert(element.to_owned()) {
                        return Err(wrong(element, "second element of this name").into());
                    }
                    let place = of(count);
                    elements.push(Element {
                        name: element.to_owned(),
                        count: parsed,
                        properties: vec![],
                        place,
                    });
                }
                ["property", ref definition @ ..] => {
                    let number = |word: &str| {
                        let known = Number::NAMES.iter().find(|(n, _)| *n == word).map(|&(_, number)| number);
                        known.ok_or_else(|| {
                            let names = Number::NAMES.iter().map(|(n, _)| *n);
                            FormatError::from(wrong(word, "unknown type of number").suggest(word, names))
                        })
                    };
                    let (list, kind, property) = match *definition {
                        ["list", length, kind, property] => (Some(number(length)?), number(kind)?, property),
                        [kind, property] => (None, number(kind)?, property),
                        _ => return Err(whole("wrong property").expected("property TYPE NAME").into()),
                    };
                    let Some(element) = elements.last_mut() else {
                        return Err(whole("property before any element").into());
                    };
                    if list.is_some_and(Number::is_float) {
                        let expected = "a type of whole numbers";
                        return Err(wrong(definition[1], "a list's length is not whole")
                            .expected(expected)
                            .into());
                    }
                    element.properties.push(Property { name: property.to_owned(), list, number: kind });
                }
                ["end_header"] => break,
                ["element", ..] => return Err(whole("wrong element").expected("element NAME COUNT").into()),
                ["format", ..] => {
                    let expected =
                        "format ascii 1.0, or binary_little_endian or binary_big_endian in place of ascii";
                    return Err(whole("wrong format").expected(expected).into());
                }
                [keyword, ..] => {
                    let known = ["format", "element", "property", "comment", "obj_info", "end_header"];
                    let wrong = wrong(keyword, "unknown line in PLY header").suggest(keyword, known);
                    if wrong.suggestion.is_some() {
                        return Err(wrong.into());
                    }
                    // A comment without its keyword, as an old exporter of Blender writes.
                    diagnostics.push(Diagnostic { severity: Severity::Warning, ..wrong });
                }
            }
        }
        let encoding =
            encoding.ok_or_else(|| Diagnostic::error("PLY header without a format line").at(place(0)))?;
        Ok(Self { encoding, elements, texture, end: at })
    }
}
