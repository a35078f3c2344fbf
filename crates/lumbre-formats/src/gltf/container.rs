//! GLB: the JSON and the first buffer of a glTF in one file.

use std::sync::Arc;

use super::json::Read;
use crate::diagnostic::{Diagnostic, Diagnostics, Place, quoted_bytes};

/// The parts of a GLB file.
#[derive(Clone, Copy, Debug)]
pub(super) struct Glb<'a> {
    /// The bytes of the JSON.
    pub json: &'a [u8],
    /// Their offset.
    pub json_start: u64,
    /// The bytes of the first buffer, with up to three bytes of padding.
    pub binary: Option<&'a [u8]>,
}

pub(super) const MAGIC: &[u8; 4] = b"glTF";
const JSON: [u8; 4] = *b"JSON";
const BINARY: [u8; 4] = *b"BIN\0";

/// Splits a GLB file into its parts.
///
/// # Errors
/// With the byte at which the container is invalid.
pub(super) fn read<'a>(bytes: &'a [u8], name: &Arc<str>, diagnostics: &mut Diagnostics) -> Read<Glb<'a>> {
    let place = |at: usize| Place::binary(name.clone(), at as u64, "");
    let wrong = |at: usize, message: &str| Diagnostic::error(message).at(place(at));
    let word = |at: usize| {
        let word = bytes.get(at..at + 4)?.try_into().ok()?;
        Some(u32::from_le_bytes(word))
    };
    let (Some(version), Some(length)) = (word(4), word(8)) else {
        let found = format!("{} bytes", bytes.len());
        return Err(wrong(0, "file is truncated in its header")
            .found(found)
            .expected("12 bytes or more")
            .into());
    };
    if version != 2 {
        return Err(wrong(4, "unknown version of GLB").found(version).expected("2").into());
    }
    let length = length as usize;
    if length < 12 {
        return Err(wrong(8, "wrong length in the header of the GLB file")
            .found(length)
            .expected("12 or more")
            .into());
    }
    if length > bytes.len() {
        let sizes =
            format!("its header says {length} bytes, the file has {}; copy or export it again", bytes.len());
        return Err(wrong(8, "file is truncated").because(sizes).into());
    }
    if length < bytes.len() {
        let found = format!("{} bytes", bytes.len() - length);
        diagnostics
            .push(Diagnostic::warning("data after the end of the GLB file").at(place(length)).found(found));
    }

    let bytes = &bytes[..length];
    let mut json = None;
    let mut binary = None;
    let mut at = 12;
    while at < length {
        let (Some(size), Some(kind)) = (word(at), bytes.get(at + 4..at + 8)) else {
            let found = format!("{} bytes", length - at);
            return Err(wrong(at, "GLB chunk without a header").found(found).expected("8 bytes").into());
        };
        let size = size as usize;
        if !size.is_multiple_of(4) {
            let warning = Diagnostic::warning("GLB chunk of a length that is no multiple of 4").at(place(at));
            diagnostics.push(warning.found(size));
        }
        let Some(data) = bytes.get(at + 8..).and_then(|rest| rest.get(..size)) else {
            let left = length - at - 8;
            return Err(wrong(at, "GLB chunk longer than the file")
                .found(size)
                .expected(format!("{left} or less"))
                .into());
        };
        if json.is_none() {
            if *kind != JSON {
                let found = quoted_bytes(kind);
                return Err(wrong(at + 4, "GLB file does not begin with JSON")
                    .found(found)
                    .expected("\"JSON\"")
                    .into());
            }
            json = Some((data, at as u64 + 8));
        } else if *kind == JSON || (*kind == BINARY && binary.is_some()) {
            return Err(wrong(at + 4, "second GLB chunk of one kind").found(quoted_bytes(kind)).into());
        } else if *kind == BINARY {
            let end = |(data, start): (&[u8], u64)| start + data.len() as u64;
            let follows_json = json.is_some_and(|json| at as u64 - end(json) < 4);
            if !follows_json {
                return Err(wrong(at + 4, "GLB binary chunk out of place")
                    .expected("it right after the JSON")
                    .into());
            }
            binary = Some(data);
        } else {
            let warning = Diagnostic::warning("unknown GLB chunk is left out").at(place(at + 4));
            diagnostics.push(warning.found(quoted_bytes(kind)));
        }
        // A length that was not rounded up may leave out the padding, or only its bytes.
        let end = at + 8 + size;
        let padded = end.next_multiple_of(4);
        let begins_chunk =
            |at: usize| matches!(bytes.get(at + 4..at + 8), Some(kind) if *kind == BINARY || *kind == JSON);
        at = if end != padded && !begins_chunk(end) && (begins_chunk(padded) || length <= padded) {
            padded
        } else {
            end
        };
    }
    let Some((json, json_start)) = json else {
        return Err(wrong(12, "GLB file without JSON").into());
    };
    Ok(Glb { json, json_start, binary })
}
