//! Maps: what the values of a pattern become.

use std::rc::Rc;
use std::sync::Arc;

use lumbre_shading::Spectrum;
use lumbre_shading::pov::function::Unary;
use lumbre_shading::pov::{Colour, Normal, Pigment, Texture};

use super::expression::begins_colour;
use super::lexer::Kind;
use super::value::Value;
use super::{Parser, Result};

/// A map by what it holds.
#[derive(Clone, Debug)]
pub(super) enum Map {
    Colours(Vec<(f64, Colour)>),
    Pigments(Vec<(f64, Arc<Pigment>)>),
    Normals(Vec<(f64, Arc<Normal>)>),
    Textures(Vec<(f64, Arc<Texture>)>),
    /// Heights with their slopes.
    Slopes(Vec<(f64, [f64; 2])>),
}

impl Parser<'_, '_> {
    /// The map of a word, which comes next; `None` if it is the word of none.
    pub(super) fn map(&mut self, word: &str) -> Result<Option<Rc<Map>>> {
        let is_map = matches!(
            word,
            "color_map"
                | "colour_map"
                | "pigment_map"
                | "normal_map"
                | "texture_map"
                | "slope_map"
                | "density_map"
        );
        if !is_map {
            return Ok(None);
        }
        self.peeked = None;
        self.expect(b'{')?;
        // The name of another one.
        let mut map = None;
        if let Some(name) = self.word()?
            && let Some(Value::Map(known)) = self.lookup(&name).map(|cell| cell.borrow().clone())
        {
            self.peeked = None;
            map = Some(known);
        }
        if let Some(map) = map {
            self.expect(b'}')?;
            return Ok(Some(map));
        }
        let map = match word {
            "color_map" | "colour_map" => Map::Colours(self.colour_entries()?),
            "pigment_map" => Map::Pigments(self.entries(|parser| parser.pigment_body(None, b']'))?),
            "density_map" => Map::Pigments(self.entries(|parser| parser.density_body(b']'))?),
            "normal_map" => Map::Normals(self.entries(|parser| parser.normal_body(None, b']'))?),
            "texture_map" => Map::Textures(self.entries(|parser| parser.texture_body(b']'))?),
            _ => Map::Slopes(self.entries(|parser| {
                let v = parser.vector()?;
                parser.expect(b']')?;
                Ok([v.x, v.y])
            })?),
        };
        Ok(Some(Rc::new(map)))
    }

    /// `[value what]` up to a closing brace. What reads the entry takes its `]`.
    fn entries<T>(&mut self, mut read: impl FnMut(&mut Self) -> Result<T>) -> Result<Vec<(f64, T)>> {
        let mut entries: Vec<(f64, T)> = Vec::new();
        while !self.take(b'}')? {
            self.expect(b'[')?;
            // Of an average, the weight may be left out.
            let v = if self.is_number()? { self.finite()? } else { 1.0 };
            self.comma()?;
            self.budget.bytes(size_of::<(f64, T)>() as u64, "maps")?;
            entries.push((v, read(self)?));
            self.comma()?;
        }
        entries.sort_by(|a, b| a.0.total_cmp(&b.0));
        if entries.is_empty() {
            return Err(self.error("a map without entries"));
        }
        Ok(entries)
    }

    /// Whether a number comes next.
    pub(super) fn is_number(&mut self) -> Result<bool> {
        let word = match self.peek()? {
            Some(Kind::Number(_) | Kind::Mark(b'-' | b'+' | b'(' | b'!')) => return Ok(true),
            Some(Kind::Word(word)) => Rc::clone(word),
            _ => return Ok(false),
        };
        if Unary::from_name(&word).is_some() || self.constant(&word).is_some_and(|num| num.n == 1) {
            return Ok(true);
        }
        Ok(match self.lookup(&word).map(|cell| cell.borrow().clone()) {
            Some(Value::Num(num)) => num.n == 1,
            Some(Value::Array(array)) => {
                matches!(array.elements.first(), Some(Value::Num(num)) if num.n == 1)
            }
            Some(Value::Function(_)) => true,
            _ => {
                matches!(&*word, "pow" | "min" | "max" | "mod" | "rand" | "div" | "atan2" | "select" | "val")
            }
        })
    }

    fn colour_entries(&mut self) -> Result<Vec<(f64, Colour)>> {
        let mut entries = Vec::new();
        while !self.take(b'}')? {
            self.expect(b'[')?;
            let v = self.finite()?;
            let has_comma = self.take(b',')?;
            self.budget.bytes(size_of::<(f64, Colour)>() as u64, "maps")?;
            if (has_comma || matches!(self.peek()?, Some(Kind::Number(_)))) && !self.is_colour()? {
                let end = self.finite()?;
                self.comma()?;
                let first = self.colour()?.as_colour();
                self.comma()?;
                let second = self.colour()?.as_colour();
                entries.extend([(v, first), (end, second)]);
            } else {
                entries.push((v, self.colour()?.as_colour()));
            }
            self.expect(b']')?;
            self.comma()?;
        }
        entries.sort_by(|a: &(f64, Colour), b| a.0.total_cmp(&b.0));
        if entries.is_empty() {
            return Err(self.error("a map without entries"));
        }
        Ok(entries)
    }

    /// Whether a colour comes next, by its word, its vector, or its name.
    pub(super) fn is_colour(&mut self) -> Result<bool> {
        Ok(match self.peek()? {
            Some(Kind::Mark(b'<')) => true,
            Some(Kind::Word(word)) => {
                let word = Rc::clone(word);
                if begins_colour(&word) {
                    return Ok(true);
                }
                match self.lookup(&word).map(|cell| cell.borrow().clone()) {
                    Some(Value::Num(num)) => num.n > 1,
                    Some(Value::Array(array)) => {
                        matches!(array.elements.first(), Some(Value::Num(num)) if num.n > 1)
                    }
                    _ => false,
                }
            }
            _ => false,
        })
    }

    /// Skips to the mark that closes what is open, and past it.
    pub(super) fn skip_to(&mut self, mark: u8) -> Result<()> {
        let mut open = 0_u32;
        loop {
            match self.next()? {
                Kind::Mark(found) if found == mark && open == 0 => return Ok(()),
                Kind::Mark(b'{' | b'[' | b'(') => open += 1,
                Kind::Mark(b'}' | b']' | b')') if open > 0 => open -= 1,
                Kind::Mark(found @ (b'}' | b']' | b')')) => {
                    return Err(self.error(format!("unexpected {}", found as char)));
                }
                _ => {}
            }
        }
    }
}

/// The colours that a block pattern has unless a scene gives some.
pub(super) fn default_blocks(count: usize, is_brick: bool) -> Vec<Colour> {
    let colour = |r, g, b| Colour::opaque(Spectrum::new(r, g, b));
    if is_brick {
        return vec![colour(0.5, 0.5, 0.5), colour(0.6, 0.15, 0.15)];
    }
    let (red, green, blue) = (colour(1.0, 0.0, 0.0), colour(0.0, 1.0, 0.0), colour(0.0, 0.0, 1.0));
    if count <= 3 {
        return [blue, green, red].into_iter().take(count.max(1)).collect();
    }
    let all = [red, green, blue, colour(1.0, 1.0, 0.0), colour(0.0, 1.0, 1.0), colour(1.0, 0.0, 1.0)];
    all.into_iter().cycle().take(count.max(1)).collect()
}

/// The colours that a continuous pattern has unless a scene gives some.
pub(super) fn default_colours(word: &str) -> Vec<(f64, Colour)> {
    let entry = |v: f64, r: f32, g: f32, b: f32| (v, Colour::opaque(Spectrum::new(r, g, b)));
    match word {
        "agate" => vec![
            entry(0.0, 1.0, 1.0, 1.0),
            entry(0.5, 0.95, 0.75, 0.5),
            entry(0.5, 0.9, 0.7, 0.5),
            entry(0.6, 0.9, 0.7, 0.4),
            entry(0.6, 1.0, 0.7, 0.4),
            entry(1.0, 0.6, 0.3, 0.0),
        ],
        "bozo" => vec![
            entry(0.4, 1.0, 1.0, 1.0),
            entry(0.4, 0.0, 1.0, 0.0),
            entry(0.6, 0.0, 1.0, 0.0),
            entry(0.6, 0.0, 0.0, 1.0),
            entry(0.8, 0.0, 0.0, 1.0),
            entry(0.8, 1.0, 0.0, 0.0),
        ],
        "mandel" => vec![
            entry(0.001, 0.0, 0.0, 0.0),
            entry(0.001, 1.0, 0.0, 1.0),
            entry(0.015, 1.0, 0.0, 1.0),
            entry(0.1, 0.0, 1.0, 1.0),
        ],
        "marble" => {
            vec![entry(0.0, 0.9, 0.8, 0.8), entry(0.9, 0.9, 0.08, 0.08), entry(0.9, 0.0, 0.0, 0.0)]
        }
        "wood" => vec![
            entry(0.0, 0.666, 0.312, 0.2),
            entry(0.6, 0.666, 0.312, 0.2),
            entry(0.6, 0.4, 0.1333, 0.066),
            entry(1.0, 0.4, 0.1333, 0.066),
        ],
        "radial" => vec![
            entry(0.0, 0.0, 1.0, 1.0),
            entry(0.333, 1.0, 1.0, 0.0),
            entry(0.666, 1.0, 0.0, 1.0),
            entry(1.0, 0.0, 1.0, 1.0),
        ],
        _ => vec![entry(0.0, 0.0, 0.0, 0.0), entry(1.0, 1.0, 1.0, 1.0)],
    }
}
