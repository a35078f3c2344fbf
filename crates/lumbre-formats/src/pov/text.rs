//! Texts as solids: the outlines of a TrueType font.

use std::collections::HashMap;
use std::rc::Rc;
use std::sync::Arc;

use lumbre_math::{DAffine3, DMat3, DVec2, DVec3, Transform};
use ttf_parser::{Face, GlyphId, OutlineBuilder};

use super::objects::{Form, Object, Operation};
use super::swept::{Outline, Swept};
use super::{Parser, Result};
use crate::diagnostic::quoted;
use crate::{Diagnostic, Input};

/// The outline of a glyph, as it is drawn.
struct Pen {
    outline: Outline,
    offset: DVec2,
    scale: f64,
    start: DVec2,
    at: DVec2,
}

impl Pen {
    fn place(&self, x: f32, y: f32) -> DVec2 {
        DVec2::new(f64::from(x), f64::from(y)) * self.scale + self.offset
    }
}

impl OutlineBuilder for Pen {
    fn move_to(&mut self, x: f32, y: f32) {
        self.start = self.place(x, y);
        self.at = self.start;
    }

    fn line_to(&mut self, x: f32, y: f32) {
        let to = self.place(x, y);
        self.outline.line(self.at, to);
        self.at = to;
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        let to = self.place(x, y);
        self.outline.parabola(self.at, self.place(x1, y1), to);
        self.at = to;
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        let to = self.place(x, y);
        self.outline.bezier([self.at, self.place(x1, y1), self.place(x2, y2), to]);
        self.at = to;
    }

    fn close(&mut self) {
        if self.at != self.start {
            self.outline.line(self.at, self.start);
            self.at = self.start;
        }
    }
}

impl Parser<'_, '_> {
    /// A text, up to what modifies it: each glyph is a prism.
    pub(super) fn text(&mut self) -> Result<Form> {
        if self.take_word("internal")? {
            self.float()?;
            self.warn("the fonts inside POV-Ray are not there: the text is not rendered");
            self.string()?;
            self.comma()?;
            self.float()?;
            self.comma()?;
            self.vector()?;
            return Ok(Form::Nothing);
        }
        self.take_word("ttf")?;
        let name = self.file_name()?;
        self.comma()?;
        let text = self.string()?;
        self.comma()?;
        let thickness = self.finite()?;
        self.comma()?;
        let offset = self.vector()?.truncate();
        let Some(bytes) = self.font(&name)? else { return Ok(Form::Nothing) };
        let Ok(face) = Face::parse(&bytes, 0) else {
            return Err(self.error("a font that cannot be read"));
        };
        let scale = 1.0 / f64::from(face.units_per_em());
        let mut glyphs: Vec<Rc<Object>> = Vec::new();
        let mut at = DVec2::ZERO;
        let mut before: Option<GlyphId> = None;
        for c in text.chars() {
            let glyph = face.glyph_index(c).unwrap_or(GlyphId(0));
            if before.is_none() {
                // The first glyph begins at 0.
                at.x = -face.glyph_bounding_box(glyph).map_or(0.0, |b| f64::from(b.x_min)) * scale;
            }
            at.x += before.map_or(0.0, |before| f64::from(kerning(&face, before, glyph)) * scale);
            let mut pen =
                Pen { outline: Outline::default(), offset: at, scale, start: DVec2::ZERO, at: DVec2::ZERO };
            face.outline_glyph(glyph, &mut pen);
            if !pen.outline.is_empty() {
                self.budget.elements(1, "glyphs")?;
                self.budget.bytes(4096, "glyphs")?;
                let swept = Swept::Prism {
                    outline: pen.outline,
                    heights: [0.0, thickness],
                    conic: false,
                    open: false,
                };
                let mut object = Object::new(Form::Swept(Arc::new(swept)));
                // What is up in a prism goes into the picture, and its z is up.
                let axes = DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::Y);
                if let Ok(map) = Transform::from_affine(DAffine3::from_mat3(axes)) {
                    object.transform = map;
                }
                glyphs.push(Rc::new(object));
            }
            at.x += f64::from(face.glyph_hor_advance(glyph).unwrap_or(0)) * scale + offset.x;
            at.y += offset.y;
            before = Some(glyph);
        }
        Ok(Form::Group(Operation::Union, glyphs))
    }

    /// The bytes of a font; nothing, with a warning, where it is not there.
    fn font(&mut self, name: &str) -> Result<Option<Rc<Vec<u8>>>> {
        if let Some(font) = self.fonts.get(name) {
            return Ok(Some(Rc::clone(font)));
        }
        let with_ending = format!("{name}.ttf");
        let Some(path) = self.find(name).or_else(|| self.find(&with_ending)) else {
            let wrong =
                Diagnostic::warning("a font that is not there: its text is not rendered").found(quoted(name));
            let wrong =
                self.diagnostic(wrong.expected("a file beside the scene or in a folder of --pov-include"));
            self.diagnostics.push(wrong);
            return Ok(None);
        };
        let bytes = Rc::new(Input::open(&path, self.budget)?.into_bytes());
        self.fonts.insert(name.to_owned(), Rc::clone(&bytes));
        Ok(Some(bytes))
    }
}

fn kerning(face: &Face<'_>, left: GlyphId, right: GlyphId) -> i16 {
    let Some(kern) = face.tables().kern else { return 0 };
    let horizontal = kern.subtables.into_iter().filter(|table| table.horizontal && !table.has_state_machine);
    horizontal.filter_map(|table| table.glyphs_kerning(left, right)).next().unwrap_or(0)
}

/// Fonts by their names.
pub(super) type Fonts = HashMap<String, Rc<Vec<u8>>>;
