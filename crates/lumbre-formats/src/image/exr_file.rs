//! OpenEXR, by the `exr` crate after checks of ours.

use std::cell::Cell;
use std::io::Cursor;
use std::sync::Arc;

use exr::meta::MetaData;
use exr::meta::attribute::{AttributeValue, Chromaticities, IntegerBounds, SampleType, Text};
use exr::meta::header::{Header, ImageAttributes, LayerAttributes};
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding as ExrEncoding, FlatSamples, Image as ExrImage, Layer as ExrLayer,
    Vec2, f16,
};
use exr::prelude::{ReadChannels, ReadLayers, WritableImage};
use lumbre_image::{Bitmap, Channels, ColourSpace, Encoding, Layer, Layers, PixelData, Window, f32_to_half};

use super::damage::Tracked;
use super::write::{ExrCompression, ExrPrecision, WriteOptions};
use super::{ImageFile, ImageFormat, check_expansion, origin};
use crate::budget::{Budget, Hold};
use crate::contained::contained;
use crate::diagnostic::{Diagnostic, Diagnostics, FormatError, Place, in_one_line, quoted};

pub(super) fn read(
    bytes: &[u8],
    name: &Arc<str>,
    budget: &Budget,
    diagnostics: &mut Diagnostics,
) -> Result<ImageFile, FormatError> {
    let place = Place::whole(name.clone());
    let (headers, _decoded) = checked_headers(bytes, &place, budget)?;
    let at = Cell::new(0);
    let mut picture = contained("EXR image", &place, || {
        exr::prelude::read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .first_valid_layer()
            .all_attributes()
            .from_buffered(Tracked::new(bytes, &at))
            .map_err(|e| fault(&place, &at, e))
    })?;
    if headers.len() > 1 {
        let said = Diagnostic::warning("only the first part of an EXR image is used").at(place.clone());
        diagnostics.push(said.found(format!("{} parts", headers.len())));
    }
    let layer = &mut picture.layer_data;
    let names: Vec<String> = layer.channel_data.list.iter().map(|c| c.name.to_string()).collect();
    let (chosen, said) = choose(&names).ok_or_else(|| {
        let list: Vec<_> = names.iter().take(12).map(|n| quoted(n)).collect();
        let wrong = Diagnostic::error("EXR image without colours").at(place.clone());
        wrong.found(format!("channels {}", list.join(", "))).expected("R, G, B or Y")
    })?;
    if let Some(said) = said {
        diagnostics
            .push(Diagnostic::warning("EXR image without plain colours").at(place.clone()).found(said));
    }
    let channels = Channels::from_count(chosen.len()).expect("one to four");
    let Vec2(width, height) = layer.size;
    let count = width * height;
    let wrong_count = chosen.iter().any(|&c| layer.channel_data.list[c].sample_data.len() != count);
    let (Ok(w), Ok(h), false) = (u32::try_from(width), u32::try_from(height), wrong_count) else {
        return Err(Diagnostic::error("damaged EXR image: a channel has the wrong size").at(place).into());
    };
    let planes: Vec<&FlatSamples> = chosen.iter().map(|&c| &layer.channel_data.list[c].sample_data).collect();
    let all_half = planes.iter().all(|plane| matches!(plane, FlatSamples::F16(_)));
    let data = if all_half {
        let mut data: Vec<u16> = budget.vec((count * planes.len()) as u64, "image")?;
        data.resize(count * planes.len(), 0);
        for (c, plane) in planes.iter().enumerate() {
            let FlatSamples::F16(plane) = plane else { continue };
            for (into, v) in data[c..].iter_mut().step_by(planes.len()).zip(plane) {
                *into = v.to_bits();
            }
        }
        PixelData::F16(data)
    } else {
        let mut data: Vec<f32> = budget.vec((count * planes.len()) as u64, "image")?;
        data.resize(count * planes.len(), 0.0);
        for (c, plane) in planes.iter().enumerate() {
            for (into, v) in data[c..].iter_mut().step_by(planes.len()).zip(plane.values_as_f32()) {
                *into = v;
            }
        }
        PixelData::F32(data)
    };
    let bitmap = Bitmap::new(w, h, channels, data, Encoding::Linear)
        .ok_or_else(|| FormatError::from(Diagnostic::error("EXR image without pixels").at(place.clone())))?;
    let Vec2(x, y) = layer.attributes.layer_position;
    let data_window = Window { x, y, width: w, height: h };
    Ok(ImageFile {
        colour_space: picture.attributes.chromaticities.map_or(ColourSpace::REC709, colour_space),
        display_window: window(picture.attributes.display_window).unwrap_or(data_window),
        data_window,
        ..ImageFile::new(ImageFormat::Exr, bitmap)
    })
}

pub(super) fn read_layers(bytes: &[u8], name: &Arc<str>, budget: &Budget) -> Result<Layers, FormatError> {
    let place = Place::whole(name.clone());
    let (_, _decoded) = checked_headers(bytes, &place, budget)?;
    let at = Cell::new(0);
    let picture = contained("EXR image", &place, || {
        exr::prelude::read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .all_layers()
            .all_attributes()
            .from_buffered(Tracked::new(bytes, &at))
            .map_err(|e| fault(&place, &at, e))
    })?;
    let damaged = |what: &str| FormatError::from(Diagnostic::error(what).at(place.clone()));
    let Some(first) = picture.layer_data.first() else { return Err(damaged("EXR image without parts")) };
    let Vec2(width, height) = first.size;
    let (Ok(w), Ok(h)) = (u32::try_from(width), u32::try_from(height)) else {
        return Err(damaged("EXR image of an impossible size"));
    };
    let mut layers = Layers::new(w, h);
    let several = picture.layer_data.len() > 1;
    for part in &picture.layer_data {
        let group = part.attributes.layer_name.as_ref().filter(|_| several);
        for channel in &part.channel_data.list {
            let name = match group {
                Some(group) => format!("{group}.{}", channel.name),
                None => channel.name.to_string(),
            };
            let mut samples = budget.vec(channel.sample_data.len() as u64, "image")?;
            samples.extend(channel.sample_data.values_as_f32());
            let full_precision = !matches!(channel.sample_data, FlatSamples::F16(_));
            layers.push(Layer { name, samples, full_precision }).map_err(|layer| {
                let wrong = Diagnostic::error("EXR channels of one name or of different sizes");
                FormatError::from(wrong.at(place.clone()).found(quoted(&layer.name)))
            })?;
        }
    }
    Ok(layers)
}

/// The headers, checked against the file's size and the budget; with the charge for decoding.
fn checked_headers<'b>(
    bytes: &[u8],
    place: &Place,
    budget: &'b Budget,
) -> Result<(Vec<Header>, Hold<'b>), FormatError> {
    let refuse = |message: &str, found: String, expected: &str| {
        let wrong = Diagnostic::error(message).at(place.clone()).found(found);
        FormatError::from(Diagnostic { expected: Some(expected.to_owned()), ..wrong })
    };
    let meta = contained("EXR image", place, || {
        let at = Cell::new(0);
        let meta = MetaData::read_from_buffered(Tracked::new(bytes, &at), false)
            .map_err(|e| fault(place, &at, e))?;
        Ok(meta)
    })?;
    let mut needed = 0u64;
    let mut chunks = 0u64;
    for header in &meta.headers {
        if header.deep {
            return Err(refuse("unsupported EXR image", "deep data".into(), "flat data"));
        }
        let Vec2(width, height) = header.layer_size;
        let pixels = (width as u64).saturating_mul(height as u64);
        for channel in &header.channels.list {
            let Vec2(sx, sy) = channel.sampling;
            if (sx, sy) != (1, 1) {
                let found =
                    format!("channel {} at every {sx} by {sy} pixels", quoted(&channel.name.to_string()));
                return Err(refuse("unsupported EXR image", found, "every channel at every pixel"));
            }
            let each = if channel.sample_type == SampleType::F16 { 2 } else { 4 };
            needed = needed.saturating_add(pixels.saturating_mul(each));
        }
        chunks = chunks.saturating_add(header.chunk_count as u64);
    }
    // Each chunk has at least its table entry, its position and its size.
    if chunks.saturating_mul(16) > bytes.len() as u64 {
        let found = format!("{chunks} chunks in {} bytes", bytes.len());
        return Err(refuse("damaged EXR image", found, "16 bytes or more for each"));
    }
    check_expansion(bytes, needed, place, budget)?;
    let hold = budget.hold(needed, "decoding an EXR image")?;
    Ok((meta.headers.to_vec(), hold))
}

/// The channels of the colours: plain names first, then those of the first complete group, then a single one.
/// With a warning if they are not plain.
fn choose(names: &[String]) -> Option<(Vec<usize>, Option<String>)> {
    let find = |name: &str| names.iter().position(|n| n == name);
    let of_group = |prefix: &str| {
        let find = |c: &str| find(&format!("{prefix}{c}"));
        let colour = match (find("R"), find("G"), find("B"), find("Y")) {
            (Some(r), Some(g), Some(b), _) => vec![r, g, b],
            (_, _, _, Some(y)) => vec![y],
            _ => return None,
        };
        Some(colour.into_iter().chain(find("A")).collect::<Vec<_>>())
    };
    if let Some(plain) = of_group("") {
        return Some((plain, None));
    }
    let groups = names.iter().filter_map(|n| n.rfind('.').map(|dot| &n[..=dot]));
    for group in groups {
        if let Some(chosen) = of_group(group) {
            return Some((chosen, Some(format!("the group {}", quoted(group.trim_end_matches('.'))))));
        }
    }
    match names {
        [only] => Some((vec![0], Some(format!("the one channel {}", quoted(only))))),
        _ => None,
    }
}

fn colour_space(c: Chromaticities) -> ColourSpace {
    let xy = |v: Vec2<f32>| [f64::from(v.0), f64::from(v.1)];
    let said = ColourSpace { red: xy(c.red), green: xy(c.green), blue: xy(c.blue), white: xy(c.white) };
    // Rounding to single precision must not make a different colour space.
    let near = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).abs() < 1e-4 && (a[1] - b[1]).abs() < 1e-4;
    let usual = ColourSpace::REC709;
    let same = near(said.red, usual.red)
        && near(said.green, usual.green)
        && near(said.blue, usual.blue)
        && near(said.white, usual.white);
    if same { usual } else { said }
}

fn window(bounds: IntegerBounds) -> Option<Window> {
    let Vec2(x, y) = bounds.position;
    let width = u32::try_from(bounds.size.0).ok().filter(|&n| n > 0)?;
    let height = u32::try_from(bounds.size.1).ok().filter(|&n| n > 0)?;
    Some(Window { x, y, width, height })
}

/// The error of a decoder that had read so far.
fn fault(place: &Place, at: &Cell<u64>, error: exr::error::Error) -> FormatError {
    let kind = match error {
        exr::error::Error::NotSupported(_) => "unsupported",
        _ => "damaged",
    };
    let place = Place::binary(place.file.clone(), at.get(), "");
    let wrong = Diagnostic::error(format!("{kind} EXR image")).at(place);
    wrong.because(in_one_line(&error.to_string())).into()
}

pub(super) fn encode(layers: &Layers, options: &WriteOptions) -> std::io::Result<Vec<u8>> {
    let invalid = |e: exr::error::Error| std::io::Error::other(e.to_string());
    let channels = layers
        .iter()
        .map(|layer| {
            // Nothing finite becomes infinite: a channel that half precision cannot hold has single precision.
            const GREATEST_HALF: f32 = 65504.0;
            let is_too_large = |v: &f32| v.is_finite() && v.abs() > GREATEST_HALF;
            let full = layer.full_precision
                || options.exr_precision == ExrPrecision::Float
                || layer.samples.iter().any(is_too_large);
            let samples = if full {
                FlatSamples::F32(layer.samples.clone())
            } else {
                FlatSamples::F16(layer.samples.iter().map(|&v| f16::from_bits(f32_to_half(v))).collect())
            };
            let name = Text::new_or_none(&layer.name).ok_or_else(|| {
                std::io::Error::other(format!("no channel can be named {}", quoted(&layer.name)))
            })?;
            Ok(AnyChannel::new(name, samples))
        })
        .collect::<std::io::Result<_>>()?;
    let size = Vec2(layers.width() as usize, layers.height() as usize);
    let data = Window { x: 0, y: 0, width: layers.width(), height: layers.height() };
    let (data, display) = match options.exr_window {
        Some((x, y, width, height)) => (Window { x, y, ..data }, Window { x: 0, y: 0, width, height }),
        None => (data, data),
    };
    let encoding = match options.exr_compression {
        ExrCompression::None => ExrEncoding::UNCOMPRESSED,
        ExrCompression::Rle => ExrEncoding::FAST_LOSSLESS,
        ExrCompression::Zip => ExrEncoding::SMALL_LOSSLESS,
        ExrCompression::Piz => {
            ExrEncoding { compression: exr::prelude::Compression::PIZ, ..ExrEncoding::SMALL_LOSSLESS }
        }
    };
    let mut attributes = LayerAttributes {
        software_name: Text::new_or_none(origin::SOFTWARE),
        layer_position: Vec2(data.x, data.y),
        ..LayerAttributes::default()
    };
    if let Some(denoiser) = options.denoiser {
        attributes.other.insert(Text::from("denoiser"), AttributeValue::Text(Text::from(denoiser)));
    }
    for (name, text) in &options.exr_attributes {
        attributes.other.insert(Text::from(name.as_str()), AttributeValue::Text(Text::from(text.as_str())));
    }
    let has_several = attributes.other.len() > 1;
    // As one attribute: texts of any length.
    let lines: Vec<String> = options.metadata.iter().map(|(name, text)| format!("{name}: {text}")).collect();
    attributes.comments = Text::new_or_none(lines.join("\n")).filter(|_| !lines.is_empty());
    let layer = ExrLayer::new(size, attributes, encoding, AnyChannels::sort(channels));
    let display_size = Vec2(display.width as usize, display.height as usize);
    let mut picture_attributes =
        ImageAttributes::new(IntegerBounds::new(Vec2(display.x, display.y), display_size));
    let xy = |[x, y]: [f64; 2]| Vec2(x as f32, y as f32);
    let space = ColourSpace::REC709;
    picture_attributes.chromaticities = Some(Chromaticities {
        red: xy(space.red),
        green: xy(space.green),
        blue: xy(space.blue),
        white: xy(space.white),
    });
    let picture = ExrImage { attributes: picture_attributes, layer_data: layer };
    let mut out = Cursor::new(Vec::new());
    picture.write().to_buffered(&mut out).map_err(invalid)?;
    let mut bytes = out.into_inner();
    if has_several {
        // The crate writes several custom ones in an order that changes every time.
        sort_attributes(&mut bytes);
    }
    Ok(bytes)
}

/// Sorts the attributes of the one header of a file by name. Each is a name and a type, both ended by a zero, a length
/// of four bytes, and a value; a zero ends the list.
fn sort_attributes(file: &mut [u8]) {
    const START: usize = 8;
    let end_of = |at: usize| -> Option<usize> {
        let text = |at: usize| Some(at + file.get(at..)?.iter().position(|&byte| byte == 0)? + 1);
        let value = text(text(at)?)?;
        let length = u32::from_le_bytes(file.get(value..value + 4)?.try_into().ok()?);
        Some(value + 4 + length as usize)
    };
    let mut ends = vec![START];
    while let Some(&at) = ends.last()
        && file.get(at).is_some_and(|&byte| byte != 0)
        && let Some(end) = end_of(at)
    {
        ends.push(end);
    }
    let mut attributes: Vec<Vec<u8>> =
        ends.windows(2).filter_map(|ends| file.get(ends[0]..ends[1])).map(<[u8]>::to_vec).collect();
    attributes.sort();
    let sorted = attributes.concat();
    if let Some(list) = file.get_mut(START..START + sorted.len()) {
        list.copy_from_slice(&sorted);
    }
}
