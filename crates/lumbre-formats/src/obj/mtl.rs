//! MTL material files.

use std::sync::Arc;

use lumbre_image::Rgb;

use super::words::{Source, Word, Words};
use crate::budget::Budget;
use crate::diagnostic::{Diagnostic, Diagnostics, FormatError, Place, TextPlaces};
use crate::input::narrow_text;

/// A material of an MTL file; unspecified values are `None`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MtlMaterial {
    /// Its name.
    pub name: String,
    /// `illum`: the illumination model, from 0 to 10.
    pub illumination: Option<u32>,
    /// `Kd`.
    pub diffuse: Option<Rgb>,
    /// `Ks`.
    pub specular: Option<Rgb>,
    /// `Ke`.
    pub emission: Option<Rgb>,
    /// `Ns`: the exponent of the highlight.
    pub shininess: Option<f32>,
    /// `Ni`: the index of refraction.
    pub refraction: Option<f32>,
    /// `d`: opacity.
    pub opacity: Option<f32>,
    /// `Tr`, with its place: 1 - opacity by some programs, opacity by others.
    pub transparency: Option<(f32, Place)>,
    /// `Pr`, in `[0, 1]`.
    pub roughness: Option<f32>,
    /// `Pm`, in `[0, 1]`.
    pub metallic: Option<f32>,
    /// `Ps`: sheen, in `[0, 1]`.
    pub sheen: Option<f32>,
    /// `Pc`: the share of the clear coat, in `[0, 1]`.
    pub clearcoat: Option<f32>,
    /// `Pcr`: roughness of the coat, in `[0, 1]`.
    pub clearcoat_roughness: Option<f32>,
    /// `aniso`: anisotropy, in `[0, 1]`.
    pub anisotropy: Option<f32>,
    /// `anisor`: its rotation from the tangent, in turns.
    pub anisotropy_rotation: Option<f32>,
    /// `map_Kd`.
    pub diffuse_map: Option<Box<MtlTexture>>,
    /// `map_Ke`.
    pub emission_map: Option<Box<MtlTexture>>,
    /// `map_d`.
    pub opacity_map: Option<Box<MtlTexture>>,
    /// `map_Pr`.
    pub roughness_map: Option<Box<MtlTexture>>,
    /// `map_Pm`.
    pub metallic_map: Option<Box<MtlTexture>>,
    /// `map_Ps`.
    pub sheen_map: Option<Box<MtlTexture>>,
    /// `bump`, `map_Bump` or `disp`: heights.
    pub bump_map: Option<Box<MtlTexture>>,
    /// `norm`: a normal map.
    pub normal_map: Option<Box<MtlTexture>>,
}

/// A texture reference of an MTL file.
#[derive(Clone, Debug, PartialEq)]
pub struct MtlTexture {
    /// The file, relative to the MTL file.
    pub file: String,
    /// The place of the reference.
    pub place: Place,
    /// `-s`: a factor on texture coordinates.
    pub scale: [f32; 2],
    /// `-o`: added to them.
    pub offset: [f32; 2],
    /// `-bm`: a factor on heights.
    pub bump_multiplier: f32,
    /// `-mm`: base and gain; the value is base + gain times the image's.
    pub range: [f32; 2],
    /// `-clamp on`: the last pixels repeat beyond the image's edges.
    pub clamp: bool,
}

/// Reads materials from the bytes of an MTL file.
///
/// Keys without a meaning here (`Ka` and others) are ignored, those that would change the appearance with a
/// warning.
///
/// # Errors
/// [`FormatError::Input`] with line and column; [`FormatError::Limit`].
pub fn read_mtl(
    bytes: &[u8],
    name: &Arc<str>,
    budget: &Budget,
    diagnostics: &mut Diagnostics,
) -> Result<Vec<MtlMaterial>, FormatError> {
    let decoded = narrow_text(bytes, name, budget)?;
    let bytes = &*decoded;
    let places = TextPlaces::default();
    let source = Source { name, bytes, places: &places };
    let mut materials: Vec<MtlMaterial> = vec![];
    for line in source.lines() {
        let mut words = line.words();
        let Some(keyword) = words.next() else { continue };
        if keyword.bytes == b"newmtl" {
            let (_, name) = words.rest();
            budget.elements(1, "materials")?;
            // Its name is in a table too, with its folder.
            let each = size_of::<MtlMaterial>() + 2 * name.len() + 128;
            budget.bytes(each as u64, "materials")?;
            materials.push(MtlMaterial { name: name.into_owned(), ..MtlMaterial::default() });
            continue;
        }
        match materials.last_mut() {
            Some(material) => {
                let mut reader = Reader { source, budget, diagnostics };
                reader.key(material, keyword, words)?;
            }
            None => {
                let said = "line before the first newmtl, passed over";
                diagnostics.warn(said, |said| said.at(source.place(keyword.start)));
            }
        }
    }
    for material in &mut materials {
        material.settle_opacity(diagnostics);
    }
    Ok(materials)
}

impl MtlMaterial {
    /// `Tr` is 1 - opacity, or opacity in MeshLab and others: `d` decides where the file has both. Nothing is
    /// written to be invisible, so a `Tr` of 1 alone is an opaque material.
    fn settle_opacity(&mut self, diagnostics: &mut Diagnostics) {
        let Some((transparency, place)) = &self.transparency else { return };
        let as_usual = 1.0 - transparency;
        match self.opacity {
            Some(opacity) if (opacity - as_usual).abs() <= 1e-3 => {}
            Some(opacity) => {
                let same = (opacity - transparency).abs() <= 1e-3;
                let meant = if same { "Tr is opacity here" } else { "d is taken" };
                diagnostics.warn("d and Tr of a material disagree", |said| {
                    said.at(place.clone()).found(format!("{transparency}, and d {opacity}: {meant}"))
                });
            }
            None if *transparency >= 1.0 => {
                diagnostics.warn("Tr of a material makes it invisible, taken for opaque", |said| {
                    said.at(place.clone()).found(transparency)
                });
                self.opacity = Some(1.0);
            }
            None => self.opacity = Some(as_usual),
        }
    }
}

/// The options of a texture.
const OPTIONS: [&[u8]; 14] = [
    b"-s",
    b"-o",
    b"-bm",
    b"-mm",
    b"-clamp",
    b"-t",
    b"-blendu",
    b"-blendv",
    b"-cc",
    b"-boost",
    b"-texres",
    b"-imfchan",
    b"-type",
    b"-colorspace",
];

struct Reader<'a, 'd> {
    source: Source<'a>,
    budget: &'d Budget,
    diagnostics: &'d mut Diagnostics,
}

impl<'a> Reader<'a, '_> {
    fn key(&mut self, m: &mut MtlMaterial, keyword: Word<'a>, words: Words<'a>) -> Result<(), FormatError> {
        let key = String::from_utf8_lossy(keyword.bytes).to_ascii_lowercase();
        match key.as_str() {
            "illum" => m.illumination = Some(self.number(keyword, words)?.clamp(0.0, 255.0) as u32),
            "kd" => m.diffuse = self.colour(keyword, words)?,
            "ks" => m.specular = self.colour(keyword, words)?,
            "ke" => m.emission = self.colour(keyword, words)?,
            "ns" => m.shininess = Some(self.number(keyword, words)?),
            "ni" => m.refraction = Some(self.number(keyword, words)?),
            "d" => {
                let halo = words.clone().next().is_some_and(|w| w.bytes == b"-halo");
                let mut words = words;
                if halo {
                    words.next();
                    self.warn(keyword, "d -halo is taken for d");
                }
                m.opacity = Some(self.number(keyword, words)?);
            }
            "tr" => {
                m.transparency = Some((self.number(keyword, words)?, self.source.place(keyword.start)));
            }
            "pr" => m.roughness = Some(self.number(keyword, words)?),
            "pm" => m.metallic = Some(self.number(keyword, words)?),
            "ps" => m.sheen = Some(self.number(keyword, words)?),
            "pc" => m.clearcoat = Some(self.number(keyword, words)?),
            "pcr" => m.clearcoat_roughness = Some(self.number(keyword, words)?),
            "aniso" => m.anisotropy = Some(self.number(keyword, words)?),
            "anisor" => m.anisotropy_rotation = Some(self.number(keyword, words)?),
            "map_pm" => m.metallic_map = self.texture(keyword, words)?,
            "map_ps" => m.sheen_map = self.texture(keyword, words)?,
            "map_kd" => m.diffuse_map = self.texture(keyword, words)?,
            "map_ke" => m.emission_map = self.texture(keyword, words)?,
            "map_d" | "map_tr" => m.opacity_map = self.texture(keyword, words)?,
            "map_pr" => m.roughness_map = self.texture(keyword, words)?,
            "bump" | "map_bump" | "disp" => m.bump_map = self.texture(keyword, words)?,
            "norm" => m.normal_map = self.texture(keyword, words)?,
            "tf" | "kt" => {
                let filter = self.colour(keyword, words)?;
                if filter.is_some_and(|filter| filter != Rgb::WHITE && !filter.is_black()) {
                    self.warn(keyword, "filter of light that passes a material is not used");
                }
            }
            // They have no effect in physically based rendering.
            "ka" | "map_ka" | "sharpness" | "map_aat" => {}
            "map_ks" | "map_ns" | "km" | "decal" | "refl" | "map_refl" => {
                let said = format!("{} of a material is not used", String::from_utf8_lossy(keyword.bytes));
                self.warn(keyword, &said);
            }
            _ => {
                let source = self.source;
                let known = [
                    "newmtl", "Kd", "Ks", "Ke", "Ns", "Ni", "d", "Tr", "illum", "Pr", "Pm", "Ps", "Pc",
                    "Pcr", "aniso", "anisor", "map_Kd", "map_Ke", "map_d", "map_Pr", "map_Pm", "map_Ps",
                    "bump", "norm",
                ];
                let text = String::from_utf8_lossy(&keyword.bytes[..keyword.bytes.len().min(64)]);
                self.diagnostics.warn("unknown key of a material is left out", |said| {
                    Diagnostic { severity: said.severity, ..source.wrong(keyword, said.message) }
                        .suggest(&text, known)
                });
            }
        }
        Ok(())
    }

    fn warn(&mut self, at: Word<'_>, what: &str) {
        let source = self.source;
        self.diagnostics.warn(what, |said| said.at(source.place(at.start)));
    }

    fn finite(&self, word: Word<'a>) -> Result<f32, FormatError> {
        let number = self.source.number(word)? as f32;
        if number.is_finite() { Ok(number) } else { Err(self.source.wrong(word, "not finite").into()) }
    }

    fn number(&self, keyword: Word<'a>, mut words: Words<'a>) -> Result<f32, FormatError> {
        match words.next() {
            Some(word) => self.finite(word),
            None => Err(self.source.wrong(keyword, "key without a number").into()),
        }
    }

    fn colour(&mut self, keyword: Word<'a>, words: Words<'a>) -> Result<Option<Rgb>, FormatError> {
        let mut numbers = [0.0; 3];
        let mut count = 0;
        for word in words {
            if matches!(word.bytes, b"xyz" | b"spectral") {
                self.warn(word, "colours by xyz or spectral curve are not used");
                return Ok(None);
            }
            let number = self.finite(word)?;
            if let Some(slot) = numbers.get_mut(count) {
                *slot = number;
            }
            count += 1;
        }
        match count {
            1 => Ok(Some(Rgb::splat(numbers[0]))),
            3 => Ok(Some(Rgb::from(numbers))),
            _ => {
                let wrong = Diagnostic::error("wrong number of values of a colour");
                Err(wrong.at(self.source.place(keyword.start)).found(count).expected("1 or 3").into())
            }
        }
    }

    /// Options, then a file name that may contain spaces.
    fn texture(
        &mut self,
        keyword: Word<'a>,
        mut words: Words<'a>,
    ) -> Result<Option<Box<MtlTexture>>, FormatError> {
        // Its file stands in a table too.
        let rest = words.clone().rest().1.len();
        self.budget.bytes((size_of::<MtlTexture>() + 2 * rest + 128) as u64, "textures")?;
        let mut texture = MtlTexture {
            file: String::new(),
            place: self.source.place(keyword.start),
            scale: [1.0; 2],
            offset: [0.0; 2],
            bump_multiplier: 1.0,
            range: [0.0, 1.0],
            clamp: false,
        };
        loop {
            let before = words.clone();
            let Some(word) = words.next() else {
                if texture.file.is_empty() {
                    self.warn(keyword, "texture without a file");
                    return Ok(None);
                }
                return Ok(Some(Box::new(texture)));
            };
            match word.bytes {
                b"-s" => [texture.scale[0], texture.scale[1], _] = self.vector(&mut words, word, 1.0)?,
                b"-o" => [texture.offset[0], texture.offset[1], _] = self.vector(&mut words, word, 0.0)?,
                b"-bm" => [texture.bump_multiplier] = self.exactly(&mut words, word)?,
                b"-mm" => texture.range = self.exactly(&mut words, word)?,
                b"-clamp" => texture.clamp = words.next().is_some_and(|w| w.bytes == b"on"),
                b"-t" => {
                    self.vector(&mut words, word, 0.0)?;
                    self.warn(word, "turbulence of a texture is not used");
                }
                b"-blendu" | b"-blendv" | b"-cc" | b"-boost" | b"-texres" => {
                    words.next();
                }
                b"-imfchan" | b"-type" | b"-colorspace" => {
                    let option = String::from_utf8_lossy(word.bytes).into_owned();
                    words.next();
                    self.warn(word, &format!("option {option} of a texture is not used"));
                }
                _ if texture.file.is_empty() => {
                    // Up to an option, which some programs write after the name.
                    let (at, whole) = before.rest();
                    let mut behind = words.clone();
                    let mut end = None;
                    while let Some(word) = words.next() {
                        if OPTIONS.contains(&word.bytes) {
                            end = Some(word.start - at);
                            break;
                        }
                        behind = words.clone();
                    }
                    words = behind;
                    let name = end.and_then(|end| whole.get(..end)).unwrap_or(&whole);
                    texture.file = name.trim_end().to_owned();
                    texture.place = self.source.place(at);
                }
                _ => self.warn(word, "unknown word after a texture"),
            }
        }
    }

    fn exactly<const N: usize>(
        &self,
        words: &mut Words<'a>,
        option: Word<'a>,
    ) -> Result<[f32; N], FormatError> {
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            let wrong = || self.source.wrong(option, "option of a texture without its numbers");
            let word = words.next().ok_or_else(|| wrong().expected(format!("{N}")))?;
            *number = self.finite(word)?;
        }
        Ok(numbers)
    }

    /// One to three numbers; missing ones are `rest`.
    fn vector(&self, words: &mut Words<'a>, option: Word<'a>, rest: f32) -> Result<[f32; 3], FormatError> {
        let [first] = self.exactly(words, option)?;
        let mut numbers = [first, rest, rest];
        for number in &mut numbers[1..] {
            let mut ahead = words.clone();
            let parsed = ahead.next().and_then(|word| self.finite(word).ok());
            let Some(parsed) = parsed else { break };
            // The file name may begin like a number, and is the last word.
            if ahead.clone().next().is_none() {
                break;
            }
            *number = parsed;
            *words = ahead;
        }
        Ok(numbers)
    }
}
