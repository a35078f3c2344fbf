//! The static page: the picture with its channels, the shapes at its pixels, and the facts of the scene, as files that
//! need no viewer.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{Read, Write};
use std::path::Path;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use lumbre::description::IntegratorKind;
use lumbre::formats::image::{ImageFormat, encode_image};
use lumbre::formats::{atomic_write, open_regular};
use lumbre::image::{Encoded, Image, f32_to_half};
use lumbre::{CancelToken, ErrorKind, NoProgress, Stop};
use rayon::prelude::*;
use serde_json::Value;

use crate::base64::base64;
use crate::frame::{Frame, HEADER, Look, Pixels, Shot};
use crate::message::{Channel, StaticChannel, StaticPage, StaticPicks, StaticProgress};
use crate::page::FILES;
use crate::source::{Built, Moment, Source, SourceError};
use crate::stage::{Stage, ray};
use crate::tree::Hidden;

/// Samples per pixel of channels other than the picture.
const FEATURE_SPP: u32 = 16;

/// Renders a scene and writes a page of it into a folder, which is created if needed: `index.html` opens from a file,
/// and the folder can be sent or put on a web server. `cancel` ends the render early, and the page has the picture so
/// far. Files of an earlier page are replaced, and no others.
///
/// # Errors
/// Faults of the scene, files that cannot be written, and a foreign file in the way, which is reported before anything
/// is read.
pub fn export(source: &dyn Source, folder: &Path, cancel: &CancelToken) -> Result<(), SourceError> {
    refuse_foreign(folder)?;
    let read = source.read(&Moment::default())?;
    // Nothing can answer beyond what is in the page.
    let built = Built { explain: None, ..source.build(read.desc.clone(), &Hidden::default())? };
    let stage = Stage::new(built, &read.desc, read.warnings);
    let scene = stage.scene();
    let look = Look::of(stage.save.clone());
    let mut options = stage.options.clone();
    options.guides = stage.denoise;
    let full = (options.width, options.height);
    source.check(&options)?;
    let (mut picture, _) = scene.render_from(&options, &NoProgress, cancel, None, None)?;
    let stats = picture.stats().clone();
    if stats.spp == 0 {
        return Err(wrong(ErrorKind::Limit, "not every pixel had a sample: nothing was written"));
    }
    if stage.denoise {
        picture.denoise(options.threads)?;
    }
    let values = packed(picture.image())?;
    let picture = match &stage.background {
        Some(background) => picture.over(background.clone()),
        None => picture,
    };
    let png = picture.encode(ImageFormat::Png, &look.save, &[])?;
    let mut channels =
        vec![StaticChannel { name: Channel::Beauty, png: base64(&png), values: base64(&values) }];
    for (channel, kind) in [
        (Channel::Albedo, IntegratorKind::Albedo),
        (Channel::Normal, IntegratorKind::Normals),
        (Channel::Depth, IntegratorKind::Depth),
        (Channel::Uv, IntegratorKind::Uv),
    ] {
        let mut options = options.clone();
        (options.integrator.kind, options.transparent, options.guides) = (kind, false, false);
        options.spectral = false;
        options.exposure = lumbre::RenderOptions::default().exposure;
        options.stop = Stop::at(FEATURE_SPP);
        let picture = scene.render(&options)?;
        let values =
            if channel == Channel::Depth { base64(&packed(picture.image())?) } else { String::new() };
        let pixels = Pixels::Rendered(Box::new(picture));
        let shot =
            Shot { pixels, channel, full, sequence: 0, is_full: true, is_done: true, is_denoised: false };
        channels.push(StaticChannel { name: channel, png: base64(&shown(&shot, &look)?), values });
    }
    let rays = stats.rays.camera + stats.rays.bounce + stats.rays.shadow;
    let seconds = stats.elapsed.as_secs_f64();
    let page = StaticPage {
        name: source.name(),
        scene: &stage.facts,
        placement: stage.placements.get(options.camera).copied(),
        camera: options.camera,
        progress: StaticProgress {
            spp: stats.spp,
            target: options.stop.spp,
            noise: stats.noise,
            seconds,
            rays_per_second: rays as f64 / seconds.max(1e-6),
        },
        channels,
        picks: picks(&stage, options.camera, full)?,
    };
    let data = serde_json::to_value(&page).map_err(|e| wrong(ErrorKind::Options, e.to_string()))?;
    write(folder, &data)
}

fn wrong(kind: ErrorKind, message: impl Into<String>) -> SourceError {
    SourceError { kind, message: message.into() }
}

/// The mark near the start of every file of the page, which identifies it.
const MARK: &str = "Written by lumbre view --export, which replaces it.";
const DATA: &str = "data.js";
const INDEX: &str = "index.html";

/// The names of all files of the page.
fn names() -> impl Iterator<Item = &'static str> {
    let pages =
        FILES.iter().map(|file| if file.path == "/" { INDEX } else { file.path.trim_start_matches('/') });
    std::iter::once(DATA).chain(pages)
}

/// Refuses a folder in which another file has the name of one of the page's.
fn refuse_foreign(folder: &Path) -> Result<(), SourceError> {
    for path in names().map(|name| folder.join(name)) {
        if std::fs::symlink_metadata(&path).is_err() {
            continue;
        }
        let mut start = Vec::new();
        let read = open_regular(&path).map(|(file, _)| file.take(1000).read_to_end(&mut start));
        let has_mark = start.windows(MARK.len()).any(|here| here == MARK.as_bytes());
        if !(read.is_ok() && has_mark) {
            let why = "is no file of an earlier page (expected another folder, or that it is removed)";
            return Err(wrong(ErrorKind::Options, format!("{}: it {why}", path.display())));
        }
    }
    Ok(())
}

fn write(folder: &Path, data: &Value) -> Result<(), SourceError> {
    std::fs::create_dir_all(folder)
        .map_err(|e| wrong(ErrorKind::Io, format!("{}: {e}", folder.display())))?;
    // Something may have appeared meanwhile.
    refuse_foreign(folder)?;
    let save = |name: &str, text: &str| {
        let text = match name.rsplit_once('.') {
            Some((_, "html")) => text.replacen("<html", &format!("<!-- {MARK} -->\n<html"), 1),
            Some((_, "svg")) => text.replacen("<svg", &format!("<!-- {MARK} -->\n<svg"), 1),
            _ => format!("/* {MARK} */\n{text}"),
        };
        atomic_write(&folder.join(name), |file: &mut dyn Write| file.write_all(text.as_bytes()))
            .map_err(|e| SourceError::from(lumbre::Error::from(e)))
    };
    save(DATA, &format!("globalThis.lumbreAtRest = {data};\n"))?;
    for (file, name) in FILES.iter().zip(names().skip(1)) {
        let text = String::from_utf8_lossy(file.bytes);
        if name == INDEX {
            let script = "<script src=\"viewer.js\"></script>";
            save(name, &text.replace(script, &format!("<script src=\"{DATA}\"></script>\n{script}")))?;
        } else {
            save(name, &text)?;
        }
    }
    Ok(())
}

/// A shot as a PNG of what its frame shows.
fn shown(shot: &Shot, look: &Look) -> Result<Vec<u8>, SourceError> {
    let Frame(bytes) = Frame::new(shot, look);
    let unit = |byte: u8| f32::from(byte) / 255.0;
    let light = |rgba: &[u8]| Encoded::new(unit(rgba[0]), unit(rgba[1]), unit(rgba[2])).to_linear();
    let pixels = bytes[HEADER..].chunks_exact(4).map(light).collect();
    let (width, height) = (shot.image().width(), shot.image().height());
    let image = Image::from_pixels(width, height, pixels)
        .ok_or_else(|| wrong(ErrorKind::Options, "a frame has a pixel too few"))?;
    encode_image(&image, ImageFormat::Png, &lumbre::SaveOptions::default())
        .map_err(|e| wrong(ErrorKind::Options, e.to_string()))
}

/// The numbers of an image in half precision.
fn packed(image: &Image) -> Result<Vec<u8>, SourceError> {
    let numbers = image.pixels().iter().flat_map(|pixel| pixel.to_array());
    compressed(numbers.map(|value| f32_to_half(value).to_le_bytes()))
}

/// The hits of the rays through the pixels' middles: for each pixel the position of the shape in a list, counted from
/// 1, or 0 for nothing, and its distance.
fn picks(stage: &Stage, camera: usize, (width, height): (u32, u32)) -> Result<StaticPicks, SourceError> {
    let scene = stage.scene();
    let pixels = (0..height).into_par_iter().flat_map_iter(|y| (0..width).map(move |x| (x, y)));
    let met = pixels.map(|(x, y)| {
        let (x, y) = (f64::from(x) + 0.5, f64::from(y) + 0.5);
        let hit = scene.closest(&ray(&scene, camera, (width, height), x, y)?)?;
        Some((hit.shape, hit.t as f32))
    });
    let met: Vec<Option<(u32, f32)>> = met.collect();
    let shapes: BTreeSet<u32> = met.iter().flatten().map(|(shape, _)| *shape).collect();
    let places: BTreeMap<u32, u32> = shapes.iter().copied().zip(1..).collect();
    let numbers = met.iter().flat_map(|met| match met {
        Some((shape, distance)) => [places[shape].to_le_bytes(), distance.to_le_bytes()],
        None => [[0; 4]; 2],
    });
    let shapes = shapes.iter().map(|shape| stage.thing(*shape).listed(*shape));
    Ok(StaticPicks { shapes: shapes.collect(), values: base64(&compressed(numbers)?) })
}

/// Little-endian numbers, compressed.
fn compressed<const N: usize>(numbers: impl Iterator<Item = [u8; N]>) -> Result<Vec<u8>, SourceError> {
    let mut packed = ZlibEncoder::new(Vec::new(), Compression::default());
    for bytes in numbers {
        packed.write_all(&bytes).map_err(|e| wrong(ErrorKind::Io, e.to_string()))?;
    }
    packed.finish().map_err(|e| wrong(ErrorKind::Io, e.to_string()))
}
