//! The mark in image files that Lumbre writes, by which it knows them again.

use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use super::ImageFormat;
use crate::input::open_regular;

/// The name of the program in the files that it writes.
pub(super) const SOFTWARE: &str = "Lumbre";

/// Where a mark has to stand, from the beginning of a file.
const NEAR: u64 = 64 << 10;

/// The tag Software (CIPA DC-008, "Exif", 4.6.5) with [`SOFTWARE`], as a directory of its own.
pub(super) const EXIF: &[u8] = b"II*\0\x08\0\0\0\x01\0\x31\x01\x02\0\x07\0\0\0\x1A\0\0\0\0\0\0\0Lumbre\0";

/// Whether the file `path` is an image that Lumbre wrote, by its metadata: the text `Software` of a PNG, the attribute
/// `software` of an EXR, the line `SOFTWARE` of an HDR, the tag Software of a JPEG or a WebP. A PFM has no place for
/// such, so that none is known to be ours; and so for what cannot be read.
pub fn is_own_image(path: &Path) -> bool {
    let Ok((mut file, length)) = open_regular(path) else { return false };
    let mut start = Vec::new();
    if Read::by_ref(&mut file).take(NEAR).read_to_end(&mut start).is_err() {
        return false;
    }
    if ImageFormat::from_bytes(&start) != Some(ImageFormat::WebP) {
        return has_mark(&start);
    }
    // Its metadata come last.
    let mark = webp_mark();
    let mut end = Vec::new();
    let from = length.saturating_sub(mark.len() as u64);
    file.seek(SeekFrom::Start(from)).and_then(|_| file.read_to_end(&mut end)).is_ok() && end == mark
}

/// The chunk EXIF of a WebP, whose length is odd.
fn webp_mark() -> Vec<u8> {
    [b"EXIF", &(EXIF.len() as u32).to_le_bytes()[..], EXIF, b"\0"].concat()
}

fn has_mark(start: &[u8]) -> bool {
    match ImageFormat::from_bytes(start) {
        Some(ImageFormat::Png) => png_has_mark(start),
        Some(ImageFormat::Exr) => {
            let mut mark = b"software\0string\0\x06\0\0\0".to_vec();
            mark.extend(SOFTWARE.bytes());
            start.windows(mark.len()).any(|here| here == mark)
        }
        Some(ImageFormat::Hdr) => {
            let mut lines = start.split(|&b| b == b'\n').take_while(|line| !line.is_empty());
            lines.any(|line| line.strip_prefix(b"SOFTWARE=") == Some(SOFTWARE.as_bytes()))
        }
        Some(ImageFormat::Jpeg) => {
            let mut mark = b"Exif\0\0".to_vec();
            mark.extend(EXIF);
            start.windows(mark.len()).any(|here| here == mark)
        }
        _ => false,
    }
}

/// Whether one of the chunks before the pixels has the mark.
fn png_has_mark(start: &[u8]) -> bool {
    let mut rest = start.get(8..).unwrap_or_default();
    while let Some((head, body)) = rest.split_at_checked(8) {
        let (length, kind) = (u32::from_be_bytes([head[0], head[1], head[2], head[3]]), &head[4..]);
        let Some((data, after)) = body.split_at_checked(length as usize) else { return false };
        let words = data.strip_prefix(b"Software\0").unwrap_or_default();
        if kind == b"tEXt" && words == SOFTWARE.as_bytes() {
            return true;
        }
        // After its checksum.
        rest = after.get(4..).unwrap_or_default();
        if kind == b"IDAT" {
            return false;
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use std::fs;

    use lumbre_image::{Image, Rgb};

    use super::*;
    use crate::image::{WriteOptions, write_image};

    #[test]
    fn own_images_are_known_by_their_metadata_and_no_others_are() {
        let folder = tempfile::tempdir().unwrap();
        let image = Image::filled(5, 3, Rgb::new(0.1, 0.2, 0.3));
        for (name, known) in [
            ("a.png", true),
            ("a.exr", true),
            ("a.hdr", true),
            ("a.jpg", true),
            ("a.webp", true),
            ("a.pfm", false),
        ] {
            let path = folder.path().join(name);
            write_image(&path, &image, &WriteOptions::default()).unwrap();
            assert_eq!(is_own_image(&path), known, "{name}");
            // Another program's name of the same length is not ours.
            let foreign: Vec<u8> = String::from_utf8_lossy(b"Lombre").bytes().collect();
            let mut bytes = fs::read(&path).unwrap();
            while let Some(at) = bytes.windows(6).position(|here| here == SOFTWARE.as_bytes()) {
                bytes[at..at + 6].copy_from_slice(&foreign);
            }
            fs::write(&path, &bytes).unwrap();
            assert!(!is_own_image(&path), "{name}");
            fs::write(&path, &bytes[..bytes.len().min(20)]).unwrap();
            assert!(!is_own_image(&path), "{name}");
        }
        assert!(!is_own_image(folder.path()));
        assert!(!is_own_image(&folder.path().join("absent.png")));
    }
}
