//! Textures: images decoded once, and lookups of materials in them.

use std::cell::RefCell;
use std::collections::HashMap;
use std::sync::Arc;

use lumbre_image::{Bitmap, Channels, Encoding, PixelData, unit_to_u16};
use lumbre_math::glam::{Affine2, Mat2};
use lumbre_math::{Vec2, Vec3};
use lumbre_scene::TextureListing;
use lumbre_shading::{
    AxisWrap, FURTHER_SETS, FloatTexture, ImageFilter, ImageTexture, Mapping2d, MipMap, MipMapOptions,
    SpectrumTexture, Texture, UvSet, Wrap,
};

use super::extensions::SUPPORTED;
use super::file::{File, List};
use super::json::{Read, Value};
use super::material::TextureRef;
use super::uri::{Target, target};
use crate::diagnostic::Place;
use crate::diagnostic::{Diagnostic, quoted};
use crate::image::read_image;

/// The use of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Use {
    /// Colours, in sRGB.
    Colour,
    /// One stored channel: 0 to 2 colours, 3 alpha.
    Channel(usize),
    /// Three stored numbers.
    Directions,
    /// Normals, with a factor (as bits) on x and y.
    Normal(u32),
}

/// A texture and its use.
type MapKey = (usize, Use);

/// The textures of a file, each decoded on first use.
pub(super) struct Textures<'f> {
    file: &'f File<'f>,
    images: RefCell<HashMap<usize, Option<Arc<Bitmap>>>>,
    listing: RefCell<Vec<TextureListing>>,
    maps: RefCell<HashMap<MapKey, Option<Arc<MipMap>>>>,
}

/// The uv sets of a mesh, as sets of the file. glTF's v counts downwards and ours upwards, so meshes have 1 -
/// v.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub(super) struct UvSets {
    pub first: usize,
    pub further: [Option<usize>; FURTHER_SETS],
    /// The transform applied to the first set in the mesh itself: area lights look up their image there without
    /// a mapping.
    pub baked: Affine2,
    /// Whether the set itself is lost by that transform: then textures of materials find it among the further
    /// ones.
    pub is_first_lost: bool,
}

impl UvSets {
    /// Whether the mesh holds a set of the file, mapped or not.
    pub(super) fn holds(&self, set: usize) -> bool {
        set == self.first || self.find(set).is_some()
    }

    /// The mesh's set for a set of the file; `None` if it does not have it.
    pub(super) fn find(&self, set: usize) -> Option<UvSet> {
        if set == self.first && !self.is_first_lost {
            return Some(UvSet::First);
        }
        let found = self.further.iter().position(|further| *further == Some(set))?;
        Some(UvSet::FURTHER[found])
    }
}

impl<'f> Textures<'f> {
    pub(super) fn new(file: &'f File<'f>) -> Self {
        Self { file, images: RefCell::default(), listing: RefCell::default(), maps: RefCell::default() }
    }

    /// The images that were decoded.
    pub(super) fn into_listing(self) -> Vec<TextureListing> {
        self.listing.into_inner()
    }

    /// Checks a texture and its image, without decoding.
    pub(super) fn check(file: &File<'_>, value: Value<'_>) -> Read<()> {
        source(file, value)?;
        sampler(file, value)?;
        Ok(())
    }

    /// Checks an image without decoding it.
    pub(super) fn check_image(file: &File<'_>, value: Value<'_>) -> Read<()> {
        let mime = value.string_at("mimeType")?;
        match (value.get("uri")?, value.get("bufferView")?) {
            (Some(uri), None) => drop(uri.string()?),
            (None, Some(view)) => {
                if mime.is_none() {
                    file.breach(value.wrong("image in a buffer view without a \"mimeType\""))?;
                }
                file.at(List::BufferViews, view)?;
            }
            (Some(_), Some(view)) => file.breach(view.wrong("image with a URI and with a buffer view"))?,
            (None, None) => {
                file.breach(value.wrong("image without data").expected("\"uri\" or \"bufferView\""))?;
            }
        }
        Ok(())
    }

    /// A colour from a texture; `None` without an image.
    pub(super) fn colour(&self, texture: TextureRef, sets: UvSets) -> Read<Option<Arc<SpectrumTexture>>> {
        Ok(self.look_up(texture, sets, Use::Colour)?.map(|image| Arc::new(Texture::Image(image))))
    }

    /// One channel of a texture (3 is alpha); `None` where it has no alpha.
    pub(super) fn channel(
        &self,
        texture: TextureRef,
        channel: usize,
        sets: UvSets,
    ) -> Read<Option<Arc<FloatTexture>>> {
        Ok(self.look_up(texture, sets, Use::Channel(channel))?.map(|image| Arc::new(Texture::Image(image))))
    }

    /// Stored directions in red and green, with blue.
    pub(super) fn directions(&self, texture: TextureRef, sets: UvSets) -> Read<Option<Arc<SpectrumTexture>>> {
        Ok(self.look_up(texture, sets, Use::Directions)?.map(|image| Arc::new(Texture::Image(image))))
    }

    /// A normal map.
    pub(super) fn normals(
        &self,
        texture: TextureRef,
        scale: f32,
        sets: UvSets,
    ) -> Read<Option<ImageTexture>> {
        self.look_up(texture, sets, Use::Normal(scale.to_bits()))
    }

    /// The colours of a texture, without a mapping.
    pub(super) fn colour_map(&self, texture: usize) -> Read<Option<Arc<MipMap>>> {
        self.map(texture, Use::Colour)
    }

    fn look_up(&self, texture: TextureRef, sets: UvSets, how: Use) -> Read<Option<ImageTexture>> {
        let Some(set) = sets.find(texture.uv_set) else { return Ok(None) };
        let image = self.map(texture.texture, how)?;
        let map = match set {
            UvSet::First => ours(texture) * sets.baked.inverse(),
            UvSet::Second | UvSet::Third | UvSet::Fourth => ours(texture),
        };
        let axes = [map.matrix2.x_axis, map.matrix2.y_axis];
        let mapping = Mapping2d::Affine { set, axes, origin: map.translation };
        Ok(image.map(|image| ImageTexture { mapping, image, scale: 1.0, invert: false }))
    }

    fn map(&self, texture: usize, how: Use) -> Read<Option<Arc<MipMap>>> {
        if let Some(map) = self.maps.borrow().get(&(texture, how)) {
            return Ok(map.clone());
        }
        let file = self.file;
        let value = file.list(List::Textures)[texture];
        let map = match source(file, value)? {
            None => {
                file.warn(value, "texture without an image is left out");
                None
            }
            Some(image) => match self.image(image)? {
                None => None,
                Some(bitmap) if how == Use::Channel(3) && bitmap.channels().alpha().is_none() => None,
                Some(bitmap) => {
                    let options = sampler(file, value)?;
                    let pixels = u64::from(bitmap.width()) * u64::from(bitmap.height());
                    let bitmap = if how == Use::Colour {
                        bitmap
                    } else {
                        let each = match how {
                            Use::Normal(_) => 6,
                            Use::Directions => bitmap.bytes() as u64 / pixels.max(1),
                            _ => 2,
                        };
                        file.budget.bytes(pixels * each, "texture")?;
                        Arc::new(derived(&bitmap, how))
                    };
                    file.budget.bytes(bitmap.bytes() as u64 / 3 + 16, "texture")?;
                    Some(Arc::new(MipMap::new(bitmap, options)))
                }
            },
        };
        self.maps.borrow_mut().insert((texture, how), map.clone());
        Ok(map)
    }

    /// A decoded image; `None` for one that cannot be read, after a warning.
    fn image(&self, index: usize) -> Read<Option<Arc<Bitmap>>> {
        if let Some(image) = self.images.borrow().get(&index) {
            return Ok(image.clone());
        }
        let file = self.file;
        let value = file.list(List::Images)[index];
        let image = match decoded(file, value) {
            Ok(image) => Some(Arc::new(image)),
            // As in other programs, the rest is shown without an image that is missing.
            Err(error @ crate::FormatError::Input(_)) if file.is_lenient() || is_absent(file, value)? => {
                let warning = Diagnostic::warning("image is left out").at(value.place());
                file.push(warning.because(within(&value.place(), &error)));
                None
            }
            Err(error) => return Err(error.included_from(value.place())),
        };
        if let Some(image) = &image {
            let (name, width, height) = (image_name(value, index)?, image.width(), image.height());
            self.listing.borrow_mut().push(TextureListing { name, width, height });
        }
        self.images.borrow_mut().insert(index, image.clone());
        Ok(image)
    }
}

/// The file of an image, or else its name, or else its index.
fn image_name(value: Value<'_>, index: usize) -> Read<String> {
    if let Some(uri) = value.string_at("uri")?
        && !matches!(target(&uri), Target::Data(_))
    {
        return Ok(uri.into_owned());
    }
    Ok(value.string_at("name")?.map_or_else(|| format!("image {index}"), |name| name.into_owned()))
}

/// An error about an image, without a place in the file that names it.
fn within(place: &Place, error: &crate::FormatError) -> String {
    match error {
        crate::FormatError::Input(wrong) if wrong.place.as_ref().is_some_and(|at| at.file == place.file) => {
            Diagnostic { place: None, ..(**wrong).clone() }.body()
        }
        _ => error.to_string(),
    }
}

/// Whether an image is in a file that does not exist, or elsewhere.
fn is_absent(file: &File<'_>, value: Value<'_>) -> Read<bool> {
    let Some(uri) = value.get("uri")? else { return Ok(false) };
    Ok(match target(&uri.string()?) {
        Target::File(path) => {
            let path = file.folder.join(path);
            // Nothing is said of files that may not be opened, not even whether they are there.
            !file.budget.allows(&path) || !file.budget.is_file(&path)
        }
        Target::Scheme(_) => true,
        Target::Data(_) | Target::Malformed => false,
    })
}

fn decoded(file: &File<'_>, value: Value<'_>) -> Read<Bitmap> {
    let read = |bytes: &[u8], name: &Arc<str>| -> Read<Bitmap> {
        check_media_type(file, value, bytes)?;
        #[cfg(feature = "basisu")]
        if bytes.starts_with(super::ktx::MAGIC) {
            return super::ktx::read(file, bytes, name);
        }
        let image = file.with_diagnostics(|diagnostics| {
            let image = read_image(bytes, name, file.budget, diagnostics)?;
            image.for_scene(|| Place::whole(name.clone()), file.budget, diagnostics)
        })?;
        Ok(image.bitmap)
    };
    if let Some(uri) = value.get("uri")? {
        let (name, bytes) = file.data(uri, &[])?;
        let image = read(&bytes, &name)?;
        file.budget.release(bytes.len() as u64);
        return Ok(image);
    }
    let name: Arc<str> = value.place().to_string().into();
    let (_, view) = file.view(value.need("bufferView")?)?;
    let bytes = view.bytes.ok_or_else(|| file.without_data(value))?;
    read(bytes, &name)
}

/// Warns of an image whose bytes are of another kind than its media type or data URI declares. The bytes take
/// precedence, as the specification requires.
fn check_media_type(file: &File<'_>, image: Value<'_>, bytes: &[u8]) -> Read<()> {
    let kinds: [(&str, bool); 4] = [
        ("image/png", bytes.starts_with(b"\x89PNG")),
        ("image/jpeg", bytes.starts_with(b"\xFF\xD8\xFF")),
        ("image/webp", bytes.starts_with(b"RIFF") && bytes.get(8..12) == Some(b"WEBP")),
        ("image/ktx2", bytes.starts_with(b"\xABKTX 20\xBB")),
    ];
    let Some((expected, _)) = kinds.into_iter().find(|(_, is)| *is) else { return Ok(()) };
    let warn = |culprit: Value<'_>, said: &str| {
        if !said.eq_ignore_ascii_case(expected) {
            let warning = Diagnostic::warning("wrong media type of an image").at(culprit.place());
            file.push(warning.found(quoted(said)).expected(quoted(expected)));
        }
    };
    if let Some(said) = image.get("mimeType")? {
        warn(said, &said.string()?);
    }
    if let Some(uri) = image.get("uri")?
        && let Target::Data(data) = target(&uri.string()?)
    {
        warn(uri, data.media_type);
    }
    Ok(())
}

/// The image of a texture; an extension's takes precedence.
fn source(file: &File<'_>, value: Value<'_>) -> Read<Option<usize>> {
    let mut chosen = None;
    for name in ["EXT_texture_webp", "KHR_texture_basisu"] {
        let Some(extension) = value.extension(name)? else { continue };
        if let Some((index, _)) = file.named(List::Images, extension, "source")?
            && SUPPORTED.contains(&name)
        {
            chosen = chosen.or(Some(index));
        }
    }
    let plain = file.named(List::Images, value, "source")?.map(|(index, _)| index);
    Ok(chosen.or(plain))
}

fn sampler(file: &File<'_>, texture: Value<'_>) -> Read<MipMapOptions> {
    let mut options =
        MipMapOptions { wrap: Wrap::Axes([AxisWrap::Repeat; 2]), filter: ImageFilter::Trilinear };
    let Some((_, sampler)) = file.named(List::Samplers, texture, "sampler")? else { return Ok(options) };
    let wrap = |name: &str| -> Read<AxisWrap> {
        let Some(value) = sampler.get(name)? else { return Ok(AxisWrap::Repeat) };
        Ok(match value.whole(0)? {
            10497 => AxisWrap::Repeat,
            33071 => AxisWrap::Clamp,
            33648 => AxisWrap::Mirror,
            _ => return Err(value.unexpected("unknown way to wrap", "10497, 33071 or 33648")),
        })
    };
    options.wrap = Wrap::Axes([wrap("wrapS")?, wrap("wrapT")?]);
    let filter = |name: &str, known: &[u64]| -> Read<Option<u64>> {
        let Some(value) = sampler.get(name)? else { return Ok(None) };
        let filter = value.whole(0)?;
        if known.contains(&filter) {
            return Ok(Some(filter));
        }
        let expected: Vec<String> = known.iter().map(u64::to_string).collect();
        Err(value.unexpected("unknown filter", &expected.join(", ")))
    };
    let nearest = 9728;
    filter("minFilter", &[nearest, 9729, 9984, 9985, 9986, 9987])?;
    if filter("magFilter", &[nearest, 9729])? == Some(nearest) {
        options.filter = ImageFilter::Point;
    }
    Ok(options)
}

/// The uv transform of a texture for coordinates whose v counts upwards, as in our meshes and images: flipped
/// before and after.
pub(super) fn ours(texture: TextureRef) -> Affine2 {
    let ([u, v], offset) = texture.transform.axes();
    let turn = Affine2 { matrix2: Mat2::from_diagonal(Vec2::new(1.0, -1.0)), translation: Vec2::Y };
    turn * Affine2 { matrix2: Mat2::from_cols(u, v), translation: offset } * turn
}

/// The values for a use of an image.
fn derived(image: &Bitmap, how: Use) -> Bitmap {
    let (width, height) = (image.width(), image.height());
    let places = || (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let grey = matches!(image.channels(), Channels::Y | Channels::Ya);
    let stored = |x, y, c: usize| match image.channels().alpha() {
        Some(alpha) if c == 3 => image.stored(x, y, alpha),
        None if c == 3 => 1.0,
        _ => image.stored(x, y, if grey { 0 } else { c }),
    };
    let single = |value: &dyn Fn(u32, u32) -> f32| {
        let data = places().map(|(x, y)| unit_to_u16(value(x, y))).collect();
        Bitmap::new(width, height, Channels::Y, PixelData::U16(data), Encoding::Linear)
    };
    let bitmap = match how {
        Use::Colour => None,
        Use::Channel(c) => single(&|x, y| stored(x, y, c)),
        Use::Directions => Some(image.clone().with_encoding(Encoding::Linear)),
        Use::Normal(scale) => {
            let scale = f32::from_bits(scale);
            let normal = |(x, y)| {
                let n = Vec3::new(stored(x, y, 0), stored(x, y, 1), stored(x, y, 2)) * 2.0 - 1.0;
                let n = (n * Vec3::new(scale, scale, 1.0)).normalize_or(Vec3::Z);
                (0.5 * n + 0.5).to_array().map(unit_to_u16)
            };
            let data = places().flat_map(normal).collect();
            Bitmap::new(width, height, Channels::Rgb, PixelData::U16(data), Encoding::Linear)
        }
    };
    bitmap.unwrap_or_else(|| image.clone())
}
