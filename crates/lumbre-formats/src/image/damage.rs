//! Where an image file is damaged, as its decoder does not say.

use std::cell::Cell;
use std::io::{BufRead, Cursor, Read, Result, Seek, SeekFrom};

use flate2::Crc;

use super::ImageFormat;

/// The first byte of what is damaged in a file that its decoder refused after it had read up to `read`: of a chunk of
/// PNG or WebP or a segment of JPEG that is cut off or not one, or else of the pixels; of other formats, `read`.
pub(super) fn first_damage(format: ImageFormat, bytes: &[u8], read: u64) -> u64 {
    match format {
        ImageFormat::Png => png(bytes),
        ImageFormat::Jpeg => jpeg(bytes),
        ImageFormat::WebP => webp(bytes),
        _ => None,
    }
    .map_or(read.min(bytes.len() as u64), |at| at as u64)
}

/// Where the size of an image stands in its file, if that is always the same place.
pub(super) fn place_of_size(format: ImageFormat) -> Option<u64> {
    match format {
        ImageFormat::Png => Some(16),
        ImageFormat::Bmp => Some(18),
        ImageFormat::Tga => Some(12),
        ImageFormat::Qoi => Some(4),
        _ => None,
    }
}

fn png(bytes: &[u8]) -> Option<usize> {
    let mut at = 8;
    let mut first_pixels = None;
    loop {
        let Some([a, b, c, d]) = bytes.get(at..).and_then(<[u8]>::first_chunk) else { return Some(at) };
        let length = u32::from_be_bytes([*a, *b, *c, *d]) as usize;
        // The checksum is over the type, too.
        let Some(covered) = bytes.get(at + 4..).and_then(|rest| rest.get(..length.checked_add(4)?)) else {
            return Some(at);
        };
        let sum = bytes.get(at + 8 + length..).and_then(<[u8]>::first_chunk);
        let mut crc = Crc::new();
        crc.update(covered);
        if sum.map(|sum| u32::from_be_bytes(*sum)) != Some(crc.sum()) {
            return Some(at);
        }
        match &covered[..4] {
            b"IDAT" => first_pixels = first_pixels.or(Some(at)),
            b"IEND" => return first_pixels,
            _ => {}
        }
        at += 12 + length;
    }
}

fn jpeg(bytes: &[u8]) -> Option<usize> {
    let mut at = 2;
    let mut first_pixels = None;
    loop {
        let start = at;
        // Any number of 0xFF may stand before a marker.
        while bytes.get(at) == Some(&0xFF) {
            at += 1;
        }
        let Some(&marker) = bytes.get(at).filter(|_| start < at) else { return Some(start) };
        at += 1;
        match marker {
            0xD9 => return first_pixels,
            0x01 | 0xD0..=0xD7 => continue,
            _ => {}
        }
        let length =
            bytes.get(at..).and_then(<[u8]>::first_chunk).map(|b| usize::from(u16::from_be_bytes(*b)));
        match length {
            Some(length) if 2 <= length && at + length <= bytes.len() => at += length,
            _ => return Some(start),
        }
        if marker == 0xDA {
            first_pixels = first_pixels.or(Some(start));
            // A marker ends the pixels; 0xFF00 is a byte of theirs, and markers to restart stand among them.
            let is_end = |pair: &[u8]| pair[0] == 0xFF && !matches!(pair[1], 0 | 0xD0..=0xD7 | 0xFF);
            match bytes[at..].windows(2).position(is_end) {
                Some(end) => at += end,
                None => return Some(bytes.len()),
            }
        }
    }
}

fn webp(bytes: &[u8]) -> Option<usize> {
    let mut at = 12;
    let mut first_pixels = None;
    while at < bytes.len() {
        let header = bytes.get(at..).and_then(<[u8]>::first_chunk);
        let Some([k0, k1, k2, k3, a, b, c, d]) = header else { return Some(at) };
        let length = u32::from_le_bytes([*a, *b, *c, *d]) as usize;
        if bytes.len() - (at + 8) < length {
            return Some(at);
        }
        if matches!(&[*k0, *k1, *k2, *k3], b"VP8 " | b"VP8L" | b"ANMF") {
            first_pixels = first_pixels.or(Some(at));
        }
        // Chunks are padded to even sizes.
        at += 8 + length + length % 2;
    }
    first_pixels.or(Some(bytes.len()))
}

/// Bytes that remember how far they were read.
#[derive(Debug)]
pub(super) struct Tracked<'a> {
    bytes: Cursor<&'a [u8]>,
    at: &'a Cell<u64>,
}

impl<'a> Tracked<'a> {
    pub(super) fn new(bytes: &'a [u8], at: &'a Cell<u64>) -> Self {
        Self { bytes: Cursor::new(bytes), at }
    }
}

impl Read for Tracked<'_> {
    fn read(&mut self, out: &mut [u8]) -> Result<usize> {
        let read = self.bytes.read(out);
        self.at.set(self.bytes.position());
        read
    }
}

impl BufRead for Tracked<'_> {
    fn fill_buf(&mut self) -> Result<&[u8]> {
        self.bytes.fill_buf()
    }

    fn consume(&mut self, count: usize) {
        self.bytes.consume(count);
        self.at.set(self.bytes.position());
    }
}

impl Seek for Tracked<'_> {
    fn seek(&mut self, to: SeekFrom) -> Result<u64> {
        let at = self.bytes.seek(to);
        self.at.set(self.bytes.position());
        at
    }
}

#[cfg(test)]
mod tests {
    use lumbre_image::{Image, Rgb};

    use super::super::{WriteOptions, encode_image};
    use super::*;

    fn file(format: ImageFormat) -> Vec<u8> {
        let pixels = (0..24 * 18).map(|i| Rgb::splat((i % 7) as f32 / 7.0)).collect();
        encode_image(&Image::from_pixels(24, 18, pixels).unwrap(), format, &WriteOptions::default()).unwrap()
    }

    fn find(bytes: &[u8], what: &[u8]) -> usize {
        bytes.windows(what.len()).position(|w| w == what).unwrap()
    }

    fn refused(bytes: &[u8], name: &str) -> String {
        let (budget, mut diagnostics) = (crate::Budget::default(), crate::Diagnostics::new());
        super::super::read_image(bytes, &name.into(), &budget, &mut diagnostics).unwrap_err().to_string()
    }

    #[test]
    fn a_damaged_chunk_of_png_is_told_by_its_first_byte() {
        let whole = file(ImageFormat::Png);
        let pixels = find(&whole, b"IDAT") - 4;
        assert_eq!(first_damage(ImageFormat::Png, &whole, 0), pixels as u64);
        let mut wrong = whole.clone();
        wrong[pixels + 12] ^= 0x40;
        assert!(refused(&wrong, "a.png").starts_with(&format!("a.png:byte {pixels}: damaged PNG image")));
        for cut in [pixels + 3, pixels + 9, whole.len() - 14] {
            let said = refused(&whole[..cut], "a.png");
            assert!(said.starts_with(&format!("a.png:byte {pixels}: ")), "{said}");
        }
    }

    #[test]
    fn a_damaged_segment_of_jpeg_is_told_by_its_first_byte() {
        let whole = file(ImageFormat::Jpeg);
        let scan = find(&whole, &[0xFF, 0xDA]);
        assert_eq!(first_damage(ImageFormat::Jpeg, &whole, 0), scan as u64);
        let tables = find(&whole, &[0xFF, 0xDB]);
        let mut wrong = whole.clone();
        wrong[tables] = 0;
        assert_eq!(first_damage(ImageFormat::Jpeg, &wrong, 0), tables as u64);
        assert_eq!(first_damage(ImageFormat::Jpeg, &whole[..tables + 5], 0), tables as u64);
        let said = refused(&whole[..tables + 5], "a.jpg");
        assert!(said.starts_with(&format!("a.jpg:byte {tables}: damaged JPEG image")), "{said}");
    }

    /// A file of a kind that we do not write.
    fn foreign(format: image::ImageFormat) -> Vec<u8> {
        let mut bytes = Cursor::new(vec![]);
        let pixels = (0..24 * 18 * 3).map(|i| (i * i % 251) as u8).collect();
        image::RgbImage::from_raw(24, 18, pixels).unwrap().write_to(&mut bytes, format).unwrap();
        bytes.into_inner()
    }

    #[test]
    fn damage_of_images_is_reported_with_its_byte() {
        let (tga, bmp, webp) = (
            foreign(image::ImageFormat::Tga),
            foreign(image::ImageFormat::Bmp),
            foreign(image::ImageFormat::WebP),
        );
        let qoi = file(ImageFormat::Qoi);
        let changed = |whole: &[u8], at: usize, bytes: &[u8]| {
            let mut wrong = whole.to_vec();
            wrong[at..at + bytes.len()].copy_from_slice(bytes);
            wrong
        };
        let pixels = find(&webp, b"VP8L");
        let cases = [
            // Cut off: where the data end; the chunk that is cut off.
            ("a.tga", tga[..200].to_vec(), 200),
            ("a.tga", tga[..9].to_vec(), 9),
            ("a.bmp", bmp[..300].to_vec(), 300),
            ("a.bmp", bmp[..20].to_vec(), 20),
            ("a.qoi", qoi[..60].to_vec(), 60),
            ("a.webp", webp[..webp.len() - 50].to_vec(), pixels),
            ("a.webp", webp[..15].to_vec(), 12),
            // Damaged: the pixels of a chunk; the sizes.
            ("a.webp", changed(&webp, pixels + 8, b"no image"), pixels),
            ("a.tga", changed(&tga, 12, &[0xff; 4]), 12),
            ("a.bmp", changed(&bmp, 18, &[0x60, 0xEA, 0, 0]), 18),
            ("a.qoi", changed(&qoi, 4, &[0, 0, 7, 0xD0, 0, 0, 7, 0xD0]), 4),
        ];
        for (name, bytes, at) in cases {
            let said = refused(&bytes, name);
            assert!(said.starts_with(&format!("{name}:byte {at}: ")), "{at}: {said}");
        }
    }

    #[test]
    fn reading_exr_stops_at_a_byte() {
        let whole = file(ImageFormat::Exr);
        for cut in [60, whole.len() - 40] {
            let said = refused(&whole[..cut], "a.exr");
            let at: usize =
                said.strip_prefix("a.exr:byte ").unwrap().split(':').next().unwrap().parse().unwrap();
            assert!(0 < at && at <= cut, "{said}");
        }
    }
}
