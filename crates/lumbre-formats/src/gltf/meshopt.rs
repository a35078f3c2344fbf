//! Compressed buffer views (`EXT_meshopt_compression`, 2021, and its successor `KHR_meshopt_compression`, a draft of
//! 2025; Khronos. The codecs are those of A. Kapoulkine's meshoptimizer).

use super::expansion::check_expansion;
use super::file::File;
use super::json::{Read, Value};
use crate::diagnostic::{Diagnostic, quoted};

/// The message for invalid compressed data.
type Decoded<T> = Result<T, &'static str>;

/// The bytes of a compressed buffer view; `None` for others.
pub(super) fn unpacked(file: &File<'_>, view: Value<'_>) -> Read<Option<Vec<u8>>> {
    let (value, generation) =
        match (view.extension("EXT_meshopt_compression")?, view.extension("KHR_meshopt_compression")?) {
            (None, None) => return Ok(None),
            (Some(value), None) => (value, Generation::Ext),
            (None, Some(value)) => (value, Generation::Khr),
            (Some(_), Some(value)) => {
                return Err(value.wrong("buffer view that is compressed in two ways").into());
            }
        };
    let stride_value = value.need("byteStride")?;
    let stride = stride_value.whole(1)?;
    let count_value = value.need("count")?;
    let count = count_value.whole(1)?;
    let mode_value = value.need("mode")?;
    let mode = mode_value.string()?;
    let filter = value.string_at("filter")?.unwrap_or("NONE".into());
    let (packed, _, length) = file.buffer_slice(value)?;

    // The largest possible expansion: nothing is allocated for more.
    let (fits_stride, expected, most) = match &*mode {
        "ATTRIBUTES" => (
            stride.is_multiple_of(4) && stride <= 256,
            "a multiple of 4, 256 at most",
            length.saturating_mul(generation.most_bytes_of_one()) / stride,
        ),
        "TRIANGLES" => (stride == 2 || stride == 4, "2 or 4", length.saturating_mul(3)),
        "INDICES" => (stride == 2 || stride == 4, "2 or 4", length),
        other => {
            let wrong = mode_value.wrong("unknown mode of compression").found(quoted(other));
            return Err(wrong.suggest(other, ["ATTRIBUTES", "TRIANGLES", "INDICES"]).into());
        }
    };
    if !fits_stride {
        return Err(stride_value.unexpected("wrong stride", expected));
    }
    if count > most || (mode == "TRIANGLES" && !count.is_multiple_of(3)) {
        let expected = if mode == "TRIANGLES" { "a multiple of 3, " } else { "" };
        let wrong = count_value.wrong("wrong count of compressed elements").found(count);
        return Err(wrong.expected(format!("{expected}{most} or less for {length} bytes")).into());
    }
    let (count, stride) = (count as usize, stride as usize);
    let said = view.need("byteLength")?;
    if said.whole(1)? != (count * stride) as u64 {
        let wrong = said.wrong("compressed buffer view of another length than its elements");
        file.breach(wrong.expected(count * stride))?;
    }
    let Some(packed) = packed else {
        return Err(value.wrong("the buffer of what is needed here has no data").into());
    };
    check_expansion(file, value, "compressed data", length, count as u64 * stride as u64)?;
    let mut bytes = file.budget.vec(count as u64 * stride as u64, "decompressed buffer view")?;
    let decoded = match &*mode {
        "ATTRIBUTES" => attributes(packed, count, stride, generation, &mut bytes),
        "TRIANGLES" => triangles(packed, count, |index| put(&mut bytes, index, stride)),
        _ => indices(packed, count, |index| put(&mut bytes, index, stride)),
    };
    let damaged = |what: &str| -> Diagnostic { value.wrong("damaged compressed data").found(what) };
    decoded.map_err(damaged)?;
    let filtered = match &*filter {
        "NONE" => Ok(()),
        "OCTAHEDRAL" if stride == 4 || stride == 8 => {
            octahedral(&mut bytes, stride);
            Ok(())
        }
        "QUATERNION" if stride == 8 => {
            quaternions(&mut bytes);
            Ok(())
        }
        "EXPONENTIAL" => {
            exponential(&mut bytes);
            Ok(())
        }
        "COLOR" if generation == Generation::Khr && (stride == 4 || stride == 8) => {
            colours(&mut bytes, stride);
            Ok(())
        }
        "OCTAHEDRAL" | "QUATERNION" | "COLOR" => Err("a filter that does not go with the stride"),
        _ => Err("an unknown filter"),
    };
    match filtered {
        Ok(()) if filter == "NONE" || mode == "ATTRIBUTES" => Ok(Some(bytes)),
        Ok(()) => Err(damaged("a filter on indices").into()),
        Err(what) => Err(damaged(what).into()),
    }
}

/// Which extension.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Generation {
    Ext,
    Khr,
}

impl Generation {
    /// The maximal expansion of one compressed byte: 256 elements of 4 bytes without differences take 4 bytes,
    /// or 1 with the control bytes of `Khr`.
    fn most_bytes_of_one(self) -> u64 {
        match self {
            Self::Ext => 64,
            Self::Khr => 1024,
        }
    }
}

fn put(bytes: &mut Vec<u8>, index: u32, stride: usize) {
    bytes.extend(&index.to_le_bytes()[..stride]);
}

const SHORT: &str = "too few bytes";

/// A reader of bytes.
struct Bytes<'b> {
    rest: &'b [u8],
}

impl<'b> Bytes<'b> {
    fn take(&mut self, count: usize) -> Decoded<&'b [u8]> {
        let (taken, rest) = self.rest.split_at_checked(count).ok_or(SHORT)?;
        self.rest = rest;
        Ok(taken)
    }

    fn byte(&mut self) -> Decoded<u8> {
        Ok(self.take(1)?[0])
    }

    /// Seven bits per byte, the lowest first.
    fn variable(&mut self) -> Decoded<u32> {
        let mut value = 0;
        for i in 0..5 {
            let byte = self.byte()?;
            value |= u32::from(byte & 0x7F) << (7 * i);
            if byte < 0x80 {
                break;
            }
        }
        Ok(value)
    }
}

/// 0, -1, 1, -2, … as 0, 1, 2, 3, …
fn unzigzag(value: u32) -> u32 {
    (value >> 1) ^ (value & 1).wrapping_neg()
}

/// Mode 0: blocks of elements, byte by byte of the element, as differences in groups of 16 of a fixed number of
/// bits each.
fn attributes(
    packed: &[u8],
    count: usize,
    stride: usize,
    generation: Generation,
    out: &mut Vec<u8>,
) -> Decoded<()> {
    let is_second = match packed.first() {
        Some(0xA0) => false,
        Some(0xA1) if generation == Generation::Khr => true,
        _ => return Err("a header that is not that of attributes"),
    };
    // The element before the first, and the difference mode of each four bytes, are at the end.
    let channels = if is_second { stride / 4 } else { 0 };
    let tail = (stride + channels).max(if is_second { 24 } else { 32 });
    let mut data = Bytes { rest: packed.get(1..packed.len().saturating_sub(tail)).ok_or(SHORT)? };
    let last = packed.len() - channels;
    let mut before = [0_u8; 256];
    before[..stride].copy_from_slice(&packed[last - stride..last]);
    let mut differences = [Difference::Bytes; 64];
    for (difference, &byte) in differences.iter_mut().zip(&packed[last..]) {
        *difference = Difference::read(byte)?;
    }
    let most = ((8192 / stride) & !15).min(256);
    let mut lanes = [[0_u8; 256]; 4];
    let mut first = 0;
    while first < count {
        let block = most.min(count - first);
        out.resize((first + block) * stride, 0);
        let groups = block.div_ceil(16);
        let controls = data.take(channels)?;
        for (channel, difference) in differences.iter().enumerate().take(stride / 4) {
            for (i, values) in lanes.iter_mut().enumerate() {
                let widths = match controls.get(channel).map(|control| control >> (2 * i) & 3) {
                    None => [0, 2, 4, 8],
                    Some(0) => [0, 1, 2, 4],
                    Some(1) => [1, 2, 4, 8],
                    Some(2) => {
                        values[..block].fill(0);
                        continue;
                    }
                    Some(_) => {
                        values[..block].copy_from_slice(data.take(block)?);
                        continue;
                    }
                };
                let header = data.take(groups.div_ceil(4))?;
                for (group, values) in values.as_chunks_mut::<16>().0.iter_mut().take(groups).enumerate() {
                    let width = widths[usize::from(header[group / 4] >> (2 * (group % 4)) & 3)];
                    group_of_16(&mut data, width, values)?;
                }
            }
            let lane = 4 * channel;
            let mut value: [u8; 4] = [before[lane], before[lane + 1], before[lane + 2], before[lane + 3]];
            let elements = out[first * stride..].chunks_exact_mut(stride);
            for (i, element) in elements.enumerate().take(block) {
                value = difference.add(value, lanes.map(|values| values[i]));
                element[lane..lane + 4].copy_from_slice(&value);
            }
            before[lane..lane + 4].copy_from_slice(&value);
        }
        first += block;
    }
    if data.rest.is_empty() { Ok(()) } else { Err("too many bytes") }
}

/// How four bytes of an element differ from those of the one before.
#[derive(Clone, Copy, Debug)]
enum Difference {
    /// Byte by byte.
    Bytes,
    /// As two 16-bit integers.
    Shorts,
    /// By the exclusive-or of the bits, rotated left by this much.
    Bits(u32),
}

impl Difference {
    fn read(byte: u8) -> Decoded<Self> {
        match (byte & 15, byte >> 4) {
            (0, 0) => Ok(Self::Bytes),
            (1, 0) => Ok(Self::Shorts),
            (2, rotation) => Ok(Self::Bits(u32::from(rotation))),
            _ => Err("an unknown kind of differences"),
        }
    }

    fn add(self, before: [u8; 4], delta: [u8; 4]) -> [u8; 4] {
        match self {
            Self::Bytes => std::array::from_fn(|i| {
                before[i].wrapping_add((delta[i] >> 1) ^ (delta[i] & 1).wrapping_neg())
            }),
            Self::Shorts => {
                let half = |i: usize| {
                    let short = |b: [u8; 4]| u16::from_le_bytes([b[i], b[i + 1]]);
                    let delta = short(delta);
                    short(before).wrapping_add((delta >> 1) ^ (delta & 1).wrapping_neg()).to_le_bytes()
                };
                let ([a, b], [c, d]) = (half(0), half(2));
                [a, b, c, d]
            }
            Self::Bits(rotation) => {
                let bits = u32::from_le_bytes(delta).rotate_right(rotation);
                (u32::from_le_bytes(before) ^ bits).to_le_bytes()
            }
        }
    }
}

/// Sixteen numbers of 0, 1, 2, 4 or 8 bits; the largest of 1, 2 and 4 bits marks a number in a byte that
/// follows.
fn group_of_16(data: &mut Bytes<'_>, bits: usize, values: &mut [u8; 16]) -> Decoded<()> {
    if bits == 0 {
        *values = [0; 16];
        return Ok(());
    }
    let packed = data.take(2 * bits)?;
    if bits == 8 {
        values.copy_from_slice(packed);
        return Ok(());
    }
    let sentinel = (1 << bits) - 1;
    for (i, value) in values.iter_mut().enumerate() {
        let byte = packed[i * bits / 8];
        // The first is in the highest bits; of single bits, in the lowest.
        let shift = if bits == 1 { i % 8 } else { 8 - bits - i * bits % 8 };
        let number = byte >> shift & sentinel;
        *value = if number == sentinel { data.byte()? } else { number };
    }
    Ok(())
}

/// The last sixteen of something.
struct Recent<T> {
    entries: [T; 16],
    next: usize,
}

impl<T: Copy> Recent<T> {
    fn push(&mut self, entry: T) {
        self.entries[self.next & 15] = entry;
        self.next = self.next.wrapping_add(1);
    }

    /// 1 is the most recent.
    fn back(&self, steps: usize) -> T {
        self.entries[self.next.wrapping_sub(steps) & 15]
    }
}

/// Mode 1: triangles by a recent edge and a recent vertex, or by new vertices.
fn triangles(packed: &[u8], count: usize, mut put: impl FnMut(u32)) -> Decoded<()> {
    let (&header, rest) = packed.split_first().ok_or(SHORT)?;
    if header != 0xE1 {
        return Err("a header that is not that of triangles");
    }
    let (codes, rest) = rest.split_at_checked(count / 3).ok_or(SHORT)?;
    let (data, table) = rest.split_at_checked(rest.len().checked_sub(16).ok_or(SHORT)?).ok_or(SHORT)?;
    let mut data = Bytes { rest: data };
    let mut edges = Recent { entries: [(u32::MAX, u32::MAX); 16], next: 0 };
    let mut vertices = Recent { entries: [u32::MAX; 16], next: 0 };
    let (mut next, mut last) = (0_u32, 0_u32);
    for &code in codes {
        let low = usize::from(code & 15);
        let [a, b, c] = if code < 0xF0 {
            let (a, b) = edges.back(1 + usize::from(code >> 4));
            let c = match low {
                0 => fresh(&mut next),
                1..13 => vertices.back(1 + low),
                _ => {
                    last = match low {
                        13 => last.wrapping_sub(1),
                        14 => last.wrapping_add(1),
                        _ => last.wrapping_add(unzigzag(data.variable()?)),
                    };
                    last
                }
            };
            if low == 0 || low >= 13 {
                vertices.push(c);
            }
            edges.push((c, b));
            edges.push((a, c));
            [a, b, c]
        } else {
            let (by_table, explicit) = (code < 0xFE, code == 0xFF);
            let pair = if by_table { table[low] } else { data.byte()? };
            if !by_table && pair == 0 {
                next = 0;
            }
            let (high, low) = (usize::from(pair >> 4), usize::from(pair & 15));
            // The sources of the other two vertices; 15 is in the data, although not in the table.
            let mut a = if explicit { 0 } else { fresh(&mut next) };
            let mut b = if high == 0 { fresh(&mut next) } else { vertices.back(high) };
            let mut c = if low == 0 { fresh(&mut next) } else { vertices.back(low) };
            for (vertex, is_explicit) in
                [(&mut a, explicit), (&mut b, !by_table && high == 15), (&mut c, !by_table && low == 15)]
            {
                if is_explicit {
                    last = last.wrapping_add(unzigzag(data.variable()?));
                    *vertex = last;
                }
            }
            vertices.push(a);
            if high == 0 || (!by_table && high == 15) {
                vertices.push(b);
            }
            if low == 0 || (!by_table && low == 15) {
                vertices.push(c);
            }
            edges.push((b, a));
            edges.push((c, b));
            edges.push((a, c));
            [a, b, c]
        };
        put(a);
        put(b);
        put(c);
    }
    if data.rest.is_empty() { Ok(()) } else { Err("too many bytes") }
}

fn fresh(next: &mut u32) -> u32 {
    let vertex = *next;
    *next = next.wrapping_add(1);
    vertex
}

/// Mode 2: indices as differences from one of the two before.
fn indices(packed: &[u8], count: usize, mut put: impl FnMut(u32)) -> Decoded<()> {
    let mut data = Bytes { rest: packed.get(..packed.len().saturating_sub(4)).ok_or(SHORT)? };
    if data.byte()? != 0xD1 {
        return Err("a header that is not that of indices");
    }
    let mut last = [0_u32; 2];
    for _ in 0..count {
        let value = data.variable()?;
        let which = &mut last[(value & 1) as usize];
        *which = which.wrapping_add(unzigzag(value >> 1));
        put(*which);
    }
    if data.rest.is_empty() { Ok(()) } else { Err("too many bytes") }
}

/// Unit vectors from x and y on the octahedron, where z is the scale of 1.
///
/// Cigolle and others, "A Survey of Efficient Representations for Independent Unit Vectors", JCGT 2014.
fn octahedral(bytes: &mut [u8], stride: usize) {
    let half = stride / 2;
    for element in bytes.chunks_exact_mut(stride) {
        let at = |i: usize| match stride {
            4 => f32::from(element[i] as i8),
            _ => f32::from(i16::from_le_bytes([element[2 * i], element[2 * i + 1]])),
        };
        let (x, y) = (at(0), at(1));
        let z = at(2) - x.abs() - y.abs();
        let fold = z.min(0.0);
        let x = x + if x >= 0.0 { fold } else { -fold };
        let y = y + if y >= 0.0 { fold } else { -fold };
        let one = if stride == 4 { 127.0 } else { 32767.0 };
        let scale = one / (x * x + y * y + z * z).sqrt();
        for (i, v) in [x, y, z].into_iter().enumerate() {
            let rounded = rounded(v * scale);
            if half == 2 {
                element[i] = rounded as i8 as u8;
            } else {
                element[2 * i..2 * i + 2].copy_from_slice(&rounded.to_le_bytes());
            }
        }
    }
}

/// Unit quaternions without their largest component, whose index is in the two lowest bits of the fourth
/// number.
fn quaternions(bytes: &mut [u8]) {
    for element in bytes.chunks_exact_mut(8) {
        let at = |i: usize| i16::from_le_bytes([element[2 * i], element[2 * i + 1]]);
        let largest = (at(3) & 3) as usize;
        let scale = std::f32::consts::FRAC_1_SQRT_2 / f32::from(at(3) | 3);
        let [x, y, z] = [0, 1, 2].map(|i| f32::from(at(i)) * scale);
        let w = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
        for (i, v) in [w, x, y, z].into_iter().enumerate() {
            let to = 2 * ((largest + i) & 3);
            element[to..to + 2].copy_from_slice(&rounded(v * 32767.0).to_le_bytes());
        }
    }
}

fn rounded(v: f32) -> i16 {
    (v + if v >= 0.0 { 0.5 } else { -0.5 }) as i16
}

/// Floats from a 24-bit integer and an 8-bit exponent.
fn exponential(bytes: &mut [u8]) {
    for element in bytes.chunks_exact_mut(4) {
        let bits = i32::from_le_bytes([element[0], element[1], element[2], element[3]]);
        let value = ((bits << 8) >> 8) as f64 * f64::powi(2.0, bits >> 24);
        element.copy_from_slice(&(value as f32).to_le_bytes());
    }
}

/// Colours from luma, orange against blue, and green against purple (H. S. Malvar, G. J. Sullivan, "YCoCg-R: A
/// Color Space with RGB Reversibility and Low Dynamic Range", 2003), with the number of bits in the fourth
/// number.
fn colours(bytes: &mut [u8], stride: usize) {
    for element in bytes.chunks_exact_mut(stride) {
        let raw = |i: usize| match stride {
            4 => u16::from(element[i]),
            _ => u16::from_le_bytes([element[2 * i], element[2 * i + 1]]),
        };
        let signed = |i: usize| match stride {
            4 => i32::from(element[i] as i8),
            _ => i32::from(raw(i) as i16),
        };
        let coverage = i32::from(raw(3));
        // All bits up to the highest; a fourth number of 0 is invalid and makes black.
        let scale = if coverage == 0 { 1 } else { (2 << coverage.ilog2()) - 1 };
        let (y, co, cg) = (i32::from(raw(0)), signed(1), signed(2));
        let a = coverage & (scale >> 1);
        let full = if stride == 4 { 255.0 } else { 65535.0 };
        for (i, v) in [y + co - cg, y + cg, y - co - cg, a << 1 | a & 1].into_iter().enumerate() {
            let shown = (v as f32 * (full / scale as f32) + 0.5).min(full) as u16;
            match stride {
                4 => element[i] = shown as u8,
                _ => element[2 * i..2 * i + 2].copy_from_slice(&shown.to_le_bytes()),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bytes(hex: &str) -> Vec<u8> {
        let digit = |c: u8| char::from(c).to_digit(16).unwrap() as u8;
        hex.as_bytes().chunks(2).map(|pair| digit(pair[0]) * 16 + digit(pair[1])).collect()
    }

    fn words(bytes: &[u8]) -> Vec<u32> {
        bytes.chunks(4).map(|w| u32::from_le_bytes(w.try_into().unwrap())).collect()
    }

    // What meshoptimizer 0.22 made of our own numbers; 1000 larger ones agreed too when this was written.
    const ATTRIBUTES: &str = "a00700434bbbc13996a3f48fcb77c45ee55dff000000512656900700d51a25ed3f6054b8f99c8ae2a23962ff0000006c\
        fdeedd070058a709eee29bf3e9a8102e56dea045ff00000059e72f94070022d5f97509ae9e3502b5e67a947352ff00000040d9f63207007437122c\
        aadc6a6d8023e4c9ae77e8ff000000501d20fc07008b7c9aac54e1705b911d607e9bbe7eff000000c2f1224f0700cc1e4365d19bf361e7b8eb23ab\
        2515ff000000764c589307008a0189bbbcbad4072c44d7439ae1b6ff00000005968d2e00000000000000000000000000000000000000000000000\
        037828554d61ba612";
    const ATTRIBUTES_RAW: &str = "37828554d61ba6121517b16510d50c57ef245dfaf4131b569111587dfd60f911309acf4213b6c6b3137a403d68e05d115\
        eaaf294d66f0f6e0cd478e30ba795d8863003c8d47964d43eb357c91430f0ead8015f6e02214c0c9c4676e17451d6a0feb7a11e0f90c47e2d081068\
        66426ecbbaeb602e2aa15b5a8b1c3d579ee050b562521077c6418bb275d39c0ab7c8b1fda04a8485c7d9ddb6e8dbce9e45b193cd";
    const TRIANGLES: &str = "e1fe1e100e4e1e120e0f06007687566778a9866589689801690000";
    const INDICES: &str = "d100040800060c0a040800060c06040800060c0a040800060c00000000";

    // What meshoptimizer 1.0 made of `second_raw`.
    const SECOND: &str = "a13a9a373900040c141c242c343c2215545c5407747c46b988dba46c8f86899073a7e295c4577fda3d675f0027433f372f22\
        0f0b07030004080c10213038404428ff60683ed98058c396e151000044010140100101400001aa020ffff888888888881010\
        1010888888888888888888888444444444444444444444444444444444000000000000666666662066666666206666666620\
        6666666620666666662066666666206666666620666666662066666666206666666620666666662066666666206666666620\
        6666666655012aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa0000000faeee2d6cabeb2a69a8e82766a5e52463a2e22160afef2\
        e6dacec2b6aa9e92867a6e62564a3e32261a0e020915212d3945515d6975818d99a5b1bdc9d5e1edf905111d29350a021555\
        5555555000001550000055012aabaaae0b0baabaaaea0b0babaaaeaa0b0bbaaaeaab0b0b0baaa00000004a4a4a4a4a4a4a4a\
        4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a\
        4a4a4a4a4a4a4a4a4a4a4a54010100020100020100020100020000000000008041000060400000409c00c8000001010100";

    /// Seventy elements of two floats, two shorts and four bytes.
    fn second_raw() -> Vec<u8> {
        let element = |i: u32| {
            let mut out = vec![];
            out.extend((16.0 + (i * i % 97) as f32 * 0.25).to_le_bytes());
            out.extend((3.5 + i as f32 * 0.125).to_le_bytes());
            out.extend(((i * 300 + 7 * (i % 5)) as u16).to_le_bytes());
            out.extend(((40_000 + i * 256 - i * i * 3) as u16).to_le_bytes());
            out.extend([i % 7, 200, i * 37, i / 16].map(|b| b as u8));
            out
        };
        (0..70).flat_map(element).collect()
    }

    #[test]
    fn attributes_of_the_second_version_come_back_to_the_byte() {
        let mut out = vec![];
        attributes(&bytes(SECOND), 70, 16, Generation::Khr, &mut out).unwrap();
        assert_eq!(out, second_raw());
        // The older extension does not know them.
        assert!(attributes(&bytes(SECOND), 70, 16, Generation::Ext, &mut vec![]).is_err());
    }

    #[test]
    fn differences_by_bits_are_turned_back() {
        // By hand: three elements of four bytes, each lane literal, differences turned by 4 bits to the left.
        let (start, deltas) = (0x1234_5678_u32, [0x0000_00F1_u32, 0x8000_0001, 0x1020_3040]);
        let mut packed = vec![0xA1, 0xFF];
        for lane in 0..4 {
            packed.extend(deltas.map(|d| d.to_le_bytes()[lane]));
        }
        packed.extend([0; 19]);
        packed.extend(start.to_le_bytes());
        packed.push(0x42);
        let mut out = vec![];
        attributes(&packed, 3, 4, Generation::Khr, &mut out).unwrap();
        let first = start ^ 0x1000_000F;
        let second = first ^ 0x1800_0000;
        assert_eq!(words(&out), [first, second, second ^ 0x0102_0304]);
        for wrong in [0x03, 0x10, 0x11, 0x0F] {
            *packed.last_mut().unwrap() = wrong;
            assert!(attributes(&packed, 3, 4, Generation::Khr, &mut vec![]).is_err(), "{wrong}");
        }
    }

    #[test]
    fn colours_come_out_of_brightness_and_differences() {
        // Red, green and blue of 6 bits: y = (r + 2 g + b) / 4 and so on, worked by hand for (40, 24, 8) and a = 21
        // of 31.
        let (y, co, cg) = (24_u8, 16_i8, 0_i8);
        let mut four = [y, co as u8, cg as u8, 32 | 21];
        colours(&mut four, 4);
        let up = |v: f64| (v * 255.0 / 63.0).round() as u8;
        assert_eq!(four, [up(40.0), up(24.0), up(8.0), up(43.0)]);
        let mut eight: Vec<u8> =
            [24_u16, 16, (-4_i16) as u16, 32 | 20].iter().flat_map(|v| v.to_le_bytes()).collect();
        colours(&mut eight, 8);
        let up = |v: f64| (v * 65535.0 / 63.0).round() as u16;
        let found: Vec<u16> = eight.as_chunks::<2>().0.iter().map(|b| u16::from_le_bytes(*b)).collect();
        assert_eq!(found, [up(44.0), up(20.0), up(12.0), up(40.0)]);
        // What is not valid makes some colour.
        colours(&mut [255, 127, 128, 0], 4);
    }

    #[test]
    fn attributes_come_back_to_the_byte() {
        let mut out = vec![];
        attributes(&bytes(ATTRIBUTES), 20, 8, Generation::Ext, &mut out).unwrap();
        assert_eq!(out, bytes(ATTRIBUTES_RAW));
    }

    #[test]
    fn triangles_and_indices_come_back() {
        let mut out = vec![];
        triangles(&bytes(TRIANGLES), 24, |index| out.push(index)).unwrap();
        assert_eq!(out, [0, 1, 3, 3, 1, 4, 4, 1, 2, 4, 2, 5, 3, 4, 6, 6, 4, 7, 7, 4, 5, 7, 5, 8]);
        out.clear();
        indices(&bytes(INDICES), 24, |index| out.push(index)).unwrap();
        assert_eq!(out, [0, 1, 3, 3, 1, 4, 1, 2, 4, 4, 2, 5, 3, 4, 6, 6, 4, 7, 4, 5, 7, 7, 5, 8]);
    }

    #[test]
    fn filters_give_what_the_reference_gives() {
        let mut normals = bytes("88be7f2305497f3449907fb124307f50");
        octahedral(&mut normals, 4);
        assert_eq!(normals, bytes("a5f6a8230769473418aba5b13e534a50"));
        let mut normals = bytes("f7017803ff0727f1b4fc3903ff070c22");
        octahedral(&mut normals, 8);
        assert_eq!(normals, bytes("1135af5d364527f1d5a835550a270c22"));
        let mut turns = bytes("d1069903cffbfe077b00c2049ffffc07");
        quaternions(&mut turns);
        assert_eq!(turns, bytes("b9288fd0c150274de9737005da35b6fb"));
        let mut floats = bytes("4e2e00fb412e00ffda2b00ff");
        exponential(&mut floats);
        assert_eq!(words(&floats), words(&bytes("0038b9430004b9450068af45")));
    }

    #[test]
    fn damaged_data_are_refused_and_never_panic() {
        for (packed, count, stride) in
            [(ATTRIBUTES, 20, 8), (SECOND, 70, 16), (TRIANGLES, 24, 4), (INDICES, 24, 4)]
        {
            let whole = bytes(packed);
            let decode = |data: &[u8]| match data.first() {
                Some(0xA0 | 0xA1) => attributes(data, count, stride, Generation::Khr, &mut vec![]),
                Some(0xE1) => triangles(data, count, |_| {}),
                _ => indices(data, count, |_| {}),
            };
            decode(&whole).unwrap();
            for cut in 0..whole.len() {
                assert!(decode(&whole[..cut]).is_err(), "{cut}");
            }
            for at in 0..whole.len() {
                for bit in 0..8 {
                    let mut damaged = whole.clone();
                    damaged[at] ^= 1 << bit;
                    let _ = decode(&damaged);
                }
            }
        }
    }
}
