//! Pigments, normals, finishes, textures, interiors and materials.

use std::rc::Rc;
use std::sync::Arc;

use lumbre_math::Transform;
use lumbre_shading::Spectrum;
use lumbre_shading::pov::{
    Colour, ColourMap, Finish, ImageMap, Interior, Layer, Normal, NormalKind, Pattern, PatternKind, Pigment,
    PigmentKind, Texture, TextureKind, Warps,
};

use super::lexer::Kind;
use super::maps::{Map, default_blocks, default_colours};
use super::patterns::Draft;
use super::value::Value;
use super::{Parser, Result};

/// How strong the pattern of a normal is that does not say so.
const DEFAULT_BUMPS: f64 = 0.5;

pub(super) type FinishStatement = Finish;
pub(super) type InteriorStatement = Interior;

/// A texture with an interior.
#[derive(Clone, Debug, Default)]
pub(super) struct MaterialStatement {
    pub texture: Option<Arc<Texture>>,
    pub interior_texture: Option<Arc<Texture>>,
    pub interior: Option<Arc<Interior>>,
}

/// What a scene has set by `#default`.
#[derive(Clone, Debug)]
pub(super) struct Defaults {
    pub layer: Layer,
    /// A texture that is no single layer.
    pub texture: Option<Arc<Texture>>,
}

impl Defaults {
    pub(super) fn new() -> Self {
        let pigment = Arc::new(Pigment::plain(Colour::default()));
        Self { layer: Layer { pigment, normal: None, finish: Arc::new(Finish::DEFAULT) }, texture: None }
    }

    pub(super) fn texture(&self) -> Arc<Texture> {
        self.texture.clone().unwrap_or_else(|| Arc::new(Texture::plain(self.layer.clone())))
    }
}

impl Parser<'_, '_> {
    /// `#default { … }`.
    pub(super) fn default_directive(&mut self) -> Result<()> {
        self.expect(b'{')?;
        while !self.take(b'}')? {
            let Some(word) = self.word()? else {
                return Err(self.unexpected("texture, pigment, normal, finish"));
            };
            self.peeked = None;
            match &*word {
                "texture" => {
                    self.expect(b'{')?;
                    let texture = self.texture_body(b'}')?;
                    match &texture.kind {
                        TextureKind::Plain(layer) if texture.warps.0.is_empty() => {
                            self.defaults.layer = layer.clone();
                            self.defaults.texture = None;
                        }
                        _ => self.defaults.texture = Some(texture),
                    }
                }
                "pigment" | "normal" | "finish" => {
                    let mut layer = self.defaults.layer.clone();
                    self.layer_part(&word, &mut layer)?;
                    self.defaults.layer = layer;
                }
                "camera" => {
                    let camera = self.camera_block(self.default_camera.clone())?;
                    self.default_camera = camera;
                }
                "radiosity" | "interior" => {
                    self.expect(b'{')?;
                    self.skip_to(b'}')?;
                }
                _ => return Err(self.error("what cannot have a default")),
            }
        }
        Ok(())
    }

    /// A pigment up to a closing mark.
    pub(super) fn pigment_body(&mut self, base: Option<Arc<Pigment>>, end: u8) -> Result<Arc<Pigment>> {
        let mut draft = Draft::new(None, Warps::default(), false);
        let mut kind = PigmentKind::Colour(Colour::default());
        let mut map: Option<Rc<Map>> = None;
        let mut blocks: Vec<Arc<Pigment>> = Vec::new();
        // Whether the first block is a pigment: then those that are not given are black, else they have colours.
        let mut is_of_pigments = false;
        let mut is_average = false;
        if let Some(base) = base {
            (draft, kind) = opened(&base);
        }
        // Whether the braces of a pattern are open in which its parts stand.
        let mut in_pattern = false;
        loop {
            if in_pattern && self.take(b'}')? {
                in_pattern = false;
                continue;
            }
            if self.take(end)? {
                break;
            }
            if self.take(b',')? {
                continue;
            }
            if self.is_colour()? {
                let colour = self.colour()?.as_colour();
                match &draft.pattern {
                    Some(pattern) if pattern.is_block() => blocks.push(Arc::new(Pigment::plain(colour))),
                    _ => {
                        draft.pattern = None;
                        kind = PigmentKind::Colour(colour);
                    }
                }
                continue;
            }
            let Some(word) = self.word()? else { return Err(self.unexpected("a pigment")) };
            if let Some(found) = self.map(&word)? {
                map = Some(found);
                continue;
            }
            if let Some(found) = self.pattern_kind(&word)? {
                draft.begin(found, self.settings.generator);
                draft.word = Rc::clone(&word);
                continue;
            }
            if self.pattern_modifier(&word, &mut draft)? {
                continue;
            }
            match &*word {
                "pigment" => {
                    self.peeked = None;
                    self.expect(b'{')?;
                    is_of_pigments |= blocks.is_empty();
                    blocks.push(self.pigment_body(None, b'}')?);
                }
                "average" => {
                    self.peeked = None;
                    is_average = true;
                }
                "image_map" => {
                    self.peeked = None;
                    self.expect(b'{')?;
                    draft.pattern = None;
                    kind = PigmentKind::Image(Box::new(self.image_body()?));
                }
                "quick_color" | "quick_colour" => {
                    self.peeked = None;
                    self.colour()?;
                }
                "object" => {
                    self.peeked = None;
                    let kind = self.inside_pattern()?;
                    draft.begin(kind, self.settings.generator);
                    in_pattern = true;
                }
                "density" => {
                    self.peeked = None;
                    blocks.push(self.density_block()?);
                }
                "density_file" | "pavement" | "tiling" | "facets" => {
                    self.peeked = None;
                    self.warn(&format!("the pattern {word} is not rendered"));
                    if self.is_mark(b'{')? {
                        self.expect(b'{')?;
                        self.skip_to(b'}')?;
                    }
                    while matches!(self.peek()?, Some(Kind::Text(_) | Kind::Number(_)))
                        || matches!(
                            self.word()?.as_deref(),
                            Some("number_of_sides" | "number_of_tiles" | "pattern" | "interpolate" | "df3")
                        )
                    {
                        self.next()?;
                    }
                    draft.pattern = Some(Pattern::new(PatternKind::Noise, self.settings.generator));
                }
                _ => {
                    let Some(cell) = self.lookup(&word).cloned() else {
                        return Err(if super::words::is_reserved(&word) {
                            self.unexpected("a pigment")
                        } else {
                            self.undeclared(&word)
                        });
                    };
                    self.peeked = None;
                    let value = cell.borrow().clone();
                    match self.indexed(value)? {
                        Value::Pigment(base) if draft.pattern.as_ref().is_some_and(Pattern::is_block) => {
                            blocks.push(base)
                        }
                        Value::Pigment(base) | Value::Density(base) => (draft, kind) = opened(&base),
                        Value::Num(num) => kind = PigmentKind::Colour(num.as_colour()),
                        other => return Err(self.error(format!("a pigment is needed, not {}", other.name()))),
                    }
                }
            }
        }
        if is_of_pigments && let Some(count) = draft.pattern.as_ref().and_then(Pattern::block_count) {
            let black = Arc::new(Pigment::plain(Colour::default()));
            blocks.resize(count.max(blocks.len()), black);
        }
        let kind = self.pigment_kind(&mut draft, kind, map, blocks, is_average)?;
        Ok(Arc::new(Pigment { kind, warps: draft.warps, uv: draft.uv }))
    }

    fn pigment_kind(
        &mut self,
        draft: &mut Draft,
        kind: PigmentKind,
        map: Option<Rc<Map>>,
        mut blocks: Vec<Arc<Pigment>>,
        is_average: bool,
    ) -> Result<PigmentKind> {
        if is_average {
            return match map.as_deref() {
                Some(Map::Pigments(entries)) => Ok(PigmentKind::Average(entries.clone().into())),
                Some(Map::Colours(entries)) => Ok(PigmentKind::Average(
                    entries
                        .iter()
                        .map(|(weight, colour)| (*weight, Arc::new(Pigment::plain(*colour))))
                        .collect(),
                )),
                _ => Err(self.error("an average without a map")),
            };
        }
        let Some(pattern) = draft.pattern.take() else { return Ok(kind) };
        let pattern = Box::new(pattern);
        match (map.as_deref(), kind) {
            (Some(Map::Colours(entries)), _) => {
                Ok(PigmentKind::Map(pattern, Arc::new(ColourMap::new(entries.clone()))))
            }
            (Some(Map::Pigments(entries)), _) => Ok(PigmentKind::Pigments(pattern, entries.clone().into())),
            (Some(_), _) => Err(self.error("a pigment has a map of colours or pigments")),
            (None, PigmentKind::Map(_, map)) => Ok(PigmentKind::Map(pattern, map)),
            (None, PigmentKind::Pigments(_, map)) => Ok(PigmentKind::Pigments(pattern, map)),
            (None, PigmentKind::Blocks(_, known)) if blocks.is_empty() => {
                Ok(PigmentKind::Blocks(pattern, known))
            }
            (None, _) => match pattern.block_count() {
                Some(count) => {
                    let is_brick = matches!(pattern.kind, PatternKind::Brick { .. });
                    let rest = default_blocks(count, is_brick).into_iter().skip(blocks.len());
                    blocks.extend(rest.map(|colour| Arc::new(Pigment::plain(colour))));
                    Ok(PigmentKind::Blocks(pattern, blocks.into()))
                }
                None => {
                    let word = if self.is_density { "" } else { &*draft.word };
                    let map = ColourMap::new(default_colours(word));
                    Ok(PigmentKind::Map(pattern, Arc::new(map)))
                }
            },
        }
    }

    /// A normal up to a closing mark.
    pub(super) fn normal_body(&mut self, base: Option<Arc<Normal>>, end: u8) -> Result<Arc<Normal>> {
        let mut draft = Draft::new(None, Warps::default(), false);
        // That of a default normal holds for all others, too, and for those in their maps.
        let usual = self.defaults.layer.normal.as_ref().map_or(DEFAULT_BUMPS, |normal| normal.amount);
        let mut amount = usual;
        let mut accuracy = 0.02;
        let mut no_bump_scale = false;
        let mut special: Option<Rc<str>> = None;
        let mut map: Option<Rc<Map>> = None;
        let mut kept: Option<Arc<Normal>> = base;
        if let Some(base) = &kept {
            draft.warps = base.warps.clone();
            amount = base.amount;
        }
        let mut is_average = false;
        let mut is_ignored = false;
        let mut bump_map: Option<Box<ImageMap>> = None;
        let mut blocks: Vec<Arc<Normal>> = Vec::new();
        let mut in_pattern = false;
        loop {
            if in_pattern && self.take(b'}')? {
                in_pattern = false;
                continue;
            }
            if self.take(end)? {
                break;
            }
            if self.take(b',')? {
                continue;
            }
            // The amount stands behind the pattern.
            let has_kind = draft.pattern.is_some() || bump_map.is_some() || kept.is_some();
            if (has_kind || is_average || is_ignored)
                && let Some(Kind::Number(_) | Kind::Mark(b'-' | b'+' | b'(' | b'.')) = self.peek()?
            {
                amount = self.finite()?;
                continue;
            }
            let Some(word) = self.word()? else { return Err(self.unexpected("a normal")) };
            if let Some(found) = self.map(&word)? {
                map = Some(found);
                continue;
            }
            if let Some(found) = self.pattern_kind(&word)? {
                draft.begin(found, self.settings.generator);
                special = Some(word);
                amount = usual;
                continue;
            }
            if self.pattern_modifier(&word, &mut draft)? {
                continue;
            }
            self.peeked = None;
            match &*word {
                "bump_size" => amount = self.finite()?,
                "accuracy" => accuracy = self.finite()?.max(1e-9),
                "no_bump_scale" => no_bump_scale = self.optional_bool()?,
                "average" => is_average = true,
                "normal" => {
                    self.expect(b'{')?;
                    blocks.push(self.normal_body(None, b'}')?);
                }
                "object" => {
                    let kind = self.inside_pattern()?;
                    draft.begin(kind, self.settings.generator);
                    special = Some(word);
                    in_pattern = true;
                }
                "bump_map" => {
                    self.expect(b'{')?;
                    let (image, bump_size) = self.bump_map_body()?;
                    amount = bump_size.unwrap_or(usual);
                    bump_map = Some(Box::new(image));
                }
                "facets" | "density_file" | "tiling" | "pavement" => {
                    self.warn(&format!("the normal {word} is not rendered"));
                    is_ignored = true;
                    if self.is_mark(b'{')? {
                        self.expect(b'{')?;
                        self.skip_to(b'}')?;
                    }
                    while matches!(self.peek()?, Some(Kind::Text(_) | Kind::Number(_)))
                        || matches!(self.word()?.as_deref(), Some("coords" | "size" | "interpolate" | "df3"))
                        || self.is_mark(b',')?
                    {
                        self.next()?;
                    }
                }
                _ => {
                    let value = match self.lookup(&word).cloned() {
                        Some(cell) => self.indexed(cell.borrow().clone())?,
                        None if super::words::is_reserved(&word) => {
                            return Err(self.error(format!("{word} has no meaning in a normal")));
                        }
                        None => return Err(self.undeclared(&word)),
                    };
                    match value {
                        Value::Normal(known) => {
                            draft.warps = known.warps.clone();
                            amount = known.amount;
                            kept = Some(known);
                        }
                        Value::Num(num) if draft.pattern.is_some() => amount = num.v[0],
                        other => return Err(self.error(format!("a normal is needed, not {}", other.name()))),
                    }
                }
            }
        }
        let kind = if is_average {
            match map.as_deref() {
                Some(Map::Normals(entries)) => NormalKind::Average(entries.clone().into()),
                _ => return Err(self.error("an average without a map")),
            }
        } else if let Some(image) = bump_map {
            NormalKind::BumpMap(image)
        } else if let Some(pattern) = draft.pattern {
            normal_kind(pattern, special.as_deref(), map.as_deref(), blocks)
        } else if let Some(known) = kept.as_ref().filter(|_| !is_ignored) {
            accuracy = known.accuracy;
            no_bump_scale |= known.no_bump_scale;
            match &known.kind {
                NormalKind::Slope { pattern, .. } if map.is_some() => {
                    normal_kind((**pattern).clone(), None, map.as_deref(), blocks)
                }
                kind => kind.clone(),
            }
        } else if map.is_some() && !is_ignored {
            return Err(self.error("a normal without a pattern"));
        } else {
            NormalKind::Average(Arc::from([]))
        };
        Ok(Arc::new(Normal { kind, warps: draft.warps, amount, accuracy, no_bump_scale, uv: draft.uv }))
    }

    /// A texture up to a closing mark.
    pub(super) fn texture_body(&mut self, end: u8) -> Result<Arc<Texture>> {
        let mut layer = self.defaults.layer.clone();
        let mut base: Option<Arc<Texture>> = self.defaults.texture.clone();
        let mut layers: Vec<Arc<Texture>> = Vec::new();
        let mut blocks: Vec<Arc<Texture>> = Vec::new();
        let mut map: Option<Rc<Map>> = None;
        let mut draft = Draft::new(None, Warps::default(), false);
        let mut is_average = false;
        let mut in_pattern = false;
        loop {
            if in_pattern && self.take(b'}')? {
                in_pattern = false;
                continue;
            }
            if self.take(end)? {
                break;
            }
            if self.take(b',')? {
                continue;
            }
            let Some(word) = self.word()? else { return Err(self.unexpected("a texture")) };
            match &*word {
                "object" => {
                    self.peeked = None;
                    let kind = self.inside_pattern()?;
                    draft.begin(kind, self.settings.generator);
                    in_pattern = true;
                    continue;
                }
                "pigment" | "normal" | "finish" => {
                    self.peeked = None;
                    // Of layers, the top one changes.
                    if let Some(known) = &base
                        && matches!(known.kind, TextureKind::Layers(_))
                    {
                        let known = Arc::clone(known);
                        base = Some(self.changed_texture(&word, &known)?);
                        continue;
                    }
                    // What is known changes; where it has been moved, this is written into what has been moved.
                    if let Some(known) = &base
                        && let TextureKind::Plain(inner) = &known.kind
                    {
                        layer = inner.clone();
                    }
                    self.layer_part(&word, &mut layer)?;
                    base = base.and_then(|known| match &known.kind {
                        TextureKind::Plain(_) => Some(Arc::new(Texture {
                            kind: TextureKind::Plain(layer.clone()),
                            warps: known.warps.clone(),
                            uv: known.uv,
                        })),
                        _ => None,
                    });
                    continue;
                }
                "texture" => {
                    self.peeked = None;
                    self.expect(b'{')?;
                    let inner = self.texture_body(b'}')?;
                    if draft.pattern.is_some() {
                        blocks.push(inner)
                    } else {
                        layers.push(inner)
                    }
                    continue;
                }
                "average" => {
                    self.peeked = None;
                    is_average = true;
                    continue;
                }
                "material_map" => {
                    self.peeked = None;
                    self.warn("material_map is not rendered");
                    self.expect(b'{')?;
                    self.skip_to(b'}')?;
                    continue;
                }
                "tiles" | "tile2" => {
                    self.peeked = None;
                    if &*word == "tiles" {
                        draft.pattern = Some(Pattern::new(PatternKind::Checker, self.settings.generator));
                        self.expect(b'{')?;
                        while !self.take(b'}')? {
                            if self.take_word("tile2")? {
                                continue;
                            }
                            if !self.take_word("texture")? {
                                return Err(self.unexpected("the texture of a tile"));
                            }
                            self.expect(b'{')?;
                            blocks.push(self.texture_body(b'}')?);
                        }
                    }
                    continue;
                }
                _ => {}
            }
            if let Some(found) = self.map(&word)? {
                map = Some(found);
                continue;
            }
            if let Some(found) = self.pattern_kind(&word)? {
                draft.pattern = Some(Pattern::new(found, self.settings.generator));
                continue;
            }
            // Transforms move what is written before them.
            if draft.pattern.is_none()
                && map.is_none()
                && let Some(moved) = self.transform()?
            {
                let known = base.take().unwrap_or_else(|| Arc::new(Texture::plain(layer.clone())));
                base = Some(known.moved(&moved));
                layers.iter_mut().for_each(|layer| *layer = layer.moved(&moved));
                continue;
            }
            if self.pattern_modifier(&word, &mut draft)? {
                continue;
            }
            let Some(cell) = self.lookup(&word).cloned() else {
                return Err(if super::words::is_reserved(&word) {
                    self.unexpected("a texture")
                } else {
                    self.undeclared(&word)
                });
            };
            self.peeked = None;
            let value = cell.borrow().clone();
            match self.indexed(value)? {
                Value::Texture(known) if draft.pattern.is_some() => blocks.push(known),
                Value::Texture(known) => base = Some(known),
                Value::Pigment(pigment) => layer.pigment = pigment,
                other => return Err(self.error(format!("a texture is needed, not {}", other.name()))),
            }
        }
        let kind = match (draft.pattern, map.as_deref()) {
            _ if is_average => match map.as_deref() {
                Some(Map::Textures(entries)) => TextureKind::Average(entries.clone().into()),
                _ => return Err(self.error("an average without a map")),
            },
            (Some(pattern), Some(Map::Textures(entries))) => {
                TextureKind::Map(Box::new(pattern), entries.clone().into())
            }
            (Some(pattern), None) if !blocks.is_empty() => {
                TextureKind::Blocks(Box::new(pattern), blocks.into())
            }
            (Some(_), _) => return Err(self.error("the pattern of a texture needs textures")),
            (None, _) => {
                return Ok(match layers.len() {
                    0 => {
                        let texture = base.unwrap_or_else(|| Arc::new(Texture::plain(layer)));
                        if draft.uv { Arc::new(Texture { uv: true, ..(*texture).clone() }) } else { texture }
                    }
                    1 => layers.swap_remove(0),
                    _ => Arc::new(Texture {
                        kind: TextureKind::Layers(layers.into()),
                        warps: Warps::default(),
                        uv: draft.uv,
                    }),
                });
            }
        };
        Ok(Arc::new(Texture { kind, warps: draft.warps, uv: draft.uv }))
    }

    /// A texture with another pigment, normal or finish, whose word was taken; of layers, the top one has it.
    pub(super) fn changed_texture(&mut self, word: &str, known: &Arc<Texture>) -> Result<Arc<Texture>> {
        let changed = |layer: Layer, known: &Texture| {
            Arc::new(Texture { kind: TextureKind::Plain(layer), warps: known.warps.clone(), uv: known.uv })
        };
        match &known.kind {
            TextureKind::Plain(layer) => {
                let mut layer = layer.clone();
                self.layer_part(word, &mut layer)?;
                Ok(changed(layer, known))
            }
            TextureKind::Layers(layers) => {
                let mut layers = layers.to_vec();
                if let Some(top) = layers.last_mut() {
                    *top = self.changed_texture(word, top)?;
                }
                let kind = TextureKind::Layers(layers.into());
                Ok(Arc::new(Texture { kind, warps: known.warps.clone(), uv: known.uv }))
            }
            _ => {
                let mut layer = self.defaults.layer.clone();
                self.layer_part(word, &mut layer)?;
                Ok(Arc::new(Texture::plain(layer)))
            }
        }
    }

    /// The pigment, the normal or the finish of a layer, whose word was taken: what it says changes what is there.
    pub(super) fn layer_part(&mut self, word: &str, layer: &mut Layer) -> Result<()> {
        match word {
            "pigment" => {
                self.expect(b'{')?;
                layer.pigment = self.pigment_body(Some(Arc::clone(&layer.pigment)), b'}')?;
            }
            "normal" => {
                self.expect(b'{')?;
                layer.normal = Some(self.normal_body(layer.normal.clone(), b'}')?);
            }
            _ => layer.finish = Arc::new(self.finish_block((*layer.finish).clone())?),
        }
        Ok(())
    }

    /// A finish in braces, from what it is without them.
    pub(super) fn finish_block(&mut self, mut finish: Finish) -> Result<Finish> {
        self.expect(b'{')?;
        while !self.take(b'}')? {
            let Some(word) = self.word()? else { return Err(self.unexpected("a finish")) };
            self.peeked = None;
            match &*word {
                "ambient" => finish.ambient = self.rgb()?,
                "emission" => finish.emission = self.rgb()?,
                "diffuse" => {
                    finish.diffuse_albedo = self.take_word("albedo")?;
                    finish.diffuse = self.finite()? as f32;
                    finish.diffuse_back = if self.take(b',')? { self.finite()? as f32 } else { 0.0 };
                }
                "brilliance" => finish.brilliance = self.finite()? as f32,
                "crand" => finish.crand = self.finite()? as f32,
                "phong" => {
                    finish.phong_albedo = self.take_word("albedo")?;
                    finish.phong = self.finite()? as f32;
                }
                "phong_size" => finish.phong_size = self.finite()? as f32,
                "specular" => {
                    finish.specular_albedo = self.take_word("albedo")?;
                    finish.specular = self.finite()? as f32;
                }
                "roughness" => finish.roughness = self.finite()?.max(1e-9) as f32,
                "metallic" => finish.metallic = self.optional_float(1.0)? as f32,
                "reflection" => self.reflection(&mut finish)?,
                "reflection_exponent" => finish.reflection.exponent = self.finite()? as f32,
                "conserve_energy" => finish.conserve_energy = self.optional_bool()?,
                "irid" => {
                    self.expect(b'{')?;
                    finish.irid = [self.finite()? as f32, 0.0, 0.0];
                    loop {
                        if self.take_word("thickness")? {
                            finish.irid[1] = self.finite()? as f32;
                        } else if self.take_word("turbulence")? {
                            finish.irid[2] = self.float()? as f32;
                        } else {
                            break;
                        }
                    }
                    self.expect(b'}')?;
                }
                "subsurface" => {
                    self.warn("subsurface is not rendered");
                    self.expect(b'{')?;
                    self.skip_to(b'}')?;
                }
                "use_alpha" => {
                    self.optional_bool()?;
                }
                "fresnel" => {
                    self.optional_bool()?;
                }
                // Old words that became those of the interior.
                "ior" | "caustics" | "fade_power" | "fade_distance" | "refraction" | "irid_wavelength" => {
                    self.expression()?;
                }
                _ => match self.known(&word)? {
                    Some(Value::Finish(known)) => finish = (*known).clone(),
                    Some(other) => {
                        return Err(self.error(format!("a finish is needed, not {}", other.name())));
                    }
                    None if super::words::is_reserved(&word) => {
                        return Err(self.error(format!("{word} has no meaning in a finish")));
                    }
                    None => return Err(self.undeclared(&word)),
                },
            }
        }
        Ok(finish)
    }

    pub(super) fn rgb(&mut self) -> Result<Spectrum> {
        Ok(self.colour()?.as_colour().rgb)
    }

    fn optional_float(&mut self, otherwise: f64) -> Result<f64> {
        match self.peek()? {
            Some(Kind::Number(_) | Kind::Mark(b'(' | b'-' | b'+')) => self.finite(),
            Some(Kind::Word(word)) => {
                let word = Rc::clone(word);
                match self.lookup(&word).map(|cell| cell.borrow().clone()) {
                    Some(Value::Num(_)) => self.finite(),
                    _ if matches!(&*word, "on" | "off" | "yes" | "no" | "true" | "false") => self.finite(),
                    _ => Ok(otherwise),
                }
            }
            _ => Ok(otherwise),
        }
    }

    fn reflection(&mut self, finish: &mut Finish) -> Result<()> {
        let mirror = &mut finish.reflection;
        if !self.take(b'{')? {
            let colour = self.rgb()?;
            (mirror.least, mirror.most, mirror.fresnel, mirror.falloff) = (colour, colour, false, 1.0);
            return Ok(());
        }
        let first = self.rgb()?;
        let mut second = None;
        if self.take(b',')? || self.is_colour()? || matches!(self.peek()?, Some(Kind::Number(_))) {
            second = Some(self.rgb()?);
        }
        let mut mirror = lumbre_shading::pov::Reflection::NONE;
        while !self.take(b'}')? {
            let Some(word) = self.word()? else { return Err(self.unexpected("what modifies a reflection")) };
            self.peeked = None;
            match &*word {
                "falloff" => mirror.falloff = self.finite()? as f32,
                "fresnel" => mirror.fresnel = self.optional_bool()?,
                "exponent" => mirror.exponent = self.finite()? as f32,
                "metallic" => mirror.metallic = self.optional_float(1.0)? as f32,
                _ => return Err(self.error(format!("{word} has no meaning in a reflection"))),
            }
        }
        (mirror.least, mirror.most) = match second {
            Some(second) => (first, second),
            None if mirror.fresnel => (Spectrum::BLACK, first),
            None => (first, first),
        };
        finish.reflection = mirror;
        Ok(())
    }

    /// An interior in braces.
    pub(super) fn interior_block(&mut self) -> Result<Arc<Interior>> {
        self.expect(b'{')?;
        let mut interior = Interior::DEFAULT;
        while !self.take(b'}')? {
            if let Some(map) = self.transform()? {
                interior = with_moved_media(&interior, &map);
                continue;
            }
            let Some(word) = self.word()? else { return Err(self.unexpected("an interior")) };
            self.peeked = None;
            match &*word {
                "ior" => interior.ior = self.finite()? as f32,
                "caustics" => interior.caustics = self.finite()? as f32,
                "fade_distance" => interior.fade_distance = self.finite()? as f32,
                "fade_power" => interior.fade_power = self.finite()? as f32,
                "fade_color" | "fade_colour" => interior.fade_colour = self.rgb()?,
                "dispersion" => interior.dispersion = self.finite()? as f32,
                "dispersion_samples" => {
                    self.float()?;
                }
                "media" => {
                    let media = self.media_block()?;
                    self.budget.bytes(size_of_val(&media) as u64, "media")?;
                    interior.media.push(media);
                }
                _ => match self.known(&word)? {
                    Some(Value::Interior(known)) => interior = (*known).clone(),
                    Some(Value::Media(known)) => interior.media.push((*known).clone()),
                    Some(other) => {
                        return Err(self.error(format!("an interior is needed, not {}", other.name())));
                    }
                    None if super::words::is_reserved(&word) => {
                        return Err(self.error(format!("{word} has no meaning in an interior")));
                    }
                    None => return Err(self.undeclared(&word)),
                },
            }
        }
        Ok(Arc::new(interior))
    }

    /// A material in braces.
    pub(super) fn material_block(&mut self) -> Result<MaterialStatement> {
        self.expect(b'{')?;
        let mut material = MaterialStatement::default();
        while !self.take(b'}')? {
            if let Some(map) = self.transform()? {
                material.texture = material.texture.map(|texture| texture.moved(&map));
                material.interior = material.interior.map(|interior| moved_interior(interior, &map));
                continue;
            }
            let Some(word) = self.word()? else { return Err(self.unexpected("a material")) };
            self.peeked = None;
            match &*word {
                "texture" => {
                    self.expect(b'{')?;
                    let texture = self.texture_body(b'}')?;
                    material.texture = Some(layered(material.texture, texture));
                }
                "interior_texture" => {
                    self.expect(b'{')?;
                    material.interior_texture = Some(self.texture_body(b'}')?);
                }
                "interior" => material.interior = Some(self.interior_block()?),
                _ => match self.known(&word)? {
                    Some(Value::Material(known)) => material = (*known).clone(),
                    Some(other) => {
                        return Err(self.error(format!("a material is needed, not {}", other.name())));
                    }
                    None => return Err(self.undeclared(&word)),
                },
            }
        }
        Ok(material)
    }
}

/// An interior that is moved: the same one where there is nothing in it that has a place.
pub(super) fn moved_interior(interior: Arc<Interior>, map: &Arc<Transform>) -> Arc<Interior> {
    if interior.media.is_empty() { interior } else { Arc::new(with_moved_media(&interior, map)) }
}

/// An interior whose media are moved.
pub(super) fn with_moved_media(interior: &Interior, map: &Arc<Transform>) -> Interior {
    let media = interior.media.iter().map(|media| media.moved(map)).collect();
    Interior { media, ..interior.clone() }
}

/// A texture on top of others.
pub(super) fn layered(below: Option<Arc<Texture>>, top: Arc<Texture>) -> Arc<Texture> {
    let Some(below) = below else { return top };
    let mut layers: Vec<Arc<Texture>> = match &below.kind {
        TextureKind::Layers(layers) if below.warps.0.is_empty() => layers.to_vec(),
        _ => vec![Arc::clone(&below)],
    };
    layers.push(top);
    Arc::new(Texture { kind: TextureKind::Layers(layers.into()), warps: Warps::default(), uv: false })
}

/// A pigment taken apart, to be changed.
fn opened(pigment: &Arc<Pigment>) -> (Draft, PigmentKind) {
    let pattern = match &pigment.kind {
        PigmentKind::Map(pattern, _)
        | PigmentKind::Pigments(pattern, _)
        | PigmentKind::Blocks(pattern, _) => Some((**pattern).clone()),
        _ => None,
    };
    (Draft::new(pattern, pigment.warps.clone(), pigment.uv), pigment.kind.clone())
}

fn normal_kind(
    pattern: Pattern,
    word: Option<&str>,
    map: Option<&Map>,
    blocks: Vec<Arc<Normal>>,
) -> NormalKind {
    let pattern = Box::new(pattern);
    match (map, word) {
        (Some(Map::Normals(entries)), _) => NormalKind::Normals(pattern, entries.clone().into()),
        (Some(Map::Slopes(entries)), _) => NormalKind::Slope { pattern, map: Some(entries.clone().into()) },
        _ if !blocks.is_empty() => {
            let entries = blocks.into_iter().enumerate().map(|(i, normal)| (i as f64, normal)).collect();
            NormalKind::Normals(pattern, entries)
        }
        (_, Some("bumps")) => NormalKind::Bumps(pattern),
        (_, Some("dents")) => NormalKind::Dents(pattern),
        (_, Some("wrinkles")) => NormalKind::Wrinkles(pattern),
        (_, Some("ripples" | "waves")) => NormalKind::Waves(pattern),
        (_, Some("quilted")) => NormalKind::Quilted(pattern),
        _ => NormalKind::Slope { pattern, map: None },
    }
}
