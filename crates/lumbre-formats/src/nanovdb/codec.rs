//! Packed grids: streams of zlib, and frames of Blosc with LZ4.
//!
//! Blosc 1 frames after F. Alted and others, "Blosc chunk format", version 2 of the format.

use std::io::Read;

use flate2::read::ZlibDecoder;

use crate::bytes::Bytes;
use crate::diagnostic::FormatError;

/// How a grid is packed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Codec {
    /// Not at all.
    None,
    /// A length and one stream of zlib.
    Zip,
    /// Lengths and frames of Blosc.
    Blosc,
}

impl Codec {
    pub(super) fn of(number: u16) -> Option<Self> {
        [Self::None, Self::Zip, Self::Blosc].get(usize::from(number)).copied()
    }
}

/// The `size` bytes of a packed grid. The caller has charged them.
pub(super) fn unpack(data: Bytes<'_>, codec: Codec, size: u64) -> Result<Vec<u8>, FormatError> {
    let mut out = Vec::new();
    let size = usize::try_from(size).ok().filter(|&size| out.try_reserve_exact(size).is_ok());
    let Some(size) = size else {
        return Err(data.fault(0, "a grid that is too large for this machine").into());
    };
    match codec {
        Codec::None => out.extend_from_slice(data.all()),
        Codec::Zip => {
            let packed = chunk(data, 0)?;
            // One byte more shows a stream that is too long.
            let read = ZlibDecoder::new(packed.all()).take(size as u64 + 1).read_to_end(&mut out);
            read.map_err(|error| packed.fault(0, format!("a damaged zlib stream: {error}")))?;
        }
        Codec::Blosc => {
            let mut at = 0;
            while out.len() < size {
                let frame = chunk(data, at)?;
                at += 8 + frame.len();
                frame_into(frame, &mut out, size)?;
            }
        }
    }
    if out.len() == size {
        return Ok(out);
    }
    Err(data
        .fault(0, "a packed grid of another size")
        .found(out.len())
        .expected(format!("{size} bytes"))
        .into())
}

/// The bytes after a length.
fn chunk(data: Bytes<'_>, at: u64) -> Result<Bytes<'_>, FormatError> {
    let length = data.u64(at, "packed grid")?;
    data.slice(at + 8..(at + 8).saturating_add(length))
}

const SHUFFLED: u8 = 1;
const STORED: u8 = 2;
const BITS_SHUFFLED: u8 = 4;
const NOT_SPLIT: u8 = 16;
const LZ4: u8 = 1;

/// Appends what a frame of Blosc holds, which must not make `out` longer than `most`.
fn frame_into(frame: Bytes<'_>, out: &mut Vec<u8>, most: usize) -> Result<(), FormatError> {
    let [_, _, flags, type_size] = frame.array::<4>(0, "Blosc frame")?;
    let size = frame.u32(4, "Blosc frame")? as usize;
    let block_size = frame.u32(8, "Blosc frame")? as usize;
    let packed = u64::from(frame.u32(12, "Blosc frame")?);
    if size == 0 || size > most - out.len() {
        let wrong = frame.fault(4, "a Blosc frame of the wrong size").found(size);
        return Err(wrong.expected(format!("1 to {} bytes", most - out.len())).into());
    }
    if packed > frame.len() {
        let wrong = frame.fault(12, "a Blosc frame that ends early").found(format!("{} bytes", frame.len()));
        return Err(wrong.expected(format!("{packed} bytes")).into());
    }
    if flags & STORED != 0 {
        out.extend_from_slice(frame.part(16..16 + size as u64, "Blosc frame")?);
        return Ok(());
    }
    if flags >> 5 != LZ4 || flags & BITS_SHUFFLED != 0 {
        let wrong =
            frame.fault(2, "a Blosc frame that is packed in another way").found(format!("flags {flags}"));
        return Err(wrong.expected("LZ4, with or without a shuffle of bytes").into());
    }
    let type_size = usize::from(type_size);
    if type_size == 0 || block_size == 0 || block_size > size {
        return Err(frame.fault(3, "a Blosc frame of no element or block size that can be").into());
    }
    let blocks = size.div_ceil(block_size);
    let shuffles = flags & SHUFFLED != 0 && type_size > 1;
    let mut shuffled = vec![0; if shuffles { block_size } else { 0 }];
    for block in 0..blocks {
        let length = block_size.min(size - block * block_size);
        let splits = flags & NOT_SPLIT == 0 && type_size <= 16 && block_size / type_size >= 128;
        let streams = if splits && length == block_size { type_size } else { 1 };
        if !length.is_multiple_of(streams) {
            return Err(frame.fault(8, "a Blosc frame whose blocks are not of whole elements").into());
        }
        let start = out.len();
        out.resize(start + length, 0);
        let mut at = u64::from(frame.u32(16 + 4 * block as u64, "Blosc frame")?);
        let target = if shuffles { &mut shuffled[..length] } else { &mut out[start..] };
        for stream in target.chunks_exact_mut(length / streams) {
            let stored = u64::from(frame.u32(at, "Blosc block")?);
            let bytes = frame.part(at + 4..(at + 4).saturating_add(stored), "Blosc block")?;
            if bytes.len() == stream.len() {
                stream.copy_from_slice(bytes);
            } else {
                let got = lz4_flex::block::decompress_into(bytes, stream);
                if got.as_ref().ok() != Some(&stream.len()) {
                    return Err(frame.fault(at, "a damaged LZ4 block").into());
                }
            }
            at += 4 + stored;
        }
        if shuffles {
            unshuffle(&shuffled[..length], &mut out[start..], type_size);
        }
    }
    Ok(())
}

/// Puts the bytes of each element side by side; what is left at the end stays.
fn unshuffle(from: &[u8], to: &mut [u8], type_size: usize) {
    let elements = from.len() / type_size;
    for (i, element) in to.chunks_exact_mut(type_size).enumerate() {
        for (byte, value) in element.iter_mut().enumerate() {
            *value = from[byte * elements + i];
        }
    }
    let whole = elements * type_size;
    to[whole..].copy_from_slice(&from[whole..]);
}
