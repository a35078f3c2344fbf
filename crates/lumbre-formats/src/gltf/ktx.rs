//! Textures in KTX 2.0 with Basis Universal inside (`KHR_texture_basisu`, Khronos, 2021).

use std::sync::Arc;

use basisu::{DecodeFlags, TargetFormat, Transcoder};
use lumbre_image::{Bitmap, Channels, Encoding, PixelData};

use super::file::File;
use super::json::Read;
use crate::FormatError;
use crate::contained::contained;
use crate::diagnostic::{Diagnostic, Place};
use crate::image::check_expansion;

/// The first bytes of a KTX 2.0 file.
pub(super) const MAGIC: &[u8] = b"\xABKTX 20\xBB\r\n\x1A\n";

/// The size of the header, with the description of the first level.
const HEADER: usize = 104;
const ZSTANDARD: u32 = 2;
const BASIS_LZ: u32 = 1;

/// The header's data.
struct Header {
    width: u32,
    height: u32,
    scheme: u32,
    /// The offset of the first level.
    offset: u64,
    /// The length of the first level, compressed and uncompressed.
    packed: u64,
    unpacked: u64,
}

/// The first level of a texture; `name` is the prefix of messages about its bytes.
pub(super) fn read(file: &File<'_>, bytes: &[u8], name: &Arc<str>) -> Read<Bitmap> {
    let header = header(bytes, name)?;
    let blocks = u64::from(header.width.div_ceil(4)) * u64::from(header.height.div_ceil(4));
    let pixels = 4 * 16 * blocks;
    // Blocks of 16 bytes each, unless they use codebooks.
    if header.scheme != BASIS_LZ && header.unpacked != 16 * blocks {
        let wrong = wrong(name, 96, "first level of another size than its blocks").found(header.unpacked);
        return Err(wrong.expected(16 * blocks).into());
    }
    let place = Place::whole(name.clone());
    check_expansion(bytes, pixels, &place, file.budget)?;
    if header.scheme == ZSTANDARD {
        let level = &bytes[header.offset as usize..][..header.packed as usize];
        let most = zstandard_size(level);
        if most.is_none_or(|[least, _]| least > header.unpacked) {
            let found =
                most.map_or("no frame of Zstandard".to_owned(), |[least, _]| format!("{least} bytes"));
            let wrong = wrong(name, header.offset, "first level of another size than it says").found(found);
            return Err(wrong.expected(header.unpacked).into());
        }
        check_expansion(bytes, most.map_or(0, |[_, most]| most), &place, file.budget)?;
    }
    file.budget.bytes(pixels, "texture")?;
    let hold = file.budget.hold(pixels, "texture")?;
    let (data, has_alpha) = contained("KTX 2.0 texture", &place, || {
        let failed = |error: basisu::Error| {
            let wrong = Diagnostic::error("KTX 2.0 texture that cannot be read").at(place.clone());
            FormatError::from(wrong.found(in_words(&error)))
        };
        let texture = Transcoder::new(bytes).map_err(failed)?;
        let data = texture.transcode(0, TargetFormat::Rgba32, DecodeFlags::NONE).map_err(failed)?;
        Ok((data, texture.has_alpha()))
    })?;
    drop(hold);
    let (channels, data) = if has_alpha {
        (Channels::Rgba, data)
    } else {
        (Channels::Rgb, data.as_chunks::<4>().0.iter().flat_map(|[r, g, b, _]| [*r, *g, *b]).collect())
    };
    Bitmap::new(header.width, header.height, channels, PixelData::U8(data), Encoding::Srgb)
        .ok_or_else(|| wrong(name, 20, "texture with another number of pixels than its size").into())
}

fn wrong(name: &Arc<str>, at: u64, message: &str) -> Diagnostic {
    Diagnostic::error(message).at(Place::binary(name.clone(), at, ""))
}

/// Checks what the decoder relies on.
fn header(bytes: &[u8], name: &Arc<str>) -> Read<Header> {
    if bytes.len() < HEADER {
        let wrong = wrong(name, bytes.len() as u64, "KTX 2.0 texture is truncated in its header");
        return Err(wrong.found(format!("{} bytes", bytes.len())).into());
    }
    let word = |at: usize| u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
    let long = |at: usize| u64::from(word(at)) | u64::from(word(at + 4)) << 32;
    let (width, height) = (word(20), word(24));
    let checks = [
        (word(12) == 0, 12, "texture that is not in Basis Universal", "format 0"),
        (0 < width && width <= 65_536, 20, "wrong width of a texture", "1 to 65536"),
        (0 < height && height <= 65_536, 24, "wrong height of a texture", "1 to 65536"),
        (word(28) == 0, 28, "texture that is not flat", "a depth of 0"),
        (word(32) <= 1, 32, "texture of several layers", "0 or 1"),
        (word(36) == 1, 36, "texture of several faces", "1"),
        (word(44) <= ZSTANDARD, 44, "unknown compression of a texture", "0, 1 or 2"),
    ];
    for (is_fine, at, message, expected) in checks {
        if !is_fine {
            return Err(wrong(name, at as u64, message).found(word(at)).expected(expected).into());
        }
    }
    let (offset, packed, unpacked) = (long(80), long(88), long(96));
    if offset.checked_add(packed).is_none_or(|end| end > bytes.len() as u64) {
        let wrong = wrong(name, 80, "first level past the end of its texture");
        return Err(wrong.found(format!("{packed} bytes from byte {offset}")).into());
    }
    Ok(Header { width, height, scheme: word(44), offset, packed, unpacked })
}

/// The least and the greatest number of bytes that data in Zstandard (RFC 8878) can unpack to, by the headers of
/// their blocks; `None` where there is no frame.
fn zstandard_size(data: &[u8]) -> Option<[u64; 2]> {
    const BLOCK: u64 = 128 << 10;
    let descriptor = *data.strip_prefix(b"\x28\xB5\x2F\xFD")?.first()?;
    let is_single = descriptor & 0x20 != 0;
    let content = [usize::from(is_single), 2, 4, 8][usize::from(descriptor >> 6)];
    let dictionary = [0, 1, 2, 4][usize::from(descriptor & 3)];
    let mut at = 5 + usize::from(!is_single) + dictionary;
    let mut declared = [0; 8];
    declared[..content].copy_from_slice(data.get(at..at + content)?);
    let declared = u64::from_le_bytes(declared) + if content == 2 { 256 } else { 0 };
    at += content;
    let [mut least, mut most] = [0u64; 2];
    while let Some(&[a, b, c]) = data.get(at..).and_then(<[u8]>::first_chunk) {
        let header = u32::from_le_bytes([a, b, c, 0]);
        let size = u64::from(header >> 3);
        let (taken, sizes) = match header >> 1 & 3 {
            0 => (size, [size, size]),
            1 => (1, [size, size]),
            _ => (size, [0, BLOCK]),
        };
        least += sizes[0];
        most += sizes[1];
        at = at.saturating_add(3 + taken as usize);
        if header & 1 != 0 {
            break;
        }
    }
    Some([least.max(declared), most.max(declared)])
}

/// What a decoder found.
fn in_words(error: &basisu::Error) -> String {
    match error {
        basisu::Error::InvalidData => "data that is not of Basis Universal".to_owned(),
        basisu::Error::Truncated => "truncated data".to_owned(),
        basisu::Error::Unsupported { .. } => "a kind of texture that is not decoded to colours".to_owned(),
        basisu::Error::UnsupportedFeature(what) => format!("what is not supported: {what}"),
        basisu::Error::VideoRequiresState => "a video".to_owned(),
        basisu::Error::InvalidImageOrLevel => "no first level".to_owned(),
        basisu::Error::OutputTooSmall { needed } => format!("{needed} bytes of pixels"),
        basisu::Error::ZstdRequired => "levels compressed by Zstandard".to_owned(),
        // Of later versions of the decoder.
        _ => "what the decoder does not read".to_owned(),
    }
}
