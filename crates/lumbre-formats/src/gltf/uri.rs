//! URIs of buffers and images: data URIs and file names.

use std::path::PathBuf;

/// The target of a URI.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Target<'a> {
    /// Data in the URI itself.
    Data(DataUri<'a>),
    /// A file, relative to the one that names it.
    File(PathBuf),
    /// An unsupported scheme.
    Scheme(&'a str),
    /// A malformed data URI.
    Malformed,
}

/// `data:MEDIA TYPE;base64,…`
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct DataUri<'a> {
    /// The media type without its parameters.
    pub media_type: &'a str,
    /// Base64 or else percent-encoded.
    pub is_base64: bool,
    /// The encoded data.
    pub data: &'a str,
}

/// Parses a URI. File names are percent-decoded once, and not expanded otherwise.
pub(super) fn target(uri: &str) -> Target<'_> {
    if let Some(rest) = strip_prefix_ignoring_case(uri, "data:") {
        let Some((head, data)) = rest.split_once(',') else { return Target::Malformed };
        let (media_type, parameters) = head.split_once(';').map_or((head, None), |(m, p)| (m, Some(p)));
        let mut is_base64 = false;
        for parameter in parameters.iter().flat_map(|p| p.split(';')) {
            if parameter.is_empty() {
                return Target::Malformed;
            }
            is_base64 |= parameter.eq_ignore_ascii_case("base64");
        }
        return Target::Data(DataUri { media_type, is_base64, data });
    }
    if let Some((scheme, rest)) = uri.split_once(':') {
        let is_scheme = scheme.len() > 1
            && scheme.starts_with(|c: char| c.is_ascii_alphabetic())
            && scheme.bytes().all(|b| b.is_ascii_alphanumeric() || matches!(b, b'+' | b'-' | b'.'));
        if is_scheme && scheme.eq_ignore_ascii_case("file") {
            let path = rest.strip_prefix("//").unwrap_or(rest);
            // file:///C:/folder/name
            let path = path.strip_prefix('/').filter(|path| cfg!(windows) && has_drive(path)).unwrap_or(path);
            return Target::File(percent_decoded(path).into());
        }
        if is_scheme {
            return Target::Scheme(scheme);
        }
    }
    Target::File(percent_decoded(uri).into())
}

/// Whether a path begins with the letter of a drive.
fn has_drive(path: &str) -> bool {
    matches!(path.as_bytes(), [letter, b':', ..] if letter.is_ascii_alphabetic())
}

fn strip_prefix_ignoring_case<'a>(text: &'a str, prefix: &str) -> Option<&'a str> {
    let head = text.get(..prefix.len())?;
    head.eq_ignore_ascii_case(prefix).then(|| &text[prefix.len()..])
}

/// `%41` as `A`; text that does not decode to UTF-8 is left unchanged.
pub(super) fn percent_decoded(text: &str) -> String {
    let bytes = percent_decoded_bytes(text);
    String::from_utf8(bytes).unwrap_or_else(|_| text.to_owned())
}

/// `%41` as `A`.
pub(super) fn percent_decoded_bytes(text: &str) -> Vec<u8> {
    let bytes = text.as_bytes();
    let mut decoded = Vec::with_capacity(bytes.len());
    let mut at = 0;
    while at < bytes.len() {
        let digit = |i: usize| bytes.get(at + i).and_then(|&b| char::from(b).to_digit(16));
        match (bytes[at], digit(1), digit(2)) {
            (b'%', Some(high), Some(low)) => {
                decoded.push((high * 16 + low) as u8);
                at += 3;
            }
            (byte, ..) => {
                decoded.push(byte);
                at += 1;
            }
        }
    }
    decoded
}

/// Decodes base64 (RFC 4648), with or without padding; or returns the position of the first wrong character.
pub(super) fn base64_decoded(text: &str) -> Result<Vec<u8>, usize> {
    let digits = text.trim_end_matches('=');
    let mut decoded = Vec::with_capacity(digits.len() / 4 * 3 + 2);
    let mut bits: u32 = 0;
    let mut count = 0;
    for (at, byte) in digits.bytes().enumerate() {
        let value = match byte {
            b'A'..=b'Z' => byte - b'A',
            b'a'..=b'z' => byte - b'a' + 26,
            b'0'..=b'9' => byte - b'0' + 52,
            b'+' | b'-' => 62,
            b'/' | b'_' => 63,
            _ => return Err(at),
        };
        bits = bits << 6 | u32::from(value);
        count += 6;
        if count >= 8 {
            count -= 8;
            decoded.push((bits >> count) as u8);
        }
    }
    if count >= 6 { Err(digits.len()) } else { Ok(decoded) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uris_lead_to_data_files_and_elsewhere() {
        let file = |path: &str| Target::File(path.into());
        assert_eq!(target("a%20b%C3%A9%2525.bin"), file("a bé%25.bin"));
        assert_eq!(target("../été/ü.png"), file("../été/ü.png"));
        assert_eq!(target("100%.bin"), file("100%.bin"));
        assert_eq!(target("%ff.bin"), file("%ff.bin"));
        assert_eq!(target("C:/a.bin"), file("C:/a.bin"));
        assert_eq!(target("file:///a/b.bin"), file("/a/b.bin"));
        let of_drive = if cfg!(windows) { "C:/a/b.bin" } else { "/C:/a/b.bin" };
        assert_eq!(target("file:///C:/a/b.bin"), file(of_drive));
        assert_eq!(target("https://example.org/a.bin"), Target::Scheme("https"));
        let data = DataUri { media_type: "image/png", is_base64: true, data: "AAEC" };
        assert_eq!(target("data:image/png;charset=utf-8;base64,AAEC"), Target::Data(data));
        let plain = DataUri { media_type: "", is_base64: false, data: "a%00b" };
        assert_eq!(target("DATA:,a%00b"), Target::Data(plain));
        for malformed in ["data:", "data:image/png;base64", "data:image/png;;base64,AAEC"] {
            assert_eq!(target(malformed), Target::Malformed, "{malformed}");
        }
    }

    #[test]
    fn base64_decodes_with_and_without_padding() {
        let cases: [(&str, &[u8]); 7] = [
            ("", b""),
            ("Zg==", b"f"),
            ("Zg", b"f"),
            ("Zm8=", b"fo"),
            ("Zm9v", b"foo"),
            ("Zm9vYmFy", b"foobar"),
            ("_-8=", &[0xFF, 0xEF]),
        ];
        for (text, expected) in cases {
            assert_eq!(base64_decoded(text).unwrap(), expected, "{text}");
        }
        assert_eq!(base64_decoded("Zm9v!mFy"), Err(4));
        assert_eq!(base64_decoded("Zm9vY"), Err(5));
    }
}
