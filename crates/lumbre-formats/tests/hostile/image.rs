//! Any bytes are a picture or an error; the first byte chooses the ending of the name.
use lumbre_formats::image::{read_image, read_layers};
use lumbre_formats::{Budget, Diagnostics, Limits};

const ENDINGS: [&str; 9] = ["png", "jpg", "exr", "hdr", "pfm", "tga", "bmp", "qoi", "webp"];

pub(crate) fn run(bytes: &[u8]) {
    let [choice, bytes @ ..] = bytes else { return };
    let name = format!("fuzz.{}", ENDINGS[usize::from(*choice) % ENDINGS.len()]).into();
    let mut limits = Limits::default();
    limits.memory = 64 << 20;
    let mut diagnostics = Diagnostics::new();
    if let Ok(file) = read_image(bytes, &name, &Budget::new(limits), &mut diagnostics) {
        let _ = file.to_image(&Budget::new(limits));
    }
    let _ = read_layers(bytes, &name, &Budget::new(limits), &mut diagnostics);
}
