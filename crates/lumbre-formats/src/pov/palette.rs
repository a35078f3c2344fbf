//! Images with a palette, by the indices of their pixels: GIF, and PNG of that kind.

use std::io::Cursor;

use gif::{ColorOutput, DecodeOptions};
use png::{ColorType, Decoder, Transformations};

use crate::budget::Budget;
use crate::{FormatError, Input};

/// Colours by a palette.
pub(super) struct Indexed {
    pub width: u32,
    pub height: u32,
    /// Row by row, the first at the top.
    pub indices: Vec<u8>,
    /// The colours of the indices as a screen shows them.
    pub palette: Vec<[u8; 3]>,
}

impl Indexed {
    /// The image of a file; `None` if it has no palette, or cannot be read.
    pub(super) fn read(bytes: &Input, budget: &Budget) -> Result<Option<Self>, FormatError> {
        let image =
            if bytes.starts_with(b"GIF8") { from_gif(bytes, budget)? } else { from_png(bytes, budget)? };
        // Files may end early, and need not name all colours.
        Ok(image.filter(|image| image.indices.len() == (image.width as usize) * (image.height as usize)))
    }

    /// The colour of a pixel as a screen shows it.
    pub(super) fn colour(&self, pixel: usize) -> [u8; 3] {
        self.palette.get(usize::from(self.indices[pixel])).copied().unwrap_or_default()
    }
}

fn in_threes(bytes: &[u8]) -> Vec<[u8; 3]> {
    bytes.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect()
}

/// The first image of a GIF file.
fn from_gif(bytes: &[u8], budget: &Budget) -> Result<Option<Indexed>, FormatError> {
    let mut options = DecodeOptions::new();
    options.set_color_output(ColorOutput::Indexed);
    // A frame is no larger than the image.
    options.check_frame_consistency(true);
    let Ok(mut decoder) = options.read_info(Cursor::new(bytes)) else { return Ok(None) };
    let shared = decoder.global_palette().map(<[u8]>::to_vec);
    let size = [u32::from(decoder.width()), u32::from(decoder.height())];
    budget.expansion(bytes.len() as u64, u64::from(size[0]) * u64::from(size[1]), "image")?;
    let mut indices = budget.vec(u64::from(size[0]) * u64::from(size[1]), "indices of an image")?;
    let Ok(Some(frame)) = decoder.read_next_frame() else { return Ok(None) };
    if [u32::from(frame.width), u32::from(frame.height)] != size {
        return Ok(None);
    }
    indices.extend_from_slice(&frame.buffer);
    let palette = frame.palette.clone().or(shared).unwrap_or_default();
    Ok(Some(Indexed { width: size[0], height: size[1], indices, palette: in_threes(&palette) }))
}

fn from_png(bytes: &[u8], budget: &Budget) -> Result<Option<Indexed>, FormatError> {
    let mut decoder = Decoder::new(Cursor::new(bytes));
    decoder.set_transformations(Transformations::IDENTITY);
    let Ok(mut reader) = decoder.read_info() else { return Ok(None) };
    let info = reader.info();
    if info.color_type != ColorType::Indexed {
        return Ok(None);
    }
    let (width, height, bits) = (info.width, info.height, info.bit_depth as usize);
    let palette = info.palette.as_deref().map(in_threes).unwrap_or_default();
    let count = u64::from(width) * u64::from(height);
    budget.expansion(bytes.len() as u64, count, "image")?;
    let Some(size) = reader.output_buffer_size() else { return Ok(None) };
    let mut rows = budget.vec(size as u64, "rows of an image")?;
    rows.resize(size, 0_u8);
    let Ok(frame) = reader.next_frame(&mut rows) else { return Ok(None) };
    let mut indices = budget.vec(count, "indices of an image")?;
    for row in rows.chunks_exact(frame.line_size).take(height as usize) {
        // Several pixels share a byte, the first in its high bits.
        indices.extend((0..width as usize).map(|x| {
            let first = x * bits;
            (row[first / 8] >> (8 - bits - first % 8)) & (0xFF_u8 >> (8 - bits))
        }));
    }
    Ok(Some(Indexed { width, height, indices, palette }))
}
